/* bench/gauss: the fast Gauss transform for the forces of force field simulation, which section
 * 7.3.5 of the thesis proposes, compared with the sums of force_field.
 *
 * The force of eqs. 7.1 to 7.3 is not a Gauss transform: its unit vector is d / r, and |cos| of the
 * directions has a kink. Method:
 * 1. 1 / r is a sum of Gaussians: the trapezoidal rule of 2 / sqrt(pi) times the integral of
 *    exp(s - r^2 e^2s). Multiplied by exp(-r^2 / (2 sigma^2)) they become narrower Gaussians; those
 *    much wider than sigma are merged into one.
 * 2. |cos(a - b)| is 2 / pi + 4 / pi times the sum of (-1)^(k+1) / (4 k^2 - 1) cos 2k(a - b),
 *    k = 1 ... --harmonics. Each Gaussian is transformed with 2k + 1 weights.
 * 3. Cells are the clusters. Taylor expansions about their centres (as improved: one expansion in
 *    place of Hermite and Taylor) give the gradients.
 * 4. The error of a sum over a cluster is at most the weight times (2 a b / h^2)^p / p! for terms
 *    up
 *    to degree p - 1, a the radius of a cluster and b the distance to which it counts, and
 *    exp(-b^2 / h^2) beyond.
 *
 * Points lie along the walls of 60 scans of one map of 12 by 10 m. Prints a line for each number of
 * points and each sigma, with the errors of both sums relative to all pairs, as a share of the root
 * mean square force. The transform sums over all points; removing the point's own scan, torque and
 * potential are not charged to it.
 *
 * Source: Greengard and Strain 1991; Yang, Duraiswami, Gumerov and Davis 2003. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "cairn/force_field.h"
#include "cairn/random.h"
#include "tools/options.h"

#define PI 3.14159265358979323846

enum { SCANS = 60, SEGMENTS = 5, WALLS = 60, SAMPLE = 200 };
enum { DEGREE = 9, TERMS = DEGREE * (DEGREE + 1) / 2 }; /* p, and monomials of degree 0 ... p - 1 */
enum { MAX_GAUSSIANS = 32, MAX_WEIGHTS = 2 * 32 + 1 };

static const double WIDTH = 12, HEIGHT = 10;
/* side of a cell, in h */
static const double CELL_SIDE = 0.7;
/* distance to which a cluster counts, in h */
static const double CUT_OFF = 2.6;
/* step of s in the sum for 1 / r */
static const double STEP_RATIO = 0.8;
static const double LEAST_R = 0.1,
                    /* sigma: 1 / r from here on; 1 / sigma: Gaussians of 1 / r at least so
                     * narrow */
    LEAST_DECAY = 0.2;

typedef struct points {
    int32_t count;
    cairn_oriented_point *point;
    cairn_segment segment[SCANS * SEGMENTS];
    int32_t first[SCANS * SEGMENTS + 1];
} points;

/* ---- The points ---- */

static int make_points(points *p, int32_t count, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 1);
    double wall[WALLS][4]; /* start, length along x, along y */

    p->count = count;
    p->point = malloc((size_t)count * sizeof *p->point);
    for (int k = 0; k < WALLS; k++) {
        double length = (double)cairn_random_uniform(&random, 1, 3);

        wall[k][0] = (double)cairn_random_uniform(&random, 0, (cairn_real)(WIDTH - length));
        wall[k][1] = (double)cairn_random_uniform(&random, 0, (cairn_real)(HEIGHT - length));
        wall[k][2] = k % 2 ? length : 0;
        wall[k][3] = k % 2 ? 0 : length;
    }
    for (int k = 0; k < SCANS * SEGMENTS && p->point != NULL; k++) {
        const double *w = wall[cairn_random_below(&random, WALLS)];
        double dx = (double)cairn_random_normal(&random) * 0.05,
               dy = (double)cairn_random_normal(&random) * 0.05;
        double turn = (double)cairn_random_normal(&random) * 0.05;
        double tx = w[2] * cos(turn) - w[3] * sin(turn), ty = w[2] * sin(turn) + w[3] * cos(turn);
        int32_t n = (int32_t)((int64_t)count * (k + 1) / (SCANS * SEGMENTS)), from = p->first[k];

        p->first[k + 1] = n;
        for (int32_t i = from; i < n; i++) {
            double at = (i - from + (double)cairn_random_uniform(&random, 0, 1)) / (n - from);

            p->point[i].position.x = (cairn_real)(w[0] + dx + at * tx);
            p->point[i].position.y = (cairn_real)(w[1] + dy + at * ty);
            p->point[i].direction.x = (cairn_real)(tx / hypot(tx, ty));
            p->point[i].direction.y = (cairn_real)(ty / hypot(tx, ty));
        }
        p->segment[k].a.x = (cairn_real)(w[0] + dx);
        p->segment[k].a.y = (cairn_real)(w[1] + dy);
        p->segment[k].b.x = (cairn_real)(w[0] + dx + tx);
        p->segment[k].b.y = (cairn_real)(w[1] + dy + ty);
    }
    return p->point != NULL;
}

/* ---- All pairs ---- */

/* The force on point i of all others, those of the same scan included or not. */
static void slow_force(const points *p, int32_t i, double sigma, int32_t own, double force[2])
{
    int32_t scan = 0;

    while (p->first[(scan + 1) * SEGMENTS] <= i)
        scan++;
    force[0] = force[1] = 0;
    for (int32_t j = 0; j < p->count; j++) {
        cairn_vec2 f;

        if (j == i ||
            (!own && j >= p->first[scan * SEGMENTS] && j < p->first[(scan + 1) * SEGMENTS]))
            continue;
        f = cairn_force_kernel_pair(p->point[i], p->point[j], 1, 1, (cairn_real)sigma, NULL);
        force[0] += (double)f.x;
        force[1] += (double)f.y;
    }
}

/* ---- The field ---- */

/* Seconds of an iteration, forces alone; -1 on failure. forces: of the sample. */
static double run_field(const points *p, double sigma, const int32_t *sample, double (*forces)[2])
{
    cairn_force_field_params params = cairn_force_field_as_written();
    cairn_force_field *field = NULL;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_pose origin = {0, 0, 0};
    cairn_status status;
    cairn_pool pool;
    void *memory;
    double seconds = -1;
    size_t bytes;

    params.max_scans = SCANS;
    params.max_segments = SCANS * SEGMENTS;
    params.max_points = p->count;
    params.roi = CAIRN_FORCE_FIELD_ROI_NONE;
    params.potential = 0;
    params.sigma_start = params.sigma_end = (cairn_real)sigma;
    bytes = cairn_force_field_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    status = memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(&pool, memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_force_field_create(&field, &pool, &params);
    for (int k = 0; k < SCANS && status == CAIRN_OK; k++) {
        cairn_scan_view view = {0};
        int32_t first[SEGMENTS + 1], from = p->first[k * SEGMENTS];

        for (int i = 0; i <= SEGMENTS; i++)
            first[i] = p->first[k * SEGMENTS + i] - from;
        view.segments = &p->segment[k * SEGMENTS];
        view.first_point = first;
        view.points = p->point + from;
        view.segment_count = SEGMENTS;
        view.point_count = first[SEGMENTS];
        status = cairn_force_field_add_scan(field, &view, NULL, origin, NULL);
    }
    if (status == CAIRN_OK) {
        double start = bench_cpu_seconds();

        while ((status = cairn_force_field_iterate(field, &budget)) == CAIRN_MORE)
            budget.left = CAIRN_UNBOUNDED;
        seconds = status < 0 ? -1 : bench_cpu_seconds() - start;
    }
    for (int k = 0; k < SAMPLE && status >= 0; k++) {
        int32_t scan = 0;
        cairn_vec2 force;
        cairn_real mass;

        while (p->first[(scan + 1) * SEGMENTS] <= sample[k])
            scan++;
        status = cairn_force_field_point_force(field, scan, sample[k] - p->first[scan * SEGMENTS],
                                               &force, &mass);
        forces[k][0] = (double)force.x;
        forces[k][1] = (double)force.y;
    }
    free(memory);
    return status < 0 ? -1 : seconds;
}

/* ---- The transform ---- */

/* The points in cells, which are the clusters. */
typedef struct cells {
    double side;
    int32_t columns, rows;
    int32_t *first, *order; /* [columns * rows + 1], [count] */
    int32_t *slot;          /* [columns * rows], of those that hold points, -1: none */
    int32_t used;
} cells;

static int32_t cell_of(const cells *c, cairn_vec2 p)
{
    int32_t x = (int32_t)(((double)p.x + 1) / c->side), y = (int32_t)(((double)p.y + 1) / c->side);

    return (y < 0          ? 0
            : y >= c->rows ? c->rows - 1
                           : y) *
               c->columns +
           (x < 0             ? 0
            : x >= c->columns ? c->columns - 1
                              : x);
}

static int cells_open(cells *c, const points *p, double side)
{
    int32_t count;

    c->side = side;
    c->columns = (int32_t)((WIDTH + 2) / side) + 1;
    c->rows = (int32_t)((HEIGHT + 2) / side) + 1;
    count = c->columns * c->rows;
    c->first = calloc((size_t)count + 2, sizeof *c->first);
    c->slot = malloc((size_t)count * sizeof *c->slot);
    c->order = malloc((size_t)p->count * sizeof *c->order);
    c->used = 0;
    if (c->first == NULL || c->slot == NULL || c->order == NULL)
        return 0;
    for (int32_t i = 0; i < p->count; i++)
        c->first[cell_of(c, p->point[i].position) + 2]++;
    for (int32_t k = 0; k < count; k++) {
        c->slot[k] = c->first[k + 2] > 0 ? c->used++ : -1;
        c->first[k + 2] += c->first[k + 1];
    }
    for (int32_t i = 0; i < p->count; i++)
        c->order[c->first[cell_of(c, p->point[i].position) + 1]++] = i;
    return 1;
}

static void cells_close(cells *c)
{
    free(c->first);
    free(c->slot);
    free(c->order);
}

/* t_x^i t_y^j, degree by degree. */
static void monomials(double x, double y, double *m)
{
    m[0] = 1;
    for (int degree = 1, at = 1; degree < DEGREE; at += ++degree) {
        for (int j = 0; j < degree; j++)
            m[at + j] = m[at - degree + j] * x;
        m[at + degree] = m[at - 1] * y;
    }
}

/* 2^(i+j) / (i! j!) */
static void factors(double *f)
{
    for (int degree = 0, at = 0; degree < DEGREE; at += ++degree)
        for (int j = 0; j <= degree; j++)
            f[at + j] = pow(2, degree) / (tgamma(degree - j + 1) * tgamma(j + 1));
}

/* Weights of a point for the harmonics: 1, cos 2a, sin 2a, cos 4a ... */
static void harmonics_of(cairn_vec2 direction, int32_t harmonics, double *w)
{
    double c = (double)(direction.x * direction.x - direction.y * direction.y),
           s = 2 * (double)(direction.x * direction.y);

    w[0] = 1;
    for (int k = 1; k <= harmonics; k++) {
        double before_c = k > 1 ? w[2 * k - 3] : 1, before_s = k > 1 ? w[2 * k - 2] : 0;

        w[2 * k - 1] = before_c * c - before_s * s;
        w[2 * k] = before_s * c + before_c * s;
    }
}

typedef struct transform {
    const points *points;
    int32_t harmonics, weights;
    double factor[TERMS], share[MAX_WEIGHTS]; /* of the weights in |cos| */
    double (*harmonic)[MAX_WEIGHTS];          /* [count] */
    double (*force)[2];                       /* [count] */
} transform;

static double *expand(const transform *t, const cells *c, double h)
{
    double *coefficient = calloc((size_t)c->used * TERMS * (size_t)t->weights, sizeof *coefficient),
           m[TERMS];

    for (int32_t k = 0; k < c->columns * c->rows && coefficient != NULL; k++) {
        double cx = (k % c->columns + 0.5) * c->side - 1,
               cy = (int32_t)(k / c->columns) * c->side + 0.5 * c->side - 1;

        for (int32_t n = c->first[k]; n < c->first[k + 1]; n++) {
            int32_t i = c->order[n];
            double x = ((double)t->points->point[i].position.x - cx) / h,
                   y = ((double)t->points->point[i].position.y - cy) / h;
            double e = exp(-x * x - y * y),
                   *a = coefficient + (size_t)c->slot[k] * TERMS * (size_t)t->weights;

            monomials(x, y, m);
            for (int term = 0; term < TERMS; term++, a += t->weights)
                for (int w = 0; w < t->weights; w++)
                    a[w] += e * m[term] * t->factor[term] * t->harmonic[i][w];
        }
    }
    return coefficient;
}

/* Adds the gradient of the expansion of a cluster at (x, y), in h from its centre, times scale. */
static void add_cluster(const transform *t, const double *a, int32_t i, double x, double y,
                        double scale)
{
    double m[TERMS], sum[TERMS], e = exp(-x * x - y * y), value = 0, gx = 0, gy = 0;

    monomials(x, y, m);
    for (int term = 0; term < TERMS; term++, a += t->weights) {
        sum[term] = 0;
        for (int w = 0; w < t->weights; w++)
            sum[term] += a[w] * t->share[w] * t->harmonic[i][w];
        value += sum[term] * m[term];
    }
    for (int degree = 1, at = 1; degree < DEGREE; at += ++degree)
        for (int j = 0; j <= degree; j++) {
            if (j < degree)
                gx += sum[at + j] * (degree - j) * m[at - degree + j];
            if (j > 0)
                gy += sum[at + j] * j * m[at - degree + j - 1];
        }
    t->force[i][0] += scale * e * (gx - 2 * x * value);
    t->force[i][1] += scale * e * (gy - 2 * y * value);
}

/* Adds weight times the sum of d exp(-r^2 / h^2). */
static int add_gaussian(const transform *t, double h, double weight)
{
    double *coefficient = NULL, reach = CUT_OFF * h;
    cells c = {0};
    int32_t around;

    if (cells_open(&c, t->points, CELL_SIDE * h))
        coefficient = expand(t, &c, h);
    around = (int32_t)(reach / c.side) + 1;
    for (int32_t i = 0; i < t->points->count && coefficient != NULL; i++) {
        cairn_vec2 p = t->points->point[i].position;
        int32_t cell = cell_of(&c, p), row = cell / c.columns, column = cell % c.columns;

        for (int32_t v = row - around; v <= row + around; v++)
            for (int32_t u = column - around; u <= column + around; u++) {
                double x, y;

                if (u < 0 || v < 0 || u >= c.columns || v >= c.rows ||
                    c.slot[v * c.columns + u] < 0)
                    continue;
                x = (double)p.x - ((u + 0.5) * c.side - 1);
                y = (double)p.y - ((v + 0.5) * c.side - 1);
                if (x * x + y * y <= reach * reach)
                    add_cluster(t,
                                coefficient +
                                    (size_t)c.slot[v * c.columns + u] * TERMS * (size_t)t->weights,
                                i, x / h, y / h, weight * h / 2);
            }
    }
    cells_close(&c);
    free(coefficient);
    return coefficient != NULL;
}

/* 1 / r as Gaussians exp(-decay r^2): their number. */
static int32_t make_gaussians(double sigma, double *decay, double *weight)
{
    double wide = 0, step = exp(STEP_RATIO), at = LEAST_DECAY / sigma;
    int32_t count = 1;

    for (double e = at / step; e > 1e-6 * at; e /= step)
        wide += e;
    decay[0] = 0;
    weight[0] = wide;
    for (; at < 2 / (LEAST_R * sigma) && count < MAX_GAUSSIANS; at *= step, count++) {
        decay[count] = at * at;
        weight[count] = at;
    }
    for (int32_t k = 0; k < count; k++)
        weight[k] *= 2 * STEP_RATIO / sqrt(PI);
    return count;
}

/* Seconds, -1 on failure. */
static double run_transform(const points *p, double sigma, int32_t harmonics, const int32_t *sample,
                            double (*forces)[2], int32_t *gaussians)
{
    transform t = {.points = p, .harmonics = harmonics, .weights = 2 * harmonics + 1};
    double decay[MAX_GAUSSIANS], weight[MAX_GAUSSIANS], start = bench_cpu_seconds(), seconds;
    int done;

    t.harmonic = malloc((size_t)p->count * sizeof *t.harmonic);
    t.force = calloc((size_t)p->count, sizeof *t.force);
    done = t.harmonic != NULL && t.force != NULL;
    factors(t.factor);
    t.share[0] = 2 / PI;
    for (int32_t k = 1; k <= harmonics; k++)
        t.share[2 * k - 1] = t.share[2 * k] = (k % 2 ? 4 : -4) / (PI * (4.0 * k * k - 1));
    for (int32_t i = 0; i < p->count && done; i++)
        harmonics_of(p->point[i].direction, harmonics, t.harmonic[i]);
    *gaussians = make_gaussians(sigma, decay, weight);
    for (int32_t k = 0; k < *gaussians && done; k++) {
        double h = 1 / sqrt(1 / (2 * sigma * sigma) + decay[k]);

        done = add_gaussian(&t, h, weight[k] / (sigma * sqrt(2 * PI)));
    }
    seconds = bench_cpu_seconds() - start;
    for (int k = 0; k < SAMPLE && done; k++)
        memcpy(forces[k], t.force[sample[k]], sizeof forces[k]);
    free(t.harmonic);
    free(t.force);
    return done ? seconds : -1;
}

/* ---- Comparison ---- */

/* Root mean square error relative to the root mean square force. */
static double error_of(double (*forces)[2], double (*truth)[2])
{
    double error = 0, size = 0;

    for (int k = 0; k < SAMPLE; k++)
        for (int d = 0; d < 2; d++) {
            error += (forces[k][d] - truth[k][d]) * (forces[k][d] - truth[k][d]);
            size += truth[k][d] * truth[k][d];
        }
    return sqrt(error / size);
}

static int compare(const points *p, double sigma, int32_t harmonics)
{
    double forces[SAMPLE][2], truth[SAMPLE][2], field, transformed, field_error, transform_error;
    int32_t sample[SAMPLE], gaussians;

    for (int k = 0; k < SAMPLE; k++) {
        sample[k] = (int32_t)((int64_t)p->count * k / SAMPLE);
        slow_force(p, sample[k], sigma, 0, truth[k]);
    }
    field = run_field(p, sigma, sample, forces);
    field_error = error_of(forces, truth);
    for (int k = 0; k < SAMPLE; k++)
        slow_force(p, sample[k], sigma, 1, truth[k]);
    transformed = run_transform(p, sigma, harmonics, sample, forces, &gaussians);
    transform_error = error_of(forces, truth);
    if (field < 0 || transformed < 0) {
        fprintf(stderr, "bench/gauss: failed\n");
        return 0;
    }
    bench_json_begin("gauss");
    bench_json_integer("points", p->count);
    bench_json_number("sigma", sigma);
    bench_json_number("field_ms", 1e3 * field);
    bench_json_number("field_error", field_error);
    bench_json_number("transform_ms", 1e3 * transformed);
    bench_json_number("transform_error", transform_error);
    bench_json_integer("gaussians", gaussians);
    bench_json_integer("harmonics", harmonics);
    bench_json_number("ratio", transformed / field);
    bench_json_end();
    return 1;
}

int main(int argc, char **argv)
{
    static const double sigmas[] = {0.04, 0.15, 0.5, 1};
    int64_t harmonics = 8, most = 100000, seed = 1;
    double sigma = 0;
    const option table[] = {
        OPTION_INTEGER("--harmonics", &harmonics, 0, 32, "N",
                       "of |cos| of the difference of directions"),
        OPTION_INTEGER("--points", &most, 1000, 1000000, "N", "at most; 1000, 10000 ..."),
        OPTION_NUMBER("--sigma", &sigma, 0, 2, "M", "this one alone, m; 0: 0.04, 0.15, 0.5 and 1"),
        OPTION_INTEGER("--seed", &seed, 0, 9e15, "N", "of the walls"),
    };
    const option_set set = {"bench/gauss", "[options]",
                            "The fast Gauss transform against the sums of force_field.", table,
                            sizeof table / sizeof *table};
    size_t words = 0;
    int done = 1;

    switch (options_read(&set, argc, argv, NULL, &words)) {
    case OPTIONS_HELPED:
        return 0;
    case OPTIONS_BAD:
        return 2;
    default:
        break;
    }
    for (int32_t count = 1000; count <= most && done; count *= 10) {
        points p = {0};

        done = make_points(&p, count, (uint64_t)seed);
        for (size_t k = 0; k < sizeof sigmas / sizeof *sigmas && done; k++)
            if (sigma <= 0 || k == 0)
                done = compare(&p, sigma > 0 ? sigma : sigmas[k], (int32_t)harmonics);
        free(p.point);
    }
    return done ? 0 : 1;
}
