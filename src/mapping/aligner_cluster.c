/* Clusters of the aligner: scans whose poses are known to each other, in a frame of their own.
 *
 * A look at one cluster from another refines their relative pose by Gauss-Newton on all pairs of
 * scans that may meet and then counts the evidence of these. The initial poses are evidence, too
 * (aligner_prior.c): how much worse the initial poses of both fit a common motion than those of
 * each alone. Their standard deviations are learnt from the clusters themselves, starting from
 * what the params expect. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/aligner_work.h"

static const cairn_real COUNT_GATE = CAIRN_REAL(0.07);
/* m: makes turns comparable to shifts */
static const cairn_real ARM = CAIRN_REAL(1.5);
/* m: a scan that moves by less does not stir others */
static const cairn_real AT_REST = CAIRN_REAL(0.006);

void cairn_aligner_insert(cairn_aligner *x, int32_t scan, int32_t cluster)
{
    aligner_cluster *c = &x->clusters[cluster];

    cairn_aligner_fit_scan(x, scan, cluster, 1);
    x->scans[scan].part = cluster;
    x->scans[scan].next = c->head;
    c->head = scan;
    c->size++;
    c->stamp = ++x->changes;
}

void cairn_aligner_remove(cairn_aligner *x, int32_t scan)
{
    aligner_cluster *c = &x->clusters[x->scans[scan].part];
    int32_t *link = &c->head;

    cairn_aligner_fit_scan(x, scan, x->scans[scan].part, -1);
    while (*link != scan)
        link = &x->scans[*link].next;
    *link = x->scans[scan].next;
    x->scans[scan].next = -1;
    c->size--;
    c->stamp = ++x->changes;
}

int32_t cairn_aligner_largest(const cairn_aligner *x)
{
    int32_t best = 0;

    for (int32_t c = 1; c < x->scan_count; c++)
        if (x->clusters[c].size > x->clusters[best].size)
            best = c;
    return best;
}

void cairn_aligner_begin_clusters(cairn_aligner *x)
{
    static const cairn_vec2 x_axis = {1, 0};

    memset(x->clusters, 0, ((size_t)x->scan_count + 1) * sizeof *x->clusters);
    for (int32_t i = 0; i <= x->scan_count; i++)
        x->clusters[i].head = x->fits[i].stamp = -1;
    for (int32_t i = 0; i < x->scan_count; i++) {
        x->poses[i] = cairn_transform_of(x->scans[i].initial);
        x->scans[i].support = x->scans[i].evidence = 0;
        x->scans[i].weak = x->scans[i].stirred = 0;
        x->scans[i].joined = -1 - i;
        x->scans[i].frame = x_axis;
        memset(&x->scans[i].pull, 0, sizeof x->scans[i].pull);
        cairn_aligner_insert(x, i, i);
    }
    cairn_aligner_learn_spread(x);
}

/* ---- Looks ---- */

void cairn_aligner_begin_look(cairn_aligner *x, int32_t moving, int32_t fixed, cairn_transform pose,
                              int32_t rounds, cairn_real least)
{
    aligner_look *look = &x->look;
    int32_t first = x->clusters[moving].head;

    memset(look, 0, sizeof *look);
    look->active = 1;
    look->moving = moving;
    look->fixed = fixed;
    look->pose = pose;
    look->rounds = rounds;
    look->least = least;
    look->outer = x->clusters[moving].size <= x->clusters[fixed].size ? moving : fixed;
    look->inner = look->outer == moving ? fixed : moving;
    look->at = x->clusters[look->outer].head;
    look->centre =
        cairn_transform_point(cairn_aligner_compose(pose, x->poses[first]), x->scans[first].middle);
}

static cairn_real refine_gate(int32_t round)
{
    static const cairn_real gates[] = {CAIRN_REAL(0.15), CAIRN_REAL(0.10), CAIRN_REAL(0.07)};

    return gates[round < 2 ? round : 2];
}

static void find_weak(aligner_look *look)
{
    cairn_sym3 m = look->sums.equations.information;
    cairn_real values[3], vectors[3][3];

    m.xz /= ARM;
    m.yz /= ARM;
    m.zz /= ARM * ARM;
    cairn_sym3_eigen(m, values, vectors);
    memcpy(look->weak, vectors[0], sizeof look->weak);
    look->weak[2] /= ARM;
}

static void end_refinement(aligner_look *look)
{
    cairn_real motion[3];

    find_weak(look);
    if (cairn_aligner_solve(&look->sums, motion))
        look->pose = cairn_aligner_moved(look->pose, look->centre, motion);
    else
        look->round = look->rounds - 1;
    memset(&look->sums, 0, sizeof look->sums);
    look->round++;
}

static void end_look(cairn_aligner *x)
{
    aligner_look *look = &x->look;

    look->active = 0;
    look->evidence = cairn_aligner_evidence(x, look->count);
    look->prior = cairn_aligner_prior(x, look->moving, look->fixed, look->pose);
}

/* The points of a pair, a of the outer cluster; returns how many were looked up. */
static int32_t look_at_pair(cairn_aligner *x, int32_t a, int32_t b, cairn_transform pose_a,
                            cairn_transform pose_b)
{
    aligner_look *look = &x->look;
    int32_t turn = look->outer != look->moving, i = turn ? b : a, j = turn ? a : b;
    cairn_transform pose_i = turn ? pose_b : pose_a, pose_j = turn ? pose_a : pose_b;

    if (look->round < look->rounds)
        return cairn_aligner_pull(x, i, j, pose_i, pose_j, refine_gate(look->round), 1,
                                  look->centre, &look->sums);
    return cairn_aligner_count_pair(x, i, j, cairn_aligner_between(pose_j, pose_i), COUNT_GATE,
                                    &look->count);
}

/* 1 when the rest of the points is not worth counting. */
static int is_decided(const cairn_aligner *x)
{
    return x->look.round >= x->look.rounds &&
           cairn_aligner_evidence(x, x->look.count) <= x->look.least;
}

/* A scan of the outer cluster from its partner at hand on, up to the next that it may meet. */
int32_t cairn_aligner_look_item(cairn_aligner *x)
{
    aligner_look *look = &x->look;
    cairn_transform same = {0, 0, 1, 0}, to_outer, to_inner, pose_a;
    int32_t a = look->at, passed = 0, work = 0;

    if (a < 0 || is_decided(x)) {
        if (look->round < look->rounds)
            end_refinement(look);
        else
            end_look(x);
        look->at = x->clusters[look->outer].head;
        return 4;
    }
    to_outer = look->outer == look->moving ? look->pose : same;
    to_inner = look->outer == look->moving ? same : look->pose;
    pose_a = cairn_aligner_compose(to_outer, x->poses[a]);
    while (work == 0 && look->partner < x->scans[a].partner_count) {
        int32_t b = cairn_aligner_partner(x, a, look->partner++);
        cairn_transform pose_b;

        passed++;
        if (x->scans[b].part != look->inner)
            continue;
        pose_b = cairn_aligner_compose(to_inner, x->poses[b]);
        if (cairn_aligner_may_meet(x, a, b, pose_a, pose_b))
            work = look_at_pair(x, a, b, pose_a, pose_b);
    }
    if (look->partner >= x->scans[a].partner_count) {
        look->at = x->scans[a].next;
        look->partner = 0;
    }
    return 1 + passed / ALIGNER_FAR_OF_UNIT + work / ALIGNER_POINTS_OF_UNIT;
}

/* ---- Relaxation ---- */

void cairn_aligner_begin_relax(cairn_aligner *x, int32_t cluster, cairn_real gate, int32_t rounds,
                               int32_t all)
{
    aligner_relax *relax = &x->relax;

    memset(relax, 0, sizeof *relax);
    relax->active = rounds > 0 && x->clusters[cluster].size > 1;
    relax->all = all;
    relax->cluster = cluster;
    relax->rounds = rounds;
    relax->gate = gate;
    relax->i = x->clusters[cluster].head;
}

static void end_round(cairn_aligner *x)
{
    aligner_relax *relax = &x->relax;

    relax->i = x->clusters[relax->cluster].head;
    relax->active = ++relax->round < relax->rounds;
    relax->all = 0;
    if (relax->active)
        return;
    x->clusters[relax->cluster].stamp = ++x->changes;
    cairn_aligner_learn_spread(x);
}

static int is_move(const cairn_real motion[3])
{
    return cairn_max(cairn_abs(motion[0]), cairn_abs(motion[1])) + ARM * cairn_abs(motion[2]) >
           AT_REST;
}

static void add_sums(aligner_sums *to, const aligner_sums *from)
{
    cairn_sym3 *m = &to->equations.information;
    const cairn_sym3 *n = &from->equations.information;

    m->xx += n->xx;
    m->xy += n->xy;
    m->xz += n->xz;
    m->yy += n->yy;
    m->yz += n->yz;
    m->zz += n->zz;
    for (int k = 0; k < 3; k++)
        to->equations.gradient[k] += from->equations.gradient[k];
    to->pairs += from->pairs;
}

/* 1 when two scans have been relaxed together in a cluster before. */
static int have_met(const cairn_aligner *x, int32_t i, int32_t j)
{
    return x->scans[i].stirred != ALIGNER_JOINED || x->scans[i].joined == x->scans[j].joined;
}

/* Adds to the pull on scan j what has changed of that between scan i and it: by the motion of i,
 * and, when they have not met before, all of it. j is stirred when that would move it. */
static void pass_on(cairn_aligner *x, int32_t i, int32_t j, const aligner_sums *pair,
                    const cairn_real motion[3])
{
    const aligner_scan *scan = &x->scans[i];
    aligner_scan *partner = &x->scans[j];
    cairn_vec2 from = cairn_transform_point(x->poses[i], scan->middle);
    cairn_vec2 arm = cairn_vec2_sub(from, cairn_transform_point(x->poses[j], partner->middle));
    const cairn_sym3 *m = &pair->equations.information;
    int met = have_met(x, i, j);
    cairn_real moved[3], pull[3];

    pull[0] = m->xx * motion[0] + m->xy * motion[1] + m->xz * motion[2];
    pull[1] = m->xy * motion[0] + m->yy * motion[1] + m->yz * motion[2];
    pull[2] = m->xz * motion[0] + m->yz * motion[1] + m->zz * motion[2];
    for (int k = 0; k < 3 && !met; k++)
        pull[k] += pair->equations.gradient[k];
    pull[2] += arm.x * pull[1] - arm.y * pull[0];
    for (int k = 0; k < 3; k++)
        partner->pull.equations.gradient[k] -= pull[k];
    if (partner->stirred == 0 &&
        (partner->pull.pairs < 3 || (cairn_aligner_solve(&partner->pull, moved) && is_move(moved))))
        partner->stirred = ALIGNER_MET;
}

static void next_scan(cairn_aligner *x)
{
    aligner_relax *relax = &x->relax;

    memset(relax->pairs, 0, sizeof relax->pairs);
    memset(&relax->sums, 0, sizeof relax->sums);
    relax->i = x->scans[relax->i].next;
    relax->partner = relax->old = 0;
    if (relax->i < 0)
        end_round(x);
}

static void end_scan(cairn_aligner *x, const cairn_real motion[3])
{
    aligner_relax *relax = &x->relax;
    aligner_scan *scan = &x->scans[relax->i];
    cairn_transform *pose = &x->poses[relax->i];
    cairn_vec2 centre = cairn_transform_point(*pose, scan->middle);

    for (int32_t k = 0; k < scan->partner_count; k++)
        if (relax->pairs[k].pairs > 0)
            pass_on(x, relax->i, cairn_aligner_partner(x, relax->i, k), &relax->pairs[k], motion);
    *pose = cairn_aligner_moved(*pose, centre, motion);
    scan->pull = relax->sums;
    memset(scan->pull.equations.gradient, 0, sizeof scan->pull.equations.gradient);
    scan->stirred = is_move(motion) ? ALIGNER_MET : 0;
    next_scan(x);
}

/* All new partners of the scan at hand are known. When what they add to the pull that it knows
 * of would not move it, that is all; else, its old ones follow. */
static void end_new_partners(cairn_aligner *x)
{
    static const cairn_real still[3] = {0, 0, 0};
    aligner_relax *relax = &x->relax;
    aligner_scan *scan = &x->scans[relax->i];
    aligner_sums sums = scan->pull;
    cairn_real motion[3];

    relax->partner = 0;
    relax->old = 1;
    add_sums(&sums, &relax->sums);
    if (relax->all || scan->stirred != ALIGNER_JOINED || scan->pull.pairs == 0 ||
        (cairn_aligner_solve(&sums, motion) && is_move(motion)))
        return;
    for (int32_t k = 0; k < scan->partner_count; k++)
        if (relax->pairs[k].pairs > 0)
            pass_on(x, relax->i, cairn_aligner_partner(x, relax->i, k), &relax->pairs[k], still);
    scan->pull = sums;
    scan->stirred = 0;
    next_scan(x);
}

/* Passes over scans of the cluster that are to stay; units. */
static int32_t pass_still(cairn_aligner *x)
{
    aligner_relax *relax = &x->relax;
    int32_t passed = 0;

    while (relax->i >= 0 && x->scans[relax->i].stirred == 0 && passed < MOST_PASSED) {
        relax->i = x->scans[relax->i].next;
        passed++;
    }
    if (relax->i < 0)
        end_round(x);
    return 1 + passed / ALIGNER_FAR_OF_UNIT;
}

/* A scan of the cluster from its partner at hand on, up to the next that it may meet: first
 * those that it has not met. */
int32_t cairn_aligner_relax_item(cairn_aligner *x)
{
    aligner_relax *relax = &x->relax;
    int32_t i = relax->i, passed = 0, work = 0;
    cairn_vec2 centre;

    if (!relax->all && x->scans[i].stirred == 0)
        return pass_still(x);
    if (relax->partner >= x->scans[i].partner_count) {
        cairn_real motion[3];

        if (!relax->old) {
            end_new_partners(x);
        } else {
            if (!cairn_aligner_solve(&relax->sums, motion))
                memset(motion, 0, sizeof motion);
            end_scan(x, motion);
        }
        return 4 + x->scans[i].partner_count / 8;
    }
    centre = cairn_transform_point(x->poses[i], x->scans[i].middle);
    while (work == 0 && relax->partner < x->scans[i].partner_count) {
        int32_t k = relax->partner++, j = cairn_aligner_partner(x, i, k);
        aligner_sums *pair = &relax->pairs[k];

        passed++;
        if (x->scans[j].part != relax->cluster || have_met(x, i, j) != relax->old ||
            !cairn_aligner_may_meet(x, i, j, x->poses[i], x->poses[j]))
            continue;
        work = cairn_aligner_pull(x, i, j, x->poses[i], x->poses[j], relax->gate, 1, centre, pair);
        work +=
            cairn_aligner_pull(x, j, i, x->poses[j], x->poses[i], relax->gate, -1, centre, pair);
        add_sums(&relax->sums, pair);
    }
    return 1 + passed / ALIGNER_FAR_OF_UNIT + work / ALIGNER_POINTS_OF_UNIT;
}

/* The pull on a scan of a cluster that turns. */
static void turn_pull(aligner_sums *sums, cairn_transform pose)
{
    cairn_sym3 *m = &sums->equations.information;
    cairn_real *g = sums->equations.gradient, c = pose.cosine, s = pose.sine;
    cairn_real xx = m->xx, xy = m->xy, yy = m->yy, xz = m->xz, gx = g[0];

    m->xx = c * c * xx - 2 * c * s * xy + s * s * yy;
    m->xy = c * s * (xx - yy) + (c * c - s * s) * xy;
    m->yy = s * s * xx + 2 * c * s * xy + c * c * yy;
    m->xz = c * xz - s * m->yz;
    m->yz = s * xz + c * m->yz;
    g[0] = c * gx - s * g[1];
    g[1] = s * gx + c * g[1];
}

/* The smaller cluster enters the frame of the larger one; returns that. pose: fixed_moving. */
int32_t cairn_aligner_join(cairn_aligner *x, int32_t moving, int32_t fixed, cairn_transform pose)
{
    int32_t event = x->changes;

    if (x->clusters[moving].size > x->clusters[fixed].size) {
        int32_t swap = moving;

        moving = fixed;
        fixed = swap;
        pose = cairn_aligner_inverse(pose);
    }
    while (x->clusters[moving].head >= 0) {
        int32_t scan = x->clusters[moving].head;

        x->poses[scan] = cairn_aligner_compose(pose, x->poses[scan]);
        turn_pull(&x->scans[scan].pull, pose);
        x->scans[scan].stirred = ALIGNER_JOINED;
        x->scans[scan].joined = event;
        cairn_aligner_remove(x, scan);
        cairn_aligner_insert(x, scan, fixed);
    }
    return fixed;
}
