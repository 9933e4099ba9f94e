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

/* ---- Scenes: 0 when something fails ---- */

uint64_t golden_elementary_functions(void);
uint64_t golden_random_numbers(void);
uint64_t golden_poses_and_segments(void);
uint64_t golden_small_matrices(void);
uint64_t golden_force_field(void);
uint64_t golden_force_field_as_written(void);
uint64_t golden_scans_and_grid(void);
uint64_t golden_matches(void);
uint64_t golden_links_and_cover(void);
uint64_t golden_aligned(void);
uint64_t golden_pose_graphs(void);
uint64_t golden_consensus(void);
uint64_t golden_lines_and_rectangles(void);
uint64_t golden_ellipses(void);
uint64_t golden_particles(void);
uint64_t golden_registered(void);
uint64_t golden_hypotheses(void);
uint64_t golden_virtual_aligned(void);
uint64_t golden_lum_as_written(void);
uint64_t golden_virtual_as_written(void);
uint64_t golden_mapped(void);
uint64_t golden_filtered(void);
uint64_t golden_places(void);
uint64_t golden_places_as_written(void);
uint64_t golden_merged(void);
uint64_t golden_merged_as_written(void);
uint64_t golden_contours(void);
uint64_t golden_edgels(void);
uint64_t golden_symmetry(void);
uint64_t golden_symmetry_as_written(void);
uint64_t golden_parts_as_written(void);
uint64_t golden_grouped(void);
uint64_t golden_grouped_written(void);
uint64_t golden_skeletons(void);
uint64_t golden_skeletons_written(void);
uint64_t golden_detected(void);
uint64_t golden_searched(void);
uint64_t golden_searched_written(void);

typedef struct golden_scene {
    const char *name;
    uint64_t (*run)(void);
} golden_scene;

extern const golden_scene golden_scenes[]; /* the last one has no name */

#endif
