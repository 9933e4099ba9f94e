/* Competing registrations (modes) of two maps.
 *
 * Method.
 *
 * 1. Hypothesis generation: every pair of corners of the same kind and opening fixes a rigid
 *    motion.
 * 2. A hypothesis is scored by a few points of each map, looked up in the distance map of the other
 *    with a wide kernel. Non-maximum suppression keeps the best distinct ones.
 * 3. These are refined by a pattern search about the centre of their overlap (x, y and rotation,
 *    with halved steps), then by lines (map_merge_refine.c), and scored by all points.
 * 4. The score is a log-likelihood ratio in lengths of wall. A point on a wall of the other map
 *    supports a pose, a point in its free space contradicts it, a point in unknown space is
 *    neutral. No image is resampled: points are transformed and looked up. */
#include "src/base/build.h"

#include "src/merging/map_merge_work.h"

/* nats per correlation length of agreeing wall: log(0.85 / 0.15); of wall in free space: log(0.75 /
 * 0.014) */
#define AGREEMENT_NATS CAIRN_REAL(1.7)
#define CONFLICT_NATS  CAIRN_REAL(4.0)
/* rad: maximum difference of the openings of matching corners */
#define MAX_OPENING_DIFFERENCE_RAD CAIRN_REAL(0.25)
/* non-maximum suppression of final modes; during the search: MAP_MERGE_COARSE_M */
#define NMS_RADIUS_M   CAIRN_REAL(0.20)
#define NMS_RADIUS_RAD CAIRN_REAL(0.06)
/* cells: first and last step of a refinement by sampled points, and by all points */
#define COARSE_FIRST_STEP_CELLS CAIRN_REAL(2.0)
#define COARSE_LAST_STEP_CELLS  CAIRN_REAL(0.2)
#define FINE_FIRST_STEP_CELLS   CAIRN_REAL(0.5)
#define FINE_LAST_STEP_CELLS    CAIRN_REAL(0.1)
/* m of wall by the search score: minimum for a refinement by all points */
#define MIN_FINE_SCORE_M CAIRN_REAL(0.3)
/* weight of violating points during the search */
#define CONFLICT_WEIGHT CAIRN_REAL(1.5)
/* nats: minimum log-likelihood ratio of a supporting neighbour */
#define MIN_NEIGHBOUR_NATS CAIRN_REAL(3.0)
/* rad: rotations to either side from which a mode is refined again; nats: minimum for that */
#define VARIANT_RAD      CAIRN_REAL(0.025)
#define MIN_VARIANT_NATS CAIRN_REAL(1.0)
enum { CLIMB_VARIANTS = 3 };
/* maximum steps of a refinement by lines */
enum { MAX_LINE_STEPS = 5 };
/* m: lever arm at which a rotation step moves points by one translation step */
#define ROTATION_LEVER_M CAIRN_REAL(3.0)

/* ---- Scoring ---- */

static void begin_comparing(cairn_map_merge *merge, int32_t first, int32_t second,
                            cairn_pose first_second, int32_t points)
{
    map_merge_comparison *c = &merge->comparison;
    const map_merge_sums none = {0, 0, 0, 0, {0, 0}, 0};
    int32_t of_first = merge->maps[first].point_count, of_second = merge->maps[second].point_count;

    c->first = first;
    c->second = second;
    c->first_second = first_second;
    c->second_to_first = cairn_transform_of(first_second);
    c->first_to_second = cairn_transform_of(cairn_pose_inverse(first_second));
    c->point_counts[0] = of_second < points ? of_second : points;
    c->point_counts[1] = of_first < points ? of_first : points;
    c->cursor = c->direction = 0;
    c->sums[0] = c->sums[1] = none;
}

static int resume_comparing(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_comparison *c = &merge->comparison;

    for (; c->direction < 2; c->direction++, c->cursor = 0) {
        int32_t to = c->direction == 0 ? c->first : c->second,
                from = c->direction == 0 ? c->second : c->first;

        while (c->cursor < c->point_counts[c->direction]) {
            int32_t end = c->cursor + MAP_MERGE_POINTS_PER_UNIT;

            if (!cairn_budget_charge(budget, &merge->units_charged, 1))
                return 0;
            end = end < c->point_counts[c->direction] ? end : c->point_counts[c->direction];
            cairn_map_merge_sum(merge, &merge->maps[to], &merge->maps[from],
                                c->direction == 0 ? &c->second_to_first : &c->first_to_second,
                                c->cursor, end, &c->sums[c->direction]);
            c->cursor = end;
        }
    }
    return 1;
}

/* Returns the m of wall per compared point. */
static cairn_real wall_per_point(const cairn_map_merge *merge,
                                 const map_merge_comparison *comparison, int32_t direction)
{
    const map_merge_map *from =
        &merge->maps[direction == 0 ? comparison->second : comparison->first];

    if (comparison->point_counts[direction] == 0)
        return 0;
    return from->spacing * (cairn_real)from->point_count /
           (cairn_real)comparison->point_counts[direction];
}

cairn_real cairn_map_merge_nats(const cairn_map_merge *merge, cairn_real agree, cairn_real conflict)
{
    return (AGREEMENT_NATS * agree - CONFLICT_NATS * conflict) /
           (merge->params.correlation_length * MAP_MERGE_CELL);
}

static cairn_real log_ratio_of(const cairn_map_merge *merge, const map_merge_comparison *comparison)
{
    cairn_real there = wall_per_point(merge, comparison, 0),
               back = wall_per_point(merge, comparison, 1);
    cairn_real agree = (comparison->sums[0].agree * there + comparison->sums[1].agree * back) / 2;
    cairn_real conflict =
        comparison->sums[0].conflict * there + comparison->sums[1].conflict * back;

    return cairn_map_merge_nats(merge, agree, conflict);
}

/* Returns the search score, with the wider kernel. */
static cairn_real soft_score(const cairn_map_merge *merge)
{
    const map_merge_comparison *c = &merge->comparison;
    cairn_real there = wall_per_point(merge, c, 0), back = wall_per_point(merge, c, 1);

    return (c->sums[0].soft_agree * there + c->sums[1].soft_agree * back) / 2 -
           CONFLICT_WEIGHT * (c->sums[0].soft_conflict * there + c->sums[1].soft_conflict * back);
}

/* ---- Hypotheses ---- */

static int corners_match(const cairn_corner *a, const cairn_corner *b)
{
    return a->kind == b->kind && cairn_abs(a->opening - b->opening) <= MAX_OPENING_DIFFERENCE_RAD;
}

/* Returns the motion that maps corner b onto corner a and aligns the bisectors of their legs. */
static cairn_pose motion_of(const cairn_corner *a, const cairn_corner *b)
{
    cairn_vec2 u = cairn_vec2_add(a->leg[0], a->leg[1]), v = cairn_vec2_add(b->leg[0], b->leg[1]);
    cairn_pose pose = {0, 0, cairn_vec2_angle(v, u)};
    cairn_vec2 moved = cairn_pose_point(pose, b->position);

    pose.x = a->position.x - moved.x;
    pose.y = a->position.y - moved.y;
    return pose;
}

static cairn_status step_hypotheses(cairn_map_merge *merge, cairn_budget *budget)
{
    const map_merge_map *first = &merge->maps[merge->map], *second = &merge->maps[merge->other];
    int32_t count = first->corner_count * second->corner_count;

    for (; merge->cursor < count; merge->cursor++) {
        const cairn_corner *a = &first->corners[merge->cursor / second->corner_count];
        const cairn_corner *b = &second->corners[merge->cursor % second->corner_count];

        if (!merge->is_comparing) {
            if (!cairn_budget_charge(budget, &merge->units_charged, 1))
                return CAIRN_MORE;
            if (!corners_match(a, b))
                continue;
            begin_comparing(merge, merge->map, merge->other, motion_of(a, b),
                            MAP_MERGE_COARSE_POINTS);
            merge->is_comparing = 1;
        }
        if (!resume_comparing(merge, budget))
            return CAIRN_MORE;
        merge->is_comparing = 0;
        merge->tried_count++;
        {
            map_merge_mode mode = {merge->comparison.first_second, soft_score(merge)};

            cairn_map_merge_insert_mode(merge->pairs.hypotheses, &merge->pairs.hypothesis_count,
                                        MAP_MERGE_MAX_HYPOTHESES, mode, MAP_MERGE_COARSE_M,
                                        MAP_MERGE_COARSE_RAD);
        }
    }
    return CAIRN_OK;
}

/* ---- One map against several ---- */

static int32_t quantized(cairn_real x, cairn_real step)
{
    return cairn_real_to_int(cairn_rint(x / step));
}

static map_merge_cache_entry *cache_slot(const cairn_map_merge *merge,
                                         const map_merge_cache_entry *key)
{
    uint32_t h = (uint32_t)key->first * 73856093U ^ (uint32_t)key->second * 19349663U ^
                 (uint32_t)key->x * 83492791U ^ (uint32_t)key->y * 2654435761U ^
                 (uint32_t)key->theta * 40503U;

    return &merge->cache[(h ^ h >> 15) & (MAP_MERGE_CACHE_SLOTS - 1)];
}

static map_merge_cache_entry cache_key(int32_t first, int32_t second, cairn_pose pose)
{
    map_merge_cache_entry key = {first,
                                 second,
                                 quantized(pose.x, CAIRN_REAL(0.02)),
                                 quantized(pose.y, CAIRN_REAL(0.02)),
                                 quantized(pose.theta, CAIRN_REAL(0.005)),
                                 0};

    return key;
}

static int is_cached(const map_merge_cache_entry *slot, const map_merge_cache_entry *key)
{
    return slot->first == key->first && slot->second == key->second && slot->x == key->x &&
           slot->y == key->y && slot->theta == key->theta;
}

void cairn_map_merge_begin_total(cairn_map_merge *merge, int32_t map, cairn_pose pose,
                                 int32_t points)
{
    merge->total.map = map;
    merge->total.pose = pose;
    merge->total.points = points;
    merge->total.neighbour = 0;
    merge->total.neighbours = 0;
    merge->total.log_ratio = merge->total.soft_score = merge->total.known_count = 0;
    merge->total.centroid_sum.x = merge->total.centroid_sum.y = 0;
    merge->is_comparing = 0;
}

/* Adds the comparison with one neighbour to the total. */
static void add_comparison(cairn_map_merge *merge, cairn_real log_ratio)
{
    const map_merge_comparison *c = &merge->comparison;
    cairn_transform t = cairn_transform_of(merge->neighbours.poses[merge->total.neighbour]);
    cairn_real known = (cairn_real)c->sums[0].known_count;
    cairn_vec2 middle = cairn_vec2_scale(c->sums[0].centroid_sum, 1 / cairn_max(known, 1));

    merge->total.soft_score += soft_score(merge);
    merge->total.known_count += known;
    merge->total.centroid_sum = cairn_vec2_add(
        merge->total.centroid_sum, cairn_vec2_scale(cairn_transform_point(t, middle), known));
    merge->total.log_ratio += log_ratio;
    merge->total.neighbours += log_ratio > MIN_NEIGHBOUR_NATS;
}

int cairn_map_merge_step_total(cairn_map_merge *merge, cairn_budget *budget)
{
    int whole = merge->total.points == merge->params.max_points;

    for (; merge->total.neighbour < merge->neighbours.count; merge->total.neighbour++) {
        int32_t near = merge->neighbours.maps[merge->total.neighbour];
        cairn_pose seen =
            cairn_pose_between(merge->neighbours.poses[merge->total.neighbour], merge->total.pose);
        map_merge_cache_entry key = cache_key(near, merge->total.map, seen),
                              *slot = cache_slot(merge, &key);

        if (!merge->is_comparing) {
            if (!cairn_budget_charge(budget, &merge->units_charged, 2))
                return 0;
            if (cairn_map_merge_is_disjoint(merge, near, merge->total.map, seen))
                continue;
            if (whole && is_cached(slot, &key)) {
                merge->total.log_ratio += slot->log_ratio;
                merge->total.neighbours += slot->log_ratio > MIN_NEIGHBOUR_NATS;
                continue;
            }
            begin_comparing(merge, near, merge->total.map, seen, merge->total.points);
            merge->is_comparing = 1;
        }
        if (!resume_comparing(merge, budget))
            return 0;
        merge->is_comparing = 0;
        key.log_ratio = log_ratio_of(merge, &merge->comparison);
        if (whole)
            *slot = key;
        add_comparison(merge, key.log_ratio);
    }
    return 1;
}

/* ---- Refinement ---- */

/* Returns the pose rotated about a point. */
static cairn_pose turned(cairn_pose pose, cairn_vec2 pivot, cairn_real angle)
{
    cairn_vec2 arm = {pose.x - pivot.x, pose.y - pivot.y};
    cairn_pose turn = {pivot.x, pivot.y, angle};
    cairn_vec2 at = cairn_pose_point(turn, arm);
    cairn_pose result = {at.x, at.y, cairn_wrap_angle(pose.theta + angle)};

    return result;
}

/* Returns the pose moved by one step along x or y, or rotated about the pivot: directions 0 ...
 * 5. */
static cairn_pose moved(const cairn_map_merge *merge, int32_t direction)
{
    cairn_real sign = direction % 2 == 0 ? 1 : -1;
    cairn_pose pose = merge->climb.best;

    if (direction < 2) {
        pose.x += sign * merge->climb.step;
    } else if (direction < 4) {
        pose.y += sign * merge->climb.step;
    } else {
        pose = turned(pose, merge->climb.pivot, sign * merge->climb.turn);
    }
    return pose;
}

static void set_step(cairn_map_merge *merge, cairn_real cells)
{
    merge->climb.cells = cells;
    merge->climb.step = cells * merge->maps[merge->total.map].input.resolution;
    merge->climb.turn = merge->climb.step / ROTATION_LEVER_M;
}

static void begin_climb(cairn_map_merge *merge, int32_t map, cairn_pose start, int32_t points,
                        cairn_real first, cairn_real last)
{
    merge->climb.best = start;
    merge->climb.points = points;
    merge->climb.last = last;
    merge->climb.direction = -1;
    merge->climb.rounds = 0;
    merge->climb.improved = 0;
    cairn_map_merge_begin_total(merge, map, start, points);
    set_step(merge, first);
}

/* Accepts or rejects the trial pose; returns 1 when the pattern search has converged. */
static int end_trial(cairn_map_merge *merge)
{
    if (merge->climb.direction < 0 || merge->total.soft_score > merge->climb.score) {
        merge->climb.improved |= merge->climb.direction >= 0;
        merge->climb.best = merge->total.pose;
        merge->climb.score = merge->total.soft_score;
        merge->climb.pivot =
            cairn_vec2_scale(merge->total.centroid_sum, 1 / cairn_max(merge->total.known_count, 1));
    }
    if (++merge->climb.direction < 6)
        return 0;
    merge->climb.direction = 0;
    if (!merge->climb.improved)
        set_step(merge, merge->climb.cells / 2);
    merge->climb.improved = 0;
    return merge->climb.cells < merge->climb.last ||
           ++merge->climb.rounds == MAP_MERGE_MAX_REFINE_STEPS;
}

static int resume_climbing(cairn_map_merge *merge, cairn_budget *budget)
{
    for (;;) {
        if (!cairn_map_merge_step_total(merge, budget))
            return 0;
        if (end_trial(merge))
            return 1;
        cairn_map_merge_begin_total(merge, merge->total.map, moved(merge, merge->climb.direction),
                                    merge->climb.points);
    }
}

/* Scores all hypotheses again with more points; the best are refined. */
static cairn_status step_rescore(cairn_map_merge *merge, cairn_budget *budget)
{
    for (; merge->cursor < merge->pairs.hypothesis_count; merge->cursor++) {
        map_merge_mode mode = merge->pairs.hypotheses[merge->cursor];

        if (!merge->is_comparing) {
            begin_comparing(merge, merge->map, merge->other, mode.first_second,
                            MAP_MERGE_REFINE_POINTS);
            merge->is_comparing = 1;
        }
        if (!resume_comparing(merge, budget))
            return CAIRN_MORE;
        merge->is_comparing = 0;
        mode.log_ratio = soft_score(merge);
        cairn_map_merge_insert_mode(merge->pairs.refined, &merge->pairs.refined_count,
                                    MAP_MERGE_MAX_REFINED, mode, MAP_MERGE_COARSE_M,
                                    MAP_MERGE_COARSE_RAD);
    }
    return CAIRN_OK;
}

/* Returns the start of a variant: a rotated pose, since the search may end in a local maximum
 * beside the best rotation. */
static cairn_pose variant_of(const cairn_map_merge *merge)
{
    cairn_real turn = merge->climb.variant == 1 ? VARIANT_RAD : -VARIANT_RAD;

    return merge->climb.variant == 0 ? merge->pairs.refined[merge->cursor].first_second
                                     : turned(merge->climb.base, merge->climb.base_pivot, turn);
}

/* Refines the current mode by cells, then by lines, then scores it by all points. */
static int step_place(cairn_map_merge *merge, cairn_budget *budget)
{
    if (merge->inner == 0) {
        merge->neighbours.maps[0] = merge->map;
        merge->neighbours.poses[0] = cairn_pose_identity();
        merge->neighbours.count = 1;
        begin_climb(merge, merge->other, variant_of(merge), MAP_MERGE_REFINE_POINTS,
                    COARSE_FIRST_STEP_CELLS, COARSE_LAST_STEP_CELLS);
        merge->inner = 1;
    }
    if (merge->inner == 1) {
        if (!resume_climbing(merge, budget))
            return 0;
        merge->inner = 2;
        if (merge->climb.score < MIN_FINE_SCORE_M)
            merge->inner = 3;
        else
            begin_climb(merge, merge->other, merge->climb.best, merge->params.max_points + 1,
                        FINE_FIRST_STEP_CELLS, FINE_LAST_STEP_CELLS);
    }
    if (merge->inner == 2 && !resume_climbing(merge, budget))
        return 0;
    if (merge->inner < 4) {
        cairn_map_merge_begin_lines(merge, merge->other, merge->climb.best, merge->climb.best,
                                    MAX_LINE_STEPS);
        merge->inner = 4;
    }
    if (merge->inner == 4) {
        if (!cairn_map_merge_step_lines(merge, budget))
            return 0;
        cairn_map_merge_begin_total(merge, merge->other, merge->climb.best,
                                    merge->params.max_points);
        merge->inner = 5;
    }
    return cairn_map_merge_step_total(merge, budget);
}

/* Refines each hypothesis kept, and its variants when its score is high enough. */
static cairn_status step_refine(cairn_map_merge *merge, cairn_budget *budget)
{
    int32_t pair = map_merge_pair(merge->map, merge->other);

    while (merge->cursor < merge->pairs.refined_count) {
        map_merge_mode mode;

        if (!step_place(merge, budget))
            return CAIRN_MORE;
        mode.first_second = merge->climb.best;
        mode.log_ratio = merge->total.log_ratio;
        if (mode.log_ratio > 0)
            cairn_map_merge_insert_mode(merge->pairs.modes +
                                            (size_t)pair * (size_t)merge->params.max_modes,
                                        &merge->pairs.mode_count[pair], merge->params.max_modes,
                                        mode, NMS_RADIUS_M, NMS_RADIUS_RAD);
        if (merge->climb.variant == 0) {
            merge->climb.base = merge->climb.best;
            merge->climb.base_pivot = merge->climb.pivot;
        }
        merge->inner = 0;
        if (mode.log_ratio < MIN_VARIANT_NATS || ++merge->climb.variant == CLIMB_VARIANTS) {
            merge->climb.variant = 0;
            merge->cursor++;
        }
    }
    return CAIRN_OK;
}

static void begin_pair(cairn_map_merge *merge)
{
    merge->cursor = 0;
    merge->inner = 0;
    merge->is_comparing = 0;
    merge->pairs.hypothesis_count = merge->pairs.refined_count = 0;
    merge->climb.variant = 0;
    merge->phase = MAP_MERGE_HYPOTHESES;
    if (merge->other < merge->map_count)
        merge->pairs.mode_count[map_merge_pair(merge->map, merge->other)] = 0;
}

static cairn_status step_phase(cairn_map_merge *merge, cairn_budget *budget)
{
    switch (merge->phase) {
    case MAP_MERGE_HYPOTHESES:
        return step_hypotheses(merge, budget);
    case MAP_MERGE_ROTATIONS:
    case MAP_MERGE_TRANSLATIONS:
        return cairn_map_merge_correlate(merge, budget);
    case MAP_MERGE_CURVE_PAIRS:
        return cairn_map_merge_register_curve_points(merge, budget);
    case MAP_MERGE_RESCORE:
        return step_rescore(merge, budget);
    default:
        return step_refine(merge, budget);
    }
}

cairn_status cairn_map_merge_find_modes(cairn_map_merge *merge, cairn_budget *budget)
{
    if (merge->phase == MAP_MERGE_OCCUPIED_DISTANCE) {
        if (!cairn_budget_charge(budget, &merge->units_charged, MAP_MERGE_CACHE_SLOTS / 16))
            return CAIRN_MORE;
        for (int32_t i = 0; i < MAP_MERGE_CACHE_SLOTS; i++)
            merge->cache[i].first = -1;
        merge->map = 0;
        merge->other = 1;
        begin_pair(merge);
    }
    while (merge->other < merge->map_count) {
        cairn_status status = step_phase(merge, budget);

        if (status != CAIRN_OK)
            return status;
        if (merge->phase < MAP_MERGE_REFINE) {
            merge->phase++;
            merge->cursor = 0;
            merge->inner = 0;
            continue;
        }
        if (++merge->map == merge->other) {
            merge->map = 0;
            merge->other++;
        }
        begin_pair(merge);
    }
    return CAIRN_OK;
}
