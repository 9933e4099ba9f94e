/* Long scenes: seeded inputs like those of the golden scenes, but of realistic size, with all
 * readable results of an object hashed, and the units of its steps, too. Numbers are cairn_real
 * throughout, so that the input is the same everywhere. */
#ifndef CAIRN_TESTS_LONG_H
#define CAIRN_TESTS_LONG_H

#include "tests/golden.h"
#include "tests/test.h"

static inline uint64_t add_int(uint64_t hash, int64_t x)
{
    return add_bytes(hash, &x, sizeof x);
}

static inline uint64_t add_vector(uint64_t hash, const cairn_real *x, int32_t count)
{
    for (int32_t k = 0; k < count; k++)
        hash = add_real(hash, x[k]);
    return hash;
}

/* Calls step(object, ...) with `each` units until it has ended, and hashes the units left each
 * time. In between it is called with budgets below 0, which must change nothing. */
#define LONG_RUN(hash, step, object, each)                                                         \
    do {                                                                                           \
        cairn_budget long_budget;                                                                  \
        cairn_status long_status;                                                                  \
                                                                                                   \
        do {                                                                                       \
            for (int64_t long_below = -1; long_below >= INT32_MIN;                                 \
                 long_below *= INT64_C(1) << 31) {                                                 \
                long_budget.left = (int32_t)long_below;                                            \
                assert_true(step(object, &long_budget) >= 0);                                      \
                assert_int_equal(long_budget.left, long_below);                                    \
            }                                                                                      \
            long_budget.left = (each);                                                             \
            long_status = step(object, &long_budget);                                              \
            (hash) = add_int(hash, long_budget.left);                                              \
        } while (long_status == CAIRN_MORE);                                                       \
        assert_ok(long_status);                                                                    \
    } while (0)

/* A pool and an object in it: LONG_CREATE(pool, icp, &icp, &params). */
#define LONG_CREATE(pool, module, object, params)                                                  \
    do {                                                                                           \
        *(pool) = test_pool(cairn_##module##_memory(params));                                      \
        assert_ok(cairn_##module##_create(object, pool, params));                                  \
    } while (0)

/* ---- The world: a flat of 12 x 8 m with five rooms on a hall, and boxes at all angles ---- */

enum { LONG_WALLS = 256, LONG_BEAMS = 361, LONG_STOPS = 9 };

typedef struct long_world {
    cairn_segment walls[LONG_WALLS]; /* free space on the left */
    int32_t count;
} long_world;

typedef struct long_sweep {
    float range[LONG_BEAMS];
    cairn_scan_input input;
} long_sweep;

void long_add_box(long_world *world, cairn_pose centre, cairn_real half_length,
                  cairn_real half_width);
void long_build(long_world *world, uint64_t seed, int32_t boxes);

/* A round trip through the rooms and back along the hall; the last stop is the first. */
cairn_pose long_on_the_way(cairn_real metres);
extern const cairn_real long_way; /* m, of a lap */

/* A pose at least 0.35 m from everything. */
cairn_pose long_somewhere(const long_world *world, cairn_random *random);

/* The ranges of a scanner of 8 m with noise of 1 cm; a share of the beams ends on people. */
void long_take_sweep(long_sweep *out, const long_world *world, cairn_random *random,
                     cairn_pose pose, int32_t beams, cairn_real view, cairn_real people);

/* For sweeps of at most LONG_BEAMS beams; the view is valid until the next fit. */
cairn_scan *long_new_scan(cairn_pool *pool);
cairn_scan_view long_fit(cairn_scan *scan, const long_sweep *sweep);

/* Within +-x and +-y; x is drawn first. */
static inline cairn_vec2 long_point(cairn_random *random, cairn_real x, cairn_real y)
{
    cairn_vec2 point;

    point.x = argument(random, x, 0);
    point.y = argument(random, y, 0);
    return point;
}

/* Random errors of at most so much in x, in y, and in theta. */
cairn_pose long_disturbed(cairn_random *random, cairn_pose pose, cairn_real metres,
                          cairn_real radians);

#endif
