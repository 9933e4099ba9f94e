/* Drawing of a graph before and after optimization, as SVG: two panels in one scale. */
#include "src/base/build.h"

#include "cairn/output.h"
#include "cairn/pose_graph_file.h"
#include "src/host/pictures/report_text.h"

/* Side of a panel, margin and height of the title, in SVG units. */
#define PANEL_SIDE_PX   560.0
#define MARGIN_PX       24.0
#define TITLE_HEIGHT_PX 72.0

/* Transformation from the map to a panel. */
typedef struct panel_view {
    /* x, y: the map's point at the panel's centre, m; scale: units per m */
    double left, scale, x, y;
} panel_view;

/* An axis-aligned bounding box, m. */
typedef struct bounding_box {
    double min_x, max_x, min_y, max_y;
} bounding_box;

static cairn_pose pose_of(const cairn_pose_graph_file *file,
                          const cairn_pose_graph_file_solution *solution, int32_t index, int after)
{
    return after ? solution->pose[index] : file->vertex[index].pose;
}

/* Returns the bounding box of the poses before or after optimization. */
static bounding_box find_bounds(const cairn_pose_graph_file *file,
                                const cairn_pose_graph_file_solution *solution, int after)
{
    cairn_pose first = pose_of(file, solution, 0, after);
    bounding_box bounds = {(double)first.x, (double)first.x, (double)first.y, (double)first.y};

    for (int32_t v = 1; v < file->vertex_count; v++) {
        cairn_pose pose = pose_of(file, solution, v, after);

        bounds.min_x = fmin(bounds.min_x, (double)pose.x);
        bounds.max_x = fmax(bounds.max_x, (double)pose.x);
        bounds.min_y = fmin(bounds.min_y, (double)pose.y);
        bounds.max_y = fmax(bounds.max_y, (double)pose.y);
    }
    return bounds;
}

static double side_of(bounding_box bounds)
{
    return fmax(fmax(bounds.max_x - bounds.min_x, bounds.max_y - bounds.min_y), 1e-3);
}

/* Prints the inlier or the outlier edges as one path. */
static void print_links(cairn_output *output, const cairn_pose_graph_file *file,
                        const cairn_pose_graph_file_solution *solution, const panel_view *panel,
                        int after, int dropped)
{
    cairn_output_print(output, "<path class=\"%s\" d=\"", dropped ? "dropped" : "kept");
    for (int32_t e = 0; e < file->edge_count; e++) {
        cairn_pose a = pose_of(file, solution, file->edge[e].first, after);
        cairn_pose b = pose_of(file, solution, file->edge[e].second, after);

        if (solution->outlier[e] != dropped)
            continue;
        cairn_output_print(
            output, "M%.1f %.1fL%.1f %.1f",
            panel->left + PANEL_SIDE_PX / 2 + ((double)a.x - panel->x) * panel->scale,
            TITLE_HEIGHT_PX + PANEL_SIDE_PX / 2 - ((double)a.y - panel->y) * panel->scale,
            panel->left + PANEL_SIDE_PX / 2 + ((double)b.x - panel->x) * panel->scale,
            TITLE_HEIGHT_PX + PANEL_SIDE_PX / 2 - ((double)b.y - panel->y) * panel->scale);
    }
    cairn_output_print(output, "\"/>\n");
}

cairn_status cairn_pose_graph_file_draw(const char *path, const cairn_pose_graph_file *file,
                                        const cairn_pose_graph_file_solution *solution,
                                        const char *title, cairn_file_error *error)
{
    bounding_box panel_bounds[2] = {find_bounds(file, solution, 0), find_bounds(file, solution, 1)};
    double scale =
        (PANEL_SIDE_PX - MARGIN_PX) / fmax(side_of(panel_bounds[0]), side_of(panel_bounds[1]));
    double width = 2 * PANEL_SIDE_PX + 3 * MARGIN_PX,
           height = PANEL_SIDE_PX + TITLE_HEIGHT_PX + MARGIN_PX;
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(
        output,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" viewBox=\"0 0 "
        "%.0f %.0f\" "
        "font-family=\"sans-serif\" font-size=\"14\">\n"
        "<style>.kept{fill:none;stroke:#555;stroke-width:.8}.dropped{fill:none;stroke:#d22;"
        "stroke-width:.6;stroke-opacity:.6}</style>\n<rect width=\"100%%\" height=\"100%%\" "
        "fill=\"#fff\"/>\n<text x=\"%.0f\" y=\"26\" font-size=\"17\">",
        width, height, width, height, MARGIN_PX);
    cairn_report_print_escaped(output, title);
    cairn_output_print(output, "</text>\n");
    for (int after = 0; after < 2; after++) {
        bounding_box bounds = panel_bounds[after];
        panel_view panel = {MARGIN_PX + after * (PANEL_SIDE_PX + MARGIN_PX), scale,
                            (bounds.min_x + bounds.max_x) / 2, (bounds.min_y + bounds.max_y) / 2};

        cairn_output_print(output, "<text x=\"%.0f\" y=\"54\">%s: &#967;&#178; %.6g", panel.left,
                           after ? "after" : "before",
                           after ? (double)solution->state.chi2 : solution->chi2_initial);
        if (after && solution->outliers > 0)
            cairn_output_print(output, " without %d links, red", (int)solution->outliers);
        cairn_output_print(output, "</text>\n");
        print_links(output, file, solution, &panel, after, 1);
        print_links(output, file, solution, &panel, after, 0);
    }
    cairn_output_print(output, "</svg>\n");
    return cairn_output_commit(output, error);
}
