/* Shape quality of a deformed outline, independent of its surroundings; and the refinement of a
 * candidate, of which it is the last part.
 *
 * Method: evidence is relative to the background, and the deformation cost adds up over single
 * steps. In clutter both accept distorted shapes. So three means over the outline's samples are
 * computed.
 * 1. Edge proximity: how near an edge of the sample's direction is, on a finer scale than that of
 *    the deformation.
 * 2. Tangent deviation: the rotation of the outline's tangents against the model outline.
 * 3. Deformation: the residual of the least-squares affine transform from the model outline. It is
 *    large for a part displaced against the others, or a new bend.
 *
 * Source: this project's. */
#include "src/base/build.h"

#include "src/base/step.h"
#include "src/detection/contour_search_fit.h"

/* Standard deviations: distance, in object sizes, and sine of the angle; edges beyond these
 * multiples are ignored. */
static const cairn_real DISTANCE_SIGMA = CAIRN_REAL(0.012), SINE_SIGMA = CAIRN_REAL(0.35);
enum { MAX_DISTANCE_SIGMAS = 4, MAX_SINE_SIGMAS = 2 };
/* Span of the central difference for the outline's direction, samples. */
enum { TANGENT_SPAN = 2 };

enum { LINES_PER_UNIT = 8, PAIRS_PER_UNIT = 4, UNITS_PER_SAMPLE = 2 };

/* Half the squared distance in sigmas of an edge from a sample; CAIRN_REAL_MAX beyond the
 * limits. */
static cairn_real cost_of(cairn_segment line, cairn_oriented_point point, cairn_real size)
{
    cairn_vec2 along = cairn_vec2_unit(cairn_vec2_sub(line.b, line.a));
    cairn_real distance =
        cairn_contour_search_point_distance(line, point.position) / (DISTANCE_SIGMA * size);
    cairn_real sine = cairn_vec2_cross(along, point.direction) / SINE_SIGMA;

    return distance <= MAX_DISTANCE_SIGMAS && cairn_abs(sine) <= MAX_SINE_SIGMAS
               ? (distance * distance + sine * sine) / 2
               : CAIRN_REAL_MAX;
}

/* Lists the lines near the box of an outline; returns their number. */
static int32_t list_candidates(const cairn_contour_search_tokens *tokens,
                               const contour_search_fitted_outline *fitted, int32_t *list)
{
    cairn_real reach = MAX_DISTANCE_SIGMAS * DISTANCE_SIGMA * fitted->size;
    cairn_box box = cairn_box_empty();
    int32_t count = 0;

    for (int32_t i = 0; i < fitted->outline_count; i++)
        box = cairn_box_extend(box, fitted->outline[i].position);
    for (int32_t i = 0; i < tokens->count; i++) {
        cairn_segment l = tokens->lines[i];

        if (cairn_max(l.a.x, l.b.x) >= box.min.x - reach &&
            cairn_min(l.a.x, l.b.x) <= box.max.x + reach &&
            cairn_max(l.a.y, l.b.y) >= box.min.y - reach &&
            cairn_min(l.a.y, l.b.y) <= box.max.y + reach)
            list[count++] = i;
    }
    return count;
}

/* Edge proximity of a sample: that of the best of the listed lines. */
static cairn_real sample_proximity(const contour_search_measure *measure, int32_t sample)
{
    const contour_search_fitted_outline *fitted = &measure->fitted;
    cairn_real smallest = CAIRN_REAL_MAX;

    for (int32_t k = 0; k < measure->count; k++)
        smallest = cairn_min(smallest, cost_of(measure->tokens->lines[measure->list[k]],
                                               fitted->outline[sample], fitted->size));
    return smallest < CAIRN_REAL_MAX ? cairn_exp(-smallest) : 0;
}

/* One past the last sample of the outline that begins at first. */
static int32_t end_of_outline(const int32_t *outline_index, int32_t first, int32_t count)
{
    int32_t end = first + 1;

    while (end < count && outline_index[end] == outline_index[first])
        end++;
    return end;
}

/* Mean of 1 - cos of the angle between the tangents of the rotated model outline and those of the
 * deformed one. */
static cairn_real tangent_deviation(const contour_search_fitted_outline *fitted,
                                    const int32_t *outline_index,
                                    const contour_search_reference *reference)
{
    const cairn_oriented_point *d = reference->outline;
    cairn_real sum = 0;

    for (int32_t first = 0, end; first < fitted->outline_count; first = end) {
        int32_t length;

        end = end_of_outline(outline_index, first, fitted->outline_count);
        length = end - first;
        for (int32_t i = 0; i < length; i++) {
            int32_t from = first + (i + TANGENT_SPAN * (length - 1)) % length,
                    to = first + (i + TANGENT_SPAN) % length;
            cairn_vec2 reference_chord = cairn_vec2_sub(d[to].position, d[from].position),
                       fitted_chord = cairn_vec2_sub(fitted->outline[to].position,
                                                     fitted->outline[from].position),
                       rotated;

            rotated.x = reference->rotation.x * reference_chord.x -
                        reference->rotation.y * reference_chord.y;
            rotated.y = reference->rotation.y * reference_chord.x +
                        reference->rotation.x * reference_chord.y;
            sum += 1 - cairn_vec2_dot(cairn_vec2_unit(rotated), cairn_vec2_unit(fitted_chord));
        }
    }
    /* 1 - cosine may round to less than 0. */
    return cairn_max(0, sum) / (cairn_real)fitted->outline_count;
}

/* Root mean square residual of the affine transform, relative to the mapped area's side. */
static cairn_real deformation_of(const contour_search_fitted_outline *fitted,
                                 const cairn_oriented_point *reference)
{
    contour_search_affine_sums sums = {cairn_sym3_zero(), {{0}}};
    cairn_real map[2][3], sum = 0, area;

    for (int32_t i = 0; i < fitted->outline_count; i++)
        cairn_contour_search_affine_add(
            &sums, reference[i].position, 1,
            cairn_vec2_sub(fitted->outline[i].position, fitted->origin));
    if (!cairn_contour_search_affine_solve(&sums, map))
        return 1;
    for (int32_t i = 0; i < fitted->outline_count; i++) {
        cairn_vec2 offset = cairn_vec2_sub(fitted->outline[i].position, fitted->origin);

        sum += cairn_vec2_norm_squared(
            cairn_vec2_sub(offset, contour_search_affine_point(map, reference[i].position)));
    }
    area = cairn_abs(map[0][0] * map[1][1] - map[0][1] * map[1][0]);
    return area > 0 ? cairn_min(1, cairn_sqrt(sum / ((cairn_real)fitted->outline_count * area)))
                    : 1;
}

void cairn_contour_search_measure_take(contour_search_measure *measure, cairn_pool *pool,
                                       int32_t max_lines, int32_t max_outline)
{
    CAIRN_TAKE(measure, pool, list, max_lines);
    CAIRN_TAKE(measure, pool, proximity, max_outline);
}

void cairn_contour_search_measure_begin(contour_search_measure *measure,
                                        const cairn_contour_search_tokens *tokens,
                                        const contour_search_fitted_outline *fitted,
                                        const int32_t *outline_index,
                                        const contour_search_reference *reference)
{
    measure->tokens = tokens;
    measure->fitted = *fitted;
    measure->outline_index = outline_index;
    measure->reference = *reference;
    measure->resume = measure->units_charged = 0;
}

/* See Method in the head of this file. */
int cairn_contour_search_measure_step(contour_search_measure *measure, cairn_budget *budget)
{
    const contour_search_fitted_outline *fitted = &measure->fitted;
    cairn_contour_search_shape *shape = &measure->shape;

    CAIRN_STEP_BEGIN(measure->resume);
    CAIRN_STEP_CHARGE(measure, resume, budget,
                      1 + (measure->tokens->count + fitted->outline_count) / LINES_PER_UNIT);
    measure->count = list_candidates(measure->tokens, fitted, measure->list);
    measure->sum = 0;
    for (measure->cursor = 0; measure->cursor < fitted->outline_count; measure->cursor++) {
        CAIRN_STEP_CHARGE(measure, resume, budget, 1 + measure->count / PAIRS_PER_UNIT);
        measure->proximity[measure->cursor] = sample_proximity(measure, measure->cursor);
        measure->sum += measure->proximity[measure->cursor];
    }
    shape->edge_proximity = measure->sum / (cairn_real)fitted->outline_count;
    CAIRN_STEP_CHARGE(measure, resume, budget, 1 + UNITS_PER_SAMPLE * fitted->outline_count);
    shape->tangent_deviation =
        tangent_deviation(fitted, measure->outline_index, &measure->reference);
    shape->deformation = deformation_of(fitted, measure->reference.outline);
    CAIRN_STEP_END(measure->resume);
}

/* ---- The refinement ---- */

void cairn_contour_search_refinement_take(contour_search_refinement *refinement, cairn_pool *pool,
                                          int32_t max_lines, int32_t max_outline)
{
    int has_object = refinement != NULL;

    cairn_contour_search_field_take(has_object ? &refinement->field : NULL, pool);
    cairn_contour_search_fit_take(has_object ? &refinement->fit : NULL, pool, max_outline);
    cairn_contour_search_collector_take(has_object ? &refinement->collector : NULL, pool,
                                        max_lines);
    cairn_contour_search_measure_take(has_object ? &refinement->measure : NULL, pool, max_lines,
                                      max_outline);
}

void cairn_contour_search_refinement_begin(contour_search_refinement *refinement,
                                           const cairn_contour_search_tokens *tokens,
                                           const cairn_shape_model *model,
                                           const cairn_contour_grouping_object *object)
{
    refinement->fit.model = model;
    refinement->fit.object = *object;
    refinement->resume = 0;
    cairn_contour_search_field_begin(&refinement->field, tokens, object->origin, object->size);
}

int cairn_contour_search_refinement_step(contour_search_refinement *refinement,
                                         cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(refinement->resume);
    CAIRN_STEP_UNTIL(refinement->resume,
                     cairn_contour_search_field_step(&refinement->field, budget));
    cairn_contour_search_fit_begin(&refinement->fit, &refinement->field, refinement->fit.model,
                                   &refinement->fit.object);
    CAIRN_STEP_UNTIL(refinement->resume, cairn_contour_search_fit_step(&refinement->fit, budget));
    CAIRN_STEP_END(refinement->resume);
}
