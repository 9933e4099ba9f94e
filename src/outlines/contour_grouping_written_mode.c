/* Modes of the posterior: the best trajectory of each mode over all steps, and the resulting
 * objects. contour_grouping_written.c describes the method.
 *
 * Two trajectories belong to one mode when at least half of the segments of the shorter one also
 * belong to the other. A trajectory is recorded unless a better one of its mode is recorded; worse
 * ones of its mode are removed (non-maximum suppression). */
#include "src/base/build.h"

#include "src/containers/ranked_list.h"
#include "src/outlines/contour_grouping_written.h"

/* Outline samples compared per work unit. */
enum { SAMPLES_PER_UNIT = 16 };

/* First index in segments[] of a slot's trajectory. */
static int32_t first_of(const cairn_contour_grouping *grouping, int32_t slot)
{
    return 2 * grouping->params.max_steps * slot;
}

static int32_t slot_of(const cairn_contour_grouping *grouping,
                       const cairn_contour_grouping_object *object)
{
    return object->first / (2 * grouping->params.max_steps);
}

/* A trajectory whose `count` segments are stamped. */
typedef struct stamped_trajectory {
    const cairn_contour_grouping *grouping;
    int32_t count;
} stamped_trajectory;

/* Returns 1 when the stamped trajectory belongs to the mode of a recorded one. */
static int is_same_mode(const void *context, const void *entry, const void *other)
{
    const stamped_trajectory *trajectory = context;
    const cairn_contour_grouping_object *object = other;
    const cairn_contour_grouping *grouping = trajectory->grouping;
    const struct contour_grouping_written *written = grouping->written;
    int32_t shared = 0;

    (void)entry;
    for (int32_t i = 0; i < object->count; i++)
        shared += written->segment_stamp[grouping->segments[object->first + i]] == written->stamp;
    return 2 * shared >= (trajectory->count < object->count ? trajectory->count : object->count);
}

static int32_t free_slot(const cairn_contour_grouping *grouping)
{
    for (int32_t slot = 0;; slot++) {
        int32_t i = 0;

        while (i < grouping->found.object_count && slot_of(grouping, &grouping->objects[i]) != slot)
            i++;
        if (i == grouping->found.object_count)
            return slot;
    }
}

cairn_contour_grouping_disc
cairn_contour_grouping_written_disc(const cairn_contour_grouping *grouping,
                                    const contour_grouping_written_state *state)
{
    cairn_contour_grouping_disc disc = {.centre = state->centre,
                                        .radius = state->radius,
                                        .deviation = state->deviation,
                                        .sample = state->sample,
                                        .log_posterior = state->log_posterior};

    for (int32_t k = 0; k < 2; k++) {
        disc.segment[k] = state->segment[k];
        disc.open_end[k] = contour_grouping_written_end(grouping, state->end[k]);
    }
    if (state->is_reversed)
        disc.sample = grouping->input.model->paths[0].count - 1 - state->sample;
    return disc;
}

/* Stamps the segments of a trajectory; returns their number. */
static int32_t stamp_segments(cairn_contour_grouping *grouping,
                              const contour_grouping_written_state *last)
{
    struct contour_grouping_written *written = grouping->written;
    int32_t count = 0;

    written->stamp++;
    for (; last != NULL; last = cairn_particle_filter_state_before(last))
        for (int32_t k = 0; k < 2; k++) {
            count += written->segment_stamp[last->segment[k]] != written->stamp;
            written->segment_stamp[last->segment[k]] = written->stamp;
        }
    return count;
}

/* Lists the segments of a trajectory, each once: the left side in order, then the right side
 * backwards. */
static void list_segments(cairn_contour_grouping *grouping, cairn_contour_grouping_object *object,
                          const cairn_contour_grouping_disc *trajectory)
{
    struct contour_grouping_written *written = grouping->written;
    int32_t steps = object->matched_samples;

    object->count = 0;
    written->stamp++;
    for (int32_t i = 0; i < 2 * steps; i++) {
        int32_t segment =
            i < steps ? trajectory[i].segment[0] : trajectory[2 * steps - 1 - i].segment[1];

        if (written->segment_stamp[segment] != written->stamp)
            grouping->segments[object->first + object->count++] = segment;
        written->segment_stamp[segment] = written->stamp;
    }
}

/* Writes a trajectory into its slot. */
static void write_trajectory(cairn_contour_grouping *grouping,
                             cairn_contour_grouping_object *object,
                             const contour_grouping_written_state *last, int32_t steps)
{
    cairn_contour_grouping_disc *trajectory =
        &grouping->written->trajectories[grouping->params.max_steps * slot_of(grouping, object)];

    object->matched_samples = steps;
    for (int32_t i = steps - 1; i >= 0; i--) {
        trajectory[i] = cairn_contour_grouping_written_disc(grouping, last);
        last = cairn_particle_filter_state_before(last);
    }
    list_segments(grouping, object, trajectory);
}

void cairn_contour_grouping_written_record(cairn_contour_grouping *grouping, int32_t index)
{
    cairn_particle p = cairn_particle_filter_particle(grouping->filter, index);
    const contour_grouping_written_state *state = p.state;
    cairn_contour_grouping_object object = {.evidence = state->log_posterior};
    stamped_trajectory trajectory = {grouping, 0};
    ranked_list objects = {.entries = grouping->objects,
                           .count = &grouping->found.object_count,
                           .capacity = grouping->params.max_objects,
                           .entry_bytes = sizeof object,
                           .score_at = offsetof(cairn_contour_grouping_object, evidence),
                           .is_near = is_same_mode,
                           .context = &trajectory};

    if (grouping->found.object_count == grouping->params.max_objects &&
        grouping->objects[grouping->found.object_count - 1].evidence >= object.evidence)
        return;
    trajectory.count = stamp_segments(grouping, state);
    if (!ranked_list_suppress(&objects, &object))
        return;
    if (grouping->found.object_count == grouping->params.max_objects)
        grouping->found.object_count--;
    object.first = first_of(grouping, free_slot(grouping));
    write_trajectory(grouping, &object, state, p.steps + 1);
    (void)ranked_list_add(&objects, &object);
}

/* ---- Result ---- */

/* Assigns segments to the model's outline samples: the segment of each disc's side to the outline
 * sample nearest to that side. */
static void set_outline_segments(cairn_contour_grouping *grouping,
                                 cairn_contour_grouping_object *object,
                                 const cairn_contour_grouping_disc *trajectory, int32_t steps)
{
    const cairn_shape_model *model = grouping->input.model;
    int32_t is_backwards = trajectory[0].sample > trajectory[steps - 1].sample;

    for (int32_t i = 0; i < model->outline_count; i++)
        grouping->along[object->first_outline + i] = -1;
    for (int32_t i = 0; i < steps; i++)
        for (int32_t k = 0; k < 2; k++) {
            cairn_vec2 position = model->samples[model->paths[0].first + trajectory[i].sample]
                                      .contact[is_backwards ? 1 - k : k]
                                      .position;
            cairn_real smallest = CAIRN_REAL_MAX;
            int32_t nearest = 0;

            for (int32_t j = 0; j < model->outline_count; j++) {
                cairn_real squared =
                    cairn_vec2_norm_squared(cairn_vec2_sub(model->outline[j].position, position));

                if (squared < smallest) {
                    smallest = squared;
                    nearest = j;
                }
            }
            grouping->along[object->first_outline + nearest] = trajectory[i].segment[k];
        }
}

/* Pose of the model: the mean translation that maps its samples to the trajectory's discs. */
static void set_pose(cairn_contour_grouping *grouping, cairn_contour_grouping_object *object,
                     int32_t index)
{
    struct contour_grouping_written *written = grouping->written;
    const cairn_shape_model *model = grouping->input.model;
    const cairn_contour_grouping_disc *trajectory =
        &written->trajectories[grouping->params.max_steps * written->trajectory_slot[index]];
    int32_t steps = object->matched_samples, first_sample = model->paths[0].count, last_sample = 0;

    for (int32_t i = 0; i < steps; i++) {
        cairn_vec2 c = model->samples[model->paths[0].first + trajectory[i].sample].centre;

        object->origin =
            cairn_vec2_add(object->origin, cairn_vec2_sub(trajectory[i].centre,
                                                          cairn_vec2_scale(c, written->size)));
        first_sample = trajectory[i].sample < first_sample ? trajectory[i].sample : first_sample;
        last_sample = trajectory[i].sample > last_sample ? trajectory[i].sample : last_sample;
    }
    object->origin = cairn_vec2_scale(object->origin, 1 / (cairn_real)steps);
    object->size = written->size;
    object->start_sample = model->paths[0].first + trajectory[0].sample;
    object->score =
        (cairn_real)(last_sample - first_sample + 1) / (cairn_real)model->paths[0].count;
    object->first_outline = index * model->outline_count;
    set_outline_segments(grouping, object, trajectory, steps);
}

/* Cost of an object in units. */
static int32_t object_cost(const cairn_contour_grouping *grouping, int32_t index)
{
    return 1 + grouping->objects[index].matched_samples * grouping->input.model->outline_count /
                   SAMPLES_PER_UNIT;
}

/* Drops the modes of a negative posterior. Keeps the slots of the others: their segment lists are
 * rewritten contiguously, which overwrites the slots' lists; the trajectories remain valid. */
static void choose_modes(cairn_contour_grouping *grouping)
{
    while (grouping->found.object_count > 0 &&
           grouping->objects[grouping->found.object_count - 1].evidence < 0)
        grouping->found.object_count--;
    for (int32_t i = 0; i < grouping->found.object_count; i++)
        grouping->written->trajectory_slot[i] = slot_of(grouping, &grouping->objects[i]);
}

/* Makes an object of a mode. */
static void finish_object(cairn_contour_grouping *grouping, int32_t index)
{
    struct contour_grouping_written *written = grouping->written;
    cairn_contour_grouping_object *object = &grouping->objects[index];

    object->first = grouping->found.segment_count;
    list_segments(
        grouping, object,
        &written->trajectories[grouping->params.max_steps * written->trajectory_slot[index]]);
    grouping->found.segment_count += object->count;
    set_pose(grouping, object, index);
    if (index == 0) {
        grouping->found.best_score = object->score;
        grouping->found.best_evidence = object->evidence;
    }
}

int cairn_contour_grouping_written_finish(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    struct contour_grouping_written *written = grouping->written;

    CAIRN_STEP_BEGIN(grouping->phase_resume);
    CAIRN_STEP_CHARGE(grouping, phase_resume, budget, grouping->found.object_count);
    choose_modes(grouping);
    for (written->cursor = 0; written->cursor < grouping->found.object_count; written->cursor++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, object_cost(grouping, written->cursor));
        finish_object(grouping, written->cursor);
    }
    CAIRN_STEP_END(grouping->phase_resume);
}

/* ---- Reading ---- */

cairn_contour_grouping_particle
cairn_contour_grouping_written_particle(const cairn_contour_grouping *grouping,
                                        const cairn_particle *p)
{
    const contour_grouping_written_state *s = p->state;
    const cairn_shape_model *model = grouping->input.model;
    const cairn_shape_model_path *path = &model->paths[0];
    cairn_contour_grouping_particle particle = {.size = grouping->written->size,
                                                .centre = s->centre,
                                                .radius = s->radius,
                                                .log_weight = p->log_weight,
                                                .matched_sides = 2};

    particle.sample = path->first + (s->is_reversed ? path->count - 1 - s->sample : s->sample);
    particle.origin =
        cairn_vec2_sub(s->centre, cairn_vec2_scale(model->samples[particle.sample].centre,
                                                   grouping->written->size));
    return particle;
}
