/* Loop closures: drives through buildings that return to earlier places. */
#include "tests/drive.h"

#include <math.h>

#include "src/maps/mapper_work.h"

enum { SCANS = 400, EVENTS = 4096 };

/* What became of a drive. */
typedef struct outcome {
    cairn_pose poses[SCANS];
    cairn_mapper_loop events[EVENTS];
    cairn_mapper_state state;
    int32_t keyframe_scan[SCANS]; /* index of the scan of a keyframe */
    int32_t pending[SCANS];       /* keyframes whose loops are not closed after a scan */
} outcome;

static outcome one, two;

/* Records the loop-closure events since the last call. */
static void drain(const cairn_mapper *mapper, int32_t *events, outcome *out)
{
    int32_t now = cairn_mapper_measure(mapper).loop_events;

    assert_true(now - *events <= 64 && now <= EVENTS);
    for (; *events < now; (*events)++)
        out->events[*events] = cairn_mapper_loop_at(mapper, *events);
}

static cairn_pose drifted[SCANS];

/* Odometry of which every step turns by `bias` rad too much. */
static void drift_odometry(const drive *d, cairn_real bias)
{
    drifted[0] = pose_of(d->scans[0].truth);
    for (int32_t i = 1; i < d->count; i++) {
        cairn_pose step =
            cairn_pose_between(pose_of(d->scans[i - 1].truth), pose_of(d->scans[i].truth));

        step.theta += bias;
        drifted[i] = cairn_pose_compose(drifted[i - 1], step);
    }
}

/* Every keyframe is linked to the one before, and perhaps to others of its local map; the graph has
 * as many loop closures as are reported. */
static void check_links(const cairn_mapper *mapper, const cairn_mapper_state *state)
{
    int32_t links = cairn_mapper_link_count(mapper), loops = 0, chained = 0;

    for (int32_t i = 0; i < links; i++) {
        cairn_mapper_link link = cairn_mapper_link_at(mapper, i);
        cairn_sym3 covariance;

        assert_true(link.first >= 0 && link.first < link.second && link.second < state->keyframes);
        assert_true(cairn_pose_is_finite(link.first_second));
        assert_true(cairn_sym3_inverse(link.information, &covariance));
        assert_true(covariance.xx > 0 && covariance.yy > 0 && covariance.zz > 0);
        assert_true(link.is_loop ? link.error_probability > 0 && link.error_probability < 1
                                 : link.error_probability == 0);
        if (link.is_loop)
            loops += !link.is_outlier;
        else if (link.second == chained) /* one more of the last keyframe */
            assert_true(link.first < chained - 1 && !link.is_outlier);
        else
            assert_true(link.first == chained && link.second == ++chained && !link.is_outlier);
    }
    assert_int_equal(loops, state->loops);
    assert_int_equal(chained, links > 0 ? state->keyframes - 1 : 0);
}

/* Takes in all scans with the drifted odometry. */
static void run(cairn_mapper *mapper, const drive *d, int32_t budget, outcome *out)
{
    cairn_mapper_result results[SCANS];
    cairn_budget left = {budget};
    cairn_status status;
    int32_t events = 0;

    memset(out, 0, sizeof *out);
    for (int32_t i = 0; i < d->count; i++) {
        cairn_scan_input input = sim_scan_input(&d->scans[i]);

        assert_taken(cairn_mapper_add(mapper, &input, &drifted[i], NULL));
        while ((status = cairn_mapper_step(mapper, &left)) == CAIRN_MORE) {
            assert_int_equal(left.left, 0);
            left.left = budget;
        }
        assert_ok(status);
        results[i] = cairn_mapper_read(mapper);
        out->pending[i] = cairn_mapper_measure(mapper).pending_keyframes;
        if (results[i].is_keyframe)
            out->keyframe_scan[results[i].keyframe] = i;
        drain(mapper, &events, out);
    }
    budget = budget < 5000 ? budget : 5000;
    do {
        left.left = budget;
        status = cairn_mapper_settle(mapper, &left);
        drain(mapper, &events, out);
    } while (status == CAIRN_MORE);
    assert_ok(status);
    for (int32_t i = 0; i < d->count; i++)
        out->poses[i] = cairn_pose_compose(cairn_mapper_keyframe_pose(mapper, results[i].keyframe),
                                           results[i].keyframe_scan);
    out->state = cairn_mapper_measure(mapper);
    check_links(mapper, &out->state);
}

static double distance(cairn_pose a, cairn_pose b)
{
    return hypot((double)(a.x - b.x), (double)(a.y - b.y));
}

/* The relative pose of two scans. */
static double relative_error(const drive *d, const outcome *out, int32_t i, int32_t k)
{
    return distance(cairn_pose_between(pose_of(d->scans[i].truth), pose_of(d->scans[k].truth)),
                    cairn_pose_between(out->poses[i], out->poses[k]));
}

/* The largest error relative to the first scan, m. */
static double worst_error(const drive *d, const outcome *out)
{
    double worst = 0;

    for (int32_t i = 0; i < d->count; i++)
        worst = fmax(worst, relative_error(d, out, 0, i));
    return worst;
}

/* The error probability of an event is that of its evidence; without any it is 1. */
static void check_evidence(const cairn_mapper_loop *e)
{
    const cairn_mapper_loop_evidence *evidence = &e->evidence;

    assert_true(evidence->competing_score >= 0 && evidence->competing_score <= 1);
    assert_true(evidence->free_space_violation >= 0 && evidence->free_space_violation <= 1);
    assert_true(evidence->prior_distance >= 0);
    if (evidence->path_sigma > 0)
        assert_true(e->error_probability == cairn_mapper_loop_error_probability(evidence));
    else
        assert_true(e->error_probability == 1 && (e->verdict == CAIRN_MAPPER_LOOP_NO_MATCH ||
                                                  e->verdict == CAIRN_MAPPER_LOOP_OUTLIER));
}

/* Accepted loop closures of an outcome; every one must be right to 2 degrees and 0.3 m, which is
 * the accuracy of a scan and its prediction along a corridor. */
static int32_t check_closures(const drive *d, const outcome *out)
{
    int32_t accepted = 0;

    for (int32_t i = 0; i < out->state.loop_events && i < EVENTS; i++) {
        const cairn_mapper_loop *e = &out->events[i];
        cairn_pose truth;

        assert_true(e->first >= 0 && e->first < e->second && e->second < out->state.keyframes);
        check_evidence(e);
        if (e->verdict != CAIRN_MAPPER_LOOP_ACCEPTED)
            continue;
        truth = cairn_pose_between(pose_of(d->scans[out->keyframe_scan[e->first]].truth),
                                   pose_of(d->scans[out->keyframe_scan[e->second]].truth));
        assert_true(distance(truth, e->first_second) < 0.3);
        assert_true(fabs((double)cairn_wrap_angle(truth.theta - e->first_second.theta)) < 0.035);
        accepted++;
    }
    return accepted;
}

static outcome *map(const drive *d, const cairn_mapper_params *params, cairn_real bias,
                    outcome *out)
{
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, params);

    drift_odometry(d, bias);
    run(mapper, d, CAIRN_UNBOUNDED, out);
    test_pool_free(&pool);
    return out;
}

static void a_drive_that_comes_back_closes_its_loops(void **state)
{
    cairn_mapper_params params = small_params();

    (void)state;
    for (uint64_t seed = 1; seed <= 2; seed++) {
        drive d = start_drive(SIM_OFFICE, seed, SCANS, 0, 0.3);
        int32_t accepted;
        double with, without;

        params.loop.max_loops = 1000;
        with = worst_error(&d, map(&d, &params, CAIRN_REAL(0.01), &one));
        accepted = check_closures(&d, &one);
        assert_true(one.state.loops > 20 && one.state.loops <= accepted);
        assert_true(one.state.graph_solutions > 1);
        assert_int_equal(one.state.pending_keyframes, 0);
        assert_int_equal(one.state.capacity_exceeded, 0);
        params.loop.max_loops = 0;
        without = worst_error(&d, map(&d, &params, CAIRN_REAL(0.01), &two));
        assert_int_equal(two.state.loop_events, 0);
        assert_int_equal(two.state.graph_solutions, 0);
        assert_true(with < 0.15 && with < 1.5 * without);
        end_drive(&d);
    }
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_OFFICE, 3, 120, 0, 0.5);

    (void)state;
    params.loop.units_per_scan = 2000;
    params.loop.min_keyframe_gap = 8;
    map(&d, &params, 0, &one);
    assert_true(one.state.loops > 3);
    for (size_t b = 0; b < sizeof budgets / sizeof *budgets; b++) {
        cairn_pool pool;
        cairn_mapper *mapper = new_mapper(&pool, &params);

        run(mapper, &d, budgets[b], &two);
        assert_memory_equal(one.poses, two.poses, sizeof one.poses);
        assert_memory_equal(one.events, two.events, sizeof one.events);
        assert_memory_equal(one.pending, two.pending, sizeof one.pending);
        assert_int_equal(one.state.units, two.state.units);
        test_pool_free(&pool);
    }
    end_drive(&d);
}

/* Runs a step to its end with one unit a call. What a call commits is there with its unit. */
static void run_by_units(cairn_mapper *mapper,
                         cairn_status (*step)(cairn_mapper *mapper, cairn_budget *budget))
{
    cairn_status status;

    do {
        cairn_mapper_state before = cairn_mapper_measure(mapper), after;
        cairn_budget budget = {1};

        status = step(mapper, &budget);
        after = cairn_mapper_measure(mapper);
        assert_int_equal(budget.left, 1 - (after.units - before.units));
        assert_true(budget.left == 0 || (budget.left == 1 && status == CAIRN_OK));
        if (after.scans != before.scans || after.keyframes != before.keyframes ||
            after.loop_events != before.loop_events ||
            after.graph_solutions != before.graph_solutions)
            assert_int_equal(budget.left, 0);
    } while (status == CAIRN_MORE);
    assert_ok(status);
}

static void nothing_is_done_before_it_is_charged(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_OFFICE, 3, 120, 0, 0.5);
    cairn_pool pool;
    cairn_mapper *mapper;

    (void)state;
    params.loop.units_per_scan = 2000;
    params.loop.min_keyframe_gap = 8;
    mapper = new_mapper(&pool, &params);
    drift_odometry(&d, 0);
    for (int32_t i = 0; i < d.count; i++) {
        cairn_scan_input input = sim_scan_input(&d.scans[i]);

        assert_taken(cairn_mapper_add(mapper, &input, &drifted[i], NULL));
        run_by_units(mapper, cairn_mapper_step);
    }
    run_by_units(mapper, cairn_mapper_settle);
    assert_true(cairn_mapper_measure(mapper).loops > 3);
    assert_true(cairn_mapper_measure(mapper).graph_solutions > 0);
    test_pool_free(&pool);
    end_drive(&d);
}

/* Places that look alike are not confused. */
static void identical_rooms_are_distinguished(void **state)
{
    static const sim_scene scenes[] = {SIM_TWINS, SIM_MIRROR, SIM_MAZE};
    cairn_mapper_params params = small_params();

    (void)state;
    for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++) {
        drive d = start_drive(scenes[i], 5, 200, 0, 0.3);

        map(&d, &params, CAIRN_REAL(0.005), &one);
        (void)check_closures(&d, &one);
        params.loop.max_loops = 0;
        map(&d, &params, CAIRN_REAL(0.005), &two);
        params.loop.max_loops = 1000;
        assert_true(one.state.loops > 5);
        assert_true(worst_error(&d, &one) < 0.2);
        assert_true(worst_error(&d, &one) < worst_error(&d, &two) + 0.05);
        end_drive(&d);
    }
}

static int32_t count_verdict(const outcome *out, cairn_mapper_loop_verdict verdict)
{
    int32_t count = 0;

    for (int32_t i = 0; i < out->state.loop_events && i < EVENTS; i++)
        count += out->events[i].verdict == verdict;
    return count;
}

/* A return that needs a wide search: all closures but the last one of those required are pending,
 * then all of them are links. */
static void a_wide_search_requires_consistent_closures(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_OFFICE, 3, 240, 0, 0.4);

    (void)state;
    params.loop.max_loops = 1000;
    params.loop.min_keyframe_gap = 10;
    for (int32_t required = 1; required <= 3; required++) {
        params.loop.min_consistent = required;
        map(&d, &params, CAIRN_REAL(0.01), &one);
        assert_int_equal(count_verdict(&one, CAIRN_MAPPER_LOOP_PENDING), required - 1);
        assert_true(check_closures(&d, &one) > 20);
    }
    end_drive(&d);
}

/* Covariance of a keyframe's position along the path to the query, m^2, and its heading variance. */
typedef struct path_covariance {
    double xx, xy, yy, heading;
} path_covariance;

/* Adds a link to the covariance of a path, by rotation matrices. */
static path_covariance covariance_after(const cairn_mapper *mapper, path_covariance path,
                                        int32_t link, int32_t from)
{
    cairn_mapper_link l = cairn_mapper_link_at(mapper, link);
    cairn_pose at = cairn_mapper_keyframe_pose(mapper, from),
               query = cairn_mapper_keyframe_pose(mapper, mapper->loop.returns.query);
    double theta = (double)cairn_mapper_keyframe_pose(mapper, l.second).theta, c = cos(theta),
           s = sin(theta), dx = (double)(query.x - at.x), dy = (double)(query.y - at.y);
    cairn_sym3 own;
    double xx, xy, yy, zz;

    assert_true(cairn_sym3_inverse(l.information, &own));
    xx = (double)own.xx, xy = (double)own.xy, yy = (double)own.yy, zz = (double)own.zz;
    path.xx += c * c * xx - 2 * c * s * xy + s * s * yy + zz * dy * dy;
    path.yy += s * s * xx + 2 * c * s * xy + c * c * yy + zz * dx * dx;
    path.xy += c * s * (xx - yy) + (c * c - s * s) * xy - zz * dx * dy;
    path.heading += zz;
    return path;
}

/* The covariances of the paths in the pose graph are those of the paths of least variance by the
 * Bellman-Ford algorithm. No closure is accepted, so that no optimization moves the keyframes. */
static void covariances_of_paths_match_a_slow_reference(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_MAZE, 5, 200, 0, 0.3);
    cairn_pool pool;
    cairn_mapper *mapper;
    const mapper_return_search *returns;
    path_covariance path[SCANS];
    int32_t links, keyframes, changed = 1, narrow = 0;

    (void)state;
    params.loop.min_log_odds = 1000;
    mapper = new_mapper(&pool, &params);
    drift_odometry(&d, CAIRN_REAL(0.005));
    run(mapper, &d, CAIRN_UNBOUNDED, &one);
    assert_int_equal(one.state.loops, 0);
    returns = &mapper->loop.returns;
    links = cairn_mapper_link_count(mapper);
    keyframes = returns->query + 1;
    assert_true(keyframes > 30 && links > keyframes);
    for (int32_t k = 0; k < keyframes; k++)
        path[k] = (path_covariance){1e9, 0, 1e9, 0};
    path[returns->query] = (path_covariance){0, 0, 0, 0};
    while (changed) {
        changed = 0;
        for (int32_t i = 0; i < 2 * links; i++) {
            cairn_mapper_link l = cairn_mapper_link_at(mapper, i / 2);
            int32_t from = i % 2 ? l.first : l.second, to = i % 2 ? l.second : l.first;
            path_covariance by;

            if (l.second > returns->query || path[from].xx >= 1e9)
                continue;
            by = covariance_after(mapper, path[from], i / 2, from);
            if (by.xx + by.yy < (path[to].xx + path[to].yy) * (1 - 1e-12)) {
                path[to] = by;
                changed = 1;
            }
        }
    }
    for (int32_t k = 0; k < keyframes; k++) {
        double variance = path[k].xx + path[k].yy, allowed = 1e-3 * variance;

        assert_near(returns->variance[k], variance, allowed);
        assert_near(returns->anisotropy[k].x, path[k].xx - path[k].yy, allowed);
        assert_near(returns->anisotropy[k].y, 2 * path[k].xy, allowed);
        assert_near(returns->heading_variance[k], path[k].heading, 1e-3 * path[k].heading);
        narrow += hypot(path[k].xx - path[k].yy, 2 * path[k].xy) > 0.5 * variance;
    }
    assert_true(narrow > 5);
    test_pool_free(&pool);
    end_drive(&d);
}

/* Corridors that repeat themselves within the accumulated drift: the one that was visited is not
 * confused with the one that was not. */
static void a_similar_place_is_not_confused(void **state)
{
    cairn_mapper_params params = small_params();
    int32_t unlikely = 0;

    (void)state;
    params.loop.max_loops = 1000;
    for (uint64_t seed = 17; seed <= 30; seed += 13) {
        drive d = start_drive(SIM_MAZE, seed, SCANS, sim_survey_default().bias_drift, 0.3);

        cairn_pool pool;
        cairn_mapper *mapper = new_mapper(&pool, &params);

        for (int32_t i = 0; i < d.count; i++)
            drifted[i] = pose_of(d.scans[i].odometry);
        run(mapper, &d, CAIRN_UNBOUNDED, &one);
        test_pool_free(&pool);
        assert_true(check_closures(&d, &one) > 10);
        assert_true(worst_error(&d, &one) < 0.3);
        unlikely += count_verdict(&one, CAIRN_MAPPER_LOOP_UNLIKELY);
        end_drive(&d);
    }
    assert_true(unlikely > 0);
}

/* Returns the error probability with one part of the evidence changed. */
static cairn_real probability_with(int32_t part, cairn_real value)
{
    cairn_mapper_loop_evidence e = {CAIRN_REAL(0.1), 1, CAIRN_REAL(0.2), CAIRN_REAL(0.02)};

    if (part == 0)
        e.path_sigma = value;
    else if (part == 1)
        e.prior_distance = value;
    else if (part == 2)
        e.competing_score = value;
    else
        e.free_space_violation = value;
    return cairn_mapper_loop_error_probability(&e);
}

/* What speaks against a closure makes it more probable that it is wrong, within the bounds of what
 * the regression was fitted to; the worst of all is no certainty. */
static void error_probabilities_grow_with_the_evidence_against(void **state)
{
    static const cairn_real least[] = {CAIRN_REAL(0.01), 0, 0, 0},
                            most[] = {2, 12, 1, CAIRN_REAL(0.1)};
    cairn_mapper_loop_evidence good = {0, 0, 0, 0}, bad = {1000, 1000, 1, CAIRN_REAL(0.1)};

    (void)state;
    for (int32_t part = 0; part < 4; part++) {
        cairn_real before = 0;

        for (int32_t i = 0; i <= 10; i++) {
            cairn_real share = (cairn_real)i / 10;
            cairn_real now =
                probability_with(part, least[part] + share * (most[part] - least[part]));

            assert_true(now > before && now < 1);
            before = now;
        }
        if (part < 2)
            assert_true(probability_with(part, 100 * most[part]) == before);
    }
    assert_true(cairn_mapper_loop_error_probability(&good) <= CAIRN_REAL(0.01));
    assert_true(cairn_mapper_loop_error_probability(&bad) > CAIRN_REAL(0.5));
    assert_true(cairn_mapper_loop_error_probability(&bad) < 1);
}

static void exceeded_capacities_are_reported(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_OFFICE, 3, 120, 0, 0.5);

    (void)state;
    params.loop.min_keyframe_gap = 8;
    params.loop.max_loops = 2;
    map(&d, &params, 0, &one);
    assert_int_equal(one.state.loops, 2);
    assert_int_equal(one.state.capacity_exceeded, 1);
    params.loop.max_loops = 100;
    params.loop.max_fill = 10;
    map(&d, &params, 0, &one);
    assert_int_equal(one.state.capacity_exceeded, 2);
    assert_int_equal(one.state.graph_solutions, 0);
    end_drive(&d);
}

/* A scan after a rotation too fast to match is searched for, and found. */
static void a_jump_is_searched_for(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_RESCUE, 1, 60, 0, 0.1);
    cairn_pool pool;
    cairn_mapper *mapper;
    double found = 0;

    (void)state;
    params.search_units = 200000;
    for (params.search = 0; params.search <= 1; params.search++) {
        double error = 0;

        mapper = new_mapper(&pool, &params);
        for (int32_t i = 0; i < d.count; i++) {
            /* six scans are missing */
            int32_t at = i < 30 ? i : i + 6 < d.count ? i + 6 : d.count - 1;
            cairn_scan_input input = sim_scan_input(&d.scans[at]);
            cairn_budget budget = {CAIRN_UNBOUNDED};
            cairn_pose truth =
                cairn_pose_between(pose_of(d.scans[0].truth), pose_of(d.scans[at].truth));

            assert_taken(cairn_mapper_add(mapper, &input, NULL, NULL));
            assert_ok(cairn_mapper_step(mapper, &budget));
            error = distance(truth, cairn_mapper_read(mapper).map_scan);
        }
        if (params.search) {
            assert_true(cairn_mapper_measure(mapper).searched > 0);
            assert_true(error < 0.1);
            assert_true(error < found);
        } else {
            assert_int_equal(cairn_mapper_measure(mapper).searched, 0);
            found = error;
        }
        test_pool_free(&pool);
    }
    end_drive(&d);
}

/* Odometry that reports motion that did not happen is rejected, and used again when it is right. */
static void odometry_is_used_as_long_as_it_is_right(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_APARTMENT, 3, 80, 0, 0.1);
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);
    cairn_pose odometry_pose = pose_of(d.scans[0].truth);
    int64_t contradicted = 0;

    (void)state;
    for (int32_t i = 0; i < d.count; i++) {
        cairn_scan_input input = sim_scan_input(&d.scans[i]);
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_mapper_result result;

        if (i > 0) {
            cairn_pose step =
                cairn_pose_between(pose_of(d.scans[i - 1].truth), pose_of(d.scans[i].truth));

            if (i >= 20 && i < 50)
                step.y += CAIRN_REAL(0.3);
            odometry_pose = cairn_pose_compose(odometry_pose, step);
        }
        assert_taken(cairn_mapper_add(mapper, &input, &odometry_pose, NULL));
        assert_ok(cairn_mapper_step(mapper, &budget));
        result = cairn_mapper_read(mapper);
        assert_true(distance(result.map_scan, pose_of(d.scans[i].truth)) < 0.1);
        if (i == 19)
            contradicted = cairn_mapper_measure(mapper).odometry_contradicted;
    }
    assert_true(contradicted <= 1);
    assert_true(cairn_mapper_measure(mapper).odometry_contradicted - contradicted >= 25);
    assert_true(cairn_mapper_measure(mapper).odometry_contradicted - contradicted <= 32);
    test_pool_free(&pool);
    end_drive(&d);
}

/* The pose of the odometry's frame in the map transforms odometry to the map. */
static void map_odom_leads_from_odometry_to_the_map(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_OFFICE, 4, 30, 0, 0.3);
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);
    cairn_pose nothing = cairn_pose_identity(), none = cairn_mapper_map_odom(mapper);

    (void)state;
    assert_memory_equal(&none, &nothing, sizeof none);
    for (int32_t i = 0; i < d.count; i++) {
        cairn_scan_input input = sim_scan_input(&d.scans[i]);
        cairn_pose odometry =
                       cairn_pose_compose((cairn_pose){5, 3, 2}, pose_of(d.scans[i].odometry)),
                   base;
        cairn_budget budget = {CAIRN_UNBOUNDED};

        assert_taken(cairn_mapper_add(mapper, &input, &odometry, NULL));
        assert_ok(cairn_mapper_step(mapper, &budget));
        base = cairn_pose_compose(cairn_mapper_map_odom(mapper), odometry);
        assert_near(distance(base, cairn_mapper_read(mapper).map_scan), 0, 1e-4);
    }
    test_pool_free(&pool);
    end_drive(&d);
}

/* ... also while a scan is processed, before anything of it is reported, and after scans without
 * odometry. */
static void map_odom_is_of_scans_that_are_done(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_OFFICE, 4, 12, 0, 0.3);
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);
    cairn_pose before = cairn_pose_identity();

    (void)state;
    for (int32_t i = 0; i < d.count; i++) {
        int32_t has_odometry = i % 4 != 2;
        cairn_scan_input input = sim_scan_input(&d.scans[i]);
        cairn_pose odometry =
            cairn_pose_compose((cairn_pose){5, 3, 2}, pose_of(d.scans[i].odometry));
        cairn_status status;

        assert_taken(cairn_mapper_add(mapper, &input, has_odometry ? &odometry : NULL, NULL));
        do {
            cairn_pose now = cairn_mapper_map_odom(mapper);
            cairn_budget budget = {100};

            if (cairn_mapper_measure(mapper).scans == i)
                assert_memory_equal(&now, &before, sizeof now);
            status = cairn_mapper_step(mapper, &budget);
        } while (status == CAIRN_MORE);
        assert_ok(status);
        before = cairn_mapper_map_odom(mapper);
        if (has_odometry)
            assert_near(
                distance(cairn_pose_compose(before, odometry), cairn_mapper_read(mapper).map_scan),
                0, 1e-4);
        else
            assert_true(before.x != 0);
    }
    test_pool_free(&pool);
    end_drive(&d);
}

/* A jump that no robot makes is no information on the motion; odometry beyond all bounds is
 * refused. */
static void odometry_that_jumps_out_of_the_world(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_OFFICE, 4, 20, 0, 0.2);
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);

    (void)state;
    for (int32_t i = 0; i < d.count; i++) {
        cairn_scan_input input = sim_scan_input(&d.scans[i]);
        cairn_pose odometry = pose_of(d.scans[i].odometry), beyond = {CAIRN_REAL(2e9), 0, 0};
        cairn_budget budget = {CAIRN_UNBOUNDED};

        odometry.x += i >= 8 && i < 12 ? CAIRN_REAL(9e8) : 0;
        assert_int_equal(cairn_mapper_add(mapper, &input, &beyond, NULL), CAIRN_BAD_ARGUMENT);
        assert_taken(cairn_mapper_add(mapper, &input, &odometry, NULL));
        assert_ok(cairn_mapper_step(mapper, &budget));
        assert_near(distance(cairn_mapper_read(mapper).map_scan, pose_of(d.scans[i].truth)), 0,
                    0.1);
    }
    test_pool_free(&pool);
    end_drive(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_drive_that_comes_back_closes_its_loops),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(nothing_is_done_before_it_is_charged),
        cmocka_unit_test(identical_rooms_are_distinguished),
        cmocka_unit_test(a_wide_search_requires_consistent_closures),
        cmocka_unit_test(covariances_of_paths_match_a_slow_reference),
        cmocka_unit_test(a_similar_place_is_not_confused),
        cmocka_unit_test(error_probabilities_grow_with_the_evidence_against),
        cmocka_unit_test(exceeded_capacities_are_reported),
        cmocka_unit_test(a_jump_is_searched_for),
        cmocka_unit_test(odometry_is_used_as_long_as_it_is_right),
        cmocka_unit_test(map_odom_leads_from_odometry_to_the_map),
        cmocka_unit_test(map_odom_is_of_scans_that_are_done),
        cmocka_unit_test(odometry_that_jumps_out_of_the_world),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
