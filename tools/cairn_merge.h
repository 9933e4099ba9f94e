/* Shared by the files of cairn merge. */
#ifndef CAIRN_TOOLS_CAIRN_MERGE_H
#define CAIRN_TOOLS_CAIRN_MERGE_H

#include "cairn/map_file.h"
#include "cairn/map_merge.h"
#include "tools/cairn_tool.h"

#define MERGE_PROGRAM "cairn merge"

/* Capacity of maps, and the range of the longest side, in cells, to which maps are downsampled. */
enum { MERGE_MAX_MAPS = 64, MERGE_MIN_SIDE_CELLS = 175, MERGE_MAX_SIDE_CELLS = 800 };

/* Maximum error probability of a confident placement. */
#define MERGE_MAX_ERROR_PROBABILITY 0.001

typedef struct merge_settings {
    const char *map[MERGE_MAX_MAPS];
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
    merge_tool_map map[MERGE_MAX_MAPS];
    cairn_map_merge *merge;
    cairn_map_merge_result result;
    size_t pool_bytes;
    merge_place *place; /* [place_count] */
    int32_t place_count;
    int32_t downsampling; /* downsampling factor of the result; 0: no result yet */
} merge_job;

/* A word for each verdict, without spaces. */
const char *merge_verdict_word(cairn_map_merge_verdict verdict);

/* Draws all placed maps in the frame and cell size of the reference. Contradicting cells are
 * decided by majority vote, ties as occupied. CAIRN_NO_MEMORY, CAIRN_FULL. */
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
