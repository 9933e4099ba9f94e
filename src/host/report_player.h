/* report_player: what a player has recorded. Internal to the host library. */
#ifndef CAIRN_HOST_REPORT_PLAYER_H
#define CAIRN_HOST_REPORT_PLAYER_H

#include "cairn/report.h"

typedef struct cairn_player_scan {
    cairn_vec2 *point;
    cairn_segment *segment;
    int32_t point_count, segment_count;
    int64_t index;
} cairn_player_scan;

typedef struct cairn_player_frame {
    int64_t ordinal; /* among all frames that were added */
    int64_t step;
    char *label;
    cairn_pose *pose;
    int32_t *doubtful; /* scans, rising */
    int32_t *part;     /* [pose_count], or NULL */
    cairn_vec2 *region;
    cairn_report_force *force;
    cairn_report_guess *guess;
    int32_t pose_count, doubtful_count, region_count, force_count, guess_count;
    double value[CAIRN_REPORT_CURVES_MOST];
} cairn_player_frame;

typedef struct cairn_player_link {
    int64_t ordinal; /* of the first frame that shows it */
    int32_t a, b;
    int32_t accepted;
} cairn_player_link;

/* Texts are never NULL. */
struct cairn_report_player {
    cairn_report_player_params params;
    cairn_report_curve curve[CAIRN_REPORT_CURVES_MOST];
    cairn_player_scan *scan;
    /* those that are kept: ordinals are multiples of the stride, but for the last one */
    cairn_player_frame *frame;
    cairn_player_link *link;
    int32_t scan_count, frame_count, link_count;
    int32_t scan_room, frame_room, link_room;
    /* frames that were added */
    int64_t ordinals;
    int64_t stride;
    /* of all frames */
    int64_t pose_count;
    /* NULL: no grid */
    uint8_t *grid_png;
    size_t grid_bytes;
    /* without its pixels */
    cairn_report_grid grid;
};

/* The lines of the page, the last one NULL. "@title@\n" and "@data@\n" stand for the title and
 * the data. */
extern const char *const cairn_report_player_page[];

#endif
