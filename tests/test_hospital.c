/* The scene hospital, and returns that travel with the robot: floor, legs, trailer. */
#include "tests/surveys.h"

#include "sim/files.h"

static const double pi = 3.14159265358979323846;
static const double step = 3.14159265358979323846 / 180; /* between two beams */

/* The leaf of a door is 4 cm thick; no other furniture is. Returns its width; 0: not a leaf. */
static double leaf_of(const sim_body *body, const sim_edge *edges)
{
    const sim_edge *e = &edges[body->first_edge];
    double one = hypot(e[0].b.x - e[0].a.x, e[0].b.y - e[0].a.y);
    double two = hypot(e[1].b.x - e[1].a.x, e[1].b.y - e[1].a.y);

    if (body->kind != SIM_FURNITURE || fabs(fmin(one, two) - 0.04) > 1e-9)
        return 0;
    return fmax(one, two);
}

static void there_are_many_doors_alike_and_every_seed_has_its_own(void **state)
{
    int32_t doors_of[6] = {0}, panes_of[6] = {0}, different = 0;

    (void)state;
    for (int32_t seed = 0; seed < 6; seed++) {
        sim_arena *arena = turned_arena_of(SIM_HOSPITAL, (uint64_t)seed + 1, 0);
        int32_t bodies, edge_count, closed = 0;
        const sim_body *body = sim_arena_bodies(arena, &bodies);
        const sim_edge *edges = sim_arena_edges(arena, &edge_count);

        for (int32_t i = 0; i < bodies; i++) {
            double width = leaf_of(&body[i], edges);

            panes_of[seed] += body[i].kind == SIM_GLASS;
            assert_true((body[i].kind == SIM_GLASS) == (body[i].glass > 0));
            if (body[i].kind == SIM_GLASS)
                assert_true(body[i].glass >= 8 * pi / 180 && body[i].glass < 35 * pi / 180);
            if (width == 0)
                continue;
            doors_of[seed]++;
            assert_true(width > 1.05 && width < 1.3);
            /* Closed in a wall that is parallel to an axis; open leaves stand at 69 to 89 degrees. */
            closed += fabs(sin(2 * body[i].angle)) < 1e-9;
        }
        /* Two or more rooms in a wing of 12 m, in up to four wings of 35 m about 80. */
        assert_in_range(doors_of[seed], 55, 110);
        assert_in_range(closed, doors_of[seed] / 3, doors_of[seed] * 9 / 10);
        assert_true(panes_of[seed] > doors_of[seed]);
    }
    for (int32_t a = 0; a < 6; a++)
        for (int32_t b = 0; b < a; b++)
            different += doors_of[a] != doors_of[b] || panes_of[a] != panes_of[b];
    assert_true(different >= 14); /* of 15 pairs */
}

static void all_places_of_the_tour_can_be_reached(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 6; seed++) {
        sim_arena *arena = arena_of(SIM_HOSPITAL, seed);
        sim_survey_options options = sim_survey_default();
        sim_survey *survey;
        const sim_point *places;
        int32_t count;

        options.headings = 1;
        options.beams = 2;
        survey = survey_of(arena, &options);
        places = sim_survey_places(survey, &count);
        assert_int_equal(count, 24);
        for (int32_t i = 0; i < count; i++)
            if (!sim_arena_reachable(arena, places[i]))
                fail_msg("seed %d: place %d has a clearance of %g m", (int)seed, (int)i,
                         sim_arena_clearance(arena, places[i]));
    }
}

/* What a scan of the drive shares with an earlier one that is 20 m of the path before. */
static void the_drive_is_long_and_seldom_comes_back(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 3; seed++) {
        sim_arena *arena = turned_arena_of(SIM_HOSPITAL, seed, 0);
        sim_survey_options options = sim_survey_default_for(SIM_HOSPITAL);
        const sim_scan *scans;
        int32_t count, back = 0;
        double way = 0, low_x = 0, high_x = 0, low_y = 0, high_y = 0;

        options.seed = seed;
        options.beams = 2;
        scans = scans_of(arena, &options, &count);
        assert_int_equal(count, 1500);
        for (int32_t i = 0; i < count; i++) {
            int32_t near = 0;

            if (i > 0)
                way += hypot(scans[i].truth.x - scans[i - 1].truth.x,
                             scans[i].truth.y - scans[i - 1].truth.y);
            low_x = fmin(low_x, scans[i].truth.x);
            high_x = fmax(high_x, scans[i].truth.x);
            low_y = fmin(low_y, scans[i].truth.y);
            high_y = fmax(high_y, scans[i].truth.y);
            for (int32_t k = 0; k < i - 100 && !near; k++)
                near = hypot(scans[i].truth.x - scans[k].truth.x,
                             scans[i].truth.y - scans[k].truth.y) < 2;
            back += near;
        }
        assert_true(way > 250 && way < 310);
        assert_true(high_x - low_x > 45 && high_y - low_y > 40);
        assert_in_range(back, 20, count * 35 / 100);
    }
}

static void four_first_angles_follow_each_other(void **state)
{
    sim_arena *arena = turned_arena_of(SIM_HOSPITAL, 1, 0);
    sim_survey_options options = sim_survey_default_for(SIM_HOSPITAL);
    sim_survey *survey;
    const sim_scan *scans;
    int32_t count, lines = 0;
    FILE *file = tmpfile();
    char start[2000];

    (void)state;
    options.drive = 12;
    survey = survey_of(arena, &options);
    scans = sim_survey_scans(survey, &count);
    for (int32_t i = 0; i < count; i++) {
        assert_near(scans[i].angle_step, step, 1e-12);
        assert_near(scans[i].angle_min, -pi / 2 + (i % 4) * step / 4, 1e-12);
        assert_near(scans[i].base_sensor.x, 0.22, 0);
    }
    /* FLASER has no first angle: the log has ROBOTLASER1, each with its own. */
    assert_non_null(file);
    assert_int_equal(sim_write_log(survey, NULL, NULL, file), 0);
    rewind(file);
    while (fgets(start, sizeof start, file) != NULL) {
        assert_true(strncmp(start, "FLASER", 6) != 0);
        if (strncmp(start, "ROBOTLASER1 0 ", 14) == 0)
            assert_near(strtod(start + 14, NULL), scans[lines++].angle_min, 1e-8);
        while (strchr(start, '\n') == NULL && fgets(start, sizeof start, file) != NULL)
            continue; /* the rest of a long line */
    }
    assert_int_equal(lines, count);
    fclose(file);
}

static void the_same_options_give_the_same_drive(void **state)
{
    sim_arena *arena = turned_arena_of(SIM_HOSPITAL, 2, 0);
    sim_survey_options options = sim_survey_default_for(SIM_HOSPITAL);
    const sim_scan *a, *b, *c;
    int32_t count, differ = 0;

    (void)state;
    options.drive = 250;
    options.ground = 6;
    options.legs = options.trailer = 1;
    a = scans_of(arena, &options, &count);
    b = scans_of(arena, &options, &count);
    options.seed = 9;
    c = scans_of(arena, &options, &count);
    for (int32_t i = 0; i < count; i++) {
        assert_memory_equal(a[i].range, b[i].range, (size_t)a[i].count * sizeof(float));
        assert_memory_equal(&a[i].truth, &b[i].truth, sizeof a[i].truth);
        assert_near(a[i].ground, b[i].ground, 0);
        differ += a[i].ground != c[i].ground;
    }
    assert_true(differ > 20);
}

/* ---- The floor ---- */

/* Reference implementation: a sensor 1 m above the floor, the plane of its beams tilted toward
 * `bearing` so that it meets the floor at `distance`; where the beam at `angle` in that plane
 * reaches the height 0. */
static double floor_range(double distance, double bearing, double angle)
{
    double descent = asin(1 / distance);
    double down[3] = {cos(bearing) * cos(descent), sin(bearing) * cos(descent), -sin(descent)};
    double level[3] = {-sin(bearing), cos(bearing), 0};
    double along[3];

    for (int32_t i = 0; i < 3; i++)
        along[i] = cos(angle - bearing) * down[i] + sin(angle - bearing) * level[i];
    return along[2] < -1e-12 ? -1 / along[2] : 1e9;
}

static void a_tilted_scanner_sees_the_nearer_of_floor_and_wall(void **state)
{
    sim_arena *arena = turned_arena_of(SIM_HOSPITAL, 3, 0);
    sim_survey_options options = sim_survey_default_for(SIM_HOSPITAL);
    sim_survey *tilted;
    const sim_scan *a, *b;
    int32_t count, floors = 0, walls = 0, tilted_scans = 0;

    (void)state;
    options.drive = 400;
    options.noise = options.lost = 0;
    a = scans_of(arena, &options, &count);
    options.ground = 6;
    tilted = survey_of(arena, &options);
    b = sim_survey_scans(tilted, &count);
    for (int32_t i = 0; i < count; i++) {
        int32_t here = 0;

        assert_memory_equal(&a[i].truth, &b[i].truth, sizeof a[i].truth);
        assert_near(a[i].ground, 0, 0);
        for (int32_t k = 0; k < a[i].count; k++) {
            double angle = b[i].angle_min + k * b[i].angle_step;
            double ground =
                b[i].ground > 0 ? floor_range(b[i].ground, b[i].ground_bearing, angle) : 1e9;

            if (ground < (double)a[i].range[k] && ground < 80) {
                assert_int_equal(b[i].edge[k], SIM_FLOOR);
                assert_near(b[i].range[k], ground, 1e-5 * ground);
                here++;
            } else {
                assert_same_return(&b[i], &a[i], k);
                walls += b[i].ground > 0;
            }
        }
        floors += here;
        tilted_scans += here > 0;
        assert_int_equal(b[i].tilted, here > 0);
    }
    assert_true(tilted_scans > 30 && floors > 8 * tilted_scans && walls > floors);
}

static void the_floor_is_met_on_several_stretches_of_5_to_15_m(void **state)
{
    static const double ground[] = {4, 13};
    sim_arena *arena = turned_arena_of(SIM_CORRIDOR, 1, 0);

    (void)state;
    for (uint64_t seed = 1; seed <= 2; seed++) {
        sim_survey_options options = sim_survey_default_for(SIM_HOSPITAL);
        const sim_scan *scans;
        int32_t count, stretches = 0;
        double way = 0, from = 0, ended = 0, nearest = 1e9, farthest = 0;

        options.seed = seed;
        options.beams = 2;
        options.ground = ground[seed - 1];
        scans = scans_of(arena, &options, &count);
        for (int32_t i = 1; i < count; i++) {
            double step_m = hypot(scans[i].truth.x - scans[i - 1].truth.x,
                                  scans[i].truth.y - scans[i - 1].truth.y);

            way += step_m;
            if (scans[i].ground > 0) {
                nearest = fmin(nearest, scans[i].ground);
                farthest = fmax(farthest, scans[i].ground);
                assert_true(fabs(scans[i].ground_bearing) <= 8 * pi / 180);
            }
            if (scans[i].ground > 0 && scans[i - 1].ground == 0) {
                from = way;
                /* the path between scans is longer than their distance, by turns back and forth */
                assert_true(way - ended > 8.5 && way - ended < 40.5);
            }
            if (scans[i].ground == 0 && scans[i - 1].ground > 0) {
                stretches++;
                ended = way;
                assert_true(way - from > 4 && way - from < 15.5);
            }
        }
        assert_true(stretches >= 4);
        assert_true(nearest > 0.9 * options.ground && nearest < 0.95 * options.ground);
        assert_true(farthest < 1.1 * options.ground && farthest > 1.05 * options.ground);
    }
}

static void ranges_to_the_floor_have_three_times_the_noise(void **state)
{
    sim_arena *arena = turned_arena_of(SIM_HOSPITAL, 1, 0);
    sim_survey_options options = sim_survey_default_for(SIM_HOSPITAL);
    const sim_scan *scans;
    int32_t count, floors = 0;
    double squares = 0;

    (void)state;
    options.drive = 600;
    options.ground = 4;
    scans = scans_of(arena, &options, &count);
    for (int32_t i = 0; i < count; i++)
        for (int32_t k = 0; k < scans[i].count; k++)
            if (scans[i].edge[k] == SIM_FLOOR) {
                double angle = scans[i].angle_min + k * scans[i].angle_step;
                double error = (double)scans[i].range[k] -
                               floor_range(scans[i].ground, scans[i].ground_bearing, angle);

                squares += error * error;
                floors++;
            }
    assert_true(floors > 1500);
    assert_near(sqrt(squares / floors), 3 * options.noise, 0.003);
}

/* ---- Legs and trailer ---- */

static void legs_return_at_sixty_degrees_and_nothing_else_changes(void **state)
{
    sim_arena *arena = turned_arena_of(SIM_HOSPITAL, 1, 0);
    sim_survey_options options = sim_survey_default_for(SIM_HOSPITAL);
    const sim_scan *a, *b;
    int32_t count, own = 0;

    (void)state;
    options.drive = 40;
    options.noise = options.lost = 0;
    a = scans_of(arena, &options, &count);
    options.legs = 1;
    b = scans_of(arena, &options, &count);
    for (int32_t i = 0; i < count; i++)
        for (int32_t k = 0; k < a[i].count; k++) {
            double angle = a[i].angle_min + k * a[i].angle_step;

            assert_memory_equal(&a[i].truth, &b[i].truth, sizeof a[i].truth);
            if (fabs(fabs(angle) - pi / 3) < atan(0.02 / 0.3) && a[i].range[k] > 0.3f) {
                assert_int_equal(b[i].edge[k], SIM_SELF);
                assert_near(b[i].range[k], 0.3, 1e-6);
                own++;
            } else {
                assert_same_return(&b[i], &a[i], k);
            }
        }
    assert_true(own >= 40 * 14);
}

static int32_t beam_at(const sim_scan *scan, double degrees)
{
    return (int32_t)lround((degrees * pi / 180 - scan->angle_min) / scan->angle_step);
}

/* The mean direction of the returns of the trailer's body, from straight behind, rad. */
static double bend_of(const sim_scan *scan)
{
    double sum = 0;
    int32_t count = 0;

    for (int32_t k = 0; k < scan->count; k++) {
        double behind = remainder(scan->angle_min + k * scan->angle_step - pi, 2 * pi);

        if (scan->edge[k] != SIM_SELF || fabs(behind) > 1.6)
            continue;
        sum += behind;
        count++;
    }
    assert_true(count > 30);
    return sum / count;
}

/* Straight, after a turn of 60 degrees to the left, and after 6 m straight ahead from there. */
static void a_trailer_follows_the_robot(void **state)
{
    const sim_pose poses[] = {{-9, 0, 0}, {-9, 0, 1}, {-9, 0, 0}, {-3, 0, 0}};
    sim_arena *arena = turned_arena_of(SIM_CORRIDOR, 1, 0);
    sim_survey_options options = sim_survey_default();
    sim_survey *survey;
    const sim_scan *scans;
    int32_t count;

    (void)state;
    options.fov = 2 * pi;
    options.beams = 360;
    options.noise = 0;
    options.trailer = 1;
    survey = survey_at(arena, &options, poses, 4, 0, 0);
    assert_non_null(survey);
    scans = sim_survey_scans(survey, &count);
    assert_int_equal(count, 4);
    for (int32_t i = 0; i < count; i += 3) {
        /* The front of the body is 0.5 m behind the robot's centre; the poles are beside it. */
        double pole = atan2(0.5, 0.3) * 180 / pi;

        assert_int_equal(scans[i].edge[beam_at(&scans[i], -180)], SIM_SELF);
        assert_near(scans[i].range[beam_at(&scans[i], -180)], 0.5, i == 0 ? 1e-6 : 0.01);
        assert_int_equal(scans[i].edge[beam_at(&scans[i], pole)], SIM_SELF);
        assert_near(scans[i].range[beam_at(&scans[i], pole)], hypot(0.3, 0.5) - 0.03, 0.01);
        assert_near(bend_of(&scans[i]), 0, i == 0 ? 0.01 : 0.03);
    }
    /* A robot that turns to the left has its trailer, which stays, behind its right. */
    assert_true(bend_of(&scans[1]) < -0.2 || bend_of(&scans[1]) > 0.2);
    assert_true(scans[1].edge[beam_at(&scans[1], 20)] >= 0);
}

static void the_trailer_bends_to_the_side_of_the_last_curve(void **state)
{
    const sim_pose left[] = {{-9, 0, 0}, {-9, 0, 0.8}}, right[] = {{-9, 0, 0}, {-9, 0, -0.8}};
    sim_arena *arena = turned_arena_of(SIM_CORRIDOR, 1, 0);
    sim_survey_options options = sim_survey_default();
    double bend[2];

    (void)state;
    options.fov = 2 * pi;
    options.beams = 720;
    options.noise = 0;
    options.trailer = 1;
    for (int32_t side = 0; side < 2; side++) {
        sim_survey *survey = survey_at(arena, &options, side == 0 ? left : right, 2, 0, 0);
        int32_t count;

        assert_non_null(survey);
        bend[side] = bend_of(&sim_survey_scans(survey, &count)[1]);
    }
    /* The trailer keeps its direction: seen from the robot it turns the other way. */
    assert_true(bend[0] < -0.2);
    assert_near(bend[1], -bend[0], 0.02);
}

static void a_robot_with_the_sensor_ahead_stays_out_of_walls(void **state)
{
    sim_arena *arena = turned_arena_of(SIM_HOSPITAL, 4, 0);
    sim_survey_options options = sim_survey_default_for(SIM_HOSPITAL);
    const sim_scan *scans;
    int32_t count;

    (void)state;
    options.drive = 500;
    options.beams = 3;
    scans = scans_of(arena, &options, &count);
    for (int32_t i = 0; i < count; i++) {
        sim_point sensor = {scans[i].truth.x + 0.22 * cos(scans[i].truth.theta),
                            scans[i].truth.y + 0.22 * sin(scans[i].truth.theta)};

        assert_true(sim_arena_clearance(arena, sensor) > 0.03);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(there_are_many_doors_alike_and_every_seed_has_its_own,
                                  surveys_free),
        cmocka_unit_test_teardown(all_places_of_the_tour_can_be_reached, surveys_free),
        cmocka_unit_test_teardown(the_drive_is_long_and_seldom_comes_back, surveys_free),
        cmocka_unit_test_teardown(four_first_angles_follow_each_other, surveys_free),
        cmocka_unit_test_teardown(the_same_options_give_the_same_drive, surveys_free),
        cmocka_unit_test_teardown(a_tilted_scanner_sees_the_nearer_of_floor_and_wall, surveys_free),
        cmocka_unit_test_teardown(the_floor_is_met_on_several_stretches_of_5_to_15_m, surveys_free),
        cmocka_unit_test_teardown(ranges_to_the_floor_have_three_times_the_noise, surveys_free),
        cmocka_unit_test_teardown(legs_return_at_sixty_degrees_and_nothing_else_changes,
                                  surveys_free),
        cmocka_unit_test_teardown(a_trailer_follows_the_robot, surveys_free),
        cmocka_unit_test_teardown(the_trailer_bends_to_the_side_of_the_last_curve, surveys_free),
        cmocka_unit_test_teardown(a_robot_with_the_sensor_ahead_stays_out_of_walls, surveys_free),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
