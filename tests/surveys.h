/* Arenas and surveys of the simulation for tests. All that a test makes is freed by its teardown,
 * surveys_free. */
#ifndef CAIRN_TESTS_SURVEYS_H
#define CAIRN_TESTS_SURVEYS_H

#include <math.h>

#include "sim/arena.h"
#include "tests/test.h"

enum { SURVEYS_MOST = 200 };

static sim_arena *surveys_arenas[SURVEYS_MOST];
static sim_survey *surveys_made[SURVEYS_MOST];
static int32_t surveys_arena_count, surveys_count;

static inline int surveys_free(void **state)
{
    (void)state;
    while (surveys_count > 0)
        sim_survey_free(surveys_made[--surveys_count]);
    while (surveys_arena_count > 0)
        sim_arena_free(surveys_arenas[--surveys_arena_count]);
    return 0;
}

static inline sim_arena *arena_with(const sim_arena_options *options)
{
    char fault[200] = "";
    sim_arena *arena = sim_arena_create(options, fault, sizeof fault);

    assert_string_equal(fault, "");
    assert_non_null(arena);
    assert_in_range(surveys_arena_count, 0, SURVEYS_MOST - 1);
    return surveys_arenas[surveys_arena_count++] = arena;
}

/* turn: rad, of the whole arena; NaN: drawn by the seed. */
static inline sim_arena *turned_arena_of(sim_scene scene, uint64_t seed, double turn)
{
    sim_arena_options options = sim_arena_default();

    options.scene = scene;
    options.seed = seed;
    options.turn = turn;
    return arena_with(&options);
}

static inline sim_arena *arena_of(sim_scene scene, uint64_t seed)
{
    return turned_arena_of(scene, seed, sim_arena_default().turn);
}

static inline sim_survey *surveys_keep(sim_survey *survey, const char *fault)
{
    assert_string_equal(fault, "");
    assert_non_null(survey);
    assert_in_range(surveys_count, 0, SURVEYS_MOST - 1);
    return surveys_made[surveys_count++] = survey;
}

static inline sim_survey *survey_of(const sim_arena *arena, const sim_survey_options *options)
{
    char fault[200] = "";

    return surveys_keep(sim_survey_create(arena, options, fault, sizeof fault), fault);
}

/* A survey from given poses, at a speed of m/s and a turn rate of rad/s. */
static inline sim_survey *survey_at(const sim_arena *arena, const sim_survey_options *options,
                                    const sim_pose *poses, int32_t count, double speed,
                                    double turn_rate)
{
    char fault[200] = "";

    return surveys_keep(
        sim_survey_at(arena, options, poses, count, speed, turn_rate, fault, sizeof fault), fault);
}

/* The scans of a survey with these options. */
static inline const sim_scan *scans_of(const sim_arena *arena, const sim_survey_options *options,
                                       int32_t *count)
{
    return sim_survey_scans(survey_of(arena, options), count);
}

/* Fails unless a beam has the same return in both scans. */
static inline void assert_same_return(const sim_scan *a, const sim_scan *b, int32_t beam)
{
    assert_int_equal(b->edge[beam], a->edge[beam]);
    assert_memory_equal(&b->range[beam], &a->range[beam], sizeof(float));
}

#endif
