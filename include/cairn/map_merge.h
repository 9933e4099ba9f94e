/* map_merge: global alignment of the occupancy grids of several robots without an initial guess
 * (Adluru 2008, chapter 9).
 *
 * Method. A particle filter over the poses of the maps, with one map added per step. Proposals are
 * registrations of structures: corners, wall directions, and points of curved walls. The weight is
 * the agreement of the map with those placed before. (The thesis: a virtual robot visits one map
 * after another; its control is a registration, its observation the map.)
 *
 * 1. Structures are extracted from every map, and competing registrations (modes) are found for
 *    every pair of maps.
 * 2. A Rao-Blackwellized particle filter follows the competing hypotheses until later maps resolve
 *    them.
 * 3. The best particle is refined jointly and verified. A map without sufficient support is
 *    rejected with a reason.
 * 4. Maps that are distorted, whose walls are off by more than 0.65 cells, move to the pose that is
 *    least off over all walls in common; their supports stay those of the pose before.
 *
 * Mode CAIRN_MODE_AS_WRITTEN is chapter 9 as printed. The control is the closed-form registration
 * of pairs of similar corners alone. The weight is Psi and gamma (9.5, 9.6) of whole images against
 * the map merged so far. The filter draws from the optimal proposal (9.3) and has more than
 * `particles` particles while N_eff is at least half of them. Nothing is refined, and only maps
 * without a corner similar to one of the merged maps are rejected. Choices, where the text is
 * silent:
 *
 * - A corner is where the lines of two segments of 0.20 m and more cross at 50 to 130 degrees,
 *   within 0.5 m of an end of both. Of a map the max_corners (48) strongest are used.
 * - Two corners are similar when both are concave, convex or mixed and their openings differ by at
 *   most 10 degrees. The max_modes pairs whose leg lengths, in order, agree best are registered.
 * - A registration is the least-squares motion of three points of each corner: its vertex and a
 *   point on either leg, as far away as both corners have that leg.
 * - p(x | x', u) is a sum of Gaussians about the registrations of a map, with sigma 0.2 m and 0.05
 *   rad, all maps alike. It is sampled at the registrations themselves, so no Gaussian (9.4) is
 *   fitted.
 * - The kernel of Psi and gamma has mu = 0 and sigma = 0.5 cells (of 0.5, 1 and 2 the best on other
 *   arenas) and is 0 from 10 sigma on. Manhattan distances run along the rows and columns of the
 *   image that is searched for the nearest cell: no image is resampled.
 * - {c1, c2} in gamma is read as both orders, so d has four terms. d is at least 1e-6. A single
 *   candidate has Psi~ = gamma~ = 1, and so have all when the sum is 0.
 * - A cell of the merged map has the class that most maps give it, and is occupied in a tie. Its
 *   cells are those of the reference.
 * - u registers a map with all merged maps (section 9.2.1), not only with the last one (9.3).
 * - The filter starts at the reference with one particle. Beyond twice `particles` the lightest are
 *   dropped. A particle has exp(H) followers, H the entropy of its proposal, at most 12.
 * - A particle proposes at most 1024 registrations (2^19 / particles when that is fewer), those of
 *   the most similar corners first; with 12 modes 19 maps may have more. Those beyond are counted
 *   in candidates_dropped.
 * - The result is the heaviest particle. A pose that would make the merged map larger than 6
 *   max_cells is left out.
 *
 *     clear -> add() for each map -> begin() -> step(budget) until CAIRN_OK -> read(), of() */
#ifndef CAIRN_MAP_MERGE_H
#define CAIRN_MAP_MERGE_H

#include "cairn/corner.h"
#include "cairn/object.h"
#include "cairn/occupancy_grid.h"
#include "cairn/particle_filter.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Merging of occupancy grids. */
typedef struct cairn_map_merge cairn_map_merge;

/* Perception model: how a candidate pose of a map is weighted. */
typedef int32_t cairn_map_merge_perception;
enum {
    /* log-likelihood ratio: length of agreeing wall less free-space violations, in nats */
    CAIRN_MAP_MERGE_LIKELIHOOD_RATIO = 0,
    /* image similarity Psi and gamma of the thesis (eqs. 9.5, 9.6) */
    CAIRN_MAP_MERGE_IMAGES = 1
};

/* Parameters; defaults in brackets. */
typedef struct cairn_map_merge_params {
    /* 1 ... 64 (16): maximum number of maps */
    int32_t max_maps;
    /* 1 ... 2^28 (2,560,000): capacity for the cells of all maps together */
    int32_t max_cells;
    /* 1 ... max_cells (160,000): capacity for the cells of one map */
    int32_t max_map_cells;
    /* 64 ... 2^16 (4096): surface points sampled per map; evenly spread where there are more
     * cells */
    int32_t max_points;
    /* 1 ... 4096 (256): line segments per map */
    int32_t max_segments;
    /* 1 ... 1024 (48): corners per map, the strongest */
    int32_t max_corners;
    /* 1 ... 32 (6): competing registrations (modes) kept per pair of maps */
    int32_t max_modes;
    /* 1 ... 4096 (100): particles of the filter. One suffices where no later map has to resolve an
     * ambiguity; where one has to, ten do as well as a hundred, the figure of the thesis. */
    int32_t particles;
    /* any (CAIRN_MAP_MERGE_LIKELIHOOD_RATIO): perception model */
    cairn_map_merge_perception perception;
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN (CAIRN_MODE_DEFAULT): as written, perception must
     * be CAIRN_MAP_MERGE_IMAGES */
    int32_t mode;
    /* cells of the first map, > 0 (10): correlation length of errors along a wall: wall of this
     * length counts as one observation */
    cairn_real correlation_length;
    /* nats, > 0 (6): minimum support, a log-likelihood ratio; a map with less is rejected; not as
     * written */
    cairn_real min_score;
    /* nats, >= 0 (3): minimum margin over the best competing pose; not as written */
    cairn_real min_margin;
    /* any (1): seed of the random numbers */
    uint64_t seed;
} cairn_map_merge_params;

/* Returns the default parameters, for 16 maps of 400 x 400 cells. */
cairn_map_merge_params cairn_map_merge_default(void);

/* Returns chapter 9 as written: as above, but image similarity, 50 particles (the thesis: 50 to 100
 * in the mean) and 12 modes, the pairs of similar corners of two maps. */
cairn_map_merge_params cairn_map_merge_as_written(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_map_merge_check(const cairn_map_merge_params *params,
                                                 cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for invalid params. */
size_t cairn_map_merge_memory(const cairn_map_merge_params *params);

/* Creates a map merger in the pool. CAIRN_BAD_ARGUMENT: NULL or invalid params. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_map_merge_create(cairn_map_merge **merge, cairn_pool *pool,
                                                  const cairn_map_merge_params *params);

/* An input map. Cells are CAIRN_OCCUPANCY_GRID_OCCUPIED or CAIRN_OCCUPANCY_GRID_FREE; all other
 * values are unknown. */
typedef struct cairn_map_merge_map {
    /* row 0 lowest; must stay valid until merging has ended */
    cairn_raster_u8_view cells;
    /* m, side of a cell; may differ between maps */
    cairn_real resolution;
    /* pose of the lower left corner of cell (0, 0) in the frame of the map, m and rad */
    cairn_pose origin;
} cairn_map_merge_map;

/* Downsamples a grid by k: an output cell is occupied when any of its k x k cells is, else free
 * when any is free, else unknown. For maps distorted by more than two cells, which agree only at a
 * coarse resolution. out: size of `cells` divided by k, rounded up. CAIRN_BAD_ARGUMENT: a bad view,
 * k < 1, or another size. Linear in cells.
 *
 * cells: the grid
 * k: cells of the side of an output cell, >= 1 */
CAIRN_CHECKED cairn_status cairn_map_merge_coarsen(cairn_raster_u8_view cells, int32_t k,
                                                   cairn_raster_u8 out);

/* Removes all maps. Constant time. */
void cairn_map_merge_clear(cairn_map_merge *merge);

/* Adds a map; its index is the number of maps before it. CAIRN_BAD_ARGUMENT: NULL, a bad view, a
 * resolution that is not > 0, or merging is in progress. CAIRN_NOT_FINITE: the resolution or the
 * origin. CAIRN_FULL: max_maps, max_cells or max_map_cells. *fault, when not NULL, gives the
 * reason. Constant time. */
CAIRN_CHECKED cairn_status cairn_map_merge_add(cairn_map_merge *merge,
                                               const cairn_map_merge_map *map, cairn_fault *fault);

/* Sets an initial guess of a map's pose in the frame of the reference, as from an earlier merging.
 * The pose becomes a candidate and is kept unless another one is better by min_margin.
 * CAIRN_BAD_ARGUMENT: no such map. CAIRN_NOT_FINITE. CAIRN_UNSUPPORTED: as written. Constant
 * time.
 *
 * map: index of the map */
CAIRN_CHECKED cairn_status cairn_map_merge_guess(cairn_map_merge *merge, int32_t map,
                                                 cairn_pose reference_map);

/* Starts merging. reference: the map whose frame is the merged frame. order: NULL, or [maps] a
 * permutation that begins with the reference: the order of merging. CAIRN_BAD_ARGUMENT: no such
 * reference, or not a permutation. CAIRN_EMPTY: no maps. Linear in maps. */
CAIRN_CHECKED cairn_status cairn_map_merge_begin(cairn_map_merge *merge, int32_t reference,
                                                 const int32_t *order);

/* Continues merging. CAIRN_OK: the result is ready. CAIRN_MORE: the budget is used up. Cost per
 * map: about 3 units a cell. Cost per pair of maps: 2 to 16 units for each translation tried (two
 * cells apart, in at most six rotations: about 100,000 for maps of 200 by 200 cells), as many for
 * each pair of curve points (at most 256 a map), and about 200,000 to refine its best
 * modes; then 2 to 4 units for each surface point of the pair, up to 48 when one of its maps is
 * distorted. The total grows with the square of the maps. */
CAIRN_CHECKED cairn_status cairn_map_merge_step(cairn_map_merge *merge, cairn_budget *budget);

/* ---- Score of one relative pose of two maps ---- */

/* Scores of a relative pose of two maps. */
typedef struct cairn_map_merge_pair_score {
    /* nats: (1.7 agreeing_wall - 4 free_space_violation) / (correlation_length times the first
     * map's resolution) */
    cairn_real log_likelihood_ratio;
    /* m: length of wall that both maps have; a long straight wall counts by the root of its
     * length */
    cairn_real agreeing_wall;
    /* m: length of wall of either map that lies in observed free space of the other */
    cairn_real free_space_violation;
    /* share of the smaller map's free cells that the other map has observed */
    cairn_real overlap;
    /* image similarity Psi (9.5), 0 ... 4 */
    cairn_real psi;
    /* image disagreement d of (9.6) */
    cairn_real disagreement;
    /* gamma = -log d - d (9.6) */
    cairn_real gamma;
} cairn_map_merge_pair_score;

/* Scores the relative pose a_b of map b in the frame of map a, at once. psi, disagreement and gamma
 * use an evenly spread sample of cells, d exact disagreement; as written all cells and one kernel.
 * CAIRN_BAD_ARGUMENT: no such maps, or not prepared (no merging has ended). CAIRN_NOT_FINITE.
 * Linear in the points, as written in the cells.
 *
 * score: set to the scores
 * a, b: indices of the maps */
CAIRN_CHECKED cairn_status cairn_map_merge_score(const cairn_map_merge *merge, int32_t a, int32_t b,
                                                 cairn_pose a_b, cairn_map_merge_pair_score *score);

/* ---- Result of the last merging that has ended ---- */

/* Whether a map was placed, or why not. */
typedef int32_t cairn_map_merge_verdict;
enum {
    /* placed in the frame of the reference */
    CAIRN_MAP_MERGE_PLACED = 0,
    /* rejected: it has no wall, or no known cell */
    CAIRN_MAP_MERGE_EMPTY = 1,
    /* rejected: no pose agrees with any other map */
    CAIRN_MAP_MERGE_NO_OVERLAP = 2,
    /* rejected: the best pose has too little support */
    CAIRN_MAP_MERGE_LOW_SUPPORT = 3,
    /* rejected: a competing pose has nearly as much support */
    CAIRN_MAP_MERGE_AMBIGUOUS = 4,
    /* rejected: translation along its walls is unobservable */
    CAIRN_MAP_MERGE_UNOBSERVABLE = 5,
    /* as written: no corner is similar to one of the merged maps */
    CAIRN_MAP_MERGE_NO_CORNER = 6
};

/* Returns the verdict in words, without a full stop. */
const char *cairn_map_merge_verdict_text(cairn_map_merge_verdict verdict);

/* Returns the probability, 0.001 ... 1, that a pose is wrong, from its support and that of its best
 * competing pose, as of a map that is placed by default. For the best of several mergings of the
 * same maps: competing_support is then the most that a pose elsewhere has in any of them.
 *
 * support: nats, log-likelihood ratio of the pose; below 0 as 0
 * competing_support: nats, of the best competing pose; 0: none; below 0 as 0 */
cairn_real cairn_map_merge_error_probability(cairn_real support, cairn_real competing_support);

/* Result of one map, placed or rejected. */
typedef struct cairn_map_merge_placed {
    /* whether the map was placed, or why not */
    cairn_map_merge_verdict verdict;
    /* pose of the map's frame in that of the reference, m and rad; the best pose found for a
     * rejected map */
    cairn_pose reference_map;
    /* nats: log-likelihood ratio against all maps placed; as written: Psi against the maps merged
     * before it */
    cairn_real support;
    /* nats: support of its best competing pose; as written: 0 */
    cairn_real competing_support;
    /* probability that the pose is wrong, 0 ... 1, of the reference 0: what
     * cairn_map_merge_error_probability() has of both supports; as written: the weight of all
     * particles that have the map elsewhere */
    cairn_real error_probability;
    /* maps that support it; as written: 1, the map with the similar corner */
    int32_t neighbours;
    /* 0: the reference, 1: the first one merged ...; rejected maps come last */
    int32_t rank;
    /* modes relative to the map that supports it best */
    int32_t modes;
    /* corners in the map */
    int32_t corners;
} cairn_map_merge_placed;

/* Result of a merging. */
typedef struct cairn_map_merge_result {
    /* number of maps, and of those that were placed */
    int32_t maps, placed;
    /* map whose frame is the merged frame */
    int32_t reference;
    /* registrations of structures that were tried */
    int32_t hypotheses;
    /* resamplings of the particle filter */
    int32_t resamplings;
    /* largest number of particles after any step: as written, more than `particles` while N_eff is
     * high */
    int32_t peak_particles;
    /* effective sample size of the last step */
    cairn_real n_eff;
    /* nats: total log-likelihood ratio of all pairs placed; as written: the sum of Psi */
    cairn_real log_likelihood_ratio;
    /* work units charged */
    int64_t units;
    /* as written: registrations beyond the most that a particle proposes, of all steps */
    int32_t candidates_dropped;
} cairn_map_merge_result;

/* Returns the summary of the result. */
cairn_map_merge_result cairn_map_merge_read(const cairn_map_merge *merge);

/* Returns the result of one map; all zero when there is no such map. */
cairn_map_merge_placed cairn_map_merge_of(const cairn_map_merge *merge, int32_t map);

/* ---- The best of several mergings of the same maps, with coarser and coarser cells ---- */

/* Returns the k of cairn_map_merge_coarsen() to merge with first (k = 0), or next, after a result
 * with k whose maps are not all sure; 0: no coarser. The longest side has at most 800 cells, and at
 * least 175 unless it has fewer at the start. Constant time.
 *
 * k: 0 ... 2^30, cells of the side of an output cell
 * longest_side: >= 1, of all maps, cells */
int32_t cairn_map_merge_next_coarsening(int32_t k, int32_t longest_side);

/* Returns 1 when the result places more maps than the best one so far, or as many with a higher
 * log-likelihood ratio. Constant time.
 *
 * result: of a merging
 * best: of the best one before it */
int32_t cairn_map_merge_is_better(const cairn_map_merge_result *result,
                                  const cairn_map_merge_result *best);

/* Returns 1 when a placement is sure: its error probability is at most 0.01. Constant time.
 *
 * placed: result of one map */
int32_t cairn_map_merge_is_sure(const cairn_map_merge_placed *placed);

/* Gets mode `index` of map b relative to map a, the best first; returns 0 beyond the last. *a_b is
 * in the frames of the maps. As written, *log_ratio is the similarity of the corners, 0 ... 1.
 *
 * a, b: indices of the maps
 * index: 0: the best
 * log_ratio: set to the score, nats
 * a_b: set to the pose of map b in the frame of map a */
int32_t cairn_map_merge_mode(const cairn_map_merge *merge, int32_t a, int32_t b, int32_t index,
                             cairn_pose *a_b, cairn_real *log_ratio);

#ifdef __cplusplus
}
#endif

#endif
