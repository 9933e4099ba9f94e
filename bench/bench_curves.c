#include "bench/bench_curves.h"

#include <math.h>

#include "cairn/output.h"

/* Pixels. */
enum {
    PANEL_WIDTH = 380,
    PANEL_HEIGHT = 230,
    LEFT = 62,
    RIGHT = 14,
    TOP = 34,
    BOTTOM = 34,
    HEAD_PX = 96
};

static const char *const colours[] = {"#d97706", "#2563eb", "#059669", "#dc2626"};

/* The contents and the place of a panel. */
typedef struct frame {
    double x, y, width, height; /* of the plot */
    double low, high;           /* of the values */
} frame;

static void find_range(const bench_curves *c, const bench_curve_panel *panel, frame *f)
{
    f->low = (double)INFINITY;
    f->high = -(double)INFINITY;
    for (int32_t k = 0; k < c->methods * c->samples; k++)
        if (isfinite(panel->value[k])) {
            f->low = fmin(f->low, panel->value[k]);
            f->high = fmax(f->high, panel->value[k]);
        }
    if (!(f->low < f->high)) {
        f->low = isfinite(f->low) ? f->low - 1 : 0;
        f->high = f->low + 2;
    }
    /* Errors and entropies start at 0 when that costs little space. */
    if (f->low > 0 && f->low < 0.4 * f->high)
        f->low = 0;
    f->high += 0.04 * (f->high - f->low);
}

static double x_of(const bench_curves *c, const frame *f, int32_t sample)
{
    return f->x + f->width * sample / (c->samples - 1);
}

static double y_of(const frame *f, double value)
{
    return f->y + f->height * (f->high - value) / (f->high - f->low);
}

/* 1, 2 or 5 times a power of ten: about five of them in the range. */
static double tick_of(double range)
{
    double unit = pow(10, floor(log10(range / 5))), times = range / 5 / unit;

    return unit * (times < 1.5 ? 1 : times < 3.5 ? 2 : times < 7.5 ? 5 : 10);
}

static void draw_axes(cairn_output *out, const bench_curves *c, const frame *f)
{
    double tick = tick_of(f->high - f->low);

    for (double v = ceil(f->low / tick) * tick; v <= f->high; v += tick) {
        double shown = fabs(v) < tick / 1000 ? 0 : v;

        cairn_output_print(
            out,
            "<path class=\"grid\" d=\"M%.1f %.1fh%.1f\"/>"
            "<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%g</text>\n",
            f->x, y_of(f, v), f->width, f->x - 6, y_of(f, v) + 4, shown);
    }
    for (int32_t k = 0; k < c->samples; k++)
        if ((c->step[k] <= 50 && c->step[k] % 10 == 0) ||
            (c->step[k] > 100 && c->step[k] % 100 == 0))
            cairn_output_print(
                out,
                "<path class=\"grid\" d=\"M%.1f %.1fv4\"/>"
                "<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%d</text>\n",
                x_of(c, f, k), f->y + f->height, x_of(c, f, k), f->y + f->height + 17,
                (int)c->step[k]);
    for (int32_t k = 1; k + 1 < c->samples; k++)
        if (c->step[k + 1] - c->step[k] > c->step[k] - c->step[k - 1])
            cairn_output_print(out, "<path class=\"break\" d=\"M%.1f %.1fv%.1f\"/>\n",
                               x_of(c, f, k), f->y, f->height);
    cairn_output_print(out, "<path class=\"axis\" d=\"M%.1f %.1fv%.1fh%.1f\"/>\n", f->x, f->y,
                       f->height, f->width);
}

static void draw_panel(cairn_output *out, const bench_curves *c, int32_t index)
{
    const bench_curve_panel *panel = &c->panel[index];
    int32_t row = index / c->columns;
    double corner_x = 12 + (double)(index % c->columns * PANEL_WIDTH),
           corner_y = HEAD_PX + (double)(row * PANEL_HEIGHT);
    frame f = {corner_x + LEFT,
               corner_y + TOP,
               PANEL_WIDTH - LEFT - RIGHT,
               PANEL_HEIGHT - TOP - BOTTOM,
               0,
               0};

    find_range(c, panel, &f);
    cairn_output_print(out, "<text class=\"name\" x=\"%.1f\" y=\"%.1f\">%s</text>\n", f.x,
                       corner_y + 20, panel->title);
    draw_axes(out, c, &f);
    for (int32_t m = 0; m < c->methods; m++) {
        int pen = 0;

        cairn_output_print(out, "<path class=\"curve\" stroke=\"%s\" d=\"", colours[m]);
        for (int32_t k = 0; k < c->samples; k++) {
            double value = panel->value[m * c->samples + k];

            if (isfinite(value))
                cairn_output_print(out, "%c%.1f %.1f", pen ? 'L' : 'M', x_of(c, &f, k),
                                   y_of(&f, value));
            pen = isfinite(value);
        }
        cairn_output_print(out, "\"/>\n");
    }
}

cairn_status bench_curves_write(const char *path, const bench_curves *c, cairn_file_error *error)
{
    int width = 24 + c->columns * PANEL_WIDTH;
    int height = HEAD_PX + 16 + (c->panels + c->columns - 1) / c->columns * PANEL_HEIGHT;
    cairn_output *out;
    cairn_status status = cairn_output_open(&out, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(out,
                       "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" "
                       "viewBox=\"0 0 %d %d\">\n"
                       "<style>text { font-family: system-ui, sans-serif; fill: #1e293b; } .title "
                       "{ font-size: 20px; "
                       "font-weight: 600; } .small { font-size: 13px; fill: #64748b; } .name { "
                       "font-size: 14px; font-weight: 600; } "
                       ".tick { font-size: 11px; fill: #64748b; } .grid { stroke: #dbe2ea; } .axis "
                       "{ stroke: #64748b; "
                       "fill: none; } .break { stroke: #94a3b8; stroke-dasharray: 3 3; } "
                       ".curve { fill: none; stroke-width: 1.8; stroke-linejoin: round; }</style>\n"
                       "<rect width=\"100%%\" height=\"100%%\" fill=\"#ffffff\"/>\n"
                       "<text class=\"title\" x=\"24\" y=\"34\">%s</text>\n"
                       "<text class=\"small\" x=\"24\" y=\"56\">%s</text>\n",
                       width, height, width, height, c->title, c->subtitle);
    for (int32_t m = 0; m < c->methods; m++)
        cairn_output_print(out,
                           "<path class=\"curve\" stroke=\"%s\" d=\"M%d 76h26\"/>"
                           "<text class=\"small\" x=\"%d\" y=\"80\">%s</text>\n",
                           colours[m], 24 + 120 * (int)m, 56 + 120 * (int)m, c->method[m]);
    for (int32_t k = 0; k < c->panels; k++)
        draw_panel(out, c, k);
    cairn_output_print(out, "</svg>\n");
    return cairn_output_commit(out, error);
}
