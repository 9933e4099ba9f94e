/* report_player: the recorded data of a player. Internal to the host library. */
#ifndef CAIRN_HOST_REPORT_PLAYER_H
#define CAIRN_HOST_REPORT_PLAYER_H

#include "cairn/report.h"

/* A recorded scan, on the heap. */
typedef struct cairn_player_scan {
    cairn_vec2 *point;
    cairn_segment *segment;
    int32_t point_count, segment_count;
    int64_t index;
} cairn_player_scan;

/* A recorded frame, on the heap. */
typedef struct cairn_player_frame {
    int64_t ordinal; /* index among all frames that were added */
    int64_t step;
    char *label;
    cairn_pose *pose;
    int32_t *low_confidence; /* indices of scans, ascending */
    int32_t *submap;         /* [pose_count] or NULL */
    cairn_vec2 *region;
    cairn_report_force *force;
    cairn_report_hypothesis *hypothesis;
    int32_t pose_count, low_confidence_count, region_count, force_count, hypothesis_count;
    double value[CAIRN_REPORT_MAX_CURVES];
} cairn_player_frame;

/* A recorded loop closure. */
typedef struct cairn_player_link {
    int64_t ordinal; /* ordinal of the first frame that shows it */
    int32_t a, b;
    int32_t accepted;
} cairn_player_link;

/* The player. Texts are never NULL. */
struct cairn_report_player {
    cairn_report_player_params params;
    cairn_report_curve curve[CAIRN_REPORT_MAX_CURVES];
    cairn_player_scan *scan;
    /* kept frames: ordinals are multiples of the stride, except for the last frame */
    cairn_player_frame *frame;
    cairn_player_link *link;
    int32_t scan_count, frame_count, link_count;
    int32_t scan_capacity, frame_capacity, link_capacity;
    /* number of frames that were added */
    int64_t ordinals;
    int64_t stride;
    /* poses of all kept frames */
    int64_t pose_count;
    /* NULL: no grid */
    uint8_t *grid_png;
    size_t grid_bytes;
    /* metadata of the grid; pixel is NULL */
    cairn_report_grid grid;
};

/* The lines of the page, the last one NULL. The lines "@title@\n" and "@data@\n" are placeholders
 * of the title and the data. */
extern const char *const cairn_report_player_page[];

#endif
