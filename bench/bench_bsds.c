#include "bench/bench_bsds.h"

#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Of the diagonal. */
#define MATCH_DISTANCE_SHARE 0.0075
/* Canny's lower threshold, as a fraction of the upper one. */
#define LOW 0.4

enum { SIGMAS = 6, LEVELS = 16, PATH_BYTES = 1024 };

static int32_t pixels_of(const bsds_image *image)
{
    return image->grey.width * image->grey.height;
}

/* The largest of the values within reach of each pixel. */
static void spread(const bsds_image *image, const uint8_t *from, uint8_t *to)
{
    int32_t w = image->grey.width, h = image->grey.height, r = (int32_t)image->reach;

    memset(to, 0, (size_t)pixels_of(image));
    for (int32_t y = 0; y < h; y++)
        for (int32_t x = 0; x < w; x++)
            for (int32_t v = y - r; v <= y + r && from[y * w + x] > 0; v++)
                for (int32_t u = x - r; u <= x + r; u++)
                    if (u >= 0 && v >= 0 && u < w && v < h && hypot(u - x, v - y) <= image->reach &&
                        to[v * w + u] < from[y * w + x])
                        to[v * w + u] = from[y * w + x];
}

/* NAME_gtK.png for any K. 0: none. */
static int find_truth(char path[PATH_BYTES], const char *folder, const char *name)
{
    DIR *open = opendir(folder);
    size_t length = strlen(name);
    struct dirent *entry;
    int found = 0;

    while (open != NULL && !found && (entry = readdir(open)) != NULL)
        if (strncmp(entry->d_name, name, length) == 0 &&
            strncmp(entry->d_name + length, "_gt", 3) == 0)
            found = snprintf(path, PATH_BYTES, "%s/%s", folder, entry->d_name) < PATH_BYTES;
    if (open != NULL)
        (void)closedir(open);
    return found;
}

int bsds_read(bsds_image *image, const char *folder, const char *name)
{
    char path[PATH_BYTES], truth[PATH_BYTES];
    cairn_file_error error;

    memset(image, 0, sizeof *image);
    if (snprintf(path, sizeof path, "%s/%s.jpg", folder, name) >= PATH_BYTES ||
        !find_truth(truth, folder, name)) {
        fprintf(stderr, "%s/%s: no picture with its truth, expected NAME.jpg and NAME_gtK.png\n",
                folder, name);
        return 0;
    }
    if (cairn_vision_read(&image->colour, path, &error) != CAIRN_OK ||
        cairn_vision_read_grey(&image->grey, path, &error) != CAIRN_OK ||
        cairn_vision_read_grey(&image->truth, truth, &error) != CAIRN_OK) {
        fprintf(stderr, "%s\n", error.text);
        bsds_free(image);
        return 0;
    }
    image->reach = MATCH_DISTANCE_SHARE * hypot(image->grey.width, image->grey.height);
    image->near = calloc((size_t)pixels_of(image), 1);
    if (image->near == NULL || image->truth.width != image->grey.width ||
        image->truth.height != image->grey.height) {
        fprintf(stderr, "%s: %d x %d pixels, expected %d x %d as of the picture\n", truth,
                (int)image->truth.width, (int)image->truth.height, (int)image->grey.width,
                (int)image->grey.height);
        bsds_free(image);
        return 0;
    }
    spread(image, image->truth.samples, image->near);
    return 1;
}

void bsds_free(bsds_image *image)
{
    cairn_vision_free(&image->colour);
    cairn_vision_free(&image->grey);
    cairn_vision_free(&image->truth);
    free(image->near);
    memset(image, 0, sizeof *image);
}

bsds_point bsds_score(const bsds_image *image, const uint8_t *pixels)
{
    const uint8_t *truth = image->truth.samples;
    uint8_t *met = malloc((size_t)pixels_of(image));
    int32_t found = 0, right = 0, all = 0, recalled = 0;
    bsds_point p = {0, 0};

    if (met == NULL)
        return p;
    spread(image, pixels, met);
    for (int32_t i = 0; i < pixels_of(image); i++) {
        found += pixels[i] > 0;
        right += pixels[i] > 0 && image->near[i];
        all += truth[i] > 0;
        recalled += truth[i] > 0 && met[i];
    }
    free(met);
    p.precision = found > 0 ? (double)right / found : 0;
    p.recall = all > 0 ? (double)recalled / all : 0;
    return p;
}

static void mark_way(const bsds_image *image, uint8_t *pixels, cairn_vec2 a, cairn_vec2 b)
{
    int32_t steps = 1 + (int32_t)hypot((double)(b.x - a.x), (double)(b.y - a.y));

    for (int32_t i = 0; i <= steps; i++) {
        int32_t x = (int32_t)lrint((double)a.x + (double)(b.x - a.x) * i / steps);
        int32_t y = (int32_t)lrint((double)a.y + (double)(b.y - a.y) * i / steps);

        if (x >= 0 && y >= 0 && x < image->grey.width && y < image->grey.height)
            pixels[y * image->grey.width + x] = 1;
    }
}

/* Intervals with edgels at both ends. */
static void mark_part(const bsds_image *image, uint8_t *pixels,
                      const cairn_skeleton_grouping_result *r, int32_t part)
{
    const cairn_skeleton_grouping_point *q = &r->points[r->parts[part].first];

    for (int32_t k = 0; k + 1 < r->parts[part].count; k++)
        for (int side = 0; side < 2; side++)
            if (q[k].edgel[side] >= 0 && q[k + 1].edgel[side] >= 0)
                mark_way(image, pixels, q[k].contact[side], q[k + 1].contact[side]);
}

bsds_point bsds_grouped(const bsds_image *image, const cairn_skeleton_grouping_result *r,
                        double least, uint8_t *pixels)
{
    bsds_point p = {0, 0};

    memset(pixels, 0, (size_t)pixels_of(image));
    for (int32_t i = 0; i < r->part_count && p.recall < least; i++) {
        mark_part(image, pixels, r, i);
        p = bsds_score(image, pixels);
    }
    return p;
}

/* Of the two pixels beside each side the left or the upper one. */
static void mark_contour(const bsds_image *image, uint8_t *pixels, const cairn_boundary_result *r,
                         int32_t contour)
{
    const cairn_boundary_contour *c = &r->contours[contour];
    const cairn_boundary_corner *q = &r->corners[c->first];

    for (int32_t i = 0; i + !c->closed < c->count; i++) {
        const cairn_boundary_corner *a = &q[i], *b = &q[(i + 1) % c->count];
        int32_t x = a->x < b->x ? a->x : b->x, y = a->y < b->y ? a->y : b->y;

        pixels[a->x == b->x ? y * image->grey.width + x - 1 : (y - 1) * image->grey.width + x] = 1;
    }
}

bsds_point bsds_contours(const bsds_image *image, const cairn_boundary_result *r, double least,
                         uint8_t *pixels)
{
    bsds_point p = {0, 0};

    memset(pixels, 0, (size_t)pixels_of(image));
    for (int32_t i = 0; i < r->contour_count && p.recall < least; i++) {
        mark_contour(image, pixels, r, i);
        p = bsds_score(image, pixels);
    }
    return p;
}

/* Precision at a recall, interpolated between two points. */
static double between(bsds_point a, bsds_point b, double recall)
{
    double span = b.recall - a.recall;

    if (fmin(a.recall, b.recall) > recall || fmax(a.recall, b.recall) < recall)
        return 0;
    return span != 0 ? a.precision + (recall - a.recall) / span * (b.precision - a.precision)
                     : fmax(a.precision, b.precision);
}

double bsds_canny(const bsds_image *image, double recall)
{
    static const double sigma[SIGMAS] = {0.7, 1, 1.4, 2, 2.8, 4};
    uint8_t *pixels = malloc((size_t)pixels_of(image));
    double best = 0;

    for (int s = 0; s < SIGMAS && pixels != NULL; s++) {
        bsds_point last = {1, 0};

        /* From few edges to many, until the recall is reached. */
        for (int level = 0; level < LEVELS && last.recall < recall; level++) {
            double high = 60 / sigma[s] * pow(0.8, level);
            cairn_vision_canny_params params = {.sigma = sigma[s], .low = LOW * high, .high = high};
            cairn_file_error error;
            bsds_point here;

            if (cairn_vision_canny(&image->grey, &params, pixels, "image", &error) != CAIRN_OK)
                break;
            here = bsds_score(image, pixels);
            best = fmax(best, between(last, here, recall));
            last = here;
        }
    }
    free(pixels);
    return best;
}
