/* Contours as JSON. */
#include "src/base/build.h"

#include <math.h>

#include "src/host/base/degrees.h"
#include "src/host/pictures/report_text.h"
#include "src/host/results/contour_file_work.h"

/* Returns a coordinate of the searched picture in pixels of the image. */
static double image_x(const cairn_contour_file_picture *picture, cairn_real x)
{
    return contour_file_coordinate((double)x, picture->shrink);
}

static double image_length(const cairn_contour_file_picture *picture, cairn_real length)
{
    return (double)length * picture->shrink;
}

void cairn_contour_file_print_segments(cairn_output *output,
                                       const cairn_contour_search_tokens *tokens, int32_t shrink,
                                       const int32_t *segments, int32_t first, int32_t count)
{
    cairn_output_print(output, "\"segments\": [");
    for (int32_t i = 0; i < count; i++) {
        int32_t index = segments[first + i];
        cairn_segment line = tokens->lines[index];

        cairn_output_print(output,
                           "%s{\"id\": %d, \"chain\": %d, \"line\": [%.2f, %.2f, %.2f, %.2f]}",
                           i > 0 ? ", " : "", (int)index, (int)tokens->chain[index],
                           contour_file_coordinate((double)line.a.x, shrink),
                           contour_file_coordinate((double)line.a.y, shrink),
                           contour_file_coordinate((double)line.b.x, shrink),
                           contour_file_coordinate((double)line.b.y, shrink));
    }
    cairn_output_print(output, "]");
}

/* Prints the segments of one side along a path, without consecutive duplicates. */
static void print_side(cairn_output *output, const cairn_contour_search_disc *discs, int32_t count,
                       int32_t side)
{
    int32_t previous = -1, printed = 0;

    cairn_output_print(output, "\"%s\": [", side == 0 ? "left" : "right");
    for (int32_t k = 0; k < count; k++)
        if (discs[k].side[side] >= 0 && discs[k].side[side] != previous) {
            previous = discs[k].side[side];
            cairn_output_print(output, "%s%d", printed++ > 0 ? ", " : "", (int)previous);
        }
    cairn_output_print(output, "]");
}

/* Prints the paths. In the mode as written the walk of the particle filter is the only path. */
static void print_paths(cairn_output *output, const cairn_contour_file_picture *picture,
                        const cairn_contour_search_object *object)
{
    const cairn_shape_model_path walk = {.count = object->disc_count};
    int32_t count = object->outline_count > 0 ? picture->model->path_count : 1;

    cairn_output_print(output, "\"paths\": [");
    for (int32_t i = 0; i < count; i++) {
        const cairn_shape_model_path *path =
            object->outline_count > 0 ? &picture->model->paths[i] : &walk;
        const cairn_contour_search_disc *discs =
            &picture->result->discs[object->first_disc + path->first];

        cairn_output_print(output, "%s\n    {", i > 0 ? "," : "");
        print_side(output, discs, path->count, 0);
        cairn_output_print(output, ", ");
        print_side(output, discs, path->count, 1);
        cairn_output_print(output, ",\n     \"skeleton\": [");
        for (int32_t k = 0; k < path->count; k++)
            cairn_output_print(output, "%s[%.2f, %.2f, %.2f, %d, %d]", k > 0 ? ", " : "",
                               image_x(picture, discs[k].centre.x),
                               image_x(picture, discs[k].centre.y),
                               image_length(picture, discs[k].radius), discs[k].side[0] >= 0,
                               discs[k].side[1] >= 0);
        cairn_output_print(output, "]}");
    }
    cairn_output_print(output, "]");
}

/* Prints the unobserved stretches of the contour, as the deformed outline predicts them (amodal
 * completion). */
static void print_completed(cairn_output *output, const cairn_contour_file_picture *picture,
                            const cairn_contour_search_object *object)
{
    int32_t first, count, printed = 0;

    cairn_output_print(output, "\"completed\": [");
    for (int32_t from = 0;
         cairn_contour_search_completed(picture->result, object, from, &first, &count);
         from = first + count) {
        cairn_output_print(output, "%s[", printed++ > 0 ? ", " : "");
        for (int32_t i = first; i < first + count; i++) {
            cairn_vec2 at = picture->result->outline[object->first_outline + i].point.position;

            cairn_output_print(output, "%s[%.2f, %.2f]", i > first ? ", " : "",
                               image_x(picture, at.x), image_x(picture, at.y));
        }
        cairn_output_print(output, "]");
    }
    cairn_output_print(output, "]");
}

static void print_object(cairn_output *output, const cairn_contour_file_picture *picture,
                         const cairn_contour_search_object *object)
{
    cairn_output_print(
        output,
        "  {\"score\": %.4f, \"evidence\": %.2f, \"rigid\": %.2f, \"bent\": %.2f, \"close\": %.4f, "
        "\"turned\": %.4f, \"strained\": %.4f, \"x\": %.2f, \"y\": %.2f, \"size\": %.2f, "
        "\"turn_deg\": %.2f, \"mirrored\": %s, "
        "\"seen_samples\": %d, \"seen_share\": %.3f, \"start_sample\": %d,\n   ",
        (double)object->found.score, (double)object->found.evidence, (double)object->rigid_evidence,
        (double)object->deformed_evidence, (double)object->shape.edge_proximity,
        (double)object->shape.tangent_deviation, (double)object->shape.deformation,
        image_x(picture, object->found.origin.x), image_x(picture, object->found.origin.y),
        image_length(picture, object->found.size),
        CAIRN_DEGREES_PER_RADIAN * (double)object->found.turn, object->mirrored ? "true" : "false",
        (int)object->found.matched_samples,
        (double)object->found.matched_samples / picture->model->sample_count,
        (int)object->found.start_sample);
    cairn_contour_file_print_segments(output, picture->tokens, picture->shrink,
                                      picture->result->segments, object->found.first,
                                      object->found.count);
    cairn_output_print(output, ",\n   ");
    print_completed(output, picture, object);
    cairn_output_print(output, ",\n   ");
    print_paths(output, picture, object);
    cairn_output_print(output, "}");
}

/* Prints a number; null for a number that is not finite, which JSON does not have. */
static void print_number(cairn_output *output, const char *name, double value)
{
    if (isfinite(value))
        cairn_output_print(output, "\"%s\": %.6g", name, value);
    else
        cairn_output_print(output, "\"%s\": null", name);
}

/* Prints the trace of one run of the particle filter. */
static void print_trace(cairn_output *output, const cairn_contour_search_result *result,
                        int32_t mirrored)
{
    cairn_output_print(output, "  {\"mirrored\": %s, \"starts\": %d, ", mirrored ? "true" : "false",
                       (int)result->hypothesis_counts[mirrored]);
    if (result->mode == CAIRN_MODE_AS_WRITTEN)
        cairn_output_print(
            output,
            "\"points\": %d, \"points_dropped\": %d, \"candidates_dropped\": %d, \"end\": \"%s\", ",
            (int)result->point_count, (int)result->points_dropped, (int)result->candidates_dropped,
            cairn_contour_search_end_text(result->end_reason));
    cairn_output_print(output, "\"steps\": [");
    for (int32_t i = 0; i < result->steps[mirrored]; i++) {
        const cairn_contour_grouping_trace *step = &result->trace[mirrored][i];

        cairn_output_print(output, "%s\n    {", i > 0 ? "," : "");
        print_number(output, "n_eff", (double)step->n_eff);
        cairn_output_print(output, ", ");
        print_number(output, "log_likelihood", (double)step->log_likelihood);
        cairn_output_print(
            output, ", \"followers\": %d, \"resampled\": %s, \"particles\": %d, \"modes\": %d}",
            (int)step->followers, step->resampled ? "true" : "false", (int)step->particles,
            (int)result->mode_counts[mirrored][i]);
    }
    cairn_output_print(output, "]}");
}

cairn_status cairn_contour_file_write(const cairn_contour_file_picture *picture, const char *path,
                                      cairn_file_error *error)
{
    const cairn_contour_search_result *result = picture->result;
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(output, "{\"image\": ");
    cairn_report_print_json(output, picture->image);
    cairn_output_print(output, ", \"model\": ");
    cairn_report_print_json(output, picture->model_name);
    cairn_output_print(output,
                       ", \"width\": %d, \"height\": %d, \"shrink\": %d,\n \"chains\": %d, "
                       "\"segments\": %d, \"pool_bytes\": %zu, "
                       "\"verdict\": \"%s\", \"best_score\": %.4f, \"best_evidence\": %.2f,\n "
                       "\"objects\": [",
                       (int)(picture->tokens->width * picture->shrink),
                       (int)(picture->tokens->height * picture->shrink), (int)picture->shrink,
                       (int)picture->tokens->chain_count, (int)picture->tokens->count,
                       result->pool_bytes, result->object_count > 0 ? "found" : "none",
                       (double)result->best_score, (double)result->best_evidence);
    for (int32_t i = 0; i < result->object_count; i++) {
        cairn_output_print(output, "%s\n", i > 0 ? "," : "");
        print_object(output, picture, &result->objects[i]);
    }
    cairn_output_print(output, "],\n \"trace\": [");
    for (int32_t mirrored = 0; mirrored < 2 && result->trace[mirrored] != NULL; mirrored++) {
        cairn_output_print(output, "%s\n", mirrored > 0 ? "," : "");
        print_trace(output, result, mirrored);
    }
    cairn_output_print(output, "]}\n");
    return cairn_output_commit(output, error);
}
