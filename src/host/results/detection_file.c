/* Writers of detections as JSON and as SVG over their image. */
#include "src/base/build.h"

#include <math.h>
#include <stdio.h>

#include "cairn/detection_file.h"
#include "cairn/output.h"
#include "src/host/pictures/report_overlay.h"
#include "src/host/results/contour_file_work.h"

/* Converts a coordinate of the searched image to pixels of the original image. */
static double image_x(const cairn_detection_file_picture *picture, cairn_real x)
{
    return contour_file_coordinate((double)x, picture->shrink);
}

void cairn_detection_file_box(const cairn_detection_file_picture *picture,
                              const cairn_object_detection *detection, double box[4])
{
    const double right = (double)picture->tokens->width * picture->shrink,
                 bottom = (double)picture->tokens->height * picture->shrink;

    box[0] = fmax(0, image_x(picture, detection->left));
    box[1] = fmax(0, image_x(picture, detection->top));
    box[2] = fmin(right, image_x(picture, detection->right));
    box[3] = fmin(bottom, image_x(picture, detection->bottom));
}

/* ---- JSON ---- */

/* The deformed outline, and which of its samples are unmatched. */
static void print_outline(cairn_output *output, const cairn_detection_file_picture *picture,
                          const cairn_object_detection *detection)
{
    const cairn_contour_search_place *outline =
        &picture->detections->outline[detection->first_outline];

    cairn_output_print(output, "\"outline\": [");
    for (int32_t i = 0; i < detection->outline_count; i++)
        cairn_output_print(output, "%s[%.2f, %.2f, %d]", i > 0 ? ", " : "",
                           image_x(picture, outline[i].point.position.x),
                           image_x(picture, outline[i].point.position.y), (int)outline[i].segment);
    cairn_output_print(output, "]");
}

/* The configuration: matched fragments of the model along chains, and the bundles without one. */
static void print_parts(cairn_output *output, const cairn_detection_file_picture *picture,
                        const cairn_object_detection *detection)
{
    const char *comma = "";

    cairn_output_print(output, "\"distance\": %.4f, \"agreement\": %.4f, \"parts\": [",
                       (double)detection->shape_distance, (double)detection->configuration_score);
    for (int32_t i = 0; i < detection->part_count; i++) {
        const cairn_object_detect_part *part =
            &picture->detections->parts[detection->first_part + i];

        cairn_output_print(output,
                           "%s{\"bundle\": %d, \"fragment\": %d, \"chain\": %d, \"reversed\": %s, "
                           "\"similarity\": %.4f, "
                           "\"from\": %.2f, \"to\": %.2f}",
                           i > 0 ? ", " : "", (int)part->bundle, (int)part->fragment,
                           (int)part->chain, part->reversed ? "true" : "false",
                           (double)part->similarity, (double)part->from * picture->shrink,
                           (double)part->to * picture->shrink);
    }
    cairn_output_print(output, "], \"missing\": [");
    for (int32_t bundle = 0; bundle < picture->detections->bundle_count; bundle++) {
        int is_missing = 1;

        for (int32_t i = 0; i < detection->part_count && is_missing; i++)
            is_missing = picture->detections->parts[detection->first_part + i].bundle != bundle;
        if (is_missing) {
            cairn_output_print(output, "%s%d", comma, (int)bundle);
            comma = ", ";
        }
    }
    cairn_output_print(output, "],\n   ");
}

static void print_detection(cairn_output *output, const cairn_detection_file_picture *picture,
                            const cairn_object_detection *detection)
{
    double box[4];

    cairn_detection_file_box(picture, detection, box);
    cairn_output_print(
        output,
        "  {\"score\": %.4f, \"rigid\": %.4f, \"bent\": %.4f, \"along\": %.4f, "
        "\"close\": %.4f, \"turned\": %.4f, \"strained\": %.4f, \"agreed\": %.4f, \"grouped\": "
        "%.4f, "
        "\"box\": [%.2f, %.2f, %.2f, %.2f], \"x\": %.2f, \"y\": %.2f, \"size\": %.2f, "
        "\"mirrored\": %s,\n   ",
        (double)detection->score, (double)detection->rigid_evidence,
        (double)detection->deformed_evidence, (double)detection->outline_coverage,
        (double)detection->edge_proximity, (double)detection->tangent_deviation,
        (double)detection->deformation, (double)detection->rigid_proximity,
        (double)detection->grouped_evidence, box[0], box[1], box[2], box[3],
        image_x(picture, detection->origin.x), image_x(picture, detection->origin.y),
        (double)detection->size * picture->shrink, detection->mirrored ? "true" : "false");
    if (picture->detections->has_appearance)
        cairn_output_print(output, "\"appearance\": %.4f, ", (double)detection->appearance);
    if (picture->detections->bundle_count > 0)
        print_parts(output, picture, detection);
    cairn_contour_file_print_segments(output, picture->tokens, picture->shrink,
                                      picture->detections->segments, detection->first_segment,
                                      detection->segment_count);
    cairn_output_print(output, ",\n   ");
    print_outline(output, picture, detection);
    cairn_output_print(output, "}");
}

cairn_status cairn_detection_file_write(const cairn_detection_file_picture *picture,
                                        const char *path, cairn_file_error *error)
{
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(output, "{\"image\": ");
    cairn_report_print_json(output, picture->image);
    cairn_output_print(output, ", \"model\": ");
    cairn_report_print_json(output, picture->model_name);
    cairn_output_print(
        output,
        ", \"width\": %d, \"height\": %d, \"shrink\": %d, \"chains\": %d, \"segments\": %d,\n"
        " \"detections\": [",
        (int)(picture->tokens->width * picture->shrink),
        (int)(picture->tokens->height * picture->shrink), (int)picture->shrink,
        (int)picture->tokens->chain_count, (int)picture->tokens->count);
    for (int32_t i = 0; i < picture->detections->count; i++) {
        cairn_output_print(output, "%s\n", i > 0 ? "," : "");
        print_detection(output, picture, &picture->detections->found[i]);
    }
    cairn_output_print(output, "]}\n");
    return cairn_output_commit(output, error);
}

/* ---- SVG ---- */

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
