/* What the files of the map merging room share: the maps made ready, rival places of pairs, and the
 * state between steps.
 *
 * All poses inside are between the centres of the maps' grids (the middle of the raster, along
 * its rows), where errors of rotation move cells least. */
#ifndef CAIRN_MAPPING_MAP_MERGE_WORK_H
#define CAIRN_MAPPING_MAP_MERGE_WORK_H

#include "cairn/map_merge.h"
#include "cairn/rigid_motion.h"

enum {
    MERGE_MAX_MAPS = 64,
    MERGE_MAX_DISTANCE = 127,     /* distances in cells are capped here */
    MERGE_COARSE_POINTS = 96,     /* by which a pair of corners is judged first */
    MERGE_REFINE_POINTS = 320,    /* by which a place is refined */
    MERGE_MAX_HYPOTHESES = 96,    /* hypotheses of a pair that are looked at again */
    MERGE_MAX_REFINED = 20,       /* ... and refined */
    MERGE_MAX_CURVE_POINTS = 256, /* points of a map off all lines */
    MERGE_MAX_ROTATIONS = 6,      /* rotations in which a pair is correlated */
    MERGE_ANGLE_BINS = 360,       /* of the circle */
    MERGE_POINTS_PER_UNIT = 8,
    MERGE_MAX_REFINE_STEPS = 40, /* steps of a refinement at most */
    MERGE_MAX_CANDIDATES = 12,   /* candidates of a particle */
    MERGE_CACHED_PROPOSALS = 8,
    MERGE_CACHE_SLOTS = 8192 /* scores of pairs of maps that are remembered, a power of two */
};

/* Side of a cell of the first map inside. */
#define MERGE_CELL CAIRN_REAL(0.05)

/* m: shorter lines are not straight enough to refine by. */
#define MERGE_MIN_LINE_M CAIRN_REAL(0.35)

/* Places of one map that differ by less, m and rad, are the same. */
/* Places nearer than this are one while searching. */
#define MERGE_COARSE_M   CAIRN_REAL(0.25)
#define MERGE_COARSE_RAD CAIRN_REAL(0.10)
#define MERGE_SAME_M     CAIRN_REAL(0.30)
#define MERGE_SAME_RAD   CAIRN_REAL(0.10)

/* A packed cell: distance to the nearest occupied cell, to the nearest free one, and its class. */
enum { MERGE_UNKNOWN = 0, MERGE_FREE = 1, MERGE_OCCUPIED = 2 };

static inline int32_t merge_to_occupied(uint16_t cell)
{
    return cell & 127;
}

static inline int32_t merge_to_free(uint16_t cell)
{
    return cell >> 7 & 127;
}

static inline int32_t merge_class(uint16_t cell)
{
    return cell >> 14;
}

typedef struct merge_point {
    cairn_vec2 position;  /* from the centre of the grid */
    cairn_vec2 normal;    /* unit, into free space */
    cairn_vec2 free_side; /* a little before it, where free space begins */
    cairn_real weight;    /* as evidence: a long straight wall is soon known */
    int32_t cell;         /* index in the grid */
    int32_t is_curved;    /* 1: on no line that is long enough to refine by */
} merge_point;

/* The direction of a line and its length. */
typedef struct merge_direction {
    cairn_real angle, length; /* rad, free space on the left; m */
} merge_direction;

/* Where the surface of a wall that is not straight lies, off all lines. */
typedef struct merge_curve_point {
    cairn_vec2 position, normal; /* between free and occupied cells; unit, into free space */
} merge_curve_point;

typedef struct merge_map {
    cairn_merge_map input;
    cairn_pose map_centre;           /* the centre of the grid in the frame of the map */
    cairn_vec2 corner;               /* lower left of cell (0, 0), seen from the centre */
    uint16_t *grid;                  /* [height][width] */
    merge_point *points;             /* [point_count], any beginning of them an even choice */
    cairn_vec2 *free_cells;          /* [open_count] free cells, likewise */
    cairn_corner *corners;           /* [corner_count] */
    cairn_segment *lines;            /* [line_count] with free space on their left */
    merge_direction *directions;     /* likewise: their directions */
    merge_curve_point *curve_points; /* [bend_count], an even choice */
    cairn_real curved_wall;          /* m of wall off all lines */
    int32_t point_count, free_cell_count, corner_count, line_count, curve_point_count;
    int32_t occupied_count, free_count; /* cells */
    cairn_real spacing;                 /* m of wall for each point */
    cairn_real clearing;                /* share of a free cell */
    int32_t has_guess;
    cairn_pose given_guess; /* a guess of the map's frame in that of the reference ... */
    cairn_pose guess;       /* ... and of their centres */
} merge_map;

/* A place of the pair's second map beside its first one. */
typedef struct merge_mode {
    cairn_pose first_second;
    cairn_real log_ratio;
} merge_mode;

/* What the points of one map are in the grid of another. */
typedef struct merge_sums {
    /* points */
    cairn_real agree, conflict;
    /* likewise, felt from farther away */
    cairn_real soft_agree, soft_conflict;
    /* sum of the points that are known there, in the frame of the grid */
    cairn_vec2 centroid_sum;
    int32_t known_count;
} merge_sums;

/* A pair of maps being compared at one place: points of each in the grid of the other, some at a
 * time. */
typedef struct merge_comparison {
    int32_t first, second;
    cairn_pose first_second;
    cairn_transform there, back; /* second to first, first to second */
    int32_t point_counts[2];     /* of the second, of the first map, that are compared */
    int32_t cursor, direction;
    merge_sums sums[2];
} merge_comparison;

enum { MERGE_ENDED = -1, MERGE_DEFERRED = -2 };

/* A place that a particle filter's particle has put a map at. */
typedef struct merge_state {
    int32_t map;        /* MERGE_ENDED: no more; MERGE_DEFERRED - map: that one is put aside */
    int32_t source_map; /* the map that the proposal came from */
    cairn_pose reference_map;
    cairn_real log_ratio; /* given those before it */
    cairn_real psi, gamma;
} merge_state;

/* What follows a particle. */
typedef struct merge_proposal {
    const merge_state *state; /* the particle's last one */
    merge_state candidates[MERGE_MAX_CANDIDATES];
    int32_t count;
} merge_proposal;

/* One step of Gauss and Newton of a body's place beside its neighbours. */
typedef struct merge_fit {
    cairn_rigid_motion motion;
    cairn_normal_equations equations;
    /* of the neighbour at hand; body to neighbour; neighbour to body */
    cairn_transform at, there, here;
    /* m: the larger of both maps' */
    cairn_real cell;
    /* the neighbour, and its lines and bends that are done */
    int32_t neighbour, item;
    int32_t under_way;
} merge_fit;

/* ---- As written ---- */

/* Psi and d of two images (9.5, 9.6) being added up: rows of the one, then of the other. */
typedef struct merge_images {
    const merge_map *map[2];
    cairn_transform to_other[2];
    /* columns and rows of map k that the other one can feel: [k][0 column, 1 row] */
    int32_t begin[2][2], end[2][2];
    /* the map whose rows are added, and the next one */
    int32_t turn, row;
    cairn_real same[2][2],
        /* sums of the kernel, [map][class - MERGE_FREE]: to cells of that class, of the other */
        other[2][2];
    /* free cells of the second map that the first one knows */
    int32_t known;
} merge_images;

/* The candidates of a particle: those of an earlier one when both have the same history. */
typedef struct merge_places {
    const merge_state *state;
    int32_t first, count;
} merge_places;

/* What the mode as written needs besides. */
typedef struct merge_written {
    /* of the particle under way, in the frame of the reference's centre */
    merge_map merged;
    /* [most_cells] its classes */
    uint8_t *cells;
    int32_t max_cells;
    /* m, of the maps merged */
    cairn_box box;
    cairn_real kernel[MERGE_MAX_DISTANCE + 1];
    /* [most_listed] candidates of this step; `evidence` is the log of their prior mass */
    merge_state *candidates;
    int32_t candidate_count, max_candidates;
    /* [max_particles] of the filter */
    merge_places *places;
    int32_t stage, map, cursor, at;
    /* over all candidates; of gamma beyond the first one's */
    cairn_real psi_sum, gamma_first, gamma_sum, gamma_least;
    int32_t emitted;
    /* of the filter */
    int32_t steps;
    /* at the end of a step */
    int32_t peak_particles;
    merge_images images;
} merge_written;

typedef struct merge_cache_entry {
    int32_t first, second; /* maps; first -1: free */
    int32_t x, y, theta;   /* rounded */
    cairn_real log_ratio;
} merge_cache_entry;

typedef int32_t merge_stage;
enum { MERGE_PREPARING, MERGE_PAIRING, MERGE_VISITING, MERGE_CHECKING, MERGE_FINISHED };

typedef int32_t merge_phase;
enum {
    MERGE_IDLE,
    MERGE_OCCUPIED_DISTANCE,
    MERGE_OCCUPIED_PACK,
    MERGE_FREE_DISTANCE,
    MERGE_FREE_PACK,
    MERGE_SURFACE,
    MERGE_NORMALS,
    MERGE_SEGMENTS,
    MERGE_CORNERS,
    MERGE_SHUFFLE,
    MERGE_CURVE_POINTS,
    MERGE_HYPOTHESES,
    MERGE_ROTATIONS,
    MERGE_TRANSLATIONS,
    MERGE_CURVE_PAIRS,
    MERGE_SIFT,
    MERGE_REFINE,
    MERGE_FILTER,
    MERGE_CHECK
};

struct cairn_map_merge {
    cairn_map_merge_params params;
    /* [max_maps] */
    merge_map *maps;
    int32_t map_count;
    /* of all maps */
    int64_t cells;
    /* m of a length of 1 inside, where a cell of the first map has MERGE_CELL: all limits are in
     * cells */
    cairn_real unit;
    int32_t reference;
    int32_t order[MERGE_MAX_MAPS];
    int32_t has_order;
    /* [max_cells] */
    uint16_t *grid;

    /* Preparation of one map. */
    cairn_distance_map *distances;
    /* [max_map_cells] distances, then 1 + index of the point in a cell */
    int32_t *scratch;
    /* [max_points] the line that grows */
    int32_t *queue;
    /* [max_points] */
    int32_t *label;
    /* [max_points] */
    cairn_vec2 *line;
    /* [max_points] */
    merge_point *shuffled;
    /* points of it, and so many when it was fitted last */
    int32_t queued, fitted;
    /* what the line's points are compared with */
    cairn_vec2 line_at, line_normal;
    /* cells */
    int32_t surface, seen_surface, seen_free;
    cairn_corner_set *corners;

    /* Places of pairs. */
    merge_mode *modes;                           /* [pairs][max_modes] */
    int32_t *mode_count;                         /* [pairs] */
    merge_mode hypotheses[MERGE_MAX_HYPOTHESES]; /* of the pair under way, the best first */
    merge_mode refined[MERGE_MAX_REFINED];
    int32_t hypothesis_count, refined_count;
    struct {
        cairn_real bins[MERGE_ANGLE_BINS];
        cairn_real turns[MERGE_MAX_ROTATIONS];
        int32_t count, at;
        cairn_real cosine, sine;
        /* m for one of these points */
        cairn_real wall;
        /* points turned, in the other's cells */
        cairn_vec2 first[MERGE_COARSE_POINTS], second[MERGE_COARSE_POINTS];
        cairn_vec2 first_front[MERGE_COARSE_POINTS], second_front[MERGE_COARSE_POINTS];
        int32_t firsts, seconds;
        /* m */
        cairn_box shifts;
        int32_t columns, rows;
        /* of the shift under way */
        merge_sums sums;
    } search;
    merge_comparison comparison;
    /* how much a distance in cells counts as agreement while searching */
    cairn_real soft_kernel[MERGE_MAX_DISTANCE + 1];
    struct {
        cairn_pose best, start;
        cairn_real score, cells, step, turn;
        cairn_real last; /* cells: the last step */
        int32_t points;  /* of each map that are compared */
        cairn_vec2 pivot;
        int32_t direction, rounds, improved;
        int32_t variant; /* of a place that is refined: as it is, then turned to either side */
        cairn_pose base;
        cairn_vec2 base_pivot;
    } climb;

    merge_fit fit;

    /* The maps that the one under way is compared with, and where they lie. */
    int32_t neighbours[MERGE_MAX_MAPS];
    cairn_pose neighbour_poses[MERGE_MAX_MAPS];
    int32_t neighbour_count;
    int32_t deferrals[MERGE_MAX_MAPS]; /* how often a map was put aside */
    struct {
        cairn_pose pose;
        int32_t map, near;
        int32_t points;     /* of each map that are compared */
        int32_t neighbours; /* that give evidence */
        cairn_real evidence, soft;
        cairn_vec2 middle;
        cairn_real known;
    } total;

    /* The filter. */
    cairn_particle_filter *filter;
    struct {
        merge_proposal made[MERGE_CACHED_PROPOSALS]; /* of particles of this step; many are alike */
        merge_proposal *now;
        int32_t count, stage, at;
        cairn_real psi_sum, gamma_sum, gamma_least; /* over all candidates of the step */
        int32_t offered;
    } offer;
    union {
        merge_cache_entry *cache; /* [MERGE_CACHE_SLOTS] in the default mode */
        merge_written *written;   /* in the mode as written */
    };
    int32_t filter_steps; /* steps of the filter */
    struct {
        int32_t list[MERGE_MAX_MAPS];     /* maps placed, in their order */
        cairn_pose pose[MERGE_MAX_MAPS];  /* of each map, in the frame of the reference's centre */
        cairn_pose start[MERGE_MAX_MAPS]; /* where the filter has left them */
        int32_t count, round, at, stage, looking, refused;
        int32_t accepted[MERGE_MAX_MAPS];
        cairn_real link[MERGE_MAX_MAPS * (MERGE_MAX_MAPS - 1) / 2]; /* evidence of each pair */
        merge_mode rival_list[MERGE_MAX_REFINED];
        int32_t rivals;
        cairn_real slide; /* evidence of the best shifted place */
    } check;

    merge_stage stage;
    merge_phase phase;
    int32_t map, other; /* under way */
    int32_t cursor, inner;
    int32_t units_charged;
    int32_t is_comparing; /* 1: `comparison` is under way */
    int64_t units;
    int32_t tried_count;
    cairn_merge_placed placed[MERGE_MAX_MAPS];
    cairn_merge_result result;
    int32_t done; /* 1: the result stands */
};

/* The packed cell of a point in cells of the grid; that of something unknown outside. */
static inline uint16_t merge_cell_at(const merge_map *map, cairn_real x, cairn_real y)
{
    if (!(x >= 0 && y >= 0 && x < (cairn_real)map->input.cells.width &&
          y < (cairn_real)map->input.cells.height))
        return MERGE_MAX_DISTANCE | MERGE_MAX_DISTANCE << 7 | MERGE_UNKNOWN << 14;
    return map->grid[cairn_real_to_int(y) * map->input.cells.width + cairn_real_to_int(x)];
}

/* ---- The search of places: what a few points of each map, counted in cells around, say of one
 * ---- */

/* m of wall that each of the first points stands for, of both maps in the mean. */
static inline cairn_real merge_search_wall(const merge_map *first, const merge_map *second)
{
    return (first->spacing * (cairn_real)first->point_count +
            second->spacing * (cairn_real)second->point_count) /
           (cairn_real)(2 * MERGE_COARSE_POINTS);
}

/* 1 when more points speak against a place than 2.5 and a third of those that speak for it. */
static inline int merge_is_rejected(const merge_sums *s)
{
    return s->soft_conflict > s->soft_agree / 3 + CAIRN_REAL(2.5);
}

/* m of wall that speak for a place. */
static inline cairn_real merge_search_score(const merge_sums *s, cairn_real wall)
{
    return (s->soft_agree / 2 - CAIRN_REAL(1.5) * s->soft_conflict) * wall;
}

static inline int32_t merge_pair(int32_t first, int32_t second)
{
    return second * (second - 1) / 2 + first;
}

/* ---- map_merge_prepare.c: each phase returns CAIRN_OK when it is done with m->map ---- */

cairn_status cairn_merge_prepare(cairn_map_merge *merge, cairn_budget *budget);

/* Distances in the cells of a map to those of a class, into m->scratch; *cursor is 0 before the
 * first call. */
cairn_status cairn_merge_measure(cairn_map_merge *merge, const merge_map *map, uint8_t match,
                                 int32_t *cursor, cairn_budget *budget);

/* Packs the distances at hand into the grid, 16 cells a unit: `shift` 0: to occupied cells, with
 * the class, which is counted; 7: to free ones. */
cairn_status cairn_merge_pack(cairn_map_merge *merge, merge_map *map, int32_t shift,
                              int32_t *cursor, cairn_budget *budget);

/* ---- map_merge_pairs.c ---- */

/* A map placed beside another one by all rotations that their lines suggest and all
 * translations. */
cairn_status cairn_merge_correlate(cairn_map_merge *merge, cairn_budget *budget);

/* ---- map_merge_bend.c ---- */

/* Points off all lines, from the even order in which they are; a phase of the preparation. */
cairn_status cairn_merge_choose_bends(cairn_map_merge *merge, merge_map *map, cairn_budget *budget);

/* How far along a normal from p free cells end at occupied ones, within 2.5 cells; 1 when they
 * do. */
int cairn_merge_surface_along(const merge_map *map, cairn_vec2 p, cairn_vec2 normal,
                              cairn_real *along);

/* A map placed beside another one by all pairs of such points. */
cairn_status cairn_merge_try_bends(cairn_map_merge *merge, cairn_budget *budget);

cairn_status cairn_merge_find_modes(cairn_map_merge *merge, cairn_budget *budget);
void cairn_merge_sum(const cairn_map_merge *merge, const merge_map *to, const merge_map *from,
                     const cairn_transform *t, int32_t begin, int32_t end, merge_sums *s);

/* 1 when two places of a map differ by less than so much. */
int cairn_merge_is_same(cairn_pose a, cairn_pose b, cairn_real metres, cairn_real radians);

/* Keeps a place among the best `most` ones, best first; of places that are the same the better
 * one. */
void cairn_merge_keep(merge_mode *list, int32_t *count, int32_t most, merge_mode mode,
                      cairn_real metres, cairn_real radians);

/* Compares map `map` at a pose with all of near[]; go_on returns 1 when m->total is complete. */
void cairn_merge_begin_total(cairn_map_merge *merge, int32_t map, cairn_pose pose, int32_t points);
int cairn_merge_go_on_total(cairn_map_merge *merge, cairn_budget *budget);

/* 1 when two maps are too far apart to have anything in common. */
int cairn_merge_is_apart(const cairn_map_merge *merge, int32_t first, int32_t second,
                         cairn_pose first_second);

/* Refines a pose of `map`, which is near `start`, beside near[] by lines and bends, `rounds`
 * times at most; go_on returns 1 when m->climb.best is it. */
void cairn_merge_begin_lines(cairn_map_merge *merge, int32_t map, cairn_pose start, cairn_pose pose,
                             int32_t rounds);
int cairn_merge_go_on_lines(cairn_map_merge *merge, cairn_budget *budget);

/* Nats for so many m of wall that agree, and that do not. */
cairn_real cairn_merge_nats(const cairn_map_merge *merge, cairn_real agree, cairn_real conflict);

static inline int merge_is_written(const cairn_map_merge_params *p)
{
    return p->mode == CAIRN_MODE_AS_WRITTEN;
}

/* ---- map_merge_score.c ---- */

/* The score of map b whose centre lies at `centres` seen from that of map a; lengths in units of
 * the merging. */
void cairn_merge_score_at(const cairn_map_merge *merge, int32_t a, int32_t b, cairn_pose centres,
                          cairn_merge_score *score);

/* ---- map_merge_filter.c ---- */

cairn_particle_filter_params cairn_merge_filter_params(const cairn_map_merge_params *p);
cairn_particle_model cairn_merge_model(cairn_map_merge *merge);
cairn_status cairn_merge_run_filter(cairn_map_merge *merge, cairn_budget *budget);

/* The maps that a particle has placed become near[]. 1 when it has come to its end. */
int cairn_merge_gather(cairn_map_merge *merge, const void *state);

/* Rival places of a map beside all of near[], the best first; returns their number. */
int32_t cairn_merge_places(const cairn_map_merge *merge, int32_t map, merge_mode *list,
                           int32_t most);

/* 1 when two particles have put the same maps at the same places. */
int cairn_merge_is_same_history(const merge_state *a, const merge_state *b);

/* ---- map_merge_image.c ---- */

/* Compares image b, placed at a_b, with image a; go_on returns 1 when all is added up. Four
 * cells a unit. */
void cairn_merge_begin_images(merge_images *c, const merge_map *a, const merge_map *b,
                              cairn_pose a_b);
int cairn_merge_go_on_images(merge_images *c, const cairn_real *kernel, int32_t *paid,
                             cairn_budget *budget);

/* psi, disagreement, gamma and overlap. */
void cairn_merge_end_images(const merge_images *c, cairn_merge_score *score);

/* exp(x (2 mu - x) / (2 sigma^2)) of distances 0 ... MERGE_MAX_DISTANCE in cells. */
void cairn_merge_set_kernel(cairn_real *kernel);

/* Draws the maps near[] into one image, as m->written->merged; 1 when it is done. Begins with
 * written->stage 0. */
int cairn_merge_draw_merged(cairn_map_merge *merge, cairn_budget *budget);

/* The box of a map's cells at a pose; that of both boxes; 1 when an image of it has room. */
cairn_box cairn_merge_box_of(const merge_map *map, cairn_pose pose);
cairn_box cairn_merge_join(cairn_box a, cairn_box b);
int cairn_merge_has_room(const cairn_map_merge *merge, cairn_box box);

/* ---- map_merge_corners.c ---- */

enum { MERGE_CORRESPONDENCES = 3 };

/* The motion from the frame of from[MERGE_CORRESPONDENCES] into that of to[] with the least sum
 * of squared distances. */
cairn_pose cairn_merge_motion_of(const cairn_vec2 *to, const cairn_vec2 *from);

/* As the modes of every pair of maps: the registrations of their most similar corners. */
cairn_status cairn_merge_register_corners(cairn_map_merge *merge, cairn_budget *budget);

/* ---- map_merge_written.c ---- */

enum {
    /* times the particles asked for: so many while N_eff is at least half of them */
    MERGE_GROWTH = 2,
    /* times max_cells: cells of the box about all maps merged, at most */
    MERGE_MAX_MERGED_CELLS = 6,
    /* registrations that a particle draws from, at most */
    MERGE_MAX_PLACES = 1024
};

cairn_particle_filter_params cairn_merge_written_params(const cairn_map_merge_params *p);
cairn_particle_model cairn_merge_written_model(cairn_map_merge *merge);
cairn_status cairn_merge_run_written(cairn_map_merge *merge, cairn_budget *budget);
cairn_status cairn_merge_end_written(cairn_map_merge *merge, cairn_budget *budget);

/* ---- map_merge_check.c ---- */

cairn_status cairn_merge_check(cairn_map_merge *merge, cairn_budget *budget);

#endif
