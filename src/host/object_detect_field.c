/* What edges are worth for an outline, at every place of a picture and for every size.
 *
 * Method: for each size a grid of cells, which are a share of it. Every segment enters the directions near its own at a cost of the turn
 * and of its strength; least costs spread over a few sigmas, in rows, then in columns. What edges come to by chance is the mean over a
 * window somewhat larger than the object; a place is worth the logarithm of how much likelier its edge is with the object.
 *
 * Source: this project's, for the verification of Adluru 2008, section 5.3. */
#include "src/core/build.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/object_detect_work.h"

/* Sigmas: of the place, in cells, and of the direction, rad; a segment is no edge of directions beyond so many sigmas. */
#define SIGMA     1.0
#define TURN      0.35
#define TURN_MOST 2.2
/* Cells that a cost spreads, and half the window's side. */
enum { SPREAD = 3, WINDOW = 30 };
/* An edge stronger than a share s of all is 2 s times as likely on an object as elsewhere, but never less than this. */
#define WEAKEST 0.2
/* So likely an edge is by chance at least, and a piece of an outline has none. */
#define LEAST_CHANCE 0.02
#define HIDDEN       0.25
/* What an outline's piece outside the picture is worth. */
#define OUTSIDE (-0.7F)
/* Between sizes. */
#define SIZE_STEP 1.2
#define FAR       30.0F

enum { BINS = DETECT_BINS, MARGIN = DETECT_MARGIN };
/* Of params. */
enum {
    SIZE_LEAST = 8,
    SIZE_MOST = 2 * CAIRN_CONTOUR_SIDE_MOST,
    CANDIDATES_MOST = 64,
    MATCHES_MOST = 64,
    NEAREST_MOST = 64,
    WEIGHT_MOST = 1000,
    VERIFY_MOST = 100
};

typedef struct maker {
    float *cost;  /* [BINS][height][width] */
    double *sums; /* [(height + 1)][width + 1] */
    float *strip; /* a row or column with its margins */
} maker;

static void mark(const detect_plane *p, cairn_segment line, float *cost, float worth)
{
    double length = (double)cairn_segment_length(line);
    int32_t steps = 1 + (int32_t)(2 * length / (double)p->cell);

    for (int32_t k = 0; k <= steps; k++) {
        double t = (double)k / steps;
        int32_t x = (int32_t)floor(((double)line.a.x + t * (double)(line.b.x - line.a.x)) / (double)p->cell);
        int32_t y = (int32_t)floor(((double)line.a.y + t * (double)(line.b.y - line.a.y)) / (double)p->cell);

        if (x >= 0 && y >= 0 && x < p->width && y < p->height && worth < cost[y * p->width + x])
            cost[y * p->width + x] = worth;
    }
}

static void enter(const detect_plane *p, cairn_segment line, cairn_real strength, float *cost)
{
    double angle = atan2((double)(line.b.y - line.a.y), (double)(line.b.x - line.a.x));
    double strong = -log(fmax(WEAKEST, 2 * (double)strength));

    for (int32_t bin = 0; bin < BINS; bin++) {
        double turn = remainder(angle - (bin + 0.5) * ((double)CAIRN_PI / BINS), (double)CAIRN_PI) / TURN;

        if (fabs(turn) <= TURN_MOST)
            mark(p, line, &cost[(size_t)bin * (size_t)(p->width * p->height)], (float)(strong + turn * turn / 2));
    }
}

/* Least of the costs in reach of a row or column of `count` cells, `step` apart. */
static void spread_line(float *strip, float *cost, int32_t count, int32_t step)
{
    for (int32_t i = 0; i < SPREAD; i++)
        strip[i] = strip[count + SPREAD + i] = FAR;
    for (int32_t i = 0; i < count; i++)
        strip[SPREAD + i] = cost[i * step];
    for (int32_t i = 0; i < count; i++) {
        float least = strip[SPREAD + i];

        for (int32_t k = 1; k <= SPREAD; k++) {
            float near = strip[SPREAD + i - k] < strip[SPREAD + i + k] ? strip[SPREAD + i - k] : strip[SPREAD + i + k];

            near += (float)(k * k / (2 * SIGMA * SIGMA));
            least = near < least ? near : least;
        }
        cost[i * step] = least;
    }
}

/* Costs become likelihoods, with their sums over all cells above and to the left. */
static void sum_up(const detect_plane *p, float *cost, double *sums)
{
    int32_t w = p->width;

    memset(sums, 0, (size_t)(w + 1) * sizeof *sums);
    for (int32_t y = 0; y < p->height; y++) {
        double row = 0;

        sums[(y + 1) * (w + 1)] = 0;
        for (int32_t x = 0; x < w; x++) {
            cost[y * w + x] = expf(-cost[y * w + x]);
            row += (double)cost[y * w + x];
            sums[(y + 1) * (w + 1) + x + 1] = sums[y * (w + 1) + x + 1] + row;
        }
    }
}

static void weigh(const detect_plane *p, const float *likely, const double *sums, float *worth)
{
    int32_t w = p->width, h = p->height;

    for (int32_t y = 0; y < h; y++) {
        int32_t above = y > WINDOW ? y - WINDOW : 0, below = y + WINDOW < h ? y + WINDOW : h;
        float *row = &worth[(size_t)(y + MARGIN) * cairn_detect_row(p) + MARGIN];

        for (int32_t x = 0; x < w; x++) {
            int32_t left = x > WINDOW ? x - WINDOW : 0, right = x + WINDOW < w ? x + WINDOW : w;
            double sum = sums[below * (w + 1) + right] - sums[above * (w + 1) + right] - sums[below * (w + 1) + left] +
                         sums[above * (w + 1) + left];
            double chance = fmax(LEAST_CHANCE, sum / ((double)(below - above) * (right - left)));

            row[x] = logf((float)(HIDDEN + (1 - HIDDEN) * (double)likely[y * w + x] / chance));
        }
    }
}

/* 0: there is no memory. */
static int make_plane(detect_plane *p, const cairn_contour_tokens *tokens, maker *m)
{
    int32_t w = p->width, h = p->height, longest = w > h ? w : h;
    size_t cells = (size_t)w * (size_t)h;

    p->worth = malloc(BINS * cairn_detect_layer(p) * sizeof *p->worth);
    m->cost = calloc(BINS * cells, sizeof *m->cost);
    m->sums = malloc(((size_t)w + 1) * ((size_t)h + 1) * sizeof *m->sums);
    m->strip = malloc(((size_t)longest + 2 * SPREAD) * sizeof *m->strip);
    if (p->worth == NULL || m->cost == NULL || m->sums == NULL || m->strip == NULL)
        return 0;
    for (size_t i = 0; i < BINS * cells; i++)
        m->cost[i] = FAR;
    for (size_t i = 0; i < BINS * cairn_detect_layer(p); i++)
        p->worth[i] = OUTSIDE;
    for (int32_t i = 0; i < tokens->count; i++)
        enter(p, tokens->lines[i], tokens->strength[i], m->cost);
    for (int32_t bin = 0; bin < BINS; bin++) {
        float *cost = &m->cost[(size_t)bin * cells];

        for (int32_t y = 0; y < h; y++)
            spread_line(m->strip, &cost[y * w], w, 1);
        for (int32_t x = 0; x < w; x++)
            spread_line(m->strip, &cost[x], h, w);
        sum_up(p, cost, m->sums);
        weigh(p, cost, m->sums, &p->worth[(size_t)bin * cairn_detect_layer(p)]);
    }
    return 1;
}

static cairn_status check_parts(const cairn_object_detect_params *p, const char *path, cairn_file_error *error)
{
    if (p->method < CAIRN_DETECT_EVIDENCE || p->method > CAIRN_DETECT_PARTS)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0, "method %" PRId32 ", expected 0 or 1",
                                    p->method);
    if (p->bundles < CAIRN_DETECT_BUNDLES || p->bundles > CAIRN_DETECT_NO_BUNDLES)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0, "bundles %" PRId32 ", expected 0 to 2",
                                    p->bundles);
    if (p->mode != CAIRN_MODE_DEFAULT && p->mode != CAIRN_MODE_AS_WRITTEN)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0, "mode %" PRId32 ", expected 0 or 1", p->mode);
    if (p->appearance_nearest != 0 && (p->appearance_nearest != 1 || p->mode != CAIRN_MODE_AS_WRITTEN))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "appearance_nearest %" PRId32 ", expected 0, or 1 as written",
                                    p->appearance_nearest);
    if (p->mode == CAIRN_MODE_AS_WRITTEN && (p->method != CAIRN_DETECT_PARTS || p->bundles != CAIRN_DETECT_BUNDLES ||
                                             p->modes || p->occluded || p->verify > 0))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "as written by another method, with other bundles, modes, occluded or verify, "
                                    "which the thesis does not have, expected parts without them");
    if (p->matches < 1 || p->matches > MATCHES_MOST || p->nearest < 1 || p->nearest > NEAREST_MOST)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "%" PRId32 " matches and %" PRId32 " nearest votes, expected 1 to %d and 1 to %d",
                                    p->matches, p->nearest, MATCHES_MOST, NEAREST_MOST);
    return CAIRN_OK;
}

static cairn_status check_params(const cairn_object_detect_params *p, const cairn_contour_tokens *tokens,
                                 const char *path, cairn_file_error *error)
{
    int32_t longer = tokens->width > tokens->height ? tokens->width : tokens->height;
    double least = (double)longer * DETECT_CELLS / DETECT_SIDE_MOST;

    if (!(p->min_size >= SIZE_LEAST && p->min_size <= SIZE_MOST))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0, "min_size %g, expected %d to %d pixels",
                                    (double)p->min_size, SIZE_LEAST, SIZE_MOST);
    if (!(p->max_size >= p->min_size && p->max_size <= SIZE_MOST))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0, "max_size %g, expected %g to %d pixels",
                                    (double)p->max_size, (double)p->min_size, SIZE_MOST);
    if (!((double)p->min_size >= least))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "min_size %g in a picture of %" PRId32 " pixels, expected at least %g",
                                    (double)p->min_size, longer, least);
    if (p->candidates < 1 || p->candidates > CANDIDATES_MOST)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0, "%" PRId32 " candidates, expected 1 to %d",
                                    p->candidates, CANDIDATES_MOST);
    if (!(p->overlap >= 0 && p->overlap <= 1))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0, "overlap %g, expected 0 to 1",
                                    (double)p->overlap);
    if (!cairn_is_finite(p->min_score))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0, "min_score %g, expected a finite one",
                                    (double)p->min_score);
    if (!(p->appearance_weight >= 0 && p->appearance_weight <= WEIGHT_MOST))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0, "appearance_weight %g, expected 0 to %d",
                                    (double)p->appearance_weight, WEIGHT_MOST);
    if (!(p->verify >= 0 && p->verify <= VERIFY_MOST))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0, "verify %g, expected 0 to %d",
                                    (double)p->verify, VERIFY_MOST);
    return check_parts(p, path, error);
}

/* As many sizes as there are up to the largest. */
static int32_t planes_of(const cairn_object_detect_params *p)
{
    int32_t planes = 1 + (int32_t)(log((double)(p->max_size / p->min_size)) / log(SIZE_STEP) + 1e-6);

    CAIRN_ASSERT(planes <= DETECT_PLANES);
    return planes;
}

cairn_status cairn_detect_field_make(cairn_detect_field **field, const cairn_contour_tokens *tokens,
                                     const cairn_object_detect_params *params, const char *path,
                                     cairn_file_error *error)
{
    cairn_status status = check_params(params, tokens, path, error);
    cairn_detect_field *f;
    int ok = 1;

    *field = NULL;
    if (status != CAIRN_OK)
        return status;
    f = calloc(1, sizeof *f);
    if (f == NULL)
        return cairn_file_error_system(error, path, "detect", ENOMEM);
    f->tokens = tokens;
    f->params = *params;
    if (params->method == CAIRN_DETECT_PARTS)
        ok = cairn_detect_chains_make(&f->chains, tokens);
    for (int32_t k = 0; params->method == CAIRN_DETECT_EVIDENCE && k < planes_of(params) && ok; k++) {
        detect_plane *p = &f->plane[f->planes++];
        maker m = {NULL, NULL, NULL};

        p->size = params->min_size * (cairn_real)pow(SIZE_STEP, k);
        p->cell = p->size / DETECT_CELLS;
        p->width = 1 + (int32_t)((double)tokens->width / (double)p->cell);
        p->height = 1 + (int32_t)((double)tokens->height / (double)p->cell);
        ok = make_plane(p, tokens, &m);
        free(m.cost);
        free(m.sums);
        free(m.strip);
    }
    if (!ok) {
        cairn_detect_field_free(f);
        return cairn_file_error_system(error, path, "detect", ENOMEM);
    }
    *field = f;
    return CAIRN_OK;
}

void cairn_detect_field_free(cairn_detect_field *field)
{
    for (int32_t k = 0; field != NULL && k < field->planes; k++)
        free(field->plane[k].worth);
    if (field != NULL)
        cairn_detect_chains_free(&field->chains);
    free(field);
}
