/* What the parts of skeleton_grouping share. */
#ifndef CAIRN_CONTOUR_SKELETON_GROUPING_WORK_H
#define CAIRN_CONTOUR_SKELETON_GROUPING_WORK_H

#include "cairn/particle_filter.h"
#include "cairn/skeleton_grouping.h"

/* Side of a cell of the index, px. */
enum { SKELETON_CELL = 8, SKELETON_EDGELS_A_UNIT = 4 };
/* Edgels that a side may choose from; what a step may choose from with no edgel as well. */
enum {
    SKELETON_CHOICE = 3,
    SKELETON_FOLLOWERS = 4,
    SKELETON_CANDIDATES = (SKELETON_CHOICE + 1) * (SKELETON_CHOICE + 1)
};
/* Bins of the histogram of radii, eight to an octave. */
enum { SKELETON_BINS = 64 };

/* Senses of an edgel: the object lies on the darker or on the brighter side. */
enum { SKELETON_DARKER = 0, SKELETON_BRIGHTER = 1 };

/* An edgel in order of the cells. */
typedef struct skeleton_edgel {
    cairn_vec2 at, normal;
    cairn_real contrast; /* logarithm of its slope over the mean one */
    int32_t source;      /* index in the input */
    int32_t taken;       /* 1: a part's contour runs here, which so has an inside and an outside */
} skeleton_edgel;

typedef struct skeleton_centre {
    cairn_vec2 at;
    cairn_real radius, deviation;
    int32_t edgel[2], sense[2];
} skeleton_centre;

/* Where a walk may begin: the centre in the middle of a line. */
typedef struct skeleton_start {
    int32_t centre;  /* as written: the line */
    int32_t support; /* CPs of the line that are mirror images; 0: a CP of its own */
} skeleton_start;

/* One step of a walk. */
typedef struct skeleton_state {
    /* on the left and on the right of the heading */
    cairn_vec2 touch[2], inward[2];
    cairn_vec2 centre, heading;
    cairn_real radius, deviation;
    /* log odds of this step, of the walk so far, and the most on its way */
    cairn_real gain, total, best;
    /* edgel -1: none seen */
    int32_t edgel[2], sense[2];
    /* states before this one */
    int32_t length;
} skeleton_state;

/* A disc of a part that may yet lose against others. */
typedef struct skeleton_disc {
    cairn_vec2 centre, touch[2];
    cairn_real radius, gain;
    int32_t edgel[2], sense[2];
} skeleton_disc;

typedef struct skeleton_part {
    int32_t first, count; /* discs */
    int32_t from, end;    /* of these, what is left of it */
    cairn_real log_odds;
    int32_t state; /* 0: may be chosen, 1: chosen, -1: dropped */
} skeleton_part;

/* What the method as written works with. */
typedef struct skeleton_written skeleton_written;

struct cairn_skeleton {
    cairn_skeleton_params params;
    cairn_skeleton_input input;
    cairn_particle_filter *filter;
    cairn_polyline *polyline;
    /* [max_edgels] */
    skeleton_edgel *edgels;
    /* [cells + 1] of each cell in edgels[] */
    int32_t *first;
    /* [max_centres] */
    skeleton_centre *centres;
    /* [max_lines] */
    skeleton_start *starts;
    /* [max_steps + 1] the best walk; NULL as written */
    skeleton_state *path;
    /* NULL unless as written */
    skeleton_written *written;
    /* [max_points] of all candidates */
    skeleton_disc *discs;
    /* [max_parts] */
    skeleton_part *candidates;
    /* [max_points] */
    cairn_skeleton_point *points;
    /* [max_parts] */
    cairn_skeleton_part *parts;
    /* [max_parts] */
    cairn_skeleton_object *objects;
    /* [max_parts] another part of the same object; at last, the objects' order */
    int32_t *group;
    /* [max_parts] places of the contour with the brighter side inside, less the others; at last,
     * objects' places */
    int32_t *bright;
    cairn_real histogram[SKELETON_BINS];
    /* mean of the edgels' whose slope is known */
    cairn_real log_slope;
    /* px, of radii that are looked for: the range with room on both sides */
    cairn_real low, high;
    int32_t columns, rows, edgel_count, steep_count, stride;
    int32_t centre_count, centres_seen, start_count, line_starts, line_count, walked;
    int32_t disc_count, candidate_count, point_count, part_count, object_count;
    int32_t path_count;
    cairn_real path_best;
    int32_t start, direction, is_walking;
    int32_t cursor, other, sense, item;
    int32_t phase, paid, stage;
};

/* Edgels of the cells in columns x0 ... x1 of row y: indices *from ... *end - 1. */
static inline void skeleton_row(const cairn_skeleton *g, int32_t y, int32_t x0, int32_t x1,
                                int32_t *from, int32_t *end)
{
    *from = g->first[y * g->columns + x0];
    *end = g->first[y * g->columns + x1 + 1];
}

/* Units for looking at the edgels of cells. */
static inline int32_t skeleton_cost(const cairn_skeleton *g, int32_t x0, int32_t x1, int32_t y0,
                                    int32_t y1)
{
    int32_t count = 0, from, end;

    for (int32_t y = y0; y <= y1; y++) {
        skeleton_row(g, y, x0, x1, &from, &end);
        count += end - from;
    }
    return y1 - y0 + count / SKELETON_EDGELS_A_UNIT;
}

int32_t cairn_skeleton_column(const cairn_skeleton *g, cairn_real x);
int32_t cairn_skeleton_line(const cairn_skeleton *g, cairn_real y);

/* The normal that points to the object. */
static inline cairn_vec2 skeleton_inward(const skeleton_edgel *e, int32_t sense)
{
    return cairn_vec2_scale(e->normal, sense == SKELETON_BRIGHTER ? 1 : -1);
}

/* Edgels for each pixel about a place. */
cairn_real cairn_skeleton_density(const cairn_skeleton *g, cairn_vec2 at);

/* Radii that are looked for: the range, widened in the default mode. */
void cairn_skeleton_set_limits(cairn_skeleton *g);

/* The phases. */
cairn_status cairn_skeleton_index(cairn_skeleton *g, cairn_budget *budget);
cairn_status cairn_skeleton_centres(cairn_skeleton *g, cairn_budget *budget);
cairn_status cairn_skeleton_propose_range(cairn_skeleton *g, cairn_budget *budget);
cairn_status cairn_skeleton_lines(cairn_skeleton *g, cairn_budget *budget);
cairn_status cairn_skeleton_mirror(cairn_skeleton *g, cairn_budget *budget);
cairn_status cairn_skeleton_walks(cairn_skeleton *g, cairn_budget *budget);
cairn_status cairn_skeleton_choose(cairn_skeleton *g, cairn_budget *budget);
cairn_status cairn_skeleton_join(cairn_skeleton *g, cairn_budget *budget);

cairn_particle_model cairn_skeleton_model(cairn_skeleton *g);

#endif
