/* Maps of places without odometry: simulated arenas, ambiguity, likelihoods compared with a
 * reference implementation, refusals. */
#include "tests/place_mapping.h"

#include <math.h>

#include "sim/arena.h"
#include "src/alignment/place_map_variants.h"
#include "src/alignment/place_map_work.h"
#include "tests/rooms.h"

enum { MAX_SCANS = 64 };

static const double DEGREE = 0.017453292519943295;

/* ---- Scans ---- */

/* A set of scans with their places and their poses in the places; views are valid with `reader`
 * only until the next one. */
struct scans {
    cairn_scan_input input[MAX_SCANS];
    int32_t place[MAX_SCANS];
    cairn_pose place_scan[MAX_SCANS];
    cairn_pose truth[MAX_SCANS];
    int32_t count;
};

/* The first `places` places of an arena. */
struct arena {
    sim_arena *arena;
    sim_survey *survey;
    struct scans scans;
};

static cairn_pose pose_of(sim_pose p)
{
    cairn_pose pose = {(cairn_real)p.x, (cairn_real)p.y, (cairn_real)p.theta};

    return pose;
}

/* error: of the scans in their places, uniform +-m and +-degrees. people: share of the beams that
 * end on people. */
static void make_arena(struct arena *a, uint64_t seed, int32_t places, double error_m,
                       double error_deg, double people)
{
    sim_arena_options arena = sim_arena_default();
    sim_survey_options survey = sim_survey_default();
    cairn_random random = cairn_random_seed(seed, 3);
    const sim_scan *scans;
    char fault[256] = "";
    int32_t count, first = 0;

    memset(a, 0, sizeof *a);
    arena.seed = survey.seed = seed;
    arena.width = 7;
    arena.height = 6;
    survey.places = places;
    survey.beams = 201;
    survey.crowd = people;
    a->arena = sim_arena_create(&arena, fault, sizeof fault);
    assert_non_null(a->arena);
    a->survey = sim_survey_create(a->arena, &survey, fault, sizeof fault);
    assert_non_null(a->survey);
    scans = sim_survey_scans(a->survey, &count);
    for (int32_t k = 0; k < count && scans[k].place < places; k++) {
        struct scans *s = &a->scans;
        int32_t i = s->count++;

        s->input[i] = sim_scan_input(&scans[k]);
        s->place[i] = scans[k].place;
        s->truth[i] = pose_of(scans[k].truth);
        if (i == 0 || s->place[i] != s->place[i - 1])
            first = i;
        s->place_scan[i] = cairn_pose_between(s->truth[first], s->truth[i]);
        if (i != first) {
            s->place_scan[i].x +=
                (cairn_real)(error_m * (double)cairn_random_uniform(&random, -1, 1));
            s->place_scan[i].y +=
                (cairn_real)(error_m * (double)cairn_random_uniform(&random, -1, 1));
            s->place_scan[i].theta +=
                (cairn_real)(error_deg * DEGREE * (double)cairn_random_uniform(&random, -1, 1));
        }
    }
}

static void free_arena(struct arena *a)
{
    sim_survey_free(a->survey);
    sim_arena_free(a->arena);
}

/* Another scan of a place that has only one, or whose scans are all at its origin. */
static void add_room_scan(struct scans *s, const rooms_room *room, int32_t place, cairn_pose pose)
{
    static rooms_scan taken[MAX_SCANS];

    s->input[s->count] = rooms_take_scan(room, pose, (uint64_t)s->count + 1, &taken[s->count]);
    s->place[s->count] = place;
    s->place_scan[s->count] = cairn_pose_identity();
    s->truth[s->count++] = pose;
}

/* ---- Maps ---- */

struct mapper {
    cairn_pool pool;
    cairn_scan *scan;
    cairn_place_map *map;
};

static cairn_place_map_params small_params(int32_t places)
{
    cairn_place_map_params params = cairn_place_map_default();

    params.max_places = places;
    params.max_scans = 4 * places;
    params.max_place_beams = 1024;
    params.consensus.max_hypotheses = 512;
    return params;
}

static void make_mapper(struct mapper *m, const cairn_place_map_params *params)
{
    cairn_scan_params scan = cairn_scan_default();

    m->pool = test_pool(cairn_scan_memory(&scan) + cairn_place_map_memory(params));
    assert_ok(cairn_scan_create(&m->scan, &m->pool, &scan));
    assert_ok(cairn_place_map_create(&m->map, &m->pool, params));
}

static void load(struct mapper *m, const struct scans *scans)
{
    cairn_place_map_clear(m->map);
    for (int32_t k = 0; k < scans->count; k++) {
        cairn_scan_view view = view_of(m->scan, &scans->input[k]);

        assert_ok(
            cairn_place_map_add_scan(m->map, scans->place[k], &view, scans->place_scan[k], NULL));
    }
}

static cairn_place_map_result solve(struct mapper *m)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status;

    assert_ok(cairn_place_map_begin(m->map));
    assert_int_equal(cairn_place_map_read(m->map).places, 0);
    assert_int_equal(cairn_place_map_place_of(m->map, 0).component, 0);
    while ((status = cairn_place_map_step(m->map, &budget)) == CAIRN_MORE)
        budget.left = CAIRN_UNBOUNDED;
    assert_ok(status);
    return cairn_place_map_read(m->map);
}

/* Places that lie within the given metres and radians of the truth, relative to the first. */
static int32_t count_right(const struct mapper *m, const struct scans *scans, double metres,
                           double radians)
{
    int32_t right = 0;

    for (int32_t k = 0; k < scans->count; k++) {
        cairn_pose pose = cairn_place_map_place_of(m->map, scans->place[k]).map_place;
        cairn_pose seen = cairn_pose_between(scans->truth[0], scans->truth[k]);

        right += (k == 0 || scans->place[k] != scans->place[k - 1]) &&
                 hypot((double)(pose.x - seen.x), (double)(pose.y - seen.y)) < metres &&
                 fabs((double)cairn_wrap_angle(pose.theta - seen.theta)) < radians;
    }
    return right;
}

/* ---- What it finds ---- */

static void places_of_an_arena(void **state)
{
    cairn_place_map_params params = small_params(6);
    static struct arena arena;
    struct mapper m;
    cairn_place_map_result result;
    cairn_real expected_wrong = 0;

    (void)state;
    make_arena(&arena, 1003, 6, 0, 0, 0);
    make_mapper(&m, &params);
    load(&m, &arena.scans);
    result = solve(&m);
    assert_int_equal(result.places, 6);
    assert_int_equal(result.placed, 6);
    assert_int_equal(result.components, 1);
    assert_int_equal(result.matches, 15 + 6);
    assert_true(result.hypotheses >= 5);
    assert_true(result.total > 10);
    assert_int_equal(result.decoupled, 0);
    assert_int_equal(count_right(&m, &arena.scans, 0.03, 0.5 * DEGREE), 6);
    for (int32_t k = 0; k < arena.scans.count; k++) {
        cairn_place_map_place place = cairn_place_map_place_of(m.map, arena.scans.place[k]);
        cairn_pose pose = cairn_place_map_scan_pose(m.map, k);
        cairn_pose expected = cairn_pose_compose(place.map_place, arena.scans.place_scan[k]);

        assert_near(pose.x, expected.x, NUMBER(1e-9, 1e-4));
        assert_near(pose.y, expected.y, NUMBER(1e-9, 1e-4));
        assert_near(cairn_wrap_angle(pose.theta - expected.theta), 0, NUMBER(1e-9, 1e-4));
        assert_int_equal(place.component, 0);
        assert_true(place.support > 1);
        assert_true(place.link_support > 10);
    }
    for (int32_t i = 0; i < 6; i++)
        expected_wrong += cairn_place_map_place_of(m.map, i).error_probability;
    assert_true(expected_wrong < CAIRN_REAL(0.5));
    assert_near(cairn_place_map_scan_pose(m.map, arena.scans.count).x, 0, 0);
    assert_near(cairn_place_map_scan_pose(m.map, -1).x, 0, 0);
    assert_int_equal(cairn_place_map_place_of(m.map, 6).alternatives, 0);
    assert_near(cairn_place_map_place_of(m.map, -1).support, 0, 0);
    test_pool_free(&m.pool);
    free_arena(&arena);
}

/* Places of another arena fit somewhere by chance: they become separate components or submaps. */
static void places_of_another_arena_are_reported(void **state)
{
    enum { OWN_PLACES = 3, UNRELATED_PLACES = 2 };
    cairn_place_map_params params = small_params(OWN_PLACES + UNRELATED_PLACES);
    static struct arena arena, unrelated;
    struct mapper m;
    int32_t joined = 0, submaps = 0;

    (void)state;
    make_arena(&arena, 1003, OWN_PLACES, 0, 0, 0);
    make_arena(&unrelated, 1012, UNRELATED_PLACES, 0, 0, 0);
    for (int32_t k = 0; k < unrelated.scans.count; k++) {
        int32_t i = arena.scans.count++;

        arena.scans.input[i] = unrelated.scans.input[k];
        arena.scans.place[i] = unrelated.scans.place[k] + OWN_PLACES;
        arena.scans.place_scan[i] = unrelated.scans.place_scan[k];
    }
    make_mapper(&m, &params);
    load(&m, &arena.scans);
    (void)solve(&m);
    for (int32_t i = 0; i < OWN_PLACES; i++)
        for (int32_t k = OWN_PLACES; k < OWN_PLACES + UNRELATED_PLACES; k++) {
            cairn_place_map_place own = cairn_place_map_place_of(m.map, i);
            cairn_place_map_place other = cairn_place_map_place_of(m.map, k);

            joined += own.component == other.component && own.submap == other.submap;
            submaps += other.submap > 0 && other.ambiguous;
            assert_true(other.error_probability > CAIRN_REAL(0.1));
        }
    assert_int_equal(joined, 0);
    assert_int_equal(submaps, OWN_PLACES * UNRELATED_PLACES);
    test_pool_free(&m.pool);
    free_arena(&unrelated);
    free_arena(&arena);
}

/* The poses in a log must not be used. */
static void the_order_of_budgets_and_stamps_do_not_matter(void **state)
{
    const int32_t budgets[] = {CAIRN_UNBOUNDED, 1, 7, 1000};
    cairn_place_map_params params = small_params(3);
    static struct arena arena;
    struct mapper m;
    uint64_t first = 0;

    (void)state;
    make_arena(&arena, 1003, 3, 0, 0, 0);
    make_mapper(&m, &params);
    for (int32_t b = 0; b < 4; b++) {
        cairn_budget budget = {0};
        cairn_status status;
        int64_t units = 0;

        for (int32_t k = 0; k < arena.scans.count; k++)
            arena.scans.input[k].stamp_ns = 1000 * b + k;
        load(&m, &arena.scans);
        assert_ok(cairn_place_map_begin(m.map));
        assert_status(cairn_place_map_step(m.map, &budget), CAIRN_MORE);
        do {
            budget.left = budgets[b];
            status = cairn_place_map_step(m.map, &budget);
            assert_true(budget.left >= 0);
            units += budgets[b] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        assert_int_equal(cairn_place_map_read(m.map).units, units);
        if (b == 0)
            first = hash_of(m.map, arena.scans.count);
        assert_true(hash_of(m.map, arena.scans.count) == first);
    }
    test_pool_free(&m.pool);
    free_arena(&arena);
}

/* Sum of the errors of the scans relative to each other. */
static void relative_errors(const struct mapper *m, const struct scans *scans, double errors[2])
{
    errors[0] = errors[1] = 0;
    for (int32_t k = 0; k < scans->count; k++)
        for (int32_t l = k + 1; l < scans->count; l++) {
            cairn_pose seen = cairn_pose_between(scans->truth[k], scans->truth[l]);
            cairn_pose found = cairn_pose_between(cairn_place_map_scan_pose(m->map, k),
                                                  cairn_place_map_scan_pose(m->map, l));

            errors[0] += hypot((double)(found.x - seen.x), (double)(found.y - seen.y));
            errors[1] += fabs((double)cairn_wrap_angle(found.theta - seen.theta));
        }
}

/* A pair's likelihood is charged before it is evaluated: a step whose units do not reach for two
 * stores at most one hypothesis of a match. */
static void a_step_scores_what_it_has_charged(void **state)
{
    cairn_place_map_params params = small_params(3);
    const int32_t units = 16;
    static struct arena arena;
    struct mapper m;
    cairn_status status = CAIRN_MORE;
    int32_t stored = 0;

    (void)state;
    make_arena(&arena, 1003, 3, 0, 0, 0);
    make_mapper(&m, &params);
    load(&m, &arena.scans);
    assert_ok(cairn_place_map_begin(m.map));
    while (status == CAIRN_MORE) {
        cairn_budget budget = {units};

        status = cairn_place_map_step(m.map, &budget);
        assert_true(m.map->hypothesis_count <= stored + 1);
        stored = m.map->hypothesis_count;
    }
    assert_ok(status);
    assert_true(stored > 3);
    for (int32_t i = 0; i < 3; i++)
        assert_true(cairn_place_map_pair_units(m.map, i, (i + 1) % 3) >= units);
    test_pool_free(&m.pool);
    free_arena(&arena);
}

static void scans_aligned_by_themselves(void **state)
{
    const double most[3] = {1, 0.9, 0.25}; /* of the remaining errors */
    cairn_place_map_params params = small_params(6);
    static struct arena arena;
    double first[2];

    (void)state;
    make_arena(&arena, 1003, 6, 0.05, 2, 0);
    for (int32_t decoupled = CAIRN_PLACE_MAP_COUPLED; decoupled <= CAIRN_PLACE_MAP_JOINTLY;
         decoupled++) {
        struct mapper m;
        double errors[2];
        cairn_place_map_result result;

        params.decoupled = decoupled;
        make_mapper(&m, &params);
        load(&m, &arena.scans);
        result = solve(&m);
        assert_int_equal(result.decoupled > 0, decoupled != CAIRN_PLACE_MAP_COUPLED);
        assert_true(result.decoupled <= arena.scans.count);
        relative_errors(&m, &arena.scans, errors);
        if (decoupled == CAIRN_PLACE_MAP_COUPLED)
            memcpy(first, errors, sizeof first);
        assert_true(errors[0] <= most[decoupled] * first[0]);
        assert_true(errors[1] <= most[decoupled] * first[1]);
        test_pool_free(&m.pool);
    }
    free_arena(&arena);
}

/* The place moves with its first scan, and rooms that share nothing are components or submaps that
 * do not change. */
static void parts_are_aligned_apart(void **state)
{
    const cairn_pose poses[4] = {{0, 0, 0},
                                 {CAIRN_REAL(0.6), CAIRN_REAL(0.3), 1},
                                 {0, 0, CAIRN_REAL(0.5)},
                                 {CAIRN_REAL(0.5), 0, 3}};
    cairn_place_map_params params = small_params(4);
    rooms_room rooms[2] = {{.count = 0}, {.count = 0}};
    static struct scans scans;
    struct mapper m;

    (void)state;
    rooms_add_box(&rooms[0], -3, -2, 3, 2);
    rooms_add_box(&rooms[0], 1.8, 1, 3, 2);
    rooms_add_box(&rooms[1], -4, -3, 4, 2);
    rooms_add_box(&rooms[1], 1.5, -1, 4, 2);
    scans.count = 0;
    for (int32_t i = 0; i < 4; i++)
        add_room_scan(&scans, &rooms[i / 2], i, poses[i]);
    params.decoupled = CAIRN_PLACE_MAP_JOINTLY;
    make_mapper(&m, &params);
    load(&m, &scans);
    (void)solve(&m);
    for (int32_t i = 0; i < 4; i++) {
        cairn_place_map_place first = cairn_place_map_place_of(m.map, i / 2 * 2), place;
        cairn_pose expected = cairn_pose_between(poses[i / 2 * 2], poses[i]), found;

        place = cairn_place_map_place_of(m.map, i);
        found = cairn_pose_between(first.map_place, place.map_place);
        assert_int_equal(place.component, first.component);
        assert_int_equal(place.ambiguous != 0 || place.component != 0, i >= 2);
        assert_near(found.x, expected.x, 0.02);
        assert_near(found.y, expected.y, 0.02);
        assert_near(cairn_wrap_angle(found.theta - expected.theta), 0, 0.01);
    }
    test_pool_free(&m.pool);
}

static void an_aligner_that_is_full_refuses(void **state)
{
    cairn_place_map_params params = small_params(2);
    rooms_room room = {.count = 0};
    static struct scans scans;
    struct mapper m;
    cairn_scan_view view;

    (void)state;
    rooms_add_box(&room, -3, -2, 3, 2);
    scans.count = 0;
    add_room_scan(&scans, &room, 0, cairn_pose_identity());
    params.decoupled = CAIRN_PLACE_MAP_JOINTLY;
    params.aligner.max_segments = 0;
    assert_int_equal(cairn_place_map_memory(&params), 0);
    params.aligner.max_segments = 1;
    make_mapper(&m, &params);
    view = view_of(m.scan, &scans.input[0]);
    assert_status(cairn_place_map_add_scan(m.map, 0, &view, cairn_pose_identity(), NULL),
                  CAIRN_FULL);
    assert_status(cairn_place_map_begin(m.map), CAIRN_EMPTY);
    test_pool_free(&m.pool);
}

/* A rectangle is symmetric under half a turn. */
static void half_a_turn_of_a_rectangle_is_ambiguous(void **state)
{
    const cairn_pose poses[2] = {{1, CAIRN_REAL(0.5), 0}, {CAIRN_REAL(-1.2), CAIRN_REAL(-0.4), 2}};
    cairn_place_map_params params = small_params(2);
    rooms_room room = {.count = 0};
    static struct scans scans;
    struct mapper m;
    cairn_place_map_result result;
    cairn_place_map_place place;
    cairn_pose_consensus_competing_pose other;

    (void)state;
    rooms_add_box(&room, -3, -2, 3, 2);
    scans.count = 0;
    for (int32_t i = 0; i < 2; i++)
        add_room_scan(&scans, &room, i, poses[i]);
    make_mapper(&m, &params);
    load(&m, &scans);
    result = solve(&m);
    assert_int_equal(result.components, 1);
    assert_true(result.ambiguous > 0);
    place = cairn_place_map_place_of(m.map, 1);
    assert_int_equal(place.ambiguous, 1);
    assert_true(place.alternatives > 0);
    other = cairn_place_map_alternative(m.map, 1, 0);
    assert_near(fabs((double)cairn_wrap_angle(other.map_node.theta - place.map_place.theta)),
                3.14159, 0.02);
    assert_near(cairn_place_map_alternative(m.map, 1, place.alternatives).weight, 0, 0);

    /* A box in a corner makes it unambiguous. */
    rooms_add_box(&room, 2, 1, 3, 2);
    scans.count = 0;
    for (int32_t i = 0; i < 2; i++)
        add_room_scan(&scans, &room, i, poses[i]);
    load(&m, &scans);
    result = solve(&m);
    assert_int_equal(result.ambiguous, 0);
    assert_int_equal(count_right(&m, &scans, 0.03, 0.01), 2);
    test_pool_free(&m.pool);
}

static void different_rooms_are_components(void **state)
{
    cairn_place_map_params params = small_params(4);
    rooms_room small = {.count = 0}, large = {.count = 0};
    static struct scans scans;

    (void)state;
    rooms_add_box(&small, -1, -1.5, 1, 1.5);
    rooms_add_box(&small, 0.5, 0.7, 1, 1.5);
    rooms_add_box(&large, -4, -3, 4, 3);
    rooms_add_box(&large, 1.5, 1, 4, 3);
    scans.count = 0;
    for (int32_t i = 0; i < 4; i++) {
        cairn_pose pose = {CAIRN_REAL(0.3) * (cairn_real)i - CAIRN_REAL(0.3), CAIRN_REAL(-0.2),
                           (cairn_real)i};

        add_room_scan(&scans, i % 2 == 0 ? &large : &small, i, pose);
    }
    for (int32_t jointly = 0; jointly < 2; jointly++) {
        cairn_place_map_result result;
        struct mapper m;

        params.decoupled = jointly ? CAIRN_PLACE_MAP_JOINTLY : params.decoupled;
        make_mapper(&m, &params);
        load(&m, &scans);
        result = solve(&m);
        assert_int_equal(result.components, 2);
        assert_int_equal(result.placed, 2);
        for (int32_t i = 0; i < 4; i++) {
            cairn_place_map_place place = cairn_place_map_place_of(m.map, i);
            cairn_pose seen = cairn_pose_between(scans.truth[i % 2], scans.truth[i]);

            assert_int_equal(place.component, i % 2);
            assert_near(place.map_place.x, seen.x, 0.02);
            assert_near(place.map_place.y, seen.y, 0.02);
            assert_near(cairn_wrap_angle(place.map_place.theta - seen.theta), 0, 0.01);
        }
        test_pool_free(&m.pool);
    }
}

static void one_after_the_other(void **state)
{
    cairn_place_map_params params = small_params(4);
    rooms_room room = {.count = 0};
    static struct scans scans;
    struct mapper m;
    cairn_place_map_result result;

    (void)state;
    rooms_add_box(&room, -3, -2, 3, 2);
    rooms_add_box(&room, 1.8, 1, 3, 2);
    rooms_add_box(&room, -0.5, -2, 0.2, -1.2);
    scans.count = 0;
    for (int32_t i = 0; i < 4; i++) {
        cairn_pose pose = {CAIRN_REAL(0.5) * (cairn_real)i - 1, CAIRN_REAL(0.3), (cairn_real)i};

        add_room_scan(&scans, &room, i, pose);
    }
    params.mode = CAIRN_PLACE_MAP_SEQUENTIAL;
    params.recent_places = 2;
    make_mapper(&m, &params);
    load(&m, &scans);
    result = solve(&m);
    assert_int_equal(result.matches, 3);
    assert_int_equal(result.hypotheses, 0);
    assert_int_equal(result.components, 1);
    assert_int_equal(count_right(&m, &scans, 0.03, 0.01), 4);
    assert_int_equal(cairn_place_map_place_of(m.map, 1).ambiguous, 0);
    assert_near(cairn_place_map_place_of(m.map, 1).error_probability, 1, 0); /* not estimated */
    test_pool_free(&m.pool);
}

/* An error is less probable with more support of the link, and more with a competing pose; a ratio of
 * supports, not their difference, decides. */
static void the_error_probability_follows_the_supports(void **state)
{
    const cairn_real most = CAIRN_REAL_MAX;

    (void)state;
    for (int32_t competing = 0; competing <= 100; competing += 50) {
        cairn_real before = cairn_place_map_error_probability(200, (cairn_real)competing, -10, 0);

        assert_near(before, cairn_place_map_error_probability(200, (cairn_real)competing, 0, 0), 0);
        for (int32_t nats = 1; nats < 300; nats++) {
            cairn_real now =
                cairn_place_map_error_probability(200, (cairn_real)competing, (cairn_real)nats, 0);

            /* a strong link adds less than the last digit */
            assert_true(nats < 100 ? now < before || now == CAIRN_REAL(0.001)
                                   : now <= before + (cairn_real)NUMBER(1e-15, 1e-7));
            assert_true(now <= cairn_place_map_error_probability(200, (cairn_real)competing + 50,
                                                                 (cairn_real)nats, 0));
            assert_true(now <= cairn_place_map_error_probability(200, (cairn_real)competing,
                                                                 (cairn_real)nats, 1));
            before = now;
        }
    }
    assert_near(cairn_place_map_error_probability(most, 0, most, 0), 0.001, 1e-9);
    assert_true(cairn_place_map_error_probability(40, 36, most, 0) > CAIRN_REAL(0.1));
    assert_true(cairn_place_map_error_probability(400, 360, most, 0) > CAIRN_REAL(0.1));
    assert_true(cairn_place_map_error_probability(-10, 0, most, 0) > CAIRN_REAL(0.1));
}

static void one_place(void **state)
{
    cairn_place_map_params params = small_params(2);
    rooms_room room = {.count = 0};
    static struct scans scans;
    struct mapper m;
    cairn_place_map_result result;

    (void)state;
    rooms_add_box(&room, -3, -2, 3, 2);
    scans.count = 0;
    add_room_scan(&scans, &room, 0, cairn_pose_identity());
    for (int k = 0; k < 2; k++) {
        params.mode = k == 0 ? CAIRN_PLACE_MAP_CONSENSUS : CAIRN_PLACE_MAP_SEQUENTIAL;
        make_mapper(&m, &params);
        assert_status(cairn_place_map_begin(m.map), CAIRN_EMPTY);
        load(&m, &scans);
        result = solve(&m);
        assert_int_equal(result.places, 1);
        assert_int_equal(result.components, 1);
        assert_int_equal(result.matches, 0);
        assert_near(cairn_place_map_place_of(m.map, 0).map_place.x, 0, 0);
        test_pool_free(&m.pool);
    }
}

/* ---- Evidence ---- */

/* The likelihood of a place among others by a reference implementation: all marks of a point in a
 * set, and a list of the points that share it. */
static double reference_among(const cairn_place_map *map, int32_t place, const cairn_pose *poses,
                              const int32_t *parts)
{
    double sum = 0;

    for (int32_t s = 0; s < map->scan_count; s++) {
        int32_t of = map->scans[s].place;

        for (int32_t i = 0; i < map->scans[s].point_count && (of == place || parts[of] == 0); i++) {
            const cairn_oriented_point *point = &map->points[map->scans[s].first_point + i];
            int floats = map->point_class[map->scans[s].first_point + i] &
                         PLACE_MAP_POINT_DYNAMIC_CANDIDATE,
                sharers = 1;
            cairn_pose map_scan = cairn_pose_compose(poses[of], map->scans[s].place_scan);
            cairn_vec2 position = cairn_pose_point(map_scan, point->position);
            cairn_vec2 direction =
                cairn_transform_direction(cairn_transform_of(map_scan), point->direction);
            int marks[64] = {0};
            double nats = 0;

            for (int32_t k = 0; k < map->place_count; k++) {
                cairn_transform seen_from = cairn_transform_of(cairn_pose_inverse(poses[k]));
                int32_t saw =
                    cairn_place_map_observed(map, k, cairn_transform_point(seen_from, position),
                                             cairn_transform_direction(seen_from, direction));

                if (k == of || (k != place && parts[k] != 0))
                    continue;
                if (of == place || k == place)
                    marks[saw] = 1;
                else
                    sharers += saw > PLACE_MAP_OBSERVED_FREE;
            }
            if (floats) {
                nats = marks[PLACE_MAP_OBSERVED_DYNAMIC] || marks[PLACE_MAP_OBSERVED_ROUGH] ? 0.42
                       : marks[PLACE_MAP_OBSERVED_PARALLEL] || marks[PLACE_MAP_OBSERVED_OPPOSITE] ||
                               marks[PLACE_MAP_OBSERVED_OTHER_DIRECTION]
                           ? 0.26
                           : 0;
                nats -= marks[PLACE_MAP_OBSERVED_FREE] ? 0.19 : 0;
            } else {
                int any = marks[PLACE_MAP_OBSERVED_PARALLEL] + marks[PLACE_MAP_OBSERVED_OPPOSITE] +
                          marks[PLACE_MAP_OBSERVED_OTHER_DIRECTION] +
                          marks[PLACE_MAP_OBSERVED_ROUGH] + marks[PLACE_MAP_OBSERVED_DYNAMIC];

                nats = marks[PLACE_MAP_OBSERVED_PARALLEL]   ? 0.2
                       : marks[PLACE_MAP_OBSERVED_ROUGH]    ? 0.87
                       : marks[PLACE_MAP_OBSERVED_OPPOSITE] ? 0.1
                       : marks[PLACE_MAP_OBSERVED_DYNAMIC]  ? 0.1
                                                            : 0;
                nats -= !marks[PLACE_MAP_OBSERVED_FREE] ? 0 : any ? 1.75 : 1.2;
            }
            sum += of == place ? nats : nats / sharers;
        }
    }
    for (int32_t y = 0; y < map->visibility_side; y += 6)
        for (int32_t x = 0; x < map->visibility_side; x += 6) {
            cairn_vec2 here = {((cairn_real)x + CAIRN_REAL(0.5)) * map->params.visibility_cell -
                                   map->params.visibility_reach,
                               ((cairn_real)y + CAIRN_REAL(0.5)) * map->params.visibility_cell -
                                   map->params.visibility_reach};
            cairn_vec2 at = cairn_pose_point(poses[place], here), none = {0, 0};
            int shared = 0;

            if (cairn_place_map_observed(map, place, here, none) != PLACE_MAP_OBSERVED_FREE)
                continue;
            for (int32_t k = 0; k < map->place_count; k++)
                shared |= k != place && parts[k] == 0 &&
                          cairn_place_map_observed(
                              map, k, cairn_pose_point(cairn_pose_inverse(poses[k]), at), none) ==
                              PLACE_MAP_OBSERVED_FREE;
            sum += shared ? 5 * 0.3 * 0.3 : 0;
        }
    return sum;
}

/* The joint likelihood of a place, in steps of two units. */
static cairn_pose_likelihood joint_of(struct mapper *m, int32_t place, const cairn_pose *poses,
                                      const int32_t *parts, int32_t part, int32_t *units)
{
    cairn_pose_likelihood found = {0, 0, 0, 0};
    int is_done = 0;

    *units = 0;
    while (!is_done) {
        cairn_budget budget = {2};

        is_done = cairn_place_map_joint_likelihood(m->map, place, poses[place], poses, parts, part,
                                                   &found, &budget);
        assert_true(budget.left >= 0);
        assert_true(is_done || budget.left == 0);
        *units += 2 - budget.left;
    }
    assert_int_equal(found.resume, 0);
    assert_int_equal(found.units_charged, 0);
    return found;
}

static void every_surface_counts_once(void **state)
{
    cairn_place_map_params params = small_params(4);
    const int32_t all[4] = {0, 0, 0, 0}, two[4] = {0, 0, -1, 1};
    cairn_pose poses[4];
    static struct arena arena;
    struct mapper m;
    double alone;
    int32_t units = 0;

    (void)state;
    make_arena(&arena, 1003, 3, 0, 0, 0.2);
    /* The fourth place duplicates the second. */
    for (int32_t k = 0, count = arena.scans.count; k < count; k++)
        if (arena.scans.place[k] == 1) {
            int32_t i = arena.scans.count++;

            arena.scans.input[i] = arena.scans.input[k];
            arena.scans.place[i] = 3;
            arena.scans.place_scan[i] = arena.scans.place_scan[k];
            arena.scans.truth[i] = arena.scans.truth[k];
        }
    make_mapper(&m, &params);
    load(&m, &arena.scans);
    (void)solve(&m);
    for (int32_t k = arena.scans.count - 1; k >= 0; k--)
        if (k == 0 || arena.scans.place[k] != arena.scans.place[k - 1])
            poses[arena.scans.place[k]] = arena.scans.truth[k];
    for (int32_t shift = 0; shift < 3; shift++) {
        for (int32_t i = 0; i < 4; i++) {
            cairn_pose_likelihood found = joint_of(&m, i, poses, all, 0, &units);

            assert_near(found.ratio, reference_among(m.map, i, poses, all), NUMBER(1e-6, 2));
            assert_true(found.against > 0);
            /* six lookups a unit: every point and free cell of the place in the grids of three */
            assert_true(units >=
                        3 * (m.map->places[i].point_count + m.map->places[i].free_count) / 6);
        }
        poses[0].x += CAIRN_REAL(0.13);
        poses[2].theta += CAIRN_REAL(0.2);
    }
    alone = (double)joint_of(&m, 0, poses, two, 0, &units).ratio;
    assert_near(alone, reference_among(m.map, 0, poses, two), NUMBER(1e-6, 2));
    poses[3] = poses[1];
    for (int32_t part = -1; part < 1; part++) {
        int32_t parts[4] = {0, 0, -1, part};

        assert_near(joint_of(&m, 0, poses, parts, 0, &units).ratio, alone, NUMBER(1e-6, 2));
    }
    assert_near(joint_of(&m, 0, poses, two, 2, &units).ratio, 0, 0);
    test_pool_free(&m.pool);
    free_arena(&arena);
}

/* ---- Golden results ---- */

static uint64_t hash_of_all(const struct mapper *m, const struct scans *scans)
{
    cairn_place_map_result r = cairn_place_map_read(m->map);
    int64_t counts[] = {r.places,  r.placed,     r.components, r.ambiguous,
                        r.matches, r.hypotheses, r.decoupled};
    cairn_real sums[] = {r.total, r.competing_total};
    uint64_t hash = test_hash(hash_of(m->map, scans->count), counts, sizeof counts);

    hash = test_hash(hash, sums, sizeof sums);
    for (int32_t i = 0; i < r.places; i++) {
        cairn_place_map_place place = cairn_place_map_place_of(m->map, i);

        hash = test_hash(hash, &place.map_place, sizeof place.map_place);
        hash = test_hash(hash, &place.support, sizeof place.support);
        hash = test_hash(hash, &place.component, 3 * sizeof place.component);
        for (int32_t k = 0; k < place.alternatives; k++) {
            cairn_pose_consensus_competing_pose other = cairn_place_map_alternative(m->map, i, k);

            hash = test_hash(hash, &other.map_node, sizeof other.map_node);
            hash = test_hash(hash, &other.weight, sizeof other.weight);
        }
    }
    return hash;
}

/* Four places of two scans each, the second scan displaced by some centimetres and a degree;
 * `in_other_room`: the last two places are in another room. A free-standing post is in the room. */
static uint64_t hash_of_rooms(cairn_place_map_params params, int32_t in_other_room)
{
    rooms_room rooms[2] = {{.count = 0}, {.count = 0}};
    static struct scans scans;
    struct mapper m;
    uint64_t hash;

    rooms_add_box(&rooms[0], -3, -2, 3, 2);
    rooms_add_box(&rooms[0], 1.8, 1, 3, 2);
    rooms_add_box(&rooms[0], -0.7, -1.1, -0.4, -0.8);
    rooms_add_box(&rooms[1], -4, -3, 4, 2);
    rooms_add_box(&rooms[1], 1.5, -1, 4, 2);
    scans.count = 0;
    for (int32_t i = 0; i < 8; i++) {
        int32_t place = i / 2;
        cairn_real k = (cairn_real)place;
        cairn_pose pose = {CAIRN_REAL(0.5) * k - 1, CAIRN_REAL(0.3) * k - CAIRN_REAL(0.4), 2 * k};
        cairn_pose step = {CAIRN_REAL(0.2), CAIRN_REAL(0.1), CAIRN_REAL(1.5)}, off = step;

        off.x += CAIRN_REAL(0.03);
        off.theta += CAIRN_REAL(0.015);
        add_room_scan(&scans, &rooms[in_other_room && i >= 4], i / 2,
                      i % 2 ? cairn_pose_compose(pose, step) : pose);
        scans.place_scan[i] = i % 2 ? off : cairn_pose_identity();
    }
    make_mapper(&m, &params);
    load(&m, &scans);
    (void)solve(&m);
    hash = hash_of_all(&m, &scans);
    test_pool_free(&m.pool);
    return hash;
}

static uint64_t hash_of_busy_arena(cairn_place_map_params params)
{
    static struct arena arena;
    struct mapper m;
    uint64_t hash;

    make_arena(&arena, 1007, 5, 0.02, 1, 0.2);
    make_mapper(&m, &params);
    load(&m, &arena.scans);
    (void)solve(&m);
    hash = hash_of_all(&m, &arena.scans);
    test_pool_free(&m.pool);
    free_arena(&arena);
    return hash;
}

static void results_stay_as_they_are(void **state)
{
    cairn_place_map_params params = small_params(4), sequential = params, decoupled = params;
    cairn_place_map_params one_by_one = small_params(5), jointly = one_by_one;

    (void)state;
    sequential.mode = CAIRN_PLACE_MAP_SEQUENTIAL;
    sequential.recent_places = 2;
    decoupled.decoupled = 1;
    decoupled.rematch_rounds = 1;
    decoupled.refinement_sweeps = 1;
    assert_golden(hash_of_rooms(params, 0), UINT64_C(0x8b46370a4858ad24),
                  UINT64_C(0x12952a362ebe4d21));
    assert_golden(hash_of_rooms(params, 1), UINT64_C(0x59a212f68d84f056),
                  UINT64_C(0x5b416bf6bd8b5401));
    assert_golden(hash_of_rooms(sequential, 0), UINT64_C(0x5fd47e4840096001),
                  UINT64_C(0xa3b8a145304838a8));
    jointly.decoupled = CAIRN_PLACE_MAP_JOINTLY;
    assert_golden(hash_of_busy_arena(one_by_one), UINT64_C(0xfffda666f155c671),
                  UINT64_C(0xe438f34502f32575));
    assert_golden(hash_of_busy_arena(jointly), UINT64_C(0x32efe4edc02a0f86),
                  UINT64_C(0xda4eedf52cf964ca));
    assert_golden(hash_of_rooms(decoupled, 0), UINT64_C(0x7fca74721f33f384),
                  UINT64_C(0xff9503e73219a7a7));
}

/* ---- Contracts ---- */

static void memory_is_exact(void **state)
{
    cairn_place_map_params params = cairn_place_map_default();

    (void)state;
    params.max_places = 2;
    params.max_scans = 2;
    params.max_place_points = 4;
    params.max_place_beams = 4;
    params.visibility_reach = CAIRN_REAL(0.5);
    params.match.max_hypotheses = 1;
    params.consensus.max_hypotheses = 2;
    test_every_pool_size(create, &params, cairn_place_map_memory(&params));
}

/* Capacities of the matching, the consensus and the alignment follow from those of the map. */
static void capacities_within_are_not_read(void **state)
{
    (void)state;
    for (int32_t jointly = 0; jointly < 2; jointly++) {
        cairn_place_map_params params = small_params(3), same;

        params.decoupled = jointly ? CAIRN_PLACE_MAP_JOINTLY : params.decoupled;
        same = params;
        same.match.max_target = same.match.max_dense = same.match.max_views = -1;
        same.match.max_query = same.consensus.max_nodes = -1;
        same.aligner.max_scans = same.aligner.max_points = -1;
        assert_true(cairn_place_map_memory(&params) > 0);
        assert_int_equal(cairn_place_map_memory(&same), cairn_place_map_memory(&params));
    }
}

#define REFUSED(field, value)                                                                      \
    do {                                                                                           \
        cairn_place_map_params bad = small_params(2);                                              \
        cairn_place_map *none = NULL;                                                              \
        bad.field = value;                                                                         \
        assert_int_equal(cairn_place_map_memory(&bad), 0);                                         \
        assert_status(cairn_place_map_create(&none, &pool, &bad), CAIRN_BAD_ARGUMENT);             \
        assert_null(none);                                                                         \
    } while (0)

#define TAKEN(field, value)                                                                        \
    do {                                                                                           \
        cairn_place_map_params good = small_params(2);                                             \
        good.field = value;                                                                        \
        assert_true(cairn_place_map_memory(&good) > 0);                                            \
    } while (0)

/* Rules between parameters; tests/test_object.c has the ranges. */
static void bad_params_are_refused(void **state)
{
    cairn_place_map_params params = small_params(2);
    cairn_pool pool = test_pool(cairn_place_map_memory(&params));
    cairn_place_map *map;

    (void)state;
    REFUSED(mode, CAIRN_PLACE_MAP_AS_WRITTEN); /* with a match that is not as written */
    REFUSED(max_scans, 1);
    REFUSED(max_place_points, (1 << 19) + 1);
    REFUSED(max_place_beams, (1 << 19) + 1);
    REFUSED(visibility_cell, CAIRN_REAL(0.001));
    REFUSED(visibility_margin, 2);
    REFUSED(match.max_hypotheses, 0);
    REFUSED(consensus.max_hypotheses, 0);
    TAKEN(recent_places, 1);
    TAKEN(surface_nats, CAIRN_REAL(1e6));
    TAKEN(rematch_rounds, 0);
    TAKEN(refinement_sweeps, 0);
    TAKEN(dynamic_factor, 0);
    TAKEN(dynamic_factor, 1);
    TAKEN(free_area_nats, 0);
    TAKEN(chance_nats, 0);
    TAKEN(max_places, 8);
    TAKEN(max_scans, 2);
    TAKEN(max_place_points, 1);
    TAKEN(max_place_beams, 1);
    assert_int_equal(cairn_place_map_memory(NULL), 0);
    assert_status(cairn_place_map_create(NULL, &pool, &params), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_place_map_create(&map, NULL, &params), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.used, 0);
    test_pool_free(&pool);
}

static void bad_scans_are_refused(void **state)
{
    const cairn_real nan = (cairn_real)NAN;
    cairn_place_map_params params = small_params(2);
    rooms_room room = {.count = 0};
    static struct scans scans;
    struct mapper m;
    cairn_scan_view view, large;
    cairn_pose pose = {0, 0, 0}, bad = pose;
    cairn_fault fault = {7, NULL};

    (void)state;
    params.max_scans = 3;
    params.max_place_beams = 2 * ROOMS_BEAMS;
    make_mapper(&m, &params);
    rooms_add_box(&room, -3, -2, 3, 2);
    scans.count = 0;
    add_room_scan(&scans, &room, 0, pose);
    view = view_of(m.scan, &scans.input[0]);
    assert_status(cairn_place_map_begin(NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_place_map_step(NULL, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_place_map_step(m.map, NULL), CAIRN_BAD_ARGUMENT);
    assert_fault(&fault, cairn_place_map_add_scan(NULL, 0, &view, pose, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_non_null(fault.message);
    assert_int_equal(fault.index, -1);
    assert_status(cairn_place_map_add_scan(m.map, 0, NULL, pose, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_place_map_add_scan(m.map, 1, &view, pose, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_place_map_add_scan(m.map, -1, &view, pose, NULL), CAIRN_BAD_ARGUMENT);
    bad.theta = nan;
    assert_fault(&fault, cairn_place_map_add_scan(m.map, 0, &view, bad, &fault), CAIRN_NOT_FINITE,
                 -1);
    bad.theta = 0;
    bad.x = 2 * CAIRN_SCAN_EXTENT;
    assert_status(cairn_place_map_add_scan(m.map, 0, &view, bad, NULL), CAIRN_BAD_ARGUMENT);
    bad.x = 0;
    bad.y = -2 * CAIRN_SCAN_EXTENT;
    assert_status(cairn_place_map_add_scan(m.map, 0, &view, bad, NULL), CAIRN_BAD_ARGUMENT);
    large = view;
    large.point_count = params.max_place_points + 1;
    assert_status(cairn_place_map_add_scan(m.map, 0, &large, pose, NULL), CAIRN_FULL);
    large = view;
    large.beam_count = params.max_place_beams + 1;
    assert_status(cairn_place_map_add_scan(m.map, 0, &large, pose, NULL), CAIRN_FULL);
    /* nothing of these was stored */
    assert_status(cairn_place_map_begin(m.map), CAIRN_EMPTY);
    assert_ok(cairn_place_map_add_scan(m.map, 0, &view, pose, NULL));
    assert_ok(cairn_place_map_add_scan(m.map, 0, &view, pose, NULL));
    /* of one place */
    assert_status(cairn_place_map_add_scan(m.map, 0, &view, pose, NULL), CAIRN_FULL);
    assert_ok(cairn_place_map_add_scan(m.map, 1, &view, pose, NULL));
    /* came too late */
    assert_status(cairn_place_map_add_scan(m.map, 0, &view, pose, NULL), CAIRN_BAD_ARGUMENT);
    /* scans */
    assert_status(cairn_place_map_add_scan(m.map, 1, &view, pose, NULL), CAIRN_FULL);
    /* places */
    assert_status(cairn_place_map_add_scan(m.map, 2, &view, pose, NULL), CAIRN_FULL);
    (void)solve(&m);
    assert_int_equal(cairn_place_map_read(m.map).places, 2);
    cairn_place_map_clear(m.map);
    assert_int_equal(cairn_place_map_read(m.map).places, 0);
    assert_ok(cairn_place_map_add_scan(m.map, 0, &view, pose, NULL));
    test_pool_free(&m.pool);
}

/* ---- Grouping ---- */

static void scans_close_together_are_a_place(void **state)
{
    const cairn_pose pose[] = {{1, 1, 0.5}, {1.25, 1, 1.5}, {4, 1, 0}, {4, 1.5, 0}, {1, 1, 0}};
    const int32_t expected[] = {0, 0, 1, 1, 2};
    cairn_place_map_grouping grouping = {0}, kept = {.keep_heading = 1};

    (void)state;
    for (int32_t i = 0; i < 5; i++) {
        cairn_pose own, turned;

        assert_int_equal(cairn_place_map_group(&grouping, pose[i], &own), expected[i]);
        assert_int_equal(cairn_place_map_group(&kept, pose[i], &turned), expected[i]);
        /* the frame of a place is the pose of its first scan, or has only its position */
        assert_near(turned.theta, pose[i].theta, 1e-6);
        assert_near(hypot((double)turned.x, (double)turned.y), hypot((double)own.x, (double)own.y),
                    1e-6);
        if (i == 1) {
            assert_near(own.theta, 1, 1e-6);
            assert_near(turned.x, 0.25, 1e-6);
            assert_near(turned.y, 0, 1e-6);
        }
    }
    assert_int_equal(grouping.scans, 5);
    assert_int_equal(grouping.places, 3);
    assert_int_equal(grouping.first, 4);
}

static void a_scan_beyond_the_radius_begins_a_place(void **state)
{
    cairn_place_map_grouping grouping = {0};
    cairn_pose own;

    (void)state;
    assert_int_equal(cairn_place_map_group(&grouping, (cairn_pose){1, 0, 0}, &own), 0);
    assert_int_equal(cairn_place_map_group(&grouping, (cairn_pose){1.5, 0, 0}, &own), 0);
    assert_int_equal(cairn_place_map_group(&grouping, (cairn_pose){1.75, 0, 0}, &own), 1);
    assert_near(own.x, 0, 0);
    /* what is not finite is no place of others, and no other scan is of its place */
    assert_int_equal(
        cairn_place_map_group(&grouping, (cairn_pose){(cairn_real)INFINITY, 0, 0}, &own), 2);
    assert_false(cairn_pose_is_finite(own));
    assert_int_equal(cairn_place_map_group(&grouping, (cairn_pose){1, 0, 0}, &own), 3);
}

static void scans_at_even_headings_are_a_place_whatever_their_poses(void **state)
{
    cairn_place_map_grouping grouping = {.headings = 4};
    cairn_pose own = {0, 0, 0};

    (void)state;
    for (int32_t i = 0; i < 12; i++)
        assert_int_equal(
            cairn_place_map_group(&grouping, (cairn_pose){(cairn_real)(10 * i), 0, 0}, &own),
            i / 4);
    assert_near(own.theta, -CAIRN_PI / 2, 1e-6);
    assert_near(own.x, 0, 0);
}

/* The fault says the public modes; the variant is accepted, with its other fields checked. */
static void test_modes_are_the_public_ones_and_the_variant(void **state)
{
    cairn_place_map_params params = cairn_place_map_default();
    cairn_object_fault fault = {.field = NULL};

    (void)state;
    assert_ok(cairn_place_map_check(&params, NULL));
    params.mode = CAIRN_PLACE_MAP_SEQUENTIAL;
    assert_ok(cairn_place_map_check(&params, NULL));
    for (params.mode = -2; params.mode <= CAIRN_PLACE_MAP_SEQUENTIAL + 2; params.mode++) {
        if (params.mode == CAIRN_PLACE_MAP_CONSENSUS || params.mode == CAIRN_PLACE_MAP_AS_WRITTEN ||
            params.mode == CAIRN_PLACE_MAP_SEQUENTIAL)
            continue;
        assert_status(cairn_place_map_check(&params, &fault), CAIRN_BAD_ARGUMENT);
        assert_string_equal(fault.field, "mode");
        assert_true(fault.lowest == CAIRN_PLACE_MAP_CONSENSUS &&
                    fault.highest == CAIRN_PLACE_MAP_AS_WRITTEN);
    }
    params.mode = CAIRN_PLACE_MAP_SEQUENTIAL;
    params.max_places = 1;
    assert_status(cairn_place_map_check(&params, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.field, "max_places");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scans_close_together_are_a_place),
        cmocka_unit_test(a_scan_beyond_the_radius_begins_a_place),
        cmocka_unit_test(scans_at_even_headings_are_a_place_whatever_their_poses),
        cmocka_unit_test(every_surface_counts_once),
        cmocka_unit_test(results_stay_as_they_are),
        cmocka_unit_test(places_of_an_arena),
        cmocka_unit_test(places_of_another_arena_are_reported),
        cmocka_unit_test(the_order_of_budgets_and_stamps_do_not_matter),
        cmocka_unit_test(a_step_scores_what_it_has_charged),
        cmocka_unit_test(scans_aligned_by_themselves),
        cmocka_unit_test(parts_are_aligned_apart),
        cmocka_unit_test(an_aligner_that_is_full_refuses),
        cmocka_unit_test(half_a_turn_of_a_rectangle_is_ambiguous),
        cmocka_unit_test(different_rooms_are_components),
        cmocka_unit_test(one_after_the_other),
        cmocka_unit_test(the_error_probability_follows_the_supports),
        cmocka_unit_test(one_place),
        cmocka_unit_test(memory_is_exact),
        cmocka_unit_test(capacities_within_are_not_read),
        cmocka_unit_test(bad_params_are_refused),
        cmocka_unit_test(test_modes_are_the_public_ones_and_the_variant),
        cmocka_unit_test(bad_scans_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
