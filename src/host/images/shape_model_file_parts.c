/* Drawing of the fragments of a model's outline by part bundles (Adluru 2008, fig. 5.4). */
#include "src/base/build.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "cairn/output.h"
#include "cairn/shape_model_file.h"
#include "src/host/base/interruption.h"
#include "src/host/images/shape_model_file_parts.h"
#include "src/host/pictures/report_text.h"

/* px: side of a fragment's cell, size of the model in it */
#define CELL_SIDE_PX  120.0
#define MODEL_SIZE_PX 100.0

/* The drawing: one column of cells for each bundle. */
typedef struct parts_drawing {
    const cairn_shape_model *model;
    cairn_shape_model_parts parts;
    double head_height; /* px */
} parts_drawing;

/* ---- Fragments ---- */

/* Computes the fragments in the memory of the parts. */
static cairn_status find_in(cairn_shape_model_parts *parts, size_t bytes,
                            const cairn_part_bundle_params *params, const cairn_vec2 *points,
                            const cairn_part_bundle_cut *cuts, int32_t cut_count)
{
    cairn_part_bundle_builder *builder;
    cairn_budget budget;
    cairn_pool pool;
    cairn_status status = cairn_pool_init(&pool, parts->memory, bytes);

    if (status == CAIRN_OK)
        status = cairn_part_bundle_create(&builder, &pool, params);
    if (status == CAIRN_OK)
        status = cairn_part_bundle_begin(builder, points, parts->outline, cuts, cut_count);
    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_INTERRUPTION_UNITS;
        status = cairn_part_bundle_step(builder, &budget);
    } while (status == CAIRN_MORE && !cairn_interruption_is_requested());
    parts->found = cairn_part_bundle_read(builder);
    return status;
}

cairn_status cairn_shape_model_parts_find(cairn_shape_model_parts *parts,
                                          const cairn_shape_model *model,
                                          const cairn_part_bundle_cut *cuts, int32_t cut_count)
{
    cairn_part_bundle_params params = cairn_part_bundle_default();
    cairn_status status = CAIRN_NO_MEMORY;
    cairn_vec2 *points;
    size_t bytes;

    parts->outline = cairn_shape_model_first_outline(model);
    if (parts->outline < 3)
        return CAIRN_EMPTY;
    params.max_points = parts->outline;
    bytes = cairn_part_bundle_memory(&params) + CAIRN_ALIGN;
    parts->memory = malloc(bytes);
    points = malloc((size_t)parts->outline * sizeof *points);
    if (parts->memory != NULL && points != NULL) {
        for (int32_t i = 0; i < parts->outline; i++)
            points[i] = model->outline[i].position;
        status = find_in(parts, bytes, &params, points, cuts, cut_count);
    }
    free(points);
    if (status != CAIRN_OK)
        cairn_shape_model_parts_free(parts);
    return status;
}

void cairn_shape_model_parts_free(cairn_shape_model_parts *parts)
{
    free(parts->memory);
    parts->memory = NULL;
}

/* ---- Drawing ---- */

const char *cairn_shape_model_parts_colour(int32_t bundle)
{
    static const char *const colours[CAIRN_PART_MAX_BUNDLES] = {
        "#2563eb", "#ea580c", "#16a34a", "#dc2626", "#7c3aed", "#0891b2", "#ca8a04", "#475569"};

    return colours[bundle];
}

/* Prints the outline from one sample to another, in order around the outline. */
static void print_arc(cairn_output *output, const cairn_shape_model_parts *parts,
                      const cairn_shape_model *model, int32_t from, int32_t to,
                      const cairn_shape_model_view *view)
{
    int32_t i = from, is_first = 1;

    do {
        cairn_vec2 point = model->outline[i].position;
        double x = view->mirrored ? -(double)point.x : (double)point.x;

        cairn_output_print(output, "%s%.2f %.2f", is_first ? "M" : "L", view->x + view->size * x,
                           view->y + view->size * (double)point.y);
        is_first = 0;
        if (i == to)
            return;
        i = (i + 1) % parts->outline;
    } while (i != from);
}

void cairn_shape_model_parts_print_outline(cairn_output *output,
                                           const cairn_shape_model_parts *parts,
                                           const cairn_shape_model *model,
                                           const cairn_shape_model_view *view)
{
    cairn_output_print(output, "<path class=\"outline\" d=\"");
    print_arc(output, parts, model, 0, -1, view);
    cairn_output_print(output, "Z\"/>\n");
}

void cairn_shape_model_parts_print_fragment(cairn_output *output,
                                            const cairn_shape_model_parts *parts,
                                            const cairn_shape_model *model, int32_t fragment,
                                            const cairn_shape_model_view *view)
{
    const cairn_part_bundle_fragment *f = &parts->found.fragments[fragment];

    cairn_output_print(output, "<path class=\"fragment\" stroke=\"%s\" d=\"",
                       cairn_shape_model_parts_colour(f->bundle));
    print_arc(output, parts, model, f->from, f->to, view);
    cairn_output_print(output, "\"/>\n");
}

/* Prints the cell of a fragment. */
static void print_cell(cairn_output *output, const parts_drawing *drawing, int32_t fragment,
                       int32_t row)
{
    cairn_shape_model_view view = {.x = CAIRN_REPORT_MARGIN +
                                        CELL_SIDE_PX *
                                            (drawing->parts.found.fragments[fragment].bundle + 0.5),
                                   .y = drawing->head_height + CELL_SIDE_PX * (row + 0.5),
                                   .size = MODEL_SIZE_PX};

    cairn_shape_model_parts_print_outline(output, &drawing->parts, drawing->model, &view);
    cairn_shape_model_parts_print_fragment(output, &drawing->parts, drawing->model, fragment,
                                           &view);
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
                   (int)drawing->parts.found.fragment_count,
                   (int)drawing->parts.found.bundle_count);
    drawing->head_height = cairn_report_head_height(title, subtitle) + CAIRN_REPORT_MARGIN;
    cairn_report_print_head(
        output, 2 * CAIRN_REPORT_MARGIN + CELL_SIDE_PX * fmax(5, drawing->parts.found.bundle_count),
        drawing->head_height + CELL_SIDE_PX * count_rows(&drawing->parts.found) +
            CAIRN_REPORT_MARGIN,
        title, subtitle);
    cairn_output_print(
        output,
        "<style>path{fill:none}.outline{stroke:#cbd5e1}.fragment{stroke-width:3;stroke-linecap:"
        "round}</style>\n");
    for (int32_t i = 0; i < drawing->parts.found.fragment_count; i++)
        print_cell(output, drawing, i, row[drawing->parts.found.fragments[i].bundle]++);
    cairn_output_print(output, "</svg>\n");
    return cairn_output_commit(output, error);
}

cairn_status cairn_shape_model_file_draw_parts(const cairn_shape_model *model,
                                               const cairn_part_bundle_cut *cuts, int32_t cut_count,
                                               const char *title, const char *path,
                                               cairn_file_error *error)
{
    cairn_fault fault = {-1, NULL};
    cairn_status status = cairn_shape_model_check(model, &fault);
    parts_drawing drawing = {.model = model};

    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, path, 0, "%s", fault.message);
    if (cairn_shape_model_first_outline(model) < 3)
        return cairn_file_error_set(
            error, CAIRN_EMPTY, path, 0,
            "a model without an outline, expected one of 3 samples at least");
    status = cairn_shape_model_parts_find(&drawing.parts, model, cuts, cut_count);
    if (status != CAIRN_OK)
        return cairn_file_error_set(
            error, status, path, 0, "%s, expected %s", cairn_status_text(status),
            cuts != NULL ? "manual fragments within a first outline of positive length"
                         : "an outline with length");
    status = print_drawing(&drawing, title, path, error);
    cairn_shape_model_parts_free(&drawing.parts);
    return status;
}
