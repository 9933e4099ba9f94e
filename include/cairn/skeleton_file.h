/* skeleton_file: writer of the skeletons and contours of skeleton_grouping and the region contours
 * of boundary, as JSON and as SVG pictures over the image. */
#ifndef CAIRN_SKELETON_FILE_H
#define CAIRN_SKELETON_FILE_H

#include "cairn/boundary.h"
#include "cairn/file_error.h"
#include "cairn/skeleton_grouping.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The data to be written. */
typedef struct cairn_skeleton_file_picture {
    const char *image;     /* name of the image, as displayed */
    const uint8_t *grey;   /* [height * width] background of the picture; NULL: white */
    int32_t width, height; /* pixels, as it was searched */
    /* pixels of the image along a side of a pixel that was searched: 1, 2, 4 ...; JSON is in pixels
     * of the image, pictures in those that were searched */
    int32_t shrink;
    /* number of edgels of the image */
    int32_t edgel_count;
    int32_t proposed; /* 1: the range of radii was estimated from the image */
    /* skeletons and contours to be written */
    cairn_skeleton_grouping_result result;
    cairn_boundary_result boundary; /* all 0: not computed */
} cairn_skeleton_file_picture;

/* Writes the result as JSON; docs/formats.md defines the keys. CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * picture: what is written
 * path: target */
CAIRN_CHECKED cairn_status cairn_skeleton_file_write(const cairn_skeleton_file_picture *picture,
                                                     const char *path, cairn_file_error *error);

/* Draws the result over the image as SVG: region contours green; contours of parts blue, dashed
 * where no edgel supports them; axes red. CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * picture: what is drawn
 * path: target */
CAIRN_CHECKED cairn_status cairn_skeleton_file_draw(const cairn_skeleton_file_picture *picture,
                                                    const char *path, cairn_file_error *error);

/* Draws the centre points as dots, coloured from blue (small radius) to red, and the
 * mirror-symmetric lines through them in cyan, over the image as SVG (Adluru 2008, fig. 3.3).
 * skeleton: the object that computed picture->result. CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * picture: what is drawn
 * path: target */
CAIRN_CHECKED cairn_status cairn_skeleton_file_draw_lines(
    const cairn_skeleton_file_picture *picture, const cairn_skeleton_grouping *skeleton,
    const char *path, cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
