/* Links of a pose graph: residuals, the kernel's weights, what they add to the normal equations.
 * The method is told in pose_graph_solve.c. */
#include "src/core/build.h"

#include "src/mapping/pose_graph_work.h"

/* The information turned by an angle of this sine and cosine. */
static cairn_sym3 turned_by(cairn_sym3 information, cairn_real s, cairn_real c)
{
    cairn_sym3 m = information;

    m.xx = c * c * information.xx - 2 * c * s * information.xy + s * s * information.yy;
    m.yy = s * s * information.xx + 2 * c * s * information.xy + c * c * information.yy;
    m.xy = c * s * (information.xx - information.yy) + (c * c - s * s) * information.xy;
    m.xz = c * information.xz - s * information.yz;
    m.yz = s * information.xz + c * information.yz;
    return m;
}

cairn_sym3 cairn_pose_graph_turned(cairn_sym3 information, cairn_real theta)
{
    cairn_real s, c;

    cairn_sincos(theta, &s, &c);
    return turned_by(information, s, c);
}

/* rho(s) and its derivative, the weight, with c^2 widened. */
static cairn_real rho(const cairn_pose_graph *g, cairn_real s, cairn_real *weight)
{
    cairn_real c2 = g->params.width * g->params.width, share;

    *weight = 1;
    switch (g->params.kernel) {
    case CAIRN_POSE_GRAPH_HUBER:
        if (s <= c2)
            return s;
        *weight = g->params.width / cairn_sqrt(s);
        return 2 * g->params.width * cairn_sqrt(s) - c2;
    case CAIRN_POSE_GRAPH_CAUCHY:
        *weight = 1 / (1 + s / c2);
        return c2 * cairn_log(1 + s / c2);
    case CAIRN_POSE_GRAPH_GEMAN_MCCLURE:
        c2 *= g->widening;
        share = c2 / (c2 + s);
        *weight = share * share;
        return s * share;
    case CAIRN_POSE_GRAPH_DCS:
        if (s <= c2)
            return s;
        share = 2 * c2 / (c2 + s);
        *weight = share * share;
        return 3 * c2 - 2 * c2 * share;
    default:
        return s;
    }
}

/* Residual and information of a link in the map's frame. */
static void residual(const struct pose_graph_link *link, const cairn_pose *poses, cairn_real e[3],
                     cairn_sym3 *w)
{
    cairn_pose a = poses[link->first], b = poses[link->second];
    cairn_real s, c;

    cairn_sincos(a.theta, &s, &c);
    e[0] = b.x - a.x - (c * link->measured.x - s * link->measured.y);
    e[1] = b.y - a.y - (s * link->measured.x + c * link->measured.y);
    e[2] = cairn_wrap_angle(b.theta - a.theta - link->measured.theta);
    *w = turned_by(link->information, s, c);
}

/* The same of the unit vectors of headings; *turn is R_z. */
static void heading_residual(const struct pose_graph_link *link, const cairn_pose *poses,
                             cairn_real e[3], cairn_sym3 *w, cairn_real turn[9])
{
    cairn_transform a = cairn_transform_of(poses[link->first]),
                    b = cairn_transform_of(poses[link->second]);
    cairn_real s, c;

    cairn_sincos(link->measured.theta, &s, &c);
    e[0] = b.cosine - (c * a.cosine - s * a.sine);
    e[1] = b.sine - (s * a.cosine + c * a.sine);
    e[2] = 0;
    *w = cairn_sym3_zero();
    w->xx = w->yy = link->information.zz;
    turn[0] = turn[4] = c;
    turn[1] = -s;
    turn[3] = s;
}

/* v in the derivative by the first pose. */
static void set_lever(cairn_real a[9], cairn_real x, cairn_real y)
{
    a[2] = -y;
    a[5] = x;
}

static cairn_sym3 times(cairn_sym3 m, cairn_real by)
{
    cairn_sym3 product = {by * m.xx, by * m.xy, by * m.xz, by * m.yy, by * m.yz, by * m.zz};
    return product;
}

static void add(cairn_sym3 *to, cairn_sym3 m)
{
    to->xx += m.xx;
    to->xy += m.xy;
    to->xz += m.xz;
    to->yy += m.yy;
    to->yz += m.yz;
    to->zz += m.zz;
}

/* product = A^T W, where the third row of A is (0 0 1) */
static void multiply_transposed(const cairn_real a[9], cairn_sym3 w, cairn_real product[9])
{
    const cairn_real rows[3][3] = {{w.xx, w.xy, w.xz}, {w.xy, w.yy, w.yz}, {w.xz, w.yz, w.zz}};

    for (int c = 0; c < 3; c++) {
        product[c] = a[0] * rows[0][c] + a[3] * rows[1][c];
        product[3 + c] = a[1] * rows[0][c] + a[4] * rows[1][c];
        product[6 + c] = a[2] * rows[0][c] + a[5] * rows[1][c] + rows[2][c];
    }
}

/* The symmetric product m A */
static cairn_sym3 multiply(const cairn_real m[9], const cairn_real a[9])
{
    cairn_sym3 product = {m[0] * a[0] + m[1] * a[3],        m[0] * a[1] + m[1] * a[4],
                          m[0] * a[2] + m[1] * a[5] + m[2], m[3] * a[1] + m[4] * a[4],
                          m[3] * a[2] + m[4] * a[5] + m[5], m[6] * a[2] + m[7] * a[5] + m[8]};
    return product;
}

/* Adds W, A^T W A and -A^T W of a link to the normal equations. */
static void add_blocks(cairn_pose_graph *g, int32_t index, cairn_sym3 w, const cairn_real a[9])
{
    const struct pose_graph_link *link = &g->links[index];
    cairn_real aw[9];
    int moves_first = !cairn_pose_graph_stays(g, link->first),
        moves_second = !cairn_pose_graph_stays(g, link->second);

    multiply_transposed(a, w, aw);
    if (moves_second)
        add(&g->diagonal[link->second], w);
    if (moves_first)
        add(&g->diagonal[link->first], multiply(aw, a));
    if (moves_first && moves_second) {
        for (int k = 0; k < 9; k++)
            aw[k] = -aw[k];
        if (g->solver.add_link_block(g->solver.context, index, aw) != CAIRN_OK)
            g->outcome = CAIRN_NOT_FINITE;
    }
}

static void add_right_side(cairn_pose_graph *g, const struct pose_graph_link *link,
                           const cairn_real e[3], cairn_sym3 w, const cairn_real a[9])
{
    const cairn_real we[3] = {w.xx * e[0] + w.xy * e[1] + w.xz * e[2],
                              w.xy * e[0] + w.yy * e[1] + w.yz * e[2],
                              w.xz * e[0] + w.yz * e[1] + w.zz * e[2]};

    if (!cairn_pose_graph_stays(g, link->second))
        for (int k = 0; k < 3; k++)
            g->right[link->second][k] -= we[k];
    if (!cairn_pose_graph_stays(g, link->first))
        for (int k = 0; k < 3; k++)
            g->right[link->first][k] += a[k] * we[0] + a[3 + k] * we[1] + a[6 + k] * we[2];
}

/* Adds a link to the right side and to the matrix. */
static void add_link(cairn_pose_graph *g, int32_t index, const cairn_real e[3], cairn_sym3 w,
                     const cairn_real a[9])
{
    add_right_side(g, &g->links[index], e, w, a);
    add_blocks(g, index, w, a);
}

const cairn_pose *cairn_pose_graph_base(const cairn_pose_graph *g)
{
    return g->mode == POSE_GRAPH_JOINT || g->ahead ? g->trial : g->poses;
}

void cairn_pose_graph_assemble_link(cairn_pose_graph *g, int32_t index)
{
    struct pose_graph_link *link = &g->links[index];
    const cairn_pose *poses = cairn_pose_graph_base(g);
    cairn_real a[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, e[3], v[2], chi2;
    cairn_sym3 w;

    if (link->dropped)
        return;
    if (g->mode == POSE_GRAPH_HEADINGS) {
        heading_residual(link, poses, e, &w, a);
        add_link(g, index, e, w, a);
        return;
    }
    residual(link, poses, e, &w);
    v[0] = poses[link->second].x - poses[link->first].x;
    v[1] = poses[link->second].y - poses[link->first].y;
    if (g->mode == POSE_GRAPH_JOINT) {
        set_lever(a, v[0] - e[0], v[1] - e[1]);
        add_link(g, index, e, w, a);
        return;
    }
    chi2 = cairn_sym3_form(w, e);
    g->cost += rho(g, chi2, &link->weight);
    set_lever(a, v[0], v[1]);
    add_link(g, index, e, times(w, link->weight), a);
}

cairn_real cairn_pose_graph_curvature_of_link(const cairn_pose_graph *g, int32_t index)
{
    const struct pose_graph_link *link = &g->links[index];
    const cairn_pose *poses = cairn_pose_graph_base(g);
    const cairn_real *first = g->direction[link->first], *second = g->direction[link->second];
    cairn_pose a = poses[link->first], b = poses[link->second];
    const cairn_real e[3] = {second[0] - first[0] + (b.y - a.y) * first[2],
                             second[1] - first[1] - (b.x - a.x) * first[2], second[2] - first[2]};

    if (link->dropped)
        return 0;
    return link->weight * cairn_sym3_form(cairn_pose_graph_turned(link->information, a.theta), e);
}

static void cost_of_link(cairn_pose_graph *g, struct pose_graph_link *link, const cairn_pose *poses,
                         cairn_real e[3], cairn_sym3 *w)
{
    residual(link, poses, e, w);
    link->chi2 = cairn_sym3_form(*w, e);
    if (link->dropped) {
        link->weight = 0;
        return;
    }
    g->chi2 += link->chi2;
    g->cost += rho(g, link->chi2, &link->weight);
    g->largest = cairn_max(g->largest, link->chi2);
}

void cairn_pose_graph_cost_of_link(cairn_pose_graph *g, int32_t index)
{
    cairn_real e[3];
    cairn_sym3 w;

    cost_of_link(g, &g->links[index], g->poses, e, &w);
}

void cairn_pose_graph_try_link(cairn_pose_graph *g, int32_t index)
{
    struct pose_graph_link *link = &g->links[index];
    cairn_real a[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, e[3];
    cairn_sym3 w;

    cost_of_link(g, link, g->trial, e, &w);
    if (link->dropped || g->mode != POSE_GRAPH_NEWTON)
        return;
    set_lever(a, g->trial[link->second].x - g->trial[link->first].x,
              g->trial[link->second].y - g->trial[link->first].y);
    add_right_side(g, link, e, times(w, link->weight), a);
}
