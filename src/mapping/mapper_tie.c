/* On what does a key scan hang?
 *
 * Method. A match is against the whole local map, but its key scans are not all sure of their
 * places among each other: one that came along a bare wall hangs loosely, and what came later and
 * saw more must not hang on it. So key scans whose place is told well by earlier ones form rigid
 * pieces. The information of a match is split by the pieces that have its pairs (icp). A key scan
 * is tied to the one before by what the pairs with that one's piece tell, and by odometry since;
 * and to the last key scan of up to two other pieces, where these tell much that is not known. What
 * is tied firmly becomes part of the piece, what is not begins one of its own.
 *
 * Limits: a piece is taken as rigid also where it has been led astray unnoticed. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/mapper_work.h"

/* m and rad: of what a piece tells nothing */
static const cairn_real LOOSE = 1;
/* times the information, of all directions together */
static const cairn_real TELLS_MUCH = 4;
/* of all information, that a piece must tell */
static const cairn_real LEAST_SHARE = CAIRN_REAL(0.1);
/* m and rad, within a piece */
static const cairn_real RIGID = CAIRN_REAL(0.05), RIGID_TURN = CAIRN_REAL(0.03);

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

/* Covariance of the scan at hand seen from a piece of the map, by its pairs with that and by the
 * prior, with a doubt added (NULL: none), in its own frame. Where the pairs tell little, that
 * little is noise of their normals. */
static cairn_sym3 seen_from(const cairn_mapper *mapper, int32_t piece,
                            const cairn_pose_prior *prior, const cairn_real *doubt)
{
    cairn_sym3 told = told_by(mapper, piece);
    const cairn_rigid_motion *motion = &mapper->parts.motion;
    cairn_normal_equations known = cairn_rigid_motion_prior(motion, prior);
    cairn_real covariance[9];
    cairn_motion_basis basis;
    int32_t has_pairs = told.xx + told.yy > 0;

    if (has_pairs)
        basis = cairn_motion_basis_of(told, mapper->params.icp.weak_ratio);
    cairn_rigid_motion_covariance(motion, has_pairs ? &basis : NULL, has_pairs ? &told : NULL,
                                  &known, covariance);
    for (int k = 0; k < 9 && doubt != NULL; k++)
        covariance[k] += doubt[k];
    return cairn_mapper_own_covariance(mapper, covariance, motion->map_body.theta);
}

static cairn_real determinant(cairn_sym3 m)
{
    return m.xx * (m.yy * m.zz - m.yz * m.yz) - m.xy * (m.xy * m.zz - m.yz * m.xz) +
           m.xz * (m.xy * m.yz - m.yy * m.xz);
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

/* 1 when a part is the first one of its piece, which is none in doubt, and enough pairs are with
 * that: a few may be with somebody who walks there. */
static int32_t is_anchor(const cairn_mapper *mapper, int32_t part)
{
    int32_t piece = piece_of(mapper, part);
    cairn_sym3 all = cairn_sym3_zero(), told = told_by(mapper, piece);

    for (int32_t i = 0; i < part_count(mapper); i++) {
        if (i < part && piece_of(mapper, i) == piece)
            return 0;
        all = joined(all, mapper->parts.information[i]);
    }
    return !mapper->loop.ties[piece].doubtful &&
           told.xx + told.yy > LEAST_SHARE * (all.xx + all.yy);
}

static int32_t is_anchored(const mapper_tie *tie, int32_t key)
{
    for (int32_t i = 0; i < tie->anchor_count; i++)
        if (tie->anchors[i] == key)
            return 1;
    return 0;
}

/* Hangs the scan at hand on one more piece of the map, that which tells most of what is not
 * known; 0 when none tells much. known: information so far. */
static int32_t add_anchor(const cairn_mapper *mapper, mapper_tie *tie, int32_t piece_before,
                          cairn_sym3 *known)
{
    cairn_pose_prior loose = {mapper->match.target_query, LOOSE, LOOSE, LOOSE};
    cairn_real best = TELLS_MUCH * determinant(*known);
    cairn_sym3 covariance, information, told = cairn_sym3_zero();
    int32_t at = tie->anchor_count, found = 0;

    for (int32_t part = 0; part < part_count(mapper); part++) {
        int32_t piece = piece_of(mapper, part);

        if (piece == piece_before || !is_anchor(mapper, part) ||
            is_anchored(tie, last_of(mapper, piece)))
            continue;
        covariance = seen_from(mapper, piece, &loose, NULL);
        if (!cairn_sym3_inverse(covariance, &information) ||
            !(determinant(joined(*known, information)) > best))
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
    int32_t last = mapper->key_count - 1, best = last, piece_last;
    cairn_pose_prior prior = cairn_mapper_prior(mapper);
    cairn_real least;

    if (!mapper->has_match || mapper->loop.graph == NULL || mapper->doubtful)
        return last;
    piece_last = mapper->loop.ties[last].piece;
    prior.mean = mapper->match.target_query;
    least = determinant(seen_from(mapper, piece_last, &prior, NULL)) / TELLS_MUCH;
    if (mapper->loop.ties[last].doubtful)
        least = LOOSE;
    prior.sigma_x = prior.sigma_y = prior.sigma_theta = LOOSE;
    for (int32_t part = 0; part < part_count(mapper); part++) {
        cairn_real d;

        if (piece_of(mapper, part) == piece_last || !is_anchor(mapper, part))
            continue;
        d = determinant(seen_from(mapper, piece_of(mapper, part), &prior, NULL));
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
    int32_t key = mapper->key_count - 1, before = key - 1, piece;
    cairn_real gap = cairn_sqrt(mapper->gap_variance);
    cairn_pose_prior prior = {mapper->match.target_query, gap, gap,
                              cairn_sqrt(mapper->gap_turn_variance)};
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
    tie->covariance = seen_from(mapper, mapper->loop.ties[before].piece, &prior, mapper->doubt);
    if (mapper->loop.ties[before].doubtful) {
        tie->covariance.xx += MAPPER_DOUBT * MAPPER_DOUBT;
        tie->covariance.yy += MAPPER_DOUBT * MAPPER_DOUBT;
        tie->covariance.zz += MAPPER_DOUBT_TURN * MAPPER_DOUBT_TURN;
    }
    tie->spread = spread_of(tie->covariance);
    if (tie->doubtful || !cairn_sym3_inverse(tie->covariance, &known))
        return;
    while (tie->anchor_count < MAPPER_ANCHORS &&
           add_anchor(mapper, tie, mapper->loop.ties[before].piece, &known))
        continue;
    if (cairn_sym3_inverse(known, &known))
        tie->spread = spread_of(known);
    piece = piece_for(mapper, tie, before);
    if (piece >= 0)
        tie->piece = piece;
}
