/* Drawings whose lines nearly close, and the way round a region. */
#include "src/core/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "cairn/edge_chain.h"
#include "src/host/shape_image_work.h"

/* More loose ends than these are no drawing of an outline. */
enum { ENDS_MOST = 256, SMOOTH = 2 };

/* ---- Loose ends ---- */

/* Thins the ink and follows its lines; their loose ends. */
static cairn_status find_ends(const shape_picture *p, cairn_edge_chain_set *set,
                              cairn_edge_pixel *ends, int32_t *count)
{
    cairn_raster_u8_view view = {p->ink, p->width, p->height, p->width};
    cairn_budget budget = {0};
    cairn_edge_chain_result r;
    cairn_status status = cairn_edge_chain_begin(set, view);

    for (; status == CAIRN_OK || status == CAIRN_MORE;) {
        budget.left = INT32_MAX;
        status = cairn_edge_chain_step(set, &budget);
        if (status == CAIRN_OK)
            break;
    }
    if (status != CAIRN_OK)
        return status;
    r = cairn_edge_chain_read(set);
    for (int32_t i = 0; i < r.chain_count; i++) {
        const cairn_edge_chain *c = &r.chains[i];

        if (*count + 2 > ENDS_MOST)
            return cairn_file_error_set(
                p->error, CAIRN_BAD_FORMAT, p->path, 0,
                "more than %d loose ends of lines, expected a drawing of one outline",
                ENDS_MOST - 2);
        if (c->from == CAIRN_EDGE_OPEN)
            ends[(*count)++] = r.pixels[c->first];
        if (c->to == CAIRN_EDGE_OPEN)
            ends[(*count)++] = r.pixels[c->first + c->count - 1];
    }
    return CAIRN_OK;
}

static void draw_line(shape_picture *p, cairn_edge_pixel a, cairn_edge_pixel b)
{
    int32_t dx = b.x - a.x, dy = b.y - a.y, steps = abs(dx) > abs(dy) ? abs(dx) : abs(dy);

    for (int32_t i = 0; i <= steps; i++) {
        int32_t x = a.x + (int32_t)lrint((double)dx * i / (steps > 0 ? steps : 1));
        int32_t y = a.y + (int32_t)lrint((double)dy * i / (steps > 0 ? steps : 1));

        p->ink[y * p->width + x] = 1;
    }
}

/* gaps: [CAIRN_SHAPE_GAPS] the middles of the first ones that are joined, without the ink's
 * frame of one pixel. */
static int32_t join_ends(shape_picture *p, cairn_edge_pixel *ends, int32_t count, double reach,
                         cairn_vec2 *gaps)
{
    int32_t joined = 0;

    for (;;) {
        double nearest = reach;
        int32_t first = -1, second = -1;

        for (int32_t i = 0; i < count; i++)
            for (int32_t k = i + 1; k < count; k++) {
                double gap = hypot((double)ends[i].x - ends[k].x, (double)ends[i].y - ends[k].y);

                if (gap <= nearest && (first < 0 || gap < nearest)) {
                    nearest = gap;
                    first = i;
                    second = k;
                }
            }
        if (first < 0)
            return joined;
        draw_line(p, ends[first], ends[second]);
        if (joined < CAIRN_SHAPE_GAPS) {
            gaps[joined].x = (cairn_real)(ends[first].x + ends[second].x) / 2 - 1;
            gaps[joined].y = (cairn_real)(ends[first].y + ends[second].y) / 2 - 1;
        }
        joined++;
        ends[second] = ends[--count];
        ends[first] = ends[--count];
    }
}

cairn_status cairn_shape_image_join(shape_picture *p, double reach, cairn_shape_image *image)
{
    cairn_edge_chain_params params = cairn_edge_chain_default();
    cairn_edge_pixel ends[ENDS_MOST];
    cairn_edge_chain_set *set;
    int32_t count = 0, edges = 0;
    cairn_status status;
    cairn_pool pool;
    void *memory;
    size_t bytes;

    for (int32_t i = 0; i < p->width * p->height; i++)
        edges += p->ink[i];
    params.max_width = p->width;
    params.max_height = p->height;
    params.max_edges = edges > 0 ? edges : 1;
    params.max_chains = params.max_edges;
    params.min_length = 2;
    bytes = cairn_edge_chain_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    if (memory == NULL)
        return cairn_file_error_system(p->error, p->path, "trace", ENOMEM);
    status = cairn_pool_init(&pool, memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_edge_chain_create(&set, &pool, &params);
    if (status == CAIRN_OK)
        status = find_ends(p, set, ends, &count);
    free(memory);
    image->joined = status == CAIRN_OK ? join_ends(p, ends, count, reach, image->gaps) : 0;
    return status;
}

/* ---- The way round ---- */

/* A corner of pixels, and the way on from it: 0 east, 1 south, 2 west, 3 north; the region lies
 * to the right. */
typedef struct crack {
    int32_t x, y, heading;
} crack;

static int is_region(const shape_picture *p, const int32_t *labels, int32_t label, int32_t x,
                     int32_t y)
{
    return x >= 0 && y >= 0 && x < p->width && y < p->height && labels[y * p->width + x] == label;
}

static crack go_on(const shape_picture *p, const int32_t *labels, int32_t label, int32_t corners,
                   crack c)
{
    static const int8_t ahead[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    /* The pixels that touch a corner on the right and on the left of the way on. */
    static const int8_t right[4][2] = {{0, 0}, {-1, 0}, {-1, -1}, {0, -1}};
    int32_t h = c.heading, left = (h + 3) % 4, is_right, is_left;

    c.x += ahead[h][0];
    c.y += ahead[h][1];
    is_right = is_region(p, labels, label, c.x + right[h][0], c.y + right[h][1]);
    is_left = is_region(p, labels, label, c.x + right[left][0], c.y + right[left][1]);
    if (corners)
        c.heading = is_left ? left : is_right ? h : (h + 1) % 4;
    else
        c.heading = !is_right ? (h + 1) % 4 : is_left ? left : h;
    return c;
}

static void smooth(cairn_vec2 *points, int32_t count)
{
    cairn_vec2 *even = malloc((size_t)count * sizeof *even);

    if (even == NULL || count <= 2 * SMOOTH + 1) {
        free(even);
        return;
    }
    for (int32_t i = 0; i < count; i++) {
        even[i].x = even[i].y = 0;
        for (int32_t k = -SMOOTH; k <= SMOOTH; k++)
            even[i] = cairn_vec2_add(even[i], points[(i + k + count) % count]);
        even[i] = cairn_vec2_scale(even[i], CAIRN_REAL(1.0) / (2 * SMOOTH + 1));
    }
    for (int32_t i = 0; i < count; i++)
        points[i] = even[i];
    free(even);
}

int32_t cairn_shape_image_outline(const shape_picture *p, const int32_t *labels, int32_t label,
                                  int32_t corners, int32_t first, cairn_vec2 *points)
{
    static const double half_x[4] = {0.5, 0, -0.5, 0}, half_y[4] = {0, 0.5, 0, -0.5};
    crack start = {first % p->width, first / p->width, 0}, at = start;
    int32_t count = 0;

    do {
        /* A corner lies half a pixel before the middle of its pixel, and the rim shifts by one. */
        if (points != NULL) {
            points[count].x = (cairn_real)(at.x + half_x[at.heading] - 1.5);
            points[count].y = (cairn_real)(at.y + half_y[at.heading] - 1.5);
        }
        count++;
        at = go_on(p, labels, label, corners, at);
    } while (at.x != start.x || at.y != start.y || at.heading != start.heading);
    if (points != NULL)
        smooth(points, count);
    return count;
}
