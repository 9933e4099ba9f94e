/* Drawing of the fragments of a model's outline by part bundles (Adluru 2008, fig. 5.4). */
#include "src/base/build.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "cairn/output.h"
#include "cairn/part_bundle.h"
#include "cairn/shape_model_file.h"
#include "src/host/base/interruption.h"
#include "src/host/pictures/report_text.h"

#define CELL_SIDE_PX                                                                               \
    120.0 /* px: side of a fragment's cell; MODEL_SIZE_PX: the model's size in it */
#define MODEL_SIZE_PX 100.0

static const char *const colours[CAIRN_PART_MAX_BUNDLES] = {
    "#2563eb", "#ea580c", "#16a34a", "#dc2626", "#7c3aed", "#0891b2", "#ca8a04", "#475569"};

/* The drawing: one column of cells for each bundle. */
typedef struct parts_drawing {
    const cairn_shape_model *model;
    const cairn_part_bundle_cut *cuts; /* manual fragments; NULL: those of part_bundle */
    int32_t cut_count;
    int32_t outline; /* samples of the first outline; other outlines have no fragments */
    cairn_part_bundle_model parts;
    double head_height; /* px */
} parts_drawing;

/* Prints the outline from one sample to another, in order around the outline. */
static void print_arc(cairn_output *output, const parts_drawing *drawing, int32_t from, int32_t to,
                      double x, double y)
{
    int32_t i = from, is_first = 1;

    do {
        cairn_vec2 point = drawing->model->outline[i].position;

        cairn_output_print(output, "%s%.1f %.1f", is_first ? "M" : "L",
                           x + MODEL_SIZE_PX * (double)point.x,
                           y + MODEL_SIZE_PX * (double)point.y);
        is_first = 0;
        if (i == to)
            return;
        i = (i + 1) % drawing->outline;
    } while (i != from);
}

static void print_fragment(cairn_output *output, const parts_drawing *drawing,
                           const cairn_part_bundle_fragment *fragment, int32_t row)
{
    double x = CAIRN_REPORT_MARGIN + CELL_SIDE_PX * (fragment->bundle + 0.5),
           y = drawing->head_height + CELL_SIDE_PX * (row + 0.5);

    cairn_output_print(output, "<path class=\"outline\" d=\"");
    print_arc(output, drawing, 0, -1, x, y);
    cairn_output_print(output, "Z\"/>\n<path class=\"fragment\" stroke=\"%s\" d=\"",
                       colours[fragment->bundle]);
    print_arc(output, drawing, fragment->from, fragment->to, x, y);
    cairn_output_print(output, "\"/>\n");
}

/* Returns the fragments of the largest bundle. */
static int32_t count_rows(const cairn_part_bundle_model *parts)
{
    int32_t rows[CAIRN_PART_MAX_BUNDLES] = {0}, largest = 0;

    for (int32_t i = 0; i < parts->fragment_count; i++) {
        rows[parts->fragments[i].bundle]++;
        largest =
            rows[parts->fragments[i].bundle] > largest ? rows[parts->fragments[i].bundle] : largest;
    }
    return largest;
}

static cairn_status print_drawing(parts_drawing *drawing, const char *title, const char *path,
                                  cairn_file_error *error)
{
    int32_t row[CAIRN_PART_MAX_BUNDLES] = {0};
    char subtitle[128];
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    (void)snprintf(subtitle, sizeof subtitle,
                   "%d fragments in %d bundles; an image has at most one of each bundle",
                   (int)drawing->parts.fragment_count, (int)drawing->parts.bundle_count);
    drawing->head_height = cairn_report_head_height(title, subtitle) + CAIRN_REPORT_MARGIN;
    cairn_report_print_head(
        output, 2 * CAIRN_REPORT_MARGIN + CELL_SIDE_PX * fmax(5, drawing->parts.bundle_count),
        drawing->head_height + CELL_SIDE_PX * count_rows(&drawing->parts) + CAIRN_REPORT_MARGIN,
        title, subtitle);
    cairn_output_print(
        output,
        "<style>path{fill:none}.outline{stroke:#cbd5e1}.fragment{stroke-width:3;stroke-linecap:"
        "round}</style>\n");
    for (int32_t i = 0; i < drawing->parts.fragment_count; i++)
        print_fragment(output, drawing, &drawing->parts.fragments[i],
                       row[drawing->parts.fragments[i].bundle]++);
    cairn_output_print(output, "</svg>\n");
    return cairn_output_commit(output, error);
}

/* Computes the fragments in the given memory. */
static cairn_status find_parts(parts_drawing *drawing, void *memory, size_t bytes,
                               const cairn_part_bundle_params *params, cairn_vec2 *points)
{
    cairn_part_bundle_builder *builder;
    cairn_budget budget;
    cairn_pool pool;
    cairn_status status = cairn_pool_init(&pool, memory, bytes);

    for (int32_t i = 0; i < drawing->outline; i++)
        points[i] = drawing->model->outline[i].position;
    if (status == CAIRN_OK)
        status = cairn_part_bundle_create(&builder, &pool, params);
    if (status == CAIRN_OK)
        status = cairn_part_bundle_begin(builder, points, drawing->outline, drawing->cuts,
                                         drawing->cut_count);
    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_INTERRUPTION_UNITS;
        status = cairn_part_bundle_step(builder, &budget);
    } while (status == CAIRN_MORE && !cairn_interruption_is_requested());
    drawing->parts = cairn_part_bundle_read(builder);
    return status;
}

cairn_status cairn_shape_model_file_draw_parts(const cairn_shape_model *model,
                                               const cairn_part_bundle_cut *cuts, int32_t cut_count,
                                               const char *title, const char *path,
                                               cairn_file_error *error)
{
    cairn_fault fault = {-1, NULL};
    cairn_status status = cairn_shape_model_check(model, &fault);
    cairn_part_bundle_params params = cairn_part_bundle_default();
    parts_drawing drawing = {.model = model, .cuts = cuts, .cut_count = cut_count};
    cairn_vec2 *points;
    size_t bytes;
    void *memory;

    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, path, 0, "%s", fault.message);
    drawing.outline = cairn_shape_model_first_outline(model);
    if (drawing.outline < 3)
        return cairn_file_error_set(
            error, CAIRN_EMPTY, path, 0,
            "a model without an outline, expected one of 3 samples at least");
    params.max_points = drawing.outline;
    bytes = cairn_part_bundle_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    points = malloc((size_t)drawing.outline * sizeof *points);
    status = memory != NULL && points != NULL ? find_parts(&drawing, memory, bytes, &params, points)
                                              : CAIRN_NO_MEMORY;
    if (status == CAIRN_OK)
        status = print_drawing(&drawing, title, path, error);
    else
        status = cairn_file_error_set(
            error, status, path, 0, "%s, expected %s", cairn_status_text(status),
            cuts != NULL ? "manual fragments within a first outline of positive length"
                         : "an outline with length");
    free(memory);
    free(points);
    return status;
}
