/* The search for contours of known shapes in drawn edge images: found at their places, mirrored
 * too, with both kinds of tokens; the trace; images with nothing, with edges everywhere, and too
 * large ones. */
#include "cairn/contour_search_run.h"
#include "tests/flag_picture.h"

#include "tests/detection_tools.h"

static int32_t samples; /* of the model searched last */

static cairn_contour_search_result run(const cairn_contour_search_tokens *tokens,
                                       const cairn_contour_search_params *params)
{
    cairn_shape_model_file model = make_model();
    cairn_contour_search_result result;

    assert_ok(cairn_contour_search_run(&result, tokens, &model.model, params, "edges", &error));
    samples = model.model.sample_count;
    cairn_shape_model_file_free(&model);
    return result;
}

/* Every index is within the list it refers to. */
static void assert_whole(const cairn_contour_search_result *r, const cairn_contour_search_tokens *t)
{
    for (int32_t i = 0; i < r->object_count; i++) {
        const cairn_contour_search_object *o = &r->objects[i];

        assert_in_range(o->found.first, 0, r->segment_count);
        assert_in_range(o->found.first + o->found.count, o->found.first, r->segment_count);
        assert_in_range(o->first_disc, 0, r->disc_count - 1);
        if (i > 0)
            assert_true(o->found.evidence <= r->objects[i - 1].found.evidence);
    }
    for (int32_t i = 0; i < r->segment_count; i++)
        assert_in_range(r->segments[i], 0, t->count - 1);
    for (int32_t i = 0; i < r->disc_count; i++)
        for (int32_t side = 0; side < 2; side++)
            assert_true(r->discs[i].side[side] >= -1 && r->discs[i].side[side] < t->count);
}

/* A search that always reports its best candidate. */
static cairn_contour_search_params generous(void)
{
    cairn_contour_search_params params = cairn_contour_search_default(WIDTH, HEIGHT);

    params.min_score = CAIRN_REAL(0.3);
    params.grouping.min_evidence = 1;
    return params;
}

/* The same in sizes about that of the flag. */
static cairn_contour_search_params of_the_flags_size(void)
{
    cairn_contour_search_params params = generous();

    params.min_size = 120;
    params.max_size = 170;
    return params;
}

static void check_found(double x, double y, double scale, int mirrored, int32_t edgels)
{
    cairn_contour_search_params params = generous();
    double size = scale * hypot(80, 120);
    cairn_contour_search_tokens tokens;
    cairn_contour_search_result r;
    const cairn_contour_search_object *o;
    int32_t sides = 0;

    clear_picture();
    draw_clutter(30);
    draw_flag(x, y, scale, mirrored);
    tokens = find_tokens(edgels);
    params.min_size = (cairn_real)(0.7 * size);
    params.max_size = (cairn_real)(1.4 * size);
    r = run(&tokens, &params);
    assert_whole(&r, &tokens);
    assert_true(r.object_count >= 1);
    o = &r.objects[0];
    assert_int_equal(o->mirrored, mirrored);
    assert_near(o->found.size, size, 0.06 * size);
    assert_near(o->found.origin.x, x + (mirrored ? -40 : 40) * scale, 0.06 * size);
    assert_near(o->found.origin.y, y + 60 * scale, 0.06 * size);
    assert_true(r.best_score >= o->found.score);
    /* Most discs of the axis have both sides, and lie inside the flag. */
    for (int32_t k = 0; k < samples; k++) {
        const cairn_contour_search_disc *d = &r.discs[o->first_disc + k];

        assert_int_equal(d->sample, k);
        assert_true(d->radius > 0);
        sides += (d->side[0] >= 0) + (d->side[1] >= 0);
    }
    assert_true(sides >= 12 * samples / 10);
    cairn_contour_search_run_free(&r);
    assert_null(r.objects);
    cairn_contour_search_run_free_tokens(&tokens);
}

static void test_found_as_it_is_and_mirrored(void **state)
{
    (void)state;
    check_found(60, 40, 1, 0, 0);
    check_found(180, 60, 1.2, 1, 0);
}

static void test_found_among_edgels(void **state)
{
    (void)state;
    check_found(60, 40, 1, 0, 1);
}

/* Without mirroring there is one trace, and the mirrored flag is not the best. */
static void test_without_mirror(void **state)
{
    cairn_contour_search_params params = generous();
    cairn_contour_search_tokens tokens;
    cairn_contour_search_result r;

    (void)state;
    tokens = flag_tokens(0, 180, 60, 1, 1);
    params.mirror = 0;
    r = run(&tokens, &params);
    assert_null(r.trace[1]);
    assert_null(r.mode_counts[1]);
    assert_int_equal(r.steps[1] + r.hypothesis_counts[1], 0);
    for (int32_t i = 0; i < r.object_count; i++)
        assert_int_equal(r.objects[i].mirrored, 0);
    cairn_contour_search_run_free(&r);
    cairn_contour_search_run_free_tokens(&tokens);
}

static void test_both_of_two(void **state)
{
    cairn_contour_search_params params = of_the_flags_size();
    cairn_contour_search_tokens tokens;
    cairn_contour_search_result r;
    int32_t found[2] = {0, 0};

    (void)state;
    clear_picture();
    draw_flag(20, 50, 1, 0);
    draw_flag(280, 50, 1, 1);
    tokens = find_tokens(0);
    r = run(&tokens, &params);
    assert_true(r.object_count >= 2);
    for (int32_t i = 0; i < 2; i++)
        found[r.objects[i].mirrored]++;
    assert_int_equal(found[0], 1);
    assert_int_equal(found[1], 1);
    assert_near(r.objects[0].mirrored ? r.objects[1].found.origin.x : r.objects[0].found.origin.x,
                60, 6);
    cairn_contour_search_run_free(&r);
    cairn_contour_search_run_free_tokens(&tokens);
}

/* Of a flag alone in the image all edges but short ones at the corners belong to the object, each
 * segment once. */
/* A flag whose tip is cut off by the border of the image. */
static void test_cut_by_the_border(void **state)
{
    cairn_contour_search_params params = of_the_flags_size();
    cairn_contour_search_tokens tokens;
    cairn_contour_search_result r;

    (void)state;
    tokens = flag_tokens(0, WIDTH - 55, 40, 1, 0);
    r = run(&tokens, &params);
    assert_whole(&r, &tokens);
    assert_true(r.object_count >= 1);
    assert_near(r.objects[0].found.origin.x, WIDTH - 55 + 40, 10);
    assert_near(r.objects[0].found.origin.y, 100, 10);
    assert_true(r.objects[0].found.score < CAIRN_REAL(0.95));
    cairn_contour_search_run_free(&r);
    cairn_contour_search_run_free_tokens(&tokens);
}

/* A triangle given by its three corners is a valid model. */
static void test_model_of_three_points(void **state)
{
    static const cairn_vec2 corners[] = {{0, 0}, {90, 10}, {30, 100}};
    cairn_curve outline = {corners, 3, 1};
    cairn_shape_model_builder_params builder = cairn_shape_model_builder_default();
    cairn_contour_search_params params = generous();
    cairn_shape_model_file model;
    cairn_contour_search_tokens tokens;
    cairn_contour_search_result r;

    (void)state;
    assert_ok(cairn_shape_model_file_build(&model, &outline, 1, &builder, "triangle", &error));
    clear_picture();
    for (int32_t i = 0; i < 3; i++)
        draw_line(80 + (double)corners[i].x, 50 + (double)corners[i].y,
                  80 + (double)corners[(i + 1) % 3].x, 50 + (double)corners[(i + 1) % 3].y);
    tokens = find_tokens(0);
    params.min_size = 100;
    params.max_size = 170;
    params.min_evidence = 0;
    assert_ok(cairn_contour_search_run(&r, &tokens, &model.model, &params, "edges", &error));
    assert_true(r.object_count >= 1);
    assert_near(r.objects[0].found.origin.x, 80 + (double)model.model.origin.x, 6);
    assert_near(r.objects[0].found.origin.y, 50 + (double)model.model.origin.y, 6);
    cairn_contour_search_run_free(&r);
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

static void test_completed_along_the_chains(void **state)
{
    cairn_contour_search_params params = of_the_flags_size();
    cairn_contour_search_tokens tokens;
    cairn_contour_search_result r;
    double all = 0, found = 0;
    uint8_t *seen;

    (void)state;
    tokens = flag_tokens(0, 60, 40, 1, 0);
    params.mirror = 0;
    r = run(&tokens, &params);
    assert_true(r.object_count >= 1);
    seen = calloc((size_t)tokens.count, 1);
    assert_non_null(seen);
    for (int32_t i = 0; i < tokens.count; i++)
        all += (double)cairn_segment_length(tokens.lines[i]);
    for (int32_t i = 0; i < r.objects[0].found.count; i++) {
        int32_t segment = r.segments[r.objects[0].found.first + i];

        assert_int_equal(seen[segment], 0);
        seen[segment] = 1;
        found += (double)cairn_segment_length(tokens.lines[segment]);
    }
    assert_true(found >= 0.9 * all);
    free(seen);
    cairn_contour_search_run_free(&r);
    cairn_contour_search_run_free_tokens(&tokens);
}

enum { LEVEL = 41 };

/* An outline from left to right at a height of 100. */
static void draw_level(cairn_oriented_point outline[LEVEL])
{
    for (int32_t i = 0; i < LEVEL; i++) {
        outline[i].position.x = (cairn_real)(5 * i);
        outline[i].position.y = 100;
        outline[i].direction.x = 1;
        outline[i].direction.y = 0;
    }
}

/* Such an outline with edges around it: which of them are collected, and in which order. */
static void collect(const cairn_segment *lines, const int32_t *chains, int32_t count,
                    const char *wanted)
{
    cairn_oriented_point outline[LEVEL];
    contour_search_fitted_outline placed = {outline, LEVEL, {100, 100}, 200};
    cairn_contour_search_tokens tokens;
    int32_t list[16], listed = 0, known[16] = {0};

    memset(&tokens, 0, sizeof tokens);
    draw_level(outline);
    tokens.lines = (cairn_segment *)lines;
    tokens.chain = (int32_t *)chains;
    tokens.count = count;
    listed = collected(&tokens, &placed, NULL, list);
    for (int32_t i = 0; i < listed; i++) {
        known[list[i]]++;
        if (i > 0)
            assert_true(lines[list[i]].a.x >= lines[list[i - 1]].a.x);
    }
    for (int32_t i = 0; i < count; i++)
        if (known[i] != (wanted[i] == '+'))
            fail_msg("segment %d: %d, expected %c", i, known[i], wanted[i]);
}

/* Eight segments of 20 px in a row at a height. */
static void make_row(cairn_segment row[8], cairn_real y)
{
    for (int32_t i = 0; i < 8; i++) {
        row[i].a.x = (cairn_real)(20 + 20 * i);
        row[i].b.x = row[i].a.x + 20;
        row[i].a.y = row[i].b.y = y;
    }
}

static void test_edges_along_the_outline(void **state)
{
    static const int32_t apart[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    cairn_segment row[8];

    (void)state;
    /* Within 9 px of an outline of 200. */
    make_row(row, 108);
    collect(row, apart, 8, "++++++++");
    make_row(row, 110);
    collect(row, apart, 8, "........");
    /* Rotated by less than 37 degrees. */
    make_row(row, 100);
    row[2].a.y = 94;
    row[2].b.y = 106;
    row[3].a.x = row[3].b.x = 90;
    row[3].a.y = 92;
    row[3].b.y = 108;
    row[5].a.x = 124;
    row[5].b.x = 136;
    row[5].a.y = 94;
    row[5].b.y = 106;
    collect(row, apart, 8, "+++.+.++");
    /* Not farther than one size from the middle. */
    make_row(row, 100);
    row[7].a.x = 310;
    row[7].b.x = 330;
    collect(row, apart, 8, "+++++++.");
}

static void test_completed_outlines(void **state)
{
    static const int32_t one[8] = {0, 0, 0, 0, 0, 0, 0, 0}, two[8] = {0, 0, 0, 0, 1, 1, 1, 1};
    cairn_segment row[8];

    (void)state;
    /* A gap of up to 30 px within a chain is closed whatever lies in it. */
    make_row(row, 100);
    row[3].a.y = row[3].b.y = 130;
    collect(row, one, 8, "++++++++");
    row[3].a.y = row[3].b.y = row[4].a.y = row[4].b.y = 145;
    collect(row, one, 8, "+++..+++");
    /* An edge that leaves the outline gradually is followed, with the rest of its chain. */
    make_row(row, 100);
    for (int32_t i = 0; i < 8; i++)
        row[i].a.y = row[i].b.y = (cairn_real)(100 + 3 * i);
    collect(row, one, 8, "++++++++");
    /* Across a junction to a chain that begins there, 13 px off, behind one that is 8 px off; not
     * to one that begins 6 px away. */
    make_row(row, 108);
    for (int32_t i = 4; i < 8; i++)
        row[i].a.y = row[i].b.y = 113;
    row[4].a.y = 110;
    collect(row, two, 8, "++++++++");
    for (int32_t i = 4; i < 8; i++) {
        row[i].a.x += 6;
        row[i].b.x += 6;
    }
    collect(row, two, 8, "++++....");
}

/* A bow over a box: what leaves the outline is followed for a third of the size; out of the box for
 * a fifth; never round a sharp bend. */
static void test_edges_that_are_followed(void **state)
{
    static const int32_t one[8] = {0, 0, 0, 0, 0, 0, 0, 0}, two[8] = {0, 0, 0, 1, 1, 1, 1, 1};
    cairn_oriented_point outline[40];
    contour_search_fitted_outline placed = {outline, 40, {100, 100}, 200};
    cairn_contour_search_tokens tokens;
    cairn_segment row[8];
    int32_t list[8], listed;

    (void)state;
    memset(&tokens, 0, sizeof tokens);
    tokens.lines = row;
    tokens.count = 8;
    for (int32_t i = 0; i < 40; i++) {
        outline[i].position.x = i < 20 ? (cairn_real)(10 * i) : (cairn_real)(10 * (39 - i));
        outline[i].position.y = i < 20 ? 40 : 160;
        outline[i].direction.x = 1;
        outline[i].direction.y = 0;
    }
    /* Along the upper side, then gradually down into the box: each 14 px long. */
    for (int32_t k = 0; k < 4; k++) {
        for (int32_t i = 0; i < 8; i++) {
            row[i].a.x = (cairn_real)(20 + 10 * i);
            row[i].b.x = row[i].a.x + 10;
            row[i].a.y = i < 3 ? 40 : (cairn_real)(40 + 10 * (i - 3));
            row[i].b.y = i < 3 ? 40 : row[i].a.y + 10;
        }
        tokens.chain = (int32_t *)(k == 1 ? two : one);
        for (int32_t i = 3; i < 8 && k == 2; i++) {
            row[i].a.y = (cairn_real)(40 - 13 * (i - 3));
            row[i].b.y = row[i].a.y - 13;
        }
        for (int32_t i = 3; i < 8 && k == 3; i++) {
            row[i].a.x = row[i].b.x = 48;
            row[i].a.y = (cairn_real)(40 + 20 * (i - 3));
            row[i].b.y = row[i].a.y + 20;
        }
        listed = collected(&tokens, &placed, NULL, list);
        assert_int_equal(listed, k < 2 ? 7 : k == 2 ? 6 : 3);
    }
}

/* Intervals of an outline of two parts that no segment covers. */
/* Below a line that ends in a gap of its drawing: edges that begin below it, 8 px off and at a
 * right angle, are followed near the gap only. */
static void test_edges_are_followed_at_a_gap(void **state)
{
    static const int32_t apart[3] = {0, 1, 2};
    const cairn_segment lines[3] = {
        {{150, 100}, {170, 100}}, {{170, 108}, {170, 128}}, {{170, 135}, {170, 138}}};
    cairn_oriented_point outline[LEVEL];
    contour_search_fitted_outline placed = {outline, LEVEL, {100, 100}, 200};
    contour_search_gaps gaps = {.at = {{200, 100}}, .count = 0};
    cairn_contour_search_tokens tokens;
    int32_t list[3], listed;

    (void)state;
    memset(&tokens, 0, sizeof tokens);
    draw_level(outline);
    tokens.lines = (cairn_segment *)lines;
    tokens.chain = (int32_t *)apart;
    tokens.count = 3;
    listed = collected(&tokens, &placed, &gaps, list);
    assert_int_equal(listed, 1);
    gaps.count = 1;
    listed = collected(&tokens, &placed, &gaps, list);
    assert_int_equal(listed, 3);
    gaps.at[0].x = 50;
    listed = collected(&tokens, &placed, &gaps, list);
    assert_int_equal(listed, 1);
}

static void test_intervals_not_seen(void **state)
{
    static const char seen[] = "..++.+..|..+++..", *const wanted = "aa++b+cc|dd+++ee";
    cairn_contour_search_place outline[16];
    cairn_contour_search_object object;
    cairn_contour_search_result r;
    int32_t first, count, pieces = 0, n = 0;

    (void)state;
    memset(&object, 0, sizeof object);
    memset(&r, 0, sizeof r);
    r.outline = outline;
    object.first_outline = 1;
    for (size_t i = 0, part = 0; seen[i] != '\0'; i++) {
        part += seen[i] == '|';
        if (seen[i] != '|') {
            outline[1 + n].segment = seen[i] == '+' ? 3 : -1;
            outline[1 + n++].outline_index = (int32_t)part;
        }
    }
    object.outline_count = n;
    for (int32_t from = 0; cairn_contour_search_completed(&r, &object, from, &first, &count);
         from = first + count, pieces++)
        for (int32_t i = first; i < first + count; i++)
            assert_int_equal(wanted[i < 8 ? i : i + 1], 'a' + pieces);
    assert_int_equal(pieces, 5);
    assert_int_equal(count, 0);
}

/* A flag with an interval of the pole hidden: that interval, and hardly more, is predicted, at its
 * place. */
static void test_hidden_interval_is_predicted(void **state)
{
    cairn_contour_search_params params = of_the_flags_size();
    cairn_contour_search_tokens tokens;
    cairn_contour_search_result r;
    int32_t first, count, hidden = 0, others = 0;

    (void)state;
    clear_picture();
    draw_flag(60, 40, 1, 0);
    for (int32_t y = 85; y < 135; y++)
        memset(&edges[y * WIDTH + 50], 0, 40);
    tokens = find_tokens(0);
    params.mirror = 0;
    r = run(&tokens, &params);
    assert_true(r.object_count >= 1);
    for (int32_t from = 0; cairn_contour_search_completed(&r, &r.objects[0], from, &first, &count);
         from = first + count)
        for (int32_t i = first; i < first + count; i++) {
            cairn_vec2 p = r.outline[r.objects[0].first_outline + i].point.position;

            if (p.y > 92 && p.y < 130 && p.x < 90) {
                hidden++;
                assert_true(cairn_min(cairn_abs(p.x - 60), cairn_abs(p.x - 74)) < 4);
            } else {
                others++;
            }
        }
    assert_true(hidden >= 10);
    assert_true(others <= 8);
    cairn_contour_search_run_free(&r);
    cairn_contour_search_run_free_tokens(&tokens);
}

/* ---- The trace of the walk ---- */

typedef struct watch {
    int32_t calls[2], last;
    double weight;
} watch;

static void on_step(void *context, const cairn_contour_grouping_particle *particles, int32_t count,
                    int32_t mirrored)
{
    watch *w = context;

    assert_in_range(count, 1, 100);
    assert_true(mirrored >= w->last);
    w->last = mirrored;
    w->calls[mirrored]++;
    w->weight = 0;
    for (int32_t i = 0; i < count; i++) {
        w->weight += exp((double)particles[i].log_weight);
        assert_true(particles[i].size > 0 && cairn_is_finite(particles[i].origin.x));
        assert_true(cairn_is_finite(particles[i].centre.y) && particles[i].radius > 0);
        assert_in_range(particles[i].matched_sides, 0, 2);
    }
    assert_near(w->weight, 1, 1e-3);
}

static void test_the_walk_is_watched(void **state)
{
    cairn_contour_search_params params = generous();
    cairn_contour_search_tokens tokens;
    cairn_contour_search_result r, silent;
    watch w = {{0, 0}, 0, 0};

    (void)state;
    tokens = flag_tokens(30, 60, 40, 1, 0);
    params.grouping.particles = 100;
    silent = run(&tokens, &params);
    params.on_step = on_step;
    params.context = &w;
    r = run(&tokens, &params);
    for (int32_t m = 0; m < 2; m++) {
        assert_int_equal(w.calls[m], r.steps[m]);
        for (int32_t i = 0; i < r.steps[m]; i++)
            assert_in_range(r.mode_counts[m][i], 1, r.trace[m][i].particles);
    }
    /* Tracing changes nothing. */
    assert_int_equal(r.object_count, silent.object_count);
    assert_memory_equal(r.segments, silent.segments, (size_t)r.segment_count * sizeof *r.segments);
    cairn_contour_search_run_free(&silent);
    cairn_contour_search_run_free(&r);
    cairn_contour_search_run_free_tokens(&tokens);
}

static void test_no_walk_no_particles(void **state)
{
    cairn_contour_grouping_particle particle;
    int32_t steps = 7;

    (void)state;
    assert_int_equal(cairn_contour_grouping_particles(NULL, &particle, 1, &steps), 0);
    assert_int_equal(steps, 0);
    assert_int_equal(cairn_contour_grouping_particles(NULL, NULL, 0, NULL), 0);
}

/* Objects below the threshold are not reported, but the best score is. */
static void test_least_of_evidence_and_score(void **state)
{
    (void)state;
    clear_picture();
    draw_flag(60, 40, 1, 0);
    for (int k = 0; k < 3; k++) {
        cairn_contour_search_params params = of_the_flags_size();
        cairn_contour_search_tokens tokens = find_tokens(0);
        cairn_contour_search_result r;

        params.min_evidence = k == 1 ? 300 : params.min_evidence;
        params.min_score = k == 2 ? 1 : params.min_score;
        r = run(&tokens, &params);
        assert_int_equal(r.object_count > 0, k == 0);
        assert_true(r.best_score > CAIRN_REAL(0.8) && r.best_score < 1);
        assert_true(r.best_evidence > params.min_evidence || k == 1);
        cairn_contour_search_run_free(&r);
        cairn_contour_search_run_free_tokens(&tokens);
    }
}

/* A flag as drawn, and one whose edges are shifted in its lower half: its shape term is more
 * negative. */
static void test_shape_counts(void **state)
{
    cairn_real left[2];

    (void)state;
    for (int k = 0; k < 2; k++) {
        cairn_contour_search_params params = of_the_flags_size();
        cairn_contour_search_tokens tokens;
        cairn_contour_search_result r;
        const cairn_contour_search_object *o;

        tokens = flag_tokens(0, 60, 40, 1, 0);
        for (int32_t i = 0; i < tokens.count; i++) {
            cairn_segment *line = &tokens.lines[i];

            line->a.x += k == 1 && line->a.y > 90 ? 14 : 0;
            line->b.x += k == 1 && line->b.y > 90 ? 14 : 0;
        }
        params.min_evidence = 0;
        r = run(&tokens, &params);
        assert_true(r.object_count >= 1);
        o = &r.objects[0];
        assert_true(o->shape.edge_proximity > CAIRN_REAL(0.5) && o->shape.edge_proximity <= 1);
        assert_true(o->shape.tangent_deviation >= 0 && o->shape.deformation >= 0);
        left[k] = o->found.evidence - o->deformed_evidence - 2 * o->rigid_evidence;
        assert_true(k == 0 || o->shape.tangent_deviation > CAIRN_REAL(0.01));
        cairn_contour_search_run_free(&r);
        cairn_contour_search_run_free_tokens(&tokens);
    }
    assert_true(left[1] < left[0] - 3);
}

/* For edges of three strengths the share of the length that is weaker. */
static void test_strengths(void **state)
{
    cairn_contour_search_tokens tokens;

    (void)state;
    clear_picture();
    for (int32_t k = 0; k < 4; k++)
        for (int32_t x = 20; x < 120; x++)
            edges[(30 + 30 * k) * WIDTH + x] = (uint8_t)(k == 0 ? 60 : k == 3 ? 240 : 120);
    tokens = find_tokens(0);
    assert_true(tokens.count >= 4);
    for (int32_t i = 0; i < tokens.count; i++) {
        double y = (double)tokens.lines[i].a.y;

        assert_near(tokens.strength_rank[i], y < 45 ? 0.125 : y < 105 ? 0.5 : 0.875, 0.02);
    }
    cairn_contour_search_run_free_tokens(&tokens);
}

/* ---- Empty images, and full ones ---- */

static void test_empty_and_full(void **state)
{
    cairn_contour_search_params params = cairn_contour_search_default(WIDTH, HEIGHT);
    static const uint8_t one[1] = {255};
    cairn_raster_u8_view dot = {one, 1, 1, 1};

    (void)state;
    for (int k = 0; k < 3; k++) {
        cairn_contour_search_tokens tokens;
        cairn_contour_search_result r;

        memset(edges, k == 0 ? 0 : 255, sizeof edges);
        if (k < 2)
            tokens = find_tokens(0);
        else
            assert_ok(cairn_contour_search_run_tokens(&tokens, dot, 1, 0, "dot", &error));
        assert_int_equal(tokens.width, k < 2 ? WIDTH : 1);
        r = run(&tokens, &params);
        assert_int_equal(r.object_count, 0);
        cairn_contour_search_run_free(&r);
        cairn_contour_search_run_free_tokens(&tokens);
    }
}

static void test_limits(void **state)
{
    int32_t wide = CAIRN_CONTOUR_SEARCH_MAX_SIDE + 1, many = 1100;
    uint8_t *pixels = malloc((size_t)many * (size_t)many);
    cairn_raster_u8_view row = {pixels, wide, 1, wide}, full = {pixels, many, many, many},
                         none = {NULL, 1, 1, 1};
    cairn_contour_search_tokens tokens;

    (void)state;
    assert_non_null(pixels);
    memset(pixels, 9, (size_t)many * (size_t)many);
    assert_status(cairn_contour_search_run_tokens(&tokens, row, 1, 0, "row", &error), CAIRN_FULL);
    assert_non_null(strstr(error.text, "row: 8193 x 1 pixels"));
    assert_status(cairn_contour_search_run_tokens(&tokens, full, 1, 0, "full", &error), CAIRN_FULL);
    assert_non_null(strstr(error.text, "1210000 of them edges, expected"));
    assert_ok(cairn_contour_search_run_tokens(&tokens, full, 10, 0, "full", &error));
    assert_int_equal(tokens.count, 0);
    cairn_contour_search_run_free_tokens(&tokens);
    assert_status(cairn_contour_search_run_tokens(&tokens, none, 1, 0, "none", &error),
                  CAIRN_BAD_ARGUMENT);
    assert_string_equal(error.text, "none: no edge image, expected strengths from 1 to 255");
    assert_status(cairn_contour_search_run_tokens(&tokens, full, 0, 0, "full", &error),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_contour_search_run_tokens(&tokens, full, 256, 0, "full", &error),
                  CAIRN_BAD_ARGUMENT);
    assert_null(tokens.lines);
    free(pixels);
}

static void test_refused_searches(void **state)
{
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens;
    cairn_contour_search_result r;

    (void)state;
    tokens = flag_tokens(0, 60, 40, 1, 0);
    for (int k = 0; k < 6; k++) {
        cairn_contour_search_params bad = cairn_contour_search_default(WIDTH, HEIGHT);

        bad.min_size = k == 0 ? 0 : k == 1 ? (cairn_real)NAN : bad.min_size;
        bad.max_size = k == 2 ? bad.min_size / 2 : bad.max_size;
        bad.min_turn = k == 3 ? 4 : bad.min_turn;
        bad.grouping.particles = k == 4 ? 0 : bad.grouping.particles;
        bad.grouping.token_length = k == 5 ? 0 : bad.grouping.token_length;
        memset(&error, 0, sizeof error);
        assert_status(cairn_contour_search_run(&r, &tokens, &model.model, &bad, "name", &error),
                      CAIRN_BAD_ARGUMENT);
        assert_non_null(strstr(error.text, "name: "));
        assert_null(r.objects);
        assert_null(r.trace[0]);
    }
    cairn_shape_model_file_free(&model);
    cairn_contour_search_run_free_tokens(&tokens);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_found_as_it_is_and_mirrored),
        cmocka_unit_test(test_found_among_edgels),
        cmocka_unit_test(test_without_mirror),
        cmocka_unit_test(test_both_of_two),
        cmocka_unit_test(test_cut_by_the_border),
        cmocka_unit_test(test_model_of_three_points),
        cmocka_unit_test(test_completed_along_the_chains),
        cmocka_unit_test(test_edges_along_the_outline),
        cmocka_unit_test(test_completed_outlines),
        cmocka_unit_test(test_edges_that_are_followed),
        cmocka_unit_test(test_edges_are_followed_at_a_gap),
        cmocka_unit_test(test_intervals_not_seen),
        cmocka_unit_test(test_hidden_interval_is_predicted),
        cmocka_unit_test(test_the_walk_is_watched),
        cmocka_unit_test(test_no_walk_no_particles),
        cmocka_unit_test(test_least_of_evidence_and_score),
        cmocka_unit_test(test_shape_counts),
        cmocka_unit_test(test_strengths),
        cmocka_unit_test(test_empty_and_full),
        cmocka_unit_test(test_limits),
        cmocka_unit_test(test_refused_searches),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
