/* Occupancy grid maps of map_server: cells, and the writer. map_file_yaml.c reads the YAML file. */
#include "src/base/build.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/number_text.h"
#include "cairn/output.h"
#include "src/host/files/map_file_work.h"

/* Grey levels of free and unknown cells, as map_server writes them. */
#define PIXEL_FREE    254
#define PIXEL_UNKNOWN 205

static const char *const mode_name[] = {"trinary", "scale", "raw"};

cairn_map_file cairn_map_file_default(void)
{
    cairn_map_file map;

    memset(&map, 0, sizeof map);
    map.resolution = CAIRN_REAL(0.05);
    map.occupied_threshold = CAIRN_REAL(0.65);
    map.free_threshold = CAIRN_REAL(0.196);
    return map;
}

void cairn_map_file_free(cairn_map_file *map)
{
    free(map->pixel);
    free(map->occupancy);
    map->pixel = NULL;
    map->occupancy = NULL;
    map->width = 0;
    map->height = 0;
}

cairn_status cairn_map_file_allocate(cairn_map_file *map, int32_t width, int32_t height)
{
    size_t count;

    if (width < 1 || height < 1)
        return CAIRN_BAD_ARGUMENT;
    if (height > CAIRN_MAP_FILE_MAX_CELLS / width)
        return CAIRN_FULL;
    count = (size_t)width * (size_t)height;
    map->pixel = malloc(count);
    map->occupancy = malloc(count);
    if (map->pixel == NULL || map->occupancy == NULL) {
        cairn_map_file_free(map);
        return CAIRN_NO_MEMORY;
    }
    map->width = width;
    map->height = height;
    memset(map->pixel, PIXEL_UNKNOWN, count);
    memset(map->occupancy, -1, count);
    return CAIRN_OK;
}

/* Returns the occupancy probability of a grey level. */
static cairn_real probability_of(const cairn_map_file *map, int32_t pixel)
{
    return (cairn_real)(map->negate ? pixel : 255 - pixel) / 255;
}

/* Returns the occupancy of a grey level: -1, or 0 ... 100. */
static int8_t occupancy_of(const cairn_map_file *map, uint8_t pixel)
{
    cairn_real occupied = map->occupied_threshold, unoccupied = map->free_threshold,
               p = probability_of(map, pixel);

    if (map->mode == CAIRN_MAP_FILE_RAW)
        return (int8_t)(pixel <= 100 ? pixel : -1);
    if (p > occupied)
        return 100;
    if (p < unoccupied)
        return 0;
    if (map->mode == CAIRN_MAP_FILE_TRINARY)
        return -1;
    return (int8_t)(occupied > unoccupied ? 1 + 98 * (p - unoccupied) / (occupied - unoccupied)
                                          : 1);
}

cairn_status cairn_map_file_fill(cairn_map_file *map, const cairn_image *image)
{
    cairn_status status = cairn_map_file_allocate(map, image->width, image->height);
    int32_t x, y;

    for (y = 0; y < map->height; y++) {
        size_t from = (size_t)(map->height - 1 - y) * (size_t)map->width,
               to = (size_t)y * (size_t)map->width;

        for (x = 0; x < map->width; x++, from++, to++) {
            map->pixel[to] = image->pixel[from];
            map->occupancy[to] = (int8_t)(image->alpha != NULL && image->alpha[from] == 0
                                              ? -1
                                              : occupancy_of(map, image->pixel[from]));
        }
    }
    return status;
}

/* Returns the grey level of unknown cells: the usual one, or the one halfway between the thresholds
 * where they would classify the usual one as free or occupied. */
static int32_t unknown_pixel(const cairn_map_file *map)
{
    int32_t pixel = map->negate ? 255 - PIXEL_UNKNOWN : PIXEL_UNKNOWN;
    cairn_real p = probability_of(map, pixel);

    if (p >= map->free_threshold && p <= map->occupied_threshold)
        return pixel;
    pixel = cairn_real_to_int(255 * (map->free_threshold + map->occupied_threshold) / 2 +
                              CAIRN_REAL(0.5));
    return map->negate ? pixel : 255 - pixel;
}

/* Returns the grey level of an occupancy. */
static uint8_t pixel_of(const cairn_map_file *map, int8_t occupancy, int32_t unknown)
{
    cairn_real p = CAIRN_REAL(0.01) * (cairn_real)occupancy;

    if (map->mode == CAIRN_MAP_FILE_RAW)
        return (uint8_t)(occupancy < 0 || occupancy > 100 ? 255 : occupancy);
    if (occupancy >= 0 && p > map->occupied_threshold)
        return map->negate ? 255 : 0;
    if (occupancy >= 0 && p < map->free_threshold)
        return map->negate ? 255 - PIXEL_FREE : PIXEL_FREE;
    return (uint8_t)unknown;
}

cairn_status cairn_map_file_draw(cairn_map_file *map)
{
    size_t count = (size_t)map->width * (size_t)map->height, i;
    int32_t unknown = unknown_pixel(map);

    if (map->mode != CAIRN_MAP_FILE_TRINARY && map->mode != CAIRN_MAP_FILE_RAW)
        return CAIRN_UNSUPPORTED;
    for (i = 0; i < count; i++)
        map->pixel[i] = pixel_of(map, map->occupancy[i], unknown);
    return CAIRN_OK;
}

/* Writes the pixels as an image, rows flipped. */
static cairn_status write_image(const cairn_map_file *map, const char *path,
                                cairn_map_file_image format, cairn_file_error *error)
{
    size_t width = (size_t)map->width, count = width * (size_t)map->height, y;
    uint8_t *flipped = malloc(count);
    cairn_status status;

    if (flipped == NULL)
        return cairn_file_error_system(error, path, "write", ENOMEM);
    for (y = 0; y < (size_t)map->height; y++)
        memcpy(flipped + ((size_t)map->height - 1 - y) * width, map->pixel + y * width, width);
    status = format == CAIRN_MAP_FILE_PNG
                 ? cairn_image_write_png(path, flipped, map->width, map->height, error)
                 : cairn_image_write_pgm(path, flipped, map->width, map->height, error);
    free(flipped);
    return status;
}

/* Prints a YAML string in single quotes, which is safe for any name without a line end. */
static void print_quoted(cairn_output *output, const char *text)
{
    cairn_output_print(output, "'");
    for (; *text != 0; text++)
        cairn_output_bytes(output, *text == '\'' ? "''" : text, *text == '\'' ? 2 : 1);
    cairn_output_print(output, "'");
}

static cairn_status write_yaml(const cairn_map_file *map, const char *path, const char *image,
                               cairn_file_error *error)
{
    char a[CAIRN_NUMBER_TEXT_BYTES], b[CAIRN_NUMBER_TEXT_BYTES], c[CAIRN_NUMBER_TEXT_BYTES];
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(output, "image: ");
    print_quoted(output, image);
    cairn_output_print(output, "\nresolution: %s\norigin: [%s, %s, ",
                       cairn_number_write(a, map->resolution), cairn_number_write(b, map->origin.x),
                       cairn_number_write(c, map->origin.y));
    cairn_output_print(output, "%s]\nnegate: %d\noccupied_thresh: %s\nfree_thresh: %s\nmode: %s\n",
                       cairn_number_write(a, map->origin.theta), (int)map->negate,
                       cairn_number_write(b, map->occupied_threshold),
                       cairn_number_write(c, map->free_threshold), mode_name[map->mode]);
    return cairn_output_commit(output, error);
}

/* Validates a map before it is written. */
static cairn_status check(const cairn_map_file *map, const char *path, cairn_map_file_image format,
                          cairn_file_error *error)
{
    const char *problem = NULL;

    if (map->pixel == NULL || map->width < 1 || map->height < 1)
        problem = "no cells";
    else if (!(map->resolution > 0) || !cairn_is_finite(map->resolution))
        problem = "a resolution that is not above 0";
    else if (!(map->free_threshold >= 0 && map->free_threshold <= map->occupied_threshold &&
               map->occupied_threshold <= 1))
        problem = "thresholds that are not 0 <= free <= occupied <= 1";
    else if (map->mode < CAIRN_MAP_FILE_TRINARY || map->mode > CAIRN_MAP_FILE_RAW ||
             (map->negate != 0 && map->negate != 1))
        problem = "an unknown mode";
    else if (format != CAIRN_MAP_FILE_PGM && format != CAIRN_MAP_FILE_PNG)
        problem = "an unknown image format";
    if (problem != NULL)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0, "not written: %s", problem);
    if (!cairn_pose_is_finite(map->origin))
        return cairn_file_error_set(error, CAIRN_NOT_FINITE, path, 0,
                                    "not written: an origin that is not finite");
    return CAIRN_OK;
}

cairn_status cairn_map_file_write(const cairn_map_file *map, const char *yaml_path,
                                  cairn_map_file_image format, cairn_file_error *error)
{
    const char *name = cairn_output_path_name(yaml_path), *dot = strrchr(name, '.');
    size_t stem = dot != NULL && dot != name ? (size_t)(dot - yaml_path) : strlen(yaml_path);
    cairn_status status = check(map, yaml_path, format, error);
    char *image;

    if (status != CAIRN_OK)
        return status;
    image = malloc(stem + 5);
    if (image == NULL)
        return cairn_file_error_system(error, yaml_path, "write", ENOMEM);
    memcpy(image, yaml_path, stem);
    memcpy(image + stem, format == CAIRN_MAP_FILE_PNG ? ".png" : ".pgm", 5);
    status = write_image(map, image, format, error);
    if (status == CAIRN_OK)
        status = write_yaml(map, yaml_path, cairn_output_path_name(image), error);
    free(image);
    return status;
}
