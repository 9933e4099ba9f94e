/* The line algebra of the polyline room: sums in the frame of a piece, and frames from sums. */
#include "src/core/build.h"

#include "src/core/polyline_work.h"

void cairn_polyline_local(const polyline_piece *k, int32_t dim, const cairn_real p[3],
                          cairn_real local[3])
{
    cairn_real dx = p[0] - k->mid[0], dy = p[1] - k->mid[1], dz;

    local[0] = k->axis[0][0] * dx + k->axis[0][1] * dy;
    local[1] = k->axis[1][0] * dx + k->axis[1][1] * dy;
    local[2] = 0;
    if (dim == 2)
        return;
    dz = p[2] - k->mid[2];
    local[0] += k->axis[0][2] * dz;
    local[1] += k->axis[1][2] * dz;
    local[2] = k->axis[2][0] * dx + k->axis[2][1] * dy + k->axis[2][2] * dz;
}

void cairn_polyline_sum(polyline_sums *m, const cairn_real v[3], cairn_real weight)
{
    cairn_real t = weight * v[0], p = weight * v[1], q = weight * v[2];

    m->n += weight;
    m->v[0] += t;
    m->v[1] += p;
    m->vv.xx += t * v[0];
    m->vv.xy += t * v[1];
    m->vv.yy += p * v[1];
    if (q == 0) /* as always in the plane */
        return;
    m->v[2] += q;
    m->vv.xz += t * v[2];
    m->vv.yz += p * v[2];
    m->vv.zz += q * v[2];
}

/* Scatter about the mean, which is also given. n > 0. */
static cairn_sym3 scatter(const polyline_sums *m, cairn_real mean[3])
{
    cairn_sym3 about = m->vv;

    for (int i = 0; i < 3; i++)
        mean[i] = m->v[i] / m->n;
    cairn_sym3_add_outer(&about, mean, -m->n);
    return about;
}

cairn_real cairn_polyline_residual(const polyline_sums *m)
{
    cairn_real mean[3], sse;
    cairn_sym3 about = scatter(m, mean);

    sse = about.yy + about.zz;
    if (about.xx > 0)
        sse -= (about.xy * about.xy + about.xz * about.xz) / about.xx;
    return cairn_max(sse, 0);
}

/* Right-handed frame about axis[0]. */
static void complete(polyline_piece *k, int32_t dim)
{
    cairn_real *u = k->axis[0], *v = k->axis[1], *w = k->axis[2];
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
    /* v: the coordinate axis farthest from u, made orthogonal to it; w = u x v. */
    for (int i = 0; i < 3; i++)
        v[i] = (i == least) - u[least] * u[i];
    norm = cairn_sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int i = 0; i < 3; i++)
        v[i] /= norm;
    for (int i = 0; i < 3; i++)
        w[i] = u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3];
}

/* Moves the origin to `mean` and turns the frame so that its first axis is `along`; both in the
 * frame of the piece. */
static void reframe(polyline_piece *k, const cairn_real mean[3], const cairn_real along[3],
                    int32_t dim)
{
    cairn_real mid[3], direction[3];

    for (int i = 0; i < 3; i++) {
        mid[i] =
            k->mid[i] + k->axis[0][i] * mean[0] + k->axis[1][i] * mean[1] + k->axis[2][i] * mean[2];
        direction[i] =
            k->axis[0][i] * along[0] + k->axis[1][i] * along[1] + k->axis[2][i] * along[2];
    }
    for (int i = 0; i < 3; i++) {
        k->mid[i] = mid[i];
        k->axis[0][i] = direction[i];
    }
    complete(k, dim);
    k->low -= mean[0];
    k->high -= mean[0];
}

void cairn_polyline_fit(polyline_piece *k, const polyline_sums *m, int32_t dim)
{
    cairn_real mean[3], values[3], vectors[3][3], along[3] = {1, 0, 0};
    cairn_sym3 about = scatter(m, mean);
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
    reframe(k, mean, along, dim);
}

void cairn_polyline_fit_own(polyline_piece *k, const polyline_sums *m, int32_t dim)
{
    cairn_real mean[3], along[3] = {1, 0, 0}, stretch;
    cairn_sym3 about = scatter(m, mean);

    if (about.xx > 0) {
        along[1] = about.xy / about.xx;
        along[2] = about.xz / about.xx;
    }
    stretch = 1 + along[1] * along[1] + along[2] * along[2];
    k->tt = cairn_max(about.xx, 0) * stretch;
    k->sse = cairn_polyline_residual(m);
    k->count = cairn_real_to_int(cairn_rint(m->n));
    for (int i = 0; i < 3; i++)
        k->own[i] = 0;
    reframe(k, mean, along, dim);
    k->low *= cairn_sqrt(stretch);
    k->high *= cairn_sqrt(stretch);
}

void cairn_polyline_place(const polyline_piece *k, cairn_real t, cairn_real place[3])
{
    for (int i = 0; i < 3; i++)
        place[i] = k->mid[i] + t * k->axis[0][i];
}

void cairn_polyline_box(polyline_piece *k)
{
    for (int i = 0; i < 3; i++) {
        cairn_real a = k->mid[i] + (k->low - k->reach_low) * k->axis[0][i];
        cairn_real b = k->mid[i] + (k->high + k->reach_high) * k->axis[0][i];

        k->box_min[i] = cairn_min(a, b);
        k->box_max[i] = cairn_max(a, b);
    }
}

cairn_real cairn_polyline_worth(const cairn_polyline *x, cairn_real n, cairn_real sse)
{
    cairn_real freedom = cairn_max(n - 4, 1) * (cairn_real)(x->params.dim - 1);
    cairn_real variance = cairn_max(x->sigma * x->sigma, sse / freedom);

    /* Many points tell bends far below sigma; half a sigma, root mean square, is as fine as a
     * map needs. */
    return cairn_max(x->params.bend * variance, n * x->sigma * x->sigma / 4);
}

void cairn_polyline_keep(cairn_polyline *x, polyline_piece *list, int32_t *count,
                         const polyline_piece *k)
{
    int32_t place = *count;

    if (place == x->params.max_segments) {
        x->part += *count; /* for the search */
        place = 0;
        for (int32_t i = 1; i < *count; i++)
            if (list[i].count <= list[place].count)
                place = i;
        x->left_out++;
        if (list[place].count >= k->count)
            return;
    } else {
        (*count)++;
    }
    list[place] = *k;
    cairn_polyline_box(&list[place]);
    list[place].soft = (polyline_sums){0, {0, 0, 0}, {0, 0, 0, 0, 0, 0}};
    if (*count > x->measure.peak_segments)
        x->measure.peak_segments = *count;
}
