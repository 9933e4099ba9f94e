/* survey: what the surveyor of a program is to map: the sweeps that arrive, how often, the
 * capacities, the memory. */
#ifndef CAIRN_FIRMWARE_SURVEY_H
#define CAIRN_FIRMWARE_SURVEY_H

#include "firmware/surveyor.h"

/* Memory of a program goes here when it is too much for the microcontroller itself: the board's
 * external RAM, which nothing clears. A desktop puts it with the rest. */
#define SURVEY_EXTERNAL __attribute__((section(".bss.external")))

/* Most beams of a sweep, and most sweeps of a lap. */
enum { SURVEY_BEAMS = 256, SURVEY_SWEEPS = 256 };

typedef struct survey {
    const char *name;
    /* [sweep_count] of SURVEY_BEAMS at most, without noise */
    const robot_sweep *sweeps;
    int32_t sweep_count;
    /* times that they arrive, if the program is not told how many: there, back again, there ... */
    int32_t laps;
    /* m, standard deviation: new in the ranges of every sweep */
    float noise;
    /* the odometry is wrong by up to this share of every motion, and by so many rad a metre */
    float slip;
    /* ticks from one sweep to the next: the scanner does not wait */
    int32_t arrival;
    /* units of a tick */
    int32_t budget;
    surveyor_params params;
    /* [bytes]: all that there is */
    unsigned char *memory;
    size_t bytes;
} survey;

/* Of the program's one survey. */
void survey_read(survey *out);

#endif
