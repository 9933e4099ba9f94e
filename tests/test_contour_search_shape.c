/* Measures of a fitted outline: on its edges and beside them, with edges missing; rotated,
 * stretched, with a part moved; two outlines. */
#include "tests/test.h"

#include <math.h>

#include "tests/detection_tools.h"

enum { SIDE = 16, SAMPLES = 4 * SIDE, LINES = 8 };

/* A square of 0.7 sizes a side, whose diagonal is about one, and its fitted positions. */
static cairn_oriented_point drawn[SAMPLES], fitted[SAMPLES];
static int32_t part[SAMPLES];
static cairn_segment lines[LINES];
static cairn_contour_search_tokens tokens;

static const cairn_real size = 200;
static const cairn_vec2 origin = {150, 140};

/* Places it rotated and wider than high, and draws its sides as edges `off` px outside of it,
 * without the sides in the bit set `hidden`. */
static void place_square(double turn, double wide, double off, int32_t hidden)
{
    static const cairn_vec2 corners[] = {{CAIRN_REAL(-0.35), CAIRN_REAL(-0.35)},
                                         {CAIRN_REAL(0.35), CAIRN_REAL(-0.35)},
                                         {CAIRN_REAL(0.35), CAIRN_REAL(0.35)},
                                         {CAIRN_REAL(-0.35), CAIRN_REAL(0.35)}};
    cairn_real c = size * (cairn_real)cos(turn), s = size * (cairn_real)sin(turn),
               w = (cairn_real)wide;

    memset(&tokens, 0, sizeof tokens);
    tokens.lines = lines;
    for (int32_t i = 0; i < SAMPLES; i++) {
        cairn_vec2 a = corners[i / SIDE], b = corners[(i / SIDE + 1) % 4],
                   along = cairn_vec2_sub(b, a), p;
        cairn_vec2 on;

        p = cairn_vec2_add(a, cairn_vec2_scale(along, (cairn_real)(i % SIDE) / SIDE));
        drawn[i].position = p;
        drawn[i].direction = cairn_vec2_unit(along);
        fitted[i].position.x = origin.x + c * w * p.x - s * p.y;
        fitted[i].position.y = origin.y + s * w * p.x + c * p.y;
        on.x = c * w * along.x - s * along.y;
        on.y = s * w * along.x + c * along.y;
        fitted[i].direction = cairn_vec2_unit(on);
        part[i] = 0;
    }
    for (int32_t k = 0; k < 4; k++) {
        cairn_oriented_point from = fitted[k * SIDE], to = fitted[(k + 1) % 4 * SIDE];
        cairn_vec2 out = {(cairn_real)off * from.direction.y, -(cairn_real)off * from.direction.x};

        if (hidden >> k & 1)
            continue;
        lines[tokens.count].a = cairn_vec2_add(from.position, out);
        lines[tokens.count++].b = cairn_vec2_add(to.position, out);
    }
}

/* turn: the direction that counts as upright. */
static cairn_contour_search_shape measure(double turn)
{
    const contour_search_fitted_outline c = {fitted, SAMPLES, origin, size};
    const contour_search_reference d = {drawn, {(cairn_real)cos(turn), (cairn_real)sin(turn)}};
    cairn_pool pool = test_pool(1 << 16);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    contour_search_measure measured;

    cairn_contour_search_measure_take(&measured, &pool, LINES, SAMPLES);
    cairn_contour_search_measure_begin(&measured, &tokens, &c, part, &d);
    assert_true(cairn_contour_search_measure_step(&measured, &budget));
    test_pool_free(&pool);
    return measured.shape;
}

static void test_on_its_edges(void **state)
{
    cairn_contour_search_shape shape;

    (void)state;
    place_square(0, 1, 0, 0);
    shape = measure(0);
    assert_near(shape.edge_proximity, 1, 1e-5);
    assert_near(shape.tangent_deviation, 0, 1e-5);
    assert_near(shape.deformation, 0, 1e-4);
}

/* One sigma of 0.012 sizes off, three of them, and beyond the limit; the corners are at most nearer
 * to the other sides' ends. */
static void test_how_close(void **state)
{
    (void)state;
    place_square(0, 1, 0.012 * 200, 0);
    assert_near(measure(0).edge_proximity, exp(-0.5), 1e-3);
    place_square(0, 1, 3 * 0.012 * 200, 0);
    assert_near(measure(0).edge_proximity, exp(-4.5), 1e-3);
    place_square(0, 1, 4.1 * 0.012 * 200, 0);
    assert_near(measure(0).edge_proximity, 0, 1e-6);
    place_square(0, 1, 0, 1 << 2);
    assert_near(measure(0).edge_proximity, 0.75, 0.02);
    place_square(0, 1, 0, 15);
    assert_near(measure(0).edge_proximity, 0, 1e-6);
}

/* An edge across the outline does not count. */
static void test_of_its_direction(void **state)
{
    (void)state;
    place_square(0, 1, 0, 15);
    lines[0].a.x = lines[0].b.x = fitted[SIDE / 2].position.x;
    lines[0].a.y = fitted[SIDE / 2].position.y - 20;
    lines[0].b.y = fitted[SIDE / 2].position.y + 20;
    tokens.count = 1;
    assert_near(measure(0).edge_proximity, 0, 1e-6);
    lines[0].a.y = lines[0].b.y = fitted[0].position.y;
    lines[0].a.x = fitted[0].position.x;
    lines[0].b.x = fitted[SIDE].position.x;
    assert_near(measure(0).edge_proximity, 0.25, 0.02);
}

/* A rotation of the whole counts against uprightness, never as deformation. */
static void test_turned(void **state)
{
    (void)state;
    place_square(0.3, 1, 0, 0);
    assert_near(measure(0).tangent_deviation, 1 - cos(0.3), 1e-4);
    assert_near(measure(0.3).tangent_deviation, 0, 1e-4);
    assert_near(measure(-0.1).tangent_deviation, 1 - cos(0.4), 1e-4);
    assert_near(measure(0).deformation, 0, 1e-3);
    assert_near(measure(0).edge_proximity, 1, 1e-4);
}

/* Other proportions are no deformation; skewed sides deviate in tangent. */
static void test_stretched(void **state)
{
    (void)state;
    place_square(0, 1.4, 0, 0);
    assert_near(measure(0).deformation, 0, 1e-3);
    assert_true(measure(0).tangent_deviation < CAIRN_REAL(0.01));
}

/* A moved side deforms the square: increasing with the motion, and equally whichever side. */
static void test_deformation(void **state)
{
    cairn_real before = 0;

    (void)state;
    for (int32_t k = 1; k <= 3; k++) {
        cairn_real now;

        place_square(0, 1, 0, 0);
        for (int32_t i = SIDE / 4; i < SIDE; i++)
            fitted[i].position.y -= (cairn_real)(8 * k);
        now = measure(0).deformation;
        assert_true(now > before + CAIRN_REAL(0.005) && now < CAIRN_REAL(0.1));
        before = now;
    }
}

/* A point for each sample is no outline with an area. */
static void test_flat(void **state)
{
    (void)state;
    place_square(0, 1, 0, 0);
    for (int32_t i = 0; i < SAMPLES; i++)
        fitted[i].position = origin;
    assert_near(measure(0).deformation, 1, 1e-6);
    assert_near(measure(0).tangent_deviation, 1, 1e-6);
    for (int32_t i = 0; i < SAMPLES; i++)
        drawn[i].position.y = 0;
    assert_near(measure(0).deformation, 1, 1e-6);
}

/* Directions are measured within an outline, not across to the next one. */
static void test_two_outlines(void **state)
{
    cairn_real one;

    (void)state;
    place_square(0, 1, 0, 0);
    for (int32_t i = SAMPLES / 2; i < SAMPLES; i++)
        fitted[i].position.x += 60;
    one = measure(0).tangent_deviation;
    for (int32_t i = SAMPLES / 2; i < SAMPLES; i++)
        part[i] = 1;
    assert_near(measure(0).tangent_deviation, 0, 1e-5);
    assert_true(one > CAIRN_REAL(0.02));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_on_its_edges),
        cmocka_unit_test(test_how_close),
        cmocka_unit_test(test_of_its_direction),
        cmocka_unit_test(test_turned),
        cmocka_unit_test(test_stretched),
        cmocka_unit_test(test_deformation),
        cmocka_unit_test(test_flat),
        cmocka_unit_test(test_two_outlines),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
