/* A rescue arena: 60 scans of 401 beams from 15 places, a grid of 0.2 m. */
#include "src/core/build.h"

#include "arena_scans.h"

enum { SCANS = 60, BEAMS = 401, POINTS = 5200, SEGMENTS = 900, CORNERS = 256, WIDTH = 80, HEIGHT = 80 };

static _Alignas(CAIRN_ALIGN) unsigned char memory[500 * 1024];

void mission_read(mission *out)
{
    static const mission arena = {.name = "arena", .range_max = 8, .arrival = 200, .tick_budget = 1000};

    *out = arena;
    out->scans = recorded;
    out->scan_count = (int32_t)(sizeof recorded / sizeof *recorded);
    out->memory = memory;
    out->bytes = sizeof memory;
    out->scan = cairn_scan_default();
    out->scan.max_beams = BEAMS;
    out->scan.max_segments = 80;
    out->scan.max_points = 256;
    out->field = cairn_force_field_default();
    out->field.max_scans = SCANS;
    out->field.max_points = POINTS;
    out->field.max_segments = SEGMENTS;
    out->field.max_corners = CORNERS;
    out->grid = cairn_occupancy_grid_default();
    out->grid.width = WIDTH;
    out->grid.height = HEIGHT;
    out->grid.resolution = CAIRN_REAL(0.2);
    out->grid.origin.x = -WIDTH * CAIRN_REAL(0.1);
    out->grid.origin.y = -HEIGHT * CAIRN_REAL(0.1);
}
