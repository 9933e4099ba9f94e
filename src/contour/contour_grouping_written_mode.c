/* The modes of the posterior: the best walk of each, over all steps so far, and the objects that
 * they are in the end.
 *
 * Two walks are of one mode when at least half of the segments of the shorter one are also of
 * the other. A walk is kept when no better one of its mode is there; of the worse ones of its
 * mode none stays. */
#include "src/core/build.h"

#include <string.h>

#include "src/contour/contour_grouping_written.h"

/* Segments of a walk lie in segments[] from here on. */
static int32_t first_of(const cairn_grouping *grouping, int32_t slot)
{
    return 2 * grouping->params.max_steps * slot;
}

static int32_t slot_of(const cairn_grouping *grouping, const cairn_grouped_object *o)
{
    return o->first / (2 * grouping->params.max_steps);
}

/* Whether a walk whose segments are marked, `count` of them, is of the mode of one that is kept. */
static int are_one(const cairn_grouping *grouping, const cairn_grouped_object *o, int32_t count)
{
    const struct grouping_written *w = grouping->written;
    int32_t shared = 0;

    for (int32_t i = 0; i < o->count; i++)
        shared += w->stamp[grouping->segments[o->first + i]] == w->look;
    return 2 * shared >= (count < o->count ? count : o->count);
}

static void take_out(cairn_grouping *grouping, int32_t at)
{
    grouping->object_count--;
    for (; at < grouping->object_count; at++)
        grouping->objects[at] = grouping->objects[at + 1];
}

static int32_t free_slot(const cairn_grouping *grouping)
{
    for (int32_t slot = 0;; slot++) {
        int32_t i = 0;

        while (i < grouping->object_count && slot_of(grouping, &grouping->objects[i]) != slot)
            i++;
        if (i == grouping->object_count)
            return slot;
    }
}

static void set_disc(const cairn_grouping *grouping, cairn_grouping_disc *d,
                     const grouping_written_state *s)
{
    d->centre = s->centre;
    d->radius = s->radius;
    d->deviation = s->deviation;
    d->sample = s->sample;
    d->log_posterior = s->log_posterior;
    for (int32_t k = 0; k < 2; k++) {
        d->segment[k] = s->segment[k];
        d->open[k] = grouping_written_end(grouping, s->end[k]);
    }
    if (s->way)
        d->sample = grouping->input.model->paths[0].count - 1 - s->sample;
}

/* Marks the segments of a walk; their number. */
static int32_t mark(cairn_grouping *grouping, const grouping_written_state *last)
{
    struct grouping_written *w = grouping->written;
    int32_t count = 0;

    w->look++;
    for (; last != NULL; last = cairn_particle_state_before(last))
        for (int32_t k = 0; k < 2; k++) {
            count += w->stamp[last->segment[k]] != w->look;
            w->stamp[last->segment[k]] = w->look;
        }
    return count;
}

/* Lists the segments of a walk from first on, each once: those of the left in order, then those
 * of the right backwards. */
static void list_segments(cairn_grouping *grouping, cairn_grouped_object *o,
                          const cairn_grouping_disc *walk)
{
    struct grouping_written *w = grouping->written;
    int32_t steps = o->seen;

    o->count = 0;
    w->look++;
    for (int32_t i = 0; i < 2 * steps; i++) {
        int32_t segment = i < steps ? walk[i].segment[0] : walk[2 * steps - 1 - i].segment[1];

        if (w->stamp[segment] != w->look)
            grouping->segments[o->first + o->count++] = segment;
        w->stamp[segment] = w->look;
    }
}

/* Writes a walk into its place. */
static void write_walk(cairn_grouping *grouping, cairn_grouped_object *o,
                       const grouping_written_state *last, int32_t steps)
{
    cairn_grouping_disc *walk =
        &grouping->written->walk[grouping->params.max_steps * slot_of(grouping, o)];

    o->seen = steps;
    for (int32_t i = steps - 1; i >= 0; i--) {
        set_disc(grouping, &walk[i], last);
        last = cairn_particle_state_before(last);
    }
    list_segments(grouping, o, walk);
}

void cairn_grouping_written_record(cairn_grouping *grouping, int32_t index)
{
    cairn_particle p = cairn_particle_filter_particle(grouping->filter, index);
    const grouping_written_state *s = p.state;
    cairn_grouped_object o = {.evidence = s->log_posterior};
    int32_t count, at;

    if (grouping->object_count == grouping->params.max_objects &&
        grouping->objects[grouping->object_count - 1].evidence >= o.evidence)
        return;
    count = mark(grouping, s);
    for (int32_t i = grouping->object_count - 1; i >= 0; i--)
        if (grouping->objects[i].evidence >= o.evidence &&
            are_one(grouping, &grouping->objects[i], count))
            return;
    for (int32_t i = grouping->object_count - 1; i >= 0; i--)
        if (are_one(grouping, &grouping->objects[i], count))
            take_out(grouping, i);
    if (grouping->object_count == grouping->params.max_objects)
        grouping->object_count--;
    o.first = first_of(grouping, free_slot(grouping));
    write_walk(grouping, &o, s, p.steps + 1);
    for (at = grouping->object_count++; at > 0 && grouping->objects[at - 1].evidence < o.evidence;
         at--)
        grouping->objects[at] = grouping->objects[at - 1];
    grouping->objects[at] = o;
}

/* ---- The end ---- */

/* Which segment is at each sample of the model's outline: that of the side of a step's sample,
 * at the nearest one. */
static void set_along(cairn_grouping *grouping, cairn_grouped_object *o,
                      const cairn_grouping_disc *walk, int32_t steps)
{
    const cairn_shape_model *m = grouping->input.model;
    int32_t back = walk[0].sample > walk[steps - 1].sample;

    for (int32_t i = 0; i < m->outline_count; i++)
        grouping->along[o->along + i] = -1;
    for (int32_t i = 0; i < steps; i++)
        for (int32_t k = 0; k < 2; k++) {
            cairn_vec2 at =
                m->samples[m->paths[0].first + walk[i].sample].side[back ? 1 - k : k].position;
            cairn_real least = CAIRN_REAL_MAX;
            int32_t nearest = 0;

            for (int32_t j = 0; j < m->outline_count; j++) {
                cairn_real off =
                    cairn_vec2_norm_squared(cairn_vec2_sub(m->outline[j].position, at));

                if (off < least) {
                    least = off;
                    nearest = j;
                }
            }
            grouping->along[o->along + nearest] = walk[i].segment[k];
        }
}

/* Where the model lies when its samples are, in the mean, where the walk has seen them. */
static void set_place(cairn_grouping *grouping, cairn_grouped_object *o, int32_t index)
{
    struct grouping_written *w = grouping->written;
    const cairn_shape_model *m = grouping->input.model;
    const cairn_grouping_disc *walk = &w->walk[grouping->params.max_steps * w->place[index]];
    int32_t steps = o->seen, least = m->paths[0].count, most = 0;

    for (int32_t i = 0; i < steps; i++) {
        cairn_vec2 c = m->samples[m->paths[0].first + walk[i].sample].centre;

        o->origin =
            cairn_vec2_add(o->origin, cairn_vec2_sub(walk[i].centre, cairn_vec2_scale(c, w->size)));
        least = walk[i].sample < least ? walk[i].sample : least;
        most = walk[i].sample > most ? walk[i].sample : most;
    }
    o->origin = cairn_vec2_scale(o->origin, 1 / (cairn_real)steps);
    o->size = w->size;
    o->start = m->paths[0].first + walk[0].sample;
    o->score = (cairn_real)(most - least + 1) / (cairn_real)m->paths[0].count;
    o->along = index * m->outline_count;
    set_along(grouping, o, walk, steps);
}

cairn_status cairn_grouping_written_finish(cairn_grouping *grouping, cairn_budget *budget)
{
    struct grouping_written *w = grouping->written;

    while (grouping->cursor == 0 && grouping->object_count > 0 &&
           grouping->objects[grouping->object_count - 1].evidence < 0)
        grouping->object_count--;
    for (; grouping->cursor < grouping->object_count; grouping->cursor++) {
        cairn_grouped_object *o = &grouping->objects[grouping->cursor];

        if (!cairn_budget_pay(budget, &grouping->charged_units,
                              1 + o->seen * grouping->input.model->outline_count / 16))
            return CAIRN_MORE;
        /* Lists are written anew, one after the other: what they lay in is no longer needed, but
         * the places of the walks are. */
        for (int32_t i = 0; i < grouping->object_count && grouping->cursor == 0; i++)
            w->place[i] = slot_of(grouping, &grouping->objects[i]);
        o->first = grouping->segment_count;
        list_segments(grouping, o,
                      &w->walk[grouping->params.max_steps * w->place[grouping->cursor]]);
        grouping->segment_count += o->count;
        set_place(grouping, o, grouping->cursor);
        if (grouping->cursor == 0) {
            grouping->best_score = o->score;
            grouping->best_evidence = o->evidence;
        }
    }
    return CAIRN_OK;
}

/* ---- Reading ---- */

cairn_grouping_particle cairn_grouping_written_particle(const cairn_grouping *grouping,
                                                        const cairn_particle *p)
{
    const grouping_written_state *s = p->state;
    const cairn_shape_model *m = grouping->input.model;
    const cairn_shape_path *path = &m->paths[0];
    cairn_grouping_particle particle = {.size = grouping->written->size,
                                        .centre = s->centre,
                                        .radius = s->radius,
                                        .log_weight = p->log_weight,
                                        .sides = 2};

    particle.sample = path->first + (s->way ? path->count - 1 - s->sample : s->sample);
    particle.origin = cairn_vec2_sub(
        s->centre, cairn_vec2_scale(m->samples[particle.sample].centre, grouping->written->size));
    return particle;
}

int32_t cairn_grouping_history(const cairn_grouping *grouping, int32_t particle,
                               cairn_grouping_disc *discs, int32_t most)
{
    const grouping_written_state *s;
    int32_t count;

    if (grouping == NULL || grouping->written == NULL || !grouping->has_particles || particle < 0 ||
        particle >= cairn_particle_filter_count(grouping->filter))
        return 0;
    count = cairn_particle_filter_particle(grouping->filter, particle).steps + 1;
    s = cairn_particle_filter_particle(grouping->filter, particle).state;
    for (int32_t i = count - 1; i >= 0 && discs != NULL; i--) {
        if (i < most)
            set_disc(grouping, &discs[i], s);
        s = cairn_particle_state_before(s);
    }
    return count;
}

int32_t cairn_grouping_skeleton(const cairn_grouping *grouping, int32_t object,
                                cairn_grouping_disc *discs, int32_t most)
{
    cairn_grouping_result r = cairn_grouping_read(grouping);
    int32_t count;

    if (grouping == NULL || grouping->written == NULL || object < 0 || object >= r.object_count)
        return 0;
    count = r.objects[object].seen;
    for (int32_t i = 0; i < count && i < most && discs != NULL; i++)
        discs[i] = grouping->written
                       ->walk[grouping->params.max_steps * grouping->written->place[object] + i];
    return count;
}
