/* Two arcs as mirror images of each other.
 *
 * An axis from end to end may bend evenly, and its ribs may lean. Taken back to a straight axis
 * and upright ribs, the arcs of a symmetric shape lie one on the other when one of them is
 * turned over. What is left between them, from each sample to the other arc, is the misfit; bend
 * and skew cost a little, so that they are found only where they explain something. */
#include "src/core/build.h"

#include "src/contour/self_similarity_work.h"

/* A side is looked at when its place along its arc is so near, as a share of the arc. */
#define WINDOW CAIRN_REAL(0.2)
/* An axis that bends less is straight. */
#define STRAIGHT  CAIRN_REAL(1e-3)
#define MOST_BEND CAIRN_REAL(3.0)
#define MOST_SKEW CAIRN_REAL(1.0)
/* In spans: no sample counts for more: of what lies close, of a fit where joints moved,
 * elsewhere. */
#define CLOSE       CAIRN_REAL(0.01)
#define ROBUST      CAIRN_REAL(0.02)
#define MOST_MISFIT CAIRN_REAL(0.1)
/* In spans a rad, the first degrees of a bend the most, and spans for ribs that lean by 45
 * degrees. */
#define BEND_COST CAIRN_REAL(0.03)
#define BEND_HALF CAIRN_REAL(0.25)
#define SKEW_COST CAIRN_REAL(0.008)

enum { PAIRS = 12 };

/* ---- The axis ---- */

typedef struct frame {
    /* straight: the first end; bent: the centre, and from there to the middle of the axis */
    cairn_vec2 origin, along;
    /* of the axis, < 0: it turns right; 0: it is straight */
    cairn_real radius;
    /* of its length */
    cairn_real half;
    cairn_real skew;
} frame;

static frame frame_of(cairn_vec2 from, cairn_vec2 to, cairn_real bend, cairn_real skew)
{
    cairn_vec2 chord = cairn_vec2_sub(to, from), along = cairn_vec2_unit(chord),
               across = cairn_vec2_left(along);
    cairn_real length = cairn_vec2_norm(chord), sine, cosine;
    frame f = {from, along, 0, length / 2, skew};

    if (cairn_abs(bend) < STRAIGHT)
        return f;
    cairn_sincos(bend / 2, &sine, &cosine);
    f.radius = length / (2 * sine);
    f.half = f.radius * bend / 2;
    f.origin = cairn_vec2_add(cairn_vec2_add(from, cairn_vec2_scale(chord, CAIRN_REAL(0.5))),
                              cairn_vec2_scale(across, f.radius * cosine));
    f.along = cairn_vec2_scale(across, f.radius > 0 ? -1 : 1);
    return f;
}

/* Where a point lies along the axis, from its middle, and aside of it to the left, its ribs
 * upright. */
static cairn_vec2 flatten(const frame *f, cairn_vec2 p)
{
    cairn_vec2 v = cairn_vec2_sub(p, f->origin), flat;

    if (f->radius == 0) {
        flat.x = cairn_vec2_dot(f->along, v) - f->half;
        flat.y = cairn_vec2_cross(f->along, v);
    } else {
        flat.x =
            f->radius * cairn_atan2(cairn_vec2_cross(f->along, v), cairn_vec2_dot(f->along, v));
        flat.y = f->radius + (f->radius > 0 ? -cairn_vec2_norm(v) : cairn_vec2_norm(v));
    }
    flat.x -= f->skew * flat.y;
    return flat;
}

/* ---- Arcs ---- */

similarity_sides cairn_similarity_sides(const cairn_self_similarity *s, const similarity_cut *cut,
                                        int32_t stride)
{
    similarity_sides sides = {{0, 0}, {0, 0}, stride};

    for (int32_t arc = 0; arc < 2; arc++) {
        cairn_real from = cut->place[arc], to = cut->place[1 - arc];
        int32_t first = cairn_real_to_int(cairn_floor(from)) + 1;

        first += (stride - first % stride) % stride;
        to += to < from ? (cairn_real)s->params.points : 0;
        sides.first[arc] = first;
        while ((cairn_real)(first + stride * sides.count[arc]) < to)
            sides.count[arc]++;
    }
    return sides;
}

similarity_flat cairn_similarity_lay(const cairn_self_similarity *s, const similarity_cut *cut,
                                     const similarity_sides *sides, cairn_vec2 *room)
{
    cairn_vec2 end[2] = {cairn_similarity_point(s, s->smooth, cut->place[0]),
                         cairn_similarity_point(s, s->smooth, cut->place[1])};
    frame f = frame_of(end[0], end[1], cut->bend, cut->skew);
    similarity_flat flat;

    for (int32_t arc = 0; arc < 2; arc++) {
        int32_t count = sides->count[arc] + 2, last = count - 1;

        flat.points[arc] = room;
        flat.count[arc] = count;
        for (int32_t k = 0; k < count; k++) {
            int32_t i =
                (sides->first[arc] + (k - 1) * sides->stride + s->params.points) % s->params.points;
            cairn_vec2 p = flatten(&f, k == 0 ? end[arc] : k == last ? end[1 - arc] : s->smooth[i]);

            p.y = arc == 0 ? p.y : -p.y;
            room[arc == 0 ? k : last - k] = p;
        }
        room += count;
    }
    return flat;
}

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

/* The side of the other arc that is nearest to point i of an arc, among those at about the same
 * share of it. */
static int32_t nearest_side(const similarity_flat *flat, int32_t arc, int32_t i,
                            cairn_real *distance)
{
    const cairn_vec2 *other = flat->points[1 - arc];
    int32_t sides = flat->count[1 - arc] - 1,
            reach = 2 + cairn_real_to_int(WINDOW * (cairn_real)sides);
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

int32_t cairn_similarity_hole_samples(const cairn_self_similarity *s)
{
    int32_t sum = 0;

    for (int32_t h = 0; h < s->holes; h++)
        sum += s->hole_count[h];
    return sum;
}

/* The sum over the samples of all holes of the distance of their mirror images to the nearest
 * side of any. *count grows by their number. */
static cairn_real misfit_of_holes(cairn_self_similarity *s, const similarity_cut *cut,
                                  cairn_real most, int32_t *count)
{
    frame f = frame_of(cairn_similarity_point(s, s->smooth, cut->place[0]),
                       cairn_similarity_point(s, s->smooth, cut->place[1]), cut->bend, cut->skew);
    int32_t all = cairn_similarity_hole_samples(s);
    cairn_real sum = 0;

    for (int32_t i = 0; i < all; i++)
        s->flat_holes[i] = flatten(&f, s->samples[s->params.points + i]);
    for (int32_t i = 0; i < all; i++) {
        cairn_vec2 mirrored = {s->flat_holes[i].x, -s->flat_holes[i].y};
        const cairn_vec2 *hole = s->flat_holes;
        cairn_real least = most * most;

        for (int32_t h = 0; h < s->holes; hole += s->hole_count[h++])
            for (int32_t k = 0; k < s->hole_count[h]; k++)
                least = cairn_min(
                    least, squared_distance(hole[k], hole[k + 1 < s->hole_count[h] ? k + 1 : 0],
                                            mirrored));
        sum += cairn_sqrt(least);
    }
    *count += all;
    return sum;
}

void cairn_similarity_try(cairn_self_similarity *s, similarity_trial *t, int32_t stride)
{
    cairn_real sum = 0, close = 0, robust = 0, most = MOST_MISFIT * s->span;
    cairn_real bend = cairn_abs(t->cut.bend), price, all;
    int32_t count = 0;

    t->sides = cairn_similarity_sides(s, &t->cut, stride);
    t->flat = cairn_similarity_lay(s, &t->cut, &t->sides, t->room);
    for (int32_t arc = 0; arc < 2; arc++)
        for (int32_t i = 1; i + 1 < t->flat.count[arc]; i++) {
            cairn_real distance;

            t->near[count++] = nearest_side(&t->flat, arc, i, &distance);
            sum += cairn_min(distance, most);
            close += cairn_min(distance, CLOSE * s->span);
            robust += cairn_min(distance, ROBUST * s->span);
        }
    all = (cairn_real)count * s->span;
    price = BEND_COST * bend / (1 + bend / BEND_HALF) + SKEW_COST * cairn_abs(t->cut.skew);
    t->cut.close = count > 0 ? close / all : CLOSE;
    robust = count > 0 ? robust / all : ROBUST;
    sum += s->holes > 0 ? misfit_of_holes(s, &t->cut, most, &count) : 0;
    s->comparisons++;
    t->cut.misfit = count > 0 ? sum / ((cairn_real)count * s->span) : MOST_MISFIT;
    t->cut.whole = t->cut.misfit + price;
    t->cut.cost = s->robust ? robust + price : t->cut.whole;
}

int32_t cairn_similarity_trial_units(const cairn_self_similarity *s, int32_t stride)
{
    int32_t n = s->params.points / stride, holes = cairn_similarity_hole_samples(s);

    return 2 + n / 2 + n * (4 + n / 5) / 10 + holes * (4 + holes) / 10;
}

void cairn_similarity_limit(const cairn_self_similarity *s, similarity_cut *cut)
{
    cairn_real n = (cairn_real)s->params.points;

    for (int32_t i = 0; i < 2; i++) {
        cut->place[i] -= cut->place[i] >= n ? n : cut->place[i] < 0 ? -n : 0;
        /* What is below 0 by less than rounding tells comes out as n. */
        cut->place[i] = cut->place[i] < n ? cut->place[i] : 0;
    }
    cut->bend = cairn_max(-MOST_BEND, cairn_min(MOST_BEND, cut->bend));
    cut->skew = cairn_max(-MOST_SKEW, cairn_min(MOST_SKEW, cut->skew));
}

/* ---- A first guess ---- */

/* Points at equal shares of both arcs; the middles between them lie on the axis. */
void cairn_similarity_guess(const cairn_self_similarity *s, similarity_cut *cut)
{
    cairn_real n = (cairn_real)s->params.points, low = cut->place[0], high = cut->place[1];
    cairn_vec2 from = cairn_similarity_point(s, s->smooth, low),
               to = cairn_similarity_point(s, s->smooth, high);
    cairn_real there = high < low ? high + n - low : high - low, back = n - there;
    cairn_real rise = 0, weights = 0, lean = 0, wide = 0;
    cairn_vec2 left[PAIRS], right[PAIRS];
    frame f = frame_of(from, to, 0, 0);

    cut->bend = cut->skew = 0;
    if (!(f.half > 0))
        return;
    for (int32_t i = 0; i < PAIRS; i++) {
        cairn_real share = (cairn_real)(i + 1) / (PAIRS + 1), a = low + share * there,
                   b = low - share * back;
        cairn_real x, weight;
        cairn_vec2 p, q;

        left[i] = cairn_similarity_point(s, s->smooth, a < n ? a : a - n);
        right[i] = cairn_similarity_point(s, s->smooth, b < 0 ? b + n : b);
        p = flatten(&f, left[i]);
        q = flatten(&f, right[i]);
        x = (p.x + q.x) / (2 * f.half);
        weight = cairn_max(0, 1 - x * x);
        rise += weight * (p.y + q.y) / 2;
        weights += weight * weight;
    }
    cut->bend = weights > 0 ? -4 * cairn_atan2(rise / weights, f.half) : 0;
    cairn_similarity_limit(s, cut);
    f = frame_of(from, to, cut->bend, 0);
    for (int32_t i = 0; i < PAIRS; i++) {
        cairn_vec2 rib = cairn_vec2_sub(flatten(&f, left[i]), flatten(&f, right[i]));

        lean += rib.x * rib.y;
        wide += rib.y * rib.y;
    }
    cut->skew = wide > 0 ? lean / wide : 0;
    cairn_similarity_limit(s, cut);
}
