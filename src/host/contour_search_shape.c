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
#define DISTANCE_SIGMA      0.012
#define SINE_SIGMA          0.35
#define MAX_DISTANCE_SIGMAS 4
#define MAX_SINE_SIGMAS     2
/* Samples between which the direction of an outline is measured. */
enum { TANGENT_SPAN = 2 };

/* Half the square of how far an edge is from a sample, in sigmas; above the most: it is none. */
static cairn_real cost_of(cairn_segment line, cairn_oriented_point point, cairn_real size)
{
    cairn_vec2 along = cairn_vec2_unit(cairn_vec2_sub(line.b, line.a));
    cairn_real distance =
        cairn_contour_point_distance(line, point.position) / ((cairn_real)DISTANCE_SIGMA * size);
    cairn_real turn = cairn_vec2_cross(along, point.direction) / (cairn_real)SINE_SIGMA;

    return distance <= MAX_DISTANCE_SIGMAS && cairn_abs(turn) <= MAX_SINE_SIGMAS
               ? (distance * distance + turn * turn) / 2
               : CAIRN_REAL_MAX;
}

/* The lines that come near enough to the box of an outline. */
static int32_t list_candidates(const cairn_contour_tokens *tokens,
                               const contour_fitted_outline *fitted, int32_t *list)
{
    cairn_real reach = MAX_DISTANCE_SIGMAS * (cairn_real)DISTANCE_SIGMA * fitted->size;
    cairn_box box = cairn_box_empty();
    int32_t count = 0;

    for (int32_t i = 0; i < fitted->outline_count; i++)
        box = cairn_box_extend(box, fitted->outline[i].position);
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
static cairn_real edge_proximity(const cairn_contour_tokens *tokens,
                                 const contour_fitted_outline *fitted, int32_t *list,
                                 cairn_real *proximity)
{
    int32_t count = list_candidates(tokens, fitted, list);
    cairn_real sum = 0;

    for (int32_t i = 0; i < fitted->outline_count; i++) {
        cairn_real least = CAIRN_REAL_MAX;

        for (int32_t k = 0; k < count; k++)
            least =
                cairn_min(least, cost_of(tokens->lines[list[k]], fitted->outline[i], fitted->size));
        least = least < CAIRN_REAL_MAX ? cairn_exp(-least) : 0;
        if (proximity != NULL)
            proximity[i] = least;
        sum += least;
    }
    return sum / (cairn_real)fitted->outline_count;
}

/* One past the last sample of the outline that begins at first. */
static int32_t end_of_part(const int32_t *part, int32_t first, int32_t count)
{
    int32_t end = first + 1;

    while (end < count && part[end] == part[first])
        end++;
    return end;
}

static cairn_real tangent_deviation(const contour_fitted_outline *fitted, const int32_t *part,
                                    const contour_reference *reference)
{
    const cairn_oriented_point *d = reference->outline;
    cairn_real sum = 0;

    for (int32_t first = 0, end; first < fitted->outline_count; first = end) {
        int32_t length;

        end = end_of_part(part, first, fitted->outline_count);
        length = end - first;
        for (int32_t i = 0; i < length; i++) {
            int32_t from = first + (i + TANGENT_SPAN * (length - 1)) % length,
                    to = first + (i + TANGENT_SPAN) % length;
            cairn_vec2 was = cairn_vec2_sub(d[to].position, d[from].position),
                       is = cairn_vec2_sub(fitted->outline[to].position,
                                           fitted->outline[from].position),
                       rotated;

            rotated.x = reference->rotation.x * was.x - reference->rotation.y * was.y;
            rotated.y = reference->rotation.y * was.x + reference->rotation.x * was.y;
            sum += 1 - cairn_vec2_dot(cairn_vec2_unit(rotated), cairn_vec2_unit(is));
        }
    }
    /* One less a cosine may round to less than 0. */
    return cairn_max(0, sum) / (cairn_real)fitted->outline_count;
}

/* The affine map by least squares; 0: there is none. */
static int32_t solve_map(const contour_fitted_outline *fitted,
                         const cairn_oriented_point *reference, cairn_real map[2][3])
{
    cairn_sym3 sums = cairn_sym3_zero();
    cairn_real right[2][3] = {{0}};

    for (int32_t i = 0; i < fitted->outline_count; i++) {
        const cairn_real v[3] = {reference[i].position.x, reference[i].position.y, 1};
        cairn_vec2 at = cairn_vec2_sub(fitted->outline[i].position, fitted->origin);

        cairn_sym3_add_outer(&sums, v, 1);
        for (int32_t k = 0; k < 3; k++) {
            right[0][k] += v[k] * at.x;
            right[1][k] += v[k] * at.y;
        }
    }
    return cairn_sym3_solve(sums, right[0], map[0]) && cairn_sym3_solve(sums, right[1], map[1]);
}

static cairn_real deformation_of(const contour_fitted_outline *fitted,
                                 const cairn_oriented_point *reference)
{
    cairn_real map[2][3], sum = 0, area;

    if (!solve_map(fitted, reference, map))
        return 1;
    for (int32_t i = 0; i < fitted->outline_count; i++) {
        cairn_vec2 p = reference[i].position,
                   at = cairn_vec2_sub(fitted->outline[i].position, fitted->origin), mapped;

        mapped.x = map[0][0] * p.x + map[0][1] * p.y + map[0][2];
        mapped.y = map[1][0] * p.x + map[1][1] * p.y + map[1][2];
        sum += cairn_vec2_norm_squared(cairn_vec2_sub(at, mapped));
    }
    area = cairn_abs(map[0][0] * map[1][1] - map[0][1] * map[1][0]);
    return area > 0 ? cairn_min(1, cairn_sqrt(sum / ((cairn_real)fitted->outline_count * area)))
                    : 1;
}

cairn_contour_shape cairn_contour_shape_of(const cairn_contour_tokens *tokens,
                                           const contour_fitted_outline *fitted,
                                           const int32_t *part, const contour_reference *reference,
                                           int32_t *list, cairn_real *proximity)
{
    cairn_contour_shape shape;

    shape.close = edge_proximity(tokens, fitted, list, proximity);
    shape.turned = tangent_deviation(fitted, part, reference);
    shape.strained = deformation_of(fitted, reference->outline);
    return shape;
}
