/* Shared by the golden scenes: hashes, random arguments, sweeps of a room, the list of scenes. */
#ifndef CAIRN_TESTS_GOLDEN_H
#define CAIRN_TESTS_GOLDEN_H

#include <string.h>

#include "cairn/random.h"
#include "cairn/scan.h"

/* ---- Hashes ---- */

#define GOLDEN_START UINT64_C(14695981039346656037)

/* FNV-1a over the bytes of a value. */
static inline uint64_t add_bytes(uint64_t hash, const void *data, size_t bytes)
{
    const unsigned char *byte = data;

    for (size_t i = 0; i < bytes; i++)
        hash = (hash ^ byte[i]) * UINT64_C(1099511628211);
    return hash;
}

static inline uint64_t add_real(uint64_t hash, cairn_real x)
{
    return x == x ? add_bytes(hash, &x, sizeof x) : add_bytes(hash, "nan", 3);
}

static inline uint64_t add_pose(uint64_t hash, cairn_pose pose)
{
    return add_real(add_real(add_real(hash, pose.x), pose.y), pose.theta);
}

static inline uint64_t add_point(uint64_t hash, cairn_vec2 point)
{
    return add_real(add_real(hash, point.x), point.y);
}

static inline uint64_t add_covariance(uint64_t hash, const cairn_real *covariance)
{
    for (int k = 0; k < 9; k++)
        hash = add_real(hash, covariance[k]);
    return hash;
}

/* ---- Arguments ---- */

/* 0: uniform within +-size; else multiplied by a factor of 2^-30 ... 2^30. */
static inline cairn_real argument(cairn_random *random, cairn_real size, int wide)
{
    cairn_real x = cairn_random_uniform(random, -size, size);
    int32_t doublings = wide ? cairn_random_below(random, 61) - 30 : 0;

    for (; doublings > 0; doublings--)
        x *= 2;
    for (; doublings < 0; doublings++)
        x /= 2;
    return x;
}

/* ---- Sweeps of a room with a niche, seen by a scanner that turns while it sweeps ---- */

enum { GOLDEN_BEAMS = 181 };

typedef struct golden_sweep {
    float range[GOLDEN_BEAMS];
    cairn_scan_input input;
} golden_sweep;

void golden_make_sweep(golden_sweep *out, cairn_random *random, cairn_pose pose);

/* A fitted sweep; its view is valid until the next one of the same object. 0: the fit fails. */
int golden_fit_sweep(cairn_scan *scan, const golden_sweep *s);

/* Allocates for such sweeps; NULL when memory is insufficient. */
cairn_scan *golden_new_scan(cairn_pool *pool);

/* True poses of the sweeps, and their initial poses. */
enum { GOLDEN_VIEWS = 5 };

cairn_pose golden_view_pose(int32_t i);
cairn_pose golden_thought_pose(cairn_random *random, int32_t i);

/* ---- Memory of a scene ---- */

enum { GOLDEN_MEMORY = 1200 * 1024 };

extern unsigned char golden_memory[GOLDEN_MEMORY];

/* ---- Scenes, in order; each returns its hash, 0 when something fails ---- */

#define GOLDEN_SCENES(X)                                                                           \
    X(elementary_functions)                                                                        \
    X(random_numbers)                                                                              \
    X(poses_and_segments)                                                                          \
    X(small_matrices)                                                                              \
    X(force_field)                                                                                 \
    X(force_field_as_written)                                                                      \
    X(scans_and_grid)                                                                              \
    X(scans_mapped)                                                                                \
    X(matches)                                                                                     \
    X(scanner_checked)                                                                             \
    X(angle_step_estimated)                                                                        \
    X(links_and_cover)                                                                             \
    X(aligned)                                                                                     \
    X(pose_graphs)                                                                                 \
    X(robust_pose_graphs)                                                                          \
    X(consensus)                                                                                   \
    X(lines_and_rectangles)                                                                        \
    X(ellipses)                                                                                    \
    X(particles)                                                                                   \
    X(registered)                                                                                  \
    X(hypotheses)                                                                                  \
    X(virtual_aligned)                                                                             \
    X(lum_as_written)                                                                              \
    X(virtual_as_written)                                                                          \
    X(mapped)                                                                                      \
    X(filtered)                                                                                    \
    X(places)                                                                                      \
    X(places_as_written)                                                                           \
    X(merged)                                                                                      \
    X(merged_as_written)                                                                           \
    X(voted)                                                                                       \
    X(contours)                                                                                    \
    X(edgels)                                                                                      \
    X(outlines)                                                                                    \
    X(symmetry)                                                                                    \
    X(symmetry_as_written)                                                                         \
    X(parts_as_written)                                                                            \
    X(grouped)                                                                                     \
    X(grouped_written)                                                                             \
    X(skeletons)                                                                                   \
    X(skeletons_written)                                                                           \
    X(detected)                                                                                    \
    X(searched)                                                                                    \
    X(searched_written)

#define GOLDEN_PROTOTYPE(name) uint64_t golden_##name(void);
GOLDEN_SCENES(GOLDEN_PROTOTYPE)

typedef struct golden_scene {
    const char *name;
    uint64_t (*run)(void);
} golden_scene;

extern const golden_scene golden_scenes[]; /* the last one has no name */

#endif
