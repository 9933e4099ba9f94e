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
 * gate the mean distance of its pairs but at least 1.5 spacings. Mode AS_WRITTEN takes the readings
 * themselves, every degree, and applies each filter once, as printed; its ICP is in
 * scan_match_written.c, its choices in the header.
 * Layout: histograms in bytes, 0 ... 255 for 0 ... 1. */
#include "src/base/build.h"

#include <string.h>

#include "src/scans/scan_match_shape.h"

static const cairn_real RAD_PER_DEG = CAIRN_PI / 180;
static const cairn_real DESCRIPTOR_RADIUS_M = CAIRN_REAL(0.5); /* m: radius of a descriptor */
/* cosine and sine of 10 degrees: similar directions */
static const cairn_real SIMILAR_COSINE = CAIRN_REAL(0.98480775);
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
    MAX_ITERATIONS = 20,
    MIN_PAIRS = 3
};

/* ---- Descriptors ---- */

static int32_t bearing_bin(cairn_vec2 d)
{
    int32_t bin = cairn_real_to_int(
        cairn_floor(cairn_atan2(d.y, d.x) * (SCAN_MATCH_SHAPE_BINS / (2 * CAIRN_PI))));

    return (bin + SCAN_MATCH_SHAPE_BINS) % SCAN_MATCH_SHAPE_BINS;
}

/* Computes the histogram of points[i] among points[first ... end-1], rotated. */
static void describe(cairn_scan_match *match, const cairn_oriented_point *points, int32_t i,
                     int32_t first, int32_t end, cairn_transform turn,
                     scan_match_shape_descriptor *descriptor)
{
    int32_t count[SCAN_MATCH_SHAPE_BINS] = {0}, most = 1;

    for (int32_t k = first; k < end; k++) {
        cairn_vec2 d = cairn_vec2_sub(points[k].position, points[i].position);
        int32_t bin;

        if (k == i || cairn_vec2_norm_squared(d) > DESCRIPTOR_RADIUS_M * DESCRIPTOR_RADIUS_M)
            continue;
        bin = bearing_bin(cairn_transform_direction(turn, d));
        count[bin]++;
        most = count[bin] > most ? count[bin] : most;
        cairn_scan_match_charge(match, 6);
    }
    cairn_scan_match_charge(match, (end - first) / 3 + 16);
    for (int32_t b = 0; b < SCAN_MATCH_SHAPE_BINS; b++)
        descriptor->bin[b] = (uint8_t)(255 * count[b] / most);
}

int32_t cairn_scan_match_shape_describe_target(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;
    cairn_transform still = cairn_transform_of(cairn_pose_identity());
    int32_t part = shape->target_part[match->index_in_phase], first = match->index_in_phase,
            end = match->index_in_phase + 1;

    if (match->index_in_phase > 0 && shape->target_part[match->index_in_phase - 1] == part)
        first = shape->part_first;
    while (end < match->target_count && shape->target_part[end] == part)
        end++;
    shape->part_first = first;
    describe(match, match->target, match->index_in_phase, first, end, still,
             &shape->target[match->index_in_phase]);
    return ++match->index_in_phase == match->target_count;
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
               SIMILAR_COSINE &&
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
    shape->with_lines = shape->is_replay = 0;
}

static cairn_real angle_of(const scan_match_shape *shape)
{
    return shape->first_angle + shape->step * (cairn_real)shape->rotation;
}

/* Rotates one query point and computes its histogram. */
int32_t cairn_scan_match_shape_rotate(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;
    cairn_pose turn = {0, 0, 0};
    cairn_oriented_point *p = &shape->rotated_query[match->index_in_phase];

    if (match->index_in_phase == 0) {
        turn.theta = shape->rotated_angle = angle_of(shape);
        shape->rotation_transform = cairn_transform_of(turn);
    }
    p->position =
        cairn_vec2_add(cairn_transform_point(shape->rotation_transform,
                                             match->query.points[match->index_in_phase].position),
                       shape->shift);
    p->direction = cairn_transform_direction(shape->rotation_transform,
                                             match->query.points[match->index_in_phase].direction);
    describe(match, match->query.points, match->index_in_phase, 0, match->query.count,
             shape->rotation_transform, &shape->query[match->index_in_phase]);
    if (++match->index_in_phase < match->query.count)
        return 0;
    cairn_must_be_ok(cairn_sequence_begin(shape->sequence, match->query.count, match->target_count,
                                          compare, match));
    return 1;
}

cairn_status cairn_scan_match_shape_align(cairn_scan_match *match, cairn_budget *budget)
{
    int32_t before = budget->left;
    cairn_status status = cairn_sequence_step(match->shape->sequence, budget);

    match->measure.units += before - budget->left;
    return status;
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

/* One pair of the common subsequence: rejected, or added to its segment. */
int32_t cairn_scan_match_shape_filter(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;
    cairn_sequence_result common = cairn_sequence_read(shape->sequence);

    if (match->index_in_phase == 0)
        shape->segment_count = shape->pair_count = 0;
    cairn_scan_match_charge(match, shape->with_lines ? 20 : 60);
    if (match->index_in_phase < common.count) {
        cairn_sequence_pair pair = common.pairs[match->index_in_phase++], last;

        if (!is_rejected(match, pair)) {
            last = shape->pairs[shape->pair_count > 0 ? shape->pair_count - 1 : 0];
            if (shape->pair_count == 0 ||
                gap_between(shape->rotated_query[pair.first].position,
                            shape->rotated_query[last.first].position) >= SEGMENT_JUMP_M ||
                gap_between(match->target[pair.second].position,
                            match->target[last.second].position) >= SEGMENT_JUMP_M)
                shape->segments[shape->segment_count++].first = shape->pair_count;
            shape->pairs[shape->pair_count++] = pair;
        }
    }
    if (match->index_in_phase < common.count)
        return 0;
    shape->segments[shape->segment_count].first = shape->pair_count;
    shape->most_pairs = 0;
    return 1;
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

/* Tests one segment as the main one, and the consistency of the others with it. The main segment
 * with most consistent pairs is selected. */
int32_t cairn_scan_match_shape_segment(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;
    scan_match_shape_segment *main;
    cairn_vec2 shift;
    cairn_real most;
    int32_t left = 0;

    cairn_scan_match_charge(match, 8 + 2 * shape->pair_count);
    if (match->index_in_phase == shape->segment_count)
        return 1;
    main = &shape->segments[match->index_in_phase];
    shift = mean_of(match, main[0].first, main[1].first);
    most = SEGMENT_FACTOR * mean_distance(match, main[0].first, main[1].first, shift) +
           SEGMENT_SLACK_M;
    for (int32_t k = 0; k < shape->segment_count; k++) {
        scan_match_shape_segment *other = &shape->segments[k];

        other->is_consistent = k == match->index_in_phase ||
                               mean_distance(match, other[0].first, other[1].first, shift) <= most;
        left += other->is_consistent ? other[1].first - other[0].first : 0;
    }
    if (left > shape->most_pairs) {
        shape->most_pairs = left;
        for (int32_t k = 0; k < shape->segment_count; k++)
            shape->segments[k].is_selected = shape->segments[k].is_consistent;
    }
    return ++match->index_in_phase == shape->segment_count;
}

/* Without the segment filter: the mean translation of all pairs. */
static void shift_by_all(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;

    shape->best_shift = mean_of(match, 0, shape->pair_count);
    shape->best_distance = mean_distance(match, 0, shape->pair_count, shape->best_shift);
    shape->most_pairs = shape->pair_count;
}

/* Tests the translation of one selected segment by the number of consistent pairs. */
int32_t cairn_scan_match_shape_translate(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;
    int32_t left = 0;

    cairn_scan_match_charge(match, 8 + 2 * shape->pair_count);
    if (match->index_in_phase == 0)
        shape->most_pairs = 0;
    if (!cairn_scan_match_has_segment_filter(match)) {
        shift_by_all(match);
        return 1;
    }
    if (match->index_in_phase == shape->segment_count)
        return 1;
    if (shape->segments[match->index_in_phase].is_selected) {
        const scan_match_shape_segment *own = &shape->segments[match->index_in_phase];
        cairn_vec2 shift = mean_of(match, own[0].first, own[1].first);
        cairn_real distance = mean_distance(match, own[0].first, own[1].first, shift);

        for (int32_t k = 0; k < shape->segment_count; k++)
            for (int32_t i = shape->segments[k].first;
                 shape->segments[k].is_selected && i < shape->segments[k + 1].first; i++)
                left += gap_between(vector_of(match, shape->pairs[i]), shift) <=
                        distance + CAIRN_REAL(1e-6);
        if (left > shape->most_pairs) {
            shape->most_pairs = left;
            shape->best_shift = shift;
            shape->best_distance = distance;
        }
    }
    return ++match->index_in_phase == shape->segment_count;
}

/* ---- Overlap ---- */

const cairn_oriented_point *cairn_scan_match_shape_nearest(cairn_scan_match *match,
                                                           const cairn_oriented_point *point,
                                                           cairn_transform transform,
                                                           cairn_real gate, cairn_vec2 *p,
                                                           cairn_real *distance)
{
    scan_match_search search;
    int32_t parts = 8;
    const cairn_oriented_point *found;

    *p = search.p = cairn_transform_point(transform, point->position);
    search.direction = cairn_transform_direction(transform, point->direction);
    search.cosine = SIMILAR_COSINE;
    found = cairn_scan_match_index_nearest(&match->index, &search, gate, &parts);
    *distance = found != NULL ? cairn_sqrt(search.nearest) : 0;
    cairn_scan_match_charge(match, parts);
    return found;
}

/* Applies the filters again with the points of straight lines, or takes the next rotation. */
static void next_rotation(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;

    shape->with_lines =
        !shape->with_lines && (match->params.mode == CAIRN_SCAN_MATCH_SHAPE ||
                               match->params.mode == CAIRN_SCAN_MATCH_SHAPE_SEGMENTS);
    if (shape->with_lines)
        return;
    if (++shape->rotation < shape->rotations || shape->is_fine || shape->best_overlap < 0)
        return;
    shape->is_fine = 1;
    shape->step = RAD_PER_DEG;
    shape->rotations = 2 * COARSE_STEP_DEGREES - 1;
    shape->rotation = 0;
    shape->first_angle = shape->best.theta - shape->step * (cairn_real)(COARSE_STEP_DEGREES - 1);
}

/* Tests one query point for overlap; at the end of a rotation the best is stored. Returns 1 at the
 * end of the query. */
int32_t cairn_scan_match_shape_overlap(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;
    cairn_transform at = shape->rotation_transform;
    cairn_real distance;
    cairn_vec2 p;

    if (match->index_in_phase == 0)
        shape->overlap = 0;
    at.x = shape->shift.x + shape->best_shift.x;
    at.y = shape->shift.y + shape->best_shift.y;
    if (shape->most_pairs > 0)
        shape->overlap += cairn_scan_match_shape_nearest(
                              match, &match->query.points[match->index_in_phase], at,
                              shape->best_distance + OVERLAP_SLACK_M, &p, &distance) != NULL;
    cairn_scan_match_charge(match, 2);
    if (++match->index_in_phase < match->query.count)
        return 0;
    if (shape->most_pairs > 0 && shape->overlap > shape->best_overlap) {
        shape->best_overlap = shape->overlap;
        shape->gate = shape->best_distance + OVERLAP_SLACK_M;
        shape->best_angle = angle_of(shape);
        shape->best_with_lines = shape->with_lines;
        shape->best.x = at.x;
        shape->best.y = at.y;
        shape->best.theta = cairn_wrap_angle(shape->best_angle);
    }
    match->measure.candidates++;
    next_rotation(match);
    return 1;
}

int32_t cairn_scan_match_shape_has_ended(const cairn_scan_match *match)
{
    return match->shape->rotation >= match->shape->rotations;
}

int32_t cairn_scan_match_shape_restore_best(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;
    int32_t is_there = shape->rotated_angle == shape->best_angle;

    shape->is_replay = 1;
    shape->with_lines = shape->best_with_lines;
    shape->first_angle = shape->best_angle;
    shape->rotation = 0;
    return is_there;
}

/* ---- ICP ---- */

void cairn_scan_match_shape_icp_begin(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;

    shape->iteration = 0;
    shape->overlap_gate = shape->gate;
    shape->last = shape->best;
    shape->last_overlap = -1;
    shape->is_summing = 0;
    memset(&shape->sums, 0, sizeof shape->sums);
}

void cairn_scan_match_written_icp_begin(cairn_scan_match *match, cairn_pose start)
{
    scan_match_shape *shape = match->shape;

    shape->rotations = 0;
    shape->best = start;
    shape->best_overlap = 1;
    shape->gate = shape->overlap_gate > 0 ? shape->overlap_gate : OVERLAP_SLACK_M;
    cairn_scan_match_shape_icp_begin(match);
}

cairn_pose cairn_scan_match_shape_move(const scan_match_shape_sums *sums, cairn_pose pose)
{
    cairn_real n = (cairn_real)sums->pairs;
    cairn_vec2 from = cairn_vec2_scale(sums->from, 1 / n), to = cairn_vec2_scale(sums->to, 1 / n);
    cairn_real sine = sums->cross - n * cairn_vec2_cross(from, to),
               cosine = sums->dot - n * cairn_vec2_dot(from, to);

    return cairn_pose_compose(cairn_pose_from_moments(from, to, cosine, sine), pose);
}

/* Ends an ICP iteration; returns 1 when the ICP ends. */
static int32_t end_iteration(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;
    const scan_match_shape_sums *sums = &shape->sums;
    cairn_real mean = sums->overlap > 0 ? sums->overlap_distance / (cairn_real)sums->overlap : 0;
    cairn_pose moved;

    cairn_scan_match_charge(match, 3 * SCAN_MATCH_PARTS_PER_UNIT);
    if (shape->last_overlap >= 0 && sums->overlap < shape->last_overlap &&
        mean > shape->last_mean) {
        shape->best = shape->last;
        return 1;
    }
    if (shape->iteration++ == MAX_ITERATIONS || sums->pairs < MIN_PAIRS)
        return 1;
    moved = cairn_scan_match_shape_move(sums, shape->best);
    shape->last = shape->best;
    shape->last_overlap = sums->overlap;
    shape->last_mean = mean;
    shape->gate = cairn_max(sums->distance / (cairn_real)sums->pairs,
                            CAIRN_REAL(1.5) * match->params.spacing);
    shape->best = moved;
    memset(&shape->sums, 0, sizeof shape->sums);
    match->index_in_phase = 0;
    return 0;
}

void cairn_scan_match_shape_add_pair(scan_match_shape_sums *sums, cairn_vec2 p, cairn_vec2 partner,
                                     cairn_real distance)
{
    sums->pairs++;
    sums->distance += distance;
    sums->from = cairn_vec2_add(sums->from, p);
    sums->to = cairn_vec2_add(sums->to, partner);
    sums->cross += cairn_vec2_cross(p, partner);
    sums->dot += cairn_vec2_dot(p, partner);
}

/* One query point, or the end of an iteration; returns 1 when the ICP ends. */
int32_t cairn_scan_match_shape_icp(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;
    scan_match_shape_sums *sums = &shape->sums;
    const cairn_oriented_point *found;
    cairn_real distance;
    cairn_vec2 p;

    if (match->index_in_phase == 0)
        shape->rotation_transform = cairn_transform_of(shape->best);
    if (match->index_in_phase == match->query.count)
        return end_iteration(match);
    found = cairn_scan_match_shape_nearest(match, &match->query.points[match->index_in_phase++],
                                           shape->rotation_transform, shape->overlap_gate, &p,
                                           &distance);
    if (found == NULL)
        return 0;
    sums->overlap++;
    sums->overlap_distance += distance;
    if (distance > shape->gate)
        return 0;
    cairn_scan_match_shape_add_pair(sums, p, found->position, distance);
    return 0;
}
