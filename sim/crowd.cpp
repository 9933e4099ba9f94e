#include "sim/crowd.h"
#include "sim/arena_parts.h"

#include <algorithm>

namespace sim
{

enum { crowd_most = 12, attempts_most = 200 };

constexpr double nearest = 0.8, farthest = 4; // m, of a person from the sensor

Crowd::Crowd(World &w, const sim_arena &a, const sim_survey_options &o)
    : world(w), arena(a), options(o), random(o.seed, crowd_stream)
{
    for (size_t i = 0; i < (o.crowd > 0 ? crowd_most : 0); i++) {
        radius.push_back(random.uniform(0.15, 0.25));
        people.push_back(world.add_mover({0, 0}, radius[i]));
        send_away(i);
    }
}

// Moves a person far outside the arena, without overlaps.
void Crowd::send_away(size_t person)
{
    world.place_mover(people[person], {1000 + 2 * (double)person, 1000});
}

// Places a person at a random visible position clear of all bodies.
bool Crowd::place_one(sim_pose sensor, size_t person)
{
    double bearing = sensor.theta + random.uniform(-0.5, 0.5) * options.fov;
    double distance = random.uniform(nearest, farthest);
    sim_point at = sim_point{sensor.x, sensor.y} + direction(bearing) * distance;
    Hit hit = world.cast({sensor.x, sensor.y}, bearing, options.range_max);

    if (hit.range < distance + radius[person] || sim_arena_clearance(&arena, at) < radius[person])
        return false;
    world.place_mover(people[person], at);
    return true;
}

// Returns the fraction of the beams that end on people.
double Crowd::covered(sim_pose sensor) const
{
    bool whole_turn = options.fov > 2 * pi - 1e-9;
    double step = options.fov / (whole_turn ? options.beams : options.beams - 1);
    int32_t hits = 0;

    for (int32_t i = 0; i < options.beams; i++) {
        Hit hit = world.cast({sensor.x, sensor.y}, sensor.theta - options.fov / 2 + i * step,
                             options.range_max);

        hits += hit.any && hit.body == hit_mover;
    }
    return (double)hits / options.beams;
}

void Crowd::gather(const sim_pose &sensor)
{
    size_t placed = 0;
    double share = 0;

    for (size_t i = 0; i < people.size(); i++)
        send_away(i);
    for (int attempt = 0;
         attempt < attempts_most && placed < people.size() && share < options.crowd; attempt++) {
        if (!place_one(sensor, placed))
            continue;
        double now = covered(sensor);

        if (now > 1.25 * options.crowd) {
            send_away(placed);
            continue;
        }
        share = now;
        placed++;
    }
}

} // namespace sim
