/* pose_consensus: the best map as the result: frames and order of its components, alternatives,
 * ambiguity. pose_consensus.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/ranked_list.h"
#include "src/poses/pose_consensus_work.h"

/* m and rad: farther poses count as another place, not as another estimate of the same place. */
static const cairn_real OTHER_PLACE_M = 1, OTHER_PLACE_RAD = CAIRN_REAL(0.5);

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

    if (!(consensus->result.competing_total > 0) || consensus->competing[node].component < 0 ||
        consensus->competing[node].component != consensus->competing[anchor].component)
        return 0;
    *pose = cairn_pose_consensus_compose(
        consensus->current[anchor].pose,
        cairn_pose_consensus_compose(
            cairn_pose_consensus_inverse(consensus->competing[anchor].pose),
            consensus->competing[node].pose));
    return !cairn_pose_consensus_is_same_pose(consensus, *pose, consensus->current[node].pose);
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
    list[0].map_node = cairn_pose_consensus_to_pose(pose);
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

static int32_t size_of_part(const cairn_pose_consensus *consensus, int32_t part)
{
    int32_t size = 0;

    for (int32_t i = 0; i < consensus->node_count; i++)
        size += consensus->current[i].component == part;
    return size;
}

/* Numbers the components by size, those of equal size by their first node, and unsupported nodes
 * behind them. */
static void number_parts(cairn_pose_consensus *consensus)
{
    for (int32_t i = 0; i < consensus->node_count; i++)
        consensus->nodes[i].component = -1;
    for (;;) {
        int32_t best = -1, size = 0;

        for (int32_t i = 0; i < consensus->node_count; i++) {
            int32_t here = consensus->nodes[i].component >= 0 ? 0
                           : consensus->current[i].component < 0
                               ? 1
                               : size_of_part(consensus, consensus->current[i].component);

            if (here > size) {
                best = i;
                size = here;
            }
        }
        if (best < 0)
            return;
        for (int32_t i = 0; i < consensus->node_count; i++)
            if (i == best ||
                (consensus->current[best].component >= 0 &&
                 consensus->current[i].component == consensus->current[best].component))
                consensus->nodes[i].component = consensus->result.components;
        consensus->result.components++;
        consensus->result.placed += consensus->current[best].component >= 0 ? size : 0;
    }
}

/* Returns the pose of the current map's frame in the result's, for a component. */
static cairn_pose frame_of(const cairn_pose_consensus *consensus, int32_t node)
{
    cairn_pose frame;

    if (consensus->bound_count == 0)
        return cairn_pose_inverse(cairn_pose_consensus_to_pose(
            consensus->current[first_of_part(consensus->current, node)].pose));
    (void)cairn_pose_consensus_within_bounds(consensus, consensus->current[node].component, -1,
                                             consensus->current[node].pose, &frame);
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
        cairn_pose_compose(frame, cairn_pose_consensus_to_pose(consensus->current[node].pose));
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
    cairn_pose_consensus_pose here = consensus->current[candidate->node].pose;
    cairn_real x = candidate->pose.transform.x - here.transform.x,
               y = candidate->pose.transform.y - here.transform.y;

    return consensus->params.significant_support > 0 &&
           cairn_pose_consensus_is_significant(consensus, candidate->support,
                                               candidate->violations) &&
           cairn_exp(-candidate->violations) >= consensus->params.min_ambiguous_weight &&
           (x * x + y * y > OTHER_PLACE_M * OTHER_PLACE_M ||
            cairn_abs(cairn_wrap_angle(candidate->pose.theta - here.theta)) > OTHER_PLACE_RAD);
}

/* Writes the result of the node whose alternatives have been searched. */
void cairn_pose_consensus_report_node(cairn_pose_consensus *consensus)
{
    cairn_pose_consensus_estimate *node = &consensus->nodes[consensus->subject];
    const cairn_pose_consensus_assignment *assignment = &consensus->current[consensus->subject];
    cairn_pose_consensus_competing_pose *list =
        &consensus->alternatives[consensus->subject * consensus->params.max_alternatives];
    ranked_list alternatives = {.entries = list,
                                .count = &node->alternatives,
                                .capacity = consensus->params.max_alternatives,
                                .entry_bytes = sizeof *list,
                                .score_at = offsetof(cairn_pose_consensus_competing_pose, support)};
    cairn_pose_consensus_support support = cairn_pose_consensus_support_of(
        consensus, consensus->subject, assignment->pose, assignment->component, 1);

    consensus->units_due += 2 * support.units;
    write_covariance(consensus, consensus->subject);
    node->support = support.sum;
    node->agreeing = support.agreeing;
    node->conflicting = support.conflicting;
    for (int32_t i = 0; i < consensus->candidate_count; i++) {
        cairn_pose_consensus_competing_pose alternative = {
            cairn_pose_consensus_to_pose(consensus->candidates[i].pose),
            consensus->candidates[i].support, 0, 0};

        node->ambiguous |= is_significant_elsewhere(consensus, &consensus->candidates[i]);
        if (!consensus->candidates[i].is_current && alternative.support > 0)
            (void)ranked_list_add(&alternatives, &alternative);
    }
}

/* Propagates ambiguity: a node is ambiguous when most of its support comes from ambiguous nodes.
 * Repeated until nothing changes. */
void cairn_pose_consensus_propagate_ambiguity_item(cairn_pose_consensus *consensus)
{
    int32_t node = consensus->next, link, units = 1;
    cairn_real all = 0, ambiguous_evidence = 0;

    consensus->units_due++;
    if (consensus->next == consensus->end) {
        cairn_pose_consensus_enter(consensus,
                                   consensus->changed_nodes > 0 ? POSE_CONSENSUS_PROPAGATE_AMBIGUITY
                                                                : POSE_CONSENSUS_IDLE,
                                   consensus->node_count);
        consensus->changed_nodes = 0;
        return;
    }
    consensus->next++;
    if (consensus->current[node].component < 0 || consensus->nodes[node].ambiguous)
        return;
    link = consensus->first_link[node];
    for (int32_t i = 0; i < consensus->node_count; i++)
        if (i != node && consensus->current[i].component == consensus->current[node].component) {
            cairn_real evidence = cairn_pose_consensus_pair_likelihood(
                consensus, node, consensus->current[node].pose, i, &link, &units);

            all += cairn_max(evidence, 0);
            ambiguous_evidence += consensus->nodes[i].ambiguous ? cairn_max(evidence, 0) : 0;
        }
    consensus->nodes[node].ambiguous = 2 * ambiguous_evidence > all;
    consensus->changed_nodes += consensus->nodes[node].ambiguous;
    consensus->result.ambiguous += consensus->nodes[node].ambiguous;
    consensus->units_due += units;
}

void cairn_pose_consensus_finish(cairn_pose_consensus *consensus)
{
    consensus->result.nodes = consensus->node_count;
    for (int32_t i = 0; i < consensus->node_count; i++) {
        if (consensus->current[i].component < 0) {
            consensus->nodes[i].map_node = consensus->bounds[i].centre;
            continue;
        }
        insert_competing(consensus, i);
        set_weights(consensus, i);
        move_into_frame(consensus, i);
        consensus->units_due += 4;
    }
    number_parts(consensus);
    consensus->units_due += consensus->node_count;
    for (int32_t h = 0; h < consensus->hypothesis_count; h++) {
        const cairn_pose_consensus_hypothesis *kept = &consensus->hypotheses[h];
        const cairn_pose_consensus_assignment *first = &consensus->current[kept->first],
                                              *second = &consensus->current[kept->second];

        consensus->result.inliers += first->component >= 0 &&
                                     first->component == second->component &&
                                     cairn_pose_consensus_chi2(kept, first->pose, second->pose,
                                                               NULL) < consensus->params.max_chi2;
    }
    consensus->units_due += consensus->hypothesis_count / 2;
}
