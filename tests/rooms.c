/* Ranges of a scanner in rooms of straight walls. */
#include "tests/rooms.h"

#include <math.h>

#include "tests/test.h"

static const double DEGREE = 0.017453292519943295, FIRST = -3.14159;

void rooms_add_wall(rooms_room *room, double ax, double ay, double bx, double by)
{
    cairn_segment wall = {{(cairn_real)ax, (cairn_real)ay}, {(cairn_real)bx, (cairn_real)by}};

    assert_true(room->count < ROOMS_WALLS);
    room->walls[room->count++] = wall;
}

void rooms_add_box(rooms_room *room, double x0, double y0, double x1, double y1)
{
    rooms_add_wall(room, x0, y0, x1, y0);
    rooms_add_wall(room, x1, y0, x1, y1);
    rooms_add_wall(room, x1, y1, x0, y1);
    rooms_add_wall(room, x0, y1, x0, y0);
}

/* Distance along a beam to the nearest wall, 7.9 m when there is none. */
static float cast(const rooms_room *room, cairn_pose from, double angle)
{
    double best = 7.9, c = cos((double)from.theta + angle), s = sin((double)from.theta + angle);

    for (int32_t i = 0; i < room->count; i++) {
        double ax = (double)(room->walls[i].a.x - from.x),
               ay = (double)(room->walls[i].a.y - from.y);
        double dx = (double)(room->walls[i].b.x - room->walls[i].a.x),
               dy = (double)(room->walls[i].b.y - room->walls[i].a.y);
        double cross = c * dy - s * dx, t = (ax * dy - ay * dx) / cross,
               u = (ax * s - ay * c) / cross;

        if (cross != 0 && t > 0 && t < best && u >= 0 && u <= 1)
            best = t;
    }
    return (float)best;
}

cairn_scan_input rooms_take_scan(const rooms_room *room, cairn_pose pose, uint64_t seed,
                                 rooms_scan *scan)
{
    cairn_random random = cairn_random_seed(seed, 5);
    cairn_scan_input input;

    for (int32_t i = 0; i < ROOMS_BEAMS; i++)
        scan->range[i] =
            cast(room, pose, FIRST + i * DEGREE) + 0.005F * (float)cairn_random_normal(&random);
    memset(&input, 0, sizeof input);
    input.range = scan->range;
    input.count = ROOMS_BEAMS;
    input.angle_min = (float)FIRST;
    input.angle_step = (float)DEGREE;
    input.range_min = 0.05F;
    input.range_max = 8;
    input.range_sigma = 0.005F;
    return input;
}
