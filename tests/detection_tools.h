/* Parts of the detection run at once, for the tests of its sources. */
#ifndef CAIRN_TESTS_DETECTION_TOOLS_H
#define CAIRN_TESTS_DETECTION_TOOLS_H

#include "src/detection/object_detect_object.h"
#include "tests/test.h"

/* Bytes for what the tests carve. */
enum { DETECTION_TOOLS_BYTES = 1 << 25 };

/* A field around an object, computed. */
static inline contour_search_field field_around(cairn_pool *pool,
                                                const cairn_contour_search_tokens *tokens,
                                                const cairn_contour_grouping_object *object)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    contour_search_field field;

    cairn_contour_search_field_take(&field, pool);
    cairn_contour_search_field_begin(&field, tokens, object->origin, object->size);
    assert_true(cairn_contour_search_field_step(&field, &budget));
    return field;
}

/* The segments of an outline, in list; returns their number. gaps: NULL, none. */
static inline int32_t collected(const cairn_contour_search_tokens *tokens,
                                const contour_search_fitted_outline *fitted,
                                const contour_search_gaps *gaps, int32_t *list)
{
    cairn_pool pool = test_pool(DETECTION_TOOLS_BYTES);
    contour_search_collector collector;
    cairn_budget budget;

    cairn_contour_search_collector_take(&collector, &pool, tokens->count > 0 ? tokens->count : 1);
    cairn_contour_search_collect_begin(&collector, tokens, fitted, gaps);
    do
        budget.left = 7;
    while (!cairn_contour_search_collect_step(&collector, &budget));
    for (int32_t i = 0; i < collector.count; i++)
        list[i] = collector.order[i].segment;
    test_pool_free(&pool);
    return collector.count;
}

/* A field of an image on a pool, as the host makes it. */
static inline cairn_object_detect_field *field_of(cairn_pool *pool,
                                                  const cairn_contour_search_tokens *tokens,
                                                  const cairn_object_detect_params *params)
{
    cairn_object_detect_params own = *params;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_object_detect_field *field;

    own.max_width = tokens->width;
    own.max_height = tokens->height;
    *pool = test_pool(cairn_object_detect_field_memory(&own));
    assert_ok(cairn_object_detect_field_create(&field, pool, &own));
    assert_ok(cairn_object_detect_field_begin(field, tokens, NULL));
    while (cairn_object_detect_field_step(field, &budget) == CAIRN_MORE)
        budget.left = CAIRN_UNBOUNDED;
    return field;
}

#endif
