/* The stages of the shape modes compared with reference implementations. */
#include "tests/match_bed.h"

#include <math.h>

#include "src/scans/scan_match_variants.h"
#include "src/scans/scan_match_work.h"

enum { ITEM_COUNT = 1024 };

/* Target and query overlap in part; the query is rotated by 0.02 rad and shifted. */
static void make_bed_of(bed *b, cairn_scan_match_mode mode, int32_t candidates)
{
    static const cairn_pose from = {CAIRN_REAL(0.5), CAIRN_REAL(-0.05), CAIRN_REAL(0.32)};
    static const cairn_pose home = {0, 0, CAIRN_REAL(0.3)};
    cairn_scan_match_params params = cairn_scan_match_default();

    params.mode = mode;
    params.max_candidates = candidates;
    open_bed(b, params, home, 9, from);
}

static void make_bed(bed *b, cairn_scan_match_mode mode)
{
    make_bed_of(b, mode, cairn_scan_match_default().max_candidates);
}

static void run_turned(bed *b, cairn_real angle)
{
    cairn_scan_match_window window = {2, angle};

    (void)run_in(b, &window);
}

static void run(bed *b)
{
    run_turned(b, 0);
}

/* Whether the vector of a pair is within 10 degrees of the line of one of its points. */
static int is_collinear(const bed *b, cairn_scan_match_pair pair)
{
    cairn_transform t = cairn_transform_of(b->start);
    const cairn_oriented_point *q = &b->query[pair.query], *p = &b->target[pair.target];
    cairn_vec2 from = cairn_transform_point(t, q->position),
               along = cairn_vec2_sub(p->position, from);
    cairn_vec2 lines[2] = {cairn_transform_direction(t, q->direction), p->direction};

    for (int k = 0; k < 2; k++)
        if (fabs(atan((double)cairn_vec2_cross(along, lines[k]) /
                      (double)cairn_vec2_dot(along, lines[k]))) < 10 * (double)CAIRN_PI / 180)
            return 1;
    return 0;
}

static void pairs_and_their_stages(void **state)
{
    int32_t count, at_stage[3] = {0, 0, 0};
    bed b;

    (void)state;
    make_bed(&b, CAIRN_SCAN_MATCH_SHAPE);
    run(&b);
    count = cairn_scan_match_pair_count(b.match);
    assert_true(count > 20 && count <= b.query_part.count && count <= b.target_part.count);
    for (int32_t i = 0; i < count; i++) {
        cairn_scan_match_pair pair = cairn_scan_match_pair_at(b.match, i);

        assert_in_range(pair.query, 0, b.query_part.count - 1);
        assert_in_range(pair.target, 0, b.target_part.count - 1);
        if (i > 0) {
            assert_true(pair.query > cairn_scan_match_pair_at(b.match, i - 1).query);
            assert_true(pair.target > cairn_scan_match_pair_at(b.match, i - 1).target);
        }
        assert_in_range(pair.stage, 0, 2);
        assert_true(pair.stage == CAIRN_SCAN_MATCH_REJECTED_COLINEAR || !is_collinear(&b, pair));
        at_stage[pair.stage]++;
    }
    assert_true(at_stage[CAIRN_SCAN_MATCH_REJECTED_COLINEAR] > 0 &&
                at_stage[CAIRN_SCAN_MATCH_ACCEPTED] > 5);
    test_pool_free(&b.pool);
}

/* Without a filter nothing is dropped by it. */
static void modes_up_to_a_stage(void **state)
{
    static const cairn_scan_match_mode modes[] = {
        CAIRN_SCAN_MATCH_SHAPE_COMMON, CAIRN_SCAN_MATCH_SHAPE_COLINEAR,
        CAIRN_SCAN_MATCH_SHAPE_SEGMENTS, CAIRN_SCAN_MATCH_SHAPE, CAIRN_SCAN_MATCH_SHAPE_LINES};
    int32_t dropped[5][3], counts[5];

    (void)state;
    memset(dropped, 0, sizeof dropped);
    for (int k = 0; k < 5; k++) {
        bed b;

        make_bed(&b, modes[k]);
        run(&b);
        counts[k] = cairn_scan_match_pair_count(b.match);
        for (int32_t i = 0; i < counts[k]; i++)
            dropped[k][cairn_scan_match_pair_at(b.match, i).stage]++;
        test_pool_free(&b.pool);
        assert_int_equal(counts[0], counts[k]);
    }
    assert_int_equal(dropped[0][CAIRN_SCAN_MATCH_ACCEPTED], counts[0]);
    assert_true(dropped[1][CAIRN_SCAN_MATCH_REJECTED_COLINEAR] >=
                dropped[2][CAIRN_SCAN_MATCH_REJECTED_COLINEAR]);
    assert_int_equal(dropped[1][CAIRN_SCAN_MATCH_REJECTED_SEGMENT], 0);
    assert_true(dropped[2][CAIRN_SCAN_MATCH_REJECTED_COLINEAR] > 0 &&
                dropped[2][CAIRN_SCAN_MATCH_ACCEPTED] > 0);
    assert_memory_equal(dropped[2], dropped[3], sizeof dropped[2]);
    assert_int_equal(dropped[4][CAIRN_SCAN_MATCH_REJECTED_COLINEAR], 0);
    assert_true(dropped[4][CAIRN_SCAN_MATCH_REJECTED_SEGMENT] > 0 &&
                dropped[4][CAIRN_SCAN_MATCH_ACCEPTED] > 0);
}

/* Whether points within half a metre of a point, at least a quarter of those in the fullest bin of
 * 10 degrees, lie off the line along its direction: 1, 0, or -1 where a point at the border of bins
 * or reach decides. */
static int is_descriptive(const cairn_oriented_point *points, int32_t count, int32_t i, double turn)
{
    const double direction =
        atan2((double)points[i].direction.y, (double)points[i].direction.x) + turn;
    const double step = (double)CAIRN_PI / 18, circle = 2 * (double)CAIRN_PI;
    const int along = (int)(fmod(direction + 2 * circle, circle) / step);
    int bins[CAIRN_SCAN_MATCH_BINS] = {0}, most = 1, border = 0, off_line = 0;

    border |= fabs(direction / step - rint(direction / step)) < 1e-3;
    for (int32_t k = 0; k < count; k++) {
        cairn_vec2 d = cairn_vec2_sub(points[k].position, points[i].position);
        double place = fmod(atan2((double)d.y, (double)d.x) + turn + 2 * circle, circle) / step;
        double distance = hypot((double)d.x, (double)d.y);

        if (k == i || distance > 0.501)
            continue;
        border |= distance > 0.499 || fabs(place - rint(place)) < 1e-3;
        bins[(int)place]++;
        most = bins[(int)place] > most ? bins[(int)place] : most;
    }
    for (int k = 0; k < CAIRN_SCAN_MATCH_BINS; k++) {
        int apart = (k - along + CAIRN_SCAN_MATCH_BINS) % 18;

        if (apart > 1 && apart < 17)
            off_line |= 255 * bins[k] / most >= 64;
    }
    return border ? -1 : off_line;
}

/* Before the collinear filter, points with only a straight line around them are dropped, too. */
static void points_of_straight_lines(void **state)
{
    int32_t straight = 0, descriptive = 0;
    bed b;

    (void)state;
    make_bed(&b, CAIRN_SCAN_MATCH_SHAPE_COLINEAR);
    b.start.theta = CAIRN_REAL(0.013);
    run(&b);
    for (int32_t i = 0; i < cairn_scan_match_pair_count(b.match); i++) {
        cairn_scan_match_pair pair = cairn_scan_match_pair_at(b.match, i);
        int first = is_descriptive(b.query, b.query_part.count, pair.query, (double)b.start.theta);
        int second = is_descriptive(b.target, b.target_part.count, pair.target, 0);

        if (first < 0 || second < 0 || is_collinear(&b, pair))
            continue;
        assert_int_equal(pair.stage, first && second ? CAIRN_SCAN_MATCH_ACCEPTED
                                                     : CAIRN_SCAN_MATCH_REJECTED_COLINEAR);
        straight += !(first && second);
        descriptive += first && second;
    }
    assert_true(straight > 5 && descriptive > 2);
    test_pool_free(&b.pool);
}

/* Pairs that the filters drop though their vector leads away from both lines, where the test is
 * certain, and those kept though one of their points has only a straight line around it. */
static void count_strict(const bed *b, int *dropped, int *kept)
{
    cairn_pose pose = cairn_scan_match_pair_pose(b->match);

    *dropped = *kept = 0;
    for (int32_t i = 0; i < cairn_scan_match_pair_count(b->match); i++) {
        cairn_scan_match_pair pair = cairn_scan_match_pair_at(b->match, i);
        int first = is_descriptive(b->query, b->query_part.count, pair.query, (double)pose.theta);
        int second = is_descriptive(b->target, b->target_part.count, pair.target, 0);

        if (first < 0 || second < 0 || is_collinear(b, pair))
            continue;
        *dropped += pair.stage == CAIRN_SCAN_MATCH_REJECTED_COLINEAR;
        *kept += pair.stage != CAIRN_SCAN_MATCH_REJECTED_COLINEAR && !(first && second);
    }
}

/* The filters are applied without the points of straight lines and with them; the reported pairs
 * are those of the winning one. */
static void pairs_of_one_pass(void **state)
{
    int won[2] = {0, 0};
    bed b;

    (void)state;
    make_bed(&b, CAIRN_SCAN_MATCH_SHAPE_SEGMENTS);
    for (int k = 0; k < 12; k++) {
        int dropped, kept;

        b.start.theta = CAIRN_REAL(0.013) + CAIRN_REAL(0.05) * (cairn_real)(k - 6);
        run(&b);
        count_strict(&b, &dropped, &kept);
        assert_true(dropped == 0 || kept == 0);
        won[0] += dropped > 0;
        won[1] += kept > 0;
    }
    assert_true(won[0] > 0 && won[1] > 0);
    test_pool_free(&b.pool);
}

/* 1 when the pairs' vectors of one segment, between jumps of 0.3 m, have this mean. */
static int has_segment_of_mean(const bed *b, cairn_vec2 mean)
{
    cairn_transform t = cairn_transform_of(cairn_scan_match_pair_pose(b->match));
    cairn_vec2 sum = {0, 0}, last_q = {0, 0}, last_p = {0, 0};
    int32_t count = cairn_scan_match_pair_count(b->match);
    cairn_real n = 0;

    for (int32_t i = 0; i <= count; i++) {
        cairn_scan_match_pair pair = cairn_scan_match_pair_at(b->match, i < count ? i : count - 1);
        cairn_vec2 q = cairn_transform_point(t, b->query[pair.query].position),
                   p = b->target[pair.target].position;

        if (i < count && pair.stage == CAIRN_SCAN_MATCH_REJECTED_COLINEAR)
            continue;
        if (n > 0 && (i == count || cairn_vec2_norm(cairn_vec2_sub(q, last_q)) >= CAIRN_REAL(0.3) ||
                      cairn_vec2_norm(cairn_vec2_sub(p, last_p)) >= CAIRN_REAL(0.3))) {
            if (cairn_vec2_norm(cairn_vec2_sub(cairn_vec2_scale(sum, 1 / n), mean)) <
                CAIRN_REAL(1e-4))
                return 1;
            n = 0;
            sum.x = sum.y = 0;
        }
        sum = cairn_vec2_add(sum, cairn_vec2_sub(p, q));
        n += 1;
        last_q = q;
        last_p = p;
    }
    return 0;
}

/* With many rotations, the pairs are those that gave the pose: without ICP it is the mean of a
 * segment's vectors. */
static void pairs_are_those_of_the_pose(void **state)
{
    int turned = 0;
    bed b;

    (void)state;
    make_bed(&b, CAIRN_SCAN_MATCH_SHAPE_SEGMENTS);
    for (int k = 0; k < 6; k++) {
        cairn_scan_match_result found;
        cairn_pose pose, placed;
        cairn_vec2 moved;

        b.start.theta = CAIRN_REAL(0.1) * (cairn_real)(k - 3);
        run_turned(&b, CAIRN_REAL(0.4));
        found = cairn_scan_match_read(b.match);
        assert_int_equal(found.count, 1);
        pose = found.hypotheses[0].target_query;
        placed = cairn_scan_match_pair_pose(b.match);
        assert_near(cairn_wrap_angle(pose.theta - placed.theta), 0, 1e-6);
        turned += fabs((double)(placed.theta - b.start.theta)) > 0.02;
        moved.x = pose.x - placed.x;
        moved.y = pose.y - placed.y;
        assert_true(has_segment_of_mean(&b, moved));
    }
    assert_true(turned > 2);
    test_pool_free(&b.pool);
}

/* Compared with counting by angles; a point so near to a border of bins that rounding decides is
 * skipped. */
static void histograms(void **state)
{
    cairn_real share[CAIRN_SCAN_MATCH_BINS];
    int compared = 0;
    bed b;

    (void)state;
    make_bed(&b, CAIRN_SCAN_MATCH_SHAPE);
    b.start.theta = CAIRN_REAL(0.5);
    assert_status(cairn_scan_match_histogram(b.match, 0, share), CAIRN_EMPTY);
    run(&b);
    for (int32_t i = 0; i < b.query_part.count; i++) {
        int count[CAIRN_SCAN_MATCH_BINS] = {0}, most = 1, near_border = 0;

        for (int32_t k = 0; k < b.query_part.count; k++) {
            cairn_vec2 d = cairn_vec2_sub(b.query[k].position, b.query[i].position);
            double distance = hypot((double)d.x, (double)d.y),
                   bearing = atan2((double)d.y, (double)d.x) + 0.5;
            double place =
                fmod(bearing + 4 * (double)CAIRN_PI, 2 * (double)CAIRN_PI) * 18 / (double)CAIRN_PI;

            if (k == i || distance > 0.51)
                continue;
            near_border |= fabs(distance - 0.5) < 1e-3 || fabs(place - rint(place)) < 1e-3;
            if (distance <= 0.5 && ++count[(int)place] > most)
                most = count[(int)place];
        }
        assert_ok(cairn_scan_match_histogram(b.match, i, share));
        if (near_border)
            continue;
        compared++;
        for (int k = 0; k < CAIRN_SCAN_MATCH_BINS; k++)
            assert_near(share[k], (double)count[k] / most, 0.005);
    }
    assert_true(compared > b.query_part.count / 4);
    assert_status(cairn_scan_match_histogram(b.match, -1, share), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_scan_match_histogram(b.match, b.query_part.count, share),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_scan_match_histogram(b.match, 0, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_scan_match_histogram(NULL, 0, share), CAIRN_BAD_ARGUMENT);
    test_pool_free(&b.pool);
}

static void nothing_to_show(void **state)
{
    cairn_real share[CAIRN_SCAN_MATCH_BINS];
    bed b;

    (void)state;
    make_bed(&b, CAIRN_SCAN_MATCH_CORRELATIVE);
    run(&b);
    assert_int_equal(cairn_scan_match_pair_count(b.match), 0);
    assert_status(cairn_scan_match_histogram(b.match, 0, share), CAIRN_EMPTY);
    test_pool_free(&b.pool);
    make_bed(&b, CAIRN_SCAN_MATCH_SHAPE);
    run(&b);
    assert_true(cairn_scan_match_pair_count(b.match) > 0);
    b.query_part.count = 0; /* earlier input is not shown for it */
    run(&b);
    assert_int_equal(cairn_scan_match_pair_count(b.match), 0);
    assert_status(cairn_scan_match_histogram(b.match, 0, share), CAIRN_EMPTY);
    assert_int_equal(cairn_scan_match_pair_count(NULL), 0);
    test_pool_free(&b.pool);
}

/* ---- The vote, compared with a reference implementation ---- */

static int32_t plain_bin(const cairn_oriented_point *p)
{
    double turns =
        atan2((double)p->direction.y, (double)p->direction.x) / (2 * (double)CAIRN_PI) * 65536;

    return (int32_t)floor((turns < 0 ? turns + 65536 : turns) * SCAN_MATCH_DIRECTION_BINS / 65536);
}

/* The cell of the grid for which a pair of points votes; -1: none. Positions are whole fractions of
 * a cell, as in the vote. */
static int32_t plain_cell(const bed *b, int32_t query, int32_t target)
{
    const scan_match_accumulator *v = &b->match->votes;
    const cairn_oriented_point p = b->query[query], m = b->match->target[target];
    cairn_pose heading = {0, 0, v->first_angle + (cairn_real)v->rotation * v->angle_step};
    cairn_transform turn = cairn_transform_of(heading);
    int32_t bin = cairn_scan_match_angle_bin(
        (uint16_t)(cairn_scan_match_quantize_angle(cairn_atan2(p.direction.y, p.direction.x)) +
                   cairn_scan_match_quantize_angle(cairn_wrap_angle(heading.theta))));
    int32_t apart = (bin - plain_bin(&m) + SCAN_MATCH_DIRECTION_BINS) % SCAN_MATCH_DIRECTION_BINS;
    scan_match_position corner = cairn_scan_match_quantize(
        b->match, cairn_vec2_add(cairn_transform_point(turn, p.position), v->origin));
    scan_match_position at = cairn_scan_match_quantize(b->match, m.position);
    double x = floor((double)(at.x - corner.x) / SCAN_MATCH_CELL_STEPS),
           y = floor((double)(at.y - corner.y) / SCAN_MATCH_CELL_STEPS);

    if (apart > 3 && apart < SCAN_MATCH_DIRECTION_BINS - 3)
        return -1;
    return x < 0 || y < 0 || x >= v->width || y >= v->height ? -1
                                                             : (int32_t)y * v->width + (int32_t)x;
}

/* Every query point votes with every target point; `once`: at most once for a cell. */
static void plain_votes(const bed *b, int once, int32_t *cell)
{
    static int32_t last[SCAN_MATCH_MAX_CELLS];
    const scan_match_accumulator *v = &b->match->votes;

    memset(cell, 0, (size_t)v->width * (size_t)v->height * sizeof *cell);
    memset(last, 0, sizeof last);
    for (int32_t i = 0; i < b->query_part.count; i += v->stride)
        for (int32_t k = 0; k < b->match->target_count; k++) {
            int32_t at = plain_cell(b, i, k);

            if (at < 0 || (once && last[at] == i + 1))
                continue;
            cell[at]++;
            last[at] = i + 1;
        }
}

static int32_t plain_window(const scan_match_accumulator *v, const int32_t *cell, int32_t column,
                            int32_t row)
{
    int32_t sum = 0;

    for (int32_t y = row; y < row + 2; y++)
        for (int32_t x = column; x < column + 2; x++)
            sum += x >= 0 && y >= 0 && x < v->width && y < v->height ? cell[y * v->width + x] : 0;
    return sum;
}

/* No point votes in a rotation. */
static void assert_no_votes(const bed *b, int32_t rotation)
{
    static int32_t cell[SCAN_MATCH_MAX_CELLS];
    scan_match_accumulator *v = &b->match->votes;
    int32_t current = v->rotation;

    v->rotation = rotation;
    plain_votes(b, 0, cell);
    v->rotation = current;
    for (int32_t at = 0; at < v->width * v->height; at++)
        assert_int_equal(cell[at], 0);
}

/* Whether all query points have voted in a rotation, whose peaks are not all tested yet. */
static int votes_are_complete(const bed *b)
{
    const scan_match_accumulator *v = &b->match->votes;

    return v->rotation < v->rotations && v->point >= b->query_part.count;
}

static void step_by_one(bed *b)
{
    cairn_budget budget = {1};

    assert_status(cairn_scan_match_step(b->match, &budget), CAIRN_MORE);
}

/* Steps until the votes of a rotation that has some are complete; 0 when all have been. */
static int next_rotation(bed *b)
{
    while (b->match->votes.rotation < b->match->votes.rotations) {
        step_by_one(b);
        if (votes_are_complete(b))
            return 1;
    }
    return 0;
}

/* Steps through the peaks of a rotation. */
static void pass_peaks(bed *b)
{
    while (votes_are_complete(b))
        step_by_one(b);
}

/* Peaks of this rotation by the plain votes; all are reported. A peak is a cell with votes whose
 * window of two by two cells has more votes than the neighbouring windows, or as many and comes
 * first. */
static int32_t assert_peaks(const bed *b, const int32_t *cell, int32_t rotation, int32_t already)
{
    const scan_match_accumulator *v = &b->match->votes;
    int32_t peaks = 0;

    for (int32_t at = 0; at < v->width * v->height; at++) {
        int32_t column = at % v->width, row = at / v->width,
                own = plain_window(v, cell, column, row), reported = 0;
        int32_t is_peak = cell[at] > 0;

        for (int32_t k = 0; k < 9 && is_peak; k++) {
            int32_t x = column + k % 3 - 1, y = row + k / 3 - 1;
            int32_t other =
                x < 0 || y < 0 || x >= v->width || y >= v->height ? 0 : plain_window(v, cell, x, y);

            is_peak = k < 4 ? other < own : other <= own;
        }
        if (!is_peak)
            continue;
        peaks++;
        for (int32_t i = 0; i < b->match->candidate_count; i++) {
            const scan_match_candidate *c = &b->match->candidates[i];

            reported +=
                fabs((double)(c->pose.x - v->origin.x) / (double)v->cell_size - column - 1) <
                    1e-3 &&
                fabs((double)(c->pose.y - v->origin.y) / (double)v->cell_size - row - 1) < 1e-3 &&
                fabs((double)cairn_wrap_angle(c->pose.theta - v->first_angle -
                                              (cairn_real)rotation * v->angle_step)) < 1e-3 &&
                fabs((double)c->score - own) < 0.5;
        }
        assert_int_equal(reported, 1);
    }
    assert_int_equal(b->match->candidate_count, already + peaks);
    return peaks;
}

static void votes_are_those_of_all_pairs(void **state)
{
    static int32_t cell[SCAN_MATCH_MAX_CELLS];
    const cairn_scan_match_window window = {1, CAIRN_REAL(0.3)};
    static bed b;
    int32_t rotations = 0, peaks = 0, votes = 0;

    (void)state;
    make_bed_of(&b, CAIRN_SCAN_MATCH_CORRELATIVE, ITEM_COUNT);
    assert_ok(cairn_scan_match_begin(b.match, &b.query_part, b.start, &window, NULL));
    b.match->votes.max_candidates = ITEM_COUNT; /* all peaks are kept */
    while (next_rotation(&b)) {
        int32_t rotation = b.match->votes.rotation;

        for (; rotations < rotation; rotations++)
            assert_no_votes(&b, rotations);
        plain_votes(&b, 0, cell);
        for (int32_t at = 0; at < b.match->votes.width * b.match->votes.height; at++) {
            assert_int_equal(b.match->votes.cell[at], cell[at]);
            votes += cell[at];
        }
        rotations++;
        if (rotation + 1 == b.match->votes.rotations) /* then the candidates are refined at once */
            break;
        pass_peaks(&b);
        peaks += assert_peaks(&b, cell, rotation, peaks);
    }
    assert_int_equal(rotations, b.match->votes.rotations);
    assert_true(rotations > 4 && votes > 1000 && peaks > 20);
    test_pool_free(&b.pool);
}

/* Without a guess a query point votes for a cell once, however many parts saw the wall. */
static void votes_of_everything_are_points(void **state)
{
    static int32_t cell[SCAN_MATCH_MAX_CELLS];
    static bed b;
    int32_t votes = 0, most = 0;

    (void)state;
    make_bed_of(&b, CAIRN_SCAN_MATCH_CORRELATIVE, 3);
    assert_ok(cairn_scan_match_add_target(
        b.match, &b.query_part, (cairn_pose){CAIRN_REAL(1.03), CAIRN_REAL(0.02), CAIRN_REAL(0.11)},
        NULL));
    assert_ok(cairn_scan_match_begin(b.match, &b.query_part, b.start, NULL, NULL));
    while (next_rotation(&b)) { /* all but those without votes */
        const scan_match_accumulator *v = &b.match->votes;

        plain_votes(&b, 1, cell);
        for (int32_t at = 0; at < v->width * v->height; at++) {
            assert_int_equal(v->cell[at] >> 8, cell[at]);
            votes += cell[at];
            most = most > cell[at] ? most : cell[at];
        }
        if (v->rotation + 1 == v->rotations)
            break;
        pass_peaks(&b);
    }
    assert_true(votes > 1000 && most > b.query_part.count / 4);
    test_pool_free(&b.pool);
}

/* ---- Charges ---- */

/* A bed without memory of earlier matches, whose match has begun; a window of one heading. */
static void begin_bed(bed *b, cairn_scan_match_mode mode)
{
    const cairn_scan_match_window window = {2, 0};

    make_bed(b, mode);
    assert_ok(cairn_scan_match_begin(b->match, &b->query_part, b->start, &window, NULL));
}

/* A block of the target's grid is reset when its units are charged. */
static void grids_are_reset_when_charged(void **state)
{
    const int32_t units = 8, not_reset = 7;
    bed b;

    (void)state;
    begin_bed(&b, CAIRN_SCAN_MATCH_CORRELATIVE);
    b.match->index.start[0] = not_reset;
    for (int32_t call = 1; call < units; call++) {
        step_by_one(&b);
        assert_int_equal(b.match->index.start[0], not_reset);
        assert_int_equal(cairn_scan_match_measured(b.match).units, call);
    }
    step_by_one(&b);
    assert_int_equal(b.match->index.start[0], 0);
    test_pool_free(&b.pool);
}

/* With one unit a call, the query is moved behind the calls that its 24 units are charged in, and
 * not before them: in these no pair is added. */
static void nothing_is_done_before_it_is_charged(void **state)
{
    const int32_t units = 24;
    int32_t calls = 0, quiet = 0, moved = 0, iteration = 0, pairs = 0;
    cairn_status status = CAIRN_MORE;
    bed b;

    (void)state;
    begin_bed(&b, CAIRN_SCAN_MATCH_CORRELATIVE);
    while (status == CAIRN_MORE) {
        const scan_match_fit *fit = &b.match->fit;
        cairn_budget one = {1};

        status = cairn_scan_match_step(b.match, &one);
        calls++;
        assert_int_equal(cairn_scan_match_measured(b.match).units, calls);
        assert_int_equal(cairn_scan_match_read(b.match).verdict == CAIRN_SCAN_MATCH_RUNNING,
                         status == CAIRN_MORE);
        if (fit->iteration > iteration) {
            assert_true(quiet >= units - 1);
            moved++;
        }
        quiet = fit->iteration == iteration && fit->robust.sums.pairs == pairs ? quiet + 1 : 0;
        iteration = fit->iteration;
        pairs = fit->robust.sums.pairs;
    }
    assert_ok(status);
    assert_true(moved > 10);
    test_pool_free(&b.pool);
}

/* A match that is begun again while the descriptors of the target are made, makes them anew. */
static void a_dropped_match_leaves_no_descriptors(void **state)
{
    const int32_t last_units = 4500, each = 150; /* the target has been described before the last */
    const cairn_scan_match_window window = {2, 0};
    cairn_scan_match_hypothesis expected;
    int32_t pairs;
    bed b;

    (void)state;
    make_bed(&b, CAIRN_SCAN_MATCH_SHAPE);
    expected = run_in(&b, &window).hypotheses[0];
    pairs = cairn_scan_match_pair_count(b.match);
    assert_true(pairs > 20);
    test_pool_free(&b.pool);
    for (int32_t units = each; units <= last_units; units += each) {
        cairn_budget some = {units};
        cairn_scan_match_result result;

        begin_bed(&b, CAIRN_SCAN_MATCH_SHAPE);
        assert_status(cairn_scan_match_step(b.match, &some), CAIRN_MORE);
        result = run_in(&b, &window);
        assert_int_equal(result.count, 1);
        assert_memory_equal(&result.hypotheses[0], &expected, sizeof expected);
        assert_int_equal(cairn_scan_match_pair_count(b.match), pairs);
        test_pool_free(&b.pool);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pairs_and_their_stages),
        cmocka_unit_test(modes_up_to_a_stage),
        cmocka_unit_test(points_of_straight_lines),
        cmocka_unit_test(pairs_of_one_pass),
        cmocka_unit_test(pairs_are_those_of_the_pose),
        cmocka_unit_test(histograms),
        cmocka_unit_test(nothing_to_show),
        cmocka_unit_test(votes_are_those_of_all_pairs),
        cmocka_unit_test(votes_of_everything_are_points),
        cmocka_unit_test(grids_are_reset_when_charged),
        cmocka_unit_test(nothing_is_done_before_it_is_charged),
        cmocka_unit_test(a_dropped_match_leaves_no_descriptors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
