/* Which key scan could go?
 *
 * Method. Of what a key scan saw, every fourth bearing is a sample of a surface, at its end, and of
 * free space, half-way. A key scan covers a sample when it saw free space there, or a surface as
 * far away in that bearing. Loss of a key scan: the sum over its samples of 1 / (1 + n), when n of
 * the nearest key scans before it cover it. The one with the least loss is the best covered. Only
 * those before it count: of two that show the same the older one stays, from which the map has been
 * built, and what a robot sees that drives round and round is measured against the first round for
 * ever.
 *
 * Layout: losses are kept until the key scans move or one that counted goes.
 *
 * Limits: what has changed in the building stays beside what has not, as long as there is room. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/mapper_work.h"

enum {
    BEARING_STEP = MAPPER_BEARINGS / (MAPPER_SAMPLES / 2),
    KEYS_A_UNIT = 16,
    SAMPLES_A_UNIT = 2 /* that one key scan may cover */
};

static const cairn_real NEAR = CAIRN_REAL(0.2);     /* m: two see the same surface */
static const cairn_real NOWHERE = CAIRN_REAL(1e30); /* m^2 */

static cairn_vec2 sensor_in_map(const cairn_mapper *mapper, int32_t key)
{
    return cairn_pose_point(mapper->key_pose[key], cairn_mapper_key_scan(mapper, key)->sensor);
}

static cairn_real apart_squared(const cairn_mapper *mapper, int32_t a, int32_t b)
{
    return cairn_vec2_norm_squared(
        cairn_vec2_sub(sensor_in_map(mapper, a), sensor_in_map(mapper, b)));
}

void cairn_mapper_forget_cover(cairn_mapper *mapper)
{
    for (int32_t key = 0; key < mapper->key_count; key++)
        mapper->loop.cover.loss[key] = -1;
}

void cairn_mapper_uncover(cairn_mapper *mapper, int32_t gone)
{
    mapper_cover *cover = &mapper->loop.cover;

    for (int32_t key = gone + 1; key < mapper->key_count; key++)
        if (cover->loss[key] >= 0 && !(apart_squared(mapper, key, gone) > cover->reach[key]))
            cover->loss[key] = -1;
}

/* ---- The key scans that may cover one ---- */

static void take_near(mapper_cover *cover, int32_t key, cairn_real distance)
{
    int32_t at = cover->near_count;

    if (at == MAPPER_COVERING) {
        if (!(distance < cover->distance[at - 1]))
            return;
        at--;
    } else {
        cover->near_count++;
    }
    for (; at > 0 && distance < cover->distance[at - 1]; at--) {
        cover->near[at] = cover->near[at - 1];
        cover->distance[at] = cover->distance[at - 1];
    }
    cover->near[at] = key;
    cover->distance[at] = distance;
}

static void find_near(cairn_mapper *mapper)
{
    mapper_cover *cover = &mapper->loop.cover;

    cover->near_count = cover->at = 0;
    for (int32_t key = 0; key < cover->key; key++)
        take_near(cover, key, apart_squared(mapper, cover->key, key));
    cover->reach[cover->key] =
        cover->near_count == MAPPER_COVERING ? cover->distance[MAPPER_COVERING - 1] : NOWHERE;
    memset(cover->covered, 0, sizeof cover->covered);
}

/* ---- Samples ---- */

/* 1 when a key scan saw free space, or a surface, at a point in its frame. */
static int32_t sees(const cairn_mapper *mapper, int32_t key, cairn_vec2 point, int32_t surface)
{
    const uint16_t *sight = &mapper->sight[(size_t)mapper->slot[key] * MAPPER_BEARINGS];
    cairn_vec2 d = cairn_vec2_sub(point, cairn_mapper_key_scan(mapper, key)->sensor);
    cairn_real range = (cairn_real)sight[cairn_mapper_bearing_of(d)] / 100,
               distance = cairn_vec2_norm(d);

    return surface ? range > 0 && cairn_abs(range - distance) <= NEAR : distance <= range;
}

/* Counts what another key scan covers of the one at hand. */
static void count_covered(cairn_mapper *mapper, int32_t other)
{
    mapper_cover *cover = &mapper->loop.cover;
    const uint16_t *sight = &mapper->sight[(size_t)mapper->slot[cover->key] * MAPPER_BEARINGS];
    cairn_transform other_key = cairn_transform_of(
        cairn_pose_between(mapper->key_pose[other], mapper->key_pose[cover->key]));
    cairn_vec2 sensor = cairn_mapper_key_scan(mapper, cover->key)->sensor;

    for (int32_t i = 0; i < MAPPER_SAMPLES / 2; i++) {
        int32_t bearing = i * BEARING_STEP;
        cairn_vec2 way = cairn_vec2_scale(cairn_mapper_bearing_direction(bearing),
                                          (cairn_real)sight[bearing] / 100);
        cairn_vec2 end = cairn_transform_point(other_key, cairn_vec2_add(sensor, way));
        cairn_vec2 half = cairn_transform_point(
            other_key, cairn_vec2_add(sensor, cairn_vec2_scale(way, CAIRN_REAL(0.5))));

        if (sight[bearing] == 0)
            continue;
        cover->covered[2 * i] += (uint8_t)sees(mapper, other, end, 1);
        cover->covered[2 * i + 1] += (uint8_t)sees(mapper, other, half, 0);
    }
}

static cairn_real loss_of(const cairn_mapper *mapper)
{
    const mapper_cover *cover = &mapper->loop.cover;
    const uint16_t *sight = &mapper->sight[(size_t)mapper->slot[cover->key] * MAPPER_BEARINGS];
    cairn_real loss = 0;

    for (int32_t i = 0; i < MAPPER_SAMPLES; i++)
        if (sight[i / 2 * BEARING_STEP] > 0)
            loss += 1 / (cairn_real)(1 + cover->covered[i]);
    return loss;
}

/* ---- Steps ---- */

void cairn_mapper_begin_cover(cairn_mapper *mapper)
{
    mapper->loop.cover.key = 1;
    mapper->loop.cover.near_count = mapper->loop.cover.at = -1;
}

int32_t cairn_mapper_cover_item(cairn_mapper *mapper, int32_t end, cairn_budget *budget)
{
    mapper_cover *cover = &mapper->loop.cover;

    if (cover->at >= 0 && cover->at < cover->near_count) {
        count_covered(mapper, cover->near[cover->at++]);
        budget->left -= MAPPER_SAMPLES / SAMPLES_A_UNIT;
        return 0;
    }
    if (cover->at >= 0) {
        cover->loss[cover->key] = loss_of(mapper);
        budget->left -= 1 + MAPPER_SAMPLES / KEYS_A_UNIT;
        cover->at = -1;
    }
    for (; cover->key < end && cover->loss[cover->key] >= 0; cover->key++)
        if (cover->key % KEYS_A_UNIT == 0)
            budget->left--;
    if (cover->key >= end)
        return 1;
    find_near(mapper);
    budget->left -= 1 + cover->key / KEYS_A_UNIT;
    return 0;
}

int32_t cairn_mapper_best_covered(const cairn_mapper *mapper, int32_t end)
{
    const cairn_real *loss = mapper->loop.cover.loss;
    int32_t best = 1;

    for (int32_t key = 2; key < end; key++)
        if (!(loss[key] > loss[best]))
            best = key;
    return best;
}
