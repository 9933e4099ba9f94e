/* What the parts of place_map share. */
#ifndef CAIRN_MAPPING_PLACE_MAP_WORK_H
#define CAIRN_MAPPING_PLACE_MAP_WORK_H

#include "cairn/place_map.h"

typedef struct cairn_place_scan {
    int32_t place;
    int32_t first_point, point_count; /* in the frame of the scan */
    int32_t first_beam, beam_count;
    cairn_pose place_scan;
    cairn_pose map_scan; /* of the result */
} cairn_place_scan;

typedef struct cairn_place {
    int32_t first_scan, scan_count;
    int32_t point_count, beam_count;
    int32_t free_count; /* cells of its sample of free space */
    cairn_pose map_place;
    int32_t part;
} cairn_place;

/* What a place saw, by cells about its origin. */
enum {
    CAIRN_SIGHT_UNKNOWN = 0,
    CAIRN_SIGHT_FREE = 1,
    CAIRN_SIGHT_DIRECTIONS = 16, /* of a turn */
    CAIRN_SIGHT_BEHIND = 2,      /* hidden just behind a surface: this and its direction */
    CAIRN_SIGHT_ROUGH = 18,      /* a surface of no known direction */
    CAIRN_SIGHT_BODY = 19,       /* a surface of a small body, which may have walked there */
    CAIRN_SIGHT_DIRECTION = 20   /* a surface that stays: this and its direction */
};

enum { CAIRN_SIGHT_STRIDE = 6 }; /* rows and columns of which one is in the sample of free space */

/* What a place saw where a point of another one lies. */
enum {
    CAIRN_SAW_NOTHING = 0,
    CAIRN_SAW_FREE = 1,
    CAIRN_SAW_ALONG = 2,  /* a surface of its direction */
    CAIRN_SAW_BACK = 4,   /* the other side of a wall */
    CAIRN_SAW_ACROSS = 8, /* a surface of another direction */
    CAIRN_SAW_ROUGH = 16,
    CAIRN_SAW_BODY = 32,
    CAIRN_SAW_SURFACE = 62 /* any of these */
};

/* What speaks against a point as a surface that stays. */
enum {
    CAIRN_POINT_SOUND = 0,
    CAIRN_POINT_FLOATING = 1, /* it is on a small round thing with free space beside it */
    CAIRN_POINT_SUSPECT = 2   /* another place of the map saw through it: 2 or 3 */
};

typedef int32_t cairn_place_map_phase;
enum {
    CAIRN_PLACE_MAP_IDLE = 0,
    CAIRN_PLACE_MAP_SIGHT,  /* what each place saw */
    CAIRN_PLACE_MAP_TARGET, /* what the next match matches with */
    CAIRN_PLACE_MAP_MATCH,
    CAIRN_PLACE_MAP_WEIGH, /* hypotheses, by evidence, into the consensus */
    CAIRN_PLACE_MAP_AGREE,
    CAIRN_PLACE_MAP_DOUBT,    /* points that others see through */
    CAIRN_PLACE_MAP_REFINE,   /* each place with all others */
    CAIRN_PLACE_MAP_DECOUPLE, /* each scan with all others */
    CAIRN_PLACE_MAP_JOIN,     /* all scans at once */
    CAIRN_PLACE_MAP_DONE
};

struct cairn_place_map {
    cairn_place_map_params params;
    cairn_scan_match *match;
    cairn_pose_consensus *consensus;
    cairn_icp *icp;
    /* NULL unless scans are aligned jointly */
    cairn_aligner *aligner;
    /* [max_places] */
    cairn_place *places;
    /* [max_scans] */
    cairn_place_scan *scans;
    /* [max_places * max_place_points] of scans, in their frames */
    cairn_oriented_point *points;
    /* [as points] */
    uint8_t *doubt;
    /* [consensus.max_hypotheses] all that matches gave */
    cairn_pose_hypothesis *hypotheses;
    /* [max_places * max_place_beams] */
    cairn_beam *beams;
    /* [max_places][side][side] */
    uint8_t *sight;
    /* [max_places][(side / CAIRN_SIGHT_STRIDE)^2] sample of those seen free */
    int32_t *free_cells;
    /* [max_places] places among which one is weighed, ... */
    int32_t *seers;
    /* ... and the map seen from them */
    cairn_transform *seers_map;
    /* [max_places * max_place_points] of the query, in its place's frame */
    cairn_oriented_point *query_points;
    /* [max_place_beams] */
    cairn_beam *query_beams;
    /* cells of a place's sight */
    int32_t side;
    cairn_vec2 directions[CAIRN_SIGHT_DIRECTIONS];
    int32_t place_count, scan_count, point_count, beam_count, hypothesis_count;

    cairn_place_map_phase phase;
    int32_t next;  /* beam or point of the place whose sight is made, ... */
    int32_t place; /* ... the target of a match in the first round, or the one aligned */
    int32_t query; /* place that is matched */
    int32_t round; /* 0: pairs; then with the map of all others */
    int32_t sweep;
    int32_t moved;     /* places that the last consensus laid elsewhere */
    int32_t is_judged; /* where the map of the last round may hang together by chance is known */
    int32_t polished;  /* hypotheses whose poses have been */
    int32_t running;   /* icp or consensus has begun */
    int32_t debt;      /* units of items done that are not yet paid for */
    cairn_place_map_result result;
};

/* Cells of a side for a reach; 0 when there would be too many. */
int32_t cairn_place_map_side(const cairn_place_map_params *params);

/* Marks the points of a scan, added last, that float. */
void cairn_place_map_find_floating(cairn_place_map *map, const cairn_place_scan *scan,
                                   const cairn_scan_view *view);

/* Marks the points of a place that other places of its part see through, and none that they see
 * as surface as often; for is_last also those on bodies that no other place sees where they
 * stood. */
void cairn_place_map_doubt(cairn_place_map *map, int32_t place, int32_t is_last);

/* One beam or point of a place into its sight; 0 when there are none left. */
int32_t cairn_place_map_see(cairn_place_map *map, int32_t place, int32_t item);

/* Samples what a place saw free, when all of it has been seen. */
void cairn_place_map_sample_free(cairn_place_map *map, int32_t place);

/* Units of weighing two places. */
int32_t cairn_place_map_weighing(const cairn_place_map *map, int32_t first, int32_t second);

/* Nats for two places to lie so: of the points of each on surfaces of the other and of space that
 * both saw free, less points in the other's free space. */
cairn_real cairn_place_map_evidence(const cairn_place_map *map, int32_t first, int32_t second,
                                    cairn_pose first_second);

/* What a place saw at a point in its own frame. */
int32_t cairn_place_map_saw(const cairn_place_map *map, int32_t place, cairn_vec2 point,
                            cairn_vec2 direction);

/* Point `i` of the sample of free space, in the place's frame. */
cairn_vec2 cairn_place_map_free_point(const cairn_place_map *map, int32_t place, int32_t i);

/* Square metres that a point of the sample of free space stands for. */
cairn_real cairn_place_map_free_area(const cairn_place_map *map);

/* Nats for a place to lie so among all others of a part, each surface counted once however many
 * saw it, and what of that speaks against it: the jury of the consensus. */
cairn_real cairn_place_map_among(const cairn_place_map *map, int32_t place, cairn_pose map_place,
                                 const cairn_pose *map_places, const int32_t *parts, int32_t part,
                                 cairn_real *against, int32_t *units);

/* Evidence of two places, charged. */
cairn_real cairn_place_map_weigh(cairn_place_map *map, int32_t first, int32_t second,
                                 cairn_pose first_second);

/* Covariance of map_query seen from a place that is turned by theta in the map. */
void cairn_place_map_turn(const cairn_real in[9], cairn_real theta, cairn_real out[9]);

/* Keeps a hypothesis, its covariance bounded to where its evidence holds. When the store is full
 * no more is taken: what came first came from better matches. */
void cairn_place_map_keep(cairn_place_map *map, int32_t first, int32_t second,
                          cairn_pose first_second, const cairn_real covariance[9]);

/* Moves a hypothesis to a pose near it that has more evidence, if there is one, and returns the
 * evidence. */
cairn_real cairn_place_map_polish(cairn_place_map *map, cairn_pose_hypothesis *hypothesis);

/* ---- Shared by the modes ---- */

void cairn_place_map_enter(cairn_place_map *map, cairn_place_map_phase phase);

/* Poses of the scans of a place from that of the place. */
void cairn_place_map_place_scans(cairn_place_map *map, int32_t place);

/* Poses become those seen from the part's first place; the result stands. */
void cairn_place_map_finish(cairn_place_map *map);

/* place_map_written.c: mode as_written goes on after its first `place` places; one item of it. */
void cairn_place_map_written_extend(cairn_place_map *map);
void cairn_place_map_written_item(cairn_place_map *map, cairn_budget *budget);

/* Does one item and adds its cost to the debt; items of the match, the consensus and icp take
 * from the budget instead. */
void cairn_place_map_item(cairn_place_map *map, cairn_budget *budget);

#endif
