#include "sim/robot.h"

#include <algorithm>

namespace sim
{

Wheels::Wheels(const sim_survey_options &o) : options(o), random(o.seed, odometry_stream)
{
    distance_bias = random.uniform(-o.bias_scale, o.bias_scale);
    turn_bias = random.uniform(-o.bias_scale, o.bias_scale);
    drift_bias = random.uniform(-o.bias_drift, o.bias_drift);
}

Move Wheels::slip(Move move)
{
    double root_distance = std::sqrt(std::abs(move.distance)),
           root_turn = std::sqrt(std::abs(move.turn));
    double distance = random.normal() * options.slip_distance * root_distance;
    double turn = random.normal() * options.slip_turn * root_turn;
    double drift = random.normal() * options.slip_drift * root_distance;

    return {move.distance + distance, move.turn + turn + drift};
}

Move Wheels::report(Move move) const
{
    return {move.distance * (1 + distance_bias),
            move.turn * (1 + turn_bias) + std::abs(move.distance) * drift_bias};
}

// Along the chord of the arc.
sim_pose moved(sim_pose pose, Move move)
{
    double half = move.turn / 2,
           chord = std::abs(half) > 1e-9 ? move.distance * std::sin(half) / half : move.distance;
    sim_point step = direction(pose.theta + half) * chord;

    return {pose.x + step.x, pose.y + step.y, wrap(pose.theta + move.turn)};
}

Driver::Driver(const FreeSpace &s, const std::vector<sim_point> &g, uint64_t seed)
    : space(s), goals(g), random(seed, drive_stream), goal(0), leg(0), last(), stuck(0),
      back_off(0), failures(0), back_turn(0), wander(0)
{
}

void Driver::plan(sim_pose pose)
{
    way =
        space.way(space.nearest_reachable({pose.x, pose.y}), space.nearest_reachable(goals[goal]));
    leg = 0;
}

void Driver::command(sim_pose pose, double *speed, double *turn_rate)
{
    sim_point at = {pose.x, pose.y};
    double off;

    // Steering noise: about 0.13 rad, correlated over about a second.
    wander = 0.98 * wander + 0.025 * random.normal();
    // Stuck: hardly any motion for half a second.
    if (length(at - sim_point{last.x, last.y}) > 0.05 ||
        std::abs(wrap(pose.theta - last.theta)) > 0.1) {
        last = pose;
        stuck = 0;
    } else if (++stuck * time_step > 0.5) {
        stuck = 0;
        back_off = 50;
        back_turn = random.uniform(-1, 1);
        way.clear();
        if (++failures > 4) {
            failures = 0;
            goal = (goal + 1) % goals.size();
        }
    }
    if (back_off > 0) {
        back_off--;
        *speed = -0.3;
        *turn_rate = back_turn;
        return;
    }
    if (way.empty())
        plan(pose);
    while (leg < way.size() && length(way[leg] - at) < 0.2)
        leg++;
    if (leg == way.size()) {
        goal = (goal + 1) % goals.size();
        failures = 0;
        way.clear();
        *speed = *turn_rate = 0;
        return;
    }
    off = wrap(std::atan2(way[leg].y - at.y, way[leg].x - at.x) - pose.theta + wander);
    *turn_rate = std::clamp(2.5 * off, -top_turn_rate, top_turn_rate);
    *speed = top_speed * std::max(0.0, 1 - std::abs(off) / 0.7);
}

} // namespace sim
