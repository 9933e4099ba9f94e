/* How much of a bent outline agrees on one similarity map of the drawing, and where that lays it:
 * for objects of the model's own shape that are hidden in part.
 *
 * Method: from each half of the outline, and from all of it, a map is fitted by least squares,
 * samples are weighed by how near they lie to where it lays them, and it is fitted again. What lies
 * behind something else was bent along that, and does not count; what a bend made fit does not,
 * either.
 *
 * Source: this project's. */
#include "src/core/build.h"

#include "src/host/object_detect_work.h"

/* Sigma, in sizes, of how far samples lie from the similarity map that they agree on, at last;
 * wider at first. */
#define AGREED 0.012
static const double widening[] = {4, 2, 1, 1};
/* Halves of the outline that such a map is looked for from, besides the whole; and how much
 * larger or smaller than the outline it makes it, most. */
enum { HALVES = 8, ROUNDS = sizeof widening / sizeof *widening };
#define SCALE_MOST 2

static cairn_vec2 lay(const detect_similarity *s, cairn_vec2 p)
{
    cairn_vec2 laid = {s->a * p.x - s->b * p.y + s->shift.x, s->b * p.x + s->a * p.y + s->shift.y};

    return laid;
}

/* Where a sample came to lie, in the sizes and from the origin of the outline. */
static cairn_vec2 place_of(const contour_fitted_outline *c, int32_t i)
{
    return cairn_vec2_scale(cairn_vec2_sub(c->outline[i].position, c->origin), 1 / c->size);
}

/* By least squares with weights; 0: there is none within SCALE_MOST. */
static int32_t solve_similarity(const contour_fitted_outline *c, const cairn_oriented_point *drawn,
                                const cairn_real *weight, detect_similarity *s)
{
    cairn_vec2 from = {0, 0}, to = {0, 0};
    cairn_real sum = 0, spread = 0, scale;

    for (int32_t i = 0; i < c->outline_count; i++) {
        sum += weight[i];
        from = cairn_vec2_add(from, cairn_vec2_scale(drawn[i].position, weight[i]));
        to = cairn_vec2_add(to, cairn_vec2_scale(place_of(c, i), weight[i]));
    }
    if (!(sum > 0))
        return 0;
    from = cairn_vec2_scale(from, 1 / sum);
    to = cairn_vec2_scale(to, 1 / sum);
    s->a = s->b = 0;
    for (int32_t i = 0; i < c->outline_count; i++) {
        cairn_vec2 p = cairn_vec2_sub(drawn[i].position, from),
                   q = cairn_vec2_sub(place_of(c, i), to);

        s->a += weight[i] * cairn_vec2_dot(p, q);
        s->b += weight[i] * cairn_vec2_cross(p, q);
        spread += weight[i] * cairn_vec2_norm_squared(p);
    }
    if (!(spread > 0))
        return 0;
    s->a /= spread;
    s->b /= spread;
    s->shift.x = s->shift.y = 0;
    s->shift = cairn_vec2_sub(to, lay(s, from));
    scale = s->a * s->a + s->b * s->b;
    return scale > (cairn_real)1 / (SCALE_MOST * SCALE_MOST) && scale < SCALE_MOST * SCALE_MOST;
}

/* Weighs samples by how near an edge is to each, and how near it lies to where the map lays it;
 * the mean weight. */
static cairn_real weigh(const contour_fitted_outline *c, const cairn_oriented_point *drawn,
                        const detect_similarity *s, cairn_real sigma, const cairn_real *near,
                        cairn_real *weight)
{
    cairn_real sum = 0, far = 2 * sigma * sigma * (s->a * s->a + s->b * s->b);

    for (int32_t i = 0; i < c->outline_count; i++) {
        cairn_vec2 beside = cairn_vec2_sub(place_of(c, i), lay(s, drawn[i].position));

        weight[i] = near[i] * cairn_exp(-cairn_vec2_norm_squared(beside) / far);
        sum += weight[i];
    }
    return sum / (cairn_real)c->outline_count;
}

cairn_real cairn_detect_agreed(const contour_fitted_outline *laid,
                               const cairn_oriented_point *drawn, const cairn_real *near,
                               cairn_real *weight, detect_similarity *map)
{
    cairn_real most = 0;

    for (int32_t half = 0; half <= HALVES; half++) {
        int32_t count = laid->outline_count, first = (int32_t)((int64_t)half * count / HALVES),
                is_whole = half == HALVES;
        cairn_real share = 0;
        detect_similarity s;

        for (int32_t i = 0; i < count; i++)
            weight[i] = is_whole || (i - first + count) % count < count / 2 ? near[i] : 0;
        for (int32_t round = 0; round < ROUNDS; round++) {
            if (!solve_similarity(laid, drawn, weight, &s)) {
                share = 0;
                break;
            }
            share = weigh(laid, drawn, &s, (cairn_real)(AGREED * widening[round]), near, weight);
        }
        if (share > most) {
            most = share;
            *map = s;
        }
    }
    return most;
}

void cairn_detect_lay(const detect_similarity *laid, const cairn_oriented_point *drawn,
                      contour_fit *fit, cairn_detection *o)
{
    const cairn_vec2 none = {0, 0};
    cairn_vec2 middle = lay(laid, none);

    for (int32_t i = 0; i < o->outline_count; i++) {
        cairn_vec2 at = cairn_vec2_scale(lay(laid, drawn[i].position), o->size);

        fit->outline[i].position = cairn_vec2_add(o->origin, at);
        fit->outline[i].direction =
            cairn_vec2_unit(cairn_vec2_sub(lay(laid, drawn[i].direction), middle));
    }
    o->origin = cairn_vec2_add(o->origin, cairn_vec2_scale(middle, o->size));
    o->size *= cairn_sqrt(laid->a * laid->a + laid->b * laid->b);
}
