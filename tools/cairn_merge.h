/* Shared by the files of cairn merge. */
#ifndef CAIRN_TOOLS_CAIRN_MERGE_H
#define CAIRN_TOOLS_CAIRN_MERGE_H

#include "cairn/map_file.h"
#include "cairn/map_merge.h"
#include "src/host/maps/capacity.h"
#include "tools/cairn_tool.h"

#define MERGE_PROGRAM "cairn merge"

typedef struct merge_settings {
    const char *map[CAIRN_CAPACITY_MAX_MAPS];
    const char *folder, *order, *scale, *start, *pool, *perception;
    int64_t reference, coarsen, particles, seed;
    double min_score;
    int32_t count, json, quiet, as_written;
    int32_t coarsen_given, min_score_given, particles_given;
} merge_settings;

typedef struct merge_tool_map {
    cairn_map_file file;
    uint8_t *fine;  /* [file.height * file.width] CAIRN_CELL_..., row 0 lowest */
    uint8_t *cells; /* [height * width] downsampled cells for merging */
    int32_t width, height;
    double resolution; /* m */
    int32_t loaded;
    cairn_map_merge_placed placed;
} merge_tool_map;

/* A pose hypothesis of a map relative to a map placed before it. */
typedef struct merge_place {
    int32_t map, placed_map;
    cairn_pose pose; /* of the map's frame in that of the reference */
    cairn_real log_likelihood_ratio;
    cairn_map_merge_pair_score score;
    double psi_share, gamma_share; /* relative to the sum over all hypotheses of the map */
    double product; /* product of both shares, normalized over the map's hypotheses */
} merge_place;

typedef struct merge_job {
    const merge_settings *settings;
    merge_tool_map map[CAIRN_CAPACITY_MAX_MAPS];
    cairn_map_merge *merge;
    cairn_map_merge_result result;
    size_t pool_bytes;
    merge_place *place; /* [place_count] */
    int32_t place_count;
    int32_t downsampling; /* downsampling factor of the result; 0: no result yet */
} merge_job;

/* Parses a comma-separated list of one number per map. Returns 0 after a line on standard error. */
int merge_read_list(const merge_settings *s, const char *name, const char *text, double *list);

/* Reads the maps and classifies their cells. An exit code. */
int merge_load_maps(merge_job *job);

/* Returns a map with its downsampled cells as the merger takes it. */
cairn_map_merge_map merge_map_of(const merge_tool_map *map);

enum { MERGE_FRAME_BYTES = 64 };

/* Writes the name of the frame of a map: "robot1/map" of robot1.yaml, robot1.pgm, robot1/ and
 * robot1/map.yaml; letters, digits and "_", and "_" and the index when another map has that name
 * too. */
void merge_frame_name(const merge_job *job, int32_t map, char frame[MERGE_FRAME_BYTES]);

/* A word for each verdict, without spaces. */
const char *merge_verdict_word(cairn_map_merge_verdict verdict);

/* Draws all placed maps in the frame and cell size of the reference. Statuses of
 * cairn_merged_map_make(). */
cairn_status merge_draw_map(const merge_job *job, cairn_map_file *merged, cairn_file_error *error);

/* Reads the pose hypotheses of all maps from job->merge. Returns 0 when there is no memory. */
int merge_read_places(merge_job *job);

cairn_status merge_write_places(const merge_job *job, const char *path, cairn_file_error *error);
cairn_status merge_write_yaml(const merge_job *job, const char *path, cairn_file_error *error);
cairn_status merge_write_csv(const merge_job *job, const char *path, cairn_file_error *error);
cairn_status merge_write_picture(const merge_job *job, const char *path, cairn_file_error *error);

/* Print the result on standard output, as text or as a JSON object. seconds: of the whole run. */
void merge_print_text(const merge_job *job, double seconds);
void merge_print_json(const merge_job *job, double seconds);

#endif
