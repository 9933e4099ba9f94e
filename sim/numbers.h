// numbers: random doubles from the library's integer stream, and poses in double, equal in both
// builds.
#ifndef CAIRN_SIM_NUMBERS_H
#define CAIRN_SIM_NUMBERS_H

#include <cmath>
#include <cstdint>

#include "cairn/random.h"
#include "sim/arena.h"

namespace sim
{

constexpr double pi = 3.14159265358979323846;

// Streams of one seed. Every scan has four of its own after `scan_streams`.
enum Stream : uint64_t {
    layout_stream = 1,
    turn_stream = 2,
    rubble_stream = 3,
    place_stream = 4,
    pose_stream = 5,
    drive_stream = 6,
    odometry_stream = 7,
    mover_stream = 8,
    disturb_stream = 9,
    sweep_stream = 10,
    crowd_stream = 11,
    glass_stream = 12,
    ground_stream = 13,
    scan_streams = 1024
};

class Random
{
  public:
    Random(uint64_t seed, uint64_t stream) : random(cairn_random_seed(seed, stream))
    {
    }
    double unit() // [0, 1), 53 bits
    {
        uint64_t high = cairn_random_bits(&random) >> 5;
        uint64_t low = cairn_random_bits(&random) >> 6;

        return (double)(high << 26 | low) * 0x1p-53;
    }
    double uniform(double low, double high)
    {
        return low + (high - low) * unit();
    }
    double normal()
    {
        double radius = std::sqrt(-2 * std::log(1 - unit()));

        return radius * std::cos(2 * pi * unit());
    }
    int below(int count) // [0, count)
    {
        return cairn_random_below(&random, count);
    }
    bool chance(double share)
    {
        return unit() < share;
    }

  private:
    cairn_random random;
};

inline sim_point operator+(sim_point a, sim_point b)
{
    return {a.x + b.x, a.y + b.y};
}

inline sim_point operator-(sim_point a, sim_point b)
{
    return {a.x - b.x, a.y - b.y};
}

inline sim_point operator*(sim_point a, double s)
{
    return {a.x * s, a.y * s};
}

inline double dot(sim_point a, sim_point b)
{
    return a.x * b.x + a.y * b.y;
}

inline double cross(sim_point a, sim_point b)
{
    return a.x * b.y - a.y * b.x;
}

inline double length(sim_point a)
{
    return std::hypot(a.x, a.y);
}

inline sim_point direction(double angle)
{
    return {std::cos(angle), std::sin(angle)};
}

inline sim_point turned(sim_point p, sim_point d) // by the angle of the direction
{
    return {d.x * p.x - d.y * p.y, d.y * p.x + d.x * p.y};
}

inline sim_point turned(sim_point p, double angle)
{
    return turned(p, direction(angle));
}

inline double wrap(double angle) // (-pi, pi]
{
    double wrapped = std::remainder(angle, 2 * pi);

    return wrapped <= -pi ? pi : wrapped;
}

inline sim_pose compose(sim_pose a_b, sim_pose b_c)
{
    sim_point p = turned({b_c.x, b_c.y}, a_b.theta);

    return {a_b.x + p.x, a_b.y + p.y, wrap(a_b.theta + b_c.theta)};
}

inline sim_pose between(sim_pose a_b, sim_pose a_c) // b_c
{
    sim_point p = turned({a_c.x - a_b.x, a_c.y - a_b.y}, -a_b.theta);

    return {p.x, p.y, wrap(a_c.theta - a_b.theta)};
}

// From a to b as time goes from 0 to 1, at constant speed and turn rate: along an arc.
inline sim_pose blend(const sim_pose &a, const sim_pose &b, double time)
{
    sim_pose way = between(a, b);
    double turn = way.theta, half = turn / 2, part = turn * time;
    double k = std::abs(half) > 1e-6 ? half / std::tan(half) : 1;
    sim_point velocity = {k * way.x + half * way.y, k * way.y - half * way.x};
    double along = std::abs(turn) > 1e-6 ? std::sin(part) / turn : time;
    double aside = std::abs(turn) > 1e-6 ? (1 - std::cos(part)) / turn : part * time / 2;

    return compose(a, {along * velocity.x - aside * velocity.y,
                       aside * velocity.x + along * velocity.y, part});
}

} // namespace sim

#endif
