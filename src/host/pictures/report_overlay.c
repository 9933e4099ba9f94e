/* Drawings over an image: head, the image in pale grey, drawing, legend. */
#include "src/base/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "src/host/files/map_file_image.h"
#include "src/host/pictures/report_overlay.h"

#define PICTURE_SIDE_PX 1000.0 /* px, the longer side of the image */
/* px, height of the legend */
#define LEGEND_HEIGHT 50.0

static cairn_status print_image(cairn_output *output, const cairn_report_overlay *overlay)
{
    uint8_t *png;
    size_t count;
    cairn_status status =
        cairn_image_encode_png(&png, &count, overlay->grey, overlay->width, overlay->height, 1);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(output,
                       "<image x=\"-0.5\" y=\"-0.5\" width=\"%d\" height=\"%d\" opacity=\"0.55\" "
                       "href=\"data:image/png;base64,",
                       (int)overlay->width, (int)overlay->height);
    cairn_report_print_base64(output, png, count);
    cairn_output_print(output, "\"/>\n");
    free(png);
    return CAIRN_OK;
}

double cairn_report_overlay_scale(const cairn_report_overlay *overlay)
{
    return PICTURE_SIDE_PX / fmax(overlay->width, overlay->height);
}

static double head_of(const cairn_report_overlay *overlay)
{
    return cairn_report_head_height(overlay->title, overlay->subtitle);
}

static double height_of(const cairn_report_overlay *overlay)
{
    return head_of(overlay) + cairn_report_overlay_scale(overlay) * overlay->height + LEGEND_HEIGHT;
}

cairn_status cairn_report_overlay_begin(cairn_output *output, const cairn_report_overlay *overlay,
                                        const char *style)
{
    double scale = cairn_report_overlay_scale(overlay);

    cairn_report_print_head(
        output, fmax(overlay->min_width, 2 * CAIRN_REPORT_MARGIN + scale * overlay->width),
        height_of(overlay), overlay->title, overlay->subtitle);
    cairn_output_print(
        output, "<style>.over path,.over circle,.over .box{clip-path:url(#frame)}%s</style>\n",
        style);
    cairn_output_print(output,
                       "<g class=\"over\" transform=\"translate(%.1f %.1f) scale(%.6f)\">\n",
                       CAIRN_REPORT_MARGIN + 0.5 * scale, head_of(overlay) + 0.5 * scale, scale);
    cairn_output_print(output,
                       "<clipPath id=\"frame\"><rect x=\"-0.5\" y=\"-0.5\" width=\"%d\" "
                       "height=\"%d\"/></clipPath>\n"
                       "<rect x=\"-0.5\" y=\"-0.5\" width=\"%d\" height=\"%d\" fill=\"#fff\"/>\n",
                       (int)overlay->width, (int)overlay->height, (int)overlay->width,
                       (int)overlay->height);
    return overlay->grey != NULL ? print_image(output, overlay) : CAIRN_OK;
}

cairn_status cairn_report_overlay_end(cairn_output *output, const cairn_report_overlay *overlay,
                                      cairn_status status, const char *path,
                                      cairn_file_error *error)
{
    cairn_output_print(output, "</g>\n");
    cairn_report_print_keys(output, height_of(overlay) - CAIRN_REPORT_MARGIN, overlay->key_step,
                            overlay->keys, overlay->key_count);
    cairn_output_print(output, "</svg>\n");
    if (status != CAIRN_OK) {
        cairn_output_discard(output);
        return cairn_file_error_system(error, path, "draw", ENOMEM);
    }
    return cairn_output_commit(output, error);
}
