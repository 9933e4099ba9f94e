/* bench/virtual: what virtual scans are worth (chapter 8).
 *
 * rooms: four rooms on a hallway, turned at random, five places, poses off by up to 25 units of 0.03 m and 15 degrees. A seed
 * is right when every scan lies within 4 units and 1 degree after the best common motion. rubble and round: the arenas of
 * bench/align, and those without a straight wall; shares as there. rescue110: the first, seen by scans of 110 degrees. halls: the
 * rooms, whose hallway is 12 m long, by scans of half a circle; rooms far off: by full ones from starts 1 m and 20 degrees off. Each with
 * hypotheses and without, on the same starts. Without: what the aligner alone finds; gradient: algorithm 2 as written; field without:
 * the aligner, its field, and parts that slide, but no hypotheses. wall_rms_m: of the hits on walls that lie in one line about their common line.
 *
 * box: a flat box in a room, two scans of 110 degrees that face it from either side, with no long side and no wall across
 * in common: how far apart the sides are only the starts tell, and the sides attract each other. It has collapsed when these end
 * up nearer to each other than half its thickness. Starts are off by 0.1 m and 5 degrees, and, far off, by 0.3 m and 15 degrees.
 *
 * planted: rooms, by the field alone, with a false rectangle among the hypotheses of step 5. How many of the seeds it is still
 * believed in at step 15, and how many come out worse for it.
 *
 * detector: scenes of rectangles turned at random, of whose outline 60 % is seen in pieces with noise, among single pieces of
 * walls; a rectangle is found when all its corners are within 0.3 m. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "bench/bench_align.h"
#include "bench/bench_bound.h"
#include "bench/bench_guess.h"
#include "bench/bench_json.h"
#include "bench/bench_rectangles.h"
#include "bench/bench_score.h"
#include "cairn/random.h"
#include "cairn/virtual_align.h"
#include "tools/options.h"

#define DEGREE 0.017453292519943295
#define UNIT   0.03 /* m */

enum { ROOM_STEPS = 30 /* fig. 8.10 */ };

typedef struct settings {
    int64_t seeds, seed, arenas, halls, scenes, boxes, lies;
    int32_t steps, as_written; /* --steps: prints every virtual scan; --as-written: algorithm 2 alone */
} settings;

/* Which field moves what the aligner leaves over. */
typedef int32_t field_kind;
enum {
    NO_FIELD,  /* the aligner alone */
    SPRINGS,   /* as virtual_align asks for it */
    AS_WRITTEN /* algorithm 2, with hypotheses or without */
};

/* One way to align. */
typedef struct method {
    const char *name;
    int32_t align, hypotheses;
    field_kind field;
    double sigma; /* m, of the field at its start */
} method;

/* What a scene is seen like. */
typedef struct scene {
    const char *name;
    sim_scene scene;
    int32_t places, headings;
    double fov, metres, degrees;
} scene;

typedef struct problem {
    sim_arena *arena;
    sim_survey *survey;
    const sim_scan *scans;
    sim_pose *truth, *start, *result;
    bench_lie *lie;   /* that is told; NULL: none */
    int32_t believed; /* it was, at step 15 or later */
    int32_t *use;
    int32_t count, observable;
} problem;

/* Sums over the seeds of a row. */
typedef struct row {
    int32_t seeds, right, scans, observable, aligned, iterations, active, moved;
    double seconds, squares, hits;
    int64_t align_units, hypothesis_units, field_units;
    size_t pool_bytes;
} row;

static void close_problem(problem *p)
{
    free(p->truth);
    free(p->start);
    free(p->result);
    free(p->use);
    sim_survey_free(p->survey);
    sim_arena_free(p->arena);
}

static void disturb(sim_pose *pose, cairn_random *random, double metres, double degrees)
{
    pose->x += (double)cairn_random_uniform(random, -1, 1) * metres;
    pose->y += (double)cairn_random_uniform(random, -1, 1) * metres;
    pose->theta += (double)cairn_random_uniform(random, -1, 1) * degrees * DEGREE;
}

static int open_problem(const scene *from, uint64_t seed, problem *p)
{
    sim_arena_options arena_options = sim_arena_default();
    sim_survey_options survey_options = sim_survey_default();
    cairn_random random = cairn_random_seed(seed, 80);
    char fault[256];

    memset(p, 0, sizeof *p);
    arena_options.seed = survey_options.seed = seed;
    arena_options.scene = from->scene;
    survey_options.places = from->places;
    survey_options.headings = from->headings;
    survey_options.fov = from->fov * DEGREE;
    p->arena = sim_arena_create(&arena_options, fault, sizeof fault);
    if (p->arena != NULL)
        p->survey = sim_survey_create(p->arena, &survey_options, fault, sizeof fault);
    if (p->survey == NULL) {
        fprintf(stderr, "bench/virtual: %s\n", fault);
        return 0;
    }
    p->scans = sim_survey_scans(p->survey, &p->count);
    p->truth = malloc((size_t)p->count * sizeof *p->truth);
    p->start = malloc((size_t)p->count * sizeof *p->start);
    p->result = malloc((size_t)p->count * sizeof *p->result);
    p->use = malloc((size_t)p->count * sizeof *p->use);
    if (p->truth == NULL || p->start == NULL || p->result == NULL || p->use == NULL)
        return 0;
    for (int32_t i = 0; i < p->count; i++) {
        p->truth[i] = p->start[i] = p->scans[i].truth;
        disturb(&p->start[i], &random, from->metres, from->degrees);
    }
    return 1;
}

/* Which scans the bound calls observable. */
static int find_observable(const scene *from, problem *p)
{
    bench_bound *bounds = malloc((size_t)p->count * sizeof *bounds);
    int done = bounds != NULL &&
               bench_bound_compute(p->arena, p->scans, p->count, from->metres, from->degrees * DEGREE, bounds) >= 0;

    for (int32_t i = 0; i < p->count && done; i++) {
        p->use[i] = bounds[i].observable;
        p->observable += p->use[i];
    }
    free(bounds);
    return done;
}

static cairn_status count_room(cairn_scan *scan, const problem *p, cairn_virtual_align_params *params)
{
    cairn_status status = CAIRN_OK;

    params->aligner.max_scans = p->count;
    params->aligner.max_segments = params->aligner.max_points = 1;
    params->aligner.max_hypotheses = 24 * p->count;
    params->aligner.max_fill = 32 * p->count;
    for (int32_t i = 0; i < p->count && status == CAIRN_OK; i++) {
        cairn_scan_view view;

        status = bench_fit_scan(scan, &p->scans[i], &view);
        params->aligner.max_segments += view.segment_count;
        params->aligner.max_points += view.point_count;
    }
    return status;
}

/* Algorithm 2 as written. Of the rooms the text gives only sigma at the start and 30 iterations; sigma at the end and dt keep the ratios to it that
 * they have in section 7.4.2 (dt is a length: its square times a force, which is one over a length), and sigma falls evenly. */
static cairn_virtual_align_params as_written(const method *m)
{
    cairn_virtual_align_params params = cairn_virtual_align_as_written();
    cairn_real scale = (cairn_real)m->sigma / params.field.sigma_start;

    if (m->sigma > 0) {
        params.field.max_steps = ROOM_STEPS;
        params.field.sigma_start *= scale;
        params.field.sigma_end *= scale;
        params.field.sigma_step = (params.field.sigma_start - params.field.sigma_end) / (ROOM_STEPS - 1);
        params.field.dt_start *= scale;
        params.field.dt_end *= scale;
    }
    params.field.potential = 0;
    return params;
}

static cairn_virtual_align_params params_of(const method *m, const problem *p)
{
    cairn_virtual_align_params params = m->field == AS_WRITTEN ? as_written(m) : cairn_virtual_align_default();

    if (m->field != AS_WRITTEN)
        params.align = m->align;
    if (p->lie != NULL)
        params.every = 5;
    if (!m->hypotheses)
        params.hypotheses.lines = params.hypotheses.rectangles = params.hypotheses.ellipses = params.slide.thickness =
            0;
    return params;
}

/* Of this thread, whatever else the machine does. */
static double processor_seconds(void)
{
    return (double)clock() / CLOCKS_PER_SEC;
}

/* alone: the aligner, and no more. */
static cairn_status align(const settings *s, problem *p, cairn_scan *scan, cairn_virtual_align *align, int32_t alone,
                          row *out)
{
    double start = processor_seconds();
    cairn_virtual_align_result result;
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < p->count && status == CAIRN_OK; i++) {
        cairn_pose pose = {(cairn_real)p->start[i].x, (cairn_real)p->start[i].y, (cairn_real)p->start[i].theta};
        cairn_scan_view view;

        status = bench_fit_scan(scan, &p->scans[i], &view);
        if (status == CAIRN_OK)
            status = cairn_virtual_align_add_scan(align, &view, pose, NULL);
    }
    if (status == CAIRN_OK)
        status = cairn_virtual_align_begin(align);
    while (status >= 0 && cairn_virtual_align_running(align)) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status = cairn_virtual_align_iterate(align, &budget);
        if (alone)
            break;
        if (s->steps)
            bench_guess_print(cairn_virtual_align_hypotheses(align), cairn_virtual_align_read(align).iterations);
        if (p->lie != NULL && cairn_virtual_align_read(align).iterations >= 15)
            p->believed |= bench_lie_is_believed(p->lie, cairn_virtual_align_hypotheses(align));
    }
    result = cairn_virtual_align_read(align);
    out->seconds += processor_seconds() - start;
    out->iterations += result.iterations;
    out->active += result.active;
    out->moved += result.moved;
    out->align_units += result.align_units;
    out->hypothesis_units += result.hypothesis_units;
    out->field_units += result.field_units;
    for (int32_t i = 0; i < p->count && status >= 0; i++) {
        cairn_pose pose = cairn_virtual_align_pose_of(align, i).aligned.map_scan;

        p->result[i].x = (double)pose.x;
        p->result[i].y = (double)pose.y;
        p->result[i].theta = (double)pose.theta;
    }
    return status < 0 ? status : CAIRN_OK;
}

static int run(const settings *s, problem *p, const method *m, row *out)
{
    cairn_scan_params scan_params = cairn_scan_default();
    cairn_virtual_align_params params = params_of(m, p);
    cairn_virtual_align *aligned = NULL;
    cairn_scan *scan = NULL;
    cairn_pool pool, scan_pool;
    cairn_status status;
    size_t bytes = 0;
    void *memory = NULL, *scan_memory;

    scan_params.max_beams = p->scans[0].count;
    scan_memory = malloc(cairn_scan_memory(&scan_params) + CAIRN_ALIGN);
    status = scan_memory == NULL
                 ? CAIRN_NO_MEMORY
                 : cairn_pool_init(&scan_pool, scan_memory, cairn_scan_memory(&scan_params) + CAIRN_ALIGN);
    if (status == CAIRN_OK)
        status = cairn_scan_create(&scan, &scan_pool, &scan_params);
    if (status == CAIRN_OK)
        status = count_room(scan, p, &params);
    if (status == CAIRN_OK) {
        bytes = cairn_virtual_align_memory(&params) + CAIRN_ALIGN;
        memory = malloc(bytes);
        status = memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(&pool, memory, bytes);
    }
    if (status == CAIRN_OK)
        status = cairn_virtual_align_create(&aligned, &pool, &params);
    if (status == CAIRN_OK && p->lie != NULL) {
        cairn_hypothesis_detector detector = bench_lie_detector(p->lie);

        status = cairn_virtual_align_add_detector(aligned, &detector);
    }
    if (status == CAIRN_OK)
        status = align(s, p, scan, aligned, m->field == NO_FIELD, out);
    if (bytes > out->pool_bytes)
        out->pool_bytes = bytes;
    if (status != CAIRN_OK)
        fprintf(stderr, "bench/virtual: %s\n", cairn_status_text(status));
    free(memory);
    free(scan_memory);
    return status == CAIRN_OK;
}

/* Scans of the result that lie right. */
static int32_t score(const problem *p, double metres)
{
    return bench_fit_common(p->truth, p->result, p->use, p->count, metres, DEGREE, p->result);
}

static void print_row(const scene *from, const method *m, const row *r)
{
    bench_json_begin("virtual");
    bench_json_text("scene", from->name);
    bench_json_text("method", m->name);
    bench_json_number("sigma_units", m->sigma / UNIT);
    bench_json_integer("seeds", r->seeds);
    bench_json_number("right", (double)r->right / r->seeds);
    bench_json_number("share", (double)r->aligned / r->observable);
    bench_json_number("moved", (double)r->moved / r->scans);
    bench_json_number("active", r->iterations > 0 ? (double)r->active / r->iterations : (double)NAN);
    bench_json_number("wall_rms_m", sqrt(r->squares / r->hits));
    bench_json_number("processor_seconds_mean", r->seconds / r->seeds);
    bench_json_number("hypothesis_units_over_align", (double)r->hypothesis_units / (double)r->align_units);
    bench_json_integer("pool_bytes", (int64_t)r->pool_bytes);
    bench_json_end();
}

/* Processor time of the first of two methods beyond that of the second, over that. */
static double cost_ratio(const row *rows)
{
    return (rows[0].seconds - rows[1].seconds) / rows[1].seconds;
}

/* Each method on the same starts; rows: [count]. */
static int run_scene(const settings *s, const scene *from, int64_t seeds, const method *methods, int32_t count,
                     double metres, row *rows)
{
    memset(rows, 0, (size_t)count * sizeof *rows);
    for (int64_t i = 0; i < seeds; i++) {
        problem p;
        int done = open_problem(from, (uint64_t)(s->seed + i), &p) && find_observable(from, &p);

        for (int32_t k = 0; k < count && done; k++) {
            int32_t right;

            done = run(s, &p, &methods[k], &rows[k]);
            if (done)
                bench_guess_straightness(p.arena, p.scans, p.result, p.count, &rows[k].squares, &rows[k].hits);
            right = done ? score(&p, metres) : 0;
            rows[k].seeds++;
            rows[k].right += right == p.observable;
            rows[k].scans += p.count;
            rows[k].observable += p.observable;
            rows[k].aligned += right;
        }
        close_problem(&p);
        if (!done)
            return 0;
    }
    for (int32_t k = 0; k < count; k++)
        print_row(from, &methods[k], &rows[k]);
    return 1;
}

/* What algorithm 2 reaches in rooms: with hypotheses, without, without from another sigma. */
static void print_gradient(const row rows[3])
{
    static const char *const keys[] = {"gradient_with", "without30", "without80"};

    for (int k = 0; k < 3; k++) {
        char name[64];

        snprintf(name, sizeof name, "%s_ok", keys[k]);
        bench_json_number(name, (double)rows[k].right / rows[k].seeds);
        snprintf(name, sizeof name, "%s_share", keys[k]);
        bench_json_number(name, (double)rows[k].aligned / rows[k].observable);
    }
}

/* ---- A box, and a lie ---- */

/* Each method on the same starts; how many boxes it has collapsed. of_last: [2] those of the last two methods; NULL: not wanted. */
static int run_boxes(const settings *s, const char *name, double metres, double degrees, int32_t *of_last)
{
    static const method methods[] = {
        {"default with hypotheses", 1, 1, SPRINGS, 30 * UNIT},     {"default without", 1, 0, NO_FIELD, 30 * UNIT},
        {"springs with hypotheses", 0, 1, SPRINGS, 30 * UNIT},     {"springs without", 0, 0, SPRINGS, 30 * UNIT},
        {"gradient with hypotheses", 0, 1, AS_WRITTEN, 30 * UNIT}, {"gradient without", 0, 0, AS_WRITTEN, 30 * UNIT}};

    for (size_t k = s->as_written ? 4 : 0; k < sizeof methods / sizeof *methods; k++) {
        int32_t collapsed = 0;
        double off = 0, thinnest = (double)INFINITY;

        for (int64_t i = 0; i < s->boxes; i++) {
            static bench_box box;
            sim_pose truth[BENCH_BOX_SCANS], start[BENCH_BOX_SCANS], result[BENCH_BOX_SCANS];
            cairn_random random = cairn_random_seed((uint64_t)(s->seed + i), 84);
            problem p;
            row out;
            double thickness;

            memset(&p, 0, sizeof p);
            memset(&out, 0, sizeof out);
            bench_box_draw(&box, (uint64_t)(s->seed + i));
            p.scans = box.scans;
            p.count = BENCH_BOX_SCANS;
            p.truth = truth;
            p.start = start;
            p.result = result;
            for (int32_t j = 0; j < BENCH_BOX_SCANS; j++) {
                truth[j] = start[j] = box.scans[j].truth;
                disturb(&start[j], &random, metres, degrees);
            }
            if (!run(s, &p, &methods[k], &out))
                return 0;
            thickness = bench_box_thickness(&box, result);
            collapsed += !(thickness > box.thickness / 2);
            off += fabs(thickness - box.thickness);
            thinnest = fmin(thinnest, thickness);
        }
        if (of_last != NULL && k + 2 >= sizeof methods / sizeof *methods)
            of_last[k + 2 - sizeof methods / sizeof *methods] = collapsed;
        bench_json_begin("virtual");
        bench_json_text("scene", name);
        bench_json_text("method", methods[k].name);
        bench_json_integer("seeds", s->boxes);
        bench_json_integer("collapsed", collapsed);
        bench_json_number("thickness_off_mean_m", off / (double)s->boxes);
        bench_json_number("thinnest_m", thinnest);
        bench_json_end();
    }
    return 1;
}

static int run_lies(const settings *s, const scene *rooms)
{
    static const method springs = {"springs with hypotheses", 0, 1, SPRINGS, 30 * UNIT};
    int32_t believed = 0, right[2] = {0, 0};

    for (int64_t i = 0; i < s->lies; i++)
        for (int told = 0; told < 2; told++) {
            problem p;
            bench_lie lie;
            row out;
            int done = open_problem(rooms, (uint64_t)(s->seed + i), &p) && find_observable(rooms, &p);

            memset(&out, 0, sizeof out);
            if (done) {
                lie = bench_lie_draw(p.start, p.count, (uint64_t)(s->seed + i));
                p.lie = told ? &lie : NULL;
                done = run(s, &p, &springs, &out);
            }
            if (done)
                right[told] += score(&p, 4 * UNIT);
            believed += p.believed;
            close_problem(&p);
            if (!done)
                return 0;
        }
    bench_json_begin("virtual");
    bench_json_text("scene", "planted");
    bench_json_integer("seeds", s->lies);
    bench_json_integer("believed_at_15", believed);
    bench_json_integer("right_scans_without_it", right[0]);
    bench_json_integer("right_scans_with_it", right[1]);
    bench_json_end();
    return 1;
}

/* ---- The detectors alone ---- */

typedef int (*detector)(uint64_t seed, int32_t *there, int32_t *found, int32_t *wrong);

static int run_detector(const settings *s, const char *name, detector find)
{
    int32_t there = 0, found = 0, wrong = 0;

    for (int64_t i = 0; i < s->scenes; i++)
        if (!find((uint64_t)(s->seed + i), &there, &found, &wrong)) {
            fprintf(stderr, "bench/virtual: no memory\n");
            return 0;
        }
    bench_json_begin("virtual");
    bench_json_text("scene", name);
    bench_json_integer("seeds", s->scenes);
    bench_json_number("found", (double)found / there);
    bench_json_number("false_per_scene", (double)wrong / (double)s->scenes);
    bench_json_end();
    return 1;
}

/* Rooms, arenas and boxes by algorithm 2; methods: with hypotheses, without, without from another sigma. */
static int run_as_written(const settings *s, const scene *rooms, const scene *rubble, const method *methods)
{
    static const method in_rubble[] = {{"gradient with hypotheses", 0, 1, AS_WRITTEN, 0},
                                       {"gradient without", 0, 0, AS_WRITTEN, 0}};
    row of_rooms[3] = {{0}}, of_rubble[2] = {{0}};
    int32_t collapsed[2] = {0};

    if ((s->boxes > 0 && (!run_boxes(s, "box", 0.1, 5, collapsed) || !run_boxes(s, "box far off", 0.3, 15, NULL))) ||
        (s->seeds > 0 && !run_scene(s, rooms, s->seeds, methods, 3, 4 * UNIT, of_rooms)) ||
        (s->arenas > 0 && !run_scene(s, rubble, s->arenas, in_rubble, 2, 0.05, of_rubble)))
        return 0;
    bench_json_begin("virtual");
    bench_json_true("summary");
    bench_json_true("as_written");
    print_gradient(of_rooms);
    bench_json_number("rubble_share_with", (double)of_rubble[0].aligned / of_rubble[0].observable);
    bench_json_number("rubble_share_without", (double)of_rubble[1].aligned / of_rubble[1].observable);
    bench_json_number("rubble_rms_with_m", sqrt(of_rubble[0].squares / of_rubble[0].hits));
    bench_json_number("rubble_rms_without_m", sqrt(of_rubble[1].squares / of_rubble[1].hits));
    bench_json_integer("boxes_collapsed_with", collapsed[0]);
    bench_json_integer("boxes_collapsed_without", collapsed[1]);
    bench_json_integer("boxes", s->boxes);
    bench_json_end();
    return 1;
}

int main(int argc, char **argv)
{
    static const scene rooms = {"rooms", SIM_ROOMS, 5, 1, 360, 25 * UNIT, 15};
    static const scene rubble = {"rubble", SIM_RESCUE, 15, 4, 100, 0.3, 20};
    static const scene narrow = {"rescue110", SIM_RESCUE, 15, 4, 110, 0.3, 20};
    static const scene curved = {"round", SIM_ROUND, 15, 4, 100, 0.3, 20};
    static const scene halls = {"halls", SIM_ROOMS, 6, 2, 180, 0.5, 20};
    static const scene far_off = {"rooms far off", SIM_ROOMS, 5, 1, 360, 1, 20};
    static const method rooms_methods[] = {
        {"default with hypotheses", 1, 1, SPRINGS, 30 * UNIT},     {"default without", 1, 0, NO_FIELD, 30 * UNIT},
        {"gradient with hypotheses", 0, 1, AS_WRITTEN, 30 * UNIT}, {"gradient without", 0, 0, AS_WRITTEN, 30 * UNIT},
        {"gradient without", 0, 0, AS_WRITTEN, 80 * UNIT},
    };
    static const method long_methods[] = {{"default with hypotheses", 1, 1, SPRINGS, 30 * UNIT},
                                          {"default without", 1, 0, NO_FIELD, 30 * UNIT},
                                          {"default, field without hypotheses", 1, 0, SPRINGS, 30 * UNIT}};
    settings s = {100, 1, 20, 100, 200, 20, 20, 0, 0};
    const option table[] = {
        OPTION_INTEGER("--seeds", &s.seeds, 0, 1000, "N", "rooms to align"),
        OPTION_INTEGER("--arenas", &s.arenas, 0, 1000, "N", "arenas with rubble, and with round walls, to align"),
        OPTION_INTEGER("--halls", &s.halls, 0, 1000, "N", "halls, and rooms far off, to align"),
        OPTION_INTEGER("--scenes", &s.scenes, 0, 100000, "N", "scenes for the detectors alone"),
        OPTION_INTEGER("--boxes", &s.boxes, 0, 1000, "N", "boxes seen from two sides"),
        OPTION_INTEGER("--lies", &s.lies, 0, 1000, "N", "rooms with a false hypothesis"),
        OPTION_INTEGER("--seed", &s.seed, 0, 1000000000, "N", "first seed"),
        OPTION_FLAG("--as-written", &s.as_written,
                    "algorithm 2 as written alone, with hypotheses and without: rooms, boxes, arenas"),
        OPTION_FLAG("--steps", &s.steps, "print the hypotheses of every step"),
    };
    const option_set set = {"bench/virtual", "[options]", "Measures what virtual scans are worth.", table,
                            sizeof table / sizeof *table};
    row in_rooms[5] = {{0}}, in_rubble[3] = {{0}}, in_narrow[2] = {{0}}, in_round[2] = {{0}}, in_halls[3] = {{0}},
        in_far[3] = {{0}};
    size_t none = 0;
    option_result result = options_read(&set, argc, argv, NULL, &none);

    if (result != OPTIONS_READ)
        return (int)result;
    if (s.as_written)
        return !run_as_written(&s, &rooms, &rubble, rooms_methods + 2);
    if (s.scenes > 0 && (!run_detector(&s, "detector of rectangles", bench_rectangles_find) ||
                         !run_detector(&s, "detector of ellipses", bench_guess_ellipses)))
        return 1;
    if ((s.boxes > 0 && (!run_boxes(&s, "box", 0.1, 5, NULL) || !run_boxes(&s, "box far off", 0.3, 15, NULL))) ||
        (s.lies > 0 && !run_lies(&s, &rooms)))
        return 1;
    if (s.seeds > 0 && !run_scene(&s, &rooms, s.seeds, rooms_methods, 5, 4 * UNIT, in_rooms))
        return 1;
    if (s.halls > 0 && (!run_scene(&s, &halls, s.halls, long_methods, 3, 0.05, in_halls) ||
                        !run_scene(&s, &far_off, s.halls, long_methods, 3, 0.05, in_far)))
        return 1;
    if (s.arenas > 0 && (!run_scene(&s, &rubble, s.arenas, long_methods, 3, 0.05, in_rubble) ||
                         !run_scene(&s, &narrow, s.arenas, rooms_methods, 2, 0.05, in_narrow) ||
                         !run_scene(&s, &curved, s.arenas, rooms_methods, 2, 0.05, in_round)))
        return 1;
    bench_json_begin("virtual");
    bench_json_true("summary");
    bench_json_number("with_ok", (double)in_rooms[0].right / in_rooms[0].seeds);
    bench_json_number("default_without_ok", (double)in_rooms[1].right / in_rooms[1].seeds);
    print_gradient(in_rooms + 2);
    bench_json_number("rubble_share_with", (double)in_rubble[0].aligned / in_rubble[0].observable);
    bench_json_number("rubble_share_without", (double)in_rubble[1].aligned / in_rubble[1].observable);
    bench_json_number("halls_share_with", (double)in_halls[0].aligned / in_halls[0].observable);
    bench_json_number("halls_share_without", (double)in_halls[1].aligned / in_halls[1].observable);
    bench_json_number("far_off_share_with", (double)in_far[0].aligned / in_far[0].observable);
    bench_json_number("far_off_share_without", (double)in_far[1].aligned / in_far[1].observable);
    bench_json_number("round_share_with", (double)in_round[0].aligned / in_round[0].observable);
    bench_json_number("round_share_without", (double)in_round[1].aligned / in_round[1].observable);
    bench_json_number("rescue110_rms_with_m", sqrt(in_narrow[0].squares / in_narrow[0].hits));
    bench_json_number("rescue110_rms_without_m", sqrt(in_narrow[1].squares / in_narrow[1].hits));
    bench_json_number("active", (double)(in_rooms[0].active + in_rooms[2].active + in_rubble[0].active) /
                                    (in_rooms[0].iterations + in_rooms[2].iterations + in_rubble[0].iterations));
    bench_json_number("rooms_active", (double)in_rooms[0].active / in_rooms[0].iterations);
    bench_json_number("rubble_active", (double)in_rubble[0].active / in_rubble[0].iterations);
    bench_json_integer("rubble_iterations", in_rubble[0].iterations);
    bench_json_number("cost_ratio", cost_ratio(in_rubble));
    bench_json_number("rooms_cost_ratio", cost_ratio(in_rooms));
    bench_json_number("halls_cost_ratio", cost_ratio(in_halls));
    bench_json_number("far_off_cost_ratio", cost_ratio(in_far));
    bench_json_number("rescue110_cost_ratio", cost_ratio(in_narrow));
    bench_json_number("round_cost_ratio", cost_ratio(in_round));
    bench_json_end();
    return 0;
}
