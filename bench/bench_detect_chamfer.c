/* Plain oriented chamfer matching: for each of eight directions the clipped distance to the nearest
 * edge; the mean over the model's samples at every position, scale and aspect ratio; local minima
 * are the detections. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/contour_search_run.h"
#include "bench/bench_detect.h"

enum { CHANNELS = 8, SIZES = 9, ASPECTS = 3, STEP = 4, MAX_DETECTIONS = 64, MAX_PEAKS = 1 << 15 };

/* Clipping distance as a share of the size; penalty of a direction that is one channel off, in
 * px. */
#define CLIP_SHARE  0.06
#define MAX_OVERLAP 0.2
#define DIAGONAL    1.41421356F

typedef struct matcher {
    const group_image *image;
    const cairn_shape_model *model;
    float *distance; /* [CHANNELS][height][width] px */
    cairn_object_detection *peaks;
    int32_t count, seen;
} matcher;

static int32_t channel_of(double angle)
{
    return (int32_t)floor(fmod(angle + 2 * 3.14159265358979, 3.14159265358979) / 3.14159265358979 *
                          CHANNELS) %
           CHANNELS;
}

static float least(float a, float b)
{
    return a < b ? a : b;
}

/* Two passes of distances over the eight neighbours. */
static void spread(float *d, int32_t w, int32_t h)
{
    for (int pass = 0; pass < 2; pass++)
        for (int32_t k = 0; k < w * h; k++) {
            int32_t i = pass == 0 ? k : w * h - 1 - k, x = i % w, y = i / w, s = pass == 0 ? -1 : 1;
            int has_side = x + s >= 0 && x + s < w, has_line = y + s >= 0 && y + s < h;

            if (has_side)
                d[i] = least(d[i], d[i + s] + 1);
            if (has_line)
                d[i] = least(d[i], d[i + s * w] + 1);
            if (has_line && has_side)
                d[i] = least(d[i], d[i + s * w + s] + DIAGONAL);
            if (has_line && x - s >= 0 && x - s < w)
                d[i] = least(d[i], d[i + s * w - s] + DIAGONAL);
        }
}

/* Every segment enters its channel and the nearer neighbouring one. */
static int make_channels(matcher *m)
{
    int32_t w = m->image->width, h = m->image->height;
    cairn_raster_u8_view view = {m->image->edges, w, h, w};
    cairn_contour_search_tokens tokens;
    cairn_file_error error;

    if (cairn_contour_search_run_tokens(&tokens, view, 1, 0, m->image->name, &error) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < CHANNELS * w * h; i++)
        m->distance[i] = 1e6F;
    for (int32_t i = 0; i < tokens.count; i++) {
        cairn_segment line = tokens.lines[i];
        double dx = (double)(line.b.x - line.a.x), dy = (double)(line.b.y - line.a.y),
               angle = atan2(dy, dx);
        int32_t steps = 1 + (int32_t)(2 * hypot(dx, dy));

        for (int32_t k = 0; k <= steps; k++) {
            int32_t x = (int32_t)lrint((double)line.a.x + dx * k / steps);
            int32_t y = (int32_t)lrint((double)line.a.y + dy * k / steps);

            for (int32_t turn = -1; turn <= 1 && x >= 0 && y >= 0 && x < w && y < h; turn += 2) {
                double beside = angle + turn * 3.14159265358979 / (2.0 * CHANNELS);

                m->distance[(channel_of(beside) * h + y) * w + x] = 0;
            }
        }
    }
    for (int32_t c = 0; c < CHANNELS; c++)
        spread(&m->distance[c * w * h], w, h);
    cairn_contour_search_run_free_tokens(&tokens);
    return 1;
}

static int compare_peaks(const void *a, const void *b)
{
    const cairn_object_detection *x = a, *y = b;

    if (x->score != y->score)
        return x->score < y->score ? 1 : -1;
    return x->first_outline - y->first_outline;
}

/* Storage for a peak; when it is full the worse half is dropped. */
static cairn_object_detection *next_peak(matcher *m)
{
    if (m->count == MAX_PEAKS) {
        qsort(m->peaks, (size_t)m->count, sizeof *m->peaks, compare_peaks);
        m->count /= 2;
    }
    return &m->peaks[m->count++];
}

/* The model at one size and proportion at every STEP-th place. */
static void match(matcher *m, double size, double aspect, int32_t mirrored)
{
    int32_t w = m->image->width, h = m->image->height, n = m->model->outline_count;
    double wide = sqrt(aspect) * size * (mirrored ? -1 : 1), tall = size / sqrt(aspect), half_x = 0,
           half_y = 0;
    float cut = (float)(CLIP_SHARE * size);

    for (int32_t i = 0; i < n; i++) {
        half_x = fmax(half_x, fabs(wide * (double)m->model->outline[i].position.x));
        half_y = fmax(half_y, fabs(tall * (double)m->model->outline[i].position.y));
    }
    for (int32_t y = 0; y < h; y += STEP)
        for (int32_t x = 0; x < w; x += STEP) {
            cairn_object_detection *d;
            double sum = 0;

            for (int32_t i = 0; i < n && sum < 0.6 * n * (double)cut; i++) {
                const cairn_oriented_point *o = &m->model->outline[i];
                int32_t u = x + (int32_t)lrint(wide * (double)o->position.x);
                int32_t v = y + (int32_t)lrint(tall * (double)o->position.y);
                int32_t c =
                    channel_of(atan2(tall * (double)o->direction.y, wide * (double)o->direction.x));

                sum += u >= 0 && v >= 0 && u < w && v < h
                           ? (double)least(cut, m->distance[(c * h + v) * w + u])
                           : (double)cut;
            }
            if (sum >= 0.6 * n * (double)cut)
                continue;
            d = next_peak(m);
            memset(d, 0, sizeof *d);
            d->left = (cairn_real)(x - half_x);
            d->right = (cairn_real)(x + half_x);
            d->top = (cairn_real)(y - half_y);
            d->bottom = (cairn_real)(y + half_y);
            d->score = (cairn_real)(-sum / (n * (double)cut));
            d->mirrored = mirrored;
            d->first_outline = m->seen++;
        }
}

static double shared(const cairn_object_detection *a, const cairn_object_detection *b)
{
    double w = fmin((double)a->right, (double)b->right) - fmax((double)a->left, (double)b->left);
    double h = fmin((double)a->bottom, (double)b->bottom) - fmax((double)a->top, (double)b->top);
    double both = w > 0 && h > 0 ? w * h : 0;

    return both / ((double)(a->right - a->left) * (double)(a->bottom - a->top) +
                   (double)(b->right - b->left) * (double)(b->bottom - b->top) - both);
}

static void keep_best(matcher *m)
{
    int32_t kept = 0;

    qsort(m->peaks, (size_t)m->count, sizeof *m->peaks, compare_peaks);
    for (int32_t i = 0; i < m->count && kept < MAX_DETECTIONS; i++) {
        int32_t apart = 1;

        for (int32_t k = 0; k < kept && apart; k++)
            apart = shared(&m->peaks[i], &m->peaks[k]) <= MAX_OVERLAP;
        if (apart)
            m->peaks[kept++] = m->peaks[i];
    }
    m->count = kept;
}

int32_t detect_chamfer(const group_image *image, const cairn_shape_model *model,
                       cairn_object_detection **found)
{
    static const double aspects[ASPECTS] = {0.8, 1, 1.25};
    matcher m = {image, model, NULL, NULL, 0, 0};
    double diagonal = hypot(image->width, image->height);
    int ok;

    m.distance = malloc((size_t)CHANNELS * (size_t)image->width * (size_t)image->height *
                        sizeof *m.distance);
    m.peaks = malloc(MAX_PEAKS * sizeof *m.peaks);
    ok = m.distance != NULL && m.peaks != NULL && make_channels(&m);
    for (int32_t k = 0; k < SIZES && ok; k++)
        for (int32_t i = 0; i < 2 * ASPECTS; i++)
            match(&m, diagonal * 0.8 * pow(0.79, SIZES - 1 - k), aspects[i % ASPECTS], i / ASPECTS);
    free(m.distance);
    if (!ok) {
        free(m.peaks);
        return -1;
    }
    keep_best(&m);
    *found = m.peaks;
    return m.count;
}
