/* force_field_iteration: one iteration of a force field, and the field's state, which the parts of force_field share. */
#ifndef CAIRN_MAPPING_FORCE_FIELD_ITERATION_H
#define CAIRN_MAPPING_FORCE_FIELD_ITERATION_H

#include "cairn/force_field.h"
#include "cairn/small_matrix.h"

/* In the order of an iteration. Between iterations the field is AT_COMMIT or, when scans have been released, in PACK. */
typedef int32_t cairn_force_phase;
enum {
    PHASE_AT_COMMIT,
    PHASE_PACK,
    PHASE_COMPARE,
    PHASE_MARK_OLD,
    PHASE_PLACE_EXTRA,
    PHASE_PLACE,
    PHASE_CORNERS,
    PHASE_UNGRID,
    PHASE_GRID,
    PHASE_MASSES,
    PHASE_MARK_NEW,
    PHASE_RESET,
    PHASE_PAIRS,
    PHASE_BALANCE,
    PHASE_MOVE
};

struct cairn_force_placement {
    cairn_pose map_scan;
    cairn_force_field_motion motion;
};

/* What the field holds of a scan, beside its placements. Forces and the like stay from one iteration to the next as long as
 * nothing near the scan changes. */
struct cairn_force_body {
    cairn_transform transform; /* of `placed` */
    cairn_pose placed;         /* where the scan was when its segments and points were last put into the map */
    cairn_vec2 centre, force;
    cairn_real torque;
    cairn_real potential; /* of all pairs that the scan takes part in */
    int64_t pairs;
    int32_t segment_pairs;
    uint32_t since, until; /* commit points from which on the scan is there, and is no longer */
    uint32_t fixed_from;   /* iteration from which on `fixed_after` holds, `fixed_before` until then */
    int32_t next_leaving;  /* the scan released before this one, -1: none */
    uint8_t fixed_before, fixed_after;
    uint8_t leaves;   /* until counts */
    uint8_t is_new;   /* not yet put into the map */
    uint8_t is_fixed; /* in the last iteration */
    uint8_t reported; /* took part in the last iteration */
    uint8_t moved;    /* this iteration: its pose, masses or fixing are not those of the last one */
    uint8_t dirty;    /* this iteration: its forces are computed anew */
};

/* No scan: of points from outside. */
enum { CAIRN_FORCE_NOBODY = -1 };

/* All springs between two scans. */
struct cairn_force_bond {
    int32_t first, second; /* scans; first may be NOBODY */
    int32_t next;          /* another bond with this second scan, -1: none */
    cairn_sym3 stiffness;  /* against a motion (x, y, turn) of first against second, about the centre of second */
    cairn_real pull[3];    /* force and torque on first; second feels the opposite */
};

/* A scan in the system of all springs; motions are (x, y, turn) about the centre. */
struct cairn_force_balance {
    int32_t bond, bonds; /* the last bond of which the scan is the second, -1: none; how many */
    cairn_sym3 diagonal; /* of the system, then its inverse; 0: the scan stays */
    cairn_real hold[3];  /* of it what holds the scan back where it is */
    cairn_real motion[3], residual[3], direction[3], image[3]; /* of conjugate gradients */
};

/* Conjugate gradients under way. */
struct cairn_force_solver {
    int32_t stage, next, round;
    cairn_real length, next_length, least_length; /* squares of residuals in the solver's metric */
    cairn_real curvature;                         /* along the direction */
};

/* Points from outside, in runs of one direction. */
struct cairn_force_extra {
    cairn_vec2 *position;  /* [max_extra] */
    cairn_real *weight;    /* [max_extra] */
    cairn_vec2 *direction; /* [max_extra], of each run */
    int32_t *first;        /* [max_extra + 1], points of each run */
    int32_t count, runs;
};

/* A few points of one line, and room for those that are made on the fly. */
struct cairn_force_tile {
    cairn_force_strip strip;
    cairn_vec2 position[CAIRN_FORCE_STRIP];
    cairn_real mass[CAIRN_FORCE_STRIP];
    cairn_box box;       /* of the points when the line has more than one tile */
    int32_t line, first; /* line -1: holds nothing */
};

/* A line: a segment of a scan, or a run of points from outside. */
struct cairn_force_line {
    int32_t index;   /* of its box */
    int32_t segment; /* below 0: a run */
    int32_t scan;    /* NOBODY: of a run */
    int32_t count;   /* points */
    cairn_vec2 direction;
};

/* A pair of lines at work. */
struct cairn_force_pair {
    struct cairn_force_line line[2];
    int32_t is_begun;
    int32_t due;     /* units for finding and ending it, to be paid first */
    int32_t tile[2]; /* first points of the tiles at hand */
    int32_t loaded;  /* of these tiles */
    cairn_force_cursor cursor;
    int32_t is_summed;
    cairn_real cosine; /* |cos| or what stands for it */
    cairn_force_sum sum;
    cairn_force_springs springs;
};

struct cairn_force_field {
    cairn_force_field_params params;
    cairn_force_kernel kernel;
    cairn_scan_set *set;
    cairn_box_sweep *sweep;
    cairn_corner_set *corners;                   /* NULL without roi */
    cairn_point_grid *grid;                      /* of the corners; NULL without roi */
    struct cairn_force_placement *placements[2]; /* [max_scans] each; placements[front] is committed */
    struct cairn_force_body *bodies;             /* [max_scans] */
    cairn_segment *segments;                     /* [max_segments], in the map */
    cairn_vec2 *directions;                      /* [max_segments], in the map */
    cairn_box *boxes;     /* [max_extra + max_segments], of the runs, then of the segments with their points, grown */
    cairn_vec2 *position; /* [max_points], in the map; NULL with spacing */
    cairn_real *mass;     /* [max_points], in the forces; NULL with spacing, that of the set without roi */
    uint32_t *in_region;  /* [max_points / 32 + 1], a bit for each point; NULL but with spacing and roi */
    struct cairn_force_extra extra[2];    /* extra[extra_front] is in use */
    struct cairn_force_bond *bonds;       /* [max_bonds]; NULL without springs */
    struct cairn_force_balance *balances; /* [max_scans]; NULL without springs */

    int32_t front, extra_front;
    int32_t extra_waits; /* the other extra is to be used from the next iteration on */
    int32_t slots;       /* those of scans that have taken effect are below */
    int32_t present;     /* scans, those that have not yet taken effect included */
    int32_t leaving;     /* the scan released last, -1: none */
    int32_t reported;    /* the places, boxes and masses of the last iteration are still there */
    int32_t restart;     /* wanted at the next commit point */
    uint32_t revision;
    uint32_t clock;                /* iterations begun */
    uint32_t commits;              /* and ended */
    cairn_force_field_state state; /* as committed, but units and worst_step */

    /* The iteration under way. */
    cairn_force_phase phase;
    int32_t paid;            /* units towards the item at hand */
    int32_t segment_count;   /* those of the scans that have taken effect */
    int32_t placed_segments; /* whose boxes are those of their last iteration */
    int32_t fresh;           /* all is computed anew */
    int32_t mixed;           /* some scans have moved, some have not */
    int32_t by_sensor;       /* rotations are about the sensor */
    cairn_real sigma, dt;
    cairn_real sigma_scale;       /* product of the factors so far */
    cairn_real placed_sigma;      /* of the boxes */
    cairn_real margin;            /* m, half the reach: growth of boxes */
    cairn_box free_box;           /* about the boxes of scans that are not fixed: only there anything attracts */
    int32_t scan, segment, point; /* cursors */
    int32_t moved, still;         /* COMPARE: scans */
    struct cairn_force_pair pair; /* PAIRS; MARK_OLD and MARK_NEW: scans and is_begun */
    struct cairn_force_tile tiles[2];
    int32_t bond_count, bonds_dropped; /* PAIRS */
    struct cairn_force_solver solver;  /* BALANCE */
    int64_t pairs;                     /* MOVE: sums over the scans */
    int64_t segment_pairs;
    cairn_real potential;
    cairn_real relocation; /* over the free scans */
    int32_t free_scans;    /* with points */
};

/* Lets all scans that were added take effect. */
void cairn_force_iteration_take_in(cairn_force_field *field);

/* Sets sigma, dt and the count against max_steps to the start. */
void cairn_force_iteration_start_cooling(cairn_force_field *field);

/* 1 between iterations, when inputs take effect at once. */
int32_t cairn_force_iteration_is_between(const cairn_force_field *field);

/* 1 when a scan has taken effect and was not released. */
int32_t cairn_force_iteration_has(const cairn_force_field *field, int32_t scan);

int32_t cairn_force_iteration_is_fixed(const cairn_force_field *field, int32_t scan);

/* Begins an iteration at a commit point. */
void cairn_force_iteration_begin(cairn_force_field *field);

/* One phase, or what the budget allows of it (CAIRN_MORE); the last one commits. */
CAIRN_CHECKED cairn_status cairn_force_iteration_step(cairn_force_field *field, cairn_budget *budget);

/* ---- force_field_params ---- */

int32_t cairn_force_params_are_valid(const cairn_force_field_params *params);

/* ---- force_field_move ---- */

/* Moves all scans and sums up what the iteration did. */
CAIRN_CHECKED cairn_status cairn_force_move(cairn_force_field *field, cairn_budget *budget);

/* Puts the centre of a scan and the like into the map. */
void cairn_force_place_scan(cairn_force_field *field, int32_t scan);

/* ---- force_field_springs ---- */

/* 1 when scans are joined by springs. */
int32_t cairn_force_has_springs(const cairn_force_field *field);

/* Forgets the springs of a scan. */
void cairn_force_unbind(cairn_force_field *field, int32_t scan);

/* Units to bind the pair of lines at hand. */
int32_t cairn_force_bind_cost(const cairn_force_field *field);

/* Adds the springs of the pair of lines at hand to the bond of their scans. */
void cairn_force_bind(cairn_force_field *field);

void cairn_force_balance_begin(cairn_force_field *field);

/* The motions that bring all springs to rest, to the accuracy of the solver. */
CAIRN_CHECKED cairn_status cairn_force_balance_step(cairn_force_field *field, cairn_budget *budget);

/* ---- force_field_pairs ---- */

/* points[0 ... count-1] = the points first ... of a segment in the map, where the last PLACE put their scan. */
void cairn_force_points(const cairn_force_field *field, int32_t segment, int32_t first, int32_t count,
                        cairn_vec2 *points);

/* Marks the scans that are near one that has moved. */
CAIRN_CHECKED cairn_status cairn_force_mark(cairn_force_field *field, cairn_budget *budget);

/* The forces of all pairs of lines that concern a dirty scan. */
CAIRN_CHECKED cairn_status cairn_force_pairs(cairn_force_field *field, cairn_budget *budget);

/* The force on a point of a segment in the last iteration, and its mass. */
cairn_vec2 cairn_force_at(const cairn_force_field *field, int32_t segment, int32_t index, cairn_real *mass);

#endif
