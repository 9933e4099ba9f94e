/* The result of cairn map: a summary, or a JSON object. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "cairn/uncertain_stretch.h"
#include "src/host/base/degrees.h"
#include "tools/cairn_map_work.h"

void map_write_common(cairn_json_writer *json, const map_settings *s, int32_t scans, int64_t faults,
                      int32_t stamps_back, double seconds, double seconds_to_map, size_t pool_bytes)
{
    cairn_json_write_array(json, "logs");
    for (int32_t i = 0; i < s->log_count; i++)
        cairn_json_write_text(json, NULL, s->logs[i]);
    cairn_json_write_array_end(json);
    cairn_json_write_text(json, "folder", s->folder);
    cairn_json_write_integer(json, "scans", scans);
    cairn_json_write_integer(json, "damaged", faults);
    cairn_json_write_boolean(json, "stamps_run_back", stamps_back);
    cairn_json_write_number(json, "seconds", seconds);
    cairn_json_write_number(json, "scans_per_second", scans / seconds_to_map);
    cairn_json_write_integer(json, "pool_bytes", (int64_t)pool_bytes);
    map_write_angle_step(json, s);
}

/* Adds scans to the drive until a stretch has ended; returns 0 at the end of the drive. */
static int find_stretch(const map_run *run, cairn_uncertain_drive *drive,
                        cairn_uncertain_stretch *stretch)
{
    while (drive->scans < run->count) {
        const cairn_placed_scan *scan = &run->scans[drive->scans],
                                *before = scan - (drive->scans > 0);

        if (cairn_uncertain_stretch_add(drive, scan->covariance,
                                        cairn_pose_between(before->after, scan->after), stretch))
            return 1;
    }
    return cairn_uncertain_stretch_end(drive, stretch);
}

/* Writes all stretches whose motion no match determines. */
static void write_uncertain_stretches(cairn_json_writer *json, const map_run *run)
{
    cairn_uncertain_drive drive = {0};
    cairn_uncertain_stretch stretch;

    cairn_json_write_array(json, "uncertain_stretches");
    while (find_stretch(run, &drive, &stretch)) {
        cairn_json_write_object(json, NULL);
        cairn_json_write_integer(json, "first", stretch.first);
        cairn_json_write_integer(json, "last", stretch.last);
        cairn_json_write_integer(json, "unmatched", stretch.unmatched);
        cairn_json_write_number(json, "length_m", (double)stretch.length);
        cairn_json_write_number(json, "turn_deg", (double)stretch.turn * CAIRN_DEGREES_PER_RADIAN);
        cairn_json_write_object_end(json);
    }
    cairn_json_write_array_end(json);
}

/* Stretches that the summary names. */
enum { NAMED_STRETCHES = 5, NAMED_LOOPS = 5 };

/* Returns what a stretch may bend: by its length, and by its turn, 30 degrees like 1 m. */
static double weight_of(const cairn_uncertain_stretch *stretch)
{
    return (double)stretch->length + (double)stretch->turn / (30 * CAIRN_DEGREE);
}

/* Prints the worst stretches whose motion no match determines, in the order of the drive. */
static void print_uncertain_stretches(const map_run *run, FILE *file)
{
    cairn_uncertain_drive drive = {0};
    cairn_uncertain_stretch stretch, worst[NAMED_STRETCHES];
    int32_t count = 0, named = 0;
    double length = 0;

    while (find_stretch(run, &drive, &stretch)) {
        int32_t least = 0;

        count++;
        length += (double)stretch.length;
        if (named == NAMED_STRETCHES) {
            for (int32_t i = 1; i < named; i++)
                if (weight_of(&worst[i]) < weight_of(&worst[least]))
                    least = i;
            if (weight_of(&worst[least]) >= weight_of(&stretch))
                continue;
            named--;
            memmove(&worst[least], &worst[least + 1], (size_t)(named - least) * sizeof *worst);
        }
        worst[named++] = stretch;
    }
    if (count == 0)
        return;
    fprintf(file,
            "stretches  %" PRId32
            ", %.1f m in all, without a certain match: the map may be bent there%s\n",
            count, length, count > named ? "; the worst:" : ":");
    for (int32_t i = 0; i < named; i++)
        fprintf(
            file,
            "           scans %" PRId32 " to %" PRId32 " (line %" PRId64 " on): %.1f m, turned %.0f"
            " degrees, %" PRId32 " without a match\n",
            worst[i].first, worst[i].last, run->scans[worst[i].first].line, (double)worst[i].length,
            (double)worst[i].turn * CAIRN_DEGREES_PER_RADIAN, worst[i].unmatched);
}

/* m: standard deviation of a position in the map from which a pose is uncertain */
static const double UNCERTAIN_M = 0.35;

/* Returns the number of poses that are uncertain in the map, and the largest standard deviation, m. */
static int32_t uncertain_poses(const map_run *run, double *largest)
{
    int32_t count = 0;

    *largest = 0;
    for (int32_t i = 0; i < run->count && run->keeps; i++) {
        double sigma = (double)run->scans[i].map_sigma;

        count += sigma >= UNCERTAIN_M;
        *largest = fmax(*largest, sigma);
    }
    return count;
}

static void print_uncertain_poses(const map_run *run, FILE *file)
{
    double largest;
    int32_t count = uncertain_poses(run, &largest);

    if (count > 0)
        fprintf(file,
                "lost       %" PRId32 " of %" PRId32
                " poses are uncertain in the map (standard deviation up to %.1f m): scans had no "
                "certain match before them, and no loop closure joins them past that\n",
                count, run->count, largest);
}

/* Sum of the error probabilities of the loop closures in the graph. */
static double expected_wrong_loops(const cairn_mapper *mapper)
{
    double expected = 0;

    for (int32_t i = 0; i < cairn_mapper_link_count(mapper); i++) {
        cairn_mapper_link link = cairn_mapper_link_at(mapper, i);

        expected += link.is_outlier ? 0 : (double)link.error_probability;
    }
    return expected;
}

/* Error probability from which a loop closure is named. */
static const double UNCERTAIN_PROBABILITY = 0.1;

/* Returns the loop closure of greatest error probability among those that rank after `before` (-1:
 * all): by probability, then by index. -1: none that is uncertain. */
static int32_t next_uncertain(const cairn_mapper *mapper, int32_t before)
{
    double most = before < 0 ? 2 : (double)cairn_mapper_link_at(mapper, before).error_probability;
    double best = UNCERTAIN_PROBABILITY;
    int32_t uncertain = -1;

    for (int32_t i = 0; i < cairn_mapper_link_count(mapper); i++) {
        cairn_mapper_link link = cairn_mapper_link_at(mapper, i);
        double p = link.is_outlier ? 0 : (double)link.error_probability;

        if ((p < most || (p <= most && i > before)) && (p > best || (uncertain < 0 && p >= best))) {
            best = p;
            uncertain = i;
        }
    }
    return uncertain;
}

/* How many loop closures are expected to be wrong, and those that are most likely to be. */
static void print_uncertain_loops(const cairn_mapper *mapper, FILE *file)
{
    double expected = expected_wrong_loops(mapper);
    int32_t uncertain = -1;

    if (expected >= UNCERTAIN_PROBABILITY)
        fprintf(file,
                "           %.1f of them are expected to be off by more than 0.2 m or 2 degrees\n",
                expected);
    for (int32_t i = 0; i < NAMED_LOOPS; i++) {
        cairn_mapper_link link;

        uncertain = next_uncertain(mapper, uncertain);
        if (uncertain < 0)
            return;
        link = cairn_mapper_link_at(mapper, uncertain);
        fprintf(file,
                "           keyframes %" PRId32 " and %" PRId32
                " (vertices of graph.g2o): with a probability of %.2f\n",
                link.first, link.second, (double)link.error_probability);
    }
}

static void print_json(const map_run *run, int64_t faults, int32_t stamps_back, double seconds,
                       double seconds_to_map)
{
    cairn_mapper_state state = cairn_mapper_measure(run->mapper);
    cairn_json_writer json = cairn_json_write_begin(stdout);
    double largest;

    cairn_json_write_text(&json, "method", "mapper");
    map_write_common(&json, run->settings, run->count, faults, stamps_back, seconds, seconds_to_map,
                     run->pool.peak);
    cairn_json_write_integer(&json, "keyframes", state.keyframes);
    cairn_json_write_integer(&json, "unmatched", state.predicted);
    cairn_json_write_integer(&json, "culled_keyframes", state.culled_keyframes);
    cairn_json_write_integer(&json, "loops", state.loops);
    cairn_json_write_number(&json, "loops_expected_wrong", expected_wrong_loops(run->mapper));
    cairn_json_write_integer(&json, "corrections", state.graph_solutions);
    cairn_json_write_boolean(&json, "capacity_exceeded", state.capacity_exceeded != 0);
    cairn_json_write_integer(&json, "uncertain", state.low_confidence);
    if (run->keeps)
        cairn_json_write_integer(&json, "poses_uncertain", uncertain_poses(run, &largest));
    cairn_json_write_integer(&json, "unobservable", state.unobservable);
    cairn_json_write_integer(&json, "odometry_contradicted", state.odometry_contradicted);
    cairn_json_write_integer(&json, "odometry_rejected", state.odometry_rejected);
    cairn_json_write_integer(&json, "matches_rejected", state.matches_rejected);
    cairn_json_write_integer(&json, "stretches_rejected", state.stretches_rejected);
    cairn_json_write_number(&json, "potential", (double)state.potential);
    write_uncertain_stretches(&json, run);
    map_write_poses(&json, run->scans, run->count);
    cairn_json_write_end(&json);
}

static void print_text(const map_run *run, FILE *file, int64_t faults, int32_t stamps_back,
                       double seconds, double seconds_to_map)
{
    cairn_mapper_state state = cairn_mapper_measure(run->mapper);

    fprintf(file,
            "scans      %" PRId32 " (%" PRId64 " damaged lines left out%s)\n"
            "seconds    %.3f, %.0f scans/s\n"
            "pool       %zu bytes at most\n"
            "keyframes  %" PRId32 " (%" PRId32 " culled)\n"
            "loops      %" PRId32 " closed, %" PRId32 " corrections%s\n",
            run->count, faults, stamps_back ? ", some times run back" : "", seconds,
            run->count / seconds_to_map, run->pool.peak, state.keyframes, state.culled_keyframes,
            state.loops, state.graph_solutions,
            state.capacity_exceeded ? ", capacity reached" : "");
    print_uncertain_loops(run->mapper, file);
    fprintf(file,
            "unmatched  %" PRId64 " (pose by prediction)\n"
            "uncertain  %" PRId64 ", weakly observable in some direction %" PRId64 "\n"
            "odometry   contradicted by %" PRId64 " matches, %" PRId64
            " matched better from the predicted motion\n"
            "potential  %.6g\n",
            state.predicted, state.low_confidence, state.unobservable, state.odometry_contradicted,
            state.odometry_rejected, (double)state.potential);
    if (state.matches_rejected > 0)
        fprintf(file,
                "rejected   %" PRId32 " matches contradict the odometry over %" PRId32
                " stretches: returns that travel with the robot (floor, legs, trailer)?\n",
                state.matches_rejected, state.stretches_rejected);
    if (run->keeps)
        print_uncertain_stretches(run, file);
    print_uncertain_poses(run, file);
}

/* Of all scans: with more without a match, or with more whose match contradicts the odometry, the
 * log is likely to be wrong about the scanner. */
static const double MOST = 0.5;

/* Says on standard error where most scans do not fit. */
static void print_hint(const map_run *run)
{
    cairn_mapper_state state = cairn_mapper_measure(run->mapper);
    const char *what = NULL;

    if ((double)state.predicted > MOST * run->count)
        what = "most scans have no match";
    else if ((double)state.odometry_contradicted > MOST * run->count)
        what = "most matches contradict the odometry";
    if (what != NULL)
        fprintf(stderr,
                MAP_PROGRAM
                ": %s: cairn info LOG --check looks for what is wrong with the scanner\n",
                what);
}

void map_run_print(const map_run *run, int64_t faults, int32_t stamps_back, double seconds,
                   double seconds_to_map)
{
    const map_settings *s = run->settings;

    if (!s->quiet) {
        map_print_angle_step(s);
        print_hint(run);
    }
    if (s->json)
        print_json(run, faults, stamps_back, seconds, seconds_to_map);
    else if (!s->quiet)
        print_text(run, s->live ? stderr : stdout, faults, stamps_back, seconds, seconds_to_map);
}
