/* What the parts of shape_model share. */
#ifndef CAIRN_CONTOUR_SHAPE_MODEL_WORK_H
#define CAIRN_CONTOUR_SHAPE_MODEL_WORK_H

#include "cairn/shape_model.h"

/* Samples that every outline has at least. */
enum { SHAPE_LEAST_POINTS = 16, SHAPE_LEAST_SAMPLES = 3 };

/* A run of samples of an outline that still needs a path: `count` of them from `start` on; all
 * of them, round, when it is the outline itself. */
typedef struct shape_arc {
    int32_t start, count;
    int32_t round;
    int32_t parent, branch; /* of the path that will come of it */
} shape_arc;

/* A pair of samples of the outline on the way: the path has come down to `low` and up to `high`,
 * counted from arc.start (negative and beyond the end where the arc goes round). */
typedef struct shape_pair {
    int32_t low, high;
} shape_pair;

struct cairn_shape_builder {
    cairn_shape_builder_params params;
    /* all outlines one after another */
    cairn_oriented_point *outline;
    /* [points^2] of the outline at hand: what its pairs are worth, below 0: not symmetric */
    cairn_real *gain;
    /* [3][points] rows of the longest path for gaps g, g - 1, g - 2 */
    cairn_real *value;
    /* [points^2] how the longest path came to (low, gap) */
    uint8_t *move;
    /* [2 points] the path that was found, from its start on */
    shape_pair *way;
    cairn_shape_sample *samples;
    cairn_shape_path *paths;
    /* still to be looked at, the longest first */
    shape_arc arcs[CAIRN_SHAPE_PATHS];
    /* of each outline in outline[] */
    int32_t first[CAIRN_SHAPE_OUTLINES + 1];
    /* of each, in units of the size */
    cairn_real length[CAIRN_SHAPE_OUTLINES];
    /* of all */
    cairn_real whole;
    cairn_real size;
    cairn_vec2 origin;
    int32_t outline_count, sample_count, path_count, arc_count, way_count;
    /* the outline at hand */
    int32_t at;
    /* PAIRS: pair; WALK: cell of (gap, low) */
    int32_t cursor;
    /* WALK: gap and low of the best end so far */
    int32_t best[2];
    cairn_real best_value;
    int32_t phase;
    int32_t paid;
};

/* Samples of the outline at hand. */
static inline int32_t shape_points(const cairn_shape_builder *b)
{
    return b->first[b->at + 1] - b->first[b->at];
}

/* Index in outline[] of place `i` of an arc. */
static inline int32_t shape_point(const cairn_shape_builder *b, const shape_arc *arc, int32_t i)
{
    int32_t n = shape_points(b), at = (arc->start + i) % n;

    return b->first[b->at] + (at < 0 ? at + n : at);
}

/* Samples of all paths at most. */
int32_t cairn_shape_most_samples(const cairn_shape_builder_params *params);

/* The disc of two samples, its first touch at `low`. 0: there is none that lies inside. */
int cairn_shape_disc(const cairn_shape_builder *b, int32_t low, int32_t high,
                     cairn_shape_sample *disc);

/* What pair (low, high), indices in outline[], is worth. */
cairn_real cairn_shape_gain(const cairn_shape_builder *b, int32_t low, int32_t high);

/* Looks for the longest path through an arc: begin, then step until it does not return
 * CAIRN_MORE; then way[] holds it. */
void cairn_shape_walk_begin(cairn_shape_builder *b);
cairn_status cairn_shape_walk_step(cairn_shape_builder *b, const shape_arc *arc,
                                   cairn_budget *budget);

/* Makes a path of way[], and arcs of what it has left out. */
void cairn_shape_add_path(cairn_shape_builder *b, const shape_arc *arc);

/* Puts an arc among those that wait, the longest first; without room the shortest goes. */
void cairn_shape_add_arc(cairn_shape_builder *b, shape_arc arc);

#endif
