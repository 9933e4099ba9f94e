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

enum { MAX_ITERATIONS = 60 };

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

static void place_scan(cairn_lum *lum, int32_t scan, cairn_pose pose)
{
    struct lum_register *r = &lum->registration;

    cairn_must_be_ok(
        cairn_icp_add_target(r->icp, r->points + r->first[scan], count_of(r, scan), pose, NULL));
    r->placed[scan] = pose;
    r->is_placed[scan] = 1;
    r->placed_count++;
    r->motion =
        cairn_pose_fit(r->initial, r->placed, r->is_placed, lum->state.scans, HEADING_ARM_M);
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
}

/* 1 when a scan is matched in this round: the first round has nothing to match with. */
static int is_matched(const struct lum_register *registration, int32_t scan)
{
    return registration->placed_count > 0 && !registration->is_placed[scan] &&
           count_of(registration, scan) > 0;
}

/* Starts the ICP of the current scan from its current start heading. */
static void begin_match(cairn_lum *lum)
{
    struct lum_register *r = &lum->registration;
    cairn_pose start = cairn_pose_compose(r->motion, r->initial[r->scan]);

    start.theta = cairn_wrap_angle(start.theta + (cairn_real)HEADING_STEPS[r->turn_index] *
                                                     lum->params.registration_angle);
    cairn_must_be_ok(cairn_icp_begin(r->icp, r->points + r->first[r->scan], count_of(r, r->scan),
                                     start, NULL, NULL));
}

/* Keeps the match of the current scan when it is the best of the round. */
static void end_match(cairn_lum *lum)
{
    struct lum_register *r = &lum->registration;
    cairn_icp_result result = cairn_icp_read(r->icp);
    cairn_real score = result.overlap * cairn_sqrt((cairn_real)count_of(r, r->scan)) /
                       (result.mean_distance + lum->params.min_sigma);

    if (result.verdict != CAIRN_ICP_TOO_FEW_PAIRS && score > r->best.score) {
        r->best.score = score;
        r->best.pose = result.target_query;
        r->best.scan = r->scan;
    }
}

/* Chooses the scan that is placed at the end of the round: that of the best match, or without one
 * the seed of a new component, where the common motion moves it. */
static void choose_scan(cairn_lum *lum)
{
    struct lum_register *r = &lum->registration;

    if (r->best.scan >= 0)
        return;
    r->best.scan = next_seed(lum);
    if (r->best.scan >= 0)
        r->best.pose = cairn_pose_compose(r->motion, r->initial[r->best.scan]);
}

/* Places the chosen scan; 0: none is left. */
static int place_chosen(cairn_lum *lum)
{
    const struct lum_register *r = &lum->registration;

    if (r->best.scan < 0)
        return 0;
    lum->state.registered_scans += r->best.score > 0;
    place_scan(lum, r->best.scan, r->best.pose);
    return 1;
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

/* Units of an operation on all scans, and on the points of one (-1: none). */
static int32_t units_of(const cairn_lum *lum, int32_t scan)
{
    int32_t points = scan >= 0 ? count_of(&lum->registration, scan) : 0;

    return 1 + lum->state.scans / LUM_LISTED_PER_UNIT + points / LUM_LISTED_PER_UNIT;
}

/* Number of start headings of a match. */
static int32_t turn_count(const cairn_lum *lum)
{
    return lum->params.registration_angle > 0 ? 3 : 1;
}

int cairn_lum_register_scans(cairn_lum *lum, cairn_budget *budget)
{
    struct lum_register *r = &lum->registration;

    CAIRN_STEP_BEGIN(lum->phase_resume);
    do {
        r->best.scan = -1;
        r->best.score = 0;
        for (r->scan = 0; r->scan < lum->state.scans; r->scan++) {
            if (!is_matched(r, r->scan))
                continue;
            for (r->turn_index = 0; r->turn_index < turn_count(lum); r->turn_index++) {
                CAIRN_STEP_CHARGE(lum, phase_resume, budget, units_of(lum, r->scan));
                begin_match(lum);
                CAIRN_STEP_UNTIL(lum->phase_resume, cairn_icp_step(r->icp, budget) != CAIRN_MORE);
                end_match(lum);
            }
        }
        choose_scan(lum);
        CAIRN_STEP_CHARGE(lum, phase_resume, budget, units_of(lum, r->best.scan));
    } while (place_chosen(lum));
    CAIRN_STEP_CHARGE(lum, phase_resume, budget, LUM_UNITS_PER_SCAN * lum->state.scans);
    commit(lum);
    CAIRN_STEP_END(lum->phase_resume);
}
