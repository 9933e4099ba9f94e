/* Gap bridging in line drawings. silhouette.c describes the method. */
#include "src/base/build.h"

#include "cairn/real.h"
#include "src/edges/silhouette_work.h"

/* Chains, pairs of ends, and pixels of a line for one work unit. */
enum { CHAINS_PER_UNIT = 8, PAIRS_PER_UNIT = 8, LINE_PIXELS_PER_UNIT = 4 };

/* ---- Open line ends ---- */

static void begin_lines(cairn_silhouette *s)
{
    cairn_raster_u8_view view = {s->ink, s->width, s->height, s->width};

    if (s->measure.ink > s->params.max_ink)
        silhouette_refuse(s, CAIRN_SILHOUETTE_INK, CAIRN_FULL);
    else
        cairn_must_be_ok(cairn_edge_chain_begin(s->lines, view));
}

/* Runs the extraction of lines. Their capacities suffice for the ink. */
static int find_lines(cairn_silhouette *s, cairn_budget *budget)
{
    cairn_status status = cairn_edge_chain_step(s->lines, budget);

    CAIRN_ASSERT(status == CAIRN_OK || status == CAIRN_MORE);
    return status == CAIRN_OK;
}

/* Collects the open ends of the next chains. */
static void collect_ends(cairn_silhouette *s)
{
    cairn_edge_chain_result lines = cairn_edge_chain_read(s->lines);
    int32_t left = lines.chain_count - s->cursor,
            end = s->cursor + (left < CHAINS_PER_UNIT ? left : CHAINS_PER_UNIT);

    for (int32_t i = s->cursor; i < end && s->status == CAIRN_MORE; i++) {
        const cairn_edge_chain *chain = &lines.chains[i];

        if (chain->from == CAIRN_EDGE_CHAIN_OPEN)
            s->ends[s->end_count++] = lines.pixels[chain->first];
        if (chain->to == CAIRN_EDGE_CHAIN_OPEN)
            s->ends[s->end_count++] = lines.pixels[chain->first + chain->count - 1];
        if (s->end_count > CAIRN_SILHOUETTE_MAX_OPEN_ENDS)
            silhouette_refuse(s, CAIRN_SILHOUETTE_OPEN_ENDS, CAIRN_BAD_FORMAT);
    }
}

/* ---- Bridges ---- */

/* Compares the pairs of end `cursor` and a later one with the closest pair so far. */
static void compare_ends(cairn_silhouette *s)
{
    const cairn_edge_chain_pixel *a = &s->ends[s->cursor];

    for (int32_t k = s->cursor + 1; k < s->end_count; k++) {
        int32_t dx = a->x - s->ends[k].x, dy = a->y - s->ends[k].y, squared = dx * dx + dy * dy;

        if (s->gap_squared < 0 || squared < s->gap_squared) {
            s->gap_squared = squared;
            s->gap_ends[0] = s->cursor;
            s->gap_ends[1] = k;
        }
    }
}

/* 1 when the closest pair is close enough. */
static int has_gap(const cairn_silhouette *s)
{
    return s->gap_squared >= 0 &&
           cairn_sqrt((cairn_real)s->gap_squared) <=
               s->params.max_gap * cairn_sqrt((cairn_real)silhouette_squared_diagonal(s));
}

/* Pixels from one end of the gap to the other. */
static int32_t gap_steps(const cairn_silhouette *s)
{
    const cairn_edge_chain_pixel *a = &s->ends[s->gap_ends[0]], *b = &s->ends[s->gap_ends[1]];
    int32_t dx = a->x < b->x ? b->x - a->x : a->x - b->x,
            dy = a->y < b->y ? b->y - a->y : a->y - b->y;

    return dx > dy ? dx : dy;
}

/* part / whole, rounded to the nearest integer, to the even one of two. */
static int32_t rounded_quotient(int32_t part, int32_t whole)
{
    int32_t size = part < 0 ? -part : part, quotient = size / whole, twice = 2 * (size % whole);

    quotient += twice > whole || (twice == whole && quotient % 2 == 1);
    return part < 0 ? -quotient : quotient;
}

/* Draws a line of ink across the gap, stores its centre and removes both ends. */
static void bridge_gap(cairn_silhouette *s)
{
    int32_t first = s->gap_ends[0], second = s->gap_ends[1], steps = gap_steps(s);
    cairn_edge_chain_pixel a = s->ends[first], b = s->ends[second];
    cairn_vec2 *centre = &s->gaps[s->gap_count++];

    for (int32_t i = 1; i < steps; i++) {
        int32_t x = a.x + rounded_quotient((b.x - a.x) * i, steps);
        int32_t y = a.y + rounded_quotient((b.y - a.y) * i, steps);

        s->ink[y * s->width + x] = 1;
    }
    /* Without the border of one pixel. */
    centre->x = (cairn_real)(a.x + b.x) / 2 - 1;
    centre->y = (cairn_real)(a.y + b.y) / 2 - 1;
    s->ends[second] = s->ends[--s->end_count];
    s->ends[first] = s->ends[--s->end_count];
}

int cairn_silhouette_bridge(cairn_silhouette *s, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(s->phase_resume);
    begin_lines(s);
    if (s->status == CAIRN_MORE) {
        CAIRN_STEP_RUN(s, phase_resume, budget, find_lines);
        for (s->cursor = 0;
             s->cursor < cairn_edge_chain_read(s->lines).chain_count && s->status == CAIRN_MORE;
             s->cursor += CHAINS_PER_UNIT) {
            CAIRN_STEP_CHARGE_UNIT(s, phase_resume, budget);
            collect_ends(s);
        }
    }
    while (s->status == CAIRN_MORE) {
        s->gap_squared = -1;
        for (s->cursor = 0; s->cursor < s->end_count; s->cursor++) {
            CAIRN_STEP_CHARGE(s, phase_resume, budget,
                              1 + (s->end_count - s->cursor) / PAIRS_PER_UNIT);
            compare_ends(s);
        }
        if (!has_gap(s))
            break;
        CAIRN_STEP_CHARGE(s, phase_resume, budget, 1 + gap_steps(s) / LINE_PIXELS_PER_UNIT);
        bridge_gap(s);
    }
    CAIRN_STEP_END(s->phase_resume);
}
