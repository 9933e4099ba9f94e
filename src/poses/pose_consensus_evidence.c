/* pose_consensus: support of a pose by hypotheses, likelihood functions and bounds; relaxation.
 * pose_consensus.c describes the method. */
#include "src/base/build.h"

#include "src/poses/pose_consensus_work.h"

/* Tolerance factor of bounds: the common motion minimises squares, not the largest error. */
static const cairn_real BOUND_SLACK = CAIRN_REAL(1.5);
static const cairn_real SAME_POSE_SIGMAS = 5;
/* Factor on max_chi2 for cycles, which carry the errors of two hypotheses more. */
static const cairn_real CYCLE_GATE = 3;

cairn_pose_consensus_pose cairn_pose_consensus_pose_of(cairn_pose pose)
{
    cairn_pose_consensus_pose turned;

    turned.transform = cairn_transform_of(pose);
    turned.theta = pose.theta;
    return turned;
}

cairn_pose cairn_pose_consensus_to_pose(cairn_pose_consensus_pose turned)
{
    cairn_pose pose = {turned.transform.x, turned.transform.y, cairn_wrap_angle(turned.theta)};

    return pose;
}

/* Angles are sums of theta, from which sine and cosine are computed anew: repeated products would
 * drift. */
cairn_pose_consensus_pose cairn_pose_consensus_compose(cairn_pose_consensus_pose a_b,
                                                       cairn_pose_consensus_pose b_c)
{
    cairn_vec2 origin = {b_c.transform.x, b_c.transform.y},
               moved = cairn_transform_point(a_b.transform, origin);
    cairn_pose a_c = {moved.x, moved.y, cairn_wrap_angle(a_b.theta + b_c.theta)};

    return cairn_pose_consensus_pose_of(a_c);
}

cairn_pose_consensus_pose cairn_pose_consensus_inverse(cairn_pose_consensus_pose a_b)
{
    return cairn_pose_consensus_pose_of(cairn_pose_inverse(cairn_pose_consensus_to_pose(a_b)));
}

int32_t cairn_pose_consensus_is_same_pose(const cairn_pose_consensus *consensus,
                                          cairn_pose_consensus_pose a, cairn_pose_consensus_pose b)
{
    cairn_real x = a.transform.x - b.transform.x, y = a.transform.y - b.transform.y;
    cairn_real reach = SAME_POSE_SIGMAS * consensus->params.sigma;

    return x * x + y * y <= reach * reach && cairn_abs(cairn_wrap_angle(a.theta - b.theta)) <=
                                                 SAME_POSE_SIGMAS * consensus->params.sigma_theta;
}

cairn_real cairn_pose_consensus_chi2(const cairn_pose_consensus_hypothesis *hypothesis,
                                     cairn_pose_consensus_pose map_first,
                                     cairn_pose_consensus_pose map_second, cairn_real residual[3])
{
    cairn_transform a = map_first.transform, z = hypothesis->first_second.transform;
    cairn_vec2 offset = {map_second.transform.x - a.x, map_second.transform.y - a.y},
               seen = cairn_transform_inverse_direction(a, offset);
    cairn_real error[3] = {
        seen.x - z.x, seen.y - z.y,
        cairn_wrap_angle(map_second.theta - map_first.theta - hypothesis->first_second.theta)};

    for (int k = 0; k < 3 && residual != NULL; k++)
        residual[k] = error[k];
    return cairn_sym3_form(hypothesis->information, error);
}

/* Returns the weight of a hypothesis' score: 1 at its mode, 0 from max_chi2 on. */
static cairn_real weight_of(const cairn_pose_consensus *consensus, cairn_real chi)
{
    return cairn_max(1 - chi / consensus->params.max_chi2, 0);
}

int32_t cairn_pose_consensus_best_of_pair(const cairn_pose_consensus *consensus, int32_t node,
                                          cairn_pose_consensus_pose map_node, int32_t from,
                                          cairn_pose_consensus_pose map_other, int32_t *to,
                                          cairn_real *earned, cairn_real *strongest)
{
    const cairn_pose_consensus_link *links = consensus->links;
    int32_t other = links[from].other, best = -1, l = from;

    *earned = *strongest = 0;
    for (; l < consensus->first_link[node + 1] && links[l].other == other; l++) {
        const cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[links[l].hypothesis];
        cairn_real chi = h->first == node ? cairn_pose_consensus_chi2(h, map_node, map_other, NULL)
                                          : cairn_pose_consensus_chi2(h, map_other, map_node, NULL);
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

/* Returns the pairwise log-likelihood ratio of two placed nodes. */
static cairn_real pairwise_likelihood(const cairn_pose_consensus *consensus, int32_t node,
                                      cairn_pose_consensus_pose map_node, int32_t other,
                                      int32_t *units)
{
    int32_t first = node < other ? node : other, second = node < other ? other : node, cost = 1;
    cairn_pose here = cairn_pose_consensus_to_pose(map_node);
    cairn_pose there = cairn_pose_consensus_to_pose(consensus->current[other].pose);
    cairn_pose first_second =
        node < other ? cairn_pose_between(here, there) : cairn_pose_between(there, here);
    cairn_real evidence =
        consensus->pair_likelihood(consensus->pair_context, first, second, first_second, &cost);

    *units += cost > 1 ? cost : 1;
    return cairn_is_finite(evidence) ? evidence : 0;
}

static void add_support(cairn_pose_consensus_support *support, cairn_real evidence)
{
    support->sum += evidence;
    support->violations -= cairn_min(evidence, 0);
    support->agreeing += evidence > 0;
    support->conflicting += evidence < 0;
}

/* Support by hypotheses alone. */
static void support_by_links(const cairn_pose_consensus *consensus, int32_t node,
                             cairn_pose_consensus_pose map_node, int32_t part,
                             cairn_pose_consensus_support *support)
{
    for (int32_t l = consensus->first_link[node], to; l < consensus->first_link[node + 1]; l = to) {
        const cairn_pose_consensus_assignment *other =
            &consensus->current[consensus->links[l].other];
        cairn_real earned, strongest;

        (void)cairn_pose_consensus_best_of_pair(consensus, node, map_node, l, other->pose, &to,
                                                &earned, &strongest);
        if (other->component == part)
            add_support(support,
                        earned > 0 ? earned : -consensus->params.conflict_penalty * strongest);
    }
}

cairn_real cairn_pose_consensus_pair_likelihood(const cairn_pose_consensus *consensus, int32_t node,
                                                cairn_pose_consensus_pose map_node, int32_t other,
                                                int32_t *link, int32_t *units)
{
    cairn_real earned = 0, strongest;

    while (*link < consensus->first_link[node + 1] && consensus->links[*link].other < other)
        ++*link;
    if (*link < consensus->first_link[node + 1] && consensus->links[*link].other == other)
        (void)cairn_pose_consensus_best_of_pair(consensus, node, map_node, *link,
                                                consensus->current[other].pose, link, &earned,
                                                &strongest);
    if (consensus->pair_likelihood != NULL) {
        cairn_real likelihood = pairwise_likelihood(consensus, node, map_node, other, units);

        earned = earned > 0 ? cairn_max(earned, likelihood) : likelihood;
    }
    return earned;
}

/* Support by hypotheses and the pairwise likelihood. */
static void support_by_pairs(const cairn_pose_consensus *consensus, int32_t node,
                             cairn_pose_consensus_pose map_node, int32_t part,
                             cairn_pose_consensus_support *support)
{
    int32_t link = consensus->first_link[node];

    for (int32_t other = 0; other < consensus->node_count; other++)
        if (other != node && consensus->current[other].component == part)
            add_support(support, cairn_pose_consensus_pair_likelihood(
                                     consensus, node, map_node, other, &link, &support->units));
}

/* Support by the joint likelihood; agreeing and conflicting pairs are counted by hypotheses. */
static void support_by_joint(const cairn_pose_consensus *consensus, int32_t node,
                             cairn_pose_consensus_pose map_node, int32_t part,
                             cairn_pose_consensus_support *support)
{
    int32_t cost = 1;
    cairn_real evidence, against = 0;

    support_by_links(consensus, node, map_node, part, support);
    for (int32_t i = 0; i < consensus->node_count; i++) {
        consensus->joint_poses[i] = cairn_pose_consensus_to_pose(consensus->current[i].pose);
        consensus->joint_components[i] = consensus->current[i].component;
    }
    evidence = consensus->joint_likelihood(
        consensus->joint_context, node, cairn_pose_consensus_to_pose(map_node),
        consensus->joint_poses, consensus->joint_components, part, &against, &cost);
    support->sum = cairn_is_finite(evidence) ? evidence : 0;
    support->violations = cairn_is_finite(against) ? against : 0;
    support->units += consensus->node_count / 4 + (cost > 1 ? cost : 1);
}

cairn_pose_consensus_support cairn_pose_consensus_support_of(const cairn_pose_consensus *consensus,
                                                             int32_t node,
                                                             cairn_pose_consensus_pose map_node,
                                                             int32_t part, int32_t by_likelihood)
{
    cairn_pose_consensus_support support = {0, 0, 0, 0, 1};

    support.units += (consensus->first_link[node + 1] - consensus->first_link[node]) / 4;
    if (by_likelihood && consensus->joint_likelihood != NULL)
        support_by_joint(consensus, node, map_node, part, &support);
    else if (by_likelihood && consensus->pair_likelihood != NULL)
        support_by_pairs(consensus, node, map_node, part, &support);
    else
        support_by_links(consensus, node, map_node, part, &support);
    return support;
}

int32_t cairn_pose_consensus_is_significant(const cairn_pose_consensus *consensus,
                                            cairn_real support, cairn_real against)
{
    return support - against >= consensus->params.significant_support;
}

/* ---- Cycle consistency ---- */

cairn_pose_consensus_pose
cairn_pose_consensus_relative_to(const cairn_pose_consensus_hypothesis *hypothesis, int32_t node)
{
    return hypothesis->first == node ? hypothesis->first_second : hypothesis->second_first;
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

/* Returns the score of the best cycle of h through one third node, over links a[0] ... a[1]-1 of
 * the first and b[0] ... b[1]-1 of the second node. */
static cairn_real best_cycle(cairn_pose_consensus *consensus,
                             const cairn_pose_consensus_hypothesis *hypothesis, const int32_t a[2],
                             const int32_t b[2])
{
    const cairn_pose_consensus_pose here = {{0, 0, 1, 0}, 0};
    cairn_real best = 0;

    for (int32_t i = a[0]; i < a[1]; i++)
        for (int32_t j = b[0]; j < b[1]; j++) {
            const cairn_pose_consensus_hypothesis *to =
                &consensus->hypotheses[consensus->links[i].hypothesis];
            const cairn_pose_consensus_hypothesis *on =
                &consensus->hypotheses[consensus->links[j].hypothesis];
            cairn_pose_consensus_pose way = cairn_pose_consensus_relative_to(to, hypothesis->first),
                                      rest = cairn_pose_consensus_relative_to(
                                          on, consensus->links[j].other);
            cairn_vec2 position = {rest.transform.x, rest.transform.y};
            cairn_real share;

            position = cairn_transform_point(way.transform, position);
            way.transform.x = position.x;
            way.transform.y = position.y;
            way.theta += rest.theta;
            share = 1 - cairn_pose_consensus_chi2(hypothesis, here, way, NULL) /
                            (CYCLE_GATE * consensus->params.max_chi2);
            best = cairn_max(best,
                             share * cairn_min(hypothesis->score, cairn_min(to->score, on->score)));
        }
    consensus->units_due += 1 + (a[1] - a[0]) * (b[1] - b[0]) / 2;
    return best;
}

void cairn_pose_consensus_add_cycles(cairn_pose_consensus *consensus)
{
    cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[consensus->next++];
    int32_t a[2] = {consensus->first_link[h->first], 0},
            b[2] = {consensus->first_link[h->second], 0};

    h->cycle_score = 0;
    while (a[0] < consensus->first_link[h->first + 1] &&
           b[0] < consensus->first_link[h->second + 1]) {
        int32_t third = consensus->links[a[0]].other, other = consensus->links[b[0]].other;

        a[1] = end_of_pair(consensus, h->first, a[0]);
        b[1] = end_of_pair(consensus, h->second, b[0]);
        if (third == other)
            h->cycle_score += best_cycle(consensus, h, a, b);
        if (third <= other)
            a[0] = a[1];
        if (other <= third)
            b[0] = b[1];
    }
    consensus->units_due++;
}

/* ---- Bounds ---- */

/* Sums over nodes with bounds for the least-squares common motion. */
struct fit {
    cairn_vec2 from, to; /* weighted means */
    cairn_real weight, dot, cross;
};

static void add_centre(struct fit *fit, const cairn_pose_consensus_bound *bound,
                       cairn_pose_consensus_pose pose)
{
    cairn_real weight = 1 / (bound->metres * bound->metres);

    fit->weight += weight;
    fit->from.x += weight * pose.transform.x;
    fit->from.y += weight * pose.transform.y;
    fit->to.x += weight * bound->centre.x;
    fit->to.y += weight * bound->centre.y;
}

static void add_turn(struct fit *fit, const cairn_pose_consensus_bound *bound,
                     cairn_pose_consensus_pose pose)
{
    cairn_real weight = 1 / (bound->metres * bound->metres),
               turns = 1 / (bound->radians * bound->radians);
    cairn_vec2 from = {pose.transform.x - fit->from.x, pose.transform.y - fit->from.y};
    cairn_vec2 to = {bound->centre.x - fit->to.x, bound->centre.y - fit->to.y};
    cairn_real by = bound->centre.theta - pose.theta;

    fit->dot += weight * cairn_vec2_dot(from, to) + turns * cairn_cos(by);
    fit->cross += weight * cairn_vec2_cross(from, to) + turns * cairn_sin(by);
}

static int is_within(const cairn_pose_consensus_bound *bound, cairn_pose map_part,
                     cairn_pose_consensus_pose pose)
{
    cairn_pose placed = cairn_pose_compose(map_part, cairn_pose_consensus_to_pose(pose));
    cairn_real x = placed.x - bound->centre.x, y = placed.y - bound->centre.y,
               reach = BOUND_SLACK * bound->metres;

    return x * x + y * y <= reach * reach &&
           cairn_abs(cairn_wrap_angle(placed.theta - bound->centre.theta)) <=
               BOUND_SLACK * bound->radians;
}

/* Finds the pose of a bounded node of the component, or of the candidate; returns 0 when it is
 * neither, or has no bound. */
static int bounded_pose(const cairn_pose_consensus *consensus, int32_t i, int32_t part,
                        int32_t node, cairn_pose_consensus_pose candidate,
                        cairn_pose_consensus_pose *pose)
{
    *pose = i == node ? candidate : consensus->current[i].pose;
    return consensus->bounds[i].metres > 0 &&
           (i == node || consensus->current[i].component == part);
}

int32_t cairn_pose_consensus_within_bounds(const cairn_pose_consensus *consensus, int32_t part,
                                           int32_t node, cairn_pose_consensus_pose candidate,
                                           cairn_pose *map_part)
{
    struct fit fit = {{0, 0}, {0, 0}, 0, 0, 0};
    cairn_pose motion = {0, 0, 0};
    cairn_pose_consensus_pose pose;
    int32_t within = 1;

    if (map_part != NULL)
        *map_part = motion;
    for (int32_t i = 0; i < consensus->node_count && consensus->bound_count > 0; i++)
        if (bounded_pose(consensus, i, part, node, candidate, &pose))
            add_centre(&fit, &consensus->bounds[i], pose);
    if (!(fit.weight > 0))
        return 1;
    fit.from = cairn_vec2_scale(fit.from, 1 / fit.weight);
    fit.to = cairn_vec2_scale(fit.to, 1 / fit.weight);
    for (int32_t i = 0; i < consensus->node_count; i++)
        if (bounded_pose(consensus, i, part, node, candidate, &pose))
            add_turn(&fit, &consensus->bounds[i], pose);
    motion = cairn_pose_from_moments(fit.from, fit.to, fit.dot, fit.cross);
    for (int32_t i = 0; i < consensus->node_count && within; i++)
        if (bounded_pose(consensus, i, part, node, candidate, &pose))
            within = is_within(&consensus->bounds[i], motion, pose);
    if (map_part != NULL)
        *map_part = motion;
    return within;
}

/* ---- Relaxation: Gauss-Newton, one node at a time ---- */

/* Jacobian of a hypothesis' residual by (x, y, theta) of one of its nodes in the map, by
 * columns. */
static void residual_columns(cairn_pose_consensus_pose map_first,
                             cairn_pose_consensus_pose map_second, int32_t of_first,
                             cairn_real columns[3][3])
{
    cairn_transform a = map_first.transform;
    cairn_vec2 offset = {map_second.transform.x - a.x, map_second.transform.y - a.y},
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
    cairn_pose_consensus_pose first = consensus->current[hypothesis->first].pose,
                              second = consensus->current[hypothesis->second].pose;
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
        int32_t h = cairn_pose_consensus_best_of_pair(consensus, node, here->pose, l, other->pose,
                                                      &to, &earned, &strongest);

        if (h >= 0 && other->component == here->component)
            add_terms(consensus, &consensus->hypotheses[h], node, &information, gradient);
    }
    return information;
}

void cairn_pose_consensus_relax(cairn_pose_consensus *consensus, int32_t node)
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
