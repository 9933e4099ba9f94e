/* bench/group: grouping of objects in the images of the ETHZ shape classes (chapter 2), from their
 * supplied edge images and one drawn model a class.
 *
 * --class NAME: all images of the class's folder with its model, then, unless --no-others, those of
 * the other classes for false groupings. --as-written: the thesis's own method, at the size of each
 * instance's box. --scale given: the size of each instance's box, within a tenth; searched: a tenth
 * of the image's diagonal to the whole.
 *
 * Only the edge pixels within a pixel of a grouping's segments count. Hit (hit_rate): of the
 * outline's pixels with an edge within 3 px, 80 % have the grouping within 3 px, and 60 % of the
 * grouping lie within 4 % of the box's diagonal of the outline; only the best I groupings of an
 * image with I instances. covered_rate: by coverage alone, as the thesis counts. hit_rate_thin:
 * against the midline of the outlines' strokes, some of which are as wide as the tolerance of
 * coverage. With --as-written also points_dropped, symmetric points beyond the capacity, and the
 * numbers of searches by the end of the walk: end_no_start, end_posterior, end_no_follower,
 * end_steps, end_histories (with --each: end, of the instance's).
 *
 * The folders of the original distribution are read unchanged: images .jpg, edges _edges.tif, boxes
 * _CLASS.groundtruth, outlines _CLASS_outlines.pgm or .png, or masks .mask.N.png, whose border is
 * the outline. Instances with neither, or without edges, are left out and counted. */
#include <dirent.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_group.h"
#include "bench/bench_json.h"
#include "cairn/contour_search_run.h"
#include "cairn/object_detect_run.h"
#include "tools/options.h"
#include "src/outlines/contour_grouping_variants.h"

#define SIZE_SLACK 0.1
#define WILSON_Z   1.96
/* Of a detection's size on both sides; least IoU of a grouping with it. */
#define DETECTED_SLACK 1.25
#define DETECTED_IOU   0.5

typedef struct settings {
    const char *class_name, *scale, *data, *draw, *tokens;
    int64_t most, particles, paths, strength, seed, others;
    double score, evidence;
    int32_t no_model, no_skeleton, letter, no_mirror, no_others, each, from_detections, as_written;
    double strong;
    int64_t fold;
} settings;

typedef struct sums {
    int32_t images, instances, hits, covered, thin_hits, false_groupings, own_false, other_images,
        without_outline;
    double coverage, precision;
    double *seconds;
    size_t pool_bytes;
    int32_t timed;
    /* Of the mode as written. */
    int64_t points_dropped;
    int32_t ends[CAIRN_CONTOUR_GROUPING_HISTORIES + 1]; /* searches by why the walk ended */
} sums;

static const struct {
    const char *folder, *model;
} classes[] = {{"Applelogos", "applelogo"},
               {"Bottles", "bottle"},
               {"Giraffes", "giraffe"},
               {"Mugs", "mug"},
               {"Swans", "swan"}};

enum { CLASSES = sizeof classes / sizeof *classes, MAX_SECONDS = 4096 };

static cairn_contour_search_params params_of(const settings *s, const group_image *image)
{
    cairn_contour_search_params p =
        s->as_written ? cairn_contour_search_as_written(image->width, image->height)
                      : cairn_contour_search_default(image->width, image->height);

    p.mirror = p.mirror && !s->no_mirror;
    p.grouping.particles = (int32_t)s->particles;
    if (s->letter)
        p.grouping.mode += CAIRN_CONTOUR_GROUPING_WRITTEN_LETTER;
    contour_grouping_ablate(&p.grouping, s->no_model, s->no_skeleton);
    p.grouping.seed = (uint64_t)s->seed;
    if (s->score >= 0)
        p.min_score = (cairn_real)s->score;
    if (s->evidence >= 0)
        p.min_evidence = (cairn_real)s->evidence;
    return p;
}

static double overlap_with(const cairn_object_detection *d,
                           const cairn_contour_search_result *result,
                           const cairn_contour_search_object *o)
{
    double left = HUGE_VAL, top = HUGE_VAL, right = -HUGE_VAL, bottom = -HUGE_VAL, w, h, both;

    for (int32_t i = 0; i < o->outline_count; i++) {
        const cairn_oriented_point *at = &result->outline[o->first_outline + i].point;

        left = fmin(left, (double)at->position.x);
        top = fmin(top, (double)at->position.y);
        right = fmax(right, (double)at->position.x);
        bottom = fmax(bottom, (double)at->position.y);
    }
    w = fmin(right, (double)d->right) - fmax(left, (double)d->left);
    h = fmin(bottom, (double)d->bottom) - fmax(top, (double)d->top);
    if (!(w > 0) || !(h > 0))
        return 0;
    both = (right - left) * (bottom - top) +
           (double)(d->right - d->left) * (double)(d->bottom - d->top);
    return w * h / (both - w * h);
}

static void keep_detected(cairn_contour_search_result *result, const cairn_object_detection *d)
{
    int32_t kept = 0;

    for (int32_t i = 0; i < result->object_count; i++)
        if (overlap_with(d, result, &result->objects[i]) >= DETECTED_IOU)
            result->objects[kept++] = result->objects[i];
    result->object_count = kept;
}

/* Groups at the size of each detection. */
static int search_detected(const settings *s, const group_image *image,
                           const cairn_contour_search_tokens *tokens,
                           const cairn_shape_model *model, group_found *found,
                           cairn_file_error *error)
{
    cairn_object_detect_params params = cairn_object_detect_default(image->width, image->height);
    const cairn_contour_search_params all = params_of(s, image);
    cairn_object_detect_run_image *field = NULL;
    cairn_object_detections d;
    int ok;

    params.mirror = !s->no_mirror;
    if (cairn_object_detect_run_make(&field, tokens, &params, image->name, error) != CAIRN_OK)
        return 0;
    ok = cairn_object_detect_run(&d, field, model, image->name, error) == CAIRN_OK;
    for (int32_t i = 0; i < d.count && ok; i++) {
        cairn_contour_search_params p = all;
        cairn_contour_search_result result;

        p.min_size =
            (cairn_real)fmax((double)all.min_size, (double)d.found[i].size / DETECTED_SLACK);
        p.max_size =
            (cairn_real)fmin((double)all.max_size, (double)d.found[i].size * DETECTED_SLACK);
        if (p.min_size > p.max_size)
            continue;
        ok = cairn_contour_search_run(&result, tokens, model, &p, image->name, error) == CAIRN_OK;
        if (ok) {
            keep_detected(&result, &d.found[i]);
            group_found_add(found, image, tokens, &result);
            cairn_contour_search_run_free(&result);
        }
    }
    cairn_object_detect_run_free(&d);
    cairn_object_detect_run_free_image(field);
    return ok;
}

/* 0: a line was printed. */
static int search_from_detections(const settings *s, sums *t, const group_image *image,
                                  const cairn_shape_model *model, group_found *found)
{
    cairn_raster_u8_view view = {image->edges, image->width, image->height, image->width};
    cairn_contour_search_tokens tokens;
    cairn_file_error error;
    double start = bench_cpu_seconds();
    int ok = cairn_contour_search_run_tokens(&tokens, view, (int32_t)s->strength,
                                             s->tokens[0] == 'e', image->name, &error) == CAIRN_OK;

    if (ok) {
        ok = search_detected(s, image, &tokens, model, found, &error);
        cairn_contour_search_run_free_tokens(&tokens);
        group_found_sort(found);
    }
    if (ok && t->timed < MAX_SECONDS)
        t->seconds[t->timed++] = bench_cpu_seconds() - start;
    if (!ok)
        fprintf(stderr, "bench/group: %s\n", error.text);
    return ok;
}

static cairn_status find_tokens(const settings *s, const group_image *image,
                                cairn_contour_search_tokens *tokens, cairn_file_error *error)
{
    cairn_raster_u8_view view = {image->edges, image->width, image->height, image->width};
    int32_t edgels = s->tokens[0] == 'e';

    return s->as_written
               ? cairn_contour_search_run_tokens_as_written(tokens, view, (int32_t)s->strength,
                                                            edgels, (cairn_real)s->strong,
                                                            image->name, error)
               : cairn_contour_search_run_tokens(tokens, view, (int32_t)s->strength, edgels,
                                                 image->name, error);
}

/* Runs the search on an image; 0: a line was printed. */
static int search(const settings *s, sums *t, const group_image *image,
                  const cairn_shape_model *model, const cairn_contour_search_params *params,
                  group_found *found)
{
    cairn_contour_search_tokens tokens;
    cairn_contour_search_result result;
    cairn_file_error error;
    double start = bench_cpu_seconds();

    if (find_tokens(s, image, &tokens, &error) != CAIRN_OK ||
        cairn_contour_search_run(&result, &tokens, model, params, image->name, &error) !=
            CAIRN_OK) {
        fprintf(stderr, "bench/group: %s\n", error.text);
        return 0;
    }
    if (t->timed < MAX_SECONDS)
        t->seconds[t->timed++] = bench_cpu_seconds() - start;
    t->pool_bytes = t->pool_bytes > result.pool_bytes + tokens.pool_bytes
                        ? t->pool_bytes
                        : result.pool_bytes + tokens.pool_bytes;
    group_found_add(found, image, &tokens, &result);
    cairn_contour_search_run_free(&result);
    cairn_contour_search_run_free_tokens(&tokens);
    return 1;
}

/* All groupings of an image of the class. */
static int search_own(const settings *s, sums *t, const group_image *image,
                      const cairn_shape_model *model, group_found *found)
{
    cairn_contour_search_params params = params_of(s, image);

    if (s->from_detections)
        return search_from_detections(s, t, image, model, found);
    if (s->scale[0] == 's')
        return search(s, t, image, model, &params, found);
    for (int32_t i = 0; i < image->instances; i++) {
        const group_box *box = &image->box[i];
        double size = hypot(box->right - box->left, box->bottom - box->top);

        if (s->as_written) {
            params.min_size = params.max_size = (cairn_real)fmax(4, size);
            if (!search(s, t, image, model, &params, found))
                return 0;
            continue;
        }
        params.min_size = (cairn_real)fmax(4, size * (1 - SIZE_SLACK));
        params.max_size = (cairn_real)fmax(4, size * (1 + SIZE_SLACK));
        if (!search(s, t, image, model, &params, found))
            return 0;
    }
    return 1;
}

/* Prints the first grouping with the terms of its log-likelihood ratio, and the maximum over all
 * groupings. */
static void print_best(const group_found *found)
{
    static const group_grouping none;
    const group_grouping *g = found->count > 0 ? &found->grouping[0] : &none;

    bench_json_number("score", (double)g->object.score);
    bench_json_number("evidence", (double)g->object.evidence);
    bench_json_number("rigid", g->rigid);
    bench_json_number("bent", g->bent);
    bench_json_number("close", (double)g->shape.edge_proximity);
    bench_json_number("turned", (double)g->shape.tangent_deviation);
    bench_json_number("strained", (double)g->shape.deformation);
    bench_json_number("best", found->best);
}

/* Prints the reason for the end of a search, and the skipped parts. */
static void print_end(const group_found *found, int32_t search)
{
    if (search >= found->searches)
        return;
    bench_json_text("end", cairn_contour_search_end_text(found->end[search]));
    bench_json_integer("points_dropped", found->points_dropped);
}

static void add_ends(sums *t, const group_found *found)
{
    t->points_dropped += found->points_dropped;
    for (int32_t i = 0; i < found->searches; i++)
        t->ends[found->end[i]]++;
}

static void print_ends(const sums *t)
{
    static const char *const keys[] = {"end_no_start", "end_posterior", "end_no_follower",
                                       "end_steps", "end_histories"};

    bench_json_integer("points_dropped", t->points_dropped);
    for (int32_t i = 0; i <= CAIRN_CONTOUR_GROUPING_HISTORIES; i++)
        bench_json_integer(keys[i], t->ends[i]);
}

static void print_each(const group_image *image, const group_found *found, const group_score *score,
                       int32_t search)
{
    bench_json_begin("group");
    bench_json_text("image", image->name);
    bench_json_integer("instance", score->instance);
    bench_json_integer("hit", score->hit);
    bench_json_number("coverage", score->coverage);
    bench_json_number("precision", score->precision);
    bench_json_number("present", score->present);
    bench_json_number("box_iou", score->iou);
    bench_json_integer("groupings", found->count);
    print_best(found);
    print_end(found, search);
    bench_json_end();
}

static int run_own(const settings *s, sums *t, const char *folder, const char *name,
                   const cairn_shape_model *model)
{
    static group_found found;
    group_image image;
    group_score score[GROUP_INSTANCES];
    int32_t taken;

    if (!group_image_read(&image, folder, name, s->class_name))
        return 0;
    group_found_clear(&found);
    if (!search_own(s, t, &image, model, &found)) {
        group_image_free(&image);
        return 0;
    }
    group_found_sort(&found);
    taken = group_measure(&image, &found, score);
    t->images++;
    t->own_false += found.count - taken;
    add_ends(t, &found);
    for (int32_t i = 0; i < image.instances; i++) {
        if (score[i].present == 0) {
            t->without_outline++;
            continue;
        }
        t->instances++;
        t->hits += score[i].hit;
        t->covered += score[i].covered;
        t->thin_hits += score[i].thin;
        t->coverage += score[i].coverage;
        t->precision += score[i].precision;
        if (s->each)
            print_each(&image, &found, &score[i], i);
    }
    if (s->draw != NULL)
        group_draw(s->draw, &image, &found);
    group_found_clear(&found);
    group_image_free(&image);
    return 1;
}

/* An image of another class: every grouping is false. */
static int run_other(const settings *s, sums *t, const char *folder, const char *name,
                     const cairn_shape_model *model)
{
    static group_found found;
    cairn_contour_search_params params;
    group_image image;
    int ok;

    if (!group_image_read(&image, folder, name, NULL))
        return 0;
    params = params_of(s, &image);
    group_found_clear(&found);
    ok = s->from_detections ? search_from_detections(s, t, &image, model, &found)
                            : search(s, t, &image, model, &params, &found);
    t->other_images++;
    t->false_groupings += found.count;
    add_ends(t, &found);
    if (s->each && ok) {
        bench_json_begin("group");
        bench_json_text("other", image.name);
        bench_json_integer("groupings", found.count);
        print_best(&found);
        print_end(&found, 0);
        bench_json_end();
    }
    group_found_clear(&found);
    group_image_free(&image);
    return ok;
}

/* Every n-th of a folder's images, so that there are at most `most`. */
static int run_folder(const settings *s, sums *t, const char *class_folder, int64_t most, int own,
                      const cairn_shape_model *model)
{
    char folder[4096];
    group_names names;
    int ok = 1;

    (void)snprintf(folder, sizeof folder, "%s/ethz/%s", s->data, class_folder);
    if (!group_names_read(&names, folder)) {
        (void)snprintf(folder, sizeof folder, "%s/%s", s->data, class_folder);
        if (!group_names_read(&names, folder)) {
            fprintf(
                stderr,
                "bench/group: %s/ethz/%s: no images, expected the ETHZ shape classes (--data)\n",
                s->data, class_folder);
            return 0;
        }
    }
    for (int64_t k = 0, count = most < names.count ? most : names.count; k < count && ok; k++) {
        const char *name = names.name[k * names.count / count];

        if (own && s->fold > 0 && k % 2 != s->fold - 1)
            continue;
        fprintf(stderr, "%s/%s\n", class_folder, name);
        ok = own ? run_own(s, t, folder, name, model) : run_other(s, t, folder, name, model);
    }
    group_names_free(&names);
    return ok;
}

static double most_of(const double *values, int32_t count)
{
    double most = 0;

    for (int32_t i = 0; i < count; i++)
        most = fmax(most, values[i]);
    return most;
}

static void print_summary(const settings *s, sums *t)
{
    double n = t->instances > 0 ? t->instances : 1, p = t->hits / n, z2 = WILSON_Z * WILSON_Z;
    double middle = (p + z2 / (2 * n)) / (1 + z2 / n);
    double half = WILSON_Z / (1 + z2 / n) * sqrt(p * (1 - p) / n + z2 / (4 * n * n));

    bench_json_begin("group");
    bench_json_text("class", s->class_name);
    bench_json_text("scale", s->scale);
    bench_json_text("tokens", s->tokens);
    bench_json_integer("particles", s->particles);
    bench_json_integer("images", t->images);
    bench_json_integer("without_outline", t->without_outline);
    bench_json_integer("instances", t->instances);
    bench_json_integer("hits", t->hits);
    bench_json_number("hit_rate", p);
    bench_json_number("covered_rate", t->covered / n);
    bench_json_number("hit_rate_thin", t->thin_hits / n);
    bench_json_number("hit_rate_low", fmax(0, middle - half));
    bench_json_number("hit_rate_high", fmin(1, middle + half));
    bench_json_number("own_false_per_image",
                      (double)t->own_false / (t->images > 0 ? t->images : 1));
    bench_json_integer("other_images", t->other_images);
    bench_json_number("false_per_image", t->other_images > 0
                                             ? (double)t->false_groupings / t->other_images
                                             : (double)NAN);
    bench_json_number("coverage", t->coverage / n);
    bench_json_number("precision", t->precision / n);
    bench_json_number("seconds_median", bench_median(t->seconds, (size_t)t->timed));
    bench_json_number("seconds_most", most_of(t->seconds, t->timed));
    bench_json_integer("pool_bytes", (int64_t)t->pool_bytes);
    if (s->as_written)
        print_ends(t);
    bench_json_true("summary");
    bench_json_end();
}

static option_result read_settings(settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_TEXT("--class", &s->class_name, "NAME",
                    "Applelogos, Bottles, Giraffes, Mugs or Swans"),
        OPTION_TEXT("--scale", &s->scale, "NAME", "given or searched"),
        OPTION_TEXT("--tokens", &s->tokens, "NAME", "segments or edgels"),
        OPTION_INTEGER("--images", &s->most, 1, 100000, "N", "of the class at most, evenly chosen"),
        OPTION_INTEGER("--others", &s->others, 1, 100000, "N", "of each other class at most"),
        OPTION_FLAG("--no-others", &s->no_others, "no images of other classes"),
        OPTION_INTEGER("--particles", &s->particles, 1, 4096, "N", "of the filter"),
        OPTION_INTEGER("--paths", &s->paths, 1, CAIRN_SHAPE_MODEL_MAX_PATHS, "N",
                       "of a model at most"),
        OPTION_INTEGER("--min-strength", &s->strength, 1, 255, "N", "of edges"),
        OPTION_NUMBER("--min-score", &s->score, 0, 1, "S", "of a grouping that is reported"),
        OPTION_NUMBER("--min-evidence", &s->evidence, 0, 1000, "E",
                      "of a grouping that is reported"),
        OPTION_INTEGER("--seed", &s->seed, 0, 1e9, "S", "of the filter"),
        OPTION_FLAG("--no-model", &s->no_model, "without the model term"),
        OPTION_FLAG("--no-skeleton", &s->no_skeleton, "without the skeleton term"),
        OPTION_FLAG("--letter", &s->letter,
                    "of --as-written: the prior and the weights to the letter of (2.9)"),
        OPTION_FLAG("--no-mirror", &s->no_mirror, "not the mirrored model"),
        OPTION_FLAG("--from-detections", &s->from_detections,
                    "only where and as large as the object is detected"),
        OPTION_FLAG("--as-written", &s->as_written, "the method of the thesis; with --scale given"),
        OPTION_NUMBER(
            "--strong", &s->strong, 0, 100, "F",
            "of --as-written: walks start at the ends of chains of F times the mean strength"),
        OPTION_INTEGER("--fold", &s->fold, 0, 2, "N",
                       "1: only images of even number, 2: only those of odd number; 0: all"),
        OPTION_FLAG("--each", &s->each, "a line for each instance, too"),
        OPTION_TEXT("--draw", &s->draw, "DIR", "pictures of what was found (PPM)"),
        OPTION_TEXT("--data", &s->data, "DIR", "where ethz/ is, or the folders of the classes"),
    };
    const option_set set = {
        "bench/group", "--class NAME [options]",
        "Groups the contours of known objects in the images of the ETHZ shape classes.", table,
        sizeof table / sizeof *table};
    size_t count = 0;
    option_result result = options_read(&set, argc, argv, NULL, &count);

    if (result != OPTIONS_READ)
        return result;
    if (strcmp(s->scale, "given") != 0 && strcmp(s->scale, "searched") != 0)
        return (option_result)options_refuse("bench/group",
                                             "--scale %s, expected given or searched", s->scale);
    if (strcmp(s->tokens, "segments") != 0 && strcmp(s->tokens, "edgels") != 0)
        return (option_result)options_refuse("bench/group",
                                             "--tokens %s, expected segments or edgels", s->tokens);
    if (s->letter && !s->as_written)
        return (option_result)options_refuse("bench/group",
                                             "--letter without --as-written, expected both");
    if (s->as_written && (s->scale[0] != 'g' || s->from_detections))
        return (option_result)options_refuse(
            "bench/group",
            "--as-written with %s, expected --scale given: the thesis sets the scale by hand",
            s->from_detections ? "--from-detections" : "--scale searched");
    return OPTIONS_READ;
}

/* The class's model, from its drawing; 0: a line was printed. */
static int load_model(const settings *s, int which, cairn_shape_model_file *model)
{
    cairn_shape_image_params image = cairn_shape_image_default();
    cairn_shape_model_builder_params builder = cairn_shape_model_builder_default();
    cairn_file_error error;
    char path[4096];
    DIR *inner;

    builder.max_paths = (int32_t)s->paths;
    (void)snprintf(path, sizeof path, "%s/ethz/models", s->data);
    inner = opendir(path);
    (void)snprintf(path, sizeof path, "%s%s/models/%s.tif", s->data, inner != NULL ? "/ethz" : "",
                   classes[which].model);
    if (inner != NULL)
        (void)closedir(inner);
    if (cairn_shape_model_file_load(model, path, &image, &builder, NULL, &error) == CAIRN_OK)
        return 1;
    fprintf(stderr, "bench/group: %s\n", error.text);
    return 0;
}

int main(int argc, char **argv)
{
    settings s = {"Swans",
                  "searched",
                  "../shared/data",
                  NULL,
                  "segments",
                  100000,
                  300,
                  CAIRN_SHAPE_MODEL_MAX_PATHS,
                  1,
                  1,
                  100000,
                  -1,
                  -1,
                  0,
                  0,
                  0,
                  0,
                  0,
                  0,
                  0,
                  0,
                  1,
                  0};
    option_result result = read_settings(&s, argc, argv);
    cairn_shape_model_file model;
    int which = 0, ok;
    sums t;

    if (result != OPTIONS_READ)
        return (int)result;
    while (which < CLASSES && strcmp(classes[which].folder, s.class_name) != 0)
        which++;
    if (which == CLASSES)
        return options_refuse("bench/group",
                              "--class %s, expected Applelogos, Bottles, Giraffes, Mugs or Swans",
                              s.class_name);
    if (!load_model(&s, which, &model))
        return 3;
    memset(&t, 0, sizeof t);
    t.seconds = calloc(MAX_SECONDS, sizeof *t.seconds);
    ok = t.seconds != NULL && run_folder(&s, &t, s.class_name, s.most, 1, &model.model);
    for (int other = 0; other < CLASSES && ok && !s.no_others; other++)
        if (other != which)
            ok = run_folder(&s, &t, classes[other].folder, s.others, 0, &model.model);
    if (ok)
        print_summary(&s, &t);
    cairn_shape_model_file_free(&model);
    free(t.seconds);
    return ok ? 0 : 3;
}
