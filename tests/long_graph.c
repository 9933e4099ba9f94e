/* Long scenes of graphs, consensus and particles. */
#include "src/base/build.h"

#include "cairn/particle_filter.h"
#include "cairn/pose_consensus.h"
#include "cairn/pose_graph.h"
#include "tests/long.h"
#include "tests/long_scenes.h"

/* ---- Graphs ---- */

enum { POSES = 120, LAP = 30 };

/* A spiral of laps. */
static cairn_pose truth_of(int32_t i)
{
    cairn_real turn = 2 * CAIRN_PI * (cairn_real)i / LAP, sine, cosine,
               radius = 5 + (cairn_real)i / 100;
    cairn_pose pose;

    cairn_sincos(turn, &sine, &cosine);
    pose.x = radius * cosine;
    pose.y = radius * sine;
    pose.theta = cairn_wrap_angle(turn + CAIRN_PI / 2);
    return pose;
}

static cairn_pose measure(cairn_random *random, int32_t i, int32_t j)
{
    cairn_pose seen = cairn_pose_between(truth_of(i), truth_of(j));

    return long_disturbed(random, seen, CAIRN_REAL(0.03), CAIRN_REAL(0.02));
}

/* Loop closures with earlier laps, some of them wrong. */
static void add_links(cairn_pose_graph *graph, cairn_random *random)
{
    cairn_sym3 information = {900, 50, -20, 1100, 30, 3000};

    for (int32_t i = 1; i < POSES; i++) {
        assert_ok(
            cairn_pose_graph_add_link(graph, i - 1, i, measure(random, i - 1, i), information));
        if (i > LAP && i % 4 == 0)
            assert_ok(cairn_pose_graph_add_link(
                graph, i - LAP, i, measure(random, i - LAP, i % 20 == 0 ? i - 7 : i), information));
        if (i > 2 * LAP && i % 9 == 0)
            assert_ok(cairn_pose_graph_add_link(graph, i, i - 2 * LAP - i % 5,
                                                measure(random, i, i - 2 * LAP - i % 5),
                                                information));
    }
}

static uint64_t add_graph(uint64_t hash, const cairn_pose_graph *graph)
{
    cairn_pose_graph_state state = cairn_pose_graph_read(graph);

    hash = add_int(add_int(add_int(add_int(hash, state.verdict), state.iterations), state.chordal),
                   state.outliers);
    hash =
        add_int(add_int(add_int(add_int(hash, state.pose), state.fill), state.poses), state.links);
    hash = add_real(add_real(hash, state.chi2_initial), state.chi2);
    hash = add_real(add_real(hash, state.cost_initial), state.cost);
    for (int32_t i = 0; i < state.poses; i++)
        hash = add_pose(hash, cairn_pose_graph_pose(graph, i));
    for (int32_t i = 0; i < state.links; i++) {
        cairn_pose_graph_link link = cairn_pose_graph_link_of(graph, i);

        hash = add_int(add_int(add_real(add_real(hash, link.chi2), link.weight), link.is_outlier),
                       link.is_excluded);
    }
    return hash;
}

static uint64_t solve(uint64_t hash, cairn_pose_graph *graph)
{
    assert_ok(cairn_pose_graph_solve(graph));
    LONG_RUN(hash, cairn_pose_graph_step, graph, 3000);
    return add_graph(hash, graph);
}

static uint64_t solve_with(uint64_t hash, cairn_pose_graph_params params, cairn_random *random)
{
    cairn_pose pose = cairn_pose_identity();
    cairn_pose_graph *graph;
    cairn_real block[9];
    cairn_pool pool;

    params.max_poses = POSES;
    params.max_links = 2 * POSES;
    params.max_fill = 8 * POSES;
    pool = test_pool(cairn_pose_graph_memory(&params, NULL));
    assert_ok(cairn_pose_graph_create(&graph, &pool, &params, NULL));
    for (int32_t i = 0; i < POSES; i++) {
        if (i > 0)
            pose = cairn_pose_compose(pose, measure(random, i - 1, i));
        assert_ok(cairn_pose_graph_add_pose(graph, pose));
    }
    add_links(graph, random);
    hash = solve(hash, graph);
    assert_ok(cairn_pose_graph_marginals(graph));
    LONG_RUN(hash, cairn_pose_graph_step, graph, 2000);
    for (int32_t i = 1; i < POSES; i += 3) {
        assert_ok(cairn_pose_graph_covariance(graph, i, i, block));
        hash = add_covariance(hash, block);
        assert_ok(cairn_pose_graph_covariance(graph, i - 1, i, block));
        hash = add_covariance(hash, block);
    }
    assert_ok(cairn_pose_graph_fix(graph, 40, 1));
    assert_ok(cairn_pose_graph_set_pose(graph, 60, truth_of(61)));
    assert_ok(cairn_pose_graph_exclude_link(graph, 37, 1));
    assert_ok(cairn_pose_graph_set_kernel(graph, CAIRN_POSE_GRAPH_CAUCHY, 1));
    hash = solve(hash, graph);
    test_pool_free(&pool);
    return hash;
}

uint64_t long_pose_graphs(void)
{
    cairn_random random = cairn_random_seed(51, 30);
    uint64_t hash = GOLDEN_START;

    for (cairn_pose_graph_kernel kernel = CAIRN_POSE_GRAPH_SQUARE; kernel <= CAIRN_POSE_GRAPH_DCS;
         kernel++) {
        cairn_pose_graph_params params = cairn_pose_graph_default();

        params.kernel = kernel;
        params.start = kernel % 3;
        params.kernel_width = 2 + (cairn_real)kernel / 4;
        params.graduated = kernel == CAIRN_POSE_GRAPH_GEMAN_MCCLURE;
        params.max_iterations = kernel == CAIRN_POSE_GRAPH_CAUCHY ? 5 : 60;
        hash = solve_with(hash, params, &random);
    }
    return hash;
}

/* ---- Block systems ---- */

uint64_t long_block_systems(void)
{
    enum { BLOCKS = 60, LINKS = 110 };
    cairn_random random = cairn_random_seed(52, 31);
    cairn_block_solver_params params = {.max_poses = BLOCKS, .max_links = LINKS, .max_fill = 900};
    uint64_t hash = GOLDEN_START;
    cairn_block_solver *solver;
    int32_t ends[LINKS][2];
    cairn_pool pool;

    LONG_CREATE(&pool, block_solver, &solver, &params);
    for (int32_t round = 0; round < 4; round++) {
        cairn_real b[3 * BLOCKS], block[9], x[3];
        int32_t poses = BLOCKS - 7 * round;

        assert_ok(cairn_block_solver_begin(solver, poses));
        for (int32_t l = 0; l < LINKS; l++) {
            int32_t first = l < poses - 1 ? l : cairn_random_below(&random, poses);
            int32_t second = l < poses - 1 ? l + 1 : cairn_random_below(&random, poses);

            if (first == second)
                second = (first + 1) % poses;
            ends[l][0] = first;
            ends[l][1] = second;
            assert_ok(cairn_block_solver_add_link(solver, first, second));
        }
        assert_ok(cairn_block_solver_analyze(solver));
        LONG_RUN(hash, cairn_block_solver_step, solver, 100);
        assert_ok(cairn_block_solver_clear(solver));
        LONG_RUN(hash, cairn_block_solver_step, solver, 100);
        for (int32_t i = 0; i < poses; i++) {
            cairn_sym3 m = {30 + (cairn_real)i, 1, 2, 35, -1, 28};

            assert_ok(cairn_block_solver_add_pose_block(solver, i, m));
            for (int32_t k = 0; k < 3; k++)
                b[3 * i + k] = argument(&random, 5, 0);
        }
        for (int32_t l = 0; l < LINKS; l++) {
            for (int32_t k = 0; k < 9; k++)
                block[k] = argument(&random, 1, 0);
            assert_ok(cairn_block_solver_add_link_block(solver, l, block));
        }
        assert_ok(cairn_block_solver_factor(solver));
        LONG_RUN(hash, cairn_block_solver_step, solver, 100);
        assert_ok(cairn_block_solver_solve(solver, b));
        LONG_RUN(hash, cairn_block_solver_step, solver, 100);
        for (int32_t i = 0; i < poses; i++) {
            assert_ok(cairn_block_solver_solution(solver, i, x));
            hash = add_vector(hash, x, 3);
        }
        assert_ok(cairn_block_solver_invert(solver));
        LONG_RUN(hash, cairn_block_solver_step, solver, 100);
        for (int32_t l = 0; l < LINKS; l++) {
            assert_ok(cairn_block_solver_covariance(solver, ends[l][0], ends[l][1], block));
            hash = add_covariance(hash, block);
            assert_ok(cairn_block_solver_covariance(solver, ends[l][0], ends[l][0], block));
            hash = add_covariance(hash, block);
        }
        hash = add_int(add_int(hash, cairn_block_solver_read(solver).fill),
                       cairn_block_solver_read(solver).units);
    }
    test_pool_free(&pool);
    return hash;
}

/* ---- Consensus ---- */

enum { NODES = 40 };

static cairn_pose node_of(int32_t i)
{
    int32_t row = i / 8;
    cairn_pose pose = {(cairn_real)(i % 8) * 2, (cairn_real)row * 2, (cairn_real)(i % 5)};

    return pose;
}

/* The log-likelihood of a pair at a pose: lower with the distance from the truth, for some pairs
 * 0. */
static int pairwise_likelihood(void *context, int32_t first, int32_t second,
                               cairn_pose first_second, cairn_pose_likelihood *likelihood,
                               cairn_budget *budget)
{
    cairn_pose off =
        cairn_pose_between(cairn_pose_between(node_of(first), node_of(second)), first_second);
    cairn_real distance = cairn_sqrt(off.x * off.x + off.y * off.y);

    (void)context;
    if (!cairn_budget_charge(budget, &likelihood->units_charged, 3))
        return 0;
    if ((first + second) % 4 != 0)
        likelihood->ratio = 8 - 20 * distance;
    return 1;
}

static uint64_t agree(uint64_t hash, const cairn_pose_consensus_params *params, uint64_t seed,
                      int32_t with_likelihood, int32_t bounded)
{
    cairn_random random = cairn_random_seed(seed, 32);
    cairn_pose_consensus_result result;
    cairn_pose_consensus *c;
    int32_t count = 0;
    cairn_pool pool;

    LONG_CREATE(&pool, pose_consensus, &c, params);
    assert_ok(cairn_pose_consensus_clear(c, NODES));
    for (int32_t i = 0; i < NODES; i++)
        for (int32_t k = 0; k < 9; k++) {
            static const int32_t apart[9] = {1, 8, 7, 1, 8, 9, 5, 2, 8};
            int32_t j = i + apart[k];
            cairn_pose_consensus_relative_pose h = {
                .first = i, .second = j, .score = 3 + cairn_random_unit(&random) * 6};
            cairn_pose seen;

            if (j >= NODES || (i < 20 && j >= 20 && i > 16))
                continue;
            seen = cairn_pose_between(node_of(i), node_of(j));
            if (k > 2 && k < 7)
                seen = long_disturbed(&random, seen, 3, 3);
            else if (k >= 7)
                seen = cairn_pose_between(node_of(i), node_of((j + 8) % NODES));
            h.first_second = long_disturbed(&random, seen, CAIRN_REAL(0.05), CAIRN_REAL(0.02));
            h.covariance[0] = h.covariance[4] = CAIRN_REAL(0.001);
            h.covariance[8] = CAIRN_REAL(0.0002);
            if ((i + k) % 13 == 0)
                h.covariance[0] = 100; /* a corridor: unobservable along it */
            if (cairn_pose_consensus_add(c, &h, NULL) == CAIRN_OK)
                count++;
        }
    cairn_pose_consensus_set_pair_likelihood(c, with_likelihood ? pairwise_likelihood : NULL, NULL);
    for (int32_t i = 0; i < NODES && bounded; i += 6)
        assert_ok(cairn_pose_consensus_set_bound(c, i, node_of(i), 1, CAIRN_REAL(0.6)));
    for (int32_t again = 0; again < 2; again++) {
        assert_ok(cairn_pose_consensus_begin(c));
        LONG_RUN(hash, cairn_pose_consensus_step, c, 1000);
    }
    result = cairn_pose_consensus_read(c);
    hash = add_real(add_real(hash, result.total), result.competing_total);
    hash =
        add_int(add_int(add_int(add_int(hash, result.placed), result.components), result.ambiguous),
                result.start);
    hash = add_int(add_int(add_int(add_int(hash, result.starts), result.rounds), result.inliers),
                   result.units);
    for (int32_t i = 0; i < NODES; i++) {
        cairn_pose_consensus_estimate node = cairn_pose_consensus_node(c, i);

        hash =
            add_real(add_covariance(add_pose(hash, node.map_node), node.covariance), node.support);
        hash = add_int(add_int(add_int(hash, node.component), node.agreeing), node.conflicting);
        hash = add_int(add_int(hash, node.alternatives), node.ambiguous);
        for (int32_t k = 0; k < node.alternatives; k++) {
            cairn_pose_consensus_competing_pose other = cairn_pose_consensus_alternative(c, i, k);

            hash = add_real(add_real(add_pose(hash, other.map_node), other.support), other.weight);
            hash = add_int(hash, other.is_other_map);
        }
    }
    for (int32_t i = 0; i < count; i++)
        hash = add_int(hash, cairn_pose_consensus_is_inlier(c, i));
    test_pool_free(&pool);
    return hash;
}

uint64_t long_consensus(void)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    uint64_t hash = GOLDEN_START;

    params.max_nodes = NODES;
    params.max_hypotheses = 9 * NODES;
    hash = agree(hash, &params, 53, 0, 0);
    hash = agree(hash, &params, 54, 1, 0);
    hash = agree(hash, &params, 55, 0, 1);
    params.max_hypotheses = 150;
    params.max_starts = 3;
    params.max_rounds = 2;
    params.max_candidates = 3;
    params.max_alternatives = 4;
    params.max_chi2 = 6;
    params.conflict_penalty = CAIRN_REAL(0.6);
    params.min_support = 5;
    params.min_ambiguous_weight = CAIRN_REAL(0.001);
    hash = agree(hash, &params, 56, 0, 0);
    return agree(hash, &params, 57, 1, 1);
}

/* ---- Particles ---- */

/* A random walk on a ring; the distance to a beacon is measured. */
typedef struct walk {
    cairn_random random;
    cairn_real seen;
    uint64_t reports;
} walk;

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    walk *w = context;
    cairn_vec2 at = *(const cairn_vec2 *)cairn_particle_filter_particle(filter, index).state;
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < 5 && status == CAIRN_OK; i++) {
        cairn_real x = cairn_random_normal(&w->random), y = cairn_random_normal(&w->random);
        cairn_vec2 to = {at.x + CAIRN_REAL(0.25) + x / 8, at.y + y / 8};

        budget->left--;
        status = cairn_particle_filter_offer(filter, &to, -(x * x + y * y) / 2);
        if (status == CAIRN_FULL) /* which the trace counts */
            status = CAIRN_OK;
    }
    return status;
}

static cairn_status weigh(void *context, const cairn_particle_filter *filter, int32_t index,
                          const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    static const cairn_vec2 beacon = {2, 1};
    const walk *w = context;
    cairn_real off =
        (cairn_vec2_norm(cairn_vec2_sub(*(const cairn_vec2 *)state, beacon)) - w->seen) * 12;

    (void)filter;
    (void)index;
    budget->left--;
    *log_likelihood = -off * off / 2;
    return CAIRN_OK;
}

static cairn_status discard(void *context, const cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    walk *w = context;

    (void)filter;
    (void)budget;
    w->reports = add_int(w->reports, index);
    return CAIRN_OK;
}

static void append(void *context, const cairn_particle_filter *filter, int32_t index, void *state)
{
    walk *w = context;

    (void)filter;
    w->reports = add_point(add_int(w->reports, index), *(cairn_vec2 *)state);
}

static uint64_t follow(uint64_t hash, const cairn_particle_filter_params *params)
{
    walk w = {cairn_random_seed(58, 33), 0, GOLDEN_START};
    cairn_particle_filter_model model = {&w, propose, weigh, append, discard};
    cairn_vec2 truth = {0, 0}, beacon = {2, 1};
    cairn_particle_filter *filter;
    cairn_pool pool = test_pool(cairn_particle_filter_memory(params));

    assert_ok(cairn_particle_filter_create(&filter, &pool, params, &model));
    assert_ok(cairn_particle_filter_clear(filter, 5));
    for (int32_t i = 0; i < params->particles; i++) {
        cairn_vec2 start = long_point(&w.random, CAIRN_REAL(0.5), CAIRN_REAL(0.5));

        assert_ok(cairn_particle_filter_start(filter, &start, -(cairn_real)(i % 4) / 4));
    }
    for (int32_t step = 0; step < 20; step++) {
        cairn_particle_filter_trace t;

        truth.x += CAIRN_REAL(0.25);
        w.seen =
            cairn_vec2_norm(cairn_vec2_sub(truth, beacon)) + cairn_random_normal(&w.random) / 12;
        assert_ok(cairn_particle_filter_begin(filter));
        LONG_RUN(hash, cairn_particle_filter_step, filter, 50);
        t = cairn_particle_filter_read(filter);
        hash = add_real(add_real(hash, t.n_eff), t.log_evidence);
        hash = add_int(add_int(add_int(add_int(hash, t.resamplings), t.particles), t.best),
                       t.candidates);
        hash = add_int(
            add_int(add_int(add_int(hash, t.dropped_candidates), t.followers), t.pruned_followers),
            t.particles_without_follower);
        hash = add_int(add_int(add_int(add_int(hash, t.depleted), t.resampled), t.blocks),
                       t.blocks_peak);
    }
    for (int32_t i = 0; i < cairn_particle_filter_count(filter); i++) {
        cairn_particle p = cairn_particle_filter_particle(filter, i);

        hash = add_int(add_real(add_real(hash, p.log_weight), p.log_likelihood), p.steps);
        for (const void *state = p.state; state != NULL;
             state = cairn_particle_filter_state_before(state))
            hash = add_point(hash, *(const cairn_vec2 *)state);
    }
    test_pool_free(&pool);
    return hash ^ w.reports;
}

uint64_t long_particles(void)
{
    cairn_particle_filter_params params = cairn_particle_filter_default();
    uint64_t hash = GOLDEN_START;

    params.state_bytes = sizeof(cairn_vec2);
    params.particles = 20;
    params.max_particles = 30;
    params.max_followers = 4;
    params.max_candidates = 90;
    params.max_blocks = 3000;
    params.resample_ratio = CAIRN_REAL(0.5);
    for (int32_t k = 0; k < 4; k++) {
        params.proposal = k % 2;
        params.adaptive_followers = k / 2;
        params.resample_ratio = k == 0 ? CAIRN_REAL(0.5) : 1;
        hash = follow(hash, &params);
    }
    return hash;
}
