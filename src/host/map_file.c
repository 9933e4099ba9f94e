/* Occupancy grid maps of map_server. The YAML file is parsed into libyaml's document tree, whose
 * nodes have line numbers for errors. */
#include "src/core/build.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <yaml.h>

#include "cairn/map_file.h"
#include "cairn/number_text.h"
#include "cairn/output.h"
#include "src/host/map_file_image.h"
#include "src/host/carmen_log_reader.h"
#include "src/host/regular_file.h"

/* Grey levels of free and unknown cells, as map_server writes them. */
#define PIXEL_FREE    254
#define PIXEL_UNKNOWN 205

/* The maximum size of the YAML file: libyaml takes quadratic time for nested and anchored nodes. */
#define MAX_YAML_BYTES 16384

enum { KEY_IMAGE, KEY_RESOLUTION, KEY_ORIGIN, KEY_NEGATE, KEY_OCCUPIED, KEY_FREE, KEY_MODE, KEYS };

static const char *const key_name[KEYS] = {"image",           "resolution",  "origin", "negate",
                                           "occupied_thresh", "free_thresh", "mode"};
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

/* ---- Reading ---- */

/* The parsed YAML file. */
typedef struct yaml_view {
    yaml_document_t document;
    yaml_node_t *value[KEYS]; /* NULL: the key is missing */
    const char *path;
    cairn_file_error *error;
} yaml_view;

static int64_t line_of(const yaml_node_t *node)
{
    return (int64_t)node->start_mark.line + 1;
}

static const char *scalar(const yaml_node_t *node)
{
    return (const char *)node->data.scalar.value;
}

static cairn_status bad_value(const yaml_view *view, int key, const yaml_node_t *node,
                              const char *expected)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];

    if (node->type != YAML_SCALAR_NODE)
        return cairn_file_error_set(
            view->error, CAIRN_BAD_FORMAT, view->path, line_of(node), "%s is a %s, expected %s",
            key_name[key], node->type == YAML_SEQUENCE_NODE ? "list" : "mapping", expected);
    return cairn_file_error_set(
        view->error, CAIRN_BAD_FORMAT, view->path, line_of(node), "%s is %s, expected %s",
        key_name[key], cairn_token_text(shown, scalar(node), node->data.scalar.length), expected);
}

/* Finds the known keys of the topmost mapping; other keys are ignored. */
static cairn_status find_keys(yaml_view *view)
{
    yaml_node_t *root = yaml_document_get_root_node(&view->document), *key;
    yaml_node_pair_t *pair;
    int k;

    if (root == NULL)
        return cairn_file_error_set(view->error, CAIRN_EMPTY, view->path, 0,
                                    "the file is empty, expected the description of a map");
    if (root->type != YAML_MAPPING_NODE)
        return cairn_file_error_set(view->error, CAIRN_BAD_FORMAT, view->path, line_of(root),
                                    "no \"key: value\" lines, expected the description of a map");
    for (pair = root->data.mapping.pairs.start; pair < root->data.mapping.pairs.top; pair++) {
        key = yaml_document_get_node(&view->document, pair->key);
        for (k = 0; k < KEYS && key->type == YAML_SCALAR_NODE; k++) {
            if (strcmp(scalar(key), key_name[k]) != 0)
                continue;
            if (view->value[k] != NULL)
                return cairn_file_error_set(view->error, CAIRN_BAD_FORMAT, view->path, line_of(key),
                                            "%s is there twice, expected it once", key_name[k]);
            view->value[k] = yaml_document_get_node(&view->document, pair->value);
        }
    }
    for (k = 0; k < KEY_MODE; k++)
        if (view->value[k] == NULL)
            return cairn_file_error_set(
                view->error, CAIRN_BAD_FORMAT, view->path, line_of(root),
                "no key \"%s\", expected image, resolution, origin, negate, occupied_thresh and "
                "free_thresh",
                key_name[k]);
    return CAIRN_OK;
}

/* Reads a number from `minimum` to `maximum`. */
static cairn_status read_number(const yaml_view *view, int key, const yaml_node_t *node,
                                double minimum, double maximum, const char *expected,
                                cairn_real *value)
{
    double number;

    if (node->type != YAML_SCALAR_NODE ||
        !cairn_number_read(scalar(node), node->data.scalar.length, &number) ||
        !(number >= minimum && number <= maximum))
        return bad_value(view, key, node, expected);
    *value = (cairn_real)number;
    return CAIRN_OK;
}

static cairn_status read_origin(yaml_view *view, cairn_pose *origin)
{
    const char *expected = "a list of three finite numbers: x, y, yaw";
    yaml_node_t *node = view->value[KEY_ORIGIN];
    yaml_node_item_t *item;
    cairn_real *const element[] = {&origin->x, &origin->y, &origin->theta};
    cairn_status status;
    int i;

    if (node->type != YAML_SEQUENCE_NODE)
        return bad_value(view, KEY_ORIGIN, node, expected);
    item = node->data.sequence.items.start;
    if (node->data.sequence.items.top - item != 3)
        return cairn_file_error_set(view->error, CAIRN_BAD_FORMAT, view->path, line_of(node),
                                    "origin has %d elements, expected %s",
                                    (int)(node->data.sequence.items.top - item), expected);
    for (i = 0; i < 3; i++) {
        status = read_number(view, KEY_ORIGIN, yaml_document_get_node(&view->document, item[i]),
                             -(double)FLT_MAX, (double)FLT_MAX, expected, element[i]);
        if (status != CAIRN_OK)
            return status;
    }
    return CAIRN_OK;
}

/* Returns 1 + the index of a scalar in a list that ends with NULL; 0: none. */
static int is_one_of(const yaml_node_t *node, const char *const *words)
{
    int i;

    for (i = 0; node->type == YAML_SCALAR_NODE && words[i] != NULL; i++)
        if (strcmp(scalar(node), words[i]) == 0)
            return i + 1;
    return 0;
}

static cairn_status read_flags(const yaml_view *view, cairn_map_file *map)
{
    static const char *const truths[] = {"0", "1", "false", "true", "False", "True", NULL};
    static const char *const modes[] = {"trinary", "scale", "raw", NULL};
    int word = is_one_of(view->value[KEY_NEGATE], truths);

    if (word == 0)
        return bad_value(view, KEY_NEGATE, view->value[KEY_NEGATE], "0 or 1");
    map->negate = (word - 1) % 2;
    if (view->value[KEY_MODE] == NULL)
        return CAIRN_OK;
    word = is_one_of(view->value[KEY_MODE], modes);
    if (word == 0)
        return bad_value(view, KEY_MODE, view->value[KEY_MODE], "trinary, scale or raw");
    map->mode = word - 1;
    return CAIRN_OK;
}

/* Reads and validates all values but the image. */
static cairn_status read_values(yaml_view *view, cairn_map_file *map)
{
    cairn_status status;

    status = read_number(view, KEY_RESOLUTION, view->value[KEY_RESOLUTION], (double)FLT_MIN,
                         (double)FLT_MAX, "metres per pixel above 0", &map->resolution);
    if (status == CAIRN_OK)
        status = read_number(view, KEY_OCCUPIED, view->value[KEY_OCCUPIED], 0, 1,
                             "a number from 0 to 1", &map->occupied_threshold);
    if (status == CAIRN_OK)
        status = read_number(view, KEY_FREE, view->value[KEY_FREE], 0, 1, "a number from 0 to 1",
                             &map->free_threshold);
    if (status == CAIRN_OK && map->free_threshold > map->occupied_threshold)
        status = bad_value(view, KEY_FREE, view->value[KEY_FREE], "at most occupied_thresh");
    if (status == CAIRN_OK)
        status = read_origin(view, &map->origin);
    if (status == CAIRN_OK)
        status = read_flags(view, map);
    return status;
}

/* Reads the image into pixels and occupancy, rows flipped. */
static cairn_status load_image(const yaml_view *view, cairn_map_file *map)
{
    const yaml_node_t *node = view->value[KEY_IMAGE];
    char *folder, *path = NULL;
    cairn_file_error fault;
    cairn_image image;
    cairn_status status;
    int32_t x, y;

    if (node->type != YAML_SCALAR_NODE || scalar(node)[0] == 0)
        return bad_value(view, KEY_IMAGE, node, "the path of an image");
    folder = cairn_output_path_folder(view->path);
    if (folder != NULL)
        path = cairn_output_path_join(folder, scalar(node));
    free(folder);
    if (path == NULL)
        return cairn_file_error_system(view->error, view->path, "read", ENOMEM);
    status = cairn_image_read(&image, path, &fault);
    free(path);
    if (status != CAIRN_OK)
        return cairn_file_error_set(view->error, status, view->path, line_of(node),
                                    "the image cannot be read: %s", fault.text);
    status = cairn_map_file_allocate(map, image.width, image.height);
    if (status != CAIRN_OK)
        (void)cairn_file_error_system(view->error, view->path, "read", ENOMEM);
    for (y = 0; y < map->height; y++) {
        size_t from = (size_t)(map->height - 1 - y) * (size_t)map->width,
               to = (size_t)y * (size_t)map->width;

        for (x = 0; x < map->width; x++, from++, to++) {
            map->pixel[to] = image.pixel[from];
            map->occupancy[to] = (int8_t)(image.alpha != NULL && image.alpha[from] == 0
                                              ? -1
                                              : occupancy_of(map, image.pixel[from]));
        }
    }
    cairn_image_free(&image);
    return status;
}

/* Parses the YAML file into a document tree. */
static cairn_status read_document(yaml_view *view, FILE *file)
{
    yaml_parser_t parser;
    cairn_status status = CAIRN_OK;
    struct stat about;

    if (fstat(fileno(file), &about) != 0)
        return cairn_file_error_system(view->error, view->path, "read", errno);
    if (about.st_size > MAX_YAML_BYTES)
        return cairn_file_error_set(view->error, CAIRN_FULL, view->path, 0,
                                    "%lld bytes, expected the description of a map of at most %d",
                                    (long long)about.st_size, MAX_YAML_BYTES);
    if (!yaml_parser_initialize(&parser))
        return cairn_file_error_system(view->error, view->path, "read", ENOMEM);
    yaml_parser_set_input_file(&parser, file);
    if (!yaml_parser_load(&parser, &view->document)) {
        if (ferror(file))
            status = cairn_file_error_system(view->error, view->path, "read", errno);
        else if (parser.error == YAML_MEMORY_ERROR)
            status = cairn_file_error_system(view->error, view->path, "read", ENOMEM);
        else
            status = cairn_file_error_set(
                view->error, CAIRN_BAD_FORMAT, view->path, (int64_t)parser.problem_mark.line + 1,
                "%s, expected YAML", parser.problem != NULL ? parser.problem : "cannot be parsed");
    }
    yaml_parser_delete(&parser);
    return status;
}

cairn_status cairn_map_file_read(cairn_map_file *map, const char *yaml_path,
                                 cairn_file_error *error)
{
    cairn_map_file read = cairn_map_file_default();
    yaml_view view;
    cairn_status status;
    FILE *file;

    *map = read;
    status = regular_file_open(&file, yaml_path, error);
    if (status != CAIRN_OK)
        return status;
    memset(&view, 0, sizeof view);
    view.path = yaml_path;
    view.error = error;
    status = read_document(&view, file);
    (void)fclose(file);
    if (status != CAIRN_OK)
        return status;
    status = find_keys(&view);
    if (status == CAIRN_OK)
        status = read_values(&view, &read);
    if (status == CAIRN_OK)
        status = load_image(&view, &read);
    yaml_document_delete(&view.document);
    if (status == CAIRN_OK)
        *map = read;
    return status;
}

/* ---- Writing ---- */

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
