/* cairn merge: merges the occupancy maps of several robots without a prior. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/output.h"
#include "cairn/output_set.h"
#include "cairn/pose_table.h"
#include "tools/cairn_merge.h"

enum { YAML, IMAGE, TRANSFORMS_YAML, TRANSFORMS_CSV, PLACES, PICTURE, FILES };
static const char *const file_names[FILES] = {"map.yaml",       "map.pgm",    "transforms.yaml",
                                              "transforms.csv", "places.csv", "map.svg"};

/* Rejects options that the method of chapter 9 lacks and unknown names; sets its number of
 * particles and its perception model. OPTIONS_READ: valid. */
static option_result check_mode(merge_settings *s)
{
    const char *other = s->start != NULL   ? "--start"
                        : s->coarsen_given ? "--coarsen"
                                           : "--min-score";

    if (s->perception != NULL && strcmp(s->perception, "images") != 0 &&
        strcmp(s->perception, "evidence") != 0)
        return (option_result)options_refuse(
            MERGE_PROGRAM, "--perception %s, expected evidence or images", s->perception);
    if (!s->as_written)
        return OPTIONS_READ;
    if (s->perception != NULL && strcmp(s->perception, "images") != 0)
        return (option_result)options_refuse(MERGE_PROGRAM,
                                             "--perception %s with --as-written: the thesis scores "
                                             "hypotheses by images, expected one of both",
                                             s->perception);
    if (s->start != NULL || s->coarsen_given || s->min_score_given)
        return (option_result)options_refuse(
            MERGE_PROGRAM,
            "%s with --as-written: the thesis has no such thing, expected one of both", other);
    if (!s->particles_given)
        s->particles = cairn_map_merge_as_written().particles;
    s->coarsen = 1;
    return OPTIONS_READ;
}

static option_result read_settings(merge_settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_TEXT("-o", &s->folder, "DIR",
                    "folder for map.pgm, map.yaml, transforms.yaml, transforms.csv, places.csv "
                    "and map.svg"),
        OPTION_INTEGER("--reference", &s->reference, 0, CAIRN_CAPACITY_MAX_MAPS - 1, "I",
                       "index of the reference map, whose frame is the frame of the result"),
        OPTION_TEXT("--order", &s->order, "I,I,...",
                    "merge in this order, all maps, the reference first"),
        OPTION_TEXT("--scale", &s->scale, "M,M,...",
                    "cell size of each map, m, instead of the value in its file"),
        {"--coarsen", OPTION_IS_INTEGER, &s->coarsen, 0, 64, "K",
         "downsamples K by K cells to one, for distorted maps (0: as needed)", &s->coarsen_given},
        {"--min-score", OPTION_IS_NUMBER, &s->min_score, 0.1, 1000, "NATS",
         "minimum log-likelihood ratio of a placement, nats", &s->min_score_given},
        OPTION_TEXT(
            "--start", &s->start, "FILE",
            "transforms.csv of an earlier run: initial estimates, kept unless others score better"),
        OPTION_TEXT("--perception", &s->perception, "NAME",
                    "scoring of pose hypotheses: evidence (log-likelihood ratio), or images: Psi "
                    "and gamma of the thesis (9.5, 9.6)"),
        OPTION_FLAG("--as-written", &s->as_written,
                    "chapter 9 of the thesis as written: only corners, only images, 50 particles; "
                    "every map with a corner similar to another map's is placed"),
        {"--particles", OPTION_IS_INTEGER, &s->particles, 1, 4096, "N",
         "particles of the filter; more than one keep competing hypotheses until a later map "
         "resolves "
         "them, ten are as good as a hundred",
         &s->particles_given},
        OPTION_INTEGER("--seed", &s->seed, 0, 9e15, "N", "seed of the particle filter"),
        OPTION_TEXT("--pool", &s->pool, "BYTES",
                    "memory of the merging (exactly the memory needed)"),
        OPTION_JSON(&s->json),
        OPTION_FLAG("--quiet", &s->quiet, "no summary"),
    };
    const option_set set = {
        MERGE_PROGRAM, "MAP MAP ... -o DIR [options]",
        "Merges occupancy maps of the ROS map_server. A MAP is a YAML file, the image (PGM, PNG) "
        "beside "
        "it, or a folder of cairn map. Nothing is known of their relative poses; maps without "
        "support are "
        "rejected and listed.",
        table, sizeof table / sizeof *table};
    size_t count = CAIRN_CAPACITY_MAX_MAPS;
    option_result result = options_read(&set, argc, argv, s->map, &count);

    if (result != OPTIONS_READ)
        return result;
    s->count = (int32_t)count;
    if (count < 1)
        return (option_result)options_refuse(MERGE_PROGRAM, "no maps, expected %s", set.synopsis);
    if (s->folder == NULL)
        return (option_result)options_refuse(MERGE_PROGRAM, "no -o DIR, expected %s", set.synopsis);
    if (s->reference >= s->count)
        return (option_result)options_refuse(MERGE_PROGRAM,
                                             "--reference %" PRId64 ", expected at most %" PRId32,
                                             s->reference, s->count - 1);
    return check_mode(s);
}

/* ---- Merging ---- */

/* Downsamples all maps K by K cells to one. */
static void coarsen(merge_job *job, int32_t k)
{
    for (int32_t i = 0; i < job->settings->count; i++) {
        merge_tool_map *map = &job->map[i];
        cairn_raster_u8_view fine = {map->fine, map->file.width, map->file.height, map->file.width};
        cairn_raster_u8 out;

        map->width = (map->file.width - 1) / k + 1;
        map->height = (map->file.height - 1) / k + 1;
        map->resolution = (double)map->file.resolution * k;
        out.data = map->cells;
        out.width = map->width;
        out.height = map->height;
        out.stride = map->width;
        if (cairn_map_merge_coarsen(fine, k, out) != CAIRN_OK)
            memset(map->cells, CAIRN_OCCUPANCY_GRID_UNKNOWN,
                   (size_t)map->width * (size_t)map->height);
    }
}

static cairn_map_merge_params params_for(const merge_job *job)
{
    const merge_settings *s = job->settings;
    cairn_map_merge_params p;
    int64_t cells = 0, most = 0;

    for (int32_t i = 0; i < job->settings->count; i++) {
        int64_t own = (int64_t)job->map[i].width * job->map[i].height;

        cells += own;
        most = own > most ? own : most;
    }
    p = cairn_capacity_map_merge(s->count, cells > CAIRN_MAP_FILE_MAX_CELLS ? 0 : (int32_t)cells,
                                 (int32_t)most, s->as_written);
    if (s->perception != NULL && strcmp(s->perception, "images") == 0)
        p.perception = CAIRN_MAP_MERGE_IMAGES;
    p.particles = (int32_t)s->particles;
    p.min_score = (cairn_real)s->min_score;
    p.seed = (uint64_t)s->seed;
    return p;
}

/* Adds the transforms of an earlier run as initial estimates, by the index of the map. */
static int add_start(const merge_job *job)
{
    cairn_file_error error;
    cairn_pose_table_row *row;
    int32_t count;

    if (job->settings->start == NULL)
        return TOOL_OK;
    if (cairn_pose_table_read(&row, &count, job->settings->start, &error) != CAIRN_OK)
        return tool_report(&error);
    for (int32_t i = 0; i < count; i++)
        if (row[i].index >= 0 && row[i].index < job->settings->count &&
            row[i].index != job->settings->reference &&
            (row[i].verdict[0] == 0 || strcmp(row[i].verdict, "placed") == 0) &&
            cairn_map_merge_guess(job->merge, (int32_t)row[i].index, row[i].pose) != CAIRN_OK)
            break;
    cairn_pose_table_free(row);
    return TOOL_OK;
}

static int begin(merge_job *job)
{
    const merge_settings *s = job->settings;
    double list[CAIRN_CAPACITY_MAX_MAPS];
    int32_t order[CAIRN_CAPACITY_MAX_MAPS] = {0};
    int code;

    for (int32_t i = 0; i < s->count; i++) {
        cairn_map_merge_map input = merge_map_of(&job->map[i]);
        cairn_fault fault = {-1, "refused"};

        if (cairn_map_merge_add(job->merge, &input, &fault) != CAIRN_OK)
            return options_refuse(MERGE_PROGRAM, "%s: %s", s->map[i], fault.message);
    }
    code = add_start(job);
    if (code != TOOL_OK)
        return code;
    if (s->order != NULL) {
        if (!merge_read_list(s, "--order", s->order, list))
            return TOOL_BAD;
        for (int32_t i = 0; i < s->count; i++)
            order[i] = list[i] >= 0 && list[i] < s->count && list[i] == floor(list[i])
                           ? (int32_t)list[i]
                           : -1;
    }
    if (cairn_map_merge_begin(job->merge, (int32_t)s->reference, s->order != NULL ? order : NULL) !=
        CAIRN_OK)
        return options_refuse(
            MERGE_PROGRAM, "--order %s, expected every map once, the reference %" PRId64 " first",
            s->order, s->reference);
    return TOOL_OK;
}

/* Returns 1 when the new result is the first one, or better than the best one so far. */
static int is_better(const merge_job *job)
{
    cairn_map_merge_result result = cairn_map_merge_read(job->merge);

    return job->downsampling == 0 || cairn_map_merge_is_better(&result, &job->result);
}

/* Returns 1 when every map is placed with a small error probability. */
static int is_sure(const merge_job *job)
{
    int32_t unsure = 0;

    for (int32_t i = 0; i < job->settings->count; i++)
        unsure += !cairn_map_merge_is_sure(&job->map[i].placed);
    return unsure == 0;
}

static int merge_once(merge_job *job, int32_t k)
{
    cairn_map_merge_params params;
    cairn_status status = CAIRN_MORE;
    cairn_pool pool;
    int code;

    coarsen(job, k);
    params = params_for(job);
    if (params.max_cells == 0)
        return options_refuse(MERGE_PROGRAM,
                              "more than %d cells in all, expected fewer: use --coarsen",
                              (int)CAIRN_MAP_FILE_MAX_CELLS);
    job->pool_bytes = cairn_map_merge_memory(&params);
    code = tool_pool_open(&pool, MERGE_PROGRAM, job->settings->pool, job->pool_bytes);
    if (code != TOOL_OK)
        return code;
    if (cairn_map_merge_create(&job->merge, &pool, &params) != CAIRN_OK) {
        (void)options_refuse(MERGE_PROGRAM, "no memory");
        code = TOOL_FAILED;
    } else {
        code = begin(job);
    }
    while (code == TOOL_OK && status == CAIRN_MORE) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status = cairn_map_merge_step(job->merge, &budget);
    }
    if (code == TOOL_OK && status < 0)
        code = options_refuse(MERGE_PROGRAM, "%s", cairn_status_text(status));
    if (code == TOOL_OK && is_better(job)) {
        for (int32_t i = 0; i < job->settings->count; i++)
            job->map[i].placed = cairn_map_merge_of(job->merge, i);
        job->result = cairn_map_merge_read(job->merge);
        job->downsampling = k;
        if (!merge_read_places(job)) {
            (void)options_refuse(MERGE_PROGRAM, "no memory");
            code = TOOL_FAILED;
        }
    }
    tool_pool_close(&pool);
    return code;
}

static int32_t longest_side(const merge_job *job)
{
    int32_t most = 0;

    for (int32_t i = 0; i < job->settings->count; i++) {
        most = job->map[i].file.width > most ? job->map[i].file.width : most;
        most = job->map[i].file.height > most ? job->map[i].file.height : most;
    }
    return most;
}

/* Merges with the downsampling of --coarsen. Otherwise starts at full resolution, or coarser for
 * very large maps, and repeats with coarser cells while maps are rejected or uncertain. */
static int merge_all(merge_job *job)
{
    int32_t given = (int32_t)job->settings->coarsen, side = longest_side(job);
    int32_t k = given > 0 ? given : cairn_map_merge_next_coarsening(0, side);
    int code = merge_once(job, k);

    while (code == TOOL_OK && given == 0 && !is_sure(job) &&
           (k = cairn_map_merge_next_coarsening(k, side)) > 0)
        code = merge_once(job, k);
    if (code == TOOL_OK)
        coarsen(job, 1);
    return code;
}

/* ---- Output ---- */

static int write_files(merge_job *job)
{
    cairn_file_error error;
    cairn_output_set *set;
    cairn_map_file merged;
    cairn_status status = merge_draw_map(job, &merged, &error);

    if (status != CAIRN_OK)
        return tool_report(&error);
    status = cairn_output_set_open(&set, job->settings->folder, file_names, FILES, &error);
    if (status == CAIRN_OK) {
        status = tool_remove_other_maps(set, file_names, FILES, &error);
        if (status == CAIRN_OK)
            status = cairn_map_file_write(&merged, cairn_output_set_path(set, YAML),
                                          CAIRN_MAP_FILE_PGM, &error);
        if (status == CAIRN_OK)
            status = merge_write_yaml(job, cairn_output_set_path(set, TRANSFORMS_YAML), &error);
        if (status == CAIRN_OK)
            status = merge_write_csv(job, cairn_output_set_path(set, TRANSFORMS_CSV), &error);
        if (status == CAIRN_OK)
            status = merge_write_places(job, cairn_output_set_path(set, PLACES), &error);
        if (status == CAIRN_OK)
            status = merge_write_picture(job, cairn_output_set_path(set, PICTURE), &error);
        if (status == CAIRN_OK)
            status = cairn_output_set_commit(set, &error);
        else
            cairn_output_set_discard(set);
    }
    cairn_map_file_free(&merged);
    return status == CAIRN_OK ? TOOL_OK : tool_report(&error);
}

int tool_merge(int argc, char **argv)
{
    merge_settings s = {
        .particles = 100, .min_score = (double)cairn_map_merge_default().min_score, .seed = 1};
    cairn_file_error error;
    option_result result = read_settings(&s, argc, argv);
    merge_job job;
    double start = tool_seconds();
    int code;

    if (result != OPTIONS_READ)
        return result;
    if (cairn_output_set_check(s.folder, file_names, FILES, &error) != CAIRN_OK)
        return tool_report(&error);
    memset(&job, 0, sizeof job);
    job.settings = &s;
    code = merge_load_maps(&job);
    if (code == TOOL_OK)
        code = merge_all(&job);
    if (code == TOOL_OK)
        code = write_files(&job);
    if (code == TOOL_OK && s.json)
        merge_print_json(&job, tool_seconds() - start);
    else if (code == TOOL_OK && !s.quiet)
        merge_print_text(&job, tool_seconds() - start);
    free(job.place);
    for (int32_t i = 0; i < CAIRN_CAPACITY_MAX_MAPS; i++) {
        free(job.map[i].fine);
        free(job.map[i].cells);
        if (job.map[i].loaded)
            cairn_map_file_free(&job.map[i].file);
    }
    return code;
}
