/* Contours completed along their chains.
 *
 * Method: segments between two that the grouping took lie on the same edge. Behind its last ones a chain is followed as long as it keeps
 * to the model, and across junctions to other chains that begin there; how far an edge lies off the model may grow slowly on the
 * way, for objects of one kind differ in their proportions. */
#include "src/core/build.h"

#include <stdlib.h>
#include <string.h>

#include "src/host/contour_search_work.h"

/* Of the object's size: a gap within a chain that is closed, whatever lies in it. */
#define GAP_SHARE 0.15
/* Beyond its ends a chain is followed so near to the model, or, from a segment that lay farther off, so much farther, but never farther than
 * the last; and turned by so little. Of the size. */
#define NEAR_SHARE  0.04
#define DRIFT_SHARE 0.02
#define FAR_SHARE   0.15
#define TURN_COSINE 0.8
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

/* The sample of the outline nearest to a segment's middle; *distance to it. */
static int32_t nearest_sample(const cairn_shape_model *m, const cairn_grouped_object *o, cairn_segment line,
                              cairn_real *distance)
{
    cairn_vec2 middle = middle_of(line);
    int32_t nearest = 0;

    *distance = CAIRN_REAL_MAX;
    for (int32_t i = 0; i < m->outline_count; i++) {
        cairn_vec2 at = cairn_vec2_add(o->origin, cairn_contour_turned(o, m->outline[i].position));
        cairn_real far = cairn_vec2_norm(cairn_vec2_sub(middle, at));

        if (far < *distance) {
            *distance = far;
            nearest = i;
        }
    }
    return nearest;
}

/* Whether the contour goes on with a segment from one that was taken. */
static int goes_on(const cairn_shape_model *m, const cairn_grouped_object *o, cairn_segment from, cairn_segment line)
{
    cairn_real before, distance;
    int32_t sample = nearest_sample(m, o, line, &distance);
    cairn_vec2 wanted = cairn_vec2_unit(cairn_contour_turned(o, m->outline[sample].direction));
    cairn_vec2 along = cairn_vec2_unit(cairn_vec2_sub(line.b, line.a));

    (void)nearest_sample(m, o, from, &before);
    return distance <= (cairn_real)FAR_SHARE * o->size &&
           distance <= cairn_max((cairn_real)NEAR_SHARE * o->size, before + (cairn_real)DRIFT_SHARE * o->size) &&
           cairn_abs(cairn_vec2_dot(wanted, along)) >= (cairn_real)TURN_COSINE;
}

/* Closes the gaps of one chain, segments[from ... to - 1]. */
static void close_gaps(const cairn_contour_tokens *t, const cairn_grouped_object *o, int32_t from, int32_t to,
                       uint8_t *taken)
{
    cairn_real gap = 0;
    int32_t before = -1;

    for (int32_t i = from; i < to; i++) {
        if (!taken[i]) {
            gap += cairn_segment_length(t->lines[i]);
            continue;
        }
        if (before >= 0 && gap <= (cairn_real)GAP_SHARE * o->size)
            memset(&taken[before], 1, (size_t)(i - before));
        before = i;
        gap = 0;
    }
}

/* Follows one chain on from what was taken, either way. */
static void follow(const cairn_contour_tokens *t, const cairn_shape_model *m, const cairn_grouped_object *o,
                   int32_t from, int32_t to, uint8_t *taken)
{
    for (int32_t i = from + 1; i < to; i++)
        if (!taken[i] && taken[i - 1])
            taken[i] = (uint8_t)goes_on(m, o, t->lines[i - 1], t->lines[i]);
    for (int32_t i = to - 2; i >= from; i--)
        if (!taken[i] && taken[i + 1])
            taken[i] = (uint8_t)goes_on(m, o, t->lines[i + 1], t->lines[i]);
}

static int meet(cairn_segment a, cairn_segment b)
{
    const cairn_real most = JUNCTION * JUNCTION;

    return cairn_vec2_norm_squared(cairn_vec2_sub(a.a, b.a)) <= most ||
           cairn_vec2_norm_squared(cairn_vec2_sub(a.a, b.b)) <= most ||
           cairn_vec2_norm_squared(cairn_vec2_sub(a.b, b.a)) <= most ||
           cairn_vec2_norm_squared(cairn_vec2_sub(a.b, b.b)) <= most;
}

static int32_t end_of(const cairn_contour_tokens *t, int32_t from)
{
    int32_t to = from + 1;

    while (to < t->count && t->chain[to] == t->chain[from])
        to++;
    return to;
}

/* Takes the ends of chains that go on where one that was taken ends; how many. */
static int32_t cross_junctions(const cairn_contour_tokens *t, const cairn_shape_model *m, const cairn_grouped_object *o,
                               const int32_t *ends, int32_t end_count, uint8_t *taken)
{
    int32_t crossed = 0;

    for (int32_t i = 0; i < end_count; i++)
        for (int32_t k = 0; k < end_count && taken[ends[i]]; k++)
            if (!taken[ends[k]] && meet(t->lines[ends[i]], t->lines[ends[k]]) &&
                goes_on(m, o, t->lines[ends[i]], t->lines[ends[k]])) {
                taken[ends[k]] = 1;
                crossed++;
            }
    return crossed;
}

/* Gaps and ends of all chains of which something was taken. */
static void complete_chains(const cairn_contour_tokens *t, const cairn_shape_model *m, const cairn_grouped_object *o,
                            uint8_t *taken)
{
    for (int32_t from = 0, to; from < t->count; from = to) {
        int32_t any = 0;

        to = end_of(t, from);
        for (int32_t i = from; i < to; i++)
            any |= taken[i];
        if (any) {
            close_gaps(t, o, from, to, taken);
            follow(t, m, o, from, to, taken);
        }
    }
}

/* The first and last segments of the chains that lie about the object; their number. */
static int32_t list_ends(const cairn_contour_tokens *t, const cairn_grouped_object *o, int32_t *ends)
{
    int32_t count = 0;

    for (int32_t from = 0, to; from < t->count; from = to) {
        to = end_of(t, from);
        for (int32_t k = 0; k < 1 + (to - from > 1); k++) {
            int32_t i = k == 0 ? from : to - 1;

            if (cairn_vec2_norm(cairn_vec2_sub(middle_of(t->lines[i]), o->origin)) <= o->size)
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
static int list_taken(const cairn_contour_tokens *t, const cairn_shape_model *m, const cairn_grouped_object *o,
                      const uint8_t *taken, int32_t *list, int32_t *count)
{
    placed *order = malloc(((size_t)t->count + 1) * sizeof *order);
    cairn_real distance;

    if (order == NULL)
        return 0;
    *count = 0;
    for (int32_t i = 0; i < t->count; i++)
        if (taken[i]) {
            order[*count].sample = nearest_sample(m, o, t->lines[i], &distance);
            order[(*count)++].segment = i;
        }
    qsort(order, (size_t)*count, sizeof *order, compare_placed);
    for (int32_t i = 0; i < *count; i++)
        list[i] = order[i].segment;
    free(order);
    return 1;
}

int cairn_contour_complete(const cairn_contour_tokens *t, const cairn_shape_model *model,
                           const cairn_grouped_object *object, int32_t *list, int32_t *count)
{
    uint8_t *taken = calloc((size_t)t->count + 1, 1);
    int32_t *ends = malloc(((size_t)t->count + 1) * sizeof *ends), end_count;
    int ok = taken != NULL && ends != NULL;

    if (ok) {
        for (int32_t i = 0; i < *count; i++)
            taken[list[i]] = 1;
        end_count = list_ends(t, object, ends);
        complete_chains(t, model, object, taken);
        for (int32_t round = 0; round < ROUNDS && cross_junctions(t, model, object, ends, end_count, taken) > 0;
             round++)
            complete_chains(t, model, object, taken);
        ok = list_taken(t, model, object, taken, list, count);
    }
    free(taken);
    free(ends);
    return ok;
}
