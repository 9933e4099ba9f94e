/* bench/skeleton: skeletons and contours without a model (chapter 3), on generated scenes; needs no
 * data.
 *
 * A scene holds one object swept by discs along known axes (bench_sweep), 120 px times 0.7 ... 1.3,
 * rotated at random, among --k others, with noise of --noise grey levels. Only the range of radii
 * is given, from 0.8 of the object's least to 1.2 of its largest, both times --wrong. Measures of
 * the likeliest object:
 * - skeleton_f: F measure of the places of its axis and the true one, within 1 % of the image's
 *   diagonal of the other;
 * - radius_error: median over scenes of the median over right places of the axis;
 * - boundary_f: F measure of the contour at 3 px; disks_iou: of the union of its discs with the
 *   object; free_ends: mean share of the true number.
 *
 * all_f and all_boundary_f count every part that was found; parts is their mean number. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_bsds.h"
#include "bench/bench_group.h"
#include "bench/bench_json.h"
#include "bench/bench_skeleton.h"
#include "bench/bench_sweep.h"
#include "cairn/boundary.h"
#include "cairn/skeleton_grouping.h"
#include "tools/options.h"

#define LEAST_RECALL 0.3

typedef struct settings {
    int64_t scenes, seed, k, images;
    int64_t particles; /* 0: not given */
    double noise, wrong, slope, sigma;
    double contrast; /* NaN: not given */
    const char *weight, *draw, *data;
    int32_t each, propose, bsds, written;
} settings;

typedef struct finder {
    cairn_pool pool;
    void *memory;
    cairn_edgel_set *edgels;
    cairn_skeleton_grouping *skeleton;
    cairn_boundary *boundary; /* of photographs alone */
} finder;

typedef struct sums {
    int32_t scenes;
    double f, all_f, boundary_f, all_boundary_f, parts, iou, ends, errors;
    double *seconds, *error;
} sums;

static int open_finder(finder *f, const settings *s)
{
    cairn_boundary_params boundary = cairn_boundary_default();
    cairn_edgel_params edgel = cairn_edgel_default();
    cairn_skeleton_grouping_params skeleton =
        s->written ? cairn_skeleton_grouping_as_written() : cairn_skeleton_grouping_default();
    size_t bytes;

    if (s->bsds) {
        edgel.max_width = edgel.max_height = skeleton.max_width = skeleton.max_height = 1024;
        edgel.max_edgels = skeleton.max_edgels = 100000;
        if (!s->written)
            skeleton.min_log_odds = 5;
        boundary.max_width = boundary.max_height = 1024;
    } else {
        edgel.max_width = skeleton.max_width = SCENE_WIDTH;
        edgel.max_height = skeleton.max_height = SCENE_HEIGHT;
    }
    edgel.sigma = (cairn_real)s->sigma;
    edgel.min_gradient = (cairn_real)s->slope;
    if (s->particles > 0)
        skeleton.particle_count = (int32_t)s->particles;
    if (!isnan(s->contrast))
        skeleton.contrast_weight = (cairn_real)s->contrast;
    bytes = cairn_edgel_memory(&edgel) + cairn_skeleton_grouping_memory(&skeleton) + 64 +
            (s->bsds ? cairn_boundary_memory(&boundary) : 0);
    f->memory = malloc(bytes);
    return f->memory != NULL && cairn_pool_init(&f->pool, f->memory, bytes) == CAIRN_OK &&
           cairn_edgel_create(&f->edgels, &f->pool, &edgel) == CAIRN_OK &&
           cairn_skeleton_grouping_create(&f->skeleton, &f->pool, &skeleton) == CAIRN_OK &&
           (!s->bsds || cairn_boundary_create(&f->boundary, &f->pool, &boundary) == CAIRN_OK);
}

static cairn_status run_edgels(cairn_edgel_set *set)
{
    cairn_budget budget = {INT32_MAX};
    cairn_status status;

    do {
        budget.left = INT32_MAX;
        status = cairn_edgel_step(set, &budget);
    } while (status == CAIRN_MORE);
    return status;
}

static cairn_status run_skeleton(cairn_skeleton_grouping *skeleton)
{
    cairn_budget budget = {INT32_MAX};
    cairn_status status;

    do {
        budget.left = INT32_MAX;
        status = cairn_skeleton_grouping_step(skeleton, &budget);
    } while (status == CAIRN_MORE);
    return status;
}

/* Radii in px: [least, most], or 0 and 0. 0: it cannot be grouped. */
static int group(finder *f, cairn_raster_u8_view grey, double least, double most)
{
    cairn_skeleton_grouping_input in;

    if (cairn_edgel_begin(f->edgels, grey) != CAIRN_OK || run_edgels(f->edgels) != CAIRN_OK)
        return 0;
    in.edgels = cairn_edgel_list(f->edgels, &in.count);
    in.width = grey.width;
    in.height = grey.height;
    in.min_radius = (cairn_real)least;
    in.max_radius = (cairn_real)most;
    return cairn_skeleton_grouping_begin(f->skeleton, &in) == CAIRN_OK &&
           run_skeleton(f->skeleton) == CAIRN_OK;
}

static int find(finder *f, const scene *s, double least, double most)
{
    static uint8_t grey[SCENE_PIXELS];
    cairn_raster_u8_view view = {grey, SCENE_WIDTH, SCENE_HEIGHT, SCENE_WIDTH};

    for (int32_t i = 0; i < SCENE_PIXELS; i++)
        grey[i] = (uint8_t)fmax(0, fmin(255, rint((double)s->grey[i])));
    return group(f, view, least, most);
}

/* ---- Scenes ---- */

static void dot(uint8_t *pixels, double x, double y, int red, int green, int blue)
{
    int32_t u = (int32_t)lrint(x), v = (int32_t)lrint(y);

    if (u < 0 || v < 0 || u >= SCENE_WIDTH || v >= SCENE_HEIGHT)
        return;
    pixels[3 * (v * SCENE_WIDTH + u)] = (uint8_t)red;
    pixels[3 * (v * SCENE_WIDTH + u) + 1] = (uint8_t)green;
    pixels[3 * (v * SCENE_WIDTH + u) + 2] = (uint8_t)blue;
}

/* The likeliest object's contours blue and axes red, those of others dark, the true axis green:
 * PPM. */
static void draw(const settings *set, int64_t index, const scene *s,
                 const cairn_skeleton_grouping_result *r, const skeleton_places *truth)
{
    static uint8_t pixels[3 * SCENE_PIXELS];
    char path[512];
    FILE *file;

    snprintf(path, sizeof path, "%s/%03" PRId64 ".ppm", set->draw, index);
    file = fopen(path, "wb");
    if (file == NULL)
        return;
    for (int32_t i = 0; i < 3 * SCENE_PIXELS; i++)
        pixels[i] = (uint8_t)fmin(255, fmax(0, (double)s->grey[i / 3]));
    for (int32_t i = 0; i < truth->count; i++)
        dot(pixels, truth->at[i].x, truth->at[i].y, 0, 200, 0);
    for (int32_t i = 0; i < r->part_count; i++) {
        int bright = r->parts[i].object == 0 ? 255 : 110;
        static skeleton_places way;

        for (int what = 0; what < 3; what++) {
            const cairn_skeleton_grouping_point *q = &r->points[r->parts[i].first];

            way.count = 0;
            for (int32_t k = 0; k + 1 < r->parts[i].count; k++) {
                cairn_vec2 from = what < 2 ? q[k].contact[what] : q[k].centre;
                cairn_vec2 to = what < 2 ? q[k + 1].contact[what] : q[k + 1].centre;
                skeleton_place a = {(double)from.x, (double)from.y, 0},
                               b = {(double)to.x, (double)to.y, 0};

                skeleton_add_way(&way, a, b);
            }
            for (int32_t end = 0; end < 2 && what == 2; end++)
                if (r->parts[i].joint[end] >= 0)
                    skeleton_add_way(&way, skeleton_place_of(&q[end ? r->parts[i].count - 1 : 0]),
                                     skeleton_place_of(&r->points[r->parts[i].joint[end]]));
            for (int32_t k = 0; k < way.count; k++)
                dot(pixels, way.at[k].x, way.at[k].y, what < 2 ? 0 : bright, 0,
                    what < 2 ? bright : 0);
        }
    }
    fprintf(file, "P6\n%d %d\n255\n", SCENE_WIDTH, SCENE_HEIGHT);
    (void)fwrite(pixels, 1, sizeof pixels, file);
    (void)fclose(file);
}

static void measure(const settings *set, sums *t, const finder *f, const scene *s,
                    const sweep_shape *shape, int64_t index)
{
    static skeleton_places truth, found;
    cairn_skeleton_grouping_result r = cairn_skeleton_grouping_read(f->skeleton);
    double all, axis, error, iou, ends, boundary, all_boundary;

    skeleton_add_truth(&truth, s, shape);
    skeleton_add_found(&found, &r, 1);
    all = skeleton_axis_f(&found, &truth);
    skeleton_add_found(&found, &r, 0);
    axis = skeleton_axis_f(&found, &truth);
    error = skeleton_radius_error(&found, &truth);
    iou = skeleton_discs_iou(&found, s);
    boundary = skeleton_boundary_f(&r, s, 0);
    all_boundary = skeleton_boundary_f(&r, s, 1);
    ends = r.object_count > 0 ? (double)r.objects[0].free_end_count / shape->ends : 0;
    t->f += axis;
    t->all_f += all;
    t->iou += iou;
    t->boundary_f += boundary;
    t->all_boundary_f += all_boundary;
    t->parts += r.part_count;
    t->ends += ends;
    if (error == error)
        t->error[(int32_t)t->errors++] = error;
    if (set->draw != NULL)
        draw(set, index, s, &r, &truth);
    if (!set->each)
        return;
    bench_json_begin("skeleton");
    bench_json_integer("scene", index);
    bench_json_text("family", sweep_family_name((int32_t)(index % SWEEP_FAMILIES)));
    bench_json_number("skeleton_f", axis);
    bench_json_number("all_f", all);
    bench_json_number("radius_error", error);
    bench_json_number("boundary_f", boundary);
    bench_json_number("all_boundary_f", all_boundary);
    bench_json_number("disks_iou", iou);
    bench_json_number("free_ends", ends);
    bench_json_integer("parts", r.part_count);
    bench_json_integer("objects", r.object_count);
    bench_json_number("log_odds", r.object_count > 0 ? (double)r.objects[0].log_odds : 0);
    bench_json_integer("centres", r.centre_count);
    bench_json_integer("lines", r.line_count);
    bench_json_integer("starts", r.seed_count);
    bench_json_number("min_radius", (double)r.min_radius);
    bench_json_number("max_radius", (double)r.max_radius);
    bench_json_number("seconds", t->seconds[t->scenes]);
    bench_json_end();
}

/* ---- Images ---- */

/* For one way to group: its precision compared with Canny's best at its recall. */
typedef struct way_sums {
    double gain, precision, canny, recall;
    int32_t lacking; /* recall below the least */
    double *seconds;
} way_sums;

typedef struct image_sums {
    int32_t images;
    way_sums contours, parts;
} image_sums;

static void add_way_point(const settings *set, way_sums *t, const bsds_image *image,
                          const char *name, const char *way, bsds_point p)
{
    double canny = bsds_canny(image, p.recall);

    t->lacking += p.recall < LEAST_RECALL;
    t->gain += p.precision - canny;
    t->precision += p.precision;
    t->canny += canny;
    t->recall += p.recall;
    if (!set->each)
        return;
    bench_json_begin("skeleton");
    bench_json_text("image", name);
    bench_json_text("grouped", way);
    bench_json_number("precision", p.precision);
    bench_json_number("canny_precision", canny);
    bench_json_number("recall", p.recall);
    bench_json_end();
}

static int find_contours(finder *f, const bsds_image *image)
{
    const cairn_vision_image *c = &image->colour;
    cairn_boundary_image in = {c->samples, c->width, c->height, c->channels,
                               (ptrdiff_t)c->width * c->channels};
    cairn_budget budget = {INT32_MAX};
    cairn_status status;

    if (c->sample_bytes != 1 || cairn_boundary_begin(f->boundary, &in) != CAIRN_OK)
        return 0;
    do {
        budget.left = INT32_MAX;
        status = cairn_boundary_step(f->boundary, &budget);
    } while (status == CAIRN_MORE);
    return status == CAIRN_OK;
}

static int run_image(const settings *set, image_sums *t, finder *f, const char *folder,
                     const char *name)
{
    bsds_image image;
    cairn_raster_u8_view view;
    cairn_skeleton_grouping_result parts;
    cairn_boundary_result contours;
    uint8_t *pixels;
    double start;
    int ok;

    if (!bsds_read(&image, folder, name))
        return 0;
    view.data = image.grey.samples;
    view.width = image.grey.width;
    view.height = image.grey.height;
    view.stride = image.grey.width;
    pixels = malloc((size_t)view.width * (size_t)view.height);
    start = bench_seconds();
    ok = pixels != NULL && find_contours(f, &image);
    t->contours.seconds[t->images] = bench_seconds() - start;
    start = bench_seconds();
    ok = ok && group(f, view, 0, 0);
    t->parts.seconds[t->images] = bench_seconds() - start;
    if (ok) {
        contours = cairn_boundary_read(f->boundary);
        add_way_point(set, &t->contours, &image, name, "contours",
                      bsds_contours(&image, &contours, LEAST_RECALL, pixels));
        parts = cairn_skeleton_grouping_read(f->skeleton);
        add_way_point(set, &t->parts, &image, name, "parts",
                      bsds_grouped(&image, &parts, LEAST_RECALL, pixels));
        t->images++;
    }
    free(pixels);
    bsds_free(&image);
    return ok;
}

static void print_way(const settings *set, const way_sums *t, int32_t images, const char *way,
                      const finder *f)
{
    double n = images;

    bench_json_begin("skeleton");
    bench_json_text("data", "bsds");
    bench_json_text("grouped", way);
    bench_json_text("weight", set->weight);
    bench_json_text("mode", set->written ? "as_written" : "default");
    bench_json_integer("images", images);
    bench_json_number("precision_gain", t->gain / n);
    bench_json_number("precision", t->precision / n);
    bench_json_number("canny_precision", t->canny / n);
    bench_json_number("recall", t->recall / n);
    bench_json_integer("below_recall", t->lacking);
    bench_json_number("seconds_median", bench_median(t->seconds, (size_t)images));
    bench_json_integer("pool_bytes", (int64_t)f->pool.peak);
    bench_json_true("summary");
    bench_json_end();
}

static int run_images(const settings *set, finder *f)
{
    char folder[1024];
    group_names names;
    image_sums t;
    int ok;

    memset(&t, 0, sizeof t);
    (void)snprintf(folder, sizeof folder, "%s/bsds", set->data);
    if (!group_names_read(&names, folder)) {
        fprintf(stderr,
                "bench/skeleton: %s: no images, expected NAME.jpg and NAME_gtK.png (--data)\n",
                folder);
        return 3;
    }
    t.contours.seconds = calloc(2 * (size_t)names.count, sizeof *t.contours.seconds);
    ok = t.contours.seconds != NULL;
    t.parts.seconds = t.contours.seconds + names.count;
    for (int32_t i = 0; i < names.count && ok && i < set->images; i++) {
        fprintf(stderr, "%s\n", names.name[i]);
        ok = run_image(set, &t, f, folder, names.name[i]);
    }
    if (ok) {
        print_way(set, &t.contours, t.images, "contours", f);
        print_way(set, &t.parts, t.images, "parts", f);
    }
    free(t.contours.seconds);
    group_names_free(&names);
    return ok ? 0 : 1;
}

/* ---- Generated scenes ---- */

static int run_scene(const settings *set, sums *t, finder *f, int64_t index)
{
    static scene s;
    cairn_random random = cairn_random_seed((uint64_t)(set->seed + index), 91);
    sweep_shape shape = sweep_draw((int32_t)(index % SWEEP_FAMILIES), &random);
    scene_figure figure = {sweep_contains, &shape, 180};
    scene_options options = {(int32_t)set->k, set->noise, 0, 0};
    double least = 1e9, most = 0, start;

    scene_draw_figure(&s, &figure, &options, &random);
    for (int32_t i = 0; i < shape.limbs * SWEEP_NODES; i++) {
        double r = s.size * shape.nodes[i / SWEEP_NODES][i % SWEEP_NODES].r;

        least = fmin(least, r);
        most = fmax(most, r);
    }
    least = set->propose ? 0 : 0.8 * least * set->wrong;
    most = set->propose ? 0 : 1.2 * most * set->wrong;
    start = bench_seconds();
    if (!find(f, &s, least, most))
        return 0;
    t->seconds[t->scenes] = bench_seconds() - start;
    measure(set, t, f, &s, &shape, index);
    t->scenes++;
    return 1;
}

static void print_summary(const settings *s, const sums *t, const finder *f)
{
    double n = t->scenes;

    bench_json_begin("skeleton");
    bench_json_text("weight", s->weight);
    bench_json_text("mode", s->written ? "as_written" : "default");
    bench_json_integer("scenes", t->scenes);
    bench_json_integer("seed", s->seed);
    bench_json_integer("k", s->k);
    bench_json_number("noise", s->noise);
    bench_json_number("wrong", s->wrong);
    bench_json_number("skeleton_f", t->f / n);
    bench_json_number("radius_error", bench_median(t->error, (size_t)t->errors));
    bench_json_number("boundary_f", t->boundary_f / n);
    bench_json_number("disks_iou", t->iou / n);
    bench_json_number("free_ends", t->ends / n);
    bench_json_number("all_f", t->all_f / n);
    bench_json_number("all_boundary_f", t->all_boundary_f / n);
    bench_json_number("parts", t->parts / n);
    bench_json_number("seconds_median", bench_median(t->seconds, (size_t)t->scenes));
    bench_json_integer("pool_bytes", (int64_t)f->pool.peak);
    bench_json_true("summary");
    bench_json_end();
}

static option_result read_settings(settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_INTEGER("--scenes", &s->scenes, 1, 100000, "N", "scenes"),
        OPTION_INTEGER("--seed", &s->seed, 0, 1e9, "S", "of the first scene"),
        OPTION_INTEGER("--k", &s->k, 0, 1000, "K", "clutter objects"),
        OPTION_NUMBER("--noise", &s->noise, 0, 100, "SIGMA", "grey levels"),
        OPTION_NUMBER("--wrong", &s->wrong, 0.1, 10, "FACTOR",
                      "factor of the given range of radii"),
        OPTION_FLAG("--propose", &s->propose, "no range is given"),
        OPTION_NUMBER("--min-slope", &s->slope, 0.01, 1000, "G",
                      "grey levels per pixel, of edgels"),
        OPTION_NUMBER("--sigma", &s->sigma, 0.7, 8, "PX", "blur before edgels are looked for"),
        OPTION_FLAG("--as-written", &s->written, "Adluru 2008, chapter 3, as it is printed"),
        OPTION_TEXT("--weight", &s->weight, "NAME",
                    "evidence, or as-written, which is --as-written"),
        OPTION_NUMBER(
            "--contrast", &s->contrast, 0, 100, "L",
            "log odds of an edge e times as steep as the mean one; 0: all edges are the same\n"
            "(6); not as written"),
        OPTION_INTEGER("--particles", &s->particles, 1, 1024, "N",
                       "of the filter (16; as written 50)"),
        OPTION_FLAG("--each", &s->each, "a line for each scene, too"),
        OPTION_TEXT("--draw", &s->draw, "DIR", "pictures of what was found"),
        OPTION_FLAG("--bsds", &s->bsds, "Berkeley images in place of scenes, no range given"),
        OPTION_INTEGER("--images", &s->images, 1, 100000, "N", "of them at most"),
        OPTION_TEXT("--data", &s->data, "DIR", "with the folder bsds"),
    };
    const option_set set = {
        "bench/skeleton", "[options]",
        "Groups the contours and axes of objects in generated clutter, with no model of them.",
        table, sizeof table / sizeof *table};
    size_t count = 0;
    option_result result = options_read(&set, argc, argv, NULL, &count);

    if (result != OPTIONS_READ)
        return result;
    if (s->weight != NULL && strcmp(s->weight, "evidence") != 0 &&
        strcmp(s->weight, "as-written") != 0)
        return (option_result)options_refuse(
            "bench/skeleton", "--weight %s, expected evidence or as-written", s->weight);
    if (s->weight != NULL && strcmp(s->weight, "evidence") == 0 && s->written)
        return (option_result)options_refuse(
            "bench/skeleton", "--as-written and --weight evidence, expected one of them");
    s->written |= s->weight != NULL && strcmp(s->weight, "as-written") == 0;
    if (s->written && !isnan(s->contrast))
        return (option_result)options_refuse(
            "bench/skeleton", "--contrast with --as-written, expected one of them: the "
                              "thesis does not use how steep edges are");
    s->weight = s->written ? "as-written" : "evidence";
    return OPTIONS_READ;
}

int main(int argc, char **argv)
{
    settings s = {.scenes = 20,
                  .seed = 1,
                  .k = 10,
                  .noise = 5,
                  .wrong = 1,
                  .slope = 2,
                  .sigma = 1.5,
                  .images = 100000,
                  .data = "../shared/data",
                  .contrast = (double)NAN};
    option_result result = read_settings(&s, argc, argv);
    finder *f;
    sums t;
    int ok;

    if (result != OPTIONS_READ)
        return (int)result;
    memset(&t, 0, sizeof t);
    f = calloc(1, sizeof *f);
    t.seconds = calloc((size_t)s.scenes * 2, sizeof *t.seconds);
    t.error = t.seconds + s.scenes;
    ok = f != NULL && t.seconds != NULL && open_finder(f, &s);
    if (ok && s.bsds) {
        int code = run_images(&s, f);

        free(f->memory);
        free(f);
        free(t.seconds);
        return code;
    }
    for (int64_t i = 0; i < s.scenes && ok; i++) {
        fprintf(stderr, "scene %" PRId64 "\n", i);
        ok = run_scene(&s, &t, f, i);
    }
    if (ok)
        print_summary(&s, &t, f);
    else
        fprintf(stderr, "bench/skeleton: a scene could not be grouped\n");
    if (f != NULL)
        free(f->memory);
    free(f);
    free(t.seconds);
    return ok ? 0 : 1;
}
