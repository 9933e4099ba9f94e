/* The graph of key scans and their correction.
 *
 * Method. Every key scan is linked to the one before by how the local map and the force field left them, with the covariance
 * of its match; closures join those that are far apart in time. A correction solves for all key scans (pose_graph), is
 * taken over as a whole, and moves the key scans that came since along with the last one that it knows. A closure that is an
 * outlier afterwards is dropped, and the correction repeated. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/mapper_work.h"

/* A correction costs about as much as looking for so many key scans, in parts of those in the graph. */
enum { SOLVE_SHARE = 48 };

static const cairn_real LOOSE = 1; /* m and rad: of what a key scan of the local map tells nothing */
static const cairn_real TELLS_MUCH = 4; /* times the information, of all directions together */
static const cairn_real LEAST_SHARE = CAIRN_REAL(0.1); /* of all information, of a key scan on which others hang */
static const cairn_real DOUBTFUL = CAIRN_REAL(0.3), DOUBTFUL_TURN = CAIRN_REAL(0.15);
static const cairn_real STRAINED = 100; /* chi2 of a closure that asks for a correction at once */

cairn_sym3 cairn_mapper_own_covariance(const cairn_mapper *mapper, const cairn_real covariance[9], cairn_real theta)
{
    const cairn_mapper_loop_params *p = &mapper->params.loop;
    cairn_sym3 own, in_map = {covariance[0], covariance[1], covariance[2], covariance[4], covariance[5], covariance[8]};
    cairn_real s, c;

    cairn_sincos(-theta, &s, &c);
    own = in_map;
    own.xx = c * c * in_map.xx - 2 * c * s * in_map.xy + s * s * in_map.yy;
    own.yy = s * s * in_map.xx + 2 * c * s * in_map.xy + c * c * in_map.yy;
    own.xy = c * s * (in_map.xx - in_map.yy) + (c * c - s * s) * in_map.xy;
    own.xz = c * in_map.xz - s * in_map.yz;
    own.yz = s * in_map.xz + c * in_map.yz;
    own.xx += p->sigma * p->sigma;
    own.yy += p->sigma * p->sigma;
    own.zz += p->sigma_turn * p->sigma_turn;
    return own;
}

/* ---- Ties ---- */

/* Covariance of the scan at hand seen from one key scan of the local map, by its pairs with that one and by the prior. Where the
 * pairs tell little, that little is noise of their normals. */
static cairn_sym3 part_covariance(const cairn_mapper *mapper, int32_t part, const cairn_pose_prior *prior)
{
    const cairn_icp_parts *parts = &mapper->parts;
    cairn_normal_equations known = cairn_rigid_motion_prior(&parts->motion, prior);
    cairn_real covariance[9];
    cairn_motion_basis basis;
    int32_t has_pairs = part >= 0 && parts->information[part].xx + parts->information[part].yy > 0;

    if (has_pairs)
        basis = cairn_motion_basis_of(parts->information[part], mapper->params.icp.weak_ratio);
    cairn_rigid_motion_covariance(&parts->motion, has_pairs ? &basis : NULL,
                                  has_pairs ? &parts->information[part] : NULL, &known, covariance);
    return cairn_mapper_own_covariance(mapper, covariance, parts->motion.map_body.theta);
}

static cairn_real determinant(cairn_sym3 m)
{
    return m.xx * (m.yy * m.zz - m.yz * m.yz) - m.xy * (m.xy * m.zz - m.yz * m.xz) + m.xz * (m.xy * m.yz - m.yy * m.xz);
}

/* Information of both. */
static cairn_sym3 joined(cairn_sym3 a, cairn_sym3 b)
{
    cairn_sym3 out = {a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yy + b.yy, a.yz + b.yz, a.zz + b.zz};

    return out;
}

/* 1 when enough pairs are with a part: a few may be with somebody who walks there. */
static int32_t tells_enough(const cairn_mapper *mapper, int32_t part)
{
    const cairn_icp_parts *parts = &mapper->parts;
    cairn_real all = 0;

    for (int32_t i = 0; i < parts->count; i++)
        all += parts->information[i].xx + parts->information[i].yy;
    return parts->information[part].xx + parts->information[part].yy > LEAST_SHARE * all;
}

/* Hangs the scan at hand on one more key scan of its local map, that which tells most of what is not known; 0 when none tells
 * much. known: information so far. */
static int32_t add_anchor(const cairn_mapper *mapper, mapper_tie *tie, cairn_sym3 *known)
{
    cairn_pose_prior loose = {mapper->match.target_query, LOOSE, LOOSE, LOOSE};
    cairn_real best = TELLS_MUCH * determinant(*known);
    cairn_sym3 covariance, information, told = cairn_sym3_zero();
    int32_t at = tie->anchor_count, found = 0;

    for (int32_t part = 0; part < mapper->parts.count && part < mapper->local_count; part++) {
        int32_t key = mapper->local[part];

        if (key == mapper->keys->scan_count - 2 || mapper->loop.ties[key].doubtful || !tells_enough(mapper, part))
            continue;
        covariance = part_covariance(mapper, part, &loose);
        if (!cairn_sym3_inverse(covariance, &information) || !(determinant(joined(*known, information)) > best))
            continue;
        best = determinant(joined(*known, information));
        told = information;
        tie->anchors[at] = key;
        tie->anchor_covariance[at] = covariance;
        found = 1;
    }
    *known = joined(*known, told);
    tie->anchor_count += found;
    return found;
}

static int32_t part_of(const cairn_mapper *mapper, int32_t key)
{
    for (int32_t part = 0; part < mapper->parts.count && part < mapper->local_count; part++)
        if (mapper->local[part] == key)
            return part;
    return -1;
}

int32_t cairn_mapper_hang_on(const cairn_mapper *mapper)
{
    int32_t last = mapper->keys->scan_count - 1, best = last;
    cairn_pose_prior prior = cairn_mapper_prior(mapper);
    cairn_real least;

    if (!mapper->has_match || mapper->loop.graph == NULL || mapper->doubtful)
        return last;
    prior.mean = mapper->match.target_query;
    least = determinant(part_covariance(mapper, part_of(mapper, last), &prior)) / TELLS_MUCH;
    if (mapper->loop.ties[last].doubtful)
        least = LOOSE;
    prior.sigma_x = prior.sigma_y = prior.sigma_theta = LOOSE;
    for (int32_t part = 0; part < mapper->parts.count && part < mapper->local_count; part++) {
        cairn_real d;

        if (mapper->local[part] == last || mapper->loop.ties[mapper->local[part]].doubtful ||
            !tells_enough(mapper, part))
            continue;
        d = determinant(part_covariance(mapper, part, &prior));
        if (!(d < least))
            continue;
        least = d;
        best = mapper->local[part];
    }
    return best;
}

void cairn_mapper_tie(const cairn_mapper *mapper, mapper_tie *tie)
{
    int32_t before = mapper->keys->scan_count - 2, part;
    cairn_pose_prior prior = cairn_mapper_prior(mapper);
    cairn_sym3 known;

    memset(tie, 0, sizeof *tie);
    tie->doubtful = mapper->doubtful;
    if (before < 0)
        return;
    if (!mapper->has_match) {
        cairn_real unmatched[9] = {0};

        unmatched[0] = unmatched[4] = prior.sigma_x * prior.sigma_x;
        unmatched[8] = prior.sigma_theta * prior.sigma_theta;
        tie->covariance = cairn_mapper_own_covariance(mapper, unmatched, 0);
        return;
    }
    part = part_of(mapper, before);
    prior.mean = mapper->match.target_query;
    tie->covariance = part_covariance(mapper, part, &prior);
    {
        cairn_sym3 doubt = cairn_mapper_own_covariance(mapper, mapper->doubt, mapper->match.target_query.theta);

        tie->covariance = joined(tie->covariance, doubt);
    }
    if (mapper->loop.ties[before].doubtful) {
        tie->covariance.xx += DOUBTFUL * DOUBTFUL;
        tie->covariance.yy += DOUBTFUL * DOUBTFUL;
        tie->covariance.zz += DOUBTFUL_TURN * DOUBTFUL_TURN;
    }
    if (tie->doubtful || !cairn_sym3_inverse(tie->covariance, &known))
        return;
    while (tie->anchor_count < MAPPER_ANCHORS && add_anchor(mapper, tie, &known))
        continue;
}

/* ---- The graph ---- */

static void hang_link(mapper_loop *loop, int32_t key, int32_t link, int32_t end)
{
    loop->links[link].next[end] = loop->first_link[key];
    loop->first_link[key] = link;
}

static cairn_status add_link(cairn_mapper *mapper, int32_t first, int32_t second, cairn_pose first_second,
                             cairn_sym3 covariance, int32_t is_loop)
{
    mapper_loop *loop = &mapper->loop;
    mapper_link *link = &loop->links[loop->link_count];
    cairn_sym3 information;
    cairn_status status;

    if (!cairn_sym3_inverse(covariance, &information))
        return CAIRN_BAD_ARGUMENT;
    status = cairn_pose_graph_add_link(loop->graph, first, second, first_second, information);
    if (status != CAIRN_OK)
        return status;
    link->first = first;
    link->second = second;
    link->variance = covariance.xx + covariance.yy;
    link->turn_variance = covariance.zz;
    link->is_loop = is_loop;
    link->dropped = 0;
    hang_link(loop, first, loop->link_count, 0);
    hang_link(loop, second, loop->link_count, 1);
    loop->link_count++;
    return CAIRN_OK;
}

cairn_status cairn_mapper_enter(cairn_mapper *mapper)
{
    mapper_loop *loop = &mapper->loop;
    int32_t key = loop->entered;
    cairn_status status = cairn_pose_graph_add_pose(loop->graph, mapper->key_pose[key]);

    CAIRN_ASSERT(status == CAIRN_OK);
    loop->first_link[key] = -1;
    loop->entered++;
    if (key > 0)
        status = add_link(mapper, key - 1, key, cairn_pose_between(mapper->key_pose[key - 1], mapper->key_pose[key]),
                          loop->ties[key].covariance, 0);
    for (int32_t i = 0; i < loop->ties[key].anchor_count && status == CAIRN_OK; i++) {
        int32_t anchor = loop->ties[key].anchors[i];

        if (loop->link_count - loop->entered + 1 >= mapper->params.loop.max_loops)
            break;
        status = add_link(mapper, anchor, key, cairn_pose_between(mapper->key_pose[anchor], mapper->key_pose[key]),
                          loop->ties[key].anchor_covariance[i], 0);
    }
    return status;
}

/* e^T Omega e of a measured pose at the poses as they are. */
static cairn_real strain_of(const cairn_mapper *mapper, int32_t first, int32_t second, cairn_pose first_second,
                            cairn_sym3 covariance)
{
    cairn_pose e =
        cairn_pose_between(first_second, cairn_pose_between(mapper->key_pose[first], mapper->key_pose[second]));
    cairn_real error[3], solved[3];

    error[0] = e.x;
    error[1] = e.y;
    error[2] = e.theta;
    if (!cairn_sym3_solve(covariance, error, solved))
        return 0;
    return error[0] * solved[0] + error[1] * solved[1] + error[2] * solved[2];
}

cairn_status cairn_mapper_add_closure(cairn_mapper *mapper, int32_t first, int32_t second, cairn_pose first_second,
                                      cairn_sym3 covariance)
{
    mapper_loop *loop = &mapper->loop;
    cairn_status status;

    if (loop->link_count - (loop->entered - 1) == mapper->params.loop.max_loops)
        return CAIRN_FULL;
    status = add_link(mapper, first, second, first_second, covariance, 1);
    if (status != CAIRN_OK)
        return status;
    loop->strain = cairn_max(loop->strain, strain_of(mapper, first, second, first_second, covariance));
    loop->fresh++;
    mapper->state.loops++;
    return CAIRN_OK;
}

int32_t cairn_mapper_wants_solution(const cairn_mapper *mapper)
{
    const mapper_loop *loop = &mapper->loop;

    if (loop->fresh == 0 || loop->unsolvable)
        return 0;
    return loop->strain > STRAINED || loop->searched > 8 + loop->entered / SOLVE_SHARE;
}

/* Takes the solution over. */
static void correct_keys(cairn_mapper *mapper)
{
    mapper_loop *loop = &mapper->loop;
    int32_t last = loop->entered - 1;
    cairn_pose before = mapper->key_pose[last], after = cairn_pose_graph_pose(loop->graph, last);

    for (int32_t key = 0; key <= last; key++)
        mapper->key_pose[key] = cairn_pose_graph_pose(loop->graph, key);
    for (int32_t key = last + 1; key < mapper->keys->scan_count; key++)
        mapper->key_pose[key] = cairn_pose_compose(after, cairn_pose_between(before, mapper->key_pose[key]));
    mapper->target_stale = 1;
    mapper->state.solutions++;
}

/* Drops the closures that are outliers; returns how many. */
static int32_t drop_outliers(cairn_mapper *mapper)
{
    mapper_loop *loop = &mapper->loop;
    int32_t dropped = 0;

    for (int32_t i = 0; i < loop->link_count; i++) {
        mapper_link *link = &loop->links[i];

        if (!link->is_loop || link->dropped ||
            !(cairn_pose_graph_link_of(loop->graph, i).chi2 > mapper->params.loop.outlier) ||
            cairn_pose_graph_drop_link(loop->graph, i, 1) != CAIRN_OK)
            continue;
        link->dropped = 1;
        cairn_mapper_loop_tell(mapper, link->first, link->second, cairn_pose_identity(), CAIRN_MAPPER_LOOP_DROPPED);
        dropped++;
    }
    mapper->state.loops -= dropped;
    return dropped;
}

cairn_status cairn_mapper_solve_step(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_loop *loop = &mapper->loop;
    cairn_status status = CAIRN_OK;

    if (loop->cursor == 0) {
        budget->left -= 1 + (loop->entered + loop->link_count) / 8;
        loop->cursor = 1;
        return cairn_pose_graph_solve(loop->graph);
    }
    status = cairn_pose_graph_step(loop->graph, budget);
    if (status == CAIRN_MORE)
        return status;
    loop->phase = LOOP_IDLE;
    loop->cursor = 0;
    loop->fresh = loop->searched = 0;
    loop->strain = 0;
    if (status != CAIRN_OK) {
        loop->unsolvable = 1;
        mapper->state.lacks_room = 2;
        return CAIRN_OK;
    }
    budget->left -= 1 + mapper->keys->scan_count / 4 + loop->link_count / 8;
    correct_keys(mapper);
    if (drop_outliers(mapper) > 0)
        loop->fresh = 1;
    return CAIRN_OK;
}
