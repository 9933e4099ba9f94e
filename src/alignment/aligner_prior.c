/* aligner: prior of the initial poses for clusters and their merges.
 *
 * Method: the initial poses differ from a cluster's poses by a common motion (the gauge) and by a
 * residual of each scan.
 * 1. Sums of the residuals at one gauge are stored per cluster, about an origin near its scans, so
 *    that all numbers stay small.
 * 2. The chi-squared at any other gauge, and of two clusters at their common one, follows from the
 *    sums without visiting the scans. A further motion by s and a rotation R changes the residual e
 *    of a scan at position u from the origin to e + s + (R - I) u.
 * 3. When a scan may lie outside the box of expected errors, the scans are visited one by one.
 * 4. The variances are estimated from the residuals of all clusters, with the params as a prior.
 * The sums are updated as scans enter and leave, and computed anew when poses have changed. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/aligner_work.h"

/* factor on the params' error bounds: half side of the box */
static const cairn_real BOX_FACTOR = CAIRN_REAL(1.25);
/* weight of the params' prior, in scans */
static const cairn_real PRIOR_SCANS = 2;
/* nats per metre outside the box */
static const cairn_real OUTSIDE_NATS_PER_M = 100;

enum { SCANS_PER_UNIT = 2, CLUSTERS_PER_UNIT = 32, UNITS_PER_PRIOR = 4 };

/* ---- Gauges ---- */

/* Returns the weight of a heading, m^2. */
static cairn_real heading_weight(const cairn_aligner *aligner)
{
    return aligner->sigma * aligner->sigma / (aligner->sigma_angle * aligner->sigma_angle);
}

/* Returns the gauge with the rotation by (cosine, sine), of any length, that maps p to q. */
static cairn_transform gauge_of(cairn_real cosine, cairn_real sine, cairn_vec2 p, cairn_vec2 q)
{
    cairn_real norm = cairn_sqrt(cosine * cosine + sine * sine);

    return norm > 0 ? cairn_transform_mapping(cosine / norm, sine / norm, p, q)
                    : cairn_transform_mapping(1, 0, p, q);
}

cairn_transform cairn_aligner_gauge(const cairn_aligner *aligner, int32_t cluster)
{
    cairn_real heading = heading_weight(aligner), sine = 0, cosine = 0,
               share = 1 / (cairn_real)aligner->clusters[cluster].size;
    cairn_vec2 p = {0, 0}, q = {0, 0};

    for (int32_t i = aligner->clusters[cluster].head; i >= 0;
         i = aligner->scans[i].next_in_cluster) {
        p.x += share * aligner->poses[i].x;
        p.y += share * aligner->poses[i].y;
        q.x += share * aligner->scans[i].initial.x;
        q.y += share * aligner->scans[i].initial.y;
    }
    for (int32_t i = aligner->clusters[cluster].head; i >= 0;
         i = aligner->scans[i].next_in_cluster) {
        cairn_transform pose = aligner->poses[i],
                        initial = cairn_transform_of(aligner->scans[i].initial);
        cairn_vec2 u = {pose.x - p.x, pose.y - p.y}, v = {initial.x - q.x, initial.y - q.y};

        cosine += heading * (pose.cosine * initial.cosine + pose.sine * initial.sine) +
                  cairn_vec2_dot(u, v);
        sine += heading * (pose.cosine * initial.sine - pose.sine * initial.cosine) +
                cairn_vec2_cross(u, v);
    }
    return gauge_of(cosine, sine, p, q);
}

/* ---- Residuals of a cluster's initial poses ---- */

/* Residual of one scan after a gauge. */
typedef struct residual {
    cairn_vec2 place, error;
    cairn_real turn;
} residual;

static residual residual_of(const cairn_aligner *aligner, int32_t scan, cairn_transform gauge)
{
    const cairn_pose *initial = &aligner->scans[scan].initial;
    cairn_pose at = cairn_pose_of(cairn_transform_compose(gauge, aligner->poses[scan]));
    residual m = {{at.x, at.y},
                  {at.x - initial->x, at.y - initial->y},
                  cairn_wrap_angle(at.theta - initial->theta)};

    return m;
}

/* Adds a scan (sign 1) or removes it (-1); the maxima only grow. */
static void add_scan(const cairn_aligner *aligner, aligner_prior_sums *fit, int32_t scan,
                     cairn_real sign)
{
    residual m = residual_of(aligner, scan, fit->gauge);
    cairn_vec2 u = cairn_vec2_sub(m.place, fit->origin);
    cairn_real sine, cosine;

    cairn_sincos(m.turn, &sine, &cosine);
    fit->count += sign;
    fit->positions = cairn_vec2_add(fit->positions, cairn_vec2_scale(u, sign));
    fit->errors = cairn_vec2_add(fit->errors, cairn_vec2_scale(m.error, sign));
    fit->squared_positions += sign * cairn_vec2_norm_squared(u);
    fit->squared_errors += sign * cairn_vec2_norm_squared(m.error);
    fit->dot_products += sign * cairn_vec2_dot(u, m.error);
    fit->cross_products += sign * cairn_vec2_cross(u, m.error);
    fit->sum_angle += sign * m.turn;
    fit->sum_angle2 += sign * m.turn * m.turn;
    fit->cosine += sign * cosine;
    fit->sine += sign * sine;
    fit->max_error =
        cairn_max(fit->max_error, cairn_max(cairn_abs(m.error.x), cairn_abs(m.error.y)));
    fit->max_angle_error = cairn_max(fit->max_angle_error, cairn_abs(m.turn));
    fit->radius = cairn_max(fit->radius, cairn_vec2_norm(u));
}

void cairn_aligner_update_prior_sums(cairn_aligner *aligner, int32_t scan, int32_t cluster,
                                     int32_t sign)
{
    aligner_prior_sums *fit = &aligner->prior_sums[cluster];

    if (fit->stamp != aligner->clusters[cluster].stamp || aligner->clusters[cluster].size == 0)
        return;
    add_scan(aligner, fit, scan, (cairn_real)sign);
    fit->stamp = aligner->change_count + 1; /* the stamp of the change that follows */
}

static int is_outdated(const cairn_aligner *aligner, int32_t cluster)
{
    return aligner->prior_sums[cluster].stamp != aligner->clusters[cluster].stamp;
}

/* Returns the units of the sums of a cluster. */
static int32_t sums_units(const cairn_aligner *aligner, int32_t cluster)
{
    return is_outdated(aligner, cluster) ? aligner->clusters[cluster].size / SCANS_PER_UNIT : 0;
}

/* Returns the sums of a cluster, computed anew if outdated. */
static const aligner_prior_sums *sums_of(cairn_aligner *aligner, int32_t cluster)
{
    aligner_prior_sums *fit = &aligner->prior_sums[cluster];
    int32_t head = aligner->clusters[cluster].head;
    cairn_transform middle;

    if (!is_outdated(aligner, cluster))
        return fit;
    memset(fit, 0, sizeof *fit);
    fit->stamp = aligner->clusters[cluster].stamp;
    fit->estimate_stamp = -1;
    fit->gauge = cairn_aligner_gauge(aligner, cluster);
    middle = cairn_transform_compose(fit->gauge, aligner->poses[head]);
    fit->origin.x = middle.x;
    fit->origin.y = middle.y;
    for (int32_t i = head; i >= 0; i = aligner->scans[i].next_in_cluster)
        add_scan(aligner, fit, i, 1);
    return fit;
}

/* ---- One cluster or two, at their common gauge ---- */

/* A cluster in a common frame, and its contribution to the common gauge. */
typedef struct gauge_member {
    const aligner_prior_sums *fit;
    int32_t cluster;
    cairn_transform moved;       /* motion of the sums' positions */
    cairn_vec2 place, placement; /* means of its positions there, and of the initial ones */
} gauge_member;

static gauge_member member_of(cairn_aligner *aligner, int32_t cluster, cairn_transform motion)
{
    gauge_member m;
    cairn_vec2 mean;

    m.fit = sums_of(aligner, cluster);
    m.cluster = cluster;
    m.moved = cairn_transform_compose(motion, cairn_transform_inverse(m.fit->gauge));
    mean = cairn_vec2_add(m.fit->origin, cairn_vec2_scale(m.fit->positions, 1 / m.fit->count));
    m.place = cairn_transform_point(m.moved, mean);
    m.placement = cairn_vec2_sub(mean, cairn_vec2_scale(m.fit->errors, 1 / m.fit->count));
    return m;
}

/* Returns the common gauge of the clusters: least squares over positions and headings. */
static cairn_transform common_gauge(const cairn_aligner *aligner, const gauge_member *parties,
                                    int32_t count)
{
    cairn_real heading = heading_weight(aligner), cosine = 0, sine = 0, scans = 0;
    cairn_vec2 p = {0, 0}, q = {0, 0};

    for (int32_t k = 0; k < count; k++) {
        cairn_real n = parties[k].fit->count;

        scans += n;
        p = cairn_vec2_add(p, cairn_vec2_scale(cairn_vec2_sub(parties[k].place, p), n / scans));
        q = cairn_vec2_add(q, cairn_vec2_scale(cairn_vec2_sub(parties[k].placement, q), n / scans));
    }
    for (int32_t k = 0; k < count; k++) {
        const aligner_prior_sums *f = parties[k].fit;
        cairn_real c = parties[k].moved.cosine, s = parties[k].moved.sine, n = f->count;
        cairn_vec2 a = cairn_vec2_sub(parties[k].place, p),
                   b = cairn_vec2_sub(parties[k].placement, q);
        /* About the means of this cluster. */
        cairn_real uu = f->squared_positions - cairn_vec2_norm_squared(f->positions) / n;
        cairn_real ue = f->dot_products - cairn_vec2_dot(f->positions, f->errors) / n,
                   uxe = f->cross_products - cairn_vec2_cross(f->positions, f->errors) / n;

        cosine += c * uu - (c * ue + s * uxe) + n * cairn_vec2_dot(a, b) +
                  heading * (c * f->cosine - s * f->sine);
        sine += -s * uu - (c * uxe - s * ue) + n * cairn_vec2_cross(a, b) -
                heading * (s * f->cosine + c * f->sine);
    }
    return gauge_of(cosine, sine, p, q);
}

/* Sums of the residuals of a cluster's scans. */
typedef struct residual_sums {
    cairn_real squares, squares_angle;
    cairn_real beyond; /* m outside the box; rotations times ALIGNER_ARM_M */
} residual_sums;

static cairn_real distance_outside_box(const cairn_aligner *aligner, cairn_real x_error,
                                       cairn_real y_error, cairn_real turn)
{
    cairn_real far = BOX_FACTOR * aligner->params.max_initial_error,
               turned = BOX_FACTOR * aligner->params.max_initial_angle_error;

    return cairn_max(cairn_abs(x_error) - far, 0) + cairn_max(cairn_abs(y_error) - far, 0) +
           ALIGNER_ARM_M * cairn_max(cairn_abs(turn) - turned, 0);
}

/* Visits the scans one by one. */
static residual_sums visit_scans(const cairn_aligner *aligner, int32_t cluster,
                                 cairn_transform gauge)
{
    residual_sums m = {0, 0, 0};

    for (int32_t i = aligner->clusters[cluster].head; i >= 0;
         i = aligner->scans[i].next_in_cluster) {
        residual one = residual_of(aligner, i, gauge);

        m.squares += cairn_vec2_norm_squared(one.error);
        m.squares_angle += one.turn * one.turn;
        m.beyond += distance_outside_box(aligner, one.error.x, one.error.y, one.turn);
    }
    return m;
}

/* Computes the residuals from the sums where possible; common: the gauge of the frame that the
 * cluster was moved into. visited: NULL, or the scans to visit are only added up. */
static residual_sums residual_sums_of(const cairn_aligner *aligner, const gauge_member *own,
                                      cairn_transform common, int32_t *visited)
{
    const aligner_prior_sums *f = own->fit;
    cairn_transform motion = cairn_transform_compose(common, own->moved);
    cairn_vec2 s = cairn_vec2_sub(cairn_transform_point(motion, f->origin), f->origin), turned;
    cairn_real sine = motion.sine,
               lost = motion.cosine > 0 ? sine * sine / (1 + motion.cosine) : 1 - motion.cosine;
    cairn_real turn = cairn_atan2(sine, motion.cosine),
               stray = cairn_vec2_norm(s) + cairn_abs(turn) * f->radius;
    residual_sums m = {0, 0, 0};

    if (distance_outside_box(aligner, f->max_error + stray, 0,
                             f->max_angle_error + cairn_abs(turn)) > 0) {
        if (visited != NULL) {
            *visited += aligner->clusters[own->cluster].size;
            return m;
        }
        return visit_scans(
            aligner, own->cluster,
            cairn_transform_compose(common, cairn_transform_compose(own->moved, f->gauge)));
    }
    turned.x = -lost * f->positions.x - sine * f->positions.y;
    turned.y = sine * f->positions.x - lost * f->positions.y;
    m.squares = f->squared_errors + f->count * cairn_vec2_norm_squared(s) +
                2 * cairn_vec2_dot(s, f->errors) + 2 * lost * f->squared_positions +
                2 * cairn_vec2_dot(s, turned) +
                2 * (sine * f->cross_products - lost * f->dot_products);
    m.squares_angle = f->sum_angle2 + 2 * turn * f->sum_angle + f->count * turn * turn;
    return m;
}

static cairn_real chi_squared(const cairn_aligner *aligner, const residual_sums *sums)
{
    return sums->squares / (aligner->sigma * aligner->sigma) +
           sums->squares_angle / (aligner->sigma_angle * aligner->sigma_angle) +
           2 * OUTSIDE_NATS_PER_M * sums->beyond;
}

/* Residuals of a cluster at its own gauge; visited: as above. */
static residual_sums own_residual_sums(cairn_aligner *aligner, int32_t cluster, int32_t *visited)
{
    cairn_transform same = {0, 0, 1, 0};
    gauge_member alone = member_of(aligner, cluster, same);

    return residual_sums_of(aligner, &alone, common_gauge(aligner, &alone, 1), visited);
}

static cairn_real own_chi2(cairn_aligner *aligner, int32_t cluster, int32_t *visited)
{
    residual_sums m;

    if (aligner->clusters[cluster].size < 2)
        return 0;
    m = own_residual_sums(aligner, cluster, visited);
    return chi_squared(aligner, &m);
}

cairn_real cairn_aligner_prior(cairn_aligner *aligner, int32_t moving, int32_t fixed,
                               cairn_transform pose, int32_t *visited)
{
    cairn_transform same = {0, 0, 1, 0}, common;
    cairn_real together = 0;
    gauge_member parties[2];

    parties[0] = member_of(aligner, moving, pose);
    parties[1] = member_of(aligner, fixed, same);
    common = common_gauge(aligner, parties, 2);
    for (int k = 0; k < 2; k++) {
        residual_sums m = residual_sums_of(aligner, &parties[k], common, visited);

        together += chi_squared(aligner, &m);
    }
    return -(together - own_chi2(aligner, moving, visited) - own_chi2(aligner, fixed, visited)) / 2;
}

int cairn_aligner_find_prior(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_evaluation *e = &aligner->evaluation;

    CAIRN_STEP_BEGIN(aligner->resume.prior);
    ALIGNER_CHARGE(prior, UNITS_PER_PRIOR + sums_units(aligner, e->moving) +
                              sums_units(aligner, e->fixed));
    aligner->visited = 0;
    (void)cairn_aligner_prior(aligner, e->moving, e->fixed, e->pose, &aligner->visited);
    ALIGNER_CHARGE(prior, aligner->visited / SCANS_PER_UNIT);
    e->log_prior = cairn_aligner_prior(aligner, e->moving, e->fixed, e->pose, NULL);
    CAIRN_STEP_END(aligner->resume.prior);
}

/* Returns 1 when the residuals of a cluster are those of its poses. */
static int is_estimated(const cairn_aligner *aligner, int32_t cluster)
{
    return !is_outdated(aligner, cluster) &&
           aligner->prior_sums[cluster].estimate_stamp == aligner->prior_sums[cluster].stamp;
}

/* Computes the residuals of a cluster at its own gauge. */
static void update_estimate(cairn_aligner *aligner, int32_t cluster)
{
    aligner_prior_sums *fit = &aligner->prior_sums[cluster];
    residual_sums m = own_residual_sums(aligner, cluster, NULL);

    fit->estimate_stamp = fit->stamp;
    fit->squares = m.squares;
    fit->squares_angle = m.squares_angle;
}

/* Expected squares of the errors of an initial pose: of x and y, and of the heading. */
static cairn_real expected_square(const cairn_aligner *aligner)
{
    return aligner->params.max_initial_error * aligner->params.max_initial_error / 3;
}

static cairn_real expected_square_angle(const cairn_aligner *aligner)
{
    return aligner->params.max_initial_angle_error * aligner->params.max_initial_angle_error / 3;
}

void cairn_aligner_expect_sigmas(cairn_aligner *aligner)
{
    aligner->sigma = cairn_sqrt(expected_square(aligner));
    aligner->sigma_angle = cairn_sqrt(expected_square_angle(aligner));
}

static void begin_sigmas(cairn_aligner *aligner)
{
    cairn_aligner_expect_sigmas(aligner);
    aligner->sigmas.squares = PRIOR_SCANS * 2 * expected_square(aligner);
    aligner->sigmas.squares_angle = PRIOR_SCANS * expected_square_angle(aligner);
    aligner->sigmas.count = PRIOR_SCANS;
}

static void add_cluster(cairn_aligner *aligner, int32_t cluster)
{
    const aligner_prior_sums *fit = &aligner->prior_sums[cluster];

    aligner->sigmas.squares += fit->squares;
    aligner->sigmas.squares_angle += fit->squares_angle;
    aligner->sigmas.count += (cairn_real)(aligner->clusters[cluster].size - 1);
}

int cairn_aligner_estimate_sigmas(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_sigmas *sigmas = &aligner->sigmas;

    CAIRN_STEP_BEGIN(aligner->resume.sigmas);
    ALIGNER_CHARGE(sigmas, aligner->scan_count / CLUSTERS_PER_UNIT);
    begin_sigmas(aligner);
    for (sigmas->cluster = 0; sigmas->cluster < aligner->scan_count; sigmas->cluster++) {
        if (aligner->clusters[sigmas->cluster].size < 2)
            continue;
        if (!is_estimated(aligner, sigmas->cluster)) {
            ALIGNER_CHARGE(sigmas, 1 + sums_units(aligner, sigmas->cluster));
            aligner->visited = 0;
            (void)own_residual_sums(aligner, sigmas->cluster, &aligner->visited);
            ALIGNER_CHARGE(sigmas, aligner->visited / SCANS_PER_UNIT);
            update_estimate(aligner, sigmas->cluster);
        }
        add_cluster(aligner, sigmas->cluster);
    }
    aligner->sigma = cairn_min(aligner->sigma, cairn_sqrt(sigmas->squares / (2 * sigmas->count)));
    aligner->sigma_angle =
        cairn_min(aligner->sigma_angle, cairn_sqrt(sigmas->squares_angle / sigmas->count));
    CAIRN_STEP_END(aligner->resume.sigmas);
}
