/* The support of the pieces: extent, cuts at gaps, cuts at bends, and the end of those with too
 * little.
 *
 * Points come sorted by piece and place. A run without a gap is summed, then swept by a cut that
 * shows the residual of two lines in place of one (sums left of the cut, the rest right of it). */
#include "src/core/build.h"

#include <string.h>

#include "src/core/polyline_work.h"

/* What a cut must save, in terms of what forbids joining. */
#define CUT CAIRN_REAL(1.5)

static cairn_real place(const cairn_polyline *x, int32_t i)
{
    return x->along[x->order[i]];
}

/* How far apart the next point may lie when the two last distances on its side are these. */
static cairn_real reach_of(const cairn_polyline *x, cairn_real spacing)
{
    return cairn_min(cairn_max(x->params.gap, x->params.gap_factor * spacing), x->params.gap_max);
}

/* The longer of the up to two distances between points from ... from + 2 * way that lie in
 * [first, last); -1 when there is none. */
static cairn_real spacing(const cairn_polyline *x, int32_t from, int32_t way, int32_t first,
                          int32_t last)
{
    cairn_real longest = -1;

    for (int32_t i = 1; i <= 2 && from + i * way >= first && from + i * way < last; i++)
        longest = cairn_max(longest,
                            cairn_abs(place(x, from + i * way) - place(x, from + (i - 1) * way)));
    return longest;
}

/* 1 when the points i and i + 1 of a run that starts at `first` and has points up to `last` are
 * too far apart: farther than either side, as far as it has distances, bears out. */
static int is_gap(const cairn_polyline *x, int32_t i, int32_t first, int32_t last)
{
    cairn_real distance = place(x, i + 1) - place(x, i), reach = x->params.gap_max, side;

    if (distance <= x->params.gap)
        return 0;
    side = spacing(x, i, -1, first, last);
    if (side >= 0)
        reach = cairn_min(reach, reach_of(x, side));
    side = spacing(x, i + 1, 1, first, last);
    if (side >= 0)
        reach = cairn_min(reach, reach_of(x, side));
    return distance > reach;
}

static int32_t owner_at(const cairn_polyline *x, int32_t i)
{
    return i < x->count ? x->owner[x->order[i]] : -1;
}

/* Points first ... last-1 of the piece `owner`, whose sums are m, become a piece of the next
 * iteration. */
static void emit(cairn_polyline *x, int32_t owner, int32_t first, int32_t last,
                 const polyline_sums *m, int cut)
{
    const polyline_piece *k = &x->pieces[owner];

    x->made = *k;
    x->made.low = place(x, first);
    x->made.high = place(x, last - 1);
    x->made.reach_low = reach_of(x, spacing(x, first, 1, first, last));
    x->made.reach_high = reach_of(x, spacing(x, last - 1, -1, first, last));
    if (cut) {
        cairn_polyline_fit_own(&x->made, m, x->params.dim);
    } else {
        /* The line of the M-step stays; its own points give the mean and the sums of squares
         * about it. */
        for (int j = 0; j < 3; j++)
            x->made.own[j] = m->v[j] / m->n;
        x->made.tt = m->vv.xx - m->v[0] * x->made.own[0];
        x->made.sse =
            cairn_max(m->vv.yy - m->v[1] * x->made.own[1] + m->vv.zz - m->v[2] * x->made.own[2], 0);
        x->made.count = last - first;
        x->moved = cairn_max(x->moved, cairn_max(cairn_abs(x->made.low - k->low),
                                                 cairn_abs(x->made.high - k->high)));
    }
    if (cut || x->other == owner + 1) {
        x->measure.cuts++;
        x->changed = 1;
    }
    x->other = owner + 1;
    cairn_polyline_keep(x, x->next, &x->next_count, &x->made);
}

/* The sums of the points right of a cut. */
static polyline_sums rest_of(const polyline_sums *all, const polyline_sums *left)
{
    polyline_sums rest = *all;

    rest.n -= left->n;
    for (int j = 0; j < 3; j++)
        rest.v[j] -= left->v[j];
    rest.vv.xx -= left->vv.xx;
    rest.vv.xy -= left->vv.xy;
    rest.vv.xz -= left->vv.xz;
    rest.vv.yy -= left->vv.yy;
    rest.vv.yz -= left->vv.yz;
    rest.vv.zz -= left->vv.zz;
    return rest;
}

/* Tries a cut between points `inner` and the next. */
static void try_cut(cairn_polyline *x)
{
    const cairn_polyline_params *p = &x->params;
    int32_t i = x->inner;
    polyline_sums rest;
    cairn_real sse;

    if (i + 1 - x->first < p->min_points || x->last - i - 1 < p->min_points ||
        place(x, i) - place(x, x->first) < p->min_length ||
        place(x, x->last - 1) - place(x, i + 1) < p->min_length)
        return;
    rest = rest_of(&x->sum, &x->left);
    sse = cairn_polyline_residual(&x->left) + cairn_polyline_residual(&rest);
    if (x->best_at < 0 || sse < x->best_sse) {
        x->best_at = i;
        x->best_sse = sse;
        x->best_left = x->left;
    }
}

/* Finds the end of the run without a gap that starts at `first`. */
static int find_run(cairn_polyline *x, cairn_budget *budget, int32_t owner)
{
    for (; owner_at(x, x->last) == owner; x->last++) {
        int32_t known = x->last + 1; /* of the points to the right, as many as a gap looks at */

        if (!polyline_pay(x, budget, 9))
            return 0;
        while (known < x->last + 3 && owner_at(x, known) == owner)
            known++;
        if (is_gap(x, x->last - 1, x->first, known))
            break;
    }
    return 1;
}

/* Stage 0 begins a run at `at`, 1 finds its end, 2 sums it, 3 sweeps the cut, 4 hands on what
 * there is. */
int cairn_polyline_support(cairn_polyline *x, cairn_budget *budget)
{
    while (owner_at(x, x->at) >= 0) {
        int32_t owner = owner_at(x, x->at);
        cairn_real local[3], sse;

        if (x->stage == 0) {
            x->first = x->at;
            x->last = x->at + 1;
            memset(&x->sum, 0, sizeof x->sum);
            memset(&x->left, 0, sizeof x->left);
            x->best_at = -1;
            x->stage = 1;
        }
        if (x->stage == 1) {
            if (!find_run(x, budget, owner))
                return 0;
            x->inner = x->first;
            x->stage = 2;
            if (x->last - x->first < x->params.min_points ||
                place(x, x->last - 1) - place(x, x->first) < x->params.min_length) {
                x->at = x->last;
                x->stage = 0;
                continue;
            }
        }
        for (; x->stage == 2 && x->inner < x->last; x->inner++) {
            if (!polyline_pay_four(x, budget, x->inner - x->first, x->last - x->first, 8))
                return 0;
            cairn_polyline_local(&x->pieces[owner], x->params.dim, x->point[x->order[x->inner]],
                                 local);
            cairn_polyline_sum(&x->sum, local, 1);
        }
        sse = cairn_polyline_residual(&x->sum);
        if (x->stage == 2) {
            /* No cut can save more than there is. */
            x->stage = x->measure.iterations < x->params.max_iterations / 2 &&
                               sse > CUT * cairn_polyline_worth(x, x->sum.n, 0)
                           ? 3
                           : 4;
            x->inner = x->first;
        }
        for (; x->stage == 3 && x->inner < x->last; x->inner++) {
            if (!polyline_pay(x, budget, 21))
                return 0;
            cairn_polyline_local(&x->pieces[owner], x->params.dim, x->point[x->order[x->inner]],
                                 local);
            cairn_polyline_sum(&x->left, local, 1);
            try_cut(x);
        }
        x->stage = 4;
        if (!polyline_pay(x, budget, 52))
            return 0;
        if (x->best_at >= 0 &&
            sse - x->best_sse > CUT * cairn_polyline_worth(x, x->sum.n, x->best_sse)) {
            polyline_sums rest = rest_of(&x->sum, &x->best_left);

            emit(x, owner, x->first, x->best_at + 1, &x->best_left, 1);
            emit(x, owner, x->best_at + 1, x->last, &rest, 1);
        } else {
            emit(x, owner, x->first, x->last, &x->sum, 0);
        }
        x->at = x->last;
        x->stage = 0;
    }
    x->unclaimed = x->at;
    return 1;
}
