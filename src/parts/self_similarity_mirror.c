/* Least-squares fit of a mirror line.
 *
 * The two ends of a short axis determine its direction poorly (at the end of a slit, between the
 * points of a star). All samples together determine it much better.
 *
 * Method:
 * 1. Start from the line through both ends.
 * 2. Residuals: distances of all reflected samples to the line of the nearest segment of the other
 *    arc.
 * 3. Gauss-Newton over the line's heading and offset, with Geman-McClure weights. */
#include "src/base/build.h"

#include "src/parts/self_similarity_work.h"

enum { MAX_ITERATIONS = 6 };

/* Scale of the Geman-McClure weight, relative to the greatest inner distance. */
#define GEMAN_MCCLURE_SCALE CAIRN_REAL(0.02)
/* Search window of the nearest segment about the proportional position, share of the arc. */
#define SEARCH_WINDOW CAIRN_REAL(0.2)

typedef struct mirror_line {
    cairn_vec2 along, normal, point;
} mirror_line;

typedef struct normal_equations {
    cairn_real turn_turn, turn_shift, shift_shift, turn_residual, shift_residual;
} normal_equations;

/* Returns the mirror image of a point. */
static cairn_vec2 reflect(const mirror_line *line, cairn_vec2 p)
{
    cairn_real aside = cairn_vec2_dot(line->normal, cairn_vec2_sub(p, line->point));

    return cairn_vec2_sub(p, cairn_vec2_scale(line->normal, 2 * aside));
}

static cairn_vec2 sample_of(const cairn_self_similarity *similarity,
                            const self_similarity_sides *sides, int32_t arc, int32_t i)
{
    return similarity->samples[(sides->first[arc] + i) % similarity->params.outline_samples];
}

/* Finds the segment of the other arc nearest to the reflection of sample i, within the search
 * window; returns 0 if that arc has no segment. */
static int32_t nearest_segment(const cairn_self_similarity *similarity,
                               const self_similarity_sides *sides, int32_t arc, int32_t i,
                               cairn_vec2 p, cairn_segment *best)
{
    int32_t other = 1 - arc, count = sides->count[other] - 1, middle, reach, first, last;
    cairn_real least = 0;

    best->a = p;
    best->b = p;
    if (count < 1)
        return 0;
    reach = 2 + cairn_real_to_int(SEARCH_WINDOW * (cairn_real)count);
    middle = (sides->count[arc] - i) * count / (sides->count[arc] + 1);
    first = middle > reach ? middle - reach : 0;
    last = middle + reach < count ? middle + reach : count;
    for (int32_t k = first; k < last; k++) {
        cairn_segment side = {sample_of(similarity, sides, other, k),
                              sample_of(similarity, sides, other, k + 1)};
        cairn_real d = cairn_segment_distance(side, p);

        if (k == first || d < least) {
            least = d;
            *best = side;
        }
    }
    return last > first;
}

/* Adds the residual of a sample to the weighted normal equations. */
static void add_sample(normal_equations *sums, const mirror_line *line, cairn_vec2 p,
                       cairn_vec2 image, const cairn_segment *side, cairn_real outlier)
{
    cairn_vec2 normal = cairn_vec2_left_perp(cairn_vec2_unit(cairn_vec2_sub(side->b, side->a)));
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

/* Runs one Gauss-Newton iteration; returns 0 if the normal equations are singular. */
static int32_t iterate(const cairn_self_similarity *similarity, const self_similarity_sides *sides,
                       mirror_line *line)
{
    normal_equations sums = {0, 0, 0, 0, 0};
    cairn_real determinant, turn, shift, sine, cosine;

    for (int32_t arc = 0; arc < 2; arc++)
        for (int32_t i = 0; i < sides->count[arc]; i++) {
            cairn_vec2 p = sample_of(similarity, sides, arc, i), image = reflect(line, p);
            cairn_segment side;

            if (nearest_segment(similarity, sides, arc, i, image, &side))
                add_sample(&sums, line, p, image, &side,
                           GEMAN_MCCLURE_SCALE * similarity->max_distance);
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
    line->normal = cairn_vec2_left_perp(line->along);
    return 1;
}

int32_t cairn_self_similarity_mirror_cost(const cairn_self_similarity *similarity)
{
    return MAX_ITERATIONS * cairn_self_similarity_evaluate_cost(similarity, 1);
}

void cairn_self_similarity_mirror(const cairn_self_similarity *similarity,
                                  const self_similarity_cut *cut, cairn_self_similarity_axis *axis)
{
    self_similarity_sides sides = cairn_self_similarity_sides(similarity, cut, 1);
    mirror_line line;

    line.along = axis->mirror_direction;
    line.normal = cairn_vec2_left_perp(line.along);
    line.point = axis->mirror_point;
    for (int32_t round = 0; round < MAX_ITERATIONS; round++)
        if (!iterate(similarity, &sides, &line))
            return;
    axis->mirror_direction = line.along;
    axis->mirror_point = line.point;
}
