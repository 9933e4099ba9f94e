/* Figures: plots of points, lines and bars side by side, all of one size, with the legend below. */
#include "src/base/build.h"

#include <stdlib.h>
#include <string.h>

#include "cairn/report.h"
#include "src/host/pictures/report_text.h"

/* Largest accepted magnitude of a coordinate. Lengths below are in px. */
#define MAX_COORDINATE   CAIRN_REAL(1e9)
#define PANEL_GAP_PX     20.0
#define FRAME_PADDING_PX 16.0 /* between a frame and its content */
#define AXIS_LEFT        62.0 /* space for the tick labels and the axis label */
#define AXIS_BOTTOM      46.0
#define LEGEND_HEIGHT    44.0
#define MIN_EXTENT       1e-6 /* smallest displayed range of an axis, in its units */
#define BAR_PIXELS       120.0
#define TICK_PIXELS      70.0
#define TEXT_SMALL       "font-size=\"12\" fill=\"#475569\""

cairn_report_figure cairn_report_figure_default(void)
{
    cairn_report_figure figure;

    memset(&figure, 0, sizeof figure);
    figure.width = 1200;
    return figure;
}

/* ---- Validation ---- */

static int32_t points_of(const cairn_report_layer *layer)
{
    return layer->mark == CAIRN_REPORT_LINES ? 2 * layer->count : layer->count;
}

static int box_is_empty(cairn_box box)
{
    return !(box.min.x <= box.max.x && box.min.y <= box.max.y);
}

static cairn_status check_layer(const char *path, const cairn_report_layer *layer, int plot,
                                int index, cairn_file_error *error)
{
    int32_t i;

    if (layer->count < 0 || layer->count > INT32_MAX / 2 ||
        (layer->count > 0 && layer->point == NULL) || layer->mark < CAIRN_REPORT_DOTS ||
        layer->mark > CAIRN_REPORT_BARS || layer->colour == NULL || !(layer->width > 0) ||
        !(layer->opacity > 0 && layer->opacity <= 1))
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "plot %d, layer %d: expected points, a mark, a colour, a width and an opacity", plot,
            index);
    for (i = 0; i < points_of(layer); i++)
        if (!cairn_vec2_is_within(layer->point[i], MAX_COORDINATE))
            return cairn_file_error_set(error, CAIRN_NOT_FINITE, path, 0,
                                        "plot %d, layer %d: point %d is not finite", plot, index,
                                        (int)i);
    return CAIRN_OK;
}

static cairn_status check_plot(const char *path, const cairn_report_plot *plot, int index,
                               cairn_file_error *error)
{
    cairn_status status = CAIRN_OK;
    int32_t i;

    if (plot->layer_count < 0 || (plot->layer_count > 0 && plot->layer == NULL) ||
        (plot->x_label == NULL) != (plot->y_label == NULL) || !(plot->x_step >= 0) ||
        !(plot->y_step >= 0))
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "plot %d: expected layers, both labels or none, steps not below 0", index);
    if (!box_is_empty(plot->box) && (!cairn_vec2_is_within(plot->box.min, MAX_COORDINATE) ||
                                     !cairn_vec2_is_within(plot->box.max, MAX_COORDINATE)))
        return cairn_file_error_set(error, CAIRN_NOT_FINITE, path, 0,
                                    "plot %d: its box is not finite", index);
    for (i = 0; i < plot->layer_count && status == CAIRN_OK; i++)
        status = check_layer(path, &plot->layer[i], index, (int)i, error);
    return status;
}

static cairn_status check(const char *path, const cairn_report_figure *figure,
                          cairn_file_error *error)
{
    cairn_status status = CAIRN_OK;
    int32_t i;

    if (figure->plot == NULL || figure->plot_count < 1 ||
        figure->plot_count > CAIRN_REPORT_MAX_PLOTS || figure->width < 200 || figure->width > 10000)
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "%d plots, width %d: expected 1 to %d plots, a width from 200 to 10000",
            (int)figure->plot_count, (int)figure->width, CAIRN_REPORT_MAX_PLOTS);
    for (i = 0; i < figure->plot_count && status == CAIRN_OK; i++)
        status = check_plot(path, &figure->plot[i], (int)i, error);
    return status;
}

/* ---- Layout ---- */

/* A plot's frame and its transformation to px: x = left + (px - min_x) scale_x, y = bottom - (py -
 * min_y) scale_y. */
typedef struct plot_view {
    double frame_left, frame_top, frame_width, frame_height;
    double left, bottom, width, height; /* of the plotting area */
    double min_x, min_y, max_x, max_y;
    double scale_x, scale_y;
} plot_view;

static int is_map(const cairn_report_plot *plot)
{
    return plot->x_label == NULL;
}

/* Returns the displayed box of a plot: its own, or the bounding box of its layers. */
static cairn_box box_of(const cairn_report_plot *plot)
{
    cairn_box box = cairn_box_empty();
    int32_t i, k;

    if (!box_is_empty(plot->box))
        return plot->box;
    for (i = 0; i < plot->layer_count; i++) {
        const cairn_report_layer *layer = &plot->layer[i];
        cairn_vec2 half = {(cairn_real)(layer->width / 2), 0};

        for (k = 0; k < points_of(layer); k++) {
            cairn_vec2 p = layer->point[k], foot = {p.x, 0};

            box = cairn_box_extend(box, p);
            if (layer->mark == CAIRN_REPORT_BARS) {
                box = cairn_box_extend(box, cairn_vec2_add(foot, half));
                box = cairn_box_extend(box, cairn_vec2_sub(foot, half));
            }
        }
    }
    return box;
}

/* Sets the displayed range, which is never empty. */
static void set_range(plot_view *view, cairn_box box, int map)
{
    double x, y, min_extent = map ? 1 : MIN_EXTENT;

    if (box_is_empty(box))
        memset(&box, 0, sizeof box);
    x = ((double)box.min.x + (double)box.max.x) / 2;
    y = ((double)box.min.y + (double)box.max.y) / 2;
    view->max_x = fmax((double)box.max.x - (double)box.min.x, min_extent);
    view->max_y = fmax((double)box.max.y - (double)box.min.y, min_extent);
    view->min_x = x - view->max_x / 2;
    view->min_y = y - view->max_y / 2;
    view->max_x += view->min_x;
    view->max_y += view->min_y;
}

/* Computes the transformation of a plot. */
static plot_view view_of(const cairn_report_plot *plot, double left, double top, double width,
                         double height)
{
    int map = is_map(plot);
    double wide, high;
    plot_view view;

    view.frame_left = left;
    view.frame_top = top;
    view.frame_width = width;
    view.frame_height = height;
    view.left = left + (map ? FRAME_PADDING_PX : AXIS_LEFT);
    view.width = width - (map ? 2 * FRAME_PADDING_PX : AXIS_LEFT + FRAME_PADDING_PX);
    view.height = height - (map ? 2 * FRAME_PADDING_PX : AXIS_BOTTOM + FRAME_PADDING_PX);
    view.bottom = top + height - (map ? FRAME_PADDING_PX : AXIS_BOTTOM);
    set_range(&view, box_of(plot), map);
    wide = view.max_x - view.min_x;
    high = view.max_y - view.min_y;
    view.scale_x = view.width / wide;
    view.scale_y = view.height / high;
    if (map) {
        view.scale_x = view.scale_y = fmin(view.scale_x, view.scale_y);
        view.left += (view.width - wide * view.scale_x) / 2;
        view.bottom -= (view.height - high * view.scale_y) / 2;
    }
    return view;
}

static double to_x(const plot_view *view, double x)
{
    return view->left + (x - view->min_x) * view->scale_x;
}

static double to_y(const plot_view *view, double y)
{
    return view->bottom - (y - view->min_y) * view->scale_y;
}

/* ---- Drawing ---- */

static void draw_layer(cairn_output *output, const plot_view *view, const cairn_report_layer *layer)
{
    int bars = layer->mark == CAIRN_REPORT_BARS;
    double half = layer->width / 2 * view->scale_x;
    int32_t i;

    if (layer->count == 0)
        return;
    cairn_output_print(output,
                       "<path fill=\"%s\" stroke=\"%s\" stroke-width=\"%.2f\" "
                       "stroke-linecap=\"round\" opacity=\"%.3g\" d=\"",
                       bars ? layer->colour : "none", bars ? "#fff" : layer->colour,
                       bars ? 0.8 : layer->width, layer->opacity);
    for (i = 0; i < points_of(layer); i++) {
        double x = to_x(view, (double)layer->point[i].x), y = to_y(view, (double)layer->point[i].y);

        if (layer->mark == CAIRN_REPORT_DOTS)
            cairn_output_print(output, "M%.1f %.1fh0", x, y);
        else if (layer->mark == CAIRN_REPORT_LINES)
            cairn_output_print(output, "%s%.1f %.1f", i % 2 == 0 ? "M" : "L", x, y);
        else
            cairn_output_print(output, "M%.1f %.1fV%.1fH%.1fV%.1fZ", x - half, to_y(view, 0), y,
                               x + half, to_y(view, 0));
    }
    cairn_output_print(output, "\"/>\n");
}

static void draw_scale_bar(cairn_output *output, const plot_view *view)
{
    double bar = cairn_report_round_down(BAR_PIXELS / view->scale_x), length = bar * view->scale_x;
    double x = view->frame_left + view->frame_width - 14,
           y = view->frame_top + view->frame_height - 14;

    cairn_output_print(output,
                       "<path d=\"M%.1f %.1fv7h%.1fv-7\" fill=\"none\" stroke=\"#334155\" "
                       "stroke-width=\"1.4\"/>\n",
                       x - length, y - 7, length);
    cairn_output_print(
        output, "<text x=\"%.1f\" y=\"%.1f\" " TEXT_SMALL " text-anchor=\"middle\">%g m</text>\n",
        x - length / 2, y - 6, bar);
}

/* Returns the tick distance: the requested one unless ticks would be too dense, else an automatic
 * one. */
static double step_of(double requested, double extent, double pixels, double tick_pixels)
{
    return requested * pixels / extent > tick_pixels / 4
               ? requested
               : cairn_report_round_down(extent * tick_pixels / pixels);
}

/* Draws the grid lines, the tick labels and the axis labels. */
static void draw_axes(cairn_output *output, const plot_view *view, const cairn_report_plot *plot)
{
    double step_x =
        step_of(plot->x_step, view->max_x - view->min_x, view->width, 1.6 * TICK_PIXELS);
    double step_y = step_of(plot->y_step, view->max_y - view->min_y, view->height, TICK_PIXELS);
    double top = view->bottom - view->height, at;
    double first_x = ceil(view->min_x / step_x - 1e-9), first_y = ceil(view->min_y / step_y - 1e-9);

    for (int32_t i = 0; (at = (first_x + i) * step_x) <= view->max_x + step_x * 1e-9; i++)
        cairn_output_print(
            output,
            "<path d=\"M%.1f %.1fV%.1f\" stroke=\"#e8edf3\"/>\n"
            "<text x=\"%.1f\" y=\"%.1f\" " TEXT_SMALL " text-anchor=\"middle\">%g</text>\n",
            to_x(view, at), view->bottom, top, to_x(view, at), view->bottom + 17, at + 0);
    for (int32_t i = 0; (at = (first_y + i) * step_y) <= view->max_y + step_y * 1e-9; i++)
        cairn_output_print(output,
                           "<path d=\"M%.1f %.1fH%.1f\" stroke=\"#e8edf3\"/>\n"
                           "<text x=\"%.1f\" y=\"%.1f\" " TEXT_SMALL
                           " text-anchor=\"end\">%g</text>\n",
                           view->left, to_y(view, at), view->left + view->width, view->left - 7,
                           to_y(view, at) + 4, at + 0);
    cairn_report_print_text(output, view->left + view->width / 2, view->bottom + 36,
                            TEXT_SMALL " text-anchor=\"middle\"", plot->x_label);
    cairn_output_print(output, "<g transform=\"translate(%.1f %.1f) rotate(-90)\">",
                       view->frame_left + 17, top + view->height / 2);
    cairn_report_print_text(output, 0, 0, TEXT_SMALL " text-anchor=\"middle\"", plot->y_label);
    cairn_output_print(output, "</g>\n");
}

static void draw_plot(cairn_output *output, const plot_view *view, const cairn_report_plot *plot,
                      int index)
{
    int32_t i;

    if (plot->title != NULL)
        cairn_report_print_text(output, view->frame_left + 2, view->frame_top - 9,
                                "font-size=\"14\" font-weight=\"600\" fill=\"#334155\"",
                                plot->title);
    if (plot->note != NULL)
        cairn_report_print_text(
            output, view->frame_left + view->frame_width - 2, view->frame_top - 9,
            "font-size=\"12\" fill=\"#64748b\" text-anchor=\"end\"", plot->note);
    cairn_output_print(
        output,
        "<rect id=\"frame%d\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" rx=\"8\" "
        "fill=\"#fff\" "
        "stroke=\"#dbe2ea\"/>\n<clipPath id=\"clip%d\"><use href=\"#frame%d\"/></clipPath>\n"
        "<g clip-path=\"url(#clip%d)\">\n",
        index, view->frame_left, view->frame_top, view->frame_width, view->frame_height, index,
        index, index);
    if (!is_map(plot))
        draw_axes(output, view, plot);
    for (i = 0; i < plot->layer_count; i++)
        draw_layer(output, view, &plot->layer[i]);
    if (is_map(plot))
        draw_scale_bar(output, view);
    cairn_output_print(output, "</g>\n");
}

/* ---- Legend ---- */

/* Returns 1 when an earlier layer has the same name. */
static int is_named_before(const cairn_report_figure *figure, int32_t plot, int32_t layer)
{
    const char *name = figure->plot[plot].layer[layer].name;
    int32_t earlier, i;

    for (earlier = 0; earlier <= plot; earlier++)
        for (i = 0; i < (earlier < plot ? figure->plot[earlier].layer_count : layer); i++)
            if (figure->plot[earlier].layer[i].name != NULL &&
                strcmp(figure->plot[earlier].layer[i].name, name) == 0)
                return 1;
    return 0;
}

/* Estimates the width of a text in px. */
static double text_width(const char *text)
{
    double width = 0;

    for (; *text != '\0'; text++)
        width += (*text & 0xC0) != 0x80 ? 6.6 : 0;
    return width;
}

static double draw_legend_entry(cairn_output *output, const cairn_report_layer *layer, double x,
                                double y)
{
    if (layer->mark == CAIRN_REPORT_DOTS)
        cairn_output_print(output, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\" fill=\"%s\"/>\n",
                           x + 9, y - 4, fmax(2.6, fmin(layer->width / 2, 6)), layer->colour);
    else if (layer->mark == CAIRN_REPORT_LINES)
        cairn_output_print(output,
                           "<path d=\"M%.1f %.1fh18\" stroke=\"%s\" stroke-width=\"2.2\" "
                           "stroke-linecap=\"round\"/>\n",
                           x, y - 4, layer->colour);
    else
        cairn_output_print(output,
                           "<rect x=\"%.1f\" y=\"%.1f\" width=\"12\" height=\"11\" fill=\"%s\"/>\n",
                           x + 3, y - 9, layer->colour);
    cairn_report_print_text(output, x + 25, y, TEXT_SMALL, layer->name);
    return x + 25 + text_width(layer->name) + 24;
}

static void draw_legend(cairn_output *output, const cairn_report_figure *figure, double y)
{
    double x = CAIRN_REPORT_MARGIN + 2;
    int32_t plot, i;

    for (plot = 0; plot < figure->plot_count; plot++)
        for (i = 0; i < figure->plot[plot].layer_count; i++)
            if (figure->plot[plot].layer[i].name != NULL && !is_named_before(figure, plot, i))
                x = draw_legend_entry(output, &figure->plot[plot].layer[i], x, y);
}

cairn_status cairn_report_figure_write(const char *path, const cairn_report_figure *figure,
                                       cairn_file_error *error)
{
    double head = cairn_report_head_height(figure->title, figure->subtitle), width, height;
    int titles = 0, maps = 0;
    cairn_output *output;
    cairn_status status = check(path, figure, error);
    int32_t i;

    if (status != CAIRN_OK)
        return status;
    status = cairn_output_open(&output, path, error);
    if (status != CAIRN_OK)
        return status;
    for (i = 0; i < figure->plot_count; i++) {
        titles |= figure->plot[i].title != NULL || figure->plot[i].note != NULL;
        maps += is_map(&figure->plot[i]);
    }
    width = (figure->width - 2 * CAIRN_REPORT_MARGIN - PANEL_GAP_PX * (figure->plot_count - 1)) /
            figure->plot_count;
    height = width * (maps > 0 && figure->plot_count > 1 ? 1.0
                      : maps > 0                         ? 0.75
                      : figure->plot_count > 1           ? 0.7
                                                         : 0.4);
    head += titles ? 26 : 0;
    cairn_report_print_head(output, figure->width, head + height + LEGEND_HEIGHT, figure->title,
                            figure->subtitle);
    for (i = 0; i < figure->plot_count; i++) {
        plot_view view = view_of(&figure->plot[i], CAIRN_REPORT_MARGIN + i * (width + PANEL_GAP_PX),
                                 head, width, height);

        draw_plot(output, &view, &figure->plot[i], (int)i);
    }
    draw_legend(output, figure, head + height + 28);
    cairn_output_print(output, "</svg>\n");
    return cairn_output_commit(output, error);
}
