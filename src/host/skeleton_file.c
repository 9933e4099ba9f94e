/* Skeletons and contours between regions as JSON, and over their image as SVG. */
#include "src/core/build.h"

#include <stdio.h>

#include "cairn/output.h"
#include "cairn/skeleton_file.h"
#include "src/host/report_overlay.h"

/* ---- JSON ---- */

static void print_part(cairn_output *output, const cairn_skeleton_picture *p, int32_t part)
{
    const cairn_skeleton_part *s = &p->result.parts[part];

    cairn_output_print(output,
                       "  {\"log_odds\": %.2f, \"object\": %d, \"joints\": [%d, %d], \"first\": "
                       "%d,\n   \"axis\": [",
                       (double)s->log_odds, (int)s->object, (int)s->joint[0], (int)s->joint[1],
                       (int)s->first);
    for (int32_t i = 0; i < s->count; i++) {
        const cairn_skeleton_point *q = &p->result.points[s->first + i];

        cairn_output_print(output, "%s[%.2f, %.2f, %.2f]", i > 0 ? ", " : "", (double)q->centre.x,
                           (double)q->centre.y, (double)q->radius);
    }
    for (int32_t side = 0; side < 2; side++) {
        cairn_output_print(output, "],\n   \"%s\": [", side == 0 ? "left" : "right");
        for (int32_t i = 0; i < s->count; i++) {
            const cairn_skeleton_point *q = &p->result.points[s->first + i];

            cairn_output_print(output, "%s[%.2f, %.2f, %s]", i > 0 ? ", " : "",
                               (double)q->touch[side].x, (double)q->touch[side].y,
                               q->edgel[side] >= 0 ? "true" : "false");
        }
    }
    cairn_output_print(output, "]}");
}

/* Corners of pixels lie half a pixel up and left of the pixel that they are named after. */
static void print_corner(cairn_output *output, const char *before, const char *between,
                         cairn_boundary_corner corner, const char *after)
{
    cairn_output_print(output, "%s%.1f%s%.1f%s", before, corner.x - 0.5, between, corner.y - 0.5,
                       after);
}

/* Where a contour ends or turns. */
static int turns(const cairn_boundary_contour *c, const cairn_boundary_corner *q, int32_t i)
{
    const cairn_boundary_corner *last = &q[i > 0 ? i - 1 : c->count - 1],
                                *next = &q[i + 1 < c->count ? i + 1 : 0];

    return (!c->closed && (i == 0 || i == c->count - 1)) ||
           (last->x != next->x && last->y != next->y) || (last->x == next->x && last->y == next->y);
}

static void print_contour(cairn_output *output, const cairn_boundary_result *r, int32_t contour)
{
    const cairn_boundary_contour *c = &r->contours[contour];
    const cairn_boundary_corner *q = &r->corners[c->first];
    const char *comma = "";

    cairn_output_print(output,
                       "  {\"strength\": %.2f, \"level\": %.2f, \"closed\": %s, \"points\": [",
                       (double)c->strength, (double)c->level, c->closed ? "true" : "false");
    for (int32_t i = 0; i < c->count; i++)
        if (turns(c, q, i)) {
            cairn_output_print(output, "%s", comma);
            print_corner(output, "[", ", ", q[i], "]");
            comma = ", ";
        }
    cairn_output_print(output, "]}");
}

cairn_status cairn_skeleton_file_write(const cairn_skeleton_picture *p, const char *path,
                                       cairn_file_error *error)
{
    const cairn_skeleton_result *r = &p->result;
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(output, "{\"image\": ");
    cairn_report_print_json(output, p->image);
    cairn_output_print(output,
                       ", \"width\": %d, \"height\": %d, \"min_radius\": %.2f, \"max_radius\": "
                       "%.2f, \"proposed\": %s,\n"
                       " \"edgels\": %d, \"centres\": %d, \"lines\": %d, \"starts\": %d, "
                       "\"left_out\": %d, \"verdict\": \"%s\",\n"
                       " \"objects\": [",
                       (int)p->width, (int)p->height, (double)r->min_radius, (double)r->max_radius,
                       p->proposed ? "true" : "false", (int)p->edgel_count, (int)r->centres,
                       (int)r->lines, (int)r->starts, (int)r->left_out,
                       r->part_count > 0 ? "found" : "none");
    for (int32_t i = 0; i < r->object_count; i++)
        cairn_output_print(output, "%s\n  {\"log_odds\": %.2f, \"parts\": %d, \"free_ends\": %d}",
                           i > 0 ? "," : "", (double)r->objects[i].log_odds,
                           (int)r->objects[i].parts, (int)r->objects[i].free_ends);
    cairn_output_print(output, "],\n \"parts\": [");
    for (int32_t i = 0; i < r->part_count; i++) {
        cairn_output_print(output, "%s\n", i > 0 ? "," : "");
        print_part(output, p, i);
    }
    cairn_output_print(output, "],\n \"contours\": [");
    for (int32_t i = 0; i < p->boundary.contour_count; i++) {
        cairn_output_print(output, "%s\n", i > 0 ? "," : "");
        print_contour(output, &p->boundary, i);
    }
    cairn_output_print(output, "]}\n");
    return cairn_output_commit(output, error);
}

/* ---- SVG ---- */

/* Of one side the stretches that were seen, or those that were not. */
static void print_side(cairn_output *output, const cairn_skeleton_point *q, int32_t count,
                       int32_t side, int seen)
{
    cairn_output_print(output, "<path class=\"%s\" d=\"", seen ? "contour" : "carried");
    for (int32_t i = 0; i + 1 < count; i++)
        if ((q[i].edgel[side] >= 0 && q[i + 1].edgel[side] >= 0) == seen)
            cairn_output_print(output, "M%.1f %.1fL%.1f %.1f", (double)q[i].touch[side].x,
                               (double)q[i].touch[side].y, (double)q[i + 1].touch[side].x,
                               (double)q[i + 1].touch[side].y);
    cairn_output_print(output, "\"/>\n");
}

static void print_axis(cairn_output *output, const cairn_skeleton_picture *p,
                       const cairn_skeleton_part *s)
{
    const cairn_skeleton_point *q = &p->result.points[s->first];

    cairn_output_print(output, "<path class=\"axis\" d=\"");
    for (int32_t i = 0; i < s->count; i++)
        cairn_output_print(output, "%s%.1f %.1f", i == 0 ? "M" : "L", (double)q[i].centre.x,
                           (double)q[i].centre.y);
    for (int32_t end = 0; end < 2; end++)
        if (s->joint[end] >= 0) {
            cairn_vec2 from = q[end ? s->count - 1 : 0].centre,
                       to = p->result.points[s->joint[end]].centre;

            cairn_output_print(output, "M%.1f %.1fL%.1f %.1f", (double)from.x, (double)from.y,
                               (double)to.x, (double)to.y);
        }
    cairn_output_print(output, "\"/>\n");
}

/* All contours between regions. */
static void print_boundary(cairn_output *output, const cairn_boundary_result *r)
{
    if (r->contour_count == 0)
        return;
    cairn_output_print(output, "<path class=\"boundary\" d=\"");
    for (int32_t k = 0; k < r->contour_count; k++) {
        const cairn_boundary_contour *c = &r->contours[k];
        const cairn_boundary_corner *q = &r->corners[c->first];
        const char *to = "M";

        for (int32_t i = 0; i < c->count; i++)
            if (turns(c, q, i)) {
                print_corner(output, to, " ", q[i], "");
                to = "L";
            }
        cairn_output_print(output, "%s", c->closed ? "Z" : "");
    }
    cairn_output_print(output, "\"/>\n");
}

cairn_status cairn_skeleton_file_draw(const cairn_skeleton_picture *p, const char *path,
                                      cairn_file_error *error)
{
    static const cairn_report_key keys[] = {
        {"contour", "stroke=\"#2563eb\""},
        {"carried on", "stroke=\"#2563eb\" stroke-dasharray=\"3 4\""},
        {"axis", "stroke=\"#dc2626\""},
        {"between regions", "stroke=\"#16a34a\""}};
    char subtitle[256], style[400];
    const cairn_report_overlay overlay = {p->image,  subtitle, p->grey, p->width,
                                          p->height, 640,      keys,    sizeof keys / sizeof *keys,
                                          160};
    double scale = cairn_report_overlay_scale(&overlay);
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    (void)snprintf(subtitle, sizeof subtitle,
                   "%d parts of %d objects, radii %.1f to %.1f px, %d edgels",
                   (int)p->result.part_count, (int)p->result.object_count,
                   (double)p->result.min_radius, (double)p->result.max_radius, (int)p->edgel_count);
    (void)snprintf(
        style, sizeof style,
        "path{fill:none;stroke-linecap:round}.contour,.carried{stroke:#2563eb;stroke-width:%.2f}"
        ".carried{stroke-dasharray:%.2f}.axis{stroke:#dc2626;stroke-width:%.2f}"
        ".boundary{stroke:#16a34a;stroke-width:%.2f}",
        2.6 / scale, 5 / scale, 2.2 / scale, 1.4 / scale);
    status = cairn_report_overlay_begin(output, &overlay, style);
    print_boundary(output, &p->boundary);
    for (int32_t i = 0; i < p->result.part_count; i++) {
        const cairn_skeleton_part *s = &p->result.parts[i];

        for (int32_t side = 0; side < 2; side++)
            for (int seen = 0; seen < 2; seen++)
                print_side(output, &p->result.points[s->first], s->count, side, seen);
        print_axis(output, p, s);
    }
    return cairn_report_overlay_end(output, &overlay, status, path, error);
}

/* ---- SVG of what walks started from ---- */

/* Share of the range of radii, in percent. */
static int percent_of(const cairn_skeleton_result *r, cairn_real radius)
{
    cairn_real width = cairn_max(r->max_radius - r->min_radius, CAIRN_REAL(1e-3));

    return (int)(100 * cairn_min(cairn_max((radius - r->min_radius) / width, 0), 1));
}

cairn_status cairn_skeleton_file_draw_lines(const cairn_skeleton_picture *p,
                                            const cairn_skeleton *skeleton, const char *path,
                                            cairn_file_error *error)
{
    static const cairn_report_key keys[] = {{"small radius", "stroke=\"rgb(0,0,255)\""},
                                            {"large radius", "stroke=\"rgb(255,0,0)\""},
                                            {"line", "stroke=\"#06b6d4\""}};
    char subtitle[256], style[200];
    const cairn_report_overlay overlay = {p->image,  subtitle, p->grey, p->width,
                                          p->height, 640,      keys,    sizeof keys / sizeof *keys,
                                          160};
    double scale = cairn_report_overlay_scale(&overlay);
    cairn_polyline_segment line;
    cairn_output *output;
    cairn_vec2 at;
    cairn_real radius;
    int32_t lines = 0;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    while (cairn_skeleton_mirror_line(skeleton, lines, &line))
        lines++;
    (void)snprintf(subtitle, sizeof subtitle,
                   "%d centre points, radii %.1f to %.1f px, %d of %d lines mirror symmetric",
                   (int)p->result.centres, (double)p->result.min_radius,
                   (double)p->result.max_radius, (int)lines, (int)p->result.lines);
    (void)snprintf(style, sizeof style,
                   "path{fill:none;stroke-linecap:round;stroke-width:%.2f}.line{stroke:#06b6d4;"
                   "stroke-width:%.2f}",
                   2 / scale, 3 / scale);
    status = cairn_report_overlay_begin(output, &overlay, style);
    for (int32_t i = 0; cairn_skeleton_centre_point(skeleton, i, &at, &radius); i++) {
        int red = percent_of(&p->result, radius);

        cairn_output_print(output, "<path stroke=\"rgb(%d%%,0%%,%d%%)\" d=\"M%.1f %.1fh0\"/>\n",
                           red, 100 - red, (double)at.x, (double)at.y);
    }
    for (int32_t i = 0; cairn_skeleton_mirror_line(skeleton, i, &line); i++)
        cairn_output_print(output, "<path class=\"line\" d=\"M%.1f %.1fL%.1f %.1f\"/>\n",
                           (double)line.a[0], (double)line.a[1], (double)line.b[0],
                           (double)line.b[1]);
    return cairn_report_overlay_end(output, &overlay, status, path, error);
}
