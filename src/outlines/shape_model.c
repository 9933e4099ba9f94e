/* Symmetry-set model of a shape from its outlines.
 *
 * Method:
 * 1. An outline is sampled evenly. Two samples and the disc that touches the outline at both are a
 *    point of the symmetry set.
 * 2. A path through the set steps from pair to pair: one sample moves forward and the other
 *    backward, or one of them stays. Its value is the passed outline length times the symmetry of
 *    the pairs, minus a constant cost per length. Asymmetric stretches are passed only if symmetric
 *    ones follow.
 * 3. The path of greatest value is found by dynamic programming over (position, gap).
 * 4. Stretches passed on one side alone, and the remainders beyond the ends of the path, are
 *    searched in the same way, the longest first.
 *
 * Memory layout: outlines, the matrix of gains, three rows of values, the matrix of moves, samples,
 * paths.
 *
 * Limits: the outlines of an object are processed independently; a hole is treated like any other
 * outline, with its interior as object. The length of a path is the passed outline, not the length
 * of the medial axis, so a disc, whose centre is fixed, has a path as well.
 *
 * Source: Adluru 2008, sections 2.3.2 and 2.5. */
#include "src/base/build.h"

#include <string.h>

#include "src/outlines/shape_model_work.h"

/* Work units of a path; outline samples per work unit of a gain. */
enum { SAMPLES_PER_UNIT = 16 };

/* Samples to either side over which tangents are estimated. */
enum { TANGENT_HALF_WIDTH = 2 };
/* A step longer than this multiple of the mean step begins another outline. */
#define MAX_STEP_RATIO CAIRN_REAL(3.0)

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_shape_model_builder_params, field, __VA_ARGS__)
#define NUMBER(field, ...)  CAIRN_NUMBER(cairn_shape_model_builder_params, field, __VA_ARGS__)
#define POSITIVE(field, ...)                                                                       \
    CAIRN_NUMBER_ABOVE(cairn_shape_model_builder_params, field, __VA_ARGS__)
#define BETWEEN(field, ...)                                                                        \
    CAIRN_NUMBER_BETWEEN(cairn_shape_model_builder_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(outline_samples, 128, SHAPE_MODEL_MIN_OUTLINE_SAMPLES, 1024),
    INTEGER(path_samples, 32, 4, 256),
    INTEGER(max_paths, CAIRN_SHAPE_MODEL_MAX_PATHS, 1, CAIRN_SHAPE_MODEL_MAX_PATHS),
    BETWEEN(max_deviation, 20 * (CAIRN_PI / 180), 0, CAIRN_PI / 2),
    POSITIVE(deviation_sigma, 10 * (CAIRN_PI / 180), 0, CAIRN_REAL_MAX),
    NUMBER(min_clearance, CAIRN_REAL(0.8), 0, 1),
    POSITIVE(min_outline_share, CAIRN_REAL(0.08), 0, 1),
};
const cairn_parameters cairn_shape_model_builder_parameters =
    CAIRN_PARAMETERS("shape_model_builder", cairn_shape_model_builder_params, rows);

cairn_shape_model_builder_params cairn_shape_model_builder_default(void)
{
    cairn_shape_model_builder_params params;

    cairn_parameters_preset(&cairn_shape_model_builder_parameters, &params);
    return params;
}

cairn_status cairn_shape_model_builder_check(const cairn_shape_model_builder_params *params,
                                             cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_shape_model_builder_parameters, params, fault);
}

/* Returns the greatest number of samples of all outlines. */
static int32_t max_outline_samples(const cairn_shape_model_builder_params *params)
{
    return params->outline_samples +
           CAIRN_SHAPE_MODEL_MAX_OUTLINES * (SHAPE_MODEL_MIN_OUTLINE_SAMPLES + 1);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_shape_model_builder *build(cairn_pool *pool,
                                        const cairn_shape_model_builder_params *params)
{
    size_t side = (size_t)params->outline_samples + SHAPE_MODEL_MIN_OUTLINE_SAMPLES;
    cairn_shape_model_builder *builder = cairn_object_take(pool, sizeof *builder);

    CAIRN_TAKE(builder, pool, outline, max_outline_samples(params));
    CAIRN_TAKE(builder, pool, gain, side * side);
    CAIRN_TAKE(builder, pool, dp_value, 3 * side);
    CAIRN_TAKE(builder, pool, dp_move, side * side);
    CAIRN_TAKE(builder, pool, path_pairs, 2 * side);
    CAIRN_TAKE(builder, pool, samples, shape_model_max_samples(params));
    CAIRN_TAKE(builder, pool, paths, CAIRN_SHAPE_MODEL_MAX_PATHS);
    if (builder != NULL)
        builder->params = *params;
    return builder;
}

CAIRN_OBJECT(shape_model_builder, shape_model_builder, build);

/* ---- Outlines ---- */

static cairn_status check_outlines(const cairn_curve *outlines, int32_t count, cairn_box *box,
                                   cairn_real *whole)
{
    *box = cairn_box_empty();
    *whole = 0;
    for (int32_t i = 0; i < count; i++) {
        const cairn_curve *c = &outlines[i];

        if (c->points == NULL || c->count < 3 || !c->closed)
            return CAIRN_BAD_ARGUMENT;
        for (int32_t k = 0; k < c->count; k++) {
            if (!cairn_vec2_is_finite(c->points[k]))
                return CAIRN_NOT_FINITE;
            *box = cairn_box_extend(*box, c->points[k]);
        }
        *whole += cairn_curve_length(c);
        if (!cairn_is_finite(cairn_vec2_norm_squared(cairn_vec2_sub(box->max, box->min))) ||
            !cairn_is_finite(*whole))
            return CAIRN_NOT_FINITE;
        if (!(cairn_abs(cairn_polygon_area(c->points, c->count)) > 0))
            return CAIRN_EMPTY;
    }
    return CAIRN_OK;
}

/* Samples one outline into outline[outline_first ...], in units of the size, oriented with its
 * interior to the left. */
static void sample_outline(cairn_shape_model_builder *builder, const cairn_curve *curve,
                           cairn_oriented_point *to, int32_t count)
{
    int turned = cairn_polygon_area(curve->points, curve->count) < 0;
    cairn_vec2 *even = (cairn_vec2 *)(void *)builder->gain, *tangent = even + count;
    cairn_curve sampled = {even, count, 1};

    cairn_must_be_ok(cairn_curve_resample(curve, even, NULL, count));
    for (int32_t i = 0; i < count; i++)
        even[i] = cairn_vec2_scale(cairn_vec2_sub(even[i], builder->origin), 1 / builder->size);
    cairn_must_be_ok(cairn_curve_tangents(&sampled, TANGENT_HALF_WIDTH, tangent));
    for (int32_t i = 0; i < count; i++) {
        int32_t from = turned ? count - 1 - i : i;

        to[i].position = even[from];
        to[i].direction = cairn_vec2_scale(tangent[from], turned ? -1 : 1);
    }
}

cairn_status cairn_shape_model_builder_begin(cairn_shape_model_builder *builder,
                                             const cairn_curve *outlines, int32_t count)
{
    cairn_real whole;
    cairn_status status;
    cairn_box box;

    if (builder == NULL || outlines == NULL || count < 1 || count > CAIRN_SHAPE_MODEL_MAX_OUTLINES)
        return CAIRN_BAD_ARGUMENT;
    status = check_outlines(outlines, count, &box, &whole);
    if (status != CAIRN_OK)
        return status;
    builder->size = cairn_vec2_norm(cairn_vec2_sub(box.max, box.min));
    builder->origin = cairn_vec2_scale(cairn_vec2_add(box.min, box.max), CAIRN_REAL(0.5));
    builder->total_length = whole / builder->size;
    builder->outline_count = count;
    builder->sample_count = builder->path_count = 0;
    builder->outline_first[0] = 0;
    for (int32_t i = 0; i < count; i++) {
        cairn_real length = cairn_curve_length(&outlines[i]);
        int32_t points = cairn_real_to_int(
            cairn_rint((cairn_real)builder->params.outline_samples * (length / whole)));

        points =
            points < SHAPE_MODEL_MIN_OUTLINE_SAMPLES ? SHAPE_MODEL_MIN_OUTLINE_SAMPLES : points;
        builder->outline_length[i] = length / builder->size;
        sample_outline(builder, &outlines[i], &builder->outline[builder->outline_first[i]], points);
        builder->outline_first[i + 1] = builder->outline_first[i] + points;
    }
    builder->resume = builder->search_resume = builder->units_charged = 0;
    builder->outline_index = 0;
    return CAIRN_OK;
}

/* ---- Step ---- */

/* Cost in units of the gain of a pair of samples of the current outline. */
static int32_t gain_cost(const cairn_shape_model_builder *builder)
{
    return builder->low == builder->high ? 1 : 4 + shape_model_points(builder) / SAMPLES_PER_UNIT;
}

/* Cost in units of making the path that was found: of its pairs, and of a disc for each sample. */
static int32_t path_cost(const cairn_shape_model_builder *builder)
{
    return 1 + builder->path_pair_count / SAMPLES_PER_UNIT + builder->params.path_samples;
}

static void set_gain(cairn_shape_model_builder *builder)
{
    int32_t first = builder->outline_first[builder->outline_index];

    builder->gain[builder->low * shape_model_points(builder) + builder->high] =
        builder->low == builder->high
            ? SHAPE_MODEL_ASYMMETRIC_GAIN
            : cairn_shape_model_gain(builder, first + builder->low, first + builder->high);
}

/* The whole outline is the only waiting arc. Paths of further outlines begin at the first one. */
static void wait_for_whole(cairn_shape_model_builder *builder)
{
    int32_t parent = builder->outline_index > 0 && builder->path_count > 0 ? 0 : -1;
    shape_model_arc whole = {0, shape_model_points(builder), 1, parent, -1};

    builder->arc_count = 0;
    cairn_shape_model_add_arc(builder, whole);
}

/* The model: see Method in the head of this file. */
static int make_model(cairn_shape_model_builder *builder, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(builder->resume);
    for (; builder->outline_index < builder->outline_count; builder->outline_index++) {
        for (builder->low = 0; builder->low < shape_model_points(builder); builder->low++)
            for (builder->high = 0; builder->high < shape_model_points(builder); builder->high++) {
                CAIRN_STEP_CHARGE(builder, resume, budget, gain_cost(builder));
                set_gain(builder);
            }
        wait_for_whole(builder);
        while (builder->arc_count > 0 && builder->path_count < builder->params.max_paths) {
            CAIRN_STEP_RUN(builder, resume, budget, cairn_shape_model_search);
            CAIRN_STEP_CHARGE(builder, resume, budget, path_cost(builder));
            cairn_shape_model_add_path(builder);
        }
    }
    CAIRN_STEP_END(builder->resume);
}

/* 1 when a model is to be built. */
static int is_pending(const cairn_shape_model_builder *builder)
{
    return builder->outline_index < builder->outline_count;
}

cairn_status cairn_shape_model_builder_step(cairn_shape_model_builder *builder,
                                            cairn_budget *budget)
{
    if (builder == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!is_pending(builder))
        return CAIRN_OK;
    if (!make_model(builder, budget))
        return CAIRN_MORE;
    return builder->path_count > 0 ? CAIRN_OK : CAIRN_EMPTY;
}

cairn_shape_model cairn_shape_model_builder_read(const cairn_shape_model_builder *builder)
{
    cairn_shape_model model;

    memset(&model, 0, sizeof model);
    if (builder == NULL || is_pending(builder) || builder->path_count == 0)
        return model;
    model.samples = builder->samples;
    model.paths = builder->paths;
    model.outline = builder->outline;
    model.sample_count = builder->sample_count;
    model.path_count = builder->path_count;
    model.outline_count = builder->outline_first[builder->outline_count];
    model.size = builder->size;
    model.origin = builder->origin;
    return model;
}

/* ---- Validation ---- */

static int is_share(cairn_real x)
{
    return x >= 0 && x <= 1;
}

/* Returns 0 if not finite, too. */
static int is_valid_point(cairn_oriented_point p)
{
    return cairn_vec2_is_finite(p.position) &&
           cairn_abs(cairn_vec2_norm(p.direction) - 1) <= CAIRN_REAL(1e-3);
}

static cairn_status check_sample(const cairn_shape_model_sample *s, int64_t index,
                                 cairn_fault *fault)
{
    if (!cairn_vec2_is_finite(s->centre) || !cairn_is_finite(s->radius) ||
        !cairn_is_finite(s->deviation))
        return cairn_refuse(fault, index, "a sample that is not finite, expected finite ones",
                            CAIRN_NOT_FINITE);
    if (!(s->radius > 0) || s->deviation < 0 || !is_share(s->outline_share[0]) ||
        !is_share(s->outline_share[1]))
        return cairn_refuse(
            fault, index, "a sample out of range, expected a radius above 0 and shares from 0 to 1",
            CAIRN_BAD_ARGUMENT);
    if (!is_valid_point(s->contact[0]) || !is_valid_point(s->contact[1]))
        return cairn_refuse(
            fault, index,
            "a contact point out of range, expected a finite position and a unit direction",
            CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

static cairn_status check_path(const cairn_shape_model *model, int32_t index, cairn_fault *fault)
{
    const cairn_shape_model_path *p = &model->paths[index];

    if (p->first < 0 || p->count < 1 || p->first > model->sample_count ||
        p->count > model->sample_count - p->first)
        return cairn_refuse(fault, index,
                            "a path beyond the samples, expected at least one of them",
                            CAIRN_BAD_ARGUMENT);
    if (p->parent < -1 || p->parent >= index || (p->parent < 0) != (p->branch < 0) ||
        (p->parent >= 0 && p->branch >= model->paths[p->parent].count) ||
        !is_share(p->outline_share))
        return cairn_refuse(
            fault, index, "a path that branches off nowhere, expected a sample of a path before it",
            CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

/* Validates the gaps of a model. */
static int gaps_are_valid(const cairn_shape_model *model)
{
    int32_t good = model->gap_count >= 0 && model->gap_count <= CAIRN_SHAPE_MODEL_MAX_GAPS;

    for (int32_t i = 0; good && i < model->gap_count; i++)
        good = cairn_vec2_is_finite(model->gaps[i]);
    return good;
}

cairn_status cairn_shape_model_check(const cairn_shape_model *m, cairn_fault *fault)
{
    cairn_status status = CAIRN_OK;

    if (m == NULL || m->samples == NULL || m->paths == NULL || m->outline == NULL ||
        m->sample_count < 1 || m->path_count < 1 || m->path_count > CAIRN_SHAPE_MODEL_MAX_PATHS ||
        m->outline_count < 1 || !(m->size > 0) || !cairn_is_finite(m->size) ||
        !cairn_vec2_is_finite(m->origin))
        return cairn_refuse(fault, -1, "no model, expected a size, paths, samples and an outline",
                            CAIRN_BAD_ARGUMENT);
    if (!gaps_are_valid(m))
        return cairn_refuse(fault, -1, "gaps out of range, expected at most 8 finite positions",
                            CAIRN_BAD_ARGUMENT);
    for (int32_t i = 0; i < m->sample_count && status == CAIRN_OK; i++)
        status = check_sample(&m->samples[i], i, fault);
    for (int32_t i = 0; i < m->path_count && status == CAIRN_OK; i++)
        status = check_path(m, i, fault);
    for (int32_t i = 0; i < m->outline_count && status == CAIRN_OK; i++)
        if (!is_valid_point(m->outline[i]))
            status = cairn_refuse(
                fault, i, "an outline out of range, expected finite positions and unit directions",
                CAIRN_BAD_ARGUMENT);
    return status;
}

static void mirror_point(cairn_oriented_point *point)
{
    point->position.x = -point->position.x;
    point->direction.x = -point->direction.x;
}

void cairn_shape_model_mirror(const cairn_shape_model *model, cairn_shape_model_sample *samples,
                              cairn_oriented_point *outline, cairn_shape_model *mirrored)
{
    int32_t count = model->outline_count;

    memmove(samples, model->samples, (size_t)model->sample_count * sizeof *samples);
    memmove(outline, model->outline, (size_t)count * sizeof *outline);
    *mirrored = *model;
    mirrored->samples = samples;
    mirrored->outline = outline;
    for (int32_t i = 0; i < model->sample_count; i++) {
        cairn_shape_model_sample *sample = &samples[i];
        cairn_oriented_point left = sample->contact[0];
        cairn_real share = sample->outline_share[0];

        sample->centre.x = -sample->centre.x;
        sample->contact[0] = sample->contact[1];
        sample->contact[1] = left;
        sample->outline_share[0] = sample->outline_share[1];
        sample->outline_share[1] = share;
        mirror_point(&sample->contact[0]);
        mirror_point(&sample->contact[1]);
    }
    for (int32_t i = 0; i < mirrored->gap_count; i++)
        mirrored->gaps[i].x = -mirrored->gaps[i].x;
    /* The order of the samples is reversed, so that the interior stays on the same side. */
    for (int32_t i = 0; i < count; i++) {
        mirror_point(&outline[i]);
        outline[i].direction = cairn_vec2_scale(outline[i].direction, -1);
    }
    for (int32_t i = 0; i < count / 2; i++) {
        cairn_oriented_point swapped = outline[i];

        outline[i] = outline[count - 1 - i];
        outline[count - 1 - i] = swapped;
    }
}

int32_t cairn_shape_model_first_outline(const cairn_shape_model *model)
{
    cairn_real mean = 0;
    int32_t count = model->outline_count > 0;

    for (int32_t i = 1; i < model->outline_count; i++)
        mean += cairn_vec2_norm(
                    cairn_vec2_sub(model->outline[i].position, model->outline[i - 1].position)) /
                (cairn_real)model->outline_count;
    while (count < model->outline_count &&
           cairn_vec2_norm(cairn_vec2_sub(model->outline[count].position,
                                          model->outline[count - 1].position)) <=
               MAX_STEP_RATIO * mean)
        count++;
    return count;
}
