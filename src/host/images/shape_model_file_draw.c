/* Drawing of a model: outline, axes, radii (Adluru 2008, fig. 2.7). */
#include "src/base/build.h"

#include <stdio.h>

#include "cairn/output.h"
#include "cairn/shape_model_file.h"
#include "src/host/pictures/report_text.h"

#define MODEL_SIZE_PX 760.0 /* px: the model's size */
/* px: height of the legend. */
#define LEGEND_HEIGHT 54.0
/* Samples farther apart than this multiple of the mean spacing belong to different outlines. */
#define MAX_SPACING_RATIO 3.0

/* Transformation from the model to the picture. */
typedef struct model_view {
    double left, top; /* px, of the model's origin */
} model_view;

static double x_of(const model_view *origin, cairn_vec2 point)
{
    return origin->left + MODEL_SIZE_PX * (double)point.x;
}

static double y_of(const model_view *origin, cairn_vec2 point)
{
    return origin->top + MODEL_SIZE_PX * (double)point.y;
}

/* Returns the bounding box of a model. */
static cairn_box box_of(const cairn_shape_model *model)
{
    cairn_box box = cairn_box_empty();

    for (int32_t i = 0; i < model->outline_count; i++)
        box = cairn_box_extend(box, model->outline[i].position);
    for (int32_t i = 0; i < model->sample_count; i++)
        box = cairn_box_extend(box, model->samples[i].centre);
    return box;
}

/* Prints the outlines, which are stored consecutively: a new one starts where the next sample is
 * far away. */
static void print_outline(cairn_output *output, const cairn_shape_model *model,
                          const model_view *origin)
{
    double mean = 0;

    for (int32_t i = 1; i < model->outline_count; i++)
        mean += (double)cairn_vec2_norm(
                    cairn_vec2_sub(model->outline[i].position, model->outline[i - 1].position)) /
                model->outline_count;
    cairn_output_print(output, "<path class=\"outline\" d=\"");
    for (int32_t i = 0; i < model->outline_count; i++) {
        cairn_vec2 point = model->outline[i].position;
        int starts = i == 0 || (double)cairn_vec2_norm(
                                   cairn_vec2_sub(point, model->outline[i - 1].position)) >
                                   MAX_SPACING_RATIO * mean;

        cairn_output_print(output, "%s%s%.1f %.1f", starts && i > 0 ? "Z" : "", starts ? "M" : "L",
                           x_of(origin, point), y_of(origin, point));
    }
    cairn_output_print(output, "Z\"/>\n");
}

/* Prints the radii to one side and their contact points. */
static void print_radii(cairn_output *output, const cairn_shape_model *model,
                        const model_view *origin, int32_t side)
{
    cairn_output_print(output, "<path class=\"%s\" d=\"", side == 0 ? "left" : "right");
    for (int32_t i = 0; i < model->sample_count; i++)
        cairn_output_print(output, "M%.1f %.1fL%.1f %.1f", x_of(origin, model->samples[i].centre),
                           y_of(origin, model->samples[i].centre),
                           x_of(origin, model->samples[i].contact[side].position),
                           y_of(origin, model->samples[i].contact[side].position));
    cairn_output_print(output, "\"/>\n");
    for (int32_t i = 0; i < model->sample_count; i++)
        cairn_output_print(output, "<circle class=\"%s\" cx=\"%.1f\" cy=\"%.1f\" r=\"3\"/>\n",
                           side == 0 ? "at-left" : "at-right",
                           x_of(origin, model->samples[i].contact[side].position),
                           y_of(origin, model->samples[i].contact[side].position));
}

/* Prints the axes of all paths. */
static void print_axes(cairn_output *output, const cairn_shape_model *model,
                       const model_view *origin)
{
    for (int32_t i = 0; i < model->path_count; i++) {
        const cairn_shape_model_path *path = &model->paths[i];

        cairn_output_print(output, "<path class=\"axis\" d=\"");
        for (int32_t k = 0; k < path->count; k++)
            cairn_output_print(output, "%s%.1f %.1f", k == 0 ? "M" : "L",
                               x_of(origin, model->samples[path->first + k].centre),
                               y_of(origin, model->samples[path->first + k].centre));
        cairn_output_print(output, "\"/>\n");
        cairn_output_print(output, "<circle class=\"start\" cx=\"%.1f\" cy=\"%.1f\" r=\"5\"/>\n",
                           x_of(origin, model->samples[path->first].centre),
                           y_of(origin, model->samples[path->first].centre));
    }
}

cairn_status cairn_shape_model_file_draw(const cairn_shape_model *model, const char *title,
                                         const char *path, cairn_file_error *error)
{
    static const cairn_report_key keys[] = {{"outline", "stroke=\"#0f172a\""},
                                            {"axis, starting at its dot", "stroke=\"#dc2626\""},
                                            {"left side", "stroke=\"#2563eb\""},
                                            {"right side", "stroke=\"#d97706\""}};
    cairn_fault fault = {-1, NULL};
    cairn_status status = cairn_shape_model_check(model, &fault);
    char subtitle[128];
    cairn_output *output;
    cairn_box box;
    double width, height, head;
    model_view origin;

    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, path, 0, "%s", fault.message);
    (void)snprintf(subtitle, sizeof subtitle, "%d paths, %d samples, %d of the outline",
                   (int)model->path_count, (int)model->sample_count, (int)model->outline_count);
    box = box_of(model);
    head = cairn_report_head_height(title, subtitle);
    origin.left = CAIRN_REPORT_MARGIN - MODEL_SIZE_PX * (double)box.min.x;
    origin.top = head + CAIRN_REPORT_MARGIN - MODEL_SIZE_PX * (double)box.min.y;
    width = fmax(800, 2 * CAIRN_REPORT_MARGIN + MODEL_SIZE_PX * (double)(box.max.x - box.min.x));
    height = head + 2 * CAIRN_REPORT_MARGIN + MODEL_SIZE_PX * (double)(box.max.y - box.min.y) +
             LEGEND_HEIGHT;
    status = cairn_output_open(&output, path, error);
    if (status != CAIRN_OK)
        return status;
    cairn_report_print_head(output, width, height, title, subtitle);
    cairn_output_print(
        output, "<style>path{fill:none}.outline{stroke:#0f172a;stroke-width:2;fill:#e8edf3}"
                ".axis{stroke:#dc2626;stroke-width:3}.start{fill:#dc2626}.left{stroke:#2563eb}"
                ".right{stroke:#d97706}.at-left{fill:#2563eb}.at-right{fill:#d97706}</style>\n");
    print_outline(output, model, &origin);
    print_radii(output, model, &origin, 0);
    print_radii(output, model, &origin, 1);
    print_axes(output, model, &origin);
    cairn_report_print_keys(output, height - CAIRN_REPORT_MARGIN, 180, keys,
                            sizeof keys / sizeof *keys);
    cairn_output_print(output, "</svg>\n");
    return cairn_output_commit(output, error);
}
