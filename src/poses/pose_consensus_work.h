/* Private state of the pose_consensus module: hypotheses, assignments (maps in progress), and
 * log-likelihood ratios. */
#ifndef CAIRN_POSES_POSE_CONSENSUS_WORK_H
#define CAIRN_POSES_POSE_CONSENSUS_WORK_H

#include "cairn/pose_consensus.h"
#include "cairn/small_matrix.h"
#include "src/base/object.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_pose_consensus_parameters;

/* A pose with the sine and cosine of its angle. */
typedef struct cairn_pose_consensus_pose {
    cairn_transform transform;
    cairn_real theta;
} cairn_pose_consensus_pose;

typedef struct cairn_pose_consensus_hypothesis {
    int32_t first, second;
    cairn_pose_consensus_pose first_second, second_first;
    /* information of first_second with the nodes' model noise, in the frame of the first */
    cairn_sym3 information;
    cairn_real score;
    /* score of the agreeing cycles through a third node */
    cairn_real cycle_score;
    /* 1: an inlier of a map found before, or the seed of one */
    int32_t is_explained;
} cairn_pose_consensus_hypothesis;

/* A hypothesis in the list of one of its nodes; the links of a node are contiguous, sorted by the
 * other node. */
typedef struct cairn_pose_consensus_link {
    int32_t other, hypothesis;
} cairn_pose_consensus_link;

/* Assignment of a node: its pose and its component, -1 when it is not placed. */
typedef struct cairn_pose_consensus_assignment {
    cairn_pose_consensus_pose pose;
    int32_t component;
    int32_t component_before; /* during a tentative merge */
} cairn_pose_consensus_assignment;

/* A node in the maximum spanning tree of its component. */
typedef struct cairn_pose_consensus_branch {
    int32_t parent; /* -1: a root; while submaps are numbered the first node of its own submap */
    int32_t is_in_tree;
    cairn_real log_likelihood_ratio; /* log-likelihood ratio of the pair with the parent, nats */
} cairn_pose_consensus_branch;

typedef struct cairn_pose_consensus_bound {
    cairn_pose centre;
    cairn_real metres, radians; /* metres 0: no bound */
} cairn_pose_consensus_bound;

typedef struct cairn_pose_consensus_candidate {
    cairn_pose_consensus_pose pose;
    cairn_real support, violations;
    /* score of the agreeing cycles of the proposing hypothesis, in growth; added to the support in
     * the choice */
    cairn_real cycle_score;
    int32_t node, component;
    /* 1: the node's current pose */
    int32_t is_current;
} cairn_pose_consensus_candidate;

/* Support of a pose of a node by all pairs, nats. */
typedef struct cairn_pose_consensus_support {
    cairn_real sum, violations; /* violations: the sum of the negative terms, >= 0 */
    int32_t agreeing, conflicting;
    int32_t units;
} cairn_pose_consensus_support;

typedef int32_t pose_consensus_phase;
enum {
    POSE_CONSENSUS_IDLE = 0,
    POSE_CONSENSUS_CYCLES,
    POSE_CONSENSUS_START,
    /* votes for the candidates of a choice ... */
    POSE_CONSENSUS_SEARCH,
    /* ... and evaluation of the best voted by the likelihood functions */
    POSE_CONSENSUS_EVALUATE,
    POSE_CONSENSUS_RELAX,
    POSE_CONSENSUS_MERGE,
    /* every node is assigned again, given the others */
    POSE_CONSENSUS_REASSIGN,
    POSE_CONSENSUS_TALLY,
    /* maximum spanning tree of the best map, ... */
    POSE_CONSENSUS_TREE,
    /* ... blocks cut off at its edges are moved as a whole */
    POSE_CONSENSUS_BLOCK,
    POSE_CONSENSUS_PROPOSE,
    /* submaps are split off, ... */
    POSE_CONSENSUS_SPLIT,
    /* ... measured ... */
    POSE_CONSENSUS_SUBMAPS,
    /* ... and numbered */
    POSE_CONSENSUS_NUMBER_SUBMAPS,
    POSE_CONSENSUS_REPORT,
    /* ambiguity propagates to nodes that depend on ambiguous ones */
    POSE_CONSENSUS_PROPAGATE_AMBIGUITY
};

/* Subject of a search. */
typedef int32_t cairn_pose_consensus_choice;
enum {
    POSE_CONSENSUS_CHOOSE_NEXT = 0,        /* the next node of the growing component */
    POSE_CONSENSUS_CHOOSE_REASSIGN = 1,    /* the pose of a node given the others */
    POSE_CONSENSUS_CHOOSE_ALTERNATIVES = 2 /* alternatives of a node */
};

struct cairn_pose_consensus {
    cairn_pose_consensus_params params;
    /* [max_hypotheses] */
    cairn_pose_consensus_hypothesis *hypotheses;
    /* [2 * max_hypotheses] */
    cairn_pose_consensus_link *links;
    /* [max_nodes + 1] */
    int32_t *first_link;
    /* [max_nodes] insertion points while links are built; sizes of submaps */
    int32_t *next_free;
    /* [max_nodes] */
    cairn_pose_consensus_bound *bounds;
    /* [max_nodes] assignment: current, best, and best competing map */
    cairn_pose_consensus_assignment *current, *best, *competing;
    /* [max_nodes] */
    cairn_pose_consensus_branch *tree;
    /* [max_nodes] */
    cairn_pose_consensus_estimate *nodes;
    /* [max_nodes * max_alternatives] */
    cairn_pose_consensus_competing_pose *alternatives;
    /* [max_candidates] of the search, the best first */
    cairn_pose_consensus_candidate *candidates;
    /* [max_nodes] poses of the current assignment, for the joint likelihood, ... */
    cairn_pose *joint_poses;
    /* ... and its components */
    int32_t *joint_components;
    cairn_pose_pair_likelihood pair_likelihood;
    cairn_pose_joint_likelihood joint_likelihood;
    void *pair_context, *joint_context;
    int32_t node_count, hypothesis_count, bound_count;

    /* after: the phase after relaxation */
    pose_consensus_phase phase, after;
    cairn_pose_consensus_choice choice;
    /* next: hypothesis, link, candidate or node of the phase; end: where it ends */
    int32_t next, end;
    /* node of the link, or the one that is reassigned or reported */
    int32_t subject;
    /* growing component */
    int32_t component;
    /* components begun so far */
    int32_t component_count;
    /* node at the edge where the block is cut off */
    int32_t block_node;
    /* component of the block */
    int32_t block_component;
    /* passes over all blocks */
    int32_t block_passes;
    /* 1: the map is final; submaps are searched */
    int32_t is_final;
    /* sweeps of relaxation left */
    int32_t sweeps;
    /* reassignment rounds of this growth */
    int32_t rounds;
    /* nodes changed in this round */
    int32_t changed_nodes;
    /* units of finished items, not yet charged */
    int32_t units_due;
    int32_t candidate_count;
    /* best merge so far: its pose maps component `node` into `part` */
    cairn_pose_consensus_candidate merge;
    cairn_real total;
    /* seed hypothesis of this map */
    int32_t start;
    cairn_pose_consensus_result result;
};

/* Assigns a node a pose in a component. */
static inline void pose_consensus_place(cairn_pose_consensus *consensus, int32_t node,
                                        cairn_pose_consensus_pose pose, int32_t part)
{
    consensus->current[node].pose = pose;
    consensus->current[node].component = part;
}

cairn_pose_consensus_pose cairn_pose_consensus_pose_of(cairn_pose pose);
cairn_pose cairn_pose_consensus_to_pose(cairn_pose_consensus_pose pose);
cairn_pose_consensus_pose cairn_pose_consensus_compose(cairn_pose_consensus_pose a_b,
                                                       cairn_pose_consensus_pose b_c);
cairn_pose_consensus_pose cairn_pose_consensus_inverse(cairn_pose_consensus_pose a_b);

/* Returns 1 when two poses are equal within five of the nodes' model sigmas. */
int32_t cairn_pose_consensus_is_same_pose(const cairn_pose_consensus *consensus,
                                          cairn_pose_consensus_pose a, cairn_pose_consensus_pose b);

/* Returns chi-squared of a hypothesis given two poses; of the second only its position and angle
 * are read. residual, when not NULL: its residual in the frame of the first node. */
cairn_real cairn_pose_consensus_chi2(const cairn_pose_consensus_hypothesis *hypothesis,
                                     cairn_pose_consensus_pose map_first,
                                     cairn_pose_consensus_pose map_second, cairn_real residual[3]);

/* Returns the best agreeing hypothesis of the pair (node, other), and its weighted score; -1: none.
 * `from` is the first link of the pair, *to is set behind its last. *strongest: best score of the
 * pair, agreeing or not. */
int32_t cairn_pose_consensus_best_of_pair(const cairn_pose_consensus *consensus, int32_t node,
                                          cairn_pose_consensus_pose map_node, int32_t from,
                                          cairn_pose_consensus_pose map_other, int32_t *to,
                                          cairn_real *earned, cairn_real *strongest);

/* Returns the support of a pose of a node by the placed nodes of a component; by_likelihood 1: by
 * the likelihood functions. */
cairn_pose_consensus_support cairn_pose_consensus_support_of(const cairn_pose_consensus *consensus,
                                                             int32_t node,
                                                             cairn_pose_consensus_pose map_node,
                                                             int32_t part, int32_t by_likelihood);

/* Returns 1 when the support is significant by itself. */
int32_t cairn_pose_consensus_is_significant(const cairn_pose_consensus *consensus,
                                            cairn_real support, cairn_real against);

/* Returns 1 when a common motion of the component brings its nodes and the candidate within their
 * bounds; *map_part, when not NULL, is that motion (identity without bounds). node -1: no
 * candidate. */
int32_t cairn_pose_consensus_within_bounds(const cairn_pose_consensus *consensus, int32_t part,
                                           int32_t node, cairn_pose_consensus_pose pose,
                                           cairn_pose *map_part);

/* Returns the other node's pose in the frame of `node`. */
cairn_pose_consensus_pose
cairn_pose_consensus_relative_to(const cairn_pose_consensus_hypothesis *hypothesis, int32_t node);

/* Computes the cycle score of the next hypothesis, and advances. */
void cairn_pose_consensus_add_cycles(cairn_pose_consensus *consensus);

/* Writes the result of the node whose alternatives have been searched. */
void cairn_pose_consensus_report_node(cairn_pose_consensus *consensus);

/* Returns the information about a node given the others, by its inlier hypotheses; gradient: of
 * half their chi-squared. */
cairn_sym3 cairn_pose_consensus_information(const cairn_pose_consensus *consensus, int32_t node,
                                            cairn_real gradient[3]);

/* One Gauss-Newton step of a node given the others. */
void cairn_pose_consensus_relax(cairn_pose_consensus *consensus, int32_t node);

/* Returns the log-likelihood ratio of a pair of placed nodes: the weighted score of its best
 * hypothesis or the pairwise likelihood, the greater. *link: the first link of the node that is not
 * to a lower node than `other`; it is advanced. */
cairn_real cairn_pose_consensus_pair_likelihood(const cairn_pose_consensus *consensus, int32_t node,
                                                cairn_pose_consensus_pose map_node, int32_t other,
                                                int32_t *link, int32_t *units);

/* Returns the support of placing component merge->node in merge->part by merge->pose. */
cairn_real cairn_pose_consensus_merged_support(cairn_pose_consensus *consensus,
                                               const cairn_pose_consensus_candidate *merge,
                                               int32_t by_likelihood);

/* Merges one component into the other; returns 0 and changes nothing when bounds forbid it. */
int32_t cairn_pose_consensus_apply_merge(cairn_pose_consensus *consensus,
                                         const cairn_pose_consensus_candidate *merge);

/* An item of the merging. */
void cairn_pose_consensus_merge_item(cairn_pose_consensus *consensus);

/* Enters a phase of `end` items. */
void cairn_pose_consensus_enter(cairn_pose_consensus *consensus, pose_consensus_phase phase,
                                int32_t end);

/* Starts sweeps of relaxation over all nodes, and sets the phase after them. */
void cairn_pose_consensus_begin_relaxation(cairn_pose_consensus *consensus, int32_t sweeps,
                                           pose_consensus_phase after);

/* Starts to merge components and to reassign every node. */
void cairn_pose_consensus_begin_rounds(cairn_pose_consensus *consensus);

/* Starts the report: the best map is relaxed, and every node is written. */
void cairn_pose_consensus_begin_report(cairn_pose_consensus *consensus);

/* Starts the block moves of the best map. */
void cairn_pose_consensus_begin_blocks(cairn_pose_consensus *consensus);

/* Starts the maximum spanning trees of the best map. */
void cairn_pose_consensus_begin_tree(cairn_pose_consensus *consensus);

/* An item of the trees, of the blocks, of a block's proposals. */
void cairn_pose_consensus_tree_item(cairn_pose_consensus *consensus);
void cairn_pose_consensus_block_item(cairn_pose_consensus *consensus);
void cairn_pose_consensus_propose_item(cairn_pose_consensus *consensus);

/* Evaluates a block of the final map, or splits off the least supported one as a submap. */
void cairn_pose_consensus_split_item(cairn_pose_consensus *consensus);

/* Measures the submap of a node; numbers it. */
void cairn_pose_consensus_submap_item(cairn_pose_consensus *consensus);
void cairn_pose_consensus_number_item(cairn_pose_consensus *consensus);

/* Executes one item of the search and adds its cost to units_due. */
void cairn_pose_consensus_item(cairn_pose_consensus *consensus);

/* Marks a node as ambiguous when it depends on ambiguous nodes. */
void cairn_pose_consensus_propagate_ambiguity_item(cairn_pose_consensus *consensus);

/* Makes the best map the result: frames, components by size, alternatives from other maps. */
void cairn_pose_consensus_finish(cairn_pose_consensus *consensus);

#endif
