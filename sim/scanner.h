// scanner: simulated range scanner: ray casting of each beam from the sensor pose at its own time,
// what travels with the robot, then floor hits by tilt, range noise, lost beams and glass, dropouts.
#ifndef CAIRN_SIM_SCANNER_H
#define CAIRN_SIM_SCANNER_H

#include "sim/carried.h"

namespace sim
{

struct Sweep {
    std::vector<float> range;
    std::vector<int32_t> edge;
    sim_scan scan; // its arrays are set when the survey is complete
};

// True pose and odometry pose of the robot at a time.
struct State {
    double time; // s
    sim_pose truth, odometry;
    double way;     // m, length of the path so far
    double trailer; // rad, heading of the trailer relative to the robot
};

class Scanner
{
  public:
    Scanner(const sim_arena &where, const sim_survey_options &how);

    // Starts sweep number `index`.
    void begin(const State &state, int32_t index, double speed, double turn_rate);
    // Casts the beams that are due until `now`; true when the last one is cast.
    bool advance(const World &world, const State &before, const State &now);
    // Returns the sweep with all sensor errors.
    Sweep finish();

  private:
    int32_t edge_of(const Hit &hit) const;
    void tilt();
    void meet_floor();
    bool is_glass(int32_t edge) const;

    const sim_arena &arena;
    const sim_survey_options &options;
    std::vector<bool> glass; // by body
    Carried carried;
    Tilts tilts;
    std::vector<double> range;
    Sweep sweep;
    State first;
    int32_t index, next;
};

} // namespace sim

#endif
