/* Matching of the model's whole outline to the tokens, and refinement of the pose.
 *
 * Method: dynamic programming along the outline with an occlusion state (Viterbi algorithm).
 * 1. States: an outline sample is matched to one of the tokens near it, or occluded.
 * 2. Data term: an approximate log-likelihood ratio of the token, object against background
 *    clutter. It decreases with the distance, by the better of two tolerances: that of the same
 *    object and that of another object of its class. It is less for a straight piece than for a
 *    curved one. A chain that is followed round a curve has a reward, since chains of the
 *    background rarely curve there.
 * 3. Transition term: costs to begin a matched run, to end it, and to switch chains. The greatest
 *    is that of a switch away from a chain that continues elsewhere, which a contour of the object
 *    rarely does.
 * 4. Occlusion state: a small cost per piece, since a visible part of an object is evidence as
 *    well.
 * 5. Refinement: alternates matching and a least-squares fit of the pose, with pruning of poor
 *    poses.
 *
 * Source: the dynamic program over a whole path is this project's, in place of the likelihood of
 * Adluru 2008 (2.13), which cannot distinguish an occluded part from an absent object. */
#include "src/base/build.h"

#include <string.h>

#include "src/outlines/contour_grouping_work.h"

/* Share of the object's size: pieces of the outline of this length are treated as independent. */
#define PIECE_LENGTH CAIRN_REAL(0.08)
/* Log-likelihood ratio (nats) of a perfectly matched piece: for the same object, and for another of
 * its class, whose sigmas are wider by SIMILAR_SIGMA_FACTOR. */
#define SAME_OBJECT_LLR      CAIRN_REAL(2.14)
#define SIMILAR_OBJECT_LLR   CAIRN_REAL(0.5)
#define SIMILAR_SIGMA_FACTOR CAIRN_REAL(2.5)
/* Relative reduction of the score of a straight piece. */
#define STRAIGHT_DISCOUNT CAIRN_REAL(0.65)
/* Usual edge density, px per px^2; and the cost (nats) of a piece per e-fold density. */
#define USUAL_EDGE_DENSITY CAIRN_REAL(0.035)
#define DENSITY_COST       CAIRN_REAL(0.25)
/* Costs (nats): an occluded piece, beginning or ending a matched run, switching to another chain,
 * and leaving a chain that continues. */
#define OCCLUSION_COST    CAIRN_REAL(0.15)
#define BORDER_COST       CAIRN_REAL(0.4)
#define CHAIN_SWITCH_COST CAIRN_REAL(0.8)
#define CHAIN_LEAVE_COST  2
/* Reward (nats) for following a chain where the outline curves. */
#define CURVE_REWARD 1
/* 1 - cosine of the turning angle, between the samples two before and two after, of a curve. */
#define CURVE_TURN CAIRN_REAL(0.0667)
/* Greatest step along a chain, tokens; remaining tokens with which a chain counts as continuing. */
enum { MAX_TOKEN_STEP = 3, MIN_REMAINING_TOKENS = 2 };
/* Refinement rounds; pruning ratio per round: a pose is refined further only if its evidence times
 * the ratio reaches the best evidence so far. */
enum { MAX_ROUNDS = 5 };
static const int32_t pruning_ratio[MAX_ROUNDS] = {12, 6, 4, 3, 0};
/* Smoothing radius of the deformation, samples. */
enum { SMOOTHING_RADIUS = 3 };
/* Decay of the shift per unmatched sample. */
#define SHIFT_DECAY CAIRN_REAL(0.95)
/* Weight of the previous round's pose in the fit, points. */
#define PRIOR_WEIGHT 2
/* Work units of one sample: token search and transitions; samples in a unit: of the best path, to
 * which shifts are propagated; work units of a sample in the fit of the pose. */
enum {
    UNITS_PER_SAMPLE = 12,
    TRACED_PER_UNIT = 8,
    PROPAGATED_PER_UNIT = 2,
    UNITS_PER_FITTED_SAMPLE = 1
};

/* Clutter cost: reduces the score of a piece in images with more edges than usual, where chance
 * matches are more frequent. */
void cairn_contour_grouping_set_clutter_cost(cairn_contour_grouping *grouping)
{
    cairn_real area = (cairn_real)grouping->input.width * (cairn_real)grouping->input.height;

    grouping->limits.clutter_cost =
        DENSITY_COST *
        cairn_log(cairn_max(grouping->pieces.length / (area * USUAL_EDGE_DENSITY), 1));
}

/* Curvature weight at a sample: 0 straight, 1 sharp. */
static cairn_real curvature_at(const cairn_shape_model *model, int32_t i)
{
    cairn_vec2 before = model->outline[i >= 2 ? i - 2 : 0].direction;
    cairn_vec2 after =
        model->outline[i + 2 < model->outline_count ? i + 2 : model->outline_count - 1].direction;

    return 1 - cairn_exp((cairn_vec2_dot(before, after) - 1) / CURVE_TURN);
}

/* Returns 1 when the step from token `from` to token `to` follows a chain in the direction of the
 * outline. */
static int continues_chain(const cairn_contour_grouping *grouping, int32_t from, int32_t to,
                           cairn_vec2 direction)
{
    int32_t ahead =
        cairn_vec2_dot(grouping->tokens[to].direction, direction) >= 0 ? to - from : from - to;

    return grouping->tokens[from].chain == grouping->tokens[to].chain && ahead >= 0 &&
           ahead <= MAX_TOKEN_STEP;
}

/* Cost of leaving a token's chain that continues ahead of it (ahead 1) or behind it (-1), along the
 * outline. */
static cairn_real chain_leave_cost(const cairn_contour_grouping *grouping, int32_t token,
                                   cairn_vec2 direction, int32_t ahead)
{
    int32_t sense =
        cairn_vec2_dot(grouping->tokens[token].direction, direction) >= 0 ? ahead : -ahead;
    int32_t next = token + MIN_REMAINING_TOKENS * sense;

    return !grouping->outline.is_listing && next >= 0 && next < grouping->token_count &&
                   grouping->tokens[next].chain == grouping->tokens[token].chain
               ? CHAIN_LEAVE_COST
               : 0;
}

/* Transition cost between two nodes; leave, enter: costs of leaving the chain of the first and of
 * entering that of the second. */
static cairn_real transition_cost(const cairn_contour_grouping *grouping,
                                  const contour_grouping_node *from,
                                  const contour_grouping_node *to, cairn_vec2 direction,
                                  cairn_real curvature, cairn_real leave, cairn_real enter)
{
    cairn_real offset_jump;

    if (from->token == to->token)
        return 0;
    if (from->token < 0)
        return BORDER_COST + enter;
    if (to->token < 0)
        return BORDER_COST + leave;
    if (continues_chain(grouping, from->token, to->token, direction))
        return -CURVE_REWARD * curvature;
    offset_jump = to->offset - from->offset;
    return CHAIN_SWITCH_COST + offset_jump * offset_jump + leave + enter;
}

/* Creates the nodes of a sample: occluded, and the tokens near it. Returns their number. */
static int32_t make_nodes(const cairn_contour_grouping *grouping, const cairn_similarity *pose,
                          const cairn_oriented_point *sample, cairn_real curvature,
                          contour_grouping_node *row)
{
    cairn_vec2 at = cairn_similarity_point(*pose, sample->position),
               direction = cairn_similarity_vector(*pose, sample->direction);
    cairn_real size = cairn_similarity_scale(*pose), sigma = grouping->params.deform_sigma * size,
               cost[CONTOUR_GROUPING_MAX_NODES - 1];
    cairn_real pieces = grouping->limits.spacing / PIECE_LENGTH,
               weight = grouping->outline.is_listing ? 1 : 1 - STRAIGHT_DISCOUNT * (1 - curvature);
    int32_t token[CONTOUR_GROUPING_MAX_NODES - 1];
    int32_t count;

    at = grouping->outline.is_listing
             ? cairn_vec2_add(at, grouping->outline.shift[sample - grouping->input.model->outline])
             : at;
    count = cairn_contour_grouping_match_tokens(grouping, at, direction, sigma,
                                                CONTOUR_GROUPING_MAX_NODES - 1, token, cost);

    row[0].token = -1;
    row[0].cost = row[0].offset = 0;
    row[0].value = -OCCLUSION_COST * pieces;
    for (int32_t k = 0; k < count; k++) {
        cairn_vec2 offset =
            cairn_vec2_sub(cairn_contour_grouping_nearest_point(grouping, token[k], at), at);

        row[k + 1].token = token[k];
        row[k + 1].cost = cost[k];
        row[k + 1].offset = cairn_vec2_cross(direction, offset) / (size * sigma);
        row[k + 1].value =
            pieces * (cairn_max(SAME_OBJECT_LLR * weight -
                                    SIMILAR_SIGMA_FACTOR * SIMILAR_SIGMA_FACTOR * cost[k],
                                SIMILAR_OBJECT_LLR * weight - cost[k]) -
                      grouping->limits.clutter_cost);
    }
    return count + 1;
}

/* One Viterbi step: the nodes of a sample and the best predecessor of each. */
static void extend_paths(cairn_contour_grouping *grouping, int32_t i)
{
    const cairn_oriented_point *sample = &grouping->input.model->outline[i];
    contour_grouping_node *row = &grouping->outline.nodes[i * CONTOUR_GROUPING_MAX_NODES],
                          *previous = row - CONTOUR_GROUPING_MAX_NODES;
    cairn_vec2 direction = cairn_similarity_vector(grouping->outline.pose, sample->direction);
    cairn_real curvature = grouping->outline.curvature[i], leave[CONTOUR_GROUPING_MAX_NODES];
    int32_t count = make_nodes(grouping, &grouping->outline.pose, sample, curvature, row);

    for (int32_t j = 0; j < grouping->outline.node_count && i > 0; j++)
        leave[j] =
            previous[j].token < 0 ? 0 : chain_leave_cost(grouping, previous[j].token, direction, 1);
    for (int32_t k = 0; k < count && i > 0; k++) {
        cairn_real best_value = -CAIRN_REAL_MAX;
        cairn_real enter =
            row[k].token < 0 ? 0 : chain_leave_cost(grouping, row[k].token, direction, -1);

        for (int32_t j = 0; j < grouping->outline.node_count; j++) {
            cairn_real value =
                previous[j].value - transition_cost(grouping, &previous[j], &row[k], direction,
                                                    curvature, leave[j], enter);

            if (value > best_value) {
                best_value = value;
                row[k].predecessor = j;
            }
        }
        row[k].value += best_value;
    }
    grouping->outline.node_count = count;
}

/* Viterbi backtracking: sets the matches and their costs, returns the score of the best path. */
static cairn_real backtrack(cairn_contour_grouping *grouping)
{
    int32_t last = grouping->input.model->outline_count - 1, best = 0;
    const contour_grouping_node *row = &grouping->outline.nodes[last * CONTOUR_GROUPING_MAX_NODES];
    cairn_real value;

    for (int32_t k = 1; k < grouping->outline.node_count; k++)
        if (row[k].value > row[best].value)
            best = k;
    value = row[best].value;
    for (int32_t i = last; i >= 0; i--) {
        const contour_grouping_node *node =
            &grouping->outline.nodes[i * CONTOUR_GROUPING_MAX_NODES + best];

        grouping->outline.match[i] = node->token;
        grouping->outline.cost[i] = node->cost;
        best = node->predecessor;
    }
    return value;
}

int cairn_contour_grouping_match_outline(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(grouping->match_resume);
    for (grouping->outline.sample = 0;
         grouping->outline.sample < grouping->input.model->outline_count;
         grouping->outline.sample++) {
        CAIRN_STEP_CHARGE(grouping, match_resume, budget, UNITS_PER_SAMPLE);
        extend_paths(grouping, grouping->outline.sample);
    }
    CAIRN_STEP_CHARGE(grouping, match_resume, budget,
                      1 + grouping->input.model->outline_count / TRACED_PER_UNIT);
    grouping->outline.evidence = backtrack(grouping);
    CAIRN_STEP_END(grouping->match_resume);
}

/* Refits the pose to the matches: weighted least squares with a prior on the previous pose. */
static void fit_matches(cairn_contour_grouping *grouping)
{
    const cairn_shape_model *model = grouping->input.model;
    contour_grouping_fit_sums sums =
        cairn_contour_grouping_pose_prior(&grouping->outline.pose, PRIOR_WEIGHT);
    cairn_similarity previous = grouping->outline.pose;

    for (int32_t i = 0; i < model->outline_count; i++) {
        cairn_vec2 point = model->outline[i].position;

        if (grouping->outline.match[i] >= 0)
            cairn_contour_grouping_add_point(
                &sums, point,
                cairn_contour_grouping_nearest_point(grouping, grouping->outline.match[i],
                                                     cairn_similarity_point(previous, point)),
                cairn_exp(-grouping->outline.cost[i]));
    }
    grouping->outline.pose = cairn_contour_grouping_fit_pose(&sums, &previous);
}

/* 1 when the evidence is too little for a further round. */
static int is_poor(const cairn_contour_grouping *grouping)
{
    return grouping->outline.evidence * (cairn_real)pruning_ratio[grouping->outline.round] <
           grouping->outline.max_evidence;
}

int cairn_contour_grouping_refine_pose(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(grouping->refine_resume);
    for (grouping->outline.round = 0; grouping->outline.round < MAX_ROUNDS;
         grouping->outline.round++) {
        CAIRN_STEP_RUN(grouping, refine_resume, budget, cairn_contour_grouping_match_outline);
        if (grouping->outline.round + 1 == MAX_ROUNDS || is_poor(grouping))
            break;
        CAIRN_STEP_CHARGE(grouping, refine_resume, budget,
                          1 + UNITS_PER_FITTED_SAMPLE * grouping->input.model->outline_count);
        fit_matches(grouping);
    }
    grouping->outline.max_evidence =
        cairn_max(grouping->outline.max_evidence, grouping->outline.evidence);
    CAIRN_STEP_END(grouping->refine_resume);
}

/* Sums the shifts of the matched samples from i - SMOOTHING_RADIUS to i + SMOOTHING_RADIUS; returns
 * their number. */
static int32_t shifts_around(const cairn_contour_grouping *grouping, int32_t i, cairn_vec2 *sum)
{
    const cairn_shape_model *model = grouping->input.model;
    int32_t count = 0;

    sum->x = sum->y = 0;
    for (int32_t k = i > SMOOTHING_RADIUS ? i - SMOOTHING_RADIUS : 0;
         k <= i + SMOOTHING_RADIUS && k < model->outline_count; k++)
        if (grouping->outline.match[k] >= 0) {
            cairn_vec2 point =
                cairn_similarity_point(grouping->outline.pose, model->outline[k].position);
            cairn_vec2 from = cairn_vec2_add(point, grouping->outline.shift[k]);

            *sum =
                cairn_vec2_add(*sum, cairn_vec2_sub(cairn_contour_grouping_nearest_point(
                                                        grouping, grouping->outline.match[k], from),
                                                    point));
            count++;
        }
    return count;
}

/* Propagates the shift of the nearest matched sample to unmatched ones, with decay, in one
 * direction. */
static void propagate_shifts(cairn_vec2 *shift, int32_t *match_distance, int32_t count,
                             int32_t step)
{
    int32_t index = step > 0 ? 0 : count - 1;

    for (int32_t k = 1; k < 2 * count; k++) {
        int32_t next = (index + step + count) % count;

        if (match_distance[index] + 1 < match_distance[next]) {
            match_distance[next] = match_distance[index] + 1;
            shift[next] = cairn_vec2_scale(shift[index], SHIFT_DECAY);
        }
        index = next;
    }
}

/* Shift of a sample: the mean of the matched ones around it. */
static void average_shifts(cairn_contour_grouping *grouping, int32_t i)
{
    cairn_vec2 sum;
    int32_t matched = shifts_around(grouping, i, &sum);

    grouping->outline.next_shift[i] =
        cairn_vec2_scale(sum, 1 / (cairn_real)(matched > 0 ? matched : 1));
    grouping->outline.match_distance[i] =
        matched > 0 ? 0 : 2 * grouping->input.model->outline_count;
}

int cairn_contour_grouping_deform_outline(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    int32_t count = grouping->input.model->outline_count;

    CAIRN_STEP_BEGIN(grouping->match_resume);
    for (grouping->outline.sample = 0; grouping->outline.sample < count;
         grouping->outline.sample++) {
        CAIRN_STEP_CHARGE_UNIT(grouping, match_resume, budget);
        average_shifts(grouping, grouping->outline.sample);
    }
    CAIRN_STEP_CHARGE(grouping, match_resume, budget, 1 + count / PROPAGATED_PER_UNIT);
    propagate_shifts(grouping->outline.next_shift, grouping->outline.match_distance, count, 1);
    propagate_shifts(grouping->outline.next_shift, grouping->outline.match_distance, count, -1);
    memcpy(grouping->outline.shift, grouping->outline.next_shift,
           (size_t)count * sizeof *grouping->outline.next_shift);
    CAIRN_STEP_END(grouping->match_resume);
}

void cairn_contour_grouping_begin_outline(cairn_contour_grouping *grouping)
{
    const cairn_shape_model *model = grouping->input.model;
    cairn_real sum = 0;

    for (int32_t i = 1; i < model->outline_count; i++)
        sum += cairn_vec2_norm(
            cairn_vec2_sub(model->outline[i].position, model->outline[i - 1].position));
    grouping->limits.spacing = sum / (cairn_real)model->outline_count;
    for (int32_t i = 0; i < model->outline_count; i++)
        grouping->outline.curvature[i] = curvature_at(model, i);
    grouping->outline.max_evidence = 0;
    grouping->outline.node_count = grouping->outline.is_listing = 0;
}
