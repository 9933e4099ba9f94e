#include "sim/files.h"

#include "sim/numbers.h"
#include "sim/text.h"

using namespace sim;

static Text &pose_into(Text &text, sim_pose pose)
{
    return text << pose.x << " " << pose.y << " " << pose.theta;
}

int32_t sim_write_log(const sim_survey *survey, const sim_pose *poses, const char *command,
                      FILE *file)
{
    sim_survey_options o = sim_survey_options_of(survey);
    sim_arena_options a = sim_arena_options_of(sim_survey_arena(survey));
    // FLASER has no start angle: it is that of half a turn.
    bool half_turn = std::abs(o.fov - pi) < 1e-9 && o.start_angles == 1;
    int32_t count;
    const sim_scan *scans = sim_survey_scans(survey, &count);
    Text text;

    text << "# cairn-arena: " << sim_scene_name(a.scene) << ", " << a.width << " x " << a.height
         << " m, seed " << a.seed << "\n";
    if (command)
        text << "# " << command << "\n";
    text << "# m, rad, s. Poses: " << (poses ? "the truth, disturbed" : "odometry that drifts")
         << ". "
         << "A beam that met nothing reads " << o.range_max << ", a beam that was lost reads 0.\n";
    if (half_turn)
        text << "# FLASER n range... laser_x laser_y laser_theta odom_x odom_y odom_theta stamp "
                "host logger_stamp\n";
    else
        text << "# ROBOTLASER1 type start_angle fov resolution max_range accuracy remission_mode n "
                "range... 0 "
                "laser_x laser_y laser_theta robot_x robot_y robot_theta tv rv safety safety "
                "turn_axis stamp host "
                "logger_stamp\n";
    text << "# ODOM x y theta tv rv accel stamp host logger_stamp\n";
    text << "PARAM robot_frontlaser_offset " << o.base_sensor.x << " nohost 0\n";
    text << "PARAM robot_front_laser_max " << o.range_max << " nohost 0\n";
    for (int32_t i = 0; i < count; i++) {
        const sim_scan &scan = scans[i];
        sim_pose robot = poses ? poses[i] : scan.odometry, laser = compose(robot, scan.base_sensor);
        double stamp = (double)scan.stamp_ns * 1e-9;

        pose_into(text << "ODOM ", robot) << " " << scan.speed << " " << scan.turn_rate << " 0 ";
        text.fixed(stamp, 6) << " host ";
        text.fixed(stamp, 6) << "\n";
        if (half_turn)
            text << "FLASER ";
        else
            text << "ROBOTLASER1 0 " << scan.angle_min << " " << o.fov << " " << scan.angle_step
                 << " " << scan.range_max << " " << scan.range_sigma << " 0 ";
        text << scan.count;
        for (int32_t k = 0; k < scan.count; k++) {
            double range = (double)scan.range[k];

            text << " " << (std::isnan(range) ? 0 : std::isinf(range) ? scan.range_max : range);
        }
        if (!half_turn)
            text << " 0";
        pose_into(pose_into(text << " ", laser) << " ", robot) << " ";
        if (!half_turn)
            text << scan.speed << " " << scan.turn_rate << " 0 0 0 ";
        text.fixed(stamp, 6) << " host ";
        text.fixed(stamp, 6) << "\n";
    }
    return text.write(file);
}

int32_t sim_write_truth(const sim_survey *survey, FILE *file)
{
    int32_t count;
    const sim_scan *scans = sim_survey_scans(survey, &count);
    Text text;

    text << "index,x,y,theta,place,heading,stamp,ground\n";
    for (int32_t i = 0; i < count; i++) {
        text << i << ",";
        text.digits(scans[i].truth.x, 17) << ",";
        text.digits(scans[i].truth.y, 17) << ",";
        text.digits(scans[i].truth.theta, 17)
            << "," << scans[i].place << "," << scans[i].heading << ",";
        text.digits((double)scans[i].stamp_ns * 1e-9, 17) << "," << scans[i].ground << "\n";
    }
    return text.write(file);
}

int32_t sim_write_json(const sim_arena *arena, FILE *file)
{
    static const char *const kinds[] = {"wall", "furniture", "box", "rubble", "glass"};
    sim_arena_options o = sim_arena_options_of(arena);
    int32_t body_count, edge_count;
    const sim_body *bodies = sim_arena_bodies(arena, &body_count);
    const sim_edge *edges = sim_arena_edges(arena, &edge_count);
    Text text;

    text << "{\n  \"scene\": \"" << sim_scene_name(o.scene) << "\",\n  \"seed\": " << o.seed
         << ",\n  \"width_m\": " << o.width << ",\n  \"height_m\": " << o.height
         << ",\n  \"turn_rad\": ";
    text.digits(o.turn, 17) << ",\n  \"rubble\": " << o.rubble << ",\n  \"bodies\": [\n";
    for (int32_t i = 0; i < body_count; i++) {
        const sim_body &b = bodies[i];

        text << "    {\"id\": " << i << ", \"kind\": \"" << kinds[b.kind]
             << "\", \"first_edge\": " << b.first_edge << ", \"edges\": " << b.edge_count
             << ", \"centre\": [" << b.centre.x << ", " << b.centre.y << "], \"angle\": " << b.angle
             << ", \"radius\": " << b.radius << ", \"glass\": " << b.glass << "}"
             << (i + 1 < body_count ? ",\n" : "\n");
    }
    text << "  ],\n  \"edges\": [\n";
    for (int32_t i = 0; i < edge_count; i++) {
        const sim_edge &e = edges[i];

        text << "    {\"id\": " << i << ", \"body\": " << e.body << ", \"a\": [" << e.a.x << ", "
             << e.a.y << "], \"b\": [" << e.b.x << ", " << e.b.y << "], \"normal\": [" << e.normal.x
             << ", " << e.normal.y << "], \"radius\": " << e.radius
             << ", \"curved\": " << (e.curved ? "true" : "false") << "}"
             << (i + 1 < edge_count ? ",\n" : "\n");
    }
    text << "  ]\n}\n";
    return text.write(file);
}
