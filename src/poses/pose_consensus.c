/* pose_consensus: consensus over competing relative poses; the object, its hypotheses and links.
 *
 * Method: an inlier hypothesis earns its score times 1 - chi^2 / max_chi2; a pair earns the best of
 * its hypotheses. The support of a node is the sum over the pairs with the placed nodes of its
 * component; the total of a map is the sum over all pairs.
 * 1. Cycle consistency: each hypothesis gets a score from the agreeing cycles through third nodes.
 *    With few nodes placed, it separates true hypotheses from strong wrong ones.
 * 2. Greedy growth from one seed: the candidate of the greatest support and cycle score is placed.
 *    After each placement the poses are relaxed node by node (Gauss-Seidel), so that errors do not
 *    accumulate along chains.
 * 3. Components that single nodes could not join are merged as wholes.
 * 4. Every node is reassigned given all others (iterated conditional modes, Besag 1986) until
 *    nothing changes.
 * 5. Seeds: the next growth starts from the strongest hypothesis that no map found so far agrees
 *    with; the total decides between the maps.
 * 6. Block moves: the best map is cut at every edge of its maximum spanning tree, and the smaller
 *    side is moved to its best supported pose (pose_consensus_block.c). Nodes that support each
 *    other never move alone.
 *
 * Layout: hypotheses in the order of add(); links sorted by node, other node and hypothesis, so
 * that the links of a node are contiguous, and those of a pair within them. They are sorted by
 * distribution counting, twice. Three maps: the growing one, the best, and the best competing one.
 * Limits: the total has many local maxima and the search is greedy. A map is found when from one of
 * the seeds every step finds more support for the true candidate than for false ones. The caller
 * must ensure that the scores of several pairs are independent: weights are as good as the scores.
 * Source: after the pairwise consistent measurement sets of Mangelson et al. 2018 and the growth by
 * voting of map merging (Adluru 2008, chapter 9), with competing hypotheses of one pair. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/counting_sort.h"
#include "src/poses/pose_consensus_work.h"

enum { MAX_NODES = 1 << 16, MAX_HYPOTHESES = 1 << 20, MAX_LISTED = 32 };

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_pose_consensus_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_pose_consensus_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_pose_consensus_params, field, __VA_ARGS__)
#define BETWEEN(field, ...)  CAIRN_NUMBER_BETWEEN(cairn_pose_consensus_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_nodes, 64, 1, MAX_NODES),
    INTEGER(max_hypotheses, 1024, 1, MAX_HYPOTHESES),
    INTEGER(max_starts, 16, 1, INT32_MAX),
    INTEGER(max_rounds, 10, 0, INT32_MAX),
    INTEGER(max_candidates, 8, 1, MAX_LISTED),
    INTEGER(max_alternatives, 4, 0, MAX_LISTED),
    POSITIVE(sigma, CAIRN_REAL(0.03), 0, CAIRN_MAX_MAGNITUDE),
    POSITIVE(sigma_theta, CAIRN_PI / 300, 0, CAIRN_MAX_MAGNITUDE),
    POSITIVE(max_chi2, 16, 0, CAIRN_MAX_MAGNITUDE),
    NUMBER(conflict_penalty, 0, 0, CAIRN_MAX_MAGNITUDE),
    POSITIVE(min_support, 3, 0, CAIRN_MAX_MAGNITUDE),
    BETWEEN(min_ambiguous_weight, CAIRN_REAL(0.02), 0, 1),
    NUMBER(significant_support, 0, 0, CAIRN_MAX_MAGNITUDE),
};
const cairn_parameters cairn_pose_consensus_parameters =
    CAIRN_PARAMETERS("pose_consensus", cairn_pose_consensus_params, rows);

cairn_pose_consensus_params cairn_pose_consensus_default(void)
{
    cairn_pose_consensus_params params;

    cairn_parameters_preset(&cairn_pose_consensus_parameters, &params);
    return params;
}

cairn_status cairn_pose_consensus_check(const cairn_pose_consensus_params *params,
                                        cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_pose_consensus_parameters, params, fault);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_pose_consensus *build(cairn_pool *pool, const cairn_pose_consensus_params *params)
{
    size_t nodes = (size_t)params->max_nodes, hypotheses = (size_t)params->max_hypotheses;
    cairn_pose_consensus *consensus = cairn_object_take(pool, sizeof *consensus);

    CAIRN_TAKE(consensus, pool, hypotheses, hypotheses);
    CAIRN_TAKE(consensus, pool, links, 2 * hypotheses);
    CAIRN_TAKE(consensus, pool, first_link, nodes + 1);
    CAIRN_TAKE(consensus, pool, next_free, nodes);
    CAIRN_TAKE(consensus, pool, bounds, nodes);
    CAIRN_TAKE(consensus, pool, current, nodes);
    CAIRN_TAKE(consensus, pool, best, nodes);
    CAIRN_TAKE(consensus, pool, competing, nodes);
    CAIRN_TAKE(consensus, pool, tree, nodes);
    CAIRN_TAKE(consensus, pool, nodes, nodes);
    CAIRN_TAKE(consensus, pool, alternatives, nodes * (size_t)params->max_alternatives);
    CAIRN_TAKE(consensus, pool, joint_poses, nodes);
    CAIRN_TAKE(consensus, pool, joint_components, nodes);
    CAIRN_TAKE(consensus, pool, candidates, params->max_candidates);
    if (consensus != NULL)
        consensus->params = *params;
    return consensus;
}

CAIRN_OBJECT(pose_consensus, pose_consensus, build);

/* Starts a task in place of the one that is under way. */
static void begin_task(cairn_pose_consensus *consensus, pose_consensus_task task)
{
    consensus->task = task;
    consensus->units_charged = 0;
    memset(&consensus->resume, 0, sizeof consensus->resume);
    memset(&consensus->likelihood, 0, sizeof consensus->likelihood);
}

/* Discards the result and cancels the search. */
static void cancel(cairn_pose_consensus *consensus)
{
    begin_task(consensus, POSE_CONSENSUS_IDLE);
    memset(&consensus->result, 0, sizeof consensus->result);
}

cairn_status cairn_pose_consensus_clear(cairn_pose_consensus *consensus, int32_t nodes)
{
    if (consensus == NULL || nodes < 1)
        return CAIRN_BAD_ARGUMENT;
    if (nodes > consensus->params.max_nodes)
        return CAIRN_FULL;
    cancel(consensus);
    consensus->node_count = nodes;
    consensus->hypothesis_count = consensus->bound_count = 0;
    consensus->pair_likelihood = NULL;
    consensus->joint_likelihood = NULL;
    memset(consensus->bounds, 0, (size_t)nodes * sizeof *consensus->bounds);
    return CAIRN_OK;
}

/* 1 for a positive number within the limit. */
static int is_positive(cairn_real x)
{
    return x > 0 && x <= CAIRN_MAX_MAGNITUDE;
}

static cairn_status check_hypothesis(const cairn_pose_consensus *consensus,
                                     const cairn_pose_consensus_relative_pose *h,
                                     cairn_fault *fault)
{
    if (h->first < 0 || h->second < 0 || h->first >= consensus->node_count ||
        h->second >= consensus->node_count || h->first == h->second)
        return cairn_refuse(fault, -1, "the hypothesis is not about two of the nodes",
                            CAIRN_BAD_ARGUMENT);
    if (!cairn_pose_is_finite(h->first_second))
        return cairn_refuse(fault, -1, "the relative pose is not finite", CAIRN_NOT_FINITE);
    for (int k = 0; k < 9; k++)
        if (!cairn_is_finite(h->covariance[k]))
            return cairn_refuse(fault, -1, "the covariance is not finite", CAIRN_NOT_FINITE);
    if (!is_positive(h->score) || !cairn_pose_is_within(h->first_second, CAIRN_MAX_MAGNITUDE))
        return cairn_refuse(fault, -1, "the score must be positive, and score and pose at most 1e6",
                            CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

/* Returns the information: inverse of the covariance plus the nodes' model noise; 0 when it is
 * singular. */
static int32_t information_of(const cairn_pose_consensus_params *params,
                              const cairn_pose_consensus_relative_pose *pose,
                              cairn_sym3 *information)
{
    const cairn_real *c = pose->covariance;
    cairn_real x = pose->first_second.x, y = pose->first_second.y,
               turn = params->sigma_theta * params->sigma_theta;
    cairn_real shift = params->sigma * params->sigma + turn * (x * x + y * y);
    cairn_sym3 sum = {c[0] + shift, (c[1] + c[3]) / 2, (c[2] + c[6]) / 2,
                      c[4] + shift, (c[5] + c[7]) / 2, c[8] + turn};

    return c[0] <= CAIRN_MAX_MAGNITUDE && c[4] <= CAIRN_MAX_MAGNITUDE &&
           c[8] <= CAIRN_MAX_MAGNITUDE && cairn_sym3_inverse(sum, information);
}

cairn_status cairn_pose_consensus_add(cairn_pose_consensus *consensus,
                                      const cairn_pose_consensus_relative_pose *hypothesis,
                                      cairn_fault *fault)
{
    cairn_pose_consensus_hypothesis kept;
    cairn_status status;

    if (consensus == NULL || hypothesis == NULL)
        return cairn_refuse(fault, -1, "no object or no hypothesis", CAIRN_BAD_ARGUMENT);
    status = check_hypothesis(consensus, hypothesis, fault);
    if (status != CAIRN_OK)
        return status;
    if (!information_of(&consensus->params, hypothesis, &kept.information))
        return cairn_refuse(fault, -1, "the covariance is not positive, or above 1e6",
                            CAIRN_BAD_ARGUMENT);
    if (consensus->hypothesis_count == consensus->params.max_hypotheses)
        return cairn_refuse(fault, -1, "more hypotheses than max_hypotheses", CAIRN_FULL);
    kept.first = hypothesis->first;
    kept.second = hypothesis->second;
    kept.first_second = cairn_pose_consensus_pose_of(hypothesis->first_second);
    kept.second_first = cairn_pose_consensus_inverse(&kept.first_second);
    kept.score = hypothesis->score;
    kept.cycle_score = 0;
    kept.is_explained = 0;
    consensus->hypotheses[consensus->hypothesis_count++] = kept;
    cancel(consensus);
    return CAIRN_OK;
}

cairn_status cairn_pose_consensus_set_bound(cairn_pose_consensus *consensus, int32_t node,
                                            cairn_pose map_node, cairn_real metres,
                                            cairn_real radians)
{
    cairn_pose_consensus_bound bound = {map_node, metres, radians};

    if (consensus == NULL || node < 0 || node >= consensus->node_count)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pose_is_finite(map_node) || !cairn_is_finite(metres) || !cairn_is_finite(radians))
        return CAIRN_NOT_FINITE;
    if (!is_positive(metres) || !is_positive(radians) ||
        !cairn_pose_is_within(map_node, CAIRN_MAX_MAGNITUDE))
        return CAIRN_BAD_ARGUMENT;
    consensus->bound_count += !(consensus->bounds[node].metres > 0);
    consensus->bounds[node] = bound;
    cancel(consensus);
    return CAIRN_OK;
}

void cairn_pose_consensus_set_pair_likelihood(cairn_pose_consensus *consensus,
                                              cairn_pose_pair_likelihood likelihood, void *context)
{
    consensus->pair_likelihood = likelihood;
    consensus->pair_context = context;
    cancel(consensus);
}

void cairn_pose_consensus_set_joint_likelihood(cairn_pose_consensus *consensus,
                                               cairn_pose_joint_likelihood likelihood,
                                               void *context)
{
    consensus->joint_likelihood = likelihood;
    consensus->joint_context = context;
    cancel(consensus);
}

/* ---- Links ---- */

/* Node of a hypothesis that is not `node`. */
static int32_t other_node(const cairn_pose_consensus *consensus, int32_t hypothesis, int32_t node)
{
    const cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[hypothesis];

    return h->first + h->second - node;
}

/* Hypotheses sorted by node, in the links' `hypothesis`; the first link of each node. */
static void sort_by_node(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_hypothesis *h = consensus->hypotheses;
    cairn_pose_consensus_link *links = consensus->links;
    int32_t *first = consensus->first_link, end = consensus->node_count + 1;

    counting_sort_reset(first, 0, end);
    for (int32_t i = 0; i < consensus->hypothesis_count; i++) {
        counting_sort_count(first, h[i].first);
        counting_sort_count(first, h[i].second);
    }
    counting_sort_sum(first, 0, end);
    for (int32_t i = consensus->hypothesis_count - 1; i >= 0; i--) {
        links[counting_sort_place(first, h[i].first)].hypothesis = i;
        links[counting_sort_place(first, h[i].second)].hypothesis = i;
    }
}

/* Sorts the hypotheses of each node by the other node: they are visited in the order of that one,
 * from the last to the first, and written to `other`, which is free until all are sorted. */
static void build_links(cairn_pose_consensus *consensus)
{
    cairn_pose_consensus_link *links = consensus->links;
    const int32_t *first = consensus->first_link;

    sort_by_node(consensus);
    memcpy(consensus->next_free, first + 1, (size_t)consensus->node_count * sizeof *first);
    for (int32_t node = consensus->node_count - 1; node >= 0; node--)
        for (int32_t k = first[node + 1] - 1; k >= first[node]; k--) {
            int32_t i = links[k].hypothesis, other = other_node(consensus, i, node);

            links[counting_sort_place(consensus->next_free, other)].other = i;
        }
    for (int32_t node = 0; node < consensus->node_count; node++)
        for (int32_t k = first[node]; k < first[node + 1]; k++) {
            links[k].hypothesis = links[k].other;
            links[k].other = other_node(consensus, links[k].hypothesis, node);
        }
}

cairn_status cairn_pose_consensus_begin(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_assignment unplaced = {{{0, 0, 1, 0}, 0}, -1, -1};

    if (consensus == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (consensus->node_count == 0)
        return CAIRN_EMPTY;
    cancel(consensus);
    build_links(consensus);
    memset(consensus->nodes, 0, (size_t)consensus->node_count * sizeof *consensus->nodes);
    for (int32_t i = 0; i < consensus->node_count; i++) {
        consensus->current[i] = consensus->best[i] = consensus->competing[i] = unplaced;
        consensus->nodes[i].link_support = CAIRN_REAL_MAX;
    }
    for (int32_t i = 0; i < consensus->hypothesis_count; i++)
        consensus->hypotheses[i].is_explained = 0;
    consensus->block_passes = 0;
    consensus->block.has_link_support = 0;
    begin_task(consensus, POSE_CONSENSUS_SEARCH);
    return CAIRN_OK;
}

static int has_result(const cairn_pose_consensus *consensus)
{
    return consensus->task == POSE_CONSENSUS_IDLE && consensus->result.nodes > 0;
}

cairn_status cairn_pose_consensus_find_submaps(cairn_pose_consensus *consensus)
{
    if (consensus == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!has_result(consensus))
        return CAIRN_EMPTY;
    if (!(consensus->params.significant_support > 0))
        return CAIRN_OK;
    begin_task(consensus, POSE_CONSENSUS_SUBMAPS);
    return CAIRN_OK;
}

/* Continues the task; 0 when the budget is used up. */
static int run_task(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    return consensus->task == POSE_CONSENSUS_SUBMAPS
               ? cairn_pose_consensus_search_submaps(consensus, budget)
               : cairn_pose_consensus_search(consensus, budget);
}

cairn_status cairn_pose_consensus_step(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    int32_t before;
    int is_done;

    if (consensus == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (consensus->task == POSE_CONSENSUS_IDLE)
        return CAIRN_OK;
    if (budget->left <= 0)
        return CAIRN_MORE;
    before = budget->left;
    is_done = run_task(consensus, budget);
    consensus->result.units += before - budget->left;
    if (!is_done)
        return CAIRN_MORE;
    consensus->task = POSE_CONSENSUS_IDLE;
    return CAIRN_OK;
}

/* ---- Results ---- */

cairn_pose_consensus_result cairn_pose_consensus_read(const cairn_pose_consensus *consensus)
{
    cairn_pose_consensus_result none;

    memset(&none, 0, sizeof none);
    return has_result(consensus) ? consensus->result : none;
}

cairn_pose_consensus_estimate cairn_pose_consensus_node(const cairn_pose_consensus *consensus,
                                                        int32_t node)
{
    cairn_pose_consensus_estimate none;

    memset(&none, 0, sizeof none);
    return has_result(consensus) && node >= 0 && node < consensus->node_count
               ? consensus->nodes[node]
               : none;
}

cairn_pose_consensus_competing_pose
cairn_pose_consensus_alternative(const cairn_pose_consensus *consensus, int32_t node, int32_t index)
{
    cairn_pose_consensus_competing_pose none;

    memset(&none, 0, sizeof none);
    if (index < 0 || index >= cairn_pose_consensus_node(consensus, node).alternatives)
        return none;
    return consensus->alternatives[node * consensus->params.max_alternatives + index];
}

int32_t cairn_pose_consensus_is_inlier(const cairn_pose_consensus *consensus, int32_t hypothesis)
{
    const cairn_pose_consensus_hypothesis *h;
    const cairn_pose_consensus_estimate *first, *second;
    cairn_pose_consensus_pose poses[2];

    if (!has_result(consensus) || hypothesis < 0 || hypothesis >= consensus->hypothesis_count)
        return 0;
    h = &consensus->hypotheses[hypothesis];
    first = &consensus->nodes[h->first];
    second = &consensus->nodes[h->second];
    poses[0] = cairn_pose_consensus_pose_of(first->map_node);
    poses[1] = cairn_pose_consensus_pose_of(second->map_node);
    return first->component == second->component &&
           cairn_pose_consensus_chi2(h, &poses[0], &poses[1], NULL) < consensus->params.max_chi2;
}
