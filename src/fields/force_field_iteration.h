/* force_field_iteration: state of the force field, and one iteration of it. Shared by the source
 * files of module force_field. */
#ifndef CAIRN_FIELDS_FORCE_FIELD_ITERATION_H
#define CAIRN_FIELDS_FORCE_FIELD_ITERATION_H

#include "cairn/force_field.h"
#include "cairn/small_matrix.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_force_field_parameters;

struct cairn_force_field_placement {
    cairn_pose map_scan;
    cairn_force_field_motion motion;
};

/* State of a scan, besides its placements. Forces are cached from one iteration to the next as long
 * as nothing near the scan changes. */
struct cairn_force_field_body {
    /* of `placed` */
    cairn_transform transform;
    /* pose at which its segments and points were last transformed into the map */
    cairn_pose placed;
    cairn_vec2 centre, force;
    cairn_real torque;
    /* sum over all pairs of the scan */
    cairn_real potential;
    int64_t pairs;
    int32_t segment_pairs;
    /* commit points from which on the scan is present, and is removed */
    uint32_t active_from, active_until;
    /* iteration from which on `fixed_after` holds; `fixed_before` until then */
    uint32_t fixed_from;
    /* the scan removed before this one, -1: none */
    int32_t next_leaving;
    uint8_t fixed_before, fixed_after;
    /* active_until is valid */
    uint8_t is_leaving;
    /* not yet transformed into the map */
    uint8_t is_new;
    /* in the last iteration */
    uint8_t is_fixed;
    /* took part in the last iteration */
    uint8_t has_forces;
    /* this iteration: pose, masses or fixing differ from the last one */
    uint8_t moved;
    /* this iteration: its forces are recomputed */
    uint8_t dirty;
};

/* Scan index of external points. */
enum { FORCE_FIELD_NO_SCAN = -1 };

/* A bond: the sum of all springs between two scans. */
struct cairn_force_field_bond {
    /* scans; first may be NO_SCAN */
    int32_t first, second;
    /* next bond in the list of this second scan, -1: none */
    int32_t next;
    /* against a motion (x, y, rotation) of first relative to second, about the centre of second */
    cairn_sym3 stiffness;
    /* force and torque on first; opposite on second */
    cairn_real wrench[3];
};

/* Unknowns of a scan in the sparse linear system of all springs: its motion (x, y, rotation) about
 * the centre. */
struct cairn_force_field_unknown {
    /* the last bond with the scan as second, -1: none; number of bonds */
    int32_t last_bond, bond_count;
    /* diagonal block of the system, then its inverse (Jacobi preconditioner); 0: fixed */
    cairn_sym3 diagonal;
    cairn_real damping[3]; /* diagonal damping that holds the scan at its pose */
    /* vectors of the conjugate gradient method; product = A direction */
    cairn_real motion[3], residual[3], direction[3], product[3];
};

/* State of the conjugate gradient method. */
struct cairn_force_field_solver {
    /* current bond or scan; iteration of the solver */
    int32_t item, iteration;
    /* squared residual norms, preconditioned */
    cairn_real residual2, next_residual2, min_residual2;
    /* direction^T A direction */
    cairn_real curvature;
};

/* External points, in runs of one direction. */
struct cairn_force_field_extra {
    cairn_vec2 *position;  /* [max_extra] */
    cairn_real *weight;    /* [max_extra] */
    cairn_vec2 *direction; /* [max_extra], of each run */
    int32_t *first;        /* [max_extra + 1], first point of each run */
    int32_t count, runs;
};

/* A tile: a few points of one line, and buffers for points generated on demand. */
struct cairn_force_field_tile {
    cairn_force_kernel_strip strip;
    cairn_vec2 position[CAIRN_FORCE_STRIP_POINTS];
    cairn_real mass[CAIRN_FORCE_STRIP_POINTS];
    cairn_box box;       /* of the points when the line has more than one tile */
    int32_t line, first; /* line -1: empty */
};

/* A line: a segment of a scan, or a run of external points. */
struct cairn_force_field_line {
    int32_t index;   /* of its box */
    int32_t segment; /* negative: a run */
    int32_t scan;    /* NO_SCAN: of a run */
    int32_t count;   /* number of points */
    cairn_vec2 direction;
};

/* A pair of lines in progress. */
struct cairn_force_field_pair {
    struct cairn_force_field_line line[2];
    /* 0: there are no more pairs */
    int32_t is_found;
    /* first points of the current tiles */
    int32_t tile_first[2];
    cairn_force_kernel_cursor cursor;
    /* direction factor: |cos| or max(0, cos) */
    cairn_real cosine;
    cairn_force_kernel_sum sum;
    cairn_force_kernel_springs springs;
};

/* Sums over the scans that are moved. */
struct cairn_force_field_totals {
    int64_t pairs, segment_pairs;
    cairn_real potential;
    /* over the free scans with points, and their number */
    cairn_real relocation;
    int32_t free_scans;
};

struct cairn_force_field {
    /* The current iteration: resume points of the iteration, of its phase, or of the removal of
     * scans between iterations, and of the current pair of lines. */
    int32_t resume, phase_resume, pair_resume;
    /* units charged towards the current item */
    int32_t units_charged;
    /* current scan, segment or run, and point of it */
    int32_t scan, segment, point;
    /* segments of the scans that have taken effect */
    int32_t segment_count;
    /* segments whose boxes are those of their last iteration */
    int32_t placed_segments;
    /* numbers of scans that have moved, and that have not */
    int32_t moved_count, still_count;
    /* all forces are recomputed */
    int32_t recomputes_all;
    /* rotations are about the sensor */
    int32_t rotates_about_sensor;
    /* springs of the current iteration */
    int32_t bond_count, bonds_dropped;

    int32_t front, extra_front;
    int32_t slots; /* bound of the indices of scans that have taken effect */

    cairn_scan_set *set;
    cairn_box_sweep *sweep;
    /* NULL without roi */
    cairn_corner_set *corners;
    /* hash grid of the corners; NULL without roi */
    cairn_point_grid *grid;
    /* [max_scans] each, double-buffered; placements[front] is committed */
    struct cairn_force_field_placement *placements[2];
    /* [max_scans] */
    struct cairn_force_field_body *bodies;
    /* [max_segments], in the map */
    cairn_segment *segments;
    /* [max_segments], in the map */
    cairn_vec2 *directions;
    /* [max_extra + max_segments], of the runs, then of the segments with their points, grown by
     * margin */
    cairn_box *boxes;
    /* [max_points], in the map; NULL with spacing */
    cairn_vec2 *position;
    /* [max_points], masses in the forces; NULL with spacing, that of the set without roi */
    cairn_real *mass;
    /* [max_points / 32 + 1], a bit per point; only with spacing and roi, else NULL */
    uint32_t *in_region;
    /* [max_bonds]; NULL without springs */
    struct cairn_force_field_bond *bonds;
    /* [max_scans]; NULL without springs */
    struct cairn_force_field_unknown *unknowns;

    int32_t extra_pending; /* 1: the other buffer is used from the next iteration on */
    int32_t scan_count;    /* scans present, including those that have not taken effect */
    int32_t last_leaving;  /* the scan removed last, -1: none */
    /* 1: positions, boxes and masses of the last iteration are still valid */
    int32_t has_forces;
    int32_t restart; /* 1: a restart is pending until the next commit point */
    uint32_t revision;
    uint32_t clock;   /* iterations begun */
    uint32_t commits; /* iterations committed */

    cairn_real sigma, dt;
    /* product of the cooling factors so far */
    cairn_real sigma_scale;
    /* sigma of the boxes */
    cairn_real placed_sigma;
    /* m, half the reach: growth of boxes */
    cairn_real margin;
    /* bounding box of free scans: forces exist only inside it */
    cairn_box free_box;

    cairn_force_kernel kernel;
    /* double-buffered: extra[extra_front] is in use */
    struct cairn_force_field_extra extra[2];
    cairn_force_field_state state; /* as committed, except units and max_step_units */
    cairn_force_field_params params;
    /* State of a phase; no two of these phases are under way at a time. */
    union {
        /* pairs of lines; marks of the dirty scans */
        struct {
            struct cairn_force_field_pair pair;
            struct cairn_force_field_tile tiles[2];
        };
        struct cairn_force_field_solver solver;
        struct cairn_force_field_totals totals;
    };
};

/* 1 between iterations, when inputs take effect at once. */
static inline int32_t force_field_is_between(const cairn_force_field *field)
{
    return field->resume == 0;
}

/* 1 when a scan has taken effect and was not removed. */
static inline int32_t force_field_has_scan(const cairn_force_field *field, int32_t scan)
{
    const struct cairn_force_field_body *body = &field->bodies[scan];

    return field->set->scans[scan].in_use && field->commits >= body->active_from &&
           !(body->is_leaving && field->commits >= body->active_until);
}

/* 1 when a scan is fixed in the current iteration. */
static inline int32_t force_field_is_fixed(const cairn_force_field *field, int32_t scan)
{
    const struct cairn_force_field_body *body = &field->bodies[scan];

    return field->clock >= body->fixed_from ? body->fixed_after : body->fixed_before;
}

/* 1 in mode SPRINGS. */
static inline int32_t force_field_has_springs(const cairn_force_field *field)
{
    return field->bonds != NULL;
}

/* ---- force_field_iteration: a phase returns 1 when done, 0 when the budget is used up ---- */

/* Activates all scans that were added. */
void cairn_force_field_iteration_take_in(cairn_force_field *field);

/* Resets sigma, dt and the count against max_steps. */
void cairn_force_field_iteration_start_cooling(cairn_force_field *field);

/* One iteration, from commit point to commit point. */
int cairn_force_field_iteration(cairn_force_field *field, cairn_budget *budget);

/* Between iterations: frees the memory of the scans that were removed. */
int cairn_force_field_pack(cairn_force_field *field, cairn_budget *budget);

/* ---- force_field_move ---- */

/* Moves all scans and sums the statistics of the iteration. */
int cairn_force_field_move(cairn_force_field *field, cairn_budget *budget);

/* Transforms the centre and pose of a scan into the map. */
void cairn_force_field_place_scan(cairn_force_field *field, int32_t scan);

/* ---- force_field_springs ---- */

/* Removes the springs of a scan. */
void cairn_force_field_remove_springs(cairn_force_field *field, int32_t scan);

/* Units of adding the current pair of lines. */
int32_t cairn_force_field_add_springs_cost(const cairn_force_field *field);

/* Adds the springs of the current pair of lines to the bond of their scans. */
void cairn_force_field_add_springs(cairn_force_field *field);

/* Motions to the equilibrium of all springs, to the solver's accuracy. */
int cairn_force_field_solve(cairn_force_field *field, cairn_budget *budget);

/* ---- force_field_pairs ---- */

/* Computes points[0 ... count-1], the points first ... of a segment in the map, at the last
 * placement of their scan. */
void cairn_force_field_points(const cairn_force_field *field, int32_t segment, int32_t first,
                              int32_t count, cairn_vec2 *points);

/* Marks the scans near one that has moved as dirty. */
int cairn_force_field_mark_dirty(cairn_force_field *field, cairn_budget *budget);

/* Forces of all pairs of lines that involve a dirty scan. */
int cairn_force_field_pairs(cairn_force_field *field, cairn_budget *budget);

/* Returns the force on a point of a segment in the last iteration, and its mass. */
cairn_vec2 cairn_force_field_at(const cairn_force_field *field, int32_t segment, int32_t index,
                                cairn_real *mass);

#endif
