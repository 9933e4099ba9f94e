/* cairn_match: what a match was made of, for its text and its pictures. */
#ifndef CAIRN_TOOLS_CAIRN_MATCH_H
#define CAIRN_TOOLS_CAIRN_MATCH_H

#include "cairn/scan_match.h"
#include "tools/cairn_match_input.h"

/* The most hypotheses that are told. */
#define MATCH_HYPOTHESES_MOST 8

/* A scan, fitted; dense: its hits with directions; readings: as written the points of the view,
 * otherwise NULL. */
typedef struct match_side {
    match_input input;
    cairn_scan_view view; /* valid as long as the pool */
    cairn_oriented_point *dense, *readings;
    int32_t dense_count;
} match_side;

typedef struct match_record {
    const char *method;
    match_side target, query;
    cairn_pose start;
    int32_t has_start;
    cairn_scan_match_result result; /* its hypotheses are the following */
    cairn_scan_match_hypothesis hypotheses[MATCH_HYPOTHESES_MOST];
    cairn_scan_match_measure measure;
    const cairn_scan_match *match; /* done; by shape: it tells the pairs of each stage */
} match_record;

/* "found", "ambiguous" or "none". */
const char *match_verdict_text(cairn_scan_match_verdict verdict);

/* Text and JSON of a match, from the heap; NULL: no memory. */
char *match_text(const match_record *record);
char *match_json(const match_record *record);

#endif
