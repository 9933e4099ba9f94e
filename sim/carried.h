// carried: what travels with the robot: its legs, its trailer, and the floor ahead of a scanner that
// is tilted forward.
#ifndef CAIRN_SIM_CARRIED_H
#define CAIRN_SIM_CARRIED_H

#include "sim/robot.h"

namespace sim
{

// Legs and trailer as the scanner sees them.
class Carried
{
  public:
    explicit Carried(const sim_survey_options &options);

    // Returns the range of a beam at an angle in the frame of the sensor to legs, poles and trailer;
    // 1e9: it meets none. trailer: heading of the trailer relative to the robot, rad.
    double range(double angle, double trailer) const;

  private:
    sim_pose sensor;
    bool legs, trailer;
};

// Heading of the trailer relative to the robot, rad, after a move.
double trailer_after(double heading, Move move);

// The line where the plane of a sweep meets the floor.
struct FloorLine {
    double distance; // m; 0: the scanner is level
    double bearing;  // rad
};

// Stretches of the path on which the scanner is tilted.
class Tilts
{
  public:
    explicit Tilts(const sim_survey_options &options);

    // way: length of the path so far, m; it never decreases between calls.
    FloorLine at(double way);

  private:
    void draw();

    Random random;
    double ground;
    double from, to, bearing; // of the current stretch, or of the next one
    double phases[2];         // of the unevenness of the floor
};

} // namespace sim

#endif
