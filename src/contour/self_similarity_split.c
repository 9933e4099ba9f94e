/* The search of the thesis: all cuts at two critical points, on all levels. */
#include "src/core/build.h"

#include "src/contour/self_similarity_work.h"

/* Units: cells of a warp's table. */
enum { CELLS_A_UNIT = 8, VERTICES_A_UNIT = 32, DIVISIONS = 4 };

similarity_warp cairn_similarity_warp(cairn_self_similarity *s, const int32_t *first,
                                      int32_t first_count, const int32_t *second,
                                      int32_t second_count)
{
    similarity_warp warp;
    cairn_real *above = s->sum, *sum = s->sum + s->params.points;
    int32_t *steps_above = s->steps, *steps = s->steps + s->params.points;

    for (int32_t i = 0; i < first_count; i++) {
        const cairn_real *unlike = &s->unlike[first[i] * s->params.points];
        cairn_real *sum_kept = above;
        int32_t *steps_kept = steps_above;

        for (int32_t k = 0; k < second_count; k++) {
            cairn_real best = 0;
            int32_t behind = 0;

            /* The diagonal before a step in one alone, of equal sums. */
            if (i > 0 && k > 0) {
                best = above[k - 1];
                behind = steps_above[k - 1];
            }
            if (i > 0 && (k == 0 || above[k] < best)) {
                best = above[k];
                behind = steps_above[k];
            }
            if (k > 0 && (i == 0 || sum[k - 1] < best)) {
                best = sum[k - 1];
                behind = steps[k - 1];
            }
            sum[k] = best + unlike[second[k]];
            steps[k] = behind + 1;
        }
        above = sum;
        steps_above = steps;
        sum = sum_kept;
        steps = steps_kept;
    }
    warp.sum = above[second_count - 1];
    warp.pairs = steps_above[second_count - 1];
    return warp;
}

/* ---- Levels ---- */

/* The vertices of the level in their order; 0: there is no such level. */
static int take_level(cairn_self_similarity *s)
{
    cairn_curve_evolution_result r = cairn_curve_evolution_read(s->evolution);
    int32_t count = 0;

    if (s->level < r.least)
        return 0;
    for (int32_t i = 0; i < r.count; i++)
        if (r.rank[i] < s->level)
            s->vertex[count++] = i;
    return 1;
}

/* A run of vertices: `count` of them from `first` on, round the level. */
typedef struct run {
    int32_t first, count;
} run;

/* Division 1 ... 4 at vertices i and k of a level of m: what S and T are made of. */
static void divide(int32_t m, int32_t i, int32_t k, int32_t division, run *s, run *t)
{
    int32_t shares_k = division == 2 || division == 3, shares_i = division == 2 || division == 4;

    s->first = i;
    s->count = 1 + (k - i + m) % m;
    t->first = shares_k ? k : (k + 1) % m;
    t->count = m - s->count + shares_k + shares_i;
}

static cairn_real sample_at(const cairn_self_similarity *s, int32_t vertex)
{
    return (cairn_real)s->vertex[vertex % s->level];
}

/* A vertex where the arcs share one, halfway between their ends otherwise. */
static cairn_real end_between(const cairn_self_similarity *s, cairn_real last, cairn_real first)
{
    cairn_real n = (cairn_real)s->params.points, gap = first - last, place;

    gap += gap < 0 ? n : 0;
    place = last + gap / 2;
    return place < n ? place : place - n;
}

static int is_as_written(const cairn_self_similarity *s)
{
    return s->params.mode == CAIRN_MODE_AS_WRITTEN;
}

static void try_division(cairn_self_similarity *s, run first, run second)
{
    int32_t there[SIMILARITY_VERTICES], back[SIMILARITY_VERTICES], m = s->level;
    cairn_real n = (cairn_real)s->params.points;
    similarity_cut cut = {.vertices = m, .division = s->division};
    similarity_warp warp;

    for (int32_t i = 0; i < first.count; i++)
        there[i] = s->vertex[(first.first + i) % m];
    for (int32_t i = 0; i < second.count; i++)
        back[i] = s->vertex[(second.first + second.count - 1 - i) % m];
    warp = cairn_similarity_warp(s, there, first.count, back, second.count);
    cut.cost = is_as_written(s) ? warp.sum : warp.sum / (cairn_real)warp.pairs;
    cut.from[0] = sample_at(s, first.first);
    cut.to[0] = sample_at(s, first.first + first.count - 1);
    cut.from[1] = sample_at(s, second.first);
    cut.to[1] = sample_at(s, second.first + second.count - 1);
    cut.place[0] = end_between(s, cut.to[1], cut.from[0]);
    cut.place[1] = end_between(s, cut.to[0], cut.from[1]);
    for (int32_t arc = 0; arc < 2; arc++)
        cut.to[arc] += cut.to[arc] < cut.from[arc] ? n : 0;
    s->comparisons++;
    cairn_similarity_offer(s, &s->list, &cut);
}

void cairn_similarity_split_begin(cairn_self_similarity *s)
{
    s->level = s->params.least_vertices;
    s->i = -1;
    s->k = 0;
    s->division = 1;
    s->list.count = 0;
}

/* On to the next division, pair and level. */
static void advance(cairn_self_similarity *s)
{
    if (++s->division <= DIVISIONS)
        return;
    s->division = 1;
    if (++s->k < s->level)
        return;
    s->k = 0;
    if (++s->i < s->level)
        return;
    s->i = -1;
    s->level++;
}

cairn_status cairn_similarity_split_step(cairn_self_similarity *s, cairn_budget *budget)
{
    while (s->level <= s->params.most_vertices) {
        int32_t m = s->level, gap = (s->k - s->i + m) % m;
        run first, second;

        if (s->i < 0) {
            if (!cairn_budget_pay(budget, &s->paid, 1 + s->params.points / VERTICES_A_UNIT))
                return CAIRN_MORE;
            s->i = take_level(s) ? 0 : -1;
            s->level += s->i < 0;
            continue;
        }
        divide(m, s->i, s->k, s->division, &first, &second);
        /* Neighbours are no cut; the second division is the same from i to k and from k to i. An
         * arc of one vertex is one as written. */
        if (gap > 1 && gap < m - 1 && (second.count > 1 || is_as_written(s)) &&
            (s->division != 2 || s->i < s->k)) {
            if (!cairn_budget_pay(budget, &s->paid, 2 + first.count * second.count / CELLS_A_UNIT))
                return CAIRN_MORE;
            try_division(s, first, second);
        } else if (!cairn_budget_pay(budget, &s->paid, 1)) {
            return CAIRN_MORE;
        }
        advance(s);
    }
    return CAIRN_OK;
}
