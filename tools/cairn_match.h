/* Record of a scan match: inputs and result, for its text output and its pictures. */
#ifndef CAIRN_TOOLS_CAIRN_MATCH_H
#define CAIRN_TOOLS_CAIRN_MATCH_H

#include "cairn/scan_match.h"
#include "src/host/maps/capacity.h"
#include "tools/cairn_match_input.h"

/* One of the two scans after line fitting. dense: its hits with directions; readings: as written
 * the raw readings as points of the view, otherwise NULL. */
typedef struct match_side {
    match_input input;
    cairn_scan_view view; /* valid while the pool is open */
    cairn_oriented_point *dense, *readings;
    int32_t dense_count;
} match_side;

typedef struct match_record {
    const char *method;
    match_side target, query;
    cairn_pose start;
    int32_t has_start;
    cairn_scan_match_result result; /* result.hypotheses points to the array below */
    cairn_scan_match_hypothesis hypotheses[CAIRN_CAPACITY_MATCH_HYPOTHESES];
    cairn_scan_match_measure measure;
    const cairn_scan_match
        *match; /* the finished match; by shape it holds the correspondences of each stage */
} match_record;

/* "found", "ambiguous" or "none". */
const char *match_verdict_text(cairn_scan_match_verdict verdict);

/* Text and JSON of a match, from the heap; NULL: no memory. */
char *match_text(const match_record *record);
char *match_json(const match_record *record);

#endif
