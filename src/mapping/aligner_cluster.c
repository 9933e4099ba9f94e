/* Clusters of the aligner: scans whose poses are known to each other, in a frame of their own.
 *
 * A look at one cluster from another refines their relative pose by Gauss-Newton on all pairs of scans that may meet and
 * then counts the evidence of these. The initial poses are evidence, too: how much worse the initial poses of both fit a
 * common motion than those of each alone. Their standard deviations are learnt from the clusters themselves, starting from
 * what the params expect. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/aligner_work.h"

static const cairn_real COUNT_GATE = CAIRN_REAL(0.07);
static const cairn_real BOX = CAIRN_REAL(1.25); /* of the params' spread: hardly anything lies farther off */
static const cairn_real EXPECTED_SCANS = 2;     /* what the params' spread weighs against what is learnt */
static const cairn_real ARM = CAIRN_REAL(1.5);  /* m: makes turns comparable to shifts */
static const cairn_real BEYOND_NATS = 100;      /* a metre */

void cairn_aligner_insert(cairn_aligner *x, int32_t scan, int32_t cluster)
{
    aligner_cluster *c = &x->clusters[cluster];

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
    memset(x->clusters, 0, ((size_t)x->scan_count + 1) * sizeof *x->clusters);
    for (int32_t i = 0; i <= x->scan_count; i++)
        x->clusters[i].head = -1;
    for (int32_t i = 0; i < x->scan_count; i++) {
        x->poses[i] = cairn_transform_of(x->scans[i].initial);
        x->scans[i].support = 0;
        x->scans[i].weak = 0;
        cairn_aligner_insert(x, i, i);
    }
    cairn_aligner_learn_spread(x);
}

/* ---- Initial poses ---- */

/* The members of up to two clusters, one after the other. */
typedef struct walk {
    const cairn_aligner *x;
    int32_t scan, second;
    cairn_transform move; /* of the first cluster */
    int32_t in_first;
} walk;

static walk begin_walk(const cairn_aligner *x, int32_t first, int32_t second, cairn_transform second_first)
{
    walk w = {x, x->clusters[first].head, second, second_first, 1};

    return w;
}

/* The next member and its pose; -1: none. */
static int32_t walk_on(walk *w, cairn_transform *pose)
{
    int32_t scan;

    if (w->scan < 0 && w->in_first && w->second >= 0) {
        w->in_first = 0;
        w->scan = w->x->clusters[w->second].head;
    }
    scan = w->scan;
    if (scan < 0)
        return -1;
    *pose = w->in_first ? cairn_aligner_compose(w->move, w->x->poses[scan]) : w->x->poses[scan];
    w->scan = w->x->scans[scan].next;
    return scan;
}

/* Least squares over positions and headings, weighted by their variances. */
cairn_transform cairn_aligner_gauge(const cairn_aligner *x, int32_t first, int32_t second, cairn_transform second_first)
{
    cairn_real heading = x->sigma * x->sigma / (x->sigma_angle * x->sigma_angle), sine = 0, cosine = 0, count = 0;
    cairn_vec2 p = {0, 0}, q = {0, 0};
    cairn_transform pose, gauge;
    walk w = begin_walk(x, first, second, second_first);
    int32_t i;

    while ((i = walk_on(&w, &pose)) >= 0) {
        p.x += pose.x;
        p.y += pose.y;
        q.x += x->scans[i].initial.x;
        q.y += x->scans[i].initial.y;
        count += 1;
    }
    p = cairn_vec2_scale(p, 1 / count);
    q = cairn_vec2_scale(q, 1 / count);
    w = begin_walk(x, first, second, second_first);
    while ((i = walk_on(&w, &pose)) >= 0) {
        cairn_transform initial = cairn_transform_of(x->scans[i].initial);
        cairn_vec2 u = {pose.x - p.x, pose.y - p.y}, v = {initial.x - q.x, initial.y - q.y};

        cosine += heading * (pose.cosine * initial.cosine + pose.sine * initial.sine) + cairn_vec2_dot(u, v);
        sine += heading * (pose.cosine * initial.sine - pose.sine * initial.cosine) + cairn_vec2_cross(u, v);
    }
    count = cairn_sqrt(cosine * cosine + sine * sine);
    gauge.cosine = count > 0 ? cosine / count : 1;
    gauge.sine = count > 0 ? sine / count : 0;
    gauge.x = q.x - (gauge.cosine * p.x - gauge.sine * p.y);
    gauge.y = q.y - (gauge.sine * p.x + gauge.cosine * p.y);
    return gauge;
}

/* What is left of the initial poses after the best common motion. */
typedef struct leftover {
    cairn_real squares, squares_angle;
    cairn_real beyond; /* m outside the box; turns times ARM */
    int32_t count;
} leftover;

static leftover leftover_of(const cairn_aligner *x, int32_t first, int32_t second, cairn_transform second_first)
{
    cairn_transform gauge = cairn_aligner_gauge(x, first, second, second_first), pose;
    cairn_real far = BOX * x->params.spread, turned = BOX * x->params.spread_angle;
    walk w = begin_walk(x, first, second, second_first);
    leftover m = {0, 0, 0, 0};
    int32_t i;

    while ((i = walk_on(&w, &pose)) >= 0) {
        const cairn_pose *initial = &x->scans[i].initial;
        cairn_pose at = cairn_aligner_to_pose(cairn_aligner_compose(gauge, pose));
        cairn_real dx = at.x - initial->x, dy = at.y - initial->y, turn = cairn_wrap_angle(at.theta - initial->theta);

        m.squares += dx * dx + dy * dy;
        m.squares_angle += turn * turn;
        m.beyond += cairn_max(cairn_abs(dx) - far, 0) + cairn_max(cairn_abs(dy) - far, 0) +
                    ARM * cairn_max(cairn_abs(turn) - turned, 0);
        m.count++;
    }
    return m;
}

static cairn_real chi_squared(const cairn_aligner *x, const leftover *m)
{
    return m->squares / (x->sigma * x->sigma) + m->squares_angle / (x->sigma_angle * x->sigma_angle) +
           2 * BEYOND_NATS * m->beyond;
}

void cairn_aligner_learn_spread(cairn_aligner *x)
{
    cairn_transform same = {0, 0, 1, 0};
    cairn_real expected = x->params.spread * x->params.spread / 3;
    cairn_real expected_angle = x->params.spread_angle * x->params.spread_angle / 3;
    cairn_real squares = EXPECTED_SCANS * 2 * expected, squares_angle = EXPECTED_SCANS * expected_angle;
    cairn_real count = EXPECTED_SCANS;

    x->sigma = cairn_sqrt(expected);
    x->sigma_angle = cairn_sqrt(expected_angle);
    for (int32_t c = 0; c < x->scan_count; c++)
        if (x->clusters[c].size > 1) {
            leftover m = leftover_of(x, c, -1, same);

            squares += m.squares;
            squares_angle += m.squares_angle;
            count += (cairn_real)(m.count - 1);
        }
    x->sigma = cairn_min(x->sigma, cairn_sqrt(squares / (2 * count)));
    x->sigma_angle = cairn_min(x->sigma_angle, cairn_sqrt(squares_angle / count));
    for (int32_t c = 0; c < x->scan_count; c++) {
        x->clusters[c].misfit = 0;
        if (x->clusters[c].size > 1) {
            leftover m = leftover_of(x, c, -1, same);

            x->clusters[c].misfit = chi_squared(x, &m);
        }
    }
}

/* ---- Looks ---- */

void cairn_aligner_begin_look(cairn_aligner *x, int32_t moving, int32_t fixed, cairn_transform pose, int32_t rounds)
{
    aligner_look *look = &x->look;
    int32_t first = x->clusters[moving].head;

    memset(look, 0, sizeof *look);
    look->active = 1;
    look->moving = moving;
    look->fixed = fixed;
    look->pose = pose;
    look->rounds = rounds;
    look->i = first;
    look->j = x->clusters[fixed].head;
    look->centre = cairn_transform_point(cairn_aligner_compose(pose, x->poses[first]), x->scans[first].middle);
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
    leftover m = leftover_of(x, look->moving, look->fixed, look->pose);

    look->active = 0;
    look->evidence = cairn_aligner_evidence(x, look->count);
    look->prior = -(chi_squared(x, &m) - x->clusters[look->moving].misfit - x->clusters[look->fixed].misfit) / 2;
    x->debt += m.count / 2;
}

/* One pair of scans. */
int32_t cairn_aligner_look_item(cairn_aligner *x)
{
    aligner_look *look = &x->look;
    int32_t i = look->i, j = look->j, points;
    cairn_transform pose_i;

    if (i < 0) {
        if (look->round < look->rounds)
            end_refinement(look);
        else
            end_look(x);
        look->i = x->clusters[look->moving].head;
        look->j = x->clusters[look->fixed].head;
        return 4;
    }
    look->j = x->scans[j].next;
    if (look->j < 0) {
        look->i = x->scans[i].next;
        look->j = x->clusters[look->fixed].head;
    }
    pose_i = cairn_aligner_compose(look->pose, x->poses[i]);
    if (!cairn_aligner_may_meet(x, i, j, pose_i, x->poses[j]))
        return 1;
    points = cairn_aligner_points_of(x, i);
    if (look->round < look->rounds) {
        cairn_aligner_pull(x, i, j, pose_i, x->poses[j], refine_gate(look->round), 1, look->centre, &look->sums);
    } else {
        cairn_aligner_count_pair(x, i, j, cairn_aligner_between(x->poses[j], pose_i), COUNT_GATE, &look->count);
        points += cairn_aligner_points_of(x, j);
    }
    return 1 + points / ALIGNER_POINTS_OF_UNIT;
}

/* ---- Relaxation ---- */

void cairn_aligner_begin_relax(cairn_aligner *x, int32_t cluster, cairn_real gate, int32_t rounds)
{
    aligner_relax *relax = &x->relax;

    memset(relax, 0, sizeof *relax);
    relax->active = rounds > 0 && x->clusters[cluster].size > 1;
    relax->cluster = cluster;
    relax->rounds = rounds;
    relax->gate = gate;
    relax->i = relax->j = x->clusters[cluster].head;
}

static void end_scan(cairn_aligner *x)
{
    aligner_relax *relax = &x->relax;
    cairn_transform *pose = &x->poses[relax->i];
    cairn_vec2 centre = cairn_transform_point(*pose, x->scans[relax->i].middle);
    cairn_real motion[3];

    if (cairn_aligner_solve(&relax->sums, motion))
        *pose = cairn_aligner_moved(*pose, centre, motion);
    memset(&relax->sums, 0, sizeof relax->sums);
    relax->i = x->scans[relax->i].next;
    if (relax->i < 0) {
        relax->i = x->clusters[relax->cluster].head;
        relax->round++;
    }
    relax->j = x->clusters[relax->cluster].head;
    relax->active = relax->round < relax->rounds;
    if (!relax->active) {
        x->clusters[relax->cluster].stamp = ++x->changes;
        cairn_aligner_learn_spread(x);
        x->debt += x->scan_count;
    }
}

/* One pair of scans of the cluster. */
int32_t cairn_aligner_relax_item(cairn_aligner *x)
{
    aligner_relax *relax = &x->relax;
    int32_t i = relax->i, j = relax->j;
    cairn_vec2 centre;

    if (j < 0) {
        end_scan(x);
        return 4;
    }
    relax->j = x->scans[j].next;
    if (i == j || !cairn_aligner_may_meet(x, i, j, x->poses[i], x->poses[j]))
        return 1;
    centre = cairn_transform_point(x->poses[i], x->scans[i].middle);
    cairn_aligner_pull(x, i, j, x->poses[i], x->poses[j], relax->gate, 1, centre, &relax->sums);
    cairn_aligner_pull(x, j, i, x->poses[j], x->poses[i], relax->gate, -1, centre, &relax->sums);
    return 1 + (cairn_aligner_points_of(x, i) + cairn_aligner_points_of(x, j)) / ALIGNER_POINTS_OF_UNIT;
}

/* The smaller cluster enters the frame of the larger one; returns that. pose: fixed_moving. */
int32_t cairn_aligner_join(cairn_aligner *x, int32_t moving, int32_t fixed, cairn_transform pose)
{
    if (x->clusters[moving].size > x->clusters[fixed].size) {
        int32_t swap = moving;

        moving = fixed;
        fixed = swap;
        pose = cairn_aligner_inverse(pose);
    }
    while (x->clusters[moving].head >= 0) {
        int32_t scan = x->clusters[moving].head;

        x->poses[scan] = cairn_aligner_compose(pose, x->poses[scan]);
        cairn_aligner_remove(x, scan);
        cairn_aligner_insert(x, scan, fixed);
    }
    return fixed;
}
