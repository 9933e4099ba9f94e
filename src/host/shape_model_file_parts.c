/* The fragments of a model's outline, bundle by bundle (Adluru 2008, fig. 5.4). */
#include "src/core/build.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "cairn/output.h"
#include "cairn/part_bundle.h"
#include "cairn/shape_model_file.h"
#include "src/host/report_text.h"

#define CELL 120.0 /* px, of a fragment's picture: the model's size and what is free about it */
#define SIZE 100.0

static const char *const colours[CAIRN_PART_BUNDLES] = {"#2563eb", "#ea580c", "#16a34a", "#dc2626",
                                                        "#7c3aed", "#0891b2", "#ca8a04", "#475569"};

typedef struct sheet {
    const cairn_shape_model *model;
    const cairn_part_cut *cuts; /* NULL: by rule */
    int32_t cut_count;
    int32_t outline; /* samples of the first outline, which alone has fragments */
    cairn_part_model parts;
    double head;
} sheet;

/* Samples from one on to another, round the outline. */
static void print_arc(cairn_output *output, const sheet *s, int32_t from, int32_t to, double x,
                      double y)
{
    int32_t i = from, begins = 1;

    do {
        cairn_vec2 p = s->model->outline[i].position;

        cairn_output_print(output, "%s%.1f %.1f", begins ? "M" : "L", x + SIZE * (double)p.x,
                           y + SIZE * (double)p.y);
        begins = 0;
        if (i == to)
            return;
        i = (i + 1) % s->outline;
    } while (i != from);
}

static void print_fragment(cairn_output *output, const sheet *s, const cairn_part_fragment *f,
                           int32_t row)
{
    double x = CAIRN_REPORT_MARGIN + CELL * (f->bundle + 0.5), y = s->head + CELL * (row + 0.5);

    cairn_output_print(output, "<path class=\"outline\" d=\"");
    print_arc(output, s, 0, -1, x, y);
    cairn_output_print(output, "Z\"/>\n<path class=\"fragment\" stroke=\"%s\" d=\"",
                       colours[f->bundle]);
    print_arc(output, s, f->from, f->to, x, y);
    cairn_output_print(output, "\"/>\n");
}

static int32_t most_rows(const cairn_part_model *m)
{
    int32_t rows[CAIRN_PART_BUNDLES] = {0}, most = 0;

    for (int32_t i = 0; i < m->fragment_count; i++) {
        rows[m->fragments[i].bundle]++;
        most = rows[m->fragments[i].bundle] > most ? rows[m->fragments[i].bundle] : most;
    }
    return most;
}

static cairn_status print_sheet(sheet *s, const char *title, const char *path,
                                cairn_file_error *error)
{
    int32_t row[CAIRN_PART_BUNDLES] = {0};
    char subtitle[128];
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    (void)snprintf(subtitle, sizeof subtitle,
                   "%d fragments in %d bundles, of each of which one is in an image at most",
                   (int)s->parts.fragment_count, (int)s->parts.bundles);
    s->head = cairn_report_head_height(title, subtitle) + CAIRN_REPORT_MARGIN;
    cairn_report_print_head(output, 2 * CAIRN_REPORT_MARGIN + CELL * fmax(5, s->parts.bundles),
                            s->head + CELL * most_rows(&s->parts) + CAIRN_REPORT_MARGIN, title,
                            subtitle);
    cairn_output_print(
        output,
        "<style>path{fill:none}.outline{stroke:#cbd5e1}.fragment{stroke-width:3;stroke-linecap:"
        "round}</style>\n");
    for (int32_t i = 0; i < s->parts.fragment_count; i++)
        print_fragment(output, s, &s->parts.fragments[i], row[s->parts.fragments[i].bundle]++);
    cairn_output_print(output, "</svg>\n");
    return cairn_output_commit(output, error);
}

/* The fragments, in memory that the builder stands in. */
static cairn_status find_parts(sheet *s, void *memory, size_t bytes,
                               const cairn_part_bundle_params *params, cairn_vec2 *points)
{
    cairn_part_builder *builder;
    cairn_budget budget;
    cairn_pool pool;
    cairn_status status = cairn_pool_init(&pool, memory, bytes);

    for (int32_t i = 0; i < s->outline; i++)
        points[i] = s->model->outline[i].position;
    if (status == CAIRN_OK)
        status = cairn_part_bundle_create(&builder, &pool, params);
    if (status == CAIRN_OK)
        status = cairn_part_bundle_begin(builder, points, s->outline, s->cuts, s->cut_count);
    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = INT32_MAX;
        status = cairn_part_bundle_step(builder, &budget);
    } while (status == CAIRN_MORE);
    s->parts = cairn_part_bundle_read(builder);
    return status;
}

cairn_status cairn_shape_model_file_draw_parts(const cairn_shape_model *model,
                                               const cairn_part_cut *cuts, int32_t cut_count,
                                               const char *title, const char *path,
                                               cairn_file_error *error)
{
    cairn_fault fault = {-1, NULL};
    cairn_status status = cairn_shape_model_check(model, &fault);
    cairn_part_bundle_params params = cairn_part_bundle_default();
    sheet s = {.model = model, .cuts = cuts, .cut_count = cut_count};
    cairn_vec2 *points;
    size_t bytes;
    void *memory;

    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, path, 0, "%s", fault.what);
    s.outline = cairn_shape_first_outline(model);
    if (s.outline < 3)
        return cairn_file_error_set(
            error, CAIRN_EMPTY, path, 0,
            "a model without an outline, expected one of 3 samples at least");
    params.max_points = s.outline;
    bytes = cairn_part_bundle_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    points = malloc((size_t)s.outline * sizeof *points);
    status = memory != NULL && points != NULL ? find_parts(&s, memory, bytes, &params, points)
                                              : CAIRN_NO_MEMORY;
    if (status == CAIRN_OK)
        status = print_sheet(&s, title, path, error);
    else
        status = cairn_file_error_set(
            error, status, path, 0, "%s, expected %s", cairn_status_text(status),
            cuts != NULL ? "fragments by hand of the first outline, which has a length"
                         : "an outline with length");
    free(memory);
    free(points);
    return status;
}
