/* visibility: visibility profile of a scan: the least measured range by bearing, and whether a
 * point is on a surface, in free space or hidden as seen from the sensor.
 *
 * A profile belongs to one sensor position, and is in the frame of its scan. Bins are even in the
 * pseudo angle y / (|x| + |y|), which grows with the angle and needs no arc tangent. The arrays are
 * the caller's.
 *
 *     clear() -> add() ... -> query() */
#ifndef CAIRN_VISIBILITY_H
#define CAIRN_VISIBILITY_H

#include "cairn/scan.h"

/* Attribute of a function that is inlined unless code size is optimized. */
#if defined __GNUC__ && !defined __OPTIMIZE_SIZE__
#define CAIRN_INLINED __attribute__((always_inline))
#else
#define CAIRN_INLINED
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Bins of a profile as scan_match and mapper keep it. */
#define CAIRN_VISIBILITY_BINS 256

/* Steps of the greatest range of a profile. */
#define CAIRN_VISIBILITY_STEPS 65535

/* Name of no surface. */
#define CAIRN_VISIBILITY_NO_SURFACE 255

/* A visibility profile. */
typedef struct cairn_visibility {
    /* position of the sensor, m */
    cairn_vec2 sensor;
    /* m, > 0: resolution of the ranges; ranges beyond CAIRN_VISIBILITY_STEPS of them are cut */
    cairn_real step;
    /* [bins] least range by bearing, in steps; 0: unknown */
    uint16_t *range;
    /* [bins] surface at that range, 0 ... 254 or CAIRN_VISIBILITY_NO_SURFACE; NULL: none is kept */
    uint8_t *surface;
    /* bins of the full circle, a power of two, 4 ... 32768 */
    int32_t bins;
    /* bins between two successive beams that are filled, < bins / 2; the later beam's range is
     * theirs */
    int32_t max_gap;
    /* bin of the last range that was added; -1: none */
    int32_t last;
} cairn_visibility;

/* How a point is compared with the ranges about its bearing. Margins are for the errors of ranges
 * and poses. */
typedef struct cairn_visibility_rule {
    /* m: a point is in free space when it is nearer than the least range by more than this, ... */
    cairn_real clearance;
    /* ... and this share of the range of its own bin */
    cairn_real clearance_of_range;
    /* m: a point is on a surface up to this far behind its range */
    cairn_real depth;
    /* share of the point's distance that is added to clearance and depth */
    cairn_real margin_of_distance;
    /* bins on either side whose ranges count like the point's own, 0 or 1: a beam that passes the
     * end of a wall does not put the wall into free space */
    int32_t beside;
    /* 1: one closed surface runs through these ranges: points between them are on it, and nothing
     * is free beside a bin without a range; 0: each range is a surface of its own */
    int32_t is_closed;
} cairn_visibility_rule;

/* What a sensor has observed at a point. */
typedef int32_t cairn_visibility_answer;
enum {
    /* nothing was measured in this direction, or the point is not finite */
    CAIRN_VISIBILITY_UNKNOWN = 0,
    /* at a measured range */
    CAIRN_VISIBILITY_SURFACE = 1,
    /* in front of the measured ranges */
    CAIRN_VISIBILITY_FREE = 2,
    /* hidden behind a range */
    CAIRN_VISIBILITY_BEHIND = 3,
    /* behind a range, on a surface that faces away from the sensor: another face of a wall */
    CAIRN_VISIBILITY_BACK_FACE = 4
};

/* Returns the bin of a direction; 0 for a vector that is zero or not finite.
 *
 * direction: any length
 * bins: bins of the full circle, a power of two */
inline int32_t cairn_visibility_bin(cairn_vec2 direction, int32_t bins)
{
    cairn_real x = cairn_abs(direction.x), y = cairn_abs(direction.y), sum = x + y, turn;

    if (!(sum > 0 && sum <= CAIRN_REAL_MAX))
        return 0;
    turn = y / sum; /* 0 ... 4, one unit a quadrant */
    turn = direction.x < 0 ? 2 - turn : turn;
    turn = direction.y < 0 ? 4 - turn : turn;
    return (int32_t)(turn / 4 * (cairn_real)bins) & (bins - 1);
}

/* Returns the unit vector at the middle of a bin.
 *
 * bin: 0 ... bins - 1
 * bins: bins of the full circle, a power of two */
cairn_vec2 cairn_visibility_direction(int32_t bin, int32_t bins);

/* Returns the range of a bin, m; 0: unknown.
 *
 * visibility: profile with its arrays
 * bin: any integer, wrapped */
inline cairn_real cairn_visibility_range(const cairn_visibility *visibility, int32_t bin)
{
    return (cairn_real)visibility->range[bin & (visibility->bins - 1)] * visibility->step;
}

/* Removes all ranges.
 *
 * visibility: profile whose other fields and arrays are set
 * sensor: position of the sensor, m */
void cairn_visibility_clear(cairn_visibility *visibility, cairn_vec2 sensor);

/* Adds a range: its bin, and those of a gap to the last one, keep the least. Constant time, and
 * linear in max_gap.
 *
 * visibility: profile after clear()
 * ray: from the sensor to the end of a beam, m; zero: an unknown range, so that no gap is filled
 * surface: of the beam's end, or CAIRN_VISIBILITY_NO_SURFACE */
void cairn_visibility_add(cairn_visibility *visibility, cairn_vec2 ray, uint8_t surface);

/* Makes the profile of a scan from its beams that are not UNKNOWN. Linear in the beams.
 *
 * visibility: profile whose other fields and arrays are set
 * sensor: position of the sensor, m
 * beams: [count] in the frame of the profile */
void cairn_visibility_fill(cairn_visibility *visibility, cairn_vec2 sensor,
                           const cairn_scan_beam *beams, int32_t count);

/* Returns the observation at a point whose bin is known. Inlined unless code size is optimized: in
 * most loops over points the rule is a constant. With the caller's compiler options, of which
 * contraction to fused operations may change the answer at a margin.
 *
 * visibility: profile of a sensor
 * bin: of the ray from the sensor to the point
 * ray: from the sensor to the point, m
 * normal: of the point's surface towards its free side, any length; zero: unknown
 * rule: margins of the comparison */
CAIRN_INLINED inline cairn_visibility_answer
cairn_visibility_query_bin(const cairn_visibility *visibility, int32_t bin, cairn_vec2 ray,
                           cairn_vec2 normal, const cairn_visibility_rule *rule)
{
    cairn_real squared = cairn_vec2_dot(ray, ray), margin = rule->margin_of_distance,
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

/* Returns the observation at a point. Constant time.
 *
 * visibility: profile of a sensor
 * point: in the frame of the profile, m
 * normal: of the point's surface towards its free side, any length; zero: unknown
 * rule: margins of the comparison */
static inline cairn_visibility_answer cairn_visibility_query(const cairn_visibility *visibility,
                                                             cairn_vec2 point, cairn_vec2 normal,
                                                             const cairn_visibility_rule *rule)
{
    cairn_vec2 ray = cairn_vec2_sub(point, visibility->sensor);

    return cairn_visibility_query_bin(visibility, cairn_visibility_bin(ray, visibility->bins), ray,
                                      normal, rule);
}

#ifdef __cplusplus
}
#endif

#endif
