/* Simulated surveys: ranges compared with all edges, errors of the scanner, people, motion,
 * odometry, refusals. */
#include "tests/surveys.h"

static const double pi = 3.14159265358979323846;

static sim_pose compose(sim_pose a, sim_pose b)
{
    sim_pose c = {a.x + cos(a.theta) * b.x - sin(a.theta) * b.y,
                  a.y + sin(a.theta) * b.x + cos(a.theta) * b.y,
                  remainder(a.theta + b.theta, 2 * pi)};
    return c;
}

/* Reference implementation: distance along a ray to the nearest edge by intersecting all edges; 1e9
 * when there is none. */
static double cast(const sim_arena *arena, sim_pose from, double angle, int32_t *which)
{
    int32_t count, bodies;
    const sim_edge *edges = sim_arena_edges(arena, &count);
    const sim_body *body = sim_arena_bodies(arena, &bodies);
    double dx = cos(from.theta + angle), dy = sin(from.theta + angle), nearest = 1e9;

    *which = -1;
    for (int32_t i = 0; i < count; i++) {
        const sim_edge *e = &edges[i];
        double ax = e->a.x - from.x, ay = e->a.y - from.y, t;

        if (e->radius > 0) {
            double along = ax * dx + ay * dy, off = ax * dy - ay * dx,
                   half = e->radius * e->radius - off * off;

            if (half < 0)
                continue;
            t = along - sqrt(half);
        } else {
            double sx = e->b.x - e->a.x, sy = e->b.y - e->a.y, side = dx * sy - dy * sx, u;

            /* A pane returns beams near its normal alone. */
            if (dx * e->normal.x + dy * e->normal.y >=
                (body[e->body].kind == SIM_GLASS ? -cos(body[e->body].glass) : 0))
                continue;
            t = (ax * sy - ay * sx) / side;
            u = (ax * dy - ay * dx) / side;
            if (u < 0 || u > 1)
                continue;
        }
        if (t > 0 && t < nearest) {
            nearest = t;
            *which = i;
        }
    }
    return nearest;
}

static void test_ranges_against_reference(void **state)
{
    (void)state;
    for (sim_scene scene = 0; scene < SIM_SCENES; scene++) {
        sim_arena *arena = arena_of(scene, 4);
        sim_survey_options options = sim_survey_default();
        const sim_scan *scans;
        int32_t count, beams = 0, odd = 0, other_edge = 0, none = 0, edge_count;
        const sim_edge *edges = sim_arena_edges(arena, &edge_count);

        options.noise = 0;
        options.range_max = 5;
        scans = scans_of(arena, &options, &count);
        assert_int_equal(count, 4 * sim_scene_places(scene));
        for (int32_t i = 0; i < count; i++) {
            assert_int_equal(scans[i].count, 401);
            assert_near(scans[i].angle_min, -50 * pi / 180, 1e-12);
            assert_near(scans[i].angle_step, 0.25 * pi / 180, 1e-12);
            for (int32_t k = 0; k < scans[i].count; k++, beams++) {
                int32_t edge;
                double expected = cast(arena, scans[i].truth,
                                       scans[i].angle_min + k * scans[i].angle_step, &edge);
                double range = (double)scans[i].range[k];

                if (scans[i].edge[k] == SIM_NOTHING) {
                    none++;
                    assert_true(isinf(range) && range > 0);
                    odd += expected < 5 - 1e-4;
                    continue;
                }
                assert_in_range(scans[i].edge[k], 0, edge_count - 1);
                assert_true(range > 0.25 && range < 5);
                odd += fabs(range - expected) > 1e-4;
                if (scans[i].edge[k] != edge) {
                    /* The same point on another edge: where bodies cross. */
                    const sim_edge *e = &edges[scans[i].edge[k]];
                    double angle =
                        scans[i].truth.theta + scans[i].angle_min + k * scans[i].angle_step;
                    double x = scans[i].truth.x + range * cos(angle),
                           y = scans[i].truth.y + range * sin(angle);

                    other_edge++;
                    if (e->radius == 0 && fabs(range - expected) <= 1e-4)
                        assert_near((x - e->a.x) * e->normal.x + (y - e->a.y) * e->normal.y, 0,
                                    1e-4);
                }
            }
        }
        /* Beams that graze a corner may differ in float and double. */
        if (odd > beams / 5000 || other_edge > beams / 500)
            fail_msg("%s: %d ranges and %d edges differ of %d", sim_scene_name(scene), (int)odd,
                     (int)other_edge, (int)beams);
        if (scene == SIM_CORRIDOR || scene == SIM_HOSPITAL)
            assert_true(none > 100);
        else
            assert_true(none < beams / 3);
    }
}

static void test_places(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 3; seed++)
        for (sim_scene scene = 0; scene < SIM_SCENES; scene++) {
            sim_arena *arena = arena_of(scene, seed);
            sim_survey_options options = sim_survey_default();
            sim_survey *survey;
            const sim_scan *scans;
            const sim_point *places;
            int32_t count, place_count, group[200], merged, all;

            options.seed = seed;
            options.beams = 101;
            survey = survey_of(arena, &options);
            scans = sim_survey_scans(survey, &count);
            places = sim_survey_places(survey, &place_count);
            assert_int_equal(place_count, sim_scene_places(scene));
            assert_int_equal(sim_survey_options_of(survey).places, place_count);
            assert_ptr_equal(sim_survey_arena(survey), arena);
            for (int32_t i = 0; i < count; i++) {
                const sim_scan *s = &scans[i];
                sim_point p = {s->truth.x, s->truth.y};

                assert_int_equal(s->place, i / 4);
                assert_int_equal(s->heading, i % 4);
                assert_true(sim_arena_clearance(arena, p) >= 0.3 ||
                            hypot(p.x - places[i / 4].x, p.y - places[i / 4].y) == 0);
                assert_true(sim_arena_clearance(arena, p) > 0.22);
                assert_true(hypot(p.x - places[i / 4].x, p.y - places[i / 4].y) <= 0.075);
                if (i % 4) {
                    double turn =
                        remainder(s->truth.theta - scans[i - 1].truth.theta - pi / 2, 2 * pi);

                    assert_near(turn, 0, 5 * pi / 180);
                    assert_true(turn != 0);
                    assert_true(s->truth.x != scans[i - 1].truth.x);
                }
                assert_true(i == 0 || s->stamp_ns > scans[i - 1].stamp_ns);
                group[i] = i;
            }
            for (int32_t a = 0; a < place_count; a++)
                for (int32_t b = 0; b < a; b++)
                    assert_true(hypot(places[a].x - places[b].x, places[a].y - places[b].y) >=
                                0.299);
            /* All scans are connected by common edges, each seen by five beams of both; those of a
             * hospital are of places farther apart. */
            merged = scene != SIM_HOSPITAL;
            while (merged) {
                merged = 0;
                for (int32_t a = 0; a < count; a++)
                    for (int32_t b = 0; b < a; b++) {
                        int32_t shared = 0, low = group[a] < group[b] ? group[a] : group[b];

                        if (group[a] == group[b])
                            continue;
                        for (int32_t k = 0; k < 101; k++)
                            for (int32_t m = 0; m < 101; m++)
                                if (scans[a].edge[k] >= 0 && scans[a].edge[k] == scans[b].edge[m]) {
                                    shared++;
                                    break;
                                }
                        if (shared < 5)
                            continue;
                        group[a] = group[b] = low;
                        merged = 1;
                    }
            }
            all = 0;
            for (int32_t i = 0; i < count; i++)
                all += group[i] == 0;
            if (scene != SIM_HOSPITAL && all < count - 2)
                fail_msg("%s %d: only %d of %d scans hang together", sim_scene_name(scene),
                         (int)seed, (int)all, (int)count);
        }
}

static uint64_t hash_scans(const sim_survey *survey)
{
    uint64_t hash = TEST_HASH_START;
    int32_t count;
    const sim_scan *scans = sim_survey_scans(survey, &count);

    for (int32_t i = 0; i < count; i++) {
        hash = test_hash(hash, scans[i].range, (size_t)scans[i].count * sizeof(float));
        hash = test_hash(hash, scans[i].edge, (size_t)scans[i].count * sizeof(int32_t));
        hash = test_hash(hash, &scans[i].truth, sizeof scans[i].truth);
        hash = test_hash(hash, &scans[i].odometry, sizeof scans[i].odometry);
        hash = test_hash(hash, &scans[i].stamp_ns, sizeof scans[i].stamp_ns);
    }
    return hash;
}

static void test_same_options_same_scans(void **state)
{
    sim_arena *arena = arena_of(SIM_RESCUE, 8), *again_arena = arena_of(SIM_RESCUE, 8);
    sim_survey_options options = sim_survey_default();

    (void)state;
    options.places = 4;
    options.tilt = 0.1;
    options.dropout = 0.05;
    options.movers = 3;
    options.scan_time = 0.1;
    for (int32_t drive = 0; drive <= 30; drive += 30) {
        sim_survey *first, *again, *other;

        options.drive = drive;
        options.seed = 8;
        first = survey_of(arena, &options);
        again = survey_of(again_arena, &options);
        options.seed = 9;
        other = survey_of(arena, &options);
        assert_true(hash_scans(first) == hash_scans(again));
        assert_true(hash_scans(first) != hash_scans(other));
    }
}

/* Lost beams and glass take returns away and change no other beam; glass is always the same walls
 * and pieces of furniture, never rubble. */
static void test_lost_beams_and_glass(void **state)
{
    sim_arena *arena = arena_of(SIM_RESCUE, 3);
    sim_survey_options options = sim_survey_default();
    int32_t count, bodies, edge_count, lost = 0, hits = 0, behind_glass = 0;
    const sim_body *body = sim_arena_bodies(arena, &bodies);
    const sim_scan *a = scans_of(arena, &options, &count), *b, *c;
    const sim_edge *edges = sim_arena_edges(arena, &edge_count);
    uint8_t *seen = calloc((size_t)bodies, 1), *unseen = calloc((size_t)bodies, 1);

    (void)state;
    options.lost = 0.1;
    b = scans_of(arena, &options, &count);
    options.lost = 0;
    options.glass = 0.3;
    c = scans_of(arena, &options, &count);
    for (int32_t i = 0; i < count; i++)
        for (int32_t k = 0; k < a[i].count; k++) {
            int32_t is_hit = a[i].edge[k] >= 0;
            int32_t of = is_hit ? edges[a[i].edge[k]].body : -1;

            hits += is_hit;
            if (b[i].edge[k] == a[i].edge[k]) {
                assert_memory_equal(&b[i].range[k], &a[i].range[k], sizeof(float));
            } else {
                lost++;
                assert_int_equal(b[i].edge[k], SIM_NOTHING);
                assert_true(isinf(b[i].range[k]));
            }
            if (!is_hit)
                continue;
            if (c[i].edge[k] == a[i].edge[k]) {
                seen[of] = 1;
            } else {
                unseen[of] = 1;
                behind_glass++;
                assert_true(isinf(c[i].range[k]));
                assert_true(body[of].kind == SIM_WALL || body[of].kind == SIM_FURNITURE);
            }
        }
    assert_near((double)lost / hits, 0.1, 0.01);
    assert_true(behind_glass > hits / 20);
    for (int32_t i = 0; i < bodies; i++)
        assert_false(seen[i] && unseen[i]);
    free(seen);
    free(unseen);
}

/* Errors of the scanner do not move the robot, and do not affect each other. Their shares and sizes
 * are as requested. */
static void test_noise_and_dropouts(void **state)
{
    sim_arena *arena = arena_of(SIM_RESCUE, 3);
    sim_survey_options options = sim_survey_default();
    const sim_scan *a, *b, *c;
    int32_t count, hits = 0, far = 0, very_far = 0, lost = 0, beams = 0;
    double sum = 0, squares = 0, neighbours = 0, last = 0;

    (void)state;
    options.noise = 0;
    a = scans_of(arena, &options, &count);
    options.noise = 0.02;
    b = scans_of(arena, &options, &count);
    options.dropout = 0.15;
    c = scans_of(arena, &options, &count);
    for (int32_t i = 0; i < count; i++) {
        assert_memory_equal(&a[i].truth, &b[i].truth, sizeof a[i].truth);
        assert_memory_equal(&a[i].odometry, &c[i].odometry, sizeof a[i].odometry);
        assert_near(b[i].range_sigma, 0.02, 0);
        for (int32_t k = 0; k < a[i].count; k++, beams++) {
            double error = (double)b[i].range[k] - (double)a[i].range[k];

            if (c[i].edge[k] == SIM_DROPPED) {
                assert_true(isnan(c[i].range[k]));
                lost++;
            } else {
                assert_same_return(&c[i], &b[i], k);
            }
            if (!(a[i].range[k] < 7.8f && b[i].range[k] < 8))
                continue;
            assert_int_equal(a[i].edge[k], b[i].edge[k]);
            hits++;
            sum += error;
            squares += error * error;
            neighbours += error * last;
            last = error;
            far += fabs(error) > 0.02;
            very_far += fabs(error) > 0.06;
        }
    }
    assert_true(hits > 20000);
    assert_near(sum / hits, 0, 4 * 0.02 / sqrt(hits));
    assert_near(sqrt(squares / hits), 0.02, 0.0004);
    assert_near(neighbours / squares, 0, 4 / sqrt(hits));
    assert_near((double)far / hits, 0.3173, 0.013);
    assert_near((double)very_far / hits, 0.0027, 0.0015);
    assert_near((double)lost / beams, 0.15, 0.01);
}

/* Tilted scans see the floor in one interval, short of the walls, along d / cos: 1/r is a cosine of
 * the bearing. */
static void test_tilt(void **state)
{
    sim_arena *arena = arena_of(SIM_RESCUE, 3);
    sim_survey_options options = sim_survey_default();
    sim_survey *tilted;
    const sim_scan *a, *b;
    int32_t count, floor = 0, beams = 0, scans_tilted = 0;

    (void)state;
    options.noise = 0;
    options.places = 40;
    a = scans_of(arena, &options, &count);
    options.tilt = 0.12;
    tilted = survey_of(arena, &options);
    b = sim_survey_scans(tilted, &count);
    for (int32_t i = 0; i < count; i++) {
        int32_t runs = 0, here = 0;

        assert_int_equal(a[i].tilted, 0);
        for (int32_t k = 0; k < a[i].count; k++, beams++) {
            if (b[i].edge[k] != SIM_FLOOR) {
                assert_memory_equal(&a[i].range[k], &b[i].range[k], sizeof(float));
                continue;
            }
            here++;
            runs += k == 0 || b[i].edge[k - 1] != SIM_FLOOR;
            assert_true(b[i].range[k] < 0.91f * a[i].range[k]);
            if (k > 0 && k + 1 < a[i].count && b[i].edge[k - 1] == SIM_FLOOR &&
                b[i].edge[k + 1] == SIM_FLOOR)
                assert_near(1 / (double)b[i].range[k - 1] + 1 / (double)b[i].range[k + 1],
                            2 * cos(a[i].angle_step) / (double)b[i].range[k], 1e-5);
        }
        assert_int_equal(runs, here > 0);
        assert_int_equal(b[i].tilted, here > 0);
        scans_tilted += here > 0;
        floor += here;
    }
    assert_near((double)floor / beams, 0.12, 0.025);
    assert_near((double)scans_tilted / count, 0.36, 0.12);
}

/* People hide a share of every scan, and nothing else changes. */
static void test_dense_cluster(void **state)
{
    sim_arena *arena = arena_of(SIM_ROOMS, 3);
    sim_survey_options options = sim_survey_default();
    const sim_scan *a, *b;
    int32_t count, hidden = 0, beams = 0, right = 0;

    (void)state;
    options.noise = 0;
    a = scans_of(arena, &options, &count);
    options.crowd = 0.2;
    b = scans_of(arena, &options, &count);
    for (int32_t i = 0; i < count; i++) {
        int32_t here = 0;

        assert_memory_equal(&a[i].truth, &b[i].truth, sizeof a[i].truth);
        for (int32_t k = 0; k < a[i].count; k++, beams++) {
            if (b[i].edge[k] == SIM_MOVER) {
                assert_true(b[i].range[k] < a[i].range[k]);
                assert_true(b[i].range[k] > 0.5f && b[i].range[k] < 4.1f);
                here++;
            } else {
                assert_memory_equal(&b[i].range[k], &a[i].range[k], sizeof(float));
            }
        }
        assert_true(here <= 0.25 * a[i].count + 1);
        right += here >= 0.2 * a[i].count - 1;
        hidden += here;
    }
    assert_true(right > 0.8 * count);
    assert_near((double)hidden / beams, 0.21, 0.03);
}

static void test_movers(void **state)
{
    sim_arena *arena = arena_of(SIM_ROOMS, 3);
    sim_survey_options options = sim_survey_default();
    const sim_scan *a, *b;
    int32_t count, seen = 0, with = 0, beams = 0, apart = 0;

    (void)state;
    options.noise = 0;
    options.fov = 2 * pi;
    options.beams = 360;
    options.headings = 8;
    options.jitter_position = 0;
    a = scans_of(arena, &options, &count);
    options.movers = 5;
    b = scans_of(arena, &options, &count);
    for (int32_t i = 0; i < count; i++) {
        int32_t here = 0;

        assert_near(a[i].angle_step, pi / 180, 1e-12);
        assert_memory_equal(&a[i].truth, &b[i].truth, sizeof a[i].truth);
        for (int32_t k = 0; k < a[i].count; k++, beams++) {
            assert_true(a[i].edge[k] >= 0 || a[i].edge[k] == SIM_NOTHING);
            if (b[i].edge[k] == SIM_MOVER) {
                assert_true(b[i].range[k] < a[i].range[k]);
                assert_true(b[i].range[k] > 0.3f);
                here++;
                /* They walk: the last scan of a place differs. */
                if (i > 0 && b[i].place == b[i - 1].place) {
                    double bearing = b[i].truth.theta - b[i - 1].truth.theta;
                    int32_t before = (k + (int32_t)lround(bearing * 180 / pi) + 720) % 360;

                    apart += b[i - 1].edge[before] != SIM_MOVER;
                }
            } else {
                assert_memory_equal(&b[i].range[k], &a[i].range[k], sizeof(float));
            }
        }
        seen += here;
        with += here > 0;
    }
    assert_true(seen > beams / 200 && seen < beams / 4);
    assert_true(with > count / 4);
    assert_true(apart > seen / 4);
}

/* Beams of a moving sensor: each from its own pose. */
static void test_sweep_motion(void **state)
{
    sim_arena *arena = arena_of(SIM_RESCUE, 5);
    sim_survey_options options = sim_survey_default();
    sim_survey *places, *still, *moving;
    const sim_scan *scans, *s;
    sim_pose poses[15], sensor = {0.1, 0.05, 0.3};
    int32_t count, odd = 0, edge, differ = 0;
    double speed = 0.5, turn_rate = 1, time = 0.1;

    (void)state;
    options.headings = 1;
    places = survey_of(arena, &options);
    scans = sim_survey_scans(places, &count);
    assert_int_equal(count, 15);
    for (int32_t i = 0; i < count; i++)
        poses[i] = scans[i].truth;
    options.noise = 0;
    options.fov = 1.5 * pi;
    options.beams = 271;
    options.base_sensor = sensor;
    still = survey_at(arena, &options, poses, count, 0, 0);
    options.scan_time = time;
    moving = survey_at(arena, &options, poses, count, speed, turn_rate);
    s = sim_survey_scans(moving, &count);
    assert_int_equal(count, 15);
    for (int32_t i = 0; i < count; i++) {
        const sim_scan *fixed = &sim_survey_scans(still, &count)[i];
        cairn_scan_input input = sim_scan_input(&s[i]);

        assert_memory_equal(&s[i].truth, &poses[i], sizeof poses[i]);
        assert_near(fixed->motion.x, 0, 0);
        assert_near(fixed->motion.theta, 0, 0);
        assert_near(s[i].motion.theta, 0.1, 1e-9);
        assert_near(s[i].motion.x, speed / turn_rate * sin(0.1), 1e-9);
        assert_near(s[i].motion.y, speed / turn_rate * (1 - cos(0.1)), 1e-9);
        assert_near(s[i].speed, 0.5, 0);
        assert_near(s[i].turn_rate, 1, 0);
        assert_near(s[i].odometry_motion.theta, 0.1, 0.003);
        assert_true(s[i].odometry_motion.theta != s[i].motion.theta);
        for (int32_t k = 0; k < s[i].count; k++) {
            double t = time * k / (s[i].count - 1), angle = s[i].angle_min + k * s[i].angle_step;
            sim_pose moved = {speed / turn_rate * sin(turn_rate * t),
                              speed / turn_rate * (1 - cos(turn_rate * t)), turn_rate * t};
            double expected = cast(arena, compose(compose(poses[i], moved), sensor), angle, &edge);

            if (expected < 8)
                odd += !(fabs(expected - (double)s[i].range[k]) < 1e-4);
            differ += s[i].range[k] != fixed->range[k];
            expected = cast(arena, compose(poses[i], sensor), angle, &edge);
            if (expected < 8)
                odd += !(fabs(expected - (double)fixed->range[k]) < 1e-4);
        }
        assert_ptr_equal(input.range, s[i].range);
        assert_null(input.angle);
        assert_int_equal(input.count, 271);
        assert_near(input.angle_min, -0.75 * pi, 1e-6);
        assert_near(input.angle_step, pi / 180, 1e-8);
        assert_near(input.range_min, 0.05, 1e-7);
        assert_near(input.range_max, 8, 0);
        assert_near(input.range_sigma, 0, 0);
        assert_true(input.stamp_ns == s[i].stamp_ns);
        assert_near(input.base_sensor.x, 0.1, 1e-7);
        assert_near(input.base_sensor.y, 0.05, 1e-7);
        assert_near(input.base_sensor.theta, 0.3, 1e-7);
        assert_near(input.motion.x, s[i].motion.x, 1e-8);
        assert_near(input.motion.y, s[i].motion.y, 1e-8);
        assert_near(input.motion.theta, 0.1, 1e-7);
    }
    assert_true(odd <= 6);
    assert_true(differ > 15 * 250);
}

/* Scans at places that take time: bounded motion; the sensor, not the base, is at the place. */
static void test_sweeps_at_places(void **state)
{
    sim_arena *arena = arena_of(SIM_APARTMENT, 5);
    sim_survey_options options = sim_survey_default();
    sim_pose sensor = {0.1, 0, pi / 2};
    sim_survey *survey;
    const sim_scan *scans;
    const sim_point *places;
    int32_t count, moved = 0;

    (void)state;
    options.scan_time = 1;
    options.base_sensor = sensor;
    survey = survey_of(arena, &options);
    scans = sim_survey_scans(survey, &count);
    places = sim_survey_places(survey, &count);
    (void)sim_survey_scans(survey, &count);
    for (int32_t i = 0; i < count; i++) {
        sim_pose at = compose(scans[i].truth, sensor);
        double way = hypot(scans[i].motion.x, scans[i].motion.y);

        assert_true(hypot(at.x - places[i / 4].x, at.y - places[i / 4].y) < 0.0751);
        assert_true(way <= 0.2 + 1e-6 && fabs(scans[i].motion.theta) <= 1);
        moved += way > 0.05 && fabs(scans[i].motion.theta) > 0.1;
    }
    assert_true(moved > count / 2);
}

static void test_odometry(void **state)
{
    sim_arena *arena = arena_of(SIM_OFFICE, 2);
    sim_survey_options options = sim_survey_default();
    sim_survey *survey;
    const sim_scan *scans;
    int32_t count;
    double drift = 0;

    (void)state;
    options.scan_time = 0.2;
    survey = survey_of(arena, &options);
    scans = sim_survey_scans(survey, &count);
    assert_memory_equal(&scans[0].odometry, &scans[0].truth, sizeof scans[0].truth);
    for (int32_t i = 1; i < count; i++) {
        double off =
            hypot(scans[i].odometry.x - scans[i].truth.x, scans[i].odometry.y - scans[i].truth.y);

        assert_true(off > 0 && off < 12);
        drift = off > drift ? off : drift;
        if (scans[i].place == scans[i - 1].place) /* from scan to scan it is good */
            assert_near(remainder(scans[i].odometry.theta - scans[i - 1].odometry.theta -
                                      scans[i].truth.theta + scans[i - 1].truth.theta,
                                  2 * pi),
                        0, 0.2);
    }
    assert_true(drift > 0.1);

    options.slip_distance = options.slip_turn = options.slip_drift = options.bias_scale =
        options.bias_drift = 0;
    survey = survey_of(arena, &options);
    scans = sim_survey_scans(survey, &count);
    for (int32_t i = 0; i < count; i++) {
        assert_near(scans[i].odometry.x, scans[i].truth.x, 1e-9);
        assert_near(scans[i].odometry.y, scans[i].truth.y, 1e-9);
        assert_near(remainder(scans[i].odometry.theta - scans[i].truth.theta, 2 * pi), 0, 1e-9);
        assert_near(scans[i].odometry_motion.x, scans[i].motion.x, 1e-9);
    }
}

static void test_drive(void **state)
{
    int32_t bumps = 0;

    (void)state;
    for (sim_scene scene = 0; scene < SIM_SCENES; scene++) {
        sim_arena *arena = arena_of(scene, 1);
        sim_survey_options options = sim_survey_default();
        sim_survey *survey;
        const sim_scan *scans;
        const sim_pose *path;
        int32_t count, steps;
        double way = 0, off = 0;

        options.drive = 150;
        options.scan_time = 0.1;
        options.movers = scene == SIM_OFFICE ? 6 : 0;
        survey = survey_of(arena, &options);
        scans = sim_survey_scans(survey, &count);
        path = sim_survey_path(survey, &steps);
        assert_int_equal(count, 150);
        for (int32_t i = 0; i < steps; i++) {
            sim_point p = {path[i].x, path[i].y};

            assert_true(sim_arena_clearance(arena, p) > 0.19);
            assert_true(i == 0 || hypot(p.x - path[i - 1].x, p.y - path[i - 1].y) < 0.15);
        }
        for (int32_t i = 0; i < count; i++) {
            assert_int_equal(scans[i].place, -1);
            assert_true(fabs(scans[i].motion.theta) < 0.3);
            assert_true(hypot(scans[i].motion.x, scans[i].motion.y) < 0.09);
            off = hypot(scans[i].truth.x - scans[i].odometry.x,
                        scans[i].truth.y - scans[i].odometry.y);
            if (i == 0)
                continue;
            way += hypot(scans[i].truth.x - scans[i - 1].truth.x,
                         scans[i].truth.y - scans[i - 1].truth.y);
            assert_true(hypot(scans[i].truth.x - scans[i - 1].truth.x,
                              scans[i].truth.y - scans[i - 1].truth.y) < 0.48);
            assert_true(fabs(remainder(scans[i].truth.theta - scans[i - 1].truth.theta, 2 * pi)) <
                        0.65);
            assert_true(scans[i].stamp_ns > scans[i - 1].stamp_ns + 100000000);
        }
        assert_true(way > 20);
        assert_true(off > 0.01 && off < 10);
        bumps += sim_survey_bumps(survey);
    }
    assert_in_range(bumps, 3, 200);
}

/* Without slip and bias a drive without collisions has true odometry. */
static void test_drive_without_slip(void **state)
{
    sim_arena *arena = arena_of(SIM_CORRIDOR, 1);
    sim_survey_options options = sim_survey_default();
    sim_survey *survey;
    const sim_scan *scans;
    int32_t count;

    (void)state;
    options.drive = 60;
    options.slip_distance = options.slip_turn = options.slip_drift = options.bias_scale =
        options.bias_drift = 0;
    survey = survey_of(arena, &options);
    scans = sim_survey_scans(survey, &count);
    assert_int_equal(sim_survey_bumps(survey), 0);
    assert_near(scans[59].odometry.x, scans[59].truth.x, 0.05);
    assert_near(scans[59].odometry.y, scans[59].truth.y, 0.05);
}

/* Scene `rooms`: five places; none sees more than three sides of the lower right room, together
 * they see all of three. */
static void test_rooms_scene(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 5; seed++) {
        sim_survey_options options = sim_survey_default();
        sim_arena *arena;
        const sim_scan *scans;
        const sim_edge *edges;
        int32_t count, edge_count, most = 0;

        arena = turned_arena_of(SIM_ROOMS, seed, 0);
        edges = sim_arena_edges(arena, &edge_count);
        options.fov = 2 * pi;
        options.beams = 720;
        options.headings = 1;
        options.noise = 0;
        options.seed = seed;
        scans = scans_of(arena, &options, &count);
        assert_int_equal(count, 5);
        for (int32_t i = 0; i < count; i++) {
            int32_t sides[4] = {0};

            for (int32_t k = 0; k < scans[i].count; k++) {
                double angle = scans[i].truth.theta + scans[i].angle_min + k * scans[i].angle_step;
                double r = (double)scans[i].range[k];
                double x = scans[i].truth.x + r * cos(angle), y = scans[i].truth.y + r * sin(angle);
                const sim_edge *e;

                /* Inside the lower right room: y below the hallway's lower wall, x right of the
                 * dividing wall. */
                if (scans[i].edge[k] < 0 || !(y < -0.9 - 0.0499) || !(x > -0.04 * 12 - 0.01))
                    continue;
                e = &edges[scans[i].edge[k]];
                if (fabs(e->normal.x) > 0.5 && fabs(e->a.y - e->b.y) > 2)
                    sides[e->normal.x > 0 ? (x < 2 ? 0 : 3) : (x > 5.5 ? 1 : 3)]++;
                else if (e->normal.y > 0.5 && y < -4)
                    sides[2]++;
                else if (e->normal.y < -0.5)
                    sides[3] += fabs(e->a.x - e->b.x) > 0.5;
            }
            if (i < 4)
                continue;
            for (int32_t side = 0; side < 3; side++)
                most += sides[side] > 5;
            assert_int_equal(sides[3], 0); /* the side with the door */
        }
        assert_int_equal(most, 3);
    }
}

static void test_disturb(void **state)
{
    sim_arena *arena = arena_of(SIM_RESCUE, 1);
    sim_survey_options options = sim_survey_default();
    sim_survey *survey;
    const sim_scan *scans;
    sim_pose poses[60], again[60], other[60];
    double most_x = 0, most_y = 0, most_turn = 0, sum = 0;
    int32_t count;

    (void)state;
    survey = survey_of(arena, &options);
    scans = sim_survey_scans(survey, &count);
    assert_int_equal(count, 60);
    sim_survey_disturb(survey, 3, 0.3, 0.35, poses);
    sim_survey_disturb(survey, 3, 0.3, 0.35, again);
    sim_survey_disturb(survey, 4, 0.3, 0.35, other);
    assert_memory_equal(poses, again, sizeof poses);
    assert_memory_not_equal(poses, other, sizeof poses);
    for (int32_t i = 0; i < count; i++) {
        most_x = fmax(most_x, fabs(poses[i].x - scans[i].truth.x));
        most_y = fmax(most_y, fabs(poses[i].y - scans[i].truth.y));
        most_turn = fmax(most_turn, fabs(remainder(poses[i].theta - scans[i].truth.theta, 2 * pi)));
        sum += poses[i].x - scans[i].truth.x;
    }
    assert_true(most_x > 0.25 && most_x <= 0.3 && most_y > 0.25 && most_y <= 0.3);
    assert_true(most_turn > 0.3 && most_turn <= 0.35);
    assert_near(sum / count, 0, 0.09);
}

static void expect_fault(const sim_arena *arena, sim_survey_options options, const char *what)
{
    char fault[200] = "";

    assert_null(sim_survey_create(arena, &options, fault, sizeof fault));
    assert_ptr_equal(strstr(fault, what), fault);
    assert_non_null(strstr(fault, ", expected "));
    assert_null(sim_survey_create(arena, &options, NULL, 0));
}

static void test_bad_options(void **state)
{
    sim_arena *arena = arena_of(SIM_CORRIDOR, 1);
    sim_survey_options good = sim_survey_default(), bad;
    sim_pose pose = {0, 0, 0};
    char fault[200] = "";
    const struct {
        size_t offset;
        double value;
        const char *what;
    } numbers[] = {
        {offsetof(sim_survey_options, jitter_position), 1.1, "jitter_position is 1.1 m"},
        {offsetof(sim_survey_options, jitter_heading), -1, "jitter_heading is -1 rad"},
        {offsetof(sim_survey_options, crowd), 0.6, "crowd is 0.6"},
        {offsetof(sim_survey_options, drive_distance), 0, "drive_distance is 0 m"},
        {offsetof(sim_survey_options, drive_turn), 0, "drive_turn is 0 rad"},
        {offsetof(sim_survey_options, fov), 0, "fov is 0 rad"},
        {offsetof(sim_survey_options, fov), 6.3, "fov is 6.3 rad"},
        {offsetof(sim_survey_options, range_min), -0.1, "range_min is -0.1 m"},
        {offsetof(sim_survey_options, range_max), 0.5, "range_max is 0.5 m"},
        {offsetof(sim_survey_options, noise), -0.01, "noise is -0.01 m"},
        {offsetof(sim_survey_options, noise), (double)NAN, "noise is nan m"},
        {offsetof(sim_survey_options, dropout), 1.5, "dropout is 1.5"},
        {offsetof(sim_survey_options, lost), 1.5, "lost is 1.5"},
        {offsetof(sim_survey_options, glass), -0.1, "glass is -0.1"},
        {offsetof(sim_survey_options, tilt), 0.31, "tilt is 0.31"},
        {offsetof(sim_survey_options, ground), 0.5, "ground is 0.5 m, expected 1 to 50"},
        {offsetof(sim_survey_options, ground), 51, "ground is 51 m"},
        {offsetof(sim_survey_options, ground), (double)NAN, "ground is nan m"},
        {offsetof(sim_survey_options, scan_time), 3, "scan_time is 3 s"},
        {offsetof(sim_survey_options, sweep_speed), 6, "sweep_speed is 6 m/s"},
        {offsetof(sim_survey_options, sweep_turn), 21, "sweep_turn is 21 rad/s"},
        {offsetof(sim_survey_options, slip_distance), 2, "slip_distance is 2"},
        {offsetof(sim_survey_options, slip_turn), 2, "slip_turn is 2"},
        {offsetof(sim_survey_options, slip_drift), 2, "slip_drift is 2"},
        {offsetof(sim_survey_options, bias_scale), 2, "bias_scale is 2"},
        {offsetof(sim_survey_options, bias_drift), 2, "bias_drift is 2"},
        {offsetof(sim_survey_options, base_sensor.x), 0.26, "base_sensor is 0.26 m"},
        {offsetof(sim_survey_options, base_sensor.theta), (double)INFINITY,
         "base_sensor.theta is inf"},
    };
    const struct {
        size_t offset;
        int32_t value;
        const char *what;
    } counts[] = {
        {offsetof(sim_survey_options, places), -1, "places is -1"},
        {offsetof(sim_survey_options, headings), 0, "headings is 0"},
        {offsetof(sim_survey_options, drive), -1, "drive is -1"},
        {offsetof(sim_survey_options, beams), 1, "beams is 1"},
        {offsetof(sim_survey_options, movers), 101, "movers is 101"},
        {offsetof(sim_survey_options, start_angles), 0, "start_angles is 0, expected 1 to 64"},
        {offsetof(sim_survey_options, legs), 2, "legs is 2, expected 0 to 1"},
        {offsetof(sim_survey_options, trailer), -1, "trailer is -1, expected 0 to 1"},
        {offsetof(sim_survey_options, places), 1000, "places is 1000, expected at most "},
    };

    (void)state;
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        bad = good;
        memcpy((char *)&bad + numbers[i].offset, &numbers[i].value, sizeof(double));
        expect_fault(arena, bad, numbers[i].what);
    }
    for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++) {
        bad = good;
        memcpy((char *)&bad + counts[i].offset, &counts[i].value, sizeof(int32_t));
        expect_fault(arena, bad, counts[i].what);
    }
    bad = good;
    bad.beams = 0;
    assert_null(sim_survey_at(arena, &bad, &pose, 1, 0, 0, fault, sizeof fault));
    assert_ptr_equal(strstr(fault, "beams is 0"), fault);
    assert_null(sim_survey_at(arena, &good, &pose, 1, 6, 0, fault, sizeof fault));
    assert_ptr_equal(strstr(fault, "speed is 6 m/s"), fault);
    assert_null(sim_survey_at(arena, &good, &pose, 1, 0, (double)NAN, fault, sizeof fault));
    assert_ptr_equal(strstr(fault, "turn_rate"), fault);
    pose.x = cos(sim_arena_options_of(arena).turn + pi / 2);
    pose.y = sin(sim_arena_options_of(arena).turn + pi / 2);
    assert_null(sim_survey_at(arena, &good, &pose, 1, 0, 0, fault, sizeof fault));
    assert_string_equal(fault, "pose 0 is inside a body, expected free space");
    assert_null(sim_survey_at(arena, &good, &pose, 1, 0, 0, NULL, 0));
    sim_survey_free(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_ranges_against_reference, surveys_free),
        cmocka_unit_test_teardown(test_places, surveys_free),
        cmocka_unit_test_teardown(test_same_options_same_scans, surveys_free),
        cmocka_unit_test_teardown(test_noise_and_dropouts, surveys_free),
        cmocka_unit_test_teardown(test_lost_beams_and_glass, surveys_free),
        cmocka_unit_test_teardown(test_tilt, surveys_free),
        cmocka_unit_test_teardown(test_movers, surveys_free),
        cmocka_unit_test_teardown(test_dense_cluster, surveys_free),
        cmocka_unit_test_teardown(test_sweep_motion, surveys_free),
        cmocka_unit_test_teardown(test_sweeps_at_places, surveys_free),
        cmocka_unit_test_teardown(test_odometry, surveys_free),
        cmocka_unit_test_teardown(test_drive, surveys_free),
        cmocka_unit_test_teardown(test_drive_without_slip, surveys_free),
        cmocka_unit_test_teardown(test_rooms_scene, surveys_free),
        cmocka_unit_test_teardown(test_disturb, surveys_free),
        cmocka_unit_test_teardown(test_bad_options, surveys_free),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
