/* What the initial poses say of the clusters of the aligner.
 *
 * The poses of a cluster and its initial poses differ by a motion of the cluster as a whole, its
 * gauge, and by what is left over of each scan. Sums of what is left at one gauge are kept for each
 * cluster (aligner_fit), about an origin amid its scans, so that all numbers stay small. From them
 * follows what is left at any other gauge, and of two clusters at their common one, without looking
 * at a single scan: with e the error of a scan, u its place from the origin, and a further motion
 * by s and a turn R, the error is e + s + (R - I) u. Only when some scan may lie outside the box in
 * which errors are expected, the scans are looked at one by one.
 *
 * The sums follow scans that come and go, and are found anew when poses have changed. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/aligner_work.h"

/* of the params' spread: hardly anything lies farther off */
static const cairn_real BOX = CAIRN_REAL(1.25);
/* what the params' spread weighs against what is learnt */
static const cairn_real EXPECTED_SCANS = 2;
/* m: makes turns comparable to shifts */
static const cairn_real ARM = CAIRN_REAL(1.5);
/* a metre */
static const cairn_real BEYOND_NATS = 100;

enum { SCANS_OF_UNIT = 2, CLUSTERS_OF_UNIT = 32 };

/* ---- Gauges ---- */

/* The weight of a heading, in square metres. */
static cairn_real heading_weight(const cairn_aligner *x)
{
    return x->sigma * x->sigma / (x->sigma_angle * x->sigma_angle);
}

/* The rotation by (cosine, sine), of any length, that brings p to q. */
static cairn_transform gauge_of(cairn_real cosine, cairn_real sine, cairn_vec2 p, cairn_vec2 q)
{
    cairn_real norm = cairn_sqrt(cosine * cosine + sine * sine);
    cairn_transform gauge;

    gauge.cosine = norm > 0 ? cosine / norm : 1;
    gauge.sine = norm > 0 ? sine / norm : 0;
    gauge.x = q.x - (gauge.cosine * p.x - gauge.sine * p.y);
    gauge.y = q.y - (gauge.sine * p.x + gauge.cosine * p.y);
    return gauge;
}

cairn_transform cairn_aligner_gauge(const cairn_aligner *x, int32_t cluster)
{
    cairn_real heading = heading_weight(x), sine = 0, cosine = 0,
               share = 1 / (cairn_real)x->clusters[cluster].size;
    cairn_vec2 p = {0, 0}, q = {0, 0};

    for (int32_t i = x->clusters[cluster].head; i >= 0; i = x->scans[i].next) {
        p.x += share * x->poses[i].x;
        p.y += share * x->poses[i].y;
        q.x += share * x->scans[i].initial.x;
        q.y += share * x->scans[i].initial.y;
    }
    for (int32_t i = x->clusters[cluster].head; i >= 0; i = x->scans[i].next) {
        cairn_transform pose = x->poses[i], initial = cairn_transform_of(x->scans[i].initial);
        cairn_vec2 u = {pose.x - p.x, pose.y - p.y}, v = {initial.x - q.x, initial.y - q.y};

        cosine += heading * (pose.cosine * initial.cosine + pose.sine * initial.sine) +
                  cairn_vec2_dot(u, v);
        sine += heading * (pose.cosine * initial.sine - pose.sine * initial.cosine) +
                cairn_vec2_cross(u, v);
    }
    return gauge_of(cosine, sine, p, q);
}

/* ---- What is left of the initial poses of a cluster ---- */

/* What is left of one scan after a gauge. */
typedef struct leftover {
    cairn_vec2 place, error;
    cairn_real turn;
} leftover;

static leftover leftover_of(const cairn_aligner *x, int32_t scan, cairn_transform gauge)
{
    const cairn_pose *initial = &x->scans[scan].initial;
    cairn_pose at = cairn_aligner_to_pose(cairn_aligner_compose(gauge, x->poses[scan]));
    leftover m = {{at.x, at.y},
                  {at.x - initial->x, at.y - initial->y},
                  cairn_wrap_angle(at.theta - initial->theta)};

    return m;
}

/* Adds a scan (sign 1) or takes it away (-1); what is greatest only grows. */
static void add_scan(const cairn_aligner *x, aligner_fit *fit, int32_t scan, cairn_real sign)
{
    leftover m = leftover_of(x, scan, fit->gauge);
    cairn_vec2 u = cairn_vec2_sub(m.place, fit->origin);
    cairn_real sine, cosine;

    cairn_sincos(m.turn, &sine, &cosine);
    fit->count += sign;
    fit->u = cairn_vec2_add(fit->u, cairn_vec2_scale(u, sign));
    fit->e = cairn_vec2_add(fit->e, cairn_vec2_scale(m.error, sign));
    fit->uu += sign * cairn_vec2_norm_squared(u);
    fit->ee += sign * cairn_vec2_norm_squared(m.error);
    fit->ue += sign * cairn_vec2_dot(u, m.error);
    fit->uxe += sign * cairn_vec2_cross(u, m.error);
    fit->turn += sign * m.turn;
    fit->turns += sign * m.turn * m.turn;
    fit->cosine += sign * cosine;
    fit->sine += sign * sine;
    fit->far = cairn_max(fit->far, cairn_max(cairn_abs(m.error.x), cairn_abs(m.error.y)));
    fit->turned = cairn_max(fit->turned, cairn_abs(m.turn));
    fit->radius = cairn_max(fit->radius, cairn_vec2_norm(u));
}

void cairn_aligner_fit_scan(cairn_aligner *x, int32_t scan, int32_t cluster, int32_t sign)
{
    aligner_fit *fit = &x->fits[cluster];

    if (fit->stamp != x->clusters[cluster].stamp || x->clusters[cluster].size == 0)
        return;
    add_scan(x, fit, scan, (cairn_real)sign);
    fit->stamp = x->changes + 1; /* that of the change at hand */
}

/* The sums of a cluster. */
static const aligner_fit *fit_of(cairn_aligner *x, int32_t cluster)
{
    aligner_fit *fit = &x->fits[cluster];
    int32_t head = x->clusters[cluster].head;
    cairn_transform middle;

    if (fit->stamp == x->clusters[cluster].stamp)
        return fit;
    memset(fit, 0, sizeof *fit);
    fit->stamp = x->clusters[cluster].stamp;
    fit->learnt = -1;
    fit->gauge = cairn_aligner_gauge(x, cluster);
    middle = cairn_aligner_compose(fit->gauge, x->poses[head]);
    fit->origin.x = middle.x;
    fit->origin.y = middle.y;
    for (int32_t i = head; i >= 0; i = x->scans[i].next)
        add_scan(x, fit, i, 1);
    x->debt += x->clusters[cluster].size / SCANS_OF_UNIT;
    return fit;
}

/* ---- Of one cluster or two, at their common gauge ---- */

/* A cluster, its motion as a whole into a common frame, and what that adds to the common gauge. */
typedef struct party {
    const aligner_fit *fit;
    int32_t cluster;
    cairn_transform moved;       /* of the fit's places */
    cairn_vec2 place, placement; /* mean of the places there, and of the initial ones */
} party;

static party party_of(cairn_aligner *x, int32_t cluster, cairn_transform motion)
{
    party m;
    cairn_vec2 mean;

    m.fit = fit_of(x, cluster);
    m.cluster = cluster;
    m.moved = cairn_aligner_compose(motion, cairn_aligner_inverse(m.fit->gauge));
    mean = cairn_vec2_add(m.fit->origin, cairn_vec2_scale(m.fit->u, 1 / m.fit->count));
    m.place = cairn_transform_point(m.moved, mean);
    m.placement = cairn_vec2_sub(mean, cairn_vec2_scale(m.fit->e, 1 / m.fit->count));
    return m;
}

/* The common gauge of parties: least squares over positions and headings, weighted by their
 * variances. */
static cairn_transform common_gauge(const cairn_aligner *x, const party *parties, int32_t count)
{
    cairn_real heading = heading_weight(x), cosine = 0, sine = 0, scans = 0;
    cairn_vec2 p = {0, 0}, q = {0, 0};

    for (int32_t k = 0; k < count; k++) {
        cairn_real n = parties[k].fit->count;

        scans += n;
        p = cairn_vec2_add(p, cairn_vec2_scale(cairn_vec2_sub(parties[k].place, p), n / scans));
        q = cairn_vec2_add(q, cairn_vec2_scale(cairn_vec2_sub(parties[k].placement, q), n / scans));
    }
    for (int32_t k = 0; k < count; k++) {
        const aligner_fit *f = parties[k].fit;
        cairn_real c = parties[k].moved.cosine, s = parties[k].moved.sine, n = f->count;
        cairn_vec2 a = cairn_vec2_sub(parties[k].place, p),
                   b = cairn_vec2_sub(parties[k].placement, q);
        /* About the means of this party. */
        cairn_real uu = f->uu - cairn_vec2_norm_squared(f->u) / n;
        cairn_real ue = f->ue - cairn_vec2_dot(f->u, f->e) / n,
                   uxe = f->uxe - cairn_vec2_cross(f->u, f->e) / n;

        cosine += c * uu - (c * ue + s * uxe) + n * cairn_vec2_dot(a, b) +
                  heading * (c * f->cosine - s * f->sine);
        sine += -s * uu - (c * uxe - s * ue) + n * cairn_vec2_cross(a, b) -
                heading * (s * f->cosine + c * f->sine);
    }
    return gauge_of(cosine, sine, p, q);
}

/* What is left of all scans of a party. */
typedef struct remains {
    cairn_real squares, squares_angle;
    cairn_real beyond; /* m outside the box; turns times ARM */
} remains;

static cairn_real beyond_box(const cairn_aligner *x, cairn_real x_error, cairn_real y_error,
                             cairn_real turn)
{
    cairn_real far = BOX * x->params.spread, turned = BOX * x->params.spread_angle;

    return cairn_max(cairn_abs(x_error) - far, 0) + cairn_max(cairn_abs(y_error) - far, 0) +
           ARM * cairn_max(cairn_abs(turn) - turned, 0);
}

/* Scan by scan. */
static remains look_through(cairn_aligner *x, int32_t cluster, cairn_transform gauge)
{
    remains m = {0, 0, 0};

    for (int32_t i = x->clusters[cluster].head; i >= 0; i = x->scans[i].next) {
        leftover one = leftover_of(x, i, gauge);

        m.squares += cairn_vec2_norm_squared(one.error);
        m.squares_angle += one.turn * one.turn;
        m.beyond += beyond_box(x, one.error.x, one.error.y, one.turn);
    }
    x->debt += x->clusters[cluster].size / SCANS_OF_UNIT;
    return m;
}

/* By the sums where they tell all; common: the gauge of the frame that the party was moved into. */
static remains remains_of(cairn_aligner *x, const party *own, cairn_transform common)
{
    const aligner_fit *f = own->fit;
    cairn_transform motion = cairn_aligner_compose(common, own->moved);
    cairn_vec2 s = cairn_vec2_sub(cairn_transform_point(motion, f->origin), f->origin), turned;
    cairn_real sine = motion.sine,
               lost = motion.cosine > 0 ? sine * sine / (1 + motion.cosine) : 1 - motion.cosine;
    cairn_real turn = cairn_atan2(sine, motion.cosine),
               stray = cairn_vec2_norm(s) + cairn_abs(turn) * f->radius;
    remains m;

    if (beyond_box(x, f->far + stray, 0, f->turned + cairn_abs(turn)) > 0)
        return look_through(
            x, own->cluster,
            cairn_aligner_compose(common, cairn_aligner_compose(own->moved, f->gauge)));
    turned.x = -lost * f->u.x - sine * f->u.y;
    turned.y = sine * f->u.x - lost * f->u.y;
    m.squares = f->ee + f->count * cairn_vec2_norm_squared(s) + 2 * cairn_vec2_dot(s, f->e) +
                2 * lost * f->uu + 2 * cairn_vec2_dot(s, turned) +
                2 * (sine * f->uxe - lost * f->ue);
    m.squares_angle = f->turns + 2 * turn * f->turn + f->count * turn * turn;
    m.beyond = 0;
    return m;
}

static cairn_real chi_squared(const cairn_aligner *x, const remains *m)
{
    return m->squares / (x->sigma * x->sigma) +
           m->squares_angle / (x->sigma_angle * x->sigma_angle) + 2 * BEYOND_NATS * m->beyond;
}

/* What is left of a cluster by itself. */
static remains own_remains(cairn_aligner *x, int32_t cluster)
{
    cairn_transform same = {0, 0, 1, 0};
    party alone = party_of(x, cluster, same);

    return remains_of(x, &alone, common_gauge(x, &alone, 1));
}

static cairn_real own_misfit(cairn_aligner *x, int32_t cluster)
{
    remains m;

    if (x->clusters[cluster].size < 2)
        return 0;
    m = own_remains(x, cluster);
    return chi_squared(x, &m);
}

cairn_real cairn_aligner_prior(cairn_aligner *x, int32_t moving, int32_t fixed,
                               cairn_transform pose)
{
    cairn_transform same = {0, 0, 1, 0}, common;
    cairn_real together = 0;
    party parties[2];

    parties[0] = party_of(x, moving, pose);
    parties[1] = party_of(x, fixed, same);
    common = common_gauge(x, parties, 2);
    for (int k = 0; k < 2; k++) {
        remains m = remains_of(x, &parties[k], common);

        together += chi_squared(x, &m);
    }
    x->debt += 4;
    return -(together - own_misfit(x, moving) - own_misfit(x, fixed)) / 2;
}

/* What is left of a cluster by itself at the standard deviations that the params expect; found
 * anew when it has changed. */
static const aligner_fit *learn_from(cairn_aligner *x, int32_t cluster)
{
    aligner_fit *fit = &x->fits[cluster];
    remains m;

    if (fit->stamp == x->clusters[cluster].stamp && fit->learnt == fit->stamp)
        return fit;
    m = own_remains(x, cluster);
    fit->learnt = fit->stamp;
    fit->squares = m.squares;
    fit->squares_angle = m.squares_angle;
    x->debt++;
    return fit;
}

void cairn_aligner_learn_spread(cairn_aligner *x)
{
    cairn_real expected = x->params.spread * x->params.spread / 3;
    cairn_real expected_angle = x->params.spread_angle * x->params.spread_angle / 3;
    cairn_real squares = EXPECTED_SCANS * 2 * expected,
               squares_angle = EXPECTED_SCANS * expected_angle;
    cairn_real count = EXPECTED_SCANS;

    x->debt += x->scan_count / CLUSTERS_OF_UNIT;
    x->sigma = cairn_sqrt(expected);
    x->sigma_angle = cairn_sqrt(expected_angle);
    for (int32_t c = 0; c < x->scan_count; c++)
        if (x->clusters[c].size > 1) {
            const aligner_fit *fit = learn_from(x, c);

            squares += fit->squares;
            squares_angle += fit->squares_angle;
            count += (cairn_real)(x->clusters[c].size - 1);
        }
    x->sigma = cairn_min(x->sigma, cairn_sqrt(squares / (2 * count)));
    x->sigma_angle = cairn_min(x->sigma_angle, cairn_sqrt(squares_angle / count));
}
