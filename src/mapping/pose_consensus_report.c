/* pose_consensus: the best map as the result: frames of its parts, their order, and what other
 * maps say. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/pose_consensus_work.h"

/* m and rad: what is nearer is the same place, if not the same pose. */
static const cairn_real ELSEWHERE = 1, ELSEWHERE_ANGLE = CAIRN_REAL(0.5);

static int32_t first_of_part(const cairn_chart_node *chart, int32_t node)
{
    int32_t first = 0;

    while (chart[first].part != chart[node].part)
        first++;
    return first;
}

/* Where the rival map has a node, in the frame of the chart: laid onto it by the first node of
 * the node's part that both have placed. 0 when the rival says nothing else. */
static int rival_pose(const cairn_pose_consensus *c, int32_t node, cairn_turned_pose *pose)
{
    int32_t anchor = first_of_part(c->chart, node);

    if (!(c->result.rival > 0) || c->rival[node].part < 0 ||
        c->rival[node].part != c->rival[anchor].part)
        return 0;
    *pose = cairn_turned_compose(
        c->chart[anchor].pose,
        cairn_turned_compose(cairn_turned_inverse(c->rival[anchor].pose), c->rival[node].pose));
    return !cairn_consensus_same(c, *pose, c->chart[node].pose);
}

/* Puts the rival's pose first, where alternatives are kept at all. */
static void add_rival(cairn_pose_consensus *c, int32_t node)
{
    cairn_consensus_alternative *list = &c->alternatives[node * c->params.max_alternatives];
    cairn_turned_pose pose;
    int32_t *count = &c->nodes[node].alternatives;

    if (c->params.max_alternatives == 0 || !rival_pose(c, node, &pose))
        return;
    if (*count == c->params.max_alternatives)
        (*count)--;
    memmove(&list[1], &list[0], (size_t)*count * sizeof *list);
    list[0].map_node = cairn_turned_pose_of(pose);
    list[0].support = c->result.rival;
    list[0].whole = 1;
    (*count)++;
}

/* Weights by support (of the whole map where another map is the alternative), heaviest first. */
static void weigh(cairn_pose_consensus *c, int32_t node)
{
    cairn_consensus_alternative *list = &c->alternatives[node * c->params.max_alternatives];
    cairn_consensus_node *chosen = &c->nodes[node];
    cairn_real sum = 1;

    for (int32_t i = 0; i < chosen->alternatives; i++) {
        list[i].weight = cairn_exp(
            cairn_min(list[i].support - (list[i].whole ? c->result.total : chosen->support), 0));
        sum += list[i].weight;
    }
    for (int32_t i = 0; i < chosen->alternatives; i++)
        list[i].weight /= sum;
    if (chosen->alternatives > 1 && list[0].weight < list[1].weight) {
        cairn_consensus_alternative rival = list[0];
        int32_t at = 0;

        for (; at + 1 < chosen->alternatives && list[at + 1].weight > rival.weight; at++)
            list[at] = list[at + 1];
        list[at] = rival;
    }
    chosen->ambiguous |= chosen->alternatives > 0 && list[0].weight >= c->params.ambiguous;
    c->result.ambiguous += chosen->ambiguous;
}

static int32_t size_of_part(const cairn_pose_consensus *c, int32_t part)
{
    int32_t size = 0;

    for (int32_t i = 0; i < c->node_count; i++)
        size += c->chart[i].part == part;
    return size;
}

/* Numbers the parts by size, those of equal size by their first node, and nodes that nothing
 * supports behind them. */
static void number_parts(cairn_pose_consensus *c)
{
    for (int32_t i = 0; i < c->node_count; i++)
        c->nodes[i].part = -1;
    for (;;) {
        int32_t best = -1, size = 0;

        for (int32_t i = 0; i < c->node_count; i++) {
            int32_t here = c->nodes[i].part >= 0  ? 0
                           : c->chart[i].part < 0 ? 1
                                                  : size_of_part(c, c->chart[i].part);

            if (here > size) {
                best = i;
                size = here;
            }
        }
        if (best < 0)
            return;
        for (int32_t i = 0; i < c->node_count; i++)
            if (i == best || (c->chart[best].part >= 0 && c->chart[i].part == c->chart[best].part))
                c->nodes[i].part = c->result.parts;
        c->result.parts++;
        c->result.placed += c->chart[best].part >= 0 ? size : 0;
    }
}

/* From the frame of a part in the chart to that of the result. */
static cairn_pose frame_of(const cairn_pose_consensus *c, int32_t node)
{
    cairn_pose frame;

    if (c->bound_count == 0)
        return cairn_pose_inverse(
            cairn_turned_pose_of(c->chart[first_of_part(c->chart, node)].pose));
    (void)cairn_consensus_within_bounds(c, c->chart[node].part, -1, c->chart[node].pose, &frame);
    return frame;
}

/* R C R^T */
static void turn_covariance(cairn_real covariance[9], cairn_pose frame)
{
    cairn_transform t = cairn_transform_of(frame);
    cairn_real c = t.cosine, s = t.sine, xx = covariance[0], xy = covariance[1], yy = covariance[4];
    cairn_vec2 angle = {covariance[2], covariance[5]};

    angle = cairn_transform_direction(t, angle);
    covariance[0] = c * c * xx - 2 * c * s * xy + s * s * yy;
    covariance[4] = s * s * xx + 2 * c * s * xy + c * c * yy;
    covariance[1] = covariance[3] = c * s * (xx - yy) + (c * c - s * s) * xy;
    covariance[2] = covariance[6] = angle.x;
    covariance[5] = covariance[7] = angle.y;
}

static void move_into_frame(cairn_pose_consensus *c, int32_t node)
{
    cairn_consensus_alternative *list = &c->alternatives[node * c->params.max_alternatives];
    cairn_pose frame = frame_of(c, node);

    c->nodes[node].map_node = cairn_pose_compose(frame, cairn_turned_pose_of(c->chart[node].pose));
    turn_covariance(c->nodes[node].covariance, frame);
    for (int32_t i = 0; i < c->nodes[node].alternatives; i++)
        list[i].map_node = cairn_pose_compose(frame, list[i].map_node);
}

/* In the frame of the chart. */
static void write_covariance(cairn_pose_consensus *c, int32_t node)
{
    cairn_real gradient[3], *covariance = c->nodes[node].covariance;
    cairn_sym3 inverse = cairn_sym3_zero();

    (void)cairn_sym3_inverse(cairn_consensus_information(c, node, gradient), &inverse);
    covariance[0] = inverse.xx;
    covariance[1] = covariance[3] = inverse.xy;
    covariance[2] = covariance[6] = inverse.xz;
    covariance[4] = inverse.yy;
    covariance[5] = covariance[7] = inverse.yz;
    covariance[8] = inverse.zz;
}

/* 1 when a candidate lies elsewhere and would be believed there, were nothing known of where its
 * node lies. */
static int is_believed(const cairn_pose_consensus *c, const cairn_candidate *candidate)
{
    cairn_turned_pose here = c->chart[candidate->node].pose;
    cairn_real x = candidate->pose.transform.x - here.transform.x,
               y = candidate->pose.transform.y - here.transform.y;

    return c->params.believed > 0 &&
           cairn_consensus_is_believed(c, candidate->support, candidate->against) &&
           cairn_exp(-candidate->against) >= c->params.ambiguous &&
           (x * x + y * y > ELSEWHERE * ELSEWHERE ||
            cairn_abs(cairn_wrap_angle(candidate->pose.theta - here.theta)) > ELSEWHERE_ANGLE);
}

/* Writes down the node whose alternatives have been searched. */
void cairn_consensus_report_node(cairn_pose_consensus *c)
{
    cairn_consensus_node *node = &c->nodes[c->subject];
    const cairn_chart_node *chart = &c->chart[c->subject];
    cairn_consensus_alternative *list = &c->alternatives[c->subject * c->params.max_alternatives];
    cairn_consensus_support support =
        cairn_consensus_support_of(c, c->subject, chart->pose, chart->part, 1);

    c->debt += 2 * support.units;
    write_covariance(c, c->subject);
    node->support = support.sum;
    node->agreeing = support.agreeing;
    node->contradicting = support.contradicting;
    for (int32_t i = 0; i < c->candidate_count; i++) {
        cairn_consensus_alternative alternative = {cairn_turned_pose_of(c->candidates[i].pose),
                                                   c->candidates[i].support, 0, 0};
        int32_t at = node->alternatives;

        node->ambiguous |= is_believed(c, &c->candidates[i]);
        if (c->candidates[i].current || !(alternative.support > 0))
            continue;
        while (at > 0 && list[at - 1].support < alternative.support)
            at--;
        if (at == c->params.max_alternatives)
            continue;
        if (node->alternatives == c->params.max_alternatives)
            node->alternatives--;
        memmove(&list[at + 1], &list[at], (size_t)(node->alternatives - at) * sizeof *list);
        list[at] = alternative;
        node->alternatives++;
    }
}

/* A node is as doubtful as what most of its evidence is about. Done again until nothing changes. */
void cairn_consensus_spread_item(cairn_pose_consensus *c)
{
    int32_t node = c->next, link, units = 1;
    cairn_real all = 0, doubtful = 0;

    c->debt++;
    if (c->next == c->end) {
        cairn_consensus_enter(c, c->changed > 0 ? CAIRN_CONSENSUS_SPREAD : CAIRN_CONSENSUS_IDLE,
                              c->node_count);
        c->changed = 0;
        return;
    }
    c->next++;
    if (c->chart[node].part < 0 || c->nodes[node].ambiguous)
        return;
    link = c->first_link[node];
    for (int32_t i = 0; i < c->node_count; i++)
        if (i != node && c->chart[i].part == c->chart[node].part) {
            cairn_real evidence =
                cairn_consensus_evidence(c, node, c->chart[node].pose, i, &link, &units);

            all += cairn_max(evidence, 0);
            doubtful += c->nodes[i].ambiguous ? cairn_max(evidence, 0) : 0;
        }
    c->nodes[node].ambiguous = 2 * doubtful > all;
    c->changed += c->nodes[node].ambiguous;
    c->result.ambiguous += c->nodes[node].ambiguous;
    c->debt += units;
}

void cairn_consensus_finish(cairn_pose_consensus *c)
{
    c->result.nodes = c->node_count;
    for (int32_t i = 0; i < c->node_count; i++) {
        if (c->chart[i].part < 0) {
            c->nodes[i].map_node = c->bounds[i].centre;
            continue;
        }
        add_rival(c, i);
        weigh(c, i);
        move_into_frame(c, i);
        c->debt += 4;
    }
    number_parts(c);
    c->debt += c->node_count;
    for (int32_t h = 0; h < c->hypothesis_count; h++) {
        const cairn_kept_hypothesis *kept = &c->hypotheses[h];
        const cairn_chart_node *first = &c->chart[kept->first], *second = &c->chart[kept->second];

        c->result.agreeing +=
            first->part >= 0 && first->part == second->part &&
            cairn_consensus_chi(kept, first->pose, second->pose, NULL) < c->params.gate;
    }
    c->debt += c->hypothesis_count / 2;
}
