/* Drawing of map pictures as SVG. The layout is in report_layout.c, embedded images are in
 * report_picture.c. */
#include "src/base/build.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/output.h"
#include "src/host/pictures/report_picture.h"
#include "src/host/pictures/report_text.h"

/* Height of the legend, px; limits of the markers and of the colour steps of a path. */
#define LEGEND_HEIGHT 44.0
#define MAX_MARKERS   60
#define PATH_COLOURS  48

cairn_report_map cairn_report_map_default(void)
{
    cairn_report_map map;

    memset(&map, 0, sizeof map);
    map.connect = 1;
    map.max_elements = 20000;
    map.width = 1200;
    return map;
}

/* ---- Drawing ---- */

/* Interpolates the colour map at a position along the path, 0 (start) to 1 (end): blue, violet,
 * rose, amber. */
static void colour_at(double position, int rgb[3])
{
    static const int stop[4][3] = {{37, 99, 235}, {139, 62, 230}, {225, 60, 130}, {245, 140, 20}};
    int k = position < 1 ? (int)(position * 3) : 2, c;

    for (c = 0; c < 3; c++)
        rgb[c] = (int)(stop[k][c] + (position * 3 - k) * (stop[k + 1][c] - stop[k][c]) + 0.5);
}

static double path_position(const cairn_report_map *map, int32_t index)
{
    return map->scan_count > 1 ? (double)index / (double)(map->scan_count - 1) : 0;
}

static int has_low_confidence(const cairn_report_panel *panel, int32_t index)
{
    return panel->low_confidence != NULL && panel->low_confidence[index] != 0;
}

static void draw_scan(cairn_output *output, const cairn_report_view *view,
                      const cairn_report_scan *scan, cairn_pose pose)
{
    cairn_transform t = cairn_transform_of(pose);
    int32_t k;

    for (k = 0; k < scan->segment_count; k++) {
        cairn_vec2 a = cairn_transform_point(t, scan->segment[k].a),
                   b = cairn_transform_point(t, scan->segment[k].b);

        cairn_output_print(output, "M%.1f %.1fL%.1f %.1f", cairn_report_view_x(view, (double)a.x),
                           cairn_report_view_y(view, (double)a.y),
                           cairn_report_view_x(view, (double)b.x),
                           cairn_report_view_y(view, (double)b.y));
    }
    for (k = 0; k < scan->point_count && scan->segment_count == 0; k++) {
        cairn_vec2 p = cairn_transform_point(t, scan->point[k]);

        cairn_output_print(output, "M%.1f %.1fh0", cairn_report_view_x(view, (double)p.x),
                           cairn_report_view_y(view, (double)p.y));
    }
}

/* Draws the walls as vectors; scans with low confidence last, in red. */
static void draw_walls(cairn_output *output, const cairn_report_view *view,
                       const cairn_report_map *map, const cairn_report_panel *panel)
{
    int32_t low_confidence, i;
    int rgb[3];

    for (low_confidence = 0; low_confidence <= 1; low_confidence++) {
        cairn_output_print(
            output,
            "<g fill=\"none\" stroke-linecap=\"round\" stroke-width=\"1.5\" stroke=\"%s\" "
            "stroke-opacity=\"%s\">\n",
            low_confidence ? "#dc2626" : "#1e293b",
            low_confidence      ? ".45"
            : map->colour_scans ? ".75"
                                : ".6");
        for (i = 0; i < map->scan_count; i++) {
            if (has_low_confidence(panel, i) != low_confidence ||
                map->scan[i].point_count + map->scan[i].segment_count == 0)
                continue;
            cairn_output_print(output, "<path d=\"");
            draw_scan(output, view, &map->scan[i], panel->pose[i]);
            cairn_output_print(output, "\"");
            if (map->colour_scans && !low_confidence) {
                colour_at(path_position(map, i), rgb);
                cairn_output_print(output, " stroke=\"#%02x%02x%02x\"", (unsigned)rgb[0],
                                   (unsigned)rgb[1], (unsigned)rgb[2]);
            }
            cairn_output_print(output, "/>\n");
        }
        cairn_output_print(output, "</g>\n");
    }
}

/* Draws the path in stretches of one colour each. A pose within half a pixel of the last drawn one
 * is skipped. */
static void draw_path(cairn_output *output, const cairn_report_view *view,
                      const cairn_report_map *map, const cairn_report_panel *panel)
{
    int32_t stretches = map->scan_count - 1 < PATH_COLOURS ? map->scan_count - 1 : PATH_COLOURS,
            stretch, i;
    int rgb[3];

    cairn_output_print(output, "<g fill=\"none\" stroke-width=\"1.8\" stroke-linecap=\"round\" "
                               "stroke-linejoin=\"round\">\n");
    for (stretch = 0; stretch < stretches; stretch++) {
        int32_t first = (int32_t)((int64_t)(map->scan_count - 1) * stretch / stretches);
        int32_t last = (int32_t)((int64_t)(map->scan_count - 1) * (stretch + 1) / stretches);
        double drawn_x = 0, drawn_y = 0;

        colour_at((stretch + 0.5) / stretches, rgb);
        cairn_output_print(output, "<path stroke=\"#%02x%02x%02x\" d=\"", (unsigned)rgb[0],
                           (unsigned)rgb[1], (unsigned)rgb[2]);
        for (i = first; i <= last; i++) {
            double x = cairn_report_view_x(view, (double)panel->pose[i].x);
            double y = cairn_report_view_y(view, (double)panel->pose[i].y);

            if (i > first && i < last && fabs(x - drawn_x) < 0.5 && fabs(y - drawn_y) < 0.5)
                continue;
            cairn_output_print(output, "%s%.1f %.1f", i == first ? "M" : "L", x, y);
            drawn_x = x;
            drawn_y = y;
        }
        cairn_output_print(output, "\"/>\n");
    }
    cairn_output_print(output, "</g>\n");
}

/* Draws a robot as an arrowhead in its heading. */
static void draw_robot(cairn_output *output, double x, double y, double theta, const char *fill)
{
    cairn_output_print(
        output,
        "<path transform=\"translate(%.1f %.1f) rotate(%.1f)\" d=\"M7 0L-4.5 4.6L-2.4 0L-4.5 "
        "-4.6Z\" "
        "fill=\"%s\" stroke=\"#fff\" stroke-width=\".9\" stroke-linejoin=\"round\"/>\n",
        x, y, 0 - theta * 180 / (double)CAIRN_PI, fill);
}

static void draw_robots(cairn_output *output, const cairn_report_view *view,
                        const cairn_report_map *map, const cairn_report_panel *panel)
{
    int32_t step = (map->scan_count + MAX_MARKERS - 1) / MAX_MARKERS, i;
    char fill[8] = "#dc2626";
    int rgb[3], c, digit;

    for (i = 0; i < map->scan_count; i++) {
        cairn_pose pose = panel->pose[i];

        /* With more poses than markers, the path shows the skipped ones, also those with low
         * confidence. */
        if (i % step != 0 && i != map->scan_count - 1)
            continue;
        if (has_low_confidence(panel, i)) {
            memcpy(fill, "#dc2626", sizeof fill);
        } else {
            colour_at(path_position(map, i), rgb);
            for (c = 0; c < 6; c++) {
                digit = rgb[c / 2] >> (c % 2 == 0 ? 4 : 0) & 15;
                fill[1 + c] = "0123456789abcdef"[digit];
            }
        }
        draw_robot(output, cairn_report_view_x(view, (double)pose.x),
                   cairn_report_view_y(view, (double)pose.y), (double)pose.theta, fill);
    }
}

static cairn_status draw_panel(cairn_output *output, const cairn_report_map *map,
                               const cairn_report_layout *layout, int32_t index)
{
    const cairn_report_panel *panel = &map->panel[index];
    cairn_report_view view = cairn_report_view_of(layout, index);
    cairn_status status = CAIRN_OK;

    if (panel->title != NULL)
        cairn_report_print_text(output, view.frame_left + 2, layout->top - 9,
                                "font-size=\"14\" font-weight=\"600\" fill=\"#334155\"",
                                panel->title);
    if (panel->note != NULL)
        cairn_report_print_text(output, view.frame_left + view.width - 2, layout->top - 9,
                                "font-size=\"12\" fill=\"#64748b\" text-anchor=\"end\"",
                                panel->note);
    cairn_output_print(
        output,
        "<rect id=\"frame%d\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" rx=\"8\" "
        "fill=\"#fff\" stroke=\"#dbe2ea\"/>\n<clipPath id=\"clip%d\"><use "
        "href=\"#frame%d\"/></clipPath>\n"
        "<g clip-path=\"url(#clip%d)\">\n",
        (int)index, view.frame_left, view.frame_top, view.width, view.height, (int)index,
        (int)index, (int)index);
    if (panel->grid != NULL)
        status = cairn_report_draw_grid(output, &view, panel->grid);
    else if (cairn_report_elements(map) > map->max_elements)
        status = cairn_report_draw_density(output, &view, map, panel->pose);
    else if (map->scan != NULL)
        draw_walls(output, &view, map, panel);
    if (map->connect && map->scan_count > 1)
        draw_path(output, &view, map, panel);
    draw_robots(output, &view, map, panel);
    cairn_output_print(output, "</g>\n");
    return status;
}

static void draw_legend(cairn_output *output, const cairn_report_map *map,
                        const cairn_report_layout *layout, double right)
{
    const char *style = "font-size=\"12\" fill=\"#475569\"";
    double y = layout->top + layout->height + 28, x = CAIRN_REPORT_MARGIN + 2,
           bar = cairn_report_round_down(150 / layout->scale);
    int32_t i, k, low_confidence = 0, grids = 0;
    int rgb[3];

    for (i = 0; i < map->panel_count; i++) {
        grids += map->panel[i].grid != NULL;
        for (k = 0; k < map->scan_count; k++)
            low_confidence |= has_low_confidence(&map->panel[i], k);
    }
    if (cairn_report_elements(map) > 0 && grids < map->panel_count) {
        cairn_output_print(output,
                           "<path d=\"M%.1f %.1fh18\" stroke=\"#1e293b\" stroke-width=\"2.4\" "
                           "stroke-linecap=\"round\" stroke-opacity=\".75\"/>\n",
                           x, y - 4);
        cairn_report_print_text(output, x + 25, y, style, "walls");
        x += 78;
    }
    draw_robot(output, x + 6, y - 4, 0, "#2563eb");
    cairn_report_print_text(output, x + 20, y, style, "robot");
    x += 72;
    x += map->connect ? 66 : 32;
    cairn_output_print(output, "<text x=\"%.1f\" y=\"%.1f\" %s text-anchor=\"end\">%s</text>\n",
                       x - 6, y, style, map->connect ? "path: start" : "start");
    for (i = 0; i < 24; i++) {
        colour_at((i + 0.5) / 24, rgb);
        cairn_output_print(
            output,
            "<rect x=\"%.1f\" y=\"%.1f\" width=\"3.5\" height=\"5\" fill=\"#%02x%02x%02x\"/>\n",
            x + 3 * i, y - 6.5, (unsigned)rgb[0], (unsigned)rgb[1], (unsigned)rgb[2]);
    }
    cairn_report_print_text(output, x + 79, y, style, "end");
    x += 122;
    if (low_confidence) {
        draw_robot(output, x + 6, y - 4, 0, "#dc2626");
        cairn_report_print_text(output, x + 20, y, style, "low confidence");
    }
    cairn_output_print(output,
                       "<path d=\"M%.1f %.1fv7h%.1fv-7\" fill=\"none\" stroke=\"#334155\" "
                       "stroke-width=\"1.4\"/>\n",
                       right - 2 - bar * layout->scale, y - 8, bar * layout->scale);
    cairn_output_print(output, "<text x=\"%.1f\" y=\"%.1f\" %s text-anchor=\"end\">%g m</text>\n",
                       right - 10 - bar * layout->scale, y, style, bar);
}

static cairn_status draw(cairn_output *output, const cairn_report_map *map,
                         const cairn_report_layout *layout)
{
    double height = layout->top + layout->height + LEGEND_HEIGHT;
    cairn_status status = CAIRN_OK;
    int32_t i;

    cairn_report_print_head(output, map->width, height, map->title, map->subtitle);
    for (i = 0; i < map->panel_count && status == CAIRN_OK; i++)
        status = draw_panel(output, map, layout, i);
    draw_legend(output, map, layout, map->width - CAIRN_REPORT_MARGIN);
    cairn_output_print(output, "</svg>\n");
    return status;
}

cairn_status cairn_report_map_write(const char *path, const cairn_report_map *map,
                                    cairn_file_error *error)
{
    cairn_output *output;
    cairn_report_layout layout;
    cairn_status status = cairn_report_check(path, map, error);

    if (status != CAIRN_OK)
        return status;
    cairn_report_compute_layout(map, &layout);
    status = cairn_output_open(&output, path, error);
    if (status != CAIRN_OK)
        return status;
    if (draw(output, map, &layout) != CAIRN_OK) {
        cairn_output_discard(output);
        return cairn_file_error_system(error, path, "write", ENOMEM);
    }
    return cairn_output_commit(output, error);
}
