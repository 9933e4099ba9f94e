/* Rooms of straight walls and simulated scans of them by plain geometry: the same ranges on every
 * machine. */
#ifndef CAIRN_TESTS_ROOMS_H
#define CAIRN_TESTS_ROOMS_H

#include "cairn/scan.h"

enum { ROOMS_BEAMS = 360, ROOMS_WALLS = 32 };

/* Walls are visible from both sides. */
typedef struct rooms_room {
    cairn_segment walls[ROOMS_WALLS];
    int32_t count;
} rooms_room;

/* A full circle of ROOMS_BEAMS beams a degree apart, up to 8 m, with noise of 5 mm. */
typedef struct rooms_scan {
    float range[ROOMS_BEAMS];
} rooms_scan;

void rooms_add_wall(rooms_room *room, double ax, double ay, double bx, double by);
/* Four walls. */
void rooms_add_box(rooms_room *room, double x0, double y0, double x1, double y1);

/* Takes a scan at a pose, with noise seeded by `seed`. The input points into the scan. */
cairn_scan_input rooms_take_scan(const rooms_room *room, cairn_pose pose, uint64_t seed,
                                 rooms_scan *scan);

#endif
