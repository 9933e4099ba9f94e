/* Pairwise merging of real maps. */
#include "bench/bench_maps.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_reliability.h"
#include "cairn/map_merge.h"
#include "src/host/files/map_file_image.h"

/* Pixels: the largest fitting error of annotated pairs that are used, and the tolerance of a placed
 * map. */
static const double FIT_MOST = 16, RIGHT_HALMSTAD = 20, RIGHT_PARTS = 10;

/* Maps are coarsened while they have more cells to a side than MAX_SIDE_CELLS, or are not merged
 * and keep MIN_SIDE_CELLS. */
enum { MIN_SIDE_CELLS = 175, MAX_SIDE_CELLS = 800, MAX_NAME_BYTES = 64 };

/* Pixels beyond which the distance of a wall is clipped. */
enum { MAX_DISTANCE_PX = 40 };

/* Factors by which a map may be larger than the other one: SIZE_STEP apart, the first in the
 * middle. */
enum { SIZES = 3 };
static const double SIZE[SIZES] = {1, 0.97, 1.03}, SIZE_STEP = 0.03, MOST_STEPS = 1.5;

/* Nats by which the support of one pose varies with the cells, and poses of less difference are
 * ambiguous. */
static const double SUPPORT_NOISE = 3;

static const double FULL_TURN = 6.283185307179586;

/* Pixels of the source's middle, and radians, beyond which two poses are of different places. */
static const double ELSEWHERE_PX = 100, ELSEWHERE_RAD = 0.2;

typedef struct picture {
    char name[MAX_NAME_BYTES];
    uint8_t *cells; /* row 0 lowest */
    int32_t width, height;
} picture;

/* q = rotation and shift of p, in pixels. */
typedef struct shift {
    double cosine, sine, scale, x, y;
} shift;

static int load(const char *folder, const char *name, picture *p)
{
    char path[1200];
    cairn_file_error error;
    cairn_image image;

    snprintf(path, sizeof path, "%s/%s.png", folder, name);
    if (cairn_image_read(&image, path, &error) != CAIRN_OK) {
        fprintf(stderr, "%s\n", error.text);
        return 0;
    }
    snprintf(p->name, sizeof p->name, "%s", name);
    p->width = image.width;
    p->height = image.height;
    p->cells = malloc((size_t)image.width * (size_t)image.height);
    for (int32_t y = 0; y < image.height && p->cells != NULL; y++)
        for (int32_t x = 0; x < image.width; x++) {
            uint8_t v =
                image.pixel[(size_t)(image.height - 1 - y) * (size_t)image.width + (size_t)x];

            p->cells[(size_t)y * (size_t)image.width + (size_t)x] =
                v < 90    ? CAIRN_OCCUPANCY_GRID_OCCUPIED
                : v > 220 ? CAIRN_OCCUPANCY_GRID_FREE
                          : CAIRN_OCCUPANCY_GRID_UNKNOWN;
        }
    cairn_image_free(&image);
    return p->cells != NULL;
}

/* size: side of a pixel in pixels of the target. */
static cairn_status add_coarse(cairn_map_merge *merge, const picture *p, int32_t k, double size,
                               uint8_t *cells_of)
{
    cairn_raster_u8_view fine = {p->cells, p->width, p->height, p->width};
    cairn_raster_u8 coarse = {cells_of, (p->width - 1) / k + 1, (p->height - 1) / k + 1,
                              (p->width - 1) / k + 1};
    cairn_map_merge_map map;
    cairn_status status = cairn_map_merge_coarsen(fine, k, coarse);

    map.cells = cairn_raster_u8_as_view(coarse);
    map.resolution = (cairn_real)(k * size); /* lengths in pixels of the target */
    map.origin = cairn_pose_identity();
    return status == CAIRN_OK ? cairn_map_merge_add(merge, &map, NULL) : status;
}

/* Pose of `source` in `target`, in pixels. 1 and *found set when it was placed; -1 on failure. */
static int merge_at(const picture *target, const picture *source, int32_t k, double size,
                    const cairn_map_merge_params *base, cairn_map_merge_placed *found)
{
    cairn_map_merge_params params = *base;
    int32_t cells = target->width * target->height, own = source->width * source->height;
    cairn_status status = CAIRN_MORE;
    cairn_map_merge *merge = NULL;
    uint8_t *cells_of[2];
    cairn_pool pool;
    size_t bytes;
    void *memory;
    int ok;

    params.max_maps = 2;
    params.max_cells = cells + own;
    params.max_map_cells = cells > own ? cells : own;
    params.max_points = 4096;
    bytes = cairn_map_merge_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    cells_of[0] = malloc((size_t)cells);
    cells_of[1] = malloc((size_t)own);
    ok = memory != NULL && cells_of[0] != NULL && cells_of[1] != NULL &&
         cairn_pool_init(&pool, memory, bytes) == CAIRN_OK &&
         cairn_map_merge_create(&merge, &pool, &params) == CAIRN_OK &&
         add_coarse(merge, target, k, 1, cells_of[0]) == CAIRN_OK &&
         add_coarse(merge, source, k, size, cells_of[1]) == CAIRN_OK &&
         cairn_map_merge_begin(merge, 0, NULL) == CAIRN_OK;
    while (ok && status == CAIRN_MORE) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status = cairn_map_merge_step(merge, &budget);
    }
    ok = ok && status == CAIRN_OK;
    if (ok)
        *found = cairn_map_merge_of(merge, 1);
    free(cells_of[0]);
    free(cells_of[1]);
    free(memory);
    return !ok ? -1 : found->verdict == CAIRN_MAP_MERGE_PLACED;
}

/* By about a half more. */
static int32_t next_size(int32_t k)
{
    return k + (k + 1) / 2;
}

/* Pose of a source, and its evidence. */
typedef struct finding {
    cairn_map_merge_placed placed;
    int32_t is_placed;
    int32_t cell_pixels;    /* pixels to a side of a cell */
    double size;            /* in pixels of the target */
    double supports[SIZES]; /* nats: of this place with each size; 0: another place */
} finding;

/* Position of the middle of a source's cell in the target. */
static cairn_vec2 placed_at(const finding *f, int32_t x, int32_t y)
{
    cairn_vec2 p = {(cairn_real)((x + 0.5) * f->size), (cairn_real)((y + 0.5) * f->size)};

    return cairn_pose_point(f->placed.reference_map, p);
}

/* Compares first whether it was placed, then the evidence. */
static int is_better(const finding *f, const finding *best)
{
    return f->is_placed != best->is_placed ? f->is_placed > best->is_placed
                                           : f->placed.support > best->placed.support;
}

static int is_elsewhere(const picture *source, const finding *a, const finding *b)
{
    cairn_vec2 p = placed_at(a, source->width / 2, source->height / 2),
               q = placed_at(b, source->width / 2, source->height / 2);

    return hypot((double)(p.x - q.x), (double)(p.y - q.y)) > ELSEWHERE_PX ||
           fabs(remainder((double)(a->placed.reference_map.theta - b->placed.reference_map.theta),
                          FULL_TURN)) > ELSEWHERE_RAD;
}

/* A pose elsewhere, of another merging of the same maps, competes. */
static void compete(const picture *source, const finding *other, finding *f)
{
    cairn_map_merge_placed *placed = &f->placed;

    if (is_elsewhere(source, f, other))
        placed->competing_support = cairn_max(placed->competing_support, other->placed.support);
    placed->error_probability =
        cairn_map_merge_error_probability(placed->support, placed->competing_support);
}

/* A place has the least error probability of the mergings that agree on it. */
static void agree(const finding *other, finding *f)
{
    f->placed.error_probability =
        cairn_min(f->placed.error_probability, other->placed.error_probability);
}

static int is_sure(const finding *f)
{
    return f->is_placed && cairn_map_merge_is_sure(&f->placed);
}

/* Merges with cells of k pixels; 0 on failure. */
static int find_at(const picture *target, const picture *source, int32_t k, double size,
                   const cairn_map_merge_params *base, finding *f)
{
    int placed = merge_at(target, source, k, size, base, &f->placed);

    memset(f->supports, 0, sizeof f->supports);
    f->is_placed = placed > 0;
    f->cell_pixels = k;
    f->size = size;
    return placed >= 0;
}

/* Finds the best pose with cells of k pixels, of all sizes. 0 on failure. */
static int find_best(const picture *target, const picture *source, int32_t k,
                     const cairn_map_merge_params *base, finding *best)
{
    finding tried[SIZES];
    int32_t at = 0;

    for (int32_t i = 0; i < SIZES; i++) {
        if (!find_at(target, source, k, SIZE[i], base, &tried[i]))
            return 0;
        at = is_better(&tried[i], &tried[at]) ? i : at;
    }
    *best = tried[at];
    for (int32_t i = 0; i < SIZES; i++) {
        compete(source, &tried[i], best);
        best->supports[i] =
            is_elsewhere(source, best, &tried[i]) ? 0 : (double)tried[i].placed.support;
    }
    return 1;
}

/* Merges with the size at which a parabola through the supports of the three sizes is highest. Its
 * pose counts unless it is elsewhere, or has less support by more than SUPPORT_NOISE. 0 on
 * failure. */
static int refine_size(const picture *target, const picture *source,
                       const cairn_map_merge_params *base, finding *best)
{
    const double *support = best->supports;
    double slope = support[2] - support[1], bend = 2 * support[0] - support[1] - support[2];
    double steps = bend > 0 ? fmin(fmax(slope / (2 * bend), -MOST_STEPS), MOST_STEPS)
                            : (best->size - 1) / SIZE_STEP;
    finding tried;

    if (!find_at(target, source, best->cell_pixels, 1 + steps * SIZE_STEP, base, &tried))
        return 0;
    if (tried.is_placed && !is_elsewhere(source, best, &tried) &&
        (double)tried.placed.support >= (double)best->placed.support - SUPPORT_NOISE) {
        agree(best, &tried);
        *best = tried;
    }
    return 1;
}

/* Combines the findings of two sizes of cells: of two that agree the one of more support, else the
 * one of less error probability, with which the other one competes. */
static void combine(const picture *source, finding *coarse, finding *best)
{
    finding finer = *best;

    if (!coarse->is_placed || !best->is_placed) {
        *best = is_better(coarse, best) ? *coarse : *best;
    } else if (is_elsewhere(source, best, coarse)) {
        compete(source, coarse, best);
        compete(source, &finer, coarse);
        *best = coarse->placed.error_probability < best->placed.error_probability ? *coarse : *best;
    } else {
        agree(coarse, best);
        agree(&finer, coarse);
        *best = is_better(coarse, best) ? *coarse : *best;
    }
}

/* Cells from fine to coarse until the place is sure, also by the next coarser ones; maps of several
 * surveys differ in scale by some percent. As written: the cells of the maps, coarsened to at most
 * MAX_SIDE_CELLS to a side. 0 on failure. */
static int merge_pair(const picture *target, const picture *source,
                      const cairn_map_merge_params *base, finding *best)
{
    int32_t side = target->width > target->height ? target->width : target->height;
    int32_t k = side > MAX_SIDE_CELLS ? (side - 1) / MAX_SIDE_CELLS + 1 : 1;
    int was_sure = 0;

    if (base->mode == CAIRN_MODE_AS_WRITTEN)
        return find_at(target, source, k, SIZE[0], base, best);
    if (!find_best(target, source, k, base, best))
        return 0;
    while (!(was_sure && is_sure(best)) && side / next_size(k) >= MIN_SIDE_CELLS) {
        finding coarse;

        was_sure = is_sure(best);
        k = next_size(k);
        if (!find_best(target, source, k, base, &coarse))
            return 0;
        combine(source, &coarse, best);
    }
    return !best->is_placed || refine_size(target, source, base, best);
}

/* Pixels from a point to the nearest wall of the target, at most MAX_DISTANCE_PX. */
static double to_wall(const picture *target, cairn_vec2 p)
{
    int32_t u = (int32_t)floor((double)p.x), v = (int32_t)floor((double)p.y);
    double least = MAX_DISTANCE_PX;

    for (int32_t y = v - MAX_DISTANCE_PX; y <= v + MAX_DISTANCE_PX; y++)
        for (int32_t x = u - MAX_DISTANCE_PX; x <= u + MAX_DISTANCE_PX; x++)
            if (x >= 0 && y >= 0 && x < target->width && y < target->height &&
                target->cells[(size_t)y * (size_t)target->width + (size_t)x] ==
                    CAIRN_OCCUPANCY_GRID_OCCUPIED)
                least = fmin(least, hypot(x - u, y - v));
    return least;
}

/* Mean distance in pixels of the source's walls from those of the target: parts of a map have no
 * ground truth. */
static double distance_to_walls(const picture *target, const picture *source, const finding *found)
{
    double sum = 0;
    int64_t count = 0;

    for (int32_t y = 0; y < source->height; y++)
        for (int32_t x = 0; x < source->width; x++) {
            if (source->cells[(size_t)y * (size_t)source->width + (size_t)x] !=
                CAIRN_OCCUPANCY_GRID_OCCUPIED)
                continue;
            sum += to_wall(target, placed_at(found, x, y));
            count++;
        }
    return count > 0 ? sum / (double)count : (double)NAN;
}

/* Mean distance in pixels of the source's walls from their true positions. */
static double displacement(const picture *source, shift truth, const finding *found)
{
    double sum = 0;
    int64_t count = 0;

    for (int32_t y = 0; y < source->height; y++)
        for (int32_t x = 0; x < source->width; x++) {
            double u = x + 0.5, v = y + 0.5;
            cairn_vec2 p = placed_at(found, x, y);

            if (source->cells[(size_t)y * (size_t)source->width + (size_t)x] !=
                CAIRN_OCCUPANCY_GRID_OCCUPIED)
                continue;
            sum += hypot((double)p.x - truth.scale * (truth.cosine * u - truth.sine * v) - truth.x,
                         (double)p.y - truth.scale * (truth.sine * u + truth.cosine * v) - truth.y);
            count++;
        }
    return count > 0 ? sum / (double)count : (double)NAN;
}

typedef struct tally {
    int32_t pairs, right, wrong, refused;
    bench_reliability reliability; /* of the maps that were placed */
} tally;

/* truth: NULL when only the target's walls decide. */
static void run_pair(const picture *target, const picture *source, const shift *truth, double right,
                     const cairn_map_merge_params *base, tally *t)
{
    finding found = {.cell_pixels = 0};
    double start = bench_seconds(), off = (double)NAN;
    int done = merge_pair(target, source, base, &found), placed = done && found.is_placed;

    t->pairs++;
    if (placed)
        off = truth != NULL ? displacement(source, *truth, &found)
                            : distance_to_walls(target, source, &found);
    t->right += off <= right;
    t->wrong += placed && !(off <= right);
    t->refused += !placed;
    if (placed)
        bench_reliability_add(&t->reliability, (double)found.placed.error_probability,
                              !(off <= right));
    bench_json_begin("merge");
    bench_json_text("source", source->name);
    bench_json_text("target", target->name);
    bench_json_text("verdict",
                    !done ? "failed" : cairn_map_merge_verdict_text(found.placed.verdict));
    bench_json_number("off_px", off);
    bench_json_number("wrong_probability",
                      placed ? (double)found.placed.error_probability : (double)NAN);
    bench_json_number("support", (double)found.placed.support);
    bench_json_number("competing", (double)found.placed.competing_support);
    bench_json_integer("cells", found.cell_pixels);
    bench_json_number("size", found.size);
    bench_json_number("seconds", bench_seconds() - start);
    bench_json_end();
    fflush(stdout);
}

static int run_halmstad(const char *folder, const cairn_map_merge_params *base, tally *t)
{
    char path[1100], line[1024];
    FILE *file;

    snprintf(path, sizeof path, "%s/pairs.csv", folder);
    file = fopen(path, "r");
    if (file == NULL)
        return 0;
    while (fgets(line, sizeof line, file) != NULL) {
        char names[2][MAX_NAME_BYTES];
        double points, theta, scale, x, y, rms;
        picture source = {"", NULL, 0, 0}, target = {"", NULL, 0, 0};

        if (sscanf(line, "%63[^,],%63[^,],%lf,%lf,%lf,%lf,%lf,%lf", names[0], names[1], &points,
                   &theta, &scale, &x, &y, &rms) != 8 ||
            strcmp(names[0], names[1]) >= 0 || strstr(names[1], "layout") != NULL || rms > FIT_MOST)
            continue;
        if (load(folder, names[0], &source) && load(folder, names[1], &target)) {
            shift truth = {cos(theta), sin(theta), scale, x, y};

            run_pair(&target, &source, &truth, RIGHT_HALMSTAD, base, t);
        }
        free(source.cells);
        free(target.cells);
    }
    fclose(file);
    return 1;
}

/* Parts of a map placed in the whole. */
static void run_parts(const char *folder, const cairn_map_merge_params *base, tally *t)
{
    picture whole = {"", NULL, 0, 0};

    if (load(folder, "intel", &whole))
        for (int i = 1; i <= 2; i++) {
            picture part = {"", NULL, 0, 0};
            char name[MAX_NAME_BYTES];

            snprintf(name, sizeof name, "intel_local_%02d", i);
            if (load(folder, name, &part))
                run_pair(&whole, &part, NULL, RIGHT_PARTS, base, t);
            free(part.cells);
        }
    free(whole.cells);
}

int bench_maps_run(const char *folder, const cairn_map_merge_params *base)
{
    tally halmstad, parts;
    char path[1024];

    memset(&halmstad, 0, sizeof halmstad);
    memset(&parts, 0, sizeof parts);
    snprintf(path, sizeof path, "%s/halmstad", folder);
    if (!run_halmstad(path, base, &halmstad)) {
        fprintf(stderr, "merge: no %s/pairs.csv: the maps are not there\n", path);
        return 3;
    }
    snprintf(path, sizeof path, "%s/parts", folder);
    run_parts(path, base, &parts);
    bench_reliability_print("merge", "halmstad", &halmstad.reliability);
    bench_json_begin("merge");
    bench_json_integer("pairs", halmstad.pairs);
    bench_json_integer("right", halmstad.right);
    bench_json_number("pairs_right",
                      halmstad.pairs > 0 ? (double)halmstad.right / halmstad.pairs : (double)NAN);
    bench_json_integer("wrong", halmstad.wrong);
    bench_json_integer("refused", halmstad.refused);
    bench_json_integer("sure", halmstad.reliability.sure);
    bench_json_integer("sure_wrong", halmstad.reliability.sure_wrong);
    bench_json_integer("parts_right", parts.right);
    bench_json_integer("parts", parts.pairs);
    bench_json_true("summary");
    bench_json_end();
    return 0;
}
