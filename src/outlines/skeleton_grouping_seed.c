/* Seeding: lines through the CPs in (x, y, radius), and the CP at the middle of each line that is
 * an axis of mirror symmetry. skeleton_grouping.c describes the method. */
#include "src/base/build.h"

#include "src/containers/ranked_list.h"
#include "src/outlines/skeleton_grouping_written.h"

/* Relative tolerance of the distances of two edgels to the axis. */
#define DISTANCE_TOLERANCE CAIRN_REAL(0.2)
/* Deviation, rad, that costs as much as half a line length of distance to the line's middle. */
#define DEVIATION_SCALE_RAD CAIRN_REAL(0.3)
/* CPs compared with a line per work unit. */
enum { CENTRES_PER_UNIT = 16 };

/* Adds a CP to the line fit. */
static cairn_status add_centre(cairn_skeleton_grouping *skeleton,
                               const skeleton_grouping_centre *centre)
{
    cairn_real point[3] = {centre->position.x, centre->position.y, centre->radius};

    return cairn_polyline_add(skeleton->polyline, point);
}

int cairn_skeleton_grouping_lines(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(skeleton->phase_resume);
    skeleton->status = cairn_polyline_clear(skeleton->polyline, 1);
    CAIRN_STEP_UNTIL(skeleton->phase_resume, skeleton->status == CAIRN_OK);
    for (skeleton->centre = 0; skeleton->centre < skeleton->centre_count; skeleton->centre++) {
        CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, 1);
        skeleton->status = add_centre(skeleton, &skeleton->centres[skeleton->centre]);
        CAIRN_STEP_UNTIL(skeleton->phase_resume, skeleton->status == CAIRN_OK);
    }
    CAIRN_STEP_UNTIL(skeleton->phase_resume,
                     cairn_polyline_step(skeleton->polyline, budget) == CAIRN_OK);
    skeleton->line_count = cairn_polyline_read(skeleton->polyline).segment_count;
    CAIRN_STEP_END(skeleton->phase_resume);
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

/* Cost of a line in units: linear in its CPs, and less in all others. */
static int32_t line_cost(const cairn_skeleton_grouping *skeleton, int32_t line)
{
    return 1 + skeleton->centre_count / CENTRES_PER_UNIT +
           cairn_polyline_read(skeleton->polyline).segments[line].count;
}

/* Makes the CP at the middle of a line a seed, if enough CPs of the line are mirror symmetric about
 * it. As written the seed is the line with all its CPs. */
static void seed_line(cairn_skeleton_grouping *skeleton, int32_t line)
{
    cairn_polyline_view view = cairn_polyline_read(skeleton->polyline);
    const cairn_polyline_segment *s = &view.segments[line];
    skeleton_grouping_seed start = {-1, 0};
    cairn_real best = CAIRN_REAL_MAX;

    for (int32_t i = 0; i < skeleton->centre_count; i++) {
        const skeleton_grouping_centre *c = &skeleton->centres[i];
        cairn_real cost;

        if (view.label[i] != line || !cairn_skeleton_grouping_is_mirrored(skeleton, c, s))
            continue;
        start.support++;
        cost = seed_cost(c, s);
        if (cost < best) {
            best = cost;
            start.centre = i;
        }
    }
    if (start.centre >= 0 && skeleton->params.mode == CAIRN_MODE_AS_WRITTEN)
        start.centre = line;
    if (start.centre >= 0 &&
        (cairn_real)start.support >= skeleton->params.min_mirror_ratio * (cairn_real)s->count)
        insert_seed(skeleton, &start);
}

int cairn_skeleton_grouping_line_seeds(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(skeleton->phase_resume);
    for (skeleton->line = 0; skeleton->line < skeleton->line_count; skeleton->line++) {
        CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, line_cost(skeleton, skeleton->line));
        seed_line(skeleton, skeleton->line);
    }
    skeleton->line_seeds = skeleton->seed_count;
    CAIRN_STEP_END(skeleton->phase_resume);
}

/* Takes one in N of the single CPs that are seeds, as many as the remaining capacity allows. */
static void take_single(cairn_skeleton_grouping *skeleton, int32_t centre)
{
    int32_t capacity = skeleton->params.max_lines - skeleton->line_seeds;
    skeleton_grouping_seed start = {centre, 0};

    if (is_seed(skeleton, &skeleton->centres[centre]) &&
        skeleton->single_passed++ % (1 + (skeleton->single_count - 1) / capacity) == 0)
        skeleton->seeds[skeleton->seed_count++] = start;
}

/* The remaining capacity goes to single CPs, evenly over the image: they are counted, then one in N
 * is taken. */
int cairn_skeleton_grouping_single_seeds(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(skeleton->phase_resume);
    if (skeleton->line_seeds < skeleton->params.max_lines) {
        skeleton->single_count = skeleton->single_passed = 0;
        for (skeleton->centre = 0; skeleton->centre < skeleton->centre_count; skeleton->centre++) {
            CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, 1);
            skeleton->single_count += is_seed(skeleton, &skeleton->centres[skeleton->centre]);
        }
        for (skeleton->centre = 0; skeleton->centre < skeleton->centre_count; skeleton->centre++) {
            CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, 1);
            take_single(skeleton, skeleton->centre);
        }
    }
    CAIRN_STEP_END(skeleton->phase_resume);
}
