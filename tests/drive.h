/* Drives through arenas of the simulation, and mappers for them. */
#ifndef CAIRN_TESTS_DRIVE_H
#define CAIRN_TESTS_DRIVE_H

#include "cairn/mapper.h"
#include "sim/arena.h"
#include "tests/test.h"

/* A robot that drives through an arena. */
typedef struct drive {
    sim_arena *arena;
    sim_survey *survey;
    const sim_scan *scans;
    int32_t count;
} drive;

/* Distance and turn between scans, m and rad. */
static inline drive start_drive(sim_scene scene, uint64_t seed, int32_t scans, double bias,
                                double every)
{
    sim_arena_options arena = sim_arena_default();
    sim_survey_options survey = sim_survey_default();
    char fault[256] = "";
    drive d;

    arena.scene = scene;
    arena.seed = seed;
    survey.seed = seed;
    survey.drive = scans;
    survey.beams = 181;
    survey.fov = 3.14159265;
    survey.bias_drift = bias;
    survey.drive_distance = every;
    survey.drive_turn = every;
    d.arena = sim_arena_create(&arena, fault, sizeof fault);
    assert_non_null(d.arena);
    d.survey = sim_survey_create(d.arena, &survey, fault, sizeof fault);
    assert_non_null(d.survey);
    d.scans = sim_survey_scans(d.survey, &d.count);
    assert_int_equal(d.count, scans);
    return d;
}

static inline void end_drive(drive *d)
{
    sim_survey_free(d->survey);
    sim_arena_free(d->arena);
}

static inline cairn_pose pose_of(sim_pose p)
{
    cairn_pose pose = {(cairn_real)p.x, (cairn_real)p.y, (cairn_real)p.theta};

    return pose;
}

static inline cairn_mapper_params small_params(void)
{
    cairn_mapper_params params = cairn_mapper_default();

    params.scan.max_beams = 181;
    params.scan.max_points = 400;
    params.scan.max_segments = 64;
    params.max_keyframes = 200;
    params.max_keyframe_points = 40000;
    params.max_keyframe_segments = 8000;
    return params;
}

static inline cairn_mapper *new_mapper(cairn_pool *pool, const cairn_mapper_params *params)
{
    cairn_mapper *mapper;

    *pool = test_pool(cairn_mapper_memory(params));
    assert_ok(cairn_mapper_create(&mapper, pool, params));
    return mapper;
}

#endif
