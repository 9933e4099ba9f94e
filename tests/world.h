/* A world of walls, boxes and round bodies, and maps of parts of it. */
#ifndef CAIRN_TESTS_WORLD_H
#define CAIRN_TESTS_WORLD_H

#include <math.h>

#include "cairn/occupancy_grid.h"
#include "tests/test.h"

enum { BOXES_MOST = 120, SIDE = 120 };

static const double PI = 3.14159265358979323846;

typedef struct box {
    double x, y, half_x, half_y, angle;
    int32_t round; /* 1: a disc, half_x its radius */
} box;

typedef struct world {
    box box[BOXES_MOST];
    int32_t count;
    double top, bottom; /* beyond it cells are unknown */
} world;

/* A map: the part within a window of the world, in a frame of its own. */
typedef struct view {
    uint8_t cells[SIDE * SIDE];
    double x, y, theta; /* of the frame in the world */
    double resolution;  /* m */
    int32_t mirrored;
} view;

static inline double uniform(cairn_random *random, double low, double high)
{
    return low + (high - low) * (double)cairn_random_unit(random);
}

static inline void add_box(world *w, double x, double y, double half_x, double half_y, double angle)
{
    box b = {x, y, half_x, half_y, angle, 0};

    assert_true(w->count < BOXES_MOST);
    w->box[w->count++] = b;
}

static inline void add_disc(world *w, double x, double y, double radius)
{
    add_box(w, x, y, radius, radius, 0);
    w->box[w->count - 1].round = 1;
}

/* Rooms of different sizes, doors, and boxes at all angles. */
static inline world rooms(uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 5);
    world w;

    memset(&w, 0, sizeof w);
    w.top = uniform(&random, 3.2, 4);
    w.bottom = -uniform(&random, 3.2, 4);
    add_box(&w, 0, w.top, 7, 0.05, 0);
    add_box(&w, 0, w.bottom, 7, 0.05, 0);
    add_box(&w, -7, 0, 0.05, 4, 0);
    add_box(&w, 7, 0, 0.05, 4, 0);
    for (int i = 0; i < 4; i++) {
        double x = -4.5 + 3 * i + uniform(&random, -1, 1), length = uniform(&random, 0.8, 1.6);

        add_box(&w, x, i % 2 ? w.top - length : w.bottom + length, 0.05, length, 0);
        add_box(&w, x + uniform(&random, -0.8, 0.8), uniform(&random, -1.5, 1.5), length / 2, 0.05,
                0);
    }
    for (int i = 0; i < 22; i++) {
        double x = uniform(&random, -6.5, 6.5), y = uniform(&random, -3.5, 3.5);
        double half_x = uniform(&random, 0.08, 0.4), half_y = uniform(&random, 0.08, 0.3);

        add_box(&w, x, y, half_x, half_y, uniform(&random, 0, PI));
    }
    return w;
}

/* A cave: no wall is straight. */
static inline world cave(uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 6);
    double bend = uniform(&random, 0.9, 1.6), phase = uniform(&random, 0, 2 * PI);
    world w;

    memset(&w, 0, sizeof w);
    w.top = 4;
    w.bottom = -4;
    for (int i = 0; i <= 28; i++) {
        double x = -7 + 0.5 * i;

        add_disc(&w, x, 3.3 + 0.4 * sin(bend * x + phase), uniform(&random, 0.3, 0.55));
        add_disc(&w, x, -3.3 + 0.4 * cos(bend * x + 2 * phase), uniform(&random, 0.3, 0.55));
    }
    for (int i = 0; i < 13; i++) {
        add_disc(&w, -7, -3 + 0.5 * i, uniform(&random, 0.3, 0.55));
        add_disc(&w, 7, -3 + 0.5 * i, uniform(&random, 0.3, 0.55));
    }
    for (int i = 0; i < 10; i++) {
        double x = uniform(&random, -6, 6), y = uniform(&random, -2.3, 2.3);

        add_disc(&w, x, y, uniform(&random, 0.12, 0.5));
    }
    return w;
}

/* Distance of a point to the border of a box, negative inside. */
static inline double outside(const box *b, double x, double y)
{
    double c = cos(b->angle), s = sin(b->angle), u = c * (x - b->x) + s * (y - b->y),
           v = c * (y - b->y) - s * (x - b->x);
    double du = fabs(u) - b->half_x, dv = fabs(v) - b->half_y;

    if (b->round)
        return hypot(u, v) - b->half_x;
    return du > 0 && dv > 0 ? hypot(du, dv) : fmax(du, dv);
}

/* Free, on a surface, or unknown inside of bodies. */
static inline uint8_t look(const world *w, double x, double y, double cell)
{
    double nearest = 1e9;

    for (int32_t i = 0; i < w->count; i++)
        nearest = fmin(nearest, outside(&w->box[i], x, y));
    if (fabs(x) > 7.1 || y > w->top + 0.1 || y < w->bottom - 0.1)
        return CAIRN_OCCUPANCY_GRID_UNKNOWN;
    return nearest > cell / 2    ? CAIRN_OCCUPANCY_GRID_FREE
           : nearest > -cell / 2 ? CAIRN_OCCUPANCY_GRID_OCCUPIED
                                 : CAIRN_OCCUPANCY_GRID_UNKNOWN;
}

/* Draws the part of the world with low <= x <= high. */
static inline view *draw(const world *w, double x, double y, double theta, double low, double high,
                         double resolution, int32_t mirrored)
{
    view *v = calloc(1, sizeof *v);

    assert_non_null(v);
    v->x = x;
    v->y = y;
    v->theta = theta;
    v->resolution = resolution;
    v->mirrored = mirrored;
    for (int32_t i = 0; i < SIDE * SIDE; i++) {
        double p = (i % SIDE + 0.5 - SIDE / 2.0) * resolution,
               q = ((int32_t)(i / SIDE) + 0.5 - SIDE / 2.0) * resolution;
        double u = x + cos(theta) * p - sin(theta) * q, t = y + sin(theta) * p + cos(theta) * q;

        t = mirrored ? -t : t;
        v->cells[i] =
            u >= low && u <= high ? look(w, u, t, resolution) : CAIRN_OCCUPANCY_GRID_UNKNOWN;
    }
    return v;
}

#endif
