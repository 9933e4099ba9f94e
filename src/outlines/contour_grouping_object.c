/* Object selection by non-maximum suppression.
 *
 * Method:
 * 1. The outline is matched to the tokens at every hypothesis and at the final pose of every
 *    particle.
 * 2. The poses of greatest evidence that are far enough apart are the objects.
 * 3. Each object lists the segments along its outline. A token belongs to one object only: tokens
 *    of a better object are no evidence for the next. */
#include "src/base/build.h"

#include <stddef.h>
#include <string.h>

#include "src/containers/ranked_list.h"
#include "src/outlines/contour_grouping_work.h"

/* Non-maximum suppression radius, share of the object's size. */
#define NMS_RADIUS CAIRN_REAL(0.3)
/* Cost (half squared sigmas) at which a sample counts 1/e in the score. */
#define SCORE_COST 3

/* Final poses within this distance, share of the size, are duplicates. */
#define END_TOLERANCE CAIRN_REAL(0.002)
/* For a unit: final poses, and outline samples, that are compared; samples with a score; listed
 * segments that are looked at. */
enum { ENDS_PER_UNIT = 16, COMPARED_PER_UNIT = 16, SCORED_PER_UNIT = 4, LISTED_PER_UNIT = 64 };

/* Deformation rounds before an object's segments are listed. */
enum { DEFORM_ROUNDS = 8 };

/* Returns 1 when a pose is within the size range, with a tolerance of a tenth. */
static int is_size_allowed(const cairn_contour_grouping *grouping, const cairn_similarity *pose)
{
    cairn_real size = cairn_similarity_scale(*pose);

    return size >= CAIRN_REAL(0.9) * grouping->input.min_size &&
           size <= CAIRN_REAL(1.1) * grouping->input.max_size;
}

static int are_duplicates(const void *context, const void *entry, const void *other)
{
    const cairn_contour_grouping_object *a = entry, *b = other;
    cairn_real radius = NMS_RADIUS * cairn_max(a->size, b->size);

    (void)context;
    return cairn_vec2_norm_squared(cairn_vec2_sub(a->origin, b->origin)) <= radius * radius;
}

/* The objects, sorted by evidence. */
static ranked_list objects_of(cairn_contour_grouping *grouping)
{
    ranked_list objects = {.entries = grouping->objects,
                           .count = &grouping->found.object_count,
                           .capacity = grouping->params.max_objects,
                           .entry_bytes = sizeof *grouping->objects,
                           .score_at = offsetof(cairn_contour_grouping_object, evidence),
                           .is_near = are_duplicates};

    return objects;
}

/* Inserts a pose into the objects with non-maximum suppression. */
static void insert_object(cairn_contour_grouping *grouping, const cairn_similarity *pose,
                          cairn_real evidence, int32_t start)
{
    cairn_contour_grouping_object object = {.evidence = evidence,
                                            .origin = pose->shift,
                                            .size = cairn_similarity_scale(*pose),
                                            .start_sample = start};
    ranked_list objects = objects_of(grouping);

    if (!(evidence > 0) || !is_size_allowed(grouping, pose))
        return;
    object.turn = cairn_similarity_rotation(*pose);
    (void)ranked_list_insert(&objects, &object);
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

/* Claims the matched tokens for an object, and begins the list of its segments. */
static void claim_tokens(cairn_contour_grouping *grouping, cairn_contour_grouping_object *object)
{
    object->first = grouping->found.segment_count;
    object->count = 0;
    for (int32_t i = 0; i < grouping->input.model->outline_count; i++)
        if (grouping->outline.match[i] >= 0)
            grouping->tokens[grouping->outline.match[i]].is_used = 1;
}

/* Lists the matched segment of the current outline sample, each once, in the order of the
 * outline. */
static void list_segment(cairn_contour_grouping *grouping)
{
    cairn_contour_grouping_object *object = &grouping->objects[grouping->candidate];
    int32_t *list = &grouping->segments[object->first],
            match = grouping->outline.match[grouping->sample], known = 0, segment;

    grouping->along[object->first_outline + grouping->sample] = -1;
    if (match < 0 || !is_segment_used(grouping, match))
        return;
    segment = grouping->tokens[match].segment;
    grouping->along[object->first_outline + grouping->sample] = segment;
    for (int32_t k = 0; k < object->count && !known; k++)
        known = list[k] == segment;
    if (!known)
        list[object->count++] = segment;
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

/* Counts the current path sample when at least one of its sides is matched. */
static void count_matched_sides(cairn_contour_grouping *grouping)
{
    const cairn_shape_model *model = grouping->input.model;
    const cairn_shape_model_sample *sample = &model->samples[grouping->sample];

    grouping->objects[grouping->candidate].matched_samples +=
        grouping->outline.match[nearest_sample(model, sample->contact[0].position)] >= 0 ||
        grouping->outline.match[nearest_sample(model, sample->contact[1].position)] >= 0;
}

/* Score of the match: mean over the outline of exp(-cost / SCORE_COST), 0 where occluded. */
static cairn_real score_of(const cairn_contour_grouping *grouping)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < grouping->input.model->outline_count; i++)
        sum += grouping->outline.match[i] >= 0 ? cairn_exp(-grouping->outline.cost[i] / SCORE_COST)
                                               : 0;
    return sum / (cairn_real)grouping->input.model->outline_count;
}

/* Verifies an object with the tokens left by better ones; 0: it is below the thresholds and is
 * removed. */
static int verify_object(cairn_contour_grouping *grouping, int32_t index)
{
    cairn_contour_grouping_object *object = &grouping->objects[index];
    ranked_list objects = objects_of(grouping);

    object->evidence = grouping->outline.evidence;
    object->score = score_of(grouping);
    if (index == 0 && !(grouping->found.best_evidence > 0)) {
        grouping->found.best_score = object->score;
        grouping->found.best_evidence = object->evidence;
    }
    if (object->evidence >= grouping->params.min_evidence &&
        object->score >= grouping->params.min_score)
        return 1;
    ranked_list_remove(&objects, index);
    return 0;
}

/* Begins the listing of the tokens of an object. */
static void begin_listing(cairn_contour_grouping *grouping)
{
    grouping->outline.is_listing = 1;
    memset(grouping->outline.shift, 0,
           (size_t)grouping->input.model->outline_count * sizeof *grouping->outline.shift);
}

/* Begins the description of the current object by the last match. */
static void describe_object(cairn_contour_grouping *grouping)
{
    cairn_contour_grouping_object *object = &grouping->objects[grouping->candidate];

    object->first_outline = grouping->candidate * grouping->input.model->outline_count;
    object->score = score_of(grouping);
    if (grouping->candidate == 0 && object->evidence >= grouping->found.best_evidence)
        grouping->found.best_score = object->score;
    object->matched_samples = 0;
    claim_tokens(grouping, object);
}

static void end_object(cairn_contour_grouping *grouping)
{
    grouping->found.segment_count += grouping->objects[grouping->candidate].count;
    grouping->outline.is_listing = 0;
    grouping->candidate++;
}

/* Units of the score. */
static int32_t score_units(const cairn_contour_grouping *grouping)
{
    return 1 + grouping->input.model->outline_count / SCORED_PER_UNIT;
}

/* Units of the outline samples nearest to both contacts of a path sample. */
static int32_t side_units(const cairn_contour_grouping *grouping)
{
    return 1 + 2 * grouping->input.model->outline_count / COMPARED_PER_UNIT;
}

/* Units of the segment of the current outline sample, and of its tokens. */
static int32_t segment_units(const cairn_contour_grouping *grouping)
{
    return 2 + grouping->objects[grouping->candidate].count / LISTED_PER_UNIT;
}

static cairn_similarity pose_of(const cairn_contour_grouping_object *object)
{
    return cairn_similarity_of(object->origin, object->size, object->turn);
}

/* Keeps the refined pose and the evidence of a hypothesis. */
static void keep_refined(cairn_contour_grouping *grouping, contour_grouping_hypothesis *hypothesis)
{
    hypothesis->pose = grouping->outline.pose;
    hypothesis->score = grouping->outline.evidence;
    insert_object(grouping, &grouping->outline.pose, grouping->outline.evidence,
                  hypothesis->sample);
}

int cairn_contour_grouping_refine_hypotheses(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(grouping->phase_resume);
    for (grouping->candidate = 0; grouping->candidate < grouping->found.hypothesis_count;
         grouping->candidate++) {
        grouping->outline.pose = grouping->hypotheses[grouping->candidate].pose;
        CAIRN_STEP_RUN(grouping, phase_resume, budget, cairn_contour_grouping_refine_pose);
        keep_refined(grouping, &grouping->hypotheses[grouping->candidate]);
    }
    CAIRN_STEP_END(grouping->phase_resume);
}

/* Returns 1 when an earlier particle ended at the current pose; else records the pose as new. The
 * hypotheses' memory holds the recorded poses: the filter no longer needs it. */
static int is_known_end(cairn_contour_grouping *grouping)
{
    cairn_real size = cairn_similarity_scale(grouping->outline.pose),
               tolerance = END_TOLERANCE * END_TOLERANCE * size * size;

    for (int32_t i = 0; i < grouping->end_count; i++) {
        const cairn_similarity *end = &grouping->hypotheses[i].pose;
        cairn_real a = end->a - grouping->outline.pose.a, b = end->b - grouping->outline.pose.b;

        if (cairn_vec2_norm_squared(cairn_vec2_sub(end->shift, grouping->outline.pose.shift)) +
                a * a + b * b <=
            tolerance)
            return 1;
    }
    grouping->hypotheses[grouping->end_count++].pose = grouping->outline.pose;
    return 0;
}

/* Number of particles with a final pose. */
static int32_t particle_count(const cairn_contour_grouping *grouping)
{
    return grouping->has_particles ? cairn_particle_filter_count(grouping->filter) : 0;
}

static const contour_grouping_state *state_of(const cairn_contour_grouping *grouping,
                                              int32_t particle)
{
    return cairn_particle_filter_particle(grouping->filter, particle).state;
}

int cairn_contour_grouping_refine_particles(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(grouping->phase_resume);
    grouping->end_count = 0;
    for (grouping->candidate = 0; grouping->candidate < particle_count(grouping);
         grouping->candidate++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, 1 + grouping->end_count / ENDS_PER_UNIT);
        grouping->outline.pose = state_of(grouping, grouping->candidate)->pose;
        if (is_known_end(grouping))
            continue;
        CAIRN_STEP_RUN(grouping, phase_resume, budget, cairn_contour_grouping_refine_pose);
        insert_object(grouping, &grouping->outline.pose, grouping->outline.evidence,
                      state_of(grouping, grouping->candidate)->start);
    }
    CAIRN_STEP_END(grouping->phase_resume);
}

int cairn_contour_grouping_select_objects(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(grouping->phase_resume);
    grouping->candidate = 0;
    while (grouping->candidate < grouping->found.object_count) {
        grouping->outline.pose = pose_of(&grouping->objects[grouping->candidate]);
        CAIRN_STEP_RUN(grouping, phase_resume, budget, cairn_contour_grouping_match_outline);
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, score_units(grouping));
        if (!verify_object(grouping, grouping->candidate))
            continue;
        begin_listing(grouping);
        for (grouping->outline.round = 0; grouping->outline.round < DEFORM_ROUNDS;
             grouping->outline.round++) {
            CAIRN_STEP_RUN(grouping, phase_resume, budget, cairn_contour_grouping_match_outline);
            CAIRN_STEP_RUN(grouping, phase_resume, budget, cairn_contour_grouping_deform_outline);
        }
        CAIRN_STEP_RUN(grouping, phase_resume, budget, cairn_contour_grouping_match_outline);
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, score_units(grouping));
        describe_object(grouping);
        for (grouping->sample = 0; grouping->sample < grouping->input.model->sample_count;
             grouping->sample++) {
            CAIRN_STEP_CHARGE(grouping, phase_resume, budget, side_units(grouping));
            count_matched_sides(grouping);
        }
        for (grouping->sample = 0; grouping->sample < grouping->input.model->outline_count;
             grouping->sample++) {
            CAIRN_STEP_CHARGE(grouping, phase_resume, budget, segment_units(grouping));
            list_segment(grouping);
        }
        end_object(grouping);
    }
    CAIRN_STEP_END(grouping->phase_resume);
}
