/* weak_direction: clustering of scans with a weakly observable direction into submaps, and greedy
 * merging of the submaps.
 *
 * Method:
 * 1. Principal axes of each scan's position covariance. A scan of the largest component with one
 *    large and one small axis, and a small heading variance, has a weakly observable direction.
 * 2. Connected components: such scans with equal direction and deviation that share a wall across
 *    the direction form one submap. The scans with observable poses are the fixed submap.
 * 3. Each submap is tried against another at evenly spaced translations along its direction
 *    (weak_direction_translate.c), scored by initial poses, wall thickness (weak_direction_walls.c)
 *    and free-space violations.
 * 4. Greedy merging: the pair with the greatest margin over its best competing translation is
 *    merged; its pairs are evaluated again.
 *
 * Layout: scans; walls of all submaps; for each pair of submaps the best translation.
 * Limits: translations only, headings stay; submaps with two weakly observable directions stay; a
 * submap is merged at a grid translation.
 * Source: Adluru 2008, chapter 8, for hypotheses about the world where scans share no surface; the
 * likelihoods are those of the aligner. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/small_matrix.h"
#include "src/alignment/weak_direction_work.h"

#define MAX_COORDINATE_M CAIRN_REAL(1e6)

enum { SCANS_PER_UNIT = 16 };

static const cairn_real MIN_AXIS_COSINE = CAIRN_REAL(0.99); /* cosine */
static const cairn_real MAX_SIGMA_DIFFERENCE =
    CAIRN_REAL(0.03); /* relative difference of the deviations */

#define INTEGER(field, is, from, to) CAIRN_INTEGER(cairn_weak_direction_params, field, is, from, to)
#define LENGTH(field, is)                                                                          \
    CAIRN_NUMBER_ABOVE(cairn_weak_direction_params, field, is, 0, MAX_COORDINATE_M)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_scans, 64, 1, 1 << 16),        INTEGER(max_walls, 1024, 1, 1 << 16),
    INTEGER(max_submaps, 24, 1, 64),           INTEGER(use_thickness, 1, 0, 1),
    LENGTH(weak_sigma, CAIRN_REAL(0.03)),      LENGTH(max_cross_sigma, CAIRN_REAL(0.05)),
    LENGTH(max_sigma_theta, CAIRN_PI / 180),   LENGTH(translation_step, CAIRN_REAL(0.02)),
    LENGTH(thickness_sigma, CAIRN_REAL(0.02)),
};
const cairn_parameters cairn_weak_direction_parameters =
    CAIRN_PARAMETERS("weak_direction", cairn_weak_direction_params, rows);

cairn_weak_direction_params cairn_weak_direction_default(void)
{
    cairn_weak_direction_params params;

    cairn_parameters_preset(&cairn_weak_direction_parameters, &params);
    return params;
}

cairn_status cairn_weak_direction_check(const cairn_weak_direction_params *params,
                                        cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_weak_direction_parameters, params, fault);
}

static size_t pairs_of(int32_t parts)
{
    return (size_t)(parts * (parts + 1) / 2);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_weak_direction *build(cairn_pool *pool, const cairn_weak_direction_params *params)
{
    size_t scans = (size_t)params->max_scans;
    cairn_weak_direction *weak_direction = cairn_object_take(pool, sizeof *weak_direction);

    CAIRN_TAKE(weak_direction, pool, scans, scans);
    CAIRN_TAKE(weak_direction, pool, fixed_initial, scans);
    CAIRN_TAKE(weak_direction, pool, fixed_map, scans);
    CAIRN_TAKE(weak_direction, pool, walls, params->max_walls);
    CAIRN_TAKE(weak_direction, pool, submaps, params->max_submaps + 1);
    CAIRN_TAKE(weak_direction, pool, pairs, pairs_of(params->max_submaps));
    CAIRN_TAKE(weak_direction, pool, trials, WEAK_DIRECTION_MAX_TRIALS + 1);
    CAIRN_TAKE(weak_direction, pool, fits, WEAK_DIRECTION_MAX_TRIALS + 1);
    CAIRN_TAKE(weak_direction, pool, thickness_weight, WEAK_DIRECTION_THICKNESS_BINS);
    CAIRN_TAKE(weak_direction, pool, thickness_sum, WEAK_DIRECTION_THICKNESS_BINS);
    if (weak_direction != NULL) {
        weak_direction->params = *params;
        weak_direction->phase = WEAK_DIRECTION_DONE;
    }
    return weak_direction;
}

CAIRN_OBJECT(weak_direction, weak_direction, build);

/* ---- Scans ---- */

cairn_status cairn_weak_direction_begin(cairn_weak_direction *weak_direction,
                                        const cairn_aligner *aligner, const cairn_scan_set *set,
                                        cairn_real spread)
{
    if (weak_direction == NULL || aligner == NULL || set == NULL ||
        cairn_aligner_running(aligner) || cairn_aligner_scan_count(aligner) != set->scan_count ||
        !(spread > 0 && spread <= MAX_COORDINATE_M))
        return CAIRN_BAD_ARGUMENT;
    if (set->scan_count > weak_direction->params.max_scans)
        return CAIRN_FULL;
    weak_direction->aligner = aligner;
    weak_direction->set = set;
    weak_direction->scan_count = set->scan_count;
    weak_direction->initial_sigma = spread;
    weak_direction->added_scans = weak_direction->wall_count = 0;
    weak_direction->submap_count = 1;
    weak_direction->phase = WEAK_DIRECTION_ADD_SCANS;
    weak_direction->item = weak_direction->inner_item = weak_direction->units_due = 0;
    weak_direction->gathers_fixed = 0;
    memset(&weak_direction->result, 0, sizeof weak_direction->result);
    memset(weak_direction->thickness_weight, 0,
           WEAK_DIRECTION_THICKNESS_BINS * sizeof *weak_direction->thickness_weight);
    memset(weak_direction->thickness_sum, 0,
           WEAK_DIRECTION_THICKNESS_BINS * sizeof *weak_direction->thickness_sum);
    memset(weak_direction->submaps, 0,
           ((size_t)weak_direction->params.max_submaps + 1) * sizeof *weak_direction->submaps);
    return CAIRN_OK;
}

/* Returns the principal axis of greatest variance of a scan's position, and the standard deviations
 * along and across it. */
static void find_axes(const cairn_aligner_pose *aligned, cairn_vec2 *along, cairn_real *deviation,
                      cairn_real *across)
{
    const cairn_real *c = aligned->covariance;
    cairn_sym2 position = {c[0], c[1], c[4]};
    cairn_real values[2];
    cairn_vec2 minor;

    cairn_sym2_eigen(position, values, &minor, along);
    *deviation = cairn_sqrt(cairn_max(values[1], 0));
    *across = cairn_sqrt(cairn_max(values[0], 0));
}

int32_t cairn_weak_direction_is_weak(const cairn_weak_direction *weak_direction,
                                     const cairn_aligner_pose *aligned)
{
    cairn_real deviation, across;
    cairn_vec2 along;

    if (weak_direction == NULL || aligned == NULL || aligned->component != 0 || aligned->placed)
        return 0;
    find_axes(aligned, &along, &deviation, &across);
    return cairn_sqrt(aligned->covariance[8]) <= weak_direction->params.max_sigma_theta &&
           across <= weak_direction->params.max_cross_sigma &&
           deviation >= weak_direction->params.weak_sigma;
}

cairn_status cairn_weak_direction_add(cairn_weak_direction *weak_direction, cairn_pose start,
                                      const cairn_aligner_pose *aligned)
{
    weak_direction_scan *scan;
    cairn_real across;

    if (weak_direction == NULL || aligned == NULL ||
        weak_direction->phase != WEAK_DIRECTION_ADD_SCANS ||
        weak_direction->added_scans == weak_direction->scan_count)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pose_is_finite(start) || !cairn_pose_is_finite(aligned->map_scan))
        return CAIRN_NOT_FINITE;
    if (!cairn_pose_is_within(start, MAX_COORDINATE_M) ||
        !cairn_pose_is_within(aligned->map_scan, MAX_COORDINATE_M))
        return CAIRN_BAD_ARGUMENT;
    scan = &weak_direction->scans[weak_direction->added_scans];
    memset(scan, 0, sizeof *scan);
    scan->initial = start;
    scan->map_scan = aligned->map_scan;
    find_axes(aligned, &scan->along, &scan->deviation, &across);
    scan->is_weak = cairn_weak_direction_is_weak(weak_direction, aligned);
    scan->submap = scan->is_weak ? weak_direction->added_scans : WEAK_DIRECTION_NO_SUBMAP;
    if (aligned->component == 0 && aligned->placed) {
        scan->submap = WEAK_DIRECTION_FIXED_SUBMAP;
        weak_direction->fixed_initial[weak_direction->submaps[WEAK_DIRECTION_FIXED_SUBMAP].scans] =
            start;
        weak_direction->fixed_map[weak_direction->submaps[WEAK_DIRECTION_FIXED_SUBMAP].scans++] =
            aligned->map_scan;
    }
    weak_direction->added_scans++;
    return CAIRN_OK;
}

/* ---- Submaps ---- */

static int is_same_submap(const weak_direction_scan *a, const weak_direction_scan *b)
{
    return b->is_weak && a->submap != b->submap &&
           cairn_abs(cairn_vec2_dot(a->along, b->along)) >= MIN_AXIS_COSINE &&
           cairn_abs(a->deviation - b->deviation) <=
               MAX_SIGMA_DIFFERENCE * cairn_max(a->deviation, b->deviation);
}

static void merge_clusters(cairn_weak_direction *weak_direction, int32_t first, int32_t second)
{
    int32_t low = first < second ? first : second, high = first + second - low;

    for (int32_t k = 0; k < weak_direction->scan_count; k++)
        if (weak_direction->scans[k].is_weak && weak_direction->scans[k].submap == high)
            weak_direction->scans[k].submap = low;
}

/* Tests scan i against one of the scans before it, and merges their clusters when they share a
 * wall. */
static int32_t cluster_item(cairn_weak_direction *weak_direction)
{
    const weak_direction_scan *a = &weak_direction->scans[weak_direction->item], *b;
    cairn_vec2 along;
    int32_t passed = 0, units;

    if (weak_direction->item == weak_direction->scan_count) {
        weak_direction->phase = WEAK_DIRECTION_NUMBER;
        weak_direction->item = 0;
        return 1;
    }
    for (; a->is_weak && weak_direction->inner_item < weak_direction->item;
         weak_direction->inner_item++, passed++)
        if (is_same_submap(a, &weak_direction->scans[weak_direction->inner_item]))
            break;
    if (!a->is_weak || weak_direction->inner_item == weak_direction->item) {
        weak_direction->item++;
        weak_direction->inner_item = 0;
        return 1 + passed / SCANS_PER_UNIT;
    }
    b = &weak_direction->scans[weak_direction->inner_item];
    along =
        cairn_transform_direction(cairn_transform_of(cairn_pose_inverse(a->map_scan)), a->along);
    if (cairn_aligner_share_wall(weak_direction->aligner, weak_direction->item,
                                 weak_direction->inner_item,
                                 cairn_pose_between(b->map_scan, a->map_scan), along, &units))
        merge_clusters(weak_direction, a->submap, b->submap);
    weak_direction->inner_item++;
    return units + 2 + (passed + weak_direction->scan_count) / SCANS_PER_UNIT;
}

/* Numbers the submap of scan i and adds the offset of its initial pose; a submap beyond max_submaps
 * stays. */
static void number_scan(cairn_weak_direction *weak_direction, int32_t i, cairn_pose gauge)
{
    weak_direction_scan *scan = &weak_direction->scans[i];
    cairn_pose expected = cairn_pose_compose(gauge, scan->initial);
    weak_direction_submap *part;

    if (scan->submap == WEAK_DIRECTION_NO_SUBMAP)
        return;
    if (scan->is_weak && scan->submap == i) {
        if (weak_direction->submap_count > weak_direction->params.max_submaps) {
            weak_direction->result.dropped++;
            weak_direction->scans[i].is_weak = 0;
            scan->submap = WEAK_DIRECTION_NO_SUBMAP;
            return;
        }
        weak_direction->submaps[weak_direction->submap_count].along = scan->along;
        scan->submap = weak_direction->submap_count++;
    } else if (scan->is_weak) {
        scan->submap = weak_direction->scans[scan->submap].submap;
        scan->is_weak = scan->submap != WEAK_DIRECTION_NO_SUBMAP;
        if (!scan->is_weak)
            return;
    }
    part = &weak_direction->submaps[scan->submap];
    part->scans += scan->is_weak;
    part->initial_offset.x += expected.x - scan->map_scan.x;
    part->initial_offset.y += expected.y - scan->map_scan.y;
}

/* Numbers all submaps; none when there is no fixed or no weak submap. */
static int32_t number_item(cairn_weak_direction *weak_direction)
{
    int32_t fixed_count = weak_direction->submaps[WEAK_DIRECTION_FIXED_SUBMAP].scans;
    cairn_pose gauge = fixed_count > 0
                           ? cairn_pose_fit(weak_direction->fixed_initial,
                                            weak_direction->fixed_map, NULL, fixed_count, 1)
                           : cairn_pose_identity();

    for (int32_t i = 0; i < weak_direction->scan_count && fixed_count > 0; i++)
        number_scan(weak_direction, i, gauge);
    for (size_t k = 0; k < pairs_of(weak_direction->submap_count - 1); k++)
        weak_direction->pairs[k].margin = -1;
    weak_direction->result.weak_submaps = weak_direction->submap_count - 1;
    weak_direction->phase =
        weak_direction->result.weak_submaps > 0 ? WEAK_DIRECTION_WALLS : WEAK_DIRECTION_DONE;
    return 1 + weak_direction->scan_count / 2;
}

/* ---- Pairs of submaps ---- */

/* Returns 1 when a submap may be translated against another one. */
static int may_merge(const cairn_weak_direction *weak_direction, int32_t moving, int32_t fixed)
{
    const weak_direction_submap *a = &weak_direction->submaps[moving],
                                *b = &weak_direction->submaps[fixed];

    return a->scans > 0 && b->scans > 0 &&
           (fixed == WEAK_DIRECTION_FIXED_SUBMAP ||
            cairn_abs(cairn_vec2_dot(a->along, b->along)) >= MIN_AXIS_COSINE);
}

/* Merges submap `moving` into `fixed` at their best translation. */
static void merge_submaps(cairn_weak_direction *weak_direction, int32_t moving, int32_t fixed)
{
    weak_direction_submap *a = &weak_direction->submaps[moving],
                          *b = &weak_direction->submaps[fixed];
    cairn_vec2 shift = cairn_vec2_scale(
        a->along, cairn_weak_direction_pair(weak_direction, moving, fixed)->translation);

    for (int32_t i = 0; i < weak_direction->scan_count; i++)
        if (weak_direction->scans[i].submap == moving) {
            weak_direction->scans[i].submap = fixed;
            weak_direction->scans[i].translation =
                cairn_vec2_add(weak_direction->scans[i].translation, shift);
        }
    for (int32_t k = 0; k < weak_direction->wall_count; k++)
        if (weak_direction->walls[k].submap == moving) {
            weak_direction->walls[k].submap = fixed;
            weak_direction->walls[k].middle =
                cairn_vec2_add(weak_direction->walls[k].middle, shift);
        }
    b->initial_offset = cairn_vec2_add(
        b->initial_offset,
        cairn_vec2_sub(a->initial_offset, cairn_vec2_scale(shift, (cairn_real)a->scans)));
    b->scans += a->scans;
    a->scans = 0;
    for (int32_t k = 1; k < weak_direction->submap_count; k++)
        for (int32_t h = 0; h < k; h++)
            if (k == fixed || h == fixed)
                cairn_weak_direction_pair(weak_direction, k, h)->margin = -1;
    weak_direction->result.merged_submaps++;
    weak_direction->fixed = fixed;
    weak_direction->item = 0;
    /* the weights of the fixed submap are not needed again */
    weak_direction->phase = fixed == WEAK_DIRECTION_FIXED_SUBMAP ? WEAK_DIRECTION_NEXT_PAIR
                                                                 : WEAK_DIRECTION_WEIGHT_MERGED;
}

static void finish(cairn_weak_direction *weak_direction)
{
    for (int32_t i = 0; i < weak_direction->scan_count; i++)
        weak_direction->result.translated_scans += weak_direction->scans[i].translation.x != 0 ||
                                                   weak_direction->scans[i].translation.y != 0;
    weak_direction->phase = WEAK_DIRECTION_DONE;
}

/* Starts the trials of the next pair without a result; when all have one, merges the pair of
 * greatest margin. */
static int32_t next_item(cairn_weak_direction *weak_direction)
{
    int32_t moving = 0, fixed = 0,
            units = 1 + (int32_t)pairs_of(weak_direction->submap_count - 1) / SCANS_PER_UNIT;

    for (int32_t k = 1; k < weak_direction->submap_count; k++)
        for (int32_t h = 0; h < k; h++) {
            if (!may_merge(weak_direction, k, h))
                continue;
            if (cairn_weak_direction_pair(weak_direction, k, h)->margin < 0) {
                return units + cairn_weak_direction_begin_pair(weak_direction, k, h);
            }
            if (moving == 0 ||
                cairn_weak_direction_pair(weak_direction, k, h)->margin >
                    cairn_weak_direction_pair(weak_direction, moving, fixed)->margin) {
                moving = k;
                fixed = h;
            }
        }
    if (moving > 0)
        merge_submaps(weak_direction, moving, fixed);
    else
        finish(weak_direction);
    return units + (weak_direction->scan_count + weak_direction->wall_count) / SCANS_PER_UNIT;
}

/* ---- Phases ---- */

/* Executes item i of a phase of `count` items, then enters the next phase. */
static int32_t run_through(cairn_weak_direction *weak_direction, int32_t count,
                           int32_t (*phase_item)(cairn_weak_direction *), weak_direction_phase next)
{
    int32_t units = weak_direction->item < count ? phase_item(weak_direction) : 1;

    if (++weak_direction->item >= count) {
        weak_direction->item = 0;
        weak_direction->phase = next;
    }
    return units;
}

/* Walls of the weak submaps, then those of the fixed one. */
static int32_t gather_item(cairn_weak_direction *weak_direction)
{
    int32_t units = run_through(weak_direction, weak_direction->scan_count,
                                cairn_weak_direction_walls_item, WEAK_DIRECTION_WEIGHT);

    if (weak_direction->phase == WEAK_DIRECTION_WEIGHT && !weak_direction->gathers_fixed) {
        weak_direction->phase = WEAK_DIRECTION_WALLS;
        weak_direction->gathers_fixed = 1;
    }
    return units;
}

static int32_t phase_item(cairn_weak_direction *weak_direction)
{
    switch (weak_direction->phase) {
    case WEAK_DIRECTION_CLUSTER:
        return cluster_item(weak_direction);
    case WEAK_DIRECTION_NUMBER:
        return number_item(weak_direction);
    case WEAK_DIRECTION_WALLS:
        return gather_item(weak_direction);
    case WEAK_DIRECTION_WEIGHT:
        return run_through(weak_direction, weak_direction->wall_count,
                           cairn_weak_direction_weight_item, WEAK_DIRECTION_HISTOGRAM);
    case WEAK_DIRECTION_WEIGHT_MERGED: /* of the merged submap */
        return run_through(weak_direction, weak_direction->wall_count,
                           cairn_weak_direction_weight_item, WEAK_DIRECTION_NEXT_PAIR);
    case WEAK_DIRECTION_HISTOGRAM:
        return run_through(weak_direction, weak_direction->wall_count,
                           cairn_weak_direction_histogram_item, WEAK_DIRECTION_NEXT_PAIR);
    case WEAK_DIRECTION_THICKNESS:
        return run_through(weak_direction, weak_direction->wall_count,
                           cairn_weak_direction_thickness_item, WEAK_DIRECTION_FREE_SPACE);
    case WEAK_DIRECTION_FREE_SPACE:
        return cairn_weak_direction_free_space_item(weak_direction);
    default:
        return next_item(weak_direction);
    }
}

cairn_status cairn_weak_direction_step(cairn_weak_direction *weak_direction, cairn_budget *budget)
{
    if (weak_direction == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (weak_direction->phase == WEAK_DIRECTION_ADD_SCANS &&
        weak_direction->added_scans < weak_direction->scan_count)
        return CAIRN_EMPTY;
    if (weak_direction->phase == WEAK_DIRECTION_ADD_SCANS)
        weak_direction->phase = WEAK_DIRECTION_CLUSTER;
    while (weak_direction->phase != WEAK_DIRECTION_DONE || weak_direction->units_due > 0) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        weak_direction->result.units += cairn_budget_settle(budget, &weak_direction->units_due);
        if (weak_direction->units_due == 0 && weak_direction->phase != WEAK_DIRECTION_DONE)
            weak_direction->units_due = phase_item(weak_direction);
    }
    return CAIRN_OK;
}

/* ---- The result ---- */

static int has_ended(const cairn_weak_direction *weak_direction)
{
    return weak_direction->phase == WEAK_DIRECTION_DONE && weak_direction->units_due == 0;
}

cairn_weak_direction_result cairn_weak_direction_read(const cairn_weak_direction *weak_direction)
{
    static const cairn_weak_direction_result none = {0};

    return has_ended(weak_direction) ? weak_direction->result : none;
}

cairn_vec2 cairn_weak_direction_translation(const cairn_weak_direction *weak_direction,
                                            int32_t scan)
{
    static const cairn_vec2 none = {0, 0};

    return has_ended(weak_direction) && scan >= 0 && scan < weak_direction->scan_count
               ? weak_direction->scans[scan].translation
               : none;
}
