/* skeleton_grouping: contours and skeletons of the symmetric parts of an image at once, with no model of what they are of.
 *
 * Adluru 2008, chapter 3: pairs of edgels that face each other across a disc have their centre points (CPs); lines through CPs in
 * (x, y, radius) whose edgels lie like mirror images of each other on both sides are where particles start. A particle walks along
 * the axis, disc by disc, and lengthens the contour on both sides; what it gains is the logarithm of how much likelier its
 * edgels are as a contour with an axis than as edgels strewn evenly. Parts are ranked by that sum, those that share contours
 * rival for them, and those whose axes lead into each other are an object. Image coordinates, pixels.
 *
 *     begin(edgels) -> step(budget) until CAIRN_OK -> read() */
#ifndef CAIRN_SKELETON_GROUPING_H
#define CAIRN_SKELETON_GROUPING_H

#include "cairn/edgel.h"
#include "cairn/polyline.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What a step of a walk is worth. */
typedef int32_t cairn_skeleton_weight;
enum {
    CAIRN_SKELETON_EVIDENCE =
        0, /* log odds of the edgels' places and directions, of their symmetry and of the radius */
    CAIRN_SKELETON_AS_WRITTEN =
        1 /* of (H + T) S, Adluru 2008 (3.7 ... 3.9), the loss of symmetry with its sign mended */
};

typedef struct cairn_skeleton_params {
    int32_t max_width, max_height; /* pixels, 1 ... 8192 (640 and 480) */
    int32_t max_edgels;            /* 1 ... 2^24 (40,000) */
    int32_t max_centres;           /* CPs, 1 ... 2^20: of more, one in so many (4000) */
    int32_t max_lines;             /* through CPs, also while they are fitted, and starts, 1 ... 4096 (256) */
    int32_t max_parts;             /* 1 ... 4096 (256) */
    int32_t max_points; /* of the axes of all parts, 1 ... 2^20 (8192); 2 max_steps + 1 of them free for each walk */
    int32_t max_steps;  /* of a walk, 1 ... 1024 (96) */
    int32_t particles;  /* 1 ... 1024 (16) */
    cairn_skeleton_weight weight;
    cairn_real duality;      /* rad, > 0, D sigma: of directions, and of the loss of symmetry (20 degrees) */
    cairn_real reach;        /* px, > 0, C sigma: how far a step looks for edgels (8) */
    cairn_real radius;       /* share of the radius, > 0, R sigma: how far it may lie off the range (0.2) */
    cairn_real symmetry;     /* rad, > 0: deviation of edgels from the way to their centre (8 degrees) */
    cairn_real detection;    /* 0 ... 1, neither: share of a contour that is seen (0.9) */
    cairn_real flip;         /* 0 ... 1, neither: share of places where a contour's brighter side changes (0.05) */
    cairn_real contrast;     /* >= 0: log odds of an edgel e times as steep as the mean one; not as written (6) */
    cairn_real stop;         /* > 0: a walk ends when it has lost so much log odds since its best (10) */
    cairn_real min_log_odds; /* >= 0: of a part that is reported (20) */
    cairn_real min_mirror;   /* 0 ... 1: share of a line's CPs that are mirror images about it (0.6) */
    uint64_t seed;
} cairn_skeleton_params;

typedef struct cairn_skeleton cairn_skeleton;

/* The values in brackets above, weight: evidence. */
cairn_skeleton_params cairn_skeleton_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_skeleton_memory(const cairn_skeleton_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_skeleton_create(cairn_skeleton **skeleton, cairn_pool *pool,
                                                 const cairn_skeleton_params *params);

/* What is to be grouped. */
typedef struct cairn_skeleton_input {
    const cairn_edgel *edgels; /* [count], normals of length 1; slopes <= 0: not known, neither steep nor not */
    int32_t count;
    int32_t width, height;             /* px, of the image */
    cairn_real min_radius, max_radius; /* px, 1 <= min <= max; both 0: proposed from the CPs */
} cairn_skeleton_input;

/* Starts on an image; the edgels must stay until step() returns CAIRN_OK; what was found before is gone. CAIRN_BAD_ARGUMENT: NULL,
 * counts, sides or radii that the comments above rule out. CAIRN_NOT_FINITE: a radius. CAIRN_FULL: larger than max_width or max_height, more than
 * max_edgels. Constant time. */
CAIRN_CHECKED cairn_status cairn_skeleton_begin(cairn_skeleton *skeleton, const cairn_skeleton_input *input);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the parts stand, or nothing was begun. While lines are fitted it may use what an item of `polyline` costs beyond the budget. CAIRN_NOT_FINITE: an edgel; given up, and there
 * are none. The result does not depend on the budgets. Costs a unit for each edgel, for four edgels in reach of one that a CP is looked for
 * for, what `polyline` takes for the CPs, about 150 for each state of each particle's walk and one for four edgels about it, for each part that
 * is chosen one for eight discs of all others, and for it and four points of all parts one. */
CAIRN_CHECKED cairn_status cairn_skeleton_step(cairn_skeleton *skeleton, cairn_budget *budget);

/* One disc along an axis. */
typedef struct cairn_skeleton_point {
    cairn_vec2 centre;
    cairn_real radius;
    cairn_vec2 touch[2]; /* on the contour, to the left and to the right of the way along the part (y up) */
    int32_t edgel[2];    /* -1: none was seen there, the contour is carried on */
} cairn_skeleton_point;

typedef struct cairn_skeleton_part {
    int32_t first, count; /* points[first ... first + count - 1] */
    int32_t object;       /* its object's index */
    int32_t joint[2];     /* its first and last point lead into this point of another part; -1: a free end */
    cairn_real log_odds;  /* natural, against the background */
} cairn_skeleton_part;

typedef struct cairn_skeleton_object {
    int32_t parts, free_ends;
    cairn_real log_odds; /* sum over its parts */
} cairn_skeleton_object;

/* Empty until step() returns CAIRN_OK; valid until the next begin(). */
typedef struct cairn_skeleton_result {
    const cairn_skeleton_point *points;   /* [point_count] */
    const cairn_skeleton_part *parts;     /* [part_count], the likeliest first */
    const cairn_skeleton_object *objects; /* [object_count], the likeliest first */
    int32_t point_count, part_count, object_count;
    int32_t centres, lines, starts;    /* CPs found, lines through them, and those that walks began on */
    int32_t left_out;                  /* starts for whose walks max_parts or max_points had no room */
    cairn_real min_radius, max_radius; /* px, the range that was given or proposed */
} cairn_skeleton_result;

cairn_skeleton_result cairn_skeleton_read(const cairn_skeleton *skeleton);

#ifdef __cplusplus
}
#endif

#endif
