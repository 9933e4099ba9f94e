/* The joint solution of the aligner: the poses of the largest cluster and the walls that its scans
 * share (aligner_wall.c), each of unknown offset and angle. The hits of a segment enter by their
 * moments alone: with the error e = n p - rho of a hit at p, the sums of J J^T and J e over all
 * hits of a segment follow from its weight, mean and spread about the mean, since J is linear in p;
 * so every beam counts and none is kept. Segments that fit their wall worse than noise can explain
 * lose weight (Geman and McClure), the sooner the further the iteration. The standard deviations
 * learnt of the initial poses hold, weakly, where it stands what nothing else does: evidence has
 * put it there.
 *
 * The inverse of the same system, one scan held, is the Cramer-Rao bound of the poses at the
 * solution, by which they are judged observable; their covariance is that times chi-squared per
 * degree of freedom, since segments of two surfaces in one and walls that only look like one are
 * no noise. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/aligner_work.h"

static const cairn_real HELD = CAIRN_REAL(1e10);
static const cairn_real AT_REST = CAIRN_REAL(5e-4); /* m */
static const cairn_real LEAST_SUPPORT = 2;          /* nats of a placed scan */

/* Chi-squared beyond which a segment loses weight. */
static const cairn_real tolerances[] = {1000, 300, 100, 50, 25, 15, 12};

enum { AGAIN_FROM = 6 }; /* round that follows when scans have slid: the others lie well */
enum { TOLERATED = 4 };  /* round whose tolerance the covariances have */
enum { OF_ITEM = 64 };   /* segments, scans or walls that one item adds */

/* How far a segment may be from its wall before it loses weight: in standard deviations, and, as
 * long as the poses are poor, in metres, however well a long segment is known. */
static void set_tolerance(cairn_aligner *x, int32_t round)
{
    static const cairn_real metres[] = {CAIRN_REAL(0.08), CAIRN_REAL(0.08), CAIRN_REAL(0.05),
                                        CAIRN_REAL(0.03)};

    x->tolerance = tolerances[round < 6 ? round : 6];
    x->loose = round < 4 ? metres[round] * metres[round] : 0;
}

/* ---- The system ---- */

/* Numbers the walls that are shared behind the scans. */
static void number_walls(cairn_aligner *x)
{
    x->node_count = x->scan_count;
    x->result.walls = 0;
    for (int32_t w = 0; w < x->wall_count; w++) {
        x->walls[w].node = x->walls[w].scans > 1 ? x->node_count++ : -1;
        x->result.walls += x->walls[w].scans > 1;
    }
}

static int is_shared(const cairn_aligner *x, const aligner_segment *s)
{
    return s->wall >= 0 && x->walls[s->wall].node >= 0;
}

/* The numbers, then the links of some segments, then the order of elimination; these are what
 * they were where segments keep their walls. */
static int32_t link_some(cairn_aligner *x)
{
    cairn_status status = CAIRN_OK;
    int32_t end = x->at + OF_ITEM < x->segment_count ? x->at + OF_ITEM : x->segment_count,
            units = 1;

    if (x->at == 0) {
        number_walls(x);
        units += x->wall_count / 32 + x->node_count / 8;
        if (cairn_aligner_keeps_walls(x)) {
            x->phase = ALIGNER_SOLVE;
            return units;
        }
        status = cairn_block_solver_begin(x->solver, x->node_count);
    }
    for (; x->at < end && status == CAIRN_OK; x->at++) {
        const aligner_segment *s = &x->segments[x->at];

        if (is_shared(x, s))
            status = cairn_block_solver_add_link(x->solver, s->scan, x->walls[s->wall].node);
    }
    if (end == x->segment_count) {
        if (status == CAIRN_OK)
            status = cairn_block_solver_analyze(x->solver);
        units += cairn_block_solver_read(x->solver).links / 8 + x->node_count / 8;
        x->phase = ALIGNER_SOLVE;
        x->at = x->stage = 0;
    }
    if (status != CAIRN_OK)
        cairn_aligner_give_up(x, status);
    return units + OF_ITEM / 8;
}

/* A segment on its wall. */
typedef struct term {
    /* m, of the mean of its hits */
    cairn_real error;
    /* of the error over its scan's pose, ... */
    cairn_real row[3];
    /* ... and over its wall's offset and angle */
    cairn_real column[3];
    /* spread along the wall, and of both directions; these move the angles only */
    cairn_real along, oblique;
    /* chi-squared, and what is left of the weight */
    cairn_real chi, scale;
} term;

static term term_of(const cairn_aligner *x, const aligner_segment *s)
{
    const aligner_wall *wall = &x->walls[s->wall];
    cairn_transform pose = x->poses[s->scan];
    cairn_vec2 mean = cairn_transform_point(pose, s->mean), along = cairn_aligner_along(wall), n, t;
    cairn_vec2 arm = {mean.x - pose.x, mean.y - pose.y};
    cairn_real across;
    term m;

    /* The wall's axes in the scan's frame. */
    n.x = pose.cosine * wall->normal.x + pose.sine * wall->normal.y;
    n.y = pose.cosine * wall->normal.y - pose.sine * wall->normal.x;
    t.x = n.y;
    t.y = -n.x;
    m.along = s->spread.xx * t.x * t.x + 2 * s->spread.xy * t.x * t.y + s->spread.yy * t.y * t.y;
    across = s->spread.xx * n.x * n.x + 2 * s->spread.xy * n.x * n.y + s->spread.yy * n.y * n.y;
    m.oblique = s->spread.xx * t.x * n.x + s->spread.xy * (t.x * n.y + t.y * n.x) +
                s->spread.yy * t.y * n.y;
    m.error = cairn_vec2_dot(wall->normal, mean) - wall->offset;
    m.chi = s->weight * m.error * m.error + cairn_max(across - s->least, 0);
    m.scale = 1 / (1 + m.chi / cairn_max(x->tolerance, s->weight * x->loose));
    m.scale *= m.scale;
    m.row[0] = wall->normal.x;
    m.row[1] = wall->normal.y;
    m.row[2] = cairn_vec2_dot(along, arm);
    m.column[0] = -1;
    m.column[1] = -(cairn_vec2_dot(along, mean) - cairn_vec2_dot(along, wall->middle));
    m.column[2] = 0;
    return m;
}

/* A shift (or row over it) seen from a frame, and in the map. */
static void into_frame(cairn_vec2 frame, cairn_real shift[2])
{
    cairn_real along = frame.x * shift[0] + frame.y * shift[1];

    shift[1] = frame.x * shift[1] - frame.y * shift[0];
    shift[0] = along;
}

static void out_of_frame(cairn_vec2 frame, cairn_real shift[2])
{
    cairn_real first = frame.x * shift[0] - frame.y * shift[1];

    shift[1] = frame.y * shift[0] + frame.x * shift[1];
    shift[0] = first;
}

/* The direction of a scan's first unknown: along that in which its walls tell least. The shift
 * of a scan of one wall is known ten thousand times better across than along; by axes that lie
 * askew, the inverse of its block has entries as great as the one in all places, and what is
 * left of the other in their difference is, in float, mostly rounding. */
static cairn_vec2 frame_of(const cairn_aligner *x, int32_t scan)
{
    cairn_sym3 own = cairn_aligner_own_information(x, scan);
    cairn_sym2 shifts = {own.xx, own.xy, own.yy};
    cairn_real values[2];
    cairn_vec2 least, most;

    cairn_sym2_eigen(shifts, values, &least, &most);
    return least;
}

static cairn_status add_segment(cairn_aligner *x, const aligner_segment *s, int32_t link)
{
    int32_t node = x->walls[s->wall].node;
    term m = term_of(x, s);
    cairn_real *b = &x->rhs[3 * s->scan], *c = &x->rhs[3 * node], block[9],
               weight = m.scale * s->weight;
    cairn_sym3 own = cairn_sym3_zero(), walls = cairn_sym3_zero();
    cairn_status status;

    into_frame(x->scans[s->scan].frame, m.row);
    cairn_sym3_add_outer(&own, m.row, weight);
    own.zz += m.scale * m.along;
    cairn_sym3_add_outer(&walls, m.column, weight);
    walls.yy += m.scale * m.along;
    for (int r = 0; r < 3; r++) {
        b[r] -= weight * m.error * m.row[r];
        c[r] -= weight * m.error * m.column[r];
        for (int k = 0; k < 3; k++)
            block[3 * r + k] = weight * m.row[r] * m.column[k];
    }
    block[7] -= m.scale * m.along;
    b[2] -= m.scale * m.oblique;
    c[1] += m.scale * m.oblique;
    status = cairn_block_solver_add_pose_block(x->solver, s->scan, own);
    if (status == CAIRN_OK)
        status = cairn_block_solver_add_pose_block(x->solver, node, walls);
    return status == CAIRN_OK ? cairn_block_solver_add_link_block(x->solver, link, block) : status;
}

cairn_sym3 cairn_aligner_own_information(const cairn_aligner *x, int32_t scan)
{
    cairn_sym3 own = cairn_sym3_zero();

    for (int32_t k = x->scans[scan].first_segment; k < x->scans[scan].end_segment; k++) {
        const aligner_segment *s = &x->segments[k];
        term m;

        if (!is_shared(x, s))
            continue;
        m = term_of(x, s);
        cairn_sym3_add_outer(&own, m.row, m.scale * s->weight);
        own.zz += m.scale * m.along;
    }
    return own;
}

/* What holds a scan that nothing else holds, and the anchor of covariances. */
static cairn_status add_prior(cairn_aligner *x, int32_t i, int32_t anchor)
{
    cairn_real weight = 1 / (x->sigma * x->sigma), turn = 1 / (x->sigma_angle * x->sigma_angle);
    cairn_sym3 block = {weight, 0, 0, weight, 0, turn};

    if (i == anchor)
        block.xx = block.yy = block.zz = HELD;
    return cairn_block_solver_add_pose_block(x->solver, i, block);
}

/* What holds a wall that nothing else holds, and its third unknown. */
static cairn_status add_wall_prior(cairn_aligner *x, const aligner_wall *wall)
{
    cairn_real loose = CAIRN_REAL_EPSILON * 256 * wall->weight + CAIRN_REAL(0.01);
    cairn_sym3 block = {loose, 0, 0, loose + 1, 0, 1};

    return wall->node >= 0 ? cairn_block_solver_add_pose_block(x->solver, wall->node, block)
                           : CAIRN_OK;
}

/* The k-th of the values: segments, then scans, then walls. */
static cairn_status add_value(cairn_aligner *x, int32_t k, int32_t anchor)
{
    if (k < x->segment_count) {
        int32_t scan = x->segments[k].scan;

        if (k == x->scans[scan].first_segment) {
            x->scans[scan].frame = frame_of(x, scan);
            x->debt += (x->scans[scan].end_segment - k) / 2;
        }
        return is_shared(x, &x->segments[k]) ? add_segment(x, &x->segments[k], x->link++)
                                             : CAIRN_OK;
    }
    k -= x->segment_count;
    return k < x->scan_count ? add_prior(x, k, anchor)
                             : add_wall_prior(x, &x->walls[k - x->scan_count]);
}

/* Some of the values; after the last the solver starts to factor. The anchor is held in the last
 * round only. */
static int32_t build_some(cairn_aligner *x, int32_t anchor)
{
    int32_t count = x->segment_count + x->scan_count + x->wall_count;
    int32_t end = x->at + OF_ITEM < count ? x->at + OF_ITEM : count, units = 1;
    cairn_status status = CAIRN_OK;

    if (x->at == 0) {
        status = cairn_block_solver_clear(x->solver);
        memset(x->rhs, 0, 3 * (size_t)x->node_count * sizeof *x->rhs);
        x->link = 0;
        units += x->result.fill / 32 + x->node_count / 32;
    }
    for (; x->at < end && status == CAIRN_OK; x->at++, units++)
        status = add_value(x, x->at, anchor);
    if (end == count && status == CAIRN_OK) {
        status = cairn_block_solver_factor(x->solver);
        x->at = 0;
        x->stage = 1;
    }
    if (status != CAIRN_OK)
        cairn_aligner_give_up(x, status);
    return units;
}

static void move_scans(cairn_aligner *x)
{
    x->moved = 0;
    for (int32_t i = 0; i < x->scan_count; i++) {
        cairn_transform *pose = &x->poses[i];
        cairn_vec2 centre = {pose->x, pose->y};
        cairn_real motion[3];

        if (x->scans[i].part != x->home ||
            cairn_block_solver_solution(x->solver, i, motion) != CAIRN_OK)
            continue;
        out_of_frame(x->scans[i].frame, motion);
        x->moved = cairn_max(x->moved, cairn_max(cairn_abs(motion[0]), cairn_abs(motion[1])));
        *pose = cairn_aligner_moved(*pose, centre, motion);
    }
    x->clusters[x->home].stamp = ++x->changes;
}

/* ---- The end ---- */

/* The scan that is held: with the most information in its own block, the walls known. */
static int32_t best_known(const cairn_aligner *x)
{
    int32_t best = -1;
    cairn_real most = -1;

    for (int32_t i = 0; i < x->scan_count; i++) {
        cairn_sym3 own;
        cairn_real determinant;

        if (x->scans[i].part != x->home)
            continue;
        own = cairn_aligner_own_information(x, i);
        determinant = own.xx * (own.yy * own.zz - own.yz * own.yz) -
                      own.xy * (own.xy * own.zz - own.yz * own.xz) +
                      own.xz * (own.xy * own.yz - own.yy * own.xz);
        if (determinant > most) {
            most = determinant;
            best = i;
        }
    }
    return best;
}

/* m of a scan in a frame, as it is in the map: turned by the gauge that brings the frame there. */
static void turn_covariance(cairn_transform gauge, const cairn_real m[9], cairn_real out[9])
{
    cairn_real r[9] = {gauge.cosine, -gauge.sine, 0, gauge.sine, gauge.cosine, 0, 0, 0, 1}, half[9];

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            half[3 * i + j] = r[3 * i] * m[j] + r[3 * i + 1] * m[3 + j] + r[3 * i + 2] * m[6 + j];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            out[3 * i + j] = half[3 * i] * r[3 * j] + half[3 * i + 1] * r[3 * j + 1] +
                             half[3 * i + 2] * r[3 * j + 2];
}

static void judge(cairn_aligner *x, int32_t i)
{
    cairn_aligner_pose *r = &x->results[i];
    const cairn_real *c = r->covariance;
    cairn_real far = x->params.observable, turned = x->params.observable_angle;

    r->observable = (cairn_sqrt(c[0]) < far ? CAIRN_ALIGNER_X : 0) |
                    (cairn_sqrt(c[4]) < far ? CAIRN_ALIGNER_Y : 0) |
                    (cairn_sqrt(c[8]) < turned ? CAIRN_ALIGNER_THETA : 0);
    r->placed = r->part == 0 && r->support >= LEAST_SUPPORT && cairn_sqrt(c[0] + c[4]) < far &&
                cairn_sqrt(c[8]) < turned;
}

/* The number of the cluster of a scan: by size, ties by index. */
static int32_t number_of(const cairn_aligner *x, int32_t i)
{
    int32_t own = x->scans[i].part, before = 0;

    for (int32_t c = 0; c < x->scan_count; c++)
        before +=
            x->clusters[c].size > x->clusters[own].size ||
            (x->clusters[c].size == x->clusters[own].size && x->clusters[c].size > 0 && c < own);
    return own == x->home ? 0 : before;
}

/* Clusters but for blind scans. */
static int32_t count_parts(const cairn_aligner *x)
{
    int32_t parts = 0;

    for (int32_t c = 0; c < x->scan_count; c++)
        parts += x->clusters[c].size > 1 ||
                 (x->clusters[c].size == 1 && cairn_aligner_points_of(x, x->clusters[c].head) > 0);
    return parts;
}

static void read_covariance(const cairn_aligner *x, int32_t i, cairn_transform gauge,
                            cairn_real covariance[9])
{
    cairn_real block[9], prior = 2 * x->sigma * x->sigma,
                         turn = 2 * x->sigma_angle * x->sigma_angle;

    memset(covariance, 0, 9 * sizeof *covariance);
    covariance[0] = covariance[4] = prior;
    covariance[8] = turn;
    if (x->scans[i].part != x->home || x->result.anchor < 0)
        return;
    if (i == x->result.anchor)
        memset(covariance, 0, 9 * sizeof *covariance);
    else if (cairn_block_solver_covariance(x->solver, i, i, block) == CAIRN_OK) {
        cairn_vec2 frame = x->scans[i].frame;
        cairn_transform own = {0, 0, frame.x, frame.y};

        turn_covariance(cairn_aligner_compose(gauge, own), block, covariance);
    }
}

/* Chi-squared of some of the segments on shared walls, each by its mean and its direction; of
 * all, per degree of freedom. */
static int32_t add_misfits(cairn_aligner *x)
{
    int32_t end = x->at + OF_ITEM < x->segment_count ? x->at + OF_ITEM : x->segment_count;

    if (x->at == 0) {
        x->margin = 0;
        x->freedom = -3 * x->clusters[x->home].size - 2 * x->result.walls;
    }
    for (; x->at < end; x->at++)
        if (is_shared(x, &x->segments[x->at])) {
            term m = term_of(x, &x->segments[x->at]);

            x->margin += m.chi * m.scale;
            x->freedom += 2;
        }
    if (end == x->segment_count) {
        x->margin = x->freedom > 0 ? cairn_max(x->margin / (cairn_real)x->freedom, 1) : 1;
        x->gauge_part = -1;
        x->result.placed = 0;
        x->stage = 4;
        x->i = 0;
    }
    return OF_ITEM;
}

static int32_t finish(cairn_aligner *x)
{
    x->result.parts = count_parts(x);
    x->result.largest = x->clusters[x->home].size;
    x->result.spread = x->sigma;
    x->result.spread_angle = x->sigma_angle;
    if (x->result.verdict == CAIRN_ALIGNER_RUNNING) {
        x->result.verdict =
            x->moved <= AT_REST ? CAIRN_ALIGNER_CONVERGED : CAIRN_ALIGNER_OUT_OF_STEPS;
        if (x->result.parts > 1 || x->result.largest < 2)
            x->result.verdict = CAIRN_ALIGNER_SPLIT;
    }
    x->has_ended = 1;
    x->phase = ALIGNER_DONE;
    return 1 + x->scan_count / 16;
}

/* The result of one scan. */
static int32_t report_scan(cairn_aligner *x, int32_t i)
{
    cairn_aligner_pose *r = &x->results[i];
    int32_t units = 8 + x->scan_count / 16;

    if (x->scans[i].part != x->gauge_part) {
        x->gauge_part = x->scans[i].part;
        x->gauge = cairn_aligner_gauge(x, x->gauge_part);
        units += x->clusters[x->gauge_part].size;
    }
    r->part = number_of(x, i);
    r->map_scan = cairn_aligner_to_pose(cairn_aligner_compose(x->gauge, x->poses[i]));
    r->support = x->scans[i].support;
    read_covariance(x, i, x->gauge, r->covariance);
    judge(x, i);
    for (int k = 0; k < 9; k++)
        r->covariance[k] *= x->margin;
    x->result.placed += r->placed;
    x->scans[i].held = r->placed;
    return units;
}

/* No joint solution: what is known of the poses are the initial ones. */
void cairn_aligner_give_up(cairn_aligner *x, cairn_status status)
{
    if (status == CAIRN_FULL)
        x->result.verdict = CAIRN_ALIGNER_NO_FILL;
    x->result.anchor = -1;
    x->phase = ALIGNER_MARGINALS;
    x->stage = 2;
    x->i = x->j = 0;
}

/* Evidence between one pair of scans of the part, then the end. */
static int32_t support_item(cairn_aligner *x)
{
    aligner_count count = {0, 0, 0};
    int32_t i = x->i, j, work;
    cairn_real evidence;

    if (i == x->scan_count) {
        x->stage = 3;
        x->at = 0;
        return 1;
    }
    if (x->j == x->scans[i].partner_count) {
        x->i++;
        x->j = 0;
        return 1;
    }
    j = cairn_aligner_partner(x, i, x->j++);
    if (j > i || x->scans[i].part != x->scans[j].part ||
        !cairn_aligner_may_meet(x, i, j, x->poses[i], x->poses[j]))
        return 1;
    work = cairn_aligner_count_pair(x, i, j, cairn_aligner_between(x->poses[j], x->poses[i]),
                                    CAIRN_REAL(0.07), &count);
    evidence = cairn_aligner_evidence(x, count);
    x->scans[i].support += evidence;
    x->scans[j].support += evidence;
    return 1 + work / ALIGNER_POINTS_OF_UNIT;
}

/* ---- Phases ---- */

static int32_t settle(cairn_aligner *x)
{
    if (x->stage == 0 && x->at == 0) {
        x->home = cairn_aligner_largest(x);
        x->settled = 0;
        if (x->segment_count == 0 || x->params.max_rounds == 0) {
            x->moved = 0;
            cairn_aligner_give_up(x, CAIRN_OK);
            return 1;
        }
    }
    return cairn_aligner_sort_item(x);
}

/* The marginals are those at the poses and walls that have been found. */
static void begin_marginals(cairn_aligner *x)
{
    x->tolerance = tolerances[TOLERATED];
    x->loose = 0;
    x->result.anchor = best_known(x);
    x->phase = ALIGNER_MARGINALS;
}

static int is_over(const cairn_aligner *x)
{
    return x->round >= x->params.max_rounds ||
           (cairn_aligner_keeps_walls(x) && x->moved <= AT_REST);
}

void cairn_aligner_end_slides(cairn_aligner *x, int32_t changed)
{
    x->at = x->stage = 0;
    x->phase = ALIGNER_ASSOCIATE;
    x->settled = changed == 0;
    if (!x->settled)
        x->round = AGAIN_FROM < x->params.max_rounds ? AGAIN_FROM : x->params.max_rounds - 1;
    else if (is_over(x))
        begin_marginals(x);
}

/* As long as scans may slide, no more is asked than the walls; only then do the poses come to
 * rest on them. */
static void end_round(cairn_aligner *x)
{
    x->at = x->stage = 0;
    x->phase = ALIGNER_ASSOCIATE;
    x->round++;
    x->result.rounds++;
    if (!x->settled && (x->round >= x->params.max_rounds || cairn_aligner_keeps_walls(x)))
        cairn_aligner_begin_slides(x);
    else if (x->settled && is_over(x))
        begin_marginals(x);
}

/* The solver has done what it was told; what comes next. */
static int32_t solve(cairn_aligner *x)
{
    cairn_block_solver_result state = cairn_block_solver_read(x->solver);

    if (x->stage == 0) {
        set_tolerance(x, x->round);
        return build_some(x, -1);
    }
    if (x->stage == 1) {
        cairn_status status = state.state == CAIRN_BLOCK_SOLVER_FACTORED
                                  ? cairn_block_solver_solve(x->solver, x->rhs)
                                  : CAIRN_UNSUPPORTED;

        x->stage = 2;
        if (status != CAIRN_OK)
            cairn_aligner_give_up(x, status);
        return 1 + x->node_count / 8;
    }
    move_scans(x);
    if (state.fill > x->result.fill)
        x->result.fill = state.fill;
    end_round(x);
    return x->scan_count;
}

static int32_t marginals(cairn_aligner *x)
{
    if (x->stage == 0)
        return build_some(x, x->result.anchor);
    if (x->stage == 1) {
        cairn_status status =
            cairn_block_solver_read(x->solver).state == CAIRN_BLOCK_SOLVER_FACTORED
                ? cairn_block_solver_invert(x->solver)
                : CAIRN_UNSUPPORTED;

        x->stage = 2;
        x->i = x->j = 0;
        if (status != CAIRN_OK)
            cairn_aligner_give_up(x, status);
        return 1;
    }
    if (x->stage == 2)
        return support_item(x);
    if (x->stage == 3)
        return add_misfits(x);
    if (x->i < x->scan_count)
        return report_scan(x, x->i++);
    return finish(x);
}

int32_t cairn_aligner_joint_item(cairn_aligner *x)
{
    switch (x->phase) {
    case ALIGNER_SETTLE:
        return settle(x);
    case ALIGNER_ASSOCIATE:
        if (x->at < x->segment_count)
            return cairn_aligner_associate_item(x);
        x->phase = ALIGNER_LINK;
        x->at = 0;
        return 1;
    case ALIGNER_LINK:
        return link_some(x);
    case ALIGNER_SOLVE:
        return solve(x);
    default:
        return marginals(x);
    }
}
