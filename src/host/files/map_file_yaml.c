/* Reader of map files. The YAML file is parsed into libyaml's document tree, whose nodes have line
 * numbers for errors. map_file_no_yaml.c takes its place where libyaml is missing. */
#include "src/base/build.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <yaml.h>

#include "cairn/number_text.h"
#include "cairn/output.h"
#include "src/host/files/map_file_work.h"
#include "src/host/logs/carmen_log_reader.h"
#include "src/host/base/regular_file.h"

/* The maximum size of the YAML file: libyaml takes quadratic time for nested and anchored nodes. */
#define MAX_YAML_BYTES 16384

enum {
    KEY_IMAGE,
    KEY_RESOLUTION,
    KEY_ORIGIN,
    KEY_NEGATE,
    KEY_OCCUPIED,
    KEY_FREE,
    KEY_MODE,
    KEY_COUNT
};

static const char *const key_name[KEY_COUNT] = {
    "image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode"};

/* The parsed YAML file. */
typedef struct yaml_view {
    yaml_document_t document;
    yaml_node_t *value[KEY_COUNT]; /* NULL: the key is missing */
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
        for (k = 0; k < KEY_COUNT && key->type == YAML_SCALAR_NODE; k++) {
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
    status = cairn_map_file_fill(map, &image);
    if (status != CAIRN_OK)
        (void)cairn_file_error_system(view->error, view->path, "read", ENOMEM);
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
