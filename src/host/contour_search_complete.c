/* The segments of a contour: those along the bent outline, completed along their chains.
 *
 * Method: a segment belongs to the contour when most of it runs near the outline and in its
 * direction. Segments between two of one chain lie on the same edge. Behind its last ones a
 * chain is followed as long as it keeps to the outline, and across junctions to other chains
 * that begin there; how far an edge lies off the outline may grow slowly on the way. About the
 * gaps of a drawing, where the object goes on that was not drawn, edges are followed round any
 * corner. */
#include "src/core/build.h"

#include <stdlib.h>
#include <string.h>

#include "src/host/contour_search_ends.h"
#include "src/host/contour_search_fit.h"

/* Of the object's size: a gap within a chain that is closed, whatever lies in it. */
#define GAP_SHARE 0.15
/* Beyond its ends a chain is followed so near to the model, or, from a segment that lay farther
 * off, so much farther, but never farther than the last; and turned by so little. Of the size. */
#define NEAR_SHARE  0.05
#define DRIFT_SHARE 0.03
#define FAR_SHARE   0.1
#define TURN_COSINE 0.8
/* A segment is along the outline within such a share of the size, but at least so many pixels;
 * looked at in such steps, px. */
#define REACH_SHARE 0.045
#define LEAST_REACH 3
#define STEP        3
/* Where an edge leaves the outline it is followed by so much of the size, round bends of a
 * chain, and across junctions about straight on. */
#define EXTEND_SHARE 0.35
/* And out of the box about the outline by so much of it: a drawing may end where the object goes
 * on, as at legs. */
#define BEYOND_SHARE 0.2
#define BEND_COSINE  0.5
#define ON_COSINE    0.6
/* Within such a share of the size of a gap of the drawing the object goes on: there edges are
 * followed round bends like these, and between ends so many pixels apart in any direction. */
#define OPEN_SHARE    0.3
#define OPEN_COSINE   0.3
#define OPEN_JUNCTION 10
/* Pixels between ends of chains that meet. */
#define JUNCTION 4
enum { ROUNDS = 8 };

typedef struct placed {
    int32_t sample, segment;
} placed;

static cairn_vec2 middle_of(cairn_segment line)
{
    return cairn_vec2_scale(cairn_vec2_add(line.a, line.b), CAIRN_REAL(0.5));
}

/* The sample of the outline nearest to a place; *distance to it. */
static int32_t nearest_sample(const contour_laid *c, cairn_vec2 place, cairn_real *distance)
{
    cairn_real least = CAIRN_REAL_MAX;
    int32_t nearest = 0;

    for (int32_t i = 0; i < c->outline_count; i++) {
        cairn_real far = cairn_vec2_norm_squared(cairn_vec2_sub(place, c->outline[i].position));

        if (far < least) {
            least = far;
            nearest = i;
        }
    }
    *distance = cairn_sqrt(least);
    return nearest;
}

/* 1 when a line runs as the outline does at a sample. */
static int runs_along(const contour_laid *c, int32_t sample, cairn_segment line)
{
    cairn_vec2 along = cairn_vec2_unit(cairn_vec2_sub(line.b, line.a));

    return cairn_abs(cairn_vec2_dot(c->outline[sample].direction, along)) >=
           (cairn_real)TURN_COSINE;
}

/* Whether the contour goes on with a segment from one that was taken. */
static int goes_on(const contour_laid *c, cairn_segment from, cairn_segment line)
{
    cairn_real before, distance;
    int32_t sample = nearest_sample(c, middle_of(line), &distance);

    (void)nearest_sample(c, middle_of(from), &before);
    return distance <= (cairn_real)FAR_SHARE * c->size &&
           distance <= cairn_max((cairn_real)NEAR_SHARE * c->size,
                                 before + (cairn_real)DRIFT_SHARE * c->size) &&
           runs_along(c, sample, line);
}

/* Whether most of a segment runs along the outline. */
static int lies_along(const contour_laid *c, cairn_segment line)
{
    int32_t steps = 1 + (int32_t)(cairn_segment_length(line) / STEP), near = 0;
    cairn_real most = cairn_max(LEAST_REACH, (cairn_real)REACH_SHARE * c->size);

    for (int32_t k = 0; k <= steps; k++) {
        cairn_real share = (cairn_real)k / (cairn_real)steps, distance;
        int32_t sample = nearest_sample(
            c, cairn_vec2_add(line.a, cairn_vec2_scale(cairn_vec2_sub(line.b, line.a), share)),
            &distance);

        near += distance <= most && runs_along(c, sample, line);
    }
    return 2 * near > steps + 1;
}

/* Closes the gaps of one chain, segments[from ... to - 1]. */
static void close_gaps(const cairn_contour_tokens *t, const contour_laid *c, int32_t from,
                       int32_t to, uint8_t *taken)
{
    cairn_real gap = 0;
    int32_t before = -1;

    for (int32_t i = from; i < to; i++) {
        if (!taken[i]) {
            gap += cairn_segment_length(t->lines[i]);
            continue;
        }
        if (before >= 0 && gap <= (cairn_real)GAP_SHARE * c->size)
            memset(&taken[before], 1, (size_t)(i - before));
        before = i;
        gap = 0;
    }
}

/* Follows one chain on from what was taken, either way. */
static void follow(const cairn_contour_tokens *t, const contour_laid *c, int32_t from, int32_t to,
                   uint8_t *taken)
{
    for (int32_t i = from + 1; i < to; i++)
        if (!taken[i] && taken[i - 1])
            taken[i] = (uint8_t)goes_on(c, t->lines[i - 1], t->lines[i]);
    for (int32_t i = to - 2; i >= from; i--)
        if (!taken[i] && taken[i + 1])
            taken[i] = (uint8_t)goes_on(c, t->lines[i + 1], t->lines[i]);
}

static int32_t end_of(const cairn_contour_tokens *t, int32_t from)
{
    int32_t to = from + 1;

    while (to < t->count && t->chain[to] == t->chain[from])
        to++;
    return to;
}

/* Takes the ends of chains that go on where one that was taken ends; how many. */
static int32_t cross_junctions(const cairn_contour_tokens *t, const contour_laid *c,
                               contour_ends *ends, uint8_t *taken)
{
    int32_t crossed = 0;

    for (int32_t i = 0; i < ends->count; i++) {
        int32_t from = ends->listed[i], near = taken[from] ? cairn_contour_ends_near(ends, i) : 0;

        for (int32_t k = 0; k < near; k++) {
            int32_t to = ends->listed[ends->near[k]];

            if (!taken[to] && goes_on(c, t->lines[from], t->lines[to])) {
                taken[to] = 1;
                crossed++;
            }
        }
    }
    return crossed;
}

/* Gaps and ends of all chains of which something was taken. */
static void complete_chains(const cairn_contour_tokens *t, const contour_laid *c, uint8_t *taken)
{
    for (int32_t from = 0, to; from < t->count; from = to) {
        int32_t any = 0;

        to = end_of(t, from);
        for (int32_t i = from; i < to; i++)
            any |= taken[i];
        if (any) {
            close_gaps(t, c, from, to, taken);
            follow(t, c, from, to, taken);
        }
    }
}

/* The first and last segments of the chains that lie about the object; their number. */
static int32_t list_ends(const cairn_contour_tokens *t, const contour_laid *c, int32_t *ends)
{
    int32_t count = 0;

    for (int32_t from = 0, to; from < t->count; from = to) {
        to = end_of(t, from);
        for (int32_t k = 0; k < 1 + (to - from > 1); k++) {
            int32_t i = k == 0 ? from : to - 1;

            if (cairn_vec2_norm(cairn_vec2_sub(middle_of(t->lines[i]), c->origin)) <= c->size)
                ends[count++] = i;
        }
    }
    return count;
}

static int compare_placed(const void *a, const void *b)
{
    const placed *x = a, *y = b;

    return x->sample != y->sample ? x->sample - y->sample : x->segment - y->segment;
}

/* All that is taken, in the order of the outline. */
static int list_taken(const cairn_contour_tokens *t, const contour_laid *c, const uint8_t *taken,
                      int32_t *list, int32_t *count)
{
    placed *order = malloc(((size_t)t->count + 1) * sizeof *order);
    cairn_real distance;

    if (order == NULL)
        return 0;
    *count = 0;
    for (int32_t i = 0; i < t->count; i++)
        if (taken[i]) {
            order[*count].sample = nearest_sample(c, middle_of(t->lines[i]), &distance);
            order[(*count)++].segment = i;
        }
    qsort(order, (size_t)*count, sizeof *order, compare_placed);
    for (int32_t i = 0; i < *count; i++)
        list[i] = order[i].segment;
    free(order);
    return 1;
}

/* The segments along the outline, those about the object only. */
static void collect(const cairn_contour_tokens *t, const contour_laid *c, uint8_t *taken)
{
    for (int32_t i = 0; i < t->count; i++)
        taken[i] = (uint8_t)(cairn_vec2_norm(cairn_vec2_sub(middle_of(t->lines[i]), c->origin)) <=
                                 c->size &&
                             lies_along(c, t->lines[i]));
}

/* ---- Beyond the outline ---- */

static int bends_little(cairn_segment from, cairn_segment to, cairn_real cosine)
{
    return cairn_vec2_dot(cairn_vec2_unit(cairn_vec2_sub(from.b, from.a)),
                          cairn_vec2_unit(cairn_vec2_sub(to.b, to.a))) >= cosine;
}

/* 1 when the second line goes on from an end of the first, at most so many pixels off and turned
 * by so little. */
static int continues(cairn_segment from, cairn_segment to, cairn_real junction, cairn_real cosine)
{
    for (int32_t k = 0; k < 4; k++) {
        cairn_vec2 end = k % 2 == 0 ? from.b : from.a,
                   out = cairn_vec2_sub(end, k % 2 == 0 ? from.a : from.b);
        cairn_vec2 start = k / 2 == 0 ? to.a : to.b,
                   on = cairn_vec2_sub(k / 2 == 0 ? to.b : to.a, start);

        if (cairn_vec2_norm_squared(cairn_vec2_sub(start, end)) <= junction * junction &&
            cairn_vec2_dot(cairn_vec2_unit(out), cairn_vec2_unit(on)) >= cosine)
            return 1;
    }
    return 0;
}

typedef struct extender {
    const cairn_contour_tokens *tokens;
    /* px, of the middles of segments */
    cairn_vec2 least, most;
    /* px */
    cairn_real limit;
    /* cosines along a chain and between chains */
    cairn_real bend, on;
    /* only about these; NULL: anywhere */
    const contour_gaps *gaps;
    /* px, of a gap */
    cairn_real reach;
    /* [tokens->count] px of edges from the outline to the end of each segment; CAIRN_REAL_MAX:
     * not taken */
    cairn_real *beyond;
    int32_t grown;
} extender;

static int is_open(const extender *e, cairn_vec2 at)
{
    int32_t near = e->gaps == NULL;

    for (int32_t i = 0; !near && i < e->gaps->count; i++)
        near = cairn_vec2_norm(cairn_vec2_sub(at, e->gaps->at[i])) <= e->reach;
    return near;
}

/* Goes on from one segment to another. */
static void extend(extender *e, int32_t from, int32_t to)
{
    cairn_vec2 at = middle_of(e->tokens->lines[to]);
    cairn_real beyond;

    if (!(e->beyond[from] < CAIRN_REAL_MAX) || e->beyond[to] == 0)
        return;
    beyond = e->beyond[from] + cairn_segment_length(e->tokens->lines[to]);
    if (beyond <= e->limit && beyond < e->beyond[to] && at.x >= e->least.x && at.y >= e->least.y &&
        at.x <= e->most.x && at.y <= e->most.y && is_open(e, at)) {
        e->beyond[to] = beyond;
        e->grown = 1;
    }
}

static void extend_chain(extender *e, int32_t from, int32_t to)
{
    const cairn_segment *lines = e->tokens->lines;

    for (int32_t i = from + 1; i < to; i++)
        if (bends_little(lines[i - 1], lines[i], e->bend))
            extend(e, i - 1, i);
    for (int32_t i = to - 2; i >= from; i--)
        if (bends_little(lines[i], lines[i + 1], e->bend))
            extend(e, i + 1, i);
}

/* Follows edges on beyond the outline, where they leave it. */
static void extend_all(extender *e, contour_ends *ends)
{
    for (int32_t round = 0; round < ROUNDS; round++) {
        e->grown = 0;
        for (int32_t from = 0, to; from < e->tokens->count; from = to) {
            to = end_of(e->tokens, from);
            extend_chain(e, from, to);
        }
        for (int32_t i = 0; i < ends->count; i++) {
            int32_t own = ends->listed[i],
                    near = e->beyond[own] < e->limit ? cairn_contour_ends_near(ends, i) : 0;

            for (int32_t k = 0; k < near; k++)
                if (continues(e->tokens->lines[own], e->tokens->lines[ends->listed[ends->near[k]]],
                              ends->apart, e->on))
                    extend(e, own, ends->listed[ends->near[k]]);
        }
        if (!e->grown)
            break;
    }
}

/* Once more, about the gaps, from all that is taken. */
static int extend_gaps(extender *e, const contour_gaps *gaps, const contour_ends *ends)
{
    contour_ends wide;

    if (!cairn_contour_ends_make(&wide, ends->lines, ends->listed, ends->count, OPEN_JUNCTION))
        return 0;
    for (int32_t i = 0; i < e->tokens->count; i++)
        e->beyond[i] = e->beyond[i] < CAIRN_REAL_MAX ? 0 : CAIRN_REAL_MAX;
    e->gaps = gaps;
    e->bend = (cairn_real)OPEN_COSINE;
    e->on = -1;
    extend_all(e, &wide);
    cairn_contour_ends_free(&wide);
    return 1;
}

static int extend_taken(const cairn_contour_tokens *t, const contour_laid *c,
                        const contour_gaps *gaps, contour_ends *ends, uint8_t *taken)
{
    cairn_real beyond = (cairn_real)BEYOND_SHARE * c->size;
    cairn_box box = cairn_box_empty();
    int ok = 1;
    extender e = {.tokens = t,
                  .limit = (cairn_real)EXTEND_SHARE * c->size,
                  .bend = (cairn_real)BEND_COSINE,
                  .on = (cairn_real)ON_COSINE,
                  .reach = (cairn_real)OPEN_SHARE * c->size,
                  .beyond = calloc((size_t)t->count + 1, sizeof *e.beyond)};

    if (e.beyond == NULL)
        return 0;
    for (int32_t i = 0; i < c->outline_count; i++)
        box = cairn_box_extend(box, c->outline[i].position);
    e.least = cairn_vec2_sub(box.min, (cairn_vec2){beyond, beyond});
    e.most = cairn_vec2_add(box.max, (cairn_vec2){beyond, beyond});
    for (int32_t i = 0; i < t->count; i++)
        e.beyond[i] = taken[i] ? 0 : CAIRN_REAL_MAX;
    extend_all(&e, ends);
    if (gaps->count > 0)
        ok = extend_gaps(&e, gaps, ends);
    for (int32_t i = 0; i < t->count; i++)
        taken[i] = e.beyond[i] < CAIRN_REAL_MAX;
    free(e.beyond);
    return ok;
}

int cairn_contour_collect_open(const cairn_contour_tokens *t, const contour_laid *c,
                               const contour_gaps *gaps, int32_t *list, int32_t *count)
{
    uint8_t *taken = calloc((size_t)t->count + 1, 1);
    int32_t *listed = malloc(((size_t)t->count + 1) * sizeof *listed);
    contour_ends ends;
    int ok = taken != NULL && listed != NULL &&
             cairn_contour_ends_make(&ends, t->lines, listed, list_ends(t, c, listed), JUNCTION);

    if (ok) {
        collect(t, c, taken);
        complete_chains(t, c, taken);
        for (int32_t round = 0; round < ROUNDS && cross_junctions(t, c, &ends, taken) > 0; round++)
            complete_chains(t, c, taken);
        ok = extend_taken(t, c, gaps, &ends, taken) && list_taken(t, c, taken, list, count);
        cairn_contour_ends_free(&ends);
    }
    free(taken);
    free(listed);
    return ok;
}

int cairn_contour_collect(const cairn_contour_tokens *t, const contour_laid *c, int32_t *list,
                          int32_t *count)
{
    const contour_gaps none = {.count = 0};

    return cairn_contour_collect_open(t, c, &none, list, count);
}
