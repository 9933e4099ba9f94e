/* Shared by the tests of both modes of contour_grouping: segments of an image made by hand, a
 * contour_grouping with a model and its own pool. */
#ifndef CAIRN_TESTS_CONTOUR_SCENE_H
#define CAIRN_TESTS_CONTOUR_SCENE_H

#include "tests/test.h"

#include <math.h>

#include "cairn/contour_grouping.h"

enum { WIDTH = 320, HEIGHT = 240, MAX_COUNT = 700, CORNERS_MOST = 16 };

typedef struct scene {
    cairn_segment lines[MAX_COUNT];
    cairn_vec2 ends[32]; /* of strong chains */
    int32_t count, end_count;
} scene;

typedef struct finder {
    cairn_pool pool;
    cairn_shape_model_builder *builder;
    cairn_contour_grouping *grouping;
    cairn_contour_grouping_params params;
    cairn_shape_model model;
} finder;

static inline void add_line(scene *s, double ax, double ay, double bx, double by)
{
    cairn_segment line = {{(cairn_real)ax, (cairn_real)ay}, {(cairn_real)bx, (cairn_real)by}};

    assert_true(s->count < MAX_COUNT);
    s->lines[s->count++] = line;
}

/* The line from a to b as segments of about 8 px, in order. */
static inline void add_pieces(scene *s, double ax, double ay, double bx, double by)
{
    int parts = (int)ceil(hypot(bx - ax, by - ay) / 8 - 1e-9);

    for (int k = 0; k < parts; k++)
        add_line(s, ax + (bx - ax) * k / parts, ay + (by - ay) * k / parts,
                 ax + (bx - ax) * (k + 1) / parts, ay + (by - ay) * (k + 1) / parts);
}

/* Random lines of half lengths `least` to `most`, px. */
static inline void add_clutter(scene *s, int32_t count, double least, double most, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 3);

    for (int32_t i = 0; i < count; i++) {
        double x = (double)cairn_random_uniform(&random, 10, WIDTH - 10);
        double y = (double)cairn_random_uniform(&random, 10, HEIGHT - 10);
        double turn = (double)cairn_random_uniform(&random, 0, CAIRN_PI);
        double half = (double)cairn_random_uniform(&random, (cairn_real)least, (cairn_real)most);

        add_line(s, x - half * cos(turn), y - half * sin(turn), x + half * cos(turn),
                 y + half * sin(turn));
    }
}

static inline finder new_finder_of(const cairn_contour_grouping_params *params,
                                   const double (*corners)[2], int32_t count)
{
    cairn_shape_model_builder_params shape = cairn_shape_model_builder_default();
    cairn_vec2 v[CORNERS_MOST];
    cairn_curve outline = {v, count, 1};
    cairn_budget budget = {INT32_MAX};
    finder f;

    assert_in_range(count, 3, CORNERS_MOST);
    for (int32_t i = 0; i < count; i++) {
        v[i].x = (cairn_real)corners[i][0];
        v[i].y = (cairn_real)corners[i][1];
    }
    f.params = *params;
    f.pool =
        test_pool(cairn_shape_model_builder_memory(&shape) + cairn_contour_grouping_memory(params));
    assert_ok(cairn_shape_model_builder_create(&f.builder, &f.pool, &shape));
    assert_ok(cairn_contour_grouping_create(&f.grouping, &f.pool, params));
    assert_ok(cairn_shape_model_builder_begin(f.builder, &outline, 1));
    assert_ok(cairn_shape_model_builder_step(f.builder, &budget));
    f.model = cairn_shape_model_builder_read(f.builder);
    return f;
}

static inline cairn_contour_grouping_result group(finder *f, const cairn_contour_grouping_input *in)
{
    cairn_budget budget = {INT32_MAX};

    assert_ok(cairn_contour_grouping_begin(f->grouping, in));
    assert_int_equal(cairn_contour_grouping_read(f->grouping).token_count, 0);
    assert_int_equal(cairn_contour_grouping_read(f->grouping).object_count, 0);
    assert_ok(cairn_contour_grouping_step(f->grouping, &budget));
    return cairn_contour_grouping_read(f->grouping);
}

static inline cairn_status create(void *context, cairn_pool *pool)
{
    cairn_contour_grouping *grouping;

    return cairn_contour_grouping_create(&grouping, pool, context);
}

#endif
