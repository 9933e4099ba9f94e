/* Walls of the aligner: the search by tiles compared with a linear search. */
#include "tests/test.h"

#include "src/alignment/aligner_work.h"

enum { SEGMENTS = 900, SCANS = 12 };

/* Segments of a lattice of lines, 3 m apart, a few of them much longer than the others; from -30 to
 * 30 m, rotated at random. */
static aligner_segment random_segment(cairn_random *random, cairn_real turn)
{
    static const cairn_real lengths[] = {CAIRN_REAL(0.1), CAIRN_REAL(0.4), 1, 3, 12};
    cairn_real angle = turn + cairn_random_uniform(random, -CAIRN_REAL(0.03), CAIRN_REAL(0.03));
    cairn_real line = cairn_floor(cairn_random_uniform(random, -10, 11)) * 3, sine, cosine;
    cairn_vec2 middle = {cairn_random_uniform(random, -30, 30), line}, half;
    aligner_segment s;

    memset(&s, 0, sizeof s);
    angle += cairn_floor(cairn_random_uniform(random, 0, 4)) * CAIRN_PI / 2;
    cairn_sincos(angle, &sine, &cosine);
    s.length =
        lengths[cairn_real_to_int(cairn_floor(cairn_random_uniform(random, 0, CAIRN_REAL(4.1))))];
    s.direction.x = cosine;
    s.direction.y = sine;
    middle.y += cairn_random_uniform(random, -CAIRN_REAL(0.05), CAIRN_REAL(0.05));
    s.mean.x = cosine * middle.x - sine * middle.y;
    s.mean.y = sine * middle.x + cosine * middle.y;
    half = cairn_vec2_scale(s.direction, s.length / 2);
    s.a = cairn_vec2_sub(s.mean, half);
    s.weight = 100 * s.length;
    s.scatter.xx = s.weight * s.length * s.length / 12 * cosine * cosine;
    s.scatter.xy = s.weight * s.length * s.length / 12 * cosine * sine;
    s.scatter.yy = s.weight * s.length * s.length / 12 * sine * sine;
    s.scan = cairn_real_to_int(cairn_floor(cairn_random_uniform(random, 0, SCANS)));
    s.is_short = s.length < CAIRN_REAL(0.3) && cairn_random_uniform(random, 0, 1) < CAIRN_REAL(0.5);
    s.wall = -1;
    return s;
}

static int32_t search_every_wall(const cairn_aligner *aligner, const aligner_segment *s)
{
    cairn_real best = CAIRN_REAL_MAX;
    int32_t found = -1;

    for (int32_t w = 0; w < aligner->wall_count; w++) {
        cairn_real misfit = cairn_aligner_wall_distance(aligner, s, &aligner->walls[w]);

        if (misfit >= 0 && misfit < best) {
            best = misfit;
            found = w;
        }
    }
    return found;
}

/* An aligner whose scans are at the origin of one cluster; every third has few other
 * constraints. */
static cairn_aligner *make_aligner(cairn_pool *pool, uint64_t seed)
{
    cairn_aligner_params params = cairn_aligner_default();
    cairn_random random = cairn_random_seed(seed, 1);
    cairn_real turn = cairn_random_uniform(&random, -3, 3);
    cairn_pose origin = {0, 0, 0};
    cairn_scan_view nothing;
    cairn_aligner *aligner;

    params.max_scans = SCANS;
    params.max_segments = SEGMENTS;
    *pool = test_pool(cairn_aligner_memory(&params));
    assert_ok(cairn_aligner_create(&aligner, pool, &params));
    memset(&nothing, 0, sizeof nothing);
    for (int32_t i = 0; i < SCANS; i++)
        assert_ok(cairn_aligner_add_scan(aligner, &nothing, origin, NULL));
    assert_ok(cairn_aligner_begin(aligner));
    for (int32_t i = 0; i < SCANS; i++) {
        aligner->scans[i].cluster = 0;
        aligner->scans[i].is_weak = i % 3 == 0;
    }
    aligner->segment_count = SEGMENTS;
    for (int32_t i = 0; i < SEGMENTS; i++) {
        aligner->segments[i] = random_segment(&random, turn);
        aligner->order[i] = i;
    }
    aligner->move.home = aligner->joint.at = aligner->joint.round = 0;
    return aligner;
}

/* The wall nearest to a segment, also while segments are assigned. */
static int32_t find_wall(cairn_aligner *aligner, const aligner_segment *s, int32_t *passed)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    aligner_joint joint = aligner->joint;
    aligner_resume resume = aligner->resume;
    int32_t wall;

    memset(&aligner->resume, 0, sizeof aligner->resume);
    cairn_aligner_begin_search(aligner, s);
    assert_int_equal(cairn_aligner_find_wall(aligner, &budget), 1);
    wall = aligner->joint.search.wall;
    *passed = aligner->joint.search.passed;
    aligner->joint = joint;
    aligner->resume = resume;
    return wall;
}

/* Assigns all segments. */
static void assign_all(cairn_aligner *aligner)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_int_equal(cairn_aligner_associate(aligner, &budget), 1);
}

static void tiles_find_what_a_linear_search_finds(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 12; seed++) {
        cairn_pool pool;
        cairn_aligner *aligner = make_aligner(&pool, seed);
        int32_t found = 0, looked = 0, walls = 0, last = 0;
        cairn_budget one = {1};

        /* A search costs a unit or more, which stops the assignment before each segment. */
        for (; !cairn_aligner_associate(aligner, &one); one.left = 1) {
            aligner_segment *s = &aligner->segments[aligner->joint.at];
            int32_t passed, wall;

            if (aligner->joint.at == last)
                continue;
            last = aligner->joint.at;
            wall = find_wall(aligner, s, &passed);
            assert_int_equal(wall, search_every_wall(aligner, s));
            found += wall >= 0;
            looked += passed;
            walls += aligner->wall_count;
        }
        assert_int_equal(last, SEGMENTS - 1);
        assert_in_range(found, SEGMENTS / 20, SEGMENTS);
        assert_true(looked < walls);
        test_pool_free(&pool);
    }
}

/* When walls are kept they are filled in anew, and are found at their new positions. */
static void kept_walls_are_found_where_they_are(void **state)
{
    cairn_pool pool;
    cairn_aligner *aligner = make_aligner(&pool, 7);
    int32_t walls;

    (void)state;
    assign_all(aligner);
    walls = aligner->wall_count;
    for (int32_t i = 0; i < SCANS; i++)
        aligner->poses[i].x += 9;
    aligner->joint.round = 8;
    assign_all(aligner);
    assert_int_equal(aligner->wall_count, walls);
    aligner->joint.round = 3;
    for (int32_t i = 0; i < SEGMENTS; i++) {
        int32_t passed;

        assert_int_equal(find_wall(aligner, &aligner->segments[i], &passed),
                         search_every_wall(aligner, &aligner->segments[i]));
    }
    test_pool_free(&pool);
}

/* A segment near the line of another, often at about the same position along it, displaced and
 * rotated as far as may just fit. */
static aligner_segment continuation(cairn_random *random, const aligner_segment *of)
{
    static const cairn_real lengths[] = {CAIRN_REAL(0.1), CAIRN_REAL(0.5), 3, 12};
    aligner_segment s = *of;
    cairn_real turn, sine, cosine, gap,
        off = cairn_random_uniform(random, -CAIRN_REAL(0.09), CAIRN_REAL(0.09));

    s.length =
        lengths[cairn_real_to_int(cairn_floor(cairn_random_uniform(random, 0, CAIRN_REAL(3.99))))];
    s.is_short = s.length < CAIRN_REAL(0.3);
    turn = cairn_random_uniform(random, -1, 1) * CAIRN_REAL(0.09) / s.length;
    turn = cairn_max(cairn_min(turn, CAIRN_REAL(0.85)), -CAIRN_REAL(0.85));
    cairn_sincos(turn, &sine, &cosine);
    s.direction.x = cosine * of->direction.x - sine * of->direction.y;
    s.direction.y = sine * of->direction.x + cosine * of->direction.y;
    gap = cairn_random_uniform(random, -7, 7);
    s.a = cairn_vec2_add(
        of->a, cairn_vec2_scale(of->direction, gap < 0 ? gap - s.length : gap + of->length));
    s.a = cairn_vec2_add(s.a, cairn_vec2_scale(cairn_vec2_left_perp(of->direction), off));
    s.mean = cairn_vec2_add(s.a, cairn_vec2_scale(s.direction, s.length / 2));
    s.scan = cairn_real_to_int(cairn_floor(cairn_random_uniform(random, 0, SCANS)));
    return s;
}

/* No tile is skipped that holds a wall which the segment fits. */
static void what_fits_is_found(void **state)
{
    cairn_random random = cairn_random_seed(5, 1);
    cairn_pool pool;
    cairn_aligner *aligner = make_aligner(&pool, 5);
    int32_t fitting = 0, far = 0;

    (void)state;
    for (int32_t i = 0; i < 40000; i++) {
        aligner_segment wall = random_segment(&random, cairn_random_uniform(&random, -3, 3)), s;
        int32_t passed;
        cairn_real misfit;

        wall.length = cairn_max(wall.length, CAIRN_REAL(0.4));
        wall.is_short = 0;
        s = continuation(&random, &wall);
        aligner->segments[0] = wall;
        aligner->segment_count = 1;
        aligner->move.home = 0;
        aligner->joint.round = i % 6;
        assign_all(aligner);
        misfit = cairn_aligner_wall_distance(aligner, &s, &aligner->walls[0]);
        assert_int_equal(find_wall(aligner, &s, &passed), misfit >= 0 ? 0 : -1);
        fitting += misfit >= 0;
        far += misfit >= CAIRN_REAL(0.2); /* over more than 3 m */
    }
    assert_in_range(fitting, 2000, 38000);
    assert_true(far > 100);
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tiles_find_what_a_linear_search_finds),
        cmocka_unit_test(kept_walls_are_found_where_they_are),
        cmocka_unit_test(what_fits_is_found),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
