/* pose_consensus: growth, merging of parts, choosing again, and the comparison of maps, item by
 * item. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/pose_consensus_work.h"

enum { SWEEPS_GROWTH = 1, SWEEPS_ROUND = 2, SWEEPS_END = 10 };

/* A node moves only for more support than rounding makes. */
static const cairn_real MOVE = CAIRN_REAL(1e-4);

void cairn_consensus_enter(cairn_pose_consensus *c, cairn_consensus_phase phase, int32_t end)
{
    c->phase = phase;
    c->next = 0;
    c->end = end;
}

/* ---- Starts ---- */

/* The strongest hypothesis between unplaced nodes, counting the ways round that agree; for a new
 * map only those that no map explains. -1: none that could place a node. */
static int32_t strongest_hypothesis(cairn_pose_consensus *c, int32_t for_new_map)
{
    cairn_real best = 0;
    int32_t index = -1;

    for (int32_t i = 0; i < c->hypothesis_count; i++) {
        const cairn_kept_hypothesis *h = &c->hypotheses[i];

        if (c->chart[h->first].part < 0 && c->chart[h->second].part < 0 &&
            !(for_new_map && h->is_explained) && h->score >= c->params.min_support &&
            h->score + h->cycles > best) {
            best = h->score + h->cycles;
            index = i;
        }
    }
    c->debt += 1 + c->hypothesis_count / 8;
    return index;
}

static void place(cairn_pose_consensus *c, int32_t node, cairn_turned_pose pose, int32_t part)
{
    c->chart[node].pose = pose;
    c->chart[node].part = part;
}

static void search(cairn_pose_consensus *c, cairn_consensus_choice choice, int32_t subject)
{
    int32_t all = choice == CAIRN_CHOOSE_NEXT;

    cairn_consensus_enter(c, CAIRN_CONSENSUS_SEARCH,
                          all ? c->first_link[c->node_count] : c->first_link[subject + 1]);
    c->next = all ? 0 : c->first_link[subject];
    c->subject = subject;
    c->choice = choice;
    c->candidate_count = 0;
}

/* Places the two nodes of a hypothesis as a new part; only the first when bounds forbid the
 * second. */
static void begin_part(cairn_pose_consensus *c, int32_t hypothesis)
{
    const cairn_kept_hypothesis *h = &c->hypotheses[hypothesis];
    cairn_turned_pose first = cairn_turned_of(c->bounds[h->first].centre);
    cairn_turned_pose second = cairn_turned_compose(first, h->first_second);

    c->part = c->parts++;
    place(c, h->first, first, c->part);
    if (cairn_consensus_within_bounds(c, c->part, h->second, second, NULL))
        place(c, h->second, second, c->part);
    search(c, CAIRN_CHOOSE_NEXT, 0);
}

static void relax(cairn_pose_consensus *c, int32_t sweeps, cairn_consensus_phase after)
{
    cairn_consensus_enter(c, CAIRN_CONSENSUS_RELAX, c->node_count);
    c->sweeps = sweeps;
    c->after = after;
}

void cairn_consensus_begin_report(cairn_pose_consensus *c)
{
    memcpy(c->chart, c->best, (size_t)c->node_count * sizeof *c->chart);
    relax(c, SWEEPS_END, CAIRN_CONSENSUS_REPORT);
}

static void start(cairn_pose_consensus *c)
{
    int32_t hypothesis = -1;

    for (int32_t i = 0; i < c->node_count; i++)
        c->chart[i].part = -1;
    if (c->result.starts < c->params.max_starts && c->passes == 0)
        hypothesis = strongest_hypothesis(c, 1);
    c->debt++;
    if (hypothesis < 0) {
        cairn_consensus_begin_blocks(c);
        return;
    }
    c->hypotheses[hypothesis].is_explained = 1;
    c->start = hypothesis;
    c->result.starts++;
    c->parts = c->rounds = 0;
    begin_part(c, hypothesis);
}

/* ---- A choice ---- */

static cairn_real rank_of(const cairn_candidate *candidate)
{
    return candidate->support + candidate->cycles;
}

/* 1 when a candidate stays in the list before another one: where a node lies already is always
 * judged. */
static int is_before(const cairn_candidate *a, const cairn_candidate *b)
{
    return a->current || (!b->current && rank_of(a) >= rank_of(b));
}

/* Into the list of the best; of two for one pose of a node the better stays, or the one where it
 * lies already. */
static void keep_candidate(cairn_pose_consensus *c, const cairn_candidate *candidate)
{
    cairn_candidate *list = c->candidates;
    int32_t at = 0, same = -1;

    for (int32_t i = 0; i < c->candidate_count && same < 0; i++)
        if (list[i].node == candidate->node && list[i].part == candidate->part &&
            cairn_consensus_same(c, list[i].pose, candidate->pose))
            same = i;
    if (same >= 0 && is_before(&list[same], candidate))
        return;
    if (same >= 0) {
        memmove(&list[same], &list[same + 1],
                (size_t)(c->candidate_count - same - 1) * sizeof *list);
        c->candidate_count--;
    }
    while (at < c->candidate_count && is_before(&list[at], candidate))
        at++;
    if (at == c->params.max_candidates)
        return;
    if (c->candidate_count == c->params.max_candidates)
        c->candidate_count--;
    memmove(&list[at + 1], &list[at], (size_t)(c->candidate_count - at) * sizeof *list);
    list[at] = *candidate;
    c->candidate_count++;
}

static void vote(cairn_pose_consensus *c, cairn_candidate *candidate)
{
    cairn_consensus_support support =
        cairn_consensus_support_of(c, candidate->node, candidate->pose, candidate->part, 0);

    candidate->support = support.sum;
    c->debt += support.units;
    if (cairn_consensus_within_bounds(c, candidate->part, candidate->node, candidate->pose, NULL))
        keep_candidate(c, candidate);
    if (c->bound_count > 0)
        c->debt += c->node_count;
}

static void propose(cairn_pose_consensus *c, int32_t link)
{
    const cairn_kept_hypothesis *h = &c->hypotheses[c->links[link].hypothesis];
    const cairn_chart_node *other = &c->chart[c->links[link].other];
    cairn_candidate candidate;

    memset(&candidate, 0, sizeof candidate);
    candidate.node = c->subject;
    candidate.part = other->part;
    candidate.pose =
        cairn_turned_compose(other->pose, cairn_consensus_seen_from(h, c->links[link].other));
    candidate.cycles = c->choice == CAIRN_CHOOSE_NEXT ? h->cycles : 0;
    vote(c, &candidate);
}

static int is_open(const cairn_pose_consensus *c, int32_t link)
{
    int32_t here = c->chart[c->subject].part, there = c->chart[c->links[link].other].part;

    if (c->choice == CAIRN_CHOOSE_NEXT)
        return here < 0 && there == c->part;
    return c->choice == CAIRN_CHOOSE_AGAIN ? there >= 0 : there >= 0 && there == here;
}

static void search_item(cairn_pose_consensus *c)
{
    c->debt++;
    if (c->choice != CAIRN_CHOOSE_NEXT && c->next == c->first_link[c->subject] &&
        c->candidate_count == 0 && c->chart[c->subject].part >= 0) {
        cairn_candidate current;

        memset(&current, 0, sizeof current);
        current.node = c->subject;
        current.part = c->chart[c->subject].part;
        current.pose = c->chart[c->subject].pose;
        current.current = 1;
        vote(c, &current);
    }
    if (c->next < c->end) {
        while (c->first_link[c->subject + 1] <= c->next)
            c->subject++;
        if (is_open(c, c->next))
            propose(c, c->next);
        c->next++;
        return;
    }
    cairn_consensus_enter(c, CAIRN_CONSENSUS_JUDGE, c->candidate_count);
}

/* The candidate with the best rank and enough support; -1: none. */
static int32_t best_candidate(const cairn_pose_consensus *c)
{
    int32_t best = -1;

    for (int32_t i = 0; i < c->candidate_count; i++)
        if (c->candidates[i].support >= c->params.min_support &&
            (best < 0 || rank_of(&c->candidates[i]) > rank_of(&c->candidates[best])))
            best = i;
    return best;
}

void cairn_consensus_begin_rounds(cairn_pose_consensus *c)
{
    c->merge.support = 0;
    cairn_consensus_enter(c, CAIRN_CONSENSUS_MERGE, c->hypothesis_count);
}

static void choose_next(cairn_pose_consensus *c)
{
    int32_t best = best_candidate(c), hypothesis;

    if (best >= 0) {
        place(c, c->candidates[best].node, c->candidates[best].pose, c->part);
        relax(c, SWEEPS_GROWTH, CAIRN_CONSENSUS_SEARCH);
        return;
    }
    hypothesis = strongest_hypothesis(c, 0);
    if (hypothesis >= 0)
        begin_part(c, hypothesis);
    else
        cairn_consensus_begin_rounds(c);
}

static void choose_again(cairn_pose_consensus *c)
{
    int32_t best = best_candidate(c), current = -1;
    cairn_chart_node *node = &c->chart[c->subject];

    for (int32_t i = 0; i < c->candidate_count; i++)
        if (c->candidates[i].current)
            current = i;
    if (best < 0) {
        c->changed += node->part >= 0;
        node->part = -1;
    } else if (current < 0 || c->candidates[best].support > c->candidates[current].support + MOVE) {
        place(c, c->subject, c->candidates[best].pose, c->candidates[best].part);
        c->changed++;
    }
    cairn_consensus_enter(c, CAIRN_CONSENSUS_AGAIN, c->node_count);
    c->next = c->subject + 1;
}

static void report_item(cairn_pose_consensus *c);

static void judge_item(cairn_pose_consensus *c)
{
    c->debt++;
    if (c->next < c->end) {
        cairn_candidate *candidate = &c->candidates[c->next++];
        cairn_consensus_support support =
            cairn_consensus_support_of(c, candidate->node, candidate->pose, candidate->part, 1);

        candidate->support = support.sum;
        candidate->against = support.against;
        c->debt += support.units;
    } else if (c->choice == CAIRN_CHOOSE_NEXT) {
        choose_next(c);
    } else if (c->choice == CAIRN_CHOOSE_AGAIN) {
        choose_again(c);
    } else {
        report_item(c);
    }
}

/* ---- Rounds ---- */

cairn_real cairn_consensus_merged_support(cairn_pose_consensus *c, const cairn_candidate *merge,
                                          int32_t judged)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < c->node_count; i++)
        if (c->chart[i].part == merge->node) {
            cairn_consensus_support support = cairn_consensus_support_of(
                c, i, cairn_turned_compose(merge->pose, c->chart[i].pose), merge->part, judged);

            sum += support.sum;
            c->debt += support.units;
        }
    return sum;
}

static void propose_merge(cairn_pose_consensus *c, const cairn_kept_hypothesis *h)
{
    const cairn_chart_node *first = &c->chart[h->first], *second = &c->chart[h->second];
    cairn_candidate merge;

    memset(&merge, 0, sizeof merge);
    merge.node = second->part;
    merge.part = first->part;
    merge.pose = cairn_turned_compose(cairn_turned_compose(first->pose, h->first_second),
                                      cairn_turned_inverse(second->pose));
    merge.support = cairn_consensus_merged_support(c, &merge, 0);
    if (merge.support > c->merge.support)
        c->merge = merge;
}

int32_t cairn_consensus_lay(cairn_pose_consensus *c, const cairn_candidate *merge)
{
    cairn_turned_pose back = cairn_turned_inverse(merge->pose);

    for (int32_t i = 0; i < c->node_count; i++) {
        c->chart[i].part_before = c->chart[i].part;
        if (c->chart[i].part == merge->node)
            place(c, i, cairn_turned_compose(merge->pose, c->chart[i].pose), merge->part);
    }
    if (cairn_consensus_within_bounds(c, merge->part, -1, back, NULL))
        return 1;
    for (int32_t i = 0; i < c->node_count; i++)
        if (c->chart[i].part_before == merge->node)
            place(c, i, cairn_turned_compose(back, c->chart[i].pose), merge->node);
    return 0;
}

static void merge_item(cairn_pose_consensus *c)
{
    const cairn_kept_hypothesis *h = &c->hypotheses[c->next];

    c->debt++;
    if (c->next < c->end) {
        int32_t first = c->chart[h->first].part, second = c->chart[h->second].part;

        c->next++;
        if (first >= 0 && second >= 0 && first != second)
            propose_merge(c, h);
    } else if (c->merge.support > 0 &&
               cairn_consensus_merged_support(c, &c->merge, 1) >= c->params.min_support &&
               cairn_consensus_lay(c, &c->merge)) {
        cairn_consensus_begin_rounds(c);
    } else {
        c->changed = 0;
        cairn_consensus_enter(c, CAIRN_CONSENSUS_AGAIN,
                              c->rounds < c->params.max_rounds ? c->node_count : 0);
        c->rounds++;
    }
}

static void again_item(cairn_pose_consensus *c)
{
    c->debt++;
    if (c->next < c->end) {
        search(c, CAIRN_CHOOSE_AGAIN, c->next);
    } else if (c->changed > 0) {
        c->result.rounds++;
        relax(c, SWEEPS_ROUND, CAIRN_CONSENSUS_MERGE);
    } else {
        c->total = 0;
        cairn_consensus_enter(c, CAIRN_CONSENSUS_TALLY, c->node_count);
    }
}

static void relax_item(cairn_pose_consensus *c)
{
    if (c->next < c->end) {
        c->debt += 2 + (c->first_link[c->next + 1] - c->first_link[c->next]) / 4;
        cairn_consensus_relax(c, c->next);
        c->next++;
    } else if (--c->sweeps > 0) {
        c->next = 0;
    } else if (c->after == CAIRN_CONSENSUS_SEARCH) {
        search(c, CAIRN_CHOOSE_NEXT, 0);
    } else if (c->after == CAIRN_CONSENSUS_MERGE) {
        cairn_consensus_begin_rounds(c);
    } else {
        cairn_consensus_enter(c, c->after, c->node_count);
    }
}

/* ---- Comparison ---- */

/* 1 when two maps have the same parts, and nodes lie alike in them. */
static int same_map(const cairn_pose_consensus *c, const cairn_chart_node *a,
                    const cairn_chart_node *b)
{
    for (int32_t i = 0; i < c->node_count; i++) {
        int32_t anchor = 0;

        if (a[i].part < 0 || b[i].part < 0) {
            if (a[i].part != b[i].part)
                return 0;
            continue;
        }
        while (a[anchor].part != a[i].part)
            anchor++;
        if (b[anchor].part != b[i].part ||
            !cairn_consensus_same(
                c, cairn_turned_compose(cairn_turned_inverse(a[anchor].pose), a[i].pose),
                cairn_turned_compose(cairn_turned_inverse(b[anchor].pose), b[i].pose)))
            return 0;
    }
    return 1;
}

static void copy_map(const cairn_pose_consensus *c, cairn_chart_node *to,
                     const cairn_chart_node *from)
{
    memcpy(to, from, (size_t)c->node_count * sizeof *to);
}

/* Keeps the best map, and the best one that is another. */
static void compare(cairn_pose_consensus *c)
{
    cairn_consensus_result *result = &c->result;
    int is_first = result->starts == 1 && c->passes == 0,
        is_other = !is_first && !same_map(c, c->chart, c->best);
    int is_better = is_first || c->total > result->total;

    if (is_better && is_other) {
        copy_map(c, c->rival, c->best);
        result->rival = result->total;
    } else if (is_other && c->total > result->rival) {
        copy_map(c, c->rival, c->chart);
        result->rival = c->total;
    }
    if (is_better) {
        copy_map(c, c->best, c->chart);
        result->total = c->total;
        result->start = c->start;
    }
    c->debt += c->node_count / 2;
}

static void mark_explained(cairn_pose_consensus *c)
{
    for (int32_t i = 0; i < c->hypothesis_count; i++) {
        cairn_kept_hypothesis *h = &c->hypotheses[i];
        const cairn_chart_node *first = &c->chart[h->first], *second = &c->chart[h->second];

        if (first->part >= 0 && first->part == second->part &&
            cairn_consensus_chi(h, first->pose, second->pose, NULL) < c->params.gate)
            h->is_explained = 1;
    }
    c->debt += c->hypothesis_count / 2;
}

static void tally_item(cairn_pose_consensus *c)
{
    c->debt++;
    if (c->next < c->end) {
        const cairn_chart_node *node = &c->chart[c->next];

        if (node->part >= 0) {
            cairn_consensus_support support =
                cairn_consensus_support_of(c, c->next, node->pose, node->part, 1);

            c->total += support.sum / 2;
            c->debt += support.units;
        }
        c->next++;
    } else {
        compare(c);
        mark_explained(c);
        cairn_consensus_enter(c, CAIRN_CONSENSUS_START, 0);
    }
}

/* ---- Report ---- */

/* Comes twice to a node: to search its alternatives, and after that from the judge. */
static void report_item(cairn_pose_consensus *c)
{
    c->debt++;
    if (c->phase == CAIRN_CONSENSUS_JUDGE) {
        cairn_consensus_report_node(c);
        cairn_consensus_enter(c, CAIRN_CONSENSUS_REPORT, c->node_count);
        c->next = c->subject + 1;
        return;
    }
    while (c->next < c->end && c->chart[c->next].part < 0)
        c->next++;
    if (c->next < c->end) {
        search(c, CAIRN_CHOOSE_ALTERNATIVES, c->next);
    } else {
        cairn_consensus_finish(c);
        c->changed = 0;
        cairn_consensus_enter(
            c, c->params.believed > 0 ? CAIRN_CONSENSUS_SPREAD : CAIRN_CONSENSUS_IDLE,
            c->node_count);
    }
}

void cairn_consensus_item(cairn_pose_consensus *c)
{
    switch (c->phase) {
    case CAIRN_CONSENSUS_CYCLES:
        if (c->next < c->end)
            cairn_consensus_add_cycles(c);
        else
            cairn_consensus_enter(c, CAIRN_CONSENSUS_START, 0);
        break;
    case CAIRN_CONSENSUS_START:
        start(c);
        break;
    case CAIRN_CONSENSUS_SEARCH:
        search_item(c);
        break;
    case CAIRN_CONSENSUS_JUDGE:
        judge_item(c);
        break;
    case CAIRN_CONSENSUS_RELAX:
        relax_item(c);
        break;
    case CAIRN_CONSENSUS_MERGE:
        merge_item(c);
        break;
    case CAIRN_CONSENSUS_AGAIN:
        again_item(c);
        break;
    case CAIRN_CONSENSUS_TALLY:
        tally_item(c);
        break;
    case CAIRN_CONSENSUS_TREE:
        cairn_consensus_tree_item(c);
        break;
    case CAIRN_CONSENSUS_BLOCK:
        cairn_consensus_block_item(c);
        break;
    case CAIRN_CONSENSUS_PROPOSE:
        cairn_consensus_propose_item(c);
        break;
    case CAIRN_CONSENSUS_PART:
        cairn_consensus_part_item(c);
        break;
    case CAIRN_CONSENSUS_ISLANDS:
        cairn_consensus_island_item(c);
        break;
    case CAIRN_CONSENSUS_NUMBER:
        cairn_consensus_number_item(c);
        break;
    case CAIRN_CONSENSUS_SPREAD:
        cairn_consensus_spread_item(c);
        break;
    default:
        report_item(c);
        break;
    }
}
