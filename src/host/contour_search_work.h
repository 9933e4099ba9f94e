/* contour_search_work: what the parts of contour_search share. Internal to the host library. */
#ifndef CAIRN_HOST_CONTOUR_SEARCH_WORK_H
#define CAIRN_HOST_CONTOUR_SEARCH_WORK_H

#include "cairn/contour_search.h"

/* A vector of the model where an object lies. */
cairn_vec2 cairn_contour_turned(const cairn_grouped_object *object, cairn_vec2 m);

/* Distance of a point to a segment. */
cairn_real cairn_contour_distance(cairn_segment line, cairn_vec2 p);

/* Completes an object along its chains: what lies between two of its segments on one chain, and what goes on behind its last ones along
 * the model. list: [tokens->count] its segments, *count of them, in the order of the model's outline before and after. 0: no memory. */
int cairn_contour_complete(const cairn_contour_tokens *tokens, const cairn_shape_model *model,
                           const cairn_grouped_object *object, int32_t *list, int32_t *count);

#endif
