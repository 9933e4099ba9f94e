/* Outlines of an object from a picture of it.
 *
 * Method: ink is told from background at the middle between the darkest and the brightest pixel,
 * drawings from silhouettes by the greatest thickness of their ink. The outside is flooded from the
 * rim; other faces of the background are holes, but for the largest face of each part of a drawing,
 * which is its inside. Outlines run along the sides of the pixels, outside of a drawing's lines.
 *
 * Limits: one object a picture: all its parts are the object's. A drawing within a drawing
 * (spots of a giraffe) makes holes. */
#include "src/core/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/shape_image_work.h"

/* Ink thinner than this, of the diagonal of all ink, is lines. */
#define LINE_SHARE     0.02
#define LEAST_DIAGONAL 16

/* A region that gets an outline. */
typedef struct region {
    int32_t label, first; /* its first pixel */
    int32_t area;
    int32_t is_hole;
} region;

cairn_shape_image_params cairn_shape_image_default(void)
{
    cairn_shape_image_params params = {CAIRN_SHAPE_HOLES_KEEP, 0.1, 0.01};

    return params;
}

void cairn_shape_image_free(cairn_shape_image *image)
{
    free(image->points);
    memset(image, 0, sizeof *image);
}

/* ---- Ink ---- */

/* 1 when most of the rim is bright. */
static int has_bright_rim(cairn_raster_u8_view grey, int32_t middle)
{
    int64_t bright = 0, all = 0;

    for (int32_t y = 0; y < grey.height; y++)
        for (int32_t x = 0; x < grey.width;
             x += y == 0 || y == grey.height - 1 || grey.width == 1 ? 1 : grey.width - 1) {
            bright += grey.data[y * grey.stride + x] > middle;
            all++;
        }
    return 2 * bright > all;
}

/* Ink in the middle of the rim, and the box about it; 0: there is none. */
static int find_ink(shape_picture *p, cairn_raster_u8_view grey, double *diagonal)
{
    int32_t least = 255, most = 0, left = grey.width, right = -1, top = grey.height, bottom = -1,
            middle, bright;

    for (int32_t y = 0; y < grey.height; y++)
        for (int32_t x = 0; x < grey.width; x++) {
            int32_t v = grey.data[y * grey.stride + x];

            least = v < least ? v : least;
            most = v > most ? v : most;
        }
    middle = (least + most) / 2;
    bright = has_bright_rim(grey, middle);
    memset(p->ink, 0, (size_t)p->width * (size_t)p->height);
    for (int32_t y = 0; y < grey.height && least < most; y++)
        for (int32_t x = 0; x < grey.width; x++)
            if ((grey.data[y * grey.stride + x] > middle) != bright) {
                p->ink[(y + 1) * p->width + x + 1] = 1;
                left = x < left ? x : left;
                right = x > right ? x : right;
                top = y < top ? y : top;
                bottom = y;
            }
    *diagonal = right < 0 ? 0 : hypot(right - left + 1, bottom - top + 1);
    return right >= 0;
}

/* The greatest distance (L1) of ink from what is none, in pixels; distances are laid out in
 * part[]. */
static int32_t thickness(const shape_picture *p)
{
    int32_t most = 0, n = p->width * p->height, *far = p->part;

    for (int32_t i = 0; i < n; i++)
        far[i] =
            !p->ink[i] ? 0 : 1 + (far[i - 1] < far[i - p->width] ? far[i - 1] : far[i - p->width]);
    for (int32_t i = n - 1; i >= 0; i--)
        if (p->ink[i]) {
            int32_t near = 1 + (far[i + 1] < far[i + p->width] ? far[i + 1] : far[i + p->width]);

            far[i] = near < far[i] ? near : far[i];
            most = far[i] > most ? far[i] : most;
        }
    return most;
}

/* ---- Regions ---- */

/* Labels a region from a pixel: all pixels whose label is `from`, over sides or corners, too. */
static void flood(const shape_picture *p, int32_t *labels, int32_t at, int32_t from, int32_t to,
                  int32_t corners)
{
    static const int8_t near[8][2] = {{1, 0}, {-1, 0}, {0, 1},  {0, -1},
                                      {1, 1}, {-1, 1}, {1, -1}, {-1, -1}};
    int32_t waiting = 0;

    labels[at] = to;
    p->stack[waiting++] = at;
    while (waiting > 0) {
        int32_t i = p->stack[--waiting], x = i % p->width, y = i / p->width;

        for (int32_t k = 0; k < (corners ? 8 : 4); k++) {
            int32_t u = x + near[k][0], v = y + near[k][1], j = v * p->width + u;

            if (u >= 0 && v >= 0 && u < p->width && v < p->height && labels[j] == from) {
                labels[j] = to;
                p->stack[waiting++] = j;
            }
        }
    }
}

/* Puts a region behind the larger ones of its kind; what has no room is counted. */
static void add_region(region *regions, int32_t *count, int32_t *beyond, region r)
{
    int32_t at = *count;

    if (at == CAIRN_SHAPE_OUTLINES) {
        ++*beyond;
        return;
    }
    for (; at > 0 && regions[at - 1].is_hole == r.is_hole && regions[at - 1].area < r.area; at--)
        regions[at] = regions[at - 1];
    regions[at] = r;
    ++*count;
}

/* Floods face[] and part[]; *parts, *faces: how many. */
static void label_all(shape_picture *p, int32_t *parts, int32_t *faces)
{
    enum { UNKNOWN = -2 };
    int32_t n = p->width * p->height;

    for (int32_t i = 0; i < n; i++)
        p->face[i] = p->ink[i] ? -1 : UNKNOWN;
    flood(p, p->face, 0, UNKNOWN, 0, 0);
    *faces = *parts = 0;
    for (int32_t i = 0; i < n; i++)
        if (p->face[i] == UNKNOWN)
            flood(p, p->face, i, UNKNOWN, ++*faces, 0);
    for (int32_t i = 0; i < n; i++)
        p->part[i] = p->face[i] == 0 ? 0 : UNKNOWN;
    for (int32_t i = 0; i < n; i++)
        if (p->part[i] == UNKNOWN)
            flood(p, p->part, i, UNKNOWN, ++*parts, 1);
}

/* What is known of a label. */
typedef struct census {
    int32_t area, first; /* -1: not seen yet */
    int32_t ink;         /* of a part */
    int32_t inside;      /* of a part of a drawing: its largest face */
    int32_t part;        /* of a face */
} census;

static void count_labels(const shape_picture *p, census *part, int32_t parts, census *face,
                         int32_t faces)
{
    for (int32_t i = 0; i <= parts; i++)
        part[i].first = -1;
    for (int32_t i = 0; i <= faces; i++)
        face[i].first = -1;
    for (int32_t i = 0; i < p->width * p->height; i++) {
        census *a = &part[p->part[i]], *f = p->face[i] > 0 ? &face[p->face[i]] : NULL;

        a->first = a->first < 0 ? i : a->first;
        a->area++;
        a->ink += p->ink[i];
        if (f != NULL) {
            f->first = f->first < 0 ? i : f->first;
            f->area++;
            f->part = p->part[i];
        }
    }
    for (int32_t i = 1; i <= faces; i++)
        if (part[face[i].part].inside == 0 || face[part[face[i].part].inside].area < face[i].area)
            part[face[i].part].inside = i;
}

/* Parts of lines that enclose less than the lines themselves cover are not closed. */
static int is_closed(const census *part, const census *face)
{
    return part->inside > 0 && face[part->inside].area >= part->ink / 2;
}

static cairn_status not_closed(const shape_picture *p)
{
    return cairn_file_error_set(
        p->error, CAIRN_BAD_FORMAT, p->path, 0,
        "lines that enclose nothing, expected a silhouette, or an outline that closes but for "
        "small gaps");
}

/* Which regions get outlines: parts, then holes. */
static cairn_status choose(const shape_picture *p, const cairn_shape_image_params *params,
                           const census *part, int32_t parts, const census *face, int32_t faces,
                           cairn_shape_image *image, region *regions)
{
    int32_t largest = 0, beyond = 0;

    for (int32_t i = 1; i <= parts; i++)
        if ((!image->is_drawing || is_closed(&part[i], face)) && part[i].area > largest)
            largest = part[i].area;
    if (largest == 0)
        return not_closed(p);
    for (int32_t i = 1; i <= parts; i++) {
        region r = {i, part[i].first, part[i].area, 0};

        if (part[i].area < params->min_part * largest ||
            (image->is_drawing && !is_closed(&part[i], face)))
            image->specks++;
        else
            add_region(regions, &image->count, &beyond, r);
    }
    for (int32_t i = 1; i <= faces && params->holes != CAIRN_SHAPE_HOLES_FILL; i++) {
        region r = {i, face[i].first, face[i].area, 1};

        if (image->is_drawing && part[face[i].part].inside == i)
            continue;
        if (face[i].area < params->min_part * largest) {
            image->specks++;
            continue;
        }
        if (params->holes == CAIRN_SHAPE_HOLES_REFUSE)
            return cairn_file_error_set(
                p->error, CAIRN_UNSUPPORTED, p->path, 0,
                "a hole of %d pixels at (%d, %d), expected an object without holes", (int)r.area,
                (int)(r.first % p->width - 1), (int)(r.first / p->width - 1));
        image->holes += image->count < CAIRN_SHAPE_OUTLINES;
        add_region(regions, &image->count, &beyond, r);
    }
    if (beyond > 0)
        return cairn_file_error_set(p->error, CAIRN_FULL, p->path, 0,
                                    "%d parts and holes, expected one object of at most %d",
                                    (int)(image->count + beyond), CAIRN_SHAPE_OUTLINES);
    return CAIRN_OK;
}

/* ---- All of it ---- */

static cairn_status trace_regions(const shape_picture *p, const region *regions,
                                  cairn_shape_image *image)
{
    int32_t counts[CAIRN_SHAPE_OUTLINES], sum = 0;

    for (int32_t i = 0; i < image->count; i++) {
        const region *r = &regions[i];

        counts[i] = cairn_shape_image_outline(p, r->is_hole ? p->face : p->part, r->label,
                                              !r->is_hole, r->first, NULL);
        sum += counts[i];
    }
    image->points = malloc(((size_t)sum + 1) * sizeof *image->points);
    if (image->points == NULL)
        return cairn_file_error_system(p->error, p->path, "trace", ENOMEM);
    sum = 0;
    for (int32_t i = 0; i < image->count; i++) {
        const region *r = &regions[i];
        cairn_vec2 *points = &image->points[sum];

        sum += cairn_shape_image_outline(p, r->is_hole ? p->face : p->part, r->label, !r->is_hole,
                                         r->first, points);
        image->outlines[i].points = points;
        image->outlines[i].count = counts[i];
        image->outlines[i].closed = 1;
    }
    return CAIRN_OK;
}

static cairn_status choose_and_trace(shape_picture *p, const cairn_shape_image_params *params,
                                     cairn_shape_image *image)
{
    region regions[CAIRN_SHAPE_OUTLINES] = {{0, 0, 0, 0}};
    int32_t parts, faces;
    cairn_status status;
    census *part, *face;

    label_all(p, &parts, &faces);
    part = calloc((size_t)parts + 1, sizeof *part);
    face = calloc((size_t)faces + 1, sizeof *face);
    if (part != NULL && face != NULL) {
        count_labels(p, part, parts, face, faces);
        status = choose(p, params, part, parts, face, faces, image, regions);
    } else {
        status = cairn_file_error_system(p->error, p->path, "trace", ENOMEM);
    }
    free(part);
    free(face);
    return status == CAIRN_OK ? trace_regions(p, regions, image) : status;
}

static cairn_status trace_picture(shape_picture *p, cairn_raster_u8_view grey,
                                  const cairn_shape_image_params *params, cairn_shape_image *image)
{
    double diagonal;
    cairn_status status = CAIRN_OK;

    if (!find_ink(p, grey, &diagonal))
        return cairn_file_error_set(
            p->error, CAIRN_EMPTY, p->path, 0,
            "%d x %d pixels of one colour, expected a silhouette or a drawing", (int)grey.width,
            (int)grey.height);
    if (diagonal < LEAST_DIAGONAL)
        return cairn_file_error_set(
            p->error, CAIRN_EMPTY, p->path, 0,
            "an object of %.0f pixels along its diagonal, expected at least %d", diagonal,
            LEAST_DIAGONAL);
    image->is_drawing = thickness(p) <= fmax(2, LINE_SHARE * diagonal);
    if (image->is_drawing)
        status = cairn_shape_image_join(p, params->max_gap * diagonal, image);
    return status == CAIRN_OK ? choose_and_trace(p, params, image) : status;
}

cairn_status cairn_shape_image_trace(cairn_shape_image *image, cairn_raster_u8_view grey,
                                     const cairn_shape_image_params *params, const char *path,
                                     cairn_file_error *error)
{
    shape_picture p = {0, 0, NULL, NULL, NULL, NULL, path, error};
    cairn_status status;
    size_t pixels;

    memset(image, 0, sizeof *image);
    if (cairn_raster_u8_check(grey) != CAIRN_OK || params == NULL ||
        params->holes < CAIRN_SHAPE_HOLES_KEEP || params->holes > CAIRN_SHAPE_HOLES_REFUSE ||
        !(params->max_gap >= 0) || !(params->max_gap <= 1) || !(params->min_part >= 0) ||
        !(params->min_part <= 1))
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "not to be traced, expected a picture, gaps and parts from 0 to 1");
    if (grey.width > CAIRN_SHAPE_IMAGE_SIDE_MOST || grey.height > CAIRN_SHAPE_IMAGE_SIDE_MOST)
        return cairn_file_error_set(error, CAIRN_FULL, path, 0,
                                    "%d x %d pixels, expected at most %d a side", (int)grey.width,
                                    (int)grey.height, CAIRN_SHAPE_IMAGE_SIDE_MOST);
    p.width = grey.width + 2;
    p.height = grey.height + 2;
    pixels = (size_t)p.width * (size_t)p.height;
    p.ink = malloc(pixels);
    p.face = malloc(pixels * sizeof *p.face);
    p.part = malloc(pixels * sizeof *p.part);
    p.stack = malloc(pixels * sizeof *p.stack);
    if (p.ink != NULL && p.face != NULL && p.part != NULL && p.stack != NULL)
        status = trace_picture(&p, grey, params, image);
    else
        status = cairn_file_error_system(error, path, "trace", ENOMEM);
    free(p.ink);
    free(p.face);
    free(p.part);
    free(p.stack);
    if (status != CAIRN_OK)
        cairn_shape_image_free(image);
    return status;
}
