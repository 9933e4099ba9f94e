/* lum: sequential registration (incremental ICP) before the first links.
 *
 * Method:
 * 1. Seed: the scan with the most points is placed first; again whenever no remaining scan has a
 *    match.
 * 2. In every round each remaining scan is matched by ICP with all placed scans, from its initial
 *    pose moved by the common motion of these, and from that pose turned left and right.
 * 3. The match of highest score is placed: the overlap over the mean distance of the pairs, times
 *    the root of the number of points.
 * 4. At the end all scans are moved together so that the first stays.
 *
 * Limits: errors accumulate: a wrongly placed scan attracts others. From poses right within a few
 * degrees the links alone are better. The number of matches grows with the square of the scans.
 * Source: the sequence of Borrmann et al. 2008, Globally consistent 3D mapping with scan matching:
 * ICP scan by scan, then global relaxation; best first instead of in the order of the file, which
 * is unknown here. */
#include "src/base/build.h"

#include "src/poses/lum_work.h"

enum { MAX_ITERATIONS = 60, POINTS_PER_UNIT = 4, SCANS_PER_UNIT = 4 };

/* m: lever arm that weights headings in the common motion. */
static const cairn_real HEADING_ARM_M = 1;

/* Start headings, in multiples of params.registration_angle. */
static const int32_t HEADING_STEPS[] = {0, -1, 1};

cairn_icp_params cairn_lum_register_icp(const cairn_lum_params *params)
{
    cairn_icp_params icp = cairn_icp_default();

    icp.max_target = params->max_points;
    icp.max_iterations = MAX_ITERATIONS;
    icp.gate_start = params->registration_gate;
    icp.gate_end = params->max_pair_distance / 2;
    icp.gate_factor = CAIRN_REAL(1.5);
    icp.direction_gate = params->direction_gate;
    return icp;
}

void cairn_lum_register_add(cairn_lum *lum, const cairn_oriented_point *points, int32_t count)
{
    struct lum_register *r = &lum->registration;
    cairn_real spacing = lum->params.registration_spacing;
    int32_t scan = lum->state.scans - 1, end, last = 0;

    if (scan == 0)
        r->first[0] = 0;
    end = r->first[scan];
    for (int32_t k = 0; k < count; k++) {
        cairn_vec2 step = cairn_vec2_sub(points[k].position, points[last].position);

        if (k > 0 && cairn_vec2_norm_squared(step) < spacing * spacing)
            continue;
        r->points[end++] = points[k];
        last = k;
    }
    r->first[scan + 1] = end;
}

static int32_t count_of(const struct lum_register *registration, int32_t scan)
{
    return registration->first[scan + 1] - registration->first[scan];
}

static void begin_round(struct lum_register *registration)
{
    registration->scan = registration->turn_index = 0;
    registration->best.scan = -1;
    registration->best.score = 0;
}

static void place_scan(cairn_lum *lum, int32_t scan, cairn_pose pose)
{
    struct lum_register *r = &lum->registration;
    cairn_status status =
        cairn_icp_add_target(r->icp, r->points + r->first[scan], count_of(r, scan), pose, NULL);

    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    r->placed[scan] = pose;
    r->is_placed[scan] = 1;
    r->placed_count++;
    r->motion =
        cairn_pose_fit(r->initial, r->placed, r->is_placed, lum->state.scans, HEADING_ARM_M);
    begin_round(r);
}

/* Returns the scan with the most points among those not placed; -1: none has any. */
static int32_t next_seed(const cairn_lum *lum)
{
    const struct lum_register *r = &lum->registration;
    int32_t seed = -1, most = 0;

    for (int32_t i = 0; i < lum->state.scans; i++)
        if (!r->is_placed[i] && count_of(r, i) > most) {
            most = count_of(r, i);
            seed = i;
        }
    return seed;
}

void cairn_lum_register_begin(cairn_lum *lum)
{
    struct lum_register *r = &lum->registration;

    cairn_icp_clear_target(r->icp);
    for (int32_t i = 0; i < lum->state.scans; i++) {
        r->initial[i] = lum->scans[i].pose;
        r->is_placed[i] = 0;
    }
    r->motion = cairn_pose_identity();
    r->placed_count = 0;
    r->icp_running = 0;
    begin_round(r);
}

/* Places the best match of the round, or without one the seed of a new component; 0: none is
 * left. */
static int32_t end_round(cairn_lum *lum)
{
    struct lum_register *r = &lum->registration;
    int32_t seed;

    if (r->best.scan >= 0) {
        lum->state.registered_scans++;
        place_scan(lum, r->best.scan, r->best.pose);
        return 1;
    }
    seed = next_seed(lum);
    if (seed >= 0)
        place_scan(lum, seed, cairn_pose_compose(r->motion, r->initial[seed]));
    return seed >= 0;
}

/* Sets the map's poses from the placed ones, moved so that the first scan stays; unplaced scans get
 * the common motion. */
static void commit(cairn_lum *lum)
{
    struct lum_register *r = &lum->registration;
    cairn_pose back;

    for (int32_t i = 0; i < lum->state.scans; i++)
        if (!r->is_placed[i])
            r->placed[i] = cairn_pose_compose(r->motion, r->initial[i]);
    back = cairn_pose_compose(r->initial[0], cairn_pose_inverse(r->placed[0]));
    for (int32_t i = 1; i < lum->state.scans; i++)
        lum->scans[i].pose = cairn_pose_compose(back, r->placed[i]);
}

int32_t cairn_lum_register_next(cairn_lum *lum, int32_t *units)
{
    struct lum_register *r = &lum->registration;
    cairn_status status;
    cairn_pose start;
    int32_t points, target = cairn_icp_target_count(r->icp);

    while (r->scan < lum->state.scans &&
           (r->placed_count == 0 || r->is_placed[r->scan] || count_of(r, r->scan) == 0))
        r->scan++;
    *units = 1 + lum->state.scans / SCANS_PER_UNIT;
    if (r->scan == lum->state.scans) {
        if (end_round(lum)) {
            *units += (cairn_icp_target_count(r->icp) - target) / POINTS_PER_UNIT;
            return 0;
        }
        commit(lum);
        return 1;
    }
    points = count_of(r, r->scan);
    start = cairn_pose_compose(r->motion, r->initial[r->scan]);
    start.theta = cairn_wrap_angle(start.theta + (cairn_real)HEADING_STEPS[r->turn_index] *
                                                     lum->params.registration_angle);
    status = cairn_icp_begin(r->icp, r->points + r->first[r->scan], points, start, NULL, NULL);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    r->icp_running = 1;
    *units += points / POINTS_PER_UNIT;
    return 0;
}

void cairn_lum_register_matched(cairn_lum *lum)
{
    struct lum_register *r = &lum->registration;
    cairn_icp_result result = cairn_icp_read(r->icp);
    cairn_real score = result.overlap * cairn_sqrt((cairn_real)count_of(r, r->scan)) /
                       (result.mean_distance + lum->params.min_sigma);

    r->icp_running = 0;
    if (result.verdict != CAIRN_ICP_TOO_FEW_PAIRS && score > r->best.score) {
        r->best.score = score;
        r->best.pose = result.target_query;
        r->best.scan = r->scan;
    }
    if (++r->turn_index == (lum->params.registration_angle > 0 ? 3 : 1)) {
        r->turn_index = 0;
        r->scan++;
    }
}
