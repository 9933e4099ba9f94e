/* Drawing of detections over their image. */
#include "src/base/build.h"

#include <stdio.h>

#include "cairn/detection_file.h"
#include "cairn/output.h"
#include "src/host/pictures/report_overlay.h"

/* Draws the matched samples, or the unmatched ones. */
static void draw_outline(cairn_output *output, const cairn_detection_file_picture *picture,
                         const cairn_object_detection *detection, int is_seen)
{
    const cairn_contour_search_place *outline =
        &picture->detections->outline[detection->first_outline];

    cairn_output_print(output, "<path class=\"%s\" d=\"", is_seen ? "seen" : "missing");
    for (int32_t i = 1; i < detection->outline_count; i++)
        if (outline[i].outline_index == outline[i - 1].outline_index &&
            (outline[i].segment >= 0) == is_seen)
            cairn_output_print(
                output, "M%.1f %.1fL%.1f %.1f", (double)outline[i - 1].point.position.x,
                (double)outline[i - 1].point.position.y, (double)outline[i].point.position.x,
                (double)outline[i].point.position.y);
    cairn_output_print(output, "\"/>\n");
}

static void draw_detection(cairn_output *output, const cairn_detection_file_picture *picture,
                           const cairn_object_detection *detection)
{
    cairn_output_print(output, "<path class=\"segment\" d=\"");
    for (int32_t i = 0; i < detection->segment_count; i++) {
        cairn_segment line =
            picture->tokens->lines[picture->detections->segments[detection->first_segment + i]];

        cairn_output_print(output, "M%.1f %.1fL%.1f %.1f", (double)line.a.x, (double)line.a.y,
                           (double)line.b.x, (double)line.b.y);
    }
    cairn_output_print(output, "\"/>\n");
    draw_outline(output, picture, detection, 1);
    draw_outline(output, picture, detection, 0);
    cairn_output_print(
        output,
        "<rect class=\"box\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>\n"
        "<text class=\"score\" x=\"%.1f\" y=\"%.1f\">%.2f</text>\n",
        (double)detection->left, (double)detection->top,
        (double)(detection->right - detection->left), (double)(detection->bottom - detection->top),
        (double)detection->left, (double)detection->top, (double)detection->score);
}

cairn_status cairn_detection_file_draw(const cairn_detection_file_picture *picture,
                                       const char *path, cairn_file_error *error)
{
    static const cairn_report_key keys[] = {
        {"edge segments along it", "stroke=\"#ea580c\""},
        {"deformed outline; dashed where no edge matches", "stroke=\"#7c3aed\""},
        {"box and score", "stroke=\"#dc2626\""}};
    char subtitle[256], style[320];
    const cairn_report_overlay overlay = {.title = picture->image,
                                          .subtitle = subtitle,
                                          .grey = picture->grey,
                                          .width = picture->tokens->width,
                                          .height = picture->tokens->height,
                                          .min_width = 860,
                                          .keys = keys,
                                          .key_count = sizeof keys / sizeof *keys,
                                          .key_step = 280};
    double scale = cairn_report_overlay_scale(&overlay);
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    (void)snprintf(subtitle, sizeof subtitle, "%d of %.120s; %d segments of %d chains",
                   (int)picture->detections->count, picture->model_name,
                   (int)picture->tokens->count, (int)picture->tokens->chain_count);
    (void)snprintf(
        style, sizeof style,
        "path,.box{fill:none}.segment{stroke:#ea580c;stroke-width:%.2f;stroke-linecap:round}"
        ".seen,.missing{stroke:#7c3aed;stroke-width:%.2f}.missing{stroke-dasharray:%.2f}"
        ".box{stroke:#dc2626;stroke-width:%.2f}.score{font-size:%.1fpx;fill:#dc2626}",
        2.6 / scale, 1.5 / scale, 4 / scale, 2 / scale, 18 / scale);
    status = cairn_report_overlay_begin(output, &overlay, style);
    for (int32_t i = 0; i < picture->detections->count; i++)
        draw_detection(output, picture, &picture->detections->found[i]);
    return cairn_report_overlay_end(output, &overlay, status, path, error);
}
