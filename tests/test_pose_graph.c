/* Pose graphs: minima compared with numeric gradients, covariances with a dense inverse; starts,
 * kernels, fixed poses, components; refusals and budgets. */
#include "tests/test.h"

#include <math.h>

#include "cairn/pose_graph.h"

enum { SIDE = 5, POSES = SIDE * SIDE, MAX_LINKS = 200, ROWS = 3 * POSES };

struct measurement {
    int32_t first, second;
    cairn_pose z;
    cairn_sym3 information;
};

struct problem {
    int32_t poses, links;
    cairn_pose truth[POSES], guess[POSES];
    struct measurement link[MAX_LINKS];
};

static cairn_pose noisy(cairn_pose pose, double distance, double angle, cairn_random *random)
{
    cairn_real x = cairn_random_normal(random), y = cairn_random_normal(random),
               theta = cairn_random_normal(random);

    pose.x += (cairn_real)distance * x;
    pose.y += (cairn_real)distance * y;
    pose.theta = cairn_wrap_angle(pose.theta + (cairn_real)angle * theta);
    return pose;
}

static void measure(struct problem *p, int32_t a, int32_t b, double noise, cairn_random *random)
{
    struct measurement *m = &p->link[p->links++];

    assert_true(p->links <= MAX_LINKS);
    m->first = a;
    m->second = b;
    m->z = noisy(cairn_pose_between(p->truth[a], p->truth[b]), noise, noise, random);
    m->information.xx = 100 + cairn_random_uniform(random, 0, 300);
    m->information.yy = 100 + cairn_random_uniform(random, 0, 300);
    m->information.zz = 200 + cairn_random_uniform(random, 0, 300);
    m->information.xy = cairn_random_uniform(random, -60, 60);
    m->information.xz = cairn_random_uniform(random, -60, 60);
    m->information.yz = cairn_random_uniform(random, -60, 60);
}

/* A robot that traverses a grid row by row, there and back, and sees the row below. */
static struct problem a_problem(uint64_t seed, double noise)
{
    cairn_random random = cairn_random_seed(seed, 0);
    static struct problem p;

    p.poses = POSES;
    p.links = 0;
    for (int32_t i = 0; i < POSES; i++) {
        int32_t row = i / SIDE, column = row % 2 == 0 ? i % SIDE : SIDE - 1 - i % SIDE;

        p.truth[i].x = (cairn_real)column + CAIRN_REAL(0.5);
        p.truth[i].y = (cairn_real)row - 2;
        p.truth[i].theta = cairn_wrap_angle(CAIRN_REAL(2.4) * (cairn_real)i);
    }
    p.guess[0] = p.truth[0];
    for (int32_t i = 1; i < POSES; i++) {
        measure(&p, i - 1, i, noise, &random);
        p.guess[i] = cairn_pose_compose(p.guess[i - 1], p.link[p.links - 1].z);
    }
    for (int32_t i = SIDE; i < POSES; i++)
        measure(&p, i, i / SIDE * SIDE - 1 - i % SIDE, noise, &random);
    return p;
}

static cairn_pose_graph_params small_params(void)
{
    cairn_pose_graph_params params = cairn_pose_graph_default();

    params.max_poses = POSES;
    params.max_links = MAX_LINKS;
    params.max_fill = 400;
    return params;
}

struct made {
    cairn_pool pool;
    cairn_pose_graph *graph;
};

static void add_problem(cairn_pose_graph *graph, const struct problem *p)
{
    for (int32_t i = 0; i < p->poses; i++)
        assert_ok(cairn_pose_graph_add_pose(graph, p->guess[i]));
    for (int32_t l = 0; l < p->links; l++) {
        cairn_sym3 information, given = p->link[l].information;
        cairn_pose z;

        assert_ok(cairn_pose_graph_add_link(graph, p->link[l].first, p->link[l].second,
                                            p->link[l].z, given));
        z = cairn_pose_graph_measurement(graph, l, &information);
        assert_memory_equal(&z, &p->link[l].z, sizeof z);
        assert_near(information.xx, given.xx, 1e-5 * (double)given.xx);
        assert_near(information.xy, given.xy, 1e-5 * (double)given.xx);
        assert_near(information.xz, given.xz, 1e-5 * (double)given.xx);
        assert_near(information.yy, given.yy, 1e-5 * (double)given.yy);
        assert_near(information.yz, given.yz, 1e-5 * (double)given.yy);
        assert_near(information.zz, given.zz, 1e-5 * (double)given.zz);
    }
}

static struct made make_graph(const struct problem *p, const cairn_pose_graph_params *params,
                              const cairn_pose_graph_solver *solver)
{
    struct made made;

    made.pool = test_pool(cairn_pose_graph_memory(params, solver));
    assert_ok(cairn_pose_graph_create(&made.graph, &made.pool, params, solver));
    add_problem(made.graph, p);
    return made;
}

static cairn_status run(cairn_pose_graph *graph, int32_t units)
{
    for (;;) {
        cairn_budget budget = {units};
        cairn_status status = cairn_pose_graph_step(graph, &budget);

        assert_true(budget.left >= 0);
        if (status != CAIRN_MORE)
            return status;
        assert_int_equal(budget.left, 0);
    }
}

static cairn_pose_graph_state solve(cairn_pose_graph *graph)
{
    assert_ok(cairn_pose_graph_solve(graph));
    assert_ok(run(graph, CAIRN_UNBOUNDED));
    return cairn_pose_graph_read(graph);
}

/* ---- The reference implementation ---- */

struct reference {
    double x[POSES][3];
};

static struct reference reference_of(const cairn_pose_graph *graph, int32_t poses)
{
    struct reference t;

    memset(&t, 0, sizeof t);
    for (int32_t i = 0; i < poses; i++) {
        cairn_pose pose = cairn_pose_graph_pose(graph, i);

        t.x[i][0] = (double)pose.x;
        t.x[i][1] = (double)pose.y;
        t.x[i][2] = (double)pose.theta;
    }
    return t;
}

/* z^-1 (a^-1 b) as in g2o. */
static void reference_error(const struct reference *t, const struct measurement *m, double e[3])
{
    const double *a = t->x[m->first], *b = t->x[m->second];
    double dx = b[0] - a[0], dy = b[1] - a[1], c = cos(a[2]), s = sin(a[2]);
    double u = c * dx + s * dy - (double)m->z.x, v = -s * dx + c * dy - (double)m->z.y;
    double cz = cos((double)m->z.theta), sz = sin((double)m->z.theta);

    e[0] = cz * u + sz * v;
    e[1] = -sz * u + cz * v;
    e[2] = remainder(b[2] - a[2] - (double)m->z.theta, 2 * 3.14159265358979323846);
}

static void reference_information(const struct measurement *m, double w[3][3])
{
    w[0][0] = (double)m->information.xx;
    w[1][1] = (double)m->information.yy;
    w[2][2] = (double)m->information.zz;
    w[0][1] = w[1][0] = (double)m->information.xy;
    w[0][2] = w[2][0] = (double)m->information.xz;
    w[1][2] = w[2][1] = (double)m->information.yz;
}

static double reference_chi2(const struct reference *t, const struct measurement *m)
{
    double e[3], w[3][3], sum = 0;

    reference_error(t, m, e);
    reference_information(m, w);
    for (int k = 0; k < 9; k++)
        sum += e[k / 3] * w[k / 3][k % 3] * e[k % 3];
    return sum;
}

static double reference_rho(cairn_pose_graph_kernel kernel, double c, double s)
{
    double c2 = c * c;

    switch (kernel) {
    case CAIRN_POSE_GRAPH_HUBER:
        return s <= c2 ? s : 2 * c * sqrt(s) - c2;
    case CAIRN_POSE_GRAPH_CAUCHY:
        return c2 * log1p(s / c2);
    case CAIRN_POSE_GRAPH_GEMAN_MCCLURE:
        return s * c2 / (s + c2);
    case CAIRN_POSE_GRAPH_DCS:
        return s <= c2 ? s : c2 * (3 * s - c2) / (s + c2);
    default:
        return s;
    }
}

static double reference_cost(const struct reference *t, const struct problem *p,
                             const cairn_pose_graph_params *params)
{
    double sum = 0;

    for (int32_t l = 0; l < p->links; l++)
        sum += reference_rho(params->kernel, (double)params->kernel_width,
                             reference_chi2(t, &p->link[l]));
    return sum;
}

/* The gradient vanishes at all free poses, compared with the gradient of a single link. */
static void assert_minimum(const struct made *made, const struct problem *p,
                           const cairn_pose_graph_params *params, const int32_t *fixed)
{
    struct reference t = reference_of(made->graph, p->poses);
    double h = NUMBER(1e-5, 1e-3);

    for (int32_t i = 0; i < 3 * p->poses; i++) {
        struct reference up = t, down = t;

        if (fixed[i / 3])
            continue;
        up.x[i / 3][i % 3] += h;
        down.x[i / 3][i % 3] -= h;
        assert_near((reference_cost(&up, p, params) - reference_cost(&down, p, params)) / (2 * h),
                    0, NUMBER(2e-2, 3));
    }
}

static const int32_t FIRST_FIXED[POSES] = {1};

static void assert_state(const struct made *made, const struct problem *p,
                         const cairn_pose_graph_params *params)
{
    cairn_pose_graph_state state = cairn_pose_graph_read(made->graph);
    struct reference t = reference_of(made->graph, p->poses);
    double chi2 = 0;
    int32_t outliers = 0;

    for (int32_t l = 0; l < p->links; l++) {
        cairn_pose_graph_link link = cairn_pose_graph_link_of(made->graph, l);
        double s = reference_chi2(&t, &p->link[l]), c = (double)params->kernel_width,
               step = 1e-6 * (s + 1);

        chi2 += s;
        outliers += s > (double)params->max_chi2;
        assert_int_equal(link.first, p->link[l].first);
        assert_int_equal(link.second, p->link[l].second);
        assert_int_equal(link.is_outlier, s > (double)params->max_chi2);
        assert_near(link.chi2, s, NUMBER(1e-8, 2e-2) * (1 + s));
        assert_near(
            link.weight,
            (reference_rho(params->kernel, c, s + step) - reference_rho(params->kernel, c, s)) /
                step,
            NUMBER(1e-4, 1e-2));
    }
    assert_near(state.chi2, chi2, NUMBER(1e-9, 1e-2) * (1 + chi2));
    assert_near(state.cost, reference_cost(&t, p, params), NUMBER(1e-9, 1e-2) * (1 + chi2));
    assert_int_equal(state.outliers, outliers);
    assert_int_equal(state.poses, p->poses);
    assert_int_equal(state.links, p->links);
}

/* ---- Minima ---- */

static void every_kernel_finds_its_minimum(void **state)
{
    struct problem p = a_problem(1, 0.08);

    (void)state;
    for (int32_t kernel = CAIRN_POSE_GRAPH_SQUARE; kernel <= CAIRN_POSE_GRAPH_DCS; kernel++)
        for (int32_t start = CAIRN_POSE_GRAPH_GIVEN; start <= CAIRN_POSE_GRAPH_BEST; start++) {
            cairn_pose_graph_params params = small_params();
            cairn_pose_graph_state s;
            struct made made;

            params.kernel = kernel;
            params.start = start;
            params.kernel_width = 2;
            params.max_iterations = 1000;
            params.converged_decrease = NUMBER(1e-12, 1e-5f);
            made = make_graph(&p, &params, NULL);
            s = solve(made.graph);
            assert_int_equal(s.verdict, CAIRN_POSE_GRAPH_CONVERGED);
            assert_int_equal(s.pose, -1);
            assert_true(s.cost < CAIRN_REAL(0.9) * s.cost_initial);
            assert_true(s.chi2_initial >= s.cost_initial);
            if (start != CAIRN_POSE_GRAPH_BEST)
                assert_int_equal(s.chordal, start == CAIRN_POSE_GRAPH_CHORDAL);
            assert_minimum(&made, &p, &params, FIRST_FIXED);
            assert_state(&made, &p, &params);
            test_pool_free(&made.pool);
        }
}

/* From poses that are all wrong: the chordal start needs none; a given one that is right is
 * kept. */
static void chordal_start_needs_no_guess(void **state)
{
    struct problem p = a_problem(2, 0);
    cairn_pose_graph_params params = small_params();
    cairn_pose_graph_state s;
    struct made made;

    (void)state;
    for (int32_t i = 1; i < POSES; i++)
        p.guess[i] = cairn_pose_identity();
    made = make_graph(&p, &params, NULL);
    s = solve(made.graph);
    assert_int_equal(s.verdict, CAIRN_POSE_GRAPH_CONVERGED);
    assert_int_equal(s.chordal, 1);
    assert_in_range(s.iterations, 1, 3);
    for (int32_t i = 0; i < POSES; i++) {
        cairn_pose pose = cairn_pose_graph_pose(made.graph, i);

        assert_near(pose.x, p.truth[i].x, NUMBER(1e-9, 1e-3));
        assert_near(pose.y, p.truth[i].y, NUMBER(1e-9, 1e-3));
        assert_near(cairn_wrap_angle(pose.theta - p.truth[i].theta), 0, NUMBER(1e-9, 1e-4));
    }
    s = solve(made.graph);
    assert_in_range(s.iterations, 1, 2);
    assert_true(s.chi2_initial < CAIRN_REAL(1e-3));
    test_pool_free(&made.pool);
}

/* With outliers the chordal start is bad: BEST takes the given one, and the kernel identifies
 * them. */
static void outliers_are_named(void **state)
{
    struct problem p = a_problem(3, 0.02);
    cairn_random random = cairn_random_seed(30, 0);
    cairn_pose_graph_params params = small_params();
    int32_t good = p.links;
    cairn_pose_graph_state s;
    struct made made;

    (void)state;
    for (int k = 0; k < 20; k++) {
        int32_t a = cairn_random_below(&random, POSES);

        measure(&p, a, (a + 4 + cairn_random_below(&random, POSES - 8)) % POSES, 3, &random);
    }
    params.kernel = CAIRN_POSE_GRAPH_GEMAN_MCCLURE;
    made = make_graph(&p, &params, NULL);
    s = solve(made.graph);
    assert_int_equal(s.chordal, 0);
    assert_int_equal(s.outliers, 20);
    for (int32_t l = 0; l < p.links; l++)
        assert_int_equal(cairn_pose_graph_link_of(made.graph, l).is_outlier, l >= good);
    assert_minimum(&made, &p, &params, FIRST_FIXED);

    /* Without the outliers: least squares of the others. */
    for (int32_t l = good; l < p.links; l++)
        assert_ok(cairn_pose_graph_exclude_link(made.graph, l, 1));
    assert_ok(cairn_pose_graph_set_kernel(made.graph, CAIRN_POSE_GRAPH_SQUARE, 1));
    s = solve(made.graph);
    assert_int_equal(s.outliers, 20);
    assert_int_equal(cairn_pose_graph_link_of(made.graph, good).is_excluded, 1);
    assert_near(cairn_pose_graph_link_of(made.graph, good).weight, 0, 0);
    assert_int_equal(cairn_pose_graph_link_of(made.graph, 0).is_excluded, 0);
    params.kernel = CAIRN_POSE_GRAPH_SQUARE;
    p.links = good;
    assert_minimum(&made, &p, &params, FIRST_FIXED);
    assert_near(
        s.chi2,
        reference_cost(&(struct reference[]){reference_of(made.graph, POSES)}[0], &p, &params),
        NUMBER(1e-6, 1));
    assert_ok(cairn_pose_graph_exclude_link(made.graph, good, 0));
    assert_true(solve(made.graph).chi2 > 10 * s.chi2);
    test_pool_free(&made.pool);
}

/* Graduated: a drifting chain is consistent with itself; the kernel alone keeps it and takes the
 * rows' links for outliers. */
static void graduated_widens_the_reach(void **state)
{
    struct problem p = a_problem(4, 0);
    cairn_pose_graph_params params = small_params();
    cairn_pose_graph_state plain, graduated;
    struct made made;

    (void)state;
    for (int32_t i = 1; i < POSES; i++) {
        p.link[i - 1].z.theta = cairn_wrap_angle(p.link[i - 1].z.theta + CAIRN_REAL(0.15));
        p.guess[i] = cairn_pose_compose(p.guess[i - 1], p.link[i - 1].z);
    }
    params.start = CAIRN_POSE_GRAPH_GIVEN;
    params.kernel = CAIRN_POSE_GRAPH_GEMAN_MCCLURE;
    made = make_graph(&p, &params, NULL);
    plain = solve(made.graph);
    test_pool_free(&made.pool);
    params.graduated = 1;
    made = make_graph(&p, &params, NULL);
    graduated = solve(made.graph);
    assert_true(plain.outliers > 5);
    assert_in_range(graduated.outliers, 0, NUMBER(1, 8));
    assert_true(graduated.cost < plain.cost);
    assert_int_equal(graduated.verdict, CAIRN_POSE_GRAPH_CONVERGED);
    assert_minimum(&made, &p, &params, FIRST_FIXED);
    test_pool_free(&made.pool);
}

static void fixed_poses_stay(void **state)
{
    struct problem p = a_problem(5, 0.05);
    cairn_pose_graph_params params = small_params();
    int32_t fixed[POSES] = {0};
    struct made made = make_graph(&p, &params, NULL);
    cairn_real block[9];

    (void)state;
    fixed[7] = fixed[20] = 1;
    p.guess[20] = noisy(p.truth[20], 0.1, 0.1, &(cairn_random[]){cairn_random_seed(9, 0)}[0]);
    assert_ok(cairn_pose_graph_set_pose(made.graph, 20, p.guess[20]));
    assert_ok(cairn_pose_graph_fix(made.graph, 7, 1));
    assert_ok(cairn_pose_graph_fix(made.graph, 7, 5));
    assert_ok(cairn_pose_graph_fix(made.graph, 20, 1));
    assert_ok(cairn_pose_graph_fix(made.graph, 3, 1));
    assert_ok(cairn_pose_graph_fix(made.graph, 3, 0));
    assert_int_equal(solve(made.graph).verdict, CAIRN_POSE_GRAPH_CONVERGED);
    for (int32_t i = 7; i <= 20; i += 13) {
        cairn_pose pose = cairn_pose_graph_pose(made.graph, i);

        assert_memory_equal(&pose, &p.guess[i], sizeof pose);
    }
    assert_minimum(&made, &p, &params, fixed);
    assert_ok(cairn_pose_graph_marginals(made.graph));
    assert_ok(run(made.graph, CAIRN_UNBOUNDED));
    assert_ok(cairn_pose_graph_covariance(made.graph, 7, 8, block));
    for (int k = 0; k < 9; k++)
        assert_near(block[k], 0, 0);
    assert_ok(cairn_pose_graph_covariance(made.graph, 0, 0, block));
    assert_true(block[0] > CAIRN_REAL(1e-4));
    /* All but the first are free again. */
    assert_ok(cairn_pose_graph_fix(made.graph, 7, 0));
    assert_ok(cairn_pose_graph_fix(made.graph, 20, 0));
    (void)solve(made.graph);
    assert_minimum(&made, &p, &params, FIRST_FIXED);
    test_pool_free(&made.pool);
}

/* ---- Covariances ---- */

/* The inverse of J^T Omega J of numeric derivatives, without the first pose. */
static void dense_covariance(const struct reference *t, const struct problem *p,
                             double (*inverse)[ROWS])
{
    static double h[ROWS][2 * ROWS];
    int32_t n = 3 * p->poses - 3;

    memset(h, 0, sizeof h);
    for (int32_t l = 0; l < p->links; l++) {
        const struct measurement *m = &p->link[l];
        double w[3][3], j[6][3];

        reference_information(m, w);
        for (int k = 0; k < 6; k++) {
            struct reference up = *t, down = *t;
            int32_t pose = k < 3 ? m->first : m->second;
            double plus[3], minus[3];

            up.x[pose][k % 3] += 1e-6;
            down.x[pose][k % 3] -= 1e-6;
            reference_error(&up, m, plus);
            reference_error(&down, m, minus);
            for (int r = 0; r < 3; r++)
                j[k][r] = (plus[r] - minus[r]) / 2e-6;
        }
        for (int k = 0; k < 36; k++) {
            int32_t a = 3 * (k / 6 < 3 ? m->first : m->second) + k / 6 % 3 - 3;
            int32_t b = 3 * (k % 6 < 3 ? m->first : m->second) + k % 6 % 3 - 3;

            for (int r = 0; r < 9 && a >= 0 && b >= 0; r++)
                h[a][b] += j[k / 6][r / 3] * w[r / 3][r % 3] * j[k % 6][r % 3];
        }
    }
    for (int32_t i = 0; i < n; i++)
        h[i][n + i] = 1;
    for (int32_t i = 0; i < n; i++) {
        double pivot = h[i][i];

        for (int32_t c = 0; c < 2 * n; c++)
            h[i][c] /= pivot;
        for (int32_t r = 0; r < n; r++) {
            double f = h[r][i];

            for (int32_t c = 0; c < 2 * n && r != i; c++)
                h[r][c] -= f * h[i][c];
        }
    }
    for (int32_t i = 0; i < n; i++)
        for (int32_t c = 0; c < n; c++)
            inverse[3 + i][3 + c] = h[i][n + c];
}

static void covariances_are_those_of_the_dense_inverse(void **state)
{
    static double inverse[ROWS][ROWS];
    struct problem p = a_problem(6, 0.03);
    cairn_pose_graph_params params = small_params();
    struct made made = make_graph(&p, &params, NULL);
    struct reference t;
    cairn_real block[9];
    int32_t unsupported = 0;

    (void)state;
    assert_status(cairn_pose_graph_marginals(made.graph), CAIRN_BAD_ARGUMENT);
    (void)solve(made.graph);
    assert_status(cairn_pose_graph_covariance(made.graph, 1, 1, block), CAIRN_EMPTY);
    assert_ok(cairn_pose_graph_marginals(made.graph));
    assert_status(cairn_pose_graph_marginals(made.graph), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_graph_covariance(made.graph, 1, 1, block), CAIRN_EMPTY);
    assert_ok(run(made.graph, 10));
    t = reference_of(made.graph, POSES);
    dense_covariance(&t, &p, inverse);
    for (int32_t i = 1; i < POSES; i++)
        for (int32_t j = 1; j < POSES; j++) {
            cairn_status status = cairn_pose_graph_covariance(made.graph, i, j, block);

            if (status == CAIRN_UNSUPPORTED) {
                unsupported++;
                continue;
            }
            assert_ok(status);
            for (int k = 0; k < 9; k++)
                assert_near(block[k], inverse[3 * i + k / 3][3 * j + k % 3],
                            NUMBER(1e-7, 1e-3) * inverse[ROWS - 1][ROWS - 1] + NUMBER(1e-9, 1e-5));
        }
    assert_true(unsupported > 0);
    for (int32_t l = 0; l < p.links; l++)
        assert_ok(
            cairn_pose_graph_covariance(made.graph, p.link[l].first, p.link[l].second, block));
    /* Invalid after the first change. */
    assert_ok(cairn_pose_graph_set_pose(made.graph, 4, p.truth[4]));
    assert_status(cairn_pose_graph_covariance(made.graph, 1, 1, block), CAIRN_EMPTY);
    assert_status(cairn_pose_graph_marginals(made.graph), CAIRN_BAD_ARGUMENT);
    test_pool_free(&made.pool);
}

/* ---- Components, capacities, a custom solver ---- */

/* Covariances are valid from the end of marginals() to the next solve() or marginals(). */
static void covariances_are_of_the_last_poses(void **state)
{
    struct problem p = a_problem(13, 0.05);
    cairn_pose_graph_params params = small_params();
    struct made made = make_graph(&p, &params, NULL);
    cairn_pose_graph_link link = cairn_pose_graph_link_of(made.graph, 3);
    cairn_budget little = {2};
    cairn_real block[9];

    (void)state;
    assert_near(link.weight, 1, 0); /* nothing solved yet */
    assert_near(link.chi2, 0, 0);
    assert_int_equal(link.is_outlier, 0);
    assert_int_equal(link.is_excluded, 0);
    assert_status(cairn_pose_graph_covariance(made.graph, 1, 1, block), CAIRN_EMPTY);
    (void)solve(made.graph);
    assert_status(cairn_pose_graph_covariance(made.graph, 1, 1, block), CAIRN_EMPTY);
    for (int round = 0; round < 2; round++) {
        assert_ok(cairn_pose_graph_marginals(made.graph));
        assert_status(cairn_pose_graph_covariance(made.graph, 1, 1, block), CAIRN_EMPTY);
        assert_status(cairn_pose_graph_step(made.graph, &little), CAIRN_MORE);
        assert_status(cairn_pose_graph_covariance(made.graph, 1, 1, block), CAIRN_EMPTY);
        assert_ok(run(made.graph, CAIRN_UNBOUNDED));
        assert_ok(cairn_pose_graph_covariance(made.graph, 1, 1, block));
        little.left = 2;
    }
    assert_ok(cairn_pose_graph_solve(made.graph));
    assert_status(cairn_pose_graph_covariance(made.graph, 1, 1, block), CAIRN_EMPTY);
    assert_ok(run(made.graph, CAIRN_UNBOUNDED));
    assert_status(cairn_pose_graph_covariance(made.graph, 1, 1, block), CAIRN_EMPTY);
    test_pool_free(&made.pool);
}

static void components_are_counted(void **state)
{
    struct problem p = a_problem(7, 0.05);
    cairn_pose_graph_params params = small_params();
    cairn_pose_graph_state s;
    struct made made;

    (void)state;
    p.links = 12; /* of the chain: poses 0 ... 12 */
    made = make_graph(&p, &params, NULL);
    s = solve(made.graph);
    assert_int_equal(s.verdict, CAIRN_POSE_GRAPH_DISCONNECTED);
    assert_int_equal(s.pose, 13);
    assert_status(cairn_pose_graph_marginals(made.graph), CAIRN_BAD_ARGUMENT);
    for (int32_t i = 13; i < POSES; i++)
        assert_ok(cairn_pose_graph_fix(made.graph, i, 1));
    s = solve(made.graph); /* a fixed pose elsewhere frees the first */
    assert_int_equal(s.pose, 0);
    assert_ok(cairn_pose_graph_fix(made.graph, 5, 1));
    s = solve(made.graph);
    assert_int_equal(s.verdict, CAIRN_POSE_GRAPH_CONVERGED);
    assert_ok(cairn_pose_graph_exclude_link(made.graph, 8, 1));
    s = solve(made.graph);
    assert_int_equal(s.verdict, CAIRN_POSE_GRAPH_DISCONNECTED);
    assert_int_equal(s.pose, 9);
    test_pool_free(&made.pool);
}

static void too_much_fill_is_reported(void **state)
{
    struct problem p = a_problem(8, 0.05);
    cairn_pose_graph_params params = small_params();
    cairn_pose_graph_state s;
    struct made made;
    int32_t fill;

    (void)state;
    made = make_graph(&p, &params, NULL);
    fill = solve(made.graph).fill;
    test_pool_free(&made.pool);
    params.max_fill = fill - 1;
    made = make_graph(&p, &params, NULL);
    for (int k = 0; k < 2; k++) {
        assert_ok(cairn_pose_graph_solve(made.graph));
        assert_status(run(made.graph, 3), CAIRN_FULL);
        s = cairn_pose_graph_read(made.graph);
        assert_int_equal(s.fill, fill);
        assert_int_equal(s.verdict, CAIRN_POSE_GRAPH_RUNNING);
    }
    test_pool_free(&made.pool);
    params.max_fill = fill;
    made = make_graph(&p, &params, NULL);
    assert_int_equal(solve(made.graph).verdict, CAIRN_POSE_GRAPH_CONVERGED);
    assert_int_equal(solve(made.graph).fill, fill);
    test_pool_free(&made.pool);
}

static int graphs_are_equal(const cairn_pose_graph *a, const cairn_pose_graph *b, int32_t poses)
{
    cairn_pose_graph_state s = cairn_pose_graph_read(a), t = cairn_pose_graph_read(b);

    for (int32_t i = 0; i < poses; i++) {
        cairn_pose p = cairn_pose_graph_pose(a, i), q = cairn_pose_graph_pose(b, i);

        if (memcmp(&p, &q, sizeof p) != 0)
            return 0;
    }
    return memcmp(&s, &t, sizeof s) == 0;
}

/* A graph without memory for a factor takes it once the size is known, and continues to the same
 * bits; not before, not for another graph, not beside a custom solver. */
static void memory_is_taken_when_the_fill_is_known(void **state)
{
    struct problem p = a_problem(8, 0.05);
    cairn_pose_graph_params params = small_params();
    struct made whole, made;
    cairn_block_solver_params inner;
    cairn_block_solver *solver;
    cairn_pose_graph_solver face;
    cairn_pool more;
    int32_t fill;
    size_t bytes;

    (void)state;
    whole = make_graph(&p, &params, NULL);
    fill = solve(whole.graph).fill;
    bytes = cairn_block_solver_extend_memory(fill);
    params.max_fill = 0;
    made = make_graph(&p, &params, NULL);
    more = test_pool(bytes);
    assert_status(cairn_pose_graph_extend(NULL, &more, fill), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_graph_extend(made.graph, &more, fill), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_pose_graph_solve(made.graph));
    /* it runs */
    assert_status(cairn_pose_graph_extend(made.graph, &more, fill), CAIRN_BAD_ARGUMENT);
    assert_status(run(made.graph, 3), CAIRN_FULL);
    assert_ok(cairn_pose_graph_set_pose(made.graph, 1, cairn_pose_graph_pose(made.graph, 1)));
    /* it has been changed */
    assert_status(cairn_pose_graph_extend(made.graph, &more, fill), CAIRN_BAD_ARGUMENT);
    for (int k = 0; k < 2; k++) {
        cairn_pool less = test_pool(bytes - 16);

        assert_ok(cairn_pose_graph_solve(made.graph));
        assert_status(run(made.graph, 3), CAIRN_FULL);
        assert_status(cairn_pose_graph_extend(made.graph, &less, fill), CAIRN_NO_MEMORY);
        assert_status(cairn_pose_graph_extend(made.graph, &more, fill - 1), CAIRN_BAD_ARGUMENT);
        test_pool_free(&less);
    }
    assert_ok(cairn_pose_graph_extend(made.graph, &more, fill));
    assert_status(cairn_pose_graph_extend(made.graph, &more, fill), CAIRN_BAD_ARGUMENT);
    assert_ok(run(made.graph, 3));
    assert_true(
        graphs_are_equal(made.graph, whole.graph, cairn_pose_graph_read(whole.graph).poses));
    assert_status(cairn_pose_graph_extend(made.graph, &more, fill), CAIRN_BAD_ARGUMENT);
    test_pool_free(&made.pool);
    test_pool_free(&more);
    inner = (cairn_block_solver_params){
        .max_poses = params.max_poses, .max_links = params.max_links, .max_fill = 0};
    more = test_pool(cairn_block_solver_memory(&inner) + bytes);
    assert_ok(cairn_block_solver_create(&solver, &more, &inner));
    face = cairn_pose_graph_solver_of(solver);
    made = make_graph(&p, &params, &face);
    assert_ok(cairn_pose_graph_solve(made.graph));
    assert_status(run(made.graph, 3), CAIRN_FULL);
    assert_status(cairn_pose_graph_extend(made.graph, &more, fill), CAIRN_BAD_ARGUMENT);
    test_pool_free(&more);
    test_pool_free(&made.pool);
    test_pool_free(&whole.pool);
}

/* A wrapper of the built-in solver that counts, and fails on demand. */
static struct {
    cairn_pose_graph_solver inner;
    int32_t refuse_from; /* factors from this one on are not positive definite; -1: none */
    int32_t factors;
} outer;

static cairn_status outer_factor(void *context)
{
    outer.factors++;
    return outer.inner.factor(context);
}

static cairn_block_solver_result outer_read(const void *context)
{
    cairn_block_solver_result result = outer.inner.read(context);

    if (outer.refuse_from >= 0 && outer.factors > outer.refuse_from) {
        result.state = CAIRN_BLOCK_SOLVER_NOT_POSITIVE;
        result.failed_pose = 11;
    }
    return result;
}

static void a_solver_of_ones_own(void **state)
{
    struct problem p = a_problem(9, 0.05);
    cairn_pose_graph_params params = small_params();
    cairn_block_solver_params inner = {.max_poses = POSES, .max_links = MAX_LINKS, .max_fill = 400};
    cairn_block_solver *solver;
    cairn_pose_graph_solver face;
    cairn_pool pool = test_pool(cairn_block_solver_memory(&inner));
    struct made mine, builtin = make_graph(&p, &params, NULL);
    cairn_pose_graph_state s = solve(builtin.graph), t;

    (void)state;
    assert_ok(cairn_block_solver_create(&solver, &pool, &inner));
    outer.inner = face = cairn_pose_graph_solver_of(solver);
    face.factor = outer_factor;
    face.read = outer_read;
    outer.refuse_from = -1;
    /* of no use then */
    params.max_fill = 0;
    assert_true(cairn_pose_graph_memory(&params, &face) < cairn_pose_graph_memory(&params, NULL));
    mine = make_graph(&p, &params, &face);
    t = solve(mine.graph);
    assert_memory_equal(&s, &t, sizeof s);
    /* headings, poses about them, and one that was reused for all steps */
    assert_int_equal(outer.factors, 3);
    assert_true(t.iterations > NUMBER(1, 0));
    for (int32_t i = 0; i < POSES; i++) {
        cairn_pose a = cairn_pose_graph_pose(mine.graph, i),
                   b = cairn_pose_graph_pose(builtin.graph, i);

        assert_memory_equal(&a, &b, sizeof a);
    }
    outer.factors = 0; /* the covariance */
    outer.refuse_from = 0;
    assert_ok(cairn_pose_graph_marginals(mine.graph));
    assert_ok(run(mine.graph, 5));
    t = cairn_pose_graph_read(mine.graph);
    assert_int_equal(t.verdict, CAIRN_POSE_GRAPH_SINGULAR);
    assert_int_equal(t.pose, 11);
    assert_status(cairn_pose_graph_marginals(mine.graph), CAIRN_BAD_ARGUMENT);
    outer.factors = 0; /* headings, positions, then all */
    outer.refuse_from = 2;
    t = solve(mine.graph);
    assert_int_equal(t.verdict, CAIRN_POSE_GRAPH_SINGULAR);
    assert_int_equal(t.pose, 11);
    assert_in_range(outer.factors, NUMBER(8, 7), NUMBER(8, 7)); /* increasing damping first */
    assert_status(cairn_pose_graph_marginals(mine.graph), CAIRN_BAD_ARGUMENT);
    outer.factors = 0; /* headings: then from the current poses */
    outer.refuse_from = 0;
    t = solve(mine.graph);
    assert_int_equal(t.verdict, CAIRN_POSE_GRAPH_SINGULAR);
    assert_int_equal(t.chordal, 0);
    test_pool_free(&mine.pool);
    test_pool_free(&builtin.pool);
    test_pool_free(&pool);
}

/* ---- Weak motions ---- */

enum { STREET_POSES = 55, STREETS = STREET_POSES * STREET_POSES };

static cairn_pose disturbed(cairn_pose pose, cairn_real sigma, cairn_random *random)
{
    pose.x += sigma * cairn_random_normal(random);
    pose.y += sigma * cairn_random_normal(random);
    pose.theta += sigma / 2 * cairn_random_normal(random);
    return pose;
}

/* Streets in both directions, linked with the parallel street every fourth metre: large parts turn
 * at little cost. */
static void add_streets(cairn_pose_graph *graph, cairn_real sigma, uint64_t seed)
{
    const cairn_sym3 information = {100, 0, 0, 100, 0, 400};
    cairn_random random = cairn_random_seed(seed, 0);
    cairn_pose guess = cairn_pose_identity(), truth[STREETS];

    for (int32_t i = 0; i < STREETS; i++) {
        int32_t row = i / STREET_POSES,
                column = row % 2 == 0 ? i % STREET_POSES : STREET_POSES - 1 - i % STREET_POSES;

        truth[i].x = (cairn_real)column;
        truth[i].y = (cairn_real)row;
        truth[i].theta = row % 2 == 0 ? 0 : CAIRN_PI;
        if (i > 0) {
            cairn_pose step = disturbed(cairn_pose_between(truth[i - 1], truth[i]), sigma, &random);

            guess = cairn_pose_compose(guess, step);
            assert_ok(cairn_pose_graph_add_pose(graph, guess));
            assert_ok(cairn_pose_graph_add_link(graph, i - 1, i, step, information));
        } else {
            assert_ok(cairn_pose_graph_add_pose(graph, guess));
        }
        if (row > 0 && column % 4 == 0) {
            int32_t beside = row * STREET_POSES - 1 - i % STREET_POSES;

            assert_ok(cairn_pose_graph_add_link(
                graph, beside, i,
                disturbed(cairn_pose_between(truth[beside], truth[i]), sigma, &random),
                information));
        }
    }
}

/* Steps that bend such a graph raise the cost by their second order. It is solved with few factors
 * all the same, in the known number of steps, and to the same minimum as with a factor for every
 * step. */
static void weak_motions_take_few_factors(void **state)
{
    static const struct {
        uint64_t seed;
        double sigma; /* m of a link */
        int32_t factors, iterations;
    } known[] = {{2, 0.1, 4, NUMBER(8, 3)},
                 {6, 0.1, 3, NUMBER(6, 2)},
                 {9, 0.1, NUMBER(4, 3), NUMBER(7, 1)},
                 {3, 0.2, NUMBER(10, 3), NUMBER(11, 1)},
                 {9, 0.2, NUMBER(6, 4), NUMBER(9, 2)}};

    (void)state;
    for (size_t k = 0; k < sizeof known / sizeof *known; k++) {
        cairn_pose_graph_params params = cairn_pose_graph_default();
        cairn_block_solver_params inner = {
            .max_poses = STREETS, .max_links = 2 * STREETS, .max_fill = 6 * STREETS};
        cairn_pool pool = test_pool(cairn_block_solver_memory(&inner)), graphs;
        cairn_block_solver *solver;
        cairn_pose_graph *graph;
        cairn_pose_graph_state s, again;
        cairn_pose_graph_solver face;

        params.max_poses = STREETS;
        params.max_links = 2 * STREETS;
        assert_ok(cairn_block_solver_create(&solver, &pool, &inner));
        outer.inner = face = cairn_pose_graph_solver_of(solver);
        face.factor = outer_factor;
        face.read = outer_read;
        outer.refuse_from = -1;
        outer.factors = 0;
        graphs = test_pool(cairn_pose_graph_memory(&params, &face));
        assert_ok(cairn_pose_graph_create(&graph, &graphs, &params, &face));
        add_streets(graph, (cairn_real)known[k].sigma, known[k].seed);
        s = solve(graph);
        assert_int_equal(s.verdict, CAIRN_POSE_GRAPH_CONVERGED);
        assert_int_equal(s.chordal, 1);
        assert_int_equal(outer.factors, known[k].factors);
        assert_int_equal(s.iterations, known[k].iterations);
        for (int32_t i = 0; i < 3; i++) { /* no way down is left */
            again = solve(graph);
            assert_near(again.cost, s.cost, NUMBER(1e-8, 1e-4) * (double)s.cost);
        }
        test_pool_free(&graphs);
        test_pool_free(&pool);
    }
}

/* ---- Old factors ---- */

/* A wrapper of the built-in solver whose reused factor promises a false descent: it moves only the
 * coordinate of the smallest gradient, so far that the slope is 1. */
static struct {
    cairn_pose_graph_solver inner;
    int32_t solves; /* since the last factor */
    int32_t spoiled, least;
    cairn_real least_gradient;
} stale;

static cairn_status stale_factor(void *context)
{
    stale.solves = 0;
    return stale.inner.factor(context);
}

static cairn_status stale_solve(void *context, const cairn_real *b)
{
    stale.least_gradient = 0;
    for (int32_t k = 0; k < 3 * POSES; k++)
        if (b[k] != 0 &&
            (stale.least_gradient == 0 || cairn_abs(b[k]) < cairn_abs(stale.least_gradient))) {
            stale.least_gradient = b[k];
            stale.least = k;
        }
    stale.solves++;
    stale.spoiled += stale.solves == 2;
    return stale.inner.solve(context, b);
}

static cairn_status stale_solution(const void *context, int32_t pose, cairn_real x[3])
{
    if (stale.solves < 2)
        return stale.inner.solution(context, pose, x);
    x[0] = x[1] = x[2] = 0;
    if (stale.least / 3 == pose)
        x[stale.least % 3] = 1 / stale.least_gradient;
    return CAIRN_OK;
}

/* A step that hardly changes the cost is not convergence when an old factor made it: a new factor
 * continues to the minimum. */
static void old_factors_do_not_end_it(void **state)
{
    struct problem p = a_problem(9, 0.2);
    cairn_pose_graph_params params = small_params();
    cairn_block_solver_params inner = {.max_poses = POSES, .max_links = MAX_LINKS, .max_fill = 400};
    cairn_block_solver *solver;
    cairn_pose_graph_solver face;
    cairn_pool pool = test_pool(cairn_block_solver_memory(&inner));
    struct made mine, builtin = make_graph(&p, &params, NULL);
    cairn_pose_graph_state s = solve(builtin.graph), t;

    (void)state;
    assert_ok(cairn_block_solver_create(&solver, &pool, &inner));
    stale.inner = face = cairn_pose_graph_solver_of(solver);
    stale.spoiled = 0;
    face.factor = stale_factor;
    face.solve = stale_solve;
    face.solution = stale_solution;
    mine = make_graph(&p, &params, &face);
    t = solve(mine.graph);
    assert_true(stale.spoiled > 0);
    assert_int_equal(t.verdict, CAIRN_POSE_GRAPH_CONVERGED);
    assert_near(t.cost, s.cost, NUMBER(1e-8, 1e-4) * (double)s.cost);
    assert_minimum(&mine, &p, &params, FIRST_FIXED);
    test_pool_free(&mine.pool);
    test_pool_free(&builtin.pool);
    test_pool_free(&pool);
}

static void out_of_iterations(void **state)
{
    struct problem p = a_problem(10, 0.2);
    cairn_pose_graph_params params = small_params();
    struct made made;

    (void)state;
    params.max_iterations = 1;
    made = make_graph(&p, &params, NULL);
    assert_int_equal(solve(made.graph).verdict, CAIRN_POSE_GRAPH_OUT_OF_ITERATIONS);
    assert_int_equal(cairn_pose_graph_read(made.graph).iterations, 1);
    assert_ok(cairn_pose_graph_marginals(made.graph));
    test_pool_free(&made.pool);
}

/* ---- Budgets, bits ---- */

static uint64_t hash_with(int32_t units)
{
    struct problem p = a_problem(11, 0.05);
    cairn_pose_graph_params params = small_params();
    uint64_t hash = TEST_HASH_START;
    cairn_pose_graph_state s;
    struct made made;
    cairn_real block[9];

    params.kernel = CAIRN_POSE_GRAPH_CAUCHY;
    made = make_graph(&p, &params, NULL);
    assert_ok(cairn_pose_graph_solve(made.graph));
    assert_ok(run(made.graph, units));
    assert_ok(cairn_pose_graph_marginals(made.graph));
    assert_ok(run(made.graph, units));
    for (int32_t i = 0; i < POSES; i++) {
        cairn_pose pose = cairn_pose_graph_pose(made.graph, i);

        assert_ok(cairn_pose_graph_covariance(made.graph, i, i, block));
        hash = test_hash(hash, &pose, sizeof pose);
        hash = test_hash(hash, block, sizeof block);
    }
    s = cairn_pose_graph_read(made.graph);
    hash = test_hash(hash, &s, sizeof s);
    test_pool_free(&made.pool);
    return hash;
}

static void budgets_do_not_matter(void **state)
{
    uint64_t hash = hash_with(CAIRN_UNBOUNDED);

    (void)state;
    if (hash != NUMBER(UINT64_C(0xa0f6c5dd56523c92), UINT64_C(0x01b812c902065f60)))
        fail_msg("the hash is %#llx", (unsigned long long)hash);
    assert_true(hash_with(1) == hash);
    assert_true(hash_with(7) == hash);
    assert_true(hash_with(1000) == hash);
}

/* The path to the minimum: every kernel, start and width, with outliers; units, iterations,
 * weights, covariances. */
static uint64_t hash_of_path(cairn_pose_graph_params params, double noise, int32_t fixed)
{
    struct problem p = a_problem(12, noise);
    cairn_pose_graph_state s;
    struct made made;
    uint64_t hash = TEST_HASH_START;
    int64_t units = 0;

    p.link[30].z.x += 2;
    p.link[8].z.theta += 1;
    p.link[44] = p.link[30];
    p.link[44].z.y -= 1;
    p.links = p.links > 45 ? p.links : 45;
    made = make_graph(&p, &params, NULL);
    if (fixed > 0)
        assert_ok(cairn_pose_graph_fix(made.graph, fixed, 1));
    assert_ok(cairn_pose_graph_exclude_link(made.graph, 12, fixed > 0));
    for (int32_t part = 0; part < 2; part++) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        if (part == 0)
            assert_ok(cairn_pose_graph_solve(made.graph));
        else
            assert_ok(cairn_pose_graph_marginals(made.graph));
        assert_ok(cairn_pose_graph_step(made.graph, &budget));
        units += CAIRN_UNBOUNDED - budget.left;
    }
    s = cairn_pose_graph_read(made.graph);
    hash = test_hash(hash, &units, sizeof units);
    hash = test_hash(hash, &s, sizeof s);
    for (int32_t i = 0; i < p.poses; i++) {
        cairn_pose pose = cairn_pose_graph_pose(made.graph, i);

        hash = test_hash(hash, &pose, sizeof pose);
    }
    for (int32_t l = 0; l < p.links; l++) {
        cairn_pose_graph_link link = cairn_pose_graph_link_of(made.graph, l);
        cairn_real block[9];

        hash = test_hash(hash, &link, sizeof link);
        assert_ok(cairn_pose_graph_covariance(made.graph, link.first, link.second, block));
        hash = test_hash(hash, block, sizeof block);
    }
    test_pool_free(&made.pool);
    return hash;
}

static void paths_stay_as_they_are(void **state)
{
    static const struct {
        cairn_pose_graph_kernel kernel;
        cairn_pose_graph_start start;
        double width, noise;
        int32_t graduated, fixed;
        uint64_t in_double, in_float;
    } known[] = {
        {CAIRN_POSE_GRAPH_SQUARE, CAIRN_POSE_GRAPH_GIVEN, 3, 0.2, 0, 0,
         UINT64_C(0x3cac61fa0d1ca9af), UINT64_C(0xaadf9e7434b08c29)},
        {CAIRN_POSE_GRAPH_HUBER, CAIRN_POSE_GRAPH_CHORDAL, 2, 0.1, 0, 7,
         UINT64_C(0xdec1c8bca4342d0f), UINT64_C(0x07e1691f221f3bc3)},
        {CAIRN_POSE_GRAPH_CAUCHY, CAIRN_POSE_GRAPH_BEST, 1, 0.05, 0, 0,
         UINT64_C(0x886ac2b483109455), UINT64_C(0x7a4d9c921a057cbb)},
        {CAIRN_POSE_GRAPH_GEMAN_MCCLURE, CAIRN_POSE_GRAPH_GIVEN, 4, 0.1, 1, 0,
         UINT64_C(0xa2f977e9efcc0125), UINT64_C(0xbd905200c40b88eb)},
        {CAIRN_POSE_GRAPH_GEMAN_MCCLURE, CAIRN_POSE_GRAPH_BEST, 4, 0.4, 0, 20,
         UINT64_C(0xe14ba87f839d9f59), UINT64_C(0x44bb4a91157f1de7)},
        {CAIRN_POSE_GRAPH_DCS, CAIRN_POSE_GRAPH_CHORDAL, 2, 0.1, 0, 0, UINT64_C(0xfa6f8a550f9ddf62),
         UINT64_C(0xc743fc33fe41e4f6)},
    };

    (void)state;
    for (size_t k = 0; k < sizeof known / sizeof *known; k++) {
        cairn_pose_graph_params params = small_params();

        params.kernel = known[k].kernel;
        params.start = known[k].start;
        params.kernel_width = (cairn_real)known[k].width;
        params.graduated = known[k].graduated;
        assert_golden(hash_of_path(params, known[k].noise, known[k].fixed), known[k].in_double,
                      known[k].in_float);
    }
}

/* ---- Refusals ---- */

static void no_graph_and_no_pool_are_refused(void **state)
{
    const cairn_pose_graph_params good = small_params();
    cairn_pose_graph *graph = NULL;
    cairn_pool pool = test_pool(1 << 17);

    (void)state;
    assert_status(cairn_pose_graph_create(NULL, &pool, &good, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_graph_create(&graph, NULL, &good, NULL), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.used, 0);
    test_pool_free(&pool);
}

static cairn_status create_one(void *context, cairn_pool *pool)
{
    cairn_pose_graph *graph;

    return cairn_pose_graph_create(&graph, pool, context, NULL);
}

static void every_pool_size(void **state)
{
    cairn_pose_graph_params params = small_params();

    (void)state;
    params.max_poses = 3;
    params.max_links = 5;
    params.max_fill = 7;
    test_every_pool_size(create_one, &params, cairn_pose_graph_memory(&params, NULL));
}

/* Indices outside read no array: the identity, a link of no poses. */
static void indices_outside_read_nothing(void **state)
{
    static const int32_t outside[] = {-1, 1, INT32_MIN, INT32_MAX};
    const cairn_sym3 one = {1, 0, 0, 1, 0, 1};
    const cairn_pose far = {7, 8, 1};
    cairn_pose_graph_params params = small_params();
    cairn_pose_graph *graph;
    cairn_pool pool = test_pool(cairn_pose_graph_memory(&params, NULL));

    (void)state;
    assert_ok(cairn_pose_graph_create(&graph, &pool, &params, NULL));
    for (int i = 0; i < 3; i++)
        assert_ok(cairn_pose_graph_add_pose(graph, far));
    assert_ok(cairn_pose_graph_add_link(graph, 0, 1, far, one));
    assert_ok(cairn_pose_graph_add_link(graph, 1, 2, far, one));
    /* What is taken away stays behind in the arrays. */
    assert_ok(cairn_pose_graph_remove_pose(graph, 2));
    assert_ok(cairn_pose_graph_remove_pose(graph, 1));
    assert_ok(cairn_pose_graph_add_pose(graph, far));
    assert_ok(cairn_pose_graph_add_link(graph, 0, 1, far, one));
    for (int k = 0; k < 4; k++) {
        cairn_pose_graph_link link = cairn_pose_graph_link_of(graph, outside[k]);
        cairn_sym3 information = one;
        cairn_pose pose = cairn_pose_graph_measurement(graph, outside[k], &information);

        assert_int_equal(link.first, -1);
        assert_int_equal(link.second, -1);
        assert_near(link.weight, 0, 0);
        assert_near(pose.x, 0, 0);
        assert_near(information.xx, 0, 0);
        pose = cairn_pose_graph_pose(graph, outside[k] == 1 ? 2 : outside[k]);
        assert_near(pose.x, 0, 0);
        assert_near(pose.theta, 0, 0);
    }
    test_pool_free(&pool);
}

static void refused_graphs(void **state)
{
    const cairn_real bad[2] = {(cairn_real)NAN, (cairn_real)INFINITY};
    const cairn_sym3 one = {1, 0, 0, 1, 0, 1}, flat = {1, 1, 0, 1, 0, 1};
    const cairn_pose zero = cairn_pose_identity();
    cairn_pose_graph_params params = small_params();
    cairn_pose_graph *graph;
    cairn_pool pool;
    cairn_real block[9];
    cairn_budget budget = {1};

    (void)state;
    params.max_poses = 3;
    params.max_links = 2;
    pool = test_pool(cairn_pose_graph_memory(&params, NULL));
    assert_ok(cairn_pose_graph_create(&graph, &pool, &params, NULL));
    assert_status(cairn_pose_graph_solve(NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_graph_solve(graph), CAIRN_EMPTY);
    assert_status(cairn_pose_graph_marginals(NULL), CAIRN_BAD_ARGUMENT);
    for (int round = 0; round < 2; round++) {
        for (int i = 0; i < 3; i++)
            assert_ok(cairn_pose_graph_add_pose(graph, zero));
        assert_status(cairn_pose_graph_add_pose(graph, zero), CAIRN_FULL);
        assert_status(cairn_pose_graph_add_pose(NULL, zero), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_set_pose(NULL, 0, zero), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_set_pose(graph, 3, zero), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_set_pose(graph, -1, zero), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_fix(NULL, 0, 1), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_fix(graph, 3, 1), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_add_link(NULL, 0, 1, zero, one), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_add_link(graph, 3, 1, zero, one), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_add_link(graph, 0, -1, zero, one), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_add_link(graph, 1, 1, zero, one), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_add_link(graph, 0, 1, zero, flat), CAIRN_BAD_ARGUMENT);
        for (int k = 0; k < 12; k++) {
            cairn_sym3 information = one;
            cairn_pose pose = zero;
            cairn_real *numbers[] = {&information.xx, &information.xy, &information.xz,
                                     &information.yy, &information.yz, &information.zz};
            cairn_real *parts[] = {&pose.x, &pose.y, &pose.theta};

            *numbers[k / 2] = bad[k % 2];
            assert_status(cairn_pose_graph_add_link(graph, 0, 1, zero, information),
                          CAIRN_NOT_FINITE);
            *parts[k / 2 % 3] = bad[k % 2];
            assert_status(cairn_pose_graph_add_link(graph, 0, 1, pose, one), CAIRN_NOT_FINITE);
            assert_status(cairn_pose_graph_set_link(graph, 0, 0, 1, pose, one), CAIRN_NOT_FINITE);
            assert_status(cairn_pose_graph_set_pose(graph, 0, pose), CAIRN_NOT_FINITE);
            assert_status(cairn_pose_graph_add_pose(graph, pose), CAIRN_NOT_FINITE);
        }
        assert_status(cairn_pose_graph_set_link(graph, 0, 0, 1, zero, one), CAIRN_BAD_ARGUMENT);
        assert_ok(cairn_pose_graph_add_link(graph, 0, 1, zero, one));
        assert_ok(cairn_pose_graph_add_link(graph, 1, 2, zero, one));
        assert_status(cairn_pose_graph_set_link(NULL, 0, 0, 1, zero, one), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_set_link(graph, 2, 0, 1, zero, one), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_set_link(graph, -1, 0, 1, zero, one), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_set_link(graph, 0, 0, 3, zero, one), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_set_link(graph, 0, 2, 2, zero, one), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_set_link(graph, 0, 0, 1, zero, flat), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_remove_pose(NULL, 0), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_remove_pose(graph, -1), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_remove_pose(graph, 3), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_add_link(graph, 0, 2, zero, one), CAIRN_FULL);
        assert_status(cairn_pose_graph_exclude_link(graph, 2, 1), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_exclude_link(graph, -1, 1), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_exclude_link(NULL, 0, 1), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_set_kernel(NULL, 0, 1), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_set_kernel(graph, 7, 1), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_set_kernel(graph, 0, bad[0]), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_set_kernel(graph, 0, 0), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_pose_graph_set_kernel(graph, 0, 1000001), CAIRN_BAD_ARGUMENT);
        assert_ok(cairn_pose_graph_set_kernel(graph, 0, 1000000));
        assert_ok(cairn_pose_graph_set_kernel(graph, 0, CAIRN_REAL(1e-6)));
        assert_ok(cairn_pose_graph_solve(graph));
        /* While it runs. */
        for (int begun = 0; begun < 2; begun++) {
            assert_status(cairn_pose_graph_solve(graph), CAIRN_BAD_ARGUMENT);
            assert_status(cairn_pose_graph_set_pose(graph, 0, zero), CAIRN_BAD_ARGUMENT);
            assert_status(cairn_pose_graph_fix(graph, 0, 1), CAIRN_BAD_ARGUMENT);
            assert_status(cairn_pose_graph_exclude_link(graph, 0, 1), CAIRN_BAD_ARGUMENT);
            assert_status(cairn_pose_graph_set_kernel(graph, 0, 1), CAIRN_BAD_ARGUMENT);
            assert_status(cairn_pose_graph_add_link(graph, 0, 1, zero, one), CAIRN_BAD_ARGUMENT);
            assert_status(cairn_pose_graph_add_pose(graph, zero), CAIRN_BAD_ARGUMENT);
            assert_status(cairn_pose_graph_set_link(graph, 0, 0, 1, zero, one), CAIRN_BAD_ARGUMENT);
            assert_status(cairn_pose_graph_remove_pose(graph, 0), CAIRN_BAD_ARGUMENT);
            budget.left = 1;
            assert_status(cairn_pose_graph_step(graph, &budget), CAIRN_MORE);
        }
        if (round == 0)
            cairn_pose_graph_clear(graph); /* drops what runs */
    }
    assert_int_equal(cairn_pose_graph_read(graph).links, 2);
    assert_ok(run(graph, CAIRN_UNBOUNDED));
    assert_status(cairn_pose_graph_covariance(NULL, 0, 0, block), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_graph_covariance(graph, 3, 0, block), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_graph_covariance(graph, 0, -1, block), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_graph_covariance(graph, 0, 0, NULL), CAIRN_BAD_ARGUMENT);
    test_pool_free(&pool);
}

/* ---- Cleared while it runs ---- */

struct cleared {
    struct problem p;
    struct made made;
};

static cairn_status begin_solution(void *context)
{
    struct cleared *c = context;

    cairn_pose_graph_clear(c->made.graph);
    add_problem(c->made.graph, &c->p);
    return cairn_pose_graph_solve(c->made.graph);
}

static cairn_status begin_marginals(void *context)
{
    struct cleared *c = context;

    assert_ok(begin_solution(c));
    assert_ok(run(c->made.graph, CAIRN_UNBOUNDED));
    return cairn_pose_graph_marginals(c->made.graph);
}

static cairn_status step_cleared(void *context, cairn_budget *budget)
{
    struct cleared *c = context;

    return cairn_pose_graph_step(c->made.graph, budget);
}

static uint64_t cleared_hash(void *context)
{
    struct cleared *c = context;
    cairn_pose_graph_state s = cairn_pose_graph_read(c->made.graph);
    uint64_t hash = test_hash(TEST_HASH_START, &s.cost, sizeof s.cost);

    hash = test_hash(hash, &s.iterations, sizeof s.iterations);
    for (int32_t i = 0; i < c->p.poses; i++) {
        cairn_pose pose = cairn_pose_graph_pose(c->made.graph, i);
        cairn_real block[9];

        hash = test_hash(hash, &pose, sizeof pose);
        if (cairn_pose_graph_covariance(c->made.graph, i, i, block) == CAIRN_OK)
            hash = test_hash(hash, block, sizeof block);
    }
    return hash;
}

/* clear() drops a solution, and the computation of its covariances, wherever they are. */
static void what_ran_before_clear_leaves_no_trace(void **state)
{
    static struct cleared c;
    cairn_pose_graph_params params = small_params();
    test_stepped solution = {begin_solution, step_cleared, cleared_hash, &c};
    test_stepped marginals = {begin_marginals, step_cleared, cleared_hash, &c};

    (void)state;
    c.p = a_problem(12, 0.05);
    c.made = make_graph(&c.p, &params, NULL);
    test_begins_anew(&solution, 100);
    test_begins_anew(&marginals, 20);
    test_pool_free(&c.made.pool);
}

/* A solution costs the same in a new graph and in one that was cleared. */
static void clear_does_not_change_what_is_charged(void **state)
{
    struct problem p = a_problem(12, 0.05);
    cairn_pose_graph_params params = small_params();
    struct made made = make_graph(&p, &params, NULL);
    int32_t used[2];

    (void)state;
    for (int k = 0; k < 2; k++) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        if (k == 1) {
            cairn_pose_graph_clear(made.graph);
            add_problem(made.graph, &p);
        }
        assert_ok(cairn_pose_graph_solve(made.graph));
        assert_ok(cairn_pose_graph_step(made.graph, &budget));
        used[k] = CAIRN_UNBOUNDED - budget.left;
    }
    assert_int_equal(used[1], used[0]);
    test_pool_free(&made.pool);
}

/* A graph from which links and poses were removed, or in which they were changed, equals one built
 * that way. */
static void removed_scans_leave_no_trace(void **state)
{
    static struct problem p, without;
    cairn_pose_graph_params params = small_params();

    (void)state;
    for (int32_t gone = 0; gone < POSES; gone += 8) {
        cairn_random random = cairn_random_seed(11, 1);
        struct made made, plain;

        p = without = a_problem(11, 0.05);
        measure(&p, 2, 17, 0.05, &random);
        without.poses = POSES - 1;
        without.links = 0;
        for (int32_t i = gone; i < POSES - 1; i++)
            without.guess[i] = p.guess[i + 1];
        p.link[3].first = 20; /* it gets other ends later */
        p.link[3].second = 5;
        for (int32_t l = 0; l < p.links; l++) {
            struct measurement m = p.link[l];

            if (l == 3) {
                m.first = 23;
                m.second = 3;
                m.z = p.link[4].z;
                m.information = p.link[5].information;
            }
            if (m.first == gone || m.second == gone)
                continue;
            m.first -= m.first > gone;
            m.second -= m.second > gone;
            without.link[without.links++] = m;
        }
        made = make_graph(&p, &params, NULL);
        plain = make_graph(&without, &params, NULL);
        assert_ok(cairn_pose_graph_fix(made.graph, 9, 1));
        assert_ok(cairn_pose_graph_fix(made.graph, 16, 1));
        assert_ok(cairn_pose_graph_exclude_link(made.graph, p.links - 2, 1));
        if (gone != 24) /* whose link that is */
            assert_ok(cairn_pose_graph_exclude_link(plain.graph, without.links - 2, 1));
        if (gone != 16)
            assert_ok(cairn_pose_graph_fix(plain.graph, 16 - (gone < 16), 1));
        assert_ok(cairn_pose_graph_fix(plain.graph, 9 - (gone < 9), 1));
        (void)solve(made.graph);
        assert_ok(
            cairn_pose_graph_set_link(made.graph, 3, 23, 3, p.link[4].z, p.link[5].information));
        assert_ok(cairn_pose_graph_remove_pose(made.graph, gone));
        assert_int_equal(cairn_pose_graph_read(made.graph).poses, without.poses);
        assert_int_equal(cairn_pose_graph_read(made.graph).links, without.links);
        assert_status(cairn_pose_graph_marginals(made.graph), CAIRN_BAD_ARGUMENT);
        for (int32_t i = 0; i < without.poses; i++)
            assert_ok(cairn_pose_graph_set_pose(made.graph, i, without.guess[i]));
        assert_memory_equal(&(cairn_real){solve(made.graph).chi2},
                            &(cairn_real){solve(plain.graph).chi2}, sizeof(cairn_real));
        for (int32_t i = 0; i < without.poses; i++) {
            cairn_pose a = cairn_pose_graph_pose(made.graph, i),
                       b = cairn_pose_graph_pose(plain.graph, i);

            assert_memory_equal(&a, &b, sizeof a);
        }
        for (int32_t l = 0; l < without.links; l++) {
            cairn_pose_graph_link a = cairn_pose_graph_link_of(made.graph, l);
            cairn_pose_graph_link b = cairn_pose_graph_link_of(plain.graph, l);

            assert_memory_equal(&a, &b, sizeof a);
        }
        test_pool_free(&made.pool);
        test_pool_free(&plain.pool);
    }
}

static void overflow_is_reported(void **state)
{
    const cairn_sym3 one = {1, 0, 0, 1, 0, 1};
    cairn_pose_graph_params params = small_params();
    cairn_pose far = {NUMBER(1e200, 1e30f), 0, 0};
    struct made made;
    struct problem p = a_problem(12, 0.05);
    cairn_pose_graph_state s;

    (void)state;
    p.guess[3].x = far.x;
    params.start = CAIRN_POSE_GRAPH_GIVEN;
    made = make_graph(&p, &params, NULL);
    assert_ok(cairn_pose_graph_solve(made.graph));
    assert_status(run(made.graph, CAIRN_UNBOUNDED), CAIRN_NOT_FINITE);
    s = cairn_pose_graph_read(made.graph);
    assert_int_equal(s.verdict, CAIRN_POSE_GRAPH_RUNNING);
    assert_true(cairn_is_finite(s.chi2) && cairn_is_finite(s.chi2_initial));
    assert_ok(cairn_pose_graph_set_pose(made.graph, 3, p.truth[3]));
    assert_int_equal(solve(made.graph).verdict, CAIRN_POSE_GRAPH_CONVERGED);
    cairn_pose_graph_clear(made.graph);
    assert_ok(cairn_pose_graph_add_pose(made.graph, cairn_pose_identity()));
    assert_ok(cairn_pose_graph_add_pose(made.graph, cairn_pose_identity()));
    assert_ok(cairn_pose_graph_add_link(made.graph, 1, 0, p.truth[4], one));
    s = solve(made.graph);
    assert_int_equal(s.verdict, CAIRN_POSE_GRAPH_CONVERGED);
    assert_near(s.chi2, 0, NUMBER(1e-18, 1e-8));
    test_pool_free(&made.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(paths_stay_as_they_are),
        cmocka_unit_test(indices_outside_read_nothing),
        cmocka_unit_test(every_kernel_finds_its_minimum),
        cmocka_unit_test(chordal_start_needs_no_guess),
        cmocka_unit_test(outliers_are_named),
        cmocka_unit_test(graduated_widens_the_reach),
        cmocka_unit_test(fixed_poses_stay),
        cmocka_unit_test(covariances_are_those_of_the_dense_inverse),
        cmocka_unit_test(covariances_are_of_the_last_poses),
        cmocka_unit_test(components_are_counted),
        cmocka_unit_test(too_much_fill_is_reported),
        cmocka_unit_test(memory_is_taken_when_the_fill_is_known),
        cmocka_unit_test(a_solver_of_ones_own),
        cmocka_unit_test(weak_motions_take_few_factors),
        cmocka_unit_test(old_factors_do_not_end_it),
        cmocka_unit_test(out_of_iterations),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(no_graph_and_no_pool_are_refused),
        cmocka_unit_test(every_pool_size),
        cmocka_unit_test(refused_graphs),
        cmocka_unit_test(what_ran_before_clear_leaves_no_trace),
        cmocka_unit_test(clear_does_not_change_what_is_charged),
        cmocka_unit_test(removed_scans_leave_no_trace),
        cmocka_unit_test(overflow_is_reported),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
