/* bench/scenes: false loop closures: drives through buildings with perceptual aliasing.
 *
 * Every arena is mapped twice, with loops and without. A loop closure is wrong when its error
 * exceeds 0.2 m or 2 degrees. A pose is corrupted when its error relative to the first scan is more
 * than 0.2 m and with loops by more than 0.2 m larger than without. A pose is off when its error
 * with loops is more than 0.3 m; that is reported when the scan has no match, or a standard
 * deviation of its position of at least a third of that, or its keyframe a standard deviation in the map
 * of at least 0.35 m. A pose is folded when the map has it
 * within 0.5 m of another one that is more than 2 m away. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_closures.h"
#include "bench/bench_json.h"
#include "bench/bench_reliability.h"
#include "bench/bench_score.h"
#include "cairn/mapper.h"
#include "sim/arena.h"
#include "tools/options.h"

static const double MAX_ERROR_M = 0.2; /* m */
static const double MAX_ERROR_RAD = 2 / 57.29577951308232;
static const double OFF_M = 0.3;              /* m */
static const double LEAST_REPORTED_M = 0.1;   /* m, standard deviation */
static const double LEAST_UNCERTAIN_M = 0.35; /* m, standard deviation in the map */
enum { DEFAULT_SCANS = 400 };                 /* of a drive */
static const char DEFAULT_SCENE[] = "twins";
static const double FOLD_MAPPED_M = 0.5, FOLD_TRUE_M = 2;

typedef struct settings {
    const char *scene;
    int64_t seeds, seed, scans, movers;
    double ground;
    int32_t legs, trailer, no_odometry, verbose, calibration, fit, table;
    /* of --calibration: seed of the drive that is mapped, and the decisions of odd seeds */
    int64_t drive_seed;
    bench_reliability *odd;
} settings;

/* A drive, mapped. */
typedef struct outcome {
    cairn_pose *poses;       /* [scans] */
    int32_t *keyframe_scans; /* [scans] scan index of a keyframe */
    uint8_t *reported;       /* [scans] 1: the mapper reported that the pose may be off */
    int32_t accepted, rejected, waiting, wrong;
    double worst_closure;
    cairn_mapper_state state;
} outcome;

static double length(cairn_pose p)
{
    return hypot((double)p.x, (double)p.y);
}

/* ---- Closures ---- */

static void count_closure(const settings *s, const cairn_mapper_loop *loop, const sim_scan *scans,
                          outcome *out)
{
    cairn_pose truth =
        cairn_pose_between(bench_cairn_pose(scans[out->keyframe_scans[loop->first]].truth),
                           bench_cairn_pose(scans[out->keyframe_scans[loop->second]].truth));
    cairn_pose error = cairn_pose_between(truth, loop->first_second);
    double off = length(error), turn = fabs((double)error.theta);
    int32_t wrong = off > MAX_ERROR_M || turn > MAX_ERROR_RAD;

    out->waiting += loop->verdict == CAIRN_MAPPER_LOOP_PENDING;
    out->rejected +=
        loop->verdict != CAIRN_MAPPER_LOOP_ACCEPTED && loop->verdict != CAIRN_MAPPER_LOOP_PENDING;
    if (loop->verdict != CAIRN_MAPPER_LOOP_ACCEPTED)
        return;
    out->accepted++;
    out->worst_closure = fmax(out->worst_closure, off);
    out->wrong += wrong;
    if (s->calibration) {
        bench_closures_drive drive = {s->drive_seed, s->scene, (int32_t)s->movers, s->no_odometry};

        bench_closures_print(&drive, loop, wrong);
        if (s->drive_seed % 2 != 0)
            bench_reliability_add(s->odd, (double)loop->error_probability, wrong);
    }
    if (s->verbose && wrong)
        fprintf(stderr,
                "loop closure of keyframes %" PRId32 " and %" PRId32
                ": off by %.3f m, %.2f degrees\n",
                loop->first, loop->second, off, turn * 57.29577951308232);
}

static void count_closures(const settings *s, const cairn_mapper *mapper, const sim_scan *scans,
                           int32_t *seen, outcome *out)
{
    for (int32_t now = cairn_mapper_measure(mapper).loop_events; *seen < now; (*seen)++) {
        cairn_mapper_loop loop = cairn_mapper_loop_at(mapper, *seen);

        count_closure(s, &loop, scans, out);
    }
}

/* ---- Mapping ---- */

/* 1 when the result says that the pose may be off. The first scan is exact. */
static uint8_t is_reported(cairn_mapper_result result)
{
    double xx = (double)result.covariance[0], xy = (double)result.covariance[1],
           yy = (double)result.covariance[4];
    double largest = (xx + yy) / 2 + hypot((xx - yy) / 2, xy);

    if (result.verdict == CAIRN_MAPPER_FIRST)
        return 0;
    return result.verdict != CAIRN_MAPPER_MATCHED || sqrt(largest) >= LEAST_REPORTED_M;
}

/* Events are read after every few units of work, before older ones are overwritten. */
static cairn_status work(const settings *s, cairn_mapper *mapper, const sim_scan *scans,
                         int32_t *seen, outcome *out,
                         cairn_status (*step)(cairn_mapper *, cairn_budget *))
{
    cairn_status status = CAIRN_MORE;

    while (status == CAIRN_MORE) {
        cairn_budget budget = {5000};

        status = step(mapper, &budget);
        count_closures(s, mapper, scans, seen, out);
    }
    return status;
}

/* Reports the poses in keyframes that are uncertain in the map. */
static cairn_status report_uncertain(const cairn_mapper *mapper, const int32_t *key, int32_t count,
                                     outcome *out)
{
    int32_t keyframes = cairn_mapper_measure(mapper).keyframes;
    cairn_mapper_uncertainty *uncertainty = malloc((size_t)keyframes * sizeof *uncertainty);
    cairn_status status = uncertainty == NULL
                              ? CAIRN_NO_MEMORY
                              : cairn_mapper_find_uncertainty(mapper, uncertainty, keyframes);

    for (int32_t i = 0; i < count && status == CAIRN_OK; i++)
        out->reported[i] |=
            sqrt((double)uncertainty[key[i]].position_variance) >= LEAST_UNCERTAIN_M;
    free(uncertainty);
    return status == CAIRN_UNSUPPORTED ? CAIRN_OK : status;
}

static cairn_status feed(const settings *s, cairn_mapper *mapper, const sim_scan *scans,
                         int32_t count, outcome *out)
{
    int32_t *key = malloc((size_t)count * sizeof *key), seen = 0;
    cairn_status status = key == NULL ? CAIRN_NO_MEMORY : CAIRN_OK;

    for (int32_t i = 0; i < count && status == CAIRN_OK; i++) {
        cairn_scan_input input = sim_scan_input(&scans[i]);
        cairn_pose odometry = bench_cairn_pose(scans[i].odometry);
        int32_t keys = cairn_mapper_measure(mapper).keyframes;

        out->keyframe_scans[keys] = i;
        status = cairn_mapper_add(mapper, &input, s->no_odometry ? NULL : &odometry, NULL);
        if (status == CAIRN_MORE)
            status = work(s, mapper, scans, &seen, out, cairn_mapper_step);
        key[i] = cairn_mapper_read(mapper).keyframe;
        out->poses[i] = cairn_mapper_read(mapper).keyframe_scan;
        out->reported[i] = is_reported(cairn_mapper_read(mapper));
    }
    if (status == CAIRN_OK)
        status = work(s, mapper, scans, &seen, out, cairn_mapper_settle);
    for (int32_t i = 0; i < count && status == CAIRN_OK; i++)
        out->poses[i] =
            cairn_pose_compose(cairn_mapper_keyframe_pose(mapper, key[i]), out->poses[i]);
    if (status == CAIRN_OK)
        status = report_uncertain(mapper, key, count, out);
    out->state = cairn_mapper_measure(mapper);
    free(key);
    return status;
}

static void free_outcome(outcome *out)
{
    free(out->poses);
    free(out->keyframe_scans);
    free(out->reported);
}

static cairn_status map_drive(const settings *s, const sim_scan *scans, int32_t count,
                              int32_t loops, outcome *out)
{
    cairn_mapper_params params = cairn_mapper_default_for(count, scans[0].count);
    cairn_mapper *mapper = NULL;
    cairn_pool pool;
    void *memory;
    size_t bytes;
    cairn_status status = CAIRN_NO_MEMORY;

    memset(out, 0, sizeof *out);
    if (!loops)
        params.loop.max_loops = 0;
    bytes = cairn_mapper_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    out->poses = calloc((size_t)count + 1, sizeof *out->poses);
    out->keyframe_scans = calloc((size_t)count + 1, sizeof *out->keyframe_scans);
    out->reported = calloc((size_t)count + 1, sizeof *out->reported);
    if (memory != NULL && out->poses != NULL && out->keyframe_scans != NULL &&
        out->reported != NULL)
        status = cairn_pool_init(&pool, memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_mapper_create(&mapper, &pool, &params);
    if (status == CAIRN_OK)
        status = feed(s, mapper, scans, count, out);
    free(memory);
    return status;
}

/* ---- Errors ---- */

/* Position errors relative to the first scan. */
static double error_of(const sim_scan *scans, const outcome *out, int32_t i)
{
    cairn_pose truth =
        cairn_pose_between(bench_cairn_pose(scans[0].truth), bench_cairn_pose(scans[i].truth));

    return length(cairn_pose_between(truth, cairn_pose_between(out->poses[0], out->poses[i])));
}

/* Over all arenas. */
typedef struct totals {
    int64_t arenas, closures, rejected, wrong, poses, corrupted_poses, corrupted_arenas;
    int64_t reported, off, unreported, folded;
    double worst_closure, worst_led, worst_with, worst_without, sum_with;
    /* m, without loops, true and in the map; of scans that saw the floor, and of others */
    double driven[2], mapped[2];
} totals;

/* Motion along the heading from scan to scan, as the poses without loops have it. */
static void add_motion(const sim_scan *scans, int32_t count, const outcome *without, totals *t)
{
    for (int32_t i = 1; i < count; i++) {
        int32_t tilted = scans[i - 1].tilted && scans[i].tilted;
        cairn_pose truth = cairn_pose_between(bench_cairn_pose(scans[i - 1].truth),
                                              bench_cairn_pose(scans[i].truth));

        t->driven[tilted] += (double)truth.x;
        t->mapped[tilted] += (double)cairn_pose_between(without->poses[i - 1], without->poses[i]).x;
    }
}

/* Poses that the map has beside others that are far away. */
static int64_t count_folds(const sim_scan *scans, int32_t count, const outcome *out)
{
    int64_t folded = 0;

    for (int32_t i = 0; i < count; i++)
        for (int32_t k = 0; k < count; k++)
            if (length(cairn_pose_between(out->poses[i], out->poses[k])) < FOLD_MAPPED_M &&
                length(cairn_pose_between(bench_cairn_pose(scans[i].truth),
                                          bench_cairn_pose(scans[k].truth))) > FOLD_TRUE_M) {
                folded++;
                break;
            }
    return folded;
}

static void add_up(const sim_scan *scans, int32_t count, const outcome *with,
                   const outcome *without, totals *t)
{
    int64_t corrupted = 0;

    for (int32_t i = 0; i < count; i++) {
        double a = error_of(scans, with, i), b = error_of(scans, without, i);

        t->worst_with = fmax(t->worst_with, a);
        t->worst_without = fmax(t->worst_without, b);
        t->worst_led = fmax(t->worst_led, a - b);
        corrupted += a > MAX_ERROR_M && a - b > MAX_ERROR_M;
        t->sum_with += a;
        t->reported += with->reported[i];
        t->off += a > OFF_M;
        t->unreported += a > OFF_M && !with->reported[i];
    }
    add_motion(scans, count, without, t);
    t->folded = count_folds(scans, count, with);
    t->arenas++;
    t->poses += count;
    t->closures += with->accepted;
    t->rejected += with->rejected;
    t->wrong += with->wrong;
    t->worst_closure = fmax(t->worst_closure, with->worst_closure);
    t->corrupted_poses += corrupted;
    t->corrupted_arenas += corrupted > 0;
}

static void merge(totals *all, const totals *one)
{
    all->arenas += one->arenas;
    all->closures += one->closures;
    all->rejected += one->rejected;
    all->wrong += one->wrong;
    all->poses += one->poses;
    all->corrupted_poses += one->corrupted_poses;
    all->corrupted_arenas += one->corrupted_arenas;
    all->reported += one->reported;
    all->off += one->off;
    all->unreported += one->unreported;
    all->folded += one->folded;
    all->sum_with += one->sum_with;
    for (int32_t tilted = 0; tilted < 2; tilted++) {
        all->driven[tilted] += one->driven[tilted];
        all->mapped[tilted] += one->mapped[tilted];
    }
    all->worst_closure = fmax(all->worst_closure, one->worst_closure);
    all->worst_led = fmax(all->worst_led, one->worst_led);
    all->worst_with = fmax(all->worst_with, one->worst_with);
    all->worst_without = fmax(all->worst_without, one->worst_without);
}

static void print_totals(const settings *s, const totals *t, int64_t seed)
{
    bench_json_begin("scenes");
    bench_json_text("scene", s->scene);
    bench_json_text("odometry", s->no_odometry ? "none" : "log");
    if (s->ground > 0)
        bench_json_number("ground_m", s->ground);
    if (s->legs)
        bench_json_true("legs");
    if (s->trailer)
        bench_json_true("trailer");
    if (s->movers > 0)
        bench_json_integer("movers", s->movers);
    if (seed >= 0)
        bench_json_integer("seed", seed);
    else
        bench_json_integer("arenas", t->arenas);
    bench_json_integer("closures", t->closures);
    bench_json_integer("rejected", t->rejected);
    bench_json_integer("wrong", t->wrong);
    bench_json_number("closure_worst_m", t->worst_closure);
    bench_json_integer("poses", t->poses);
    bench_json_integer("poses_astray", t->corrupted_poses);
    if (seed < 0)
        bench_json_integer("arenas_astray", t->corrupted_arenas);
    bench_json_number("led_worst_m", t->worst_led);
    bench_json_number("error_worst_m", t->worst_with);
    bench_json_number("error_worst_without_m", t->worst_without);
    bench_json_number("error_mean_m", t->sum_with / (double)t->poses);
    bench_json_integer("poses_reported", t->reported);
    bench_json_integer("poses_off", t->off);
    bench_json_integer("poses_off_unreported", t->unreported);
    bench_json_number("unreported_share", (double)t->unreported / (double)t->poses);
    bench_json_integer("poses_folded", t->folded);
    /* motion in the map over true motion, without loops */
    bench_json_number("motion_ratio", t->mapped[0] / t->driven[0]);
    if (t->driven[1] > 0)
        bench_json_number("motion_ratio_tilted", t->mapped[1] / t->driven[1]);
    if (seed < 0)
        bench_json_true("summary");
    bench_json_end();
    fflush(stdout);
}

/* One arena; 0 after a line on standard error. With --calibration it is mapped once, with loops. */
static int run_seed(const settings *s, uint64_t seed, totals *all)
{
    sim_arena_options arena_options = sim_arena_default();
    sim_survey_options options;
    sim_arena *arena;
    sim_survey *survey = NULL;
    char fault[256] = "no memory";
    totals t = {0};
    int done = 0;

    arena_options.scene = sim_scene_find(s->scene);
    options = sim_survey_default_for(arena_options.scene);
    arena_options.seed = options.seed = seed;
    if (options.drive == 0) {
        options.drive = DEFAULT_SCANS;
        options.drive_distance = options.drive_turn = 0.3;
        options.beams = 181;
        options.fov = 3.14159265358979;
    }
    if (s->scans > 0)
        options.drive = (int32_t)s->scans;
    options.ground = s->ground;
    options.legs = s->legs;
    options.trailer = s->trailer;
    options.movers = (int32_t)s->movers;
    arena = sim_arena_create(&arena_options, fault, sizeof fault);
    if (arena != NULL)
        survey = sim_survey_create(arena, &options, fault, sizeof fault);
    if (survey != NULL) {
        outcome with = {0}, without = {0};
        int32_t count;
        const sim_scan *scans = sim_survey_scans(survey, &count);

        done = map_drive(s, scans, count, 1, &with) == CAIRN_OK &&
               (s->calibration || map_drive(s, scans, count, 0, &without) == CAIRN_OK);
        if (done && !s->calibration)
            add_up(scans, count, &with, &without, &t);
        else
            snprintf(fault, sizeof fault, "the mapper failed");
        free_outcome(&with);
        free_outcome(&without);
    }
    if (done && !s->calibration) {
        print_totals(s, &t, (int64_t)seed);
        merge(all, &t);
    } else if (!done) {
        fprintf(stderr, "%s, seed %" PRIu64 ": %s\n", s->scene, seed, fault);
    }
    sim_survey_free(survey);
    sim_arena_free(arena);
    return done;
}

/* Decisions on the closures of generated drives, and the reliability of those of odd seeds. */
static int calibrate(settings *s)
{
    totals none = {0};

    for (s->drive_seed = s->seed; s->drive_seed < s->seed + s->seeds; s->drive_seed++) {
        bench_closures_drive drive = bench_closures_drive_of(s->drive_seed);

        s->scene = drive.scene;
        s->movers = drive.movers;
        s->no_odometry = drive.no_odometry;
        if (!run_seed(s, (uint64_t)s->drive_seed, &none))
            return 1;
    }
    bench_reliability_print("scenes", "odd seeds", s->odd);
    return 0;
}

int main(int argc, char **argv)
{
    settings s = {.scene = DEFAULT_SCENE, .seeds = 50, .seed = 1};
    const option table[] = {
        OPTION_TEXT("--scene", &s.scene, "NAME",
                    "twins, mirror, maze, office, hospital or another scene"),
        OPTION_INTEGER("--seeds", &s.seeds, 1, 1000000, "N", "arenas"),
        OPTION_INTEGER("--seed", &s.seed, 0, 1000000000, "N", "of the first one"),
        OPTION_INTEGER("--scans", &s.scans, 2, 10000, "N",
                       "of a drive (400, one every 0.3 m or 0.3 rad; hospital: 1500, 0.2)"),
        OPTION_NUMBER("--ground", &s.ground, 1, 50, "M",
                      "on stretches of the drive the scanner meets the floor M m ahead"),
        OPTION_FLAG("--legs", &s.legs, "the scanner sees the robot's own legs"),
        OPTION_FLAG("--trailer", &s.trailer, "the scanner sees a trailer that follows"),
        OPTION_INTEGER("--movers", &s.movers, 0, 100, "N",
                       "people who walk about, stop, block the view and push the robot"),
        OPTION_FLAG("--no-odometry", &s.no_odometry, "uses the ranges alone"),
        OPTION_FLAG("--verbose", &s.verbose, "prints every wrong loop closure"),
        OPTION_FLAG(
            "--calibration", &s.calibration,
            "a line for every accepted closure of drives in eight scenes, with and without "
            "people and odometry instead, and the reliability of the error probabilities of "
            "odd seeds; chooses the drives itself"),
        OPTION_FLAG("--fit", &s.fit,
                    "reads lines of --calibration from standard input instead: constants of the "
                    "error probability by those of even seeds, and its reliability"),
        OPTION_FLAG("--table", &s.table, "with --fit: a table of that in Markdown"),
    };
    const option_set set = {"bench/scenes", "[options]",
                            "Measures false loop closures in buildings with perceptual aliasing.",
                            table, sizeof table / sizeof *table};
    totals all = {0};
    bench_reliability odd;
    size_t words = 0;
    option_result result = options_read(&set, argc, argv, NULL, &words);

    if (result != OPTIONS_READ)
        return result;
    if (sim_scene_find(s.scene) < 0)
        return options_refuse("bench/scenes", "--scene is '%s', expected the name of a scene",
                              s.scene);
    if (s.table && !s.fit)
        return options_refuse("bench/scenes", "--table is given without --fit, expected both");
    if (s.calibration && (s.scans > 0 || s.ground > 0 || s.legs || s.trailer || s.movers > 0 ||
                          s.no_odometry || strcmp(s.scene, DEFAULT_SCENE) != 0))
        return options_refuse("bench/scenes", "--calibration chooses the drives itself, expected "
                                              "--seeds and --seed only");
    if (s.fit) {
        bench_calibration_model model = bench_calibration_of_closures();

        return bench_calibration_fit(&model, s.table);
    }
    if (s.calibration) {
        memset(&odd, 0, sizeof odd);
        s.odd = &odd;
        return calibrate(&s);
    }
    for (int64_t i = 0; i < s.seeds; i++)
        if (!run_seed(&s, (uint64_t)(s.seed + i), &all))
            return 1;
    print_totals(&s, &all, -1);
    return 0;
}
