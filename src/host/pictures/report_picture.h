/* report_picture: images embedded in a map picture. Internal to the host library. */
#ifndef CAIRN_HOST_REPORT_PICTURE_H
#define CAIRN_HOST_REPORT_PICTURE_H

#include "cairn/output.h"
#include "src/host/pictures/report_layout.h"

/* Embeds a density image of all walls of a panel, two samples a pixel, darker where more points
 * fall. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_report_draw_density(cairn_output *output,
                                                     const cairn_report_view *view,
                                                     const cairn_report_map *map,
                                                     const cairn_pose *pose);

/* Downscales a grid to at most 2048 cells a side; a cell is the darkest of the cells that it
 * covers. *pixel: its pixels, row 0 topmost, to be freed by free(). CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_report_coarsen_grid(const cairn_report_grid *grid,
                                                     cairn_report_grid *coarse, uint8_t **pixel);

/* Embeds a grid, downscaled if it has more than 2048 cells a side. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_report_draw_grid(cairn_output *output,
                                                  const cairn_report_view *view,
                                                  const cairn_report_grid *grid);

#endif
