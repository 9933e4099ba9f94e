/* Scans of simulated arenas aligned with virtual scans (chapter 8): problems, ways to align
 * them, sums over many. */
#ifndef CAIRN_BENCH_VIRTUAL_H
#define CAIRN_BENCH_VIRTUAL_H

#include "bench/bench_guess.h"
#include "cairn/random.h"
#include "cairn/virtual_align.h"
#include "sim/arena.h"

#define BENCH_VIRTUAL_UNIT 0.03 /* m, of the rooms */

/* Force field that registers the scans which the aligner leaves unplaced. */
typedef int32_t bench_virtual_field;
enum {
    BENCH_NO_FIELD,        /* the aligner alone */
    BENCH_SPRINGS,         /* virtual_align's defaults */
    BENCH_FIELD_AS_WRITTEN /* algorithm 2, with hypotheses or without */
};

/* One way to align. */
typedef struct bench_virtual_method {
    const char *name;
    int32_t align, hypotheses;
    bench_virtual_field field;
    double sigma; /* m, of the field at its start */
} bench_virtual_method;

/* Sensor and pose errors of a scene. */
typedef struct bench_virtual_scene {
    const char *name;
    sim_scene scene;
    int32_t places, headings;
    double fov, metres, degrees;
} bench_virtual_scene;

typedef struct bench_virtual_problem {
    sim_arena *arena;
    sim_survey *survey;
    const sim_scan *scans;
    sim_pose *truth, *start, *result;
    bench_false_rectangle *lie; /* reported hypothesis; NULL: none */
    int32_t accepted;           /* a false hypothesis was accepted at step 15 or later */
    int32_t *use;               /* [count] observable by the bound */
    int32_t count, observable;
} bench_virtual_problem;

/* Sums over the seeds of a row. */
typedef struct bench_virtual_row {
    int32_t seeds, right, scans, observable, aligned, iterations, active, moved;
    double seconds, squares, hits;
    int64_t align_units, hypothesis_units, field_units;
    size_t pool_bytes;
} bench_virtual_row;

/* Uniform in +-metres and +-degrees. */
void bench_virtual_disturb(sim_pose *pose, cairn_random *random, double metres, double degrees);

/* Surveys the scene's arena of a seed, and disturbs the starts. 0: a line on standard error; to
 * be closed in any case. */
int bench_virtual_open(const bench_virtual_scene *from, uint64_t seed, bench_virtual_problem *p);
void bench_virtual_close(bench_virtual_problem *p);

/* Aligns the problem's scans and adds to the row; prints_steps: prints every virtual scan. 0: a
 * line on standard error. */
int bench_virtual_run(bench_virtual_problem *p, const bench_virtual_method *m, int32_t prints_steps,
                      bench_virtual_row *out);

/* Scans of the result that lie within `metres` and 1 degree after the best common motion. */
int32_t bench_virtual_score(const bench_virtual_problem *p, double metres);

#endif
