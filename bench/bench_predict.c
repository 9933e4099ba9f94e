/* Spearman's rank correlation with confidence intervals by bootstrap over the arenas. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "bench/bench_json.h"
#include "bench/bench_predict.h"
#include "cairn/random.h"

enum { DRAWS = 1000, MIN_MAPS = 6 };

typedef struct ranked {
    double value, rank;
    int32_t place;
} ranked;

static int compare_ranked(const void *a, const void *b)
{
    const ranked *x = a, *y = b;

    if (x->value != y->value)
        return x->value < y->value ? -1 : 1;
    return (x->place > y->place) - (x->place < y->place);
}

/* Ranks of values, equal ones with their mean rank. work: [count] */
static void rank(const double *values, int32_t count, ranked *work, double *ranks)
{
    for (int32_t i = 0; i < count; i++) {
        work[i].value = values[i];
        work[i].place = i;
    }
    qsort(work, (size_t)count, sizeof *work, compare_ranked);
    for (int32_t i = 0, end; i < count; i = end) {
        for (end = i + 1; end < count && work[end].value == work[i].value; end++) {
        }
        for (int32_t k = i; k < end; k++)
            ranks[work[k].place] = (i + end - 1) / 2.0;
    }
}

/* Pearson's correlation; NaN when one of them is constant. */
static double correlation(const double *a, const double *b, int32_t count)
{
    double mean_a = 0, mean_b = 0, ab = 0, aa = 0, bb = 0;

    for (int32_t i = 0; i < count; i++) {
        mean_a += a[i] / count;
        mean_b += b[i] / count;
    }
    for (int32_t i = 0; i < count; i++) {
        ab += (a[i] - mean_a) * (b[i] - mean_b);
        aa += (a[i] - mean_a) * (a[i] - mean_a);
        bb += (b[i] - mean_b) * (b[i] - mean_b);
    }
    return aa > 0 && bb > 0 ? ab / sqrt(aa * bb) : (double)NAN;
}

/* Memory for the maps of one step. */
typedef struct ranking {
    double *measure, *error, *measure_rank, *error_rank;
    ranked *work;
} ranking;

static int open_ranking(ranking *r, int32_t maps)
{
    size_t n = (size_t)maps;

    r->measure = malloc(4 * n * sizeof *r->measure);
    r->work = malloc(n * sizeof *r->work);
    if (r->measure == NULL || r->work == NULL)
        return 0;
    r->error = r->measure + n;
    r->measure_rank = r->error + n;
    r->error_rank = r->measure_rank + n;
    return 1;
}

static void close_ranking(ranking *r)
{
    free(r->measure);
    free(r->work);
}

/* The mean of the steps' rank correlations over the arenas named in drawn [arenas]. */
static double predict(const bench_predict_maps *all, const int32_t *drawn, ranking *r,
                      int64_t *maps)
{
    double sum = 0;

    *maps = 0;
    for (int32_t k = 0; k < all->steps; k++) {
        int32_t count = 0;
        double rho;

        for (int32_t a = 0; a < all->arenas; a++)
            for (int32_t m = 0; m < all->methods; m++) {
                size_t map =
                    ((size_t)drawn[a] * (size_t)all->methods + (size_t)m) * (size_t)all->steps +
                    (size_t)k;

                if (!(all->error[map] < all->good))
                    continue;
                r->measure[count] = all->measure[map];
                r->error[count++] = all->error[map];
            }
        if (count < MIN_MAPS)
            continue;
        rank(r->measure, count, r->work, r->measure_rank);
        rank(r->error, count, r->work, r->error_rank);
        rho = correlation(r->measure_rank, r->error_rank, count);
        if (!isfinite(rho))
            continue;
        sum += count * rho;
        *maps += count;
    }
    return *maps > 0 ? sum / (double)*maps : (double)NAN;
}

int bench_predict(const bench_predict_maps *all, uint64_t seed, bench_prediction *p)
{
    cairn_random random = cairn_random_seed(seed, 80);
    int32_t *drawn = malloc((size_t)all->arenas * sizeof *drawn), count = 0;
    ranking r = {NULL, NULL, NULL, NULL, NULL};
    double rho[DRAWS];
    int64_t maps;
    int done = drawn != NULL && open_ranking(&r, all->arenas * all->methods);

    p->low = p->high = (double)NAN;
    for (int32_t a = 0; a < all->arenas && done; a++)
        drawn[a] = a;
    if (done)
        p->rho = predict(all, drawn, &r, &p->maps);
    for (int32_t d = 0; d < DRAWS && done; d++) {
        for (int32_t a = 0; a < all->arenas; a++)
            drawn[a] = cairn_random_below(&random, all->arenas);
        rho[count] = predict(all, drawn, &r, &maps);
        count += isfinite(rho[count]);
    }
    if (done && count >= DRAWS / 2) {
        bench_sort(rho, (size_t)count);
        p->low = rho[(int32_t)(0.025 * count)];
        p->high = rho[(int32_t)(0.975 * (count - 1))];
    }
    close_ranking(&r);
    free(drawn);
    return done;
}

void bench_predict_print(const char *name, const bench_prediction *p)
{
    char key[64];

    snprintf(key, sizeof key, "%s_rank_correlation", name);
    bench_json_number(key, p->rho);
    snprintf(key, sizeof key, "%s_rank_correlation_low", name);
    bench_json_number(key, p->low);
    snprintf(key, sizeof key, "%s_rank_correlation_high", name);
    bench_json_number(key, p->high);
}
