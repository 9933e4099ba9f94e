/* Variants of the methods of scan matching, for ablation studies: further values of the field
 * `mode` of cairn_scan_match_params. */
#ifndef CAIRN_SCANS_SCAN_MATCH_VARIANTS_H
#define CAIRN_SCANS_SCAN_MATCH_VARIANTS_H

#include "cairn/scan_match.h"

enum {
    /* Parts of mode SHAPE: the common subsequence alone */
    CAIRN_SCAN_MATCH_SHAPE_COMMON = 3,
    /* with the collinear filter in its strict form */
    CAIRN_SCAN_MATCH_SHAPE_COLINEAR = 4,
    /* with the segment filter and its translation: all but ICP */
    CAIRN_SCAN_MATCH_SHAPE_SEGMENTS = 5,
    /* all but the collinear filter */
    CAIRN_SCAN_MATCH_SHAPE_LINES = 6,
    /* The same parts of mode AS_WRITTEN; CAIRN_SCAN_MATCH_AS_WRITTEN_SEGMENTS is between them. */
    CAIRN_SCAN_MATCH_AS_WRITTEN_COMMON = 7,
    CAIRN_SCAN_MATCH_AS_WRITTEN_COLINEAR = 8,
    CAIRN_SCAN_MATCH_AS_WRITTEN_LINES = 10
};

#endif
