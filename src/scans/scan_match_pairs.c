/* scan_match: correspondences of the shape modes for pictures: the filter stage of each, and
 * angular histograms. */
#include "src/base/build.h"

#include "src/scans/scan_match_shape.h"

static int is_done(const cairn_scan_match *match)
{
    return match != NULL && match->shape != NULL && match->state == SCAN_MATCH_DONE &&
           match->query.count > 0 && match->target_count > 0 && match->shape->rotations > 0;
}

int32_t cairn_scan_match_pair_count(const cairn_scan_match *match)
{
    return is_done(match) ? cairn_sequence_read(match->shape->sequence).count : 0;
}

/* Returns 1 when the segment of filtered pair k is selected; binary search. */
static int32_t is_in_selected_segment(const cairn_scan_match *match, int32_t k)
{
    const scan_match_shape *shape = match->shape;
    int32_t low = 0, high = shape->segment_count - 1;

    if (!cairn_scan_match_has_segment_filter(match))
        return 1;
    while (low < high) {
        int32_t middle = (low + high + 1) / 2;

        if (shape->segments[middle].first <= k)
            low = middle;
        else
            high = middle - 1;
    }
    return shape->segments[low].is_selected;
}

cairn_scan_match_pair cairn_scan_match_pair_at(const cairn_scan_match *match, int32_t index)
{
    const scan_match_shape *shape = match->shape;
    cairn_sequence_pair own = cairn_sequence_read(shape->sequence).pairs[index];
    cairn_scan_match_pair pair = {own.first, own.second, CAIRN_SCAN_MATCH_REJECTED_COLINEAR};
    int32_t low = 0, high = shape->pair_count;

    while (low < high) { /* the filtered pairs are in the same order */
        int32_t middle = (low + high) / 2;

        if (shape->pairs[middle].first < own.first)
            low = middle + 1;
        else
            high = middle;
    }
    if (low < shape->pair_count && shape->pairs[low].first == own.first)
        pair.stage = is_in_selected_segment(match, low) ? CAIRN_SCAN_MATCH_ACCEPTED
                                                        : CAIRN_SCAN_MATCH_REJECTED_SEGMENT;
    return pair;
}

cairn_pose cairn_scan_match_pair_pose(const cairn_scan_match *match)
{
    cairn_pose pose = cairn_pose_identity();

    if (!is_done(match))
        return pose;
    pose.x = match->shape->shift.x;
    pose.y = match->shape->shift.y;
    pose.theta = cairn_wrap_angle(match->shape->rotated_angle);
    return pose;
}

cairn_status cairn_scan_match_histogram(const cairn_scan_match *match, int32_t point,
                                        cairn_real share[CAIRN_SCAN_MATCH_BINS])
{
    if (match == NULL || share == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!is_done(match))
        return CAIRN_EMPTY;
    if (point < 0 || point >= match->query.count)
        return CAIRN_BAD_ARGUMENT;
    for (int32_t b = 0; b < SCAN_MATCH_SHAPE_BINS; b++)
        share[b] = (cairn_real)match->shape->query[point].bin[b] / 255;
    return CAIRN_OK;
}
