// crowd: people who stand about the robot and hide a share of what each scan would see, other ones
// at every scan.
#ifndef CAIRN_SIM_CROWD_H
#define CAIRN_SIM_CROWD_H

#include "sim/world.h"

#include <vector>

namespace sim
{

class Crowd
{
  public:
    Crowd(World &world, const sim_arena &arena, const sim_survey_options &options);

    // Places people so that at least the share of the beams from this sensor end on them, and at
    // most a quarter more where there is room for that; sends all others away.
    void gather(const sim_pose &sensor);

  private:
    bool place_one(sim_pose sensor, size_t who);
    double covered(sim_pose sensor) const;
    void send_away(size_t who);

    World &world;
    const sim_arena &arena;
    const sim_survey_options &options;
    Random random;
    std::vector<size_t> people;
    std::vector<double> radius;
};

} // namespace sim

#endif
