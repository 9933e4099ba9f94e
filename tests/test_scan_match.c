/* Matching of two scans: rooms with known poses, ambiguity, covariances, budgets, memory,
 * refusals. */
#include "tests/poses.h"

#include <math.h>

#include "cairn/scan_match.h"
#include "cairn/small_matrix.h"
#include "src/scans/scan_match_variants.h"

enum { MAX_POINTS = 1500, MAX_BEAMS = 720 };

/* An L-shaped room, counter-clockwise, so that the inside is on the left. */
static const cairn_vec2 L_ROOM[] = {{-3, -2}, {4, -2}, {4, 1}, {1, 1}, {1, 4}, {-3, 4}};
static const cairn_vec2 SQUARE[] = {{-2, -2}, {2, -2}, {2, 2}, {-2, 2}};
static const cairn_vec2 OBLONG[] = {{-3, -2}, {3, -2}, {3, 2}, {-3, 2}};
static const cairn_vec2 CORRIDOR[] = {{-30, -1}, {30, -1}, {30, 1}, {-30, 1}};
static const cairn_vec2 TRIANGLE[] = {{-2.5, -1.5}, {3, -1}, {0.5, 3}};

/* A room and the ranges of a rotating scanner in it from one pose. */
struct seen {
    cairn_oriented_point points[MAX_POINTS];
    cairn_oriented_point dense[MAX_POINTS];
    cairn_scan_beam beams[MAX_BEAMS];
    cairn_scan_match_part part;
};

/* Distance along the ray to the wall, or `most`. */
static cairn_real cast(const cairn_vec2 *corners, int32_t count, cairn_vec2 from,
                       cairn_vec2 direction, cairn_real most)
{
    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 a = corners[i], along = cairn_vec2_sub(corners[(i + 1) % count], a);
        cairn_real across = cairn_vec2_cross(direction, along), t, s;

        if (cairn_abs(across) < CAIRN_REAL(1e-9))
            continue;
        t = cairn_vec2_cross(cairn_vec2_sub(a, from), along) / across;
        s = cairn_vec2_cross(cairn_vec2_sub(a, from), direction) / across;
        if (t > 0 && t < most && s >= 0 && s <= 1)
            most = t;
    }
    return most;
}

/* All points of walls every 0.1 m that are visible within 12 m, beams around the circle, their
 * dense points. */
static void take_scan(struct seen *seen, const cairn_vec2 *corners, int32_t count, cairn_pose pose,
                      cairn_real noise, cairn_random *random)
{
    cairn_transform to_sensor = cairn_transform_of(cairn_pose_inverse(pose));
    cairn_vec2 from = {pose.x, pose.y};
    cairn_scan_view view;

    memset(&seen->part, 0, sizeof seen->part);
    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 a = corners[i], along = cairn_vec2_sub(corners[(i + 1) % count], a),
                   unit = cairn_vec2_unit(along);

        for (cairn_real s = CAIRN_REAL(0.05); s < cairn_vec2_norm(along); s += CAIRN_REAL(0.1)) {
            cairn_vec2 p = cairn_vec2_add(a, cairn_vec2_scale(unit, s)),
                       ray = cairn_vec2_sub(p, from);
            cairn_real range = cairn_vec2_norm(ray);

            if (range > 12 ||
                cast(corners, count, from, cairn_vec2_unit(ray), 20) < range - CAIRN_REAL(0.01))
                continue;
            assert_true(seen->part.count < MAX_POINTS);
            seen->points[seen->part.count].position = cairn_transform_point(to_sensor, p);
            seen->points[seen->part.count++].direction = cairn_transform_direction(to_sensor, unit);
        }
    }
    for (int32_t i = 0; i < MAX_BEAMS; i++) {
        cairn_real angle = (cairn_real)i * 2 * CAIRN_PI / MAX_BEAMS, range;
        cairn_vec2 body = {cairn_cos(angle), cairn_sin(angle)}, origin = {0, 0};
        cairn_vec2 world = cairn_transform_direction(cairn_transform_of(pose), body);

        range = cast(corners, count, from, world, 12);
        seen->beams[i].from = origin;
        seen->beams[i].kind = range < 12 ? CAIRN_SCAN_BEAM_HIT : CAIRN_SCAN_BEAM_FREE;
        if (noise > 0 && range < 12)
            range += noise * cairn_random_normal(random);
        seen->beams[i].to = cairn_vec2_scale(body, range);
    }
    memset(&view, 0, sizeof view);
    view.beams = seen->part.beams = seen->beams;
    view.beam_count = seen->part.beam_count = MAX_BEAMS;
    seen->part.points = seen->points;
    seen->part.dense = seen->dense;
    seen->part.dense_count = cairn_scan_match_dense(&view, seen->dense);
}

static cairn_scan_match *make_match(cairn_pool *pool, cairn_scan_match_params params)
{
    cairn_scan_match *match;

    *pool = test_pool(cairn_scan_match_memory(&params));
    assert_ok(cairn_scan_match_create(&match, pool, &params));
    return match;
}

static cairn_scan_match_result run(cairn_scan_match *match, const cairn_scan_match_part *query,
                                   cairn_pose start, const cairn_scan_match_window *window)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_scan_match_result result;

    assert_ok(cairn_scan_match_begin(match, query, start, window, NULL));
    assert_ok(cairn_scan_match_step(match, &budget));
    result = cairn_scan_match_read(match);
    assert_true(result.verdict != CAIRN_SCAN_MATCH_RUNNING);
    assert_int_equal(cairn_scan_match_measured(match).units, CAIRN_UNBOUNDED - budget.left);
    for (int32_t i = 0; i < result.count; i++) {
        const cairn_scan_match_hypothesis *h = &result.hypotheses[i];

        assert_true(cairn_pose_is_finite(h->target_query));
        assert_true(h->score >= 0 && h->score <= 1 && h->overlap >= 0 && h->overlap <= 1);
        assert_true(h->free_space_violation >= 0 && h->free_space_violation <= 1);
        assert_true(i == 0 || h->score <= h[-1].score);
        for (int k = 0; k < 9; k++) {
            assert_true(cairn_is_finite(h->covariance[k]));
            assert_near(h->covariance[k], h->covariance[k % 3 * 3 + k / 3],
                        1e-9 + 1e-5 * sqrt((double)(h->covariance[4 * (k / 3)] *
                                                    h->covariance[4 * (k % 3)])));
        }
    }
    return result;
}

static struct seen first, second;

static cairn_pose draw(cairn_random *random, cairn_real distance, cairn_real angle)
{
    cairn_pose pose;

    pose.x = cairn_random_uniform(random, -distance, distance);
    pose.y = cairn_random_uniform(random, -distance, distance);
    pose.theta = cairn_random_uniform(random, -angle, angle);
    return pose;
}

/* Matches the views of a room from two places. */
static cairn_scan_match_result match_room(cairn_scan_match *match, const cairn_vec2 *corners,
                                          int32_t count, cairn_pose a, cairn_pose b,
                                          const cairn_pose *start,
                                          const cairn_scan_match_window *window,
                                          cairn_random *random)
{
    take_scan(&first, corners, count, a, CAIRN_REAL(0.01), random);
    take_scan(&second, corners, count, b, CAIRN_REAL(0.01), random);
    cairn_scan_match_clear_target(match);
    assert_ok(cairn_scan_match_add_target(match, &first.part, cairn_pose_identity(), NULL));
    return run(match, &second.part, start != NULL ? *start : cairn_pose_identity(), window);
}

static void finds_from_a_guess_and_from_none(void **state)
{
    cairn_random random = cairn_random_seed(1, 1);
    cairn_pool pool;
    cairn_scan_match *match = make_match(&pool, cairn_scan_match_default());

    (void)state;
    for (int trial = 0; trial < 12; trial++) {
        cairn_pose a = draw(&random, CAIRN_REAL(0.8), CAIRN_PI),
                   b = draw(&random, CAIRN_REAL(0.8), CAIRN_PI);
        cairn_pose truth = cairn_pose_between(a, b),
                   off = draw(&random, CAIRN_REAL(0.3), CAIRN_REAL(0.35)), start;
        cairn_scan_match_window window = {CAIRN_REAL(0.3), CAIRN_REAL(0.35)};
        cairn_scan_match_result result;

        start.x = truth.x + off.x;
        start.y = truth.y + off.y;
        start.theta = cairn_wrap_angle(truth.theta + off.theta);
        result = match_room(match, L_ROOM, 6, a, b, trial % 2 ? &start : NULL,
                            trial % 2 ? &window : NULL, &random);
        assert_int_equal(result.verdict, CAIRN_SCAN_MATCH_FOUND);
        assert_pose_near(result.hypotheses[0].target_query, truth, 0.01, 0.004);
        assert_true(result.hypotheses[0].overlap > CAIRN_REAL(0.9));
        assert_true(result.hypotheses[0].free_space_violation < CAIRN_REAL(0.02));
        assert_int_equal(result.hypotheses[0].observable_dof, 3);
    }
    test_pool_free(&pool);
}

/* 1 when one of the hypotheses is the pose. */
static int is_listed(const cairn_scan_match_result *result, cairn_pose pose)
{
    for (int32_t i = 0; i < result->count; i++) {
        cairn_pose h = result->hypotheses[i].target_query;

        if (cairn_abs(h.x - pose.x) < CAIRN_REAL(0.05) &&
            cairn_abs(h.y - pose.y) < CAIRN_REAL(0.05) &&
            cairn_abs(cairn_wrap_angle(h.theta - pose.theta)) < CAIRN_REAL(0.02))
            return 1;
    }
    return 0;
}

static void lists_all_that_look_alike(void **state)
{
    cairn_random random = cairn_random_seed(2, 1);
    cairn_pool pool;
    cairn_scan_match *match = make_match(&pool, cairn_scan_match_default());
    cairn_pose a = {CAIRN_REAL(0.3), CAIRN_REAL(-0.2), 1},
               b = {CAIRN_REAL(-0.4), CAIRN_REAL(0.5), 2};

    (void)state;
    for (int turns = 2; turns <= 4; turns += 2) {
        cairn_scan_match_result result =
            match_room(match, turns == 2 ? OBLONG : SQUARE, 4, a, b, NULL, NULL, &random);

        assert_int_equal(result.verdict, CAIRN_SCAN_MATCH_AMBIGUOUS);
        assert_true(result.count >= turns);
        for (int k = 0; k < turns; k++) {
            cairn_pose turn = {0, 0, 2 * CAIRN_PI / (cairn_real)turns * (cairn_real)k};

            assert_true(is_listed(&result, cairn_pose_between(a, cairn_pose_compose(turn, b))));
        }
    }
    test_pool_free(&pool);
}

/* Keeps what lies within half a field of view of the heading: of the points and of the beams. */
static void narrow(struct seen *seen, cairn_real half)
{
    cairn_real least = cairn_cos(half);
    int32_t points = 0, beams = 0;

    for (int32_t i = 0; i < seen->part.count; i++)
        if (cairn_vec2_unit(seen->points[i].position).x > least)
            seen->points[points++] = seen->points[i];
    for (int32_t i = 0; i < seen->part.beam_count; i++)
        if (cairn_vec2_unit(seen->beams[i].to).x > least)
            seen->beams[beams++] = seen->beams[i];
    seen->part.count = points;
    seen->part.beam_count = beams;
    seen->part.dense_count = 0;
}

/* One corner fits all four of a room. */
static void a_corner_alone_is_ambiguous(void **state)
{
    cairn_random random = cairn_random_seed(20, 1);
    cairn_pool pool;
    cairn_scan_match *match = make_match(&pool, cairn_scan_match_default());

    (void)state;
    take_scan(&first, SQUARE, 4, cairn_pose_identity(), CAIRN_REAL(0.01), &random);
    assert_ok(cairn_scan_match_add_target(match, &first.part, cairn_pose_identity(), NULL));
    for (int k = 0; k < 4; k++) {
        cairn_pose corner = {0, 0, CAIRN_PI / 4 + CAIRN_PI / 2 * (cairn_real)k}, b;
        cairn_scan_match_result result;

        corner = cairn_pose_compose(corner, (cairn_pose){CAIRN_REAL(-0.3), 0, 0});
        b = corner;
        b.theta += CAIRN_REAL(0.1);
        take_scan(&second, SQUARE, 4, b, CAIRN_REAL(0.01), &random);
        narrow(&second, CAIRN_PI / 4);
        result = run(match, &second.part, cairn_pose_identity(), NULL);
        assert_int_equal(result.verdict, CAIRN_SCAN_MATCH_AMBIGUOUS);
        assert_true(result.count >= 4 && is_listed(&result, b));
    }
    test_pool_free(&pool);
}

/* Two equal rooms, of which the target has seen one less completely, 12 or 3 sixteenths of it: that
 * the other explains more of the query does not decide. Where they differ by an interval of wall, it
 * does. */
static void an_identical_room_seen_in_part_is_ambiguous(void **state)
{
    static const cairn_vec2 other_room[] = {{-3, -2}, {4, -2}, {4, 1}, {2, 1}, {2, 3}, {-3, 3}};
    const cairn_pose away = {20, 3, CAIRN_REAL(0.5)}, a = {CAIRN_REAL(-0.5), CAIRN_REAL(0.2), 0},
                     b = {CAIRN_REAL(0.3), CAIRN_REAL(-0.4), CAIRN_REAL(1.2)};
    cairn_random random = cairn_random_seed(21, 1);
    cairn_pool pool;
    cairn_scan_match *match = make_match(&pool, cairn_scan_match_default());
    cairn_scan_match_result result;

    (void)state;
    for (int k = 0; k < 3; k++) {
        int32_t sixteenths = k == 1 ? 3 : 12;
        int differs = k == 2;

        cairn_scan_match_clear_target(match);
        take_scan(&first, differs ? other_room : L_ROOM, 6, a, CAIRN_REAL(0.01), &random);
        assert_ok(cairn_scan_match_add_target(match, &first.part, a, NULL));
        take_scan(&first, L_ROOM, 6, a, CAIRN_REAL(0.01), &random);
        first.part.count = first.part.count * sixteenths / 16;
        first.part.dense_count = 0;
        assert_ok(
            cairn_scan_match_add_target(match, &first.part, cairn_pose_compose(away, a), NULL));
        take_scan(&second, L_ROOM, 6, b, CAIRN_REAL(0.01), &random);
        result = run(match, &second.part, cairn_pose_identity(), NULL);
        assert_int_equal(result.verdict,
                         differs ? CAIRN_SCAN_MATCH_FOUND : CAIRN_SCAN_MATCH_AMBIGUOUS);
        if (differs) {
            assert_pose_near(result.hypotheses[0].target_query, cairn_pose_compose(away, b), 0.02,
                             0.01);
            continue;
        }
        assert_true(is_listed(&result, b) &&
                    result.hypotheses[1].score < CAIRN_REAL(0.9) * result.hypotheses[0].score);
        /* along the only wall that is left of 3 sixteenths its place is not known as well */
        assert_pose_near(result.hypotheses[1].target_query, cairn_pose_compose(away, b),
                         sixteenths == 3 ? 0.15 : 0.02, 0.01);
    }
    test_pool_free(&pool);
}

/* Two equal rooms, of which the target saw one fifteen times and the other once: a wall is not more
 * likely to be the right one because many scans have seen it. */
static void an_identical_room_seen_once_is_ambiguous(void **state)
{
    enum { LOOKS = 15 };
    const cairn_pose away = {20, 3, CAIRN_REAL(0.5)},
                     b = {CAIRN_REAL(0.3), CAIRN_REAL(-0.4), CAIRN_REAL(1.2)};
    cairn_scan_match_params params = cairn_scan_match_default();
    cairn_random random = cairn_random_seed(22, 1);
    cairn_pool pool;
    cairn_scan_match *match;
    cairn_scan_match_result result;

    (void)state;
    params.max_target = params.max_dense = 16384;
    match = make_match(&pool, params);
    for (int k = 0; k <= LOOKS; k++) {
        cairn_pose a = draw(&random, CAIRN_REAL(0.8), CAIRN_PI);

        take_scan(&first, L_ROOM, 6, a, CAIRN_REAL(0.01), &random);
        assert_ok(cairn_scan_match_add_target(match, &first.part,
                                              k < LOOKS ? a : cairn_pose_compose(away, a), NULL));
    }
    take_scan(&second, L_ROOM, 6, b, CAIRN_REAL(0.01), &random);
    result = run(match, &second.part, cairn_pose_identity(), NULL);
    assert_int_equal(result.verdict, CAIRN_SCAN_MATCH_AMBIGUOUS);
    assert_true(is_listed(&result, b) && is_listed(&result, cairn_pose_compose(away, b)));
    test_pool_free(&pool);
}

static void names_unobservable_directions(void **state)
{
    cairn_random random = cairn_random_seed(3, 1);
    cairn_pool pool;
    cairn_scan_match *match = make_match(&pool, cairn_scan_match_default());
    cairn_pose a = {0, 0, CAIRN_REAL(0.5)}, b = {CAIRN_REAL(0.7), CAIRN_REAL(0.2), CAIRN_REAL(0.3)};
    cairn_pose truth = cairn_pose_between(a, b);
    cairn_scan_match_window window = {CAIRN_REAL(0.3), CAIRN_REAL(0.3)};
    cairn_scan_match_result result = match_room(match, CORRIDOR, 4, a, b, &truth, &window, &random);
    const cairn_scan_match_hypothesis *h = result.hypotheses;

    (void)state;
    assert_int_equal(result.verdict, CAIRN_SCAN_MATCH_AMBIGUOUS);
    assert_int_equal(h->observable_dof, 2);
    /* Along the corridor, as the target sees it. */
    assert_near(cairn_abs(h->weak_direction[0] * cairn_cos(CAIRN_REAL(0.5)) -
                          h->weak_direction[1] * cairn_sin(CAIRN_REAL(0.5))),
                1, 0.02);
    assert_pose_near(h->target_query, truth, 0.4, 0.01); /* in the window */
    test_pool_free(&pool);
}

static void reports_not_found(void **state)
{
    cairn_random random = cairn_random_seed(4, 1);
    cairn_pool pool;
    cairn_scan_match *match = make_match(&pool, cairn_scan_match_default());
    cairn_scan_match_part empty, one;
    cairn_oriented_point alone = {{1, 0}, {0, 1}};
    cairn_scan_match_result result;

    (void)state;
    memset(&empty, 0, sizeof empty);
    one = empty;
    one.points = one.dense = &alone;
    one.count = one.dense_count = 1;
    take_scan(&first, L_ROOM, 6, cairn_pose_identity(), 0, &random);
    assert_int_equal(cairn_scan_match_read(match).verdict, CAIRN_SCAN_MATCH_RUNNING);
    assert_int_equal(run(match, &first.part, cairn_pose_identity(), NULL).verdict,
                     CAIRN_SCAN_MATCH_NONE);
    assert_ok(cairn_scan_match_add_target(match, &first.part, cairn_pose_identity(), NULL));
    assert_int_equal(run(match, &empty, cairn_pose_identity(), NULL).verdict,
                     CAIRN_SCAN_MATCH_NONE);
    result = run(match, &one, cairn_pose_identity(), NULL);
    assert_true(result.verdict != CAIRN_SCAN_MATCH_FOUND);
    take_scan(&second, TRIANGLE, 3, cairn_pose_identity(), 0, &random);
    assert_int_equal(run(match, &second.part, cairn_pose_identity(), NULL).verdict,
                     CAIRN_SCAN_MATCH_NONE);
    test_pool_free(&pool);
}

static void joins_parts(void **state)
{
    cairn_random random = cairn_random_seed(5, 1);
    cairn_scan_match_params params = cairn_scan_match_default();
    cairn_pool pool;
    cairn_scan_match *match;
    cairn_pose places[] = {
        {CAIRN_REAL(3.4), CAIRN_REAL(-1.5), 1}, {-2, 3, 2}, {CAIRN_REAL(0.4), 0, 3}};
    cairn_scan_match_result result;

    (void)state;
    params.max_target = 3000;
    match = make_match(&pool, params);
    for (int i = 0; i < 2; i++) {
        take_scan(&first, L_ROOM, 6, places[i], CAIRN_REAL(0.01), &random);
        assert_ok(cairn_scan_match_add_target(match, &first.part, places[i], NULL));
    }
    take_scan(&second, L_ROOM, 6, places[2], CAIRN_REAL(0.01), &random);
    result = run(match, &second.part, cairn_pose_identity(), NULL);
    assert_int_equal(result.verdict, CAIRN_SCAN_MATCH_FOUND);
    assert_pose_near(result.hypotheses[0].target_query, places[2], 0.01, 0.004);
    test_pool_free(&pool);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    cairn_random random = cairn_random_seed(6, 1);
    cairn_pose a = draw(&random, CAIRN_REAL(0.5), 3), b = draw(&random, CAIRN_REAL(0.5), 3);
    cairn_scan_match_hypothesis whole[8];
    cairn_pool pool;
    cairn_scan_match *match = make_match(&pool, cairn_scan_match_default());
    cairn_scan_match_result result = match_room(match, L_ROOM, 6, a, b, NULL, NULL, &random);
    cairn_scan_match_measure measure = cairn_scan_match_measured(match);
    int32_t count = result.count;

    (void)state;
    memcpy(whole, result.hypotheses, (size_t)count * sizeof *whole);
    for (int k = 0; k < 3; k++) {
        int64_t used = 0;
        cairn_status status = CAIRN_MORE;

        cairn_scan_match_clear_target(match);
        assert_ok(cairn_scan_match_add_target(match, &first.part, cairn_pose_identity(), NULL));
        assert_ok(cairn_scan_match_begin(match, &second.part, cairn_pose_identity(), NULL, NULL));
        while (status == CAIRN_MORE) {
            cairn_budget budget = {budgets[k]};

            assert_int_equal(cairn_scan_match_read(match).verdict, CAIRN_SCAN_MATCH_RUNNING);
            status = cairn_scan_match_step(match, &budget);
            assert_true(budget.left >= 0);
            used += budgets[k] - budget.left;
        }
        assert_ok(status);
        assert_int_equal(used, measure.units);
        result = cairn_scan_match_read(match);
        assert_int_equal(result.count, count);
        assert_memory_equal(result.hypotheses, whole, (size_t)count * sizeof *whole);
    }
    test_pool_free(&pool);
}

static void refuses_no_object(void **state)
{
    cairn_scan_match_params good = cairn_scan_match_default();
    cairn_pool pool = test_pool(cairn_scan_match_memory(&good));

    (void)state;
    assert_status(cairn_scan_match_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.used, 0);
    test_pool_free(&pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_scan_match *match;

    return cairn_scan_match_create(&match, pool, context);
}

/* A part with the profile of its beams, which is copied, is as good as the beams; in a profile of
 * twice the ranges the target is in free space. */
static void a_profile_takes_the_place_of_the_beams(void **state)
{
    cairn_random random = cairn_random_seed(23, 1);
    cairn_scan_match_window window = {1, 1};
    cairn_pose target_part = {1, -2, 2}, pose = {CAIRN_REAL(0.3), CAIRN_REAL(0.2), 1}, start;
    cairn_scan_match_hypothesis best[3];
    uint16_t range[CAIRN_VISIBILITY_BINS];
    cairn_visibility visibility = {.range = range, .bins = CAIRN_VISIBILITY_BINS};
    int32_t count[3];

    (void)state;
    take_scan(&first, L_ROOM, 6, cairn_pose_identity(), CAIRN_REAL(0.01), &random);
    take_scan(&second, L_ROOM, 6, pose, CAIRN_REAL(0.01), &random);
    start = cairn_pose_compose(target_part, pose);
    for (int32_t i = 0; i < MAX_BEAMS; i++)
        visibility.step = cairn_max(visibility.step, cairn_vec2_norm(first.beams[i].to));
    visibility.step /= CAIRN_VISIBILITY_STEPS;
    for (int k = 0; k < 3; k++) {
        cairn_pool pool;
        cairn_scan_match *match = make_match(&pool, cairn_scan_match_default());
        cairn_scan_match_part target = first.part;
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_scan_match_result result;

        if (k == 1) {
            target.beams = NULL;
            target.beam_count = 0;
        }
        assert_ok(cairn_scan_match_add_target(match, &target, target_part, NULL));
        if (k == 1) {
            cairn_visibility_fill(&visibility, first.beams[0].from, first.beams, MAX_BEAMS);
            assert_ok(cairn_scan_match_add_view(match, &visibility, target_part, NULL));
            memset(range, 1, sizeof range);
        }
        assert_ok(cairn_scan_match_begin(match, &second.part, start, &window, NULL));
        if (k == 2) {
            cairn_visibility_fill(&visibility, second.beams[0].from, second.beams, MAX_BEAMS);
            visibility.step *= 2;
            assert_ok(cairn_scan_match_set_query_view(match, &visibility, NULL));
            memset(range, 1, sizeof range);
        }
        assert_ok(cairn_scan_match_step(match, &budget));
        result = cairn_scan_match_read(match);
        assert_true(result.count > 0);
        count[k] = result.count;
        best[k] = result.hypotheses[0];
        test_pool_free(&pool);
    }
    assert_int_equal(count[1], count[0]);
    assert_memory_equal(&best[1], &best[0], sizeof best[0]);
    assert_true(best[0].target_free_space_violation < CAIRN_REAL(0.1));
    assert_true(best[2].target_free_space_violation > CAIRN_REAL(0.9));
}

/* The target and the query refuse the same profiles, and keep what they had. */
static void refuses_profiles_that_are_none(void **state)
{
    const cairn_real nan = (cairn_real)NAN;
    cairn_random random = cairn_random_seed(24, 1);
    cairn_scan_match_params params = cairn_scan_match_default();
    uint16_t range[CAIRN_VISIBILITY_BINS] = {0};
    const cairn_visibility good = {
        .sensor = {0, 0}, .step = 1, .range = range, .bins = CAIRN_VISIBILITY_BINS};
    /* of even index: not finite */
    cairn_visibility bad[8] = {good, good, good, good, good, good, good, good};
    cairn_pose zero = cairn_pose_identity(), lost = {nan, 0, 0}, far = {0, CAIRN_REAL(2e5), 0};
    cairn_budget budget = {1};
    cairn_scan_match *match;
    cairn_fault fault;
    cairn_pool pool;

    (void)state;
    take_scan(&first, L_ROOM, 6, zero, 0, &random);
    params.max_views = 2;
    match = make_match(&pool, params);
    bad[0].step = nan;
    bad[1].bins = CAIRN_VISIBILITY_BINS / 2;
    bad[2].sensor.y = nan;
    bad[3].range = NULL;
    bad[4].step = (cairn_real)INFINITY;
    bad[5].step = 0;
    bad[6].sensor.x = (cairn_real)-INFINITY;
    bad[7].sensor.y = 2 * CAIRN_SCAN_EXTENT;
    for (int k = 4; k < 8; k++) {
        assert_status(cairn_scan_match_add_view(match, &bad[k], zero, &fault),
                      k % 2 ? CAIRN_BAD_ARGUMENT : CAIRN_NOT_FINITE);
        assert_string_equal(fault.message, k % 2
                                               ? "a visibility profile is without step or too large"
                                               : "a visibility profile is not finite");
    }
    assert_fault(&fault, cairn_scan_match_set_query_view(match, &good, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_ok(cairn_scan_match_add_target(match, &first.part, zero, NULL));
    assert_fault(&fault, cairn_scan_match_add_view(match, NULL, zero, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_fault(&fault, cairn_scan_match_add_view(NULL, &good, zero, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_fault(&fault, cairn_scan_match_add_view(match, &good, lost, &fault), CAIRN_NOT_FINITE,
                 -1);
    assert_fault(&fault, cairn_scan_match_add_view(match, &good, far, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    for (int k = 0; k < 8; k++)
        assert_fault(&fault, cairn_scan_match_add_view(match, &bad[k], zero, &fault),
                     k % 2 ? CAIRN_BAD_ARGUMENT : CAIRN_NOT_FINITE, -1);
    assert_ok(cairn_scan_match_add_view(match, &good, zero, NULL));
    assert_fault(&fault, cairn_scan_match_add_view(match, &good, zero, &fault), CAIRN_FULL, -1);
    assert_ok(cairn_scan_match_begin(match, &first.part, zero, NULL, NULL));
    for (int k = 0; k < 8; k++)
        assert_fault(&fault, cairn_scan_match_set_query_view(match, &bad[k], &fault),
                     k % 2 ? CAIRN_BAD_ARGUMENT : CAIRN_NOT_FINITE, -1);
    assert_fault(&fault, cairn_scan_match_set_query_view(match, NULL, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_fault(&fault, cairn_scan_match_set_query_view(NULL, &good, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_status(cairn_scan_match_step(match, &budget), CAIRN_MORE);
    assert_fault(&fault, cairn_scan_match_add_view(match, &good, zero, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    test_pool_free(&pool);
    /* Without capacity for profiles it is left out. */
    params.max_views = 0;
    match = make_match(&pool, params);
    for (int k = 0; k < 3; k++)
        assert_ok(cairn_scan_match_add_view(match, &good, zero, NULL));
    test_pool_free(&pool);
}

static void memory_is_as_stated(void **state)
{
    cairn_scan_match_params params = cairn_scan_match_default();

    (void)state;
    params.max_target = 5;
    params.max_dense = 7;
    params.max_views = 1;
    test_every_pool_size(create, &params, cairn_scan_match_memory(&params));
}

/* ---- By shape ---- */

static void shape_finds_and_each_stage_brings_it_nearer(void **state)
{
    static const cairn_scan_match_mode modes[] = {
        CAIRN_SCAN_MATCH_SHAPE_COMMON, CAIRN_SCAN_MATCH_SHAPE_SEGMENTS, CAIRN_SCAN_MATCH_SHAPE};
    double errors[3] = {0, 0, 0};

    (void)state;
    for (int k = 0; k < 3; k++) {
        cairn_random random = cairn_random_seed(7, 1);
        cairn_scan_match_params params = cairn_scan_match_default();
        cairn_pool pool;
        cairn_scan_match *match;

        params.mode = modes[k];
        match = make_match(&pool, params);
        for (int trial = 0; trial < 3; trial++) {
            cairn_pose a = draw(&random, CAIRN_REAL(0.6), CAIRN_PI),
                       b = draw(&random, CAIRN_REAL(0.6), CAIRN_PI);
            cairn_pose truth = cairn_pose_between(a, b), h;
            cairn_scan_match_result result =
                match_room(match, L_ROOM, 6, a, b, NULL, NULL, &random);

            assert_int_equal(result.count, 1);
            h = result.hypotheses[0].target_query;
            errors[k] += hypot((double)(h.x - truth.x), (double)(h.y - truth.y)) +
                         fabs((double)cairn_wrap_angle(h.theta - truth.theta));
            if (k == 2) {
                assert_int_equal(result.verdict, CAIRN_SCAN_MATCH_FOUND);
                assert_pose_near(h, truth, 0.1, 0.03);
            }
        }
        test_pool_free(&pool);
    }
    assert_true(errors[1] < errors[0] && errors[2] < errors[1] / 2);
}

static void shape_does_not_depend_on_budgets(void **state)
{
    cairn_random random = cairn_random_seed(8, 1);
    cairn_scan_match_params params = cairn_scan_match_default();
    cairn_pose a = draw(&random, CAIRN_REAL(0.5), 3), b = draw(&random, CAIRN_REAL(0.5), 3), start;
    cairn_scan_match_window window = {CAIRN_REAL(0.3), CAIRN_REAL(0.05)};
    cairn_scan_match_hypothesis whole;
    cairn_scan_match_result result;
    cairn_pool pool;
    cairn_scan_match *match;
    int64_t units;

    (void)state;
    params.mode = CAIRN_SCAN_MATCH_SHAPE;
    match = make_match(&pool, params);
    start = cairn_pose_between(a, b);
    start.theta += CAIRN_REAL(0.03);
    result = match_room(match, L_ROOM, 6, a, b, &start, &window, &random);
    assert_int_equal(result.count, 1);
    assert_pose_near(result.hypotheses[0].target_query, cairn_pose_between(a, b), 0.05, 0.02);
    whole = result.hypotheses[0];
    units = cairn_scan_match_measured(match).units;
    for (int32_t each = 1; each <= 1000; each *= 10) {
        cairn_status status = CAIRN_MORE;
        int64_t used = 0;

        cairn_scan_match_clear_target(match);
        assert_ok(cairn_scan_match_add_target(match, &first.part, cairn_pose_identity(), NULL));
        assert_ok(cairn_scan_match_begin(match, &second.part, start, &window, NULL));
        while (status == CAIRN_MORE) {
            cairn_budget budget = {each};

            status = cairn_scan_match_step(match, &budget);
            used += each - budget.left;
        }
        assert_ok(status);
        assert_int_equal(used, units);
        assert_memory_equal(cairn_scan_match_read(match).hypotheses, &whole, sizeof whole);
    }
    test_pool_free(&pool);
}

static void memory_of_shape_is_as_stated(void **state)
{
    cairn_scan_match_params params = cairn_scan_match_default();

    (void)state;
    params.mode = CAIRN_SCAN_MATCH_SHAPE;
    params.max_target = 5;
    params.max_query = 3;
    params.max_dense = params.max_views = 0;
    test_every_pool_size(create, &params, cairn_scan_match_memory(&params));
}

/* ---- Terms of the log-likelihood ratio ---- */

static void free_space_violations_lower_the_score(void **state)
{
    cairn_random random = cairn_random_seed(9, 1);
    cairn_scan_match_params params = cairn_scan_match_default();
    cairn_pool pool;
    cairn_scan_match *match = make_match(&pool, params);
    cairn_scan_match_result result;

    (void)state;
    take_scan(&first, OBLONG, 4, cairn_pose_identity(), 0, &random);
    take_scan(&second, TRIANGLE, 3, cairn_pose_identity(), 0, &random);
    assert_ok(cairn_scan_match_add_target(match, &first.part, cairn_pose_identity(), NULL));
    result = run(match, &second.part, cairn_pose_identity(), NULL);
    assert_true(result.count > 0);
    assert_true(result.hypotheses[0].free_space_violation +
                    result.hypotheses[0].target_free_space_violation >
                CAIRN_REAL(0.1));
    assert_true(result.hypotheses[0].log_odds < 0);
    /* No free space is known. */
    second.part.beam_count = first.part.beam_count = 0;
    cairn_scan_match_clear_target(match);
    assert_ok(cairn_scan_match_add_target(match, &first.part, cairn_pose_identity(), NULL));
    result = run(match, &second.part, cairn_pose_identity(), NULL);
    assert_near(result.hypotheses[0].free_space_violation, 0, 0);
    assert_near(result.hypotheses[0].target_free_space_violation, 0, 0);
    test_pool_free(&pool);
}

static void leaves_out_what_exceeds_the_capacity(void **state)
{
    cairn_random random = cairn_random_seed(10, 1);
    cairn_scan_match_params params = cairn_scan_match_default();
    cairn_pose a = {CAIRN_REAL(0.2), 0, 1}, b = {0, CAIRN_REAL(0.4), 2};
    cairn_scan_match_result result;
    cairn_pool pool;
    cairn_scan_match *match;

    (void)state;
    params.max_dense = params.max_views = 0;
    match = make_match(&pool, params);
    result = match_room(match, L_ROOM, 6, a, b, NULL, NULL, &random);
    /* no free-space violation when the room is turned about */
    assert_int_equal(result.verdict, CAIRN_SCAN_MATCH_AMBIGUOUS);
    assert_pose_near(result.hypotheses[0].target_query, cairn_pose_between(a, b), 0.02, 0.008);
    assert_near(result.hypotheses[0].free_space_violation, 0, 0);
    test_pool_free(&pool);
}

/* 95 % of the errors lie in the 95 % ellipsoid, approximately. */
static void covariance_holds(void **state)
{
    cairn_random random = cairn_random_seed(11, 1);
    cairn_pool pool;
    cairn_scan_match *match = make_match(&pool, cairn_scan_match_default());
    cairn_scan_match_window window = {CAIRN_REAL(0.1), CAIRN_REAL(0.1)};
    int inside = 0, trials = 60;

    (void)state;
    for (int trial = 0; trial < trials; trial++) {
        cairn_pose a = draw(&random, CAIRN_REAL(0.8), CAIRN_PI),
                   b = draw(&random, CAIRN_REAL(0.8), CAIRN_PI);
        cairn_pose truth = cairn_pose_between(a, b);
        cairn_scan_match_result result =
            match_room(match, L_ROOM, 6, a, b, &truth, &window, &random);
        const cairn_scan_match_hypothesis *h = &result.hypotheses[0];
        const cairn_real *c = h->covariance;
        cairn_sym3 inverse;
        cairn_real e[3] = {h->target_query.x - truth.x, h->target_query.y - truth.y,
                           cairn_wrap_angle(h->target_query.theta - truth.theta)};

        assert_true(cairn_sym3_inverse(cairn_sym3_of_full(c), &inverse));
        inside += cairn_sym3_form(inverse, e) < CAIRN_REAL(7.815);
        assert_true(c[0] < CAIRN_REAL(1e-4) && c[4] < CAIRN_REAL(1e-4) && c[8] < CAIRN_REAL(1e-5));
    }
    assert_true(inside >= trials * 85 / 100);
    test_pool_free(&pool);
}

static void a_round_room_is_ambiguous(void **state)
{
    static cairn_vec2 circle[60];
    cairn_random random = cairn_random_seed(12, 1);
    cairn_pool pool;
    cairn_scan_match *match = make_match(&pool, cairn_scan_match_default());

    (void)state;
    for (int i = 0; i < 60; i++) {
        cairn_real angle = (cairn_real)i * CAIRN_PI / 30;

        circle[i].x = 3 * cairn_cos(angle);
        circle[i].y = 3 * cairn_sin(angle);
    }
    assert_true(match_room(match, circle, 60, cairn_pose_identity(), cairn_pose_identity(), NULL,
                           NULL, &random)
                    .verdict != CAIRN_SCAN_MATCH_FOUND);
    test_pool_free(&pool);
}

/* ---- Dense points ---- */

static void dense_points_have_the_direction_of_their_wall(void **state)
{
    cairn_scan_beam beams[43];
    cairn_oriented_point dense[43];
    cairn_scan_view view;
    int32_t count;

    (void)state;
    memset(beams, 0, sizeof beams);
    memset(&view, 0, sizeof view);
    view.beams = beams;
    view.beam_count = 43;
    /* A corner at (2, 0.6), seen from the origin counter-clockwise: up along x = 2, then left along
     * y = 0.6; then an isolated hit, and a beam without a hit. */
    for (int i = 0; i < 41; i++) {
        beams[i].kind = CAIRN_SCAN_BEAM_HIT;
        beams[i].to.x = i < 21 ? 2 : 2 - (cairn_real)(i - 20) * CAIRN_REAL(0.03);
        beams[i].to.y = i < 21 ? (cairn_real)i * CAIRN_REAL(0.03) : CAIRN_REAL(0.6);
    }
    beams[41].kind = CAIRN_SCAN_BEAM_HIT;
    beams[41].to.x = -5;
    beams[42].kind = CAIRN_SCAN_BEAM_FREE;
    beams[42].to.x = -5;
    count = cairn_scan_match_dense(&view, dense);
    assert_int_equal(count, 41);
    for (int i = 0; i < 41; i++) {
        int up = i < 20;

        assert_memory_equal(&dense[i].position, &beams[i].to, sizeof dense[i].position);
        if (i != 20) {
            assert_near(dense[i].direction.x, up ? 0 : -1, 0.12);
            assert_near(dense[i].direction.y, up ? 1 : 0, 0.12);
        }
    }
}

/* ---- Few points ---- */

/* A corner's points a metre apart: three pairs are too few for a decision, four make the corner. */
static void four_pairs_are_enough(void **state)
{
    static const cairn_oriented_point corner[] = {
        {{1, 0}, {0, 1}}, {{1, 1}, {0, 1}}, {{0, 2}, {-1, 0}}, {{-1, 2}, {-1, 0}}};
    cairn_scan_match_window window = {CAIRN_REAL(0.3), 0};
    cairn_scan_match_params params = cairn_scan_match_default();
    cairn_scan_match_part part;
    cairn_scan_match *match;
    cairn_pool pool;

    (void)state;
    params.mode = CAIRN_SCAN_MATCH_SHAPE_SEGMENTS;
    match = make_match(&pool, params);
    memset(&part, 0, sizeof part);
    part.points = corner;
    part.count = 4;
    assert_ok(cairn_scan_match_add_target(match, &part, cairn_pose_identity(), NULL));
    for (part.count = 1; part.count <= 4; part.count++) {
        int32_t enough = part.count == 4;
        cairn_scan_match_result result = run(match, &part, cairn_pose_identity(), &window);
        const cairn_scan_match_hypothesis *h = result.hypotheses;

        assert_int_equal(result.count, 1);
        assert_int_equal(h->pairs, part.count);
        assert_int_equal(h->observable_dof, enough ? 3 : 0);
        assert_int_equal(h->weak_ratio > 0, enough);
        for (int k = 0; k < 3 && !enough; k++)
            assert_near(h->weak_direction[k], 0, 0);
        assert_near(h->overlap, 1, 0);
        assert_near(h->fit, 1, 1e-6);
        assert_pose_near(h->target_query, cairn_pose_identity(), 1e-6, 1e-6);
    }
    test_pool_free(&pool);
}

/* ---- Golden results ---- */

static uint64_t hash_match(const cairn_scan_match *match)
{
    cairn_scan_match_result result = cairn_scan_match_read(match);
    cairn_scan_match_measure cost = cairn_scan_match_measured(match);
    int64_t numbers[] = {result.count,    result.verdict,  cost.units,
                         cost.worst_step, cost.candidates, cost.refinements};
    uint64_t hash = test_hash(TEST_HASH_START, result.hypotheses,
                              (size_t)result.count * sizeof *result.hypotheses);

    return test_hash(hash, numbers, sizeof numbers);
}

/* The view of one place is added as two parts; of the view of another every hypothesis is
 * hashed. */
struct scene {
    cairn_scan_match_mode mode;
    const cairn_vec2 *target, *query;
    int32_t target_corners, query_corners;
    /* 1: without dense points and beams, the parts of the target far apart */
    int32_t bare;
    /* of the window; < 0: none */
    double distance, angle;
    uint64_t in_double, in_float;
};

/* Another target, elsewhere; a first match of it ends, and a second is dropped during the votes. */
static void leave_traces(cairn_scan_match *match)
{
    const cairn_pose elsewhere = {-40, -30, 2};
    cairn_scan_match_window window = {2, CAIRN_REAL(0.1)};
    cairn_budget some = {CAIRN_UNBOUNDED};
    int64_t units;

    assert_ok(cairn_scan_match_add_target(match, &first.part, elsewhere, NULL));
    (void)run(match, &second.part, elsewhere, &window);
    units = cairn_scan_match_measured(match).units;
    assert_ok(cairn_scan_match_begin(match, &second.part, elsewhere, &window, NULL));
    some.left = (int32_t)(units / 8);
    assert_status(cairn_scan_match_step(match, &some), CAIRN_MORE);
    cairn_scan_match_clear_target(match);
}

static uint64_t hash_of_scene(const struct scene *scene)
{
    const cairn_pose a = {CAIRN_REAL(0.4), CAIRN_REAL(-0.3), CAIRN_REAL(0.7)},
                     b = {CAIRN_REAL(-0.2), CAIRN_REAL(0.1), -1};
    const cairn_pose home = {1, -2, CAIRN_REAL(0.3)}, away = {33, -55, 1};
    cairn_scan_match_params params = cairn_scan_match_default();
    cairn_scan_match_window window = {(cairn_real)scene->distance, (cairn_real)scene->angle};
    cairn_random random = cairn_random_seed(14, 1);
    cairn_scan_match *match;
    cairn_pose start;
    cairn_pool pool;
    uint64_t hash;

    params.mode = scene->mode;
    match = make_match(&pool, params);
    take_scan(&first, scene->target, scene->target_corners, a, CAIRN_REAL(0.01), &random);
    take_scan(&second, scene->query, scene->query_corners, b, CAIRN_REAL(0.01), &random);
    hash = test_hash(TEST_HASH_START, second.dense,
                     (size_t)second.part.dense_count * sizeof *second.dense);
    if (scene->bare) {
        first.part.dense_count = second.part.dense_count = first.part.beam_count =
            second.part.beam_count = 0;
        /* one more than all of the first stage's */
        second.part.count = second.part.count / 48 * 48 + 1;
    }
    leave_traces(match);
    for (int32_t half = 0; half < 2; half++) {
        cairn_scan_match_part part = first.part;

        part.count = half ? first.part.count - first.part.count / 3 : first.part.count / 3;
        part.points += half * (first.part.count / 3);
        part.dense_count =
            half ? first.part.dense_count - first.part.dense_count / 2 : first.part.dense_count / 2;
        part.dense += half * (first.part.dense_count / 2);
        assert_ok(
            cairn_scan_match_add_target(match, &part, half && scene->bare ? away : home, NULL));
    }
    start = cairn_pose_compose(home, cairn_pose_between(a, b));
    start.x += window.distance / 2;
    start.y -= window.distance / 4;
    start.theta -= window.angle / 3;
    (void)run(match, &second.part, start, window.distance >= 0 ? &window : NULL);
    hash ^= hash_match(match);
    test_pool_free(&pool);
    return hash;
}

static void results_stay_as_they_are(void **state)
{
    static const struct scene scenes[] = {
        {CAIRN_SCAN_MATCH_CORRELATIVE, L_ROOM, L_ROOM, 6, 6, 0, -1, -1,
         UINT64_C(0x6ccb817131650f0e), UINT64_C(0x5c1f60aed413b2e9)},
        {CAIRN_SCAN_MATCH_CORRELATIVE, L_ROOM, L_ROOM, 6, 6, 0, 0.3, 0.35,
         UINT64_C(0x6d208e7f150fddf3), UINT64_C(0x7ea63d23b97d6e2c)},
        {CAIRN_SCAN_MATCH_CORRELATIVE, L_ROOM, L_ROOM, 6, 6, 1, 0.8, 0.2,
         UINT64_C(0xd7a00f1397ff75d5), UINT64_C(0xb247292c71dc9e03)},
        {CAIRN_SCAN_MATCH_CORRELATIVE, L_ROOM, L_ROOM, 6, 6, 1, -1, -1,
         UINT64_C(0x6ed647e26bf470f4), UINT64_C(0x636619d0b69027ce)},
        {CAIRN_SCAN_MATCH_CORRELATIVE, OBLONG, OBLONG, 4, 4, 0, -1, -1,
         UINT64_C(0x5a34d44d0b96e52a), UINT64_C(0xcc69f81bfeb2c4e6)},
        {CAIRN_SCAN_MATCH_CORRELATIVE, OBLONG, TRIANGLE, 4, 3, 0, -1, -1,
         UINT64_C(0x6553660176233150), UINT64_C(0x8c446e43c5f34a2a)},
        {CAIRN_SCAN_MATCH_CORRELATIVE, CORRIDOR, CORRIDOR, 4, 4, 0, 1, 4,
         UINT64_C(0xb0018aaf2a2621b3), UINT64_C(0x70b1262e19b8aeae)},
        {CAIRN_SCAN_MATCH_SHAPE, L_ROOM, L_ROOM, 6, 6, 0, -1, -1, UINT64_C(0x7501c087713ebde1),
         UINT64_C(0x5649b6629446d860)},
        {CAIRN_SCAN_MATCH_SHAPE, L_ROOM, L_ROOM, 6, 6, 0, 0.5, 0.05, UINT64_C(0x3729fa9401213f7a),
         UINT64_C(0xee8d292388e2e523)},
        {CAIRN_SCAN_MATCH_SHAPE, OBLONG, TRIANGLE, 4, 3, 1, 0.5, 0.2, UINT64_C(0x09c38339472575c7),
         UINT64_C(0x879791dadf896c44)},
        {CAIRN_SCAN_MATCH_SHAPE_COMMON, L_ROOM, L_ROOM, 6, 6, 0, 0.5, 0.2,
         UINT64_C(0xd184b4fd0732312f), UINT64_C(0xa853bc645f863f90)},
        {CAIRN_SCAN_MATCH_SHAPE_COLINEAR, L_ROOM, L_ROOM, 6, 6, 0, 0.5, 0.2,
         UINT64_C(0xb294fdaa88ef682d), UINT64_C(0xda82d178a97416c1)},
        {CAIRN_SCAN_MATCH_SHAPE_SEGMENTS, L_ROOM, L_ROOM, 6, 6, 0, 0.5, 0.2,
         UINT64_C(0x6c9def0acec5882d), UINT64_C(0x541278d4aaffb119)},
        {CAIRN_SCAN_MATCH_SHAPE, L_ROOM, OBLONG, 6, 4, 0, -1, -1, UINT64_C(0x73074fbbefe844a2),
         UINT64_C(0x3785705b8c4fc0f2)},
        {CAIRN_SCAN_MATCH_SHAPE, OBLONG, SQUARE, 4, 4, 0, 0.5, 0.3, UINT64_C(0x3557810111a29a7e),
         UINT64_C(0x4fffc301ae59300c)},
        {CAIRN_SCAN_MATCH_SHAPE_COMMON, SQUARE, L_ROOM, 4, 6, 0, -1, -1,
         UINT64_C(0x7b0afe434e48de06), UINT64_C(0x19da4e90e9005bfe)},
        {CAIRN_SCAN_MATCH_SHAPE_COLINEAR, CORRIDOR, OBLONG, 4, 4, 0, -1, -1,
         UINT64_C(0x90f844b9145861ad), UINT64_C(0x959994d7e7ba8afd)},
        {CAIRN_SCAN_MATCH_SHAPE_SEGMENTS, OBLONG, L_ROOM, 4, 6, 0, -1, -1,
         UINT64_C(0x8a335048bcf28960), UINT64_C(0x077ad7859895b645)},
        {CAIRN_SCAN_MATCH_CORRELATIVE, SQUARE, SQUARE, 4, 4, 1, -1, -1,
         UINT64_C(0xc12f6c42988801a0), UINT64_C(0x8224dd10e2bd68ca)},
        {CAIRN_SCAN_MATCH_CORRELATIVE, TRIANGLE, CORRIDOR, 3, 4, 0, 0.5, 0.5,
         UINT64_C(0x2fda4a0ca43498e5), UINT64_C(0x6c0972bad14e3a72)},
    };

    (void)state;
    for (size_t k = 0; k < sizeof scenes / sizeof *scenes; k++)
        assert_golden(hash_of_scene(&scenes[k]), scenes[k].in_double, scenes[k].in_float);
}

/* ---- Memory of the search ---- */

/* A grid that just holds the window finds the same as the largest one, in less memory; a smaller
 * one holds the middle of the window. */
static void a_small_grid_finds_the_same(void **state)
{
    cairn_scan_match_params params = cairn_scan_match_default();
    cairn_scan_match_window window = {1, CAIRN_REAL(0.4)};
    cairn_pose a = {CAIRN_REAL(0.3), 0, 0},
               b = {CAIRN_REAL(-0.5), CAIRN_REAL(0.4), CAIRN_REAL(0.2)};
    size_t whole = cairn_scan_match_memory(&params);
    cairn_scan_match_hypothesis best = {0};
    int32_t sides[] = {0, 16, 5};

    (void)state;
    assert_int_equal(cairn_scan_match_cells(1, params.spacing), 256);
    assert_int_equal(cairn_scan_match_cells(0, params.spacing), 36);
    assert_int_equal(cairn_scan_match_cells(1000, params.spacing), 65536);
    assert_int_equal(cairn_scan_match_cells(CAIRN_REAL(1e30), params.spacing), 65536);
    assert_int_equal(cairn_scan_match_cells(-1, params.spacing), 25);
    assert_int_equal(cairn_scan_match_cells((cairn_real)NAN, params.spacing), 25);
    assert_int_equal(cairn_scan_match_cells(1, 0), 25);
    for (int i = 0; i < 3; i++) {
        cairn_random random = cairn_random_seed(3, 1);
        cairn_scan_match_result result;
        cairn_pool pool;
        cairn_scan_match *match;

        params.max_cells = i == 0 ? 65536 : sides[i] * sides[i];
        match = make_match(&pool, params);
        result = match_room(match, L_ROOM, 6, a, b, NULL, &window, &random);
        if (i == 0) {
            best = result.hypotheses[0];
            assert_pose_near(best.target_query, cairn_pose_between(a, b), 0.05, 0.02);
        } else if (i == 1) {
            assert_memory_equal(&best, &result.hypotheses[0], sizeof best);
            assert_int_equal(cairn_scan_match_memory(&params),
                             whole - (65536 - 256) * 2 * sizeof(uint16_t));
        } else {
            assert_true(cairn_scan_match_measured(match).candidates < 25);
        }
        test_pool_free(&pool);
    }
}

/* ---- Refusals ---- */

static void refuses_input(void **state)
{
    const cairn_real nan = (cairn_real)NAN;
    cairn_random random = cairn_random_seed(13, 1);
    cairn_scan_match_params params = cairn_scan_match_default();
    cairn_scan_match_window window = {1, 1};
    cairn_pose zero = cairn_pose_identity(), lost = {nan, 0, 0}, far = {CAIRN_REAL(2e5), 0, 0};
    cairn_scan_match_part part;
    cairn_budget budget = {100};
    cairn_oriented_point kept;
    cairn_scan_beam beam;
    cairn_fault fault;
    cairn_pool pool;
    cairn_scan_match *match;
    int32_t count;

    (void)state;
    take_scan(&first, L_ROOM, 6, zero, 0, &random);
    count = first.part.count;
    params.max_target = 2 * count - 1;
    params.max_query = count;
    params.max_dense = 2 * MAX_BEAMS;
    params.max_views = 2;
    match = make_match(&pool, params);
    assert_fault(&fault, cairn_scan_match_add_target(NULL, &first.part, zero, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_status(cairn_scan_match_add_target(match, NULL, zero, NULL), CAIRN_BAD_ARGUMENT);
    assert_fault(&fault, cairn_scan_match_add_target(match, &first.part, lost, &fault),
                 CAIRN_NOT_FINITE, -1);
    assert_fault(&fault, cairn_scan_match_add_target(match, &first.part, far, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    part = first.part;
    part.count = -1;
    assert_fault(&fault, cairn_scan_match_add_target(match, &part, zero, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    part = first.part;
    part.dense = NULL;
    assert_fault(&fault, cairn_scan_match_add_target(match, &part, zero, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    part = first.part;
    part.beams = NULL;
    assert_fault(&fault, cairn_scan_match_add_target(match, &part, zero, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    kept = first.points[3];
    first.points[3].position.y = nan;
    assert_fault(&fault, cairn_scan_match_add_target(match, &first.part, zero, &fault),
                 CAIRN_NOT_FINITE, 3);
    first.points[3] = kept;
    first.points[3].direction.x *= CAIRN_REAL(1.1);
    first.points[3].direction.y *= CAIRN_REAL(1.1);
    assert_fault(&fault, cairn_scan_match_add_target(match, &first.part, zero, &fault),
                 CAIRN_BAD_ARGUMENT, 3);
    first.points[3] = kept;
    first.points[3].position.x = 2 * CAIRN_SCAN_EXTENT;
    assert_fault(&fault, cairn_scan_match_add_target(match, &first.part, zero, &fault),
                 CAIRN_BAD_ARGUMENT, 3);
    first.points[3] = kept;
    kept = first.dense[5];
    first.dense[5].direction.x = nan;
    assert_fault(&fault, cairn_scan_match_add_target(match, &first.part, zero, &fault),
                 CAIRN_NOT_FINITE, 5);
    first.dense[5] = kept;
    beam = first.beams[7];
    first.beams[7].to.x = nan;
    assert_fault(&fault, cairn_scan_match_add_target(match, &first.part, zero, &fault),
                 CAIRN_NOT_FINITE, 7);
    assert_string_equal(fault.message, "a beam is not finite");
    first.beams[7].to.x = -2 * CAIRN_SCAN_EXTENT;
    assert_fault(&fault, cairn_scan_match_add_target(match, &first.part, zero, &fault),
                 CAIRN_BAD_ARGUMENT, 7);
    assert_string_equal(fault.message, "a beam is too far away");
    first.beams[7] = beam;
    /* No input so far; then exactly as much as the capacity. */
    assert_int_equal(run(match, &first.part, zero, NULL).verdict, CAIRN_SCAN_MATCH_NONE);
    assert_ok(cairn_scan_match_add_target(match, &first.part, zero, &fault));
    assert_fault(&fault, cairn_scan_match_add_target(match, &first.part, zero, &fault), CAIRN_FULL,
                 -1);
    part = first.part;
    part.count = 0;
    assert_ok(cairn_scan_match_add_target(match, &part, zero, &fault));
    assert_fault(&fault, cairn_scan_match_add_target(match, &part, zero, &fault), CAIRN_FULL, -1);
    part.dense_count = 0;
    assert_fault(&fault, cairn_scan_match_add_target(match, &part, zero, &fault), CAIRN_FULL, -1);

    assert_status(cairn_scan_match_begin(NULL, &first.part, zero, NULL, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_scan_match_begin(match, NULL, zero, NULL, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_scan_match_begin(match, &first.part, lost, &window, NULL),
                  CAIRN_NOT_FINITE);
    /* not used */
    assert_ok(cairn_scan_match_begin(match, &first.part, lost, NULL, NULL));
    window.distance = -1;
    assert_status(cairn_scan_match_begin(match, &first.part, zero, &window, NULL),
                  CAIRN_BAD_ARGUMENT);
    window.distance = 1;
    window.angle = nan;
    assert_status(cairn_scan_match_begin(match, &first.part, zero, &window, NULL),
                  CAIRN_BAD_ARGUMENT);
    part = first.part;
    part.count++;
    first.points[count] = first.points[0];
    assert_fault(&fault, cairn_scan_match_begin(match, &part, zero, NULL, &fault), CAIRN_FULL, -1);
    assert_status(cairn_scan_match_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_scan_match_step(match, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_scan_match_step(match, &budget), CAIRN_MORE);
    /* running */
    assert_status(cairn_scan_match_add_target(match, &part, zero, NULL), CAIRN_BAD_ARGUMENT);
    cairn_scan_match_clear_target(match);
    assert_int_equal(cairn_scan_match_read(match).verdict, CAIRN_SCAN_MATCH_RUNNING);
    assert_ok(cairn_scan_match_add_target(match, &first.part, zero, NULL));
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(results_stay_as_they_are),
        cmocka_unit_test(finds_from_a_guess_and_from_none),
        cmocka_unit_test(lists_all_that_look_alike),
        cmocka_unit_test(a_corner_alone_is_ambiguous),
        cmocka_unit_test(an_identical_room_seen_in_part_is_ambiguous),
        cmocka_unit_test(an_identical_room_seen_once_is_ambiguous),
        cmocka_unit_test(names_unobservable_directions),
        cmocka_unit_test(reports_not_found),
        cmocka_unit_test(joins_parts),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(refuses_no_object),
        cmocka_unit_test(a_profile_takes_the_place_of_the_beams),
        cmocka_unit_test(refuses_profiles_that_are_none),
        cmocka_unit_test(memory_is_as_stated),
        cmocka_unit_test(shape_finds_and_each_stage_brings_it_nearer),
        cmocka_unit_test(shape_does_not_depend_on_budgets),
        cmocka_unit_test(memory_of_shape_is_as_stated),
        cmocka_unit_test(free_space_violations_lower_the_score),
        cmocka_unit_test(leaves_out_what_exceeds_the_capacity),
        cmocka_unit_test(covariance_holds),
        cmocka_unit_test(a_round_room_is_ambiguous),
        cmocka_unit_test(dense_points_have_the_direction_of_their_wall),
        cmocka_unit_test(four_pairs_are_enough),
        cmocka_unit_test(a_small_grid_finds_the_same),
        cmocka_unit_test(refuses_input),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
