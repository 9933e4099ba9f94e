/* The outline of a model bent onto edges.
 *
 * Method: members of a class differ in their proportions, and by more than a similarity of their
 * outlines can follow. Every sample of the outline may lie beside its place by one of a grid of
 * shifts. What a sample is worth is the logarithm of how much likelier the edges there are with the
 * object than by chance, in the mean over the window; that neighbours lie beside their places by
 * different shifts costs in proportion to the difference. Dynamic programming finds the best shifts
 * of a whole outline, coarsely at first; the affine map that follows them best is the next base,
 * then the bent outline itself is, each time on a finer grid. An outline goes round: it is followed
 * twice, and the middle of both rounds is read.
 *
 * Limits: a part that lies farther than the widest grid from its place is not found; outlines of
 * one model bend each for itself.
 *
 * Source: this project's, for the deformations that the displacements of Adluru 2008 (2.9) allow
 * along a skeleton. */
#include "src/core/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/small_matrix.h"
#include "src/host/contour_search_fit.h"

/* Of the size: pieces of the outline of this length are independent of each other. */
#define PIECE 0.08
/* How likely a piece of the contour is to have no edge. */
#define HIDDEN 0.25
/* What it costs to shift a sample against the one before, by the size. */
#define STRETCH 30.0
/* Sigma of the logarithm of an affine map's aspect. */
#define ASPECT 0.25
/* What holds the affine map where there are no edges, to the weight of a sample with one. */
#define HELD 0.15
/* Samples between which the direction of an outline is measured. */
#define AROUND 2
/* Neighbours farther apart than so many spacings are of two outlines. */
#define BREAK 3

enum {
    REACH_MOST = 8,
    WIDTH_MOST = 2 * REACH_MOST + 1,
    LABELS_MOST = WIDTH_MOST * WIDTH_MOST,
    ROUNDS = 4
};
enum { PADDED_MOST = (WIDTH_MOST + 2) * (WIDTH_MOST + 2) };

/* Shifts of the rounds: so many steps either way, each of such a share of the size. */
static const struct {
    int32_t reach;
    double step;
} rounds[ROUNDS] = {{8, 0.02}, {7, 0.015}, {6, 0.008}, {5, 0.004}};

typedef struct bender {
    const contour_field *field;
    const cairn_shape_model *model;
    contour_fit *fit;
    /* [outline_count] px */
    cairn_vec2 *base;
    /* [(2 * outline_count + 1) * LABELS_MOST] of the best ways to each label */
    cairn_real *value;
    /* [outline_count * LABELS_MOST] what each sample is worth at each label */
    cairn_real *gain;
    /* what a place is worth that no edge is near */
    cairn_real no_edge[CONTOUR_FIELD_BINS];
    /* px; of the size, of the samples */
    cairn_real size, spacing;
    /* what all moves have cost */
    cairn_real bending;
    /* of the round */
    int32_t reach, width, labels;
    /* px */
    cairn_real step;
} bender;

int cairn_contour_fit_new(contour_fit *fit, int32_t outline_count)
{
    fit->outline = malloc((size_t)outline_count * sizeof *fit->outline);
    fit->worth = malloc((size_t)outline_count * sizeof *fit->worth);
    fit->part = malloc((size_t)outline_count * sizeof *fit->part);
    fit->evidence = 0;
    if (fit->outline != NULL && fit->worth != NULL && fit->part != NULL)
        return 1;
    cairn_contour_fit_free(fit);
    return 0;
}

void cairn_contour_fit_free(contour_fit *fit)
{
    free(fit->outline);
    free(fit->worth);
    free(fit->part);
    memset(fit, 0, sizeof *fit);
}

/* The log of how much likelier edges of such a cost are with an outline in a direction there
 * than by chance. */
static cairn_real worth_at(const contour_field *f, cairn_real cost, int32_t bin)
{
    return cairn_log((cairn_real)HIDDEN +
                     (1 - (cairn_real)HIDDEN) * cairn_exp(-cost) / f->chance[bin]);
}

static int32_t cell_at(cairn_real from_corner, cairn_real cell)
{
    return (int32_t)floor((double)(from_corner / cell));
}

/* Each cell is worked out once: neighbouring samples and later rounds ask for the same ones. */
static cairn_real worth_in(const bender *b, int32_t x, int32_t y, int32_t bin)
{
    const contour_field *f = b->field;
    size_t cell = ((size_t)bin * CONTOUR_FIELD_SIDE + (size_t)y) * CONTOUR_FIELD_SIDE + (size_t)x;

    if (x < 0 || y < 0 || x >= CONTOUR_FIELD_SIDE || y >= CONTOUR_FIELD_SIDE ||
        !(f->cost[cell] < CONTOUR_FIELD_MOST))
        return b->no_edge[bin];
    if (f->worth[cell] == CAIRN_REAL_MAX)
        f->worth[cell] = worth_at(f, f->cost[cell], bin);
    return f->worth[cell];
}

static cairn_real worth_of(const bender *b, cairn_vec2 at, int32_t bin)
{
    const contour_field *f = b->field;

    return worth_in(b, cell_at(at.x - f->corner.x, f->cell), cell_at(at.y - f->corner.y, f->cell),
                    bin);
}

static cairn_vec2 shift_of(const bender *b, int32_t label)
{
    int32_t column = label % b->width - b->reach, row = label / b->width - b->reach;
    cairn_vec2 shift = {b->step * (cairn_real)column, b->step * (cairn_real)row};

    return shift;
}

/* ---- One outline ---- */

/* What a step costs: to a neighbour on the grid of shifts, and to one across its corner. */
static cairn_real cost_of_move(const bender *b, int32_t move)
{
    return (move == 4       ? 0
            : move % 2 == 0 ? CAIRN_REAL(1.4142)
                            : 1) *
           ((cairn_real)STRETCH * b->step / b->size);
}

/* The value of the best way to each label of a sample from those of the sample before. About the
 * labels there is a border that no way comes from; of the moves, which are alike to the left and
 * to the right, the better one is taken first. */
static void take_ways(const bender *b, const cairn_real *before, cairn_real *now)
{
    cairn_real near = cost_of_move(b, 1), far = cost_of_move(b, 0), padded[PADDED_MOST] = {0},
               beside[PADDED_MOST] = {0};
    int32_t row = b->width + 2;

    for (int32_t i = 0; i < row * row; i++)
        padded[i] = -CAIRN_REAL_MAX;
    for (int32_t y = 0; y < b->width; y++)
        memcpy(&padded[(y + 1) * row + 1], &before[y * b->width],
               (size_t)b->width * sizeof *before);
    for (int32_t i = 1; i < row * row - 1; i++)
        beside[i] = cairn_max(padded[i - 1], padded[i + 1]);
    for (int32_t y = 0; y < b->width; y++) {
        const cairn_real *here = &padded[(y + 1) * row + 1], *along = &beside[(y + 1) * row + 1];

        for (int32_t x = 0; x < b->width; x++) {
            cairn_real straight = cairn_max(along[x], cairn_max(here[x - row], here[x + row]));
            cairn_real diagonal = cairn_max(along[x - row], along[x + row]);

            now[y * b->width + x] = cairn_max(here[x], cairn_max(straight - near, diagonal - far));
        }
    }
}

/* The move that leads best to a label from the values of the sample before: (dy + 1) * 3 + dx +
 * 1. */
static int32_t best_move(const bender *b, const cairn_real *before, int32_t label)
{
    int32_t x = label % b->width, y = label / b->width, best = 4;
    cairn_real most = before[label];

    for (int32_t k = 0; k < 9; k++) {
        int32_t u = x + k % 3 - 1, v = y + k / 3 - 1;
        cairn_real value;

        if (k == 4 || u < 0 || v < 0 || u >= b->width || v >= b->width)
            continue;
        value = before[v * b->width + u] - cost_of_move(b, k);
        if (value > most) {
            most = value;
            best = k;
        }
    }
    return best;
}

/* What a sample is worth at each label: the cells of the grid's columns and rows are looked up
 * once. */
static void find_gain(const bender *b, int32_t sample, cairn_real *gain)
{
    int32_t bin = cairn_contour_field_bin(b->fit->outline[sample].direction), column[WIDTH_MOST],
            row[WIDTH_MOST];

    for (int32_t i = 0; i < b->width; i++) {
        cairn_real shift = b->step * (cairn_real)(i - b->reach);

        column[i] = cell_at(b->base[sample].x + shift - b->field->corner.x, b->field->cell);
        row[i] = cell_at(b->base[sample].y + shift - b->field->corner.y, b->field->cell);
    }
    for (int32_t y = 0; y < b->width; y++)
        for (int32_t x = 0; x < b->width; x++)
            *gain++ = b->spacing / (cairn_real)PIECE * worth_in(b, column[x], row[y], bin);
}

/* Shifts the samples first ... first + count - 1 to where they lie best. */
static void bend_outline(bender *b, int32_t first, int32_t count)
{
    size_t labels = (size_t)b->labels;
    cairn_real *last = &b->value[2 * (size_t)count * labels];
    int32_t label = b->labels / 2;

    memset(b->value, 0, labels * sizeof *b->value);
    for (int32_t k = 0; k < 2 * count; k++) {
        cairn_real *now = &b->value[((size_t)k + 1) * labels],
                   *gain = &b->gain[(size_t)(k % count) * labels];

        take_ways(b, now - labels, now);
        if (k < count)
            find_gain(b, first + k, gain);
        for (size_t i = 0; i < labels; i++)
            now[i] += gain[i];
    }
    for (int32_t i = 0; i < b->labels; i++)
        label = last[i] > last[label] ? i : label;
    for (int32_t k = 2 * count - 1; k >= count / 2; k--) {
        int32_t move = best_move(b, &b->value[(size_t)k * labels], label),
                sample = first + k % count;

        if (k < count / 2 + count) {
            b->fit->outline[sample].position = cairn_vec2_add(b->base[sample], shift_of(b, label));
            b->bending += cost_of_move(b, move);
        }
        label += move % 3 - 1 + b->width * (move / 3 - 1);
    }
}

/* One past the last sample of the outline that begins at first. */
static int32_t end_of_outline(const bender *b, int32_t first)
{
    const cairn_oriented_point *o = b->model->outline;
    int32_t end = first + 1;

    while (end < b->model->outline_count &&
           cairn_vec2_norm(cairn_vec2_sub(o[end].position, o[end - 1].position)) <
               BREAK * b->spacing)
        end++;
    return end;
}

/* ---- All of them ---- */

/* Evens out the shifts of an outline, and turns its directions with it. */
static void smooth_outline(bender *b, const cairn_grouped_object *o, int32_t first, int32_t end)
{
    int32_t count = end - first;
    cairn_oriented_point *outline = b->fit->outline;

    for (int32_t i = 0; i < count; i++) {
        int32_t before = first + (i + count - 1) % count, at = first + i,
                after = first + (i + 1) % count;
        cairn_vec2 sum = cairn_vec2_add(cairn_vec2_sub(outline[before].position, b->base[before]),
                                        cairn_vec2_sub(outline[after].position, b->base[after]));

        sum = cairn_vec2_add(
            sum, cairn_vec2_scale(cairn_vec2_sub(outline[at].position, b->base[at]), 2));
        b->base[at] = cairn_vec2_add(b->base[at], cairn_vec2_scale(sum, CAIRN_REAL(0.25)));
    }
    for (int32_t i = 0; i < count; i++) {
        int32_t before = first + (i + count - AROUND) % count, after = first + (i + AROUND) % count;
        cairn_vec2 was = cairn_vec2_unit(
                       cairn_contour_turned(o, cairn_vec2_sub(b->model->outline[after].position,
                                                              b->model->outline[before].position))),
                   is = cairn_vec2_unit(cairn_vec2_sub(b->base[after], b->base[before])),
                   d = cairn_vec2_unit(
                       cairn_contour_turned(o, b->model->outline[first + i].direction));
        cairn_real cosine = cairn_vec2_dot(was, is), sine = cairn_vec2_cross(was, is);

        outline[first + i].direction.x = cosine * d.x - sine * d.y;
        outline[first + i].direction.y = sine * d.x + cosine * d.y;
    }
}

static void bend_all(bender *b, int32_t round)
{
    b->reach = rounds[round].reach;
    b->width = 2 * b->reach + 1;
    b->labels = b->width * b->width;
    b->step = (cairn_real)rounds[round].step * b->size;
    for (int32_t first = 0, end; first < b->model->outline_count; first = end) {
        end = end_of_outline(b, first);
        bend_outline(b, first, end - first);
    }
}

/* Numbers the outlines. */
static void number_parts(bender *b)
{
    int32_t part = 0;

    for (int32_t first = 0, end; first < b->model->outline_count; first = end, part++) {
        end = end_of_outline(b, first);
        for (int32_t i = first; i < end; i++)
            b->fit->part[i] = part;
    }
}

static void smooth_all(bender *b, const cairn_grouped_object *o)
{
    for (int32_t first = 0, end; first < b->model->outline_count; first = end) {
        end = end_of_outline(b, first);
        smooth_outline(b, o, first, end);
    }
}

static void weigh(bender *b)
{
    for (int32_t i = 0; i < b->model->outline_count; i++)
        b->fit->worth[i] = worth_of(b, b->fit->outline[i].position,
                                    cairn_contour_field_bin(b->fit->outline[i].direction));
}

/* What it costs that an affine map stretches one direction more than the other. */
static cairn_real cost_of_aspect(cairn_real map[2][3])
{
    double p = (double)map[0][0], q = (double)map[0][1], r = (double)map[1][0],
           s = (double)map[1][1];
    double turned = hypot(p + s, r - q), mirrored = hypot(p - s, r + q);
    double aspect = log((turned + mirrored) / fmax(1e-6, fabs(turned - mirrored))) / ASPECT;

    return (cairn_real)(aspect * aspect / 2);
}

/* The affine map of the model that follows the outline best becomes the base; what its aspect
 * costs. */
static cairn_real follow_affinely(bender *b)
{
    const cairn_shape_model *m = b->model;
    cairn_sym3 sums = cairn_sym3_zero();
    cairn_real right[2][3] = {{0}}, map[2][3];

    weigh(b);
    for (int32_t i = 0; i < m->outline_count; i++) {
        cairn_real v[3] = {m->outline[i].position.x, m->outline[i].position.y, 1};
        cairn_real weight = b->fit->worth[i] > 0 ? 1 : 0;

        cairn_sym3_add_outer(&sums, v, weight + (cairn_real)HELD);
        for (int32_t k = 0; k < 3; k++) {
            right[0][k] +=
                v[k] * (weight * b->fit->outline[i].position.x + (cairn_real)HELD * b->base[i].x);
            right[1][k] +=
                v[k] * (weight * b->fit->outline[i].position.y + (cairn_real)HELD * b->base[i].y);
        }
    }
    if (!cairn_sym3_solve(sums, right[0], map[0]) || !cairn_sym3_solve(sums, right[1], map[1]))
        return 0;
    for (int32_t i = 0; i < m->outline_count; i++) {
        cairn_vec2 p = m->outline[i].position;

        b->base[i].x = map[0][0] * p.x + map[0][1] * p.y + map[0][2];
        b->base[i].y = map[1][0] * p.x + map[1][1] * p.y + map[1][2];
        b->fit->outline[i].position = b->base[i];
    }
    return cost_of_aspect(map);
}

/* The similarity that follows the bent outline. */
static void move_object(const bender *b, cairn_grouped_object *o)
{
    const cairn_shape_model *m = b->model;
    cairn_real count = (cairn_real)m->outline_count, mm = 0, dot = 0, cross = 0;
    cairn_vec2 mean = {0, 0}, place = {0, 0}, moved;

    for (int32_t i = 0; i < m->outline_count; i++) {
        mean = cairn_vec2_add(mean, cairn_vec2_scale(m->outline[i].position, 1 / count));
        place = cairn_vec2_add(place, cairn_vec2_scale(b->fit->outline[i].position, 1 / count));
    }
    for (int32_t i = 0; i < m->outline_count; i++) {
        cairn_vec2 p = cairn_vec2_sub(m->outline[i].position, mean),
                   q = cairn_vec2_sub(b->fit->outline[i].position, place);

        mm += cairn_vec2_norm_squared(p);
        dot += cairn_vec2_dot(p, q);
        cross += cairn_vec2_cross(p, q);
    }
    if (!(mm > 0) || !(dot * dot + cross * cross > 0))
        return;
    o->size = cairn_sqrt(dot * dot + cross * cross) / mm;
    o->turn = (cairn_real)atan2((double)cross, (double)dot);
    moved = cairn_contour_turned(o, mean);
    o->origin = cairn_vec2_sub(place, moved);
}

/* Where the model lies before anything is bent. */
static void lay(bender *b, const cairn_grouped_object *o)
{
    for (int32_t i = 0; i < b->model->outline_count; i++) {
        b->base[i] =
            cairn_vec2_add(o->origin, cairn_contour_turned(o, b->model->outline[i].position));
        b->fit->outline[i].position = b->base[i];
        b->fit->outline[i].direction =
            cairn_vec2_unit(cairn_contour_turned(o, b->model->outline[i].direction));
    }
}

static void bend(bender *b, cairn_grouped_object *o)
{
    cairn_real aspect;

    number_parts(b);
    lay(b, o);
    bend_all(b, 0);
    aspect = follow_affinely(b);
    smooth_all(b, o);
    b->bending = 0;
    for (int32_t round = 1; round < ROUNDS; round++) {
        bend_all(b, round);
        smooth_all(b, o);
    }
    weigh(b);
    b->fit->evidence = -b->bending - aspect;
    for (int32_t i = 0; i < b->model->outline_count; i++)
        b->fit->evidence += b->fit->worth[i] * b->spacing / (cairn_real)PIECE;
    b->fit->length = b->spacing * (cairn_real)b->model->outline_count;
    move_object(b, o);
}

/* The mean distance of neighbours, those at the ends of outlines left out. */
static cairn_real spacing_of(const cairn_shape_model *m)
{
    cairn_real most = CAIRN_REAL_MAX, mean = 0;

    for (int32_t pass = 0; pass < 2; pass++) {
        cairn_real sum = 0, count = 0;

        for (int32_t i = 1; i < m->outline_count; i++) {
            cairn_real apart =
                cairn_vec2_norm(cairn_vec2_sub(m->outline[i].position, m->outline[i - 1].position));

            sum += apart < most ? apart : 0;
            count += apart < most;
        }
        mean = sum / cairn_max(count, 1);
        most = BREAK * mean;
    }
    return mean;
}

int cairn_contour_fit_run(contour_fit *fit, const contour_field *field,
                          const cairn_shape_model *model, cairn_grouped_object *object)
{
    bender b = {.field = field,
                .model = model,
                .fit = fit,
                .size = object->size,
                .spacing = spacing_of(model)};
    size_t count = (size_t)model->outline_count;
    int ok;

    b.base = malloc(count * sizeof *b.base);
    b.value = malloc((2 * count + 1) * LABELS_MOST * sizeof *b.value);
    b.gain = malloc(count * LABELS_MOST * sizeof *b.gain);
    for (int32_t bin = 0; bin < CONTOUR_FIELD_BINS; bin++)
        b.no_edge[bin] = worth_at(field, CONTOUR_FIELD_MOST, bin);
    ok = b.base != NULL && b.value != NULL && b.gain != NULL;
    if (ok)
        bend(&b, object);
    free(b.base);
    free(b.value);
    free(b.gain);
    return ok;
}
