/* map_merge: how the maps of many robots lie to each other, with no guess (Adluru 2008, chapter 9).
 *
 * A virtual robot visits one map after the other. Its pose at a map is that map's place among those
 * merged so far; what moves it is the registration of corners, of the directions of walls and of
 * where walls bend; what it sees is the map itself. A particle filter follows the rival places: ten
 * particles are as good as a hundred, and one is where no later map has to decide between places.
 * What the maps do not support is refused and said so.
 *
 * Mode CAIRN_MODE_AS_WRITTEN is chapter 9 as it is printed: what moves the virtual robot is the
 * registration of pairs of similar corners alone, in closed form; what it sees is weighed by Psi
 * and gamma (9.5, 9.6) of whole images, against the map merged so far; the filter draws from the
 * optimal proposal (9.3) and has more than `particles` particles while N_eff is at least half of
 * them. Nothing is refined, and no map is refused that has a corner like one of the maps merged.
 * Choices, where the text is silent:
 *   - two corners are similar when both are concave, convex or mixed, their openings differ by at
 *     most 10 degrees and the lengths of their legs, in order, agree best of all pairs of the two
 *     maps: the max_modes best pairs are registered;
 *   - a registration is the least squares motion of three points of each corner: its vertex and a
 *     point on either leg, as far away as both corners have that leg;
 *   - p(x | x', u) is a sum of Gaussians about the registrations of a map, 0.2 m and 0.05 rad wide,
 *     all maps alike; it is drawn from at the registrations themselves, so no Gaussian (9.4) is
 *     fitted;
 *   - the kernel of Psi and gamma has mu = 0 and sigma = 0.5 cells (of 0.5, 1 and 2 the best on
 *     other arenas), is 0 from 10 sigma on, and Manhattan distances run along the rows and columns
 *     of the image in which the nearest cell is looked for: no image is resampled;
 *   - {c1, c2} in gamma is read as both orders, so d has four terms; d is at least 1e-6; a single
 *     place has Psi~ = gamma~ = 1, and so have all when the sum is 0;
 *   - a cell of the merged map is what most maps say, and occupied among equals; its cells are
 *     those of the reference;
 *   - u registers a map with all maps merged (section 9.2.1), not only with the last one (9.3);
 *   - the filter starts at the reference with one particle; beyond twice `particles` the lightest
 *     go;
 *   - the result is the heaviest particle; a place that would make the merged map larger than 6
 *     max_cells is left out.
 *
 *     clear -> add() for each map -> begin() -> step(budget) until CAIRN_OK -> read(), of() */
#ifndef CAIRN_MAP_MERGE_H
#define CAIRN_MAP_MERGE_H

#include "cairn/corner.h"
#include "cairn/occupancy_grid.h"
#include "cairn/particle_filter.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_map_merge cairn_map_merge;

/* How a place of a map is weighed against others. */
typedef int32_t cairn_merge_perception;
enum {
    /* length of wall that agrees, less what lies in the other's free space, in nats */
    CAIRN_MERGE_EVIDENCE = 0,
    /* Psi and gamma of the thesis (eqs. 9.5, 9.6) */
    CAIRN_MERGE_IMAGES = 1
};

typedef struct cairn_map_merge_params {
    /* 1 ... 64 */
    int32_t max_maps;
    /* of all maps together, 1 ... 2^28 */
    int32_t max_cells;
    /* of one map, 1 ... max_cells */
    int32_t max_map_cells;
    /* surface points kept of a map, 64 ... 2^16; of more cells an even choice is kept */
    int32_t max_points;
    /* of a map, 1 ... 4096 */
    int32_t max_segments;
    /* of a map, the strongest, 1 ... 1024 */
    int32_t max_corners;
    /* of a pair of maps: rival places that are kept, 1 ... 32 */
    int32_t max_modes;
    /* 1 ... 4096 */
    int32_t particles;
    cairn_merge_perception perception;
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN, which needs CAIRN_MERGE_IMAGES */
    int32_t mode;
    /* cells of the first map, > 0: walls so long agree or not as one (10) */
    cairn_real correlation;
    /* nats, > 0: with less support a map is refused; not as written */
    cairn_real min_score;
    /* nats, >= 0: so much more than its best rival place; not as written */
    cairn_real min_margin;
    uint64_t seed;
} cairn_map_merge_params;

/* 16 maps of 400 x 400 cells, 2048 points, 256 segments, 48 corners, 6 modes, 100 particles, by
 * evidence; correlation over 10 cells, least score 6 and margin 3 nats. */
cairn_map_merge_params cairn_map_merge_default(void);

/* Chapter 9 as written: as above, but by images, with 50 particles (the thesis: 50 to 100 in the
 * mean) and 12 modes, which are the pairs of similar corners of two maps. */
cairn_map_merge_params cairn_map_merge_as_written(void);

/* 0 for params that create() would refuse. */
size_t cairn_map_merge_memory(const cairn_map_merge_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_map_merge_create(cairn_map_merge **merge, cairn_pool *pool,
                                                  const cairn_map_merge_params *params);

/* A map as it comes. Cells are CAIRN_CELL_OCCUPIED or CAIRN_CELL_FREE; all other values are
 * unknown. */
typedef struct cairn_merge_map {
    /* row 0 lowest; must stay until the merging has ended */
    cairn_raster_u8_view cells;
    /* m, side of a cell; maps may differ */
    cairn_real resolution;
    /* of the lower left corner of cell (0, 0) in the frame of the map */
    cairn_pose origin;
} cairn_merge_map;

/* Cells of k by k made one: occupied when one of them is, else free when one is, else unknown.
 * For maps that are bent by more than two cells, which agree only in coarse. out: as wide and
 * high as `cells`, divided by k and rounded up. CAIRN_BAD_ARGUMENT: a bad view, k < 1, another
 * size. Linear in cells. */
CAIRN_CHECKED cairn_status cairn_map_merge_coarsen(cairn_raster_u8_view cells, int32_t k,
                                                   cairn_raster_u8 out);

/* Forgets all maps. Constant time. */
void cairn_map_merge_clear(cairn_map_merge *merge);

/* Adds a map; its index is the number of those before it. CAIRN_BAD_ARGUMENT: NULL, a bad view,
 * a resolution that is not > 0, or a merging is under way. CAIRN_NOT_FINITE: the resolution or
 * the origin. CAIRN_FULL: max_maps, max_cells or max_map_cells. *fault, when not NULL, says
 * what. Constant time. */
CAIRN_CHECKED cairn_status cairn_map_merge_add(cairn_map_merge *merge, const cairn_merge_map *map,
                                               cairn_fault *fault);

/* Says that a map lies at map_map in the frame of the reference, as an earlier merging has
 * found: that place is tried too, and kept unless another one is better by min_margin.
 * CAIRN_BAD_ARGUMENT: no such map; CAIRN_NOT_FINITE; CAIRN_UNSUPPORTED: as written. Constant
 * time. */
CAIRN_CHECKED cairn_status cairn_map_merge_guess(cairn_map_merge *merge, int32_t map,
                                                 cairn_pose reference_map);

/* Starts. reference: the map whose frame all others are placed in. order: NULL, or [maps] a
 * permutation that begins with the reference, to be merged in that order. CAIRN_BAD_ARGUMENT: no
 * such reference, not a permutation; CAIRN_EMPTY: no maps. Linear in maps. */
CAIRN_CHECKED cairn_status cairn_map_merge_begin(cairn_map_merge *merge, int32_t reference,
                                                 const int32_t *order);

/* CAIRN_OK: the result stands. CAIRN_MORE: go on. Per map about 3 units a cell; per pair of maps
 * 2 to 16 units for each translation that is tried (two cells apart, in at most six rotations:
 * some 100,000 for maps of 200 by 200 cells), as many for each pair of points where walls bend
 * (256 of a map at most), and about 200,000 to refine its best places; in the filter mostly what
 * was not yet remembered of a pair. So it grows with the square of the maps. */
CAIRN_CHECKED cairn_status cairn_map_merge_step(cairn_map_merge *merge, cairn_budget *budget);

/* ---- What is known of one place of a map beside another ---- */

typedef struct cairn_merge_score {
    /* nats: (1.7 agree - 4 conflict) / correlation */
    cairn_real evidence;
    /* m of wall that both maps have; a long straight one counts by the root of its length */
    cairn_real agree;
    /* m of wall of either map that the other one has seen to be free */
    cairn_real conflict;
    /* share of the smaller map's free cells that the other one knows */
    cairn_real overlap;
    /* (9.5), 0 ... 4 */
    cairn_real psi;
    /* d of (9.6) */
    cairn_real disagreement;
    /* (9.6) */
    cairn_real gamma;
} cairn_merge_score;

/* Scores a place of map b beside map a (a_b in the frames of the maps) at once. psi,
 * disagreement and gamma are those of an even choice of cells, d of exact disagreement; as
 * written of all cells, with one kernel. CAIRN_BAD_ARGUMENT: no such maps, or they are not
 * prepared (no merging has ended); CAIRN_NOT_FINITE. Linear in the points, as written in the
 * cells. */
CAIRN_CHECKED cairn_status cairn_map_merge_score(const cairn_map_merge *merge, int32_t a, int32_t b,
                                                 cairn_pose a_b, cairn_merge_score *score);

/* ---- The result: of the last merging that ended ---- */

typedef int32_t cairn_merge_verdict;
enum {
    CAIRN_MERGE_PLACED = 0,
    CAIRN_MERGE_EMPTY = 1,      /* refused: no wall, or nothing known, in it */
    CAIRN_MERGE_NO_OVERLAP = 2, /* refused: no place agrees with any other map */
    CAIRN_MERGE_WEAK = 3,       /* refused: the best place has too little support */
    CAIRN_MERGE_AMBIGUOUS = 4,  /* refused: another place has nearly as much */
    CAIRN_MERGE_SLIDES = 5,     /* refused: it could be shifted along its walls */
    CAIRN_MERGE_NO_CORNER = 6   /* as written: no corner of it is like one of the maps merged */
};

/* In words, without a full stop. */
const char *cairn_merge_verdict_text(cairn_merge_verdict verdict);

typedef struct cairn_merge_placed {
    cairn_merge_verdict verdict;
    /* of the map's frame in that of the reference; of a refused map the best place found */
    cairn_pose reference_map;
    /* nats from all maps placed with it; as written: Psi against the maps merged before it */
    cairn_real support;
    /* support of its best other place; as written: 0 */
    cairn_real rival;
    /* probability that the place is wrong, 0 ... 1; of the reference 0; as written: the weight
     * of all particles that have the map elsewhere */
    cairn_real wrong;
    /* maps that support it; as written: 1, that with the corner */
    int32_t neighbours;
    /* 0: the reference, 1: the first one merged ...; of refused maps they go on */
    int32_t rank;
    /* rival places beside the map that supports it best */
    int32_t modes;
    /* in the map */
    int32_t corners;
} cairn_merge_placed;

typedef struct cairn_merge_result {
    int32_t maps, placed;
    int32_t reference;
    /* pairs of corners that were tried */
    int32_t hypotheses;
    int32_t resamplings;
    /* after any step: as written, more than `particles` while N_eff is high */
    int32_t most_particles;
    /* of the last step */
    cairn_real n_eff;
    /* nats, of the whole; as written: the sum of Psi */
    cairn_real evidence;
    int64_t units;
} cairn_merge_result;

cairn_merge_result cairn_map_merge_read(const cairn_map_merge *merge);

/* All zero when there is no such map. */
cairn_merge_placed cairn_map_merge_of(const cairn_map_merge *merge, int32_t map);

/* Rival places of map b beside map a, the best first; 0 when there are no more. *a_b is in the
 * frames of the maps; as written, *evidence is the similarity of the corners, 0 ... 1. */
int32_t cairn_map_merge_mode(const cairn_map_merge *merge, int32_t a, int32_t b, int32_t index,
                             cairn_pose *a_b, cairn_real *evidence);

#ifdef __cplusplus
}
#endif

#endif
