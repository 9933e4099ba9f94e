/* pose_graph: poses from relative measurements: Gauss-Newton with damping, robust kernels,
 * covariances.
 *
 * A graph has poses map_i and links: a measured pose of j seen from i with its information matrix.
 * Wanted are the poses that minimise the sum of rho(e^T Omega e), where e = (R_z^T (R_i^T (t_j -
 * t_i) - t_z), theta_j - theta_i - theta_z) as in g2o. Poses that are fixed stay; when none is, the
 * first one is.
 *
 * The linear systems are solved behind a small interface: by block_solver in fixed memory, or by
 * one that the user brings. */
#ifndef CAIRN_POSE_GRAPH_H
#define CAIRN_POSE_GRAPH_H

#include "cairn/block_solver.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A solver of block-sparse systems; every call is as that of block_solver. */
typedef struct cairn_pose_solver {
    void *context;
    cairn_status (*begin)(void *context, int32_t poses);
    cairn_status (*add_link)(void *context, int32_t first, int32_t second);
    cairn_status (*analyze)(void *context);
    cairn_status (*clear)(void *context);
    cairn_status (*add_pose_block)(void *context, int32_t pose, cairn_sym3 block);
    cairn_status (*add_link_block)(void *context, int32_t link, const cairn_real block[9]);
    cairn_status (*factor)(void *context);
    cairn_status (*solve)(void *context, const cairn_real *b);
    cairn_status (*solution)(const void *context, int32_t pose, cairn_real x[3]);
    cairn_status (*invert)(void *context);
    cairn_status (*covariance)(const void *context, int32_t first, int32_t second,
                               cairn_real block[9]);
    cairn_status (*step)(void *context, cairn_budget *budget);
    cairn_block_solver_result (*read)(const void *context);
} cairn_pose_solver;

/* The interface of a block_solver, which must stay. */
cairn_pose_solver cairn_pose_solver_of(cairn_block_solver *solver);

/* rho(s) of s = e^T Omega e, with the width c: quadratic near 0, all slower beyond c. */
typedef int32_t cairn_pose_graph_kernel;
enum {
    /* s */
    CAIRN_POSE_GRAPH_SQUARE = 0,
    /* 2 c sqrt(s) - c^2 beyond c^2 */
    CAIRN_POSE_GRAPH_HUBER = 1,
    /* c^2 log(1 + s / c^2) */
    CAIRN_POSE_GRAPH_CAUCHY = 2,
    /* s c^2 / (s + c^2) */
    CAIRN_POSE_GRAPH_GEMAN_MCCLURE = 3,
    /* s, beyond c^2 c^2 (3 s - c^2) / (s + c^2): dynamic covariance scaling with Phi = c^2
     * (Agarwal et al. 2013) */
    CAIRN_POSE_GRAPH_DCS = 4
};

typedef int32_t cairn_pose_graph_start;
enum {
    /* from the poses as they are */
    CAIRN_POSE_GRAPH_GIVEN = 0,
    /* headings first, as a linear problem of their cosines and sines (Carlone, Tron, Daniilidis
     * and Dellaert 2015), then the poses, as one about these headings (Carlone, Aragues,
     * Castellanos and Bona 2014) */
    CAIRN_POSE_GRAPH_CHORDAL = 1,
    /* whichever of the two has the lower cost */
    CAIRN_POSE_GRAPH_BEST = 2
};

typedef struct cairn_pose_graph_params {
    /* 1 ... 2^22 (1000) */
    int32_t max_poses;
    /* 1 ... 2^24 (3000) */
    int32_t max_links;
    /* of the built-in solver, see block_solver (12000) */
    int32_t max_fill;
    /* (BEST) */
    cairn_pose_graph_start start;
    /* (SQUARE) */
    cairn_pose_graph_kernel kernel;
    /* c, in standard deviations, > 0 (3) */
    cairn_real width;
    /* not 0: begins with so wide a kernel that it is nearly SQUARE, narrowed in every iteration
     * (GNC, Yang et al. 2020). For GEMAN_MCCLURE, others are as they are (0) */
    int32_t graduated;
    /* >= 1, refused steps counted (100) */
    int32_t max_iterations;
    /* relative decrease of the cost, in (0, 1) (1e-9; float 1e-5) */
    cairn_real converged;
    /* links of e^T Omega e > this are counted as outliers, > 0 (16.27: 99.9 % of good ones are
     * below) */
    cairn_real outlier;
} cairn_pose_graph_params;

/* In brackets above. */
cairn_pose_graph_params cairn_pose_graph_default(void);

typedef struct cairn_pose_graph cairn_pose_graph;

typedef int32_t cairn_pose_graph_verdict;
enum {
    /* or nothing solved yet */
    CAIRN_POSE_GRAPH_RUNNING = 0,
    CAIRN_POSE_GRAPH_CONVERGED = 1,
    CAIRN_POSE_GRAPH_OUT_OF_ITERATIONS = 2,
    /* `pose` is the first that no links join to a fixed one; nothing was done */
    CAIRN_POSE_GRAPH_SPLIT = 3,
    /* the links do not determine `pose`; the poses are those of the best iteration */
    CAIRN_POSE_GRAPH_SINGULAR = 4
};

typedef struct cairn_pose_graph_state {
    cairn_pose_graph_verdict verdict;
    int32_t poses, links;
    int32_t iterations;
    int32_t chordal;         /* 1: begun from the chordal start */
    int32_t outliers;        /* links beyond params.outlier */
    int32_t pose;            /* of SPLIT and SINGULAR; else -1 */
    int32_t fill;            /* blocks of the factor, also when they did not fit */
    cairn_real chi2_initial; /* sum of e^T Omega e at the poses as they were given */
    cairn_real chi2;         /* ... at the last accepted ones */
    cairn_real cost_initial; /* sum of rho, likewise */
    cairn_real cost;
} cairn_pose_graph_state;

/* What a link says at the last accepted poses. */
typedef struct cairn_pose_graph_link {
    int32_t first, second;
    cairn_real chi2;   /* e^T Omega e */
    cairn_real weight; /* that the kernel gives it, 0 ... 1 */
    int32_t outlier;   /* 1: chi2 > params.outlier */
    int32_t dropped;   /* 1: left out by drop_link() */
} cairn_pose_graph_link;

/* 0 for params that create() would refuse. Without a solver of the user's own, max_fill counts. */
size_t cairn_pose_graph_memory(const cairn_pose_graph_params *params,
                               const cairn_pose_solver *solver);

/* solver: copied; NULL: a block_solver of the graph's own. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_pose_graph_create(cairn_pose_graph **graph, cairn_pool *pool,
                                                   const cairn_pose_graph_params *params,
                                                   const cairn_pose_solver *solver);

/* After a step that returned CAIRN_FULL: takes room for max_fill blocks from a pool whose memory
 * must stay, and goes on with the solution: a graph that was made with max_fill of 0 so takes
 * what it needs. The bytes are those of cairn_block_solver_extend_memory(). CAIRN_BAD_ARGUMENT:
 * NULL, no such step, the graph has been changed since (a new kernel is a change), it has a
 * solver of the user's own, or max_fill is less than the state's fill or more than 2^26.
 * CAIRN_NO_MEMORY: nothing has changed. */
CAIRN_CHECKED cairn_status cairn_pose_graph_extend(cairn_pose_graph *graph, cairn_pool *pool,
                                                   int32_t max_fill);

/* Forgets all poses and links. */
void cairn_pose_graph_clear(cairn_pose_graph *graph);

/* Adds a pose with its first guess; its index is the number of poses before it. While a solution
 * runs, all that changes the graph is refused. CAIRN_BAD_ARGUMENT, CAIRN_NOT_FINITE, CAIRN_FULL. */
CAIRN_CHECKED cairn_status cairn_pose_graph_add_pose(cairn_pose_graph *graph, cairn_pose map_pose);

/* Moves a pose. CAIRN_BAD_ARGUMENT: no such pose. CAIRN_NOT_FINITE. */
CAIRN_CHECKED cairn_status cairn_pose_graph_set_pose(cairn_pose_graph *graph, int32_t pose,
                                                     cairn_pose map_pose);

/* A fixed pose (yes not 0) stays where it is. CAIRN_BAD_ARGUMENT: no such pose. */
CAIRN_CHECKED cairn_status cairn_pose_graph_fix(cairn_pose_graph *graph, int32_t pose, int32_t yes);

/* Adds a link: second seen from first, and the inverse of its covariance over (x, y, theta) in
 * the frame of the measured pose itself, as in g2o. CAIRN_BAD_ARGUMENT: no such pose, first ==
 * second, or the information is not positive definite. CAIRN_NOT_FINITE, CAIRN_FULL. */
CAIRN_CHECKED cairn_status cairn_pose_graph_add_link(cairn_pose_graph *graph, int32_t first,
                                                     int32_t second, cairn_pose first_second,
                                                     cairn_sym3 information);

/* Leaves a link out (yes not 0), or takes it in again; its chi2 is still told.
 * CAIRN_BAD_ARGUMENT: no such link. */
CAIRN_CHECKED cairn_status cairn_pose_graph_drop_link(cairn_pose_graph *graph, int32_t link,
                                                      int32_t yes);

/* Gives a link another measurement, between these poses. Statuses of add_link();
 * CAIRN_BAD_ARGUMENT also: no such link. */
CAIRN_CHECKED cairn_status cairn_pose_graph_set_link(cairn_pose_graph *graph, int32_t link,
                                                     int32_t first, int32_t second,
                                                     cairn_pose first_second,
                                                     cairn_sym3 information);

/* Removes a pose and all its links. Those that come later move up: poses and links keep their
 * order. CAIRN_BAD_ARGUMENT: no such pose. Cost: a linear pass over poses and links. */
CAIRN_CHECKED cairn_status cairn_pose_graph_remove_pose(cairn_pose_graph *graph, int32_t pose);

/* Another kernel for the next solution. CAIRN_BAD_ARGUMENT: no such kernel, or width is not > 0. */
CAIRN_CHECKED cairn_status cairn_pose_graph_set_kernel(cairn_pose_graph *graph,
                                                       cairn_pose_graph_kernel kernel,
                                                       cairn_real width);

/* Starts to solve from the poses as they are. CAIRN_BAD_ARGUMENT: a solution runs. CAIRN_EMPTY:
 * no poses. Cost: a linear pass over poses and links. */
CAIRN_CHECKED cairn_status cairn_pose_graph_solve(cairn_pose_graph *graph);

/* Starts to compute covariances at the last accepted poses. CAIRN_BAD_ARGUMENT: a solution runs,
 * the last one did not end as CONVERGED or OUT_OF_ITERATIONS, or the graph has changed since. */
CAIRN_CHECKED cairn_status cairn_pose_graph_marginals(cairn_pose_graph *graph);

/* CAIRN_OK: nothing left to do, the verdict stands. CAIRN_MORE: go on. CAIRN_FULL: the factor
 * has more than max_fill blocks, the state tells how many; nothing was solved; extend() goes on.
 * CAIRN_NOT_FINITE: a cost overflows; nothing was solved. Costs 9 units for each link whose
 * equations are formed, 4 for each whose cost is, 1 for each pose in a pass over them, and what
 * the solver takes. */
CAIRN_CHECKED cairn_status cairn_pose_graph_step(cairn_pose_graph *graph, cairn_budget *budget);

cairn_pose_graph_state cairn_pose_graph_read(const cairn_pose_graph *graph);

/* The last accepted pose of an index below `poses`. */
cairn_pose cairn_pose_graph_pose(const cairn_pose_graph *graph, int32_t pose);

/* Of an index below `links`. */
cairn_pose_graph_link cairn_pose_graph_link_of(const cairn_pose_graph *graph, int32_t link);

/* What a link measured, as it was added (the information up to rounding); of an index below
 * `links`. */
cairn_pose cairn_pose_graph_measured(const cairn_pose_graph *graph, int32_t link,
                                     cairn_sym3 *information);

/* Covariance of two poses' errors, row-major over (x, y, theta) of the first and of the second,
 * in the map; zero for fixed ones. Of a pose with itself and of linked ones. CAIRN_EMPTY: no
 * marginals. CAIRN_UNSUPPORTED: outside the pattern. CAIRN_BAD_ARGUMENT: no such pose. */
CAIRN_CHECKED cairn_status cairn_pose_graph_covariance(const cairn_pose_graph *graph, int32_t first,
                                                       int32_t second, cairn_real block[9]);

#ifdef __cplusplus
}
#endif

#endif
