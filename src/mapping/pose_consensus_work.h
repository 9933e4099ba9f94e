/* What the parts of pose_consensus share: hypotheses as they are kept, maps in the making, and
 * evidence. */
#ifndef CAIRN_MAPPING_POSE_CONSENSUS_WORK_H
#define CAIRN_MAPPING_POSE_CONSENSUS_WORK_H

#include "cairn/pose_consensus.h"
#include "cairn/small_matrix.h"

/* A pose with the sine and cosine of its angle. */
typedef struct cairn_turned_pose {
    cairn_transform transform;
    cairn_real theta;
} cairn_turned_pose;

typedef struct cairn_kept_hypothesis {
    int32_t first, second;
    cairn_turned_pose first_second, second_first;
    /* of first_second with the nodes' own sigmas, in the frame of the first */
    cairn_sym3 information;
    cairn_real score;
    /* score of the ways round by a third node that agree with it */
    cairn_real cycles;
    /* 1: a map that was found agrees, or a growth began with it */
    int32_t is_explained;
} cairn_kept_hypothesis;

/* A hypothesis as one of its nodes sees it; those of a node stand together, sorted by the other
 * node. */
typedef struct cairn_consensus_link {
    int32_t other, hypothesis;
} cairn_consensus_link;

/* A node in a map: its part, or -1 when it is not placed. */
typedef struct cairn_chart_node {
    cairn_turned_pose pose;
    int32_t part;
    int32_t part_before; /* while a merge is tried */
} cairn_chart_node;

/* A node in the tree of the strongest pairs of its part. */
typedef struct cairn_consensus_branch {
    int32_t parent; /* -1: a root; when islands are numbered the first node of its own */
    int32_t is_in;
    cairn_real evidence; /* of the pair with the parent */
} cairn_consensus_branch;

typedef struct cairn_node_bound {
    cairn_pose centre;
    cairn_real metres, radians; /* metres 0: none */
} cairn_node_bound;

typedef struct cairn_candidate {
    cairn_turned_pose pose;
    cairn_real support, against;
    /* in growth what ways round say for the hypothesis: it counts with the support in the choice */
    cairn_real cycles;
    int32_t node, part;
    /* 1: where the node lies already */
    int32_t current;
} cairn_candidate;

/* What all pairs of a node say for a pose of it. */
typedef struct cairn_consensus_support {
    cairn_real sum, against; /* against: what was taken off the sum */
    int32_t agreeing, contradicting;
    int32_t units;
} cairn_consensus_support;

typedef int32_t cairn_consensus_phase;
enum {
    CAIRN_CONSENSUS_IDLE = 0,
    CAIRN_CONSENSUS_CYCLES,
    CAIRN_CONSENSUS_START,
    CAIRN_CONSENSUS_SEARCH, /* vote for the candidates of a choice ... */
    CAIRN_CONSENSUS_JUDGE,  /* ... and judge the best voted */
    CAIRN_CONSENSUS_RELAX,
    CAIRN_CONSENSUS_MERGE,
    CAIRN_CONSENSUS_AGAIN, /* every node is chosen again */
    CAIRN_CONSENSUS_TALLY,
    CAIRN_CONSENSUS_TREE,  /* of the best map at last: where it hangs by single pairs, ... */
    CAIRN_CONSENSUS_BLOCK, /* ... what hangs there is laid anew as a whole */
    CAIRN_CONSENSUS_PROPOSE,
    CAIRN_CONSENSUS_PART,    /* islands are cut off, ... */
    CAIRN_CONSENSUS_ISLANDS, /* ... measured ... */
    CAIRN_CONSENSUS_NUMBER,  /* ... and numbered */
    CAIRN_CONSENSUS_REPORT,
    CAIRN_CONSENSUS_SPREAD /* doubt, to nodes that hang by those in doubt */
};

/* What is chosen by a search. */
typedef int32_t cairn_consensus_choice;
enum {
    CAIRN_CHOOSE_NEXT = 0,        /* the node that grows the part */
    CAIRN_CHOOSE_AGAIN = 1,       /* the pose of a node given the others */
    CAIRN_CHOOSE_ALTERNATIVES = 2 /* of a node */
};

struct cairn_pose_consensus {
    cairn_pose_consensus_params params;
    /* [max_hypotheses] */
    cairn_kept_hypothesis *hypotheses;
    /* [2 * max_hypotheses] */
    cairn_consensus_link *links;
    /* [max_nodes + 1] */
    int32_t *first_link;
    /* [max_nodes] for the links while they are built; sizes of islands */
    int32_t *fill;
    /* [max_nodes] */
    cairn_node_bound *bounds;
    /* [max_nodes] */
    cairn_chart_node *chart, *best, *rival;
    /* [max_nodes] */
    cairn_consensus_branch *tree;
    /* [max_nodes] */
    cairn_consensus_node *nodes;
    /* [max_nodes * max_alternatives] */
    cairn_consensus_alternative *alternatives;
    /* [max_candidates] of the search, the best first */
    cairn_candidate *candidates;
    /* [max_nodes] of the chart, for the jury, ... */
    cairn_pose *jury_poses;
    /* ... and its parts */
    int32_t *jury_parts;
    cairn_pose_judge judge;
    cairn_pose_jury jury;
    void *judge_context, *jury_context;
    int32_t node_count, hypothesis_count, bound_count;

    /* after: that follows relaxation */
    cairn_consensus_phase phase, after;
    cairn_consensus_choice choice;
    /* hypothesis, link, candidate or node that the phase comes to, and where it ends */
    int32_t next, end;
    /* node of the link, or the one that is chosen again or reported */
    int32_t subject;
    /* that grows */
    int32_t part;
    /* begun so far */
    int32_t parts;
    /* node that the block hangs by, ... */
    int32_t block;
    /* ... the part it is of, ... */
    int32_t whole;
    /* ... and how often all blocks have been laid */
    int32_t passes;
    /* nothing moves any more: islands are looked for */
    int32_t is_settled;
    /* of relaxation that are left */
    int32_t sweeps;
    /* of this growth */
    int32_t rounds;
    /* nodes in this round */
    int32_t changed;
    /* units of items done that are not yet paid for */
    int32_t debt;
    int32_t candidate_count;
    /* best so far: its pose maps part `node` into `part` */
    cairn_candidate merge;
    cairn_real total;
    /* hypothesis from which this map grew */
    int32_t start;
    cairn_consensus_result result;
};

cairn_turned_pose cairn_turned_of(cairn_pose pose);
cairn_pose cairn_turned_pose_of(cairn_turned_pose pose);
cairn_turned_pose cairn_turned_compose(cairn_turned_pose a_b, cairn_turned_pose b_c);
cairn_turned_pose cairn_turned_inverse(cairn_turned_pose a_b);

/* 1 when two poses are the same for all purposes: within five of the nodes' own sigmas. */
int32_t cairn_consensus_same(const cairn_pose_consensus *consensus, cairn_turned_pose a,
                             cairn_turned_pose b);

/* Chi-squared of a hypothesis given two poses; of the second only its position and angle are
 * read. residual, when not NULL, is its error in the frame of the first node. */
cairn_real cairn_consensus_chi(const cairn_kept_hypothesis *hypothesis, cairn_turned_pose map_first,
                               cairn_turned_pose map_second, cairn_real residual[3]);

/* The hypothesis of the pair (node, other) that the poses agree with best, and what it earns;
 * -1: none. `from` is the first link of the pair, *to is set behind its last. *strongest: best
 * score of the pair, agreeing or not. */
int32_t cairn_consensus_pair(const cairn_pose_consensus *consensus, int32_t node,
                             cairn_turned_pose map_node, int32_t from, cairn_turned_pose map_other,
                             int32_t *to, cairn_real *earned, cairn_real *strongest);

/* Support of a pose of a node by the placed nodes of a part; the judge is asked when judged is
 * 1. */
cairn_consensus_support cairn_consensus_support_of(const cairn_pose_consensus *consensus,
                                                   int32_t node, cairn_turned_pose map_node,
                                                   int32_t part, int32_t judged);

/* 1 when a pose with such support would be believed by itself. */
int32_t cairn_consensus_is_believed(const cairn_pose_consensus *consensus, cairn_real support,
                                    cairn_real against);

/* 1 when some common motion of the part brings its nodes and the candidate within their bounds;
 * *map_part, when not NULL, is that motion (identity without bounds). node -1: no candidate. */
int32_t cairn_consensus_within_bounds(const cairn_pose_consensus *consensus, int32_t part,
                                      int32_t node, cairn_turned_pose pose, cairn_pose *map_part);

/* The other node's pose in the frame of `node`. */
cairn_turned_pose cairn_consensus_seen_from(const cairn_kept_hypothesis *hypothesis, int32_t node);

/* What the ways round by third nodes say for the next hypothesis, which is then the one after
 * it. */
void cairn_consensus_add_cycles(cairn_pose_consensus *consensus);

/* Writes down the node whose alternatives have been searched. */
void cairn_consensus_report_node(cairn_pose_consensus *consensus);

/* Information about a node given the others, by the hypotheses that agree, and the gradient of
 * half their chi-squared. */
cairn_sym3 cairn_consensus_information(const cairn_pose_consensus *consensus, int32_t node,
                                       cairn_real gradient[3]);

/* One Gauss-Newton step of a node given the others. */
void cairn_consensus_relax(cairn_pose_consensus *consensus, int32_t node);

/* Evidence of the pair of a node and another one, both placed: what a hypothesis earns or the
 * judge says, whichever is more. *link: the first link of the node that is not to a lower node
 * than `other`; it is moved on. */
cairn_real cairn_consensus_evidence(const cairn_pose_consensus *consensus, int32_t node,
                                    cairn_turned_pose map_node, int32_t other, int32_t *link,
                                    int32_t *units);

/* Support for laying part `merge->node` into `merge->part` by `merge->pose`. */
cairn_real cairn_consensus_merged_support(cairn_pose_consensus *consensus,
                                          const cairn_candidate *merge, int32_t judged);

/* Lays one part into the other as `merge` says; 0 and nothing changed when bounds forbid it. */
int32_t cairn_consensus_lay(cairn_pose_consensus *consensus, const cairn_candidate *merge);

/* Starts to merge parts and to choose every node again. */
void cairn_consensus_begin_rounds(cairn_pose_consensus *consensus);

/* Poses of the best map are settled, and every node is reported. */
void cairn_consensus_begin_report(cairn_pose_consensus *consensus);

/* Starts to lay the blocks of the best map anew. */
void cairn_consensus_begin_blocks(cairn_pose_consensus *consensus);

/* Starts with the trees of the best map. */
void cairn_consensus_begin_tree(cairn_pose_consensus *consensus);

/* An item of the trees, of the blocks, of a block's proposals. */
void cairn_consensus_tree_item(cairn_pose_consensus *consensus);
void cairn_consensus_block_item(cairn_pose_consensus *consensus);
void cairn_consensus_propose_item(cairn_pose_consensus *consensus);

/* Weighs a block of the settled map, or makes an island of the one that lacks most. */
void cairn_consensus_part_item(cairn_pose_consensus *consensus);

/* Measures the island of a node; numbers it. */
void cairn_consensus_island_item(cairn_pose_consensus *consensus);
void cairn_consensus_number_item(cairn_pose_consensus *consensus);

/* Goes to a phase of `end` items. */
void cairn_consensus_enter(cairn_pose_consensus *consensus, cairn_consensus_phase phase,
                           int32_t end);

/* Does one item of the search and adds its cost to the debt. */
void cairn_consensus_item(cairn_pose_consensus *consensus);

/* Whether a node hangs by nodes that are ambiguous. */
void cairn_consensus_spread_item(cairn_pose_consensus *consensus);

/* Makes the best map the result: frames, parts by size, alternatives from other maps. */
void cairn_consensus_finish(cairn_pose_consensus *consensus);

#endif
