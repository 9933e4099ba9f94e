/* A maze: 16 full scans of 181 beams, a grid of 0.3 m. */
#include "src/core/build.h"

#include "maze_scans.h"

enum { SCANS = 16, BEAMS = 181, POINTS = 2048, SEGMENTS = 136, CORNERS = 64, SIDE = 48 };

static _Alignas(CAIRN_ALIGN) unsigned char memory[144 * 1024];

void mission_read(mission *out)
{
    static const mission maze = {.name = "maze", .range_max = 8, .arrival = 200, .tick_budget = 1000};

    *out = maze;
    out->scans = recorded;
    out->scan_count = (int32_t)(sizeof recorded / sizeof *recorded);
    out->memory = memory;
    out->bytes = sizeof memory;
    out->scan = cairn_scan_default();
    out->scan.max_beams = BEAMS;
    out->scan.max_segments = 36;
    out->scan.max_points = 256;
    out->field = cairn_force_field_default();
    out->field.max_scans = SCANS;
    out->field.max_points = POINTS;
    out->field.max_segments = SEGMENTS;
    out->field.max_corners = CORNERS;
    out->grid = cairn_occupancy_grid_default();
    out->grid.width = out->grid.height = SIDE;
    out->grid.resolution = CAIRN_REAL(0.3);
    out->grid.origin.x = out->grid.origin.y = -SIDE * CAIRN_REAL(0.15);
}
