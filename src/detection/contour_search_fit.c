/* Deformation of a model's outline to image edges (deformable template matching by dynamic
 * programming).
 *
 * Method: members of a class differ in proportions by more than a similarity transform can follow.
 * 1. Every sample of the outline may be shifted by a vector of a grid (label). A sample's score is
 *    the log-likelihood ratio of the edges there, object against the background of the window.
 *    Different shifts of neighbours cost in proportion to the difference.
 * 2. Dynamic programming finds the best shifts of a whole outline. An outline is closed: it is
 *    traversed twice, and the middle of both rounds is read.
 * 3. The first round is coarse. The least-squares affine transform of its result is the next base.
 * 4. Later rounds start from the smoothed deformed outline, on finer grids.
 *
 * Limits: a part farther from its predicted position than the widest grid is not found. The
 * outlines of one model are deformed independently. The translation along an edge is not observable
 * (aperture problem): hidden sides of which no visible one is the counterpart may be a tenth of the
 * size off.
 *
 * Source: this project's, for the deformations that the displacements of Adluru 2008 (2.9) allow
 * along a skeleton. */
#include "src/base/build.h"

#include <string.h>

#include "src/base/step.h"
#include "src/detection/contour_search_fit.h"

/* Cost (nats) of a relative shift of neighbouring samples, per object size. */
static const cairn_real STRETCH_COST = 30;
/* Standard deviation of the logarithm of an affine transform's anisotropy. */
static const cairn_real ASPECT_SIGMA = CAIRN_REAL(0.25);
/* Weight of the previous base in the affine fit, relative to a sample with an edge. */
static const cairn_real PRIOR_WEIGHT = CAIRN_REAL(0.15);
/* Span of the central difference for the outline's direction, samples. */
enum { TANGENT_SPAN = 2 };
/* Neighbours farther apart than this many spacings belong to different outlines. */
enum { MAX_SPACING_RATIO = 3 };

enum {
    MAX_GRID_RADIUS = 8,
    MAX_GRID_WIDTH = 2 * MAX_GRID_RADIUS + 1,
    MAX_LABELS = MAX_GRID_WIDTH * MAX_GRID_WIDTH,
    ROUND_COUNT = 4
};
enum { MAX_PADDED_LABELS = (MAX_GRID_WIDTH + 2) * (MAX_GRID_WIDTH + 2) };

/* Grids of the rounds: radius in steps, and step as a share of the size. */
static const struct {
    int32_t reach;
    cairn_real step;
} rounds[ROUND_COUNT] = {
    {8, CAIRN_REAL(0.02)}, {7, CAIRN_REAL(0.015)}, {6, CAIRN_REAL(0.008)}, {5, CAIRN_REAL(0.004)}};

/* Labels of a sample that a unit propagates, scores or adds; units of a converted cell. */
enum { LABELS_PER_UNIT = 4, UNITS_PER_CONVERSION = 2 };
/* Units of each sample that is placed, smoothed, scored. */
enum { UNITS_PER_SAMPLE = 3 };
/* No cell of the field. */
#define NO_CELL UINT32_MAX

void cairn_contour_search_fit_take(contour_search_fit *fit, cairn_pool *pool, int32_t max_outline)
{
    size_t count = (size_t)max_outline;

    CAIRN_TAKE(fit, pool, outline, count);
    CAIRN_TAKE(fit, pool, llr, count);
    CAIRN_TAKE(fit, pool, outline_index, count);
    CAIRN_TAKE(fit, pool, base, count);
    CAIRN_TAKE(fit, pool, path_value, (2 * count + 1) * MAX_LABELS);
    CAIRN_TAKE(fit, pool, sample_llr, count * MAX_LABELS);
}

/* Log-likelihood ratio of a cell's edge proximity in a direction, object against background. */
static cairn_real llr_of(const contour_search_field *field, cairn_real proximity, int32_t bin)
{
    return cairn_log(CONTOUR_SEARCH_OCCLUSION_PROBABILITY +
                     (1 - CONTOUR_SEARCH_OCCLUSION_PROBABILITY) * proximity /
                         field->background[bin]);
}

static int32_t cell_at(cairn_real from_corner, cairn_real cell)
{
    return cairn_real_to_int(cairn_floor(from_corner / cell));
}

/* Index of a cell of the field in a direction; NO_CELL: outside of the window. */
static inline uint32_t cell_of(int32_t x, int32_t y, int32_t bin)
{
    if (x < 0 || y < 0 || x >= CONTOUR_SEARCH_FIELD_SIDE || y >= CONTOUR_SEARCH_FIELD_SIDE)
        return NO_CELL;
    return ((uint32_t)bin * CONTOUR_SEARCH_FIELD_SIDE + (uint32_t)y) * CONTOUR_SEARCH_FIELD_SIDE +
           (uint32_t)x;
}

/* 1 when a cell holds its log-likelihood ratio. */
static inline int is_converted(const contour_search_field *field, uint32_t cell)
{
    return (field->is_llr[cell / 32] >> cell % 32 & 1) != 0;
}

/* 1 when a cell holds an edge proximity that is to be converted. */
static inline int is_unconverted(const contour_search_fit *fit, uint32_t cell)
{
    return cell != NO_CELL && !is_converted(fit->field, cell) &&
           fit->field->value[cell] > fit->no_edge_proximity;
}

/* Replaces the proximity of a cell by the log-likelihood ratio, because neighbouring samples and
 * later rounds use the same cells. */
static void convert_cell(contour_search_field *field, uint32_t cell, int32_t bin)
{
    field->value[cell] = llr_of(field, field->value[cell], bin);
    field->is_llr[cell / 32] |= UINT32_C(1) << cell % 32;
}

/* Log-likelihood ratio of a cell that needs no conversion. */
static inline cairn_real llr_in_cell(const contour_search_fit *fit, uint32_t cell, int32_t bin)
{
    return cell != NO_CELL && is_converted(fit->field, cell) ? fit->field->value[cell]
                                                             : fit->no_edge_llr[bin];
}

static cairn_real llr_at(contour_search_fit *fit, cairn_vec2 at, int32_t bin)
{
    contour_search_field *field = fit->field;
    uint32_t cell = cell_of(cell_at(at.x - field->corner.x, field->cell_size),
                            cell_at(at.y - field->corner.y, field->cell_size), bin);

    if (is_unconverted(fit, cell))
        convert_cell(field, cell, bin);
    return llr_in_cell(fit, cell, bin);
}

static cairn_vec2 shift_of(const contour_search_fit *fit, int32_t label)
{
    int32_t column = label % fit->grid_width - fit->grid_radius,
            row = label / fit->grid_width - fit->grid_radius;
    cairn_vec2 shift = {fit->step * (cairn_real)column, fit->step * (cairn_real)row};

    return shift;
}

/* ---- One outline ---- */

/* Cost of a move between the labels of neighbouring samples: along the grid, or diagonal. */
static cairn_real move_cost(const contour_search_fit *fit, int32_t move)
{
    return (move == 4       ? 0
            : move % 2 == 0 ? CAIRN_REAL(1.4142)
                            : 1) *
           (STRETCH_COST * fit->step / fit->size);
}

/* Dynamic programming step: the best path score of each label of a sample from those of the
 * previous sample. A border of minimum values surrounds the labels; the horizontal moves, which
 * cost the same, are maximized first. */
static void propagate_values(const contour_search_fit *fit, const cairn_real *previous,
                             cairn_real *current)
{
    cairn_real straight_cost = move_cost(fit, 1), diagonal_cost = move_cost(fit, 0),
               padded[MAX_PADDED_LABELS] = {0}, horizontal_best[MAX_PADDED_LABELS] = {0};
    int32_t row = fit->grid_width + 2;

    for (int32_t i = 0; i < row * row; i++)
        padded[i] = -CAIRN_REAL_MAX;
    for (int32_t y = 0; y < fit->grid_width; y++)
        memcpy(&padded[(y + 1) * row + 1], &previous[y * fit->grid_width],
               (size_t)fit->grid_width * sizeof *previous);
    for (int32_t i = 1; i < row * row - 1; i++)
        horizontal_best[i] = cairn_max(padded[i - 1], padded[i + 1]);
    for (int32_t y = 0; y < fit->grid_width; y++) {
        const cairn_real *here = &padded[(y + 1) * row + 1],
                         *along = &horizontal_best[(y + 1) * row + 1];

        for (int32_t x = 0; x < fit->grid_width; x++) {
            cairn_real straight = cairn_max(along[x], cairn_max(here[x - row], here[x + row]));
            cairn_real diagonal = cairn_max(along[x - row], along[x + row]);

            current[y * fit->grid_width + x] =
                cairn_max(here[x], cairn_max(straight - straight_cost, diagonal - diagonal_cost));
        }
    }
}

/* The best move to a label from the path scores of the previous sample: (dy + 1) * 3 + dx + 1. */
static int32_t best_move(const contour_search_fit *fit, const cairn_real *previous, int32_t label)
{
    int32_t x = label % fit->grid_width, y = label / fit->grid_width, best = 4;
    cairn_real best_value = previous[label];

    for (int32_t k = 0; k < 9; k++) {
        int32_t u = x + k % 3 - 1, v = y + k / 3 - 1;
        cairn_real value;

        if (k == 4 || u < 0 || v < 0 || u >= fit->grid_width || v >= fit->grid_width)
            continue;
        value = previous[v * fit->grid_width + u] - move_cost(fit, k);
        if (value > best_value) {
            best_value = value;
            best = k;
        }
    }
    return best;
}

/* Scores of the sample of a place, at each label. */
static cairn_real *sample_llr_at(const contour_search_fit *fit, int32_t place)
{
    int32_t sample = place % (fit->end - fit->first);

    return &fit->sample_llr[(size_t)sample * (size_t)fit->label_count];
}

/* Scores a sample at each label, from grid_row of the grid on; the cells of the grid's columns are
 * computed once a call. 0: the budget is used up. */
static int score_sample(contour_search_fit *fit, cairn_budget *budget)
{
    const contour_search_field *field = fit->field;
    int32_t sample = fit->first + fit->place,
            bin = cairn_contour_search_field_bin(fit->outline[sample].direction),
            width = fit->grid_width, column[MAX_GRID_WIDTH];

    for (int32_t i = 0; i < width; i++)
        column[i] = cell_at(fit->base[sample].x + fit->step * (cairn_real)(i - fit->grid_radius) -
                                field->corner.x,
                            field->cell_size);
    for (; fit->grid_row < width; fit->grid_row++) {
        cairn_real *llr = sample_llr_at(fit, fit->place) + fit->grid_row * width;
        int32_t row = cell_at(fit->base[sample].y +
                                  fit->step * (cairn_real)(fit->grid_row - fit->grid_radius) -
                                  field->corner.y,
                              field->cell_size);

        for (int32_t x = 0; x < width; x++) {
            uint32_t cell = cell_of(column[x], row, bin);

            if (is_unconverted(fit, cell)) {
                if (!cairn_budget_charge(budget, &fit->units_charged, UNITS_PER_CONVERSION))
                    return 0;
                convert_cell(fit->field, cell, bin);
            }
            llr[x] = fit->spacing / CONTOUR_SEARCH_PIECE_LENGTH * llr_in_cell(fit, cell, bin);
        }
    }
    return 1;
}

/* Forward step of the dynamic programming to a sample, which is scored. */
static void step_forward(contour_search_fit *fit)
{
    size_t labels = (size_t)fit->label_count;
    cairn_real *current = &fit->path_value[((size_t)fit->place + 1) * labels];
    const cairn_real *sample_llr = sample_llr_at(fit, fit->place);

    propagate_values(fit, current - labels, current);
    for (size_t i = 0; i < labels; i++)
        current[i] += sample_llr[i];
}

/* The best label of the last sample. */
static int32_t best_label(const contour_search_fit *fit)
{
    const cairn_real *last =
        &fit->path_value[2 * (size_t)(fit->end - fit->first) * (size_t)fit->label_count];
    int32_t label = fit->label_count / 2;

    for (int32_t i = 0; i < fit->label_count; i++)
        label = last[i] > last[label] ? i : label;
    return label;
}

/* Backtracking step: in the middle of both rounds the sample takes the label. */
static void step_backward(contour_search_fit *fit)
{
    int32_t count = fit->end - fit->first, k = fit->place, sample = fit->first + k % count;
    int32_t move =
        best_move(fit, &fit->path_value[(size_t)k * (size_t)fit->label_count], fit->label);

    if (k < count / 2 + count) {
        fit->outline[sample].position =
            cairn_vec2_add(fit->base[sample], shift_of(fit, fit->label));
        fit->deformation_cost += move_cost(fit, move);
    }
    fit->label += move % 3 - 1 + fit->grid_width * (move / 3 - 1);
}

/* Deforms one outline by dynamic programming and backtracking. */
static int deform_outline(contour_search_fit *fit, cairn_budget *budget)
{
    int32_t count = fit->end - fit->first;

    CAIRN_STEP_BEGIN(fit->outline_resume);
    memset(fit->path_value, 0, (size_t)fit->label_count * sizeof *fit->path_value);
    for (fit->place = 0; fit->place < 2 * count; fit->place++) {
        CAIRN_STEP_CHARGE(fit, outline_resume, budget, 1 + fit->label_count / LABELS_PER_UNIT);
        if (fit->place < count) {
            fit->grid_row = 0;
            CAIRN_STEP_RUN(fit, outline_resume, budget, score_sample);
        }
        step_forward(fit);
    }
    fit->label = best_label(fit);
    for (fit->place = 2 * count - 1; fit->place >= count / 2; fit->place--) {
        CAIRN_STEP_CHARGE_UNIT(fit, outline_resume, budget);
        step_backward(fit);
    }
    CAIRN_STEP_END(fit->outline_resume);
}

/* One past the last sample of the outline that begins at first. */
static int32_t end_of_outline(const contour_search_fit *fit, int32_t first)
{
    const cairn_oriented_point *outline = fit->model->outline;
    int32_t end = first + 1;

    while (end < fit->model->outline_count &&
           cairn_vec2_norm(cairn_vec2_sub(outline[end].position, outline[end - 1].position)) <
               MAX_SPACING_RATIO * fit->spacing)
        end++;
    return end;
}

/* ---- All outlines ---- */

/* Smooths the shifts of an outline, and rotates its directions accordingly. */
static void smooth_outline(contour_search_fit *fit, const cairn_contour_grouping_object *object,
                           int32_t first, int32_t end)
{
    int32_t count = end - first;
    cairn_oriented_point *outline = fit->outline;
    cairn_similarity pose = cairn_similarity_of(object->origin, object->size, object->turn);

    for (int32_t i = 0; i < count; i++) {
        int32_t previous = first + (i + count - 1) % count, at = first + i,
                after = first + (i + 1) % count;
        cairn_vec2 sum =
            cairn_vec2_add(cairn_vec2_sub(outline[previous].position, fit->base[previous]),
                           cairn_vec2_sub(outline[after].position, fit->base[after]));

        sum = cairn_vec2_add(
            sum, cairn_vec2_scale(cairn_vec2_sub(outline[at].position, fit->base[at]), 2));
        fit->base[at] = cairn_vec2_add(fit->base[at], cairn_vec2_scale(sum, CAIRN_REAL(0.25)));
    }
    for (int32_t i = 0; i < count; i++) {
        int32_t previous = first + (i + count - TANGENT_SPAN) % count,
                after = first + (i + TANGENT_SPAN) % count;
        cairn_vec2 reference_direction = cairn_vec2_unit(cairn_similarity_vector(
                       pose, cairn_vec2_sub(fit->model->outline[after].position,
                                            fit->model->outline[previous].position))),
                   fitted_direction =
                       cairn_vec2_unit(cairn_vec2_sub(fit->base[after], fit->base[previous])),
                   d = cairn_vec2_unit(
                       cairn_similarity_vector(pose, fit->model->outline[first + i].direction));
        cairn_real cosine = cairn_vec2_dot(reference_direction, fitted_direction),
                   sine = cairn_vec2_cross(reference_direction, fitted_direction);

        outline[first + i].direction.x = cosine * d.x - sine * d.y;
        outline[first + i].direction.y = sine * d.x + cosine * d.y;
    }
}

/* Sets the grid of the round. */
static void begin_round(contour_search_fit *fit)
{
    fit->grid_radius = rounds[fit->round].reach;
    fit->grid_width = 2 * fit->grid_radius + 1;
    fit->label_count = fit->grid_width * fit->grid_width;
    fit->step = rounds[fit->round].step * fit->size;
}

/* Sets the outline index of every sample. */
static void number_outlines(contour_search_fit *fit)
{
    int32_t index = 0;

    for (int32_t first = 0, end; first < fit->model->outline_count; first = end, index++) {
        end = end_of_outline(fit, first);
        for (int32_t i = first; i < end; i++)
            fit->outline_index[i] = index;
    }
}

static void smooth_all(contour_search_fit *fit, const cairn_contour_grouping_object *object)
{
    for (int32_t first = 0, end; first < fit->model->outline_count; first = end) {
        end = end_of_outline(fit, first);
        smooth_outline(fit, object, first, end);
    }
}

static void score_samples(contour_search_fit *fit)
{
    for (int32_t i = 0; i < fit->model->outline_count; i++)
        fit->llr[i] = llr_at(fit, fit->outline[i].position,
                             cairn_contour_search_field_bin(fit->outline[i].direction));
}

/* Cost of an affine transform's anisotropy. */
static cairn_real aspect_cost(cairn_real map[2][3])
{
    cairn_vec2 rotation = {map[0][0] + map[1][1], map[1][0] - map[0][1]},
               reflection = {map[0][0] - map[1][1], map[1][0] + map[0][1]};
    cairn_real rotation_part = cairn_vec2_norm(rotation),
               reflection_part = cairn_vec2_norm(reflection);
    cairn_real aspect =
        cairn_log((rotation_part + reflection_part) /
                  cairn_max(CAIRN_REAL(1e-6), cairn_abs(rotation_part - reflection_part))) /
        ASPECT_SIGMA;

    return aspect * aspect / 2;
}

/* Fits an affine transform from the model to the outline (weighted least squares) as the next base;
 * returns the cost of its anisotropy. */
static cairn_real fit_affine_map(contour_search_fit *fit)
{
    const cairn_shape_model *model = fit->model;
    contour_search_affine_sums sums = {cairn_sym3_zero(), {{0}}};
    cairn_real map[2][3];

    score_samples(fit);
    for (int32_t i = 0; i < model->outline_count; i++) {
        cairn_real weight = fit->llr[i] > 0 ? 1 : 0;

        cairn_contour_search_affine_add(
            &sums, model->outline[i].position, weight + PRIOR_WEIGHT,
            cairn_vec2_add(cairn_vec2_scale(fit->outline[i].position, weight),
                           cairn_vec2_scale(fit->base[i], PRIOR_WEIGHT)));
    }
    if (!cairn_contour_search_affine_solve(&sums, map))
        return 0;
    for (int32_t i = 0; i < model->outline_count; i++) {
        fit->base[i] = contour_search_affine_point(map, model->outline[i].position);
        fit->outline[i].position = fit->base[i];
    }
    return aspect_cost(map);
}

/* Sets the object's pose to the least-squares similarity transform from the model to the deformed
 * outline. */
static void fit_similarity(const contour_search_fit *fit, cairn_contour_grouping_object *object)
{
    const cairn_shape_model *model = fit->model;
    cairn_real count = (cairn_real)model->outline_count, squared_norms = 0, dot = 0, cross = 0;
    cairn_vec2 model_mean = {0, 0}, image_mean = {0, 0};

    for (int32_t i = 0; i < model->outline_count; i++) {
        model_mean =
            cairn_vec2_add(model_mean, cairn_vec2_scale(model->outline[i].position, 1 / count));
        image_mean =
            cairn_vec2_add(image_mean, cairn_vec2_scale(fit->outline[i].position, 1 / count));
    }
    for (int32_t i = 0; i < model->outline_count; i++) {
        cairn_vec2 p = cairn_vec2_sub(model->outline[i].position, model_mean),
                   q = cairn_vec2_sub(fit->outline[i].position, image_mean);

        squared_norms += cairn_vec2_norm_squared(p);
        dot += cairn_vec2_dot(p, q);
        cross += cairn_vec2_cross(p, q);
    }
    if (!(squared_norms > 0) || !(dot * dot + cross * cross > 0))
        return;
    object->size = cairn_sqrt(dot * dot + cross * cross) / squared_norms;
    object->turn = cairn_atan2(cross, dot);
    object->origin = cairn_vec2_sub(
        image_mean, cairn_similarity_vector(
                        cairn_similarity_of(image_mean, object->size, object->turn), model_mean));
}

/* Mean distance of neighbouring samples, without the steps between outlines. */
static cairn_real spacing_of(const cairn_shape_model *model)
{
    cairn_real max_spacing = CAIRN_REAL_MAX, mean = 0;

    for (int32_t pass = 0; pass < 2; pass++) {
        cairn_real sum = 0, count = 0;

        for (int32_t i = 1; i < model->outline_count; i++) {
            cairn_real distance = cairn_vec2_norm(
                cairn_vec2_sub(model->outline[i].position, model->outline[i - 1].position));

            sum += distance < max_spacing ? distance : 0;
            count += distance < max_spacing;
        }
        mean = sum / cairn_max(count, 1);
        max_spacing = MAX_SPACING_RATIO * mean;
    }
    return mean;
}

/* Initializes the outline at the object's pose. */
static void place_outline(contour_search_fit *fit, const cairn_contour_grouping_object *object)
{
    cairn_similarity pose = cairn_similarity_of(object->origin, object->size, object->turn);

    fit->spacing = spacing_of(fit->model);
    number_outlines(fit);
    for (int32_t i = 0; i < fit->model->outline_count; i++) {
        fit->base[i] = cairn_vec2_add(
            object->origin, cairn_similarity_vector(pose, fit->model->outline[i].position));
        fit->outline[i].position = fit->base[i];
        fit->outline[i].direction =
            cairn_vec2_unit(cairn_similarity_vector(pose, fit->model->outline[i].direction));
    }
}

/* Scores the outline after the last round, and fits the pose. */
static void finish(contour_search_fit *fit)
{
    score_samples(fit);
    fit->evidence = -fit->deformation_cost - fit->aspect_cost;
    for (int32_t i = 0; i < fit->model->outline_count; i++)
        fit->evidence += fit->llr[i] * fit->spacing / CONTOUR_SEARCH_PIECE_LENGTH;
    fit->length = fit->spacing * (cairn_real)fit->model->outline_count;
    fit_similarity(fit, &fit->object);
}

void cairn_contour_search_fit_begin(contour_search_fit *fit, contour_search_field *field,
                                    const cairn_shape_model *model,
                                    const cairn_contour_grouping_object *object)
{
    fit->field = field;
    fit->model = model;
    fit->object = *object;
    fit->size = object->size;
    fit->deformation_cost = fit->aspect_cost = 0;
    fit->no_edge_proximity = cairn_exp(-CONTOUR_SEARCH_FIELD_MAX_COST);
    for (int32_t bin = 0; bin < CONTOUR_SEARCH_FIELD_BINS; bin++)
        fit->no_edge_llr[bin] = llr_of(field, fit->no_edge_proximity, bin);
    fit->resume = fit->outline_resume = fit->units_charged = 0;
}

/* After a round: the next base. */
static void end_round(contour_search_fit *fit)
{
    if (fit->round == 0)
        fit->aspect_cost = fit_affine_map(fit);
    smooth_all(fit, &fit->object);
    if (fit->round == 0)
        fit->deformation_cost = 0;
}

/* See Method in the head of this file. */
int cairn_contour_search_fit_step(contour_search_fit *fit, cairn_budget *budget)
{
    int32_t units_of_all = 1 + UNITS_PER_SAMPLE * fit->model->outline_count;

    CAIRN_STEP_BEGIN(fit->resume);
    CAIRN_STEP_CHARGE(fit, resume, budget, units_of_all);
    place_outline(fit, &fit->object);
    for (fit->round = 0; fit->round < ROUND_COUNT; fit->round++) {
        begin_round(fit);
        for (fit->first = 0; fit->first < fit->model->outline_count; fit->first = fit->end) {
            fit->end = end_of_outline(fit, fit->first);
            CAIRN_STEP_RUN(fit, resume, budget, deform_outline);
        }
        CAIRN_STEP_CHARGE(fit, resume, budget, units_of_all);
        end_round(fit);
    }
    CAIRN_STEP_CHARGE(fit, resume, budget, units_of_all);
    finish(fit);
    CAIRN_STEP_END(fit->resume);
}
