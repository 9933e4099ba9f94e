/* Priors of the aligner: the running sums over a cluster compared with sums over all scans. */
#include "tests/test.h"

#include <math.h>

#include "src/alignment/aligner_work.h"

enum { SCANS = 12, FIRST_CLUSTER = 7 };

static const double PI = 3.14159265358979323846;

/* Scans without points; those before FIRST_CLUSTER in one cluster, the others in another, each in
 * its own frame. */
struct bed {
    cairn_pool pool;
    cairn_aligner *aligner;
    int32_t first, second; /* the clusters */
};

static void estimate_sigmas(cairn_aligner *aligner)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_int_equal(cairn_aligner_estimate_sigmas(aligner, &budget), 1);
}

/* off: errors of the poses in m; a third of that in rad. */
static struct bed make_bed(uint64_t seed, double off)
{
    cairn_aligner_params params = cairn_aligner_default();
    cairn_random random = cairn_random_seed(seed, 1);
    cairn_transform same = {0, 0, 1, 0};
    struct bed bed;

    params.max_scans = SCANS;
    bed.pool = test_pool(cairn_aligner_memory(&params));
    assert_ok(cairn_aligner_create(&bed.aligner, &bed.pool, &params));
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_scan_view nothing;
        cairn_pose pose = {cairn_random_uniform(&random, -8, 8),
                           cairn_random_uniform(&random, -8, 8),
                           cairn_random_uniform(&random, -3, 3)};

        memset(&nothing, 0, sizeof nothing);
        assert_ok(cairn_aligner_add_scan(bed.aligner, &nothing, pose, NULL));
    }
    assert_ok(cairn_aligner_begin(bed.aligner));
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_pose pose = bed.aligner->scans[i].initial,
                   turned = {i < FIRST_CLUSTER ? 3 : -2, 1, i < FIRST_CLUSTER ? 1 : -2};

        pose.x += cairn_random_uniform(&random, -1, 1) * (cairn_real)off;
        pose.y += cairn_random_uniform(&random, -1, 1) * (cairn_real)off;
        pose.theta += cairn_random_uniform(&random, -1, 1) * (cairn_real)(off / 3);
        bed.aligner->poses[i] =
            cairn_transform_compose(cairn_transform_of(turned), cairn_transform_of(pose));
    }
    bed.first = 0;
    for (int32_t i = 1; i < FIRST_CLUSTER; i++)
        bed.first = cairn_aligner_merge_clusters(bed.aligner, i, bed.first, same);
    bed.second = FIRST_CLUSTER;
    for (int32_t i = FIRST_CLUSTER + 1; i < SCANS; i++)
        bed.second = cairn_aligner_merge_clusters(bed.aligner, i, bed.second, same);
    estimate_sigmas(bed.aligner);
    return bed;
}

/* ---- The reference implementation ---- */

struct members {
    double x[SCANS + 1], y[SCANS + 1], theta[SCANS + 1];
    cairn_pose initial[SCANS + 1];
    int32_t count;
};

static void add_cluster(struct members *c, const cairn_aligner *aligner, int32_t cluster,
                        cairn_transform motion)
{
    for (int32_t i = aligner->clusters[cluster].head; i >= 0;
         i = aligner->scans[i].next_in_cluster) {
        cairn_transform pose = cairn_transform_compose(motion, aligner->poses[i]);

        c->x[c->count] = (double)pose.x;
        c->y[c->count] = (double)pose.y;
        c->theta[c->count] = atan2((double)pose.sine, (double)pose.cosine);
        c->initial[c->count++] = aligner->scans[i].initial;
    }
}

struct left {
    double squares, squares_angle, beyond, cost;
};

/* Residual of a cluster that is rotated as a whole, at the best shift; cost: what the gauge
 * minimizes. */
static struct left left_at(const cairn_aligner *aligner, const struct members *c, double turn)
{
    double weight = pow((double)aligner->sigma / (double)aligner->sigma_angle, 2), dx = 0, dy = 0;
    double far = 1.25 * (double)aligner->params.max_initial_error,
           wide = 1.25 * (double)aligner->params.max_initial_angle_error;
    struct left m = {0, 0, 0, 0};

    for (int pass = 0; pass < 2; pass++)
        for (int32_t i = 0; i < c->count; i++) {
            double ex = cos(turn) * c->x[i] - sin(turn) * c->y[i] - (double)c->initial[i].x;
            double ey = sin(turn) * c->x[i] + cos(turn) * c->y[i] - (double)c->initial[i].y;
            double off = remainder(c->theta[i] + turn - (double)c->initial[i].theta, 2 * PI);

            if (pass == 0) {
                dx += ex / c->count;
                dy += ey / c->count;
                continue;
            }
            ex -= dx;
            ey -= dy;
            m.squares += ex * ex + ey * ey;
            m.squares_angle += off * off;
            m.beyond +=
                fmax(fabs(ex) - far, 0) + fmax(fabs(ey) - far, 0) + 1.5 * fmax(fabs(off) - wide, 0);
            m.cost += ex * ex + ey * ey - 2 * weight * cos(off);
        }
    return m;
}

/* By trying all turns. */
static struct left least_left(const cairn_aligner *aligner, const struct members *c)
{
    double best = 0, step = PI / 60;
    struct left least = left_at(aligner, c, 0);

    for (int32_t level = 0; level < 12; level++, step /= 8) {
        double middle = best;

        for (int32_t k = -60; k <= 60; k++) {
            struct left m = left_at(aligner, c, middle + k * step);

            if (m.cost < least.cost) {
                least = m;
                best = middle + k * step;
            }
        }
    }
    return least;
}

static double chi_squared(const cairn_aligner *aligner, struct left m)
{
    return m.squares / pow((double)aligner->sigma, 2) +
           m.squares_angle / pow((double)aligner->sigma_angle, 2) + 200 * m.beyond;
}

static double slow_misfit(const cairn_aligner *aligner, int32_t cluster)
{
    cairn_transform same = {0, 0, 1, 0};
    struct members c;

    c.count = 0;
    add_cluster(&c, aligner, cluster, same);
    return c.count > 1 ? chi_squared(aligner, least_left(aligner, &c)) : 0;
}

static double slow_prior(const cairn_aligner *aligner, int32_t moving, int32_t fixed,
                         cairn_transform pose)
{
    cairn_transform same = {0, 0, 1, 0};
    struct members c;

    c.count = 0;
    add_cluster(&c, aligner, moving, pose);
    add_cluster(&c, aligner, fixed, same);
    return -(chi_squared(aligner, least_left(aligner, &c)) - slow_misfit(aligner, moving) -
             slow_misfit(aligner, fixed)) /
           2;
}

/* ---- Tests ---- */

/* The pose of the first cluster in the second according to the initial poses, with an error. */
static cairn_transform pose_off(const struct bed *bed, double off_x, double off_turn)
{
    cairn_transform first = cairn_aligner_gauge(bed->aligner, bed->first),
                    second = cairn_aligner_gauge(bed->aligner, bed->second);
    cairn_transform pose = cairn_transform_compose(cairn_transform_inverse(second), first);
    cairn_vec2 centre = {pose.x, pose.y};
    cairn_real motion[3] = {(cairn_real)off_x, (cairn_real)(-off_x / 2), (cairn_real)off_turn};

    return cairn_aligner_moved(pose, centre, motion);
}

static void assert_same_prior(struct bed *bed, cairn_transform pose)
{
    double fast = (double)cairn_aligner_prior(bed->aligner, bed->first, bed->second, pose, NULL);
    double slow = slow_prior(bed->aligner, bed->first, bed->second, pose);

    assert_near(fast, slow, (sizeof(cairn_real) == 8 ? 1e-4 : 1e-2) * (1 + fabs(slow)));
}

static void all_as_slow(struct bed *bed)
{
    static const double offs[][2] = {{0, 0},   {0.1, 0}, {0.3, 0.05}, {-0.4, -0.2},
                                     {2, 0.1}, {0, 0.9}, {-5, 2},     {1, 3.1}};

    for (size_t k = 0; k < sizeof offs / sizeof *offs; k++)
        assert_same_prior(bed, pose_off(bed, offs[k][0], offs[k][1]));
}

static void sums_equal_those_over_scans(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 6; seed++) {
        /* up to 3.6 m and 1.2 rad: far outside of the box */
        struct bed bed = make_bed(seed, 0.1 * (double)(seed * seed));

        all_as_slow(&bed);
        test_pool_free(&bed.pool);
    }
}

static void sums_follow_added_and_removed_scans(void **state)
{
    struct bed bed = make_bed(11, 0.2);
    int32_t pass = 0;

    (void)state;
    for (int32_t i = 1; i < FIRST_CLUSTER; i += 2, pass++) {
        all_as_slow(&bed); /* the sums are there */
        cairn_aligner_remove(bed.aligner, i);
        all_as_slow(&bed);
        bed.aligner->poses[i].x += (cairn_real)(0.3 * pass);
        cairn_aligner_insert(bed.aligner, i, pass == 1 ? bed.second : bed.first);
    }
    all_as_slow(&bed);
    test_pool_free(&bed.pool);
}

static void single_scans_have_no_misfit(void **state)
{
    struct bed bed = make_bed(12, 0.2);
    cairn_transform same = {0, 0, 1, 0};

    (void)state;
    while (bed.aligner->clusters[bed.second].size > 1) {
        int32_t i = bed.aligner->clusters[bed.second].head;

        cairn_aligner_remove(bed.aligner, i);
        cairn_aligner_insert(bed.aligner, i, bed.first);
    }
    all_as_slow(&bed);
    bed.aligner->poses[bed.aligner->clusters[bed.second].head] = same;
    bed.aligner->clusters[bed.second].stamp = ++bed.aligner->change_count;
    all_as_slow(&bed);
    test_pool_free(&bed.pool);
}

/* The learnt spread, with a weight of two scans of the expected spread. */
static void spread_is_that_of_the_scans(void **state)
{
    static const double offs[] = {0.05, 0.3, 5};

    (void)state;
    for (size_t k = 0; k < sizeof offs / sizeof *offs; k++) {
        struct bed bed = make_bed(21 + k, offs[k]);
        double expected = (double)bed.aligner->params.max_initial_error / sqrt(3),
               expected_angle = (double)bed.aligner->params.max_initial_angle_error / sqrt(3);
        double squares = 4 * expected * expected, angles = 2 * expected_angle * expected_angle;
        cairn_real sigma = bed.aligner->sigma, sigma_angle = bed.aligner->sigma_angle;
        int32_t clusters[2] = {bed.first, bed.second};
        cairn_transform same = {0, 0, 1, 0};

        bed.aligner->sigma = (cairn_real)expected;
        bed.aligner->sigma_angle = (cairn_real)expected_angle;
        for (int c = 0; c < 2; c++) {
            struct members members;
            struct left m;

            members.count = 0;
            add_cluster(&members, bed.aligner, clusters[c], same);
            m = least_left(bed.aligner, &members);
            squares += m.squares;
            angles += m.squares_angle;
        }
        assert_near((double)sigma, fmin(expected, sqrt(squares / (2 * SCANS))), 1e-5);
        assert_near((double)sigma_angle, fmin(expected_angle, sqrt(angles / SCANS)), 1e-5);
        test_pool_free(&bed.pool);
    }
}

/* The running sums of a cluster after each change compared with sums over its scans from
 * scratch. */
static void spread_learnt_bit_by_bit_is_that_of_all(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        struct bed bed = make_bed(seed, seed % 2 ? 0.2 : 1.5);
        cairn_random random = cairn_random_seed(seed, 2);
        cairn_aligner *aligner = bed.aligner;

        for (int32_t change = 0; change < 40; change++) {
            int32_t scan =
                cairn_real_to_int(cairn_random_uniform(&random, 0, SCANS - CAIRN_REAL(0.01)));
            int32_t to =
                cairn_random_uniform(&random, 0, 1) < CAIRN_REAL(0.5) ? bed.first : bed.second;
            cairn_real sigma, sigma_angle;

            if (aligner->clusters[aligner->scans[scan].cluster].size > 1) {
                cairn_aligner_remove(aligner, scan);
                cairn_aligner_insert(aligner, scan, to);
            }
            estimate_sigmas(aligner);
            sigma = aligner->sigma;
            sigma_angle = aligner->sigma_angle;
            if (change % 8 == 7) { /* between them, the sums continue from the stored ones */
                for (int32_t c = 0; c <= SCANS; c++)
                    aligner->prior_sums[c].stamp = -1;
                estimate_sigmas(aligner);
                assert_near((double)sigma, (double)aligner->sigma, NUMBER(1e-9, 1e-4));
                assert_near((double)sigma_angle, (double)aligner->sigma_angle, NUMBER(1e-9, 1e-4));
            }
        }
        test_pool_free(&bed.pool);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sums_equal_those_over_scans),
        cmocka_unit_test(sums_follow_added_and_removed_scans),
        cmocka_unit_test(single_scans_have_no_misfit),
        cmocka_unit_test(spread_is_that_of_the_scans),
        cmocka_unit_test(spread_learnt_bit_by_bit_is_that_of_all),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
