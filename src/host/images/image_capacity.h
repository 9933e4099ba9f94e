/* image_capacity: parameters of the objects that work on one image, with capacities for its size.
 * Internal to the host library, its programs and the Python package. */
#ifndef CAIRN_HOST_IMAGE_CAPACITY_H
#define CAIRN_HOST_IMAGE_CAPACITY_H

#include "cairn/boundary.h"
#include "cairn/edgel.h"
#include "cairn/self_similarity.h"
#include "cairn/skeleton_grouping.h"

/* The defaults with capacities for an image of width by height pixels. */
cairn_edgel_params cairn_image_capacity_edgel(int32_t width, int32_t height);
cairn_boundary_params cairn_image_capacity_boundary(int32_t width, int32_t height);
cairn_skeleton_grouping_params cairn_image_capacity_skeleton(int32_t width, int32_t height,
                                                             int32_t as_written);

/* outline_samples: of the outline; 0: the default */
cairn_self_similarity_params cairn_image_capacity_self_similarity(int32_t outline_samples,
                                                                  int32_t as_written);

#endif
