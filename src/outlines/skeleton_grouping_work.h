/* Internal structures of module skeleton_grouping. */
#ifndef CAIRN_OUTLINES_SKELETON_GROUPING_WORK_H
#define CAIRN_OUTLINES_SKELETON_GROUPING_WORK_H

#include "cairn/particle_filter.h"
#include "cairn/skeleton_grouping.h"
#include "src/base/object.h"
#include "src/base/step.h"
#include "src/containers/cell_grid.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_skeleton_grouping_parameters;

/* Side of a grid cell, px; edgels per work unit. */
enum { SKELETON_GROUPING_CELL_PX = 8, SKELETON_GROUPING_EDGELS_PER_UNIT = 4 };
/* Greatest number of edgels a side may choose from; of states a particle keeps; of states a step
 * may choose from, including the choice without an edgel. */
enum {
    SKELETON_GROUPING_MAX_CHOICES = 3,
    SKELETON_GROUPING_MAX_FOLLOWERS = 4,
    SKELETON_GROUPING_MAX_CANDIDATES =
        (SKELETON_GROUPING_MAX_CHOICES + 1) * (SKELETON_GROUPING_MAX_CHOICES + 1)
};
/* Bins of the radius histogram, eight to an octave. */
enum { SKELETON_GROUPING_RADIUS_BINS = 64 };

/* Contrast polarity of an edgel: the object lies on the darker or on the brighter side. */
enum { SKELETON_GROUPING_DARKER = 0, SKELETON_GROUPING_BRIGHTER = 1 };

/* An edgel, sorted by grid cell. */
typedef struct skeleton_grouping_edgel {
    /* Position, px, and unit normal. */
    cairn_vec2 position, normal;
    cairn_real log_slope_ratio; /* Log ratio of its slope to the mean slope; 0: unknown. */
    int32_t input_index;        /* Index in the input. */
    int32_t assigned;           /* 1: assigned to a part's contour. */
} skeleton_grouping_edgel;

typedef struct skeleton_grouping_centre {
    /* Position, px. */
    cairn_vec2 position;
    /* Radius, px; angle between the normals and the vectors to the centre, rad. */
    cairn_real radius, deviation;
    /* Both edgels and their contrast polarity. */
    int32_t edgel[2], polarity[2];
} skeleton_grouping_centre;

/* A seed: the CP at the middle of a line, or a single CP. */
typedef struct skeleton_grouping_seed {
    int32_t centre;  /* Index of the CP; as written of the line. */
    int32_t support; /* Mirror-symmetric CPs of the line; 0: a single CP. */
} skeleton_grouping_seed;

/* One state of a trajectory. */
typedef struct skeleton_grouping_state {
    /* On the left and right of the heading; inward: normal towards the axis. */
    cairn_vec2 contact[2], inward[2];
    /* Centre of the disc, px; unit direction of the axis. */
    cairn_vec2 centre, heading;
    /* As in skeleton_grouping_centre. */
    cairn_real radius, deviation;
    /* Log odds of this step, of the trajectory, and their maximum so far, nats. */
    cairn_real gain, log_odds, best_log_odds;
    /* edgel: -1: undetected. */
    int32_t edgel[2], polarity[2];
    /* Number of earlier states. */
    int32_t length;
} skeleton_grouping_state;

/* A disc of a candidate part. */
typedef struct skeleton_grouping_disc {
    /* Centre and contact points, px. */
    cairn_vec2 centre, contact[2];
    /* Radius, px; gain, nats. */
    cairn_real radius, gain;
    int32_t edgel[2], polarity[2];
} skeleton_grouping_disc;

typedef struct skeleton_grouping_part {
    int32_t first, count;         /* All of its discs. */
    int32_t kept_first, kept_end; /* Its stretch of greatest log odds. */
    cairn_real log_odds;
    int32_t state; /* 0: candidate, 1: selected, -1: dropped. */
} skeleton_grouping_part;

/* Working memory of the mode as written. */
typedef struct skeleton_grouping_written skeleton_grouping_written;

struct cairn_skeleton_grouping {
    /* Resume points: of the whole, of its current phase, of a proposal as written. */
    int32_t resume, phase_resume, propose_resume;
    /* Work units charged for the next operation and for the next proposal. */
    int32_t units_charged, step_units_charged;
    /* State of a phase; no two of these phases are under way at a time. */
    union {
        /* Index and CPs: cell; edgel, and side of it. */
        struct {
            int32_t cell, edgel, polarity;
        };
        /* CPs as written: edgel, the row of cells of its next partner, that partner. */
        struct {
            int32_t paired, partner_row, partner;
        };
        /* Range and seeds: line, CP; single CPs that are seeds, and those of them passed. */
        struct {
            int32_t line, centre, single_count, single_passed;
        };
        /* Trajectories: particle that is compared with the best one. */
        struct {
            int32_t particle;
        };
        /* Selection of parts: candidate; the best one, -1: none; disc of it, and side of that. */
        struct {
            int32_t candidate, best, disc, side;
        };
        /* Joining of parts: part, end of it, and the point that the end may continue into. */
        struct {
            int32_t part, end, joined;
        };
    };
    /* Numbers of edgels and of those with a known slope, subsampling stride. */
    int32_t edgel_count, slope_count, stride;
    /* Stored and found CPs; seeds, seeds from lines; fitted lines; started trajectories. */
    int32_t centre_count, centres_found, seed_count, line_seeds, line_count, walk_count;
    int32_t disc_count, candidate_count, point_count, part_count, object_count;
    /* 1: objects are to be found; 1: the result is complete. */
    int32_t is_pending, is_complete;
    /* Current seed and direction along the axis; 1: another step of the filter follows. */
    int32_t seed_index, direction, is_walking;

    cairn_particle_filter *filter;
    cairn_polyline *polyline;
    /* [max_edgels] */
    skeleton_grouping_edgel *edgels;
    /* [cells + 1] First edgel of each cell. */
    int32_t *cell_first;
    /* [max_centres] */
    skeleton_grouping_centre *centres;
    /* [max_lines] */
    skeleton_grouping_seed *seeds;
    /* [max_steps + 1] The best trajectory; NULL as written. */
    skeleton_grouping_state *best_path;
    /* NULL unless as written. */
    skeleton_grouping_written *written;
    /* [max_points] Discs of all candidates. */
    skeleton_grouping_disc *discs;
    /* [max_parts] */
    skeleton_grouping_part *candidates;
    /* [max_points] */
    cairn_skeleton_grouping_point *points;
    /* [max_parts] */
    cairn_skeleton_grouping_part *parts;
    /* [max_parts] */
    cairn_skeleton_grouping_object *objects;
    /* [max_parts] Union-find parent of each part; finally the objects' order. */
    int32_t *union_find;
    /* [max_parts] Contour points with the brighter side inside, minus the others; finally the
     * objects' ranks. */
    int32_t *polarity_sum;

    /* Mean logarithm of the known edgel slopes. */
    cairn_real mean_log_slope;
    /* Range of searched radii, px: the given range, widened. */
    cairn_real min_search_radius, max_search_radius;
    /* Length of the best trajectory in states. */
    int32_t best_path_length;
    cairn_real best_path_log_odds;
    /* < 0: the error that ended the search. */
    cairn_status status;
    cairn_skeleton_grouping_input input;
    /* Histogram of the CP radii. */
    cairn_real histogram[SKELETON_GROUPING_RADIUS_BINS];
    /* Cells of the image. */
    cell_grid grid;
    cairn_skeleton_grouping_params params;
};

/* Sets the range *from ... *end - 1 of edgels in the cells of row y. */
static inline void skeleton_grouping_cells_of_row(const cairn_skeleton_grouping *skeleton,
                                                  cell_range cells, int32_t y, int32_t *from,
                                                  int32_t *end)
{
    *from = skeleton->cell_first[y * skeleton->grid.columns + cells.x0];
    *end = skeleton->cell_first[y * skeleton->grid.columns + cells.x1 + 1];
}

/* Returns the cost of visiting the edgels of cells in units. */
static inline int32_t skeleton_grouping_cells_cost(const cairn_skeleton_grouping *skeleton,
                                                   cell_range cells)
{
    int32_t count = 0, from, end;

    for (int32_t y = cells.y0; y <= cells.y1; y++) {
        skeleton_grouping_cells_of_row(skeleton, cells, y, &from, &end);
        count += end - from;
    }
    return cells.y1 - cells.y0 + count / SKELETON_GROUPING_EDGELS_PER_UNIT;
}

/* Returns the cells of a box, in px; of the box around a point with sides of 2 reach. */
cell_range cairn_skeleton_grouping_cells(const cairn_skeleton_grouping *skeleton, cairn_box box);
cell_range cairn_skeleton_grouping_cells_near(const cairn_skeleton_grouping *skeleton,
                                              cairn_vec2 place, cairn_real reach);

/* Returns the normal that points to the object. */
static inline cairn_vec2 skeleton_grouping_inward(const skeleton_grouping_edgel *edgel,
                                                  int32_t polarity)
{
    return cairn_vec2_scale(edgel->normal, polarity == SKELETON_GROUPING_BRIGHTER ? 1 : -1);
}

/* Returns the local edgel density (background clutter) at a point, 1/px^2. */
cairn_real cairn_skeleton_grouping_density(const cairn_skeleton_grouping *skeleton, cairn_vec2 at);

/* Sets the range of searched radii; in the default mode wider than the given range. */
void cairn_skeleton_grouping_set_limits(cairn_skeleton_grouping *skeleton);

cairn_particle_filter_model cairn_skeleton_grouping_model(cairn_skeleton_grouping *skeleton);

/* ---- Phases: each returns 1 when done; 0 when the budget is used up, or when `status` was set to
 * an error ---- */

/* Edgels by cell. */
int cairn_skeleton_grouping_index(cairn_skeleton_grouping *skeleton, cairn_budget *budget);

/* CPs of the best partners of each edgel. */
int cairn_skeleton_grouping_centres(cairn_skeleton_grouping *skeleton, cairn_budget *budget);

/* Range of radii from the histogram of CP radii, and the CPs within it. */
int cairn_skeleton_grouping_propose_range(cairn_skeleton_grouping *skeleton, cairn_budget *budget);

/* Lines through the CPs. */
int cairn_skeleton_grouping_lines(cairn_skeleton_grouping *skeleton, cairn_budget *budget);

/* Seeds: of the lines that are axes of mirror symmetry; single CPs. */
int cairn_skeleton_grouping_line_seeds(cairn_skeleton_grouping *skeleton, cairn_budget *budget);
int cairn_skeleton_grouping_single_seeds(cairn_skeleton_grouping *skeleton, cairn_budget *budget);

/* Trajectories from the seeds: the candidates. */
int cairn_skeleton_grouping_walks(cairn_skeleton_grouping *skeleton, cairn_budget *budget);

/* Parts, and objects. */
int cairn_skeleton_grouping_select_parts(cairn_skeleton_grouping *skeleton, cairn_budget *budget);
int cairn_skeleton_grouping_join_parts(cairn_skeleton_grouping *skeleton, cairn_budget *budget);

#endif
