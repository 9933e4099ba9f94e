/* cairn detect: detects objects of a class in images by a model of their outline. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/object_detect_run.h"
#include "cairn/contour_search_run.h"
#include "cairn/appearance_file.h"
#include "cairn/appearance_image.h"
#include "cairn/detection_file.h"
#include "cairn/output.h"
#include "cairn/output_set.h"
#include "cairn/part_cut_file.h"
#include "cairn/shape_model_file.h"
#include "src/host/base/posix.h"
#include "tools/cairn_detect_truth.h"
#include "tools/cairn_objects.h"
#include "tools/cairn_picture.h"
#include "tools/cairn_tool.h"

#define PROGRAM "cairn detect"

enum { MAX_IMAGES = 4096, MAX_JOBS = 64 };
/* Separators of the records that processes write: end of an image's record, begin of its table
 * rows, of its COCO image, of its COCO annotations, of its comparison with the ground truth. The
 * texts contain none of them. */
/* RECORD_END starts a line: the text after TRUTH_BEGIN is read line by line. */
enum {
    RECORD_END = '\f',
    TABLE_BEGIN = '\v',
    IMAGE_BEGIN = '\a',
    ANNOTATIONS_BEGIN = '\x01',
    TRUTH_BEGIN = '\b',
    LINE_BYTES = 64
};

typedef struct settings {
    const char *images[MAX_IMAGES];
    size_t count;
    const char *model, *folder, *table, *method, *bundles, *cuts, *appearance, *truth_path, *curves;
    const char *coco, *masks;
    picture_settings pictures;
    int64_t strength, jobs, candidates, nearest, matches;
    double overlap, score, weight, verify;
    int32_t no_mirror, modes, occluded, as_written, json, quiet;
    cairn_part_bundle_cut cut[CAIRN_PART_MAX_FRAGMENTS]; /* of --cuts */
    int32_t cut_count;
    cairn_appearance_model look; /* of --appearance */
    detect_truth truth;          /* of --truth */
} settings;

/* Returns 1 when all options exist in the method of the thesis, else 0 after a line on standard
 * error. */
static int check_as_written(const settings *s)
{
    const char *other = s->method != NULL && strcmp(s->method, "parts") != 0
                            ? "--method other than parts"
                        : s->bundles != NULL ? "--bundles"
                        : s->modes           ? "--modes"
                        : s->occluded        ? "--occluded"
                        : s->no_mirror       ? "--no-mirror"
                        : s->candidates > 0  ? "--candidates"
                        : s->verify >= 0     ? "--verify"
                                             : NULL;

    if (other == NULL)
        return 1;
    (void)options_refuse(
        PROGRAM, "%s with --as-written, which the thesis does not have, expected one of them",
        other);
    return 0;
}

static option_result read_settings(settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_TEXT("--model", &s->model, "SHAPE",
                    "shape of the class: a model (cairn model), a silhouette or a drawing"),
        OPTION_TEXT("-o", &s->folder, "DIR",
                    "folder to write NAME.svg and NAME.json to, for each image NAME.*"),
        OPTION_TEXT("--detections", &s->table, "FILE", "all detections as one table (CSV)"),
        OPTION_TEXT("--coco", &s->coco, "FILE", OBJECTS_COCO_HELP),
        OPTION_TEXT("--masks", &s->masks, "DIR", OBJECTS_MASKS_HELP),
        OPTION_TEXT("--truth", &s->truth_path, "FILE",
                    "ground-truth bounding boxes of all objects in the images (CSV: image, left, "
                    "top, right, bottom); with "
                    "--curves"),
        OPTION_TEXT("--curves", &s->curves, "STEM",
                    "STEM.csv and STEM.svg: precision over recall, detection rate over false "
                    "positives per image"),
        OPTION_TEXT("--edges", &s->pictures.edges, "FILE",
                    "edge map of the image, strengths 0 ... 255, from another edge detector; one "
                    "image only"),
        OPTION_INTEGER("--jobs", &s->jobs, 1, MAX_JOBS, "N",
                       "parallel processes (number of processors)"),
        OPTION_NUMBER("--min-score", &s->score, -100, 100, "S",
                      "minimum score of a reported detection, by its outline alone (0; as written "
                      "none)"),
        OPTION_TEXT("--method", &s->method, "NAME",
                    "evidence: log-likelihood ratio of the edges at every position and scale; "
                    "parts: voting by fragments of the outline"),
        OPTION_FLAG(
            "--as-written", &s->as_written,
            "method parts as in the thesis: all configurations, no mirror image, bounding boxes of "
            "the fragments"),
        OPTION_INTEGER("--nearest", &s->nearest, 1, 64, "K",
                       "parts: nearest votes that form configurations"),
        OPTION_INTEGER("--matches", &s->matches, 1, 64, "N",
                       "parts: edge chains that vote, per fragment"),
        OPTION_TEXT("--bundles", &s->bundles, "HOW",
                    "part bundles: rule; one: the longest fragment of each; none: each fragment is "
                    "a bundle"),
        OPTION_TEXT("--cuts", &s->cuts, "FILE",
                    "parts: fragments by hand, one per line: first sample, last sample, bundle"),
        OPTION_FLAG("--modes", &s->modes, "parts: only configurations near the modes of the votes"),
        OPTION_TEXT("--appearance", &s->appearance, "FILE",
                    "appearance model (cairn train): detections of another appearance score less"),
        OPTION_NUMBER("--lambda", &s->weight, 0, 1000, "L", "weight of the appearance penalty"),
        OPTION_INTEGER("--candidates", &s->candidates, 1, 64, "N",
                       "candidate positions per image that are refined"),
        OPTION_NUMBER("--overlap", &s->overlap, 0, 1, "SHARE",
                      "non-maximum suppression: maximum intersection over union of two detections"),
        OPTION_FLAG("--occluded", &s->occluded,
                    "evidence: rigid objects that may be partly occluded"),
        OPTION_NUMBER("--verify", &s->verify, 0, 100, "WEIGHT",
                      "evidence: weight of the log-likelihood ratio of contours grouped at the "
                      "same position; 0: no grouping"),
        OPTION_FLAG("--no-mirror", &s->no_mirror,
                    "does not search for the mirror image of the model"),
        OPTION_INTEGER("--min-strength", &s->strength, 1, 255, "N", "minimum strength of edges"),
        OPTION_NUMBER("--sigma", &s->pictures.canny.sigma, 0, 50, "PX",
                      "standard deviation of the Gaussian blur (Canny), px"),
        OPTION_NUMBER("--low", &s->pictures.canny.low, 0.01, 1000, "G",
                      "low hysteresis threshold (Canny), grey levels per pixel"),
        OPTION_NUMBER("--high", &s->pictures.canny.high, 0.01, 1000, "G",
                      "high hysteresis threshold (Canny), grey levels per pixel"),
        OPTION_INTEGER("--max-side", &s->pictures.side, 16, 8192, "PX",
                       "maximum side of an image; larger ones are halved"),
        OPTION_JSON(&s->json),
        OPTION_FLAG("--quiet", &s->quiet, "no summary"),
    };
    const option_set set = {PROGRAM, "IMAGE... --model SHAPE -o DIR [options]",
                            "Detects objects of a class in images (" TOOL_IMAGES ") by one "
                            "model of their outline: "
                            "boxes, outlines, scores.",
                            table, sizeof table / sizeof *table};
    option_result result;

    s->count = MAX_IMAGES;
    result = options_read(&set, argc, argv, s->images, &s->count);
    if (result != OPTIONS_READ)
        return result;
    if (s->count < 1 || s->model == NULL || s->folder == NULL)
        return (option_result)options_refuse(PROGRAM, "%s, expected %s",
                                             s->count < 1       ? "no image"
                                             : s->model == NULL ? "no model (--model)"
                                                                : "no folder to write to (-o)",
                                             set.synopsis);
    if (s->as_written && !check_as_written(s))
        return OPTIONS_BAD;
    s->method = s->method != NULL ? s->method : s->as_written ? "parts" : "evidence";
    s->bundles = s->bundles != NULL ? s->bundles : "rule";
    s->candidates =
        s->candidates > 0 ? s->candidates : cairn_object_detect_default(1, 1).candidates;
    s->verify = s->as_written    ? 0
                : s->verify >= 0 ? s->verify
                                 : (double)cairn_object_detect_default(1, 1).verify;
    if (strcmp(s->method, "evidence") != 0 && strcmp(s->method, "parts") != 0)
        return (option_result)options_refuse(PROGRAM, "--method %s, expected evidence or parts",
                                             s->method);
    if (strcmp(s->bundles, "rule") != 0 && strcmp(s->bundles, "one") != 0 &&
        strcmp(s->bundles, "none") != 0)
        return (option_result)options_refuse(PROGRAM, "--bundles %s, expected rule, one or none",
                                             s->bundles);
    if ((s->truth_path == NULL) != (s->curves == NULL))
        return (option_result)options_refuse(PROGRAM,
                                             "%s alone, expected --truth and --curves together",
                                             s->curves == NULL ? "--truth" : "--curves");
    if (s->pictures.edges != NULL && s->count > 1)
        return (option_result)options_refuse(PROGRAM, "--edges with %zu images, expected one",
                                             s->count);
    if (s->pictures.canny.low > s->pictures.canny.high)
        return (option_result)options_refuse(PROGRAM,
                                             "--low %g is above --high %g, expected it below",
                                             s->pictures.canny.low, s->pictures.canny.high);
    return OPTIONS_READ;
}

/* ---- One image ---- */

typedef struct work {
    const char *path;
    char stem[PICTURE_NAME_BYTES];
    searched_picture picture;
    cairn_contour_search_tokens tokens;
    cairn_object_detections detections;
} work;

static cairn_status detect(const settings *s, work *w, const cairn_shape_model *model,
                           cairn_file_error *error)
{
    const cairn_vision_image *edges = &w->picture.edges;
    cairn_raster_u8_view view = {edges->samples, edges->width, edges->height, edges->width};
    cairn_object_detect_params params =
        s->as_written ? cairn_object_detect_as_written(edges->width, edges->height)
                      : cairn_object_detect_default(edges->width, edges->height);
    const cairn_vision_image *grey = &w->picture.grey;
    cairn_appearance_image look = {0};
    cairn_object_detect_run_image *field;
    cairn_status status =
        cairn_contour_search_run_tokens(&w->tokens, view, (int32_t)s->strength, 0, w->path, error);

    params.method = s->method[0] == 'p' ? CAIRN_OBJECT_DETECT_PARTS : CAIRN_OBJECT_DETECT_EVIDENCE;
    params.mirror = !s->no_mirror && !s->as_written;
    params.occluded = s->occluded;
    params.verify = (cairn_real)s->verify;
    params.candidates = (int32_t)s->candidates;
    params.overlap = (cairn_real)s->overlap;
    if (!isnan(s->score))
        params.min_score = (cairn_real)s->score;
    params.nearest = (int32_t)s->nearest;
    params.matches = (int32_t)s->matches;
    params.modes_only = s->modes;
    params.cuts = s->cuts != NULL ? s->cut : NULL;
    params.cut_count = s->cut_count;
    params.bundles = s->bundles[0] == 'o'   ? CAIRN_OBJECT_DETECT_BUNDLES_OF_ONE
                     : s->bundles[0] == 'n' ? CAIRN_OBJECT_DETECT_NO_BUNDLES
                                            : CAIRN_OBJECT_DETECT_BUNDLES;
    params.appearance_weight = (cairn_real)s->weight;
    if (status == CAIRN_OK && s->appearance != NULL)
        status = cairn_appearance_image_make(&look, &s->look, grey->samples, grey->width,
                                             grey->height, w->path, error);
    params.appearance = look.field;
    if (status == CAIRN_OK)
        status = cairn_object_detect_run_make(&field, &w->tokens, &params, w->path, error);
    if (status == CAIRN_OK) {
        status = cairn_object_detect_run(&w->detections, field, model, w->path, error);
        cairn_object_detect_run_free_image(field);
    }
    cairn_appearance_image_free(&look);
    return status;
}

static cairn_status write_all(const settings *s, const work *w, const cairn_shape_model *model,
                              cairn_file_error *error)
{
    cairn_detection_file_picture p = {.image = cairn_output_path_name(w->path),
                                      .model_name = cairn_output_path_name(s->model),
                                      .grey = w->picture.grey.samples,
                                      .shrink = w->picture.shrink,
                                      .tokens = &w->tokens,
                                      .detections = &w->detections,
                                      .mode = s->as_written ? CAIRN_MODE_AS_WRITTEN
                                                            : CAIRN_MODE_DEFAULT,
                                      .model = model,
                                      .cuts = s->cuts != NULL ? s->cut : NULL,
                                      .cut_count = s->cut_count};
    char svg[PICTURE_NAME_BYTES + 8], json[PICTURE_NAME_BYTES + 8];
    const char *names[] = {svg, json};
    cairn_output_set *set;
    cairn_status status;

    (void)snprintf(svg, sizeof svg, "%s.svg", w->stem);
    (void)snprintf(json, sizeof json, "%s.json", w->stem);
    status = cairn_output_set_open(&set, s->folder, names, 2, error);
    if (status != CAIRN_OK)
        return status;
    status = cairn_detection_file_draw(&p, cairn_output_set_path(set, 0), error);
    if (status == CAIRN_OK)
        status = cairn_detection_file_write(&p, cairn_output_set_path(set, 1), error);
    if (status == CAIRN_OK)
        return cairn_output_set_commit(set, error);
    cairn_output_set_discard(set);
    return status;
}

/* Writes a file's name as a field of the CSV table: quoted, with quotes in it doubled, when it
 * contains a comma, a quote or a line end. A name that a spreadsheet would take for a formula gets
 * "./" before it. */
static void print_name(const char *text, FILE *record)
{
    int is_quoted = strpbrk(text, ",\"\r\n") != NULL;

    if (is_quoted)
        fputc('"', record);
    if (*text != '\0' && strchr("=+-@\t\r", *text) != NULL)
        fputs("./", record);
    for (; *text != '\0'; text++) {
        if (*text == '"')
            fputc('"', record);
        fputc(*text, record);
    }
    if (is_quoted)
        fputc('"', record);
    fputc(',', record);
}

static void print_row(const settings *s, const work *w, const cairn_object_detection *d,
                      const double box[4], FILE *record)
{
    print_name(cairn_output_path_name(w->path), record);
    print_name(cairn_output_path_name(s->model), record);
    fprintf(record, "%.2f,%.2f,%.2f,%.2f,%.6f,%" PRId32 "\n", box[0], box[1], box[2], box[3],
            (double)d->score, d->mirrored);
}

/* Copies the detections as objects. CAIRN_NO_MEMORY. */
static cairn_status copy_objects(const work *w, objects_image *image, cairn_file_error *error)
{
    cairn_detection_file_picture p = {.shrink = w->picture.shrink, .tokens = &w->tokens};

    for (int32_t i = 0; i < w->detections.count; i++) {
        const cairn_object_detection *d = &w->detections.found[i];
        objects_shape *shape = objects_append_outline(
            image, &w->detections.outline[d->first_outline], d->outline_count, w->picture.shrink);

        if (shape == NULL)
            return cairn_file_error_set(error, CAIRN_NO_MEMORY, w->path, 0,
                                        "no memory for the outlines");
        shape->score = (double)d->score;
        cairn_detection_file_box(&p, d, shape->box);
    }
    return CAIRN_OK;
}

/* Prints the objects into the record. */
static cairn_status print_coco(const objects_image *image, FILE *record, cairn_file_error *error)
{
    cairn_status status;

    fputc(IMAGE_BEGIN, record);
    objects_print_image(image, record);
    fputc(ANNOTATIONS_BEGIN, record);
    status = objects_print_annotations(image, record);
    return status == CAIRN_OK
               ? status
               : cairn_file_error_set(error, status, image->path, 0, "no memory for the objects");
}

/* Writes the masks of an image, and its COCO objects into the record. */
static cairn_status write_objects(const settings *s, const work *w, int32_t id, FILE *record,
                                  cairn_file_error *error)
{
    objects_image image = {w->path, id, w->picture.width, w->picture.height, NULL, 0};
    cairn_status status = copy_objects(w, &image, error);

    if (status == CAIRN_OK && s->masks != NULL)
        status = objects_write_masks(&image, s->masks, w->stem, error);
    if (status == CAIRN_OK && s->coco != NULL)
        status = print_coco(&image, record, error);
    objects_free(&image);
    return status;
}

/* Writes the summary of an image. */
static void print_summary(const work *w, const cairn_detection_file_picture *p, FILE *record)
{
    fprintf(record, "%s: %" PRId32 " detection%s; %" PRId32 " segments of %" PRId32 " chains\n",
            w->path, w->detections.count, w->detections.count == 1 ? "" : "s", w->tokens.count,
            w->tokens.chain_count);
    for (int32_t i = 0; i < w->detections.count; i++) {
        const cairn_object_detection *d = &w->detections.found[i];
        double box[4];

        cairn_detection_file_box(p, d, box);
        fprintf(record, "  %.2f  (%.0f, %.0f) to (%.0f, %.0f)%s\n", (double)d->score, box[0],
                box[1], box[2], box[3], d->mirrored ? ", mirrored" : "");
    }
}

/* Writes the summary of an image as a JSON object. */
static void print_json(const work *w, const cairn_detection_file_picture *p, FILE *record)
{
    cairn_json_writer json = cairn_json_write_begin(record);

    cairn_json_write_text(&json, "image", w->path);
    cairn_json_write_array(&json, "detections");
    for (int32_t i = 0; i < w->detections.count; i++) {
        const cairn_object_detection *d = &w->detections.found[i];
        double box[4];

        cairn_detection_file_box(p, d, box);
        cairn_json_write_object(&json, NULL);
        cairn_json_write_number(&json, "score", (double)d->score);
        cairn_json_write_array(&json, "box_px");
        for (int32_t k = 0; k < 4; k++)
            cairn_json_write_number(&json, NULL, box[k]);
        cairn_json_write_array_end(&json);
        cairn_json_write_boolean(&json, "mirrored", d->mirrored);
        cairn_json_write_object_end(&json);
    }
    cairn_json_write_array_end(&json);
    cairn_json_write_integer(&json, "segments", w->tokens.count);
    cairn_json_write_integer(&json, "chains", w->tokens.chain_count);
    cairn_json_write_object_end(&json);
}

/* Writes the record of an image: its summary, its rows of the table, its COCO objects, its
 * comparison with the ground truth. */
static cairn_status print_record(const settings *s, const work *w, int32_t id, FILE *record,
                                 cairn_file_error *error)
{
    cairn_detection_file_picture p = {
        .shrink = w->picture.shrink, .tokens = &w->tokens, .detections = &w->detections};
    cairn_status status;

    (s->json ? print_json : print_summary)(w, &p, record);
    fputc(TABLE_BEGIN, record);
    for (int32_t i = 0; i < w->detections.count; i++) {
        double box[4];

        cairn_detection_file_box(&p, &w->detections.found[i], box);
        print_row(s, w, &w->detections.found[i], box, record);
    }
    status =
        s->coco != NULL || s->masks != NULL ? write_objects(s, w, id, record, error) : CAIRN_OK;
    fputc(TRUTH_BEGIN, record);
    if (status == CAIRN_OK && s->truth_path != NULL)
        status = detect_truth_print(&s->truth, w->path, &p, record, error);
    fputs("\f\n", record);
    return status;
}

static int run_image(const settings *s, size_t index, const cairn_shape_model *model, FILE *record)
{
    const char *path = s->images[index];
    cairn_file_error error;
    cairn_status status;
    work w;

    memset(&w, 0, sizeof w);
    w.path = path;
    (void)picture_stem(path, w.stem);
    status = picture_read(&w.picture, path, &s->pictures, &error);
    if (status == CAIRN_OK)
        status = detect(s, &w, model, &error);
    if (status == CAIRN_OK)
        status = write_all(s, &w, model, &error);
    if (status == CAIRN_OK)
        status = print_record(s, &w, (int32_t)index + 1, record, &error);
    picture_free(&w.picture);
    cairn_contour_search_run_free_tokens(&w.tokens);
    cairn_object_detect_run_free(&w.detections);
    return status == CAIRN_OK ? TOOL_OK : tool_report(&error);
}

/* ---- All images, distributed among processes ---- */

/* Processes images job, job + jobs, ... in order and stops at the first failure. */
static int run_job(const settings *s, int32_t job, const cairn_shape_model *model, FILE *record)
{
    int code = TOOL_OK;

    for (size_t i = (size_t)job; i < s->count && code == TOOL_OK; i += (size_t)s->jobs)
        code = run_image(s, i, model, record);
    if ((fflush(record) != 0 || ferror(record)) && code == TOOL_OK) {
        perror(PROGRAM);
        code = TOOL_FAILED;
    }
    return code;
}

static int run_jobs(const settings *s, const cairn_shape_model *model, FILE **records)
{
    pid_t process[MAX_JOBS];
    int own_code[MAX_JOBS], code = TOOL_OK;

    for (int32_t job = 0; job < s->jobs; job++) {
        own_code[job] = -1;
        process[job] = fork();
        if (process[job] == 0)
            _exit(run_job(s, job, model, records[job]));
        /* a system without fork() runs the jobs one after another */
        if (process[job] < 0 && errno == ENOSYS)
            own_code[job] = run_job(s, job, model, records[job]);
    }
    for (int32_t job = 0; job < s->jobs; job++) {
        int status = 0, own = own_code[job];

        if (own >= 0) {
            code = own > code ? own : code;
            continue;
        }
        if (process[job] < 0 || waitpid(process[job], &status, 0) < 0 || !WIFEXITED(status)) {
            fprintf(stderr, "%s: a process could not be run\n", PROGRAM);
            own = TOOL_FAILED;
        } else {
            own = WEXITSTATUS(status);
        }
        code = own > code ? own : code;
    }
    return code;
}

/* Reads the record of an image back: its summary goes to `result`, its rows to the table, its objects
 * to the COCO file, its hits to the ground truth. NULL: nowhere. */
static cairn_status merge_record(FILE *record, FILE *result, cairn_output *table,
                                 objects_coco *coco, detect_truth *truth)
{
    char line[LINE_BYTES];
    int c, part = 0;

    while ((c = fgetc(record)) != RECORD_END && c != EOF && c != TRUTH_BEGIN)
        if (c == TABLE_BEGIN || c == IMAGE_BEGIN || c == ANNOTATIONS_BEGIN)
            part = c;
        else if (part == TABLE_BEGIN && table != NULL)
            cairn_output_print(table, "%c", c);
        else if (part == IMAGE_BEGIN)
            fputc(c, coco->images.stream);
        else if (part == ANNOTATIONS_BEGIN)
            fputc(c, coco->annotations.stream);
        else if (part == 0 && result != NULL)
            fputc(c, result);
    while (c == TRUTH_BEGIN)
        if (fgets(line, sizeof line, record) == NULL)
            c = EOF;
        else if (line[0] == RECORD_END)
            c = RECORD_END;
        else if (!detect_truth_parse(truth, line))
            return CAIRN_NO_MEMORY;
    return c == RECORD_END ? CAIRN_OK : CAIRN_TRUNCATED;
}

/* Merges the records of all processes in the order of the images. */
static int merge_records(const settings *s, FILE **records, cairn_output *table, objects_coco *coco,
                         detect_truth *truth, cairn_json_writer *json)
{
    FILE *result = s->json ? json->file : s->quiet ? NULL : stdout;
    cairn_status status = CAIRN_OK;

    if (table != NULL)
        cairn_output_print(table, "image,class,left,top,right,bottom,score,mirrored\n");
    for (int32_t job = 0; job < s->jobs; job++)
        rewind(records[job]);
    for (size_t i = 0; i < s->count && status == CAIRN_OK; i++) {
        cairn_json_write_name(json, NULL);
        status = merge_record(records[i % (size_t)s->jobs], result, table, coco, truth);
    }
    if (status != CAIRN_OK)
        fprintf(stderr, "%s: the results of the processes cannot be read: %s\n", PROGRAM,
                cairn_status_text(status));
    return status == CAIRN_OK ? TOOL_OK : TOOL_FAILED;
}

static int run_all(const settings *s, const cairn_shape_model *model, cairn_output *table,
                   objects_coco *coco, detect_truth *truth, cairn_json_writer *json)
{
    FILE *records[MAX_JOBS] = {NULL};
    int code = TOOL_OK;

    for (int32_t job = 0; job < s->jobs && code == TOOL_OK; job++) {
        records[job] = tmpfile();
        if (records[job] == NULL) {
            perror(PROGRAM);
            code = TOOL_FAILED;
        }
    }
    if (code == TOOL_OK)
        code = s->jobs > 1 ? run_jobs(s, model, records) : run_job(s, 0, model, records[0]);
    if (code == TOOL_OK)
        code = merge_records(s, records, table, coco, truth, json);
    for (int32_t job = 0; job < s->jobs; job++)
        if (records[job] != NULL)
            (void)fclose(records[job]);
    return code;
}

/* Commits an open output when the code is TOOL_OK, else discards it. Returns the exit code. */
static int close_table(cairn_output *table, int code)
{
    cairn_file_error error;

    if (table != NULL && code == TOOL_OK)
        return cairn_output_commit(table, &error) == CAIRN_OK ? TOOL_OK : tool_report(&error);
    cairn_output_discard(table);
    return code;
}

/* Runs the detection. Table and COCO file are opened first, so that an unwritable path fails at
 * once and not after all images. */
static int run(const settings *s, const cairn_shape_model *model, detect_truth *truth)
{
    cairn_file_error error;
    cairn_output *table = NULL;
    objects_coco coco = {0};
    tool_json json;
    int code;

    if (s->table != NULL && tool_output_open(&table, s->table, &error) != CAIRN_OK)
        return tool_report(&error);
    if (s->coco != NULL && objects_coco_open(&coco, s->coco, &error) != CAIRN_OK)
        return close_table(table, tool_report(&error));
    code = tool_json_open(&json, PROGRAM);
    if (code != TOOL_OK) {
        objects_coco_discard(&coco);
        return close_table(table, code);
    }
    cairn_json_write_text(&json.writer, "model", s->model);
    cairn_json_write_text(&json.writer, "folder", s->folder);
    cairn_json_write_array(&json.writer, "images");
    code = run_all(s, model, table, &coco, truth, &json.writer);
    cairn_json_write_array_end(&json.writer);
    if (code == TOOL_OK && s->curves != NULL &&
        detect_truth_write(truth, s->images, s->count, s->curves, cairn_output_path_name(s->model),
                           &error) != CAIRN_OK)
        code = tool_report(&error);
    if (code != TOOL_OK)
        objects_coco_discard(&coco);
    else if (s->coco != NULL && objects_coco_commit(&coco, PROGRAM, s->model, &error) != CAIRN_OK)
        code = tool_report(&error);
    return tool_json_close(&json, PROGRAM, s->json, close_table(table, code));
}

int tool_detect(int argc, char **argv)
{
    static settings s;
    cairn_shape_image_params image = cairn_shape_image_default();
    cairn_shape_model_builder_params builder = cairn_shape_model_builder_default();
    cairn_object_detect_params params = cairn_object_detect_default(1, 1);
    cairn_shape_model_file model;
    cairn_file_error error;
    option_result result;
    int code;

    memset(&s, 0, sizeof s);
    s.pictures.side = PICTURE_SIDE;
    s.pictures.canny = cairn_vision_canny_default();
    s.strength = 1;
    s.jobs = sysconf(_SC_NPROCESSORS_ONLN);
    s.jobs = s.jobs < 1 ? 1 : s.jobs > MAX_JOBS ? MAX_JOBS : s.jobs;
    s.nearest = params.nearest;
    s.matches = params.matches;
    s.weight = (double)params.appearance_weight;
    s.verify = -1;
    s.candidates = -1;
    s.overlap = (double)params.overlap;
    s.score = (double)NAN;
    result = read_settings(&s, argc, argv);
    if (result != OPTIONS_READ)
        return (int)result;
    s.truth.as_written = s.as_written;
    s.jobs = s.jobs > (int64_t)s.count ? (int64_t)s.count : s.jobs;
    code = picture_check_names(PROGRAM, s.images, s.count);
    if (code == TOOL_OK)
        code = picture_check_name(PROGRAM, s.model);
    if (code != TOOL_OK)
        return code;
    if (cairn_shape_model_file_load(&model, s.model, &image, &builder, NULL, &error) != CAIRN_OK)
        return tool_report(&error);
    if ((s.cuts != NULL &&
         cairn_part_cut_file_read(s.cut, &s.cut_count, s.cuts, &error) != CAIRN_OK) ||
        (s.truth_path != NULL && detect_truth_read(&s.truth, s.truth_path, &error) != CAIRN_OK) ||
        (s.appearance != NULL &&
         (cairn_appearance_file_read(&s.look, s.appearance, &error) != CAIRN_OK ||
          cairn_appearance_image_load(&error) != CAIRN_OK)))
        code = tool_report(&error);
    else
        code = run(&s, &model.model, &s.truth);
    detect_truth_free(&s.truth);
    cairn_appearance_file_free(&s.look);
    cairn_shape_model_file_free(&model);
    return code;
}
