/* E-step and M-step of the line fit.
 *
 * Points go in blocks of neighbours in canonical order; a block's box is tested against those of
 * the pieces, and its points look only at the pieces that it meets. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/polyline_work.h"

/* Half width in s of the band beyond an end: less than POLYLINE_CLAIM, so that a point once
 * adopted is not lost at once. */
#define ADOPT 2

static int block_meets(const cairn_polyline *x, int32_t block, const polyline_piece *k)
{
    cairn_real by = POLYLINE_CLAIM * x->s;

    for (int j = 0; j < 3; j++)
        if (x->block_min[block][j] > k->box_max[j] + by ||
            x->block_max[block][j] < k->box_min[j] - by)
            return 0;
    return 1;
}

/* exp(-z) for 0 <= z <= 4.5, at most 4 % too small: (1 - z / 256)^256. A weight need not be
 * better, and this takes a quarter of the time. */
static cairn_real decay(cairn_real z)
{
    cairn_real power = 1 - z / 256;

    for (int i = 0; i < 8; i++)
        power *= power;
    return power;
}

/* What one piece is to a point: weight exp(-d^2 / 2s^2), d the distance to the segment, when
 * that is within 3 s; else the piece may adopt the point when that lies in the band beyond an
 * end, no farther than the end reaches. */
static void weigh(cairn_polyline *x, int32_t c, const cairn_real p[3])
{
    const polyline_piece *k = &x->pieces[x->candidate[c]];
    cairn_real *local = x->local[c], across, over, squared, limit = POLYLINE_CLAIM * x->s;
    cairn_real half = 1 / (2 * x->s * x->s);

    cairn_polyline_local(k, x->params.dim, p, local);
    across = local[1] * local[1] + local[2] * local[2];
    over = cairn_max(cairn_max(k->low - local[0], local[0] - k->high), 0);
    squared = across + over * over;
    x->weight[c] = 0;
    if (squared <= limit * limit) {
        x->weight[c] = decay(squared * half);
        x->total += x->weight[c];
        if (x->best < 0 || squared < x->least) {
            x->best = c;
            x->least = squared;
        }
    } else if (x->adopting && across <= ADOPT * ADOPT * x->s * x->s &&
               over <= (local[0] < k->low ? k->reach_low : k->reach_high) &&
               (x->adopter < 0 || squared < x->adopter_least)) {
        x->adopter = c;
        x->adopter_least = squared;
    }
}

/* Gives a point to a piece, with its weight in proportion to all, that of no piece among them. */
static void share(cairn_polyline *x, int32_t c)
{
    cairn_real part = x->weight[c] / (x->total + POLYLINE_NOISE);

    if (part > CAIRN_REAL(0.00390625))
        cairn_polyline_sum(&x->pieces[x->candidate[c]].soft, x->local[c], part);
}

/* Stage 0 collects the candidates of block `at`; then each point `first` weighs them (inner <
 * candidates) and is shared. In the last pass, POLYLINE_CLAIM_POINTS, points are claimed and not
 * shared, and none is adopted. */
int cairn_polyline_expect(cairn_polyline *x, cairn_budget *budget)
{
    int final = x->phase == POLYLINE_CLAIM_POINTS;

    x->adopting = !final && x->measure.iterations < x->params.max_iterations / 2;

    for (; x->at * POLYLINE_BLOCK < x->count; x->at++, x->stage = 0) {
        int32_t end = cairn_real_to_int(
            cairn_min((cairn_real)x->count, (cairn_real)(x->at + 1) * POLYLINE_BLOCK));

        if (x->stage == 0) {
            x->inner = x->candidates = 0;
            x->first = x->at * POLYLINE_BLOCK;
            x->stage = 1;
        }
        if (x->stage == 1) {
            for (; x->inner < x->piece_count; x->inner++) {
                if (!polyline_pay_four(x, budget, x->inner, x->piece_count, 5))
                    return 0;
                if (block_meets(x, x->at, &x->pieces[x->inner]))
                    x->candidate[x->candidates++] = x->inner;
            }
            x->inner = 0;
            x->stage = 2;
        }
        for (; x->first < end; x->first++, x->inner = 0) {
            const cairn_real *p = x->point[x->first];

            if (x->inner == 0) {
                x->best = x->adopter = -1;
                x->total = 0;
            }
            for (; x->inner < x->candidates; x->inner++) {
                if (!polyline_pay_four(x, budget, x->inner, x->candidates, 10))
                    return 0;
                weigh(x, x->inner, p);
            }
            if (x->inner == x->candidates && x->best < 0 && x->adopter >= 0) {
                x->best = x->adopter;
                x->weight[x->best] = x->total = 1;
            }
            for (; !final && x->inner < 2 * x->candidates; x->inner++) {
                if (!polyline_pay_four(x, budget, x->inner - x->candidates, x->candidates, 4))
                    return 0;
                share(x, x->inner - x->candidates);
            }
            x->owner[x->first] = x->best < 0 ? -1 : x->candidate[x->best];
        }
    }
    return 1;
}

int cairn_polyline_maximize(cairn_polyline *x, cairn_budget *budget)
{
    for (; x->at < x->piece_count; x->at++) {
        polyline_piece *k = &x->pieces[x->at];
        cairn_real end[2][3], local[3];

        if (!polyline_pay(x, budget, x->params.dim == 2 ? 56 : 96))
            return 0;
        if (k->soft.n < 2) /* it will find no support */
            continue;
        cairn_polyline_place(k, k->low, end[0]);
        cairn_polyline_place(k, k->high, end[1]);
        cairn_polyline_fit(k, &k->soft, x->params.dim);
        for (int which = 0; which < 2; which++) {
            cairn_polyline_local(k, x->params.dim, end[which], local);
            x->moved = cairn_max(x->moved, cairn_sqrt(local[1] * local[1] + local[2] * local[2]));
        }
    }
    return 1;
}
