/* bench_group: images of the ETHZ shape classes with ground truth, and scores of groupings on
 * them. */
#ifndef CAIRN_BENCH_GROUP_H
#define CAIRN_BENCH_GROUP_H

#include "cairn/contour_search.h"
#include "cairn/shape_model_file.h"

enum { GROUP_INSTANCES = 16, GROUP_GROUPINGS = 64 };

/* Names of a folder's images without .jpg, in the order of bytes. */
typedef struct group_names {
    char **name;
    int32_t count;
} group_names;

/* 0: there are none. */
int group_names_read(group_names *names, const char *folder);
void group_names_free(group_names *names);

typedef struct group_box {
    double left, top, right, bottom;
} group_box;

typedef struct group_image {
    char name[256];
    int32_t width, height;
    /* strengths */
    uint8_t *edges;
    /* 1: an edge pixel within a pixel */
    uint8_t *near_edge;
    /* 1: an edge pixel within 3 px */
    uint8_t *with_edge;
    group_box box[GROUP_INSTANCES];
    /* 1: on the outline of the instance; 2: on the midline of its stroke */
    uint8_t *outline[GROUP_INSTANCES];
    int32_t instances, has_outline;
} group_image;

/* Reads an image's edges and, with a class, its truth. 0: a line was printed. */
int group_image_read(group_image *image, const char *folder, const char *name,
                     const char *class_name);
void group_image_free(group_image *image);

/* A grouping: the edge pixels that its segments run along. */
typedef struct group_grouping {
    uint8_t *pixels;
    int32_t pixel_count;
    cairn_contour_grouping_object object;
    cairn_contour_search_place *outline; /* [outline_count] */
    int32_t outline_count;
    int32_t mirrored;
    double rigid, bent; /* of the evidence */
    cairn_contour_search_shape shape;
} group_grouping;

typedef struct group_found {
    group_grouping grouping[GROUP_GROUPINGS];
    int32_t count;
    double best;
    /* Mode as written: results of the searches on this image, in order. */
    int32_t searches, end[GROUP_INSTANCES]; /* CAIRN_CONTOUR_GROUPING_... */
    int32_t points_dropped;                 /* of all together */
} group_found;

void group_found_clear(group_found *found);
void group_found_add(group_found *found, const group_image *image,
                     const cairn_contour_search_tokens *tokens,
                     const cairn_contour_search_result *result);
/* The best first; among those at one place only the best. */
void group_found_sort(group_found *found);

typedef struct group_score {
    int32_t instance, hit;
    /* 1: hit as counted in the thesis: recall of at least 80 % of the visible contour, regardless
     * of precision */
    int32_t covered;
    /* 1: a hit against the midline of the outline's stroke */
    int32_t thin;
    double coverage, precision, present, iou;
} group_score;

/* Scores of all instances: each by the best of the first I groupings for it, no grouping for two.
 * Returns the number of groupings that were hits. */
int32_t group_measure(const group_image *image, const group_found *found,
                      group_score score[GROUP_INSTANCES]);

/* DIR/name.ppm: edges grey, outlines green, scored groupings red, their deformed outlines blue,
 * violet without supporting edges. */
void group_draw(const char *folder, const group_image *image, const group_found *found);

#endif
