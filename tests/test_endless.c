/* A robot that drives endless laps in fixed memory, for a few laps. */
#include "bench/bench_endless.h"
#include "tests/test.h"

enum { LAPS = 7 };

typedef struct laps {
    bench_endless_lap lap[LAPS];
    int32_t count;
} laps;

static void keep(void *context, const bench_endless_lap *lap)
{
    laps *l = context;

    assert_true(l->count < LAPS);
    l->lap[l->count++] = *lap;
}

static void laps_are_all_alike(void **state)
{
    bench_endless_options options = bench_endless_default();
    int32_t released = 0, oldest = 0, newest = 0;
    laps l = {.count = 0};

    (void)state;
    options.places = 24;
    options.kept = 30;
    options.scans = (int64_t)LAPS * options.places;
    assert_true(bench_endless_run(&options, keep, &l));
    assert_int_equal(l.count, LAPS);
    for (int32_t i = 0; i < LAPS; i++) {
        const bench_endless_lap *lap = &l.lap[i];

        assert_int_equal(lap->scans, options.places);
        assert_int_equal(lap->pool_used, l.lap[0].pool_used);
        assert_int_equal(lap->is_first, i == 2);
        assert_true(lap->kept <= options.kept);
        released += lap->released;
        oldest += lap->oldest;
        newest += lap->newest;
        if (i < 2)
            continue;
        assert_int_equal(lap->kept, options.kept);
        assert_int_equal(lap->released, options.places);
        assert_true(lap->units < 11 * l.lap[2].units / 10);
        assert_true(lap->mean < 0.06 && lap->away < 0.05);
    }
    /* As many scans are removed as arrive, and age does not decide. */
    assert_int_equal(released, LAPS * options.places - options.kept);
    assert_true(oldest < released / 4 && newest < released);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(laps_are_all_alike)};

    return cmocka_run_group_tests(tests, NULL, NULL);
}
