/* Modes: the best registrations of a pair of maps, and other lists of registrations, in which of
 * nearly equal ones only the best stays (non-maximum suppression).
 *
 * Layout: the pair of maps a < b has the number b (b - 1) / 2 + a; its modes are those of b in the
 * frame of a, the best first. */
#include "src/base/build.h"

#include "src/containers/ranked_list.h"
#include "src/merging/map_merge_work.h"

int cairn_map_merge_is_same(cairn_pose a, cairn_pose b, cairn_real metres, cairn_real radians)
{
    cairn_real x = a.x - b.x, y = a.y - b.y;

    return x * x + y * y < metres * metres &&
           cairn_abs(cairn_wrap_angle(a.theta - b.theta)) < radians;
}

static cairn_real reach_of(const map_merge_map *map)
{
    return cairn_vec2_norm(map->corner);
}

int cairn_map_merge_is_disjoint(const cairn_map_merge *merge, int32_t first, int32_t second,
                                cairn_pose first_second)
{
    cairn_real reach = reach_of(&merge->maps[first]) + reach_of(&merge->maps[second]);

    return first_second.x * first_second.x + first_second.y * first_second.y > reach * reach;
}

/* Tolerances within which two modes are duplicates. */
typedef struct mode_tolerance {
    cairn_real metres, radians;
} mode_tolerance;

static int is_duplicate(const void *context, const void *entry, const void *other)
{
    const mode_tolerance *tolerance = context;
    const map_merge_mode *a = other, *b = entry;

    return cairn_map_merge_is_same(a->first_second, b->first_second, tolerance->metres,
                                   tolerance->radians);
}

void cairn_map_merge_insert_mode(map_merge_mode *list, int32_t *count, int32_t most,
                                 map_merge_mode mode, cairn_real metres, cairn_real radians)
{
    mode_tolerance tolerance = {metres, radians};
    ranked_list modes = {.entries = list,
                         .count = count,
                         .capacity = most,
                         .entry_bytes = sizeof mode,
                         .score_at = offsetof(map_merge_mode, log_ratio),
                         .is_near = is_duplicate,
                         .context = &tolerance,
                         .replaces_one = 1};

    (void)ranked_list_insert(&modes, &mode);
}

void cairn_map_merge_insert_hypothesis(cairn_map_merge *merge, cairn_pose first_second,
                                       cairn_real score)
{
    map_merge_mode mode = {first_second, score};

    cairn_map_merge_insert_mode(merge->pairs.hypotheses, &merge->pairs.hypothesis_count,
                                MAP_MERGE_MAX_HYPOTHESES, mode, MAP_MERGE_COARSE_M,
                                MAP_MERGE_COARSE_RAD);
}

int32_t cairn_map_merge_pair(int32_t a, int32_t b)
{
    return a < b ? b * (b - 1) / 2 + a : a * (a - 1) / 2 + b;
}

void cairn_map_merge_insert_pair_mode(cairn_map_merge *merge, map_merge_mode mode,
                                      cairn_real metres, cairn_real radians)
{
    map_merge_pairs *pairs = &merge->pairs;
    int32_t pair = cairn_map_merge_pair(pairs->first, pairs->second),
            most = merge->params.max_modes;

    cairn_map_merge_insert_mode(pairs->modes + (size_t)pair * (size_t)most,
                                &pairs->mode_count[pair], most, mode, metres, radians);
}

int cairn_map_merge_mode_of(const cairn_map_merge *merge, int32_t a, int32_t b, int32_t index,
                            map_merge_mode *mode)
{
    const map_merge_pairs *pairs = &merge->pairs;
    int32_t pair = cairn_map_merge_pair(a, b);

    if (index >= pairs->mode_count[pair])
        return 0;
    *mode = pairs->modes[(size_t)pair * (size_t)merge->params.max_modes + (size_t)index];
    if (a > b)
        mode->first_second = cairn_pose_inverse(mode->first_second);
    return 1;
}
