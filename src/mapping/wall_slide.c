/* weak_direction: clustering of scans with a weakly observable direction into submaps, and greedy
 * merging of the submaps.
 *
 * Method:
 * 1. Principal axes of each scan's position covariance. A scan of the largest component with one
 *    large and one small axis, and a small heading variance, has a weakly observable direction.
 * 2. Connected components: such scans with equal direction and deviation that share a wall across
 *    the direction form one submap. The scans with observable poses are the fixed submap.
 * 3. Each submap is tried against another at evenly spaced translations along its direction
 *    (wall_slide_shift.c), scored by initial poses, wall thickness (wall_slide_walls.c) and
 *    free-space violations.
 * 4. Greedy merging: the pair with the greatest margin over its best competing translation is
 *    merged; its pairs are evaluated again.
 *
 * Layout: scans; walls of all submaps; for each pair of submaps the best translation.
 * Limits: translations only, headings stay; submaps with two weakly observable directions stay; a
 * submap is merged at a grid translation.
 * Source: Adluru 2008, chapter 8, for hypotheses about the world where scans share no surface; the
 * likelihoods are those of the aligner. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/small_matrix.h"
#include "src/mapping/wall_slide_work.h"

#define MAX_COORDINATE_M CAIRN_REAL(1e6)

enum { SCANS_PER_UNIT = 16 };

static const cairn_real MIN_AXIS_COSINE = CAIRN_REAL(0.99); /* cosine */
static const cairn_real MAX_SIGMA_DIFFERENCE =
    CAIRN_REAL(0.03); /* relative difference of the deviations */

cairn_wall_slide_params cairn_wall_slide_default(void)
{
    cairn_wall_slide_params params = {
        .max_scans = 64,
        .max_walls = 1024,
        .max_parts = 24,
        .thickness = 1,
        .loose = CAIRN_REAL(0.03),
        .firm = CAIRN_REAL(0.05),
        .firm_angle = CAIRN_PI / 180,
        .step = CAIRN_REAL(0.02),
        .tolerance = CAIRN_REAL(0.02),
    };

    return params;
}

static int is_count(int32_t count, int32_t least, int32_t most)
{
    return count >= least && count <= most;
}

static int is_length(cairn_real length)
{
    return length > 0 && length <= MAX_COORDINATE_M;
}

static int params_are_valid(const cairn_wall_slide_params *p)
{
    return p != NULL && is_count(p->max_scans, 1, 1 << 16) && is_count(p->max_walls, 1, 1 << 16) &&
           is_count(p->max_parts, 1, 64) && is_length(p->loose) && is_length(p->firm) &&
           is_length(p->firm_angle) && is_length(p->step) && is_length(p->tolerance);
}

static size_t pairs_of(int32_t parts)
{
    return (size_t)(parts * (parts + 1) / 2);
}

static cairn_wall_slide *carve(cairn_pool *pool, const cairn_wall_slide_params *params)
{
    cairn_wall_slide *slide = cairn_pool_take_one(pool, sizeof *slide), made;
    size_t scans = (size_t)params->max_scans;

    memset(&made, 0, sizeof made);
    made.scans = cairn_pool_take(pool, scans, sizeof *made.scans);
    made.from = cairn_pool_take(pool, scans, sizeof *made.from);
    made.to = cairn_pool_take(pool, scans, sizeof *made.to);
    made.walls = cairn_pool_take(pool, (size_t)params->max_walls, sizeof *made.walls);
    made.parts = cairn_pool_take(pool, (size_t)params->max_parts + 1, sizeof *made.parts);
    made.pairs = cairn_pool_take(pool, pairs_of(params->max_parts), sizeof *made.pairs);
    made.trials = cairn_pool_take(pool, SLIDE_SHIFTS + 1, sizeof *made.trials);
    made.fits = cairn_pool_take(pool, SLIDE_SHIFTS + 1, sizeof *made.fits);
    made.bins = cairn_pool_take(pool, SLIDE_BINS, sizeof *made.bins);
    made.gaps = cairn_pool_take(pool, SLIDE_BINS, sizeof *made.gaps);
    made.phase = SLIDE_DONE;
    made.params = *params;
    if (slide != NULL)
        *slide = made;
    return slide;
}

size_t cairn_wall_slide_memory(const cairn_wall_slide_params *params)
{
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_wall_slide_create(cairn_wall_slide **slide, cairn_pool *pool,
                                     const cairn_wall_slide_params *params)
{
    size_t need = cairn_wall_slide_memory(params);

    if (slide == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    *slide = carve(pool, params);
    return CAIRN_OK;
}

/* ---- Scans ---- */

cairn_status cairn_wall_slide_begin(cairn_wall_slide *slide, const cairn_aligner *aligner,
                                    const cairn_scan_set *set, cairn_real spread)
{
    cairn_wall_slide *x = slide;

    if (x == NULL || aligner == NULL || set == NULL || cairn_aligner_running(aligner) ||
        cairn_aligner_scan_count(aligner) != set->scan_count || !is_length(spread))
        return CAIRN_BAD_ARGUMENT;
    if (set->scan_count > x->params.max_scans)
        return CAIRN_FULL;
    x->aligner = aligner;
    x->set = set;
    x->scan_count = set->scan_count;
    x->spread = spread;
    x->added = x->wall_count = 0;
    x->part_count = 1;
    x->phase = SLIDE_GATHER;
    x->i = x->j = x->debt = 0;
    memset(&x->result, 0, sizeof x->result);
    memset(x->bins, 0, SLIDE_BINS * sizeof *x->bins);
    memset(x->gaps, 0, SLIDE_BINS * sizeof *x->gaps);
    memset(x->parts, 0, ((size_t)x->params.max_parts + 1) * sizeof *x->parts);
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

int32_t cairn_wall_slide_is_loose(const cairn_wall_slide *slide, const cairn_aligner_pose *aligned)
{
    cairn_real deviation, across;
    cairn_vec2 along;

    if (slide == NULL || aligned == NULL || aligned->part != 0 || aligned->placed)
        return 0;
    find_axes(aligned, &along, &deviation, &across);
    return cairn_sqrt(aligned->covariance[8]) <= slide->params.firm_angle &&
           across <= slide->params.firm && deviation >= slide->params.loose;
}

static int is_within_limit(cairn_pose pose)
{
    return cairn_abs(pose.x) <= MAX_COORDINATE_M && cairn_abs(pose.y) <= MAX_COORDINATE_M;
}

cairn_status cairn_wall_slide_add(cairn_wall_slide *slide, cairn_pose start,
                                  const cairn_aligner_pose *aligned)
{
    cairn_wall_slide *x = slide;
    slide_scan *scan;
    cairn_real across;

    if (x == NULL || aligned == NULL || x->phase != SLIDE_GATHER || x->added == x->scan_count)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pose_is_finite(start) || !cairn_pose_is_finite(aligned->map_scan))
        return CAIRN_NOT_FINITE;
    if (!is_within_limit(start) || !is_within_limit(aligned->map_scan))
        return CAIRN_BAD_ARGUMENT;
    scan = &x->scans[x->added];
    memset(scan, 0, sizeof *scan);
    scan->start = start;
    scan->map_scan = aligned->map_scan;
    find_axes(aligned, &scan->along, &scan->deviation, &across);
    scan->is_loose = cairn_wall_slide_is_loose(x, aligned);
    scan->part = scan->is_loose ? x->added : SLIDE_NONE;
    if (aligned->part == 0 && aligned->placed) {
        scan->part = SLIDE_FIRM;
        x->from[x->parts[SLIDE_FIRM].scans] = start;
        x->to[x->parts[SLIDE_FIRM].scans++] = aligned->map_scan;
    }
    x->added++;
    return CAIRN_OK;
}

/* ---- Submaps ---- */

static int is_same_submap(const slide_scan *a, const slide_scan *b)
{
    return b->is_loose && a->part != b->part &&
           cairn_abs(cairn_vec2_dot(a->along, b->along)) >= MIN_AXIS_COSINE &&
           cairn_abs(a->deviation - b->deviation) <=
               MAX_SIGMA_DIFFERENCE * cairn_max(a->deviation, b->deviation);
}

static void merge_clusters(cairn_wall_slide *slide, int32_t first, int32_t second)
{
    int32_t low = first < second ? first : second, high = first + second - low;

    for (int32_t k = 0; k < slide->scan_count; k++)
        if (slide->scans[k].is_loose && slide->scans[k].part == high)
            slide->scans[k].part = low;
}

/* Tests scan i against one of the scans before it, and merges their clusters when they share a
 * wall. */
static int32_t cluster_item(cairn_wall_slide *slide)
{
    const slide_scan *a = &slide->scans[slide->i], *b;
    cairn_vec2 along;
    int32_t passed = 0, units;

    if (slide->i == slide->scan_count) {
        slide->phase = SLIDE_NUMBER;
        slide->i = 0;
        return 1;
    }
    for (; a->is_loose && slide->j < slide->i; slide->j++, passed++)
        if (is_same_submap(a, &slide->scans[slide->j]))
            break;
    if (!a->is_loose || slide->j == slide->i) {
        slide->i++;
        slide->j = 0;
        return 1 + passed / SCANS_PER_UNIT;
    }
    b = &slide->scans[slide->j];
    along =
        cairn_transform_direction(cairn_transform_of(cairn_pose_inverse(a->map_scan)), a->along);
    if (cairn_aligner_share_wall(slide->aligner, slide->i, slide->j,
                                 cairn_pose_between(b->map_scan, a->map_scan), along, &units))
        merge_clusters(slide, a->part, b->part);
    slide->j++;
    return units + 2 + (passed + slide->scan_count) / SCANS_PER_UNIT;
}

/* Numbers the submap of scan i and adds the offset of its initial pose; a submap beyond max_submaps
 * stays. */
static void number_scan(cairn_wall_slide *slide, int32_t i, cairn_pose gauge)
{
    slide_scan *scan = &slide->scans[i];
    cairn_pose expected = cairn_pose_compose(gauge, scan->start);
    slide_part *part;

    if (scan->part == SLIDE_NONE)
        return;
    if (scan->is_loose && scan->part == i) {
        if (slide->part_count > slide->params.max_parts) {
            slide->result.left_out++;
            slide->scans[i].is_loose = 0;
            scan->part = SLIDE_NONE;
            return;
        }
        slide->parts[slide->part_count].along = scan->along;
        scan->part = slide->part_count++;
    } else if (scan->is_loose) {
        scan->part = slide->scans[scan->part].part;
        scan->is_loose = scan->part != SLIDE_NONE;
        if (!scan->is_loose)
            return;
    }
    part = &slide->parts[scan->part];
    part->scans += scan->is_loose;
    part->off.x += expected.x - scan->map_scan.x;
    part->off.y += expected.y - scan->map_scan.y;
}

/* Numbers all submaps; none when there is no fixed or no weak submap. */
static int32_t number_item(cairn_wall_slide *slide)
{
    int32_t firm = slide->parts[SLIDE_FIRM].scans;
    cairn_pose gauge =
        firm > 0 ? cairn_pose_fit(slide->from, slide->to, NULL, firm, 1) : cairn_pose_identity();

    for (int32_t i = 0; i < slide->scan_count && firm > 0; i++)
        number_scan(slide, i, gauge);
    for (size_t k = 0; k < pairs_of(slide->part_count - 1); k++)
        slide->pairs[k].surer = -1;
    slide->result.parts = slide->part_count - 1;
    slide->phase = slide->result.parts > 0 ? SLIDE_WALLS : SLIDE_DONE;
    return 1 + slide->scan_count / 2;
}

/* ---- Pairs of submaps ---- */

/* Returns 1 when a submap may be translated against another one. */
static int may_merge(const cairn_wall_slide *slide, int32_t moving, int32_t fixed)
{
    const slide_part *a = &slide->parts[moving], *b = &slide->parts[fixed];

    return a->scans > 0 && b->scans > 0 &&
           (fixed == SLIDE_FIRM ||
            cairn_abs(cairn_vec2_dot(a->along, b->along)) >= MIN_AXIS_COSINE);
}

/* Merges submap `moving` into `fixed` at their best translation. */
static void merge_submaps(cairn_wall_slide *slide, int32_t moving, int32_t fixed)
{
    slide_part *a = &slide->parts[moving], *b = &slide->parts[fixed];
    cairn_vec2 shift = cairn_vec2_scale(a->along, cairn_slide_pair(slide, moving, fixed)->shift);

    for (int32_t i = 0; i < slide->scan_count; i++)
        if (slide->scans[i].part == moving) {
            slide->scans[i].part = fixed;
            slide->scans[i].shift = cairn_vec2_add(slide->scans[i].shift, shift);
        }
    for (int32_t k = 0; k < slide->wall_count; k++)
        if (slide->walls[k].part == moving) {
            slide->walls[k].part = fixed;
            slide->walls[k].middle = cairn_vec2_add(slide->walls[k].middle, shift);
        }
    b->off = cairn_vec2_add(b->off,
                            cairn_vec2_sub(a->off, cairn_vec2_scale(shift, (cairn_real)a->scans)));
    b->scans += a->scans;
    a->scans = 0;
    for (int32_t k = 1; k < slide->part_count; k++)
        for (int32_t h = 0; h < k; h++)
            if (k == fixed || h == fixed)
                cairn_slide_pair(slide, k, h)->surer = -1;
    slide->result.joined++;
    slide->fixed = fixed;
    slide->i = 0;
    /* the weights of the fixed submap are not needed again */
    slide->phase = fixed == SLIDE_FIRM ? SLIDE_NEXT : SLIDE_SHARE_AGAIN;
}

static void finish(cairn_wall_slide *slide)
{
    for (int32_t i = 0; i < slide->scan_count; i++)
        slide->result.slid += slide->scans[i].shift.x != 0 || slide->scans[i].shift.y != 0;
    slide->phase = SLIDE_DONE;
}

/* Starts the trials of the next pair without a result; when all have one, merges the pair of
 * greatest margin. */
static int32_t next_item(cairn_wall_slide *slide)
{
    int32_t moving = 0, fixed = 0,
            units = 1 + (int32_t)pairs_of(slide->part_count - 1) / SCANS_PER_UNIT;

    for (int32_t k = 1; k < slide->part_count; k++)
        for (int32_t h = 0; h < k; h++) {
            if (!may_merge(slide, k, h))
                continue;
            if (cairn_slide_pair(slide, k, h)->surer < 0) {
                return units + cairn_slide_begin_pair(slide, k, h);
            }
            if (moving == 0 || cairn_slide_pair(slide, k, h)->surer >
                                   cairn_slide_pair(slide, moving, fixed)->surer) {
                moving = k;
                fixed = h;
            }
        }
    if (moving > 0)
        merge_submaps(slide, moving, fixed);
    else
        finish(slide);
    return units + (slide->scan_count + slide->wall_count) / SCANS_PER_UNIT;
}

/* ---- Phases ---- */

/* Executes item i of a phase of `count` items, then enters the next phase. */
static int32_t run_through(cairn_wall_slide *slide, int32_t count,
                           int32_t (*phase_item)(cairn_wall_slide *), slide_phase next)
{
    int32_t units = slide->i < count ? phase_item(slide) : 1;

    if (++slide->i >= count) {
        slide->i = slide->j = 0;
        slide->phase = next;
    }
    return units;
}

/* Walls of the weak submaps, then those of the fixed one. */
static int32_t gather_item(cairn_wall_slide *slide)
{
    int32_t firm = slide->j,
            units = run_through(slide, slide->scan_count, cairn_slide_walls_item, SLIDE_SHARE);

    if (slide->phase == SLIDE_SHARE && !firm) {
        slide->phase = SLIDE_WALLS;
        slide->j = 1;
    }
    return units;
}

static int32_t phase_item(cairn_wall_slide *slide)
{
    switch (slide->phase) {
    case SLIDE_TIE:
        return cluster_item(slide);
    case SLIDE_NUMBER:
        return number_item(slide);
    case SLIDE_WALLS:
        return gather_item(slide);
    case SLIDE_SHARE:
        return run_through(slide, slide->wall_count, cairn_slide_share_item, SLIDE_LEARN);
    case SLIDE_SHARE_AGAIN: /* of the merged submap */
        return run_through(slide, slide->wall_count, cairn_slide_share_item, SLIDE_NEXT);
    case SLIDE_LEARN:
        return run_through(slide, slide->wall_count, cairn_slide_learn_item, SLIDE_NEXT);
    case SLIDE_THICKNESS:
        return run_through(slide, slide->wall_count, cairn_slide_thickness_item, SLIDE_OBJECT);
    case SLIDE_OBJECT:
        return cairn_slide_object_item(slide);
    default:
        return next_item(slide);
    }
}

cairn_status cairn_wall_slide_step(cairn_wall_slide *slide, cairn_budget *budget)
{
    cairn_wall_slide *x = slide;

    if (x == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (x->phase == SLIDE_GATHER && x->added < x->scan_count)
        return CAIRN_EMPTY;
    if (x->phase == SLIDE_GATHER)
        x->phase = SLIDE_TIE;
    while (x->phase != SLIDE_DONE || x->debt > 0) {
        int32_t paid = x->debt < budget->left ? x->debt : budget->left;

        if (budget->left <= 0)
            return CAIRN_MORE;
        x->debt -= paid;
        x->result.units += paid;
        budget->left -= paid;
        if (x->debt == 0 && x->phase != SLIDE_DONE)
            x->debt = phase_item(x);
    }
    return CAIRN_OK;
}

/* ---- The result ---- */

static int has_ended(const cairn_wall_slide *slide)
{
    return slide->phase == SLIDE_DONE && slide->debt == 0;
}

cairn_wall_slide_result cairn_wall_slide_read(const cairn_wall_slide *slide)
{
    static const cairn_wall_slide_result none = {0, 0, 0, 0, 0, 0, 0};

    return has_ended(slide) ? slide->result : none;
}

cairn_vec2 cairn_wall_slide_shift_of(const cairn_wall_slide *slide, int32_t scan)
{
    static const cairn_vec2 none = {0, 0};

    return has_ended(slide) && scan >= 0 && scan < slide->scan_count ? slide->scans[scan].shift
                                                                     : none;
}
