#include "bench/bench_reflection.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979324
/* Angular step between axes, degrees. */
#define APART_DEG 10.0

/* Raster cells along the longer side of the shape. */
enum { CELLS = 96, SIDE = 2 * CELLS, COARSE = 90, ROUNDS = 6 };

typedef struct raster {
    uint8_t cell[SIDE * SIDE]; /* 1: inside */
    int32_t at[CELLS * CELLS * 2];
    int32_t count;             /* of cells inside */
    double size, x, y;         /* of a cell in px, and the position of cell (0, 0) */
    double middle_x, middle_y; /* in cells */
} raster;

static void fill(raster *r, const cairn_curve *outlines, int32_t count, double *diagonal)
{
    cairn_box box = cairn_box_empty();
    double width, height;

    for (int32_t i = 0; i < outlines[0].count; i++)
        box = cairn_box_extend(box, outlines[0].points[i]);
    width = (double)(box.max.x - box.min.x);
    height = (double)(box.max.y - box.min.y);
    *diagonal = hypot(width, height);
    r->size = fmax(width, height) / CELLS;
    r->x = (double)box.min.x - (SIDE * r->size - width) / 2;
    r->y = (double)box.min.y - (SIDE * r->size - height) / 2;
    r->count = 0;
    r->middle_x = r->middle_y = 0;
    memset(r->cell, 0, sizeof r->cell);
    for (int32_t v = CELLS / 2 - 1; v <= SIDE - CELLS / 2; v++)
        for (int32_t u = CELLS / 2 - 1; u <= SIDE - CELLS / 2; u++) {
            cairn_vec2 p = {(cairn_real)(r->x + u * r->size), (cairn_real)(r->y + v * r->size)};
            int inside = 0;

            for (int32_t o = 0; o < count; o++)
                inside ^= cairn_polygon_contains(outlines[o].points, outlines[o].count, p);
            if (inside) {
                r->cell[v * SIDE + u] = 1;
                r->at[r->count++] = v * SIDE + u;
                r->middle_x += u;
                r->middle_y += v;
            }
        }
    r->middle_x /= r->count > 0 ? r->count : 1;
    r->middle_y /= r->count > 0 ? r->count : 1;
}

/* offset: in cells from the middle of the shape. */
static double overlap_of(const raster *r, double angle, double offset, int32_t stride)
{
    double c = cos(angle), s = sin(angle);
    int32_t both = 0, all = 0;

    for (int32_t i = 0; i < r->count; i += stride, all++) {
        double x = r->at[i] % SIDE - r->middle_x, y = floor((double)r->at[i] / SIDE) - r->middle_y;
        double aside = c * y - s * x - offset;
        int32_t u = (int32_t)floor(r->middle_x + x + 2 * aside * s + 0.5);
        int32_t v = (int32_t)floor(r->middle_y + y - 2 * aside * c + 0.5);

        both += u >= 0 && v >= 0 && u < SIDE && v < SIDE && r->cell[v * SIDE + u];
    }
    return all > 0 ? both / (2.0 * all - both) : 0;
}

/* Hill climbing to the best axis near one. */
static bench_reflection climb(const raster *r, bench_reflection axis)
{
    double step_angle = PI / COARSE / 2, step_offset = 1;

    axis.overlap = overlap_of(r, axis.angle, axis.offset, 1);
    for (int round = 0; round < ROUNDS; round++) {
        bench_reflection best = axis;

        for (int a = -1; a <= 1; a++)
            for (int o = -1; o <= 1; o++) {
                bench_reflection next = {axis.angle + a * step_angle, axis.offset + o * step_offset,
                                         0};

                next.overlap = overlap_of(r, next.angle, next.offset, 1);
                if (next.overlap > best.overlap)
                    best = next;
            }
        if (best.overlap <= axis.overlap) {
            step_angle /= 2;
            step_offset /= 2;
        }
        axis = best;
    }
    return axis;
}

static double between_angles(double a, double b)
{
    double d = fmod(fabs(a - b), PI);

    return fmin(d, PI - d);
}

static void keep(bench_reflections *found, bench_reflection axis)
{
    int32_t at = found->count;

    for (int32_t i = 0; i < found->count; i++)
        if (between_angles(found->axes[i].angle, axis.angle) < APART_DEG * PI / 180) {
            if (found->axes[i].overlap < axis.overlap)
                found->axes[i] = axis;
            return;
        }
    if (at == BENCH_REFLECTIONS)
        return;
    for (; at > 0 && found->axes[at - 1].overlap < axis.overlap; at--)
        found->axes[at] = found->axes[at - 1];
    found->axes[at] = axis;
    found->count++;
}

int bench_reflections_find(bench_reflections *found, const cairn_curve *outlines, int32_t count)
{
    raster *r = malloc(sizeof *r);
    double coarse[COARSE], best = 0;

    if (r == NULL)
        return 0;
    memset(found, 0, sizeof *found);
    fill(r, outlines, count, &found->diagonal);
    for (int32_t k = 0; k < COARSE; k++)
        coarse[k] = overlap_of(r, PI * k / COARSE, 0, 3);
    for (int32_t k = 0; k < COARSE; k++)
        if (coarse[k] >= coarse[(k + 1) % COARSE] &&
            coarse[k] >= coarse[(k + COARSE - 1) % COARSE] && coarse[k] > 0.6) {
            bench_reflection axis = {PI * k / COARSE, 0, 0};

            keep(found, climb(r, axis));
        }
    for (int32_t i = 0; i < found->count; i++)
        best = fmax(best, found->axes[i].overlap);
    for (int32_t i = 0, kept = 0, all = found->count; i < all; i++) {
        bench_reflection axis = found->axes[i];

        found->count = i == 0 ? 0 : found->count;
        if (axis.overlap < best - BENCH_AS_GOOD)
            continue;
        /* From the middle of the shape in cells to the picture in px. */
        axis.offset = axis.offset * r->size + cos(axis.angle) * (r->y + r->middle_y * r->size) -
                      sin(axis.angle) * (r->x + r->middle_x * r->size);
        found->axes[kept++] = axis;
        found->count = kept;
    }
    free(r);
    return 1;
}

int bench_reflections_hit(const bench_reflections *found, cairn_vec2 from, cairn_vec2 to,
                          cairn_vec2 middle)
{
    double x = (double)(to.x - from.x), y = (double)(to.y - from.y), length = hypot(x, y);

    for (int32_t i = 0; i < found->count && length > 0; i++) {
        double c = cos(found->axes[i].angle), s = sin(found->axes[i].angle);
        double own = (x * (double)(middle.y - from.y) - y * (double)(middle.x - from.x)) / length;
        double axis = c * (double)middle.y - s * (double)middle.x - found->axes[i].offset;

        own *= x * c + y * s < 0 ? -1 : 1;
        if (between_angles(atan2(y, x), found->axes[i].angle) <= 5 * PI / 180 &&
            fabs(own - axis) <= 0.03 * found->diagonal)
            return 1;
    }
    return 0;
}

double bench_reflections_overlap(const cairn_curve *outlines, int32_t count, cairn_vec2 from,
                                 cairn_vec2 to)
{
    raster *r = malloc(sizeof *r);
    double x = (double)(to.x - from.x), y = (double)(to.y - from.y), angle = atan2(y, x), diagonal,
           overlap;

    if (r == NULL)
        return 0;
    fill(r, outlines, count, &diagonal);
    x = ((double)from.x - r->x) / r->size - r->middle_x;
    y = ((double)from.y - r->y) / r->size - r->middle_y;
    overlap = overlap_of(r, angle, cos(angle) * y - sin(angle) * x, 1);
    free(r);
    return overlap;
}
