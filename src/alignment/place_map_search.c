/* place_map: matching, consensus and refinement, item by item. place_map.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/place_map_work.h"

enum { POINTS_PER_UNIT = 16, CELLS_PER_UNIT = 1024, DECOUPLED_SWEEPS = 10 };

/* m and rad: standard deviations of a scan's pose within its place, for its individual
 * alignment. */
static const cairn_real SCAN_SIGMA_M = CAIRN_REAL(0.03);
static const cairn_real SCAN_SIGMA_RAD = CAIRN_REAL(0.02);

/* nats: least log-likelihood ratio of a stored pair; moving people penalize a pose until the map
 * invalidates their points. */
static const cairn_real MIN_PAIR_NATS = -3;

/* m: a place that the consensus moves farther changes the map. */
static const cairn_real MAX_UNMOVED_M = CAIRN_REAL(0.3);

/* ---- Visibility grids ---- */

static void visibility_item(cairn_place_map *map)
{
    size_t cells = (size_t)map->visibility_side * (size_t)map->visibility_side;

    if (map->item == 0) {
        memset(map->visibility + (size_t)map->place * cells, PLACE_MAP_VISIBILITY_UNKNOWN, cells);
        map->units_due += 1 + (int32_t)(cells / CELLS_PER_UNIT);
    }
    if (cairn_place_map_visibility_item(map, map->place, map->item)) {
        map->item++;
        return;
    }
    cairn_place_map_sample_free(map, map->place);
    map->place++;
    map->item = 0;
    if (map->place == map->place_count) {
        map->place = 0;
        map->query = 1;
        place_map_enter(map, CAIRN_PLACE_MAP_TARGET);
    }
}

/* ---- Matching ---- */

/* Copies the points of a scan for matching: without dynamic-object candidates, until a map shows
 * which of them are static. */
static int32_t copy_points(const cairn_place_map *map, const place_map_place_scan *scan,
                           cairn_pose pose, cairn_oriented_point *out)
{
    cairn_transform t = cairn_transform_of(pose);
    int32_t count = 0;

    for (int32_t i = scan->first_point; i < scan->first_point + scan->point_count; i++)
        if (map->round > 0 ? map->point_class[i] < PLACE_MAP_POINT_INVALIDATED
                           : map->point_class[i] == PLACE_MAP_POINT_STATIC) {
            out[count].position = cairn_transform_point(t, map->points[i].position);
            out[count++].direction = cairn_transform_direction(t, map->points[i].direction);
        }
    return count;
}

static void add_to_target(cairn_place_map *map, int32_t place, cairn_pose target_place)
{
    const place_map_place *here = &map->places[place];

    for (int32_t s = here->first_scan; s < here->first_scan + here->scan_count; s++) {
        const place_map_place_scan *scan = &map->scans[s];
        cairn_scan_match_part part = {.points = map->query_points,
                                      .beams = map->beams + scan->first_beam,
                                      .beam_count = scan->beam_count};

        part.count = copy_points(map, scan, cairn_pose_identity(), map->query_points);
        cairn_must_be_ok(cairn_scan_match_add_target(
            map->match, &part, cairn_pose_compose(target_place, scan->place_scan), NULL));
        map->units_due += (scan->point_count + scan->beam_count) / POINTS_PER_UNIT;
    }
}

/* Returns 1 when a place is part of the target of the current query. */
static int is_target(const cairn_place_map *map, int32_t place)
{
    if (map->params.mode == CAIRN_PLACE_MAP_SEQUENTIAL)
        return place < map->query && place >= map->query - map->params.recent_places;
    return map->round == 0 ? place == map->place
                           : place != map->query && map->places[place].component == 0;
}

static void make_target(cairn_place_map *map)
{
    int is_pair = map->params.mode == CAIRN_PLACE_MAP_CONSENSUS && map->round == 0;

    cairn_scan_match_clear_target(map->match);
    for (int32_t i = 0; i < map->place_count; i++)
        if (is_target(map, i))
            add_to_target(map, i, is_pair ? cairn_pose_identity() : map->places[i].map_place);
    map->units_due++;
    place_map_enter(map, CAIRN_PLACE_MAP_MATCH);
}

static void add_to_query(cairn_place_map *map, const place_map_place_scan *scan,
                         cairn_pose query_scan, cairn_scan_match_part *part)
{
    cairn_transform t = cairn_transform_of(query_scan);

    part->count += copy_points(map, scan, query_scan, map->query_points + part->count);
    for (int32_t i = 0; i < scan->beam_count && scan->place == map->query; i++) {
        cairn_scan_beam beam = map->beams[scan->first_beam + i];

        beam.from = cairn_transform_point(t, beam.from);
        beam.to = cairn_transform_point(t, beam.to);
        map->query_beams[part->beam_count++] = beam;
    }
}

/* Returns 1 when a place is part of the query: the query itself, or a place of the same smaller
 * component, which is matched as a whole. */
static int is_in_query(const cairn_place_map *map, int32_t place)
{
    int32_t part = map->places[map->query].component;

    return place == map->query || (map->phase == CAIRN_PLACE_MAP_MATCH && map->round > 0 &&
                                   part > 0 && map->places[place].component == part);
}

/* Returns the points of the query in the frame of its place, with those of all places of the query;
 * its beams are its own, as free space is known from one place at a time. */
static cairn_scan_match_part query_part(cairn_place_map *map)
{
    cairn_scan_match_part part = {.points = map->query_points, .beams = map->query_beams};
    cairn_pose map_query = map->places[map->query].map_place;

    for (int32_t i = 0; i < map->place_count; i++) {
        const place_map_place *here = &map->places[i];
        cairn_pose query_place = i == map->query ? cairn_pose_identity()
                                                 : cairn_pose_between(map_query, here->map_place);

        if (!is_in_query(map, i))
            continue;
        for (int32_t s = here->first_scan; s < here->first_scan + here->scan_count; s++)
            add_to_query(map, &map->scans[s],
                         cairn_pose_compose(query_place, map->scans[s].place_scan), &part);
    }
    map->units_due += (part.count + part.beam_count) / POINTS_PER_UNIT;
    return part;
}

/* Adds the hypothesis of two places, one of the target and one of the query, that follows from a
 * match with a map, if its log-likelihood ratio is positive. */
static void add_pair_of_map_match(cairn_place_map *map, int32_t target, int32_t place,
                                  const cairn_scan_match_hypothesis *hypothesis)
{
    cairn_pose map_target = map->places[target].map_place;
    cairn_pose query_place =
        cairn_pose_between(map->places[map->query].map_place, map->places[place].map_place);
    cairn_pose map_place = place == map->query
                               ? hypothesis->target_query
                               : cairn_pose_compose(hypothesis->target_query, query_place);
    cairn_pose seen = cairn_pose_between(map_target, map_place);
    cairn_real covariance[9];

    if (!(cairn_place_map_score_pair(map, target, place, seen) > 0))
        return;
    cairn_place_map_rotate_covariance(hypothesis->covariance, map_target.theta, covariance);
    cairn_place_map_add_hypothesis(map, target, place, seen, covariance);
}

static void add_map_match(cairn_place_map *map, const cairn_scan_match_hypothesis *hypothesis)
{
    for (int32_t i = 0; i < map->place_count; i++)
        for (int32_t k = 0; k < map->place_count && is_target(map, i); k++)
            if (is_in_query(map, k))
                add_pair_of_map_match(map, i, k, hypothesis);
}

static void store_match(cairn_place_map *map)
{
    cairn_scan_match_result found = cairn_scan_match_read(map->match);

    map->result.matches++;
    if (map->params.mode == CAIRN_PLACE_MAP_SEQUENTIAL) {
        if (found.count > 0)
            map->places[map->query].map_place = found.hypotheses[0].target_query;
        return;
    }
    for (int32_t k = 0; k < found.count; k++) {
        const cairn_scan_match_hypothesis *h = &found.hypotheses[k];

        if (map->round > 0)
            add_map_match(map, h);
        else if (cairn_place_map_score_pair(map, map->place, map->query, h->target_query) >
                 MIN_PAIR_NATS)
            cairn_place_map_add_hypothesis(map, map->place, map->query, h->target_query,
                                           h->covariance);
    }
}

/* Returns 1 when the query's smaller component was already matched in this round. */
static int was_matched(const cairn_place_map *map, int32_t query)
{
    int32_t part = map->places[query].component;

    for (int32_t i = 0; i < query && map->round > 0 && part > 0; i++)
        if (map->places[i].component == part)
            return 1;
    return 0;
}

/* Advances to the next query, and to its target when that changes. */
static void next_match(cairn_place_map *map)
{
    int is_pair = map->params.mode == CAIRN_PLACE_MAP_CONSENSUS && map->round == 0;

    do
        map->query++;
    while (map->query < map->place_count && was_matched(map, map->query));
    if (is_pair && map->query >= map->place_count) {
        map->place++;
        map->query = map->place + 1;
    }
    if (map->query < map->place_count) {
        place_map_enter(map, is_pair && map->query > map->place + 1 ? CAIRN_PLACE_MAP_MATCH
                                                                    : CAIRN_PLACE_MAP_TARGET);
        return;
    }
    map->place = 0;
    place_map_enter(map, map->params.mode == CAIRN_PLACE_MAP_SEQUENTIAL ? CAIRN_PLACE_MAP_REFINE
                                                                        : CAIRN_PLACE_MAP_SCORE);
    if (map->params.mode == CAIRN_PLACE_MAP_SEQUENTIAL)
        map->sweep = map->params.refinement_sweeps;
}

static void match_item(cairn_place_map *map, cairn_budget *budget)
{
    cairn_scan_match_part part;
    cairn_status status;

    if (!map->inner_running) {
        if (map->query < map->place_count) {
            part = query_part(map);
            status = cairn_scan_match_begin(map->match, &part, cairn_pose_identity(), NULL, NULL);
            CAIRN_ASSERT(status == CAIRN_OK);
            map->inner_running = status == CAIRN_OK;
        }
        map->units_due++;
        if (!map->inner_running)
            next_match(map);
        return;
    }
    if (cairn_scan_match_step(map->match, budget) == CAIRN_OK) {
        store_match(map);
        next_match(map);
    }
}

/* ---- Consensus ---- */

/* Pairwise likelihood function of the consensus. */
static int pair_likelihood(void *context, int32_t first, int32_t second, cairn_pose first_second,
                           cairn_pose_likelihood *likelihood, cairn_budget *budget)
{
    const cairn_place_map *map = context;

    if (!cairn_budget_charge(budget, &likelihood->units_charged,
                             cairn_place_map_pair_units(map, first, second)))
        return 0;
    likelihood->ratio = cairn_place_map_pair_likelihood(map, first, second, first_second);
    return 1;
}

/* Scores one hypothesis; all are scored again in each round, as fewer points are valid. */
static void score_item(cairn_place_map *map)
{
    cairn_pose_consensus_relative_pose *h = &map->hypotheses[map->item];

    if (map->item == 0) {
        cairn_must_be_ok(cairn_pose_consensus_clear(map->consensus, map->place_count));
        cairn_pose_consensus_set_pair_likelihood(map->consensus, pair_likelihood, map);
        cairn_pose_consensus_set_joint_likelihood(map->consensus, cairn_place_map_joint_likelihood,
                                                  map);
        map->result.hypotheses = 0;
        map->units_due += 1 + map->place_count;
    }
    if (map->item == map->hypothesis_count) {
        map->optimized_hypotheses = map->hypothesis_count;
        place_map_enter(map, CAIRN_PLACE_MAP_FIND_CONSENSUS);
        return;
    }
    h->score = (map->item < map->optimized_hypotheses
                    ? cairn_place_map_score_pair(map, h->first, h->second, h->first_second)
                    : cairn_place_map_optimize_hypothesis(map, h)) -
               map->params.chance_nats;
    map->item++;
    if (h->score > 0 && cairn_pose_consensus_add(map->consensus, h, NULL) == CAIRN_OK)
        map->result.hypotheses++;
}

static void store_consensus(cairn_place_map *map)
{
    cairn_pose_consensus_result found = cairn_pose_consensus_read(map->consensus);

    map->result.total = found.total;
    map->result.competing_total = found.competing_total;
    map->result.ambiguous = found.ambiguous;
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

/* Submaps are searched in the last map only: earlier, weak links may still get more support. */
static void consensus_item(cairn_place_map *map, cairn_budget *budget)
{
    if (!map->inner_running) {
        cairn_must_be_ok(cairn_pose_consensus_begin(map->consensus));
        map->units_due += 1 + map->place_count;
        map->inner_running = 1;
    } else if (cairn_pose_consensus_step(map->consensus, budget) == CAIRN_OK) {
        store_consensus(map);
        if (!is_last_round(map) || map->submaps_found) {
            map->query = map->place = map->sweep = 0;
            place_map_enter(map, CAIRN_PLACE_MAP_CLASSIFY);
        } else {
            cairn_must_be_ok(cairn_pose_consensus_find_submaps(map->consensus));
            map->units_due += 1 + map->place_count;
            map->submaps_found = 1;
        }
    }
}

/* Classifies the points of one place: only static ones are aligned at the end. */
static void classify_item(cairn_place_map *map)
{
    if (map->item < map->place_count) {
        cairn_place_map_classify_points(map, map->item++, map->submaps_found);
        return;
    }
    place_map_enter(map, map->submaps_found ? CAIRN_PLACE_MAP_REFINE : CAIRN_PLACE_MAP_TARGET);
    map->result.placed = cairn_place_map_count_placed(map);
    map->round++;
    map->units_due++;
}

/* ---- Refinement ---- */

/* Sets the ICP target: valid points of all scans of the place's component, without those of the
 * place, or of the one scan. */
static void target_others(cairn_place_map *map, int32_t place, int32_t only_scan)
{
    cairn_icp_clear_target(map->icp);
    for (int32_t s = 0; s < map->scan_count; s++) {
        const place_map_place_scan *scan = &map->scans[s];
        int32_t count;

        if ((only_scan < 0 ? scan->place == place : s == only_scan) ||
            map->places[scan->place].component != map->places[place].component)
            continue;
        count = copy_points(map, scan, cairn_pose_identity(), map->query_points);
        cairn_must_be_ok(
            cairn_icp_add_target(map->icp, map->query_points, count, scan->map_scan, NULL));
        map->units_due += scan->point_count / POINTS_PER_UNIT;
    }
    map->units_due++;
}

/* Aligns a place with all others of its component, in turn. */
static void refine_item(cairn_place_map *map, cairn_budget *budget)
{
    place_map_place *here = &map->places[map->place];

    if (map->sweep == 0 && map->place == 0 && !map->inner_running)
        for (int32_t i = 0; i < map->place_count; i++)
            cairn_place_map_place_scans(map, i);
    if (map->sweep >= map->params.refinement_sweeps) {
        for (int32_t i = 0; i < map->place_count; i++)
            cairn_place_map_place_scans(map, i);
        map->place = 0;
        if (map->params.decoupled == CAIRN_PLACE_MAP_COUPLED)
            cairn_place_map_finish(map);
        else
            place_map_enter(map, map->aligner != NULL ? CAIRN_PLACE_MAP_ALIGN_JOINTLY
                                                      : CAIRN_PLACE_MAP_DECOUPLE);
        return;
    }
    if (!map->inner_running) {
        cairn_scan_match_part part;

        target_others(map, map->place, -1);
        map->query = map->place;
        part = query_part(map);
        map->inner_running = cairn_icp_begin(map->icp, part.points, part.count, here->map_place,
                                             NULL, NULL) == CAIRN_OK;
        if (map->inner_running)
            return;
    } else if (cairn_icp_step(map->icp, budget) == CAIRN_OK) {
        cairn_icp_result aligned = cairn_icp_read(map->icp);

        if (aligned.verdict != CAIRN_ICP_TOO_FEW_PAIRS) {
            here->map_place = aligned.target_query;
            cairn_place_map_place_scans(map, map->place);
        }
    } else {
        return;
    }
    map->inner_running = 0;
    map->place++;
    if (map->place == map->place_count) {
        map->place = 0;
        map->sweep++;
    }
}

/* Aligns a scan with all others; `place` counts scans. */
static void decouple_item(cairn_place_map *map, cairn_budget *budget)
{
    place_map_place_scan *scan = &map->scans[map->place];

    if (!map->inner_running) {
        cairn_rigid_motion_pose_prior prior = {scan->map_scan, SCAN_SIGMA_M, SCAN_SIGMA_M,
                                               SCAN_SIGMA_RAD};

        target_others(map, scan->place, map->place);
        map->inner_running =
            cairn_icp_begin(map->icp, map->points + scan->first_point, scan->point_count,
                            scan->map_scan, &prior, NULL) == CAIRN_OK;
        if (map->inner_running)
            return;
    } else if (cairn_icp_step(map->icp, budget) == CAIRN_OK) {
        cairn_icp_result aligned = cairn_icp_read(map->icp);

        if (aligned.verdict != CAIRN_ICP_TOO_FEW_PAIRS) {
            scan->map_scan = aligned.target_query;
            map->result.decoupled += map->sweep == map->params.refinement_sweeps;
        }
    } else {
        return;
    }
    map->inner_running = 0;
    map->place++;
    if (map->place < map->scan_count)
        return;
    map->place = 0;
    if (++map->sweep == map->params.refinement_sweeps + DECOUPLED_SWEEPS)
        cairn_place_map_finish(map);
}

/* Returns an offset, m, that keeps the components out of each other's range in the aligner. */
static cairn_real component_offset(const cairn_place_map *map, int32_t place)
{
    return CAIRN_REAL(1e3) * (cairn_real)map->places[place].component;
}

static void store_alignment(cairn_place_map *map)
{
    for (int32_t s = map->scan_count - 1; s >= 0; s--) {
        place_map_place_scan *scan = &map->scans[s];
        place_map_place *here = &map->places[scan->place];
        cairn_aligner_pose found = cairn_aligner_pose_of(map->aligner, s);

        found.map_scan.x -= component_offset(map, scan->place);
        scan->map_scan = found.map_scan;
        map->result.decoupled += found.placed;
        if (s == here->first_scan)
            here->map_place =
                cairn_pose_compose(found.map_scan, cairn_pose_inverse(scan->place_scan));
    }
    map->units_due += map->scan_count;
}

/* Joint alignment of all scans, from the poses of their places. */
static void align_jointly_item(cairn_place_map *map, cairn_budget *budget)
{
    cairn_status status = CAIRN_OK;

    if (!map->inner_running) {
        for (int32_t s = 0; s < map->scan_count && status == CAIRN_OK; s++) {
            cairn_pose start = map->scans[s].map_scan;

            start.x += component_offset(map, map->scans[s].place);
            status = cairn_aligner_set_initial_pose(map->aligner, s, start);
        }
        if (status == CAIRN_OK)
            status = cairn_aligner_begin(map->aligner);
        map->units_due += map->scan_count;
        map->inner_running = status == CAIRN_OK;
        if (!map->inner_running)
            cairn_place_map_finish(map);
    } else if (cairn_aligner_step(map->aligner, budget) == CAIRN_OK) {
        store_alignment(map);
        cairn_place_map_finish(map);
    }
}

void cairn_place_map_item(cairn_place_map *map, cairn_budget *budget)
{
    if (map->params.mode == CAIRN_PLACE_MAP_AS_WRITTEN) {
        cairn_place_map_written_item(map, budget);
        return;
    }
    switch (map->phase) {
    case CAIRN_PLACE_MAP_VISIBILITY:
        visibility_item(map);
        break;
    case CAIRN_PLACE_MAP_TARGET:
        make_target(map);
        break;
    case CAIRN_PLACE_MAP_MATCH:
        match_item(map, budget);
        break;
    case CAIRN_PLACE_MAP_SCORE:
        score_item(map);
        break;
    case CAIRN_PLACE_MAP_FIND_CONSENSUS:
        consensus_item(map, budget);
        break;
    case CAIRN_PLACE_MAP_CLASSIFY:
        classify_item(map);
        break;
    case CAIRN_PLACE_MAP_REFINE:
        refine_item(map, budget);
        break;
    case CAIRN_PLACE_MAP_DECOUPLE:
        decouple_item(map, budget);
        break;
    default:
        align_jointly_item(map, budget);
        break;
    }
}
