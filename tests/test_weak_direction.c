/* weak_direction: components that can be translated along walls. Rooms on a hallway seen by scans
 * of half a circle, compared with a reference implementation. */
#include "tests/test.h"

#include <math.h>

#include "bench/bench_score.h"
#include "cairn/weak_direction.h"
#include "sim/arena.h"

#define DEGREE 0.017453292519943295

enum { SCANS = 12, WALLS = 512 };

/* ---- Scenes ---- */

struct scene {
    cairn_pool pool, set_pool;
    cairn_aligner *aligner;
    cairn_scan_set *set;
    cairn_pose start[SCANS];
    cairn_aligner_pose aligned[SCANS];
    sim_pose truth[SCANS];
    cairn_real spread;
};

/* The direction of the longest segment of wall. */
static cairn_vec2 hallway_of(const struct scene *s)
{
    cairn_vec2 way = {1, 0};
    cairn_real longest = 0;

    for (int32_t k = 0; k < s->set->segment_count; k++) {
        cairn_segment at = s->set->segments[k].segment;
        cairn_transform pose = cairn_transform_of(s->aligned[s->set->segments[k].scan].map_scan);

        if (cairn_segment_length(at) > longest) {
            longest = cairn_segment_length(at);
            way = cairn_transform_direction(pose, cairn_vec2_unit(cairn_vec2_sub(at.b, at.a)));
        }
    }
    return way;
}

/* As if the last four scans were well constrained, and four of the others each unobservable in one
 * direction: that of the hallway, rotated. */
static void loosen(struct scene *s, double degrees)
{
    cairn_transform turn = {0, 0, (cairn_real)cos(degrees * DEGREE),
                            (cairn_real)sin(degrees * DEGREE)};
    cairn_vec2 way = cairn_transform_direction(turn, hallway_of(s));

    for (int32_t i = 0; i < SCANS; i++) {
        cairn_real large_variance = i < 4 ? CAIRN_REAL(0.09) : CAIRN_REAL(0.04),
                   small_variance = CAIRN_REAL(1e-5);
        cairn_aligner_pose *a = &s->aligned[i];

        memset(a->anchor_covariance, 0, sizeof a->anchor_covariance);
        a->component = 0;
        a->anchored = i >= 8;
        a->anchor_covariance[0] = large_variance * way.x * way.x + small_variance * way.y * way.y;
        a->anchor_covariance[1] = a->anchor_covariance[3] =
            (large_variance - small_variance) * way.x * way.y;
        a->anchor_covariance[4] = large_variance * way.y * way.y + small_variance * way.x * way.x;
        a->anchor_covariance[8] = small_variance;
    }
}

/* Rooms on a hallway, six places with two scans of 180 degrees, poses off by up to 0.5 m and 20
 * degrees; aligned. */
static struct scene open_scene(uint64_t seed)
{
    sim_arena_options arena_options = sim_arena_default();
    sim_survey_options options = sim_survey_default();
    cairn_scan_params scan_params = cairn_scan_default();
    cairn_aligner_params params = cairn_aligner_default();
    cairn_scan_set_params set_params = {
        .max_scans = SCANS, .max_segments = WALLS, .max_points = 6000, .spacing = 0};
    cairn_random random = cairn_random_seed(seed, 80);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_pool scan_pool = test_pool(cairn_scan_memory(&scan_params));
    cairn_scan *scan;
    struct scene s;
    sim_arena *arena;
    sim_survey *survey;
    const sim_scan *scans;
    int32_t count;

    arena_options.seed = options.seed = seed;
    arena_options.scene = SIM_ROOMS;
    options.places = SCANS / 2;
    options.headings = 2;
    options.fov = 180 * DEGREE;
    arena = sim_arena_create(&arena_options, NULL, 0);
    assert_non_null(arena);
    survey = sim_survey_create(arena, &options, NULL, 0);
    assert_non_null(survey);
    scans = sim_survey_scans(survey, &count);
    assert_int_equal(count, SCANS);
    params.max_scans = SCANS;
    params.max_points = 6000;
    s.pool = test_pool(cairn_aligner_memory(&params));
    s.set_pool = test_pool(cairn_scan_set_memory(&set_params));
    assert_ok(cairn_aligner_create(&s.aligner, &s.pool, &params));
    assert_ok(cairn_scan_set_create(&s.set, &s.set_pool, &set_params));
    assert_ok(cairn_scan_create(&scan, &scan_pool, &scan_params));
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_scan_input input = sim_scan_input(&scans[i]);
        cairn_scan_view view;

        s.truth[i] = scans[i].truth;
        s.start[i].x = (cairn_real)s.truth[i].x + cairn_random_uniform(&random, -1, 1) / 2;
        s.start[i].y = (cairn_real)s.truth[i].y + cairn_random_uniform(&random, -1, 1) / 2;
        s.start[i].theta = (cairn_real)s.truth[i].theta +
                           cairn_random_uniform(&random, -1, 1) * (cairn_real)(20 * DEGREE);
        budget.left = CAIRN_UNBOUNDED;
        assert_ok(cairn_scan_begin(scan, &input, NULL));
        assert_ok(cairn_scan_step(scan, &budget));
        view = cairn_scan_read(scan);
        assert_ok(cairn_aligner_add_scan(s.aligner, &view, s.start[i], NULL));
        assert_ok(cairn_scan_set_add(s.set, &view, NULL, NULL));
    }
    assert_ok(cairn_aligner_begin(s.aligner));
    budget.left = CAIRN_UNBOUNDED;
    assert_ok(cairn_aligner_step(s.aligner, &budget));
    for (int32_t i = 0; i < SCANS; i++)
        s.aligned[i] = cairn_aligner_pose_of(s.aligner, i);
    s.spread = cairn_aligner_read(s.aligner).initial_sigma;
    test_pool_free(&scan_pool);
    sim_survey_free(survey);
    sim_arena_free(arena);
    return s;
}

static void close_scene(struct scene *s)
{
    test_pool_free(&s->pool);
    test_pool_free(&s->set_pool);
}

struct bed {
    cairn_pool pool;
    cairn_weak_direction *weak_direction;
};

static struct bed bed_with(const cairn_weak_direction_params *params)
{
    struct bed bed = {test_pool(cairn_weak_direction_memory(params)), NULL};

    assert_ok(cairn_weak_direction_create(&bed.weak_direction, &bed.pool, params));
    return bed;
}

static void begin(cairn_weak_direction *weak_direction, const struct scene *s)
{
    assert_ok(cairn_weak_direction_begin(weak_direction, s->aligner, s->set, s->spread));
    for (int32_t i = 0; i < SCANS; i++)
        assert_ok(cairn_weak_direction_add(weak_direction, s->start[i], &s->aligned[i]));
}

static void run(cairn_weak_direction *weak_direction, const struct scene *s, int32_t units)
{
    cairn_budget budget = {units};
    cairn_status status;

    begin(weak_direction, s);
    while ((status = cairn_weak_direction_step(weak_direction, &budget)) == CAIRN_MORE) {
        assert_int_equal(budget.left, 0);
        assert_int_equal(cairn_weak_direction_read(weak_direction).weak_submaps, 0);
        budget.left = units;
    }
    assert_ok(status);
}

/* Scans within 0.05 m and 1 degree of the truth after the best common motion. */
static int32_t right(const struct scene *s, const cairn_weak_direction *weak_direction)
{
    sim_pose found[SCANS], moved[SCANS];
    int32_t use[SCANS];

    for (int32_t i = 0; i < SCANS; i++) {
        cairn_vec2 shift = cairn_weak_direction_translation(weak_direction, i);

        use[i] = 1;
        found[i].x = (double)(s->aligned[i].map_scan.x + shift.x);
        found[i].y = (double)(s->aligned[i].map_scan.y + shift.y);
        found[i].theta = (double)s->aligned[i].map_scan.theta;
    }
    return bench_fit_common(s->truth, found, use, SCANS, 0.05, DEGREE, moved);
}

/* ---- Reference implementation: all pairs anew each time, nothing stored ---- */

struct reference_wall {
    cairn_vec2 a, b;
    double share;
    int32_t scan;
};

struct reference {
    const struct scene *s;
    cairn_weak_direction_params p;
    int32_t part[SCANS]; /* the lowest scan of its component, -1 well constrained, -2 none */
    cairn_vec2 along[SCANS], shift[SCANS];
    double deviation[SCANS];
    struct reference_wall walls[WALLS];
    int32_t wall_count, parts, joined;
    double thickness, alike;
    cairn_pose expected[SCANS];
};

static double dot(cairn_vec2 a, cairn_vec2 b)
{
    return (double)a.x * (double)b.x + (double)a.y * (double)b.y;
}

/* The direction of a scan's largest variance, by its angle. */
static void reference_axes(const cairn_real c[9], cairn_vec2 *along, double *most, double *least)
{
    double half = ((double)c[0] - (double)c[4]) / 2, angle = atan2((double)c[1], half) / 2;

    along->x = (cairn_real)cos(angle);
    along->y = (cairn_real)sin(angle);
    *most = sqrt(((double)c[0] + (double)c[4]) / 2 + hypot(half, (double)c[1]));
    *least = sqrt(fmax(((double)c[0] + (double)c[4]) / 2 - hypot(half, (double)c[1]), 0));
}

static void reference_constraints(struct reference *t)
{
    for (int32_t i = 0; i < SCANS; i++) {
        const cairn_aligner_pose *a = &t->s->aligned[i];
        double least;

        reference_axes(a->anchor_covariance, &t->along[i], &t->deviation[i], &least);
        t->part[i] = -2;
        if (a->component == 0 && a->anchored)
            t->part[i] = -1;
        else if (a->component == 0 &&
                 sqrt((double)a->anchor_covariance[8]) <= (double)t->p.max_sigma_theta &&
                 least <= (double)t->p.max_cross_sigma &&
                 t->deviation[i] >= (double)t->p.weak_sigma)
            t->part[i] = i;
    }
    for (int changed = 1; changed;) {
        changed = 0;
        for (int32_t i = 0; i < SCANS; i++)
            for (int32_t j = 0; j < i; j++) {
                cairn_pose pose = t->s->aligned[i].map_scan;
                cairn_transform back = cairn_transform_of(cairn_pose_inverse(pose));

                if (t->part[i] < 0 || t->part[j] < 0 || t->part[i] == t->part[j] ||
                    fabs(dot(t->along[i], t->along[j])) < 0.99 ||
                    fabs(t->deviation[i] - t->deviation[j]) >
                        0.03 * fmax(t->deviation[i], t->deviation[j]) ||
                    !cairn_aligner_share_wall(t->s->aligner, i, j,
                                              cairn_pose_between(t->s->aligned[j].map_scan, pose),
                                              cairn_transform_direction(back, t->along[i]), NULL))
                    continue;
                t->part[i] = t->part[j] = t->part[i] < t->part[j] ? t->part[i] : t->part[j];
                changed = 1;
            }
    }
    for (int32_t i = 0; i < SCANS; i++)
        t->parts += t->part[i] == i;
}

/* ---- Its walls ---- */

static cairn_vec2 way_of(const struct reference_wall *w)
{
    return cairn_vec2_unit(cairn_vec2_sub(w->b, w->a));
}

static double overlap(const struct reference_wall *v, const struct reference_wall *w)
{
    cairn_vec2 way = way_of(v),
               middle = cairn_vec2_scale(cairn_vec2_add(w->a, w->b), CAIRN_REAL(0.5));
    double half = (double)cairn_vec2_norm(cairn_vec2_sub(w->b, w->a)) / 2,
           at = dot(way, cairn_vec2_sub(middle, v->a));
    double low = fmax(at - half, 0),
           high = fmin(at + half, (double)cairn_vec2_norm(cairn_vec2_sub(v->b, v->a)));

    return high - low;
}

/* m from w to v across both, to the left of v. */
static double across(const struct reference_wall *v, const struct reference_wall *w)
{
    cairn_vec2 way = way_of(v), other = way_of(w);
    cairn_vec2 mean = dot(way, other) > 0 ? cairn_vec2_add(way, other) : cairn_vec2_sub(way, other);
    cairn_vec2 off = cairn_vec2_sub(cairn_vec2_add(v->a, v->b), cairn_vec2_add(w->a, w->b));

    return dot(cairn_vec2_left_perp(cairn_vec2_unit(mean)), off) / 2;
}

static int faces(const struct reference_wall *v, const struct reference_wall *w)
{
    return dot(way_of(v), way_of(w)) <= -0.99 && overlap(v, w) >= 0.3;
}

static void reference_draws_walls(struct reference *t)
{
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_transform pose = cairn_transform_of(t->s->aligned[i].map_scan);

        for (int32_t k = t->s->set->scans[i].first_segment;
             k < t->s->set->scans[i].end_segment && t->part[i] >= -1; k++) {
            struct reference_wall w = {
                cairn_transform_point(pose, t->s->set->segments[k].segment.a),
                cairn_transform_point(pose, t->s->set->segments[k].segment.b), 0, i};

            if (cairn_vec2_norm(cairn_vec2_sub(w.b, w.a)) >= CAIRN_REAL(0.2))
                t->walls[t->wall_count++] = w;
        }
    }
}

static void reference_shares(struct reference *t)
{
    for (int32_t i = 0; i < t->wall_count; i++) {
        const struct reference_wall *v = &t->walls[i];
        int32_t same = 0;

        for (int32_t k = 0; k < t->wall_count; k++) {
            const struct reference_wall *w = &t->walls[k];

            same += t->part[v->scan] == t->part[w->scan] && dot(way_of(v), way_of(w)) >= 0.99 &&
                    overlap(v, w) > -0.1 && fabs(across(v, w)) < 0.03;
        }
        t->walls[i].share = 1.0 / same;
    }
}

/* All observed thicknesses; in windows of eight half centimetres. */
static void reference_learns(struct reference *t)
{
    double gaps[WALLS * 4], weights[WALLS * 4], total = 0, most = 0;
    int32_t count = 0;

    for (int32_t i = 0; i < t->wall_count; i++)
        for (int32_t k = 0; k < i; k++) {
            const struct reference_wall *v = &t->walls[i], *w = &t->walls[k];

            if (t->part[v->scan] != t->part[w->scan] || !faces(v, w) || across(v, w) <= 0.02 ||
                across(v, w) >= 0.5)
                continue;
            assert_true(count < WALLS * 4);
            gaps[count] = across(v, w);
            weights[count] = v->share * w->share;
            total += weights[count++];
        }
    for (int32_t first = 0; first <= 92; first++) {
        double weight = 0, sum = 0;

        for (int32_t i = 0; i < count; i++)
            if (floor(gaps[i] / 0.005) >= first && floor(gaps[i] / 0.005) < first + 8) {
                weight += weights[i];
                sum += weights[i] * gaps[i];
            }
        if (weight > most) {
            most = weight;
            t->thickness = sum / weight;
        }
    }
    t->alike = most / (total + 2);
}

/* ---- Its shifts ---- */

static double thickness_nats(const struct reference *t, int32_t moving, int32_t fixed,
                             cairn_vec2 shift)
{
    cairn_vec2 along = t->along[moving];
    double sum = 0;

    for (int32_t i = 0; i < t->wall_count; i++) {
        struct reference_wall v = t->walls[i];
        double best = -HUGE_VAL;

        if (t->part[v.scan] != moving || fabs(dot(cairn_vec2_left_perp(way_of(&v)), along)) < 0.7)
            continue;
        for (int32_t k = 0; k < t->wall_count; k++) {
            struct reference_wall w = t->walls[k], moved = v;
            double gap, off;

            if (t->part[w.scan] != fixed || !faces(&v, &w)) /* side by side before the shift */
                continue;
            moved.a = cairn_vec2_add(moved.a, shift);
            moved.b = cairn_vec2_add(moved.b, shift);
            gap = across(&moved, &w);
            off = (gap - t->thickness) / (double)t->p.thickness_sigma;
            if (gap > -0.03 && gap < 0.5)
                best = fmax(
                    best, log(1 - t->alike +
                              t->alike * 0.5 / ((double)t->p.thickness_sigma * sqrt(8 * atan(1))) *
                                  (fabs(off) < 4 ? exp(-off * off / 2) : 0)));
        }
        if (best > -HUGE_VAL)
            sum += v.share * best;
    }
    return sum;
}

static double violation_nats(const struct reference *t, int32_t moving, int32_t fixed,
                             cairn_vec2 shift)
{
    double sum = 0;

    for (int32_t i = 0; i < SCANS; i++)
        for (int32_t j = 0; j < SCANS; j++) {
            cairn_pose a = t->s->aligned[i].map_scan, b = t->s->aligned[j].map_scan;

            if (t->part[i] != moving || t->part[j] != fixed ||
                !cairn_aligner_is_candidate_pair(t->s->aligner, i, j))
                continue;
            a.x += t->shift[i].x + shift.x;
            a.y += t->shift[i].y + shift.y;
            b.x += t->shift[j].x;
            b.y += t->shift[j].y;
            sum += (double)cairn_aligner_free_space_violation(t->s->aligner, i, j,
                                                              cairn_pose_between(b, a), NULL);
        }
    return sum;
}

/* Shift of a component according to its initial poses, less its current mean, along a direction. */
static double expected_off(const struct reference *t, int32_t part, cairn_vec2 along,
                           int32_t *scans)
{
    double sum = 0;

    *scans = 0;
    for (int32_t i = 0; i < SCANS; i++)
        if (t->part[i] == part) {
            cairn_vec2 off = {t->expected[i].x - t->s->aligned[i].map_scan.x - t->shift[i].x,
                              t->expected[i].y - t->s->aligned[i].map_scan.y - t->shift[i].y};

            sum += dot(along, off);
            ++*scans;
        }
    return sum / *scans;
}

static double shift_nats(const struct reference *t, int32_t moving, int32_t fixed, double shift,
                         double off, double variance)
{
    cairn_vec2 way = cairn_vec2_scale(t->along[moving], (cairn_real)shift);
    double nats =
        violation_nats(t, moving, fixed, way) - (shift - off) * (shift - off) / (2 * variance);

    return t->p.use_thickness && t->thickness > 0 ? nats + thickness_nats(t, moving, fixed, way)
                                                  : nats;
}

/* The best shift of a component relative to another, and its gain. The last one tried is zero. */
static double best_shift(const struct reference *t, int32_t moving, int32_t fixed, double *shift)
{
    int32_t own, others;
    double off = expected_off(t, moving, t->along[moving], &own) -
                 expected_off(t, fixed, t->along[moving], &others);
    double spread = (double)t->s->spread;
    double variance = spread * spread * (1.0 / own + 1.0 / others), far = 3 * sqrt(variance);
    double step = fmax((double)t->p.translation_step, 2 * far / 399), nats[403], at[403],
           second = -HUGE_VAL;
    int32_t first = (int32_t)ceil((off - far) / step),
            count = (int32_t)floor((off + far) / step) - first + 1, best = 0;

    if (count < 1) {
        first = (int32_t)rint(off / step);
        count = 1;
    }
    assert_in_range(count, 1, 402);
    for (int32_t i = 0; i <= count; i++) {
        at[i] = i < count ? (first + i) * step : 0;
        nats[i] = shift_nats(t, moving, fixed, at[i], off, variance);
        if (nats[i] > nats[best])
            best = i;
    }
    if (nats[best] - nats[count] < 2) /* little gain: it stays */
        best = count;
    for (int32_t i = 0; i <= count; i++)
        if (fabs(at[i] - at[best]) > 0.06 + step / 2)
            second = fmax(second, nats[i]);
    *shift = at[best];
    return fmax(nats[best] - second, 0);
}

static void reference_joins(struct reference *t)
{
    for (;;) {
        int32_t moving = -1, fixed = -1;
        double best_gain = -1, shift = 0;

        /* In the order of numbers: the well constrained component, then by the lowest scan. */
        for (int32_t k = 0; k < SCANS; k++)
            for (int32_t h = -1; h < k; h++) {
                int32_t has_k = 0, has_h = 0;
                double way, gain;

                for (int32_t i = 0; i < SCANS; i++) {
                    has_k |= t->part[i] == k;
                    has_h |= t->part[i] == h;
                }
                if (!has_k || !has_h || (h >= 0 && fabs(dot(t->along[k], t->along[h])) < 0.99))
                    continue;
                gain = best_shift(t, k, h, &way);
                if (gain > best_gain) {
                    best_gain = gain;
                    shift = way;
                    moving = k;
                    fixed = h;
                }
            }
        if (moving < 0)
            return;
        t->joined++;
        for (int32_t i = 0; i < SCANS; i++)
            if (t->part[i] == moving) {
                cairn_vec2 way = cairn_vec2_scale(t->along[moving], (cairn_real)shift);

                t->shift[i] = cairn_vec2_add(t->shift[i], way);
                for (int32_t k = 0; k < t->wall_count; k++)
                    if (t->walls[k].scan == i) {
                        t->walls[k].a = cairn_vec2_add(t->walls[k].a, way);
                        t->walls[k].b = cairn_vec2_add(t->walls[k].b, way);
                    }
            }
        for (int32_t i = 0; i < SCANS; i++)
            if (t->part[i] == moving)
                t->part[i] = fixed;
        reference_shares(t);
    }
}

static struct reference reference_of(const struct scene *s, const cairn_weak_direction_params *p)
{
    cairn_pose to[SCANS], gauge;
    int32_t use[SCANS], well_constrained = 0;
    struct reference t;

    memset(&t, 0, sizeof t);
    t.s = s;
    t.p = *p;
    reference_constraints(&t);
    for (int32_t i = 0; i < SCANS; i++) {
        to[i] = s->aligned[i].map_scan;
        use[i] = t.part[i] == -1;
        well_constrained += use[i];
    }
    if (well_constrained == 0)
        t.parts = 0;
    if (t.parts == 0)
        return t;
    gauge = cairn_pose_fit(s->start, to, use, SCANS, 1);
    for (int32_t i = 0; i < SCANS; i++)
        t.expected[i] = cairn_pose_compose(gauge, s->start[i]);
    reference_draws_walls(&t);
    reference_shares(&t);
    reference_learns(&t);
    reference_joins(&t);
    return t;
}

static void assert_reference(const struct reference *t, const cairn_weak_direction *weak_direction)
{
    cairn_weak_direction_result result = cairn_weak_direction_read(weak_direction);
    int32_t slid = 0;

    assert_int_equal(result.weak_submaps, t->parts);
    assert_int_equal(result.merged_submaps, t->joined);
    assert_near(result.thickness, t->thickness, NUMBER(1e-9, 1e-4));
    assert_near(result.thickness_share, t->alike, NUMBER(1e-9, 1e-4));
    assert_int_equal(result.dropped, 0);
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_vec2 shift = cairn_weak_direction_translation(weak_direction, i);

        slid += t->shift[i].x != 0 || t->shift[i].y != 0;
        assert_near(shift.x, t->shift[i].x, NUMBER(1e-9, 1e-4));
        assert_near(shift.y, t->shift[i].y, NUMBER(1e-9, 1e-4));
    }
    assert_int_equal(result.translated_scans, slid);
}

static const uint64_t seeds[] = {501, 504, 507, 508, 510, 513, 525, 530};

enum { SEEDS = sizeof seeds / sizeof *seeds };

static void agrees_with_the_reference(void **state)
{
    int32_t joined = 0;

    (void)state;
    for (size_t k = 0; k < SEEDS; k++) {
        cairn_weak_direction_params p = cairn_weak_direction_default();
        struct scene s = open_scene(seeds[k]);
        struct bed bed;
        struct reference t;

        if (k % 3 > 0)
            loosen(&s, k % 3 == 1 ? 0 : 40);
        if (k == 6)
            s.spread = CAIRN_REAL(0.03); /* its poses are far from the initial ones */
        p.use_thickness = k != 3;
        p.translation_step = k == 4 ? CAIRN_REAL(0.001) : k == 2 ? 5 : p.translation_step;
        p.thickness_sigma = k == 5 ? CAIRN_REAL(0.04) : p.thickness_sigma;
        bed = bed_with(&p);
        t = reference_of(&s, &p);
        run(bed.weak_direction, &s, CAIRN_UNBOUNDED);
        assert_reference(&t, bed.weak_direction);
        joined += t.joined;
        test_pool_free(&bed.pool);
        close_scene(&s);
    }
    assert_true(joined >= 15);
}

/* Scans that are right: by the aligner, after the translation, and with walls as thick as
 * elsewhere. */
static void components_are_translated_to_their_place(void **state)
{
    cairn_weak_direction_params p = cairn_weak_direction_default();
    struct bed with = bed_with(&p), without;
    int32_t before = 0, bare = 0, after = 0;

    (void)state;
    p.use_thickness = 0;
    without = bed_with(&p);
    for (size_t k = 0; k < SEEDS; k++) {
        struct scene s = open_scene(seeds[k]);

        begin(with.weak_direction, &s);
        before += right(&s, with.weak_direction);
        run(with.weak_direction, &s, CAIRN_UNBOUNDED);
        run(without.weak_direction, &s, CAIRN_UNBOUNDED);
        after += right(&s, with.weak_direction);
        bare += right(&s, without.weak_direction);
        assert_near(cairn_weak_direction_read(with.weak_direction).thickness, 0.1, 0.006);
        assert_in_range(cairn_weak_direction_read(with.weak_direction).thickness_share * 100, 40,
                        95);
        close_scene(&s);
    }
    assert_true(bare > before + 5);
    assert_true(after > bare + 5);
    assert_true(after >= 88);
    test_pool_free(&with.pool);
    test_pool_free(&without.pool);
}

/* Groups that nothing joins along a direction: the map may be right for none of them, yet the scans
 * of the anchor's group are rigid with it. */
static void groups_are_anchored_without_a_place(void **state)
{
    struct scene s = open_scene(530);
    cairn_aligner_result result = cairn_aligner_read(s.aligner);
    int32_t anchored = 0;

    (void)state;
    for (int32_t i = 0; i < SCANS; i++)
        anchored += s.aligned[i].anchored;
    assert_int_equal(result.placed, 0);
    assert_int_equal(result.anchored, anchored);
    assert_in_range(anchored, 4, 8);
    close_scene(&s);
}

static void the_budget_does_not_matter(void **state)
{
    static const int32_t budgets[] = {CAIRN_UNBOUNDED, 1, 7, 1000};
    cairn_weak_direction_params p = cairn_weak_direction_default();
    struct scene s = open_scene(508);
    struct bed bed = bed_with(&p);
    cairn_weak_direction_result first;
    cairn_vec2 shift[SCANS];

    (void)state;
    memset(&first, 0, sizeof first);
    for (int k = 0; k < 4; k++) {
        cairn_weak_direction_result result;

        run(bed.weak_direction, &s, budgets[k]);
        result = cairn_weak_direction_read(bed.weak_direction);
        if (k == 0)
            first = result;
        assert_memory_equal(&result, &first, sizeof result);
        for (int32_t i = 0; i < SCANS; i++) {
            cairn_vec2 now = cairn_weak_direction_translation(bed.weak_direction, i);

            shift[i] = k == 0 ? now : shift[i];
            assert_memory_equal(&now, &shift[i], sizeof now);
        }
    }
    assert_int_equal(first.units, NUMBER(116943, 33224));
    assert_true(first.translated_scans > 3);
    assert_near(cairn_weak_direction_translation(bed.weak_direction, SCANS).x, 0, 0);
    assert_near(cairn_weak_direction_translation(bed.weak_direction, -1).x, 0, 0);
    begin(bed.weak_direction, &s);
    assert_near(cairn_weak_direction_translation(bed.weak_direction, 0).x, 0, 0);
    test_pool_free(&bed.pool);
    close_scene(&s);
}

/* ---- Exceeded capacities, and components that are not translated ---- */

static void capacities_are_short(void **state)
{
    cairn_weak_direction_params p = cairn_weak_direction_default();
    struct scene s = open_scene(508);
    struct reference t;
    struct bed bed;
    int32_t parts, walls;

    (void)state;
    loosen(&s, 0);
    t = reference_of(&s, &p);
    walls = t.wall_count;
    assert_true(t.parts > 2);
    p.max_walls = walls;
    bed = bed_with(&p);
    run(bed.weak_direction, &s, CAIRN_UNBOUNDED);
    assert_reference(&t, bed.weak_direction);
    test_pool_free(&bed.pool);
    p.max_walls = walls - 3;
    p.max_submaps = t.parts;
    bed = bed_with(&p);
    run(bed.weak_direction, &s, CAIRN_UNBOUNDED);
    assert_int_equal(cairn_weak_direction_read(bed.weak_direction).dropped, 3);
    parts = cairn_weak_direction_read(bed.weak_direction).weak_submaps;
    assert_int_equal(parts, t.parts);
    test_pool_free(&bed.pool);
    p.max_walls = walls;
    p.max_submaps = 1;
    bed = bed_with(&p);
    run(bed.weak_direction, &s, CAIRN_UNBOUNDED);
    assert_int_equal(cairn_weak_direction_read(bed.weak_direction).weak_submaps, 1);
    assert_int_equal(cairn_weak_direction_read(bed.weak_direction).dropped, parts - 1);
    for (int32_t i = 0; i < SCANS; i++)
        if (t.shift[i].x != 0 && cairn_weak_direction_translation(bed.weak_direction, i).x != 0)
            assert_true(s.aligned[i].component == 0 && !s.aligned[i].anchored);
    test_pool_free(&bed.pool);
    close_scene(&s);
}

static void anchored_scans_stay(void **state)
{
    cairn_weak_direction_params p = cairn_weak_direction_default();
    struct scene s = open_scene(508);
    struct bed bed = bed_with(&p);
    cairn_aligner_pose kept[SCANS];

    (void)state;
    memcpy(kept, s.aligned, sizeof kept);
    for (int k = 0; k < 6; k++) {
        memcpy(s.aligned, kept, sizeof kept);
        for (int32_t i = 0; i < SCANS; i++) {
            cairn_aligner_pose *a = &s.aligned[i];

            /* no scan is well constrained, or all are */
            a->anchored = k == 0 ? 0 : k == 1 ? 1 : a->anchored;
            a->component = k == 2 && !a->anchored ? 1 : a->component;
            a->anchor_covariance[8] =
                k == 3 && !a->anchored ? CAIRN_REAL(0.0004) : a->anchor_covariance[8];
            if (k >= 4) {
                a->anchor_covariance[1] = a->anchor_covariance[3] = 0;
                a->anchor_covariance[0] = k == 4 ? CAIRN_REAL(0.04) : CAIRN_REAL(0.0008);
                a->anchor_covariance[4] = k == 4 ? CAIRN_REAL(0.003) : CAIRN_REAL(0.0001);
            }
        }
        run(bed.weak_direction, &s, CAIRN_UNBOUNDED);
        assert_int_equal(cairn_weak_direction_read(bed.weak_direction).weak_submaps, 0);
        assert_int_equal(cairn_weak_direction_read(bed.weak_direction).translated_scans, 0);
        for (int32_t i = 0; i < SCANS; i++)
            assert_near(cairn_weak_direction_translation(bed.weak_direction, i).y, 0, 0);
    }
    test_pool_free(&bed.pool);
    close_scene(&s);
}

/* Initial poses of extreme assumed accuracy, beyond what a square can represent: the components
 * move exactly to them, up to the step. */
static void starts_may_be_exact(void **state)
{
    cairn_weak_direction_params p = cairn_weak_direction_default();
    struct scene s = open_scene(508);
    struct bed bed = bed_with(&p);
    cairn_vec2 shift[SCANS];

    (void)state;
    loosen(&s, 0);
    run(bed.weak_direction, &s, CAIRN_UNBOUNDED);
    assert_true(cairn_weak_direction_read(bed.weak_direction).merged_submaps > 1);
    assert_int_equal(cairn_weak_direction_read(bed.weak_direction).units, NUMBER(195261, 106485));
    s.spread = CAIRN_REAL(1e-6);
    run(bed.weak_direction, &s, CAIRN_UNBOUNDED);
    assert_true(cairn_weak_direction_read(bed.weak_direction).merged_submaps > 0);
    for (int32_t i = 0; i < SCANS; i++)
        shift[i] = cairn_weak_direction_translation(bed.weak_direction, i);
    s.spread = NUMBER((cairn_real)1e-200, (cairn_real)1e-30);
    run(bed.weak_direction, &s, CAIRN_UNBOUNDED);
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_vec2 now = cairn_weak_direction_translation(bed.weak_direction, i);

        assert_true(cairn_vec2_norm(cairn_vec2_sub(now, shift[i])) <=
                    CAIRN_REAL(1.001) * p.translation_step);
    }
    test_pool_free(&bed.pool);
    close_scene(&s);
}

/* Components of different directions join by way of the well constrained one only. */
static void directions_are_not_mixed(void **state)
{
    cairn_weak_direction_params p = cairn_weak_direction_default();
    struct bed bed = bed_with(&p);

    (void)state;
    for (size_t k = 0; k < 3; k++) {
        struct scene s = open_scene(seeds[k]);
        struct reference t;

        for (int32_t i = 0; i < SCANS; i += 3) {
            cairn_real *c = s.aligned[i].anchor_covariance, x = c[0];

            c[0] = c[4];
            c[4] = x;
            c[1] = c[3] = -c[1];
        }
        t = reference_of(&s, &p);
        run(bed.weak_direction, &s, CAIRN_UNBOUNDED);
        assert_reference(&t, bed.weak_direction);
        close_scene(&s);
    }
    test_pool_free(&bed.pool);
}

/* ---- Refusals ---- */

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_weak_direction *weak_direction;

    return cairn_weak_direction_create(&weak_direction, pool, context);
}

static void bad_params_are_refused(void **state)
{
    cairn_weak_direction_params p = cairn_weak_direction_default();
    cairn_pool pool = test_pool(cairn_weak_direction_memory(&p));
    cairn_weak_direction *weak_direction = NULL;

    (void)state;
    assert_status(cairn_weak_direction_create(NULL, &pool, &p), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_weak_direction_create(&weak_direction, NULL, &p), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_weak_direction_create(&weak_direction, &pool, &p));
    assert_int_equal(pool.used, cairn_weak_direction_memory(&p));
    test_pool_free(&pool);
    p.max_scans = p.max_walls = p.max_submaps = 1;
    assert_true(cairn_weak_direction_memory(&p) > 0);
    test_every_pool_size(create, &p, cairn_weak_direction_memory(&p));
}

static void bad_calls_are_refused(void **state)
{
    cairn_weak_direction_params p = cairn_weak_direction_default();
    struct scene s = open_scene(501);
    struct bed bed = bed_with(&p), small;
    cairn_aligner_pose bad = s.aligned[0];
    cairn_pose nan = {0, 0, (cairn_real)NAN}, far = {0, CAIRN_REAL(-1.1e6), 0};
    cairn_budget budget = {10};

    (void)state;
    assert_ok(cairn_weak_direction_step(bed.weak_direction, &budget)); /* nothing was begun */
    assert_int_equal(budget.left, 10);
    assert_status(cairn_weak_direction_add(bed.weak_direction, s.start[0], &bad),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_weak_direction_begin(NULL, s.aligner, s.set, s.spread), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_weak_direction_begin(bed.weak_direction, NULL, s.set, s.spread),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_weak_direction_begin(bed.weak_direction, s.aligner, NULL, s.spread),
                  CAIRN_BAD_ARGUMENT);
    p.max_scans = SCANS - 1;
    small = bed_with(&p);
    assert_status(cairn_weak_direction_begin(small.weak_direction, s.aligner, s.set, s.spread),
                  CAIRN_FULL);
    test_pool_free(&small.pool);
    p.max_scans = SCANS;
    small = bed_with(&p);
    assert_ok(cairn_weak_direction_begin(small.weak_direction, s.aligner, s.set, s.spread));
    assert_status(cairn_weak_direction_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_weak_direction_step(small.weak_direction, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_weak_direction_step(small.weak_direction, &budget), CAIRN_EMPTY);
    assert_status(cairn_weak_direction_add(NULL, s.start[0], &bad), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_weak_direction_add(small.weak_direction, s.start[0], NULL),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_weak_direction_add(small.weak_direction, nan, &bad), CAIRN_NOT_FINITE);
    assert_status(cairn_weak_direction_add(small.weak_direction, far, &bad), CAIRN_BAD_ARGUMENT);
    bad.map_scan = far;
    assert_status(cairn_weak_direction_add(small.weak_direction, s.start[0], &bad),
                  CAIRN_BAD_ARGUMENT);
    far.x = far.y;
    far.y = 0;
    bad.map_scan = far;
    assert_status(cairn_weak_direction_add(small.weak_direction, s.start[0], &bad),
                  CAIRN_BAD_ARGUMENT);
    bad.map_scan = nan;
    assert_status(cairn_weak_direction_add(small.weak_direction, s.start[0], &bad),
                  CAIRN_NOT_FINITE);
    for (int32_t i = 0; i < SCANS; i++) {
        assert_status(cairn_weak_direction_step(small.weak_direction, &budget), CAIRN_EMPTY);
        assert_ok(cairn_weak_direction_add(small.weak_direction, s.start[i], &s.aligned[i]));
    }
    assert_status(cairn_weak_direction_add(small.weak_direction, s.start[0], &s.aligned[0]),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_weak_direction_step(small.weak_direction, &budget), CAIRN_MORE);
    assert_status(cairn_weak_direction_add(small.weak_direction, s.start[0], &s.aligned[0]),
                  CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_aligner_begin(s.aligner));
    assert_status(cairn_weak_direction_begin(bed.weak_direction, s.aligner, s.set, s.spread),
                  CAIRN_BAD_ARGUMENT);
    cairn_aligner_clear(s.aligner);
    assert_status(cairn_weak_direction_begin(bed.weak_direction, s.aligner, s.set, s.spread),
                  CAIRN_BAD_ARGUMENT);
    test_pool_free(&small.pool);
    test_pool_free(&bed.pool);
    close_scene(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_the_reference),
        cmocka_unit_test(components_are_translated_to_their_place),
        cmocka_unit_test(groups_are_anchored_without_a_place),
        cmocka_unit_test(the_budget_does_not_matter),
        cmocka_unit_test(capacities_are_short),
        cmocka_unit_test(anchored_scans_stay),
        cmocka_unit_test(starts_may_be_exact),
        cmocka_unit_test(directions_are_not_mixed),
        cmocka_unit_test(bad_params_are_refused),
        cmocka_unit_test(bad_calls_are_refused),
    };

    return cmocka_run_group_tests_name("weak_direction", tests, NULL, NULL);
}
