#include "bench/bench_parts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_score.h"
#include "cairn/random.h"

/* Random points per chosen place: the farthest from those chosen before is taken. */
enum { DRAWS = 12, BEAMS = 720, HALVINGS = 10, ROUNDS = 2 };

static const double FULL_TURN = 6.283185307179586;

static double uniform(cairn_random *random, double low, double high)
{
    return low + (high - low) * (double)cairn_random_unit(random);
}

/* ---- Places of the robots ---- */

/* A reachable point of the part, far from those chosen so far; 0 when none was found. */
static int choose_place(const sim_arena *arena, const bench_part *part, const sim_pose *chosen,
                        int32_t count, cairn_random *random, sim_pose *place)
{
    double best = -1;

    for (int32_t i = 0; i < DRAWS * 20 && (i < DRAWS || best < 0); i++) {
        sim_point p = {part->middle.x + uniform(random, -part->half[0], part->half[0]),
                       part->middle.y + uniform(random, -part->half[1], part->half[1])};
        double nearest = 1e9;

        if (!sim_arena_reachable(arena, p) || sim_arena_clearance(arena, p) < 0.2)
            continue;
        for (int32_t k = 0; k < count; k++)
            nearest = fmin(nearest, hypot(p.x - chosen[k].x, p.y - chosen[k].y));
        if (nearest > best) {
            best = nearest;
            place->x = p.x;
            place->y = p.y;
            place->theta = 0;
        }
    }
    return best >= 0;
}

static sim_survey *scan_part(const sim_arena *arena, const bench_parts_options *o,
                             const bench_part *part, int32_t index, cairn_random *random)
{
    sim_survey_options options = sim_survey_default();
    sim_pose poses[64];
    int32_t count = 0;
    char fault[256];
    sim_survey *survey;

    options.seed = o->seed * 1000 + (uint64_t)index;
    options.beams = BEAMS;
    options.fov = FULL_TURN;
    while (count < o->places && count < 64 &&
           choose_place(arena, part, poses, count, random, &poses[count]))
        poses[count++].theta = uniform(random, 0, FULL_TURN);
    if (count == 0) {
        fprintf(stderr, "parts: robot %d can stand nowhere\n", (int)index);
        return NULL;
    }
    survey = sim_survey_at(arena, &options, poses, count, 0, 0, fault, sizeof fault);
    if (survey == NULL)
        fprintf(stderr, "parts: %s\n", fault);
    return survey;
}

/* ---- Their grids ---- */

/* Displacement of a robot's own pose at a point of its tile: two waves across each other. */
static sim_point bend_at(const bench_part *part, sim_point at)
{
    double x = at.x - part->middle.x, y = at.y - part->middle.y;
    sim_point d = {part->bend * sin(part->bend_waves[0] * y + part->bend_waves[1]),
                   part->bend * sin(part->bend_waves[2] * x + part->bend_waves[3])};

    return d;
}

/* Where the robot takes a pose to be: moved and rotated by the bend there, less the bend in the
 * middle of its tile. */
static sim_pose assumed_pose(const bench_part *part, sim_pose truth)
{
    const double *w = part->bend_waves;
    double x = truth.x - part->middle.x, y = truth.y - part->middle.y;
    sim_point at = {truth.x, truth.y}, here = bend_at(part, at),
              middle = bend_at(part, part->middle);
    /* half the curl of the displacement */
    double turn = part->bend * (w[2] * cos(w[2] * x + w[3]) - w[0] * cos(w[0] * y + w[1])) / 2;
    sim_pose pose = {truth.x + here.x - middle.x, truth.y + here.y - middle.y, truth.theta + turn};

    return pose;
}

/* End of a beam in the frame of the part, whose lengths are those of the world times its scale. */
static cairn_vec2 end_of(const bench_part *part, const sim_scan *scan, int32_t beam, double range)
{
    sim_pose from = assumed_pose(part, scan->truth);
    double angle = from.theta + scan->angle_min + beam * scan->angle_step;
    sim_pose end = {from.x + range * cos(angle), from.y + range * sin(angle), 0};
    sim_pose seen = bench_pose_between(part->world_map, end);
    cairn_vec2 p = {(cairn_real)(part->scale * seen.x), (cairn_real)(part->scale * seen.y)};

    return p;
}

static int draw_part(bench_part *part, const sim_survey *survey, double resolution)
{
    cairn_occupancy_grid_params params = cairn_occupancy_grid_default();
    size_t bytes, cells = (size_t)part->side * (size_t)part->side;
    cairn_occupancy_grid *grid = NULL;
    cairn_raster_u8 out = {part->seen, part->side, part->side, part->side};
    cairn_pool pool;
    void *memory;
    int32_t scans;
    const sim_scan *scan = sim_survey_scans(survey, &scans);
    int ok;

    params.width = params.height = part->side;
    params.resolution = (cairn_real)resolution;
    params.origin.x = params.origin.y = -(cairn_real)(part->side * resolution / 2);
    bytes = cairn_occupancy_grid_memory(&params);
    memory = malloc(bytes + CAIRN_ALIGN);
    ok = memory != NULL && cairn_pool_init(&pool, memory, bytes + CAIRN_ALIGN) == CAIRN_OK &&
         cairn_occupancy_grid_create(&grid, &pool, &params) == CAIRN_OK;
    for (int32_t k = 0; ok && k < scans; k++)
        for (int32_t i = 0; i < scan[k].count; i++) {
            double range = (double)scan[k].range[i];
            int hit = isfinite(range);

            if (isnan(range))
                continue;
            ok &= cairn_occupancy_grid_add_beam(
                      grid, end_of(part, &scan[k], i, 0),
                      end_of(part, &scan[k], i, hit ? range : scan[k].range_max), hit) == CAIRN_OK;
        }
    ok = ok && cairn_occupancy_grid_classify(grid, cairn_occupancy_grid_thresholds_default(), 0,
                                             out) == CAIRN_OK;
    free(memory);
    for (size_t i = 0; ok && i < cells; i++) {
        double x = ((double)(i % (size_t)part->side) + 0.5 - part->side / 2.0) * resolution;
        size_t row = i / (size_t)part->side;
        double y = ((double)row + 0.5 - part->side / 2.0) * resolution;
        double c = cos(part->world_map.theta), s = sin(part->world_map.theta);
        double wx = part->world_map.x + c * x - s * y, wy = part->world_map.y + s * x + c * y;

        part->place[0][i] = (float)(wx - part->middle.x);
        part->place[1][i] = (float)(wy - part->middle.y);
    }
    return ok;
}

/* Crops a part to its tile with its margins. */
static void cut_part(bench_part *p)
{
    for (int32_t i = 0; i < p->side * p->side; i++) {
        int inside = 1;

        for (int k = 0; k < 2; k++)
            inside &= (double)p->place[k][i] >= -p->half[k] - p->margin[k][0] &&
                      (double)p->place[k][i] <= p->half[k] + p->margin[k][1];
        p->cells[i] = inside ? p->seen[i] : CAIRN_OCCUPANCY_GRID_UNKNOWN;
    }
}

double bench_parts_shared(const bench_parts *parts, int32_t a, int32_t b)
{
    const bench_part *p = &parts->list[a], *q = &parts->list[b];
    sim_pose seen = bench_pose_between(q->world_map, p->world_map);
    double c = cos(seen.theta), s = sin(seen.theta), r = parts->resolution;
    int64_t known_p = 0, known_q = 0, shared = 0;

    for (int32_t i = 0; i < q->side * q->side; i++)
        known_q += q->cells[i] != CAIRN_OCCUPANCY_GRID_UNKNOWN;
    for (int32_t i = 0; i < p->side * p->side; i++) {
        double x = (i % p->side + 0.5 - p->side / 2.0) * r,
               y = ((int32_t)(i / p->side) + 0.5 - p->side / 2.0) * r;
        double u = (seen.x + c * x - s * y) / r + q->side / 2.0,
               v = (seen.y + s * x + c * y) / r + q->side / 2.0;

        if (p->cells[i] == CAIRN_OCCUPANCY_GRID_UNKNOWN)
            continue;
        known_p++;
        if (u >= 0 && v >= 0 && u < q->side && v < q->side)
            shared += q->cells[(int32_t)v * q->side + (int32_t)u] != CAIRN_OCCUPANCY_GRID_UNKNOWN;
    }
    return (double)shared /
           (double)(known_p < known_q ? (known_p > 0 ? known_p : 1) : (known_q > 0 ? known_q : 1));
}

/* The axis along which the tile of b follows that of a; -1 when they do not share a whole side. */
static int neighbour_axis(const bench_part *a, const bench_part *b)
{
    double x = b->middle.x - a->middle.x, y = b->middle.y - a->middle.y;

    if (fabs(y) < 0.1 && x > 0 && x < 2.1 * a->half[0])
        return 0;
    return fabs(x) < 0.1 && y > 0 && y < 2.1 * a->half[1] ? 1 : -1;
}

static double median_overlap(const bench_parts *parts)
{
    double list[512];
    size_t count = 0;

    for (int32_t a = 0; a < parts->count; a++)
        for (int32_t b = 0; b < parts->count && count < 512; b++)
            if (neighbour_axis(&parts->list[a], &parts->list[b]) >= 0)
                list[count++] = bench_parts_shared(parts, a, b);
    return bench_median(list, count);
}

static void set_margin(bench_part *a, bench_part *b, int axis, double margin)
{
    a->margin[axis][1] = b->margin[axis][0] = margin;
    cut_part(a);
    cut_part(b);
}

/* The margin between two neighbours at which they have the requested overlap. */
static void set_pair(bench_parts *parts, int32_t a, int32_t b, int axis, double overlap,
                     double most)
{
    double low = 0, high = most;

    for (int k = 0; k < HALVINGS; k++) {
        double margin = (low + high) / 2;

        set_margin(&parts->list[a], &parts->list[b], axis, margin);
        if (bench_parts_shared(parts, a, b) < overlap)
            low = margin;
        else
            high = margin;
    }
    set_margin(&parts->list[a], &parts->list[b], axis, high);
}

/* All pairs of neighbours in turn, repeatedly: a margin slightly affects the overlaps of the
 * others. */
static void set_overlap(bench_parts *parts, double overlap, double most)
{
    for (int round = 0; round < ROUNDS; round++)
        for (int32_t a = 0; a < parts->count; a++)
            for (int32_t b = 0; b < parts->count; b++) {
                int axis = neighbour_axis(&parts->list[a], &parts->list[b]);

                if (axis >= 0)
                    set_pair(parts, a, b, axis, overlap, most);
            }
    parts->overlap = median_overlap(parts);
}

/* ---- The tiles ---- */

static int make_part(const sim_arena *arena, const bench_parts_options *o, int32_t index,
                     sim_point middle, const double half[2], double margin, bench_part *part)
{
    cairn_random random = cairn_random_seed(o->seed * 64 + (uint64_t)index, 23);
    double reach = hypot(half[0] + margin, half[1] + margin);
    bench_part grown;
    sim_survey *survey;
    size_t cells;
    int ok;

    part->middle = middle;
    part->half[0] = half[0];
    part->half[1] = half[1];
    part->world_map.x = middle.x + uniform(&random, -1, 1);
    part->world_map.y = middle.y + uniform(&random, -1, 1);
    part->world_map.theta = uniform(&random, -FULL_TURN / 2, FULL_TURN / 2);
    part->scale = o->stretch > 0 ? 1 + uniform(&random, -o->stretch, o->stretch) : 1;
    part->bend = o->bend;
    for (int k = 0; k < 4 && o->bend > 0; k++)
        part->bend_waves[k] =
            k % 2 == 0 ? uniform(&random, 0.1, 0.3) : uniform(&random, 0, FULL_TURN);
    part->side = 2 * (int32_t)ceil((reach + 1.5) / o->resolution);
    cells = (size_t)part->side * (size_t)part->side;
    part->cells = malloc(cells);
    part->seen = malloc(cells);
    part->place[0] = malloc(cells * sizeof *part->place[0]);
    part->place[1] = malloc(cells * sizeof *part->place[1]);
    if (part->cells == NULL || part->seen == NULL || part->place[0] == NULL ||
        part->place[1] == NULL)
        return 0;
    for (int k = 0; k < 4; k++)
        part->margin[k / 2][k % 2] = margin;
    grown = *part; /* places may also lie in the overlap */
    grown.half[0] += margin / 2;
    grown.half[1] += margin / 2;
    survey = scan_part(arena, o, &grown, index, &random);
    ok = survey != NULL && draw_part(part, survey, o->resolution);
    sim_survey_free(survey);
    return ok;
}

int bench_parts_make(const bench_parts_options *o, bench_parts *parts)
{
    sim_arena_options options = sim_arena_default();
    int32_t columns = (int32_t)ceil(sqrt((double)o->robots)),
            rows = (o->robots + columns - 1) / columns;
    double tile = o->tile * (1 - o->overlap), margin = o->tile / 2, half[2] = {tile / 2, tile / 2};
    char fault[256] = "no memory";
    sim_arena *arena;
    int ok;

    memset(parts, 0, sizeof *parts);
    parts->resolution = o->resolution;
    options.seed = o->seed;
    options.scene = sim_scene_find(o->scene);
    options.turn = 0;
    options.width = fmax(columns * tile, 12);
    options.height = fmax(rows * tile, 10);
    if (o->pair) {
        options.width = 20;
        options.height = 16;
        columns = 2;
        rows = 1;
        half[0] = tile = 10;
        half[0] /= 2;
        half[1] = 8.5;
        margin = 10;
    }
    arena = sim_arena_create(&options, fault, sizeof fault);
    parts->list = calloc((size_t)o->robots, sizeof *parts->list);
    ok = arena != NULL && parts->list != NULL;
    if (!ok)
        fprintf(stderr, "parts: %s\n", fault);
    for (int32_t i = 0; ok && i < o->robots; i++) {
        int32_t row = i / columns;
        sim_point middle = {(i % columns - (columns - 1) / 2.0) * tile,
                            (row - (rows - 1) / 2.0) * tile};

        parts->count++;
        ok = make_part(arena, o, i, middle, half, o->pair ? margin : o->tile * o->overlap,
                       &parts->list[i]);
    }
    sim_arena_free(arena);
    if (ok)
        set_overlap(parts, o->overlap, margin);
    return ok;
}

void bench_parts_free(bench_parts *parts)
{
    for (int32_t i = 0; i < parts->count; i++) {
        free(parts->list[i].cells);
        free(parts->list[i].seen);
        free(parts->list[i].place[0]);
        free(parts->list[i].place[1]);
    }
    free(parts->list);
}

void bench_part_mirror(bench_part *part)
{
    for (int32_t y = 0; y < part->side; y++)
        for (int32_t x = 0; x < part->side / 2; x++) {
            uint8_t *a = &part->cells[y * part->side + x],
                    *b = &part->cells[y * part->side + part->side - 1 - x], c = *a;

            *a = *b;
            *b = c;
        }
}

cairn_map_merge_map bench_part_map(const bench_part *part, double resolution)
{
    cairn_map_merge_map map;

    map.cells.data = part->cells;
    map.cells.width = map.cells.height = part->side;
    map.cells.stride = part->side;
    map.resolution = (cairn_real)resolution;
    map.origin.x = map.origin.y = -(cairn_real)(part->side * resolution / 2);
    map.origin.theta = 0;
    return map;
}

int bench_parts_merge(cairn_map_merge *merge, const bench_parts *parts, const bench_part *other,
                      const int32_t *order)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status = CAIRN_OK;

    cairn_map_merge_clear(merge);
    for (int32_t i = 0; i < parts->count + (other != NULL) && status == CAIRN_OK; i++) {
        cairn_map_merge_map map =
            bench_part_map(i < parts->count ? &parts->list[i] : other, parts->resolution);

        status = cairn_map_merge_add(merge, &map, NULL);
    }
    if (status == CAIRN_OK)
        status = cairn_map_merge_begin(merge, 0, order);
    while (status == CAIRN_OK || status == CAIRN_MORE) {
        status = cairn_map_merge_step(merge, &budget);
        if (status != CAIRN_MORE)
            break;
        budget.left = CAIRN_UNBOUNDED;
    }
    if (status != CAIRN_OK)
        fprintf(stderr, "merge: %s\n", cairn_status_text(status));
    return status == CAIRN_OK;
}
