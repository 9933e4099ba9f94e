/* Joint grouping of contours and skeletons without a shape model: interface, and the order of the
 * phases.
 *
 * Method:
 * 1. Edgels are sorted into grid cells (skeleton_grouping_index.c).
 * 2. Each edgel searches along its normal, to both sides, for the edgel that faces it best: their
 *    centre point, CP (skeleton_grouping_centre.c).
 * 3. Expectation-maximization fits lines to the CPs in (x, y, radius). Lines of mirror-symmetric
 *    CPs are seeds (skeleton_grouping_seed.c).
 * 4. From each seed a particle filter follows the axis to both ends (skeleton_grouping_walk.c).
 * 5. Trajectories compete for edgels by log odds; the selected parts that continue into each other
 *    form objects (skeleton_grouping_part.c).
 *
 * As written: CPs of all pairs (skeleton_grouping_written.c), and a filter for each line
 * (skeleton_grouping_written_walk.c).
 *
 * Memory layout: edgels sorted by cell, CPs, seeds, the filter with the histories of its particles,
 * the discs of all trajectories.
 *
 * Limits: an axis is found from its two sides, so round blobs, which have no axis direction, are
 * found only in part. Contours closer than two steps merge.
 *
 * Source: Adluru 2008, chapter 3. The log odds instead of the product of kernels, the
 * competition for edgels and the objects are this project's. */
#include "src/base/build.h"

#include <string.h>

#include "src/outlines/skeleton_grouping_written.h"

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_skeleton_grouping_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_skeleton_grouping_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_skeleton_grouping_params, field, __VA_ARGS__)
#define BETWEEN(field, ...)  CAIRN_NUMBER_BETWEEN(cairn_skeleton_grouping_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_width, 640, 1, 8192),
    INTEGER(max_height, 480, 1, 8192),
    INTEGER(max_edgels, 40000, 1, 1 << 24),
    INTEGER(max_centres, 4000, 1, 1 << 20),
    INTEGER(max_lines, 256, 1, 4096),
    INTEGER(max_parts, 256, 1, 4096),
    INTEGER(max_points, 8192, 1, 1 << 20),
    INTEGER(max_steps, 96, 1, 1024),
    INTEGER(particle_count, 16, 1, 1024),
    INTEGER(mode, CAIRN_MODE_DEFAULT, CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN),
    POSITIVE(duality_sigma, 20 * (CAIRN_PI / 180), 0, CAIRN_REAL_MAX),
    POSITIVE(step_sigma, 8, 0, CAIRN_REAL_MAX),
    POSITIVE(radius_sigma, CAIRN_REAL(0.2), 0, CAIRN_REAL_MAX),
    POSITIVE(symmetry_sigma, 8 * (CAIRN_PI / 180), 0, CAIRN_REAL_MAX),
    BETWEEN(detection_probability, CAIRN_REAL(0.9), 0, 1),
    BETWEEN(polarity_flip_probability, CAIRN_REAL(0.05), 0, 1),
    NUMBER(contrast_weight, 6, 0, CAIRN_REAL_MAX),
    POSITIVE(stop_log_odds, 10, 0, CAIRN_REAL_MAX),
    NUMBER(min_log_odds, 20, 0, CAIRN_REAL_MAX),
    NUMBER(min_mirror_ratio, CAIRN_REAL(0.6), 0, 1),
};
const cairn_parameters cairn_skeleton_grouping_parameters =
    CAIRN_PARAMETERS("skeleton_grouping", cairn_skeleton_grouping_params, rows);

cairn_skeleton_grouping_params cairn_skeleton_grouping_default(void)
{
    cairn_skeleton_grouping_params params;

    cairn_parameters_preset(&cairn_skeleton_grouping_parameters, &params);
    params.seed = 1;
    return params;
}

cairn_skeleton_grouping_params cairn_skeleton_grouping_as_written(void)
{
    cairn_skeleton_grouping_params params = cairn_skeleton_grouping_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    params.max_centres = 8000;
    params.max_points = 32768;
    params.max_parts = 512;
    params.max_steps = 256;
    params.particle_count = 50;
    params.radius_sigma = 2;
    params.symmetry_sigma = 10 * (CAIRN_PI / 180);
    params.stop_log_odds = 2;
    params.min_log_odds = 12;
    return params;
}

/* Returns the params of the particle filter. */
static cairn_particle_filter_params filter_params(const cairn_skeleton_grouping_params *params)
{
    cairn_particle_filter_params f = cairn_particle_filter_default();

    f.particles = f.max_particles = params->particle_count;
    f.max_blocks = (params->max_steps + 2) * params->particle_count;
    if (params->mode == CAIRN_MODE_AS_WRITTEN) {
        /* Prior boosting: all followers are kept, each with its weight. */
        f.proposal = CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR;
        f.adaptive_followers = 0;
        f.max_followers = SKELETON_GROUPING_WRITTEN_MAX_FOLLOWERS;
        f.max_candidates = params->particle_count * SKELETON_GROUPING_WRITTEN_MAX_FOLLOWERS;
        f.state_bytes = (int32_t)sizeof(skeleton_grouping_written_state);
        return f;
    }
    f.max_followers = SKELETON_GROUPING_MAX_FOLLOWERS;
    f.max_candidates = params->particle_count * SKELETON_GROUPING_MAX_CANDIDATES;
    f.state_bytes = (int32_t)sizeof(skeleton_grouping_state);
    return f;
}

/* Lengths are in pixels instead of metres. */
static cairn_polyline_params line_params(const cairn_skeleton_grouping_params *params)
{
    cairn_polyline_params line = cairn_polyline_default();

    line.dim = 3;
    line.max_points = params->max_centres;
    line.max_segments = params->max_lines;
    line.min_points = 5;
    line.max_iterations = 15;
    line.min_length = 4;
    line.sigma = 1;
    line.width_first = 4;
    line.width_last = 2;
    line.width_decay = CAIRN_REAL(0.8);
    line.gap = 8;
    line.gap_max = 12;
    line.merge_angle = 10 * (CAIRN_PI / 180);
    line.merge_distance = 3;
    line.tolerance = CAIRN_REAL(0.2);
    return line;
}

cairn_status cairn_skeleton_grouping_check(const cairn_skeleton_grouping_params *params,
                                           cairn_object_fault *fault)
{
    cairn_status status =
        cairn_parameters_check(&cairn_skeleton_grouping_parameters, params, fault);

    if (status == CAIRN_OK) {
        cairn_polyline_params line = line_params(params);

        status = cairn_polyline_check(&line, fault);
    }
    return status;
}

/* The object, its arrays and nested objects; NULL from a counting pool. */
static cairn_skeleton_grouping *build(cairn_pool *pool,
                                      const cairn_skeleton_grouping_params *params)
{
    cell_grid grid = cell_grid_of(params->max_width, params->max_height, SKELETON_GROUPING_CELL_PX);
    int is_written = params->mode == CAIRN_MODE_AS_WRITTEN;
    cairn_polyline_params line = line_params(params);
    cairn_particle_filter_params filter = filter_params(params);
    cairn_skeleton_grouping *skeleton = cairn_object_take(pool, sizeof *skeleton);
    cairn_particle_filter_model model = is_written ? cairn_skeleton_grouping_written_model(skeleton)
                                                   : cairn_skeleton_grouping_model(skeleton);

    CAIRN_TAKE(skeleton, pool, edgels, params->max_edgels);
    CAIRN_TAKE(skeleton, pool, cell_first, cell_grid_count(&grid) + 1);
    CAIRN_TAKE(skeleton, pool, centres, params->max_centres);
    CAIRN_TAKE(skeleton, pool, seeds, params->max_lines);
    if (is_written)
        CAIRN_TAKE(skeleton, pool, written, 1);
    else
        CAIRN_TAKE(skeleton, pool, best_path, params->max_steps + 1);
    CAIRN_TAKE(skeleton, pool, discs, params->max_points);
    CAIRN_TAKE(skeleton, pool, candidates, params->max_parts);
    CAIRN_TAKE(skeleton, pool, points, params->max_points);
    CAIRN_TAKE(skeleton, pool, parts, params->max_parts);
    CAIRN_TAKE(skeleton, pool, objects, params->max_parts);
    CAIRN_TAKE(skeleton, pool, union_find, params->max_parts);
    CAIRN_TAKE(skeleton, pool, polarity_sum, params->max_parts);
    CAIRN_TAKE_OBJECT(skeleton, pool, polyline, polyline, &line);
    CAIRN_TAKE_BY(skeleton, cairn_particle_filter_create(CAIRN_FIELD(skeleton, filter), pool,
                                                         &filter, &model));
    if (skeleton != NULL)
        skeleton->params = *params;
    return skeleton;
}

CAIRN_OBJECT(skeleton_grouping, skeleton_grouping, build);

static cairn_status check_input(const cairn_skeleton_grouping *skeleton,
                                const cairn_skeleton_grouping_input *in)
{
    if (in->count < 0 || (in->edgels == NULL && in->count > 0) || in->width < 1 || in->height < 1)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_is_finite(in->min_radius) || !cairn_is_finite(in->max_radius))
        return CAIRN_NOT_FINITE;
    if ((in->min_radius != 0 || in->max_radius != 0) &&
        !(in->min_radius >= 1 && in->max_radius >= in->min_radius))
        return CAIRN_BAD_ARGUMENT;
    if (in->width > skeleton->params.max_width || in->height > skeleton->params.max_height ||
        in->count > skeleton->params.max_edgels)
        return CAIRN_FULL;
    return CAIRN_OK;
}

cairn_status cairn_skeleton_grouping_begin(cairn_skeleton_grouping *skeleton,
                                           const cairn_skeleton_grouping_input *input)
{
    cairn_status status;

    if (skeleton == NULL || input == NULL)
        return CAIRN_BAD_ARGUMENT;
    status = check_input(skeleton, input);
    if (status != CAIRN_OK)
        return status;
    skeleton->input = *input;
    skeleton->grid = cell_grid_of(input->width, input->height, SKELETON_GROUPING_CELL_PX);
    skeleton->edgel_count = input->count;
    skeleton->centre_count = skeleton->centres_found = skeleton->seed_count = skeleton->line_count =
        skeleton->walk_count = skeleton->line_seeds = 0;
    skeleton->disc_count = skeleton->candidate_count = skeleton->point_count =
        skeleton->part_count = skeleton->object_count = 0;
    skeleton->seed_index = skeleton->direction = 0;
    skeleton->slope_count = 0;
    skeleton->mean_log_slope = 0;
    memset(skeleton->histogram, 0, sizeof skeleton->histogram);
    skeleton->status = CAIRN_OK;
    skeleton->resume = skeleton->phase_resume = skeleton->propose_resume = 0;
    skeleton->units_charged = skeleton->step_units_charged = 0;
    skeleton->is_pending = 1;
    skeleton->is_complete = 0;
    return CAIRN_OK;
}

/* The search in the default mode: see Method in the head of this file. */
static int search(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(skeleton->resume);
    CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_index);
    cairn_skeleton_grouping_set_limits(skeleton);
    CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_centres);
    if (skeleton->input.max_radius == 0)
        CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_propose_range);
    CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_lines);
    CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_line_seeds);
    CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_single_seeds);
    CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_walks);
    CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_select_parts);
    CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_join_parts);
    CAIRN_STEP_END(skeleton->resume);
}

/* The search as written. Without a given range of radii one is proposed from the CPs, which are
 * computed again within it. */
static int search_as_written(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(skeleton->resume);
    CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_index);
    cairn_skeleton_grouping_set_limits(skeleton);
    CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_written_centres);
    if (skeleton->input.max_radius == 0) {
        CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_propose_range);
        skeleton->min_search_radius = skeleton->input.min_radius;
        skeleton->max_search_radius = skeleton->input.max_radius;
        CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_written_centres);
    }
    skeleton->centres_found = skeleton->written->pairs_seen < INT32_MAX
                                  ? (int32_t)skeleton->written->pairs_seen
                                  : INT32_MAX;
    CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_lines);
    CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_line_seeds);
    CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_written_walks);
    CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_select_parts);
    CAIRN_STEP_RUN(skeleton, resume, budget, cairn_skeleton_grouping_join_parts);
    CAIRN_STEP_END(skeleton->resume);
}

cairn_status cairn_skeleton_grouping_step(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    int is_done;

    if (skeleton == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!skeleton->is_pending)
        return CAIRN_OK;
    is_done =
        skeleton->written != NULL ? search_as_written(skeleton, budget) : search(skeleton, budget);
    if (!is_done && skeleton->status >= CAIRN_OK)
        return CAIRN_MORE;
    skeleton->is_pending = 0;
    skeleton->is_complete = is_done;
    return is_done ? CAIRN_OK : skeleton->status;
}

cairn_skeleton_grouping_result cairn_skeleton_grouping_read(const cairn_skeleton_grouping *skeleton)
{
    cairn_skeleton_grouping_result r;

    memset(&r, 0, sizeof r);
    if (skeleton == NULL || !skeleton->is_complete)
        return r;
    r.points = skeleton->points;
    r.parts = skeleton->parts;
    r.objects = skeleton->objects;
    r.point_count = skeleton->point_count;
    r.part_count = skeleton->part_count;
    r.object_count = skeleton->object_count;
    r.centre_count = skeleton->centres_found;
    r.line_count = skeleton->line_count;
    r.seed_count = skeleton->walk_count;
    r.dropped_seed_count = skeleton->seed_count - skeleton->seed_index;
    r.min_radius = skeleton->input.min_radius;
    r.max_radius = skeleton->input.max_radius;
    return r;
}

int32_t cairn_skeleton_grouping_centre_point(const cairn_skeleton_grouping *skeleton, int32_t index,
                                             cairn_vec2 *at, cairn_real *radius)
{
    if (skeleton == NULL || !skeleton->is_complete || index < 0 || index >= skeleton->centre_count)
        return 0;
    *at = skeleton->centres[index].position;
    *radius = skeleton->centres[index].radius;
    return 1;
}

int32_t cairn_skeleton_grouping_mirror_line(const cairn_skeleton_grouping *skeleton, int32_t index,
                                            cairn_polyline_segment *line)
{
    cairn_polyline_view view;
    int32_t start;

    if (skeleton == NULL || !skeleton->is_complete || index < 0 || index >= skeleton->line_seeds)
        return 0;
    view = cairn_polyline_read(skeleton->polyline);
    start = skeleton->seeds[index].centre;
    *line =
        view.segments[skeleton->params.mode == CAIRN_MODE_AS_WRITTEN ? start : view.label[start]];
    return 1;
}
