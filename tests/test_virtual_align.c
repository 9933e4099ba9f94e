/* The aligner with virtual scans: the four rooms on a hallway, and rooms drawn by hand. */
#include "tests/four_rooms.h"

static cairn_virtual_align_params small_params(void)
{
    cairn_virtual_align_params p = cairn_virtual_align_default();

    p.aligner.max_scans = 8;
    p.aligner.max_segments = 256;
    p.aligner.max_points = 3000;
    p.aligner.max_hypotheses = 200;
    p.aligner.max_fill = 256;
    return p;
}

/* An aligner that requires more evidence than some of the scans have. */
static cairn_virtual_align_params hesitant_params(void)
{
    cairn_virtual_align_params p = small_params();

    p.aligner.min_log_likelihood_ratio = 16;
    p.aligner.max_relocalizations = 0;
    return p;
}

/* Most with hypotheses, fewer without (bench/virtual measures how many). */
static void rooms_come_together(void **state)
{
    cairn_virtual_align_params with = small_params(), without = with;
    int32_t right_with = 0, right_without = 0;

    (void)state;
    without.hypotheses.lines = without.hypotheses.rectangles = without.hypotheses.ellipses = 0;
    for (uint64_t seed = 1; seed <= 8; seed++) {
        struct rooms r = visit(seed);
        struct bed bed = bed_with(&with);
        cairn_virtual_align_result result;

        add_rooms(&bed, &r);
        run(bed.align, CAIRN_UNBOUNDED);
        result = cairn_virtual_align_read(bed.align);
        right_with += right(&r, bed.align) == SCANS;
        assert_in_range(result.rounds, 0, 2);
        assert_int_equal(result.iterations % with.field.max_steps, 0);
        assert_int_equal(result.active_iterations, result.iterations);
        assert_true(result.align_units > 0);
        assert_int_equal(result.hypotheses > 0, result.rounds > 0);
        assert_int_equal(result.hypothesis_units > result.weak_direction.units + 2 * SCANS + 1,
                         result.rounds > 0);
        assert_true(result.field_units > 0);
        test_pool_free(&bed.pool);
        bed = bed_with(&without);
        add_rooms(&bed, &r);
        run(bed.align, CAIRN_UNBOUNDED);
        right_without += right(&r, bed.align) == SCANS;
        assert_int_equal(cairn_virtual_align_read(bed.align).active_iterations, 0);
        test_pool_free(&bed.pool);
        leave(&r);
    }
    assert_true(right_with >= 6);
    assert_true(right_with >= right_without);
}

/* Scans anchored by the aligner do not move. */
static void settled_scans_stay(void **state)
{
    cairn_virtual_align_params p = hesitant_params();
    struct rooms r = visit(5);
    struct bed bed;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_pose at[SCANS];
    int32_t moves[SCANS], moved = 0;

    (void)state;
    p.max_rounds = 1;
    bed = bed_with(&p);
    add_rooms(&bed, &r);
    for (int32_t i = 0; i < SCANS; i++)
        assert_near(cairn_virtual_align_pose_of(bed.align, i).aligned.map_scan.x, r.start[i].x, 0);
    assert_ok(cairn_virtual_align_begin(bed.align));
    assert_true(cairn_virtual_align_running(bed.align));
    assert_ok(cairn_virtual_align_iterate(bed.align, &budget)); /* the aligner */
    for (int32_t i = 0; i < SCANS; i++)
        at[i] = cairn_aligner_pose_of(cairn_virtual_align_aligner(bed.align), i).map_scan;
    for (int32_t k = 0; k < p.field.max_steps; k++) {
        budget.left = CAIRN_UNBOUNDED;
        assert_ok(cairn_virtual_align_iterate(bed.align, &budget));
        assert_int_equal(cairn_virtual_align_read(bed.align).iterations, k + 1);
        for (int32_t i = 0; i < SCANS; i++) {
            cairn_virtual_align_pose pose = cairn_virtual_align_pose_of(bed.align, i);

            moves[i] = pose.moved;
            if (k > 5)
                assert_int_equal(pose.aligned.map_scan.x != at[i].x, pose.moved);
        }
    }
    for (int32_t i = 0; i < SCANS; i++) {
        moved += moves[i];
        assert_int_equal(
            moves[i], !cairn_aligner_pose_of(cairn_virtual_align_aligner(bed.align), i).anchored);
    }
    assert_int_equal(moved, cairn_virtual_align_read(bed.align).moved_scans);
    assert_in_range(moved, 1, SCANS - 2);
    assert_true(cairn_virtual_align_running(bed.align));
    test_pool_free(&bed.pool);
    leave(&r);
}

static void the_budget_does_not_matter(void **state)
{
    static const int32_t budgets[] = {CAIRN_UNBOUNDED, 7, 1000};
    cairn_virtual_align_params p = hesitant_params();
    struct rooms r = visit(5);
    struct bed bed;
    cairn_pose first[SCANS];
    int64_t units = 0;

    (void)state;
    p.field.max_steps = 7;
    p.rebuild_interval = 2;
    bed = bed_with(&p);
    add_rooms(&bed, &r);
    for (int k = 0; k < 3; k++) {
        cairn_virtual_align_result result;

        run(bed.align, budgets[k]); /* again from the same start */
        result = cairn_virtual_align_read(bed.align);
        for (int32_t i = 0; i < SCANS; i++) {
            cairn_pose pose = cairn_virtual_align_pose_of(bed.align, i).aligned.map_scan;

            if (k == 0)
                first[i] = pose;
            assert_memory_equal(&pose, &first[i], sizeof pose);
        }
        if (k == 0)
            units = result.hypothesis_units;
        assert_int_equal(result.hypothesis_units, units);
    }
    test_pool_free(&bed.pool);
    leave(&r);
}

/* Begun anew in the middle of an iteration, and with one more scan: as if nothing had run
 * before. */
static void can_be_begun_anew(void **state)
{
    cairn_virtual_align_params p = hesitant_params();
    struct rooms r = visit(5);
    struct bed bed, fresh;

    (void)state;
    p.field.max_steps = 5;
    bed = bed_with(&p);
    fresh = bed_with(&p);
    add_rooms(&fresh, &r);
    run(fresh.align, CAIRN_UNBOUNDED);
    add_rooms(&bed, &r);
    assert_ok(cairn_virtual_align_begin(bed.align));
    for (int32_t k = 0; cairn_virtual_align_read(bed.align).iterations < 2 || k % 1000 != 3; k++) {
        cairn_budget budget = {100};

        assert_true(k < 10000000);
        if (cairn_virtual_align_step(bed.align, &budget) == CAIRN_OK)
            break;
    }
    run(bed.align, 1000);
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_pose a = cairn_virtual_align_pose_of(bed.align, i).aligned.map_scan;
        cairn_pose b = cairn_virtual_align_pose_of(fresh.align, i).aligned.map_scan;

        assert_memory_equal(&a, &b, sizeof a);
    }
    cairn_virtual_align_clear(bed.align);
    assert_status(cairn_virtual_align_begin(bed.align), CAIRN_EMPTY);
    assert_near(cairn_virtual_align_pose_of(bed.align, 0).aligned.covariance[0], 0, 0);
    add_rooms(&bed, &r);
    run(bed.align, CAIRN_UNBOUNDED);
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_pose a = cairn_virtual_align_pose_of(bed.align, i).aligned.map_scan;
        cairn_pose b = cairn_virtual_align_pose_of(fresh.align, i).aligned.map_scan;

        assert_memory_equal(&a, &b, sizeof a);
    }
    test_pool_free(&bed.pool);
    test_pool_free(&fresh.pool);
    leave(&r);
}

/* Without the aligner all scans move from their initial poses. */
static void the_field_alone(void **state)
{
    cairn_virtual_align_params p = hesitant_params();
    struct rooms r = visit(5);
    struct bed bed;
    cairn_virtual_align_result result;

    (void)state;
    p.use_aligner = 0;
    bed = bed_with(&p);
    add_rooms(&bed, &r);
    run(bed.align, CAIRN_UNBOUNDED);
    result = cairn_virtual_align_read(bed.align);
    assert_int_equal(result.moved_scans, SCANS);
    assert_int_equal(result.rounds, 1);
    assert_int_equal(result.iterations, p.field.max_steps);
    assert_int_equal(result.align_units, 0);
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_pose a = cairn_virtual_align_pose_of(bed.align, i).aligned.map_scan;
        cairn_pose b = cairn_force_field_pose(cairn_virtual_align_field(bed.align), i);

        assert_memory_equal(&a, &b, sizeof a);
        assert_true(a.x != r.start[i].x);
    }
    test_pool_free(&bed.pool);
    leave(&r);
}

/* Scans without information, or without common surfaces. */
static void little_to_align(void **state)
{
    cairn_virtual_align_params p = small_params();
    struct bed bed = bed_with(&p);
    cairn_scan_view empty;
    cairn_pose pose = {1, 2, CAIRN_REAL(0.5)};
    int32_t no_points = 0;

    (void)state;
    memset(&empty, 0, sizeof empty);
    empty.first_point = &no_points;
    assert_status(cairn_virtual_align_begin(bed.align), CAIRN_EMPTY);
    for (int32_t count = 1; count < 4; count++) {
        assert_ok(cairn_virtual_align_add_scan(bed.align, &empty, pose, NULL));
        run(bed.align, CAIRN_UNBOUNDED);
        for (int32_t i = 0; i < count; i++) {
            cairn_virtual_align_pose got = cairn_virtual_align_pose_of(bed.align, i);

            assert_near(got.aligned.map_scan.x, 1, 1e-6);
            assert_near(got.aligned.map_scan.theta, 0.5, 1e-6);
        }
        assert_int_equal(cairn_virtual_align_read(bed.align).active_iterations, 0);
    }
    assert_near(cairn_virtual_align_pose_of(bed.align, 3).aligned.map_scan.x, 0, 0);
    assert_near(cairn_virtual_align_pose_of(bed.align, -1).aligned.map_scan.x, 0, 0);
    test_pool_free(&bed.pool);
}

/* ---- Reference implementation: aligner, field and hypotheses called one by one ---- */

struct reference {
    cairn_aligner_pose kept[SCANS];
    cairn_virtual_align_params p;
    cairn_pool pool;
    cairn_aligner *aligner;
    cairn_force_field *field;
    cairn_virtual_scan *hypotheses;
    cairn_weak_direction *weak_direction;
    cairn_real spread;
    const cairn_pose *start;
    cairn_virtual_align_result result;
    int32_t count, moves[SCANS], resumed;
    cairn_pose found[SCANS];
};

static struct reference reference_of(const cairn_virtual_align_params *p, const struct rooms *r)
{
    struct reference t;

    memset(&t, 0, sizeof t);
    t.p = *p;
    t.count = SCANS;
    t.p.field.max_scans = t.p.hypotheses.max_scans = p->aligner.max_scans;
    t.p.field.max_segments = t.p.hypotheses.max_segments = p->aligner.max_segments;
    t.p.field.max_points = t.p.hypotheses.max_points = p->aligner.max_points;
    t.p.field.max_extra = p->hypotheses.max_virtual;
    t.p.field.max_bonds = SCANS * (SCANS + 1) / 2;
    t.pool = test_pool(cairn_aligner_memory(&t.p.aligner) + cairn_force_field_memory(&t.p.field) +
                       cairn_virtual_scan_memory(&t.p.hypotheses) +
                       cairn_weak_direction_memory(&t.p.weak_direction));
    t.start = r->start;
    assert_ok(cairn_aligner_create(&t.aligner, &t.pool, &t.p.aligner));
    assert_ok(cairn_force_field_create(&t.field, &t.pool, &t.p.field));
    assert_ok(cairn_virtual_scan_create(&t.hypotheses, &t.pool, &t.p.hypotheses));
    assert_ok(cairn_weak_direction_create(&t.weak_direction, &t.pool, &t.p.weak_direction));
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_scan_view view = view_of(r, i);

        assert_ok(cairn_aligner_add_scan(t.aligner, &view, r->start[i], NULL));
        assert_ok(cairn_force_field_add_scan(t.field, &view, NULL, r->start[i], NULL));
    }
    return t;
}

static void reference_steps_aligner(struct reference *t)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_aligner_step(t->aligner, &budget));
    t->result.align_units += CAIRN_UNBOUNDED - budget.left;
}

static void reference_aligns(struct reference *t)
{
    assert_ok(cairn_aligner_begin(t->aligner));
    reference_steps_aligner(t);
}

static void reference_keeps(struct reference *t)
{
    t->result.aligner = cairn_aligner_read(t->aligner);
    for (int32_t i = 0; i < t->count; i++) {
        t->kept[i] = cairn_aligner_pose_of(t->aligner, i);
        t->found[i] = t->kept[i].map_scan;
    }
    t->result.field_units += 2 * (int64_t)t->count;
}

/* m of wall across the main direction of a scan, by trying all directions. */
static double reference_across(const struct reference *t, int32_t scan)
{
    const cairn_scan_set *set = cairn_force_field_scans(t->field);
    double least = (double)INFINITY;

    for (int turn = 0; turn < 1800; turn++) {
        double angle = turn * 0.1 * DEGREE, sum = 0;

        for (int32_t k = set->scans[scan].first_segment; k < set->scans[scan].end_segment; k++) {
            cairn_segment s = set->segments[k].segment;
            double across = cos(angle) * (double)set->segments[k].direction.y -
                            sin(angle) * (double)set->segments[k].direction.x;

            sum += (double)cairn_segment_length(s) * across * across;
        }
        least = fmin(least, sum);
    }
    return least;
}

/* 1 when the aligner continues from its result. */
static int reference_continues(const struct reference *t)
{
    return t->result.aligner.anchored >= 2 && t->result.aligner.largest_size >= 3;
}

/* Scans anchored before stay, with their new covariances; the new ones move with the mean motion of
 * those. */
static void reference_takes_in(struct reference *t)
{
    cairn_pose now[SCANS], then[SCANS], motion;
    int32_t use[SCANS];

    for (int32_t i = 0; i < t->count; i++) {
        now[i] = cairn_aligner_pose_of(t->aligner, i).map_scan;
        then[i] = t->kept[i].map_scan;
        use[i] = t->kept[i].anchored;
    }
    motion = cairn_pose_fit(now, then, use, t->count, 1);
    for (int32_t i = 0; i < t->count; i++) {
        if (!use[i] || cairn_aligner_pose_of(t->aligner, i).anchored) {
            t->kept[i] = cairn_aligner_pose_of(t->aligner, i);
            t->kept[i].map_scan = use[i] ? then[i] : cairn_pose_compose(motion, now[i]);
        }
        t->found[i] = t->kept[i].map_scan;
    }
    t->result.aligner = cairn_aligner_read(t->aligner);
    t->result.field_units += 1 + (int64_t)t->count;
    t->resumed++;
}

/* 1: the aligner has anchored more than before; else scans that share nothing with its largest
 * component stay where the field left them. */
static int reference_verdict(struct reference *t)
{
    if (cairn_aligner_read(t->aligner).anchored > t->result.aligner.anchored) {
        if (reference_continues(t))
            reference_takes_in(t);
        else
            reference_keeps(t);
        return 1;
    }
    for (int32_t i = 0; i < t->count; i++) {
        t->moves[i] = t->moves[i] && (t->result.aligner.anchored < 2 || t->kept[i].component != 0);
        if (!t->moves[i])
            t->found[i] = t->kept[i].map_scan;
    }
    t->result.field_units += 1 + t->count / 2;
    return 0;
}

/* Fixed are the scans that the aligner has anchored together with another one. */
static void reference_places(struct reference *t)
{
    t->result.moved_scans = 0;
    for (int32_t i = 0; i < t->count; i++) {
        cairn_aligner_pose at = t->kept[i];

        t->moves[i] = !t->p.use_aligner || t->result.aligner.anchored < 2 ||
                      (!at.anchored && !cairn_weak_direction_is_weak(t->weak_direction, &at) &&
                       reference_across(t, i) >= 0.1);
        t->result.field_units += 2 + (cairn_force_field_scans(t->field)->scans[i].end_segment -
                                      cairn_force_field_scans(t->field)->scans[i].first_segment) /
                                         4;
        t->result.moved_scans += t->moves[i];
        assert_ok(cairn_force_field_place(t->field, i, at.map_scan));
        assert_ok(cairn_force_field_fix(t->field, i, !t->moves[i]));
        t->found[i] = at.map_scan;
    }
    cairn_force_field_restart(t->field);
}

static void reference_makes_hypotheses(struct reference *t, cairn_real sigma)
{
    const cairn_scan_set *set = cairn_force_field_scans(t->field);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    const cairn_oriented_point *points;
    const cairn_real *weights;
    int32_t count;

    assert_ok(cairn_virtual_scan_begin(t->hypotheses, sigma));
    for (int32_t i = 0; i < t->count; i++) {
        if (t->result.aligner.anchored < 2 || !t->p.use_aligner || !t->moves[i])
            assert_ok(cairn_virtual_scan_add_scan(t->hypotheses, set, i,
                                                  cairn_force_field_pose(t->field, i)));
        t->result.hypothesis_units += 1 + (set->scans[i].end_point - set->scans[i].first_point) / 4;
    }
    assert_ok(cairn_virtual_scan_step(t->hypotheses, &budget));
    points = cairn_virtual_scan_points(t->hypotheses, &weights, &count);
    assert_ok(cairn_force_field_set_extra(t->field, points, weights, count));
    t->result.hypothesis_units += CAIRN_UNBOUNDED - budget.left + 1 + count / 8;
    (void)cairn_virtual_scan_hypotheses(t->hypotheses, &t->result.hypotheses);
}

/* One round of the field; the moved scans stay at its poses. */
static void reference_relaxes(struct reference *t)
{
    t->result.rounds++;
    for (int32_t since = 0;
         since == 0 || cairn_force_field_read(t->field).verdict == CAIRN_FORCE_FIELD_RUNNING;
         since++) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        if (since == 0 || (since % t->p.rebuild_interval == 0 &&
                           (!t->p.use_aligner || t->result.aligner.anchored < 2)))
            reference_makes_hypotheses(t, since == 0 ? t->p.field.sigma_start
                                                     : cairn_force_field_read(t->field).sigma);
        assert_ok(cairn_force_field_iterate(t->field, &budget));
        t->result.field_units += CAIRN_UNBOUNDED - budget.left;
        t->result.iterations++;
        t->result.active_iterations += t->result.hypotheses > 0 && t->p.hypotheses.weight > 0;
    }
    for (int32_t i = 0; i < t->count; i++)
        t->found[i] = cairn_force_field_pose(t->field, i);
}

static void reference_starts_again(struct reference *t)
{
    t->result.field_units += 1 + (int64_t)t->count;
    if (reference_continues(t)) {
        assert_ok(cairn_aligner_begin_warm(t->aligner, t->found));
        reference_steps_aligner(t);
        return;
    }
    for (int32_t i = 0; i < t->count; i++)
        assert_ok(cairn_aligner_set_initial_pose(t->aligner, i, t->found[i]));
    reference_aligns(t);
}

static void reference_places_and_relaxes(struct reference *t)
{
    if (t->p.use_aligner)
        reference_aligns(t);
    t->spread = cairn_aligner_read(t->aligner).initial_sigma;
    reference_keeps(t);
    for (;;) {
        reference_places(t);
        if (t->result.moved_scans == 0)
            return;
        reference_relaxes(t);
        if (!t->p.use_aligner)
            return;
        reference_starts_again(t);
        if (!reference_verdict(t) || t->result.rounds >= t->p.max_rounds)
            return;
    }
}

/* Last, weakly constrained components are translated, where anything was aligned. */
static void reference_translates(struct reference *t)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_weak_direction_begin(t->weak_direction, t->aligner,
                                         cairn_force_field_scans(t->field), t->spread));
    for (int32_t i = 0; i < t->count; i++) {
        cairn_aligner_pose aligned = t->kept[i];

        aligned.map_scan = t->found[i];
        assert_ok(cairn_weak_direction_add(t->weak_direction, t->start[i], &aligned));
    }
    assert_ok(cairn_weak_direction_step(t->weak_direction, &budget));
    for (int32_t i = 0; i < t->count; i++) {
        cairn_vec2 shift = cairn_weak_direction_translation(t->weak_direction, i);

        t->found[i].x += shift.x;
        t->found[i].y += shift.y;
        t->moves[i] |= shift.x != 0 || shift.y != 0;
    }
    t->result.weak_direction = cairn_weak_direction_read(t->weak_direction);
    t->result.hypothesis_units += CAIRN_UNBOUNDED - budget.left;
    t->result.hypothesis_units += 2 * (int64_t)t->count + 1 + t->count / 8;
}

static void reference_runs(struct reference *t)
{
    reference_places_and_relaxes(t);
    if (t->p.use_aligner && t->result.aligner.anchored >= 2)
        reference_translates(t);
}

static void assert_same(const struct reference *t, const cairn_virtual_align *align)
{
    cairn_virtual_align_result result = cairn_virtual_align_read(align);

    assert_int_equal(result.rounds, t->result.rounds);
    assert_int_equal(result.moved_scans, t->result.moved_scans);
    assert_int_equal(result.iterations, t->result.iterations);
    assert_int_equal(result.active_iterations, t->result.active_iterations);
    assert_int_equal(result.hypotheses, t->result.hypotheses);
    assert_int_equal(result.align_units, t->result.align_units);
    assert_int_equal(result.hypothesis_units, t->result.hypothesis_units);
    assert_int_equal(result.field_units, t->result.field_units);
    assert_int_equal(result.aligner.anchored, t->result.aligner.anchored);
    assert_memory_equal(&result.weak_direction, &t->result.weak_direction,
                        sizeof result.weak_direction);
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_virtual_align_pose pose = cairn_virtual_align_pose_of(align, i);

        assert_memory_equal(&pose.aligned.map_scan, &t->found[i], sizeof t->found[i]);
        assert_memory_equal(pose.aligned.covariance, t->kept[i].covariance,
                            sizeof pose.aligned.covariance);
        assert_int_equal(pose.aligned.placed, t->kept[i].placed);
        assert_int_equal(pose.moved, t->moves[i]);
    }
}

static void does_what_is_done_by_hand(void **state)
{
    static const struct {
        int32_t align, every, steps, rounds, hesitant;
        double weight, fov;
        uint64_t seed;
        int32_t narrow;
    } cases[] = {{0, 1, 4, 1, 0, 3, 360, 5, SCANS},  {0, 2, 5, 1, 0, 0, 360, 5, SCANS},
                 {1, 3, 4, 1, 1, 3, 360, 5, SCANS},  {1, 2, 3, 3, 1, 2, 360, 5, SCANS},
                 {1, 3, 4, 2, 0, 3, 360, 5, SCANS},  {1, 4, 4, 2, 2, 1, 360, 5, SCANS},
                 {1, 3, 4, 2, 0, 3, 180, 10, SCANS}, {1, 3, 4, 2, 0, 3, 360, 5, 2},
                 {1, 3, 4, 2, 0, 3, 360, 16, SCANS}};
    int32_t slid = 0, stayed = 0, resumed = 0;

    (void)state;
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        cairn_virtual_align_params p = cases[k].hesitant > 0 ? hesitant_params() : small_params();
        struct rooms r = visit_with(cases[k].seed, cases[k].fov);
        struct bed bed;
        struct reference t;

        r.narrow = cases[k].narrow;
        if (cases[k].hesitant == 2)
            p.aligner.min_log_likelihood_ratio = 1000; /* no scan is anchored with another */
        p.use_aligner = cases[k].align;
        p.rebuild_interval = cases[k].every;
        p.field.max_steps = cases[k].steps;
        p.max_rounds = cases[k].rounds;
        p.hypotheses.weight = (cairn_real)cases[k].weight;
        t = reference_of(&p, &r);
        reference_runs(&t);
        bed = bed_with(&p);
        add_rooms(&bed, &r);
        run(bed.align, 1000);
        assert_same(&t, bed.align);
        slid += t.result.weak_direction.translated_scans;
        resumed += t.resumed;
        if (r.narrow < SCANS)
            stayed += !t.kept[r.narrow].anchored &&
                      !cairn_weak_direction_is_weak(t.weak_direction, &t.kept[r.narrow]) &&
                      !t.moves[r.narrow];
        test_pool_free(&t.pool);
        test_pool_free(&bed.pool);
        leave(&r);
    }
    assert_true(slid > 0);
    assert_true(stayed > 0);
    assert_true(resumed > 0);
}

/* ---- Refusals ---- */

static void bad_calls_are_refused(void **state)
{
    static const char *const modules[] = {"virtual_align", "virtual_align", "aligner",
                                          "force_field",   "virtual_scan",  "virtual_align",
                                          "weak_direction"};
    cairn_object_fault refused;
    cairn_virtual_align_params p = small_params(), bad;
    cairn_pool pool = test_pool(cairn_virtual_align_memory(&p));
    cairn_virtual_align *align = NULL;
    cairn_scan_view empty;
    cairn_pose pose = {0, 0, 0}, nan = {0, (cairn_real)NAN, 0};
    cairn_budget budget = {1};
    cairn_fault fault;
    int32_t no_points = 0;

    (void)state;
    for (int32_t i = 0; i < 7; i++) {
        bad = p;
        bad.rebuild_interval = i == 0 ? 0 : 1;
        bad.max_rounds = i == 1 ? 0 : 1;
        bad.aligner.max_scans = i == 2 ? 0 : 4;
        bad.field.sigma_end = i == 3 ? 0 : bad.field.sigma_end;
        bad.hypotheses.stride = i == 4 ? 0 : 1;
        bad.weak_direction.translation_step = i == 6 ? 0 : 1;
        assert_status(cairn_virtual_align_check(i == 5 ? NULL : &bad, &refused),
                      CAIRN_BAD_ARGUMENT);
        assert_string_equal(refused.module, modules[i]);
        assert_int_equal(cairn_virtual_align_memory(i == 5 ? NULL : &bad), 0);
        assert_status(cairn_virtual_align_create(&align, &pool, i == 5 ? NULL : &bad),
                      CAIRN_BAD_ARGUMENT);
        assert_int_equal(pool.used, 0);
    }
    assert_status(cairn_virtual_align_create(NULL, &pool, &p), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_align_create(&align, NULL, &p), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_virtual_align_create(&align, &pool, &p));
    assert_int_equal(pool.used, cairn_virtual_align_memory(&p));
    assert_ok(cairn_virtual_align_step(align, &budget)); /* nothing was begun */
    assert_ok(cairn_virtual_align_iterate(align, &budget));
    assert_status(cairn_virtual_align_begin(NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_align_add_detector(NULL, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_align_add_detector(align, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_align_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_align_step(align, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_align_iterate(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_align_iterate(align, NULL), CAIRN_BAD_ARGUMENT);
    memset(&empty, 0, sizeof empty);
    empty.first_point = &no_points;
    assert_status(cairn_virtual_align_add_scan(NULL, &empty, pose, &fault), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_align_add_scan(align, NULL, pose, &fault), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_align_add_scan(align, &empty, nan, &fault), CAIRN_NOT_FINITE);
    for (int32_t i = 0; i < 8; i++)
        assert_ok(cairn_virtual_align_add_scan(align, &empty, pose, &fault));
    assert_status(cairn_virtual_align_add_scan(align, &empty, pose, &fault), CAIRN_FULL);
    assert_non_null(fault.message);
    test_pool_free(&pool);

    p.aligner.max_scans = 2;
    p.aligner.max_segments = p.aligner.max_points = 5;
    p.aligner.max_hypotheses = p.aligner.max_fill = 4;
    p.aligner.max_cells = 64;
    p.hypotheses.max_virtual = 6;
    p.weak_direction.max_walls = p.weak_direction.max_submaps = 2;
    p.hypotheses.hough.angles = p.hypotheses.hough.distances = 8;
    p.hypotheses.rectangle.max_pairs = p.hypotheses.rectangle.max_sides = 4;
    test_every_pool_size(create, &p, cairn_virtual_align_memory(&p));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rooms_come_together),
        cmocka_unit_test(settled_scans_stay),
        cmocka_unit_test(the_budget_does_not_matter),
        cmocka_unit_test(can_be_begun_anew),
        cmocka_unit_test(the_field_alone),
        cmocka_unit_test(little_to_align),
        cmocka_unit_test(does_what_is_done_by_hand),
        cmocka_unit_test(bad_calls_are_refused),
    };

    return cmocka_run_group_tests_name("virtual_align", tests, open_scan, close_scan);
}
