/* mission: what a robot of this loop is to do: the scans that arrive, the capacities, the memory. */
#ifndef CAIRN_FIRMWARE_MISSION_H
#define CAIRN_FIRMWARE_MISSION_H

#include "cairn/force_field.h"
#include "cairn/occupancy_grid.h"
#include "cairn/scan.h"

/* A sweep as the scanner gives it, with the pose that the robot believes in. */
typedef struct recorded_scan {
    const float *range; /* [count] m */
    int32_t count;
    float angle_min, angle_step; /* rad */
    cairn_pose pose;
} recorded_scan;

typedef struct mission {
    const char *name;
    const recorded_scan *scans; /* [scan_count] */
    int32_t scan_count;
    float range_max;     /* m */
    int32_t arrival;     /* ticks from one scan to the next, at least */
    int32_t tick_budget; /* units */
    cairn_scan_params scan;
    cairn_force_field_params field;
    cairn_occupancy_grid_params grid;
    unsigned char *memory; /* [bytes]: all that there is */
    size_t bytes;
} mission;

/* Of the program's one mission. */
void mission_read(mission *out);

#endif
