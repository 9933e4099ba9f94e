/* merged_map: the cells of map files that are merged, and the map file that they make together.
 * Internal to the host library, its programs and the Python package. */
#ifndef CAIRN_HOST_MERGED_MAP_H
#define CAIRN_HOST_MERGED_MAP_H

#include "cairn/map_file.h"
#include "cairn/map_merge.h"

/* Classifies all cells of a map file as they are merged: by the thresholds in mode raw; in the
 * other modes only fully occupied and free cells are known.
 *
 * cells: [height * width] set to CAIRN_OCCUPANCY_GRID_..., row 0 lowest */
void cairn_merged_map_classify(const cairn_map_file *file, uint8_t *cells);

/* Draws all maps that are placed, in the frame of the reference, into a map file that contains
 * them, to be freed by cairn_map_file_free(). Contradicting cells are decided by majority vote,
 * ties as occupied. CAIRN_FULL: too many cells, or no map is placed; CAIRN_NO_MEMORY. Linear in
 * placed maps times merged cells.
 *
 * maps, placed: [count], count at most 127
 * resolution: of the merged map, m per cell */
CAIRN_CHECKED cairn_status cairn_merged_map_make(const cairn_map_merge_map *maps,
                                                 const cairn_map_merge_placed *placed,
                                                 int32_t count, cairn_real resolution,
                                                 cairn_map_file *merged, cairn_file_error *error);

#endif
