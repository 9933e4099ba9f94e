/* Exhaustive search over all cuts at two critical points, on all evolution levels (Adluru 2008,
 * section 4.4). self_similarity.c describes the method. */
#include "src/base/build.h"

#include "src/parts/self_similarity_work.h"

/* Vertices per work unit; number of divisions. */
enum { VERTICES_PER_UNIT = 32, ROUND_DIVISIONS = 4 };

/* Lists the vertices of the level in outline order; returns 0 if the level does not exist. */
static int select_level(cairn_self_similarity *similarity)
{
    cairn_curve_evolution_result r = cairn_curve_evolution_read(similarity->evolution);
    int32_t count = 0;

    if (similarity->level < r.min_vertices)
        return 0;
    for (int32_t i = 0; i < r.count; i++)
        if (r.rank[i] < similarity->level)
            similarity->vertex[count++] = i;
    return 1;
}

/* Sets the runs S and T of the current division at the two ends; both are empty when it is no cut:
 * adjacent vertices are none, and division 2 is symmetric in the ends. Arcs of one vertex are
 * allowed as written only. */
static void set_runs(cairn_self_similarity *similarity)
{
    int32_t m = similarity->level, i = similarity->first_end, k = similarity->second_end,
            division = similarity->division, gap = (k - i + m) % m;
    int32_t shares_k = division == 2 || division == 3, shares_i = division == 2 || division == 4;
    self_similarity_run *s = &similarity->run[0], *t = &similarity->run[1];

    s->first = i;
    s->count = 1 + gap;
    t->first = shares_k ? k : (k + 1) % m;
    t->count = m - s->count + shares_k + shares_i;
    if (gap <= 1 || gap >= m - 1 || (t->count == 1 && !self_similarity_is_as_written(similarity)) ||
        (division == 2 && i >= k))
        s->count = t->count = 0;
}

/* Cost of a division in units. */
static int32_t division_cost(const cairn_self_similarity *similarity)
{
    const self_similarity_run *run = similarity->run;

    return run[0].count == 0 ? 1 : 2 + run[0].count * run[1].count / SELF_SIMILARITY_CELLS_PER_UNIT;
}

static cairn_real sample_at(const cairn_self_similarity *similarity, int32_t vertex)
{
    return (cairn_real)similarity->vertex[vertex % similarity->level];
}

/* Returns the end of the axis: the shared vertex, or the midpoint between the ends of both arcs. */
static cairn_real axis_end(const cairn_self_similarity *similarity, cairn_real last,
                           cairn_real first)
{
    cairn_real n = (cairn_real)similarity->params.outline_samples, gap = first - last, position;

    gap += gap < 0 ? n : 0;
    position = last + gap / 2;
    return position < n ? position : position - n;
}

/* Aligns the two arcs of a division, if it is a cut, and inserts the cut. */
static void try_division(cairn_self_similarity *similarity)
{
    self_similarity_run first = similarity->run[0], second = similarity->run[1];
    int32_t forward[SELF_SIMILARITY_MAX_VERTICES], back[SELF_SIMILARITY_MAX_VERTICES],
        m = similarity->level;
    cairn_real n = (cairn_real)similarity->params.outline_samples;
    self_similarity_cut cut = {.vertices = m, .division = similarity->division};
    self_similarity_alignment alignment;

    if (first.count == 0)
        return;
    for (int32_t i = 0; i < first.count; i++)
        forward[i] = similarity->vertex[(first.first + i) % m];
    for (int32_t i = 0; i < second.count; i++)
        back[i] = similarity->vertex[(second.first + second.count - 1 - i) % m];
    alignment = cairn_self_similarity_align(similarity, forward, first.count, back, second.count);
    cut.cost = self_similarity_is_as_written(similarity)
                   ? alignment.sum
                   : alignment.sum / (cairn_real)alignment.length;
    cut.from[0] = sample_at(similarity, first.first);
    cut.to[0] = sample_at(similarity, first.first + first.count - 1);
    cut.from[1] = sample_at(similarity, second.first);
    cut.to[1] = sample_at(similarity, second.first + second.count - 1);
    cut.position[0] = axis_end(similarity, cut.to[1], cut.from[0]);
    cut.position[1] = axis_end(similarity, cut.to[0], cut.from[1]);
    for (int32_t arc = 0; arc < 2; arc++)
        cut.to[arc] += cut.to[arc] < cut.from[arc] ? n : 0;
    similarity->comparison_count++;
    cairn_self_similarity_insert(similarity, &similarity->list, &cut);
}

int cairn_self_similarity_search(cairn_self_similarity *similarity, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(similarity->phase_resume);
    similarity->list.count = 0;
    for (similarity->level = similarity->params.min_vertices;
         similarity->level <= similarity->params.max_vertices; similarity->level++) {
        CAIRN_STEP_CHARGE(similarity, phase_resume, budget,
                          1 + similarity->params.outline_samples / VERTICES_PER_UNIT);
        if (!select_level(similarity))
            continue;
        for (similarity->first_end = 0; similarity->first_end < similarity->level;
             similarity->first_end++)
            for (similarity->second_end = 0; similarity->second_end < similarity->level;
                 similarity->second_end++)
                for (similarity->division = 1; similarity->division <= ROUND_DIVISIONS;
                     similarity->division++) {
                    set_runs(similarity);
                    CAIRN_STEP_CHARGE(similarity, phase_resume, budget, division_cost(similarity));
                    try_division(similarity);
                }
    }
    CAIRN_STEP_END(similarity->phase_resume);
}
