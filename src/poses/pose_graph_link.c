/* pose_graph: links: residuals, Jacobians, robust weights, and their blocks of the normal
 * equations. The method is described in pose_graph_solve.c. chi-squared of a link is the square of
 * its normalized residual: e^T Omega e. */
#include "src/base/build.h"

#include "src/poses/pose_graph_work.h"

/* Returns rho(s) and its derivative, the weight; with c^2 scaled by graduated non-convexity. */
static cairn_real rho(const cairn_pose_graph_params *params, cairn_real kernel_scale, cairn_real s,
                      cairn_real *weight)
{
    cairn_real c2 = params->kernel_width * params->kernel_width, share;

    *weight = 1;
    switch (params->kernel) {
    case CAIRN_POSE_GRAPH_HUBER:
        if (s <= c2)
            return s;
        *weight = params->kernel_width / cairn_sqrt(s);
        return 2 * params->kernel_width * cairn_sqrt(s) - c2;
    case CAIRN_POSE_GRAPH_CAUCHY:
        *weight = 1 / (1 + s / c2);
        return c2 * cairn_log(1 + s / c2);
    case CAIRN_POSE_GRAPH_GEMAN_MCCLURE:
        c2 *= kernel_scale;
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

/* Residual and information of a link in the map frame. */
static void residual(const struct pose_graph_link *link, const cairn_pose *poses, cairn_real e[3],
                     cairn_sym3 *w)
{
    cairn_pose a = poses[link->first], b = poses[link->second];
    cairn_real s, c;

    cairn_sincos(a.theta, &s, &c);
    e[0] = b.x - a.x - (c * link->measured.x - s * link->measured.y);
    e[1] = b.y - a.y - (s * link->measured.x + c * link->measured.y);
    e[2] = cairn_wrap_angle(b.theta - a.theta - link->measured.theta);
    *w = cairn_sym3_rotate(link->information, s, c);
}

/* Residual and information of the unit vectors of headings; *turn is R_z. */
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

/* Enters the lever arm v into the Jacobian of the first pose. */
static void set_lever(cairn_real a[9], cairn_real x, cairn_real y)
{
    a[2] = -y;
    a[5] = x;
}

/* product = A^T W, where the third row of A is (0 0 1). */
static void multiply_transposed(const cairn_real a[9], cairn_sym3 w, cairn_real product[9])
{
    const cairn_real rows[3][3] = {{w.xx, w.xy, w.xz}, {w.xy, w.yy, w.yz}, {w.xz, w.yz, w.zz}};

    for (int c = 0; c < 3; c++) {
        product[c] = a[0] * rows[0][c] + a[3] * rows[1][c];
        product[3 + c] = a[1] * rows[0][c] + a[4] * rows[1][c];
        product[6 + c] = a[2] * rows[0][c] + a[5] * rows[1][c] + rows[2][c];
    }
}

/* Returns the symmetric product m A. */
static cairn_sym3 multiply(const cairn_real m[9], const cairn_real a[9])
{
    cairn_sym3 product = {m[0] * a[0] + m[1] * a[3],        m[0] * a[1] + m[1] * a[4],
                          m[0] * a[2] + m[1] * a[5] + m[2], m[3] * a[1] + m[4] * a[4],
                          m[3] * a[2] + m[4] * a[5] + m[5], m[6] * a[2] + m[7] * a[5] + m[8]};
    return product;
}

/* Adds W, A^T W A and -A^T W of a link to the normal equations. */
static void add_blocks(cairn_pose_graph *graph, int32_t index, cairn_sym3 w, const cairn_real a[9])
{
    const struct pose_graph_link *link = &graph->links[index];
    cairn_real aw[9];
    int moves_first = !cairn_pose_graph_is_fixed(graph, link->first),
        moves_second = !cairn_pose_graph_is_fixed(graph, link->second);

    multiply_transposed(a, w, aw);
    if (moves_second)
        graph->system.diagonal[link->second] =
            cairn_sym3_add(graph->system.diagonal[link->second], w);
    if (moves_first)
        graph->system.diagonal[link->first] =
            cairn_sym3_add(graph->system.diagonal[link->first], multiply(aw, a));
    if (moves_first && moves_second) {
        for (int k = 0; k < 9; k++)
            aw[k] = -aw[k];
        if (graph->solver.add_link_block(graph->solver.context, index, aw) != CAIRN_OK)
            graph->system.is_singular = 1;
    }
}

static void add_right_side(cairn_pose_graph *graph, const struct pose_graph_link *link,
                           const cairn_real e[3], cairn_sym3 w, const cairn_real a[9])
{
    cairn_real we[3];

    cairn_sym3_times(w, e, we);
    if (!cairn_pose_graph_is_fixed(graph, link->second))
        for (int k = 0; k < 3; k++)
            graph->system.right[link->second][k] -= we[k];
    if (!cairn_pose_graph_is_fixed(graph, link->first))
        for (int k = 0; k < 3; k++)
            graph->system.right[link->first][k] +=
                a[k] * we[0] + a[3 + k] * we[1] + a[6 + k] * we[2];
}

/* Adds a link to the right-hand side and to the matrix. */
static void add_link(cairn_pose_graph *graph, int32_t index, const cairn_real e[3], cairn_sym3 w,
                     const cairn_real a[9])
{
    add_right_side(graph, &graph->links[index], e, w, a);
    add_blocks(graph, index, w, a);
}

const cairn_pose *cairn_pose_graph_linearization_poses(const cairn_pose_graph *graph)
{
    return graph->system.mode == POSE_GRAPH_JOINT || graph->newton.is_watchdog_step ? graph->trial
                                                                                    : graph->poses;
}

void cairn_pose_graph_assemble_link(cairn_pose_graph *graph, int32_t index)
{
    struct pose_graph_link *link = &graph->links[index];
    const cairn_pose *poses = cairn_pose_graph_linearization_poses(graph);
    cairn_real a[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, e[3], v[2], chi2;
    cairn_sym3 w;

    if (link->is_excluded)
        return;
    if (graph->system.mode == POSE_GRAPH_HEADINGS) {
        heading_residual(link, poses, e, &w, a);
        add_link(graph, index, e, w, a);
        return;
    }
    residual(link, poses, e, &w);
    v[0] = poses[link->second].x - poses[link->first].x;
    v[1] = poses[link->second].y - poses[link->first].y;
    if (graph->system.mode == POSE_GRAPH_JOINT) {
        set_lever(a, v[0] - e[0], v[1] - e[1]);
        add_link(graph, index, e, w, a);
        return;
    }
    chi2 = cairn_sym3_form(w, e);
    graph->sums.cost += rho(&graph->params, graph->newton.kernel_scale, chi2, &link->weight);
    set_lever(a, v[0], v[1]);
    add_link(graph, index, e, cairn_sym3_scale(w, link->weight), a);
}

cairn_real cairn_pose_graph_curvature_of_link(const cairn_pose_graph *graph, int32_t index)
{
    const struct pose_graph_link *link = &graph->links[index];
    const cairn_pose *poses = cairn_pose_graph_linearization_poses(graph);
    const cairn_real *first = graph->newton.direction[link->first],
                     *second = graph->newton.direction[link->second];
    cairn_pose a = poses[link->first], b = poses[link->second];
    const cairn_real e[3] = {second[0] - first[0] + (b.y - a.y) * first[2],
                             second[1] - first[1] - (b.x - a.x) * first[2], second[2] - first[2]};

    if (link->is_excluded)
        return 0;
    return link->weight * cairn_sym3_form(cairn_sym3_rotate_by(link->information, a.theta), e);
}

static void cost_of_link(cairn_pose_graph *graph, struct pose_graph_link *link,
                         const cairn_pose *poses, cairn_real e[3], cairn_sym3 *w)
{
    residual(link, poses, e, w);
    link->chi2 = cairn_sym3_form(*w, e);
    if (link->is_excluded) {
        link->weight = 0;
        return;
    }
    graph->sums.chi2 += link->chi2;
    graph->sums.cost += rho(&graph->params, graph->newton.kernel_scale, link->chi2, &link->weight);
    graph->sums.max_chi2 = cairn_max(graph->sums.max_chi2, link->chi2);
}

void cairn_pose_graph_cost_of_link(cairn_pose_graph *graph, int32_t index)
{
    cairn_real e[3];
    cairn_sym3 w;

    cost_of_link(graph, &graph->links[index], graph->poses, e, &w);
}

void cairn_pose_graph_try_link(cairn_pose_graph *graph, int32_t index)
{
    struct pose_graph_link *link = &graph->links[index];
    cairn_real a[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, e[3];
    cairn_sym3 w;

    cost_of_link(graph, link, graph->trial, e, &w);
    if (link->is_excluded || graph->system.mode != POSE_GRAPH_NEWTON)
        return;
    set_lever(a, graph->trial[link->second].x - graph->trial[link->first].x,
              graph->trial[link->second].y - graph->trial[link->first].y);
    add_right_side(graph, link, e, cairn_sym3_scale(w, link->weight), a);
}
