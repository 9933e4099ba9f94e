/* Rooms of 5 by 5 m: four along a corridor, two behind the last two of them. Walls are 0.1 m thick;
 * tables stand in the rooms. The observed area of a robot is a set of boxes, bounded by the centre
 * lines of walls. */
#include "bench/bench_repeat.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/random.h"

enum { ROOMS = 6, TABLES = 4, MAPS = 3, MAX_OBSERVED_BOXES = 4 };

static const double FULL_TURN = 6.283185307179586, ROOM = 5, CORRIDOR = 2, HALF_WALL = 0.05,
                    DOOR = 0.5;

/* Rooms 0 ... 3 along the corridor, 4 behind 2 and 5 behind 3. */
static const double WEST[ROOMS] = {0, 5, 10, 15, 10, 15}, SOUTH[ROOMS] = {2, 2, 2, 2, 7, 7};

typedef struct table {
    double x, y, half[2], turn;
} table;

typedef struct building {
    table tables[ROOMS][TABLES]; /* from the room's lower left corner */
} building;

typedef struct box {
    double x0, y0, x1, y1;
} box;

static double uniform(cairn_random *random, double low, double high)
{
    return low + (high - low) * (double)cairn_random_unit(random);
}

static void furnish(building *b, cairn_random *random)
{
    for (int i = 0; i < ROOMS; i++)
        for (int k = 0; k < TABLES; k++) {
            table t = {
                uniform(random, 0.8, ROOM - 0.8), uniform(random, 0.8, ROOM - 0.8), {0, 0}, 0};

            t.half[0] = uniform(random, 0.15, 0.5);
            t.half[1] = uniform(random, 0.15, 0.5);
            t.turn = uniform(random, 0, FULL_TURN);
            b->tables[i][k] = t;
        }
    memcpy(b->tables[2], b->tables[0], sizeof b->tables[0]);
}

static int in_table(const table *t, double x, double y)
{
    double c = cos(t->turn), s = sin(t->turn), dx = x - t->x, dy = y - t->y;

    return fabs(c * dx + s * dy) <= t->half[0] && fabs(c * dy - s * dx) <= t->half[1];
}

/* Walls of a room, with a door in the middle of the south and north walls, and of the west wall of
 * one room. */
static int in_room_walls(int room, double x, double y)
{
    int west_door = room == 5, north_door = room != 1 && room < 4, south_door = room != 5 || x > 0;
    int door_x = fabs(x - ROOM / 2) < DOOR, door_y = fabs(y - ROOM / 2) < DOOR;

    if (x < -HALF_WALL || y < -HALF_WALL || x > ROOM + HALF_WALL || y > ROOM + HALF_WALL)
        return 0;
    if (fabs(y) <= HALF_WALL)
        return !(door_x && south_door);
    if (fabs(y - ROOM) <= HALF_WALL)
        return !(door_x && north_door);
    if (fabs(x) <= HALF_WALL)
        return !(door_y && west_door);
    return fabs(x - ROOM) <= HALF_WALL && !(door_y && room == 4);
}

static int is_wall(const building *b, double x, double y)
{
    if ((fabs(x) <= HALF_WALL || fabs(x - 4 * ROOM) <= HALF_WALL || fabs(y) <= HALF_WALL) &&
        y <= CORRIDOR)
        return 1;
    for (int i = 0; i < ROOMS; i++) {
        double u = x - WEST[i], v = y - SOUTH[i];

        if (in_room_walls(i, u, v))
            return 1;
        for (int k = 0; k < TABLES && u > 0 && v > 0 && u < ROOM && v < ROOM; k++)
            if (in_table(&b->tables[i][k], u, v))
                return 1;
    }
    return 0;
}

/* The area beyond the faces of walls is unknown, and so is the inside of a table. */
static uint8_t cell_at(const building *b, const box *seen, int count, double x, double y)
{
    for (int i = 0; i < count; i++)
        if (x >= seen[i].x0 && x <= seen[i].x1 && y >= seen[i].y0 && y <= seen[i].y1)
            return is_wall(b, x, y) ? CAIRN_OCCUPANCY_GRID_OCCUPIED : CAIRN_OCCUPANCY_GRID_FREE;
    return CAIRN_OCCUPANCY_GRID_UNKNOWN;
}

static int draw(const building *b, const box *seen, int count, double resolution,
                cairn_random *random, bench_part *part)
{
    double x0 = 1e9, y0 = 1e9, x1 = -1e9, y1 = -1e9, c, s;

    for (int i = 0; i < count; i++) {
        x0 = fmin(x0, seen[i].x0);
        y0 = fmin(y0, seen[i].y0);
        x1 = fmax(x1, seen[i].x1);
        y1 = fmax(y1, seen[i].y1);
    }
    part->world_map.x = (x0 + x1) / 2 + uniform(random, -1, 1);
    part->world_map.y = (y0 + y1) / 2 + uniform(random, -1, 1);
    part->world_map.theta = uniform(random, -FULL_TURN / 2, FULL_TURN / 2);
    part->side = 2 * (int32_t)ceil((hypot(x1 - x0, y1 - y0) / 2 + 1.5) / resolution);
    part->cells = malloc((size_t)part->side * (size_t)part->side);
    if (part->cells == NULL)
        return 0;
    c = cos(part->world_map.theta);
    s = sin(part->world_map.theta);
    for (int32_t i = 0; i < part->side * part->side; i++) {
        double x = (i % part->side + 0.5 - part->side / 2.0) * resolution;
        double y = ((int32_t)(i / part->side) + 0.5 - part->side / 2.0) * resolution;

        part->cells[i] = cell_at(b, seen, count, part->world_map.x + c * x - s * y,
                                 part->world_map.y + s * x + c * y);
    }
    return 1;
}

int bench_repeat_make(uint64_t seed, double resolution, bench_parts *parts)
{
    static const int seen_count[MAPS] = {4, 2, 2};
    const double w = HALF_WALL;
    /* The first: corridor, room 0, the nearer 80 % of room 2, room 3. The second: rooms 2 and 4.
     * The third: room 5 with the eastern half of 4, and the farther half of room 3. */
    const box seen[MAPS][MAX_OBSERVED_BOXES] = {
        {{-w, -w, 20 + w, 2 + w},
         {-w, 2, 5 + w, 7 + w},
         {10 - w, 2, 15 + w, 6},
         {15 - w, 2, 20 + w, 7 + w}},
        {{10 - w, 2 - w, 15 + w, 7 + w}, {10 - w, 7, 15 + w, 12 + w}},
        {{12.5, 7 - w, 20 + w, 12 + w}, {15 - w, 4.5, 20 + w, 7}}};
    cairn_random random = cairn_random_seed(seed, 41);
    building b;
    int ok;

    memset(parts, 0, sizeof *parts);
    parts->resolution = resolution;
    parts->list = calloc(MAPS, sizeof *parts->list);
    ok = parts->list != NULL;
    furnish(&b, &random);
    for (int i = 0; ok && i < MAPS; i++) {
        parts->count++;
        ok = draw(&b, seen[i], seen_count[i], resolution, &random, &parts->list[i]);
    }
    if (!ok)
        fprintf(stderr, "repeat: no memory\n");
    return ok;
}
