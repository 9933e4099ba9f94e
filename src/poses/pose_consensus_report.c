/* pose_consensus: the best map as the result: frames and order of its components, alternatives,
 * ambiguity. pose_consensus.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/ranked_list.h"
#include "src/poses/pose_consensus_work.h"

/* m and rad: farther poses count as another place, not as another estimate of the same place. */
static const cairn_real OTHER_PLACE_M = 1, OTHER_PLACE_RAD = CAIRN_REAL(0.5);

/* Sweeps of relaxation of the best map. Units of the alternatives and of the frame of a node. */
enum { SWEEPS_END = 10, FRAME_UNITS = 4 };

static int32_t first_of_part(const cairn_pose_consensus_assignment *assignment, int32_t node)
{
    int32_t first = 0;

    while (assignment[first].component != assignment[node].component)
        first++;
    return first;
}

/* Returns in *pose the node's pose in the competing map, in the frame of the current one: aligned
 * by the first node of its component that both have placed. 0 when the competing map has no other
 * pose. */
static int competing_pose(const cairn_pose_consensus *consensus, int32_t node,
                          cairn_pose_consensus_pose *pose)
{
    int32_t anchor = first_of_part(consensus->current, node);
    cairn_pose_consensus_pose inverse, between;

    if (!(consensus->result.competing_total > 0) || consensus->competing[node].component < 0 ||
        consensus->competing[node].component != consensus->competing[anchor].component)
        return 0;
    inverse = cairn_pose_consensus_inverse(&consensus->competing[anchor].pose);
    between = cairn_pose_consensus_compose(&inverse, &consensus->competing[node].pose);
    *pose = cairn_pose_consensus_compose(&consensus->current[anchor].pose, &between);
    return !cairn_pose_consensus_is_same_pose(consensus, pose, &consensus->current[node].pose);
}

/* Inserts the competing map's pose first, if alternatives are stored at all. */
static void insert_competing(cairn_pose_consensus *consensus, int32_t node)
{
    cairn_pose_consensus_competing_pose *list =
        &consensus->alternatives[node * consensus->params.max_alternatives];
    cairn_pose_consensus_pose pose;
    int32_t *count = &consensus->nodes[node].alternatives;

    if (consensus->params.max_alternatives == 0 || !competing_pose(consensus, node, &pose))
        return;
    if (*count == consensus->params.max_alternatives)
        (*count)--;
    memmove(&list[1], &list[0], (size_t)*count * sizeof *list);
    list[0].map_node = cairn_pose_consensus_to_pose(&pose);
    list[0].support = consensus->result.competing_total;
    list[0].is_other_map = 1;
    (*count)++;
}

/* Softmax weights by support (of the whole map for an alternative map), the greatest first. */
static void set_weights(cairn_pose_consensus *consensus, int32_t node)
{
    cairn_pose_consensus_competing_pose *list =
        &consensus->alternatives[node * consensus->params.max_alternatives];
    cairn_pose_consensus_estimate *chosen = &consensus->nodes[node];
    cairn_real sum = 1;

    for (int32_t i = 0; i < chosen->alternatives; i++) {
        list[i].weight = cairn_exp(cairn_min(
            list[i].support - (list[i].is_other_map ? consensus->result.total : chosen->support),
            0));
        sum += list[i].weight;
    }
    for (int32_t i = 0; i < chosen->alternatives; i++)
        list[i].weight /= sum;
    if (chosen->alternatives > 1 && list[0].weight < list[1].weight) {
        cairn_pose_consensus_competing_pose other_map = list[0];
        int32_t at = 0;

        for (; at + 1 < chosen->alternatives && list[at + 1].weight > other_map.weight; at++)
            list[at] = list[at + 1];
        list[at] = other_map;
    }
    chosen->ambiguous |=
        chosen->alternatives > 0 && list[0].weight >= consensus->params.min_ambiguous_weight;
    consensus->result.ambiguous += chosen->ambiguous;
}

/* Takes all numbers from the components, and counts their nodes in next_free. */
static void count_parts(cairn_pose_consensus *consensus)
{
    memset(consensus->next_free, 0, (size_t)consensus->node_count * sizeof *consensus->next_free);
    for (int32_t i = 0; i < consensus->node_count; i++) {
        consensus->nodes[i].component = -1;
        if (consensus->current[i].component >= 0)
            consensus->next_free[consensus->current[i].component]++;
    }
}

/* Numbers the largest component of several nodes that has no number, of equal ones that of the
 * first node. Returns 0 when there is none. */
static int32_t number_part(cairn_pose_consensus *consensus)
{
    int32_t part = -1, size = 1;

    for (int32_t i = 0; i < consensus->node_count; i++) {
        int32_t own = consensus->current[i].component;

        if (own >= 0 && consensus->nodes[i].component < 0 && consensus->next_free[own] > size) {
            part = own;
            size = consensus->next_free[own];
        }
    }
    if (part < 0)
        return 0;
    for (int32_t i = 0; i < consensus->node_count; i++)
        if (consensus->current[i].component == part)
            consensus->nodes[i].component = consensus->result.components;
    consensus->result.components++;
    consensus->result.placed += size;
    return 1;
}

/* Numbers the nodes that are alone. */
static void number_single_nodes(cairn_pose_consensus *consensus)
{
    for (int32_t i = 0; i < consensus->node_count; i++)
        if (consensus->nodes[i].component < 0) {
            consensus->nodes[i].component = consensus->result.components++;
            consensus->result.placed += consensus->current[i].component >= 0;
        }
}

/* Returns the pose of the current map's frame in the result's, for a component. */
static cairn_pose frame_of(const cairn_pose_consensus *consensus, int32_t node)
{
    cairn_pose frame;

    if (consensus->bound_count == 0)
        return cairn_pose_inverse(cairn_pose_consensus_to_pose(
            &consensus->current[first_of_part(consensus->current, node)].pose));
    (void)cairn_pose_consensus_within_bounds(consensus, consensus->current[node].component, -1,
                                             NULL, &frame);
    return frame;
}

static void rotate_covariance(cairn_real covariance[9], cairn_pose frame)
{
    cairn_sym3_to_full(cairn_sym3_rotate_by(cairn_sym3_of_full(covariance), frame.theta),
                       covariance);
}

static void move_into_frame(cairn_pose_consensus *consensus, int32_t node)
{
    cairn_pose_consensus_competing_pose *list =
        &consensus->alternatives[node * consensus->params.max_alternatives];
    cairn_pose frame = frame_of(consensus, node);

    consensus->nodes[node].map_node =
        cairn_pose_compose(frame, cairn_pose_consensus_to_pose(&consensus->current[node].pose));
    rotate_covariance(consensus->nodes[node].covariance, frame);
    for (int32_t i = 0; i < consensus->nodes[node].alternatives; i++)
        list[i].map_node = cairn_pose_compose(frame, list[i].map_node);
}

/* Writes the covariance of a node, in the frame of the current map. */
static void write_covariance(cairn_pose_consensus *consensus, int32_t node)
{
    cairn_real gradient[3];
    cairn_sym3 inverse = cairn_sym3_zero();

    (void)cairn_sym3_inverse(cairn_pose_consensus_information(consensus, node, gradient), &inverse);
    cairn_sym3_to_full(inverse, consensus->nodes[node].covariance);
}

/* Returns 1 when a candidate is at another place and significant there by itself. */
static int is_significant_elsewhere(const cairn_pose_consensus *consensus,
                                    const cairn_pose_consensus_candidate *candidate)
{
    const cairn_pose_consensus_pose *here = &consensus->current[candidate->node].pose;
    cairn_real x = candidate->pose.transform.x - here->transform.x,
               y = candidate->pose.transform.y - here->transform.y;

    return consensus->params.significant_support > 0 &&
           candidate->support - candidate->violations >= consensus->params.significant_support &&
           cairn_exp(-candidate->violations) >= consensus->params.min_ambiguous_weight &&
           (x * x + y * y > OTHER_PLACE_M * OTHER_PLACE_M ||
            cairn_abs(cairn_wrap_angle(candidate->pose.theta - here->theta)) > OTHER_PLACE_RAD);
}

/* Writes the result of a node whose alternatives and support have been found. */
static void report_node(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_support *support = &consensus->query.found;
    int32_t subject = consensus->node;
    cairn_pose_consensus_estimate *node = &consensus->nodes[subject];
    cairn_pose_consensus_competing_pose *list =
        &consensus->alternatives[subject * consensus->params.max_alternatives];
    ranked_list alternatives = {.entries = list,
                                .count = &node->alternatives,
                                .capacity = consensus->params.max_alternatives,
                                .entry_bytes = sizeof *list,
                                .score_at = offsetof(cairn_pose_consensus_competing_pose, support)};

    write_covariance(consensus, subject);
    node->support = support->sum;
    node->agreeing = support->agreeing;
    node->conflicting = support->conflicting;
    for (int32_t i = 0; i < consensus->choice.count; i++) {
        cairn_pose_consensus_competing_pose alternative = {
            cairn_pose_consensus_to_pose(&consensus->candidates[i].pose),
            consensus->candidates[i].support, 0, 0};

        node->ambiguous |= is_significant_elsewhere(consensus, &consensus->candidates[i]);
        if (!consensus->candidates[i].is_current && alternative.support > 0)
            (void)ranked_list_add(&alternatives, &alternative);
    }
}

/* Moves a node into the frame of the result. */
static void finish_node(cairn_pose_consensus *consensus, int32_t node)
{
    if (consensus->current[node].component < 0) {
        consensus->nodes[node].map_node = consensus->bounds[node].centre;
        return;
    }
    insert_competing(consensus, node);
    set_weights(consensus, node);
    move_into_frame(consensus, node);
}

/* Units of a node's end: its alternatives, and the first node and the frame of its component. */
static int32_t finish_units(const cairn_pose_consensus *consensus)
{
    return FRAME_UNITS + cairn_pose_consensus_node_units(consensus) +
           cairn_pose_consensus_bound_units(consensus);
}

int cairn_pose_consensus_report(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(consensus->resume.phase);
    CAIRN_STEP_CHARGE(consensus, resume.phase, budget, cairn_pose_consensus_copy_units(consensus));
    memcpy(consensus->current, consensus->best,
           (size_t)consensus->node_count * sizeof *consensus->current);
    consensus->sweeps = SWEEPS_END;
    CAIRN_STEP_RUN(consensus, resume.phase, budget, cairn_pose_consensus_relax);
    for (consensus->node = 0; consensus->node < consensus->node_count; consensus->node++) {
        CAIRN_STEP_CHARGE_UNIT(consensus, resume.phase, budget);
        if (consensus->current[consensus->node].component < 0)
            continue;
        cairn_pose_consensus_set_choice(consensus, POSE_CONSENSUS_ALTERNATIVES, consensus->node);
        CAIRN_STEP_RUN(consensus, resume.phase, budget, cairn_pose_consensus_find_candidates);
        cairn_pose_consensus_query_current(consensus, consensus->node, POSE_CONSENSUS_BY_ALL);
        CAIRN_STEP_RUN(consensus, resume.phase, budget, cairn_pose_consensus_find_support);
        CAIRN_STEP_CHARGE(consensus, resume.phase, budget,
                          cairn_pose_consensus_link_units(consensus, consensus->node));
        report_node(consensus);
    }
    for (consensus->node = 0; consensus->node < consensus->node_count; consensus->node++) {
        CAIRN_STEP_CHARGE(consensus, resume.phase, budget, finish_units(consensus));
        finish_node(consensus, consensus->node);
    }
    CAIRN_STEP_CHARGE(consensus, resume.phase, budget, cairn_pose_consensus_copy_units(consensus));
    count_parts(consensus);
    do
        CAIRN_STEP_CHARGE(consensus, resume.phase, budget,
                          cairn_pose_consensus_copy_units(consensus));
    while (number_part(consensus));
    number_single_nodes(consensus);
    CAIRN_STEP_RUN(consensus, resume.phase, budget, cairn_pose_consensus_find_inliers);
    consensus->result.nodes = consensus->node_count;
    CAIRN_STEP_END(consensus->resume.phase);
}

/* ---- Ambiguity ---- */

/* Marks the node when most of its support comes from ambiguous nodes. */
static void mark_ambiguous(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_support *support = &consensus->query.found;
    cairn_pose_consensus_estimate *node = &consensus->nodes[consensus->node];

    node->ambiguous = 2 * support->ambiguous > support->positive;
    consensus->changed_nodes += node->ambiguous;
    consensus->result.ambiguous += node->ambiguous;
}

/* Repeated until nothing changes. */
int cairn_pose_consensus_propagate_ambiguity(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(consensus->resume.phase);
    do {
        consensus->changed_nodes = 0;
        for (consensus->node = 0; consensus->node < consensus->node_count; consensus->node++) {
            CAIRN_STEP_CHARGE_UNIT(consensus, resume.phase, budget);
            if (consensus->current[consensus->node].component < 0 ||
                consensus->nodes[consensus->node].ambiguous)
                continue;
            cairn_pose_consensus_query_current(consensus, consensus->node, POSE_CONSENSUS_BY_PAIRS);
            CAIRN_STEP_RUN(consensus, resume.phase, budget, cairn_pose_consensus_find_support);
            mark_ambiguous(consensus);
        }
    } while (consensus->changed_nodes > 0);
    CAIRN_STEP_END(consensus->resume.phase);
}
