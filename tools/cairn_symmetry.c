/* cairn symmetry: the axes of self-similarity of shapes, from pictures of them. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/output.h"
#include "cairn/output_set.h"
#include "cairn/vision.h"
#include "src/host/images/image_capacity.h"
#include "tools/cairn_symmetry.h"
#include "tools/cairn_picture.h"
#include "tools/cairn_tool.h"

#define PROGRAM "cairn symmetry"

enum { MAX_SHAPES = 1024 };

static const char sheet_name[] = "sheet.svg";

typedef struct settings {
    const char *shapes[MAX_SHAPES];
    size_t count;
    const char *folder, *mode, *holes;
    int64_t points, side;
    double gap, part;
    int32_t as_written, sheet, json, quiet;
} settings;

static option_result read_settings(settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_TEXT("-o", &s->folder, "DIR",
                    "folder to write NAME.svg and NAME.json to, for each shape NAME.*"),
        OPTION_FLAG("--as-written", &s->as_written,
                    "the method of the thesis: cuts only at critical points, minimum sum of costs"),
        OPTION_TEXT("--mode", &s->mode, "NAME", "re-ranked, or as-written, which is --as-written"),
        OPTION_INTEGER("--points", &s->points, 16, SYMMETRY_MAX_POINTS, "N",
                       "samples of the outline"),
        OPTION_TEXT("--holes", &s->holes, "NAME", "holes: keep as background, fill, or refuse"),
        OPTION_NUMBER(
            "--gap", &s->gap, 0, 1, "SHARE",
            "maximum gap between line ends that is closed, fraction of the drawing's diagonal"),
        OPTION_NUMBER("--part", &s->part, 0, 1, "SHARE",
                      "minimum area of a part, fraction of the largest one"),
        OPTION_INTEGER("--max-side", &s->side, 16, CAIRN_SHAPE_IMAGE_MAX_SIDE, "PX",
                       "larger pictures are halved until they fit"),
        OPTION_FLAG("--sheet", &s->sheet, "also sheet.svg, all shapes side by side"),
        OPTION_JSON(&s->json),
        OPTION_FLAG("--quiet", &s->quiet, "no summary"),
    };
    const option_set set = {PROGRAM, "SHAPE... -o DIR [options]",
                            "Finds the axes that divide a shape into two most similar parts, from "
                            "pictures of one object each "
                            "(silhouettes or drawings; " TOOL_IMAGES "): of mirror symmetry, "
                            "also of shapes that are "
                            "skewed, bent, noisy, or articulated. Of an object of "
                            "several parts the largest is taken.",
                            table, sizeof table / sizeof *table};
    option_result result;

    s->count = MAX_SHAPES;
    result = options_read(&set, argc, argv, s->shapes, &s->count);
    if (result != OPTIONS_READ)
        return result;
    if (s->count < 1 || s->folder == NULL)
        return (option_result)options_refuse(
            PROGRAM, "%s, expected %s", s->count < 1 ? "no picture" : "no folder to write to (-o)",
            set.synopsis);
    if (s->mode != NULL && strcmp(s->mode, "re-ranked") != 0 && strcmp(s->mode, "as-written") != 0)
        return (option_result)options_refuse(PROGRAM, "--mode %s, expected re-ranked or as-written",
                                             s->mode);
    if (s->as_written && s->mode != NULL && strcmp(s->mode, "as-written") != 0)
        return (option_result)options_refuse(
            PROGRAM, "--mode %s with --as-written, which is another method, expected one of them",
            s->mode);
    s->as_written |= s->mode != NULL && strcmp(s->mode, "as-written") == 0;
    if (strcmp(s->holes, "keep") != 0 && strcmp(s->holes, "fill") != 0 &&
        strcmp(s->holes, "refuse") != 0)
        return (option_result)options_refuse(PROGRAM, "--holes %s, expected keep, fill or refuse",
                                             s->holes);
    return OPTIONS_READ;
}

/* "folder/horse-1.png" -> "horse-1"; Returns 0 when there is no such name. */
static int stem_of(const char *path, char stem[SYMMETRY_NAME_BYTES])
{
    const char *name = cairn_output_path_name(path), *dot = strrchr(name, '.');
    size_t length = dot != NULL && dot > name ? (size_t)(dot - name) : strlen(name);

    if (length < 1 || length >= SYMMETRY_NAME_BYTES)
        return 0;
    memcpy(stem, name, length);
    stem[length] = '\0';
    return 1;
}

/* Rejects shapes whose output files would overwrite each other. */
static int check_names(const settings *s, symmetry_found *found)
{
    for (size_t i = 0; i < s->count; i++) {
        found[i].path = s->shapes[i];
        if (!stem_of(s->shapes[i], found[i].stem))
            return options_refuse(PROGRAM, "'%s', expected the name of a picture", s->shapes[i]);
        for (size_t k = 0; k < i; k++)
            if (strcmp(found[i].stem, found[k].stem) == 0)
                return options_refuse(PROGRAM,
                                      "%s and %s are both named '%s', expected different names",
                                      s->shapes[k], s->shapes[i], found[i].stem);
        if (s->sheet && strcmp(found[i].stem, "sheet") == 0)
            return options_refuse(PROGRAM, "%s with --sheet, expected another name", s->shapes[i]);
    }
    return TOOL_OK;
}

/* Traces the outlines of the object: its largest part and the holes in it. */
static cairn_status read_shape(const settings *s, symmetry_found *f, cairn_file_error *error)
{
    cairn_shape_image_params params = cairn_shape_image_default();
    cairn_vision_image grey;
    cairn_raster_u8_view view;
    cairn_status status = cairn_vision_read_grey(&grey, f->path, error);

    if (status != CAIRN_OK)
        return status;
    params.holes = s->holes[0] == 'k'   ? CAIRN_SHAPE_IMAGE_HOLES_KEEP
                   : s->holes[0] == 'f' ? CAIRN_SHAPE_IMAGE_HOLES_FILL
                                        : CAIRN_SHAPE_IMAGE_HOLES_REFUSE;
    params.max_gap = s->gap;
    params.min_part = s->part;
    params.max_side = (int32_t)s->side;
    view = (cairn_raster_u8_view){grey.samples, grey.width, grey.height, grey.width};
    status = cairn_shape_image_trace(&f->image, view, &params, f->path, error);
    cairn_vision_free(&grey);
    if (status != CAIRN_OK)
        return status;
    f->parts = f->image.count - f->image.holes;
    f->shape[0] = f->image.outlines[0];
    for (int32_t i = f->parts; i < f->image.count; i++)
        if (cairn_polygon_contains(f->shape[0].points, f->shape[0].count,
                                   f->image.outlines[i].points[0]))
            f->shape[1 + f->holes++] = f->image.outlines[i];
    return CAIRN_OK;
}

static cairn_status find_axes(cairn_self_similarity *similarity, symmetry_found *f,
                              cairn_file_error *error)
{
    cairn_status status = cairn_self_similarity_begin(similarity, f->shape, 1 + f->holes);

    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, f->path, 0,
                                    "no outline with an area, expected an object");
    do {
        cairn_budget budget = {INT32_MAX};

        status = cairn_self_similarity_step(similarity, &budget);
    } while (status == CAIRN_MORE);
    f->result = cairn_self_similarity_read(similarity);
    memcpy(f->axes, f->result.axes, (size_t)f->result.count * sizeof f->axes[0]);
    memcpy(f->samples, f->result.samples, (size_t)f->result.sample_count * sizeof f->samples[0]);
    f->result.axes = f->axes;
    f->result.samples = f->samples;
    return CAIRN_OK;
}

static void print_summary(const symmetry_found *f, double seconds)
{
    const cairn_self_similarity_result *r = &f->result;
    const cairn_self_similarity_axis *a = r->axes;

    printf("%s: %s", f->path, symmetry_verdict_name(r->verdict));
    if (r->verdict != CAIRN_SELF_SIMILARITY_SINGLE)
        printf(" (%" PRId32 " as good as the best)", r->tie_count);
    if (r->rotation_order != 1)
        printf(r->rotation_order == 0 ? ", the same after any turn"
                                      : ", the same after a turn by 1/%" PRId32,
               r->rotation_order);
    if (f->parts > 1)
        printf(", the largest of %" PRId32 " parts", f->parts);
    printf("; %.3f s\n", seconds);
    if (r->count > 0)
        printf("  %.4f  from (%.1f, %.1f) to (%.1f, %.1f), bend %.0f degrees, skew %.2f\n",
               (double)a->dissimilarity, (double)a->end[0].x, (double)a->end[0].y,
               (double)a->end[1].x, (double)a->end[1].y, 57.29577951308232 * (double)a->bend,
               (double)a->skew);
}

static void write_json(cairn_json_writer *json, const symmetry_found *f, double seconds)
{
    const cairn_self_similarity_result *r = &f->result;

    cairn_json_write_object(json, NULL);
    cairn_json_write_text(json, "shape", f->path);
    cairn_json_write_text(json, "verdict", symmetry_verdict_name(r->verdict));
    cairn_json_write_integer(json, "ties", r->tie_count);
    cairn_json_write_integer(json, "rotations", r->rotation_order);
    cairn_json_write_integer(json, "parts", f->parts);
    cairn_json_write_array(json, "axes");
    for (int32_t i = 0; i < r->count; i++) {
        const cairn_self_similarity_axis *a = &r->axes[i];
        const cairn_real ends[4] = {a->end[0].x, a->end[0].y, a->end[1].x, a->end[1].y};

        cairn_json_write_object(json, NULL);
        cairn_json_write_number(json, "dissimilarity", (double)a->dissimilarity);
        cairn_json_write_numbers(json, "ends_px", ends, 4);
        cairn_json_write_number(json, "bend_deg", 57.29577951308232 * (double)a->bend);
        cairn_json_write_number(json, "skew", (double)a->skew);
        cairn_json_write_object_end(json);
    }
    cairn_json_write_array_end(json);
    cairn_json_write_number(json, "seconds", seconds);
    cairn_json_write_object_end(json);
}

static cairn_status write_shape(const settings *s, const symmetry_found *f, cairn_file_error *error)
{
    char name[2][SYMMETRY_NAME_BYTES + 8];
    const char *names[2] = {name[0], name[1]};
    cairn_output_set *set;
    cairn_status status;

    (void)snprintf(name[0], sizeof name[0], "%s.svg", f->stem);
    (void)snprintf(name[1], sizeof name[1], "%s.json", f->stem);
    status = cairn_output_set_open(&set, s->folder, names, 2, error);
    if (status != CAIRN_OK)
        return status;
    if (!s->sheet && strcmp(f->stem, "sheet") != 0)
        status = picture_remove_unless_of_image(set, s->folder, sheet_name, error);
    if (status == CAIRN_OK)
        status = symmetry_draw(f, cairn_output_set_path(set, 0), error);
    if (status == CAIRN_OK)
        status = symmetry_write(f, cairn_output_set_path(set, 1), error);
    if (status == CAIRN_OK)
        return cairn_output_set_commit(set, error);
    cairn_output_set_discard(set);
    return status;
}

static cairn_status write_sheet(const settings *s, const symmetry_found *found,
                                cairn_file_error *error)
{
    char *path = cairn_output_path_join(s->folder, sheet_name);
    cairn_status status;

    if (path == NULL)
        return cairn_file_error_set(error, CAIRN_NO_MEMORY, s->folder, 0,
                                    "no memory for the sheet");
    status = symmetry_draw_sheet(found, (int32_t)s->count, path, error);
    free(path);
    return status;
}

static cairn_status run(const settings *s, cairn_self_similarity *similarity, int32_t mode,
                        symmetry_found *found, cairn_json_writer *json, cairn_file_error *error)
{
    cairn_status status = CAIRN_OK;

    cairn_json_write_text(json, "folder", s->folder);
    cairn_json_write_text(json, "mode", symmetry_mode_name(mode));
    cairn_json_write_array(json, "shapes");

    for (size_t i = 0; i < s->count && status == CAIRN_OK; i++) {
        double start = tool_seconds();

        found[i].mode = mode;
        status = read_shape(s, &found[i], error);
        if (status == CAIRN_OK)
            status = find_axes(similarity, &found[i], error);
        if (status == CAIRN_OK)
            status = write_shape(s, &found[i], error);
        if (status == CAIRN_OK && s->json)
            write_json(json, &found[i], tool_seconds() - start);
        else if (status == CAIRN_OK && !s->quiet)
            print_summary(&found[i], tool_seconds() - start);
    }
    cairn_json_write_array_end(json);
    return status == CAIRN_OK && s->sheet ? write_sheet(s, found, error) : status;
}

int tool_symmetry(int argc, char **argv)
{
    static settings s;
    cairn_self_similarity_params params = cairn_self_similarity_default();
    cairn_shape_image_params image = cairn_shape_image_default();
    cairn_self_similarity *similarity;
    cairn_status status = CAIRN_OK;
    cairn_file_error error;
    symmetry_found *found;
    option_result result;
    cairn_pool pool;
    tool_json json;
    int code;

    memset(&s, 0, sizeof s);
    s.holes = "keep";
    s.points = params.outline_samples;
    s.gap = image.max_gap;
    s.side = image.max_side;
    s.part = image.min_part;
    result = read_settings(&s, argc, argv);
    if (result != OPTIONS_READ)
        return (int)result;
    params = cairn_image_capacity_self_similarity((int32_t)s.points, s.as_written);
    found = calloc(s.count, sizeof *found);
    if (found == NULL)
        return options_refuse(PROGRAM, "no memory for %zu shapes", s.count), TOOL_FAILED;
    code = check_names(&s, found);
    if (code == TOOL_OK)
        code = tool_pool_open(&pool, PROGRAM, NULL, cairn_self_similarity_memory(&params));
    if (code == TOOL_OK) {
        code = tool_json_open(&json, PROGRAM);
        if (code == TOOL_OK) {
            status = cairn_self_similarity_create(&similarity, &pool, &params);
            status = status == CAIRN_OK
                         ? run(&s, similarity, params.mode, found, &json.writer, &error)
                         : cairn_file_error_set(&error, status, PROGRAM, 0, "no memory");
            code = tool_json_close(&json, PROGRAM, s.json && status == CAIRN_OK, code);
        }
        tool_pool_close(&pool);
    }
    for (size_t i = 0; i < s.count; i++)
        cairn_shape_image_free(&found[i].image);
    free(found);
    return status != CAIRN_OK ? tool_report(&error) : code;
}
