/* Golden scenes of contours: from edges to symmetric points. */
#include "src/core/build.h"

#include "cairn/curve.h"
#include "cairn/edge_chain.h"
#include "cairn/edge_segment.h"
#include "cairn/symmetric_point.h"
#include "tests/golden.h"

enum { SIDE = 96, DOTS = 400 };

static uint8_t picture[SIDE * SIDE];

static void dot(cairn_vec2 at, int32_t strength)
{
    int32_t x = cairn_real_to_int(at.x), y = cairn_real_to_int(at.y);

    if (x >= 0 && y >= 0 && x < SIDE && y < SIDE)
        picture[y * SIDE + x] = (uint8_t)strength;
}

/* Two rings two pixels wide, lines across them, and noise. */
static void draw(cairn_random *random)
{
    memset(picture, 0, sizeof picture);
    for (int32_t i = 0; i < DOTS; i++) {
        cairn_real turn = (cairn_real)i * (2 * CAIRN_PI / DOTS), sine, cosine;
        cairn_vec2 noise = {cairn_random_uniform(random, 0, SIDE), cairn_random_uniform(random, 0, SIDE)};

        cairn_sincos(turn, &sine, &cosine);
        for (int32_t k = 0; k < 4; k++) {
            cairn_real radius = (cairn_real)(k < 2 ? 20 + k : 35 + k);
            cairn_vec2 on_ring = {48 + radius * cosine, 45 + radius * sine};

            dot(on_ring, 80 + 40 * k);
        }
        if (i % 4 == 0) {
            cairn_vec2 down = {(cairn_real)i / 4, 10 + (cairn_real)i / 6},
                       up = {20 + (cairn_real)i / 8, 90 - (cairn_real)i / 5};

            dot(down, 120);
            dot(up, 60 + i / 4);
            dot(noise, 30);
        }
    }
}

static uint64_t add_segments(uint64_t hash, const cairn_edge_segment_result *r)
{
    hash = add_real(add_real(hash, r->look_ahead), r->mean_length);
    for (int32_t i = 0; i < r->count; i++) {
        const cairn_edge_segment *s = &r->segments[i];

        hash = add_point(add_point(add_real(hash, s->strength), s->line.a), s->line.b);
        hash = add_bytes(add_bytes(hash, &s->first, sizeof s->first), &s->last, sizeof s->last);
    }
    return hash;
}

static uint64_t add_symmetric_points(uint64_t hash, const cairn_symmetric_point *points, int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        hash = add_point(add_real(add_real(hash, points[i].radius), points[i].deviation), points[i].centre);
        hash = add_real(hash, cairn_symmetric_point_quality(&points[i], 1));
    }
    return hash;
}

/* The centres of the discs as a curve, evenly sampled. */
static uint64_t add_samples(uint64_t hash, const cairn_symmetric_point *points, int32_t count)
{
    enum { MOST = 64 };
    cairn_vec2 vertices[MOST], samples[MOST], directions[MOST];
    cairn_curve curve = {vertices, count < MOST ? count : MOST, 1};

    for (int32_t i = 0; i < curve.count; i++)
        vertices[i] = points[i].centre;
    if (cairn_curve_resample(&curve, samples, directions, MOST) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < MOST; i++)
        hash = add_point(add_point(hash, samples[i]), directions[i]);
    if (cairn_curve_tangents(&curve, 1, directions) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < curve.count; i++)
        hash = add_point(hash, directions[i]);
    return hash;
}

uint64_t golden_contours(void)
{
    cairn_edge_chain_params chain = {SIDE, SIDE, 4000, 400, 20, 4, 3};
    cairn_edge_segment_params segment = cairn_edge_segment_default();
    cairn_symmetric_point_params symmetric = cairn_symmetric_point_default();
    cairn_raster_u8_view view = {picture, SIDE, SIDE, SIDE};
    static cairn_segment lines[600];
    cairn_random random = cairn_random_seed(20, 1);
    cairn_budget budget = {INT32_MAX};
    const cairn_symmetric_point *points;
    cairn_edge_chain_result chains;
    cairn_edge_segment_result segments;
    cairn_edge_chain_set *linker;
    cairn_edge_segment_set *cutter;
    cairn_symmetric_point_set *finder;
    cairn_pool pool;
    int32_t count;

    segment.max_lines = 300;
    segment.max_segments = symmetric.max_segments = 600;
    symmetric.max_points = 2000;
    symmetric.max_radius = 25;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_edge_chain_create(&linker, &pool, &chain) != CAIRN_OK ||
        cairn_edge_segment_create(&cutter, &pool, &segment) != CAIRN_OK ||
        cairn_symmetric_point_create(&finder, &pool, &symmetric) != CAIRN_OK)
        return 0;
    draw(&random);
    if (cairn_edge_chain_begin(linker, view) != CAIRN_OK || cairn_edge_chain_step(linker, &budget) != CAIRN_OK)
        return 0;
    chains = cairn_edge_chain_read(linker);
    if (cairn_edge_segment_begin(cutter, &chains) != CAIRN_OK || cairn_edge_segment_step(cutter, &budget) != CAIRN_OK)
        return 0;
    segments = cairn_edge_segment_read(cutter);
    for (int32_t i = 0; i < segments.count; i++)
        lines[i] = segments.segments[i].line;
    if (cairn_symmetric_point_begin(finder, lines, segments.count) != CAIRN_OK ||
        cairn_symmetric_point_step(finder, &budget) != CAIRN_OK)
        return 0;
    points = cairn_symmetric_point_list(finder, &count);
    return add_samples(add_symmetric_points(add_segments(GOLDEN_START, &segments), points, count), points, count);
}
