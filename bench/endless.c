/* bench/endless: long-term operation in bounded memory: a robot drives laps through an arena with
 * capacity for a few scans (bench_endless), or with the mapper and keyframe culling.
 *
 * Prints one line for each of a few laps, spread over the run, and one for the whole run: units and
 * time of a scan in the first laps after the memory was full, and in the last laps; distance of the
 * poses of the last lap from those of the first. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bench/bench_endless.h"
#include "bench/bench_json.h"
#include "tools/options.h"

#define PROGRAM "bench/endless"

enum { EDGE = 20 }; /* laps at the beginning and at the end that are compared */

/* Sums over some laps. */
typedef struct stretch {
    int64_t scans, units, worst;
    double seconds, most;
} stretch;

typedef struct totals {
    int64_t laps, every, full; /* full: the first lap that began with full memory, -1: none yet */
    stretch early, late;
    int64_t scans, released, oldest, newest, worst;
    double most, away_most;
    bench_endless_lap first, last; /* the first one in full memory */
    const char *method;
    uint64_t pool_first;
    int64_t grown; /* laps after which the number of bytes in use differs from that of the first */
} totals;

static void print_lap(const totals *t, const bench_endless_lap *lap)
{
    bench_json_begin("endless");
    bench_json_text("method", t->method);
    bench_json_integer("lap", lap->lap);
    bench_json_integer("kept", lap->kept);
    bench_json_number("units_scan", (double)lap->units / lap->scans);
    bench_json_integer("units_worst", lap->worst);
    bench_json_number("scan_ms", 1e3 * lap->seconds / lap->scans);
    bench_json_integer("released", lap->released);
    bench_json_number("mean_m", lap->mean);
    bench_json_number("most_m", lap->most);
    bench_json_number("most_deg", lap->most_degrees);
    bench_json_number("away_m", lap->away);
    bench_json_integer("pool_bytes", (int64_t)lap->pool_used);
    bench_json_end();
}

static void add(stretch *s, const bench_endless_lap *lap)
{
    s->scans += lap->scans;
    s->units += lap->units;
    s->worst = lap->worst > s->worst ? lap->worst : s->worst;
    s->seconds += lap->seconds;
    s->most = fmax(s->most, lap->most);
}

static void count(void *context, const bench_endless_lap *lap)
{
    totals *t = context;

    if (lap->lap == 0)
        t->pool_first = lap->pool_used;
    t->grown += lap->pool_used != t->pool_first;
    if (lap->is_first) {
        t->full = lap->lap;
        t->first = *lap;
    }
    if (t->full >= 0 && lap->lap < t->full + EDGE)
        add(&t->early, lap);
    if (lap->lap >= t->laps - EDGE)
        add(&t->late, lap);
    t->scans += lap->scans;
    t->released += lap->released;
    t->oldest += lap->oldest;
    t->newest += lap->newest;
    t->worst = lap->worst > t->worst ? lap->worst : t->worst;
    t->most = fmax(t->most, lap->most);
    t->away_most = fmax(t->away_most, lap->away);
    t->last = *lap;
    if (lap->lap % t->every == 0 || lap->lap == t->laps - 1)
        print_lap(t, lap);
}

static void print_totals(const totals *t, const bench_endless_options *options)
{
    bench_json_begin("endless");
    bench_json_text("method", t->method);
    bench_json_true("total");
    bench_json_text("scene", sim_scene_name(options->scene));
    bench_json_integer("seed", (int64_t)options->seed);
    bench_json_integer("laps", t->laps);
    bench_json_integer("scans", t->scans);
    bench_json_integer("kept", t->last.kept);
    bench_json_number("units_scan_early", (double)t->early.units / (double)t->early.scans);
    bench_json_number("units_scan_late", (double)t->late.units / (double)t->late.scans);
    bench_json_integer("units_worst_early", t->early.worst);
    bench_json_integer("units_worst_late", t->late.worst);
    bench_json_integer("units_worst", t->worst);
    bench_json_number("scan_ms_early", 1e3 * t->early.seconds / (double)t->early.scans);
    bench_json_number("scan_ms_late", 1e3 * t->late.seconds / (double)t->late.scans);
    bench_json_integer("pool_bytes", (int64_t)t->last.pool_used);
    bench_json_integer("laps_of_other_bytes", t->grown);
    bench_json_integer("released", t->released);
    bench_json_integer("released_oldest", t->oldest);
    bench_json_integer("released_newest", t->newest);
    bench_json_integer("loops", t->last.loops);
    bench_json_integer("links", t->last.links);
    bench_json_number("first_mean_m", t->first.mean);
    bench_json_number("last_mean_m", t->last.mean);
    bench_json_number("first_most_m", t->first.most);
    bench_json_number("most_m", t->most);
    bench_json_number("last_most_m", t->last.most);
    bench_json_number("last_from_first_m", t->last.away);
    bench_json_number("any_from_first_m", t->away_most);
    bench_json_end();
}

int main(int argc, char **argv)
{
    bench_endless_options options = bench_endless_default();
    totals t = {.full = -1};
    const char *scene = NULL, *data = NULL;
    int32_t maps = 0;
    int64_t every = 0;
    int32_t places = 0, kept = 0;
    const option table[] = {
        OPTION_INTEGER("--scans", &options.scans, 1, 1e9, "N", "in all"),
        OPTION_FLAG("--mapper", &maps,
                    "the mapper, forward and back; --places and --kept are then 600 and 120"),
        OPTION_TEXT("--scene", &scene, "NAME", "of cairn-arena (rescue; of the mapper apartment)"),
        OPTION_SEED("--seed", &options.seed, "of the arena and of all noise"),
        OPTION_COUNT("--places", &places, 2, 10000, "N", "of a lap (30)"),
        OPTION_COUNT("--kept", &kept, 2, 1000, "N", "capacity of scans, or of keyframes (32)"),
        OPTION_INTEGER("--every", &every, 0, 1e9, "N",
                       "laps between two printed lines, 0: a tenth of all"),
        OPTION_TEXT("--data", &data, "DIR", "not needed"),
    };
    const option_set set = {
        PROGRAM, "[options]",
        "Drives laps through a simulated arena, with fresh noise in every lap; each "
        "scan "
        "is aligned with the stored scans, and the most redundant scan is removed. "
        "With --mapper the robot drives forward and back, and the mapper culls keyframes.",
        table, sizeof table / sizeof *table};
    size_t words = 0;

    switch (options_read(&set, argc, argv, NULL, &words)) {
    case OPTIONS_HELPED:
        return 0;
    case OPTIONS_BAD:
        return 2;
    default:
        break;
    }
    if (scene == NULL)
        scene = maps ? "apartment" : "rescue";
    if (maps) {
        options.places = 600;
        options.kept = 120;
    }
    t.method = maps ? "mapper" : "aligner";
    options.places = places > 0 ? places / (1 + maps) * (1 + maps) : options.places;
    options.kept = kept > 0 ? kept : options.kept;
    options.scene = sim_scene_find(scene);
    if (options.scene < 0)
        return options_refuse(PROGRAM, "unknown scene '%s', expected one of cairn-arena", scene);
    t.laps = options.scans / options.places;
    if (t.laps < 1)
        return options_refuse(PROGRAM, "--scans: fewer than a lap of %d places", options.places);
    t.every = every > 0 ? every : t.laps / 10 > 0 ? t.laps / 10 : 1;
    if (!(maps ? bench_endless_map : bench_endless_run)(&options, count, &t))
        return 1;
    print_totals(&t, &options);
    return 0;
}
