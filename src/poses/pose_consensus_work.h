/* Private state of the pose_consensus module: hypotheses, assignments (maps in progress), and
 * log-likelihood ratios. */
#ifndef CAIRN_POSES_POSE_CONSENSUS_WORK_H
#define CAIRN_POSES_POSE_CONSENSUS_WORK_H

#include "cairn/pose_consensus.h"
#include "cairn/small_matrix.h"
#include "src/base/object.h"
#include "src/base/step.h"

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
    /* during a tentative merge; while a block is cut off 1: below the edge */
    int32_t component_before;
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
    cairn_real sum, violations;     /* violations: the sum of the negative terms, >= 0 */
    cairn_real positive, ambiguous; /* sum of the positive terms; of those with ambiguous nodes */
    int32_t agreeing, conflicting;
} cairn_pose_consensus_support;

/* Subject of a search for candidates. */
typedef int32_t cairn_pose_consensus_subject;
enum {
    POSE_CONSENSUS_NEXT = 0,        /* the next node of the growing component */
    POSE_CONSENSUS_REASSIGN = 1,    /* the pose of a node given the others */
    POSE_CONSENSUS_ALTERNATIVES = 2 /* alternatives of a node */
};

/* What the support is evaluated by. */
typedef int32_t cairn_pose_consensus_evidence;
enum {
    POSE_CONSENSUS_BY_HYPOTHESES = 0,
    /* hypotheses and the pairwise likelihood function, if there is one */
    POSE_CONSENSUS_BY_PAIRS = 1,
    /* the joint likelihood function, if there is one, else pairs */
    POSE_CONSENSUS_BY_ALL = 2
};

/* Steps that run one another, the outermost first. */
struct pose_consensus_resume {
    int32_t search, phase, part, sum, support;
};

/* Cycles of a hypothesis through third nodes. */
struct pose_consensus_cycles {
    /* links of the first and of the second node to a third: first and end */
    int32_t a[2], b[2];
    int32_t link; /* of the first node */
    cairn_real best;
};

/* A choice among candidates for the pose of a node. */
struct pose_consensus_choice {
    cairn_pose_consensus_subject subject;
    int32_t node;      /* node of the link, or the one that is reassigned or reported */
    int32_t link, end; /* next link that proposes a pose, and the end of the links */
    int32_t count;     /* candidates */
    int32_t evaluated; /* candidates evaluated by the likelihood functions */
    cairn_pose_consensus_candidate candidate; /* whose votes are counted */
};

/* Pose of a node whose support by the placed nodes of a component is searched, and what is found;
 * pairs of the node. */
struct pose_consensus_query {
    cairn_pose_consensus_pose pose;
    int32_t node, component;
    cairn_pose_consensus_evidence evidence;
    int32_t other;    /* node of the pair */
    int32_t link;     /* first link of the node that is not to a lower node than `other` */
    cairn_real ratio; /* log-likelihood ratio of the pair, nats */
    cairn_pose_consensus_support found;
};

/* Support of a component that is placed as a whole; it is summed in `tried`. */
struct pose_consensus_merger {
    /* `pose` maps component `node` into `component` */
    cairn_pose_consensus_candidate tried;
    cairn_pose_consensus_evidence evidence;
    int32_t node; /* next node, and number of those summed */
    int32_t size;
};

/* A block, cut off at an edge of the maximum spanning tree. */
struct pose_consensus_block {
    int32_t node;             /* at the edge */
    int32_t component;        /* that it is cut off from */
    int32_t weakest;          /* node of the block with the greatest missing support */
    cairn_real lack;          /* missing support of that block, nats */
    int32_t has_link_support; /* 1: of all nodes, from the tree before the first split */
};

typedef int32_t pose_consensus_task;
enum {
    POSE_CONSENSUS_IDLE = 0,
    POSE_CONSENSUS_SEARCH,
    /* cairn_pose_consensus_find_submaps() */
    POSE_CONSENSUS_SUBMAPS
};

/* What the steps use most comes first: it takes shorter instructions there. */
struct cairn_pose_consensus {
    /* units charged for the operation that waits */
    int32_t units_charged;
    struct pose_consensus_resume resume;
    pose_consensus_task task;

    /* of a phase */
    int32_t node, hypothesis; /* those that are visited */
    int32_t visited;          /* node of a sweep; number of nodes in trees */
    int32_t sweeps;           /* of relaxation that are left */
    int32_t changed_nodes;    /* in this round */
    int32_t is_merged;        /* 1: components were merged */
    int32_t is_other;         /* 1: another map than the best */

    /* of a growth */
    int32_t seed;            /* hypothesis of the next component; -1: none */
    int32_t start;           /* seed hypothesis of this map */
    int32_t component;       /* growing component */
    int32_t component_count; /* components begun so far */
    int32_t rounds;          /* reassignment rounds */
    int32_t block_passes;    /* passes over all blocks */
    cairn_real seed_rank;    /* score and cycle score of the seed */
    cairn_real total;

    int32_t node_count, hypothesis_count, bound_count;
    /* [max_nodes] assignment: current, best, and best competing map */
    cairn_pose_consensus_assignment *current, *best, *competing;
    /* [max_hypotheses] */
    cairn_pose_consensus_hypothesis *hypotheses;
    /* [2 * max_hypotheses] */
    cairn_pose_consensus_link *links;
    /* [max_nodes + 1] */
    int32_t *first_link;
    /* [max_nodes] */
    cairn_pose_consensus_branch *tree;
    /* [max_nodes] */
    cairn_pose_consensus_estimate *nodes;
    /* [max_candidates] of the search, the best first */
    cairn_pose_consensus_candidate *candidates;

    struct pose_consensus_block block;
    struct pose_consensus_choice choice;
    struct pose_consensus_merger merger;
    struct pose_consensus_query query;
    struct pose_consensus_cycles cycles;
    cairn_pose_likelihood likelihood;
    cairn_pose_consensus_candidate merge; /* best merge so far, or best pose of a block */
    cairn_pose_consensus_result result;

    /* [max_nodes] insertion points while links are built; nodes in the order of the trees; sizes of
     * components, and of submaps */
    int32_t *next_free;
    /* [max_nodes] */
    cairn_pose_consensus_bound *bounds;
    /* [max_nodes * max_alternatives] */
    cairn_pose_consensus_competing_pose *alternatives;
    /* [max_nodes] poses of the current assignment, for the joint likelihood, ... */
    cairn_pose *joint_poses;
    /* ... and its components */
    int32_t *joint_components;
    cairn_pose_pair_likelihood pair_likelihood;
    cairn_pose_joint_likelihood joint_likelihood;
    void *pair_context, *joint_context;
    cairn_pose_consensus_params params;
};

/* Nodes that a work unit covers: when they are compared, and when they are copied or moved. */
enum { POSE_CONSENSUS_NODES_PER_UNIT = 32, POSE_CONSENSUS_POSES_PER_UNIT = 4 };

/* Assigns a node a pose in a component. */
static inline void pose_consensus_place(cairn_pose_consensus *consensus, int32_t node,
                                        const cairn_pose_consensus_pose *pose, int32_t part)
{
    consensus->current[node].pose = *pose;
    consensus->current[node].component = part;
}

cairn_pose_consensus_pose cairn_pose_consensus_pose_of(cairn_pose pose);
cairn_pose cairn_pose_consensus_to_pose(const cairn_pose_consensus_pose *pose);
cairn_pose_consensus_pose cairn_pose_consensus_compose(const cairn_pose_consensus_pose *a_b,
                                                       const cairn_pose_consensus_pose *b_c);
cairn_pose_consensus_pose cairn_pose_consensus_inverse(const cairn_pose_consensus_pose *a_b);

/* Returns 1 when two poses are equal within five of the nodes' model sigmas. */
int32_t cairn_pose_consensus_is_same_pose(const cairn_pose_consensus *consensus,
                                          const cairn_pose_consensus_pose *a,
                                          const cairn_pose_consensus_pose *b);

/* Returns chi-squared of a hypothesis given two poses; of the second only its position and angle
 * are read. residual, when not NULL: its residual in the frame of the first node. */
cairn_real cairn_pose_consensus_chi2(const cairn_pose_consensus_hypothesis *hypothesis,
                                     const cairn_pose_consensus_pose *map_first,
                                     const cairn_pose_consensus_pose *map_second,
                                     cairn_real residual[3]);

/* Returns the units of the hypotheses of a node; of the bounds of all nodes; of a pass that compares
 * all nodes, and of one that copies them. */
int32_t cairn_pose_consensus_link_units(const cairn_pose_consensus *consensus, int32_t node);
int32_t cairn_pose_consensus_bound_units(const cairn_pose_consensus *consensus);
int32_t cairn_pose_consensus_node_units(const cairn_pose_consensus *consensus);
int32_t cairn_pose_consensus_copy_units(const cairn_pose_consensus *consensus);

/* Sets the query: the support of a pose of a node by the placed nodes of a component. */
void cairn_pose_consensus_set_query(cairn_pose_consensus *consensus, int32_t node,
                                    const cairn_pose_consensus_pose *map_node, int32_t part,
                                    cairn_pose_consensus_evidence evidence);

/* Sets the query: the support of a placed node at its current pose. */
void cairn_pose_consensus_query_current(cairn_pose_consensus *consensus, int32_t node,
                                        cairn_pose_consensus_evidence evidence);

/* Step: finds query.found. */
int cairn_pose_consensus_find_support(cairn_pose_consensus *consensus, cairn_budget *budget);

/* Finds query.ratio, of the pair of query.node at its pose and query.other, which is placed: the
 * weighted score of its best hypothesis or the pairwise likelihood, the greater. Advances query.link.
 * 0 when the budget is used up. Its hypotheses are charged by the caller. */
int cairn_pose_consensus_find_pair(cairn_pose_consensus *consensus, cairn_budget *budget);

/* Returns 1 when a common motion of the component brings its nodes and the candidate within their
 * bounds; *map_part, when not NULL, is that motion (identity without bounds). node -1: no
 * candidate. */
int32_t cairn_pose_consensus_within_bounds(const cairn_pose_consensus *consensus, int32_t part,
                                           int32_t node, const cairn_pose_consensus_pose *pose,
                                           cairn_pose *map_part);

/* Returns the other node's pose in the frame of `node`. */
const cairn_pose_consensus_pose *
cairn_pose_consensus_relative_to(const cairn_pose_consensus_hypothesis *hypothesis, int32_t node);

/* Step of a phase: computes the cycle scores of all hypotheses. */
int cairn_pose_consensus_add_cycles(cairn_pose_consensus *consensus, cairn_budget *budget);

/* Returns the information about a node given the others, by its inlier hypotheses; gradient: of
 * half their chi-squared. */
cairn_sym3 cairn_pose_consensus_information(const cairn_pose_consensus *consensus, int32_t node,
                                            cairn_real gradient[3]);

/* Step of a part: `sweeps` sweeps of relaxation over all nodes. */
int cairn_pose_consensus_relax(cairn_pose_consensus *consensus, cairn_budget *budget);

/* Sets the choice; finds its candidates (step of a part), evaluated by the likelihood functions. */
void cairn_pose_consensus_set_choice(cairn_pose_consensus *consensus,
                                     cairn_pose_consensus_subject subject, int32_t node);
int cairn_pose_consensus_find_candidates(cairn_pose_consensus *consensus, cairn_budget *budget);

/* Returns the candidate of the best rank with enough support; NULL: none. */
const cairn_pose_consensus_candidate *
cairn_pose_consensus_best_candidate(const cairn_pose_consensus *consensus);

/* Sets the merge whose support is searched; finds it in merger.sum (step of a sum). */
void cairn_pose_consensus_set_merger(cairn_pose_consensus *consensus,
                                     const cairn_pose_consensus_candidate *merge,
                                     cairn_pose_consensus_evidence evidence);
int cairn_pose_consensus_find_merged_support(cairn_pose_consensus *consensus, cairn_budget *budget);

/* Returns the units of a merge: nodes are moved, and their bounds visited. */
int32_t cairn_pose_consensus_merge_units(const cairn_pose_consensus *consensus);

/* Merges one component into the other; returns 0 and changes nothing when bounds forbid it. */
int32_t cairn_pose_consensus_apply_merge(cairn_pose_consensus *consensus,
                                         const cairn_pose_consensus_candidate *merge);

/* Step of a part: counts the inliers of the current map in the result; it explains them. */
int cairn_pose_consensus_find_inliers(cairn_pose_consensus *consensus, cairn_budget *budget);

/* Step of a part: merges the two components of the best supported merge; is_merged 0: there is
 * none. */
int cairn_pose_consensus_merge_parts(cairn_pose_consensus *consensus, cairn_budget *budget);

/* Step of a phase: moves the blocks of the best map, and counts those moved in changed_nodes. */
int cairn_pose_consensus_move_blocks(cairn_pose_consensus *consensus, cairn_budget *budget);

/* Step of a phase: makes the best map the result: every node with its alternatives, frames, components
 * by size, alternatives from other maps. */
int cairn_pose_consensus_report(cairn_pose_consensus *consensus, cairn_budget *budget);

/* Step of a phase: nodes become ambiguous that depend on ambiguous nodes. */
int cairn_pose_consensus_propagate_ambiguity(cairn_pose_consensus *consensus, cairn_budget *budget);

/* Steps of the search: all of it; the submaps. */
int cairn_pose_consensus_search(cairn_pose_consensus *consensus, cairn_budget *budget);
int cairn_pose_consensus_search_submaps(cairn_pose_consensus *consensus, cairn_budget *budget);

#endif
