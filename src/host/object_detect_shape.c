/* How well a bent outline fits, whatever lies round it.
 *
 * Method: evidence is by what edges come to by chance, and bending pays for its steps one by one; among many edges both forgive much. So
 * three means over the outline's samples are taken of where it came to lie: how near to it an edge of its direction is, on a scale finer
 * than the one it was bent by; how far it is turned from the drawing; and what is left of its places after the affine map of the drawing
 * that is nearest to them: a part that was moved against the others, a bend where there was none.
 * Besides, how much of it agrees on one similarity map, for objects of the model's own shape that are hidden in part.
 *
 * Source: this project's. */
#include "src/core/build.h"

#include <math.h>

#include "cairn/small_matrix.h"
#include "src/host/object_detect_work.h"

/* Sigmas: of the distance, in sizes, and of the sine of the turn; edges beyond so many are none. */
#define CLOSE      0.012
#define TURN       0.35
#define CLOSE_MOST 4
#define TURN_MOST  2
/* Sigma, in sizes, of how far samples lie from the similarity map that they agree on, at last; wider at first. */
#define AGREED 0.012
static const double widening[] = {4, 2, 1, 1};
/* Halves of the outline that such a map is looked for from, besides the whole; and how much larger or smaller than the outline it makes it,
 * most. */
enum { HALVES = 8, ROUNDS = sizeof widening / sizeof *widening };
#define SCALE_MOST 2
/* Samples between which the direction of an outline is measured. */
enum { AROUND = 2 };

/* Half the square of how far an edge is from a sample, in sigmas; above the most: it is none. */
static cairn_real cost_of(cairn_segment line, cairn_oriented_point place, cairn_real size)
{
    cairn_vec2 along = cairn_vec2_unit(cairn_vec2_sub(line.b, line.a));
    cairn_real far = cairn_contour_distance(line, place.position) / ((cairn_real)CLOSE * size);
    cairn_real turn = cairn_vec2_cross(along, place.direction) / (cairn_real)TURN;

    return far <= CLOSE_MOST && cairn_abs(turn) <= TURN_MOST ? (far * far + turn * turn) / 2 : CAIRN_REAL_MAX;
}

/* The lines that come near enough to the box of a detection. */
static int32_t list_near(const cairn_contour_tokens *tokens, const cairn_detection *o, int32_t *list)
{
    cairn_real reach = CLOSE_MOST * (cairn_real)CLOSE * o->size;
    int32_t count = 0;

    for (int32_t i = 0; i < tokens->count; i++) {
        cairn_segment l = tokens->lines[i];

        if (cairn_max(l.a.x, l.b.x) >= o->left - reach && cairn_min(l.a.x, l.b.x) <= o->right + reach &&
            cairn_max(l.a.y, l.b.y) >= o->top - reach && cairn_min(l.a.y, l.b.y) <= o->bottom + reach)
            list[count++] = i;
    }
    return count;
}

/* near: [outline_count] of each sample. */
static cairn_real near_of(const cairn_contour_tokens *tokens, const cairn_detection *o, const contour_fit *fit,
                          int32_t *list, cairn_real *near)
{
    int32_t count = list_near(tokens, o, list);
    cairn_real sum = 0;

    for (int32_t i = 0; i < o->outline_count; i++) {
        cairn_real least = CAIRN_REAL_MAX;

        for (int32_t k = 0; k < count; k++)
            least = cairn_min(least, cost_of(tokens->lines[list[k]], fit->outline[i], o->size));
        near[i] = least < CAIRN_REAL_MAX ? cairn_exp(-least) : 0;
        sum += near[i];
    }
    return sum / (cairn_real)o->outline_count;
}

/* One past the last sample of the outline that begins at first. */
static int32_t end_of_part(const contour_fit *fit, int32_t first, int32_t count)
{
    int32_t end = first + 1;

    while (end < count && fit->part[end] == fit->part[first])
        end++;
    return end;
}

static cairn_real turned_of(const contour_fit *fit, const cairn_oriented_point *drawn, int32_t count)
{
    cairn_real sum = 0;

    for (int32_t first = 0, end; first < count; first = end) {
        int32_t length;

        end = end_of_part(fit, first, count);
        length = end - first;
        for (int32_t i = 0; i < length; i++) {
            int32_t from = first + (i + AROUND * (length - 1)) % length, to = first + (i + AROUND) % length;
            cairn_vec2 was = cairn_vec2_sub(drawn[to].position, drawn[from].position),
                       is = cairn_vec2_sub(fit->outline[to].position, fit->outline[from].position);

            sum += 1 - cairn_vec2_dot(cairn_vec2_unit(was), cairn_vec2_unit(is));
        }
    }
    return sum / (cairn_real)count;
}

/* The affine map by least squares; 0: there is none. */
static int32_t solve_map(const contour_fit *fit, const cairn_oriented_point *drawn, const cairn_detection *o,
                         cairn_real map[2][3])
{
    cairn_sym3 sums = cairn_sym3_zero();
    cairn_real right[2][3] = {{0}};

    for (int32_t i = 0; i < o->outline_count; i++) {
        const cairn_real v[3] = {drawn[i].position.x, drawn[i].position.y, 1};
        cairn_vec2 at = cairn_vec2_sub(fit->outline[i].position, o->origin);

        cairn_sym3_add_outer(&sums, v, 1);
        for (int32_t k = 0; k < 3; k++) {
            right[0][k] += v[k] * at.x;
            right[1][k] += v[k] * at.y;
        }
    }
    return cairn_sym3_solve(sums, right[0], map[0]) && cairn_sym3_solve(sums, right[1], map[1]);
}

static cairn_real strained_of(const contour_fit *fit, const cairn_oriented_point *drawn, const cairn_detection *o)
{
    cairn_real map[2][3], sum = 0, area;

    if (!solve_map(fit, drawn, o, map))
        return 1;
    for (int32_t i = 0; i < o->outline_count; i++) {
        cairn_vec2 p = drawn[i].position, at = cairn_vec2_sub(fit->outline[i].position, o->origin), laid;

        laid.x = map[0][0] * p.x + map[0][1] * p.y + map[0][2];
        laid.y = map[1][0] * p.x + map[1][1] * p.y + map[1][2];
        sum += cairn_vec2_norm_squared(cairn_vec2_sub(at, laid));
    }
    area = cairn_abs(map[0][0] * map[1][1] - map[0][1] * map[1][0]);
    return area > 0 ? cairn_min(1, cairn_sqrt(sum / ((cairn_real)o->outline_count * area))) : 1;
}

static cairn_vec2 lay(const detect_similarity *s, cairn_vec2 p)
{
    cairn_vec2 laid = {s->a * p.x - s->b * p.y + s->shift.x, s->b * p.x + s->a * p.y + s->shift.y};

    return laid;
}

/* Where a sample came to lie, in the sizes and from the origin of the detection. */
static cairn_vec2 place_of(const contour_fit *fit, const cairn_detection *o, int32_t i)
{
    return cairn_vec2_scale(cairn_vec2_sub(fit->outline[i].position, o->origin), 1 / o->size);
}

/* By least squares with weights; 0: there is none within SCALE_MOST. */
static int32_t solve_similarity(const contour_fit *fit, const cairn_oriented_point *drawn, const cairn_detection *o,
                                const cairn_real *weight, detect_similarity *s)
{
    cairn_vec2 from = {0, 0}, to = {0, 0};
    cairn_real sum = 0, spread = 0, scale;

    for (int32_t i = 0; i < o->outline_count; i++) {
        sum += weight[i];
        from = cairn_vec2_add(from, cairn_vec2_scale(drawn[i].position, weight[i]));
        to = cairn_vec2_add(to, cairn_vec2_scale(place_of(fit, o, i), weight[i]));
    }
    if (!(sum > 0))
        return 0;
    from = cairn_vec2_scale(from, 1 / sum);
    to = cairn_vec2_scale(to, 1 / sum);
    s->a = s->b = 0;
    for (int32_t i = 0; i < o->outline_count; i++) {
        cairn_vec2 p = cairn_vec2_sub(drawn[i].position, from), q = cairn_vec2_sub(place_of(fit, o, i), to);

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

/* Weighs samples by how near an edge is to each, and how near it lies to where the map lays it; the mean weight. */
static cairn_real weigh(const contour_fit *fit, const cairn_oriented_point *drawn, const cairn_detection *o,
                        const detect_similarity *s, cairn_real sigma, const cairn_real *near, cairn_real *weight)
{
    cairn_real sum = 0, far = 2 * sigma * sigma * (s->a * s->a + s->b * s->b);

    for (int32_t i = 0; i < o->outline_count; i++) {
        cairn_vec2 beside = cairn_vec2_sub(place_of(fit, o, i), lay(s, drawn[i].position));

        weight[i] = near[i] * cairn_exp(-cairn_vec2_norm_squared(beside) / far);
        sum += weight[i];
    }
    return sum / (cairn_real)o->outline_count;
}

/* The most of the outline that agrees on one similarity map: from each half of it, and from all, by weighing and solving again. What lies behind
 * something else was laid along that, and does not count; what a bend made fit does not, either. */
static cairn_real agreed_of(const contour_fit *fit, const cairn_oriented_point *drawn, const cairn_detection *o,
                            const cairn_real *near, cairn_real *weight, detect_similarity *laid)
{
    cairn_real most = 0;

    for (int32_t half = 0; half <= HALVES; half++) {
        int32_t count = o->outline_count, first = (int32_t)((int64_t)half * count / HALVES), is_whole = half == HALVES;
        cairn_real share = 0;
        detect_similarity s;

        for (int32_t i = 0; i < count; i++)
            weight[i] = is_whole || (i - first + count) % count < count / 2 ? near[i] : 0;
        for (int32_t round = 0; round < ROUNDS; round++) {
            if (!solve_similarity(fit, drawn, o, weight, &s)) {
                share = 0;
                break;
            }
            share = weigh(fit, drawn, o, &s, (cairn_real)(AGREED * widening[round]), near, weight);
        }
        if (share > most) {
            most = share;
            *laid = s;
        }
    }
    return most;
}

void cairn_detect_lay(const detect_similarity *laid, const cairn_oriented_point *drawn, contour_fit *fit,
                      cairn_detection *o)
{
    const cairn_vec2 none = {0, 0};
    cairn_vec2 middle = lay(laid, none);

    for (int32_t i = 0; i < o->outline_count; i++) {
        cairn_vec2 at = cairn_vec2_scale(lay(laid, drawn[i].position), o->size);

        fit->outline[i].position = cairn_vec2_add(o->origin, at);
        fit->outline[i].direction = cairn_vec2_unit(cairn_vec2_sub(lay(laid, drawn[i].direction), middle));
    }
    o->origin = cairn_vec2_add(o->origin, cairn_vec2_scale(middle, o->size));
    o->size *= cairn_sqrt(laid->a * laid->a + laid->b * laid->b);
}

void cairn_detect_shape(const cairn_contour_tokens *tokens, const contour_fit *fit, const cairn_oriented_point *drawn,
                        int32_t *list, cairn_real *room, detect_similarity *laid, cairn_detection *o)
{
    o->close = near_of(tokens, o, fit, list, room);
    o->agreed = agreed_of(fit, drawn, o, room, room + o->outline_count, laid);
    o->turned = turned_of(fit, drawn, o->outline_count);
    o->strained = strained_of(fit, drawn, o);
}
