/* bench/symmetry: axes of self-similarity of shapes whose axis is known. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_shapes.h"
#include "cairn/self_similarity.h"
#include "tools/options.h"

#define PROGRAM "bench/symmetry"
#define DEGREE  0.017453292519943295
/* An end is right within this share of the outline. */
#define NEAR 0.05

enum { MODES = 2 };

static const char *const mode_names[MODES] = {"as written", "re-ranked"};

typedef struct settings {
    int64_t shapes;
    uint64_t seed;
    double bend, skew, noise, turn;
    int32_t articulated, mpeg7, each;
    const char *data;
} settings;

/* What a mode did over all shapes. */
typedef struct sums {
    cairn_self_similarity *similarity;
    int64_t shapes, hits, among, units;
    double *seconds; /* [shapes] */
} sums;

static int open_mode(sums *t, cairn_pool *pool, cairn_symmetry_mode mode, int64_t shapes)
{
    cairn_self_similarity_params params = cairn_self_similarity_default();
    size_t need;
    void *memory;

    params.mode = mode;
    need = cairn_self_similarity_memory(&params);
    memory = malloc(need + CAIRN_ALIGN);
    memset(t, 0, sizeof *t);
    t->seconds = calloc((size_t)shapes, sizeof *t->seconds);
    return t->seconds != NULL && memory != NULL && cairn_pool_init(pool, memory, need + CAIRN_ALIGN) == CAIRN_OK &&
           cairn_self_similarity_create(&t->similarity, pool, &params) == CAIRN_OK;
}

/* 0: the library refused the shape. */
static int analyze(sums *t, const cairn_curve *outlines, int32_t count, cairn_self_similarity_result *result)
{
    double start = bench_seconds();
    cairn_budget budget = {INT32_MAX};

    if (cairn_self_similarity_begin(t->similarity, outlines, count) != CAIRN_OK ||
        cairn_self_similarity_step(t->similarity, &budget) != CAIRN_OK)
        return 0;
    t->seconds[t->shapes++] = bench_seconds() - start;
    t->units += INT32_MAX - budget.left;
    *result = cairn_self_similarity_read(t->similarity);
    return 1;
}

/* Of an axis to the true one, the farther end, as a share of the outline. */
static double ends_off(const cairn_symmetry_axis *axis, const double end[2])
{
    double off[2] = {0, 0};

    for (int flip = 0; flip < 2; flip++)
        for (int k = 0; k < 2; k++) {
            double d = fabs((double)axis->place[k] - end[flip ? 1 - k : k]);

            off[flip] = fmax(off[flip], fmin(d, 1 - d));
        }
    return fmin(off[0], off[1]);
}

static void print_axis(const char *name, const cairn_symmetry_axis *axis)
{
    char key[64];

    (void)snprintf(key, sizeof key, "%s_dissimilarity", name);
    bench_json_number(key, (double)axis->dissimilarity);
    (void)snprintf(key, sizeof key, "%s_misfit", name);
    bench_json_number(key, (double)axis->misfit);
    (void)snprintf(key, sizeof key, "%s_warp", name);
    bench_json_number(key, (double)axis->warp);
    (void)snprintf(key, sizeof key, "%s_bend", name);
    bench_json_number(key, (double)axis->bend / DEGREE);
    (void)snprintf(key, sizeof key, "%s_skew", name);
    bench_json_number(key, (double)axis->skew);
}

/* right: the place of the true axis in the list, or beyond it. */
static void print_each(const settings *s, int mode, uint64_t seed, double off, int32_t right,
                       const cairn_self_similarity_result *r)
{
    if (!s->each)
        return;
    bench_json_begin("symmetry");
    bench_json_text("mode", mode_names[mode]);
    bench_json_integer("seed", (int64_t)seed);
    bench_json_number("ends_off", off);
    bench_json_integer("axes", r->count);
    bench_json_integer("ties", r->ties);
    bench_json_integer("right", right);
    if (r->count > 0)
        print_axis("first", &r->axes[0]);
    if (right < r->count)
        print_axis("right", &r->axes[right]);
    bench_json_end();
}

static int run_generated(const settings *s, sums t[MODES])
{
    static bench_shape shape;

    for (int64_t i = 0; i < s->shapes; i++) {
        uint64_t seed = s->seed * 100000 + (uint64_t)i;

        if (!s->articulated)
            bench_shape_swept(&shape, seed, s->bend * DEGREE, s->skew, s->noise);
        else if (!bench_shape_articulated(&shape, seed, s->turn * DEGREE))
            return 0;
        for (int mode = 0; mode < MODES; mode++) {
            cairn_curve outline = {shape.points, shape.count, 1};
            cairn_self_similarity_result r;
            double off = 1, best = 1;
            int32_t right = 0;

            if (!analyze(&t[mode], &outline, 1, &r))
                return 0;
            for (int32_t k = 0; k < r.count; k++) {
                right = best > NEAR ? k : right;
                best = fmin(best, ends_off(&r.axes[k], shape.end));
                off = k == 0 ? best : off;
            }
            t[mode].hits += off <= NEAR;
            t[mode].among += best <= NEAR;
            print_each(s, mode, seed, off, best > NEAR ? r.count : right, &r);
        }
    }
    return 1;
}

static void print_summary(const settings *s, int mode, sums *t)
{
    double n = t->shapes > 0 ? (double)t->shapes : 1;

    bench_json_begin("symmetry");
    bench_json_text("mode", mode_names[mode]);
    bench_json_text("shapes_of", s->mpeg7 ? "mpeg7" : s->articulated ? "articulated" : "swept");
    bench_json_integer("shapes", t->shapes);
    if (!s->mpeg7)
        bench_json_integer("seed", (int64_t)s->seed);
    if (s->articulated) {
        bench_json_number("turn", s->turn);
    } else if (!s->mpeg7) {
        bench_json_number("bend", s->bend);
        bench_json_number("skew", s->skew);
        bench_json_number("noise", s->noise);
    }
    bench_json_number("hit_rate", (double)t->hits / n);
    bench_json_number("among_listed", (double)t->among / n);
    bench_json_number("seconds_median", bench_median(t->seconds, (size_t)t->shapes));
    bench_json_number("units", (double)t->units / n);
    bench_json_true("summary");
    bench_json_end();
}

static option_result read_settings(settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_INTEGER("--shapes", &s->shapes, 1, 100000, "N", "generated shapes"),
        OPTION_SEED("--seed", &s->seed, "of the shapes"),
        OPTION_NUMBER("--bend", &s->bend, 0, 150, "DEG", "of the axis, to either side"),
        OPTION_NUMBER("--skew", &s->skew, 0, 1, "X", "shear along the axis, to either side"),
        OPTION_NUMBER("--noise", &s->noise, 0, 20, "PX",
                      "of the outline's vertices, 4 px apart; the axis is 200 px long"),
        OPTION_FLAG("--articulated", &s->articulated, "bodies with limbs that are turned at their joints"),
        OPTION_NUMBER("--turn", &s->turn, 0, 80, "DEG", "of limbs, at most, to either side"),
        OPTION_FLAG("--mpeg7", &s->mpeg7, "shapes of MPEG-7 that have a mirror axis"),
        OPTION_FLAG("--each", &s->each, "a line for each shape, too"),
        OPTION_TEXT("--data", &s->data, "DIR", "where shapes/mpeg7 is, or the folder of the shapes"),
    };
    const option_set set = {PROGRAM, "[options]", "Axes of self-similarity of shapes whose axis is known.", table,
                            sizeof table / sizeof *table};
    size_t count = 0;
    option_result result = options_read(&set, argc, argv, NULL, &count);

    if (result == OPTIONS_READ && s->articulated && s->mpeg7)
        return (option_result)options_refuse(PROGRAM, "--articulated and --mpeg7, expected one of them");
    return result;
}

int main(int argc, char **argv)
{
    settings s = {.shapes = 200, .seed = 1, .turn = 60, .data = "../shared/data"};
    option_result result = read_settings(&s, argc, argv);
    cairn_pool pools[MODES];
    sums t[MODES];
    int ok = 1;

    if (result != OPTIONS_READ)
        return (int)result;
    for (int mode = 0; mode < MODES; mode++)
        ok = ok && open_mode(&t[mode], &pools[mode], mode, s.shapes);
    ok = ok && run_generated(&s, t);
    for (int mode = 0; mode < MODES && ok; mode++)
        print_summary(&s, mode, &t[mode]);
    if (!ok)
        fprintf(stderr, PROGRAM ": a shape could not be looked at\n");
    return ok ? 0 : 1;
}
