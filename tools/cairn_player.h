/* Recording of the frames of --report FILE.html, shared by all subcommands. */
#ifndef CAIRN_TOOLS_CAIRN_PLAYER_H
#define CAIRN_TOOLS_CAIRN_PLAYER_H

#include "cairn/aligner.h"
#include "cairn/force_field.h"
#include "cairn/report.h"
#include "tools/cairn_map_output.h"

/* The help of --report. */
#define PLAYER_HELP "a page that plays every step: map, forces, curves (HTML, one file)"

/* Checks whether player_write() can write there, before the computation. Creates nothing. */
CAIRN_CHECKED cairn_status player_check(const char *path, cairn_file_error *error);

/* Writes the page; missing folders are created. On failure nothing is changed. */
CAIRN_CHECKED cairn_status player_write(const cairn_report_player *player, const char *path,
                                        cairn_file_error *error);

/* Adds the points and segments of scan `index` of a log. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status player_add_scan(cairn_report_player *player, const map_scan *scan,
                                           int32_t index);

/* Records a force field: call before() and after() for every iteration, and end() after the last. A
 * frame has the poses before an iteration with its forces and regions. Statuses of
 * cairn_report_player_add_frame. */
typedef struct player_field {
    cairn_report_player *player;
    const cairn_force_field *field;
    cairn_pose *pose;
    cairn_report_force *force;
    cairn_vec2 *region;
    int32_t region_capacity;
    double relocation; /* mm, by the last iteration; NaN before the first */
} player_field;

/* Records an aligner: call commit() after every commit point; a frame without a visible change is
 * skipped. Statuses of cairn_report_player_add_frame. */
typedef struct player_aligner {
    cairn_report_player *player;
    const cairn_aligner *aligner;
    cairn_pose *pose;
    int32_t *submap;
    uint8_t *low_confidence;
    int64_t step;
} player_aligner;

cairn_report_player_params player_aligner_params(void);
CAIRN_CHECKED cairn_status player_aligner_begin(player_aligner *record, cairn_report_player *player,
                                                const cairn_aligner *aligner);
CAIRN_CHECKED cairn_status player_aligner_commit(player_aligner *record);
void player_aligner_free(player_aligner *record);

/* The player's params for a force field; the title and subtitle are the caller's. */
cairn_report_player_params player_field_params(const cairn_force_field_params *field);

/* The field holds all its scans. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status player_field_begin(player_field *record, cairn_report_player *player,
                                              const cairn_force_field *field);
void player_field_before(player_field *record);
CAIRN_CHECKED cairn_status player_field_after(player_field *record);
CAIRN_CHECKED cairn_status player_field_end(player_field *record);
void player_field_free(player_field *record);

#endif
