/* Detections as JSON. */
#include "src/base/build.h"

#include <math.h>

#include "cairn/detection_file.h"
#include "cairn/output.h"
#include "src/host/pictures/report_text.h"
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
