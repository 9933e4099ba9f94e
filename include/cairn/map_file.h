/* map_file: reader and writer of occupancy grid maps in the format of ROS map_server: an image (PGM
 * or PNG) and a YAML file with its metadata.
 *
 *   image: map.pgm              # relative to the YAML file unless absolute
 *   resolution: 0.05            # m per pixel
 *   origin: [-10, -5, 0]        # lower left corner of the map: x and y in m, yaw in rad
 *   negate: 0                   # 1: dark is free
 *   occupied_thresh: 0.65
 *   free_thresh: 0.196
 *   mode: trinary               # or scale, raw; optional
 *
 * A pixel v has the occupancy probability p = (255 - v)/255, or v/255 when negated. A cell is
 * occupied (100) if p > occupied_thresh and free (0) if p < free_thresh. In between it is unknown
 * (-1) in mode trinary and 1 + 98 (p - free)/(occupied - free), rounded down, in mode scale. In
 * mode raw the value is v when it is at most 100, else unknown. Fully transparent pixels are
 * unknown in all modes.
 *
 * In memory, cell (0, 0) is the lower left one: the rows of the image are flipped vertically. */
#ifndef CAIRN_MAP_FILE_H
#define CAIRN_MAP_FILE_H

#include "cairn/file_error.h"
#include "cairn/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The maximum number of cells of a map. */
#define CAIRN_MAP_FILE_MAX_CELLS (INT32_C(1) << 28)

/* How pixels are interpreted. */
typedef int32_t cairn_map_file_mode;
enum {
    /* occupied, free or unknown, by the thresholds */
    CAIRN_MAP_FILE_TRINARY = 0,
    /* grey levels are occupancies */
    CAIRN_MAP_FILE_SCALE = 1,
    /* pixels are occupancies, 0 ... 100; 255: unknown */
    CAIRN_MAP_FILE_RAW = 2
};

/* The format of the image file. */
typedef int32_t cairn_map_file_image;
enum {
    /* binary portable grey map */
    CAIRN_MAP_FILE_PGM = 0,
    /* PNG */
    CAIRN_MAP_FILE_PNG = 1
};

/* A map with its metadata. */
typedef struct cairn_map_file {
    int32_t width, height; /* cells */
    cairn_real resolution; /* m per cell */
    /* pose of the lower left corner of cell (0, 0), m, m, rad; theta as in the file */
    cairn_pose origin;
    int32_t negate;                                /* 0 or 1 */
    cairn_real occupied_threshold, free_threshold; /* probabilities, 0 ... 1 */
    /* how pixels are interpreted */
    cairn_map_file_mode mode;
    uint8_t *pixel;    /* [height * width] grey levels, row 0 lowest */
    int8_t *occupancy; /* [height * width] -1: unknown, 0: free .. 100: occupied; row 0 lowest */
} cairn_map_file;

/* Returns a map without cells and with default metadata: resolution 0.05, origin 0, thresholds 0.65
 * and 0.196, mode trinary. */
cairn_map_file cairn_map_file_default(void);

/* Allocates the arrays, all cells unknown (occupancy -1, pixel 205). CAIRN_BAD_ARGUMENT: a size
 * below 1; CAIRN_FULL: more than CAIRN_MAP_FILE_MAX_CELLS; CAIRN_NO_MEMORY.
 *
 * map: set to the arrays
 * width, height: size, px */
CAIRN_CHECKED cairn_status cairn_map_file_allocate(cairn_map_file *map, int32_t width,
                                                   int32_t height);

/* Renders the occupancy into the pixels. Trinary: occupied 0 or free 254 by the thresholds
 * (negated: 255 or 1), otherwise 205 (negated: 50) for unknown. Where the thresholds would classify
 * that level as free or occupied, unknown is the level halfway between them. Raw: the occupancy,
 * 255 for unknown. CAIRN_UNSUPPORTED: mode scale, which has no grey level for unknown.
 *
 * map: map with occupancy */
CAIRN_CHECKED cairn_status cairn_map_file_draw(cairn_map_file *map);

/* Reads a YAML file and its image. CAIRN_BAD_FORMAT: not in the format above, the error has file
 * and line; CAIRN_TRUNCATED, CAIRN_UNSUPPORTED (a maximum grey level other than 255; a folder, pipe
 * or device; a build without libyaml, or a PNG and a build without libpng), CAIRN_FULL (more than
 * 16 KiB of YAML or 2^28 samples of the image), CAIRN_IO, CAIRN_NO_MEMORY. On failure there is
 * nothing to free.
 *
 * map: set to the map
 * yaml_path: the YAML file */
CAIRN_CHECKED cairn_status cairn_map_file_read(cairn_map_file *map, const char *yaml_path,
                                               cairn_file_error *error);

/* Writes the image from `pixel`, then the YAML file. The image has the path of the YAML file with
 * the extension .pgm or .png. CAIRN_BAD_ARGUMENT: no cells, a resolution that is not above 0,
 * thresholds that are not 0 <= free <= occupied <= 1, an unknown mode or format; CAIRN_NOT_FINITE:
 * the origin; CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * map: map with pixels
 * yaml_path: the YAML file to be written
 * format: format of the image */
CAIRN_CHECKED cairn_status cairn_map_file_write(const cairn_map_file *map, const char *yaml_path,
                                                cairn_map_file_image format,
                                                cairn_file_error *error);

/* Frees the arrays.
 *
 * map: map that was read or allocated */
void cairn_map_file_free(cairn_map_file *map);

#ifdef __cplusplus
}
#endif

#endif
