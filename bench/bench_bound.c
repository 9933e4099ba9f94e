#include "bench/bench_bound.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { POSE = 3, WALL = 2 };

/* Adds the beams of scan s to the pose block and to the walls. */
typedef struct wall {
    double own[WALL][WALL];
    double *cross; /* [count][POSE][WALL] */
} wall;

/* Adds the beams of scan s to the pose block and to the walls. */
static void add_scan(const sim_edge *edges, const sim_scan *scan, int32_t s, double *information,
                     int32_t dimension, wall *walls)
{
    double c = cos(scan->truth.theta), si = sin(scan->truth.theta);
    double sensor_c = cos(scan->base_sensor.theta), sensor_s = sin(scan->base_sensor.theta);

    for (int32_t i = 0; i < scan->count; i++) {
        const sim_edge *edge;
        double angle, r, x, y, qx, qy, px, py, nx, ny, cosine, weight;
        double j[POSE + WALL];

        if (scan->edge[i] < 0 || edges[scan->edge[i]].radius > 0)
            continue;
        edge = &edges[scan->edge[i]];
        angle = scan->angle_min + i * scan->angle_step;
        r = (double)scan->range[i];
        x = r * cos(angle);
        y = r * sin(angle);
        qx = sensor_c * x - sensor_s * y + scan->base_sensor.x;
        qy = sensor_s * x + sensor_c * y + scan->base_sensor.y;
        px = c * qx - si * qy + scan->truth.x;
        py = si * qx + c * qy + scan->truth.y;
        nx = edge->normal.x;
        ny = edge->normal.y;
        {
            double heading = angle + scan->base_sensor.theta + scan->truth.theta;

            cosine = fmax(fabs(nx * cos(heading) + ny * sin(heading)), 0.05);
        }
        weight = 1 / (scan->range_sigma * cosine * scan->range_sigma * cosine);
        j[0] = nx;
        j[1] = ny;
        j[2] = nx * (-si * qx - c * qy) + ny * (c * qx - si * qy);
        j[3] = -1;
        j[4] = -ny * (px - (edge->a.x + edge->b.x) / 2) + nx * (py - (edge->a.y + edge->b.y) / 2);
        for (int a = 0; a < POSE; a++)
            for (int b = 0; b < POSE; b++)
                information[(size_t)(POSE * s + a) * (size_t)dimension + (size_t)(POSE * s + b)] +=
                    weight * j[a] * j[b];
        for (int a = 0; a < WALL; a++)
            for (int b = 0; b < WALL; b++)
                walls[scan->edge[i]].own[a][b] += weight * j[POSE + a] * j[POSE + b];
        for (int a = 0; a < POSE; a++)
            for (int b = 0; b < WALL; b++)
                walls[scan->edge[i]].cross[(s * POSE + a) * WALL + b] +=
                    weight * j[a] * j[POSE + b];
    }
}

/* information -= cross own^-1 cross^T; a wall is known beforehand to 10 m and 1 rad only. */
static void marginalise(const wall *w, int32_t dimension, double *information)
{
    double a = w->own[0][0] + 0.01, b = w->own[0][1], d = w->own[1][1] + 1;
    double determinant = a * d - b * b;
    double inverse[WALL][WALL] = {{d / determinant, -b / determinant},
                                  {-b / determinant, a / determinant}};

    for (int32_t i = 0; i < dimension; i++) {
        const double *ci = &w->cross[i * WALL];
        double u[WALL];

        if (ci[0] == 0 && ci[1] == 0)
            continue;
        for (int k = 0; k < WALL; k++)
            u[k] = ci[0] * inverse[0][k] + ci[1] * inverse[1][k];
        for (int32_t j = 0; j < dimension; j++)
            information[(size_t)i * (size_t)dimension + (size_t)j] -=
                u[0] * w->cross[j * WALL] + u[1] * w->cross[j * WALL + 1];
    }
}

/* In place inverse of a symmetric positive definite matrix by Gauss-Jordan elimination without
 * pivoting. */
static void invert(double *m, int32_t n)
{
    for (int32_t k = 0; k < n; k++) {
        double pivot = 1 / m[(size_t)k * (size_t)n + (size_t)k];

        m[(size_t)k * (size_t)n + (size_t)k] = 1;
        for (int32_t j = 0; j < n; j++)
            m[(size_t)k * (size_t)n + (size_t)j] *= pivot;
        for (int32_t i = 0; i < n; i++) {
            double factor = m[(size_t)i * (size_t)n + (size_t)k];

            if (i == k)
                continue;
            m[(size_t)i * (size_t)n + (size_t)k] = 0;
            for (int32_t j = 0; j < n; j++)
                m[(size_t)i * (size_t)n + (size_t)j] -=
                    factor * m[(size_t)k * (size_t)n + (size_t)j];
        }
    }
}

/* The scan with the greatest determinant of its own block. */
static int32_t best_observed(const double *information, int32_t dimension, int32_t count)
{
    int32_t best = 0;
    double greatest = -1;

    for (int32_t s = 0; s < count; s++) {
        double m[POSE][POSE], determinant;

        for (int a = 0; a < POSE; a++)
            for (int b = 0; b < POSE; b++)
                m[a][b] = information[(size_t)(POSE * s + a) * (size_t)dimension +
                                      (size_t)(POSE * s + b)];
        determinant = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                      m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                      m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
        if (determinant > greatest) {
            greatest = determinant;
            best = s;
        }
    }
    return best;
}

static void read_bounds(const double *covariance, int32_t dimension, int32_t count, int32_t fixed,
                        bench_bound *bounds)
{
    for (int32_t s = 0; s < count; s++) {
        double *c = bounds[s].covariance;

        memset(c, 0, sizeof bounds[s].covariance);
        if (s != fixed)
            for (int a = 0; a < POSE; a++)
                for (int b = 0; b < POSE; b++)
                    c[a * POSE + b] = covariance[(size_t)(POSE * s + a) * (size_t)dimension +
                                                 (size_t)(POSE * s + b)];
        bounds[s].observable = sqrt(c[0] + c[4]) < 0.05 && sqrt(c[8]) < 0.017453292519943295;
    }
}

int32_t bench_bound_compute(const sim_arena *arena, const sim_scan *scans, int32_t count,
                            double prior_m, double prior_rad, bench_bound *bounds)
{
    int32_t edge_count, dimension = POSE * count, fixed = -1;
    const sim_edge *edges = sim_arena_edges(arena, &edge_count);
    double *information = calloc((size_t)dimension * (size_t)dimension, sizeof *information);
    wall *walls = calloc((size_t)edge_count, sizeof *walls);
    double *cross = calloc((size_t)edge_count * (size_t)dimension * WALL, sizeof *cross);

    if (information != NULL && walls != NULL && cross != NULL) {
        for (int32_t w = 0; w < edge_count; w++)
            walls[w].cross = cross + (size_t)w * (size_t)dimension * WALL;
        for (int32_t s = 0; s < count; s++)
            add_scan(edges, &scans[s], s, information, dimension, walls);
        for (int32_t w = 0; w < edge_count; w++)
            marginalise(&walls[w], dimension, information);
        for (int32_t i = 0; i < dimension; i++) {
            double a = i % POSE == 2 ? prior_rad : prior_m;

            information[(size_t)i * (size_t)dimension + (size_t)i] += 3 / (a * a);
        }
        fixed = best_observed(information, dimension, count);
        for (int a = 0; a < POSE; a++)
            information[(size_t)(POSE * fixed + a) * (size_t)dimension +
                        (size_t)(POSE * fixed + a)] += 1e14;
        invert(information, dimension);
        read_bounds(information, dimension, count, fixed, bounds);
    }
    free(cross);
    free(walls);
    free(information);
    return fixed;
}
