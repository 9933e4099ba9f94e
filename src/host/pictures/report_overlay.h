/* report_overlay: drawings over an image. Internal to the host library. */
#ifndef CAIRN_HOST_REPORT_OVERLAY_H
#define CAIRN_HOST_REPORT_OVERLAY_H

#include "cairn/output.h"
#include "src/host/pictures/report_text.h"

/* The frame of a drawing. */
typedef struct cairn_report_overlay {
    const char *title, *subtitle;
    const uint8_t *grey;   /* [height * width] row 0 topmost; NULL: white */
    int32_t width, height; /* of the image, pixels */
    double min_width;      /* minimum width of the picture for its legend, px */
    const cairn_report_key *keys;
    int32_t key_count;
    double key_step; /* px between entries of the legend */
} cairn_report_overlay;

/* Returns the scale: px of the picture for a pixel of the image. */
double cairn_report_overlay_scale(const cairn_report_overlay *overlay);

/* Begins the picture, with the text of its style element. Drawing then is in coordinates of the
 * image, whose pixels have their centres at integers. CAIRN_NO_MEMORY: the image is omitted. */
CAIRN_CHECKED cairn_status cairn_report_overlay_begin(cairn_output *output,
                                                      const cairn_report_overlay *overlay,
                                                      const char *style);

/* Ends the picture with its legend. Commits it when `status` is CAIRN_OK; otherwise no file is
 * written. */
CAIRN_CHECKED cairn_status cairn_report_overlay_end(cairn_output *output,
                                                    const cairn_report_overlay *overlay,
                                                    cairn_status status, const char *path,
                                                    cairn_file_error *error);

#endif
