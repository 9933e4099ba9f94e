// movers: bodies that walk from one free position to the next, without end.
#ifndef CAIRN_SIM_MOVERS_H
#define CAIRN_SIM_MOVERS_H

#include "sim/free_space.h"
#include "sim/world.h"

namespace sim
{

class Movers
{
  public:
    Movers(World &world, const FreeSpace &space, int32_t count, uint64_t seed);

    // One time step of walking; the world is stepped by the caller.
    void step();
    // Whoever stands within 0.6 m of the point is put elsewhere: a robot never stands inside
    // someone.
    void make_room(sim_point point);
    bool any() const
    {
        return !walkers.empty();
    }

  private:
    struct Walker {
        size_t index;
        double speed;
        std::vector<sim_point> way;
        size_t leg;
        sim_point last;
        int stuck; // steps
    };
    int32_t random_cell();
    void set_out(Walker &walker);

    World &world;
    const FreeSpace &space;
    Random random;
    std::vector<Walker> walkers;
};

} // namespace sim

#endif
