/* min_cut: minimum cut of a graph between a source and a sink, by maximum flow in bounded steps.
 *
 * A node has a capacity from the source or into the sink, and an edge one in each direction. The
 * cut separates the nodes on the side of the source from the others at the least sum of capacities.
 * Of all minimum cuts it is the one with the fewest nodes on the side of the source.
 *
 * Method: from each node that the source feeds in turn, a breadth-first search finds a shortest path
 * of residual capacity to the sink. The path is saturated, and the search starts again. When there
 * is no path, no later one can pass what the search reached: that is on the side of the source, and
 * is not searched again. So a search stays near its node.
 *
 * Limits: residual capacities up to MIN_CUT_LEAST count as none.
 *
 * Source: Ford and Fulkerson 1956; Edmonds and Karp 1972. */
#ifndef CAIRN_CONTAINERS_MIN_CUT_H
#define CAIRN_CONTAINERS_MIN_CUT_H

#include "cairn/real.h"
#include "cairn/status.h"
#include "src/base/step.h"

/* least residual capacity that a path may use */
#define MIN_CUT_LEAST CAIRN_REAL(1e-3)

/* By which arc a search reached a node: none, or from the source. */
enum { MIN_CUT_NOT_REACHED = -1, MIN_CUT_FROM_SOURCE = -2 };

/* For a unit: nodes whose search state is reset, or which may be sources; arcs that are looked at;
 * nodes of a path. */
enum { MIN_CUT_NODES_PER_UNIT = 32, MIN_CUT_ARCS_PER_UNIT = 8, MIN_CUT_PATH_PER_UNIT = 8 };

typedef struct min_cut_node {
    /* residual capacity from the source; below 0: into the sink */
    cairn_real capacity;
    /* first arc that leaves the node, -1: none; an arc is 2 * edge + side */
    int32_t first;
    /* arc that reached the node */
    int32_t from;
    /* node at this place of the search's queue */
    int32_t queued;
} min_cut_node;

typedef struct min_cut_edge {
    /* residual capacity of the arc that leaves ends[side] */
    cairn_real capacity[2];
    /* next arc of the same node, -1: none */
    int32_t next[2];
    uint16_t ends[2];
} min_cut_edge;

typedef struct min_cut {
    min_cut_node *nodes;
    min_cut_edge *edges;
    int32_t node_count;
    /* resume point of the step */
    int32_t resume;
    /* node that the source feeds, and next arc of the node at the head of the queue, -1: none */
    int32_t source, arc;
    /* places of the queue: before `kept` the side of the source, [head, tail) wait */
    int32_t kept, head, tail;
} min_cut;

/* Removes all edges of the graph. Linear in the nodes. */
static inline void min_cut_clear(min_cut *cut, min_cut_node *nodes, min_cut_edge *edges,
                                 int32_t node_count)
{
    cut->nodes = nodes;
    cut->edges = edges;
    cut->node_count = node_count;
    cut->resume = 0;
    for (int32_t i = 0; i < node_count; i++)
        nodes[i].first = -1;
}

/* Sets the ends of an edge, which must be new, and links it. */
static inline void min_cut_link(min_cut *cut, int32_t edge, int32_t a, int32_t b)
{
    min_cut_edge *e = &cut->edges[edge];

    e->ends[0] = (uint16_t)a;
    e->ends[1] = (uint16_t)b;
    for (int side = 0; side < 2; side++) {
        e->next[side] = cut->nodes[e->ends[side]].first;
        cut->nodes[e->ends[side]].first = 2 * edge + side;
    }
}

static inline void min_cut_begin(min_cut *cut)
{
    cut->kept = cut->head = cut->tail = 0;
    for (int32_t i = 0; i < cut->node_count; i++)
        cut->nodes[i].from = MIN_CUT_NOT_REACHED;
}

/* Starts the search from the node that the source feeds; 0: it does not, or the node is on its
 * side. */
static inline int min_cut_begin_search(min_cut *cut)
{
    min_cut_node *node = &cut->nodes[cut->source];

    if (!(node->capacity > MIN_CUT_LEAST) || node->from != MIN_CUT_NOT_REACHED)
        return 0;
    node->from = MIN_CUT_FROM_SOURCE;
    cut->nodes[cut->tail++].queued = cut->source;
    return 1;
}

/* The node at the head of the queue. */
static inline const min_cut_node *min_cut_head(const min_cut *cut)
{
    return &cut->nodes[cut->nodes[cut->head].queued];
}

/* 1 while nodes wait, and the one at the head does not lead into the sink. */
static inline int min_cut_searches(const min_cut *cut)
{
    return cut->head < cut->tail && min_cut_head(cut)->capacity >= -MIN_CUT_LEAST;
}

/* Forgets what the search reached. */
static inline void min_cut_end_search(min_cut *cut)
{
    for (int32_t k = cut->kept; k < cut->tail; k++)
        cut->nodes[cut->nodes[k].queued].from = MIN_CUT_NOT_REACHED;
    cut->head = cut->tail = cut->kept;
}

/* Saturates the path that reached a node which leads into the sink. */
static inline void min_cut_saturate(min_cut *cut, int32_t last)
{
    cairn_real flow = -cut->nodes[last].capacity;
    int32_t i = last, arc;

    for (; (arc = cut->nodes[i].from) >= 0; i = cut->edges[arc / 2].ends[arc & 1])
        flow = cairn_min(flow, cut->edges[arc / 2].capacity[arc & 1]);
    flow = cairn_min(flow, cut->nodes[i].capacity);
    cut->nodes[i].capacity -= flow;
    cut->nodes[last].capacity += flow;
    for (i = last; (arc = cut->nodes[i].from) >= 0; i = cut->edges[arc / 2].ends[arc & 1]) {
        cut->edges[arc / 2].capacity[arc & 1] -= flow;
        cut->edges[arc / 2].capacity[!(arc & 1)] += flow;
    }
}

/* Queues the nodes that the next arcs of the node at the head reach first. */
static inline void min_cut_reach(min_cut *cut)
{
    for (int k = 0; k < MIN_CUT_ARCS_PER_UNIT && cut->arc >= 0; k++) {
        const min_cut_edge *e = &cut->edges[cut->arc / 2];
        int side = cut->arc & 1;
        min_cut_node *to = &cut->nodes[e->ends[!side]];

        if (to->from == MIN_CUT_NOT_REACHED && e->capacity[side] > MIN_CUT_LEAST) {
            to->from = cut->arc;
            cut->nodes[cut->tail++].queued = e->ends[!side];
        }
        cut->arc = e->next[side];
    }
}

/* Step: finds the minimum cut of the capacities, which become residual. 1 at the end, 0 when the
 * budget is used up.
 *
 * charged: units charged for the operation that waits, 0 before the first call */
static inline int min_cut_step(min_cut *cut, cairn_budget *budget, int32_t *charged)
{
    CAIRN_STEP_BEGIN(cut->resume);
    CAIRN_STEP_UNTIL(
        cut->resume,
        cairn_budget_charge(budget, charged, 1 + cut->node_count / MIN_CUT_NODES_PER_UNIT));
    min_cut_begin(cut);
    for (cut->source = 0; cut->source < cut->node_count; cut->source++) {
        if (cut->source % MIN_CUT_NODES_PER_UNIT == 0)
            CAIRN_STEP_UNTIL(cut->resume, cairn_budget_charge(budget, charged, 1));
        while (min_cut_begin_search(cut)) {
            CAIRN_STEP_UNTIL(cut->resume, cairn_budget_charge(budget, charged, 1));
            for (; min_cut_searches(cut); cut->head++)
                for (cut->arc = min_cut_head(cut)->first; cut->arc >= 0;) {
                    CAIRN_STEP_UNTIL(cut->resume, cairn_budget_charge(budget, charged, 1));
                    min_cut_reach(cut);
                }
            if (cut->head == cut->tail) {
                cut->kept = cut->tail;
                continue;
            }
            CAIRN_STEP_UNTIL(cut->resume, cairn_budget_charge(budget, charged,
                                                              1 + (cut->tail - cut->kept) /
                                                                      MIN_CUT_PATH_PER_UNIT));
            min_cut_saturate(cut, cut->nodes[cut->head].queued);
            min_cut_end_search(cut);
        }
    }
    CAIRN_STEP_END(cut->resume);
}

/* Returns 1 for a node on the side of the source, 0 for another; after the last step. */
static inline int min_cut_is_with_source(const min_cut *cut, int32_t node)
{
    return cut->nodes[node].from != MIN_CUT_NOT_REACHED;
}

#endif
