/* pose_consensus: the poses of nodes that the largest consistent part of many rival measurements
 * supports.
 *
 * Nodes are scans, places or whole maps. A hypothesis says how two of them may lie to each
 * other; a pair may have several that exclude each other, and most may be wrong. From several
 * starts, each a hypothesis that no map found so far agrees with, a map grows node by node:
 * every hypothesis from a placed node proposes a pose for the next one, all others vote, and the
 * best supported candidate is placed. Then every node is chosen again given the others until
 * nothing changes, and the start with the best total evidence wins. Nodes that could as well lie
 * elsewhere are reported with their alternatives, parts that do not hang together as parts. */
#ifndef CAIRN_POSE_CONSENSUS_H
#define CAIRN_POSE_CONSENSUS_H

#include "cairn/geometry.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* "The second node lies so, seen from the first." */
typedef struct cairn_pose_hypothesis {
    int32_t first, second;
    cairn_pose first_second;
    /* row-major over (x, y, theta) of first_second, in the frame of the first node */
    cairn_real covariance[9];
    /* > 0: evidence in nats, the logarithm of how much likelier the data of the pair are so than
     * by chance; scores of independent pairs add up */
    cairn_real score;
} cairn_pose_hypothesis;

typedef struct cairn_pose_consensus_params {
    /* 1 ... 2^16 */
    int32_t max_nodes;
    /* 1 ... 2^20 */
    int32_t max_hypotheses;
    /* >= 1: growths, each from the strongest hypothesis that no map found so far agrees with */
    int32_t max_starts;
    /* >= 0: times that every node is chosen again, and that blocks of them are laid anew */
    int32_t max_rounds;
    /* 1 ... 32: of a choice, the best voted ones, that the judge sees */
    int32_t max_candidates;
    /* 0 ... 32: reported of each node */
    int32_t max_alternatives;
    /* m, > 0, added in quadrature to the covariances, as nodes do not lie exactly either, ... */
    cairn_real sigma;
    /* ... and rad, > 0; times the distance of the nodes it adds to their positions too */
    cairn_real sigma_angle;
    /* > 0: a hypothesis agrees with poses when its chi-squared (3 degrees of freedom) is below */
    cairn_real gate;
    /* >= 0: share of the best score of a pair that is lost when none of its hypotheses agrees
     * and there is no judge */
    cairn_real contradiction;
    /* > 0, nats: with less from all others together a node is not placed */
    cairn_real min_support;
    /* in (0, 1): least weight of an alternative that makes its node ambiguous */
    cairn_real ambiguous;
    /* nats, >= 0: what a pose needs to be believed by itself, what speaks against it taken off
     * twice. A node is ambiguous that has so much elsewhere, however much more it has here, if
     * what speaks against it weighs at least `ambiguous`; and so are nodes that owe most to such
     * nodes. See also cairn_pose_consensus_islands(). 0: not asked */
    cairn_real believed;
} cairn_pose_consensus_params;

/* 64 nodes, 1024 hypotheses, 16 starts, 10 rounds, 8 candidates, 4 alternatives; 0.03 m and 0.6
 * degrees; gate 16; contradiction 0; least support 3 nats; ambiguous from 0.02, nothing believed
 * by itself. */
cairn_pose_consensus_params cairn_pose_consensus_default(void);

typedef struct cairn_pose_consensus cairn_pose_consensus;

/* 0 for params that create() would refuse. */
size_t cairn_pose_consensus_memory(const cairn_pose_consensus_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_pose_consensus_create(cairn_pose_consensus **consensus,
                                                       cairn_pool *pool,
                                                       const cairn_pose_consensus_params *params);

/* Forgets all, the judge too, and makes it `nodes` nodes. CAIRN_BAD_ARGUMENT: NULL, nodes < 1.
 * CAIRN_FULL: more than max_nodes. Linear in nodes. */
CAIRN_CHECKED cairn_status cairn_pose_consensus_clear(cairn_pose_consensus *consensus,
                                                      int32_t nodes);

/* Adds a hypothesis; it is copied, its index is the number of those before it.
 * CAIRN_BAD_ARGUMENT: NULL, nodes that are not there or the same, a score that is not > 0, a
 * covariance that is negative along a direction. CAIRN_NOT_FINITE. CAIRN_FULL: max_hypotheses.
 * *fault, when not NULL, tells what. Ends a search that is running. Constant time. */
CAIRN_CHECKED cairn_status cairn_pose_consensus_add(cairn_pose_consensus *consensus,
                                                    const cairn_pose_hypothesis *hypothesis,
                                                    cairn_fault *fault);

/* Says beforehand that a node lies within +-metres (a circle) and +-radians of `map_node`.
 * Candidates are dropped that no common motion of the part brings within the bounds, and the
 * result is in the map's frame. CAIRN_BAD_ARGUMENT: NULL, no such node, not > 0.
 * CAIRN_NOT_FINITE. Ends a search that is running. Constant time. */
CAIRN_CHECKED cairn_status cairn_pose_consensus_bound(cairn_pose_consensus *consensus, int32_t node,
                                                      cairn_pose map_node, cairn_real metres,
                                                      cairn_real radians);

/* Evidence in nats, positive or negative, of the data of two nodes for a relative pose; a pair
 * earns it, or what its hypotheses earn where that is more. *units: what it cost. It is a
 * function of its arguments alone. */
typedef cairn_real (*cairn_pose_judge)(void *context, int32_t first, int32_t second,
                                       cairn_pose first_second, int32_t *units);

/* judge NULL: none. Ends a search that is running. */
void cairn_pose_consensus_judge_by(cairn_pose_consensus *consensus, cairn_pose_judge judge,
                                   void *context);

/* Evidence in nats, positive or negative, of the data of a node for a pose given all others of a
 * part as they lie: those i with parts[i] == part, at map_nodes[i], but the node itself. So data
 * that several others share can count once, which sums over pairs cannot. *against: what was
 * taken off, >= 0. *units: what it cost. It is a function of its arguments alone. */
typedef cairn_real (*cairn_pose_jury)(void *context, int32_t node, cairn_pose map_node,
                                      const cairn_pose *map_nodes, const int32_t *parts,
                                      int32_t part, cairn_real *against, int32_t *units);

/* What a jury says stands in place of the sum over pairs wherever the judge would be asked for a
 * whole part; pairs still say where a map could come apart. jury NULL: none. clear() forgets it.
 * Ends a search that is running. */
void cairn_pose_consensus_jury_by(cairn_pose_consensus *consensus, cairn_pose_jury jury,
                                  void *context);

/* Starts the search. CAIRN_EMPTY: no nodes (clear() was never called). CAIRN_BAD_ARGUMENT: NULL.
 * Linear in nodes and hypotheses. */
CAIRN_CHECKED cairn_status cairn_pose_consensus_begin(cairn_pose_consensus *consensus);

/* CAIRN_OK: nothing left to do. CAIRN_MORE. CAIRN_BAD_ARGUMENT: NULL. An item costs a unit for
 * every four hypotheses looked at, and what the judge says. At most starts * (nodes + rounds)
 * choices, and `max_rounds` times a look at every hypothesis for every node and the choices that
 * follow. */
CAIRN_CHECKED cairn_status cairn_pose_consensus_step(cairn_pose_consensus *consensus,
                                                     cairn_budget *budget);

/* Starts to look where the map that was found may hang together by chance: a node that has less
 * than params.believed where it lies, what speaks against it taken off twice, and several that
 * together hang at the rest by less than four times as much, what speaks against them not taken
 * off, are islands, found one by one, those that lack most first. Poses and parts stay; nodes
 * beside the largest island of their part are ambiguous. step() until CAIRN_OK, as after
 * begin(). CAIRN_EMPTY: there is no result. CAIRN_BAD_ARGUMENT: NULL. Cost: for every island one
 * look at all pairs, and one of the judge at every node for each pair of the tree above it. */
CAIRN_CHECKED cairn_status cairn_pose_consensus_islands(cairn_pose_consensus *consensus);

/* ---- The result: empty until step() returns CAIRN_OK ---- */

typedef struct cairn_consensus_node {
    /* in the frame of its part: that of its first node, or of the bounds when there are any */
    cairn_pose map_node;
    /* in that frame, of the agreeing hypotheses given their other ends */
    cairn_real covariance[9];
    /* nats that all others of the part give for it, less what speaks against it */
    cairn_real support;
    /* 0: the largest; a node that nothing supports is a part of its own */
    int32_t part;
    /* pairs whose data agree */
    int32_t agreeing;
    /* pairs whose data speak against it */
    int32_t contradicting;
    /* see cairn_pose_consensus_alternative() */
    int32_t alternatives;
    /* 1: an alternative weighs at least params.ambiguous, or see params.believed */
    int32_t ambiguous;
    /* of its part, by cairn_pose_consensus_islands(), 0: the largest */
    int32_t island;
} cairn_consensus_node;

/* Another pose of a node given the others, or (for whole = 1) given another consistent map. */
typedef struct cairn_consensus_alternative {
    cairn_pose map_node;
    cairn_real support; /* nats; of the other map's total for whole = 1 */
    cairn_real weight;  /* among the pose chosen and all alternatives, by their support */
    int32_t whole;
} cairn_consensus_alternative;

typedef struct cairn_consensus_result {
    cairn_real total;      /* nats of all pairs */
    cairn_real rival;      /* total of the best map found that is another one; 0: there was none */
    int32_t nodes, placed; /* placed: nodes in parts of two or more */
    int32_t parts;         /* 1: it hangs together */
    int32_t ambiguous;     /* nodes */
    int32_t start;         /* hypothesis from which the best map grew */
    int32_t starts, rounds;
    int32_t agreeing; /* hypotheses */
    int64_t units;
} cairn_consensus_result;

cairn_consensus_result cairn_pose_consensus_read(const cairn_pose_consensus *consensus);

/* All zero for a node that is not there. */
cairn_consensus_node cairn_pose_consensus_node(const cairn_pose_consensus *consensus, int32_t node);

/* The alternatives of a node, the heaviest first; all zero for one that is not there. */
cairn_consensus_alternative cairn_pose_consensus_alternative(const cairn_pose_consensus *consensus,
                                                             int32_t node, int32_t index);

/* 1 when the poses found agree with a hypothesis: those are the measurements for a joint
 * solution. */
int32_t cairn_pose_consensus_agrees(const cairn_pose_consensus *consensus, int32_t hypothesis);

#ifdef __cplusplus
}
#endif

#endif
