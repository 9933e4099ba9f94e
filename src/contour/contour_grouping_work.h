/* What the parts of contour_grouping share. */
#ifndef CAIRN_CONTOUR_CONTOUR_GROUPING_WORK_H
#define CAIRN_CONTOUR_CONTOUR_GROUPING_WORK_H

#include "cairn/contour_grouping.h"

/* Sides of the cells: of the lists of tokens, and of the map of first sight. */
enum { GROUPING_CELL = 8, GROUPING_SIGHT = 4 };
/* Ways in which a chord between two tokens may run. */
enum { GROUPING_WAYS = 64 };
/* Tokens that a side may choose from, and what a step may choose from with no token as well. */
enum {
    GROUPING_CHOICE = 3,
    GROUPING_FOLLOWERS = 4,
    GROUPING_CANDIDATES = (GROUPING_CHOICE + 1) * (GROUPING_CHOICE + 1)
};
/* What a sample of the outline may be: hidden, or along one of so many tokens near it. */
enum { GROUPING_CELLS = 5 };

/* image = t + (a, -b; b, a) * model. */
typedef struct grouping_pose {
    cairn_real a, b;
    cairn_vec2 t;
} grouping_pose;

/* A piece of a segment. */
typedef struct grouping_token {
    cairn_vec2 at, direction; /* its middle */
    cairn_real half;          /* px, half its length */
    int32_t segment;
    int32_t next;  /* in its cell, -1: none; until they are laid side by side */
    int32_t chain; /* those of one chain follow each other, along it */
    int32_t taken; /* 1: by an object */
} grouping_token;

/* What is looked at of a token near a place; those of a cell lie side by side, and so do those
 * of the cells of a row. */
typedef struct grouping_near {
    cairn_vec2 at, direction;
    cairn_real half;
    int32_t token;
} grouping_near;

/* One way in which a sample of the outline may be seen. */
typedef struct grouping_cell {
    cairn_real value;     /* evidence of the best way to here */
    cairn_real cost, off; /* half squares of sigmas; sigmas across the outline */
    int32_t token;        /* -1: hidden */
    int32_t from;         /* cell of the sample before */
} grouping_cell;

/* A place that looks like the model at first sight. */
typedef struct grouping_start {
    grouping_pose pose;
    cairn_real size;  /* at first sight */
    cairn_real score; /* at first sight the share of the outline that is seen, then its evidence */
    int32_t sample;
} grouping_start;

/* Samples whose chords may run one way: none before the one and none from the other on. */
typedef struct grouping_way {
    int16_t from, to;
} grouping_way;

/* Sums for the similarity that lies best. */
typedef struct grouping_sums {
    cairn_real n, mm, dot, cross;
    cairn_vec2 m, p;
} grouping_sums;

/* One step of a walk. */
typedef struct grouping_state {
    grouping_pose pose;
    grouping_sums sums;
    cairn_vec2 off[2];  /* px: how far the contour lies off the pose, on either side */
    cairn_vec2 last[2]; /* px: where it was seen last */
    cairn_vec2 centre;  /* of the symmetric point, px */
    cairn_real radius, deviation;
    cairn_real gap;   /* px */
    int32_t token[2]; /* -1: not seen */
    int32_t sample, start;
} grouping_state;

struct cairn_grouping {
    cairn_grouping_params params;
    cairn_grouping_input input;
    /* of the mode as written; NULL in the default one */
    struct grouping_written *written;
    cairn_particle_filter *filter;
    grouping_token *tokens;
    /* [max_tokens] by cells */
    grouping_near *near;
    /* [cells + 1] first of each cell in near; first token, -1: none, until they are there */
    int32_t *head;
    /* bits of the directions near each cell */
    uint8_t *sight;
    /* [particles] */
    grouping_start *starts;
    /* [max_samples] */
    cairn_grouping_trace *trace;
    /* [max_objects * max_outline] */
    int32_t *segments;
    cairn_grouped_object *objects;
    /* [max_objects * max_outline] segment of each sample of an object's outline */
    int32_t *along;
    /* [max_outline] token of each sample of the outline, -1: none */
    int32_t *match;
    /* [max_outline] and how well it fits */
    cairn_real *cost;
    /* [max_outline] px: how far the contour lies off the pose; the next ones */
    cairn_vec2 *shift, *bent;
    /* [max_outline] samples to the nearest one that is seen */
    int32_t *apart;
    /* [max_outline] how much the outline bends there, 0 ... 1 */
    cairn_real *bend;
    /* [max_outline * GROUPING_CELLS] */
    grouping_cell *cells;
    /* the middle of the turns that are searched, and the cosine of half their range */
    cairn_vec2 turn_axis;
    /* px, between two sides */
    cairn_real turn_cosine, reach;
    /* squares of the sizes that are searched, with room for rounding */
    cairn_real least2, most2;
    /* least square of the cosine of a turn that is searched, with room for rounding; < 0: any
     * turn is */
    cairn_real cosine2;
    grouping_way ways[GROUPING_WAYS];
    /* of all segments, more than tokens where there are too many */
    int32_t piece_count, pieces_cut;
    int32_t token_count, columns, rows, sight_columns, sight_rows;
    /* 1: the filter holds the walks of this image */
    int32_t has_walked;
    int32_t start_count, object_count, segment_count, steps, looked;
    cairn_real best, best_evidence;
    /* the log of the parameter */
    cairn_real missing;
    /* How the outline lies: the pose at hand, its evidence, the most of any so far. */
    grouping_pose pose;
    cairn_real evidence, most;
    /* what a piece is worth less because edges are dense */
    cairn_real chance;
    /* of the outline's samples, of the size */
    cairn_real spacing;
    /* cell_count: cells of the sample before */
    int32_t sample, round, cell_count, is_laying;
    /* 1: it is there, and what matters is which tokens are its own */
    int32_t is_listing;
    int32_t cursor, other, link;
    int32_t phase, paid;
    /* of a callback: 0: not paid */
    int32_t stage;
};

static inline cairn_vec2 grouping_place(const grouping_pose *pose, cairn_vec2 m)
{
    cairn_vec2 p = {pose->t.x + pose->a * m.x - pose->b * m.y,
                    pose->t.y + pose->b * m.x + pose->a * m.y};

    return p;
}

static inline cairn_real grouping_size(const grouping_pose *pose)
{
    return cairn_sqrt(pose->a * pose->a + pose->b * pose->b);
}

/* A direction of the model in the image, not of length 1 but of the size. */
static inline cairn_vec2 grouping_direction(const grouping_pose *pose, cairn_vec2 d)
{
    cairn_vec2 turned = {pose->a * d.x - pose->b * d.y, pose->b * d.x + pose->a * d.y};

    return turned;
}

void cairn_grouping_sum(grouping_sums *sums, cairn_vec2 m, cairn_vec2 p, cairn_real weight);
grouping_pose cairn_grouping_fit(const grouping_sums *sums, const grouping_pose *otherwise);

/* Sums that hold a pose in place like `weight` points. */
grouping_sums cairn_grouping_hold(const grouping_pose *pose, cairn_real weight);

/* The tokens that fit best to a place and direction of the contour, at most `most`, the best
 * first: their costs, half squares of sigmas. The number of them. */
int32_t cairn_grouping_near(const cairn_grouping *g, cairn_vec2 at, cairn_vec2 direction,
                            cairn_real sigma, int32_t most, int32_t *token, cairn_real *cost);

/* The point of a token nearest to p. */
cairn_vec2 cairn_grouping_touch(const cairn_grouping *g, int32_t token, cairn_vec2 p);

/* First sight: what is needed of the model; and the places. */
void cairn_grouping_look_begin(cairn_grouping *g);
cairn_status cairn_grouping_look(cairn_grouping *g, cairn_budget *budget);

/* The walk. */
cairn_particle_model cairn_grouping_model(cairn_grouping *g);
cairn_status cairn_grouping_walk_begin(cairn_grouping *g);
cairn_status cairn_grouping_walk(cairn_grouping *g, cairn_budget *budget);

/* The outline: what is needed of the model; g->pose laid onto the tokens, match[], cost[] and
 * evidence; and moved to where it lies best, in a few rounds. */
void cairn_grouping_outline_begin(cairn_grouping *g);
void cairn_grouping_outline_chance(cairn_grouping *g);
cairn_status cairn_grouping_lay(cairn_grouping *g, cairn_budget *budget);
cairn_status cairn_grouping_refine(cairn_grouping *g, cairn_budget *budget);

/* The outline follows what it was laid onto, sample by sample, for the next time that it is laid
 * while listing. */
void cairn_grouping_bend(cairn_grouping *g);

/* The objects: at the starts, at the ends of the walks, and what is left of them side by side. */
cairn_status cairn_grouping_weigh(cairn_grouping *g, cairn_budget *budget);
cairn_status cairn_grouping_collect(cairn_grouping *g, cairn_budget *budget);
cairn_status cairn_grouping_finish(cairn_grouping *g, cairn_budget *budget);

#endif
