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
 * outlines of one model are deformed independently.
 *
 * Source: this project's, for the deformations that the displacements of Adluru 2008 (2.9) allow
 * along a skeleton. */
#include "src/base/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/small_matrix.h"
#include "src/host/detection/contour_search_fit.h"

/* Share of the size: pieces of the outline of this length are treated as independent. */
#define PIECE_LENGTH 0.08
/* Probability that a piece of the contour has no edge: 1 - detection probability. */
#define OCCLUSION_PROBABILITY 0.25
/* Cost (nats) of a relative shift of neighbouring samples, per object size. */
#define STRETCH_COST 30.0
/* Standard deviation of the logarithm of an affine transform's anisotropy. */
#define ASPECT_SIGMA 0.25
/* Weight of the previous base in the affine fit, relative to a sample with an edge. */
#define PRIOR_WEIGHT 0.15
/* Span of the central difference for the outline's direction, samples. */
#define TANGENT_SPAN 2
/* Neighbours farther apart than this many spacings belong to different outlines. */
#define MAX_SPACING_RATIO 3

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
    double step;
} rounds[ROUND_COUNT] = {{8, 0.02}, {7, 0.015}, {6, 0.008}, {5, 0.004}};

typedef struct outline_deformer {
    const contour_search_field *field;
    const cairn_shape_model *model;
    contour_search_fit *fit;
    /* [outline_count] px, base positions that shifts are relative to */
    cairn_vec2 *base;
    /* [(2 * outline_count + 1) * MAX_LABELS] score of the best path to each label */
    cairn_real *path_value;
    /* [outline_count * MAX_LABELS] score of each sample at each label */
    cairn_real *sample_llr;
    /* log-likelihood ratio where no edge is in reach, per direction */
    cairn_real no_edge_llr[CONTOUR_SEARCH_FIELD_BINS];
    /* size: px, of the object; spacing: of the samples, share of the size */
    cairn_real size, spacing;
    /* total cost of relative shifts */
    cairn_real deformation_cost;
    /* grid of the current round */
    int32_t grid_radius, grid_width, label_count;
    /* px, grid step */
    cairn_real step;
} outline_deformer;

int cairn_contour_search_fit_new(contour_search_fit *fit, int32_t outline_count)
{
    fit->outline = malloc((size_t)outline_count * sizeof *fit->outline);
    fit->llr = malloc((size_t)outline_count * sizeof *fit->llr);
    fit->outline_index = malloc((size_t)outline_count * sizeof *fit->outline_index);
    fit->evidence = 0;
    if (fit->outline != NULL && fit->llr != NULL && fit->outline_index != NULL)
        return 1;
    cairn_contour_search_fit_free(fit);
    return 0;
}

void cairn_contour_search_fit_free(contour_search_fit *fit)
{
    free(fit->outline);
    free(fit->llr);
    free(fit->outline_index);
    memset(fit, 0, sizeof *fit);
}

/* Log-likelihood ratio of a cell's cost in a direction, object against background. */
static cairn_real llr_of_cost(const contour_search_field *field, cairn_real cost, int32_t bin)
{
    return cairn_log((cairn_real)OCCLUSION_PROBABILITY + (1 - (cairn_real)OCCLUSION_PROBABILITY) *
                                                             cairn_exp(-cost) /
                                                             field->background[bin]);
}

static int32_t cell_at(cairn_real from_corner, cairn_real cell)
{
    return (int32_t)floor((double)(from_corner / cell));
}

/* Log-likelihood ratio of a cell; cached, because neighbouring samples and later rounds use the
 * same cells. */
static cairn_real llr_in_cell(const outline_deformer *deformer, int32_t x, int32_t y, int32_t bin)
{
    const contour_search_field *field = deformer->field;
    size_t cell =
        ((size_t)bin * CONTOUR_SEARCH_FIELD_SIDE + (size_t)y) * CONTOUR_SEARCH_FIELD_SIDE +
        (size_t)x;

    if (x < 0 || y < 0 || x >= CONTOUR_SEARCH_FIELD_SIDE || y >= CONTOUR_SEARCH_FIELD_SIDE ||
        !(field->cost[cell] < CONTOUR_SEARCH_FIELD_MAX_COST))
        return deformer->no_edge_llr[bin];
    if (field->llr[cell] == CAIRN_REAL_MAX)
        field->llr[cell] = llr_of_cost(field, field->cost[cell], bin);
    return field->llr[cell];
}

static cairn_real llr_at(const outline_deformer *deformer, cairn_vec2 at, int32_t bin)
{
    const contour_search_field *field = deformer->field;

    return llr_in_cell(deformer, cell_at(at.x - field->corner.x, field->cell_size),
                       cell_at(at.y - field->corner.y, field->cell_size), bin);
}

static cairn_vec2 shift_of(const outline_deformer *deformer, int32_t label)
{
    int32_t column = label % deformer->grid_width - deformer->grid_radius,
            row = label / deformer->grid_width - deformer->grid_radius;
    cairn_vec2 shift = {deformer->step * (cairn_real)column, deformer->step * (cairn_real)row};

    return shift;
}

/* ---- One outline ---- */

/* Cost of a move between the labels of neighbouring samples: along the grid, or diagonal. */
static cairn_real move_cost(const outline_deformer *deformer, int32_t move)
{
    return (move == 4       ? 0
            : move % 2 == 0 ? CAIRN_REAL(1.4142)
                            : 1) *
           ((cairn_real)STRETCH_COST * deformer->step / deformer->size);
}

/* Dynamic programming step: the best path score of each label of a sample from those of the
 * previous sample. A border of minimum values surrounds the labels; the horizontal moves, which
 * cost the same, are maximized first. */
static void propagate_values(const outline_deformer *deformer, const cairn_real *previous,
                             cairn_real *current)
{
    cairn_real straight_cost = move_cost(deformer, 1), diagonal_cost = move_cost(deformer, 0),
               padded[MAX_PADDED_LABELS] = {0}, horizontal_best[MAX_PADDED_LABELS] = {0};
    int32_t row = deformer->grid_width + 2;

    for (int32_t i = 0; i < row * row; i++)
        padded[i] = -CAIRN_REAL_MAX;
    for (int32_t y = 0; y < deformer->grid_width; y++)
        memcpy(&padded[(y + 1) * row + 1], &previous[y * deformer->grid_width],
               (size_t)deformer->grid_width * sizeof *previous);
    for (int32_t i = 1; i < row * row - 1; i++)
        horizontal_best[i] = cairn_max(padded[i - 1], padded[i + 1]);
    for (int32_t y = 0; y < deformer->grid_width; y++) {
        const cairn_real *here = &padded[(y + 1) * row + 1],
                         *along = &horizontal_best[(y + 1) * row + 1];

        for (int32_t x = 0; x < deformer->grid_width; x++) {
            cairn_real straight = cairn_max(along[x], cairn_max(here[x - row], here[x + row]));
            cairn_real diagonal = cairn_max(along[x - row], along[x + row]);

            current[y * deformer->grid_width + x] =
                cairn_max(here[x], cairn_max(straight - straight_cost, diagonal - diagonal_cost));
        }
    }
}

/* The best move to a label from the path scores of the previous sample: (dy + 1) * 3 + dx + 1. */
static int32_t best_move(const outline_deformer *deformer, const cairn_real *previous,
                         int32_t label)
{
    int32_t x = label % deformer->grid_width, y = label / deformer->grid_width, best = 4;
    cairn_real best_value = previous[label];

    for (int32_t k = 0; k < 9; k++) {
        int32_t u = x + k % 3 - 1, v = y + k / 3 - 1;
        cairn_real value;

        if (k == 4 || u < 0 || v < 0 || u >= deformer->grid_width || v >= deformer->grid_width)
            continue;
        value = previous[v * deformer->grid_width + u] - move_cost(deformer, k);
        if (value > best_value) {
            best_value = value;
            best = k;
        }
    }
    return best;
}

/* Scores a sample at each label; the cells of the grid's columns and rows are computed once. */
static void compute_sample_llr(const outline_deformer *deformer, int32_t sample,
                               cairn_real *sample_llr)
{
    int32_t bin = cairn_contour_search_field_bin(deformer->fit->outline[sample].direction),
            column[MAX_GRID_WIDTH], row[MAX_GRID_WIDTH];

    for (int32_t i = 0; i < deformer->grid_width; i++) {
        cairn_real shift = deformer->step * (cairn_real)(i - deformer->grid_radius);

        column[i] = cell_at(deformer->base[sample].x + shift - deformer->field->corner.x,
                            deformer->field->cell_size);
        row[i] = cell_at(deformer->base[sample].y + shift - deformer->field->corner.y,
                         deformer->field->cell_size);
    }
    for (int32_t y = 0; y < deformer->grid_width; y++)
        for (int32_t x = 0; x < deformer->grid_width; x++)
            *sample_llr++ = deformer->spacing / (cairn_real)PIECE_LENGTH *
                            llr_in_cell(deformer, column[x], row[y], bin);
}

/* Deforms one outline, the samples first ... first + count - 1, by dynamic programming and
 * backtracking. */
static void deform_outline(outline_deformer *deformer, int32_t first, int32_t count)
{
    size_t labels = (size_t)deformer->label_count;
    cairn_real *last = &deformer->path_value[2 * (size_t)count * labels];
    int32_t label = deformer->label_count / 2;

    memset(deformer->path_value, 0, labels * sizeof *deformer->path_value);
    for (int32_t k = 0; k < 2 * count; k++) {
        cairn_real *current = &deformer->path_value[((size_t)k + 1) * labels],
                   *sample_llr = &deformer->sample_llr[(size_t)(k % count) * labels];

        propagate_values(deformer, current - labels, current);
        if (k < count)
            compute_sample_llr(deformer, first + k, sample_llr);
        for (size_t i = 0; i < labels; i++)
            current[i] += sample_llr[i];
    }
    for (int32_t i = 0; i < deformer->label_count; i++)
        label = last[i] > last[label] ? i : label;
    for (int32_t k = 2 * count - 1; k >= count / 2; k--) {
        int32_t move = best_move(deformer, &deformer->path_value[(size_t)k * labels], label),
                sample = first + k % count;

        if (k < count / 2 + count) {
            deformer->fit->outline[sample].position =
                cairn_vec2_add(deformer->base[sample], shift_of(deformer, label));
            deformer->deformation_cost += move_cost(deformer, move);
        }
        label += move % 3 - 1 + deformer->grid_width * (move / 3 - 1);
    }
}

/* One past the last sample of the outline that begins at first. */
static int32_t end_of_outline(const outline_deformer *deformer, int32_t first)
{
    const cairn_oriented_point *outline = deformer->model->outline;
    int32_t end = first + 1;

    while (end < deformer->model->outline_count &&
           cairn_vec2_norm(cairn_vec2_sub(outline[end].position, outline[end - 1].position)) <
               MAX_SPACING_RATIO * deformer->spacing)
        end++;
    return end;
}

/* ---- All outlines ---- */

/* Smooths the shifts of an outline, and rotates its directions accordingly. */
static void smooth_outline(outline_deformer *deformer, const cairn_contour_grouping_object *object,
                           int32_t first, int32_t end)
{
    int32_t count = end - first;
    cairn_oriented_point *outline = deformer->fit->outline;

    for (int32_t i = 0; i < count; i++) {
        int32_t previous = first + (i + count - 1) % count, at = first + i,
                after = first + (i + 1) % count;
        cairn_vec2 sum =
            cairn_vec2_add(cairn_vec2_sub(outline[previous].position, deformer->base[previous]),
                           cairn_vec2_sub(outline[after].position, deformer->base[after]));

        sum = cairn_vec2_add(
            sum, cairn_vec2_scale(cairn_vec2_sub(outline[at].position, deformer->base[at]), 2));
        deformer->base[at] =
            cairn_vec2_add(deformer->base[at], cairn_vec2_scale(sum, CAIRN_REAL(0.25)));
    }
    for (int32_t i = 0; i < count; i++) {
        int32_t previous = first + (i + count - TANGENT_SPAN) % count,
                after = first + (i + TANGENT_SPAN) % count;
        cairn_vec2 reference_direction = cairn_vec2_unit(cairn_contour_search_transform_vector(
                       object, cairn_vec2_sub(deformer->model->outline[after].position,
                                              deformer->model->outline[previous].position))),
                   fitted_direction = cairn_vec2_unit(
                       cairn_vec2_sub(deformer->base[after], deformer->base[previous])),
                   d = cairn_vec2_unit(cairn_contour_search_transform_vector(
                       object, deformer->model->outline[first + i].direction));
        cairn_real cosine = cairn_vec2_dot(reference_direction, fitted_direction),
                   sine = cairn_vec2_cross(reference_direction, fitted_direction);

        outline[first + i].direction.x = cosine * d.x - sine * d.y;
        outline[first + i].direction.y = sine * d.x + cosine * d.y;
    }
}

static void deform_all(outline_deformer *deformer, int32_t round)
{
    deformer->grid_radius = rounds[round].reach;
    deformer->grid_width = 2 * deformer->grid_radius + 1;
    deformer->label_count = deformer->grid_width * deformer->grid_width;
    deformer->step = (cairn_real)rounds[round].step * deformer->size;
    for (int32_t first = 0, end; first < deformer->model->outline_count; first = end) {
        end = end_of_outline(deformer, first);
        deform_outline(deformer, first, end - first);
    }
}

/* Sets the outline index of every sample. */
static void number_outlines(outline_deformer *deformer)
{
    int32_t index = 0;

    for (int32_t first = 0, end; first < deformer->model->outline_count; first = end, index++) {
        end = end_of_outline(deformer, first);
        for (int32_t i = first; i < end; i++)
            deformer->fit->outline_index[i] = index;
    }
}

static void smooth_all(outline_deformer *deformer, const cairn_contour_grouping_object *object)
{
    for (int32_t first = 0, end; first < deformer->model->outline_count; first = end) {
        end = end_of_outline(deformer, first);
        smooth_outline(deformer, object, first, end);
    }
}

static void score_samples(outline_deformer *deformer)
{
    for (int32_t i = 0; i < deformer->model->outline_count; i++)
        deformer->fit->llr[i] =
            llr_at(deformer, deformer->fit->outline[i].position,
                   cairn_contour_search_field_bin(deformer->fit->outline[i].direction));
}

/* Cost of an affine transform's anisotropy. */
static cairn_real aspect_cost(cairn_real map[2][3])
{
    double p = (double)map[0][0], q = (double)map[0][1], r = (double)map[1][0],
           s = (double)map[1][1];
    double rotation_part = hypot(p + s, r - q), reflection_part = hypot(p - s, r + q);
    double aspect =
        log((rotation_part + reflection_part) / fmax(1e-6, fabs(rotation_part - reflection_part))) /
        ASPECT_SIGMA;

    return (cairn_real)(aspect * aspect / 2);
}

/* Fits an affine transform from the model to the outline (weighted least squares) as the next base;
 * returns the cost of its anisotropy. */
static cairn_real fit_affine_map(outline_deformer *deformer)
{
    const cairn_shape_model *model = deformer->model;
    cairn_sym3 sums = cairn_sym3_zero();
    cairn_real right[2][3] = {{0}}, map[2][3];

    score_samples(deformer);
    for (int32_t i = 0; i < model->outline_count; i++) {
        cairn_real v[3] = {model->outline[i].position.x, model->outline[i].position.y, 1};
        cairn_real weight = deformer->fit->llr[i] > 0 ? 1 : 0;

        cairn_sym3_add_outer(&sums, v, weight + (cairn_real)PRIOR_WEIGHT);
        for (int32_t k = 0; k < 3; k++) {
            right[0][k] += v[k] * (weight * deformer->fit->outline[i].position.x +
                                   (cairn_real)PRIOR_WEIGHT * deformer->base[i].x);
            right[1][k] += v[k] * (weight * deformer->fit->outline[i].position.y +
                                   (cairn_real)PRIOR_WEIGHT * deformer->base[i].y);
        }
    }
    if (!cairn_sym3_solve(sums, right[0], map[0]) || !cairn_sym3_solve(sums, right[1], map[1]))
        return 0;
    for (int32_t i = 0; i < model->outline_count; i++) {
        cairn_vec2 p = model->outline[i].position;

        deformer->base[i].x = map[0][0] * p.x + map[0][1] * p.y + map[0][2];
        deformer->base[i].y = map[1][0] * p.x + map[1][1] * p.y + map[1][2];
        deformer->fit->outline[i].position = deformer->base[i];
    }
    return aspect_cost(map);
}

/* Sets the object's pose to the least-squares similarity transform from the model to the deformed
 * outline. */
static void fit_similarity(const outline_deformer *deformer, cairn_contour_grouping_object *object)
{
    const cairn_shape_model *model = deformer->model;
    cairn_real count = (cairn_real)model->outline_count, squared_norms = 0, dot = 0, cross = 0;
    cairn_vec2 model_mean = {0, 0}, image_mean = {0, 0}, moved;

    for (int32_t i = 0; i < model->outline_count; i++) {
        model_mean =
            cairn_vec2_add(model_mean, cairn_vec2_scale(model->outline[i].position, 1 / count));
        image_mean = cairn_vec2_add(
            image_mean, cairn_vec2_scale(deformer->fit->outline[i].position, 1 / count));
    }
    for (int32_t i = 0; i < model->outline_count; i++) {
        cairn_vec2 p = cairn_vec2_sub(model->outline[i].position, model_mean),
                   q = cairn_vec2_sub(deformer->fit->outline[i].position, image_mean);

        squared_norms += cairn_vec2_norm_squared(p);
        dot += cairn_vec2_dot(p, q);
        cross += cairn_vec2_cross(p, q);
    }
    if (!(squared_norms > 0) || !(dot * dot + cross * cross > 0))
        return;
    object->size = cairn_sqrt(dot * dot + cross * cross) / squared_norms;
    object->turn = (cairn_real)atan2((double)cross, (double)dot);
    moved = cairn_contour_search_transform_vector(object, model_mean);
    object->origin = cairn_vec2_sub(image_mean, moved);
}

/* Initializes the outline at the object's pose. */
static void place_outline(outline_deformer *deformer, const cairn_contour_grouping_object *object)
{
    for (int32_t i = 0; i < deformer->model->outline_count; i++) {
        deformer->base[i] = cairn_vec2_add(
            object->origin,
            cairn_contour_search_transform_vector(object, deformer->model->outline[i].position));
        deformer->fit->outline[i].position = deformer->base[i];
        deformer->fit->outline[i].direction = cairn_vec2_unit(
            cairn_contour_search_transform_vector(object, deformer->model->outline[i].direction));
    }
}

static void deform(outline_deformer *deformer, cairn_contour_grouping_object *object)
{
    cairn_real aspect;

    number_outlines(deformer);
    place_outline(deformer, object);
    deform_all(deformer, 0);
    aspect = fit_affine_map(deformer);
    smooth_all(deformer, object);
    deformer->deformation_cost = 0;
    for (int32_t round = 1; round < ROUND_COUNT; round++) {
        deform_all(deformer, round);
        smooth_all(deformer, object);
    }
    score_samples(deformer);
    deformer->fit->evidence = -deformer->deformation_cost - aspect;
    for (int32_t i = 0; i < deformer->model->outline_count; i++)
        deformer->fit->evidence +=
            deformer->fit->llr[i] * deformer->spacing / (cairn_real)PIECE_LENGTH;
    deformer->fit->length = deformer->spacing * (cairn_real)deformer->model->outline_count;
    fit_similarity(deformer, object);
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

int cairn_contour_search_fit_run(contour_search_fit *fit, const contour_search_field *field,
                                 const cairn_shape_model *model,
                                 cairn_contour_grouping_object *object)
{
    outline_deformer deformer = {.field = field,
                                 .model = model,
                                 .fit = fit,
                                 .size = object->size,
                                 .spacing = spacing_of(model)};
    size_t count = (size_t)model->outline_count;
    int ok;

    deformer.base = malloc(count * sizeof *deformer.base);
    deformer.path_value = malloc((2 * count + 1) * MAX_LABELS * sizeof *deformer.path_value);
    deformer.sample_llr = malloc(count * MAX_LABELS * sizeof *deformer.sample_llr);
    for (int32_t bin = 0; bin < CONTOUR_SEARCH_FIELD_BINS; bin++)
        deformer.no_edge_llr[bin] = llr_of_cost(field, CONTOUR_SEARCH_FIELD_MAX_COST, bin);
    ok = deformer.base != NULL && deformer.path_value != NULL && deformer.sample_llr != NULL;
    if (ok)
        deform(&deformer, object);
    free(deformer.base);
    free(deformer.path_value);
    free(deformer.sample_llr);
    return ok;
}
