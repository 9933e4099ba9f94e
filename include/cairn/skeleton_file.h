/* skeleton_file: axes and contours that skeleton_grouping has found, and contours between
 * regions (boundary), as JSON and as pictures over the image. */
#ifndef CAIRN_SKELETON_FILE_H
#define CAIRN_SKELETON_FILE_H

#include "cairn/boundary.h"
#include "cairn/file_error.h"
#include "cairn/skeleton_grouping.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What is written. */
typedef struct cairn_skeleton_picture {
    const char *image;   /* its name, as shown */
    const uint8_t *grey; /* [height * width], to draw over; NULL: white */
    int32_t width, height;
    int32_t edgel_count;
    int32_t proposed; /* 1: the range of radii was proposed from the image */
    cairn_skeleton_result result;
    cairn_boundary_result boundary; /* all 0: not looked for */
} cairn_skeleton_picture;

/* As JSON; docs/formats.md says its keys. CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_skeleton_file_write(const cairn_skeleton_picture *picture,
                                                     const char *path, cairn_file_error *error);

/* Over the image (SVG): contours between regions green; contours of parts blue, dashed where
 * none was seen; axes red. CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_skeleton_file_draw(const cairn_skeleton_picture *picture,
                                                    const char *path, cairn_file_error *error);

/* Centre points as dots, the larger their radius the redder, and the mirror symmetric lines
 * through them in cyan, over the image (SVG; Adluru 2008, fig. 3.3). The skeleton is the one
 * that has found picture->result. CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_skeleton_file_draw_lines(const cairn_skeleton_picture *picture,
                                                          const cairn_skeleton *skeleton,
                                                          const char *path,
                                                          cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
