/* force_field_iteration: one iteration of a force field, and the field's state, which the parts
 * of force_field share. */
#ifndef CAIRN_MAPPING_FORCE_FIELD_ITERATION_H
#define CAIRN_MAPPING_FORCE_FIELD_ITERATION_H

#include "cairn/force_field.h"
#include "cairn/small_matrix.h"

/* In the order of an iteration. Between iterations the field is AT_COMMIT or, when scans have
 * been released, in PACK. */
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
    PHASE_SOLVE,
    PHASE_MOVE
};

struct cairn_force_placement {
    cairn_pose map_scan;
    cairn_force_field_motion motion;
};

/* What the field holds of a scan, beside its placements. Forces and the like stay from one
 * iteration to the next as long as nothing near the scan changes. */
struct cairn_force_body {
    /* of `placed` */
    cairn_transform transform;
    /* where the scan was when its segments and points were last put into the map */
    cairn_pose placed;
    cairn_vec2 centre, force;
    cairn_real torque;
    /* of all pairs that the scan takes part in */
    cairn_real potential;
    int64_t pairs;
    int32_t segment_pairs;
    /* commit points from which on the scan is there, and is no longer */
    uint32_t active_from, active_until;
    /* iteration from which on `fixed_after` holds, `fixed_before` until then */
    uint32_t fixed_from;
    /* the scan released before this one, -1: none */
    int32_t next_leaving;
    uint8_t fixed_before, fixed_after;
    /* until counts */
    uint8_t is_leaving;
    /* not yet put into the map */
    uint8_t is_new;
    /* in the last iteration */
    uint8_t is_fixed;
    /* took part in the last iteration */
    uint8_t has_forces;
    /* this iteration: its pose, masses or fixing are not those of the last one */
    uint8_t moved;
    /* this iteration: its forces are computed anew */
    uint8_t dirty;
};

/* No scan: of points from outside. */
enum { CAIRN_FORCE_NO_SCAN = -1 };

/* All springs between two scans. */
struct cairn_force_bond {
    /* scans; first may be NOBODY */
    int32_t first, second;
    /* another bond with this second scan, -1: none */
    int32_t next;
    /* against a motion (x, y, turn) of first against second, about the centre of second */
    cairn_sym3 stiffness;
    /* force and torque on first; second feels the opposite */
    cairn_real wrench[3];
};

/* A scan in the system of all springs; motions are (x, y, turn) about the centre. */
struct cairn_force_unknown {
    int32_t last_bond,
        bond_count;        /* the last bond of which the scan is the second, -1: none; how many */
    cairn_sym3 diagonal;   /* of the system, then its inverse; 0: the scan stays */
    cairn_real damping[3]; /* of it what holds the scan back where it is */
    cairn_real motion[3], residual[3], direction[3], product[3]; /* of conjugate gradients */
};

/* Conjugate gradients under way. */
struct cairn_force_solver {
    int32_t stage, next_item, iteration;
    cairn_real residual2, next_residual2,
        min_residual2;    /* squares of residuals in the solver's metric */
    cairn_real curvature; /* along the direction */
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
    int32_t units_due;     /* units for finding and ending it, to be paid first */
    int32_t tile_first[2]; /* first points of the tiles at hand */
    int32_t loaded;        /* of these tiles */
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
    /* NULL without roi */
    cairn_corner_set *corners;
    /* of the corners; NULL without roi */
    cairn_point_grid *grid;
    /* [max_scans] each; placements[front] is committed */
    struct cairn_force_placement *placements[2];
    /* [max_scans] */
    struct cairn_force_body *bodies;
    /* [max_segments], in the map */
    cairn_segment *segments;
    /* [max_segments], in the map */
    cairn_vec2 *directions;
    /* [max_extra + max_segments], of the runs, then of the segments with their points, grown */
    cairn_box *boxes;
    /* [max_points], in the map; NULL with spacing */
    cairn_vec2 *position;
    /* [max_points], in the forces; NULL with spacing, that of the set without roi */
    cairn_real *mass;
    /* [max_points / 32 + 1], a bit for each point; NULL but with spacing and roi */
    uint32_t *in_region;
    /* extra[extra_front] is in use */
    struct cairn_force_extra extra[2];
    /* [max_bonds]; NULL without springs */
    struct cairn_force_bond *bonds;
    /* [max_scans]; NULL without springs */
    struct cairn_force_unknown *unknowns;

    int32_t front, extra_front;
    int32_t extra_pending; /* the other extra is to be used from the next iteration on */
    int32_t slots;         /* those of scans that have taken effect are below */
    int32_t scan_count;    /* scans, those that have not yet taken effect included */
    int32_t last_leaving;  /* the scan released last, -1: none */
    int32_t has_forces;    /* the places, boxes and masses of the last iteration are still there */
    int32_t restart;       /* wanted at the next commit point */
    uint32_t revision;
    uint32_t clock;                /* iterations begun */
    uint32_t commits;              /* and ended */
    cairn_force_field_state state; /* as committed, but units and worst_step */

    /* The iteration under way. */
    cairn_force_phase phase;
    /* units towards the item at hand */
    int32_t units_charged;
    /* those of the scans that have taken effect */
    int32_t segment_count;
    /* whose boxes are those of their last iteration */
    int32_t placed_segments;
    /* all is computed anew */
    int32_t recomputes_all;
    /* some scans have moved, some have not */
    int32_t is_partly_still;
    /* rotations are about the sensor */
    int32_t rotates_about_sensor;
    cairn_real sigma, dt;
    /* product of the factors so far */
    cairn_real sigma_scale;
    /* of the boxes */
    cairn_real placed_sigma;
    /* m, half the reach: growth of boxes */
    cairn_real margin;
    /* about the boxes of scans that are not fixed: only there anything attracts */
    cairn_box free_box;
    /* cursors */
    int32_t scan, segment, point;
    /* COMPARE: scans */
    int32_t moved_count, still_count;
    /* PAIRS; MARK_OLD and MARK_NEW: scans and is_begun */
    struct cairn_force_pair pair;
    struct cairn_force_tile tiles[2];
    /* PAIRS */
    int32_t bond_count, bonds_dropped;
    /* BALANCE */
    struct cairn_force_solver solver;
    /* MOVE: sums over the scans */
    int64_t pairs;
    int64_t segment_pairs;
    cairn_real potential;
    /* over the free scans */
    cairn_real relocation;
    /* with points */
    int32_t free_scans;
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
CAIRN_CHECKED cairn_status cairn_force_iteration_step(cairn_force_field *field,
                                                      cairn_budget *budget);

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

/* points[0 ... count-1] = the points first ... of a segment in the map, where the last PLACE put
 * their scan. */
void cairn_force_points(const cairn_force_field *field, int32_t segment, int32_t first,
                        int32_t count, cairn_vec2 *points);

/* Marks the scans that are near one that has moved. */
CAIRN_CHECKED cairn_status cairn_force_mark(cairn_force_field *field, cairn_budget *budget);

/* The forces of all pairs of lines that concern a dirty scan. */
CAIRN_CHECKED cairn_status cairn_force_pairs(cairn_force_field *field, cairn_budget *budget);

/* The force on a point of a segment in the last iteration, and its mass. */
cairn_vec2 cairn_force_at(const cairn_force_field *field, int32_t segment, int32_t index,
                          cairn_real *mass);

#endif
