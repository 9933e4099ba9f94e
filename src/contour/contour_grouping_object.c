/* From walks to objects: every particle's model is laid onto its segments along the whole outline, ends and tips included, and the
 * best ones that share no place are reported, each with the segments that it goes along. */
#include "src/core/build.h"

#include "src/contour/contour_grouping_work.h"

/* Of the last deviation from the model how much is expected of the next one. */
#define CARRY CAIRN_REAL(0.8)
/* Points that the similarity of the round before is worth in the fit. */
#define HELD 2
/* Objects whose middles are closer than this, of their size, are one. */
#define APART CAIRN_REAL(0.3)
enum { UNITS_A_SAMPLE = 3 };
/* The best starts, which are tried in the end as well. */
enum { STARTS = 60 };

/* Goes along the outline in a pose and matches a token to each sample. The score; *sums: for the next fit. */
static cairn_real go_round(cairn_grouping *g, const grouping_pose *pose, grouping_sums *sums)
{
    const cairn_shape_model *m = g->input.model;
    cairn_real sigma = g->params.deform * grouping_size(pose), score = 0;
    cairn_vec2 off = {0, 0};

    for (int32_t i = 0; i < m->outline_count; i++) {
        cairn_vec2 place = grouping_place(pose, m->outline[i].position), at, touch, direction;
        cairn_real cost, across;

        off = cairn_vec2_scale(off, CARRY);
        at = cairn_vec2_add(place, off);
        direction = grouping_direction(pose, m->outline[i].direction);
        if (cairn_grouping_near(g, at, direction, sigma, 1, &g->match[i], &cost) == 0) {
            g->match[i] = -1;
            continue;
        }
        touch = cairn_grouping_touch(g, g->match[i], at);
        off = cairn_vec2_sub(touch, place);
        cairn_grouping_sum(sums, m->outline[i].position, touch, cairn_exp(-cost));
        across = cairn_vec2_norm(off) / (4 * sigma);
        score += cairn_exp(-cost / 3 - CAIRN_REAL(0.5) * across * across);
    }
    return score / (cairn_real)m->outline_count;
}

static cairn_real refine(cairn_grouping *g, grouping_pose *pose)
{
    cairn_real score = 0;

    for (int32_t round = 0; round < GROUPING_ROUNDS; round++) {
        grouping_sums sums = cairn_grouping_hold(pose, HELD);
        grouping_pose was = *pose;

        score = go_round(g, pose, &sums);
        if (round + 1 < GROUPING_ROUNDS)
            *pose = cairn_grouping_fit(&sums, &was);
    }
    return score;
}

/* Whether a pose is within what was asked for, but for a tenth. */
static int is_wanted(const cairn_grouping *g, const grouping_pose *pose)
{
    cairn_real size = grouping_size(pose);

    return size >= CAIRN_REAL(0.9) * g->input.min_size && size <= CAIRN_REAL(1.1) * g->input.max_size;
}

/* Puts an object where it belongs by its score; its place among the objects, -1: none. The place of its segments goes with it. */
static int32_t rank(cairn_grouping *g, const cairn_grouped_object *object)
{
    int32_t at = g->object_count, slot = g->object_count * g->params.max_outline;

    for (int32_t i = 0; i < g->object_count; i++) {
        cairn_real apart = APART * cairn_max(g->objects[i].size, object->size);

        if (cairn_vec2_norm_squared(cairn_vec2_sub(g->objects[i].origin, object->origin)) > apart * apart)
            continue;
        if (object->score <= g->objects[i].score)
            return -1;
        at = i;
        slot = g->objects[i].first;
        break;
    }
    if (at == g->object_count) {
        if (at == g->params.max_objects) {
            if (object->score <= g->objects[at - 1].score)
                return -1;
            at--;
            slot = g->objects[at].first;
        } else {
            g->object_count++;
        }
    }
    for (; at > 0 && g->objects[at - 1].score < object->score; at--)
        g->objects[at] = g->objects[at - 1];
    g->objects[at] = *object;
    g->objects[at].first = slot;
    return at;
}

/* The segments of match[], each once, in the order of the outline. */
static int32_t list_segments(const cairn_grouping *g, int32_t *list)
{
    int32_t count = 0;

    for (int32_t i = 0; i < g->input.model->outline_count; i++) {
        int32_t known = 0;

        if (g->match[i] < 0)
            continue;
        for (int32_t k = 0; k < count && !known; k++)
            known = list[k] == g->tokens[g->match[i]].segment;
        if (!known)
            list[count++] = g->tokens[g->match[i]].segment;
    }
    return count;
}

/* Samples of the paths of which a side is seen in a pose. */
static int32_t sides_seen(const cairn_grouping *g, const grouping_pose *pose)
{
    cairn_real sigma = g->params.deform * grouping_size(pose), cost;
    int32_t seen = 0, token;

    for (int32_t k = 0; k < g->input.model->sample_count; k++) {
        const cairn_shape_sample *s = &g->input.model->samples[k];
        int32_t sides = 0;

        for (int32_t side = 0; side < 2; side++)
            sides += cairn_grouping_near(g, grouping_place(pose, s->side[side].position),
                                         grouping_direction(pose, s->side[side].direction), sigma, 1, &token, &cost);
        seen += sides > 0;
    }
    return seen;
}

/* A walk's end, or, for an index behind the last walk, a start: walks that died early may have been on an object. */
static void collect_one(cairn_grouping *g, int32_t index)
{
    int32_t walks = cairn_particle_filter_count(g->filter), is_walk = index < walks;
    const grouping_state *s = is_walk ? cairn_particle_filter_particle(g->filter, index).state : NULL;
    grouping_pose pose = is_walk ? s->pose : g->starts[index - walks].pose;
    cairn_grouped_object object = {0, {0, 0}, 0, 0, 0, 0, 0, 0};
    int32_t at;

    object.score = refine(g, &pose);
    if (!is_wanted(g, &pose))
        return;
    g->best = cairn_max(g->best, object.score);
    if (object.score < g->params.min_score)
        return;
    object.origin = pose.t;
    object.size = grouping_size(&pose);
    object.turn = cairn_atan2(pose.b, pose.a);
    object.seen = sides_seen(g, &pose);
    object.start = is_walk ? s->start : g->starts[index - walks].sample;
    at = rank(g, &object);
    if (at >= 0)
        g->objects[at].count = list_segments(g, &g->segments[g->objects[at].first]);
}

/* Objects that have come to lie on better ones go; the lists of segments close up. */
static void close_up(cairn_grouping *g)
{
    int32_t kept = 0;

    for (int32_t i = 0; i < g->object_count; i++) {
        int32_t apart = 1;

        for (int32_t k = 0; k < kept && apart; k++) {
            cairn_real least = APART * cairn_max(g->objects[k].size, g->objects[i].size);

            apart = cairn_vec2_norm_squared(cairn_vec2_sub(g->objects[k].origin, g->objects[i].origin)) > least * least;
        }
        if (apart)
            g->objects[kept++] = g->objects[i];
    }
    g->object_count = kept;
    for (int32_t i = 0; i < kept; i++) {
        int32_t end = g->objects[i].first + g->objects[i].count;

        g->segment_count = end > g->segment_count ? end : g->segment_count;
    }
}

cairn_status cairn_grouping_collect(cairn_grouping *g, cairn_budget *budget)
{
    int32_t starts = g->start_count < STARTS ? g->start_count : STARTS;
    int32_t count = starts > 0 ? cairn_particle_filter_count(g->filter) + starts : 0;
    int32_t cost = GROUPING_ROUNDS * UNITS_A_SAMPLE * g->input.model->outline_count;

    for (; g->cursor < count; g->cursor++) {
        if (!cairn_budget_pay(budget, &g->paid, cost))
            return CAIRN_MORE;
        collect_one(g, g->cursor);
    }
    close_up(g);
    return CAIRN_OK;
}
