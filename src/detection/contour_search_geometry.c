/* Geometry of an outline, of its affine transform and of segments, for the sources of
 * contour_search. */
#include "src/base/build.h"

#include "src/detection/contour_search_work.h"

void cairn_contour_search_affine_add(contour_search_affine_sums *sums, cairn_vec2 point,
                                     cairn_real weight, cairn_vec2 weighted)
{
    const cairn_real v[3] = {point.x, point.y, 1};

    cairn_sym3_add_outer(&sums->points, v, weight);
    for (int32_t k = 0; k < 3; k++) {
        sums->right[0][k] += v[k] * weighted.x;
        sums->right[1][k] += v[k] * weighted.y;
    }
}

int32_t cairn_contour_search_affine_solve(const contour_search_affine_sums *sums,
                                          cairn_real map[2][3])
{
    return cairn_sym3_solve(sums->points, sums->right[0], map[0]) &&
           cairn_sym3_solve(sums->points, sums->right[1], map[1]);
}

cairn_real cairn_contour_search_point_distance(cairn_segment line, cairn_vec2 p)
{
    cairn_vec2 along = cairn_vec2_sub(line.b, line.a), to = cairn_vec2_sub(p, line.a);
    cairn_real share =
        cairn_vec2_dot(along, to) / cairn_max(cairn_vec2_norm_squared(along), CAIRN_REAL(1e-6));

    share = cairn_max(0, cairn_min(share, 1));
    return cairn_vec2_norm(cairn_vec2_sub(to, cairn_vec2_scale(along, share)));
}

int32_t cairn_contour_search_nearest_sample(const cairn_oriented_point *outline, int32_t count,
                                            cairn_vec2 point, cairn_real *distance)
{
    cairn_real smallest = CAIRN_REAL_MAX;
    int32_t nearest = 0;

    for (int32_t i = 0; i < count; i++) {
        cairn_real squared = cairn_vec2_norm_squared(cairn_vec2_sub(outline[i].position, point));

        if (squared < smallest) {
            smallest = squared;
            nearest = i;
        }
    }
    *distance = cairn_sqrt(smallest);
    return nearest;
}
