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
static const cairn_real RIGID = CAIRN_REAL(0.05), RIGID_TURN = CAIRN_REAL(0.03);
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

static int32_t piece_of(const cairn_mapper *mapper, int32_t part)
{
    return mapper->loop.ties[mapper->local[part]].piece;
}

static int32_t part_count(const cairn_mapper *mapper)
{
    return mapper->parts.count < mapper->local_count ? mapper->parts.count : mapper->local_count;
}

/* Information of both. */
static cairn_sym3 joined(cairn_sym3 a, cairn_sym3 b)
{
    cairn_sym3 out = {a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yy + b.yy, a.yz + b.yz, a.zz + b.zz};

    return out;
}

/* What the pairs with a piece of the map tell. */
static cairn_sym3 told_by(const cairn_mapper *mapper, int32_t piece)
{
    cairn_sym3 told = cairn_sym3_zero();

    for (int32_t part = 0; part < part_count(mapper); part++)
        if (piece_of(mapper, part) == piece)
            told = joined(told, mapper->parts.information[part]);
    return told;
}

/* Covariance of the scan at hand seen from a piece of the map, by its pairs with that and by the prior, in its own frame. Where the
 * pairs tell little, that little is noise of their normals. */
static cairn_sym3 seen_from(const cairn_mapper *mapper, int32_t piece, const cairn_pose_prior *prior)
{
    cairn_sym3 told = told_by(mapper, piece);
    const cairn_rigid_motion *motion = &mapper->parts.motion;
    cairn_normal_equations known = cairn_rigid_motion_prior(motion, prior);
    cairn_real covariance[9];
    cairn_motion_basis basis;
    int32_t has_pairs = told.xx + told.yy > 0;

    if (has_pairs)
        basis = cairn_motion_basis_of(told, mapper->params.icp.weak_ratio);
    cairn_rigid_motion_covariance(motion, has_pairs ? &basis : NULL, has_pairs ? &told : NULL, &known, covariance);
    return cairn_mapper_own_covariance(mapper, covariance, motion->map_body.theta);
}

static cairn_real determinant(cairn_sym3 m)
{
    return m.xx * (m.yy * m.zz - m.yz * m.yz) - m.xy * (m.xy * m.zz - m.yz * m.xz) + m.xz * (m.xy * m.yz - m.yy * m.xz);
}

/* The last key scan of the local map that is of a piece. */
static int32_t last_of(const cairn_mapper *mapper, int32_t piece)
{
    int32_t last = piece;

    for (int32_t part = 0; part < part_count(mapper); part++)
        if (piece_of(mapper, part) == piece && mapper->local[part] > last)
            last = mapper->local[part];
    return last;
}

/* 1 when a part is the first one of its piece, which is none in doubt, and enough pairs are with that: a few may be with
 * somebody who walks there. */
static int32_t is_anchor(const cairn_mapper *mapper, int32_t part)
{
    int32_t piece = piece_of(mapper, part);
    cairn_sym3 all = cairn_sym3_zero(), told = told_by(mapper, piece);

    for (int32_t i = 0; i < part_count(mapper); i++) {
        if (i < part && piece_of(mapper, i) == piece)
            return 0;
        all = joined(all, mapper->parts.information[i]);
    }
    return !mapper->loop.ties[piece].doubtful && told.xx + told.yy > LEAST_SHARE * (all.xx + all.yy);
}

static int32_t is_anchored(const mapper_tie *tie, int32_t key)
{
    for (int32_t i = 0; i < tie->anchor_count; i++)
        if (tie->anchors[i] == key)
            return 1;
    return 0;
}

/* Hangs the scan at hand on one more piece of the map, that which tells most of what is not known; 0 when none tells
 * much. known: information so far. */
static int32_t add_anchor(const cairn_mapper *mapper, mapper_tie *tie, int32_t piece_before, cairn_sym3 *known)
{
    cairn_pose_prior loose = {mapper->match.target_query, LOOSE, LOOSE, LOOSE};
    cairn_real best = TELLS_MUCH * determinant(*known);
    cairn_sym3 covariance, information, told = cairn_sym3_zero();
    int32_t at = tie->anchor_count, found = 0;

    for (int32_t part = 0; part < part_count(mapper); part++) {
        int32_t piece = piece_of(mapper, part);

        if (piece == piece_before || !is_anchor(mapper, part) || is_anchored(tie, last_of(mapper, piece)))
            continue;
        covariance = seen_from(mapper, piece, &loose);
        if (!cairn_sym3_inverse(covariance, &information) || !(determinant(joined(*known, information)) > best))
            continue;
        best = determinant(joined(*known, information));
        told = information;
        tie->anchors[at] = last_of(mapper, piece);
        tie->anchor_covariance[at] = covariance;
        found = 1;
    }
    *known = joined(*known, told);
    tie->anchor_count += found;
    return found;
}

static cairn_real spread_of(cairn_sym3 covariance)
{
    return cairn_sqrt(covariance.xx + covariance.yy);
}

static int32_t is_rigid(cairn_sym3 covariance)
{
    return spread_of(covariance) < RIGID && covariance.zz < RIGID_TURN * RIGID_TURN;
}

/* The piece of the map to which the scan at hand is tied; -1: none, it begins one. */
static int32_t piece_for(const cairn_mapper *mapper, const mapper_tie *tie, int32_t before)
{
    if (is_rigid(tie->covariance))
        return mapper->loop.ties[before].piece;
    for (int32_t i = 0; i < tie->anchor_count; i++)
        if (is_rigid(tie->anchor_covariance[i]))
            return mapper->loop.ties[tie->anchors[i]].piece;
    return -1;
}

int32_t cairn_mapper_hang_on(const cairn_mapper *mapper)
{
    int32_t last = mapper->keys->scan_count - 1, best = last, piece_last;
    cairn_pose_prior prior = cairn_mapper_prior(mapper);
    cairn_real least;

    if (!mapper->has_match || mapper->loop.graph == NULL || mapper->doubtful)
        return last;
    piece_last = mapper->loop.ties[last].piece;
    prior.mean = mapper->match.target_query;
    least = determinant(seen_from(mapper, piece_last, &prior)) / TELLS_MUCH;
    if (mapper->loop.ties[last].doubtful)
        least = LOOSE;
    prior.sigma_x = prior.sigma_y = prior.sigma_theta = LOOSE;
    for (int32_t part = 0; part < part_count(mapper); part++) {
        cairn_real d;

        if (piece_of(mapper, part) == piece_last || !is_anchor(mapper, part))
            continue;
        d = determinant(seen_from(mapper, piece_of(mapper, part), &prior));
        if (!(d < least))
            continue;
        least = d;
        best = last_of(mapper, piece_of(mapper, part));
    }
    return best;
}

/* Without a match: only odometry tells. */
static void tie_by_odometry(const cairn_mapper *mapper, mapper_tie *tie)
{
    cairn_real covariance[9] = {0};

    covariance[0] = covariance[4] = mapper->gap_variance;
    covariance[8] = mapper->gap_turn_variance;
    tie->covariance = cairn_mapper_own_covariance(mapper, covariance, 0);
    tie->spread = spread_of(tie->covariance);
}

void cairn_mapper_tie(const cairn_mapper *mapper, mapper_tie *tie)
{
    int32_t key = mapper->keys->scan_count - 1, before = key - 1, piece;
    cairn_real gap = cairn_sqrt(mapper->gap_variance);
    cairn_pose_prior prior = {mapper->match.target_query, gap, gap, cairn_sqrt(mapper->gap_turn_variance)};
    cairn_sym3 known;

    memset(tie, 0, sizeof *tie);
    tie->doubtful = mapper->doubtful;
    tie->piece = key;
    if (before < 0)
        return;
    if (!mapper->has_match) {
        tie_by_odometry(mapper, tie);
        return;
    }
    tie->covariance =
        joined(seen_from(mapper, mapper->loop.ties[before].piece, &prior),
               cairn_mapper_own_covariance(mapper, mapper->doubt, mapper->match.target_query.theta));
    if (mapper->loop.ties[before].doubtful) {
        tie->covariance.xx += DOUBTFUL * DOUBTFUL;
        tie->covariance.yy += DOUBTFUL * DOUBTFUL;
        tie->covariance.zz += DOUBTFUL_TURN * DOUBTFUL_TURN;
    }
    tie->spread = spread_of(tie->covariance);
    if (tie->doubtful || !cairn_sym3_inverse(tie->covariance, &known))
        return;
    while (tie->anchor_count < MAPPER_ANCHORS && add_anchor(mapper, tie, mapper->loop.ties[before].piece, &known))
        continue;
    if (cairn_sym3_inverse(known, &known))
        tie->spread = spread_of(known);
    piece = piece_for(mapper, tie, before);
    if (piece >= 0)
        tie->piece = piece;
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
