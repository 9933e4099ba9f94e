/* report_overlay: pictures of what was found in an image, drawn over it. Internal to the host
 * library. */
#ifndef CAIRN_HOST_REPORT_OVERLAY_H
#define CAIRN_HOST_REPORT_OVERLAY_H

#include "cairn/output.h"
#include "src/host/report_text.h"

typedef struct cairn_report_overlay {
    const char *title, *subtitle;
    const uint8_t *grey;   /* [height * width] row 0 topmost; NULL: white */
    int32_t width, height; /* px of the image */
    double least_width;    /* of the picture, for its keys */
    const cairn_report_key *keys;
    int32_t key_count;
    double key_step; /* from one key to the next */
} cairn_report_overlay;

/* Units of the picture for a pixel of the image. */
double cairn_report_overlay_scale(const cairn_report_overlay *overlay);

/* Begins the picture, with the text of a style element; then in coordinates of the image, whose
 * pixels have their middles at whole ones. CAIRN_NO_MEMORY: the image is left out. */
CAIRN_CHECKED cairn_status cairn_report_overlay_begin(cairn_output *output,
                                                      const cairn_report_overlay *overlay,
                                                      const char *style);

/* Ends the picture with its keys; commits it when `status` is CAIRN_OK, otherwise there is no
 * file. */
CAIRN_CHECKED cairn_status cairn_report_overlay_end(cairn_output *output,
                                                    const cairn_report_overlay *overlay,
                                                    cairn_status status, const char *path,
                                                    cairn_file_error *error);

#endif
