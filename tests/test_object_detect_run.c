/* Known shapes detected in drawn edge images; the field and the best place compared with a
 * reference implementation; images with nothing and with edges everywhere. */
#include "cairn/contour_search_run.h"
#include "cairn/object_detect_run.h"
#include "tests/flag_picture.h"

#include "tests/detection_tools.h"

/* Sizes from half of the flag's on, ten candidates, no grouping. The smaller sizes alone cost three
 * quarters of a search; finds_a_shape_where_it_is and accepts_unusual_images search with the defaults,
 * too. */
static cairn_object_detect_params flag_params(void)
{
    cairn_object_detect_params params = cairn_object_detect_default(WIDTH, HEIGHT);

    params.min_size = 70;
    params.candidates = 10;
    params.verify = 0;
    return params;
}

static cairn_object_detections detect(const cairn_contour_search_tokens *tokens,
                                      const cairn_object_detect_params *params)
{
    cairn_shape_model_file model = make_model();
    cairn_object_detections found = detect_flag(tokens, params);

    for (int32_t i = 0; i < found.count; i++) {
        const cairn_object_detection *d = &found.found[i];

        assert_int_equal(d->outline_count, model.model.outline_count);
        assert_in_range(d->first_outline + d->outline_count, d->outline_count, found.outline_count);
        assert_in_range(d->first_segment + d->segment_count, d->segment_count, found.segment_count);
        assert_true(d->right > d->left && d->bottom > d->top && d->size > 0);
        assert_true(d->score >= params->min_score);
        for (int32_t k = 0; k < d->outline_count; k++) {
            const cairn_contour_search_place *p = &found.outline[d->first_outline + k];

            assert_true(p->segment >= -1 && p->segment < tokens->count);
            assert_true(p->point.position.x >= d->left && p->point.position.x <= d->right);
        }
        for (int32_t k = 0; k < d->segment_count; k++)
            assert_in_range(found.segments[d->first_segment + k], 0, tokens->count - 1);
    }
    cairn_shape_model_file_free(&model);
    return found;
}

static void finds_a_shape_where_it_is(void **state)
{
    static const struct {
        double x, y, scale;
        int mirrored;
    } cases[] = {{110, 40, 1, 0}, {200, 30, 1.2, 1}, {60, 100, 0.7, 0}, {270, 60, 0.6, 1}};

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        /* By the defaults once. */
        cairn_object_detect_params params =
            i == 0 ? cairn_object_detect_default(WIDTH, HEIGHT) : flag_params();
        cairn_contour_search_tokens tokens;
        cairn_object_detections found;
        const cairn_object_detection *d;
        int32_t seen = 0;

        tokens = flag_tokens(30, cases[i].x, cases[i].y, cases[i].scale, cases[i].mirrored);
        found = detect(&tokens, &params);
        assert_true(found.count >= 1);
        d = &found.found[0];
        assert_true(share_of(d, cases[i].x, cases[i].y, cases[i].scale, cases[i].mirrored) > 0.85);
        assert_int_equal(d->mirrored, cases[i].mirrored);
        for (int32_t k = 0; k < d->outline_count; k++)
            seen += found.outline[d->first_outline + k].segment >= 0;
        assert_true(seen > 0.85 * d->outline_count);
        assert_true(d->outline_coverage > CAIRN_REAL(0.8) && d->outline_coverage < CAIRN_REAL(1.3));
        cairn_object_detect_run_free(&found);
        cairn_contour_search_run_free_tokens(&tokens);
    }
}

/* Two flags, the second one only as its mirror image; no two boxes overlap more than allowed, none
 * lies in another. */
static void finds_two_shapes(void **state)
{
    cairn_object_detect_params params = flag_params();
    cairn_contour_search_tokens tokens;
    cairn_object_detections found;
    cairn_real best, second;

    (void)state;
    clear_picture();
    draw_flag(30, 50, 1, 0);
    draw_flag(270, 50, 1, 1);
    tokens = find_tokens(0);
    params.candidates = 30;
    found = detect(&tokens, &params);
    assert_true(found.count >= 2);
    for (int32_t i = 0; i < 2; i++)
        assert_true(share_of(&found.found[i], 30, 50, 1, 0) > 0.85 ||
                    share_of(&found.found[i], 270, 50, 1, 1) > 0.85);
    assert_int_equal(found.found[0].mirrored + found.found[1].mirrored, 1);
    best = found.found[0].score;
    second = found.found[1].score;
    for (int32_t i = 0; i < found.count; i++)
        for (int32_t k = 0; k < i; k++) {
            const cairn_object_detection *a = &found.found[i], *b = &found.found[k];
            cairn_real w = cairn_min(a->right, b->right) - cairn_max(a->left, b->left),
                       h = cairn_min(a->bottom, b->bottom) - cairn_max(a->top, b->top);
            cairn_real both = w > 0 && h > 0 ? w * h : 0;

            assert_true(both <=
                        CAIRN_REAL(0.801) * cairn_min((a->right - a->left) * (a->bottom - a->top),
                                                      (b->right - b->left) * (b->bottom - b->top)));
            assert_true(both <=
                        CAIRN_REAL(0.2001) * ((a->right - a->left) * (a->bottom - a->top) +
                                              (b->right - b->left) * (b->bottom - b->top) - both));
        }
    cairn_object_detect_run_free(&found);
    params.candidates = 10;
    /* Without mirroring one is left; nothing exceeds the best. */
    params.mirror = 0;
    found = detect(&tokens, &params);
    assert_true(share_of(&found.found[0], 30, 50, 1, 0) > 0.85);
    for (int32_t i = 0; i < found.count; i++)
        assert_int_equal(found.found[i].mirrored, 0);
    cairn_object_detect_run_free(&found);
    params.mirror = 1;
    params.min_score = (best + second) / 2;
    if (best > second) {
        found = detect(&tokens, &params);
        assert_int_equal(found.count, 1);
        cairn_object_detect_run_free(&found);
    }
    cairn_contour_search_run_free_tokens(&tokens);
}

/* ---- Reference implementation ---- */

/* Agreement of the edges nearest to a cell with a direction. */
static double likely_at(const cairn_contour_search_tokens *tokens, const object_detect_level *p,
                        int32_t x, int32_t y, int32_t bin)
{
    double least = 30;

    for (int32_t i = 0; i < tokens->count; i++) {
        cairn_segment s = tokens->lines[i];
        double dx = (double)(s.b.x - s.a.x), dy = (double)(s.b.y - s.a.y), pi = 3.14159265358979;
        double turn = remainder(atan2(dy, dx) - (bin + 0.5) * pi / 12, pi) / 0.35;
        int32_t steps = 1 + (int32_t)(2 * (double)cairn_segment_length(s) / (double)p->cell_size);

        for (int32_t k = 0; k <= steps && fabs(turn) <= 2.2; k++) {
            int32_t u = (int32_t)floor(((double)s.a.x + dx * k / steps) / (double)p->cell_size) - x;
            int32_t v = (int32_t)floor(((double)s.a.y + dy * k / steps) / (double)p->cell_size) - y;

            if (abs(u) <= 3 && abs(v) <= 3)
                least = fmin(least, -log(fmax(0.2, 2 * (double)tokens->strength_rank[i])) +
                                        turn * turn / 2 + (u * u + v * v) / 2.0);
        }
    }
    return exp(-least);
}

static void weighs_edges_as_the_reference_does(void **state)
{
    cairn_object_detect_params params = cairn_object_detect_default(WIDTH, HEIGHT);
    cairn_contour_search_tokens tokens;
    cairn_object_detect_field *field;
    cairn_pool pool;
    const object_detect_level *p;
    double *likely;

    (void)state;
    tokens = flag_tokens(30, 110, 40, 1, 0);
    params.min_size = params.max_size = 250;
    field = field_of(&pool, &tokens, &params);
    assert_int_equal(field->levels, 1);
    p = &field->level[0];
    likely = malloc((size_t)(p->width * p->height) * sizeof *likely);
    assert_non_null(likely);
    for (int32_t bin = 0; bin < OBJECT_DETECT_BINS; bin += 5) {
        const float *llr = &p->llr[(size_t)bin * cairn_object_detect_layer(p)];

        for (int32_t i = 0; i < p->width * p->height; i++)
            likely[i] = likely_at(&tokens, p, i % p->width, i / p->width, bin);
        for (int32_t i = 0; i < p->width * p->height; i++) {
            int32_t x = i % p->width, y = i / p->width, cells = 0;
            double sum = 0;

            for (int32_t v = y - 30; v < y + 30; v++)
                for (int32_t u = x - 30; u < x + 30; u++)
                    if (u >= 0 && v >= 0 && u < p->width && v < p->height) {
                        sum += likely[v * p->width + u];
                        cells++;
                    }
            assert_near(llr[(size_t)(y + OBJECT_DETECT_MARGIN_CELLS) * cairn_object_detect_row(p) +
                            (size_t)(x + OBJECT_DETECT_MARGIN_CELLS)],
                        log(0.25 + 0.75 * likely[i] / fmax(0.02, sum / cells)), 1e-4);
        }
        assert_near(llr[0], -0.7, 1e-6);
        assert_near(llr[cairn_object_detect_layer(p) - 1], -0.7, 1e-6);
    }
    free(likely);
    test_pool_free(&pool);
    cairn_contour_search_run_free_tokens(&tokens);
}

/* The mean log-likelihood ratio of a flag's samples at a cell. */
static double mean_llr(const object_detect_level *p, const cairn_shape_model *m, double aspect,
                       int32_t x, int32_t y)
{
    double sum = 0;

    for (int32_t i = 0; i < m->outline_count; i++) {
        const cairn_oriented_point *o = &m->outline[i];
        cairn_vec2 along = {(cairn_real)sqrt(aspect) * o->direction.x,
                            (cairn_real)(1 / sqrt(aspect)) * o->direction.y};
        int32_t u =
            x + (int32_t)lrint(sqrt(aspect) * (double)o->position.x * OBJECT_DETECT_CELLS_PER_SIZE);
        int32_t v =
            y + (int32_t)lrint((double)o->position.y / sqrt(aspect) * OBJECT_DETECT_CELLS_PER_SIZE);
        size_t layer = (size_t)cairn_contour_search_field_bin(cairn_vec2_unit(along)) *
                       cairn_object_detect_layer(p);

        sum +=
            (double)p->llr[layer +
                           (size_t)(v + OBJECT_DETECT_MARGIN_CELLS) * cairn_object_detect_row(p) +
                           (size_t)(u + OBJECT_DETECT_MARGIN_CELLS)];
    }
    return sum / m->outline_count;
}

static void examines_every_place(void **state)
{
    static const double aspects[] = {1, 0.8, 1.25, 0.64, 1.5625};
    cairn_object_detect_params params = cairn_object_detect_default(WIDTH, HEIGHT);
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens;
    cairn_object_detect_run_image *image;
    cairn_object_detect_field *field;
    cairn_pool pool;
    cairn_object_detections found;
    double best = -1e9;

    (void)state;
    tokens = flag_tokens(30, 150, 70, 0.9, 0);
    params.min_size = params.max_size = 140;
    params.mirror = 0;
    params.candidates = 1;
    params.min_score = -100;
    field = field_of(&pool, &tokens, &params);
    for (int32_t k = 0; k < 5; k++)
        for (int32_t y = 0; y < field->level[0].height; y++)
            for (int32_t x = 0; x < field->level[0].width; x++)
                best = fmax(best, mean_llr(&field->level[0], &model.model, aspects[k], x, y));
    assert_ok(cairn_object_detect_run_make(&image, &tokens, &params, "edges", &error));
    assert_ok(cairn_object_detect_run(&found, image, &model.model, "edges", &error));
    assert_int_equal(found.count, 1);
    assert_near(found.found[0].rigid_evidence, best, 1e-4);
    cairn_object_detect_run_free(&found);
    cairn_object_detect_run_free_image(image);
    test_pool_free(&pool);
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

/* ---- Quality of a fitted outline ---- */

/* The nearest edge in sigmas of 0.012 sizes and of a sine of 0.35, over all edges. */
static double close_of(const cairn_contour_search_tokens *tokens,
                       const cairn_contour_search_place *places, const cairn_object_detection *d)
{
    double sum = 0;

    for (int32_t i = 0; i < d->outline_count; i++) {
        cairn_oriented_point at = places[i].point;
        double best = 0;

        for (int32_t k = 0; k < tokens->count; k++) {
            cairn_segment s = tokens->lines[k];
            double x = (double)(s.b.x - s.a.x), y = (double)(s.b.y - s.a.y), length = hypot(x, y);
            double u = (double)(at.position.x - s.a.x), v = (double)(at.position.y - s.a.y);
            double share = fmin(1, fmax(0, (u * x + v * y) / (length * length)));
            double far = hypot(u - share * x, v - share * y) / (double)d->size / 0.012;
            double turn =
                fabs(x * (double)at.direction.y - y * (double)at.direction.x) / length / 0.35;

            if (far <= 4 && turn <= 2)
                best = fmax(best, exp(-(far * far + turn * turn) / 2));
        }
        sum += best;
    }
    return sum / d->outline_count;
}

/* Angles between the vectors from two samples before to two behind, by atan2; the flag has one
 * outline. */
static double turned_of(const cairn_shape_model *m, const cairn_contour_search_place *places,
                        const cairn_object_detection *d)
{
    double sum = 0;
    int32_t n = m->outline_count;

    for (int32_t i = 0; i < n; i++) {
        int32_t a = (i + n - 2) % n, b = (i + 2) % n;
        double x =
            (double)(m->outline[b].position.x - m->outline[a].position.x) * (d->mirrored ? -1 : 1);
        double was = atan2((double)(m->outline[b].position.y - m->outline[a].position.y), x);
        double is = atan2((double)(places[b].point.position.y - places[a].point.position.y),
                          (double)(places[b].point.position.x - places[a].point.position.x));

        sum += 1 - cos(was - is);
    }
    return sum / n;
}

/* Residual of one coordinate after the best a + b x + c y: Gram and Schmidt on the columns, in
 * place of normal equations. */
static double residual_of(const cairn_shape_model *m, double *value, double slope[2])
{
    enum { MAX_COUNT = 1024 };
    static double column[3][MAX_COUNT];
    double scale[3], along[3][3] = {{0}}, part[3], left = 0;
    int32_t n = m->outline_count;

    assert_in_range(n, 3, MAX_COUNT);
    for (int32_t i = 0; i < n; i++) {
        column[0][i] = 1;
        column[1][i] = (double)m->outline[i].position.x;
        column[2][i] = (double)m->outline[i].position.y;
    }
    for (int32_t k = 0; k < 3; k++) {
        for (int32_t j = 0; j < k; j++) {
            for (int32_t i = 0; i < n; i++)
                along[k][j] += column[k][i] * column[j][i] / scale[j];
            for (int32_t i = 0; i < n; i++)
                column[k][i] -= along[k][j] * column[j][i];
        }
        scale[k] = part[k] = 0;
        for (int32_t i = 0; i < n; i++)
            scale[k] += column[k][i] * column[k][i];
        for (int32_t i = 0; i < n; i++)
            part[k] += column[k][i] * value[i] / scale[k];
        for (int32_t i = 0; i < n; i++)
            value[i] -= part[k] * column[k][i];
    }
    slope[1] = part[2];
    slope[0] = part[1] - along[2][1] * part[2];
    for (int32_t i = 0; i < n; i++)
        left += value[i] * value[i];
    return left;
}

static double deformation_of(const cairn_shape_model *m, const cairn_contour_search_place *places)
{
    static double value[1024];
    double slope[2][2], left;

    for (int32_t i = 0; i < m->outline_count; i++)
        value[i] = (double)places[i].point.position.x;
    left = residual_of(m, value, slope[0]);
    for (int32_t i = 0; i < m->outline_count; i++)
        value[i] = (double)places[i].point.position.y;
    left += residual_of(m, value, slope[1]);
    return fmin(1, sqrt(left / m->outline_count /
                        fabs(slope[0][0] * slope[1][1] - slope[0][1] * slope[1][0])));
}

static void measures_how_the_outline_fits(void **state)
{
    cairn_object_detect_params params = flag_params();
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens;
    cairn_object_detections found;

    (void)state;
    clear_picture();
    draw_clutter(60);
    draw_flag(30, 60, 1, 0);
    draw_flag(270, 60, 1, 1);
    tokens = find_tokens(0);
    params.candidates = 30;
    params.min_score = -100;
    found = detect(&tokens, &params);
    assert_true(found.count >= 4);
    for (int32_t i = 0; i < found.count; i++) {
        const cairn_object_detection *d = &found.found[i];
        const cairn_contour_search_place *places = &found.outline[d->first_outline];

        assert_near(d->edge_proximity, close_of(&tokens, places, d), 1e-3);
        assert_near(d->tangent_deviation, turned_of(&model.model, places, d), 1e-4);
        assert_near(d->deformation, deformation_of(&model.model, places), 1e-4);
        /* The flags are as drawn; fits along clutter are not. */
        assert_true(i < 2 ? d->edge_proximity > CAIRN_REAL(0.8)
                          : d->edge_proximity < found.found[1].edge_proximity);
        assert_true(i < 2 ? d->tangent_deviation < CAIRN_REAL(0.03)
                          : d->tangent_deviation > found.found[1].tangent_deviation);
        assert_true(i < 2 ? d->deformation < CAIRN_REAL(0.03)
                          : d->deformation > found.found[1].deformation);
        assert_true(d->rigid_proximity >= 0 && d->rigid_proximity <= d->edge_proximity);
        assert_true(i < 2 ? d->rigid_proximity > CAIRN_REAL(0.8) * d->edge_proximity
                          : d->rigid_proximity < found.found[1].rigid_proximity / 2);
    }
    cairn_object_detect_run_free(&found);
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

/* An occluding disc: no edges within, its own edges about it. */
static void hide_behind_disc(int32_t x, int32_t y, int32_t radius)
{
    for (int32_t v = y - radius; v <= y + radius; v++)
        for (int32_t u = x - radius; u <= x + radius; u++)
            if (u >= 0 && v >= 0 && u < WIDTH && v < HEIGHT &&
                (u - x) * (u - x) + (v - y) * (v - y) <= radius * radius)
                edges[v * WIDTH + u] = 0;
    for (int32_t i = 0; i < 60; i++)
        draw_line(x + radius * cos(i * 0.10471976), y + radius * sin(i * 0.10471976),
                  x + radius * cos((i + 1) * 0.10471976), y + radius * sin((i + 1) * 0.10471976));
}

/* Distance of an outline from every similarity of the drawn one: of its triangles with the first
 * and a distant place, the third places, px. */
static double unlike(const cairn_shape_model *m, const cairn_contour_search_place *places)
{
    int32_t far = m->outline_count / 2;
    cairn_vec2 a = m->outline[0].position, b = cairn_vec2_sub(m->outline[far].position, a),
               p = places[0].point.position, q = cairn_vec2_sub(places[far].point.position, p);
    double length = (double)cairn_vec2_norm_squared(b), most = 0;

    for (int32_t i = 0; i < m->outline_count; i++) {
        cairn_vec2 c = cairn_vec2_sub(m->outline[i].position, a),
                   r = cairn_vec2_sub(places[i].point.position, p);
        double along = (double)cairn_vec2_dot(b, c) / length,
               across = (double)cairn_vec2_cross(b, c) / length;

        most = fmax(most, hypot((double)r.x - along * (double)q.x + across * (double)q.y,
                                (double)r.y - along * (double)q.y - across * (double)q.x));
    }
    return most;
}

/* Half of the cloth behind a disc: with occlusion allowed it is fitted to the rest with a score
 * above 0; by default it is deformed round the disc. */
static void finds_occluded_objects(void **state)
{
    cairn_object_detect_params params = flag_params();
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens;
    cairn_object_detections found, bent;

    (void)state;
    clear_picture();
    draw_clutter(20);
    draw_flag(110, 50, 1, 0);
    hide_behind_disc(195, 70, 42);
    tokens = find_tokens(0);
    params.mirror = 0;
    params.min_score = -100;
    bent = detect(&tokens, &params);
    params.occluded = 1;
    found = detect(&tokens, &params);
    assert_true(found.count >= 1 && bent.count >= 1);
    assert_true(found.found[0].score > 0);
    assert_true(share_of(&found.found[0], 110, 50, 1, 0) > 0.9);
    assert_true(share_of(&bent.found[0], 110, 50, 1, 0) < 0.8);
    for (int32_t i = 0; i < found.count; i++)
        assert_true(unlike(&model.model, &found.outline[found.found[i].first_outline]) < 0.01);
    assert_true(unlike(&model.model, &bent.outline[bent.found[0].first_outline]) > 1);
    cairn_object_detect_run_free(&found);
    cairn_object_detect_run_free(&bent);
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

/* The flag rotated about its middle; sides from ... on; the others are hidden. */
static void draw_turned_flag(double x, double y, double turn, int32_t first, int32_t sides)
{
    for (int32_t i = first; i < first + sides; i++) {
        double p[2][2];

        for (int32_t k = 0; k < 2; k++) {
            double u = (double)flag[(i + k) % CORNERS].x - 40,
                   v = (double)flag[(i + k) % CORNERS].y - 60;

            p[k][0] = x + cos(turn) * u - sin(turn) * v;
            p[k][1] = y + sin(turn) * u + cos(turn) * v;
        }
        draw_line(p[0][0], p[0][1], p[1][0], p[1][1]);
    }
}

/* A flag that leans by 12 degrees and has no pole: candidates are upright, grouping finds the
 * leaning one, and its evidence counts whatever the weight of verification. */
static void finds_rotated_and_occluded_objects_by_grouping(void **state)
{
    cairn_object_detect_params params = flag_params();
    cairn_contour_search_tokens tokens;
    cairn_object_detections found;

    (void)state;
    clear_picture();
    draw_clutter(40);
    draw_turned_flag(150, 110, 0.21, 0, 7);
    tokens = find_tokens(0);
    params.occluded = 1;
    found = detect(&tokens, &params);
    assert_int_equal(found.count, 1);
    assert_true(found.found[0].grouped_evidence > 13);
    assert_near(found.found[0].origin.x, 150, 12);
    assert_near(found.found[0].size, hypot(80, 120), 12);
    cairn_object_detect_run_free(&found);
    cairn_contour_search_run_free_tokens(&tokens);
}

/* Flags of two sizes, one mirrored: both are grouped, the one of most evidence first, at their
 * places, and nothing else. */
static void groups_in_all_sizes(void **state)
{
    cairn_object_detect_params params = cairn_object_detect_default(WIDTH, HEIGHT);
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens;
    cairn_object_detect_field *field;
    cairn_object_detector *detector;
    cairn_pool field_pool, pool;
    cairn_object_detection at[3] = {{.left = 30, .top = 50, .right = 110, .bottom = 170},
                                    {.left = 214, .top = 120, .right = 270, .bottom = 204},
                                    {.left = 140, .top = 10, .right = 200, .bottom = 90}};
    cairn_real evidence[3];

    (void)state;
    clear_picture();
    draw_flag(30, 50, 1, 0);
    draw_flag(270, 120, 0.7, 1);
    tokens = find_tokens(0);
    for (int32_t mirror = 1; mirror >= 0; mirror--) {
        params.mirror = mirror;
        const object_detect_group_search *made;
        cairn_budget budget = {CAIRN_UNBOUNDED};

        field = field_of(&field_pool, &tokens, &params);
        pool = test_pool(cairn_object_detect_memory(&params));
        assert_ok(cairn_object_detect_create(&detector, &pool, &params));
        assert_ok(cairn_object_detect_begin(detector, field, &model.model, NULL));
        cairn_object_detect_group_begin(detector);
        assert_true(cairn_object_detect_group_step(detector, &budget));
        made = &detector->group;
        for (int32_t i = 0; i < made->count; i++) {
            assert_true(i == 0 || made->list[i].found.evidence <= made->list[i - 1].found.evidence);
            assert_true(mirror || !made->list[i].mirrored);
        }
        for (int32_t i = 0; i < 3; i++)
            evidence[i] = cairn_object_detect_grouped_evidence(made, &at[i]);
        assert_true(evidence[0] > 13 && evidence[2] == 0);
        assert_true(mirror ? evidence[1] > 13 : evidence[1] < evidence[0] / 2);
        test_pool_free(&pool);
        test_pool_free(&field_pool);
    }
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

/* By chance more small outlines are found along edges than the capacity, and the worse half of them
 * is discarded: the large one, which comes last, is found still. */
static void finds_a_large_shape_among_very_many_peaks(void **state)
{
    cairn_object_detect_params params = cairn_object_detect_default(WIDTH, HEIGHT);
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens;
    cairn_object_detections found;
    cairn_object_detect_field *field;
    cairn_object_detector *detector;
    cairn_pool field_pool, pool;
    cairn_status status = CAIRN_MORE;
    int32_t peaks = 0, discarded = 0;

    (void)state;
    tokens = flag_tokens(600, 100, 20, 1.5, 0);
    params.min_size = 18;
    params.max_size = 240;
    params.max_peaks = 4096;
    params.mirror = 0;
    params.verify = 0;
    field = field_of(&field_pool, &tokens, &params);
    pool = test_pool(cairn_object_detect_memory(&params));
    assert_ok(cairn_object_detect_create(&detector, &pool, &params));
    assert_ok(cairn_object_detect_begin(detector, field, &model.model, NULL));
    while (status == CAIRN_MORE) {
        cairn_budget budget = {1000};

        status = cairn_object_detect_step(detector, &budget);
        discarded |= detector->kept == 0 && detector->count < peaks;
        peaks = detector->count;
    }
    assert_ok(status);
    assert_true(discarded);
    found = cairn_object_detect_read(detector);
    assert_true(found.count >= 1);
    assert_true(share_of(&found.found[0], 100, 20, 1.5, 0) > 0.85);
    test_pool_free(&pool);
    test_pool_free(&field_pool);
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

/* Grouping finds the flag, too: its score rises in proportion to the weight, before non-maximum
 * suppression. With zero weight nothing is grouped. */
static void verifies_what_is_grouped_as_well(void **state)
{
    cairn_object_detect_params params = flag_params();
    cairn_contour_search_tokens tokens;
    cairn_object_detections plain, found;
    const cairn_real weight = cairn_object_detect_default(WIDTH, HEIGHT).verify;

    (void)state;
    tokens = flag_tokens(30, 110, 40, 1, 0);
    params.mirror = 0;
    plain = detect(&tokens, &params);
    assert_true(plain.count >= 1 && plain.found[0].grouped_evidence == 0);
    for (int32_t times = 1; times <= 2; times++) {
        params.verify = (cairn_real)times * weight;
        /* A score that would be too low without it. */
        params.min_score = plain.found[0].score + params.verify;
        found = detect(&tokens, &params);
        assert_int_equal(found.count, 1);
        assert_true(found.found[0].left == plain.found[0].left &&
                    found.found[0].grouped_evidence > 20);
        assert_near(found.found[0].score - plain.found[0].score,
                    params.verify * found.found[0].grouped_evidence, 1e-3);
        cairn_object_detect_run_free(&found);
    }
    params.verify = 0;
    found = detect(&tokens, &params);
    assert_int_equal(found.count, 0);
    cairn_object_detect_run_free(&found);
    cairn_object_detect_run_free(&plain);
    cairn_contour_search_run_free_tokens(&tokens);
}

/* ---- Unusual images, refusals ---- */

static void accepts_unusual_images(void **state)
{
    cairn_object_detect_params params = flag_params();
    cairn_contour_search_tokens tokens;
    cairn_object_detections found;

    (void)state;
    assert_nothing_without_edges(detect, &params);
    params = cairn_object_detect_default(WIDTH, HEIGHT);
    draw_edges_everywhere();
    tokens = find_tokens(0);
    assert_true(tokens.count > 1000);
    found = detect(&tokens, &params);
    cairn_object_detect_run_free(&found);
    cairn_contour_search_run_free_tokens(&tokens);
}

static void refuses_what_cannot_be(void **state)
{
    cairn_oriented_point line[3] = {{{0, 0}, {1, 0}}, {{0, 0}, {1, 0}}, {{0, 0}, {1, 0}}};
    enum { MANY = 4097 };
    static cairn_oriented_point many[MANY];
    static const char *const what[] = {
        "edges: min_size is 7, expected 8 to 16384",
        "edges: min_size is nan, expected 8 to 16384",
        "edges: params that contradict each other, expected max_size: at least min_size",
        "edges: max_size is inf, expected 8 to 16384",
        "edges: candidates is 0, expected 1 to 64",
        "edges: candidates is 65, expected 1 to 64",
        "edges: overlap is -0.1, expected 0 to 1",
        "edges: overlap is 1.1, expected 0 to 1",
        "edges: min_score is nan, expected -",
        "edges: overlap is nan, expected 0 to 1",
        "edges: verify is -1, expected 0 to 100",
        "edges: verify is 101, expected 0 to 100",
        "edges: verify is nan, expected 0 to 100",
        "edges: mirror is 2, expected 0 to 1"};
    enum { BAD_CASES = sizeof what / sizeof *what };
    cairn_object_detect_params good = cairn_object_detect_default(WIDTH, HEIGHT), bad[BAD_CASES];
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens = {.width = WIDTH, .height = HEIGHT};
    cairn_object_detect_run_image *field;
    cairn_object_detections found;

    (void)state;
    assert_near(good.min_size, hypot(WIDTH, HEIGHT) / 10, 1e-3);
    assert_near(good.max_size, hypot(WIDTH, HEIGHT), 1e-3);
    assert_near(cairn_object_detect_default(20, 10).min_size, 24, 0);
    assert_near(cairn_object_detect_default(20, 10).max_size, 24, 0);
    for (int i = 0; i < BAD_CASES; i++)
        bad[i] = good;
    bad[0].min_size = 7;
    bad[1].min_size = (cairn_real)NAN;
    bad[2].max_size = bad[2].min_size - 1;
    bad[3].max_size = (cairn_real)INFINITY;
    bad[4].candidates = 0;
    bad[5].candidates = 65;
    bad[6].overlap = CAIRN_REAL(-0.1);
    bad[7].overlap = CAIRN_REAL(1.1);
    bad[8].min_score = (cairn_real)NAN;
    bad[9].overlap = (cairn_real)NAN;
    bad[10].verify = -1;
    bad[11].verify = 101;
    bad[12].verify = (cairn_real)NAN;
    bad[13].mirror = 2;
    for (int i = 0; i < BAD_CASES; i++) {
        field = (cairn_object_detect_run_image *)&found;
        assert_status(cairn_object_detect_run_make(&field, &tokens, &bad[i], "edges", &error),
                      CAIRN_BAD_ARGUMENT);
        assert_null(field);
        assert_error_holds(what[i]);
    }
    assert_ok(cairn_object_detect_run_make(&field, &tokens, &good, "edges", &error));
    model.model.size = 0;
    assert_status(cairn_object_detect_run(&found, field, &model.model, "edges", &error),
                  CAIRN_BAD_ARGUMENT);
    assert_error_holds("no model, expected a size");
    model.model.size = 1;
    model.model.outline_count = 2;
    assert_status(cairn_object_detect_run(&found, field, &model.model, "edges", &error),
                  CAIRN_BAD_ARGUMENT);
    assert_error_holds("fewer than 3 samples, expected an outline");
    model.model.outline_count = 3;
    for (int32_t i = 0; i < MANY; i++)
        many[i] = line[0];
    model.model.outline = many;
    model.model.outline_count = MANY;
    assert_status(cairn_object_detect_run(&found, field, &model.model, "edges", &error),
                  CAIRN_FULL);
    assert_error_holds("edges: max_outline is 4097, expected 3 to 4096");
    model.model.outline_count = 3;
    for (int32_t upright = 0; upright < 2; upright++) {
        for (int32_t i = 0; i < 3; i++)
            line[i].position =
                upright ? (cairn_vec2){0, (cairn_real)i / 10} : (cairn_vec2){(cairn_real)i / 10, 0};
        model.model.outline = line;
        assert_status(cairn_object_detect_run(&found, field, &model.model, "edges", &error),
                      CAIRN_BAD_ARGUMENT);
        assert_error_holds("along one straight line");
    }
    cairn_object_detect_run_free_image(field);
    cairn_object_detect_run_free_image(NULL);
    cairn_shape_model_file_free(&model);
}

/* Whatever the segments are, params that fit them are made; the field says which one is refused. */
static void refuses_segments_that_are_not_finite(void **state)
{
    const cairn_real far[] = {(cairn_real)NAN, (cairn_real)INFINITY, -(cairn_real)INFINITY};
    cairn_object_detect_params params = cairn_object_detect_default(WIDTH, HEIGHT);
    cairn_segment lines[2] = {{{10, 10}, {20, 10}}, {{20, 10}, {30, 10}}};
    int32_t chain[2] = {0, 0};
    cairn_real strength_rank[2] = {CAIRN_REAL(0.5), 1};
    cairn_contour_search_tokens tokens = {.lines = lines,
                                          .chain = chain,
                                          .strength_rank = strength_rank,
                                          .count = 2,
                                          .chain_count = 1,
                                          .width = WIDTH,
                                          .height = HEIGHT};
    cairn_object_detect_run_image *field;

    (void)state;
    for (int32_t i = 0; i < 3; i++) {
        lines[1].b.x = far[i];
        assert_status(cairn_object_detect_run_make(&field, &tokens, &params, "edges", &error),
                      CAIRN_NOT_FINITE);
        assert_error_holds("edges: a segment that is not finite");
    }
    lines[1].b.x = 30;
    assert_ok(cairn_object_detect_run_make(&field, &tokens, &params, "edges", &error));
    cairn_object_detect_run_free_image(field);
}

/* An object so small that the image has too many cells for it; the largest number of sizes. */
static void takes_sizes_up_to_the_bounds(void **state)
{
    cairn_object_detect_params params = cairn_object_detect_default(WIDTH, HEIGHT);
    cairn_contour_search_tokens tokens = {.width = 8192, .height = 20};
    cairn_object_detect_run_image *field;
    cairn_object_detect_field *bounds;
    cairn_pool pool;

    (void)state;
    for (int32_t turned = 0; turned < 2; turned++) {
        params.min_size = params.max_size = 163;
        assert_status(cairn_object_detect_run_make(&field, &tokens, &params, "edges", &error),
                      CAIRN_BAD_ARGUMENT);
        assert_error_holds("expected min_size: at least a fiftieth of max_width and max_height");
        params.min_size = params.max_size = 164;
        assert_ok(cairn_object_detect_run_make(&field, &tokens, &params, "edges", &error));
        cairn_object_detect_run_free_image(field);
        tokens.width = 20;
        tokens.height = 8192;
    }
    tokens.height = 8193;
    assert_status(cairn_object_detect_run_make(&field, &tokens, &params, "edges", &error),
                  CAIRN_BAD_ARGUMENT);
    assert_error_holds("edges: max_height is 8193, expected 1 to 8192");
    tokens.height = 10;
    params.min_size = 8;
    params.max_size = 16384;
    bounds = field_of(&pool, &tokens, &params);
    assert_int_equal(bounds->levels, OBJECT_DETECT_MAX_LEVELS);
    assert_true(bounds->level[OBJECT_DETECT_MAX_LEVELS - 1].size <= 16384 &&
                bounds->level[OBJECT_DETECT_MAX_LEVELS - 1].size * CAIRN_REAL(1.2) > 16384);
    test_pool_free(&pool);
}

/* An outline that would reach beyond the field's margins. */
static void refuses_outlines_that_reach_too_far(void **state)
{
    static const cairn_real far[] = {CAIRN_REAL(0.55), CAIRN_REAL(0.9), CAIRN_REAL(1e30),
                                     CAIRN_REAL_MAX};
    cairn_object_detect_params params = cairn_object_detect_default(WIDTH, HEIGHT);
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens = {.width = WIDTH, .height = HEIGHT};
    cairn_oriented_point *outline = malloc((size_t)model.model.outline_count * sizeof *outline);
    cairn_shape_model_sample sample = model.model.samples[0];
    cairn_shape_model_path path = {0, 1, -1, -1, 1};
    cairn_shape_model bad = model.model;
    cairn_object_detect_run_image *field;
    cairn_object_detections found;

    (void)state;
    assert_non_null(outline);
    assert_ok(cairn_object_detect_run_make(&field, &tokens, &params, "edges", &error));
    bad.outline = outline;
    for (size_t i = 0; i < 4 * sizeof far / sizeof *far; i++) {
        cairn_real position = far[i / 4] * (cairn_real)(i % 2 == 0 ? 1 : -1);

        memcpy(outline, model.model.outline, (size_t)bad.outline_count * sizeof *outline);
        if (i % 4 < 2)
            outline[bad.outline_count - 1].position.x = position;
        else
            outline[bad.outline_count - 1].position.y = position;
        assert_status(cairn_object_detect_run(&found, field, &bad, "edges", &error),
                      CAIRN_BAD_ARGUMENT);
        assert_error_holds("the outline extends farther from its origin than half its size");
    }
    /* One that reaches the margin. */
    memcpy(outline, model.model.outline, (size_t)bad.outline_count * sizeof *outline);
    outline[bad.outline_count - 1].position = model.model.outline[0].position;
    outline[0].position.x = CAIRN_REAL(0.53);
    outline[0].position.y = CAIRN_REAL(-0.53);
    assert_ok(cairn_object_detect_run(&found, field, &bad, "edges", &error));
    assert_int_equal(found.count, 0);
    cairn_object_detect_run_free(&found);
    bad = model.model;
    bad.samples = &sample;
    bad.paths = &path;
    bad.sample_count = bad.path_count = 1;
    sample.centre.x = (cairn_real)NAN;
    assert_status(cairn_object_detect_run(&found, field, &bad, "edges", &error), CAIRN_NOT_FINITE);
    assert_error_holds("a sample that is not finite");
    free(outline);
    cairn_object_detect_run_free_image(field);
    cairn_shape_model_file_free(&model);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(finds_a_shape_where_it_is),
        cmocka_unit_test(finds_two_shapes),
        cmocka_unit_test(weighs_edges_as_the_reference_does),
        cmocka_unit_test(examines_every_place),
        cmocka_unit_test(measures_how_the_outline_fits),
        cmocka_unit_test(finds_occluded_objects),
        cmocka_unit_test(finds_rotated_and_occluded_objects_by_grouping),
        cmocka_unit_test(groups_in_all_sizes),
        cmocka_unit_test(finds_a_large_shape_among_very_many_peaks),
        cmocka_unit_test(verifies_what_is_grouped_as_well),
        cmocka_unit_test(accepts_unusual_images),
        cmocka_unit_test(refuses_what_cannot_be),
        cmocka_unit_test(refuses_segments_that_are_not_finite),
        cmocka_unit_test(takes_sizes_up_to_the_bounds),
        cmocka_unit_test(refuses_outlines_that_reach_too_far),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
