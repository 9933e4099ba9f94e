/* cairn_objects: objects found in images as COCO annotations, masks and label images. */
#ifndef CAIRN_TOOLS_CAIRN_OBJECTS_H
#define CAIRN_TOOLS_CAIRN_OBJECTS_H

#include <stdio.h>

#include "cairn/contour_search.h"
#include "cairn/file_error.h"
#include "cairn/output.h"
#include "src/host/base/posix.h"

/* An object: closed outlines in pixels of the image, whose pixels have their centres at integer
 * coordinates. */
typedef struct objects_shape {
    cairn_vec2 *point; /* [count] vertices of all outlines */
    int32_t *outline;  /* [count] index of each vertex's outline; those of one are consecutive */
    int32_t count;
    int32_t crosses; /* 1: an outline may cross itself */
    double box[4];   /* left, top, right, bottom, px */
    double score;
} objects_shape;

/* The objects of an image, best first. */
typedef struct objects_image {
    const char *path;
    int32_t id, width, height; /* id: unique among the images, from 1 */
    objects_shape *shape;      /* [count] */
    int32_t count;
} objects_image;

#define OBJECTS_COCO_HELP "all objects as COCO JSON: boxes, polygons, scores"
#define OBJECTS_MASKS_HELP                                                                         \
    "folder to write NAME-mask-K.png, the mask of object K from 1, and NAME-labels.png to"

/* Appends an object by its deformed outline in a searched image, `shrink` times smaller; its box is
 * that of the outline, clipped to the image. NULL: no memory. */
objects_shape *objects_append_outline(objects_image *image,
                                      const cairn_contour_search_place *outline, int32_t count,
                                      int32_t shrink);

/* The same by its segments in order, one polygon. segments: [count] indices into lines. */
objects_shape *objects_append_segments(objects_image *image, const cairn_segment *lines,
                                       const int32_t *segments, int32_t count, int32_t shrink);

void objects_free(objects_image *image);

/* Writes STEM-mask-K.png for object K, from 1 (255: inside), and STEM-labels.png (0: none, K:
 * object K; the better one where objects overlap; objects beyond the 255th are left out) to the
 * folder, and removes the masks of further objects of an earlier run. */
CAIRN_CHECKED cairn_status objects_write_masks(const objects_image *image, const char *folder,
                                               const char *stem, cairn_file_error *error);

/* Prints ",\n" and the image as a COCO object; the same for each of its objects as an annotation.
 * An object with holes, or whose outline may cross itself, has a run-length encoding, as polygons
 * of COCO are simple. CAIRN_NO_MEMORY. */
void objects_print_image(const objects_image *image, FILE *file);
CAIRN_CHECKED cairn_status objects_print_annotations(const objects_image *image, FILE *file);

/* A COCO file in progress. */
typedef struct objects_coco {
    cairn_output *output;
    cairn_text_stream images, annotations; /* what the functions above print */
} objects_coco;

/* Opens the file; its folder is made when it is missing. On failure there is nothing to discard. */
CAIRN_CHECKED cairn_status objects_coco_open(objects_coco *coco, const char *path,
                                             cairn_file_error *error);

/* Writes the file. Category 1 is the name of the model without folder and extension. */
CAIRN_CHECKED cairn_status objects_coco_commit(objects_coco *coco, const char *program,
                                               const char *model, cairn_file_error *error);
void objects_coco_discard(objects_coco *coco);

#endif
