/* Test scenes of the rectangle detector: segments of the sides of rectangles among clutter
 * segments. */
#include "bench/bench_rectangles.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_random.h"
#include "cairn/virtual_scan.h"

enum { RECTANGLES = 4, PIECES = 256, STRAYS = 12 };

typedef struct observation {
    cairn_rectangle truth[RECTANGLES];
    cairn_segment pieces[PIECES];
    int32_t count;
} observation;

static void add_piece(observation *s, cairn_vec2 a, cairn_vec2 b, cairn_random *random)
{
    const double noise = 0.015;
    cairn_segment *piece = &s->pieces[s->count++];

    piece->a.x = a.x + (cairn_real)(noise * (double)cairn_random_normal(random));
    piece->a.y = a.y + (cairn_real)(noise * (double)cairn_random_normal(random));
    piece->b.x = b.x + (cairn_real)(noise * (double)cairn_random_normal(random));
    piece->b.y = b.y + (cairn_real)(noise * (double)cairn_random_normal(random));
}

/* Draws 60 % of every side as two segments with random gaps. */
static void see_rectangle(observation *s, const cairn_rectangle *r, cairn_random *random)
{
    cairn_vec2 corner[4];

    cairn_rectangle_corners(r, corner);
    for (int i = 0; i < 4; i++) {
        cairn_vec2 a = corner[i], way = cairn_vec2_sub(corner[(i + 1) % 4], a);
        double first = bench_uniform(random, 0.2, 0.4),
               gap[2] = {bench_uniform(random, 0, 0.2), bench_uniform(random, 0, 0.2)};
        double at[4] = {gap[0], gap[0] + first, gap[0] + first + gap[1], gap[0] + gap[1] + 0.6};

        for (int k = 0; k < 4; k += 2)
            add_piece(s, cairn_vec2_add(a, cairn_vec2_scale(way, (cairn_real)at[k])),
                      cairn_vec2_add(a, cairn_vec2_scale(way, (cairn_real)at[k + 1])), random);
    }
}

/* Rooms in the quarters of a square of 24 m, and isolated walls. */
static observation make_observation(uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 81);
    observation s;

    memset(&s, 0, sizeof s);
    for (int i = 0; i < RECTANGLES; i++) {
        cairn_rectangle *r = &s.truth[i];

        r->centre.x = (cairn_real)(12 * (i % 2) + bench_uniform(&random, -2, 2));
        r->centre.y = (cairn_real)((i < 2 ? 0 : 12) + bench_uniform(&random, -2, 2));
        r->centre.theta = (cairn_real)bench_uniform(&random, 0, (double)CAIRN_PI / 2);
        r->half_length = (cairn_real)bench_uniform(&random, 0.75, 3);
        r->half_width = (cairn_real)bench_uniform(&random, 0.75, 3);
        see_rectangle(&s, r, &random);
    }
    for (int i = 0; i < STRAYS; i++) {
        double angle = bench_uniform(&random, 0, 2 * (double)CAIRN_PI),
               length = bench_uniform(&random, 0.3, 3);
        cairn_vec2 a = {(cairn_real)bench_uniform(&random, -6, 18),
                        (cairn_real)bench_uniform(&random, -6, 18)},
                   b = a;

        b.x += (cairn_real)(length * cos(angle));
        b.y += (cairn_real)(length * sin(angle));
        add_piece(&s, a, b, &random);
    }
    return s;
}

/* Every corner of one is near one of the other. */
static int is_same(const cairn_rectangle *a, const cairn_rectangle *b)
{
    cairn_vec2 p[4], q[4];

    cairn_rectangle_corners(a, p);
    cairn_rectangle_corners(b, q);
    for (int i = 0; i < 4; i++) {
        double nearest = (double)INFINITY;

        for (int k = 0; k < 4; k++)
            nearest = fmin(nearest, (double)cairn_vec2_norm(cairn_vec2_sub(p[i], q[k])));
        if (nearest > 0.3)
            return 0;
    }
    return 1;
}

/* Counts a scene's rectangles that were found, and false ones. */
static void count_found(const observation *s, const cairn_rectangle *list, int32_t count,
                        int32_t *found, int32_t *wrong)
{
    for (int i = 0; i < RECTANGLES; i++) {
        int32_t k = 0;

        while (k < count && !is_same(&s->truth[i], &list[k]))
            k++;
        *found += k < count;
    }
    for (int32_t k = 0; k < count; k++) {
        int i = 0;

        while (i < RECTANGLES && !is_same(&s->truth[i], &list[k]))
            i++;
        *wrong += i == RECTANGLES;
    }
}

int bench_rectangles_find(uint64_t seed, int32_t *there, int32_t *found, int32_t *wrong)
{
    cairn_rectangle_params params = cairn_virtual_scan_default().rectangle;
    observation seen = make_observation(seed);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_rectangle_set *set = NULL;
    cairn_pool pool;
    size_t bytes;
    void *memory;
    int done;

    params.max_segments = PIECES;
    bytes = cairn_rectangle_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    done = memory != NULL && cairn_pool_init(&pool, memory, bytes) == CAIRN_OK &&
           cairn_rectangle_create(&set, &pool, &params) == CAIRN_OK &&
           cairn_rectangle_begin(set, seen.pieces, seen.count) == CAIRN_OK &&
           cairn_rectangle_step(set, &budget) == CAIRN_OK;
    if (done) {
        int32_t count;
        const cairn_rectangle *list = cairn_rectangle_list(set, &count);

        *there += RECTANGLES;
        count_found(&seen, list, count, found, wrong);
    }
    free(memory);
    return done;
}
