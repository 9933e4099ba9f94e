/* A model as a picture: outline, axes, radii (Adluru 2008, fig. 2.7). */
#include "src/core/build.h"

#include <stdio.h>

#include "cairn/output.h"
#include "cairn/shape_model_file.h"
#include "src/host/report_text.h"

#define SCALE 760.0 /* pixels of the model's size */
#define FOOT  54.0
/* Neighbours of an outline are never so many times farther apart than its samples are in the
 * mean. */
#define APART 3.0

/* Where a point of the model is drawn. */
typedef struct view {
    double left, top; /* of the model's origin */
} view;

static double x_of(const view *v, cairn_vec2 p)
{
    return v->left + SCALE * (double)p.x;
}

static double y_of(const view *v, cairn_vec2 p)
{
    return v->top + SCALE * (double)p.y;
}

static cairn_box box_of(const cairn_shape_model *m)
{
    cairn_box box = cairn_box_empty();

    for (int32_t i = 0; i < m->outline_count; i++)
        box = cairn_box_extend(box, m->outline[i].position);
    for (int32_t i = 0; i < m->sample_count; i++)
        box = cairn_box_extend(box, m->samples[i].centre);
    return box;
}

/* Outlines lie one after another: a new one begins where the next sample is far. */
static void print_outline(cairn_output *output, const cairn_shape_model *m, const view *v)
{
    double mean = 0;

    for (int32_t i = 1; i < m->outline_count; i++)
        mean += (double)cairn_vec2_norm(
                    cairn_vec2_sub(m->outline[i].position, m->outline[i - 1].position)) /
                m->outline_count;
    cairn_output_print(output, "<path class=\"outline\" d=\"");
    for (int32_t i = 0; i < m->outline_count; i++) {
        cairn_vec2 p = m->outline[i].position;
        int begins = i == 0 || (double)cairn_vec2_norm(
                                   cairn_vec2_sub(p, m->outline[i - 1].position)) > APART * mean;

        cairn_output_print(output, "%s%s%.1f %.1f", begins && i > 0 ? "Z" : "", begins ? "M" : "L",
                           x_of(v, p), y_of(v, p));
    }
    cairn_output_print(output, "Z\"/>\n");
}

static void print_radii(cairn_output *output, const cairn_shape_model *m, const view *v,
                        int32_t side)
{
    cairn_output_print(output, "<path class=\"%s\" d=\"", side == 0 ? "left" : "right");
    for (int32_t i = 0; i < m->sample_count; i++)
        cairn_output_print(output, "M%.1f %.1fL%.1f %.1f", x_of(v, m->samples[i].centre),
                           y_of(v, m->samples[i].centre),
                           x_of(v, m->samples[i].side[side].position),
                           y_of(v, m->samples[i].side[side].position));
    cairn_output_print(output, "\"/>\n");
    for (int32_t i = 0; i < m->sample_count; i++)
        cairn_output_print(output, "<circle class=\"%s\" cx=\"%.1f\" cy=\"%.1f\" r=\"3\"/>\n",
                           side == 0 ? "at-left" : "at-right",
                           x_of(v, m->samples[i].side[side].position),
                           y_of(v, m->samples[i].side[side].position));
}

static void print_axes(cairn_output *output, const cairn_shape_model *m, const view *v)
{
    for (int32_t i = 0; i < m->path_count; i++) {
        const cairn_shape_path *p = &m->paths[i];

        cairn_output_print(output, "<path class=\"axis\" d=\"");
        for (int32_t k = 0; k < p->count; k++)
            cairn_output_print(output, "%s%.1f %.1f", k == 0 ? "M" : "L",
                               x_of(v, m->samples[p->first + k].centre),
                               y_of(v, m->samples[p->first + k].centre));
        cairn_output_print(output, "\"/>\n");
        cairn_output_print(output, "<circle class=\"start\" cx=\"%.1f\" cy=\"%.1f\" r=\"5\"/>\n",
                           x_of(v, m->samples[p->first].centre),
                           y_of(v, m->samples[p->first].centre));
    }
}

cairn_status cairn_shape_model_file_draw(const cairn_shape_model *model, const char *title,
                                         const char *path, cairn_file_error *error)
{
    static const cairn_report_key keys[] = {{"outline", "stroke=\"#0f172a\""},
                                            {"axis, from its dot on", "stroke=\"#dc2626\""},
                                            {"left side", "stroke=\"#2563eb\""},
                                            {"right side", "stroke=\"#d97706\""}};
    cairn_fault fault = {-1, NULL};
    cairn_status status = cairn_shape_model_check(model, &fault);
    char subtitle[128];
    cairn_output *output;
    cairn_box box;
    double width, height, head;
    view v;

    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, path, 0, "%s", fault.what);
    (void)snprintf(subtitle, sizeof subtitle, "%d paths, %d samples, %d of the outline",
                   (int)model->path_count, (int)model->sample_count, (int)model->outline_count);
    box = box_of(model);
    head = cairn_report_head_height(title, subtitle);
    v.left = CAIRN_REPORT_MARGIN - SCALE * (double)box.min.x;
    v.top = head + CAIRN_REPORT_MARGIN - SCALE * (double)box.min.y;
    width = fmax(800, 2 * CAIRN_REPORT_MARGIN + SCALE * (double)(box.max.x - box.min.x));
    height = head + 2 * CAIRN_REPORT_MARGIN + SCALE * (double)(box.max.y - box.min.y) + FOOT;
    status = cairn_output_open(&output, path, error);
    if (status != CAIRN_OK)
        return status;
    cairn_report_print_head(output, width, height, title, subtitle);
    cairn_output_print(
        output, "<style>path{fill:none}.outline{stroke:#0f172a;stroke-width:2;fill:#e8edf3}"
                ".axis{stroke:#dc2626;stroke-width:3}.start{fill:#dc2626}.left{stroke:#2563eb}"
                ".right{stroke:#d97706}.at-left{fill:#2563eb}.at-right{fill:#d97706}</style>\n");
    print_outline(output, model, &v);
    print_radii(output, model, &v, 0);
    print_radii(output, model, &v, 1);
    print_axes(output, model, &v);
    cairn_report_print_keys(output, height - CAIRN_REPORT_MARGIN, 180, keys,
                            sizeof keys / sizeof *keys);
    cairn_output_print(output, "</svg>\n");
    return cairn_output_commit(output, error);
}
