/* The hand-drawn outlines of known objects. */
#include "tests/test.h"

#include <math.h>

#include "cairn/geometry.h"
#include "sim/outlines.h"

static outline_object object;

static cairn_segment edge(const outline_curve *curve, int32_t i)
{
    const double *a = curve->point[i], *b = curve->point[(i + 1) % curve->count];
    cairn_segment s = {{(cairn_real)a[0], (cairn_real)a[1]}, {(cairn_real)b[0], (cairn_real)b[1]}};

    return s;
}

static void test_names_find_their_objects(void **state)
{
    (void)state;
    for (int32_t i = 0; i < OUTLINE_OBJECTS; i++) {
        assert_non_null(outline_name(i));
        assert_int_equal(outline_find(outline_name(i)), i);
    }
    assert_null(outline_name(OUTLINE_OBJECTS));
    assert_null(outline_name(-1));
    assert_int_equal(outline_find("no object"), -1);
}

/* Every curve lies in the square, has even steps, and never crosses itself. */
static void test_curves_are_simple_polygons_in_the_square(void **state)
{
    (void)state;
    for (int32_t k = 0; k < OUTLINE_OBJECTS; k++) {
        outline_draw(&object, k);
        for (int32_t c = 0; c < object.count; c++) {
            const outline_curve *curve = &object.curve[c];

            assert_true(curve->count >= 48 && curve->count <= OUTLINE_POINTS_MOST);
            for (int32_t i = 0; i < curve->count; i++) {
                cairn_segment s = edge(curve, i);

                assert_true(fabs(curve->point[i][0]) <= 0.52 && fabs(curve->point[i][1]) <= 0.52);
                assert_true(cairn_segment_length(s) > 0 &&
                            cairn_segment_length(s) < CAIRN_REAL(0.1));
                for (int32_t j = i + 2; j < curve->count - (i == 0); j++)
                    assert_false(cairn_segments_intersect(s, edge(curve, j)));
            }
        }
    }
}

static void test_a_hole_is_outside(void **state)
{
    (void)state;
    outline_draw(&object, outline_find("mug"));
    assert_int_equal(object.count, 2);
    assert_true(outline_contains(&object, 0, 0));
    assert_true(outline_contains(&object, 0.40, 0));
    assert_false(outline_contains(&object, 0.24, 0));
    assert_false(outline_contains(&object, 0.48, 0));
}

/* The area by the shoelace formula equals that of the places inside. */
static void test_contains_agrees_with_the_area(void **state)
{
    (void)state;
    for (int32_t k = 0; k < OUTLINE_OBJECTS; k++) {
        double area = 0;
        int32_t inside = 0;

        outline_draw(&object, k);
        for (int32_t c = 0; c < object.count; c++) {
            double twice = 0;

            for (int32_t i = 0; i < object.curve[c].count; i++) {
                const double *a = object.curve[c].point[i];
                const double *b = object.curve[c].point[(i + 1) % object.curve[c].count];

                twice += a[0] * b[1] - a[1] * b[0];
            }
            area += c == 0 ? fabs(twice) / 2 : -fabs(twice) / 2;
        }
        for (int32_t y = -55; y <= 55; y++)
            for (int32_t x = -55; x <= 55; x++)
                inside += outline_contains(&object, x / 100.0 + 0.003, y / 100.0 + 0.003);
        assert_true(fabs(inside * 1e-4 - area) < 0.02 * area);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_names_find_their_objects),
        cmocka_unit_test(test_curves_are_simple_polygons_in_the_square),
        cmocka_unit_test(test_a_hole_is_outside),
        cmocka_unit_test(test_contains_agrees_with_the_area),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
