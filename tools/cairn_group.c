/* cairn group: groups the contours of a known object in images. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/contour_search_run.h"
#include "cairn/number_text.h"
#include "cairn/output.h"
#include "cairn/output_set.h"
#include "cairn/shape_model_file.h"
#include "tools/cairn_group.h"
#include "src/host/base/degrees.h"
#include "tools/cairn_objects.h"
#include "tools/cairn_picture.h"
#include "tools/cairn_tool.h"

#define PROGRAM "cairn group"

enum { MAX_IMAGES = 4096, FILES_PER_IMAGE = 3 };

typedef struct settings {
    const char *images[MAX_IMAGES];
    size_t count;
    const char *model, *edges, *scale, *rotation, *tokens, *folder, *coco, *masks;
    int64_t particles, strength, side, paths;
    double score, evidence, sigma, low, high, strong;
    uint64_t seed;
    double least_size, most_size, least_turn, most_turn;
    int32_t no_mirror, report, json, quiet, as_written;
    int32_t strong_given, paths_given;
} settings;

/* Parses "A:B" or "A". Returns 0 when the text is invalid or A exceeds B. */
static int read_range(const char *text, double *least, double *most)
{
    const char *colon = strchr(text, ':');
    size_t length = colon != NULL ? (size_t)(colon - text) : strlen(text);

    if (!cairn_number_read(text, length, least))
        return 0;
    *most = *least;
    if (colon != NULL && !cairn_number_read(colon + 1, strlen(colon + 1), most))
        return 0;
    return isfinite(*least) && isfinite(*most) && *least <= *most;
}

/* Rejects options that the method of the thesis lacks, and a missing --scale, which it requires. */
static option_result check_written(const settings *s)
{
    const char *other = s->rotation != NULL ? "--rotation"
                        : s->score >= 0     ? "--min-score"
                        : s->evidence >= 0  ? "--min-evidence"
                        : s->paths_given    ? "--paths"
                                            : NULL;

    if (s->as_written && other != NULL)
        return (option_result)options_refuse(
            PROGRAM, "%s with --as-written, expected it without: the thesis has no such option",
            other);
    if (!s->as_written && s->strong_given)
        return (option_result)options_refuse(PROGRAM,
                                             "--strong without --as-written, expected with it");
    if (s->as_written && s->no_mirror)
        return (option_result)options_refuse(
            PROGRAM,
            "--no-mirror with --as-written, expected it without: the thesis has no mirror images");
    if (s->as_written && s->scale == NULL)
        return (option_result)options_refuse(
            PROGRAM,
            "--as-written without --scale, expected the object's size: the thesis sets it by hand");
    return OPTIONS_READ;
}

static option_result check_settings(settings *s)
{
    if (s->count < 1 || s->model == NULL || s->folder == NULL)
        return (option_result)options_refuse(PROGRAM, "%s, expected IMAGE... --model SHAPE -o DIR",
                                             s->count < 1       ? "no image"
                                             : s->model == NULL ? "no model (--model)"
                                                                : "no folder to write to (-o)");
    if (s->edges != NULL && s->count > 1)
        return (option_result)options_refuse(PROGRAM, "--edges with %zu images, expected one",
                                             s->count);
    if (s->scale != NULL &&
        (!read_range(s->scale, &s->least_size, &s->most_size) || s->least_size < 1))
        return (option_result)options_refuse(
            PROGRAM, "--scale %s, expected A:B in pixels, 1 <= A <= B", s->scale);
    if (s->rotation != NULL && (!read_range(s->rotation, &s->least_turn, &s->most_turn) ||
                                s->least_turn < -180 || s->most_turn > 180))
        return (option_result)options_refuse(
            PROGRAM, "--rotation %s, expected A:B in degrees, -180 <= A <= B <= 180", s->rotation);
    if (strcmp(s->tokens, "segments") != 0 && strcmp(s->tokens, "edgels") != 0)
        return (option_result)options_refuse(PROGRAM, "--tokens %s, expected segments or edgels",
                                             s->tokens);
    if (s->low > s->high)
        return (option_result)options_refuse(
            PROGRAM, "--low %g is above --high %g, expected it below", s->low, s->high);
    return check_written(s);
}

static option_result read_settings(settings *s, int argc, char **argv)
{
    option table[] = {
        OPTION_TEXT("--model", &s->model, "SHAPE",
                    "shape of the object: a model (cairn model), a silhouette or a drawing"),
        OPTION_TEXT("-o", &s->folder, "DIR",
                    "folder to write NAME.svg and NAME.json to, for each image NAME.*"),
        OPTION_TEXT("--coco", &s->coco, "FILE", OBJECTS_COCO_HELP),
        OPTION_TEXT("--masks", &s->masks, "DIR", OBJECTS_MASKS_HELP),
        OPTION_TEXT("--edges", &s->edges, "FILE",
                    "edge map of the image, strengths 0 ... 255, from another edge detector; one "
                    "image only"),
        OPTION_TEXT("--scale", &s->scale, "A:B",
                    "diagonal of the object's bounding box, pixels (a tenth of the "
                    "image's diagonal to all of it)"),
        OPTION_TEXT("--rotation", &s->rotation, "A:B",
                    "rotation from the model to the object, clockwise, degrees (-15:15)"),
        OPTION_INTEGER("--particles", &s->particles, 1, 4096, "N",
                       "particles of the filter; without --as-written also the maximum number of\n"
                       "hypotheses that are fitted, which is what matters"),
        OPTION_TEXT("--tokens", &s->tokens, "NAME", "tokens to group: segments, or edgels"),
        OPTION_INTEGER("--paths", &s->paths, 1, CAIRN_SHAPE_MODEL_MAX_PATHS, "N",
                       "maximum number of paths of a model that is built from a picture"),
        OPTION_FLAG(
            "--as-written", &s->as_written,
            "the method of the thesis: particles move from symmetric point to symmetric point, "
            "along the longest path of the model, at the middle of --scale, without rotation or "
            "mirror image"),
        OPTION_NUMBER(
            "--strong", &s->strong, 0, 100, "F",
            "--as-written: particles start near the ends of chains of F times the mean strength"),
        OPTION_FLAG("--no-mirror", &s->no_mirror,
                    "does not search for the mirror image of the model"),
        OPTION_NUMBER("--min-score", &s->score, 0, 1, "S",
                      "minimum matched share of a reported object's outline (0.3)"),
        OPTION_NUMBER("--min-evidence", &s->evidence, 0, 1000, "E",
                      "minimum score (evidence) of a reported object, a linear score in nats, not "
                      "calibrated (34)"),
        OPTION_INTEGER("--min-strength", &s->strength, 1, 255, "N", "minimum strength of edges"),
        OPTION_NUMBER("--sigma", &s->sigma, 0, 50, "PX",
                      "standard deviation of the Gaussian blur (Canny), px"),
        OPTION_NUMBER("--low", &s->low, 0.01, 1000, "G",
                      "low hysteresis threshold (Canny), grey levels per pixel"),
        OPTION_NUMBER("--high", &s->high, 0.01, 1000, "G",
                      "high hysteresis threshold (Canny), grey levels per pixel"),
        OPTION_INTEGER("--max-side", &s->side, 16, 8192, "PX",
                       "maximum side of an image; larger ones are halved"),
        {"--seed", OPTION_IS_SEED, &s->seed, 0, 0, "N", "seed of the particle filter", NULL},
        OPTION_FLAG("--report", &s->report,
                    "also NAME.html, a page that plays every step of the particle filter"),
        OPTION_JSON(&s->json),
        OPTION_FLAG("--quiet", &s->quiet, "no summary"),
    };
    const option_set set = {
        PROGRAM, "IMAGE... --model SHAPE -o DIR [options]",
        "Finds the contours of a known object in images (" TOOL_IMAGES "): edge segments of "
        "the image, "
        "grouped by fitting the outline of the model, with hypotheses seeded at pairs of segments "
        "symmetric about its axis.",
        table, sizeof table / sizeof *table};
    option_result result;

    for (size_t k = 0; k < set.count; k++) {
        if (strcmp(table[k].name, "--strong") == 0)
            table[k].given = &s->strong_given;
        if (strcmp(table[k].name, "--paths") == 0)
            table[k].given = &s->paths_given;
    }
    s->count = MAX_IMAGES;
    result = options_read(&set, argc, argv, s->images, &s->count);
    return result == OPTIONS_READ ? check_settings(s) : result;
}

/* An image and its results while it is processed. */
typedef struct work {
    const char *path;
    char stem[PICTURE_NAME_BYTES];
    searched_picture picture;
    cairn_contour_search_tokens tokens;
    cairn_contour_search_result result;
    group_record record;
    double min_score, min_evidence; /* of an object */
} work;

static void free_work(work *w)
{
    picture_free(&w->picture);
    cairn_contour_search_run_free_tokens(&w->tokens);
    cairn_contour_search_run_free(&w->result);
    group_record_free(&w->record);
}

static cairn_status search(const settings *s, work *w, const cairn_shape_model *model,
                           cairn_file_error *error)
{
    cairn_raster_u8_view view = {w->picture.edges.samples, w->picture.edges.width,
                                 w->picture.edges.height, w->picture.edges.width};
    int32_t width = w->picture.edges.width, height = w->picture.edges.height,
            edgels = s->tokens[0] == 'e';
    cairn_contour_search_params p = s->as_written ? cairn_contour_search_as_written(width, height)
                                                  : cairn_contour_search_default(width, height);
    cairn_status status =
        s->as_written
            ? cairn_contour_search_run_tokens_as_written(&w->tokens, view, (int32_t)s->strength,
                                                         edgels, (cairn_real)s->strong, w->path,
                                                         error)
            : cairn_contour_search_run_tokens(&w->tokens, view, (int32_t)s->strength, edgels,
                                              w->path, error);

    if (status != CAIRN_OK)
        return status;
    if (s->scale != NULL) {
        p.min_size = (cairn_real)(s->least_size / w->picture.shrink);
        p.max_size = (cairn_real)(s->most_size / w->picture.shrink);
    }
    if (s->rotation != NULL) {
        p.min_turn = cairn_max(-CAIRN_PI, (cairn_real)(s->least_turn * CAIRN_DEGREE));
        p.max_turn = cairn_min(CAIRN_PI, (cairn_real)(s->most_turn * CAIRN_DEGREE));
    }
    p.mirror = p.mirror && !s->no_mirror;
    p.grouping.particles = (int32_t)s->particles;
    p.grouping.seed = s->seed;
    if (s->score >= 0)
        p.min_score = (cairn_real)s->score;
    if (s->evidence >= 0)
        p.min_evidence = (cairn_real)s->evidence;
    w->min_score = (double)p.min_score;
    w->min_evidence = (double)p.min_evidence;
    if (s->report) {
        p.on_step = group_record_step;
        p.on_walk = group_record_walk;
        p.context = &w->record;
        w->record.look_ahead = (double)w->tokens.look_ahead;
    }
    return cairn_contour_search_run(&w->result, &w->tokens, model, &p, w->path, error);
}

/* ---- Output ---- */

static cairn_status write_all(const settings *s, const work *w, const cairn_shape_model *model,
                              cairn_file_error *error)
{
    static const char *const endings[FILES_PER_IMAGE] = {"svg", "json", "html"};
    cairn_contour_file_picture picture = {cairn_output_path_name(w->path),
                                          cairn_output_path_name(s->model),
                                          w->picture.grey.samples,
                                          w->picture.shrink,
                                          &w->tokens,
                                          model,
                                          &w->result};
    char name[FILES_PER_IMAGE][PICTURE_NAME_BYTES + 8];
    const char *names[FILES_PER_IMAGE];
    cairn_output_set *set;
    cairn_status status;

    for (int32_t i = 0; i < FILES_PER_IMAGE; i++) {
        (void)snprintf(name[i], sizeof name[i], "%s.%s", w->stem, endings[i]);
        names[i] = name[i];
    }
    status = cairn_output_set_open(&set, s->folder, names, s->report ? 3 : 2, error);
    if (status != CAIRN_OK)
        return status;
    if (!s->report)
        status = cairn_output_set_remove(set, names[2], error);
    if (status == CAIRN_OK)
        status = cairn_contour_file_draw(&picture, cairn_output_set_path(set, 0), error);
    if (status == CAIRN_OK)
        status = cairn_contour_file_write(&picture, cairn_output_set_path(set, 1), error);
    if (status == CAIRN_OK && s->report)
        status = group_record_write(&w->record, &picture, cairn_output_set_path(set, 2), error);
    if (status == CAIRN_OK)
        return cairn_output_set_commit(set, error);
    cairn_output_set_discard(set);
    return status;
}

static void print_summary(const work *w, double seconds)
{
    const cairn_contour_search_result *r = &w->result;

    if (r->object_count == 0 && r->mode == CAIRN_MODE_AS_WRITTEN)
        printf("%s: no object", w->path);
    else if (r->object_count == 0)
        printf("%s: no object, best score %.2f of at least %.2f, best evidence %.2f of at least "
               "%.2f",
               w->path, (double)r->best_score, w->min_score, (double)r->best_evidence,
               w->min_evidence);
    else
        printf("%s: %" PRId32 " object%s, best score %.2f", w->path, r->object_count,
               r->object_count > 1 ? "s" : "", (double)r->best_score);
    if (r->mode == CAIRN_MODE_AS_WRITTEN)
        printf("; the filter ended: %s", cairn_contour_search_end_text(r->end_reason));
    printf("; %" PRId32 " segments of %" PRId32 " chains, %zu bytes, %.2f s\n", w->tokens.count,
           w->tokens.chain_count, r->pool_bytes, seconds);
    for (int32_t i = 0; i < r->object_count; i++) {
        const cairn_contour_search_object *o = &r->objects[i];

        printf("  %.2f  at (%.0f, %.0f), size %.0f px, turned %.0f degrees%s, %" PRId32
               " segments\n",
               (double)o->found.score, (double)o->found.origin.x * w->picture.shrink,
               (double)o->found.origin.y * w->picture.shrink,
               (double)o->found.size * w->picture.shrink, (double)o->found.turn / CAIRN_DEGREE,
               o->mirrored ? ", mirrored" : "", o->found.count);
    }
}

/* Copies the objects with their deformed outlines; as written with the polygon of their segments in
 * the order of the model's outline. CAIRN_NO_MEMORY. */
static cairn_status copy_objects(const work *w, objects_image *image)
{
    for (int32_t i = 0; i < w->result.object_count; i++) {
        const cairn_contour_search_object *o = &w->result.objects[i];
        objects_shape *shape =
            o->outline_count > 0
                ? objects_append_outline(image, &w->result.outline[o->first_outline],
                                         o->outline_count, w->picture.shrink)
                : objects_append_segments(image, w->tokens.lines,
                                          &w->result.segments[o->found.first], o->found.count,
                                          w->picture.shrink);

        if (shape == NULL)
            return CAIRN_NO_MEMORY;
        shape->score = (double)o->found.score;
    }
    return CAIRN_OK;
}

/* Writes the masks of an image, and its objects to the COCO file. */
static cairn_status write_objects(const settings *s, const work *w, int32_t id, objects_coco *coco,
                                  cairn_file_error *error)
{
    objects_image image = {w->path, id, w->picture.width, w->picture.height, NULL, 0};
    cairn_status status = copy_objects(w, &image);

    if (status == CAIRN_OK && s->coco != NULL) {
        objects_print_image(&image, coco->images.stream);
        status = objects_print_annotations(&image, coco->annotations.stream);
    }
    if (status != CAIRN_OK)
        (void)cairn_file_error_set(error, status, w->path, 0, "no memory for the objects");
    else if (s->masks != NULL)
        status = objects_write_masks(&image, s->masks, w->stem, error);
    objects_free(&image);
    return status;
}

static void write_object(cairn_json_writer *json, const work *w,
                         const cairn_contour_search_object *o)
{
    cairn_json_write_object(json, NULL);
    cairn_json_write_number(json, "score", (double)o->found.score);
    cairn_json_write_number(json, "x_px", (double)o->found.origin.x * w->picture.shrink);
    cairn_json_write_number(json, "y_px", (double)o->found.origin.y * w->picture.shrink);
    cairn_json_write_number(json, "size_px", (double)o->found.size * w->picture.shrink);
    cairn_json_write_number(json, "turn_deg", (double)o->found.turn / CAIRN_DEGREE);
    cairn_json_write_boolean(json, "mirrored", o->mirrored);
    cairn_json_write_integer(json, "segments", o->found.count);
    cairn_json_write_object_end(json);
}

static void write_json(cairn_json_writer *json, const work *w, double seconds)
{
    const cairn_contour_search_result *r = &w->result;

    cairn_json_write_object(json, NULL);
    cairn_json_write_text(json, "image", w->path);
    cairn_json_write_array(json, "objects");
    for (int32_t i = 0; i < r->object_count; i++)
        write_object(json, w, &r->objects[i]);
    cairn_json_write_array_end(json);
    cairn_json_write_number(json, "best_score", (double)r->best_score);
    cairn_json_write_number(json, "min_score", w->min_score);
    cairn_json_write_number(json, "best_evidence", (double)r->best_evidence);
    cairn_json_write_number(json, "min_evidence", w->min_evidence);
    if (r->mode == CAIRN_MODE_AS_WRITTEN)
        cairn_json_write_text(json, "end", cairn_contour_search_end_text(r->end_reason));
    cairn_json_write_integer(json, "segments", w->tokens.count);
    cairn_json_write_integer(json, "chains", w->tokens.chain_count);
    cairn_json_write_integer(json, "pool_bytes", (int64_t)r->pool_bytes);
    cairn_json_write_number(json, "seconds", seconds);
    cairn_json_write_object_end(json);
}

static int run_image(const settings *s, size_t index, const cairn_shape_model *model,
                     objects_coco *coco, cairn_json_writer *json)
{
    const picture_settings pictures = {s->edges, s->side, {s->sigma, s->low, s->high}};
    double start = tool_seconds();
    cairn_file_error error;
    cairn_status status;
    work w;

    memset(&w, 0, sizeof w);
    w.path = s->images[index];
    (void)picture_stem(w.path, w.stem);
    status = picture_read(&w.picture, w.path, &pictures, &error);
    if (status == CAIRN_OK)
        status = search(s, &w, model, &error);
    if (status == CAIRN_OK)
        status = write_all(s, &w, model, &error);
    if (status == CAIRN_OK && (s->coco != NULL || s->masks != NULL))
        status = write_objects(s, &w, (int32_t)index + 1, coco, &error);
    if (status == CAIRN_OK && s->json)
        write_json(json, &w, tool_seconds() - start);
    else if (status == CAIRN_OK && !s->quiet)
        print_summary(&w, tool_seconds() - start);
    free_work(&w);
    return status == CAIRN_OK ? TOOL_OK : tool_report(&error);
}

static int run_images(const settings *s, const cairn_shape_model *model)
{
    cairn_file_error error;
    objects_coco coco = {0};
    tool_json json;
    int code;

    if (s->coco != NULL && objects_coco_open(&coco, s->coco, &error) != CAIRN_OK)
        return tool_report(&error);
    code = tool_json_open(&json, PROGRAM);
    if (code != TOOL_OK) {
        objects_coco_discard(&coco);
        return code;
    }
    cairn_json_write_text(&json.writer, "model", s->model);
    cairn_json_write_text(&json.writer, "folder", s->folder);
    cairn_json_write_array(&json.writer, "images");
    for (size_t i = 0; i < s->count && code == TOOL_OK; i++)
        code = run_image(s, i, model, &coco, &json.writer);
    cairn_json_write_array_end(&json.writer);
    if (code != TOOL_OK)
        objects_coco_discard(&coco);
    else if (s->coco != NULL && objects_coco_commit(&coco, PROGRAM, s->model, &error) != CAIRN_OK)
        code = tool_report(&error);
    return tool_json_close(&json, PROGRAM, s->json, code);
}

int tool_group(int argc, char **argv)
{
    static settings s;
    cairn_shape_image_params image = cairn_shape_image_default();
    cairn_shape_model_builder_params builder = cairn_shape_model_builder_default();
    cairn_vision_canny_params canny = cairn_vision_canny_default();
    cairn_shape_model_file model;
    cairn_file_error error;
    option_result result;
    int code;

    memset(&s, 0, sizeof s);
    s.tokens = "segments";
    s.particles = cairn_contour_grouping_default().particles;
    s.strength = 1;
    s.side = 1600;
    s.paths = builder.max_paths;
    s.score = s.evidence = -1;
    s.strong = 1;
    s.sigma = canny.sigma;
    s.low = canny.low;
    s.high = canny.high;
    s.seed = 1;
    result = read_settings(&s, argc, argv);
    if (result != OPTIONS_READ)
        return (int)result;
    code = picture_check_names(PROGRAM, s.images, s.count);
    if (code != TOOL_OK)
        return code;
    builder.max_paths = (int32_t)s.paths;
    if (cairn_shape_model_file_load(&model, s.model, &image, &builder, NULL, &error) != CAIRN_OK)
        return tool_report(&error);
    code = run_images(&s, &model.model);
    cairn_shape_model_file_free(&model);
    return code;
}
