/* What the files of the scan room share. */
#ifndef CAIRN_MAPPING_SCAN_WORK_H
#define CAIRN_MAPPING_SCAN_WORK_H

#include "cairn/scan.h"

typedef enum scan_phase {
    SCAN_BEAMS,
    SCAN_FIT,
    SCAN_ATTRIBUTE,
    SCAN_TURN,
    SCAN_CHOOSE,
    SCAN_MARK,
    SCAN_EMIT,
    SCAN_DONE
} scan_phase;

/* What becomes of a segment of the fit. */
typedef struct scan_wall {
    cairn_segment segment;
    cairn_real length;
    cairn_real side;        /* > 0: the sensors are on the left */
    cairn_real first_angle; /* smallest of its hits */
    int32_t first_place;    /* its first one in `support` */
    int32_t places;         /* 0: left out */
} scan_wall;

struct cairn_scan {
    cairn_scan_params params;
    cairn_polyline *polyline;
    float *range, *angle;
    cairn_beam *beams;
    int32_t *hit; /* [max_beams] beam of each hit */
    scan_wall *walls;
    int32_t *order;   /* [max_segments] walls in the order of the view */
    int32_t *support; /* [max_points + 1] differences of the number of hits that support a place */
    cairn_segment *segments;
    int32_t *first_point;
    cairn_oriented_point *points;

    cairn_scan_input input; /* without its arrays */
    cairn_twist twist;      /* of the motion */
    int32_t hit_count, wall_count, place_count, segment_count, point_count;
    int64_t total; /* of places */
    cairn_scan_view view;
    cairn_scan_measure measure;

    scan_phase phase;
    int32_t at, other, stage, running;
    int32_t part; /* eighths of a unit that are used but not yet charged */
};

/* Charges `eighths` of a unit; 0 when the budget is used up and the item at hand must wait. */
static inline int scan_pay(cairn_scan *x, cairn_budget *budget, int32_t eighths)
{
    if (budget->left <= 0)
        return 0;
    x->part += eighths;
    budget->left -= x->part / 8;
    x->measure.units += x->part / 8;
    x->part %= 8;
    return 1;
}

/* The phases behind the fit; CAIRN_OK when one is through, CAIRN_MORE when the budget is used
 * up. */
cairn_status cairn_scan_attribute(cairn_scan *x, cairn_budget *budget);
cairn_status cairn_scan_turn(cairn_scan *x, cairn_budget *budget);
cairn_status cairn_scan_choose(cairn_scan *x, cairn_budget *budget);
cairn_status cairn_scan_mark(cairn_scan *x, cairn_budget *budget);
cairn_status cairn_scan_emit(cairn_scan *x, cairn_budget *budget);

#endif
