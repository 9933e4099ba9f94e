/* scan_match as written: every stage compared with a reference implementation. */
#include "tests/match_bed.h"

#include <math.h>

#include "tests/rooms.h"
#include "src/scans/scan_match_variants.h"

static const double DEGREE = 0.017453292519943295;

#define assert_pose_near(actual, expected, metres, radians)                                        \
    do {                                                                                           \
        cairn_pose actual_pose = (actual), expected_pose = (expected);                             \
        assert_near(actual_pose.x, expected_pose.x, metres);                                       \
        assert_near(actual_pose.y, expected_pose.y, metres);                                       \
        assert_near(cairn_wrap_angle(actual_pose.theta - expected_pose.theta), 0, radians);        \
    } while (0)

static cairn_scan_match_params small_params(cairn_scan_match_mode mode)
{
    cairn_scan_match_params params = cairn_scan_match_as_written();

    params.mode = mode;
    params.max_query = MAX_COUNT;
    params.max_target = 2 * MAX_COUNT;
    return params;
}

/* Target and query share seven walls of the room; the query is rotated by 1.3 degrees and
 * shifted. */
static void make_bed(bed *b, cairn_scan_match_mode mode)
{
    static const cairn_pose from = {CAIRN_REAL(0.35), CAIRN_REAL(-0.15), CAIRN_REAL(0.3227)};
    static const cairn_pose home = {0, 0, CAIRN_REAL(0.3)};

    open_bed(b, small_params(mode), home, 10, from);
    b->truth = cairn_pose_between(home, from);
}

/* ---- The reference implementation ---- */

typedef struct reference {
    double query[MAX_COUNT][2],
        target[MAX_COUNT][2]; /* of the pairs kept by the collinear filter */
    int32_t count;
    double x, y, distance; /* the translation of the winning segment, and its mean distance */
    int32_t kept;
} reference;

/* Angle between two lines, rad, 0 ... pi / 2. */
static double between_lines(double ax, double ay, double bx, double by)
{
    return acos(fmin(fabs(ax * bx + ay * by) / (hypot(ax, ay) * hypot(bx, by)), 1));
}

/* Marks the pairs dropped by the collinear filter as printed, checks it, and keeps the rest. */
static void filter_pairs(const bed *b, reference *out, int32_t *dropped)
{
    cairn_pose pose = cairn_scan_match_pair_pose(b->match);
    double c = cos((double)pose.theta), s = sin((double)pose.theta);

    out->count = *dropped = 0;
    for (int32_t i = 0; i < cairn_scan_match_pair_count(b->match); i++) {
        cairn_scan_match_pair pair = cairn_scan_match_pair_at(b->match, i);
        const cairn_oriented_point *q = &b->query[pair.query], *p = &b->target[pair.target];
        double qx = c * (double)q->position.x - s * (double)q->position.y + (double)pose.x;
        double qy = s * (double)q->position.x + c * (double)q->position.y + (double)pose.y;
        double vx = (double)p->position.x - qx, vy = (double)p->position.y - qy;
        double one = between_lines(vx, vy, (double)p->direction.x, (double)p->direction.y);
        double other =
            between_lines(vx, vy, c * (double)q->direction.x - s * (double)q->direction.y,
                          s * (double)q->direction.x + c * (double)q->direction.y);
        int drops = fmin(one, other) < 10 * DEGREE;

        if (fabs(fmin(one, other) - 10 * DEGREE) > 1e-4)
            assert_int_equal(pair.stage == CAIRN_SCAN_MATCH_REJECTED_COLINEAR, drops);
        *dropped += pair.stage == CAIRN_SCAN_MATCH_REJECTED_COLINEAR;
        if (pair.stage == CAIRN_SCAN_MATCH_REJECTED_COLINEAR)
            continue;
        out->query[out->count][0] = qx;
        out->query[out->count][1] = qy;
        out->target[out->count][0] = (double)p->position.x;
        out->target[out->count++][1] = (double)p->position.y;
    }
}

static double jump(const double a[2], const double b[2])
{
    return hypot(a[0] - b[0], a[1] - b[1]);
}

/* Mean vector of pairs first ... end-1, and their mean distance from a translation. */
static void mean_vector(const reference *t, int32_t first, int32_t end, double mean[2])
{
    mean[0] = mean[1] = 0;
    for (int32_t i = first; i < end; i++)
        for (int k = 0; k < 2; k++)
            mean[k] += (t->target[i][k] - t->query[i][k]) / (end - first);
}

static double off(const reference *t, int32_t i, const double mean[2])
{
    return hypot(t->target[i][0] - t->query[i][0] - mean[0],
                 t->target[i][1] - t->query[i][1] - mean[1]);
}

static double mean_off(const reference *t, int32_t first, int32_t end, const double mean[2])
{
    double sum = 0;

    for (int32_t i = first; i < end; i++)
        sum += off(t, i, mean);
    return sum / (end - first);
}

/* The segment filter and the segment-wise translation, 6.2.4 and 6.3. */
static void translate(reference *t)
{
    int32_t first[MAX_COUNT + 1], segments = 0, best = -1, most = 0, agrees[MAX_COUNT];

    for (int32_t i = 0; i < t->count; i++)
        if (i == 0 || jump(t->query[i], t->query[i - 1]) >= 0.3 ||
            jump(t->target[i], t->target[i - 1]) >= 0.3)
            first[segments++] = i;
    first[segments] = t->count;
    for (int32_t m = 0; m < segments; m++) {
        double mean[2], own;
        int32_t left = 0;

        mean_vector(t, first[m], first[m + 1], mean);
        own = mean_off(t, first[m], first[m + 1], mean);
        for (int32_t k = 0; k < segments; k++)
            if (k == m || mean_off(t, first[k], first[k + 1], mean) <= 2 * own + 0.2)
                left += first[k + 1] - first[k];
        if (left > most) {
            most = left;
            best = m;
        }
    }
    assert_true(best >= 0);
    {
        double mean[2], own;

        mean_vector(t, first[best], first[best + 1], mean);
        own = mean_off(t, first[best], first[best + 1], mean);
        for (int32_t k = 0; k < segments; k++)
            agrees[k] = k == best || mean_off(t, first[k], first[k + 1], mean) <= 2 * own + 0.2;
    }
    t->kept = 0;
    for (int32_t m = 0; m < segments; m++) {
        double mean[2], own;
        int32_t left = 0;

        if (!agrees[m])
            continue;
        mean_vector(t, first[m], first[m + 1], mean);
        own = mean_off(t, first[m], first[m + 1], mean);
        for (int32_t k = 0; k < segments; k++)
            for (int32_t i = first[k]; agrees[k] && i < first[k + 1]; i++)
                left += off(t, i, mean) <= own + 1e-6;
        if (left > t->kept) {
            t->kept = left;
            t->x = mean[0];
            t->y = mean[1];
            t->distance = own;
        }
    }
}

typedef struct overlap {
    int32_t count;
    /* of the pairs within `gate`: from and to; about their means */
    double distance, mean[4], cross, dot;
    int32_t pairs;
} overlap;

/* Query points that overlap the target within `reach`; the pairs of those within `gate`. */
static overlap overlap_at(const bed *b, cairn_pose pose, double reach, double gate)
{
    double c = cos((double)pose.theta), s = sin((double)pose.theta);
    static double all[MAX_COUNT][4];
    overlap out;

    memset(&out, 0, sizeof out);
    for (int32_t i = 0; i < b->query_part.count; i++) {
        const cairn_oriented_point *q = &b->query[i];
        double x = c * (double)q->position.x - s * (double)q->position.y + (double)pose.x;
        double y = s * (double)q->position.x + c * (double)q->position.y + (double)pose.y;
        double dx = c * (double)q->direction.x - s * (double)q->direction.y;
        double dy = s * (double)q->direction.x + c * (double)q->direction.y, nearest = 1e9;
        int32_t at = -1;

        for (int32_t k = 0; k < b->target_part.count; k++) {
            const cairn_oriented_point *p = &b->target[k];
            double distance = hypot((double)p->position.x - x, (double)p->position.y - y);

            if (distance < nearest &&
                dx * (double)p->direction.x + dy * (double)p->direction.y >= cos(10 * DEGREE)) {
                nearest = distance;
                at = k;
            }
        }
        if (nearest >= reach)
            continue;
        out.count++;
        out.distance += nearest;
        if (nearest >= gate)
            continue;
        all[out.pairs][0] = x;
        all[out.pairs][1] = y;
        all[out.pairs][2] = (double)b->target[at].position.x;
        all[out.pairs++][3] = (double)b->target[at].position.y;
    }
    for (int32_t i = 0; i < out.pairs; i++)
        for (int k = 0; k < 4; k++)
            out.mean[k] += all[i][k] / out.pairs;
    for (int32_t i = 0; i < out.pairs; i++) {
        double ax = all[i][0] - out.mean[0], ay = all[i][1] - out.mean[1];
        double bx = all[i][2] - out.mean[2], by = all[i][3] - out.mean[3];

        out.cross += ax * by - ay * bx;
        out.dot += ax * bx + ay * by;
    }
    out.distance /= out.count > 0 ? out.count : 1;
    return out;
}

/* ICP of 6.4 from a pose. */
static cairn_pose icp(const bed *b, cairn_pose pose, double reach)
{
    cairn_pose last = pose;
    overlap before = overlap_at(b, pose, reach, 0);

    for (int k = 0; k < 20; k++) {
        overlap pairs = overlap_at(b, pose, reach, before.distance), now;
        double turn = atan2(pairs.cross, pairs.dot), c = cos(turn), s = sin(turn);
        double x = (double)pose.x - pairs.mean[0], y = (double)pose.y - pairs.mean[1];

        last = pose;
        pose.x = (cairn_real)(c * x - s * y + pairs.mean[2]);
        pose.y = (cairn_real)(s * x + c * y + pairs.mean[3]);
        pose.theta = (cairn_real)((double)pose.theta + turn);
        now = overlap_at(b, pose, reach, 0);
        if (now.count < before.count && now.distance > before.distance)
            return last;
        before = now;
    }
    return pose;
}

/* ---- Tests ---- */

static void finds_and_each_stage_follows_its_reference(void **state)
{
    static const cairn_pose starts[] = {
        {0, 0, 0}, {CAIRN_REAL(0.2), CAIRN_REAL(-0.1), 0}, {-1, 1, CAIRN_REAL(0.02)}};
    const cairn_scan_match_window window = {2, 2 * CAIRN_PI / 180};
    int32_t all_dropped = 0, all_kept = 0;

    (void)state;
    for (int k = 0; k < 3; k++) {
        static bed b, whole;
        static reference t;
        cairn_scan_match_result by_shape, found;
        cairn_pose pose, expected;
        int32_t dropped;

        make_bed(&b, CAIRN_SCAN_MATCH_AS_WRITTEN_SEGMENTS);
        b.start = starts[k];
        by_shape = run_in(&b, &window);
        assert_int_equal(by_shape.count, 1);
        assert_int_equal(cairn_scan_match_measured(b.match).candidates, 5);
        filter_pairs(&b, &t, &dropped);
        translate(&t);
        all_dropped += dropped;
        all_kept += t.count;
        pose = by_shape.hypotheses[0].target_query;
        assert_near(pose.theta, cairn_scan_match_pair_pose(b.match).theta, 1e-6);
        assert_near(pose.x, (double)b.start.x + t.x, NUMBER(1e-9, 1e-4));
        assert_near(pose.y, (double)b.start.y + t.y, NUMBER(1e-9, 1e-4));

        make_bed(&whole, CAIRN_SCAN_MATCH_AS_WRITTEN);
        whole.start = starts[k];
        found = run_in(&whole, &window);
        assert_int_equal(found.count, 1);
        expected = icp(&whole, pose, t.distance + 0.4);
        assert_pose_near(found.hypotheses[0].target_query, expected, NUMBER(1e-9, 2e-2),
                         NUMBER(1e-9, 1e-2));
        if (k < 2)
            assert_pose_near(found.hypotheses[0].target_query, b.truth, 0.15, 0.06);
        test_pool_free(&b.pool);
        test_pool_free(&whole.pool);
    }
    assert_true(all_dropped > 5 && all_kept > 20);
}

/* Points of bare walls that the other modes omit are kept when their vectors lead off the walls. */
static void the_collinear_filter_by_itself(void **state)
{
    static bed b;
    static reference t;
    int32_t dropped, count;

    (void)state;
    make_bed(&b, CAIRN_SCAN_MATCH_AS_WRITTEN_COLINEAR);
    for (int k = 0; k < 8; k++) {
        b.start.x = CAIRN_REAL(0.13) * (cairn_real)k;
        b.start.y = CAIRN_REAL(-0.21) * (cairn_real)(k % 3);
        (void)run_in(&b, NULL);
        filter_pairs(&b, &t, &dropped);
        count = cairn_scan_match_pair_count(b.match);
        assert_true(count > 20 && dropped + t.count == count);
    }
    test_pool_free(&b.pool);
    make_bed(&b, CAIRN_SCAN_MATCH_AS_WRITTEN_LINES);
    (void)run_in(&b, NULL);
    for (int32_t i = 0; i < cairn_scan_match_pair_count(b.match); i++)
        assert_true(cairn_scan_match_pair_at(b.match, i).stage !=
                    CAIRN_SCAN_MATCH_REJECTED_COLINEAR);
    test_pool_free(&b.pool);
}

static void every_degree_of_the_window(void **state)
{
    static const struct {
        double degrees;
        int32_t rotations;
    } windows[] = {{0, 1}, {0.9, 1}, {2, 5}, {5, 11}, {7.5, 15}, {180, 360}, {400, 360}};
    static bed b;

    (void)state;
    make_bed(&b, CAIRN_SCAN_MATCH_AS_WRITTEN_COMMON);
    b.query_part.count = 40;
    b.start.theta = CAIRN_REAL(0.1);
    for (size_t k = 0; k < sizeof windows / sizeof *windows; k++) {
        cairn_scan_match_window window = {0, (cairn_real)(windows[k].degrees * DEGREE)};
        double turned;

        (void)run_in(&b, &window);
        assert_int_equal(cairn_scan_match_measured(b.match).candidates, windows[k].rotations);
        turned = (double)(cairn_scan_match_pair_pose(b.match).theta - b.start.theta) / DEGREE;
        assert_near(turned, round(turned), 1e-3);
    }
    test_pool_free(&b.pool);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t each[] = {1, 7, 1000};
    cairn_scan_match_hypothesis whole;
    int64_t units;
    static bed b;

    (void)state;
    make_bed(&b, CAIRN_SCAN_MATCH_AS_WRITTEN);
    b.query_part.count = b.target_part.count = 90;
    cairn_scan_match_clear_target(b.match);
    assert_ok(cairn_scan_match_add_target(b.match, &b.target_part, cairn_pose_identity(), NULL));
    assert_int_equal(run_in(&b, NULL).count, 1);
    whole = cairn_scan_match_read(b.match).hypotheses[0];
    units = cairn_scan_match_measured(b.match).units;
    for (int k = 0; k < 3; k++) {
        cairn_status status = CAIRN_MORE;
        int64_t used = 0;

        cairn_scan_match_clear_target(b.match);
        assert_ok(
            cairn_scan_match_add_target(b.match, &b.target_part, cairn_pose_identity(), NULL));
        assert_ok(cairn_scan_match_begin(b.match, &b.query_part, b.start, NULL, NULL));
        while (status == CAIRN_MORE) {
            cairn_budget budget = {each[k]};

            status = cairn_scan_match_step(b.match, &budget);
            assert_true(budget.left >= 0);
            used += each[k] - budget.left;
            if (status == CAIRN_MORE) {
                assert_int_equal(cairn_scan_match_read(b.match).verdict, CAIRN_SCAN_MATCH_RUNNING);
                assert_int_equal(cairn_scan_match_read(b.match).count, 0);
            }
        }
        assert_ok(status);
        assert_int_equal(used, units);
        assert_memory_equal(&whole, &cairn_scan_match_read(b.match).hypotheses[0], sizeof whole);
    }
    test_pool_free(&b.pool);
}

/* Each half of a scan matched as a whole finds its own pose, by the overlap distance of the
 * whole. */
static void parts_by_icp_alone(void **state)
{
    const cairn_scan_match_window window = {CAIRN_REAL(0.05), CAIRN_REAL(0.005)};
    static bed b;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_scan_match_hypothesis first;
    cairn_scan_match_part half;
    cairn_scan_match_result found;
    cairn_fault fault;
    cairn_pose start, expected;

    (void)state;
    make_bed(&b, CAIRN_SCAN_MATCH_AS_WRITTEN);
    start = b.truth;
    start.x += CAIRN_REAL(0.06);
    start.theta -= CAIRN_REAL(0.01);
    expected = icp(&b, start, 0.4);
    assert_ok(cairn_scan_match_begin_icp(b.match, &b.query_part, start, NULL));
    assert_ok(cairn_scan_match_step(b.match, &budget));
    found = cairn_scan_match_read(b.match);
    assert_int_equal(found.count, 1);
    assert_pose_near(found.hypotheses[0].target_query, expected, NUMBER(1e-9, 2e-2),
                     NUMBER(1e-9, 1e-2));
    assert_int_equal(cairn_scan_match_pair_count(b.match), 0);

    /* the window of a search before does not matter */
    first = found.hypotheses[0];
    (void)run_in(&b, &window);
    budget.left = CAIRN_UNBOUNDED;
    assert_ok(cairn_scan_match_begin_icp(b.match, &b.query_part, start, NULL));
    assert_ok(cairn_scan_match_step(b.match, &budget));
    assert_memory_equal(&first, &cairn_scan_match_read(b.match).hypotheses[0], sizeof first);

    (void)run_in(&b, NULL); /* the target's descriptors are still known */
    assert_int_equal(cairn_scan_match_read(b.match).count, 1);
    half = b.query_part;
    half.count /= 2;
    budget.left = CAIRN_UNBOUNDED;
    assert_ok(cairn_scan_match_begin_icp(b.match, &half, start, NULL));
    assert_ok(cairn_scan_match_step(b.match, &budget));
    assert_pose_near(cairn_scan_match_read(b.match).hypotheses[0].target_query, b.truth, 0.1, 0.05);

    start.x = 500;
    assert_ok(cairn_scan_match_begin_icp(b.match, &half, start, NULL));
    budget.left = CAIRN_UNBOUNDED;
    assert_ok(cairn_scan_match_step(b.match, &budget));
    assert_int_equal(cairn_scan_match_read(b.match).count, 0);
    assert_int_equal(cairn_scan_match_read(b.match).verdict, CAIRN_SCAN_MATCH_NONE);
    half.count = 0;
    assert_ok(cairn_scan_match_begin_icp(b.match, &half, start, NULL));
    assert_int_equal(cairn_scan_match_read(b.match).verdict, CAIRN_SCAN_MATCH_NONE);
    half.count = -1;
    assert_fault(&fault, cairn_scan_match_begin_icp(b.match, &half, start, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    half.count = MAX_COUNT + 1;
    start.x = (cairn_real)NAN;
    assert_fault(&fault, cairn_scan_match_begin_icp(b.match, &b.query_part, start, &fault),
                 CAIRN_NOT_FINITE, -1);
    assert_fault(&fault, cairn_scan_match_begin_icp(b.match, NULL, start, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_status(cairn_scan_match_begin_icp(NULL, &half, start, NULL), CAIRN_BAD_ARGUMENT);
    test_pool_free(&b.pool);

    make_bed(&b, CAIRN_SCAN_MATCH_SHAPE);
    assert_fault(&fault, cairn_scan_match_begin_icp(b.match, &b.query_part, b.truth, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    test_pool_free(&b.pool);
}

/* No shapes agree: no hypothesis. */
static void nothing_in_common(void **state)
{
    static bed b;

    (void)state;
    make_bed(&b, CAIRN_SCAN_MATCH_AS_WRITTEN);
    b.query_part.count = 4; /* of one wall, whose direction differs from all */
    for (int32_t i = 0; i < 4; i++) {
        b.query[i].direction.x = CAIRN_REAL(0.6);
        b.query[i].direction.y = CAIRN_REAL(0.8);
    }
    b.target_part.count = 20;
    cairn_scan_match_clear_target(b.match);
    assert_ok(cairn_scan_match_add_target(b.match, &b.target_part, cairn_pose_identity(), NULL));
    assert_int_equal(run_in(&b, NULL).count, 0);
    assert_int_equal(cairn_scan_match_read(b.match).verdict, CAIRN_SCAN_MATCH_NONE);
    test_pool_free(&b.pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_scan_match *match;

    return cairn_scan_match_create(&match, pool, context);
}

/* The fault says the public modes; those of the variants are accepted. */
static void modes_are_the_public_ones_and_the_variants(void **state)
{
    cairn_scan_match_params params = cairn_scan_match_default();
    cairn_object_fault fault = {.field = NULL};

    (void)state;
    for (params.mode = -2; params.mode <= SCAN_MATCH_LAST_VARIANT + 2; params.mode++) {
        int is_public = params.mode >= CAIRN_SCAN_MATCH_CORRELATIVE &&
                        params.mode <= CAIRN_SCAN_MATCH_AS_WRITTEN_SEGMENTS;

        if (is_public || scan_match_is_variant(params.mode)) {
            assert_ok(cairn_scan_match_check(&params, NULL));
            continue;
        }
        assert_status(cairn_scan_match_check(&params, &fault), CAIRN_BAD_ARGUMENT);
        assert_string_equal(fault.field, "mode");
        assert_true(fault.lowest == CAIRN_SCAN_MATCH_CORRELATIVE &&
                    fault.highest == CAIRN_SCAN_MATCH_AS_WRITTEN_SEGMENTS);
    }
    /* The other fields are checked in a variant, too. */
    params.mode = SCAN_MATCH_FIRST_VARIANT;
    params.max_target = 0;
    assert_status(cairn_scan_match_check(&params, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.field, "max_target");
    assert_status(cairn_scan_match_check(NULL, &fault), CAIRN_BAD_ARGUMENT);
}

static void memory_is_as_stated(void **state)
{
    cairn_scan_match_params params = small_params(CAIRN_SCAN_MATCH_AS_WRITTEN);

    (void)state;
    params.max_query = 6;
    params.max_target = 5;
    test_every_pool_size(create, &params, cairn_scan_match_memory(&params));
    params.mode = SCAN_MATCH_LAST_VARIANT + 1;
    assert_int_equal(cairn_scan_match_memory(&params), 0);
    params = cairn_scan_match_as_written();
    assert_int_equal(params.mode, CAIRN_MODE_AS_WRITTEN);
    assert_int_equal(params.max_target, 4812);
    assert_int_equal(params.max_query, 1604);
}

/* A reading for every beam that hit, with the direction of the nearest segment. */
static void readings_have_the_direction_of_the_nearest_segment(void **state)
{
    static rooms_scan taken;
    cairn_oriented_point readings[ROOMS_BEAMS];
    cairn_scan_params params = cairn_scan_default();
    cairn_budget budget = {CAIRN_UNBOUNDED};
    rooms_room box = {.count = 0};
    cairn_scan_input input;
    cairn_scan_view view;
    cairn_pool pool;
    cairn_scan *scan;
    int32_t count, at = 0;

    (void)state;
    rooms_add_box(&box, -3, -2, 3, 2);
    rooms_add_box(&box, 1, 0.5, 1.8, 1.1);
    input = rooms_take_scan(&box, (cairn_pose){0, 0, CAIRN_REAL(0.4)}, 3, &taken);
    for (int i = 0; i < ROOMS_BEAMS; i += 9)
        taken.range[i] = i % 2 ? (float)NAN : 0;
    pool = test_pool(cairn_scan_memory(&params));
    assert_ok(cairn_scan_create(&scan, &pool, &params));
    assert_ok(cairn_scan_begin(scan, &input, NULL));
    assert_ok(cairn_scan_step(scan, &budget));
    view = cairn_scan_read(scan);
    count = cairn_scan_match_readings(&view, readings);
    for (int32_t i = 0; i < view.beam_count; i++) {
        double nearest = 1e9, own = 1e9;

        if (view.beams[i].kind != CAIRN_SCAN_BEAM_HIT)
            continue;
        assert_true(at < count);
        assert_near(readings[at].position.x, view.beams[i].to.x, 0);
        assert_near(cairn_vec2_norm(readings[at].direction), 1, 1e-5);
        for (int32_t k = 0; k < view.segment_count; k++) {
            cairn_vec2 along =
                cairn_vec2_unit(cairn_vec2_sub(view.segments[k].b, view.segments[k].a));
            cairn_vec2 foot = cairn_segment_nearest(view.segments[k], view.beams[i].to, NULL);
            double distance = (double)cairn_vec2_norm(cairn_vec2_sub(foot, view.beams[i].to));

            nearest = fmin(nearest, distance);
            if (cairn_vec2_dot(along, readings[at].direction) > CAIRN_REAL(0.99999))
                own = fmin(own, distance);
        }
        assert_near(own, nearest, 1e-5);
        at++;
    }
    assert_true(count == at && count > 200 && count < ROOMS_BEAMS);
    view.segment_count = 0;
    assert_int_equal(cairn_scan_match_readings(&view, readings), 0);
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(finds_and_each_stage_follows_its_reference),
        cmocka_unit_test(the_collinear_filter_by_itself),
        cmocka_unit_test(every_degree_of_the_window),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(parts_by_icp_alone),
        cmocka_unit_test(nothing_in_common),
        cmocka_unit_test(modes_are_the_public_ones_and_the_variants),
        cmocka_unit_test(memory_is_as_stated),
        cmocka_unit_test(readings_have_the_direction_of_the_nearest_segment),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
