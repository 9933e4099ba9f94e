/* How well a bent outline fits, whatever lies round it.
 *
 * Method: evidence is by what edges come to by chance, and bending pays for its steps one by one;
 * among many edges both forgive much. So three means over the outline's samples are taken of where
 * it came to lie: how near to it an edge of its direction is, on a scale finer than the one it was
 * bent by; how far it is turned from the drawing; and what is left of its places after the affine
 * map of the drawing that is nearest to them: a part that was moved against the others, a bend
 * where there was none.
 *
 * Source: this project's. */
#include "src/core/build.h"

#include <math.h>

#include "cairn/small_matrix.h"
#include "src/host/contour_search_fit.h"

/* Sigmas: of the distance, in sizes, and of the sine of the turn; edges beyond so many are none. */
#define CLOSE      0.012
#define TURN       0.35
#define CLOSE_MOST 4
#define TURN_MOST  2
/* Samples between which the direction of an outline is measured. */
enum { AROUND = 2 };

/* Half the square of how far an edge is from a sample, in sigmas; above the most: it is none. */
static cairn_real cost_of(cairn_segment line, cairn_oriented_point place, cairn_real size)
{
    cairn_vec2 along = cairn_vec2_unit(cairn_vec2_sub(line.b, line.a));
    cairn_real far = cairn_contour_distance(line, place.position) / ((cairn_real)CLOSE * size);
    cairn_real turn = cairn_vec2_cross(along, place.direction) / (cairn_real)TURN;

    return far <= CLOSE_MOST && cairn_abs(turn) <= TURN_MOST ? (far * far + turn * turn) / 2
                                                             : CAIRN_REAL_MAX;
}

/* The lines that come near enough to the box of an outline. */
static int32_t list_near(const cairn_contour_tokens *tokens, const contour_laid *c, int32_t *list)
{
    cairn_real reach = CLOSE_MOST * (cairn_real)CLOSE * c->size;
    cairn_box box = cairn_box_empty();
    int32_t count = 0;

    for (int32_t i = 0; i < c->outline_count; i++)
        box = cairn_box_extend(box, c->outline[i].position);
    for (int32_t i = 0; i < tokens->count; i++) {
        cairn_segment l = tokens->lines[i];

        if (cairn_max(l.a.x, l.b.x) >= box.min.x - reach &&
            cairn_min(l.a.x, l.b.x) <= box.max.x + reach &&
            cairn_max(l.a.y, l.b.y) >= box.min.y - reach &&
            cairn_min(l.a.y, l.b.y) <= box.max.y + reach)
            list[count++] = i;
    }
    return count;
}

/* near: of each sample; NULL: nobody asks. */
static cairn_real close_of(const cairn_contour_tokens *tokens, const contour_laid *c, int32_t *list,
                           cairn_real *near)
{
    int32_t count = list_near(tokens, c, list);
    cairn_real sum = 0;

    for (int32_t i = 0; i < c->outline_count; i++) {
        cairn_real least = CAIRN_REAL_MAX;

        for (int32_t k = 0; k < count; k++)
            least = cairn_min(least, cost_of(tokens->lines[list[k]], c->outline[i], c->size));
        least = least < CAIRN_REAL_MAX ? cairn_exp(-least) : 0;
        if (near != NULL)
            near[i] = least;
        sum += least;
    }
    return sum / (cairn_real)c->outline_count;
}

/* One past the last sample of the outline that begins at first. */
static int32_t end_of_part(const int32_t *part, int32_t first, int32_t count)
{
    int32_t end = first + 1;

    while (end < count && part[end] == part[first])
        end++;
    return end;
}

static cairn_real turned_of(const contour_laid *c, const int32_t *part, const contour_drawn *drawn)
{
    const cairn_oriented_point *d = drawn->outline;
    cairn_real sum = 0;

    for (int32_t first = 0, end; first < c->outline_count; first = end) {
        int32_t length;

        end = end_of_part(part, first, c->outline_count);
        length = end - first;
        for (int32_t i = 0; i < length; i++) {
            int32_t from = first + (i + AROUND * (length - 1)) % length,
                    to = first + (i + AROUND) % length;
            cairn_vec2 was = cairn_vec2_sub(d[to].position, d[from].position),
                       is = cairn_vec2_sub(c->outline[to].position, c->outline[from].position),
                       turned;

            turned.x = drawn->turn.x * was.x - drawn->turn.y * was.y;
            turned.y = drawn->turn.y * was.x + drawn->turn.x * was.y;
            sum += 1 - cairn_vec2_dot(cairn_vec2_unit(turned), cairn_vec2_unit(is));
        }
    }
    /* One less a cosine may round to less than 0. */
    return cairn_max(0, sum) / (cairn_real)c->outline_count;
}

/* The affine map by least squares; 0: there is none. */
static int32_t solve_map(const contour_laid *c, const cairn_oriented_point *drawn,
                         cairn_real map[2][3])
{
    cairn_sym3 sums = cairn_sym3_zero();
    cairn_real right[2][3] = {{0}};

    for (int32_t i = 0; i < c->outline_count; i++) {
        const cairn_real v[3] = {drawn[i].position.x, drawn[i].position.y, 1};
        cairn_vec2 at = cairn_vec2_sub(c->outline[i].position, c->origin);

        cairn_sym3_add_outer(&sums, v, 1);
        for (int32_t k = 0; k < 3; k++) {
            right[0][k] += v[k] * at.x;
            right[1][k] += v[k] * at.y;
        }
    }
    return cairn_sym3_solve(sums, right[0], map[0]) && cairn_sym3_solve(sums, right[1], map[1]);
}

static cairn_real strained_of(const contour_laid *c, const cairn_oriented_point *drawn)
{
    cairn_real map[2][3], sum = 0, area;

    if (!solve_map(c, drawn, map))
        return 1;
    for (int32_t i = 0; i < c->outline_count; i++) {
        cairn_vec2 p = drawn[i].position, at = cairn_vec2_sub(c->outline[i].position, c->origin),
                   laid;

        laid.x = map[0][0] * p.x + map[0][1] * p.y + map[0][2];
        laid.y = map[1][0] * p.x + map[1][1] * p.y + map[1][2];
        sum += cairn_vec2_norm_squared(cairn_vec2_sub(at, laid));
    }
    area = cairn_abs(map[0][0] * map[1][1] - map[0][1] * map[1][0]);
    return area > 0 ? cairn_min(1, cairn_sqrt(sum / ((cairn_real)c->outline_count * area))) : 1;
}

cairn_contour_shape cairn_contour_shape_of(const cairn_contour_tokens *tokens,
                                           const contour_laid *laid, const int32_t *part,
                                           const contour_drawn *drawn, int32_t *list,
                                           cairn_real *near)
{
    cairn_contour_shape shape;

    shape.close = close_of(tokens, laid, list, near);
    shape.turned = turned_of(laid, part, drawn);
    shape.strained = strained_of(laid, drawn->outline);
    return shape;
}
