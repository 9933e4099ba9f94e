// world: the bodies of an arena as a Box2D world, with the robot and the movers.
#ifndef CAIRN_SIM_WORLD_H
#define CAIRN_SIM_WORLD_H

#include <box2d/box2d.h>

#include <vector>

#include "sim/layout.h"

namespace sim
{

constexpr double robot_radius = 0.2; // m, unless its sensor needs a larger one
constexpr double time_step = 0.02;   // s

// What a ray met: a body by its index, or `hit_mover`.
struct Hit {
    bool any;
    int32_t body;
    double range;
    sim_point normal;
};
constexpr int32_t hit_mover = -2;

// Adds the body to a Box2D world under the number `tag`.
b2Body *add_body(b2World &world, const Body &body, b2BodyType type, uintptr_t tag);

class World : private b2ContactListener
{
  public:
    explicit World(const std::vector<Body> &bodies, double radius_of_robot = robot_radius);

    // The nearest surface along the ray, the robot excepted, and panes that the ray passes. A body
    // that holds the start is not seen.
    Hit cast(sim_point from, double angle, double range) const;
    void step();

    // The robot; there is none until it is placed.
    void place_robot(sim_pose pose);
    void drive_robot(double speed, double turn_rate);
    sim_pose robot() const;
    int32_t bumps() const
    {
        return bump_count;
    }

    size_t add_mover(sim_point at, double radius);
    sim_point mover(size_t index) const;
    void move_mover(size_t index, sim_point velocity);
    void place_mover(size_t index, sim_point at);

  private:
    void BeginContact(b2Contact *contact) override;

    b2World world;
    double own_radius;                // of the robot
    std::vector<double> least_cosine; // by body: of the incidence of a beam that returns
    b2Body *robot_body = nullptr;
    std::vector<b2Body *> movers;
    int32_t bump_count = 0;
};

} // namespace sim

#endif
