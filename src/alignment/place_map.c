/* place_map: global map of places without odometry; the object, its params, scans and results.
 *
 * Method:
 * 1. Visibility grid of each place (place_map_visibility.c).
 * 2. Round 0: global scan matching of all pairs of places, over the full circle and all positions.
 * 3. Each hypothesis is moved to the nearest local maximum of its likelihood: matches align faces
 *    of walls, and opposite faces, rough surfaces and bodies determine the pose where few faces are
 *    shared. Its log-likelihood ratio becomes its score.
 * 4. Consensus (pose_consensus). The same likelihood evaluates pairs without an agreeing
 *    hypothesis, so that no place gets a pose that contradicts places it was never matched with. A
 *    place in a map is evaluated against all others of its component jointly, each surface once
 *    (place_map_joint_likelihood.c).
 * 5. Further rounds, while the map changes: every place, and every smaller component as a whole, is
 *    matched with the map of all others, which shows more of the place than any single one. The
 *    results become hypotheses of the pairs that support them; back to 3.
 * 6. ICP refinement of each place with all others, in turn; on request of each scan, sequentially
 *    or jointly.
 *
 * Layout: points and beams of all scans side by side, in the frames of the scans. Scratch for one
 * query.
 * Limits: the number of pairs grows with the square of the places. The likelihood counts every
 * point as independent, though points of one wall are correlated: nats can be compared, but are no
 * odds; about four of them are one.
 * Source: Adluru 2008, chapter 6; the sequential mode is its order of matching, mode as written all
 * of it (place_map_written.c). */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/place_map_variants.h"
#include "src/alignment/place_map_work.h"

enum { MAX_PLACES = 256, MAX_COUNT = 1 << 16, MAX_MATCHED_POINTS = 1 << 20 };

#define INTEGER(field, is, from, to) CAIRN_INTEGER(cairn_place_map_params, field, is, from, to)
#define NUMBER(field, is, to)        CAIRN_NUMBER(cairn_place_map_params, field, is, 0, to)

#define POSITIVE(field, is)                                                                        \
    CAIRN_NUMBER_ABOVE(cairn_place_map_params, field, is, 0, CAIRN_MAX_MAGNITUDE)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(mode, CAIRN_PLACE_MAP_CONSENSUS, CAIRN_PLACE_MAP_CONSENSUS, CAIRN_PLACE_MAP_AS_WRITTEN),
    INTEGER(max_places, 16, 2, MAX_PLACES),
    INTEGER(max_scans, 64, 2, MAX_COUNT),
    INTEGER(max_place_points, 1024, 1, MAX_MATCHED_POINTS / 2),
    INTEGER(max_place_beams, 2048, 1, MAX_MATCHED_POINTS / 2),
    INTEGER(recent_places, 3, 1, INT32_MAX),
    INTEGER(rematch_rounds, 4, 0, INT32_MAX),
    INTEGER(refinement_sweeps, 10, 0, INT32_MAX),
    INTEGER(decoupled, CAIRN_PLACE_MAP_COUPLED, CAIRN_PLACE_MAP_COUPLED, CAIRN_PLACE_MAP_JOINTLY),
    POSITIVE(visibility_reach, 8),
    POSITIVE(visibility_cell, CAIRN_REAL(0.05)),
    POSITIVE(visibility_margin, CAIRN_REAL(0.1)),
    POSITIVE(surface_nats, CAIRN_REAL(0.05)),
    POSITIVE(dynamic_nats, CAIRN_REAL(0.25)),
    POSITIVE(opposite_face_nats, CAIRN_REAL(0.3)),
    POSITIVE(rough_surface_nats, CAIRN_REAL(0.65)),
    NUMBER(free_area_nats, CAIRN_REAL(1.6), CAIRN_MAX_MAGNITUDE),
    POSITIVE(free_space_penalty, CAIRN_REAL(0.6)),
    NUMBER(dynamic_factor, CAIRN_REAL(0.05), 1),
    NUMBER(chance_nats, 0, CAIRN_MAX_MAGNITUDE),
};
const cairn_parameters cairn_place_map_parameters =
    CAIRN_PARAMETERS("place_map", cairn_place_map_params, rows);

/* The same without the mode, which a variant of it has. */
static const cairn_parameters variant_parameters =
    CAIRN_PARAMETERS_FROM("place_map", cairn_place_map_params, rows, 1);

cairn_place_map_params cairn_place_map_default(void)
{
    cairn_place_map_params params;

    cairn_parameters_preset(&cairn_place_map_parameters, &params);
    params.match = cairn_scan_match_default();
    params.match.max_candidates = 768;
    params.match.max_hypotheses = 40;
    /* with this many candidates, sharper peaks are better */
    params.match.vote_once = 0;
    params.consensus = cairn_pose_consensus_default();
    params.consensus.max_hypotheses = 4096;
    /* nats of correlated points overstate the likelihood */
    params.consensus.min_ambiguous_weight = CAIRN_REAL(1e-5);
    params.consensus.significant_support = 12;
    params.aligner = cairn_aligner_default();
    params.aligner.max_segments = 4096;
    params.aligner.max_fill = 8192;
    return params;
}

cairn_place_map_params cairn_place_map_as_written(void)
{
    cairn_place_map_params params = cairn_place_map_default();

    params.mode = CAIRN_PLACE_MAP_AS_WRITTEN;
    params.match = cairn_scan_match_as_written();
    params.max_place_points = 2048;
    params.decoupled = CAIRN_PLACE_MAP_BY_ICP;
    return params;
}

static int is_written(const cairn_place_map_params *params)
{
    return params->mode == CAIRN_PLACE_MAP_AS_WRITTEN;
}

/* 1 when the scans are aligned jointly in the end. */
static int is_joint(const cairn_place_map_params *params)
{
    return !is_written(params) && params->decoupled == CAIRN_PLACE_MAP_JOINTLY;
}

/* 1 when scan matching is as written, and scans are decoupled by its ICP or not at all. */
static int written_is_valid(const cairn_place_map_params *params)
{
    cairn_scan_match_mode match = params->match.mode;

    return (match == CAIRN_SCAN_MATCH_AS_WRITTEN ||
            match == CAIRN_SCAN_MATCH_AS_WRITTEN_SEGMENTS) &&
           (params->decoupled == CAIRN_PLACE_MAP_COUPLED ||
            (match == CAIRN_SCAN_MATCH_AS_WRITTEN && params->decoupled == CAIRN_PLACE_MAP_BY_ICP));
}

/* Returns the number of places that mode AS_WRITTEN matches with. */
static int32_t written_target(const cairn_place_map_params *params)
{
    return params->recent_places < params->max_places - 1 ? params->recent_places
                                                          : params->max_places - 1;
}

/* Params of the inner objects: capacities follow from those of the map. */
static cairn_scan_match_params match_params(const cairn_place_map_params *params)
{
    cairn_scan_match_params match = params->match;

    if (is_written(params)) {
        match.max_target = written_target(params) * params->max_place_points;
        match.max_query = params->max_place_points;
        match.max_dense = match.max_views = 0;
        return match;
    }
    match.max_target = params->max_places * params->max_place_points;
    match.max_query = match.max_target;
    match.max_dense = 0;
    match.max_views = params->max_scans < 4096 ? params->max_scans : 4096;
    return match;
}

static cairn_pose_consensus_params consensus_params(const cairn_place_map_params *params)
{
    cairn_pose_consensus_params consensus = params->consensus;

    consensus.max_nodes = params->max_places;
    return consensus;
}

static cairn_icp_params icp_params(const cairn_place_map_params *params)
{
    cairn_icp_params icp = cairn_icp_default();

    icp.max_target = params->max_places * params->max_place_points;
    icp.max_iterations = 15;
    icp.gate_start = CAIRN_REAL(0.4);
    icp.direction_gate = CAIRN_PI / 6;
    icp.roll_back = 1;
    return icp;
}

static cairn_aligner_params aligner_params(const cairn_place_map_params *params)
{
    cairn_aligner_params aligner = params->aligner;

    aligner.max_scans = params->max_scans;
    aligner.max_points = params->max_places * params->max_place_points;
    return aligner;
}

/* Rules between parameters. */
static cairn_status check_rules(const cairn_place_map_params *params, cairn_object_fault *fault)
{
    const struct {
        int holds;
        const char *rule;
    } rules[] = {
        {params->max_scans >= params->max_places, "max_scans: at least max_places"},
        {params->max_place_points <= MAX_MATCHED_POINTS / params->max_places,
         "max_place_points: at most 2^20 / max_places"},
        {params->max_place_beams <= MAX_MATCHED_POINTS / params->max_places,
         "max_place_beams: at most 2^20 / max_places"},
        {!is_written(params) || written_is_valid(params),
         "mode AS_WRITTEN: match.mode as written, and decoupled by its ICP or not at all"},
        {params->visibility_margin <= 20 * params->visibility_cell,
         "visibility_margin: at most 20 visibility_cell"},
        {cairn_place_map_side(params) > 0, "visibility_reach: at most 2048 visibility_cell"},
    };
    cairn_status status = CAIRN_OK;

    for (size_t i = 0; i < sizeof rules / sizeof *rules && status == CAIRN_OK; i++)
        status = cairn_parameters_require(rules[i].holds, "place_map", rules[i].rule, fault);
    return status;
}

/* Parameters of the nested objects. */
static cairn_status check_objects(const cairn_place_map_params *params, cairn_object_fault *fault)
{
    cairn_scan_match_params match = match_params(params);
    cairn_pose_consensus_params consensus = consensus_params(params);
    cairn_icp_params icp = icp_params(params);
    cairn_aligner_params aligner = aligner_params(params);
    cairn_status status = cairn_scan_match_check(&match, fault);

    if (status == CAIRN_OK && !is_written(params))
        status = cairn_pose_consensus_check(&consensus, fault);
    if (status == CAIRN_OK && !is_written(params))
        status = cairn_icp_check(&icp, fault);
    if (status == CAIRN_OK && is_joint(params))
        status = cairn_aligner_check(&aligner, fault);
    return status;
}

cairn_status cairn_place_map_check(const cairn_place_map_params *params, cairn_object_fault *fault)
{
    cairn_status status;

    if (params == NULL)
        return cairn_parameters_check(&cairn_place_map_parameters, NULL, fault);
    status = cairn_parameters_check(params->mode == CAIRN_PLACE_MAP_SEQUENTIAL
                                        ? &variant_parameters
                                        : &cairn_place_map_parameters,
                                    params, fault);
    if (status == CAIRN_OK)
        status = check_rules(params, fault);
    if (status == CAIRN_OK)
        status = check_objects(params, fault);
    return status;
}

/* The arrays and objects of all modes but that as written. */
static void take_consensus(cairn_place_map *map, cairn_pool *pool,
                           const cairn_place_map_params *params)
{
    size_t places = (size_t)params->max_places, points = (size_t)params->max_place_points,
           beams = (size_t)params->max_place_beams, side = (size_t)cairn_place_map_side(params);
    size_t sampled =
        (side + PLACE_MAP_VISIBILITY_SAMPLE_STRIDE - 1) / PLACE_MAP_VISIBILITY_SAMPLE_STRIDE;

    CAIRN_TAKE(map, pool, point_class, places * points);
    CAIRN_TAKE(map, pool, hypotheses, params->consensus.max_hypotheses);
    CAIRN_TAKE(map, pool, beams, places * beams);
    CAIRN_TAKE_ROWS(map, pool, visibility, places * side, side);
    CAIRN_TAKE_ROWS(map, pool, free_cells, places * sampled, sampled);
    CAIRN_TAKE(map, pool, observing_places, places);
    CAIRN_TAKE(map, pool, observer_map, places);
    CAIRN_TAKE(map, pool, query_points, places * points);
    CAIRN_TAKE(map, pool, query_beams, beams);
}

/* The nested objects; as written scan matching alone. */
static void take_objects(cairn_place_map *map, cairn_pool *pool,
                         const cairn_place_map_params *params)
{
    cairn_scan_match_params match = match_params(params);
    cairn_pose_consensus_params consensus = consensus_params(params);
    cairn_icp_params icp = icp_params(params);
    cairn_aligner_params aligner = aligner_params(params);

    CAIRN_TAKE_OBJECT(map, pool, match, scan_match, &match);
    if (is_written(params))
        return;
    CAIRN_TAKE_OBJECT(map, pool, consensus, pose_consensus, &consensus);
    CAIRN_TAKE_OBJECT(map, pool, icp, icp, &icp);
    if (is_joint(params))
        CAIRN_TAKE_OBJECT(map, pool, aligner, aligner, &aligner);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_place_map *build(cairn_pool *pool, const cairn_place_map_params *params)
{
    size_t places = (size_t)params->max_places, points = (size_t)params->max_place_points;
    cairn_place_map *map = cairn_object_take(pool, sizeof *map);

    CAIRN_TAKE(map, pool, places, places);
    CAIRN_TAKE(map, pool, scans, params->max_scans);
    CAIRN_TAKE(map, pool, points, places * points);
    if (is_written(params))
        CAIRN_TAKE(map, pool, query_points, points);
    else
        take_consensus(map, pool, params);
    take_objects(map, pool, params);
    if (map != NULL) {
        map->params = *params;
        map->visibility_side = cairn_place_map_side(params);
        for (int32_t k = 0; k < PLACE_MAP_VISIBILITY_DIRECTIONS; k++)
            cairn_sincos((cairn_real)k * 2 * CAIRN_PI / PLACE_MAP_VISIBILITY_DIRECTIONS,
                         &map->directions[k].y, &map->directions[k].x);
    }
    return map;
}

CAIRN_OBJECT(place_map, place_map, build);

void cairn_place_map_clear(cairn_place_map *map)
{
    map->place_count = map->scan_count = map->point_count = map->beam_count = 0;
    map->state = PLACE_MAP_IDLE;
    map->place = 0;
    if (map->aligner != NULL)
        cairn_aligner_clear(map->aligner);
}

/* Points and beams stored of a scan: as written, its readings. */
static int32_t points_of(const cairn_place_map *map, const cairn_scan_view *view)
{
    int32_t count = 0;

    if (!is_written(&map->params))
        return view->point_count;
    for (int32_t i = 0; i < view->beam_count && view->segment_count > 0; i++)
        count += view->beams[i].kind == CAIRN_SCAN_BEAM_HIT;
    return count;
}

static int32_t beams_of(const cairn_place_map *map, const cairn_scan_view *view)
{
    return is_written(&map->params) ? 0 : view->beam_count;
}

static cairn_status check_scan(const cairn_place_map *map, int32_t place,
                               const cairn_scan_view *view, cairn_pose place_scan,
                               cairn_fault *fault)
{
    const cairn_place_map_params *params = &map->params;
    int is_new = place == map->place_count;
    int32_t points = is_new ? 0 : map->places[place].point_count,
            beams = is_new ? 0 : map->places[place].beam_count;
    cairn_status status = cairn_pose_check(place_scan, CAIRN_SCAN_EXTENT, fault);

    if (status != CAIRN_OK)
        return status;
    if (place == params->max_places || map->scan_count == params->max_scans)
        return cairn_refuse(fault, -1, "more places or scans than max_places and max_scans",
                            CAIRN_FULL);
    if (points_of(map, view) > params->max_place_points - points ||
        beams_of(map, view) > params->max_place_beams - beams)
        return cairn_refuse(fault, -1,
                            "more points or beams than max_place_points and max_place_beams",
                            CAIRN_FULL);
    return CAIRN_OK;
}

cairn_status cairn_place_map_add_scan(cairn_place_map *map, int32_t place,
                                      const cairn_scan_view *view, cairn_pose place_scan,
                                      cairn_fault *fault)
{
    place_map_place_scan *scan;
    cairn_status status;

    if (map == NULL || view == NULL || place < 0 || place < map->place_count - 1 ||
        place > map->place_count)
        return cairn_refuse(fault, -1, "no object, no scan, or not the last place or the next",
                            CAIRN_BAD_ARGUMENT);
    status = check_scan(map, place, view, place_scan, fault);
    if (status == CAIRN_OK && map->aligner != NULL)
        status = cairn_aligner_add_scan(map->aligner, view, place_scan, fault);
    if (status != CAIRN_OK)
        return status;
    if (place == map->place_count) {
        memset(&map->places[place], 0, sizeof map->places[place]);
        map->places[place].first_scan = map->scan_count;
        map->place_count++;
    }
    scan = &map->scans[map->scan_count];
    memset(scan, 0, sizeof *scan);
    scan->place = place;
    scan->place_scan = place_scan;
    scan->first_point = map->point_count;
    scan->first_beam = map->beam_count;
    scan->point_count = points_of(map, view);
    scan->beam_count = beams_of(map, view);
    if (is_written(&map->params)) {
        (void)cairn_scan_match_readings(view, map->points + map->point_count);
        /* the place may have been mapped before */
        scan->map_scan = cairn_pose_compose(map->places[place].map_place, place_scan);
    } else {
        memcpy(map->points + map->point_count, view->points,
               (size_t)view->point_count * sizeof *map->points);
        memcpy(map->beams + map->beam_count, view->beams,
               (size_t)view->beam_count * sizeof *map->beams);
        cairn_place_map_find_dynamic_candidates(map, scan, view);
    }
    map->point_count += scan->point_count;
    map->beam_count += scan->beam_count;
    map->places[place].scan_count++;
    map->places[place].point_count += scan->point_count;
    map->places[place].beam_count += scan->beam_count;
    map->scan_count++;
    map->state = PLACE_MAP_IDLE;
    return CAIRN_OK;
}

/* Takes the poses from the places that are not in the last complete map. */
static void forget_poses(cairn_place_map *map)
{
    for (int32_t i = map->place; i < map->place_count; i++) {
        map->places[i].map_place = cairn_pose_identity();
        map->places[i].component = 0;
    }
}

cairn_status cairn_place_map_begin(cairn_place_map *map)
{
    if (map == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (map->scan_count == 0)
        return CAIRN_EMPTY;
    memset(&map->result, 0, sizeof map->result);
    place_map_begin_run(map);
    for (int32_t i = 0; i < map->point_count && map->point_class != NULL; i++)
        map->point_class[i] &= PLACE_MAP_POINT_DYNAMIC_CANDIDATE;
    map->hypothesis_count = map->optimized_hypotheses = 0;
    map->place = map->round = map->submaps_found = 0;
    map->query = 1; /* as written the first place is the origin of the map */
    forget_poses(map);
    return CAIRN_OK;
}

cairn_status cairn_place_map_extend(cairn_place_map *map)
{
    if (map == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!is_written(&map->params))
        return CAIRN_UNSUPPORTED;
    if (map->place == 0)
        return cairn_place_map_begin(map);
    place_map_begin_run(map);
    map->query = map->place;
    forget_poses(map);
    return CAIRN_OK;
}

cairn_status cairn_place_map_move_scan(cairn_place_map *map, int32_t scan, cairn_pose map_scan)
{
    cairn_status status;

    if (map == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!is_written(&map->params))
        return CAIRN_UNSUPPORTED;
    if (scan < 0 || scan >= map->scan_count || map->scans[scan].place >= map->place)
        return CAIRN_BAD_ARGUMENT;
    status = cairn_pose_check(map_scan, CAIRN_SCAN_EXTENT, NULL);
    if (status == CAIRN_OK)
        map->scans[scan].map_scan = map_scan;
    return status;
}

cairn_status cairn_place_map_step(cairn_place_map *map, cairn_budget *budget)
{
    int32_t before;
    int is_done;

    if (map == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (map->state != PLACE_MAP_RUNNING)
        return CAIRN_OK;
    if (budget->left <= 0)
        return CAIRN_MORE;
    before = budget->left;
    is_done = is_written(&map->params) ? cairn_place_map_written_run(map, budget)
                                       : cairn_place_map_run(map, budget);
    map->result.units += before - budget->left;
    if (!is_done)
        return CAIRN_MORE;
    map->state = PLACE_MAP_DONE;
    return CAIRN_OK;
}

/* ---- Results ---- */

static int has_result(const cairn_place_map *map)
{
    return map->state == PLACE_MAP_DONE;
}

cairn_place_map_result cairn_place_map_read(const cairn_place_map *map)
{
    cairn_place_map_result none;

    memset(&none, 0, sizeof none);
    return has_result(map) ? map->result : none;
}

cairn_place_map_place cairn_place_map_place_of(const cairn_place_map *map, int32_t place)
{
    cairn_place_map_place out;

    memset(&out, 0, sizeof out);
    if (!has_result(map) || place < 0 || place >= map->place_count)
        return out;
    out.map_place = map->places[place].map_place;
    out.component = map->places[place].component;
    out.error_probability = 1;
    if (map->params.mode == CAIRN_PLACE_MAP_CONSENSUS)
        cairn_place_map_report(map, place, &out);
    return out;
}

cairn_pose_consensus_competing_pose cairn_place_map_alternative(const cairn_place_map *map,
                                                                int32_t place, int32_t index)
{
    cairn_pose_consensus_competing_pose none;

    memset(&none, 0, sizeof none);
    return index < cairn_place_map_place_of(map, place).alternatives
               ? cairn_pose_consensus_alternative(map->consensus, place, index)
               : none;
}

cairn_pose cairn_place_map_scan_pose(const cairn_place_map *map, int32_t scan)
{
    return has_result(map) && scan >= 0 && scan < map->scan_count ? map->scans[scan].map_scan
                                                                  : cairn_pose_identity();
}

int32_t cairn_place_map_scan_is_aligned(const cairn_place_map *map, int32_t scan)
{
    return has_result(map) && scan >= 0 && scan < map->scan_count && map->aligner != NULL &&
           cairn_aligner_pose_of(map->aligner, scan).anchored;
}
