/* contour_grouping as written: results; each step of a walk compared with its definition by a
 * reference implementation; bad input. */
#include "tests/contour_grouping_hash.h"
#include "tests/contour_scene.h"

#include "cairn/symmetric_point.h"
#include "src/outlines/contour_grouping_variants.h"

enum { SIDES = 8, STEPS = 64 };

static const double flask[SIDES][2] = {{-8, -60}, {8, -60},  {8, -30},   {22, -10},
                                       {22, 60},  {-22, 60}, {-22, -10}, {-8, -30}};

static void add_end(scene *s, double x, double y)
{
    cairn_vec2 end = {(cairn_real)x, (cairn_real)y};

    s->ends[s->end_count++] = end;
}

/* The sides of the flask as segments of about 8 px; its upper corners are ends of strong chains. */
static void add_flask(scene *s, double x, double y)
{
    for (int i = 0; i < SIDES; i++) {
        const double *a = flask[i], *b = flask[(i + 1) % SIDES];

        add_pieces(s, x + a[0], y + a[1], x + b[0], y + b[1]);
    }
    add_end(s, x + flask[0][0], y + flask[0][1]);
    add_end(s, x + flask[1][0], y + flask[1][1]);
}

static cairn_contour_grouping_params small_params(void)
{
    cairn_contour_grouping_params p = cairn_contour_grouping_as_written();

    p.max_width = WIDTH;
    p.max_height = HEIGHT;
    p.max_tokens = MAX_COUNT;
    p.max_points = 8192;
    p.max_steps = STEPS;
    p.particles = 60;
    p.max_objects = 4;
    return p;
}

static finder new_finder(const cairn_contour_grouping_params *params)
{
    return new_finder_of(params, flask, SIDES);
}

static cairn_contour_grouping_input input_of(const finder *f, const scene *s)
{
    cairn_contour_grouping_input in = {.segments = s->lines,
                                       .count = s->count,
                                       .width = WIDTH,
                                       .height = HEIGHT,
                                       .model = &f->model,
                                       .min_size = f->model.size,
                                       .max_size = f->model.size,
                                       .mean_length = 8,
                                       .look_ahead = 16,
                                       .ends = s->ends,
                                       .end_count = s->end_count};

    return in;
}

/* ---- What it finds ---- */

static void a_flask_in_clutter_is_walked_along(void **state)
{
    cairn_contour_grouping_params params = small_params();
    scene s = {.count = 0};
    cairn_contour_grouping_input in;
    cairn_contour_grouping_result r;
    int32_t own, among = 0;
    finder f;

    (void)state;
    params.particles = 300;
    f = new_finder(&params);
    add_flask(&s, 130, 100);
    own = s.count;
    add_clutter(&s, 40, 4, 4, 1);
    in = input_of(&f, &s);
    r = group(&f, &in);
    assert_true(r.object_count >= 1);
    for (int32_t i = 0; i < r.objects[0].count; i++)
        among += r.segments[r.objects[0].first + i] < own;
    assert_true(among >= own * 5 / 10);
    assert_true(among >= r.objects[0].count * 8 / 10);
    assert_near(r.objects[0].origin.x, 130 + (double)f.model.origin.x, 8);
    assert_near(r.objects[0].origin.y, 100 + (double)f.model.origin.y, 14);
    assert_near(r.objects[0].size, f.model.size, 1e-3);
    assert_true(r.objects[0].score > (cairn_real)0.7);
    assert_int_equal(r.token_count, s.count);
    assert_true(r.hypothesis_count > 0 && r.point_count > 0 && r.points_dropped == 0 &&
                r.end_reason != CAIRN_CONTOUR_GROUPING_NO_START);
    assert_near(r.best_evidence, r.objects[0].evidence, 0);
    for (int32_t i = 0; i < r.steps; i++)
        assert_in_range(r.trace[i].particles, 1, params.particles);
    for (int32_t i = 0, first = 0; i < r.object_count; first += r.objects[i++].count)
        assert_int_equal(r.objects[i].first, first);
    test_pool_free(&f.pool);
}

/* Each term changes the posteriors. Without the model only gaps and symmetry cost anything. */
static void terms_can_be_switched_off(void **state)
{
    cairn_real posterior[3];
    scene s = {.count = 0};

    (void)state;
    add_flask(&s, 130, 100);
    add_clutter(&s, 120, 4, 4, 2);
    for (int off = 0; off < 3; off++) {
        cairn_contour_grouping_params params = small_params();
        cairn_contour_grouping_input in;
        cairn_contour_grouping_result r;
        finder f;

        contour_grouping_ablate(&params, off == 1, off == 2);
        f = new_finder(&params);
        in = input_of(&f, &s);
        r = group(&f, &in);
        assert_true(r.object_count >= 1);
        posterior[off] = r.objects[0].evidence;
        test_pool_free(&f.pool);
    }
    assert_true(posterior[0] > 1 && posterior[1] > posterior[0] && posterior[2] != posterior[0]);
}

/* ---- Walks against their definition ---- */

static double reference_normal(double x, double sigma)
{
    return exp(-x * x / (2 * sigma * sigma));
}

/* The log of (2.11), of a step from one disc to the next. */
static double reference_mass(const scene *s, const cairn_contour_grouping_disc *before,
                             const cairn_contour_grouping_disc *d)
{
    double gap = 0, loss = fmax((double)(d->deviation - before->deviation), 0), kept = 0;

    for (int k = 0; k < 2; k++) {
        cairn_segment line = s->lines[d->segment[k]];
        cairn_vec2 from = before->open_end[k],
                   to = hypot((double)(line.a.x - d->open_end[k].x),
                              (double)(line.a.y - d->open_end[k].y)) == 0
                            ? line.b
                            : line.a;

        if (before->segment[k] == d->segment[k])
            kept++;
        else
            gap += hypot((double)(to.x - from.x), (double)(to.y - from.y)) / 2;
    }
    assert_true(kept < 2);
    return kept * log(0.5) + log(reference_normal(gap, 8) * reference_normal(loss, acos(-1) / 4));
}

/* The log of (2.13), the path walked from its first or its last sample. */
static double reference_likelihood(const finder *f, const cairn_contour_grouping_disc *first,
                                   const cairn_contour_grouping_disc *d, int way)
{
    const cairn_shape_model *m = &f->model;
    int32_t n = m->paths[0].count;
    const cairn_shape_model_sample *p = &m->samples[m->paths[0].first];
    double size = (double)m->size, mean = 0, least = 1e9, radius = 0;
    double x = (double)(d->centre.x - first->centre.x) / size,
           y = (double)(d->centre.y - first->centre.y) / size;

    for (int32_t k = 0; k < n; k++)
        mean += (double)p[k].radius / n;
    for (int32_t k = x != 0 || y != 0; k < n; k++) {
        const cairn_shape_model_sample *sample = &p[way ? n - 1 - k : k],
                                       *start = &p[way ? n - 1 : 0];
        double mx = (double)(sample->centre.x - start->centre.x),
               my = (double)(sample->centre.y - start->centre.y);
        double angle = fabs(remainder(atan2(y, x) - atan2(my, mx), 2 * acos(-1)));
        double off =
            (hypot(x, y) * hypot(mx, my) > 0 ? angle : 0) + fabs(hypot(x, y) - hypot(mx, my)) / 0.3;

        if (off < least) {
            least = off;
            radius = (double)sample->radius;
        }
    }
    return log(0.5 * reference_normal(least, 0.7) +
               0.5 * reference_normal(((double)d->radius / size - radius) / mean, 0.2));
}

static double apart(cairn_vec2 a, cairn_vec2 b)
{
    return hypot((double)(a.x - b.x), (double)(a.y - b.y));
}

/* The range of the model's radii, widened by a fifth of their mean on both sides. */
static void model_radii(const finder *f, cairn_real radii[2])
{
    const cairn_shape_model_path *path = &f->model.paths[0];
    cairn_real least = 1, most = 0, sum = 0;

    for (int32_t k = path->first; k < path->first + path->count; k++) {
        least = cairn_min(least, f->model.samples[k].radius);
        most = cairn_max(most, f->model.samples[k].radius);
        sum += f->model.samples[k].radius;
    }
    sum *= (cairn_real)0.2 / (cairn_real)path->count;
    radii[0] = cairn_max(f->model.size * (least - sum), 0);
    radii[1] = f->model.size * (most + sum);
}

/* Every disc is the symmetric point of its segments; every step leads from an open end to an end
 * within the look-ahead, and takes one or two new segments; the posterior is the sum of (2.11) and
 * (2.13), above `stop`, along one of the two ways. Returns the steps that take one. */
static int32_t assert_is_walk(const finder *f, const scene *s, const cairn_contour_grouping_disc *d,
                              int32_t count)
{
    double sum[2] = {0, 0};
    int right[2] = {1, 1};
    int32_t single = 0;
    cairn_real radii[2];

    model_radii(f, radii);
    assert_true(count >= 1);
    for (int32_t i = 0; i < count; i++) {
        cairn_symmetric_point_params params = cairn_symmetric_point_as_written();
        cairn_symmetric_point p;
        int32_t low = d[i].segment[0] < d[i].segment[1] ? 0 : 1;

        params.min_radius = radii[0];
        params.max_radius = radii[1];
        params.max_angle = (cairn_real)(75 * acos(-1) / 180);
        assert_int_equal(cairn_symmetric_point_of_segments(&params, s->lines[d[i].segment[low]],
                                                           s->lines[d[i].segment[1 - low]], &p),
                         1);
        assert_near(apart(p.centre, d[i].centre), 0, 0);
        assert_near(p.radius, d[i].radius, 0);
        assert_near(p.deviation, d[i].deviation, 0);
        for (int way = 0; way < 2; way++) {
            sum[way] += reference_likelihood(f, &d[0], &d[i], way) - log(0.5) +
                        (i > 0 ? reference_mass(s, &d[i - 1], &d[i]) : 0);
            right[way] =
                right[way] && fabs(sum[way] - (double)d[i].log_posterior) < NUMBER(1e-9, 1e-2);
        }
        for (int k = 0; k < 2; k++) {
            cairn_segment line = s->lines[d[i].segment[k]];
            int at_b = apart(line.b, d[i].open_end[k]) == 0;

            assert_true(at_b || apart(line.a, d[i].open_end[k]) == 0);
            if (i > 0 && d[i].segment[k] == d[i - 1].segment[k]) {
                assert_near(apart(d[i].open_end[k], d[i - 1].open_end[k]), 0, 0);
                single++;
                continue;
            }
            if (i > 0)
                assert_true(apart(d[i - 1].open_end[k], at_b ? line.a : line.b) <= 16.001);
            for (int32_t j = 0; j < i; j++)
                assert_true(d[j].segment[0] != d[i].segment[k] &&
                            d[j].segment[1] != d[i].segment[k]);
        }
    }
    assert_true(right[0] || right[1]);
    return single;
}

static void walks_agree_with_their_definition(void **state)
{
    cairn_contour_grouping_params params = small_params();
    finder f = new_finder(&params);
    static cairn_contour_grouping_disc d[STEPS];
    cairn_contour_grouping_particle particles[60];
    int32_t steps, walks = 0, longest = 0, single = 0;
    cairn_status status;

    (void)state;
    for (uint64_t seed = 1; seed < 4; seed++) {
        scene s = {.count = 0};
        cairn_contour_grouping_input in;
        cairn_contour_grouping_result r;

        add_flask(&s, 120, 100);
        add_clutter(&s, 80, 4, 4, seed);
        in = input_of(&f, &s);
        assert_ok(cairn_contour_grouping_begin(f.grouping, &in));
        assert_int_equal(cairn_contour_grouping_history(f.grouping, 0, d, STEPS), 0);
        do {
            cairn_budget budget = {20000};

            status = cairn_contour_grouping_step(f.grouping, &budget);
            for (int32_t i = 0;
                 i < cairn_contour_grouping_particles(f.grouping, particles, 60, &steps); i += 7) {
                int32_t count = cairn_contour_grouping_history(f.grouping, i, d, STEPS);

                /* The next step may have been made, but not yet counted. */
                assert_in_range(count, steps + 1, steps + 2);
                single += assert_is_walk(&f, &s, d, count);
                assert_near(apart(particles[i].centre, d[count - 1].centre), 0, 0);
                assert_int_equal(particles[i].matched_sides, 2);
                walks++;
            }
        } while (status == CAIRN_MORE);
        assert_ok(status);
        r = cairn_contour_grouping_read(f.grouping);
        for (int32_t i = 0; i < r.object_count; i++) {
            int32_t count = cairn_contour_grouping_skeleton(f.grouping, i, d, STEPS);

            assert_int_equal(count, r.objects[i].matched_samples);
            (void)assert_is_walk(&f, &s, d, count);
            assert_near(d[count - 1].log_posterior, r.objects[i].evidence, 0);
            assert_true(i == 0 || r.objects[i].evidence <= r.objects[i - 1].evidence);
            longest = count > longest ? count : longest;
            for (int32_t k = 0; k < count; k++)
                for (int side = 0; side < 2; side++) {
                    int is_listed = 0;

                    for (int32_t j = 0; j < r.objects[i].count; j++)
                        is_listed |= r.segments[r.objects[i].first + j] == d[k].segment[side];
                    assert_true(is_listed);
                }
        }
        assert_int_equal(cairn_contour_grouping_skeleton(f.grouping, r.object_count, d, STEPS), 0);
    }
    assert_true(walks > 20 && longest >= 8 && single > 20);
    assert_int_equal(cairn_contour_grouping_history(f.grouping, -1, d, STEPS), 0);
    assert_int_equal(cairn_contour_grouping_history(f.grouping, 60, d, STEPS), 0);
    assert_int_equal(cairn_contour_grouping_history(NULL, 0, d, STEPS), 0);
    assert_int_equal(cairn_contour_grouping_skeleton(NULL, 0, d, STEPS), 0);
    assert_true(cairn_contour_grouping_history(f.grouping, 0, NULL, 0) > 1);
    test_pool_free(&f.pool);
}

/* ---- Budgets, memory ---- */

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000, INT32_MAX};
    cairn_contour_grouping_params params = small_params();
    scene s = {.count = 0};
    int64_t units = 0;
    uint64_t first = 0;
    cairn_contour_grouping_input in;
    finder f;

    (void)state;
    params.particles = 12;
    f = new_finder(&params);
    add_flask(&s, 130, 100);
    add_clutter(&s, 30, 4, 4, 5);
    in = input_of(&f, &s);
    for (int i = 0; i < 4; i++) {
        cairn_contour_grouping_result r;
        cairn_status status;
        int64_t used = 0;
        uint64_t hash;

        assert_ok(cairn_contour_grouping_begin(f.grouping, &in));
        do {
            cairn_budget budget = {budgets[i]};

            status = cairn_contour_grouping_step(f.grouping, &budget);
            assert_true(budget.left >= 0);
            used += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        r = cairn_contour_grouping_read(f.grouping);
        assert_true(r.object_count >= 1);
        hash = contour_grouping_hash(&r);
        first = i == 0 ? hash : first;
        assert_true(hash == first);
        /* Later runs find the boxes of segments and points in the order of the last. */
        units = i == 0 ? used : units;
    }
    assert_golden(test_hash(first, &units, sizeof units), UINT64_C(0x2515141ea826cc70),
                  UINT64_C(0xbfc59d57ed6149be));
    test_pool_free(&f.pool);
}

static void every_pool_size(void **state)
{
    cairn_contour_grouping_params params = small_params();

    (void)state;
    params.max_tokens = 20;
    params.max_points = 30;
    params.max_steps = 4;
    params.particles = 3;
    params.max_objects = 1;
    params.max_outline = 16;
    test_every_pool_size(create, &params, cairn_contour_grouping_memory(&params));
}

/* ---- Bad input ---- */

static void the_preset_is_of_its_mode(void **state)
{
    cairn_contour_grouping_params p = cairn_contour_grouping_as_written();

    (void)state;
    assert_int_equal(p.mode, CAIRN_MODE_AS_WRITTEN);
    assert_near(p.stop_likelihood, 0.5, 1e-6);
    assert_near(p.path_sigma, 0.7, 1e-6);
    assert_near(p.radius_sigma, 0.2, 1e-6);
    assert_int_equal(cairn_contour_grouping_default().mode, CAIRN_MODE_DEFAULT);
}

static void bad_input_is_refused(void **state)
{
    cairn_contour_grouping_params params = small_params();
    finder f = new_finder(&params);
    cairn_shape_model pathless = f.model;
    cairn_budget budget = {INT32_MAX};
    cairn_contour_grouping_input good, in;
    scene s = {.count = 0};

    (void)state;
    add_flask(&s, 130, 100);
    good = input_of(&f, &s);
    pathless.path_count = 0;
#define REFUSED(change, status)                                                                    \
    in = good;                                                                                     \
    change;                                                                                        \
    assert_status(cairn_contour_grouping_begin(f.grouping, &in), status)
    REFUSED(in.look_ahead = 0, CAIRN_BAD_ARGUMENT);
    REFUSED(in.look_ahead = (cairn_real)NAN, CAIRN_NOT_FINITE);
    REFUSED(in.end_count = -1, CAIRN_BAD_ARGUMENT);
    REFUSED(in.ends = NULL, CAIRN_BAD_ARGUMENT);
    REFUSED(in.count = MAX_COUNT + 1, CAIRN_FULL);
    REFUSED(in.model = &pathless, CAIRN_BAD_ARGUMENT);
    REFUSED(in.min_size = 0, CAIRN_BAD_ARGUMENT);
#undef REFUSED
    s.lines[3].a.x = (cairn_real)NAN;
    assert_ok(cairn_contour_grouping_begin(f.grouping, &good));
    assert_status(cairn_contour_grouping_step(f.grouping, &budget), CAIRN_NOT_FINITE);
    assert_int_equal(cairn_contour_grouping_read(f.grouping).object_count, 0);
    s.lines[3].a.x = 0;
    s.ends[0].y = (cairn_real)INFINITY;
    assert_ok(cairn_contour_grouping_begin(f.grouping, &good));
    assert_status(cairn_contour_grouping_step(f.grouping, &budget), CAIRN_NOT_FINITE);
    test_pool_free(&f.pool);
}

static void no_start_is_reported(void **state)
{
    cairn_contour_grouping_params params = small_params();
    finder f = new_finder(&params);
    scene s = {.count = 0}, none = {.count = 0};
    cairn_contour_grouping_particle p;
    cairn_contour_grouping_input in;
    cairn_contour_grouping_result r;

    (void)state;
    add_flask(&s, 130, 100);
    in = input_of(&f, &s);
    in.end_count = 0;
    r = group(&f, &in);
    assert_int_equal(r.end_reason, CAIRN_CONTOUR_GROUPING_NO_START);
    assert_int_equal(r.object_count + r.steps + r.hypothesis_count, 0);
    assert_int_equal(cairn_contour_grouping_particles(f.grouping, &p, 1, NULL), 0);
    /* An image without a chain has no start either. */
    in = input_of(&f, &none);
    r = group(&f, &in);
    assert_int_equal(r.end_reason, CAIRN_CONTOUR_GROUPING_NO_START);
    assert_int_equal(r.point_count, 0);
    test_pool_free(&f.pool);
}

/* Two facing segments and nothing else nearby: 500 particles start, and none can continue. */
static void all_particles_may_die(void **state)
{
    cairn_contour_grouping_params params = small_params();
    scene s = {.count = 0};
    cairn_contour_grouping_input in;
    cairn_contour_grouping_result r;
    finder f;

    (void)state;
    params.particles = 500;
    f = new_finder(&params);
    add_line(&s, 100, 50, 100, 58);
    add_line(&s, 124, 50, 124, 58);
    add_end(&s, 100, 50);
    in = input_of(&f, &s);
    r = group(&f, &in);
    assert_int_equal(r.point_count, 1);
    assert_int_equal(r.hypothesis_count, 4);
    assert_int_equal(r.end_reason, CAIRN_CONTOUR_GROUPING_NO_FOLLOWER);
    assert_int_equal(r.object_count + r.steps, 0);
    /* Again with an object. */
    s.count = s.end_count = 0;
    add_flask(&s, 130, 100);
    in = input_of(&f, &s);
    assert_true(group(&f, &in).object_count >= 1);
    test_pool_free(&f.pool);
}

/* Parallel lines everywhere: more than ten thousand symmetric points, of which max_points are
 * kept. */
static void ten_thousand_points(void **state)
{
    cairn_contour_grouping_params params = small_params();
    scene s = {.count = 0};
    cairn_contour_grouping_input in;
    cairn_contour_grouping_result r;
    finder f;

    (void)state;
    params.max_points = 3000;
    params.particles = 10;
    f = new_finder(&params);
    for (int y = 10; y < 200; y += 10)
        for (int x = 10; x < 250; x += 10)
            add_line(&s, x, y, x, y + 9);
    add_end(&s, 50, 50);
    in = input_of(&f, &s);
    r = group(&f, &in);
    assert_int_equal(r.point_count, 3000);
    assert_true(r.point_count + r.points_dropped > 10000);
    assert_true(r.end_reason != CAIRN_CONTOUR_GROUPING_NO_START);
    test_pool_free(&f.pool);
}

/* Memory suffices for two steps only. */
static void steps_are_bounded(void **state)
{
    cairn_contour_grouping_params params = small_params();
    scene s = {.count = 0};
    cairn_contour_grouping_input in;
    cairn_contour_grouping_result r;
    finder f;

    (void)state;
    params.max_steps = 3;
    f = new_finder(&params);
    add_flask(&s, 130, 100);
    in = input_of(&f, &s);
    r = group(&f, &in);
    assert_int_equal(r.steps, 2);
    assert_int_equal(r.end_reason, CAIRN_CONTOUR_GROUPING_STEPS);
    assert_true(r.object_count >= 1 && r.objects[0].matched_samples <= 3);
    test_pool_free(&f.pool);
}

/* A corridor whose sides are cut into segments of 4 px, of which only the next two are within
 * reach: no walk dies and none is resampled, so the histories share nothing. When their memory is
 * used up the walk ends; its result until then is reported. */
static void histories_are_bounded(void **state)
{
    cairn_contour_grouping_params params = small_params();
    scene s = {.count = 0};
    cairn_contour_grouping_input in;
    cairn_contour_grouping_result r;
    finder f;

    (void)state;
    params.particles = 20;
    contour_grouping_ablate(&params, 1, 0);
    f = new_finder(&params);
    for (int x = 10; x < 250; x += 4) {
        add_line(&s, x, 100, x + 4, 100);
        add_line(&s, x, 124, x + 4, 124);
    }
    add_end(&s, 12, 112);
    in = input_of(&f, &s);
    in.look_ahead = 3;
    r = group(&f, &in);
    assert_int_equal(r.end_reason, CAIRN_CONTOUR_GROUPING_HISTORIES);
    assert_in_range(r.steps, 24, STEPS - 2);
    assert_true(r.object_count >= 1);
    assert_int_equal(r.objects[0].matched_samples, r.steps + 1);
    /* The next search has its memory again. */
    s.count = s.end_count = 0;
    add_flask(&s, 130, 100);
    in = input_of(&f, &s);
    assert_true(group(&f, &in).end_reason != CAIRN_CONTOUR_GROUPING_HISTORIES);
    test_pool_free(&f.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_flask_in_clutter_is_walked_along),
        cmocka_unit_test(terms_can_be_switched_off),
        cmocka_unit_test(walks_agree_with_their_definition),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(every_pool_size),
        cmocka_unit_test(the_preset_is_of_its_mode),
        cmocka_unit_test(bad_input_is_refused),
        cmocka_unit_test(no_start_is_reported),
        cmocka_unit_test(all_particles_may_die),
        cmocka_unit_test(ten_thousand_points),
        cmocka_unit_test(steps_are_bounded),
        cmocka_unit_test(histories_are_bounded),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
