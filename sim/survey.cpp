// survey: sends the robot through an arena, from place to place or on a drive, and collects its
// scans.
#include "sim/arena_parts.h"
#include "sim/crowd.h"
#include "sim/movers.h"
#include "sim/robot.h"

#include <algorithm>
#include <memory>

using namespace sim;

sim_survey_options sim_survey_default(void)
{
    sim_survey_options options = {};

    options.seed = 1;
    options.headings = 4;
    options.jitter_position = 0.15;
    options.jitter_heading = 5 * pi / 180;
    options.drive_distance = 0.4;
    options.drive_turn = 0.5;
    options.beams = 401;
    options.fov = 100 * pi / 180;
    options.start_angles = 1;
    options.range_min = 0.05;
    options.range_max = 8;
    options.noise = 0.01;
    options.sweep_speed = 0.4;
    options.sweep_turn = 1;
    options.slip_distance = 0.02;
    options.slip_turn = 0.02;
    options.slip_drift = 0.005;
    options.bias_scale = 0.02;
    options.bias_drift = 0.003;
    return options;
}

sim_survey_options sim_survey_default_for(sim_scene scene)
{
    sim_survey_options options = sim_survey_default();

    if (scene != SIM_HOSPITAL)
        return options;
    options.drive = 1500;
    options.drive_distance = 0.2;
    options.drive_turn = 0.2;
    options.beams = 181;
    options.fov = pi;
    options.start_angles = 4;
    options.range_max = 80;
    options.lost = 0.01;
    options.base_sensor = {0.22, 0, 0};
    options.slip_distance = 0.01;
    options.slip_turn = 0.01;
    options.slip_drift = 0.003;
    options.bias_scale = 0.005;
    options.bias_drift = 0.0005;
    return options;
}

// The farthest that a sensor may be from the centre of the robot, and the least that the robot
// reaches beyond it, so that it stays out of walls.
constexpr double most_offset = 0.25, cover = 0.05; // m

static double sensor_offset(const sim_survey_options &o)
{
    return std::hypot(o.base_sensor.x, o.base_sensor.y);
}

static bool ground_ok(const sim_survey_options &o, Fault &fault)
{
    return o.ground == 0 || within(fault, "ground", o.ground, 1, 50, "m");
}

static bool options_ok(const sim_survey_options &o, Fault &fault)
{
    return within(fault, "places", o.places, 0, 1000, "") &&
           within(fault, "headings", o.headings, 1, 64, "") &&
           within(fault, "jitter_position", o.jitter_position, 0, 1, "m") &&
           within(fault, "jitter_heading", o.jitter_heading, 0, 2 * pi, "rad") &&
           within(fault, "drive", o.drive, 0, 100000, "scans") &&
           within(fault, "drive_distance", o.drive_distance, 0.01, 100, "m") &&
           within(fault, "drive_turn", o.drive_turn, 0.01, 100, "rad") &&
           within(fault, "beams", o.beams, 2, 100000, "") &&
           within(fault, "fov", o.fov, 1e-3, 2 * pi + 1e-9, "rad") &&
           within(fault, "start_angles", o.start_angles, 1, 64, "") &&
           within(fault, "range_min", o.range_min, 0, 1, "m") &&
           within(fault, "range_max", o.range_max, 1, 200, "m") &&
           within(fault, "noise", o.noise, 0, 1, "m") &&
           within(fault, "dropout", o.dropout, 0, 1, "") &&
           within(fault, "lost", o.lost, 0, 1, "") && within(fault, "glass", o.glass, 0, 1, "") &&
           within(fault, "tilt", o.tilt, 0, 0.3, "") && ground_ok(o, fault) &&
           within(fault, "legs", o.legs, 0, 1, "") &&
           within(fault, "trailer", o.trailer, 0, 1, "") &&
           within(fault, "scan_time", o.scan_time, 0, 2, "s") &&
           within(fault, "sweep_speed", o.sweep_speed, 0, 5, "m/s") &&
           within(fault, "sweep_turn", o.sweep_turn, 0, 20, "rad/s") &&
           within(fault, "base_sensor", sensor_offset(o), 0, most_offset, "m") &&
           within(fault, "base_sensor.theta", o.base_sensor.theta, -10, 10, "rad") &&
           within(fault, "movers", o.movers, 0, 100, "") &&
           within(fault, "crowd", o.crowd, 0, 0.5, "") &&
           within(fault, "slip_distance", o.slip_distance, 0, 1, "m per root m") &&
           within(fault, "slip_turn", o.slip_turn, 0, 1, "rad per root rad") &&
           within(fault, "slip_drift", o.slip_drift, 0, 1, "rad per root m") &&
           within(fault, "bias_scale", o.bias_scale, 0, 1, "") &&
           within(fault, "bias_drift", o.bias_drift, 0, 1, "rad per m");
}

static bool is_stopped(const sim_survey_options &o)
{
    return o.is_stopped && o.is_stopped();
}

namespace
{

// The simulation of a survey: world, robot, scanner, movers and crowd.
class Expedition
{
  public:
    explicit Expedition(sim_survey &s)
        : survey(s), options(s.options),
          world(s.arena->layout.bodies, std::max(robot_radius, sensor_offset(s.options) + cover)),
          movers(world, s.arena->space, s.options.movers, s.options.seed),
          crowd(world, *s.arena, s.options), wheels(s.options), scanner(*s.arena, s.options),
          state()
    {
    }

    void start(sim_pose pose)
    {
        state = {0, pose, pose, 0, 0};
        survey.path.push_back(pose);
    }

    // Moves along the path without collisions: rotates to each leg, drives it, rotates to the
    // heading of the target at the end.
    void go(const std::vector<sim_point> &way, sim_pose target)
    {
        double until = state.time;

        for (sim_point p : way) {
            sim_point leg = p - sim_point{state.truth.x, state.truth.y};

            if (length(leg) < 1e-6)
                continue;
            until += step({0, wrap(std::atan2(leg.y, leg.x) - state.truth.theta)});
            for (int i = 0, pieces = (int)std::ceil(length(leg) / 0.25); i < pieces; i++)
                until += step({length(leg) / pieces, 0});
        }
        until += step({0, wrap(target.theta - state.truth.theta)}) + 0.5;
        state.truth = target;
        double time = state.time;
        while (movers.any() && time < until) {
            movers.step();
            world.step();
            time += time_step;
        }
        state.time = until;
    }

    // Takes a scan at constant velocities.
    void sweep(double speed, double turn_rate, int32_t place, int32_t heading)
    {
        sim_pose start = state.truth, odometry = state.odometry;
        double begun = state.time;
        State before = state;
        Move reported = wheels.report({speed * options.scan_time, turn_rate * options.scan_time});

        movers.make_room({state.truth.x, state.truth.y});
        crowd.gather(compose(state.truth, options.base_sensor));
        hold_place();
        scanner.begin(state, (int32_t)survey.sweeps.size(), speed, turn_rate);
        while (!scanner.advance(world, before, state)) {
            double time = state.time + time_step - begun, share = time / options.scan_time;

            before = state;
            state.time += time_step;
            state.truth = moved(start, {speed * time, turn_rate * time});
            state.odometry = moved(odometry, {reported.distance * share, reported.turn * share});
            carry({speed * time_step, turn_rate * time_step});
            hold_place();
            movers.step();
            world.step();
        }
        keep(place, heading);
        survey.path.push_back(state.truth);
    }

    // Drives along the places until there are `options.drive` scans.
    void drive(const std::vector<sim_point> &goals)
    {
        Driver driver(survey.arena->space, goals, options.seed);
        double way = 1e9, turn = 0; // since the last scan
        bool sweeping = false;
        State before = state;

        world.place_robot(state.truth);
        movers.make_room({state.truth.x, state.truth.y});
        while ((int32_t)survey.sweeps.size() < options.drive && !is_stopped(options)) {
            double speed, turn_rate;
            Move slipped, reported;

            driver.command(state.truth, &speed, &turn_rate);
            if (!sweeping && (way >= options.drive_distance || turn >= options.drive_turn)) {
                scanner.begin(state, (int32_t)survey.sweeps.size(), speed, turn_rate);
                survey.path.push_back(state.truth);
                sweeping = true;
                way = turn = 0;
            }
            if (sweeping && scanner.advance(world, before, state)) {
                keep(-1, -1);
                sweeping = false;
                continue;
            }
            before = state;
            slipped = wheels.slip({speed * time_step, turn_rate * time_step});
            reported = wheels.report({speed * time_step, turn_rate * time_step});
            world.drive_robot(slipped.distance / time_step, slipped.turn / time_step);
            movers.step();
            world.step();
            state.time += time_step;
            state.truth = world.robot();
            state.odometry = moved(state.odometry, reported);
            sim_pose moved_by = between(before.truth, state.truth);
            way += std::hypot(moved_by.x, moved_by.y);
            turn += std::abs(moved_by.theta);
            carry({moved_by.x, moved_by.theta});
            if (length(sim_point{state.truth.x, state.truth.y} -
                       sim_point{survey.path.back().x, survey.path.back().y}) > 0.1)
                survey.path.push_back(state.truth);
        }
        survey.bumps = world.bumps();
    }

    const State &now() const
    {
        return state;
    }

  private:
    // Movers keep clear of the robot.
    void hold_place()
    {
        if (movers.any())
            world.place_robot(state.truth);
    }

    // What follows the robot, and the length of its path, after a move.
    void carry(Move move)
    {
        state.way += std::abs(move.distance);
        state.trailer = trailer_after(state.trailer, move);
    }

    // Performs a move with its odometry; returns its duration, s.
    double step(Move move)
    {
        state.truth = moved(state.truth, move);
        state.odometry = moved(state.odometry, wheels.report(wheels.slip(move)));
        carry(move);
        survey.path.push_back(state.truth);
        return std::abs(move.distance) / top_speed + std::abs(move.turn) / top_turn_rate;
    }

    void keep(int32_t place, int32_t heading)
    {
        survey.sweeps.push_back(scanner.finish());
        survey.sweeps.back().scan.place = place;
        survey.sweeps.back().scan.heading = heading;
    }

    sim_survey &survey;
    const sim_survey_options &options;
    World world;
    Movers movers;
    Crowd crowd;
    Wheels wheels;
    Scanner scanner;
    State state;
};

} // namespace

// Returns a pose of the base at a place with jittered sensor position and sufficient clearance.
static sim_pose pose_at(const sim_survey &survey, size_t place, double heading, Random &random)
{
    const sim_survey_options &o = survey.options;
    sim_point at = survey.places[place];
    double theta = heading + random.uniform(-0.5, 0.5) * o.jitter_heading;

    for (int attempt = 0; attempt < 100; attempt++) {
        double r = std::sqrt(random.unit()) * o.jitter_position / 2,
               angle = random.uniform(-pi, pi);
        sim_point p = survey.places[place] + direction(angle) * r;

        if (sim_arena_clearance(survey.arena, p) < free_clearance)
            continue;
        at = p;
        break;
    }
    sim_point off = turned({o.base_sensor.x, o.base_sensor.y}, theta - o.base_sensor.theta);
    return {at.x - off.x, at.y - off.y, wrap(theta - o.base_sensor.theta)};
}

static void survey_places(sim_survey &survey, Expedition &expedition)
{
    const sim_survey_options &o = survey.options;
    const FreeSpace &space = survey.arena->space;
    Random poses(o.seed, pose_stream), speeds(o.seed, sweep_stream);

    double first_heading = 0;

    for (size_t place = 0; place < survey.places.size(); place++) {
        double heading = poses.uniform(-pi, pi);

        if (place == 0)
            first_heading = heading;
        if (o.same_headings)
            heading = first_heading;
        for (int32_t k = 0; k < o.headings && !is_stopped(o); k++) {
            sim_pose next = pose_at(survey, place, heading + 2 * pi * k / o.headings, poses);
            double speed = speeds.uniform(-1, 1) * o.sweep_speed,
                   turn_rate = speeds.uniform(-1, 1) * o.sweep_turn;
            std::vector<sim_point> way;

            if (place == 0 && k == 0) {
                expedition.start(next);
            } else {
                sim_pose here = expedition.now().truth;

                if (k == 0)
                    way = space.way(space.nearest_reachable({here.x, here.y}),
                                    space.nearest_reachable({next.x, next.y}));
                way.push_back({next.x, next.y});
                expedition.go(way, next);
            }
            if (std::abs(speed) * o.scan_time > 0.2)
                speed = std::copysign(0.2 / o.scan_time, speed);
            if (o.scan_time == 0)
                speed = turn_rate = 0;
            expedition.sweep(speed, turn_rate, (int32_t)place, k);
        }
    }
}

static sim_survey *complete(std::unique_ptr<sim_survey> survey)
{
    for (Sweep &sweep : survey->sweeps) {
        sweep.scan.range = sweep.range.data();
        sweep.scan.edge = sweep.edge.data();
        survey->scans.push_back(sweep.scan);
    }
    return survey.release();
}

sim_survey *sim_survey_create(const sim_arena *arena, const sim_survey_options *options,
                              char *fault_text, size_t fault_size)
{
    Fault fault = {fault_text, fault_size};
    std::unique_ptr<sim_survey> survey(new sim_survey{arena, *options, {}, {}, {}, {}, 0});
    sim_survey_options &o = survey->options;
    int found;

    if (!options_ok(o, fault))
        return NULL;
    o.places = o.places ? o.places : sim_scene_places(arena->options.scene);
    survey->places = choose_places(*arena, o.places, o.seed);
    found = (int)survey->places.size();
    if (found < o.places && fault.text)
        snprintf(fault.text, fault.size, "places is %d, expected at most %d in this arena",
                 (int)o.places, found);
    if (found < o.places)
        return NULL;

    Expedition expedition(*survey);
    if (o.drive > 0) {
        sim_point first = survey->places[0];
        Random heading(o.seed, pose_stream);

        expedition.start({first.x, first.y, heading.uniform(-pi, pi)});
        expedition.drive(survey->places);
    } else {
        survey_places(*survey, expedition);
    }
    if (is_stopped(o))
        return NULL;
    return complete(std::move(survey));
}

sim_survey *sim_survey_at(const sim_arena *arena, const sim_survey_options *options,
                          const sim_pose *poses, int32_t count, double speed, double turn_rate,
                          char *fault_text, size_t fault_size)
{
    Fault fault = {fault_text, fault_size};
    std::unique_ptr<sim_survey> survey(new sim_survey{arena, *options, {}, {}, {}, {}, 0});

    if (!options_ok(survey->options, fault))
        return NULL;
    if (!within(fault, "speed", speed, -5, 5, "m/s") ||
        !within(fault, "turn_rate", turn_rate, -20, 20, "rad/s"))
        return NULL;
    for (int32_t i = 0; i < count; i++) {
        sim_pose sensor = compose(poses[i], options->base_sensor);

        if (sim_arena_clearance(arena, {sensor.x, sensor.y}) > 0)
            continue;
        if (fault.text)
            snprintf(fault.text, fault.size, "pose %d is inside a body, expected free space",
                     (int)i);
        return NULL;
    }
    Expedition expedition(*survey);
    for (int32_t i = 0; i < count; i++) {
        if (i == 0)
            expedition.start(poses[i]);
        else
            expedition.go({{poses[i].x, poses[i].y}}, poses[i]);
        expedition.sweep(speed, turn_rate, -1, -1);
    }
    return complete(std::move(survey));
}

void sim_survey_free(sim_survey *survey)
{
    delete survey;
}

sim_survey_options sim_survey_options_of(const sim_survey *survey)
{
    return survey->options;
}

const sim_arena *sim_survey_arena(const sim_survey *survey)
{
    return survey->arena;
}

const sim_scan *sim_survey_scans(const sim_survey *survey, int32_t *count)
{
    *count = (int32_t)survey->scans.size();
    return survey->scans.data();
}

const sim_point *sim_survey_places(const sim_survey *survey, int32_t *count)
{
    *count = (int32_t)survey->places.size();
    return survey->places.data();
}

const sim_pose *sim_survey_path(const sim_survey *survey, int32_t *count)
{
    *count = (int32_t)survey->path.size();
    return survey->path.data();
}

int32_t sim_survey_bumps(const sim_survey *survey)
{
    return survey->bumps;
}

void sim_survey_disturb(const sim_survey *survey, uint64_t seed, double metres, double radians,
                        sim_pose *poses)
{
    Random random(seed, disturb_stream);

    for (size_t i = 0; i < survey->scans.size(); i++) {
        const sim_pose &truth = survey->scans[i].truth;
        double x = random.uniform(-metres, metres), y = random.uniform(-metres, metres);
        double theta = random.uniform(-radians, radians);

        poses[i] = {truth.x + x, truth.y + y, wrap(truth.theta + theta)};
    }
}
