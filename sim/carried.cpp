#include "sim/carried.h"

#include <algorithm>

namespace sim
{

constexpr double never = 1e9;

// Legs of the robot.
constexpr double leg_range = 0.3, leg_width = 0.04, leg_bearing = pi / 3; // m, m, rad

// The trailer, in its own frame: the hitch is the origin, x points to the robot. Its drawbar is a
// frame with two poles, which stand beside a robot that drives straight ahead.
constexpr double hitch_x = -0.2; // m, on the robot
constexpr double axle = 0.9;     // m, from the hitch to the wheels
constexpr sim_point poles[] = {{0.5, 0.5}, {0.5, -0.5}};
constexpr double pole_radius = 0.03;
constexpr double front = -0.3, back = -1.5, half_wide = 0.4; // sides of its body, m
constexpr double most_bend = 1.2;                            // rad, a stop
constexpr double follow_step = 0.02;                         // m or rad

Carried::Carried(const sim_survey_options &options)
    : sensor(options.base_sensor), legs(options.legs != 0), trailer(options.trailer != 0)
{
}

static double range_to_disc(sim_point from, sim_point along, sim_point centre, double radius)
{
    double middle = dot(centre - from, along), off = cross(along, centre - from);
    double half = radius * radius - off * off;

    return half > 0 && middle > 0 ? middle - std::sqrt(half) : never;
}

static double range_to_side(sim_point from, sim_point along, sim_point a, sim_point b)
{
    double denominator = cross(along, b - a), range, part;

    if (std::abs(denominator) < 1e-12)
        return never;
    range = cross(a - from, b - a) / denominator;
    part = cross(a - from, along) / denominator;
    return range > 0 && part >= 0 && part <= 1 ? range : never;
}

double Carried::range(double angle, double heading) const
{
    double nearest = never;

    if (legs &&
        std::abs(std::abs(wrap(angle)) - leg_bearing) <= std::atan(leg_width / 2 / leg_range))
        nearest = leg_range;
    if (trailer) {
        // The beam in the frame of the trailer.
        sim_pose beam = between({hitch_x, 0, heading}, compose(sensor, {0, 0, angle}));
        sim_point from = {beam.x, beam.y}, along = direction(beam.theta);
        const sim_point corners[] = {
            {front, -half_wide}, {front, half_wide}, {back, half_wide}, {back, -half_wide}};

        for (sim_point pole : poles)
            nearest = std::min(nearest, range_to_disc(from, along, pole, pole_radius));
        for (int i = 0; i < 4; i++)
            nearest =
                std::min(nearest, range_to_side(from, along, corners[i], corners[(i + 1) % 4]));
    }
    return nearest;
}

// The wheels of the trailer do not move sideways; the hitch moves with the robot.
double trailer_after(double heading, Move move)
{
    int steps = 1 + (int)(std::max(std::abs(move.distance), std::abs(move.turn)) / follow_step);
    double distance = move.distance / steps, turn = move.turn / steps;

    for (int i = 0; i < steps; i++) {
        double aside = hitch_x * turn; // of the hitch, to the left of the robot

        heading += (aside * std::cos(heading) - distance * std::sin(heading)) / axle - turn;
        heading = std::clamp(heading, -most_bend, most_bend);
    }
    return heading;
}

constexpr double least_gap = 10, most_gap = 40;        // m of the path between two stretches
constexpr double least_stretch = 5, most_stretch = 15; // m
constexpr double most_bearing = 8 * pi / 180;

// The floor is uneven: the distance varies by up to a tenth as a sum of two waves.
constexpr double wave_length[] = {2.6, 1.3}, wave_height[] = {0.06, 0.03};

Tilts::Tilts(const sim_survey_options &options)
    : random(options.seed, ground_stream), ground(options.ground), from(0), to(0), bearing(0),
      phases()
{
    draw();
}

void Tilts::draw()
{
    from = to + random.uniform(least_gap, most_gap);
    to = from + random.uniform(least_stretch, most_stretch);
    bearing = random.uniform(-most_bearing, most_bearing);
    for (double &phase : phases)
        phase = random.uniform(-pi, pi);
}

FloorLine Tilts::at(double way)
{
    double distance = ground;

    while (way >= to)
        draw();
    if (way < from)
        return {0, 0};
    for (int i = 0; i < 2; i++)
        distance += ground * wave_height[i] * std::sin(2 * pi * way / wave_length[i] + phases[i]);
    return {distance, bearing};
}

} // namespace sim
