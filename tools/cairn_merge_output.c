/* Output of cairn merge: the merged map, the transforms, a picture, the result in text and JSON. */
#include <ctype.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/output.h"
#include "cairn/report.h"
#include "src/host/maps/merged_map.h"
#include "src/host/pictures/report_text.h"
#include "tools/cairn_merge.h"
#include "tools/cairn_tool.h"

static int is_placed(const merge_job *job, int32_t i)
{
    return job->map[i].placed.verdict == CAIRN_MAP_MERGE_PLACED;
}

/* ---- The merged map ---- */

cairn_status merge_draw_map(const merge_job *job, cairn_map_file *merged, cairn_file_error *error)
{
    const merge_settings *s = job->settings;
    cairn_map_merge_map maps[CAIRN_CAPACITY_MAX_MAPS];
    cairn_map_merge_placed placed[CAIRN_CAPACITY_MAX_MAPS];

    for (int32_t i = 0; i < s->count; i++) {
        maps[i] = merge_map_of(&job->map[i]);
        placed[i] = job->map[i].placed;
    }
    return cairn_merged_map_make(maps, placed, s->count, maps[s->reference].resolution, merged,
                                 error);
}

/* ---- Transforms ---- */

/* Writes the name of a robot by the path of its map: the last folder or name that is not
 * "map.*". */
static void robot_name(const char *path, char name[MERGE_FRAME_BYTES])
{
    size_t length = strlen(path), used = 0;
    const char *from;

    while (length > 1 && path[length - 1] == '/')
        length--;
    for (from = path + length; from > path && from[-1] != '/'; from--)
        ;
    if (length - (size_t)(from - path) >= 4 && strncmp(from, "map.", 4) == 0 && from - path > 1) {
        length = (size_t)(from - path) - 1;
        for (from = path + length; from > path && from[-1] != '/'; from--)
            ;
    }
    for (const char *c = from; c < path + length && used < MERGE_FRAME_BYTES / 2; c++) {
        if (*c == '.' && c > from && memchr(c + 1, '.', (size_t)(path + length - c - 1)) == NULL)
            break;
        name[used++] = (char)(isalnum((unsigned char)*c) ? *c : '_');
    }
    name[used] = '\0';
}

void merge_frame_name(const merge_job *job, int32_t map, char frame[MERGE_FRAME_BYTES])
{
    char name[MERGE_FRAME_BYTES], other[MERGE_FRAME_BYTES];
    int is_unique = 1;

    robot_name(job->settings->map[map], name);
    for (int32_t i = 0; i < job->settings->count; i++) {
        robot_name(job->settings->map[i], other);
        is_unique &= i == map || strcmp(name, other) != 0;
    }
    if (is_unique && !isdigit((unsigned char)name[0]) && name[0] != '\0')
        (void)snprintf(frame, MERGE_FRAME_BYTES, "%.40s/map", name);
    else
        (void)snprintf(frame, MERGE_FRAME_BYTES, "robot_%.40s_%" PRId32 "/map", name, map);
}

cairn_status merge_write_yaml(const merge_job *job, const char *path, cairn_file_error *error)
{
    const merge_settings *s = job->settings;
    const char *separator = "";
    cairn_output *out;
    cairn_status status = cairn_output_open(&out, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(out, "reference: %" PRId64 "\norder: [", s->reference);
    for (int32_t rank = 0; rank < job->result.placed; rank++)
        for (int32_t i = 0; i < s->count; i++)
            if (job->map[i].placed.rank == rank) {
                cairn_output_print(out, "%s%" PRId32, separator, i);
                separator = ", ";
            }
    cairn_output_print(out, "]\nmaps:\n");
    for (int32_t i = 0; i < s->count; i++) {
        const cairn_map_merge_placed *p = &job->map[i].placed;
        char frame[MERGE_FRAME_BYTES];

        cairn_output_print(out, "  - map: ");
        cairn_report_print_json(out, s->map[i]);
        merge_frame_name(job, i, frame);
        cairn_output_print(out, "\n    frame: %s\n    placed: %s\n", frame,
                           is_placed(job, i) ? "true" : "false");
        if (is_placed(job, i))
            cairn_output_print(out,
                               "    transform: {x: %.9g, y: %.9g, yaw: %.9g}\n    wrong: %.3g\n",
                               (double)p->reference_map.x, (double)p->reference_map.y,
                               (double)p->reference_map.theta, (double)p->error_probability);
        else
            cairn_output_print(out, "    reason: %s\n", cairn_map_merge_verdict_text(p->verdict));
        cairn_output_print(out, "    support: %.9g\n    rival: %.9g\n", (double)p->support,
                           (double)p->competing_support);
    }
    return cairn_output_commit(out, error);
}

const char *merge_verdict_word(cairn_map_merge_verdict verdict)
{
    static const char *const words[] = {"placed",    "empty",  "no-overlap", "weak",
                                        "ambiguous", "slides", "no-corner"};

    return words[verdict];
}

cairn_status merge_write_csv(const merge_job *job, const char *path, cairn_file_error *error)
{
    cairn_output *out;
    cairn_status status = cairn_output_open(&out, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(out, "index,x,y,theta,verdict,wrong,support,rival,neighbours\n");
    for (int32_t i = 0; i < job->settings->count; i++) {
        const cairn_map_merge_placed *p = &job->map[i].placed;

        cairn_output_print(out, "%" PRId32 ",%.9g,%.9g,%.9g,%s,%.3g,%.9g,%.9g,%" PRId32 "\n", i,
                           (double)p->reference_map.x, (double)p->reference_map.y,
                           (double)p->reference_map.theta, merge_verdict_word(p->verdict),
                           (double)p->error_probability, (double)p->support,
                           (double)p->competing_support, p->neighbours);
    }
    return cairn_output_commit(out, error);
}

/* ---- The picture ---- */

/* The colours of Okabe and Ito, which the colour-blind can distinguish, and grey shades of them for
 * more maps. */
static void colour_of(int32_t index, char colour[8])
{
    static const uint8_t table[][3] = {{0, 114, 178},   {230, 159, 0},  {0, 158, 115},
                                       {204, 121, 167}, {86, 180, 233}, {213, 94, 0},
                                       {60, 60, 60},    {200, 188, 30}};
    enum { COLOURS = sizeof table / sizeof *table };
    const uint8_t *c = table[index % COLOURS];
    unsigned share = 4 / (1 + (unsigned)(index / COLOURS) % 4);

    snprintf(colour, 8, "#%02x%02x%02x", c[0] * share / 4, c[1] * share / 4, c[2] * share / 4);
}

/* Returns the name of a map in the legend: that of its file, or the path when another one has the
 * same name. */
static const char *legend_name(const merge_job *job, int32_t map)
{
    const char *path = job->settings->map[map], *name = cairn_output_path_name(path);

    for (int32_t i = 0; i < job->settings->count; i++)
        if (i != map && strcmp(cairn_output_path_name(job->settings->map[i]), name) == 0)
            return path;
    return name;
}

/* Transforms a position in cells of a map to the frame of the reference. */
static cairn_vec2 cell_in_reference(const merge_tool_map *map, double x, double y)
{
    cairn_vec2 p = {(cairn_real)(x * map->resolution), (cairn_real)(y * map->resolution)};

    return cairn_pose_point(cairn_pose_compose(map->placed.reference_map, map->file.origin), p);
}

/* Returns the centres of the occupied cells of a map in the frame of the reference; NULL: no
 * memory. */
static cairn_vec2 *walls_of(const merge_tool_map *map, int32_t *count)
{
    size_t cells = (size_t)map->width * (size_t)map->height, walls = 0;
    cairn_vec2 *points;

    for (size_t i = 0; i < cells; i++)
        walls += map->cells[i] == CAIRN_OCCUPANCY_GRID_OCCUPIED;
    points = malloc((walls + 1) * sizeof *points);
    *count = 0;
    for (size_t i = 0; i < cells && points != NULL; i++) {
        size_t column = i % (size_t)map->width, row = i / (size_t)map->width;

        if (map->cells[i] == CAIRN_OCCUPANCY_GRID_OCCUPIED)
            points[(*count)++] = cell_in_reference(map, (double)column + 0.5, (double)row + 0.5);
    }
    return points;
}

static void list_refused(const merge_job *job, char *text, size_t size)
{
    size_t used = (size_t)snprintf(text, size, "%" PRId32 " of %" PRId32 " maps placed",
                                   job->result.placed, job->settings->count);

    for (int32_t i = 0; i < job->settings->count && used < size; i++)
        if (!is_placed(job, i))
            used +=
                (size_t)snprintf(text + used, size - used, "; %s rejected: %s", legend_name(job, i),
                                 cairn_map_merge_verdict_text(job->map[i].placed.verdict));
}

cairn_status merge_write_picture(const merge_job *job, const char *path, cairn_file_error *error)
{
    cairn_report_figure figure = cairn_report_figure_default();
    cairn_report_layer layer[CAIRN_CAPACITY_MAX_MAPS];
    cairn_report_plot plot;
    cairn_vec2 *points[CAIRN_CAPACITY_MAX_MAPS] = {NULL};
    char colour[CAIRN_CAPACITY_MAX_MAPS][8], note[1024];
    cairn_status status = CAIRN_OK;

    memset(&plot, 0, sizeof plot);
    list_refused(job, note, sizeof note);
    for (int32_t i = 0; i < job->settings->count; i++) {
        cairn_report_layer *l = &layer[plot.layer_count];

        if (!is_placed(job, i))
            continue;
        memset(l, 0, sizeof *l);
        colour_of(i, colour[i]);
        l->name = legend_name(job, i);
        l->colour = colour[i];
        l->mark = CAIRN_REPORT_DOTS;
        l->width = 1.5;
        l->opacity = 0.8;
        points[i] = walls_of(&job->map[i], &l->count);
        l->point = points[i];
        plot.layer_count++;
        if (points[i] == NULL)
            status =
                cairn_file_error_set(error, CAIRN_NO_MEMORY, path, 0, "no memory for the picture");
    }
    plot.layer = layer;
    plot.box = cairn_box_empty();
    figure.title = "Maps merged";
    figure.subtitle = note;
    figure.plot = &plot;
    figure.plot_count = 1;
    if (status == CAIRN_OK)
        status = cairn_report_figure_write(path, &figure, error);
    for (int32_t i = 0; i < CAIRN_CAPACITY_MAX_MAPS; i++)
        free(points[i]);
    return status;
}

/* ---- The result on standard output ---- */

/* Prints the command of ROS 2 that publishes each transform from the merged map, in the frame of
 * the reference, to a placed map. */
static void print_static_transforms(const merge_job *job)
{
    for (int32_t i = 0; i < job->settings->count; i++) {
        const cairn_map_merge_placed *p = &job->map[i].placed;
        char frame[MERGE_FRAME_BYTES];

        if (p->verdict != CAIRN_MAP_MERGE_PLACED)
            continue;
        merge_frame_name(job, i, frame);
        printf("transform  ros2 run tf2_ros static_transform_publisher --x %.6f --y %.6f --yaw "
               "%.6f --frame-id map --child-frame-id %s\n",
               (double)p->reference_map.x, (double)p->reference_map.y,
               (double)p->reference_map.theta, frame);
    }
}

void merge_print_text(const merge_job *job, double seconds)
{
    const merge_settings *s = job->settings;

    printf("maps       %" PRId32 ", %" PRId32 " placed\norder     ", s->count, job->result.placed);
    for (int32_t rank = 0; rank < job->result.placed; rank++)
        for (int32_t i = 0; i < s->count; i++)
            if (job->map[i].placed.rank == rank)
                printf(" %" PRId32, i);
    printf("\n");
    if (job->result.candidates_dropped > 0)
        printf("dropped    %" PRId32 " registrations, beyond the most that a particle proposes\n",
               job->result.candidates_dropped);
    for (int32_t i = 0; i < s->count; i++) {
        const cairn_map_merge_placed *p = &job->map[i].placed;

        if (p->verdict == CAIRN_MAP_MERGE_PLACED)
            printf("%-10" PRId32 " %.3f %.3f %.4f  error probability %.2g  %s\n", i,
                   (double)p->reference_map.x, (double)p->reference_map.y,
                   (double)p->reference_map.theta, (double)p->error_probability, s->map[i]);
        else
            printf("%-10" PRId32 " rejected: %s  %s\n", i, cairn_map_merge_verdict_text(p->verdict),
                   s->map[i]);
    }
    print_static_transforms(job);
    printf("downsampled %" PRId32 " by %" PRId32 "\nseconds    %.3f\npool       %zu bytes\n",
           job->downsampling, job->downsampling, seconds, job->pool_bytes);
}

static void print_map_json(cairn_json_writer *json, const merge_job *job, int32_t i)
{
    const cairn_map_merge_placed *p = &job->map[i].placed;
    int32_t placed = p->verdict == CAIRN_MAP_MERGE_PLACED;
    char frame[MERGE_FRAME_BYTES];

    merge_frame_name(job, i, frame);
    cairn_json_write_object(json, NULL);
    cairn_json_write_text(json, "map", job->settings->map[i]);
    cairn_json_write_text(json, "frame", frame);
    cairn_json_write_text(json, "verdict", merge_verdict_word(p->verdict));
    cairn_json_write_text(json, "reason", placed ? NULL : cairn_map_merge_verdict_text(p->verdict));
    if (placed)
        tool_json_pose(json, "pose", p->reference_map);
    else
        cairn_json_write_null(json, "pose");
    cairn_json_write_integer(json, "rank", placed ? p->rank : -1);
    cairn_json_write_number(json, "wrong", (double)p->error_probability);
    cairn_json_write_number(json, "support", (double)p->support);
    cairn_json_write_number(json, "rival", (double)p->competing_support);
    cairn_json_write_integer(json, "neighbours", p->neighbours);
    cairn_json_write_object_end(json);
}

void merge_print_json(const merge_job *job, double seconds)
{
    cairn_json_writer json = cairn_json_write_begin(stdout);

    cairn_json_write_integer(&json, "reference", job->settings->reference);
    cairn_json_write_integer(&json, "placed", job->result.placed);
    cairn_json_write_integer(&json, "dropped", job->result.candidates_dropped);
    cairn_json_write_array(&json, "maps");
    for (int32_t i = 0; i < job->settings->count; i++)
        print_map_json(&json, job, i);
    cairn_json_write_array_end(&json);
    cairn_json_write_integer(&json, "downsampling", job->downsampling);
    cairn_json_write_number(&json, "seconds", seconds);
    cairn_json_write_integer(&json, "pool_bytes", (int64_t)job->pool_bytes);
    cairn_json_write_text(&json, "folder", job->settings->folder);
    cairn_json_write_end(&json);
}
