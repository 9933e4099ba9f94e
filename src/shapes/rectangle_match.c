/* Rectangles from pairs of sides: matching, coverage, score and suppression.
 *
 * Method:
 * 1. Two pairs of perpendicular slopes and the same kind give a rectangle through the lines of the
 *    four sides.
 * 2. Candidates whose sides are too short for the least coverage are rejected early.
 * 3. The segments mark the positions of each side that they cover.
 * 4. The score is the coverage of the outline, reduced by the angular deviation; duplicates of
 *    lower score are suppressed. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/ranked_list.h"
#include "src/shapes/rectangle_work.h"

/* Segments whose coverage is marked for one work unit; work units of a comparison of two pairs. */
enum { MARKED_PER_UNIT = 2, UNITS_PER_COMPARISON = 2 };

/* ---- Pairs of sides ---- */

/* Midpoint of a segment, in m. */
static cairn_vec2 midpoint(cairn_segment segment)
{
    return cairn_vec2_scale(cairn_vec2_add(segment.a, segment.b), CAIRN_REAL(0.5));
}

/* d or -d, whichever has a nonnegative dot product with `like`. */
static cairn_vec2 oriented_like(cairn_vec2 d, cairn_vec2 like)
{
    return cairn_vec2_dot(d, like) < 0 ? cairn_vec2_scale(d, -1) : d;
}

int cairn_rectangle_make_pair(const struct cairn_rectangle_set *set, int32_t first, int32_t second,
                              rectangle_pair *made)
{
    const rectangle_side *side = &set->sides[first], *other = &set->sides[second];
    cairn_vec2 u = cairn_vec2_unit(
        cairn_vec2_add(side->direction, oriented_like(other->direction, side->direction)));
    cairn_vec2 across = cairn_vec2_left_perp(u),
               to = cairn_vec2_sub(midpoint(other->segment), midpoint(side->segment));
    cairn_real distance_across = cairn_vec2_dot(across, to), slope = cairn_atan2(u.y, u.x);
    int32_t is_above = distance_across > 0;

    if (cairn_abs(distance_across) < set->params.min_side ||
        (set->params.oriented && cairn_vec2_dot(side->direction, other->direction) > 0))
        return 0;
    made->side[0] = is_above ? first : second;
    made->side[1] = is_above ? second : first;
    made->kind = CAIRN_RECTANGLE_ANY;
    if (set->params.oriented)
        made->kind = is_above ? CAIRN_RECTANGLE_ROOM : CAIRN_RECTANGLE_BOX;
    slope = slope < 0 ? slope + CAIRN_PI : slope;
    made->slope = slope >= CAIRN_PI ? slope - CAIRN_PI : slope;
    return 1;
}

/* ---- Rectangle of two perpendicular pairs ---- */

/* Mean direction of the four sides modulo a right angle, weighted by their lengths, in [0, pi/2)
 * rad. */
static cairn_real common_direction(const struct cairn_rectangle_set *set, const rectangle_pair *p,
                                   const rectangle_pair *q)
{
    cairn_real c = 0, s = 0, theta;

    for (int32_t i = 0; i < 4; i++) {
        const rectangle_side *side = &set->sides[i < 2 ? p->side[i] : q->side[i - 2]];
        cairn_vec2 d = side->direction;
        cairn_real c2 = d.x * d.x - d.y * d.y, s2 = 2 * d.x * d.y;

        c += side->mass * (c2 * c2 - s2 * s2);
        s += side->mass * 2 * c2 * s2;
    }
    theta = cairn_atan2(s, c) / 4;
    return theta < 0 ? theta + CAIRN_PI / 2 : theta;
}

/* Coordinate along `axis`, in m, of the point on the line of a side that has the same coordinate as
 * `at` along the other axis. */
static cairn_real offset_at(const rectangle_side *side, cairn_vec2 axis, cairn_vec2 other,
                            cairn_vec2 at)
{
    cairn_vec2 from = midpoint(side->segment);
    cairn_real t =
        cairn_vec2_dot(other, cairn_vec2_sub(at, from)) / cairn_vec2_dot(other, side->direction);

    return cairn_vec2_dot(axis, cairn_vec2_add(from, cairn_vec2_scale(side->direction, t)));
}

/* Fraction of the interval low ... high along `axis` that the extent of a side overlaps. */
static cairn_real overlap_fraction(const rectangle_side *side, cairn_vec2 axis, cairn_real low,
                                   cairn_real high)
{
    cairn_real a = cairn_vec2_dot(axis, side->segment.a), b = cairn_vec2_dot(axis, side->segment.b);
    cairn_real overlap = cairn_min(cairn_max(a, b), high) - cairn_max(cairn_min(a, b), low);

    return cairn_max(overlap, 0) / (high - low);
}

/* Swaps the offsets of a pair, and its sides, when they are in descending order along the
 * rectangle's axis. */
static void sort_offsets(cairn_real *low, cairn_real *high, int32_t sides[2])
{
    cairn_real swapped = *low;
    int32_t first = sides[0];

    if (*low <= *high)
        return;
    *low = *high;
    *high = swapped;
    sides[0] = sides[1];
    sides[1] = first;
}

/* Fits the rectangle to the lines of the four sides of two pairs. 0 when the pairs are not
 * perpendicular or the rectangle is too small. */
static int fit_rectangle(const struct cairn_rectangle_set *set, const rectangle_pair *p,
                         const rectangle_pair *q, rectangle_candidate *candidate)
{
    cairn_rectangle *rectangle = &candidate->rectangle;
    const rectangle_side *sides[4];
    cairn_real low_u = 0, high_u = 0, low_v = 0, high_v = 0;
    cairn_vec2 centre = {0, 0};

    rectangle->centre.theta = common_direction(set, p, q);
    cairn_sincos(rectangle->centre.theta, &candidate->u.y, &candidate->u.x);
    candidate->v = cairn_vec2_left_perp(candidate->u);
    if (cairn_abs(cairn_vec2_dot(candidate->v, set->sides[p->side[0]].direction)) >
        CAIRN_REAL(0.7)) {
        const rectangle_pair *other = p;

        p = q;
        q = other;
    }
    candidate->deviation = 0;
    for (int32_t i = 0; i < 4; i++) {
        rectangle->side[i] = i < 2 ? p->side[i] : q->side[i - 2];
        sides[i] = &set->sides[rectangle->side[i]];
        candidate->deviation = cairn_max(
            candidate->deviation,
            cairn_abs(cairn_vec2_cross(i < 2 ? candidate->u : candidate->v, sides[i]->direction)) /
                set->sine_max_angle_error);
        centre =
            cairn_vec2_add(centre, cairn_vec2_scale(midpoint(sides[i]->segment), CAIRN_REAL(0.25)));
    }
    if (candidate->deviation > 1)
        return 0;
    for (int32_t i = 0; i < 2; i++) {
        low_v = offset_at(sides[0], candidate->v, candidate->u, centre);
        high_v = offset_at(sides[1], candidate->v, candidate->u, centre);
        low_u = offset_at(sides[2], candidate->u, candidate->v, centre);
        high_u = offset_at(sides[3], candidate->u, candidate->v, centre);
        centre = cairn_vec2_add(cairn_vec2_scale(candidate->u, (low_u + high_u) / 2),
                                cairn_vec2_scale(candidate->v, (low_v + high_v) / 2));
    }
    sort_offsets(&low_v, &high_v, &rectangle->side[0]);
    sort_offsets(&low_u, &high_u, &rectangle->side[2]);
    rectangle->centre.x = centre.x;
    rectangle->centre.y = centre.y;
    rectangle->half_length = (high_u - low_u) / 2;
    rectangle->half_width = (high_v - low_v) / 2;
    rectangle->kind = p->kind;
    return rectangle->half_length >= set->params.min_side / 2 &&
           rectangle->half_width >= set->params.min_side / 2;
}

/* Half the length of a side, in m. */
static cairn_real half_side(const cairn_rectangle *rectangle, int32_t side_index)
{
    return side_index < 2 ? rectangle->half_length : rectangle->half_width;
}

/* Covered fraction of the outline, from the covered fractions of its sides. */
static cairn_real outline_coverage(const cairn_rectangle *rectangle, const cairn_real coverage[4])
{
    return ((coverage[0] + coverage[1]) * rectangle->half_length +
            (coverage[2] + coverage[3]) * rectangle->half_width) /
           (2 * (rectangle->half_length + rectangle->half_width));
}

/* 1 when the extents of the sides, an upper bound of their coverage, suffice for the least
 * coverage. */
static int can_be_covered(const struct cairn_rectangle_set *set,
                          const rectangle_candidate *candidate)
{
    cairn_vec2 centre = {candidate->rectangle.centre.x, candidate->rectangle.centre.y};
    cairn_real coverage[4] = {0, 0, 0, 0};

    for (int32_t i = 0; i < 4; i++) {
        cairn_vec2 axis = i < 2 ? candidate->u : candidate->v;
        cairn_real at = cairn_vec2_dot(axis, centre), half = half_side(&candidate->rectangle, i);

        coverage[i] =
            overlap_fraction(&set->sides[candidate->rectangle.side[i]], axis, at - half, at + half);
        if (coverage[i] < set->params.min_side_coverage)
            return 0;
    }
    return outline_coverage(&candidate->rectangle, coverage) >= set->params.min_coverage;
}

/* ---- Coverage ---- */

/* Marks the positions of the current side whose centres a segment covers. */
static void mark_coverage(rectangle_candidate *candidate, cairn_segment segment)
{
    cairn_vec2 axis = candidate->side_index < 2 ? candidate->u : candidate->v,
               centre = {candidate->rectangle.centre.x, candidate->rectangle.centre.y};
    cairn_real scale =
        RECTANGLE_COVERAGE_BITS / (2 * half_side(&candidate->rectangle, candidate->side_index));
    cairn_real a = cairn_vec2_dot(axis, cairn_vec2_sub(segment.a, centre)) * scale +
                   CAIRN_REAL(0.5) * RECTANGLE_COVERAGE_BITS;
    cairn_real b = cairn_vec2_dot(axis, cairn_vec2_sub(segment.b, centre)) * scale +
                   CAIRN_REAL(0.5) * RECTANGLE_COVERAGE_BITS;
    cairn_real low = cairn_max(cairn_min(a, b), 0),
               high = cairn_min(cairn_max(a, b), RECTANGLE_COVERAGE_BITS);
    int32_t from = cairn_real_to_int(cairn_floor(low + CAIRN_REAL(0.5)));
    int32_t to = cairn_real_to_int(cairn_floor(high + CAIRN_REAL(0.5))); /* past the last one */

    if (to - from == RECTANGLE_COVERAGE_BITS)
        candidate->coverage[candidate->side_index] = ~(uint64_t)0;
    else if (to > from)
        candidate->coverage[candidate->side_index] |=
            (((uint64_t)1 << ((uint32_t)(to - from) % RECTANGLE_COVERAGE_BITS)) - 1)
            << ((uint32_t)from % RECTANGLE_COVERAGE_BITS);
}

/* Number of bits set. */
static int32_t count_bits(uint64_t bits)
{
    int32_t count = 0;

    for (; bits != 0; bits &= bits - 1)
        count++;
    return count;
}

/* Marks what the next segments of the current side cover. 0: they were the last. */
static int mark_segments(struct cairn_rectangle_set *set)
{
    rectangle_candidate *candidate = &set->candidate;
    const rectangle_side *side = &set->sides[candidate->rectangle.side[candidate->side_index]];

    for (int32_t i = 0; i < MARKED_PER_UNIT && candidate->segment_cursor < side->count;
         i++, candidate->segment_cursor++)
        mark_coverage(
            candidate,
            set->segments[set->order[side->first - side->count + candidate->segment_cursor]]);
    return candidate->segment_cursor < side->count;
}

/* ---- Non-maximum suppression ---- */

void cairn_rectangle_corners(const cairn_rectangle *rectangle, cairn_vec2 corners[4])
{
    static const int8_t signs[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    cairn_transform t = cairn_transform_of(rectangle->centre);

    for (int32_t i = 0; i < 4; i++) {
        cairn_vec2 corner = {signs[i][0] * rectangle->half_length,
                             signs[i][1] * rectangle->half_width};

        corners[i] = cairn_transform_point(t, corner);
    }
}

/* Largest distance in m of a corner of a from the closest corner of b (directed Hausdorff
 * distance); independent of the numbering of the corners. */
static cairn_real corner_distance(const cairn_rectangle *a, const cairn_rectangle *b)
{
    cairn_vec2 of_a[4], of_b[4];
    cairn_real farthest = 0;

    cairn_rectangle_corners(a, of_a);
    cairn_rectangle_corners(b, of_b);
    for (int32_t i = 0; i < 4; i++) {
        cairn_real nearest = CAIRN_REAL_MAX;

        for (int32_t j = 0; j < 4; j++)
            nearest = cairn_min(nearest, cairn_vec2_norm_squared(cairn_vec2_sub(of_a[i], of_b[j])));
        farthest = cairn_max(farthest, nearest);
    }
    return cairn_sqrt(farthest);
}

/* 1 when two rectangles of a kind coincide. */
static int is_duplicate(const void *context, const void *entry, const void *other)
{
    const struct cairn_rectangle_set *set = context;
    const cairn_rectangle *a = other, *b = entry;

    return a->kind == b->kind && corner_distance(a, b) < set->params.separation;
}

/* Inserts a rectangle by decreasing score, if no duplicate has a score as high and there is
 * capacity; removes duplicates of lower score. */
static void insert_rectangle(struct cairn_rectangle_set *set, const cairn_rectangle *rectangle)
{
    ranked_list found = {.entries = set->found,
                         .count = &set->found_count,
                         .capacity = set->params.max_rectangles,
                         .entry_bytes = sizeof *rectangle,
                         .score_at = offsetof(cairn_rectangle, score),
                         .is_near = is_duplicate,
                         .context = set};

    if (!ranked_list_suppress(&found, rectangle))
        return;
    set->found_dropped += set->found_count == set->params.max_rectangles;
    (void)ranked_list_add(&found, rectangle);
}

/* Scores the candidate, whose coverage is complete, and inserts it if the coverage suffices. */
static void score_candidate(struct cairn_rectangle_set *set)
{
    rectangle_candidate *candidate = &set->candidate;
    cairn_real coverage[4] = {0, 0, 0, 0};

    for (int32_t i = 0; i < 4; i++) {
        coverage[i] = (cairn_real)count_bits(candidate->coverage[i]) / RECTANGLE_COVERAGE_BITS;
        if (coverage[i] < set->params.min_side_coverage)
            return;
    }
    candidate->rectangle.coverage = outline_coverage(&candidate->rectangle, coverage);
    candidate->rectangle.score =
        candidate->rectangle.coverage * (1 - candidate->deviation * candidate->deviation / 2);
    if (candidate->rectangle.coverage >= set->params.min_coverage)
        insert_rectangle(set, &candidate->rectangle);
}

/* ---- Pairs of pairs ---- */

/* The pair at a position of the cyclic order by slope. */
static const rectangle_pair *pair_at(const struct cairn_rectangle_set *set, int32_t position)
{
    return &set->pairs[set->pair_order[position % set->pair_count]];
}

/* First position in the order of pairs whose slope is not less than `slope`. */
static int32_t lower_bound(const struct cairn_rectangle_set *set, cairn_real slope)
{
    int32_t low = 0, high = set->pair_count;

    while (low < high) {
        int32_t middle = low + (high - low) / 2;

        if (pair_at(set, middle)->slope < slope)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* Least slope of the pairs that are perpendicular to the current one, in [0, pi) rad. */
static cairn_real least_slope(const struct cairn_rectangle_set *set)
{
    cairn_real slope =
        pair_at(set, set->cursor)->slope + CAIRN_PI / 2 - set->params.max_angle_error;

    return slope >= CAIRN_PI ? slope - CAIRN_PI : slope;
}

/* 1 when the compared pair is perpendicular to the current one; 0: no further pair is. */
static int is_perpendicular(const struct cairn_rectangle_set *set)
{
    return set->compared < set->pair_count &&
           cairn_rectangle_angle_difference(
               pair_at(set, set->first_compared + set->compared)->slope, least_slope(set)) <=
               2 * set->params.max_angle_error;
}

/* Sets the candidate of the current and the compared pair. 1 when it may become a rectangle. */
static int open_candidate(struct cairn_rectangle_set *set)
{
    const rectangle_pair *p = pair_at(set, set->cursor),
                         *q = pair_at(set, set->first_compared + set->compared);

    /* Every two pairs are visited twice; only one visit counts. */
    if (q <= p || p->kind != q->kind)
        return 0;
    memset(&set->candidate, 0, sizeof set->candidate);
    return fit_rectangle(set, p, q, &set->candidate) && can_be_covered(set, &set->candidate);
}

int cairn_rectangle_match(struct cairn_rectangle_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < set->pair_count; set->cursor++) {
        CAIRN_STEP_CHARGE(set, phase_resume, budget, UNITS_PER_COMPARISON);
        set->first_compared = lower_bound(set, least_slope(set));
        for (set->compared = 0; is_perpendicular(set); set->compared++) {
            if (open_candidate(set)) {
                for (; set->candidate.side_index < 4; set->candidate.side_index++) {
                    set->candidate.segment_cursor = 0;
                    do
                        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
                    while (mark_segments(set));
                }
                CAIRN_STEP_CHARGE(set, phase_resume, budget, 8 + 4 * set->found_count);
                score_candidate(set);
            }
            CAIRN_STEP_CHARGE(set, phase_resume, budget, UNITS_PER_COMPARISON);
        }
    }
    CAIRN_STEP_END(set->phase_resume);
}
