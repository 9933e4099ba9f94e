/* The world of the long scenes, and scans of it. */
#include "src/base/build.h"

#include "tests/long.h"

static const cairn_vec2 STOP[LONG_STOPS] = {{1, 4},
                                            {2, 4},
                                            {2, CAIRN_REAL(1.75)},
                                            {6, CAIRN_REAL(1.75)},
                                            {10, CAIRN_REAL(1.75)},
                                            {10, 4},
                                            {6, 4},
                                            {2, 4},
                                            {1, 4}};

const cairn_real long_way = CAIRN_REAL(22.5);

static void add_wall(long_world *world, cairn_vec2 a, cairn_vec2 b)
{
    cairn_segment wall = {a, b};

    assert_true(world->count < LONG_WALLS);
    world->walls[world->count++] = wall;
}

void long_add_box(long_world *world, cairn_pose centre, cairn_real half_length,
                  cairn_real half_width)
{
    cairn_vec2 corner[4] = {{half_length, half_width},
                            {half_length, -half_width},
                            {-half_length, -half_width},
                            {-half_length, half_width}};

    for (int32_t k = 0; k < 4; k++)
        corner[k] = cairn_pose_point(centre, corner[k]);
    for (int32_t k = 0; k < 4; k++)
        add_wall(world, corner[k], corner[(k + 1) % 4]);
}

/* A wall 0.1 m thick between two points of one row or column. */
static void add_thick(long_world *world, double ax, double ay, double bx, double by)
{
    cairn_pose centre = {(cairn_real)((ax + bx) / 2), (cairn_real)((ay + by) / 2), 0};

    long_add_box(world, centre, (cairn_real)((bx - ax) / 2 + 0.0625),
                 (cairn_real)((by - ay) / 2 + 0.0625));
}

static cairn_real clearance(const long_world *world, cairn_vec2 p)
{
    cairn_real least = 100;

    for (int32_t i = 0; i < world->count; i++)
        least = cairn_min(least, cairn_segment_distance(world->walls[i], p));
    return least;
}

static cairn_real from_way(cairn_vec2 p)
{
    cairn_real least = 100;

    for (int32_t i = 0; i + 1 < LONG_STOPS; i++) {
        cairn_segment leg = {STOP[i], STOP[i + 1]};

        least = cairn_min(least, cairn_segment_distance(leg, p));
    }
    return least;
}

void long_build(long_world *world, uint64_t seed, int32_t boxes)
{
    static const cairn_vec2 outline[4] = {{0, 0}, {12, 0}, {12, 8}, {0, 8}};
    cairn_random random = cairn_random_seed(seed, 21);

    world->count = 0;
    for (int32_t k = 0; k < 4; k++)
        add_wall(world, outline[k], outline[(k + 1) % 4]);
    add_thick(world, 0, 3.25, 1.5, 3.25); /* below the hall, with doors */
    add_thick(world, 2.5, 3.25, 9.5, 3.25);
    add_thick(world, 10.5, 3.25, 12, 3.25);
    add_thick(world, 0, 4.75, 3, 4.75); /* above it */
    add_thick(world, 4, 4.75, 8, 4.75);
    add_thick(world, 9, 4.75, 12, 4.75);
    add_thick(world, 4, 0, 4, 1.25); /* between rooms */
    add_thick(world, 4, 2.25, 4, 3.25);
    add_thick(world, 8, 0, 8, 1.25);
    add_thick(world, 8, 2.25, 8, 3.25);
    add_thick(world, 5.5, 4.75, 5.5, 8);
    while (boxes > 0) {
        cairn_real x = cairn_random_uniform(&random, CAIRN_REAL(0.5), CAIRN_REAL(11.5));
        cairn_pose centre = {x, cairn_random_uniform(&random, CAIRN_REAL(0.5), CAIRN_REAL(7.5)), 0};
        cairn_vec2 at = {centre.x, centre.y};

        if (from_way(at) < CAIRN_REAL(0.7) || clearance(world, at) < CAIRN_REAL(0.35))
            continue;
        centre.theta = cairn_random_uniform(&random, -3, 3);
        x = cairn_random_uniform(&random, CAIRN_REAL(0.08), CAIRN_REAL(0.3));
        long_add_box(world, centre, x,
                     cairn_random_uniform(&random, CAIRN_REAL(0.08), CAIRN_REAL(0.3)));
        boxes--;
    }
}

cairn_pose long_on_the_way(cairn_real metres)
{
    cairn_pose pose = {STOP[0].x, STOP[0].y, 0};

    metres -= long_way * cairn_floor(metres / long_way);
    for (int32_t i = 0; i + 1 < LONG_STOPS; i++) {
        cairn_vec2 leg = cairn_vec2_sub(STOP[i + 1], STOP[i]);
        cairn_real length = cairn_vec2_norm(leg);

        if (metres < length || i + 2 == LONG_STOPS) {
            cairn_vec2 at = cairn_vec2_add(STOP[i], cairn_vec2_scale(leg, metres / length));

            pose.x = at.x;
            pose.y = at.y;
            pose.theta = cairn_atan2(leg.y, leg.x);
            break;
        }
        metres -= length;
    }
    return pose;
}

cairn_pose long_somewhere(const long_world *world, cairn_random *random)
{
    cairn_pose pose;
    cairn_vec2 at;

    do {
        at.x = cairn_random_uniform(random, 0, 12);
        at.y = cairn_random_uniform(random, 0, 8);
    } while (clearance(world, at) < CAIRN_REAL(0.35));
    pose.x = at.x;
    pose.y = at.y;
    pose.theta = cairn_random_uniform(random, -3, 3);
    return pose;
}

cairn_pose long_disturbed(cairn_random *random, cairn_pose pose, cairn_real metres,
                          cairn_real radians)
{
    pose.x += argument(random, metres, 0);
    pose.y += argument(random, metres, 0);
    pose.theta += argument(random, radians, 0);
    return pose;
}

/* Distance along a unit vector to the nearest wall seen from its free side; 9 when there is
 * none. */
static cairn_real cast(const long_world *world, cairn_pose pose, cairn_real c, cairn_real s)
{
    cairn_real nearest = 9;

    for (int32_t i = 0; i < world->count; i++) {
        cairn_real ax = world->walls[i].a.x - pose.x, ay = world->walls[i].a.y - pose.y;
        cairn_real dx = world->walls[i].b.x - world->walls[i].a.x,
                   dy = world->walls[i].b.y - world->walls[i].a.y;
        cairn_real cross = c * dy - s * dx, along = ax * dy - ay * dx, across = ax * s - ay * c;

        if (cross > 0 && along > 0 && along < nearest * cross && across >= 0 && across <= cross)
            nearest = along / cross;
    }
    return nearest;
}

void long_take_sweep(long_sweep *out, const long_world *world, cairn_random *random,
                     cairn_pose pose, int32_t beams, cairn_real view, cairn_real people)
{
    cairn_real step = view / (cairn_real)beams, first = -view / 2;
    int32_t person = 0;

    memset(&out->input, 0, sizeof out->input);
    for (int32_t i = 0; i < beams; i++) {
        cairn_real s, c, range, noise = cairn_random_normal(random) / 100;

        cairn_sincos(pose.theta + first + (cairn_real)i * step, &s, &c);
        range = cast(world, pose, c, s);
        person = person > 0 ? person - 1 : cairn_random_unit(random) < people / 10 ? 10 : 0;
        if (person > 0)
            range = cairn_min(range, CAIRN_REAL(1.25) + (cairn_real)(person % 5) / 20);
        out->range[i] = i % 60 == 59 ? 0 : (float)(range + noise);
    }
    out->input.range = out->range;
    out->input.count = beams;
    out->input.angle_min = (float)first;
    out->input.angle_step = (float)step;
    out->input.range_max = 8;
    out->input.range_sigma = 0.01F;
}

cairn_scan *long_new_scan(cairn_pool *pool)
{
    cairn_scan_params params = cairn_scan_default();
    cairn_scan *scan;

    params.max_beams = LONG_BEAMS;
    LONG_CREATE(pool, scan, &scan, &params);
    return scan;
}

cairn_scan_view long_fit(cairn_scan *scan, const long_sweep *sweep)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_scan_begin(scan, &sweep->input, NULL));
    assert_ok(cairn_scan_step(scan, &budget));
    return cairn_scan_read(scan);
}
