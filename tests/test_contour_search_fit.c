/* Outline fitting: the field compared with its reference implementation; shapes of other
 * proportions and with parts shifted; hidden parts; nothing to fit to. */
#include "tests/test.h"

#include <math.h>

#include "cairn/shape_model_file.h"
#include "tests/detection_tools.h"

enum { LINES_MOST = 64 };

static cairn_file_error error;
static cairn_segment lines[LINES_MOST];
static cairn_real strength[LINES_MOST];
static int32_t chain[LINES_MOST];
static cairn_contour_search_tokens tokens;

/* A jug: a body with a spout on one side. */
static const cairn_vec2 jug[] = {{0, 0}, {60, 0}, {95, 20}, {60, 40}, {60, 120}, {0, 120}};
enum { CORNERS = sizeof jug / sizeof *jug };

static cairn_shape_model_file make_model(void)
{
    cairn_curve outline = {jug, CORNERS, 1};
    cairn_shape_model_builder_params params = cairn_shape_model_builder_default();
    cairn_shape_model_file file;

    assert_ok(cairn_shape_model_file_build(&file, &outline, 1, &params, "jug", &error));
    return file;
}

static void clear_lines(void)
{
    memset(&tokens, 0, sizeof tokens);
    tokens.lines = lines;
    tokens.strength_rank = strength;
    tokens.chain = chain;
    tokens.width = 400;
    tokens.height = 300;
}

static void add_line(cairn_vec2 a, cairn_vec2 b)
{
    assert_true(tokens.count < LINES_MOST);
    lines[tokens.count].a = a;
    lines[tokens.count].b = b;
    strength[tokens.count] = CAIRN_REAL(0.5);
    chain[tokens.count] = tokens.count;
    tokens.count++;
}

/* A jug at (100, 80) of the given width and height, its spout lower by `down`; without the sides in
 * the bit set `hidden`. */
static void draw_jug(double wide, double high, double down, int32_t hidden,
                     cairn_vec2 corners[CORNERS])
{
    clear_lines();
    for (int32_t i = 0; i < CORNERS; i++) {
        corners[i].x = (cairn_real)(100 + wide * (double)jug[i].x);
        corners[i].y = (cairn_real)(80 + high * (double)jug[i].y + (i == 2 || i == 3 ? down : 0));
    }
    for (int32_t i = 0; i < CORNERS; i++)
        if (!(hidden >> i & 1))
            add_line(corners[i], corners[(i + 1) % CORNERS]);
}

/* The model placed over it unchanged. */
static cairn_contour_grouping_object object_at(const cairn_shape_model *model)
{
    cairn_contour_grouping_object o;

    memset(&o, 0, sizeof o);
    o.size = model->size;
    o.origin.x = 100 + model->origin.x;
    o.origin.y = 80 + model->origin.y;
    return o;
}

static cairn_real distance_to(const cairn_vec2 corners[CORNERS], cairn_vec2 p)
{
    cairn_real least = CAIRN_REAL_MAX;

    for (int32_t i = 0; i < CORNERS; i++) {
        cairn_segment side = {corners[i], corners[(i + 1) % CORNERS]};

        least = cairn_min(least, cairn_contour_search_point_distance(side, p));
    }
    return least;
}

typedef struct bent {
    /* px: distances of the outline's samples from the drawn jug */
    cairn_real evidence, mean, most;
    /* of the object; mean log-likelihood ratio of the samples nearest to hidden sides */
    cairn_real size, hidden;
    cairn_vec2 origin;
} bent;

static bent bend(const cairn_vec2 corners[CORNERS], int32_t hidden)
{
    cairn_shape_model_file model = make_model();
    cairn_contour_grouping_object o = object_at(&model.model);
    cairn_pool pool = test_pool(DETECTION_TOOLS_BYTES);
    contour_search_field field = field_around(&pool, &tokens, &o);
    int32_t n = model.model.outline_count, behind = 0;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    contour_search_fit fit;
    bent b;

    memset(&b, 0, sizeof b);
    cairn_contour_search_fit_take(&fit, &pool, n);
    cairn_contour_search_fit_begin(&fit, &field, &model.model, &o);
    assert_true(cairn_contour_search_fit_step(&fit, &budget));
    o = fit.object;
    for (int32_t i = 0; i < n; i++) {
        cairn_real far = distance_to(corners, fit.outline[i].position);

        b.mean += far / (cairn_real)n;
        b.most = cairn_max(b.most, far);
        assert_near(cairn_vec2_norm(fit.outline[i].direction), 1, 1e-3);
        assert_int_equal(fit.outline_index[i], 0);
        for (int32_t k = 0; k < CORNERS; k++) {
            cairn_segment side = {corners[k], corners[(k + 1) % CORNERS]};

            if (hidden >> k & 1 &&
                cairn_contour_search_point_distance(side, fit.outline[i].position) <= far) {
                b.hidden += fit.llr[i];
                behind++;
            }
        }
    }
    b.hidden /= (cairn_real)(behind > 0 ? behind : 1);
    b.evidence = fit.evidence;
    b.size = o.size;
    b.origin = o.origin;
    test_pool_free(&pool);
    cairn_shape_model_file_free(&model);
    return b;
}

static void test_field_beside_its_reference(void **state)
{
    cairn_random random = cairn_random_seed(3, 1);
    cairn_pool pool = test_pool(DETECTION_TOOLS_BYTES);
    contour_search_field field;
    cairn_contour_grouping_object o;

    (void)state;
    memset(&o, 0, sizeof o);
    o.origin.x = o.origin.y = 96;
    o.size = 128;
    clear_lines();
    /* In cells of a pixel, single points, each of one direction. */
    for (int32_t i = 0; i < 40; i++) {
        cairn_vec2 a = {cairn_floor(cairn_random_uniform(&random, 5, 185)) + CAIRN_REAL(0.5),
                        cairn_floor(cairn_random_uniform(&random, 5, 185)) + CAIRN_REAL(0.5)};
        cairn_vec2 b = {a.x + CAIRN_REAL(0.1) * cairn_random_uniform(&random, -1, 1),
                        a.y + CAIRN_REAL(0.1) * cairn_random_uniform(&random, -1, 1)};

        add_line(a, b);
        strength[i] = cairn_random_uniform(&random, 0, 1);
    }
    field = field_around(&pool, &tokens, &o);
    for (int32_t bin = 0; bin < CONTOUR_SEARCH_FIELD_BINS; bin++) {
        double sum = 0;

        for (int32_t at = 0; at < CONTOUR_SEARCH_FIELD_SIDE * CONTOUR_SEARCH_FIELD_SIDE; at++) {
            int32_t column = at % CONTOUR_SEARCH_FIELD_SIDE, row = at / CONTOUR_SEARCH_FIELD_SIDE;
            double least = 30, x = column + 0.5, y = row + 0.5;
            double cost = -log((double)field.value[(size_t)bin * CONTOUR_SEARCH_FIELD_SIDE *
                                                       CONTOUR_SEARCH_FIELD_SIDE +
                                                   (size_t)at]);

            for (int32_t i = 0; i < tokens.count; i++) {
                cairn_vec2 d = cairn_vec2_sub(lines[i].b, lines[i].a);
                double turn =
                    remainder(atan2((double)d.y, (double)d.x) - (bin + 0.5) * acos(-1) / 12,
                              acos(-1)) /
                    0.35;
                double u = fabs(x - (double)cairn_floor(lines[i].a.x) - 0.5),
                       v = fabs(y - (double)cairn_floor(lines[i].a.y) - 0.5);

                if (fabs(turn) <= 2.2 && u <= 5 && v <= 5)
                    least = fmin(least, (u * u + v * v) / 8 + turn * turn / 2 -
                                            log(fmax(0.2, 2 * (double)strength[i])));
            }
            sum += exp(-cost);
            if (least < 20)
                assert_near(cost, least, 1e-3);
            else
                assert_true(cost > 20);
        }
        assert_near(field.background[bin],
                    fmax(0.02, sum / (CONTOUR_SEARCH_FIELD_SIDE * CONTOUR_SEARCH_FIELD_SIDE)),
                    1e-3);
    }
    test_pool_free(&pool);
}

static void test_directions(void **state)
{
    (void)state;
    for (int32_t i = 0; i < 48; i++) {
        double angle = (i + 0.5) * acos(-1) / 24;
        cairn_vec2 d = {(cairn_real)cos(angle), (cairn_real)sin(angle)};

        assert_int_equal(cairn_contour_search_field_bin(d), i / 2 % 12);
    }
}

/* As drawn, wider, lower, with the spout elsewhere: the outline is fitted to the edges, and more
 * deformation gives less evidence. */
static void test_bends_onto_edges(void **state)
{
    static const double wide[] = {1, 1.2, 0.85, 1}, high[] = {1, 0.95, 1.1, 1},
                        down[] = {0, 0, 0, 22};
    cairn_vec2 corners[CORNERS];
    cairn_real straight = 0;

    (void)state;
    for (int k = 0; k < 4; k++) {
        bent b;

        draw_jug(wide[k], high[k], down[k], 0, corners);
        b = bend(corners, 0);
        assert_true(b.mean < CAIRN_REAL(1.6));
        assert_true(b.most < 9);
        straight = k == 0 ? b.evidence : straight;
        assert_true(b.evidence > straight / 2);
        assert_true(k == 0 || b.evidence < straight);
    }
}

/* Hidden parts are predicted: they move with the visible ones, and their log-likelihood ratio is
 * below zero. Of width and height a visible side on either end is left: without, the extent of the
 * hidden sides is not observable, as the translation along an edge is not. */
static void test_hidden_parts(void **state)
{
    /* The left side, the left side and the lower one of the spout, the top and the right side below the
     * spout. */
    static const int32_t hidden[] = {1 << 5, 1 << 5 | 1 << 2, 1 << 0 | 1 << 3};
    static const double scales[] = {1.1, 0.9};
    cairn_vec2 corners[CORNERS];

    (void)state;
    for (int32_t k = 0; k < 2; k++) {
        bent whole;

        draw_jug(scales[k], scales[k], 0, 0, corners);
        whole = bend(corners, 0);
        for (size_t i = 0; i < sizeof hidden / sizeof *hidden; i++) {
            bent part;

            draw_jug(scales[k], scales[k], 0, hidden[i], corners);
            part = bend(corners, hidden[i]);
            assert_true(part.most < 8);
            assert_true(part.hidden < -CAIRN_REAL(0.8));
            assert_true(part.evidence < whole.evidence - 5 && part.evidence > 0);
        }
    }
}

/* The object's pose becomes that of the fitted outline. */
static void test_pose_follows(void **state)
{
    cairn_vec2 corners[CORNERS];
    bent b, shifted;

    (void)state;
    draw_jug(1, 1, 0, 0, corners);
    b = bend(corners, 0);
    for (int32_t i = 0; i < tokens.count; i++) {
        lines[i].a.x += 12;
        lines[i].b.x += 12;
    }
    for (int32_t i = 0; i < CORNERS; i++)
        corners[i].x += 12;
    shifted = bend(corners, 0);
    assert_near(shifted.origin.x - b.origin.x, 12, 1.5);
    assert_near(shifted.origin.y - b.origin.y, 0, 1.5);
    assert_near(shifted.size, b.size, 3);
    draw_jug(1.12, 1.12, 0, 0, corners);
    assert_near(bend(corners, 0).size, 1.12 * (double)b.size, 4);
}

static void test_no_edges_to_fit_to(void **state)
{
    cairn_vec2 corners[CORNERS];
    bent b;

    (void)state;
    draw_jug(1, 1, 0, 63, corners);
    b = bend(corners, 63);
    assert_near(b.hidden, log(0.25), 1e-3);
    assert_true(b.evidence < -20 && cairn_is_finite(b.evidence));
    assert_true(b.most < 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_field_beside_its_reference),
        cmocka_unit_test(test_directions),
        cmocka_unit_test(test_bends_onto_edges),
        cmocka_unit_test(test_hidden_parts),
        cmocka_unit_test(test_pose_follows),
        cmocka_unit_test(test_no_edges_to_fit_to),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
