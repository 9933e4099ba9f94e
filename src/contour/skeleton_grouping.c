/* Skeletons and contours without a model.
 *
 * Method: edgels are sorted into cells; each looks along its normal, to both sides, for the one
 * that faces it best: their centre point (skeleton_grouping_centre.c). Lines through the CPs in (x,
 * y, radius) by EM, of which those count whose CPs are mirror images, give the starts
 * (skeleton_grouping_start.c). From each start particles walk the axis to both ends
 * (skeleton_grouping_walk.c). The walks rival for the edgels by their log odds; the winners that
 * lead into each other are objects (skeleton_grouping_part.c).
 *
 * As written: CPs of all pairs (skeleton_grouping_written.c), and a filter for each line
 * (skeleton_grouping_written_walk.c).
 *
 * Layout: edgels in order of their cells, CPs, starts, the filter with the whole past of its walks,
 * the discs of all walks.
 *
 * Limits: an axis is found from its sides: round blobs, which have no direction, are found in part.
 * Contours closer than two steps are one.
 *
 * Source: Adluru 2008, chapter 3. The odds in place of the product of kernels, the rivalry for
 * edgels and the objects are this project's. */
#include "src/core/build.h"

#include <string.h>

#include "src/contour/skeleton_grouping_written.h"

enum { IDLE, INDEX, CENTRES, RANGE, LINES, MIRROR, WALKS, CHOOSE, JOIN, DONE };

cairn_skeleton_params cairn_skeleton_default(void)
{
    cairn_skeleton_params params = {
        .max_width = 640,
        .max_height = 480,
        .max_edgels = 40000,
        .max_centres = 4000,
        .max_lines = 256,
        .max_parts = 256,
        .max_points = 8192,
        .max_steps = 96,
        .particles = 16,
        .mode = CAIRN_MODE_DEFAULT,
        .duality = 20 * (CAIRN_PI / 180),
        .reach = 8,
        .radius = CAIRN_REAL(0.2),
        .symmetry = 8 * (CAIRN_PI / 180),
        .detection = CAIRN_REAL(0.9),
        .flip = CAIRN_REAL(0.05),
        .contrast = 6,
        .stop = 10,
        .min_log_odds = 20,
        .min_mirror = CAIRN_REAL(0.6),
        .seed = 1,
    };
    return params;
}

cairn_skeleton_params cairn_skeleton_as_written(void)
{
    cairn_skeleton_params params = cairn_skeleton_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    params.max_centres = 8000;
    params.max_points = 32768;
    params.max_parts = 512;
    params.max_steps = 256;
    params.particles = 50;
    params.radius = 2;
    params.symmetry = 10 * (CAIRN_PI / 180);
    params.stop = 2;
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

static int params_are_valid(const cairn_skeleton_params *p)
{
    return p != NULL && is_count(p->max_width, 8192) && is_count(p->max_height, 8192) &&
           is_count(p->max_edgels, 1 << 24) && is_count(p->max_centres, 1 << 20) &&
           is_count(p->max_lines, 4096) && is_count(p->max_parts, 4096) &&
           is_count(p->max_points, 1 << 20) && is_count(p->max_steps, 1024) &&
           is_count(p->particles, 1024) &&
           (p->mode == CAIRN_MODE_DEFAULT || p->mode == CAIRN_MODE_AS_WRITTEN) &&
           is_positive(p->duality) && is_positive(p->reach) && is_positive(p->radius) &&
           is_positive(p->symmetry) && is_share(p->detection) && is_share(p->flip) &&
           p->contrast >= 0 && cairn_is_finite(p->contrast) && is_positive(p->stop) &&
           p->min_log_odds >= 0 && cairn_is_finite(p->min_log_odds) && p->min_mirror >= 0 &&
           p->min_mirror <= 1;
}

static cairn_particle_filter_params filter_params(const cairn_skeleton_params *p)
{
    cairn_particle_filter_params f = cairn_particle_filter_default();

    f.particles = f.max_particles = p->particles;
    f.max_blocks = (p->max_steps + 2) * p->particles;
    if (p->mode == CAIRN_MODE_AS_WRITTEN) {
        /* Prior boosting: all followers, each with its weight. */
        f.proposal = CAIRN_PROPOSAL_PRIOR;
        f.by_entropy = 0;
        f.max_followers = WRITTEN_FOLLOWERS;
        f.max_candidates = p->particles * WRITTEN_FOLLOWERS;
        f.state_bytes = (int32_t)sizeof(skeleton_written_state);
        return f;
    }
    f.max_followers = SKELETON_FOLLOWERS;
    f.max_candidates = p->particles * SKELETON_CANDIDATES;
    f.state_bytes = (int32_t)sizeof(skeleton_state);
    return f;
}

/* Pixels for metres. */
static cairn_polyline_params line_params(const cairn_skeleton_params *p)
{
    cairn_polyline_params line = cairn_polyline_default();

    line.dim = 3;
    line.max_points = p->max_centres;
    line.max_segments = p->max_lines;
    line.min_points = 5;
    line.max_iterations = 15;
    line.min_length = 4;
    line.sigma = 1;
    line.s_first = 4;
    line.s_last = 2;
    line.shrink = CAIRN_REAL(0.8);
    line.gap = 8;
    line.gap_max = 12;
    line.merge_angle = 10 * (CAIRN_PI / 180);
    line.merge_distance = 3;
    line.tolerance = CAIRN_REAL(0.2);
    return line;
}

static int32_t cells(int32_t side)
{
    return (side + SKELETON_CELL - 1) / SKELETON_CELL;
}

static cairn_particle_filter *carve_filter(cairn_pool *pool, const cairn_skeleton_params *p,
                                           cairn_skeleton *g)
{
    cairn_particle_filter_params f = filter_params(p);
    cairn_particle_model model = p->mode == CAIRN_MODE_AS_WRITTEN ? cairn_skeleton_written_model(g)
                                                                  : cairn_skeleton_model(g);
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

static cairn_polyline *carve_polyline(cairn_pool *pool, const cairn_skeleton_params *p)
{
    cairn_polyline_params line = line_params(p);
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

static cairn_skeleton *carve(cairn_pool *pool, const cairn_skeleton_params *p)
{
    size_t lists = (size_t)cells(p->max_width) * (size_t)cells(p->max_height) + 1;
    int written = p->mode == CAIRN_MODE_AS_WRITTEN;
    size_t parts = (size_t)p->max_parts, points = (size_t)p->max_points;
    cairn_skeleton *g = cairn_pool_take_one(pool, sizeof *g);
    skeleton_edgel *edgels = cairn_pool_take(pool, (size_t)p->max_edgels, sizeof *edgels);
    int32_t *first = cairn_pool_take(pool, lists, sizeof *first);
    skeleton_centre *centres = cairn_pool_take(pool, (size_t)p->max_centres, sizeof *centres);
    skeleton_start *starts = cairn_pool_take(pool, (size_t)p->max_lines, sizeof *starts);
    skeleton_state *path =
        written ? NULL : cairn_pool_take(pool, (size_t)p->max_steps + 1, sizeof *path);
    skeleton_written *work = written ? cairn_pool_take_one(pool, sizeof *work) : NULL;
    skeleton_disc *discs = cairn_pool_take(pool, points, sizeof *discs);
    skeleton_part *candidates = cairn_pool_take(pool, parts, sizeof *candidates);
    cairn_skeleton_point *shown = cairn_pool_take(pool, points, sizeof *shown);
    cairn_skeleton_part *chosen = cairn_pool_take(pool, parts, sizeof *chosen);
    cairn_skeleton_object *objects = cairn_pool_take(pool, parts, sizeof *objects);
    int32_t *group = cairn_pool_take(pool, parts, sizeof *group);
    int32_t *bright = cairn_pool_take(pool, parts, sizeof *bright);
    cairn_polyline *polyline = carve_polyline(pool, p);
    cairn_particle_filter *filter = carve_filter(pool, p, g);

    if (g != NULL) {
        memset(g, 0, sizeof *g);
        g->edgels = edgels;
        g->first = first;
        g->centres = centres;
        g->starts = starts;
        g->path = path;
        g->written = work;
        g->discs = discs;
        g->candidates = candidates;
        g->points = shown;
        g->parts = chosen;
        g->objects = objects;
        g->group = group;
        g->bright = bright;
        g->polyline = polyline;
        g->filter = filter;
    }
    return g;
}

size_t cairn_skeleton_memory(const cairn_skeleton_params *params)
{
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_skeleton_create(cairn_skeleton **skeleton, cairn_pool *pool,
                                   const cairn_skeleton_params *params)
{
    size_t need = cairn_skeleton_memory(params);
    cairn_skeleton *made;

    if (skeleton == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    made->params = *params;
    *skeleton = made;
    return CAIRN_OK;
}

static cairn_status check_input(const cairn_skeleton *g, const cairn_skeleton_input *in)
{
    if (in->count < 0 || (in->edgels == NULL && in->count > 0) || in->width < 1 || in->height < 1)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_is_finite(in->min_radius) || !cairn_is_finite(in->max_radius))
        return CAIRN_NOT_FINITE;
    if ((in->min_radius != 0 || in->max_radius != 0) &&
        !(in->min_radius >= 1 && in->max_radius >= in->min_radius))
        return CAIRN_BAD_ARGUMENT;
    if (in->width > g->params.max_width || in->height > g->params.max_height ||
        in->count > g->params.max_edgels)
        return CAIRN_FULL;
    return CAIRN_OK;
}

cairn_status cairn_skeleton_begin(cairn_skeleton *g, const cairn_skeleton_input *input)
{
    cairn_status status;

    if (g == NULL || input == NULL)
        return CAIRN_BAD_ARGUMENT;
    status = check_input(g, input);
    if (status != CAIRN_OK)
        return status;
    g->input = *input;
    g->columns = cells(input->width);
    g->rows = cells(input->height);
    g->edgel_count = input->count;
    g->centre_count = g->centres_seen = g->start_count = g->line_count = g->walked =
        g->line_starts = 0;
    g->disc_count = g->candidate_count = g->point_count = g->part_count = g->object_count = 0;
    g->start = g->direction = g->is_walking = 0;
    g->cursor = g->other = g->sense = g->item = g->paid = g->stage = 0;
    g->steep_count = 0;
    g->log_slope = 0;
    memset(g->histogram, 0, sizeof g->histogram);
    g->phase = INDEX;
    return CAIRN_OK;
}

/* ---- The index ---- */

static int32_t clamp_cell(cairn_real x, int32_t count)
{
    int32_t cell = cairn_real_to_int(cairn_floor(x / SKELETON_CELL));

    return cell < 0 ? 0 : cell >= count ? count - 1 : cell;
}

int32_t cairn_skeleton_column(const cairn_skeleton *g, cairn_real x)
{
    return clamp_cell(x, g->columns);
}

int32_t cairn_skeleton_line(const cairn_skeleton *g, cairn_real y)
{
    return clamp_cell(y, g->rows);
}

static int32_t cell_of(const cairn_skeleton *g, cairn_vec2 p)
{
    return cairn_skeleton_line(g, p.y) * g->columns + cairn_skeleton_column(g, p.x);
}

static int is_finite_edgel(const cairn_edgel *e)
{
    return cairn_is_finite(e->position.x) && cairn_is_finite(e->position.y) &&
           cairn_is_finite(e->normal.x) && cairn_is_finite(e->normal.y) &&
           cairn_is_finite(e->slope);
}

static void count(cairn_skeleton *g, const cairn_edgel *e)
{
    g->first[cell_of(g, e->position)]++;
    if (e->slope > 0)
        g->log_slope += (cairn_log(e->slope) - g->log_slope) / (cairn_real)++g->steep_count;
}

static void place(cairn_skeleton *g, int32_t source)
{
    const cairn_edgel *from = &g->input.edgels[source];
    skeleton_edgel *e = &g->edgels[g->first[cell_of(g, from->position)]++];

    e->at = from->position;
    e->normal = from->normal;
    e->contrast = from->slope > 0 ? cairn_log(from->slope) - g->log_slope : 0;
    e->source = source;
    e->taken = 0;
}

/* A counting sort: how many there are in each cell and their mean slope, where each cell begins,
 * the edgels. first[] of a cell so ends up where the next one begins, and is moved on by one. */
cairn_status cairn_skeleton_index(cairn_skeleton *g, cairn_budget *budget)
{
    int32_t lists = g->columns * g->rows, n = g->edgel_count;

    for (; g->cursor < 3 * lists + 2 * n; g->cursor++) {
        int32_t i = g->cursor;

        if (!cairn_budget_pay(budget, &g->paid, 1))
            return CAIRN_MORE;
        if (i < lists) {
            g->first[i] = 0;
        } else if (i < lists + n) {
            const cairn_edgel *e = &g->input.edgels[i - lists];

            if (!is_finite_edgel(e))
                return CAIRN_NOT_FINITE;
            count(g, e);
        } else if (i < 2 * lists + n) {
            int32_t cell = i - lists - n, here = g->first[cell];

            g->first[cell] = g->item;
            g->item += here;
        } else if (i < 2 * lists + 2 * n) {
            place(g, i - 2 * lists - n);
        } else {
            int32_t cell = 3 * lists + 2 * n - 1 - i;

            g->first[cell + 1] = g->first[cell];
            if (cell == 0)
                g->first[0] = 0;
        }
    }
    return CAIRN_OK;
}

cairn_real cairn_skeleton_density(const cairn_skeleton *g, cairn_vec2 at)
{
    enum { ABOUT = 2, LEAST = 3 };
    int32_t x = cairn_skeleton_column(g, at.x), y = cairn_skeleton_line(g, at.y), count = LEAST,
            area = 0;
    int32_t x0 = x > ABOUT ? x - ABOUT : 0,
            x1 = x + ABOUT < g->columns ? x + ABOUT : g->columns - 1;

    for (int32_t row = y > ABOUT ? y - ABOUT : 0; row <= y + ABOUT && row < g->rows; row++) {
        int32_t from, end;

        skeleton_row(g, row, x0, x1, &from, &end);
        count += end - from;
        area += (x1 - x0 + 1) * SKELETON_CELL * SKELETON_CELL;
    }
    return (cairn_real)count / (cairn_real)area;
}

/* ---- Phases ---- */

static cairn_status step_phase(cairn_skeleton *g, cairn_budget *budget)
{
    static cairn_status (*const phase[2][DONE])(cairn_skeleton *, cairn_budget *) = {
        {NULL, cairn_skeleton_index, cairn_skeleton_centres, cairn_skeleton_propose_range,
         cairn_skeleton_lines, cairn_skeleton_mirror, cairn_skeleton_walks, cairn_skeleton_choose,
         cairn_skeleton_join},
        {NULL, cairn_skeleton_index, cairn_skeleton_written_centres, cairn_skeleton_written_range,
         cairn_skeleton_lines, cairn_skeleton_mirror, cairn_skeleton_written_walks,
         cairn_skeleton_choose, cairn_skeleton_join},
    };

    return phase[g->params.mode == CAIRN_MODE_AS_WRITTEN][g->phase](g, budget);
}

cairn_status cairn_skeleton_step(cairn_skeleton *g, cairn_budget *budget)
{
    if (g == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (g->phase != IDLE && g->phase != DONE) {
        cairn_status status = step_phase(g, budget);

        if (status < 0)
            g->phase = IDLE;
        if (status != CAIRN_OK)
            return status;
        g->phase++;
        g->cursor = g->other = g->sense = g->item = 0;
    }
    return CAIRN_OK;
}

cairn_skeleton_result cairn_skeleton_read(const cairn_skeleton *g)
{
    cairn_skeleton_result r;

    memset(&r, 0, sizeof r);
    if (g == NULL || g->phase != DONE)
        return r;
    r.points = g->points;
    r.parts = g->parts;
    r.objects = g->objects;
    r.point_count = g->point_count;
    r.part_count = g->part_count;
    r.object_count = g->object_count;
    r.centres = g->centres_seen;
    r.lines = g->line_count;
    r.starts = g->walked;
    r.left_out = g->start_count - g->start;
    r.min_radius = g->input.min_radius;
    r.max_radius = g->input.max_radius;
    return r;
}

int32_t cairn_skeleton_centre_point(const cairn_skeleton *g, int32_t index, cairn_vec2 *at,
                                    cairn_real *radius)
{
    if (g == NULL || g->phase != DONE || index < 0 || index >= g->centre_count)
        return 0;
    *at = g->centres[index].at;
    *radius = g->centres[index].radius;
    return 1;
}

int32_t cairn_skeleton_mirror_line(const cairn_skeleton *g, int32_t index,
                                   cairn_polyline_segment *line)
{
    cairn_polyline_view view;
    int32_t start;

    if (g == NULL || g->phase != DONE || index < 0 || index >= g->line_starts)
        return 0;
    view = cairn_polyline_read(g->polyline);
    start = g->starts[index].centre;
    *line = view.segments[g->params.mode == CAIRN_MODE_AS_WRITTEN ? start : view.label[start]];
    return 1;
}
