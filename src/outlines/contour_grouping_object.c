/* Object selection by non-maximum suppression.
 *
 * Method:
 * 1. The outline is matched to the tokens at every hypothesis and at the final pose of every
 *    particle.
 * 2. The poses of greatest evidence that are far enough apart are the objects.
 * 3. Each object lists the segments along its outline. A token belongs to one object only: tokens
 *    of a better object are no evidence for the next. */
#include "src/base/build.h"

#include <string.h>

#include "src/outlines/contour_grouping_work.h"

/* Non-maximum suppression radius, share of the object's size. */
#define NMS_RADIUS CAIRN_REAL(0.3)
/* Cost (half squared sigmas) at which a sample counts 1/e in the score. */
#define SCORE_COST 3

/* Final poses within this distance, share of the size, are duplicates. */
#define END_TOLERANCE CAIRN_REAL(0.002)
/* Final poses compared per work unit. */
enum { ENDS_PER_UNIT = 16 };

/* Deformation rounds before an object's segments are listed. */
enum { DEFORM_ROUNDS = 8 };

/* Returns 1 when a pose is within the size range, with a tolerance of a tenth. */
static int is_size_allowed(const cairn_contour_grouping *grouping,
                           const contour_grouping_pose *pose)
{
    cairn_real size = contour_grouping_size(pose);

    return size >= CAIRN_REAL(0.9) * grouping->input.min_size &&
           size <= CAIRN_REAL(1.1) * grouping->input.max_size;
}

static int are_duplicates(const cairn_contour_grouping_object *a,
                          const cairn_contour_grouping_object *b)
{
    cairn_real radius = NMS_RADIUS * cairn_max(a->size, b->size);

    return cairn_vec2_norm_squared(cairn_vec2_sub(a->origin, b->origin)) <= radius * radius;
}

/* Removes the object at `index`. */
static void remove_object(cairn_contour_grouping *grouping, int32_t index)
{
    grouping->object_count--;
    for (; index < grouping->object_count; index++)
        grouping->objects[index] = grouping->objects[index + 1];
}

/* Inserts a pose into the objects, sorted by evidence (non-maximum suppression): rejected when a
 * better one is within the radius; worse ones within the radius are removed. */
static void insert_object(cairn_contour_grouping *grouping, const contour_grouping_pose *pose,
                          cairn_real evidence, int32_t start)
{
    cairn_contour_grouping_object object = {.evidence = evidence,
                                            .origin = pose->t,
                                            .size = contour_grouping_size(pose),
                                            .start_sample = start};
    int32_t index;

    if (!(evidence > 0) || !is_size_allowed(grouping, pose))
        return;
    object.turn = cairn_atan2(pose->b, pose->a);
    for (int32_t i = grouping->object_count - 1; i >= 0; i--) {
        if (!are_duplicates(&object, &grouping->objects[i]))
            continue;
        if (grouping->objects[i].evidence >= evidence)
            return;
        remove_object(grouping, i);
    }
    if (grouping->object_count == grouping->params.max_objects) {
        if (grouping->objects[grouping->object_count - 1].evidence >= evidence)
            return;
        grouping->object_count--;
    }
    for (index = grouping->object_count++;
         index > 0 && grouping->objects[index - 1].evidence < evidence; index--)
        grouping->objects[index] = grouping->objects[index - 1];
    grouping->objects[index] = object;
}

/* Returns 1 when at least half of a token's segment is claimed by objects. */
static int is_segment_used(const cairn_contour_grouping *grouping, int32_t token)
{
    int32_t segment = grouping->tokens[token].segment, all = 0, used = 0;

    while (token > 0 && grouping->tokens[token - 1].segment == segment)
        token--;
    for (; token < grouping->token_count && grouping->tokens[token].segment == segment; token++) {
        all++;
        used += grouping->tokens[token].is_used;
    }
    return 2 * used >= all;
}

/* Lists the matched segments of an object, each once, in the order of the outline; and the segment
 * of each sample. */
static void list_segments(cairn_contour_grouping *grouping, cairn_contour_grouping_object *object)
{
    int32_t *list = &grouping->segments[grouping->segment_count];

    object->first = grouping->segment_count;
    object->count = 0;
    for (int32_t i = 0; i < grouping->input.model->outline_count; i++)
        if (grouping->match[i] >= 0)
            grouping->tokens[grouping->match[i]].is_used = 1;
    for (int32_t i = 0; i < grouping->input.model->outline_count; i++) {
        int32_t known = 0, segment;

        grouping->along[object->first_outline + i] = -1;
        if (grouping->match[i] < 0 || !is_segment_used(grouping, grouping->match[i]))
            continue;
        segment = grouping->tokens[grouping->match[i]].segment;
        grouping->along[object->first_outline + i] = segment;
        for (int32_t k = 0; k < object->count && !known; k++)
            known = list[k] == segment;
        if (!known)
            list[object->count++] = segment;
    }
    grouping->segment_count += object->count;
}

/* Index of the outline sample nearest to a point of the model. */
static int32_t nearest_sample(const cairn_shape_model *model, cairn_vec2 point)
{
    cairn_real smallest = CAIRN_REAL_MAX;
    int32_t nearest = 0;

    for (int32_t i = 0; i < model->outline_count; i++) {
        cairn_real squared =
            cairn_vec2_norm_squared(cairn_vec2_sub(model->outline[i].position, point));

        if (squared < smallest) {
            smallest = squared;
            nearest = i;
        }
    }
    return nearest;
}

/* Number of path samples with at least one matched side. */
static int32_t count_matched_sides(const cairn_contour_grouping *grouping)
{
    const cairn_shape_model *model = grouping->input.model;
    int32_t matched = 0;

    for (int32_t k = 0; k < model->sample_count; k++)
        matched +=
            grouping->match[nearest_sample(model, model->samples[k].contact[0].position)] >= 0 ||
            grouping->match[nearest_sample(model, model->samples[k].contact[1].position)] >= 0;
    return matched;
}

/* Score of the match: mean over the outline of exp(-cost / SCORE_COST), 0 where occluded. */
static cairn_real score_of(const cairn_contour_grouping *grouping)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < grouping->input.model->outline_count; i++)
        sum += grouping->match[i] >= 0 ? cairn_exp(-grouping->cost[i] / SCORE_COST) : 0;
    return sum / (cairn_real)grouping->input.model->outline_count;
}

/* Verifies the object at `cursor` with the tokens left by better ones; removes it below the
 * thresholds. */
static void verify_object(cairn_contour_grouping *grouping)
{
    cairn_contour_grouping_object *object = &grouping->objects[grouping->cursor];

    object->evidence = grouping->evidence;
    object->score = score_of(grouping);
    if (grouping->cursor == 0 && !(grouping->best_evidence > 0)) {
        grouping->best_score = object->score;
        grouping->best_evidence = object->evidence;
    }
    if (object->evidence < grouping->params.min_evidence ||
        object->score < grouping->params.min_score)
        remove_object(grouping, grouping->cursor);
    else {
        grouping->is_listing = 1;
        memset(grouping->shift, 0,
               (size_t)grouping->input.model->outline_count * sizeof *grouping->shift);
    }
}

static void list_object(cairn_contour_grouping *grouping)
{
    cairn_contour_grouping_object *object = &grouping->objects[grouping->cursor];

    object->first_outline = grouping->cursor * grouping->input.model->outline_count;
    object->score = score_of(grouping);
    if (grouping->cursor == 0 && object->evidence >= grouping->best_evidence)
        grouping->best_score = object->score;
    object->matched_samples = count_matched_sides(grouping);
    list_segments(grouping, object);
    grouping->is_listing = grouping->round = 0;
    grouping->cursor++;
}

static contour_grouping_pose pose_of(const cairn_contour_grouping_object *object)
{
    contour_grouping_pose pose = {.t = object->origin};

    cairn_sincos(object->turn, &pose.b, &pose.a);
    pose.a *= object->size;
    pose.b *= object->size;
    return pose;
}

cairn_status cairn_contour_grouping_refine_hypotheses(cairn_contour_grouping *grouping,
                                                      cairn_budget *budget)
{
    for (; grouping->cursor < grouping->hypothesis_count; grouping->cursor++) {
        contour_grouping_hypothesis *start = &grouping->hypotheses[grouping->cursor];
        cairn_status status;

        if (!grouping->is_fitting)
            grouping->pose = start->pose;
        status = cairn_contour_grouping_refine_pose(grouping, budget);
        if (status != CAIRN_OK)
            return status;
        start->pose = grouping->pose;
        start->score = grouping->evidence;
        insert_object(grouping, &grouping->pose, grouping->evidence, start->sample);
    }
    return CAIRN_OK;
}

/* Returns 1 when an earlier particle ended at the current pose; else records the pose as new. The
 * hypotheses' memory holds the recorded poses: the filter no longer needs it. */
static int is_known_end(cairn_contour_grouping *grouping)
{
    cairn_real size = contour_grouping_size(&grouping->pose),
               tolerance = END_TOLERANCE * END_TOLERANCE * size * size;

    for (int32_t i = 0; i < grouping->second_cursor; i++) {
        const contour_grouping_pose *end = &grouping->hypotheses[i].pose;
        cairn_real a = end->a - grouping->pose.a, b = end->b - grouping->pose.b;

        if (cairn_vec2_norm_squared(cairn_vec2_sub(end->t, grouping->pose.t)) + a * a + b * b <=
            tolerance)
            return 1;
    }
    grouping->hypotheses[grouping->second_cursor++].pose = grouping->pose;
    return 0;
}

cairn_status cairn_contour_grouping_refine_particles(cairn_contour_grouping *grouping,
                                                     cairn_budget *budget)
{
    int32_t count =
        grouping->hypothesis_count > 0 ? cairn_particle_filter_count(grouping->filter) : 0;

    for (; grouping->cursor < count; grouping->cursor++) {
        const contour_grouping_state *s =
            cairn_particle_filter_particle(grouping->filter, grouping->cursor).state;
        cairn_status status;

        if (!grouping->is_fitting) {
            if (!cairn_budget_charge(budget, &grouping->units_charged,
                                     1 + grouping->second_cursor / ENDS_PER_UNIT))
                return CAIRN_MORE;
            grouping->pose = s->pose;
            if (is_known_end(grouping))
                continue;
        }
        status = cairn_contour_grouping_refine_pose(grouping, budget);
        if (status != CAIRN_OK)
            return status;
        insert_object(grouping, &grouping->pose, grouping->evidence, s->start);
    }
    return CAIRN_OK;
}

cairn_status cairn_contour_grouping_select_objects(cairn_contour_grouping *grouping,
                                                   cairn_budget *budget)
{
    while (grouping->cursor < grouping->object_count) {
        cairn_status status;

        if (!grouping->is_fitting)
            grouping->pose = pose_of(&grouping->objects[grouping->cursor]);
        status = cairn_contour_grouping_match_outline(grouping, budget);
        if (status != CAIRN_OK)
            return status;
        if (!grouping->is_listing)
            verify_object(grouping);
        else if (grouping->round++ < DEFORM_ROUNDS)
            cairn_contour_grouping_deform_outline(grouping);
        else
            list_object(grouping);
    }
    return CAIRN_OK;
}
