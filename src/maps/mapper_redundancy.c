/* Redundancy scores of keyframes: which keyframe can be culled with the least loss of coverage?
 *
 * Method.
 *
 * 1. Every fourth bearing of a keyframe's visibility profile gives two samples: the surface point
 *    at the end of the free range, and a free-space point at half of it.
 * 2. Another keyframe observes a sample when its own profile is free there, or has a surface within
 *    SURFACE_TOLERANCE_M along that bearing.
 * 3. Score = sum over the samples of 1 / (1 + n), where n of the nearest earlier keyframes observe
 *    the sample. The keyframe of the least score is the most redundant.
 *
 * Only earlier keyframes count. Of two that show the same, the older one stays, because the map was
 * built from it: a robot that repeats a route is always matched against the first round.
 *
 * Layout: scores are cached until keyframes move or one of their observers is culled.
 *
 * Limits: outdated views of a changed environment stay beside current ones as long as memory
 * lasts. */
#include "src/base/build.h"

#include <string.h>

#include "src/base/step.h"
#include "src/maps/mapper_work.h"

enum {
    BIN_STEP = CAIRN_VISIBILITY_BINS / (MAPPER_SAMPLES / 2),
    KEYFRAMES_PER_UNIT = 16,
    SAMPLES_PER_UNIT = 2 /* of one observing keyframe */
};

/* m: maximum difference of two views of one surface */
static const cairn_real SURFACE_TOLERANCE_M = CAIRN_REAL(0.2);
static const cairn_real UNBOUNDED_RADIUS2 = CAIRN_REAL(1e30); /* m^2 */

static cairn_vec2 sensor_in_map(const cairn_mapper *mapper, int32_t keyframe)
{
    return cairn_pose_point(mapper->keyframe_pose[keyframe],
                            cairn_mapper_keyframe_record(mapper, keyframe)->sensor);
}

static cairn_real sensor_distance2(const cairn_mapper *mapper, int32_t a, int32_t b)
{
    return cairn_vec2_norm_squared(
        cairn_vec2_sub(sensor_in_map(mapper, a), sensor_in_map(mapper, b)));
}

void cairn_mapper_invalidate_redundancy(cairn_mapper *mapper)
{
    for (int32_t keyframe = 0; keyframe < mapper->keyframe_count; keyframe++)
        mapper->loop.redundancy.score[keyframe] = -1;
}

void cairn_mapper_invalidate_redundancy_near(cairn_mapper *mapper, int32_t culled)
{
    mapper_redundancy *redundancy = &mapper->loop.redundancy;

    for (int32_t keyframe = culled + 1; keyframe < mapper->keyframe_count; keyframe++)
        if (redundancy->score[keyframe] >= 0 &&
            !(sensor_distance2(mapper, keyframe, culled) > redundancy->neighbour_radius2[keyframe]))
            redundancy->score[keyframe] = -1;
}

/* ---- Neighbours that may observe the same samples ---- */

static void find_neighbours(cairn_mapper *mapper)
{
    mapper_redundancy *redundancy = &mapper->loop.redundancy;

    redundancy->neighbour_count = 0;
    for (int32_t keyframe = 0; keyframe < redundancy->keyframe; keyframe++)
        cairn_mapper_add_neighbour(
            redundancy->neighbours, &redundancy->neighbour_count, MAPPER_REDUNDANCY_NEIGHBOURS,
            (mapper_neighbour){sensor_distance2(mapper, redundancy->keyframe, keyframe), keyframe});
    redundancy->neighbour_radius2[redundancy->keyframe] =
        redundancy->neighbour_count == MAPPER_REDUNDANCY_NEIGHBOURS
            ? redundancy->neighbours[MAPPER_REDUNDANCY_NEIGHBOURS - 1].distance
            : UNBOUNDED_RADIUS2;
    memset(redundancy->observer_counts, 0, sizeof redundancy->observer_counts);
}

/* ---- Samples ---- */

/* Returns 1 when a profile has a surface at a point in its frame. */
static int32_t has_surface(const cairn_visibility *visibility, cairn_vec2 point)
{
    const cairn_vec2 unknown_normal = {0, 0};
    const cairn_visibility_rule rule = {.clearance = SURFACE_TOLERANCE_M,
                                        .depth = SURFACE_TOLERANCE_M};

    return cairn_visibility_query(visibility, point, unknown_normal, &rule) ==
           CAIRN_VISIBILITY_SURFACE;
}

/* Returns 1 when a profile is free up to a point in its frame. */
static int32_t is_free(const cairn_visibility *visibility, cairn_vec2 point)
{
    const cairn_vec2 unknown_normal = {0, 0};
    const cairn_visibility_rule exact = {.clearance = 0};

    return cairn_visibility_query(visibility, point, unknown_normal, &exact) ==
           CAIRN_VISIBILITY_FREE;
}

/* Adds another keyframe's observations of the current keyframe's samples. */
static void count_observers(cairn_mapper *mapper, int32_t other)
{
    mapper_redundancy *redundancy = &mapper->loop.redundancy;
    cairn_visibility own = cairn_mapper_visibility(mapper, redundancy->keyframe),
                     its = cairn_mapper_visibility(mapper, other);
    cairn_transform other_keyframe =
        cairn_transform_of(cairn_mapper_relative_pose(mapper, other, redundancy->keyframe));

    for (int32_t i = 0; i < MAPPER_SAMPLES / 2; i++) {
        int32_t bin = i * BIN_STEP;
        cairn_vec2 way = cairn_vec2_scale(cairn_visibility_direction(bin, CAIRN_VISIBILITY_BINS),
                                          cairn_visibility_range(&own, bin));
        cairn_vec2 end = cairn_transform_point(other_keyframe, cairn_vec2_add(own.sensor, way));
        cairn_vec2 half = cairn_transform_point(
            other_keyframe, cairn_vec2_add(own.sensor, cairn_vec2_scale(way, CAIRN_REAL(0.5))));

        if (own.range[bin] == 0)
            continue;
        redundancy->observer_counts[2 * i] += (uint8_t)has_surface(&its, end);
        redundancy->observer_counts[2 * i + 1] += (uint8_t)is_free(&its, half);
    }
}

/* Returns the redundancy score of the current keyframe. */
static cairn_real coverage_loss(const cairn_mapper *mapper)
{
    const mapper_redundancy *redundancy = &mapper->loop.redundancy;
    cairn_visibility own = cairn_mapper_visibility(mapper, redundancy->keyframe);
    cairn_real redundancy_score = 0;

    for (int32_t i = 0; i < MAPPER_SAMPLES; i++)
        if (own.range[i / 2 * BIN_STEP] > 0)
            redundancy_score += 1 / (cairn_real)(1 + redundancy->observer_counts[i]);
    return redundancy_score;
}

/* ---- Steps ---- */

int cairn_mapper_score_redundancy(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_redundancy *redundancy = &mapper->loop.redundancy;
    int32_t end = cairn_mapper_cull_end(mapper);

    CAIRN_STEP_BEGIN(redundancy->resume);
    for (redundancy->keyframe = 1; redundancy->keyframe < end; redundancy->keyframe++) {
        if (redundancy->score[redundancy->keyframe] >= 0) {
            CAIRN_STEP_CHARGE(redundancy, resume, budget,
                              redundancy->keyframe % KEYFRAMES_PER_UNIT == 0);
            continue;
        }
        CAIRN_STEP_CHARGE(redundancy, resume, budget,
                          1 + redundancy->keyframe / KEYFRAMES_PER_UNIT);
        find_neighbours(mapper);
        for (redundancy->neighbour = 0; redundancy->neighbour < redundancy->neighbour_count;
             redundancy->neighbour++) {
            CAIRN_STEP_CHARGE(redundancy, resume, budget, MAPPER_SAMPLES / SAMPLES_PER_UNIT);
            count_observers(mapper, redundancy->neighbours[redundancy->neighbour].keyframe);
        }
        CAIRN_STEP_CHARGE(redundancy, resume, budget, 1 + MAPPER_SAMPLES / KEYFRAMES_PER_UNIT);
        redundancy->score[redundancy->keyframe] = coverage_loss(mapper);
    }
    CAIRN_STEP_END(redundancy->resume);
}

int32_t cairn_mapper_most_redundant(const cairn_mapper *mapper)
{
    int32_t end = cairn_mapper_cull_end(mapper);
    const cairn_real *redundancy_score = mapper->loop.redundancy.score;
    int32_t best = 1;

    for (int32_t keyframe = 2; keyframe < end; keyframe++)
        if (!(redundancy_score[keyframe] > redundancy_score[best]))
            best = keyframe;
    return best;
}
