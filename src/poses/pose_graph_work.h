/* Private state of the pose_graph module: pose_graph.c (the graph), pose_graph_begin.c
 * (connectivity and structure), pose_graph_solve.c (iterations) and pose_graph_link.c (residuals
 * and normal equations). */
#ifndef CAIRN_POSES_POSE_GRAPH_WORK_H
#define CAIRN_POSES_POSE_GRAPH_WORK_H

#include "cairn/pose_graph.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_pose_graph_parameters;

/* Linear problem that is being solved. */
typedef uint8_t pose_graph_mode;
enum {
    POSE_GRAPH_INITIAL_COST, /* none: the cost of the initial poses */
    POSE_GRAPH_HEADINGS,     /* chordal initialisation: cosines and sines */
    POSE_GRAPH_JOINT,        /* chordal initialisation: poses, linearized about those headings */
    POSE_GRAPH_NEWTON,       /* a Newton step of all poses */
    POSE_GRAPH_COVARIANCE    /* none: the inverse */
};

struct pose_graph_link {
    int32_t first, second;
    cairn_pose measured;
    cairn_sym3 information; /* in the frame of the first pose */
    cairn_real chi2, weight;
    int32_t is_excluded;
};

/* Sums and maximum over a pass of the links. */
typedef struct pose_graph_sums {
    cairn_real chi2, cost, max_chi2;
} pose_graph_sums;

/* The linear system. */
typedef struct pose_graph_system {
    /* [max_poses] */
    cairn_sym3 *diagonal;
    /* right-hand side of the normal equations; the rotated solution with a reused factor */
    cairn_real (*right)[3];
    /* headings at which the matrix was factored, rad */
    cairn_real *heading;
    int32_t resume;
    /* Status of the solver's last phase. */
    cairn_status solver_status;
    /* Pose that a singular system leaves undetermined; -1: unknown. */
    int32_t singular_pose;
    pose_graph_mode mode;
    /* 1: it has no solution */
    uint8_t is_singular;
} pose_graph_system;

/* The damped Newton steps. */
typedef struct pose_graph_newton {
    /* [max_poses] last conjugate direction with a reused factor */
    cairn_real (*direction)[3];
    /* factor on the kernel's c^2 (graduated non-convexity), >= 1 */
    cairn_real kernel_scale;
    /* Levenberg-Marquardt damping: share of the diagonal that is added */
    cairn_real damping;
    /* fraction of the full step that is tried (backtracking) */
    cairn_real step_fraction;
    /* decrease of the cost by the last accepted step */
    cairn_real last_decrease;
    /* right-hand side times solution; 0: no step yet */
    cairn_real slope, last_slope;
    /* direction^T matrix direction */
    cairn_real curvature;
    /* cost at the linearization point, with the current kernel */
    cairn_real base_cost;
    /* 1: the damping was raised since the last accepted step */
    uint8_t was_rejected;
    /* 1: the next step reuses the last factor as a preconditioner */
    uint8_t reuse_factor;
    /* 1: watchdog: the step starts at the trial poses, though their cost is higher */
    uint8_t is_watchdog_step;
} pose_graph_newton;

struct cairn_pose_graph {
    /* Resume points: of the work, of its current part, and of the current pass over poses or
     * links. */
    int32_t resume, part_resume, pass_resume;
    /* Units charged for the operation that waits. */
    int32_t units_charged;
    /* Cursor of the current pass. */
    int32_t index;
    /* Status of the work. */
    cairn_status outcome;
    /* 1: a solution, or the computation of the marginals, is under way */
    uint8_t is_solving, is_inverting;

    /* ---- The graph, and what is known of it ---- */
    /* 1: the solver has the sparsity structure */
    uint8_t analyzed;
    /* 1: the factor exceeds max_fill */
    uint8_t fill_exceeded;
    /* 1: the poses are a solution */
    uint8_t is_solution;
    /* 1: the solver holds the inverse */
    uint8_t has_marginals;
    /* NULL: the solver is the caller's */
    cairn_block_solver *builtin_solver;
    /* [max_poses] accepted poses */
    cairn_pose *poses;
    int32_t *fixed;
    /* [max_links] */
    struct pose_graph_link *links;

    /* ---- Of a solution, or of the computation of the marginals ---- */
    /* [max_poses] connected component of a pose (union-find), at the begin */
    int32_t *root;
    /* [max_poses] */
    cairn_pose *trial;
    cairn_pose_graph_solver solver;
    pose_graph_sums sums;
    int32_t fixed_count; /* fixed poses */
    pose_graph_system system;
    pose_graph_newton newton;
    cairn_pose_graph_state state;
    cairn_pose_graph_params params;
};

/* Returns the linearization point of the links: the trial poses where these are being built. */
const cairn_pose *cairn_pose_graph_linearization_poses(const cairn_pose_graph *graph);

/* Link operations. assemble: adds the link's blocks to the normal equations of the current mode.
 * curvature: returns its part of the curvature along the direction. cost: adds chi2 and cost at the
 * accepted poses. try: adds chi2 and cost at the trial poses; where a Newton step may start with
 * the existing factor also the right-hand side. */
void cairn_pose_graph_assemble_link(cairn_pose_graph *graph, int32_t index);
cairn_real cairn_pose_graph_curvature_of_link(const cairn_pose_graph *graph, int32_t index);
void cairn_pose_graph_cost_of_link(cairn_pose_graph *graph, int32_t index);
void cairn_pose_graph_try_link(cairn_pose_graph *graph, int32_t index);

/* Returns 1 when no solution is running. */
static inline int cairn_pose_graph_is_idle(const cairn_pose_graph *graph)
{
    return !graph->is_solving && !graph->is_inverting;
}

/* Returns 1 for fixed poses. */
static inline int cairn_pose_graph_is_fixed(const cairn_pose_graph *graph, int32_t pose)
{
    return graph->fixed_count > 0 ? graph->fixed[pose] : pose == 0;
}

#endif
