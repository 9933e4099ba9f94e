// arena_parts: definitions of the opaque types of arena.h.
#ifndef CAIRN_SIM_ARENA_PARTS_H
#define CAIRN_SIM_ARENA_PARTS_H

#include <cstdio>

#include "sim/free_space.h"
#include "sim/scanner.h"
#include "sim/world.h"

namespace sim
{

struct Fault {
    char *text; // NULL: no message
    size_t size;
};

// Returns true when low <= value <= high; otherwise, also for NaN, writes the fault.
bool within(Fault &fault, const char *name, double value, double low, double high,
            const char *unit);

// Returns free positions that together cover the arena (next-best-view planning): the scene's own
// positions first, then greedily the position that adds most new surface with sufficient overlap.
// In the order of a short tour. Fewer than `count` when no free position is left.
std::vector<sim_point> choose_places(const sim_arena &arena, int count, uint64_t seed);

} // namespace sim

struct sim_arena {
    sim_arena(const sim_arena_options &options, sim::Layout &&settled);

    sim_arena_options options;
    sim::Layout layout; // in the world frame
    sim::FreeSpace space;
    std::vector<sim_body> bodies;
    std::vector<sim_edge> edges;
};

struct sim_survey {
    const sim_arena *arena;
    sim_survey_options options;
    std::vector<sim::Sweep> sweeps;
    std::vector<sim_scan> scans;
    std::vector<sim_point> places;
    std::vector<sim_pose> path;
    int32_t bumps;
};

#endif
