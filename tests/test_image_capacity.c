/* Capacities of the objects that work on one image. */
#include "src/host/images/image_capacity.h"
#include "tests/test.h"

static void objects_of_an_image_of_any_shape_are_created(void **state)
{
    const int32_t sides[][2] = {{3, 3}, {31, 1000}, {640, 480}};

    (void)state;
    for (size_t i = 0; i < sizeof sides / sizeof *sides; i++) {
        int32_t width = sides[i][0], height = sides[i][1];
        cairn_edgel_params edgel = cairn_image_capacity_edgel(width, height);
        cairn_boundary_params boundary = cairn_image_capacity_boundary(width, height);
        cairn_skeleton_grouping_params skeleton = cairn_image_capacity_skeleton(width, height, 0);

        assert_true(cairn_edgel_memory(&edgel) > 0);
        assert_true(cairn_boundary_memory(&boundary) > 0);
        assert_true(cairn_skeleton_grouping_memory(&skeleton) > 0);
        assert_int_equal(edgel.max_edgels, skeleton.max_edgels);
        assert_in_range(32 * boundary.max_regions, width * height, width * height + 31);
    }
}

static void an_outline_has_no_more_vertices_than_samples(void **state)
{
    cairn_self_similarity_params params = cairn_image_capacity_self_similarity(8, 0);

    (void)state;
    assert_int_equal(params.outline_samples, 8);
    assert_int_equal(params.max_vertices, 8);
    params = cairn_image_capacity_self_similarity(0, 1);
    assert_int_equal(params.outline_samples, cairn_self_similarity_as_written().outline_samples);
    assert_int_equal(params.max_vertices, cairn_self_similarity_as_written().max_vertices);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(objects_of_an_image_of_any_shape_are_created),
        cmocka_unit_test(an_outline_has_no_more_vertices_than_samples),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
