/* force_field_iteration: one iteration of a force field, and the field's state, which force_field shares. */
#ifndef CAIRN_MAPPING_FORCE_FIELD_ITERATION_H
#define CAIRN_MAPPING_FORCE_FIELD_ITERATION_H

#include "cairn/force_field.h"

typedef int32_t cairn_force_phase;
enum { PHASE_AT_COMMIT, PHASE_PLACE, PHASE_CORNERS, PHASE_GRID, PHASE_MASSES, PHASE_PAIRS, PHASE_MOVE };

typedef int32_t cairn_force_stage;
enum { STAGE_SCAN, STAGE_SEGMENT, STAGE_POINTS };

struct cairn_force_placement {
    cairn_pose map_scan;
    cairn_force_field_motion motion;
};

/* Whether a scan stands still: `after` from iteration `from` on, `before` until then. */
struct cairn_force_fixing {
    uint32_t from;
    uint8_t before, after;
};

struct cairn_force_field {
    cairn_force_field_params params;
    cairn_force_kernel kernel;
    cairn_scan_set *set;
    cairn_box_sweep *sweep;
    cairn_corner_set *corners;                   /* NULL without roi */
    cairn_point_grid *grid;                      /* of the corners; NULL without roi */
    struct cairn_force_placement *placements[2]; /* [max_scans] each; placements[front] is committed */
    struct cairn_force_fixing *fixings;          /* [max_scans] */
    cairn_segment *segments;                     /* [max_segments], in the map */
    cairn_vec2 *directions;                      /* [max_segments], in the map */
    cairn_box *boxes;                            /* [max_segments], of the segment and its points in the map, grown */
    cairn_force_points points;                   /* [max_points] */

    int32_t front;
    int32_t committed; /* scans that have taken effect */
    int32_t reported;  /* scans whose forces the last iteration left in points.force */
    int32_t restart;   /* wanted at the next commit point */
    uint32_t revision;
    uint32_t clock;                /* iterations begun */
    cairn_force_field_state state; /* as committed, but units and worst_step */

    /* The iteration under way. */
    cairn_force_phase phase;
    cairn_force_stage stage;
    int32_t segment_count, point_count; /* of the committed scans */
    int32_t by_sensor;                  /* rotations are about the sensor */
    cairn_real sigma, dt;
    cairn_real margin;            /* m, half the reach: growth of boxes */
    int32_t scan, segment, point; /* cursors; in PHASE_PAIRS the segment and point of the row */
    int32_t other, next;          /* PHASE_PAIRS: the other segment, -1 between pairs, and its next point */
    int32_t row, row_end;         /* PHASE_PAIRS: the point whose row was begun, the end of the row */
    cairn_transform transform;    /* PHASE_PLACE: of the scan at hand */
    cairn_real cosine;            /* PHASE_PAIRS: of the segments at hand */
    cairn_force_sum sum;          /* PHASE_PAIRS: of the segments at hand */
    int64_t pairs;
    int32_t segment_pairs;
    cairn_real potential;
    cairn_real relocation; /* PHASE_MOVE: sum over the free scans */
    int32_t free_scans;    /* PHASE_MOVE: with points */
};

/* Lets all scans that were added take effect. */
void cairn_force_iteration_take_in(cairn_force_field *field);

/* Sets sigma, dt and the count against max_steps to the start. */
void cairn_force_iteration_start_cooling(cairn_force_field *field);

int32_t cairn_force_iteration_is_fixed(const cairn_force_field *field, int32_t scan);

/* Begins an iteration at a commit point. */
void cairn_force_iteration_begin(cairn_force_field *field);

/* One phase, or what the budget allows of it (CAIRN_MORE); the last one commits. */
CAIRN_CHECKED cairn_status cairn_force_iteration_step(cairn_force_field *field, cairn_budget *budget);

#endif
