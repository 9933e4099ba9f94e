/* Long scenes of scan alignment: the aligner, the force field, Lu and Milios, hypotheses. */
#include "src/base/build.h"

#include "cairn/lum.h"
#include "cairn/scan_redundancy.h"
#include "cairn/virtual_align.h"
#include "tests/long.h"
#include "tests/long_scenes.h"

enum { MOST_SCANS = 32 };

/* Scans at places of a flat, each of a part of the surroundings. */
typedef struct survey {
    long_world world;
    cairn_random random;
    cairn_pool pool;
    cairn_scan *scan;
} survey;

static void start_survey(survey *s, uint64_t seed, int32_t boxes)
{
    long_build(&s->world, seed, boxes);
    s->random = cairn_random_seed(seed, 22);
    s->scan = long_new_scan(&s->pool);
}

static cairn_scan_view take(survey *s, cairn_pose pose, int32_t beams, cairn_real view,
                            cairn_real people)
{
    static long_sweep sweep;

    long_take_sweep(&sweep, &s->world, &s->random, pose, beams, view, people);
    return long_fit(s->scan, &sweep);
}

/* Four headings of 100 degrees at a place, and then the next place. */
static cairn_pose heading_of(survey *s, int32_t i, cairn_pose *place)
{
    if (i % 4 == 0)
        *place = long_somewhere(&s->world, &s->random);
    place->theta += CAIRN_REAL(1.5707);
    return long_disturbed(&s->random, *place, CAIRN_REAL(0.05), CAIRN_REAL(0.05));
}

/* ---- The aligner ---- */

static uint64_t add_aligned(uint64_t hash, const cairn_aligner_pose *p)
{
    hash = add_real(add_covariance(add_pose(hash, p->map_scan), p->covariance), p->support);
    return add_int(add_int(add_int(hash, p->observable), p->placed), p->component);
}

static uint64_t add_aligner_result(uint64_t hash, const cairn_aligner_result *r)
{
    hash = add_int(add_int(add_int(add_int(hash, r->verdict), r->components), r->largest_size),
                   r->placed);
    hash =
        add_int(add_int(add_int(add_int(hash, r->anchor), r->hypotheses), r->dropped), r->merges);
    hash =
        add_int(add_int(add_int(add_int(hash, r->relocalized), r->iterations), r->walls), r->fill);
    hash = add_real(add_real(hash, r->initial_sigma), r->initial_sigma_theta);
    return add_int(add_int(hash, r->units), r->worst_step);
}

static uint64_t align_all(uint64_t hash, cairn_aligner *aligner)
{
    cairn_aligner_result result;

    assert_ok(cairn_aligner_begin(aligner));
    LONG_RUN(hash, cairn_aligner_step, aligner, 50000);
    result = cairn_aligner_read(aligner);
    hash = add_aligner_result(hash, &result);
    for (int32_t i = 0; i < cairn_aligner_scan_count(aligner); i++) {
        cairn_aligner_pose pose = cairn_aligner_pose_of(aligner, i);

        hash = add_aligned(hash, &pose);
    }
    return hash;
}

static cairn_aligner_params params_for(int32_t scans)
{
    cairn_aligner_params params = cairn_aligner_default();

    params.max_scans = scans;
    params.max_segments = 48 * scans;
    params.max_points = 400 * scans;
    return params;
}

/* The whole flat from distant poses; again from poses of which a few are right. */
static uint64_t align_flat(uint64_t hash, uint64_t seed, cairn_real metres)
{
    cairn_aligner_params params = params_for(MOST_SCANS);
    cairn_pose place = {0, 0, 0};
    cairn_aligner *aligner;
    cairn_pool pool;
    survey s;

    start_survey(&s, seed, 12);
    LONG_CREATE(&pool, aligner, &aligner, &params);
    for (int32_t i = 0; i < MOST_SCANS; i++) {
        cairn_pose pose = heading_of(&s, i, &place);
        cairn_scan_view view = take(&s, pose, 201, CAIRN_REAL(1.75), i == 5 ? CAIRN_REAL(0.9) : 0);

        assert_ok(cairn_aligner_add_scan(aligner, &view,
                                         long_disturbed(&s.random, pose, metres, metres), NULL));
        if (i == 15)
            hash = align_all(hash, aligner);
    }
    hash = align_all(hash, aligner);
    for (int32_t i = 0; i < MOST_SCANS; i += 3) {
        cairn_pose at = cairn_aligner_pose_of(aligner, i).map_scan;

        assert_ok(cairn_aligner_set_initial_pose(aligner, i, at));
    }
    hash = align_all(hash, aligner);
    test_pool_free(&pool);
    test_pool_free(&s.pool);
    return hash;
}

uint64_t long_aligned_flat(void)
{
    uint64_t hash = align_flat(GOLDEN_START, 1, CAIRN_REAL(0.4));

    hash = align_flat(hash, 11, CAIRN_REAL(0.55));
    return align_flat(hash, 12, CAIRN_REAL(0.3));
}

/* With other parameters, step by step; some initial poses are far off. */
static uint64_t align_and_repair(uint64_t hash, uint64_t seed, int32_t max_hypotheses)
{
    cairn_aligner_params params = params_for(16);
    cairn_pose place = {0, 0, 0};
    cairn_aligner *aligner;
    cairn_pool pool;
    survey s;

    params.max_hypotheses = max_hypotheses;
    params.max_short_segments = 40;
    params.max_cells = 3000;
    params.max_initial_error = CAIRN_REAL(0.5);
    params.max_initial_angle_error = CAIRN_REAL(0.5);
    params.max_range = 5;
    params.range_sigma = CAIRN_REAL(0.015);
    params.free_space_penalty = 1;
    params.oriented = max_hypotheses > 200;
    params.max_relocalizations = 3;
    params.max_iterations = 4;
    params.min_log_likelihood_ratio = 2;
    start_survey(&s, seed, 20);
    LONG_CREATE(&pool, aligner, &aligner, &params);
    for (int32_t i = 0; i < 16; i++) {
        cairn_pose pose = heading_of(&s, i, &place);
        cairn_scan_view view = take(&s, pose, 241, CAIRN_REAL(2.1), CAIRN_REAL(0.1));
        cairn_real metres = i % 5 == 4 ? CAIRN_REAL(0.9) : CAIRN_REAL(0.25);

        assert_ok(cairn_aligner_add_scan(aligner, &view,
                                         long_disturbed(&s.random, pose, metres, metres), NULL));
    }
    assert_ok(cairn_aligner_begin(aligner));
    while (cairn_aligner_running(aligner)) {
        LONG_RUN(hash, cairn_aligner_iterate, aligner, 20000);
        for (int32_t i = 0; i < 16; i++) {
            int32_t part;

            hash = add_pose(hash, cairn_aligner_current_pose(aligner, i, &part));
            hash = add_int(hash, part);
        }
    }
    hash = align_all(hash, aligner);
    test_pool_free(&pool);
    test_pool_free(&s.pool);
    return hash;
}

uint64_t long_aligned_repaired(void)
{
    uint64_t hash = align_and_repair(GOLDEN_START, 2, 90);

    hash = align_and_repair(hash, 13, 400);
    return align_and_repair(hash, 14, 400);
}

/* Groups that the joint solution cannot connect, scans without common surfaces, and a corridor
 * along which the position is unobservable. */
uint64_t long_aligned_parts(void)
{
    cairn_aligner_params params = params_for(12);
    uint64_t hash = GOLDEN_START;
    cairn_aligner *aligner;
    cairn_pool pool;
    survey s;

    start_survey(&s, 3, 0);
    for (int32_t k = 0; k < 3; k++) {
        params.max_fill = k == 0 ? 6 : 400;
        params.max_iterations = k == 2 ? 0 : 10;
        LONG_CREATE(&pool, aligner, &aligner, &params);
        for (int32_t i = 0; i < 12; i++) {
            cairn_pose pose = {CAIRN_REAL(4.5) + (cairn_real)i / 4, 4,
                               CAIRN_PI * (cairn_real)(i % 2)};
            cairn_scan_view view;

            if (i > 8)
                pose.y = i == 9 ? CAIRN_REAL(1.5) : CAIRN_REAL(6.5);
            view = take(&s, pose, 181, CAIRN_REAL(2.6), 0);
            assert_ok(cairn_aligner_add_scan(
                aligner, &view, long_disturbed(&s.random, pose, CAIRN_REAL(0.2), CAIRN_REAL(0.2)),
                NULL));
        }
        hash = align_all(hash, aligner);
        test_pool_free(&pool);
    }
    test_pool_free(&s.pool);
    return hash;
}

/* ---- The force field ---- */

static uint64_t add_state(uint64_t hash, const cairn_force_field_state *s)
{
    hash = add_int(add_int(add_int(add_int(hash, s->verdict), s->iterations), s->units),
                   s->max_step_units);
    hash = add_int(add_int(add_int(add_int(hash, s->start_iterations), s->pairs), s->segment_pairs),
                   s->corners);
    hash = add_int(add_int(add_int(hash, s->corners_dropped), s->bonds), s->bonds_dropped);
    return add_real(add_real(add_real(add_real(hash, s->sigma), s->dt), s->potential),
                    s->mean_relocation);
}

static uint64_t add_field(uint64_t hash, const cairn_force_field *field)
{
    cairn_force_field_state state = cairn_force_field_read(field);
    const cairn_corner *corners;
    int32_t count;

    hash = add_real(add_state(hash, &state), cairn_force_field_potential(field));
    for (int32_t i = 0; i < cairn_force_field_pose_count(field); i++) {
        cairn_force_field_motion motion;
        cairn_vec2 force;
        cairn_real mass;

        if (!cairn_force_field_has(field, i))
            continue;
        motion = cairn_force_field_motion_of(field, i);
        hash = add_point(add_point(add_pose(hash, cairn_force_field_pose(field, i)), motion.centre),
                         motion.force);
        hash = add_real(add_real(hash, motion.torque), motion.relocation);
        assert_ok(cairn_force_field_point_force(field, i, 3, &force, &mass));
        hash = add_real(add_point(hash, force), mass);
    }
    corners = cairn_force_field_corners(field, &count);
    for (int32_t i = 0; i < count; i++) {
        hash = add_point(add_point(add_point(hash, corners[i].position), corners[i].leg[0]),
                         corners[i].leg[1]);
        hash = add_real(add_real(hash, corners[i].opening), corners[i].strength);
        hash = add_int(add_int(add_int(hash, corners[i].kind), corners[i].segment[0]),
                       corners[i].segment[1]);
    }
    return hash;
}

enum { FIELD_SCANS = 10 };

/* A field of scans along the path, run to its end, and again after a restart with one scan fixed,
 * one moved, one removed and another in its place. */
static uint64_t run_field(uint64_t seed, const cairn_force_field_params *params, int32_t with_mass,
                          int32_t extras)
{
    static cairn_real mass[2048];
    cairn_oriented_point extra[64];
    cairn_force_field *field;
    uint64_t hash = GOLDEN_START;
    cairn_scan_view view;
    cairn_pose pose;
    cairn_pool pool;
    survey s;

    start_survey(&s, seed, 10);
    LONG_CREATE(&pool, force_field, &field, params);
    for (int32_t i = 0; i < 2048; i++)
        mass[i] = 1 + (cairn_real)(i % 3) / 2;
    for (int32_t i = 0; i < FIELD_SCANS; i++) {
        pose = long_on_the_way((cairn_real)i * CAIRN_REAL(0.6));
        view = take(&s, pose, 181, CAIRN_REAL(3.1), 0);
        assert_ok(cairn_force_field_add_scan(
            field, &view, with_mass ? mass : NULL,
            long_disturbed(&s.random, pose, CAIRN_REAL(0.1), CAIRN_REAL(0.08)), NULL));
    }
    for (int32_t i = 0; i < extras; i++) {
        extra[i].position.x = 1 + (cairn_real)i / 16;
        extra[i].position.y = CAIRN_REAL(3.3125);
        extra[i].direction.x = 1;
        extra[i].direction.y = 0;
    }
    if (extras > 0)
        assert_ok(cairn_force_field_set_extra(field, extra, mass, extras));
    assert_ok(cairn_force_field_fix(field, 0, 1));
    for (int32_t k = 0; k < 3; k++) {
        LONG_RUN(hash, cairn_force_field_iterate, field, 3000);
        hash = add_field(hash, field);
    }
    LONG_RUN(hash, cairn_force_field_step, field, 3000);
    hash = add_field(hash, field);
    assert_ok(cairn_force_field_remove(field, 4));
    assert_ok(cairn_force_field_fix(field, 0, 0));
    pose = long_on_the_way(3);
    assert_ok(cairn_force_field_place(
        field, 5, long_disturbed(&s.random, pose, CAIRN_REAL(0.1), CAIRN_REAL(0.1))));
    cairn_force_field_restart(field);
    LONG_RUN(hash, cairn_force_field_iterate, field, 500);
    view = take(&s, long_on_the_way(CAIRN_REAL(2.5)), 121, CAIRN_REAL(3.1), 0);
    assert_int_equal(cairn_force_field_next(field), 4);
    assert_ok(
        cairn_force_field_add_scan(field, &view, NULL, long_on_the_way(CAIRN_REAL(2.4)), NULL));
    LONG_RUN(hash, cairn_force_field_step, field, 7);
    hash = add_field(hash, field);
    hash = add_int(hash, cairn_force_field_revision(field));
    test_pool_free(&pool);
    test_pool_free(&s.pool);
    return hash;
}

static cairn_force_field_params field_of(cairn_force_field_params params)
{
    params.max_scans = FIELD_SCANS;
    params.max_segments = FIELD_SCANS * 48;
    params.max_points = FIELD_SCANS * 300;
    params.max_steps = 12;
    return params;
}

uint64_t long_field_gradient(void)
{
    cairn_force_field_params params = field_of(cairn_force_field_default());

    params.potential = 1;
    params.max_corners = 30;
    return run_field(4, &params, 1, 0);
}

uint64_t long_field_twisted(void)
{
    cairn_force_field_params params = field_of(cairn_force_field_default());

    params.alignment_torque = CAIRN_REAL(0.5);
    params.oriented_below = CAIRN_REAL(0.14);
    params.sigma_factor = CAIRN_REAL(0.97);
    params.reach = 3;
    params.sensor_below = 0;
    params.roi_radius = CAIRN_REAL(0.15);
    params.corner_distance = CAIRN_REAL(0.2);
    params.max_extra = 64;
    params.potential = 1;
    return run_field(5, &params, 1, 60);
}

uint64_t long_field_spaced(void)
{
    cairn_force_field_params params = field_of(cairn_force_field_spaced(CAIRN_REAL(0.1)));

    params.max_extra = 32;
    return run_field(6, &params, 0, 32);
}

uint64_t long_field_springs(void)
{
    cairn_force_field_params params = field_of(cairn_force_field_springs(CAIRN_REAL(0.4), 12));

    params.max_bonds = 30;
    params.max_extra = 64;
    params.potential = 1;
    return run_field(7, &params, 1, 50);
}

uint64_t long_field_springs_twisted(void)
{
    cairn_force_field_params params = field_of(cairn_force_field_springs(CAIRN_REAL(0.3), 10));

    params.max_bonds = 12;
    params.tangential_stiffness = CAIRN_REAL(0.3);
    params.damping_sigma = CAIRN_REAL(0.2);
    params.alignment_torque = 1;
    params.max_relocation = CAIRN_REAL(0.03);
    params.roi = 1;
    return run_field(8, &params, 0, 0);
}

/* ---- Lu and Milios, and redundancy ---- */

uint64_t long_lum(void)
{
    enum { SCANS = 12 };
    cairn_scan_redundancy_params cover_params = cairn_scan_redundancy_default();
    cairn_scan_set_params set_params = {
        .max_scans = SCANS, .max_segments = SCANS * 48, .max_points = SCANS * 300, .spacing = 0};
    cairn_lum_params params = cairn_lum_default();
    cairn_pose pose[SCANS], thought[SCANS];
    uint64_t hash = GOLDEN_START;
    cairn_scan_redundancy *cover;
    cairn_pool pool[3];
    cairn_scan_set *set;
    cairn_lum *lum;
    survey s;

    start_survey(&s, 9, 10);
    LONG_CREATE(&pool[0], scan_set, &set, &set_params);
    cover_params.max_scans = SCANS;
    LONG_CREATE(&pool[1], scan_redundancy, &cover, &cover_params);
    params.max_scans = SCANS;
    params.max_iterations = 12;
    params.rebuild_interval = 4;
    for (int32_t registers = 0; registers < 2; registers++) {
        params.sequential_registration = registers;
        params.direction_gate = registers ? CAIRN_REAL(1.2) : CAIRN_PI;
        LONG_CREATE(&pool[2], lum, &lum, &params);
        for (int32_t i = 0; i < SCANS; i++) {
            cairn_pose at = long_on_the_way((cairn_real)i * CAIRN_REAL(0.7));
            cairn_real off = registers ? CAIRN_REAL(0.4) : CAIRN_REAL(0.1);
            cairn_scan_view view;

            view = take(&s, at, 121, CAIRN_REAL(3.1), 0);
            thought[i] = long_disturbed(&s.random, at, off, off / 2);
            assert_ok(cairn_lum_add_scan(lum, view.points, view.point_count, thought[i], NULL));
            if (registers == 0)
                assert_ok(cairn_scan_set_add(set, &view, NULL, NULL));
        }
        assert_ok(cairn_lum_begin(lum));
        LONG_RUN(hash, cairn_lum_iterate, lum, 10000);
        hash = add_real(add_real(hash, cairn_lum_read(lum).chi2), cairn_lum_read(lum).max_motion);
        LONG_RUN(hash, cairn_lum_step, lum, 10000);
        for (int32_t i = 0; i < SCANS; i++) {
            pose[i] = cairn_lum_pose(lum, i);
            hash = add_int(add_pose(hash, pose[i]), cairn_lum_is_connected(lum, i));
        }
        hash = add_int(add_int(hash, cairn_lum_read(lum).links), cairn_lum_read(lum).pairs);
        hash = add_int(add_int(hash, cairn_lum_read(lum).registered_scans),
                       cairn_lum_read(lum).components);
        hash = add_real(add_real(hash, cairn_lum_read(lum).chi2), cairn_lum_read(lum).max_motion);
        hash = add_int(add_int(hash, cairn_lum_read(lum).verdict), cairn_lum_read(lum).iterations);
        test_pool_free(&pool[2]);
        if (registers > 0)
            continue;
        assert_ok(cairn_scan_redundancy_begin(cover, set, pose));
        LONG_RUN(hash, cairn_scan_redundancy_step, cover, 1000);
        for (int32_t i = 0; i < SCANS; i++)
            hash = add_real(hash, cairn_scan_redundancy_loss(cover, i));
    }
    for (int32_t i = 0; i < 2; i++)
        test_pool_free(&pool[i]);
    test_pool_free(&s.pool);
    return hash;
}

/* ---- Hypotheses ---- */

/* Scans with little overlap, so that rooms and walls that no scan sees whole must help. */
uint64_t long_hypotheses(void)
{
    enum { SCANS = 8 };
    cairn_virtual_align_params params = cairn_virtual_align_default();
    cairn_virtual_align_result result;
    cairn_virtual_align *align;
    uint64_t hash = GOLDEN_START;
    const cairn_oriented_point *points;
    const cairn_virtual_scan_hypothesis *found;
    const cairn_real *weights;
    int32_t count;
    cairn_pool pool;
    survey s;

    start_survey(&s, 10, 4);
    params.aligner = params_for(SCANS);
    params.aligner.min_log_likelihood_ratio = 60;
    params.aligner.max_relocalizations = 0;
    params.hypotheses.max_hypotheses = 12;
    params.hypotheses.max_virtual = 600;
    params.field.max_steps = 14;
    params.rebuild_interval = 5;
    LONG_CREATE(&pool, virtual_align, &align, &params);
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_pose pose = {2, CAIRN_REAL(1.5), CAIRN_REAL(0.8) * (cairn_real)i};
        cairn_scan_view view;

        if (i > 4)
            pose.x = 6;
        view = take(&s, pose, 181, CAIRN_REAL(1.2), 0);
        assert_ok(cairn_virtual_align_add_scan(
            align, &view, long_disturbed(&s.random, pose, CAIRN_REAL(0.15), CAIRN_REAL(0.15)),
            NULL));
    }
    assert_ok(cairn_virtual_align_begin(align));
    LONG_RUN(hash, cairn_virtual_align_step, align, 20000);
    result = cairn_virtual_align_read(align);
    hash = add_aligner_result(hash, &result.aligner);
    hash = add_int(add_int(add_int(hash, result.rounds), result.moved_scans), result.iterations);
    hash = add_int(add_int(hash, result.active_iterations), result.hypotheses);
    hash = add_int(add_int(add_int(hash, result.align_units), result.hypothesis_units),
                   result.field_units);
    assert_true(result.moved_scans > 0 && result.hypotheses > 0);
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_virtual_align_pose pose = cairn_virtual_align_pose_of(align, i);

        hash = add_int(add_aligned(hash, &pose.aligned), pose.moved);
    }
    found = cairn_virtual_scan_hypotheses(cairn_virtual_align_hypotheses(align), &count);
    for (int32_t i = 0; i < count; i++) {
        hash = add_int(add_int(add_int(hash, found[i].kind), found[i].first_point),
                       found[i].end_point);
        hash = add_real(add_real(add_int(hash, found[i].observing_scans), found[i].strength),
                        found[i].weight);
    }
    points = cairn_virtual_scan_points(cairn_virtual_align_hypotheses(align), &weights, &count);
    for (int32_t i = 0; i < count; i++)
        hash = add_real(add_point(add_point(hash, points[i].position), points[i].direction),
                        weights[i]);
    hash = add_int(hash, cairn_virtual_scan_dropped(cairn_virtual_align_hypotheses(align)));
    hash = add_field(hash, cairn_virtual_align_field(align));
    test_pool_free(&pool);
    test_pool_free(&s.pool);
    return hash;
}
