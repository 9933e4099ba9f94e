/* Consensus of relative poses: true and false hypotheses, ambiguity, likelihoods, submaps,
 * stored results. */
#include "tests/poses.h"

#include <math.h>

#include "cairn/pose_consensus.h"

enum { MAX_NODES = 40, MAX_HYPOTHESES = 1000 };

static const cairn_real DEGREE = CAIRN_PI / 180;

static cairn_pose_consensus *new_consensus(cairn_pool *pool,
                                           const cairn_pose_consensus_params *params)
{
    cairn_pose_consensus *consensus;

    *pool = test_pool(cairn_pose_consensus_memory(params));
    assert_ok(cairn_pose_consensus_create(&consensus, pool, params));
    return consensus;
}

/* first_second, with standard deviations `sigma` m and `sigma_angle` rad. */
static cairn_pose_consensus_relative_pose hypothesis_of(int32_t first, int32_t second,
                                                        cairn_pose first_second, cairn_real sigma,
                                                        cairn_real sigma_angle, cairn_real score)
{
    cairn_pose_consensus_relative_pose h = {
        first,
        second,
        first_second,
        {sigma * sigma, 0, 0, 0, sigma * sigma, 0, 0, 0, sigma_angle * sigma_angle},
        score};
    return h;
}

static void add(cairn_pose_consensus *consensus, int32_t first, int32_t second,
                cairn_pose first_second, cairn_real score)
{
    cairn_pose_consensus_relative_pose h = hypothesis_of(
        first, second, first_second, CAIRN_REAL(0.01), CAIRN_REAL(0.3) * DEGREE, score);

    assert_ok(cairn_pose_consensus_add(consensus, &h, NULL));
}

static cairn_pose_consensus_result solve(cairn_pose_consensus *consensus)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_pose_consensus_begin(consensus));
    assert_int_equal(cairn_pose_consensus_read(consensus).nodes, 0);
    assert_ok(cairn_pose_consensus_step(consensus, &budget));
    return cairn_pose_consensus_read(consensus);
}

/* A world of nodes with true hypotheses, each with noise of 1 cm and 0.3 degrees, and false
 * ones. */
struct world {
    cairn_pose truth[MAX_NODES];
    int32_t nodes;
    cairn_pose_consensus_relative_pose hypotheses[MAX_HYPOTHESES];
    int32_t is_true[MAX_HYPOTHESES];
    int32_t count;
};

static void add_to_world(struct world *world, int32_t first, int32_t second,
                         cairn_pose first_second, cairn_real score, int32_t is_true)
{
    assert_true(world->count < MAX_HYPOTHESES);
    world->hypotheses[world->count] = hypothesis_of(first, second, first_second, CAIRN_REAL(0.01),
                                                    CAIRN_REAL(0.3) * DEGREE, score);
    world->is_true[world->count++] = is_true;
}

static cairn_pose noisy(cairn_pose pose, cairn_random *random)
{
    pose.x += CAIRN_REAL(0.01) * cairn_random_normal(random);
    pose.y += CAIRN_REAL(0.01) * cairn_random_normal(random);
    pose.theta += CAIRN_REAL(0.3) * DEGREE * cairn_random_normal(random);
    return pose;
}

/* Of each pair nearer than `reach` a share `known` has its true hypothesis, of score 10 ... 20;
 * `lies` false ones of score 10 ... 25 follow, at random pairs. */
static void make_world(struct world *world, uint64_t seed, int32_t nodes, cairn_real reach,
                       cairn_real known, int32_t lies)
{
    cairn_random random = cairn_random_seed(seed, 1);

    world->nodes = nodes;
    world->count = 0;
    for (int32_t i = 0; i < nodes; i++)
        world->truth[i] = random_pose(&random, 5, CAIRN_PI);
    for (int32_t i = 0; i < nodes; i++)
        for (int32_t j = i + 1; j < nodes; j++) {
            cairn_pose between = cairn_pose_between(world->truth[i], world->truth[j]);
            cairn_real score = cairn_random_uniform(&random, 10, 20);

            between = noisy(between, &random);
            if (between.x * between.x + between.y * between.y <= reach * reach &&
                cairn_random_unit(&random) < known) {
                if (cairn_random_below(&random, 2) == 0)
                    add_to_world(world, i, j, between, score, 1);
                else
                    add_to_world(world, j, i, cairn_pose_inverse(between), score, 1);
            }
        }
    for (int32_t k = 0; k < lies; k++) {
        int32_t i = cairn_random_below(&random, nodes), j = cairn_random_below(&random, nodes - 1);
        cairn_pose pose = random_pose(&random, 5, CAIRN_PI);
        cairn_real score = cairn_random_uniform(&random, 10, 25);

        add_to_world(world, i, j < i ? j : j + 1, pose, score, 0);
    }
}

static void load(cairn_pose_consensus *consensus, const struct world *world)
{
    assert_ok(cairn_pose_consensus_clear(consensus, world->nodes));
    for (int32_t k = 0; k < world->count; k++)
        assert_ok(cairn_pose_consensus_add(consensus, &world->hypotheses[k], NULL));
}

/* Nodes of part 0 whose poses relative to its first node are right. */
static int32_t count_right(const cairn_pose_consensus *consensus, const struct world *world,
                           double metres, double radians)
{
    int32_t right = 0, first = -1;

    for (int32_t i = 0; i < world->nodes; i++) {
        cairn_pose_consensus_estimate node = cairn_pose_consensus_node(consensus, i);
        cairn_pose seen;

        if (node.component != 0)
            continue;
        if (first < 0)
            first = i;
        seen = cairn_pose_between(world->truth[first], world->truth[i]);
        right += hypot((double)(node.map_node.x - seen.x), (double)(node.map_node.y - seen.y)) <
                     metres &&
                 fabs((double)cairn_wrap_angle(node.map_node.theta - seen.theta)) < radians;
    }
    return right;
}

/* ---- What it finds ---- */

static void two_nodes(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    cairn_pose_consensus_relative_pose h = {1, 0, {1, 2, CAIRN_REAL(0.5)}, {0}, 12};
    cairn_pool pool;
    cairn_pose_consensus *consensus = new_consensus(&pool, &params);
    cairn_pose_consensus_result result;
    cairn_pose_consensus_estimate node;
    double shift, turn = (double)(params.sigma_theta * params.sigma_theta), x, y;

    (void)state;
    h.covariance[0] = CAIRN_REAL(0.04);
    h.covariance[1] = h.covariance[3] = CAIRN_REAL(0.01);
    h.covariance[4] = CAIRN_REAL(0.02);
    h.covariance[8] = CAIRN_REAL(0.001);
    h.covariance[2] = h.covariance[6] = CAIRN_REAL(0.002);
    assert_ok(cairn_pose_consensus_clear(consensus, 2));
    assert_ok(cairn_pose_consensus_add(consensus, &h, NULL));
    result = solve(consensus);
    assert_int_equal(result.nodes, 2);
    assert_int_equal(result.placed, 2);
    assert_int_equal(result.components, 1);
    assert_int_equal(result.ambiguous, 0);
    assert_int_equal(result.inliers, 1);
    assert_int_equal(result.starts, 1);
    assert_near(result.total, 12, 1e-5);
    assert_near(result.competing_total, 0, 0);
    assert_true(result.units > 0);
    assert_int_equal(cairn_pose_consensus_is_inlier(consensus, 0), 1);
    assert_int_equal(cairn_pose_consensus_is_inlier(consensus, 1), 0);
    assert_int_equal(cairn_pose_consensus_is_inlier(consensus, -1), 0);
    node = cairn_pose_consensus_node(consensus, 0);
    assert_pose_near(node.map_node, cairn_pose_identity(), 1e-6, 1e-6);
    node = cairn_pose_consensus_node(consensus, 1);
    assert_pose_near(node.map_node, cairn_pose_inverse(h.first_second), 1e-5, 1e-6);
    assert_near(node.support, 12, 1e-4);
    assert_int_equal(node.agreeing, 1);
    assert_int_equal(node.conflicting, 0);
    assert_int_equal(node.alternatives, 0);

    /* Of node 0 given 1 in the frame of 1 it would be the covariance with the sigmas added; here
     * the frame is that of 0. */
    node = cairn_pose_consensus_node(consensus, 0);
    shift = (double)(params.sigma * params.sigma) + 5 * turn;
    x = cos(-0.5);
    y = sin(-0.5);
    assert_near(node.covariance[0],
                x * x * (0.04 + shift) - 2 * x * y * 0.01 + y * y * (0.02 + shift), 1e-6);
    assert_near(node.covariance[4],
                y * y * (0.04 + shift) + 2 * x * y * 0.01 + x * x * (0.02 + shift), 1e-6);
    assert_near(node.covariance[1], x * y * (0.04 - 0.02) + (x * x - y * y) * 0.01, 1e-6);
    assert_near(node.covariance[2], x * 0.002, 1e-6);
    assert_near(node.covariance[5], y * 0.002, 1e-6);
    assert_near(node.covariance[8], 0.001 + turn, 1e-6);
    for (int k = 0; k < 9; k++)
        assert_near(node.covariance[k], node.covariance[k % 3 * 3 + k / 3], 1e-9);
    test_pool_free(&pool);
}

static void most_hypotheses_are_wrong(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    static struct world world;
    cairn_pool pool;
    cairn_pose_consensus *consensus = new_consensus(&pool, &params);

    (void)state;
    for (uint64_t seed = 1; seed <= 8; seed++) {
        cairn_pose_consensus_result result;

        make_world(&world, seed, 16, 7, CAIRN_REAL(0.8), 600);
        load(consensus, &world);
        result = solve(consensus);
        assert_int_equal(result.placed, 16);
        assert_int_equal(result.components, 1);
        assert_int_equal(count_right(consensus, &world, 0.08, 0.015), 16);
        for (int32_t k = 0; k < world.count; k++)
            if (world.is_true[k])
                assert_int_equal(cairn_pose_consensus_is_inlier(consensus, k), 1);
    }
    test_pool_free(&pool);
}

/* The errors of nodes are those of a least-squares solution: below those of single hypotheses. */
static void relaxation_averages(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    static struct world world;
    cairn_pool pool;
    cairn_pose_consensus *consensus = new_consensus(&pool, &params);
    double squares = 0;
    int32_t count = 0;

    (void)state;
    for (uint64_t seed = 20; seed < 28; seed++) {
        make_world(&world, seed, 16, 20, 1, 0);
        load(consensus, &world);
        assert_int_equal(solve(consensus).placed, 16);
        for (int32_t i = 1; i < 16; i++) {
            cairn_pose pose = cairn_pose_consensus_node(consensus, i).map_node;
            cairn_pose seen = cairn_pose_between(world.truth[0], world.truth[i]);

            squares += pow(remainder((double)(pose.theta - seen.theta), 6.283185307179586), 2);
            count++;
        }
    }
    /* Of the difference of two of 16 nodes with all 120 pairs: sigma * sqrt(2 / 16). */
    assert_true(sqrt(squares / count) < 0.3 * (double)DEGREE * sqrt(2.0 / 16) * 1.3);
    test_pool_free(&pool);
}

/* One false hypothesis outweighs every true one, but three true ones outweigh it. */
static void many_weak_ones_outweigh_a_strong_one(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    const cairn_pose truth[4] = {{0, 0, 0}, {3, 0, 1}, {3, 3, 2}, {0, 3, 3}};
    cairn_pose wrong = {1, -2, CAIRN_REAL(0.5)};
    cairn_pool pool;
    cairn_pose_consensus *consensus = new_consensus(&pool, &params);
    cairn_pose_consensus_estimate node;
    cairn_pose_consensus_competing_pose other;

    (void)state;
    assert_ok(cairn_pose_consensus_clear(consensus, 4));
    for (int32_t i = 0; i < 4; i++)
        for (int32_t j = i + 1; j < 4; j++)
            add(consensus, i, j, cairn_pose_between(truth[i], truth[j]), 5);
    add(consensus, 0, 3, wrong, 13);
    assert_int_equal(solve(consensus).placed, 4);
    for (int32_t i = 0; i < 4; i++)
        assert_pose_near(cairn_pose_consensus_node(consensus, i).map_node, truth[i], 1e-3, 1e-3);
    assert_int_equal(cairn_pose_consensus_is_inlier(consensus, 2), 1);
    assert_int_equal(cairn_pose_consensus_is_inlier(consensus, 6), 0);

    /* The alternative of node 3: given the others, exp(13 - 15) as likely. */
    node = cairn_pose_consensus_node(consensus, 3);
    assert_near(node.support, 15, 1e-3);
    assert_true(node.alternatives >= 1);
    other = cairn_pose_consensus_alternative(consensus, 3, 0);
    assert_near(other.support, 13, 0.01);
    assert_int_equal(other.is_other_map, 0);
    assert_near(other.weight, exp(-2) / (1 + exp(-2)), 0.01);
    assert_pose_near(other.map_node, wrong, 1e-3, 1e-3);
    assert_int_equal(node.ambiguous, 1);
    assert_near(cairn_pose_consensus_alternative(consensus, 3, node.alternatives).weight, 0, 0);
    assert_near(cairn_pose_consensus_alternative(consensus, 3, -1).weight, 0, 0);
    assert_near(cairn_pose_consensus_alternative(consensus, 4, 0).weight, 0, 0);
    test_pool_free(&pool);
}

/* ---- Reference implementation: every spanning tree of five nodes ---- */

struct reference {
    const struct world *world;
    const cairn_pose_consensus_params *params;
    cairn_pose pose[MAX_NODES];
    int32_t placed[MAX_NODES];
    double best;
};

static double plain_chi(const struct reference *reference,
                        const cairn_pose_consensus_relative_pose *h, cairn_pose first,
                        cairn_pose second)
{
    cairn_pose seen = cairn_pose_between(first, second);
    double x = (double)(seen.x - h->first_second.x), y = (double)(seen.y - h->first_second.y);
    double theta = remainder((double)(seen.theta - h->first_second.theta), 6.283185307179586);
    double turn = (double)(reference->params->sigma_theta * reference->params->sigma_theta);
    double shift = (double)(reference->params->sigma * reference->params->sigma) +
                   turn * (pow((double)h->first_second.x, 2) + pow((double)h->first_second.y, 2));

    return (x * x + y * y) / ((double)h->covariance[0] + shift) +
           theta * theta / ((double)h->covariance[8] + turn);
}

static double plain_total(const struct reference *reference)
{
    double best[MAX_NODES][MAX_NODES] = {{0}}, total = 0;

    for (int32_t k = 0; k < reference->world->count; k++) {
        const cairn_pose_consensus_relative_pose *h = &reference->world->hypotheses[k];
        double share =
            1 - plain_chi(reference, h, reference->pose[h->first], reference->pose[h->second]) /
                    (double)reference->params->max_chi2;
        int32_t i = h->first < h->second ? h->first : h->second, j = h->first + h->second - i;

        best[i][j] = fmax(best[i][j], share * (double)h->score);
    }
    for (int32_t i = 0; i < reference->world->nodes; i++)
        for (int32_t j = 0; j < reference->world->nodes; j++)
            total += best[i][j];
    return total;
}

static void attach_rest(struct reference *reference)
{
    int32_t rest = 0;

    for (int32_t n = 0; n < reference->world->nodes; n++)
        rest += !reference->placed[n];
    if (rest == 0) {
        reference->best = fmax(reference->best, plain_total(reference));
        return;
    }
    for (int32_t k = 0; k < reference->world->count; k++) {
        const cairn_pose_consensus_relative_pose *h = &reference->world->hypotheses[k];
        int32_t node = reference->placed[h->first] ? h->second : h->first;

        if (reference->placed[h->first] == reference->placed[h->second])
            continue;
        reference->pose[node] = node == h->second
                                    ? cairn_pose_compose(reference->pose[h->first], h->first_second)
                                    : cairn_pose_compose(reference->pose[h->second],
                                                         cairn_pose_inverse(h->first_second));
        reference->placed[node] = 1;
        attach_rest(reference);
        reference->placed[node] = 0;
    }
}

static void nothing_better_is_found_by_trying_all(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    static struct world world;
    static struct reference reference;
    cairn_pool pool;
    cairn_pose_consensus *consensus = new_consensus(&pool, &params);

    (void)state;
    for (uint64_t seed = 40; seed < 60; seed++) {
        cairn_pose_consensus_result result;

        make_world(&world, seed, 5, 20, CAIRN_REAL(0.8), 6);
        load(consensus, &world);
        result = solve(consensus);
        memset(&reference, 0, sizeof reference);
        reference.world = &world;
        reference.params = &params;
        reference.placed[0] = 1;
        attach_rest(&reference);
        assert_true(reference.best > 0);
        assert_true((double)result.total > 0.98 * reference.best);
        if (result.placed == 5 && result.components == 1) {
            for (int32_t i = 0; i < 5; i++)
                reference.pose[i] = cairn_pose_consensus_node(consensus, i).map_node;
            assert_near(plain_total(&reference), result.total, 2e-3 * (double)result.total);
        }
    }
    test_pool_free(&pool);
}

/* ---- Parts ---- */

/* Two triangles without a hypothesis between them, and an isolated node. */
static void load_triangles(cairn_pose_consensus *consensus, const cairn_pose truth[7])
{
    assert_ok(cairn_pose_consensus_clear(consensus, 8));
    for (int32_t i = 0; i < 7; i++)
        for (int32_t j = i + 1; j < 7; j++)
            if ((i < 3) == (j < 3))
                add(consensus, i, j, cairn_pose_between(truth[i], truth[j]), 5);
}

static const cairn_pose TRIANGLES[7] = {{0, 0, 0},  {2, 0, 1},  {1, 2, 2}, {6, 0, 3},
                                        {8, 0, -2}, {7, 2, -1}, {7, 1, 0}};

static void disconnected_nodes_are_components(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    cairn_pool pool;
    cairn_pose_consensus *consensus = new_consensus(&pool, &params);
    cairn_pose_consensus_result result;

    (void)state;
    load_triangles(consensus, TRIANGLES);
    result = solve(consensus);
    assert_int_equal(result.components, 3);
    assert_int_equal(result.placed, 7);
    assert_int_equal(result.nodes, 8);
    for (int32_t i = 0; i < 7; i++) {
        cairn_pose_consensus_estimate node = cairn_pose_consensus_node(consensus, i);
        int32_t first = i < 3 ? 0 : 3;

        /* the larger part is part 0 */
        assert_int_equal(node.component, i < 3 ? 1 : 0);
        assert_int_equal(node.agreeing, i < 3 ? 2 : 3);
        assert_pose_near(node.map_node, cairn_pose_between(TRIANGLES[first], TRIANGLES[i]), 1e-3,
                         1e-3);
    }
    assert_int_equal(cairn_pose_consensus_node(consensus, 7).component, 2);
    assert_pose_near(cairn_pose_consensus_node(consensus, 7).map_node, cairn_pose_identity(), 0, 0);
    assert_near(cairn_pose_consensus_node(consensus, 7).support, 0, 0);
    test_pool_free(&pool);
}

/* Each link between the triangles is too weak to place a node, but two that agree join them. */
static void parts_are_joined_as_wholes(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    cairn_pool pool;
    cairn_pose_consensus *consensus = new_consensus(&pool, &params);
    cairn_pose wrong = {-3, 1, 1};

    (void)state;
    load_triangles(consensus, TRIANGLES);
    add(consensus, 0, 3, cairn_pose_between(TRIANGLES[0], TRIANGLES[3]), 2);
    add(consensus, 1, 4, wrong, CAIRN_REAL(2.5));
    assert_int_equal(solve(consensus).components, 3);
    add(consensus, 4, 1, cairn_pose_between(TRIANGLES[4], TRIANGLES[1]), 2);
    assert_int_equal(solve(consensus).components, 2);
    for (int32_t i = 0; i < 7; i++)
        assert_pose_near(cairn_pose_consensus_node(consensus, i).map_node, TRIANGLES[i], 2e-3,
                         1e-3);
    assert_int_equal(cairn_pose_consensus_node(consensus, 7).component, 1);
    test_pool_free(&pool);
}

static void nothing_is_placed_on_weak_evidence(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    cairn_pool pool;
    cairn_pose_consensus *consensus = new_consensus(&pool, &params);
    cairn_pose_consensus_result result;
    cairn_pose pose = {1, 0, 0};

    (void)state;
    assert_ok(cairn_pose_consensus_clear(consensus, 3));
    result = solve(consensus);
    assert_int_equal(result.components, 3);
    assert_int_equal(result.placed, 0);
    add(consensus, 0, 1, pose, CAIRN_REAL(2.9));
    result = solve(consensus);
    assert_int_equal(result.components, 3);
    assert_int_equal(result.starts, 0);
    add(consensus, 0, 1, pose, CAIRN_REAL(3.1));
    assert_int_equal(solve(consensus).components, 2);
    test_pool_free(&pool);
}

/* ---- Ambiguity ---- */

/* A pair of nodes connected by one ambiguous link: node by node nothing moves, but both could lie
 * elsewhere. */
static void another_map_is_an_alternative(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    const cairn_pose truth[5] = {{0, 0, 0}, {2, 0, 1}, {1, 2, 2}, {6, 0, 3}, {8, 0, -2}};
    const cairn_pose elsewhere = {-4, 0, 1};
    cairn_pool pool;
    cairn_pose_consensus *consensus = new_consensus(&pool, &params);
    cairn_pose_consensus_result result;
    int32_t whole = 0;

    (void)state;
    assert_ok(cairn_pose_consensus_clear(consensus, 5));
    for (int32_t i = 0; i < 3; i++)
        for (int32_t j = i + 1; j < 3; j++)
            add(consensus, i, j, cairn_pose_between(truth[i], truth[j]), 10);
    add(consensus, 3, 4, cairn_pose_between(truth[3], truth[4]), 30);
    add(consensus, 0, 3, cairn_pose_between(truth[0], truth[3]), 8);
    add(consensus, 0, 4, elsewhere, CAIRN_REAL(7.5));
    result = solve(consensus);
    assert_int_equal(result.components, 1);
    assert_near(result.total, 68, 0.1);
    assert_near(result.competing_total, 67.5, 0.1);
    for (int32_t i = 0; i < 5; i++) {
        cairn_pose_consensus_estimate node = cairn_pose_consensus_node(consensus, i);

        assert_pose_near(node.map_node, truth[i], 1e-3, 1e-3);
        for (int32_t k = 0; k < node.alternatives; k++) {
            cairn_pose_consensus_competing_pose other =
                cairn_pose_consensus_alternative(consensus, i, k);

            if (!other.is_other_map)
                continue;
            whole++;
            assert_true(i >= 3);
            assert_near(other.support, 67.5, 0.1);
            assert_near(other.weight, exp(-0.5) / (1 + exp(-0.5)), 0.02);
            if (i == 4)
                assert_pose_near(other.map_node, elsewhere, 1e-3, 1e-3);
        }
        assert_int_equal(node.ambiguous, i >= 3);
    }
    assert_int_equal(whole, 2);
    assert_int_equal(result.ambiguous, 2);
    test_pool_free(&pool);
}

/* ---- Blocks ---- */

/* Two nodes confirm each other and are connected by one strong false hypothesis. Two weak true ones
 * outweigh it, but neither node can move alone. */
static void load_pair_at_false_place(cairn_pose_consensus *consensus, const cairn_pose truth[5])
{
    const cairn_pose false_place = {-4, 0, 1};

    assert_ok(cairn_pose_consensus_clear(consensus, 5));
    for (int32_t i = 0; i < 3; i++)
        for (int32_t j = i + 1; j < 3; j++)
            add(consensus, i, j, cairn_pose_between(truth[i], truth[j]), 20);
    add(consensus, 3, 4, cairn_pose_between(truth[3], truth[4]), 30);
    add(consensus, 0, 3, false_place, 9);
    add(consensus, 1, 4, cairn_pose_between(truth[1], truth[4]), 5);
    add(consensus, 2, 3, cairn_pose_between(truth[2], truth[3]), 6);
}

static void blocks_are_allocated_anew(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    const cairn_pose truth[5] = {{0, 0, 0}, {2, 0, 1}, {1, 2, 2}, {6, 0, 3}, {8, 0, -2}};
    cairn_pool pool;
    cairn_pose_consensus *consensus;
    cairn_pose_consensus_result result;

    (void)state;
    params.max_starts = 1;
    params.max_rounds = 0;
    consensus = new_consensus(&pool, &params);
    load_pair_at_false_place(consensus, truth);
    result = solve(consensus);
    assert_near(result.total, 60 + 30 + 9, 0.1);
    assert_near(result.competing_total, 0, 0);
    test_pool_free(&pool);

    params.max_rounds = 4;
    consensus = new_consensus(&pool, &params);
    load_pair_at_false_place(consensus, truth);
    result = solve(consensus);
    assert_near(result.total, 60 + 30 + 11, 0.1);
    assert_near(result.competing_total, 60 + 30 + 9, 0.1);
    assert_int_equal(result.components, 1);
    assert_int_equal(result.starts, 1);
    for (int32_t i = 0; i < 5; i++)
        assert_pose_near(cairn_pose_consensus_node(consensus, i).map_node, truth[i], 1e-3, 1e-3);
    test_pool_free(&pool);
}

/* A node whose every single vote supports a false place more than the true one: the sum of
 * pairwise likelihoods decides. */
struct pair_truth {
    cairn_pose truth[4];
    cairn_real right;
};

static int likelihood_of_truth(void *context, int32_t first, int32_t second,
                               cairn_pose first_second, cairn_pose_likelihood *likelihood,
                               cairn_budget *budget)
{
    struct pair_truth *known = context;
    cairn_pose seen = cairn_pose_between(known->truth[first], known->truth[second]);

    if (!cairn_budget_charge(budget, &likelihood->units_charged, 3))
        return 0;
    if (hypot((double)(seen.x - first_second.x), (double)(seen.y - first_second.y)) < 0.1)
        likelihood->ratio = known->right;
    return 1;
}

static void the_likelihood_may_exceed_a_hypothesis(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    struct pair_truth known = {{{0, 0, 0}, {3, 0, 1}, {3, 3, 2}, {0, 3, 3}}, 4};
    cairn_pool pool;
    cairn_pose_consensus *consensus = NULL;

    (void)state;
    params.max_candidates = 1; /* one false hypothesis fills the list of the best voted */
    consensus = new_consensus(&pool, &params);
    assert_ok(cairn_pose_consensus_clear(consensus, 4));
    for (int32_t i = 0; i < 3; i++)
        for (int32_t j = i + 1; j < 3; j++)
            add(consensus, i, j, cairn_pose_between(known.truth[i], known.truth[j]), 10);
    add(consensus, 0, 3, (cairn_pose){9, 9, 0}, 7);
    add(consensus, 1, 3, cairn_pose_between(known.truth[1], known.truth[3]), 1);
    cairn_pose_consensus_set_pair_likelihood(consensus, likelihood_of_truth, &known);
    assert_near(solve(consensus).total, 30 + 3 * 4, 0.1);
    assert_pose_near(cairn_pose_consensus_node(consensus, 3).map_node, known.truth[3], 1e-2, 1e-2);
    assert_near(cairn_pose_consensus_node(consensus, 3).support, 3 * 4, 0.1);
    test_pool_free(&pool);
}

/* ---- Bounds ---- */

/* Four nodes; the strongest hypotheses of node 3 are false. */
static void load_false_majority(cairn_pose_consensus *consensus, const cairn_pose truth[4])
{
    cairn_pose wrong = truth[3];

    wrong.x += 1;
    assert_ok(cairn_pose_consensus_clear(consensus, 4));
    for (int32_t i = 0; i < 4; i++)
        for (int32_t j = i + 1; j < 4; j++) {
            add(consensus, i, j, cairn_pose_between(truth[i], truth[j]), 5);
            if (j == 3)
                add(consensus, i, j, cairn_pose_between(truth[i], wrong), 6);
        }
}

static void bounds_forbid(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    const cairn_pose truth[4] = {{0, 0, 0}, {3, 0, 1}, {3, 3, 2}, {0, 3, 3}};
    const cairn_pose frame = {20, -10, CAIRN_REAL(2.5)};
    cairn_random random = cairn_random_seed(3, 1);
    cairn_pool pool;
    cairn_pose_consensus *consensus = new_consensus(&pool, &params);
    cairn_pose first;

    (void)state;
    load_false_majority(consensus, truth);
    assert_int_equal(solve(consensus).components, 1);
    assert_near(cairn_pose_consensus_node(consensus, 3).map_node.x, 1, 0.01);
    for (int32_t i = 0; i < 4; i++) {
        cairn_pose off = random_pose(&random, CAIRN_REAL(0.15), 6 * DEGREE);
        cairn_pose centre = cairn_pose_compose(frame, truth[i]);

        centre.x += off.x;
        centre.y += off.y;
        centre.theta += off.theta;
        assert_ok(
            cairn_pose_consensus_set_bound(consensus, i, centre, CAIRN_REAL(0.3), 10 * DEGREE));
    }
    assert_int_equal(solve(consensus).components, 1);
    first = cairn_pose_consensus_node(consensus, 0).map_node;
    for (int32_t i = 0; i < 4; i++) {
        cairn_pose pose = cairn_pose_consensus_node(consensus, i).map_node;

        assert_pose_near(cairn_pose_between(first, pose), cairn_pose_between(truth[0], truth[i]),
                         1e-3, 1e-3);
        assert_pose_near(pose, cairn_pose_compose(frame, truth[i]), 0.25, 0.1);
    }

    /* A node whose hypotheses are all beyond its bound has none left. */
    assert_ok(cairn_pose_consensus_set_bound(consensus, 2, frame, CAIRN_REAL(0.1), 10 * DEGREE));
    assert_int_equal(solve(consensus).components, 2);
    assert_int_equal(cairn_pose_consensus_node(consensus, 2).component, 1);
    assert_pose_near(cairn_pose_consensus_node(consensus, 2).map_node, frame, 0, 0);
    test_pool_free(&pool);
}

/* ---- Pairwise and joint likelihoods ---- */

/* Units of one evaluation. */
enum { LIKELIHOOD_UNITS = 7 };

struct counted_likelihood {
    cairn_pose truth[4];
    int32_t calls;
    cairn_real wrong; /* log-likelihood ratio of a pose that is not the truth */
};

/* True hypotheses between four nodes, except of the last one, which has a false one with higher
 * evidence than the true one. */
static void add_competing_hypotheses(cairn_pose_consensus *consensus, const cairn_pose truth[4])
{
    cairn_pose wrong = {1, 3, 3};

    assert_ok(cairn_pose_consensus_clear(consensus, 4));
    for (int32_t i = 0; i < 3; i++)
        for (int32_t j = i + 1; j < 3; j++)
            add(consensus, i, j, cairn_pose_between(truth[i], truth[j]), 10);
    add(consensus, 0, 3, cairn_pose_between(truth[0], truth[3]), 5);
    add(consensus, 0, 3, cairn_pose_between(truth[0], wrong), 6);
}

static int pairwise_likelihood(void *context, int32_t first, int32_t second,
                               cairn_pose first_second, cairn_pose_likelihood *found,
                               cairn_budget *budget)
{
    struct counted_likelihood *likelihood = context;
    cairn_pose seen = cairn_pose_between(likelihood->truth[first], likelihood->truth[second]);

    assert_true(first < second);
    assert_near(found->ratio, 0, 0);
    assert_int_equal(found->resume, 0);
    if (!cairn_budget_charge(budget, &found->units_charged, LIKELIHOOD_UNITS))
        return 0;
    likelihood->calls++;
    found->ratio = hypot((double)(seen.x - first_second.x), (double)(seen.y - first_second.y)) < 0.1
                       ? 1
                       : likelihood->wrong;
    return 1;
}

static void a_pairwise_likelihood_decides(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    struct counted_likelihood likelihood = {{{0, 0, 0}, {3, 0, 1}, {3, 3, 2}, {0, 3, 3}}, 0, -2};
    cairn_pool pool;
    cairn_pose_consensus *consensus = new_consensus(&pool, &params);
    cairn_pose_consensus_estimate node;
    int64_t units;

    (void)state;
    add_competing_hypotheses(consensus, likelihood.truth);
    units = solve(consensus).units;
    node = cairn_pose_consensus_node(consensus, 3);
    assert_near(node.map_node.x, 1, 0.01);
    assert_near(node.support, 6, 0.01);
    cairn_pose_consensus_set_pair_likelihood(consensus, pairwise_likelihood, &likelihood);
    assert_true(solve(consensus).units > units);
    node = cairn_pose_consensus_node(consensus, 3);
    assert_pose_near(node.map_node, likelihood.truth[3], 0.01, 0.01);
    assert_near(node.support, 7, 0.02); /* two more pairs, which have no hypothesis */
    assert_int_equal(node.agreeing, 3);
    assert_true(likelihood.calls > 0);
    assert_near(cairn_pose_consensus_alternative(consensus, 3, 0).support, 2, 0.02);

    /* A NaN counts nothing. */
    likelihood.wrong = (cairn_real)NAN;
    assert_int_equal(solve(consensus).components, 1);
    assert_near(cairn_pose_consensus_alternative(consensus, 3, 0).support, 6, 0.02);
    cairn_pose_consensus_set_pair_likelihood(consensus, NULL, NULL);
    (void)solve(consensus);
    assert_near(cairn_pose_consensus_node(consensus, 3).map_node.x, 1, 0.01);
    test_pool_free(&pool);
}

/* The joint likelihood of a node: the sum of the pairwise ones, less one nat for every other node
 * of the part. */
static int joint_likelihood(void *context, int32_t node, cairn_pose map_node,
                            const cairn_pose *map_nodes, const int32_t *parts, int32_t part,
                            cairn_pose_likelihood *found, cairn_budget *budget)
{
    struct counted_likelihood *likelihood = context;
    cairn_real sum = 0;

    assert_true(part >= 0);
    if (!cairn_budget_charge(budget, &found->units_charged, LIKELIHOOD_UNITS))
        return 0;
    for (int32_t i = 0; i < 4; i++) {
        cairn_pose off = cairn_pose_between(map_nodes[i], map_node), seen;

        if (i == node || parts[i] != part)
            continue;
        seen = cairn_pose_between(likelihood->truth[i], likelihood->truth[node]);
        sum +=
            (hypot((double)(seen.x - off.x), (double)(seen.y - off.y)) < 0.1 ? 4
                                                                             : likelihood->wrong) -
            1;
    }
    likelihood->calls++;
    found->ratio = sum;
    return 1;
}

static void the_joint_likelihood_decides(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    struct counted_likelihood likelihood = {{{0, 0, 0}, {3, 0, 1}, {3, 3, 2}, {0, 3, 3}}, 0, -2};
    cairn_pool pool;
    cairn_pose_consensus *consensus = new_consensus(&pool, &params);
    cairn_pose_consensus_estimate node;
    int64_t units;

    (void)state;
    add_competing_hypotheses(consensus, likelihood.truth);
    units = solve(consensus).units;
    cairn_pose_consensus_set_joint_likelihood(consensus, joint_likelihood, &likelihood);
    assert_near(cairn_pose_consensus_read(consensus).total, 0, 0);
    assert_true(solve(consensus).units > units);
    assert_true(likelihood.calls > 0);
    assert_near(cairn_pose_consensus_read(consensus).total, 18,
                1e-3); /* four nodes of nine, by pairs, in place of the pairwise sum */
    node = cairn_pose_consensus_node(consensus, 3);
    assert_pose_near(node.map_node, likelihood.truth[3], 0.01, 0.01);
    assert_near(node.support, 3 * 3, 1e-3);
    assert_int_equal(node.agreeing, 1);
    assert_int_equal(node.alternatives, 0);

    /* A NaN counts nothing: no node has support. */
    likelihood.wrong = (cairn_real)NAN;
    likelihood.truth[3].x = 7;
    assert_int_equal(solve(consensus).components, 2);
    cairn_pose_consensus_set_joint_likelihood(consensus, NULL, NULL);
    (void)solve(consensus);
    assert_near(cairn_pose_consensus_node(consensus, 3).map_node.x, 1, 0.01);
    cairn_pose_consensus_set_joint_likelihood(consensus, joint_likelihood, &likelihood);
    assert_ok(cairn_pose_consensus_clear(consensus, 1)); /* drops the likelihood */
    likelihood.calls = 0;
    (void)solve(consensus);
    assert_int_equal(likelihood.calls, 0);
    test_pool_free(&pool);
}

/* Steps of one unit: before each evaluation its units were charged. The result is that of a step
 * without bound. */
static void evaluations_are_charged_before(cairn_pose_consensus *consensus,
                                           const struct counted_likelihood *likelihood)
{
    cairn_real total = solve(consensus).total;
    int32_t calls = likelihood->calls, first = calls, charged = 0;
    int64_t units = 0;
    cairn_status status = CAIRN_MORE;

    assert_ok(cairn_pose_consensus_begin(consensus));
    while (status == CAIRN_MORE) {
        cairn_budget budget = {1};

        status = cairn_pose_consensus_step(consensus, &budget);
        assert_true(budget.left >= 0);
        units += 1 - budget.left;
        charged += 1 - budget.left;
        if (likelihood->calls == calls)
            continue;
        assert_int_equal(likelihood->calls, calls + 1);
        assert_true(charged >= LIKELIHOOD_UNITS);
        calls = likelihood->calls;
        charged = 0;
    }
    assert_ok(status);
    assert_true(calls > first);
    assert_int_equal(cairn_pose_consensus_read(consensus).units, units);
    assert_near(cairn_pose_consensus_read(consensus).total, total, 0);
}

static void a_likelihood_is_charged_before_it_is_evaluated(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    struct counted_likelihood likelihood = {{{0, 0, 0}, {3, 0, 1}, {3, 3, 2}, {0, 3, 3}}, 0, -2};
    cairn_pool pool;
    cairn_pose_consensus *consensus = new_consensus(&pool, &params);

    (void)state;
    add_competing_hypotheses(consensus, likelihood.truth);
    cairn_pose_consensus_set_pair_likelihood(consensus, pairwise_likelihood, &likelihood);
    evaluations_are_charged_before(consensus, &likelihood);
    cairn_pose_consensus_set_joint_likelihood(consensus, joint_likelihood, &likelihood);
    evaluations_are_charged_before(consensus, &likelihood);
    test_pool_free(&pool);
}

/* Node 3 has 22 nats at its pose and `elsewhere` at a pose that is off by `off`, where it
 * contradicts two nodes of six nats each, at a cost of three each; node 4 is connected by node 3
 * and node 0. */
static cairn_pose_consensus_result solve_ambiguous(cairn_pose_consensus *consensus, cairn_pose off,
                                                   cairn_real elsewhere, cairn_real by_third,
                                                   cairn_real by_first)
{
    const cairn_pose truth[5] = {{0, 0, 0}, {3, 0, 1}, {3, 3, 2}, {0, 3, 3}, {2, 2, 0}};

    assert_ok(cairn_pose_consensus_clear(consensus, 5));
    for (int32_t i = 0; i < 4; i++)
        for (int32_t j = i + 1; j < 4; j++)
            add(consensus, i, j, cairn_pose_between(truth[i], truth[j]), i > 0 && j == 3 ? 6 : 10);
    add(consensus, 0, 3, cairn_pose_compose(cairn_pose_between(truth[0], truth[3]), off),
        elsewhere);
    add(consensus, 3, 4, cairn_pose_between(truth[3], truth[4]), by_third);
    add(consensus, 0, 4, cairn_pose_between(truth[0], truth[4]), by_first);
    return solve(consensus);
}

static void nodes_with_a_competing_pose_are_ambiguous(void **state)
{
    const cairn_pose far = {CAIRN_REAL(1.2), 0, 0}, near = {CAIRN_REAL(0.8), 0, 0},
                     turned = {0, 0, CAIRN_REAL(0.7)};
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    cairn_pool pool;
    cairn_pose_consensus *consensus;

    (void)state;
    params.min_support = 1;
    params.conflict_penalty = CAIRN_REAL(0.5);
    params.min_ambiguous_weight = CAIRN_REAL(1e-9);
    consensus = new_consensus(&pool, &params);
    /* e^-12 weighs something */
    assert_int_equal(solve_ambiguous(consensus, far, 17, 0.5, 5).ambiguous, 1);
    test_pool_free(&pool);
    /* of 7.8 nats */
    params.min_ambiguous_weight = CAIRN_REAL(0.0004);
    params.significant_support = 4;
    consensus = new_consensus(&pool, &params);
    assert_int_equal(solve_ambiguous(consensus, far, 15, 0.5, 5).ambiguous, 0);
    assert_int_equal(solve_ambiguous(consensus, near, 17, 0.5, 5).ambiguous, 0);
    assert_int_equal(solve_ambiguous(consensus, turned, 17, 0.5, 5).ambiguous, 1);
    assert_int_equal(solve_ambiguous(consensus, far, 17, 0.5, 5).ambiguous, 1);
    assert_int_equal(cairn_pose_consensus_node(consensus, 3).ambiguous, 1);
    assert_int_equal(cairn_pose_consensus_node(consensus, 4).ambiguous, 0);
    /* Most of the support of node 4 comes from node 3. */
    assert_int_equal(solve_ambiguous(consensus, far, 19, 3, 2.5).ambiguous, 2);
    assert_int_equal(cairn_pose_consensus_node(consensus, 4).ambiguous, 1);
    assert_int_equal(cairn_pose_consensus_node(consensus, 0).ambiguous, 0);
    test_pool_free(&pool);
    params.min_ambiguous_weight = CAIRN_REAL(0.003);
    consensus = new_consensus(&pool, &params);
    /* six nats against it are too much */
    assert_int_equal(solve_ambiguous(consensus, far, 17, 0.5, 5).ambiguous, 0);
    test_pool_free(&pool);
}

static cairn_pose_consensus_result find_submaps(cairn_pose_consensus *consensus, int32_t units)
{
    cairn_budget budget = {units};

    assert_ok(cairn_pose_consensus_find_submaps(consensus));
    while (cairn_pose_consensus_step(consensus, &budget) == CAIRN_MORE)
        budget.left = units;
    return cairn_pose_consensus_read(consensus);
}

/* Node 4 of solve_ambiguous() is supported by its two pairs. */
static void a_node_of_too_little_support_is_a_submap(void **state)
{
    const cairn_pose near = {CAIRN_REAL(0.8), 0, 0};
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    cairn_pose_consensus_result before, after;
    cairn_pose_consensus_estimate node;
    cairn_pool pool;
    cairn_pose_consensus *consensus;

    (void)state;
    assert_int_equal(cairn_pose_consensus_find_submaps(NULL), CAIRN_BAD_ARGUMENT);
    params.min_support = 1;
    params.significant_support = 4;
    consensus = new_consensus(&pool, &params);
    assert_int_equal(cairn_pose_consensus_find_submaps(consensus), CAIRN_EMPTY);
    before = solve_ambiguous(consensus, near, 9, 1.5, 2.25);
    assert_int_equal(before.ambiguous, 0);
    node = cairn_pose_consensus_node(consensus, 4);
    assert_int_equal(node.submap, 0);
    for (int32_t units = 1; units <= 1000; units += 999) {
        after = find_submaps(consensus, units);
        assert_true(after.units > before.units);
        before.units = after.units;
        before.ambiguous = 1;
        assert_memory_equal(&after, &before, sizeof after);
        node.ambiguous = node.submap = 1;
        assert_int_equal(cairn_pose_consensus_node(consensus, 4).submap, 1);
        assert_int_equal(cairn_pose_consensus_node(consensus, 4).ambiguous, 1);
        assert_near(cairn_pose_consensus_node(consensus, 4).support, node.support, 0);
        for (int32_t i = 0; i < 4; i++) {
            assert_int_equal(cairn_pose_consensus_node(consensus, i).submap, 0);
            assert_int_equal(cairn_pose_consensus_node(consensus, i).ambiguous, 0);
        }
    }
    /* 4.25 nats are enough. */
    (void)solve_ambiguous(consensus, near, 9, 1.75, 2.5);
    assert_int_equal(find_submaps(consensus, 1000).ambiguous, 0);
    assert_int_equal(cairn_pose_consensus_node(consensus, 4).submap, 0);
    test_pool_free(&pool);

    params.significant_support = 0; /* no submaps */
    consensus = new_consensus(&pool, &params);
    before = solve_ambiguous(consensus, near, 9, 1.5, 2.25);
    after = find_submaps(consensus, 1000);
    assert_memory_equal(&after, &before, sizeof after);
    assert_true(cairn_pose_consensus_node(consensus, 4).link_support == CAIRN_REAL_MAX);
    test_pool_free(&pool);
}

/* Three groups of nodes connected by ten nats a pair; the second is linked to the first by one pair
 * of `second`, the third to the second by one of `third`. */
static void solve_groups(cairn_pose_consensus *consensus, cairn_real second, cairn_real third)
{
    const cairn_pose at[9] = {{0, 0, 0}, {3, 0, 1},  {9, 0, 1},  {12, 0, 2}, {12, 3, 3},
                              {9, 3, 0}, {20, 0, 0}, {20, 3, 1}, {23, 2, 2}};
    const int32_t group[9] = {0, 0, 1, 1, 1, 1, 2, 2, 2};

    assert_ok(cairn_pose_consensus_clear(consensus, 9));
    for (int32_t i = 0; i < 9; i++)
        for (int32_t j = i + 1; j < 9; j++)
            if (group[i] == group[j])
                add(consensus, i, j, cairn_pose_between(at[i], at[j]), 10);
    add(consensus, 1, 2, cairn_pose_between(at[1], at[2]), second);
    add(consensus, 5, 6, cairn_pose_between(at[5], at[6]), third);
    assert_int_equal(solve(consensus).components, 1);
    (void)find_submaps(consensus, 1000);
    for (int32_t i = 0; i < 9; i++) {
        assert_pose_near(cairn_pose_consensus_node(consensus, i).map_node, at[i], 0.01, 0.01);
        assert_int_equal(cairn_pose_consensus_node(consensus, i).component, 0);
        assert_int_equal(cairn_pose_consensus_node(consensus, i).ambiguous,
                         cairn_pose_consensus_node(consensus, i).submap > 0);
    }
}

static void assert_submaps(const cairn_pose_consensus *consensus, int32_t first, int32_t second,
                           int32_t third)
{
    assert_int_equal(cairn_pose_consensus_node(consensus, 0).submap, first);
    assert_int_equal(cairn_pose_consensus_node(consensus, 1).submap, first);
    for (int32_t i = 2; i < 6; i++)
        assert_int_equal(cairn_pose_consensus_node(consensus, i).submap, second);
    for (int32_t i = 6; i < 9; i++)
        assert_int_equal(cairn_pose_consensus_node(consensus, i).submap, third);
}

/* Several nodes need four times as much as one, because by chance they share views in several
 * ways. */
static void groups_of_too_little_support_are_submaps(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    cairn_pool pool;
    cairn_pose_consensus *consensus;

    (void)state;
    params.significant_support = CAIRN_REAL(2.25); /* nine nats for several */
    consensus = new_consensus(&pool, &params);
    solve_groups(consensus, 9.5, 9.5);
    assert_submaps(consensus, 0, 0, 0);
    solve_groups(consensus, 9.5, 8.5);
    assert_submaps(consensus, 0, 0, 1);
    solve_groups(consensus, 8.5, 9.5);
    assert_submaps(consensus, 1, 0, 0);
    solve_groups(consensus, 8.5, 8.25);
    assert_submaps(consensus, 2, 0, 1); /* by their sizes */
    test_pool_free(&pool);
}

/* Of the groups of solve_groups(): the first is cut off with two nodes, the third with three; no
 * node of the second is weaker than its own three pairs. */
static void the_weakest_cut_is_the_link_support(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    cairn_pool pool;
    cairn_pose_consensus *consensus;

    (void)state;
    params.significant_support = CAIRN_REAL(2.25);
    consensus = new_consensus(&pool, &params);
    for (int32_t split = 0; split < 2; split++) {
        solve_groups(consensus, split ? CAIRN_REAL(8.5) : CAIRN_REAL(9.5), CAIRN_REAL(9.25));
        for (int32_t i = 0; i < 18; i++) {
            double link = (double)cairn_pose_consensus_node(consensus, i % 9).link_support;

            if (i % 9 < 2)
                assert_near(link, (split ? 8.5 : 9.5) / sqrt(2.0), 0.02);
            else if (i % 9 < 6)
                assert_true(link > 12);
            else
                assert_near(link, 9.25 / sqrt(3.0), 0.02);
            if (i == 8) /* found again, of a tree without the links that were split */
                (void)find_submaps(consensus, 1000);
        }
    }
    test_pool_free(&pool);
}

/* Two parts, each of submaps of three, three and two nodes, and a node that nothing places. Submaps
 * are numbered within their part, among equal ones by the lowest node. */
static void submaps_are_numbered_within_their_components(void **state)
{
    static const int32_t submap_of[17] = {2, 2, 0, 0, 0, 1, 1, 1, 2, 2, 0, 0, 0, 1, 1, 1, 0};
    static const int32_t group[8] = {0, 0, 1, 1, 1, 2, 2, 2};
    const cairn_pose at[8] = {{0, 0, 0},  {3, 0, 1},  {9, 0, 1},  {12, 0, 2},
                              {12, 3, 3}, {20, 0, 0}, {20, 3, 1}, {23, 2, 2}};
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    cairn_pool pool;
    cairn_pose_consensus *consensus;
    cairn_pose_consensus_result result;

    (void)state;
    params.significant_support = CAIRN_REAL(2.25);
    params.max_nodes = 17;
    consensus = new_consensus(&pool, &params);
    assert_ok(cairn_pose_consensus_clear(consensus, 17));
    for (int32_t part = 0; part < 16; part += 8) {
        for (int32_t i = 0; i < 8; i++)
            for (int32_t j = i + 1; j < 8; j++)
                if (group[i] == group[j])
                    add(consensus, part + i, part + j, cairn_pose_between(at[i], at[j]), 10);
        add(consensus, part + 1, part + 2, cairn_pose_between(at[1], at[2]), 8.5);
        add(consensus, part + 4, part + 5, cairn_pose_between(at[4], at[5]), 8.25);
    }
    assert_int_equal(solve(consensus).components, 3);
    for (int32_t units = 1; units <= 1000; units += 999) {
        result = find_submaps(consensus, units);
        for (int32_t i = 0; i < 17; i++) {
            cairn_pose_consensus_estimate node = cairn_pose_consensus_node(consensus, i);

            assert_int_equal(node.component, i / 8);
            assert_int_equal(node.submap, submap_of[i]);
            assert_int_equal(node.ambiguous, submap_of[i] > 0);
        }
        assert_int_equal(result.ambiguous, 10);
    }
    test_pool_free(&pool);
}

static void free_space_violations_cost(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    const cairn_pose truth[3] = {{0, 0, 0}, {3, 0, 1}, {3, 3, 2}};
    cairn_pose wrong = {1, 3, 3};
    cairn_pool pool;
    cairn_pose_consensus *consensus;
    cairn_pose_consensus_estimate node;

    (void)state;
    params.conflict_penalty = CAIRN_REAL(0.5);
    consensus = new_consensus(&pool, &params);
    assert_ok(cairn_pose_consensus_clear(consensus, 3));
    for (int32_t i = 0; i < 2; i++)
        add(consensus, i, i + 1, cairn_pose_between(truth[i], truth[i + 1]), 10);
    add(consensus, 0, 2, wrong, 6);
    (void)solve(consensus);
    node = cairn_pose_consensus_node(consensus, 2);
    assert_near(node.support, 10 - 3, 0.01);
    assert_int_equal(node.agreeing, 1);
    assert_int_equal(node.conflicting, 1);
    test_pool_free(&pool);
}

/* ---- Golden results ---- */

/* All that is reported. */
static uint64_t hash_of(const cairn_pose_consensus *consensus, int32_t hypotheses)
{
    cairn_pose_consensus_result r = cairn_pose_consensus_read(consensus);
    int64_t counts[] = {r.nodes,  r.placed, r.components, r.ambiguous, r.start,
                        r.starts, r.rounds, r.inliers,    r.units};
    cairn_real totals[] = {r.total, r.competing_total};
    uint64_t hash =
        test_hash(test_hash(TEST_HASH_START, counts, sizeof counts), totals, sizeof totals);

    for (int32_t i = 0; i < r.nodes; i++) {
        cairn_pose_consensus_estimate node = cairn_pose_consensus_node(consensus, i);

        hash =
            test_hash(hash, &node,
                      offsetof(cairn_pose_consensus_estimate, ambiguous) + sizeof node.ambiguous);
        for (int32_t k = 0; k < node.alternatives; k++) {
            cairn_pose_consensus_competing_pose other =
                cairn_pose_consensus_alternative(consensus, i, k);

            hash = test_hash(hash, &other,
                             offsetof(cairn_pose_consensus_competing_pose, is_other_map) +
                                 sizeof other.is_other_map);
        }
    }
    for (int32_t k = 0; k < hypotheses; k++) {
        int32_t agrees = cairn_pose_consensus_is_inlier(consensus, k);

        hash = test_hash(hash, &agrees, sizeof agrees);
    }
    return hash;
}

/* Poses that bring the nodes close, against others. */
static int likelihood_of_proximity(void *context, int32_t first, int32_t second,
                                   cairn_pose first_second, cairn_pose_likelihood *likelihood,
                                   cairn_budget *budget)
{
    cairn_real square = first_second.x * first_second.x + first_second.y * first_second.y;

    (void)context;
    if (!cairn_budget_charge(budget, &likelihood->units_charged, 1 + (first + second) % 3))
        return 0;
    likelihood->ratio = square < 9 ? CAIRN_REAL(0.5) : CAIRN_REAL(-0.25);
    return 1;
}

struct scene {
    uint64_t seed;
    int32_t nodes, lies;
    double reach, known;
    int32_t starts, rounds, candidates, alternatives;
    double contradiction;
    int32_t bounded; /* nodes bounded about their true poses; with a joint likelihood, too */
    uint64_t in_double, in_float;
};

static uint64_t hash_of_scene(const struct scene *scene)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    static struct world world;
    cairn_pool pool;
    cairn_pose_consensus *consensus;
    uint64_t hash;

    params.max_starts = scene->starts;
    params.max_rounds = scene->rounds;
    params.max_candidates = scene->candidates;
    params.max_alternatives = scene->alternatives;
    params.conflict_penalty = (cairn_real)scene->contradiction;
    consensus = new_consensus(&pool, &params);
    make_world(&world, scene->seed, scene->nodes, (cairn_real)scene->reach,
               (cairn_real)scene->known, scene->lies);
    load(consensus, &world);
    for (int32_t i = 0; i < scene->bounded; i++)
        assert_ok(cairn_pose_consensus_set_bound(consensus, i, world.truth[i], CAIRN_REAL(0.5),
                                                 CAIRN_REAL(0.4)));
    if (scene->bounded > 0)
        cairn_pose_consensus_set_pair_likelihood(consensus, likelihood_of_proximity, NULL);
    (void)solve(consensus);
    hash = hash_of(consensus, world.count);
    test_pool_free(&pool);
    return hash;
}

static void results_stay_as_they_are(void **state)
{
    static const struct scene scenes[] = {
        {31, 16, 600, 7, 0.8, 16, 10, 8, 4, 0, 0, UINT64_C(0x072bd1cad36de2d4),
         UINT64_C(0x157fce249044662e)},
        {32, 24, 60, 3.2, 0.7, 16, 3, 3, 2, 0.3, 0, UINT64_C(0xa9dc943d02d604e4),
         UINT64_C(0x3129ff7c46389ae5)},
        {33, 12, 120, 4, 0.5, 8, 4, 8, 8, 0, 3, UINT64_C(0x3f605b2d12b45c83),
         UINT64_C(0x8429e395ea1565e9)},
        {34, 30, 30, 3, 0.4, 1, 0, 1, 1, 0, 0, UINT64_C(0x5e10bed3174717fa),
         UINT64_C(0xb500f29fed4220bd)},
        {35, 6, 20, 20, 0.5, 16, 10, 8, 32, 0.1, 6, UINT64_C(0x1336d2861bac4c1b),
         UINT64_C(0x705cdd21a71f4209)},
    };

    (void)state;
    for (size_t k = 0; k < sizeof scenes / sizeof *scenes; k++)
        assert_golden(hash_of_scene(&scenes[k]), scenes[k].in_double, scenes[k].in_float);
}

/* Nodes on a grid without rotation, with integer scores, doubled hypotheses and bounds of a metre:
 * many choices are between equals, and many values equal the limits. */
static uint64_t hash_of_ties(uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 2);
    uint64_t hash = TEST_HASH_START;

    for (int32_t k = 0; k < 40; k++) {
        cairn_pose_consensus_params params = cairn_pose_consensus_default();
        int32_t nodes = 3 + cairn_random_below(&random, 8),
                count = 3 * nodes + cairn_random_below(&random, 12);
        cairn_pool pool;
        cairn_pose_consensus *consensus;

        params.min_support = 4;
        params.max_starts = 1 + cairn_random_below(&random, 6);
        params.max_rounds = cairn_random_below(&random, 4);
        params.max_candidates = 1 + cairn_random_below(&random, 6);
        params.max_alternatives = cairn_random_below(&random, 6);
        params.conflict_penalty = CAIRN_REAL(0.25) * (cairn_real)cairn_random_below(&random, 3);
        consensus = new_consensus(&pool, &params);
        assert_ok(cairn_pose_consensus_clear(consensus, nodes));
        for (int32_t i = 0; i < count; i++) {
            int32_t first = cairn_random_below(&random, nodes);
            int32_t second = (first + 1 + cairn_random_below(&random, nodes - 1)) % nodes;
            int32_t rows = second / 3 - first / 3;
            cairn_pose between = {(cairn_real)(second % 3 - first % 3), (cairn_real)rows, 0};

            if (cairn_random_below(&random, 3) == 0)
                between.x += (cairn_real)(cairn_random_below(&random, 3) - 1);
            add(consensus, first, second, between,
                (cairn_real)(2 << cairn_random_below(&random, 3)));
        }
        for (int32_t i = 0; i < nodes && k % 3 == 0; i += 2) {
            int32_t row = i / 3 + cairn_random_below(&random, 2);
            cairn_pose centre = {(cairn_real)(i % 3), (cairn_real)row, 0};

            assert_ok(cairn_pose_consensus_set_bound(consensus, i, centre, 1, CAIRN_REAL(0.5)));
        }
        if (k % 4 == 1)
            cairn_pose_consensus_set_pair_likelihood(consensus, likelihood_of_proximity, NULL);
        (void)solve(consensus);
        hash = test_hash(hash, &nodes, sizeof nodes) ^ hash_of(consensus, count);
        test_pool_free(&pool);
    }
    return hash;
}

static void ties_go_by_the_index(void **state)
{
    (void)state;
    assert_golden(hash_of_ties(1), UINT64_C(0xb96779ef20f69857), UINT64_C(0xcf70f3565e13fbac));
    assert_golden(hash_of_ties(2), UINT64_C(0x6a0ac815ef80e9f2), UINT64_C(0x7841b3504bf66c9c));
}

/* ---- Contracts ---- */

static void the_result_does_not_depend_on_budgets(void **state)
{
    const int32_t budgets[] = {CAIRN_UNBOUNDED, 1, 7, 1000};
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    static struct world world;
    uint64_t hashes[4];

    (void)state;
    make_world(&world, 5, 10, 6, CAIRN_REAL(0.7), 60);
    for (int32_t b = 0; b < 4; b++) {
        cairn_pool pool;
        cairn_pose_consensus *consensus = new_consensus(&pool, &params);
        cairn_budget budget = {0};
        cairn_status status;
        int64_t units = 0;

        load(consensus, &world);
        assert_ok(cairn_pose_consensus_begin(consensus));
        assert_status(cairn_pose_consensus_step(consensus, &budget), CAIRN_MORE);
        do {
            budget.left = budgets[b];
            status = cairn_pose_consensus_step(consensus, &budget);
            assert_true(budget.left >= 0);
            units += budgets[b] - budget.left;
            if (status == CAIRN_MORE) {
                assert_int_equal(cairn_pose_consensus_read(consensus).nodes, 0);
                assert_int_equal(cairn_pose_consensus_is_inlier(consensus, 0), 0);
            }
        } while (status == CAIRN_MORE);
        assert_ok(status);
        assert_int_equal(cairn_pose_consensus_read(consensus).units, units);
        hashes[b] = TEST_HASH_START;
        for (int32_t i = 0; i < 10; i++) {
            cairn_pose_consensus_estimate node = cairn_pose_consensus_node(consensus, i);

            hashes[b] = test_hash(hashes[b], &node,
                                  offsetof(cairn_pose_consensus_estimate, ambiguous) +
                                      sizeof node.ambiguous);
        }
        assert_true(hashes[b] == hashes[0]);
        test_pool_free(&pool);
    }
}

static struct world half_done_world;

static cairn_status begin_world(void *context)
{
    return cairn_pose_consensus_begin(context);
}

static cairn_status step_world(void *context, cairn_budget *budget)
{
    return cairn_pose_consensus_step(context, budget);
}

static uint64_t hash_world(void *context)
{
    return hash_of(context, half_done_world.count);
}

static void begins_anew(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    cairn_pool pool;
    cairn_pose_consensus *consensus = new_consensus(&pool, &params);
    test_stepped object = {begin_world, step_world, hash_world, consensus};

    (void)state;
    make_world(&half_done_world, 36, 8, 4, CAIRN_REAL(0.6), 30);
    load(consensus, &half_done_world);
    test_begins_anew(&object, 60);
    test_pool_free(&pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_pose_consensus *consensus;

    return cairn_pose_consensus_create(&consensus, pool, context);
}

static void memory_is_exact(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    size_t need;

    (void)state;
    params.max_nodes = 5;
    params.max_hypotheses = 7;
    need = cairn_pose_consensus_memory(&params);
    test_every_pool_size(create, &params, need);
    params.max_alternatives = 0;
    assert_true(cairn_pose_consensus_memory(&params) < need);
    test_every_pool_size(create, &params, cairn_pose_consensus_memory(&params));
}

#define TAKEN(field, value)                                                                        \
    do {                                                                                           \
        cairn_pose_consensus_params good = cairn_pose_consensus_default();                         \
        good.field = value;                                                                        \
        assert_true(cairn_pose_consensus_memory(&good) > 0);                                       \
    } while (0)

static void the_limits_of_params_are_taken(void **state)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    cairn_pool pool = test_pool(cairn_pose_consensus_memory(&params));

    (void)state;
    TAKEN(max_nodes, 1);
    TAKEN(max_nodes, 1 << 16);
    TAKEN(max_hypotheses, 1);
    TAKEN(max_hypotheses, 1 << 20);
    TAKEN(max_starts, 1);
    TAKEN(max_rounds, 0);
    TAKEN(max_candidates, 1);
    TAKEN(max_candidates, 32);
    TAKEN(max_alternatives, 32);
    TAKEN(conflict_penalty, 0);
    assert_status(cairn_pose_consensus_create(NULL, &pool, &params), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.used, 0);
    test_pool_free(&pool);
}

static void bad_hypotheses_are_refused(void **state)
{
    const cairn_real nan = (cairn_real)NAN, infinity = (cairn_real)INFINITY;
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    cairn_pose pose = {1, 2, 3};
    cairn_pose_consensus_relative_pose good = hypothesis_of(0, 1, pose, CAIRN_REAL(0.1),
                                                            CAIRN_REAL(0.1), 5),
                                       bad;
    cairn_pool pool;
    cairn_pose_consensus *consensus;
    cairn_fault fault;

    (void)state;
    params.max_nodes = 3;
    params.max_hypotheses = 2;
    consensus = new_consensus(&pool, &params);
    assert_status(cairn_pose_consensus_begin(consensus), CAIRN_EMPTY);
    assert_status(cairn_pose_consensus_begin(NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_consensus_step(NULL, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_consensus_step(consensus, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_consensus_clear(NULL, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_consensus_clear(consensus, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_consensus_clear(consensus, 4), CAIRN_FULL);
    /* no nodes yet */
    assert_fault(&fault, cairn_pose_consensus_add(consensus, &good, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_ok(cairn_pose_consensus_clear(consensus, 3));
    assert_fault(&fault, cairn_pose_consensus_add(NULL, &good, &fault), CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_pose_consensus_add(consensus, NULL, &fault), CAIRN_BAD_ARGUMENT, -1);
#define REFUSED_AS(field, value, status)                                                           \
    do {                                                                                           \
        bad = good;                                                                                \
        bad.field = value;                                                                         \
        fault.message = NULL;                                                                      \
        fault.index = 7;                                                                           \
        assert_status(cairn_pose_consensus_add(consensus, &bad, &fault), status);                  \
        assert_non_null(fault.message);                                                            \
        assert_int_equal(fault.index, -1);                                                         \
        assert_status(cairn_pose_consensus_add(consensus, &bad, NULL), status);                    \
    } while (0)
    REFUSED_AS(first, -1, CAIRN_BAD_ARGUMENT);
    REFUSED_AS(first, 3, CAIRN_BAD_ARGUMENT);
    REFUSED_AS(second, -1, CAIRN_BAD_ARGUMENT);
    REFUSED_AS(second, 3, CAIRN_BAD_ARGUMENT);
    REFUSED_AS(second, 0, CAIRN_BAD_ARGUMENT);
    REFUSED_AS(first_second.x, nan, CAIRN_NOT_FINITE);
    REFUSED_AS(first_second.theta, infinity, CAIRN_NOT_FINITE);
    REFUSED_AS(first_second.x, CAIRN_REAL(2e6), CAIRN_BAD_ARGUMENT);
    REFUSED_AS(first_second.y, CAIRN_REAL(-2e6), CAIRN_BAD_ARGUMENT);
    REFUSED_AS(covariance[0], -1, CAIRN_BAD_ARGUMENT);
    REFUSED_AS(covariance[4], CAIRN_REAL(2e6), CAIRN_BAD_ARGUMENT);
    REFUSED_AS(covariance[0], CAIRN_REAL(2e6), CAIRN_BAD_ARGUMENT);
    REFUSED_AS(covariance[8], CAIRN_REAL(2e6), CAIRN_BAD_ARGUMENT);
    REFUSED_AS(covariance[5], nan, CAIRN_NOT_FINITE);
    REFUSED_AS(covariance[8], infinity, CAIRN_NOT_FINITE);
    REFUSED_AS(score, 0, CAIRN_BAD_ARGUMENT);
    REFUSED_AS(score, nan, CAIRN_BAD_ARGUMENT);
    REFUSED_AS(score, CAIRN_REAL(2e6), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_pose_consensus_add(consensus, &good, &fault));
    good.first = 2;
    assert_ok(cairn_pose_consensus_add(consensus, &good, &fault));
    assert_fault(&fault, cairn_pose_consensus_add(consensus, &good, &fault), CAIRN_FULL, -1);
    assert_int_equal(solve(consensus).placed, 3);

    assert_status(cairn_pose_consensus_set_bound(NULL, 0, pose, 1, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_consensus_set_bound(consensus, -1, pose, 1, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_consensus_set_bound(consensus, 3, pose, 1, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_consensus_set_bound(consensus, 0, pose, 0, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_consensus_set_bound(consensus, 0, pose, 1, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_consensus_set_bound(consensus, 0, pose, nan, 1), CAIRN_NOT_FINITE);
    assert_status(cairn_pose_consensus_set_bound(consensus, 0, pose, 1, infinity),
                  CAIRN_NOT_FINITE);
    pose.x = CAIRN_REAL(2e6);
    assert_status(cairn_pose_consensus_set_bound(consensus, 0, pose, 1, 1), CAIRN_BAD_ARGUMENT);
    pose.x = nan;
    assert_status(cairn_pose_consensus_set_bound(consensus, 0, pose, 1, 1), CAIRN_NOT_FINITE);
    assert_int_equal(cairn_pose_consensus_read(consensus).placed, 3);
    assert_int_equal(cairn_pose_consensus_node(consensus, 3).agreeing, 0);
    assert_int_equal(cairn_pose_consensus_node(consensus, -1).agreeing, 0);

    /* A change invalidates the result. */
    pose.x = 0;
    assert_ok(cairn_pose_consensus_set_bound(consensus, 0, pose, 1, 1));
    assert_int_equal(cairn_pose_consensus_read(consensus).placed, 0);
    assert_int_equal(solve(consensus).placed, 3);
    assert_ok(cairn_pose_consensus_clear(consensus, 3));
    assert_int_equal(cairn_pose_consensus_read(consensus).placed, 0);
    assert_int_equal(solve(consensus).placed, 0);
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(results_stay_as_they_are),
        cmocka_unit_test(ties_go_by_the_index),
        cmocka_unit_test(two_nodes),
        cmocka_unit_test(most_hypotheses_are_wrong),
        cmocka_unit_test(relaxation_averages),
        cmocka_unit_test(many_weak_ones_outweigh_a_strong_one),
        cmocka_unit_test(nothing_better_is_found_by_trying_all),
        cmocka_unit_test(disconnected_nodes_are_components),
        cmocka_unit_test(parts_are_joined_as_wholes),
        cmocka_unit_test(nothing_is_placed_on_weak_evidence),
        cmocka_unit_test(another_map_is_an_alternative),
        cmocka_unit_test(blocks_are_allocated_anew),
        cmocka_unit_test(the_likelihood_may_exceed_a_hypothesis),
        cmocka_unit_test(bounds_forbid),
        cmocka_unit_test(a_pairwise_likelihood_decides),
        cmocka_unit_test(the_joint_likelihood_decides),
        cmocka_unit_test(a_likelihood_is_charged_before_it_is_evaluated),
        cmocka_unit_test(nodes_with_a_competing_pose_are_ambiguous),
        cmocka_unit_test(a_node_of_too_little_support_is_a_submap),
        cmocka_unit_test(groups_of_too_little_support_are_submaps),
        cmocka_unit_test(the_weakest_cut_is_the_link_support),
        cmocka_unit_test(submaps_are_numbered_within_their_components),
        cmocka_unit_test(free_space_violations_cost),
        cmocka_unit_test(the_result_does_not_depend_on_budgets),
        cmocka_unit_test(begins_anew),
        cmocka_unit_test(memory_is_exact),
        cmocka_unit_test(the_limits_of_params_are_taken),
        cmocka_unit_test(bad_hypotheses_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
