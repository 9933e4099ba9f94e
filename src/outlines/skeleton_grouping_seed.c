/* Seeding: lines through the CPs in (x, y, radius), and the CP at the middle of each line that is
 * an axis of mirror symmetry. skeleton_grouping.c describes the method. */
#include "src/base/build.h"

#include "src/containers/ranked_list.h"
#include "src/outlines/skeleton_grouping_written.h"

/* Relative tolerance of the distances of two edgels to the axis. */
#define DISTANCE_TOLERANCE CAIRN_REAL(0.2)
/* Deviation, rad, that costs as much as half a line length of distance to the line's middle. */
#define DEVIATION_SCALE_RAD CAIRN_REAL(0.3)

/* Adds the CPs to the line fit. */
static cairn_status add_centres(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    cairn_status status =
        skeleton->cursor == 0 ? cairn_polyline_clear(skeleton->polyline, 1) : CAIRN_OK;

    for (; skeleton->cursor < skeleton->centre_count && status == CAIRN_OK; skeleton->cursor++) {
        const skeleton_grouping_centre *c = &skeleton->centres[skeleton->cursor];
        cairn_real point[3] = {c->position.x, c->position.y, c->radius};

        if (!cairn_budget_charge(budget, &skeleton->units_charged, 1))
            return CAIRN_MORE;
        status = cairn_polyline_add(skeleton->polyline, point);
    }
    return status;
}

cairn_status cairn_skeleton_grouping_lines(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    cairn_status status;

    if (skeleton->phase_counter == 0) {
        status = add_centres(skeleton, budget);
        if (status != CAIRN_OK)
            return status;
        skeleton->phase_counter = 1;
    }
    status = cairn_polyline_step(skeleton->polyline, budget);
    if (status == CAIRN_OK)
        skeleton->line_count = cairn_polyline_read(skeleton->polyline).segment_count;
    return status;
}

int cairn_skeleton_grouping_is_mirrored(const cairn_skeleton_grouping *skeleton,
                                        const skeleton_grouping_centre *centre,
                                        const cairn_polyline_segment *segment)
{
    cairn_vec2 a = {segment->a[0], segment->a[1]}, b = {segment->b[0], segment->b[1]},
               along = cairn_vec2_unit(cairn_vec2_sub(b, a));
    cairn_real first =
        cairn_vec2_cross(along, cairn_vec2_sub(skeleton->edgels[centre->edgel[0]].position, a));
    cairn_real second =
        cairn_vec2_cross(along, cairn_vec2_sub(skeleton->edgels[centre->edgel[1]].position, a));

    return (first > 0) != (second > 0) &&
           cairn_abs(first + second) <=
               DISTANCE_TOLERANCE * cairn_max(cairn_abs(first), cairn_abs(second));
}

/* Returns the cost of a CP as seed: distance to the line's middle relative to the line's length,
 * plus its deviation. */
static cairn_real seed_cost(const skeleton_grouping_centre *centre,
                            const cairn_polyline_segment *segment)
{
    cairn_real d[3] = {centre->position.x - (segment->a[0] + segment->b[0]) / 2,
                       centre->position.y - (segment->a[1] + segment->b[1]) / 2,
                       centre->radius - (segment->a[2] + segment->b[2]) / 2};
    cairn_real l[3] = {segment->b[0] - segment->a[0], segment->b[1] - segment->a[1],
                       segment->b[2] - segment->a[2]};

    return cairn_sqrt((d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) /
                      cairn_max(l[0] * l[0] + l[1] * l[1] + l[2] * l[2], 1)) +
           centre->deviation / DEVIATION_SCALE_RAD / 2;
}

static int has_more_support(const void *context, const void *entry, const void *other)
{
    const skeleton_grouping_seed *a = entry, *b = other;

    (void)context;
    return a->support != b->support ? a->support > b->support : a->centre < b->centre;
}

static void insert_seed(cairn_skeleton_grouping *skeleton, const skeleton_grouping_seed *start)
{
    ranked_list seeds = {.entries = skeleton->seeds,
                         .count = &skeleton->seed_count,
                         .capacity = skeleton->params.max_lines,
                         .entry_bytes = sizeof *start,
                         .ranks_before = has_more_support};

    (void)ranked_list_add(&seeds, start);
}

/* Returns 1 if a single CP is a seed, since short and curved parts have no line. It is
 * symmetric, has the same polarity on both sides, and both contrasts reach the mean. */
static int is_seed(const cairn_skeleton_grouping *skeleton, const skeleton_grouping_centre *centre)
{
    return centre->deviation <= skeleton->params.symmetry_sigma &&
           centre->polarity[0] == centre->polarity[1] &&
           (skeleton->params.contrast_weight == 0 ||
            (skeleton->edgels[centre->edgel[0]].log_slope_ratio >= 0 &&
             skeleton->edgels[centre->edgel[1]].log_slope_ratio >= 0));
}

/* Distributes the remaining capacity to single CPs, evenly over the image: they are counted,
 * then one in N is taken. */
static cairn_status add_single_seeds(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    int32_t n = skeleton->centre_count, capacity;

    if (skeleton->second_cursor == 0)
        skeleton->line_seeds = skeleton->seed_count;
    capacity = skeleton->params.max_lines - skeleton->line_seeds;
    for (; capacity > 0 && skeleton->second_cursor < 2 * n; skeleton->second_cursor++) {
        int32_t i =
            skeleton->second_cursor < n ? skeleton->second_cursor : skeleton->second_cursor - n;
        skeleton_grouping_seed start = {i, 0};

        if (!cairn_budget_charge(budget, &skeleton->units_charged, 1))
            return CAIRN_MORE;
        if (!is_seed(skeleton, &skeleton->centres[i]))
            continue;
        if (skeleton->second_cursor < n)
            skeleton->phase_counter++;
        else if (skeleton->polarity_cursor++ % (1 + (skeleton->phase_counter - 1) / capacity) == 0)
            skeleton->seeds[skeleton->seed_count++] = start;
    }
    return CAIRN_OK;
}

/* Evaluates one line per work item. Cost: linear in all CPs for each line. */
cairn_status cairn_skeleton_grouping_mirror(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    cairn_polyline_view view = cairn_polyline_read(skeleton->polyline);

    for (; skeleton->cursor < view.segment_count; skeleton->cursor++) {
        const cairn_polyline_segment *s = &view.segments[skeleton->cursor];
        skeleton_grouping_seed start = {-1, 0};
        cairn_real best = CAIRN_REAL_MAX;

        if (!cairn_budget_charge(budget, &skeleton->units_charged,
                                 1 + skeleton->centre_count / 16 + s->count))
            return CAIRN_MORE;
        for (int32_t i = 0; i < skeleton->centre_count; i++) {
            const skeleton_grouping_centre *c = &skeleton->centres[i];
            cairn_real cost;

            if (view.label[i] != skeleton->cursor ||
                !cairn_skeleton_grouping_is_mirrored(skeleton, c, s))
                continue;
            start.support++;
            cost = seed_cost(c, s);
            if (cost < best) {
                best = cost;
                start.centre = i;
            }
        }
        /* As written the seed is the line with all its CPs. */
        if (start.centre >= 0 && skeleton->params.mode == CAIRN_MODE_AS_WRITTEN)
            start.centre = skeleton->cursor;
        if (start.centre >= 0 &&
            (cairn_real)start.support >= skeleton->params.min_mirror_ratio * (cairn_real)s->count)
            insert_seed(skeleton, &start);
    }
    if (skeleton->params.mode != CAIRN_MODE_AS_WRITTEN)
        return add_single_seeds(skeleton, budget);
    skeleton->line_seeds = skeleton->seed_count;
    return CAIRN_OK;
}
