/* Steps of the grouping of a search, between which its filter is observed.
 *
 * Method:
 * 1. The grouping is stepped for the units between two observations, whatever the budgets are.
 * 2. Observation, where the filter has done a step since the last one, or has its initial particles
 *    and there is a callback: they are copied, and put into clusters one by one. The number of these
 *    after a step goes into the result, the particles to the callback. */
#include "src/base/build.h"

#include "src/base/step.h"
#include "src/detection/contour_search_object.h"

/* Particles copied, and clusters that a particle is compared with, in a unit. */
enum { PARTICLES_PER_UNIT = 16, MODES_PER_UNIT = 16 };

void cairn_contour_search_begin_observed(cairn_contour_search *search,
                                         const contour_search_observer *observer)
{
    search->last_step = observer->initial && search->params.on_step != NULL ? -1 : 0;
    search->units_to_observation = observer->units_between;
    search->observation.resume = search->observation.units_charged = 0;
}

/* Steps the grouping. 1: an observation is due, or the grouping has ended. */
static int step_grouping(cairn_contour_search *search, cairn_budget *budget)
{
    search->status = CAIRN_MORE;
    while (search->status == CAIRN_MORE && search->units_to_observation > 0 && budget->left > 0) {
        int32_t units = search->units_to_observation < budget->left ? search->units_to_observation
                                                                    : budget->left;
        cairn_budget part = {units};

        search->status = cairn_contour_grouping_step(search->grouping, &part);
        cairn_budget_spend(budget, units - part.left);
        search->units_to_observation -= units - part.left;
    }
    return search->status != CAIRN_MORE || search->units_to_observation <= 0;
}

/* Starts an observation. 0: the filter has no particles, or has done no step since the last one. */
static int begin_observation(cairn_contour_search *search, int32_t max_steps)
{
    int32_t steps, count = cairn_contour_grouping_particles(search->grouping, NULL, 0, &steps),
                   most = search->params.grouping.particles;

    if (search->status < CAIRN_OK || count == 0 || steps == search->last_step || steps > max_steps)
        return 0;
    search->last_step = steps;
    search->observation.count = count < most ? count : most;
    return 1;
}

/* Puts a particle into its cluster. */
static void add_particle(cairn_contour_search *search, const contour_search_observer *observer)
{
    contour_search_observation *seen = &search->observation;

    seen->mode_count +=
        observer->mode_of(search, seen->particle, seen->mode_count) == seen->mode_count;
}

/* The number of clusters into the result, and the particles to the callback. */
static void end_observation(cairn_contour_search *search, const contour_search_observer *observer)
{
    const contour_search_observation *seen = &search->observation;
    cairn_contour_search_result *result = &search->result;
    int32_t k = search->is_mirrored;

    if (search->last_step > 0)
        result->mode_counts[k][result->steps[k] + search->last_step - 1] = seen->mode_count;
    if (search->params.on_step != NULL)
        search->params.on_step(search->params.context, search->particles, seen->count, k);
    if (observer->end != NULL)
        observer->end(search, seen->count);
}

int cairn_contour_search_step_observed(cairn_contour_search *search, cairn_budget *budget,
                                       const contour_search_observer *observer, int32_t max_steps)
{
    contour_search_observation *seen = &search->observation;

    CAIRN_STEP_BEGIN(seen->resume);
    do {
        CAIRN_STEP_UNTIL(seen->resume, step_grouping(search, budget));
        search->units_to_observation = observer->units_between;
        if (!begin_observation(search, max_steps))
            continue;
        CAIRN_STEP_CHARGE(seen, resume, budget, 1 + seen->count / PARTICLES_PER_UNIT);
        (void)cairn_contour_grouping_particles(search->grouping, search->particles, seen->count,
                                               NULL);
        seen->mode_count = 0;
        for (seen->particle = 0; seen->particle < seen->count; seen->particle++) {
            CAIRN_STEP_CHARGE(seen, resume, budget, 1 + seen->mode_count / MODES_PER_UNIT);
            add_particle(search, observer);
        }
        end_observation(search, observer);
    } while (search->status == CAIRN_MORE);
    CAIRN_STEP_UNTIL(seen->resume, search->status == CAIRN_OK);
    CAIRN_STEP_END(seen->resume);
}
