/* scan_match: shape-based matching, as in Adluru 2008, chapter 6, without an initial guess.
 *
 * Method:
 * 1. Descriptor of a point: its direction and the angular histogram of the bearings of its scan's
 *    points within 0.5 m, in 36 bins divided by the largest (6.2.1, 6.2.2).
 * 2. For each rotation of the query: longest common subsequence of the two point sequences by
 *    dynamic programming (6.2.3).
 * 3. Collinear filter: correspondences whose vector runs along the line of one of their points are
 *    dropped (6.2.4).
 * 4. Segment filter: segments of the list that disagree with the best segment are dropped; the
 *    translation of the segment with most consistent pairs is taken (6.2.4).
 * 5. The rotation with the largest scan overlap wins (6.3).
 * 6. ICP with gates, rolled back when overlap and distance both get worse (6.4).
 *
 * The collinear filter exists because the shape of a straight line is ambiguous along it. While the
 * frames are not aligned, the direction of a vector has little information, and all points of walls
 * pass alike. Mode SHAPE therefore applies the filters twice, and the overlap decides as between
 * rotations: first without the points that have nothing but a straight line about them, then with
 * them, as written. The reported pairs are those of the winning rotation and filters, which are
 * replayed. Choices that the thesis leaves open: headings every 5 degrees over the window (every 1
 * when it is at most 5 wide), then every 1 about the best; ICP point to point in closed form, its
 * gate the mean distance of its pairs but at least 1.5 spacings (scan_match_shape_icp.c). Mode
 * AS_WRITTEN takes the readings themselves, every degree, and applies each filter once, as printed;
 * its ICP is in scan_match_written.c, its choices in the header.
 * Layout: histograms in bytes, 0 ... 255 for 0 ... 1. */
#include "src/base/build.h"

#include <string.h>

#include "src/scans/scan_match_shape.h"

static const cairn_real RAD_PER_DEG = CAIRN_PI / 180;
static const cairn_real DESCRIPTOR_RADIUS_M = CAIRN_REAL(0.5); /* m: radius of a descriptor */
/* sine of 10 degrees: similar directions */
static const cairn_real SIMILAR_SINE = CAIRN_REAL(0.17364818);
/* m: jump between segments of the correspondence list */
static const cairn_real SEGMENT_JUMP_M = CAIRN_REAL(0.3);
static const cairn_real SEGMENT_FACTOR = 2, SEGMENT_SLACK_M = CAIRN_REAL(0.2);
static const cairn_real OVERLAP_SLACK_M = CAIRN_REAL(0.4); /* m */
/* as written, a window short of a whole degree by this share of a degree includes it */
static const cairn_real WINDOW_SLACK_STEPS = CAIRN_REAL(1e-3);

enum {
    BIN_THRESHOLD = 64,
    MAX_DIFFERENT_BINS = 2,
    COARSE_STEP_DEGREES = 5,
    POINTS_PER_COUNT = 30 /* points of a histogram that are counted in one operation */
};

/* Costs in parts of a unit: a histogram, points of its scan, and a bearing within its radius; a
 * pair that is filtered, the second time with lines; a segment that is tested, and a pair for it. */
enum {
    PARTS_PER_HISTOGRAM = 16,
    POINTS_PER_PART = 3,
    PARTS_PER_BEARING = 6,
    PARTS_PER_STRICT_FILTER = 60,
    PARTS_PER_FILTER = 20,
    PARTS_PER_SEGMENT = 8,
    PARTS_PER_PAIR = 2
};

/* ---- Descriptors ---- */

static int32_t bearing_bin(cairn_vec2 d)
{
    int32_t bin = cairn_real_to_int(
        cairn_floor(cairn_atan2(d.y, d.x) * (SCAN_MATCH_SHAPE_BINS / (2 * CAIRN_PI))));

    return (bin + SCAN_MATCH_SHAPE_BINS) % SCAN_MATCH_SHAPE_BINS;
}

/* Starts the histogram of points[i] among points[first ... end-1]. */
static void begin_histogram(scan_match_histogram *histogram, const cairn_oriented_point *points,
                            int32_t i, int32_t first, int32_t end)
{
    histogram->points = points;
    histogram->point = i;
    histogram->first = histogram->next = first;
    histogram->end = end;
    memset(histogram->count, 0, sizeof histogram->count);
}

/* Counts the points up to `end`; returns the number of those within the radius. */
static CAIRN_STEP_NOT_INLINED int32_t count_bearings(scan_match_histogram *histogram, int32_t end)
{
    const cairn_oriented_point *points = histogram->points;
    int32_t i = histogram->point, counted = 0;

    for (int32_t k = histogram->next; k < end; k++) {
        cairn_vec2 d = cairn_vec2_sub(points[k].position, points[i].position);

        if (k == i || cairn_vec2_norm_squared(d) > DESCRIPTOR_RADIUS_M * DESCRIPTOR_RADIUS_M)
            continue;
        histogram->count[bearing_bin(cairn_transform_direction(histogram->rotation, d))]++;
        counted++;
    }
    histogram->next = end;
    return counted;
}

/* Continues the histogram; returns 1 when it is complete, 0 when the budget is used up. */
static int count_points(cairn_scan_match *match, cairn_budget *budget)
{
    scan_match_histogram *histogram = &match->shape->histogram;

    while (histogram->next < histogram->end) {
        int32_t left = histogram->end - histogram->next,
                count = left < POINTS_PER_COUNT ? left : POINTS_PER_COUNT;

        if (!cairn_scan_match_charge(match, budget,
                                     count / POINTS_PER_PART + PARTS_PER_BEARING * count))
            return 0;
        match->parts_ahead +=
            PARTS_PER_BEARING * (count - count_bearings(histogram, histogram->next + count));
    }
    return 1;
}

static void store_histogram(const scan_match_histogram *histogram,
                            scan_match_shape_descriptor *descriptor)
{
    int32_t most = 1;

    for (int32_t b = 0; b < SCAN_MATCH_SHAPE_BINS; b++)
        most = histogram->count[b] > most ? histogram->count[b] : most;
    for (int32_t b = 0; b < SCAN_MATCH_SHAPE_BINS; b++)
        descriptor->bin[b] = (uint8_t)(255 * histogram->count[b] / most);
}

/* Starts the histogram of a target point among those of its part. */
static void begin_target_histogram(cairn_scan_match *match, int32_t i)
{
    scan_match_shape *shape = match->shape;
    int32_t first = shape->histogram.first, end = shape->histogram.end;

    if (i == end) {
        first = i;
        while (end < match->target_count && shape->target_part[end] == shape->target_part[i])
            end++;
    }
    begin_histogram(&shape->histogram, match->target, i, first, end);
}

int cairn_scan_match_shape_describe_target(cairn_scan_match *match, cairn_budget *budget)
{
    scan_match_shape *shape = match->shape;
    scan_match_histogram *histogram = &shape->histogram;

    CAIRN_STEP_BEGIN(match->resume.phase);
    histogram->rotation = cairn_transform_of(cairn_pose_identity());
    histogram->point = histogram->end = 0;
    while (histogram->point < match->target_count) {
        SCAN_MATCH_CHARGE(phase, PARTS_PER_HISTOGRAM);
        begin_target_histogram(match, histogram->point);
        CAIRN_STEP_RUN(match, resume.phase, budget, count_points);
        store_histogram(histogram, &shape->target[histogram->point++]);
    }
    CAIRN_STEP_END(match->resume.phase);
}

static int are_similar(const scan_match_shape_descriptor *a, const scan_match_shape_descriptor *b)
{
    int32_t differ = 0;

    for (int32_t k = 0; k < SCAN_MATCH_SHAPE_BINS && differ <= MAX_DIFFERENT_BINS; k++)
        differ += a->bin[k] > b->bin[k] + BIN_THRESHOLD || b->bin[k] > a->bin[k] + BIN_THRESHOLD;
    return differ <= MAX_DIFFERENT_BINS;
}

static cairn_real compare(const void *context, int32_t i, int32_t j)
{
    const cairn_scan_match *match = context;
    const scan_match_shape *shape = match->shape;

    return cairn_vec2_dot(shape->rotated_query[i].direction, match->target[j].direction) >=
               SCAN_MATCH_SIMILAR_COSINE &&
           are_similar(&shape->query[i], &shape->target[j]);
}

/* ---- Rotations ---- */

void cairn_scan_match_shape_begin(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;
    cairn_real half = match->has_window ? cairn_min(match->window.angle, CAIRN_PI) : CAIRN_PI;
    int32_t steps;

    if (cairn_scan_match_is_as_written(match) && !match->has_window)
        half = CAIRN_SCAN_MATCH_WRITTEN_HEADING;
    shape->shift.x = match->has_window ? match->start.x : 0;
    shape->shift.y = match->has_window ? match->start.y : 0;
    shape->step = half <= COARSE_STEP_DEGREES * RAD_PER_DEG || cairn_scan_match_is_as_written(match)
                      ? RAD_PER_DEG
                      : COARSE_STEP_DEGREES * RAD_PER_DEG;
    steps = cairn_real_to_int(cairn_floor(
        half / shape->step + (cairn_scan_match_is_as_written(match) ? WINDOW_SLACK_STEPS : 0)));
    shape->rotations = 2 * steps + 1;
    shape->first_angle =
        (match->has_window ? match->start.theta : 0) - shape->step * (cairn_real)steps;
    if (half >= CAIRN_PI)
        shape->rotations--;
    shape->rotation = 0;
    shape->is_fine = shape->step < 2 * RAD_PER_DEG;
    shape->best_overlap = -1;
}

static cairn_real angle_of(const scan_match_shape *shape)
{
    return shape->first_angle + shape->step * (cairn_real)shape->rotation;
}

/* Takes the next rotation. */
static void begin_rotation(scan_match_shape *shape)
{
    cairn_pose turn = {0, 0, angle_of(shape)};

    shape->rotated_angle = turn.theta;
    shape->rotation_transform = cairn_transform_of(turn);
    shape->histogram.rotation = shape->rotation_transform;
    shape->histogram.point = 0;
}

/* Rotates a query point, and starts its histogram. */
static void rotate_point(cairn_scan_match *match, int32_t i)
{
    scan_match_shape *shape = match->shape;
    cairn_oriented_point *p = &shape->rotated_query[i];
    const cairn_oriented_point *q = &match->query.points[i];

    p->position =
        cairn_vec2_add(cairn_transform_point(shape->rotation_transform, q->position), shape->shift);
    p->direction = cairn_transform_direction(shape->rotation_transform, q->direction);
    begin_histogram(&shape->histogram, match->query.points, i, 0, match->query.count);
}

/* Continues the common subsequence; returns 1 when it is found, 0 when the budget is used up. */
static int align_sequences(cairn_scan_match *match, cairn_budget *budget)
{
    return cairn_sequence_step(match->shape->sequence, budget) == CAIRN_OK;
}

/* Part: the query in this rotation, its histograms, and the common subsequence. */
static int rotate_query(cairn_scan_match *match, cairn_budget *budget)
{
    scan_match_shape *shape = match->shape;
    scan_match_histogram *histogram = &shape->histogram;

    CAIRN_STEP_BEGIN(match->resume.part);
    begin_rotation(shape);
    while (histogram->point < match->query.count) {
        SCAN_MATCH_CHARGE(part, PARTS_PER_HISTOGRAM);
        rotate_point(match, histogram->point);
        CAIRN_STEP_RUN(match, resume.part, budget, count_points);
        store_histogram(histogram, &shape->query[histogram->point++]);
    }
    cairn_must_be_ok(cairn_sequence_begin(shape->sequence, match->query.count, match->target_count,
                                          compare, match));
    CAIRN_STEP_RUN(match, resume.part, budget, align_sequences);
    CAIRN_STEP_END(match->resume.part);
}

/* ---- Correspondences ---- */

static cairn_vec2 vector_of(const cairn_scan_match *match, cairn_sequence_pair pair)
{
    return cairn_vec2_sub(match->target[pair.second].position,
                          match->shape->rotated_query[pair.first].position);
}

/* Returns 1 when the vector of the pair runs along the line of one of its points. */
static int is_collinear(const cairn_scan_match *match, cairn_sequence_pair pair)
{
    cairn_vec2 along = cairn_vec2_unit(vector_of(match, pair));

    if (cairn_vec2_norm_squared(along) < CAIRN_REAL(0.5))
        return 0;
    return cairn_abs(cairn_vec2_cross(along, match->target[pair.second].direction)) <
               SIMILAR_SINE ||
           cairn_abs(cairn_vec2_cross(along, match->shape->rotated_query[pair.first].direction)) <
               SIMILAR_SINE;
}

/* Returns 1 when the neighbourhood of a point is a straight line along its direction. */
static int32_t is_straight(const scan_match_shape_descriptor *descriptor, cairn_vec2 direction)
{
    const int32_t half = SCAN_MATCH_SHAPE_BINS / 2;
    int32_t along = bearing_bin(direction);

    for (int32_t b = 0; b < SCAN_MATCH_SHAPE_BINS; b++) {
        int32_t off = (b - along + SCAN_MATCH_SHAPE_BINS) % half;

        if (descriptor->bin[b] >= BIN_THRESHOLD && off > 1 && off < half - 1)
            return 0;
    }
    return 1;
}

/* Returns 1 when the collinear filter rejects the pair. */
static int32_t is_rejected(const cairn_scan_match *match, cairn_sequence_pair pair)
{
    const scan_match_shape *shape = match->shape;

    if (!cairn_scan_match_has_collinear_filter(match))
        return 0;
    if (cairn_scan_match_is_as_written(match))
        return is_collinear(match, pair);
    return is_collinear(match, pair) ||
           (!shape->with_lines &&
            (is_straight(&shape->query[pair.first], shape->rotated_query[pair.first].direction) ||
             is_straight(&shape->target[pair.second], match->target[pair.second].direction)));
}

static cairn_real gap_between(cairn_vec2 a, cairn_vec2 b)
{
    return cairn_vec2_norm(cairn_vec2_sub(a, b));
}

/* Rejects a pair of the common subsequence, or adds it to its segment. */
static void filter_pair(cairn_scan_match *match, cairn_sequence_pair pair)
{
    scan_match_shape *shape = match->shape;
    cairn_sequence_pair last;

    if (is_rejected(match, pair))
        return;
    last = shape->pairs[shape->pair_count > 0 ? shape->pair_count - 1 : 0];
    if (shape->pair_count == 0 ||
        gap_between(shape->rotated_query[pair.first].position,
                    shape->rotated_query[last.first].position) >= SEGMENT_JUMP_M ||
        gap_between(match->target[pair.second].position, match->target[last.second].position) >=
            SEGMENT_JUMP_M)
        shape->segments[shape->segment_count++].first = shape->pair_count;
    shape->pairs[shape->pair_count++] = pair;
}

static cairn_vec2 mean_of(const cairn_scan_match *match, int32_t first, int32_t end)
{
    cairn_vec2 sum = {0, 0};

    for (int32_t k = first; k < end; k++)
        sum = cairn_vec2_add(sum, vector_of(match, match->shape->pairs[k]));
    return cairn_vec2_scale(sum, 1 / (cairn_real)(end > first ? end - first : 1));
}

static cairn_real mean_distance(const cairn_scan_match *match, int32_t first, int32_t end,
                                cairn_vec2 shift)
{
    cairn_real sum = 0;

    for (int32_t k = first; k < end; k++)
        sum += gap_between(vector_of(match, match->shape->pairs[k]), shift);
    return sum / (cairn_real)(end > first ? end - first : 1);
}

/* Tests a segment as the main one, and the consistency of the others with it. The main segment
 * with most consistent pairs is selected. */
static void test_main(cairn_scan_match *match, int32_t i)
{
    scan_match_shape *shape = match->shape;
    scan_match_shape_segment *main = &shape->segments[i];
    cairn_vec2 shift = mean_of(match, main[0].first, main[1].first);
    cairn_real most = SEGMENT_FACTOR * mean_distance(match, main[0].first, main[1].first, shift) +
                      SEGMENT_SLACK_M;
    int32_t left = 0;

    for (int32_t k = 0; k < shape->segment_count; k++) {
        scan_match_shape_segment *other = &shape->segments[k];

        other->is_consistent =
            k == i || mean_distance(match, other[0].first, other[1].first, shift) <= most;
        left += other->is_consistent ? other[1].first - other[0].first : 0;
    }
    if (left <= shape->most_pairs)
        return;
    shape->most_pairs = left;
    for (int32_t k = 0; k < shape->segment_count; k++)
        shape->segments[k].is_selected = shape->segments[k].is_consistent;
}

/* Cost of the test of a segment, or of a translation, with all pairs. */
static int32_t test_parts(const scan_match_shape *shape)
{
    return PARTS_PER_SEGMENT + PARTS_PER_PAIR * shape->pair_count;
}

/* Part: the pairs of the common subsequence that pass the filters, and their segments. */
static int filter_pairs(cairn_scan_match *match, cairn_budget *budget)
{
    scan_match_shape *shape = match->shape;
    cairn_sequence_result common = cairn_sequence_read(shape->sequence);

    CAIRN_STEP_BEGIN(match->resume.part);
    shape->segment_count = shape->pair_count = shape->most_pairs = 0;
    for (shape->filtered = 0; shape->filtered < common.count; shape->filtered++) {
        SCAN_MATCH_CHARGE(part, shape->with_lines ? PARTS_PER_FILTER : PARTS_PER_STRICT_FILTER);
        filter_pair(match, common.pairs[shape->filtered]);
    }
    shape->segments[shape->segment_count].first = shape->pair_count;
    for (shape->tested = 0; shape->tested < shape->segment_count; shape->tested++) {
        SCAN_MATCH_CHARGE(part, test_parts(shape));
        test_main(match, shape->tested);
    }
    CAIRN_STEP_END(match->resume.part);
}

/* Without the segment filter: the mean translation of all pairs. */
static void shift_by_all(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;

    shape->best_shift = mean_of(match, 0, shape->pair_count);
    shape->best_distance = mean_distance(match, 0, shape->pair_count, shape->best_shift);
    shape->most_pairs = shape->pair_count;
}

/* Tests the translation of a selected segment by the number of consistent pairs. */
static void test_translation(cairn_scan_match *match, const scan_match_shape_segment *own)
{
    scan_match_shape *shape = match->shape;
    cairn_vec2 shift = mean_of(match, own[0].first, own[1].first);
    cairn_real distance = mean_distance(match, own[0].first, own[1].first, shift);
    int32_t left = 0;

    for (int32_t k = 0; k < shape->segment_count; k++)
        for (int32_t i = shape->segments[k].first;
             shape->segments[k].is_selected && i < shape->segments[k + 1].first; i++)
            left += gap_between(vector_of(match, shape->pairs[i]), shift) <=
                    distance + CAIRN_REAL(1e-6);
    if (left <= shape->most_pairs)
        return;
    shape->most_pairs = left;
    shape->best_shift = shift;
    shape->best_distance = distance;
}

/* Part: the translation of this rotation. */
static int translate(cairn_scan_match *match, cairn_budget *budget)
{
    scan_match_shape *shape = match->shape;

    CAIRN_STEP_BEGIN(match->resume.part);
    shape->most_pairs = 0;
    if (!cairn_scan_match_has_segment_filter(match)) {
        SCAN_MATCH_CHARGE(part, test_parts(shape));
        shift_by_all(match);
    } else {
        for (shape->tested = 0; shape->tested < shape->segment_count; shape->tested++) {
            SCAN_MATCH_CHARGE(part, test_parts(shape));
            if (shape->segments[shape->tested].is_selected)
                test_translation(match, &shape->segments[shape->tested]);
        }
    }
    CAIRN_STEP_END(match->resume.part);
}

/* ---- Overlap ---- */

/* Starts the pass for the overlap of this rotation and translation. */
static void begin_overlap(scan_match_shape *shape)
{
    scan_match_shape_pass *pass = &shape->pass;

    memset(&pass->sums, 0, sizeof pass->sums);
    pass->target_query = shape->rotation_transform;
    pass->target_query.x = shape->shift.x + shape->best_shift.x;
    pass->target_query.y = shape->shift.y + shape->best_shift.y;
    pass->gate = shape->best_distance + OVERLAP_SLACK_M;
    pass->pair_gate = -1;
}

/* Keeps this rotation and translation when their overlap is the greatest so far. */
static void keep_best(scan_match_shape *shape)
{
    const scan_match_shape_pass *pass = &shape->pass;

    if (pass->sums.overlap <= shape->best_overlap)
        return;
    shape->best_overlap = pass->sums.overlap;
    shape->gate = pass->gate;
    shape->best_angle = shape->rotated_angle;
    shape->best_with_lines = shape->with_lines;
    shape->best.x = pass->target_query.x;
    shape->best.y = pass->target_query.y;
    shape->best.theta = cairn_wrap_angle(shape->best_angle);
}

/* Returns 1 when the filters are applied again, with the points of straight lines. */
static int filters_again(const cairn_scan_match *match)
{
    return !match->shape->with_lines && (match->params.mode == CAIRN_SCAN_MATCH_SHAPE ||
                                         match->params.mode == CAIRN_SCAN_MATCH_SHAPE_SEGMENTS);
}

/* Takes the next rotation, after the coarse ones those about the best; returns 0 when all have been
 * tried. */
static int next_rotation(scan_match_shape *shape)
{
    if (++shape->rotation < shape->rotations)
        return 1;
    if (shape->is_fine || shape->best_overlap < 0)
        return 0;
    shape->is_fine = 1;
    shape->step = RAD_PER_DEG;
    shape->rotations = 2 * COARSE_STEP_DEGREES - 1;
    shape->rotation = 0;
    shape->first_angle = shape->best.theta - shape->step * (cairn_real)(COARSE_STEP_DEGREES - 1);
    return 1;
}

/* Takes the best rotation again, for the reported pairs; returns 0 when it is the last one, whose
 * common subsequence is stored. */
static int replay_best(scan_match_shape *shape)
{
    shape->with_lines = shape->best_with_lines;
    shape->first_angle = shape->best_angle;
    shape->rotation = 0;
    return shape->rotated_angle != shape->best_angle;
}

int cairn_scan_match_shape_search(cairn_scan_match *match, cairn_budget *budget)
{
    scan_match_shape *shape = match->shape;

    CAIRN_STEP_BEGIN(match->resume.phase);
    do {
        CAIRN_STEP_RUN(match, resume.phase, budget, rotate_query);
        for (shape->with_lines = 0;; shape->with_lines = 1) {
            CAIRN_STEP_RUN(match, resume.phase, budget, filter_pairs);
            CAIRN_STEP_RUN(match, resume.phase, budget, translate);
            if (shape->most_pairs > 0) {
                begin_overlap(shape);
                CAIRN_STEP_RUN(match, resume.phase, budget, cairn_scan_match_shape_pass);
                keep_best(shape);
            }
            match->measure.candidates++;
            if (!filters_again(match))
                break;
        }
    } while (next_rotation(shape));
    if (shape->best_overlap > 0) {
        if (replay_best(shape))
            CAIRN_STEP_RUN(match, resume.phase, budget, rotate_query);
        CAIRN_STEP_RUN(match, resume.phase, budget, filter_pairs);
    }
    CAIRN_STEP_END(match->resume.phase);
}

void cairn_scan_match_shape_begin_icp(cairn_scan_match *match, cairn_pose start)
{
    scan_match_shape *shape = match->shape;

    shape->rotations = 0;
    shape->best = start;
    shape->best_overlap = 1;
    shape->gate = shape->overlap_gate > 0 ? shape->overlap_gate : OVERLAP_SLACK_M;
}
