/* Exhaustive search over all cuts at two critical points, on all evolution levels (Adluru 2008,
 * section 4.4). self_similarity.c describes the method. */
#include "src/base/build.h"

#include "src/parts/self_similarity_work.h"

/* Work units: table cells, vertices; number of divisions. */
enum { CELLS_PER_UNIT = 8, VERTICES_PER_UNIT = 32, ROUND_DIVISIONS = 4 };

self_similarity_alignment cairn_self_similarity_align(cairn_self_similarity *similarity,
                                                      const int32_t *first, int32_t first_count,
                                                      const int32_t *second, int32_t second_count)
{
    self_similarity_alignment alignment;
    cairn_real *above = similarity->dtw_sum,
               *sum = similarity->dtw_sum + similarity->params.outline_samples;
    int32_t *steps_above = similarity->dtw_length,
            *steps = similarity->dtw_length + similarity->params.outline_samples;

    for (int32_t i = 0; i < first_count; i++) {
        const cairn_real *distances =
            &similarity->descriptor_distance[first[i] * similarity->params.outline_samples];
        cairn_real *sum_kept = above;
        int32_t *steps_kept = steps_above;

        for (int32_t k = 0; k < second_count; k++) {
            cairn_real best = 0;
            int32_t length = 0;

            /* Among equal sums the diagonal step wins. */
            if (i > 0 && k > 0) {
                best = above[k - 1];
                length = steps_above[k - 1];
            }
            if (i > 0 && (k == 0 || above[k] < best)) {
                best = above[k];
                length = steps_above[k];
            }
            if (k > 0 && (i == 0 || sum[k - 1] < best)) {
                best = sum[k - 1];
                length = steps[k - 1];
            }
            sum[k] = best + distances[second[k]];
            steps[k] = length + 1;
        }
        above = sum;
        steps_above = steps;
        sum = sum_kept;
        steps = steps_kept;
    }
    alignment.sum = above[second_count - 1];
    alignment.length = steps_above[second_count - 1];
    return alignment;
}

/* ---- Levels ---- */

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

/* A cyclic run of `count` vertices from `first`. */
typedef struct vertex_run {
    int32_t first, count;
} vertex_run;

/* Sets the runs S and T of division 1 ... 4 at vertices i and k of a level of m vertices. */
static void set_division(int32_t m, int32_t i, int32_t k, int32_t division, vertex_run *s,
                         vertex_run *t)
{
    int32_t shares_k = division == 2 || division == 3, shares_i = division == 2 || division == 4;

    s->first = i;
    s->count = 1 + (k - i + m) % m;
    t->first = shares_k ? k : (k + 1) % m;
    t->count = m - s->count + shares_k + shares_i;
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

static int is_as_written(const cairn_self_similarity *similarity)
{
    return similarity->params.mode == CAIRN_MODE_AS_WRITTEN;
}

/* Aligns the two arcs of a division and inserts the cut. */
static void try_division(cairn_self_similarity *similarity, vertex_run first, vertex_run second)
{
    int32_t forward[SELF_SIMILARITY_MAX_VERTICES], back[SELF_SIMILARITY_MAX_VERTICES],
        m = similarity->level;
    cairn_real n = (cairn_real)similarity->params.outline_samples;
    self_similarity_cut cut = {.vertices = m, .division = similarity->division};
    self_similarity_alignment alignment;

    for (int32_t i = 0; i < first.count; i++)
        forward[i] = similarity->vertex[(first.first + i) % m];
    for (int32_t i = 0; i < second.count; i++)
        back[i] = similarity->vertex[(second.first + second.count - 1 - i) % m];
    alignment = cairn_self_similarity_align(similarity, forward, first.count, back, second.count);
    cut.cost =
        is_as_written(similarity) ? alignment.sum : alignment.sum / (cairn_real)alignment.length;
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

void cairn_self_similarity_search_begin(cairn_self_similarity *similarity)
{
    similarity->level = similarity->params.min_vertices;
    similarity->cursor = -1;
    similarity->inner_cursor = 0;
    similarity->division = 1;
    similarity->list.count = 0;
}

/* Advances to the next division, pair and level. */
static void advance(cairn_self_similarity *similarity)
{
    if (++similarity->division <= ROUND_DIVISIONS)
        return;
    similarity->division = 1;
    if (++similarity->inner_cursor < similarity->level)
        return;
    similarity->inner_cursor = 0;
    if (++similarity->cursor < similarity->level)
        return;
    similarity->cursor = -1;
    similarity->level++;
}

cairn_status cairn_self_similarity_search_step(cairn_self_similarity *similarity,
                                               cairn_budget *budget)
{
    while (similarity->level <= similarity->params.max_vertices) {
        int32_t m = similarity->level,
                gap = (similarity->inner_cursor - similarity->cursor + m) % m;
        vertex_run first, second;

        if (similarity->cursor < 0) {
            if (!cairn_budget_charge(budget, &similarity->units_charged,
                                     1 + similarity->params.outline_samples / VERTICES_PER_UNIT))
                return CAIRN_MORE;
            similarity->cursor = select_level(similarity) ? 0 : -1;
            similarity->level += similarity->cursor < 0;
            continue;
        }
        set_division(m, similarity->cursor, similarity->inner_cursor, similarity->division, &first,
                     &second);
        /* Adjacent vertices are no cut. Division 2 is symmetric in i and k. Arcs of one vertex
         * are allowed as written only. */
        if (gap > 1 && gap < m - 1 && (second.count > 1 || is_as_written(similarity)) &&
            (similarity->division != 2 || similarity->cursor < similarity->inner_cursor)) {
            if (!cairn_budget_charge(budget, &similarity->units_charged,
                                     2 + first.count * second.count / CELLS_PER_UNIT))
                return CAIRN_MORE;
            try_division(similarity, first, second);
        } else if (!cairn_budget_charge(budget, &similarity->units_charged, 1)) {
            return CAIRN_MORE;
        }
        advance(similarity);
    }
    return CAIRN_OK;
}
