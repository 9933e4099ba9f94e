/* map_file_work: what the reader and the writer of map files share. Internal to map_file. */
#ifndef CAIRN_HOST_MAP_FILE_WORK_H
#define CAIRN_HOST_MAP_FILE_WORK_H

#include "cairn/map_file.h"
#include "src/host/files/map_file_image.h"

/* Allocates the cells and fills them from an image, rows flipped, by the mode and the thresholds of
 * the map. As cairn_map_file_allocate(). */
CAIRN_CHECKED cairn_status cairn_map_file_fill(cairn_map_file *map, const cairn_image *image);

#endif
