/* A maze: 16 full scans of 181 beams, a grid of 0.3 m. */
#include "src/base/build.h"

#include "maze_scans.h"

enum { SCANS = 16, BEAMS = 181, POINTS = 2048, SEGMENTS = 136, CORNERS = 64, SIDE = 48 };

/* Capacities of the joint optimization. */
enum { MAX_LINKS = 56, MAX_FILL = 80 };

static _Alignas(CAIRN_ALIGN) unsigned char memory[152 * 1024];

void mission_read(mission *out)
{
    static const mission maze = {.name = "maze", .arrival = 200, .budget = 1000};

    *out = maze;
    out->sweeps = recorded;
    out->sweep_count = (int32_t)(sizeof recorded / sizeof *recorded);
    out->memory = memory;
    out->bytes = sizeof memory;
    out->params.range_max = 8;
    out->params.range_sigma = 0.01f;
    out->params.scan = cairn_scan_default();
    out->params.scan.max_beams = BEAMS;
    out->params.scan.max_segments = 36;
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
    out->params.grid.width = out->params.grid.height = SIDE;
    out->params.grid.resolution = CAIRN_REAL(0.3);
    out->params.grid.origin.x = out->params.grid.origin.y = -SIDE * CAIRN_REAL(0.15);
}
