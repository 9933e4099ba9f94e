/* Contour completion: the segments along the deformed outline, extended along their chains.
 *
 * Method:
 * 1. A segment belongs to the contour when most of it is near the outline and parallel to it.
 * 2. Gaps within a chain are closed: segments between two contour segments of one chain lie on the
 *    same edge.
 * 3. Beyond its last contour segments a chain is followed while it stays near the outline, and
 *    across junctions to other chains that start there. The offset from the outline may grow slowly
 *    on the way.
 * 4. Where edges leave the outline they are followed for a limited length. Near the gaps of the
 *    drawing, where the object continues beyond the model outline, they are followed round any
 *    corner. */
#include "src/base/build.h"

#include <stdlib.h>
#include <string.h>

#include "src/host/detection/contour_search_ends.h"
#include "src/host/detection/contour_search_fit.h"

/* Share of the object's size: greatest gap within a chain that is closed. */
#define MAX_GAP_SHARE 0.15
/* Shares of the size. A chain is followed within MAX_OFFSET_SHARE of the outline, or up to
 * OFFSET_GROWTH_SHARE beyond the offset of the previous segment, but never beyond MAX_DRIFT_SHARE.
 * And the least cosine of the angle to the outline. */
#define MAX_OFFSET_SHARE    0.05
#define OFFSET_GROWTH_SHARE 0.03
#define MAX_DRIFT_SHARE     0.1
#define MIN_COSINE          0.8
/* Greatest distance of a segment along the outline, share of the size, but at least
 * MIN_DISTANCE_PX; and the step of the test samples, px. */
#define MAX_DISTANCE_SHARE 0.045
#define MIN_DISTANCE_PX    3
#define SAMPLE_STEP_PX     3
/* Greatest length that edges are followed beyond the outline, share of the size. */
#define MAX_EXTENSION_SHARE 0.35
/* Margin of the outline's box within which they are followed, share of the size: a drawing may end
 * where the object continues, as at legs. Least cosines of the turning angle along a chain and
 * across a junction. */
#define BOX_MARGIN_SHARE    0.2
#define MIN_CHAIN_COSINE    0.5
#define MIN_JUNCTION_COSINE 0.6
/* Radius around a gap of the drawing, share of the size, where the object continues. Least cosine
 * of the turning angle along a chain there. Greatest distance of adjacent ends, px, in any
 * direction. */
#define GAP_RADIUS_SHARE 0.3
#define MIN_GAP_COSINE   0.3
#define GAP_JUNCTION_PX  10
/* Greatest distance between adjacent ends of chains, px. */
#define JUNCTION_PX 4
enum { MAX_ROUNDS = 8 };

typedef struct outline_order {
    int32_t sample, segment;
} outline_order;

static cairn_vec2 middle_of(cairn_segment line)
{
    return cairn_vec2_scale(cairn_vec2_add(line.a, line.b), CAIRN_REAL(0.5));
}

/* Index of the outline sample nearest to a point; *distance to it. */
static int32_t nearest_sample(const contour_search_fitted_outline *fitted, cairn_vec2 point,
                              cairn_real *distance)
{
    cairn_real smallest = CAIRN_REAL_MAX;
    int32_t nearest = 0;

    for (int32_t i = 0; i < fitted->outline_count; i++) {
        cairn_real squared =
            cairn_vec2_norm_squared(cairn_vec2_sub(point, fitted->outline[i].position));

        if (squared < smallest) {
            smallest = squared;
            nearest = i;
        }
    }
    *distance = cairn_sqrt(smallest);
    return nearest;
}

/* Returns 1 when a line is parallel to the outline at a sample. */
static int is_parallel(const contour_search_fitted_outline *fitted, int32_t sample,
                       cairn_segment line)
{
    cairn_vec2 along = cairn_vec2_unit(cairn_vec2_sub(line.b, line.a));

    return cairn_abs(cairn_vec2_dot(fitted->outline[sample].direction, along)) >=
           (cairn_real)MIN_COSINE;
}

/* Returns 1 when the contour continues from one selected segment to another. */
static int is_continuation(const contour_search_fitted_outline *fitted, cairn_segment from,
                           cairn_segment line)
{
    cairn_real previous, distance;
    int32_t sample = nearest_sample(fitted, middle_of(line), &distance);

    (void)nearest_sample(fitted, middle_of(from), &previous);
    return distance <= (cairn_real)MAX_DRIFT_SHARE * fitted->size &&
           distance <= cairn_max((cairn_real)MAX_OFFSET_SHARE * fitted->size,
                                 previous + (cairn_real)OFFSET_GROWTH_SHARE * fitted->size) &&
           is_parallel(fitted, sample, line);
}

/* Returns 1 when most of a segment is along the outline. */
static int is_along_outline(const contour_search_fitted_outline *fitted, cairn_segment line)
{
    int32_t steps = 1 + (int32_t)(cairn_segment_length(line) / SAMPLE_STEP_PX), near_count = 0;
    cairn_real max_distance =
        cairn_max(MIN_DISTANCE_PX, (cairn_real)MAX_DISTANCE_SHARE * fitted->size);

    for (int32_t k = 0; k <= steps; k++) {
        cairn_real share = (cairn_real)k / (cairn_real)steps, distance;
        int32_t sample = nearest_sample(
            fitted, cairn_vec2_add(line.a, cairn_vec2_scale(cairn_vec2_sub(line.b, line.a), share)),
            &distance);

        near_count += distance <= max_distance && is_parallel(fitted, sample, line);
    }
    return 2 * near_count > steps + 1;
}

/* Closes the gaps of one chain, segments [from ... to - 1]. */
static void close_gaps(const cairn_contour_search_tokens *tokens,
                       const contour_search_fitted_outline *fitted, int32_t from, int32_t to,
                       uint8_t *selected)
{
    cairn_real gap = 0;
    int32_t previous = -1;

    for (int32_t i = from; i < to; i++) {
        if (!selected[i]) {
            gap += cairn_segment_length(tokens->lines[i]);
            continue;
        }
        if (previous >= 0 && gap <= (cairn_real)MAX_GAP_SHARE * fitted->size)
            memset(&selected[previous], 1, (size_t)(i - previous));
        previous = i;
        gap = 0;
    }
}

/* Extends the selection along one chain, in both directions. */
static void follow(const cairn_contour_search_tokens *tokens,
                   const contour_search_fitted_outline *fitted, int32_t from, int32_t to,
                   uint8_t *selected)
{
    for (int32_t i = from + 1; i < to; i++)
        if (!selected[i] && selected[i - 1])
            selected[i] = (uint8_t)is_continuation(fitted, tokens->lines[i - 1], tokens->lines[i]);
    for (int32_t i = to - 2; i >= from; i--)
        if (!selected[i] && selected[i + 1])
            selected[i] = (uint8_t)is_continuation(fitted, tokens->lines[i + 1], tokens->lines[i]);
}

static int32_t end_of_chain(const cairn_contour_search_tokens *tokens, int32_t from)
{
    int32_t to = from + 1;

    while (to < tokens->count && tokens->chain[to] == tokens->chain[from])
        to++;
    return to;
}

/* Selects the ends of chains that continue where a selected segment ends; returns their number. */
static int32_t cross_junctions(const cairn_contour_search_tokens *tokens,
                               const contour_search_fitted_outline *fitted,
                               contour_search_ends *ends, uint8_t *selected)
{
    int32_t crossed = 0;

    for (int32_t i = 0; i < ends->count; i++) {
        int32_t from = ends->listed[i],
                neighbour_count = selected[from] ? cairn_contour_search_ends_near(ends, i) : 0;

        for (int32_t k = 0; k < neighbour_count; k++) {
            int32_t to = ends->listed[ends->neighbours[k]];

            if (!selected[to] && is_continuation(fitted, tokens->lines[from], tokens->lines[to])) {
                selected[to] = 1;
                crossed++;
            }
        }
    }
    return crossed;
}

/* Closes gaps and extends the ends of all chains with a selected segment. */
static void complete_chains(const cairn_contour_search_tokens *tokens,
                            const contour_search_fitted_outline *fitted, uint8_t *selected)
{
    for (int32_t from = 0, to; from < tokens->count; from = to) {
        int32_t any = 0;

        to = end_of_chain(tokens, from);
        for (int32_t i = from; i < to; i++)
            any |= selected[i];
        if (any) {
            close_gaps(tokens, fitted, from, to, selected);
            follow(tokens, fitted, from, to, selected);
        }
    }
}

/* Lists the first and last segments of the chains near the object; returns their number. */
static int32_t list_ends(const cairn_contour_search_tokens *tokens,
                         const contour_search_fitted_outline *fitted, int32_t *ends)
{
    int32_t count = 0;

    for (int32_t from = 0, to; from < tokens->count; from = to) {
        to = end_of_chain(tokens, from);
        for (int32_t k = 0; k < 1 + (to - from > 1); k++) {
            int32_t i = k == 0 ? from : to - 1;

            if (cairn_vec2_norm(cairn_vec2_sub(middle_of(tokens->lines[i]), fitted->origin)) <=
                fitted->size)
                ends[count++] = i;
        }
    }
    return count;
}

static int compare_placed(const void *a, const void *b)
{
    const outline_order *x = a, *y = b;

    return x->sample != y->sample ? x->sample - y->sample : x->segment - y->segment;
}

/* Lists the selected segments in the order of the outline. */
static int list_selected(const cairn_contour_search_tokens *tokens,
                         const contour_search_fitted_outline *fitted, const uint8_t *selected,
                         int32_t *list, int32_t *count)
{
    outline_order *order = malloc(((size_t)tokens->count + 1) * sizeof *order);
    cairn_real distance;

    if (order == NULL)
        return 0;
    *count = 0;
    for (int32_t i = 0; i < tokens->count; i++)
        if (selected[i]) {
            order[*count].sample = nearest_sample(fitted, middle_of(tokens->lines[i]), &distance);
            order[(*count)++].segment = i;
        }
    qsort(order, (size_t)*count, sizeof *order, compare_placed);
    for (int32_t i = 0; i < *count; i++)
        list[i] = order[i].segment;
    free(order);
    return 1;
}

/* Selects the segments along the outline, near the object only. */
static void select_along_outline(const cairn_contour_search_tokens *tokens,
                                 const contour_search_fitted_outline *fitted, uint8_t *selected)
{
    for (int32_t i = 0; i < tokens->count; i++)
        selected[i] = (uint8_t)(cairn_vec2_norm(cairn_vec2_sub(middle_of(tokens->lines[i]),
                                                               fitted->origin)) <= fitted->size &&
                                is_along_outline(fitted, tokens->lines[i]));
}

/* ---- Beyond the outline ---- */

static int is_turn_below(cairn_segment from, cairn_segment to, cairn_real cosine)
{
    return cairn_vec2_dot(cairn_vec2_unit(cairn_vec2_sub(from.b, from.a)),
                          cairn_vec2_unit(cairn_vec2_sub(to.b, to.a))) >= cosine;
}

/* Returns 1 when the second line continues from an end of the first, within `junction` px and a
 * turning angle of at least the given cosine. */
static int continues(cairn_segment from, cairn_segment to, cairn_real junction, cairn_real cosine)
{
    for (int32_t k = 0; k < 4; k++) {
        cairn_vec2 end = k % 2 == 0 ? from.b : from.a,
                   out = cairn_vec2_sub(end, k % 2 == 0 ? from.a : from.b);
        cairn_vec2 start = k / 2 == 0 ? to.a : to.b,
                   forward = cairn_vec2_sub(k / 2 == 0 ? to.b : to.a, start);

        if (cairn_vec2_norm_squared(cairn_vec2_sub(start, end)) <= junction * junction &&
            cairn_vec2_dot(cairn_vec2_unit(out), cairn_vec2_unit(forward)) >= cosine)
            return 1;
    }
    return 0;
}

typedef struct edge_extender {
    const cairn_contour_search_tokens *tokens;
    /* px, box that the midpoints of segments must lie in */
    cairn_vec2 box_min, box_max;
    /* px, greatest length of an extension */
    cairn_real max_extension;
    /* least cosines of the turning angle along a chain and between chains */
    cairn_real chain_cosine, junction_cosine;
    /* extension only near these gaps; NULL: everywhere */
    const contour_search_gaps *gaps;
    /* px, radius around a gap */
    cairn_real gap_radius;
    /* [tokens->count] px, length of edges from the outline to the end of each segment;
     * CAIRN_REAL_MAX: not selected */
    cairn_real *extension;
    int32_t has_changed;
} edge_extender;

static int is_near_gap(const edge_extender *extender, cairn_vec2 middle)
{
    int32_t is_near = extender->gaps == NULL;

    for (int32_t i = 0; !is_near && i < extender->gaps->count; i++)
        is_near =
            cairn_vec2_norm(cairn_vec2_sub(middle, extender->gaps->at[i])) <= extender->gap_radius;
    return is_near;
}

/* Extends the selection from one segment to another. */
static void extend(edge_extender *extender, int32_t from, int32_t to)
{
    cairn_vec2 middle = middle_of(extender->tokens->lines[to]);
    cairn_real length;

    if (!(extender->extension[from] < CAIRN_REAL_MAX) || extender->extension[to] == 0)
        return;
    length = extender->extension[from] + cairn_segment_length(extender->tokens->lines[to]);
    if (length <= extender->max_extension && length < extender->extension[to] &&
        middle.x >= extender->box_min.x && middle.y >= extender->box_min.y &&
        middle.x <= extender->box_max.x && middle.y <= extender->box_max.y &&
        is_near_gap(extender, middle)) {
        extender->extension[to] = length;
        extender->has_changed = 1;
    }
}

static void extend_chain(edge_extender *extender, int32_t from, int32_t to)
{
    const cairn_segment *lines = extender->tokens->lines;

    for (int32_t i = from + 1; i < to; i++)
        if (is_turn_below(lines[i - 1], lines[i], extender->chain_cosine))
            extend(extender, i - 1, i);
    for (int32_t i = to - 2; i >= from; i--)
        if (is_turn_below(lines[i], lines[i + 1], extender->chain_cosine))
            extend(extender, i + 1, i);
}

/* Follows edges beyond the outline, in rounds until nothing changes. */
static void extend_all(edge_extender *extender, contour_search_ends *ends)
{
    for (int32_t round = 0; round < MAX_ROUNDS; round++) {
        extender->has_changed = 0;
        for (int32_t from = 0, to; from < extender->tokens->count; from = to) {
            to = end_of_chain(extender->tokens, from);
            extend_chain(extender, from, to);
        }
        for (int32_t i = 0; i < ends->count; i++) {
            int32_t current = ends->listed[i],
                    neighbour_count = extender->extension[current] < extender->max_extension
                                          ? cairn_contour_search_ends_near(ends, i)
                                          : 0;

            for (int32_t k = 0; k < neighbour_count; k++)
                if (continues(extender->tokens->lines[current],
                              extender->tokens->lines[ends->listed[ends->neighbours[k]]],
                              ends->max_distance, extender->junction_cosine))
                    extend(extender, current, ends->listed[ends->neighbours[k]]);
        }
        if (!extender->has_changed)
            break;
    }
}

/* Second pass near the gaps, from all selected segments. */
static int extend_gaps(edge_extender *extender, const contour_search_gaps *gaps,
                       const contour_search_ends *ends)
{
    contour_search_ends wide;

    if (!cairn_contour_search_ends_make(&wide, ends->lines, ends->listed, ends->count,
                                        GAP_JUNCTION_PX))
        return 0;
    for (int32_t i = 0; i < extender->tokens->count; i++)
        extender->extension[i] = extender->extension[i] < CAIRN_REAL_MAX ? 0 : CAIRN_REAL_MAX;
    extender->gaps = gaps;
    extender->chain_cosine = (cairn_real)MIN_GAP_COSINE;
    extender->junction_cosine = -1;
    extend_all(extender, &wide);
    cairn_contour_search_ends_free(&wide);
    return 1;
}

static int extend_selected(const cairn_contour_search_tokens *tokens,
                           const contour_search_fitted_outline *fitted,
                           const contour_search_gaps *gaps, contour_search_ends *ends,
                           uint8_t *selected)
{
    cairn_real margin = (cairn_real)BOX_MARGIN_SHARE * fitted->size;
    cairn_box box = cairn_box_empty();
    int ok = 1;
    edge_extender extender = {.tokens = tokens,
                              .max_extension = (cairn_real)MAX_EXTENSION_SHARE * fitted->size,
                              .chain_cosine = (cairn_real)MIN_CHAIN_COSINE,
                              .junction_cosine = (cairn_real)MIN_JUNCTION_COSINE,
                              .gap_radius = (cairn_real)GAP_RADIUS_SHARE * fitted->size,
                              .extension =
                                  calloc((size_t)tokens->count + 1, sizeof *extender.extension)};

    if (extender.extension == NULL)
        return 0;
    for (int32_t i = 0; i < fitted->outline_count; i++)
        box = cairn_box_extend(box, fitted->outline[i].position);
    extender.box_min = cairn_vec2_sub(box.min, (cairn_vec2){margin, margin});
    extender.box_max = cairn_vec2_add(box.max, (cairn_vec2){margin, margin});
    for (int32_t i = 0; i < tokens->count; i++)
        extender.extension[i] = selected[i] ? 0 : CAIRN_REAL_MAX;
    extend_all(&extender, ends);
    if (gaps->count > 0)
        ok = extend_gaps(&extender, gaps, ends);
    for (int32_t i = 0; i < tokens->count; i++)
        selected[i] = extender.extension[i] < CAIRN_REAL_MAX;
    free(extender.extension);
    return ok;
}

int cairn_contour_search_collect_with_gaps(const cairn_contour_search_tokens *tokens,
                                           const contour_search_fitted_outline *fitted,
                                           const contour_search_gaps *gaps, int32_t *list,
                                           int32_t *count)
{
    uint8_t *selected = calloc((size_t)tokens->count + 1, 1);
    int32_t *listed = malloc(((size_t)tokens->count + 1) * sizeof *listed);
    contour_search_ends ends;
    int ok = selected != NULL && listed != NULL &&
             cairn_contour_search_ends_make(&ends, tokens->lines, listed,
                                            list_ends(tokens, fitted, listed), JUNCTION_PX);

    if (ok) {
        select_along_outline(tokens, fitted, selected);
        complete_chains(tokens, fitted, selected);
        for (int32_t round = 0;
             round < MAX_ROUNDS && cross_junctions(tokens, fitted, &ends, selected) > 0; round++)
            complete_chains(tokens, fitted, selected);
        ok = extend_selected(tokens, fitted, gaps, &ends, selected) &&
             list_selected(tokens, fitted, selected, list, count);
        cairn_contour_search_ends_free(&ends);
    }
    free(selected);
    free(listed);
    return ok;
}

int cairn_contour_search_collect_segments(const cairn_contour_search_tokens *tokens,
                                          const contour_search_fitted_outline *fitted,
                                          int32_t *list, int32_t *count)
{
    const contour_search_gaps none = {.count = 0};

    return cairn_contour_search_collect_with_gaps(tokens, fitted, &none, list, count);
}
