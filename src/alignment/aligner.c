/* aligner: joint alignment of many scans; the object, its input, steps and results.
 *
 * Method:
 * 1. aligner_neighbour.c: candidate pairs (neighbours) of scans.
 * 2. aligner_pairs.c: pairwise registration, hypotheses of relative poses.
 * 3. aligner_merge.c, aligner_cluster.c: agglomerative clustering by the most certain hypothesis.
 * 4. aligner_relocalize.c: relocalization of single scans against all others.
 * 5. aligner_joint.c, aligner_wall.c, aligner_covariance.c: joint least squares over all poses and
 *    shared walls, and covariances.
 * 6. aligner_translate.c: translation of scans along their weakly observable direction.
 * 7. aligner_shift.c: joint translations of groups of scans along the directions of the walls.
 * aligner_beams.c stores scans; aligner_scan.c evaluates pairs of scans; aligner_prior.c evaluates
 * the initial poses; aligner_query.c answers queries about the result.
 *
 * Layout: scans keep segments with the moments of their hits, points along them, and a visibility
 * profile. The phases are steps, and so are their parts (src/base/step.h); each operation is
 * charged before it is done, that of a pair of scans patch by patch. A scan is only compared with
 * its neighbours, the nearest by the initial poses, so that the cost is near linear in the scans of
 * one density.
 * Limits: a scan without a segment is not aligned. Two scans without a common surface or view are
 * connected through others only. Segments beyond the 255th of a scan are missing in its profile.
 * Source: joint treatment of all scans after Adluru 2008, chapter 7; free-space tests and growth by
 * competing hypotheses are original; robust weights after Geman and McClure 1987. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/aligner_work.h"

enum { MAX_SCANS = 1 << 16, MAX_COUNT = 1 << 24, MIN_CELLS = 64 };

#define INTEGER(field, is, from, to) CAIRN_INTEGER(cairn_aligner_params, field, is, from, to)
#define POSITIVE(field, is, to)      CAIRN_NUMBER_ABOVE(cairn_aligner_params, field, is, 0, to)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_scans, 64, 1, MAX_SCANS),
    INTEGER(max_segments, 1024, 1, MAX_COUNT),
    INTEGER(max_short_segments, 256, 0, MAX_COUNT),
    INTEGER(max_points, 4096, 1, MAX_COUNT),
    INTEGER(max_hypotheses, 1536, 1, MAX_COUNT),
    INTEGER(max_fill, 2048, 1, MAX_COUNT),
    INTEGER(max_cells, 25600, MIN_CELLS, MAX_COUNT),
    POSITIVE(max_initial_error, CAIRN_REAL(0.6), CAIRN_REAL_MAX),
    POSITIVE(max_initial_angle_error, 35 * CAIRN_PI / 180, CAIRN_PI),
    POSITIVE(max_range, 30, CAIRN_MAX_MAGNITUDE),
    POSITIVE(range_sigma, CAIRN_REAL(0.01), CAIRN_REAL_MAX),
    CAIRN_NUMBER(cairn_aligner_params, free_space_penalty, CAIRN_REAL(1.5), 0, CAIRN_REAL_MAX),
    INTEGER(oriented, 1, 0, 1),
    INTEGER(max_relocalizations, 2, 0, INT32_MAX),
    INTEGER(max_iterations, 10, 0, INT32_MAX),
    POSITIVE(min_log_likelihood_ratio, 1, CAIRN_REAL_MAX),
    POSITIVE(observable_sigma, CAIRN_REAL(0.05), CAIRN_REAL_MAX),
    POSITIVE(observable_sigma_theta, CAIRN_PI / 180, CAIRN_REAL_MAX),
};
const cairn_parameters cairn_aligner_parameters =
    CAIRN_PARAMETERS("aligner", cairn_aligner_params, rows);

cairn_aligner_params cairn_aligner_default(void)
{
    cairn_aligner_params params;

    cairn_parameters_preset(&cairn_aligner_parameters, &params);
    return params;
}

static cairn_block_solver_params solver_params(const cairn_aligner_params *p)
{
    int32_t segments = p->max_segments + p->max_short_segments;
    cairn_block_solver_params params = {
        .max_poses = p->max_scans + (segments + 1) / 2,
        .max_links = segments,
        .max_fill = p->max_fill,
    };

    return params;
}

cairn_status cairn_aligner_check(const cairn_aligner_params *params, cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_aligner_parameters, params, fault);
    cairn_block_solver_params solver;

    if (status != CAIRN_OK)
        return status;
    solver = solver_params(params);
    return cairn_block_solver_check(&solver, fault);
}

/* Returns the bytes of an array, rounded up; the sum of two cannot overflow. */
static size_t bytes_of(size_t count, size_t size)
{
    return count > SIZE_MAX / 4 / size
               ? SIZE_MAX / 4
               : (count * size + CAIRN_ALIGN - 1) / CAIRN_ALIGN * CAIRN_ALIGN;
}

/* Raster and walls share memory: walls are built when relocalization has ended. */
static void take_shared(cairn_aligner *aligner, cairn_pool *pool, size_t segments, size_t cells)
{
    size_t drawn = bytes_of(cells, sizeof *aligner->cells),
           built = bytes_of(segments, sizeof *aligner->walls);
    size_t raster = drawn + bytes_of(cells / ALIGNER_CELLS_PER_SHIFT, sizeof *aligner->votes);
    size_t walls = built + bytes_of(segments, sizeof *aligner->order);
    unsigned char *shared = cairn_pool_take(pool, raster > walls ? raster : walls, 1);

    if (shared == NULL)
        return;
    aligner->cells = (void *)shared;
    aligner->votes = (void *)(shared + drawn);
    aligner->walls = (void *)shared;
    aligner->order = (void *)(shared + built);
}

/* Returns the number of hypotheses whose memory holds as many pairs of joint translations, too. */
static size_t shared_hypotheses(size_t hypotheses)
{
    size_t pair = sizeof(aligner_shift_pair) + sizeof(min_cut_edge),
           needed = (hypotheses * pair - 1) / sizeof(aligner_hypothesis) + 1;

    return needed > hypotheses ? needed : hypotheses;
}

/* The pairs of joint translations have the memory of the hypotheses, which merging has used. */
static void share_hypotheses(cairn_aligner *aligner)
{
    aligner->shift.max_pairs = aligner->params.max_hypotheses;
    aligner->shift_pairs = (void *)aligner->hypotheses;
    aligner->shift_edges = (void *)(aligner->shift_pairs + aligner->shift.max_pairs);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_aligner *build(cairn_pool *pool, const cairn_aligner_params *params)
{
    size_t scans = (size_t)params->max_scans, points = (size_t)params->max_points,
           hypotheses = (size_t)params->max_hypotheses,
           segments = (size_t)params->max_segments + (size_t)params->max_short_segments;
    cairn_block_solver_params solver = solver_params(params);
    cairn_aligner *aligner = cairn_object_take(pool, sizeof *aligner);

    CAIRN_TAKE(aligner, pool, scans, scans);
    CAIRN_TAKE(aligner, pool, poses, scans + 1);
    CAIRN_TAKE(aligner, pool, views, scans);
    CAIRN_TAKE(aligner, pool, clusters, scans + 1);
    CAIRN_TAKE(aligner, pool, prior_sums, scans + 1);
    CAIRN_TAKE(aligner, pool, segments, segments);
    CAIRN_TAKE(aligner, pool, points, points);
    CAIRN_TAKE(aligner, pool, neighbours, scans * ALIGNER_MAX_NEIGHBOURS);
    CAIRN_TAKE(aligner, pool, patches, points / ALIGNER_PATCH_POINTS + scans);
    CAIRN_TAKE(aligner, pool, hypotheses, shared_hypotheses(hypotheses));
    CAIRN_TAKE(aligner, pool, links, scans);
    CAIRN_TAKE(aligner, pool, shift_nodes, scans);
    CAIRN_TAKE(aligner, pool, best_of_block, hypotheses / ALIGNER_HYPOTHESIS_BLOCK + 1);
    take_shared(aligner, pool, segments, (size_t)params->max_cells);
    CAIRN_TAKE(aligner, pool, rhs, 3 * (scans + (segments + 1) / 2));
    CAIRN_TAKE(aligner, pool, results, scans);
    CAIRN_TAKE_OBJECT(aligner, pool, solver, block_solver, &solver);
    if (aligner != NULL) {
        aligner->params = *params;
        aligner->result.anchor = -1;
        share_hypotheses(aligner);
    }
    return aligner;
}

CAIRN_OBJECT(aligner, aligner, build);

/* ---- Input ---- */

/* Sets a scan's result to its initial pose. */
static void set_initial_result(cairn_aligner *aligner, int32_t i)
{
    cairn_aligner_pose *r = &aligner->results[i];

    memset(r, 0, sizeof *r);
    r->map_scan = aligner->scans[i].initial;
    cairn_aligner_set_initial_covariances(
        r, 2 * aligner->params.max_initial_error * aligner->params.max_initial_error / 3,
        2 * aligner->params.max_initial_angle_error * aligner->params.max_initial_angle_error / 3);
    r->component = i;
}

/* Drops the steps that are under way, and starts an alignment (1) or none (0). */
static void set_running(cairn_aligner *aligner, int32_t is_running)
{
    memset(&aligner->resume, 0, sizeof aligner->resume);
    aligner->units_charged = aligner->has_ended = 0;
    aligner->evaluation.is_active = aligner->relax.is_active = 0;
    aligner->is_running = is_running;
}

/* Discards the result and ends an alignment. */
static void discard_result(cairn_aligner *aligner)
{
    set_running(aligner, 0);
    memset(&aligner->result, 0, sizeof aligner->result);
    aligner->result.anchor = -1;
    for (int32_t i = 0; i < aligner->scan_count; i++)
        set_initial_result(aligner, i);
}

cairn_status cairn_aligner_add_scan(cairn_aligner *aligner, const cairn_scan_view *view,
                                    cairn_pose map_scan, cairn_fault *fault)
{
    cairn_status status;

    if (aligner == NULL || view == NULL)
        return cairn_refuse(fault, -1, "no aligner or no scan", CAIRN_BAD_ARGUMENT);
    status = cairn_scan_view_check(view, fault);
    if (status == CAIRN_OK)
        status = cairn_pose_check(map_scan, CAIRN_MAX_MAGNITUDE, fault);
    if (status != CAIRN_OK)
        return status;
    if (aligner->scan_count == aligner->params.max_scans)
        return cairn_refuse(fault, -1, "more than max_scans scans", CAIRN_FULL);
    if (view->segment_count >
        aligner->params.max_segments - (aligner->segment_count - aligner->short_segment_count))
        return cairn_refuse(fault, -1, "more than max_segments segments", CAIRN_FULL);
    if (view->point_count > aligner->params.max_points - aligner->point_count)
        return cairn_refuse(fault, -1, "more than max_points points", CAIRN_FULL);
    map_scan.theta = cairn_wrap_angle(map_scan.theta);
    cairn_aligner_fill_scan(aligner, view, map_scan);
    discard_result(aligner);
    return cairn_refuse(fault, -1, NULL, CAIRN_OK);
}

cairn_status cairn_aligner_set_initial_pose(cairn_aligner *aligner, int32_t scan,
                                            cairn_pose map_scan)
{
    cairn_status status;

    if (aligner == NULL || scan < 0 || scan >= aligner->scan_count)
        return CAIRN_BAD_ARGUMENT;
    status = cairn_pose_check(map_scan, CAIRN_MAX_MAGNITUDE, NULL);
    if (status != CAIRN_OK)
        return status;
    map_scan.theta = cairn_wrap_angle(map_scan.theta);
    aligner->scans[scan].initial = map_scan;
    if (cairn_aligner_running(aligner) || aligner->result.units > 0)
        discard_result(aligner);
    else
        set_initial_result(aligner, scan);
    return CAIRN_OK;
}

void cairn_aligner_clear(cairn_aligner *aligner)
{
    aligner->scan_count = aligner->segment_count = aligner->short_segment_count = 0;
    aligner->point_count = aligner->patch_count = 0;
    discard_result(aligner);
}

/* ---- Steps ---- */

cairn_status cairn_aligner_begin(cairn_aligner *aligner)
{
    if (aligner == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (aligner->scan_count == 0)
        return CAIRN_EMPTY;
    memset(&aligner->result, 0, sizeof aligner->result);
    aligner->result.anchor = -1;
    aligner->hypothesis_count = aligner->wall_count = 0;
    aligner->change_count = aligner->reported_commit = 0;
    cairn_aligner_begin_clusters(aligner);
    aligner->relocalization_rounds = aligner->translation_passes = aligner->is_warm_start = 0;
    set_running(aligner, 1);
    return CAIRN_OK;
}

cairn_status cairn_aligner_begin_warm(cairn_aligner *aligner, const cairn_pose *map_scan)
{
    cairn_status status = CAIRN_OK;

    if (aligner == NULL || map_scan == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!aligner->has_ended)
        return CAIRN_EMPTY;
    for (int32_t i = 0; i < aligner->scan_count && status == CAIRN_OK; i++)
        if (!aligner->scans[i].was_anchored)
            status = cairn_pose_check(map_scan[i], CAIRN_MAX_MAGNITUDE, NULL);
    if (status != CAIRN_OK)
        return status;
    for (int32_t i = 0; i < aligner->scan_count; i++)
        if (!aligner->scans[i].was_anchored) {
            aligner->scans[i].initial = map_scan[i];
            aligner->scans[i].initial.theta = cairn_wrap_angle(map_scan[i].theta);
        }
    for (int32_t c = 0; c <= aligner->scan_count; c++)
        aligner->prior_sums[c].stamp = -1; /* computed for the previous initial poses */
    aligner->hypothesis_count = 0;
    aligner->relocalization_rounds = aligner->translation_passes = 0;
    aligner->is_warm_start = 1;
    set_running(aligner, 1);
    return CAIRN_OK;
}

/* Returns 1 when a warm start has changed nothing: the former result stays. */
static int is_unchanged(const cairn_aligner *aligner)
{
    return aligner->is_warm_start && aligner->result.verdict != CAIRN_ALIGNER_RUNNING;
}

/* Starts what follows a round of relocalization: at first all scans are relaxed, later those that
 * were relocalized, and their neighbours. */
static void end_relocalization(cairn_aligner *aligner)
{
    if (aligner->changed_scans > 0)
        aligner->result.verdict = CAIRN_ALIGNER_RUNNING;
    if (!is_unchanged(aligner))
        cairn_aligner_begin_relax(aligner, cairn_aligner_largest(aligner), CAIRN_REAL(0.07), 5,
                                  !aligner->is_warm_start && aligner->relocalization_rounds == 1);
}

/* Returns 1 while rounds of relocalization follow. */
static int is_relocalizing(const cairn_aligner *aligner)
{
    return aligner->changed_scans > 0 &&
           aligner->relocalization_rounds < aligner->params.max_relocalizations;
}

/* The alignment: see Method in the head of this file. */
static int align(cairn_aligner *aligner, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(aligner->resume.align);
    if (!aligner->is_warm_start) {
        CAIRN_STEP_RUN(aligner, resume.align, budget, cairn_aligner_find_neighbours);
        CAIRN_STEP_RUN(aligner, resume.align, budget, cairn_aligner_register_pairs);
        CAIRN_STEP_RUN(aligner, resume.align, budget, cairn_aligner_merge);
    }
    for (;;) {
        CAIRN_STEP_RUN(aligner, resume.align, budget, cairn_aligner_relocalize);
        end_relocalization(aligner);
        CAIRN_STEP_RUN(aligner, resume.align, budget, cairn_aligner_relax);
        if (!is_relocalizing(aligner))
            break;
        CAIRN_STEP_RUN(aligner, resume.align, budget, cairn_aligner_merge);
    }
    if (!is_unchanged(aligner))
        CAIRN_STEP_RUN(aligner, resume.align, budget, cairn_aligner_solve_jointly);
    aligner->has_ended = 1;
    aligner->is_running = 0;
    CAIRN_STEP_END(aligner->resume.align);
}

static cairn_status run(cairn_aligner *aligner, cairn_budget *budget, int32_t stops_at_commits)
{
    int32_t left;
    int is_done;

    if (aligner == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!aligner->is_running)
        return CAIRN_OK;
    if (budget->left <= 0)
        return CAIRN_MORE;
    left = budget->left;
    aligner->stops_at_commits = stops_at_commits;
    is_done = align(aligner, budget);
    aligner->result.units += left - budget->left;
    if (is_done)
        return CAIRN_OK;
    if (budget->left <= 0)
        return CAIRN_MORE;
    aligner->reported_commit = aligner_commits(aligner);
    return CAIRN_OK;
}

cairn_status cairn_aligner_step(cairn_aligner *aligner, cairn_budget *budget)
{
    return run(aligner, budget, 0);
}

cairn_status cairn_aligner_iterate(cairn_aligner *aligner, cairn_budget *budget)
{
    return run(aligner, budget, 1);
}

int32_t cairn_aligner_running(const cairn_aligner *aligner)
{
    return aligner->is_running;
}

/* ---- Results ---- */

int32_t cairn_aligner_scan_count(const cairn_aligner *aligner)
{
    return aligner->scan_count;
}

cairn_aligner_result cairn_aligner_read(const cairn_aligner *aligner)
{
    return aligner->result;
}

cairn_aligner_pose cairn_aligner_pose_of(const cairn_aligner *aligner, int32_t scan)
{
    cairn_aligner_pose none;

    memset(&none, 0, sizeof none);
    return scan >= 0 && scan < aligner->scan_count ? aligner->results[scan] : none;
}

cairn_pose cairn_aligner_current_pose(const cairn_aligner *aligner, int32_t scan, int32_t *part)
{
    cairn_transform gauge;
    int32_t known = scan >= 0 && scan < aligner->scan_count, own;

    if (part != NULL)
        *part = known ? scan : -1;
    if (!known)
        return cairn_pose_identity();
    own = aligner->scans[scan].cluster;
    if (!cairn_aligner_running(aligner) &&
        aligner->result.verdict == CAIRN_ALIGNER_RUNNING) /* not begun */
        return aligner->results[scan].map_scan;
    if (part != NULL && own < aligner->scan_count)
        *part = own;
    if (!cairn_aligner_running(aligner))
        return aligner->results[scan].map_scan;
    gauge = cairn_aligner_gauge(aligner, own);
    return cairn_pose_of(cairn_transform_compose(gauge, aligner->poses[scan]));
}
