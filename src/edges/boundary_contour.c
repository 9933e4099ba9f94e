/* Contour tracing along the pixel sides between regions, and ranking.
 *
 * Method:
 * 1. From each junction or end at the image's border, every untraced side is followed to the next
 *    such corner.
 * 2. The remaining sides form closed contours.
 * 3. A contour takes the ultrametric level of its border, and the mean edge strength of the
 *    stronger of the two pixels of each side.
 * 4. Heap sort by strength. */
#include "src/base/build.h"

#include "src/containers/heap.h"
#include "src/edges/boundary_work.h"

enum { HEADING_RIGHT, HEADING_DOWN, HEADING_LEFT, HEADING_UP, HEADING_COUNT };
enum { TRACED_ABOVE = 1, TRACED_LEFT = 2 };

/* A pixel side that starts at a corner. */
typedef struct side {
    int32_t pixel, other; /* Its two pixels: `pixel` is below the side or right of it. */
    uint8_t walked;       /* Its flag in traced_sides[pixel]. */
} side;

/* Finds the pixel side from a corner in a heading; returns 0 if it does not lie between two
 * pixels of the image. */
static int pixel_side(const cairn_boundary *boundary, int32_t x, int32_t y, int32_t heading,
                      side *s)
{
    int32_t width = boundary->image.width;

    x -= heading == HEADING_LEFT;
    y -= heading == HEADING_UP;
    if (x < 0 || y < 0 || x >= width || y >= boundary->image.height)
        return 0;
    s->pixel = y * width + x;
    if (heading == HEADING_RIGHT || heading == HEADING_LEFT) {
        s->other = s->pixel - width;
        s->walked = TRACED_ABOVE;
        return y > 0;
    }
    s->other = s->pixel - 1;
    s->walked = TRACED_LEFT;
    return x > 0;
}

/* Returns whether the pixel side from a corner in a heading is on a border between two regions. */
static int is_border(const cairn_boundary *boundary, int32_t x, int32_t y, int32_t heading, side *s)
{
    return pixel_side(boundary, x, y, heading, s) &&
           boundary->label[s->pixel] != boundary->label[s->other];
}

/* Returns the number of border sides that meet at a corner. */
static int32_t border_sides_at(const cairn_boundary *boundary, int32_t x, int32_t y)
{
    int32_t count = 0;
    side s;

    for (int32_t heading = 0; heading < HEADING_COUNT; heading++)
        count += is_border(boundary, x, y, heading, &s);
    return count;
}

/* ---- Tracing ---- */

/* Appends the current corner. More than max_corners end the tracing. */
static void add_corner(cairn_boundary *boundary)
{
    if (boundary->corner_count == boundary->params.max_corners) {
        boundary->outcome = CAIRN_FULL;
        boundary->trace.is_open = 0;
        return;
    }
    boundary->corners[boundary->corner_count].x = (int16_t)boundary->trace.x;
    boundary->corners[boundary->corner_count++].y = (int16_t)boundary->trace.y;
}

/* Sets the start of a contour at the scanned corner; returns 0 if there is none. */
static int find_start(cairn_boundary *boundary)
{
    int32_t sides = border_sides_at(boundary, boundary->trace.scan_x, boundary->trace.scan_y);
    side s;

    if (boundary->trace.is_closed_pass ? sides != 2 : sides == 2)
        return 0;
    for (int32_t heading = 0; heading < HEADING_COUNT; heading++)
        if (is_border(boundary, boundary->trace.scan_x, boundary->trace.scan_y, heading, &s) &&
            !(boundary->traced_sides[s.pixel] & s.walked)) {
            boundary->trace.heading = heading;
            boundary->trace.x = boundary->trace.scan_x;
            boundary->trace.y = boundary->trace.scan_y;
            return 1;
        }
    return 0;
}

/* Advances the scanned corner in row order, and once more for closed contours; returns 0 at the
 * end. */
static int next_corner(cairn_boundary *boundary)
{
    if (++boundary->trace.scan_x <= boundary->image.width)
        return 1;
    boundary->trace.scan_x = 0;
    if (++boundary->trace.scan_y <= boundary->image.height)
        return 1;
    boundary->trace.scan_y = 0;
    return !boundary->trace.is_closed_pass++;
}

/* Finds the next side of the traced contour. */
static void side_ahead(const cairn_boundary *boundary, side *s)
{
    int there =
        is_border(boundary, boundary->trace.x, boundary->trace.y, boundary->trace.heading, s);

    CAIRN_ASSERT(there);
    (void)there;
}

/* Begins a contour at the current corner. */
static void begin_trace(cairn_boundary *boundary)
{
    cairn_boundary_contour none = {
        .first = boundary->corner_count,
        .closed = boundary->trace.is_closed_pass,
    };
    side s;

    CAIRN_ASSERT(boundary->contour_count <
                 BOUNDARY_BORDERS_PER_REGION * boundary->params.max_regions);
    side_ahead(boundary, &s);
    none.level = boundary
                     ->borders[cairn_boundary_border_of(boundary, boundary->label[s.pixel],
                                                        boundary->label[s.other])]
                     .level;
    boundary->traced[boundary->contour_count] = none;
    boundary->trace.strength_sum = 0;
    boundary->trace.is_open = 1;
    add_corner(boundary);
}

/* Completes a contour; contours below min_strength are dropped. */
static void end_trace(cairn_boundary *boundary)
{
    cairn_boundary_contour *c = &boundary->traced[boundary->contour_count];

    boundary->trace.is_open = 0;
    c->count = boundary->corner_count - c->first;
    c->mean_strength =
        boundary->trace.strength_sum / (cairn_real)(c->closed ? c->count : c->count - 1);
    c->strength = c->level * cairn_sqrt(c->mean_strength);
    if (c->strength >= boundary->params.min_strength)
        boundary->contour_count++;
    else
        boundary->corner_count = c->first;
}

/* Sets the heading of the contour at a corner where exactly two border sides meet. */
static void continue_border(cairn_boundary *boundary)
{
    int32_t back = (boundary->trace.heading + 2) % HEADING_COUNT;
    side s;

    for (int32_t heading = 0; heading < HEADING_COUNT; heading++)
        if (heading != back &&
            is_border(boundary, boundary->trace.x, boundary->trace.y, heading, &s)) {
            boundary->trace.heading = heading;
            return;
        }
}

/* Appends the corner at the end of a side, and ends the contour or turns it there. */
static void pass_corner(cairn_boundary *boundary)
{
    add_corner(boundary);
    if (boundary->outcome != CAIRN_OK)
        return;
    if (border_sides_at(boundary, boundary->trace.x, boundary->trace.y) != 2)
        end_trace(boundary);
    else
        continue_border(boundary);
}

/* Traces one side of the current contour. */
static void trace_side(cairn_boundary *boundary)
{
    side s;

    side_ahead(boundary, &s);
    boundary->traced_sides[s.pixel] |= s.walked;
    boundary->trace.strength_sum +=
        cairn_max(boundary->strength[s.pixel], boundary->strength[s.other]);
    boundary->trace.x +=
        (boundary->trace.heading == HEADING_RIGHT) - (boundary->trace.heading == HEADING_LEFT);
    boundary->trace.y +=
        (boundary->trace.heading == HEADING_DOWN) - (boundary->trace.heading == HEADING_UP);
    if (boundary->trace.is_closed_pass && boundary->trace.x == boundary->trace.scan_x &&
        boundary->trace.y == boundary->trace.scan_y)
        end_trace(boundary);
    else
        pass_corner(boundary);
}

int cairn_boundary_trace(cairn_boundary *boundary, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(boundary->phase_resume);
    boundary->trace.scan_x = boundary->trace.scan_y = boundary->trace.is_closed_pass = 0;
    do {
        CAIRN_STEP_CHARGE(boundary, phase_resume, budget, 1);
        while (find_start(boundary)) {
            begin_trace(boundary);
            while (boundary->trace.is_open) {
                CAIRN_STEP_CHARGE(boundary, phase_resume, budget, 1);
                trace_side(boundary);
            }
            if (boundary->outcome != CAIRN_OK)
                break;
            CAIRN_STEP_CHARGE(boundary, phase_resume, budget, 1);
        }
    } while (boundary->outcome == CAIRN_OK && next_corner(boundary));
    CAIRN_STEP_END(boundary->phase_resume);
}

/* ---- Ranking ---- */

/* Ties: the contour found first ranks before the other. */
static int ranks_before(const void *context, int32_t a, int32_t b)
{
    const cairn_boundary *boundary = context;
    int32_t p = boundary->heap[a], q = boundary->heap[b];

    return boundary->traced[p].strength > boundary->traced[q].strength ||
           (p < q && boundary->traced[p].strength >= boundary->traced[q].strength);
}

static void exchange(void *context, int32_t a, int32_t b)
{
    const cairn_boundary *boundary = context;
    int32_t moved = boundary->heap[a];

    boundary->heap[a] = boundary->heap[b];
    boundary->heap[b] = moved;
}

/* Inserts the next contour into the heap. */
static void push_contour(cairn_boundary *boundary)
{
    boundary->heap[boundary->heap_count] = boundary->heap_count;
    heap_sift_up(boundary, boundary->heap_count++, ranks_before, exchange);
}

/* Moves the strongest contour from the heap to the result. */
static void rank_strongest(cairn_boundary *boundary)
{
    boundary->ranked[boundary->ranked_count++] = boundary->traced[boundary->heap[0]];
    heap_pop(boundary, boundary->heap_count--, ranks_before, exchange);
}

int cairn_boundary_rank(cairn_boundary *boundary, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(boundary->phase_resume);
    boundary->heap_count = 0;
    while (boundary->heap_count < boundary->contour_count) {
        CAIRN_STEP_CHARGE(boundary, phase_resume, budget, 1);
        push_contour(boundary);
    }
    while (boundary->heap_count > 0) {
        CAIRN_STEP_CHARGE(boundary, phase_resume, budget, 1);
        rank_strongest(boundary);
    }
    CAIRN_STEP_CHARGE(boundary, phase_resume, budget, 1);
    CAIRN_STEP_END(boundary->phase_resume);
}
