// arena: from options to bodies, edges and free space; the part of the C header that is about
// arenas.
#include "sim/arena_parts.h"

#include <algorithm>
#include <cstring>

using namespace sim;

namespace
{
struct Scene {
    const char *name, *about;
    void (*lay_out)(Layout &layout);
    double width, height, least_width, least_height;
    int32_t places;
};

const Scene scenes[SIM_SCENES] = {
    {"rescue", "rooms, collapsed walls, boxes and heaps of rubble", lay_out_rescue, 12, 10, 6, 6,
     15},
    {"maze", "corridors 1.25 m apart with a few loops", lay_out_maze, 10, 10, 5, 5, 16},
    {"rooms", "four rectangular rooms on a hallway", lay_out_rooms, 12, 9, 9, 7.5, 5},
    {"apartment", "furnished rooms on both sides of a hall", lay_out_apartment, 16, 8, 13, 7, 20},
    {"office", "a loop of corridors with rooms inside and outside", lay_out_office, 20, 14, 16, 12,
     24},
    {"corridor", "one straight corridor, the same all along", lay_out_corridor, 24, 2, 4, 1.2, 8},
    {"twins", "two identical rooms on one corridor", lay_out_twins, 14, 6.5, 11, 5.5, 10},
    {"mirror", "corridors that are their own mirror image", lay_out_mirror, 14, 10, 10, 8, 12},
    {"round", "no straight wall: a ring, arcs, pillars, round rubble", lay_out_round, 10, 10, 6, 6,
     12},
    {"hospital", "wings of wards on long corridors, many doors alike, glass", lay_out_hospital, 60,
     48, 28, 17, 24},
    {"joined", "two furnished rooms joined by one door", lay_out_joined, 10, 8, 7, 5, 8},
};
constexpr double most_side = 60;

bool is_scene(sim_scene scene)
{
    return scene >= 0 && scene < SIM_SCENES;
}
} // namespace

const char *sim_scene_name(sim_scene scene)
{
    return is_scene(scene) ? scenes[scene].name : NULL;
}

const char *sim_scene_about(sim_scene scene)
{
    return is_scene(scene) ? scenes[scene].about : NULL;
}

sim_scene sim_scene_find(const char *name)
{
    for (sim_scene scene = 0; scene < SIM_SCENES; scene++)
        if (strcmp(scenes[scene].name, name) == 0)
            return scene;
    return -1;
}

void sim_scene_size(sim_scene scene, double *width, double *height)
{
    *width = is_scene(scene) ? scenes[scene].width : 0;
    *height = is_scene(scene) ? scenes[scene].height : 0;
}

int32_t sim_scene_places(sim_scene scene)
{
    return is_scene(scene) ? scenes[scene].places : 0;
}

sim_arena_options sim_arena_default(void)
{
    return {1, SIM_RESCUE, 0, 0, std::nan(""), 1};
}

namespace sim
{

bool within(Fault &fault, const char *name, double value, double low, double high, const char *unit)
{
    if (value >= low && value <= high)
        return true;
    if (fault.text)
        snprintf(fault.text, fault.size, "%s is %.9g%s%s, expected %.9g to %.9g", name, value,
                 *unit ? " " : "", unit, low, high);
    return false;
}

static std::vector<sim_edge> edges_of(const std::vector<Body> &bodies, std::vector<sim_body> &table)
{
    std::vector<sim_edge> edges;

    for (const Body &body : bodies) {
        std::vector<sim_point> outline = body.outline();
        int32_t index = (int32_t)table.size(), first = (int32_t)edges.size();

        if (body.radius > 0)
            edges.push_back({body.centre, body.centre, {0, 0}, body.radius, index, 1});
        // Clockwise, so that the outside is on the left.
        for (size_t i = outline.size(); i-- > 0;) {
            sim_point a = outline[(i + 1) % outline.size()], b = outline[i], along = b - a;
            double whole = length(along);

            edges.push_back({a, b, {-along.y / whole, along.x / whole}, 0, index, body.curved});
        }
        table.push_back({body.kind, first, (int32_t)edges.size() - first, body.centre, body.angle,
                         body.radius, body.glass});
    }
    return edges;
}

// Removes the rubble on the shortest path into each area that it disconnects.
static void clear_ways(Layout &layout, double angle)
{
    Layout standing = layout;

    standing.bodies.clear();
    for (const Body &body : layout.bodies)
        if (!body.loose())
            standing.bodies.push_back(body);
    FreeSpace without(standing, angle), with(layout, angle);

    if (with.cells().empty())
        return;
    for (sim_point there : with.cut_off()) {
        sim_point here = with.middle(with.cells()[0]);
        std::vector<sim_point> way;

        if (!without.reachable(there) || !without.reachable(here))
            continue;
        way = without.way(without.cell_of(here), without.cell_of(there));
        auto blocks = [&](const Body &body) {
            if (!body.loose())
                return false;
            for (size_t i = 0; i + 1 < way.size(); i++)
                for (int part = 0; part < 50; part++)
                    if (distance(body, way[i] + (way[i + 1] - way[i]) * (part * 0.02)) <
                        free_clearance + 0.05)
                        return true;
            return false;
        };
        layout.bodies.erase(std::remove_if(layout.bodies.begin(), layout.bodies.end(), blocks),
                            layout.bodies.end());
    }
}

} // namespace sim

sim_arena::sim_arena(const sim_arena_options &o, Layout &&settled)
    : options(o), layout(std::move(settled)), space(layout, o.turn)
{
    edges = edges_of(layout.bodies, bodies);
}

sim_arena *sim_arena_create(const sim_arena_options *given, char *fault_text, size_t fault_size)
{
    sim_arena_options options = *given;
    Fault fault = {fault_text, fault_size};

    if (!within(fault, "scene", options.scene, 0, SIM_SCENES - 1, ""))
        return NULL;
    const Scene &scene = scenes[options.scene];
    options.width = options.width == 0 ? scene.width : options.width;
    options.height = options.height == 0 ? scene.height : options.height;
    if (std::isnan(options.turn)) {
        Random random(options.seed, turn_stream);

        options.turn = random.uniform(-pi, pi);
    }
    if (!within(fault, "width", options.width, scene.least_width, most_side, "m") ||
        !within(fault, "height", options.height, scene.least_height, most_side, "m") ||
        !within(fault, "turn", options.turn, -1000, 1000, "rad") ||
        !within(fault, "rubble", options.rubble, 0, 3, ""))
        return NULL;

    Layout layout(options.width, options.height, options.rubble, options.seed);
    scene.lay_out(layout);
    turn(layout, options.turn);
    settle(layout, options.turn);
    clear_ways(layout, options.turn);
    return new sim_arena(options, std::move(layout));
}

void sim_arena_free(sim_arena *arena)
{
    delete arena;
}

sim_arena_options sim_arena_options_of(const sim_arena *arena)
{
    return arena->options;
}

const sim_body *sim_arena_bodies(const sim_arena *arena, int32_t *count)
{
    *count = (int32_t)arena->bodies.size();
    return arena->bodies.data();
}

const sim_edge *sim_arena_edges(const sim_arena *arena, int32_t *count)
{
    *count = (int32_t)arena->edges.size();
    return arena->edges.data();
}

double sim_arena_clearance(const sim_arena *arena, sim_point point)
{
    double nearest = 1e9;

    for (const Body &body : arena->layout.bodies)
        nearest = std::fmin(nearest, distance(body, point));
    return nearest;
}

int32_t sim_arena_reachable(const sim_arena *arena, sim_point point)
{
    return arena->space.reachable(point);
}
