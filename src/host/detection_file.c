/* Detections as JSON and as SVG over their image. */
#include "src/core/build.h"

#include <stdio.h>

#include "cairn/detection_file.h"
#include "cairn/output.h"
#include "src/host/report_overlay.h"

static double image_x(const cairn_detection_picture *p, cairn_real x)
{
    return ((double)x + 0.5) * p->shrink - 0.5;
}

void cairn_detection_box(const cairn_detection_picture *picture, const cairn_detection *detection,
                         double box[4])
{
    box[0] = image_x(picture, detection->left);
    box[1] = image_x(picture, detection->top);
    box[2] = image_x(picture, detection->right);
    box[3] = image_x(picture, detection->bottom);
}

/* ---- JSON ---- */

static void print_segments(cairn_output *output, const cairn_detection_picture *p,
                           const cairn_detection *d)
{
    cairn_output_print(output, "\"segments\": [");
    for (int32_t i = 0; i < d->segment_count; i++) {
        int32_t index = p->detections->segments[d->first_segment + i];
        cairn_segment line = p->tokens->lines[index];

        cairn_output_print(
            output, "%s{\"id\": %d, \"chain\": %d, \"line\": [%.2f, %.2f, %.2f, %.2f]}",
            i > 0 ? ", " : "", (int)index, (int)p->tokens->chain[index], image_x(p, line.a.x),
            image_x(p, line.a.y), image_x(p, line.b.x), image_x(p, line.b.y));
    }
    cairn_output_print(output, "]");
}

/* The outline where it lies, and which of its samples are not seen. */
static void print_outline(cairn_output *output, const cairn_detection_picture *p,
                          const cairn_detection *d)
{
    const cairn_contour_place *outline = &p->detections->outline[d->first_outline];

    cairn_output_print(output, "\"outline\": [");
    for (int32_t i = 0; i < d->outline_count; i++)
        cairn_output_print(output, "%s[%.2f, %.2f, %d]", i > 0 ? ", " : "",
                           image_x(p, outline[i].at.position.x),
                           image_x(p, outline[i].at.position.y), (int)outline[i].segment);
    cairn_output_print(output, "]");
}

/* The configuration: fragments of the model along chains, and the bundles of which there is
 * none. */
static void print_parts(cairn_output *output, const cairn_detection_picture *p,
                        const cairn_detection *d)
{
    const char *comma = "";

    cairn_output_print(output, "\"distance\": %.4f, \"agreement\": %.4f, \"parts\": [",
                       (double)d->distance, (double)d->agreement);
    for (int32_t i = 0; i < d->part_count; i++) {
        const cairn_detected_part *part = &p->detections->parts[d->first_part + i];

        cairn_output_print(output,
                           "%s{\"bundle\": %d, \"fragment\": %d, \"chain\": %d, \"reversed\": %s, "
                           "\"similarity\": %.4f, "
                           "\"from\": %.2f, \"to\": %.2f}",
                           i > 0 ? ", " : "", (int)part->bundle, (int)part->fragment,
                           (int)part->chain, part->reversed ? "true" : "false",
                           (double)part->similarity, (double)part->from * p->shrink,
                           (double)part->to * p->shrink);
    }
    cairn_output_print(output, "], \"missing\": [");
    for (int32_t bundle = 0; bundle < p->detections->bundles; bundle++) {
        int is_missing = 1;

        for (int32_t i = 0; i < d->part_count && is_missing; i++)
            is_missing = p->detections->parts[d->first_part + i].bundle != bundle;
        if (is_missing) {
            cairn_output_print(output, "%s%d", comma, (int)bundle);
            comma = ", ";
        }
    }
    cairn_output_print(output, "],\n   ");
}

static void print_detection(cairn_output *output, const cairn_detection_picture *p,
                            const cairn_detection *d)
{
    double box[4];

    cairn_detection_box(p, d, box);
    cairn_output_print(
        output,
        "  {\"score\": %.4f, \"rigid\": %.4f, \"bent\": %.4f, \"along\": %.4f, "
        "\"close\": %.4f, \"turned\": %.4f, \"strained\": %.4f, \"agreed\": %.4f, \"grouped\": "
        "%.4f, "
        "\"box\": [%.2f, %.2f, %.2f, %.2f], \"x\": %.2f, \"y\": %.2f, \"size\": %.2f, "
        "\"mirrored\": %s,\n   ",
        (double)d->score, (double)d->rigid, (double)d->bent, (double)d->along, (double)d->close,
        (double)d->turned, (double)d->strained, (double)d->agreed, (double)d->grouped, box[0],
        box[1], box[2], box[3], image_x(p, d->origin.x), image_x(p, d->origin.y),
        (double)d->size * p->shrink, d->mirrored ? "true" : "false");
    if (p->detections->has_appearance)
        cairn_output_print(output, "\"appearance\": %.4f, ", (double)d->appearance);
    if (p->detections->bundles > 0)
        print_parts(output, p, d);
    print_segments(output, p, d);
    cairn_output_print(output, ",\n   ");
    print_outline(output, p, d);
    cairn_output_print(output, "}");
}

cairn_status cairn_detection_file_write(const cairn_detection_picture *p, const char *path,
                                        cairn_file_error *error)
{
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(output, "{\"image\": ");
    cairn_report_print_json(output, p->image);
    cairn_output_print(output, ", \"model\": ");
    cairn_report_print_json(output, p->model_name);
    cairn_output_print(
        output,
        ", \"width\": %d, \"height\": %d, \"shrink\": %d, \"chains\": %d, \"segments\": %d,\n"
        " \"detections\": [",
        (int)(p->tokens->width * p->shrink), (int)(p->tokens->height * p->shrink), (int)p->shrink,
        (int)p->tokens->chains, (int)p->tokens->count);
    for (int32_t i = 0; i < p->detections->count; i++) {
        cairn_output_print(output, "%s\n", i > 0 ? "," : "");
        print_detection(output, p, &p->detections->found[i]);
    }
    cairn_output_print(output, "]}\n");
    return cairn_output_commit(output, error);
}

/* ---- SVG ---- */

/* The samples that are seen, or those that are not. */
static void draw_outline(cairn_output *output, const cairn_detection_picture *p,
                         const cairn_detection *d, int is_seen)
{
    const cairn_contour_place *outline = &p->detections->outline[d->first_outline];

    cairn_output_print(output, "<path class=\"%s\" d=\"", is_seen ? "seen" : "missing");
    for (int32_t i = 1; i < d->outline_count; i++)
        if (outline[i].part == outline[i - 1].part && (outline[i].segment >= 0) == is_seen)
            cairn_output_print(output, "M%.1f %.1fL%.1f %.1f", (double)outline[i - 1].at.position.x,
                               (double)outline[i - 1].at.position.y,
                               (double)outline[i].at.position.x, (double)outline[i].at.position.y);
    cairn_output_print(output, "\"/>\n");
}

static void draw_detection(cairn_output *output, const cairn_detection_picture *p,
                           const cairn_detection *d)
{
    cairn_output_print(output, "<path class=\"segment\" d=\"");
    for (int32_t i = 0; i < d->segment_count; i++) {
        cairn_segment line = p->tokens->lines[p->detections->segments[d->first_segment + i]];

        cairn_output_print(output, "M%.1f %.1fL%.1f %.1f", (double)line.a.x, (double)line.a.y,
                           (double)line.b.x, (double)line.b.y);
    }
    cairn_output_print(output, "\"/>\n");
    draw_outline(output, p, d, 1);
    draw_outline(output, p, d, 0);
    cairn_output_print(
        output,
        "<rect class=\"box\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>\n"
        "<text class=\"score\" x=\"%.1f\" y=\"%.1f\">%.2f</text>\n",
        (double)d->left, (double)d->top, (double)(d->right - d->left), (double)(d->bottom - d->top),
        (double)d->left, (double)d->top, (double)d->score);
}

cairn_status cairn_detection_file_draw(const cairn_detection_picture *p, const char *path,
                                       cairn_file_error *error)
{
    static const cairn_report_key keys[] = {
        {"edge segments along it", "stroke=\"#ea580c\""},
        {"outline, bent; dashed where not seen", "stroke=\"#7c3aed\""},
        {"box and score", "stroke=\"#dc2626\""}};
    char subtitle[256], style[320];
    const cairn_report_overlay overlay = {p->image,
                                          subtitle,
                                          p->grey,
                                          p->tokens->width,
                                          p->tokens->height,
                                          860,
                                          keys,
                                          sizeof keys / sizeof *keys,
                                          280};
    double scale = cairn_report_overlay_scale(&overlay);
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    (void)snprintf(subtitle, sizeof subtitle, "%d of %.120s; %d segments of %d chains",
                   (int)p->detections->count, p->model_name, (int)p->tokens->count,
                   (int)p->tokens->chains);
    (void)snprintf(
        style, sizeof style,
        "path,.box{fill:none}.segment{stroke:#ea580c;stroke-width:%.2f;stroke-linecap:round}"
        ".seen,.missing{stroke:#7c3aed;stroke-width:%.2f}.missing{stroke-dasharray:%.2f}"
        ".box{stroke:#dc2626;stroke-width:%.2f}.score{font-size:%.1fpx;fill:#dc2626}",
        2.6 / scale, 1.5 / scale, 4 / scale, 2 / scale, 18 / scale);
    status = cairn_report_overlay_begin(output, &overlay, style);
    for (int32_t i = 0; i < p->detections->count; i++)
        draw_detection(output, p, &p->detections->found[i]);
    return cairn_report_overlay_end(output, &overlay, status, path, error);
}
