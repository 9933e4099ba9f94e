/* Input of cairn merge: occupancy maps, by YAML file, image or folder, and lists of one number per
 * map. */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/number_text.h"
#include "cairn/output.h"
#include "src/host/base/posix.h"
#include "src/host/maps/merged_map.h"
#include "tools/cairn_merge.h"

int merge_read_list(const merge_settings *s, const char *name, const char *text, double *list)
{
    const char *from = text;

    for (int32_t i = 0; i < s->count; i++) {
        const char *end = i + 1 < s->count ? strchr(from, ',') : from + strlen(from);

        if (end == NULL || !cairn_number_read(from, (size_t)(end - from), &list[i])) {
            (void)options_refuse(MERGE_PROGRAM,
                                 "%s %s, expected %" PRId32 " numbers with commas between", name,
                                 text, s->count);
            return 0;
        }
        from = end + 1;
    }
    return 1;
}

/* Classifies all cells. Returns 0 when there is no memory. */
static int classify_cells(merge_tool_map *map)
{
    const cairn_map_file *file = &map->file;
    size_t count = (size_t)file->width * (size_t)file->height;

    map->fine = malloc(count);
    map->cells = malloc(count);
    if (map->fine != NULL)
        cairn_merged_map_classify(file, map->fine);
    return map->fine != NULL && map->cells != NULL;
}

/* Returns the path of the YAML file of an input: a YAML file, the image beside it, or a folder of
 * cairn map; NULL: no memory. */
static char *yaml_path_of(const char *input)
{
    static const char *const images[] = {".pgm", ".png"};
    size_t length = strlen(input);
    struct stat about;
    char *path;

    if (stat(input, &about) == 0 && S_ISDIR(about.st_mode))
        return cairn_output_path_join(input, "map.yaml");
    path = malloc(length + sizeof ".yaml");
    if (path == NULL)
        return NULL;
    strcpy(path, input);
    for (size_t i = 0; i < sizeof images / sizeof *images; i++)
        if (length > 4 && strcmp(input + length - 4, images[i]) == 0)
            strcpy(path + length - 4, ".yaml");
    return path;
}

/* Reads the map of an input. TOOL_OK, or another exit code after a line on standard error. */
static int load_map(cairn_map_file *map, const char *input)
{
    char *yaml = yaml_path_of(input);
    cairn_file_error error;
    cairn_status status = CAIRN_NO_MEMORY;

    if (yaml == NULL)
        (void)cairn_file_error_set(&error, status, input, 0, "no memory");
    else if (strcmp(yaml, input) != 0 && access(yaml, F_OK) != 0)
        status = cairn_file_error_set(
            &error, CAIRN_IO, input, 0,
            "%s is not there, expected the YAML file of the map with resolution and origin", yaml);
    else
        status = cairn_map_file_read(map, yaml, &error);
    free(yaml);
    return status == CAIRN_OK ? TOOL_OK : tool_report(&error);
}

int merge_load_maps(merge_job *job)
{
    const merge_settings *s = job->settings;
    double scale[CAIRN_CAPACITY_MAX_MAPS] = {0};

    if (s->scale != NULL && !merge_read_list(s, "--scale", s->scale, scale))
        return TOOL_BAD;
    for (int32_t i = 0; i < s->count; i++) {
        int code = load_map(&job->map[i].file, s->map[i]);

        if (code != TOOL_OK)
            return code;
        job->map[i].loaded = 1;
        if (s->scale != NULL) {
            if (!(scale[i] > 0 && scale[i] < 1e6))
                return options_refuse(MERGE_PROGRAM,
                                      "--scale: %g is no valid cell size, expected m above 0",
                                      scale[i]);
            job->map[i].file.resolution = (cairn_real)scale[i];
        }
        if (!classify_cells(&job->map[i])) {
            (void)options_refuse(MERGE_PROGRAM, "%s: no memory", s->map[i]);
            return TOOL_FAILED;
        }
    }
    return TOOL_OK;
}

cairn_map_merge_map merge_map_of(const merge_tool_map *map)
{
    cairn_map_merge_map out = {{map->cells, map->width, map->height, map->width},
                               (cairn_real)map->resolution,
                               map->file.origin};

    return out;
}
