/* detection_file: detections in an image as SVG over it, and as JSON. docs/formats.md says what
 * is in it. */
#ifndef CAIRN_DETECTION_FILE_H
#define CAIRN_DETECTION_FILE_H

#include "cairn/object_detect.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_detection_picture {
    const char *image; /* name */
    const char *model_name;
    const uint8_t *grey; /* [height * width] as searched; NULL: drawn without */
    int32_t shrink;      /* the image's pixels along a side of a searched one, >= 1 */
    const cairn_contour_tokens *tokens;
    const cairn_detections *detections;
} cairn_detection_picture;

/* The box of a detection in pixels of the image: left, top, right, bottom. */
void cairn_detection_box(const cairn_detection_picture *picture, const cairn_detection *detection,
                         double box[4]);

/* SVG: the image, boxes with scores, segments, the bent outlines, dashed where nothing is seen.
 * CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_detection_file_draw(const cairn_detection_picture *picture,
                                                     const char *path, cairn_file_error *error);

/* JSON, in pixels of the image. CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_detection_file_write(const cairn_detection_picture *picture,
                                                      const char *path, cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
