/* Long scenes of scan matching: scan_match in all its modes, icp, places without a guess,
 * sequences. */
#include "src/base/build.h"

#include "cairn/icp.h"
#include "cairn/place_map.h"
#include "cairn/sequence.h"
#include "src/alignment/place_map_variants.h"
#include "src/scans/scan_match_variants.h"
#include "tests/long.h"
#include "tests/long_scenes.h"

/* Views that stay valid: the parts of a match point to them. */
typedef struct kept_view {
    cairn_pool pool;
    cairn_scan_match_part part;
    cairn_scan_view view;
    cairn_pose pose;
    cairn_oriented_point dense[LONG_BEAMS];
} kept_view;

static void keep(kept_view *k, const long_world *world, cairn_random *random, cairn_pose pose,
                 int32_t beams, cairn_real view, cairn_real people)
{
    static long_sweep sweep;

    k->pose = pose;
    long_take_sweep(&sweep, world, random, pose, beams, view, people);
    k->view = long_fit(long_new_scan(&k->pool), &sweep);
    k->part = cairn_scan_match_part_of(&k->view);
    k->part.dense_count = cairn_scan_match_dense(&k->view, k->dense);
    k->part.dense = k->dense;
}

static uint64_t add_match(uint64_t hash, const cairn_scan_match *match)
{
    cairn_scan_match_result result = cairn_scan_match_read(match);
    cairn_scan_match_measure measure = cairn_scan_match_measured(match);

    hash = add_int(add_int(hash, result.verdict), result.count);
    hash = add_int(
        add_int(add_int(add_int(hash, measure.units), measure.worst_step), measure.candidates),
        measure.refinements);
    for (int32_t i = 0; i < result.count; i++) {
        const cairn_scan_match_hypothesis *h = &result.hypotheses[i];

        hash = add_covariance(add_pose(hash, h->target_query), h->covariance);
        hash = add_real(add_real(add_real(hash, h->overlap), h->fit), h->free_space_violation);
        hash = add_real(add_real(add_real(hash, h->target_free_space_violation), h->score),
                        h->log_odds);
        hash = add_real(add_vector(add_real(hash, h->sigma), h->weak_direction, 3), h->weak_ratio);
        hash = add_int(add_int(add_real(hash, h->radius), h->observable_dof), h->pairs);
    }
    for (int32_t i = 0; i < cairn_scan_match_pair_count(match); i++) {
        cairn_scan_match_pair pair = cairn_scan_match_pair_at(match, i);

        hash = add_int(add_int(add_int(hash, pair.query), pair.target), pair.stage);
    }
    return hash;
}

/* Scans against a map of two others in one mode, with windows of all kinds. */
static uint64_t match_all(uint64_t seed, const cairn_scan_match_params *params, cairn_real people)
{
    enum { TARGETS = 2, QUERIES = 5 };
    static kept_view views[TARGETS + QUERIES];
    static const cairn_scan_match_window windows[QUERIES] = {
        {2, 4}, {CAIRN_REAL(0.5), CAIRN_REAL(0.4)}, {5, CAIRN_REAL(0.3)}, {1, 2}, {0, 0}};
    cairn_random random = cairn_random_seed(seed, 26);
    static long_world world;
    uint64_t hash = GOLDEN_START;
    cairn_scan_match *match;
    cairn_pool pool;

    long_build(&world, seed, 16);
    LONG_CREATE(&pool, scan_match, &match, params);
    for (int32_t i = 0; i < TARGETS + QUERIES; i++) {
        cairn_pose pose = long_on_the_way(2 + (cairn_real)i * CAIRN_REAL(0.6));

        if (i == TARGETS + QUERIES - 1)
            pose = long_on_the_way(12); /* a scan of other surroundings */
        keep(&views[i], &world, &random, long_disturbed(&random, pose, CAIRN_REAL(0.2), 1), 201,
             CAIRN_REAL(4.2), people);
    }
    if (params->max_views < TARGETS) {
        views[1].part.beams = NULL;
        views[1].part.beam_count = 0;
        views[1].part.dense = NULL;
        views[1].part.dense_count = 0;
    }
    for (int32_t i = 0; i < TARGETS; i++)
        assert_ok(cairn_scan_match_add_target(
            match, &views[i].part, cairn_pose_between(views[0].pose, views[i].pose), NULL));
    for (int32_t i = 0; i < QUERIES; i++) {
        const kept_view *query = &views[TARGETS + i];
        cairn_pose truth = cairn_pose_between(views[0].pose, query->pose);
        cairn_real share[CAIRN_SCAN_MATCH_BINS];

        truth = long_disturbed(&random, truth, windows[i].distance / 3, windows[i].angle / 3);
        assert_ok(cairn_scan_match_begin(match, &query->part, truth,
                                         i < QUERIES - 1 ? &windows[i] : NULL, NULL));
        LONG_RUN(hash, cairn_scan_match_step, match, 5000);
        hash = add_match(hash, match);
        if (cairn_scan_match_pair_count(match) > 0 &&
            cairn_scan_match_histogram(match, 5, share) == CAIRN_OK)
            hash = add_vector(hash, share, CAIRN_SCAN_MATCH_BINS);
    }
    for (int32_t i = 0; i < TARGETS + QUERIES; i++)
        test_pool_free(&views[i].pool);
    test_pool_free(&pool);
    return hash;
}

uint64_t long_match(void)
{
    cairn_scan_match_params params = cairn_scan_match_default();

    return add_int(match_all(41, &params, 0),
                   (int64_t)(match_all(51, &params, CAIRN_REAL(0.1)) >> 1));
}

uint64_t long_match_in_a_crowd(void)
{
    cairn_scan_match_params params = cairn_scan_match_default();

    params.max_hypotheses = 20;
    params.max_candidates = 300;
    params.max_cells = 2500;
    params.max_dense = 300;
    params.max_views = 1;
    params.min_sigma = CAIRN_REAL(0.02);
    params.weak_ratio = CAIRN_REAL(0.01);
    return add_int(match_all(42, &params, CAIRN_REAL(0.3)),
                   (int64_t)(match_all(52, &params, CAIRN_REAL(0.1)) >> 1));
}

uint64_t long_match_by_shape(void)
{
    static const cairn_scan_match_mode modes[] = {
        CAIRN_SCAN_MATCH_SHAPE, CAIRN_SCAN_MATCH_SHAPE_COMMON, CAIRN_SCAN_MATCH_SHAPE_COLINEAR,
        CAIRN_SCAN_MATCH_SHAPE_SEGMENTS, CAIRN_SCAN_MATCH_SHAPE_LINES};
    cairn_scan_match_params params = cairn_scan_match_default();
    uint64_t hash = GOLDEN_START;

    for (size_t k = 0; k < sizeof modes / sizeof *modes; k++) {
        params.mode = modes[k];
        hash = add_int(hash, (int64_t)(match_all(43, &params, 0) >> 1));
    }
    return hash;
}

/* ---- icp ---- */

static uint64_t add_icp(uint64_t hash, const cairn_icp_result *r)
{
    hash = add_real(
        add_real(add_covariance(add_pose(hash, r->target_query), r->covariance), r->mean_distance),
        r->sigma);
    hash = add_real(
        add_real(add_vector(add_real(add_real(hash, r->gate), r->overlap), r->weak_direction, 3),
                 r->weak_ratio),
        r->radius);
    return add_int(add_int(add_int(add_int(hash, r->observable_dof), r->pairs), r->iterations),
                   r->verdict);
}

uint64_t long_icp(void)
{
    enum { VIEWS = 8 };
    static kept_view views[VIEWS];
    cairn_rigid_motion_pose_prior prior = {
        {0, 0, 0}, CAIRN_REAL(0.1), CAIRN_REAL(0.2), CAIRN_REAL(0.1)};
    cairn_random random = cairn_random_seed(44, 27);
    static long_world world;
    uint64_t hash = GOLDEN_START;
    cairn_pool pool;
    cairn_icp *icp;

    long_build(&world, 44, 12);
    for (int32_t i = 0; i < VIEWS; i++)
        keep(&views[i], &world, &random, long_on_the_way(10 + (cairn_real)i * CAIRN_REAL(0.7)), 161,
             3, i > 5 ? CAIRN_REAL(0.3) : 0);
    for (int32_t k = 0; k < 6; k++) {
        cairn_icp_params params = cairn_icp_default();

        params.mode = k % 2;
        params.roll_back = k / 2 % 2;
        params.max_iterations = k == 5 ? 6 : 30;
        params.gate_factor = k == 4 ? 2 : 3;
        params.weak_ratio = k == 3 ? CAIRN_REAL(0.2) : CAIRN_REAL(0.01);
        LONG_CREATE(&pool, icp, &icp, &params);
        for (int32_t i = 0; i < 2; i++)
            assert_ok(cairn_icp_add_target(icp, views[i].view.points, views[i].view.point_count,
                                           cairn_pose_between(views[0].pose, views[i].pose), NULL));
        for (int32_t i = 2; i < VIEWS; i++) {
            cairn_pose start = cairn_pose_between(views[0].pose, views[i].pose);
            cairn_icp_result result;

            start = long_disturbed(&random, start, CAIRN_REAL(0.3), CAIRN_REAL(0.2));
            prior.mean = start;
            assert_ok(cairn_icp_begin(icp, views[i].view.points, views[i].view.point_count, start,
                                      i % 3 == 2 ? NULL : &prior, NULL));
            LONG_RUN(hash, cairn_icp_step, icp, 700);
            result = cairn_icp_read(icp);
            hash = add_icp(hash, &result);
        }
        test_pool_free(&pool);
    }
    for (int32_t i = 0; i < VIEWS; i++)
        test_pool_free(&views[i].pool);
    return hash;
}

/* ---- Places ---- */

enum { PLACES = 5, HEADINGS = 3 };

static uint64_t place_all(uint64_t seed, const cairn_place_map_params *params, cairn_real people)
{
    cairn_random random = cairn_random_seed(seed, 28);
    static long_world world;
    static long_sweep sweep;
    uint64_t hash = GOLDEN_START;
    cairn_place_map_result result;
    cairn_pool scan_pool, pool;
    cairn_scan *scan = long_new_scan(&scan_pool);
    cairn_place_map *map;

    long_build(&world, seed, 18);
    LONG_CREATE(&pool, place_map, &map, params);
    for (int32_t i = 0; i < PLACES * HEADINGS; i++) {
        int32_t stop = i / HEADINGS;
        cairn_pose place = long_on_the_way((cairn_real)stop * CAIRN_REAL(1.3)), heading = {0, 0, 2};
        cairn_pose place_scan, slight;
        cairn_scan_view view;

        heading.theta *= (cairn_real)(i % HEADINGS);
        place_scan = long_disturbed(&random, heading, CAIRN_REAL(0.1), CAIRN_REAL(0.1));
        long_take_sweep(&sweep, &world, &random, cairn_pose_compose(place, place_scan), 161,
                        CAIRN_REAL(2.2), people);
        view = long_fit(scan, &sweep);
        slight = long_disturbed(&random, place_scan, CAIRN_REAL(0.03), CAIRN_REAL(0.02));
        assert_ok(cairn_place_map_add_scan(map, i / HEADINGS, &view, slight, NULL));
    }
    assert_ok(cairn_place_map_begin(map));
    LONG_RUN(hash, cairn_place_map_step, map, 100000);
    result = cairn_place_map_read(map);
    hash = add_int(add_int(add_int(add_int(hash, result.places), result.placed), result.components),
                   result.ambiguous);
    hash = add_int(
        add_int(add_int(add_int(hash, result.matches), result.hypotheses), result.decoupled),
        result.units);
    hash = add_real(add_real(hash, result.total), result.competing_total);
    for (int32_t i = 0; i < PLACES; i++) {
        cairn_place_map_place place = cairn_place_map_place_of(map, i);

        hash = add_real(add_pose(hash, place.map_place), place.support);
        hash =
            add_int(add_int(add_int(hash, place.component), place.ambiguous), place.alternatives);
        for (int32_t k = 0; k < place.alternatives; k++) {
            cairn_pose_consensus_competing_pose other = cairn_place_map_alternative(map, i, k);

            hash = add_int(
                add_real(add_real(add_pose(hash, other.map_node), other.support), other.weight),
                other.is_other_map);
        }
    }
    for (int32_t i = 0; i < PLACES * HEADINGS; i++)
        hash = add_pose(hash, cairn_place_map_scan_pose(map, i));
    test_pool_free(&pool);
    test_pool_free(&scan_pool);
    return hash;
}

static cairn_place_map_params small_places(void)
{
    cairn_place_map_params params = cairn_place_map_default();

    params.max_places = PLACES;
    params.max_scans = PLACES * HEADINGS;
    params.max_place_points = 600;
    params.max_place_beams = 600;
    params.rematch_rounds = 2;
    params.match.max_hypotheses = 6;
    params.match.max_candidates = 96;
    params.consensus.max_hypotheses = 200;
    return params;
}

uint64_t long_places(void)
{
    cairn_place_map_params params = small_places();

    params.decoupled = CAIRN_PLACE_MAP_BY_ICP;
    return place_all(45, &params, 0);
}

uint64_t long_places_in_a_crowd(void)
{
    cairn_place_map_params params = small_places();

    params.decoupled = CAIRN_PLACE_MAP_JOINTLY;
    params.chance_nats = 2;
    params.visibility_reach = 5;
    params.visibility_cell = CAIRN_REAL(0.08);
    params.dynamic_factor = CAIRN_REAL(0.3);
    return add_int(place_all(46, &params, CAIRN_REAL(0.15)),
                   (int64_t)(place_all(56, &params, CAIRN_REAL(0.05)) >> 1));
}

uint64_t long_places_in_order(void)
{
    cairn_place_map_params params = small_places();

    params.mode = CAIRN_PLACE_MAP_SEQUENTIAL;
    params.recent_places = 2;
    return place_all(47, &params, 0);
}

/* ---- Sequences ---- */

typedef struct words {
    cairn_sequence_kind kind;
    int32_t first[60], second[50];
} words;

static cairn_real compare(const void *context, int32_t i, int32_t j)
{
    const words *w = context;
    int32_t apart = w->first[i] - w->second[j];

    if (w->kind == CAIRN_SEQUENCE_LCS)
        return apart == 0;
    if (w->kind == CAIRN_SEQUENCE_LOCAL)
        return apart == 0 ? 2 : -CAIRN_REAL(0.75);
    return (cairn_real)(apart * apart) / 4;
}

uint64_t long_sequences(void)
{
    cairn_random random = cairn_random_seed(48, 29);
    uint64_t hash = GOLDEN_START;
    words w;

    for (w.kind = CAIRN_SEQUENCE_LCS; w.kind <= CAIRN_SEQUENCE_DTW; w.kind++) {
        cairn_sequence_params params = {
            .kind = w.kind, .max_first = 60, .max_second = 50, .gap_cost = CAIRN_REAL(0.5)};
        cairn_sequence *sequence;
        cairn_pool pool;

        LONG_CREATE(&pool, sequence, &sequence, &params);
        for (int32_t k = 0; k < 12; k++) {
            cairn_sequence_result result;

            for (int32_t i = 0; i < 60; i++)
                w.first[i] = cairn_random_below(&random, 6);
            for (int32_t i = 0; i < 50; i++)
                w.second[i] = cairn_random_unit(&random) < CAIRN_REAL(0.8)
                                  ? w.first[i + k / 2]
                                  : cairn_random_below(&random, 6);
            assert_ok(cairn_sequence_begin(sequence, 60 - k, 50 - 2 * k, compare, &w));
            LONG_RUN(hash, cairn_sequence_step, sequence, 37);
            result = cairn_sequence_read(sequence);
            hash = add_real(add_int(hash, result.count), result.score);
            for (int32_t i = 0; i < result.count; i++)
                hash = add_int(add_int(hash, result.pairs[i].first), result.pairs[i].second);
        }
        test_pool_free(&pool);
    }
    return hash;
}
