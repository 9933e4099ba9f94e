/* cairn skeleton: groups contours and medial axes of symmetric parts of images, and finds contours
 * between regions, without a model. */
#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/boundary.h"
#include "cairn/contour_search_run.h"
#include "cairn/number_text.h"
#include "cairn/output.h"
#include "cairn/output_set.h"
#include "cairn/shape_model_file.h"
#include "cairn/skeleton_file.h"
#include "cairn/vision.h"
#include "src/host/images/image_capacity.h"
#include "tools/cairn_picture.h"
#include "tools/cairn_tool.h"

#define PROGRAM "cairn skeleton"

enum {
    MAX_IMAGES = 4096,
    PATH_BYTES = 4096,
    FILES_PER_IMAGE = 3,
    MAX_RADII = 1 << 16,
    LARGEST_SIDE = 8192
};

typedef struct settings {
    const char *images[MAX_IMAGES];
    size_t count;
    const char *radius, *learn, *weight, *folder, *edges;
    int64_t particles; /* 0: not given */
    int64_t side;      /* px: larger images are halved until they fit */
    double sigma, slope;
    int32_t sigma_given, slope_given;
    double contrast, log_odds, strength; /* NaN: not given */
    double least, most;                  /* px, range of radii; 0 and 0: proposed from the image */
    uint64_t seed;
    int32_t json, quiet, written, lines;
} settings;

/* Parses "A:B". Returns 0 when the text is invalid or not 1 <= A <= B. */
static int read_range(const char *text, double *least, double *most)
{
    const char *colon = strchr(text, ':');

    return colon != NULL && cairn_number_read(text, (size_t)(colon - text), least) &&
           cairn_number_read(colon + 1, strlen(colon + 1), most) && isfinite(*least) &&
           isfinite(*most) && *least >= 1 && *least <= *most && *most <= 8192;
}

/* Handles --weight as-written as --as-written; rejects options that the method of the thesis
 * lacks. */
static option_result check_written(settings *s)
{
    if (s->weight != NULL && strcmp(s->weight, "evidence") == 0 && s->written)
        return (option_result)options_refuse(
            PROGRAM, "--as-written and --weight evidence, expected one of them");
    s->written |= s->weight != NULL && strcmp(s->weight, "as-written") == 0;
    if (s->written && !isnan(s->contrast))
        return (option_result)options_refuse(PROGRAM,
                                             "--contrast with --as-written: the thesis does not "
                                             "use how steep edges are, expected one of them");
    if (s->written && !isnan(s->strength))
        return (option_result)options_refuse(
            PROGRAM, "--min-strength with --as-written: the thesis has no contours "
                     "between regions, expected one of them");
    return OPTIONS_READ;
}

static option_result check_settings(settings *s)
{
    if (s->count < 1 || s->folder == NULL)
        return (option_result)options_refuse(PROGRAM, "%s, expected IMAGE... -o DIR",
                                             s->count < 1 ? "no image"
                                                          : "no folder to write to (-o)");
    if (s->radius != NULL && s->learn != NULL)
        return (option_result)options_refuse(PROGRAM, "--radius and --learn, expected one of them");
    if (s->radius != NULL && !read_range(s->radius, &s->least, &s->most))
        return (option_result)options_refuse(
            PROGRAM, "--radius %s, expected A:B in pixels, 1 <= A <= B <= 8192", s->radius);
    if (s->weight != NULL && strcmp(s->weight, "evidence") != 0 &&
        strcmp(s->weight, "as-written") != 0)
        return (option_result)options_refuse(
            PROGRAM, "--weight %s, expected evidence or as-written", s->weight);
    if (s->edges != NULL && s->count > 1)
        return (option_result)options_refuse(PROGRAM, "--edges with %zu images, expected one",
                                             s->count);
    if (check_written(s) != OPTIONS_READ)
        return OPTIONS_BAD;
    if (s->edges != NULL && (s->sigma_given || s->slope_given))
        return (option_result)options_refuse(
            PROGRAM, "%s with --edges, expected one of them: edges are not searched in the image",
            s->sigma_given ? "--sigma" : "--min-slope");
    if (s->edges != NULL && !s->written)
        return (option_result)options_refuse(
            PROGRAM, "--edges without --as-written: the default method reads the gradients of the "
                     "image, expected both");
    return OPTIONS_READ;
}

static option_result read_settings(settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_TEXT("-o", &s->folder, "DIR",
                    "folder to write NAME.svg and NAME.json to, for each image NAME.*"),
        OPTION_TEXT("--radius", &s->radius, "A:B",
                    "range of half the width of parts, pixels (proposed from each image)"),
        OPTION_TEXT("--learn", &s->learn, "DIR",
                    "learns the range of radii from the objects in DIR, silhouettes or drawings of "
                    "outlines, in the scale of the images"),
        OPTION_FLAG("--as-written", &s->written,
                    "the method of Adluru 2008, chapter 3, as printed: particles start on the "
                    "centre points of every pair of edges about lines, weights 3.7 to 3.9"),
        OPTION_TEXT("--weight", &s->weight, "NAME",
                    "evidence, or as-written, which is --as-written"),
        OPTION_NUMBER(
            "--min-log-odds", &s->log_odds, 0, 1e6, "L",
            "minimum log odds of a reported part (20; as written the logarithm of p_min, 12)"),
        OPTION_NUMBER("--min-strength", &s->strength, 0, 1e6, "S",
                      "minimum strength of a reported contour between regions (2); not as written"),
        OPTION_TEXT("--edges", &s->edges, "FILE",
                    "the image's edges, strengths 0 ... 255, from a detector of your own (the "
                    "thesis has pb),\n"
                    "with the directions of their chains;\n"
                    "of one image, with --as-written"),
        {"--sigma", OPTION_IS_NUMBER, &s->sigma, 0.7, 8, "PX",
         "standard deviation of the Gaussian blur, px; not with --edges", &s->sigma_given},
        {"--min-slope", OPTION_IS_NUMBER, &s->slope, 0.01, 1000, "G",
         "minimum gradient of an edge, grey levels per pixel; not with --edges", &s->slope_given},
        OPTION_NUMBER(
            "--contrast", &s->contrast, 0, 100, "L",
            "log odds of an edge whose gradient is e times the mean; 0: all edges are equal\n"
            "(6); not as written"),
        OPTION_INTEGER("--max-side", &s->side, 16, LARGEST_SIDE, "PX",
                       "larger images are halved until they fit; lengths are of the image"),
        OPTION_INTEGER("--particles", &s->particles, 1, 1024, "N",
                       "particles of the filter (16; as written 50): more make the radii more "
                       "precise, and do not find more"),
        {"--seed", OPTION_IS_SEED, &s->seed, 0, 0, "N", "seed of the particle filter", NULL},
        OPTION_FLAG("--lines", &s->lines,
                    "also NAME-lines.svg: centre points of edges that face each other, and lines "
                    "through them"),
        OPTION_JSON(&s->json),
        OPTION_FLAG("--quiet", &s->quiet, "no summary"),
    };
    const option_set set = {
        PROGRAM, "IMAGE... -o DIR [options]",
        "Groups the contours and axes of the symmetric parts of images (" TOOL_IMAGES ") at "
        "once, "
        "without a model, by a particle filter on pairs of edges that face each other. Contours "
        "between regions "
        "of different colours are ranked by the contrast of their sides.",
        table, sizeof table / sizeof *table};
    option_result result;

    s->count = MAX_IMAGES;
    result = options_read(&set, argc, argv, s->images, &s->count);
    return result == OPTIONS_READ ? check_settings(s) : result;
}

/* ---- Radii from outlines ---- */

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

/* Adds the radii along the medial axes of one object. */
static cairn_status learn_from(const char *path, double *radii, int32_t *count,
                               cairn_file_error *error)
{
    cairn_shape_image_params image = cairn_shape_image_default();
    cairn_shape_model_builder_params builder = cairn_shape_model_builder_default();
    cairn_shape_model_file model;
    cairn_status status = cairn_shape_model_file_load(&model, path, &image, &builder, NULL, error);

    if (status != CAIRN_OK)
        return status;
    for (int32_t i = 0; i < model.model.sample_count && *count < MAX_RADII; i++)
        radii[(*count)++] = (double)(model.model.samples[i].radius * model.model.size);
    cairn_shape_model_file_free(&model);
    return CAIRN_OK;
}

/* Learns the range of radii: the 5 % and 95 % quantiles. */
static int learn(settings *s)
{
    double *radii = malloc(MAX_RADII * sizeof *radii);
    DIR *open = opendir(s->learn);
    cairn_status status = CAIRN_OK;
    cairn_file_error error;
    struct dirent *entry;
    int32_t count = 0;

    if (radii == NULL || open == NULL) {
        int code = radii == NULL ? TOOL_FAILED : TOOL_BAD;

        fprintf(stderr, "%s: %s, expected a folder of outlines\n", s->learn,
                strerror(radii == NULL ? ENOMEM : errno));
        free(radii);
        if (open != NULL)
            (void)closedir(open);
        return code;
    }
    while (status == CAIRN_OK && (entry = readdir(open)) != NULL) {
        char path[PATH_BYTES];

        if (entry->d_name[0] != '.' &&
            snprintf(path, sizeof path, "%s/%s", s->learn, entry->d_name) < PATH_BYTES)
            status = learn_from(path, radii, &count, &error);
    }
    (void)closedir(open);
    if (status == CAIRN_OK && count > 0) {
        qsort(radii, (size_t)count, sizeof *radii, compare);
        s->least = fmax(1, radii[count / 20]);
        s->most = fmax(s->least, radii[count - 1 - count / 20]);
    }
    free(radii);
    if (status != CAIRN_OK)
        return tool_report(&error);
    return count > 0
               ? TOOL_OK
               : options_refuse(PROGRAM,
                                "--learn %s holds no outlines, expected silhouettes or drawings",
                                s->learn);
}

/* ---- One image ---- */

/* An image and its results while it is processed. */
typedef struct work {
    const char *path;
    char stem[PICTURE_NAME_BYTES];
    cairn_vision_image grey, colour; /* colour: as it is; both reduced */
    int32_t width, height;           /* of the image */
    cairn_pool pool;
    int has_pool;
    cairn_boundary *boundary;
    cairn_edgel_set *edgels;
    cairn_skeleton_grouping *skeleton;
    cairn_skeleton_file_picture picture;
    cairn_edgel *given; /* [given_count] of --edges; NULL: the image's own */
    int32_t given_count;
} work;

static cairn_status create_objects(const settings *s, work *w)
{
    int32_t width = w->grey.width, height = w->grey.height;
    cairn_edgel_params edgel = cairn_image_capacity_edgel(width, height);
    cairn_skeleton_grouping_params skeleton =
        cairn_image_capacity_skeleton(width, height, s->written);
    cairn_boundary_params boundary = cairn_image_capacity_boundary(width, height);
    size_t need;

    if (!isnan(s->strength))
        boundary.min_strength = (cairn_real)s->strength;
    edgel.sigma = (cairn_real)s->sigma;
    edgel.min_gradient = (cairn_real)s->slope;
    if (s->particles > 0)
        skeleton.particle_count = (int32_t)s->particles;
    if (!isnan(s->contrast))
        skeleton.contrast_weight = (cairn_real)s->contrast;
    if (!isnan(s->log_odds))
        skeleton.min_log_odds = (cairn_real)s->log_odds;
    skeleton.seed = s->seed;
    need = cairn_edgel_memory(&edgel) + cairn_skeleton_grouping_memory(&skeleton) +
           (s->written ? 0 : cairn_boundary_memory(&boundary));
    if (tool_pool_open(&w->pool, PROGRAM, NULL, need) != TOOL_OK)
        return CAIRN_NO_MEMORY;
    w->has_pool = 1;
    if (cairn_edgel_create(&w->edgels, &w->pool, &edgel) != CAIRN_OK ||
        (!s->written && cairn_boundary_create(&w->boundary, &w->pool, &boundary) != CAIRN_OK))
        return CAIRN_NO_MEMORY;
    return cairn_skeleton_grouping_create(&w->skeleton, &w->pool, &skeleton);
}

static cairn_status run_edgels(cairn_edgel_set *edgels)
{
    cairn_status status;

    do {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status = cairn_edgel_step(edgels, &budget);
    } while (status == CAIRN_MORE);
    return status;
}

/* Edgels along the chains of the edge image of another detector; the list is from the heap. */
static cairn_status read_edgels(const char *path, const work *w, cairn_edgel **edgels,
                                int32_t *count, cairn_file_error *error)
{
    cairn_vision_image image;
    cairn_contour_search_tokens tokens;
    cairn_raster_u8_view view;
    cairn_edgel *list;
    cairn_status status = cairn_vision_read_grey(&image, path, error);

    if (status != CAIRN_OK)
        return status;
    if (image.width != w->width || image.height != w->height) {
        status = cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                      "%" PRId32 " x %" PRId32 " pixels, expected %" PRId32
                                      " x %" PRId32 " as the image",
                                      image.width, image.height, w->width, w->height);
        cairn_vision_free(&image);
        return status;
    }
    picture_shrink_edges(&image, w->picture.shrink);
    view = (cairn_raster_u8_view){image.samples, image.width, image.height, image.width};
    status = cairn_contour_search_run_tokens(&tokens, view, 1, 1, path, error);
    cairn_vision_free(&image);
    if (status != CAIRN_OK)
        return status;
    list = malloc(((size_t)tokens.count + 1) * sizeof *list);
    if (list == NULL) {
        status = cairn_file_error_set(error, CAIRN_NO_MEMORY, path, 0,
                                      "no memory for %" PRId32 " edgels, expected some more",
                                      tokens.count);
        cairn_contour_search_run_free_tokens(&tokens);
        return status;
    }
    for (int32_t i = 0; i < tokens.count; i++) {
        cairn_segment line = tokens.lines[i];
        cairn_vec2 along = cairn_vec2_sub(line.b, line.a);
        cairn_real length = cairn_vec2_norm(along);

        list[i] = (cairn_edgel){
            .position = cairn_vec2_scale(cairn_vec2_add(line.a, line.b), CAIRN_REAL(0.5)),
            .normal = cairn_vec2_scale(cairn_vec2_left_perp(along), 1 / length),
            .gradient_magnitude = 0};
    }
    *edgels = list;
    *count = tokens.count;
    cairn_contour_search_run_free_tokens(&tokens);
    return CAIRN_OK;
}

static cairn_status run_skeleton(cairn_skeleton_grouping *skeleton)
{
    cairn_status status;

    do {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status = cairn_skeleton_grouping_step(skeleton, &budget);
    } while (status == CAIRN_MORE);
    return status;
}

/* Finds the contours between regions of the colour image, or of the grey image when samples have 16
 * bits. */
static cairn_status run_boundary(work *w)
{
    const cairn_vision_image *of = w->colour.sample_bytes == 1 ? &w->colour : &w->grey;
    cairn_boundary_image in = {of->samples, of->width, of->height, of->channels,
                               (ptrdiff_t)of->width * of->channels};
    cairn_status status = cairn_boundary_begin(w->boundary, &in);

    while (status == CAIRN_OK || status == CAIRN_MORE) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status = cairn_boundary_step(w->boundary, &budget);
        if (status == CAIRN_OK)
            break;
    }
    w->picture.boundary = cairn_boundary_read(w->boundary);
    return status;
}

/* A radius in pixels of the reduced image; 0: proposed from the image. */
static cairn_real reduced_radius(double radius, int32_t shrink)
{
    return (cairn_real)(radius > 0 ? fmax(1, radius / shrink) : 0);
}

static cairn_status group(const settings *s, work *w)
{
    cairn_raster_u8_view view = {w->grey.samples, w->grey.width, w->grey.height, w->grey.width};
    cairn_skeleton_grouping_input in;
    cairn_status status = create_objects(s, w);

    if (status == CAIRN_OK && w->given == NULL)
        status = cairn_edgel_begin(w->edgels, view);
    if (status == CAIRN_OK && w->given == NULL)
        status = run_edgels(w->edgels);
    if (status != CAIRN_OK)
        return status;
    in.edgels = w->given;
    in.count = w->given_count;
    if (w->given == NULL)
        in.edgels = cairn_edgel_list(w->edgels, &in.count);
    in.width = w->grey.width;
    in.height = w->grey.height;
    in.min_radius = reduced_radius(s->least, w->picture.shrink);
    in.max_radius = reduced_radius(s->most, w->picture.shrink);
    status = cairn_skeleton_grouping_begin(w->skeleton, &in);
    if (status == CAIRN_OK)
        status = run_skeleton(w->skeleton);
    if (status == CAIRN_OK && !s->written)
        status = run_boundary(w);
    w->picture.image = cairn_output_path_name(w->path);
    w->picture.grey = w->grey.samples;
    w->picture.width = in.width;
    w->picture.height = in.height;
    w->picture.edgel_count = in.count;
    w->picture.proposed = s->most == 0;
    w->picture.result = cairn_skeleton_grouping_read(w->skeleton);
    return status;
}

static cairn_status write_all(const settings *s, const work *w, cairn_file_error *error)
{
    static const char *const endings[FILES_PER_IMAGE] = {".svg", ".json", "-lines.svg"};
    char name[FILES_PER_IMAGE][PICTURE_NAME_BYTES + 12];
    const char *names[FILES_PER_IMAGE];
    int32_t files = s->lines ? FILES_PER_IMAGE : FILES_PER_IMAGE - 1;
    cairn_output_set *set;
    cairn_status status;

    for (int32_t i = 0; i < FILES_PER_IMAGE; i++) {
        (void)snprintf(name[i], sizeof name[i], "%s%s", w->stem, endings[i]);
        names[i] = name[i];
    }
    status = cairn_output_set_open(&set, s->folder, names, files, error);
    if (status != CAIRN_OK)
        return status;
    if (!s->lines)
        status = picture_remove_unless_of_image(set, s->folder, names[FILES_PER_IMAGE - 1], error);
    if (status == CAIRN_OK)
        status = cairn_skeleton_file_draw(&w->picture, cairn_output_set_path(set, 0), error);
    if (status == CAIRN_OK)
        status = cairn_skeleton_file_write(&w->picture, cairn_output_set_path(set, 1), error);
    if (status == CAIRN_OK && s->lines)
        status = cairn_skeleton_file_draw_lines(&w->picture, w->skeleton,
                                                cairn_output_set_path(set, 2), error);
    if (status == CAIRN_OK)
        return cairn_output_set_commit(set, error);
    cairn_output_set_discard(set);
    return status;
}

static void print_summary(const work *w, double seconds)
{
    const cairn_skeleton_grouping_result *r = &w->picture.result;

    printf("%s: %" PRId32 " part%s of %" PRId32 " object%s, radii %.1f to %.1f px%s; %" PRId32
           " contour%s between regions; %" PRId32 " edgels, %zu bytes, %.2f s\n",
           w->path, r->part_count, r->part_count == 1 ? "" : "s", r->object_count,
           r->object_count == 1 ? "" : "s", (double)r->min_radius * w->picture.shrink,
           (double)r->max_radius * w->picture.shrink, w->picture.proposed ? " (proposed)" : "",
           w->picture.boundary.contour_count, w->picture.boundary.contour_count == 1 ? "" : "s",
           w->picture.edgel_count, w->pool.peak, seconds);
}

static void write_json(cairn_json_writer *json, const work *w, double seconds)
{
    const cairn_skeleton_grouping_result *r = &w->picture.result;

    cairn_json_write_object(json, NULL);
    cairn_json_write_text(json, "image", w->path);
    cairn_json_write_integer(json, "shrink", w->picture.shrink);
    cairn_json_write_integer(json, "parts", r->part_count);
    cairn_json_write_integer(json, "objects", r->object_count);
    cairn_json_write_number(json, "min_radius_px", (double)r->min_radius * w->picture.shrink);
    cairn_json_write_number(json, "max_radius_px", (double)r->max_radius * w->picture.shrink);
    cairn_json_write_boolean(json, "proposed", w->picture.proposed);
    cairn_json_write_integer(json, "contours", w->picture.boundary.contour_count);
    cairn_json_write_integer(json, "edgels", w->picture.edgel_count);
    cairn_json_write_integer(json, "pool_bytes", (int64_t)w->pool.peak);
    cairn_json_write_number(json, "seconds", seconds);
    cairn_json_write_object_end(json);
}

static int run_image(const settings *s, const char *path, cairn_json_writer *json)
{
    double start = tool_seconds();
    cairn_file_error error;
    cairn_status status;
    work w;

    memset(&w, 0, sizeof w);
    w.path = path;
    (void)picture_stem(path, w.stem);
    status = cairn_vision_read_grey(&w.grey, path, &error);
    if (status == CAIRN_OK)
        status = cairn_vision_read(&w.colour, path, &error);
    w.width = w.grey.width;
    w.height = w.grey.height;
    if (status == CAIRN_OK)
        w.picture.shrink = picture_shrink(&w.grey, s->side);
    if (status == CAIRN_OK && w.colour.sample_bytes == 1)
        (void)picture_shrink(&w.colour, s->side);
    if (status == CAIRN_OK && s->edges != NULL)
        status = read_edgels(s->edges, &w, &w.given, &w.given_count, &error);
    if (status == CAIRN_OK) {
        status = group(s, &w);
        if (status != CAIRN_OK)
            status = cairn_file_error_set(&error, status, path, 0, "%s", cairn_status_text(status));
    }
    if (status == CAIRN_OK)
        status = write_all(s, &w, &error);
    if (status == CAIRN_OK && s->json)
        write_json(json, &w, tool_seconds() - start);
    else if (status == CAIRN_OK && !s->quiet)
        print_summary(&w, tool_seconds() - start);
    cairn_vision_free(&w.grey);
    cairn_vision_free(&w.colour);
    free(w.given);
    if (w.has_pool)
        tool_pool_close(&w.pool);
    return status == CAIRN_OK ? TOOL_OK : tool_report(&error);
}

/* Returns 1 when the picture of lines of one image would have the name of the other's picture. */
static int is_its_lines(const settings *s, const char *stem, const char *other)
{
    size_t length = strlen(stem);

    return s->lines && strncmp(stem, other, length) == 0 && strcmp(other + length, "-lines") == 0;
}

/* Rejects images whose output files would overwrite each other. */
static int check_names(const settings *s)
{
    char stem[PICTURE_NAME_BYTES], other[PICTURE_NAME_BYTES];

    for (size_t i = 0; i < s->count; i++) {
        if (!picture_stem(s->images[i], stem))
            return options_refuse(PROGRAM, "'%s', expected the name of an image", s->images[i]);
        for (size_t k = 0; k < i; k++)
            if (picture_stem(s->images[k], other) &&
                (is_its_lines(s, stem, other) || is_its_lines(s, other, stem)))
                return options_refuse(
                    PROGRAM,
                    "--lines: a picture of %s would overwrite one of %s, expected other names",
                    s->images[k], s->images[i]);
            else if (strcmp(stem, other) == 0)
                return options_refuse(PROGRAM,
                                      "%s and %s are both named '%s', expected different names",
                                      s->images[k], s->images[i], stem);
    }
    return TOOL_OK;
}

static int run_images(const settings *s)
{
    tool_json json;
    int code = tool_json_open(&json, PROGRAM);

    if (code != TOOL_OK)
        return code;
    cairn_json_write_text(&json.writer, "folder", s->folder);
    cairn_json_write_array(&json.writer, "images");
    for (size_t i = 0; i < s->count && code == TOOL_OK; i++)
        code = run_image(s, s->images[i], &json.writer);
    cairn_json_write_array_end(&json.writer);
    return tool_json_close(&json, PROGRAM, s->json, code);
}

int tool_skeleton(int argc, char **argv)
{
    static settings s;
    cairn_edgel_params edgel = cairn_edgel_default();
    option_result result;
    int code;

    memset(&s, 0, sizeof s);
    s.contrast = s.log_odds = s.strength = (double)NAN;
    s.side = LARGEST_SIDE;
    s.sigma = (double)edgel.sigma;
    s.slope = (double)edgel.min_gradient;
    s.seed = 1;
    result = read_settings(&s, argc, argv);
    if (result != OPTIONS_READ)
        return (int)result;
    code = check_names(&s);
    if (code == TOOL_OK && s.learn != NULL)
        code = learn(&s);
    return code == TOOL_OK ? run_images(&s) : code;
}
