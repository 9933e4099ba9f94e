/* Matches of the pairs of scans. */
#include "src/base/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/base/interruption.h"
#include "src/host/maps/scanner_check_work.h"

/* m, rad: half sizes of the search about no motion. */
#define WINDOW_M   CAIRN_REAL(1.2)
#define WINDOW_RAD CAIRN_REAL(0.9)
/* A second hypothesis with more than this share of the first one's score makes it ambiguous. */
static const cairn_real COMPETING_SCORE = CAIRN_REAL(0.9);
/* Capacities of a scan and of a match. */
enum { MOST_POINTS = 4096, MOST_SEGMENTS = 512, MAX_HYPOTHESES = 4, MAX_CANDIDATES = 24 };
/* s: velocities are those between scans that are not farther apart. */
static const double LONGEST_STEP_S = 1;

static int32_t most_beams(const cairn_scan_log *log)
{
    int32_t most = 1;

    for (int32_t i = 0; i < log->scans.count; i++)
        most = log->scans.record[i].count > most ? log->scans.record[i].count : most;
    return most;
}

cairn_status cairn_scanner_check_open(scanner_check_work *work, const cairn_scan_log *log)
{
    cairn_scan_params scan = cairn_scan_default();
    cairn_scan_match_params match = cairn_scan_match_default();
    int32_t beams = most_beams(log);
    cairn_pool pool;
    size_t bytes;
    cairn_status status;

    scan.max_beams = beams;
    scan.max_points = MOST_POINTS;
    scan.max_segments = MOST_SEGMENTS;
    match.max_target = match.max_query = MOST_POINTS;
    match.max_dense = beams;
    match.max_views = 1;
    match.max_hypotheses = MAX_HYPOTHESES;
    match.max_candidates = MAX_CANDIDATES;
    match.max_cells = cairn_scan_match_cells(WINDOW_M, match.spacing);
    bytes = cairn_scan_memory(&scan) + cairn_scan_match_memory(&match) + CAIRN_ALIGN;
    work->memory = malloc(bytes);
    work->range = malloc((size_t)beams * sizeof *work->range);
    work->angle = malloc((size_t)beams * sizeof *work->angle);
    work->dense = malloc((size_t)beams * sizeof *work->dense);
    if (work->memory == NULL || work->range == NULL || work->angle == NULL || work->dense == NULL)
        return CAIRN_NO_MEMORY;
    status = cairn_pool_init(&pool, work->memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_scan_create(&work->scan, &pool, &scan);
    if (status == CAIRN_OK)
        status = cairn_scan_match_create(&work->match, &pool, &match);
    return status;
}

void cairn_scanner_check_close(scanner_check_work *work)
{
    free(work->memory);
    free(work->range);
    free(work->angle);
    free(work->dense);
}

/* ---- Velocities ---- */

/* Returns the motion of the sensor that a motion of the robot is. */
static cairn_pose sensor_motion(cairn_pose base_sensor, cairn_pose robot)
{
    return cairn_pose_compose(cairn_pose_inverse(base_sensor),
                              cairn_pose_compose(robot, base_sensor));
}

static cairn_twist velocity_of(cairn_pose motion, double seconds)
{
    cairn_twist still = {{0, 0}, 0}, twist;

    if (!(seconds > 0 && seconds <= LONGEST_STEP_S))
        return still;
    twist = cairn_twist_log(motion);
    twist.linear = cairn_vec2_scale(twist.linear, (cairn_real)(1 / seconds));
    twist.angular /= (cairn_real)seconds;
    return twist;
}

/* Returns the velocity of the sensor at a scan of a pair: by the odometry to the next scan, without
 * odometry by the last match of the pair. 0: not known. */
static cairn_twist velocity_at(const scanner_check_work *work, const scanner_check_pair *pair,
                               int32_t scan)
{
    const cairn_carmen_log_scans *scans = &work->log->scans;
    int32_t from = scan + 1 < scans->count ? scan : scan - 1;
    const cairn_carmen_log_record *a = &scans->record[from], *b = a + 1;

    if (!work->has_odometry)
        return velocity_of(pair->is_matched ? cairn_pose_inverse(pair->match)
                                            : cairn_pose_identity(),
                           pair->seconds);
    return velocity_of(sensor_motion(a->scan.base_sensor, cairn_pose_between(a->robot, b->robot)),
                       (double)cairn_time_difference(b->stamp_ns, a->stamp_ns) * 1e-9);
}

/* ---- Matches ---- */

static cairn_status step_scan(cairn_scan *scan)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status;

    while ((status = cairn_scan_step(scan, &budget)) == CAIRN_MORE)
        budget.left = CAIRN_UNBOUNDED;
    return status;
}

/* Corrects a scan and fits its lines, in the sensor's frame at the first beam. 0: it cannot be
 * used. */
static int prepare(scanner_check_work *work, const scanner_check_pair *pair, int32_t index,
                   cairn_scan_view *view)
{
    cairn_scan_input scan = work->log->scans.record[index].scan;

    cairn_scan_correct(&work->correction, &scan, work->range, work->angle);
    scan.base_sensor = cairn_pose_identity();
    scan.motion =
        cairn_twist_exp(velocity_at(work, pair, index), (cairn_real)fabs(work->correction.sweep));
    if (cairn_scan_begin(work->scan, &scan, NULL) != CAIRN_OK || step_scan(work->scan) != CAIRN_OK)
        return 0;
    *view = cairn_scan_read(work->scan);
    return view->point_count > 0;
}

static cairn_scan_match_part part_of(scanner_check_work *work, const cairn_scan_view *view)
{
    cairn_scan_match_part part = cairn_scan_match_part_of(view);

    part.dense = work->dense;
    part.dense_count = cairn_scan_match_dense(view, work->dense);
    return part;
}

/* Takes the result when it is not ambiguous. A match along a bare corridor is taken: its covariance
 * says what it does not determine. */
static void take_result(scanner_check_pair *pair, cairn_scan_match_result result)
{
    const cairn_scan_match_hypothesis *best = result.hypotheses;

    if (result.verdict != CAIRN_SCAN_MATCH_FOUND &&
        (result.verdict != CAIRN_SCAN_MATCH_AMBIGUOUS || best->observable_dof == 3 ||
         (result.count > 1 && best[1].score > COMPETING_SCORE * best->score)))
        return;
    pair->match = best->target_query;
    for (int i = 0; i < 9; i++)
        pair->covariance[i] = (double)best->covariance[i];
    pair->is_matched = 1;
}

static cairn_status match_scans(scanner_check_work *work, const cairn_scan_match_part *query)
{
    const cairn_scan_match_window window = {WINDOW_M, WINDOW_RAD};
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status =
        cairn_scan_match_begin(work->match, query, cairn_pose_identity(), &window, NULL);

    while (status == CAIRN_OK &&
           (status = cairn_scan_match_step(work->match, &budget)) == CAIRN_MORE) {
        budget.left = CAIRN_UNBOUNDED;
        status = CAIRN_OK;
    }
    return status;
}

/* Matches the first scan of a pair, whose walls are then measured, against the second one. */
static void match_pair(scanner_check_work *work, scanner_check_pair *pair)
{
    cairn_scan_match_part part;
    cairn_scan_view view;
    int32_t has_target;

    cairn_scan_match_clear_target(work->match);
    has_target = prepare(work, pair, pair->second, &view);
    if (has_target) {
        part = part_of(work, &view);
        cairn_scanner_check_add_walls(work, &view, pair->block,
                                      velocity_at(work, pair, pair->second));
        has_target = cairn_scan_match_add_target(work->match, &part, cairn_pose_identity(), NULL) ==
                     CAIRN_OK;
    }
    if (!prepare(work, pair, pair->first, &view))
        return;
    part = part_of(work, &view);
    pair->is_matched = 0;
    if (has_target && match_scans(work, &part) == CAIRN_OK)
        take_result(pair, cairn_scan_match_read(work->match));
    cairn_scanner_check_add_walls(work, &view, pair->block, velocity_at(work, pair, pair->first));
}

void cairn_scanner_check_match(scanner_check_work *work)
{
    work->walls = 0;
    work->wall_hits = 0;
    for (int32_t i = 0; i < work->pairs && !cairn_interruption_is_requested(); i++)
        match_pair(work, &work->pair[i]);
}
