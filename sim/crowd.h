// crowd: standing people around the robot that occlude a fraction of the beams of each scan, at new
// positions for every scan.
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

    // Places people so that at least the configured fraction of the beams from this sensor ends on
    // them, and at most a quarter more where free positions exist; removes all others.
    void gather(const sim_pose &sensor);

  private:
    bool place_one(sim_pose sensor, size_t person);
    double covered(sim_pose sensor) const;
    void send_away(size_t person);

    World &world;
    const sim_arena &arena;
    const sim_survey_options &options;
    Random random;
    std::vector<size_t> people;
    std::vector<double> radius;
};

} // namespace sim

#endif
