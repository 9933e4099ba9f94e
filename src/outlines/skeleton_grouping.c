/* Joint grouping of contours and skeletons without a shape model: interface, edgel index and
 * phases.
 *
 * Method:
 * 1. Edgels are sorted into grid cells.
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

enum {
    PHASE_IDLE,
    PHASE_INDEX,
    PHASE_CENTRES,
    PHASE_RANGE,
    PHASE_LINES,
    PHASE_MIRROR,
    PHASE_WALKS,
    PHASE_SELECT,
    PHASE_JOIN,
    PHASE_DONE
};

cairn_skeleton_grouping_params cairn_skeleton_grouping_default(void)
{
    cairn_skeleton_grouping_params params = {
        .max_width = 640,
        .max_height = 480,
        .max_edgels = 40000,
        .max_centres = 4000,
        .max_lines = 256,
        .max_parts = 256,
        .max_points = 8192,
        .max_steps = 96,
        .particle_count = 16,
        .mode = CAIRN_MODE_DEFAULT,
        .duality_sigma = 20 * (CAIRN_PI / 180),
        .step_sigma = 8,
        .radius_sigma = CAIRN_REAL(0.2),
        .symmetry_sigma = 8 * (CAIRN_PI / 180),
        .detection_probability = CAIRN_REAL(0.9),
        .polarity_flip_probability = CAIRN_REAL(0.05),
        .contrast_weight = 6,
        .stop_log_odds = 10,
        .min_log_odds = 20,
        .min_mirror_ratio = CAIRN_REAL(0.6),
        .seed = 1,
    };
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

static int is_share(cairn_real x)
{
    return x > 0 && x < 1;
}

static int is_positive(cairn_real x)
{
    return x > 0 && cairn_is_finite(x);
}

static int is_count(int32_t n, int32_t most)
{
    return n >= 1 && n <= most;
}

static int params_are_valid(const cairn_skeleton_grouping_params *params)
{
    return params != NULL && is_count(params->max_width, 8192) &&
           is_count(params->max_height, 8192) && is_count(params->max_edgels, 1 << 24) &&
           is_count(params->max_centres, 1 << 20) && is_count(params->max_lines, 4096) &&
           is_count(params->max_parts, 4096) && is_count(params->max_points, 1 << 20) &&
           is_count(params->max_steps, 1024) && is_count(params->particle_count, 1024) &&
           (params->mode == CAIRN_MODE_DEFAULT || params->mode == CAIRN_MODE_AS_WRITTEN) &&
           is_positive(params->duality_sigma) && is_positive(params->step_sigma) &&
           is_positive(params->radius_sigma) && is_positive(params->symmetry_sigma) &&
           is_share(params->detection_probability) && is_share(params->polarity_flip_probability) &&
           params->contrast_weight >= 0 && cairn_is_finite(params->contrast_weight) &&
           is_positive(params->stop_log_odds) && params->min_log_odds >= 0 &&
           cairn_is_finite(params->min_log_odds) && params->min_mirror_ratio >= 0 &&
           params->min_mirror_ratio <= 1;
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

/* Returns the number of grid cells along a side. */
static int32_t cell_count(int32_t side)
{
    return (side + SKELETON_GROUPING_CELL_PX - 1) / SKELETON_GROUPING_CELL_PX;
}

static cairn_particle_filter *carve_filter(cairn_pool *pool,
                                           const cairn_skeleton_grouping_params *params,
                                           cairn_skeleton_grouping *skeleton)
{
    cairn_particle_filter_params f = filter_params(params);
    cairn_particle_filter_model model = params->mode == CAIRN_MODE_AS_WRITTEN
                                            ? cairn_skeleton_grouping_written_model(skeleton)
                                            : cairn_skeleton_grouping_model(skeleton);
    cairn_particle_filter *filter = NULL;
    cairn_status status;

    if (pool->base == NULL) {
        cairn_pool_count(pool, cairn_particle_filter_memory(&f));
        return NULL;
    }
    status = cairn_particle_filter_create(&filter, pool, &f, &model);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    return filter;
}

static cairn_polyline *carve_polyline(cairn_pool *pool,
                                      const cairn_skeleton_grouping_params *params)
{
    cairn_polyline_params line = line_params(params);
    cairn_polyline *polyline = NULL;
    cairn_status status;

    if (pool->base == NULL) {
        cairn_pool_count(pool, cairn_polyline_memory(&line));
        return NULL;
    }
    status = cairn_polyline_create(&polyline, pool, &line);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    return polyline;
}

static cairn_skeleton_grouping *carve(cairn_pool *pool,
                                      const cairn_skeleton_grouping_params *params)
{
    size_t lists =
        (size_t)cell_count(params->max_width) * (size_t)cell_count(params->max_height) + 1;
    int written = params->mode == CAIRN_MODE_AS_WRITTEN;
    size_t parts = (size_t)params->max_parts, points = (size_t)params->max_points;
    cairn_skeleton_grouping *skeleton = cairn_pool_take_one(pool, sizeof *skeleton);
    skeleton_grouping_edgel *edgels =
        cairn_pool_take(pool, (size_t)params->max_edgels, sizeof *edgels);
    int32_t *first = cairn_pool_take(pool, lists, sizeof *first);
    skeleton_grouping_centre *centres =
        cairn_pool_take(pool, (size_t)params->max_centres, sizeof *centres);
    skeleton_grouping_seed *starts =
        cairn_pool_take(pool, (size_t)params->max_lines, sizeof *starts);
    skeleton_grouping_state *path =
        written ? NULL : cairn_pool_take(pool, (size_t)params->max_steps + 1, sizeof *path);
    skeleton_grouping_written *work = written ? cairn_pool_take_one(pool, sizeof *work) : NULL;
    skeleton_grouping_disc *discs = cairn_pool_take(pool, points, sizeof *discs);
    skeleton_grouping_part *candidates = cairn_pool_take(pool, parts, sizeof *candidates);
    cairn_skeleton_grouping_point *reported = cairn_pool_take(pool, points, sizeof *reported);
    cairn_skeleton_grouping_part *chosen = cairn_pool_take(pool, parts, sizeof *chosen);
    cairn_skeleton_grouping_object *objects = cairn_pool_take(pool, parts, sizeof *objects);
    int32_t *group = cairn_pool_take(pool, parts, sizeof *group);
    int32_t *bright = cairn_pool_take(pool, parts, sizeof *bright);
    cairn_polyline *polyline = carve_polyline(pool, params);
    cairn_particle_filter *filter = carve_filter(pool, params, skeleton);

    if (skeleton != NULL) {
        memset(skeleton, 0, sizeof *skeleton);
        skeleton->edgels = edgels;
        skeleton->cell_first = first;
        skeleton->centres = centres;
        skeleton->seeds = starts;
        skeleton->best_path = path;
        skeleton->written = work;
        skeleton->discs = discs;
        skeleton->candidates = candidates;
        skeleton->points = reported;
        skeleton->parts = chosen;
        skeleton->objects = objects;
        skeleton->union_find = group;
        skeleton->polarity_sum = bright;
        skeleton->polyline = polyline;
        skeleton->filter = filter;
    }
    return skeleton;
}

size_t cairn_skeleton_grouping_memory(const cairn_skeleton_grouping_params *params)
{
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_skeleton_grouping_create(cairn_skeleton_grouping **skeleton, cairn_pool *pool,
                                            const cairn_skeleton_grouping_params *params)
{
    size_t need = cairn_skeleton_grouping_memory(params);
    cairn_skeleton_grouping *made;

    if (skeleton == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    made->params = *params;
    *skeleton = made;
    return CAIRN_OK;
}

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
    skeleton->columns = cell_count(input->width);
    skeleton->rows = cell_count(input->height);
    skeleton->edgel_count = input->count;
    skeleton->centre_count = skeleton->centres_found = skeleton->seed_count = skeleton->line_count =
        skeleton->walk_count = skeleton->line_seeds = 0;
    skeleton->disc_count = skeleton->candidate_count = skeleton->point_count =
        skeleton->part_count = skeleton->object_count = 0;
    skeleton->seed_index = skeleton->direction = skeleton->is_walking = 0;
    skeleton->cursor = skeleton->second_cursor = skeleton->polarity_cursor =
        skeleton->phase_counter = skeleton->units_charged = skeleton->step_units_charged = 0;
    skeleton->slope_count = 0;
    skeleton->mean_log_slope = 0;
    memset(skeleton->histogram, 0, sizeof skeleton->histogram);
    skeleton->phase = PHASE_INDEX;
    return CAIRN_OK;
}

/* ---- Edgel index ---- */

static int32_t clamp_cell(cairn_real x, int32_t count)
{
    int32_t cell = cairn_real_to_int(cairn_floor(x / SKELETON_GROUPING_CELL_PX));

    return cell < 0 ? 0 : cell >= count ? count - 1 : cell;
}

int32_t cairn_skeleton_grouping_column(const cairn_skeleton_grouping *skeleton, cairn_real x)
{
    return clamp_cell(x, skeleton->columns);
}

int32_t cairn_skeleton_grouping_row(const cairn_skeleton_grouping *skeleton, cairn_real y)
{
    return clamp_cell(y, skeleton->rows);
}

static int32_t cell_of(const cairn_skeleton_grouping *skeleton, cairn_vec2 p)
{
    return cairn_skeleton_grouping_row(skeleton, p.y) * skeleton->columns +
           cairn_skeleton_grouping_column(skeleton, p.x);
}

static int is_finite_edgel(const cairn_edgel *edgel)
{
    return cairn_vec2_is_finite(edgel->position) && cairn_vec2_is_finite(edgel->normal) &&
           cairn_is_finite(edgel->gradient_magnitude);
}

/* Counts an edgel in its cell and updates the mean logarithmic slope. */
static void count(cairn_skeleton_grouping *skeleton, const cairn_edgel *edgel)
{
    skeleton->cell_first[cell_of(skeleton, edgel->position)]++;
    if (edgel->gradient_magnitude > 0)
        skeleton->mean_log_slope +=
            (cairn_log(edgel->gradient_magnitude) - skeleton->mean_log_slope) /
            (cairn_real)++skeleton->slope_count;
}

/* Stores an input edgel in its cell. */
static void store_edgel(cairn_skeleton_grouping *skeleton, int32_t source)
{
    const cairn_edgel *from = &skeleton->input.edgels[source];
    skeleton_grouping_edgel *e =
        &skeleton->edgels[skeleton->cell_first[cell_of(skeleton, from->position)]++];

    e->position = from->position;
    e->normal = from->normal;
    e->log_slope_ratio = from->gradient_magnitude > 0
                             ? cairn_log(from->gradient_magnitude) - skeleton->mean_log_slope
                             : 0;
    e->input_index = source;
    e->assigned = 0;
}

/* Counting sort of the edgels by cell: counts and mean log slope, cell offsets, edgels. Filling
 * moves each cell's offset to the next cell's; the last pass moves them back. */
cairn_status cairn_skeleton_grouping_index(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    int32_t lists = skeleton->columns * skeleton->rows, n = skeleton->edgel_count;

    for (; skeleton->cursor < 3 * lists + 2 * n; skeleton->cursor++) {
        int32_t i = skeleton->cursor;

        if (!cairn_budget_charge(budget, &skeleton->units_charged, 1))
            return CAIRN_MORE;
        if (i < lists) {
            skeleton->cell_first[i] = 0;
        } else if (i < lists + n) {
            const cairn_edgel *e = &skeleton->input.edgels[i - lists];

            if (!is_finite_edgel(e))
                return CAIRN_NOT_FINITE;
            count(skeleton, e);
        } else if (i < 2 * lists + n) {
            int32_t cell = i - lists - n, here = skeleton->cell_first[cell];

            skeleton->cell_first[cell] = skeleton->phase_counter;
            skeleton->phase_counter += here;
        } else if (i < 2 * lists + 2 * n) {
            store_edgel(skeleton, i - 2 * lists - n);
        } else {
            int32_t cell = 3 * lists + 2 * n - 1 - i;

            skeleton->cell_first[cell + 1] = skeleton->cell_first[cell];
            if (cell == 0)
                skeleton->cell_first[0] = 0;
        }
    }
    return CAIRN_OK;
}

cairn_real cairn_skeleton_grouping_density(const cairn_skeleton_grouping *skeleton, cairn_vec2 at)
{
    enum { HALF_WINDOW_CELLS = 2, PRIOR_COUNT = 3 };
    int32_t x = cairn_skeleton_grouping_column(skeleton, at.x),
            y = cairn_skeleton_grouping_row(skeleton, at.y), count = PRIOR_COUNT, area = 0;
    int32_t x0 = x > HALF_WINDOW_CELLS ? x - HALF_WINDOW_CELLS : 0,
            x1 = x + HALF_WINDOW_CELLS < skeleton->columns ? x + HALF_WINDOW_CELLS
                                                           : skeleton->columns - 1;

    for (int32_t row = y > HALF_WINDOW_CELLS ? y - HALF_WINDOW_CELLS : 0;
         row <= y + HALF_WINDOW_CELLS && row < skeleton->rows; row++) {
        int32_t from, end;

        skeleton_grouping_cells_of_row(skeleton, row, x0, x1, &from, &end);
        count += end - from;
        area += (x1 - x0 + 1) * SKELETON_GROUPING_CELL_PX * SKELETON_GROUPING_CELL_PX;
    }
    return (cairn_real)count / (cairn_real)area;
}

/* ---- Phases ---- */

static cairn_status step_phase(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    static cairn_status (*const phase[2][PHASE_DONE])(cairn_skeleton_grouping *, cairn_budget *) = {
        {NULL, cairn_skeleton_grouping_index, cairn_skeleton_grouping_centres,
         cairn_skeleton_grouping_propose_range, cairn_skeleton_grouping_lines,
         cairn_skeleton_grouping_mirror, cairn_skeleton_grouping_walks,
         cairn_skeleton_grouping_select_parts, cairn_skeleton_grouping_join_parts},
        {NULL, cairn_skeleton_grouping_index, cairn_skeleton_grouping_written_centres,
         cairn_skeleton_grouping_written_range, cairn_skeleton_grouping_lines,
         cairn_skeleton_grouping_mirror, cairn_skeleton_grouping_written_walks,
         cairn_skeleton_grouping_select_parts, cairn_skeleton_grouping_join_parts},
    };

    return phase[skeleton->params.mode == CAIRN_MODE_AS_WRITTEN][skeleton->phase](skeleton, budget);
}

cairn_status cairn_skeleton_grouping_step(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    if (skeleton == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (skeleton->phase != PHASE_IDLE && skeleton->phase != PHASE_DONE) {
        cairn_status status = step_phase(skeleton, budget);

        if (status < 0)
            skeleton->phase = PHASE_IDLE;
        if (status != CAIRN_OK)
            return status;
        skeleton->phase++;
        skeleton->cursor = skeleton->second_cursor = skeleton->polarity_cursor =
            skeleton->phase_counter = 0;
    }
    return CAIRN_OK;
}

cairn_skeleton_grouping_result cairn_skeleton_grouping_read(const cairn_skeleton_grouping *skeleton)
{
    cairn_skeleton_grouping_result r;

    memset(&r, 0, sizeof r);
    if (skeleton == NULL || skeleton->phase != PHASE_DONE)
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
    if (skeleton == NULL || skeleton->phase != PHASE_DONE || index < 0 ||
        index >= skeleton->centre_count)
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

    if (skeleton == NULL || skeleton->phase != PHASE_DONE || index < 0 ||
        index >= skeleton->line_seeds)
        return 0;
    view = cairn_polyline_read(skeleton->polyline);
    start = skeleton->seeds[index].centre;
    *line =
        view.segments[skeleton->params.mode == CAIRN_MODE_AS_WRITTEN ? start : view.label[start]];
    return 1;
}
