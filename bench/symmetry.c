/* bench/symmetry: axes of self-similarity of shapes whose axis is known, a line for the method
 * as written in the thesis, then one for the default; --as-written: the first alone. */
#include <dirent.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_reflection.h"
#include "bench/bench_shapes.h"
#include "cairn/self_similarity.h"
#include "cairn/shape_image.h"
#include "cairn/vision.h"
#include "src/host/base/degrees.h"
#include "tools/options.h"

#define PROGRAM "bench/symmetry"
/* An end is right within this share of the outline. */
#define END_TOLERANCE 0.05
/* A shape has a mirror axis when its intersection over union with its mirror image is at least
 * this. */
#define MIN_MIRROR_OVERLAP 0.9

enum { MODES = 2, MAX_FILES = 4096 };

/* In the order of the lines. */
static const int32_t modes[MODES] = {CAIRN_MODE_AS_WRITTEN, CAIRN_MODE_DEFAULT};
static const char *const mode_names[MODES] = {"as written", "re-ranked"};

typedef struct settings {
    int64_t shapes;
    uint64_t seed;
    double bend, skew, noise, turn;
    int32_t articulated, mpeg7, each, as_written;
    int modes; /* how many of modes[] are run */
    const char *data;
} settings;

/* Results of a mode over all shapes. */
typedef struct sums {
    cairn_self_similarity *similarity;
    int64_t shapes, hits, among, units;
    void *memory;
    double *seconds; /* [shapes] */
} sums;

static int open_mode(sums *t, cairn_pool *pool, int32_t mode, int64_t shapes)
{
    cairn_self_similarity_params params = cairn_self_similarity_default();
    size_t need;
    void *memory;

    params.mode = mode;
    need = cairn_self_similarity_memory(&params);
    memory = malloc(need + CAIRN_ALIGN);
    memset(t, 0, sizeof *t);
    t->memory = memory;
    t->seconds = calloc((size_t)shapes, sizeof *t->seconds);
    return t->seconds != NULL && memory != NULL &&
           cairn_pool_init(pool, memory, need + CAIRN_ALIGN) == CAIRN_OK &&
           cairn_self_similarity_create(&t->similarity, pool, &params) == CAIRN_OK;
}

/* 0: the library refused the shape. */
static int analyze(sums *t, const cairn_curve *outlines, int32_t count,
                   cairn_self_similarity_result *result)
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

/* Distance of the axis from the true one: the farther end, as a share of the outline. */
static double ends_off(const cairn_self_similarity_axis *axis, const double end[2])
{
    double off[2] = {0, 0};

    for (int flip = 0; flip < 2; flip++)
        for (int k = 0; k < 2; k++) {
            double d = fabs((double)axis->position[k] - end[flip ? 1 - k : k]);

            off[flip] = fmax(off[flip], fmin(d, 1 - d));
        }
    return fmin(off[0], off[1]);
}

static void print_axis(const char *name, const cairn_self_similarity_axis *axis)
{
    char key[64];

    (void)snprintf(key, sizeof key, "%s_dissimilarity", name);
    bench_json_number(key, (double)axis->dissimilarity);
    (void)snprintf(key, sizeof key, "%s_misfit", name);
    bench_json_number(key, (double)axis->mirror_residual);
    (void)snprintf(key, sizeof key, "%s_warp", name);
    bench_json_number(key, (double)axis->dtw_cost);
    (void)snprintf(key, sizeof key, "%s_bend", name);
    bench_json_number(key, (double)axis->bend / CAIRN_DEGREE);
    (void)snprintf(key, sizeof key, "%s_skew", name);
    bench_json_number(key, (double)axis->skew);
}

/* right: rank of the true axis in the list, or beyond it. */
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
    bench_json_integer("ties", r->tie_count);
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
            bench_shape_swept(&shape, seed, s->bend * CAIRN_DEGREE, s->skew, s->noise);
        else if (!bench_shape_articulated(&shape, seed, s->turn * CAIRN_DEGREE))
            return 0;
        for (int mode = 0; mode < s->modes; mode++) {
            cairn_curve outline = {shape.points, shape.count, 1};
            cairn_self_similarity_result r;
            double off = 1, best = 1;
            int32_t right = 0;

            if (!analyze(&t[mode], &outline, 1, &r))
                return 0;
            for (int32_t k = 0; k < r.count; k++) {
                right = best > END_TOLERANCE ? k : right;
                best = fmin(best, ends_off(&r.axes[k], shape.end));
                off = k == 0 ? best : off;
            }
            t[mode].hits += off <= END_TOLERANCE;
            t[mode].among += best <= END_TOLERANCE;
            print_each(s, mode, seed, off, best > END_TOLERANCE ? r.count : right, &r);
        }
    }
    return 1;
}

/* ---- MPEG-7 ---- */

static int compare_names(const void *a, const void *b)
{
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

/* The names of a folder's images, sorted. */
static int32_t read_names(const char *folder, char **names)
{
    DIR *open = opendir(folder);
    struct dirent *entry;
    int32_t count = 0;

    while (open != NULL && count < MAX_FILES && (entry = readdir(open)) != NULL) {
        size_t length = strlen(entry->d_name);

        if (length < 5 || strcmp(entry->d_name + length - 4, ".png") != 0)
            continue;
        names[count] = malloc(length + 1);
        if (names[count] == NULL)
            break;
        memcpy(names[count++], entry->d_name, length + 1);
    }
    if (open != NULL)
        (void)closedir(open);
    if (count > 1)
        qsort(names, (size_t)count, sizeof *names, compare_names);
    return count;
}

/* Returns 1 when the axis is one of the best or ties with them. */
static int is_right(const bench_reflections *truth, const cairn_curve *shape, int32_t count,
                    const cairn_self_similarity_axis *axis, cairn_vec2 middle)
{
    cairn_vec2 from = axis->mirror_point, to = cairn_vec2_add(from, axis->mirror_direction);

    return bench_reflections_hit(truth, from, to, middle) ||
           bench_reflections_overlap(shape, count, from, to) >=
               truth->axes[0].overlap - BENCH_AS_GOOD;
}

/* Processes one image when it has a mirror axis. 0: a line was printed. */
static int run_picture(const settings *s, sums t[MODES], const char *path, const char *name)
{
    cairn_shape_image_params params = cairn_shape_image_default();
    cairn_curve shape[CAIRN_SHAPE_MODEL_MAX_OUTLINES];
    cairn_shape_image image;
    cairn_vision_image grey;
    cairn_raster_u8_view view;
    bench_reflections truth;
    cairn_file_error error;
    int32_t count = 1;
    int ok;

    if (cairn_vision_read_grey(&grey, path, &error) != CAIRN_OK) {
        fprintf(stderr, PROGRAM ": %s\n", error.text);
        return 0;
    }
    view = (cairn_raster_u8_view){grey.samples, grey.width, grey.height, grey.width};
    ok = cairn_shape_image_trace(&image, view, &params, path, &error) == CAIRN_OK;
    cairn_vision_free(&grey);
    if (!ok) {
        fprintf(stderr, PROGRAM ": %s, passed over\n", error.text);
        return 1;
    }
    shape[0] = image.outlines[0];
    for (int32_t i = image.count - image.holes; i < image.count; i++)
        if (cairn_polygon_contains(shape[0].points, shape[0].count, image.outlines[i].points[0]))
            shape[count++] = image.outlines[i];
    ok = bench_reflections_find(&truth, shape, count);
    for (int mode = 0;
         mode < s->modes && ok && truth.count > 0 && truth.axes[0].overlap >= MIN_MIRROR_OVERLAP;
         mode++) {
        cairn_self_similarity_result r = {.count = 0};
        cairn_box box = cairn_box_empty();
        cairn_vec2 middle;
        int among = 0, first = 0;
        int32_t right = 0;

        for (int32_t i = 0; i < shape[0].count; i++)
            box = cairn_box_extend(box, shape[0].points[i]);
        middle = cairn_vec2_scale(cairn_vec2_add(box.min, box.max), (cairn_real)0.5);
        ok = analyze(&t[mode], shape, count, &r);
        for (int32_t k = 0; k < r.count && ok && !among; k++) {
            right = k;
            among |= is_right(&truth, shape, count, &r.axes[k], middle);
            first = k == 0 ? among : first;
        }
        t[mode].hits += first;
        t[mode].among += among;
        if (s->each && ok) {
            bench_json_begin("symmetry");
            bench_json_text("mode", mode_names[mode]);
            bench_json_text("shape", name);
            bench_json_number("overlap", truth.axes[0].overlap);
            bench_json_integer("true_axes", truth.count);
            bench_json_integer("hit", first);
            bench_json_integer("listed", among);
            if (r.count > 0)
                print_axis("first", &r.axes[0]);
            if (among)
                print_axis("right", &r.axes[right]);
            bench_json_integer("right", among ? right : r.count);
            bench_json_end();
        }
    }
    cairn_shape_image_free(&image);
    return ok;
}

/* An exit code. */
static int run_mpeg7(const settings *s, sums t[MODES])
{
    static char *names[MAX_FILES];
    char folder[2048], path[4096];
    int32_t count;
    int ok = 1;

    (void)snprintf(folder, sizeof folder, "%s/shapes/mpeg7", s->data);
    count = read_names(folder, names);
    if (count == 0) {
        (void)snprintf(folder, sizeof folder, "%s", s->data);
        count = read_names(folder, names);
    }
    if (count == 0) {
        fprintf(stderr,
                PROGRAM ": %s/shapes/mpeg7: no pictures, expected the shapes of MPEG-7 (--data)\n",
                s->data);
        return 3;
    }
    for (int32_t i = 0; i < count; i++) {
        (void)snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        ok = ok && (t[0].shapes >= s->shapes || run_picture(s, t, path, names[i]));
        free(names[i]);
    }
    return ok ? 0 : 1;
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
        OPTION_INTEGER("--shapes", &s->shapes, 1, 100000, "N",
                       "shapes at most; without it 200, or all of MPEG-7"),
        OPTION_SEED("--seed", &s->seed, "of the shapes"),
        OPTION_NUMBER("--bend", &s->bend, 0, 150, "DEG", "of the axis, to either side"),
        OPTION_NUMBER("--skew", &s->skew, 0, 1, "X", "shear along the axis, to either side"),
        OPTION_NUMBER("--noise", &s->noise, 0, 20, "PX",
                      "of the outline's vertices, 4 px apart; the axis is 200 px long"),
        OPTION_FLAG("--articulated", &s->articulated,
                    "bodies with limbs that are turned at their joints"),
        OPTION_NUMBER("--turn", &s->turn, 0, 80, "DEG", "of limbs, at most, to either side"),
        OPTION_FLAG("--mpeg7", &s->mpeg7, "shapes of MPEG-7 that have a mirror axis"),
        OPTION_FLAG("--as-written", &s->as_written, "the method of the thesis alone"),
        OPTION_FLAG("--each", &s->each, "a line for each shape, too"),
        OPTION_TEXT("--data", &s->data, "DIR",
                    "where shapes/mpeg7 is, or the folder of the shapes"),
    };
    const option_set set = {PROGRAM, "[options]",
                            "Axes of self-similarity of shapes whose axis is known.", table,
                            sizeof table / sizeof *table};
    size_t count = 0;
    option_result result = options_read(&set, argc, argv, NULL, &count);

    if (result == OPTIONS_READ && s->articulated && s->mpeg7)
        return (option_result)options_refuse(PROGRAM,
                                             "--articulated and --mpeg7, expected one of them");
    return result;
}

int main(int argc, char **argv)
{
    settings s = {.shapes = 0, .seed = 1, .turn = 60, .data = "../shared/data"};
    option_result result = read_settings(&s, argc, argv);
    cairn_pool pools[MODES];
    sums t[MODES];
    int code;

    if (result != OPTIONS_READ)
        return (int)result;
    if (s.shapes == 0)
        s.shapes = s.mpeg7 ? MAX_FILES : 200;
    s.modes = s.as_written ? 1 : MODES;
    for (int mode = 0; mode < s.modes; mode++)
        if (!open_mode(&t[mode], &pools[mode], modes[mode], s.shapes)) {
            fprintf(stderr, PROGRAM ": no memory\n");
            return 1;
        }
    code = s.mpeg7 ? run_mpeg7(&s, t) : !run_generated(&s, t);
    for (int mode = 0; mode < s.modes && code == 0; mode++)
        print_summary(&s, mode, &t[mode]);
    for (int mode = 0; mode < s.modes; mode++) {
        free(t[mode].seconds);
        free(t[mode].memory);
    }
    if (code == 1)
        fprintf(stderr, PROGRAM ": a shape could not be looked at\n");
    return code;
}
