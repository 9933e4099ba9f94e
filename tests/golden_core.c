/* Golden scenes of the core modules and of pose graphs. */
#include "src/base/build.h"

#include "cairn/geometry.h"
#include "cairn/pose_consensus.h"
#include "cairn/pose_graph.h"
#include "cairn/pose_graph_robust.h"
#include "cairn/small_matrix.h"
#include "tests/golden.h"

uint64_t golden_elementary_functions(void)
{
    cairn_random random = cairn_random_seed(1, 1);
    uint64_t hash = GOLDEN_START;

    for (int i = 0; i < 40000; i++) {
        cairn_real a = argument(&random, 100, 0), b = argument(&random, 4, i & 1), sine, cosine;

        cairn_sincos(a, &sine, &cosine);
        hash = add_real(hash, sine);
        hash = add_real(hash, cosine);
        hash = add_real(hash, cairn_sin(b));
        hash = add_real(hash, cairn_cos(b));
        hash = add_real(hash, cairn_atan2(a, b));
        hash = add_real(hash, cairn_exp(a));
        hash = add_real(hash, cairn_exp(b));
        hash = add_real(hash, cairn_log(cairn_abs(b)));
        hash = add_real(hash, cairn_erfc(b));
        hash = add_real(hash, cairn_wrap_angle(a));
        hash = add_real(hash, cairn_sqrt(cairn_abs(a)));
        hash = add_real(hash, (cairn_real)cairn_real_to_int(a));
    }
    return hash;
}

uint64_t golden_random_numbers(void)
{
    cairn_random random = cairn_random_seed(2, 1);
    uint64_t hash = GOLDEN_START;

    for (int i = 0; i < 20000; i++) {
        uint32_t bits = cairn_random_bits(&random);

        hash = add_bytes(hash, &bits, sizeof bits);
        hash = add_real(hash, cairn_random_unit(&random));
        hash = add_real(hash, cairn_random_uniform(&random, -3, 7));
        hash = add_real(hash, cairn_random_normal(&random));
        hash = add_real(hash, (cairn_real)cairn_random_below(&random, 1000));
    }
    return hash;
}

static cairn_vec2 random_point(cairn_random *random)
{
    cairn_real x = argument(random, 10, 0);
    cairn_real y = argument(random, 10, 0);
    cairn_vec2 point = {x, y};

    return point;
}

static cairn_pose random_pose(cairn_random *random)
{
    cairn_vec2 p = random_point(random);
    cairn_pose pose = {p.x, p.y, argument(random, CAIRN_PI, 0)};

    return pose;
}

uint64_t golden_poses_and_segments(void)
{
    cairn_random random = cairn_random_seed(3, 1);
    uint64_t hash = GOLDEN_START;
    cairn_pose walk = cairn_pose_identity();

    for (int i = 0; i < 5000; i++) {
        cairn_pose a = random_pose(&random), b = random_pose(&random);
        cairn_segment s, t;
        cairn_vec2 corners[4], point;
        cairn_real parameter;

        walk = cairn_pose_compose(walk, a);
        hash = add_pose(hash, walk);
        hash = add_pose(hash, cairn_pose_inverse(a));
        hash = add_pose(hash, cairn_pose_between(a, b));
        for (int k = 0; k < 4; k++)
            corners[k] = random_point(&random);
        s.a = corners[0], s.b = corners[1], t.a = corners[2], t.b = corners[3];
        hash = add_point(hash, cairn_segment_nearest(s, corners[2], &parameter));
        hash = add_real(hash, parameter);
        hash = add_real(hash, cairn_segment_distance(t, corners[0]));
        if (cairn_line_intersection(s, t, &point))
            hash = add_point(hash, point);
        hash = add_real(hash, (cairn_real)cairn_segments_intersect(s, t));
        hash = add_real(hash, cairn_polygon_area(corners, 4));
        hash = add_point(hash, cairn_vec2_unit(corners[3]));
    }
    return hash;
}

uint64_t golden_small_matrices(void)
{
    cairn_random random = cairn_random_seed(4, 1);
    uint64_t hash = GOLDEN_START;

    for (int i = 0; i < 5000; i++) {
        cairn_sym3 m = cairn_sym3_zero(), inverse;
        cairn_sym2 small;
        cairn_real values[3], vectors[3][3], v[3], x[3];
        cairn_vec2 minor, major;

        for (int k = 0; k < 4; k++) {
            for (int c = 0; c < 3; c++)
                v[c] = argument(&random, 3, 0);
            cairn_sym3_add_outer(&m, v, 1);
        }
        small.xx = m.xx, small.xy = m.xy, small.yy = m.yy;
        cairn_sym2_eigen(small, values, &minor, &major);
        hash = add_point(add_point(hash, minor), major);
        hash = add_real(add_real(hash, values[0]), values[1]);
        if (cairn_sym3_solve(m, v, x))
            for (int k = 0; k < 3; k++)
                hash = add_real(hash, x[k]);
        if (cairn_sym3_inverse(m, &inverse))
            hash = add_real(add_real(hash, inverse.xy), inverse.zz);
        cairn_sym3_eigen(m, values, vectors);
        for (int k = 0; k < 9; k++)
            hash = add_real(hash, vectors[k / 3][k % 3]);
        for (int k = 0; k < 3; k++)
            hash = add_real(hash, values[k]);
    }
    return hash;
}

/* A drive round a block, twice, with measurements between nearby places, some of them wrong. */
enum { NODES = 24 };

static cairn_pose drive_pose(int32_t i)
{
    cairn_pose pose = cairn_pose_identity(), step = {1, 0, 0};

    for (int32_t k = 0; k < i; k++) {
        step.theta = k % 3 == 2 ? CAIRN_PI / 2 : 0;
        pose = cairn_pose_compose(pose, step);
    }
    return pose;
}

static cairn_pose measured(cairn_random *random, int32_t i, int32_t j)
{
    cairn_pose seen = cairn_pose_between(drive_pose(i), drive_pose(j));

    seen.x += cairn_random_uniform(random, -CAIRN_REAL(0.02), CAIRN_REAL(0.02));
    seen.y += cairn_random_uniform(random, -CAIRN_REAL(0.02), CAIRN_REAL(0.02));
    seen.theta += cairn_random_uniform(random, -CAIRN_REAL(0.01), CAIRN_REAL(0.01));
    return seen;
}

/* A chain with closures, of which one is wrong; 0 when it is refused. */
static int fill_graph(cairn_pose_graph *graph)
{
    cairn_random random = cairn_random_seed(8, 1);
    cairn_sym3 information = {2500, 0, 0, 2500, 0, 10000};

    for (int32_t i = 0; i < NODES; i++)
        if (cairn_pose_graph_add_pose(graph, cairn_pose_identity()) != CAIRN_OK)
            return 0;
    for (int32_t i = 0; i < NODES; i++)
        for (int32_t j = i + 1; j < NODES; j++)
            if ((j - i == 1 || j - i == 12) &&
                cairn_pose_graph_add_link(graph, i, j,
                                          measured(&random, i, i == 5 && j == 17 ? 9 : j),
                                          information) != CAIRN_OK)
                return 0;
    return 1;
}

uint64_t golden_pose_graphs(void)
{
    cairn_pose_graph_params params = cairn_pose_graph_default();
    cairn_budget budget = {INT32_MAX};
    cairn_pose_graph *graph;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    params.max_poses = NODES;
    params.max_links = 3 * NODES;
    params.max_fill = 12 * NODES;
    params.kernel = CAIRN_POSE_GRAPH_CAUCHY;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_pose_graph_create(&graph, &pool, &params, NULL) != CAIRN_OK)
        return 0;
    if (!fill_graph(graph) || cairn_pose_graph_solve(graph) != CAIRN_OK ||
        cairn_pose_graph_step(graph, &budget) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < NODES; i++)
        hash = add_pose(hash, cairn_pose_graph_pose(graph, i));
    return add_real(hash, cairn_pose_graph_read(graph).chi2);
}

/* The same graph, without its wrong link. */
uint64_t golden_robust_pose_graphs(void)
{
    cairn_pose_graph_robust_params robust_params = cairn_pose_graph_robust_default();
    cairn_pose_graph_params params = cairn_pose_graph_default();
    cairn_budget budget = {INT32_MAX};
    cairn_pose_graph_robust_result result;
    cairn_pose_graph_robust *robust;
    cairn_pose_graph *graph;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    params.max_poses = robust_params.max_poses = NODES;
    params.max_links = 3 * NODES;
    params.max_fill = 12 * NODES;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_pose_graph_create(&graph, &pool, &params, NULL) != CAIRN_OK ||
        cairn_pose_graph_robust_create(&robust, &pool, &robust_params) != CAIRN_OK ||
        !fill_graph(graph) || cairn_pose_graph_robust_begin(robust, graph) != CAIRN_OK ||
        cairn_pose_graph_robust_step(robust, &budget) != CAIRN_OK)
        return 0;
    result = cairn_pose_graph_robust_read(robust);
    for (int32_t i = 0; i < NODES; i++)
        hash = add_pose(hash, cairn_pose_graph_pose(graph, i));
    return result.outliers > 0 ? add_real(hash, cairn_pose_graph_read(graph).chi2) : 0;
}

uint64_t golden_consensus(void)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    cairn_random random = cairn_random_seed(9, 1);
    cairn_budget budget = {INT32_MAX};
    cairn_pose_consensus *c;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    params.max_nodes = NODES;
    params.max_hypotheses = 8 * NODES;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_pose_consensus_create(&c, &pool, &params) != CAIRN_OK ||
        cairn_pose_consensus_clear(c, NODES) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < NODES; i++)
        for (int32_t k = 1; k <= 4; k++) {
            int32_t j = (i + k) % NODES;
            cairn_pose_consensus_relative_pose h = {
                .first = i, .second = j, .score = 5 + (cairn_real)((i * 7 + k) % 5)};

            h.first_second = measured(&random, i, (i + k) % 5 == 0 ? (j + 4) % NODES : j);
            h.covariance[0] = h.covariance[4] = CAIRN_REAL(0.0004);
            h.covariance[8] = CAIRN_REAL(0.0001);
            if (cairn_pose_consensus_add(c, &h, NULL) != CAIRN_OK)
                return 0;
        }
    if (cairn_pose_consensus_begin(c) != CAIRN_OK ||
        cairn_pose_consensus_step(c, &budget) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < NODES; i++) {
        cairn_pose_consensus_estimate node = cairn_pose_consensus_node(c, i);

        hash =
            add_real(add_covariance(add_pose(hash, node.map_node), node.covariance), node.support);
    }
    return hash;
}
