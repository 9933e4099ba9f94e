/* Skeletons and region contours as JSON, and over their image as SVG. */
#include "src/base/build.h"

#include <stdio.h>

#include "cairn/output.h"
#include "cairn/skeleton_file.h"
#include "src/host/pictures/report_overlay.h"
#include "src/host/results/contour_file_work.h"

/* ---- JSON ---- */

/* A coordinate, a length in pixels of the image. */
static double coordinate_of(const cairn_skeleton_file_picture *picture, double at)
{
    return contour_file_coordinate(at, picture->shrink);
}

static double length_of(const cairn_skeleton_file_picture *picture, double length)
{
    return length * picture->shrink;
}

/* Prints a part as JSON. */
static void print_part(cairn_output *output, const cairn_skeleton_file_picture *picture,
                       int32_t index)
{
    const cairn_skeleton_grouping_part *part = &picture->result.parts[index];

    cairn_output_print(output,
                       "  {\"log_odds\": %.2f, \"object\": %d, \"joints\": [%d, %d], \"first\": "
                       "%d,\n   \"axis\": [",
                       (double)part->log_odds, (int)part->object, (int)part->joint[0],
                       (int)part->joint[1], (int)part->first);
    for (int32_t i = 0; i < part->count; i++) {
        const cairn_skeleton_grouping_point *point = &picture->result.points[part->first + i];

        cairn_output_print(output, "%s[%.2f, %.2f, %.2f]", i > 0 ? ", " : "",
                           coordinate_of(picture, (double)point->centre.x),
                           coordinate_of(picture, (double)point->centre.y),
                           length_of(picture, (double)point->radius));
    }
    for (int32_t side = 0; side < 2; side++) {
        cairn_output_print(output, "],\n   \"%s\": [", side == 0 ? "left" : "right");
        for (int32_t i = 0; i < part->count; i++) {
            const cairn_skeleton_grouping_point *point = &picture->result.points[part->first + i];

            cairn_output_print(output, "%s[%.2f, %.2f, %s]", i > 0 ? ", " : "",
                               coordinate_of(picture, (double)point->contact[side].x),
                               coordinate_of(picture, (double)point->contact[side].y),
                               point->edgel[side] >= 0 ? "true" : "false");
        }
    }
    cairn_output_print(output, "]}");
}

/* Prints a corner of pixels of the given size, which is half a pixel to the upper left of the centre
 * of the pixel with its indices. */
static void print_corner(cairn_output *output, const char *before, const char *between,
                         cairn_boundary_corner corner, int32_t size, const char *after)
{
    cairn_output_print(output, "%s%.1f%s%.1f%s", before, corner.x * size - 0.5, between,
                       corner.y * size - 0.5, after);
}

/* Returns 1 where a contour ends or changes direction. */
static int is_vertex(const cairn_boundary_contour *contour, const cairn_boundary_corner *corners,
                     int32_t i)
{
    const cairn_boundary_corner *previous = &corners[i > 0 ? i - 1 : contour->count - 1],
                                *next = &corners[i + 1 < contour->count ? i + 1 : 0];

    return (!contour->closed && (i == 0 || i == contour->count - 1)) ||
           (previous->x != next->x && previous->y != next->y) ||
           (previous->x == next->x && previous->y == next->y);
}

/* Prints a region contour as JSON. */
static void print_contour(cairn_output *output, const cairn_boundary_result *result, int32_t size,
                          int32_t index)
{
    const cairn_boundary_contour *contour = &result->contours[index];
    const cairn_boundary_corner *corners = &result->corners[contour->first];
    const char *comma = "";

    cairn_output_print(
        output, "  {\"strength\": %.2f, \"level\": %.2f, \"closed\": %s, \"points\": [",
        (double)contour->strength, (double)contour->level, contour->closed ? "true" : "false");
    for (int32_t i = 0; i < contour->count; i++)
        if (is_vertex(contour, corners, i)) {
            cairn_output_print(output, "%s", comma);
            print_corner(output, "[", ", ", corners[i], size, "]");
            comma = ", ";
        }
    cairn_output_print(output, "]}");
}

cairn_status cairn_skeleton_file_write(const cairn_skeleton_file_picture *picture, const char *path,
                                       cairn_file_error *error)
{
    const cairn_skeleton_grouping_result *result = &picture->result;
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(output, "{\"image\": ");
    cairn_report_print_json(output, picture->image);
    cairn_output_print(
        output,
        ", \"width\": %d, \"height\": %d, \"shrink\": %d, \"min_radius\": %.2f, \"max_radius\": "
        "%.2f, \"proposed\": %s,\n"
        " \"edgels\": %d, \"centres\": %d, \"lines\": %d, \"starts\": %d, "
        "\"left_out\": %d, \"verdict\": \"%s\",\n"
        " \"objects\": [",
        (int)(picture->width * picture->shrink), (int)(picture->height * picture->shrink),
        (int)picture->shrink, length_of(picture, (double)result->min_radius),
        length_of(picture, (double)result->max_radius), picture->proposed ? "true" : "false",
        (int)picture->edgel_count, (int)result->centre_count, (int)result->line_count,
        (int)result->seed_count, (int)result->dropped_seed_count,
        result->part_count > 0 ? "found" : "none");
    for (int32_t i = 0; i < result->object_count; i++)
        cairn_output_print(output, "%s\n  {\"log_odds\": %.2f, \"parts\": %d, \"free_ends\": %d}",
                           i > 0 ? "," : "", (double)result->objects[i].log_odds,
                           (int)result->objects[i].part_count,
                           (int)result->objects[i].free_end_count);
    cairn_output_print(output, "],\n \"parts\": [");
    for (int32_t i = 0; i < result->part_count; i++) {
        cairn_output_print(output, "%s\n", i > 0 ? "," : "");
        print_part(output, picture, i);
    }
    cairn_output_print(output, "],\n \"contours\": [");
    for (int32_t i = 0; i < picture->boundary.contour_count; i++) {
        cairn_output_print(output, "%s\n", i > 0 ? "," : "");
        print_contour(output, &picture->boundary, picture->shrink, i);
    }
    cairn_output_print(output, "]}\n");
    return cairn_output_commit(output, error);
}

/* ---- SVG ---- */

/* Prints the supported or the unsupported stretches of one side. */
static void print_side(cairn_output *output, const cairn_skeleton_grouping_point *points,
                       int32_t count, int32_t side, int supported)
{
    cairn_output_print(output, "<path class=\"%s\" d=\"", supported ? "contour" : "carried");
    for (int32_t i = 0; i + 1 < count; i++)
        if ((points[i].edgel[side] >= 0 && points[i + 1].edgel[side] >= 0) == supported)
            cairn_output_print(output, "M%.1f %.1fL%.1f %.1f", (double)points[i].contact[side].x,
                               (double)points[i].contact[side].y,
                               (double)points[i + 1].contact[side].x,
                               (double)points[i + 1].contact[side].y);
    cairn_output_print(output, "\"/>\n");
}

/* Prints the axis of a part and its connections to other parts. */
static void print_axis(cairn_output *output, const cairn_skeleton_file_picture *picture,
                       const cairn_skeleton_grouping_part *part)
{
    const cairn_skeleton_grouping_point *points = &picture->result.points[part->first];

    cairn_output_print(output, "<path class=\"axis\" d=\"");
    for (int32_t i = 0; i < part->count; i++)
        cairn_output_print(output, "%s%.1f %.1f", i == 0 ? "M" : "L", (double)points[i].centre.x,
                           (double)points[i].centre.y);
    for (int32_t end = 0; end < 2; end++)
        if (part->joint[end] >= 0) {
            cairn_vec2 from = points[end ? part->count - 1 : 0].centre,
                       to = picture->result.points[part->joint[end]].centre;

            cairn_output_print(output, "M%.1f %.1fL%.1f %.1f", (double)from.x, (double)from.y,
                               (double)to.x, (double)to.y);
        }
    cairn_output_print(output, "\"/>\n");
}

/* Prints all region contours. */
static void print_boundary(cairn_output *output, const cairn_boundary_result *result)
{
    if (result->contour_count == 0)
        return;
    cairn_output_print(output, "<path class=\"boundary\" d=\"");
    for (int32_t k = 0; k < result->contour_count; k++) {
        const cairn_boundary_contour *contour = &result->contours[k];
        const cairn_boundary_corner *corners = &result->corners[contour->first];
        const char *to = "M";

        for (int32_t i = 0; i < contour->count; i++)
            if (is_vertex(contour, corners, i)) {
                print_corner(output, to, " ", corners[i], 1, "");
                to = "L";
            }
        cairn_output_print(output, "%s", contour->closed ? "Z" : "");
    }
    cairn_output_print(output, "\"/>\n");
}

cairn_status cairn_skeleton_file_draw(const cairn_skeleton_file_picture *picture, const char *path,
                                      cairn_file_error *error)
{
    static const cairn_report_key keys[] = {
        {"contour", "stroke=\"#2563eb\""},
        {"unsupported", "stroke=\"#2563eb\" stroke-dasharray=\"3 4\""},
        {"axis", "stroke=\"#dc2626\""},
        {"between regions", "stroke=\"#16a34a\""}};
    char subtitle[256], style[400];
    const cairn_report_overlay overlay = {.title = picture->image,
                                          .subtitle = subtitle,
                                          .grey = picture->grey,
                                          .width = picture->width,
                                          .height = picture->height,
                                          .min_width = 640,
                                          .keys = keys,
                                          .key_count = sizeof keys / sizeof *keys,
                                          .key_step = 160};
    double scale = cairn_report_overlay_scale(&overlay);
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    (void)snprintf(
        subtitle, sizeof subtitle, "%d parts of %d objects, radii %.1f to %.1f px, %d edgels",
        (int)picture->result.part_count, (int)picture->result.object_count,
        length_of(picture, (double)picture->result.min_radius),
        length_of(picture, (double)picture->result.max_radius), (int)picture->edgel_count);
    (void)snprintf(
        style, sizeof style,
        "path{fill:none;stroke-linecap:round}.contour,.carried{stroke:#2563eb;stroke-width:%.2f}"
        ".carried{stroke-dasharray:%.2f}.axis{stroke:#dc2626;stroke-width:%.2f}"
        ".boundary{stroke:#16a34a;stroke-width:%.2f}",
        2.6 / scale, 5 / scale, 2.2 / scale, 1.4 / scale);
    status = cairn_report_overlay_begin(output, &overlay, style);
    print_boundary(output, &picture->boundary);
    for (int32_t i = 0; i < picture->result.part_count; i++) {
        const cairn_skeleton_grouping_part *part = &picture->result.parts[i];

        for (int32_t side = 0; side < 2; side++)
            for (int supported = 0; supported < 2; supported++)
                print_side(output, &picture->result.points[part->first], part->count, side,
                           supported);
        print_axis(output, picture, part);
    }
    return cairn_report_overlay_end(output, &overlay, status, path, error);
}

/* ---- SVG of centre points and lines ---- */

/* Returns the position of a radius within the range of radii, in percent. */
static int percent_of(const cairn_skeleton_grouping_result *result, cairn_real radius)
{
    cairn_real width = cairn_max(result->max_radius - result->min_radius, CAIRN_REAL(1e-3));

    return (int)(100 * cairn_min(cairn_max((radius - result->min_radius) / width, 0), 1));
}

cairn_status cairn_skeleton_file_draw_lines(const cairn_skeleton_file_picture *picture,
                                            const cairn_skeleton_grouping *skeleton,
                                            const char *path, cairn_file_error *error)
{
    static const cairn_report_key keys[] = {{"small radius", "stroke=\"rgb(0,0,255)\""},
                                            {"large radius", "stroke=\"rgb(255,0,0)\""},
                                            {"line", "stroke=\"#06b6d4\""}};
    char subtitle[256], style[200];
    const cairn_report_overlay overlay = {.title = picture->image,
                                          .subtitle = subtitle,
                                          .grey = picture->grey,
                                          .width = picture->width,
                                          .height = picture->height,
                                          .min_width = 640,
                                          .keys = keys,
                                          .key_count = sizeof keys / sizeof *keys,
                                          .key_step = 160};
    double scale = cairn_report_overlay_scale(&overlay);
    cairn_polyline_segment line;
    cairn_output *output;
    cairn_vec2 at;
    cairn_real radius;
    int32_t lines = 0;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    while (cairn_skeleton_grouping_mirror_line(skeleton, lines, &line))
        lines++;
    (void)snprintf(subtitle, sizeof subtitle,
                   "%d centre points, radii %.1f to %.1f px, %d of %d lines mirror symmetric",
                   (int)picture->result.centre_count,
                   length_of(picture, (double)picture->result.min_radius),
                   length_of(picture, (double)picture->result.max_radius), (int)lines,
                   (int)picture->result.line_count);
    (void)snprintf(style, sizeof style,
                   "path{fill:none;stroke-linecap:round;stroke-width:%.2f}.line{stroke:#06b6d4;"
                   "stroke-width:%.2f}",
                   2 / scale, 3 / scale);
    status = cairn_report_overlay_begin(output, &overlay, style);
    for (int32_t i = 0; cairn_skeleton_grouping_centre_point(skeleton, i, &at, &radius); i++) {
        int red = percent_of(&picture->result, radius);

        cairn_output_print(output, "<path stroke=\"rgb(%d%%,0%%,%d%%)\" d=\"M%.1f %.1fh0\"/>\n",
                           red, 100 - red, (double)at.x, (double)at.y);
    }
    for (int32_t i = 0; cairn_skeleton_grouping_mirror_line(skeleton, i, &line); i++)
        cairn_output_print(output, "<path class=\"line\" d=\"M%.1f %.1fL%.1f %.1f\"/>\n",
                           (double)line.a[0], (double)line.a[1], (double)line.b[0],
                           (double)line.b[1]);
    return cairn_report_overlay_end(output, &overlay, status, path, error);
}
