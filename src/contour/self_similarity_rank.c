/* Cuts ranked once more.
 *
 * Method: all pairs of every other sample are judged by their misfit, as they are and with the bend and skew that pairs of points
 * between them speak for. The best of these, and the best of the thesis's search, are fitted. Where even the best of all leaves more
 * than a bend and a skew explain, limbs have moved at their joints: the pairs are warped once more, by the inner distances to
 * nearby samples alone, which joints farther off leave as they are. The warp is blended with how much of the arcs lies close when one is mirrored,
 * which is the body between the limbs, and that with the first judgement. */
#include "src/core/build.h"

#include "src/contour/self_similarity_work.h"

/* How many cuts are fitted: of the scan, of the thesis's search, of the nearby warps. */
enum { SCANNED = 16, WRITTEN = 12, JOINTED = 8 };
/* Misfits between which a shape passes from explained to jointed. */
#define EXPLAINED   CAIRN_REAL(0.012)
#define UNEXPLAINED CAIRN_REAL(0.022)
/* Of the warp where joints moved; the rest is that of what lies close, the body that did not. */
#define WARP_SHARE CAIRN_REAL(0.45)
/* Ends that are nearer than this share of the outline make no cut; samples within that share are nearby. */
enum { LEAST_PART = 8, NEARBY_PART = 10 };

void cairn_similarity_scan_begin(cairn_self_similarity *s)
{
    int32_t n = s->params.points;

    for (int32_t i = 0; i < n; i++) {
        cairn_vec2 before = s->samples[i > 0 ? i - 1 : n - 1], after = s->samples[i + 1 < n ? i + 1 : 0];
        cairn_vec2 beside = cairn_vec2_scale(cairn_vec2_add(before, after), CAIRN_REAL(0.25));

        s->smooth[i] = cairn_vec2_add(beside, cairn_vec2_scale(s->samples[i], CAIRN_REAL(0.5)));
    }
    s->span = cairn_inner_distance_read(s->inner).greatest;
    s->scanned.count = 0;
    s->jointed = 0;
    s->i = s->k = 0;
}

/* Samples i > k whose ends are far enough apart both ways round. */
static int makes_cut(const cairn_self_similarity *s, int32_t i, int32_t k)
{
    int32_t n = s->params.points, least = n / LEAST_PART;

    return i - k >= least && i - k <= n - least;
}

static similarity_cut cut_at(int32_t i, int32_t k)
{
    similarity_cut cut = {.place = {(cairn_real)k, (cairn_real)i}};

    return cut;
}

/* ---- All pairs by their misfit ---- */

cairn_status cairn_similarity_scan_step(cairn_self_similarity *s, cairn_budget *budget)
{
    int32_t units = 4 + 2 * cairn_similarity_trial_units(s, SIMILARITY_STRIDE);

    for (; s->i < s->params.points; s->i += SIMILARITY_STRIDE, s->k = 0)
        for (; s->k < s->i; s->k += SIMILARITY_STRIDE) {
            similarity_trial *straight = &s->trial[0], *bent = &s->trial[1];

            if (!cairn_budget_pay(budget, &s->paid, makes_cut(s, s->i, s->k) ? units : 1))
                return CAIRN_MORE;
            if (!makes_cut(s, s->i, s->k))
                continue;
            straight->cut = bent->cut = cut_at(s->i, s->k);
            cairn_similarity_guess(s, &bent->cut);
            cairn_similarity_try(s, straight, SIMILARITY_STRIDE);
            cairn_similarity_try(s, bent, SIMILARITY_STRIDE);
            cairn_similarity_offer(s, &s->scanned, bent->cut.cost < straight->cut.cost ? &bent->cut : &straight->cut);
        }
    return CAIRN_OK;
}

/* ---- The best of them fitted ---- */

/* Puts the first `most` cuts of a list behind the first `kept` of those that are to be looked at. */
static void line_up(cairn_self_similarity *s, int32_t kept, const similarity_list *list, int32_t most)
{
    s->scanned.count = s->scanned.count < kept ? s->scanned.count : kept;
    for (int32_t i = 0; i < list->count && i < most; i++)
        s->scanned.cuts[s->scanned.count++] = list->cuts[i];
}

void cairn_similarity_fits_begin(cairn_self_similarity *s)
{
    line_up(s, SCANNED, &s->list, WRITTEN);
    s->list.count = 0;
    s->current = 0;
    s->i = 0;
    s->k = 0;
}

/* Fits the cut that the phase is at. */
static cairn_status fit_next(cairn_self_similarity *s, cairn_budget *budget)
{
    cairn_status status;

    if (s->k == 0) {
        cairn_similarity_fit_begin(s, &s->scanned.cuts[s->i]);
        s->k = 1;
    }
    status = cairn_similarity_fit_step(s, budget);
    if (status == CAIRN_OK)
        s->k = 0;
    return status;
}

/* The cut between the places of its ends, as a division of all of the outline. */
static void set_arcs(const cairn_self_similarity *s, similarity_cut *cut)
{
    for (int32_t arc = 0; arc < 2; arc++) {
        cut->from[arc] = cut->place[arc];
        cut->to[arc] = cut->place[1 - arc];
        cut->to[arc] += cut->to[arc] < cut->from[arc] ? (cairn_real)s->params.points : 0;
    }
    cut->vertices = cut->division = 0;
}

cairn_status cairn_similarity_fits_step(cairn_self_similarity *s, cairn_budget *budget)
{
    for (; s->i < s->scanned.count; s->i++) {
        similarity_cut *fitted;

        if (fit_next(s, budget) != CAIRN_OK)
            return CAIRN_MORE;
        fitted = &s->trial[s->current].cut;
        set_arcs(s, fitted);
        cairn_similarity_offer(s, &s->list, fitted);
    }
    if (s->list.count > 0)
        s->jointed = (s->list.cuts[0].misfit - EXPLAINED) / (UNEXPLAINED - EXPLAINED);
    s->jointed = cairn_max(0, cairn_min(1, s->jointed));
    return CAIRN_OK;
}

/* ---- Joints ---- */

/* Eq. 4.4 over nearby samples alone. */
static cairn_real compare_near(const cairn_inner_distance_result *inner, int32_t i, int32_t k, int32_t reach)
{
    const cairn_real *ahead = &inner->distance[i * inner->stride], *behind = &inner->distance[k * inner->stride];
    int32_t n = inner->count;
    cairn_real sum = 0;

    for (int32_t m = -reach; m <= reach; m++) {
        cairn_real d = ahead[(i + m + n) % n] - behind[(k - m + n) % n];

        sum += d * d;
    }
    return cairn_sqrt(sum / (cairn_real)(2 * reach + 1)) / inner->greatest;
}

cairn_status cairn_similarity_near_step(cairn_self_similarity *s, cairn_budget *budget)
{
    cairn_inner_distance_result inner = cairn_inner_distance_read(s->inner);
    int32_t n = s->params.points, reach = (n + NEARBY_PART / 2) / NEARBY_PART;

    for (; s->i < n; s->i++, s->k = 0)
        for (; s->k <= s->i; s->k++) {
            if (!cairn_budget_pay(budget, &s->paid, 1 + reach / 4))
                return CAIRN_MORE;
            s->unlike[s->i * n + s->k] = s->unlike[s->k * n + s->i] = compare_near(&inner, s->i, s->k, reach);
        }
    s->scanned.count = 0;
    return CAIRN_OK;
}

/* One arc warped onto the other. */
static cairn_real warp_of(cairn_self_similarity *s, const similarity_cut *cut, int32_t stride)
{
    similarity_sides sides = cairn_similarity_sides(s, cut, stride);
    int32_t *there = s->walk, *back = there + sides.count[0], n = s->params.points;

    for (int32_t i = 0; i < sides.count[0]; i++)
        there[i] = (sides.first[0] + i * stride) % n;
    for (int32_t i = 0; i < sides.count[1]; i++)
        back[i] = (sides.first[1] + (sides.count[1] - 1 - i) * stride) % n;
    s->comparisons++;
    return cairn_similarity_warp(s, there, sides.count[0], back, sides.count[1]);
}

/* Of a warp between two ends. */
static int32_t warp_units(const cairn_self_similarity *s, int32_t stride)
{
    int32_t side = s->params.points / stride;

    return 4 + side * side / 4 / SIMILARITY_CELLS_A_UNIT;
}

cairn_status cairn_similarity_scan_near_step(cairn_self_similarity *s, cairn_budget *budget)
{
    for (; s->i < s->params.points; s->i += SIMILARITY_STRIDE, s->k = 0)
        for (; s->k < s->i; s->k += SIMILARITY_STRIDE) {
            similarity_cut cut = cut_at(s->i, s->k);

            if (!cairn_budget_pay(budget, &s->paid, makes_cut(s, s->i, s->k) ? warp_units(s, SIMILARITY_STRIDE) : 1))
                return CAIRN_MORE;
            if (!makes_cut(s, s->i, s->k))
                continue;
            cut.cost = warp_of(s, &cut, SIMILARITY_STRIDE);
            cairn_similarity_offer(s, &s->scanned, &cut);
        }
    return CAIRN_OK;
}

void cairn_similarity_blend_begin(cairn_self_similarity *s)
{
    int32_t warped = s->scanned.count < JOINTED ? s->scanned.count : JOINTED;

    line_up(s, warped, &s->list, SIMILARITY_KEPT - JOINTED);
    s->warped = warped;
    s->list.count = 0;
    s->i = 0;
    s->k = 0;
}

/* The geometric mean, weighted. */
static cairn_real blend(cairn_real explained, cairn_real warped, cairn_real share)
{
    const cairn_real least = CAIRN_REAL(1e-6);

    return cairn_exp((1 - share) * cairn_log(cairn_max(least, explained)) +
                     share * cairn_log(cairn_max(least, warped)));
}

/* Cuts by the warp keep their ends; their misfit is that of the fit from there. */
cairn_status cairn_similarity_blend_step(cairn_self_similarity *s, cairn_budget *budget)
{
    for (; s->i < s->scanned.count; s->i++) {
        similarity_cut *cut = &s->scanned.cuts[s->i];

        if (s->i < s->warped) {
            if (fit_next(s, budget) != CAIRN_OK)
                return CAIRN_MORE;
            cut->cost = s->trial[s->current].cut.cost;
            cut->misfit = s->trial[s->current].cut.misfit;
            cut->close = s->trial[s->current].cut.close;
        } else if (!cairn_budget_pay(budget, &s->paid, warp_units(s, 1))) {
            return CAIRN_MORE;
        }
        cut->warp = warp_of(s, cut, 1);
        cut->cost = blend(cut->cost, blend(cut->close, cut->warp, WARP_SHARE), s->jointed);
        set_arcs(s, cut);
        cairn_similarity_offer(s, &s->list, cut);
    }
    return CAIRN_OK;
}
