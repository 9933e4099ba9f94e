/* Internal to visibility and to loops over points: the query inlined. */
#ifndef CAIRN_SCANS_VISIBILITY_WORK_H
#define CAIRN_SCANS_VISIBILITY_WORK_H

#include "cairn/visibility.h"

/* Body of cairn_visibility_query_bin(). Where the rule is a constant, its cases fall away. */
#ifdef __GNUC__
__attribute__((always_inline))
#endif
static inline cairn_visibility_answer
visibility_answer(const cairn_visibility *visibility, int32_t bin, cairn_vec2 ray,
                  cairn_vec2 normal, const cairn_visibility_rule *rule)
{
    cairn_real squared = cairn_vec2_norm_squared(ray), margin = rule->margin_of_distance,
               here = cairn_visibility_range(visibility, bin), before = here, after = here, least,
               clear, clearance;
    cairn_real outer = squared * (1 + margin) * (1 + margin),
               inner = squared * (1 - margin) * (1 - margin);
    int is_open = 1; /* 1: nothing hides that the point is free */

    if (!(here > 0))
        return CAIRN_VISIBILITY_UNKNOWN;
    if (rule->beside > 0) {
        before = cairn_visibility_range(visibility, bin - 1);
        after = cairn_visibility_range(visibility, bin + 1);
        is_open = !rule->is_closed || (before > 0 && after > 0);
    }
    least = before > 0 && before < here ? before : here;
    least = after > 0 && after < least ? after : least;
    clearance = rule->clearance + rule->clearance_of_range * here;
    clear = least - clearance;
    if (is_open && clear > 0 && outer < clear * clear)
        return CAIRN_VISIBILITY_FREE;
    if (squared > here * here && cairn_vec2_dot(normal, ray) > 0)
        return CAIRN_VISIBILITY_BACK_FACE;
    if (rule->is_closed) {
        cairn_real end = here + rule->depth;

        if (inner <= end * end)
            return CAIRN_VISIBILITY_SURFACE;
    } else {
        /* An unknown range, 0, changes nothing: a point within the depth of 0 is within that of the
         * least range, too. */
        const cairn_real range[3] = {here, before, after};

        for (int k = 0; k < 3; k++) {
            cairn_real end = range[k] + rule->depth;

            clear = range[k] - clearance;
            if (inner <= end * end && !(clear > 0 && outer < clear * clear))
                return CAIRN_VISIBILITY_SURFACE;
        }
    }
    return squared >= 0 ? CAIRN_VISIBILITY_BEHIND : CAIRN_VISIBILITY_UNKNOWN;
}

/* cairn_visibility_query_bin(), inlined unless code size is optimized. */
static inline cairn_visibility_answer visibility_query_bin(const cairn_visibility *visibility,
                                                           int32_t bin, cairn_vec2 ray,
                                                           cairn_vec2 normal,
                                                           const cairn_visibility_rule *rule)
{
#ifdef __OPTIMIZE_SIZE__
    return cairn_visibility_query_bin(visibility, bin, ray, normal, rule);
#else
    return visibility_answer(visibility, bin, ray, normal, rule);
#endif
}

#endif
