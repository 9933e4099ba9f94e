/* Golden scenes of contours: from edges to symmetric points, from an outline to grouped
 * segments. */
#include "src/base/build.h"

#include "cairn/contour_grouping.h"
#include "cairn/curve.h"
#include "cairn/edge_chain.h"
#include "cairn/edge_segment.h"
#include "cairn/edgel.h"
#include "cairn/part_configuration.h"
#include "cairn/self_similarity.h"
#include "cairn/shape_context.h"
#include "cairn/silhouette.h"
#include "cairn/skeleton_grouping.h"
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

/* Two rings two pixels wide, crossing lines, and noise. */
static void draw(cairn_random *random)
{
    memset(picture, 0, sizeof picture);
    for (int32_t i = 0; i < DOTS; i++) {
        cairn_real turn = (cairn_real)i * (2 * CAIRN_PI / DOTS), sine, cosine;
        cairn_vec2 noise = {cairn_random_uniform(random, 0, SIDE),
                            cairn_random_uniform(random, 0, SIDE)};

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

static uint64_t add_symmetric_points(uint64_t hash, const cairn_symmetric_point *points,
                                     int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        hash = add_point(add_real(add_real(hash, points[i].radius), points[i].deviation),
                         points[i].centre);
        hash = add_real(hash, cairn_symmetric_point_quality(&points[i], 1));
    }
    return hash;
}

/* The centres of the discs as a curve, evenly sampled. */
static uint64_t add_samples(uint64_t hash, const cairn_symmetric_point *points, int32_t count)
{
    enum { MAX_COUNT = 64 };
    cairn_vec2 vertices[MAX_COUNT], samples[MAX_COUNT], directions[MAX_COUNT];
    cairn_curve curve = {vertices, count < MAX_COUNT ? count : MAX_COUNT, 1};

    for (int32_t i = 0; i < curve.count; i++)
        vertices[i] = points[i].centre;
    if (cairn_curve_resample(&curve, samples, directions, MAX_COUNT) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < MAX_COUNT; i++)
        hash = add_point(add_point(hash, samples[i]), directions[i]);
    if (cairn_curve_tangents(&curve, 1, directions) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < curve.count; i++)
        hash = add_point(hash, directions[i]);
    return hash;
}

uint64_t golden_contours(void)
{
    cairn_edge_chain_params chain = {.max_width = SIDE,
                                     .max_height = SIDE,
                                     .max_edges = 4000,
                                     .max_chains = 400,
                                     .min_strength = 20,
                                     .min_length = 4,
                                     .max_spur = 3};
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
    if (cairn_edge_chain_begin(linker, view) != CAIRN_OK ||
        cairn_edge_chain_step(linker, &budget) != CAIRN_OK)
        return 0;
    chains = cairn_edge_chain_read(linker);
    if (cairn_edge_segment_begin(cutter, &chains) != CAIRN_OK ||
        cairn_edge_segment_step(cutter, &budget) != CAIRN_OK)
        return 0;
    segments = cairn_edge_segment_read(cutter);
    for (int32_t i = 0; i < segments.count; i++)
        lines[i] = segments.segments[i].line;
    if (cairn_symmetric_point_begin(finder, lines, segments.count) != CAIRN_OK ||
        cairn_symmetric_point_step(finder, &budget) != CAIRN_OK)
        return 0;
    points = cairn_symmetric_point_list(finder, &count);
    return add_samples(add_symmetric_points(add_segments(GOLDEN_START, &segments), points, count),
                       points, count);
}

uint64_t golden_edgels(void)
{
    cairn_edgel_params params = cairn_edgel_default();
    cairn_raster_u8_view view = {picture, SIDE, SIDE, SIDE};
    cairn_random random = cairn_random_seed(21, 1);
    cairn_budget budget = {INT32_MAX};
    uint64_t hash = GOLDEN_START;
    const cairn_edgel *edgels;
    cairn_edgel_set *set;
    cairn_pool pool;
    int32_t count;

    params.max_width = params.max_height = SIDE;
    params.max_edgels = 4000;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_edgel_create(&set, &pool, &params) != CAIRN_OK)
        return 0;
    draw(&random);
    if (cairn_edgel_begin(set, view) != CAIRN_OK || cairn_edgel_step(set, &budget) != CAIRN_OK)
        return 0;
    edgels = cairn_edgel_list(set, &count);
    for (int32_t i = 0; i < count; i++)
        hash = add_real(add_point(add_point(hash, edgels[i].position), edgels[i].normal),
                        edgels[i].gradient_magnitude);
    return add_bytes(hash, &budget.left, sizeof budget.left);
}

/* Outlines of two greys, the units of their extraction included; 0: it fails. */
static uint64_t add_outlines(uint64_t hash, cairn_silhouette *silhouette)
{
    cairn_raster_u8_view view = {picture, SIDE, SIDE, SIDE};
    cairn_budget budget = {INT32_MAX};
    cairn_silhouette_result found;

    if (cairn_silhouette_begin(silhouette, view) != CAIRN_OK ||
        cairn_silhouette_step(silhouette, &budget) != CAIRN_OK)
        return 0;
    found = cairn_silhouette_read(silhouette);
    for (int32_t i = 0; i < found.count; i++)
        for (int32_t k = 0; k < found.outlines[i].count; k++)
            hash = add_point(hash, found.outlines[i].points[k]);
    for (int32_t i = 0; i < found.gap_count; i++)
        hash = add_point(hash, found.gaps[i]);
    hash = add_bytes(hash, &found.dropped_regions, sizeof found.dropped_regions);
    return add_bytes(hash, &budget.left, sizeof budget.left);
}

/* A silhouette with a hole and specks, and a drawing with gaps. */
uint64_t golden_outlines(void)
{
    cairn_silhouette_params params = cairn_silhouette_default();
    cairn_random random = cairn_random_seed(22, 1);
    uint64_t hash = GOLDEN_START;
    cairn_silhouette *silhouette;
    cairn_pool pool;

    params.max_width = params.max_height = SIDE;
    params.max_ink = 1000;
    params.max_points = 2000;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_silhouette_create(&silhouette, &pool, &params) != CAIRN_OK)
        return 0;
    for (int32_t is_drawing = 0; is_drawing < 2; is_drawing++) {
        memset(picture, 255, sizeof picture);
        for (int32_t y = 0; y < SIDE; y++)
            for (int32_t x = 0; x < SIDE; x++) {
                int32_t squared = (x - 50) * (x - 50) + (y - 44) * (y - 44),
                        speck = cairn_random_below(&random, 400);

                if (is_drawing ? squared > 1150 && squared < 1250 && (x + 2 * y) % 40 > 4
                               : (squared > 160 && squared < 1250) || speck == 0)
                    picture[y * SIDE + x] = 0;
            }
        hash = add_outlines(hash, silhouette);
        if (hash == 0)
            return 0;
    }
    return hash;
}

/* ---- A jug in clutter, one whole and one in part ---- */

enum { JUG = 9, MOST_LINES = 400, GROUP_WIDTH = 240, GROUP_HEIGHT = 160 };

static const cairn_real jug[JUG][2] = {{-14, -30}, {10, -30}, {14, -20}, {10, -8}, {26, 4},
                                       {20, 30},   {-16, 30}, {-22, 2},  {-10, -8}};

static int32_t add_jug(cairn_segment *lines, int32_t count, cairn_vec2 at, cairn_real size,
                       int32_t sides)
{
    for (int32_t i = 0; i < sides; i++) {
        const cairn_real *a = jug[i], *b = jug[(i + 1) % JUG];

        for (int32_t k = 0; k < 3; k++) {
            cairn_real from = (cairn_real)k / 3, to = (cairn_real)(k + 1) / 3;
            cairn_segment line = {{at.x + size * (a[0] + from * (b[0] - a[0])),
                                   at.y + size * (a[1] + from * (b[1] - a[1]))},
                                  {at.x + size * (a[0] + to * (b[0] - a[0])),
                                   at.y + size * (a[1] + to * (b[1] - a[1]))}};

            lines[count++] = line;
        }
    }
    return count;
}

static int32_t add_clutter(cairn_segment *lines, int32_t count, int32_t more, cairn_random *random)
{
    for (int32_t i = 0; i < more; i++) {
        cairn_vec2 at = {cairn_random_uniform(random, 0, GROUP_WIDTH),
                         cairn_random_uniform(random, 0, GROUP_HEIGHT)};
        cairn_vec2 half = {cairn_random_uniform(random, -14, 14),
                           cairn_random_uniform(random, -14, 14)};
        cairn_segment line = {cairn_vec2_sub(at, half), cairn_vec2_add(at, half)};

        lines[count++] = line;
    }
    return count;
}

static uint64_t add_model(uint64_t hash, const cairn_shape_model *m)
{
    for (int32_t i = 0; i < m->sample_count; i++) {
        const cairn_shape_model_sample *d = &m->samples[i];

        hash = add_real(add_real(add_point(hash, d->centre), d->radius), d->deviation);
        for (int32_t side = 0; side < 2; side++)
            hash = add_real(
                add_point(add_point(hash, d->contact[side].position), d->contact[side].direction),
                d->outline_share[side]);
    }
    for (int32_t i = 0; i < m->path_count; i++) {
        hash = add_bytes(hash, &m->paths[i].first, sizeof m->paths[i].first);
        hash = add_bytes(hash, &m->paths[i].branch, sizeof m->paths[i].branch);
    }
    return add_point(add_real(hash, m->size), m->origin);
}

static uint64_t add_grouping(uint64_t hash, const cairn_contour_grouping_result *r,
                             const cairn_shape_model *m)
{
    hash = add_real(add_real(hash, r->best_score), r->best_evidence);
    hash = add_bytes(add_bytes(hash, &r->hypothesis_count, sizeof r->hypothesis_count),
                     &r->token_count, sizeof r->token_count);
    hash = add_bytes(hash, r->segments, (size_t)r->segment_count * sizeof *r->segments);
    hash = add_bytes(hash, r->outline_segments,
                     (size_t)(r->object_count * m->outline_count) * sizeof *r->outline_segments);
    for (int32_t i = 0; i < r->object_count; i++) {
        const cairn_contour_grouping_object *o = &r->objects[i];

        hash = add_point(add_real(add_real(hash, o->evidence), o->score), o->origin);
        hash = add_real(add_real(hash, o->size), o->turn);
        hash = add_bytes(add_bytes(hash, &o->matched_samples, sizeof o->matched_samples),
                         &o->start_sample, sizeof o->start_sample);
    }
    for (int32_t i = 0; i < r->steps; i++) {
        hash = add_real(add_real(hash, r->trace[i].n_eff), r->trace[i].log_likelihood);
        hash = add_bytes(hash, &r->trace[i].followers, sizeof r->trace[i].followers);
    }
    return hash;
}

/* 0: grouping fails. The units are hashed, too. */
static uint64_t group(uint64_t hash, cairn_contour_grouping *g,
                      const cairn_contour_grouping_input *in)
{
    cairn_budget budget = {INT32_MAX};
    cairn_contour_grouping_result r;

    if (cairn_contour_grouping_begin(g, in) != CAIRN_OK ||
        cairn_contour_grouping_step(g, &budget) != CAIRN_OK)
        return 0;
    r = cairn_contour_grouping_read(g);
    return add_bytes(add_grouping(hash, &r, in->model), &budget.left, sizeof budget.left);
}

uint64_t golden_grouped(void)
{
    cairn_shape_model_builder_params shape = cairn_shape_model_builder_default();
    cairn_contour_grouping_params params = cairn_contour_grouping_default();
    static cairn_segment lines[MOST_LINES];
    cairn_random random = cairn_random_seed(31, 1);
    cairn_vec2 corners[JUG], at[2] = {{70, 80}, {180, 70}};
    cairn_curve outline = {corners, JUG, 1};
    cairn_budget budget = {INT32_MAX};
    cairn_shape_model_builder *builder;
    cairn_contour_grouping *grouping;
    cairn_shape_model model;
    cairn_pool pool;
    uint64_t hash;

    shape.outline_samples = 64;
    params.max_width = GROUP_WIDTH;
    params.max_height = GROUP_HEIGHT;
    params.max_tokens = 300;
    params.max_outline = 100;
    params.particles = 40;
    params.max_objects = 3;
    for (int32_t i = 0; i < JUG; i++) {
        corners[i].x = jug[i][0];
        corners[i].y = jug[i][1];
    }
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_shape_model_builder_create(&builder, &pool, &shape) != CAIRN_OK ||
        cairn_contour_grouping_create(&grouping, &pool, &params) != CAIRN_OK ||
        cairn_shape_model_builder_begin(builder, &outline, 1) != CAIRN_OK ||
        cairn_shape_model_builder_step(builder, &budget) != CAIRN_OK)
        return 0;
    model = cairn_shape_model_builder_read(builder);
    hash = add_model(GOLDEN_START, &model);
    for (int32_t part = 0; part < 2; part++) {
        cairn_contour_grouping_input in = {
            .segments = lines, .width = GROUP_WIDTH, .height = GROUP_HEIGHT, .model = &model};

        in.count = add_jug(lines, 0, at[0], 1, JUG);
        in.count = add_jug(lines, in.count, at[1], CAIRN_REAL(1.25), part ? 6 : JUG);
        in.count = add_clutter(lines, in.count, part ? 220 : 60, &random);
        in.min_size = CAIRN_REAL(0.7) * model.size;
        in.max_size = CAIRN_REAL(1.4) * model.size;
        in.min_turn = CAIRN_REAL(-0.2);
        in.max_turn = CAIRN_REAL(0.3);
        in.mean_length = 9;
        hash = group(hash, grouping, &in);
    }
    return hash;
}

/* The jug and clutter by the method of the thesis. */
uint64_t golden_grouped_written(void)
{
    cairn_shape_model_builder_params shape = cairn_shape_model_builder_default();
    cairn_contour_grouping_params params = cairn_contour_grouping_as_written();
    static cairn_segment lines[MOST_LINES];
    cairn_random random = cairn_random_seed(33, 1);
    cairn_vec2 corners[JUG], at = {120, 80}, ends[JUG];
    cairn_curve outline = {corners, JUG, 1};
    cairn_budget budget = {INT32_MAX};
    cairn_shape_model_builder *builder;
    cairn_contour_grouping *grouping;
    cairn_contour_grouping_input in;
    cairn_shape_model model;
    cairn_pool pool;

    shape.outline_samples = 64;
    params.max_width = GROUP_WIDTH;
    params.max_height = GROUP_HEIGHT;
    params.max_tokens = MOST_LINES;
    params.max_outline = 100;
    params.max_points = 4096;
    params.max_steps = 40;
    params.particles = 40;
    params.max_objects = 3;
    for (int32_t i = 0; i < JUG; i++) {
        corners[i].x = jug[i][0];
        corners[i].y = jug[i][1];
        ends[i].x = at.x + jug[i][0];
        ends[i].y = at.y + jug[i][1];
    }
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_shape_model_builder_create(&builder, &pool, &shape) != CAIRN_OK ||
        cairn_contour_grouping_create(&grouping, &pool, &params) != CAIRN_OK ||
        cairn_shape_model_builder_begin(builder, &outline, 1) != CAIRN_OK ||
        cairn_shape_model_builder_step(builder, &budget) != CAIRN_OK)
        return 0;
    model = cairn_shape_model_builder_read(builder);
    memset(&in, 0, sizeof in);
    in.segments = lines;
    in.count = add_clutter(lines, add_jug(lines, 0, at, 1, JUG), 60, &random);
    in.width = GROUP_WIDTH;
    in.height = GROUP_HEIGHT;
    in.model = &model;
    in.min_size = in.max_size = model.size;
    in.mean_length = 9;
    in.look_ahead = 14;
    in.ends = ends;
    in.end_count = 4;
    return group(GOLDEN_START, grouping, &in);
}

/* ---- Two bars, one bent, and noise ---- */

enum { SKELETON_WIDTH = 128, SKELETON_HEIGHT = 96, MOST_EDGELS = 900 };

static int32_t add_edgel(cairn_edgel *edgels, int32_t count, cairn_vec2 at, cairn_vec2 normal)
{
    edgels[count].position = at;
    edgels[count].normal = normal;
    edgels[count].gradient_magnitude = 10;
    return count + 1;
}

static int32_t draw_edgels(cairn_edgel *edgels, cairn_random *random)
{
    int32_t count = 0;

    for (int32_t i = 0; i < 80; i++) {
        cairn_vec2 lower = {20 + (cairn_real)i, 20},
                   upper = {20 + (cairn_real)i, 34 + (cairn_real)i / 16};
        cairn_vec2 up = {0, 1}, down = {0, -1};

        count = add_edgel(edgels, count, lower, up);
        count = add_edgel(edgels, count, upper, down);
    }
    for (int32_t i = 0; i < 120; i++) {
        cairn_vec2 out;

        cairn_sincos((cairn_real)i * (CAIRN_PI / 160) + CAIRN_REAL(0.2), &out.y, &out.x);
        for (int32_t k = 0; k < 2; k++) {
            cairn_vec2 at = {64 + (cairn_real)(k ? 44 : 30) * out.x,
                             46 + (cairn_real)(k ? 44 : 30) * out.y};

            count = add_edgel(edgels, count, at, cairn_vec2_scale(out, k ? -1 : 1));
        }
    }
    for (int32_t i = 0; i < 200; i++) {
        cairn_vec2 at = {cairn_random_uniform(random, 0, SKELETON_WIDTH),
                         cairn_random_uniform(random, 0, SKELETON_HEIGHT)};
        cairn_vec2 normal;

        cairn_sincos(cairn_random_uniform(random, -3, 3), &normal.y, &normal.x);
        count = add_edgel(edgels, count, at, normal);
    }
    return count;
}

static uint64_t add_skeletons(uint64_t hash, const cairn_skeleton_grouping_result *r)
{
    hash = add_real(add_real(hash, r->min_radius), r->max_radius);
    hash = add_bytes(add_bytes(hash, &r->centre_count, sizeof r->centre_count), &r->seed_count,
                     sizeof r->seed_count);
    for (int32_t i = 0; i < r->part_count; i++) {
        hash = add_real(hash, r->parts[i].log_odds);
        hash = add_bytes(hash, r->parts[i].joint, sizeof r->parts[i].joint);
        hash = add_bytes(hash, &r->parts[i].object, sizeof r->parts[i].object);
    }
    for (int32_t i = 0; i < r->point_count; i++) {
        hash = add_real(add_point(hash, r->points[i].centre), r->points[i].radius);
        hash = add_point(add_point(hash, r->points[i].contact[0]), r->points[i].contact[1]);
    }
    return hash;
}

/* Hash of two images, the first without a range of radii. */
static uint64_t golden_skeletons_of(cairn_skeleton_grouping_params params)
{
    static cairn_edgel edgels[MOST_EDGELS];
    cairn_random random = cairn_random_seed(41, 1);
    cairn_budget budget = {INT32_MAX};
    cairn_skeleton_grouping_result r;
    cairn_skeleton_grouping *skeleton;
    uint64_t hash = GOLDEN_START;
    cairn_pool pool;

    params.max_width = SKELETON_WIDTH;
    params.max_height = SKELETON_HEIGHT;
    params.max_edgels = MOST_EDGELS;
    params.max_centres = 600;
    params.max_lines = 48;
    params.max_parts = 24;
    params.max_points = 600;
    params.max_steps = 48;
    params.particle_count = 8;
    for (int32_t k = 0; k < 2; k++) {
        cairn_skeleton_grouping_input in = {
            .edgels = edgels, .width = SKELETON_WIDTH, .height = SKELETON_HEIGHT};

        in.count = draw_edgels(edgels, &random);
        in.min_radius = k ? 5 : 0;
        in.max_radius = k ? 10 : 0;
        if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
            cairn_skeleton_grouping_create(&skeleton, &pool, &params) != CAIRN_OK ||
            cairn_skeleton_grouping_begin(skeleton, &in) != CAIRN_OK ||
            cairn_skeleton_grouping_step(skeleton, &budget) != CAIRN_OK)
            return 0;
        r = cairn_skeleton_grouping_read(skeleton);
        hash = add_skeletons(hash, &r);
    }
    return add_bytes(hash, &budget.left, sizeof budget.left);
}

uint64_t golden_skeletons(void)
{
    return golden_skeletons_of(cairn_skeleton_grouping_default());
}

uint64_t golden_skeletons_written(void)
{
    cairn_skeleton_grouping_params params = cairn_skeleton_grouping_as_written();

    /* Walks are short here. */
    params.min_log_odds = 3;
    return golden_skeletons_of(params);
}

/* ---- The axes of a leaf ---- */

static uint64_t symmetry_of_leaf(const cairn_self_similarity_params *params)
{
    enum { LEAF = 60 };
    cairn_budget budget = {INT32_MAX};
    cairn_self_similarity *similarity;
    cairn_self_similarity_result r;
    cairn_pool pool;
    cairn_vec2 leaf[LEAF];
    cairn_curve outline = {leaf, LEAF, 1};
    uint64_t hash = GOLDEN_START;

    for (int32_t i = 0; i < LEAF; i++) {
        cairn_real sine, cosine, lobes, unused;

        cairn_sincos((cairn_real)i * (2 * CAIRN_PI / LEAF), &sine, &cosine);
        cairn_sincos((cairn_real)i * (10 * CAIRN_PI / LEAF), &unused, &lobes);
        leaf[i].x = (30 + 6 * lobes) * (cosine + CAIRN_REAL(0.3) * sine);
        leaf[i].y = (20 + 4 * lobes) * sine + 5 * cosine * cosine;
    }
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_self_similarity_create(&similarity, &pool, params) != CAIRN_OK ||
        cairn_self_similarity_begin(similarity, &outline, 1) != CAIRN_OK ||
        cairn_self_similarity_step(similarity, &budget) != CAIRN_OK)
        return 0;
    r = cairn_self_similarity_read(similarity);
    for (int32_t i = 0; i < r.count; i++) {
        const cairn_self_similarity_axis *a = &r.axes[i];

        hash = add_point(add_point(add_real(hash, a->dissimilarity), a->end[0]), a->end[1]);
        hash = add_real(add_real(hash, a->bend), a->skew);
    }
    return add_bytes(hash, &budget.left, sizeof budget.left);
}

uint64_t golden_symmetry(void)
{
    cairn_self_similarity_params params = cairn_self_similarity_default();

    return symmetry_of_leaf(&params);
}

uint64_t golden_symmetry_as_written(void)
{
    cairn_self_similarity_params params = cairn_self_similarity_as_written();

    return symmetry_of_leaf(&params);
}

/* ---- Every configuration of votes, two whole shapes ---- */

static uint64_t add_configurations(uint64_t hash)
{
    enum { VOTES = 40 };
    cairn_part_configuration_params params = cairn_part_configuration_as_written();
    cairn_random random = cairn_random_seed(17, 0);
    cairn_part_configuration_result r;
    cairn_part_configurator *configurator;
    cairn_budget budget = {INT32_MAX};
    cairn_part_configuration_vote votes[VOTES];
    cairn_pool pool;

    params.max_votes = VOTES;
    params.max_found = 200;
    params.min_sum = 1;
    for (int32_t i = 0; i < VOTES; i++) {
        cairn_part_configuration_vote vote = {
            i % 4, cairn_random_below(&random, 12), {0, 0}, 0, 0, 0, 20, 0};

        vote.centre.x = cairn_random_uniform(&random, 0, 300);
        vote.centre.y = cairn_random_uniform(&random, 0, 200);
        vote.scale = cairn_random_uniform(&random, 40, 90);
        vote.weight = cairn_random_uniform(&random, CAIRN_REAL(0.1), 1);
        votes[i] = vote;
    }
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_part_configuration_create(&configurator, &pool, &params) != CAIRN_OK ||
        cairn_part_configuration_begin(configurator, votes, VOTES, NULL) != CAIRN_OK ||
        cairn_part_configuration_step(configurator, &budget) != CAIRN_OK)
        return 0;
    r = cairn_part_configuration_read(configurator);
    for (int32_t i = 0; i < r.count; i++) {
        hash = add_point(add_real(add_real(hash, r.found[i].score), r.found[i].scale),
                         r.found[i].centre);
        hash =
            add_bytes(hash, &r.votes[r.found[i].first], (size_t)r.found[i].count * sizeof *r.votes);
    }
    hash = add_bytes(hash, &r.enumerated_count, sizeof r.enumerated_count);
    return add_bytes(hash, &budget.left, sizeof budget.left);
}

uint64_t golden_parts_as_written(void)
{
    enum { POINTS = 24 };
    cairn_shape_context_params params = cairn_shape_context_default();
    cairn_shape_context_input input = {
        CAIRN_SHAPE_CONTEXT_WHOLE, NULL, NULL, POINTS, POINTS - 4, 0};
    cairn_random random = cairn_random_seed(18, 0);
    cairn_budget budget = {INT32_MAX};
    cairn_vec2 first[POINTS], second[POINTS];
    cairn_shape_context *context;
    cairn_shape_context_result r;
    cairn_pool pool;
    uint64_t hash = add_configurations(GOLDEN_START);

    for (int32_t i = 0; i < POINTS; i++) {
        first[i].x = cairn_random_uniform(&random, 0, 60);
        first[i].y = cairn_random_uniform(&random, 0, 40);
        second[i].x = cairn_random_uniform(&random, 0, 30);
        second[i].y = cairn_random_uniform(&random, 0, 50);
    }
    params.max_points = POINTS;
    input.first = first;
    input.second = second;
    if (hash == 0 || cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_shape_context_create(&context, &pool, &params) != CAIRN_OK ||
        cairn_shape_context_begin(context, &input) != CAIRN_OK ||
        cairn_shape_context_step(context, &budget) != CAIRN_OK)
        return 0;
    r = cairn_shape_context_read(context);
    hash = add_real(add_real(hash, r.distance), r.symmetric_distance);
    return add_bytes(hash, &budget.left, sizeof budget.left);
}
