/* contour_search: from a picture of edge strengths to the contours of an object that is known by
 * its model.
 *
 * What edge_chain, edge_segment and contour_grouping do, one after the other, with memory from
 * the heap that fits the picture: first its tokens, then objects among them, the model as it is
 * and, on request, mirrored. Image coordinates, pixels. */
#ifndef CAIRN_CONTOUR_SEARCH_H
#define CAIRN_CONTOUR_SEARCH_H

#include "cairn/contour_grouping.h"
#include "cairn/edge_segment.h"
#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* More pixels of edges than these are refused; so are sides beyond CAIRN_CONTOUR_SIDE_MOST. Of
 * more tokens some are left out. */
#define CAIRN_CONTOUR_EDGES_MOST  (INT32_C(1) << 20)
#define CAIRN_CONTOUR_SIDE_MOST   8192
#define CAIRN_CONTOUR_TOKENS_MOST 32768

/* What is grouped: straight pieces of edges. */
typedef struct cairn_contour_tokens {
    cairn_segment *lines; /* [count] */
    int32_t *chain;       /* [count] of which chain each is a piece */
    cairn_real *strength; /* [count] 0 ... 1: the share of all edges, by length, that are weaker */
    int32_t count, chains;
    int32_t width, height;  /* px, of the picture */
    cairn_real mean_length; /* px */
    size_t pool_bytes;      /* that it took to find them */
    /* Of cairn_contour_tokens_find_written() alone. */
    cairn_real look_ahead; /* px */
    cairn_vec2 *ends;      /* [end_count] px: end points of the strong chains */
    int32_t end_count;
} cairn_contour_tokens;

/* Finds the edges' segments; edgels: 1: edgels, short straight pieces at even steps along the
 * chains, in their place. min_strength: 1 ... 255. CAIRN_FULL: beyond the limits above;
 * CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. On failure there is nothing to free. `path` is named by
 * the error. */
CAIRN_CHECKED cairn_status cairn_contour_tokens_find(cairn_contour_tokens *tokens,
                                                     cairn_raster_u8_view strengths,
                                                     int32_t min_strength, int32_t edgels,
                                                     const char *path, cairn_file_error *error);

/* The same for the mode as written (Adluru 2008, 2.6 and 2.7): the virtual segments at junctions
 * as well (their chain is -1), and the end points of the chains whose mean strength is at least
 * `strong` times that of all, by length. strong: finite, >= 0. */
CAIRN_CHECKED cairn_status cairn_contour_tokens_find_written(cairn_contour_tokens *tokens,
                                                             cairn_raster_u8_view strengths,
                                                             int32_t min_strength, int32_t edgels,
                                                             cairn_real strong, const char *path,
                                                             cairn_file_error *error);
void cairn_contour_tokens_free(cairn_contour_tokens *tokens);

/* One disc of an object's axis. */
typedef struct cairn_contour_disc {
    /* px; of the symmetric point of both sides where both were seen, else where the model has it */
    cairn_vec2 centre;
    /* px */
    cairn_real radius;
    /* the segment on the left and on the right, -1: not seen */
    int32_t side[2];
    /* of the model */
    int32_t sample;
} cairn_contour_disc;

/* A sample of the model's outline where it lies, bent, in the image: the prediction of the
 * contour where no edge is. */
typedef struct cairn_contour_place {
    /* px */
    cairn_oriented_point at;
    /* of the contour, along it; -1: not seen */
    int32_t segment;
    /* of which outline of the model, each of which goes round, it is a sample */
    int32_t part;
} cairn_contour_place;

/* How well an outline fits where it was bent to, whatever lies round it. */
typedef struct cairn_contour_shape {
    /* 0 ... 1, mean over the bent outline of how near an edge of its direction is */
    cairn_real close;
    /* 0 ... 2, mean of 1 - cos of the angles between the bent outline and the drawn one */
    cairn_real turned;
    /* 0 ... 1, rms of what an affine map of the drawn outline leaves of the bent one, in sizes */
    cairn_real strained;
} cairn_contour_shape;

/* evidence: about the logarithm of how much likelier its edges are with the object than by
 * chance, for each size of outline, more or less as the bent outline fits: its shape (turned:
 * against the drawing turned as the object is) and the score count. score: the share of the
 * outline that is seen. */
typedef struct cairn_contour_object {
    /* first: the index of its first segment in segments[] below; along: 0 */
    cairn_grouped_object found;
    /* 1: it is the mirrored model */
    int32_t mirrored;
    /* discs[first_disc ... + disc_count - 1] */
    int32_t first_disc;
    /* the model's samples, path by path; in the mode as written the steps of the walk */
    int32_t disc_count;
    /* outline[first_outline ... + outline_count - 1] */
    int32_t first_outline;
    /* the model's; 0 in the mode as written, which bends no outline */
    int32_t outline_count;
    /* of the evidence: of the outline before it was bent, and of the bent one */
    cairn_real rigid, bent;
    cairn_contour_shape shape;
} cairn_contour_object;

typedef struct cairn_contour_result {
    /* [object_count] the best first */
    cairn_contour_object *objects;
    /* indices of lines, object by object, in the order of the model's outline */
    int32_t *segments;
    cairn_contour_disc *discs;
    cairn_contour_place *outline;
    /* of the model as it is, and mirrored */
    cairn_grouping_trace *trace[2];
    /* [steps] groups of particles: models apart; as written: starts apart */
    int32_t *modes[2];
    int32_t steps[2], starts[2];
    int32_t object_count, segment_count, disc_count, outline_count;
    /* the best score of all, reported or not */
    cairn_real best;
    /* and the most evidence */
    cairn_real best_evidence;
    /* the larger of both searches' */
    size_t pool_bytes;
    /* CAIRN_MODE_... of the search */
    int32_t mode;
    /* Of the mode as written alone. */
    /* symmetric points; those beyond the memory for them, the least symmetric */
    int32_t points, points_dropped;
    /* CAIRN_GROUPING_...: why the walk ended */
    int32_t end;
} cairn_contour_result;

/* A CAIRN_GROUPING_... in words: "no start", "posterior", "no follower", "steps", "histories";
 * "" of another number. */
const char *cairn_contour_end_text(int32_t end);

typedef struct cairn_contour_search_params {
    /* its capacities are set by the search; its objects are looked at again */
    cairn_grouping_params grouping;
    /* for each size of outline: objects with less are not reported (34) */
    cairn_real min_evidence;
    /* 0 ... 1: nor those of which less is seen (0.3) */
    cairn_real min_score;
    /* px, > 0 */
    cairn_real min_size, max_size;
    /* rad (-15 ... 15 degrees) */
    cairn_real min_turn, max_turn;
    /* 1: the mirrored model is looked for, too (1) */
    int32_t mirror;
    /* Called with the particles after every step of the walk; NULL: not called. */
    void (*on_step)(void *context, const cairn_grouping_particle *particles, int32_t count,
                    int32_t mirrored);
    void *context;
    /* Of the mode as written: called after on_step with the walk of the heaviest particle; NULL:
     * not called. */
    void (*on_walk)(void *context, const cairn_grouping_disc *discs, int32_t count);
} cairn_contour_search_params;

/* The values in brackets above; sizes from a tenth of the picture's diagonal, at least 24 px, to
 * the whole. */
cairn_contour_search_params cairn_contour_search_default(int32_t width, int32_t height);

/* The mode as written: no mirror image, no turn; searched is the middle (geometric mean) of
 * min_size and max_size. */
cairn_contour_search_params cairn_contour_search_as_written(int32_t width, int32_t height);

/* Looks for the objects. CAIRN_BAD_ARGUMENT: params, a model that cannot be searched (statuses
 * of cairn_grouping_begin); CAIRN_FULL: in the mode as written, of more than 2^20 segments;
 * CAIRN_NO_MEMORY. On failure there is nothing to free. `path` is named by the error. */
CAIRN_CHECKED cairn_status cairn_contour_search_run(cairn_contour_result *result,
                                                    const cairn_contour_tokens *tokens,
                                                    const cairn_shape_model *model,
                                                    const cairn_contour_search_params *params,
                                                    const char *path, cairn_file_error *error);
void cairn_contour_result_free(cairn_contour_result *result);

/* The next piece of an object's outline, at sample `from` or behind it, that no segment of its
 * contour goes along: samples *first ... *first + *count - 1, which are predicted, not seen; it
 * ends at the end of an outline. 0: there is none. Cost: linear. */
int cairn_contour_completed(const cairn_contour_result *result, const cairn_contour_object *object,
                            int32_t from, int32_t *first, int32_t *count);

#ifdef __cplusplus
}
#endif

#endif
