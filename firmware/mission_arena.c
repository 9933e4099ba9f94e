/* A rescue arena: 60 scans of 401 beams from 15 places, a grid of 0.2 m. */
#include "src/base/build.h"

#include "arena_scans.h"

enum {
    SCANS = 60,
    BEAMS = 401,
    POINTS = 5200,
    SEGMENTS = 900,
    CORNERS = 256,
    WIDTH = 80,
    HEIGHT = 80
};

/* Capacities of the joint optimization. */
enum { MAX_LINKS = 340, MAX_FILL = 560 };

static _Alignas(CAIRN_ALIGN) unsigned char memory[500 * 1024];

void mission_read(mission *out)
{
    static const mission arena = {.name = "arena", .arrival = 200, .budget = 1000};

    *out = arena;
    out->sweeps = recorded;
    out->sweep_count = (int32_t)(sizeof recorded / sizeof *recorded);
    out->memory = memory;
    out->bytes = sizeof memory;
    out->params.range_max = 8;
    out->params.range_sigma = 0.01f;
    out->params.scan = cairn_scan_default();
    out->params.scan.max_beams = BEAMS;
    out->params.scan.max_segments = 80;
    out->params.scan.max_points = 256;
    out->params.field = cairn_force_field_default();
    out->params.field.max_scans = SCANS;
    out->params.field.max_points = POINTS;
    out->params.field.max_segments = SEGMENTS;
    out->params.field.max_corners = CORNERS;
    out->params.joint = joint_default();
    out->params.joint.max_scans = SCANS;
    out->params.joint.max_links = MAX_LINKS;
    out->params.joint.max_fill = MAX_FILL;
    out->params.grid = cairn_occupancy_grid_default();
    out->params.grid.width = WIDTH;
    out->params.grid.height = HEIGHT;
    out->params.grid.resolution = CAIRN_REAL(0.2);
    out->params.grid.origin.x = -WIDTH * CAIRN_REAL(0.1);
    out->params.grid.origin.y = -HEIGHT * CAIRN_REAL(0.1);
}
