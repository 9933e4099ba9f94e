/* bench/clutter: grouping of objects in generated clutter (chapter 2); needs no data.
 *
 * A scene holds one object of a family, 120 px times 0.7 ... 1.3, rotated by up to 10 degrees,
 * among
 * --k others, with noise of --noise grey levels, and --hidden of its boundary behind a disc. The
 * model is the object's own shape (--mode instance) or another member of its family (class).
 * --method detect, parts: cairn_object_detect, which does not rotate models, on the same scenes;
 * its segments and its deformed outline. Measures of the best grouping:
 * - hit50: its box overlaps the object's by half;
 * - boundary80: 80 % of the whole boundary lie within 3 px of its segments or, where there are
 *   none,
 *   of the deformed outline of the model;
 * - visible80: 80 % of the visible boundary lie within 3 px of its segments alone;
 * - segments80: 80 % of the whole boundary, by segments alone;
 * - boundary_f: F measure of the segments; labels: F measure by lengths of segments;
 * - false_per_image: counted on as many scenes without the object. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_scene.h"
#include "cairn/contour_search_run.h"
#include "cairn/contour_grouping.h"
#include "cairn/edge_segment.h"
#include "cairn/object_detect_run.h"
#include "src/host/base/degrees.h"
#include "tools/options.h"
#include "src/outlines/contour_grouping_variants.h"

#define TOLERANCE_PX 3 /* px */
#define TOKEN_PX     5 /* px */

enum { MOST_SEGMENTS = 40000, MOST_VERTICES = 4000 };

typedef struct settings {
    int64_t scenes, seed, k, particles, paths;
    double noise, hidden, evidence, smallest, largest, score;
    const char *mode, *method, *tokens, *draw;
    int32_t no_model, no_skeleton, each, occluded;
} settings;

/* Shared by the objects of a run. */
typedef struct finder {
    cairn_pool pool;
    void *memory;
    cairn_edge_chain_set *chains;
    cairn_edge_segment_set *segments;
    cairn_shape_model_builder *builder;
    cairn_contour_grouping *grouping;
    cairn_segment lines[MOST_SEGMENTS];
    int32_t line_count;
    cairn_contour_search_tokens tokens; /* methods detect and parts: the segments, */
    cairn_object_detections detections; /* and the detections */
} finder;

typedef struct sums {
    int32_t scenes, hit, whole, visible, completed, objects, absent;
    double f, label_precision, label_recall;
    double *seconds, *evidence, *absent_evidence;
} sums;

static size_t need_of(const cairn_edge_chain_params *chain,
                      const cairn_edge_segment_params *segment,
                      const cairn_shape_model_builder_params *shape,
                      const cairn_contour_grouping_params *group)
{
    return cairn_edge_chain_memory(chain) + cairn_edge_segment_memory(segment) +
           cairn_shape_model_builder_memory(shape) + cairn_contour_grouping_memory(group) + 64;
}

static int open_finder(finder *f, const settings *s)
{
    cairn_edge_chain_params chain = cairn_edge_chain_default();
    cairn_edge_segment_params segment = cairn_edge_segment_default();
    cairn_shape_model_builder_params shape = cairn_shape_model_builder_default();
    cairn_contour_grouping_params group = cairn_contour_grouping_default();
    size_t bytes;

    group.max_width = SCENE_WIDTH;
    group.max_height = SCENE_HEIGHT;
    group.particles = (int32_t)s->particles;
    contour_grouping_ablate(&group, s->no_model, s->no_skeleton);
    shape.max_paths = (int32_t)s->paths;
    if (s->evidence >= 0)
        group.min_evidence = (cairn_real)s->evidence;
    bytes = need_of(&chain, &segment, &shape, &group);
    f->memory = malloc(bytes);
    return f->memory != NULL && cairn_pool_init(&f->pool, f->memory, bytes) == CAIRN_OK &&
           cairn_edge_chain_create(&f->chains, &f->pool, &chain) == CAIRN_OK &&
           cairn_edge_segment_create(&f->segments, &f->pool, &segment) == CAIRN_OK &&
           cairn_shape_model_builder_create(&f->builder, &f->pool, &shape) == CAIRN_OK &&
           cairn_contour_grouping_create(&f->grouping, &f->pool, &group) == CAIRN_OK;
}

static int make_model(finder *f, const scene_shape *shape)
{
    static cairn_vec2 vertices[MOST_VERTICES];
    int32_t counts[SCENE_OUTLINES],
        outlines = scene_outlines(shape, vertices, MOST_VERTICES, counts);
    cairn_curve curves[SCENE_OUTLINES];
    cairn_budget budget = {INT32_MAX};
    cairn_vec2 *next = vertices;

    for (int32_t i = 0; i < outlines; i++) {
        cairn_curve curve = {next, counts[i], 1};

        curves[i] = curve;
        next += counts[i];
    }
    return cairn_shape_model_builder_begin(f->builder, curves, outlines) == CAIRN_OK &&
           cairn_shape_model_builder_step(f->builder, &budget) == CAIRN_OK;
}

/* Tokens instead of segments: parts of chains of TOKEN_PX px each. */
static void take_edgels(finder *f, const cairn_edge_chain_result *r)
{
    f->line_count = 0;
    for (int32_t c = 0; c < r->chain_count; c++)
        for (int32_t i = 0; i + TOKEN_PX < r->chains[c].count && f->line_count < MOST_SEGMENTS;
             i += TOKEN_PX) {
            const cairn_edge_chain_pixel *a = &r->pixels[r->chains[c].first + i], *b = a + TOKEN_PX;
            cairn_segment *line = &f->lines[f->line_count++];

            line->a.x = (cairn_real)a->x;
            line->a.y = (cairn_real)a->y;
            line->b.x = (cairn_real)b->x;
            line->b.y = (cairn_real)b->y;
        }
}

static int is_group(const settings *s)
{
    return strcmp(s->method, "group") == 0;
}

static void free_found(finder *f)
{
    cairn_contour_search_run_free_tokens(&f->tokens);
    cairn_object_detect_run_free(&f->detections);
}

/* By cairn_object_detect, which does not rotate models. */
static int detect(const settings *set, finder *f, const scene *s)
{
    cairn_raster_u8_view view = {s->edges, SCENE_WIDTH, SCENE_HEIGHT, SCENE_WIDTH};
    cairn_object_detect_params params = cairn_object_detect_default(SCENE_WIDTH, SCENE_HEIGHT);
    cairn_shape_model model = cairn_shape_model_builder_read(f->builder);
    cairn_file_error error;
    cairn_object_detect_run_image *field;
    int ok;

    free_found(f);
    params.min_size = (cairn_real)(set->smallest * (double)model.size / 240);
    params.max_size = (cairn_real)(set->largest * (double)model.size / 240);
    params.method = strcmp(set->method, "parts") == 0 ? CAIRN_OBJECT_DETECT_PARTS
                                                      : CAIRN_OBJECT_DETECT_EVIDENCE;
    params.mirror = 0;
    params.occluded = set->occluded;
    if (set->score > -100)
        params.min_score = (cairn_real)set->score;
    if (cairn_contour_search_run_tokens(&f->tokens, view, 1, 0, "scene", &error) != CAIRN_OK ||
        f->tokens.count > MOST_SEGMENTS ||
        cairn_object_detect_run_make(&field, &f->tokens, &params, "scene", &error) != CAIRN_OK)
        return 0;
    ok = cairn_object_detect_run(&f->detections, field, &model, "scene", &error) == CAIRN_OK;
    cairn_object_detect_run_free_image(field);
    f->line_count = f->tokens.count;
    if (f->line_count > 0)
        memcpy(f->lines, f->tokens.lines, (size_t)f->line_count * sizeof *f->lines);
    return ok;
}

/* From edges to objects. */
static int group(const settings *set, finder *f, const scene *s)
{
    cairn_raster_u8_view view = {s->edges, SCENE_WIDTH, SCENE_HEIGHT, SCENE_WIDTH};
    cairn_shape_model model = cairn_shape_model_builder_read(f->builder);
    cairn_budget budget = {INT32_MAX};
    cairn_edge_chain_result chains;
    cairn_edge_segment_result r;
    cairn_contour_grouping_input in;
    cairn_status status;
    double size = (double)model.size / 240;

    if (cairn_edge_chain_begin(f->chains, view) != CAIRN_OK ||
        cairn_edge_chain_step(f->chains, &budget) != CAIRN_OK)
        return 0;
    chains = cairn_edge_chain_read(f->chains);
    if (cairn_edge_segment_begin(f->segments, &chains) != CAIRN_OK ||
        cairn_edge_segment_step(f->segments, &budget) != CAIRN_OK)
        return 0;
    r = cairn_edge_segment_read(f->segments);
    f->line_count = r.count - r.virtual_count;
    for (int32_t i = 0; i < f->line_count; i++)
        f->lines[i] = r.segments[i].line;
    if (strcmp(set->tokens, "edgels") == 0)
        take_edgels(f, &chains);
    in.segments = f->lines;
    in.count = f->line_count;
    in.width = SCENE_WIDTH;
    in.height = SCENE_HEIGHT;
    in.model = &model;
    in.min_size = (cairn_real)(set->smallest * size);
    in.max_size = (cairn_real)(set->largest * size);
    in.max_turn = (cairn_real)(12 * CAIRN_DEGREE);
    in.min_turn = -in.max_turn;
    in.mean_length = r.mean_length;
    if (cairn_contour_grouping_begin(f->grouping, &in) != CAIRN_OK)
        return 0;
    do {
        budget.left = INT32_MAX;
        status = cairn_contour_grouping_step(f->grouping, &budget);
    } while (status == CAIRN_MORE);
    return status == CAIRN_OK;
}

static int find(const settings *set, finder *f, const scene *s)
{
    return is_group(set) ? group(set, f, s) : detect(set, f, s);
}

/* ---- Measures ---- */

static void mark_line(uint8_t *pixels, cairn_segment line)
{
    int32_t steps = 1 + (int32_t)cairn_segment_length(line);

    for (int32_t i = 0; i <= steps; i++) {
        int32_t x = (int32_t)lrint((double)line.a.x + (double)(line.b.x - line.a.x) * i / steps);
        int32_t y = (int32_t)lrint((double)line.a.y + (double)(line.b.y - line.a.y) * i / steps);

        if (x >= 0 && y >= 0 && x < SCENE_WIDTH && y < SCENE_HEIGHT)
            pixels[y * SCENE_WIDTH + x] = 1;
    }
}

/* 1 when a pixel of at least `least` lies within TOLERANCE_PX px. */
static int has_near(const uint8_t *pixels, int32_t at, int32_t least)
{
    int32_t x = at % SCENE_WIDTH, y = at / SCENE_WIDTH;

    for (int32_t v = y - TOLERANCE_PX; v <= y + TOLERANCE_PX; v++)
        for (int32_t u = x - TOLERANCE_PX; u <= x + TOLERANCE_PX; u++)
            if (u >= 0 && v >= 0 && u < SCENE_WIDTH && v < SCENE_HEIGHT &&
                (u - x) * (u - x) + (v - y) * (v - y) <= TOLERANCE_PX * TOLERANCE_PX &&
                pixels[v * SCENE_WIDTH + u] >= least)
                return 1;
    return 0;
}

/* The share of the pixels of at least `of` in one image that lie near those of at least `to` in the
 * other. */
static double share_near(const uint8_t *pixels, int32_t of, const uint8_t *others, int32_t to)
{
    int32_t count = 0, near = 0;

    for (int32_t i = 0; i < SCENE_PIXELS; i++)
        if (pixels[i] >= of) {
            count++;
            near += has_near(others, i, to);
        }
    return count > 0 ? (double)near / count : 0;
}

static double share_of(const double b[4], const double box[4])
{
    double w = fmax(0, fmin(b[2], box[2]) - fmax(b[0], box[0]));
    double h = fmax(0, fmin(b[3], box[3]) - fmax(b[1], box[1])), both = w * h;

    return both / ((b[2] - b[0]) * (b[3] - b[1]) + (box[2] - box[0]) * (box[3] - box[1]) - both);
}

static double overlap(const cairn_shape_model *m, const cairn_contour_grouping_object *o,
                      const double box[4])
{
    double b[4] = {1e9, 1e9, -1e9, -1e9};

    for (int32_t i = 0; i < m->outline_count; i++) {
        double px = (double)m->outline[i].position.x, py = (double)m->outline[i].position.y;
        double c = cos((double)o->turn) * (double)o->size,
               s = sin((double)o->turn) * (double)o->size;
        double x = (double)o->origin.x + c * px - s * py, y = (double)o->origin.y + s * px + c * py;

        b[0] = fmin(b[0], x);
        b[1] = fmin(b[1], y);
        b[2] = fmax(b[2], x);
        b[3] = fmax(b[3], y);
    }
    return share_of(b, box);
}

/* Completes the contour of an object in its gaps by the outline of the model. */
static void complete(uint8_t *pixels, const cairn_shape_model *m,
                     const cairn_contour_grouping_object *o, const int32_t *along)
{
    double c = cos((double)o->turn) * (double)o->size, s = sin((double)o->turn) * (double)o->size;

    for (int32_t i = 0; i < m->outline_count; i++) {
        const cairn_oriented_point *p[2] = {&m->outline[i],
                                            &m->outline[(i + 1) % m->outline_count]};
        cairn_vec2 v[2];

        for (int e = 0; e < 2; e++) {
            double x = (double)p[e]->position.x, y = (double)p[e]->position.y;

            v[e].x = o->origin.x + (cairn_real)(c * x - s * y);
            v[e].y = o->origin.y + (cairn_real)(s * x + c * y);
        }
        if (along[i] < 0 && cairn_vec2_norm(cairn_vec2_sub(v[1], v[0])) < 20) {
            cairn_segment line = {v[0], v[1]};

            mark_line(pixels, line);
        }
    }
}

/* Whether a segment lies along the visible boundary: its middle and both quarters. */
static int is_true(const scene *s, cairn_segment line)
{
    for (int k = 1; k <= 3; k++) {
        int32_t x = (int32_t)lrint((double)line.a.x + (double)(line.b.x - line.a.x) * k / 4);
        int32_t y = (int32_t)lrint((double)line.a.y + (double)(line.b.y - line.a.y) * k / 4);

        if (x < 0 || y < 0 || x >= SCENE_WIDTH || y >= SCENE_HEIGHT ||
            !has_near(s->truth, y * SCENE_WIDTH + x, 2))
            return 0;
    }
    return 1;
}

static void add_labels(sums *t, const finder *f, const scene *s, const uint8_t *chosen)
{
    double found = 0, right = 0, all = 0;

    for (int32_t i = 0; i < f->line_count; i++) {
        double length = (double)cairn_segment_length(f->lines[i]);
        int true_one = is_true(s, f->lines[i]);

        found += chosen[i] ? length : 0;
        right += chosen[i] && true_one ? length : 0;
        all += true_one ? length : 0;
    }
    t->label_precision += found > 0 ? right / found : 0;
    t->label_recall += all > 0 ? right / all : 0;
}

/* Draws the detections over the edges (PPM). */
static void draw(const char *folder, int64_t index, const scene *s, const uint8_t *grouped)
{
    char path[512];
    FILE *file;

    snprintf(path, sizeof path, "%s/%03" PRId64 ".ppm", folder, index);
    file = fopen(path, "wb");
    if (file == NULL)
        return;
    fprintf(file, "P6\n%d %d\n255\n", SCENE_WIDTH, SCENE_HEIGHT);
    for (int32_t i = 0; i < SCENE_PIXELS; i++) {
        double g = fmin(255, fmax(0, (double)s->grey[i]));
        uint8_t v = (uint8_t)(s->edges[i] ? 255 : g / 2);
        uint8_t pixel[3] = {v, v, v};

        if (s->truth[i] > 0)
            pixel[1] = 160;
        if (grouped[i]) {
            pixel[0] = 255;
            pixel[1] = pixel[2] = 0;
        }
        (void)fwrite(pixel, 1, 3, file);
    }
    (void)fclose(file);
}

/* The same of a detection: its deformed outline where it has no segment. */
static void complete_detection(uint8_t *pixels, const cairn_contour_search_place *outline,
                               int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        const cairn_contour_search_place *p = &outline[i], *q = &outline[(i + 1) % count];

        if (p->segment < 0 && p->outline_index == q->outline_index &&
            cairn_vec2_norm(cairn_vec2_sub(q->point.position, p->point.position)) < 20) {
            cairn_segment line = {p->point.position, q->point.position};

            mark_line(pixels, line);
        }
    }
}

/* The best result: its segments, their pixels, its box's overlap with the object's. */
typedef struct best_one {
    const int32_t *segments;
    int32_t count, found; /* found: objects */
    double share, score, evidence;
} best_one;

static best_one best_of(const settings *set, const finder *f, const scene *s)
{
    cairn_contour_grouping_result r = cairn_contour_grouping_read(f->grouping);
    cairn_shape_model model = cairn_shape_model_builder_read(f->builder);
    const cairn_object_detection *d = f->detections.found;
    best_one best = {NULL, 0, r.object_count, 0, (double)r.best_score, (double)r.best_evidence};

    if (!is_group(set)) {
        best.found = f->detections.count;
        best.score = best.evidence = best.found > 0 ? (double)d->score : 0;
        if (best.found > 0) {
            const double box[4] = {(double)d->left, (double)d->top, (double)d->right,
                                   (double)d->bottom};

            best.segments = &f->detections.segments[d->first_segment];
            best.count = d->segment_count;
            best.share = share_of(box, s->box);
        }
    } else if (best.found > 0) {
        best.segments = &r.segments[r.objects[0].first];
        best.count = r.objects[0].count;
        best.share = overlap(&model, &r.objects[0], s->box);
    }
    return best;
}

static void complete_best(const settings *set, const finder *f, uint8_t *pixels)
{
    cairn_contour_grouping_result r = cairn_contour_grouping_read(f->grouping);
    cairn_shape_model model = cairn_shape_model_builder_read(f->builder);

    if (is_group(set))
        complete(pixels, &model, &r.objects[0], &r.outline_segments[r.objects[0].first_outline]);
    else
        complete_detection(pixels, &f->detections.outline[f->detections.found[0].first_outline],
                           f->detections.found[0].outline_count);
}

static void measure(const settings *set, sums *t, const finder *f, const scene *s, int64_t index)
{
    static uint8_t grouped[SCENE_PIXELS], chosen[MOST_SEGMENTS];
    cairn_contour_grouping_result r = cairn_contour_grouping_read(f->grouping);
    best_one best = best_of(set, f, s);
    double coverage, precision, visible;

    memset(grouped, 0, sizeof grouped);
    memset(chosen, 0, sizeof chosen);
    for (int32_t i = 0; i < best.count; i++) {
        chosen[best.segments[i]] = 1;
        mark_line(grouped, f->lines[best.segments[i]]);
    }
    coverage = share_near(s->truth, 1, grouped, 1);
    visible = share_near(s->truth, 2, grouped, 1);
    precision = share_near(grouped, 1, s->truth, 1);
    if (set->draw != NULL)
        draw(set->draw, index, s, grouped);
    if (best.found > 0)
        complete_best(set, f, grouped);
    t->completed += share_near(s->truth, 1, grouped, 1) >= 0.8;
    t->hit += best.share >= 0.5;
    t->whole += coverage >= 0.8;
    t->visible += visible >= 0.8;
    t->f += coverage + precision > 0 ? 2 * coverage * precision / (coverage + precision) : 0;
    add_labels(t, f, s, chosen);
    t->evidence[t->scenes] = best.evidence;
    if (set->each) {
        bench_json_begin("clutter");
        bench_json_integer("scene", index);
        bench_json_number("iou", best.share);
        bench_json_number("coverage", coverage);
        bench_json_number("precision", precision);
        bench_json_number("score", best.score);
        bench_json_number("evidence", best.evidence);
        bench_json_integer("tokens", r.token_count);
        bench_json_integer("starts", r.hypothesis_count);
        bench_json_integer("objects", best.found);
        bench_json_number("seconds", t->seconds[t->scenes]);
        bench_json_end();
    }
}

static int run_scene(const settings *set, sums *t, finder *f, int64_t index)
{
    static scene s;
    int32_t family = (int32_t)(index % SCENE_FAMILIES);
    cairn_random random = cairn_random_seed((uint64_t)(set->seed + index), 77);
    scene_shape shape = scene_shape_draw(family, &random),
                other = scene_shape_draw(family, &random);
    scene_options options = {(int32_t)set->k, set->noise, set->hidden, 0};
    double start;

    if (!make_model(f, strcmp(set->mode, "class") == 0 ? &other : &shape))
        return 0;
    scene_draw(&s, &shape, &options, &random);
    start = bench_seconds();
    if (!find(set, f, &s))
        return 0;
    t->seconds[t->scenes] = bench_seconds() - start;
    measure(set, t, f, &s, index);
    options.without = 1;
    scene_draw(&s, &shape, &options, &random);
    if (!find(set, f, &s))
        return 0;
    t->absent_evidence[t->scenes] = best_of(set, f, &s).evidence;
    t->objects += best_of(set, f, &s).found;
    if (set->each) {
        bench_json_begin("clutter");
        bench_json_integer("without", index);
        bench_json_number("evidence", t->absent_evidence[t->scenes]);
        bench_json_end();
    }
    t->scenes++;
    return 1;
}

static void print_summary(const settings *s, const sums *t, const finder *f)
{
    double n = t->scenes;

    bench_json_begin("clutter");
    bench_json_text("method", s->method);
    bench_json_text("mode", s->mode);
    bench_json_integer("occluded", s->occluded);
    bench_json_integer("scenes", t->scenes);
    bench_json_integer("seed", s->seed);
    bench_json_integer("k", s->k);
    bench_json_number("noise", s->noise);
    bench_json_number("hidden", s->hidden);
    bench_json_integer("particles", s->particles);
    bench_json_number("hit50", t->hit / n);
    bench_json_number("boundary80", t->completed / n);
    bench_json_number("visible80", t->visible / n);
    bench_json_number("segments80", t->whole / n);
    bench_json_number("boundary_f", t->f / n);
    bench_json_number("label_precision", t->label_precision / n);
    bench_json_number("label_recall", t->label_recall / n);
    bench_json_number("false_per_image", t->objects / n);
    bench_json_number("seconds_median", bench_median(t->seconds, (size_t)t->scenes));
    bench_json_number("evidence_median", bench_median(t->evidence, (size_t)t->scenes));
    bench_sort(t->absent_evidence, (size_t)t->scenes);
    bench_json_number("absent_evidence_90", t->absent_evidence[t->scenes * 9 / 10]);
    bench_json_integer("pool_bytes", (int64_t)f->pool.peak);
    bench_json_true("summary");
    bench_json_end();
}

static option_result read_settings(settings *s, int argc, char **argv)
{
    const char *data = NULL;
    const option table[] = {
        OPTION_INTEGER("--scenes", &s->scenes, 1, 100000, "N", "scenes"),
        OPTION_INTEGER("--seed", &s->seed, 0, 1e9, "S", "of the first scene"),
        OPTION_INTEGER("--k", &s->k, 0, 1000, "K", "clutter objects"),
        OPTION_NUMBER("--noise", &s->noise, 0, 100, "SIGMA", "grey levels"),
        OPTION_NUMBER("--hidden", &s->hidden, 0, 0.9, "SHARE", "of the boundary"),
        OPTION_TEXT("--mode", &s->mode, "NAME", "instance or class"),
        OPTION_TEXT("--method", &s->method, "NAME",
                    "group; detect: by evidence for the outline; parts: by its parts"),
        OPTION_INTEGER("--particles", &s->particles, 1, 4096, "N", "of the filter"),
        OPTION_INTEGER("--paths", &s->paths, 1, CAIRN_SHAPE_MODEL_MAX_PATHS, "N",
                       "of a model at most"),
        OPTION_NUMBER("--min-evidence", &s->evidence, 0, 1000, "E",
                      "of a grouping that is reported"),
        OPTION_NUMBER("--min-score", &s->score, -100, 100, "S",
                      "of a detection that counts; -100: as is its default"),
        OPTION_NUMBER("--smallest", &s->smallest, 1, 1000, "PX",
                      "height of an object that is searched"),
        OPTION_NUMBER("--largest", &s->largest, 1, 1000, "PX",
                      "height of an object that is searched"),
        OPTION_TEXT("--tokens", &s->tokens, "NAME", "segments or edgels"),
        OPTION_FLAG("--occluded", &s->occluded, "of detect: with occlusion allowed"),
        OPTION_FLAG("--no-model", &s->no_model, "without the model term"),
        OPTION_FLAG("--no-skeleton", &s->no_skeleton, "without the skeleton term"),
        OPTION_FLAG("--each", &s->each, "a line for each scene, too"),
        OPTION_TEXT("--draw", &s->draw, "DIR", "pictures of what was found"),
        OPTION_TEXT("--data", &data, "DIR", "not used: scenes are generated"),
    };
    const option_set set = {"bench/clutter", "[options]",
                            "Groups the contours of known objects in generated clutter.", table,
                            sizeof table / sizeof *table};
    size_t count = 0;
    option_result result = options_read(&set, argc, argv, NULL, &count);

    if (result != OPTIONS_READ)
        return result;
    if (strcmp(s->mode, "instance") != 0 && strcmp(s->mode, "class") != 0)
        return (option_result)options_refuse("bench/clutter",
                                             "--mode %s, expected instance or class", s->mode);
    if (strcmp(s->tokens, "segments") != 0 && strcmp(s->tokens, "edgels") != 0)
        return (option_result)options_refuse("bench/clutter",
                                             "--tokens %s, expected segments or edgels", s->tokens);
    if (s->smallest > s->largest)
        return (option_result)options_refuse("bench/clutter",
                                             "--smallest %g, expected at most --largest %g",
                                             s->smallest, s->largest);
    if (!is_group(s) && strcmp(s->method, "detect") != 0 && strcmp(s->method, "parts") != 0)
        return (option_result)options_refuse(
            "bench/clutter", "--method %s, expected group, detect or parts", s->method);
    return OPTIONS_READ;
}

int main(int argc, char **argv)
{
    settings s = {.scenes = 20,
                  .seed = 1,
                  .k = 25,
                  .particles = 300,
                  .paths = CAIRN_SHAPE_MODEL_MAX_PATHS,
                  .noise = 5,
                  .evidence = -1,
                  .score = -100,
                  .smallest = 78,
                  .largest = 162,
                  .mode = "instance",
                  .method = "group",
                  .tokens = "segments"};
    option_result result = read_settings(&s, argc, argv);
    finder *f;
    sums t;
    int ok;

    if (result != OPTIONS_READ)
        return (int)result;
    memset(&t, 0, sizeof t);
    f = calloc(1, sizeof *f);
    t.seconds = calloc((size_t)s.scenes * 3, sizeof *t.seconds);
    ok = f != NULL && t.seconds != NULL && open_finder(f, &s);
    t.evidence = ok ? t.seconds + s.scenes : NULL;
    t.absent_evidence = ok ? t.evidence + s.scenes : NULL;
    for (int64_t i = 0; i < s.scenes && ok; i++) {
        fprintf(stderr, "scene %" PRId64 "\n", i);
        ok = run_scene(&s, &t, f, i);
    }
    if (ok)
        print_summary(&s, &t, f);
    else
        fprintf(stderr, "bench/clutter: a scene could not be grouped\n");
    if (f != NULL) {
        free_found(f);
        free(f->memory);
    }
    free(f);
    free(t.seconds);
    return ok ? 0 : 1;
}
