/* Alignment of many scans at once.
 *
 * Method: aligner_partner.c finds which scans are held against which, aligner_pairs.c relative
 * poses of pairs of them, aligner_merge.c merges clusters by the surest of these, aligner_cluster.c
 * looks at two clusters, aligner_repair.c looks for single scans in all the rest, aligner_joint.c
 * solves for all poses and shared walls (aligner_wall.c), and aligner_slide.c moves along their
 * walls the scans that nothing else holds. aligner_beams.c keeps scans, aligner_scan.c says what
 * two of them tell of their relative pose.
 *
 * Layout: scans keep segments with the moments of their hits, points along them, and a table of
 * bearings. The work is a sequence of items, each of which charges its units; a debt is paid by the
 * budgets that follow. A scan is only ever held against its partners, the ones nearest to it by the
 * initial poses (aligner_partner.c), so that the cost is near linear in the scans of one density.
 *
 * Limits: a scan without a segment is not aligned. Two scans that share neither a surface nor a
 * view are joined by others only. Segments beyond the 255th of a scan are not seen in its table.
 *
 * Source: the field of all scans at once after Adluru 2008, chapter 7; look-ups in free space
 * and the growth by rival hypotheses are this room's own; robust weights after Geman and McClure
 * 1987. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/aligner_work.h"

enum { MAX_SCANS = 1 << 16, MAX_COUNT = 1 << 24, LEAST_CELLS = 64 };

#define EXTENT CAIRN_REAL(1e6)

cairn_aligner_params cairn_aligner_default(void)
{
    cairn_aligner_params params = {64,
                                   1024,
                                   256,
                                   4096,
                                   1536,
                                   2048,
                                   25600,
                                   CAIRN_REAL(0.6),
                                   35 * CAIRN_PI / 180,
                                   30,
                                   CAIRN_REAL(0.01),
                                   CAIRN_REAL(1.5),
                                   1,
                                   2,
                                   10,
                                   1,
                                   CAIRN_REAL(0.05),
                                   CAIRN_PI / 180};
    return params;
}

static int is_positive(cairn_real value)
{
    return value > 0 && value <= CAIRN_REAL_MAX;
}

static int is_capacity(int32_t count, int32_t most)
{
    return count >= 1 && count <= most;
}

static int params_are_good(const cairn_aligner_params *p)
{
    return p != NULL && is_capacity(p->max_scans, MAX_SCANS) &&
           is_capacity(p->max_segments, MAX_COUNT) && p->max_stubs >= 0 &&
           p->max_stubs <= MAX_COUNT && is_capacity(p->max_points, MAX_COUNT) &&
           is_capacity(p->max_hypotheses, MAX_COUNT) && is_capacity(p->max_fill, MAX_COUNT) &&
           is_capacity(p->max_cells, MAX_COUNT) && p->max_cells >= LEAST_CELLS &&
           is_positive(p->spread) && is_positive(p->spread_angle) && p->spread_angle <= CAIRN_PI &&
           is_positive(p->reach) && p->reach <= EXTENT && is_positive(p->sigma) &&
           p->contradiction >= 0 && p->contradiction <= CAIRN_REAL_MAX && p->max_repairs >= 0 &&
           p->max_rounds >= 0 && is_positive(p->least_evidence) && is_positive(p->observable) &&
           is_positive(p->observable_angle);
}

static cairn_block_solver_params solver_params(const cairn_aligner_params *p)
{
    int32_t segments = p->max_segments + p->max_stubs;
    cairn_block_solver_params params = {p->max_scans + (segments + 1) / 2, segments, p->max_fill};

    return params;
}

/* Bytes of an array, rounded up; those of two such cannot overflow. */
static size_t bytes_of(size_t count, size_t size)
{
    return count > SIZE_MAX / 4 / size
               ? SIZE_MAX / 4
               : (count * size + CAIRN_ALIGN - 1) / CAIRN_ALIGN * CAIRN_ALIGN;
}

/* The walls come when scans are no longer looked for: they lie where the raster was. */
static void carve_shared(cairn_aligner *x, cairn_pool *pool, size_t segments, size_t cells)
{
    size_t drawn = bytes_of(cells, sizeof *x->cells), built = bytes_of(segments, sizeof *x->walls);
    size_t raster = drawn + bytes_of(cells / ALIGNER_VOTES, sizeof *x->votes);
    size_t walls = built + bytes_of(segments, sizeof *x->order);
    unsigned char *shared = cairn_pool_take(pool, raster > walls ? raster : walls, 1);

    if (shared == NULL)
        return;
    x->cells = (void *)shared;
    x->votes = (void *)(shared + drawn);
    x->walls = (void *)shared;
    x->order = (void *)(shared + built);
}

static cairn_aligner *carve(cairn_pool *pool, const cairn_aligner_params *p)
{
    size_t scans = (size_t)p->max_scans, segments = (size_t)p->max_segments + (size_t)p->max_stubs;
    cairn_aligner *made = cairn_pool_take_one(pool, sizeof *made), arrays;

    memset(&arrays, 0, sizeof arrays);
    arrays.scans = cairn_pool_take(pool, scans, sizeof *arrays.scans);
    arrays.poses = cairn_pool_take(pool, scans + 1, sizeof *arrays.poses);
    arrays.tables = cairn_pool_take(pool, scans, sizeof *arrays.tables);
    arrays.clusters = cairn_pool_take(pool, scans + 1, sizeof *arrays.clusters);
    arrays.fits = cairn_pool_take(pool, scans + 1, sizeof *arrays.fits);
    arrays.segments = cairn_pool_take(pool, segments, sizeof *arrays.segments);
    arrays.points = cairn_pool_take(pool, (size_t)p->max_points, sizeof *arrays.points);
    arrays.partners = cairn_pool_take(pool, scans * ALIGNER_PARTNERS, sizeof *arrays.partners);
    arrays.patches = cairn_pool_take(pool, (size_t)p->max_points / ALIGNER_PATCH + scans,
                                     sizeof *arrays.patches);
    arrays.hypotheses = cairn_pool_take(pool, (size_t)p->max_hypotheses, sizeof *arrays.hypotheses);
    arrays.links = cairn_pool_take(pool, scans, sizeof *arrays.links);
    arrays.surest =
        cairn_pool_take(pool, (size_t)p->max_hypotheses / ALIGNER_BLOCK + 1, sizeof *arrays.surest);
    carve_shared(&arrays, pool, segments, (size_t)p->max_cells);
    arrays.rhs = cairn_pool_take(pool, 3 * (scans + (segments + 1) / 2), sizeof *arrays.rhs);
    arrays.bearings = cairn_pool_take(pool, ALIGNER_BINS, sizeof *arrays.bearings);
    arrays.results = cairn_pool_take(pool, scans, sizeof *arrays.results);
    if (made != NULL)
        *made = arrays;
    return made;
}

size_t cairn_aligner_memory(const cairn_aligner_params *params)
{
    cairn_block_solver_params solver;
    cairn_pool counting;

    if (!params_are_good(params))
        return 0;
    solver = solver_params(params);
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    cairn_pool_count(&counting, cairn_block_solver_memory(&solver));
    return cairn_pool_counted(&counting);
}

/* The middles of the bins on the diamond. */
static void fill_bearings(cairn_vec2 *bearings)
{
    for (int32_t bin = 0; bin < ALIGNER_BINS; bin++) {
        cairn_real place = ((cairn_real)bin + CAIRN_REAL(0.5)) * 4 / ALIGNER_BINS;
        cairn_vec2 p;

        p.x = cairn_abs(place - 2) - 1;
        p.y = place < 2 ? 1 - cairn_abs(p.x) : cairn_abs(p.x) - 1;
        bearings[bin] = cairn_vec2_unit(p);
    }
}

cairn_status cairn_aligner_create(cairn_aligner **aligner, cairn_pool *pool,
                                  const cairn_aligner_params *params)
{
    size_t need = cairn_aligner_memory(params);
    cairn_block_solver_params solver;
    cairn_aligner *made;

    if (aligner == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    made->params = *params;
    made->phase = ALIGNER_DONE;
    made->result.anchor = -1;
    fill_bearings(made->bearings);
    solver = solver_params(params);
    *aligner = made;
    return cairn_block_solver_create(&made->solver, pool, &solver);
}

/* ---- Input ---- */

static cairn_status refuse(cairn_fault *fault, int32_t index, const char *what, cairn_status status)
{
    if (fault != NULL) {
        fault->index = index;
        fault->what = what;
    }
    return status;
}

static int is_finite(cairn_vec2 v)
{
    return cairn_is_finite(v.x) && cairn_is_finite(v.y);
}

static int is_near(cairn_vec2 v)
{
    return cairn_abs(v.x) <= EXTENT && cairn_abs(v.y) <= EXTENT;
}

static cairn_status check_arrays(const cairn_scan_view *view, cairn_fault *fault)
{
    if (view->beam_count < 0 || view->segment_count < 0 || view->point_count < 0)
        return refuse(fault, -1, "a count is below 0", CAIRN_BAD_ARGUMENT);
    if ((view->beam_count > 0 && view->beams == NULL) ||
        (view->point_count > 0 && view->points == NULL) ||
        (view->segment_count > 0 && (view->segments == NULL || view->first_point == NULL)))
        return refuse(fault, -1, "a count without its array", CAIRN_BAD_ARGUMENT);
    if (view->point_count > 0 && view->segment_count == 0)
        return refuse(fault, 0, "a point without a segment", CAIRN_BAD_ARGUMENT);
    for (int32_t i = 0; i < view->segment_count; i++)
        if (view->first_point[i] > view->first_point[i + 1] ||
            (i == 0 && view->first_point[0] != 0))
            return refuse(fault, i, "first_point does not rise from 0", CAIRN_BAD_ARGUMENT);
    if (view->segment_count > 0 && view->first_point[view->segment_count] != view->point_count)
        return refuse(fault, view->segment_count, "first_point does not end at point_count",
                      CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

static cairn_status check_coordinates(const cairn_scan_view *view, cairn_fault *fault)
{
    if (!is_finite(view->sensor))
        return refuse(fault, -1, "the sensor's position is not finite", CAIRN_NOT_FINITE);
    if (!is_near(view->sensor))
        return refuse(fault, -1, "the sensor is farther than 1e6 m", CAIRN_BAD_ARGUMENT);
    for (int32_t i = 0; i < view->segment_count; i++) {
        if (!is_finite(view->segments[i].a) || !is_finite(view->segments[i].b))
            return refuse(fault, i, "a segment is not finite", CAIRN_NOT_FINITE);
        if (!is_near(view->segments[i].a) || !is_near(view->segments[i].b))
            return refuse(fault, i, "a segment ends farther than 1e6 m", CAIRN_BAD_ARGUMENT);
    }
    for (int32_t i = 0; i < view->point_count; i++) {
        if (!is_finite(view->points[i].position))
            return refuse(fault, i, "a point is not finite", CAIRN_NOT_FINITE);
        if (!is_near(view->points[i].position))
            return refuse(fault, i, "a point is farther than 1e6 m", CAIRN_BAD_ARGUMENT);
    }
    for (int32_t i = 0; i < view->beam_count; i++) {
        if (!is_finite(view->beams[i].from) || !is_finite(view->beams[i].to))
            return refuse(fault, i, "a beam is not finite", CAIRN_NOT_FINITE);
        if (!is_near(view->beams[i].from) || !is_near(view->beams[i].to))
            return refuse(fault, i, "a beam ends farther than 1e6 m", CAIRN_BAD_ARGUMENT);
    }
    return CAIRN_OK;
}

/* Results as long as there are no better ones. */
static void show_initial(cairn_aligner *x, int32_t i)
{
    cairn_aligner_pose *r = &x->results[i];

    memset(r, 0, sizeof *r);
    r->map_scan = x->scans[i].initial;
    r->covariance[0] = r->covariance[4] = 2 * x->params.spread * x->params.spread / 3;
    r->covariance[8] = 2 * x->params.spread_angle * x->params.spread_angle / 3;
    r->part = i;
}

/* Ends an alignment. */
static void forget_result(cairn_aligner *x)
{
    x->phase = ALIGNER_DONE;
    x->has_ended = 0;
    x->debt = 0;
    x->look.active = x->relax.active = 0;
    memset(&x->result, 0, sizeof x->result);
    x->result.anchor = -1;
    for (int32_t i = 0; i < x->scan_count; i++)
        show_initial(x, i);
}

cairn_status cairn_aligner_add_scan(cairn_aligner *aligner, const cairn_scan_view *view,
                                    cairn_pose map_scan, cairn_fault *fault)
{
    cairn_vec2 place = {map_scan.x, map_scan.y};
    cairn_status status;

    if (aligner == NULL || view == NULL)
        return refuse(fault, -1, "no aligner or no scan", CAIRN_BAD_ARGUMENT);
    status = check_arrays(view, fault);
    if (status == CAIRN_OK)
        status = check_coordinates(view, fault);
    if (status != CAIRN_OK)
        return status;
    if (!cairn_pose_is_finite(map_scan))
        return refuse(fault, -1, "the pose is not finite", CAIRN_NOT_FINITE);
    if (!is_near(place))
        return refuse(fault, -1, "the pose is farther than 1e6 m", CAIRN_BAD_ARGUMENT);
    if (aligner->scan_count == aligner->params.max_scans)
        return refuse(fault, -1, "more than max_scans scans", CAIRN_FULL);
    if (view->segment_count >
        aligner->params.max_segments - (aligner->segment_count - aligner->stub_count))
        return refuse(fault, -1, "more than max_segments segments", CAIRN_FULL);
    if (view->point_count > aligner->params.max_points - aligner->point_count)
        return refuse(fault, -1, "more than max_points points", CAIRN_FULL);
    map_scan.theta = cairn_wrap_angle(map_scan.theta);
    cairn_aligner_fill_scan(aligner, view, map_scan);
    forget_result(aligner);
    return refuse(fault, -1, NULL, CAIRN_OK);
}

cairn_status cairn_aligner_start_at(cairn_aligner *aligner, int32_t scan, cairn_pose map_scan)
{
    cairn_vec2 place = {map_scan.x, map_scan.y};

    if (aligner == NULL || scan < 0 || scan >= aligner->scan_count)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pose_is_finite(map_scan))
        return CAIRN_NOT_FINITE;
    if (!is_near(place))
        return CAIRN_BAD_ARGUMENT;
    map_scan.theta = cairn_wrap_angle(map_scan.theta);
    aligner->scans[scan].initial = map_scan;
    if (cairn_aligner_running(aligner) || aligner->result.units > 0)
        forget_result(aligner);
    else
        show_initial(aligner, scan);
    return CAIRN_OK;
}

void cairn_aligner_clear(cairn_aligner *aligner)
{
    aligner->scan_count = aligner->segment_count = aligner->stub_count = 0;
    aligner->point_count = aligner->patch_count = 0;
    forget_result(aligner);
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
    aligner->changes = aligner->shown = 0;
    cairn_aligner_begin_clusters(aligner);
    aligner->look.active = aligner->relax.active = 0;
    aligner->phase = ALIGNER_NEAR;
    aligner->debt = 0;
    aligner->i = aligner->j = aligner->k = aligner->l = aligner->nearest_count = 0;
    aligner->trial_count = aligner->repairs = aligner->slides = 0;
    aligner->again = aligner->has_ended = 0;
    return CAIRN_OK;
}

cairn_status cairn_aligner_begin_again(cairn_aligner *aligner, const cairn_pose *map_scan)
{
    cairn_aligner *x = aligner;

    if (x == NULL || map_scan == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!x->has_ended)
        return CAIRN_EMPTY;
    for (int32_t i = 0; i < x->scan_count; i++) {
        cairn_vec2 place = {map_scan[i].x, map_scan[i].y};

        if (!x->scans[i].held && !cairn_pose_is_finite(map_scan[i]))
            return CAIRN_NOT_FINITE;
        if (!x->scans[i].held && !is_near(place))
            return CAIRN_BAD_ARGUMENT;
    }
    for (int32_t i = 0; i < x->scan_count; i++)
        if (!x->scans[i].held) {
            x->scans[i].initial = map_scan[i];
            x->scans[i].initial.theta = cairn_wrap_angle(map_scan[i].theta);
        }
    for (int32_t c = 0; c <= x->scan_count; c++)
        x->fits[c].stamp = -1; /* they are of the initial poses of before */
    x->hypothesis_count = 0;
    x->repairs = x->slides = x->changed = 0;
    x->i = x->j = x->k = x->l = 0;
    x->debt = 0;
    x->again = 1;
    x->has_ended = 0;
    x->phase = ALIGNER_REPAIR;
    return CAIRN_OK;
}

static int32_t next_item(cairn_aligner *x)
{
    if (x->look.active)
        return cairn_aligner_look_item(x);
    if (x->relax.active)
        return cairn_aligner_relax_item(x);
    if (x->phase <= ALIGNER_MUTUAL)
        return cairn_aligner_partner_item(x);
    if (x->phase <= ALIGNER_TRIALS_OF_PAIR)
        return cairn_aligner_pairs_item(x);
    if (x->phase <= ALIGNER_CLOSE)
        return cairn_aligner_merge_item(x);
    if (x->phase <= ALIGNER_PLACE)
        return cairn_aligner_repair_item(x);
    if (x->phase == ALIGNER_SLIDE || x->phase == ALIGNER_SLIDE_TRY)
        return cairn_aligner_slide_item(x);
    return cairn_aligner_joint_item(x);
}

/* The solver goes on with the same budget. */
static int solver_works(cairn_aligner *x, cairn_budget *budget)
{
    int32_t before = budget->left;
    cairn_status status;

    if (x->phase < ALIGNER_SOLVE || !cairn_block_solver_read(x->solver).running)
        return 0;
    status = cairn_block_solver_step(x->solver, budget);
    x->result.units += before - budget->left;
    if (status < 0)
        cairn_aligner_give_up(x, status);
    return status == CAIRN_MORE;
}

/* Changes with every commit point. */
static int32_t commits_of(const cairn_aligner *x)
{
    return x->changes + x->result.rounds;
}

/* Poses are whole: none is being refined, no scan is on trial elsewhere. */
static int is_whole(const cairn_aligner *x)
{
    return !x->look.active && !x->relax.active && x->clusters[x->scan_count].size == 0;
}

static cairn_status go_on(cairn_aligner *aligner, cairn_budget *budget, int to_commit)
{
    if (aligner == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (aligner->phase != ALIGNER_DONE || aligner->debt > 0) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        if (aligner->debt > 0) {
            int32_t paid = aligner->debt < budget->left ? aligner->debt : budget->left;

            aligner->debt -= paid;
            aligner->result.units += paid;
            budget->left -= paid;
        } else if (to_commit && commits_of(aligner) != aligner->shown && is_whole(aligner)) {
            aligner->shown = commits_of(aligner);
            return CAIRN_OK;
        } else if (!solver_works(aligner, budget) && aligner->phase != ALIGNER_DONE) {
            aligner->debt += next_item(aligner);
            if (aligner->debt > aligner->result.worst_step)
                aligner->result.worst_step = aligner->debt;
        }
    }
    return CAIRN_OK;
}

cairn_status cairn_aligner_step(cairn_aligner *aligner, cairn_budget *budget)
{
    return go_on(aligner, budget, 0);
}

cairn_status cairn_aligner_iterate(cairn_aligner *aligner, cairn_budget *budget)
{
    return go_on(aligner, budget, 1);
}

int32_t cairn_aligner_running(const cairn_aligner *aligner)
{
    return aligner->phase != ALIGNER_DONE || aligner->debt > 0;
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

cairn_pose cairn_aligner_pose_now(const cairn_aligner *aligner, int32_t scan, int32_t *part)
{
    cairn_transform gauge;
    int32_t known = scan >= 0 && scan < aligner->scan_count, own;

    if (part != NULL)
        *part = known ? scan : -1;
    if (!known)
        return cairn_pose_identity();
    own = aligner->scans[scan].part;
    if (!cairn_aligner_running(aligner) &&
        aligner->result.verdict == CAIRN_ALIGNER_RUNNING) /* not begun */
        return aligner->results[scan].map_scan;
    if (part != NULL && own < aligner->scan_count)
        *part = own;
    if (!cairn_aligner_running(aligner))
        return aligner->results[scan].map_scan;
    gauge = cairn_aligner_gauge(aligner, own);
    return cairn_aligner_to_pose(cairn_aligner_compose(gauge, aligner->poses[scan]));
}
