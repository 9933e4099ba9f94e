/* Candidates of a search: of each variant of the model and each size the peaks of a map of the mean worth of the outline's samples; of
 * all peaks the best that do not lie on better ones. object_detect.c says how. */
#include "src/core/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/object_detect_candidates.h"

/* Width to height of the model's, and what a step between them costs. */
static const double aspects[DETECT_ASPECTS] = {1, 0.8, 1.25, 0.64, 1.5625};
enum { PEAKS_MOST = 1 << 16 };
/* Of two candidates whose boxes share more, over their union, the better one is looked at. */
#define CANDIDATE_OVERLAP 0.5F
/* What the logarithm of the size counts beside the outline before bending, for candidates. */
#define FIRST_SIZE 0.4F

/* ---- Variants of the model ---- */

static void add_variant(detector *d, int32_t mirrored, double aspect)
{
    detect_variant *v = &d->variant[d->variants];
    const cairn_shape_model *m = d->model;
    double wide = sqrt(aspect) * (mirrored ? -1 : 1), tall = 1 / sqrt(aspect);

    v->outline = &d->outlines[(size_t)d->variants++ * (size_t)m->outline_count];
    v->mirrored = mirrored;
    v->left = v->top = 1e9F;
    v->right = v->bottom = -1e9F;
    for (int32_t i = 0; i < m->outline_count; i++) {
        cairn_oriented_point *o = &v->outline[i];
        cairn_vec2 along = {(cairn_real)wide * m->outline[i].direction.x, (cairn_real)tall * m->outline[i].direction.y};

        o->position.x = (cairn_real)wide * m->outline[i].position.x;
        o->position.y = (cairn_real)tall * m->outline[i].position.y;
        o->direction = cairn_vec2_unit(along);
        v->left = fminf(v->left, (float)o->position.x);
        v->right = fmaxf(v->right, (float)o->position.x);
        v->top = fminf(v->top, (float)o->position.y);
        v->bottom = fmaxf(v->bottom, (float)o->position.y);
    }
}

int cairn_detect_variants_add(detector *d)
{
    d->outlines = malloc(2 * DETECT_ASPECTS * (size_t)d->model->outline_count * sizeof *d->outlines);
    if (d->outlines == NULL)
        return 0;
    for (int32_t mirrored = 0; mirrored < (d->field->params.mirror ? 2 : 1); mirrored++)
        for (int32_t k = 0; k < DETECT_ASPECTS; k++)
            add_variant(d, mirrored, aspects[k]);
    return 1;
}

int cairn_detect_variants_fit(const cairn_shape_model *m)
{
    for (int32_t k = 0; k < DETECT_ASPECTS; k++)
        for (int32_t i = 0; i < m->outline_count; i++) {
            double x = sqrt(aspects[k]) * (double)m->outline[i].position.x;
            double y = (double)m->outline[i].position.y / sqrt(aspects[k]);

            if (!(fmax(fabs(x), fabs(y)) * DETECT_CELLS < DETECT_MARGIN - 1))
                return 0;
        }
    return 1;
}

/* ---- Places ---- */

static int compare_peaks(const void *a, const void *b)
{
    const detect_peak *x = a, *y = b;

    if (x->score != y->score)
        return x->score < y->score ? 1 : -1;
    if (x->size != y->size)
        return x->size < y->size ? -1 : 1;
    if (x->variant != y->variant)
        return x->variant - y->variant;
    if (x->y != y->y)
        return x->y < y->y ? -1 : 1;
    return x->x != y->x ? (x->x < y->x ? -1 : 1) : x->hypothesis - y->hypothesis;
}

/* Room for a peak; when there is none the worse half goes. */
static detect_peak *next_peak(detector *d)
{
    if (d->count == PEAKS_MOST) {
        qsort(d->peaks, (size_t)d->count, sizeof *d->peaks, compare_peaks);
        d->count /= 2;
    }
    return &d->peaks[d->count++];
}

static void add_peaks(detector *d, const detect_plane *p, const float *sum, int32_t index)
{
    int32_t w = p->width, h = p->height;
    float share = 1 / (float)d->model->outline_count;
    float bonus =
        FIRST_SIZE * logf((float)p->size / hypotf((float)d->field->tokens->width, (float)d->field->tokens->height));

    for (int32_t y = 0; y < h; y++)
        for (int32_t x = 0; x < w; x++) {
            float value = sum[y * w + x];
            int is_peak = value > 0;

            for (int32_t k = 0; k < 9 && is_peak; k++) {
                int32_t u = x + k % 3 - 1, v = y + k / 3 - 1;

                is_peak = k == 4 || u < 0 || v < 0 || u >= w || v >= h || value > sum[v * w + u] ||
                          (value >= sum[v * w + u] && k > 4);
            }
            if (is_peak) {
                detect_peak *q = next_peak(d);

                q->score = value * share + bonus;
                q->rigid = value * share;
                q->x = ((float)x + 0.5F) * (float)p->cell;
                q->y = ((float)y + 0.5F) * (float)p->cell;
                q->size = (float)p->size;
                q->turn = 0;
                q->variant = index;
                q->hypothesis = -1;
            }
        }
}

/* The sums of an outline's samples for every place of its middle. */
static void correlate(const detector *d, const detect_plane *p, const detect_variant *v, float *sum)
{
    int32_t w = p->width, h = p->height;

    memset(sum, 0, (size_t)w * (size_t)h * sizeof *sum);
    for (int32_t i = 0; i < d->model->outline_count; i++) {
        int32_t bin = cairn_contour_field_bin(v->outline[i].direction);
        int32_t dx = (int32_t)lrint((double)v->outline[i].position.x * DETECT_CELLS);
        int32_t dy = (int32_t)lrint((double)v->outline[i].position.y * DETECT_CELLS);
        const float *layer = &p->worth[(size_t)bin * cairn_detect_layer(p)];

        for (int32_t y = 0; y < h; y++) {
            const float *from =
                &layer[(size_t)(y + dy + DETECT_MARGIN) * cairn_detect_row(p) + (size_t)(DETECT_MARGIN + dx)];
            float *to = &sum[y * w];

            for (int32_t x = 0; x < w; x++)
                to[x] += from[x];
        }
    }
}

static float peak_overlap(const detector *d, const detect_peak *a, const detect_peak *b)
{
    const detect_variant *v = &d->variant[a->variant], *u = &d->variant[b->variant];

    return cairn_detect_overlap(a->x + a->size * v->left, a->y + a->size * v->top, a->x + a->size * v->right,
                                a->y + a->size * v->bottom, b->x + b->size * u->left, b->y + b->size * u->top,
                                b->x + b->size * u->right, b->y + b->size * u->bottom);
}

/* The best peaks that do not lie on better ones come first. */
static void keep_candidates(detector *d)
{
    int32_t kept = 0;

    qsort(d->peaks, (size_t)d->count, sizeof *d->peaks, compare_peaks);
    for (int32_t i = 0; i < d->count && kept < d->field->params.candidates; i++) {
        int32_t apart = 1;

        for (int32_t k = 0; k < kept && apart; k++)
            apart = peak_overlap(d, &d->peaks[i], &d->peaks[k]) <= CANDIDATE_OVERLAP;
        if (apart)
            d->peaks[kept++] = d->peaks[i];
    }
    d->count = kept;
}

cairn_status cairn_detect_candidates_of_parts(detector *d)
{
    cairn_status status = cairn_detect_parts(&d->hypotheses, d->field, d->model);

    if (status != CAIRN_OK)
        return status;
    d->peaks = malloc((size_t)(d->hypotheses.count + 1) * sizeof *d->peaks);
    if (d->peaks == NULL)
        return CAIRN_NO_MEMORY;
    for (int32_t i = 0; i < d->hypotheses.count; i++) {
        const detect_hypothesis *h = &d->hypotheses.list[i];
        detect_peak *q = &d->peaks[d->count++];

        q->score = (float)h->score;
        q->rigid = 0;
        q->x = (float)h->origin.x;
        q->y = (float)h->origin.y;
        q->size = (float)h->size;
        q->turn = 0;
        q->variant = h->mirrored ? DETECT_ASPECTS : 0;
        q->hypothesis = i;
    }
    keep_candidates(d);
    return CAIRN_OK;
}

int cairn_detect_candidates_find(detector *d)
{
    float *sum = NULL;

    d->peaks = malloc(PEAKS_MOST * sizeof *d->peaks);
    for (int32_t k = 0; k < d->field->planes && d->peaks != NULL; k++) {
        const detect_plane *p = &d->field->plane[k];

        sum = malloc((size_t)p->width * (size_t)p->height * sizeof *sum);
        if (sum == NULL)
            return 0;
        for (int32_t i = 0; i < d->variants; i++) {
            correlate(d, p, &d->variant[i], sum);
            add_peaks(d, p, sum, i);
        }
        free(sum);
    }
    if (d->peaks == NULL)
        return 0;
    keep_candidates(d);
    return 1;
}
