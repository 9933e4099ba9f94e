/* pose_consensus: greedy growth, reassignment, and comparison of maps. pose_consensus.c describes the
 * method. */
#include "src/base/build.h"

#include <string.h>

#include "src/poses/pose_consensus_work.h"

/* Sweeps of relaxation after a node is placed, and after a round of reassignment. */
enum { SWEEPS_GROWTH = 1, SWEEPS_ROUND = 2 };

/* Hypotheses whose scores are compared in a work unit. */
enum { SEEDS_PER_UNIT = 8 };

/* nats: least gain of a reassignment, above rounding. */
static const cairn_real MIN_GAIN_NATS = CAIRN_REAL(1e-4);

/* ---- Growth ---- */

/* Keeps the visited hypothesis when it is the strongest seed so far, by score and cycle score: one
 * between unplaced nodes that could place one; the first of a map is one that no map explains. */
static void keep_seed(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[consensus->hypothesis];

    if (consensus->current[h->first].component < 0 && consensus->current[h->second].component < 0 &&
        !(consensus->component_count == 0 && h->is_explained) &&
        h->score >= consensus->params.min_support &&
        h->score + h->cycle_score > consensus->seed_rank) {
        consensus->seed_rank = h->score + h->cycle_score;
        consensus->seed = consensus->hypothesis;
    }
}

/* Step of a part: finds the seed of the next component; -1: there is none. */
static int find_seed(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(consensus->resume.part);
    consensus->seed = -1;
    consensus->seed_rank = 0;
    for (consensus->hypothesis = 0; consensus->hypothesis < consensus->hypothesis_count;
         consensus->hypothesis++) {
        CAIRN_STEP_CHARGE_EVERY(consensus, resume.part, budget, SEEDS_PER_UNIT,
                                consensus->hypothesis);
        keep_seed(consensus);
    }
    CAIRN_STEP_END(consensus->resume.part);
}

/* Step of a phase: takes all nodes from the current map, and finds a seed while starts are left. */
static int begin_map(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(consensus->resume.phase);
    CAIRN_STEP_CHARGE(consensus, resume.phase, budget, cairn_pose_consensus_node_units(consensus));
    for (int32_t i = 0; i < consensus->node_count; i++)
        consensus->current[i].component = -1;
    consensus->component_count = consensus->rounds = 0;
    consensus->seed = -1;
    if (consensus->result.starts < consensus->params.max_starts)
        CAIRN_STEP_RUN(consensus, resume.phase, budget, find_seed);
    if (consensus->seed >= 0) {
        consensus->hypotheses[consensus->seed].is_explained = 1;
        consensus->start = consensus->seed;
        consensus->result.starts++;
    }
    CAIRN_STEP_END(consensus->resume.phase);
}

/* Places the two nodes of the seed as a new component; only the first when bounds forbid the
 * second. */
static void begin_part(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[consensus->seed];
    cairn_pose_consensus_pose first =
        cairn_pose_consensus_pose_of(consensus->bounds[h->first].centre);
    cairn_pose_consensus_pose second = cairn_pose_consensus_compose(&first, &h->first_second);

    consensus->component = consensus->component_count++;
    pose_consensus_place(consensus, h->first, &first, consensus->component);
    if (cairn_pose_consensus_within_bounds(consensus, consensus->component, h->second, &second,
                                           NULL))
        pose_consensus_place(consensus, h->second, &second, consensus->component);
}

/* Places the best candidate, or returns 0. */
static int place_best(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_candidate *best = cairn_pose_consensus_best_candidate(consensus);

    if (best == NULL)
        return 0;
    pose_consensus_place(consensus, best->node, &best->pose, consensus->component);
    return 1;
}

/* Step of a phase: grows components until no seed is left. */
static int grow(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(consensus->resume.phase);
    while (consensus->seed >= 0) {
        CAIRN_STEP_CHARGE(consensus, resume.phase, budget,
                          1 + cairn_pose_consensus_bound_units(consensus));
        begin_part(consensus);
        for (;;) {
            cairn_pose_consensus_set_choice(consensus, POSE_CONSENSUS_NEXT, 0);
            CAIRN_STEP_RUN(consensus, resume.phase, budget, cairn_pose_consensus_find_candidates);
            if (!place_best(consensus))
                break;
            consensus->sweeps = SWEEPS_GROWTH;
            CAIRN_STEP_RUN(consensus, resume.phase, budget, cairn_pose_consensus_relax);
        }
        CAIRN_STEP_RUN(consensus, resume.phase, budget, find_seed);
    }
    CAIRN_STEP_END(consensus->resume.phase);
}

/* ---- Reassignment ---- */

/* Chooses the pose of a node among its candidates. */
static void reassign(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_candidate *best = cairn_pose_consensus_best_candidate(consensus),
                                         *current = NULL;
    cairn_pose_consensus_assignment *node = &consensus->current[consensus->node];

    for (int32_t i = 0; i < consensus->choice.count; i++)
        if (consensus->candidates[i].is_current)
            current = &consensus->candidates[i];
    if (best == NULL) {
        consensus->changed_nodes += node->component >= 0;
        node->component = -1;
    } else if (current == NULL || best->support > current->support + MIN_GAIN_NATS) {
        pose_consensus_place(consensus, consensus->node, &best->pose, best->component);
        consensus->changed_nodes++;
    }
}

/* Step of a phase: merges components and reassigns every node, until nothing changes. */
static int improve(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(consensus->resume.phase);
    do {
        do
            CAIRN_STEP_RUN(consensus, resume.phase, budget, cairn_pose_consensus_merge_parts);
        while (consensus->is_merged);
        consensus->changed_nodes = 0;
        if (consensus->rounds < consensus->params.max_rounds)
            for (consensus->node = 0; consensus->node < consensus->node_count; consensus->node++) {
                CAIRN_STEP_CHARGE_UNIT(consensus, resume.phase, budget);
                cairn_pose_consensus_set_choice(consensus, POSE_CONSENSUS_REASSIGN,
                                                consensus->node);
                CAIRN_STEP_RUN(consensus, resume.phase, budget,
                               cairn_pose_consensus_find_candidates);
                reassign(consensus);
            }
        consensus->rounds++;
        if (consensus->changed_nodes > 0) {
            consensus->result.rounds++;
            consensus->sweeps = SWEEPS_ROUND;
            CAIRN_STEP_RUN(consensus, resume.phase, budget, cairn_pose_consensus_relax);
        }
    } while (consensus->changed_nodes > 0);
    CAIRN_STEP_END(consensus->resume.phase);
}

/* ---- Comparison ---- */

/* Returns the pose of a node in the frame of the first node of its component. */
static cairn_pose_consensus_pose pose_from(const cairn_pose_consensus_assignment *map,
                                           int32_t anchor, int32_t node)
{
    cairn_pose_consensus_pose anchor_map = cairn_pose_consensus_inverse(&map[anchor].pose);

    return cairn_pose_consensus_compose(&anchor_map, &map[node].pose);
}

/* Returns 1 when a node has the same component and an equal relative pose in the current and in the
 * best map. */
static int is_same_in_best(const cairn_pose_consensus *consensus, int32_t node)
{
    const cairn_pose_consensus_assignment *a = consensus->current, *b = consensus->best;
    cairn_pose_consensus_pose pose_a, pose_b;
    int32_t anchor = 0;

    if (a[node].component < 0 || b[node].component < 0)
        return a[node].component == b[node].component;
    while (a[anchor].component != a[node].component)
        anchor++;
    pose_a = pose_from(a, anchor, node);
    pose_b = pose_from(b, anchor, node);
    return b[anchor].component == b[node].component &&
           cairn_pose_consensus_is_same_pose(consensus, &pose_a, &pose_b);
}

/* 1 for the first map of all. */
static int is_first_map(const cairn_pose_consensus *consensus)
{
    return consensus->result.starts == 1 && consensus->block_passes == 0;
}

static void copy_map(const cairn_pose_consensus *consensus, cairn_pose_consensus_assignment *to,
                     const cairn_pose_consensus_assignment *from)
{
    memcpy(to, from, (size_t)consensus->node_count * sizeof *to);
}

/* Keeps the best map and the best competing one. */
static void keep_best(cairn_pose_consensus *consensus)
{
    cairn_pose_consensus_result *result = &consensus->result;
    int is_better = is_first_map(consensus) || consensus->total > result->total;

    if (is_better && consensus->is_other) {
        copy_map(consensus, consensus->competing, consensus->best);
        result->competing_total = result->total;
    } else if (consensus->is_other && consensus->total > result->competing_total) {
        copy_map(consensus, consensus->competing, consensus->current);
        result->competing_total = consensus->total;
    }
    if (is_better) {
        copy_map(consensus, consensus->best, consensus->current);
        result->total = consensus->total;
        result->start = consensus->start;
    }
}

/* Step of a phase: the total of the current map. */
static int sum_total(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(consensus->resume.phase);
    consensus->total = 0;
    for (consensus->node = 0; consensus->node < consensus->node_count; consensus->node++) {
        CAIRN_STEP_CHARGE_UNIT(consensus, resume.phase, budget);
        if (consensus->current[consensus->node].component < 0)
            continue;
        cairn_pose_consensus_query_current(consensus, consensus->node, POSE_CONSENSUS_BY_ALL);
        CAIRN_STEP_RUN(consensus, resume.phase, budget, cairn_pose_consensus_find_support);
        consensus->total += consensus->query.found.sum / 2;
    }
    CAIRN_STEP_END(consensus->resume.phase);
}

/* Step of a phase: compares the current map with the best. */
static int compare(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(consensus->resume.phase);
    consensus->is_other = 0;
    if (!is_first_map(consensus))
        for (consensus->node = 0; consensus->node < consensus->node_count && !consensus->is_other;
             consensus->node++) {
            CAIRN_STEP_CHARGE(consensus, resume.phase, budget,
                              cairn_pose_consensus_node_units(consensus));
            consensus->is_other = !is_same_in_best(consensus, consensus->node);
        }
    CAIRN_STEP_CHARGE(consensus, resume.phase, budget, cairn_pose_consensus_copy_units(consensus));
    keep_best(consensus);
    CAIRN_STEP_RUN(consensus, resume.phase, budget, cairn_pose_consensus_find_inliers);
    CAIRN_STEP_END(consensus->resume.phase);
}

/* ---- The search ---- */

/* 1 when another pass over the blocks of the best map may find a better one. */
static int may_move_blocks(const cairn_pose_consensus *consensus)
{
    return consensus->result.starts > 0 && consensus->block_passes < consensus->params.max_rounds &&
           (consensus->block_passes == 0 || !(consensus->total < consensus->result.total));
}

int cairn_pose_consensus_search(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(consensus->resume.search);
    CAIRN_STEP_RUN(consensus, resume.search, budget, cairn_pose_consensus_add_cycles);
    for (;;) {
        CAIRN_STEP_RUN(consensus, resume.search, budget, begin_map);
        if (consensus->seed < 0)
            break;
        CAIRN_STEP_RUN(consensus, resume.search, budget, grow);
        CAIRN_STEP_RUN(consensus, resume.search, budget, improve);
        CAIRN_STEP_RUN(consensus, resume.search, budget, sum_total);
        CAIRN_STEP_RUN(consensus, resume.search, budget, compare);
    }
    while (may_move_blocks(consensus)) {
        consensus->block_passes++;
        CAIRN_STEP_RUN(consensus, resume.search, budget, cairn_pose_consensus_move_blocks);
        if (consensus->changed_nodes == 0)
            break;
        consensus->rounds = 0;
        CAIRN_STEP_RUN(consensus, resume.search, budget, improve);
        CAIRN_STEP_RUN(consensus, resume.search, budget, sum_total);
        CAIRN_STEP_RUN(consensus, resume.search, budget, compare);
    }
    CAIRN_STEP_RUN(consensus, resume.search, budget, cairn_pose_consensus_report);
    if (consensus->params.significant_support > 0)
        CAIRN_STEP_RUN(consensus, resume.search, budget, cairn_pose_consensus_propagate_ambiguity);
    CAIRN_STEP_END(consensus->resume.search);
}
