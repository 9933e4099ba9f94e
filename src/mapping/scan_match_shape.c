/* Scan matching by shape, as in Adluru 2008, chapter 6, with no guess needed.
 *
 * Method. A point is described by its direction and by the bearings of the points of its scan
 * within 0.5 m, in 36 bins divided by the largest (6.2.1, 6.2.2). For each rotation of the query:
 * the longest common subsequence of the two sequences (6.2.3); correspondences whose vector runs
 * along the line of one of their points are dropped, as are segments of the list that disagree with
 * the best segment (6.2.4); the translation of the segment that most pairs follow is taken; the
 * rotation with the largest scan overlap wins (6.3). ICP with gates, rolled back when overlap and
 * distance both get worse, ends it (6.4).
 *
 * The colinear filter is there because the shape of a straight line tells little. While the frames
 * are not aligned, where a vector points tells little of that, and all points of walls pass it
 * alike. So the filters are applied twice, and the overlap decides as it does between rotations:
 * first without the points that have nothing but a straight line about them, then with them, as
 * written. What the pictures show is the rotation and the filters that won: they are gone through
 * once more.
 *
 * Choices that the thesis leaves open: headings every 5 degrees over the window (every 1 when it is
 * at most 5 wide), then every 1 about the best; ICP point to point in closed form, its gate the
 * mean distance of its pairs but at least 1.5 spacings.
 *
 * Mode as_written takes the readings themselves, every degree, and applies each filter once, as
 * printed; its ICP stands in scan_match_written.c, its choices in the header.
 *
 * Layout: descriptors in bytes, 0 ... 255 for 0 ... 1. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/scan_match_shape.h"

static const cairn_real DEGREE = CAIRN_PI / 180;
static const cairn_real REACH = CAIRN_REAL(0.5);               /* m, of a descriptor */
static const cairn_real ALIKE_COSINE = CAIRN_REAL(0.98480775); /* 10 degrees */
static const cairn_real ALIKE_SINE = CAIRN_REAL(0.17364818);
static const cairn_real JUMP = CAIRN_REAL(0.3); /* m, between segments */
static const cairn_real SEGMENT_FACTOR = 2, SEGMENT_SLACK = CAIRN_REAL(0.2);
static const cairn_real OVERLAP_SLACK = CAIRN_REAL(0.4); /* m */
static const cairn_real STEP_SLACK =
    CAIRN_REAL(1e-3); /* as written a window short of a whole degree by this share of one has it */

enum { BIN_DIFFERS = 64, BINS_DIFFER = 2, COARSE = 5, ITERATIONS = 20, LEAST_PAIRS = 3 };

/* ---- Descriptors ---- */

static int32_t bearing_bin(cairn_vec2 d)
{
    int32_t bin =
        cairn_real_to_int(cairn_floor(cairn_atan2(d.y, d.x) * (SHAPE_BINS / (2 * CAIRN_PI))));

    return (bin + SHAPE_BINS) % SHAPE_BINS;
}

/* The descriptor of points[i] among points[first ... end-1], turned. */
static void describe(cairn_scan_match *x, const cairn_oriented_point *points, int32_t i,
                     int32_t first, int32_t end, cairn_transform turn, shape_descriptor *descriptor)
{
    int32_t count[SHAPE_BINS] = {0}, most = 1;

    for (int32_t k = first; k < end; k++) {
        cairn_vec2 d = cairn_vec2_sub(points[k].position, points[i].position);
        int32_t bin;

        if (k == i || cairn_vec2_norm_squared(d) > REACH * REACH)
            continue;
        bin = bearing_bin(cairn_transform_direction(turn, d));
        count[bin]++;
        most = count[bin] > most ? count[bin] : most;
        cairn_match_charge(x, 6);
    }
    cairn_match_charge(x, (end - first) / 3 + 16);
    for (int32_t b = 0; b < SHAPE_BINS; b++)
        descriptor->bin[b] = (uint8_t)(255 * count[b] / most);
}

int32_t cairn_match_shape_target(cairn_scan_match *x)
{
    match_shape *s = x->shape;
    cairn_transform still = cairn_transform_of(cairn_pose_identity());
    int32_t part = s->part_of[x->at], first = x->at, end = x->at + 1;

    if (x->at > 0 && s->part_of[x->at - 1] == part)
        first = s->part_first;
    while (end < x->target_count && s->part_of[end] == part)
        end++;
    s->part_first = first;
    describe(x, x->target, x->at, first, end, still, &s->target[x->at]);
    return ++x->at == x->target_count;
}

static int are_alike(const shape_descriptor *a, const shape_descriptor *b)
{
    int32_t differ = 0;

    for (int32_t k = 0; k < SHAPE_BINS && differ <= BINS_DIFFER; k++)
        differ += a->bin[k] > b->bin[k] + BIN_DIFFERS || b->bin[k] > a->bin[k] + BIN_DIFFERS;
    return differ <= BINS_DIFFER;
}

static cairn_real compare(const void *context, int32_t i, int32_t j)
{
    const cairn_scan_match *x = context;
    const match_shape *s = x->shape;

    return cairn_vec2_dot(s->turned[i].direction, x->target[j].direction) >= ALIKE_COSINE &&
           are_alike(&s->query[i], &s->target[j]);
}

/* ---- Rotations ---- */

void cairn_match_shape_begin(cairn_scan_match *x)
{
    match_shape *s = x->shape;
    cairn_real half = x->has_window ? cairn_min(x->window.angle, CAIRN_PI) : CAIRN_PI;
    int32_t steps;

    if (cairn_match_is_as_written(x) && !x->has_window)
        half = CAIRN_SCAN_MATCH_WRITTEN_HEADING;
    s->shift.x = x->has_window ? x->start.x : 0;
    s->shift.y = x->has_window ? x->start.y : 0;
    s->step = half <= COARSE * DEGREE || cairn_match_is_as_written(x) ? DEGREE : COARSE * DEGREE;
    steps = cairn_real_to_int(
        cairn_floor(half / s->step + (cairn_match_is_as_written(x) ? STEP_SLACK : 0)));
    s->rotations = 2 * steps + 1;
    s->first_angle = (x->has_window ? x->start.theta : 0) - s->step * (cairn_real)steps;
    if (half >= CAIRN_PI)
        s->rotations--;
    s->rotation = 0;
    s->is_fine = s->step < 2 * DEGREE;
    s->best_overlap = -1;
    s->with_lines = s->is_again = 0;
}

static cairn_real angle_of(const match_shape *s)
{
    return s->first_angle + s->step * (cairn_real)s->rotation;
}

/* One query point, turned and described. */
int32_t cairn_match_shape_turn(cairn_scan_match *x)
{
    match_shape *s = x->shape;
    cairn_pose turn = {0, 0, 0};
    cairn_oriented_point *p = &s->turned[x->at];
    cairn_status status;

    if (x->at == 0) {
        turn.theta = s->turned_angle = angle_of(s);
        s->turn = cairn_transform_of(turn);
    }
    p->position =
        cairn_vec2_add(cairn_transform_point(s->turn, x->query.points[x->at].position), s->shift);
    p->direction = cairn_transform_direction(s->turn, x->query.points[x->at].direction);
    describe(x, x->query.points, x->at, 0, x->query.count, s->turn, &s->query[x->at]);
    if (++x->at < x->query.count)
        return 0;
    status = cairn_sequence_begin(s->sequence, x->query.count, x->target_count, compare, x);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    return 1;
}

cairn_status cairn_match_shape_align(cairn_scan_match *x, cairn_budget *budget)
{
    int32_t before = budget->left;
    cairn_status status = cairn_sequence_step(x->shape->sequence, budget);

    x->measure.units += before - budget->left;
    return status;
}

/* ---- Correspondences ---- */

static cairn_vec2 vector_of(const cairn_scan_match *x, cairn_sequence_pair pair)
{
    return cairn_vec2_sub(x->target[pair.second].position, x->shape->turned[pair.first].position);
}

/* 1 when the vector of the pair runs along the line of one of its points. */
static int is_colinear(const cairn_scan_match *x, cairn_sequence_pair pair)
{
    cairn_vec2 along = cairn_vec2_unit(vector_of(x, pair));

    if (cairn_vec2_norm_squared(along) < CAIRN_REAL(0.5))
        return 0;
    return cairn_abs(cairn_vec2_cross(along, x->target[pair.second].direction)) < ALIKE_SINE ||
           cairn_abs(cairn_vec2_cross(along, x->shape->turned[pair.first].direction)) < ALIKE_SINE;
}

/* 1 when all there is about a point is a line along its direction. */
static int32_t is_straight(const shape_descriptor *d, cairn_vec2 direction)
{
    const int32_t half = SHAPE_BINS / 2;
    int32_t along = bearing_bin(direction);

    for (int32_t b = 0; b < SHAPE_BINS; b++) {
        int32_t off = (b - along + SHAPE_BINS) % half;

        if (d->bin[b] >= BIN_DIFFERS && off > 1 && off < half - 1)
            return 0;
    }
    return 1;
}

/* 1 when the colinear filter drops the pair. */
static int32_t is_dropped(const cairn_scan_match *x, cairn_sequence_pair pair)
{
    const match_shape *s = x->shape;

    if (!cairn_match_has_colinear_filter(x))
        return 0;
    if (cairn_match_is_as_written(x))
        return is_colinear(x, pair);
    return is_colinear(x, pair) ||
           (!s->with_lines &&
            (is_straight(&s->query[pair.first], s->turned[pair.first].direction) ||
             is_straight(&s->target[pair.second], x->target[pair.second].direction)));
}

static cairn_real gap_between(cairn_vec2 a, cairn_vec2 b)
{
    return cairn_vec2_norm(cairn_vec2_sub(a, b));
}

/* One pair of the common subsequence: dropped, or added to its segment. */
int32_t cairn_match_shape_filter(cairn_scan_match *x)
{
    match_shape *s = x->shape;
    cairn_sequence_result common = cairn_sequence_read(s->sequence);

    if (x->at == 0)
        s->segment_count = s->pair_count = 0;
    cairn_match_charge(x, s->with_lines ? 20 : 60);
    if (x->at < common.count) {
        cairn_sequence_pair pair = common.pairs[x->at++], last;

        if (!is_dropped(x, pair)) {
            last = s->pairs[s->pair_count > 0 ? s->pair_count - 1 : 0];
            if (s->pair_count == 0 ||
                gap_between(s->turned[pair.first].position, s->turned[last.first].position) >=
                    JUMP ||
                gap_between(x->target[pair.second].position, x->target[last.second].position) >=
                    JUMP)
                s->segments[s->segment_count++].first = s->pair_count;
            s->pairs[s->pair_count++] = pair;
        }
    }
    if (x->at < common.count)
        return 0;
    s->segments[s->segment_count].first = s->pair_count;
    s->most_pairs = 0;
    return 1;
}

static cairn_vec2 mean_of(const cairn_scan_match *x, int32_t first, int32_t end)
{
    cairn_vec2 sum = {0, 0};

    for (int32_t k = first; k < end; k++)
        sum = cairn_vec2_add(sum, vector_of(x, x->shape->pairs[k]));
    return cairn_vec2_scale(sum, 1 / (cairn_real)(end > first ? end - first : 1));
}

static cairn_real mean_distance(const cairn_scan_match *x, int32_t first, int32_t end,
                                cairn_vec2 shift)
{
    cairn_real sum = 0;

    for (int32_t k = first; k < end; k++)
        sum += gap_between(vector_of(x, x->shape->pairs[k]), shift);
    return sum / (cairn_real)(end > first ? end - first : 1);
}

/* One segment as the main one: which others agree with it? The choice that leaves most pairs is
 * kept. */
int32_t cairn_match_shape_segment(cairn_scan_match *x)
{
    match_shape *s = x->shape;
    shape_segment *main;
    cairn_vec2 shift;
    cairn_real most;
    int32_t left = 0;

    cairn_match_charge(x, 8 + 2 * s->pair_count);
    if (x->at == s->segment_count)
        return 1;
    main = &s->segments[x->at];
    shift = mean_of(x, main[0].first, main[1].first);
    most = SEGMENT_FACTOR * mean_distance(x, main[0].first, main[1].first, shift) + SEGMENT_SLACK;
    for (int32_t k = 0; k < s->segment_count; k++) {
        shape_segment *other = &s->segments[k];

        other->agrees =
            k == x->at || mean_distance(x, other[0].first, other[1].first, shift) <= most;
        left += other->agrees ? other[1].first - other[0].first : 0;
    }
    if (left > s->most_pairs) {
        s->most_pairs = left;
        for (int32_t k = 0; k < s->segment_count; k++)
            s->segments[k].kept = s->segments[k].agrees;
    }
    return ++x->at == s->segment_count;
}

/* Without the segment filter: the mean of all pairs. */
static void shift_by_all(cairn_scan_match *x)
{
    match_shape *s = x->shape;

    s->best_shift = mean_of(x, 0, s->pair_count);
    s->best_distance = mean_distance(x, 0, s->pair_count, s->best_shift);
    s->most_pairs = s->pair_count;
}

/* One kept segment: how many pairs follow its translation? */
int32_t cairn_match_shape_translate(cairn_scan_match *x)
{
    match_shape *s = x->shape;
    int32_t left = 0;

    cairn_match_charge(x, 8 + 2 * s->pair_count);
    if (x->at == 0)
        s->most_pairs = 0;
    if (!cairn_match_has_segment_filter(x)) {
        shift_by_all(x);
        return 1;
    }
    if (x->at == s->segment_count)
        return 1;
    if (s->segments[x->at].kept) {
        const shape_segment *own = &s->segments[x->at];
        cairn_vec2 shift = mean_of(x, own[0].first, own[1].first);
        cairn_real distance = mean_distance(x, own[0].first, own[1].first, shift);

        for (int32_t k = 0; k < s->segment_count; k++)
            for (int32_t i = s->segments[k].first;
                 s->segments[k].kept && i < s->segments[k + 1].first; i++)
                left +=
                    gap_between(vector_of(x, s->pairs[i]), shift) <= distance + CAIRN_REAL(1e-6);
        if (left > s->most_pairs) {
            s->most_pairs = left;
            s->best_shift = shift;
            s->best_distance = distance;
        }
    }
    return ++x->at == s->segment_count;
}

/* ---- Overlap ---- */

const cairn_oriented_point *cairn_match_shape_partner(cairn_scan_match *x,
                                                      const cairn_oriented_point *q,
                                                      cairn_transform transform, cairn_real gate,
                                                      cairn_vec2 *p, cairn_real *distance)
{
    match_search search;
    int32_t parts = 8;
    const cairn_oriented_point *found;

    *p = search.p = cairn_transform_point(transform, q->position);
    search.direction = cairn_transform_direction(transform, q->direction);
    search.cosine = ALIKE_COSINE;
    found = cairn_match_index_nearest(&x->index, &search, gate, &parts);
    *distance = found != NULL ? cairn_sqrt(search.nearest) : 0;
    cairn_match_charge(x, parts);
    return found;
}

/* The filters again with the points of straight lines, or the next rotation. */
static void next_rotation(cairn_scan_match *x)
{
    match_shape *s = x->shape;

    s->with_lines = !s->with_lines && (x->params.mode == CAIRN_SCAN_MATCH_SHAPE ||
                                       x->params.mode == CAIRN_SCAN_MATCH_SHAPE_SEGMENTS);
    if (s->with_lines)
        return;
    if (++s->rotation < s->rotations || s->is_fine || s->best_overlap < 0)
        return;
    s->is_fine = 1;
    s->step = DEGREE;
    s->rotations = 2 * COARSE - 1;
    s->rotation = 0;
    s->first_angle = s->best.theta - s->step * (cairn_real)(COARSE - 1);
}

/* One query point; at the end the best is kept. 1: all query points are through. */
int32_t cairn_match_shape_overlap(cairn_scan_match *x)
{
    match_shape *s = x->shape;
    cairn_transform at = s->turn;
    cairn_real distance;
    cairn_vec2 p;

    if (x->at == 0)
        s->overlap = 0;
    at.x = s->shift.x + s->best_shift.x;
    at.y = s->shift.y + s->best_shift.y;
    if (s->most_pairs > 0)
        s->overlap +=
            cairn_match_shape_partner(x, &x->query.points[x->at], at,
                                      s->best_distance + OVERLAP_SLACK, &p, &distance) != NULL;
    cairn_match_charge(x, 2);
    if (++x->at < x->query.count)
        return 0;
    if (s->most_pairs > 0 && s->overlap > s->best_overlap) {
        s->best_overlap = s->overlap;
        s->gate = s->best_distance + OVERLAP_SLACK;
        s->best_angle = angle_of(s);
        s->best_with_lines = s->with_lines;
        s->best.x = at.x;
        s->best.y = at.y;
        s->best.theta = cairn_wrap_angle(s->best_angle);
    }
    x->measure.candidates++;
    next_rotation(x);
    return 1;
}

int32_t cairn_match_shape_is_turned(const cairn_scan_match *x)
{
    return x->shape->rotation >= x->shape->rotations;
}

int32_t cairn_match_shape_again(cairn_scan_match *x)
{
    match_shape *s = x->shape;
    int32_t is_there = s->turned_angle == s->best_angle;

    s->is_again = 1;
    s->with_lines = s->best_with_lines;
    s->first_angle = s->best_angle;
    s->rotation = 0;
    return is_there;
}

/* ---- ICP ---- */

void cairn_match_shape_icp_begin(cairn_scan_match *x)
{
    match_shape *s = x->shape;

    s->iteration = 0;
    s->overlap_gate = s->gate;
    s->last = s->best;
    s->last_overlap = -1;
    s->is_summing = 0;
    memset(&s->sums, 0, sizeof s->sums);
}

void cairn_match_written_icp_at(cairn_scan_match *x, cairn_pose start)
{
    match_shape *s = x->shape;

    s->rotations = 0;
    s->best = start;
    s->best_overlap = 1;
    s->gate = s->overlap_gate > 0 ? s->overlap_gate : OVERLAP_SLACK;
    cairn_match_shape_icp_begin(x);
}

cairn_pose cairn_match_shape_moved(const shape_sums *sums, cairn_pose pose)
{
    cairn_real n = (cairn_real)sums->pairs;
    cairn_vec2 from = cairn_vec2_scale(sums->from, 1 / n), to = cairn_vec2_scale(sums->to, 1 / n);
    cairn_real sine = sums->cross - n * cairn_vec2_cross(from, to),
               cosine = sums->dot - n * cairn_vec2_dot(from, to);

    return cairn_pose_compose(cairn_pose_about(from, to, cosine, sine), pose);
}

/* 1 when the alignment ended. */
static int32_t end_iteration(cairn_scan_match *x)
{
    match_shape *s = x->shape;
    const shape_sums *sums = &s->sums;
    cairn_real mean = sums->overlap > 0 ? sums->overlap_distance / (cairn_real)sums->overlap : 0;
    cairn_pose moved;

    cairn_match_charge(x, 3 * MATCH_PART);
    if (s->last_overlap >= 0 && sums->overlap < s->last_overlap && mean > s->last_mean) {
        s->best = s->last;
        return 1;
    }
    if (s->iteration++ == ITERATIONS || sums->pairs < LEAST_PAIRS)
        return 1;
    moved = cairn_match_shape_moved(sums, s->best);
    s->last = s->best;
    s->last_overlap = sums->overlap;
    s->last_mean = mean;
    s->gate =
        cairn_max(sums->distance / (cairn_real)sums->pairs, CAIRN_REAL(1.5) * x->params.spacing);
    s->best = moved;
    memset(&s->sums, 0, sizeof s->sums);
    x->at = 0;
    return 0;
}

void cairn_match_shape_add(shape_sums *sums, cairn_vec2 p, cairn_vec2 partner, cairn_real distance)
{
    sums->pairs++;
    sums->distance += distance;
    sums->from = cairn_vec2_add(sums->from, p);
    sums->to = cairn_vec2_add(sums->to, partner);
    sums->cross += cairn_vec2_cross(p, partner);
    sums->dot += cairn_vec2_dot(p, partner);
}

/* One query point, or the end of an iteration; 1 when the alignment ended. */
int32_t cairn_match_shape_icp(cairn_scan_match *x)
{
    match_shape *s = x->shape;
    shape_sums *sums = &s->sums;
    const cairn_oriented_point *found;
    cairn_real distance;
    cairn_vec2 p;

    if (x->at == 0)
        s->turn = cairn_transform_of(s->best);
    if (x->at == x->query.count)
        return end_iteration(x);
    found = cairn_match_shape_partner(x, &x->query.points[x->at++], s->turn, s->overlap_gate, &p,
                                      &distance);
    if (found == NULL)
        return 0;
    sums->overlap++;
    sums->overlap_distance += distance;
    if (distance > s->gate)
        return 0;
    cairn_match_shape_add(sums, p, found->position, distance);
    return 0;
}
