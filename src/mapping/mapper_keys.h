/* mapper_keys: the state of a mapper, and what it does with its key scans: the local map, the force field's window. */
#ifndef CAIRN_MAPPING_MAPPER_KEYS_H
#define CAIRN_MAPPING_MAPPER_KEYS_H

#include "cairn/mapper.h"

typedef int32_t phase;
enum {
    IDLE = 0,
    FIT,          /* lines of the new scan */
    SELECT,       /* key scans near the predicted pose */
    TARGET,       /* local map out of them */
    MATCH,        /* from the prediction */
    MATCH_MOTION, /* from the last motion */
    KEEP,         /* result, and a key scan if it is one */
    WINDOW,       /* key scans into the force field */
    FIELD
};

struct cairn_mapper {
    cairn_mapper_params params;
    cairn_scan *scan;
    cairn_icp *icp;
    cairn_force_field *field;
    cairn_scan_set *keys;
    cairn_pose *key_pose; /* [max_keys] map_key */
    /* One key scan on its way into the local map or the force field. */
    cairn_oriented_point *oriented; /* [scan.max_points] */
    cairn_segment *segments;        /* [scan.max_segments] */
    int32_t *first_point;           /* [scan.max_segments + 1] */

    phase phase;
    int32_t cursor; /* within the phase */
    int32_t full;

    int32_t has_odometry; /* of the scan at hand */
    cairn_pose odometry;
    cairn_pose motion; /* predicted by odometry or by the last motion */
    cairn_pose predicted;
    cairn_pose repeated; /* pose by the last motion */

    int32_t had_odometry; /* of the scan before */
    cairn_pose last_odometry;
    cairn_pose last_motion;

    int32_t local[CAIRN_MAPPER_LOCAL_MOST]; /* key scans of the local map, the last ones first, then by distance */
    cairn_real local_distance[CAIRN_MAPPER_LOCAL_MOST];
    int32_t local_count;
    int32_t target_stale; /* 1: key scans were added or moved since the local map was made */
    cairn_pose target_pose;
    cairn_icp_result match; /* the better one so far */
    int32_t has_match;

    cairn_mapper_result result;
    cairn_mapper_state state;
};

/* Begins to choose the key scans of the local map; one key scan a call then. 1 when all have been looked at. */
void cairn_mapper_begin_local(cairn_mapper *mapper);
int32_t cairn_mapper_select_local(cairn_mapper *mapper);

/* 1 when the local map does not serve the predicted pose. */
int32_t cairn_mapper_needs_local(const cairn_mapper *mapper);

/* Adds the chosen key scan at the cursor to the local map. */
cairn_status cairn_mapper_add_local(cairn_mapper *mapper, cairn_budget *budget);

/* Key scans over which the force field runs now. */
int32_t cairn_mapper_window_count(const cairn_mapper *mapper);

/* Adds the key scan at the cursor to the force field. */
cairn_status cairn_mapper_add_window(cairn_mapper *mapper, cairn_budget *budget);

/* Takes over the poses that the force field found. */
void cairn_mapper_read_window(cairn_mapper *mapper);

#endif
