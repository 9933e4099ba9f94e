/* Fragments of an outline, grouped into part bundles.
 *
 * Method:
 * 1. By rule the vertices are the last bundles * pieces_each of the outline's discrete curve
 *    evolution, fewer when it has fewer. The fragments are all arcs of consecutive pieces that
 *    leave at least one piece out. Manual cuts: the vertices are all ends of cuts.
 * 2. Each fragment is resampled at even arc length.
 *
 * Memory layout: the outline with its cumulative arc length, the evolution, the model's arrays, the
 * arc being sampled.
 *
 * Limits: one outline; holes are models of their own.
 *
 * Source: Adluru 2008, section 5.2.1; the rule is this project's, where the thesis bundles
 * manually. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/curve.h"
#include "cairn/curve_evolution.h"
#include "cairn/part_bundle.h"
#include "src/base/object.h"
#include "src/base/step.h"

enum {
    MAX_POINTS = 4096,
    MAX_PIECES_EACH = 4,
    MAX_FRAGMENT_PIECES = 3,
    MAX_SAMPLES_EACH = 64,
    POINTS_PER_UNIT = 4
};

static const cairn_real MAX_COORDINATE = CAIRN_REAL(1e9);

struct cairn_part_bundle_builder {
    cairn_part_bundle_params params;
    cairn_vec2 *points; /* [max_points] */
    /* [max_points + 1] cumulative arc length from the first point to each */
    cairn_real *arc_length;
    cairn_vec2 *arc;                       /* [max_points + 1] the arc being sampled */
    cairn_vec2 *positions, *directions;    /* [samples_each] */
    cairn_part_bundle_fragment *fragments; /* [FRAGMENTS] */
    cairn_oriented_point *samples;         /* [FRAGMENTS * samples_each] */
    cairn_curve_evolution *evolution;
    int32_t vertices[CAIRN_PART_MAX_PIECES];
    cairn_real piece_length[CAIRN_PART_MAX_PIECES];
    int32_t count, vertex_count, fragment_count, bundles;
    cairn_vec2 centroid;
    /* 1: the fragments are cut by rule. */
    int32_t is_by_rule;
    /* Fragment that is sampled. */
    int32_t next_fragment;
    /* 1: a model is to be built; 1: the model is complete. */
    int32_t is_pending, is_complete;
    int32_t resume, units_charged;
};

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_part_bundle_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_points, 256, 3, MAX_POINTS),        INTEGER(bundles, 4, 1, CAIRN_PART_MAX_BUNDLES),
    INTEGER(pieces_each, 2, 1, MAX_PIECES_EACH),    INTEGER(max_pieces, 3, 1, MAX_FRAGMENT_PIECES),
    INTEGER(samples_each, 20, 2, MAX_SAMPLES_EACH),
};
extern const cairn_parameters cairn_part_bundle_parameters;
const cairn_parameters cairn_part_bundle_parameters =
    CAIRN_PARAMETERS("part_bundle", cairn_part_bundle_params, rows);

cairn_part_bundle_params cairn_part_bundle_default(void)
{
    cairn_part_bundle_params params;

    cairn_parameters_preset(&cairn_part_bundle_parameters, &params);
    return params;
}

cairn_status cairn_part_bundle_check(const cairn_part_bundle_params *params,
                                     cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_part_bundle_parameters, params, fault);
}

static cairn_curve_evolution_params evolution_params(const cairn_part_bundle_params *params)
{
    cairn_curve_evolution_params evolution = {.max_points = params->max_points};

    return evolution;
}

/* The object, its arrays and the evolution; NULL from a counting pool. */
static cairn_part_bundle_builder *build(cairn_pool *pool, const cairn_part_bundle_params *params)
{
    size_t n = (size_t)params->max_points, samples = (size_t)params->samples_each;
    cairn_curve_evolution_params evolution = evolution_params(params);
    cairn_part_bundle_builder *builder = cairn_object_take(pool, sizeof *builder);

    CAIRN_TAKE(builder, pool, points, n);
    CAIRN_TAKE(builder, pool, arc_length, n + 1);
    CAIRN_TAKE(builder, pool, arc, n + 1);
    CAIRN_TAKE(builder, pool, positions, 2 * samples);
    CAIRN_TAKE(builder, pool, fragments, CAIRN_PART_MAX_FRAGMENTS);
    CAIRN_TAKE(builder, pool, samples, CAIRN_PART_MAX_FRAGMENTS * samples);
    CAIRN_TAKE_OBJECT(builder, pool, evolution, curve_evolution, &evolution);
    if (builder != NULL) {
        builder->params = *params;
        builder->directions = builder->positions + samples;
    }
    return builder;
}

CAIRN_OBJECT(part_bundle, part_bundle_builder, build);

/* ---- The outline ---- */

static int32_t next_vertex(const cairn_part_bundle_builder *builder, int32_t i)
{
    return i + 1 < builder->count ? i + 1 : 0;
}

/* Computes the cumulative arc length and the length-weighted centroid. */
static void measure_outline(cairn_part_bundle_builder *builder)
{
    cairn_vec2 sum = {0, 0};

    builder->arc_length[0] = 0;
    for (int32_t i = 0; i < builder->count; i++) {
        cairn_vec2 from = builder->points[i], to = builder->points[next_vertex(builder, i)];
        cairn_real length = cairn_vec2_norm(cairn_vec2_sub(to, from));

        builder->arc_length[i + 1] = builder->arc_length[i] + length;
        sum = cairn_vec2_add(sum, cairn_vec2_scale(cairn_vec2_add(from, to), length / 2));
    }
    if (builder->arc_length[builder->count] > 0)
        builder->centroid = cairn_vec2_scale(sum, 1 / builder->arc_length[builder->count]);
}

/* Arc length from one vertex forward to another; the whole outline from a vertex to itself. */
static cairn_real arc_length(const cairn_part_bundle_builder *builder, int32_t from, int32_t to)
{
    cairn_real length = builder->arc_length[to] - builder->arc_length[from];

    return from < to ? length : length + builder->arc_length[builder->count];
}

/* ---- Fragments ---- */

/* Bit set of the pieces from one of the model's vertices forward to another. */
static uint32_t pieces_between(const cairn_part_bundle_builder *builder, int32_t from, int32_t to)
{
    uint32_t pieces = 0;
    int32_t i = 0;

    while (builder->vertices[i] != from)
        i++;
    do {
        pieces |= UINT32_C(1) << i;
        i = i + 1 < builder->vertex_count ? i + 1 : 0;
    } while (builder->vertices[i] != to);
    return pieces;
}

static void add_fragment(cairn_part_bundle_builder *builder, int32_t from, int32_t to,
                         int32_t bundle)
{
    cairn_part_bundle_fragment *fragment = &builder->fragments[builder->fragment_count];

    fragment->from = from;
    fragment->to = to;
    fragment->bundle = bundle;
    fragment->pieces = pieces_between(builder, from, to);
    fragment->length = arc_length(builder, from, to);
    fragment->first = builder->fragment_count * builder->params.samples_each;
    builder->fragment_count++;
}

static void measure_pieces(cairn_part_bundle_builder *builder)
{
    for (int32_t i = 0; i < builder->vertex_count; i++)
        builder->piece_length[i] =
            arc_length(builder, builder->vertices[i],
                       builder->vertices[i + 1 < builder->vertex_count ? i + 1 : 0]);
}

/* Level of the curve evolution whose vertices are the model's. */
static int32_t level_of(const cairn_part_bundle_params *params)
{
    int32_t level = params->bundles * params->pieces_each;

    return level < 3 ? 3 : level;
}

static void cut_by_rule(cairn_part_bundle_builder *builder)
{
    cairn_curve_evolution_result levels = cairn_curve_evolution_read(builder->evolution);
    int32_t level = level_of(&builder->params), n;
    cairn_real whole = builder->arc_length[builder->count];

    for (int32_t i = 0; i < builder->count; i++)
        if (levels.rank[i] < level)
            builder->vertices[builder->vertex_count++] = i;
    n = builder->vertex_count;
    measure_pieces(builder);
    for (int32_t i = 0; i < n; i++)
        for (int32_t pieces = 1; pieces <= builder->params.max_pieces && pieces < n; pieces++) {
            int32_t from = builder->vertices[i], to = builder->vertices[(i + pieces) % n];
            cairn_real middle = builder->arc_length[from] -
                                builder->arc_length[builder->vertices[0]] +
                                arc_length(builder, from, to) / 2;
            cairn_real share = (middle < whole ? middle : middle - whole) / whole;
            int32_t bundle = cairn_real_to_int(share * (cairn_real)builder->params.bundles);

            if (arc_length(builder, from, to) > 0)
                add_fragment(builder, from, to,
                             bundle < builder->params.bundles ? bundle
                                                              : builder->params.bundles - 1);
        }
    builder->bundles = builder->params.bundles;
}

static int is_end(const cairn_part_bundle_cut *cuts, int32_t count, int32_t vertex)
{
    for (int32_t k = 0; k < count; k++)
        if (cuts[k].from == vertex || cuts[k].to == vertex)
            return 1;
    return 0;
}

static void cut_by_hand(cairn_part_bundle_builder *builder, const cairn_part_bundle_cut *cuts,
                        int32_t count)
{
    for (int32_t i = 0; i < builder->count; i++)
        if (is_end(cuts, count, i))
            builder->vertices[builder->vertex_count++] = i;
    measure_pieces(builder);
    for (int32_t k = 0; k < count; k++) {
        add_fragment(builder, cuts[k].from, cuts[k].to, cuts[k].bundle);
        builder->bundles =
            cuts[k].bundle >= builder->bundles ? cuts[k].bundle + 1 : builder->bundles;
    }
}

static void sample_fragment(cairn_part_bundle_builder *builder,
                            const cairn_part_bundle_fragment *fragment)
{
    cairn_curve arc = {.points = builder->arc, .count = 1};
    int32_t i = fragment->from;

    builder->arc[0] = builder->points[i];
    do {
        i = next_vertex(builder, i);
        builder->arc[arc.count++] = builder->points[i];
    } while (i != fragment->to);
    cairn_must_be_ok(cairn_curve_resample(&arc, builder->positions, builder->directions,
                                          builder->params.samples_each));
    for (int32_t k = 0; k < builder->params.samples_each; k++) {
        builder->samples[fragment->first + k].position = builder->positions[k];
        builder->samples[fragment->first + k].direction = builder->directions[k];
    }
}

/* ---- Calls ---- */

static cairn_status check_outline(const cairn_part_bundle_builder *builder,
                                  const cairn_vec2 *points, int32_t count)
{
    if (count > builder->params.max_points)
        return CAIRN_FULL;
    for (int32_t i = 0; i < count; i++)
        if (!cairn_vec2_is_within(points[i], MAX_COORDINATE))
            return CAIRN_NOT_FINITE;
    for (int32_t i = 1; i < count; i++)
        if (cairn_vec2_norm(cairn_vec2_sub(points[i], points[0])) > 0)
            return CAIRN_OK;
    return CAIRN_EMPTY;
}

/* Length of a cut, for validation before any state changes. */
static cairn_real cut_length(const cairn_vec2 *points, int32_t count,
                             const cairn_part_bundle_cut *cut)
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

static cairn_status check_cuts(const cairn_vec2 *points, int32_t count,
                               const cairn_part_bundle_cut *cuts, int32_t cut_count)
{
    int32_t vertices = 0;
    uint32_t bundles = 0;

    if (cut_count < 1)
        return CAIRN_BAD_ARGUMENT;
    for (int32_t k = 0; k < cut_count; k++)
        if (cuts[k].from < 0 || cuts[k].from >= count || cuts[k].to < 0 || cuts[k].to >= count ||
            cuts[k].from == cuts[k].to || cuts[k].bundle < 0 ||
            cuts[k].bundle >= CAIRN_PART_MAX_BUNDLES)
            return CAIRN_BAD_ARGUMENT;
    for (int32_t k = 0; k < cut_count; k++)
        bundles |= UINT32_C(1) << cuts[k].bundle;
    if ((bundles & (bundles + 1)) != 0) /* a bundle below the greatest has no fragment */
        return CAIRN_BAD_ARGUMENT;
    if (cut_count > CAIRN_PART_MAX_FRAGMENTS)
        return CAIRN_FULL;
    for (int32_t i = 0; i < count; i++)
        vertices += is_end(cuts, cut_count, i);
    if (vertices > CAIRN_PART_MAX_PIECES)
        return CAIRN_FULL;
    for (int32_t k = 0; k < cut_count; k++)
        if (!(cut_length(points, count, &cuts[k]) > 0))
            return CAIRN_EMPTY;
    return CAIRN_OK;
}

cairn_status cairn_part_bundle_begin(cairn_part_bundle_builder *builder, const cairn_vec2 *points,
                                     int32_t count, const cairn_part_bundle_cut *cuts,
                                     int32_t cut_count)
{
    cairn_status status;

    if (builder == NULL || points == NULL || count < 3)
        return CAIRN_BAD_ARGUMENT;
    status = check_outline(builder, points, count);
    if (status == CAIRN_OK && cuts != NULL)
        status = check_cuts(points, count, cuts, cut_count);
    if (status == CAIRN_OK && cuts == NULL)
        status = cairn_curve_evolution_begin(builder->evolution, points, count);
    if (status != CAIRN_OK)
        return status;
    memcpy(builder->points, points, (size_t)count * sizeof *points);
    builder->count = count;
    builder->vertex_count = builder->fragment_count = builder->bundles = 0;
    builder->resume = builder->units_charged = 0;
    builder->is_pending = 1;
    builder->is_complete = 0;
    measure_outline(builder);
    builder->is_by_rule = cuts == NULL;
    if (!builder->is_by_rule)
        cut_by_hand(builder, cuts, cut_count);
    return CAIRN_OK;
}

/* Cost of the cuts by rule, and of a fragment, in units. */
static int32_t rule_cost(const cairn_part_bundle_builder *builder)
{
    return 1 +
           (builder->count + MAX_FRAGMENT_PIECES * level_of(&builder->params)) / POINTS_PER_UNIT;
}

static int32_t fragment_cost(const cairn_part_bundle_builder *builder)
{
    return 1 + (builder->count + builder->params.samples_each) / POINTS_PER_UNIT;
}

/* The model: see Method in the head of this file. Cuts by hand are made by begin(). */
static int make_model(cairn_part_bundle_builder *builder, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(builder->resume);
    if (builder->is_by_rule) {
        CAIRN_STEP_UNTIL(builder->resume,
                         cairn_curve_evolution_step(builder->evolution, budget) == CAIRN_OK);
        CAIRN_STEP_CHARGE(builder, resume, budget, rule_cost(builder));
        cut_by_rule(builder);
    }
    for (builder->next_fragment = 0; builder->next_fragment < builder->fragment_count;
         builder->next_fragment++) {
        CAIRN_STEP_CHARGE(builder, resume, budget, fragment_cost(builder));
        sample_fragment(builder, &builder->fragments[builder->next_fragment]);
    }
    CAIRN_STEP_END(builder->resume);
}

cairn_status cairn_part_bundle_step(cairn_part_bundle_builder *builder, cairn_budget *budget)
{
    if (builder == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (builder->is_pending && make_model(builder, budget)) {
        builder->is_pending = 0;
        builder->is_complete = 1;
    }
    return builder->is_pending ? CAIRN_MORE : CAIRN_OK;
}

cairn_part_bundle_model cairn_part_bundle_read(const cairn_part_bundle_builder *builder)
{
    cairn_part_bundle_model model;

    memset(&model, 0, sizeof model);
    if (builder == NULL || !builder->is_complete)
        return model;
    model.fragments = builder->fragments;
    model.samples = builder->samples;
    model.vertices = builder->vertices;
    model.piece_length = builder->piece_length;
    model.fragment_count = builder->fragment_count;
    model.samples_each = builder->params.samples_each;
    model.vertex_count = builder->vertex_count;
    model.bundle_count = builder->bundles;
    model.length = builder->arc_length[builder->count];
    model.centroid = builder->centroid;
    return model;
}
