/* From walks to objects: the outline is laid onto the tokens where the walks have ended and
 * where they began, and the places with most evidence that are apart from each other are the
 * objects, each with the segments that it goes along. No token belongs to two of them: what the
 * better one has taken is no evidence for the next. */
#include "src/core/build.h"

#include <string.h>

#include "src/contour/contour_grouping_work.h"

/* Objects whose middles are closer than this, of their size, are one. */
#define APART CAIRN_REAL(0.3)
/* Half squares of sigmas at which a sample counts by a third in the score. */
#define SCORE_COST 3

/* Walks that end within so much of each other, of their size, come to the same place. */
#define SAME_END CAIRN_REAL(0.002)
/* Ends that a unit compares. */
enum { ENDS_A_UNIT = 16 };

/* So often the outline follows what an object has been laid onto before its segments are listed. */
enum { BENDS = 8 };

/* Whether a pose is within what was asked for, but for a tenth. */
static int is_wanted(const cairn_grouping *g, const grouping_pose *pose)
{
    cairn_real size = grouping_size(pose);

    return size >= CAIRN_REAL(0.9) * g->input.min_size &&
           size <= CAIRN_REAL(1.1) * g->input.max_size;
}

static int are_one(const cairn_grouped_object *a, const cairn_grouped_object *b)
{
    cairn_real apart = APART * cairn_max(a->size, b->size);

    return cairn_vec2_norm_squared(cairn_vec2_sub(a->origin, b->origin)) <= apart * apart;
}

/* Takes the object at a place out of the list. */
static void take_out(cairn_grouping *g, int32_t at)
{
    g->object_count--;
    for (; at < g->object_count; at++)
        g->objects[at] = g->objects[at + 1];
}

/* Puts a place among the objects by its evidence, unless a better one is the same; worse ones
 * that are the same go. */
static void consider(cairn_grouping *g, const grouping_pose *pose, cairn_real evidence,
                     int32_t start)
{
    cairn_grouped_object o = {
        .evidence = evidence, .origin = pose->t, .size = grouping_size(pose), .start = start};
    int32_t at;

    if (!(evidence > 0) || !is_wanted(g, pose))
        return;
    o.turn = cairn_atan2(pose->b, pose->a);
    for (int32_t i = g->object_count - 1; i >= 0; i--) {
        if (!are_one(&o, &g->objects[i]))
            continue;
        if (g->objects[i].evidence >= evidence)
            return;
        take_out(g, i);
    }
    if (g->object_count == g->params.max_objects) {
        if (g->objects[g->object_count - 1].evidence >= evidence)
            return;
        g->object_count--;
    }
    for (at = g->object_count++; at > 0 && g->objects[at - 1].evidence < evidence; at--)
        g->objects[at] = g->objects[at - 1];
    g->objects[at] = o;
}

/* 1 when at least half of a token's segment is taken. */
static int is_grouped(const cairn_grouping *g, int32_t token)
{
    int32_t segment = g->tokens[token].segment, all = 0, taken = 0;

    while (token > 0 && g->tokens[token - 1].segment == segment)
        token--;
    for (; token < g->token_count && g->tokens[token].segment == segment; token++) {
        all++;
        taken += g->tokens[token].taken;
    }
    return 2 * taken >= all;
}

/* The segments of match[], each once, in the order of the outline; the segment of each sample. */
static void list_segments(cairn_grouping *g, cairn_grouped_object *o)
{
    int32_t *list = &g->segments[g->segment_count];

    o->first = g->segment_count;
    o->count = 0;
    for (int32_t i = 0; i < g->input.model->outline_count; i++)
        if (g->match[i] >= 0)
            g->tokens[g->match[i]].taken = 1;
    for (int32_t i = 0; i < g->input.model->outline_count; i++) {
        int32_t known = 0, segment;

        g->along[o->along + i] = -1;
        if (g->match[i] < 0 || !is_grouped(g, g->match[i]))
            continue;
        segment = g->tokens[g->match[i]].segment;
        g->along[o->along + i] = segment;
        for (int32_t k = 0; k < o->count && !known; k++)
            known = list[k] == segment;
        if (!known)
            list[o->count++] = segment;
    }
    g->segment_count += o->count;
}

/* The sample of the outline nearest to a place of the model. */
static int32_t nearest_sample(const cairn_shape_model *m, cairn_vec2 place)
{
    cairn_real least = CAIRN_REAL_MAX;
    int32_t nearest = 0;

    for (int32_t i = 0; i < m->outline_count; i++) {
        cairn_real apart = cairn_vec2_norm_squared(cairn_vec2_sub(m->outline[i].position, place));

        if (apart < least) {
            least = apart;
            nearest = i;
        }
    }
    return nearest;
}

/* Samples of the paths of which a side is seen. */
static int32_t sides_seen(const cairn_grouping *g)
{
    const cairn_shape_model *m = g->input.model;
    int32_t seen = 0;

    for (int32_t k = 0; k < m->sample_count; k++)
        seen += g->match[nearest_sample(m, m->samples[k].side[0].position)] >= 0 ||
                g->match[nearest_sample(m, m->samples[k].side[1].position)] >= 0;
    return seen;
}

/* How much of the outline is seen, and how well. */
static cairn_real score_of(const cairn_grouping *g)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < g->input.model->outline_count; i++)
        sum += g->match[i] >= 0 ? cairn_exp(-g->cost[i] / SCORE_COST) : 0;
    return sum / (cairn_real)g->input.model->outline_count;
}

/* The object at `cursor` with what the better ones have left: it goes when that is too little. */
static void judge(cairn_grouping *g)
{
    cairn_grouped_object *o = &g->objects[g->cursor];

    o->evidence = g->evidence;
    o->score = score_of(g);
    if (g->cursor == 0 && !(g->best_evidence > 0)) {
        g->best = o->score;
        g->best_evidence = o->evidence;
    }
    if (o->evidence < g->params.min_evidence || o->score < g->params.min_score)
        take_out(g, g->cursor);
    else {
        g->is_listing = 1;
        memset(g->shift, 0, (size_t)g->input.model->outline_count * sizeof *g->shift);
    }
}

static void list(cairn_grouping *g)
{
    cairn_grouped_object *o = &g->objects[g->cursor];

    o->along = g->cursor * g->input.model->outline_count;
    o->score = score_of(g);
    if (g->cursor == 0 && o->evidence >= g->best_evidence)
        g->best = o->score;
    o->seen = sides_seen(g);
    list_segments(g, o);
    g->is_listing = g->round = 0;
    g->cursor++;
}

static grouping_pose pose_of(const cairn_grouped_object *o)
{
    grouping_pose pose = {.t = o->origin};

    cairn_sincos(o->turn, &pose.b, &pose.a);
    pose.a *= o->size;
    pose.b *= o->size;
    return pose;
}

cairn_status cairn_grouping_weigh(cairn_grouping *g, cairn_budget *budget)
{
    for (; g->cursor < g->start_count; g->cursor++) {
        grouping_start *start = &g->starts[g->cursor];
        cairn_status status;

        if (!g->is_laying)
            g->pose = start->pose;
        status = cairn_grouping_refine(g, budget);
        if (status != CAIRN_OK)
            return status;
        start->pose = g->pose;
        start->score = g->evidence;
        consider(g, &g->pose, g->evidence, start->sample);
    }
    return CAIRN_OK;
}

/* 1 when a walk before has ended where the pose at hand is; 0: it is a new end. The starts,
 * which the walk has done with, keep them. */
static int has_ended_here(cairn_grouping *g)
{
    cairn_real size = grouping_size(&g->pose), least = SAME_END * SAME_END * size * size;

    for (int32_t i = 0; i < g->other; i++) {
        const grouping_pose *end = &g->starts[i].pose;
        cairn_real a = end->a - g->pose.a, b = end->b - g->pose.b;

        if (cairn_vec2_norm_squared(cairn_vec2_sub(end->t, g->pose.t)) + a * a + b * b <= least)
            return 1;
    }
    g->starts[g->other++].pose = g->pose;
    return 0;
}

cairn_status cairn_grouping_collect(cairn_grouping *g, cairn_budget *budget)
{
    int32_t count = g->start_count > 0 ? cairn_particle_filter_count(g->filter) : 0;

    for (; g->cursor < count; g->cursor++) {
        const grouping_state *s = cairn_particle_filter_particle(g->filter, g->cursor).state;
        cairn_status status;

        if (!g->is_laying) {
            if (!cairn_budget_pay(budget, &g->paid, 1 + g->other / ENDS_A_UNIT))
                return CAIRN_MORE;
            g->pose = s->pose;
            if (has_ended_here(g))
                continue;
        }
        status = cairn_grouping_refine(g, budget);
        if (status != CAIRN_OK)
            return status;
        consider(g, &g->pose, g->evidence, s->start);
    }
    return CAIRN_OK;
}

cairn_status cairn_grouping_finish(cairn_grouping *g, cairn_budget *budget)
{
    while (g->cursor < g->object_count) {
        cairn_status status;

        if (!g->is_laying)
            g->pose = pose_of(&g->objects[g->cursor]);
        status = cairn_grouping_lay(g, budget);
        if (status != CAIRN_OK)
            return status;
        if (!g->is_listing)
            judge(g);
        else if (g->round++ < BENDS)
            cairn_grouping_bend(g);
        else
            list(g);
    }
    return CAIRN_OK;
}
