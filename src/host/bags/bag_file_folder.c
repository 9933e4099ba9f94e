/* The files of a bag folder of ROS 2, by its metadata.yaml.
 *
 * Layout: rosbag2_bagfile_information: relative_file_paths: a list of files in the order of their
 * recording. Early versions put the folder's own name before each.
 *
 * Limits: metadata.yaml of 16 MiB; files outside the folder are refused. */
#include "src/base/build.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <yaml.h>

#include "src/host/bags/bag_file_work.h"
#include "src/host/base/regular_file.h"

static const int64_t MAX_METADATA_BYTES = 16 * 1024 * 1024;

/* Returns folder/name on the heap; NULL when out of memory. */
static char *join_path(const char *folder, const char *name)
{
    size_t length = strlen(folder) + strlen(name) + 2;
    char *path = malloc(length);

    if (path != NULL)
        (void)snprintf(path, length, "%s/%s", folder, name);
    return path;
}

/* Returns the value of a key of a mapping; NULL: none. */
static yaml_node_t *find_key(yaml_document_t *document, const yaml_node_t *mapping, const char *key)
{
    if (mapping == NULL || mapping->type != YAML_MAPPING_NODE)
        return NULL;
    for (yaml_node_pair_t *pair = mapping->data.mapping.pairs.start;
         pair < mapping->data.mapping.pairs.top; pair++) {
        const yaml_node_t *name = yaml_document_get_node(document, pair->key);

        if (name != NULL && name->type == YAML_SCALAR_NODE &&
            strcmp((const char *)name->data.scalar.value, key) == 0)
            return yaml_document_get_node(document, pair->value);
    }
    return NULL;
}

/* Returns 1 when a name has a part "..". */
static int leaves_folder(const char *name)
{
    const char *part = name;

    for (; part != NULL; part = strchr(part, '/') != NULL ? strchr(part, '/') + 1 : NULL)
        if (strncmp(part, "..", 2) == 0 && (part[2] == '/' || part[2] == 0))
            return 1;
    return name[0] == '/';
}

/* Appends the file of a list's item. */
static cairn_status add_file(cairn_bag_files *files, const char *folder, const char *metadata,
                             const yaml_node_t *item, cairn_file_error *error)
{
    const char *name =
        item != NULL && item->type == YAML_SCALAR_NODE ? (const char *)item->data.scalar.value : "";
    int64_t line = item != NULL ? (int64_t)item->start_mark.line + 1 : 0;
    char *path;

    if (name[0] == 0 || leaves_folder(name))
        return cairn_file_error_set(error, CAIRN_BAD_FORMAT, metadata, line,
                                    "the file '%s', expected the name of one in the folder", name);
    path = join_path(folder, name);
    if (path != NULL && access(path, F_OK) != 0 && strchr(name, '/') != NULL) {
        free(path);
        path = join_path(folder, strrchr(name, '/') + 1);
    }
    if (path == NULL)
        return cairn_file_error_system(error, metadata, "read", ENOMEM);
    files->path[files->count++] = path;
    return CAIRN_OK;
}

/* Reads the list of files. */
static cairn_status read_list(cairn_bag_files *files, const char *folder, const char *metadata,
                              yaml_document_t *document, cairn_file_error *error)
{
    yaml_node_t *list = find_key(
        document,
        find_key(document, yaml_document_get_root_node(document), "rosbag2_bagfile_information"),
        "relative_file_paths");
    cairn_status status = CAIRN_OK;
    yaml_node_item_t *item;

    if (list == NULL || list->type != YAML_SEQUENCE_NODE ||
        list->data.sequence.items.start == list->data.sequence.items.top)
        return cairn_file_error_set(
            error, CAIRN_BAD_FORMAT, metadata, 0,
            "no files, expected rosbag2_bagfile_information with relative_file_paths");
    files->path = calloc((size_t)(list->data.sequence.items.top - list->data.sequence.items.start),
                         sizeof *files->path);
    if (files->path == NULL)
        return cairn_file_error_system(error, metadata, "read", ENOMEM);
    for (item = list->data.sequence.items.start;
         item < list->data.sequence.items.top && status == CAIRN_OK; item++)
        status = add_file(files, folder, metadata, yaml_document_get_node(document, *item), error);
    return status;
}

/* Parses an open metadata.yaml. */
static cairn_status parse(cairn_bag_files *files, const char *folder, const char *metadata,
                          FILE *file, cairn_file_error *error)
{
    yaml_document_t document;
    yaml_parser_t parser;
    cairn_status status = CAIRN_OK;

    if (!yaml_parser_initialize(&parser))
        return cairn_file_error_system(error, metadata, "read", ENOMEM);
    yaml_parser_set_input_file(&parser, file);
    if (!yaml_parser_load(&parser, &document) && parser.error == YAML_MEMORY_ERROR) {
        status = cairn_file_error_system(error, metadata, "read", ENOMEM);
    } else if (parser.error != YAML_NO_ERROR) {
        status = cairn_file_error_set(error, CAIRN_BAD_FORMAT, metadata,
                                      (int64_t)parser.problem_mark.line + 1, "%s, expected YAML",
                                      parser.problem != NULL ? parser.problem : "damaged");
    } else {
        status = read_list(files, folder, metadata, &document, error);
        yaml_document_delete(&document);
    }
    yaml_parser_delete(&parser);
    return status;
}

cairn_status cairn_bag_list_files(cairn_bag_files *files, const char *folder,
                                  cairn_file_error *error)
{
    char *metadata = join_path(folder, "metadata.yaml");
    struct stat about;
    cairn_status status;
    FILE *file;

    memset(files, 0, sizeof *files);
    if (metadata == NULL)
        return cairn_file_error_system(error, folder, "read", ENOMEM);
    status = regular_file_open(&file, metadata, error);
    if (status != CAIRN_OK && access(metadata, F_OK) != 0 && errno == ENOENT)
        status = cairn_file_error_set(error, CAIRN_BAD_FORMAT, folder, 0,
                                      "a folder without metadata.yaml, expected a bag of ROS 2 or "
                                      "a file");
    else if (status == CAIRN_OK &&
             (fstat(fileno(file), &about) != 0 || about.st_size > MAX_METADATA_BYTES))
        status = cairn_file_error_set(error, CAIRN_FULL, metadata, 0,
                                      "more than %" PRId64 " bytes, expected at most that",
                                      MAX_METADATA_BYTES);
    else if (status == CAIRN_OK)
        status = parse(files, folder, metadata, file, error);
    if (file != NULL)
        (void)fclose(file);
    free(metadata);
    if (status != CAIRN_OK)
        cairn_bag_free_files(files);
    return status;
}

void cairn_bag_free_files(cairn_bag_files *files)
{
    for (int32_t i = 0; i < files->count; i++)
        free(files->path[i]);
    free(files->path);
    memset(files, 0, sizeof *files);
}
