/* Evaluation of detections: hits, precision and recall. */
#include <stdlib.h>
#include <string.h>

#include "bench/bench_detect.h"

static double overlap(const group_box *a, const cairn_object_detection *b)
{
    const cairn_real first[4] = {(cairn_real)a->left, (cairn_real)a->top, (cairn_real)a->right,
                                 (cairn_real)a->bottom};
    const cairn_real second[4] = {b->left, b->top, b->right, b->bottom};

    return (double)cairn_detection_curve_overlap(first, second);
}

int32_t detect_object(const group_image *truth, const cairn_object_detection *detection,
                      double *share)
{
    int32_t best = -1;

    *share = 0;
    for (int32_t i = 0; truth != NULL && i < truth->instances; i++)
        if (overlap(&truth->box[i], detection) > *share) {
            *share = overlap(&truth->box[i], detection);
            best = i;
        }
    return best;
}

/* 1 when a detection hits an object that is not assigned yet. */
static int take_object(const group_image *truth, const cairn_object_detection *d, int32_t criterion,
                       int32_t taken[GROUP_INSTANCES])
{
    double most = 0;
    int32_t best = -1;

    for (int32_t i = 0; truth != NULL && i < truth->instances; i++) {
        double share = overlap(&truth->box[i], d);

        if (!taken[i] && share > most) {
            most = share;
            best = i;
        }
    }
    if (best < 0 || !(criterion == DETECT_HALF ? most >= 0.5 : most > 0.2))
        return 0;
    taken[best] = 1;
    return 1;
}

int detect_tally_add(detect_tally *tally, const cairn_object_detection *found, int32_t count,
                     const group_image *truth)
{
    int32_t taken[DETECT_CRITERIA][GROUP_INSTANCES] = {{0}};
    detect_event *grown;

    if (tally->count + count > tally->capacity) {
        tally->capacity = 2 * (tally->count + count);
        grown = realloc(tally->events, (size_t)tally->capacity * sizeof *grown);
        if (grown == NULL)
            return 0;
        tally->events = grown;
    }
    for (int32_t i = 0; i < count; i++) {
        detect_event *e = &tally->events[tally->count++];

        e->score = (double)found[i].score;
        for (int32_t k = 0; k < DETECT_CRITERIA; k++)
            e->hit[k] = take_object(truth, &found[i], k, taken[k]);
    }
    tally->images++;
    tally->instances += truth != NULL ? truth->instances : 0;
    return 1;
}

void detect_tally_free(detect_tally *tally)
{
    free(tally->events);
    memset(tally, 0, sizeof *tally);
}

int detect_curve(const detect_tally *tally, int32_t criterion, cairn_detection_curve_point *points)
{
    cairn_detection_curve_event *events = malloc(((size_t)tally->count + 1) * sizeof *events);
    int ok;

    for (int32_t i = 0; i < tally->count && events != NULL; i++) {
        events[i].score = (cairn_real)tally->events[i].score;
        events[i].hit = tally->events[i].hit[criterion];
    }
    ok = events != NULL && cairn_detection_curve(events, tally->count, tally->images,
                                                 tally->instances, points, NULL) == CAIRN_OK;
    free(events);
    return ok;
}
