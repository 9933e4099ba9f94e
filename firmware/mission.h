/* mission: configuration of a robot program: sweeps, arrival interval, capacities, memory. */
#ifndef CAIRN_FIRMWARE_MISSION_H
#define CAIRN_FIRMWARE_MISSION_H

#include "firmware/robot.h"

typedef struct mission {
    const char *name;
    const robot_sweep *sweeps; /* [sweep_count] */
    int32_t sweep_count;
    int32_t arrival; /* minimum number of ticks between two sweeps */
    int32_t budget;  /* work units of a tick */
    robot_params params;
    unsigned char *memory; /* [bytes] memory of the program's pool */
    size_t bytes;
} mission;

/* Returns the program's mission. */
void mission_read(mission *out);

#endif
