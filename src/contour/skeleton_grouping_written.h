/* What the parts of skeleton_grouping that follow the thesis as it is printed share
 * (CAIRN_MODE_AS_WRITTEN). */
#ifndef CAIRN_CONTOUR_SKELETON_GROUPING_WRITTEN_H
#define CAIRN_CONTOUR_SKELETON_GROUPING_WRITTEN_H

#include "src/contour/skeleton_grouping_work.h"

/* Edgels of one look-ahead circle, and followers of one particle; of more, one in N, evenly. */
enum { WRITTEN_EDGELS = 48, WRITTEN_FOLLOWERS = 256 };

/* Two edgels and the centre point that they induce (fig. 3.2). */
typedef struct written_pair {
    cairn_vec2 centre;
    cairn_vec2 touch[2], inward[2]; /* normals turned towards the centre */
    cairn_real deviation[2];        /* rad, delta: between normal and way to the centre */
    cairn_real radius;
    int32_t edgel[2];
    int32_t crossed; /* 1: its axis, or its contour, crosses the walk so far */
} written_pair;

/* Which pairs have a centre point. */
typedef struct written_rule {
    cairn_real low, high;    /* px, of the radius */
    cairn_real deviation;    /* rad, the largest mean deviation */
    cairn_real twice_cosine; /* of twice that: either deviation is less */
} written_rule;

/* One pose of the virtual robot, x_t. */
typedef struct skeleton_written_state {
    /* touch[0] of one contour, touch[1] of the other, all along a walk */
    written_pair pair;
    /* of length 1: sum of the four vectors between the edgels before and these */
    cairn_vec2 heading;
    /* logarithm of (3.7), of its greatest value; 0 for the first pose */
    cairn_real log_step;
    /* logarithm of the number of followers that the pose before has */
    cairn_real log_followers;
} skeleton_written_state;

/* An edgel in a look-ahead circle. */
typedef struct written_ahead {
    cairn_vec2 at;
    int32_t edgel;
    int32_t inside; /* 1: within the contour so far */
    int32_t culled; /* 1: part of the contour so far, or the way to it crosses the contour */
} written_ahead;

struct skeleton_written {
    written_ahead ahead[2][WRITTEN_EDGELS];
    written_pair pairs[WRITTEN_FOLLOWERS];
    int64_t seen, stride; /* pairs so far, and of how many one is kept */
    int32_t ahead_count[2], pair_count;
    int32_t collected; /* 1: ahead[] stands, pairs are to be made */
};

written_rule cairn_skeleton_written_rule(const cairn_skeleton *g, cairn_real margin);

/* 1: two edgels have a centre point. About two units. */
int cairn_skeleton_written_pair(const cairn_skeleton *g, const written_rule *rule, int32_t first,
                                int32_t second, written_pair *pair);

/* The phases that differ from the default's. */
cairn_status cairn_skeleton_written_centres(cairn_skeleton *g, cairn_budget *budget);
cairn_status cairn_skeleton_written_range(cairn_skeleton *g, cairn_budget *budget);
cairn_status cairn_skeleton_written_walks(cairn_skeleton *g, cairn_budget *budget);

/* 1: the CP's edgels lie on both sides of its line, about equally far. */
int cairn_skeleton_is_mirrored(const cairn_skeleton *g, const skeleton_centre *c,
                               const cairn_polyline_segment *s);

cairn_particle_model cairn_skeleton_written_model(cairn_skeleton *g);

#endif
