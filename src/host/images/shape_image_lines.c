/* Gap bridging in line drawings, and boundary tracing of regions. shape_image.c describes the
 * method. */
#include "src/base/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "cairn/edge_chain.h"
#include "src/host/base/interruption.h"
#include "src/host/images/shape_image_work.h"

/* Maximum number of open line ends of a drawing; half width of the smoothing window in points. */
enum { MAX_OPEN_ENDS = 256, SMOOTHING_RADIUS = 2 };

/* ---- Open line ends ---- */

/* Thins the ink, follows its lines as edge chains, and returns their open ends. */
static cairn_status find_open_ends(const shape_picture *picture, cairn_edge_chain_set *set,
                                   cairn_edge_chain_pixel *ends, int32_t *count)
{
    cairn_raster_u8_view view = {.data = picture->ink,
                                 .width = picture->width,
                                 .height = picture->height,
                                 .stride = picture->width};
    cairn_budget budget = {0};
    cairn_edge_chain_result result;
    cairn_status status = cairn_edge_chain_begin(set, view);

    for (; status == CAIRN_OK || status == CAIRN_MORE;) {
        budget.left = CAIRN_INTERRUPTION_UNITS;
        status = cairn_edge_chain_step(set, &budget);
        if (status == CAIRN_OK || cairn_interruption_is_requested())
            break;
    }
    if (status != CAIRN_OK)
        return status;
    result = cairn_edge_chain_read(set);
    for (int32_t i = 0; i < result.chain_count; i++) {
        const cairn_edge_chain *chain = &result.chains[i];

        if (*count + 2 > MAX_OPEN_ENDS)
            return cairn_file_error_set(
                picture->error, CAIRN_BAD_FORMAT, picture->path, 0,
                "more than %d open line ends, expected a drawing of one outline",
                MAX_OPEN_ENDS - 2);
        if (chain->from == CAIRN_EDGE_CHAIN_OPEN)
            ends[(*count)++] = result.pixels[chain->first];
        if (chain->to == CAIRN_EDGE_CHAIN_OPEN)
            ends[(*count)++] = result.pixels[chain->first + chain->count - 1];
    }
    return CAIRN_OK;
}

/* Draws a line of ink between two pixels. */
static void draw_line(shape_picture *picture, cairn_edge_chain_pixel a, cairn_edge_chain_pixel b)
{
    int32_t dx = b.x - a.x, dy = b.y - a.y, steps = abs(dx) > abs(dy) ? abs(dx) : abs(dy);

    for (int32_t i = 0; i <= steps; i++) {
        int32_t x = a.x + (int32_t)lrint((double)dx * i / (steps > 0 ? steps : 1));
        int32_t y = a.y + (int32_t)lrint((double)dy * i / (steps > 0 ? steps : 1));

        picture->ink[y * picture->width + x] = 1;
    }
}

/* Bridges the closest pair of open ends until none is within `reach`; returns the number of
 * bridges. gaps: [CAIRN_SHAPE_MODEL_MAX_GAPS] centres of the first ones, without the border of one
 * pixel. */
static int32_t bridge_gaps(shape_picture *picture, cairn_edge_chain_pixel *ends, int32_t count,
                           double reach, cairn_vec2 *gaps)
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
        draw_line(picture, ends[first], ends[second]);
        if (joined < CAIRN_SHAPE_MODEL_MAX_GAPS) {
            gaps[joined].x = (cairn_real)(ends[first].x + ends[second].x) / 2 - 1;
            gaps[joined].y = (cairn_real)(ends[first].y + ends[second].y) / 2 - 1;
        }
        joined++;
        ends[second] = ends[--count];
        ends[first] = ends[--count];
    }
}

cairn_status cairn_shape_image_join(shape_picture *picture, double reach, cairn_shape_image *image)
{
    cairn_edge_chain_params params = cairn_edge_chain_default();
    cairn_edge_chain_pixel ends[MAX_OPEN_ENDS];
    cairn_edge_chain_set *set;
    int32_t count = 0, edges = 0;
    cairn_status status;
    cairn_pool pool;
    void *memory;
    size_t bytes;

    for (int32_t i = 0; i < picture->width * picture->height; i++)
        edges += picture->ink[i];
    params.max_width = picture->width;
    params.max_height = picture->height;
    params.max_edges = edges > 0 ? edges : 1;
    params.max_chains = params.max_edges;
    params.min_length = 2;
    bytes = cairn_edge_chain_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    if (memory == NULL)
        return cairn_file_error_system(picture->error, picture->path, "trace", ENOMEM);
    status = cairn_pool_init(&pool, memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_edge_chain_create(&set, &pool, &params);
    if (status == CAIRN_OK)
        status = find_open_ends(picture, set, ends, &count);
    free(memory);
    image->bridged_gaps =
        status == CAIRN_OK ? bridge_gaps(picture, ends, count, reach, image->gaps) : 0;
    return status;
}

/* ---- Boundary tracing ---- */

/* A pixel corner and the direction of the next crack: 0 east, 1 south, 2 west, 3 north. The region
 * is on the right. */
typedef struct crack {
    int32_t x, y, heading;
} crack;

static int is_region(const shape_picture *picture, const int32_t *labels, int32_t label, int32_t x,
                     int32_t y)
{
    return x >= 0 && y >= 0 && x < picture->width && y < picture->height &&
           labels[y * picture->width + x] == label;
}

/* Advances along the region's boundary by one crack. */
static crack next_crack(const shape_picture *picture, const int32_t *labels, int32_t label,
                        int32_t corners, crack at)
{
    static const int8_t ahead[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    /* The pixels at a corner to the right and to the left of the direction. */
    static const int8_t right[4][2] = {{0, 0}, {-1, 0}, {-1, -1}, {0, -1}};
    int32_t h = at.heading, left = (h + 3) % 4, is_right, is_left;

    at.x += ahead[h][0];
    at.y += ahead[h][1];
    is_right = is_region(picture, labels, label, at.x + right[h][0], at.y + right[h][1]);
    is_left = is_region(picture, labels, label, at.x + right[left][0], at.y + right[left][1]);
    if (corners)
        at.heading = is_left ? left : is_right ? h : (h + 1) % 4;
    else
        at.heading = !is_right ? (h + 1) % 4 : is_left ? left : h;
    return at;
}

/* Smooths a closed outline by a moving average; leaves it unchanged when it is short or memory is
 * missing. */
static void smooth_outline(cairn_vec2 *points, int32_t count)
{
    cairn_vec2 *averaged = malloc((size_t)count * sizeof *averaged);

    if (averaged == NULL || count <= 2 * SMOOTHING_RADIUS + 1) {
        free(averaged);
        return;
    }
    for (int32_t i = 0; i < count; i++) {
        averaged[i].x = averaged[i].y = 0;
        for (int32_t k = -SMOOTHING_RADIUS; k <= SMOOTHING_RADIUS; k++)
            averaged[i] = cairn_vec2_add(averaged[i], points[(i + k + count) % count]);
        averaged[i] = cairn_vec2_scale(averaged[i], CAIRN_REAL(1.0) / (2 * SMOOTHING_RADIUS + 1));
    }
    for (int32_t i = 0; i < count; i++)
        points[i] = averaged[i];
    free(averaged);
}

int32_t cairn_shape_image_outline(const shape_picture *picture, const int32_t *labels,
                                  int32_t label, int32_t corners, int32_t first, cairn_vec2 *points)
{
    static const double half_x[4] = {0.5, 0, -0.5, 0}, half_y[4] = {0, 0.5, 0, -0.5};
    crack start = {first % picture->width, first / picture->width, 0}, at = start;
    int32_t count = 0;

    do {
        /* A corner is half a pixel before its pixel's centre, and the border shifts by one. */
        if (points != NULL) {
            points[count].x = (cairn_real)(at.x + half_x[at.heading] - 1.5);
            points[count].y = (cairn_real)(at.y + half_y[at.heading] - 1.5);
        }
        count++;
        at = next_crack(picture, labels, label, corners, at);
    } while (at.x != start.x || at.y != start.y || at.heading != start.heading);
    if (points != NULL)
        smooth_outline(points, count);
    return count;
}
