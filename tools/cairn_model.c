/* cairn model: builds the model of a shape (outline, medial axes, radii) from a picture. */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cairn/number_text.h"
#include "cairn/output.h"
#include "cairn/part_cut_file.h"
#include "cairn/shape_model_file.h"
#include "cairn/vision.h"
#include "src/host/files/map_file_image.h"
#include "tools/cairn_tool.h"

#define PROGRAM "cairn model"

enum { PATH_BYTES = 4096 };

typedef struct settings {
    const char *shape, *output, *picture, *parts, *cuts, *holes;
    int64_t points, samples, paths;
    double gap, part;
    int64_t side;
    const char *grab;
    int32_t box[4];
    char silhouette[PATH_BYTES]; /* of --grab; "": none */
    int32_t mirror, json, quiet;
} settings;

/* Reads x,y,w,h. Returns 0 when the text is invalid. */
static int read_box(const char *text, int32_t box[4])
{
    for (int32_t k = 0; k < 4; k++) {
        size_t length = strcspn(text, ",");
        double value;

        if (!cairn_number_read(text, length, &value) || !(value >= 0) ||
            value > CAIRN_VISION_MAX_SIDE || value != floor(value) ||
            text[length] != (k < 3 ? ',' : '\0'))
            return 0;
        box[k] = (int32_t)value;
        text += length + (k < 3);
    }
    return 1;
}

/* Writes the name of the silhouette: that of the model, without its extension. */
static int name_silhouette(settings *s)
{
    const char *name = cairn_output_path_name(s->output), *dot = strrchr(name, '.');
    size_t length = dot != NULL && dot > name ? (size_t)(dot - s->output) : strlen(s->output);

    return snprintf(s->silhouette, sizeof s->silhouette, "%.*s-silhouette.png", (int)length,
                    s->output) < PATH_BYTES;
}

static option_result read_settings(settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_TEXT("-o", &s->output, "FILE", "the model, a text file"),
        OPTION_TEXT("--svg", &s->picture, "FILE", "draws the model: outline, axes, radii"),
        OPTION_TEXT("--parts", &s->parts, "FILE",
                    "draws the part bundles: fragments of the outline (SVG)"),
        OPTION_TEXT("--cuts", &s->cuts, "FILE",
                    "--parts: fragments by hand, one per line: first sample, last sample, bundle"),
        OPTION_INTEGER("--points", &s->points, 16, 1024, "N", "samples of the outline"),
        OPTION_INTEGER("--samples", &s->samples, 4, 256, "N",
                       "samples of a path that covers the complete outline"),
        OPTION_INTEGER("--paths", &s->paths, 1, CAIRN_SHAPE_MODEL_MAX_PATHS, "N",
                       "maximum number of paths; 1: only the longest"),
        OPTION_TEXT("--holes", &s->holes, "NAME",
                    "holes: keep as separate outlines, fill, or refuse"),
        OPTION_NUMBER(
            "--gap", &s->gap, 0, 1, "SHARE",
            "maximum gap between line ends that is closed, fraction of the drawing's diagonal"),
        OPTION_NUMBER("--part", &s->part, 0, 1, "SHARE",
                      "minimum area of a part, fraction of the largest one"),
        OPTION_INTEGER("--max-side", &s->side, 16, CAIRN_SHAPE_IMAGE_MAX_SIDE, "PX",
                       "larger pictures are halved until they fit"),
        OPTION_TEXT("--grab", &s->grab, "X,Y,W,H",
                    "cuts the object in this box out of a photograph (OpenCV), px; its silhouette\n"
                    "is written beside the model: NAME-silhouette.png"),
        OPTION_FLAG("--mirror", &s->mirror, "mirrors the model, left and right exchanged"),
        OPTION_JSON(&s->json),
        OPTION_FLAG("--quiet", &s->quiet, "no summary"),
    };
    const option_set set = {PROGRAM, "SHAPE -o FILE [options]",
                            "Makes the model of a shape from a picture of one object, a silhouette "
                            "or a drawing of its "
                            "outline (" TOOL_IMAGES "): the axes of its symmetry with the "
                            "radii along them. SHAPE may also be a "
                            "model, to be drawn or mirrored.",
                            table, sizeof table / sizeof *table};
    const char *words[1] = {NULL};
    size_t count = 1;
    option_result result = options_read(&set, argc, argv, words, &count);

    if (result != OPTIONS_READ)
        return result;
    if (count < 1 || s->output == NULL)
        return (option_result)options_refuse(PROGRAM, "%s, expected %s",
                                             count < 1 ? "no picture" : "no file to write to (-o)",
                                             set.synopsis);
    if (strcmp(s->holes, "keep") != 0 && strcmp(s->holes, "fill") != 0 &&
        strcmp(s->holes, "refuse") != 0)
        return (option_result)options_refuse(PROGRAM, "--holes %s, expected keep, fill or refuse",
                                             s->holes);
    if (s->cuts != NULL && s->parts == NULL)
        return (option_result)options_refuse(
            PROGRAM, "--cuts without --parts, expected a picture to draw them in");
    if (s->grab != NULL && !read_box(s->grab, s->box))
        return (option_result)options_refuse(
            PROGRAM, "--grab %s, expected X,Y,W,H: left, top, width, height in pixels", s->grab);
    if (s->grab != NULL && !name_silhouette(s))
        return (option_result)options_refuse(PROGRAM, "-o %s, expected a shorter path", s->output);
    s->shape = words[0];
    return OPTIONS_READ;
}

/* Cuts the object out of the photograph and writes its silhouette. */
static cairn_status grab(const settings *s, cairn_file_error *error)
{
    cairn_vision_image photo, silhouette;
    cairn_status status = cairn_vision_read(&photo, s->shape, error);

    if (status != CAIRN_OK)
        return status;
    if (photo.sample_bytes > 1)
        status = cairn_vision_make_grey(&photo) == CAIRN_OK
                     ? CAIRN_OK
                     : cairn_file_error_system(error, s->shape, "read", ENOMEM);
    if (status == CAIRN_OK)
        status = cairn_vision_grab(&silhouette, &photo, s->box, s->shape, error);
    cairn_vision_free(&photo);
    if (status != CAIRN_OK)
        return status;
    status = cairn_image_write_png(s->silhouette, silhouette.samples, silhouette.width,
                                   silhouette.height, error);
    cairn_vision_free(&silhouette);
    return status;
}

static cairn_status load(const settings *s, cairn_shape_model_file *file, cairn_shape_image *traced,
                         cairn_file_error *error)
{
    cairn_shape_image_params image = cairn_shape_image_default();
    cairn_shape_model_builder_params builder = cairn_shape_model_builder_default();

    image.holes = s->holes[0] == 'k'   ? CAIRN_SHAPE_IMAGE_HOLES_KEEP
                  : s->holes[0] == 'f' ? CAIRN_SHAPE_IMAGE_HOLES_FILL
                                       : CAIRN_SHAPE_IMAGE_HOLES_REFUSE;
    image.max_gap = s->gap;
    image.min_part = s->part;
    image.max_side = (int32_t)s->side;
    builder.outline_samples = (int32_t)s->points;
    builder.path_samples = (int32_t)s->samples;
    builder.max_paths = (int32_t)s->paths;
    if (s->grab != NULL) {
        cairn_status status = grab(s, error);

        if (status != CAIRN_OK)
            return status;
    }
    return cairn_shape_model_file_load(file, s->grab != NULL ? s->silhouette : s->shape, &image,
                                       &builder, traced, error);
}

static void print_summary(const settings *s, const cairn_shape_model *m,
                          const cairn_shape_image *traced)
{
    double share = 0;

    for (int32_t i = 0; i < m->path_count; i++)
        share += (double)m->paths[i].outline_share;
    if (s->grab != NULL)
        printf("silhouette %s\n", s->silhouette);
    if (traced->count > 0)
        printf("picture    %s, outlines %" PRId32 ", holes %" PRId32 "\n"
               "gaps       %" PRId32 " joined\n"
               "specks     %" PRId32 " left out\n",
               traced->is_drawing ? "a drawing" : "a silhouette", traced->count, traced->holes,
               traced->bridged_gaps, traced->dropped_regions);
    printf("size       %.6g\n"
           "outline    %" PRId32 " samples, %.0f %% of it on the sides of paths\n"
           "paths      %" PRId32 ", %" PRId32 " samples\n",
           (double)m->size, m->outline_count, 100 * share, m->path_count, m->sample_count);
    for (int32_t i = 0; i < m->path_count; i++)
        printf("  %" PRId32 "        %" PRId32 " samples, %.0f %% of the outline%s\n", i,
               m->paths[i].count, 100 * (double)m->paths[i].outline_share,
               m->paths[i].parent < 0 ? "" : ", a branch");
}

static void print_json(const settings *s, const cairn_shape_model *m,
                       const cairn_shape_image *traced)
{
    cairn_json_writer json = cairn_json_write_begin(stdout);

    cairn_json_write_text(&json, "shape", s->shape);
    cairn_json_write_text(&json, "model", s->output);
    if (s->grab != NULL)
        cairn_json_write_text(&json, "silhouette", s->silhouette);
    else
        cairn_json_write_null(&json, "silhouette");
    if (traced->count > 0) {
        cairn_json_write_object(&json, "picture");
        cairn_json_write_text(&json, "kind", traced->is_drawing ? "drawing" : "silhouette");
        cairn_json_write_integer(&json, "outlines", traced->count);
        cairn_json_write_integer(&json, "holes", traced->holes);
        cairn_json_write_integer(&json, "joined_gaps", traced->bridged_gaps);
        cairn_json_write_integer(&json, "specks", traced->dropped_regions);
        cairn_json_write_object_end(&json);
    } else {
        cairn_json_write_null(&json, "picture");
    }
    cairn_json_write_number(&json, "size_px", (double)m->size);
    cairn_json_write_integer(&json, "outline_samples", m->outline_count);
    cairn_json_write_integer(&json, "path_samples", m->sample_count);
    cairn_json_write_array(&json, "paths");
    for (int32_t i = 0; i < m->path_count; i++) {
        cairn_json_write_object(&json, NULL);
        cairn_json_write_integer(&json, "samples", m->paths[i].count);
        cairn_json_write_number(&json, "outline_share", (double)m->paths[i].outline_share);
        cairn_json_write_integer(&json, "parent", m->paths[i].parent);
        cairn_json_write_object_end(&json);
    }
    cairn_json_write_array_end(&json);
    cairn_json_write_end(&json);
}

static cairn_status draw_parts(const settings *s, const cairn_shape_model *model,
                               cairn_file_error *error)
{
    cairn_part_bundle_cut cut[CAIRN_PART_MAX_FRAGMENTS];
    int32_t count = 0;
    cairn_status status =
        s->cuts == NULL ? CAIRN_OK : cairn_part_cut_file_read(cut, &count, s->cuts, error);

    if (status != CAIRN_OK)
        return status;
    return cairn_shape_model_file_draw_parts(model, s->cuts != NULL ? cut : NULL, count,
                                             cairn_output_path_name(s->shape), s->parts, error);
}

int tool_model(int argc, char **argv)
{
    settings s = {.holes = "keep",
                  .points = 128,
                  .samples = 32,
                  .paths = CAIRN_SHAPE_MODEL_MAX_PATHS,
                  .side = CAIRN_SHAPE_IMAGE_MAX_SIDE,
                  .gap = 0.1,
                  .part = 0.01};
    option_result result = read_settings(&s, argc, argv);
    cairn_shape_model_file file;
    cairn_shape_image traced;
    cairn_file_error error;
    cairn_status status;

    if (result != OPTIONS_READ)
        return (int)result;
    if (load(&s, &file, &traced, &error) != CAIRN_OK)
        return tool_report(&error);
    if (s.mirror)
        cairn_shape_model_file_mirror(&file);
    status = s.picture == NULL
                 ? CAIRN_OK
                 : cairn_shape_model_file_draw(&file.model, cairn_output_path_name(s.shape),
                                               s.picture, &error);
    if (status == CAIRN_OK && s.parts != NULL)
        status = draw_parts(&s, &file.model, &error);
    if (status == CAIRN_OK)
        status = cairn_shape_model_file_write(&file.model, s.output, &error);
    if (status == CAIRN_OK && s.json)
        print_json(&s, &file.model, &traced);
    else if (status == CAIRN_OK && !s.quiet)
        print_summary(&s, &file.model, &traced);
    cairn_shape_model_file_free(&file);
    return status == CAIRN_OK ? TOOL_OK : tool_report(&error);
}
