/* Solves, inverses and eigenvectors: each result is substituted into its equation; degenerate
 * matrices are refused. */
#include "tests/test.h"

#include <math.h>

#include "cairn/small_matrix.h"

static const double TOLERANCE = NUMBER(1e-13, 1e-5);

static void full(cairn_sym3 m, double a[3][3])
{
    a[0][0] = (double)m.xx;
    a[1][1] = (double)m.yy;
    a[2][2] = (double)m.zz;
    a[0][1] = a[1][0] = (double)m.xy;
    a[0][2] = a[2][0] = (double)m.xz;
    a[1][2] = a[2][1] = (double)m.yz;
}

static double largest(cairn_sym3 m)
{
    double a[3][3], most = 0;

    full(m, a);
    for (int i = 0; i < 9; i++)
        most = fmax(most, fabs(a[i / 3][i % 3]));
    return most;
}

static cairn_sym3 random_sym3(cairn_random *random)
{
    cairn_sym3 m;

    m.xx = cairn_random_uniform(random, -5, 5);
    m.xy = cairn_random_uniform(random, -5, 5);
    m.xz = cairn_random_uniform(random, -5, 5);
    m.yy = cairn_random_uniform(random, -5, 5);
    m.yz = cairn_random_uniform(random, -5, 5);
    m.zz = cairn_random_uniform(random, -5, 5);
    return m;
}

/* A sum of outer products over six random vectors, of full rank. */
static cairn_sym3 random_positive(cairn_random *random)
{
    cairn_sym3 m = cairn_sym3_zero();

    for (int i = 0; i < 6; i++) {
        cairn_real v[3];

        for (int k = 0; k < 3; k++)
            v[k] = cairn_random_uniform(random, -2, 2);
        cairn_sym3_add_outer(&m, v, 1);
    }
    m.xx += 1;
    m.yy += 1;
    m.zz += 1;
    return m;
}

static void outer_products_and_forms(void **state)
{
    const cairn_real v[3] = {2, 3, 5}, w[3] = {7, -1, 4};
    cairn_sym3 m = {1, 2, 3, 4, 5, 6};

    (void)state;
    cairn_sym3_add_outer(&m, v, 10);
    assert_true(m.xx == 41 && m.xy == 62 && m.xz == 103 && m.yy == 94 && m.yz == 155 &&
                m.zz == 256);
    {
        double a[3][3], sum = 0;

        full(m, a);
        for (int i = 0; i < 9; i++)
            sum += (double)w[i / 3] * a[i / 3][i % 3] * (double)w[i % 3];
        assert_near(cairn_sym3_form(m, w), sum, TOLERANCE);
    }
    m = cairn_sym3_zero();
    assert_near(cairn_sym3_form(m, w), 0, 0);
}

static void assert_entries(cairn_sym3 m, const double entries[9], double tolerance)
{
    double a[3][3];

    full(m, a);
    for (int i = 0; i < 9; i++)
        assert_near(a[i / 3][i % 3], entries[i], tolerance);
}

static void sums_and_products(void **state)
{
    static const double entries[9] = {1, 2, 3, 2, 4, 5, 3, 5, 6},
                        sum[9] = {11, 22, 33, 22, 44, 55, 33, 55, 66},
                        scaled[9] = {-2, -4, -6, -4, -8, -10, -6, -10, -12};
    const cairn_sym3 m = {1, 2, 3, 4, 5, 6}, n = {10, 20, 30, 40, 50, 60};
    const cairn_real v[3] = {2, -3, 5};
    cairn_real product[3], all[9];

    (void)state;
    assert_entries(cairn_sym3_add(m, n), sum, 0);
    assert_entries(cairn_sym3_scale(m, -2), scaled, 0);
    cairn_sym3_times(m, v, product);
    assert_true(product[0] == 11 && product[1] == 17 && product[2] == 21);
    assert_true(cairn_dot3(v, product) == cairn_sym3_form(m, v));
    cairn_sym3_to_full(m, all);
    for (int i = 0; i < 9; i++)
        assert_near(all[i], entries[i], 0);
    assert_entries(cairn_sym3_of_full(all), entries, 0);
}

/* R m R^T by matrix products. */
static void rotations(void **state)
{
    cairn_random random = cairn_random_seed(4, 0);

    (void)state;
    for (int trial = 0; trial < 100; trial++) {
        cairn_sym3 m = random_sym3(&random);
        double angle = (double)cairn_random_uniform(&random, -4, 4), s = sin(angle), c = cos(angle);
        double r[3][3] = {{c, -s, 0}, {s, c, 0}, {0, 0, 1}}, a[3][3], rotated[9] = {0};

        full(m, a);
        for (int i = 0; i < 9; i++)
            for (int k = 0; k < 9; k++)
                rotated[i] += r[i / 3][k / 3] * a[k / 3][k % 3] * r[i % 3][k % 3];
        assert_entries(cairn_sym3_rotate(m, (cairn_real)s, (cairn_real)c), rotated,
                       100 * TOLERANCE);
        assert_entries(cairn_sym3_rotate_by(m, (cairn_real)angle), rotated, 100 * TOLERANCE);
    }
}

static void check_sym2(cairn_sym2 m)
{
    cairn_real values[2];
    cairn_vec2 axis[2];
    double scale = fmax(fabs((double)m.xx), fmax(fabs((double)m.yy), fabs((double)m.xy)));

    cairn_sym2_eigen(m, values, &axis[0], &axis[1]);
    assert_true(values[0] <= values[1]);
    for (int i = 0; i < 2; i++) {
        assert_near(m.xx * axis[i].x + m.xy * axis[i].y, values[i] * axis[i].x,
                    4 * TOLERANCE * scale);
        assert_near(m.xy * axis[i].x + m.yy * axis[i].y, values[i] * axis[i].y,
                    4 * TOLERANCE * scale);
        assert_near(cairn_vec2_norm(axis[i]), 1, TOLERANCE);
    }
    assert_near(cairn_vec2_dot(axis[0], axis[1]), 0, TOLERANCE);
}

static void eigen_of_two(void **state)
{
    cairn_random random = cairn_random_seed(1, 0);
    cairn_sym2 identity = {3, 0, 3}, diagonal = {1, 0, 4}, other = {4, 0, 1}, zero = {0, 0, 0};
    cairn_sym2 swap = {0, 1, 0}, thin = {1, NUMBER(1e-9, 1e-4f), 1}, known = {2, 1, 2};
    cairn_real values[2];
    cairn_vec2 minor, major;

    (void)state;
    for (int i = 0; i < 5000; i++) {
        cairn_sym2 m;

        m.xx = cairn_random_uniform(&random, -5, 5);
        m.xy = cairn_random_uniform(&random, -5, 5);
        m.yy = cairn_random_uniform(&random, -5, 5);
        check_sym2(m);
    }
    check_sym2(identity);
    check_sym2(diagonal);
    check_sym2(other);
    check_sym2(zero);
    check_sym2(swap);
    check_sym2(thin);
    cairn_sym2_eigen(identity, values, &minor, &major);
    assert_true(major.x == 1 && major.y == 0 && minor.x == 0 && minor.y == 1);
    assert_true(values[0] == 3 && values[1] == 3);
    cairn_sym2_eigen(known, values, &minor, &major);
    assert_near(values[0], 1, TOLERANCE);
    assert_near(values[1], 3, TOLERANCE);
    assert_near(major.x, sqrt(0.5), TOLERANCE);
    assert_near(major.y, sqrt(0.5), TOLERANCE);
    cairn_sym2_eigen(diagonal, values, &minor, &major);
    assert_near(fabs((double)major.y), 1, 0);
    /* Nearly on an axis, where a difference of nearly equal numbers would lose the angle. */
    known.xx = 1;
    known.yy = 0;
    known.xy = NUMBER(1e-10, 1e-5f);
    cairn_sym2_eigen(known, values, &minor, &major);
    assert_near(major.y / major.x, known.xy, NUMBER(1e-24, 1e-11));
    known.xx = 0;
    known.yy = 1;
    cairn_sym2_eigen(known, values, &minor, &major);
    assert_near(major.x / major.y, known.xy, NUMBER(1e-24, 1e-11));
}

static void solves_and_inverses(void **state)
{
    cairn_random random = cairn_random_seed(2, 0);

    (void)state;
    for (int i = 0; i < 5000; i++) {
        cairn_sym3 m = random_positive(&random), inverse;
        cairn_real b[3], x[3];
        double a[3][3], n[3][3];

        for (int k = 0; k < 3; k++)
            b[k] = cairn_random_uniform(&random, -5, 5);
        full(m, a);
        assert_int_equal(cairn_sym3_solve(m, b, x), 1);
        assert_int_equal(cairn_sym3_inverse(m, &inverse), 1);
        full(inverse, n);
        for (int r = 0; r < 3; r++) {
            double back = 0;

            for (int c = 0; c < 3; c++)
                back += a[r][c] * (double)x[c];
            assert_near(back, b[r], 50 * TOLERANCE);
            for (int c = 0; c < 3; c++) {
                double unit = 0;

                for (int k = 0; k < 3; k++)
                    unit += a[r][k] * n[k][c];
                assert_near(unit, r == c, 50 * TOLERANCE);
            }
        }
    }
}

/* a x = b of up to 8 rows, a the sum of outer products. */
static void solves_of_any_size(void **state)
{
    cairn_random random = cairn_random_seed(8, 1);

    (void)state;
    for (int trial = 0; trial < 500; trial++) {
        int32_t n = 1 + trial % 8;
        double a[8][8] = {{0}};
        cairn_real packed[36], b[8], x[8];

        for (int k = 0; k < 3 * n; k++) {
            double v[8];

            for (int i = 0; i < n; i++)
                v[i] = (double)cairn_random_uniform(&random, -1, 1);
            for (int i = 0; i < n; i++)
                for (int j = 0; j < n; j++)
                    a[i][j] += v[i] * v[j] + (i == j ? 0.2 : 0);
        }
        for (int i = 0; i < n; i++) {
            for (int j = 0; j <= i; j++)
                packed[cairn_sym_element(i, j)] = (cairn_real)a[i][j];
            x[i] = b[i] = cairn_random_uniform(&random, -5, 5);
        }
        assert_int_equal(cairn_sym_solve(packed, n, 0, x), 1);
        for (int i = 0; i < n; i++) {
            double back = 0;

            for (int j = 0; j < n; j++)
                back += a[i][j] * (double)x[j];
            assert_near(back, b[i], 200 * TOLERANCE);
        }
    }
}

/* The second pivot of (1, 1; 1, 1 + p) is p. */
static void pivots_below_a_share_are_refused(void **state)
{
    const cairn_real shares[] = {0, CAIRN_REAL(0.24), CAIRN_REAL(0.26), 2};

    (void)state;
    for (int k = 0; k < 4; k++) {
        cairn_real a[3] = {1, 1, CAIRN_REAL(1.3333)}, x[2] = {1, 2}, negative[3] = {1, 2, 1},
                   none[1] = {(cairn_real)NAN};

        assert_int_equal(cairn_sym_solve(a, 2, shares[k], x), k < 2);
        assert_int_equal(cairn_sym_solve(negative, 2, shares[k], x), 0);
        assert_int_equal(cairn_sym_solve(none, 1, shares[k], x), 0);
    }
}

static void refused(cairn_sym3 m)
{
    const cairn_real b[3] = {1, 2, 3};
    cairn_real x[3] = {7, 8, 9};
    cairn_sym3 inverse = {1, 2, 3, 4, 5, 6};

    assert_int_equal(cairn_sym3_solve(m, b, x), 0);
    assert_true(x[0] == 7 && x[1] == 8 && x[2] == 9);
    assert_int_equal(cairn_sym3_inverse(m, &inverse), 0);
    assert_true(inverse.xx == 1 && inverse.xy == 2 && inverse.xz == 3 && inverse.yy == 4 &&
                inverse.yz == 5 && inverse.zz == 6);
}

static void not_positive_definite(void **state)
{
    static const cairn_sym3 bad[] = {
        {0, 0, 0, 0, 0, 0}, {-1, 0, 0, 1, 0, 1}, {1, 0, 0, -1, 0, 1}, {1, 0, 0, 1, 0, -1},
        {0, 0, 0, 1, 0, 1}, {1, 0, 0, 0, 0, 1},  {1, 0, 0, 1, 0, 0},  {1, 1, 1, 1, 1, 1},
        {1, 2, 0, 1, 0, 1}, {1, 0, 2, 1, 0, 1},  {1, 0, 0, 1, 2, 1},  {4, 2, 6, 1, 3, 9},
        {2, 1, 3, 2, 3, 6}, /* rank 2: z = x + y */
    };
    const cairn_real not_a_number = (cairn_real)NAN, infinite = (cairn_real)INFINITY;

    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        refused(bad[i]);
    for (int i = 0; i < 6; i++) {
        cairn_real entries[6] = {2, 0, 0, 2, 0, 2};
        cairn_sym3 m;

        entries[i] = not_a_number;
        m.xx = entries[0], m.xy = entries[1], m.xz = entries[2];
        m.yy = entries[3], m.yz = entries[4], m.zz = entries[5];
        refused(m);
    }
    {
        cairn_sym3 m = {2, 0, 0, 2, 0, 2};

        m.zz = infinite;
        refused(m);
    }
}

/* Diagonal matrices of any scale and shape are accepted as long as no pivot is lost in rounding. */
static void scales(void **state)
{
    const cairn_real b[3] = {1, 1, 1};
    cairn_real x[3];
    cairn_sym3 m = {NUMBER(1e-20, 1e-10f), 0, 0, NUMBER(1e-20, 1e-10f), 0, NUMBER(1e-20, 1e-10f)};
    cairn_sym3 uneven = {1, 0, 0, 1, 0, 64 * CAIRN_REAL_EPSILON * CAIRN_REAL_EPSILON};
    cairn_sym3 drowned = {1, 0, 0, 1, 0, 4 * CAIRN_REAL_EPSILON * CAIRN_REAL_EPSILON};

    (void)state;
    assert_int_equal(cairn_sym3_solve(m, b, x), 1);
    assert_near(x[1] * m.yy, 1, TOLERANCE);
    assert_int_equal(cairn_sym3_solve(uneven, b, x), 1);
    refused(drowned);
    drowned.zz = 1;
    drowned.yy = 4 * CAIRN_REAL_EPSILON * CAIRN_REAL_EPSILON;
    refused(drowned);
    drowned.yy = 1;
    drowned.xx = 4 * CAIRN_REAL_EPSILON * CAIRN_REAL_EPSILON;
    refused(drowned);
    {
        /* The rest of a pivot after elimination is compared with its own entry. */
        cairn_sym3 nearly = {1, 1, 0, 1 + 2 * CAIRN_REAL_EPSILON, 0, 1};

        refused(nearly);
        nearly.yy = 1 + 16 * CAIRN_REAL_EPSILON;
        assert_int_equal(cairn_sym3_solve(nearly, b, x), 1);
        nearly.yy = 1;
        nearly.xy = 0;
        nearly.xz = 1;
        nearly.zz = 1 + 2 * CAIRN_REAL_EPSILON;
        refused(nearly);
        nearly.zz = 1 + 16 * CAIRN_REAL_EPSILON;
        assert_int_equal(cairn_sym3_solve(nearly, b, x), 1);
    }
}

static void check_sym3(cairn_sym3 m)
{
    cairn_real values[3], vectors[3][3];
    double a[3][3], tolerance = 20 * TOLERANCE * largest(m);

    full(m, a);
    cairn_sym3_eigen(m, values, vectors);
    assert_true(values[0] <= values[1] && values[1] <= values[2]);
    for (int i = 0; i < 3; i++) {
        for (int r = 0; r < 3; r++) {
            double mapped = 0;

            for (int c = 0; c < 3; c++)
                mapped += a[r][c] * (double)vectors[i][c];
            assert_near(mapped, values[i] * vectors[i][r], tolerance);
        }
        for (int j = 0; j < 3; j++) {
            double dot = 0;

            for (int c = 0; c < 3; c++)
                dot += (double)vectors[i][c] * (double)vectors[j][c];
            assert_near(dot, i == j, 10 * TOLERANCE);
        }
    }
}

static void eigen_of_three(void **state)
{
    static const cairn_sym3 special[] = {
        {0, 0, 0, 0, 0, 0}, {2, 0, 0, 2, 0, 2}, {3, 0, 0, 2, 0, 1},  {1, 0, 0, 3, 0, 2},
        {0, 1, 0, 0, 0, 0}, {0, 0, 1, 0, 0, 0}, {0, 0, 0, 0, 1, 0},  {1, 1, 1, 1, 1, 1},
        {2, 0, 0, 2, 1, 2}, {1, 0, 1, 5, 0, 1}, {-1, 2, 0, 4, 0, 7}, {1, -1, 1, 1, -1, 1},
    };
    cairn_random random = cairn_random_seed(3, 0);
    cairn_real values[3], vectors[3][3];

    (void)state;
    for (size_t i = 0; i < sizeof special / sizeof *special; i++)
        check_sym3(special[i]);
    for (int i = 0; i < 3000; i++)
        check_sym3(random_sym3(&random));
    cairn_sym3_eigen(special[2], values, vectors);
    assert_true(values[0] == 1 && values[1] == 2 && values[2] == 3);
    assert_true(vectors[0][2] == 1 && vectors[1][1] == 1 && vectors[2][0] == 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(outer_products_and_forms),
        cmocka_unit_test(sums_and_products),
        cmocka_unit_test(rotations),
        cmocka_unit_test(eigen_of_two),
        cmocka_unit_test(solves_and_inverses),
        cmocka_unit_test(solves_of_any_size),
        cmocka_unit_test(pivots_below_a_share_are_refused),
        cmocka_unit_test(not_positive_definite),
        cmocka_unit_test(scales),
        cmocka_unit_test(eigen_of_three),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
