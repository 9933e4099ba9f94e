/* Internal state and functions shared by the source files of module map_merge:
 *
 * - map_merge.c: params, memory, inputs, the step of all
 * - map_merge_prepare.c: distance maps, surface points, lines and corners of each map
 * - map_merge_pairs.c: competing registrations of two maps from corners
 * - map_merge_search.c: ... from wall directions and all translations
 * - map_merge_curve_points.c: ... from points of curved walls
 * - map_merge_modes.c: lists of the best registrations
 * - map_merge_refine.c: Gauss-Newton refinement by lines and curve points
 * - map_merge_average.c: ... of distorted maps, by all surface points
 * - map_merge_score.c, map_merge_image.c: scores of a relative pose
 * - map_merge_filter.c: the particle filter
 * - map_merge_check.c: joint refinement and verification of the result
 * - map_merge_corners.c, map_merge_written.c: the mode as written
 *
 * All internal poses are between the centres of the maps' grids (the middle of the raster, axes
 * along its rows and columns), where rotation errors move cells least. */
#ifndef CAIRN_MERGING_MAP_MERGE_WORK_H
#define CAIRN_MERGING_MAP_MERGE_WORK_H

#include "cairn/map_merge.h"
#include "cairn/registration.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_map_merge_parameters;

enum {
    MAP_MERGE_MAX_MAPS = 64,
    MAP_MERGE_MAX_DISTANCE = 127,  /* distances in cells saturate here (7 bits of a packed cell) */
    MAP_MERGE_COARSE_POINTS = 96,  /* points per map that score a hypothesis first */
    MAP_MERGE_REFINE_POINTS = 320, /* points per map that refine a mode */
    MAP_MERGE_MAX_HYPOTHESES = 96, /* hypotheses of a pair that are scored again */
    MAP_MERGE_MAX_REFINED = 20,    /* hypotheses of a pair that are refined */
    MAP_MERGE_MAX_CURVE_POINTS = 256, /* points of curved walls per map */
    MAP_MERGE_MAX_ROTATIONS = 6,      /* rotations in which a pair is correlated */
    MAP_MERGE_ANGLE_BINS = 360,       /* bins of the direction histogram over the circle */
    MAP_MERGE_POINTS_PER_UNIT = 8,
    MAP_MERGE_BLOCKS_PER_UNIT = 4,   /* states of the filter that are released */
    MAP_MERGE_MAX_REFINE_STEPS = 40, /* maximum steps of a refinement */
    MAP_MERGE_MAX_CANDIDATES = 12,   /* candidates of a particle's proposal */
    MAP_MERGE_CACHED_PROPOSALS = 8,
    MAP_MERGE_CACHE_SLOTS = 8192 /* cached scores of pairs of maps, a power of two */
};

/* m: internal side of a cell of the first map. */
#define MAP_MERGE_CELL CAIRN_REAL(0.05)

/* m: radius of a map that relates rotation and translation. */
#define MAP_MERGE_BODY_RADIUS_M CAIRN_REAL(3.0)

/* m: minimum length of a line used for refinement. */
#define MAP_MERGE_MIN_LINE_M CAIRN_REAL(0.35)

/* Non-maximum suppression: modes closer than this, m and rad, are duplicates. COARSE holds during
 * the search, SAME for the result. */
#define MAP_MERGE_COARSE_M   CAIRN_REAL(0.25)
#define MAP_MERGE_COARSE_RAD CAIRN_REAL(0.10)
#define MAP_MERGE_SAME_M     CAIRN_REAL(0.30)
#define MAP_MERGE_SAME_RAD   CAIRN_REAL(0.10)

/* A packed cell of 16 bits: distance to the nearest occupied cell (bits 0-6), to the nearest free
 * one (bits 7-13), class (bits 14-15). */
enum { MAP_MERGE_UNKNOWN = 0, MAP_MERGE_FREE = 1, MAP_MERGE_OCCUPIED = 2 };

static inline int32_t map_merge_to_occupied(uint16_t cell)
{
    return cell & 127;
}

static inline int32_t map_merge_to_free(uint16_t cell)
{
    return cell >> 7 & 127;
}

static inline int32_t map_merge_class(uint16_t cell)
{
    return cell >> 14;
}

typedef struct map_merge_point {
    cairn_vec2 position;  /* m, from the centre of the grid */
    cairn_vec2 normal;    /* unit normal into free space */
    cairn_vec2 free_side; /* m: a point a few cells in front, in free space */
    cairn_real weight;    /* weight in the log-likelihood ratio: a long straight wall saturates */
    int32_t cell;         /* index in the grid */
    int32_t is_curved;    /* 1: on no line long enough to refine by */
} map_merge_point;

/* Direction of a line and its length. */
typedef struct map_merge_direction {
    cairn_real angle, length; /* rad, free space on the left; m */
} map_merge_direction;

/* A surface point of a wall that is not straight, off all lines. */
typedef struct map_merge_curve_point {
    cairn_vec2 position, normal; /* between free and occupied cells, m; unit, into free space */
} map_merge_curve_point;

typedef struct map_merge_map {
    cairn_map_merge_map input;
    cairn_pose map_centre;           /* centre of the grid in the frame of the map */
    cairn_vec2 corner;               /* m: lower left of cell (0, 0) relative to the centre */
    uint16_t *grid;                  /* [height][width] packed cells */
    map_merge_point *points;         /* [point_count]; every prefix is an evenly spread sample */
    cairn_vec2 *free_cells;          /* [free_cell_count] free cells, likewise; m */
    cairn_corner *corners;           /* [corner_count] */
    cairn_segment *lines;            /* [line_count], free space on their left */
    map_merge_direction *directions; /* [line_count] their directions */
    map_merge_curve_point *curve_points; /* [curve_point_count], evenly spread */
    cairn_real curved_wall;              /* m of wall off all lines */
    int32_t point_count, free_cell_count, corner_count, line_count, curve_point_count;
    int32_t occupied_count, free_count; /* numbers of cells */
    cairn_real spacing;                 /* m of wall per point */
    int32_t has_guess;
    cairn_pose given_guess; /* initial guess of the map's frame in that of the reference */
    cairn_pose guess;       /* the same between the centres */
} map_merge_map;

/* A registration hypothesis: a pose of the pair's second map in the frame of its first one.
 * log_ratio: log-likelihood ratio in nats; as written the similarity of corners. */
typedef struct map_merge_mode {
    cairn_pose first_second;
    cairn_real log_ratio;
} map_merge_mode;

/* Counts of one map's points looked up in the grid of another. */
typedef struct map_merge_sums {
    /* points that agree, and that violate free space */
    cairn_real agree, conflict;
    /* likewise, with a wider kernel for the search */
    cairn_real soft_agree, soft_conflict;
    /* m: sum of the points in known cells, in the frame of the grid */
    cairn_vec2 centroid_sum;
    int32_t known_count;
} map_merge_sums;

/* Resume points of the steps that run one another, the outermost first. */
typedef struct map_merge_resume {
    uint16_t run;
    uint16_t stage; /* preparation, search of modes, filter, verification */
    uint16_t phase; /* of a stage: of one map, one pair of maps, one particle */
    uint16_t part;  /* of a phase: one mode, one candidate, one map */
    /* distances of one map; pattern search; refinement by lines, and by those of one neighbour; score
     * against all neighbours, and against one */
    uint16_t pack, climb, lines, neighbour, total, comparison;
    uint16_t images; /* image similarity to all neighbours */
} map_merge_resume;

/* Indices of two items that are compared: corners, lines or curve points of a pair of maps, or two
 * maps. */
typedef struct map_merge_item_pair {
    int32_t first, second;
} map_merge_item_pair;

/* Preparation of one map. */
typedef struct map_merge_preparation {
    int32_t map; /* index of the map */
    cairn_distance_map *distances;
    int32_t *scratch; /* [max_map_cells] distances, then 1 + index of the point in a cell */
    int32_t *queue;   /* [max_points] points of the line being grown */
    int32_t *label;   /* [max_points] */
    cairn_vec2 *line; /* [max_points] */
    map_merge_point *shuffled; /* [max_points] */
    cairn_corner_set *corners;
    int32_t cell; /* that is packed or sampled */
    /* whose normal is found, from which a line grows, or that may be a curve point */
    int32_t point;
    /* points of the line: found, with their neighbours added, and found at the last fit */
    int32_t queued, grown, fitted;
    cairn_vec2 line_at, line_normal;          /* anchor and normal of the region-growing test */
    int32_t surface, seen_surface, seen_free; /* counts of cells during sampling */
} map_merge_preparation;

/* Modes of the pairs of maps. */
typedef struct map_merge_pairs {
    map_merge_mode *modes;                               /* [pairs][max_modes] */
    int32_t *mode_count;                                 /* [pairs] */
    int32_t first, second;                               /* indices of the current pair of maps */
    map_merge_mode hypotheses[MAP_MERGE_MAX_HYPOTHESES]; /* of the current pair, best first */
    map_merge_mode refined[MAP_MERGE_MAX_REFINED];
    int32_t hypothesis_count, refined_count;
    map_merge_item_pair corners;
    int32_t hypothesis; /* that is scored again */
    int32_t mode;       /* that is refined */
    /* start of the refinement: the mode, then its refined pose rotated to either side about the
     * pivot */
    int32_t variant;
    cairn_pose base;
    cairn_vec2 base_pivot;
} map_merge_pairs;

/* Registration by wall directions and all translations. */
typedef struct map_merge_search {
    cairn_real bins[MAP_MERGE_ANGLE_BINS]; /* histogram of direction differences */
    map_merge_item_pair lines;
    cairn_real rotations[MAP_MERGE_MAX_ROTATIONS]; /* rad: peaks of the histogram */
    int32_t rotation_count, rotation;              /* number, and the current one */
    cairn_real cosine, sine;                       /* of the current one */
    cairn_real wall;                               /* m of wall per coarse point */
    /* points rotated, in the other map's cells */
    cairn_vec2 first[MAP_MERGE_COARSE_POINTS], second[MAP_MERGE_COARSE_POINTS];
    cairn_vec2 first_front[MAP_MERGE_COARSE_POINTS], second_front[MAP_MERGE_COARSE_POINTS];
    int32_t first_count, second_count;
    cairn_box translations; /* m: their range */
    int32_t columns, rows, column, row;
    cairn_pose first_second; /* current rotation and translation */
    cairn_vec2 there, back;  /* translation of the second map, in cells of the first, and back */
    int32_t point;           /* points of each map that were looked up */
    map_merge_sums sums;
} map_merge_search;

/* Registration by pairs of curve points. */
typedef struct map_merge_curves {
    cairn_real wall; /* m of wall per coarse point */
    map_merge_item_pair points;
    cairn_transform there, back; /* second to first map, and back */
    int32_t point;               /* points of each map that were looked up */
    map_merge_sums sums;
} map_merge_curves;

/* Scoring of one relative pose of two maps: points of each looked up in the grid of the other. */
typedef struct map_merge_comparison {
    int32_t first, second;
    cairn_pose first_second;
    cairn_transform second_to_first, first_to_second;
    int32_t point_counts[2];  /* points of the second and of the first map that are compared */
    int32_t direction, point; /* whose points are looked up, and the next one */
    map_merge_sums sums[2];
} map_merge_comparison;

enum { MAP_MERGE_ENDED = -1, MAP_MERGE_DEFERRED = -2 };

/* A particle's state: the pose of one map in the merged frame. */
typedef struct map_merge_state {
    /* MAP_MERGE_ENDED: no map left; MAP_MERGE_DEFERRED - map: that map is deferred. */
    int32_t map;
    int32_t source_map; /* the map whose mode proposed it */
    cairn_pose reference_map;
    cairn_real log_ratio; /* nats, given the maps before it */
    cairn_real psi, gamma;
} map_merge_state;

/* The cached proposal of a particle: candidates for its next state. */
typedef struct map_merge_proposal {
    const map_merge_state *state; /* the particle's last one */
    map_merge_state candidates[MAP_MERGE_MAX_CANDIDATES];
    int32_t count;
} map_merge_proposal;

/* Refinement of a map's pose relative to its neighbours, by Gauss-Newton steps. */
typedef struct map_merge_fit {
    int32_t map;
    cairn_pose pose, start;     /* current pose, and the one that a prior holds */
    int32_t rounds;             /* steps left */
    cairn_registration robust;  /* of the current step */
    int32_t neighbour;          /* the current one */
    const map_merge_map *other; /* its map */
    /* Transforms: of the current neighbour; map to neighbour; neighbour to map. */
    cairn_transform neighbour_transform, to_neighbour, to_map;
    /* m: the larger cell side of both maps */
    cairn_real cell;
    int32_t line, point; /* a point of the surface, on lines or off all of them */
} map_merge_fit;

/* Pattern search of the maximum of a map's score against its neighbours. */
typedef struct map_merge_climb {
    cairn_pose best;
    cairn_real score;
    cairn_real cells, last; /* cells: size of the pattern, and its minimum */
    cairn_real step, turn;  /* m and rad: the same */
    cairn_vec2 pivot;
    int32_t points; /* points per map that are compared */
    int32_t direction, rounds;
    int32_t improved; /* 1: the current pattern has improved the pose */
} map_merge_climb;

typedef struct map_merge_cache_entry {
    int32_t first, second; /* maps; first -1: empty slot */
    int32_t x, y, theta;   /* quantized pose */
    cairn_real log_ratio;
} map_merge_cache_entry;

/* Score of a pose of one map against all neighbours. */
typedef struct map_merge_total {
    cairn_pose pose;
    int32_t map;
    int32_t points;            /* points per map that are compared */
    int32_t neighbour;         /* the current one */
    map_merge_cache_entry key; /* its score in the cache */
    int32_t neighbours;        /* neighbours that support the map */
    cairn_real log_ratio, soft_score;
    cairn_vec2 centroid_sum;
    cairn_real known_count;
} map_merge_total;

/* Proposals of a step of the filter. */
typedef struct map_merge_proposals {
    map_merge_proposal cached[MAP_MERGE_CACHED_PROPOSALS]; /* many particles are alike */
    int32_t count;
    map_merge_proposal *current; /* of the current particle */
    int32_t candidate;           /* of it, that is scored */
    int32_t neighbour;           /* whose image is compared */
    cairn_real overlap;          /* largest one so far */
    /* normalizers over all candidates of the step */
    cairn_real psi_sum, gamma_sum, gamma_min;
    int32_t emitted;
} map_merge_proposals;

/* Joint refinement and verification. */
typedef struct map_merge_verification {
    int32_t list[MAP_MERGE_MAX_MAPS]; /* placed maps in order of merging */
    int32_t count;
    cairn_pose pose[MAP_MERGE_MAX_MAPS];  /* of each map, in the frame of the reference's centre */
    cairn_pose start[MAP_MERGE_MAX_MAPS]; /* poses of the filter's result */
    int32_t accepted[MAP_MERGE_MAX_MAPS];
    int32_t round;            /* of the joint refinement */
    int32_t current;          /* index in the list of the map that is refined or verified */
    int32_t refused;          /* 1: a map has been rejected since the last cut */
    map_merge_item_pair pair; /* indices in the list of the maps that are compared */
    /* nats: log-likelihood ratio of each pair */
    cairn_real pair_score[MAP_MERGE_MAX_MAPS * (MAP_MERGE_MAX_MAPS - 1) / 2];
    map_merge_mode competing[MAP_MERGE_MAX_REFINED];
    int32_t competing_count;
    int32_t trial;            /* pose of a map: its own, competing, then shifted ones */
    cairn_real shifted_score; /* nats: score of the best shifted pose */
} map_merge_verification;

/* ---- Mode as written ---- */

/* Sums of Psi and d of two images (9.5, 9.6): rows of one image, then of the other. */
typedef struct map_merge_images {
    int32_t resume, units_charged;
    const map_merge_map *map[2];
    cairn_transform to_other[2];
    /* columns and rows of map k within the kernel's reach of the other: [k][0 column, 1 row] */
    int32_t begin[2][2], end[2][2];
    /* the image whose rows are added, and the row */
    int32_t turn, row;
    cairn_real same[2][2],
        /* sums of the kernel, [map][class - MAP_MERGE_FREE]: to the same class, and to the other
         * class */
        other[2][2];
    /* free cells of the second map that the first one has observed */
    int32_t known;
} map_merge_images;

/* Candidates of a particle; shared by particles of the same history. */
typedef struct map_merge_places {
    const map_merge_state *state;
    int32_t first, count;
} map_merge_places;

/* State of the mode as written. */
typedef struct map_merge_written {
    /* merged map of the current particle, in the frame of the reference's centre */
    map_merge_map merged;
    /* [max_cells] its classes */
    uint8_t *cells;
    int32_t max_cells;
    /* m, bounding box of the merged maps */
    cairn_box box;
    cairn_real kernel[MAP_MERGE_MAX_DISTANCE + 1];
    /* [max_candidates] candidates of this step; log_ratio is the log of their prior mass */
    map_merge_state *candidates;
    int32_t candidate_count, max_candidates;
    /* [max_particles] of the filter */
    map_merge_places *places;
    int32_t neighbour, row; /* map that is drawn, and the row of the merged map */
    int32_t candidate;      /* that is scored */
    /* normalizers over all candidates; gamma relative to the first one's */
    cairn_real psi_sum, gamma_first, gamma_sum, gamma_min;
    int32_t emitted;
    /* steps of the filter */
    int32_t steps;
    /* particles at the end of a step, maximum */
    int32_t peak_particles;
    /* registrations beyond the capacity of a proposal, of all steps */
    int32_t dropped_count;
    map_merge_images images;
} map_merge_written;

struct cairn_map_merge {
    /* units charged for the operation that waits */
    int32_t units_charged;
    map_merge_resume resume;
    int32_t is_running; /* 1: step() has work left */
    int32_t done;       /* 1: the result is ready */
    int64_t units;

    cairn_map_merge_params params;
    map_merge_map *maps; /* [max_maps] */
    int32_t map_count;
    int64_t cells;  /* of all maps */
    uint16_t *grid; /* [max_cells] */
    /* m per internal unit of length, in which a cell of the first map has side MAP_MERGE_CELL: all
     * limits are in cells */
    cairn_real unit;
    int32_t reference;
    int32_t order[MAP_MERGE_MAX_MAPS];
    int32_t has_order;

    map_merge_preparation prepared;
    map_merge_pairs pairs;
    map_merge_search search;
    map_merge_curves curves;
    int32_t tried_count;
    map_merge_comparison comparison;
    cairn_real soft_kernel[MAP_MERGE_MAX_DISTANCE + 1]; /* weight of a distance in cells */
    map_merge_climb climb;
    map_merge_fit fit;

    /* The maps that the current one is compared with, and their poses. */
    struct {
        int32_t maps[MAP_MERGE_MAX_MAPS];
        cairn_pose poses[MAP_MERGE_MAX_MAPS];
        int32_t count;
    } neighbours;
    int32_t deferrals[MAP_MERGE_MAX_MAPS]; /* how often a map was deferred */
    map_merge_total total;

    cairn_particle_filter *filter;
    int32_t filter_step;
    map_merge_proposals proposals;
    union {
        map_merge_cache_entry *cache; /* [MAP_MERGE_CACHE_SLOTS] in the default mode */
        map_merge_written *written;   /* in the mode as written */
    };

    map_merge_verification check;
    cairn_map_merge_placed placed[MAP_MERGE_MAX_MAPS];
    cairn_map_merge_result result;
};

/* Returns the packed cell of a point in cells of the grid; an unknown cell outside. */
static inline uint16_t map_merge_cell_at(const map_merge_map *map, cairn_real x, cairn_real y)
{
    if (!(x >= 0 && y >= 0 && x < (cairn_real)map->input.cells.width &&
          y < (cairn_real)map->input.cells.height))
        return MAP_MERGE_MAX_DISTANCE | MAP_MERGE_MAX_DISTANCE << 7 | MAP_MERGE_UNKNOWN << 14;
    return map->grid[cairn_real_to_int(y) * map->input.cells.width + cairn_real_to_int(x)];
}

/* ---- Search of modes: scores from a few points of each map, counted in points ---- */

/* Returns the m of wall per coarse point, mean of both maps. */
static inline cairn_real map_merge_search_wall(const map_merge_map *first,
                                               const map_merge_map *second)
{
    return (first->spacing * (cairn_real)first->point_count +
            second->spacing * (cairn_real)second->point_count) /
           (cairn_real)(2 * MAP_MERGE_COARSE_POINTS);
}

/* Returns 1 when free-space violations exceed 2.5 plus a third of the agreeing points: early
 * rejection. */
static inline int map_merge_is_rejected(const map_merge_sums *sums)
{
    return sums->soft_conflict > sums->soft_agree / 3 + CAIRN_REAL(2.5);
}

/* Returns the score of a pose in m of wall. */
static inline cairn_real map_merge_search_score(const map_merge_sums *sums, cairn_real wall)
{
    return (sums->soft_agree / 2 - CAIRN_REAL(1.5) * sums->soft_conflict) * wall;
}

/* Steps return 1 at their end, 0 when the budget is used up. */

/* ---- map_merge_prepare.c ---- */

/* Step: prepares all maps. */
int cairn_map_merge_prepare(cairn_map_merge *merge, cairn_budget *budget);

/* Step: computes the distances of a map's cells to occupied and to free ones, packs them with the
 * class into its grid, 16 cells a unit, and counts the cells of each class. */
int cairn_map_merge_pack(cairn_map_merge *merge, map_merge_map *map, cairn_budget *budget);

/* ---- map_merge_search.c ---- */

/* Steps: find the rotations of a pair of maps that their wall directions suggest, and register the
 * pair by all translations in each of them. */
int cairn_map_merge_find_rotations(cairn_map_merge *merge, cairn_budget *budget);
int cairn_map_merge_try_translations(cairn_map_merge *merge, cairn_budget *budget);

/* ---- map_merge_curve_points.c ---- */

/* Step: selects evenly spread points off all lines of the map that is prepared. */
int cairn_map_merge_select_curve_points(cairn_map_merge *merge, cairn_budget *budget);

/* Step: registers a pair of maps by all pairs of curve points. */
int cairn_map_merge_register_curve_points(cairn_map_merge *merge, cairn_budget *budget);

/* Finds the transition from free to occupied cells along a normal from p, within 2.5 cells; returns
 * 1 when there is one. */
int cairn_map_merge_surface_along(const map_merge_map *map, cairn_vec2 p, cairn_vec2 normal,
                                  cairn_real *along);

/* Adds points begin ... end - 1 of `from`, mapped by the transform, looked up in the grid of
 * `to`. */
void cairn_map_merge_sum(const cairn_map_merge *merge, const map_merge_map *to,
                         const map_merge_map *from, const cairn_transform *transform, int32_t begin,
                         int32_t end, map_merge_sums *sums);

/* ---- map_merge_modes.c ---- */

/* Returns 1 when two poses differ by less than the tolerances in m and rad. */
int cairn_map_merge_is_same(cairn_pose a, cairn_pose b, cairn_real metres, cairn_real radians);

/* Inserts a mode into the list of the best `most` modes, best first. Non-maximum suppression: of
 * duplicates within the tolerances only the better one stays. */
void cairn_map_merge_insert_mode(map_merge_mode *list, int32_t *count, int32_t most,
                                 map_merge_mode mode, cairn_real metres, cairn_real radians);

/* Returns 1 when two maps at this relative pose cannot overlap. */
int cairn_map_merge_is_disjoint(const cairn_map_merge *merge, int32_t first, int32_t second,
                                cairn_pose first_second);

/* Inserts a pose of the second map of the current pair, with its search score, into the pair's
 * hypotheses. */
void cairn_map_merge_insert_hypothesis(cairn_map_merge *merge, cairn_pose first_second,
                                       cairn_real score);

/* Inserts a mode into the modes of the current pair. */
void cairn_map_merge_insert_pair_mode(cairn_map_merge *merge, map_merge_mode mode,
                                      cairn_real metres, cairn_real radians);

/* Returns the index of a pair of maps, in either order. */
int32_t cairn_map_merge_pair(int32_t a, int32_t b);

/* Gets mode `index` of map b relative to map a; returns 0 beyond the last. */
int cairn_map_merge_mode_of(const cairn_map_merge *merge, int32_t a, int32_t b, int32_t index,
                            map_merge_mode *mode);

/* ---- map_merge_pairs.c ---- */

/* Step: finds the modes of all pairs of maps. */
int cairn_map_merge_find_modes(cairn_map_merge *merge, cairn_budget *budget);

/* Scores a pose of map `map` against all neighbours; step_total() is the step that completes
 * merge->total. */
void cairn_map_merge_begin_total(cairn_map_merge *merge, int32_t map, cairn_pose pose,
                                 int32_t points);
int cairn_map_merge_step_total(cairn_map_merge *merge, cairn_budget *budget);

/* ---- map_merge_refine.c ---- */

/* Begins to refine a pose of `map` relative to the neighbours, in at most `rounds` steps, near
 * `start`. step_lines(), by lines and curve points, or step_average() is the step after which
 * merge->fit.pose is final. */
void cairn_map_merge_begin_fit(cairn_map_merge *merge, int32_t map, cairn_pose start,
                               cairn_pose pose, int32_t rounds);
int cairn_map_merge_step_lines(cairn_map_merge *merge, cairn_budget *budget);

/* Sets up the current neighbour of the refinement; returns 0 when it cannot overlap. */
int cairn_map_merge_begin_neighbour(cairn_map_merge *merge);

/* Returns the log-likelihood ratio of agreeing and violating lengths of wall, nats. */
cairn_real cairn_map_merge_nats(const cairn_map_merge *merge, cairn_real agree,
                                cairn_real conflict);

/* ---- map_merge_average.c ---- */

/* Begins to move `map` from a pose to that of least residuals of all surface points, when it is
 * distorted against its neighbours; step_average() follows. */
void cairn_map_merge_begin_average(cairn_map_merge *merge, int32_t map, cairn_pose pose);
int cairn_map_merge_step_average(cairn_map_merge *merge, cairn_budget *budget);

static inline int map_merge_is_written(const cairn_map_merge_params *params)
{
    return params->mode == CAIRN_MODE_AS_WRITTEN;
}

/* ---- map_merge_score.c ---- */

/* Scores the pose `centres` of map b's centre relative to that of map a; lengths in internal
 * units. */
void cairn_map_merge_score_at(const cairn_map_merge *merge, int32_t a, int32_t b,
                              cairn_pose centres, cairn_map_merge_pair_score *score);

/* Returns the units of cairn_map_merge_score_at() in the default mode. */
int32_t cairn_map_merge_score_units(const cairn_map_merge *merge, int32_t a, int32_t b);

/* ---- map_merge_filter.c ---- */

cairn_particle_filter_params cairn_map_merge_filter_params(const cairn_map_merge_params *params);
cairn_particle_filter_model cairn_map_merge_model(cairn_map_merge *merge);

/* Step: runs the filter. */
int cairn_map_merge_run_filter(cairn_map_merge *merge, cairn_budget *budget);

/* Collects the maps that a particle has placed as neighbours. Returns 1 when the particle has
 * ended. */
int cairn_map_merge_collect_neighbours(cairn_map_merge *merge, const void *state);

/* Returns 1 when a map is one of the neighbours. */
static inline int map_merge_is_neighbour(const cairn_map_merge *merge, int32_t map)
{
    for (int32_t i = 0; i < merge->neighbours.count; i++)
        if (merge->neighbours.maps[i] == map)
            return 1;
    return 0;
}

/* Collects competing modes of a map relative to all neighbours, best first; returns their
 * number. */
int32_t cairn_map_merge_places(const cairn_map_merge *merge, int32_t map, map_merge_mode *list,
                               int32_t most);

/* Returns 1 when two particles have placed the same maps at the same poses. */
int cairn_map_merge_is_same_history(const map_merge_state *a, const map_merge_state *b);

/* ---- map_merge_image.c ---- */

/* Compares image b, placed at a_b, with image a; step_images() is the step that adds all rows. Four
 * cells a unit. */
void cairn_map_merge_begin_images(map_merge_images *images, const map_merge_map *a,
                                  const map_merge_map *b, cairn_pose a_b);
int cairn_map_merge_step_images(map_merge_images *images, const cairn_real *kernel,
                                cairn_budget *budget);

/* Computes psi, disagreement, gamma and overlap from the sums. */
void cairn_map_merge_end_images(const map_merge_images *images, cairn_map_merge_pair_score *score);

/* Fills in exp(x (2 mu - x) / (2 sigma^2)) for distances 0 ... MAP_MERGE_MAX_DISTANCE in cells. */
void cairn_map_merge_set_kernel(cairn_real *kernel);

/* Step: renders the neighbours into one image, merge->written->merged. */
int cairn_map_merge_draw_merged(cairn_map_merge *merge, cairn_budget *budget);

/* Returns the bounding box of a map's cells at a pose; the union of two boxes; 1 when an image of
 * the box fits. */
cairn_box cairn_map_merge_box_of(const map_merge_map *map, cairn_pose pose);
cairn_box cairn_map_merge_join(cairn_box a, cairn_box b);
int cairn_map_merge_has_capacity(const cairn_map_merge *merge, cairn_box box);

/* ---- map_merge_corners.c ---- */

enum { MAP_MERGE_CORRESPONDENCES = 3 };

/* Returns the least-squares rigid motion from the frame of from[MAP_MERGE_CORRESPONDENCES] to that
 * of to[]. */
cairn_pose cairn_map_merge_motion_of(const cairn_vec2 *to, const cairn_vec2 *from);

/* Step: computes the modes of every pair of maps as registrations of their most similar corners. */
int cairn_map_merge_register_corners(cairn_map_merge *merge, cairn_budget *budget);

/* ---- map_merge_written.c ---- */

enum {
    /* factor of `particles`: bound on the particles while N_eff is at least half of them */
    MAP_MERGE_GROWTH = 2,
    /* factor of max_cells: bound on the cells of the merged map */
    MAP_MERGE_MAX_MERGED_CELLS = 6,
    /* maximum number of registrations in a particle's proposal */
    MAP_MERGE_MAX_PLACES = 1024
};

cairn_particle_filter_params cairn_map_merge_written_params(const cairn_map_merge_params *params);
cairn_particle_filter_model cairn_map_merge_written_model(cairn_map_merge *merge);

/* Steps: run the filter, and take over its best particle. */
int cairn_map_merge_run_written(cairn_map_merge *merge, cairn_budget *budget);
int cairn_map_merge_end_written(cairn_map_merge *merge, cairn_budget *budget);

/* ---- map_merge_check.c ---- */

/* Step: refines and verifies the result of the filter. */
int cairn_map_merge_verify(cairn_map_merge *merge, cairn_budget *budget);

#endif
