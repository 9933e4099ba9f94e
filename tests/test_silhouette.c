/* Silhouettes: contours of known silhouettes and drawings, their gaps, components and holes; random
 * pictures compared with a slow reference; refusals, budgets, capacities. */
#include "tests/grey_picture.h"

#include <math.h>

#include "cairn/silhouette.h"

/* The object of a test, in memory of its own. */
static cairn_silhouette *silhouette;
static cairn_pool pool;

static void open_silhouette(const cairn_silhouette_params *params)
{
    pool = test_pool(cairn_silhouette_memory(params));
    assert_ok(cairn_silhouette_create(&silhouette, &pool, params));
}

static void close_silhouette(void)
{
    test_pool_free(&pool);
}

static cairn_silhouette_params small_params(void)
{
    cairn_silhouette_params params = cairn_silhouette_default();

    params.max_width = WIDTH;
    params.max_height = HEIGHT;
    params.max_ink = params.max_points = PIXELS;
    return params;
}

/* Steps of `units` to the end; *used: the units that were charged. */
static cairn_status run_by(int32_t units, int64_t *used)
{
    cairn_status status;

    *used = 0;
    do {
        cairn_budget budget = {units};

        status = cairn_silhouette_step(silhouette, &budget);
        *used += units - budget.left;
    } while (status == CAIRN_MORE);
    return status;
}

static cairn_status run(void)
{
    int64_t used;

    assert_ok(cairn_silhouette_begin(silhouette, view()));
    return run_by(CAIRN_UNBOUNDED, &used);
}

static cairn_silhouette_result extract(void)
{
    assert_ok(run());
    assert_int_equal(cairn_silhouette_measured(silhouette).refusal, CAIRN_SILHOUETTE_ACCEPTED);
    return cairn_silhouette_read(silhouette);
}

/* Extraction is refused, and leaves no outlines. */
static cairn_silhouette_measure assert_refused(cairn_status status,
                                               cairn_silhouette_refusal refusal)
{
    cairn_silhouette_result result;
    cairn_budget budget = {10};

    assert_status(run(), status);
    result = cairn_silhouette_read(silhouette);
    assert_null(result.outlines);
    assert_int_equal(result.count + result.holes + result.gap_count + result.dropped_regions, 0);
    assert_int_equal(cairn_silhouette_measured(silhouette).refusal, refusal);
    assert_ok(cairn_silhouette_step(silhouette, &budget)); /* nothing left to do */
    assert_int_equal(budget.left, 10);
    return cairn_silhouette_measured(silhouette);
}

/* Each point is a neighbour of the one before, all the way round. */
static void assert_closed(const cairn_curve *c)
{
    assert_int_equal(c->closed, 1);
    for (int32_t i = 0; i < c->count; i++) {
        cairn_vec2 step = cairn_vec2_sub(c->points[(i + 1) % c->count], c->points[i]);

        assert_true((double)cairn_vec2_norm(step) <= 1.01);
    }
}

/* ---- Silhouettes ---- */

static void an_object_of_any_two_greys_is_outlined_along_its_pixel_edges(void **state)
{
    static const uint8_t colours[3][2] = {{255, 0}, {0, 255}, {90, 110}};
    cairn_silhouette_params params = small_params();

    (void)state;
    open_silhouette(&params);
    for (int k = 0; k < 3; k++) {
        cairn_silhouette_result result;
        cairn_box box;

        clear(colours[k][0]);
        fill(20, 10, 79, 49, colours[k][1]);
        result = extract();
        assert_int_equal(result.count, 1);
        assert_int_equal(
            result.holes + result.is_drawing + result.gap_count + result.dropped_regions, 0);
        assert_int_equal(result.outlines[0].count, 2 * (60 + 40));
        box = box_of(&result.outlines[0]);
        assert_near(box.min.x, 19.5, 1e-4);
        assert_near(box.min.y, 9.5, 1e-4);
        assert_near(box.max.x, 79.5, 1e-4);
        assert_near(box.max.y, 49.5, 1e-4);
        /* Smoothing cuts only the corners. */
        assert_near(area_of(&result.outlines[0]), 60 * 40, 8);
        assert_closed(&result.outlines[0]);
    }
    close_silhouette();
}

static void a_disc_has_its_centre_area_and_circumference(void **state)
{
    cairn_silhouette_params params = small_params();
    cairn_silhouette_result result;
    cairn_vec2 sum = {0, 0};

    (void)state;
    open_silhouette(&params);
    clear(255);
    for (int32_t y = 0; y < HEIGHT; y++)
        for (int32_t x = 0; x < WIDTH; x++)
            if ((x - 50) * (x - 50) + (y - 40) * (y - 40) <= 900)
                grey[y * WIDTH + x] = 0;
    result = extract();
    for (int32_t i = 0; i < result.outlines[0].count; i++)
        sum = cairn_vec2_add(sum, result.outlines[0].points[i]);
    assert_near(sum.x / (cairn_real)result.outlines[0].count, 50, 0.1);
    assert_near(sum.y / (cairn_real)result.outlines[0].count, 40, 0.1);
    assert_near(area_of(&result.outlines[0]), 3.14159 * 900, 40);
    assert_near(cairn_curve_length(&result.outlines[0]), 2 * 3.14159 * 30, 14);
    close_silhouette();
}

static void an_object_cut_by_the_border_of_the_picture_is_closed_along_it(void **state)
{
    cairn_silhouette_params params = small_params();
    cairn_silhouette_result result;

    (void)state;
    open_silhouette(&params);
    clear(255);
    fill(0, 30, 40, HEIGHT - 1, 0);
    result = extract();
    assert_int_equal(result.count, 1);
    assert_near(area_of(&result.outlines[0]), 41 * 60, 8);
    assert_near(box_of(&result.outlines[0]).min.x, -0.5, 1e-4);
    assert_near(box_of(&result.outlines[0]).max.y, HEIGHT - 0.5, 1e-4);
    clear(255);
    fill(80, 0, WIDTH - 1, 29, 0);
    result = extract();
    assert_near(box_of(&result.outlines[0]).max.x, WIDTH - 0.5, 1e-4);
    assert_int_equal(cairn_silhouette_measured(silhouette).ink_width, 40);
    assert_int_equal(cairn_silhouette_measured(silhouette).ink_height, 30);
    close_silhouette();
}

/* 180 of 416 pixels of the border are bright, 240 in the second picture. */
static void the_background_has_most_pixels_of_the_border(void **state)
{
    cairn_silhouette_params params = small_params();

    (void)state;
    open_silhouette(&params);
    clear(0);
    fill(0, 0, WIDTH - 1, 30, 255);
    assert_near(box_of(&extract().outlines[0]).max.y, 30.5, 1e-4);
    fill(0, 0, WIDTH - 1, 60, 255);
    assert_near(box_of(&extract().outlines[0]).min.y, 60.5, 1e-4);
    close_silhouette();
}

/* The outline of a pixel has four points, the middles of its sides. */
static void outlines_that_are_shorter_than_the_window_are_not_smoothed(void **state)
{
    cairn_silhouette_params params = small_params();
    const cairn_vec2 *points;

    (void)state;
    params.min_part = 0;
    open_silhouette(&params);
    clear(255);
    fill(20, 10, 79, 49, 0);
    fill(100, 70, 100, 70, 0);
    assert_int_equal(extract().count, 2);
    assert_int_equal(extract().outlines[1].count, 4);
    points = extract().outlines[1].points;
    assert_near(points[0].x, 100, 0);
    assert_near(points[0].y, 69.5, 0);
    assert_near(points[1].x, 100.5, 0);
    assert_near(points[1].y, 70, 0);
    close_silhouette();
}

static void components_that_touch_at_a_corner_are_one_and_holes_are_two(void **state)
{
    cairn_silhouette_params params = small_params();
    cairn_silhouette_result result;

    (void)state;
    open_silhouette(&params);
    clear(255);
    fill(10, 10, 39, 39, 0);
    fill(40, 40, 69, 69, 0);
    result = extract();
    assert_int_equal(result.count, 1);
    assert_near(area_of(&result.outlines[0]), 2 * 900, 20);
    clear(255);
    fill(10, 10, 79, 79, 0);
    fill(20, 20, 39, 39, 255);
    fill(40, 40, 59, 59, 255);
    result = extract();
    assert_int_equal(result.count, 3);
    assert_int_equal(result.holes, 2);
    assert_near(area_of(&result.outlines[0]), 70 * 70, 8);
    assert_near(area_of(&result.outlines[1]), 400, 8);
    assert_near(area_of(&result.outlines[2]), 400, 8);
    close_silhouette();
}

static void components_come_by_descending_area_before_holes_and_specks_are_dropped(void **state)
{
    cairn_silhouette_params params = small_params();
    cairn_silhouette_result result;

    (void)state;
    open_silhouette(&params);
    clear(255);
    fill(5, 5, 24, 24, 0);
    fill(40, 5, 99, 64, 0);
    fill(60, 20, 79, 39, 255);
    fill(5, 70, 8, 73, 0);     /* 16 of 3600: a speck */
    fill(50, 10, 51, 11, 255); /* and a hole of 4 */
    result = extract();
    assert_int_equal(result.count, 3);
    assert_int_equal(result.holes, 1);
    assert_int_equal(result.dropped_regions, 2);
    assert_near(area_of(&result.outlines[0]), 3600, 8);
    assert_near(area_of(&result.outlines[1]), 400, 8);
    assert_near(box_of(&result.outlines[1]).min.x, 4.5, 1e-4);
    assert_near(area_of(&result.outlines[2]), 400, 8);
    assert_near(box_of(&result.outlines[2]).min.x, 59.5, 1e-4);
    close_silhouette();
}

static void holes_are_kept_filled_or_refused(void **state)
{
    cairn_silhouette_params params = small_params();
    cairn_silhouette_measure measure;
    cairn_silhouette_result result;

    (void)state;
    clear(0);
    fill(10, 10, 79, 79, 255);
    fill(30, 41, 49, 60, 0);
    open_silhouette(&params);
    assert_int_equal(extract().holes, 1);
    close_silhouette();
    params.holes = CAIRN_SILHOUETTE_HOLES_FILL;
    open_silhouette(&params);
    result = extract();
    assert_int_equal(result.count, 1);
    assert_int_equal(result.holes + result.dropped_regions, 0);
    close_silhouette();
    params.holes = CAIRN_SILHOUETTE_HOLES_REFUSE;
    open_silhouette(&params);
    measure = assert_refused(CAIRN_UNSUPPORTED, CAIRN_SILHOUETTE_HOLE);
    assert_int_equal(measure.hole_area, 400);
    assert_int_equal(measure.hole_x, 30);
    assert_int_equal(measure.hole_y, 41);
    fill(30, 41, 49, 60, 255);
    fill(40, 50, 41, 51, 0); /* a small hole is no reason */
    assert_int_equal(extract().dropped_regions, 1);
    close_silhouette();
}

static void rows_may_be_strided_and_run_upwards(void **state)
{
    cairn_silhouette_params params = small_params();
    cairn_raster_u8_view upwards = {grey + (HEIGHT - 1) * WIDTH + 10, 80, HEIGHT, -WIDTH};
    cairn_silhouette_result result;
    int64_t used;

    (void)state;
    open_silhouette(&params);
    clear(255);
    fill(20, 10, 49, 39, 0);
    fill(95, 0, WIDTH - 1, 5, 0); /* beyond the view */
    assert_ok(cairn_silhouette_begin(silhouette, upwards));
    assert_ok(run_by(CAIRN_UNBOUNDED, &used));
    result = cairn_silhouette_read(silhouette);
    assert_int_equal(result.count, 1);
    assert_near(box_of(&result.outlines[0]).min.x, 9.5, 1e-4);
    assert_near(box_of(&result.outlines[0]).min.y, HEIGHT - 1 - 39.5, 1e-4);
    assert_near(box_of(&result.outlines[0]).max.y, HEIGHT - 1 - 9.5, 1e-4);
    close_silhouette();
}

/* ---- Drawings ---- */

static void a_drawing_is_outlined_outside_of_its_lines(void **state)
{
    cairn_silhouette_params params = small_params();

    (void)state;
    open_silhouette(&params);
    for (int thick = 0; thick < 3; thick++) {
        cairn_silhouette_result result;

        clear(255);
        for (int k = 0; k <= thick; k++)
            frame(20 + k, 10 + k, 79 - k, 69 - k, 0);
        result = extract();
        assert_int_equal(result.is_drawing, 1);
        assert_int_equal(result.count, 1);
        assert_int_equal(result.holes + result.gap_count + result.dropped_regions, 0);
        assert_near(area_of(&result.outlines[0]), 60 * 60, 8);
    }
    close_silhouette();
}

/* A frame of 4 pixels, with a half thickness of 3 in its corners, is thin from a diagonal of 150
 * on. */
static void a_drawing_has_lines_of_up_to_a_fiftieth_of_its_diagonal(void **state)
{
    enum { BIG_WIDTH = 130, BIG_HEIGHT = 100 };
    static uint8_t big[BIG_WIDTH * BIG_HEIGHT];
    const cairn_raster_u8_view picture = {big, BIG_WIDTH, BIG_HEIGHT, BIG_WIDTH};
    cairn_silhouette_params params = small_params();
    int64_t used;

    (void)state;
    params.max_width = BIG_WIDTH;
    params.max_height = BIG_HEIGHT;
    open_silhouette(&params);
    for (int32_t width = 119; width <= 120; width++) {
        for (int32_t y = 0; y < BIG_HEIGHT; y++)
            for (int32_t x = 0; x < BIG_WIDTH; x++) {
                int is_outer = x >= 4 && x < 4 + width && y >= 4 && y < 94,
                    is_inner = x >= 8 && x < width && y >= 8 && y < 90;

                big[y * BIG_WIDTH + x] = is_outer && !is_inner ? 0 : 255;
            }
        assert_ok(cairn_silhouette_begin(silhouette, picture));
        assert_ok(run_by(CAIRN_UNBOUNDED, &used));
        assert_int_equal(cairn_silhouette_read(silhouette).is_drawing, width == 120);
        assert_int_equal(cairn_silhouette_read(silhouette).holes, width == 119);
    }
    close_silhouette();
}

/* The diagonal is that of the ink, 85 here. */
static void gaps_up_to_a_share_of_the_diagonal_are_bridged_the_narrowest_first(void **state)
{
    cairn_silhouette_params params = small_params();
    cairn_silhouette_result result;

    (void)state;
    open_silhouette(&params);
    clear(255);
    frame(20, 10, 79, 69, 0);
    fill(60, 10, 66, 10, 255);
    fill(40, 69, 44, 69, 255);
    result = extract();
    assert_int_equal(result.is_drawing, 1);
    assert_int_equal(result.count, 1);
    assert_int_equal(result.gap_count, 2);
    assert_near(result.gaps[0].x, 42, 0.6);
    assert_near(result.gaps[0].y, 69, 0);
    assert_near(result.gaps[1].x, 63, 0.6);
    assert_near(result.gaps[1].y, 10, 0);
    assert_near(area_of(&result.outlines[0]), 60 * 60, 10);
    fill(60, 10, 70, 10, 255);
    assert_refused(CAIRN_BAD_FORMAT, CAIRN_SILHOUETTE_OPEN_LINES);
    close_silhouette();
    fill(67, 10, 70, 10, 0);
    params.max_gap = CAIRN_REAL(0.08);
    open_silhouette(&params);
    assert_refused(CAIRN_BAD_FORMAT, CAIRN_SILHOUETTE_OPEN_LINES);
    clear(255);
    fill(20, 20, 80, 20, 0);
    assert_refused(CAIRN_BAD_FORMAT, CAIRN_SILHOUETTE_OPEN_LINES);
    close_silhouette();
}

/* Across corners, in all directions: the outline of a square without one of its corners. */
static void oblique_gaps_are_bridged_by_straight_lines(void **state)
{
    static const int32_t corner[4][4] = {
        {20, 10, 27, 14}, {72, 10, 79, 14}, {20, 65, 27, 69}, {72, 65, 79, 69}};
    cairn_silhouette_params params = small_params();

    (void)state;
    params.max_gap = CAIRN_REAL(0.2);
    open_silhouette(&params);
    for (int k = 0; k < 4; k++) {
        cairn_silhouette_result result;

        clear(255);
        frame(20, 10, 79, 69, 0);
        fill(corner[k][0], corner[k][1], corner[k][2], corner[k][3], 255);
        result = extract();
        assert_int_equal(result.gap_count, 1);
        assert_int_equal(result.count, 1);
        /* less a triangle of 9 by 6 pixels */
        assert_near(area_of(&result.outlines[0]), 60 * 60 - 27, 3);
    }
    close_silhouette();
}

/* A mug and the hole of its handle. */
static void the_largest_face_of_a_drawing_is_the_object_and_others_are_holes(void **state)
{
    cairn_silhouette_params params = small_params();
    cairn_silhouette_result result;

    (void)state;
    open_silhouette(&params);
    clear(255);
    frame(10, 10, 59, 79, 0);
    frame(59, 25, 89, 60, 0);
    result = extract();
    assert_int_equal(result.count, 2);
    assert_int_equal(result.holes, 1);
    assert_near(area_of(&result.outlines[0]), 50 * 70 + 30 * 36, 10);
    assert_near(area_of(&result.outlines[1]), 29 * 34, 10);
    close_silhouette();
}

static void lines_beside_a_drawing_that_enclose_nothing_are_dropped(void **state)
{
    cairn_silhouette_params params = small_params();
    cairn_silhouette_result result;

    (void)state;
    open_silhouette(&params);
    clear(255);
    frame(10, 10, 29, 29, 0);
    frame(40, 10, 99, 69, 0);
    fill(10, 80, 20, 80, 0);
    result = extract();
    assert_int_equal(result.count, 2);
    assert_int_equal(result.holes, 0);
    assert_int_equal(result.dropped_regions, 1);
    assert_near(area_of(&result.outlines[0]), 3600, 8);
    close_silhouette();
}

/* ---- Refusals ---- */

static void pictures_of_one_colour_and_small_objects_are_refused(void **state)
{
    cairn_raster_u8_view one = {grey, 1, 1, 1};
    cairn_silhouette_params params = small_params();
    cairn_silhouette_measure measure;
    int64_t used;

    (void)state;
    open_silhouette(&params);
    clear(7);
    assert_refused(CAIRN_EMPTY, CAIRN_SILHOUETTE_ONE_COLOUR);
    assert_ok(cairn_silhouette_begin(silhouette, one));
    assert_status(run_by(CAIRN_UNBOUNDED, &used), CAIRN_EMPTY);
    fill(10, 10, 20, 21, 70); /* 11 x 12: a diagonal of 16.3 */
    assert_int_equal(extract().count, 1);
    fill(10, 21, 20, 21, 7);
    measure = assert_refused(CAIRN_EMPTY, CAIRN_SILHOUETTE_TOO_SMALL);
    assert_int_equal(measure.ink_width, 11);
    assert_int_equal(measure.ink_height, 11);
    assert_int_equal(measure.ink, 121);
    close_silhouette();
}

static void more_greys_than_a_quarter_of_the_picture_are_a_photograph(void **state)
{
    cairn_silhouette_params params = small_params();

    (void)state;
    open_silhouette(&params);
    clear(255);
    fill(40, 40, 99, 79, 0);
    fill(0, 0, WIDTH - 1, 22, 170); /* 23 of 90 rows */
    assert_int_equal(assert_refused(CAIRN_BAD_FORMAT, CAIRN_SILHOUETTE_PHOTOGRAPH).between,
                     23 * WIDTH);
    fill(0, 22, WIDTH - 1, 22, 255);
    assert_int_equal(extract().count, 1);
    /* The middle half of the greys ends a quarter of their range from both ends. */
    fill(0, 22, WIDTH - 1, 22, 192);
    assert_int_equal(extract().count, 1);
    assert_int_equal(cairn_silhouette_measured(silhouette).between, 22 * WIDTH);
    fill(0, 22, WIDTH - 1, 22, 191);
    assert_refused(CAIRN_BAD_FORMAT, CAIRN_SILHOUETTE_PHOTOGRAPH);
    close_silhouette();
}

static void greys_in_a_tenth_or_specks_are_of_silhouettes_and_both_are_of_photographs(void **state)
{
    cairn_silhouette_params params = small_params();

    (void)state;
    open_silhouette(&params);
    for (int32_t greys = 0; greys < 2; greys++)
        for (int32_t specks = 30; specks < 32; specks++) {
            clear(255);
            fill(30, 20, 100, 80, 0);
            if (greys)
                fill(0, 0, WIDTH - 1, 9, 170);
            for (int32_t i = 0; i < specks; i++)
                grey[(85 + i % 2) * WIDTH + 3 * i + 2] = 0;
            if (greys && specks > 30) {
                cairn_silhouette_measure measure =
                    assert_refused(CAIRN_BAD_FORMAT, CAIRN_SILHOUETTE_SPECKS);

                assert_int_equal(measure.dropped_regions, 31);
                assert_int_equal(measure.between, 10 * WIDTH);
            } else {
                cairn_silhouette_result result = extract();

                assert_int_equal(result.count, 1);
                assert_int_equal(result.dropped_regions, specks);
            }
        }
    close_silhouette();
}

static void endless_open_lines_are_refused_not_joined(void **state)
{
    cairn_silhouette_params params = small_params();

    (void)state;
    open_silhouette(&params);
    /* 127 lines are taken, and enclose nothing; one more is too many. */
    for (int32_t lines = 127; lines < 129; lines++) {
        clear(255);
        for (int32_t i = 0; i < lines; i++)
            fill(2 + 10 * (i % 10), 2 + 6 * (i / 10), 6 + 10 * (i % 10), 2 + 6 * (i / 10), 0);
        if (lines == 127)
            assert_refused(CAIRN_BAD_FORMAT, CAIRN_SILHOUETTE_OPEN_LINES);
        else
            assert_refused(CAIRN_BAD_FORMAT, CAIRN_SILHOUETTE_OPEN_ENDS);
    }
    close_silhouette();
}

static void used_up_capacities_are_refused_with_the_number_that_was_needed(void **state)
{
    cairn_raster_u8_view wide = {grey, WIDTH + 1, 10, WIDTH + 1}, high = {grey, 10, HEIGHT + 1, 10};
    cairn_silhouette_params params = small_params();
    cairn_silhouette_measure measure;
    int32_t ink, points;

    (void)state;
    clear(255);
    frame(10, 10, 89, 79, 0);
    open_silhouette(&params);
    assert_ok(run());
    measure = cairn_silhouette_measured(silhouette);
    ink = measure.ink;
    points = measure.points;
    assert_int_equal(ink, 2 * (80 + 70) - 4);
    assert_int_equal(points, 2 * (80 + 70));
    assert_status(cairn_silhouette_begin(silhouette, wide), CAIRN_FULL);
    assert_status(cairn_silhouette_begin(silhouette, high), CAIRN_FULL);
    assert_int_equal(cairn_silhouette_read(silhouette).count, 1); /* nothing has changed */
    close_silhouette();

    params.max_ink = ink;
    params.max_points = points;
    open_silhouette(&params);
    assert_ok(run());
    close_silhouette();
    params.max_points = points - 1;
    open_silhouette(&params);
    assert_int_equal(assert_refused(CAIRN_FULL, CAIRN_SILHOUETTE_POINTS).points, points);
    close_silhouette();
    params.max_points = PIXELS;
    params.max_ink = ink - 1;
    open_silhouette(&params);
    assert_int_equal(assert_refused(CAIRN_FULL, CAIRN_SILHOUETTE_INK).ink, ink);
    fill(10, 10, 89, 79, 0); /* the ink of a silhouette needs no capacity */
    assert_ok(run());
    close_silhouette();
    frame(30, 30, 50, 50, 255);
    params.max_points = points;
    open_silhouette(&params);
    assert_int_equal(assert_refused(CAIRN_FULL, CAIRN_SILHOUETTE_POINTS).points, points + 4 * 21);
    close_silhouette();
}

static void more_outlines_than_max_outlines_are_refused(void **state)
{
    cairn_silhouette_params params = small_params();

    (void)state;
    open_silhouette(&params);
    clear(255);
    for (int32_t i = 0; i < 9; i++) {
        fill(5 + 12 * (i % 5), 5 + 20 * (i / 5), 14 + 12 * (i % 5), 20 + 20 * (i / 5), 0);
        if (i == 7)
            assert_int_equal(extract().count, 8);
    }
    assert_int_equal(assert_refused(CAIRN_FULL, CAIRN_SILHOUETTE_OUTLINES).regions, 9);
    close_silhouette();
}

static void what_is_no_picture_is_refused_and_changes_nothing(void **state)
{
    cairn_silhouette_params params = small_params();
    cairn_raster_u8_view none = {NULL, WIDTH, HEIGHT, WIDTH};
    cairn_budget budget = {10};

    (void)state;
    open_silhouette(&params);
    assert_ok(cairn_silhouette_step(silhouette, &budget)); /* nothing was begun */
    assert_int_equal(cairn_silhouette_read(silhouette).count, 0);
    clear(255);
    fill(20, 10, 79, 49, 0);
    assert_int_equal(extract().count, 1);
    assert_status(cairn_silhouette_begin(NULL, view()), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_silhouette_begin(silhouette, none), CAIRN_BAD_ARGUMENT);
    assert_int_equal(cairn_silhouette_read(silhouette).count, 1);
    assert_int_equal(cairn_silhouette_read(NULL).count, 0);
    assert_int_equal(cairn_silhouette_measured(NULL).points, 0);
    close_silhouette();
}

/* ---- Reference: the definitions, pixel by pixel ---- */

enum { SIDE_X = 26, SIDE_Y = 20, SMALL = SIDE_X * SIDE_Y, MOST = 64 };

/* Small picture with a border of one pixel of background. */
typedef struct reference {
    int ink[SMALL], face[SMALL], component[SMALL];
    int is_drawing, dropped, hole_count;
    /* regions in the order of the outlines */
    int count;
    int area[SMALL], points[SMALL];
    double x[SMALL], y[SMALL];
} reference;

/* Spreads the least label of touching pixels that may be labelled until nothing changes. */
static void spread_labels(int *labels, int with_corners)
{
    for (int changed = 1; changed;) {
        changed = 0;
        for (int y = 0; y < SIDE_Y; y++)
            for (int x = 0; x < SIDE_X; x++)
                for (int v = y - 1; v <= y + 1; v++)
                    for (int u = x - 1; u <= x + 1; u++) {
                        int *here = &labels[y * SIDE_X + x];

                        if (u < 0 || v < 0 || u == SIDE_X || v == SIDE_Y || *here < 0 ||
                            labels[v * SIDE_X + u] < 0 || (!with_corners && u != x && v != y))
                            continue;
                        if (labels[v * SIDE_X + u] < *here) {
                            *here = labels[v * SIDE_X + u];
                            changed = 1;
                        }
                    }
    }
}

static int area_with(const int *labels, int label)
{
    int area = 0;

    for (int i = 0; i < SMALL; i++)
        area += labels[i] == label;
    return area;
}

/* The largest face of a component, the first of equal ones; -1: none. */
static int largest_face(const reference *r, int component)
{
    int found = -1;

    for (int i = 0; i < SMALL; i++)
        if (r->face[i] == i && i > 0 && r->component[i] == component &&
            (found < 0 || area_with(r->face, i) > area_with(r->face, found)))
            found = i;
    return found;
}

static int ink_of(const reference *r, int component)
{
    int ink = 0;

    for (int i = 0; i < SMALL; i++)
        ink += r->component[i] == component && r->ink[i];
    return ink;
}

static int is_object(const reference *r, int component)
{
    int face = largest_face(r, component);

    return !r->is_drawing || (face >= 0 && area_with(r->face, face) >= ink_of(r, component) / 2);
}

/* Half thickness of the ink: greatest city-block distance to the background. */
static int thickness(const reference *r)
{
    int most = 0;

    for (int i = 0; i < SMALL; i++) {
        int nearest = SMALL;

        for (int k = 0; k < SMALL && r->ink[i]; k++) {
            int distance = abs(i % SIDE_X - k % SIDE_X) + abs(i / SIDE_X - k / SIDE_X);

            if (!r->ink[k] && distance < nearest)
                nearest = distance;
        }
        most = r->ink[i] && nearest > most ? nearest : most;
    }
    return most;
}

/* Pixel edges between a region and what surrounds it: their number, and the sum of their middles,
 * which smoothing keeps. What the region surrounds is not counted. */
static void measure_outline(reference *r, int at, const int *labels, int label)
{
    static const int dx[4] = {1, -1, 0, 0}, dy[4] = {0, 0, 1, -1};
    int around[SMALL];

    for (int i = 0; i < SMALL; i++)
        around[i] = labels[i] == label ? -1 : i;
    spread_labels(around, labels == r->face);
    r->points[at] = 0;
    r->x[at] = r->y[at] = 0;
    for (int y = 1; y < SIDE_Y - 1; y++)
        for (int x = 1; x < SIDE_X - 1; x++)
            for (int k = 0; k < 4 && labels[y * SIDE_X + x] == label; k++)
                if (around[(y + dy[k]) * SIDE_X + x + dx[k]] == 0) {
                    r->points[at]++;
                    r->x[at] += x + dx[k] / 2.0 - 1;
                    r->y[at] += y + dy[k] / 2.0 - 1;
                }
}

/* Inserts a region behind those of its kind that are not smaller. */
static void insert(reference *r, const int *labels, int label)
{
    int area = area_with(labels, label), first = labels == r->face ? r->count - r->hole_count : 0,
        at = r->count;

    for (; at > first && r->area[at - 1] < area; at--) {
        r->area[at] = r->area[at - 1];
        r->points[at] = r->points[at - 1];
        r->x[at] = r->x[at - 1];
        r->y[at] = r->y[at - 1];
    }
    r->area[at] = area;
    measure_outline(r, at, labels, label);
    r->count++;
    r->hole_count += labels == r->face;
}

static void find_reference(reference *r, cairn_real min_part)
{
    int largest = 0;

    for (int i = 0; i < SMALL; i++)
        r->face[i] = r->ink[i] ? -1 : i;
    spread_labels(r->face, 0);
    for (int i = 0; i < SMALL; i++)
        r->component[i] = r->face[i] == 0 ? -1 : i;
    spread_labels(r->component, 1);
    r->is_drawing = thickness(r) <= 2;
    r->dropped = r->hole_count = r->count = 0;
    for (int i = 0; i < SMALL; i++)
        if (r->component[i] == i && is_object(r, i) && area_with(r->component, i) > largest)
            largest = area_with(r->component, i);
    for (int i = 0; i < SMALL; i++)
        if (r->component[i] == i) {
            if (!is_object(r, i) ||
                (cairn_real)area_with(r->component, i) < min_part * (cairn_real)largest)
                r->dropped++;
            else
                insert(r, r->component, i);
        }
    for (int i = 1; i < SMALL; i++)
        if (r->face[i] == i && !(r->is_drawing && largest_face(r, r->component[i]) == i)) {
            if ((cairn_real)area_with(r->face, i) < min_part * (cairn_real)largest)
                r->dropped++;
            else
                insert(r, r->face, i);
        }
    if (largest == 0)
        r->count = 0;
}

static void assert_as_reference(const reference *r, cairn_status status)
{
    cairn_silhouette_measure measure = cairn_silhouette_measured(silhouette);
    cairn_silhouette_result result = cairn_silhouette_read(silhouette);

    if (r->count == 0) {
        assert_status(status, CAIRN_BAD_FORMAT);
        assert_int_equal(measure.refusal, CAIRN_SILHOUETTE_OPEN_LINES);
        return;
    }
    assert_int_equal(measure.regions, r->count);
    assert_int_equal(measure.dropped_regions, r->dropped);
    if (r->count > MOST) {
        assert_status(status, CAIRN_FULL);
        return;
    }
    assert_ok(status);
    assert_int_equal(result.is_drawing, r->is_drawing);
    assert_int_equal(result.count, r->count);
    assert_int_equal(result.holes, r->hole_count);
    for (int i = 0; i < r->count; i++) {
        const cairn_curve *outline = &result.outlines[i];
        double x = 0, y = 0;

        assert_int_equal(outline->count, r->points[i]);
        assert_closed(outline);
        for (int32_t k = 0; k < outline->count; k++) {
            x += (double)outline->points[k].x;
            y += (double)outline->points[k].y;
        }
        assert_near(x, r->x[i], 1e-2);
        assert_near(y, r->y[i], 1e-2);
    }
}

/* Blackens a pixel of the small picture. */
static void add_ink(reference *r, int32_t x, int32_t y)
{
    grey[y * WIDTH + x] = 0;
    r->ink[(y + 1) * SIDE_X + x + 1] = 1;
}

/* Noise: `share` of 64 pixels. */
static void add_noise(reference *r, cairn_random *random, int32_t share)
{
    for (int32_t y = 1; y < SIDE_Y - 3; y++)
        for (int32_t x = 1; x < SIDE_X - 3; x++)
            if (cairn_random_below(random, 64) < share)
                add_ink(r, x, y);
}

/* A rectangle anywhere, filled or its lines alone. */
static void add_rectangle(reference *r, cairn_random *random, int is_filled)
{
    int32_t left = cairn_random_below(random, 12), right = left + 4 + cairn_random_below(random, 8),
            top = cairn_random_below(random, 8), bottom = top + 4 + cairn_random_below(random, 6);

    for (int32_t y = top; y <= bottom; y++)
        for (int32_t x = left; x <= right; x++)
            if (is_filled || x == left || x == right || y == top || y == bottom)
                add_ink(r, x, y);
}

/* Noise of growing density with blocks or frames. Drawings with too many open ends are left to
 * other tests. */
static void random_pictures_have_the_regions_of_the_reference(void **state)
{
    static const cairn_real parts[3] = {0, CAIRN_REAL(0.02), CAIRN_REAL(0.2)};
    cairn_raster_u8_view small = {grey, SIDE_X - 2, SIDE_Y - 2, WIDTH};
    cairn_random random = cairn_random_seed(8, 1);
    int32_t silhouettes = 0, drawings = 0, holes = 0;
    static reference r;

    (void)state;
    for (int32_t round = 0; round < 240; round++) {
        cairn_silhouette_params params = small_params();
        int64_t used;
        cairn_status status;

        params.min_part = parts[round % 3];
        params.max_outlines = MOST;
        params.max_gap = 0;
        open_silhouette(&params);
        memset(&r, 0, sizeof r);
        clear(255);
        add_noise(&r, &random, round % 2 ? 4 * (round % 12) : round % 8);
        for (int32_t i = 0; i <= round % 3; i++)
            add_rectangle(&r, &random, round % 2);
        assert_ok(cairn_silhouette_begin(silhouette, small));
        status = run_by(CAIRN_UNBOUNDED, &used);
        if (cairn_silhouette_measured(silhouette).refusal != CAIRN_SILHOUETTE_OPEN_ENDS &&
            cairn_silhouette_measured(silhouette).refusal != CAIRN_SILHOUETTE_TOO_SMALL) {
            find_reference(&r, params.min_part);
            assert_as_reference(&r, status);
            silhouettes += status == CAIRN_OK && !r.is_drawing;
            drawings += status == CAIRN_OK && r.is_drawing;
            holes += r.hole_count > 1;
        }
        close_silhouette();
    }
    assert_true(silhouettes > 60 && drawings > 40 && holes > 60);
}

/* Pixels with a gap all around are the most components, a checkerboard has the most faces. */
static void the_most_regions_that_there_can_be_are_measured(void **state)
{
    cairn_silhouette_params params = small_params();

    (void)state;
    params.min_part = 0;
    open_silhouette(&params);
    for (int board = 0; board < 2; board++) {
        int32_t count = 0;

        clear(255);
        for (int32_t y = 0; y < HEIGHT; y++)
            for (int32_t x = 0; x < WIDTH; x++)
                if (board ? (x + y) % 2 == 0 : x % 2 == 0 && y % 2 == 0)
                    grey[y * WIDTH + x] = 0;
        fill(WIDTH - 20, 0, WIDTH - 1, HEIGHT - 1, 255);
        fill(WIDTH - 16, 20, WIDTH - 2, 40, 0);
        for (int32_t y = 1; y < HEIGHT - 1; y++)
            for (int32_t x = 1; x < WIDTH - 21; x++)
                count += board && (x + y) % 2 == 1;
        if (!board)
            count = (WIDTH - 20) / 2 * (HEIGHT / 2);
        assert_int_equal(assert_refused(CAIRN_FULL, CAIRN_SILHOUETTE_OUTLINES).regions,
                         count + 1 + board);
    }
    close_silhouette();
}

/* All its pixels are junctions of lines: two chains a pixel. */
static void a_checkerboard_is_a_drawing_that_encloses_nothing(void **state)
{
    cairn_silhouette_params params = small_params();

    (void)state;
    params.max_ink = (WIDTH - 20) * (HEIGHT - 20) / 2;
    open_silhouette(&params);
    clear(255);
    for (int32_t y = 10; y < HEIGHT - 10; y++)
        for (int32_t x = 10; x < WIDTH - 10; x++)
            grey[y * WIDTH + x] = (x + y) % 2 ? 255 : 0;
    assert_refused(CAIRN_BAD_FORMAT, CAIRN_SILHOUETTE_OPEN_LINES);
    close_silhouette();
}

/* ---- Budgets, memory ---- */

static uint64_t hash_of_result(void *context)
{
    cairn_silhouette_measure measure = cairn_silhouette_measured(silhouette);
    cairn_silhouette_result result = cairn_silhouette_read(silhouette);
    uint64_t hash = test_hash(TEST_HASH_START, &measure, sizeof measure);

    (void)context;
    for (int32_t i = 0; i < result.count; i++)
        hash = test_hash(hash, result.outlines[i].points,
                         (size_t)result.outlines[i].count * sizeof(cairn_vec2));
    return test_hash(hash, result.gaps, (size_t)result.gap_count * sizeof *result.gaps);
}

enum { SCENES = 4 };

/* A drawing with gaps, a silhouette with holes and specks, a photograph, open lines. */
static void draw_scene(int32_t scene)
{
    clear(255);
    if (scene == 1) {
        fill(15, 5, 90, 75, 0);
        fill(30, 20, 44, 40, 255);
        fill(60, 30, 80, 50, 255);
        fill(100, 80, 101, 81, 0);
        return;
    }
    if (scene == 2)
        fill(0, 0, WIDTH - 1, HEIGHT / 2, 128);
    frame(20, 10, 79, 69, 0);
    fill(40, 10, 44, 10, 255);
    fill(79, 30, 79, 36, 255);
    if (scene == 3)
        fill(20, 20, 20, 60, 255);
}

static void budgets_of_1_7_1000_and_all_give_the_same_bits(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    cairn_silhouette_params params = small_params();

    (void)state;
    open_silhouette(&params);
    for (int32_t scene = 0; scene < SCENES; scene++) {
        cairn_status status;
        int64_t whole, used;
        uint64_t hash;

        draw_scene(scene);
        assert_ok(cairn_silhouette_begin(silhouette, view()));
        status = run_by(CAIRN_UNBOUNDED, &whole);
        assert_status(status, scene < 2 ? CAIRN_OK : CAIRN_BAD_FORMAT);
        hash = hash_of_result(NULL);
        for (size_t i = 0; i < sizeof budgets / sizeof *budgets; i++) {
            assert_ok(cairn_silhouette_begin(silhouette, view()));
            assert_int_equal(cairn_silhouette_read(silhouette).count, 0);
            assert_status(run_by(budgets[i], &used), status);
            assert_true(hash_of_result(NULL) == hash);
            assert_true(used == whole);
        }
    }
    close_silhouette();
}

static cairn_status begin_again(void *context)
{
    (void)context;
    return cairn_silhouette_begin(silhouette, view());
}

static cairn_status step_again(void *context, cairn_budget *budget)
{
    (void)context;
    return cairn_silhouette_step(silhouette, budget);
}

static void an_extraction_begun_anew_knows_nothing_of_the_last_one(void **state)
{
    const test_stepped stepped = {begin_again, step_again, hash_of_result, NULL};
    cairn_silhouette_params params = small_params();

    (void)state;
    open_silhouette(&params);
    for (int32_t scene = 0; scene < 2; scene++) {
        draw_scene(scene);
        test_begins_anew(&stepped, 24);
    }
    close_silhouette();
}

static cairn_status create(void *context, cairn_pool *in)
{
    cairn_silhouette *created;

    return cairn_silhouette_create(&created, in, context);
}

static void its_memory_suffices_and_less_is_refused(void **state)
{
    cairn_silhouette_params params = cairn_silhouette_default();

    (void)state;
    params.max_width = 18;
    params.max_height = 12;
    params.max_ink = 20;
    params.max_points = 100;
    test_every_pool_size(create, &params, cairn_silhouette_memory(&params));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_object_of_any_two_greys_is_outlined_along_its_pixel_edges),
        cmocka_unit_test(a_disc_has_its_centre_area_and_circumference),
        cmocka_unit_test(an_object_cut_by_the_border_of_the_picture_is_closed_along_it),
        cmocka_unit_test(the_background_has_most_pixels_of_the_border),
        cmocka_unit_test(outlines_that_are_shorter_than_the_window_are_not_smoothed),
        cmocka_unit_test(components_that_touch_at_a_corner_are_one_and_holes_are_two),
        cmocka_unit_test(components_come_by_descending_area_before_holes_and_specks_are_dropped),
        cmocka_unit_test(holes_are_kept_filled_or_refused),
        cmocka_unit_test(rows_may_be_strided_and_run_upwards),
        cmocka_unit_test(a_drawing_is_outlined_outside_of_its_lines),
        cmocka_unit_test(a_drawing_has_lines_of_up_to_a_fiftieth_of_its_diagonal),
        cmocka_unit_test(gaps_up_to_a_share_of_the_diagonal_are_bridged_the_narrowest_first),
        cmocka_unit_test(oblique_gaps_are_bridged_by_straight_lines),
        cmocka_unit_test(the_largest_face_of_a_drawing_is_the_object_and_others_are_holes),
        cmocka_unit_test(lines_beside_a_drawing_that_enclose_nothing_are_dropped),
        cmocka_unit_test(pictures_of_one_colour_and_small_objects_are_refused),
        cmocka_unit_test(more_greys_than_a_quarter_of_the_picture_are_a_photograph),
        cmocka_unit_test(greys_in_a_tenth_or_specks_are_of_silhouettes_and_both_are_of_photographs),
        cmocka_unit_test(endless_open_lines_are_refused_not_joined),
        cmocka_unit_test(used_up_capacities_are_refused_with_the_number_that_was_needed),
        cmocka_unit_test(more_outlines_than_max_outlines_are_refused),
        cmocka_unit_test(what_is_no_picture_is_refused_and_changes_nothing),
        cmocka_unit_test(random_pictures_have_the_regions_of_the_reference),
        cmocka_unit_test(the_most_regions_that_there_can_be_are_measured),
        cmocka_unit_test(a_checkerboard_is_a_drawing_that_encloses_nothing),
        cmocka_unit_test(budgets_of_1_7_1000_and_all_give_the_same_bits),
        cmocka_unit_test(an_extraction_begun_anew_knows_nothing_of_the_last_one),
        cmocka_unit_test(its_memory_suffices_and_less_is_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
