/* Contours of an object from a picture of it.
 *
 * Method
 * 1. Binarization: the threshold is the middle between the darkest and the brightest pixel.
 * 2. Silhouette or drawing: the maximum of the distance transform of the ink decides.
 * 3. Connected-component labelling: the outside is flooded from the border. Other background faces
 *    are holes, except for the largest face of each component of a drawing, which is its interior.
 * 4. Components and holes are filtered by area, and their boundaries are traced along pixel edges,
 *    of drawings outside of their lines.
 *
 * Limits: one object a picture; all components belong to it. A drawing within a drawing (the dots
 * of a giraffe) yields holes. */
#include "src/base/build.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/images/shape_image_work.h"

/* Ink up to this half thickness, as a fraction of its diagonal, is a line drawing. */
#define MAX_LINE_FRACTION 0.02
/* Smallest object, in pixels along its diagonal. */
#define MIN_DIAGONAL_PIXELS 16

/* A picture of which more is neither dark nor bright is a photograph. */
#define MAX_SHARE_BETWEEN 0.25
/* So is one of which this share is, with more specks than that beside its object: of the photographs
 * of apple logos, bottles and giraffes of the ETHZ shape classes those that pass the first rule have
 * 85 specks or more; drawings and silhouettes have shares below 0.04 (chosen on these, tried on mugs,
 * swans, horses and scenes: six of the seven left are found, and no drawing). */
#define MIN_SHARE_BETWEEN 0.05
enum { MAX_SPECKS = 30 };

/* What helps with a photograph. */
#define GRAB "cairn model --grab x,y,w,h cuts the object out of that box"

/* A region that gets an outline. */
typedef struct region {
    int32_t label, first; /* first: index of its first pixel in row order */
    int32_t area;         /* pixels */
    int32_t is_hole;
} region;

cairn_shape_image_params cairn_shape_image_default(void)
{
    cairn_shape_image_params params = {.holes = CAIRN_SHAPE_IMAGE_HOLES_KEEP,
                                       .max_gap = 0.1,
                                       .min_part = 0.01,
                                       .max_side = CAIRN_SHAPE_IMAGE_MAX_SIDE};

    return params;
}

void cairn_shape_image_free(cairn_shape_image *image)
{
    free(image->points);
    memset(image, 0, sizeof *image);
}

/* ---- Ink ---- */

/* Returns 1 when most pixels of the border are brighter than the threshold. */
static int has_bright_border(cairn_raster_u8_view grey, int32_t threshold)
{
    int64_t bright = 0, all = 0;

    for (int32_t y = 0; y < grey.height; y++)
        for (int32_t x = 0; x < grey.width;
             x += y == 0 || y == grey.height - 1 || grey.width == 1 ? 1 : grey.width - 1) {
            bright += grey.data[y * grey.stride + x] > threshold;
            all++;
        }
    return 2 * bright > all;
}

/* Returns the share of pixels that are neither dark nor bright: in the middle half of the greys. */
static double share_between(cairn_raster_u8_view grey)
{
    int32_t darkest = 255, brightest = 0;
    int64_t between = 0;

    for (int32_t pass = 0; pass < 2; pass++)
        for (int32_t y = 0; y < grey.height; y++)
            for (int32_t x = 0; x < grey.width; x++) {
                int32_t value = grey.data[y * grey.stride + x], range = brightest - darkest;

                if (pass == 0) {
                    darkest = value < darkest ? value : darkest;
                    brightest = value > brightest ? value : brightest;
                } else {
                    between += 4 * (value - darkest) > range && 4 * (brightest - value) > range;
                }
            }
    return (double)between / ((double)grey.width * grey.height);
}

/* Binarizes the picture into ink within the border, and returns the diagonal of the ink's bounding
 * box in pixels; 0: there is no ink. */
static int binarize(shape_picture *picture, cairn_raster_u8_view grey, double *diagonal)
{
    int32_t darkest = 255, brightest = 0, left = grey.width, right = -1, top = grey.height,
            bottom = -1, threshold, bright;

    for (int32_t y = 0; y < grey.height; y++)
        for (int32_t x = 0; x < grey.width; x++) {
            int32_t value = grey.data[y * grey.stride + x];

            darkest = value < darkest ? value : darkest;
            brightest = value > brightest ? value : brightest;
        }
    threshold = (darkest + brightest) / 2;
    bright = has_bright_border(grey, threshold);
    memset(picture->ink, 0, (size_t)picture->width * (size_t)picture->height);
    for (int32_t y = 0; y < grey.height && darkest < brightest; y++)
        for (int32_t x = 0; x < grey.width; x++)
            if ((grey.data[y * grey.stride + x] > threshold) != bright) {
                picture->ink[(y + 1) * picture->width + x + 1] = 1;
                left = x < left ? x : left;
                right = x > right ? x : right;
                top = y < top ? y : top;
                bottom = y;
            }
    *diagonal = right < 0 ? 0 : hypot(right - left + 1, bottom - top + 1);
    return right >= 0;
}

/* Returns the maximum of the distance transform of the ink (L1, two passes), in pixels. The
 * distances are stored in part[]. */
static int32_t max_thickness(const shape_picture *picture)
{
    int32_t most = 0, n = picture->width * picture->height, *distance = picture->part;

    for (int32_t i = 0; i < n; i++)
        distance[i] = !picture->ink[i] ? 0
                                       : 1 + (distance[i - 1] < distance[i - picture->width]
                                                  ? distance[i - 1]
                                                  : distance[i - picture->width]);
    for (int32_t i = n - 1; i >= 0; i--)
        if (picture->ink[i]) {
            int32_t back =
                1 + (distance[i + 1] < distance[i + picture->width] ? distance[i + 1]
                                                                    : distance[i + picture->width]);

            distance[i] = back < distance[i] ? back : distance[i];
            most = distance[i] > most ? distance[i] : most;
        }
    return most;
}

/* ---- Regions ---- */

/* Flood fill: labels the connected region of pixels with the label `from`, with 4-connectivity or,
 * with `corners`, 8-connectivity. */
static void flood(const shape_picture *picture, int32_t *labels, int32_t at, int32_t from,
                  int32_t to, int32_t corners)
{
    static const int8_t neighbours[8][2] = {{1, 0}, {-1, 0}, {0, 1},  {0, -1},
                                            {1, 1}, {-1, 1}, {1, -1}, {-1, -1}};
    int32_t waiting = 0;

    labels[at] = to;
    picture->stack[waiting++] = at;
    while (waiting > 0) {
        int32_t i = picture->stack[--waiting], x = i % picture->width, y = i / picture->width;

        for (int32_t k = 0; k < (corners ? 8 : 4); k++) {
            int32_t u = x + neighbours[k][0], v = y + neighbours[k][1], j = v * picture->width + u;

            if (u >= 0 && v >= 0 && u < picture->width && v < picture->height &&
                labels[j] == from) {
                labels[j] = to;
                picture->stack[waiting++] = j;
            }
        }
    }
}

/* Inserts a region behind the larger ones of its kind; regions beyond the capacity are counted. */
static void add_region(region *regions, int32_t *count, int32_t *overflow, region added)
{
    int32_t at = *count;

    if (at == CAIRN_SHAPE_MODEL_MAX_OUTLINES) {
        ++*overflow;
        return;
    }
    for (; at > 0 && regions[at - 1].is_hole == added.is_hole && regions[at - 1].area < added.area;
         at--)
        regions[at] = regions[at - 1];
    regions[at] = added;
    ++*count;
}

/* Connected-component labelling: fills face[] and part[]. *parts, *faces: the numbers of labels
 * without the outside. */
static void label_components(shape_picture *picture, int32_t *parts, int32_t *faces)
{
    enum { UNLABELLED = -2 };
    int32_t n = picture->width * picture->height;

    for (int32_t i = 0; i < n; i++)
        picture->face[i] = picture->ink[i] ? -1 : UNLABELLED;
    flood(picture, picture->face, 0, UNLABELLED, 0, 0);
    *faces = *parts = 0;
    for (int32_t i = 0; i < n; i++)
        if (picture->face[i] == UNLABELLED)
            flood(picture, picture->face, i, UNLABELLED, ++*faces, 0);
    for (int32_t i = 0; i < n; i++)
        picture->part[i] = picture->face[i] == 0 ? 0 : UNLABELLED;
    for (int32_t i = 0; i < n; i++)
        if (picture->part[i] == UNLABELLED)
            flood(picture, picture->part, i, UNLABELLED, ++*parts, 1);
}

/* Statistics of a label. */
typedef struct label_stats {
    int32_t area, first; /* pixels; first pixel in row order, -1: none yet */
    int32_t ink;         /* of a part: pixels of ink */
    int32_t inside;      /* of a part of a drawing: label of its largest face */
    int32_t part;        /* of a face: label of the part that encloses it */
} label_stats;

/* Computes the statistics of all labels. */
static void count_labels(const shape_picture *picture, label_stats *part, int32_t parts,
                         label_stats *face, int32_t faces)
{
    for (int32_t i = 0; i <= parts; i++)
        part[i].first = -1;
    for (int32_t i = 0; i <= faces; i++)
        face[i].first = -1;
    for (int32_t i = 0; i < picture->width * picture->height; i++) {
        label_stats *part_stats = &part[picture->part[i]],
                    *face_stats = picture->face[i] > 0 ? &face[picture->face[i]] : NULL;

        part_stats->first = part_stats->first < 0 ? i : part_stats->first;
        part_stats->area++;
        part_stats->ink += picture->ink[i];
        if (face_stats != NULL) {
            face_stats->first = face_stats->first < 0 ? i : face_stats->first;
            face_stats->area++;
            face_stats->part = picture->part[i];
        }
    }
    for (int32_t i = 1; i <= faces; i++)
        if (part[face[i].part].inside == 0 || face[part[face[i].part].inside].area < face[i].area)
            part[face[i].part].inside = i;
}

/* Returns 1 when the lines of a part enclose an area at least half as large as their ink. */
static int is_closed(const label_stats *part, const label_stats *face)
{
    return part->inside > 0 && face[part->inside].area >= part->ink / 2;
}

static cairn_status report_open_lines(const shape_picture *picture)
{
    return cairn_file_error_set(
        picture->error, CAIRN_BAD_FORMAT, picture->path, 0,
        "lines that enclose nothing, expected a silhouette, or an outline closed except for "
        "small gaps");
}

/* Selects the regions to trace: components, then holes. */
static cairn_status select_regions(const shape_picture *picture,
                                   const cairn_shape_image_params *params, const label_stats *part,
                                   int32_t parts, const label_stats *face, int32_t faces,
                                   cairn_shape_image *image, region *regions)
{
    int32_t largest = 0, overflow = 0;

    for (int32_t i = 1; i <= parts; i++)
        if ((!image->is_drawing || is_closed(&part[i], face)) && part[i].area > largest)
            largest = part[i].area;
    if (largest == 0)
        return report_open_lines(picture);
    for (int32_t i = 1; i <= parts; i++) {
        region candidate = {i, part[i].first, part[i].area, 0};

        if (part[i].area < params->min_part * largest ||
            (image->is_drawing && !is_closed(&part[i], face)))
            image->dropped_regions++;
        else
            add_region(regions, &image->count, &overflow, candidate);
    }
    for (int32_t i = 1; i <= faces && params->holes != CAIRN_SHAPE_IMAGE_HOLES_FILL; i++) {
        region candidate = {i, face[i].first, face[i].area, 1};

        if (image->is_drawing && part[face[i].part].inside == i)
            continue;
        if (face[i].area < params->min_part * largest) {
            image->dropped_regions++;
            continue;
        }
        if (params->holes == CAIRN_SHAPE_IMAGE_HOLES_REFUSE)
            return cairn_file_error_set(
                picture->error, CAIRN_UNSUPPORTED, picture->path, 0,
                "a hole of %d pixels at (%d, %d), expected an object without holes",
                (int)candidate.area, (int)(candidate.first % picture->width - 1),
                (int)(candidate.first / picture->width - 1));
        image->holes += image->count < CAIRN_SHAPE_MODEL_MAX_OUTLINES;
        add_region(regions, &image->count, &overflow, candidate);
    }
    if (overflow > 0)
        return cairn_file_error_set(picture->error, CAIRN_FULL, picture->path, 0,
                                    "%d parts and holes, expected one object of at most %d; of a "
                                    "photograph " GRAB,
                                    (int)(image->count + overflow), CAIRN_SHAPE_MODEL_MAX_OUTLINES);
    return CAIRN_OK;
}

/* ---- Tracing ---- */

/* Traces the outlines of the selected regions. */
static cairn_status trace_regions(const shape_picture *picture, const region *regions,
                                  cairn_shape_image *image)
{
    int32_t counts[CAIRN_SHAPE_MODEL_MAX_OUTLINES], sum = 0;

    for (int32_t i = 0; i < image->count; i++) {
        const region *traced = &regions[i];

        counts[i] =
            cairn_shape_image_outline(picture, traced->is_hole ? picture->face : picture->part,
                                      traced->label, !traced->is_hole, traced->first, NULL);
        sum += counts[i];
    }
    image->points = malloc(((size_t)sum + 1) * sizeof *image->points);
    if (image->points == NULL)
        return cairn_file_error_system(picture->error, picture->path, "trace", ENOMEM);
    sum = 0;
    for (int32_t i = 0; i < image->count; i++) {
        const region *traced = &regions[i];
        cairn_vec2 *points = &image->points[sum];

        sum += cairn_shape_image_outline(picture, traced->is_hole ? picture->face : picture->part,
                                         traced->label, !traced->is_hole, traced->first, points);
        image->outlines[i].points = points;
        image->outlines[i].count = counts[i];
        image->outlines[i].closed = 1;
    }
    return CAIRN_OK;
}

/* Labels the components, selects regions and traces them. */
static cairn_status label_and_trace(shape_picture *picture, const cairn_shape_image_params *params,
                                    cairn_shape_image *image)
{
    region regions[CAIRN_SHAPE_MODEL_MAX_OUTLINES] = {{0, 0, 0, 0}};
    int32_t parts, faces;
    cairn_status status;
    label_stats *part, *face;

    label_components(picture, &parts, &faces);
    part = calloc((size_t)parts + 1, sizeof *part);
    face = calloc((size_t)faces + 1, sizeof *face);
    if (part != NULL && face != NULL) {
        count_labels(picture, part, parts, face, faces);
        status = select_regions(picture, params, part, parts, face, faces, image, regions);
    } else {
        status = cairn_file_error_system(picture->error, picture->path, "trace", ENOMEM);
    }
    free(part);
    free(face);
    return status == CAIRN_OK ? trace_regions(picture, regions, image) : status;
}

/* specks: beside its object; 0: not counted */
static cairn_status report_photograph(const shape_picture *picture, double share, int32_t specks)
{
    char beside[40] = "";

    if (specks > 0)
        snprintf(beside, sizeof beside, ", %d specks", (int)specks);
    return cairn_file_error_set(
        picture->error, CAIRN_BAD_FORMAT, picture->path, 0,
        "a photograph (%.0f %% of it is neither dark nor bright%s), expected a silhouette or a "
        "drawing; " GRAB,
        100 * share, beside);
}

/* Runs all steps of the method. */
static cairn_status trace_picture(shape_picture *picture, cairn_raster_u8_view grey,
                                  const cairn_shape_image_params *params, cairn_shape_image *image)
{
    double diagonal;
    double share = share_between(grey);
    cairn_status status = CAIRN_OK;

    if (share > MAX_SHARE_BETWEEN)
        return report_photograph(picture, share, 0);
    if (!binarize(picture, grey, &diagonal))
        return cairn_file_error_set(
            picture->error, CAIRN_EMPTY, picture->path, 0,
            "%d x %d pixels of one colour, expected a silhouette or a drawing", (int)grey.width,
            (int)grey.height);
    if (diagonal < MIN_DIAGONAL_PIXELS)
        return cairn_file_error_set(
            picture->error, CAIRN_EMPTY, picture->path, 0,
            "an object of %.0f pixels along its diagonal, expected at least %d", diagonal,
            MIN_DIAGONAL_PIXELS);
    image->is_drawing = max_thickness(picture) <= fmax(2, MAX_LINE_FRACTION * diagonal);
    if (image->is_drawing)
        status = cairn_shape_image_join(picture, params->max_gap * diagonal, image);
    if (status == CAIRN_OK)
        status = label_and_trace(picture, params, image);
    if (status == CAIRN_OK && share > MIN_SHARE_BETWEEN && image->dropped_regions > MAX_SPECKS)
        return report_photograph(picture, share, image->dropped_regions);
    return status;
}

/* Traces a picture within the limits. */
static cairn_status trace(cairn_shape_image *image, cairn_raster_u8_view grey,
                          const cairn_shape_image_params *params, const char *path,
                          cairn_file_error *error)
{
    shape_picture picture = {.path = path, .error = error};
    cairn_status status;
    size_t pixels;

    picture.width = grey.width + 2;
    picture.height = grey.height + 2;
    pixels = (size_t)picture.width * (size_t)picture.height;
    picture.ink = malloc(pixels);
    picture.face = malloc(pixels * sizeof *picture.face);
    picture.part = malloc(pixels * sizeof *picture.part);
    picture.stack = malloc(pixels * sizeof *picture.stack);
    if (picture.ink != NULL && picture.face != NULL && picture.part != NULL &&
        picture.stack != NULL)
        status = trace_picture(&picture, grey, params, image);
    else
        status = cairn_file_error_system(error, path, "trace", ENOMEM);
    free(picture.ink);
    free(picture.face);
    free(picture.part);
    free(picture.stack);
    if (status != CAIRN_OK)
        cairn_shape_image_free(image);
    return status;
}

/* Means of squares of `shrink` pixels a side, on the heap; NULL: no memory. */
static uint8_t *reduce(cairn_raster_u8_view grey, int32_t shrink, int32_t width, int32_t height)
{
    uint8_t *small = malloc((size_t)width * (size_t)height);

    for (int32_t y = 0; y < height && small != NULL; y++)
        for (int32_t x = 0; x < width; x++) {
            int64_t sum = 0, count = 0;

            for (int32_t v = y * shrink; v < (y + 1) * shrink && v < grey.height; v++)
                for (int32_t u = x * shrink; u < (x + 1) * shrink && u < grey.width; u++, count++)
                    sum += grey.data[v * grey.stride + u];
            CAIRN_ASSERT(count > 0);
            small[(size_t)y * (size_t)width + (size_t)x] = (uint8_t)((sum + count / 2) / count);
        }
    return small;
}

/* Converts points of a reduced picture into pixels of the picture. */
static void enlarge(cairn_vec2 *points, int32_t count, int32_t shrink)
{
    const cairn_real half = CAIRN_REAL(0.5);

    for (int32_t i = 0; i < count; i++)
        points[i] = (cairn_vec2){(points[i].x + half) * (cairn_real)shrink - half,
                                 (points[i].y + half) * (cairn_real)shrink - half};
}

cairn_status cairn_shape_image_trace(cairn_shape_image *image, cairn_raster_u8_view grey,
                                     const cairn_shape_image_params *params, const char *path,
                                     cairn_file_error *error)
{
    cairn_raster_u8_view small;
    cairn_status status;
    uint8_t *samples;
    int32_t shrink = 1, points = 0;

    memset(image, 0, sizeof *image);
    if (cairn_raster_u8_check(grey) != CAIRN_OK || params == NULL ||
        params->holes < CAIRN_SHAPE_IMAGE_HOLES_KEEP ||
        params->holes > CAIRN_SHAPE_IMAGE_HOLES_REFUSE || !(params->max_gap >= 0) ||
        !(params->max_gap <= 1) || !(params->min_part >= 0) || !(params->min_part <= 1) ||
        params->max_side < MIN_DIAGONAL_PIXELS || params->max_side > CAIRN_SHAPE_IMAGE_MAX_SIDE)
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "cannot be traced, expected a picture, gaps and parts from 0 to 1, sides up to %d",
            CAIRN_SHAPE_IMAGE_MAX_SIDE);
    while ((grey.width - 1) / shrink >= params->max_side ||
           (grey.height - 1) / shrink >= params->max_side)
        shrink *= 2;
    if (shrink == 1)
        return trace(image, grey, params, path, error);
    small.width = (grey.width - 1) / shrink + 1;
    small.stride = small.width;
    small.height = (grey.height - 1) / shrink + 1;
    small.data = samples = reduce(grey, shrink, small.width, small.height);
    if (samples == NULL)
        return cairn_file_error_system(error, path, "trace", ENOMEM);
    status = trace(image, small, params, path, error);
    free(samples);
    for (int32_t i = 0; status == CAIRN_OK && i < image->count; i++)
        points += image->outlines[i].count;
    enlarge(image->points, points, shrink);
    enlarge(image->gaps, CAIRN_SHAPE_MODEL_MAX_GAPS, shrink);
    return status;
}
