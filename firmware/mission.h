/* mission: what the robot of a program is to do: the sweeps that arrive, how often, the
 * capacities, the memory. */
#ifndef CAIRN_FIRMWARE_MISSION_H
#define CAIRN_FIRMWARE_MISSION_H

#include "firmware/robot.h"

typedef struct mission {
    const char *name;
    const robot_sweep *sweeps; /* [sweep_count] */
    int32_t sweep_count;
    int32_t arrival; /* ticks from one sweep to the next, at least */
    int32_t budget;  /* units of a tick */
    robot_params params;
    unsigned char *memory; /* [bytes]: all that there is */
    size_t bytes;
} mission;

/* Of the program's one mission. */
void mission_read(mission *out);

#endif
