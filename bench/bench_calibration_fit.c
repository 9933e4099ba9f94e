/* Fit of a logistic model with one feature: log odds = offset + exponent log ((chance + competing)
 * / (chance + support) + chance / (chance + link support)); the second ratio is 0 for decisions
 * without links. Decisions on what is ambiguous have an offset of their own.
 *
 * Chance and exponent are tried on a grid, with the best offsets of each by Newton's method. Of those
 * in the 95 % confidence region of the fit the one is taken by which most decisions are sure. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_calibration_fit.h"
#include "bench/bench_json.h"
#include "bench/bench_reliability.h"

enum { NEWTON_STEPS = 30, LINE_BYTES = 1024 };

/* nats: values of `chance` that are tried; exponents from the least by steps */
static const double CHANCES[] = {0.5, 1, 1.5, 2, 2.5, 3, 4, 5, 7, 10, 15, 20};
static const double LEAST_EXPONENT = 1, EXPONENT_STEP = 0.1;
enum { EXPONENTS = 70, GROUPS = 2 };

/* nats: half of the 95 % quantile of chi squared with one degree of freedom, of the profile */
static const double REGION_NATS = 1.92;

static const double LEAST_PROBABILITY = 1e-3;

typedef struct decision {
    int64_t seed;
    double stated;
    bench_evidence evidence;
    int32_t wrong;
} decision;

typedef struct decisions {
    decision *list;
    size_t count, capacity;
} decisions;

typedef struct weights {
    double chance, exponent, offset[GROUPS];
} weights;

/* The number after a key of a line; NaN when it has no such key. */
static double number_of(const char *line, const char *key)
{
    char quoted[32];
    const char *at;

    snprintf(quoted, sizeof quoted, "\"%s\": ", key);
    at = strstr(line, quoted);
    return at != NULL ? strtod(at + strlen(quoted), NULL) : (double)NAN;
}

static int append(decisions *all, decision d)
{
    if (all->count == all->capacity) {
        size_t capacity = 2 * all->capacity + 1024;
        decision *list = realloc(all->list, capacity * sizeof *list);

        if (list == NULL)
            return 0;
        all->list = list;
        all->capacity = capacity;
    }
    all->list[all->count++] = d;
    return 1;
}

static int read_decisions(decisions *all)
{
    char line[LINE_BYTES];

    while (fgets(line, sizeof line, stdin) != NULL) {
        double seed = number_of(line, "decision");
        decision d = {.stated = number_of(line, "wrong_probability"),
                      .evidence = {.support = fmax(number_of(line, "support"), 0),
                                   .competing = fmax(number_of(line, "competing"), 0),
                                   .link_support = number_of(line, "link_support"),
                                   .is_ambiguous = number_of(line, "ambiguous") > 0},
                      .wrong = number_of(line, "wrong") > 0};

        if (isnan(seed))
            continue;
        d.seed = (int64_t)seed;
        d.evidence.link_support =
            isnan(d.evidence.link_support) ? HUGE_VAL : fmax(d.evidence.link_support, 0);
        if (!append(all, d))
            return 0;
    }
    return all->count > 0;
}

static double feature_of(const bench_evidence *e, double chance)
{
    return log((chance + e->competing) / (chance + e->support) +
               chance / (chance + e->link_support));
}

static double probability_of(const decision *d, const weights *w)
{
    return 1 / (1 + exp(-w->offset[d->evidence.is_ambiguous] -
                        w->exponent * feature_of(&d->evidence, w->chance)));
}

/* Sum of the logarithmic losses of even seeds; *sure: how many of them are sure. */
static double loss_of(const decisions *all, const weights *w, int64_t *sure)
{
    double loss = 0;

    *sure = 0;
    for (size_t i = 0; i < all->count; i++)
        if (all->list[i].seed % 2 == 0) {
            double p = probability_of(&all->list[i], w);

            loss -= log(all->list[i].wrong ? p : 1 - p);
            *sure += p <= BENCH_SURE;
        }
    return loss;
}

/* The offsets of the least loss of even seeds. */
static weights fit_offsets(const decisions *all, double chance, double exponent)
{
    weights w = {chance, exponent, {0, 0}};

    for (int step = 0; step < NEWTON_STEPS; step++) {
        double slope[GROUPS] = {0, 0}, bend[GROUPS] = {1e-9, 1e-9};

        for (size_t i = 0; i < all->count; i++)
            if (all->list[i].seed % 2 == 0) {
                const decision *d = &all->list[i];
                int32_t group = d->evidence.is_ambiguous;
                double p = probability_of(d, &w);

                slope[group] += p - d->wrong;
                bend[group] += p * (1 - p);
            }
        for (int group = 0; group < GROUPS; group++)
            w.offset[group] -= fmin(fmax(slope[group] / bend[group], -1), 1);
    }
    return w;
}

static weights fit(const decisions *all)
{
    const size_t chances = sizeof CHANCES / sizeof *CHANCES;
    weights best = {0, 0, {0, 0}};
    double least = HUGE_VAL;
    int64_t most = -1;

    for (int pass = 0; pass < 2; pass++)
        for (size_t i = 0; i < chances; i++)
            for (int k = 0; k < EXPONENTS; k++) {
                weights w = fit_offsets(all, CHANCES[i], LEAST_EXPONENT + k * EXPONENT_STEP);
                int64_t sure;
                double loss = loss_of(all, &w, &sure);

                if (pass == 0) {
                    least = fmin(least, loss);
                } else if (loss <= least + REGION_NATS && sure > most) {
                    most = sure;
                    best = w;
                }
            }
    return best;
}

enum { STATED, LIBRARY, FITTED };

static double probability_by(const bench_calibration_kind *kind, const decision *d, int by,
                             const weights *w)
{
    if (by == STATED)
        return d->stated;
    return by == LIBRARY ? kind->probability(&d->evidence)
                         : fmax(probability_of(d, w), LEAST_PROBABILITY);
}

static bench_reliability reliability_of(const bench_calibration_kind *kind, const decisions *all,
                                        int fold, int by, const weights *w)
{
    bench_reliability r;

    memset(&r, 0, sizeof r);
    for (size_t i = 0; i < all->count; i++)
        if (all->list[i].seed % 2 == fold)
            bench_reliability_add(&r, probability_by(kind, &all->list[i], by, w),
                                  all->list[i].wrong);
    return r;
}

int bench_calibration_fit(const bench_calibration_kind *kind, int markdown)
{
    static const char *const names[][2] = {{"stated, even seeds", "stated, odd seeds"},
                                           {"library, even seeds", "library, odd seeds"},
                                           {"fitted, even seeds", "fitted, odd seeds"}};
    decisions all = {NULL, 0, 0};
    int done = read_decisions(&all);

    if (done) {
        weights w = fit(&all);
        bench_reliability odd = reliability_of(kind, &all, 1, LIBRARY, &w);

        if (markdown) {
            bench_reliability_table(&odd);
        } else {
            bench_json_begin(kind->bench);
            bench_json_integer("decisions", (int64_t)all.count);
            bench_json_number("chance_nats", w.chance);
            bench_json_number("exponent", w.exponent);
            bench_json_number("log_odds", w.offset[0]);
            bench_json_number("ambiguous_log_odds", w.offset[1]);
            bench_json_end();
            for (int by = STATED; by <= FITTED; by++)
                for (int fold = 0; fold < 2; fold++) {
                    bench_reliability r = reliability_of(kind, &all, fold, by, &w);

                    bench_reliability_print(kind->bench, names[by][fold], &r);
                }
        }
    } else {
        fprintf(stderr,
                "bench/%s: no decisions on standard input, expected lines of --calibration\n",
                kind->bench);
    }
    free(all.list);
    return done ? 0 : 1;
}
