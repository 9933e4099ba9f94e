#include "sim/arena_parts.h"

#include <algorithm>

namespace sim
{

// Random streams of a scan: 4 * index + one of these.
enum { noise_of_scan = 0, dropout_of_scan = 1, tilt_of_scan = 2, lost_of_scan = 3 };

// The noise of a range to the floor, which beams meet at a grazing angle, over that to a wall.
constexpr double floor_noise = 3;

static Random scan_random(uint64_t seed, int32_t index, int which)
{
    return Random(seed, scan_streams + 4 * (uint64_t)index + (uint64_t)which);
}

Scanner::Scanner(const sim_arena &where, const sim_survey_options &how)
    : arena(where), options(how), glass(where.bodies.size()), carried(how), tilts(how), sweep(),
      first(), index(0), next(0)
{
    Random random(how.seed, glass_stream);

    for (size_t body = 0; body < glass.size(); body++)
        glass[body] = random.chance(how.glass) && where.bodies[body].kind <= SIM_FURNITURE;
}

void Scanner::begin(const State &state, int32_t number, double speed, double turn_rate)
{
    bool whole_turn = options.fov > 2 * pi - 1e-9;
    FloorLine floor = tilts.at(state.way);
    sim_scan scan = {};

    scan.count = options.beams;
    scan.place = scan.heading = -1;
    scan.angle_step = options.fov / (whole_turn ? options.beams : options.beams - 1);
    scan.angle_min =
        -options.fov / 2 + scan.angle_step * (number % options.start_angles) / options.start_angles;
    scan.range_min = options.range_min;
    scan.range_max = options.range_max;
    scan.range_sigma = options.noise;
    if (options.ground > 0) {
        scan.ground = floor.distance;
        scan.ground_bearing = floor.bearing;
    }
    scan.base_sensor = options.base_sensor;
    scan.truth = state.truth;
    scan.odometry = state.odometry;
    scan.speed = speed;
    scan.turn_rate = turn_rate;
    scan.stamp_ns = (int64_t)std::llround(state.time * 1e9);
    sweep = {std::vector<float>((size_t)options.beams), std::vector<int32_t>((size_t)options.beams),
             scan};
    range.assign((size_t)options.beams, 0);
    first = state;
    index = number;
    next = 0;
}

int32_t Scanner::edge_of(const Hit &hit) const
{
    double best = -2;
    int32_t edge = SIM_MOVER;

    if (!hit.any)
        return SIM_NOTHING;
    if (hit.body == hit_mover)
        return SIM_MOVER;
    const sim_body &body = arena.bodies[(size_t)hit.body];
    for (int32_t i = body.first_edge; i < body.first_edge + body.edge_count; i++) {
        double likeness = dot(arena.edges[(size_t)i].normal, hit.normal);

        if (likeness > best) {
            best = likeness;
            edge = i;
        }
    }
    return edge;
}

bool Scanner::advance(const World &world, const State &before, const State &now)
{
    for (; next < options.beams; next++) {
        double due = first.time + options.scan_time * next / (options.beams - 1);
        double share = now.time > before.time ? (due - before.time) / (now.time - before.time) : 0;
        sim_pose base, sensor;
        double angle, own;
        Hit hit;

        if (due > now.time + 1e-9)
            return false;
        share = std::clamp(share, 0.0, 1.0);
        base = blend(before.truth, now.truth, share);
        sensor = compose(base, options.base_sensor);
        angle = sweep.scan.angle_min + next * sweep.scan.angle_step;
        hit = world.cast({sensor.x, sensor.y}, sensor.theta + angle, options.range_max);
        range[(size_t)next] = hit.range;
        sweep.edge[(size_t)next] = edge_of(hit);
        own = carried.range(angle, before.trailer + (now.trailer - before.trailer) * share);
        if (own < range[(size_t)next]) {
            range[(size_t)next] = own;
            sweep.edge[(size_t)next] = SIM_SELF;
        }
        if (next + 1 == options.beams) {
            sweep.scan.motion = between(first.truth, base);
            sweep.scan.odometry_motion =
                between(first.odometry, blend(before.odometry, now.odometry, share));
        }
    }
    return true;
}

// A scanner tilted by an angle a toward bearing b hits the floor in direction c at (height / tan a)
// / cos(c - b). A run of beams about b returns these ranges when they are shorter than the range to
// a body; the other beams are unaffected.
void Scanner::tilt()
{
    Random random = scan_random(options.seed, index, tilt_of_scan);
    double tilted_scans = std::min(1.0, 3 * options.tilt);
    bool tilted = random.chance(tilted_scans);
    double share = options.tilt / std::max(tilted_scans, 1e-9) * random.uniform(0.5, 1.5);
    double start = random.unit(), depth = random.uniform(0.35, 0.9), nearest = 1e9;
    int32_t length = std::min(options.beams, (int32_t)std::lround(share * options.beams));
    int32_t from = (int32_t)std::lround(start * (options.beams - length));

    if (!tilted || length == 0)
        return;
    auto leaning = [&](int32_t beam) {
        return std::max(0.1, std::cos((beam - from - (length - 1) / 2.0) * sweep.scan.angle_step));
    };
    for (int32_t i = from; i < from + length; i++)
        nearest = std::min(nearest, range[(size_t)i] * leaning(i));
    for (int32_t i = from; i < from + length; i++) {
        range[(size_t)i] = depth * nearest / leaning(i);
        sweep.edge[(size_t)i] = SIM_FLOOR;
    }
    sweep.scan.tilted = 1;
}

// A plane that descends by a toward bearing b, from a height h, meets the floor in direction c at
// (h / sin a) / cos(c - b), and never where that cosine is not positive.
void Scanner::meet_floor()
{
    for (size_t i = 0; sweep.scan.ground > 0 && i < range.size(); i++) {
        double angle = sweep.scan.angle_min + (double)i * sweep.scan.angle_step;
        double descent = std::cos(angle - sweep.scan.ground_bearing);

        if (descent <= 0 || sweep.scan.ground / descent >= range[i])
            continue;
        range[i] = sweep.scan.ground / descent;
        sweep.edge[i] = SIM_FLOOR;
        sweep.scan.tilted = 1;
    }
}

bool Scanner::is_glass(int32_t edge) const
{
    return edge >= 0 && glass[(size_t)arena.edges[(size_t)edge].body];
}

Sweep Scanner::finish()
{
    Random noise = scan_random(options.seed, index, noise_of_scan);
    Random dropout = scan_random(options.seed, index, dropout_of_scan);
    Random lost = scan_random(options.seed, index, lost_of_scan);

    tilt();
    meet_floor();
    for (size_t i = 0; i < range.size(); i++) {
        bool grazing = sweep.scan.ground > 0 && sweep.edge[i] == SIM_FLOOR;
        double error = noise.normal() * options.noise * (grazing ? floor_noise : 1);
        bool dropped = dropout.chance(options.dropout);
        bool is_lost = lost.chance(options.lost);
        double read = std::max(range[i] + error, options.range_min);

        if (is_lost || is_glass(sweep.edge[i]))
            sweep.edge[i] = SIM_NOTHING;
        if (sweep.edge[i] == SIM_NOTHING || (float)read >= (float)options.range_max) {
            sweep.edge[i] = SIM_NOTHING;
            sweep.range[i] = INFINITY;
        } else {
            sweep.range[i] = (float)read;
        }
        if (dropped) {
            sweep.edge[i] = SIM_DROPPED;
            sweep.range[i] = NAN;
        }
    }
    return sweep;
}

} // namespace sim
