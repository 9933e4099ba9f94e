/* The links of Lu and Milios: nearest points of two scans, and the difference of their poses
 * that these ask for. The method is told in lum.c. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/lum_work.h"

static int32_t cell_of(const cairn_lum *l, cairn_real x)
{
    return cairn_real_to_int(cairn_floor(x / l->params.distance));
}

static int32_t bucket_of(const struct lum_scan *scan, int32_t x, int32_t y)
{
    uint32_t hash = (uint32_t)x * UINT32_C(0x9E3779B1) ^ (uint32_t)y * UINT32_C(0x85EBCA77);
    uint32_t buckets = 2 * (uint32_t)(scan->end - scan->first);

    hash ^= hash >> 15;
    return 2 * scan->first + (int32_t)(buckets > 0 ? hash % buckets : 0);
}

void cairn_lum_fill_buckets(cairn_lum *l, const struct lum_scan *scan)
{
    for (int32_t k = 2 * scan->first; k < 2 * scan->end; k++)
        l->heads[k] = -1;
    for (int32_t k = scan->end - 1; k >= scan->first; k--) {
        int32_t bucket = bucket_of(scan, cell_of(l, l->points[k].x), cell_of(l, l->points[k].y));

        l->next[k] = l->heads[bucket];
        l->heads[bucket] = k;
    }
}

/* The point of the scan nearest to p (in its frame) within the distance whose direction agrees,
 * the lowest index among equals; -1: none. */
static int32_t nearest(const cairn_lum *l, const struct lum_scan *scan, cairn_vec2 p,
                       cairn_vec2 direction)
{
    cairn_real best = l->params.distance * l->params.distance;
    int32_t cx = cell_of(l, p.x), cy = cell_of(l, p.y), found = -1;

    for (int32_t c = 0; c < 9; c++)
        for (int32_t k = l->heads[bucket_of(scan, cx - 1 + c % 3, cy - 1 + c / 3)]; k >= 0;
             k = l->next[k]) {
            cairn_real away = cairn_vec2_norm_squared(cairn_vec2_sub(l->points[k], p));

            if ((away < best || (away == best && (found < 0 || k < found))) &&
                cairn_vec2_dot(l->directions[k], direction) >= l->least_cosine) {
                best = away;
                found = k;
            }
        }
    return found;
}

void cairn_lum_begin_pairs(cairn_lum *l, int32_t first, int32_t second)
{
    l->first = first;
    l->second = second;
    l->point = l->scans[second].first;
    memset(&l->sums, 0, sizeof l->sums);
    l->map_first = cairn_transform_of(l->scans[first].pose);
    l->second_first =
        cairn_transform_of(cairn_pose_between(l->scans[first].pose, l->scans[second].pose));
}

void cairn_lum_add_pair(cairn_lum *l)
{
    const struct lum_scan *first = &l->scans[l->first];
    cairn_vec2 own = cairn_transform_point(l->second_first, l->points[l->point]), a, b;
    int32_t found = nearest(l, first, own,
                            cairn_transform_direction(l->second_first, l->directions[l->point++]));
    struct lum_sums *s = &l->sums;
    cairn_real x, y, zx, zy;

    if (found < 0)
        return;
    a = cairn_transform_point(l->map_first, l->points[found]);
    b = cairn_transform_point(l->map_first, own);
    x = (a.x + b.x) / 2 - l->centre.x;
    y = (a.y + b.y) / 2 - l->centre.y;
    zx = a.x - b.x;
    zy = a.y - b.y;
    s->pairs++;
    s->x += x;
    s->y += y;
    s->squares += x * x + y * y;
    s->zx += zx;
    s->zy += zy;
    s->turn += x * zy - y * zx;
    s->miss += zx * zx + zy * zy;
}

/* Adds the link's equations. */
cairn_status cairn_lum_add_link(cairn_lum *l, int32_t index)
{
    const struct lum_sums *s = &l->sums;
    const cairn_real n = (cairn_real)s->pairs, mz[3] = {s->zx, s->zy, s->turn};
    cairn_sym3 m = {n, 0, -s->y, n, s->x, s->squares};
    cairn_real d[3] = {0, 0, 0}, by, explained = 0;
    cairn_real block[9] = {0};
    int moves_first = l->root[l->first] != l->first, moves_second = l->root[l->second] != l->second;
    cairn_status status = CAIRN_OK;

    if (s->pairs <= l->params.min_pairs)
        return CAIRN_OK; /* built from other poses, and now out of sight of each other */
    if (cairn_sym3_solve(m, mz, d))
        explained = d[0] * mz[0] + d[1] * mz[1] + d[2] * mz[2];
    by = 1 / cairn_max((s->miss - explained) / (2 * n - 3), l->params.sigma * l->params.sigma);
    /* D^T C^-1 D, as C^-1 = M^T M / s^2 and the poses have not moved yet */
    l->error += by * explained;
    l->pairs += s->pairs;
    m.xx *= by;
    m.xz *= by;
    m.yy *= by;
    m.yz *= by;
    m.zz *= by;
    for (int k = 0; k < 3; k++) {
        l->right[l->first][k] -= by * mz[k];
        l->right[l->second][k] += by * mz[k];
    }
    if (moves_first)
        status = cairn_block_solver_add_pose_block(l->solver, l->first, m);
    if (moves_second && status == CAIRN_OK)
        status = cairn_block_solver_add_pose_block(l->solver, l->second, m);
    block[0] = -m.xx;
    block[2] = block[6] = -m.xz;
    block[4] = -m.yy;
    block[5] = block[7] = -m.yz;
    block[8] = -m.zz;
    if (moves_first && moves_second && status == CAIRN_OK)
        status = cairn_block_solver_add_link_block(l->solver, index, block);
    return status;
}
