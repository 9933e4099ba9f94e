// robot: wheel slip, odometry drift, and a driver that follows waypoints.
#ifndef CAIRN_SIM_ROBOT_H
#define CAIRN_SIM_ROBOT_H

#include "sim/free_space.h"
#include "sim/world.h"

namespace sim
{

constexpr double top_speed = 0.5;     // m/s
constexpr double top_turn_rate = 1.2; // rad/s

// A move of the base: a distance along its heading and a turn.
struct Move {
    double distance, turn;
};

// Random errors of wheels against the ground, and constant ones of the odometry.
class Wheels
{
  public:
    Wheels(const sim_survey_options &options);

    Move slip(Move move);         // motion with random slip
    Move report(Move move) const; // motion as measured by the odometry

  private:
    const sim_survey_options &options;
    Random random;
    double distance_bias, turn_bias, drift_bias;
};

sim_pose moved(sim_pose pose, Move move);

// Drives cyclically through goals: plans a path to the next goal, follows it with random steering
// noise, backs up when stuck.
class Driver
{
  public:
    Driver(const FreeSpace &space, const std::vector<sim_point> &goals, uint64_t seed);

    // Speeds for the next time step.
    void command(sim_pose pose, double *speed, double *turn_rate);

  private:
    void plan(sim_pose pose);

    const FreeSpace &space;
    const std::vector<sim_point> &goals;
    Random random;
    size_t goal;
    std::vector<sim_point> way;
    size_t leg;
    sim_pose last;
    int stuck, back_off, failures; // steps, steps, times
    double back_turn, wander;
};

} // namespace sim

#endif
