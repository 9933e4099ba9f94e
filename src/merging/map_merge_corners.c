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

/* units of a pair of corners */
enum { UNITS_PER_PAIR = 4 };

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

/* Registers the current pair of corners, when they are similar. */
static void register_pair(cairn_map_merge *merge)
{
    const map_merge_pairs *pairs = &merge->pairs;
    const map_merge_map *first = &merge->maps[pairs->first], *second = &merge->maps[pairs->second];
    const cairn_corner *a = &first->corners[pairs->corners.first],
                       *b = &second->corners[pairs->corners.second];
    map_merge_mode mode;

    mode.log_ratio = similarity_of(first, a, second, b);
    if (mode.log_ratio < 0)
        return;
    merge->tried_count++;
    mode.first_second = registration_of(first, a, second, b);
    cairn_map_merge_insert_pair_mode(merge, mode, 0, 0);
}

/* Step: compares all pairs of corners of the current pair of maps. */
static int compare_corners(cairn_map_merge *merge, cairn_budget *budget)
{
    const map_merge_map *first = &merge->maps[merge->pairs.first],
                        *second = &merge->maps[merge->pairs.second];
    map_merge_item_pair *at = &merge->pairs.corners;

    CAIRN_STEP_BEGIN(merge->resume.phase);
    merge->pairs.mode_count[cairn_map_merge_pair(merge->pairs.first, merge->pairs.second)] = 0;
    for (at->first = 0; at->first < first->corner_count; at->first++)
        for (at->second = 0; at->second < second->corner_count; at->second++) {
            CAIRN_STEP_CHARGE(merge, resume.phase, budget, UNITS_PER_PAIR);
            register_pair(merge);
        }
    CAIRN_STEP_END(merge->resume.phase);
}

int cairn_map_merge_register_corners(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_pairs *pairs = &merge->pairs;

    CAIRN_STEP_BEGIN(merge->resume.stage);
    for (pairs->second = 1; pairs->second < merge->map_count; pairs->second++)
        for (pairs->first = 0; pairs->first < pairs->second; pairs->first++)
            CAIRN_STEP_RUN(merge, resume.stage, budget, compare_corners);
    CAIRN_STEP_END(merge->resume.stage);
}
