/* Objects of a class, by their outlines.
 *
 * Method: for each size, the model and its mirror image, and three proportions of each, a map of
 * the mean worth of the outline's samples (object_detect_field.c) for every place of its middle:
 * sums of shifted planes. Of the peaks of all maps the best are taken that do not lie on better
 * ones (object_detect_candidates.c), and looked at again: the outline is bent onto the edges about
 * them (contour_search_fit.c). Both means, before and after, make the score, with how the bent
 * outline fits (contour_search_shape.c) and what contour grouping finds there
 * (object_detect_group.c); boxes are those of the bent outlines. Of detections that overlap the
 * best stays.
 *
 * PARTS: the candidates are configurations of parts (object_detect_parts.c) and keep their scores;
 * bending gives the box only. As written nothing is bent (object_detect_written.c).
 *
 * Source: this project's, but for PARTS; of Adluru 2008, section 5, only that there are two
 * steps, coarse then fine. */
#include "src/core/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/shape_model_file.h"
#include "src/host/contour_search_fit.h"
#include "src/host/object_detect_candidates.h"

/* Of bent outlines evidence is counted in pieces of this length (contour_search_fit.c). */
#define PIECE 0.08
/* What the outline before bending and the logarithm of the size, to the picture's diagonal,
 * count beside the bent one. A piece of a small outline is a few pixels, along which chance lays
 * an edge more easily. */
#define RIGID 2
#define SIZE  1
/* And how near edges are to the bent outline, how far it is turned and strained against the
 * drawn one (contour_search_shape.c). */
#define NEAR     12
#define TURNED   32
#define STRAINED 16
/* What all that comes to where there is no object, so that 0 is where most pictures without one
 * have none left (docs/accuracy.md). */
#define NOTHING 10.7
/* And the square of the logarithm of how much wider its box is, to its height, than the model's. */
#define PROPORTION 1
/* Where objects may be hidden in part: what of the outline agrees on one similarity map counts,
 * as what is hidden was bent onto what hides it, with the evidence of what is grouped there, the
 * size, and nothing else. Scores have the same 0. */
#define OCCLUDED_AGREED  20
#define OCCLUDED_GROUPED CAIRN_REAL(0.5)
#define OCCLUDED_SIZE    2
#define OCCLUDED_NOTHING 8
/* Of two detections one goes, too, when more of the smaller box than this lies in the other:
 * parts of an object look like small ones. */
#define INSIDE 0.8F
/* A segment stands for a place so near, of the size, but at least so many pixels; and turned by
 * so much. */
#define REACH_SHARE 0.04
#define LEAST_REACH 3
#define TURN_COSINE 0.7

cairn_object_detect_params cairn_object_detect_default(int32_t width, int32_t height)
{
    cairn_real diagonal = (cairn_real)hypot((double)width, (double)height);
    cairn_object_detect_params params = {cairn_max(24, diagonal / 10),
                                         cairn_max(24, diagonal),
                                         1,
                                         30,
                                         CAIRN_REAL(0.2),
                                         0,
                                         CAIRN_DETECT_EVIDENCE,
                                         CAIRN_DETECT_BUNDLES,
                                         NULL,
                                         0,
                                         2,
                                         20,
                                         0,
                                         NULL,
                                         8,
                                         NULL,
                                         NULL,
                                         0,
                                         CAIRN_REAL(0.08),
                                         CAIRN_MODE_DEFAULT,
                                         0};

    return params;
}

void cairn_detections_free(cairn_detections *detections)
{
    free(detections->found);
    free(detections->segments);
    free(detections->outline);
    free(detections->parts);
    memset(detections, 0, sizeof *detections);
}

/* ---- Candidates ---- */

/* The share of the smaller of two boxes that lies in the other. */
static float inside_of(const cairn_detection *a, const cairn_detection *b)
{
    cairn_real w = cairn_min(a->right, b->right) - cairn_max(a->left, b->left),
               h = cairn_min(a->bottom, b->bottom) - cairn_max(a->top, b->top),
               least = cairn_min((a->right - a->left) * (a->bottom - a->top),
                                 (b->right - b->left) * (b->bottom - b->top));

    return w > 0 && h > 0 ? (float)(w * h / least) : 0;
}

/* With `occluded` what is grouped makes as many candidates more, at most. PEAKS_MOST leaves room
 * for them. */
static cairn_status group(detector *d)
{
    const cairn_object_detect_params *p = &d->field->params;
    cairn_status status = p->occluded || p->verify > 0
                              ? cairn_detect_group(&d->groupings, d->field, d->model)
                              : CAIRN_OK;

    for (int32_t i = 0;
         status == CAIRN_OK && p->occluded && i < d->groupings.count && i < p->candidates; i++) {
        const detect_grouping *g = &d->groupings.list[i];
        detect_peak *q = &d->peaks[d->count++];

        q->score = q->rigid = 0;
        q->x = (float)g->found.origin.x;
        q->y = (float)g->found.origin.y;
        q->size = (float)g->found.size;
        q->turn = (float)g->found.turn;
        q->variant = g->mirrored ? DETECT_ASPECTS : 0;
        q->hypothesis = -1;
    }
    return status;
}

/* ---- Detections ---- */

static void take_outline(const detector *d, cairn_detections *found, cairn_detection *o)
{
    o->first_outline = found->outline_count;
    o->outline_count = d->model->outline_count;
    o->left = o->top = CAIRN_REAL_MAX;
    o->right = o->bottom = -CAIRN_REAL_MAX;
    for (int32_t i = 0; i < o->outline_count; i++) {
        cairn_contour_place *place = &found->outline[o->first_outline + i];
        cairn_vec2 at = d->fit.outline[i].position;

        place->at = d->fit.outline[i];
        place->part = d->fit.part[i];
        o->left = cairn_min(o->left, at.x);
        o->right = cairn_max(o->right, at.x);
        o->top = cairn_min(o->top, at.y);
        o->bottom = cairn_max(o->bottom, at.y);
    }
    found->outline_count += o->outline_count;
}

/* The segment nearest to a place of the outline and about in its direction; -1: none is near. */
static int32_t segment_at(const detector *d, const int32_t *list, int32_t count,
                          cairn_oriented_point place, cairn_real size)
{
    cairn_real nearest = cairn_max(LEAST_REACH, (cairn_real)REACH_SHARE * size);
    int32_t found = -1;

    for (int32_t i = 0; i < count; i++) {
        cairn_segment line = d->field->tokens->lines[list[i]];
        cairn_real distance = cairn_contour_point_distance(line, place.position);
        cairn_vec2 along = cairn_vec2_unit(cairn_vec2_sub(line.b, line.a));

        if (distance < nearest &&
            cairn_abs(cairn_vec2_dot(along, place.direction)) >= (cairn_real)TURN_COSINE) {
            nearest = distance;
            found = list[i];
        }
    }
    return found;
}

/* The segments along the bent outline, and where it has none. 0: there is no memory. */
static int take_segments(const detector *d, cairn_detections *found, cairn_detection *o)
{
    const cairn_contour_tokens *tokens = d->field->tokens;
    contour_fitted_outline laid = {d->fit.outline, d->model->outline_count, o->origin, o->size};
    int32_t *list = realloc(
        found->segments, ((size_t)found->segment_count + (size_t)tokens->count + 1) * sizeof *list);
    cairn_real length = 0;

    if (list == NULL)
        return 0;
    found->segments = list;
    o->first_segment = found->segment_count;
    list += found->segment_count;
    if (!cairn_contour_collect_segments(tokens, &laid, list, &o->segment_count))
        return 0;
    found->segment_count += o->segment_count;
    for (int32_t i = 0; i < o->segment_count; i++)
        length += cairn_segment_length(tokens->lines[list[i]]);
    o->along = length / (d->fit.length * o->size);
    for (int32_t i = 0; i < o->outline_count; i++) {
        cairn_contour_place *place = &found->outline[o->first_outline + i];

        place->segment = segment_at(d, list, o->segment_count, place->at, o->size);
    }
    return 1;
}

/* As it was drawn, mirrored where the detection is. */
static const cairn_oriented_point *drawn_outline(const detector *d, const cairn_detection *o)
{
    return d->variant[o->mirrored ? DETECT_ASPECTS : 0].outline;
}

/* Objects stand upright: a turn of the whole counts as bending does. map: see
 * cairn_detect_agreed(). */
static void measure_shape(const detector *d, cairn_detection *o, detect_similarity *map)
{
    const contour_fitted_outline laid = {d->fit.outline, o->outline_count, o->origin, o->size};
    const contour_reference drawn = {drawn_outline(d, o), {1, 0}};
    cairn_contour_shape shape =
        cairn_contour_shape_of(d->field->tokens, &laid, d->fit.part, &drawn, d->near, d->room);

    o->close = shape.close;
    o->turned = shape.turned;
    o->strained = shape.strained;
    o->agreed = cairn_detect_agreed(&laid, drawn.outline, d->room, d->room + o->outline_count, map);
}

static cairn_real score_of(const detector *d, const cairn_detection *o)
{
    const detect_variant *plain = &d->variant[0];
    double diagonal = hypot((double)d->field->tokens->width, (double)d->field->tokens->height);
    double proportion = (double)(o->right - o->left) * (double)(plain->bottom - plain->top) /
                        ((double)(o->bottom - o->top) * (double)(plain->right - plain->left));

    if (d->field->params.occluded)
        return OCCLUDED_AGREED * o->agreed + OCCLUDED_GROUPED * o->grouped +
               (cairn_real)(OCCLUDED_SIZE * log((double)o->size / diagonal) - OCCLUDED_NOTHING);
    return o->bent + RIGID * o->rigid + d->field->params.verify * o->grouped + NEAR * o->close -
           TURNED * o->turned - STRAINED * o->strained +
           (cairn_real)(SIZE * log((double)o->size / diagonal) -
                        PROPORTION * log(proportion) * log(proportion) - NOTHING);
}

/* What the thesis says of a hypothesis by its parts. */
static void take_parts(const detect_hypothesis *h, cairn_detection *o)
{
    o->score = h->score;
    o->distance = h->distance;
    o->agreement = h->agreement;
    o->first_part = h->first_part;
    o->part_count = h->part_count;
}

/* What is in the box (Adluru 2008, eq. 5.1, with how unlikely it shows the class as the distance
 * of appearance). */
static void look_at(const detector *d, cairn_detection *o)
{
    const double box[4] = {(double)o->left, (double)o->top, (double)o->right, (double)o->bottom};

    o->appearance = (cairn_real)cairn_appearance_probability(d->field->params.appearance, box);
    o->score -= d->field->params.appearance_weight * (1 - o->appearance);
}

/* Bends the outline onto the edges about a candidate. 0: there is no memory. */
static int verify(detector *d, const detect_peak *p, cairn_detections *found)
{
    cairn_detection *o = &found->found[found->count];
    const detect_variant *v = &d->variant[p->variant];
    detect_similarity map;
    cairn_shape_model model = *d->model;
    cairn_grouped_object object;

    memset(&object, 0, sizeof object);
    object.origin.x = (cairn_real)p->x;
    object.origin.y = (cairn_real)p->y;
    object.size = (cairn_real)p->size;
    object.turn = (cairn_real)p->turn;
    model.outline = v->outline;
    cairn_contour_field_fill(d->window, d->field->tokens, &object);
    if (!cairn_contour_fit_run(&d->fit, d->window, &model, &object))
        return 0;
    memset(o, 0, sizeof *o);
    o->rigid = (cairn_real)p->rigid;
    o->bent = d->fit.evidence / d->fit.length * (cairn_real)PIECE;
    o->origin = object.origin;
    o->size = object.size;
    o->mirrored = v->mirrored;
    take_outline(d, found, o);
    measure_shape(d, o, &map);
    if (d->field->params.occluded && o->agreed > 0) {
        cairn_detect_lay(&map, drawn_outline(d, o), &d->fit, o);
        found->outline_count -= o->outline_count;
        take_outline(d, found, o);
    }
    if (!take_segments(d, found, o))
        return 0;
    o->grouped = cairn_detect_grouped_at(&d->groupings, o);
    o->score = score_of(d, o);
    if (p->hypothesis >= 0)
        take_parts(&d->hypotheses.list[p->hypothesis], o);
    found->count += o->score >= d->field->params.min_score;
    if (d->field->params.appearance != NULL)
        look_at(d, o);
    return 1;
}

static int compare_detections(const void *a, const void *b)
{
    const cairn_detection *x = a, *y = b;

    if (x->score != y->score)
        return x->score < y->score ? 1 : -1;
    return x->first_outline != y->first_outline ? x->first_outline - y->first_outline
                                                : x->first_part - y->first_part;
}

static void keep_best(const detector *d, cairn_detections *found)
{
    int32_t kept = 0;

    if (found->count > 1)
        qsort(found->found, (size_t)found->count, sizeof *found->found, compare_detections);
    for (int32_t i = 0; i < found->count; i++) {
        const cairn_detection *o = &found->found[i];
        int32_t apart = 1;

        for (int32_t k = 0; k < kept && apart; k++) {
            const cairn_detection *b = &found->found[k];

            apart = cairn_detect_overlap((float)o->left, (float)o->top, (float)o->right,
                                         (float)o->bottom, (float)b->left, (float)b->top,
                                         (float)b->right,
                                         (float)b->bottom) <= (float)d->field->params.overlap &&
                    (cairn_detect_is_as_written(d->field) || inside_of(o, b) <= INSIDE);
        }
        if (apart)
            found->found[kept++] = *o;
    }
    found->count = kept;
}

static void take_configurations(detector *d, cairn_detections *found)
{
    found->parts = d->hypotheses.parts;
    found->part_count = d->hypotheses.part_count;
    found->bundles = d->hypotheses.bundles;
    found->has_appearance = d->field->params.appearance != NULL;
    d->hypotheses.parts = NULL;
}

/* Every hypothesis is a detection; of those in one place the best stays. */
static cairn_status detect_as_written(detector *d, cairn_detections *found)
{
    cairn_status status = cairn_detect_parts(&d->hypotheses, d->field, d->model);

    if (status != CAIRN_OK)
        return status;
    take_configurations(d, found);
    cairn_detect_tell(d->field, CAIRN_DETECT_BOXES);
    status = cairn_detect_written_take(found, &d->hypotheses, d->field);
    if (status != CAIRN_OK)
        return status;
    keep_best(d, found);
    return cairn_detect_written_draw(found, d->field, d->model);
}

static cairn_status detect(detector *d, cairn_detections *found)
{
    cairn_status status = CAIRN_OK;

    d->window = cairn_contour_field_new();
    d->near = malloc(((size_t)d->field->tokens->count + 1) * sizeof *d->near);
    d->room = malloc(2 * (size_t)d->model->outline_count * sizeof *d->room);
    if (d->window == NULL || d->near == NULL || d->room == NULL ||
        !cairn_contour_fit_new(&d->fit, d->model->outline_count) || !cairn_detect_variants_add(d))
        return CAIRN_NO_MEMORY;
    cairn_detect_tell(d->field, CAIRN_DETECT_VOTES);
    if (d->field->params.method == CAIRN_DETECT_PARTS)
        status = cairn_detect_candidates_of_parts(d);
    else if (!cairn_detect_candidates_find(d))
        status = CAIRN_NO_MEMORY;
    else
        status = group(d);
    if (status != CAIRN_OK)
        return status;
    take_configurations(d, found);
    found->found = malloc(((size_t)d->count + 1) * sizeof *found->found);
    found->outline =
        malloc(((size_t)d->count + 1) * (size_t)d->model->outline_count * sizeof *found->outline);
    if (found->found == NULL || found->outline == NULL)
        return CAIRN_NO_MEMORY;
    cairn_detect_tell(d->field, d->field->params.method == CAIRN_DETECT_PARTS
                                    ? CAIRN_DETECT_BOXES
                                    : CAIRN_DETECT_SCORES);
    for (int32_t i = 0; i < d->count; i++)
        if (!verify(d, &d->peaks[i], found))
            return CAIRN_NO_MEMORY;
    cairn_detect_tell(d->field, CAIRN_DETECT_BOXES);
    keep_best(d, found);
    return CAIRN_OK;
}

/* 1 when the box of the outline has a width and a height. */
static int has_area(const cairn_shape_model *m)
{
    cairn_box box = cairn_box_empty();

    for (int32_t i = 0; i < m->outline_count; i++)
        box = cairn_box_extend(box, m->outline[i].position);
    return box.max.x > box.min.x && box.max.y > box.min.y;
}

static cairn_status check_model(const cairn_shape_model *model, cairn_fault *fault)
{
    cairn_status status = cairn_shape_model_check(model, fault);

    if (status == CAIRN_OK && model->outline_count < 3)
        status = cairn_refuse(fault, -1, "a model of fewer than 3 places, expected an outline",
                              CAIRN_BAD_ARGUMENT);
    if (status == CAIRN_OK && !has_area(model))
        status = cairn_refuse(
            fault, -1, "an outline along one straight line, expected one with a width and a height",
            CAIRN_BAD_ARGUMENT);
    if (status == CAIRN_OK && !cairn_detect_variants_fit(model))
        status = cairn_refuse(
            fault, -1,
            "the outline lies farther from its middle than half its size, expected it within",
            CAIRN_BAD_ARGUMENT);
    return status;
}

cairn_status cairn_object_detect(cairn_detections *detections, const cairn_detect_field *field,
                                 const cairn_shape_model *model, const char *path,
                                 cairn_file_error *error)
{
    detector d = {.field = field, .model = model};
    cairn_fault fault = {0, NULL};
    cairn_status status = check_model(model, &fault);

    memset(detections, 0, sizeof *detections);
    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, path, 0, "%s", fault.what);
    status = cairn_detect_is_as_written(field) ? detect_as_written(&d, detections)
                                               : detect(&d, detections);
    cairn_detect_parts_free(&d.hypotheses);
    cairn_detect_group_free(&d.groupings);
    free(d.outlines);
    free(d.peaks);
    free(d.near);
    free(d.room);
    cairn_contour_field_free(d.window);
    cairn_contour_fit_free(&d.fit);
    if (status == CAIRN_OK)
        return CAIRN_OK;
    cairn_detections_free(detections);
    if (status != CAIRN_NO_MEMORY && field->params.cuts != NULL)
        return cairn_file_error_set(error, status, path, 0,
                                    "%s, expected fragments by hand of its first outline",
                                    cairn_status_text(status));
    if (status != CAIRN_NO_MEMORY)
        return cairn_file_error_set(error, status, path, 0,
                                    "%s, expected an outline with length of 3 to 4096 samples",
                                    cairn_status_text(status));
    return cairn_file_error_system(error, path, "detect", ENOMEM);
}
