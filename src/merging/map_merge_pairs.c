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
/* directions of the pattern: to either side along x, along y, and rotated */
enum { PATTERN_DIRECTIONS = 6 };
/* maximum steps of a refinement by lines */
enum { MAX_LINE_STEPS = 5 };
/* m: lever arm at which a rotation step moves points by one translation step */
#define ROTATION_LEVER_M CAIRN_REAL(3.0)

/* units of a neighbour whose score is looked up or begun; slots of the cache that are cleared per
 * unit */
enum { UNITS_PER_NEIGHBOUR = 2, SLOTS_PER_UNIT = 16 };

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
    c->sums[0] = c->sums[1] = none;
}

/* Looks up the next points of one map in the grid of the other. */
static void look_up_points(cairn_map_merge *merge)
{
    map_merge_comparison *c = &merge->comparison;
    int32_t to = c->direction == 0 ? c->first : c->second,
            from = c->direction == 0 ? c->second : c->first,
            end = c->point + MAP_MERGE_POINTS_PER_UNIT, count = c->point_counts[c->direction];

    cairn_map_merge_sum(merge, &merge->maps[to], &merge->maps[from],
                        c->direction == 0 ? &c->second_to_first : &c->first_to_second, c->point,
                        end < count ? end : count, &c->sums[c->direction]);
}

/* Step: looks up the points of each map in the grid of the other. */
static int compare(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_comparison *c = &merge->comparison;

    CAIRN_STEP_BEGIN(merge->resume.comparison);
    for (c->direction = 0; c->direction < 2; c->direction++)
        for (c->point = 0; c->point < c->point_counts[c->direction];
             c->point += MAP_MERGE_POINTS_PER_UNIT) {
            CAIRN_STEP_CHARGE_UNIT(merge, resume.comparison, budget);
            look_up_points(merge);
        }
    CAIRN_STEP_END(merge->resume.comparison);
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

/* Returns 1 when the current pair of corners matches, and begins to score its motion. */
static int begin_corners(cairn_map_merge *merge)
{
    const map_merge_pairs *pairs = &merge->pairs;
    const cairn_corner *a = &merge->maps[pairs->first].corners[pairs->corners.first],
                       *b = &merge->maps[pairs->second].corners[pairs->corners.second];

    if (!corners_match(a, b))
        return 0;
    begin_comparing(merge, pairs->first, pairs->second, motion_of(a, b), MAP_MERGE_COARSE_POINTS);
    return 1;
}

static void end_corners(cairn_map_merge *merge)
{
    merge->tried_count++;
    cairn_map_merge_insert_hypothesis(merge, merge->comparison.first_second, soft_score(merge));
}

/* Step: registers the current pair of maps by all pairs of corners. */
static int match_corners(cairn_map_merge *merge, cairn_budget *budget)
{
    const map_merge_map *first = &merge->maps[merge->pairs.first],
                        *second = &merge->maps[merge->pairs.second];
    map_merge_item_pair *at = &merge->pairs.corners;

    CAIRN_STEP_BEGIN(merge->resume.phase);
    for (at->first = 0; at->first < first->corner_count; at->first++)
        for (at->second = 0; at->second < second->corner_count; at->second++) {
            CAIRN_STEP_CHARGE_UNIT(merge, resume.phase, budget);
            if (!begin_corners(merge))
                continue;
            CAIRN_STEP_RUN(merge, resume.phase, budget, compare);
            end_corners(merge);
        }
    CAIRN_STEP_END(merge->resume.phase);
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
    merge->total.neighbours = 0;
    merge->total.log_ratio = merge->total.soft_score = merge->total.known_count = 0;
    merge->total.centroid_sum.x = merge->total.centroid_sum.y = 0;
}

static void add_log_ratio(map_merge_total *total, cairn_real log_ratio)
{
    total->log_ratio += log_ratio;
    total->neighbours += log_ratio > MIN_NEIGHBOUR_NATS;
}

/* Returns 1 when the total is over all points, and its scores are cached. */
static int is_whole(const cairn_map_merge *merge)
{
    return merge->total.points == merge->params.max_points;
}

/* Returns 1 when the pose must be compared with the current neighbour, and begins to: it can
 * overlap, and no score is cached, which is added else. */
static int begin_neighbour(cairn_map_merge *merge)
{
    map_merge_total *total = &merge->total;
    int32_t near = merge->neighbours.maps[total->neighbour];
    cairn_pose seen = cairn_pose_between(merge->neighbours.poses[total->neighbour], total->pose);

    if (cairn_map_merge_is_disjoint(merge, near, total->map, seen))
        return 0;
    if (is_whole(merge)) {
        const map_merge_cache_entry *slot;

        total->key = cache_key(near, total->map, seen);
        slot = cache_slot(merge, &total->key);
        if (is_cached(slot, &total->key)) {
            add_log_ratio(total, slot->log_ratio);
            return 0;
        }
    }
    begin_comparing(merge, near, total->map, seen, total->points);
    return 1;
}

/* Adds the comparison with the current neighbour to the total, and to the cache. */
static void end_neighbour(cairn_map_merge *merge)
{
    map_merge_total *total = &merge->total;
    const map_merge_sums *sums = &merge->comparison.sums[0];
    cairn_transform t = cairn_transform_of(merge->neighbours.poses[total->neighbour]);
    cairn_real known = (cairn_real)sums->known_count,
               log_ratio = log_ratio_of(merge, &merge->comparison);
    cairn_vec2 middle = cairn_vec2_scale(sums->centroid_sum, 1 / cairn_max(known, 1));

    if (is_whole(merge)) {
        total->key.log_ratio = log_ratio;
        *cache_slot(merge, &total->key) = total->key;
    }
    total->soft_score += soft_score(merge);
    total->known_count += known;
    total->centroid_sum = cairn_vec2_add(total->centroid_sum,
                                         cairn_vec2_scale(cairn_transform_point(t, middle), known));
    add_log_ratio(total, log_ratio);
}

int cairn_map_merge_step_total(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_total *total = &merge->total;

    CAIRN_STEP_BEGIN(merge->resume.total);
    for (total->neighbour = 0; total->neighbour < merge->neighbours.count; total->neighbour++) {
        CAIRN_STEP_CHARGE(merge, resume.total, budget, UNITS_PER_NEIGHBOUR);
        if (!begin_neighbour(merge))
            continue;
        CAIRN_STEP_RUN(merge, resume.total, budget, compare);
        end_neighbour(merge);
    }
    CAIRN_STEP_END(merge->resume.total);
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

/* Returns the best pose moved by one step of the pattern. */
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

/* Begins the pattern search of the current pair's second map. */
static void begin_climb(cairn_map_merge *merge, cairn_pose start, int32_t points, cairn_real first,
                        cairn_real last)
{
    merge->climb.points = points;
    merge->climb.last = last;
    merge->climb.rounds = 0;
    cairn_map_merge_begin_total(merge, merge->pairs.second, start, points);
    set_step(merge, first);
}

static void begin_trial(cairn_map_merge *merge)
{
    cairn_map_merge_begin_total(merge, merge->total.map, moved(merge, merge->climb.direction),
                                merge->climb.points);
}

/* Makes the pose that was scored the best one. */
static void accept_trial(cairn_map_merge *merge)
{
    merge->climb.best = merge->total.pose;
    merge->climb.score = merge->total.soft_score;
    merge->climb.pivot =
        cairn_vec2_scale(merge->total.centroid_sum, 1 / cairn_max(merge->total.known_count, 1));
}

static void end_trial(cairn_map_merge *merge)
{
    if (!(merge->total.soft_score > merge->climb.score))
        return;
    merge->climb.improved = 1;
    accept_trial(merge);
}

/* Halves a pattern that has not improved the pose; returns 1 when the search has converged. */
static int end_pattern(cairn_map_merge *merge)
{
    if (!merge->climb.improved)
        set_step(merge, merge->climb.cells / 2);
    return merge->climb.cells < merge->climb.last ||
           ++merge->climb.rounds == MAP_MERGE_MAX_REFINE_STEPS;
}

/* Step: the pattern search. */
static int search_pattern(cairn_map_merge *merge, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(merge->resume.climb);
    CAIRN_STEP_RUN(merge, resume.climb, budget, cairn_map_merge_step_total);
    accept_trial(merge);
    do {
        merge->climb.improved = 0;
        for (merge->climb.direction = 0; merge->climb.direction < PATTERN_DIRECTIONS;
             merge->climb.direction++) {
            begin_trial(merge);
            CAIRN_STEP_RUN(merge, resume.climb, budget, cairn_map_merge_step_total);
            end_trial(merge);
        }
    } while (!end_pattern(merge));
    CAIRN_STEP_END(merge->resume.climb);
}

/* Inserts the current hypothesis, scored again, into those to be refined. */
static void insert_refined(cairn_map_merge *merge)
{
    map_merge_mode mode = {merge->comparison.first_second, soft_score(merge)};

    cairn_map_merge_insert_mode(merge->pairs.refined, &merge->pairs.refined_count,
                                MAP_MERGE_MAX_REFINED, mode, MAP_MERGE_COARSE_M,
                                MAP_MERGE_COARSE_RAD);
}

/* Step: scores all hypotheses again with more points; the best are refined. */
static int rescore(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_pairs *pairs = &merge->pairs;

    CAIRN_STEP_BEGIN(merge->resume.phase);
    for (pairs->hypothesis = 0; pairs->hypothesis < pairs->hypothesis_count; pairs->hypothesis++) {
        begin_comparing(merge, pairs->first, pairs->second,
                        pairs->hypotheses[pairs->hypothesis].first_second, MAP_MERGE_REFINE_POINTS);
        CAIRN_STEP_RUN(merge, resume.phase, budget, compare);
        insert_refined(merge);
    }
    CAIRN_STEP_END(merge->resume.phase);
}

/* Returns the start of a variant: a rotated pose, since the search may end in a local maximum
 * beside the best rotation. */
static cairn_pose variant_of(const map_merge_pairs *pairs)
{
    cairn_real turn = pairs->variant == 1 ? VARIANT_RAD : -VARIANT_RAD;

    return pairs->variant == 0 ? pairs->refined[pairs->mode].first_second
                               : turned(pairs->base, pairs->base_pivot, turn);
}

static void begin_variant(cairn_map_merge *merge)
{
    merge->neighbours.maps[0] = merge->pairs.first;
    merge->neighbours.poses[0] = cairn_pose_identity();
    merge->neighbours.count = 1;
    begin_climb(merge, variant_of(&merge->pairs), MAP_MERGE_REFINE_POINTS, COARSE_FIRST_STEP_CELLS,
                COARSE_LAST_STEP_CELLS);
}

/* Step: refines the current variant by cells, then by lines, then scores it by all points. */
static int refine_variant(cairn_map_merge *merge, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(merge->resume.part);
    begin_variant(merge);
    CAIRN_STEP_RUN(merge, resume.part, budget, search_pattern);
    if (merge->climb.score >= MIN_FINE_SCORE_M) {
        begin_climb(merge, merge->climb.best, merge->params.max_points + 1, FINE_FIRST_STEP_CELLS,
                    FINE_LAST_STEP_CELLS);
        CAIRN_STEP_RUN(merge, resume.part, budget, search_pattern);
    }
    cairn_map_merge_begin_fit(merge, merge->pairs.second, merge->climb.best, merge->climb.best,
                              MAX_LINE_STEPS);
    CAIRN_STEP_RUN(merge, resume.part, budget, cairn_map_merge_step_lines);
    cairn_map_merge_begin_total(merge, merge->pairs.second, merge->fit.pose,
                                merge->params.max_points);
    CAIRN_STEP_RUN(merge, resume.part, budget, cairn_map_merge_step_total);
    CAIRN_STEP_END(merge->resume.part);
}

/* Inserts the refined variant into the pair's modes; returns 1 when its score is high enough for
 * further ones. */
static int end_variant(cairn_map_merge *merge)
{
    map_merge_pairs *pairs = &merge->pairs;
    map_merge_mode mode = {merge->fit.pose, merge->total.log_ratio};

    if (mode.log_ratio > 0)
        cairn_map_merge_insert_pair_mode(merge, mode, NMS_RADIUS_M, NMS_RADIUS_RAD);
    if (pairs->variant == 0) {
        pairs->base = mode.first_second;
        pairs->base_pivot = merge->climb.pivot;
    }
    return mode.log_ratio >= MIN_VARIANT_NATS;
}

/* Step: refines each hypothesis kept, and its variants when its score is high enough. */
static int refine(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_pairs *pairs = &merge->pairs;

    CAIRN_STEP_BEGIN(merge->resume.phase);
    for (pairs->mode = 0; pairs->mode < pairs->refined_count; pairs->mode++)
        for (pairs->variant = 0; pairs->variant < CLIMB_VARIANTS; pairs->variant++) {
            CAIRN_STEP_RUN(merge, resume.phase, budget, refine_variant);
            if (!end_variant(merge))
                break;
        }
    CAIRN_STEP_END(merge->resume.phase);
}

/* ---- All pairs ---- */

static void clear_cache(cairn_map_merge *merge)
{
    for (int32_t i = 0; i < MAP_MERGE_CACHE_SLOTS; i++)
        merge->cache[i].first = -1;
}

static void begin_pair(map_merge_pairs *pairs)
{
    pairs->hypothesis_count = pairs->refined_count = 0;
    pairs->mode_count[cairn_map_merge_pair(pairs->first, pairs->second)] = 0;
}

int cairn_map_merge_find_modes(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_pairs *pairs = &merge->pairs;

    CAIRN_STEP_BEGIN(merge->resume.stage);
    CAIRN_STEP_CHARGE(merge, resume.stage, budget, MAP_MERGE_CACHE_SLOTS / SLOTS_PER_UNIT);
    clear_cache(merge);
    for (pairs->second = 1; pairs->second < merge->map_count; pairs->second++)
        for (pairs->first = 0; pairs->first < pairs->second; pairs->first++) {
            begin_pair(pairs);
            CAIRN_STEP_RUN(merge, resume.stage, budget, match_corners);
            CAIRN_STEP_RUN(merge, resume.stage, budget, cairn_map_merge_find_rotations);
            CAIRN_STEP_RUN(merge, resume.stage, budget, cairn_map_merge_try_translations);
            CAIRN_STEP_RUN(merge, resume.stage, budget, cairn_map_merge_register_curve_points);
            CAIRN_STEP_RUN(merge, resume.stage, budget, rescore);
            CAIRN_STEP_RUN(merge, resume.stage, budget, refine);
        }
    CAIRN_STEP_END(merge->resume.stage);
}
