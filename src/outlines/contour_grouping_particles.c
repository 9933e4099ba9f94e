/* Read access to the particles of the running filter, and to the trajectories as written. */
#include "src/base/build.h"

#include "src/outlines/contour_grouping_written.h"

int32_t cairn_contour_grouping_particles(const cairn_contour_grouping *grouping,
                                         cairn_contour_grouping_particle *particles, int32_t most,
                                         int32_t *steps)
{
    int32_t count = grouping != NULL && grouping->has_particles
                        ? cairn_particle_filter_count(grouping->filter)
                        : 0;

    if (steps != NULL)
        *steps = count > 0 ? grouping->found.step_count : 0;
    for (int32_t i = 0; i < count && i < most && particles != NULL; i++) {
        cairn_particle p = cairn_particle_filter_particle(grouping->filter, i);
        const contour_grouping_state *s = p.state;

        if (grouping->written != NULL) {
            particles[i] = cairn_contour_grouping_written_particle(grouping, &p);
            continue;
        }
        particles[i].origin = s->pose.shift;
        particles[i].size = cairn_similarity_scale(s->pose);
        particles[i].turn = cairn_similarity_rotation(s->pose);
        particles[i].centre = s->centre;
        particles[i].radius = s->radius;
        particles[i].log_weight = p.log_weight;
        particles[i].sample = s->sample;
        particles[i].matched_sides = (s->token[0] >= 0) + (s->token[1] >= 0);
    }
    return count;
}

int32_t cairn_contour_grouping_history(const cairn_contour_grouping *grouping, int32_t particle,
                                       cairn_contour_grouping_disc *discs, int32_t most)
{
    const contour_grouping_written_state *state;
    int32_t count;

    if (grouping == NULL || grouping->written == NULL || !grouping->has_particles || particle < 0 ||
        particle >= cairn_particle_filter_count(grouping->filter))
        return 0;
    count = cairn_particle_filter_particle(grouping->filter, particle).steps + 1;
    state = cairn_particle_filter_particle(grouping->filter, particle).state;
    for (int32_t i = count - 1; i >= 0 && discs != NULL; i--) {
        if (i < most)
            discs[i] = cairn_contour_grouping_written_disc(grouping, state);
        state = cairn_particle_filter_state_before(state);
    }
    return count;
}

int32_t cairn_contour_grouping_skeleton(const cairn_contour_grouping *grouping, int32_t object,
                                        cairn_contour_grouping_disc *discs, int32_t most)
{
    int32_t count;

    if (grouping == NULL || grouping->written == NULL || !grouping->is_complete || object < 0 ||
        object >= grouping->found.object_count)
        return 0;
    count = grouping->objects[object].matched_samples;
    for (int32_t i = 0; i < count && i < most && discs != NULL; i++)
        discs[i] = grouping->written->trajectories[grouping->params.max_steps *
                                                       grouping->written->trajectory_slot[object] +
                                                   i];
    return count;
}
