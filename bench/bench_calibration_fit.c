#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_calibration_fit.h"
#include "bench/bench_json.h"
#include "bench/bench_reliability.h"

enum { LINE_BYTES = 1024 };

/* Steps of the search for constants. */
static const double FIRST_STEP = 1, LAST_STEP = 0.005;

/* The number after a key of a line; NaN when it has no such key. */
static double number_of(const char *line, const char *key)
{
    char quoted[32];
    const char *at;

    snprintf(quoted, sizeof quoted, "\"%s\": ", key);
    at = strstr(line, quoted);
    return at != NULL ? strtod(at + strlen(quoted), NULL) : (double)NAN;
}

static int append(bench_decisions *all, bench_decision d)
{
    if (all->count == all->capacity) {
        size_t capacity = 2 * all->capacity + 1024;
        bench_decision *list = realloc(all->list, capacity * sizeof *list);

        if (list == NULL)
            return 0;
        all->list = list;
        all->capacity = capacity;
    }
    all->list[all->count++] = d;
    return 1;
}

static int read_decisions(bench_decisions *all)
{
    char line[LINE_BYTES];

    while (fgets(line, sizeof line, stdin) != NULL) {
        double seed = number_of(line, "decision");
        bench_decision d = {
            .stated = number_of(line, "wrong_probability"),
            .evidence = {.support = fmax(number_of(line, "support"), 0),
                         .competing = fmax(number_of(line, "competing"), 0),
                         .link_support = fmax(number_of(line, "link_support"), 0),
                         .is_ambiguous = number_of(line, "ambiguous") > 0,
                         .path_sigma = number_of(line, "path_sigma"),
                         .prior_distance = number_of(line, "prior_distance"),
                         .competing_score = number_of(line, "competing_score"),
                         .free_space_violation = number_of(line, "free_space_violation")},
            .wrong = number_of(line, "wrong") > 0};

        if (isnan(seed))
            continue;
        d.seed = (int64_t)seed;
        if (!append(all, d))
            return 0;
    }
    return all->count > 0;
}

double bench_calibration_loss(const bench_calibration_model *model, const bench_decisions *all,
                              const double *constants, int64_t *sure)
{
    double loss = 0;
    int64_t count = 0;

    for (size_t i = 0; i < all->count; i++)
        if (all->list[i].seed % 2 == 0) {
            double p = model->probability(&all->list[i].evidence, constants);

            loss -= log(all->list[i].wrong ? p : 1 - p);
            count += p <= BENCH_SURE;
        }
    if (sure != NULL)
        *sure = count;
    return loss;
}

void bench_calibration_search(const bench_calibration_model *model, const bench_decisions *all,
                              double *constants)
{
    double least = bench_calibration_loss(model, all, constants, NULL);

    for (double step = FIRST_STEP; step >= LAST_STEP;) {
        int moved = 0;

        for (int32_t i = 0; i < 2 * model->constants; i++) {
            double before = constants[i / 2], loss;

            constants[i / 2] += i % 2 == 0 ? step : -step;
            loss = bench_calibration_loss(model, all, constants, NULL);
            if (loss < least) {
                least = loss;
                moved = 1;
            } else {
                constants[i / 2] = before;
            }
        }
        if (!moved)
            step /= 2;
    }
}

enum { STATED, LIBRARY, FITTED };

static double probability_by(const bench_calibration_model *model, const bench_decision *d, int by,
                             const double *constants)
{
    if (by == STATED)
        return d->stated;
    return by == LIBRARY
               ? model->stated(&d->evidence)
               : fmax(model->probability(&d->evidence, constants), BENCH_LEAST_PROBABILITY);
}

static bench_reliability reliability_of(const bench_calibration_model *model,
                                        const bench_decisions *all, int fold, int by,
                                        const double *constants)
{
    bench_reliability r;

    memset(&r, 0, sizeof r);
    for (size_t i = 0; i < all->count; i++)
        if (all->list[i].seed % 2 == fold)
            bench_reliability_add(&r, probability_by(model, &all->list[i], by, constants),
                                  all->list[i].wrong);
    return r;
}

static void print_fit(const bench_calibration_model *model, const bench_decisions *all,
                      const double *constants)
{
    static const char *const names[][2] = {{"stated, even seeds", "stated, odd seeds"},
                                           {"library, even seeds", "library, odd seeds"},
                                           {"fitted, even seeds", "fitted, odd seeds"}};

    bench_json_begin(model->bench);
    bench_json_integer("decisions", (int64_t)all->count);
    for (int32_t i = 0; i < model->constants; i++)
        bench_json_number(model->names[i], constants[i]);
    bench_json_end();
    for (int by = STATED; by <= FITTED; by++)
        for (int fold = 0; fold < 2; fold++) {
            bench_reliability r = reliability_of(model, all, fold, by, constants);

            bench_reliability_print(model->bench, names[by][fold], &r);
        }
}

int bench_calibration_fit(const bench_calibration_model *model, int markdown)
{
    bench_decisions all = {NULL, 0, 0};
    int done = read_decisions(&all);

    if (done && markdown) {
        bench_reliability odd = reliability_of(model, &all, 1, LIBRARY, NULL);

        bench_reliability_table(&odd);
    } else if (done) {
        double constants[BENCH_CONSTANTS];

        model->fit(model, &all, constants);
        print_fit(model, &all, constants);
    } else {
        fprintf(stderr,
                "bench/%s: no decisions on standard input, expected lines of --calibration\n",
                model->bench);
    }
    free(all.list);
    return done ? 0 : 1;
}
