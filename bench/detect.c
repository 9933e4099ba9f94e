/* bench/detect: detection of objects of the ETHZ shape classes (chapter 5) in all their images,
 * from the supplied edges and one drawn model a class.
 *
 * Every class's model is searched in the images of all classes; size and rotation are not given,
 * and nothing is trained. A hit has an IoU of the boxes >= 0.5, each object once. Output: a line
 * for each class, and one with the means over the classes:
 * - the detection rate at 0.3 and 0.4 false positives per image, the 11-point average precision;
 * - precision_at_recall: the precision at the thesis's recall, which counts boxes above 0.2 as hits
 *   (recall_most_fifth: the greatest recall reached, ap_fifth: the average precision by that
 *   criterion); with 0.5: precision_at_recall_half.
 *
 * --method parts: by configurations of parts. --as-written: by the method of the thesis. --bundles,
 * --nearest and --modes change the parts of the other. --method chamfer: the plain oriented chamfer
 * baseline. --verify: the weight of verification by contour grouping, 0: without. --curves DIR:
 * CLASS.csv and CLASS.svg, precision over recall and detection rate over false positives per image,
 * of hits at IoU >= 0.5, with --as-written above 0.2, as in the thesis (figs 5.5, 5.7). */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_detect.h"
#include "bench/bench_detect_look.h"
#include "bench/bench_json.h"
#include "cairn/object_detect_run.h"
#include "cairn/contour_search_run.h"
#include "cairn/detection_curve_file.h"
#include "cairn/vision.h"
#include "tools/options.h"

typedef struct settings {
    const char *class_name, *method, *data, *curves;
    const char *bundles;
    int64_t most, candidates, matches, nearest, train;
    double overlap, weight, verify;
    int32_t each, no_mirror, modes, stages, occluded, as_written, machine;
} settings;

static const struct {
    const char *folder, *model;
    cairn_real recall; /* of the thesis */
} classes[] = {{"Applelogos", "applelogo", CAIRN_REAL(0.864)},
               {"Bottles", "bottle", CAIRN_REAL(0.927)},
               {"Giraffes", "giraffe", CAIRN_REAL(0.703)},
               {"Mugs", "mug", CAIRN_REAL(0.834)},
               {"Swans", "swan", CAIRN_REAL(0.939)}};

enum { CLASSES = sizeof classes / sizeof *classes, MAX_SECONDS = 1 << 16 };

/* Processor time by stage, over all images and models; those before VOTES are per image and shared
 * by all models. */
enum {
    STAGE_EDGES,
    STAGE_SEGMENTS,
    STAGE_FIELD,
    STAGE_LOOK,
    STAGE_SEARCH,
    STAGES = STAGE_SEARCH + 3
};
typedef struct stage_clock {
    double seconds[STAGES], begun;
    int32_t stage, images, searches;
} stage_clock;

typedef struct run {
    const settings *settings;
    cairn_shape_model_file model[CLASSES];
    int32_t wanted[CLASSES];
    detect_tally tally[CLASSES];
    double *seconds;
    int32_t timed;
    stage_clock stages;
    cairn_appearance_model look; /* of the trained class, with --train */
} run;

static void begin_stage(stage_clock *c, int32_t stage)
{
    double now = bench_cpu_seconds();

    if (c->stage >= 0)
        c->seconds[c->stage] += now - c->begun;
    c->begun = bench_cpu_seconds();
    c->stage = stage;
}

static void on_stage(void *context, cairn_object_detect_stage stage)
{
    begin_stage(context, STAGE_SEARCH + stage);
}

/* Canny edges, unused: the supplied edges replace them. */
static int time_edges(run *r, const char *folder, const char *name)
{
    cairn_vision_canny_params params = cairn_vision_canny_default();
    cairn_file_error error = {.text = "no memory"};
    cairn_vision_image grey;
    char path[4096 + 300];
    uint8_t *edges = NULL;
    int ok;

    (void)snprintf(path, sizeof path, "%s/%s.jpg", folder, name);
    ok = cairn_vision_read_grey(&grey, path, &error) == CAIRN_OK;
    if (ok) {
        edges = malloc((size_t)grey.width * (size_t)grey.height);
        begin_stage(&r->stages, STAGE_EDGES);
        ok = edges != NULL && cairn_vision_canny(&grey, &params, edges, path, &error) == CAIRN_OK;
        begin_stage(&r->stages, -1);
        cairn_vision_free(&grey);
    }
    free(edges);
    if (!ok)
        fprintf(stderr, "bench/detect: %s\n", error.text);
    return ok;
}

/* ---- Images ---- */

static void print_each(const run *r, const group_image *image, int32_t class,
                       const group_image *truth, const cairn_object_detection *found, int32_t count)
{
    for (int32_t i = 0; i < count && r->settings->each; i++) {
        double overlap;

        bench_json_begin("detect");
        bench_json_text("image", image->name);
        bench_json_text("class", classes[class].folder);
        bench_json_number("score", (double)found[i].score);
        bench_json_number("left", (double)found[i].left);
        bench_json_number("top", (double)found[i].top);
        bench_json_number("right", (double)found[i].right);
        bench_json_number("bottom", (double)found[i].bottom);
        bench_json_number("rigid", (double)found[i].rigid_evidence);
        bench_json_number("bent", (double)found[i].deformed_evidence);
        bench_json_number("along", (double)found[i].outline_coverage);
        bench_json_number("close", (double)found[i].edge_proximity);
        bench_json_number("turned", (double)found[i].tangent_deviation);
        bench_json_number("strained", (double)found[i].deformation);
        bench_json_number("agreed", (double)found[i].rigid_proximity);
        bench_json_number("grouped", (double)found[i].grouped_evidence);
        bench_json_number("agreement", (double)found[i].configuration_score);
        bench_json_number("distance", (double)found[i].shape_distance);
        bench_json_number("appearance", (double)found[i].appearance);
        bench_json_integer("parts", found[i].part_count);
        bench_json_number("size", (double)found[i].size / hypot(image->width, image->height));
        bench_json_integer("object", detect_object(truth, &found[i], &overlap));
        bench_json_number("box_iou", overlap);
        bench_json_end();
    }
}

static int count_image(run *r, const group_image *image, int32_t class, int32_t own,
                       const cairn_object_detection *found, int32_t count, double seconds)
{
    if (r->timed < MAX_SECONDS)
        r->seconds[r->timed++] = seconds;
    print_each(r, image, class, own == class ? image : NULL, found, count);
    return detect_tally_add(&r->tally[class], found, count, own == class ? image : NULL);
}

static int run_chamfer(run *r, const group_image *image, int32_t own)
{
    for (int32_t k = 0; k < CLASSES; k++) {
        double start = bench_cpu_seconds();
        cairn_object_detection *found = NULL;
        int32_t count = r->wanted[k] ? detect_chamfer(image, &r->model[k].model, &found) : 0;
        int ok = !r->wanted[k] || (count >= 0 && count_image(r, image, k, own, found, count,
                                                             bench_cpu_seconds() - start));

        free(found);
        if (!ok)
            return 0;
    }
    return 1;
}

/* The time of an image and a model includes that of the edges and the field, which all models of an
 * image share. */
static int run_default(run *r, const group_image *image, const char *folder, int32_t own,
                       cairn_file_error *error)
{
    cairn_object_detect_params params =
        r->settings->as_written ? cairn_object_detect_as_written(image->width, image->height)
                                : cairn_object_detect_default(image->width, image->height);
    cairn_raster_u8_view view = {image->edges, image->width, image->height, image->width};
    double start, field_seconds;
    cairn_contour_search_tokens tokens;
    cairn_appearance_image look = {0};
    cairn_object_detect_run_image *field = NULL;
    int ok = 1;

    params.candidates = (int32_t)r->settings->candidates;
    params.overlap = (cairn_real)r->settings->overlap;
    params.mirror = !r->settings->no_mirror && !r->settings->as_written;
    params.min_score = -100;
    params.method =
        r->settings->method[0] == 'p' ? CAIRN_OBJECT_DETECT_PARTS : CAIRN_OBJECT_DETECT_EVIDENCE;
    params.bundles = r->settings->bundles[0] == 'o'   ? CAIRN_OBJECT_DETECT_BUNDLES_OF_ONE
                     : r->settings->bundles[0] == 'n' ? CAIRN_OBJECT_DETECT_NO_BUNDLES
                                                      : CAIRN_OBJECT_DETECT_BUNDLES;
    params.occluded = r->settings->occluded;
    params.verify = (cairn_real)r->settings->verify;
    params.matches = (int32_t)r->settings->matches;
    params.nearest = (int32_t)r->settings->nearest;
    params.modes_only = r->settings->modes;
    params.appearance_nearest = r->settings->as_written && !r->settings->machine;
    params.appearance_weight = (cairn_real)r->settings->weight;
    params.on_stage = on_stage;
    params.on_stage_context = &r->stages;
    if (r->settings->stages && !time_edges(r, folder, image->name))
        return 0;
    start = bench_cpu_seconds();
    begin_stage(&r->stages, STAGE_LOOK);
    if (r->look.word_count > 0 && !detect_look_field(&look, &r->look, folder, image))
        return 0;
    params.appearance = look.field;
    begin_stage(&r->stages, STAGE_SEGMENTS);
    ok = cairn_contour_search_run_tokens(&tokens, view, 1, 0, image->name, error) == CAIRN_OK;
    begin_stage(&r->stages, STAGE_FIELD);
    ok = ok &&
         cairn_object_detect_run_make(&field, &tokens, &params, image->name, error) == CAIRN_OK;
    begin_stage(&r->stages, -1);
    r->stages.images++;
    field_seconds = bench_cpu_seconds() - start;
    for (int32_t k = 0; k < CLASSES && ok; k++) {
        cairn_object_detections d;

        if (!r->wanted[k])
            continue;
        start = bench_cpu_seconds();
        ok = cairn_object_detect_run(&d, field, &r->model[k].model, image->name, error) == CAIRN_OK;
        begin_stage(&r->stages, -1);
        r->stages.searches++;
        if (ok)
            ok = count_image(r, image, k, own, d.found, d.count,
                             field_seconds + bench_cpu_seconds() - start);
        cairn_object_detect_run_free(&d);
    }
    cairn_object_detect_run_free_image(field);
    cairn_appearance_image_free(&look);
    cairn_contour_search_run_free_tokens(&tokens);
    return ok;
}

static int run_image(run *r, const char *folder, const char *name, int32_t own)
{
    cairn_file_error error = {.text = "no memory"};
    group_image image;
    int ok;

    if (!group_image_read(&image, folder, name, classes[own].folder))
        return 0;
    ok = r->settings->method[0] == 'c' ? run_chamfer(r, &image, own)
                                       : run_default(r, &image, folder, own, &error);
    if (!ok)
        fprintf(stderr, "bench/detect: %s: %s\n", name, error.text);
    group_image_free(&image);
    return ok;
}

/* Of the trained class, the images after the training images. */
static int64_t first_scored(const run *r, int32_t own)
{
    return r->wanted[own] ? r->settings->train : 0;
}

/* Every n-th of a folder's images, so that there are at most `most`. */
static int run_folder(run *r, int32_t own)
{
    char folder[4096];
    group_names names;
    int64_t count;
    int ok = 1;

    (void)snprintf(folder, sizeof folder, "%s/ethz/%s", r->settings->data, classes[own].folder);
    if (!group_names_read(&names, folder)) {
        fprintf(stderr, "bench/detect: %s: no images, expected the ETHZ shape classes (--data)\n",
                folder);
        return 0;
    }
    count = r->settings->most < names.count ? r->settings->most : names.count;
    for (int64_t k = first_scored(r, own); k < count && ok; k++) {
        fprintf(stderr, "%s/%s\n", classes[own].folder, names.name[k * names.count / count]);
        ok = run_image(r, folder, names.name[k * names.count / count], own);
    }
    group_names_free(&names);
    return ok;
}

static int load_models(run *r)
{
    cairn_shape_image_params image = cairn_shape_image_default();
    cairn_shape_model_builder_params builder = cairn_shape_model_builder_default();
    cairn_file_error error;

    for (int32_t k = 0; k < CLASSES; k++) {
        char path[4096];

        r->wanted[k] = r->settings->class_name == NULL ||
                       strcmp(r->settings->class_name, classes[k].folder) == 0;
        (void)snprintf(path, sizeof path, "%s/ethz/models/%s.tif", r->settings->data,
                       classes[k].model);
        if (cairn_shape_model_file_load(&r->model[k], path, &image, &builder, NULL, &error) !=
            CAIRN_OK) {
            fprintf(stderr, "bench/detect: %s\n", error.text);
            return 0;
        }
    }
    return 1;
}

/* Without it (--train 0) or with zero weight appearance is not used. */
static int learn_looks(run *r)
{
    char folder[4096];

    for (int32_t k = 0; k < CLASSES && r->settings->train > 0 && r->settings->weight > 0; k++)
        if (r->wanted[k]) {
            (void)snprintf(folder, sizeof folder, "%s/ethz/%s", r->settings->data,
                           classes[k].folder);
            return detect_look_train(&r->look, folder, classes[k].folder,
                                     (int32_t)r->settings->train);
        }
    return 1;
}

/* ---- Figures ---- */

static int write_curves(const settings *s, const char *name,
                        const cairn_detection_curve_point *points, int32_t count)
{
    cairn_file_error error;
    char stem[4000], title[80];

    if (s->curves == NULL || count < 2)
        return 1;
    (void)snprintf(stem, sizeof stem, "%s/%s", s->curves, name);
    (void)snprintf(title, sizeof title, "%s%s", name,
                   s->as_written ? ", as written, hits above IoU 0.2" : "");
    if (cairn_detection_curve_file_write(stem, title, points, count, &error) == CAIRN_OK)
        return 1;
    fprintf(stderr, "bench/detect: %s\n", error.text);
    return 0;
}

typedef struct means {
    double rate03, rate04, precision, precision_fifth, at_recall, recall, classes;
} means;

static int print_class(run *r, int32_t k, means *m)
{
    detect_tally *t = &r->tally[k];
    cairn_detection_curve_point *half = malloc(((size_t)t->count + 1) * sizeof *half);
    cairn_detection_curve_point *fifth = malloc(((size_t)t->count + 1) * sizeof *fifth);
    int ok = half != NULL && fifth != NULL && detect_curve(t, DETECT_HALF, half) &&
             detect_curve(t, DETECT_FIFTH, fifth);

    if (ok) {
        cairn_real rate03, rate04, precision, precision_fifth, low, high;

        rate03 = cairn_detection_curve_rate_at(half, t->count, CAIRN_REAL(0.3));
        rate04 = cairn_detection_curve_rate_at(half, t->count, CAIRN_REAL(0.4));
        precision = cairn_detection_curve_average_precision(half, t->count);
        precision_fifth = cairn_detection_curve_average_precision(fifth, t->count);
        bench_json_begin("detect");
        bench_json_text("class", classes[k].folder);
        bench_json_text("method", r->settings->method);
        bench_json_text("mode", r->settings->as_written ? "as written" : "default");
        bench_json_integer("images", t->images);
        bench_json_integer("instances", t->instances);
        cairn_detection_curve_interval(rate03, t->instances, &low, &high);
        bench_json_number("dr03", (double)rate03);
        bench_json_number("dr03_low", (double)low);
        bench_json_number("dr03_high", (double)high);
        cairn_detection_curve_interval(rate04, t->instances, &low, &high);
        bench_json_number("dr04", (double)rate04);
        bench_json_number("dr04_low", (double)low);
        bench_json_number("dr04_high", (double)high);
        bench_json_number("ap", (double)precision);
        bench_json_number("ap_fifth", (double)precision_fifth);
        bench_json_number("recall_most", t->count > 0 ? (double)half[t->count - 1].recall : 0);
        bench_json_number("recall_most_fifth",
                          t->count > 0 ? (double)fifth[t->count - 1].recall : 0);
        bench_json_number("precision_at_recall", (double)cairn_detection_curve_precision_at(
                                                     fifth, t->count, classes[k].recall));
        bench_json_number("precision_at_recall_half", (double)cairn_detection_curve_precision_at(
                                                          half, t->count, classes[k].recall));
        bench_json_end();
        m->rate03 += (double)rate03;
        m->rate04 += (double)rate04;
        m->precision += (double)precision;
        m->precision_fifth += (double)precision_fifth;
        m->at_recall +=
            (double)cairn_detection_curve_precision_at(fifth, t->count, classes[k].recall);
        m->recall += t->count > 0 ? (double)fifth[t->count - 1].recall : 0;
        m->classes++;
        ok = write_curves(r->settings, classes[k].folder, r->settings->as_written ? fifth : half,
                          t->count);
    }
    free(half);
    free(fifth);
    return ok;
}

/* Means per image, then per image and model. */
static void print_stages(const stage_clock *c)
{
    static const char *const names[STAGES] = {
        "seconds_edges",  "seconds_segments", "seconds_field", "seconds_appearance",
        "seconds_voting", "seconds_scoring",  "seconds_boxes"};

    for (int32_t i = 0; i < STAGES && c->searches > 0; i++)
        bench_json_number(names[i], c->seconds[i] / (i < STAGE_SEARCH ? c->images : c->searches));
}

static int print_all(run *r)
{
    means m = {0, 0, 0, 0, 0, 0, 0};

    for (int32_t k = 0; k < CLASSES; k++)
        if (r->wanted[k] && !print_class(r, k, &m))
            return 0;
    bench_json_begin("detect");
    bench_json_text("method", r->settings->method);
    bench_json_number("dr03_mean", m.rate03 / m.classes);
    bench_json_number("dr04_mean", m.rate04 / m.classes);
    bench_json_number("ap_mean", m.precision / m.classes);
    bench_json_number("ap_fifth_mean", m.precision_fifth / m.classes);
    bench_json_number("precision_at_recall_mean", m.at_recall / m.classes);
    bench_json_number("recall_most_fifth_mean", m.recall / m.classes);
    bench_json_number("seconds_median", bench_median(r->seconds, (size_t)r->timed));
    print_stages(&r->stages);
    bench_json_true("summary");
    bench_json_end();
    return 1;
}

static int is_class(const char *name)
{
    for (int32_t k = 0; k < CLASSES; k++)
        if (strcmp(name, classes[k].folder) == 0)
            return 1;
    return 0;
}

static option_result read_settings(settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_TEXT("--class", &s->class_name, "NAME",
                    "Applelogos, Bottles, Giraffes, Mugs or Swans; without it all"),
        OPTION_TEXT("--method", &s->method, "NAME", "default, parts or chamfer"),
        OPTION_FLAG("--as-written", &s->as_written, "of parts: the method of the thesis"),
        OPTION_TEXT("--bundles", &s->bundles, "HOW",
                    "of parts: rule, one (fragment in each) or none"),
        OPTION_INTEGER("--matches", &s->matches, 1, 64, "N",
                       "of parts: chains that vote for each fragment"),
        OPTION_INTEGER("--nearest", &s->nearest, 1, 64, "K",
                       "of parts: votes that configurations are made of"),
        OPTION_FLAG("--modes", &s->modes, "of parts: near the modes of the votes only"),
        OPTION_INTEGER("--images", &s->most, 1, 100000, "N",
                       "of each class at most, evenly chosen"),
        OPTION_INTEGER("--candidates", &s->candidates, 1, 64, "N",
                       "places of an image that are looked at closely"),
        OPTION_NUMBER("--overlap", &s->overlap, 0, 1, "SHARE",
                      "of boxes, above which the better detection stays alone"),
        OPTION_FLAG("--no-mirror", &s->no_mirror, "not the mirrored models"),
        OPTION_FLAG("--occluded", &s->occluded, "objects may be hidden in part"),
        OPTION_FLAG("--stages", &s->stages,
                    "also Canny's time (the images are decoded then); the other stages always"),
        OPTION_FLAG("--each", &s->each, "a line for each detection, too"),
        OPTION_INTEGER("--train", &s->train, 0, 1000, "N",
                       "learns what the class looks like from its first N images, which are not "
                       "looked at then"),
        OPTION_FLAG("--machine", &s->machine,
                    "as written, with --train: appearance by the support vector machine, not the "
                    "nearest words learnt"),
        OPTION_NUMBER("--weight", &s->weight, 0, 1000, "LAMBDA", "of appearance, with --train"),
        OPTION_NUMBER("--verify", &s->verify, 0, 100, "WEIGHT",
                      "weight of the evidence of contour grouping at a detection; 0: no grouping"),
        OPTION_TEXT("--curves", &s->curves, "DIR",
                    "writes CLASS.csv and CLASS.svg: at IoU 0.5, as written at 0.2"),
        OPTION_TEXT("--data", &s->data, "DIR", "where ethz/ is"),
    };
    const option_set set = {"bench/detect", "[options]",
                            "Detects the ETHZ shape classes by one drawn model each.", table,
                            sizeof table / sizeof *table};
    size_t count = 0;
    option_result result = options_read(&set, argc, argv, NULL, &count);

    if (result == OPTIONS_READ && s->as_written &&
        ((s->method != NULL && strcmp(s->method, "parts") != 0) || s->bundles != NULL || s->modes ||
         s->occluded || s->no_mirror || s->candidates > 0 || s->verify > 0))
        return (option_result)options_refuse(
            "bench/detect",
            "--as-written with another method than parts, --bundles, --modes, --occluded, "
            "--no-mirror, --candidates or --verify, which the thesis does not have, expected it "
            "without them");
    if (result == OPTIONS_READ && s->machine && (!s->as_written || s->train == 0))
        return (option_result)options_refuse("bench/detect",
                                             "--machine, expected with --as-written and --train");
    s->method = s->method != NULL ? s->method : s->as_written ? "parts" : "default";
    s->bundles = s->bundles != NULL ? s->bundles : "rule";
    s->candidates =
        s->candidates > 0 ? s->candidates : cairn_object_detect_default(1, 1).candidates;
    s->verify = s->as_written    ? 0
                : s->verify >= 0 ? s->verify
                                 : (double)cairn_object_detect_default(1, 1).verify;
    if (result == OPTIONS_READ && strcmp(s->method, "default") != 0 &&
        strcmp(s->method, "chamfer") != 0 && strcmp(s->method, "parts") != 0)
        return (option_result)options_refuse(
            "bench/detect", "--method %s, expected default, parts or chamfer", s->method);
    if (result == OPTIONS_READ && strcmp(s->bundles, "rule") != 0 &&
        strcmp(s->bundles, "one") != 0 && strcmp(s->bundles, "none") != 0)
        return (option_result)options_refuse(
            "bench/detect", "--bundles %s, expected rule, one or none", s->bundles);
    if (result == OPTIONS_READ && s->train > 0 &&
        (s->class_name == NULL || s->most < 100000 || strcmp(s->method, "chamfer") == 0))
        return (option_result)options_refuse(
            "bench/detect",
            "--train %" PRId64 ", expected with --class, without --images, not of chamfer",
            s->train);
    if (result == OPTIONS_READ && s->class_name != NULL && !is_class(s->class_name))
        return (option_result)options_refuse(
            "bench/detect", "--class %s, expected Applelogos, Bottles, Giraffes, Mugs or Swans",
            s->class_name);
    return result;
}

int main(int argc, char **argv)
{
    cairn_object_detect_params params = cairn_object_detect_default(1, 1);
    settings s = {.data = "../shared/data",
                  .most = 100000,
                  .candidates = -1,
                  .matches = params.matches,
                  .nearest = params.nearest};
    option_result result;
    static run r;
    int ok;

    s.overlap = (double)params.overlap;
    s.weight = (double)params.appearance_weight;
    s.verify = -1;
    result = read_settings(&s, argc, argv);
    if (result != OPTIONS_READ)
        return (int)result;
    r.settings = &s;
    r.stages.stage = -1;
    r.seconds = malloc(MAX_SECONDS * sizeof *r.seconds);
    ok = r.seconds != NULL && load_models(&r);
    ok = ok && learn_looks(&r);
    for (int32_t k = 0; k < CLASSES && ok; k++)
        ok = run_folder(&r, k);
    ok = ok && print_all(&r);
    for (int32_t k = 0; k < CLASSES; k++) {
        cairn_shape_model_file_free(&r.model[k]);
        detect_tally_free(&r.tally[k]);
    }
    cairn_appearance_file_free(&r.look);
    free(r.seconds);
    return ok ? 0 : 3;
}
