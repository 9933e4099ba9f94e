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
static int32_t first_of(const cairn_grouping *g, int32_t slot)
{
    return 2 * g->params.max_steps * slot;
}

static int32_t slot_of(const cairn_grouping *g, const cairn_grouped_object *o)
{
    return o->first / (2 * g->params.max_steps);
}

/* Whether a walk whose segments are marked, `count` of them, is of the mode of one that is kept. */
static int are_one(const cairn_grouping *g, const cairn_grouped_object *o, int32_t count)
{
    const struct grouping_written *w = g->written;
    int32_t shared = 0;

    for (int32_t i = 0; i < o->count; i++)
        shared += w->stamp[g->segments[o->first + i]] == w->look;
    return 2 * shared >= (count < o->count ? count : o->count);
}

static void take_out(cairn_grouping *g, int32_t at)
{
    g->object_count--;
    for (; at < g->object_count; at++)
        g->objects[at] = g->objects[at + 1];
}

static int32_t free_slot(const cairn_grouping *g)
{
    for (int32_t slot = 0;; slot++) {
        int32_t i = 0;

        while (i < g->object_count && slot_of(g, &g->objects[i]) != slot)
            i++;
        if (i == g->object_count)
            return slot;
    }
}

static void set_disc(const cairn_grouping *g, cairn_grouping_disc *d,
                     const grouping_written_state *s)
{
    d->centre = s->centre;
    d->radius = s->radius;
    d->deviation = s->deviation;
    d->sample = s->sample;
    d->log_posterior = s->log_posterior;
    for (int32_t k = 0; k < 2; k++) {
        d->segment[k] = s->segment[k];
        d->open[k] = grouping_written_end(g, s->end[k]);
    }
    if (s->way)
        d->sample = g->input.model->paths[0].count - 1 - s->sample;
}

/* Marks the segments of a walk; their number. */
static int32_t mark(cairn_grouping *g, const grouping_written_state *last)
{
    struct grouping_written *w = g->written;
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
static void list_segments(cairn_grouping *g, cairn_grouped_object *o,
                          const cairn_grouping_disc *walk)
{
    struct grouping_written *w = g->written;
    int32_t steps = o->seen;

    o->count = 0;
    w->look++;
    for (int32_t i = 0; i < 2 * steps; i++) {
        int32_t segment = i < steps ? walk[i].segment[0] : walk[2 * steps - 1 - i].segment[1];

        if (w->stamp[segment] != w->look)
            g->segments[o->first + o->count++] = segment;
        w->stamp[segment] = w->look;
    }
}

/* Writes a walk into its place. */
static void write_walk(cairn_grouping *g, cairn_grouped_object *o,
                       const grouping_written_state *last, int32_t steps)
{
    cairn_grouping_disc *walk = &g->written->walk[g->params.max_steps * slot_of(g, o)];

    o->seen = steps;
    for (int32_t i = steps - 1; i >= 0; i--) {
        set_disc(g, &walk[i], last);
        last = cairn_particle_state_before(last);
    }
    list_segments(g, o, walk);
}

void cairn_grouping_written_keep(cairn_grouping *g, int32_t index)
{
    cairn_particle p = cairn_particle_filter_particle(g->filter, index);
    const grouping_written_state *s = p.state;
    cairn_grouped_object o = {.evidence = s->log_posterior};
    int32_t count, at;

    if (g->object_count == g->params.max_objects &&
        g->objects[g->object_count - 1].evidence >= o.evidence)
        return;
    count = mark(g, s);
    for (int32_t i = g->object_count - 1; i >= 0; i--)
        if (g->objects[i].evidence >= o.evidence && are_one(g, &g->objects[i], count))
            return;
    for (int32_t i = g->object_count - 1; i >= 0; i--)
        if (are_one(g, &g->objects[i], count))
            take_out(g, i);
    if (g->object_count == g->params.max_objects)
        g->object_count--;
    o.first = first_of(g, free_slot(g));
    write_walk(g, &o, s, p.steps + 1);
    for (at = g->object_count++; at > 0 && g->objects[at - 1].evidence < o.evidence; at--)
        g->objects[at] = g->objects[at - 1];
    g->objects[at] = o;
}

/* ---- The end ---- */

/* Which segment is at each sample of the model's outline: that of the side of a step's sample,
 * at the nearest one. */
static void set_along(cairn_grouping *g, cairn_grouped_object *o, const cairn_grouping_disc *walk,
                      int32_t steps)
{
    const cairn_shape_model *m = g->input.model;
    int32_t back = walk[0].sample > walk[steps - 1].sample;

    for (int32_t i = 0; i < m->outline_count; i++)
        g->along[o->along + i] = -1;
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
            g->along[o->along + nearest] = walk[i].segment[k];
        }
}

/* Where the model lies when its samples are, in the mean, where the walk has seen them. */
static void set_place(cairn_grouping *g, cairn_grouped_object *o, int32_t index)
{
    struct grouping_written *w = g->written;
    const cairn_shape_model *m = g->input.model;
    const cairn_grouping_disc *walk = &w->walk[g->params.max_steps * w->place[index]];
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
    set_along(g, o, walk, steps);
}

cairn_status cairn_grouping_written_finish(cairn_grouping *g, cairn_budget *budget)
{
    struct grouping_written *w = g->written;

    while (g->cursor == 0 && g->object_count > 0 && g->objects[g->object_count - 1].evidence < 0)
        g->object_count--;
    for (; g->cursor < g->object_count; g->cursor++) {
        cairn_grouped_object *o = &g->objects[g->cursor];

        if (!cairn_budget_pay(budget, &g->paid, 1 + o->seen * g->input.model->outline_count / 16))
            return CAIRN_MORE;
        /* Lists are written anew, one after the other: what they lay in is no longer needed, but
         * the places of the walks are. */
        for (int32_t i = 0; i < g->object_count && g->cursor == 0; i++)
            w->place[i] = slot_of(g, &g->objects[i]);
        o->first = g->segment_count;
        list_segments(g, o, &w->walk[g->params.max_steps * w->place[g->cursor]]);
        g->segment_count += o->count;
        set_place(g, o, g->cursor);
        if (g->cursor == 0) {
            g->best = o->score;
            g->best_evidence = o->evidence;
        }
    }
    return CAIRN_OK;
}

/* ---- Reading ---- */

cairn_grouping_particle cairn_grouping_written_particle(const cairn_grouping *g,
                                                        const cairn_particle *p)
{
    const grouping_written_state *s = p->state;
    const cairn_shape_model *m = g->input.model;
    const cairn_shape_path *path = &m->paths[0];
    cairn_grouping_particle particle = {.size = g->written->size,
                                        .centre = s->centre,
                                        .radius = s->radius,
                                        .log_weight = p->log_weight,
                                        .sides = 2};

    particle.sample = path->first + (s->way ? path->count - 1 - s->sample : s->sample);
    particle.origin = cairn_vec2_sub(
        s->centre, cairn_vec2_scale(m->samples[particle.sample].centre, g->written->size));
    return particle;
}

int32_t cairn_grouping_history(const cairn_grouping *g, int32_t particle,
                               cairn_grouping_disc *discs, int32_t most)
{
    const grouping_written_state *s;
    int32_t count;

    if (g == NULL || g->written == NULL || !g->has_walked || particle < 0 ||
        particle >= cairn_particle_filter_count(g->filter))
        return 0;
    count = cairn_particle_filter_particle(g->filter, particle).steps + 1;
    s = cairn_particle_filter_particle(g->filter, particle).state;
    for (int32_t i = count - 1; i >= 0 && discs != NULL; i--) {
        if (i < most)
            set_disc(g, &discs[i], s);
        s = cairn_particle_state_before(s);
    }
    return count;
}

int32_t cairn_grouping_skeleton(const cairn_grouping *g, int32_t object, cairn_grouping_disc *discs,
                                int32_t most)
{
    cairn_grouping_result r = cairn_grouping_read(g);
    int32_t count;

    if (g == NULL || g->written == NULL || object < 0 || object >= r.object_count)
        return 0;
    count = r.objects[object].seen;
    for (int32_t i = 0; i < count && i < most && discs != NULL; i++)
        discs[i] = g->written->walk[g->params.max_steps * g->written->place[object] + i];
    return count;
}
