/* Long scenes of lines, surfaces and images. */
#include "src/base/build.h"

#include "cairn/corner.h"
#include "cairn/curve.h"
#include "cairn/edge_chain.h"
#include "cairn/edge_segment.h"
#include "cairn/hough.h"
#include "cairn/neighbours.h"
#include "cairn/raster.h"
#include "cairn/rectangle.h"
#include "cairn/shape_model.h"
#include "cairn/symmetric_point.h"
#include "tests/long.h"
#include "tests/long_scenes.h"

/* ---- Line fitting in the plane and in space ---- */

static uint64_t add_polyline(uint64_t hash, const cairn_polyline *polyline)
{
    cairn_polyline_view view = cairn_polyline_read(polyline);
    cairn_polyline_measure measure = cairn_polyline_measured(polyline);

    for (int32_t i = 0; i < view.segment_count; i++) {
        hash = add_vector(add_vector(hash, view.segments[i].a, 3), view.segments[i].b, 3);
        hash = add_int(add_real(hash, view.segments[i].rms), view.segments[i].count);
    }
    for (int32_t i = 0; i < view.point_count; i++)
        hash = add_int(hash, view.label[i]);
    hash = add_int(add_int(add_int(hash, view.segment_count), view.converged), view.dropped);
    hash = add_int(add_int(add_int(hash, measure.units), measure.iterations), measure.splits);
    return add_int(add_int(hash, measure.merges), measure.peak_segments);
}

uint64_t long_polylines(void)
{
    enum { POINTS = 500 };
    static cairn_real points[3 * POINTS];
    cairn_random random = cairn_random_seed(61, 34);
    uint64_t hash = GOLDEN_START;

    for (int32_t k = 0; k < 8; k++) {
        cairn_polyline_params params = cairn_polyline_default();
        cairn_polyline *polyline;
        cairn_pool pool;
        int32_t dim = 2 + k % 2;

        params.dim = dim;
        params.max_points = POINTS;
        params.max_segments = k == 6 ? 14 : 120;
        params.max_iterations = k == 7 ? 4 : 20;
        params.segment_penalty = k > 3 ? 12 : 20;
        params.gap_factor = k > 4 ? 2 : 3;
        LONG_CREATE(&pool, polyline, &polyline, &params);
        for (int32_t i = 0; i < POINTS; i++) { /* a zigzag with holes, outliers, and an arc */
            int32_t leg = i / 60;
            cairn_real along = (cairn_real)(i % 60) / 20, sine, cosine;

            cairn_sincos((cairn_real)leg * CAIRN_REAL(1.1), &sine, &cosine);
            if (leg == 5)
                cairn_sincos((cairn_real)(i % 60) / 40, &sine, &cosine);
            points[dim * i] =
                (cairn_real)leg * 2 + along * cosine + cairn_random_normal(&random) / 100;
            points[dim * i + 1] =
                (cairn_real)(leg % 3) + along * sine + cairn_random_normal(&random) / 100;
            if (dim == 3)
                points[dim * i + 2] =
                    along * (cairn_real)(leg % 2) + cairn_random_normal(&random) / 100;
            if (i % 60 > 30 && i % 60 < 42 && leg % 2 == 0)
                points[dim * i] += 30;
            if (i % 41 == 40)
                points[dim * i + 1] += argument(&random, 1, 0);
        }
        assert_ok(cairn_polyline_begin(polyline, points, POINTS - 40 * (k % 3), NULL));
        LONG_RUN(hash, cairn_polyline_step, polyline, 300);
        hash = add_polyline(hash, polyline);
        test_pool_free(&pool);
    }
    return hash;
}

/* ---- Fitted sweeps ---- */

uint64_t long_sweeps(void)
{
    cairn_scan_params params = cairn_scan_default();
    cairn_random random = cairn_random_seed(62, 35);
    static float angle[LONG_BEAMS];
    static long_world world;
    static long_sweep sweep;
    uint64_t hash = GOLDEN_START;
    cairn_scan *scan;
    cairn_pool pool;

    params.max_beams = LONG_BEAMS;
    params.max_points = 260;
    params.spacing = CAIRN_REAL(0.12);
    LONG_CREATE(&pool, scan, &scan, &params);
    long_build(&world, 62, 20);
    for (int32_t i = 0; i < 16; i++) {
        cairn_scan_measure measure;
        cairn_scan_view view;

        long_take_sweep(&sweep, &world, &random, long_somewhere(&world, &random), 121 + 16 * i,
                        CAIRN_REAL(6.1), CAIRN_REAL(0.1) * (cairn_real)(i % 3));
        sweep.input.base_sensor.x = CAIRN_REAL(0.1) * (cairn_real)(i % 4);
        sweep.input.base_sensor.theta = (cairn_real)(i % 5);
        sweep.input.motion.x = CAIRN_REAL(0.02) * (cairn_real)(i % 3);
        sweep.input.motion.theta = CAIRN_REAL(0.03) * (cairn_real)(i % 4 - 1);
        sweep.input.range_max = i % 2 ? 8 : 3;
        sweep.input.range_min = i % 3 ? 0 : 0.8F;
        sweep.input.range_sigma = i % 5 ? 0.01F : 0.03F;
        if (i % 4 == 3) { /* an angle for each beam, clockwise order */
            for (int32_t k = 0; k < sweep.input.count; k++)
                angle[k] = 3 - (float)k * sweep.input.angle_step;
            sweep.input.angle = angle;
        }
        assert_ok(cairn_scan_begin(scan, &sweep.input, NULL));
        LONG_RUN(hash, cairn_scan_step, scan, 400);
        view = cairn_scan_read(scan);
        for (int32_t k = 0; k < view.beam_count; k++)
            hash = add_int(add_point(add_point(hash, view.beams[k].from), view.beams[k].to),
                           view.beams[k].kind);
        for (int32_t k = 0; k < view.segment_count; k++)
            hash = add_int(add_point(add_point(hash, view.segments[k].a), view.segments[k].b),
                           view.first_point[k]);
        for (int32_t k = 0; k < view.point_count; k++)
            hash = add_point(add_point(hash, view.points[k].position), view.points[k].direction);
        measure = cairn_scan_measured(scan);
        hash = add_int(add_int(add_int(add_int(hash, measure.units), measure.hits), measure.free),
                       measure.unknown);
        hash = add_int(add_int(add_int(hash, measure.unassigned_hits), measure.fit_iterations),
                       measure.fit_converged);
        hash = add_int(hash, measure.dropped_segments);
    }
    test_pool_free(&pool);
    return hash;
}

/* ---- Walls, rooms and corners of the flat ---- */

/* The walls as several segments, each slightly displaced. */
static int32_t break_walls(const long_world *world, cairn_random *random, cairn_segment *pieces,
                           int32_t most)
{
    int32_t count = 0;

    for (int32_t i = 0; i < world->count; i++) {
        cairn_segment wall = world->walls[i];
        cairn_vec2 way = cairn_vec2_sub(wall.b, wall.a),
                   left = cairn_vec2_left_perp(cairn_vec2_unit(way));

        for (int32_t k = 0; k < 2 && count < most; k++) {
            cairn_real from = (cairn_real)k / 2 + argument(random, CAIRN_REAL(0.04), 0);
            cairn_vec2 off = cairn_vec2_scale(left, argument(random, CAIRN_REAL(0.03), 0));

            pieces[count].a =
                cairn_vec2_add(cairn_vec2_add(wall.a, cairn_vec2_scale(way, from)), off);
            pieces[count].b = cairn_vec2_add(
                cairn_vec2_add(wall.a, cairn_vec2_scale(way, from + CAIRN_REAL(0.45))), off);
            count++;
        }
    }
    return count;
}

static uint64_t add_lines(uint64_t hash, const cairn_hough *hough)
{
    int32_t count;
    const cairn_hough_line *lines = cairn_hough_list(hough, &count);

    for (int32_t i = 0; i < count; i++) {
        hash = add_real(
            add_real(add_real(add_point(add_point(hash, lines[i].point), lines[i].direction),
                              lines[i].low),
                     lines[i].high),
            lines[i].covered_length);
        hash = add_real(add_real(hash, lines[i].votes), lines[i].rms);
        hash = add_point(hash, cairn_hough_segment(&lines[i]).b);
    }
    return add_int(add_int(hash, count), cairn_hough_dropped(hough));
}

static uint64_t add_rectangles(uint64_t hash, const cairn_rectangle_set *set)
{
    int32_t count;
    const cairn_rectangle *r = cairn_rectangle_list(set, &count);

    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 corners[4];

        cairn_rectangle_corners(&r[i], corners);
        hash = add_real(add_real(add_pose(hash, r[i].centre), r[i].half_length), r[i].half_width);
        hash = add_int(add_real(add_real(hash, r[i].coverage), r[i].score), r[i].kind);
        for (int32_t k = 0; k < 4; k++)
            hash = add_int(add_point(hash, corners[k]), r[i].side[k]);
    }
    return add_int(add_int(hash, count), cairn_rectangle_dropped(set));
}

static uint64_t add_corners(uint64_t hash, const cairn_corner_set *set)
{
    int32_t count;
    const cairn_corner *c = cairn_corner_list(set, &count);

    for (int32_t i = 0; i < count; i++) {
        hash = add_point(add_point(add_point(hash, c[i].position), c[i].leg[0]), c[i].leg[1]);
        hash = add_int(add_real(add_real(hash, c[i].opening), c[i].strength), c[i].kind);
        hash = add_int(add_int(hash, c[i].segment[0]), c[i].segment[1]);
    }
    return add_int(add_int(hash, count), cairn_corner_dropped(set));
}

uint64_t long_walls(void)
{
    enum { SEGMENTS = 220, SEGMENT_POINTS = 8 };
    static cairn_oriented_point points[SEGMENTS * SEGMENT_POINTS];
    static cairn_real weights[SEGMENTS * SEGMENT_POINTS];
    static cairn_segment pieces[SEGMENTS];
    cairn_random random = cairn_random_seed(63, 36);
    static long_world world;
    uint64_t hash = GOLDEN_START;
    int32_t count;

    long_build(&world, 63, 14);
    count = break_walls(&world, &random, pieces, SEGMENTS);
    for (int32_t i = 0; i < count * SEGMENT_POINTS; i++) {
        cairn_segment piece = pieces[i / SEGMENT_POINTS];
        cairn_vec2 way = cairn_vec2_sub(piece.b, piece.a);

        points[i].position =
            cairn_vec2_add(piece.a, cairn_vec2_scale(way, (cairn_real)(i % SEGMENT_POINTS) /
                                                              (SEGMENT_POINTS - 1)));
        points[i].direction = cairn_vec2_unit(way);
        weights[i] = 1 + (cairn_real)(i % 5) / 4;
    }
    for (int32_t k = 0; k < 4; k++) {
        cairn_rectangle_params rectangle_params = cairn_rectangle_default();
        cairn_hough_params hough_params = cairn_hough_default();
        cairn_corner_params corner_params = cairn_corner_default();
        cairn_rectangle_set *rectangles;
        cairn_corner_set *corners;
        cairn_pool pool[3];
        cairn_hough *hough;

        hough_params.oriented = rectangle_params.oriented = k % 2;
        hough_params.angles = k < 2 ? 180 : 64;
        hough_params.distances = k < 2 ? 256 : 60;
        hough_params.max_lines = k < 2 ? 32 : 9;
        rectangle_params.max_sides = k < 2 ? 256 : 40;
        rectangle_params.max_pairs = k < 2 ? 2048 : 150;
        rectangle_params.max_rectangles = k < 2 ? 32 : 5;
        corner_params.max_corners = k < 2 ? 400 : 40;
        corner_params.max_segments = SEGMENTS;
        corner_params.merge_radius = k == 3 ? 0 : CAIRN_REAL(0.1);
        corner_params.min_opening = k == 1 ? 1 : CAIRN_REAL(1.4);
        LONG_CREATE(&pool[0], hough, &hough, &hough_params);
        LONG_CREATE(&pool[1], rectangle, &rectangles, &rectangle_params);
        LONG_CREATE(&pool[2], corner, &corners, &corner_params);
        assert_ok(
            cairn_hough_begin(hough, points, k == 2 ? NULL : weights, count * SEGMENT_POINTS));
        LONG_RUN(hash, cairn_hough_step, hough, 1000);
        hash = add_lines(hash, hough);
        assert_ok(cairn_rectangle_begin(rectangles, pieces, count));
        LONG_RUN(hash, cairn_rectangle_step, rectangles, 1000);
        hash = add_rectangles(hash, rectangles);
        assert_ok(cairn_corner_begin(corners, pieces, count));
        LONG_RUN(hash, cairn_corner_step, corners, 1000);
        hash = add_corners(hash, corners);
        for (int32_t i = 0; i < 3; i++)
            test_pool_free(&pool[i]);
    }
    return hash;
}

/* ---- Pictures ---- */

enum { WIDTH = 200, HEIGHT = 150 };

/* The flat from above, walls two pixels thick, with some noise. */
static void paint(uint8_t *picture, const long_world *world, cairn_random *random)
{
    memset(picture, 0, (size_t)WIDTH * HEIGHT);
    for (int32_t i = 0; i < world->count; i++)
        for (int32_t k = 0; k < 400; k++) {
            cairn_vec2 way = cairn_vec2_sub(world->walls[i].b, world->walls[i].a);
            cairn_vec2 p =
                cairn_vec2_add(world->walls[i].a, cairn_vec2_scale(way, (cairn_real)k / 400));
            int32_t x = 4 + (int32_t)(p.x * 16), y = 10 + (int32_t)(p.y * 16);

            picture[y * WIDTH + x] = (uint8_t)(100 + i % 150);
            if (i % 3 == 0)
                picture[(y + 1) * WIDTH + x] = (uint8_t)(60 + k % 7);
        }
    for (int32_t i = 0; i < 300; i++)
        picture[cairn_random_below(random, WIDTH * HEIGHT)] = (uint8_t)(20 + i % 60);
}

static uint64_t add_chains(uint64_t hash, const cairn_edge_chain_result *r)
{
    for (int32_t i = 0; i < r->chain_count; i++) {
        hash = add_int(add_int(add_int(hash, r->chains[i].first), r->chains[i].count),
                       r->chains[i].from);
        hash = add_real(add_int(hash, r->chains[i].to), r->chains[i].strength);
    }
    for (int32_t i = 0; i < r->pixel_count; i++)
        hash = add_int(add_int(hash, r->pixels[i].x), r->pixels[i].y);
    return add_int(add_int(hash, r->edge_count), r->short_count);
}

uint64_t long_pictures(void)
{
    static int32_t distances[WIDTH * HEIGHT];
    static uint8_t picture[WIDTH * HEIGHT];
    static cairn_segment lines[1500];
    static cairn_vec2 samples[90], directions[90], vertices[1000];
    cairn_raster_u8_view view = {picture, WIDTH, HEIGHT, WIDTH};
    cairn_raster_i32 out = {distances, WIDTH, HEIGHT, WIDTH};
    cairn_random random = cairn_random_seed(64, 37);
    static long_world world;
    uint64_t hash = GOLDEN_START;

    long_build(&world, 64, 12);
    paint(picture, &world, &random);
    for (int32_t k = 0; k < 3; k++) {
        cairn_edge_chain_params chain_params = cairn_edge_chain_default();
        cairn_edge_segment_params segment_params = cairn_edge_segment_default();
        cairn_symmetric_point_params point_params = cairn_symmetric_point_default();
        cairn_distance_map_params map_params = {.max_width = WIDTH};
        cairn_distance_map_input input = {view, out, 0xFF, 0, k % 2};
        const cairn_symmetric_point *points;
        cairn_edge_segment_result segments;
        cairn_symmetric_point_set *finder;
        cairn_edge_segment_set *cutter;
        cairn_edge_chain_result chains;
        cairn_edge_chain_set *linker;
        cairn_distance_map *map;
        cairn_pool pool[4];
        cairn_curve curve;
        int32_t count;

        chain_params.min_strength = 1 + 40 * k;
        chain_params.max_spur = 3 - k;
        chain_params.min_length = 3 + k;
        segment_params.tolerance = 1 + (cairn_real)k / 4;
        segment_params.look_ahead = k == 2 ? 12 : 0;
        segment_params.junction_distance = k == 1 ? 9 : 6;
        segment_params.max_lines = 1000;
        segment_params.max_segments = 1500;
        point_params.max_segments = 1500;
        point_params.max_points = k == 0 ? 300 : 3000;
        point_params.max_radius = 20;
        point_params.samples = 5 - k;
        LONG_CREATE(&pool[0], edge_chain, &linker, &chain_params);
        LONG_CREATE(&pool[1], edge_segment, &cutter, &segment_params);
        LONG_CREATE(&pool[2], symmetric_point, &finder, &point_params);
        LONG_CREATE(&pool[3], distance_map, &map, &map_params);
        assert_ok(cairn_edge_chain_begin(linker, view));
        LONG_RUN(hash, cairn_edge_chain_step, linker, 1000);
        chains = cairn_edge_chain_read(linker);
        hash = add_chains(hash, &chains);
        assert_ok(cairn_edge_segment_begin(cutter, &chains));
        LONG_RUN(hash, cairn_edge_segment_step, cutter, 1000);
        segments = cairn_edge_segment_read(cutter);
        hash = add_int(add_int(add_int(hash, segments.count), segments.virtual_count),
                       segments.line_count);
        hash = add_real(add_real(hash, segments.look_ahead), segments.mean_length);
        for (int32_t i = 0; i < segments.count; i++) {
            const cairn_edge_segment *s = &segments.segments[i];

            lines[i] = s->line;
            hash = add_real(add_point(add_point(hash, s->line.a), s->line.b), s->strength);
            hash = add_int(add_int(add_int(hash, s->chain), s->first), s->last);
        }
        assert_ok(cairn_symmetric_point_begin(finder, lines, segments.count));
        LONG_RUN(hash, cairn_symmetric_point_step, finder, 10000);
        points = cairn_symmetric_point_list(finder, &count);
        hash = add_int(add_int(hash, count), cairn_symmetric_point_dropped(finder));
        for (int32_t i = 0; i < count; i++) {
            hash = add_point(add_point(add_point(hash, points[i].centre), points[i].contact[0]),
                             points[i].contact[1]);
            hash = add_real(add_real(hash, points[i].radius), points[i].deviation);
            hash = add_int(add_int(hash, points[i].first), points[i].second);
            hash = add_real(hash, cairn_symmetric_point_quality(&points[i], CAIRN_REAL(0.3)));
        }
        curve.count = chains.chains[k].count < 1000 ? chains.chains[k].count : 1000;
        for (int32_t i = 0; i < curve.count; i++) {
            vertices[i].x = (cairn_real)chains.pixels[chains.chains[k].first + i].x;
            vertices[i].y = (cairn_real)chains.pixels[chains.chains[k].first + i].y;
        }
        curve.points = vertices;
        curve.closed = k % 2;
        hash = add_real(hash, cairn_curve_length(&curve));
        assert_ok(cairn_curve_resample(&curve, samples, directions, 90));
        for (int32_t i = 0; i < 90; i++)
            hash = add_point(add_point(hash, samples[i]), directions[i]);
        assert_ok(cairn_distance_map_begin(map, &input));
        LONG_RUN(hash, cairn_distance_map_step, map, 500);
        hash = add_bytes(hash, distances, sizeof distances);
        for (int32_t i = 0; i < 4; i++)
            test_pool_free(&pool[i]);
    }
    return hash;
}

/* ---- Neighbours ---- */

uint64_t long_neighbours(void)
{
    enum { POINTS = 600 };
    cairn_point_grid_params grid_params = {.max_points = POINTS, .cell_size = CAIRN_REAL(0.3)};
    cairn_box_sweep_params sweep_params = {.max_boxes = POINTS};
    cairn_random random = cairn_random_seed(65, 38);
    static cairn_box boxes[POINTS];
    uint64_t hash = GOLDEN_START;
    cairn_budget budget = {0};
    cairn_point_grid *grid;
    cairn_box_sweep *sweep;
    cairn_pool pool[2];
    cairn_status status;
    int32_t a, b;

    LONG_CREATE(&pool[0], point_grid, &grid, &grid_params);
    LONG_CREATE(&pool[1], box_sweep, &sweep, &sweep_params);
    for (int32_t i = 0; i < POINTS; i++) {
        cairn_vec2 p = long_point(&random, 4, i % 7 ? 3 : 30),
                   q = long_point(&random, CAIRN_REAL(0.2), CAIRN_REAL(0.2));

        assert_ok(cairn_point_grid_insert(grid, p));
        boxes[i].min = p;
        boxes[i].max.x = p.x + cairn_abs(q.x);
        boxes[i].max.y = p.y + cairn_abs(q.y);
    }
    for (int32_t i = 0; i < POINTS; i++) {
        cairn_point_grid_cursor cursor;
        cairn_real radius = CAIRN_REAL(0.1) * (cairn_real)(1 + i % 20), squared = 0;
        cairn_vec2 p = long_point(&random, 5, 5);
        int32_t k = cairn_point_grid_nearest(grid, p, radius, &squared);

        hash = add_int(hash, k);
        hash = add_int(hash, cairn_point_grid_has_near(grid, p, radius));
        if (k >= 0)
            hash = add_real(hash, squared);
        cursor = cairn_point_grid_begin(grid, p, radius);
        while ((k = cairn_point_grid_next(grid, &cursor)) >= 0)
            hash = add_int(hash, k);
        if (i % 50 == 49)
            cairn_point_grid_remove_last(grid);
    }
    assert_ok(cairn_box_sweep_begin(sweep, boxes, POINTS));
    do {
        budget.left = 13;
        status = cairn_box_sweep_next(sweep, &budget, &a, &b);
        hash = add_int(hash, budget.left);
        if (status == CAIRN_OK)
            hash = add_int(add_int(hash, a), b);
    } while (status != CAIRN_EMPTY);
    for (int32_t i = 0; i < 2; i++)
        test_pool_free(&pool[i]);
    return hash;
}

/* ---- Models of shapes ---- */

uint64_t long_shape_models(void)
{
    enum { VERTICES = 60 };
    uint64_t hash = GOLDEN_START;

    for (int32_t k = 0; k < 6; k++) {
        cairn_shape_model_builder_params params = cairn_shape_model_builder_default();
        cairn_vec2 vertices[VERTICES];
        cairn_curve outline = {vertices, VERTICES, 1};
        cairn_shape_model_builder *builder;
        cairn_shape_model model;
        cairn_pool pool;

        /* a star with k + 2 soft arms, one longer than the others */
        for (int32_t i = 0; i < VERTICES; i++) {
            cairn_real turn = 2 * CAIRN_PI * (cairn_real)i / VERTICES, sine, cosine, radius;

            radius = 60 + 25 * cairn_cos((cairn_real)(k + 2) * turn) + 12 * cairn_cos(turn);
            cairn_sincos(k % 2 ? -turn : turn, &sine, &cosine);
            vertices[i].x = 100 + radius * cosine;
            vertices[i].y = 80 + radius * sine / 2;
        }
        params.outline_samples = k < 3 ? 96 : 64;
        params.max_paths = k == 4 ? 1 : 8;
        params.min_clearance = k == 5 ? CAIRN_REAL(0.5) : CAIRN_REAL(0.8);
        LONG_CREATE(&pool, shape_model_builder, &builder, &params);
        assert_ok(cairn_shape_model_builder_begin(builder, &outline, 1));
        LONG_RUN(hash, cairn_shape_model_builder_step, builder, 3000);
        model = cairn_shape_model_builder_read(builder);
        assert_ok(cairn_shape_model_check(&model, NULL));
        for (int32_t i = 0; i < model.sample_count; i++) {
            const cairn_shape_model_sample *s = &model.samples[i];

            hash = add_real(add_real(add_point(hash, s->centre), s->radius), s->deviation);
            for (int32_t side = 0; side < 2; side++)
                hash = add_real(add_point(add_point(hash, s->contact[side].position),
                                          s->contact[side].direction),
                                s->outline_share[side]);
        }
        for (int32_t i = 0; i < model.path_count; i++) {
            const cairn_shape_model_path *p = &model.paths[i];

            hash = add_int(add_int(add_int(hash, p->first), p->count), p->parent);
            hash = add_real(add_int(hash, p->branch), p->outline_share);
        }
        for (int32_t i = 0; i < model.outline_count; i++)
            hash =
                add_point(add_point(hash, model.outline[i].position), model.outline[i].direction);
        hash = add_real(add_point(hash, model.origin), model.size);
        test_pool_free(&pool);
    }
    return hash;
}
