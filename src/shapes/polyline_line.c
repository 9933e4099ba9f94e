/* Line algebra of the fit: moments in the frame of a component, and frames from moments.
 *
 * Source: total least squares by the principal axis (Pearson 1901). */
#include "src/base/build.h"

#include "src/shapes/polyline_work.h"

extern inline void cairn_polyline_to_local(const polyline_component *component, int32_t dim,
                                           const cairn_real p[3], cairn_real local[3]);
extern inline void cairn_polyline_add_point(polyline_sums *sums, const cairn_real v[3],
                                            cairn_real weight);

/* Scatter matrix about the mean, in m^2; sets *mean. n > 0. */
static cairn_sym3 scatter(const polyline_sums *sums, cairn_real mean[3])
{
    cairn_sym3 about = sums->vv;

    for (int i = 0; i < 3; i++)
        mean[i] = sums->v[i] / sums->weight;
    cairn_sym3_add_outer(&about, mean, -sums->weight);
    return about;
}

cairn_real cairn_polyline_residual(const polyline_sums *sums)
{
    cairn_real mean[3], sse;
    cairn_sym3 about = scatter(sums, mean);

    sse = about.yy + about.zz;
    if (about.xx > 0)
        sse -= (about.xy * about.xy + about.xz * about.xz) / about.xx;
    return cairn_max(sse, 0);
}

/* Completes axis[0] to a right-handed orthonormal frame. */
static void complete_frame(polyline_component *component, int32_t dim)
{
    cairn_real *u = component->axis[0], *v = component->axis[1], *w = component->axis[2];
    cairn_real norm = cairn_sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
    int least = 0;

    for (int i = 0; i < 3; i++)
        u[i] /= norm;
    if (dim == 2) {
        v[0] = -u[1];
        v[1] = u[0];
        v[2] = w[0] = w[1] = 0;
        w[2] = 1;
        return;
    }
    for (int i = 1; i < 3; i++)
        if (cairn_abs(u[i]) < cairn_abs(u[least]))
            least = i;
    /* v: the coordinate axis least parallel to u, orthogonalized (Gram-Schmidt); w = u x v. */
    for (int i = 0; i < 3; i++)
        v[i] = (i == least) - u[least] * u[i];
    norm = cairn_sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int i = 0; i < 3; i++)
        v[i] /= norm;
    for (int i = 0; i < 3; i++)
        w[i] = u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3];
}

/* Moves the origin of the frame to `mean`, and rotates its first axis to `along`; both in the old
 * frame. */
static void reframe(polyline_component *component, const cairn_real mean[3],
                    const cairn_real along[3], int32_t dim)
{
    cairn_real mid[3], direction[3];

    for (int i = 0; i < 3; i++) {
        mid[i] = component->mid[i] + component->axis[0][i] * mean[0] +
                 component->axis[1][i] * mean[1] + component->axis[2][i] * mean[2];
        direction[i] = component->axis[0][i] * along[0] + component->axis[1][i] * along[1] +
                       component->axis[2][i] * along[2];
    }
    for (int i = 0; i < 3; i++) {
        component->mid[i] = mid[i];
        component->axis[0][i] = direction[i];
    }
    complete_frame(component, dim);
    component->low -= mean[0];
    component->high -= mean[0];
}

void cairn_polyline_fit(polyline_component *component, const polyline_sums *sums, int32_t dim)
{
    cairn_real mean[3], values[3], vectors[3][3], along[3] = {1, 0, 0};
    cairn_sym3 about = scatter(sums, mean);
    cairn_real sign;

    if (dim == 2) {
        cairn_sym2 plane = {about.xx, about.xy, about.yy};
        cairn_vec2 minor, major;

        cairn_sym2_eigen(plane, values, &minor, &major);
        along[0] = major.x;
        along[1] = major.y;
    } else {
        cairn_sym3_eigen(about, values, vectors);
        for (int i = 0; i < 3; i++)
            along[i] = vectors[2][i];
    }
    sign = along[0] < 0 ? -1 : 1;
    for (int i = 0; i < 3; i++)
        along[i] *= sign;
    reframe(component, mean, along, dim);
}

void cairn_polyline_fit_own(polyline_component *component, const polyline_sums *sums, int32_t dim)
{
    cairn_real mean[3], along[3] = {1, 0, 0}, stretch;
    cairn_sym3 about = scatter(sums, mean);

    if (about.xx > 0) {
        along[1] = about.xy / about.xx;
        along[2] = about.xz / about.xx;
    }
    stretch = 1 + along[1] * along[1] + along[2] * along[2];
    component->tt = cairn_max(about.xx, 0) * stretch;
    component->sse = cairn_polyline_residual(sums);
    component->count = cairn_real_to_int(cairn_rint(sums->weight));
    for (int i = 0; i < 3; i++)
        component->own_mean[i] = 0;
    reframe(component, mean, along, dim);
    component->low *= cairn_sqrt(stretch);
    component->high *= cairn_sqrt(stretch);
}

void cairn_polyline_point_at(const polyline_component *component, cairn_real t, cairn_real point[3])
{
    for (int i = 0; i < 3; i++)
        point[i] = component->mid[i] + t * component->axis[0][i];
}

void cairn_polyline_box(polyline_component *component)
{
    for (int i = 0; i < 3; i++) {
        cairn_real a =
            component->mid[i] + (component->low - component->reach_low) * component->axis[0][i];
        cairn_real b =
            component->mid[i] + (component->high + component->reach_high) * component->axis[0][i];

        component->box_min[i] = cairn_min(a, b);
        component->box_max[i] = cairn_max(a, b);
    }
}

cairn_real cairn_polyline_split_penalty(const cairn_polyline *polyline, cairn_real n,
                                        cairn_real sse)
{
    cairn_real freedom = cairn_max(n - 4, 1) * (cairn_real)(polyline->params.dim - 1);
    cairn_real variance = cairn_max(polyline->sigma * polyline->sigma, sse / freedom);

    /* With many points bends far below sigma become significant; a root mean square of half a sigma
     * is accurate enough for a map. */
    return cairn_max(polyline->params.segment_penalty * variance,
                     n * polyline->sigma * polyline->sigma / 4);
}

void cairn_polyline_insert(cairn_polyline *polyline, polyline_component *list, int32_t *count,
                           const polyline_component *component)
{
    int32_t index = *count;

    if (index == polyline->params.max_segments) {
        index = 0;
        for (int32_t i = 1; i < *count; i++)
            if (list[i].count <= list[index].count)
                index = i;
        polyline->dropped++;
        if (list[index].count >= component->count)
            return;
    } else {
        (*count)++;
    }
    list[index] = *component;
    cairn_polyline_box(&list[index]);
    list[index].soft_sums = (polyline_sums){0, {0, 0, 0}, {0, 0, 0, 0, 0, 0}};
    if (*count > polyline->measure.peak_segments)
        polyline->measure.peak_segments = *count;
}
