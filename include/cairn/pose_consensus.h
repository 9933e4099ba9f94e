/* pose_consensus: robust pose estimation from many competing relative measurements, by the largest
 * consistent set (consensus set) of inliers.
 *
 * Nodes are scans, places or whole maps. A hypothesis is a measured relative pose of two nodes. A
 * pair may have several that exclude each other, and most may be outliers.
 *
 * Method:
 * 1. Seeds: each start is a hypothesis that agrees with no map found so far.
 * 2. Greedy growth: every hypothesis from a placed node proposes a pose of an unplaced node, all
 *    others vote, and the best supported candidate is placed.
 * 3. Coordinate ascent: every node is chosen again given the others until nothing changes.
 * 4. The start with the greatest total log-likelihood ratio wins.
 * 5. Ambiguous nodes are reported with their alternatives, unconnected nodes as components. */
#ifndef CAIRN_POSE_CONSENSUS_H
#define CAIRN_POSE_CONSENSUS_H

#include "cairn/geometry.h"
#include "cairn/object.h"
#include "cairn/pool.h"
#include "cairn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A relative pose measurement: the pose of the second node in the frame of the first. */
typedef struct cairn_pose_consensus_relative_pose {
    /* nodes that the hypothesis joins */
    int32_t first, second;
    /* pose of the second node in the frame of the first */
    cairn_pose first_second;
    /* row-major over (x, y, theta) of first_second in m and rad, in the frame of the first node */
    cairn_real covariance[9];
    /* nats, > 0: log-likelihood ratio of the pair's data, for this pose against chance; scores of
     * independent pairs add up */
    cairn_real score;
} cairn_pose_consensus_relative_pose;

/* Parameters; defaults in brackets. */
typedef struct cairn_pose_consensus_params {
    /* 1 ... 2^16 (64): capacity for nodes */
    int32_t max_nodes;
    /* 1 ... 2^20 (1024): capacity for hypotheses of relative poses */
    int32_t max_hypotheses;
    /* >= 1 (16): growths, each from the strongest hypothesis that no map found so far agrees
     * with */
    int32_t max_starts;
    /* >= 0 (10): rounds in which every node is chosen again, and in which blocks of nodes are
     * moved */
    int32_t max_rounds;
    /* 1 ... 32 (8): candidates of a choice, by votes, that the likelihood functions evaluate */
    int32_t max_candidates;
    /* 0 ... 32 (4): alternatives reported per node */
    int32_t max_alternatives;
    /* m, > 0, <= 1e6 (0.03): model noise of the nodes' positions, added in quadrature to the
     * covariances */
    cairn_real sigma;
    /* rad, > 0, <= 1e6 (0.6 degrees): model noise of the headings, likewise; times the distance of
     * the nodes it adds to their positions */
    cairn_real sigma_theta;
    /* > 0, <= 1e6 (16): a hypothesis is an inlier when its chi-squared (3 degrees of freedom) is
     * below */
    cairn_real max_chi2;
    /* >= 0, <= 1e6 (0): share of the best score of a pair that is subtracted when none of its
     * hypotheses is an inlier and there is no pairwise likelihood function */
    cairn_real conflict_penalty;
    /* nats, > 0, <= 1e6 (3): a node with less support from all others together is not placed */
    cairn_real min_support;
    /* > 0, < 1 (0.02): least weight of an alternative that makes its node ambiguous */
    cairn_real min_ambiguous_weight;
    /* nats, >= 0, <= 1e6 (0): significance threshold of a pose's support, violations subtracted
     * twice. A node is ambiguous that reaches it at an alternative pose, however much greater the
     * support of the chosen pose, if the violations there weigh at least min_ambiguous_weight; so
     * are nodes whose support comes mostly from ambiguous nodes. See also
     * cairn_pose_consensus_find_submaps(). 0: no test. */
    cairn_real significant_support;
} cairn_pose_consensus_params;

/* Returns the default parameters. */
cairn_pose_consensus_params cairn_pose_consensus_default(void);

/* Search for the poses that most hypotheses agree with. */
typedef struct cairn_pose_consensus cairn_pose_consensus;

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_pose_consensus_check(const cairn_pose_consensus_params *params,
                                                      cairn_object_fault *fault);

/* Returns the bytes that create() takes; 0 for params that create() would refuse. */
size_t cairn_pose_consensus_memory(const cairn_pose_consensus_params *params);

/* Creates the object in memory of the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_pose_consensus_create(cairn_pose_consensus **consensus,
                                                       cairn_pool *pool,
                                                       const cairn_pose_consensus_params *params);

/* Removes all hypotheses, bounds and likelihood functions, and sets the number of nodes.
 * CAIRN_BAD_ARGUMENT: NULL, nodes < 1. CAIRN_FULL: more than max_nodes. Linear in nodes.
 *
 * nodes: number of nodes, 1 ... max_nodes */
CAIRN_CHECKED cairn_status cairn_pose_consensus_clear(cairn_pose_consensus *consensus,
                                                      int32_t nodes);

/* Adds a hypothesis; it is copied, its index is the number of those before it. CAIRN_BAD_ARGUMENT:
 * NULL, nodes that do not exist or are equal, a score that is not > 0, a covariance that is not
 * positive semidefinite. CAIRN_NOT_FINITE. CAIRN_FULL: max_hypotheses. *fault, when not NULL, names
 * the field. Cancels a running search. Constant time.
 *
 * hypothesis: relative pose of two nodes with its score */
CAIRN_CHECKED cairn_status
cairn_pose_consensus_add(cairn_pose_consensus *consensus,
                         const cairn_pose_consensus_relative_pose *hypothesis, cairn_fault *fault);

/* Sets a prior bound of a node: within +-metres (a circle) and +-radians of map_node. Candidates
 * that no common motion of their component brings within the bounds are dropped, and the result is
 * in the frame of the bounds. CAIRN_BAD_ARGUMENT: NULL, no such node, not > 0. CAIRN_NOT_FINITE.
 * Cancels a running search. Constant time.
 *
 * node: index of the node
 * metres, radians: half-widths of the bound, > 0 */
CAIRN_CHECKED cairn_status cairn_pose_consensus_set_bound(cairn_pose_consensus *consensus,
                                                          int32_t node, cairn_pose map_node,
                                                          cairn_real metres, cairn_real radians);

/* What a likelihood function finds, and where it continues. All 0 at its first call for a pose. */
typedef struct cairn_pose_likelihood {
    /* nats: log-likelihood ratio, positive or negative; NaN and infinite count as 0 */
    cairn_real ratio;
    /* nats, >= 0: violations that were subtracted, of the joint likelihood alone */
    cairn_real against;
    /* of the function, until it returns 1: units charged for the operation that waits, see
     * cairn_budget_charge(), and where it continues */
    int32_t units_charged, resume;
} cairn_pose_likelihood;

/* Pairwise likelihood function: finds the log-likelihood ratio of the data of two nodes for a
 * relative pose. A pair counts with it, or with the score of its agreeing hypothesis where that is
 * greater. Charges each operation to the budget before it is done, at least one unit. Returns 1: done;
 * 0: the budget is used up, and the function is called again with the same arguments. The ratio is a
 * pure function of the nodes and the pose.
 *
 * context: that of cairn_pose_consensus_set_pair_likelihood()
 * first, second: nodes
 * likelihood: the ratio is written there */
typedef int (*cairn_pose_pair_likelihood)(void *context, int32_t first, int32_t second,
                                          cairn_pose first_second,
                                          cairn_pose_likelihood *likelihood, cairn_budget *budget);

/* Sets the pairwise likelihood function; NULL: none. Cancels a running search.
 *
 * likelihood: the function, or NULL
 * context: passed to the function */
void cairn_pose_consensus_set_pair_likelihood(cairn_pose_consensus *consensus,
                                              cairn_pose_pair_likelihood likelihood, void *context);

/* Joint likelihood function: finds the log-likelihood ratio of the data of a node for a pose given
 * all other nodes of a component: those i != node with parts[i] == part, at map_nodes[i]. Data that
 * several nodes share so count once, which sums over pairs cannot do. Charges and returns as the
 * pairwise one does; the values are a pure function of the nodes and the poses.
 *
 * context: that of cairn_pose_consensus_set_joint_likelihood()
 * node: the node in question
 * map_nodes: poses of all nodes
 * parts: component of each node
 * part: the component in question
 * likelihood: ratio and violations are written there */
typedef int (*cairn_pose_joint_likelihood)(void *context, int32_t node, cairn_pose map_node,
                                           const cairn_pose *map_nodes, const int32_t *parts,
                                           int32_t part, cairn_pose_likelihood *likelihood,
                                           cairn_budget *budget);

/* Sets the joint likelihood function; NULL: none. Its value replaces the sum over pairs wherever
 * the support by a whole component is evaluated; pairs still determine the tree of strongest links.
 * clear() removes it. Cancels a running search.
 *
 * likelihood: the function, or NULL
 * context: passed to the function */
void cairn_pose_consensus_set_joint_likelihood(cairn_pose_consensus *consensus,
                                               cairn_pose_joint_likelihood likelihood,
                                               void *context);

/* Starts the search. CAIRN_EMPTY: no nodes (clear() was never called). CAIRN_BAD_ARGUMENT: NULL.
 * Linear in nodes and hypotheses. */
CAIRN_CHECKED cairn_status cairn_pose_consensus_begin(cairn_pose_consensus *consensus);

/* Continues the search. CAIRN_OK: it has ended. CAIRN_MORE: the budget is used up.
 * CAIRN_BAD_ARGUMENT: NULL. Every operation is charged before it is done: a unit for every four
 * hypotheses visited. The largest ones visit the hypotheses of two nodes, or all nodes. The
 * likelihood functions charge their own. At most starts * (nodes + rounds) choices; the moves of
 * blocks visit every hypothesis for every node max_rounds times, plus the choices that follow. */
CAIRN_CHECKED cairn_status cairn_pose_consensus_step(cairn_pose_consensus *consensus,
                                                     cairn_budget *budget);

/* Starts to split the components of the result into submaps, where the links between them may be
 * due to chance. A node is a submap when its support, violations subtracted twice, is below
 * params.significant_support. So are several nodes together when their links to the rest,
 * violations not subtracted, are below four times that. Submaps are split off one by one, the least
 * supported first. Poses and components stay; nodes outside the largest submap of their component
 * become ambiguous. The link_support of all nodes is found before the first split. step() until
 * CAIRN_OK, as after begin(). CAIRN_EMPTY: there is no result. CAIRN_BAD_ARGUMENT: NULL. Cost: for
 * every submap one pass over all pairs, and one evaluation of the joint likelihood at every node for
 * each pair of the tree above it. */
CAIRN_CHECKED cairn_status cairn_pose_consensus_find_submaps(cairn_pose_consensus *consensus);

/* ---- The result: empty until step() returns CAIRN_OK ---- */

/* Estimate of a node. */
typedef struct cairn_pose_consensus_estimate {
    /* in the frame of its component: that of its first node, or of the bounds if any */
    cairn_pose map_node;
    /* row-major over (x, y, theta) in m and rad, in that frame, of the agreeing hypotheses, their
     * other nodes given */
    cairn_real covariance[9];
    /* nats: log-likelihood ratio given all other nodes of the component, violations subtracted */
    cairn_real support;
    /* connected component; 0: the largest; a node without support is a component of its own */
    int32_t component;
    /* pairs with a positive log-likelihood ratio */
    int32_t agreeing;
    /* pairs with a negative log-likelihood ratio */
    int32_t conflicting;
    /* number of alternatives, see cairn_pose_consensus_alternative() */
    int32_t alternatives;
    /* 1: an alternative weighs at least params.min_ambiguous_weight, or see
     * params.significant_support */
    int32_t ambiguous;
    /* submap within the component, by cairn_pose_consensus_find_submaps(); 0: the largest */
    int32_t submap;
    /* nats, by the same: the weakest link between the node and most of its component. Cut at an edge
     * of its maximum spanning tree, a component has a smaller side; its support by the larger one,
     * violations subtracted twice, over the root of its number of nodes, the least of all cuts with
     * the node on the smaller side. CAIRN_REAL_MAX: on none, and before submaps are found. */
    cairn_real link_support;
} cairn_pose_consensus_estimate;

/* Alternative pose of a node given the others, or (is_other_map 1) given another consistent map. */
typedef struct cairn_pose_consensus_competing_pose {
    /* alternative pose of the node in the map */
    cairn_pose map_node;
    cairn_real support; /* nats; of the other map's total for is_other_map 1 */
    /* softmax of the support over the chosen pose and all alternatives, 0 ... 1 */
    cairn_real weight;
    /* 1: given another consistent map */
    int32_t is_other_map;
} cairn_pose_consensus_competing_pose;

/* Result of a search, and counts of the work done. */
typedef struct cairn_pose_consensus_result {
    cairn_real total;           /* nats, sum over all pairs */
    cairn_real competing_total; /* total of the best competing map found; 0: none */
    int32_t nodes, placed;      /* placed: nodes in components of two or more */
    int32_t components;         /* connected components; 1 is good */
    int32_t ambiguous;          /* ambiguous nodes */
    int32_t start;              /* seed hypothesis of the best map */
    /* growths, and rounds of all of them */
    int32_t starts, rounds;
    int32_t inliers; /* inlier hypotheses */
    /* work units charged */
    int64_t units;
} cairn_pose_consensus_result;

/* Returns the result; all zero until step() returns CAIRN_OK. */
cairn_pose_consensus_result cairn_pose_consensus_read(const cairn_pose_consensus *consensus);

/* Returns the estimate of a node; all zero for a node that does not exist.
 *
 * node: index of the node */
cairn_pose_consensus_estimate cairn_pose_consensus_node(const cairn_pose_consensus *consensus,
                                                        int32_t node);

/* Returns an alternative of a node, the most probable first; all zero for one that does not
 * exist.
 *
 * index: 0 ... number of alternatives - 1
 * node: index of the node */
cairn_pose_consensus_competing_pose
cairn_pose_consensus_alternative(const cairn_pose_consensus *consensus, int32_t node,
                                 int32_t index);

/* Returns 1 when a hypothesis is an inlier of the poses found; the inliers are the measurements for
 * a joint solution.
 *
 * hypothesis: index of the hypothesis */
int32_t cairn_pose_consensus_is_inlier(const cairn_pose_consensus *consensus, int32_t hypothesis);

#ifdef __cplusplus
}
#endif

#endif
