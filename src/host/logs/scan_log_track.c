/* Poses of odometry by time. */
#include "src/base/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/logs/log_interpolation.h"
#include "src/host/logs/scan_log_work.h"

cairn_status cairn_scan_log_track_add(cairn_scan_log_track *track, int64_t stamp_ns,
                                      const cairn_ros_transform *pose)
{
    const double *q = pose->rotation;
    cairn_scan_log_sample *grown;

    if (track->count == track->capacity) {
        int32_t capacity = track->capacity > 0 ? 2 * track->capacity : 256;

        if (track->capacity > INT32_MAX / 2)
            return CAIRN_FULL;
        grown = realloc(track->sample, (size_t)capacity * sizeof *grown);
        if (grown == NULL)
            return CAIRN_NO_MEMORY;
        track->sample = grown;
        track->capacity = capacity;
    }
    grown = &track->sample[track->count];
    grown->stamp_ns = stamp_ns;
    grown->order = track->count++;
    grown->x = pose->translation[0];
    grown->y = pose->translation[1];
    grown->theta = atan2(2 * (q[0] * q[1] + q[2] * q[3]), 1 - 2 * (q[1] * q[1] + q[2] * q[2]));
    return CAIRN_OK;
}

static int by_time(const void *first, const void *second)
{
    const cairn_scan_log_sample *a = first, *b = second;

    if (a->stamp_ns != b->stamp_ns)
        return a->stamp_ns < b->stamp_ns ? -1 : 1;
    return a->order < b->order ? -1 : a->order > b->order;
}

void cairn_scan_log_track_sort(cairn_scan_log_track *track)
{
    if (track->count > 1)
        qsort(track->sample, (size_t)track->count, sizeof *track->sample, by_time);
}

static cairn_pose pose_of(const cairn_scan_log_sample *sample)
{
    cairn_pose pose = {(cairn_real)sample->x, (cairn_real)sample->y, (cairn_real)sample->theta};

    return pose;
}

cairn_pose cairn_scan_log_track_at(const cairn_scan_log_track *track, int64_t stamp_ns)
{
    const cairn_scan_log_sample *sample = track->sample;
    int32_t from = 0, to = track->count;
    cairn_pose a;

    /* [from, to): the samples that may be the first one after the time */
    while (from < to) {
        int32_t middle = from + (to - from) / 2;

        if (sample[middle].stamp_ns <= stamp_ns)
            from = middle + 1;
        else
            to = middle;
    }
    if (from == 0)
        return pose_of(&sample[0]);
    a = pose_of(&sample[from - 1]);
    if (from == track->count || sample[from - 1].stamp_ns == stamp_ns)
        return a;
    return log_pose_between(a, sample[from - 1].stamp_ns, pose_of(&sample[from]),
                            sample[from].stamp_ns, stamp_ns);
}

void cairn_scan_log_track_free(cairn_scan_log_track *track)
{
    free(track->sample);
    memset(track, 0, sizeof *track);
}
