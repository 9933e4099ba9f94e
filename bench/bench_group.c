/* Ground truth and scores of groupings. */
#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_group.h"
#include "cairn/vision.h"

/* Protocol: px of coverage, share of the box's diagonal of precision; and thresholds of a hit. */
#define COVERAGE_PX      3
#define FAR_SHARE        0.04
#define HIT_COVERAGE     0.8
#define HIT_PRECISION    0.6
#define SAME_PLACE_SHARE 0.3
/* Pixels by which an outline may leave its box, and that it has at least. */
#define BOX_SLACK     5
#define LEAST_OUTLINE 20

/* ---- Names ---- */

static int compare_names(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

int group_names_read(group_names *names, const char *folder)
{
    DIR *open = opendir(folder);
    struct dirent *entry;

    memset(names, 0, sizeof *names);
    while (open != NULL && (entry = readdir(open)) != NULL) {
        size_t length = strlen(entry->d_name);
        char **grown;

        if (length < 5 || strcmp(entry->d_name + length - 4, ".jpg") != 0 ||
            entry->d_name[0] == '.')
            continue;
        grown = realloc(names->name, ((size_t)names->count + 1) * sizeof *grown);
        if (grown == NULL)
            break;
        names->name = grown;
        grown[names->count] = malloc(length);
        if (grown[names->count] == NULL)
            break;
        memcpy(grown[names->count], entry->d_name, length - 4);
        grown[names->count++][length - 4] = '\0';
    }
    if (open != NULL)
        (void)closedir(open);
    if (names->count > 1)
        qsort(names->name, (size_t)names->count, sizeof *names->name, compare_names);
    return names->count > 0;
}

void group_names_free(group_names *names)
{
    for (int32_t i = 0; i < names->count; i++)
        free(names->name[i]);
    free(names->name);
    memset(names, 0, sizeof *names);
}

/* ---- Pixels ---- */

static uint8_t *empty_picture(const group_image *image)
{
    return calloc((size_t)image->width * (size_t)image->height, 1);
}

/* Marks all pixels within `reach` of the marked ones. */
static uint8_t *grown(const group_image *image, const uint8_t *pixels, double reach)
{
    uint8_t *out = empty_picture(image);
    int32_t r = (int32_t)reach;

    for (int32_t y = 0; y < image->height && out != NULL; y++)
        for (int32_t x = 0; x < image->width; x++) {
            if (!pixels[y * image->width + x])
                continue;
            for (int32_t v = y - r < 0 ? 0 : y - r; v <= y + r && v < image->height; v++)
                for (int32_t u = x - r < 0 ? 0 : x - r; u <= x + r && u < image->width; u++)
                    if ((u - x) * (u - x) + (v - y) * (v - y) <= reach * reach)
                        out[v * image->width + u] = 1;
        }
    return out;
}

/* ---- Truth ---- */

static void read_boxes(group_image *image, const char *folder, const char *class_name)
{
    char path[4096], lower[64];
    FILE *file;
    size_t i;

    for (i = 0; class_name[i] != '\0' && i + 1 < sizeof lower; i++)
        lower[i] = (char)(class_name[i] >= 'A' && class_name[i] <= 'Z' ? class_name[i] + 32
                                                                       : class_name[i]);
    lower[i] = '\0';
    (void)snprintf(path, sizeof path, "%s/%s_%s.groundtruth", folder, image->name, lower);
    file = fopen(path, "r");
    while (file != NULL && image->instances < GROUP_INSTANCES) {
        group_box *b = &image->box[image->instances];

        if (fscanf(file, "%lf %lf %lf %lf", &b->left, &b->top, &b->right, &b->bottom) != 4)
            break;
        image->instances++;
    }
    if (file != NULL)
        (void)fclose(file);
}

/* The border pixels of an object in a mask, or all pixels of a line drawing. */
static int add_outline(group_image *image, const uint8_t *pixels, int32_t level, int32_t is_mask,
                       uint8_t *outline)
{
    int32_t count = 0, w = image->width, h = image->height;

    for (int32_t y = 0; y < h; y++)
        for (int32_t x = 0; x < w; x++) {
            int32_t is_in = is_mask ? pixels[y * w + x] != 0 : pixels[y * w + x] == level;
            int32_t is_rim = !is_mask || (x > 0 && !pixels[y * w + x - 1]) ||
                             (x + 1 < w && !pixels[y * w + x + 1]) ||
                             (y > 0 && !pixels[(y - 1) * w + x]) ||
                             (y + 1 < h && !pixels[(y + 1) * w + x]);

            outline[y * w + x] = (uint8_t)(is_in && is_rim);
            count += outline[y * w + x];
        }
    return count;
}

static double overlap(const group_box *a, const group_box *b)
{
    double w = fmin(a->right, b->right) - fmax(a->left, b->left),
           h = fmin(a->bottom, b->bottom) - fmax(a->top, b->top);
    double both = w > 0 && h > 0 ? w * h : 0;

    return both / ((a->right - a->left) * (a->bottom - a->top) +
                   (b->right - b->left) * (b->bottom - b->top) - both);
}

static group_box box_of(const group_image *image, const uint8_t *pixels)
{
    group_box b = {1e9, 1e9, -1e9, -1e9};

    for (int32_t i = 0; i < image->width * image->height; i++)
        if (pixels[i]) {
            int32_t x = i % image->width, y = i / image->width;

            b.left = fmin(b.left, x);
            b.right = fmax(b.right, x);
            b.top = fmin(b.top, y);
            b.bottom = fmax(b.bottom, y);
        }
    return b;
}

/* Assigns an outline to the instance whose box it fills best and that has none. */
static void assign(group_image *image, uint8_t *outline)
{
    group_box box = box_of(image, outline);
    int32_t best = -1;
    double most = 0.1;

    for (int32_t i = 0; i < image->instances; i++)
        if (image->outline[i] == NULL && overlap(&image->box[i], &box) > most) {
            most = overlap(&image->box[i], &box);
            best = i;
        }
    if (best < 0) {
        free(outline);
        return;
    }
    image->outline[best] = outline;
    image->has_outline = 1;
}

/* The most frequent grey level. */
static int32_t background_of(const group_image *image, const uint8_t *pixels)
{
    int32_t count[256] = {0}, most = 0;

    for (int32_t i = 0; i < image->width * image->height; i++)
        count[pixels[i]]++;
    for (int32_t level = 1; level < 256; level++)
        most = count[level] > count[most] ? level : most;
    return most;
}

/* One level may contain several instances: each remaining box takes the contour inside it. */
static void share_out(group_image *image, const uint8_t *outline)
{
    for (int32_t k = 0; k < image->instances; k++) {
        const group_box *b = &image->box[k];
        uint8_t *own = image->outline[k] == NULL ? empty_picture(image) : NULL;
        int32_t count = 0;

        for (int32_t i = 0; i < image->width * image->height && own != NULL; i++) {
            int32_t x = i % image->width, y = i / image->width;

            own[i] =
                (uint8_t)(outline[i] && x >= b->left - BOX_SLACK && x <= b->right + BOX_SLACK &&
                          y >= b->top - BOX_SLACK && y <= b->bottom + BOX_SLACK);
            count += own[i];
        }
        if (count > LEAST_OUTLINE && own != NULL)
            assign(image, own);
        else
            free(own);
    }
}

static void read_levels(group_image *image, const cairn_vision_image *grey)
{
    const uint8_t *pixels = grey->samples;
    int32_t background = background_of(image, pixels);

    for (int32_t level = 0; level < 256; level++) {
        uint8_t *outline = level != background ? empty_picture(image) : NULL;

        if (outline != NULL && add_outline(image, pixels, level, 0, outline) > LEAST_OUTLINE)
            share_out(image, outline);
        free(outline);
    }
}

/* Masks one by one, or all outlines in one picture by their grey levels. */
static void read_outlines(group_image *image, const char *folder, const char *class_name)
{
    static const char *const forms[] = {"%s/%s_%s_outlines.pgm", "%s/%s_%s_outlines.png",
                                        "%s/%s_half_%s_outlines.pgm"};
    cairn_vision_image grey;
    char path[4096], lower[64];

    (void)snprintf(lower, sizeof lower, "%s", class_name);
    lower[0] = (char)(lower[0] >= 'A' && lower[0] <= 'Z' ? lower[0] + 32 : lower[0]);
    for (size_t k = 0; k < sizeof forms / sizeof *forms; k++) {
        (void)snprintf(path, sizeof path, forms[k], folder, image->name, lower);
        if (cairn_vision_read_grey(&grey, path, NULL) != CAIRN_OK)
            continue;
        if (grey.width == image->width && grey.height == image->height)
            read_levels(image, &grey);
        cairn_vision_free(&grey);
    }
    for (int32_t k = 0; k < GROUP_INSTANCES; k++) {
        uint8_t *outline;

        (void)snprintf(path, sizeof path, "%s/%s.mask.%d.png", folder, image->name, (int)k);
        if (cairn_vision_read_grey(&grey, path, NULL) != CAIRN_OK)
            continue;
        outline = empty_picture(image);
        if (outline != NULL && grey.width == image->width && grey.height == image->height &&
            add_outline(image, grey.samples, 0, 1, outline) > LEAST_OUTLINE)
            assign(image, outline);
        else
            free(outline);
        cairn_vision_free(&grey);
    }
}

/* Marks the middle of the drawn strokes, as some are as wide as the coverage tolerance. */
static void mark_middle(group_image *image, uint8_t *outline)
{
    cairn_raster_u8_view view = {outline, image->width, image->height, image->width};
    cairn_edge_chain_params params = cairn_edge_chain_default();
    cairn_edge_chain_set *set;
    cairn_budget budget = {INT32_MAX};
    cairn_edge_chain_result r;
    cairn_pool pool;
    size_t bytes;
    void *memory;

    params.max_width = image->width;
    params.max_height = image->height;
    params.max_edges = params.max_chains = image->width * image->height;
    bytes = cairn_edge_chain_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    if (memory != NULL && cairn_pool_init(&pool, memory, bytes) == CAIRN_OK &&
        cairn_edge_chain_create(&set, &pool, &params) == CAIRN_OK &&
        cairn_edge_chain_begin(set, view) == CAIRN_OK &&
        cairn_edge_chain_step(set, &budget) == CAIRN_OK) {
        r = cairn_edge_chain_read(set);
        for (int32_t i = 0; i < r.pixel_count; i++)
            outline[r.pixels[i].y * image->width + r.pixels[i].x] = 2;
    }
    free(memory);
}

/* An instance without an outline has the size of its box. */
static void finish_outlines(group_image *image)
{
    for (int32_t i = 0; i < image->instances; i++)
        if (image->outline[i] == NULL)
            image->outline[i] = empty_picture(image);
        else
            mark_middle(image, image->outline[i]);
}

int group_image_read(group_image *image, const char *folder, const char *name,
                     const char *class_name)
{
    cairn_vision_image edges;
    cairn_file_error error;
    char path[4096];

    memset(image, 0, sizeof *image);
    (void)snprintf(image->name, sizeof image->name, "%s", name);
    (void)snprintf(path, sizeof path, "%s/%s_edges.tif", folder, name);
    if (cairn_vision_read_grey(&edges, path, &error) != CAIRN_OK) {
        fprintf(stderr, "bench/group: %s\n", error.text);
        return 0;
    }
    image->width = edges.width;
    image->height = edges.height;
    image->edges = edges.samples;
    image->near_edge = grown(image, image->edges, 1.5);
    image->with_edge = grown(image, image->edges, COVERAGE_PX);
    if (class_name != NULL) {
        read_boxes(image, folder, class_name);
        read_outlines(image, folder, class_name);
        finish_outlines(image);
    }
    return image->near_edge != NULL && image->with_edge != NULL;
}

void group_image_free(group_image *image)
{
    free(image->edges);
    free(image->near_edge);
    free(image->with_edge);
    for (int32_t i = 0; i < image->instances; i++)
        free(image->outline[i]);
    memset(image, 0, sizeof *image);
}

/* ---- Groupings ---- */

static void free_grouping(const group_grouping *g)
{
    free(g->pixels);
    free(g->outline);
}

void group_found_clear(group_found *found)
{
    for (int32_t i = 0; i < found->count; i++)
        free_grouping(&found->grouping[i]);
    memset(found, 0, sizeof *found);
}

/* Only edge pixels count. */
static void mark(const group_image *image, cairn_segment line, group_grouping *g)
{
    int32_t steps = 1 + (int32_t)(2 * cairn_segment_length(line));

    for (int32_t i = 0; i <= steps; i++) {
        int32_t x = (int32_t)lrint((double)line.a.x + (double)(line.b.x - line.a.x) * i / steps);
        int32_t y = (int32_t)lrint((double)line.a.y + (double)(line.b.y - line.a.y) * i / steps);
        int32_t at = y * image->width + x;

        if (x >= 0 && y >= 0 && x < image->width && y < image->height && image->near_edge[at] &&
            !g->pixels[at]) {
            g->pixels[at] = 1;
            g->pixel_count++;
        }
    }
}

void group_found_add(group_found *found, const group_image *image,
                     const cairn_contour_search_tokens *tokens,
                     const cairn_contour_search_result *result)
{
    found->best = fmax(found->best, (double)result->best_evidence);
    if (result->mode == CAIRN_MODE_AS_WRITTEN && found->searches < GROUP_INSTANCES) {
        found->end[found->searches++] = result->end_reason;
        found->points_dropped += result->points_dropped;
    }
    for (int32_t i = 0; i < result->object_count && found->count < GROUP_GROUPINGS; i++) {
        const cairn_contour_search_object *o = &result->objects[i];
        group_grouping *g = &found->grouping[found->count];

        memset(g, 0, sizeof *g);
        g->pixels = empty_picture(image);
        g->outline_count = o->outline_count;
        g->outline = malloc((size_t)g->outline_count * sizeof *g->outline);
        if (g->pixels == NULL || g->outline == NULL) {
            free_grouping(g);
            return;
        }
        memcpy(g->outline, &result->outline[o->first_outline],
               (size_t)g->outline_count * sizeof *g->outline);
        g->object = o->found;
        g->mirrored = o->mirrored;
        g->rigid = (double)o->rigid_evidence;
        g->bent = (double)o->deformed_evidence;
        g->shape = o->shape;
        for (int32_t k = 0; k < o->found.count; k++)
            mark(image, tokens->lines[result->segments[o->found.first + k]], g);
        found->count++;
    }
}

static int compare_groupings(const void *a, const void *b)
{
    const group_grouping *x = a, *y = b;

    return (x->object.evidence < y->object.evidence) - (x->object.evidence > y->object.evidence);
}

void group_found_sort(group_found *found)
{
    int32_t kept = 0;

    qsort(found->grouping, (size_t)found->count, sizeof *found->grouping, compare_groupings);
    for (int32_t i = 0; i < found->count; i++) {
        const cairn_contour_grouping_object *o = &found->grouping[i].object;
        int32_t apart = 1;

        for (int32_t k = 0; k < kept && apart; k++) {
            const cairn_contour_grouping_object *b = &found->grouping[k].object;

            apart =
                hypot((double)(o->origin.x - b->origin.x), (double)(o->origin.y - b->origin.y)) >
                SAME_PLACE_SHARE * fmax((double)o->size, (double)b->size);
        }
        if (apart)
            found->grouping[kept++] = found->grouping[i];
        else
            free_grouping(&found->grouping[i]);
    }
    found->count = kept;
}

/* ---- Scores ---- */

/* The share of an outline that has edges; 0 where there is no outline. */
static double present_share(const group_image *image, int32_t instance)
{
    int32_t outline = 0, present = 0;

    for (int32_t i = 0; i < image->width * image->height; i++) {
        outline += image->outline[instance][i] > 0;
        present += image->outline[instance][i] && image->with_edge[i];
    }
    return outline > 0 ? (double)present / outline : 0;
}

/* Returns the score of a grouping for an instance. */
static group_score score_of(const group_image *image, const group_grouping *g, int32_t instance)
{
    const group_box *b = &image->box[instance];
    double far = fmax(1, FAR_SHARE * hypot(b->right - b->left, b->bottom - b->top));
    uint8_t *near = grown(image, g->pixels, COVERAGE_PX),
            *along = grown(image, image->outline[instance], far);
    group_score s = {.instance = instance};
    int32_t present = 0, covered = 0, thin_present = 0, thin_covered = 0, right = 0;
    group_box box = box_of(image, g->pixels);

    for (int32_t i = 0; i < image->width * image->height && near != NULL && along != NULL; i++) {
        if (image->outline[instance][i] && image->with_edge[i]) {
            present++;
            covered += near[i];
            thin_present += image->outline[instance][i] == 2;
            thin_covered += image->outline[instance][i] == 2 && near[i];
        }
        right += g->pixels[i] && along[i];
    }
    free(near);
    free(along);
    s.present = present_share(image, instance);
    s.coverage = present > 0 ? (double)covered / present : 0;
    s.precision = g->pixel_count > 0 ? (double)right / g->pixel_count : 0;
    s.iou = g->pixel_count > 0 ? overlap(&box, b) : 0;
    s.thin = thin_present > 0 && thin_covered >= HIT_COVERAGE * thin_present &&
             s.precision >= HIT_PRECISION;
    s.covered = s.coverage >= HIT_COVERAGE;
    s.hit = s.coverage >= HIT_COVERAGE && s.precision >= HIT_PRECISION;
    return s;
}

int32_t group_measure(const group_image *image, const group_found *found,
                      group_score score[GROUP_INSTANCES])
{
    int32_t used[GROUP_GROUPINGS] = {0}, hits = 0;

    for (int32_t i = 0; i < image->instances; i++) {
        int32_t best = -1;

        memset(&score[i], 0, sizeof score[i]);
        score[i].instance = i;
        score[i].present = present_share(image, i);
        for (int32_t k = 0; k < found->count && k < image->instances; k++) {
            group_score s = score_of(image, &found->grouping[k], i);

            if (!used[k] && (s.hit > score[i].hit ||
                             (s.hit == score[i].hit && s.coverage > score[i].coverage))) {
                score[i] = s;
                best = k;
            }
        }
        if (best >= 0 && score[i].hit) {
            used[best] = 1;
            hits++;
        }
    }
    return hits;
}

/* ---- Pictures ---- */

static void dot(const group_image *image, uint8_t *rgb, double x, double y, const uint8_t colour[3])
{
    int32_t u = (int32_t)lrint(x), v = (int32_t)lrint(y);

    if (u >= 0 && v >= 0 && u < image->width && v < image->height)
        memcpy(&rgb[3 * (v * image->width + u)], colour, 3);
}

static void draw_outline(const group_image *image, uint8_t *rgb, const group_grouping *g)
{
    static const uint8_t blue[3] = {60, 120, 255}, violet[3] = {220, 60, 255};

    for (int32_t i = 0; i < g->outline_count; i++) {
        const cairn_contour_search_place *place = &g->outline[i];

        for (int32_t v = 0; v < 2; v++)
            for (int32_t u = 0; u < 2; u++)
                dot(image, rgb, (double)place->point.position.x + u,
                    (double)place->point.position.y + v, place->segment >= 0 ? blue : violet);
    }
}

void group_draw(const char *folder, const group_image *image, const group_found *found)
{
    int32_t n = image->width * image->height;
    uint8_t *rgb = malloc(3 * (size_t)n);
    char path[4096];
    FILE *file;

    (void)snprintf(path, sizeof path, "%s/%s.ppm", folder, image->name);
    file = rgb != NULL ? fopen(path, "wb") : NULL;
    for (int32_t i = 0; i < n && file != NULL; i++) {
        memset(&rgb[3 * i], image->edges[i] > 0 ? 70 + image->edges[i] / 2 : 0, 3);
        for (int32_t k = 0; k < image->instances; k++)
            if (image->outline[k][i])
                rgb[3 * i + 1] = 200;
        for (int32_t k = 0; k < found->count && k < image->instances; k++)
            if (found->grouping[k].pixels[i]) {
                rgb[3 * i] = 255;
                rgb[3 * i + 2] = 0;
            }
    }
    for (int32_t k = 0; k < found->count && k < image->instances && file != NULL; k++)
        draw_outline(image, rgb, &found->grouping[k]);
    if (file != NULL) {
        fprintf(file, "P6\n%d %d\n255\n", (int)image->width, (int)image->height);
        (void)fwrite(rgb, 1, 3 * (size_t)n, file);
        (void)fclose(file);
    }
    free(rgb);
}
