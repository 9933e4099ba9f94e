/* scan_match: correlative scan matching by voting with multi-stage refinement; the object, its
 * target and its query.
 *
 * Method:
 * 1. Hough voting: all pairs of points of equal direction vote for a position of the query's
 *    origin, heading by heading (scan_match_vote.c).
 * 2. Non-maximum suppression of the peaks over positions and headings (scan_match_rank.c).
 * 3. Refinement in stages by robust point-to-line ICP (scan_match_fit.c): few points and wide gates
 *    first, at the end every beam.
 * 4. After each stage the hypotheses are scored by inliers and free-space violations, duplicates
 *    are removed, and the worse ones are pruned.
 * 5. Decision: found, ambiguous or none by a logistic regression over the final scores.
 *
 * Layout: the target's points in the order of add_target(); sorted by cell (scan_match_index.c);
 * their quantized positions sorted by direction and strip (scan_match_positions.c). Both sorted
 * copies are built at the first match after the target changed. Beams are reduced to a
 * visibility profile in the frame of their part (visibility.c). The number of operations is
 * bounded: by the voting points of query and target, by the number of headings, and by fixed
 * numbers of candidates, iterations and points of each stage. Limits: positions farther than 256 cells of
 * two spacings apart are not searched. */
#include "src/base/build.h"

#include <string.h>

#include "src/scans/scan_match_shape.h"

enum { MAX_POINTS = 1 << 20, MAX_VIEWS = 4096, MAX_HYPOTHESES = 64, MAX_CANDIDATES = 1024 };

enum { WRITTEN_READINGS = 1604 }; /* readings of a scan in the thesis: 4 x 401 */

/* m: least spacing, so that cell coordinates fit their integers */
#define MIN_SPACING_M CAIRN_REAL(1e-3)

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_scan_match_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_scan_match_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_scan_match_params, field, __VA_ARGS__)
#define BELOW(field, ...)    CAIRN_NUMBER_BELOW(cairn_scan_match_params, field, __VA_ARGS__)

/* Default, lowest and highest value; the mode is the first. */
static const cairn_parameter rows[] = {
    INTEGER(mode, CAIRN_SCAN_MATCH_CORRELATIVE, CAIRN_SCAN_MATCH_CORRELATIVE,
            CAIRN_SCAN_MATCH_AS_WRITTEN_SEGMENTS),
    INTEGER(max_target, 2048, 1, MAX_POINTS),
    INTEGER(max_dense, 4096, 0, MAX_POINTS),
    INTEGER(max_views, 16, 0, MAX_VIEWS),
    INTEGER(max_query, 1024, 1, MAX_POINTS),
    INTEGER(max_hypotheses, 8, 1, MAX_HYPOTHESES),
    INTEGER(max_candidates, 128, 1, MAX_CANDIDATES),
    INTEGER(max_cells, SCAN_MATCH_MAX_CELLS, SCAN_MATCH_MIN_CELLS, SCAN_MATCH_MAX_CELLS),
    INTEGER(vote_once, 1, 0, 1),
    NUMBER(spacing, CAIRN_REAL(0.1), MIN_SPACING_M, CAIRN_SCAN_EXTENT),
    POSITIVE(min_sigma, CAIRN_REAL(0.01), 0, CAIRN_SCAN_EXTENT),
    BELOW(weak_ratio, CAIRN_REAL(0.001), 0, 1),
};
const cairn_parameters cairn_scan_match_parameters =
    CAIRN_PARAMETERS("scan_match", cairn_scan_match_params, rows);

/* The same without the mode, which a variant of it has. */
static const cairn_parameters variant_parameters =
    CAIRN_PARAMETERS_FROM("scan_match", cairn_scan_match_params, rows, 1);

cairn_scan_match_params cairn_scan_match_default(void)
{
    cairn_scan_match_params params;

    cairn_parameters_preset(&cairn_scan_match_parameters, &params);
    return params;
}

cairn_scan_match_params cairn_scan_match_as_written(void)
{
    cairn_scan_match_params params = cairn_scan_match_default();

    params.mode = CAIRN_SCAN_MATCH_AS_WRITTEN;
    params.max_target = 3 * WRITTEN_READINGS;
    params.max_query = WRITTEN_READINGS;
    params.max_dense = params.max_views = 0;
    params.max_hypotheses = params.max_candidates = 1;
    return params;
}

cairn_status cairn_scan_match_check(const cairn_scan_match_params *params,
                                    cairn_object_fault *fault)
{
    return cairn_parameters_check(params != NULL && scan_match_is_variant(params->mode)
                                      ? &variant_parameters
                                      : &cairn_scan_match_parameters,
                                  params, fault);
}

/* The arrays of the shape modes and their sequence; NULL from a counting pool. */
static scan_match_shape *build_shape(cairn_pool *pool, const cairn_scan_match_params *params)
{
    cairn_sequence_params sequence = {
        .kind = CAIRN_SEQUENCE_LCS,
        .max_first = params->max_query,
        .max_second = params->max_target,
    };
    scan_match_shape *shape = cairn_object_take(pool, sizeof *shape);

    CAIRN_TAKE(shape, pool, target, params->max_target);
    CAIRN_TAKE(shape, pool, query, params->max_query);
    CAIRN_TAKE(shape, pool, target_part, params->max_target);
    CAIRN_TAKE(shape, pool, rotated_query, params->max_query);
    CAIRN_TAKE(shape, pool, pairs, params->max_query);
    CAIRN_TAKE(shape, pool, segments, params->max_query + 1);
    CAIRN_TAKE_OBJECT(shape, pool, sequence, sequence, &sequence);
    return shape;
}

/* The object and its arrays, of which the modes by shape have no votes; NULL from a counting
 * pool. */
static cairn_scan_match *build(cairn_pool *pool, const cairn_scan_match_params *params)
{
    int votes = params->mode == CAIRN_SCAN_MATCH_CORRELATIVE;
    size_t target = (size_t)params->max_target, dense = (size_t)params->max_dense,
           cells = votes ? (size_t)params->max_cells : 0;
    cairn_scan_match *match = cairn_object_take(pool, sizeof *match);
    scan_match_shape *shape = NULL;

    CAIRN_TAKE(match, pool, target, target);
    CAIRN_TAKE(match, pool, dense, dense);
    CAIRN_TAKE(match, pool, dense_index.points, dense);
    CAIRN_TAKE(match, pool, dense_index.start, cairn_scan_match_index_cells(params->max_dense) + 1);
    CAIRN_TAKE(match, pool, views, params->max_views);
    CAIRN_TAKE(match, pool, query_view, 1);
    CAIRN_TAKE(match, pool, index.points, target);
    CAIRN_TAKE(match, pool, index.start, cairn_scan_match_index_cells(params->max_target) + 1);
    CAIRN_TAKE(match, pool, by_direction, votes ? target : 0);
    CAIRN_TAKE(match, pool, query_angle, votes ? SCAN_MATCH_MAX_QUERY_POINTS : 0);
    CAIRN_TAKE(match, pool, votes.cell, cells);
    CAIRN_TAKE(match, pool, votes.touched, cells);
    CAIRN_TAKE(match, pool, candidates, params->max_candidates);
    CAIRN_TAKE(match, pool, hypotheses, params->max_candidates);
    if (!votes)
        shape = build_shape(pool, params);
    if (match != NULL) {
        match->params = *params;
        match->shape = shape;
        memset(match->votes.cell, 0, cells * sizeof *match->votes.cell);
        cairn_scan_match_clear_target(match);
    }
    return match;
}

CAIRN_OBJECT(scan_match, scan_match, build);

cairn_scan_match_part cairn_scan_match_part_of(const cairn_scan_view *view)
{
    cairn_scan_match_part part = {
        .points = view->points,
        .dense = NULL,
        .beams = view->beams,
        .count = view->point_count,
        .dense_count = 0,
        .beam_count = view->beam_count,
    };

    return part;
}

static void cancel(cairn_scan_match *match)
{
    cairn_scan_match_clear_votes(match);
    match->state = SCAN_MATCH_IDLE;
    memset(&match->resume, 0, sizeof match->resume);
    match->units_charged = match->parts_ahead = 0;
    memset(&match->result, 0, sizeof match->result);
}

void cairn_scan_match_clear_target(cairn_scan_match *match)
{
    cancel(match);
    match->target_count = match->dense_count = match->view_count = match->part_count = 0;
    match->lacks_dense = 0;
    match->is_indexed = 0;
    if (match->shape != NULL)
        match->shape->overlap_gate = 0;
    match->target_low.x = match->target_low.y = CAIRN_SCAN_EXTENT;
    match->target_high.x = match->target_high.y = -CAIRN_SCAN_EXTENT;
    match->target_sum.x = match->target_sum.y = 0;
}

/* ---- Target and query ---- */

static int is_array(const void *array, int32_t count)
{
    return count >= 0 && (array != NULL || count == 0);
}

static cairn_status check_part(const cairn_scan_match_part *part, cairn_pose pose,
                               cairn_fault *fault)
{
    cairn_status status;

    if (!is_array(part->points, part->count) || !is_array(part->dense, part->dense_count) ||
        !is_array(part->beams, part->beam_count))
        return cairn_refuse(fault, -1, "a negative count, or no array", CAIRN_BAD_ARGUMENT);
    status = cairn_pose_check(pose, CAIRN_SCAN_EXTENT, fault);
    if (status == CAIRN_OK)
        status = cairn_oriented_points_check(part->points, part->count, CAIRN_SCAN_EXTENT, fault);
    if (status == CAIRN_OK)
        status =
            cairn_oriented_points_check(part->dense, part->dense_count, CAIRN_SCAN_EXTENT, fault);
    if (status == CAIRN_OK)
        status = cairn_scan_beams_check(part->beams, part->beam_count, CAIRN_SCAN_EXTENT, fault);
    return status;
}

/* Makes the visibility profile of a part from its beams, in steps of the longest one; returns 0
 * when no range is known. */
static int32_t make_view(scan_match_view *view, const cairn_scan_match_part *part)
{
    cairn_visibility *visibility = &view->visibility;
    cairn_real longest = 0;
    int32_t first = 0;

    while (first < part->beam_count && part->beams[first].kind == CAIRN_SCAN_BEAM_UNKNOWN)
        first++;
    for (int32_t i = first; i < part->beam_count; i++)
        if (part->beams[i].kind != CAIRN_SCAN_BEAM_UNKNOWN)
            longest = cairn_max(longest, cairn_vec2_norm_squared(cairn_vec2_sub(
                                             part->beams[i].to, part->beams[first].from)));
    if (!(longest > 0))
        return 0;
    memset(visibility, 0, sizeof *visibility);
    visibility->step = cairn_sqrt(longest) / CAIRN_VISIBILITY_STEPS;
    visibility->range = view->range;
    visibility->bins = CAIRN_VISIBILITY_BINS;
    cairn_visibility_fill(visibility, part->beams[first].from, part->beams, part->beam_count);
    return 1;
}

/* Copies a visibility profile that the caller keeps. */
static void copy_view(scan_match_view *view, const cairn_visibility *visibility)
{
    view->visibility = *visibility;
    view->visibility.range = view->range;
    view->visibility.surface = NULL;
    memcpy(view->range, visibility->range, sizeof view->range);
}

static cairn_status check_visibility(const cairn_visibility *visibility, cairn_fault *fault)
{
    if (visibility->range == NULL || visibility->bins != CAIRN_VISIBILITY_BINS)
        return cairn_refuse(fault, -1, "a visibility profile without CAIRN_VISIBILITY_BINS bins",
                            CAIRN_BAD_ARGUMENT);
    if (!cairn_vec2_is_finite(visibility->sensor) || !cairn_is_finite(visibility->step))
        return cairn_refuse(fault, -1, "a visibility profile is not finite", CAIRN_NOT_FINITE);
    if (!cairn_vec2_is_within(visibility->sensor, CAIRN_SCAN_EXTENT) || visibility->step <= 0 ||
        visibility->step > CAIRN_SCAN_EXTENT)
        return cairn_refuse(fault, -1, "a visibility profile is without step or too large",
                            CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

cairn_status cairn_scan_match_add_target(cairn_scan_match *match, const cairn_scan_match_part *part,
                                         cairn_pose target_part, cairn_fault *fault)
{
    cairn_transform transform;
    cairn_status status;

    if (match == NULL || part == NULL)
        return cairn_refuse(fault, -1, "no object or no part", CAIRN_BAD_ARGUMENT);
    if (match->state == SCAN_MATCH_RUNNING)
        return cairn_refuse(fault, -1, "a match is running", CAIRN_BAD_ARGUMENT);
    status = check_part(part, target_part, fault);
    if (status != CAIRN_OK)
        return status;
    if (part->count > match->params.max_target - match->target_count)
        return cairn_refuse(fault, -1, "more target points than max_target", CAIRN_FULL);
    if (match->params.max_dense > 0 &&
        part->dense_count > match->params.max_dense - match->dense_count)
        return cairn_refuse(fault, -1, "more dense target points than max_dense", CAIRN_FULL);
    if (part->beam_count > 0 && match->params.max_views > 0 &&
        match->view_count == match->params.max_views)
        return cairn_refuse(fault, -1, "more parts with beams than max_views", CAIRN_FULL);
    transform = cairn_transform_of(target_part);
    for (int32_t i = 0; i < part->count; i++) {
        cairn_oriented_point *p = &match->target[match->target_count];

        if (match->shape != NULL)
            match->shape->target_part[match->target_count] = match->part_count;
        match->target_count++;
        p->position = cairn_transform_point(transform, part->points[i].position);
        p->direction = cairn_transform_direction(transform, part->points[i].direction);
        match->target_low.x = cairn_min(match->target_low.x, p->position.x);
        match->target_low.y = cairn_min(match->target_low.y, p->position.y);
        match->target_high.x = cairn_max(match->target_high.x, p->position.x);
        match->target_high.y = cairn_max(match->target_high.y, p->position.y);
        match->target_sum = cairn_vec2_add(match->target_sum, p->position);
    }
    for (int32_t i = 0; i < part->dense_count && match->params.max_dense > 0; i++) {
        cairn_oriented_point *p = &match->dense[match->dense_count++];

        p->position = cairn_transform_point(transform, part->dense[i].position);
        p->direction = cairn_transform_direction(transform, part->dense[i].direction);
    }
    if (match->params.max_views > 0 && make_view(&match->views[match->view_count], part))
        match->views[match->view_count++].part_target = cairn_transform_inverse(transform);
    if (part->dense_count == 0 && part->count > 0)
        match->lacks_dense = 1;
    match->part_count++;
    match->is_indexed = 0;
    return CAIRN_OK;
}

cairn_status cairn_scan_match_add_view(cairn_scan_match *match, const cairn_visibility *visibility,
                                       cairn_pose target_view, cairn_fault *fault)
{
    scan_match_view *view;
    cairn_status status;

    if (match == NULL || visibility == NULL)
        return cairn_refuse(fault, -1, "no object or no profile", CAIRN_BAD_ARGUMENT);
    if (match->state == SCAN_MATCH_RUNNING)
        return cairn_refuse(fault, -1, "a match is running", CAIRN_BAD_ARGUMENT);
    status = check_visibility(visibility, fault);
    if (status == CAIRN_OK)
        status = cairn_pose_check(target_view, CAIRN_SCAN_EXTENT, fault);
    if (status != CAIRN_OK || match->params.max_views == 0)
        return status;
    if (match->view_count == match->params.max_views)
        return cairn_refuse(fault, -1, "more profiles than max_views", CAIRN_FULL);
    view = &match->views[match->view_count++];
    copy_view(view, visibility);
    view->part_target = cairn_transform_inverse(cairn_transform_of(target_view));
    return CAIRN_OK;
}

cairn_status cairn_scan_match_set_query_view(cairn_scan_match *match,
                                             const cairn_visibility *visibility, cairn_fault *fault)
{
    cairn_status status;

    if (match == NULL || visibility == NULL)
        return cairn_refuse(fault, -1, "no object or no profile", CAIRN_BAD_ARGUMENT);
    if (match->state == SCAN_MATCH_IDLE)
        return cairn_refuse(fault, -1, "no match was begun", CAIRN_BAD_ARGUMENT);
    status = check_visibility(visibility, fault);
    if (status != CAIRN_OK)
        return status;
    copy_view(match->query_view, visibility);
    match->query_has_view = 1;
    return CAIRN_OK;
}

/* Computes centroid, radius and extent of the query. */
static void measure_query(cairn_scan_match *match)
{
    const cairn_scan_match_part *q = &match->query;
    cairn_real n = (cairn_real)q->count, squares = 0;

    match->centroid.x = match->centroid.y = 0;
    match->query_extent = 0;
    for (int32_t i = 0; i < q->count; i++) {
        match->centroid =
            cairn_vec2_add(match->centroid, cairn_vec2_scale(q->points[i].position, 1 / n));
        match->query_extent =
            cairn_max(match->query_extent, cairn_vec2_norm(q->points[i].position));
    }
    for (int32_t i = 0; i < q->count; i++)
        squares += cairn_vec2_norm_squared(cairn_vec2_sub(q->points[i].position, match->centroid));
    match->radius = cairn_max(cairn_sqrt(squares / cairn_max(n, 1)), match->params.spacing);
}

/* Sets the prior from the window: the uniform distribution's variance, so that unobservable
 * directions stay at the start. */
static void set_window(cairn_scan_match *match, cairn_pose start,
                       const cairn_scan_match_window *window)
{
    const cairn_real share = CAIRN_REAL(0.577), least = CAIRN_REAL(0.1) * match->params.spacing;

    match->has_window = window != NULL;
    if (window == NULL)
        return;
    match->window = *window;
    match->start = start;
    match->prior.mean = start;
    match->prior.sigma_x = match->prior.sigma_y =
        cairn_max(share * cairn_min(window->distance, CAIRN_SCAN_EXTENT), least);
    match->prior.sigma_theta =
        cairn_max(share * cairn_min(window->angle, CAIRN_PI), CAIRN_REAL(0.01));
}

/* Validates and stores a query and its window; it is done when there is nothing to match. */
static cairn_status set_query(cairn_scan_match *match, const cairn_scan_match_part *query,
                              cairn_pose start, const cairn_scan_match_window *window,
                              cairn_fault *fault)
{
    cairn_status status = check_part(query, start, fault);

    if (status != CAIRN_OK)
        return status;
    if (query->count > match->params.max_query)
        return cairn_refuse(fault, -1, "more query points than max_query", CAIRN_FULL);
    cancel(match);
    memset(&match->measure, 0, sizeof match->measure);
    match->query = *query;
    match->query_has_view = make_view(match->query_view, query);
    match->candidate_count = match->hypothesis_count = 0;
    match->state = SCAN_MATCH_RUNNING;
    if (query->count == 0 || match->target_count == 0) {
        match->result.hypotheses = match->hypotheses;
        match->result.verdict = CAIRN_SCAN_MATCH_NONE;
        match->state = SCAN_MATCH_DONE;
        return CAIRN_OK;
    }
    measure_query(match);
    set_window(match, start, window);
    return CAIRN_OK;
}

cairn_status cairn_scan_match_begin(cairn_scan_match *match, const cairn_scan_match_part *query,
                                    cairn_pose start, const cairn_scan_match_window *window,
                                    cairn_fault *fault)
{
    cairn_status status;

    if (match == NULL || query == NULL)
        return cairn_refuse(fault, -1, "no object or no query", CAIRN_BAD_ARGUMENT);
    if (window != NULL && !(window->distance >= 0 && window->angle >= 0))
        return cairn_refuse(fault, -1, "a window is negative or not a number", CAIRN_BAD_ARGUMENT);
    if (window == NULL)
        start = cairn_pose_identity();
    status = set_query(match, query, start, window, fault);
    if (status != CAIRN_OK || match->state == SCAN_MATCH_DONE)
        return status;
    if (match->shape != NULL)
        cairn_scan_match_shape_begin(match);
    else
        cairn_scan_match_votes_begin(match);
    return CAIRN_OK;
}

cairn_status cairn_scan_match_begin_icp(cairn_scan_match *match, const cairn_scan_match_part *query,
                                        cairn_pose start, cairn_fault *fault)
{
    cairn_status status;

    if (match == NULL || query == NULL)
        return cairn_refuse(fault, -1, "no object or no query", CAIRN_BAD_ARGUMENT);
    if (!cairn_scan_match_is_as_written(match) || !cairn_scan_match_has_icp(match))
        return cairn_refuse(fault, -1, "the mode has no ICP of its own", CAIRN_BAD_ARGUMENT);
    status = set_query(match, query, start, NULL, fault);
    if (status != CAIRN_OK || match->state == SCAN_MATCH_DONE)
        return status;
    cairn_scan_match_shape_begin_icp(match, start);
    return CAIRN_OK;
}

cairn_scan_match_result cairn_scan_match_read(const cairn_scan_match *match)
{
    cairn_scan_match_result running = {
        .hypotheses = NULL,
        .count = 0,
        .verdict = CAIRN_SCAN_MATCH_RUNNING,
    };

    return match->state == SCAN_MATCH_DONE ? match->result : running;
}

cairn_scan_match_measure cairn_scan_match_measured(const cairn_scan_match *match)
{
    return match->measure;
}
