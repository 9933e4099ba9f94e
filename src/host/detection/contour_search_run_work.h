/* contour_search_run_work: what object_detect_run shares with contour_search_run. */
#ifndef CAIRN_HOST_CONTOUR_SEARCH_RUN_WORK_H
#define CAIRN_HOST_CONTOUR_SEARCH_RUN_WORK_H

#include "cairn/contour_search.h"

/* Number of pieces of at most `length` px of all segments in contour grouping, within the range of
 * max_tokens of the search; at least 64, also where a segment is not finite. Cost: linear.
 *
 * length: > 0 */
int32_t cairn_contour_search_run_count_pieces(const cairn_contour_search_tokens *tokens,
                                              cairn_real length);

#endif
