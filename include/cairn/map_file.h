/* map_file: occupancy maps as the map_server of ROS keeps them, an image (PGM or PNG) and a YAML
 * file that describes it:
 *
 *   image: map.pgm              # beside the YAML file unless absolute
 *   resolution: 0.05            # m per pixel
 *   origin: [-10, -5, 0]        # x and y of the lower left corner of the map in m, yaw in rad
 *   negate: 0                   # 1: dark is free
 *   occupied_thresh: 0.65
 *   free_thresh: 0.196
 *   mode: trinary               # or scale, raw; may be left out
 *
 * A pixel v has the occupancy p = (255 - v)/255, or v/255 when negated. Occupied (100) is p >
 * occupied_thresh, free (0) is p < free_thresh; between them is unknown (-1) in mode trinary and 1
 * + 98 (p - free)/(occupied - free), rounded down, in mode scale. In mode raw v itself is the value
 * when it is at most 100, else the cell is unknown. Pixels that are wholly transparent are unknown
 * in all modes.
 *
 * In memory, cell (0, 0) is the lower left one: the rows of the image are turned upside down. */
#ifndef CAIRN_MAP_FILE_H
#define CAIRN_MAP_FILE_H

#include "cairn/file_error.h"
#include "cairn/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The most cells of a map. */
#define CAIRN_MAP_FILE_CELLS_MOST (INT32_C(1) << 28)

typedef int32_t cairn_map_file_mode;
enum { CAIRN_MAP_TRINARY = 0, CAIRN_MAP_SCALE = 1, CAIRN_MAP_RAW = 2 };

typedef int32_t cairn_map_file_image;
enum { CAIRN_MAP_PGM = 0, CAIRN_MAP_PNG = 1 };

typedef struct cairn_map_file {
    int32_t width, height;
    cairn_real resolution; /* m */
    cairn_pose origin;     /* of the lower left corner of cell (0, 0), theta as in the file */
    int32_t negate;        /* 0 or 1 */
    cairn_real occupied_threshold, free_threshold;
    cairn_map_file_mode mode;
    uint8_t *pixel;    /* [height * width] as in the image, row 0 lowest */
    int8_t *occupancy; /* [height * width] -1: unknown, 0: free .. 100: occupied; row 0 lowest */
} cairn_map_file;

/* No cells; resolution 0.05, origin 0, thresholds 0.65 and 0.196, trinary. */
cairn_map_file cairn_map_file_default(void);

/* Makes the arrays, all cells unknown (occupancy -1, pixel 205). CAIRN_BAD_ARGUMENT: a size
 * below 1; CAIRN_FULL: more than CAIRN_MAP_FILE_CELLS_MOST; CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_map_file_allocate(cairn_map_file *map, int32_t width,
                                                   int32_t height);

/* Sets the pixels from the occupancy. Trinary: 0 or 254 by the thresholds (negated: 255 or 1);
 * 205 (50) for what is between them or unknown, or a level halfway between the thresholds where
 * these would call 205 free or occupied. Raw: the occupancy, 255 for unknown. CAIRN_UNSUPPORTED
 * in mode scale, in which a grey level for unknown does not exist. */
CAIRN_CHECKED cairn_status cairn_map_file_draw(cairn_map_file *map);

/* Reads a YAML file and its image. CAIRN_BAD_FORMAT: not as said above (the error names file and
 * line); CAIRN_TRUNCATED, CAIRN_UNSUPPORTED (grey levels other than 255), CAIRN_FULL, CAIRN_IO,
 * CAIRN_NO_MEMORY. On failure there is nothing to free. */
CAIRN_CHECKED cairn_status cairn_map_file_read(cairn_map_file *map, const char *yaml_path,
                                               cairn_file_error *error);

/* Writes the image from `pixel`, under the name of the YAML file with .pgm or .png at its end,
 * then the YAML file. CAIRN_BAD_ARGUMENT: no cells, a resolution that is not above 0, thresholds
 * that are not 0 <= free <= occupied <= 1, an unknown mode or format; CAIRN_NOT_FINITE: the
 * origin; CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_map_file_write(const cairn_map_file *map, const char *yaml_path,
                                                cairn_map_file_image format,
                                                cairn_file_error *error);

void cairn_map_file_free(cairn_map_file *map);

#ifdef __cplusplus
}
#endif

#endif
