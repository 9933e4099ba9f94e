/* survey: configuration of a mapping program: sweeps, arrival interval, capacities, memory. */
#ifndef CAIRN_FIRMWARE_SURVEY_H
#define CAIRN_FIRMWARE_SURVEY_H

#include "firmware/surveyor.h"

/* Section for memory that exceeds the microcontroller's internal RAM: the board's external RAM,
 * which is not cleared at startup. On a desktop: ordinary static memory. */
#define SURVEY_EXTERNAL __attribute__((section(".bss.external")))

/* Maximum number of beams of a sweep, and of sweeps of a lap. */
enum { SURVEY_BEAMS = 256, SURVEY_SWEEPS = 256 };

typedef struct survey {
    const char *name;
    /* [sweep_count] of at most SURVEY_BEAMS beams, without noise */
    const robot_sweep *sweeps;
    int32_t sweep_count;
    /* default number of laps: forward, back, forward, ... */
    int32_t laps;
    /* m, standard deviation of the noise added to the ranges of every sweep */
    float noise;
    /* odometry noise: maximum relative error of every motion, and heading error in rad per m */
    float slip;
    /* ticks from one sweep to the next, constant */
    int32_t arrival;
    /* work units of a tick */
    int32_t budget;
    surveyor_params params;
    /* [bytes] memory of the program's pool */
    unsigned char *memory;
    size_t bytes;
} survey;

/* Returns the program's survey. */
void survey_read(survey *out);

#endif
