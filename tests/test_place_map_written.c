/* place_map as written: the map of chapter 6 in its own setting, headings known. */
#include "tests/place_mapping.h"

#include <math.h>

#include "tests/rooms.h"

enum { PLACES = 4, HEADINGS = 4 };

static const double DEGREE = 0.017453292519943295;

/* A map, its scan reader, and the places of a cluttered room, whose frames have equal headings up
 * to 2 degrees. */
typedef struct bed {
    cairn_pool pool;
    cairn_scan *scan;
    cairn_place_map *map;
    cairn_pose frame[PLACES], truth[PLACES][HEADINGS];
    int32_t scans;
} bed;

static cairn_place_map_params small_params(void)
{
    cairn_place_map_params params = cairn_place_map_as_written();

    params.max_places = PLACES;
    params.max_scans = PLACES * HEADINGS;
    params.max_place_points = 440;
    return params;
}

static rooms_room cluttered(void)
{
    rooms_room room = {.count = 0};

    rooms_add_box(&room, -3, -2, 3, 2);
    rooms_add_box(&room, 1.8, 1, 3, 2);
    rooms_add_box(&room, -0.5, -2, 0.2, -1.2);
    rooms_add_wall(&room, -3, 0.8, -2.1, 1.3);
    rooms_add_wall(&room, 2, -2, 2.5, -1);
    return room;
}

static void make_bed(bed *b, const cairn_place_map_params *params)
{
    cairn_scan_params scan = cairn_scan_default();

    memset(b, 0, sizeof *b);
    b->pool = test_pool(cairn_scan_memory(&scan) + cairn_place_map_memory(params));
    assert_ok(cairn_scan_create(&b->scan, &b->pool, &scan));
    assert_ok(cairn_place_map_create(&b->map, &b->pool, params));
}

/* Adds a scan of 100 degrees of a place, or with `blind` one without returns. */
static cairn_status add(bed *b, int32_t place, int32_t heading, cairn_pose place_scan,
                        int32_t blind)
{
    static const cairn_pose step = {CAIRN_REAL(0.25), CAIRN_REAL(0.06), 0};
    rooms_room room = cluttered();
    rooms_scan taken;
    cairn_scan_input input;
    cairn_scan_view view;

    b->frame[place].x = step.x * (cairn_real)place - CAIRN_REAL(0.5);
    b->frame[place].y = step.y * (cairn_real)place;
    b->frame[place].theta = place == 0 ? 0 : (cairn_real)((place % 2 ? 1.4 : -1.7) * DEGREE);
    b->truth[place][heading] = cairn_pose_compose(b->frame[place], place_scan);
    input =
        rooms_take_scan(&room, b->truth[place][heading], (uint64_t)(10 * place + heading), &taken);
    for (int i = 0; i < ROOMS_BEAMS; i++) /* beams are a degree apart and begin behind the robot */
        if (blind || abs(i - ROOMS_BEAMS / 2) > 50)
            taken.range[i] = 0;
    view = view_of(b->scan, &input);
    return cairn_place_map_add_scan(b->map, place, &view, place_scan, NULL);
}

static void load(bed *b, int32_t blind_place)
{
    cairn_place_map_clear(b->map);
    b->scans = 0;
    for (int32_t place = 0; place < PLACES; place++)
        for (int32_t k = 0; k < HEADINGS; k++, b->scans++) {
            cairn_pose place_scan = {CAIRN_REAL(0.02) * (cairn_real)k, 0,
                                     (cairn_real)(90 * k * DEGREE)};

            assert_ok(add(b, place, k, place_scan, place == blind_place));
        }
}

static cairn_place_map_result solve(bed *b, int32_t each, int64_t *used)
{
    cairn_status status = CAIRN_MORE;

    *used = 0;
    assert_ok(cairn_place_map_begin(b->map));
    while (status == CAIRN_MORE) {
        cairn_budget budget = {each};

        status = cairn_place_map_step(b->map, &budget);
        assert_true(budget.left >= 0);
        *used += each - budget.left;
    }
    assert_ok(status);
    return cairn_place_map_read(b->map);
}

static double metres_off(const bed *b, int32_t place)
{
    cairn_pose pose = cairn_place_map_place_of(b->map, place).map_place;
    cairn_pose seen = cairn_pose_between(b->frame[0], b->frame[place]);

    return hypot((double)(pose.x - seen.x), (double)(pose.y - seen.y));
}

/* Steps of a quarter of a metre: matched in order, each scan aligned by itself at once. */
static void places_in_order(void **state)
{
    cairn_place_map_params params = small_params();
    cairn_place_map_result result;
    int64_t used;
    bed b;

    (void)state;
    make_bed(&b, &params);
    load(&b, -1);
    result = solve(&b, CAIRN_UNBOUNDED, &used);
    assert_int_equal(result.places, PLACES);
    assert_int_equal(result.placed, PLACES);
    assert_int_equal(result.components, 1);
    assert_int_equal(result.matches, PLACES - 1);
    assert_int_equal(result.decoupled, (PLACES - 1) * HEADINGS);
    assert_int_equal(result.ambiguous, 0);
    assert_int_equal(result.units, used);
    for (int32_t i = 0; i < PLACES; i++) {
        assert_true(metres_off(&b, i) < 0.25);
        assert_int_equal(cairn_place_map_place_of(b.map, i).alternatives, 0);
    }
    test_pool_free(&b.pool);
}

/* Without decoupling scans keep their poses in the place, and the estimate by shape alone
 * differs. */
static void stages(void **state)
{
    cairn_place_map_params params = small_params();
    cairn_pose last[2];
    int64_t used;
    bed b;

    (void)state;
    params.decoupled = CAIRN_PLACE_MAP_COUPLED;
    for (int k = 0; k < 2; k++) {
        params.match.mode =
            k == 0 ? CAIRN_SCAN_MATCH_AS_WRITTEN : CAIRN_SCAN_MATCH_AS_WRITTEN_SEGMENTS;
        make_bed(&b, &params);
        load(&b, -1);
        assert_int_equal(solve(&b, CAIRN_UNBOUNDED, &used).decoupled, 0);
        for (int32_t s = 0; s < b.scans; s++) {
            int32_t place = s / HEADINGS;
            cairn_pose place_scan =
                cairn_pose_between(b.frame[place], b.truth[place][s % HEADINGS]);
            cairn_pose expected =
                cairn_pose_compose(cairn_place_map_place_of(b.map, place).map_place, place_scan);
            cairn_pose pose = cairn_place_map_scan_pose(b.map, s);

            assert_near(pose.x, expected.x, NUMBER(1e-9, 1e-4));
            assert_near(pose.y, expected.y, NUMBER(1e-9, 1e-4));
            assert_near(cairn_wrap_angle(pose.theta - expected.theta), 0, NUMBER(1e-9, 1e-4));
        }
        last[k] = cairn_place_map_place_of(b.map, PLACES - 1).map_place;
        test_pool_free(&b.pool);
    }
    assert_true(last[0].x != last[1].x);
}

/* A place without points is a component of its own, and the next ones are matched with those before
 * it. */
static void a_blind_place(void **state)
{
    cairn_place_map_params params = small_params();
    cairn_place_map_result result;
    int64_t used;
    bed b;

    (void)state;
    params.recent_places = 1;
    make_bed(&b, &params);
    load(&b, 1);
    result = solve(&b, CAIRN_UNBOUNDED, &used);
    assert_int_equal(result.placed, PLACES - 1);
    assert_int_equal(result.components, 2);
    assert_int_equal(result.decoupled, (PLACES - 2) * HEADINGS);
    assert_int_equal(cairn_place_map_place_of(b.map, 1).component, 1);
    assert_near(cairn_place_map_place_of(b.map, 1).map_place.x, 0, 0);
    assert_true(metres_off(&b, 2) < 0.3 && metres_off(&b, 3) < 0.3);
    load(&b, 0); /* the first place defines the map, whatever it saw */
    result = solve(&b, CAIRN_UNBOUNDED, &used);
    assert_int_equal(result.placed, 1);
    assert_int_equal(result.components, PLACES);
    test_pool_free(&b.pool);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t each[] = {7, 1000, CAIRN_UNBOUNDED};
    cairn_place_map_params params = small_params();
    int64_t units = 0, used;
    uint64_t hash = 0;
    bed b;

    (void)state;
    make_bed(&b, &params);
    for (int k = 0; k < 3; k++) {
        load(&b, -1);
        (void)solve(&b, each[k], &used);
        assert_true(k == 0 || (hash_of(b.map, b.scans) == hash && used == units));
        hash = hash_of(b.map, b.scans);
        units = used;
    }
    test_pool_free(&b.pool);
}

static void few_places_and_far_ones(void **state)
{
    cairn_place_map_params params = small_params();
    cairn_pose far_off = {CAIRN_REAL(9e4), 0, 0}, nowhere = {(cairn_real)NAN, 0, 0};
    int64_t used;
    bed b;

    (void)state;
    make_bed(&b, &params);
    assert_status(cairn_place_map_begin(b.map), CAIRN_EMPTY);
    assert_ok(add(&b, 0, 0, cairn_pose_identity(), 0));
    assert_int_equal(solve(&b, CAIRN_UNBOUNDED, &used).placed, 1);
    assert_status(add(&b, 0, 1, nowhere, 0), CAIRN_NOT_FINITE);
    assert_status(add(&b, 2, 0, cairn_pose_identity(), 0), CAIRN_BAD_ARGUMENT);
    assert_ok(add(&b, 1, 0, far_off, 0));
    assert_int_equal(solve(&b, CAIRN_UNBOUNDED, &used).places, 2);
    for (int k = 1; k < HEADINGS; k++)
        assert_ok(add(&b, 1, k, cairn_pose_identity(), 0));
    /* 440 readings are four scans of 101 */
    assert_status(add(&b, 1, 0, cairn_pose_identity(), 0), CAIRN_FULL);
    test_pool_free(&b.pool);
}

static void add_place(bed *b, int32_t place)
{
    for (int32_t k = 0; k < HEADINGS; k++, b->scans++) {
        cairn_pose place_scan = {CAIRN_REAL(0.02) * (cairn_real)k, 0,
                                 (cairn_real)(90 * k * DEGREE)};

        assert_ok(add(b, place, k, place_scan, 0));
    }
}

static void extend(bed *b, int32_t each)
{
    cairn_status status = CAIRN_MORE;

    assert_ok(cairn_place_map_extend(b->map));
    while (status == CAIRN_MORE) {
        cairn_budget budget = {each};

        status = cairn_place_map_step(b->map, &budget);
    }
    assert_ok(status);
}

/* Place after place gives the same as all at once; what another aligner has moved stays, and the
 * next place follows. */
static void places_one_by_one(void **state)
{
    cairn_place_map_params params = small_params();
    cairn_pose at_once, pose;
    int64_t used;
    uint64_t hash;
    bed b;

    (void)state;
    make_bed(&b, &params);
    assert_status(cairn_place_map_extend(b.map), CAIRN_EMPTY);
    load(&b, -1);
    (void)solve(&b, CAIRN_UNBOUNDED, &used);
    hash = hash_of(b.map, b.scans);
    at_once = cairn_place_map_scan_pose(b.map, HEADINGS * (PLACES - 1));
    for (int k = 0; k < 2; k++) {
        cairn_place_map_clear(b.map);
        b.scans = 0;
        for (int32_t place = 0; place < PLACES; place++) {
            add_place(&b, place);
            assert_status(cairn_place_map_move_scan(b.map, b.scans - 1, at_once),
                          CAIRN_BAD_ARGUMENT);
            extend(&b, place % 2 ? 7 : CAIRN_UNBOUNDED);
            assert_int_equal(cairn_place_map_read(b.map).placed, place + 1);
            if (k == 0 || place != PLACES - 2)
                continue;
            for (int32_t s = 0; s < b.scans; s++) { /* 2 m to the right */
                pose = cairn_place_map_scan_pose(b.map, s);
                pose.x += 2;
                assert_ok(cairn_place_map_move_scan(b.map, s, pose));
                assert_near(cairn_place_map_scan_pose(b.map, s).x, pose.x, 0);
            }
        }
        assert_int_equal(cairn_place_map_read(b.map).decoupled, (PLACES - 1) * HEADINGS);
        if (k == 0)
            assert_true(hash_of(b.map, b.scans) == hash);
    }
    pose = cairn_place_map_scan_pose(b.map, HEADINGS * (PLACES - 1));
    assert_near(pose.x, at_once.x + 2, 0.3);
    assert_near(pose.y, at_once.y, 0.3);
    pose.y = (cairn_real)NAN;
    assert_status(cairn_place_map_move_scan(b.map, 0, pose), CAIRN_NOT_FINITE);
    pose.y = CAIRN_REAL(1e9);
    assert_status(cairn_place_map_move_scan(b.map, 0, pose), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_place_map_move_scan(b.map, -1, at_once), CAIRN_BAD_ARGUMENT);
    test_pool_free(&b.pool);
    params = cairn_place_map_default();
    params.max_places = params.max_scans = 2;
    params.consensus.max_hypotheses = 64;
    make_bed(&b, &params);
    assert_status(cairn_place_map_extend(b.map), CAIRN_UNSUPPORTED);
    assert_status(cairn_place_map_move_scan(b.map, 0, at_once), CAIRN_UNSUPPORTED);
    test_pool_free(&b.pool);
}

static void memory_is_as_stated(void **state)
{
    cairn_place_map_params params = small_params(), large = params, same;
    cairn_place_map_params bad[5];
    cairn_scan_match_params match;

    (void)state;
    params.max_place_points = 5;
    params.max_places = 3;
    test_every_pool_size(create, &params, cairn_place_map_memory(&params));
    /* A place is matched with all recent ones, however large they are. */
    large.max_places = 3;
    large.max_place_points = 1 << 15;
    match = large.match;
    match.max_query = large.max_place_points;
    match.max_target = 2 * large.max_place_points;
    match.max_dense = match.max_views = 0;
    assert_true(cairn_place_map_memory(&large) > cairn_scan_match_memory(&match));
    same = large;
    same.match.max_target = same.match.max_dense = same.match.max_views = -1;
    same.match.max_query = same.consensus.max_nodes = -1;
    assert_int_equal(cairn_place_map_memory(&same), cairn_place_map_memory(&large));
    for (int k = 0; k < 5; k++)
        bad[k] = params;
    bad[0].decoupled = CAIRN_PLACE_MAP_JOINTLY;
    bad[1].match = cairn_scan_match_default();
    bad[2].match.mode = CAIRN_SCAN_MATCH_AS_WRITTEN_SEGMENTS; /* without ICP for the decoupling */
    bad[3].match.mode = CAIRN_SCAN_MATCH_SHAPE;
    bad[4].mode = CAIRN_MODE_AS_WRITTEN + 2;
    for (int k = 0; k < 5; k++)
        assert_int_equal(cairn_place_map_memory(&bad[k]), 0);
    assert_int_equal(params.mode, CAIRN_MODE_AS_WRITTEN);
    assert_int_equal(params.recent_places, 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(places_in_order),         cmocka_unit_test(stages),
        cmocka_unit_test(a_blind_place),           cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(few_places_and_far_ones), cmocka_unit_test(places_one_by_one),
        cmocka_unit_test(memory_is_as_stated),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
