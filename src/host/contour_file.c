/* Contours as JSON. */
#include "src/core/build.h"

#include <math.h>

#include "cairn/contour_file.h"
#include "cairn/output.h"
#include "src/host/report_text.h"

#define DEGREES 57.29577951308232

static double image_x(const cairn_contour_picture *p, cairn_real x)
{
    return ((double)x + 0.5) * p->shrink - 0.5;
}

static double image_length(const cairn_contour_picture *p, cairn_real length)
{
    return (double)length * p->shrink;
}

static void print_segments(cairn_output *output, const cairn_contour_picture *p,
                           const cairn_grouped_object *o)
{
    cairn_output_print(output, "\"segments\": [");
    for (int32_t i = 0; i < o->count; i++) {
        int32_t index = p->result->segments[o->first + i];
        cairn_segment line = p->tokens->lines[index];

        cairn_output_print(
            output, "%s{\"id\": %d, \"chain\": %d, \"line\": [%.2f, %.2f, %.2f, %.2f]}",
            i > 0 ? ", " : "", (int)index, (int)p->tokens->chain[index], image_x(p, line.a.x),
            image_x(p, line.a.y), image_x(p, line.b.x), image_x(p, line.b.y));
    }
    cairn_output_print(output, "]");
}

/* Segments of one side along a path, each once in a row. */
static void print_side(cairn_output *output, const cairn_contour_disc *discs, int32_t count,
                       int32_t side)
{
    int32_t before = -1, printed = 0;

    cairn_output_print(output, "\"%s\": [", side == 0 ? "left" : "right");
    for (int32_t k = 0; k < count; k++)
        if (discs[k].side[side] >= 0 && discs[k].side[side] != before) {
            before = discs[k].side[side];
            cairn_output_print(output, "%s%d", printed++ > 0 ? ", " : "", (int)before);
        }
    cairn_output_print(output, "]");
}

/* In the mode as written the walk is the only path. */
static void print_paths(cairn_output *output, const cairn_contour_picture *p,
                        const cairn_contour_object *o)
{
    const cairn_shape_path walk = {.count = o->disc_count};
    int32_t count = o->outline_count > 0 ? p->model->path_count : 1;

    cairn_output_print(output, "\"paths\": [");
    for (int32_t i = 0; i < count; i++) {
        const cairn_shape_path *path = o->outline_count > 0 ? &p->model->paths[i] : &walk;
        const cairn_contour_disc *discs = &p->result->discs[o->first_disc + path->first];

        cairn_output_print(output, "%s\n    {", i > 0 ? "," : "");
        print_side(output, discs, path->count, 0);
        cairn_output_print(output, ", ");
        print_side(output, discs, path->count, 1);
        cairn_output_print(output, ",\n     \"skeleton\": [");
        for (int32_t k = 0; k < path->count; k++)
            cairn_output_print(output, "%s[%.2f, %.2f, %.2f, %d, %d]", k > 0 ? ", " : "",
                               image_x(p, discs[k].centre.x), image_x(p, discs[k].centre.y),
                               image_length(p, discs[k].radius), discs[k].side[0] >= 0,
                               discs[k].side[1] >= 0);
        cairn_output_print(output, "]}");
    }
    cairn_output_print(output, "]");
}

/* What is not seen, as the bent outline predicts it. */
static void print_completed(cairn_output *output, const cairn_contour_picture *p,
                            const cairn_contour_object *o)
{
    int32_t first, count, printed = 0;

    cairn_output_print(output, "\"completed\": [");
    for (int32_t from = 0; cairn_contour_completed(p->result, o, from, &first, &count);
         from = first + count) {
        cairn_output_print(output, "%s[", printed++ > 0 ? ", " : "");
        for (int32_t i = first; i < first + count; i++) {
            cairn_vec2 at = p->result->outline[o->first_outline + i].at.position;

            cairn_output_print(output, "%s[%.2f, %.2f]", i > first ? ", " : "", image_x(p, at.x),
                               image_x(p, at.y));
        }
        cairn_output_print(output, "]");
    }
    cairn_output_print(output, "]");
}

static void print_object(cairn_output *output, const cairn_contour_picture *p,
                         const cairn_contour_object *o)
{
    cairn_output_print(
        output,
        "  {\"score\": %.4f, \"evidence\": %.2f, \"rigid\": %.2f, \"bent\": %.2f, \"close\": %.4f, "
        "\"turned\": %.4f, \"strained\": %.4f, \"x\": %.2f, \"y\": %.2f, \"size\": %.2f, "
        "\"turn_deg\": %.2f, \"mirrored\": %s, "
        "\"seen_samples\": %d, \"seen_share\": %.3f, \"start_sample\": %d,\n   ",
        (double)o->found.score, (double)o->found.evidence, (double)o->rigid, (double)o->bent,
        (double)o->shape.close, (double)o->shape.turned, (double)o->shape.strained,
        image_x(p, o->found.origin.x), image_x(p, o->found.origin.y),
        image_length(p, o->found.size), DEGREES * (double)o->found.turn,
        o->mirrored ? "true" : "false", (int)o->found.seen,
        (double)o->found.seen / p->model->sample_count, (int)o->found.start);
    print_segments(output, p, &o->found);
    cairn_output_print(output, ",\n   ");
    print_completed(output, p, o);
    cairn_output_print(output, ",\n   ");
    print_paths(output, p, o);
    cairn_output_print(output, "}");
}

/* Of numbers that are none JSON knows null. */
static void print_number(cairn_output *output, const char *name, double value)
{
    if (isfinite(value))
        cairn_output_print(output, "\"%s\": %.6g", name, value);
    else
        cairn_output_print(output, "\"%s\": null", name);
}

static void print_trace(cairn_output *output, const cairn_contour_result *r, int32_t mirrored)
{
    cairn_output_print(output, "  {\"mirrored\": %s, \"starts\": %d, ", mirrored ? "true" : "false",
                       (int)r->starts[mirrored]);
    if (r->mode == CAIRN_MODE_AS_WRITTEN)
        cairn_output_print(output, "\"points\": %d, \"points_dropped\": %d, \"end\": \"%s\", ",
                           (int)r->points, (int)r->points_dropped, cairn_contour_end_text(r->end));
    cairn_output_print(output, "\"steps\": [");
    for (int32_t i = 0; i < r->steps[mirrored]; i++) {
        const cairn_grouping_trace *t = &r->trace[mirrored][i];

        cairn_output_print(output, "%s\n    {", i > 0 ? "," : "");
        print_number(output, "n_eff", (double)t->n_eff);
        cairn_output_print(output, ", ");
        print_number(output, "log_likelihood", (double)t->log_likelihood);
        cairn_output_print(
            output, ", \"followers\": %d, \"resampled\": %s, \"particles\": %d, \"modes\": %d}",
            (int)t->followers, t->resampled ? "true" : "false", (int)t->particles,
            (int)r->modes[mirrored][i]);
    }
    cairn_output_print(output, "]}");
}

cairn_status cairn_contour_file_write(const cairn_contour_picture *p, const char *path,
                                      cairn_file_error *error)
{
    const cairn_contour_result *r = p->result;
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(output, "{\"image\": ");
    cairn_report_print_json(output, p->image);
    cairn_output_print(output, ", \"model\": ");
    cairn_report_print_json(output, p->model_name);
    cairn_output_print(output,
                       ", \"width\": %d, \"height\": %d, \"shrink\": %d,\n \"chains\": %d, "
                       "\"segments\": %d, \"pool_bytes\": %zu, "
                       "\"verdict\": \"%s\", \"best_score\": %.4f, \"best_evidence\": %.2f,\n "
                       "\"objects\": [",
                       (int)(p->tokens->width * p->shrink), (int)(p->tokens->height * p->shrink),
                       (int)p->shrink, (int)p->tokens->chains, (int)p->tokens->count, r->pool_bytes,
                       r->object_count > 0 ? "found" : "none", (double)r->best,
                       (double)r->best_evidence);
    for (int32_t i = 0; i < r->object_count; i++) {
        cairn_output_print(output, "%s\n", i > 0 ? "," : "");
        print_object(output, p, &r->objects[i]);
    }
    cairn_output_print(output, "],\n \"trace\": [");
    for (int32_t mirrored = 0; mirrored < 2 && r->trace[mirrored] != NULL; mirrored++) {
        cairn_output_print(output, "%s\n", mirrored > 0 ? "," : "");
        print_trace(output, r, mirrored);
    }
    cairn_output_print(output, "]}\n");
    return cairn_output_commit(output, error);
}
