#include "sim/movers.h"

namespace sim
{

int32_t Movers::random_cell()
{
    return space.cells()[(size_t)random.below((int)space.cells().size())];
}

Movers::Movers(World &w, const FreeSpace &s, int32_t count, uint64_t seed)
    : world(w), space(s), random(seed, mover_stream)
{
    for (int32_t i = 0; i < count; i++) {
        sim_point at = space.middle(random_cell());
        double radius = random.uniform(0.15, 0.25), speed = random.uniform(0.5, 1.2);

        walkers.push_back({world.add_mover(at, radius), speed, {}, 0, at, 0});
        set_out(walkers.back());
    }
}

void Movers::set_out(Walker &walker)
{
    sim_point at = world.mover(walker.index);

    walker.way = space.way(space.nearest_reachable(at), random_cell());
    walker.leg = 0;
    walker.last = at;
    walker.stuck = 0;
}

void Movers::step()
{
    for (Walker &walker : walkers) {
        sim_point at = world.mover(walker.index), ahead;

        if (length(at - walker.last) > 0.1) {
            walker.last = at;
            walker.stuck = 0;
        } else if (++walker.stuck * time_step > 1.5) {
            set_out(walker);
        }
        while (walker.leg < walker.way.size() && length(walker.way[walker.leg] - at) < 0.15)
            walker.leg++;
        if (walker.leg == walker.way.size()) {
            set_out(walker);
            world.move_mover(walker.index, {0, 0});
            continue;
        }
        ahead = walker.way[walker.leg] - at;
        world.move_mover(walker.index, ahead * (walker.speed / length(ahead)));
    }
}

void Movers::make_room(sim_point point)
{
    for (Walker &walker : walkers) {
        if (length(world.mover(walker.index) - point) >= 0.6)
            continue;
        for (int attempt = 0; attempt < 100; attempt++) {
            sim_point at = space.middle(random_cell());

            if (attempt < 99 && length(at - point) < 1)
                continue;
            world.place_mover(walker.index, at);
            break;
        }
        set_out(walker);
    }
}

} // namespace sim
