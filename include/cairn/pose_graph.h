/* pose_graph: pose graph optimization (graph SLAM back end): Levenberg-Marquardt, robust kernels,
 * marginal covariances.
 *
 * A graph has poses map_i and links (relative pose constraints): a measured pose of j in the frame
 * of i with its information matrix Omega. The solution minimises the sum of rho(e^T Omega e), where
 * e = (R_z^T (R_i^T (t_j - t_i) - t_z), theta_j - theta_i - theta_z) as in g2o. Fixed poses stay;
 * when none is fixed, the first one is (gauge freedom).
 *
 * The linear systems are solved behind a small interface: by block_solver in fixed memory, or by a
 * solver of the caller. */
#ifndef CAIRN_POSE_GRAPH_H
#define CAIRN_POSE_GRAPH_H

#include "cairn/block_solver.h"
#include "cairn/object.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Interface of a solver of block-sparse systems; every call is as that of block_solver. */
typedef struct cairn_pose_graph_solver {
    /* passed to all functions */
    void *context;
    /* as cairn_block_solver_begin() */
    cairn_status (*begin)(void *context, int32_t poses);
    /* as cairn_block_solver_add_link() */
    cairn_status (*add_link)(void *context, int32_t first, int32_t second);
    /* as cairn_block_solver_analyze() */
    cairn_status (*analyze)(void *context);
    /* as cairn_block_solver_clear() */
    cairn_status (*clear)(void *context);
    /* as cairn_block_solver_add_pose_block() */
    cairn_status (*add_pose_block)(void *context, int32_t pose, cairn_sym3 block);
    /* as cairn_block_solver_add_link_block() */
    cairn_status (*add_link_block)(void *context, int32_t link, const cairn_real block[9]);
    /* as cairn_block_solver_factor() */
    cairn_status (*factor)(void *context);
    /* as cairn_block_solver_solve() */
    cairn_status (*solve)(void *context, const cairn_real *b);
    /* as cairn_block_solver_solution() */
    cairn_status (*solution)(const void *context, int32_t pose, cairn_real x[3]);
    /* as cairn_block_solver_invert() */
    cairn_status (*invert)(void *context);
    /* as cairn_block_solver_covariance() */
    cairn_status (*covariance)(const void *context, int32_t first, int32_t second,
                               cairn_real block[9]);
    /* as cairn_block_solver_step() */
    cairn_status (*step)(void *context, cairn_budget *budget);
    /* as cairn_block_solver_read() */
    cairn_block_solver_result (*read)(const void *context);
} cairn_pose_graph_solver;

/* Returns the interface of a block_solver, which must outlive it. */
cairn_pose_graph_solver cairn_pose_graph_solver_of(cairn_block_solver *solver);

/* Robust kernel rho(s) of s = e^T Omega e, with the width c: quadratic near 0, slower beyond c. */
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

/* Initial poses of an optimization. */
typedef int32_t cairn_pose_graph_start;
enum {
    /* from the current poses */
    CAIRN_POSE_GRAPH_GIVEN = 0,
    /* chordal initialisation: headings first, as a linear problem of their cosines and sines
     * (Carlone, Tron, Daniilidis and Dellaert 2015), then the poses, linearized about these
     * headings (Carlone, Aragues, Castellanos and Bona 2014) */
    CAIRN_POSE_GRAPH_CHORDAL = 1,
    /* the start of lower cost */
    CAIRN_POSE_GRAPH_BEST = 2
};

/* Parameters; defaults in brackets. */
typedef struct cairn_pose_graph_params {
    /* 1 ... 2^22 (1000): capacity for poses */
    int32_t max_poses;
    /* 1 ... 2^24 (3000): capacity for links */
    int32_t max_links;
    /* 0 ... 2^26 (12000): blocks of the built-in solver's factor, see block_solver */
    int32_t max_fill;
    /* any (CAIRN_POSE_GRAPH_BEST): initial poses */
    cairn_pose_graph_start start;
    /* any (CAIRN_POSE_GRAPH_SQUARE): robust kernel */
    cairn_pose_graph_kernel kernel;
    /* standard deviations, > 0, <= 1e6 (3): width c of the kernel */
    cairn_real kernel_width;
    /* 0 or 1 (0): 1: graduated non-convexity (GNC, Yang et al. 2020): the kernel starts nearly
     * quadratic and is narrowed in every iteration. GEMAN_MCCLURE only; other kernels stay
     * unchanged. */
    int32_t graduated;
    /* >= 1 (100): greatest number of iterations, rejected steps included */
    int32_t max_iterations;
    /* > 0, < 1 (1e-9): converged below this relative decrease of the cost; 1e-5 by default in
     * float */
    cairn_real converged_decrease;
    /* > 0 (16.27): links with e^T Omega e above this are counted as outliers; 99.9 % of the inliers
     * are below the default */
    cairn_real max_chi2;
} cairn_pose_graph_params;

/* Returns the default parameters. */
cairn_pose_graph_params cairn_pose_graph_default(void);

/* Pose graph and its optimizer. */
typedef struct cairn_pose_graph cairn_pose_graph;

/* How an optimization has ended. */
typedef int32_t cairn_pose_graph_verdict;
enum {
    /* running, or nothing was solved yet */
    CAIRN_POSE_GRAPH_RUNNING = 0,
    /* the relative decrease of the cost was below converged_decrease */
    CAIRN_POSE_GRAPH_CONVERGED = 1,
    /* max_iterations were done without convergence */
    CAIRN_POSE_GRAPH_OUT_OF_ITERATIONS = 2,
    /* disconnected graph: `pose` is the first pose without a path to a fixed one; nothing was
     * solved */
    CAIRN_POSE_GRAPH_DISCONNECTED = 3,
    /* the links do not determine `pose`; the poses are those of the best iteration */
    CAIRN_POSE_GRAPH_SINGULAR = 4
};

/* State after the last iteration. */
typedef struct cairn_pose_graph_state {
    /* running, or how the optimization has ended */
    cairn_pose_graph_verdict verdict;
    /* number of poses and of links */
    int32_t poses, links;
    /* iterations done, rejected steps included */
    int32_t iterations;
    int32_t chordal;         /* 1: started from the chordal initialisation */
    int32_t outliers;        /* links with chi2 > params.max_chi2 */
    int32_t pose;            /* the pose of DISCONNECTED and SINGULAR; else -1 */
    int32_t fill;            /* blocks of the factor, also when they exceeded max_fill */
    cairn_real chi2_initial; /* sum of e^T Omega e at the initial poses */
    cairn_real chi2;         /* sum of e^T Omega e at the last accepted poses */
    cairn_real cost_initial; /* sum of rho at the initial poses */
    /* sum of the robust kernel over the links */
    cairn_real cost;
} cairn_pose_graph_state;

/* Residual of a link at the last accepted poses. */
typedef struct cairn_pose_graph_link {
    /* poses that the link joins */
    int32_t first, second;
    cairn_real chi2;     /* e^T Omega e */
    cairn_real weight;   /* weight by the robust kernel, 0 ... 1 */
    int32_t is_outlier;  /* 1: chi2 > params.max_chi2 */
    int32_t is_excluded; /* 1: excluded by exclude_link() */
} cairn_pose_graph_link;

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_pose_graph_check(const cairn_pose_graph_params *params,
                                                  cairn_object_fault *fault);

/* Returns the bytes that create() takes; 0 for params that create() would refuse. solver: as in
 * create(); max_fill takes memory only with NULL. */
size_t cairn_pose_graph_memory(const cairn_pose_graph_params *params,
                               const cairn_pose_graph_solver *solver);

/* Creates a graph. solver: copied; NULL: a built-in block_solver. CAIRN_BAD_ARGUMENT,
 * CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_pose_graph_create(cairn_pose_graph **graph, cairn_pool *pool,
                                                   const cairn_pose_graph_params *params,
                                                   const cairn_pose_graph_solver *solver);

/* Extends the factor's memory to max_fill blocks after a step that returned CAIRN_FULL, from a pool
 * whose memory must stay, and resumes the solution. A graph created with max_fill 0 can so take
 * exactly the memory it needs: cairn_block_solver_extend_memory() bytes. CAIRN_BAD_ARGUMENT: NULL,
 * no such step, the graph has been changed since (a new kernel is a change), it has a solver of the
 * caller, or max_fill is less than the state's fill or more than 2^26. CAIRN_NO_MEMORY: nothing has
 * changed.
 *
 * max_fill: new capacity for blocks of the factor */
CAIRN_CHECKED cairn_status cairn_pose_graph_extend(cairn_pose_graph *graph, cairn_pool *pool,
                                                   int32_t max_fill);

/* Removes all poses and links. */
void cairn_pose_graph_clear(cairn_pose_graph *graph);

/* Adds a pose with its initial value; its index is the number of poses before it. While a solution
 * is running, every change of the graph is refused. CAIRN_BAD_ARGUMENT, CAIRN_NOT_FINITE,
 * CAIRN_FULL. */
CAIRN_CHECKED cairn_status cairn_pose_graph_add_pose(cairn_pose_graph *graph, cairn_pose map_pose);

/* Sets a pose. CAIRN_BAD_ARGUMENT: no such pose. CAIRN_NOT_FINITE. */
CAIRN_CHECKED cairn_status cairn_pose_graph_set_pose(cairn_pose_graph *graph, int32_t pose,
                                                     cairn_pose map_pose);

/* Fixes a pose (fixed not 0), or frees it. CAIRN_BAD_ARGUMENT: no such pose.
 *
 * pose: index of the pose
 * fixed: 0: the pose is free */
CAIRN_CHECKED cairn_status cairn_pose_graph_fix(cairn_pose_graph *graph, int32_t pose,
                                                int32_t fixed);

/* Adds a link: the measured pose of second in the frame of first, and its information matrix
 * (inverse covariance) over (x, y, theta) in the frame of the measured pose itself, as in g2o.
 * CAIRN_BAD_ARGUMENT: no such pose, first == second, or the information is not positive definite.
 * CAIRN_NOT_FINITE, CAIRN_FULL.
 *
 * first, second: indices of the poses
 * information: positive definite */
CAIRN_CHECKED cairn_status cairn_pose_graph_add_link(cairn_pose_graph *graph, int32_t first,
                                                     int32_t second, cairn_pose first_second,
                                                     cairn_sym3 information);

/* Excludes a link from the solution (excluded not 0), or includes it again; its chi2 is still
 * reported. CAIRN_BAD_ARGUMENT: no such link.
 *
 * link: index of the link
 * excluded: 0: the link is included again */
CAIRN_CHECKED cairn_status cairn_pose_graph_exclude_link(cairn_pose_graph *graph, int32_t link,
                                                         int32_t excluded);

/* Replaces the measurement of a link, and the poses that it joins. Statuses of add_link();
 * CAIRN_BAD_ARGUMENT also: no such link.
 *
 * first, second, first_second, information: as for add_link() */
CAIRN_CHECKED cairn_status cairn_pose_graph_set_link(cairn_pose_graph *graph, int32_t link,
                                                     int32_t first, int32_t second,
                                                     cairn_pose first_second,
                                                     cairn_sym3 information);

/* Removes a pose and all its links. Later poses and links move up in order. CAIRN_BAD_ARGUMENT: no
 * such pose. Cost: a linear pass over poses and links. */
CAIRN_CHECKED cairn_status cairn_pose_graph_remove_pose(cairn_pose_graph *graph, int32_t pose);

/* Sets the robust kernel of the next solution. CAIRN_BAD_ARGUMENT: no such kernel, or width is not
 * in the range of kernel_width.
 *
 * width: width c of the kernel, in standard deviations, > 0, <= 1e6 */
CAIRN_CHECKED cairn_status cairn_pose_graph_set_kernel(cairn_pose_graph *graph,
                                                       cairn_pose_graph_kernel kernel,
                                                       cairn_real width);

/* Starts to solve from the current poses. CAIRN_BAD_ARGUMENT: a solution is running. CAIRN_EMPTY:
 * no poses. Cost: a linear pass over poses and links. */
CAIRN_CHECKED cairn_status cairn_pose_graph_solve(cairn_pose_graph *graph);

/* Starts to compute the marginal covariances at the last accepted poses. CAIRN_BAD_ARGUMENT: a
 * solution is running, the last one did not end as CONVERGED or OUT_OF_ITERATIONS, or the graph has
 * changed since. */
CAIRN_CHECKED cairn_status cairn_pose_graph_marginals(cairn_pose_graph *graph);

/* Continues. CAIRN_OK: the solution has ended; the verdict is valid. CAIRN_MORE: the budget is used
 * up. CAIRN_FULL: the factor needs more than max_fill blocks, their number is the state's fill;
 * nothing was solved; extend() resumes. CAIRN_NOT_FINITE: a cost overflows; nothing was solved.
 * Cost: 9 units per link whose normal equations are formed, 4 per link whose cost is evaluated, 1
 * per pose in a pass over the poses, plus the solver's units. */
CAIRN_CHECKED cairn_status cairn_pose_graph_step(cairn_pose_graph *graph, cairn_budget *budget);

/* Returns the state after the last iteration. */
cairn_pose_graph_state cairn_pose_graph_read(const cairn_pose_graph *graph);

/* Returns the last accepted pose of an index below `poses`; the identity outside. */
cairn_pose cairn_pose_graph_pose(const cairn_pose_graph *graph, int32_t pose);

/* Returns the residual of a link of an index below `links`; outside a link of the poses -1 and -1.
 *
 * link: index of the link */
cairn_pose_graph_link cairn_pose_graph_link_of(const cairn_pose_graph *graph, int32_t link);

/* Returns the measured pose of a link of an index below `links`, as it was added, and its
 * information (up to rounding); outside the identity and 0.
 *
 * link: index of the link
 * information: set to the information matrix */
cairn_pose cairn_pose_graph_measurement(const cairn_pose_graph *graph, int32_t link,
                                        cairn_sym3 *information);

/* Covariance of two poses' errors, row-major over (x, y, theta) of the first and of the second in m
 * and rad, in the map frame; zero for fixed poses. For a pose with itself and for linked poses.
 * CAIRN_EMPTY: no marginals. CAIRN_UNSUPPORTED: outside the sparsity pattern. CAIRN_BAD_ARGUMENT:
 * no such pose.
 *
 * block: [3][3] set to the covariance
 * first, second: indices of the poses */
CAIRN_CHECKED cairn_status cairn_pose_graph_covariance(const cairn_pose_graph *graph, int32_t first,
                                                       int32_t second, cairn_real block[9]);

#ifdef __cplusplus
}
#endif

#endif
