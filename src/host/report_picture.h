/* report_picture: the parts of a map picture that are images. Internal to the host library. */
#ifndef CAIRN_HOST_REPORT_PICTURE_H
#define CAIRN_HOST_REPORT_PICTURE_H

#include "cairn/output.h"
#include "src/host/report_layout.h"

/* Embeds a grey picture of all walls of a panel, two samples a pixel, darker where more points
 * fall. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_report_draw_density(cairn_output *output,
                                                     const cairn_report_view *view,
                                                     const cairn_report_map *map,
                                                     const cairn_pose *pose);

/* A grid of at most 2048 cells a side, of which each stands for the darkest of several cells;
 * *pixel holds its pixels, row 0 topmost, and is to be freed. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_report_coarsen_grid(const cairn_report_grid *grid,
                                                     cairn_report_grid *coarse, uint8_t **pixel);

/* Embeds a grid. Grids of more than 2048 cells a side are drawn coarser, the darkest cell
 * standing for its neighbours. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_report_draw_grid(cairn_output *output,
                                                  const cairn_report_view *view,
                                                  const cairn_report_grid *grid);

#endif
