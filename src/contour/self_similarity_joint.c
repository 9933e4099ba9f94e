/* Cuts of shapes whose limbs turned at their joints.
 *
 * A limb that turned is as it was: what lies together on one rigid part looks the same from both
 * sides, up to a motion. So two samples are compared by the stretches of the outline about them,
 * the one mirrored and laid on the other as well as a rigid motion can, and a stretch may lie to
 * either side of its sample: one beside a joint is told by the part that it belongs to. One arc is
 * warped onto the other by that. What did not turn, the body between the limbs, lies close when one
 * arc is mirrored: the mirror line is fitted once more, straight at first, so that what lies far
 * counts little.
 *
 * Method: all pairs of every other sample are warped and tried; the best, and those that were best
 * before, are fitted, and ranked by the weighted geometric mean of the warp and what lies close;
 * that is blended with the first judgement.
 *
 * Limits: where limbs in front and behind are as alike as those left and right, the body alone
 * tells its axis. */
#include "src/core/build.h"

#include "src/contour/self_similarity_work.h"

/* How many cuts of the scan are fitted. */
enum { JOINTED = 12 };
/* A stretch is two of these shares of the outline long, and lies off its sample by one at most. */
enum { PART = 32 };
/* In spans: about the length of a stretch, of which the difference of two is told. */
#define STRETCH CAIRN_REAL(0.25)
/* Of the warp, in the scan and at last; the rest is that of what lies close. */
#define SCAN_SHARE CAIRN_REAL(0.5)
#define WARP_SHARE CAIRN_REAL(0.5)
/* Axes are where a fit for joints puts them once the shape is so much jointed. */
#define MOVED CAIRN_REAL(0.5)

static int32_t reach_of(const cairn_self_similarity *s)
{
    return (s->params.points + PART / 2) / PART;
}

/* ---- How unlike stretches are ---- */

/* Sums over pairs of points, for the rigid motion that lays one set on the other. */
typedef struct motion_sums {
    cairn_vec2 first, second;
    cairn_real squares, dot, cross;
    int32_t count;
} motion_sums;

static void add_pair(motion_sums *sums, cairn_vec2 p, cairn_vec2 q)
{
    sums->first = cairn_vec2_add(sums->first, p);
    sums->second = cairn_vec2_add(sums->second, q);
    sums->squares += cairn_vec2_norm_squared(p) + cairn_vec2_norm_squared(q);
    sums->dot += cairn_vec2_dot(p, q);
    sums->cross += cairn_vec2_cross(p, q);
    sums->count++;
}

/* The mean square that the best motion leaves. */
static cairn_real left_by_motion(const motion_sums *sums)
{
    cairn_real n = (cairn_real)sums->count, dot, cross, squares;

    squares = sums->squares -
              (cairn_vec2_norm_squared(sums->first) + cairn_vec2_norm_squared(sums->second)) / n;
    dot = sums->dot - cairn_vec2_dot(sums->first, sums->second) / n;
    cross = sums->cross - cairn_vec2_cross(sums->first, sums->second) / n;
    return cairn_max(0, squares - 2 * cairn_sqrt(dot * dot + cross * cross)) / n;
}

/* The stretch about sample i and the mirror image of that about k, halfway on to the neighbour
 * that `step` leads to. */
static cairn_real compare_halfway(const cairn_self_similarity *s, int32_t i, int32_t k,
                                  int32_t step)
{
    int32_t n = s->params.points, reach = reach_of(s);
    motion_sums sums = {{0, 0}, {0, 0}, 0, 0, 0, 0};

    for (int32_t m = -reach; m <= reach; m++) {
        int32_t back = (k - m + n) % n;
        cairn_vec2 p = cairn_vec2_sub(s->samples[(i + m + n) % n], s->samples[i]);
        cairn_vec2 q = cairn_vec2_sub(s->samples[back], s->samples[k]);
        cairn_vec2 next = cairn_vec2_sub(s->samples[(back + step + n) % n], s->samples[k]);

        q = cairn_vec2_scale(cairn_vec2_add(q, next), CAIRN_REAL(0.5));
        q.y = -q.y;
        add_pair(&sums, p, q);
    }
    return left_by_motion(&sums);
}

/* Of a stretch, and of cells that it slides over. */
static int32_t stretch_units(const cairn_self_similarity *s)
{
    return 1 + reach_of(s);
}

/* Samples lie anywhere on the outline: the second is tried where it is and halfway to its
 * neighbours. */
cairn_status cairn_similarity_near_step(cairn_self_similarity *s, cairn_budget *budget)
{
    int32_t n = s->params.points;

    for (; s->i < n; s->i++, s->k = 0)
        for (; s->k <= s->i; s->k++) {
            cairn_real least;

            if (!cairn_budget_pay(budget, &s->paid, 3 * stretch_units(s)))
                return CAIRN_MORE;
            least = cairn_min(
                compare_halfway(s, s->i, s->k, 0),
                cairn_min(compare_halfway(s, s->i, s->k, -1), compare_halfway(s, s->i, s->k, 1)));
            s->unlike[s->i * n + s->k] = s->unlike[s->k * n + s->i] =
                cairn_sqrt(least) / (STRETCH * s->span);
        }
    return CAIRN_OK;
}

/* The best of the stretches that lie a little off both samples by the same: a row a time of
 * those that do. s->i: the sum of the samples. */
cairn_status cairn_similarity_slide_step(cairn_self_similarity *s, cairn_budget *budget)
{
    int32_t n = s->params.points, reach = reach_of(s);

    for (; s->i < n; s->i++) {
        if (!cairn_budget_pay(budget, &s->paid, 1 + n * stretch_units(s) / SIMILARITY_CELLS_A_UNIT))
            return CAIRN_MORE;
        for (int32_t k = 0; k < n; k++)
            s->sum[k] = s->unlike[k * n + (s->i - k + n) % n];
        for (int32_t k = 0; k < n; k++) {
            cairn_real least = s->sum[k];

            for (int32_t off = -reach; off <= reach; off++)
                least = cairn_min(least, s->sum[(k + off + n) % n]);
            s->unlike[k * n + (s->i - k + n) % n] = least;
        }
    }
    return CAIRN_OK;
}

/* ---- Warps ---- */

/* One arc warped onto the other. */
static cairn_real warp_of(cairn_self_similarity *s, const similarity_cut *cut, int32_t stride)
{
    similarity_sides sides = cairn_similarity_sides(s, cut, stride);
    int32_t *there = s->walk, *back = there + sides.count[0], n = s->params.points;
    similarity_warp warp;

    for (int32_t i = 0; i < sides.count[0]; i++)
        there[i] = (sides.first[0] + i * stride) % n;
    for (int32_t i = 0; i < sides.count[1]; i++)
        back[i] = (sides.first[1] + (sides.count[1] - 1 - i) * stride) % n;
    s->comparisons++;
    warp = cairn_similarity_warp(s, there, sides.count[0], back, sides.count[1]);
    return warp.sum / (cairn_real)warp.pairs;
}

/* Of a warp between two ends. */
static int32_t warp_units(const cairn_self_similarity *s, int32_t stride)
{
    int32_t side = s->params.points / stride;

    return 4 + side * side / 4 / SIMILARITY_CELLS_A_UNIT;
}

/* The geometric mean, weighted. */
static cairn_real blend(cairn_real first, cairn_real second, cairn_real share)
{
    const cairn_real least = CAIRN_REAL(1e-6);

    return cairn_exp((1 - share) * cairn_log(cairn_max(least, first)) +
                     share * cairn_log(cairn_max(least, second)));
}

void cairn_similarity_scan_near_begin(cairn_self_similarity *s)
{
    s->scanned.count = 0;
    s->robust = 1;
}

cairn_status cairn_similarity_scan_near_step(cairn_self_similarity *s, cairn_budget *budget)
{
    int32_t units =
        warp_units(s, SIMILARITY_STRIDE) + cairn_similarity_trial_units(s, SIMILARITY_STRIDE);

    for (; s->i < s->params.points; s->i += SIMILARITY_STRIDE, s->k = 0)
        for (; s->k < s->i; s->k += SIMILARITY_STRIDE) {
            similarity_trial *straight = &s->trial[0];
            int makes_cut = cairn_similarity_makes_cut(s, s->i, s->k);

            if (!cairn_budget_pay(budget, &s->paid, makes_cut ? units : 1))
                return CAIRN_MORE;
            if (!makes_cut)
                continue;
            straight->cut = cairn_similarity_cut_at(s->i, s->k);
            cairn_similarity_try(s, straight, SIMILARITY_STRIDE);
            straight->cut.cost = blend(straight->cut.cost,
                                       warp_of(s, &straight->cut, SIMILARITY_STRIDE), SCAN_SHARE);
            cairn_similarity_offer(s, &s->scanned, &straight->cut);
        }
    return CAIRN_OK;
}

/* ---- The best of all ---- */

/* All are fitted from straight on. */
void cairn_similarity_blend_begin(cairn_self_similarity *s)
{
    int32_t warped = s->scanned.count < JOINTED ? s->scanned.count : JOINTED;

    cairn_similarity_line_up(s, warped, &s->list, SIMILARITY_KEPT - JOINTED);
    s->warped = warped;
    s->list.count = 0;
    s->i = 0;
    s->k = 0;
}

cairn_status cairn_similarity_blend_step(cairn_self_similarity *s, cairn_budget *budget)
{
    int32_t units = warp_units(s, 1);

    for (; s->i < s->scanned.count; s->i++) {
        similarity_cut *before = &s->scanned.cuts[s->i], straight = *before, cut;

        straight.bend = straight.skew = 0;
        if (s->k == 0)
            cairn_similarity_fit_begin(s, &straight);
        s->k = 1;
        if (cairn_similarity_fit_step(s, budget) != CAIRN_OK ||
            !cairn_budget_pay(budget, &s->paid, units))
            return CAIRN_MORE;
        s->k = 0;
        cut = s->trial[s->current].cut;
        cut.warp = warp_of(s, &cut, 1);
        cut.cost = blend(s->i < s->warped ? cut.whole : before->whole,
                         blend(cut.close, cut.warp, WARP_SHARE), s->jointed);
        if (s->i >= s->warped && s->jointed < MOVED) {
            before->cost = cut.cost;
            before->warp = cut.warp;
            cut = *before;
        }
        cairn_similarity_set_arcs(s, &cut);
        cairn_similarity_offer(s, &s->list, &cut);
    }
    return CAIRN_OK;
}
