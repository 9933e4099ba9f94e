/* lum: data association of a link, closest points of two scans in a hash grid, and its normal
 * equations. The method is described in lum.c. */
#include "src/base/build.h"

#include <string.h>

#include "src/poses/lum_work.h"

static int32_t cell_of(const cairn_lum *lum, cairn_real x)
{
    return cairn_real_to_int(cairn_floor(x / lum->params.max_pair_distance));
}

static int32_t bucket_of(const struct lum_scan *scan, int32_t x, int32_t y)
{
    uint32_t hash = (uint32_t)x * UINT32_C(0x9E3779B1) ^ (uint32_t)y * UINT32_C(0x85EBCA77);
    uint32_t buckets = 2 * (uint32_t)(scan->end - scan->first);

    hash ^= hash >> 15;
    return 2 * scan->first + (int32_t)(buckets > 0 ? hash % buckets : 0);
}

void cairn_lum_fill_buckets(cairn_lum *lum, const struct lum_scan *scan)
{
    for (int32_t k = 2 * scan->first; k < 2 * scan->end; k++)
        lum->heads[k] = -1;
    for (int32_t k = scan->end - 1; k >= scan->first; k--) {
        int32_t bucket =
            bucket_of(scan, cell_of(lum, lum->points[k].x), cell_of(lum, lum->points[k].y));

        lum->next[k] = lum->heads[bucket];
        lum->heads[bucket] = k;
    }
}

/* Returns the point of the scan nearest to p (in its frame) within the distance and direction
 * gates, the lowest index among equals; -1: none. */
static int32_t nearest_point(const cairn_lum *lum, const struct lum_scan *scan, cairn_vec2 p,
                             cairn_vec2 direction)
{
    cairn_real best = lum->params.max_pair_distance * lum->params.max_pair_distance;
    int32_t cx = cell_of(lum, p.x), cy = cell_of(lum, p.y), found = -1;

    for (int32_t c = 0; c < 9; c++)
        for (int32_t k = lum->heads[bucket_of(scan, cx - 1 + c % 3, cy - 1 + c / 3)]; k >= 0;
             k = lum->next[k]) {
            cairn_real away = cairn_vec2_norm_squared(cairn_vec2_sub(lum->points[k], p));

            if ((away < best || (away == best && (found < 0 || k < found))) &&
                cairn_vec2_dot(lum->directions[k], direction) >= lum->least_cosine) {
                best = away;
                found = k;
            }
        }
    return found;
}

void cairn_lum_begin_pairs(cairn_lum *lum, int32_t first, int32_t second)
{
    lum->first = first;
    lum->second = second;
    lum->point = lum->scans[second].first;
    memset(&lum->sums, 0, sizeof lum->sums);
    lum->map_first = cairn_transform_of(lum->scans[first].pose);
    lum->second_first =
        cairn_transform_of(cairn_pose_between(lum->scans[first].pose, lum->scans[second].pose));
}

void cairn_lum_add_pair(cairn_lum *lum)
{
    const struct lum_scan *first = &lum->scans[lum->first];
    cairn_vec2 own = cairn_transform_point(lum->second_first, lum->points[lum->point]), a, b;
    int32_t found =
        nearest_point(lum, first, own,
                      cairn_transform_direction(lum->second_first, lum->directions[lum->point++]));
    struct lum_sums *s = &lum->sums;
    cairn_real x, y, zx, zy;

    if (found < 0)
        return;
    a = cairn_transform_point(lum->map_first, lum->points[found]);
    b = cairn_transform_point(lum->map_first, own);
    x = (a.x + b.x) / 2 - lum->centre.x;
    y = (a.y + b.y) / 2 - lum->centre.y;
    zx = a.x - b.x;
    zy = a.y - b.y;
    s->pairs++;
    s->x += x;
    s->y += y;
    s->middle_squares += x * x + y * y;
    s->zx += zx;
    s->zy += zy;
    s->cross += x * zy - y * zx;
    s->residual_squares += zx * zx + zy * zy;
}

/* Adds the link's normal equations. */
cairn_status cairn_lum_add_link(cairn_lum *lum, int32_t index)
{
    const struct lum_sums *s = &lum->sums;
    const cairn_real n = (cairn_real)s->pairs, mz[3] = {s->zx, s->zy, s->cross};
    cairn_sym3 m = {n, 0, -s->y, n, s->x, s->middle_squares};
    cairn_real d[3] = {0, 0, 0}, by, explained = 0;
    cairn_real block[9] = {0};
    int moves_first = lum->root[lum->first] != lum->first,
        moves_second = lum->root[lum->second] != lum->second;
    cairn_status status = CAIRN_OK;

    if (s->pairs <= lum->params.min_pairs)
        return CAIRN_OK; /* built from other poses; the scans no longer overlap */
    if (cairn_sym3_solve(m, mz, d))
        explained = d[0] * mz[0] + d[1] * mz[1] + d[2] * mz[2];
    by = 1 / cairn_max((s->residual_squares - explained) / (2 * n - 3),
                       lum->params.min_sigma * lum->params.min_sigma);
    /* D^T C^-1 D, as C^-1 = M^T M / s^2 and the poses have not moved yet */
    lum->chi2 += by * explained;
    lum->pairs += s->pairs;
    m.xx *= by;
    m.xz *= by;
    m.yy *= by;
    m.yz *= by;
    m.zz *= by;
    for (int k = 0; k < 3; k++) {
        lum->right[lum->first][k] -= by * mz[k];
        lum->right[lum->second][k] += by * mz[k];
    }
    if (moves_first)
        status = cairn_block_solver_add_pose_block(lum->solver, lum->first, m);
    if (moves_second && status == CAIRN_OK)
        status = cairn_block_solver_add_pose_block(lum->solver, lum->second, m);
    block[0] = -m.xx;
    block[2] = block[6] = -m.xz;
    block[4] = -m.yy;
    block[5] = block[7] = -m.yz;
    block[8] = -m.zz;
    if (moves_first && moves_second && status == CAIRN_OK)
        status = cairn_block_solver_add_link_block(lum->solver, index, block);
    return status;
}
