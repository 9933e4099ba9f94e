/* Closed-form registration of pairs of similar corners: the motion update of the virtual robot as
 * written.
 *
 * Method.
 *
 * 1. Every corner of a map is compared with every corner of the same kind and opening of another
 *    map. The pairs whose legs have the most similar lengths are kept.
 * 2. A pair fixes a rigid motion by three correspondences: the vertex, and a point on each leg as
 *    far from it as both corners have that leg. The motion is the least-squares solution (Horn
 *    1987, Arun 1987, in the plane).
 *
 * Source: Adluru 2008, section 9.3. */
#include "src/base/build.h"

#include "src/merging/map_merge_work.h"

/* rad: maximum difference of the openings of similar corners */
#define MAX_OPENING_DIFFERENCE_RAD (10 * (CAIRN_PI / 180))

/* m: uncertainty of a leg's length; it lowers the similarity of short legs, which agree by
 * chance */
#define LEG_NOISE_M CAIRN_REAL(0.20)

/* Returns the length of a leg of a corner, m. */
static cairn_real leg_length(const map_merge_map *map, const cairn_corner *corner, int32_t leg)
{
    cairn_segment s = map->lines[corner->segment[leg]];
    cairn_real a = cairn_vec2_dot(corner->leg[leg], cairn_vec2_sub(s.a, corner->position));
    cairn_real b = cairn_vec2_dot(corner->leg[leg], cairn_vec2_sub(s.b, corner->position));

    return cairn_max(a, b);
}

/* Returns the similarity of two corners, 0 ... 1: the mean over both legs of the shorter length
 * divided by the longer length plus noise. Negative: not similar. */
static cairn_real similarity_of(const map_merge_map *first, const cairn_corner *a,
                                const map_merge_map *second, const cairn_corner *b)
{
    cairn_real sum = 0;

    if (a->kind != b->kind || cairn_abs(a->opening - b->opening) > MAX_OPENING_DIFFERENCE_RAD)
        return -1;
    for (int32_t leg = 0; leg < 2; leg++) {
        cairn_real u = leg_length(first, a, leg), v = leg_length(second, b, leg);

        sum += cairn_min(u, v) / (cairn_max(u, v) + LEG_NOISE_M);
    }
    return sum / 2;
}

cairn_pose cairn_map_merge_motion_of(const cairn_vec2 *to, const cairn_vec2 *from)
{
    cairn_vec2 p = {0, 0}, q = {0, 0};
    cairn_real sine = 0, cosine = 0;

    for (int32_t i = 0; i < MAP_MERGE_CORRESPONDENCES; i++) {
        p = cairn_vec2_add(p, cairn_vec2_scale(to[i], CAIRN_REAL(1.0) / MAP_MERGE_CORRESPONDENCES));
        q = cairn_vec2_add(q,
                           cairn_vec2_scale(from[i], CAIRN_REAL(1.0) / MAP_MERGE_CORRESPONDENCES));
    }
    for (int32_t i = 0; i < MAP_MERGE_CORRESPONDENCES; i++) {
        cairn_vec2 u = cairn_vec2_sub(from[i], q), v = cairn_vec2_sub(to[i], p);

        sine += cairn_vec2_cross(u, v);
        cosine += cairn_vec2_dot(u, v);
    }
    return cairn_pose_from_moments(q, p, cosine, sine);
}

static cairn_pose registration_of(const map_merge_map *first, const cairn_corner *a,
                                  const map_merge_map *second, const cairn_corner *b)
{
    cairn_vec2 to[MAP_MERGE_CORRESPONDENCES] = {a->position},
               from[MAP_MERGE_CORRESPONDENCES] = {b->position};

    for (int32_t leg = 0; leg < 2; leg++) {
        cairn_real length = cairn_min(leg_length(first, a, leg), leg_length(second, b, leg));

        to[1 + leg] = cairn_vec2_add(a->position, cairn_vec2_scale(a->leg[leg], length));
        from[1 + leg] = cairn_vec2_add(b->position, cairn_vec2_scale(b->leg[leg], length));
    }
    return cairn_map_merge_motion_of(to, from);
}

static void begin_pair(cairn_map_merge *merge)
{
    merge->cursor = 0;
    if (merge->other < merge->map_count)
        merge->pairs.mode_count[map_merge_pair(merge->map, merge->other)] = 0;
}

/* Compares all pairs of corners of the current pair of maps. */
static cairn_status step_pair(cairn_map_merge *merge, cairn_budget *budget)
{
    const map_merge_map *first = &merge->maps[merge->map], *second = &merge->maps[merge->other];
    int32_t count = first->corner_count * second->corner_count,
            pair = map_merge_pair(merge->map, merge->other);
    map_merge_mode *modes = merge->pairs.modes + (size_t)pair * (size_t)merge->params.max_modes;

    for (; merge->cursor < count; merge->cursor++) {
        const cairn_corner *a = &first->corners[merge->cursor / second->corner_count];
        const cairn_corner *b = &second->corners[merge->cursor % second->corner_count];
        map_merge_mode mode;

        if (!cairn_budget_charge(budget, &merge->units_charged, 4))
            return CAIRN_MORE;
        mode.log_ratio = similarity_of(first, a, second, b);
        if (mode.log_ratio < 0)
            continue;
        merge->tried_count++;
        mode.first_second = registration_of(first, a, second, b);
        cairn_map_merge_insert_mode(modes, &merge->pairs.mode_count[pair], merge->params.max_modes,
                                    mode, 0, 0);
    }
    return CAIRN_OK;
}

cairn_status cairn_map_merge_register_corners(cairn_map_merge *merge, cairn_budget *budget)
{
    if (merge->phase == MAP_MERGE_OCCUPIED_DISTANCE) {
        merge->map = 0;
        merge->other = 1;
        begin_pair(merge);
        merge->phase = MAP_MERGE_HYPOTHESES;
    }
    while (merge->other < merge->map_count) {
        cairn_status status = step_pair(merge, budget);

        if (status != CAIRN_OK)
            return status;
        if (++merge->map == merge->other) {
            merge->map = 0;
            merge->other++;
        }
        begin_pair(merge);
    }
    return CAIRN_OK;
}
