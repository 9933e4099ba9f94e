/* Simulated arenas: bodies, walls, reachability, scenes, options, refusals. */
#include "tests/surveys.h"

enum { SEEDS = 3 };

static const double pi = 3.14159265358979323846;

static uint64_t hash_of(const sim_arena *arena)
{
    int32_t bodies, edges;
    const sim_body *body = sim_arena_bodies(arena, &bodies);
    const sim_edge *edge = sim_arena_edges(arena, &edges);
    uint64_t hash = TEST_HASH_START;

    for (int32_t i = 0; i < bodies; i++)
        hash = test_hash(hash, &body[i].centre, sizeof body[i].centre);
    for (int32_t i = 0; i < edges; i++)
        hash = test_hash(hash, &edge[i].a, 2 * sizeof edge[i].a);
    return hash;
}

static void test_scene_table(void **state)
{
    (void)state;
    for (sim_scene scene = 0; scene < SIM_SCENES; scene++) {
        double width, height;

        assert_int_equal(sim_scene_find(sim_scene_name(scene)), scene);
        assert_true(strlen(sim_scene_about(scene)) > 10);
        sim_scene_size(scene, &width, &height);
        if (scene == SIM_HOSPITAL)
            assert_true(width == 60 && height == 48);
        else
            assert_true(width >= 9 && width <= 24 && height >= 2 && height <= 14);
        assert_in_range(sim_scene_places(scene), 5, 24);
    }
    assert_int_equal(sim_scene_find("castle"), -1);
    assert_null(sim_scene_name(-1));
    assert_null(sim_scene_name(SIM_SCENES));
    assert_null(sim_scene_about(SIM_SCENES));
    assert_int_equal(sim_scene_places(-1), 0);
    assert_string_equal(sim_scene_name(SIM_RESCUE), "rescue");
    assert_string_equal(sim_scene_name(SIM_ROUND), "round");
    assert_int_equal(sim_scene_places(SIM_RESCUE), 15);
    assert_int_equal(sim_scene_places(SIM_ROOMS), 5);
}

static void expect_fault(sim_arena_options options, const char *what)
{
    char fault[200] = "";

    assert_null(sim_arena_create(&options, fault, sizeof fault));
    assert_ptr_equal(strstr(fault, what), fault);
    assert_non_null(strstr(fault, ", expected "));
    assert_null(sim_arena_create(&options, NULL, 0));
}

static void test_bad_options(void **state)
{
    sim_arena_options good = sim_arena_default(), bad;

    (void)state;
    bad = good;
    bad.scene = SIM_SCENES;
    expect_fault(bad, "scene is 11");
    bad.scene = -1;
    expect_fault(bad, "scene is -1");
    bad = good;
    bad.width = 5.9;
    expect_fault(bad, "width is 5.9 m");
    bad.width = (double)NAN;
    expect_fault(bad, "width");
    bad = good;
    bad.height = 61;
    expect_fault(bad, "height is 61 m");
    bad = good;
    bad.turn = (double)INFINITY;
    expect_fault(bad, "turn");
    bad = good;
    bad.rubble = -0.1;
    expect_fault(bad, "rubble is -0.1");
    sim_arena_free(NULL);
}

static void test_same_seed_same_arena(void **state)
{
    (void)state;
    for (sim_scene scene = 0; scene < SIM_SCENES; scene++) {
        sim_arena *first = arena_of(scene, 5), *again = arena_of(scene, 5),
                  *other = arena_of(scene, 6);

        assert_true(hash_of(first) == hash_of(again));
        assert_true(hash_of(first) != hash_of(other));
        assert_true(sim_arena_options_of(first).turn != sim_arena_options_of(other).turn);
    }
}

/* The rotation moves the arena as a whole; fixed bodies are the same with any amount of rubble. */
static void test_turn_and_rubble_have_streams_of_their_own(void **state)
{
    sim_arena_options options = sim_arena_default();
    sim_arena *straight, *turned, *empty;
    const sim_body *a, *b, *c;
    int32_t count, others, walls = 0;
    double turn = 0.7;

    (void)state;
    options.turn = 0;
    straight = arena_with(&options);
    options.turn = turn;
    turned = arena_with(&options);
    options.turn = 0;
    options.rubble = 0;
    empty = arena_with(&options);
    a = sim_arena_bodies(straight, &count);
    b = sim_arena_bodies(turned, &others);
    c = sim_arena_bodies(empty, &others);
    for (; walls < others; walls++) {
        assert_true(a[walls].kind == SIM_WALL || a[walls].kind == SIM_FURNITURE);
        assert_near(b[walls].centre.x,
                    cos(turn) * a[walls].centre.x - sin(turn) * a[walls].centre.y, 1e-12);
        assert_near(b[walls].centre.y,
                    sin(turn) * a[walls].centre.x + cos(turn) * a[walls].centre.y, 1e-12);
        assert_near(fabs(remainder(b[walls].angle - a[walls].angle - turn, 2 * pi)), 0, 1e-12);
        assert_memory_equal(&c[walls].centre, &a[walls].centre, sizeof a[walls].centre);
    }
    assert_true(count > walls + 30);
    assert_true(a[walls].kind >= SIM_BOX);
}

/* Edges: closed outlines, unit normals that point outward, free side on the left. */
static void test_edges(void **state)
{
    (void)state;
    for (sim_scene scene = 0; scene < SIM_SCENES; scene++) {
        sim_arena *arena = arena_of(scene, 2);
        int32_t bodies, edges, next = 0, curved = 0, flat = 0;
        const sim_body *body = sim_arena_bodies(arena, &bodies);
        const sim_edge *edge = sim_arena_edges(arena, &edges);

        for (int32_t i = 0; i < bodies; i++) {
            assert_int_equal(body[i].first_edge, next);
            next += body[i].edge_count;
            assert_true(body[i].radius > 0 ? body[i].edge_count == 1 : body[i].edge_count >= 4);
            for (int32_t k = body[i].first_edge; k < next; k++) {
                const sim_edge *e = &edge[k],
                               *after = k + 1 < next ? e + 1 : &edge[body[i].first_edge];
                double x = e->b.x - e->a.x, y = e->b.y - e->a.y, whole = sqrt(x * x + y * y);

                assert_int_equal(e->body, i);
                assert_near(e->radius, body[i].radius, 0);
                if (e->radius > 0) {
                    assert_int_equal(e->curved, 1);
                    curved++;
                    continue;
                }
                curved += e->curved && x * x + y * y > 0.15 * 0.15;
                flat += !e->curved;
                assert_true(whole > 0.02);
                assert_near(e->normal.x, -y / whole, 1e-12);
                assert_near(e->normal.y, x / whole, 1e-12);
                assert_true((e->a.x - body[i].centre.x) * e->normal.x +
                                (e->a.y - body[i].centre.y) * e->normal.y >
                            0);
                assert_near(e->b.x, after->a.x, 1e-12);
                assert_near(e->b.y, after->a.y, 1e-12);
            }
            if (body[i].kind == SIM_WALL) { /* two long sides, 0.1 m apart */
                const sim_edge *e = &edge[body[i].first_edge];
                double one = hypot(e[0].b.x - e[0].a.x, e[0].b.y - e[0].a.y);
                double two = hypot(e[1].b.x - e[1].a.x, e[1].b.y - e[1].a.y);

                assert_int_equal(body[i].edge_count, 4);
                assert_near(fmin(fabs(one - 0.1), fabs(two - 0.1)), 0, 1e-9);
            }
        }
        assert_int_equal(next, edges);
        assert_true(scene == SIM_ROUND ? curved > 60 && flat == 0 : curved == 0 && flat > 0);
    }
}

/* Depth to which two bodies overlap, by their edges alone; negative: their gap along the best
 * axis. */
static double overlap_along(const sim_edge *e, const sim_body *other, const sim_edge *edges)
{
    double nearest = 1e9;

    for (int32_t k = other->first_edge; k < other->first_edge + other->edge_count; k++)
        nearest = fmin(nearest, (edges[k].a.x - e->a.x) * e->normal.x +
                                    (edges[k].a.y - e->a.y) * e->normal.y - edges[k].radius);
    return -nearest;
}

static double overlap(const sim_body *a, const sim_body *b, const sim_edge *edges)
{
    double x = b->centre.x - a->centre.x, y = b->centre.y - a->centre.y, least = 1e9;
    const sim_body *bodies[2] = {a, b};

    if (a->radius > 0 && b->radius > 0)
        return a->radius + b->radius - sqrt(x * x + y * y);
    for (int32_t i = 0; i < 2; i++)
        for (int32_t k = bodies[i]->first_edge; k < bodies[i]->first_edge + bodies[i]->edge_count;
             k++) {
            const sim_edge *e = &edges[k], *corner;

            if (e->radius == 0) {
                least = fmin(least, overlap_along(e, bodies[1 - i], edges));
                continue;
            }
            /* A disc: the axes from its centre to the corners of the other body. */
            for (int32_t c = bodies[1 - i]->first_edge;
                 c < bodies[1 - i]->first_edge + bodies[1 - i]->edge_count; c++) {
                double far = 1e9, whole;

                corner = &edges[c];
                whole = hypot(corner->a.x - e->a.x, corner->a.y - e->a.y);
                for (int32_t q = bodies[1 - i]->first_edge;
                     q < bodies[1 - i]->first_edge + bodies[1 - i]->edge_count; q++)
                    far = fmin(far, ((edges[q].a.x - e->a.x) * (corner->a.x - e->a.x) +
                                     (edges[q].a.y - e->a.y) * (corner->a.y - e->a.y)) /
                                        whole);
                least = fmin(least, e->radius - far);
            }
        }
    return least;
}

static void test_rubble(void **state)
{
    int32_t bins[9] = {0}, loose = 0, discs = 0;

    (void)state;
    for (uint64_t seed = 1; seed <= 4; seed++)
        for (sim_scene scene = 0; scene < SIM_SCENES; scene++) {
            sim_arena *arena = arena_of(scene, seed);
            int32_t count, edge_count, here = 0;
            const sim_body *body = sim_arena_bodies(arena, &count);
            const sim_edge *edges = sim_arena_edges(arena, &edge_count);

            for (int32_t i = 0; i < count; i++) {
                if (body[i].kind != SIM_BOX && body[i].kind != SIM_RUBBLE)
                    continue;
                here++;
                discs += body[i].radius > 0;
                for (int32_t k = 0; k < count; k++)
                    if (k != i && overlap(&body[i], &body[k], edges) >= 0.005)
                        fail_msg("bodies %d and %d of %s overlap by %g", (int)i, (int)k,
                                 sim_scene_name(scene), overlap(&body[i], &body[k], edges));
                if (scene == SIM_RESCUE) {
                    double angle =
                        fmod(body[i].angle - sim_arena_options_of(arena).turn + 20 * pi, pi / 2);

                    bins[(int)(angle / (pi / 2) * 9) % 9]++;
                    loose++;
                }
            }
            if (scene == SIM_RESCUE || scene == SIM_ROUND)
                assert_in_range(here, 20, 200);
        }
    /* Nine bins of 10 degrees relative to the walls: none empty, none with more than twice its
     * share. */
    assert_true(loose > 120 && discs > 20);
    for (int32_t i = 0; i < 9; i++)
        assert_in_range(bins[i], loose / 27, 2 * loose / 9);
}

/* Nearest edge by hand. */
static void test_clearance(void **state)
{
    sim_arena *arena = arena_of(SIM_CORRIDOR, 3);
    sim_arena_options o = sim_arena_options_of(arena);
    double c = cos(o.turn), s = sin(o.turn);
    sim_point middle = {0, 0}, side = {-0.7 * s, 0.7 * c}, in_wall = {-s, c},
              corner = {11.75 * c - 0.65 * s, 11.75 * s + 0.65 * c};
    sim_point outside = {-2 * s, 2 * c}, far = {100, 0};

    (void)state;
    assert_near(o.width, 24, 0);
    assert_near(o.height, 2, 0);
    assert_near(sim_arena_clearance(arena, middle), 0.95, 1e-9);
    assert_near(sim_arena_clearance(arena, side), 0.25, 1e-9);
    assert_near(sim_arena_clearance(arena, in_wall), -0.05, 1e-9);
    assert_near(sim_arena_clearance(arena, corner), 0.2, 1e-9);
    assert_int_equal(sim_arena_reachable(arena, middle), 1);
    assert_int_equal(sim_arena_reachable(arena, side), 0);
    assert_int_equal(sim_arena_reachable(arena, in_wall), 0);
    assert_int_equal(sim_arena_reachable(arena, outside), 0);
    assert_int_equal(sim_arena_reachable(arena, far), 0);
}

/* A robot reaches most of every arena: the reachable part by sampling, as a share of the whole
 * rectangle. */
static void test_reachable_share(void **state)
{
    static const double least[SIM_SCENES] = {0.28, 0.22, 0.5, 0.2, 0.2, 0.55, 0.25, 0.2, 0.3, 0.15};

    (void)state;
    for (uint64_t seed = 1; seed <= 5; seed++)
        for (sim_scene scene = 0; scene < SIM_SCENES; scene++) {
            sim_arena *arena = arena_of(scene, seed);
            sim_arena_options o = sim_arena_options_of(arena);
            int32_t inside = 0, all = 0;

            for (double x = -o.width / 2; x < o.width / 2; x += 0.1)
                for (double y = -o.height / 2; y < o.height / 2; y += 0.1) {
                    sim_point p = {cos(o.turn) * x - sin(o.turn) * y,
                                   sin(o.turn) * x + cos(o.turn) * y};

                    all++;
                    if (!sim_arena_reachable(arena, p))
                        continue;
                    inside++;
                    if (inside % 50 == 0)
                        assert_true(sim_arena_clearance(arena, p) > 0.3 - 0.071);
                }
            if (inside < least[scene] * all)
                fail_msg("%s %d: %g reachable", sim_scene_name(scene), (int)seed,
                         (double)inside / all);
        }
}

static void test_sizes(void **state)
{
    sim_arena_options options = sim_arena_default();
    sim_arena *arena;
    int32_t small, large;

    (void)state;
    for (sim_scene scene = 0; scene < SIM_SCENES; scene++) {
        options.scene = scene;
        options.width = 30;
        options.height = 17;
        arena = arena_with(&options);
        assert_non_null(arena);
        assert_near(sim_arena_options_of(arena).width, 30, 0);
        assert_near(sim_arena_options_of(arena).height, 17, 0);
    }
    options.scene = SIM_MAZE;
    arena = arena_with(&options);
    (void)sim_arena_edges(arena, &large);
    options.width = options.height = 5;
    arena = arena_with(&options);
    (void)sim_arena_edges(arena, &small);
    assert_true(large > 4 * small);
}

/* The two rooms of `twins` are equal, the halves of `mirror` mirror images. */
static void test_symmetric_scenes(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= SEEDS; seed++)
        for (sim_scene scene = SIM_TWINS; scene <= SIM_MIRROR; scene++) {
            sim_arena_options options = sim_arena_default();
            sim_arena *arena;
            const sim_body *body;
            int32_t count, matched = 0, wanted = 0;

            options.scene = scene;
            options.seed = seed;
            options.turn = 0;
            arena = arena_with(&options);
            body = sim_arena_bodies(arena, &count);
            for (int32_t i = 0; i < count; i++) {
                sim_point p = body[i].centre, q = p;

                if (scene == SIM_TWINS && body[i].kind != SIM_FURNITURE)
                    continue;
                if (scene == SIM_TWINS)
                    q.x += p.x < 0 ? 0.64 * 14 : -0.64 * 14;
                else
                    q.x = -p.x;
                wanted++;
                for (int32_t k = 0; k < count; k++)
                    if (hypot(body[k].centre.x - q.x, body[k].centre.y - q.y) < 1e-9 &&
                        body[k].kind == body[i].kind) {
                        matched++;
                        break;
                    }
            }
            assert_true(wanted >= 8);
            assert_int_equal(matched, wanted);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_scene_table, surveys_free),
        cmocka_unit_test_teardown(test_bad_options, surveys_free),
        cmocka_unit_test_teardown(test_same_seed_same_arena, surveys_free),
        cmocka_unit_test_teardown(test_turn_and_rubble_have_streams_of_their_own, surveys_free),
        cmocka_unit_test_teardown(test_edges, surveys_free),
        cmocka_unit_test_teardown(test_rubble, surveys_free),
        cmocka_unit_test_teardown(test_clearance, surveys_free),
        cmocka_unit_test_teardown(test_reachable_share, surveys_free),
        cmocka_unit_test_teardown(test_sizes, surveys_free),
        cmocka_unit_test_teardown(test_symmetric_scenes, surveys_free),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
