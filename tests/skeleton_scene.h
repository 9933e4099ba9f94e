/* Shared by the tests of both modes of skeleton_grouping: edgels made by hand, an object with its
 * own pool, and its result under any budget. */
#ifndef CAIRN_TESTS_SKELETON_SCENE_H
#define CAIRN_TESTS_SKELETON_SCENE_H

#include "tests/test.h"

#include <math.h>

#include "cairn/skeleton_grouping.h"

#define PI 3.14159265358979323846

enum { MAX_COUNT = 3000, WIDTH = 200, HEIGHT = 160 };
/* How far a fit of lines may exceed the budget, and the cost of moving CPs. */
enum { MAX_EXCESS_UNITS = 12 + 64 / 8 };

static cairn_edgel edgels[MAX_COUNT];
static int32_t edgel_count;

static inline void add(double x, double y, double nx, double ny)
{
    cairn_edgel e = {{(cairn_real)x, (cairn_real)y}, {(cairn_real)nx, (cairn_real)ny}, 10};

    assert_true(edgel_count < MAX_COUNT);
    edgels[edgel_count++] = e;
}

static inline void add_noise(int32_t count, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 0);

    for (int32_t i = 0; i < count; i++) {
        double x = (double)cairn_random_uniform(&random, 0, WIDTH),
               y = (double)cairn_random_uniform(&random, 0, HEIGHT);
        double turn = (double)cairn_random_uniform(&random, (cairn_real)-PI, (cairn_real)PI);

        add(x, y, cos(turn), sin(turn));
    }
}

static inline cairn_skeleton_grouping_input input_of(double least, double most)
{
    cairn_skeleton_grouping_input in = {edgels, edgel_count,       WIDTH,
                                        HEIGHT, (cairn_real)least, (cairn_real)most};

    return in;
}

struct fixture {
    cairn_pool pool;
    cairn_skeleton_grouping *skeleton;
};

static inline struct fixture with(cairn_skeleton_grouping_params params)
{
    struct fixture f;

    f.pool = test_pool(cairn_skeleton_grouping_memory(&params));
    assert_ok(cairn_skeleton_grouping_create(&f.skeleton, &f.pool, &params));
    edgel_count = 0;
    return f;
}

static inline cairn_skeleton_grouping_result run(cairn_skeleton_grouping *skeleton, double least,
                                                 double most)
{
    cairn_skeleton_grouping_input in = input_of(least, most);
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_skeleton_grouping_begin(skeleton, &in));
    assert_ok(cairn_skeleton_grouping_step(skeleton, &budget));
    return cairn_skeleton_grouping_read(skeleton);
}

/* Edgels of both senses at one place form no part. */
static inline void assert_nothing_at_one_place(cairn_skeleton_grouping *skeleton)
{
    for (int32_t i = 0; i < 50; i++)
        add(10, 10, i % 2 ? 1 : -1, 0);
    assert_int_equal(run(skeleton, 5, 10).part_count, 0);
}

/* Edgels far outside of the image: sorted into its outermost cells. */
static inline void place_far_edgels(void)
{
    edgel_count = 0;
    for (int32_t i = 0; i < 60; i++) {
        add(-500 + i, -300, 0, 1);
        add(1e6 + i, 1e6, 0, -1);
    }
}

/* ---- Budgets and memory ---- */

static inline uint64_t result_hash(void *context)
{
    cairn_skeleton_grouping_result r = cairn_skeleton_grouping_read(context);
    uint64_t hash = test_hash(TEST_HASH_START, &r.part_count, sizeof r.part_count);

    for (int32_t i = 0; i < r.point_count; i++)
        hash = test_hash(hash, &r.points[i], sizeof r.points[i]);
    for (int32_t i = 0; i < r.part_count; i++) {
        const cairn_skeleton_grouping_part *p = &r.parts[i];
        const int32_t places[] = {p->first, p->count, p->object, p->joint[0], p->joint[1]};

        hash = test_hash(test_hash(hash, &p->log_odds, sizeof p->log_odds), places, sizeof places);
    }
    for (int32_t i = 0; i < r.object_count; i++) {
        const cairn_skeleton_grouping_object *o = &r.objects[i];

        hash = test_hash(hash, &o->part_count, sizeof o->part_count);
        hash = test_hash(hash, &o->free_end_count, sizeof o->free_end_count);
        hash = test_hash(hash, &o->log_odds, sizeof o->log_odds);
    }
    hash = test_hash(hash, &r.centre_count, sizeof r.centre_count);
    hash = test_hash(hash, &r.line_count, sizeof r.line_count);
    return test_hash(hash, &r.seed_count, sizeof r.seed_count);
}

static inline cairn_status begin_scene(void *context)
{
    cairn_skeleton_grouping_input in = input_of(0, 0);

    return cairn_skeleton_grouping_begin(context, &in);
}

static inline cairn_status step_scene(void *context, cairn_budget *budget)
{
    return cairn_skeleton_grouping_step(context, budget);
}

/* The scene gives the same result with small budgets; none is exceeded by more than an item.
 * Returns the hash of the result and of its units. */
static inline uint64_t assert_any_budget(cairn_skeleton_grouping *skeleton)
{
    static const int32_t budgets[] = {1, 7, 1000};
    cairn_budget whole = {CAIRN_UNBOUNDED};
    uint64_t all;

    assert_ok(begin_scene(skeleton));
    assert_ok(step_scene(skeleton, &whole));
    all = result_hash(skeleton);
    for (size_t k = 0; k < sizeof budgets / sizeof *budgets; k++) {
        cairn_status status = CAIRN_MORE;

        assert_ok(begin_scene(skeleton));
        while (status == CAIRN_MORE) {
            cairn_budget budget = {budgets[k]};

            assert_int_equal(cairn_skeleton_grouping_read(skeleton).part_count, 0);
            status = cairn_skeleton_grouping_step(skeleton, &budget);
            assert_true(budget.left >= -MAX_EXCESS_UNITS &&
                        (status != CAIRN_MORE || budget.left <= 0));
        }
        assert_ok(status);
        assert_true(cairn_skeleton_grouping_read(skeleton).part_count > 0);
        assert_true(result_hash(skeleton) == all);
    }
    return test_hash(all, &whole.left, sizeof whole.left);
}

static inline cairn_status create_in(void *context, cairn_pool *pool)
{
    cairn_skeleton_grouping *skeleton;

    return cairn_skeleton_grouping_create(&skeleton, pool, context);
}

#endif
