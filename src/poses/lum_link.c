/* lum: data association of a link, closest points of two scans in a hash grid, and its normal
 * equations. The method is described in lum.c. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/cell_grid.h"
#include "src/poses/lum_work.h"

static int32_t cell_of(const cairn_lum *lum, cairn_real x)
{
    return cairn_real_to_int(cairn_floor(x / lum->params.max_pair_distance));
}

static int32_t bucket_of(const struct lum_scan *scan, int32_t x, int32_t y)
{
    uint32_t buckets = 2 * (uint32_t)(scan->end - scan->first);

    return 2 * scan->first + (int32_t)(buckets > 0 ? cell_hash(x, y, 0) % buckets : 0);
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

    if (found < 0)
        return;
    a = cairn_transform_point(lum->map_first, lum->points[found]);
    b = cairn_transform_point(lum->map_first, own);
    cairn_registration_add_points(&lum->sums.points, &lum->motion,
                                  cairn_vec2_scale(cairn_vec2_add(a, b), CAIRN_REAL(0.5)),
                                  cairn_vec2_sub(a, b), 1);
    lum->sums.pairs++;
}

/* Adds the link's normal equations. */
cairn_status cairn_lum_add_link(cairn_lum *lum, int32_t index)
{
    const struct lum_sums *s = &lum->sums;
    const cairn_sym3 *m = &s->points.equations.information;
    const cairn_real *mz = s->points.equations.gradient;
    cairn_sym3 block;
    cairn_real d[3] = {0, 0, 0}, by, explained = 0, full[9];
    const int32_t ends[2] = {lum->first, lum->second};
    int moving = 0;
    cairn_status status = CAIRN_OK;

    if (s->pairs <= lum->params.min_pairs)
        return CAIRN_OK; /* built from other poses; the scans no longer overlap */
    if (cairn_sym3_solve(*m, mz, d))
        explained = d[0] * mz[0] + d[1] * mz[1] + d[2] * mz[2];
    by = 1 / cairn_max((s->points.squares - explained) / (2 * (cairn_real)s->pairs - 3),
                       lum->params.min_sigma * lum->params.min_sigma);
    /* D^T C^-1 D, as C^-1 = M^T M / s^2 and the poses have not moved yet */
    lum->chi2 += by * explained;
    lum->pairs += s->pairs;
    block = cairn_sym3_scale(*m, by);
    for (int k = 0; k < 3; k++) {
        lum->right[lum->first][k] -= by * mz[k];
        lum->right[lum->second][k] += by * mz[k];
    }
    for (int end = 0; end < 2 && status == CAIRN_OK; end++) {
        if (lum->root[ends[end]] == ends[end])
            continue;
        status = cairn_block_solver_add_pose_block(lum->solver, ends[end], block);
        moving++;
    }
    cairn_sym3_to_full(cairn_sym3_scale(block, -1), full);
    if (moving == 2 && status == CAIRN_OK)
        status = cairn_block_solver_add_link_block(lum->solver, index, full);
    return status;
}
