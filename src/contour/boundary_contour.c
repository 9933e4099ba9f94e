/* Contours: walks along the sides of pixels that part regions, ranked.
 *
 * Method: from each corner where other than two such sides meet (a junction, or an end at the
 * image's border) walks go along each side that was not walked yet, to the next such corner;
 * what is left after that are closed contours. A contour takes the level of its border, and the
 * mean of the stronger pixels beside it. */
#include "src/core/build.h"

#include "src/contour/boundary_work.h"

enum { RIGHT, DOWN, LEFT, UP, HEADINGS };
enum { WALKED_ABOVE = 1, WALKED_LEFT = 2 };

/* A side of pixels that goes out from a corner. */
typedef struct side {
    int32_t pixel, other; /* its two pixels: `pixel` is below it or right of it */
    uint8_t walked;       /* its flag there */
} side;

/* 0: no side between two pixels of the image. */
static int side_from(const cairn_boundary *b, int32_t x, int32_t y, int32_t heading, side *s)
{
    int32_t width = b->image.width;

    x -= heading == LEFT;
    y -= heading == UP;
    if (x < 0 || y < 0 || x >= width || y >= b->image.height)
        return 0;
    s->pixel = y * width + x;
    if (heading == RIGHT || heading == LEFT) {
        s->other = s->pixel - width;
        s->walked = WALKED_ABOVE;
        return y > 0;
    }
    s->other = s->pixel - 1;
    s->walked = WALKED_LEFT;
    return x > 0;
}

static int parts(const cairn_boundary *b, int32_t x, int32_t y, int32_t heading, side *s)
{
    return side_from(b, x, y, heading, s) && b->label[s->pixel] != b->label[s->other];
}

static int32_t sides_at(const cairn_boundary *b, int32_t x, int32_t y)
{
    int32_t count = 0;
    side s;

    for (int32_t heading = 0; heading < HEADINGS; heading++)
        count += parts(b, x, y, heading, &s);
    return count;
}

/* ---- Walks ---- */

static cairn_status add_corner(cairn_boundary *b)
{
    if (b->corner_count == b->params.max_points)
        return CAIRN_FULL;
    b->corners[b->corner_count].x = (int16_t)b->x;
    b->corners[b->corner_count++].y = (int16_t)b->y;
    return CAIRN_OK;
}

/* A walk from the corner at hand; 0: there is none. */
static int start(cairn_boundary *b)
{
    int32_t sides = sides_at(b, b->from_x, b->from_y);
    side s;

    if (b->loops ? sides != 2 : sides == 2)
        return 0;
    for (int32_t heading = 0; heading < HEADINGS; heading++)
        if (parts(b, b->from_x, b->from_y, heading, &s) && !(b->walked[s.pixel] & s.walked)) {
            b->heading = heading;
            b->x = b->from_x;
            b->y = b->from_y;
            return 1;
        }
    return 0;
}

/* The corner that the next walk is looked for at: row by row, and again for closed contours. */
static int next_corner(cairn_boundary *b)
{
    if (++b->from_x <= b->image.width)
        return 1;
    b->from_x = 0;
    if (++b->from_y <= b->image.height)
        return 1;
    b->from_y = 0;
    return !b->loops++;
}

/* The side that the walk goes along next. */
static void side_ahead(const cairn_boundary *b, side *s)
{
    int there = parts(b, b->x, b->y, b->heading, s);

    CAIRN_ASSERT(there);
    (void)there;
}

static cairn_status begin_walk(cairn_boundary *b)
{
    cairn_boundary_contour none = {b->corner_count, 0, b->loops, 0, 0, 0};
    side s;

    CAIRN_ASSERT(b->contour_count < b->max_borders);
    side_ahead(b, &s);
    none.level =
        b->borders[cairn_boundary_border_of(b, b->label[s.pixel], b->label[s.other])].level;
    b->found[b->contour_count] = none;
    b->walk_sum = 0;
    b->walking = 1;
    return add_corner(b);
}

/* Weak contours are dropped again. */
static void end_walk(cairn_boundary *b)
{
    cairn_boundary_contour *c = &b->found[b->contour_count];

    b->walking = 0;
    c->count = b->corner_count - c->first;
    c->mean = b->walk_sum / (cairn_real)(c->closed ? c->count : c->count - 1);
    c->strength = c->level * cairn_sqrt(c->mean);
    if (c->strength >= b->params.min_strength)
        b->contour_count++;
    else
        b->corner_count = c->first;
}

/* Where the contour goes on at a corner where just two sides meet. */
static void turn(cairn_boundary *b)
{
    int32_t back = (b->heading + 2) % HEADINGS;
    side s;

    for (int32_t heading = 0; heading < HEADINGS; heading++)
        if (heading != back && parts(b, b->x, b->y, heading, &s)) {
            b->heading = heading;
            return;
        }
}

static cairn_status walk(cairn_boundary *b)
{
    cairn_status status;
    side s;

    side_ahead(b, &s);
    b->walked[s.pixel] |= s.walked;
    b->walk_sum += cairn_max(b->one[s.pixel], b->one[s.other]);
    b->x += (b->heading == RIGHT) - (b->heading == LEFT);
    b->y += (b->heading == DOWN) - (b->heading == UP);
    if (b->loops && b->x == b->from_x && b->y == b->from_y) {
        end_walk(b);
        return CAIRN_MORE;
    }
    status = add_corner(b);
    if (status != CAIRN_OK)
        return status;
    if (sides_at(b, b->x, b->y) != 2)
        end_walk(b);
    else
        turn(b);
    return CAIRN_MORE;
}

cairn_status cairn_boundary_trace_side(cairn_boundary *b)
{
    if (b->walking)
        return walk(b);
    if (start(b)) {
        cairn_status status = begin_walk(b);

        return status == CAIRN_OK ? CAIRN_MORE : status;
    }
    return next_corner(b) ? CAIRN_MORE : CAIRN_OK;
}

/* ---- Ranks ---- */

/* Of two equal contours the one found first. */
static int ahead(const cairn_boundary *b, int32_t p, int32_t q)
{
    return b->found[p].strength > b->found[q].strength ||
           (p < q && b->found[p].strength >= b->found[q].strength);
}

static void rise(const cairn_boundary *b, int32_t contour)
{
    int32_t at = contour;

    for (; at > 0 && ahead(b, contour, b->heap[(at - 1) / 2]); at = (at - 1) / 2)
        b->heap[at] = b->heap[(at - 1) / 2];
    b->heap[at] = contour;
}

static void sink(const cairn_boundary *b, int32_t contour)
{
    int32_t at = 0;

    for (int32_t child = 1; child < b->heap_count; child = 2 * at + 1) {
        child += child + 1 < b->heap_count && ahead(b, b->heap[child + 1], b->heap[child]);
        if (!ahead(b, b->heap[child], contour))
            break;
        b->heap[at] = b->heap[child];
        at = child;
    }
    b->heap[at] = contour;
}

int cairn_boundary_rank_next(cairn_boundary *b)
{
    if (b->ranked_count == 0 && b->heap_count < b->contour_count) {
        rise(b, b->heap_count++);
        return 1;
    }
    if (b->heap_count == 0)
        return 0;
    b->ranked[b->ranked_count++] = b->found[b->heap[0]];
    if (--b->heap_count > 0)
        sink(b, b->heap[b->heap_count]);
    return 1;
}
