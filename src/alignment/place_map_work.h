/* Private state of the place_map module. */
#ifndef CAIRN_ALIGNMENT_PLACE_MAP_WORK_H
#define CAIRN_ALIGNMENT_PLACE_MAP_WORK_H

#include "cairn/place_map.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_place_map_parameters;

typedef struct place_map_place_scan {
    int32_t place;
    int32_t first_point, point_count; /* in the frame of the scan */
    int32_t first_beam, beam_count;
    cairn_pose place_scan;
    cairn_pose map_scan; /* of the result */
} place_map_place_scan;

typedef struct place_map_place {
    int32_t first_scan, scan_count;
    int32_t point_count, beam_count;
    int32_t free_count; /* cells of its free-space sample */
    cairn_pose map_place;
    int32_t component;
} place_map_place;

/* Visibility grid of a place, by cells about its origin: codes of a cell. */
enum {
    PLACE_MAP_VISIBILITY_UNKNOWN = 0,
    PLACE_MAP_VISIBILITY_FREE = 1,
    PLACE_MAP_VISIBILITY_DIRECTIONS = 16, /* quantized surface directions of the full circle */
    PLACE_MAP_VISIBILITY_BEHIND = 2,   /* occluded just behind a surface: this plus its direction */
    PLACE_MAP_VISIBILITY_ROUGH = 18,   /* a surface of unknown direction */
    PLACE_MAP_VISIBILITY_DYNAMIC = 19, /* a surface of a dynamic-object candidate */
    PLACE_MAP_VISIBILITY_SURFACE = 20  /* a static surface: this plus its direction */
};

/* stride of the rows and columns in the free-space sample */
enum { PLACE_MAP_VISIBILITY_SAMPLE_STRIDE = 6 };

/* Observation of a place at a point of another one; bits. */
enum {
    PLACE_MAP_OBSERVED_UNKNOWN = 0,
    PLACE_MAP_OBSERVED_FREE = 1,
    PLACE_MAP_OBSERVED_PARALLEL = 2,        /* a surface of the point's direction */
    PLACE_MAP_OBSERVED_OPPOSITE = 4,        /* the opposite face of a wall */
    PLACE_MAP_OBSERVED_OTHER_DIRECTION = 8, /* a surface of another direction */
    PLACE_MAP_OBSERVED_ROUGH = 16,
    PLACE_MAP_OBSERVED_DYNAMIC = 32,
    PLACE_MAP_OBSERVED_SURFACE = 62 /* any surface */
};

/* Class of a point; bits. */
enum {
    PLACE_MAP_POINT_STATIC = 0,
    /* on a small round body with free space beside it */
    PLACE_MAP_POINT_DYNAMIC_CANDIDATE = 1,
    /* invalidated: another place of the map measured free space there */
    PLACE_MAP_POINT_INVALIDATED = 2
};

typedef int32_t place_map_state;
enum { PLACE_MAP_IDLE = 0, PLACE_MAP_RUNNING, PLACE_MAP_DONE };

/* Steps that run one another, the outermost first. */
struct place_map_resume {
    int32_t run, phase, part, inner;
};

/* Points, or cells of a free-space sample, that are evaluated at once. */
enum { PLACE_MAP_ITEMS = 16 };

/* Items that are visited: points or beams of a scan, or cells of a free-space sample. */
struct place_map_visit {
    cairn_transform transform; /* their frame in that of the visit */
    int32_t scan;
    int32_t item, end; /* next item, and the end */
};

/* Search of the local maximum of a hypothesis' likelihood, by a pattern of six poses. */
struct place_map_pattern {
    cairn_pose matched, around, better; /* pose of the match, of the pattern, best of the pattern */
    cairn_real before, best;            /* nats: at the match, and the best so far */
    cairn_real metres, radians;         /* size of the pattern */
    int32_t direction, moves, halvings;
};

/* Terms for and against a pose, nats, >= 0. */
struct place_map_terms {
    cairn_real pro, contra;
};

/* A joint likelihood that is under way. */
struct place_map_joint {
    cairn_transform place_map; /* the map in the frame of the place */
    struct place_map_terms sum;
    int32_t shared;     /* cells of free space that others observed as free */
    int32_t lookups;    /* not charged: less than a unit */
    int32_t seen_count; /* of the next points, in the grid of the place, not unknown */
    uint8_t seen[PLACE_MAP_ITEMS];
};

/* What the steps use most comes first: it takes shorter instructions there. */
struct cairn_place_map {
    /* units charged for the operation that waits */
    int32_t units_charged;
    struct place_map_resume resume;
    place_map_state state;

    int32_t place;      /* target of a match in the first round, or the place that is aligned */
    int32_t query;      /* place that is matched or aligned */
    int32_t query_part; /* component that is matched as a whole; 0: the query alone */
    int32_t scan; /* that is decoupled, in the order of add_scan() or in its place; -1: none */
    int32_t hypothesis;    /* of the map, or of a match */
    int32_t target, moved; /* pair of places of a match */
    int32_t round;         /* 0: pairs; then with the map of all others */
    int32_t sweep;
    int32_t is_matched;           /* 1: the query was placed by its match */
    int32_t moved_places;         /* places that the last consensus moved */
    int32_t submaps_found;        /* 1: the submaps of the last map are known */
    int32_t optimized_hypotheses; /* hypotheses whose poses have been optimized */
    int32_t observer_count;       /* observing places */

    int32_t place_count, scan_count, point_count, beam_count, hypothesis_count;
    /* [max_places] */
    place_map_place *places;
    /* [max_scans] */
    place_map_place_scan *scans;
    /* [max_places * max_place_points] in the frames of the scans */
    cairn_oriented_point *points;
    /* [as points] class of each point */
    uint8_t *point_class;
    /* [max_places][side][side] visibility grids */
    uint8_t *visibility;
    /* cells along a side of a visibility grid */
    int32_t visibility_side;
    /* [max_places] observing places of a joint likelihood or of points that are classified, ... */
    int32_t *observing_places;
    /* ... and the map in the frame of each */
    cairn_transform *observer_map;
    cairn_scan_match *match;
    cairn_pose_consensus *consensus;
    cairn_icp *icp;
    /* NULL unless scans are aligned jointly */
    cairn_aligner *aligner;

    struct place_map_visit visit;
    struct place_map_joint joint;
    struct place_map_pattern pattern;
    /* of the query, in the frame of its place */
    cairn_scan_match_part part;
    cairn_place_map_result result;

    /* [consensus.max_hypotheses] hypotheses of all matches */
    cairn_pose_consensus_relative_pose *hypotheses;
    /* [max_places * max_place_beams] */
    cairn_scan_beam *beams;
    /* [max_places][(side / VISIBILITY_SAMPLE_STRIDE)^2] sample of the free cells */
    int32_t *free_cells;
    /* [max_places * max_place_points] query points, in the frame of its place */
    cairn_oriented_point *query_points;
    /* [max_place_beams] */
    cairn_scan_beam *query_beams;
    cairn_place_map_params params;
    /* unit vectors of the quantized surface directions */
    cairn_vec2 directions[PLACE_MAP_VISIBILITY_DIRECTIONS];
};

/* Returns the cells of a side for a reach; 0 when there would be too many. */
int32_t cairn_place_map_side(const cairn_place_map_params *params);

/* Marks the dynamic-object candidates among the points of the scan added last. */
void cairn_place_map_find_dynamic_candidates(cairn_place_map *map, const place_map_place_scan *scan,
                                             const cairn_scan_view *view);

/* Step of a phase: invalidates the points of all places at which more other places of the component
 * measured free space than a surface; of the last map also dynamic-object candidates at which no
 * other place measured a surface. */
int cairn_place_map_classify(cairn_place_map *map, cairn_budget *budget);

/* Step of a phase: builds the visibility grid of the place and the sample of its free cells. */
int cairn_place_map_build_visibility(cairn_place_map *map, cairn_budget *budget);

/* Returns a point in another frame. */
static inline cairn_oriented_point place_map_placed_point(cairn_transform transform,
                                                          cairn_oriented_point point)
{
    point.position = cairn_transform_point(transform, point.position);
    point.direction = cairn_transform_direction(transform, point.direction);
    return point;
}

/* Transforms a beam into another frame. */
void cairn_place_map_place_beam(cairn_transform transform, cairn_scan_beam *beam);

/* Starts to visit `count` items from `first` on, in a frame whose pose is given; the points of the
 * visited scan, whose place has a pose in the map. */
void cairn_place_map_begin_visit(cairn_place_map *map, cairn_pose pose, int32_t first,
                                 int32_t count);
void cairn_place_map_begin_points(cairn_place_map *map, cairn_pose map_place);

/* Number of the next items that are evaluated at once. */
int32_t cairn_place_map_next_items(const cairn_place_map *map);

/* Adds a place to the observing ones. */
void cairn_place_map_add_observer(cairn_place_map *map, int32_t place, cairn_pose map_place);

/* Returns the units of a pair's likelihood. */
int32_t cairn_place_map_pair_units(const cairn_place_map *map, int32_t first, int32_t second);

/* Returns the log-likelihood ratio of a relative pose of two places, nats: from points of each on
 * surfaces of the other and from shared free space, less free-space violations. */
cairn_real cairn_place_map_pair_likelihood(const cairn_place_map *map, int32_t first,
                                           int32_t second, cairn_pose first_second);

/* Returns the observation of a place at a point in its own frame. */
int32_t cairn_place_map_observed(const cairn_place_map *map, int32_t place, cairn_vec2 point,
                                 cairn_vec2 direction);

/* Returns point `i` of the free-space sample, in the place's frame. */
cairn_vec2 cairn_place_map_free_point(const cairn_place_map *map, int32_t place, int32_t i);

/* Returns the area that a point of the free-space sample represents, m^2. */
cairn_real cairn_place_map_free_area(const cairn_place_map *map);

/* nats, added to both supports where a place is compared with a competing pose */
#define PLACE_MAP_SHARED_NATS CAIRN_REAL(5.0)

/* Returns the probability that a place is wrong relative to most of its component. support,
 * competing: nats, of its pose and of its best alternative among the others; link_support: nats;
 * is_ambiguous: of the node of the consensus. */
cairn_real cairn_place_map_error_probability(cairn_real support, cairn_real competing,
                                             cairn_real link_support, int32_t is_ambiguous);

/* Returns the support of the best alternative pose of a place among the others, nats; 0: none. */
cairn_real cairn_place_map_competing_support(const cairn_place_map *map, int32_t place);

/* Writes what the consensus says of a place. Linear in the places. */
void cairn_place_map_report(const cairn_place_map *map, int32_t place, cairn_place_map_place *out);

/* Joint likelihood function of the consensus, context: the map. The log-likelihood ratio of a place's
 * pose given all others of a component, nats, each surface counted once however many places observed
 * it, and its free-space violations. */
int cairn_place_map_joint_likelihood(void *context, int32_t place, cairn_pose map_place,
                                     const cairn_pose *map_places, const int32_t *parts,
                                     int32_t part, cairn_pose_likelihood *likelihood,
                                     cairn_budget *budget);

/* Rotates a covariance of map_query into the frame of a place with heading theta in the map. */
void cairn_place_map_rotate_covariance(const cairn_real in[9], cairn_real theta, cairn_real out[9]);

/* Adds a hypothesis, its covariance bounded to where its likelihood is valid. A full store drops
 * it: earlier ones come from better matches. */
void cairn_place_map_add_hypothesis(cairn_place_map *map, int32_t first, int32_t second,
                                    cairn_pose first_second, const cairn_real covariance[9]);

/* Step of a phase: scores all hypotheses, new ones at the local maximum of their likelihood, to which
 * they are moved, and adds them to the consensus. */
int cairn_place_map_score(cairn_place_map *map, cairn_budget *budget);

/* Step: all of the map; in mode as written (place_map_written.c). */
int cairn_place_map_run(cairn_place_map *map, cairn_budget *budget);
int cairn_place_map_written_run(cairn_place_map *map, cairn_budget *budget);

/* ---- Shared by the modes ---- */

/* Starts the steps at their beginning. */
static inline void place_map_begin_run(cairn_place_map *map)
{
    const struct place_map_resume none = {0, 0, 0, 0};

    map->resume = none;
    map->units_charged = 0;
    map->state = PLACE_MAP_RUNNING;
}

/* Sets the poses of the scans of a place from that of the place. */
void cairn_place_map_place_scans(cairn_place_map *map, int32_t place);

/* Returns the units of cairn_place_map_finish(). */
int32_t cairn_place_map_finish_units(const cairn_place_map *map);

/* Transforms all poses into the frame of their component's first place, which completes the result. */
void cairn_place_map_finish(cairn_place_map *map);

#endif
