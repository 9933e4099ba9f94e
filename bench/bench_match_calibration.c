/* bench/match --calibration: whether the error probabilities of places are true, on generated arenas
 * with people and with places of other arenas. */
#include "bench/bench_match.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_reliability.h"
#include "cairn/random.h"
#include "src/alignment/place_map_work.h"

/* Scenes, and their shares in eighths. */
enum { SHARES = 8 };
static const char *const scene_of_share[SHARES] = {"rescue",    "rescue", "rescue", "maze",
                                                   "apartment", "office", "rooms",  "twins"};

/* Scenes whose arenas all have the same floor plan, so that none is unrelated. */
static const char *const ONE_PLAN[] = {"rooms", "twins"};

/* nats: printed for a place that no cut separates from most others */
static const double MOST_NATS = 1e6;

/* Numbers of places, shares of people in view, and of places of another arena: each as likely. */
enum { SIZES = 4, MOVER_SHARES = 4, OTHERS = 4 };
static const int32_t sizes[SIZES] = {6, 8, 10, 12};
static const double mover_shares[MOVER_SHARES] = {0, 0, .1, .2}, others[OTHERS] = {0, 0, .2, .45};

static int has_one_plan(const char *scene)
{
    return strcmp(scene, ONE_PLAN[0]) == 0 || strcmp(scene, ONE_PLAN[1]) == 0;
}

static bench_match_settings settings_of(uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 77);
    bench_match_settings s = {.arenas = 1, .seed = (int64_t)seed};

    s.scene = scene_of_share[cairn_random_below(&random, SHARES)];
    s.places = sizes[cairn_random_below(&random, SIZES)];
    s.movers = mover_shares[cairn_random_below(&random, MOVER_SHARES)];
    s.unrelated = (int32_t)(others[cairn_random_below(&random, OTHERS)] * (double)s.places);
    if (has_one_plan(s.scene))
        s.unrelated = 0;
    return s;
}

static void print_decision(const bench_match_settings *s, const cairn_place_map *map, int32_t i,
                           const cairn_place_map_place *place, int wrong)
{
    bench_json_begin("match");
    bench_json_integer("decision", s->seed);
    bench_json_integer("place", i);
    bench_json_text("scene", s->scene);
    bench_json_integer("places", s->places);
    bench_json_number("movers", s->movers);
    bench_json_integer("strangers", s->unrelated);
    bench_json_integer("wrong", wrong);
    bench_json_number("wrong_probability", (double)place->error_probability);
    bench_json_number("support", (double)place->support);
    bench_json_number("competing", (double)cairn_place_map_competing_support(map, i));
    bench_json_number("link_support", fmin((double)place->link_support, MOST_NATS));
    bench_json_integer("ambiguous", cairn_pose_consensus_node(map->consensus, i).ambiguous);
    bench_json_integer("reported", place->ambiguous);
    bench_json_end();
}

int bench_match_print_decisions(const bench_match_settings *s, const bench_match_problem *p,
                                const bench_match_machine *m, bench_reliability *odd)
{
    size_t n = (size_t)p->place_count;
    sim_pose *places = malloc(n * sizeof *places);
    int32_t *use = malloc(n * sizeof *use), used = 0;
    int done = places != NULL && use != NULL;

    for (int32_t i = 0; i < p->place_count && done; i++) {
        cairn_place_map_place place = cairn_place_map_place_of(m->map, i);

        places[i] = bench_sim_pose(place.map_place);
        use[i] = place.component == 0;
        used += use[i];
    }
    if (used > 1)
        (void)bench_fit_common(p->frame, places, use, p->place_count, BENCH_RIGHT_M,
                               BENCH_RIGHT_RAD, places);
    for (int32_t i = 0; i < p->place_count && used > 1; i++) {
        cairn_place_map_place place = cairn_place_map_place_of(m->map, i);
        int wrong = !bench_pose_near(p->frame[i], places[i], BENCH_RIGHT_M, BENCH_RIGHT_RAD);

        if (!use[i])
            continue;
        print_decision(s, m->map, i, &place, wrong);
        if (odd != NULL && s->seed % 2 != 0)
            bench_reliability_add(odd, (double)place.error_probability, wrong);
    }
    free(places);
    free(use);
    return done;
}

static int run_arena(uint64_t seed, bench_reliability *odd)
{
    bench_match_settings s = settings_of(seed);
    cairn_place_map_params params = cairn_place_map_default();
    bench_match_machine m = {NULL, 0, NULL, NULL};
    bench_match_problem p;
    int done = 0;

    params.max_places = (int32_t)s.places;
    params.max_scans = BENCH_MATCH_HEADINGS * (int32_t)s.places;
    if (!bench_match_make(&s, seed, &p))
        return 0;
    if (bench_match_machine_make(&params, &m))
        done = bench_match_map(&p, &m) && bench_match_print_decisions(&s, &p, &m, odd);
    free(m.memory);
    bench_match_free(&p);
    return done;
}

int bench_match_calibrate(int64_t arenas, int64_t seed)
{
    bench_reliability odd;

    memset(&odd, 0, sizeof odd);
    for (int64_t i = 0; i < arenas; i++)
        if (!run_arena((uint64_t)(seed + i), &odd))
            return 1;
    bench_reliability_print("match", "odd seeds", &odd);
    return 0;
}

/* ---- Fit ---- */

/* A place is wrong by chance, because of a competing pose, or where the consensus reports it as
 * ambiguous. The odds of the three add: exp (chance_log_odds - link support / chance_nats) + exp
 * (competing_log_odds) ((SHARED_NATS + competing) / (SHARED_NATS + support))^competing_exponent +
 * ambiguous_odds. */
enum {
    CHANCE_LOG_ODDS,
    CHANCE_NATS,
    COMPETING_LOG_ODDS,
    COMPETING_EXPONENT,
    AMBIGUOUS_LOG_ODDS,
    CONSTANTS
};

static const double SHARED_NATS = (double)PLACE_MAP_SHARED_NATS;

static double stated_of_place(const bench_evidence *e)
{
    return (double)cairn_place_map_error_probability((cairn_real)e->support,
                                                     (cairn_real)e->competing,
                                                     (cairn_real)e->link_support, e->is_ambiguous);
}

static double probability_of_place(const bench_evidence *e, const double *c)
{
    double by_chance = exp(c[CHANCE_LOG_ODDS] - e->link_support / c[CHANCE_NATS]);
    double by_competing =
        exp(c[COMPETING_LOG_ODDS] +
            c[COMPETING_EXPONENT] * log((SHARED_NATS + e->competing) / (SHARED_NATS + e->support)));
    double odds = by_chance + by_competing + (e->is_ambiguous ? exp(c[AMBIGUOUS_LOG_ODDS]) : 0);

    return c[CHANCE_NATS] > 0
               ? fmin(fmax(odds / (1 + odds), BENCH_LEAST_PROBABILITY), 1 - BENCH_LEAST_PROBABILITY)
               : (double)NAN;
}

static void fit_places(const bench_calibration_model *model, const bench_decisions *all,
                       double *constants)
{
    static const double start[CONSTANTS] = {2, 8, 0, 2, -1};

    memcpy(constants, start, sizeof start);
    bench_calibration_search(model, all, constants);
}

bench_calibration_model bench_calibration_of_places(void)
{
    bench_calibration_model model = {.bench = "match",
                                     .constants = CONSTANTS,
                                     .names = {"chance_log_odds", "chance_nats",
                                               "competing_log_odds", "competing_exponent",
                                               "ambiguous_log_odds"},
                                     .stated = stated_of_place,
                                     .probability = probability_of_place,
                                     .fit = fit_places};

    return model;
}
