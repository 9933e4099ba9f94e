/* A hash of all that a grouping of contours says. */
#ifndef CAIRN_TESTS_CONTOUR_GROUPING_HASH_H
#define CAIRN_TESTS_CONTOUR_GROUPING_HASH_H

#include "cairn/contour_grouping.h"
#include "tests/test.h"

static inline uint64_t contour_grouping_hash(const cairn_contour_grouping_result *r)
{
    const int32_t counts[] = {r->object_count,     r->segment_count,      r->steps,
                              r->hypothesis_count, r->token_count,        r->point_count,
                              r->points_dropped,   r->candidates_dropped, r->end_reason};
    uint64_t hash = test_hash(TEST_HASH_START, counts, sizeof counts);

    hash = test_hash(hash, &r->best_score, sizeof r->best_score);
    hash = test_hash(hash, &r->best_evidence, sizeof r->best_evidence);
    hash = test_hash(hash, r->segments, (size_t)r->segment_count * sizeof *r->segments);
    for (int32_t i = 0; i < r->object_count; i++) {
        const cairn_contour_grouping_object *o = &r->objects[i];
        const cairn_real numbers[] = {o->evidence, o->score, o->origin.x,
                                      o->origin.y, o->size,  o->turn};
        const int32_t places[] = {o->first, o->count, o->first_outline, o->matched_samples,
                                  o->start_sample};

        hash = test_hash(test_hash(hash, numbers, sizeof numbers), places, sizeof places);
    }
    for (int32_t i = 0; i < r->steps; i++) {
        const cairn_contour_grouping_trace *t = &r->trace[i];
        const cairn_real numbers[] = {t->n_eff, t->log_likelihood};
        const int32_t drawn[] = {t->followers, t->resampled, t->particles};

        hash = test_hash(test_hash(hash, numbers, sizeof numbers), drawn, sizeof drawn);
    }
    return hash;
}

#endif
