/* Rotations after which a shape looks the same.
 *
 * Method: the outline is turned about its centre of area by the k-th part of a whole turn, k = 2
 * ... MOST_TURNS, and measured against itself, from each sample to the nearest side, samples of
 * holes to those of holes. The greatest k that fits is the shape's; where every k fits, any turn
 * does. */
#include "src/core/build.h"

#include "src/contour/self_similarity_work.h"

enum { MOST_TURNS = 12, SIDES_A_UNIT = 8 };

/* In mean distances of the outline from its centre. */
#define FITS CAIRN_REAL(0.012)

static cairn_vec2 centre_of(const cairn_vec2 *points, int32_t count)
{
    cairn_real area = 0;
    cairn_vec2 sum = {0, 0};

    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 a = cairn_vec2_sub(points[i], points[0]);
        cairn_vec2 b = cairn_vec2_sub(points[i + 1 < count ? i + 1 : 0], points[0]);
        cairn_real twice = cairn_vec2_cross(a, b);

        area += twice;
        sum = cairn_vec2_add(sum, cairn_vec2_scale(cairn_vec2_add(a, b), twice / 3));
    }
    return area != 0 ? cairn_vec2_add(points[0], cairn_vec2_scale(sum, 1 / area)) : points[0];
}

static cairn_real nearest(const cairn_vec2 *points, int32_t count, cairn_vec2 p)
{
    cairn_real least = 0;

    for (int32_t i = 0; i < count; i++) {
        cairn_segment side = {points[i], points[i + 1 < count ? i + 1 : 0]};
        cairn_real d = cairn_segment_distance(side, p);

        least = i == 0 || d < least ? d : least;
    }
    return least;
}

/* The nearest side of the outline, or of any hole. */
static cairn_real nearest_of_kind(const cairn_self_similarity *s, int is_hole, cairn_vec2 p)
{
    const cairn_vec2 *hole = s->samples + s->params.points;
    cairn_real least =
        is_hole ? nearest(hole, s->hole_count[0], p) : nearest(s->samples, s->params.points, p);

    for (int32_t h = 1; h < s->holes && is_hole; h++) {
        hole += s->hole_count[h - 1];
        least = cairn_min(least, nearest(hole, s->hole_count[h], p));
    }
    return least;
}

/* s->i: turns, from 2 on; s->k: the sample; s->turned: the sum of distances. */
cairn_status cairn_similarity_turn_step(cairn_self_similarity *s, cairn_budget *budget)
{
    int32_t n = s->params.points, all = n + cairn_similarity_hole_samples(s);

    for (; s->i <= MOST_TURNS; s->i++, s->k = 0) {
        cairn_transform turn = {0, 0, 0, 0};
        cairn_vec2 centre = centre_of(s->samples, n);

        cairn_sincos(2 * CAIRN_PI / (cairn_real)s->i, &turn.sine, &turn.cosine);
        for (; s->k < all; s->k++) {
            cairn_vec2 arm = cairn_vec2_sub(s->samples[s->k], centre);

            if (!cairn_budget_pay(budget, &s->paid, 1 + n / SIDES_A_UNIT))
                return CAIRN_MORE;
            s->size += cairn_vec2_norm(arm);
            s->turned += nearest_of_kind(
                s, s->k >= n, cairn_vec2_add(centre, cairn_transform_direction(turn, arm)));
        }
        if (s->turned <= FITS * s->size) {
            s->rotations = s->i;
            s->fitting++;
        }
        s->turned = s->size = 0;
    }
    if (s->fitting == MOST_TURNS - 1)
        s->rotations = 0;
    return CAIRN_OK;
}

void cairn_similarity_turn_begin(cairn_self_similarity *s)
{
    s->i = 2;
    s->k = 0;
    s->turned = s->size = 0;
    s->rotations = 1;
    s->fitting = 0;
}
