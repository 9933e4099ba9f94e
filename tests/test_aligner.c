/* The aligner on simulated arenas, on rooms drawn by hand, and on uninformative scans; refusals and
 * budgets. */
#include "tests/test.h"

#include <math.h>

#include "bench/bench_bound.h"
#include "bench/bench_score.h"
#include "cairn/aligner.h"
#include "sim/arena.h"
#include "tests/rooms.h"

#define DEGREE 0.017453292519943295

enum { MAX_SCANS = 64 };

/* An aligner with its inputs and pool. */
struct bed {
    cairn_pool pool;
    cairn_aligner_params params;
    cairn_aligner *aligner;
};

static cairn_aligner_params params_for(int32_t scans)
{
    cairn_aligner_params params = cairn_aligner_default();

    params.max_scans = scans;
    params.max_segments = 32 * scans;
    params.max_points = 400 * scans;
    params.max_hypotheses = 24 * scans;
    params.max_fill = 32 * scans;
    return params;
}

static struct bed make_bed(const cairn_aligner_params *params)
{
    struct bed bed = {test_pool(cairn_aligner_memory(params)), *params, NULL};

    assert_ok(cairn_aligner_create(&bed.aligner, &bed.pool, params));
    return bed;
}

static void end_bed(struct bed *bed)
{
    test_pool_free(&bed->pool);
}

/* ---- Scans ---- */

static cairn_pool scan_pool;
static cairn_scan *scan_object;

static int open_scan(void **state)
{
    cairn_scan_params params = cairn_scan_default();

    (void)state;
    scan_pool = test_pool(cairn_scan_memory(&params));
    assert_ok(cairn_scan_create(&scan_object, &scan_pool, &params));
    return 0;
}

static int close_scan(void **state)
{
    (void)state;
    test_pool_free(&scan_pool);
    return 0;
}

static cairn_scan_view fit(const cairn_scan_input *input)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_scan_begin(scan_object, input, NULL));
    assert_ok(cairn_scan_step(scan_object, &budget));
    return cairn_scan_read(scan_object);
}

static void add(struct bed *bed, const cairn_scan_input *input, cairn_pose start)
{
    cairn_scan_view view = fit(input);
    cairn_fault fault;

    assert_ok(cairn_aligner_add_scan(bed->aligner, &view, start, &fault));
    assert_null(fault.message);
}

static void run(struct bed *bed, int32_t budget)
{
    cairn_budget left = {budget};
    cairn_status status;

    assert_ok(cairn_aligner_begin(bed->aligner));
    while ((status = cairn_aligner_step(bed->aligner, &left)) == CAIRN_MORE)
        left.left = budget;
    assert_ok(status);
}

static int all_finite(const cairn_aligner_pose *p)
{
    int finite = isfinite((double)p->map_scan.x) && isfinite((double)p->map_scan.y) &&
                 isfinite((double)p->map_scan.theta) && isfinite((double)p->support);

    for (int k = 0; k < 9; k++)
        finite = finite && isfinite((double)p->covariance[k]);
    return finite;
}

/* ---- Arenas ---- */

struct survey {
    sim_arena *arena;
    sim_survey *survey;
    const sim_scan *scans;
    int32_t count;
    cairn_pose start[MAX_SCANS];
    bench_bound bounds[MAX_SCANS];
};

static struct survey visit(uint64_t seed, int32_t places, int32_t headings, double fov,
                           double metres, double degrees)
{
    sim_arena_options arena = sim_arena_default();
    sim_survey_options options = sim_survey_default();
    cairn_random random = cairn_random_seed(seed, 3);
    struct survey s;

    memset(&s, 0, sizeof s);
    arena.seed = seed;
    options.seed = seed;
    options.places = places;
    options.headings = headings;
    options.fov = fov * DEGREE;
    s.arena = sim_arena_create(&arena, NULL, 0);
    assert_non_null(s.arena);
    s.survey = sim_survey_create(s.arena, &options, NULL, 0);
    assert_non_null(s.survey);
    s.scans = sim_survey_scans(s.survey, &s.count);
    assert_true(s.count <= MAX_SCANS);
    for (int32_t i = 0; i < s.count; i++) {
        sim_pose truth = s.scans[i].truth;

        s.start[i].x =
            (cairn_real)truth.x + cairn_random_uniform(&random, -1, 1) * (cairn_real)metres;
        s.start[i].y =
            (cairn_real)truth.y + cairn_random_uniform(&random, -1, 1) * (cairn_real)metres;
        s.start[i].theta =
            cairn_wrap_angle((cairn_real)truth.theta +
                             cairn_random_uniform(&random, -1, 1) * (cairn_real)(degrees * DEGREE));
    }
    assert_true(
        bench_bound_compute(s.arena, s.scans, s.count, metres, degrees * DEGREE, s.bounds) >= 0);
    return s;
}

static void leave(struct survey *s)
{
    sim_survey_free(s->survey);
    sim_arena_free(s->arena);
}

/* All scans, beginning with the `from`-th. */
static void add_all(struct bed *bed, const struct survey *s, int32_t from)
{
    for (int32_t k = 0; k < s->count; k++) {
        int32_t i = (k + from) % s->count;
        cairn_scan_input input = sim_scan_input(&s->scans[i]);

        add(bed, &input, s->start[i]);
    }
}

struct outcome {
    int32_t observable, aligned, flagged, missed, unflagged, inside;
};

/* Errors of the poses relative to the truth, of scans shifted by `from`. */
static struct outcome compare(const struct bed *bed, const struct survey *s, int32_t from)
{
    sim_pose truth[MAX_SCANS], poses[MAX_SCANS];
    int32_t use[MAX_SCANS], anchor = cairn_aligner_read(bed->aligner).anchor;
    cairn_aligner_pose results[MAX_SCANS];
    struct outcome out;

    memset(&out, 0, sizeof out);
    for (int32_t k = 0; k < s->count; k++) {
        int32_t i = (k + from) % s->count;

        results[i] = cairn_aligner_pose_of(bed->aligner, k);
        assert_true(all_finite(&results[i]));
        truth[i] = s->scans[i].truth;
        poses[i].x = (double)results[i].map_scan.x;
        poses[i].y = (double)results[i].map_scan.y;
        poses[i].theta = (double)results[i].map_scan.theta;
        use[i] = s->bounds[i].observable;
    }
    (void)bench_fit_common(truth, poses, use, s->count, 0.05, DEGREE, poses);
    for (int32_t i = 0; i < s->count; i++) {
        const cairn_real *c = results[i].covariance;
        double x = poses[i].x - truth[i].x, y = poses[i].y - truth[i].y;
        double det = (double)(c[0] * c[4] - c[1] * c[1]);

        out.observable += use[i];
        out.aligned += use[i] && bench_pose_near(truth[i], poses[i], 0.05, DEGREE);
        out.flagged += use[i] && !results[i].placed;
        out.missed += !use[i] && results[i].placed;
        if (!results[i].placed || i == (anchor + from) % s->count)
            continue;
        assert_true(c[0] > 0 && c[4] > 0 && c[8] > 0 && det > 0);
        out.unflagged++;
        out.inside +=
            ((double)c[4] * x * x - 2 * (double)c[1] * x * y + (double)c[0] * y * y) / det < 9.21;
    }
    return out;
}

static void aligns_an_arena(void **state)
{
    struct survey s = visit(2001, 15, 4, 100, 0.3, 20);
    cairn_aligner_params params = params_for(s.count);
    struct bed bed = make_bed(&params);
    cairn_aligner_result result;
    struct outcome out;

    (void)state;
    add_all(&bed, &s, 0);
    run(&bed, CAIRN_UNBOUNDED);
    out = compare(&bed, &s, 0);
    result = cairn_aligner_read(bed.aligner);
    assert_true(out.aligned >= 0.90 * out.observable);
    assert_true(out.flagged <= 0.10 * out.observable);
    assert_true(out.missed <= 1);
    assert_true(out.inside >= 0.6 * out.unflagged);
    assert_true(result.verdict != CAIRN_ALIGNER_RUNNING);
    assert_true(result.largest_size >= 54 && result.largest_size <= 60);
    assert_true(result.placed <= result.largest_size && result.placed >= 50);
    assert_true(result.components >= 1 && result.components <= 60 - result.largest_size + 1);
    assert_true(result.walls > 60 && result.fill >= result.walls && result.merges > 30);
    assert_true(result.hypotheses > 500 && result.hypotheses <= params.max_hypotheses);
    assert_true(result.iterations >= 7 && result.iterations <= 3 * params.max_iterations);
    assert_true(result.anchor >= 0 && result.anchor < 60);
    assert_near(result.initial_sigma, 0.3 / sqrt(3.0), 0.06);
    assert_near((double)result.initial_sigma_theta / DEGREE, 20 / sqrt(3.0), 4);
    assert_true(result.worst_step <= 200 && result.units > 100000);
    end_bed(&bed);
    leave(&s);
}

/* Every arena has scans of one wall, oblique to the axes of the map; they must not cost the others
 * their joint solution in float. */
static void unobservable_scans_spoil_no_solution(void **state)
{
    (void)state;
    for (uint64_t seed = 2003; seed < 2009; seed++) {
        struct survey s = visit(seed, 15, 4, 100, 0.3, 20);
        cairn_aligner_params params = params_for(s.count);
        struct bed bed = make_bed(&params);
        cairn_aligner_result result;

        add_all(&bed, &s, 0);
        run(&bed, CAIRN_UNBOUNDED);
        result = cairn_aligner_read(bed.aligner);
        assert_true(result.iterations >= 7 && result.anchor >= 0);
        end_bed(&bed);
        leave(&s);
    }
}

/* The scans of a survey, once, and four times far from each other. Returns the units of the
 * alignment. */
static int64_t units_of_copies(const struct survey *s, int32_t copies, int32_t *worst_step)
{
    cairn_aligner_params params = params_for(MAX_SCANS);
    struct bed bed = make_bed(&params);
    cairn_aligner_result result;

    for (int32_t copy = 0; copy < copies; copy++)
        for (int32_t i = 0; i < s->count; i++) {
            cairn_scan_input input = sim_scan_input(&s->scans[i]);
            cairn_pose start = s->start[i];

            start.x += (cairn_real)(60 * copy);
            add(&bed, &input, start);
        }
    run(&bed, CAIRN_UNBOUNDED);
    result = cairn_aligner_read(bed.aligner);
    assert_int_equal(cairn_aligner_scan_count(bed.aligner), copies * s->count);
    assert_true(copies == 1 || result.components >= copies);
    *worst_step = result.worst_step;
    end_bed(&bed);
    return result.units;
}

static void cost_grows_with_the_scans(void **state)
{
    struct survey s = visit(2001, 4, 4, 100, 0.3, 20);
    int32_t worst_one, worst_four;
    int64_t one = units_of_copies(&s, 1, &worst_one), four = units_of_copies(&s, 4, &worst_four);

    (void)state;
    assert_true(four <= 4 * one);
    assert_true(worst_one <= 200 && worst_four <= 200);
    leave(&s);
}

static void aligns_full_scans(void **state)
{
    struct survey s = visit(2002, 16, 1, 360, 0.5, 30);
    cairn_aligner_params params = params_for(s.count);
    struct bed bed = make_bed(&params);
    struct outcome out;

    (void)state;
    add_all(&bed, &s, 0);
    run(&bed, CAIRN_UNBOUNDED);
    out = compare(&bed, &s, 0);
    assert_true(out.aligned >= 0.95 * out.observable);
    assert_true(out.flagged <= 0.05 * out.observable);
    end_bed(&bed);
    leave(&s);
}

/* In another order of the scans sums round differently; the map is equally good. */
static void order_does_not_matter(void **state)
{
    struct survey s = visit(2001, 15, 4, 100, 0.3, 20);
    cairn_aligner_params params = params_for(s.count);
    struct bed a = make_bed(&params), b = make_bed(&params);
    struct outcome first, second;

    (void)state;
    add_all(&a, &s, 0);
    add_all(&b, &s, 7);
    run(&a, CAIRN_UNBOUNDED);
    run(&b, CAIRN_UNBOUNDED);
    first = compare(&a, &s, 0);
    second = compare(&b, &s, 7);
    assert_true(first.aligned >= 0.85 * first.observable &&
                second.aligned >= 0.85 * second.observable);
    end_bed(&a);
    end_bed(&b);
    leave(&s);
}

static uint64_t hash_of(const struct bed *bed)
{
    cairn_aligner_result result = cairn_aligner_read(bed->aligner);
    uint64_t hash = TEST_HASH_START;

    result.units = 0;
    for (int32_t i = 0; i < cairn_aligner_scan_count(bed->aligner); i++) {
        cairn_aligner_pose p = cairn_aligner_pose_of(bed->aligner, i);

        hash = test_hash(hash, &p.map_scan, sizeof p.map_scan);
        hash = test_hash(hash, p.covariance, sizeof p.covariance);
        hash = test_hash(hash, p.anchor_covariance, sizeof p.anchor_covariance);
        hash = test_hash(hash, &p.support, sizeof p.support);
        hash = test_hash(hash, &p.component, sizeof p.component);
        hash = test_hash(hash, &p.placed, sizeof p.placed);
        hash = test_hash(hash, &p.anchored, sizeof p.anchored);
    }
    hash = test_hash(hash, &result.verdict, sizeof result.verdict);
    return test_hash(hash, &result.walls, sizeof result.walls);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    struct survey s = visit(2004, 4, 4, 100, 0.3, 20);
    cairn_aligner_params params = params_for(s.count);
    struct bed bed = make_bed(&params);
    cairn_budget none = {0};
    uint64_t expected;
    int64_t units;

    (void)state;
    add_all(&bed, &s, 0);
    run(&bed, CAIRN_UNBOUNDED);
    expected = hash_of(&bed);
    units = cairn_aligner_read(bed.aligner).units;
    for (size_t k = 0; k < sizeof budgets / sizeof *budgets; k++) {
        run(&bed, budgets[k]);
        assert_true(hash_of(&bed) == expected);
        assert_true(llabs(cairn_aligner_read(bed.aligner).units - units) < units / 10);
    }
    assert_ok(cairn_aligner_begin(bed.aligner));
    assert_status(cairn_aligner_step(bed.aligner, &none), CAIRN_MORE);
    assert_int_equal(cairn_aligner_read(bed.aligner).verdict, CAIRN_ALIGNER_RUNNING);
    end_bed(&bed);
    leave(&s);
}

/* With one unit a call, the result is there when its last unit is charged, and not before. */
static void nothing_is_done_before_it_is_charged(void **state)
{
    struct survey s = visit(2004, 4, 4, 100, 0.3, 20);
    cairn_aligner_params params = params_for(s.count);
    struct bed bed = make_bed(&params);
    int64_t calls = 0;
    cairn_status status;

    (void)state;
    add_all(&bed, &s, 0);
    assert_ok(cairn_aligner_begin(bed.aligner));
    do {
        cairn_budget one = {1};
        cairn_aligner_result result;

        status = cairn_aligner_step(bed.aligner, &one);
        calls++;
        result = cairn_aligner_read(bed.aligner);
        assert_int_equal(result.verdict == CAIRN_ALIGNER_RUNNING, status == CAIRN_MORE);
        assert_int_equal(result.units, calls);
    } while (status == CAIRN_MORE);
    assert_ok(status);
    end_bed(&bed);
    leave(&s);
}

/* Hash of the state at every commit point; *commits: their number. */
static uint64_t watch(struct bed *bed, const struct survey *s, int32_t budget, int32_t *commits)
{
    int32_t count = cairn_aligner_scan_count(bed->aligner), parts = count, most = 0;
    uint64_t hash = TEST_HASH_START;

    *commits = 0;
    assert_ok(cairn_aligner_begin(bed->aligner));
    assert_int_equal(cairn_aligner_running(bed->aligner), 1);
    while (cairn_aligner_running(bed->aligner)) {
        cairn_budget left = {budget};
        int32_t size[MAX_SCANS] = {0};
        cairn_status status = cairn_aligner_iterate(bed->aligner, &left);

        assert_true(status == CAIRN_OK || (status == CAIRN_MORE && left.left == 0));
        if (status == CAIRN_MORE)
            continue;
        for (int32_t i = 0; i < count; i++) {
            int32_t part;
            cairn_pose pose = cairn_aligner_current_pose(bed->aligner, i, &part);

            assert_true(cairn_pose_is_finite(pose));
            assert_in_range(part, 0, count - 1);
            size[part]++;
            hash = test_hash(hash, &pose, sizeof pose);
            hash = test_hash(hash, &part, sizeof part);
            if (*commits == 0) {
                assert_int_equal(part, i);
                assert_near(pose.x, s->start[i].x, NUMBER(1e-9, 1e-5));
                assert_near(pose.theta, s->start[i].theta, NUMBER(1e-9, 1e-5));
            }
        }
        parts = 0;
        for (int32_t i = 0; i < count; i++) {
            parts += size[i] > 0;
            most = size[i] > most ? size[i] : most;
        }
        ++*commits;
    }
    assert_int_equal(parts, cairn_aligner_read(bed->aligner).components);
    assert_int_equal(most, cairn_aligner_read(bed->aligner).largest_size);
    return hash;
}

static void an_alignment_can_be_watched(void **state)
{
    struct survey s = visit(2004, 4, 4, 100, 0.3, 20);
    cairn_aligner_params params = params_for(s.count);
    struct bed bed = make_bed(&params);
    int32_t commits, again, part;
    uint64_t expected, hash;

    (void)state;
    add_all(&bed, &s, 0);
    assert_int_equal(cairn_aligner_running(bed.aligner), 0);
    (void)cairn_aligner_current_pose(bed.aligner, 3, &part);
    assert_int_equal(part, 3);
    run(&bed, CAIRN_UNBOUNDED);
    expected = hash_of(&bed);
    hash = watch(&bed, &s, CAIRN_UNBOUNDED, &commits);
    /* The same result, and more than one commit point for each scan joined. */
    assert_true(hash_of(&bed) == expected);
    assert_true(commits > s.count);
    assert_true(watch(&bed, &s, 7, &again) == hash);
    assert_int_equal(again, commits);
    for (int32_t i = 0; i < s.count; i++) {
        cairn_pose now = cairn_aligner_current_pose(bed.aligner, i, NULL);
        cairn_pose end = cairn_aligner_pose_of(bed.aligner, i).map_scan;

        assert_memory_equal(&now, &end, sizeof now);
    }
    assert_near(cairn_aligner_current_pose(bed.aligner, s.count, &part).x, 0, 0);
    assert_int_equal(part, -1);
    assert_near(cairn_aligner_current_pose(bed.aligner, -1, &part).theta, 0, 0);
    assert_int_equal(part, -1);
    assert_status(cairn_aligner_iterate(NULL, NULL), CAIRN_BAD_ARGUMENT);
    end_bed(&bed);
    leave(&s);
}

/* Without an ingredient the aligner still ends, with worse results or fewer outputs. */
static void ingredients_matter(void **state)
{
    struct survey s = visit(2005, 10, 4, 100, 0.3, 20);
    cairn_aligner_params params = params_for(s.count);
    struct outcome all, blind, lines;
    struct bed bed = make_bed(&params);

    (void)state;
    add_all(&bed, &s, 0);
    run(&bed, CAIRN_UNBOUNDED);
    all = compare(&bed, &s, 0);
    end_bed(&bed);

    params.free_space_penalty = 0;
    bed = make_bed(&params);
    add_all(&bed, &s, 0);
    run(&bed, CAIRN_UNBOUNDED);
    blind = compare(&bed, &s, 0);
    assert_true(blind.aligned < all.aligned);
    end_bed(&bed);

    params = params_for(s.count);
    params.oriented = 0;
    bed = make_bed(&params);
    add_all(&bed, &s, 0);
    run(&bed, CAIRN_UNBOUNDED);
    lines = compare(&bed, &s, 0);
    assert_true(lines.aligned > 0 && lines.aligned < lines.observable);
    end_bed(&bed);

    params = params_for(s.count);
    params.max_iterations = params.max_relocalizations = 0;
    bed = make_bed(&params);
    add_all(&bed, &s, 0);
    run(&bed, CAIRN_UNBOUNDED);
    assert_int_equal(cairn_aligner_read(bed.aligner).anchor, -1);
    assert_int_equal(cairn_aligner_read(bed.aligner).iterations, 0);
    assert_int_equal(cairn_aligner_read(bed.aligner).relocalized, 0);
    assert_int_equal(cairn_aligner_read(bed.aligner).placed, 0);
    end_bed(&bed);
    leave(&s);
}

static void too_little_fill_is_a_verdict(void **state)
{
    struct survey s = visit(2004, 4, 4, 100, 0.1, 5);
    cairn_aligner_params params = params_for(s.count);
    struct bed bed;

    (void)state;
    params.max_fill = 3;
    bed = make_bed(&params);
    add_all(&bed, &s, 0);
    run(&bed, CAIRN_UNBOUNDED);
    assert_int_equal(cairn_aligner_read(bed.aligner).verdict, CAIRN_ALIGNER_FILL_EXCEEDED);
    assert_int_equal(cairn_aligner_read(bed.aligner).anchor, -1);
    for (int32_t i = 0; i < s.count; i++) {
        cairn_aligner_pose p = cairn_aligner_pose_of(bed.aligner, i);

        assert_true(all_finite(&p));
        assert_int_equal(p.placed, 0);
    }
    end_bed(&bed);
    leave(&s);
}

/* ---- Rooms drawn by hand ---- */

enum { BEAMS = 360 };

/* Ranges of a sensor in a box with corners at (0, 0) and (width, height). */
static cairn_scan_input box_scan(float *ranges, double width, double height, sim_pose at)
{
    cairn_scan_input input;

    for (int i = 0; i < BEAMS; i++) {
        double a = at.theta + i * DEGREE - 180 * DEGREE, c = cos(a), s = sin(a);
        double x = c > 0 ? (width - at.x) / c : c < 0 ? -at.x / c : 1e9;
        double y = s > 0 ? (height - at.y) / s : s < 0 ? -at.y / s : 1e9;

        ranges[i] = (float)fmin(x, y);
    }
    memset(&input, 0, sizeof input);
    input.range = ranges;
    input.count = BEAMS;
    input.angle_min = (float)(-180 * DEGREE);
    input.angle_step = (float)DEGREE;
    input.range_min = 0.05F;
    input.range_max = 20;
    input.range_sigma = 0.01F;
    return input;
}

static cairn_pose start_at(double x, double y, double degrees)
{
    cairn_pose p = {(cairn_real)x, (cairn_real)y, (cairn_real)(degrees * DEGREE)};

    return p;
}

/* Two scans of one box are aligned exactly. */
static void two_scans_of_a_box(void **state)
{
    cairn_aligner_params params = params_for(2);
    struct bed bed = make_bed(&params);
    sim_pose first = {2, 1.5, 0}, second = {3, 2, 0.3};
    cairn_aligner_pose a, b;
    cairn_pose between;
    float ranges[BEAMS];
    cairn_scan_input input = box_scan(ranges, 6, 4, first);

    (void)state;
    add(&bed, &input, start_at(2.2, 1.4, 8));
    input = box_scan(ranges, 6, 4, second);
    add(&bed, &input, start_at(2.8, 2.2, 10));
    run(&bed, CAIRN_UNBOUNDED);
    a = cairn_aligner_pose_of(bed.aligner, 0);
    b = cairn_aligner_pose_of(bed.aligner, 1);
    between = cairn_pose_between(a.map_scan, b.map_scan);
    assert_near(between.x, 1, 2e-3);
    assert_near(between.y, 0.5, 2e-3);
    assert_near(between.theta, 0.3, 1e-3);
    assert_int_equal(a.component, 0);
    assert_int_equal(b.component, 0);
    assert_int_equal(a.placed && b.placed, 1);
    assert_int_equal(b.observable, CAIRN_ALIGNER_X | CAIRN_ALIGNER_Y | CAIRN_ALIGNER_THETA);
    assert_true(a.support > 5);
    assert_near(a.support, b.support, 1e-3);
    assert_int_equal(cairn_aligner_read(bed.aligner).verdict, CAIRN_ALIGNER_CONVERGED);
    assert_int_equal(cairn_aligner_read(bed.aligner).walls, 4);
    end_bed(&bed);
}

/* Aligns two scans of a box; a position is observable below `sigma`, m. */
static void align_two_of_a_box(cairn_real sigma, cairn_aligner_pose poses[2])
{
    cairn_aligner_params params = params_for(2);
    sim_pose first = {2, 1.5, 0}, second = {3, 2, 0.3};
    struct bed bed;
    float ranges[BEAMS];
    cairn_scan_input input = box_scan(ranges, 6, 4, first);

    params.observable_sigma = sigma;
    bed = make_bed(&params);
    add(&bed, &input, start_at(2.2, 1.4, 8));
    input = box_scan(ranges, 6, 4, second);
    add(&bed, &input, start_at(2.8, 2.2, 10));
    run(&bed, CAIRN_UNBOUNDED);
    for (int32_t i = 0; i < 2; i++)
        poses[i] = cairn_aligner_pose_of(bed.aligner, i);
    end_bed(&bed);
}

/* The covariances are those after the best common motion, which leaves two scans opposite errors of
 * their positions; no scan, not even the anchor, is without one. */
static void two_scans_have_the_same_covariance(void **state)
{
    cairn_aligner_pose poses[2];

    (void)state;
    align_two_of_a_box(CAIRN_REAL(0.05), poses);
    for (int k = 0; k < 5; k += 4) {
        double a = (double)poses[0].covariance[k], b = (double)poses[1].covariance[k];

        assert_true(a > 1e-8 && a < 1e-4);
        assert_near(a, b, 0.1 * b);
    }
    for (int k = 1; k < 9; k += 4)
        assert_near(poses[0].covariance[k], poses[0].covariance[k == 1 ? 3 : 7], 1e-9);
}

/* Relative to the anchor a scan has the errors of both, four times the variance of either after the
 * common motion; the anchor has none. */
static void covariances_are_relative_to_the_anchor(void **state)
{
    cairn_aligner_pose poses[2];
    const cairn_real *own, *other;

    (void)state;
    align_two_of_a_box(CAIRN_REAL(0.05), poses);
    own = poses[0].anchor_covariance;
    other = poses[1].anchor_covariance;
    for (int k = 0; k < 5; k += 4) {
        double both = 4 * (double)poses[1].covariance[k];

        assert_near(own[k], 0, 1e-9);
        assert_near(other[k], both, 0.2 * both);
    }
    assert_near(own[8], 0, 1e-9);
    assert_true(other[8] > poses[1].covariance[8]);
    assert_int_equal(poses[0].anchored && poses[1].anchored, 1);
}

/* A scan is observable with one standard deviation within the limit, and placed with 2.24. */
static void a_placed_scan_is_well_within_the_limit(void **state)
{
    const cairn_real factors[] = {CAIRN_REAL(1.5), CAIRN_REAL(2.5)};
    cairn_aligner_pose poses[2];
    cairn_real sigma;

    (void)state;
    align_two_of_a_box(CAIRN_REAL(0.05), poses);
    sigma = cairn_sqrt(poses[1].covariance[0] + poses[1].covariance[4]);
    for (int k = 0; k < 2; k++) {
        align_two_of_a_box(factors[k] * sigma, poses);
        assert_int_equal(poses[1].observable,
                         CAIRN_ALIGNER_X | CAIRN_ALIGNER_Y | CAIRN_ALIGNER_THETA);
        assert_int_equal(poses[1].placed, k);
    }
}

/* The common motion is that of the initial poses. */
static void initial_poses_place_the_map(void **state)
{
    cairn_aligner_params params = params_for(2);
    struct bed bed = make_bed(&params);
    sim_pose first = {2, 1.5, 0}, second = {3, 2, 0};
    float ranges[BEAMS];
    cairn_scan_input input = box_scan(ranges, 6, 4, first);
    cairn_aligner_pose a, b;

    (void)state;
    add(&bed, &input, start_at(102, 51.5, 0));
    input = box_scan(ranges, 6, 4, second);
    add(&bed, &input, start_at(103, 52.2, 0));
    run(&bed, CAIRN_UNBOUNDED);
    a = cairn_aligner_pose_of(bed.aligner, 0);
    b = cairn_aligner_pose_of(bed.aligner, 1);
    assert_near((a.map_scan.x + b.map_scan.x) / 2, 102.5, 1e-3);
    assert_near((a.map_scan.y + b.map_scan.y) / 2, 51.85, 1e-3);
    end_bed(&bed);
}

/* Another initial pose acts as if the scan had been added with it: before an alignment, during one,
 * and after it. */
static void initial_poses_can_be_changed(void **state)
{
    cairn_aligner_params params = params_for(2);
    struct bed bed = make_bed(&params), fresh = make_bed(&params);
    sim_pose first = {2, 1.5, 0}, second = {3, 2, 0};
    cairn_pose far = {CAIRN_REAL(1.1e6), 0, 0}, nan = {0, (cairn_real)NAN, 0},
               last = start_at(2.7, 2.3, 365);
    float ranges[BEAMS];
    cairn_scan_input input = box_scan(ranges, 6, 4, first);
    cairn_budget budget = {5};

    (void)state;
    add(&bed, &input, start_at(2, 1, 8));
    add(&fresh, &input, start_at(2.2, 1.4, 8));
    input = box_scan(ranges, 6, 4, second);
    add(&bed, &input, start_at(40, -7, 3));
    add(&fresh, &input, last);
    run(&fresh, CAIRN_UNBOUNDED);
    assert_ok(cairn_aligner_set_initial_pose(bed.aligner, 1, start_at(50, 50, 50)));
    assert_near(cairn_aligner_pose_of(bed.aligner, 1).map_scan.x, 50, 0);
    for (int k = 0; k < 3; k++) {
        assert_ok(cairn_aligner_begin(bed.aligner));
        if (k == 1)
            assert_int_equal(cairn_aligner_step(bed.aligner, &budget), CAIRN_MORE);
        if (k == 2)
            run(&bed, CAIRN_UNBOUNDED);
        assert_ok(cairn_aligner_set_initial_pose(bed.aligner, 0, start_at(2.2, 1.4, 8)));
        assert_false(cairn_aligner_running(bed.aligner));
        assert_ok(cairn_aligner_set_initial_pose(bed.aligner, 1, last));
        assert_near(cairn_aligner_pose_of(bed.aligner, 0).map_scan.x, 2.2, 1e-6);
        assert_near(cairn_aligner_pose_of(bed.aligner, 1).map_scan.theta, 5 * DEGREE, 1e-6);
        assert_int_equal(cairn_aligner_pose_of(bed.aligner, 1).placed, 0);
        assert_int_equal(cairn_aligner_read(bed.aligner).components, 0);
        run(&bed, CAIRN_UNBOUNDED);
        for (int32_t i = 0; i < 2; i++) {
            cairn_aligner_pose a = cairn_aligner_pose_of(bed.aligner, i),
                               b = cairn_aligner_pose_of(fresh.aligner, i);

            assert_memory_equal(&a.map_scan, &b.map_scan, sizeof a.map_scan);
        }
    }
    assert_status(cairn_aligner_set_initial_pose(NULL, 0, last), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_aligner_set_initial_pose(bed.aligner, -1, last), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_aligner_set_initial_pose(bed.aligner, 2, last), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_aligner_set_initial_pose(bed.aligner, 0, far), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_aligner_set_initial_pose(bed.aligner, 0, nan), CAIRN_NOT_FINITE);
    assert_int_equal(cairn_aligner_read(bed.aligner).components, 1);
    end_bed(&bed);
    end_bed(&fresh);
}

/* One flat wall: the translation of the scan along it is unobservable, which its direction
 * shows. */
static void a_flat_wall_is_not_observable(void **state)
{
    cairn_aligner_params params = params_for(2);
    struct bed bed = make_bed(&params);
    float ranges[BEAMS];
    sim_pose at = {10, 2, 0};
    cairn_scan_input input = box_scan(ranges, 20, 30, at);
    cairn_aligner_pose p;

    (void)state;
    for (int i = 0; i < BEAMS; i++)
        if (ranges[i] > 3.5F)
            ranges[i] = NAN;
    add(&bed, &input, start_at(10, 2, 0));
    add(&bed, &input, start_at(10.1, 2.1, 5));
    run(&bed, CAIRN_UNBOUNDED);
    for (int32_t i = 0; i < 2; i++) {
        p = cairn_aligner_pose_of(bed.aligner, i);
        assert_true(all_finite(&p));
        if (i != cairn_aligner_read(bed.aligner).anchor) {
            assert_int_equal(p.placed, 0);
            assert_int_equal(p.observable & CAIRN_ALIGNER_X, 0);
        }
    }
    end_bed(&bed);
}

static void parts_that_do_not_meet(void **state)
{
    cairn_aligner_params params = params_for(4);
    struct bed bed = make_bed(&params);
    sim_pose first = {2, 1.5, 0}, second = {3, 2, 0.2};
    float ranges[BEAMS];
    cairn_scan_input input;
    cairn_aligner_result result;

    (void)state;
    input = box_scan(ranges, 6, 4, first);
    add(&bed, &input, start_at(2, 1.5, 0));
    input = box_scan(ranges, 6, 4, second);
    add(&bed, &input, start_at(3, 2, 10));
    input = box_scan(ranges, 5, 7, first);
    add(&bed, &input, start_at(52, 1.5, 0));
    input = box_scan(ranges, 5, 7, second);
    add(&bed, &input, start_at(53, 2, 10));
    run(&bed, CAIRN_UNBOUNDED);
    result = cairn_aligner_read(bed.aligner);
    assert_int_equal(result.verdict, CAIRN_ALIGNER_DISCONNECTED);
    assert_int_equal(result.components, 2);
    assert_int_equal(result.largest_size, 2);
    assert_int_equal(cairn_aligner_pose_of(bed.aligner, 0).component,
                     cairn_aligner_pose_of(bed.aligner, 1).component);
    assert_int_equal(cairn_aligner_pose_of(bed.aligner, 2).component,
                     cairn_aligner_pose_of(bed.aligner, 3).component);
    assert_int_equal(cairn_aligner_pose_of(bed.aligner, 0).component +
                         cairn_aligner_pose_of(bed.aligner, 2).component,
                     1);
    end_bed(&bed);
}

/* Only those hits of a sensor that lie within [x0, x1] x [y0, y1], or on the wall at the top to the
 * right of `right`. */
struct kept {
    double x0, x1, y0, y1, right;
};

static void keep_hits(float *ranges, sim_pose at, struct kept kept)
{
    for (int i = 0; i < BEAMS; i++) {
        double a = at.theta + i * DEGREE - 180 * DEGREE, r = (double)ranges[i];
        double x = at.x + r * cos(a), y = at.y + r * sin(a);

        if (!(x > kept.x0 && x < kept.x1 && y > kept.y0 && y < kept.y1) &&
            !(y > 7.9 && x > kept.right))
            ranges[i] = (float)NAN;
    }
}

/* Three scans of the lower left of a box, which also see its upper wall, and one of that wall and
 * of what it bounds. */
static cairn_aligner_pose align_with_capacity(struct kept kept, int32_t max_short_segments)
{
    static const sim_pose others[] = {{3, 3, 0}, {3.6, 3.4, 0.2}, {4, 2.8, -0.1}};
    const struct kept low = {-1, 13, -1, 4, 0.6};
    const sim_pose at = {1.5, 7, 0.1};
    cairn_aligner_params params = params_for(4);
    cairn_aligner_pose first, last;
    cairn_pose between;
    cairn_scan_input input;
    float ranges[BEAMS];
    struct bed bed;

    params.max_short_segments = max_short_segments;
    bed = make_bed(&params);
    for (int k = 0; k < 3; k++) {
        input = box_scan(ranges, 12, 8, others[k]);
        keep_hits(ranges, others[k], low);
        add(&bed, &input, start_at(others[k].x + 0.05 * k, others[k].y, others[k].theta / DEGREE));
    }
    input = box_scan(ranges, 12, 8, at);
    keep_hits(ranges, at, kept);
    add(&bed, &input, start_at(at.x + 0.25, at.y - 0.1, at.theta / DEGREE + 3));
    run(&bed, CAIRN_UNBOUNDED);
    first = cairn_aligner_pose_of(bed.aligner, 0);
    last = cairn_aligner_pose_of(bed.aligner, 3);
    between = cairn_pose_between(first.map_scan, last.map_scan);
    last.map_scan.x = between.x - (cairn_real)(at.x - others[0].x);
    last.map_scan.y = between.y - (cairn_real)(at.y - others[0].y);
    last.map_scan.theta = between.theta - (cairn_real)at.theta;
    assert_int_equal(last.component, 0);
    end_bed(&bed);
    return last;
}

/* A wall that no scan has seen at that place, but others have seen elsewhere on its line, stops a
 * scan. */
static void a_scan_is_translated_until_its_walls_meet(void **state)
{
    const struct kept corner = {-0.1, 0.1, 6, 7.8, 0.1}, nothing = {0, 0, 0, 0, 0.6},
                      reach = {-0.1, 0.1, 6.95, 7.05, 0.6};
    cairn_aligner_pose p = align_with_capacity(corner, 0);

    (void)state;
    assert_near(p.map_scan.x, 0, 5e-3);
    assert_near(p.map_scan.y, 0, 5e-3);
    assert_near(p.map_scan.theta, 0, 5e-3);
    assert_int_equal(p.placed, 1);
    assert_int_equal(p.observable, CAIRN_ALIGNER_X | CAIRN_ALIGNER_Y | CAIRN_ALIGNER_THETA);
    p = align_with_capacity(nothing, 8);
    assert_int_equal(p.placed, 0);
    assert_int_equal(p.observable, CAIRN_ALIGNER_Y | CAIRN_ALIGNER_THETA);
    p = align_with_capacity(reach, 8);
    assert_near(p.map_scan.x, 0, 2e-2);
    assert_int_equal(p.placed, 1);
    p = align_with_capacity(reach, 0);
    assert_int_equal(p.placed, 0);
}

/* ---- Scans of little or no information ---- */

static void check_ends(struct bed *bed)
{
    run(bed, CAIRN_UNBOUNDED);
    assert_true(cairn_aligner_read(bed->aligner).verdict != CAIRN_ALIGNER_RUNNING);
    for (int32_t i = 0; i < cairn_aligner_scan_count(bed->aligner); i++) {
        cairn_aligner_pose p = cairn_aligner_pose_of(bed->aligner, i);

        assert_true(all_finite(&p));
    }
}

static void degenerate_scans(void **state)
{
    cairn_aligner_params params = params_for(12);
    struct bed bed = make_bed(&params);
    sim_pose at = {2, 1.5, 0};
    float ranges[BEAMS];
    cairn_scan_input input = box_scan(ranges, 6, 4, at);

    (void)state;
    /* One scan. */
    add(&bed, &input, start_at(1, 2, 0));
    check_ends(&bed);
    assert_int_equal(cairn_aligner_read(bed.aligner).verdict, CAIRN_ALIGNER_DISCONNECTED);
    assert_near(cairn_aligner_pose_of(bed.aligner, 0).map_scan.x, 1, 1e-5);
    /* All equal, far from each other, and at the same place. */
    for (int i = 0; i < 6; i++)
        add(&bed, &input, start_at(i < 3 ? 1 : 2, 2, 5 * i));
    check_ends(&bed);
    /* Nothing at all. */
    cairn_aligner_clear(bed.aligner);
    for (int i = 0; i < BEAMS; i++)
        ranges[i] = INFINITY;
    add(&bed, &input, start_at(0, 0, 0));
    add(&bed, &input, start_at(0, 0, 0));
    check_ends(&bed);
    assert_int_equal(cairn_aligner_read(bed.aligner).components, 0);
    /* One point each. */
    ranges[180] = 2;
    add(&bed, &input, start_at(0, 0, 0));
    add(&bed, &input, start_at(0, 0, 0));
    check_ends(&bed);
    /* Circles. */
    for (int i = 0; i < BEAMS; i++)
        ranges[i] = 3;
    add(&bed, &input, start_at(0, 0, 0));
    add(&bed, &input, start_at(0.1, 0, 20));
    check_ends(&bed);
    end_bed(&bed);
}

/* ---- Refusals ---- */

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_aligner *aligner;

    return cairn_aligner_create(&aligner, pool, context);
}

static void memory_is_exact(void **state)
{
    cairn_aligner_params params = cairn_aligner_default();

    (void)state;
    params.max_scans = 3;
    params.max_segments = 7;
    params.max_points = 11;
    params.max_hypotheses = 5;
    params.max_fill = 3;
    params.max_cells = 64;
    test_every_pool_size(create, &params, cairn_aligner_memory(&params));
}

static void refused(const cairn_aligner_params *params)
{
    cairn_pool pool = test_pool(1 << 20);
    cairn_aligner *aligner = NULL;

    assert_true(cairn_aligner_memory(params) == 0);
    assert_status(cairn_aligner_create(&aligner, &pool, params), CAIRN_BAD_ARGUMENT);
    assert_null(aligner);
    assert_true(pool.used == 0);
    test_pool_free(&pool);
}

static void params_are_refused(void **state)
{
    static const cairn_real bad[] = {0, -1, (cairn_real)NAN, (cairn_real)INFINITY};
    const cairn_aligner_params good = cairn_aligner_default();
    cairn_aligner_params p;

    (void)state;
    refused(NULL);
#define REFUSE(field, value) (p = good, p.field = (value), refused(&p))
    REFUSE(max_scans, 0);
    REFUSE(max_scans, (1 << 16) + 1);
    REFUSE(max_segments, 0);
    REFUSE(max_segments, (1 << 24) + 1);
    REFUSE(max_points, 0);
    REFUSE(max_points, (1 << 24) + 1);
    REFUSE(max_hypotheses, 0);
    REFUSE(max_hypotheses, (1 << 24) + 1);
    REFUSE(max_fill, 0);
    REFUSE(max_fill, (1 << 24) + 1);
    REFUSE(max_cells, 63);
    REFUSE(max_cells, (1 << 24) + 1);
    REFUSE(max_short_segments, -1);
    REFUSE(max_short_segments, (1 << 24) + 1);
    REFUSE(max_relocalizations, -1);
    REFUSE(max_iterations, -1);
    REFUSE(free_space_penalty, -1);
    REFUSE(free_space_penalty, (cairn_real)NAN);
    REFUSE(free_space_penalty, (cairn_real)INFINITY);
    REFUSE(max_initial_angle_error, CAIRN_REAL(3.2));
    REFUSE(max_range, CAIRN_REAL(1.1e6));
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        REFUSE(max_initial_error, bad[k]);
        REFUSE(max_initial_angle_error, bad[k]);
        REFUSE(max_range, bad[k]);
        REFUSE(range_sigma, bad[k]);
        REFUSE(min_log_likelihood_ratio, bad[k]);
        REFUSE(observable_sigma, bad[k]);
        REFUSE(observable_sigma_theta, bad[k]);
    }
    p = good;
    assert_true(cairn_aligner_memory(&p) > 0);
    p.max_relocalizations = p.max_iterations = 0;
    p.free_space_penalty = 0;
    assert_true(cairn_aligner_memory(&p) > 0);
}

/* The fault names the field and the range of the linear system's params. */
static void too_large_a_system_is_refused_by_name(void **state)
{
    cairn_aligner_params p = cairn_aligner_default();
    cairn_object_fault fault = {.module = NULL};
    const int32_t most = 1 << 22;

    (void)state;
    p.max_scans = 3;
    p.max_short_segments = 0;
    p.max_segments = 2 * (most - 3);
    assert_ok(cairn_aligner_check(&p, &fault));
    assert_true(cairn_aligner_memory(&p) > 0);
    p.max_segments++;
    refused(&p);
    assert_status(cairn_aligner_check(&p, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.module, "block_solver");
    assert_non_null(fault.field);
    assert_string_equal(fault.field, "max_poses");
    assert_true(fault.value == (cairn_real)most + 1);
    assert_true(fault.lowest == 1 && fault.highest == (cairn_real)most);
    assert_status(cairn_aligner_check(&p, NULL), CAIRN_BAD_ARGUMENT);
}

static void scans_are_refused(void **state)
{
    cairn_aligner_params params = params_for(2);
    cairn_segment segments[2] = {{{1, 0}, {1, 1}}, {{1, 1}, {0, 1}}};
    cairn_oriented_point points[3] = {{{1, 0}, {0, 1}}, {{1, 1}, {0, 1}}, {{0, 1}, {-1, 0}}};
    cairn_scan_beam beams[1] = {{{0, 0}, {1, CAIRN_REAL(0.5)}, CAIRN_SCAN_BEAM_HIT}};
    int32_t first[3] = {0, 2, 3};
    const cairn_scan_view good = {beams, segments, first, points, 1, 2, 3, {0, 0}, 0};
    cairn_scan_view view = good;
    cairn_pose at = {0, 0, 0};
    cairn_fault fault;
    struct bed bed;

    (void)state;
    params.max_segments = 4;
    params.max_points = 6;
    bed = make_bed(&params);
    assert_status(cairn_aligner_begin(NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_aligner_begin(bed.aligner), CAIRN_EMPTY);
    assert_status(cairn_aligner_step(NULL, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_aligner_step(bed.aligner, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_aligner_add_scan(NULL, &view, at, NULL), CAIRN_BAD_ARGUMENT);
    assert_fault(&fault, cairn_aligner_add_scan(bed.aligner, NULL, at, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_non_null(fault.message);
#define REFUSE_VIEW(change, status, where)                                                         \
    do {                                                                                           \
        view = good;                                                                               \
        change;                                                                                    \
        assert_status(cairn_aligner_add_scan(bed.aligner, &view, at, &fault), status);             \
        assert_int_equal(fault.index, where);                                                      \
        assert_non_null(fault.message);                                                            \
        assert_int_equal(cairn_aligner_scan_count(bed.aligner), 0);                                \
    } while (0)
    REFUSE_VIEW(view.beam_count = -1, CAIRN_BAD_ARGUMENT, -1);
    REFUSE_VIEW(view.segment_count = -1, CAIRN_BAD_ARGUMENT, -1);
    REFUSE_VIEW(view.point_count = -1, CAIRN_BAD_ARGUMENT, -1);
    REFUSE_VIEW(view.beams = NULL, CAIRN_BAD_ARGUMENT, -1);
    REFUSE_VIEW(view.points = NULL, CAIRN_BAD_ARGUMENT, -1);
    REFUSE_VIEW(view.segments = NULL, CAIRN_BAD_ARGUMENT, -1);
    REFUSE_VIEW(view.first_point = NULL, CAIRN_BAD_ARGUMENT, -1);
    REFUSE_VIEW(view.segment_count = 0, CAIRN_BAD_ARGUMENT, 0);
    REFUSE_VIEW(view.point_count = 2, CAIRN_BAD_ARGUMENT, 2);
    REFUSE_VIEW(view.sensor.x = (cairn_real)NAN, CAIRN_NOT_FINITE, -1);
    REFUSE_VIEW(view.sensor.y = CAIRN_REAL(2e6), CAIRN_BAD_ARGUMENT, -1);
    REFUSE_VIEW(at.x = (cairn_real)INFINITY, CAIRN_NOT_FINITE, -1);
    REFUSE_VIEW(at.x = CAIRN_REAL(-2e6), CAIRN_BAD_ARGUMENT, -1);
    at.x = 0;
#define REFUSE_ELEMENT(element, value, status, where)                                              \
    do {                                                                                           \
        cairn_real *at_element = &(element), kept = *at_element;                                   \
        *at_element = value;                                                                       \
        REFUSE_VIEW((void)0, status, where);                                                       \
        *at_element = kept;                                                                        \
    } while (0)
    REFUSE_ELEMENT(segments[1].a.x, (cairn_real)NAN, CAIRN_NOT_FINITE, 1);
    REFUSE_ELEMENT(segments[1].b.y, (cairn_real)INFINITY, CAIRN_NOT_FINITE, 1);
    REFUSE_ELEMENT(segments[0].a.x, CAIRN_REAL(2e6), CAIRN_BAD_ARGUMENT, 0);
    REFUSE_ELEMENT(segments[0].b.y, CAIRN_REAL(-2e6), CAIRN_BAD_ARGUMENT, 0);
    REFUSE_ELEMENT(points[2].position.x, (cairn_real)NAN, CAIRN_NOT_FINITE, 2);
    REFUSE_ELEMENT(points[2].position.y, CAIRN_REAL(2e6), CAIRN_BAD_ARGUMENT, 2);
    REFUSE_ELEMENT(beams[0].from.x, (cairn_real)NAN, CAIRN_NOT_FINITE, 0);
    REFUSE_ELEMENT(beams[0].to.y, (cairn_real)INFINITY, CAIRN_NOT_FINITE, 0);
    REFUSE_ELEMENT(beams[0].to.x, CAIRN_REAL(2e6), CAIRN_BAD_ARGUMENT, 0);
    REFUSE_ELEMENT(beams[0].from.y, CAIRN_REAL(2e6), CAIRN_BAD_ARGUMENT, 0);
    first[0] = 1;
    REFUSE_VIEW((void)0, CAIRN_BAD_ARGUMENT, 0);
    first[0] = 0;
    first[1] = 4;
    REFUSE_VIEW((void)0, CAIRN_BAD_ARGUMENT, 1);
    first[1] = 2;

    view = good;
    assert_ok(cairn_aligner_add_scan(bed.aligner, &view, at, &fault));
    assert_ok(cairn_aligner_add_scan(bed.aligner, &view, at, NULL));
    assert_fault(&fault, cairn_aligner_add_scan(bed.aligner, &view, at, &fault), CAIRN_FULL, -1);
    assert_int_equal(cairn_aligner_scan_count(bed.aligner), 2);
    check_ends(&bed);
    assert_int_equal(cairn_aligner_pose_of(bed.aligner, 2).placed, 0);
    assert_int_equal(cairn_aligner_pose_of(bed.aligner, -1).component, 0);
    end_bed(&bed);

    params.max_scans = 9;
    params.max_points = 5;
    bed = make_bed(&params);
    assert_ok(cairn_aligner_add_scan(bed.aligner, &view, at, NULL));
    assert_fault(&fault, cairn_aligner_add_scan(bed.aligner, &view, at, &fault), CAIRN_FULL, -1);
    assert_non_null(strstr(fault.message, "max_points"));
    end_bed(&bed);
    params.max_points = 50;
    params.max_segments = 3;
    bed = make_bed(&params);
    assert_ok(cairn_aligner_add_scan(bed.aligner, &view, at, NULL));
    assert_fault(&fault, cairn_aligner_add_scan(bed.aligner, &view, at, &fault), CAIRN_FULL, -1);
    assert_non_null(strstr(fault.message, "max_segments"));
    end_bed(&bed);
}

/* Before an alignment and after clear() the poses are the initial ones. */
static void initial_poses_are_shown(void **state)
{
    cairn_aligner_params params = params_for(2);
    struct bed bed = make_bed(&params);
    sim_pose at = {2, 1.5, 0};
    float ranges[BEAMS];
    cairn_scan_input input = box_scan(ranges, 6, 4, at);
    cairn_aligner_pose p;

    (void)state;
    add(&bed, &input, start_at(1, 2, 30));
    p = cairn_aligner_pose_of(bed.aligner, 0);
    assert_near(p.map_scan.x, 1, 1e-6);
    assert_near(p.map_scan.theta, 30 * DEGREE, 1e-6);
    assert_near(p.covariance[0], 0.24, 1e-6);
    assert_int_equal(p.placed, 0);
    assert_int_equal(cairn_aligner_read(bed.aligner).anchor, -1);
    cairn_aligner_clear(bed.aligner);
    assert_int_equal(cairn_aligner_scan_count(bed.aligner), 0);
    assert_status(cairn_aligner_begin(bed.aligner), CAIRN_EMPTY);
    end_bed(&bed);
}

/* A scan whose start is too far off is not placed. With another start it is, and the others hardly
 * move. */
static void unplaced_scans_are_searched_again(void **state)
{
    enum { LOST = 4, PLACES = 8 };
    static const int32_t budgets[] = {CAIRN_UNBOUNDED, 1, 1000};
    struct survey s = visit(3, PLACES, 1, 360, 0.1, 5);
    cairn_aligner_params params = params_for(PLACES);
    cairn_pose near[PLACES], truth = {0, 0, 0}, first[PLACES], bad[PLACES];
    int64_t units = 0;

    (void)state;
    truth.x = (cairn_real)s.scans[LOST].truth.x;
    truth.y = (cairn_real)s.scans[LOST].truth.y;
    truth.theta = (cairn_real)s.scans[LOST].truth.theta;
    s.start[LOST].x = truth.x + 4;
    s.start[LOST].theta = cairn_wrap_angle(truth.theta + 2);
    for (int k = 0; k < 3; k++) {
        struct bed bed = make_bed(&params);
        cairn_budget left = {budgets[k]};
        cairn_aligner_pose before[PLACES], now;
        cairn_aligner_result result;

        assert_status(cairn_aligner_begin_warm(bed.aligner, near), CAIRN_EMPTY);
        add_all(&bed, &s, 0);
        assert_status(cairn_aligner_begin_warm(bed.aligner, near), CAIRN_EMPTY);
        run(&bed, CAIRN_UNBOUNDED);
        result = cairn_aligner_read(bed.aligner);
        assert_int_equal(result.placed, PLACES - 1);
        for (int32_t i = 0; i < PLACES; i++) {
            before[i] = cairn_aligner_pose_of(bed.aligner, i);
            assert_int_equal(before[i].placed, i != LOST);
            /* ignored for those that are placed */
            near[i].x = near[i].y = near[i].theta = (cairn_real)NAN;
        }
        near[LOST] = s.start[LOST];
        memcpy(bad, near, sizeof bad);
        assert_status(cairn_aligner_begin_warm(NULL, near), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_aligner_begin_warm(bed.aligner, NULL), CAIRN_BAD_ARGUMENT);
        bad[LOST].theta = (cairn_real)NAN;
        assert_status(cairn_aligner_begin_warm(bed.aligner, bad), CAIRN_NOT_FINITE);
        bad[LOST] = start_at(2e6, 0, 0);
        assert_status(cairn_aligner_begin_warm(bed.aligner, bad), CAIRN_BAD_ARGUMENT);
        assert_false(cairn_aligner_running(bed.aligner));

        /* From its old start it is not found, and the result stays bit by bit. */
        assert_ok(cairn_aligner_begin_warm(bed.aligner, near));
        assert_true(cairn_aligner_running(bed.aligner));
        assert_status(cairn_aligner_begin_warm(bed.aligner, near), CAIRN_EMPTY);
        while (cairn_aligner_step(bed.aligner, &left) == CAIRN_MORE)
            left.left = budgets[k];
        assert_true(cairn_aligner_read(bed.aligner).units > result.units);
        assert_true(cairn_aligner_read(bed.aligner).units < 2 * result.units);
        assert_int_equal(cairn_aligner_read(bed.aligner).verdict, result.verdict);
        for (int32_t i = 0; i < PLACES; i++) {
            now = cairn_aligner_pose_of(bed.aligner, i);
            assert_memory_equal(&now, &before[i], sizeof now);
        }

        near[LOST] = truth;
        near[LOST].x += (cairn_real)0.15;
        near[LOST].theta += (cairn_real)0.1 + 2 * CAIRN_PI;
        assert_ok(cairn_aligner_begin_warm(bed.aligner, near));
        left.left = budgets[k];
        while (cairn_aligner_step(bed.aligner, &left) == CAIRN_MORE)
            left.left = budgets[k];
        result = cairn_aligner_read(bed.aligner);
        assert_int_equal(result.placed, PLACES);
        assert_int_equal(result.largest_size, PLACES);
        assert_int_equal(compare(&bed, &s, 0).aligned, compare(&bed, &s, 0).observable);
        for (int32_t i = 0; i < PLACES; i++) {
            cairn_pose apart;

            now = cairn_aligner_pose_of(bed.aligner, i);
            apart = cairn_pose_between(
                cairn_pose_between(before[0].map_scan, before[i].map_scan),
                cairn_pose_between(cairn_aligner_pose_of(bed.aligner, 0).map_scan, now.map_scan));
            if (i != LOST)
                assert_true(hypot((double)apart.x, (double)apart.y) < 0.02 &&
                            fabs((double)apart.theta) < 0.005);
            if (k == 0)
                first[i] = now.map_scan;
            assert_memory_equal(&now.map_scan, &first[i], sizeof now.map_scan);
        }
        if (k == 0)
            units = result.units;
        assert_int_equal(result.units, units);
        /* forgets what has ended */
        assert_ok(cairn_aligner_set_initial_pose(bed.aligner, 0, truth));
        assert_status(cairn_aligner_begin_warm(bed.aligner, near), CAIRN_EMPTY);
        end_bed(&bed);
    }
    leave(&s);
}

/* Initial poses given late act like those given at once. */
static void initial_poses_can_be_given_again(void **state)
{
    cairn_aligner_params params = params_for(2);
    struct bed bed = make_bed(&params), other = make_bed(&params);
    sim_pose first = {2, 1.5, 0}, second = {3, 2, 0};
    cairn_pose far = start_at(103, 52.2, 0), bad = far;
    float ranges[BEAMS];
    cairn_scan_input input = box_scan(ranges, 6, 4, first);

    (void)state;
    add(&bed, &input, start_at(102, 51.5, 0));
    add(&other, &input, start_at(1, 2, 30));
    input = box_scan(ranges, 6, 4, second);
    add(&bed, &input, far);
    add(&other, &input, start_at(5, 2, 90));
    run(&other, CAIRN_UNBOUNDED);
    far.theta += 2 * CAIRN_PI;
    assert_ok(cairn_aligner_set_initial_pose(other.aligner, 0, start_at(102, 51.5, 0)));
    assert_ok(cairn_aligner_set_initial_pose(other.aligner, 1, far));
    assert_near(cairn_aligner_pose_of(other.aligner, 1).map_scan.theta, 0, 1e-6);
    assert_int_equal(cairn_aligner_pose_of(other.aligner, 1).placed, 0);
    assert_int_equal(cairn_aligner_running(other.aligner), 0);
    assert_ok(cairn_aligner_set_initial_pose(other.aligner, 1, bad));
    run(&bed, CAIRN_UNBOUNDED);
    run(&other, CAIRN_UNBOUNDED);
    for (int32_t i = 0; i < 2; i++) {
        cairn_aligner_pose a = cairn_aligner_pose_of(bed.aligner, i),
                           b = cairn_aligner_pose_of(other.aligner, i);

        assert_memory_equal(&a, &b, sizeof a);
    }
    assert_status(cairn_aligner_set_initial_pose(NULL, 0, far), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_aligner_set_initial_pose(other.aligner, -1, far), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_aligner_set_initial_pose(other.aligner, 2, far), CAIRN_BAD_ARGUMENT);
    bad.theta = (cairn_real)NAN;
    assert_status(cairn_aligner_set_initial_pose(other.aligner, 0, bad), CAIRN_NOT_FINITE);
    bad = start_at(2e6, 0, 0);
    assert_status(cairn_aligner_set_initial_pose(other.aligner, 0, bad), CAIRN_BAD_ARGUMENT);
    assert_near(cairn_aligner_read(other.aligner).largest_size, 2, 0);
    end_bed(&bed);
    end_bed(&other);
}

/* ---- Golden results ---- */

/* All that is reported. */
static uint64_t hash_of_all(const struct bed *bed)
{
    cairn_aligner_result r = cairn_aligner_read(bed->aligner);
    int64_t numbers[] = {r.dropped,    r.merges, r.relocalized, r.iterations, r.fill,
                         r.hypotheses, r.anchor, r.worst_step,  r.units};
    cairn_real spreads[] = {r.initial_sigma, r.initial_sigma_theta};

    return test_hash(test_hash(hash_of(bed), numbers, sizeof numbers), spreads, sizeof spreads);
}

/* Scans of half a circle from places in a room with boxes and slanting walls; the last
 * `in_other_room` ones are in another room, and every `wild`-th has an initial error of a metre and
 * more. */
struct scene {
    int32_t scans, in_other_room, wild, hypotheses, oriented;
    double metres, degrees;
    uint64_t world; /* not 0: the seed of another world, with random walls and boxes */
    int32_t beams;
    uint64_t in_double, in_float;
};

static double drawn(cairn_random *random, double low, double high)
{
    return (double)cairn_random_uniform(random, (cairn_real)low, (cairn_real)high);
}

/* A room about the origin with boxes and walls near its sides. */
static void furnish(rooms_room *room, cairn_random *random)
{
    double width = drawn(random, 3.2, 5);
    double height = drawn(random, 2.2, 4);

    rooms_add_box(room, -width, -height, width, height);
    for (int32_t k = 0; k < 4; k++) {
        double y = (k % 2 ? 0.75 : -0.75) * height;
        double x = drawn(random, -width, width);
        double size = drawn(random, 0.1, 0.5);

        if (k < 2)
            rooms_add_box(room, x, y, x + size, y + size / 2);
        else
            rooms_add_wall(room, x, y, x + size, y + size);
    }
}

static uint64_t hash_of_scene(const struct scene *scene)
{
    cairn_aligner_params params = params_for(scene->scans);
    cairn_random random = cairn_random_seed((uint64_t)scene->scans, 9);
    const cairn_pose wild = {1, CAIRN_REAL(-0.5), 1};
    rooms_room rooms[2];
    rooms_scan taken;
    struct bed bed;
    uint64_t hash;

    memset(rooms, 0, sizeof rooms);
    rooms_add_box(&rooms[0], -3, -2.5, 3.5, 2.5);
    rooms_add_box(&rooms[0], 1.8, 1, 3.5, 2.5);
    rooms_add_box(&rooms[0], -0.7, -1.1, -0.2, -0.6);
    rooms_add_wall(&rooms[0], -3, 1, -1.8, 2.5);
    rooms_add_wall(&rooms[0], 1, -2.5, 1.7, -1.2);
    rooms_add_wall(&rooms[0], 1.7, -1.2, 2.4, -2.5);
    rooms_add_box(&rooms[1], -4, -3, 4, 2);
    rooms_add_box(&rooms[1], 1.5, -1, 4, 2);
    if (scene->world != 0) {
        cairn_random world = cairn_random_seed(scene->world, 10);

        memset(rooms, 0, sizeof rooms);
        furnish(&rooms[0], &world);
        furnish(&rooms[1], &world);
    }
    params.max_hypotheses = scene->hypotheses;
    params.oriented = scene->oriented;
    bed = make_bed(&params);
    for (int32_t i = 0; i < scene->scans; i++) {
        int32_t place = i / 2;
        cairn_real along = (cairn_real)place;
        cairn_pose pose = {CAIRN_REAL(0.55) * along - CAIRN_REAL(2.2),
                           CAIRN_REAL(0.3) * (cairn_real)(place % 3),
                           CAIRN_REAL(0.8) * along + CAIRN_REAL(2.6) * (cairn_real)(i % 2)};
        cairn_pose start = pose;
        cairn_scan_input input = rooms_take_scan(&rooms[i >= scene->scans - scene->in_other_room],
                                                 pose, (uint64_t)i + 1, &taken);

        input.count = scene->beams;
        start.x += (cairn_real)scene->metres * cairn_random_uniform(&random, -1, 1);
        start.y += (cairn_real)scene->metres * cairn_random_uniform(&random, -1, 1);
        start.theta += (cairn_real)(scene->degrees * DEGREE) * cairn_random_uniform(&random, -1, 1);
        if (scene->wild > 0 && i % scene->wild == 2)
            start = cairn_pose_compose(start, wild);
        add(&bed, &input, start);
    }
    run(&bed, CAIRN_UNBOUNDED);
    hash = hash_of_all(&bed);
    end_bed(&bed);
    return hash;
}

static void results_stay_as_they_are(void **state)
{
    static const struct scene scenes[] = {
        {12, 4, 0, 240, 1, 0.3, 20, 0, 190, UINT64_C(0x8ab31636700d29bc),
         UINT64_C(0x222975b072a5f3c1)},
        {16, 0, 0, 40, 1, 0.6, 40, 0, 190, UINT64_C(0xcdbb86bdebeb559e),
         UINT64_C(0x875b0581ff5fe6ed)},
        {8, 0, 0, 100, 1, 1.2, 90, 0, 190, UINT64_C(0xa802caf5b80095c7),
         UINT64_C(0x09212da928aab078)},
        {16, 0, 5, 300, 1, 0.1, 5, 0, 190, UINT64_C(0x445504b949c178b9),
         UINT64_C(0x9059ce6e99984386)},
        {10, 2, 4, 200, 0, 0.2, 10, 0, 190, UINT64_C(0x4385ceb47bec034e),
         UINT64_C(0x110827d0f9a6e7d2)},
        {12, 3, 0, 200, 1, 0.4, 20, 1, 120, UINT64_C(0xaf64981dc1bb2ad5),
         UINT64_C(0x4e257b91793bfe89)},
        {10, 0, 3, 200, 1, 0.2, 10, 2, 60, UINT64_C(0x39aaa2ec7a791a34),
         UINT64_C(0x22e0af65074a3b50)},
        {16, 5, 0, 300, 1, 0.5, 30, 3, 190, UINT64_C(0x96695f4c54fdbac2),
         UINT64_C(0xe3de4c8464d718cf)},
        {12, 2, 5, 200, 1, 0.3, 15, 4, 90, UINT64_C(0x52829841b7735f44),
         UINT64_C(0x85c793ecbb4bb7e6)},
        {10, 4, 0, 200, 0, 0.3, 20, 5, 150, UINT64_C(0xd231721de0794d74),
         UINT64_C(0x8405bb8e23197067)},
        {14, 0, 0, 250, 1, 0.8, 60, 6, 70, UINT64_C(0x798b89efe97ed8ed),
         UINT64_C(0x8b68811eb3e6c762)},
    };

    (void)state;
    for (size_t k = 0; k < sizeof scenes / sizeof *scenes; k++)
        assert_golden(hash_of_scene(&scenes[k]), scenes[k].in_double, scenes[k].in_float);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(results_stay_as_they_are),
        cmocka_unit_test(aligns_an_arena),
        cmocka_unit_test(unobservable_scans_spoil_no_solution),
        cmocka_unit_test(two_scans_have_the_same_covariance),
        cmocka_unit_test(covariances_are_relative_to_the_anchor),
        cmocka_unit_test(a_placed_scan_is_well_within_the_limit),
        cmocka_unit_test(cost_grows_with_the_scans),
        cmocka_unit_test(aligns_full_scans),
        cmocka_unit_test(order_does_not_matter),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(nothing_is_done_before_it_is_charged),
        cmocka_unit_test(an_alignment_can_be_watched),
        cmocka_unit_test(ingredients_matter),
        cmocka_unit_test(too_little_fill_is_a_verdict),
        cmocka_unit_test(two_scans_of_a_box),
        cmocka_unit_test(initial_poses_place_the_map),
        cmocka_unit_test(initial_poses_can_be_changed),
        cmocka_unit_test(a_flat_wall_is_not_observable),
        cmocka_unit_test(a_scan_is_translated_until_its_walls_meet),
        cmocka_unit_test(parts_that_do_not_meet),
        cmocka_unit_test(degenerate_scans),
        cmocka_unit_test(memory_is_exact),
        cmocka_unit_test(params_are_refused),
        cmocka_unit_test(too_large_a_system_is_refused_by_name),
        cmocka_unit_test(scans_are_refused),
        cmocka_unit_test(initial_poses_are_shown),
        cmocka_unit_test(initial_poses_can_be_given_again),
        cmocka_unit_test(unplaced_scans_are_searched_again),
    };

    return cmocka_run_group_tests(tests, open_scan, close_scan);
}
