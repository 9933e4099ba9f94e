/* weak_direction: translation of submaps along weakly observable directions, by greedy merging.
 *
 * Method:
 * 1. Principal axes of each scan's position covariance relative to the anchor, as it is added. A
 *    scan of the largest component with one large and one small axis, and a small heading variance,
 *    has a weakly observable direction.
 * 2. Such scans are clustered into submaps (weak_direction_cluster.c). The anchored scans are the
 *    fixed submap.
 * 3. Walls of the submaps, and their most common thickness (weak_direction_walls.c).
 * 4. Each submap is tried against another at evenly spaced translations along its direction
 *    (weak_direction_translate.c), scored by initial poses, wall thickness and free-space
 *    violations.
 * 5. Greedy merging: the pair with the greatest margin over its best competing translation is
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
#include "src/fields/weak_direction_work.h"
#include "src/containers/disjoint_sets.h"

/* Pairs, scans or walls that are visited, and poses that are fitted, for a work unit. */
enum { VISITS_PER_UNIT = 16, FITS_PER_UNIT = 2 };

#define INTEGER(field, is, from, to) CAIRN_INTEGER(cairn_weak_direction_params, field, is, from, to)
#define LENGTH(field, is)                                                                          \
    CAIRN_NUMBER_ABOVE(cairn_weak_direction_params, field, is, 0, CAIRN_MAX_MAGNITUDE)

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

/* The object and its arrays; NULL from a counting pool. */
static cairn_weak_direction *build(cairn_pool *pool, const cairn_weak_direction_params *params)
{
    size_t scans = (size_t)params->max_scans;
    cairn_weak_direction *weak_direction = cairn_object_take(pool, sizeof *weak_direction);

    CAIRN_TAKE(weak_direction, pool, scans, scans);
    CAIRN_TAKE(weak_direction, pool, submap, scans);
    CAIRN_TAKE(weak_direction, pool, fixed_initial, scans);
    CAIRN_TAKE(weak_direction, pool, fixed_map, scans);
    CAIRN_TAKE(weak_direction, pool, walls, params->max_walls);
    CAIRN_TAKE(weak_direction, pool, submaps, params->max_submaps + 1);
    CAIRN_TAKE(weak_direction, pool, pairs, cairn_weak_direction_pairs_of(params->max_submaps));
    CAIRN_TAKE(weak_direction, pool, trials, WEAK_DIRECTION_MAX_TRIALS + 1);
    CAIRN_TAKE(weak_direction, pool, fits, WEAK_DIRECTION_MAX_TRIALS + 1);
    CAIRN_TAKE(weak_direction, pool, bins, WEAK_DIRECTION_THICKNESS_BINS);
    if (weak_direction != NULL) {
        weak_direction->params = *params;
        weak_direction->has_ended = 1;
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
        !(spread > 0 && spread <= CAIRN_MAX_MAGNITUDE))
        return CAIRN_BAD_ARGUMENT;
    if (set->scan_count > weak_direction->params.max_scans)
        return CAIRN_FULL;
    weak_direction->aligner = aligner;
    weak_direction->set = set;
    weak_direction->scan_count = set->scan_count;
    weak_direction->initial_sigma = spread;
    weak_direction->added_scans = weak_direction->wall_count = 0;
    weak_direction->submap_count = 1;
    weak_direction->has_ended = 0;
    weak_direction->resume = weak_direction->phase_resume = 0;
    weak_direction->trial_resume = weak_direction->pair_resume = 0;
    weak_direction->units_charged = 0;
    memset(&weak_direction->result, 0, sizeof weak_direction->result);
    memset(weak_direction->bins, 0, WEAK_DIRECTION_THICKNESS_BINS * sizeof *weak_direction->bins);
    memset(weak_direction->submaps, 0,
           ((size_t)weak_direction->params.max_submaps + 1) * sizeof *weak_direction->submaps);
    for (int32_t k = 0; k < cairn_weak_direction_pairs_of(weak_direction->params.max_submaps); k++)
        weak_direction->pairs[k].margin = -1;
    return CAIRN_OK;
}

/* Returns the principal axis of greatest variance of a scan's position, and the standard deviations
 * along and across it. */
static void find_axes(const cairn_aligner_pose *aligned, cairn_vec2 *along, cairn_real *deviation,
                      cairn_real *across)
{
    const cairn_real *c = aligned->anchor_covariance;
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

    if (weak_direction == NULL || aligned == NULL || aligned->component != 0 || aligned->anchored)
        return 0;
    find_axes(aligned, &along, &deviation, &across);
    return cairn_sqrt(aligned->anchor_covariance[8]) <= weak_direction->params.max_sigma_theta &&
           across <= weak_direction->params.max_cross_sigma &&
           deviation >= weak_direction->params.weak_sigma;
}

/* Adds the poses of a scan of the fixed submap. */
static void add_fixed(cairn_weak_direction *weak_direction, cairn_pose start, cairn_pose map_scan)
{
    int32_t *count = &weak_direction->submaps[WEAK_DIRECTION_FIXED_SUBMAP].scans;

    weak_direction->submap[weak_direction->added_scans] = WEAK_DIRECTION_OBSERVABLE;
    weak_direction->fixed_initial[*count] = start;
    weak_direction->fixed_map[(*count)++] = map_scan;
}

cairn_status cairn_weak_direction_add(cairn_weak_direction *weak_direction, cairn_pose start,
                                      const cairn_aligner_pose *aligned)
{
    weak_direction_scan *scan;
    cairn_real across;
    cairn_status status;

    if (weak_direction == NULL || aligned == NULL ||
        weak_direction->added_scans == weak_direction->scan_count)
        return CAIRN_BAD_ARGUMENT;
    status = cairn_pose_check(start, CAIRN_MAX_MAGNITUDE, NULL);
    if (status == CAIRN_OK)
        status = cairn_pose_check(aligned->map_scan, CAIRN_MAX_MAGNITUDE, NULL);
    if (status != CAIRN_OK)
        return status;
    scan = &weak_direction->scans[weak_direction->added_scans];
    memset(scan, 0, sizeof *scan);
    scan->initial = start;
    scan->map_scan = aligned->map_scan;
    find_axes(aligned, &scan->along, &scan->deviation, &across);
    if (aligned->component == 0 && aligned->anchored)
        add_fixed(weak_direction, start, aligned->map_scan);
    else if (cairn_weak_direction_is_weak(weak_direction, aligned))
        disjoint_sets_add(weak_direction->submap, weak_direction->added_scans);
    else
        weak_direction->submap[weak_direction->added_scans] = WEAK_DIRECTION_NO_SUBMAP;
    weak_direction->added_scans++;
    return CAIRN_OK;
}

/* ---- Pairs of submaps ---- */

/* 1 when a submap may be translated against another one. */
static int may_merge(const cairn_weak_direction *weak_direction, int32_t moving, int32_t fixed)
{
    const weak_direction_submap *a = &weak_direction->submaps[moving],
                                *b = &weak_direction->submaps[fixed];

    return a->scans > 0 && b->scans > 0 &&
           (fixed == WEAK_DIRECTION_FIXED_SUBMAP ||
            cairn_weak_direction_are_parallel(a->along, b->along));
}

/* Units of an operation that visits all pairs of submaps. */
static int32_t all_pairs_units(const cairn_weak_direction *weak_direction)
{
    return 1 + cairn_weak_direction_pairs_of(weak_direction->submap_count - 1) / VISITS_PER_UNIT;
}

/* Chooses the next pair that is not evaluated; when all are, that of the greatest margin. */
static void choose_pair(cairn_weak_direction *weak_direction)
{
    weak_direction_submap_pair *pair = weak_direction->pairs;

    weak_direction->pair = NULL;
    for (int32_t k = 1; k < weak_direction->submap_count; k++)
        for (int32_t h = 0; h < k; h++, pair++) {
            if (!may_merge(weak_direction, k, h) ||
                (weak_direction->pair != NULL && pair->margin >= 0 &&
                 pair->margin <= weak_direction->pair->margin))
                continue;
            weak_direction->pair = pair;
            weak_direction->moving = k;
            weak_direction->fixed = h;
            if (pair->margin < 0)
                return;
        }
}

/* 1 when a scan is translated. */
static int is_translated(const weak_direction_scan *scan)
{
    return scan->translation.x != 0 || scan->translation.y != 0;
}

/* Translates a scan. */
static void translate(cairn_weak_direction *weak_direction, int32_t i, cairn_vec2 shift)
{
    weak_direction_scan *scan = &weak_direction->scans[i];

    weak_direction->result.translated_scans -= is_translated(scan);
    scan->translation = cairn_vec2_add(scan->translation, shift);
    weak_direction->result.translated_scans += is_translated(scan);
}

/* Merges the current pair at its best translation; the pairs of the merged submap are evaluated
 * again. */
static void merge(cairn_weak_direction *weak_direction)
{
    int32_t moving = weak_direction->moving, fixed = weak_direction->fixed;
    weak_direction_submap *a = &weak_direction->submaps[moving],
                          *b = &weak_direction->submaps[fixed];
    cairn_vec2 shift = cairn_vec2_scale(a->along, weak_direction->pair->translation);
    weak_direction_submap_pair *pair = weak_direction->pairs;

    for (int32_t i = 0; i < weak_direction->scan_count; i++)
        if (weak_direction->submap[i] == moving) {
            weak_direction->submap[i] = fixed;
            translate(weak_direction, i, shift);
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
        for (int32_t h = 0; h < k; h++, pair++)
            if (k == fixed || h == fixed)
                pair->margin = -1;
    weak_direction->result.merged_submaps++;
    weak_direction->phase.items.weighed = fixed;
}

/* ---- The correction ---- */

/* 1 when the walls have a common thickness that the trials are scored by. */
static int has_thickness(const cairn_weak_direction *weak_direction)
{
    return weak_direction->params.use_thickness && weak_direction->result.thickness > 0;
}

/* Units of a scan that is numbered. */
static int32_t number_units(const cairn_weak_direction *weak_direction, int32_t scan)
{
    (void)weak_direction;
    (void)scan;
    return 1;
}

/* Units of a merge, which visits all pairs of submaps, scans and walls. */
static int32_t merge_units(const cairn_weak_direction *weak_direction)
{
    return all_pairs_units(weak_direction) +
           (weak_direction->scan_count + weak_direction->wall_count) / VISITS_PER_UNIT;
}

/* Does an item for each of `count` scans or walls. */
static int do_each(cairn_weak_direction *weak_direction, cairn_budget *budget, int32_t count,
                   int32_t (*units_of)(const cairn_weak_direction *weak_direction, int32_t i),
                   void (*item)(cairn_weak_direction *weak_direction, int32_t i))
{
    struct weak_direction_items *items = &weak_direction->phase.items;

    CAIRN_STEP_BEGIN(weak_direction->phase_resume);
    for (items->next = 0; items->next < count; items->next++) {
        CAIRN_STEP_CHARGE(weak_direction, phase_resume, budget,
                          units_of(weak_direction, items->next));
        item(weak_direction, items->next);
    }
    CAIRN_STEP_END(weak_direction->phase_resume);
}

/* Place of return: items of a phase are done. */
#define EACH(count, units, item)                                                                   \
    CAIRN_STEP_UNTIL(weak_direction->resume,                                                       \
                     do_each(weak_direction, budget, weak_direction->count, units, item))

/* The correction, from clusters to the last merge (Method). */
static int correct(cairn_weak_direction *weak_direction, cairn_budget *budget)
{
    const weak_direction_submap *fixed = &weak_direction->submaps[WEAK_DIRECTION_FIXED_SUBMAP];
    struct weak_direction_items *items = &weak_direction->phase.items;

    CAIRN_STEP_BEGIN(weak_direction->resume);
    CAIRN_STEP_RUN(weak_direction, resume, budget, cairn_weak_direction_cluster);
    if (fixed->scans > 0) {
        CAIRN_STEP_CHARGE(weak_direction, resume, budget, 1 + fixed->scans / FITS_PER_UNIT);
        cairn_weak_direction_fit_initial_poses(weak_direction);
        EACH(scan_count, number_units, cairn_weak_direction_number_scan);
    }
    if (weak_direction->submap_count > 1) {
        for (items->gathers_fixed = 0; items->gathers_fixed < 2; items->gathers_fixed++)
            EACH(scan_count, cairn_weak_direction_gather_units, cairn_weak_direction_gather_walls);
        items->weighed = WEAK_DIRECTION_NO_SUBMAP;
        EACH(wall_count, cairn_weak_direction_weigh_units, cairn_weak_direction_weigh_wall);
        EACH(wall_count, cairn_weak_direction_bin_units, cairn_weak_direction_bin_wall);
        for (;;) {
            CAIRN_STEP_CHARGE(weak_direction, resume, budget, all_pairs_units(weak_direction));
            choose_pair(weak_direction);
            if (weak_direction->pair == NULL)
                break;
            if (weak_direction->pair->margin < 0) {
                CAIRN_STEP_RUN(weak_direction, resume, budget, cairn_weak_direction_begin_trials);
                if (has_thickness(weak_direction))
                    CAIRN_STEP_RUN(weak_direction, resume, budget,
                                   cairn_weak_direction_add_thickness);
                CAIRN_STEP_RUN(weak_direction, resume, budget, cairn_weak_direction_search_trials);
                continue;
            }
            CAIRN_STEP_CHARGE(weak_direction, resume, budget, merge_units(weak_direction));
            merge(weak_direction);
            /* the weights of the fixed submap are not needed again */
            if (weak_direction->fixed != WEAK_DIRECTION_FIXED_SUBMAP)
                EACH(wall_count, cairn_weak_direction_weigh_units, cairn_weak_direction_weigh_wall);
        }
    }
    CAIRN_STEP_END(weak_direction->resume);
}

cairn_status cairn_weak_direction_step(cairn_weak_direction *weak_direction, cairn_budget *budget)
{
    int32_t left;

    if (weak_direction == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (weak_direction->has_ended)
        return CAIRN_OK;
    if (weak_direction->added_scans < weak_direction->scan_count)
        return CAIRN_EMPTY;
    left = budget->left;
    weak_direction->has_ended = correct(weak_direction, budget);
    weak_direction->result.units += left - budget->left;
    return weak_direction->has_ended ? CAIRN_OK : CAIRN_MORE;
}

/* ---- The result ---- */

cairn_weak_direction_result cairn_weak_direction_read(const cairn_weak_direction *weak_direction)
{
    static const cairn_weak_direction_result none = {0};

    return weak_direction->has_ended ? weak_direction->result : none;
}

cairn_vec2 cairn_weak_direction_translation(const cairn_weak_direction *weak_direction,
                                            int32_t scan)
{
    static const cairn_vec2 none = {0, 0};

    return weak_direction->has_ended && scan >= 0 && scan < weak_direction->scan_count
               ? weak_direction->scans[scan].translation
               : none;
}
