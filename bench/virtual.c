/* bench/virtual: evaluation of virtual scans (chapter 8).
 *
 * rooms: four rooms on a hallway, rotated randomly, five places, pose errors of up to 25 units of
 * 0.03 m and 15 degrees. A seed is right when every scan lies within 4 units and 1 degree after the
 * best rigid alignment. rubble and round: the arenas of bench/align, and those without a straight
 * wall; shares as there. rescue110: the first arena with scans of 110 degrees. halls: the rooms
 * with a hallway 12 m long, by scans of half a circle. rooms far off: by full scans from starts 1 m
 * and 20 degrees off. Each with hypotheses and without, on the same starts. Without: the aligner
 * alone; gradient: algorithm 2 as written; field without: the aligner, its field and the
 * translation of components along walls, but no hypotheses. wall_rms_m: RMS distance of the hits on
 * collinear walls from their common line.
 *
 * box: a flat box in a room, and two scans of 110 degrees that face it from opposite sides, without
 * a long side or a transverse wall in common. Only the initial poses determine the distance of the
 * sides, and the sides attract each other. The box has collapsed when they end up nearer to each
 * other than half its thickness. Starts are off by 0.1 m and 5 degrees, and, far off, by 0.3 m and
 * 15 degrees.
 *
 * planted: rooms, by the field alone (springs, or algorithm 2 as written), with a false rectangle
 * among the hypotheses of step 5. Output: in how many of the seeds it is accepted at step 15 or
 * later, and how many scans are right with it and without.
 *
 * detector: scenes of rectangles rotated at random, with 60 % of their outlines visible as noisy
 * segments among isolated segments of walls. A rectangle is found when all its corners are within
 * 0.3 m. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_rectangles.h"
#include "bench/bench_virtual.h"
#include "cairn/random.h"
#include "tools/options.h"

enum { PLANTED_STEP = 5 }; /* where the false one is among the hypotheses */

typedef struct settings {
    int64_t seeds, seed, arenas, halls, scenes, boxes, lies;
    /* --steps: prints every virtual scan; --as-written: algorithm 2 alone */
    int32_t steps, as_written;
} settings;

static void print_row(const bench_virtual_scene *from, const bench_virtual_method *m,
                      const bench_virtual_row *r)
{
    bench_json_begin("virtual");
    bench_json_text("scene", from->name);
    bench_json_text("method", m->name);
    bench_json_number("sigma_units", m->sigma / BENCH_VIRTUAL_UNIT);
    bench_json_integer("seeds", r->seeds);
    bench_json_number("right", (double)r->right / r->seeds);
    bench_json_number("share", (double)r->aligned / r->observable);
    bench_json_number("moved", (double)r->moved / r->scans);
    bench_json_number("active",
                      r->iterations > 0 ? (double)r->active / r->iterations : (double)NAN);
    bench_json_number("wall_rms_m", sqrt(r->squares / r->hits));
    bench_json_number("processor_seconds_mean", r->seconds / r->seeds);
    bench_json_number("hypothesis_units_over_align",
                      (double)r->hypothesis_units / (double)r->align_units);
    bench_json_integer("pool_bytes", (int64_t)r->pool_bytes);
    bench_json_end();
}

/* Relative processor time of the first of two methods above that of the second. */
static double cost_ratio(const bench_virtual_row *rows)
{
    return (rows[0].seconds - rows[1].seconds) / rows[1].seconds;
}

/* Each method on the same starts; rows: [count]. */
static int run_scene(const settings *s, const bench_virtual_scene *from, int64_t seeds,
                     const bench_virtual_method *methods, int32_t count, double metres,
                     bench_virtual_row *rows)
{
    memset(rows, 0, (size_t)count * sizeof *rows);
    for (int64_t i = 0; i < seeds; i++) {
        bench_virtual_problem p;
        int done = bench_virtual_open(from, (uint64_t)(s->seed + i), &p);

        for (int32_t k = 0; k < count && done; k++) {
            int32_t right;

            done = bench_virtual_run(&p, &methods[k], s->steps, &rows[k]);
            if (done)
                bench_guess_straightness(p.arena, p.scans, p.result, p.count, &rows[k].squares,
                                         &rows[k].hits);
            right = done ? bench_virtual_score(&p, metres) : 0;
            rows[k].seeds++;
            rows[k].right += right == p.observable;
            rows[k].scans += p.count;
            rows[k].observable += p.observable;
            rows[k].aligned += right;
        }
        bench_virtual_close(&p);
        if (!done)
            return 0;
    }
    for (int32_t k = 0; k < count; k++)
        print_row(from, &methods[k], &rows[k]);
    return 1;
}

/* Evaluates algorithm 2 in scene rooms: with hypotheses, without, and without from another
 * sigma. */
static void print_gradient(const bench_virtual_row rows[3])
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

/* ---- A box, and a false hypothesis ---- */

/* Each method on the same starts; counts collapsed boxes. of_first: [2] those of the first two
 * methods, as written of the gradient, else of the default; NULL: not wanted. */
static int run_boxes(const settings *s, const char *name, double metres, double degrees,
                     int32_t *of_first)
{
    static const bench_virtual_method methods[] = {
        {"default with hypotheses", 1, 1, BENCH_SPRINGS, 30 * BENCH_VIRTUAL_UNIT},
        {"default without", 1, 0, BENCH_NO_FIELD, 30 * BENCH_VIRTUAL_UNIT},
        {"springs with hypotheses", 0, 1, BENCH_SPRINGS, 30 * BENCH_VIRTUAL_UNIT},
        {"springs without", 0, 0, BENCH_SPRINGS, 30 * BENCH_VIRTUAL_UNIT},
        {"gradient with hypotheses", 0, 1, BENCH_FIELD_AS_WRITTEN, 30 * BENCH_VIRTUAL_UNIT},
        {"gradient without", 0, 0, BENCH_FIELD_AS_WRITTEN, 30 * BENCH_VIRTUAL_UNIT}};

    const size_t first = s->as_written ? 4 : 0;

    for (size_t k = first; k < sizeof methods / sizeof *methods; k++) {
        int32_t collapsed = 0;
        double off = 0, thinnest = (double)INFINITY;

        for (int64_t i = 0; i < s->boxes; i++) {
            static bench_box box;
            sim_pose truth[BENCH_BOX_SCANS], start[BENCH_BOX_SCANS], result[BENCH_BOX_SCANS];
            cairn_random random = cairn_random_seed((uint64_t)(s->seed + i), 84);
            bench_virtual_problem p;
            bench_virtual_row out;
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
                bench_virtual_disturb(&start[j], &random, metres, degrees);
            }
            if (!bench_virtual_run(&p, &methods[k], s->steps, &out))
                return 0;
            thickness = bench_box_thickness(&box, result);
            collapsed += !(thickness > box.thickness / 2);
            off += fabs(thickness - box.thickness);
            thinnest = fmin(thinnest, thickness);
        }
        if (of_first != NULL && k < first + 2)
            of_first[k - first] = collapsed;
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

/* Evaluates scene rooms with a false hypothesis. */
typedef struct planted_counts {
    int32_t scans, accepted, right_with, right_without;
} planted_counts;

static int run_planted(const settings *s, const bench_virtual_scene *rooms, planted_counts *of)
{
    static const bench_virtual_method methods[] = {
        {"springs with hypotheses", 0, 1, BENCH_SPRINGS, 30 * BENCH_VIRTUAL_UNIT},
        {"gradient with hypotheses", 0, 1, BENCH_FIELD_AS_WRITTEN, 30 * BENCH_VIRTUAL_UNIT}};

    for (int64_t i = 0; i < s->lies; i++)
        for (int planted = 0; planted < 2; planted++) {
            bench_virtual_problem p;
            bench_virtual_row out;
            bench_false_rectangle lie;
            int done = bench_virtual_open(rooms, (uint64_t)(s->seed + i), &p);

            memset(&out, 0, sizeof out);
            if (done) {
                lie = bench_false_rectangle_draw(p.start, p.count, (uint64_t)(s->seed + i));
                if (s->as_written) { /* V is computed anew in every iteration */
                    lie.when = PLANTED_STEP - 1;
                    lie.spacing = (double)cairn_virtual_align_as_written().hypotheses.spacing;
                }
                p.lie = planted ? &lie : NULL;
                done = bench_virtual_run(&p, &methods[s->as_written], s->steps, &out);
            }
            if (done) {
                *(planted ? &of->right_with : &of->right_without) +=
                    bench_virtual_score(&p, 4 * BENCH_VIRTUAL_UNIT);
                of->accepted += p.accepted;
                of->scans += planted ? p.observable : 0;
            }
            bench_virtual_close(&p);
            if (!done)
                return 0;
        }
    bench_json_begin("virtual");
    bench_json_text("scene", "planted");
    bench_json_text("method", methods[s->as_written].name);
    bench_json_integer("seeds", s->lies);
    bench_json_integer("believed_at_15", of->accepted);
    bench_json_integer("right_scans_without_it", of->right_without);
    bench_json_integer("right_scans_with_it", of->right_with);
    bench_json_end();
    return 1;
}

/* Errors of walls in a line, with and without virtual scans. */
static void print_walls(const bench_virtual_row *of_rubble)
{
    bench_json_number("rubble_rms_with_m", sqrt(of_rubble[0].squares / of_rubble[0].hits));
    bench_json_number("rubble_rms_without_m", sqrt(of_rubble[1].squares / of_rubble[1].hits));
}

static void print_boxes(const settings *s, const int32_t *collapsed)
{
    bench_json_integer("boxes_collapsed_with", collapsed[0]);
    bench_json_integer("boxes_collapsed_without", collapsed[1]);
    bench_json_integer("boxes", s->boxes);
}

static void print_lies(const settings *s, const planted_counts *of)
{
    bench_json_integer("lies", s->lies);
    bench_json_integer("lies_believed_at_15", of->accepted);
    bench_json_integer("lies_scans", of->scans);
    bench_json_integer("lies_right_scans_with", of->right_with);
    bench_json_integer("lies_right_scans_without", of->right_without);
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

/* Rooms, false hypotheses, arenas and boxes by algorithm 2; methods: with hypotheses, without,
 * without from another sigma. */
static int run_as_written(const settings *s, const bench_virtual_scene *rooms,
                          const bench_virtual_scene *rubble, const bench_virtual_method *methods)
{
    static const bench_virtual_method in_rubble[] = {
        {"gradient with hypotheses", 0, 1, BENCH_FIELD_AS_WRITTEN, 0},
        {"gradient without", 0, 0, BENCH_FIELD_AS_WRITTEN, 0}};
    bench_virtual_row of_rooms[3] = {{0}}, of_rubble[2] = {{0}};
    int32_t collapsed[2] = {0};
    planted_counts of_planted = {0};

    if ((s->boxes > 0 && (!run_boxes(s, "box", 0.1, 5, collapsed) ||
                          !run_boxes(s, "box far off", 0.3, 15, NULL))) ||
        (s->lies > 0 && !run_planted(s, rooms, &of_planted)) ||
        (s->seeds > 0 &&
         !run_scene(s, rooms, s->seeds, methods, 3, 4 * BENCH_VIRTUAL_UNIT, of_rooms)) ||
        (s->arenas > 0 && !run_scene(s, rubble, s->arenas, in_rubble, 2, 0.05, of_rubble)))
        return 0;
    bench_json_begin("virtual");
    bench_json_true("summary");
    bench_json_true("as_written");
    print_gradient(of_rooms);
    bench_json_number("rubble_share_with", (double)of_rubble[0].aligned / of_rubble[0].observable);
    bench_json_number("rubble_share_without",
                      (double)of_rubble[1].aligned / of_rubble[1].observable);
    print_walls(of_rubble);
    print_boxes(s, collapsed);
    print_lies(s, &of_planted);
    bench_json_end();
    return 1;
}

int main(int argc, char **argv)
{
    static const bench_virtual_scene rooms = {
        "rooms", SIM_ROOMS, 5, 1, 360, 25 * BENCH_VIRTUAL_UNIT, 15};
    static const bench_virtual_scene rubble = {"rubble", SIM_RESCUE, 15, 4, 100, 0.3, 20};
    static const bench_virtual_scene narrow = {"rescue110", SIM_RESCUE, 15, 4, 110, 0.3, 20};
    static const bench_virtual_scene curved = {"round", SIM_ROUND, 15, 4, 100, 0.3, 20};
    static const bench_virtual_scene halls = {"halls", SIM_ROOMS, 6, 2, 180, 0.5, 20};
    static const bench_virtual_scene far_off = {"rooms far off", SIM_ROOMS, 5, 1, 360, 1, 20};
    static const bench_virtual_method rooms_methods[] = {
        {"default with hypotheses", 1, 1, BENCH_SPRINGS, 30 * BENCH_VIRTUAL_UNIT},
        {"default without", 1, 0, BENCH_NO_FIELD, 30 * BENCH_VIRTUAL_UNIT},
        {"gradient with hypotheses", 0, 1, BENCH_FIELD_AS_WRITTEN, 30 * BENCH_VIRTUAL_UNIT},
        {"gradient without", 0, 0, BENCH_FIELD_AS_WRITTEN, 30 * BENCH_VIRTUAL_UNIT},
        {"gradient without", 0, 0, BENCH_FIELD_AS_WRITTEN, 80 * BENCH_VIRTUAL_UNIT},
    };
    static const bench_virtual_method long_methods[] = {
        {"default with hypotheses", 1, 1, BENCH_SPRINGS, 30 * BENCH_VIRTUAL_UNIT},
        {"default without", 1, 0, BENCH_NO_FIELD, 30 * BENCH_VIRTUAL_UNIT},
        {"default, field without hypotheses", 1, 0, BENCH_SPRINGS, 30 * BENCH_VIRTUAL_UNIT}};
    settings s = {100, 1, 20, 100, 200, 20, 20, 0, 0};
    const option table[] = {
        OPTION_INTEGER("--seeds", &s.seeds, 0, 1000, "N", "rooms to align"),
        OPTION_INTEGER("--arenas", &s.arenas, 0, 1000, "N",
                       "arenas with rubble, and with round walls, to align"),
        OPTION_INTEGER("--halls", &s.halls, 0, 1000, "N", "halls, and rooms far off, to align"),
        OPTION_INTEGER("--scenes", &s.scenes, 0, 100000, "N", "scenes for the detectors alone"),
        OPTION_INTEGER("--boxes", &s.boxes, 0, 1000, "N", "boxes seen from two sides"),
        OPTION_INTEGER("--lies", &s.lies, 0, 1000, "N", "rooms with a false hypothesis"),
        OPTION_INTEGER("--seed", &s.seed, 0, 1000000000, "N", "first seed"),
        OPTION_FLAG("--as-written", &s.as_written,
                    "algorithm 2 as written alone, with hypotheses and without: rooms, boxes, "
                    "lies, arenas"),
        OPTION_FLAG("--steps", &s.steps, "print the hypotheses of every step"),
    };
    const option_set set = {"bench/virtual", "[options]",
                            "Measures the accuracy of alignment with virtual scans.", table,
                            sizeof table / sizeof *table};
    bench_virtual_row in_rooms[5] = {{0}}, in_rubble[3] = {{0}}, in_narrow[2] = {{0}},
                      in_round[2] = {{0}}, in_halls[3] = {{0}}, in_far[3] = {{0}};
    planted_counts of_planted = {0};
    int32_t collapsed[2] = {0};
    size_t none = 0;
    option_result result = options_read(&set, argc, argv, NULL, &none);

    if (result != OPTIONS_READ)
        return (int)result;
    if (s.as_written)
        return !run_as_written(&s, &rooms, &rubble, rooms_methods + 2);
    if (s.scenes > 0 && (!run_detector(&s, "detector of rectangles", bench_rectangles_find) ||
                         !run_detector(&s, "detector of ellipses", bench_guess_ellipses)))
        return 1;
    if ((s.boxes > 0 && (!run_boxes(&s, "box", 0.1, 5, collapsed) ||
                         !run_boxes(&s, "box far off", 0.3, 15, NULL))) ||
        (s.lies > 0 && !run_planted(&s, &rooms, &of_planted)))
        return 1;
    if (s.seeds > 0 &&
        !run_scene(&s, &rooms, s.seeds, rooms_methods, 5, 4 * BENCH_VIRTUAL_UNIT, in_rooms))
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
    bench_json_number("rubble_share_without",
                      (double)in_rubble[1].aligned / in_rubble[1].observable);
    print_walls(in_rubble);
    print_boxes(&s, collapsed);
    bench_json_number("halls_share_with", (double)in_halls[0].aligned / in_halls[0].observable);
    bench_json_number("halls_share_without", (double)in_halls[1].aligned / in_halls[1].observable);
    bench_json_number("far_off_share_with", (double)in_far[0].aligned / in_far[0].observable);
    bench_json_number("far_off_share_without", (double)in_far[1].aligned / in_far[1].observable);
    bench_json_number("round_share_with", (double)in_round[0].aligned / in_round[0].observable);
    bench_json_number("round_share_without", (double)in_round[1].aligned / in_round[1].observable);
    bench_json_number("rescue110_rms_with_m", sqrt(in_narrow[0].squares / in_narrow[0].hits));
    bench_json_number("rescue110_rms_without_m", sqrt(in_narrow[1].squares / in_narrow[1].hits));
    bench_json_number(
        "active", (double)(in_rooms[0].active + in_rooms[2].active + in_rubble[0].active) /
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
    print_lies(&s, &of_planted);
    bench_json_end();
    return 0;
}
