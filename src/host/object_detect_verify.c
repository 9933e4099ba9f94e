/* Detections verified by contour grouping (chapter 2).
 *
 * Method: the grouping walks with the same model over the same edges, at the sizes of the detections alone. What it groups where a detection
 * is says that there is one: the detection's score goes up in proportion to its evidence. */
#include "src/core/build.h"

#include <math.h>
#include <stdlib.h>

#include "cairn/contour_search.h"
#include "cairn/detection_curve.h"
#include "cairn/object_detect.h"

/* Boxes that share so much of their union are of one object. */
#define SAME 0.5
/* Sizes are looked for so much below the smallest and above the largest detection. */
#define ROOM 1.25

static int compare_scores(const void *a, const void *b)
{
    const cairn_detection *x = a, *y = b;

    if (x->score != y->score)
        return x->score < y->score ? 1 : -1;
    return x->first_outline - y->first_outline;
}

static void box_of(const cairn_contour_result *r, const cairn_contour_object *o, double box[4])
{
    box[0] = box[1] = HUGE_VAL;
    box[2] = box[3] = -HUGE_VAL;
    for (int32_t i = 0; i < o->outline_count; i++) {
        cairn_vec2 at = r->outline[o->first_outline + i].at.position;

        box[0] = fmin(box[0], (double)at.x);
        box[1] = fmin(box[1], (double)at.y);
        box[2] = fmax(box[2], (double)at.x);
        box[3] = fmax(box[3], (double)at.y);
    }
}

/* The most evidence of what is grouped where a detection is, to what the grouping asks for; 0: nothing is. */
static double evidence_at(const cairn_contour_result *r, const cairn_detection *d, double asked)
{
    const double own[4] = {(double)d->left, (double)d->top, (double)d->right, (double)d->bottom};
    double most = 0;

    for (int32_t i = 0; i < r->object_count; i++) {
        double box[4];

        box_of(r, &r->objects[i], box);
        if (cairn_detection_overlap(box, own) >= SAME)
            most = fmax(most, (double)r->objects[i].found.evidence / asked);
    }
    return most;
}

cairn_status cairn_detections_verify(cairn_detections *d, const cairn_contour_tokens *tokens,
                                     const cairn_shape_model *model, cairn_real weight, const char *path,
                                     cairn_file_error *error)
{
    cairn_contour_search_params params = cairn_contour_search_default(tokens->width, tokens->height);
    double asked = (double)params.min_evidence, least = HUGE_VAL, most = 0;
    cairn_contour_result grouped;
    cairn_status status;

    if (!(weight >= 0 && weight <= CAIRN_DETECT_VERIFY_MOST))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "a weight of verification of %g, expected 0 to %d", (double)weight,
                                    CAIRN_DETECT_VERIFY_MOST);
    for (int32_t i = 0; i < d->count; i++) {
        least = fmin(least, (double)d->found[i].size / ROOM);
        most = fmax(most, (double)d->found[i].size * ROOM);
    }
    params.min_size = cairn_max(params.min_size, (cairn_real)least);
    params.max_size = cairn_min(params.max_size, (cairn_real)most);
    params.min_evidence = 0;
    params.min_score = 0;
    if (!(weight > 0) || d->count == 0 || params.min_size > params.max_size)
        return CAIRN_OK;
    status = cairn_contour_search_run(&grouped, tokens, model, &params, path, error);
    if (status != CAIRN_OK)
        return status;
    for (int32_t i = 0; i < d->count; i++)
        d->found[i].score += (cairn_real)((double)weight * evidence_at(&grouped, &d->found[i], asked));
    cairn_contour_result_free(&grouped);
    qsort(d->found, (size_t)d->count, sizeof *d->found, compare_scores);
    return CAIRN_OK;
}
