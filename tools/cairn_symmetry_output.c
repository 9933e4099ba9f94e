/* Output files of cairn symmetry: pictures and JSON. */
#include <math.h>
#include <stdio.h>

#include "cairn/output.h"
#include "src/host/base/degrees.h"
#include "src/host/pictures/report_text.h"
#include "tools/cairn_symmetry.h"

#define PANEL_PX     480.0
#define CELL_PX      280.0
#define CAPTION_PX   40.0
#define LINE_PX      20.0
#define COLUMNS      4
#define MIN_BEND_RAD 1e-3
#define AXES_DRAWN   8

const char *symmetry_mode_name(int32_t mode)
{
    return mode == CAIRN_MODE_AS_WRITTEN ? "as written" : "re-ranked";
}

const char *symmetry_verdict_name(cairn_self_similarity_verdict verdict)
{
    return verdict == CAIRN_SELF_SIMILARITY_SINGLE     ? "one axis"
           : verdict == CAIRN_SELF_SIMILARITY_MULTIPLE ? "several axes"
                                                       : "no single axis";
}

/* ---- Pictures ---- */

/* Mapping from pixels of the image to coordinates of the drawing. */
typedef struct view {
    double left, top, scale;
    cairn_box box;
} view;

static double x_of(const view *v, cairn_vec2 p)
{
    return v->left + v->scale * (double)(p.x - v->box.min.x);
}

static double y_of(const view *v, cairn_vec2 p)
{
    return v->top + v->scale * (double)(p.y - v->box.min.y);
}

static view view_of(const symmetry_found *f, double left, double top, double size)
{
    view v = {left, top, 1, cairn_box_empty()};
    double width, height;

    for (int32_t i = 0; i < f->shape[0].count; i++)
        v.box = cairn_box_extend(v.box, f->shape[0].points[i]);
    width = (double)(v.box.max.x - v.box.min.x);
    height = (double)(v.box.max.y - v.box.min.y);
    v.scale = size / fmax(width, height);
    v.left += (size - v.scale * width) / 2;
    v.top += (size - v.scale * height) / 2;
    return v;
}

static void print_point(cairn_output *output, const view *v, const char *move, cairn_vec2 p)
{
    cairn_output_print(output, "%s%.1f %.1f", move, x_of(v, p), y_of(v, p));
}

static void print_filled(cairn_output *output, const symmetry_found *f, const view *v)
{
    cairn_output_print(output, "<path class=\"shape\" d=\"");
    for (int32_t o = 0; o < 1 + f->holes; o++) {
        for (int32_t i = 0; i < f->shape[o].count; i++)
            print_point(output, v, i == 0 ? "M" : "L", f->shape[o].points[i]);
        cairn_output_print(output, "Z");
    }
    cairn_output_print(output, "\"/>\n");
}

/* Draws the outline between two positions, given as fractions of its length. */
static void print_arc(cairn_output *output, const symmetry_found *f, const view *v,
                      cairn_self_similarity_arc arc, const char *name)
{
    int32_t n = f->result.sample_count, first = (int32_t)ceil((double)arc.from * n);
    int32_t last = (int32_t)floor((double)arc.to * n);

    cairn_output_print(output, "<path class=\"%s\" d=\"", name);
    for (int32_t i = first; i <= last; i++)
        print_point(output, v, i == first ? "M" : "L", f->samples[i % n]);
    cairn_output_print(output, "\"/>\n");
}

static void print_axis(cairn_output *output, const view *v, const cairn_self_similarity_axis *a,
                       const char *name)
{
    double chord = hypot((double)(a->end[1].x - a->end[0].x), (double)(a->end[1].y - a->end[0].y)),
           bend = (double)a->bend;

    cairn_output_print(output, "<path class=\"%s\" d=\"", name);
    print_point(output, v, "M", a->end[0]);
    if (fabs(bend) > MIN_BEND_RAD) {
        double radius = v->scale * chord / (2 * sin(fabs(bend) / 2));

        cairn_output_print(output, "A%.1f %.1f 0 0 %d ", radius, radius, bend > 0);
        print_point(output, v, "", a->end[1]);
    } else {
        print_point(output, v, "L", a->end[1]);
    }
    cairn_output_print(output, "\"/>\n");
}

/* Draws the complete outline grey, the arcs over it, the best axis and ties. */
static void print_shape(cairn_output *output, const symmetry_found *f, const view *v)
{
    const cairn_self_similarity_axis *best = &f->axes[0];
    cairn_self_similarity_arc whole = {0, 1};

    print_filled(output, f, v);
    print_arc(output, f, v, whole, "skipped");
    if (f->result.count < 1)
        return;
    print_arc(output, f, v, best->arc[0], "first");
    print_arc(output, f, v, best->arc[1], "second");
    for (int32_t i = 1; i < f->result.tie_count && i < AXES_DRAWN; i++)
        print_axis(output, v, &f->axes[i], "tie");
    print_axis(output, v, best, "axis");
    for (int k = 0; k < 2; k++)
        cairn_output_print(output, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"4\"/>\n",
                           x_of(v, best->end[k]), y_of(v, best->end[k]));
}

static void print_style(cairn_output *output)
{
    cairn_output_print(
        output,
        "<style>path{fill:none;stroke-width:3;stroke-linejoin:round}.shape{fill:#f1f5f9;"
        "fill-rule:evenodd;stroke:#cbd5e1;stroke-width:1}.skipped{stroke:#94a3b8}"
        ".first{stroke:#dc2626}.second{stroke:#2563eb}.axis{stroke:#0f172a;stroke-width:2}"
        ".tie{stroke:#64748b;stroke-width:1.5;stroke-dasharray:6 4}circle{fill:#0f172a}</style>\n");
}

static void describe(const symmetry_found *f, char *text, size_t size)
{
    char turns[32] = "";

    if (f->result.rotation_order == 0)
        (void)snprintf(turns, sizeof turns, ", any turn");
    else if (f->result.rotation_order > 1)
        (void)snprintf(turns, sizeof turns, ", %d turns", (int)f->result.rotation_order);
    (void)snprintf(text, size, "%s, dissimilarity %.4f%s", symmetry_verdict_name(f->result.verdict),
                   f->result.count > 0 ? (double)f->axes[0].dissimilarity : 0, turns);
}

cairn_status symmetry_draw(const symmetry_found *f, const char *path, cairn_file_error *error)
{
    const char *title = cairn_output_path_name(f->path);
    cairn_output *output;
    cairn_status status;
    char subtitle[160];
    double head;
    view v;

    describe(f, subtitle, sizeof subtitle);
    head = cairn_report_head_height(title, subtitle);
    v = view_of(f, CAIRN_REPORT_MARGIN, head + CAIRN_REPORT_MARGIN, PANEL_PX);
    status = cairn_output_open(&output, path, error);
    if (status != CAIRN_OK)
        return status;
    cairn_report_print_head(output, PANEL_PX + 2 * CAIRN_REPORT_MARGIN,
                            head + PANEL_PX + 2 * CAIRN_REPORT_MARGIN, title, subtitle);
    print_style(output);
    print_shape(output, f, &v);
    cairn_output_print(output, "</svg>\n");
    return cairn_output_commit(output, error);
}

cairn_status symmetry_draw_sheet(const symmetry_found *found, int32_t count, const char *path,
                                 cairn_file_error *error)
{
    int32_t columns = count < COLUMNS ? count : COLUMNS, rows = (count + columns - 1) / columns;
    double step = CELL_PX + CAIRN_REPORT_MARGIN, head;
    const char *subtitle = symmetry_mode_name(found[0].mode);
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    head = cairn_report_head_height("Axes of self-similarity", subtitle);
    cairn_report_print_head(output, CAIRN_REPORT_MARGIN + columns * step,
                            head + CAIRN_REPORT_MARGIN + rows * (step + CAPTION_PX),
                            "Axes of self-similarity", subtitle);
    print_style(output);
    for (int32_t i = 0; i < count; i++) {
        int32_t row = i / columns, column = i % columns;
        double left = CAIRN_REPORT_MARGIN + column * step,
               top = head + CAIRN_REPORT_MARGIN + row * (step + CAPTION_PX);
        view v = view_of(&found[i], left, top, CELL_PX);
        char text[160];

        describe(&found[i], text, sizeof text);
        print_shape(output, &found[i], &v);
        cairn_report_print_text(output, left, top + CELL_PX + LINE_PX,
                                "font-size=\"14\" fill=\"#0f172a\"",
                                cairn_output_path_name(found[i].path));
        cairn_report_print_text(output, left, top + CELL_PX + 2 * LINE_PX,
                                "font-size=\"12\" fill=\"#475569\"", text);
    }
    cairn_output_print(output, "</svg>\n");
    return cairn_output_commit(output, error);
}

/* ---- JSON ---- */

static void write_axis(cairn_output *output, const cairn_self_similarity_axis *a)
{
    cairn_output_print(
        output,
        "  {\"ends\": [[%.2f, %.2f], [%.2f, %.2f]], \"places\": [%.5f, %.5f], \"arcs\": [[%.5f, "
        "%.5f], "
        "[%.5f, %.5f]],\n   \"dissimilarity\": %.6f, \"misfit\": %.6f, \"warp\": %.6f, "
        "\"bend_deg\": %.2f, "
        "\"skew\": %.4f,\n   \"mirror\": [%.2f, %.2f, %.3f], \"vertices\": %d, \"division\": %d}",
        (double)a->end[0].x, (double)a->end[0].y, (double)a->end[1].x, (double)a->end[1].y,
        (double)a->position[0], (double)a->position[1], (double)a->arc[0].from,
        (double)a->arc[0].to, (double)a->arc[1].from, (double)a->arc[1].to,
        (double)a->dissimilarity, (double)a->mirror_residual, (double)a->dtw_cost,
        CAIRN_DEGREES_PER_RADIAN * (double)a->bend, (double)a->skew, (double)a->mirror_point.x,
        (double)a->mirror_point.y,
        CAIRN_DEGREES_PER_RADIAN *
            atan2((double)a->mirror_direction.y, (double)a->mirror_direction.x),
        (int)a->vertices, (int)a->division);
}

cairn_status symmetry_write(const symmetry_found *f, const char *path, cairn_file_error *error)
{
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(output, "{\"shape\": ");
    cairn_report_print_json(output, cairn_output_path_name(f->path));
    cairn_output_print(
        output,
        ", \"mode\": \"%s\", \"parts\": %d, \"holes\": %d,\n \"verdict\": \"%s\", \"ties\": %d, "
        "\"rotations\": %d,\n \"axes\": [",
        symmetry_mode_name(f->mode), (int)f->parts, (int)f->holes,
        symmetry_verdict_name(f->result.verdict), (int)f->result.tie_count,
        (int)f->result.rotation_order);
    for (int32_t i = 0; i < f->result.count; i++) {
        cairn_output_print(output, "%s\n", i > 0 ? "," : "");
        write_axis(output, &f->axes[i]);
    }
    cairn_output_print(output, "],\n \"outline\": [");
    for (int32_t i = 0; i < f->result.sample_count; i++)
        cairn_output_print(output, "%s[%.2f, %.2f]", i > 0 ? ", " : "", (double)f->samples[i].x,
                           (double)f->samples[i].y);
    cairn_output_print(output, "]}\n");
    return cairn_output_commit(output, error);
}
