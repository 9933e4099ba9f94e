/* A graph before and after, as SVG: two panels in one scale. */
#include "src/core/build.h"

#include "cairn/output.h"
#include "cairn/pose_graph_file.h"
#include "src/host/report_text.h"

#define PANEL  560.0
#define MARGIN 24.0
#define TOP    72.0

/* From the map to a panel. */
typedef struct view {
    double left, scale, x, y; /* x, y: the map's point in the panel's middle */
} view;

typedef struct extent {
    double least_x, most_x, least_y, most_y;
} extent;

static cairn_pose pose_of(const cairn_pose_graph_file *file,
                          const cairn_pose_graph_solution *solution, int32_t v, int after)
{
    return after ? solution->pose[v] : file->vertex[v].pose;
}

static extent extent_of(const cairn_pose_graph_file *file,
                        const cairn_pose_graph_solution *solution, int after)
{
    cairn_pose first = pose_of(file, solution, 0, after);
    extent e = {(double)first.x, (double)first.x, (double)first.y, (double)first.y};

    for (int32_t v = 1; v < file->vertex_count; v++) {
        cairn_pose pose = pose_of(file, solution, v, after);

        e.least_x = fmin(e.least_x, (double)pose.x);
        e.most_x = fmax(e.most_x, (double)pose.x);
        e.least_y = fmin(e.least_y, (double)pose.y);
        e.most_y = fmax(e.most_y, (double)pose.y);
    }
    return e;
}

static double side_of(extent e)
{
    return fmax(fmax(e.most_x - e.least_x, e.most_y - e.least_y), 1e-3);
}

static void print_links(cairn_output *output, const cairn_pose_graph_file *file,
                        const cairn_pose_graph_solution *solution, const view *v, int after,
                        int dropped)
{
    cairn_output_print(output, "<path class=\"%s\" d=\"", dropped ? "dropped" : "kept");
    for (int32_t e = 0; e < file->edge_count; e++) {
        cairn_pose a = pose_of(file, solution, file->edge[e].first, after);
        cairn_pose b = pose_of(file, solution, file->edge[e].second, after);

        if (solution->outlier[e] != dropped)
            continue;
        cairn_output_print(output, "M%.1f %.1fL%.1f %.1f",
                           v->left + PANEL / 2 + ((double)a.x - v->x) * v->scale,
                           TOP + PANEL / 2 - ((double)a.y - v->y) * v->scale,
                           v->left + PANEL / 2 + ((double)b.x - v->x) * v->scale,
                           TOP + PANEL / 2 - ((double)b.y - v->y) * v->scale);
    }
    cairn_output_print(output, "\"/>\n");
}

cairn_status cairn_pose_graph_file_draw(const char *path, const cairn_pose_graph_file *file,
                                        const cairn_pose_graph_solution *solution,
                                        const char *title, cairn_file_error *error)
{
    extent extents[2] = {extent_of(file, solution, 0), extent_of(file, solution, 1)};
    double scale = (PANEL - MARGIN) / fmax(side_of(extents[0]), side_of(extents[1]));
    double width = 2 * PANEL + 3 * MARGIN, height = PANEL + TOP + MARGIN;
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
        width, height, width, height, MARGIN);
    cairn_report_print_escaped(output, title);
    cairn_output_print(output, "</text>\n");
    for (int after = 0; after < 2; after++) {
        extent e = extents[after];
        view v = {MARGIN + after * (PANEL + MARGIN), scale, (e.least_x + e.most_x) / 2,
                  (e.least_y + e.most_y) / 2};

        cairn_output_print(output, "<text x=\"%.0f\" y=\"54\">%s: &#967;&#178; %.6g", v.left,
                           after ? "after" : "before",
                           after ? (double)solution->state.chi2 : solution->chi2_initial);
        if (after && solution->outliers > 0)
            cairn_output_print(output, " without %d links, red", (int)solution->outliers);
        cairn_output_print(output, "</text>\n");
        print_links(output, file, solution, &v, after, 1);
        print_links(output, file, solution, &v, after, 0);
    }
    cairn_output_print(output, "</svg>\n");
    return cairn_output_commit(output, error);
}
