/* Translation along a weakly observable direction, from the ranges of two successive scans.
 *
 * Without odometry a match along a corridor mostly repeats its prediction: the fitted segments show
 * no wall across. The beams still show what moves: the far end of the corridor, hit by few of them,
 * door frames, and edges. And a robot that stands still sees all ranges unchanged.
 *
 * Method. The trials shift the match along its weakly observable direction, evenly spaced, from
 * standing still to the prediction and beyond both; across and in heading the match decides.
 *
 * 1. Each beam's end, moved by the trial, is seen from the sensor of the previous scan between two
 *    neighbouring beams. Where these hit one surface, the distance from the line through their ends is
 *    taken. Where they do not, the surface between them is unknown. (The difference of range to the
 *    nearer beam favours standing still, as only there beams end where those before ended.)
 * 2. Cost of a trial, nats: the sum of e^2 / (1 + e^2) with e = distance / DISTANCE_SCALE_M
 *    (Geman-McClure), and the prior of the predicted motion.
 * 3. The trial of the least cost replaces the match. It is not taken when many trials have nearly
 *    the same cost, when it is the first or the last one, or when the ranges do not fit. Its
 *    standard deviation is half the length that those trials span.
 *
 * Limits: drifts, as it has no memory of the scans before. A scan whose pose is a prediction is not
 * compared with. A trial gains where more of its beams see an unknown surface: a fixed cost of these
 * makes it drift more, as the door frames are seen by few beams. Past equal
 * doors the motion may be off by their distance, when it is more than half of it. The robot must not
 * turn by more than its field of view between the scans. */
#include "src/base/build.h"

#include "src/base/step.h"
#include "src/maps/mapper_work.h"

static const cairn_real TRIAL_STEP_M = CAIRN_REAL(0.01);
/* m: beyond standing still and beyond the predicted translation */
static const cairn_real TRIAL_MARGIN_M = CAIRN_REAL(0.2);
/* m: distance at which a beam has half of the greatest cost; large, as neighbouring beams err
 * together */
static const cairn_real DISTANCE_SCALE_M = CAIRN_REAL(0.1);
/* m and m per m: standard deviation of the change of the motion since the scan before */
static const cairn_real CHANGE_SIGMA_M = CAIRN_REAL(0.06), CHANGE_SIGMA_SHARE = CAIRN_REAL(0.5);
/* m and share of the range: neighbouring beams whose ends are nearer hit one surface */
static const cairn_real MAX_GAP_M = CAIRN_REAL(0.3), MAX_GAP_SHARE = CAIRN_REAL(0.2);
/* nats: trials within this cost of the least are nearly as good */
static const cairn_real NEARLY_BEST_NATS = 2;
/* nats: greatest mean cost of a beam where the ranges fit */
static const cairn_real MAX_MEAN_COST = CAIRN_REAL(0.25);
/* m: least standard deviation of the translation */
static const cairn_real MIN_SIGMA_M = CAIRN_REAL(0.03);

enum {
    MAX_COMPARED = 360,   /* beams of a scan that are compared */
    MIN_COMPARED = 20,    /* for a result */
    MAX_NEARLY_BEST = 15, /* trials nearly as good as the best one */
    /* from the neighbours of one beam to those of the next, in a scan of MAX_COMPARED beams */
    MAX_NEIGHBOUR_STEPS = 32,
    BEAMS_PER_UNIT = 4,
    NEIGHBOURS_PER_UNIT = 16
};

/* ---- The previous scan ---- */

static int is_hit(cairn_vec2 end)
{
    return end.x != 0 || end.y != 0;
}

void cairn_mapper_keep_ranges(cairn_mapper *mapper)
{
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    mapper_ranges *ranges = &mapper->ranges;
    cairn_vec2 none = {0, 0}, before = none;
    cairn_real turn = 0;

    ranges->sensor = view.sensor;
    ranges->count = view.beam_count;
    for (int32_t i = 0; i < view.beam_count; i++) {
        int hits = view.beams[i].kind == CAIRN_SCAN_BEAM_HIT;
        cairn_vec2 end = hits ? cairn_vec2_sub(view.beams[i].to, view.sensor) : none;

        ranges->ends[i] = end;
        if (hits) {
            turn += cairn_vec2_cross(before, end);
            before = end;
        }
    }
    ranges->sense = turn < 0 ? -1 : 1;
}

/* ---- The distance of a beam's end ---- */

/* Returns 1 when a point is seen behind beam i in the order of the beams, or that beam has no end. */
static int is_behind(const mapper_ranges *ranges, int32_t i, cairn_vec2 point)
{
    cairn_vec2 end = ranges->ends[i];

    return !is_hit(end) ||
           (ranges->sense * cairn_vec2_cross(end, point) >= 0 && cairn_vec2_dot(end, point) > 0);
}

/* Advances from the neighbours of the point before to those of a point. Returns 1 when the point lies
 * between the two. */
static int find_neighbours(mapper_ranges *ranges, cairn_vec2 point)
{
    int32_t most = MAX_NEIGHBOUR_STEPS + ranges->count / MAX_COMPARED;

    for (int32_t steps = 0; steps < most; steps++) {
        int32_t i = ranges->neighbour;
        int first = is_behind(ranges, i, point), second = is_behind(ranges, i + 1, point);

        if (first != second)
            return first;
        i += first ? 1 : -1;
        if (i < 0 || i > ranges->count - 2)
            return 0;
        ranges->neighbour = i;
    }
    return 0;
}

/* Adds the cost of a point, from its distance to the line through the ends of its two neighbours,
 * where these hit one surface. */
static void add_cost(mapper_ranges *ranges, cairn_vec2 point, cairn_real *cost)
{
    const cairn_vec2 *end;
    cairn_vec2 along;
    cairn_real gap, moment;

    if (!find_neighbours(ranges, point))
        return;
    end = &ranges->ends[ranges->neighbour];
    along = cairn_vec2_sub(end[1], end[0]);
    gap = cairn_vec2_norm_squared(along);
    if (!is_hit(end[0]) ||
        !(gap < cairn_max(MAX_GAP_M * MAX_GAP_M,
                          MAX_GAP_SHARE * MAX_GAP_SHARE * cairn_vec2_norm_squared(end[0]))))
        return;
    moment = cairn_vec2_cross(cairn_vec2_sub(point, end[0]), along);
    moment *= moment;
    *cost += moment / (DISTANCE_SCALE_M * DISTANCE_SCALE_M * gap + moment);
    ranges->compared++;
}

/* ---- A trial ---- */

/* Returns the pose of the match, moved as a trial says. */
static cairn_pose trial_pose(const cairn_mapper *mapper, int32_t trial)
{
    const mapper_ranges *ranges = &mapper->ranges;
    cairn_real shift = ranges->first + TRIAL_STEP_M * (cairn_real)trial;
    cairn_pose pose = mapper->current.match.target_query;

    pose.x += ranges->along.x * shift;
    pose.y += ranges->along.y * shift;
    return pose;
}

/* Returns the shift of the match that moves it to a pose. */
static cairn_real shift_to(const cairn_mapper *mapper, const cairn_pose *pose)
{
    const cairn_pose *match = &mapper->current.match.target_query;

    return mapper->ranges.along.x * (pose->x - match->x) +
           mapper->ranges.along.y * (pose->y - match->y);
}

/* Computes the cost of a trial from all beams that are compared. */
static void try_shift(cairn_mapper *mapper, int32_t trial)
{
    mapper_ranges *ranges = &mapper->ranges;
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    int32_t stride = 1 + (view.beam_count - 1) / MAX_COMPARED;
    cairn_pose pose = trial_pose(mapper, trial);
    cairn_transform motion = cairn_transform_of(cairn_pose_between(mapper->previous.pose, pose));
    cairn_real change = (shift_to(mapper, &pose) - ranges->predicted) / ranges->change_sigma,
               cost = change * change / 2;

    ranges->neighbour = ranges->compared = 0;
    for (int32_t i = 0; i < view.beam_count; i += stride) {
        const cairn_scan_beam *beam = &view.beams[i];
        cairn_vec2 point = cairn_vec2_sub(cairn_transform_point(motion, beam->to), ranges->sensor);

        if (beam->kind == CAIRN_SCAN_BEAM_HIT)
            add_cost(ranges, point, &cost);
    }
    ranges->cost[trial] = cost;
    if (trial == 0 || cost < ranges->cost[ranges->best]) {
        ranges->best = trial;
        ranges->best_compared = ranges->compared;
    }
}

/* Returns the cost of a trial in work units. */
static int32_t trial_units(const cairn_mapper *mapper)
{
    int32_t beams = cairn_scan_read(mapper->scan).beam_count;

    return 1 + (beams < MAX_COMPARED ? beams : MAX_COMPARED) / BEAMS_PER_UNIT +
           mapper->ranges.count / NEIGHBOURS_PER_UNIT;
}

/* Sets the trials; returns 0 where the weakly observable direction is a turn, or the prediction is too
 * far. */
static int begin_trials(cairn_mapper *mapper)
{
    mapper_ranges *ranges = &mapper->ranges;
    const mapper_current *current = &mapper->current;
    cairn_vec2 weak = {current->match.weak_direction[0], current->match.weak_direction[1]};
    cairn_real standing, length;

    if (cairn_vec2_norm_squared(weak) < MAPPER_MIN_TRANSLATION * MAPPER_MIN_TRANSLATION)
        return 0;
    ranges->along = cairn_vec2_unit(weak);
    standing = shift_to(mapper, &mapper->previous.pose);
    ranges->predicted = shift_to(mapper, &current->predicted);
    ranges->change_sigma =
        CHANGE_SIGMA_M + CHANGE_SIGMA_SHARE * cairn_mapper_translation(current->motion);
    ranges->first = cairn_min(standing, ranges->predicted) - TRIAL_MARGIN_M;
    length = 2 * TRIAL_MARGIN_M + cairn_abs(ranges->predicted - standing);
    if (length > TRIAL_STEP_M * (MAPPER_MAX_TRIALS - 1))
        return 0;
    ranges->trials = cairn_real_to_int(length / TRIAL_STEP_M) + 1;
    return 1;
}

/* ---- The result ---- */

/* Moves the match to the best trial where few others are nearly as good. */
static void take_best(cairn_mapper *mapper)
{
    const mapper_ranges *ranges = &mapper->ranges;
    mapper_current *current = &mapper->current;
    int32_t first = ranges->best, last = first, count = -1;

    for (int32_t i = 0; i < ranges->trials; i++) {
        if (!(ranges->cost[i] < ranges->cost[ranges->best] + NEARLY_BEST_NATS))
            continue;
        first = i < first ? i : first;
        last = i;
        count++;
    }
    if (ranges->best_compared < MIN_COMPARED || count > MAX_NEARLY_BEST || ranges->best == 0 ||
        ranges->best == ranges->trials - 1 ||
        ranges->cost[ranges->best] > MAX_MEAN_COST * (cairn_real)ranges->best_compared)
        return;
    current->match.target_query = trial_pose(mapper, ranges->best);
    current->weak_sigma = cairn_max(MIN_SIGMA_M, TRIAL_STEP_M * (cairn_real)(last - first) / 2);
}

int cairn_mapper_compare_ranges(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_ranges *ranges = &mapper->ranges;

    CAIRN_STEP_BEGIN(ranges->resume);
    if (ranges->count > 1 && begin_trials(mapper)) {
        for (ranges->trial = 0; ranges->trial < ranges->trials; ranges->trial++) {
            CAIRN_STEP_CHARGE(ranges, resume, budget, trial_units(mapper));
            try_shift(mapper, ranges->trial);
        }
        take_best(mapper);
    }
    CAIRN_STEP_END(ranges->resume);
}
