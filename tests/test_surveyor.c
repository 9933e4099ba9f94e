/* The surveyor of the firmware: the mapper in a loop of ticks gives the same poses as without the
 * loop. */
#include <math.h>

#include "firmware/surveyor.h"
#include "tests/test.h"

enum { SWEEPS = 12, BEAMS = 121, KEYFRAMES = 16, MEMORY = 4 * 1024 * 1024 };

static _Alignas(CAIRN_ALIGN) unsigned char memory[MEMORY];

/* A drive through a 4 x 3 m room with a niche, and slightly wrong odometry. */
typedef struct drive {
    float range[SWEEPS][BEAMS];
    robot_sweep sweep[SWEEPS];
    cairn_pose truth[SWEEPS];
} drive;

static cairn_real range_to_wall(cairn_vec2 at, cairn_real angle)
{
    static const cairn_vec2 corner[] = {
        {0, 0}, {4, 0}, {4, 3}, {3, 3}, {3, CAIRN_REAL(3.5)}, {2, CAIRN_REAL(3.5)}, {2, 3}, {0, 3}};
    enum { CORNERS = sizeof corner / sizeof *corner };
    cairn_vec2 along = {cairn_cos(angle), cairn_sin(angle)};
    cairn_real nearest = 100;

    for (int32_t i = 0; i < CORNERS; i++) {
        cairn_vec2 a = corner[i], wall = cairn_vec2_sub(corner[(i + 1) % CORNERS], a),
                   to = cairn_vec2_sub(a, at);
        cairn_real slope = cairn_vec2_cross(along, wall);
        cairn_real range = cairn_vec2_cross(to, wall) / slope,
                   share = cairn_vec2_cross(to, along) / slope;

        if (slope != 0 && range > 0 && share >= 0 && share <= 1)
            nearest = cairn_min(nearest, range);
    }
    return nearest;
}

static void make_drive(drive *d)
{
    cairn_random random = cairn_random_seed(5, 1);

    for (int32_t i = 0; i < SWEEPS; i++) {
        robot_sweep *sweep = &d->sweep[i];
        cairn_pose at = {1 + CAIRN_REAL(0.15) * (cairn_real)i, CAIRN_REAL(1.2),
                         CAIRN_REAL(0.1) * (cairn_real)i};
        cairn_vec2 from = {at.x, at.y};

        d->truth[i] = sweep->pose = at;
        sweep->pose.x += cairn_random_uniform(&random, -CAIRN_REAL(0.03), CAIRN_REAL(0.03));
        sweep->pose.theta += cairn_random_uniform(&random, -CAIRN_REAL(0.02), CAIRN_REAL(0.02));
        if (i == 0)
            sweep->pose = at;
        sweep->range = d->range[i];
        sweep->count = BEAMS;
        sweep->angle_min = -3.0f;
        sweep->angle_step = 0.05f;
        for (int32_t k = 0; k < BEAMS; k++)
            d->range[i][k] =
                (float)(range_to_wall(from, at.theta - 3 + CAIRN_REAL(0.05) * (cairn_real)k) +
                        cairn_random_uniform(&random, -CAIRN_REAL(0.01), CAIRN_REAL(0.01)));
    }
}

static surveyor_params room_params(void)
{
    surveyor_params params = {
        .range_max = 8, .range_sigma = 0.01f, .mapper = cairn_mapper_default_for(KEYFRAMES, BEAMS)};

    return params;
}

static surveyor made_surveyor(void)
{
    surveyor_params params = room_params();
    surveyor s;

    assert_int_equal(surveyor_create(&s, memory, sizeof memory, &params), CAIRN_OK);
    return s;
}

static void tick(surveyor *s, int32_t units, surveyor_work expected)
{
    cairn_budget budget = {units};
    surveyor_work work;

    assert_int_equal(surveyor_tick(s, &budget, &work), CAIRN_MORE);
    assert_int_equal(work, expected);
}

/* The whole drive, ticks of given units, each sweep when the one before is done or, early, as
 * soon as it can wait. */
static void fly(surveyor *s, const drive *d, int32_t units, int32_t early)
{
    int32_t next = 0;
    cairn_status status;

    do {
        cairn_budget budget = {units};
        surveyor_work work;

        if (next < SWEEPS && !s->queued && (early || !s->mapping)) {
            assert_int_equal(surveyor_offer(s, &d->sweep[next]), CAIRN_OK);
            if (++next == SWEEPS)
                surveyor_finish(s);
        }
        status = surveyor_tick(s, &budget, &work);
        assert_true(status >= 0);
        assert_true(s->ticks < 10000000);
    } while (status == CAIRN_MORE);
    assert_int_equal(s->taken, SWEEPS);
}

/* The mapper without the loop, in other memory. */
static uint32_t mapped_hash(const drive *d)
{
    surveyor_params params = room_params();
    void *other = test_malloc(MEMORY);
    surveyor s;
    uint32_t hash;

    assert_int_equal(surveyor_create(&s, other, MEMORY, &params), CAIRN_OK);
    for (int32_t i = 0; i < SWEEPS; i++) {
        const robot_sweep *sweep = &d->sweep[i];
        cairn_scan_input input = {.range = sweep->range,
                                  .count = sweep->count,
                                  .angle_min = sweep->angle_min,
                                  .angle_step = sweep->angle_step,
                                  .range_max = 8,
                                  .range_sigma = 0.01f};
        cairn_budget all = {INT32_MAX};

        assert_int_equal(cairn_mapper_add(s.mapper, &input, &sweep->pose, NULL), CAIRN_MORE);
        assert_int_equal(cairn_mapper_step(s.mapper, &all), CAIRN_OK);
        if (i == SWEEPS - 1)
            assert_int_equal(cairn_mapper_settle(s.mapper, &all), CAIRN_OK);
    }
    hash = surveyor_hash(&s, HASH_START);
    test_free(other);
    return hash;
}

static void ticks_do_not_change_the_map(void **state)
{
    static drive d;
    uint32_t expected;

    (void)state;
    make_drive(&d);
    expected = mapped_hash(&d);
    for (int32_t early = 0; early < 2; early++)
        for (int32_t units = 7; units <= 7000; units *= 10) {
            surveyor s = made_surveyor();

            fly(&s, &d, units, early);
            assert_int_equal(surveyor_hash(&s, HASH_START), expected);
        }
}

static void poses_are_right(void **state)
{
    static drive d;
    surveyor s = made_surveyor();

    (void)state;
    make_drive(&d);
    fly(&s, &d, 1000, 0);
    assert_int_equal(cairn_mapper_measure(s.mapper).predicted, 0);
    assert_near(cairn_mapper_read(s.mapper).map_scan.x, d.truth[SWEEPS - 1].x, 0.02);
    assert_near(cairn_mapper_read(s.mapper).map_scan.y, d.truth[SWEEPS - 1].y, 0.02);
    assert_near(cairn_mapper_read(s.mapper).map_scan.theta, d.truth[SWEEPS - 1].theta, 0.01);
}

static void one_sweep_may_wait(void **state)
{
    static drive d;
    surveyor s = made_surveyor();

    (void)state;
    make_drive(&d);
    tick(&s, 10, SURVEYOR_IDLE);
    assert_int_equal(surveyor_offer(&s, &d.sweep[0]), CAIRN_OK);
    tick(&s, 10, SURVEYOR_ADD);
    tick(&s, 10, SURVEYOR_MAP);
    assert_int_equal(surveyor_offer(&s, &d.sweep[1]), CAIRN_OK);
    assert_int_equal(surveyor_offer(&s, &d.sweep[2]), CAIRN_MORE);
    assert_ptr_equal(s.sweep.range, d.range[1]);
    assert_int_equal(s.taken, 1);
    while (s.mapping)
        tick(&s, 1000, SURVEYOR_MAP);
    tick(&s, 1000, SURVEYOR_ADD);
    assert_int_equal(s.taken, 2);
    assert_int_equal(surveyor_offer(&s, &d.sweep[2]), CAIRN_OK);
}

static void the_hash_is_of_result_and_keys(void **state)
{
    static drive d;
    surveyor s = made_surveyor();
    uint32_t empty = surveyor_hash(&s, HASH_START);

    (void)state;
    make_drive(&d);
    assert_int_not_equal(surveyor_hash(&s, HASH_START + 1), empty);
    fly(&s, &d, 1000, 0);
    assert_int_not_equal(surveyor_hash(&s, HASH_START), empty);
}

static void what_is_refused(void **state)
{
    surveyor_params params = room_params();
    static float nothing[BEAMS];
    robot_sweep bad = {nothing, BEAMS, 0, 0.05f, {(cairn_real)NAN, 0, 0}};
    cairn_budget budget = {1000};
    surveyor_work work;
    surveyor s;

    (void)state;
    assert_int_equal(surveyor_create(&s, memory, cairn_mapper_memory(&params.mapper) / 2, &params),
                     CAIRN_NO_MEMORY);
    assert_int_equal(surveyor_create(&s, NULL, MEMORY, &params), CAIRN_BAD_ARGUMENT);
    params.mapper.max_keyframes = 0;
    assert_int_equal(surveyor_create(&s, memory, MEMORY, &params), CAIRN_BAD_ARGUMENT);
    s = made_surveyor();
    assert_int_equal(surveyor_offer(&s, &bad), CAIRN_OK);
    assert_int_equal(surveyor_tick(&s, &budget, &work), CAIRN_NOT_FINITE);
    assert_int_equal(work, SURVEYOR_ADD);
    assert_int_equal(s.taken, 0);
    assert_int_equal(s.mapping, 0);
    tick(&s, 1000, SURVEYOR_IDLE);
}

/* To and fro in the room, lap after lap. */
enum { LAPS = 40, LAP = 24, FEW_KEYS = 36 };

typedef struct shuttle {
    float range[BEAMS];
    robot_sweep sweep;
    cairn_pose truth;
    cairn_random random;
} shuttle;

static void drive_on(shuttle *d, int32_t turn)
{
    int32_t at = turn % LAP < LAP / 2 ? turn % LAP : LAP - 1 - turn % LAP;
    cairn_pose next = {1 + CAIRN_REAL(0.15) * (cairn_real)at, CAIRN_REAL(1.2),
                       CAIRN_REAL(0.1) * (cairn_real)at},
               step;
    cairn_vec2 from = {next.x, next.y};

    step = cairn_pose_between(turn > 0 ? d->truth : next, next);
    step.x += cairn_random_uniform(&d->random, -CAIRN_REAL(0.02), CAIRN_REAL(0.02));
    step.theta += cairn_random_uniform(&d->random, -CAIRN_REAL(0.02), CAIRN_REAL(0.02));
    d->sweep.pose = turn > 0 ? cairn_pose_compose(d->sweep.pose, step) : next;
    d->truth = next;
    d->sweep.range = d->range;
    d->sweep.count = BEAMS;
    d->sweep.angle_min = -3.0f;
    d->sweep.angle_step = 0.05f;
    for (int32_t k = 0; k < BEAMS; k++)
        d->range[k] =
            (float)(range_to_wall(from, next.theta - 3 + CAIRN_REAL(0.05) * (cairn_real)k) +
                    cairn_random_uniform(&d->random, -CAIRN_REAL(0.01), CAIRN_REAL(0.01)));
}

/* The loop of the firmware, in fixed memory: no sweep is refused, and all laps are alike. */
static void it_runs_without_end(void **state)
{
    static shuttle d;
    surveyor_params params = room_params();
    /* units of the earlier and of the later laps in full memory */
    double off[LAPS] = {0}, sum[2] = {0, 0};
    int64_t units[LAPS] = {0};
    int32_t full = LAPS;
    surveyor s;

    (void)state;
    params.mapper = cairn_mapper_default_for(FEW_KEYS, BEAMS);
    params.mapper.cull_keyframes = 1;
    d.random = cairn_random_seed(7, 1);
    assert_int_equal(surveyor_create(&s, memory, sizeof memory, &params), CAIRN_OK);
    for (int32_t turn = 0; turn < LAPS * LAP; turn++) {
        size_t used = s.pool.used;
        cairn_pose found;

        drive_on(&d, turn);
        assert_int_equal(surveyor_offer(&s, &d.sweep), CAIRN_OK);
        while (s.queued || s.mapping) {
            cairn_budget budget = {1000};
            surveyor_work work;

            assert_int_equal(surveyor_tick(&s, &budget, &work), CAIRN_MORE);
            units[turn / LAP] += 1000 - budget.left;
        }
        found = cairn_mapper_read(s.mapper).map_scan;
        off[turn / LAP] +=
            hypot((double)(found.x - d.truth.x), (double)(found.y - d.truth.y)) / LAP;
        assert_int_equal(s.pool.used, used);
        assert_true(cairn_mapper_measure(s.mapper).keyframes < FEW_KEYS);
        if (full == LAPS && cairn_mapper_measure(s.mapper).culled_keyframes > 0)
            full = turn / LAP + 1;
    }
    assert_int_equal(s.taken, LAPS * LAP);
    assert_true(full < LAPS / 4);
    assert_true(cairn_mapper_measure(s.mapper).culled_keyframes > 3 * FEW_KEYS);
    for (int32_t lap = full; lap < LAPS; lap++) {
        assert_true(off[lap] < 0.02);
        sum[lap >= (full + LAPS) / 2] +=
            (double)units[lap] /
            (lap >= (full + LAPS) / 2 ? LAPS - (full + LAPS) / 2 : (full + LAPS) / 2 - full);
    }
    assert_near(sum[1] / sum[0], 1, 0.05);
    assert_true(off[LAPS - 1] < off[full] + 0.005);
}

static void a_full_map_stays(void **state)
{
    static drive d;
    surveyor_params params = room_params();
    int32_t refused = 0, next = 0;
    cairn_status status = CAIRN_MORE;
    surveyor s;

    (void)state;
    make_drive(&d);
    params.mapper.max_keyframes = 2;
    assert_int_equal(surveyor_create(&s, memory, sizeof memory, &params), CAIRN_OK);
    while (status != CAIRN_OK) {
        cairn_budget budget = {1000};
        surveyor_work work;

        if (next < SWEEPS && !s.queued) {
            assert_int_equal(surveyor_offer(&s, &d.sweep[next]), CAIRN_OK);
            if (++next == SWEEPS)
                surveyor_finish(&s);
        }
        status = surveyor_tick(&s, &budget, &work);
        refused += status == CAIRN_FULL;
        assert_true(status >= 0 || status == CAIRN_FULL);
    }
    assert_int_equal(cairn_mapper_measure(s.mapper).keyframes, 2);
    assert_int_equal(refused, SWEEPS - s.taken + 1);
    assert_true(s.taken > 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ticks_do_not_change_the_map),
        cmocka_unit_test(poses_are_right),
        cmocka_unit_test(one_sweep_may_wait),
        cmocka_unit_test(the_hash_is_of_result_and_keys),
        cmocka_unit_test(what_is_refused),
        cmocka_unit_test(it_runs_without_end),
        cmocka_unit_test(a_full_map_stays),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
