/* Fragments of an outline, in bundles.
 *
 * Method: by rule the vertices are those of the level of bundles * pieces_each of the outline's
 * evolution, fewer when it has fewer; the fragments are all arcs of consecutive pieces that leave
 * at least one piece out. By hand the vertices are all ends of cuts.
 *
 * Layout: the outline with its length up to each point, the evolution, the model's arrays, the arc
 * that is sampled.
 *
 * Limits: one outline; holes are models of their own.
 *
 * Source: Adluru 2008, section 5.2.1; the rule is this project's, where the thesis bundles by
 * hand. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/curve.h"
#include "cairn/curve_evolution.h"
#include "cairn/part_bundle.h"

enum {
    POINTS_MOST = 4096,
    PIECES_EACH_MOST = 4,
    LONGEST_MOST = 3,
    SAMPLES_MOST = 64,
    PLACES_A_UNIT = 4
};
enum { IDLE, EVOLVE, LAY, CUT, DONE };

static const cairn_real FAR = CAIRN_REAL(1e9);

struct cairn_part_builder {
    cairn_part_bundle_params params;
    cairn_vec2 *points;              /* [max_points] */
    cairn_real *reached;             /* [max_points + 1] length from the first point to each */
    cairn_vec2 *arc;                 /* [max_points + 1] */
    cairn_vec2 *places, *directions; /* [samples_each] */
    cairn_part_fragment *fragments;  /* [FRAGMENTS] */
    cairn_oriented_point *samples;   /* [FRAGMENTS * samples_each] */
    cairn_curve_evolution *evolution;
    int32_t vertices[CAIRN_PART_PIECES];
    cairn_real piece_length[CAIRN_PART_PIECES];
    int32_t count, vertex_count, fragment_count, bundles;
    cairn_vec2 centroid;
    int32_t next; /* fragment to be sampled */
    int32_t phase, paid;
};

cairn_part_bundle_params cairn_part_bundle_default(void)
{
    cairn_part_bundle_params params = {256, 4, 2, 3, 20};

    return params;
}

static int params_are_good(const cairn_part_bundle_params *p)
{
    return p != NULL && p->max_points >= 3 && p->max_points <= POINTS_MOST && p->bundles >= 1 &&
           p->bundles <= CAIRN_PART_BUNDLES && p->pieces_each >= 1 &&
           p->pieces_each <= PIECES_EACH_MOST && p->longest >= 1 && p->longest <= LONGEST_MOST &&
           p->samples_each >= 2 && p->samples_each <= SAMPLES_MOST;
}

static cairn_curve_evolution_params evolution_params(const cairn_part_bundle_params *p)
{
    cairn_curve_evolution_params params = {p->max_points};

    return params;
}

/* All but the evolution. */
static cairn_part_builder *carve(cairn_pool *pool, const cairn_part_bundle_params *p)
{
    size_t n = (size_t)p->max_points, samples = (size_t)p->samples_each;
    cairn_part_builder *b = cairn_pool_take_one(pool, sizeof *b);
    cairn_vec2 *points = cairn_pool_take(pool, n, sizeof *points);
    cairn_real *reached = cairn_pool_take(pool, n + 1, sizeof *reached);
    cairn_vec2 *arc = cairn_pool_take(pool, n + 1, sizeof *arc);
    cairn_vec2 *places = cairn_pool_take(pool, 2 * samples, sizeof *places);
    cairn_part_fragment *fragments = cairn_pool_take(pool, CAIRN_PART_FRAGMENTS, sizeof *fragments);
    cairn_oriented_point *at = cairn_pool_take(pool, CAIRN_PART_FRAGMENTS * samples, sizeof *at);

    if (b != NULL) {
        memset(b, 0, sizeof *b);
        b->points = points;
        b->reached = reached;
        b->arc = arc;
        b->places = places;
        b->directions = places + samples;
        b->fragments = fragments;
        b->samples = at;
    }
    return b;
}

size_t cairn_part_bundle_memory(const cairn_part_bundle_params *params)
{
    cairn_curve_evolution_params evolution;
    cairn_pool counting;

    if (!params_are_good(params))
        return 0;
    evolution = evolution_params(params);
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    cairn_pool_count(&counting, cairn_curve_evolution_memory(&evolution));
    return cairn_pool_counted(&counting);
}

cairn_status cairn_part_bundle_create(cairn_part_builder **builder, cairn_pool *pool,
                                      const cairn_part_bundle_params *params)
{
    size_t need = cairn_part_bundle_memory(params);
    cairn_curve_evolution_params evolution;

    if (builder == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    *builder = carve(pool, params);
    (*builder)->params = *params;
    evolution = evolution_params(params);
    return cairn_curve_evolution_create(&(*builder)->evolution, pool, &evolution);
}

/* ---- The outline ---- */

static int32_t behind(const cairn_part_builder *b, int32_t i)
{
    return i + 1 < b->count ? i + 1 : 0;
}

static void measure(cairn_part_builder *b)
{
    cairn_vec2 sum = {0, 0};

    b->reached[0] = 0;
    for (int32_t i = 0; i < b->count; i++) {
        cairn_vec2 from = b->points[i], to = b->points[behind(b, i)];
        cairn_real length = cairn_vec2_norm(cairn_vec2_sub(to, from));

        b->reached[i + 1] = b->reached[i] + length;
        sum = cairn_vec2_add(sum, cairn_vec2_scale(cairn_vec2_add(from, to), length / 2));
    }
    if (b->reached[b->count] > 0)
        b->centroid = cairn_vec2_scale(sum, 1 / b->reached[b->count]);
}

/* From one vertex on to another; a whole round from one to itself. */
static cairn_real arc_length(const cairn_part_builder *b, int32_t from, int32_t to)
{
    cairn_real length = b->reached[to] - b->reached[from];

    return from < to ? length : length + b->reached[b->count];
}

/* ---- Fragments ---- */

/* The pieces from one of the model's vertices to another. */
static uint32_t pieces_between(const cairn_part_builder *b, int32_t from, int32_t to)
{
    uint32_t pieces = 0;
    int32_t i = 0;

    while (b->vertices[i] != from)
        i++;
    do {
        pieces |= UINT32_C(1) << i;
        i = i + 1 < b->vertex_count ? i + 1 : 0;
    } while (b->vertices[i] != to);
    return pieces;
}

static void add_fragment(cairn_part_builder *b, int32_t from, int32_t to, int32_t bundle)
{
    cairn_part_fragment *f = &b->fragments[b->fragment_count];

    f->from = from;
    f->to = to;
    f->bundle = bundle;
    f->pieces = pieces_between(b, from, to);
    f->length = arc_length(b, from, to);
    f->first = b->fragment_count * b->params.samples_each;
    b->fragment_count++;
}

static void measure_pieces(cairn_part_builder *b)
{
    for (int32_t i = 0; i < b->vertex_count; i++)
        b->piece_length[i] =
            arc_length(b, b->vertices[i], b->vertices[i + 1 < b->vertex_count ? i + 1 : 0]);
}

/* The level of the outline's evolution whose vertices are the model's. */
static int32_t level_of(const cairn_part_bundle_params *p)
{
    int32_t level = p->bundles * p->pieces_each;

    return level < 3 ? 3 : level;
}

static void cut_by_rule(cairn_part_builder *b)
{
    cairn_curve_evolution_result levels = cairn_curve_evolution_read(b->evolution);
    int32_t level = level_of(&b->params), n;
    cairn_real whole = b->reached[b->count];

    for (int32_t i = 0; i < b->count; i++)
        if (levels.rank[i] < level)
            b->vertices[b->vertex_count++] = i;
    n = b->vertex_count;
    measure_pieces(b);
    for (int32_t i = 0; i < n; i++)
        for (int32_t pieces = 1; pieces <= b->params.longest && pieces < n; pieces++) {
            int32_t from = b->vertices[i], to = b->vertices[(i + pieces) % n];
            cairn_real middle =
                b->reached[from] - b->reached[b->vertices[0]] + arc_length(b, from, to) / 2;
            cairn_real share = (middle < whole ? middle : middle - whole) / whole;
            int32_t bundle = cairn_real_to_int(share * (cairn_real)b->params.bundles);

            if (arc_length(b, from, to) > 0)
                add_fragment(b, from, to,
                             bundle < b->params.bundles ? bundle : b->params.bundles - 1);
        }
    b->bundles = b->params.bundles;
    b->phase = CUT;
}

static int is_end(const cairn_part_cut *cuts, int32_t count, int32_t vertex)
{
    for (int32_t k = 0; k < count; k++)
        if (cuts[k].from == vertex || cuts[k].to == vertex)
            return 1;
    return 0;
}

static void cut_by_hand(cairn_part_builder *b, const cairn_part_cut *cuts, int32_t count)
{
    for (int32_t i = 0; i < b->count; i++)
        if (is_end(cuts, count, i))
            b->vertices[b->vertex_count++] = i;
    measure_pieces(b);
    for (int32_t k = 0; k < count; k++) {
        add_fragment(b, cuts[k].from, cuts[k].to, cuts[k].bundle);
        b->bundles = cuts[k].bundle >= b->bundles ? cuts[k].bundle + 1 : b->bundles;
    }
    b->phase = CUT;
}

static void sample_fragment(cairn_part_builder *b, const cairn_part_fragment *f)
{
    cairn_curve arc = {b->arc, 1, 0};
    int32_t i = f->from;
    cairn_status status;

    b->arc[0] = b->points[i];
    do {
        i = behind(b, i);
        b->arc[arc.count++] = b->points[i];
    } while (i != f->to);
    status = cairn_curve_resample(&arc, b->places, b->directions, b->params.samples_each);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    for (int32_t k = 0; k < b->params.samples_each; k++) {
        b->samples[f->first + k].position = b->places[k];
        b->samples[f->first + k].direction = b->directions[k];
    }
}

/* ---- Calls ---- */

static cairn_status check_outline(const cairn_part_builder *b, const cairn_vec2 *points,
                                  int32_t count)
{
    if (count > b->params.max_points)
        return CAIRN_FULL;
    for (int32_t i = 0; i < count; i++)
        if (!(cairn_abs(points[i].x) <= FAR) || !(cairn_abs(points[i].y) <= FAR))
            return CAIRN_NOT_FINITE;
    for (int32_t i = 1; i < count; i++)
        if (cairn_vec2_norm(cairn_vec2_sub(points[i], points[0])) > 0)
            return CAIRN_OK;
    return CAIRN_EMPTY;
}

/* The length of a cut, before anything is taken over. */
static cairn_real cut_length(const cairn_vec2 *points, int32_t count, const cairn_part_cut *cut)
{
    cairn_real length = 0;
    int32_t i = cut->from;

    while (i != cut->to) {
        int32_t next = i + 1 < count ? i + 1 : 0;

        length += cairn_vec2_norm(cairn_vec2_sub(points[next], points[i]));
        i = next;
    }
    return length;
}

static cairn_status check_cuts(const cairn_vec2 *points, int32_t count, const cairn_part_cut *cuts,
                               int32_t cut_count)
{
    int32_t vertices = 0;
    uint32_t bundles = 0;

    if (cut_count < 1)
        return CAIRN_BAD_ARGUMENT;
    for (int32_t k = 0; k < cut_count; k++)
        if (cuts[k].from < 0 || cuts[k].from >= count || cuts[k].to < 0 || cuts[k].to >= count ||
            cuts[k].from == cuts[k].to || cuts[k].bundle < 0 ||
            cuts[k].bundle >= CAIRN_PART_BUNDLES)
            return CAIRN_BAD_ARGUMENT;
    for (int32_t k = 0; k < cut_count; k++)
        bundles |= UINT32_C(1) << cuts[k].bundle;
    if ((bundles & (bundles + 1)) != 0) /* one below the last has no fragment */
        return CAIRN_BAD_ARGUMENT;
    if (cut_count > CAIRN_PART_FRAGMENTS)
        return CAIRN_FULL;
    for (int32_t i = 0; i < count; i++)
        vertices += is_end(cuts, cut_count, i);
    if (vertices > CAIRN_PART_PIECES)
        return CAIRN_FULL;
    for (int32_t k = 0; k < cut_count; k++)
        if (!(cut_length(points, count, &cuts[k]) > 0))
            return CAIRN_EMPTY;
    return CAIRN_OK;
}

cairn_status cairn_part_bundle_begin(cairn_part_builder *b, const cairn_vec2 *points, int32_t count,
                                     const cairn_part_cut *cuts, int32_t cut_count)
{
    cairn_status status;

    if (b == NULL || points == NULL || count < 3)
        return CAIRN_BAD_ARGUMENT;
    status = check_outline(b, points, count);
    if (status == CAIRN_OK && cuts != NULL)
        status = check_cuts(points, count, cuts, cut_count);
    if (status == CAIRN_OK && cuts == NULL)
        status = cairn_curve_evolution_begin(b->evolution, points, count);
    if (status != CAIRN_OK)
        return status;
    memcpy(b->points, points, (size_t)count * sizeof *points);
    b->count = count;
    b->vertex_count = b->fragment_count = b->bundles = b->next = b->paid = 0;
    measure(b);
    b->phase = EVOLVE;
    if (cuts != NULL)
        cut_by_hand(b, cuts, cut_count);
    return CAIRN_OK;
}

cairn_status cairn_part_bundle_step(cairn_part_builder *b, cairn_budget *budget)
{
    if (b == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (b->phase == EVOLVE) {
        cairn_status status = cairn_curve_evolution_step(b->evolution, budget);

        if (status != CAIRN_OK)
            return status;
        b->phase = LAY;
    }
    if (b->phase == LAY) {
        if (!cairn_budget_pay(budget, &b->paid,
                              1 + (b->count + LONGEST_MOST * level_of(&b->params)) / PLACES_A_UNIT))
            return CAIRN_MORE;
        cut_by_rule(b);
    }
    while (b->phase == CUT) {
        if (b->next == b->fragment_count) {
            b->phase = DONE;
            break;
        }
        if (!cairn_budget_pay(budget, &b->paid,
                              1 + (b->count + b->params.samples_each) / PLACES_A_UNIT))
            return CAIRN_MORE;
        sample_fragment(b, &b->fragments[b->next++]);
    }
    return CAIRN_OK;
}

cairn_part_model cairn_part_bundle_read(const cairn_part_builder *b)
{
    cairn_part_model model;

    memset(&model, 0, sizeof model);
    if (b == NULL || b->phase != DONE)
        return model;
    model.fragments = b->fragments;
    model.samples = b->samples;
    model.vertices = b->vertices;
    model.piece_length = b->piece_length;
    model.fragment_count = b->fragment_count;
    model.samples_each = b->params.samples_each;
    model.vertex_count = b->vertex_count;
    model.bundles = b->bundles;
    model.length = b->reached[b->count];
    model.centroid = b->centroid;
    return model;
}
