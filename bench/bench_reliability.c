#include "bench/bench_reliability.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "bench/bench_json.h"
#include "cairn/detection_curve.h"

/* Upper bounds of the bins. */
static const double BOUNDS[BENCH_RELIABILITY_BINS] = {0.001, 0.01, 0.03, 0.1, 0.3, 0.7, 0.99, 1};

/* Least probability that the loss is computed of, of either outcome. */
static const double LEAST = 1e-6;

void bench_reliability_add(bench_reliability *r, double probability, int wrong)
{
    double p = fmin(fmax(probability, LEAST), 1 - LEAST);
    int bin = 0;

    while (bin < BENCH_RELIABILITY_BINS - 1 && probability > BOUNDS[bin])
        bin++;
    r->count[bin]++;
    r->wrong[bin] += wrong != 0;
    r->stated[bin] += probability;
    r->loss -= log(wrong ? p : 1 - p);
    r->sure += probability <= BENCH_SURE;
    r->sure_wrong += probability <= BENCH_SURE && wrong;
    r->denied += probability >= 1 - BENCH_SURE;
    r->denied_wrong += probability >= 1 - BENCH_SURE && wrong;
}

/* Share of wrong decisions, and its interval of 95 %. */
static double share_of(int64_t wrong, int64_t count, cairn_real *low, cairn_real *high)
{
    cairn_real share = count > 0 ? (cairn_real)wrong / (cairn_real)count : 0;

    cairn_detection_curve_interval(share, (int32_t)count, low, high);
    return count > 0 ? (double)share : (double)NAN;
}

static void print_share(int64_t wrong, int64_t count)
{
    cairn_real low, high;
    double share = share_of(wrong, count, &low, &high);

    bench_json_integer("decisions", count);
    bench_json_integer("wrong", wrong);
    bench_json_number("wrong_share", share);
    bench_json_number("low", (double)low);
    bench_json_number("high", (double)high);
}

void bench_reliability_print(const char *bench, const char *name, const bench_reliability *r)
{
    int64_t count = 0, wrong = 0;
    double difference = 0;

    for (int bin = 0; bin < BENCH_RELIABILITY_BINS; bin++) {
        if (r->count[bin] == 0)
            continue;
        count += r->count[bin];
        wrong += r->wrong[bin];
        difference += fabs(r->stated[bin] - (double)r->wrong[bin]);
        bench_json_begin(bench);
        bench_json_text("reliability", name);
        bench_json_number("up_to", BOUNDS[bin]);
        bench_json_number("stated", r->stated[bin] / (double)r->count[bin]);
        print_share(r->wrong[bin], r->count[bin]);
        bench_json_end();
    }
    bench_json_begin(bench);
    bench_json_text("reliability", name);
    print_share(wrong, count);
    bench_json_number("log_loss", r->loss / (double)(count > 0 ? count : 1));
    bench_json_number("calibration_error", difference / (double)(count > 0 ? count : 1));
    bench_json_integer("sure", r->sure);
    bench_json_integer("sure_wrong", r->sure_wrong);
    bench_json_integer("denied", r->denied);
    bench_json_integer("denied_wrong", r->denied_wrong);
    bench_json_number("decided_share",
                      (double)(r->sure + r->denied) / (double)(count > 0 ? count : 1));
    bench_json_true("summary");
    bench_json_end();
}

void bench_reliability_table(const bench_reliability *r)
{
    printf("| stated, up to | decisions | stated, mean | wrong | share wrong | 95 %% |\n"
           "|---|---|---|---|---|---|\n");
    for (int bin = 0; bin < BENCH_RELIABILITY_BINS; bin++) {
        cairn_real low, high;
        double share = share_of(r->wrong[bin], r->count[bin], &low, &high);

        if (r->count[bin] > 0)
            printf("| %g | %" PRId64 " | %.4f | %" PRId64 " | %.4f | %.4f to %.4f |\n", BOUNDS[bin],
                   r->count[bin], r->stated[bin] / (double)r->count[bin], r->wrong[bin], share,
                   (double)low, (double)high);
    }
}
