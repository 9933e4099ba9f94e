/* The axis near a cut under which the arcs fit best.
 *
 * Method: Levenberg and Marquardt over the places of both ends, bend and skew, on the distances
 * of all samples to the line of the side that is nearest, outliers weighted down (Geman and
 * McClure): a limb that moved at its joint does not turn the axis. Which side is nearest is
 * found anew for each trial; a trial that is no better is dropped. */
#include "src/core/build.h"

#include "src/contour/self_similarity_work.h"

enum { VARIABLES = SIMILARITY_VARIABLES, ROUNDS = 10 };

/* In spans: distances from here on count less and less. */
#define OUTLIER CAIRN_REAL(0.02)
/* Keeps bend and skew from drifting where nothing speaks for them. */
#define STIFF CAIRN_REAL(1e-6)
/* An improvement below this share is the last. */
#define LAST_GAIN CAIRN_REAL(1e-3)

/* A variable's unit, and by how much of it the differences are taken; ends in samples. */
static const cairn_real unit[VARIABLES] = {2, 2, CAIRN_REAL(0.3), CAIRN_REAL(0.2)};
#define NUDGE CAIRN_REAL(0.1)
/* Units by which a variable moves at most. */
#define MOST_MOVE 2

static cairn_real *variable(similarity_cut *cut, int32_t i)
{
    return i < 2 ? &cut->place[i] : i == 2 ? &cut->bend : &cut->skew;
}

/* The distances of all samples to the lines of the sides that are nearest. */
static void measure(const cairn_self_similarity *s, const similarity_flat *flat,
                    const int32_t *near, cairn_real *to)
{
    for (int32_t arc = 0; arc < 2; arc++)
        for (int32_t i = 1; i + 1 < flat->count[arc]; i++, near++, to++) {
            cairn_vec2 a = flat->points[1 - arc][*near], b = flat->points[1 - arc][*near + 1];
            cairn_vec2 normal = cairn_vec2_left(cairn_vec2_unit(cairn_vec2_sub(b, a)));

            *to = cairn_vec2_dot(normal, cairn_vec2_sub(flat->points[arc][i], a)) / s->span;
        }
}

static cairn_real *row_of(const cairn_self_similarity *s, int32_t row)
{
    return &s->residual[row * s->params.points];
}

/* Row 0: the distances; row 1 + v: how they change with variable v. Returns their number. */
static int32_t differentiate(cairn_self_similarity *s, const similarity_trial *t)
{
    int32_t count = t->sides.count[0] + t->sides.count[1];
    const cairn_real *here = row_of(s, 0);

    measure(s, &t->flat, t->near, row_of(s, 0));
    for (int32_t v = 0; v < VARIABLES; v++) {
        cairn_real *change = row_of(s, 1 + v);
        similarity_cut moved = t->cut;
        similarity_flat nudged;

        *variable(&moved, v) += NUDGE * unit[v];
        for (int32_t i = 0; i < 2; i++)
            moved.place[i] -=
                moved.place[i] >= (cairn_real)s->params.points ? (cairn_real)s->params.points : 0;
        nudged = cairn_similarity_lay(s, &moved, &t->sides, s->nudged);
        measure(s, &nudged, t->near, change);
        for (int32_t i = 0; i < count; i++)
            change[i] = (change[i] - here[i]) / NUDGE;
    }
    return count;
}

/* a x = b of least squares, damped. */
static void set_equations(const cairn_self_similarity *s, const similarity_cut *cut, int32_t count,
                          cairn_real a[VARIABLES][VARIABLES], cairn_real b[VARIABLES])
{
    const cairn_real *here = row_of(s, 0);
    cairn_real stiff = STIFF * (cairn_real)count;

    for (int32_t v = 0; v < VARIABLES; v++) {
        b[v] = 0;
        for (int32_t u = 0; u < VARIABLES; u++)
            a[v][u] = 0;
    }
    for (int32_t i = 0; i < count; i++) {
        cairn_real scaled = here[i] / OUTLIER, share = 1 / (1 + scaled * scaled),
                   weight = share * share;

        for (int32_t v = 0; v < VARIABLES; v++) {
            cairn_real change = weight * row_of(s, 1 + v)[i];

            for (int32_t u = 0; u < VARIABLES; u++)
                a[v][u] += change * row_of(s, 1 + u)[i];
            b[v] -= change * here[i];
        }
    }
    for (int32_t v = 0; v < VARIABLES; v++)
        a[v][v] += s->damping * (a[v][v] + stiff) + stiff;
    b[2] -= stiff * cut->bend / unit[2];
    b[3] -= stiff * cut->skew / unit[3];
}

/* Solves a x = b for a symmetric positive a, in place; x in b. */
static void solve(cairn_real a[VARIABLES][VARIABLES], cairn_real b[VARIABLES])
{
    for (int32_t i = 0; i < VARIABLES; i++)
        for (int32_t k = i + 1; k < VARIABLES; k++) {
            cairn_real share = a[k][i] / a[i][i];

            for (int32_t j = i; j < VARIABLES; j++)
                a[k][j] -= share * a[i][j];
            b[k] -= share * b[i];
        }
    for (int32_t i = VARIABLES - 1; i >= 0; i--) {
        for (int32_t k = i + 1; k < VARIABLES; k++)
            b[i] -= a[i][k] * b[k];
        b[i] /= a[i][i];
    }
}

/* One round: a trial from where the fit stands. 0: it is the last. */
static int improve(cairn_self_similarity *s)
{
    similarity_trial *stands = &s->trial[s->current], *next = &s->trial[1 - s->current];
    cairn_real a[VARIABLES][VARIABLES], b[VARIABLES];

    set_equations(s, &stands->cut, differentiate(s, stands), a, b);
    solve(a, b);
    next->cut = stands->cut;
    for (int32_t v = 0; v < VARIABLES; v++)
        *variable(&next->cut, v) += unit[v] * cairn_max(-MOST_MOVE, cairn_min(MOST_MOVE, b[v]));
    cairn_similarity_limit(s, &next->cut);
    cairn_similarity_try(s, next, 1);
    if (next->cut.cost < stands->cut.cost) {
        int goes_on = stands->cut.cost - next->cut.cost > LAST_GAIN * stands->cut.cost;

        s->current = 1 - s->current;
        s->damping *= CAIRN_REAL(0.2);
        return goes_on;
    }
    s->damping = cairn_max(10 * s->damping, CAIRN_REAL(0.1));
    return 1;
}

void cairn_similarity_fit_begin(cairn_self_similarity *s, const similarity_cut *cut)
{
    s->trial[s->current].cut = *cut;
    s->damping = CAIRN_REAL(0.01);
    s->round = 0;
}

cairn_status cairn_similarity_fit_step(cairn_self_similarity *s, cairn_budget *budget)
{
    int32_t units = cairn_similarity_trial_units(s, 1), n = s->params.points;

    while (s->round <= ROUNDS) {
        int goes_on = 1;

        if (!cairn_budget_pay(budget, &s->paid, s->round == 0 ? units : units + VARIABLES * n))
            return CAIRN_MORE;
        if (s->round == 0)
            cairn_similarity_try(s, &s->trial[s->current], 1);
        else
            goes_on = improve(s);
        s->round = goes_on ? s->round + 1 : ROUNDS + 1;
    }
    return CAIRN_OK;
}
