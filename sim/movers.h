// movers: dynamic objects that walk between random free positions.
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

    // Performs one time step of walking; the world is stepped by the caller.
    void step();
    // Relocates movers within 0.6 m of the point, so that none overlaps with the robot.
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
