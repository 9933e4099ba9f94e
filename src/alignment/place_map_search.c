/* place_map: matching, consensus and refinement. place_map.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/place_map_variants.h"
#include "src/alignment/place_map_work.h"

/* Points or beams copied and hypotheses linked in a work unit; sweeps that decouple all scans. */
enum { POINTS_PER_UNIT = 16, HYPOTHESES_PER_UNIT = 2, DECOUPLED_SWEEPS = 10 };

/* m and rad: standard deviations of a scan's pose within its place, for its individual
 * alignment. */
static const cairn_real SCAN_SIGMA_M = CAIRN_REAL(0.03);
static const cairn_real SCAN_SIGMA_RAD = CAIRN_REAL(0.02);

/* nats: least log-likelihood ratio of a stored pair; moving people penalize a pose until the map
 * invalidates their points. */
static const cairn_real MIN_PAIR_NATS = -3;

/* m: a place that the consensus moves farther changes the map. */
static const cairn_real MAX_UNMOVED_M = CAIRN_REAL(0.3);

/* ---- Matching ---- */

/* Copies the points of a scan for matching: without dynamic-object candidates, until a map shows
 * which of them are static. */
static int32_t copy_points(const cairn_place_map *map, const place_map_place_scan *scan,
                           cairn_transform t, cairn_oriented_point *out)
{
    int32_t count = 0;

    for (int32_t i = scan->first_point; i < scan->first_point + scan->point_count; i++)
        if (map->round > 0 ? map->point_class[i] < PLACE_MAP_POINT_INVALIDATED
                           : map->point_class[i] == PLACE_MAP_POINT_STATIC)
            out[count++] = place_map_placed_point(t, map->points[i]);
    return count;
}

static const place_map_place_scan *visited_scan(const cairn_place_map *map)
{
    return &map->scans[map->visit.scan];
}

/* Returns the units of copying the points and beams of the visited scan. */
static int32_t copy_units(const cairn_place_map *map)
{
    return (visited_scan(map)->point_count + visited_scan(map)->beam_count) / POINTS_PER_UNIT;
}

/* Copies the points of the visited scan in its own frame; returns their number. */
static int32_t copy_own(cairn_place_map *map)
{
    return copy_points(map, visited_scan(map), cairn_transform_of(cairn_pose_identity()),
                       map->query_points);
}

/* Adds the visited scan to the target. */
static void add_to_target(cairn_place_map *map)
{
    const place_map_place_scan *scan = visited_scan(map);
    cairn_scan_match_part part = {.points = map->query_points,
                                  .beams = map->beams + scan->first_beam,
                                  .beam_count = scan->beam_count};

    part.count = copy_own(map);
    cairn_must_be_ok(cairn_scan_match_add_target(
        map->match, &part, cairn_pose_compose(map->places[scan->place].map_place, scan->place_scan),
        NULL));
}

/* Returns 1 when a place is part of the target of the current query. */
static int is_target(const cairn_place_map *map, int32_t place)
{
    if (map->params.mode == CAIRN_PLACE_MAP_SEQUENTIAL)
        return place < map->query && place >= map->query - map->params.recent_places;
    return map->round == 0 ? place == map->place
                           : place != map->query && map->places[place].component == 0;
}

/* Step of a part: makes the target of the query. In the first round the place is at the origin. */
static int make_target(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.part);
    CAIRN_STEP_CHARGE_UNIT(map, resume.part, budget);
    cairn_scan_match_clear_target(map->match);
    for (map->visit.scan = 0; map->visit.scan < map->scan_count; map->visit.scan++) {
        if (!is_target(map, visited_scan(map)->place))
            continue;
        CAIRN_STEP_CHARGE(map, resume.part, budget, copy_units(map));
        add_to_target(map);
    }
    CAIRN_STEP_END(map->resume.part);
}

/* Returns 1 when a place is part of the query: the query itself, or a place of the component that
 * is matched as a whole. */
static int is_in_query(const cairn_place_map *map, int32_t place)
{
    return place == map->query ||
           (map->query_part > 0 && map->places[place].component == map->query_part);
}

/* Returns the pose of a place of the query in the frame of the query. */
static cairn_pose query_place(const cairn_place_map *map, int32_t place)
{
    return place == map->query ? cairn_pose_identity()
                               : cairn_pose_between(map->places[map->query].map_place,
                                                    map->places[place].map_place);
}

/* Adds the visited scan to the query, in the frame of the query's place; beams of that place alone,
 * as free space is known from one place at a time. */
static void add_to_query(cairn_place_map *map)
{
    const place_map_place_scan *scan = visited_scan(map);
    cairn_scan_match_part *part = &map->part;
    cairn_transform t =
        cairn_transform_of(cairn_pose_compose(query_place(map, scan->place), scan->place_scan));

    part->count += copy_points(map, scan, t, map->query_points + part->count);
    for (int32_t i = 0; i < scan->beam_count && scan->place == map->query; i++) {
        cairn_scan_beam beam = map->beams[scan->first_beam + i];

        cairn_place_map_place_beam(t, &beam);
        map->query_beams[part->beam_count++] = beam;
    }
}

static void begin_query(cairn_place_map *map)
{
    cairn_scan_match_part none = {.points = map->query_points, .beams = map->query_beams};

    map->part = none;
}

/* Step of an inner part: copies the points and beams of the query. */
static int make_query(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.inner);
    begin_query(map);
    for (map->visit.scan = 0; map->visit.scan < map->scan_count; map->visit.scan++) {
        if (!is_in_query(map, visited_scan(map)->place))
            continue;
        CAIRN_STEP_CHARGE(map, resume.inner, budget, copy_units(map));
        add_to_query(map);
    }
    CAIRN_STEP_END(map->resume.inner);
}

/* Adds the hypothesis of two places, one of the target and one of the query, that follows from a
 * match, if its log-likelihood ratio is high enough: with a map it must be positive. */
static void add_pair(cairn_place_map *map)
{
    cairn_scan_match_result found = cairn_scan_match_read(map->match);
    const cairn_scan_match_hypothesis *hypothesis = &found.hypotheses[map->hypothesis];
    cairn_pose map_target = map->places[map->target].map_place,
               map_place =
                   map->moved == map->query
                       ? hypothesis->target_query
                       : cairn_pose_compose(hypothesis->target_query, query_place(map, map->moved));
    cairn_pose seen = cairn_pose_between(map_target, map_place);
    cairn_real covariance[9];

    if (!(cairn_place_map_pair_likelihood(map, map->target, map->moved, seen) >
          (map->round > 0 ? 0 : MIN_PAIR_NATS)))
        return;
    if (map->round > 0)
        cairn_place_map_rotate_covariance(hypothesis->covariance, map_target.theta, covariance);
    cairn_place_map_add_hypothesis(map, map->target, map->moved, seen,
                                   map->round > 0 ? covariance : hypothesis->covariance);
}

/* Step of an inner part: adds the hypotheses of the match, of all pairs of a place of the target and
 * one of the query. */
static int add_pairs(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.inner);
    for (map->hypothesis = 0; map->hypothesis < cairn_scan_match_read(map->match).count;
         map->hypothesis++)
        for (map->target = 0; map->target < map->place_count; map->target++) {
            if (!is_target(map, map->target))
                continue;
            for (map->moved = 0; map->moved < map->place_count; map->moved++) {
                if (!is_in_query(map, map->moved))
                    continue;
                CAIRN_STEP_CHARGE(map, resume.inner, budget,
                                  cairn_place_map_pair_units(map, map->target, map->moved));
                add_pair(map);
            }
        }
    CAIRN_STEP_END(map->resume.inner);
}

static int begin_match(cairn_place_map *map)
{
    cairn_status status =
        cairn_scan_match_begin(map->match, &map->part, cairn_pose_identity(), NULL, NULL);

    CAIRN_ASSERT(status == CAIRN_OK);
    return status == CAIRN_OK;
}

/* Sequential mode: places the query by its best match. */
static void place_query(cairn_place_map *map)
{
    cairn_scan_match_result found = cairn_scan_match_read(map->match);

    if (found.count > 0)
        map->places[map->query].map_place = found.hypotheses[0].target_query;
}

/* Step of a part: matches the query with the target. */
static int match(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.part);
    map->query_part = map->round > 0 ? map->places[map->query].component : 0;
    CAIRN_STEP_RUN(map, resume.part, budget, make_query);
    CAIRN_STEP_CHARGE_UNIT(map, resume.part, budget);
    if (begin_match(map)) {
        CAIRN_STEP_UNTIL(map->resume.part, cairn_scan_match_step(map->match, budget) == CAIRN_OK);
        map->result.matches++;
        if (map->params.mode == CAIRN_PLACE_MAP_SEQUENTIAL)
            place_query(map);
        else
            CAIRN_STEP_RUN(map, resume.part, budget, add_pairs);
    }
    CAIRN_STEP_END(map->resume.part);
}

/* Step of a phase: matches all pairs of places. */
static int match_pairs(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.phase);
    for (map->place = 0; map->place + 1 < map->place_count; map->place++) {
        CAIRN_STEP_RUN(map, resume.phase, budget, make_target);
        for (map->query = map->place + 1; map->query < map->place_count; map->query++)
            CAIRN_STEP_RUN(map, resume.phase, budget, match);
    }
    CAIRN_STEP_END(map->resume.phase);
}

/* Returns 1 when the query's smaller component was already matched in this round. */
static int was_matched(const cairn_place_map *map)
{
    int32_t part = map->places[map->query].component;

    for (int32_t i = 0; i < map->query && map->round > 0 && part > 0; i++)
        if (map->places[i].component == part)
            return 1;
    return 0;
}

/* Step of a phase: matches every place, or component, with the map of all others; in the sequential
 * mode with the places before. */
static int match_with_map(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.phase);
    for (map->query = map->round > 0 ? 0 : 1; map->query < map->place_count; map->query++) {
        if (was_matched(map))
            continue;
        CAIRN_STEP_RUN(map, resume.phase, budget, make_target);
        CAIRN_STEP_RUN(map, resume.phase, budget, match);
    }
    CAIRN_STEP_END(map->resume.phase);
}

/* ---- Consensus ---- */

static void store_consensus(cairn_place_map *map)
{
    cairn_pose_consensus_result found = cairn_pose_consensus_read(map->consensus);

    map->result.total = found.total;
    map->result.competing_total = found.competing_total;
    map->moved_places = 0;
    for (int32_t i = 0; i < map->place_count; i++) {
        cairn_pose_consensus_estimate node = cairn_pose_consensus_node(map->consensus, i);
        cairn_pose before = map->places[i].map_place;

        map->moved_places +=
            node.component != map->places[i].component ||
            cairn_abs(node.map_node.x - before.x) + cairn_abs(node.map_node.y - before.y) >
                MAX_UNMOVED_M;
        map->places[i].map_place = node.map_node;
        map->places[i].component = node.component;
    }
}

/* Rounds continue while the map changes. */
static int is_last_round(const cairn_place_map *map)
{
    return map->round >= map->params.rematch_rounds || map->moved_places == 0;
}

/* Step of a phase: the consensus of all hypotheses. Submaps are searched in the last map only:
 * earlier, weak links may still get more support. */
static int find_consensus(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.phase);
    CAIRN_STEP_CHARGE(map, resume.phase, budget,
                      1 + map->place_count + map->result.hypotheses / HYPOTHESES_PER_UNIT);
    cairn_must_be_ok(cairn_pose_consensus_begin(map->consensus));
    CAIRN_STEP_UNTIL(map->resume.phase,
                     cairn_pose_consensus_step(map->consensus, budget) == CAIRN_OK);
    store_consensus(map);
    map->submaps_found = is_last_round(map);
    if (map->submaps_found) {
        CAIRN_STEP_CHARGE(map, resume.phase, budget, 1 + map->place_count);
        cairn_must_be_ok(cairn_pose_consensus_find_submaps(map->consensus));
        CAIRN_STEP_UNTIL(map->resume.phase,
                         cairn_pose_consensus_step(map->consensus, budget) == CAIRN_OK);
        store_consensus(map);
    }
    CAIRN_STEP_END(map->resume.phase);
}

/* ---- Refinement ---- */

static void place_all_scans(cairn_place_map *map)
{
    for (int32_t i = 0; i < map->place_count; i++)
        cairn_place_map_place_scans(map, i);
}

/* Returns 1 when the visited scan is part of the ICP target: of the component of the place that is
 * aligned, but not of the place, or not the one scan that is decoupled. */
static int is_other(const cairn_place_map *map)
{
    const place_map_place_scan *scan = visited_scan(map);

    return (map->scan < 0 ? scan->place != map->query : map->visit.scan != map->scan) &&
           map->places[scan->place].component == map->places[map->query].component;
}

/* Step of a part: sets the ICP target, of valid points. */
static int target_others(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.part);
    CAIRN_STEP_CHARGE_UNIT(map, resume.part, budget);
    cairn_icp_clear_target(map->icp);
    for (map->visit.scan = 0; map->visit.scan < map->scan_count; map->visit.scan++) {
        if (!is_other(map))
            continue;
        CAIRN_STEP_CHARGE(map, resume.part, budget,
                          visited_scan(map)->point_count / POINTS_PER_UNIT);
        cairn_must_be_ok(cairn_icp_add_target(map->icp, map->query_points, copy_own(map),
                                              visited_scan(map)->map_scan, NULL));
    }
    CAIRN_STEP_END(map->resume.part);
}

/* Starts the alignment of the query, or of the scan that is decoupled, near its pose; 0 when there
 * is none. */
static int begin_refinement(cairn_place_map *map)
{
    return cairn_icp_begin(map->icp, map->part.points, map->part.count,
                           map->places[map->query].map_place, NULL, NULL) == CAIRN_OK;
}

static int begin_decoupling(cairn_place_map *map)
{
    const place_map_place_scan *scan = &map->scans[map->scan];
    cairn_rigid_motion_pose_prior prior = {scan->map_scan, SCAN_SIGMA_M, SCAN_SIGMA_M,
                                           SCAN_SIGMA_RAD};

    return cairn_icp_begin(map->icp, map->points + scan->first_point, scan->point_count,
                           scan->map_scan, &prior, NULL) == CAIRN_OK;
}

/* Keeps the aligned pose of the query, or of the scan. */
static void store_refinement(cairn_place_map *map)
{
    cairn_icp_result aligned = cairn_icp_read(map->icp);

    if (aligned.verdict == CAIRN_ICP_TOO_FEW_PAIRS)
        return;
    if (map->scan < 0) {
        map->places[map->query].map_place = aligned.target_query;
        cairn_place_map_place_scans(map, map->query);
    } else {
        map->scans[map->scan].map_scan = aligned.target_query;
        map->result.decoupled += map->sweep == 0;
    }
}

/* Step of a phase: aligns each place with all others of its component, in turn. */
static int refine(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.phase);
    CAIRN_STEP_CHARGE(map, resume.phase, budget, map->scan_count);
    place_all_scans(map);
    map->query_part = 0;
    map->scan = -1;
    for (map->sweep = 0; map->sweep < map->params.refinement_sweeps; map->sweep++)
        for (map->query = 0; map->query < map->place_count; map->query++) {
            CAIRN_STEP_RUN(map, resume.phase, budget, target_others);
            CAIRN_STEP_RUN(map, resume.phase, budget, make_query);
            if (!begin_refinement(map))
                continue;
            CAIRN_STEP_UNTIL(map->resume.phase, cairn_icp_step(map->icp, budget) == CAIRN_OK);
            store_refinement(map);
        }
    CAIRN_STEP_END(map->resume.phase);
}

/* Step of a phase: aligns each scan with all others of its component, in turn. */
static int decouple(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.phase);
    for (map->sweep = 0; map->sweep < DECOUPLED_SWEEPS; map->sweep++)
        for (map->scan = 0; map->scan < map->scan_count; map->scan++) {
            map->query = map->scans[map->scan].place;
            CAIRN_STEP_RUN(map, resume.phase, budget, target_others);
            if (!begin_decoupling(map))
                continue;
            CAIRN_STEP_UNTIL(map->resume.phase, cairn_icp_step(map->icp, budget) == CAIRN_OK);
            store_refinement(map);
        }
    CAIRN_STEP_END(map->resume.phase);
}

/* Returns an offset, m, that keeps the components out of each other's range in the aligner. It needs
 * no subtraction: each component moves to its first place at the end. */
static cairn_real component_offset(const cairn_place_map *map, int32_t place)
{
    return CAIRN_REAL(1e3) * (cairn_real)map->places[place].component;
}

/* Starts from the poses of the places; 0 when the aligner refuses them. */
static int begin_alignment(cairn_place_map *map)
{
    cairn_status status = CAIRN_OK;

    for (int32_t s = 0; s < map->scan_count && status == CAIRN_OK; s++) {
        cairn_pose start = map->scans[s].map_scan;

        start.x += component_offset(map, map->scans[s].place);
        status = cairn_aligner_set_initial_pose(map->aligner, s, start);
    }
    return status == CAIRN_OK && cairn_aligner_begin(map->aligner) == CAIRN_OK;
}

static void store_alignment(cairn_place_map *map)
{
    for (int32_t s = map->scan_count - 1; s >= 0; s--) {
        place_map_place_scan *scan = &map->scans[s];
        place_map_place *here = &map->places[scan->place];
        cairn_aligner_pose found = cairn_aligner_pose_of(map->aligner, s);

        scan->map_scan = found.map_scan;
        map->result.decoupled += found.anchored;
        if (s == here->first_scan)
            here->map_place =
                cairn_pose_compose(found.map_scan, cairn_pose_inverse(scan->place_scan));
    }
}

/* Step of a phase: joint alignment of all scans. */
static int align_jointly(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.phase);
    CAIRN_STEP_CHARGE(map, resume.phase, budget, 2 * map->scan_count);
    if (begin_alignment(map)) {
        CAIRN_STEP_UNTIL(map->resume.phase, cairn_aligner_step(map->aligner, budget) == CAIRN_OK);
        store_alignment(map);
    }
    CAIRN_STEP_END(map->resume.phase);
}

/* ---- All of it ---- */

int cairn_place_map_run(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.run);
    for (map->place = 0; map->place < map->place_count; map->place++)
        CAIRN_STEP_RUN(map, resume.run, budget, cairn_place_map_build_visibility);
    if (map->params.mode == CAIRN_PLACE_MAP_SEQUENTIAL) {
        CAIRN_STEP_RUN(map, resume.run, budget, match_with_map);
    } else {
        CAIRN_STEP_RUN(map, resume.run, budget, match_pairs);
        for (;;) {
            CAIRN_STEP_RUN(map, resume.run, budget, cairn_place_map_score);
            CAIRN_STEP_RUN(map, resume.run, budget, find_consensus);
            CAIRN_STEP_RUN(map, resume.run, budget, cairn_place_map_classify);
            map->round++;
            if (map->submaps_found)
                break;
            CAIRN_STEP_RUN(map, resume.run, budget, match_with_map);
        }
        CAIRN_STEP_RUN(map, resume.run, budget, refine);
    }
    CAIRN_STEP_CHARGE(map, resume.run, budget, map->scan_count);
    place_all_scans(map);
    if (map->aligner != NULL)
        CAIRN_STEP_RUN(map, resume.run, budget, align_jointly);
    else if (map->params.decoupled != CAIRN_PLACE_MAP_COUPLED)
        CAIRN_STEP_RUN(map, resume.run, budget, decouple);
    CAIRN_STEP_CHARGE(map, resume.run, budget, cairn_place_map_finish_units(map));
    cairn_place_map_finish(map);
    CAIRN_STEP_END(map->resume.run);
}
