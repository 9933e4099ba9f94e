/* Visibility profiles compared with rays against the segments of generated scenes, point by point;
 * borders of bins, gaps, margins, numbers that are none. */
#include "tests/test.h"

#include <math.h>

#include "cairn/visibility.h"

enum { BINS = CAIRN_VISIBILITY_BINS, MASK = BINS - 1 };
#define PI 3.14159265358979323846

static const cairn_vec2 NO_NORMAL = {0, 0};
/* Exact margins, and those of scan_match, mapper and aligner with a gate of 5 cm. */
static const cairn_visibility_rule exact = {.clearance = 0};
static const cairn_visibility_rule each_range = {.clearance = CAIRN_REAL(0.1),
                                                 .depth = CAIRN_REAL(0.1),
                                                 .margin_of_distance = CAIRN_REAL(0.01),
                                                 .beside = 1};
static const cairn_visibility_rule own_range = {.clearance = CAIRN_REAL(0.2),
                                                .depth = CAIRN_REAL(0.2)};
static const cairn_visibility_rule closed_surface = {.clearance = CAIRN_REAL(0.17),
                                                     .clearance_of_range = CAIRN_REAL(0.02),
                                                     .depth = CAIRN_REAL(0.15),
                                                     .beside = 1,
                                                     .is_closed = 1};

/* A profile with its arrays, empty, in steps of 1 mm about a sensor. */
typedef struct profile {
    cairn_visibility visibility;
    uint16_t range[BINS];
    uint8_t surface[BINS];
} profile;

static cairn_visibility *make(profile *p, cairn_real x, cairn_real y)
{
    cairn_vec2 sensor = {x, y};

    memset(p, 0, sizeof *p);
    memset(p->range, 7, sizeof p->range);
    p->visibility.step = CAIRN_REAL(0.001);
    p->visibility.range = p->range;
    p->visibility.surface = p->surface;
    p->visibility.bins = BINS;
    cairn_visibility_clear(&p->visibility, sensor);
    return &p->visibility;
}

/* The ray of a length through the middle of a bin. */
static cairn_vec2 ray_of(int32_t bin, cairn_real length)
{
    return cairn_vec2_scale(cairn_visibility_direction(bin & MASK, BINS), length);
}

static void add(cairn_visibility *visibility, int32_t bin, cairn_real length, uint8_t surface)
{
    cairn_visibility_add(visibility, ray_of(bin, length), surface);
}

static cairn_visibility_answer query(const cairn_visibility *visibility, int32_t bin,
                                     cairn_real distance, const cairn_visibility_rule *rule)
{
    return cairn_visibility_query(
        visibility, cairn_vec2_add(visibility->sensor, ray_of(bin, distance)), NO_NORMAL, rule);
}

/* ---- Bins ---- */

/* The point of the diamond |x| + |y| = 1 at a turn of 0 ... 4. */
static cairn_vec2 on_diamond(double turn)
{
    double within = turn - floor(turn), x[4] = {1 - within, -within, within - 1, within},
           y[4] = {within, 1 - within, -within, within - 1};
    int quarter = (int)turn & 3;
    cairn_vec2 p = {(cairn_real)x[quarter], (cairn_real)y[quarter]};

    return p;
}

static void bins_divide_the_diamond_and_begin_at_their_border(void **state)
{
    (void)state;
    for (int32_t bins = 4; bins <= 4096; bins *= 2)
        for (int32_t k = 0; k < bins; k++) {
            double begin = 4.0 * k / bins, end = 4.0 * (k + 1) / bins;
            cairn_vec2 middle = on_diamond((begin + end) / 2),
                       direction = cairn_visibility_direction(k, bins);
            cairn_real length = cairn_vec2_norm(middle);

            assert_int_equal(cairn_visibility_bin(on_diamond(begin), bins), k);
            assert_int_equal(cairn_visibility_bin(on_diamond(end - 1e-5), bins), k);
            assert_int_equal(cairn_visibility_bin(cairn_vec2_scale(middle, 123), bins), k);
            assert_int_equal(cairn_visibility_bin(direction, bins), k);
            assert_near(direction.x, middle.x / length, NUMBER(1e-15, 1e-6));
            assert_near(direction.y, middle.y / length, NUMBER(1e-15, 1e-6));
        }
}

static void the_first_and_the_last_bin_meet_at_bearing_0(void **state)
{
    cairn_vec2 ahead = {3, 0}, below = {3, CAIRN_REAL(-1e-3)}, minus = {3, -CAIRN_REAL(0.0)};
    cairn_vec2 back = {-3, 0}, before = {-3, CAIRN_REAL(1e-3)}, behind = {-3, CAIRN_REAL(-1e-3)};

    (void)state;
    assert_int_equal(cairn_visibility_bin(ahead, BINS), 0);
    assert_int_equal(cairn_visibility_bin(minus, BINS), 0);
    assert_int_equal(cairn_visibility_bin(below, BINS), BINS - 1);
    assert_int_equal(cairn_visibility_bin(back, BINS), BINS / 2);
    assert_int_equal(cairn_visibility_bin(before, BINS), BINS / 2 - 1);
    assert_int_equal(cairn_visibility_bin(behind, BINS), BINS / 2);
}

static void no_direction_is_in_bin_0(void **state)
{
    const cairn_real nan = (cairn_real)NAN, infinite = (cairn_real)INFINITY;
    cairn_vec2 none[] = {{0, 0},
                         {nan, -1},
                         {-1, nan},
                         {nan, nan},
                         {-1, infinite},
                         {-infinite, -1},
                         {infinite, -infinite}};

    (void)state;
    for (size_t k = 0; k < sizeof none / sizeof *none; k++)
        assert_int_equal(cairn_visibility_bin(none[k], BINS), 0);
}

/* ---- Ranges ---- */

static void a_bin_keeps_the_least_range_and_the_first_surface_of_equal_ones(void **state)
{
    static profile p;
    cairn_visibility *visibility = make(&p, 1, -2);

    (void)state;
    for (int32_t k = 0; k < BINS; k++) {
        assert_int_equal(p.range[k], 0);
        assert_int_equal(p.surface[k], CAIRN_VISIBILITY_NO_SURFACE);
    }
    add(visibility, 9, 4, 1);
    add(visibility, 9, 3, 2);
    add(visibility, 9, 3, 3);
    add(visibility, 9, 5, 4);
    assert_near(cairn_visibility_range(visibility, 9), 3, 1e-3);
    assert_near(cairn_visibility_range(visibility, 9 - BINS), 3, 1e-3);
    assert_int_equal(p.surface[9], 2);
    assert_int_equal(p.range[8] + p.range[10], 0);
}

static void a_profile_without_surfaces_is_the_same(void **state)
{
    static profile with, without;
    cairn_visibility *a = make(&with, 0, 0), *b = make(&without, 0, 0);
    cairn_random random = cairn_random_seed(3, 1);

    (void)state;
    without.visibility.surface = NULL;
    for (int32_t k = 0; k < 500; k++) {
        cairn_vec2 ray = {cairn_random_uniform(&random, -5, 5),
                          cairn_random_uniform(&random, -5, 5)};

        cairn_visibility_add(a, ray, 3);
        cairn_visibility_add(b, ray, 3);
    }
    assert_memory_equal(with.range, without.range, sizeof with.range);
}

static void ranges_are_cut_at_the_greatest_and_at_one_step(void **state)
{
    static profile p;
    cairn_visibility *visibility = make(&p, 0, 0);

    (void)state;
    add(visibility, 1, 1000, 0);
    add(visibility, 2, CAIRN_REAL(1e-9), 0);
    assert_int_equal(p.range[1], CAIRN_VISIBILITY_STEPS);
    assert_int_equal(p.range[2], 1);
    assert_near(cairn_visibility_range(visibility, 1), 65.535, 1e-4);
}

/* The filled bins, as bits about bin 0: bit 16 is bin 0. */
static uint32_t filled(const profile *p)
{
    uint32_t bits = 0;

    for (int32_t k = -16; k < 16; k++)
        bits |= (uint32_t)(p->range[k & MASK] > 0) << (k + 16);
    return bits;
}

static void gaps_are_filled_with_the_later_range_in_both_senses_and_over_bearing_0(void **state)
{
    static profile p;

    (void)state;
    for (int32_t sense = -1; sense <= 1; sense += 2) {
        cairn_visibility *visibility = make(&p, 0, 0);

        visibility->max_gap = 3;
        add(visibility, -2 * sense, 2, 1);
        add(visibility, 1 * sense, 4, 2);
        assert_int_equal(filled(&p), 0xfu << (sense > 0 ? 14 : 15));
        assert_near(cairn_visibility_range(visibility, -2 * sense), 2, 1e-3);
        for (int32_t k = -1; k <= 1; k++) {
            assert_near(cairn_visibility_range(visibility, k * sense), 4, 1e-3);
            assert_int_equal(p.surface[(k * sense) & MASK], 2);
        }
        /* The next gap begins at the last beam; one more bin is too many. */
        add(visibility, 4 * sense, 3, 3);
        assert_int_equal(filled(&p), 0x7fu << (sense > 0 ? 14 : 12));
        assert_near(cairn_visibility_range(visibility, 1 * sense), 4, 1e-3);
        assert_near(cairn_visibility_range(visibility, 2 * sense), 3, 1e-3);
        add(visibility, 8 * sense, 3, 3);
        assert_int_equal(filled(&p), 0x7fu << (sense > 0 ? 14 : 12) | 1u << (16 + 8 * sense));
    }
}

static void no_gap_is_filled_about_an_unknown_range(void **state)
{
    static profile p;
    cairn_visibility *visibility = make(&p, 0, 0);

    (void)state;
    visibility->max_gap = 5;
    add(visibility, 0, 2, 1);
    cairn_visibility_add(visibility, NO_NORMAL, 1);
    add(visibility, 3, 2, 1);
    assert_int_equal(filled(&p), 1u << 16 | 1u << 19);
    visibility->max_gap = 0;
    add(visibility, 4, 2, 1);
    add(visibility, 6, 2, 1);
    assert_int_equal(filled(&p), 1u << 16 | 1u << 19 | 1u << 20 | 1u << 22);
}

static void a_scan_fills_the_bins_of_its_known_beams(void **state)
{
    static profile p, single;
    const cairn_vec2 sensor = {1, 2};
    cairn_scan_beam beams[3];
    cairn_visibility *visibility = make(&p, 0, 0), *expected = make(&single, 1, 2);

    (void)state;
    for (int32_t i = 0; i < 3; i++) {
        beams[i].from = NO_NORMAL; /* the profile's sensor counts */
        beams[i].to = cairn_vec2_add(sensor, ray_of(20 * i, (cairn_real)i + 3));
        beams[i].kind = i == 0 ? CAIRN_SCAN_BEAM_HIT
                               : (i == 1 ? CAIRN_SCAN_BEAM_UNKNOWN : CAIRN_SCAN_BEAM_FREE);
    }
    add(visibility, 50, 1, 0);
    cairn_visibility_fill(visibility, sensor, beams, 3);
    add(expected, 0, 3, CAIRN_VISIBILITY_NO_SURFACE);
    add(expected, 40, 5, CAIRN_VISIBILITY_NO_SURFACE);
    assert_memory_equal(p.range, single.range, sizeof p.range);
    assert_memory_equal(p.surface, single.surface, sizeof p.surface);
    assert_near(p.visibility.sensor.x, 1, 0);
    assert_near(p.visibility.sensor.y, 2, 0);
}

/* ---- Answers ---- */

static void each_answer_about_a_wall(void **state)
{
    static profile p;
    cairn_visibility *visibility = make(&p, 1, 2);
    cairn_vec2 towards = {-1, 0}, away = {1, 0}, behind = {7, 2}, before = {CAIRN_REAL(5.9), 2};

    (void)state;
    for (int32_t k = -20; k <= 20; k++) { /* the wall x = 6 */
        cairn_vec2 ray = ray_of(k, 1);

        add(visibility, k, 5 / ray.x, 0);
    }
    assert_int_equal(query(visibility, 40, 1, &own_range), CAIRN_VISIBILITY_UNKNOWN);
    assert_int_equal(query(visibility, 0, 1, &own_range), CAIRN_VISIBILITY_FREE);
    assert_int_equal(query(visibility, 0, CAIRN_REAL(4.79), &own_range), CAIRN_VISIBILITY_FREE);
    assert_int_equal(query(visibility, 0, CAIRN_REAL(4.83), &own_range), CAIRN_VISIBILITY_SURFACE);
    assert_int_equal(query(visibility, 0, CAIRN_REAL(5.19), &own_range), CAIRN_VISIBILITY_SURFACE);
    assert_int_equal(query(visibility, 0, CAIRN_REAL(5.23), &own_range), CAIRN_VISIBILITY_BEHIND);
    assert_int_equal(query(visibility, 0, 0, &own_range), CAIRN_VISIBILITY_FREE);
    assert_int_equal(cairn_visibility_query(visibility, behind, towards, &own_range),
                     CAIRN_VISIBILITY_BEHIND);
    assert_int_equal(cairn_visibility_query(visibility, behind, away, &own_range),
                     CAIRN_VISIBILITY_BACK_FACE);
    assert_int_equal(cairn_visibility_query(visibility, before, away, &own_range),
                     CAIRN_VISIBILITY_SURFACE);
    /* The other face of a thin wall is no part of the surface. */
    behind.x = CAIRN_REAL(6.1);
    assert_int_equal(cairn_visibility_query(visibility, behind, away, &own_range),
                     CAIRN_VISIBILITY_BACK_FACE);
    assert_int_equal(cairn_visibility_query(visibility, behind, towards, &own_range),
                     CAIRN_VISIBILITY_SURFACE);
}

static void the_range_itself_is_on_the_surface_without_a_margin(void **state)
{
    static profile p;
    cairn_visibility *visibility = make(&p, 0, 0);
    cairn_vec2 end = {4, 0}, nearer = {CAIRN_REAL(3.99), 0}, farther = {CAIRN_REAL(4.01), 0};

    (void)state;
    visibility->step = CAIRN_REAL(0.125); /* exact */
    cairn_visibility_add(visibility, end, 0);
    assert_int_equal(cairn_visibility_query(visibility, end, NO_NORMAL, &exact),
                     CAIRN_VISIBILITY_SURFACE);
    assert_int_equal(cairn_visibility_query(visibility, nearer, NO_NORMAL, &exact),
                     CAIRN_VISIBILITY_FREE);
    assert_int_equal(cairn_visibility_query(visibility, farther, NO_NORMAL, &exact),
                     CAIRN_VISIBILITY_BEHIND);
}

static void margins_grow_with_range_and_distance(void **state)
{
    static profile p;
    cairn_visibility *visibility = make(&p, 0, 0);
    cairn_visibility_rule rule = {.clearance_of_range = CAIRN_REAL(0.1)};

    (void)state;
    add(visibility, 0, 10, 0);
    assert_int_equal(query(visibility, 0, CAIRN_REAL(8.99), &rule), CAIRN_VISIBILITY_FREE);
    assert_int_equal(query(visibility, 0, CAIRN_REAL(9.01), &rule), CAIRN_VISIBILITY_SURFACE);
    rule.clearance_of_range = 0;
    rule.margin_of_distance = CAIRN_REAL(0.25);
    assert_int_equal(query(visibility, 0, CAIRN_REAL(7.99), &rule), CAIRN_VISIBILITY_FREE);
    assert_int_equal(query(visibility, 0, CAIRN_REAL(8.01), &rule), CAIRN_VISIBILITY_SURFACE);
    assert_int_equal(query(visibility, 0, CAIRN_REAL(13.3), &rule), CAIRN_VISIBILITY_SURFACE);
    assert_int_equal(query(visibility, 0, CAIRN_REAL(13.4), &rule), CAIRN_VISIBILITY_BEHIND);
    /* A clearance of the whole range, or more, leaves nothing free. */
    rule.clearance = 10;
    assert_int_equal(query(visibility, 0, 0, &rule), CAIRN_VISIBILITY_SURFACE);
    rule.clearance = 20;
    assert_int_equal(query(visibility, 0, 1, &rule), CAIRN_VISIBILITY_SURFACE);
}

static void bins_beside_count_over_bearing_0_only_when_the_rule_says_so(void **state)
{
    static profile p;

    (void)state;
    for (int32_t side = -1; side <= 1; side += 2)
        for (int32_t bin = -1; bin <= 0; bin++) {
            cairn_visibility *visibility = make(&p, 0, 0);

            add(visibility, bin, 10, 0);
            add(visibility, bin + side, 4, 0);
            add(visibility, bin - 2 * side, 1, 0);
            assert_int_equal(query(visibility, bin, 6, &own_range), CAIRN_VISIBILITY_FREE);
            assert_int_equal(query(visibility, bin, 3, &each_range), CAIRN_VISIBILITY_FREE);
            assert_int_equal(query(visibility, bin, 4, &each_range), CAIRN_VISIBILITY_SURFACE);
            assert_int_equal(query(visibility, bin, 6, &each_range), CAIRN_VISIBILITY_BEHIND);
            assert_int_equal(query(visibility, bin, 10, &each_range), CAIRN_VISIBILITY_SURFACE);
            assert_int_equal(query(visibility, bin + side, 10, &each_range),
                             CAIRN_VISIBILITY_SURFACE);
        }
}

static void a_closed_surface_fills_the_step_and_needs_both_neighbours(void **state)
{
    static profile p;
    cairn_visibility *visibility = make(&p, 0, 0);

    (void)state;
    add(visibility, 7, 10, 0);
    add(visibility, 8, 4, 0);
    assert_int_equal(query(visibility, 7, 2, &closed_surface), CAIRN_VISIBILITY_SURFACE);
    add(visibility, 6, 10, 0);
    assert_int_equal(query(visibility, 7, 2, &closed_surface), CAIRN_VISIBILITY_FREE);
    assert_int_equal(query(visibility, 7, 6, &closed_surface), CAIRN_VISIBILITY_SURFACE);
    assert_int_equal(query(visibility, 7, CAIRN_REAL(10.14), &closed_surface),
                     CAIRN_VISIBILITY_SURFACE);
    assert_int_equal(query(visibility, 7, CAIRN_REAL(10.16), &closed_surface),
                     CAIRN_VISIBILITY_BEHIND);
    assert_int_equal(query(visibility, 8, CAIRN_REAL(4.16), &closed_surface),
                     CAIRN_VISIBILITY_BEHIND);
}

static void a_point_that_is_not_finite_is_unknown(void **state)
{
    static profile p;
    const cairn_real nan = (cairn_real)NAN;
    cairn_vec2 points[] = {{nan, 1}, {1, nan}, {nan, nan}};
    const cairn_visibility_rule *rules[] = {&exact, &each_range, &own_range, &closed_surface};
    cairn_visibility *visibility = make(&p, 0, 0);

    (void)state;
    for (int32_t k = 0; k < BINS; k++)
        add(visibility, k, 5, 0);
    for (int32_t k = 0; k < 12; k++)
        assert_int_equal(cairn_visibility_query(visibility, points[k % 3], NO_NORMAL, rules[k / 3]),
                         CAIRN_VISIBILITY_UNKNOWN);
}

/* ---- Rays against segments ---- */

enum { WALLS = 12, RAYS_PER_BIN = 16, SCENES = 20, POINTS = 2000 };

typedef struct scene {
    cairn_segment walls[WALLS];
    cairn_vec2 sensor;
    double least[BINS]; /* least range of the rays of each bin, m; 0: none */
} scene;

/* Range along a ray of unit direction; 0: no wall is hit. */
static double cast(const scene *s, double dx, double dy)
{
    double nearest = 0;

    for (int32_t k = 0; k < WALLS; k++) {
        double ax = (double)s->walls[k].a.x - (double)s->sensor.x,
               ay = (double)s->walls[k].a.y - (double)s->sensor.y,
               ex = (double)s->walls[k].b.x - (double)s->walls[k].a.x,
               ey = (double)s->walls[k].b.y - (double)s->walls[k].a.y;
        double across = dx * ey - dy * ex, range, along;

        if (fabs(across) < 1e-12)
            continue;
        range = (ax * ey - ay * ex) / across;
        along = (ax * dy - ay * dx) / across;
        if (range > 0 && along >= 0 && along <= 1 && (nearest <= 0 || range < nearest))
            nearest = range;
    }
    return nearest;
}

static double uniform(cairn_random *random, double low, double high)
{
    return (double)cairn_random_uniform(random, (cairn_real)low, (cairn_real)high);
}

/* Walls of 0.5 to 3 m about a sensor, which sees past them into the open in some directions. */
static void make_scene(scene *s, profile *p, cairn_random *random)
{
    s->sensor.x = (cairn_real)uniform(random, -3, 3);
    s->sensor.y = (cairn_real)uniform(random, -3, 3);
    for (int32_t k = 0; k < WALLS; k++) {
        double angle = uniform(random, -PI, PI), length = uniform(random, 0.5, 3),
               bearing = uniform(random, -PI, PI), range = uniform(random, 2, 8);

        s->walls[k].a.x = s->sensor.x + (cairn_real)(range * cos(bearing));
        s->walls[k].a.y = s->sensor.y + (cairn_real)(range * sin(bearing));
        s->walls[k].b.x = s->walls[k].a.x + (cairn_real)(length * cos(angle));
        s->walls[k].b.y = s->walls[k].a.y + (cairn_real)(length * sin(angle));
    }
    make(p, s->sensor.x, s->sensor.y);
    for (int32_t k = 0; k < BINS * RAYS_PER_BIN; k++) {
        cairn_vec2 on = on_diamond(4 * (k + 0.5) / (BINS * RAYS_PER_BIN));
        double norm = hypot((double)on.x, (double)on.y),
               range = cast(s, (double)on.x / norm, (double)on.y / norm),
               *least = &s->least[k / RAYS_PER_BIN];

        if (k % RAYS_PER_BIN == 0)
            *least = 0;
        if (range <= 0)
            continue;
        *least = *least <= 0 || range < *least ? range : *least;
        cairn_visibility_add(&p->visibility, cairn_vec2_scale(on, (cairn_real)(range / norm)), 0);
    }
}

/* The bin of a direction by its angle. */
static int32_t slow_bin(double x, double y)
{
    int32_t found = 0;
    double angle = atan2(y, x);

    for (int32_t k = 1; k < BINS; k++) {
        cairn_vec2 begin = on_diamond(4.0 * k / BINS);
        double from = atan2((double)begin.y, (double)begin.x);

        if ((angle < 0 ? angle + 2 * PI : angle) >= (from < 0 ? from + 2 * PI : from))
            found = k;
    }
    return found;
}

/* The answer by the words of the rule; *gap: distance to the nearest threshold, m. */
static cairn_visibility_answer slow_answer(const scene *s, cairn_vec2 point, cairn_vec2 normal,
                                           const cairn_visibility_rule *rule, double *gap)
{
    double x = (double)point.x - (double)s->sensor.x, y = (double)point.y - (double)s->sensor.y,
           distance = hypot(x, y), far = (double)rule->margin_of_distance * distance;
    int32_t bin = slow_bin(x, y), known = 0, count = rule->beside ? 3 : 1, is_at = 0;
    double here = s->least[bin], least = here, facing = (double)normal.x * x + (double)normal.y * y,
           clearance = (double)rule->clearance + (double)rule->clearance_of_range * here + far,
           depth = (double)rule->depth + far;

    *gap = 1;
    if (here <= 0)
        return CAIRN_VISIBILITY_UNKNOWN;
    for (int32_t k = -(count / 2); k <= count / 2; k++) {
        double range = s->least[(bin + k) & MASK];

        if (range <= 0)
            continue;
        known++;
        least = range < least ? range : least;
        is_at |= distance >= range - clearance && distance <= range + depth;
        *gap = fmin(*gap, fabs(distance - (range - clearance)));
        *gap = fmin(*gap, fabs(distance - (range + depth)));
        *gap = fmin(*gap, fabs(distance - range));
    }
    if (distance < least - clearance && (!rule->is_closed || known == count))
        return CAIRN_VISIBILITY_FREE;
    if (facing > 0 && distance > here)
        return CAIRN_VISIBILITY_BACK_FACE;
    if (rule->is_closed ? distance < here + depth : is_at)
        return CAIRN_VISIBILITY_SURFACE;
    return CAIRN_VISIBILITY_BEHIND;
}

/* Points within two steps of a threshold are left out. */
static void answers_are_those_of_rays_against_the_walls(void **state)
{
    static scene s;
    static profile p;
    const cairn_visibility_rule *rules[] = {&exact, &each_range, &own_range, &closed_surface};
    cairn_random random = cairn_random_seed(17, 1);
    int32_t seen[4][5] = {{0}}, skipped = 0;

    (void)state;
    for (int32_t k = 0; k < SCENES; k++) {
        make_scene(&s, &p, &random);
        for (int32_t i = 0; i < POINTS; i++) {
            cairn_vec2 point = {s.sensor.x + (cairn_real)uniform(&random, -8, 8),
                                s.sensor.y + (cairn_real)uniform(&random, -8, 8)};
            cairn_vec2 normal = {(cairn_real)uniform(&random, -1, 1),
                                 (cairn_real)uniform(&random, -1, 1)};
            double gap;
            cairn_visibility_answer expected;

            if (i % 3 == 0)
                normal = NO_NORMAL;
            if (i % 5 == 0) { /* near a wall */
                const cairn_segment *wall = &s.walls[i % WALLS];

                point =
                    cairn_vec2_add(wall->a, cairn_vec2_scale(cairn_vec2_sub(wall->b, wall->a),
                                                             (cairn_real)uniform(&random, 0, 1)));
            }
            expected = slow_answer(&s, point, normal, rules[i % 4], &gap);
            if (gap < 0.002) {
                skipped++;
                continue;
            }
            seen[i % 4][expected]++;
            assert_int_equal(cairn_visibility_query(&p.visibility, point, normal, rules[i % 4]),
                             expected);
        }
    }
    assert_true(skipped < SCENES * POINTS / 10);
    for (int32_t k = 0; k < 20; k++)
        assert_true(seen[k / 5][k % 5] > 50 || (k == CAIRN_VISIBILITY_SURFACE && k / 5 == 0));
}

/* Nothing behind a wall is free, and what is far before the wall of its ray is no back
 * face. */
static void no_point_behind_a_wall_is_free(void **state)
{
    static scene s;
    static profile p;
    cairn_random random = cairn_random_seed(18, 1);
    int32_t hidden = 0, open = 0;

    (void)state;
    for (int32_t k = 0; k < SCENES; k++) {
        make_scene(&s, &p, &random);
        for (int32_t i = 0; i < POINTS; i++) {
            double x = uniform(&random, -8, 8), y = uniform(&random, -8, 8), distance = hypot(x, y),
                   range = cast(&s, x / distance, y / distance);
            cairn_vec2 point = {s.sensor.x + (cairn_real)x, s.sensor.y + (cairn_real)y};
            cairn_visibility_answer answer =
                cairn_visibility_query(&p.visibility, point, NO_NORMAL, &each_range);

            if (range > 0 && distance > range + 0.1) {
                hidden++;
                assert_true(answer != CAIRN_VISIBILITY_FREE);
            } else if (range > 0 && distance < range / 4) {
                open += answer == CAIRN_VISIBILITY_FREE;
                assert_true(answer != CAIRN_VISIBILITY_BACK_FACE);
            }
        }
    }
    assert_true(hidden > 5000 && open > 100);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bins_divide_the_diamond_and_begin_at_their_border),
        cmocka_unit_test(the_first_and_the_last_bin_meet_at_bearing_0),
        cmocka_unit_test(no_direction_is_in_bin_0),
        cmocka_unit_test(a_bin_keeps_the_least_range_and_the_first_surface_of_equal_ones),
        cmocka_unit_test(a_profile_without_surfaces_is_the_same),
        cmocka_unit_test(ranges_are_cut_at_the_greatest_and_at_one_step),
        cmocka_unit_test(gaps_are_filled_with_the_later_range_in_both_senses_and_over_bearing_0),
        cmocka_unit_test(no_gap_is_filled_about_an_unknown_range),
        cmocka_unit_test(a_scan_fills_the_bins_of_its_known_beams),
        cmocka_unit_test(each_answer_about_a_wall),
        cmocka_unit_test(the_range_itself_is_on_the_surface_without_a_margin),
        cmocka_unit_test(margins_grow_with_range_and_distance),
        cmocka_unit_test(bins_beside_count_over_bearing_0_only_when_the_rule_says_so),
        cmocka_unit_test(a_closed_surface_fills_the_step_and_needs_both_neighbours),
        cmocka_unit_test(a_point_that_is_not_finite_is_unknown),
        cmocka_unit_test(answers_are_those_of_rays_against_the_walls),
        cmocka_unit_test(no_point_behind_a_wall_is_free),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
