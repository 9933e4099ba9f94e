/* What the files of cairn merge share. */
#ifndef CAIRN_TOOLS_CAIRN_MERGE_H
#define CAIRN_TOOLS_CAIRN_MERGE_H

#include "cairn/map_file.h"
#include "cairn/map_merge.h"
#include "tools/cairn_tool.h"

#define MERGE_PROGRAM "cairn merge"

/* Cells of the longest side of all maps, between which they are made coarser as needed. */
enum { MERGE_TOOL_MAPS = 64, MERGE_LEAST_SIDE = 175, MERGE_MOST_SIDE = 800 };

/* A place with a probability of being wrong up to this is not doubtful. */
#define MERGE_SURE 0.001

typedef struct merge_settings {
    const char *map[MERGE_TOOL_MAPS];
    const char *folder, *order, *scale, *start, *pool, *perception;
    int64_t reference, coarsen, particles, seed;
    double min_score;
    int32_t count, quiet, as_written;
    int32_t gave_coarsen, gave_min_score, gave_particles;
} merge_settings;

typedef struct merge_tool_map {
    cairn_map_file file;
    uint8_t *fine;  /* [file.height * file.width] CAIRN_CELL_..., row 0 lowest */
    uint8_t *cells; /* [height * width] of them, as merged */
    int32_t width, height;
    double resolution; /* m */
    int32_t loaded;
    cairn_merge_placed placed;
} merge_tool_map;

/* A place of a map beside one that was placed before. */
typedef struct merge_place {
    int32_t map, beside;
    cairn_pose pose; /* of the map's frame in that of the reference */
    cairn_real evidence;
    cairn_merge_score score;
    double psi_share, gamma_share; /* among all places of the map */
    double product;                /* of both, over the sum of these products */
} merge_place;

typedef struct merge_job {
    const merge_settings *settings;
    merge_tool_map map[MERGE_TOOL_MAPS];
    cairn_map_merge *merge;
    cairn_merge_result result;
    size_t pool_bytes;
    merge_place *place; /* [place_count] */
    int32_t place_count;
    int32_t k; /* cells of the result: of k by k; 0: there is none */
} merge_job;

/* All maps placed, in the frame of the reference and with its cells. Where they contradict each
 * other the majority holds, and a wall among equals. CAIRN_NO_MEMORY, CAIRN_FULL. */
cairn_status merge_draw_map(const merge_job *job, cairn_map_file *merged, cairn_file_error *error);

/* The places of all maps, from job->merge. 0: no memory. */
int merge_take_places(merge_job *job);

cairn_status merge_write_places(const merge_job *job, const char *path, cairn_file_error *error);
cairn_status merge_write_yaml(const merge_job *job, const char *path, cairn_file_error *error);
cairn_status merge_write_csv(const merge_job *job, const char *path, cairn_file_error *error);
cairn_status merge_write_picture(const merge_job *job, const char *path, cairn_file_error *error);

#endif
