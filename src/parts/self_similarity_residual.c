/* Mirror residual of two arcs.
 *
 * Method:
 * 1. The axis is a circular arc (bend); its ribs may be oblique (skew). All samples are transformed
 *    to coordinates along the axis and across it, which removes bend and skew.
 * 2. The second arc is reflected. The residual is the mean truncated distance from each sample to
 *    the other arc.
 * 3. Bend and skew have small penalties, so that they are used only where they decrease the
 *    residual. */
#include "src/base/build.h"

#include "src/parts/self_similarity_work.h"

/* Search window of the nearest segment about the proportional position, share of the arc. */
#define SEARCH_WINDOW CAIRN_REAL(0.2)
/* Least bend of a curved axis, and the bounds of bend, rad, and skew. */
#define MIN_BEND_RAD CAIRN_REAL(1e-3)
#define MAX_BEND_RAD CAIRN_REAL(3.0)
#define MAX_SKEW     CAIRN_REAL(1.0)
/* Truncation of a sample's distance, relative to the greatest inner distance: of inliers, of the
 * fit to articulated shapes, and otherwise. */
#define TRUNCATION_INLIER  CAIRN_REAL(0.01)
#define TRUNCATION_ROBUST  CAIRN_REAL(0.02)
#define TRUNCATION_DEFAULT CAIRN_REAL(0.1)
/* Penalty of the bend per rad, saturating with the half-cost angle, and penalty of skew 1,
 * relative to the greatest inner distance. */
#define BEND_COST          CAIRN_REAL(0.03)
#define BEND_HALF_COST_RAD CAIRN_REAL(0.25)
#define SKEW_COST          CAIRN_REAL(0.008)

enum { ESTIMATE_PAIRS = 12 };

/* ---- Axis ---- */

typedef struct axis_frame {
    /* Straight axis: the first end and the direction. Curved axis: the circle's centre and the
     * direction from it to the middle of the axis. */
    cairn_vec2 origin, along;
    /* Radius of the axis, < 0: clockwise; 0: straight. */
    cairn_real radius;
    /* Half of the length of the axis. */
    cairn_real half;
    cairn_real skew;
} axis_frame;

/* Returns the frame of an axis between two points with a bend and a skew. */
static axis_frame axis_frame_of(cairn_vec2 from, cairn_vec2 to, cairn_real bend, cairn_real skew)
{
    cairn_vec2 chord = cairn_vec2_sub(to, from), along = cairn_vec2_unit(chord),
               across = cairn_vec2_left_perp(along);
    cairn_real length = cairn_vec2_norm(chord), sine, cosine;
    axis_frame f = {.origin = from, .along = along, .half = length / 2, .skew = skew};

    if (cairn_abs(bend) < MIN_BEND_RAD)
        return f;
    cairn_sincos(bend / 2, &sine, &cosine);
    f.radius = length / (2 * sine);
    f.half = f.radius * bend / 2;
    f.origin = cairn_vec2_add(cairn_vec2_add(from, cairn_vec2_scale(chord, CAIRN_REAL(0.5))),
                              cairn_vec2_scale(across, f.radius * cosine));
    f.along = cairn_vec2_scale(across, f.radius > 0 ? -1 : 1);
    return f;
}

/* Transforms a point to axis coordinates: x along the axis from its middle, y to the left, skew
 * removed. */
static cairn_vec2 to_axis_coordinates(const axis_frame *frame, cairn_vec2 p)
{
    cairn_vec2 v = cairn_vec2_sub(p, frame->origin), flat;

    if (frame->radius == 0) {
        flat.x = cairn_vec2_dot(frame->along, v) - frame->half;
        flat.y = cairn_vec2_cross(frame->along, v);
    } else {
        flat.x = frame->radius * cairn_vec2_angle(frame->along, v);
        flat.y = frame->radius + (frame->radius > 0 ? -cairn_vec2_norm(v) : cairn_vec2_norm(v));
    }
    flat.x -= frame->skew * flat.y;
    return flat;
}

/* ---- Arcs ---- */

self_similarity_sides cairn_self_similarity_sides(const cairn_self_similarity *similarity,
                                                  const self_similarity_cut *cut, int32_t stride)
{
    self_similarity_sides sides = {{0, 0}, {0, 0}, stride};

    for (int32_t arc = 0; arc < 2; arc++) {
        cairn_real from = cut->position[arc], to = cut->position[1 - arc];
        int32_t first = cairn_real_to_int(cairn_floor(from)) + 1;

        first += (stride - first % stride) % stride;
        to += to < from ? (cairn_real)similarity->params.outline_samples : 0;
        sides.first[arc] = first;
        while ((cairn_real)(first + stride * sides.count[arc]) < to)
            sides.count[arc]++;
    }
    return sides;
}

self_similarity_axis_arcs cairn_self_similarity_unbend(const cairn_self_similarity *similarity,
                                                       const self_similarity_cut *cut,
                                                       const self_similarity_sides *sides,
                                                       cairn_vec2 *buffer)
{
    cairn_vec2 end[2] = {
        cairn_self_similarity_point(similarity, similarity->smoothed, cut->position[0]),
        cairn_self_similarity_point(similarity, similarity->smoothed, cut->position[1])};
    axis_frame f = axis_frame_of(end[0], end[1], cut->bend, cut->skew);
    self_similarity_axis_arcs flat;

    for (int32_t arc = 0; arc < 2; arc++) {
        int32_t count = sides->count[arc] + 2, last = count - 1;

        flat.points[arc] = buffer;
        flat.count[arc] = count;
        for (int32_t k = 0; k < count; k++) {
            int32_t i =
                (sides->first[arc] + (k - 1) * sides->stride + similarity->params.outline_samples) %
                similarity->params.outline_samples;
            cairn_vec2 p = to_axis_coordinates(&f, k == 0      ? end[arc]
                                                   : k == last ? end[1 - arc]
                                                               : similarity->smoothed[i]);

            p.y = arc == 0 ? p.y : -p.y;
            buffer[arc == 0 ? k : last - k] = p;
        }
        buffer += count;
    }
    return flat;
}

/* Returns the squared distance of a point to a segment. */
static cairn_real squared_distance(cairn_vec2 a, cairn_vec2 b, cairn_vec2 p)
{
    cairn_vec2 side = cairn_vec2_sub(b, a), to = cairn_vec2_sub(p, a);
    cairn_real along = cairn_vec2_dot(side, to), length = cairn_vec2_norm_squared(side);

    if (!(along > 0))
        return cairn_vec2_norm_squared(to);
    if (along >= length)
        return cairn_vec2_norm_squared(cairn_vec2_sub(p, b));
    along = cairn_vec2_cross(side, to);
    return along * along / length;
}

/* Returns the segment of the other arc nearest to point i of an arc, within the search window. */
static int32_t nearest_segment(const self_similarity_axis_arcs *flat, int32_t arc, int32_t i,
                               cairn_real *distance)
{
    const cairn_vec2 *other = flat->points[1 - arc];
    int32_t sides = flat->count[1 - arc] - 1,
            reach = 2 + cairn_real_to_int(SEARCH_WINDOW * (cairn_real)sides);
    int32_t middle = i * sides / (flat->count[arc] - 1), best = 0;
    int32_t first = middle > reach ? middle - reach : 0,
            last = middle + reach < sides ? middle + reach : sides;
    cairn_real least = 0;

    for (int32_t k = first; k < last; k++) {
        cairn_real d = squared_distance(other[k], other[k + 1], flat->points[arc][i]);

        if (k == first || d < least) {
            least = d;
            best = k;
        }
    }
    *distance = cairn_sqrt(least);
    return best;
}

/* Returns the sum of truncated distances from the reflected hole samples to the nearest hole
 * segment; *count increases by the number of samples. */
static cairn_real hole_residual_sum(cairn_self_similarity *similarity,
                                    const self_similarity_cut *cut, cairn_real most, int32_t *count)
{
    axis_frame f = axis_frame_of(
        cairn_self_similarity_point(similarity, similarity->smoothed, cut->position[0]),
        cairn_self_similarity_point(similarity, similarity->smoothed, cut->position[1]), cut->bend,
        cut->skew);
    int32_t all = cairn_self_similarity_hole_samples(similarity);
    cairn_real sum = 0;

    for (int32_t i = 0; i < all; i++)
        similarity->axis_holes[i] =
            to_axis_coordinates(&f, similarity->samples[similarity->params.outline_samples + i]);
    for (int32_t i = 0; i < all; i++) {
        cairn_vec2 mirrored = {similarity->axis_holes[i].x, -similarity->axis_holes[i].y};
        const cairn_vec2 *hole = similarity->axis_holes;
        cairn_real least = most * most;

        for (int32_t h = 0; h < similarity->hole_total; hole += similarity->hole_count[h++])
            for (int32_t k = 0; k < similarity->hole_count[h]; k++)
                least = cairn_min(
                    least,
                    squared_distance(hole[k], hole[k + 1 < similarity->hole_count[h] ? k + 1 : 0],
                                     mirrored));
        sum += cairn_sqrt(least);
    }
    *count += all;
    return sum;
}

void cairn_self_similarity_evaluate(cairn_self_similarity *similarity, self_similarity_trial *trial,
                                    int32_t stride)
{
    cairn_real sum = 0, inlier_sum = 0, robust_sum = 0,
               most = TRUNCATION_DEFAULT * similarity->max_distance;
    cairn_real bend = cairn_abs(trial->cut.bend), penalty, all;
    int32_t count = 0;

    trial->sides = cairn_self_similarity_sides(similarity, &trial->cut, stride);
    trial->axis_arcs =
        cairn_self_similarity_unbend(similarity, &trial->cut, &trial->sides, trial->buffer);
    for (int32_t arc = 0; arc < 2; arc++)
        for (int32_t i = 1; i + 1 < trial->axis_arcs.count[arc]; i++) {
            cairn_real distance;

            trial->nearest_segment[count++] = nearest_segment(&trial->axis_arcs, arc, i, &distance);
            sum += cairn_min(distance, most);
            inlier_sum += cairn_min(distance, TRUNCATION_INLIER * similarity->max_distance);
            robust_sum += cairn_min(distance, TRUNCATION_ROBUST * similarity->max_distance);
        }
    all = (cairn_real)count * similarity->max_distance;
    penalty =
        BEND_COST * bend / (1 + bend / BEND_HALF_COST_RAD) + SKEW_COST * cairn_abs(trial->cut.skew);
    trial->cut.truncated_residual = count > 0 ? inlier_sum / all : TRUNCATION_INLIER;
    robust_sum = count > 0 ? robust_sum / all : TRUNCATION_ROBUST;
    sum +=
        similarity->hole_total > 0 ? hole_residual_sum(similarity, &trial->cut, most, &count) : 0;
    similarity->comparison_count++;
    trial->cut.mirror_residual =
        count > 0 ? sum / ((cairn_real)count * similarity->max_distance) : TRUNCATION_DEFAULT;
    trial->cut.mirror_cost = trial->cut.mirror_residual + penalty;
    trial->cut.cost = similarity->robust ? robust_sum + penalty : trial->cut.mirror_cost;
}

int32_t cairn_self_similarity_evaluate_cost(const cairn_self_similarity *similarity, int32_t stride)
{
    int32_t n = similarity->params.outline_samples / stride,
            holes = cairn_self_similarity_hole_samples(similarity);

    return 2 + n / 2 + n * (4 + n / 5) / 10 + holes * (4 + holes) / 10;
}

void cairn_self_similarity_clamp(const cairn_self_similarity *similarity, self_similarity_cut *cut)
{
    cairn_real n = (cairn_real)similarity->params.outline_samples;

    for (int32_t i = 0; i < 2; i++) {
        cut->position[i] -= cut->position[i] >= n ? n : cut->position[i] < 0 ? -n : 0;
        /* Rounding may turn a tiny negative position into n. */
        cut->position[i] = cut->position[i] < n ? cut->position[i] : 0;
    }
    cut->bend = cairn_max(-MAX_BEND_RAD, cairn_min(MAX_BEND_RAD, cut->bend));
    cut->skew = cairn_max(-MAX_SKEW, cairn_min(MAX_SKEW, cut->skew));
}

/* ---- Initial estimate ---- */

/* Estimates bend and skew: points at equal shares of both arcs are paired, and the midpoints of
 * the pairs lie on the axis. */
void cairn_self_similarity_estimate(const cairn_self_similarity *similarity,
                                    self_similarity_cut *cut)
{
    cairn_real n = (cairn_real)similarity->params.outline_samples, low = cut->position[0],
               high = cut->position[1];
    cairn_vec2 from = cairn_self_similarity_point(similarity, similarity->smoothed, low),
               to = cairn_self_similarity_point(similarity, similarity->smoothed, high);
    cairn_real there = high < low ? high + n - low : high - low, back = n - there;
    cairn_real rise = 0, weights = 0, lean = 0, wide = 0;
    cairn_vec2 left[ESTIMATE_PAIRS], right[ESTIMATE_PAIRS];
    axis_frame f = axis_frame_of(from, to, 0, 0);

    cut->bend = cut->skew = 0;
    if (!(f.half > 0))
        return;
    for (int32_t i = 0; i < ESTIMATE_PAIRS; i++) {
        cairn_real share = (cairn_real)(i + 1) / (ESTIMATE_PAIRS + 1), a = low + share * there,
                   b = low - share * back;
        cairn_real x, weight;
        cairn_vec2 p, q;

        left[i] = cairn_self_similarity_point(similarity, similarity->smoothed, a < n ? a : a - n);
        right[i] = cairn_self_similarity_point(similarity, similarity->smoothed, b < 0 ? b + n : b);
        p = to_axis_coordinates(&f, left[i]);
        q = to_axis_coordinates(&f, right[i]);
        x = (p.x + q.x) / (2 * f.half);
        weight = cairn_max(0, 1 - x * x);
        rise += weight * (p.y + q.y) / 2;
        weights += weight * weight;
    }
    cut->bend = weights > 0 ? -4 * cairn_atan2(rise / weights, f.half) : 0;
    cairn_self_similarity_clamp(similarity, cut);
    f = axis_frame_of(from, to, cut->bend, 0);
    for (int32_t i = 0; i < ESTIMATE_PAIRS; i++) {
        cairn_vec2 rib =
            cairn_vec2_sub(to_axis_coordinates(&f, left[i]), to_axis_coordinates(&f, right[i]));

        lean += rib.x * rib.y;
        wide += rib.y * rib.y;
    }
    cut->skew = wide > 0 ? lean / wide : 0;
    cairn_self_similarity_clamp(similarity, cut);
}
