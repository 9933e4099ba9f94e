/* Variants of the methods of scan matching, for ablation studies: further values of the field
 * `mode` of cairn_scan_match_params. _check() accepts them, and says the range of the public
 * ones. */
#ifndef CAIRN_SCANS_SCAN_MATCH_VARIANTS_H
#define CAIRN_SCANS_SCAN_MATCH_VARIANTS_H

#include "cairn/scan_match.h"

/* Parts of mode SHAPE, even, and of mode AS_WRITTEN, odd as that is. */
enum {
    /* the common subsequence alone */
    CAIRN_SCAN_MATCH_SHAPE_COMMON = 6,
    CAIRN_SCAN_MATCH_AS_WRITTEN_COMMON = 7,
    /* with the collinear filter in its strict form */
    CAIRN_SCAN_MATCH_SHAPE_COLINEAR = 8,
    CAIRN_SCAN_MATCH_AS_WRITTEN_COLINEAR = 9,
    /* all but the collinear filter */
    CAIRN_SCAN_MATCH_SHAPE_LINES = 10,
    CAIRN_SCAN_MATCH_AS_WRITTEN_LINES = 11,
    /* with the segment filter and its translation: all but ICP; as written it is public */
    CAIRN_SCAN_MATCH_SHAPE_SEGMENTS = 12,

    SCAN_MATCH_FIRST_VARIANT = CAIRN_SCAN_MATCH_SHAPE_COMMON,
    SCAN_MATCH_LAST_VARIANT = CAIRN_SCAN_MATCH_SHAPE_SEGMENTS
};

/* Whether the mode is a variant of a public one. */
static inline int scan_match_is_variant(cairn_scan_match_mode mode)
{
    return mode >= SCAN_MATCH_FIRST_VARIANT && mode <= SCAN_MATCH_LAST_VARIANT;
}

#endif
