/* angle_step: angle step of a scanner from overlapping scans.
 *
 * Method:
 * 1. Pairs of scans some way apart are spread over the drive.
 * 2. Their points with normals, of beams on smooth surfaces, are aligned by point-to-line ICP from
 *    the odometry.
 * 3. Each point is paired with the nearest one of the other scan. The distance along the normal
 *    depends on the pose, on a change of the step, which moves points across their rays in
 *    proportion to the bearing, and on an offset of the ranges. The pose is eliminated.
 * 4. All pairs are solved together, with robust weights and a jackknife; again with the step found.
 *
 * Limits: a turn during a scan is not corrected. A pure rotation says nothing of the step. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/angle_step.h"
#include "cairn/icp.h"
#include "cairn/random.h"
#include "cairn/registration.h"
#include "cairn/small_matrix.h"
#include "src/base/object.h"
#include "src/base/step.h"
#include "src/calibration/scanner_check_work.h"

enum {
    MAX_BEAMS = 100000,
    MAX_PAIRS = 1 << 16,
    ROUNDS = 2,
    REWEIGHT_ROUNDS = 8,
    /* beams to each side by which a normal is fitted */
    NORMAL_BEAMS = 3,
    LEAST_POINTS = 40,
    LEAST_MATCHES = 30,
    LEAST_PAIRS = 30,
    MAX_ITERATIONS = 20,
    /* scans that are drawn until one is at the right distance */
    MOST_DRAWS = 100,
    RANDOM_SEED = 1
};

enum {
    UNITS_PER_SCAN = 4,
    BEAMS_PER_UNIT = 2,
    POINTS_PER_UNIT = 24,
    UNITS_PER_PAIR = 2,
    UNITS_PER_SOLUTION = 120
};

/* m, rad: distances and greatest turn between the two scans of a pair. */
static const cairn_real PAIR_DISTANCE_M = CAIRN_REAL(0.8);
static const cairn_real PAIR_FARTHEST_M = 3;
static const cairn_real PAIR_WIDEST_RAD = CAIRN_REAL(2.5);
/* m: points farther away say little of their normal. */
static const cairn_real LONGEST_RANGE_M = 20;
/* m, share: rms deviation of the beams from their line, and smaller per greater moment. */
static const cairn_real ROUGHNESS_M = CAIRN_REAL(0.02);
static const cairn_real ROUNDNESS = CAIRN_REAL(0.02);
/* Cosine of the angle of incidence: at grazing beams ranges are wrong. */
static const cairn_real LEAST_COSINE = CAIRN_REAL(0.25);
/* m: gates of the alignment, and of the points that are paired after it. */
static const cairn_real GATE_START_M = CAIRN_REAL(0.4);
static const cairn_real GATE_M = CAIRN_REAL(0.15);
/* Cosine of the angle between the normals of paired points. */
static const cairn_real NORMALS_COSINE = CAIRN_REAL(0.9);
/* Least share of the points of the smaller scan that are paired. */
static const cairn_real LEAST_OVERLAP = CAIRN_REAL(0.25);
/* m: standard deviation of a paired point. */
static const cairn_real POINT_SIGMA_M = CAIRN_REAL(0.01);
/* Scales of the Cauchy weights of points and pairs, in standard deviations. */
static const cairn_real POINT_SCALE = 2;
static const cairn_real PAIR_SCALE = 3;
/* Standard deviations of the step and of the offset, m, that are expected. */
static const cairn_real STEP_SIGMA = 1;
static const cairn_real OFFSET_SIGMA_M = CAIRN_REAL(0.03);
/* Prior information of a pose, 1/m^2 and 1/rad^2, so that a bare corridor is solvable. */
static const cairn_real POSE_INFORMATION = 1;

/* Share of the step by which right logs of buildings deviate, besides the jackknife. */
static const cairn_real SYSTEMATIC_SIGMA = CAIRN_REAL(0.0006);
/* An estimate with a larger standard deviation is not known. */
static const cairn_real STEP_KNOWN = CAIRN_REAL(0.003);
/* A deviation counts from this many standard deviations and this share on; an agreement is one
 * within this many standard deviations. */
static const cairn_real SIGNIFICANCE_SIGMAS = 4;
static const cairn_real STEP_MATTERS = CAIRN_REAL(0.002);
static const cairn_real AGREEMENT_SIGMAS = 3;
/* Steps of scanners are multiples of this, up to a relative rounding. */
static const cairn_real ROUND_STEP_RAD = CAIRN_REAL(0.05) * CAIRN_PI / 180;
static const cairn_real ROUND_TOLERANCE = CAIRN_REAL(2e-5);

/* Unknowns of a pair after the elimination of its pose, and those of the pose. */
enum { STEP, OFFSET, UNKNOWNS };
enum { POSE_UNKNOWNS = 3 };

/* Points of a scan. */
typedef struct scan_points {
    cairn_oriented_point *point; /* [max_beams] in the sensor's frame */
    cairn_real *bearing;         /* [max_beams] rad, from the middle of the field of view */
    int32_t count;
} scan_points;

/* Normal equations of a pair for step and offset. */
typedef struct pair_equations {
    cairn_real a[3], b[UNKNOWNS];
    int32_t block;
} pair_equations;

/* Sums over the paired points: pose by pose, pose by unknown, unknown by unknown; right sides. */
typedef struct point_sums {
    cairn_sym3 pose;
    cairn_real mixed[UNKNOWNS][POSE_UNKNOWNS], own[3], pose_b[POSE_UNKNOWNS], own_b[UNKNOWNS];
    int32_t count;
} point_sums;

struct cairn_angle_step {
    cairn_icp *icp;
    float *range, *angle; /* [max_beams] of the scan in work */
    scan_points target, query;
    pair_equations *pairs; /* [max_pairs] */

    const cairn_scanner_check_scan *scans;
    int32_t scan_count;
    int32_t pair_count;
    cairn_real ratio; /* found so far */
    cairn_angle_step_result result;
    int64_t units;

    /* Resume points of the estimate and of the steps that it runs. */
    uint16_t resume, resume_pair, resume_round, resume_solve;
    /* 1: step() has work left. */
    int32_t is_running;
    /* Units charged for the operation that waits. */
    int32_t units_charged;
    cairn_status status;
    /* Candidate pair, its scans, whether there is a second one; round; draw, point or pair; round
     * of weights. */
    int32_t candidate, first, second, is_drawn, round, cursor, reweight;
    cairn_random random;
    cairn_transform target_query;
    point_sums sums;
    scanner_check_sums solver;
    scanner_check_solution solution;
    int32_t is_solved;
    cairn_angle_step_params params;
};

/* ---- The object ---- */

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_angle_step_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_beams, 1024, 1, MAX_BEAMS),
    INTEGER(max_pairs, 2000, 2, MAX_PAIRS),
};
extern const cairn_parameters cairn_angle_step_parameters;
const cairn_parameters cairn_angle_step_parameters =
    CAIRN_PARAMETERS("angle_step", cairn_angle_step_params, rows);

cairn_angle_step_params cairn_angle_step_default(void)
{
    cairn_angle_step_params params;

    cairn_parameters_preset(&cairn_angle_step_parameters, &params);
    return params;
}

cairn_status cairn_angle_step_check(const cairn_angle_step_params *params,
                                    cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_angle_step_parameters, params, fault);
}

static cairn_icp_params icp_params(const cairn_angle_step_params *params)
{
    cairn_icp_params icp = cairn_icp_default();

    icp.max_target = params->max_beams;
    icp.max_iterations = MAX_ITERATIONS;
    icp.gate_start = GATE_START_M;
    return icp;
}

/* The object, its arrays and its ICP; NULL from a counting pool. */
static cairn_angle_step *build(cairn_pool *pool, const cairn_angle_step_params *params)
{
    cairn_icp_params icp = icp_params(params);
    cairn_angle_step *angle_step = cairn_object_take(pool, sizeof *angle_step);

    CAIRN_TAKE(angle_step, pool, range, params->max_beams);
    CAIRN_TAKE(angle_step, pool, angle, params->max_beams);
    CAIRN_TAKE(angle_step, pool, target.point, params->max_beams);
    CAIRN_TAKE(angle_step, pool, target.bearing, params->max_beams);
    CAIRN_TAKE(angle_step, pool, query.point, params->max_beams);
    CAIRN_TAKE(angle_step, pool, query.bearing, params->max_beams);
    CAIRN_TAKE(angle_step, pool, pairs, params->max_pairs);
    CAIRN_TAKE_OBJECT(angle_step, pool, icp, icp, &icp);
    if (angle_step != NULL)
        angle_step->params = *params;
    return angle_step;
}

CAIRN_OBJECT(angle_step, angle_step, build);

/* ---- Begin ---- */

static cairn_status check_scan(const cairn_angle_step *angle_step,
                               const cairn_scanner_check_scan *scan, int32_t index,
                               cairn_fault *fault)
{
    const cairn_scan_input *input = &scan->input;

    if (input->range == NULL || input->count < 1)
        return cairn_refuse(fault, index, "a scan without ranges, expected one beam or more",
                            CAIRN_BAD_ARGUMENT);
    if (input->count > angle_step->params.max_beams)
        return cairn_refuse(fault, index, "more beams than max_beams", CAIRN_FULL);
    if (!cairn_pose_is_finite(input->base_sensor) || !cairn_pose_is_finite(scan->robot))
        return cairn_refuse(fault, index, "a pose is not finite", CAIRN_NOT_FINITE);
    return CAIRN_OK;
}

cairn_status cairn_angle_step_begin(cairn_angle_step *angle_step,
                                    const cairn_scanner_check_scan *scans, int32_t count,
                                    cairn_fault *fault)
{
    if (angle_step == NULL || count < 0 || (scans == NULL && count > 0))
        return cairn_refuse(fault, -1, "no object or no scans", CAIRN_BAD_ARGUMENT);
    if (count == 0)
        return cairn_refuse(fault, -1, "no scans, expected one or more", CAIRN_EMPTY);
    for (int32_t i = 0; i < count; i++) {
        cairn_status status = check_scan(angle_step, &scans[i], i, fault);

        if (status != CAIRN_OK)
            return status;
    }
    angle_step->resume = angle_step->resume_pair = angle_step->resume_round =
        angle_step->resume_solve = 0;
    angle_step->units_charged = 0;
    angle_step->scans = scans;
    angle_step->scan_count = count;
    angle_step->ratio = 1;
    angle_step->units = 0;
    angle_step->is_running = 1;
    memset(&angle_step->result, 0, sizeof angle_step->result);
    return CAIRN_OK;
}

/* ---- Points ---- */

static cairn_vec2 direction_of(cairn_real angle)
{
    cairn_vec2 unit;

    cairn_sincos(angle, &unit.y, &unit.x);
    return unit;
}

static int is_usable(const cairn_scan_input *input, float range)
{
    return range > 0 && range >= input->range_min && (cairn_real)range < LONGEST_RANGE_M &&
           (!(input->range_max > 0) || range < input->range_max);
}

static cairn_vec2 hit_of(const cairn_angle_step *angle_step, int32_t beam)
{
    return cairn_vec2_scale(direction_of((cairn_real)angle_step->angle[beam]),
                            (cairn_real)angle_step->range[beam]);
}

/* Fits the line of the beams around one. 0: there is no smooth surface, or a grazing one. */
static int fit_normal(const cairn_angle_step *angle_step, const cairn_scan_input *input,
                      int32_t beam, cairn_oriented_point *point)
{
    const cairn_real hits = 2 * NORMAL_BEAMS + 1;
    cairn_vec2 sum = {0, 0}, minor, major;
    cairn_sym2 moments = {0, 0, 0};
    cairn_real values[2], cosine;

    point->position = hit_of(angle_step, beam);
    for (int32_t i = beam - NORMAL_BEAMS; i <= beam + NORMAL_BEAMS; i++) {
        cairn_vec2 from;

        if (!is_usable(input, angle_step->range[i]))
            return 0;
        from = cairn_vec2_sub(hit_of(angle_step, i), point->position);
        sum = cairn_vec2_add(sum, from);
        moments.xx += from.x * from.x;
        moments.xy += from.x * from.y;
        moments.yy += from.y * from.y;
    }
    moments.xx -= sum.x * sum.x / hits;
    moments.xy -= sum.x * sum.y / hits;
    moments.yy -= sum.y * sum.y / hits;
    cairn_sym2_eigen(moments, values, &minor, &major);
    if (values[0] > ROUGHNESS_M * ROUGHNESS_M * hits || values[0] > ROUNDNESS * values[1])
        return 0;
    cosine = -cairn_vec2_dot(minor, point->position) / (cairn_real)angle_step->range[beam];
    if (cairn_abs(cosine) < LEAST_COSINE)
        return 0;
    point->direction = cairn_vec2_scale(cairn_vec2_left_perp(minor), cosine > 0 ? -1 : 1);
    return 1;
}

/* Fills in the points of a scan with the step found so far. */
static void make_points(cairn_angle_step *angle_step, int32_t scan, scan_points *points)
{
    cairn_scan_input input = angle_step->scans[scan].input;
    cairn_scan_correction correction = cairn_scan_correction_none();
    cairn_real middle;

    correction.angle_step = angle_step->ratio * cairn_abs(cairn_scan_correction_mean_step(&input));
    cairn_scan_correction_apply(&correction, &input, angle_step->range, angle_step->angle);
    middle = CAIRN_REAL(0.5) *
             ((cairn_real)angle_step->angle[0] + (cairn_real)angle_step->angle[input.count - 1]);
    points->count = 0;
    for (int32_t i = NORMAL_BEAMS; i < input.count - NORMAL_BEAMS; i++)
        if (fit_normal(angle_step, &input, i, &points->point[points->count]))
            points->bearing[points->count++] = (cairn_real)angle_step->angle[i] - middle;
}

/* ---- Paired points ---- */

/* Nearest target point of the same side; -1: none within the gate. */
static int32_t nearest_of(const scan_points *target, cairn_vec2 at, cairn_vec2 direction)
{
    cairn_real least = GATE_M * GATE_M;
    int32_t nearest = -1;

    for (int32_t i = 0; i < target->count; i++) {
        cairn_vec2 from = cairn_vec2_sub(at, target->point[i].position);
        cairn_real square = cairn_vec2_dot(from, from);

        if (square < least &&
            cairn_vec2_dot(direction, target->point[i].direction) > NORMALS_COSINE) {
            least = square;
            nearest = i;
        }
    }
    return nearest;
}

/* How step and offset move a point, along a normal. */
static void moves_of(cairn_vec2 position, cairn_real bearing, cairn_vec2 normal,
                     cairn_real moves[UNKNOWNS])
{
    moves[STEP] = bearing * cairn_vec2_dot(cairn_vec2_left_perp(position), normal);
    moves[OFFSET] = cairn_vec2_dot(cairn_vec2_unit(position), normal);
}

/* Adds the pair of the query point in work to the sums. */
static void add_point(cairn_angle_step *angle_step)
{
    const scan_points *target = &angle_step->target, *query = &angle_step->query;
    const cairn_oriented_point *own = &query->point[angle_step->cursor], *other;
    const cairn_transform transform = angle_step->target_query;
    point_sums *sums = &angle_step->sums;
    cairn_vec2 at = cairn_transform_point(transform, own->position),
               direction = cairn_transform_direction(transform, own->direction), normal, turned;
    int32_t nearest = nearest_of(target, at, direction);
    cairn_real row[POSE_UNKNOWNS], moves[UNKNOWNS], theirs[UNKNOWNS], left, weight;

    if (nearest < 0)
        return;
    other = &target->point[nearest];
    normal = cairn_vec2_unit(cairn_vec2_left_perp(cairn_vec2_add(direction, other->direction)));
    turned = cairn_transform_direction(transform, own->position);
    left = cairn_vec2_dot(cairn_vec2_sub(at, other->position), normal);
    row[0] = normal.x;
    row[1] = normal.y;
    row[2] = cairn_vec2_dot(cairn_vec2_left_perp(turned), normal);
    moves_of(turned, query->bearing[angle_step->cursor], normal, moves);
    moves_of(other->position, target->bearing[nearest], normal, theirs);
    moves[STEP] -= theirs[STEP];
    moves[OFFSET] -= theirs[OFFSET];
    weight = left / (POINT_SCALE * POINT_SIGMA_M);
    weight = 1 / ((1 + weight * weight) * POINT_SIGMA_M * POINT_SIGMA_M);
    sums->pose =
        cairn_sym3_add(sums->pose, cairn_sym3_scale((cairn_sym3){row[0] * row[0], row[0] * row[1],
                                                                 row[0] * row[2], row[1] * row[1],
                                                                 row[1] * row[2], row[2] * row[2]},
                                                    weight));
    for (int k = 0; k < POSE_UNKNOWNS; k++) {
        sums->pose_b[k] -= weight * row[k] * left;
        for (int i = 0; i < UNKNOWNS; i++)
            sums->mixed[i][k] += weight * moves[i] * row[k];
    }
    sums->own[0] += weight * moves[STEP] * moves[STEP];
    sums->own[1] += weight * moves[OFFSET] * moves[STEP];
    sums->own[2] += weight * moves[OFFSET] * moves[OFFSET];
    for (int i = 0; i < UNKNOWNS; i++)
        sums->own_b[i] -= weight * moves[i] * left;
    sums->count++;
}

/* Eliminates the pose, and takes the pair when it overlaps. */
static void take_pair(cairn_angle_step *angle_step)
{
    point_sums *sums = &angle_step->sums;
    int32_t fewer = angle_step->query.count < angle_step->target.count ? angle_step->query.count
                                                                       : angle_step->target.count;
    pair_equations *pair = &angle_step->pairs[angle_step->pair_count];
    cairn_real solved[UNKNOWNS][POSE_UNKNOWNS];

    if (sums->count < LEAST_MATCHES || (cairn_real)sums->count < LEAST_OVERLAP * (cairn_real)fewer)
        return;
    sums->pose.xx += POSE_INFORMATION;
    sums->pose.yy += POSE_INFORMATION;
    sums->pose.zz += POSE_INFORMATION;
    for (int i = 0; i < UNKNOWNS; i++)
        if (!cairn_sym3_solve(sums->pose, sums->mixed[i], solved[i]))
            return;
    pair->a[0] = sums->own[0] - cairn_dot3(sums->mixed[STEP], solved[STEP]);
    pair->a[1] = sums->own[1] - cairn_dot3(sums->mixed[OFFSET], solved[STEP]);
    pair->a[2] = sums->own[2] - cairn_dot3(sums->mixed[OFFSET], solved[OFFSET]);
    for (int i = 0; i < UNKNOWNS; i++)
        pair->b[i] = sums->own_b[i] - cairn_dot3(sums->pose_b, solved[i]);
    pair->block =
        (int32_t)((int64_t)angle_step->first * SCANNER_CHECK_BLOCKS / angle_step->scan_count);
    angle_step->pair_count++;
}

/* ---- Pairs ---- */

static cairn_pose motion_between(const cairn_angle_step *angle_step, int32_t from, int32_t to)
{
    const cairn_scanner_check_scan *a = &angle_step->scans[from], *b = &angle_step->scans[to];

    return cairn_pose_between(cairn_pose_compose(a->robot, a->input.base_sensor),
                              cairn_pose_compose(b->robot, b->input.base_sensor));
}

/* Chooses the scans of a candidate: the first ones are spread evenly over the drive, the second one
 * is drawn. 0: the scan drawn last is too near or too far. */
static int draw_second(cairn_angle_step *angle_step)
{
    cairn_pose motion;
    cairn_real distance;

    angle_step->first = (int32_t)((int64_t)angle_step->candidate * angle_step->scan_count /
                                  angle_step->params.max_pairs);
    angle_step->second = cairn_random_below(&angle_step->random, angle_step->scan_count);
    motion = motion_between(angle_step, angle_step->first, angle_step->second);
    distance = cairn_scanner_check_distance(motion);
    return distance >= PAIR_DISTANCE_M && distance <= PAIR_FARTHEST_M &&
           cairn_abs(motion.theta) <= PAIR_WIDEST_RAD;
}

static int begin_alignment(cairn_angle_step *angle_step)
{
    cairn_pose motion = motion_between(angle_step, angle_step->first, angle_step->second);

    cairn_icp_clear_target(angle_step->icp);
    if (angle_step->target.count < LEAST_POINTS || angle_step->query.count < LEAST_POINTS)
        return 0;
    return cairn_icp_add_target(angle_step->icp, angle_step->target.point, angle_step->target.count,
                                cairn_pose_identity(), NULL) == CAIRN_OK &&
           cairn_icp_begin(angle_step->icp, angle_step->query.point, angle_step->query.count,
                           motion, NULL, NULL) == CAIRN_OK;
}

/* Units of the points of a scan. */
static int32_t point_units(const cairn_angle_step *angle_step, int32_t scan)
{
    return UNITS_PER_SCAN + angle_step->scans[scan].input.count / BEAMS_PER_UNIT;
}

/* Aligns the two scans of a pair, and pairs their points. */
static int align(cairn_angle_step *angle_step, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(angle_step->resume_pair);
    angle_step->is_drawn = 0;
    for (angle_step->cursor = 0; angle_step->cursor < MOST_DRAWS && !angle_step->is_drawn;
         angle_step->cursor++) {
        CAIRN_STEP_CHARGE_UNIT(angle_step, resume_pair, budget);
        angle_step->is_drawn = draw_second(angle_step);
    }
    if (angle_step->is_drawn) {
        CAIRN_STEP_CHARGE(angle_step, resume_pair, budget,
                          point_units(angle_step, angle_step->first));
        make_points(angle_step, angle_step->first, &angle_step->target);
        CAIRN_STEP_CHARGE(angle_step, resume_pair, budget,
                          point_units(angle_step, angle_step->second));
        make_points(angle_step, angle_step->second, &angle_step->query);
        if (begin_alignment(angle_step)) {
            CAIRN_STEP_UNTIL(angle_step->resume_pair, (angle_step->status = cairn_icp_step(
                                                           angle_step->icp, budget)) != CAIRN_MORE);
            angle_step->target_query =
                cairn_transform_of(cairn_icp_read(angle_step->icp).target_query);
            memset(&angle_step->sums, 0, sizeof angle_step->sums);
            for (angle_step->cursor = 0; angle_step->cursor < angle_step->query.count;
                 angle_step->cursor++) {
                CAIRN_STEP_CHARGE(angle_step, resume_pair, budget,
                                  1 + angle_step->target.count / POINTS_PER_UNIT);
                add_point(angle_step);
            }
            CAIRN_STEP_CHARGE(angle_step, resume_pair, budget, UNITS_PER_PAIR);
            take_pair(angle_step);
        }
    }
    CAIRN_STEP_END(angle_step->resume_pair);
}

/* ---- Solution ---- */

/* Robust weight of a pair from what the solution leaves in the direction of the step. */
static cairn_real weight_of(const pair_equations *pair, const cairn_real *x)
{
    cairn_real left = pair->b[STEP] - pair->a[0] * x[STEP] - pair->a[1] * x[OFFSET],
               z = pair->a[0] > 0 ? left / (cairn_sqrt(pair->a[0]) * PAIR_SCALE) : 0;

    return cairn_registration_cauchy(z * z, 1);
}

static void clear_solver(cairn_angle_step *angle_step)
{
    const cairn_real expected[UNKNOWNS] = {0, 0},
                     prior[UNKNOWNS] = {[STEP] = 1 / (STEP_SIGMA * STEP_SIGMA),
                                        [OFFSET] = 1 / (OFFSET_SIGMA_M * OFFSET_SIGMA_M)};

    cairn_scanner_check_clear(&angle_step->solver, UNKNOWNS, prior, expected);
}

/* Solves all pairs with weights of the solution before; in the first round all count alike. */
static int solve_pairs(cairn_angle_step *angle_step, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(angle_step->resume_solve);
    angle_step->is_solved = 0;
    for (angle_step->reweight = 0;
         angle_step->reweight < REWEIGHT_ROUNDS && angle_step->pair_count >= LEAST_PAIRS;
         angle_step->reweight++) {
        clear_solver(angle_step);
        for (angle_step->cursor = 0; angle_step->cursor < angle_step->pair_count;
             angle_step->cursor++) {
            const pair_equations *pair;

            CAIRN_STEP_CHARGE_UNIT(angle_step, resume_solve, budget);
            pair = &angle_step->pairs[angle_step->cursor];
            cairn_scanner_check_add(
                &angle_step->solver, pair->block,
                angle_step->reweight == 0 ? 1 : weight_of(pair, angle_step->solution.x), pair->a,
                pair->b);
        }
        CAIRN_STEP_CHARGE(angle_step, resume_solve, budget, UNITS_PER_SOLUTION);
        angle_step->is_solved =
            cairn_scanner_check_solve(&angle_step->solver, &angle_step->solution);
        if (!angle_step->is_solved)
            break;
    }
    CAIRN_STEP_END(angle_step->resume_solve);
}

/* Aligns all pairs with the step found so far. */
static int align_pairs(cairn_angle_step *angle_step, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(angle_step->resume_round);
    angle_step->pair_count = 0;
    angle_step->random = cairn_random_seed(RANDOM_SEED, 0);
    for (angle_step->candidate = 0; angle_step->candidate < angle_step->params.max_pairs;
         angle_step->candidate++) {
        CAIRN_STEP_CHARGE_UNIT(angle_step, resume_round, budget);
        CAIRN_STEP_RUN(angle_step, resume_round, budget, align);
    }
    CAIRN_STEP_END(angle_step->resume_round);
}

static void commit_result(cairn_angle_step *angle_step)
{
    cairn_angle_step_result *result = &angle_step->result;
    cairn_real sigma = angle_step->is_solved ? angle_step->solution.sigma[STEP] : 0;

    result->pairs = angle_step->pair_count;
    result->logged = cairn_abs(cairn_scan_correction_mean_step(&angle_step->scans[0].input));
    sigma = cairn_sqrt(sigma * sigma + SYSTEMATIC_SIGMA * SYSTEMATIC_SIGMA);
    if (angle_step->is_solved && sigma <= STEP_KNOWN && result->logged > 0) {
        result->ratio.value = angle_step->ratio;
        result->ratio.sigma = sigma;
        result->ratio.is_known = 1;
    }
    angle_step->is_running = 0;
}

static int run(cairn_angle_step *angle_step, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(angle_step->resume);
    for (angle_step->round = 0; angle_step->round < ROUNDS; angle_step->round++) {
        CAIRN_STEP_RUN(angle_step, resume, budget, align_pairs);
        CAIRN_STEP_RUN(angle_step, resume, budget, solve_pairs);
        if (!angle_step->is_solved)
            break;
        angle_step->ratio *= 1 + angle_step->solution.x[STEP];
    }
    commit_result(angle_step);
    CAIRN_STEP_END(angle_step->resume);
}

cairn_status cairn_angle_step_step(cairn_angle_step *angle_step, cairn_budget *budget)
{
    int32_t before;

    if (angle_step == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!angle_step->is_running)
        return CAIRN_OK;
    before = budget->left;
    if (before <= 0)
        return CAIRN_MORE;
    (void)run(angle_step, budget);
    angle_step->units += before - budget->left;
    return angle_step->is_running ? CAIRN_MORE : CAIRN_OK;
}

cairn_angle_step_result cairn_angle_step_read(const cairn_angle_step *angle_step)
{
    return angle_step->result;
}

int64_t cairn_angle_step_units(const cairn_angle_step *angle_step)
{
    return angle_step->units;
}

/* ---- The mistake ---- */

static int is_round(cairn_real step)
{
    cairn_real multiple = cairn_floor(step / ROUND_STEP_RAD + CAIRN_REAL(0.5));

    return multiple >= 1 && cairn_abs(step - multiple * ROUND_STEP_RAD) <= ROUND_TOLERANCE * step;
}

cairn_real cairn_angle_step_mistake(const cairn_scan_input *scan)
{
    cairn_real logged = cairn_abs(cairn_scan_correction_mean_step(scan)), other;

    if (scan->count < 2)
        return 0;
    other = logged * (cairn_real)(scan->count - 1) / (cairn_real)scan->count;
    return is_round(other) && !is_round(logged) ? other : 0;
}

int32_t cairn_angle_step_is_mistake(const cairn_angle_step_result *result, cairn_real mistake)
{
    cairn_scanner_check_value ratio = result->ratio;
    cairn_real deviation = cairn_abs(ratio.value - 1);

    return ratio.is_known && mistake > 0 && deviation > STEP_MATTERS &&
           deviation > SIGNIFICANCE_SIGMAS * ratio.sigma &&
           cairn_abs(ratio.value - mistake / result->logged) <= AGREEMENT_SIGMAS * ratio.sigma;
}
