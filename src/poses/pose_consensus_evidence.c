/* pose_consensus: support of a pose by hypotheses, likelihood functions and bounds; inliers, cycles,
 * relaxation. pose_consensus.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "src/poses/pose_consensus_work.h"

/* Tolerance factor of bounds: the common motion minimises squares, not the largest error. */
static const cairn_real BOUND_SLACK = CAIRN_REAL(1.5);
static const cairn_real SAME_POSE_SIGMAS = 5;
/* Factor on max_chi2 for cycles, which carry the errors of two hypotheses more. */
static const cairn_real CYCLE_GATE = 3;

/* Hypotheses of a node, cycles, and hypotheses of the map that a work unit covers. */
enum { LINKS_PER_UNIT = 4, CYCLES_PER_UNIT = 2, INLIERS_PER_UNIT = 2 };

cairn_pose_consensus_pose cairn_pose_consensus_pose_of(cairn_pose pose)
{
    cairn_pose_consensus_pose turned;

    turned.transform = cairn_transform_of(pose);
    turned.theta = pose.theta;
    return turned;
}

cairn_pose cairn_pose_consensus_to_pose(const cairn_pose_consensus_pose *turned)
{
    cairn_pose pose = {turned->transform.x, turned->transform.y, cairn_wrap_angle(turned->theta)};

    return pose;
}

/* Angles are sums of theta, from which sine and cosine are computed anew: repeated products would
 * drift. */
cairn_pose_consensus_pose cairn_pose_consensus_compose(const cairn_pose_consensus_pose *a_b,
                                                       const cairn_pose_consensus_pose *b_c)
{
    cairn_vec2 origin = {b_c->transform.x, b_c->transform.y},
               moved = cairn_transform_point(a_b->transform, origin);
    cairn_pose a_c = {moved.x, moved.y, cairn_wrap_angle(a_b->theta + b_c->theta)};

    return cairn_pose_consensus_pose_of(a_c);
}

cairn_pose_consensus_pose cairn_pose_consensus_inverse(const cairn_pose_consensus_pose *a_b)
{
    return cairn_pose_consensus_pose_of(cairn_pose_inverse(cairn_pose_consensus_to_pose(a_b)));
}

int32_t cairn_pose_consensus_is_same_pose(const cairn_pose_consensus *consensus,
                                          const cairn_pose_consensus_pose *a,
                                          const cairn_pose_consensus_pose *b)
{
    cairn_real x = a->transform.x - b->transform.x, y = a->transform.y - b->transform.y;
    cairn_real reach = SAME_POSE_SIGMAS * consensus->params.sigma;

    return x * x + y * y <= reach * reach && cairn_abs(cairn_wrap_angle(a->theta - b->theta)) <=
                                                 SAME_POSE_SIGMAS * consensus->params.sigma_theta;
}

cairn_real cairn_pose_consensus_chi2(const cairn_pose_consensus_hypothesis *hypothesis,
                                     const cairn_pose_consensus_pose *map_first,
                                     const cairn_pose_consensus_pose *map_second,
                                     cairn_real residual[3])
{
    cairn_transform a = map_first->transform, z = hypothesis->first_second.transform;
    cairn_vec2 offset = {map_second->transform.x - a.x, map_second->transform.y - a.y},
               seen = cairn_transform_inverse_direction(a, offset);
    cairn_real error[3] = {
        seen.x - z.x, seen.y - z.y,
        cairn_wrap_angle(map_second->theta - map_first->theta - hypothesis->first_second.theta)};

    for (int k = 0; k < 3 && residual != NULL; k++)
        residual[k] = error[k];
    return cairn_sym3_form(hypothesis->information, error);
}

/* Returns the weight of a hypothesis' score: 1 at its mode, 0 from max_chi2 on. */
static cairn_real weight_of(const cairn_pose_consensus *consensus, cairn_real chi)
{
    return cairn_max(1 - chi / consensus->params.max_chi2, 0);
}

/* Returns the best agreeing hypothesis of a node at a pose and the other node of its link `from`,
 * which is the first one of the pair; -1: none. *to: the link behind the last of the pair. *earned: its
 * weighted score. *strongest: the best score of the pair, agreeing or not. */
static int32_t best_of_pair(const cairn_pose_consensus *consensus, int32_t node,
                            const cairn_pose_consensus_pose *map_node, int32_t from, int32_t *to,
                            cairn_real *earned, cairn_real *strongest)
{
    const cairn_pose_consensus_link *links = consensus->links;
    const cairn_pose_consensus_pose *map_other = &consensus->current[links[from].other].pose;
    int32_t other = links[from].other, best = -1, l = from;

    *earned = *strongest = 0;
    for (; l < consensus->first_link[node + 1] && links[l].other == other; l++) {
        const cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[links[l].hypothesis];
        int is_first = h->first == node;
        cairn_real chi = cairn_pose_consensus_chi2(h, is_first ? map_node : map_other,
                                                   is_first ? map_other : map_node, NULL);
        cairn_real share = weight_of(consensus, chi);

        *strongest = cairn_max(*strongest, h->score);
        if (share * h->score > *earned) {
            *earned = share * h->score;
            best = links[l].hypothesis;
        }
    }
    *to = l;
    return best;
}

int32_t cairn_pose_consensus_link_units(const cairn_pose_consensus *consensus, int32_t node)
{
    return 1 + (consensus->first_link[node + 1] - consensus->first_link[node]) / LINKS_PER_UNIT;
}

int32_t cairn_pose_consensus_node_units(const cairn_pose_consensus *consensus)
{
    return 1 + consensus->node_count / POSE_CONSENSUS_NODES_PER_UNIT;
}

int32_t cairn_pose_consensus_copy_units(const cairn_pose_consensus *consensus)
{
    return 1 + consensus->node_count / POSE_CONSENSUS_POSES_PER_UNIT;
}

/* ---- Support ---- */

/* Evaluates the pairwise likelihood of the query's pair; 0 when the budget is used up. */
static int evaluate_pair(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    const struct pose_consensus_query *query = &consensus->query;
    int is_second = query->node > query->other;
    int32_t nodes[2];
    cairn_pose poses[2];

    nodes[is_second] = query->node;
    nodes[!is_second] = query->other;
    poses[is_second] = cairn_pose_consensus_to_pose(&query->pose);
    poses[!is_second] = cairn_pose_consensus_to_pose(&consensus->current[query->other].pose);
    return consensus->pair_likelihood(consensus->pair_context, nodes[0], nodes[1],
                                      cairn_pose_between(poses[0], poses[1]),
                                      &consensus->likelihood, budget);
}

/* Evaluates the joint likelihood of the query; 0 when the budget is used up. */
static int evaluate_joint(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    const struct pose_consensus_query *query = &consensus->query;

    return consensus->joint_likelihood(consensus->joint_context, query->node,
                                       cairn_pose_consensus_to_pose(&query->pose),
                                       consensus->joint_poses, consensus->joint_components,
                                       query->component, &consensus->likelihood, budget);
}

static cairn_real finite_or_zero(cairn_real x)
{
    return cairn_is_finite(x) ? x : 0;
}

/* Adds the log-likelihood ratio of the pair with another node. */
static void add_support(cairn_pose_consensus *consensus, int32_t other, cairn_real evidence)
{
    cairn_pose_consensus_support *support = &consensus->query.found;
    cairn_real positive = cairn_max(evidence, 0);

    support->sum += evidence;
    support->violations -= cairn_min(evidence, 0);
    support->positive += positive;
    support->ambiguous += consensus->nodes[other].ambiguous ? positive : 0;
    support->agreeing += evidence > 0;
    support->conflicting += evidence < 0;
}

/* Adds the support by hypotheses alone. */
static void add_links(cairn_pose_consensus *consensus)
{
    const struct pose_consensus_query *query = &consensus->query;
    int32_t end = consensus->first_link[query->node + 1];

    for (int32_t l = consensus->first_link[query->node], to; l < end; l = to) {
        int32_t other = consensus->links[l].other;
        cairn_real earned, strongest;

        (void)best_of_pair(consensus, query->node, &query->pose, l, &to, &earned, &strongest);
        if (consensus->current[other].component == query->component)
            add_support(consensus, other,
                        earned > 0 ? earned : -consensus->params.conflict_penalty * strongest);
    }
}

int cairn_pose_consensus_find_pair(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    struct pose_consensus_query *query = &consensus->query;
    int32_t end = consensus->first_link[query->node + 1];
    cairn_real earned = 0, strongest;

    if (consensus->pair_likelihood != NULL && !evaluate_pair(consensus, budget))
        return 0;
    while (query->link < end && consensus->links[query->link].other < query->other)
        query->link++;
    if (query->link < end && consensus->links[query->link].other == query->other)
        (void)best_of_pair(consensus, query->node, &query->pose, query->link, &query->link, &earned,
                           &strongest);
    if (consensus->pair_likelihood != NULL) {
        cairn_real likelihood = finite_or_zero(consensus->likelihood.ratio);

        earned = earned > 0 ? cairn_max(earned, likelihood) : likelihood;
        memset(&consensus->likelihood, 0, sizeof consensus->likelihood);
    }
    query->ratio = earned;
    return 1;
}

/* Copies the current assignment for the joint likelihood function. */
static void copy_poses(const cairn_pose_consensus *consensus)
{
    for (int32_t i = 0; i < consensus->node_count; i++) {
        consensus->joint_poses[i] = cairn_pose_consensus_to_pose(&consensus->current[i].pose);
        consensus->joint_components[i] = consensus->current[i].component;
    }
}

/* The joint likelihood replaces the support by hypotheses; agreeing and conflicting pairs are counted
 * by hypotheses. */
static void take_joint(cairn_pose_consensus *consensus)
{
    consensus->query.found.sum = finite_or_zero(consensus->likelihood.ratio);
    consensus->query.found.violations = finite_or_zero(consensus->likelihood.against);
    memset(&consensus->likelihood, 0, sizeof consensus->likelihood);
}

void cairn_pose_consensus_set_query(cairn_pose_consensus *consensus, int32_t node,
                                    const cairn_pose_consensus_pose *map_node, int32_t part,
                                    cairn_pose_consensus_evidence evidence)
{
    struct pose_consensus_query *query = &consensus->query;

    query->node = node;
    query->pose = *map_node;
    query->component = part;
    query->evidence = evidence;
    query->link = consensus->first_link[node];
    memset(&query->found, 0, sizeof query->found);
}

void cairn_pose_consensus_query_current(cairn_pose_consensus *consensus, int32_t node,
                                        cairn_pose_consensus_evidence evidence)
{
    const cairn_pose_consensus_assignment *current = &consensus->current[node];

    cairn_pose_consensus_set_query(consensus, node, &current->pose, current->component, evidence);
}

int cairn_pose_consensus_find_support(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    struct pose_consensus_query *query = &consensus->query;

    CAIRN_STEP_BEGIN(consensus->resume.support);
    CAIRN_STEP_CHARGE(consensus, resume.support, budget,
                      cairn_pose_consensus_link_units(consensus, query->node));
    if (query->evidence == POSE_CONSENSUS_BY_ALL && consensus->joint_likelihood != NULL) {
        add_links(consensus);
        CAIRN_STEP_CHARGE(consensus, resume.support, budget,
                          cairn_pose_consensus_copy_units(consensus));
        copy_poses(consensus);
        CAIRN_STEP_UNTIL(consensus->resume.support, evaluate_joint(consensus, budget));
        take_joint(consensus);
    } else if (query->evidence != POSE_CONSENSUS_BY_HYPOTHESES &&
               consensus->pair_likelihood != NULL) {
        CAIRN_STEP_CHARGE(consensus, resume.support, budget,
                          cairn_pose_consensus_node_units(consensus));
        for (query->other = 0; query->other < consensus->node_count; query->other++) {
            if (query->other == query->node ||
                consensus->current[query->other].component != query->component)
                continue;
            CAIRN_STEP_UNTIL(consensus->resume.support,
                             cairn_pose_consensus_find_pair(consensus, budget));
            add_support(consensus, query->other, query->ratio);
        }
    } else {
        add_links(consensus);
    }
    CAIRN_STEP_END(consensus->resume.support);
}

/* ---- Inliers ---- */

/* Returns 1 when a hypothesis is an inlier of the current map. */
static int is_inlier(const cairn_pose_consensus *consensus,
                     const cairn_pose_consensus_hypothesis *hypothesis)
{
    const cairn_pose_consensus_assignment *first = &consensus->current[hypothesis->first],
                                          *second = &consensus->current[hypothesis->second];

    return first->component >= 0 && first->component == second->component &&
           cairn_pose_consensus_chi2(hypothesis, &first->pose, &second->pose, NULL) <
               consensus->params.max_chi2;
}

int cairn_pose_consensus_find_inliers(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    cairn_pose_consensus_hypothesis *h;

    CAIRN_STEP_BEGIN(consensus->resume.part);
    consensus->result.inliers = 0;
    for (consensus->hypothesis = 0; consensus->hypothesis < consensus->hypothesis_count;
         consensus->hypothesis++) {
        CAIRN_STEP_CHARGE_EVERY(consensus, resume.part, budget, INLIERS_PER_UNIT,
                                consensus->hypothesis);
        h = &consensus->hypotheses[consensus->hypothesis];
        if (is_inlier(consensus, h)) {
            h->is_explained = 1;
            consensus->result.inliers++;
        }
    }
    CAIRN_STEP_END(consensus->resume.part);
}

/* ---- Cycle consistency ---- */

const cairn_pose_consensus_pose *
cairn_pose_consensus_relative_to(const cairn_pose_consensus_hypothesis *hypothesis, int32_t node)
{
    return hypothesis->first == node ? &hypothesis->first_second : &hypothesis->second_first;
}

/* Returns the end of the links of a node to one other node, from `from` on. */
static int32_t end_of_pair(const cairn_pose_consensus *consensus, int32_t node, int32_t from)
{
    int32_t to = from + 1;

    while (to < consensus->first_link[node + 1] &&
           consensus->links[to].other == consensus->links[from].other)
        to++;
    return to;
}

/* Adds the cycles of a hypothesis over the next link of its first node to a third one, and all links
 * of its second node to it. */
static void add_cycles_of_link(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_pose here = {{0, 0, 1, 0}, 0};
    const cairn_pose_consensus_hypothesis *hypothesis =
        &consensus->hypotheses[consensus->hypothesis];
    struct pose_consensus_cycles *cycles = &consensus->cycles;
    const cairn_pose_consensus_hypothesis *to =
        &consensus->hypotheses[consensus->links[cycles->link].hypothesis];

    for (int32_t j = cycles->b[0]; j < cycles->b[1]; j++) {
        const cairn_pose_consensus_hypothesis *on =
            &consensus->hypotheses[consensus->links[j].hypothesis];
        cairn_pose_consensus_pose way = *cairn_pose_consensus_relative_to(to, hypothesis->first);
        const cairn_pose_consensus_pose *rest =
            cairn_pose_consensus_relative_to(on, consensus->links[j].other);
        cairn_vec2 position = {rest->transform.x, rest->transform.y};
        cairn_real share;

        position = cairn_transform_point(way.transform, position);
        way.transform.x = position.x;
        way.transform.y = position.y;
        way.theta += rest->theta;
        share = 1 - cairn_pose_consensus_chi2(hypothesis, &here, &way, NULL) /
                        (CYCLE_GATE * consensus->params.max_chi2);
        cycles->best = cairn_max(
            cycles->best, share * cairn_min(hypothesis->score, cairn_min(to->score, on->score)));
    }
}

/* Starts with the first links of both nodes of the hypothesis. */
static void begin_cycles(cairn_pose_consensus *consensus)
{
    cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[consensus->hypothesis];

    h->cycle_score = 0;
    consensus->cycles.a[0] = consensus->first_link[h->first];
    consensus->cycles.b[0] = consensus->first_link[h->second];
}

/* Advances to the next third node that both nodes of the hypothesis have links to; 0: none. */
static int next_third(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[consensus->hypothesis];
    struct pose_consensus_cycles *cycles = &consensus->cycles;

    while (cycles->a[0] < consensus->first_link[h->first + 1] &&
           cycles->b[0] < consensus->first_link[h->second + 1]) {
        int32_t third = consensus->links[cycles->a[0]].other,
                other = consensus->links[cycles->b[0]].other;

        cycles->a[1] = end_of_pair(consensus, h->first, cycles->a[0]);
        cycles->b[1] = end_of_pair(consensus, h->second, cycles->b[0]);
        if (third == other)
            return 1;
        if (third < other)
            cycles->a[0] = cycles->a[1];
        else
            cycles->b[0] = cycles->b[1];
    }
    return 0;
}

/* Adds the best cycle through the third node, and starts with the links behind it. */
static void end_third(cairn_pose_consensus *consensus)
{
    consensus->hypotheses[consensus->hypothesis].cycle_score += consensus->cycles.best;
    consensus->cycles.a[0] = consensus->cycles.a[1];
    consensus->cycles.b[0] = consensus->cycles.b[1];
}

/* Units of the search for third nodes: the links of both nodes are compared. */
static int32_t third_units(const cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[consensus->hypothesis];
    int32_t links = consensus->first_link[h->first + 1] - consensus->first_link[h->first] +
                    consensus->first_link[h->second + 1] - consensus->first_link[h->second];

    return 1 + links / POSE_CONSENSUS_NODES_PER_UNIT;
}

int cairn_pose_consensus_add_cycles(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    struct pose_consensus_cycles *cycles = &consensus->cycles;

    CAIRN_STEP_BEGIN(consensus->resume.phase);
    for (consensus->hypothesis = 0; consensus->hypothesis < consensus->hypothesis_count;
         consensus->hypothesis++) {
        CAIRN_STEP_CHARGE(consensus, resume.phase, budget, third_units(consensus));
        begin_cycles(consensus);
        while (next_third(consensus)) {
            cycles->best = 0;
            for (cycles->link = cycles->a[0]; cycles->link < cycles->a[1]; cycles->link++) {
                CAIRN_STEP_CHARGE(consensus, resume.phase, budget,
                                  1 + (cycles->b[1] - cycles->b[0]) / CYCLES_PER_UNIT);
                add_cycles_of_link(consensus);
            }
            end_third(consensus);
        }
    }
    CAIRN_STEP_END(consensus->resume.phase);
}

/* ---- Bounds ---- */

/* Sums over nodes with bounds for the least-squares common motion. */
struct fit {
    cairn_vec2 from, to; /* weighted means */
    cairn_real weight, dot, cross;
};

static void add_centre(struct fit *fit, const cairn_pose_consensus_bound *bound,
                       const cairn_pose_consensus_pose *pose)
{
    cairn_real weight = 1 / (bound->metres * bound->metres);

    fit->weight += weight;
    fit->from.x += weight * pose->transform.x;
    fit->from.y += weight * pose->transform.y;
    fit->to.x += weight * bound->centre.x;
    fit->to.y += weight * bound->centre.y;
}

static void add_turn(struct fit *fit, const cairn_pose_consensus_bound *bound,
                     const cairn_pose_consensus_pose *pose)
{
    cairn_real weight = 1 / (bound->metres * bound->metres),
               turns = 1 / (bound->radians * bound->radians);
    cairn_vec2 from = {pose->transform.x - fit->from.x, pose->transform.y - fit->from.y};
    cairn_vec2 to = {bound->centre.x - fit->to.x, bound->centre.y - fit->to.y};
    cairn_real by = bound->centre.theta - pose->theta;

    fit->dot += weight * cairn_vec2_dot(from, to) + turns * cairn_cos(by);
    fit->cross += weight * cairn_vec2_cross(from, to) + turns * cairn_sin(by);
}

static int is_within(const cairn_pose_consensus_bound *bound, cairn_pose map_part,
                     const cairn_pose_consensus_pose *pose)
{
    cairn_pose placed = cairn_pose_compose(map_part, cairn_pose_consensus_to_pose(pose));
    cairn_real x = placed.x - bound->centre.x, y = placed.y - bound->centre.y,
               reach = BOUND_SLACK * bound->metres;

    return x * x + y * y <= reach * reach &&
           cairn_abs(cairn_wrap_angle(placed.theta - bound->centre.theta)) <=
               BOUND_SLACK * bound->radians;
}

/* Returns the pose of a bounded node of the component, or of the candidate; NULL when it is neither,
 * or has no bound. */
static const cairn_pose_consensus_pose *bounded_pose(const cairn_pose_consensus *consensus,
                                                     int32_t i, int32_t part, int32_t node,
                                                     const cairn_pose_consensus_pose *candidate)
{
    const cairn_pose_consensus_assignment *current = &consensus->current[i];

    if (!(consensus->bounds[i].metres > 0) || (i != node && current->component != part))
        return NULL;
    return i == node ? candidate : &current->pose;
}

int32_t cairn_pose_consensus_bound_units(const cairn_pose_consensus *consensus)
{
    return consensus->bound_count > 0 ? consensus->node_count : 0;
}

int32_t cairn_pose_consensus_within_bounds(const cairn_pose_consensus *consensus, int32_t part,
                                           int32_t node, const cairn_pose_consensus_pose *candidate,
                                           cairn_pose *map_part)
{
    struct fit fit = {{0, 0}, {0, 0}, 0, 0, 0};
    cairn_pose motion = {0, 0, 0};
    const cairn_pose_consensus_pose *pose;
    int32_t within = 1;

    if (map_part != NULL)
        *map_part = motion;
    for (int32_t i = 0; i < consensus->node_count && consensus->bound_count > 0; i++)
        if ((pose = bounded_pose(consensus, i, part, node, candidate)) != NULL)
            add_centre(&fit, &consensus->bounds[i], pose);
    if (!(fit.weight > 0))
        return 1;
    fit.from = cairn_vec2_scale(fit.from, 1 / fit.weight);
    fit.to = cairn_vec2_scale(fit.to, 1 / fit.weight);
    for (int32_t i = 0; i < consensus->node_count; i++)
        if ((pose = bounded_pose(consensus, i, part, node, candidate)) != NULL)
            add_turn(&fit, &consensus->bounds[i], pose);
    motion = cairn_pose_from_moments(fit.from, fit.to, fit.dot, fit.cross);
    for (int32_t i = 0; i < consensus->node_count && within; i++)
        if ((pose = bounded_pose(consensus, i, part, node, candidate)) != NULL)
            within = is_within(&consensus->bounds[i], motion, pose);
    if (map_part != NULL)
        *map_part = motion;
    return within;
}

/* ---- Relaxation: Gauss-Newton, one node at a time ---- */

/* Jacobian of a hypothesis' residual by (x, y, theta) of one of its nodes in the map, by
 * columns. */
static void residual_columns(const cairn_pose_consensus_pose *map_first,
                             const cairn_pose_consensus_pose *map_second, int32_t of_first,
                             cairn_real columns[3][3])
{
    cairn_transform a = map_first->transform;
    cairn_vec2 offset = {map_second->transform.x - a.x, map_second->transform.y - a.y},
               seen = cairn_transform_inverse_direction(a, offset);
    cairn_real sign = of_first ? -1 : 1;

    columns[0][0] = sign * a.cosine;
    columns[0][1] = -sign * a.sine;
    columns[0][2] = 0;
    columns[1][0] = sign * a.sine;
    columns[1][1] = sign * a.cosine;
    columns[1][2] = 0;
    columns[2][0] = of_first ? seen.y : 0;
    columns[2][1] = of_first ? -seen.x : 0;
    columns[2][2] = sign;
}

/* Adds the normal equations of one hypothesis for one of its nodes. */
static void add_terms(const cairn_pose_consensus *consensus,
                      const cairn_pose_consensus_hypothesis *hypothesis, int32_t node,
                      cairn_sym3 *information, cairn_real gradient[3])
{
    const cairn_pose_consensus_pose *first = &consensus->current[hypothesis->first].pose,
                                    *second = &consensus->current[hypothesis->second].pose;
    cairn_real columns[3][3], weighted[3][3], residual[3];
    cairn_real weight =
        weight_of(consensus, cairn_pose_consensus_chi2(hypothesis, first, second, residual));

    residual_columns(first, second, hypothesis->first == node, columns);
    for (int k = 0; k < 3; k++) {
        cairn_sym3_times(hypothesis->information, columns[k], weighted[k]);
        gradient[k] += weight * cairn_dot3(weighted[k], residual);
    }
    information->xx += weight * cairn_dot3(weighted[0], columns[0]);
    information->xy += weight * cairn_dot3(weighted[0], columns[1]);
    information->xz += weight * cairn_dot3(weighted[0], columns[2]);
    information->yy += weight * cairn_dot3(weighted[1], columns[1]);
    information->yz += weight * cairn_dot3(weighted[1], columns[2]);
    information->zz += weight * cairn_dot3(weighted[2], columns[2]);
}

cairn_sym3 cairn_pose_consensus_information(const cairn_pose_consensus *consensus, int32_t node,
                                            cairn_real gradient[3])
{
    const cairn_pose_consensus_assignment *here = &consensus->current[node];
    cairn_sym3 information = cairn_sym3_zero();

    gradient[0] = gradient[1] = gradient[2] = 0;
    for (int32_t l = consensus->first_link[node], to; l < consensus->first_link[node + 1]; l = to) {
        const cairn_pose_consensus_assignment *other =
            &consensus->current[consensus->links[l].other];
        cairn_real earned, strongest;
        int32_t h = best_of_pair(consensus, node, &here->pose, l, &to, &earned, &strongest);

        if (h >= 0 && other->component == here->component)
            add_terms(consensus, &consensus->hypotheses[h], node, &information, gradient);
    }
    return information;
}

/* One Gauss-Newton step of a node given the others. */
static void relax_node(cairn_pose_consensus *consensus, int32_t node)
{
    cairn_pose_consensus_assignment *here = &consensus->current[node];
    cairn_real gradient[3], step[3];
    cairn_sym3 information = cairn_pose_consensus_information(consensus, node, gradient);

    if (here->component >= 0 && cairn_sym3_solve(information, gradient, step)) {
        cairn_pose moved = {here->pose.transform.x - step[0], here->pose.transform.y - step[1],
                            cairn_wrap_angle(here->pose.theta - step[2])};

        here->pose = cairn_pose_consensus_pose_of(moved);
    }
}

int cairn_pose_consensus_relax(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(consensus->resume.part);
    for (; consensus->sweeps > 0; consensus->sweeps--)
        for (consensus->visited = 0; consensus->visited < consensus->node_count;
             consensus->visited++) {
            CAIRN_STEP_CHARGE(consensus, resume.part, budget,
                              1 + cairn_pose_consensus_link_units(consensus, consensus->visited));
            relax_node(consensus, consensus->visited);
        }
    CAIRN_STEP_END(consensus->resume.part);
}
