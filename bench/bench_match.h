/* Problems of bench/match, places of simulated arenas, and the place mapper that solves them. */
#ifndef CAIRN_BENCH_MATCH_H
#define CAIRN_BENCH_MATCH_H

#include "bench/bench_calibration_fit.h"
#include "bench/bench_reliability.h"
#include "bench/bench_score.h"
#include "cairn/place_map.h"
#include "sim/arena.h"
#include "src/host/base/degrees.h"
#include "tools/cairn_places_picture.h"

enum { BENCH_MATCH_HEADINGS = 4 };

#define BENCH_RIGHT_M   0.10
#define BENCH_RIGHT_RAD (2 * CAIRN_DEGREE)

typedef struct bench_match_settings {
    const char *scene;
    int64_t arenas, seed, places;
    double tilt, movers;
    /* m, degrees */
    double sub_error[2];
    int32_t walkers, unrelated;
    /* 1: the scans of all places have the same headings, as in the thesis */
    int32_t same_headings;
    /* 1: the method and the setting of chapter 6: headings of places are equal and known up to
     * ... */
    int32_t as_written;
    /* ... uniform +-, degrees */
    double heading_error;
} bench_match_settings;

/* The input of a mapper from an arena, or from two unrelated ones, and the truth, which it does not
 * see. */
typedef struct bench_match_problem {
    sim_arena *arena[2];
    sim_survey *survey[2];
    sim_scan *scans;
    int32_t scan_count, place_count;
    double bad_share;       /* of the beams: on movers or the floor */
    cairn_pose *place_scan; /* [scan_count] pose of the scan in its place, as given to the mapper */
    sim_pose *truth;        /* [scan_count] */
    sim_pose *frame;        /* [place_count] true poses of the places */
    int32_t *first_scan;    /* [place_count] */
} bench_match_problem;

/* 0: a line on standard error, and nothing to free. */
int bench_match_make(const bench_match_settings *settings, uint64_t seed,
                     bench_match_problem *problem);

void bench_match_free(bench_match_problem *problem);

/* Mapper and scan reader in one pool. */
typedef struct bench_match_machine {
    void *memory;
    size_t bytes;
    cairn_scan *scan;
    cairn_place_map *map;
} bench_match_machine;

/* 0: memory is insufficient. The caller frees the memory in either case. */
int bench_match_machine_make(const cairn_place_map_params *params, bench_match_machine *machine);

/* The scan reader's view of a scan, valid until the next one; empty where it refuses. */
cairn_scan_view bench_match_view(bench_match_machine *machine, const sim_scan *scan,
                                 cairn_status *status);

/* Maps all scans of a problem; 0: a line on standard error. */
int bench_match_map(const bench_match_problem *problem, bench_match_machine *machine);

/* The mapper as written after a stage, with the capacities that the problem needs. */
cairn_place_map_params bench_match_written_params(const bench_match_settings *settings,
                                                  places_stage stage);

/* Maps an arena as written and draws fig-6.6-SEED.svg and fig-6.7-SEED.svg into a folder. 0: a
 * line on standard error. */
int bench_match_draw_written(const bench_match_settings *settings,
                             const bench_match_problem *problem, uint64_t seed, const char *folder);

/* The method of chapter 6 after each of its stages, and all but one of them, on the arenas of
 * the settings, a JSON line each; params: of the scan reader's maps. 0 on failure. */
int bench_match_ablate(const bench_match_settings *settings, const cairn_place_map_params *params);

/* Maps places of `arenas` arenas, from `seed` on: of six scenes, 6 to 12 places, up to a fifth of the
 * beams on people, up to 45 % of the places of another arena. Prints an object for each place of the
 * largest components, and the reliability of the error probabilities of odd seeds. An exit code. */
int bench_match_calibrate(int64_t arenas, int64_t seed);

/* Prints an object for each place of the largest component: whether its pose is wrong after the
 * motion that fits most of them, and what its error probability is stated from. Those of odd seeds
 * are added to `odd` unless it is NULL. 0: no memory. */
int bench_match_print_decisions(const bench_match_settings *settings,
                                const bench_match_problem *problem,
                                const bench_match_machine *machine, bench_reliability *odd);

/* The model of the error probability of places, for bench_calibration_fit(). */
bench_calibration_model bench_calibration_of_places(void);

#endif
