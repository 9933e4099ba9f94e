/* Skeletons of images: bars, rings, branches; slopes, pairs compared with a reference
 * implementation, degenerate images, budgets. */
#include "tests/skeleton_scene.h"

/* Edgels a pixel apart along a line, the bright side to the left of the direction (y up). */
static void add_line(double ax, double ay, double bx, double by)
{
    double length = hypot(bx - ax, by - ay), ux = (bx - ax) / length, uy = (by - ay) / length;

    for (double t = 0.5; t < length; t += 1)
        add(ax + t * ux, ay + t * uy, -uy, ux);
}

/* A bright bar about an axis from a to b, without ends. */
static void add_bar(double ax, double ay, double bx, double by, double r)
{
    double length = hypot(bx - ax, by - ay), ux = (bx - ax) / length, uy = (by - ay) / length;

    add_line(ax + uy * r, ay - ux * r, bx + uy * r, by - ux * r);
    add_line(bx - uy * r, by + ux * r, ax - uy * r, ay + ux * r);
}

static void add_arc(double cx, double cy, double r, double from, double to, double inward)
{
    double step = 1 / r;

    for (double t = from + step / 2; t < to; t += step)
        add(cx + r * cos(t), cy + r * sin(t), -inward * cos(t), -inward * sin(t));
}

static cairn_skeleton_grouping_params small_params(void)
{
    cairn_skeleton_grouping_params params = cairn_skeleton_grouping_default();

    params.max_width = WIDTH;
    params.max_height = HEIGHT;
    params.max_edgels = MAX_COUNT;
    params.max_centres = 2000;
    params.max_lines = 64;
    params.max_parts = 32;
    params.max_points = 2000;
    return params;
}

/* Invariants of every result. */
static void check(const cairn_skeleton_grouping_result *r, const cairn_skeleton_grouping_params *p)
{
    int32_t points = 0, parts = 0;

    for (int32_t i = 0; i < r->part_count; i++) {
        const cairn_skeleton_grouping_part *part = &r->parts[i];

        assert_int_equal(part->first, points);
        assert_true(part->count >= 3);
        assert_true(part->log_odds >= p->min_log_odds);
        assert_true(i == 0 || part->log_odds <= r->parts[i - 1].log_odds);
        assert_true(part->object >= 0 && part->object < r->object_count);
        for (int32_t end = 0; end < 2; end++)
            assert_true(part->joint[end] == -1 ||
                        (part->joint[end] >= 0 && part->joint[end] < r->point_count &&
                         (part->joint[end] < part->first ||
                          part->joint[end] >= part->first + part->count)));
        points += part->count;
    }
    assert_int_equal(points, r->point_count);
    for (int32_t i = 0; i < r->point_count; i++) {
        const cairn_skeleton_grouping_point *q = &r->points[i];

        assert_true(q->radius > 0 && q->radius < 1000);
        for (int32_t side = 0; side < 2; side++) {
            assert_true(q->edgel[side] >= -1 && q->edgel[side] < edgel_count);
            if (q->edgel[side] >= 0)
                assert_memory_equal(&q->contact[side], &edgels[q->edgel[side]].position,
                                    sizeof q->contact[side]);
        }
    }
    for (int32_t o = 0; o < r->object_count; o++) {
        int32_t members = 0, ends = 0;
        double sum = 0;

        for (int32_t i = 0; i < r->part_count; i++)
            if (r->parts[i].object == o) {
                members++;
                ends += (r->parts[i].joint[0] < 0) + (r->parts[i].joint[1] < 0);
                sum += (double)r->parts[i].log_odds;
            }
        assert_true(members > 0);
        assert_int_equal(r->objects[o].part_count, members);
        assert_int_equal(r->objects[o].free_end_count, ends);
        assert_near(r->objects[o].log_odds, sum, NUMBER(1e-9, 1e-2));
        assert_true(o == 0 || r->objects[o].log_odds <= r->objects[o - 1].log_odds);
        parts += members;
    }
    assert_int_equal(parts, r->part_count);
}

/* ---- What is found ---- */

/* At any angle; from one end of the axis to the other, up to a disc. */
static void a_bar_has_its_axis(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);

    (void)state;
    for (int32_t k = 0; k < 6; k++) {
        double turn = 0.5 * k, r = 5 + 1.5 * k, c = cos(turn), s = sin(turn), least = 1e9,
               most = -1e9;
        cairn_skeleton_grouping_result found;

        edgel_count = 0;
        add_bar(100 - 45 * c, 80 - 45 * s, 100 + 45 * c, 80 + 45 * s, r);
        found = run(f.skeleton, 0.8 * r, 1.2 * r);
        check(&found, &params);
        assert_int_equal(found.part_count, 1);
        assert_int_equal(found.object_count, 1);
        assert_int_equal(found.objects[0].free_end_count, 2);
        assert_true(found.centre_count > 60 && found.line_count >= 1 && found.seed_count >= 1);
        assert_near(found.min_radius, 0.8 * r, 1e-5);
        assert_near(found.max_radius, 1.2 * r, 1e-5);
        for (int32_t i = 0; i < found.point_count; i++) {
            const cairn_skeleton_grouping_point *q = &found.points[i];
            double x = (double)q->centre.x - 100, y = (double)q->centre.y - 80;

            assert_near(c * y - s * x, 0, 0.4);
            assert_near(q->radius, r, 0.4);
            least = fmin(least, c * x + s * y);
            most = fmax(most, c * x + s * y);
        }
        assert_true(least < -45 + r && most > 45 - r);
        /* Contact points stay on their sides, first to the left of the direction (y up). */
        for (int32_t i = 0; i + 1 < found.point_count; i++) {
            cairn_vec2 way = cairn_vec2_sub(found.points[i + 1].centre, found.points[i].centre);

            for (int32_t side = 0; side < 2; side++) {
                cairn_vec2 out =
                    cairn_vec2_sub(found.points[i].contact[side], found.points[i].centre);

                assert_true(cairn_vec2_cross(way, out) * (side == 0 ? 1 : -1) > 0);
            }
        }
    }
    test_pool_free(&f.pool);
}

static void a_bent_band_has_a_bent_axis(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);
    cairn_skeleton_grouping_result found;
    double first = 9, last = -9;

    (void)state;
    add_arc(100, 20, 62, 0.4, 2.7, 1);
    add_arc(100, 20, 48, 0.4, 2.7, -1);
    found = run(f.skeleton, 5, 9);
    check(&found, &params);
    assert_int_equal(found.part_count, 1);
    for (int32_t i = 0; i < found.point_count; i++) {
        double x = (double)found.points[i].centre.x - 100,
               y = (double)found.points[i].centre.y - 20;

        assert_near(hypot(x, y), 55, 0.7);
        assert_near(found.points[i].radius, 7, 0.5);
        first = fmin(first, atan2(y, x));
        last = fmax(last, atan2(y, x));
    }
    assert_true(first < 0.6 && last > 2.5);
    test_pool_free(&f.pool);
}

/* A limb of 24 px joins a bar: one object with three free ends. */
static void limbs_join(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);
    cairn_skeleton_grouping_result found;

    (void)state;
    add_line(30, 70, 170, 70);
    add_line(170, 90, 105, 90);
    add_line(95, 90, 30, 90);
    add_line(105, 90, 105, 140);
    add_line(95, 140, 95, 90);
    found = run(f.skeleton, 4, 12);
    check(&found, &params);
    assert_int_equal(found.part_count, 2);
    assert_int_equal(found.object_count, 1);
    assert_int_equal(found.objects[0].free_end_count, 3);
    assert_near(found.points[found.parts[0].first + 3].radius, 10, 1);
    assert_near(found.points[found.parts[1].first + 3].radius, 5, 1);
    test_pool_free(&f.pool);
}

/* A dark bar that joins a bright one is not a limb of it. */
static void dark_and_bright_do_not_join(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);
    cairn_skeleton_grouping_result found;

    (void)state;
    add_line(30, 70, 170, 70);
    add_line(170, 90, 105, 90);
    add_line(95, 90, 30, 90);
    add_line(105, 140, 105, 90);
    add_line(95, 90, 95, 140);
    found = run(f.skeleton, 4, 12);
    check(&found, &params);
    assert_int_equal(found.part_count, 2);
    assert_int_equal(found.object_count, 2);
    test_pool_free(&f.pool);
}

/* One side is hidden for an interval: the contour is extrapolated there, and the axis is
 * continuous. */
static void gaps_are_bridged(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);
    cairn_skeleton_grouping_result found;
    int32_t carried = 0;

    (void)state;
    add_line(40, 70, 160, 70);
    add_line(160, 86, 106, 86);
    add_line(94, 86, 40, 86);
    found = run(f.skeleton, 6, 10);
    check(&found, &params);
    assert_int_equal(found.part_count, 1);
    for (int32_t i = 0; i < found.point_count; i++) {
        assert_near(found.points[i].centre.y, 78, 1);
        carried += found.points[i].edgel[0] < 0 || found.points[i].edgel[1] < 0;
    }
    assert_true(carried >= 1 && carried <= 5);
    test_pool_free(&f.pool);
}

/* A contour has one inside: of the spaces between three lines the one within the range of radii is
 * taken. */
static void a_contour_belongs_to_one_part(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);
    cairn_skeleton_grouping_result found;

    (void)state;
    add_line(40, 60, 160, 60);
    add_line(160, 76, 40, 76);
    add_line(40, 106, 160, 106);
    found = run(f.skeleton, 7, 9);
    check(&found, &params);
    assert_int_equal(found.part_count, 1);
    assert_near(found.points[5].centre.y, 68, 0.5);
    test_pool_free(&f.pool);
}

static void the_range_is_proposed(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);
    cairn_skeleton_grouping_result found;

    (void)state;
    add_bar(20, 40, 180, 40, 9);
    add_bar(20, 110, 180, 120, 9);
    found = run(f.skeleton, 0, 0);
    check(&found, &params);
    assert_true(found.min_radius >= 3 && found.min_radius < 9 && found.max_radius > 9 &&
                found.max_radius < 25);
    assert_int_equal(found.part_count, 2);
    assert_near(found.points[5].radius, 9, 0.5);
    test_pool_free(&f.pool);
}

/* The further a radius is outside the range the lower the part's log odds; beyond the tolerance
 * there is none. */
static void the_range_counts(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);
    cairn_real inside, near;

    (void)state;
    add_bar(40, 80, 160, 80, 10);
    inside = run(f.skeleton, 8, 12).parts[0].log_odds;
    near = run(f.skeleton, 13, 20).parts[0].log_odds;
    assert_true(near < inside - 5);
    assert_int_equal(run(f.skeleton, 20, 24).part_count, 0);
    assert_int_equal(run(f.skeleton, 4, 6).part_count, 0);
    test_pool_free(&f.pool);
}

static void noise_is_no_object(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);
    cairn_skeleton_grouping_result found;

    (void)state;
    add_noise(1500, 4);
    found = run(f.skeleton, 5, 12);
    check(&found, &params);
    assert_true(found.part_count <= 1);
    edgel_count = 0;
    add_noise(500, 5);
    add_bar(40, 80, 160, 80, 9);
    found = run(f.skeleton, 7, 11);
    check(&found, &params);
    assert_true(found.part_count >= 1);
    assert_true(found.parts[0].count > 20);
    for (int32_t i = found.parts[0].first; i < found.parts[0].first + found.parts[0].count; i++)
        assert_near(found.points[i].centre.y, 80, 3);
    test_pool_free(&f.pool);
}

/* Two bars, the second one with other slopes: log odds of the parts of both. */
static void run_two_bars(const cairn_skeleton_grouping_params *params, double slope, double other,
                         double log_odds[2])
{
    struct fixture f = with(*params);
    cairn_skeleton_grouping_result found;
    int32_t half;

    add_bar(40, 40, 160, 40, 9);
    half = edgel_count;
    add_bar(40, 120, 160, 120, 9);
    for (int32_t i = 0; i < edgel_count; i++)
        edgels[i].gradient_magnitude = (cairn_real)(i < half ? slope : other);
    found = run(f.skeleton, 7, 11);
    check(&found, params);
    log_odds[0] = log_odds[1] = 0;
    for (int32_t i = 0; i < found.part_count; i++)
        log_odds[found.points[found.parts[i].first].centre.y > 80] +=
            (double)found.parts[i].log_odds;
    assert_true(log_odds[0] > 0 && log_odds[1] > 0);
    test_pool_free(&f.pool);
}

/* The steeper one is likelier, by its slopes alone, where slopes are known and used. */
static void steep_edges_stand_out(void **state)
{
    static const double unknown[3][2] = {{0, 0}, {0, -1}, {-1, 90}};
    cairn_skeleton_grouping_params params = small_params();
    double even[2], odds[2];

    (void)state;
    params.contrast_weight = 2;
    run_two_bars(&params, 10, 10, even);
    for (int32_t way = 0; way < 3; way++) {
        run_two_bars(&params, unknown[way][0], unknown[way][1], odds);
        assert_near(odds[0], even[0], 1e-3 * even[0]);
        assert_near(odds[1], even[1], 1e-3 * even[1]);
    }
    /* The mean is 30: log 3 more for one and less for the other, twice, for at least every 3 px of
     * the axis. */
    run_two_bars(&params, 10, 90, odds);
    assert_true(odds[1] > even[1] + 2 * log(3) * 38);
    assert_true(odds[0] < even[0] - 2 * log(3) * 38);
    params.contrast_weight = 0;
    run_two_bars(&params, 10, 90, odds);
    assert_near(odds[0], even[0], 1e-3 * even[0]);
    assert_near(odds[1], even[1], 1e-3 * even[1]);
}

/* Starts on isolated pairs of edgels, far apart in a draughtboard, after equal ones: the slopes of
 * the white squares' pairs, and of both sides of the black ones. */
static int32_t starts_of(double contrast, double white, double left, double right)
{
    cairn_skeleton_grouping_params params = small_params();
    cairn_skeleton_grouping_result found;
    struct fixture f;

    params.contrast_weight = (cairn_real)contrast;
    f = with(params);
    for (int32_t i = 0; i < 20; i++) {
        int32_t column = i % 5, row = i / 5;

        add(20 + 40 * column - 6, 20 + 40 * row, 1, 0);
        add(20 + 40 * column + 6, 20 + 40 * row, -1, 0);
    }
    (void)run(f.skeleton, 5, 8);
    for (int32_t i = 0; i < edgel_count; i++)
        edgels[i].gradient_magnitude = (cairn_real)(i / 2 % 2 ? white : i % 2 ? right : left);
    found = run(f.skeleton, 5, 8);
    check(&found, &params);
    test_pool_free(&f.pool);
    return found.seed_count;
}

/* Faint CPs do not take the starts from those with steep edges on both sides; where slopes do not
 * count they are equal. */
static void walks_start_where_edges_are_steep(void **state)
{
    int32_t all = starts_of(6, 10, 10, 10);

    (void)state;
    assert_in_range(all, 20, 40);
    assert_int_equal(starts_of(0, 3, 30, 30), all);
    assert_int_equal(starts_of(6, 300, 3000, 3000), all / 2);
    assert_int_equal(starts_of(6, 10, 1, 30), all / 2);
    assert_int_equal(starts_of(6, 10, 30, 1), all / 2);
}

/* ---- The reference implementation: every edgel with every other ---- */

/* The cost of a pair by definition; 4: none. */
static double reference_cost(const cairn_edgel *a, double sense, const cairn_edgel *b, double low,
                             double high, double sigma)
{
    double dx = (double)(b->position.x - a->position.x),
           dy = (double)(b->position.y - a->position.y);
    double length = hypot(dx, dy), nx = sense * (double)a->normal.x,
           ny = sense * (double)a->normal.y;
    double mx = (double)b->normal.x, my = (double)b->normal.y, p, q, r, other = 1, along;

    if (!(length > 0))
        return 4;
    if (mx * dx + my * dy > 0) {
        mx = -mx;
        my = -my;
        other = -1;
    }
    p = (nx * dx + ny * dy) / length;
    q = -(mx * dx + my * dy) / length;
    if (p < 0.82 || q < 0.82 || length > 2 * high)
        return 4;
    r = length / (p + q);
    if (r < low || r > high)
        return 4;
    along = 2 * p / length;
    return (1 - (nx - along * dx) * mx - (ny - along * dy) * my) / (4 * sigma * sigma) +
           (other != sense ? 1.5 : 0) + (r - low) / (high - low + 1);
}

static void centres_are_those_of_all_pairs(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);

    (void)state;
    for (uint64_t seed = 1; seed <= 4; seed++) {
        double low = 5 / 1.6, high = 11 * 1.25;
        int32_t expected = 0;

        edgel_count = 0;
        add_noise(seed == 4 ? 600 : 300, 10 + seed);
        for (int32_t i = 0; i < edgel_count; i++)
            for (int32_t k = 0; k < 2; k++) {
                double best = 4;

                for (int32_t j = 0; j < edgel_count; j++)
                    best = fmin(best, reference_cost(&edgels[i], k ? 1 : -1, &edgels[j], low, high,
                                                     (double)params.symmetry_sigma));
                expected += best < 4;
            }
        assert_true(expected > 20);
        assert_int_equal(run(f.skeleton, 5, 11).centre_count, expected);
    }
    test_pool_free(&f.pool);
}

/* ---- Degenerate images ---- */

static void little_or_nothing(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);
    cairn_skeleton_grouping_result found = run(f.skeleton, 5, 10);

    (void)state;
    assert_int_equal(found.part_count, 0);
    assert_int_equal(found.centre_count, 0);
    found = run(f.skeleton, 0, 0);
    assert_int_equal(found.part_count, 0);
    add(10, 10, 1, 0);
    found = run(f.skeleton, 5, 10);
    assert_int_equal(found.part_count, 0);
    assert_nothing_at_one_place(f.skeleton);
    place_far_edgels();
    found = run(f.skeleton, 5, 10);
    check(&found, &params);
    test_pool_free(&f.pool);
}

/* A circle has no axis to follow; a square has the axes between its sides; both end. */
static void circles_and_squares(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);
    cairn_skeleton_grouping_result found;

    (void)state;
    add_arc(100, 80, 12, 0, 2 * PI, 1);
    found = run(f.skeleton, 9, 15);
    check(&found, &params);
    for (int32_t i = 0; i < found.point_count; i++)
        assert_near(
            hypot((double)found.points[i].centre.x - 100, (double)found.points[i].centre.y - 80), 0,
            12);
    edgel_count = 0;
    add_line(80, 60, 120, 60);
    add_line(120, 60, 120, 100);
    add_line(120, 100, 80, 100);
    add_line(80, 100, 80, 60);
    found = run(f.skeleton, 16, 24);
    check(&found, &params);
    assert_true(found.part_count >= 1);
    /* A ring: the walk ends after one round. */
    edgel_count = 0;
    add_arc(100, 80, 60, 0, 2 * PI, 1);
    add_arc(100, 80, 46, 0, 2 * PI, -1);
    found = run(f.skeleton, 5, 9);
    check(&found, &params);
    assert_true(found.part_count >= 1 && found.part_count <= 3);
    test_pool_free(&f.pool);
}

static void draw_scene(void)
{
    edgel_count = 0;
    add_line(30, 50, 170, 50);
    add_line(170, 70, 105, 70);
    add_line(95, 70, 30, 70);
    add_line(105, 70, 105, 120);
    add_line(95, 120, 95, 70);
    add_arc(40, 120, 14, 0, 2 * PI, 1);
    add_noise(300, 8);
}

/* Small capacities of every kind: what exceeds them is left out. */
static void small_capacities(void **state)
{
    (void)state;
    for (int32_t k = 0; k < 6; k++) {
        cairn_skeleton_grouping_params params = small_params();
        int32_t *field[] = {&params.max_lines, &params.max_parts,      &params.max_points,
                            &params.max_steps, &params.particle_count, &params.max_centres};
        cairn_skeleton_grouping_result found;
        struct fixture f;

        *field[k] = k == 2 ? 200 : k == 5 ? 40 : 1;
        f = with(params);
        draw_scene();
        found = run(f.skeleton, 4, 12);
        check(&found, &params);
        assert_true(k != 1 || found.part_count <= 1);
        assert_true(k != 5 || found.centre_count <= 40);
        assert_true(k != 0 || found.seed_count <= 1);
        test_pool_free(&f.pool);
    }
}

/* Each edgel examined may be in two CPs. */
static void few_centres(void **state)
{
    (void)state;
    for (int32_t most = 1; most < 12; most++) {
        cairn_skeleton_grouping_params params = small_params();
        cairn_skeleton_grouping_result found;
        struct fixture f;

        params.max_centres = most;
        f = with(params);
        draw_scene();
        found = run(f.skeleton, 4, 12);
        check(&found, &params);
        assert_in_range(found.centre_count, 0, most);
        test_pool_free(&f.pool);
    }
}

/* Exceeded capacities are reported. */
static void starts_are_left_out(void **state)
{
    (void)state;
    for (int32_t k = 0; k < 3; k++) {
        cairn_skeleton_grouping_params params = small_params();
        cairn_skeleton_grouping_result found;
        struct fixture f;

        params.max_parts = k == 1 ? 1 : 256;
        params.max_points = k == 2 ? 2 * params.max_steps : 16384;
        f = with(params);
        draw_scene();
        found = run(f.skeleton, 4, 12);
        assert_int_equal(found.dropped_seed_count > 0, k > 0);
        if (k == 0)
            assert_true(found.seed_count > 1);
        else
            assert_int_equal(found.seed_count, k == 1 ? 1 : 0);
        test_pool_free(&f.pool);
    }
}

/* ---- Budgets ---- */

static void budgets_do_not_matter(void **state)
{
    struct fixture f = with(small_params());

    (void)state;
    draw_scene();
    assert_golden(assert_any_budget(f.skeleton), UINT64_C(0x22fa587d56325c94),
                  UINT64_C(0x4a23900f43a3e468));
    test_pool_free(&f.pool);
}

static void it_begins_anew(void **state)
{
    struct fixture f = with(small_params());
    test_stepped object = {begin_scene, step_scene, result_hash, f.skeleton};

    (void)state;
    draw_scene();
    test_begins_anew(&object, 9);
    test_pool_free(&f.pool);
}

/* No slopes of the image before remain. */
static void steepness_is_of_the_image(void **state)
{
    static const double slopes[] = {1, 3, 17.3, NUMBER(1e300, 1e30), NUMBER(1e-300, 1e-30)};
    struct fixture f = with(small_params());
    uint64_t first = 0;

    (void)state;
    for (size_t k = 0; k < sizeof slopes / sizeof *slopes; k++) {
        edgel_count = 0;
        add(WIDTH / 2.0, HEIGHT / 2.0, 1, 0);
        edgels[0].gradient_magnitude = (cairn_real)slopes[k];
        (void)run(f.skeleton, 4, 12);
        edgel_count = 0;
        draw_scene();
        (void)run(f.skeleton, 4, 12);
        first = k == 0 ? result_hash(f.skeleton) : first;
        assert_int_equal(result_hash(f.skeleton), first);
    }
    test_pool_free(&f.pool);
}

/* ---- Refusals ---- */

static void bad_input_is_refused(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_skeleton_grouping_input good, in;
    const struct {
        cairn_real *field;
        double bad;
        cairn_status status;
    } reals[] = {{&in.min_radius, 0.99, CAIRN_BAD_ARGUMENT},
                 {&in.min_radius, 13, CAIRN_BAD_ARGUMENT},
                 {&in.min_radius, -1, CAIRN_BAD_ARGUMENT},
                 {&in.max_radius, 0, CAIRN_BAD_ARGUMENT},
                 {&in.min_radius, (double)NAN, CAIRN_NOT_FINITE},
                 {&in.max_radius, (double)NAN, CAIRN_NOT_FINITE},
                 {&in.max_radius, (double)INFINITY, CAIRN_NOT_FINITE}};
    const struct {
        int32_t *field, bad;
        cairn_status status;
    } counts[] = {{&in.count, -1, CAIRN_BAD_ARGUMENT},  {&in.width, 0, CAIRN_BAD_ARGUMENT},
                  {&in.height, 0, CAIRN_BAD_ARGUMENT},  {&in.width, WIDTH + 1, CAIRN_FULL},
                  {&in.height, HEIGHT + 1, CAIRN_FULL}, {&in.count, MAX_COUNT + 1, CAIRN_FULL}};
    uint64_t before;

    (void)state;
    draw_scene();
    (void)run(f.skeleton, 4, 12);
    before = result_hash(f.skeleton);
    good = input_of(4, 12);
    for (size_t k = 0; k < sizeof reals / sizeof *reals; k++) {
        in = good;
        *reals[k].field = (cairn_real)reals[k].bad;
        assert_status(cairn_skeleton_grouping_begin(f.skeleton, &in), reals[k].status);
    }
    for (size_t k = 0; k < sizeof counts / sizeof *counts; k++) {
        in = good;
        *counts[k].field = counts[k].bad;
        assert_status(cairn_skeleton_grouping_begin(f.skeleton, &in), counts[k].status);
    }
    in = good;
    in.edgels = NULL;
    assert_status(cairn_skeleton_grouping_begin(f.skeleton, &in), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_skeleton_grouping_begin(f.skeleton, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_skeleton_grouping_begin(NULL, &good), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_skeleton_grouping_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_skeleton_grouping_step(f.skeleton, NULL), CAIRN_BAD_ARGUMENT);
    assert_int_equal(cairn_skeleton_grouping_read(NULL).part_count, 0);
    assert_true(result_hash(f.skeleton) == before);
    for (int32_t k = 0; k < 5; k++) {
        cairn_real *field[] = {&edgels[9].position.x, &edgels[9].position.y, &edgels[9].normal.x,
                               &edgels[9].normal.y, &edgels[9].gradient_magnitude};
        cairn_real kept = *field[k];

        *field[k] = (cairn_real)(k % 2 ? NAN : INFINITY);
        assert_ok(cairn_skeleton_grouping_begin(f.skeleton, &good));
        assert_status(cairn_skeleton_grouping_step(f.skeleton, &budget), CAIRN_NOT_FINITE);
        assert_int_equal(cairn_skeleton_grouping_read(f.skeleton).part_count, 0);
        assert_ok(cairn_skeleton_grouping_step(f.skeleton, &budget));
        *field[k] = kept;
    }
    in = good;
    in.edgels = NULL;
    in.count = 0;
    assert_ok(cairn_skeleton_grouping_begin(f.skeleton, &in));
    assert_ok(cairn_skeleton_grouping_step(f.skeleton, &budget));
    test_pool_free(&f.pool);
}

static void memory_is_exactly_as_stated(void **state)
{
    cairn_skeleton_grouping_params params = small_params();

    (void)state;
    params.max_width = params.max_height = 20;
    params.max_edgels = params.max_centres = params.max_points = 9;
    params.max_lines = params.max_parts = params.max_steps = params.particle_count = 2;
    test_every_pool_size(create_in, &params, cairn_skeleton_grouping_memory(&params));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_bar_has_its_axis),
        cmocka_unit_test(a_bent_band_has_a_bent_axis),
        cmocka_unit_test(limbs_join),
        cmocka_unit_test(dark_and_bright_do_not_join),
        cmocka_unit_test(gaps_are_bridged),
        cmocka_unit_test(a_contour_belongs_to_one_part),
        cmocka_unit_test(the_range_is_proposed),
        cmocka_unit_test(the_range_counts),
        cmocka_unit_test(noise_is_no_object),
        cmocka_unit_test(steep_edges_stand_out),
        cmocka_unit_test(walks_start_where_edges_are_steep),
        cmocka_unit_test(centres_are_those_of_all_pairs),
        cmocka_unit_test(little_or_nothing),
        cmocka_unit_test(circles_and_squares),
        cmocka_unit_test(small_capacities),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(it_begins_anew),
        cmocka_unit_test(steepness_is_of_the_image),
        cmocka_unit_test(few_centres),
        cmocka_unit_test(starts_are_left_out),
        cmocka_unit_test(bad_input_is_refused),
        cmocka_unit_test(memory_is_exactly_as_stated),
    };
    return cmocka_run_group_tests_name("skeleton_grouping", tests, NULL, NULL);
}
