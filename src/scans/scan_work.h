/* Private state and phases of the scan module. */
#ifndef CAIRN_MAPPING_SCAN_WORK_H
#define CAIRN_MAPPING_SCAN_WORK_H

#include "cairn/scan.h"
#include "src/base/object.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_scan_parameters;

typedef int32_t scan_phase;
enum {
    SCAN_BEAMS,     /* deskewed beams */
    SCAN_FIT,       /* line fit */
    SCAN_ATTRIBUTE, /* side and bearing of each segment */
    SCAN_TURN,      /* orientation and order */
    SCAN_CHOOSE,    /* segments within the capacity */
    SCAN_MARK,      /* support of the positions */
    SCAN_EMIT,      /* points and segments of the view */
    SCAN_DONE
};

/* A segment of the line fit. */
typedef struct scan_segment {
    cairn_segment segment;
    cairn_real length;
    cairn_real side;        /* sum over its hits; > 0: the sensors are on the left */
    cairn_real first_angle; /* rad, smallest bearing of its hits */
    int32_t first_position; /* index of its first position in support */
    int32_t positions;      /* positions of resampled points; 0: left out */
} scan_segment;

struct cairn_scan {
    cairn_scan_params params;
    cairn_polyline *polyline;
    float *range, *angle;
    cairn_scan_beam *beams;
    int32_t *hit; /* [max_beams] beam of each hit */
    scan_segment *fitted;
    int32_t *order; /* [max_segments] segments of the fit, in the order of the view */
    /* [max_points + 1] difference array: changes of the number of hits that support a position */
    int32_t *support;
    cairn_segment *segments;
    int32_t *first_point;
    cairn_oriented_point *points;

    cairn_scan_input input; /* without its arrays */
    cairn_twist twist;      /* twist of the motion */
    int32_t hit_count, fitted_count, position_count, segment_count, point_count;
    int64_t total; /* resampling positions of all segments */
    cairn_scan_view view;
    cairn_scan_measure measure;

    scan_phase phase;
    int32_t item_index, inner_index, stage, support_count;
    int32_t eighths; /* eighths of a unit, used but not yet charged */
};

/* Charges `eighths` of a unit; 0 when the budget is used up and the item must wait. */
static inline int cairn_scan_charge(cairn_scan *scan, cairn_budget *budget, int32_t eighths)
{
    if (budget->left <= 0)
        return 0;
    scan->eighths += eighths;
    budget->left -= scan->eighths / 8;
    scan->measure.units += scan->eighths / 8;
    scan->eighths %= 8;
    return 1;
}

/* The phases after the line fit. Each returns CAIRN_OK at its end, CAIRN_MORE when the budget is
 * used up. */
cairn_status cairn_scan_attribute(cairn_scan *scan, cairn_budget *budget);
cairn_status cairn_scan_turn(cairn_scan *scan, cairn_budget *budget);
cairn_status cairn_scan_choose(cairn_scan *scan, cairn_budget *budget);
cairn_status cairn_scan_mark(cairn_scan *scan, cairn_budget *budget);
cairn_status cairn_scan_emit(cairn_scan *scan, cairn_budget *budget);

#endif
