/* Parts that slide along walls: which scans they are, and which of them join first.
 *
 * Method: a scan of the alignment's largest part whose covariance is long and thin may slide along
 * its long axis. Scans that may slide the same way, are known alike and share a wall across it are
 * one part; what the alignment has placed is the firm part. A part is tried against another at even
 * shifts along its direction (wall_slide_shift.c). The pair whose best shift is surest against all
 * that are not near it joins, and those parts are weighed anew.
 *
 * Layout: scans; walls of all parts; for each pair of parts what was found.
 *
 * Limits: shifts only, headings stay; parts that may slide in two directions stay; a part joins at
 * a shift of the grid.
 *
 * Source: the choice of the place by likelihood is that of the aligner; that hypotheses about
 * the world help where scans share no surface, Adluru 2008, chapter 8. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/small_matrix.h"
#include "src/mapping/wall_slide_work.h"

#define LIMIT CAIRN_REAL(1e6)

enum { SCANS_OF_UNIT = 16 };

static const cairn_real SAME_WAY = CAIRN_REAL(0.99);    /* cosine */
static const cairn_real KNOWN_ALIKE = CAIRN_REAL(0.03); /* share of the deviation */

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
    return length > 0 && length <= LIMIT;
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
    cairn_wall_slide *x = cairn_pool_take_one(pool, sizeof *x), made;
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
    if (x != NULL)
        *x = made;
    return x;
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

/* The direction in which a scan is known least, and its standard deviation there and across. */
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

static int is_near(cairn_pose pose)
{
    return cairn_abs(pose.x) <= LIMIT && cairn_abs(pose.y) <= LIMIT;
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
    if (!is_near(start) || !is_near(aligned->map_scan))
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

/* ---- Parts ---- */

static int slide_as_one(const slide_scan *a, const slide_scan *b)
{
    return b->is_loose && a->part != b->part &&
           cairn_abs(cairn_vec2_dot(a->along, b->along)) >= SAME_WAY &&
           cairn_abs(a->deviation - b->deviation) <=
               KNOWN_ALIKE * cairn_max(a->deviation, b->deviation);
}

static void tie(cairn_wall_slide *x, int32_t first, int32_t second)
{
    int32_t low = first < second ? first : second, high = first + second - low;

    for (int32_t k = 0; k < x->scan_count; k++)
        if (x->scans[k].is_loose && x->scans[k].part == high)
            x->scans[k].part = low;
}

/* Scan i with one of the scans before it. */
static int32_t tie_item(cairn_wall_slide *x)
{
    const slide_scan *a = &x->scans[x->i], *b;
    cairn_vec2 along;
    int32_t passed = 0, units;

    if (x->i == x->scan_count) {
        x->phase = SLIDE_NUMBER;
        x->i = 0;
        return 1;
    }
    for (; a->is_loose && x->j < x->i; x->j++, passed++)
        if (slide_as_one(a, &x->scans[x->j]))
            break;
    if (!a->is_loose || x->j == x->i) {
        x->i++;
        x->j = 0;
        return 1 + passed / SCANS_OF_UNIT;
    }
    b = &x->scans[x->j];
    along =
        cairn_transform_direction(cairn_transform_of(cairn_pose_inverse(a->map_scan)), a->along);
    if (cairn_aligner_share_wall(x->aligner, x->i, x->j,
                                 cairn_pose_between(b->map_scan, a->map_scan), along, &units))
        tie(x, a->part, b->part);
    x->j++;
    return units + 2 + (passed + x->scan_count) / SCANS_OF_UNIT;
}

/* Numbers the part of scan i, and adds what its start says; a part that finds no number stays
 * where it is. */
static void number_scan(cairn_wall_slide *x, int32_t i, cairn_pose gauge)
{
    slide_scan *scan = &x->scans[i];
    cairn_pose expected = cairn_pose_compose(gauge, scan->start);
    slide_part *part;

    if (scan->part == SLIDE_NONE)
        return;
    if (scan->is_loose && scan->part == i) {
        if (x->part_count > x->params.max_parts) {
            x->result.left_out++;
            x->scans[i].is_loose = 0;
            scan->part = SLIDE_NONE;
            return;
        }
        x->parts[x->part_count].along = scan->along;
        scan->part = x->part_count++;
    } else if (scan->is_loose) {
        scan->part = x->scans[scan->part].part;
        scan->is_loose = scan->part != SLIDE_NONE;
        if (!scan->is_loose)
            return;
    }
    part = &x->parts[scan->part];
    part->scans += scan->is_loose;
    part->off.x += expected.x - scan->map_scan.x;
    part->off.y += expected.y - scan->map_scan.y;
}

/* All parts; none when nothing is firm or nothing may slide. */
static int32_t number_item(cairn_wall_slide *x)
{
    int32_t firm = x->parts[SLIDE_FIRM].scans;
    cairn_pose gauge =
        firm > 0 ? cairn_pose_fit(x->from, x->to, NULL, firm, 1) : cairn_pose_identity();

    for (int32_t i = 0; i < x->scan_count && firm > 0; i++)
        number_scan(x, i, gauge);
    for (size_t k = 0; k < pairs_of(x->part_count - 1); k++)
        x->pairs[k].surer = -1;
    x->result.parts = x->part_count - 1;
    x->phase = x->result.parts > 0 ? SLIDE_WALLS : SLIDE_DONE;
    return 1 + x->scan_count / 2;
}

/* ---- Pairs of parts ---- */

/* 1 when a part may be shifted against another one. */
static int may_join(const cairn_wall_slide *x, int32_t moving, int32_t fixed)
{
    const slide_part *a = &x->parts[moving], *b = &x->parts[fixed];

    return a->scans > 0 && b->scans > 0 &&
           (fixed == SLIDE_FIRM || cairn_abs(cairn_vec2_dot(a->along, b->along)) >= SAME_WAY);
}

/* The one part stays, the other takes its number. */
static void join(cairn_wall_slide *x, int32_t moving, int32_t fixed)
{
    slide_part *a = &x->parts[moving], *b = &x->parts[fixed];
    cairn_vec2 shift = cairn_vec2_scale(a->along, cairn_slide_pair(x, moving, fixed)->shift);

    for (int32_t i = 0; i < x->scan_count; i++)
        if (x->scans[i].part == moving) {
            x->scans[i].part = fixed;
            x->scans[i].shift = cairn_vec2_add(x->scans[i].shift, shift);
        }
    for (int32_t k = 0; k < x->wall_count; k++)
        if (x->walls[k].part == moving) {
            x->walls[k].part = fixed;
            x->walls[k].middle = cairn_vec2_add(x->walls[k].middle, shift);
        }
    b->off = cairn_vec2_add(b->off,
                            cairn_vec2_sub(a->off, cairn_vec2_scale(shift, (cairn_real)a->scans)));
    b->scans += a->scans;
    a->scans = 0;
    for (int32_t k = 1; k < x->part_count; k++)
        for (int32_t h = 0; h < k; h++)
            if (k == fixed || h == fixed)
                cairn_slide_pair(x, k, h)->surer = -1;
    x->result.joined++;
    x->fixed = fixed;
    x->i = 0;
    /* that of the firm part is not asked again */
    x->phase = fixed == SLIDE_FIRM ? SLIDE_NEXT : SLIDE_SHARE_AGAIN;
}

static void finish(cairn_wall_slide *x)
{
    for (int32_t i = 0; i < x->scan_count; i++)
        x->result.slid += x->scans[i].shift.x != 0 || x->scans[i].shift.y != 0;
    x->phase = SLIDE_DONE;
}

/* The next pair that is not weighed; when all are, the surest joins. */
static int32_t next_item(cairn_wall_slide *x)
{
    int32_t moving = 0, fixed = 0, units = 1 + (int32_t)pairs_of(x->part_count - 1) / SCANS_OF_UNIT;

    for (int32_t k = 1; k < x->part_count; k++)
        for (int32_t h = 0; h < k; h++) {
            if (!may_join(x, k, h))
                continue;
            if (cairn_slide_pair(x, k, h)->surer < 0) {
                return units + cairn_slide_begin_pair(x, k, h);
            }
            if (moving == 0 ||
                cairn_slide_pair(x, k, h)->surer > cairn_slide_pair(x, moving, fixed)->surer) {
                moving = k;
                fixed = h;
            }
        }
    if (moving > 0)
        join(x, moving, fixed);
    else
        finish(x);
    return units + (x->scan_count + x->wall_count) / SCANS_OF_UNIT;
}

/* ---- The steps ---- */

/* Item i of a phase that has `count` of them, then the next phase. */
static int32_t run_through(cairn_wall_slide *x, int32_t count, int32_t (*item)(cairn_wall_slide *),
                           slide_phase next)
{
    int32_t units = x->i < count ? item(x) : 1;

    if (++x->i >= count) {
        x->i = x->j = 0;
        x->phase = next;
    }
    return units;
}

/* Walls of the parts that may slide, then the firm ones. */
static int32_t gather_item(cairn_wall_slide *x)
{
    int32_t firm = x->j, units = run_through(x, x->scan_count, cairn_slide_walls_item, SLIDE_SHARE);

    if (x->phase == SLIDE_SHARE && !firm) {
        x->phase = SLIDE_WALLS;
        x->j = 1;
    }
    return units;
}

static int32_t item(cairn_wall_slide *x)
{
    switch (x->phase) {
    case SLIDE_TIE:
        return tie_item(x);
    case SLIDE_NUMBER:
        return number_item(x);
    case SLIDE_WALLS:
        return gather_item(x);
    case SLIDE_SHARE:
        return run_through(x, x->wall_count, cairn_slide_share_item, SLIDE_LEARN);
    case SLIDE_SHARE_AGAIN: /* of the part that another has joined */
        return run_through(x, x->wall_count, cairn_slide_share_item, SLIDE_NEXT);
    case SLIDE_LEARN:
        return run_through(x, x->wall_count, cairn_slide_learn_item, SLIDE_NEXT);
    case SLIDE_THICKNESS:
        return run_through(x, x->wall_count, cairn_slide_thickness_item, SLIDE_OBJECT);
    case SLIDE_OBJECT:
        return cairn_slide_object_item(x);
    default:
        return next_item(x);
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
            x->debt = item(x);
    }
    return CAIRN_OK;
}

/* ---- The result ---- */

static int has_ended(const cairn_wall_slide *x)
{
    return x->phase == SLIDE_DONE && x->debt == 0;
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
