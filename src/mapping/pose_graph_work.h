/* What the parts of pose_graph share: pose_graph.c (the graph), pose_graph_begin.c (what
 * a solution begins with), pose_graph_solve.c (iterations) and pose_graph_link.c (links). */
#ifndef CAIRN_MAPPING_POSE_GRAPH_WORK_H
#define CAIRN_MAPPING_POSE_GRAPH_WORK_H

#include "cairn/pose_graph.h"

/* What is solved for. */
enum {
    POSE_GRAPH_AS_GIVEN,  /* nothing: the cost of the poses as given */
    POSE_GRAPH_HEADINGS,  /* cosines and sines */
    POSE_GRAPH_JOINT,     /* poses, as a linear problem about those headings */
    POSE_GRAPH_NEWTON,    /* a step of all */
    POSE_GRAPH_COVARIANCE /* nothing: the inverse */
};

/* What the next item of work is. */
enum {
    POSE_GRAPH_IDLE,
    POSE_GRAPH_ANALYZE,
    POSE_GRAPH_CLEAR,
    /* their blocks, at the base */
    POSE_GRAPH_LINKS,
    /* their blocks, with the damping */
    POSE_GRAPH_POSES,
    POSE_GRAPH_FACTOR,
    POSE_GRAPH_SOLVE,
    /* with a factor of other poses: the right sides into their headings; SOLVE comes next */
    POSE_GRAPH_TURN,
    /* ... the solution turned back, */
    POSE_GRAPH_SLOPE,
    /* ... conjugate to the step before, */
    POSE_GRAPH_DIRECTION,
    /* ... and how far to go, a link an item */
    POSE_GRAPH_CURVATURE,
    /* the trial poses */
    POSE_GRAPH_MOVE,
    /* of the trial poses, a link an item */
    POSE_GRAPH_COST,
    POSE_GRAPH_INVERT,
    /* every link at the end */
    POSE_GRAPH_REPORT
};

struct pose_graph_link {
    int32_t first, second;
    cairn_pose measured;
    cairn_sym3 information; /* in the frame of the first pose */
    cairn_real chi2, weight;
    int32_t dropped;
};

struct cairn_pose_graph {
    cairn_pose_graph_params params;
    cairn_pose_graph_state state;
    cairn_pose_solver solver;
    /* NULL: the solver is the user's */
    cairn_block_solver *own;
    /* [max_poses] accepted */
    cairn_pose *poses;
    cairn_pose *trial;
    int32_t *fixed;
    /* of the piece that a pose is in */
    int32_t *root;
    cairn_sym3 *diagonal;
    /* of the normal equations, then their solution where it is turned */
    cairn_real (*right)[3];
    /* of the last step with a factor of other poses */
    cairn_real (*direction)[3];
    /* of the poses at which the matrix was factored */
    cairn_real *heading;
    /* [max_links] */
    struct pose_graph_link *links;
    int32_t fixed_count;
    /* 1: the solver knows the structure */
    int32_t analyzed;
    /* 1: the solver has too little room for the factor */
    int32_t full;
    /* 1: the poses are a solution */
    int32_t settled;
    /* 1: the solver holds the inverse */
    int32_t has_marginals;
    /* for the step that ends */
    cairn_status outcome;
    int32_t mode, stage, at, debt;
    /* of the kernel's c^2, >= 1 */
    cairn_real widening;
    /* share of the diagonal that is added */
    cairn_real damping;
    /* 1: it has been raised since the last step that was taken */
    int32_t refused;
    /* part of the step that is tried */
    cairn_real length;
    /* 1: the next step is made with the factor of one before */
    int32_t reuse;
    /* 1: it begins at the trial poses, though their cost is higher */
    int32_t ahead;
    /* by so much the last step that was taken made the cost less */
    cairn_real better;
    /* right side by solution; 0: of no step yet */
    cairn_real slope, last_slope;
    /* direction by matrix by direction */
    cairn_real curvature;
    /* of the base, with the kernel as it is */
    cairn_real base_cost;
    /* of a pass over the links */
    cairn_real chi2, cost, largest;
};

/* The information turned from the frame of a pose to that in which it has the heading theta. */
cairn_sym3 cairn_pose_graph_turned(cairn_sym3 information, cairn_real theta);

/* The poses at which the links are taken: those of the trial where they are being made. */
const cairn_pose *cairn_pose_graph_base(const cairn_pose_graph *g);

/* Adds what a link asks for in the mode at hand to the normal equations; its part of the
 * curvature along the direction; adds chi2 and cost of a link at the accepted poses; the same at
 * the trial ones, where a Newton step may begin with a factor that is there, so that it adds to
 * the right side as well. */
void cairn_pose_graph_assemble_link(cairn_pose_graph *g, int32_t index);
cairn_real cairn_pose_graph_curvature_of_link(const cairn_pose_graph *g, int32_t index);
void cairn_pose_graph_cost_of_link(cairn_pose_graph *g, int32_t index);
void cairn_pose_graph_try_link(cairn_pose_graph *g, int32_t index);

/* Begins a stage of a mode. */
void cairn_pose_graph_enter(cairn_pose_graph *g, int32_t mode, int32_t stage);

/* Waits for the solver's structure once more. */
void cairn_pose_graph_go_on(cairn_pose_graph *g);

/* 1 when no solution runs. */
static inline int cairn_pose_graph_is_idle(const cairn_pose_graph *g)
{
    return g->stage == POSE_GRAPH_IDLE && g->debt == 0 && g->outcome == CAIRN_OK;
}

/* 1 for poses that do not move. */
static inline int cairn_pose_graph_stays(const cairn_pose_graph *g, int32_t pose)
{
    return g->fixed_count > 0 ? g->fixed[pose] : pose == 0;
}

#endif
