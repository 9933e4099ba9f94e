/* pose_consensus: candidates for the pose of a node. pose_consensus.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/ranked_list.h"
#include "src/poses/pose_consensus_work.h"

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
           cairn_pose_consensus_is_same_pose(context, &a->pose, &b->pose);
}

static void insert_candidate(cairn_pose_consensus *consensus,
                             const cairn_pose_consensus_candidate *candidate)
{
    ranked_list candidates = {.entries = consensus->candidates,
                              .count = &consensus->choice.count,
                              .capacity = consensus->params.max_candidates,
                              .entry_bytes = sizeof *candidate,
                              .ranks_before = is_better,
                              .is_near = is_same,
                              .context = consensus,
                              .replaces_one = 1};

    (void)ranked_list_insert(&candidates, candidate);
}

/* Starts a candidate for the pose of the node. */
static cairn_pose_consensus_candidate *begin_candidate(cairn_pose_consensus *consensus,
                                                       int32_t component)
{
    cairn_pose_consensus_candidate *candidate = &consensus->choice.candidate;

    memset(candidate, 0, sizeof *candidate);
    candidate->node = consensus->choice.node;
    candidate->component = component;
    return candidate;
}

/* Sets the candidate to the current pose of the node. */
static void take_current(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_assignment *current = &consensus->current[consensus->choice.node];
    cairn_pose_consensus_candidate *candidate = begin_candidate(consensus, current->component);

    candidate->pose = current->pose;
    candidate->is_current = 1;
}

/* Sets the candidate to the pose that the hypothesis of the link proposes. */
static void take_proposed(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_link *link = &consensus->links[consensus->choice.link];
    const cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[link->hypothesis];
    const cairn_pose_consensus_assignment *other = &consensus->current[link->other];
    cairn_pose_consensus_candidate *candidate = begin_candidate(consensus, other->component);

    candidate->pose = cairn_pose_consensus_compose(
        &other->pose, cairn_pose_consensus_relative_to(h, link->other));
    if (consensus->choice.subject == POSE_CONSENSUS_NEXT)
        candidate->cycle_score = h->cycle_score;
}

/* Sets the query: the support of a candidate. */
static void query_candidate(cairn_pose_consensus *consensus,
                            const cairn_pose_consensus_candidate *candidate,
                            cairn_pose_consensus_evidence evidence)
{
    cairn_pose_consensus_set_query(consensus, candidate->node, &candidate->pose,
                                   candidate->component, evidence);
}

/* Step of a sum: counts the votes for the candidate, and inserts it if the bounds permit it. */
static int vote(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    cairn_pose_consensus_candidate *candidate = &consensus->choice.candidate;

    CAIRN_STEP_BEGIN(consensus->resume.sum);
    query_candidate(consensus, candidate, POSE_CONSENSUS_BY_HYPOTHESES);
    CAIRN_STEP_RUN(consensus, resume.sum, budget, cairn_pose_consensus_find_support);
    candidate->support = consensus->query.found.sum;
    CAIRN_STEP_CHARGE(consensus, resume.sum, budget, cairn_pose_consensus_bound_units(consensus));
    if (cairn_pose_consensus_within_bounds(consensus, candidate->component, candidate->node,
                                           &candidate->pose, NULL))
        insert_candidate(consensus, candidate);
    CAIRN_STEP_END(consensus->resume.sum);
}

/* Advances to the node of the next link, and returns 1 when its hypothesis may propose a pose. */
static int is_open(cairn_pose_consensus *consensus)
{
    struct pose_consensus_choice *choice = &consensus->choice;
    int32_t here, there = consensus->current[consensus->links[choice->link].other].component;

    while (consensus->first_link[choice->node + 1] <= choice->link)
        choice->node++;
    here = consensus->current[choice->node].component;
    if (choice->subject == POSE_CONSENSUS_NEXT)
        return here < 0 && there == consensus->component;
    return choice->subject == POSE_CONSENSUS_REASSIGN ? there >= 0 : there >= 0 && there == here;
}

void cairn_pose_consensus_set_choice(cairn_pose_consensus *consensus,
                                     cairn_pose_consensus_subject subject, int32_t node)
{
    struct pose_consensus_choice *choice = &consensus->choice;
    int32_t all = subject == POSE_CONSENSUS_NEXT;

    choice->subject = subject;
    choice->node = node;
    choice->link = all ? 0 : consensus->first_link[node];
    choice->end = consensus->first_link[all ? consensus->node_count : node + 1];
    choice->count = 0;
}

/* Keeps what the likelihood functions have found of the candidate. */
static void keep_evaluation(cairn_pose_consensus *consensus)
{
    cairn_pose_consensus_candidate *candidate = &consensus->candidates[consensus->choice.evaluated];

    candidate->support = consensus->query.found.sum;
    candidate->violations = consensus->query.found.violations;
}

int cairn_pose_consensus_find_candidates(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    struct pose_consensus_choice *choice = &consensus->choice;

    CAIRN_STEP_BEGIN(consensus->resume.part);
    if (choice->subject != POSE_CONSENSUS_NEXT && consensus->current[choice->node].component >= 0) {
        take_current(consensus);
        CAIRN_STEP_RUN(consensus, resume.part, budget, vote);
    }
    for (; choice->link < choice->end; choice->link++) {
        CAIRN_STEP_CHARGE_UNIT(consensus, resume.part, budget);
        if (!is_open(consensus))
            continue;
        take_proposed(consensus);
        CAIRN_STEP_RUN(consensus, resume.part, budget, vote);
    }
    for (choice->evaluated = 0; choice->evaluated < choice->count; choice->evaluated++) {
        CAIRN_STEP_CHARGE_UNIT(consensus, resume.part, budget);
        query_candidate(consensus, &consensus->candidates[choice->evaluated],
                        POSE_CONSENSUS_BY_ALL);
        CAIRN_STEP_RUN(consensus, resume.part, budget, cairn_pose_consensus_find_support);
        keep_evaluation(consensus);
    }
    CAIRN_STEP_END(consensus->resume.part);
}

const cairn_pose_consensus_candidate *
cairn_pose_consensus_best_candidate(const cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_candidate *best = NULL;

    for (int32_t i = 0; i < consensus->choice.count; i++) {
        const cairn_pose_consensus_candidate *candidate = &consensus->candidates[i];

        if (candidate->support >= consensus->params.min_support &&
            (best == NULL || rank_of(candidate) > rank_of(best)))
            best = candidate;
    }
    return best;
}
