/* pose_consensus: greedy growth, reassignment, and comparison of maps, item by item.
 * pose_consensus.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/ranked_list.h"
#include "src/poses/pose_consensus_work.h"

/* Sweeps of relaxation after a node is placed, and after a round of reassignment. */
enum { SWEEPS_GROWTH = 1, SWEEPS_ROUND = 2 };

/* nats: least gain of a reassignment, above rounding. */
static const cairn_real MIN_GAIN_NATS = CAIRN_REAL(1e-4);

/* ---- Seeds ---- */

/* Returns the strongest hypothesis between unplaced nodes, by score and cycle score; for a new map
 * only those that no map explains. -1: none that could place a node. */
static int32_t strongest_hypothesis(cairn_pose_consensus *consensus, int32_t for_new_map)
{
    cairn_real best = 0;
    int32_t index = -1;

    for (int32_t i = 0; i < consensus->hypothesis_count; i++) {
        const cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[i];

        if (consensus->current[h->first].component < 0 &&
            consensus->current[h->second].component < 0 && !(for_new_map && h->is_explained) &&
            h->score >= consensus->params.min_support && h->score + h->cycle_score > best) {
            best = h->score + h->cycle_score;
            index = i;
        }
    }
    consensus->units_due += 1 + consensus->hypothesis_count / 8;
    return index;
}

static void search(cairn_pose_consensus *consensus, cairn_pose_consensus_choice choice,
                   int32_t subject)
{
    int32_t all = choice == POSE_CONSENSUS_CHOOSE_NEXT;

    cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_SEARCH,
                               all ? consensus->first_link[consensus->node_count]
                                   : consensus->first_link[subject + 1]);
    consensus->next = all ? 0 : consensus->first_link[subject];
    consensus->subject = subject;
    consensus->choice = choice;
    consensus->candidate_count = 0;
}

/* Places the two nodes of a hypothesis as a new component; only the first when bounds forbid the
 * second. */
static void begin_part(cairn_pose_consensus *consensus, int32_t hypothesis)
{
    const cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[hypothesis];
    cairn_pose_consensus_pose first =
        cairn_pose_consensus_pose_of(consensus->bounds[h->first].centre);
    cairn_pose_consensus_pose second = cairn_pose_consensus_compose(first, h->first_second);

    consensus->component = consensus->component_count++;
    pose_consensus_place(consensus, h->first, first, consensus->component);
    if (cairn_pose_consensus_within_bounds(consensus, consensus->component, h->second, second,
                                           NULL))
        pose_consensus_place(consensus, h->second, second, consensus->component);
    search(consensus, POSE_CONSENSUS_CHOOSE_NEXT, 0);
}

static void start_growth(cairn_pose_consensus *consensus)
{
    int32_t hypothesis = -1;

    for (int32_t i = 0; i < consensus->node_count; i++)
        consensus->current[i].component = -1;
    if (consensus->result.starts < consensus->params.max_starts && consensus->block_passes == 0)
        hypothesis = strongest_hypothesis(consensus, 1);
    consensus->units_due++;
    if (hypothesis < 0) {
        cairn_pose_consensus_begin_blocks(consensus);
        return;
    }
    consensus->hypotheses[hypothesis].is_explained = 1;
    consensus->start = hypothesis;
    consensus->result.starts++;
    consensus->component_count = consensus->rounds = 0;
    begin_part(consensus, hypothesis);
}

/* ---- A choice ---- */

static cairn_real rank_of(const cairn_pose_consensus_candidate *candidate)
{
    return candidate->support + candidate->cycle_score;
}

/* Order of the candidate list; the current pose is always kept. */
static int is_better(const void *context, const void *entry, const void *other)
{
    const cairn_pose_consensus_candidate *a = entry, *b = other;

    (void)context;
    return !b->is_current && (a->is_current || !(rank_of(b) >= rank_of(a)));
}

/* Returns 1 for the same pose of a node. */
static int is_same(const void *context, const void *entry, const void *other)
{
    const cairn_pose_consensus_candidate *a = other, *b = entry;

    return a->node == b->node && a->component == b->component &&
           cairn_pose_consensus_is_same_pose(context, a->pose, b->pose);
}

static void insert_candidate(cairn_pose_consensus *consensus,
                             const cairn_pose_consensus_candidate *candidate)
{
    ranked_list candidates = {.entries = consensus->candidates,
                              .count = &consensus->candidate_count,
                              .capacity = consensus->params.max_candidates,
                              .entry_bytes = sizeof *candidate,
                              .ranks_before = is_better,
                              .is_near = is_same,
                              .context = consensus,
                              .replaces_one = 1};

    (void)ranked_list_insert(&candidates, candidate);
}

static void vote(cairn_pose_consensus *consensus, cairn_pose_consensus_candidate *candidate)
{
    cairn_pose_consensus_support support = cairn_pose_consensus_support_of(
        consensus, candidate->node, candidate->pose, candidate->component, 0);

    candidate->support = support.sum;
    consensus->units_due += support.units;
    if (cairn_pose_consensus_within_bounds(consensus, candidate->component, candidate->node,
                                           candidate->pose, NULL))
        insert_candidate(consensus, candidate);
    if (consensus->bound_count > 0)
        consensus->units_due += consensus->node_count;
}

static void propose(cairn_pose_consensus *consensus, int32_t link)
{
    const cairn_pose_consensus_hypothesis *h =
        &consensus->hypotheses[consensus->links[link].hypothesis];
    const cairn_pose_consensus_assignment *other =
        &consensus->current[consensus->links[link].other];
    cairn_pose_consensus_candidate candidate;

    memset(&candidate, 0, sizeof candidate);
    candidate.node = consensus->subject;
    candidate.component = other->component;
    candidate.pose = cairn_pose_consensus_compose(
        other->pose, cairn_pose_consensus_relative_to(h, consensus->links[link].other));
    candidate.cycle_score = consensus->choice == POSE_CONSENSUS_CHOOSE_NEXT ? h->cycle_score : 0;
    vote(consensus, &candidate);
}

static int is_open(const cairn_pose_consensus *consensus, int32_t link)
{
    int32_t here = consensus->current[consensus->subject].component,
            there = consensus->current[consensus->links[link].other].component;

    if (consensus->choice == POSE_CONSENSUS_CHOOSE_NEXT)
        return here < 0 && there == consensus->component;
    return consensus->choice == POSE_CONSENSUS_CHOOSE_REASSIGN ? there >= 0
                                                               : there >= 0 && there == here;
}

static void search_item(cairn_pose_consensus *consensus)
{
    consensus->units_due++;
    if (consensus->choice != POSE_CONSENSUS_CHOOSE_NEXT &&
        consensus->next == consensus->first_link[consensus->subject] &&
        consensus->candidate_count == 0 && consensus->current[consensus->subject].component >= 0) {
        cairn_pose_consensus_candidate current;

        memset(&current, 0, sizeof current);
        current.node = consensus->subject;
        current.component = consensus->current[consensus->subject].component;
        current.pose = consensus->current[consensus->subject].pose;
        current.is_current = 1;
        vote(consensus, &current);
    }
    if (consensus->next < consensus->end) {
        while (consensus->first_link[consensus->subject + 1] <= consensus->next)
            consensus->subject++;
        if (is_open(consensus, consensus->next))
            propose(consensus, consensus->next);
        consensus->next++;
        return;
    }
    cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_EVALUATE, consensus->candidate_count);
}

/* Returns the candidate of the best rank with enough support; -1: none. */
static int32_t best_candidate(const cairn_pose_consensus *consensus)
{
    int32_t best = -1;

    for (int32_t i = 0; i < consensus->candidate_count; i++)
        if (consensus->candidates[i].support >= consensus->params.min_support &&
            (best < 0 ||
             rank_of(&consensus->candidates[i]) > rank_of(&consensus->candidates[best])))
            best = i;
    return best;
}

static void choose_next(cairn_pose_consensus *consensus)
{
    int32_t best = best_candidate(consensus), hypothesis;

    if (best >= 0) {
        pose_consensus_place(consensus, consensus->candidates[best].node,
                             consensus->candidates[best].pose, consensus->component);
        cairn_pose_consensus_begin_relaxation(consensus, SWEEPS_GROWTH, POSE_CONSENSUS_SEARCH);
        return;
    }
    hypothesis = strongest_hypothesis(consensus, 0);
    if (hypothesis >= 0)
        begin_part(consensus, hypothesis);
    else
        cairn_pose_consensus_begin_rounds(consensus);
}

static void reassign(cairn_pose_consensus *consensus)
{
    int32_t best = best_candidate(consensus), current = -1;
    cairn_pose_consensus_assignment *node = &consensus->current[consensus->subject];

    for (int32_t i = 0; i < consensus->candidate_count; i++)
        if (consensus->candidates[i].is_current)
            current = i;
    if (best < 0) {
        consensus->changed_nodes += node->component >= 0;
        node->component = -1;
    } else if (current < 0 || consensus->candidates[best].support >
                                  consensus->candidates[current].support + MIN_GAIN_NATS) {
        pose_consensus_place(consensus, consensus->subject, consensus->candidates[best].pose,
                             consensus->candidates[best].component);
        consensus->changed_nodes++;
    }
    cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_REASSIGN, consensus->node_count);
    consensus->next = consensus->subject + 1;
}

static void report_item(cairn_pose_consensus *consensus);

static void evaluate_item(cairn_pose_consensus *consensus)
{
    consensus->units_due++;
    if (consensus->next < consensus->end) {
        cairn_pose_consensus_candidate *candidate = &consensus->candidates[consensus->next++];
        cairn_pose_consensus_support support = cairn_pose_consensus_support_of(
            consensus, candidate->node, candidate->pose, candidate->component, 1);

        candidate->support = support.sum;
        candidate->violations = support.violations;
        consensus->units_due += support.units;
    } else if (consensus->choice == POSE_CONSENSUS_CHOOSE_NEXT) {
        choose_next(consensus);
    } else if (consensus->choice == POSE_CONSENSUS_CHOOSE_REASSIGN) {
        reassign(consensus);
    } else {
        report_item(consensus);
    }
}

/* ---- Reassignment ---- */

static void reassign_item(cairn_pose_consensus *consensus)
{
    consensus->units_due++;
    if (consensus->next < consensus->end) {
        search(consensus, POSE_CONSENSUS_CHOOSE_REASSIGN, consensus->next);
    } else if (consensus->changed_nodes > 0) {
        consensus->result.rounds++;
        cairn_pose_consensus_begin_relaxation(consensus, SWEEPS_ROUND, POSE_CONSENSUS_MERGE);
    } else {
        consensus->total = 0;
        cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_TALLY, consensus->node_count);
    }
}

static void relax_item(cairn_pose_consensus *consensus)
{
    if (consensus->next < consensus->end) {
        consensus->units_due += 2 + (consensus->first_link[consensus->next + 1] -
                                     consensus->first_link[consensus->next]) /
                                        4;
        cairn_pose_consensus_relax(consensus, consensus->next);
        consensus->next++;
    } else if (--consensus->sweeps > 0) {
        consensus->next = 0;
    } else if (consensus->after == POSE_CONSENSUS_SEARCH) {
        search(consensus, POSE_CONSENSUS_CHOOSE_NEXT, 0);
    } else if (consensus->after == POSE_CONSENSUS_MERGE) {
        cairn_pose_consensus_begin_rounds(consensus);
    } else {
        cairn_pose_consensus_enter(consensus, consensus->after, consensus->node_count);
    }
}

/* ---- Comparison ---- */

/* Returns 1 when two maps have the same components with equal relative poses. */
static int same_map(const cairn_pose_consensus *consensus, const cairn_pose_consensus_assignment *a,
                    const cairn_pose_consensus_assignment *b)
{
    for (int32_t i = 0; i < consensus->node_count; i++) {
        int32_t anchor = 0;

        if (a[i].component < 0 || b[i].component < 0) {
            if (a[i].component != b[i].component)
                return 0;
            continue;
        }
        while (a[anchor].component != a[i].component)
            anchor++;
        if (b[anchor].component != b[i].component ||
            !cairn_pose_consensus_is_same_pose(
                consensus,
                cairn_pose_consensus_compose(cairn_pose_consensus_inverse(a[anchor].pose),
                                             a[i].pose),
                cairn_pose_consensus_compose(cairn_pose_consensus_inverse(b[anchor].pose),
                                             b[i].pose)))
            return 0;
    }
    return 1;
}

static void copy_map(const cairn_pose_consensus *consensus, cairn_pose_consensus_assignment *to,
                     const cairn_pose_consensus_assignment *from)
{
    memcpy(to, from, (size_t)consensus->node_count * sizeof *to);
}

/* Keeps the best map and the best competing one. */
static void compare(cairn_pose_consensus *consensus)
{
    cairn_pose_consensus_result *result = &consensus->result;
    int is_first = result->starts == 1 && consensus->block_passes == 0,
        is_other = !is_first && !same_map(consensus, consensus->current, consensus->best);
    int is_better = is_first || consensus->total > result->total;

    if (is_better && is_other) {
        copy_map(consensus, consensus->competing, consensus->best);
        result->competing_total = result->total;
    } else if (is_other && consensus->total > result->competing_total) {
        copy_map(consensus, consensus->competing, consensus->current);
        result->competing_total = consensus->total;
    }
    if (is_better) {
        copy_map(consensus, consensus->best, consensus->current);
        result->total = consensus->total;
        result->start = consensus->start;
    }
    consensus->units_due += consensus->node_count / 2;
}

static void mark_explained(cairn_pose_consensus *consensus)
{
    for (int32_t i = 0; i < consensus->hypothesis_count; i++) {
        cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[i];
        const cairn_pose_consensus_assignment *first = &consensus->current[h->first],
                                              *second = &consensus->current[h->second];

        if (first->component >= 0 && first->component == second->component &&
            cairn_pose_consensus_chi2(h, first->pose, second->pose, NULL) <
                consensus->params.max_chi2)
            h->is_explained = 1;
    }
    consensus->units_due += consensus->hypothesis_count / 2;
}

static void total_item(cairn_pose_consensus *consensus)
{
    consensus->units_due++;
    if (consensus->next < consensus->end) {
        const cairn_pose_consensus_assignment *node = &consensus->current[consensus->next];

        if (node->component >= 0) {
            cairn_pose_consensus_support support = cairn_pose_consensus_support_of(
                consensus, consensus->next, node->pose, node->component, 1);

            consensus->total += support.sum / 2;
            consensus->units_due += support.units;
        }
        consensus->next++;
    } else {
        compare(consensus);
        mark_explained(consensus);
        cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_START, 0);
    }
}

/* ---- Report ---- */

/* Visited twice per node: to search its alternatives, and after their evaluation. */
static void report_item(cairn_pose_consensus *consensus)
{
    consensus->units_due++;
    if (consensus->phase == POSE_CONSENSUS_EVALUATE) {
        cairn_pose_consensus_report_node(consensus);
        cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_REPORT, consensus->node_count);
        consensus->next = consensus->subject + 1;
        return;
    }
    while (consensus->next < consensus->end && consensus->current[consensus->next].component < 0)
        consensus->next++;
    if (consensus->next < consensus->end) {
        search(consensus, POSE_CONSENSUS_CHOOSE_ALTERNATIVES, consensus->next);
    } else {
        cairn_pose_consensus_finish(consensus);
        consensus->changed_nodes = 0;
        cairn_pose_consensus_enter(consensus,
                                   consensus->params.significant_support > 0
                                       ? POSE_CONSENSUS_PROPAGATE_AMBIGUITY
                                       : POSE_CONSENSUS_IDLE,
                                   consensus->node_count);
    }
}

void cairn_pose_consensus_item(cairn_pose_consensus *consensus)
{
    switch (consensus->phase) {
    case POSE_CONSENSUS_CYCLES:
        if (consensus->next < consensus->end)
            cairn_pose_consensus_add_cycles(consensus);
        else
            cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_START, 0);
        break;
    case POSE_CONSENSUS_START:
        start_growth(consensus);
        break;
    case POSE_CONSENSUS_SEARCH:
        search_item(consensus);
        break;
    case POSE_CONSENSUS_EVALUATE:
        evaluate_item(consensus);
        break;
    case POSE_CONSENSUS_RELAX:
        relax_item(consensus);
        break;
    case POSE_CONSENSUS_MERGE:
        cairn_pose_consensus_merge_item(consensus);
        break;
    case POSE_CONSENSUS_REASSIGN:
        reassign_item(consensus);
        break;
    case POSE_CONSENSUS_TALLY:
        total_item(consensus);
        break;
    case POSE_CONSENSUS_TREE:
        cairn_pose_consensus_tree_item(consensus);
        break;
    case POSE_CONSENSUS_BLOCK:
        cairn_pose_consensus_block_item(consensus);
        break;
    case POSE_CONSENSUS_PROPOSE:
        cairn_pose_consensus_propose_item(consensus);
        break;
    case POSE_CONSENSUS_SPLIT:
        cairn_pose_consensus_split_item(consensus);
        break;
    case POSE_CONSENSUS_SUBMAPS:
        cairn_pose_consensus_submap_item(consensus);
        break;
    case POSE_CONSENSUS_NUMBER_SUBMAPS:
        cairn_pose_consensus_number_item(consensus);
        break;
    case POSE_CONSENSUS_PROPAGATE_AMBIGUITY:
        cairn_pose_consensus_propagate_ambiguity_item(consensus);
        break;
    default:
        report_item(consensus);
        break;
    }
}
