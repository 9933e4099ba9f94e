/* The line in which one arc, mirrored, lies best on the other.
 *
 * An axis is told by its two ends, and a sample more or less there turns it where it is short: at
 * the end of a slit, between the points of a star. All samples together tell the line far better.
 *
 * Method: Gauss and Newton over the line's heading and offset, on the distances of all mirrored
 * samples to the line of the nearest side of the other arc, outliers weighted down (Geman and
 * McClure), from the line through both ends. */
#include "src/core/build.h"

#include "src/contour/self_similarity_work.h"

enum { ROUNDS = 6 };

/* In spans: distances from here on count less and less. */
#define OUTLIER CAIRN_REAL(0.02)
/* A side is looked at when its place along its arc is so near, as a share of the arc. */
#define WINDOW CAIRN_REAL(0.2)

typedef struct mirror_line {
    cairn_vec2 along, normal, point;
} mirror_line;

typedef struct mirror_sums {
    cairn_real turn_turn, turn_shift, shift_shift, turn_residual, shift_residual;
} mirror_sums;

static cairn_vec2 mirrored(const mirror_line *line, cairn_vec2 p)
{
    cairn_real aside = cairn_vec2_dot(line->normal, cairn_vec2_sub(p, line->point));

    return cairn_vec2_sub(p, cairn_vec2_scale(line->normal, 2 * aside));
}

static cairn_vec2 sample_of(const cairn_self_similarity *s, const similarity_sides *sides,
                            int32_t arc, int32_t i)
{
    return s->samples[(sides->first[arc] + i) % s->params.points];
}

/* The side of the other arc that is nearest to the mirror image of sample i, among those at
 * about the same share of it as seen from the same end. 0: that arc has none. */
static int32_t nearest_side(const cairn_self_similarity *s, const similarity_sides *sides,
                            int32_t arc, int32_t i, cairn_vec2 p, cairn_segment *best)
{
    int32_t other = 1 - arc, count = sides->count[other] - 1, middle, reach, first, last;
    cairn_real least = 0;

    best->a = p;
    best->b = p;
    if (count < 1)
        return 0;
    reach = 2 + cairn_real_to_int(WINDOW * (cairn_real)count);
    middle = (sides->count[arc] - i) * count / (sides->count[arc] + 1);
    first = middle > reach ? middle - reach : 0;
    last = middle + reach < count ? middle + reach : count;
    for (int32_t k = first; k < last; k++) {
        cairn_segment side = {sample_of(s, sides, other, k), sample_of(s, sides, other, k + 1)};
        cairn_real d = cairn_segment_distance(side, p);

        if (k == first || d < least) {
            least = d;
            *best = side;
        }
    }
    return last > first;
}

static void add_sample(mirror_sums *sums, const mirror_line *line, cairn_vec2 p, cairn_vec2 image,
                       const cairn_segment *side, cairn_real outlier)
{
    cairn_vec2 normal = cairn_vec2_left(cairn_vec2_unit(cairn_vec2_sub(side->b, side->a)));
    cairn_vec2 from = cairn_vec2_sub(p, line->point), turn;
    cairn_real residual = cairn_vec2_dot(normal, cairn_vec2_sub(image, side->a)),
               scaled = residual / outlier;
    cairn_real share = 1 / (1 + scaled * scaled), weight = share * share, by_turn, by_shift;

    turn = cairn_vec2_add(cairn_vec2_scale(line->normal, cairn_vec2_dot(line->along, from)),
                          cairn_vec2_scale(line->along, cairn_vec2_dot(line->normal, from)));
    by_turn = 2 * cairn_vec2_dot(normal, turn);
    by_shift = 2 * cairn_vec2_dot(normal, line->normal);
    sums->turn_turn += weight * by_turn * by_turn;
    sums->turn_shift += weight * by_turn * by_shift;
    sums->shift_shift += weight * by_shift * by_shift;
    sums->turn_residual += weight * by_turn * residual;
    sums->shift_residual += weight * by_shift * residual;
}

/* One round from where the line lies. 0: nothing tells it. */
static int32_t improve(const cairn_self_similarity *s, const similarity_sides *sides,
                       mirror_line *line)
{
    mirror_sums sums = {0, 0, 0, 0, 0};
    cairn_real determinant, turn, shift, sine, cosine;

    for (int32_t arc = 0; arc < 2; arc++)
        for (int32_t i = 0; i < sides->count[arc]; i++) {
            cairn_vec2 p = sample_of(s, sides, arc, i), image = mirrored(line, p);
            cairn_segment side;

            if (nearest_side(s, sides, arc, i, image, &side))
                add_sample(&sums, line, p, image, &side, OUTLIER * s->span);
        }
    determinant = sums.turn_turn * sums.shift_shift - sums.turn_shift * sums.turn_shift;
    if (!(determinant > CAIRN_REAL(1e-6) * sums.turn_turn * sums.shift_shift))
        return 0;
    turn = (sums.turn_shift * sums.shift_residual - sums.shift_shift * sums.turn_residual) /
           determinant;
    shift =
        (sums.turn_shift * sums.turn_residual - sums.turn_turn * sums.shift_residual) / determinant;
    cairn_sincos(turn, &sine, &cosine);
    line->point = cairn_vec2_add(line->point, cairn_vec2_scale(line->normal, shift));
    line->along = cairn_vec2_unit(cairn_vec2_add(cairn_vec2_scale(line->along, cosine),
                                                 cairn_vec2_scale(line->normal, sine)));
    line->normal = cairn_vec2_left(line->along);
    return 1;
}

int32_t cairn_similarity_mirror_units(const cairn_self_similarity *s)
{
    return ROUNDS * cairn_similarity_trial_units(s, 1);
}

void cairn_similarity_mirror(const cairn_self_similarity *s, const similarity_cut *cut,
                             cairn_symmetry_axis *axis)
{
    similarity_sides sides = cairn_similarity_sides(s, cut, 1);
    mirror_line line;

    line.along = axis->mirror_along;
    line.normal = cairn_vec2_left(line.along);
    line.point = axis->mirror_point;
    for (int32_t round = 0; round < ROUNDS; round++)
        if (!improve(s, &sides, &line))
            return;
    axis->mirror_along = line.along;
    axis->mirror_point = line.point;
}
