/* The search in the mode as written: one run of contour_grouping at one size. The segments of its
 * trajectories are the contours, and their symmetric points the skeletons. No outline is fitted or
 * deformed. */
#include "src/base/build.h"

#include <string.h>

#include "src/detection/contour_search_object.h"

/* Work units between observations. A filter step costs more than 50 units, also that of a single
 * particle, so that two steps never fall between two observations. */
enum { UNITS_BETWEEN_OBSERVATIONS = 25 };

/* Trajectories that are reported after a step, but for the best one. */
enum { MAX_OTHER_WALKS = 15 };

cairn_contour_search_params cairn_contour_search_as_written(int32_t width, int32_t height)
{
    cairn_contour_search_params params = cairn_contour_search_default(width, height);

    params.grouping = cairn_contour_grouping_as_written();
    params.min_evidence = params.min_score = 0;
    params.min_turn = params.max_turn = 0;
    params.mirror = 0;
    return params;
}

const char *cairn_contour_search_end_text(int32_t end)
{
    static const char *const text[] = {"no start", "posterior", "no follower", "steps",
                                       "histories"};

    return end >= 0 && end < (int32_t)(sizeof text / sizeof *text) ? text[end] : "";
}

/* The cluster of a particle, by the symmetric point that its trajectory started at. */
static int32_t mode_of(cairn_contour_search *search, int32_t particle, int32_t mode_count)
{
    cairn_contour_grouping_disc first;
    int32_t k = 0;

    (void)cairn_contour_grouping_history(search->grouping, particle, &first, 1);
    while (k < mode_count &&
           (search->starts[k].x != first.centre.x || search->starts[k].y != first.centre.y))
        k++;
    if (k == mode_count)
        search->starts[k] = first.centre;
    return k;
}

/* The trajectory of a particle to the callback. */
static void report_walk(cairn_contour_search *search, int32_t particle, int32_t rank)
{
    int32_t length = cairn_contour_grouping_history(search->grouping, particle, search->walk,
                                                    search->params.grouping.max_steps);

    search->params.on_walk(search->params.context, search->walk, length, rank);
}

/* The trajectories of the best particle and of others to the callback. */
static void report_walks(cairn_contour_search *search, int32_t count)
{
    int32_t best = 0, stride = (count + MAX_OTHER_WALKS - 1) / MAX_OTHER_WALKS, rank = 1;

    if (search->params.on_walk == NULL)
        return;
    for (int32_t i = 1; i < count; i++)
        best = search->particles[i].log_weight > search->particles[best].log_weight ? i : best;
    report_walk(search, best, 0);
    for (int32_t i = 0; i < count; i += stride)
        if (i != best)
            report_walk(search, i, rank++);
}

static const contour_search_observer observer_as_written = {.units_between =
                                                                UNITS_BETWEEN_OBSERVATIONS,
                                                            .initial = 1,
                                                            .mode_of = mode_of,
                                                            .end = report_walks};

cairn_status cairn_contour_search_written_begin(cairn_contour_search *search)
{
    const cairn_contour_search_tokens *tokens = &search->tokens;
    cairn_contour_grouping_input input = {.segments = tokens->lines,
                                          .count = tokens->count,
                                          .width = tokens->width,
                                          .height = tokens->height,
                                          .model = search->model,
                                          .min_size = search->params.min_size,
                                          .max_size = search->params.max_size,
                                          .mean_length = cairn_max(tokens->mean_length, 1),
                                          .look_ahead = cairn_max(tokens->look_ahead, 1),
                                          .ends = tokens->ends,
                                          .end_count = tokens->end_count};

    cairn_contour_search_begin_observed(search, &observer_as_written);
    return cairn_contour_grouping_begin(search->grouping, &input);
}

/* Appends an object's segments and discs. */
static void append_object(cairn_contour_search *search, const cairn_contour_grouping_result *found,
                          int32_t index)
{
    cairn_contour_search_result *result = &search->result;
    cairn_contour_search_object *object = &result->objects[result->object_count++];

    memset(object, 0, sizeof *object);
    object->found = found->objects[index];
    object->found.first = result->segment_count;
    object->found.first_outline = 0;
    object->first_disc = result->disc_count;
    object->disc_count = cairn_contour_grouping_skeleton(search->grouping, index, search->walk,
                                                         search->params.grouping.max_steps);
    for (int32_t i = 0; i < object->found.count; i++)
        result->segments[result->segment_count++] =
            found->segments[found->objects[index].first + i];
    for (int32_t i = 0; i < object->disc_count; i++) {
        const cairn_contour_grouping_disc *step = &search->walk[i];
        cairn_contour_search_disc disc = {.centre = step->centre,
                                          .radius = step->radius,
                                          .side = {step->segment[0], step->segment[1]},
                                          .sample = step->sample};

        result->discs[result->disc_count++] = disc;
    }
}

static void copy_result(cairn_contour_search *search)
{
    cairn_contour_grouping_result found = cairn_contour_grouping_read(search->grouping);
    cairn_contour_search_result *result = &search->result;

    if (found.steps > 0)
        memcpy(result->trace[0], found.trace, (size_t)found.steps * sizeof *found.trace);
    result->steps[0] = found.steps;
    result->hypothesis_counts[0] = found.hypothesis_count;
    result->best_score = found.best_score;
    result->best_evidence = found.best_evidence;
    result->point_count = found.point_count;
    result->points_dropped = found.points_dropped;
    result->candidates_dropped = found.candidates_dropped;
    result->end_reason = found.end_reason;
    for (int32_t i = 0; i < found.object_count; i++)
        append_object(search, &found, i);
}

int cairn_contour_search_written_step(cairn_contour_search *search, cairn_budget *budget)
{
    if (!cairn_contour_search_step_observed(search, budget, &observer_as_written,
                                            search->params.grouping.max_steps))
        return 0;
    copy_result(search);
    return 1;
}
