/* The long scenes: LONG_SCENES(X) is X(name) for each. */
#ifndef CAIRN_TESTS_LONG_SCENES_H
#define CAIRN_TESTS_LONG_SCENES_H

#include <stdint.h>

#define LONG_SCENES(X)                                                                             \
    X(aligned_flat)                                                                                \
    X(aligned_repaired)                                                                            \
    X(aligned_parts)                                                                               \
    X(field_gradient)                                                                              \
    X(field_twisted)                                                                               \
    X(field_spaced)                                                                                \
    X(field_springs)                                                                               \
    X(field_springs_twisted)                                                                       \
    X(lum)                                                                                         \
    X(hypotheses)                                                                                  \
    X(drive)                                                                                       \
    X(drive_blindly)                                                                               \
    X(drive_astray)                                                                                \
    X(drive_among_twins)                                                                           \
    X(grid)                                                                                        \
    X(merged)                                                                                      \
    X(merged_by_walls)                                                                             \
    X(merged_by_images)                                                                            \
    X(match)                                                                                       \
    X(match_in_a_crowd)                                                                            \
    X(match_by_shape)                                                                              \
    X(icp)                                                                                         \
    X(places)                                                                                      \
    X(places_in_a_crowd)                                                                           \
    X(places_in_order)                                                                             \
    X(sequences)                                                                                   \
    X(pose_graphs)                                                                                 \
    X(block_systems)                                                                               \
    X(consensus)                                                                                   \
    X(particles)                                                                                   \
    X(polylines)                                                                                   \
    X(sweeps)                                                                                      \
    X(walls)                                                                                       \
    X(pictures)                                                                                    \
    X(neighbours)                                                                                  \
    X(shape_models)                                                                                \
    X(detected_as_written)

#define LONG_SCENE(name) uint64_t long_##name(void);
LONG_SCENES(LONG_SCENE)
#undef LONG_SCENE

#endif
