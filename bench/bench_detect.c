#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_detect.h"

#define WILSON_Z 1.96

static double overlap(const group_box *a, const cairn_detection *b)
{
    double w = fmin(a->right, (double)b->right) - fmax(a->left, (double)b->left);
    double h = fmin(a->bottom, (double)b->bottom) - fmax(a->top, (double)b->top), both = w > 0 && h > 0 ? w * h : 0;

    return both / ((a->right - a->left) * (a->bottom - a->top) +
                   (double)(b->right - b->left) * (double)(b->bottom - b->top) - both);
}

int32_t detect_object(const group_image *truth, const cairn_detection *detection, double *share)
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

/* 1 when a detection hits an object that is still free. */
static int take_object(const group_image *truth, const cairn_detection *d, int32_t criterion,
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

int detect_tally_add(detect_tally *tally, const cairn_detection *found, int32_t count, const group_image *truth)
{
    int32_t taken[DETECT_CRITERIA][GROUP_INSTANCES] = {{0}};
    detect_event *grown;

    if (tally->count + count > tally->room) {
        tally->room = 2 * (tally->count + count);
        grown = realloc(tally->events, (size_t)tally->room * sizeof *grown);
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

/* False ones before true ones of the same score: nothing is won by ties. */
static int compare_events(const void *a, const void *b)
{
    const detect_event *x = a, *y = b;

    if (x->score != y->score)
        return x->score < y->score ? 1 : -1;
    return x->hit[0] + x->hit[1] - y->hit[0] - y->hit[1];
}

void detect_interval(double share, int32_t count, double *low, double *high)
{
    double n = count > 0 ? count : 1, z2 = WILSON_Z * WILSON_Z, centre = (share + z2 / (2 * n)) / (1 + z2 / n);
    double half = WILSON_Z / (1 + z2 / n) * sqrt(share * (1 - share) / n + z2 / (4 * n * n));

    *low = fmax(0, centre - half);
    *high = fmin(1, centre + half);
}

void detect_curve(detect_tally *tally, int32_t criterion, detect_point *points)
{
    int32_t hits = 0;

    if (tally->count > 1)
        qsort(tally->events, (size_t)tally->count, sizeof *tally->events, compare_events);
    for (int32_t i = 0; i < tally->count; i++) {
        hits += tally->events[i].hit[criterion];
        points[i].recall = (double)hits / (tally->instances > 0 ? tally->instances : 1);
        points[i].precision = (double)hits / (i + 1);
        points[i].false_per_image = (double)(i + 1 - hits) / (tally->images > 0 ? tally->images : 1);
        points[i].instances = tally->instances;
        points[i].detections = i + 1;
    }
}

double detect_rate_at(const detect_point *points, int32_t count, double false_per_image)
{
    double rate = 0;

    for (int32_t i = 0; i < count && points[i].false_per_image <= false_per_image; i++)
        rate = points[i].recall;
    return rate;
}

double detect_precision_at(const detect_point *points, int32_t count, double recall)
{
    double best = 0;

    for (int32_t i = 0; i < count; i++)
        if (points[i].recall >= recall - 1e-9)
            best = fmax(best, points[i].precision);
    return best;
}

double detect_average_precision(const detect_point *points, int32_t count)
{
    double sum = 0;

    for (int32_t k = 0; k <= 10; k++)
        sum += detect_precision_at(points, count, k / 10.0);
    return sum / 11;
}
