/* The joint solution of the aligner: the poses of the largest cluster and the walls that its scans share.
 *
 * Segments of several scans on one line, with overlapping or neighbouring extents, are one wall of unknown offset and
 * angle. The hits of a segment enter by their moments alone: with the error e = n p - rho of a hit at p, the sums of J J^T
 * and J e over all hits of a segment follow from its weight, mean and spread about the mean, since J is linear in p; so
 * every beam counts and none is kept. Segments that fit their wall worse than noise can explain lose weight (Geman and
 * McClure), the sooner the further the iteration. The initial poses are a weak prior with the standard deviations learnt.
 *
 * The inverse of the same system, one scan held, is the Cramer-Rao bound of the poses at the solution, by which they are
 * judged observable; their covariance is that with a margin. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/aligner_work.h"

static const cairn_real LEAST_COSINE = CAIRN_REAL(0.94); /* of the directions of one wall */
static const cairn_real GAP = 1;                         /* m between the extents on one wall, ... */
static const cairn_real GAP_LONG = 2;                    /* times the shorter extent, when that is more */
static const cairn_real GAP_STRICT = CAIRN_REAL(0.6);    /* ... over which the gate is that share of itself */
static const cairn_real GAP_COST = CAIRN_REAL(0.05);
static const cairn_real SHORT = CAIRN_REAL(0.3), SHORT_EXTRA = CAIRN_REAL(0.01), SHORTEST = CAIRN_REAL(0.08); /* m */
/* On the covariances: segments of two surfaces in one and walls that only look like one are no noise, and not in the bound. */
static const cairn_real MARGIN = CAIRN_REAL(1.5);
static const cairn_real HELD = CAIRN_REAL(1e10);
static const cairn_real AT_REST = CAIRN_REAL(5e-4); /* m */
static const cairn_real LEAST_SUPPORT = 2;          /* nats of a placed scan */

/* Gates of the association in m, and chi-squared beyond which a segment loses weight. */
static const cairn_real gates[] = {CAIRN_REAL(0.08), CAIRN_REAL(0.07), CAIRN_REAL(0.06),
                                   CAIRN_REAL(0.05), CAIRN_REAL(0.04), CAIRN_REAL(0.03)};
static const cairn_real tolerances[] = {1000, 300, 100, 50, 25, 15, 12};

static cairn_real gate_of(int32_t round)
{
    return gates[round < 5 ? round : 5];
}

static cairn_real tolerance_of(int32_t round)
{
    return tolerances[round < 6 ? round : 6];
}

static int is_used(const cairn_aligner *x, const aligner_segment *s)
{
    return s->weight > 0 && s->length > SHORTEST && x->scans[s->scan].part == x->home;
}

/* ---- The order of segments: those that say most first, by heap ---- */

static int says_less(const cairn_aligner *x, int32_t a, int32_t b)
{
    cairn_real first = x->segments[a].weight * x->segments[a].length;
    cairn_real second = x->segments[b].weight * x->segments[b].length;

    return first < second || (!(second < first) && a > b);
}

/* Sinks entry `at` of a heap of `count` with the least on top. */
static void sink(cairn_aligner *x, int32_t at, int32_t count)
{
    for (;;) {
        int32_t child = 2 * at + 1, swap = x->order[at];

        if (child >= count)
            return;
        if (child + 1 < count && says_less(x, x->order[child + 1], x->order[child]))
            child++;
        if (!says_less(x, x->order[child], x->order[at]))
            return;
        x->order[at] = x->order[child];
        x->order[child] = swap;
        at = child;
    }
}

/* One entry: the heap is built (stage 0) and emptied from its end (stage 1). */
static int32_t sort(cairn_aligner *x)
{
    if (x->stage == 0) {
        if (x->at == 0)
            for (int32_t i = 0; i < x->segment_count; i++)
                x->order[i] = i;
        sink(x, x->segment_count - 1 - x->at, x->segment_count);
    } else {
        int32_t last = x->segment_count - 1 - x->at, swap = x->order[0];

        x->order[0] = x->order[last];
        x->order[last] = swap;
        sink(x, 0, last);
    }
    if (++x->at == x->segment_count) {
        x->at = 0;
        if (++x->stage == 2) {
            x->phase = ALIGNER_ASSOCIATE;
            x->stage = 0;
        }
    }
    return 3;
}

/* ---- Walls ---- */

static void fit_wall(aligner_wall *wall, cairn_vec2 direction)
{
    cairn_real values[2];
    cairn_vec2 minor, major;

    cairn_sym2_eigen(wall->spread, values, &minor, &major);
    if (cairn_vec2_dot(minor, cairn_vec2_left(direction)) < 0)
        minor = cairn_vec2_scale(minor, -1);
    wall->normal = minor;
    wall->offset = cairn_vec2_dot(minor, wall->middle);
}

/* The direction along a wall, free side on the left. */
static cairn_vec2 along_wall(const aligner_wall *wall)
{
    cairn_vec2 along = {wall->normal.y, -wall->normal.x};

    return along;
}

static void add_to_wall(cairn_aligner *x, aligner_wall *wall, const aligner_segment *s)
{
    cairn_transform pose = x->poses[s->scan];
    cairn_vec2 mean = cairn_transform_point(pose, s->mean), along;
    cairn_real c = pose.cosine, si = pose.sine, sum = wall->weight + s->weight, share = wall->weight * s->weight / sum;
    cairn_real dx = mean.x - wall->middle.x, dy = mean.y - wall->middle.y, low, high;
    cairn_sym2 m = s->spread;

    wall->spread.xx += c * c * m.xx - 2 * c * si * m.xy + si * si * m.yy + share * dx * dx;
    wall->spread.xy += c * si * (m.xx - m.yy) + (c * c - si * si) * m.xy + share * dx * dy;
    wall->spread.yy += si * si * m.xx + 2 * c * si * m.xy + c * c * m.yy + share * dy * dy;
    wall->middle.x += dx * s->weight / sum;
    wall->middle.y += dy * s->weight / sum;
    wall->weight = sum;
    fit_wall(wall, cairn_transform_direction(pose, s->direction));
    along = along_wall(wall);
    low = cairn_vec2_dot(along, cairn_transform_point(pose, s->a));
    high = low + s->length;
    wall->low = cairn_min(wall->low, low);
    wall->high = cairn_max(wall->high, high);
    if (wall->scans == 0)
        wall->first_scan = s->scan;
    if (wall->scans < 2 && (wall->scans == 0 || wall->first_scan != s->scan))
        wall->scans++;
}

/* How badly a segment (its ends in the map) fits a wall, m; negative: it does not. */
static cairn_real fits_wall(const aligner_wall *wall, cairn_vec2 a, cairn_vec2 b, cairn_vec2 direction, cairn_real gate)
{
    cairn_vec2 along = along_wall(wall);
    cairn_real error, low, gap, most;

    if (cairn_vec2_dot(along, direction) < LEAST_COSINE)
        return -1;
    error = cairn_max(cairn_abs(cairn_vec2_dot(wall->normal, a) - wall->offset),
                      cairn_abs(cairn_vec2_dot(wall->normal, b) - wall->offset));
    low = cairn_vec2_dot(along, a);
    gap = cairn_max(low - wall->high, wall->low - cairn_vec2_dot(along, b));
    most = cairn_max(GAP, GAP_LONG * cairn_min(wall->high - wall->low, cairn_vec2_dot(along, b) - low));
    if (gap > most || error > (gap > 0 ? GAP_STRICT * gate : gate))
        return -1;
    return error + GAP_COST * cairn_max(gap, 0);
}

/* Finds the wall of one segment, or makes a new one of it. */
static int32_t associate(cairn_aligner *x)
{
    aligner_segment *s = &x->segments[x->order[x->at]];
    cairn_transform pose;
    cairn_vec2 a, b, direction;
    cairn_real gate, best = CAIRN_REAL_MAX;

    if (x->at == 0)
        x->wall_count = 0;
    s->wall = -1;
    x->at++;
    if (!is_used(x, s))
        return 1;
    pose = x->poses[s->scan];
    direction = cairn_transform_direction(pose, s->direction);
    a = cairn_transform_point(pose, s->a);
    b = cairn_vec2_add(a, cairn_vec2_scale(direction, s->length));
    gate = gate_of(x->round) + (s->length < SHORT ? SHORT_EXTRA : 0);
    for (int32_t w = 0; w < x->wall_count; w++) {
        cairn_real fit = fits_wall(&x->walls[w], a, b, direction, gate);

        if (fit >= 0 && fit < best) {
            best = fit;
            s->wall = w;
        }
    }
    if (s->wall < 0) {
        aligner_wall *wall = &x->walls[x->wall_count];

        memset(wall, 0, sizeof *wall);
        wall->low = CAIRN_REAL_MAX;
        wall->high = -CAIRN_REAL_MAX;
        s->wall = x->wall_count++;
    }
    add_to_wall(x, &x->walls[s->wall], s);
    return 2 + x->wall_count / 8;
}

/* ---- The system ---- */

/* Numbers the walls that are shared behind the scans, and links them. */
static cairn_status begin_system(cairn_aligner *x)
{
    cairn_status status;

    x->node_count = x->scan_count;
    x->result.walls = 0;
    for (int32_t w = 0; w < x->wall_count; w++) {
        x->walls[w].node = x->walls[w].scans > 1 ? x->node_count++ : -1;
        x->result.walls += x->walls[w].scans > 1;
    }
    status = cairn_block_solver_begin(x->solver, x->node_count);
    for (int32_t k = 0; k < x->segment_count && status == CAIRN_OK; k++) {
        const aligner_segment *s = &x->segments[k];

        if (s->wall >= 0 && x->walls[s->wall].node >= 0)
            status = cairn_block_solver_add_link(x->solver, s->scan, x->walls[s->wall].node);
    }
    memset(x->rhs, 0, 3 * (size_t)x->node_count * sizeof *x->rhs);
    return status == CAIRN_OK ? cairn_block_solver_analyze(x->solver) : status;
}

/* Terms of a segment: those of its mean, and those of its spread about it, which move the angles only. */
static cairn_status add_segment(cairn_aligner *x, const aligner_segment *s, int32_t link)
{
    const aligner_wall *wall = &x->walls[s->wall];
    cairn_transform pose = x->poses[s->scan];
    cairn_vec2 mean = cairn_transform_point(pose, s->mean), along = along_wall(wall), n, t;
    cairn_vec2 arm = {mean.x - pose.x, mean.y - pose.y};
    cairn_real error = cairn_vec2_dot(wall->normal, mean) - wall->offset, st, sn, snn, chi, scale;
    cairn_real row[3], column[3], *b = &x->rhs[3 * s->scan], *c = &x->rhs[3 * wall->node], block[9];
    cairn_sym3 own = cairn_sym3_zero(), walls = cairn_sym3_zero();
    cairn_status status;

    /* Spread along the wall, across it, and of both, with the axes turned into the scan's frame. */
    n.x = pose.cosine * wall->normal.x + pose.sine * wall->normal.y;
    n.y = pose.cosine * wall->normal.y - pose.sine * wall->normal.x;
    t.x = n.y;
    t.y = -n.x;
    st = s->spread.xx * t.x * t.x + 2 * s->spread.xy * t.x * t.y + s->spread.yy * t.y * t.y;
    snn = s->spread.xx * n.x * n.x + 2 * s->spread.xy * n.x * n.y + s->spread.yy * n.y * n.y;
    sn = s->spread.xx * t.x * n.x + s->spread.xy * (t.x * n.y + t.y * n.x) + s->spread.yy * t.y * n.y;
    chi = s->weight * error * error + cairn_max(snn - s->least, 0);
    scale = 1 / (1 + chi / tolerance_of(x->round));
    scale *= scale;
    row[0] = wall->normal.x;
    row[1] = wall->normal.y;
    row[2] = cairn_vec2_dot(along, arm);
    column[0] = -1;
    column[1] = -(cairn_vec2_dot(along, mean) - cairn_vec2_dot(along, wall->middle));
    column[2] = 0;
    cairn_sym3_add_outer(&own, row, scale * s->weight);
    own.zz += scale * st;
    cairn_sym3_add_outer(&walls, column, scale * s->weight);
    walls.yy += scale * st;
    for (int r = 0; r < 3; r++) {
        b[r] -= scale * s->weight * error * row[r];
        c[r] -= scale * s->weight * error * column[r];
        for (int k = 0; k < 3; k++)
            block[3 * r + k] = scale * s->weight * row[r] * column[k];
    }
    block[7] -= scale * st;
    b[2] -= scale * sn;
    c[1] += scale * sn;
    status = cairn_block_solver_add_pose_block(x->solver, s->scan, own);
    if (status == CAIRN_OK)
        status = cairn_block_solver_add_pose_block(x->solver, wall->node, walls);
    return status == CAIRN_OK ? cairn_block_solver_add_link_block(x->solver, link, block) : status;
}

/* Initial poses, scans and walls that nothing else holds, and the anchor for covariances. */
static cairn_status add_priors(cairn_aligner *x, int32_t anchor)
{
    cairn_transform same = {0, 0, 1, 0}, gauge = cairn_aligner_inverse(cairn_aligner_gauge(x, x->home, -1, same));
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < x->scan_count && status == CAIRN_OK; i++) {
        cairn_real weight = 1 / (x->sigma * x->sigma), turn = 1 / (x->sigma_angle * x->sigma_angle);
        cairn_sym3 block = {weight, 0, 0, weight, 0, turn};

        if (x->scans[i].part == x->home) {
            cairn_transform initial = cairn_aligner_compose(gauge, cairn_transform_of(x->scans[i].initial));
            cairn_transform off = cairn_aligner_between(initial, x->poses[i]);

            x->rhs[3 * i] -= weight * (x->poses[i].x - initial.x);
            x->rhs[3 * i + 1] -= weight * (x->poses[i].y - initial.y);
            x->rhs[3 * i + 2] -= turn * cairn_atan2(off.sine, off.cosine);
        }
        if (i == anchor)
            block.xx = block.yy = block.zz = HELD;
        status = cairn_block_solver_add_pose_block(x->solver, i, block);
    }
    for (int32_t w = 0; w < x->wall_count && status == CAIRN_OK; w++) {
        const aligner_wall *wall = &x->walls[w];
        cairn_real loose = CAIRN_REAL_EPSILON * 256 * wall->weight + CAIRN_REAL(0.01);
        cairn_sym3 block = {loose, 0, 0, loose + 1, 0, 1};

        if (wall->node >= 0)
            status = cairn_block_solver_add_pose_block(x->solver, wall->node, block);
    }
    return status;
}

/* All values. */
static cairn_status build(cairn_aligner *x, int32_t anchor)
{
    cairn_status status = cairn_block_solver_clear(x->solver);
    int32_t link = 0;

    memset(x->rhs, 0, 3 * (size_t)x->node_count * sizeof *x->rhs);
    for (int32_t k = 0; k < x->segment_count && status == CAIRN_OK; k++) {
        const aligner_segment *s = &x->segments[k];

        if (s->wall >= 0 && x->walls[s->wall].node >= 0)
            status = add_segment(x, s, link++);
    }
    return status == CAIRN_OK ? add_priors(x, anchor) : status;
}

static void move_scans(cairn_aligner *x)
{
    x->moved = 0;
    for (int32_t i = 0; i < x->scan_count; i++) {
        cairn_transform *pose = &x->poses[i];
        cairn_vec2 centre = {pose->x, pose->y};
        cairn_real motion[3];

        if (x->scans[i].part != x->home || cairn_block_solver_solution(x->solver, i, motion) != CAIRN_OK)
            continue;
        x->moved = cairn_max(x->moved, cairn_max(cairn_abs(motion[0]), cairn_abs(motion[1])));
        *pose = cairn_aligner_moved(*pose, centre, motion);
    }
}

/* ---- The end ---- */

/* The scan that is held: with the most information in its own block, the walls known. */
static int32_t best_known(const cairn_aligner *x)
{
    int32_t best = -1;
    cairn_real most = -1;

    for (int32_t i = 0; i < x->scan_count; i++) {
        cairn_sym3 own = cairn_sym3_zero();
        cairn_real determinant;

        if (x->scans[i].part != x->home)
            continue;
        for (int32_t k = x->scans[i].first_segment; k < x->scans[i].end_segment; k++) {
            const aligner_segment *s = &x->segments[k];
            cairn_real row[3];

            if (s->wall < 0 || x->walls[s->wall].node < 0)
                continue;
            row[0] = x->walls[s->wall].normal.x;
            row[1] = x->walls[s->wall].normal.y;
            row[2] = cairn_vec2_cross(cairn_transform_direction(x->poses[i], s->mean), x->walls[s->wall].normal);
            cairn_sym3_add_outer(&own, row, s->weight * x->params.sigma * x->params.sigma);
        }
        determinant = own.xx * (own.yy * own.zz - own.yz * own.yz) - own.xy * (own.xy * own.zz - own.yz * own.xz) +
                      own.xz * (own.xy * own.yz - own.yy * own.xz);
        if (determinant > most) {
            most = determinant;
            best = i;
        }
    }
    return best;
}

/* m of a scan in its cluster's frame, as it is in the map: turned by the gauge. */
static void turn_covariance(cairn_transform gauge, const cairn_real m[9], cairn_real out[9])
{
    cairn_real r[9] = {gauge.cosine, -gauge.sine, 0, gauge.sine, gauge.cosine, 0, 0, 0, 1}, half[9];

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            half[3 * i + j] = r[3 * i] * m[j] + r[3 * i + 1] * m[3 + j] + r[3 * i + 2] * m[6 + j];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            out[3 * i + j] = half[3 * i] * r[3 * j] + half[3 * i + 1] * r[3 * j + 1] + half[3 * i + 2] * r[3 * j + 2];
}

static void judge(cairn_aligner *x, int32_t i)
{
    cairn_aligner_pose *r = &x->results[i];
    const cairn_real *c = r->covariance;
    cairn_real far = x->params.observable, turned = x->params.observable_angle;

    r->observable = (cairn_sqrt(c[0]) < far ? CAIRN_ALIGNER_X : 0) | (cairn_sqrt(c[4]) < far ? CAIRN_ALIGNER_Y : 0) |
                    (cairn_sqrt(c[8]) < turned ? CAIRN_ALIGNER_THETA : 0);
    r->placed =
        r->part == 0 && r->support >= LEAST_SUPPORT && cairn_sqrt(c[0] + c[4]) < far && cairn_sqrt(c[8]) < turned;
}

/* Numbers the clusters by size, ties by index; blind scans are no parts. */
static void number_parts(cairn_aligner *x)
{
    for (int32_t i = 0; i < x->scan_count; i++) {
        int32_t own = x->scans[i].part, before = 0;

        for (int32_t c = 0; c < x->scan_count; c++)
            before += x->clusters[c].size > x->clusters[own].size ||
                      (x->clusters[c].size == x->clusters[own].size && x->clusters[c].size > 0 && c < own);
        x->results[i].part = own == x->home ? 0 : before;
    }
    x->result.parts = 0;
    for (int32_t c = 0; c < x->scan_count; c++)
        x->result.parts += x->clusters[c].size > 1 ||
                           (x->clusters[c].size == 1 && cairn_aligner_points_of(x, x->clusters[c].head) > 0);
}

static void read_covariance(const cairn_aligner *x, int32_t i, cairn_transform gauge, cairn_real covariance[9])
{
    cairn_real block[9], prior = 2 * x->sigma * x->sigma, turn = 2 * x->sigma_angle * x->sigma_angle;

    memset(covariance, 0, 9 * sizeof *covariance);
    covariance[0] = covariance[4] = prior;
    covariance[8] = turn;
    if (x->scans[i].part != x->home || x->result.anchor < 0)
        return;
    if (i == x->result.anchor)
        memset(covariance, 0, 9 * sizeof *covariance);
    else if (cairn_block_solver_covariance(x->solver, i, i, block) == CAIRN_OK)
        turn_covariance(gauge, block, covariance);
}

static int32_t finish(cairn_aligner *x)
{
    cairn_transform same = {0, 0, 1, 0};

    number_parts(x);
    x->result.placed = 0;
    for (int32_t i = 0; i < x->scan_count; i++) {
        cairn_transform gauge = cairn_aligner_gauge(x, x->scans[i].part, -1, same);
        cairn_aligner_pose *r = &x->results[i];

        r->map_scan = cairn_aligner_to_pose(cairn_aligner_compose(gauge, x->poses[i]));
        r->support = x->scans[i].support;
        read_covariance(x, i, gauge, r->covariance);
        judge(x, i);
        for (int k = 0; k < 9; k++)
            r->covariance[k] *= MARGIN;
        x->result.placed += r->placed;
    }
    x->result.largest = x->clusters[x->home].size;
    x->result.spread = x->sigma;
    x->result.spread_angle = x->sigma_angle;
    if (x->result.verdict == CAIRN_ALIGNER_RUNNING) {
        x->result.verdict = x->moved <= AT_REST ? CAIRN_ALIGNER_CONVERGED : CAIRN_ALIGNER_OUT_OF_STEPS;
        if (x->result.parts > 1 || x->result.largest < 2)
            x->result.verdict = CAIRN_ALIGNER_SPLIT;
    }
    x->phase = ALIGNER_DONE;
    return x->scan_count * (x->scan_count / 16 + 4);
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
    cairn_real evidence;
    int32_t i = x->i, j = x->j;

    if (i == x->scan_count)
        return finish(x);
    if (j >= i) {
        x->i++;
        x->j = 0;
        return 1;
    }
    x->j++;
    if (x->scans[i].part != x->scans[j].part || !cairn_aligner_may_meet(x, i, j, x->poses[i], x->poses[j]))
        return 1;
    evidence = cairn_aligner_pair_evidence(x, i, j, cairn_aligner_between(x->poses[j], x->poses[i]), CAIRN_REAL(0.07));
    x->scans[i].support += evidence;
    x->scans[j].support += evidence;
    return 1 + (cairn_aligner_points_of(x, i) + cairn_aligner_points_of(x, j)) / ALIGNER_POINTS_OF_UNIT;
}

/* ---- Phases ---- */

static int32_t settle(cairn_aligner *x)
{
    if (x->stage == 0 && x->at == 0) {
        x->home = cairn_aligner_largest(x);
        if (x->segment_count == 0 || x->params.max_rounds == 0) {
            x->moved = 0;
            cairn_aligner_give_up(x, CAIRN_OK);
            return 1;
        }
    }
    return sort(x);
}

/* Builds and starts to factor; the anchor is held in the last round only. */
static int32_t begin_solution(cairn_aligner *x, int32_t anchor)
{
    cairn_status status = build(x, anchor);

    if (status == CAIRN_OK)
        status = cairn_block_solver_factor(x->solver);
    x->stage = 1;
    if (status != CAIRN_OK)
        cairn_aligner_give_up(x, status);
    return x->segment_count / 2 + x->node_count;
}

/* The solver has done what it was told; what comes next. */
static int32_t solve(cairn_aligner *x)
{
    cairn_block_solver_result state = cairn_block_solver_read(x->solver);

    if (x->stage == 0)
        return begin_solution(x, -1);
    if (x->stage == 1) {
        cairn_status status = state.state == CAIRN_BLOCK_SOLVER_FACTORED ? cairn_block_solver_solve(x->solver, x->rhs)
                                                                         : CAIRN_UNSUPPORTED;

        x->stage = 2;
        if (status != CAIRN_OK)
            cairn_aligner_give_up(x, status);
        return 1 + x->node_count / 8;
    }
    move_scans(x);
    x->result.rounds = ++x->round;
    x->result.fill = state.fill;
    x->at = x->stage = 0;
    if (x->round == x->params.max_rounds || (x->round > 6 && x->moved <= AT_REST)) {
        x->result.anchor = best_known(x);
        x->phase = ALIGNER_MARGINALS;
    } else {
        x->phase = ALIGNER_ASSOCIATE;
    }
    return x->scan_count;
}

static int32_t marginals(cairn_aligner *x)
{
    if (x->stage == 0)
        return begin_solution(x, x->result.anchor);
    if (x->stage == 1) {
        cairn_status status = cairn_block_solver_read(x->solver).state == CAIRN_BLOCK_SOLVER_FACTORED
                                  ? cairn_block_solver_invert(x->solver)
                                  : CAIRN_UNSUPPORTED;

        x->stage = 2;
        x->i = x->j = 0;
        if (status != CAIRN_OK)
            cairn_aligner_give_up(x, status);
        return 1;
    }
    return support_item(x);
}

int32_t cairn_aligner_joint_item(cairn_aligner *x)
{
    switch (x->phase) {
    case ALIGNER_SETTLE:
        return settle(x);
    case ALIGNER_ASSOCIATE:
        if (x->at < x->segment_count)
            return associate(x);
        x->phase = ALIGNER_SOLVE;
        x->stage = 0;
        {
            cairn_status status = begin_system(x);

            if (status != CAIRN_OK)
                cairn_aligner_give_up(x, status);
        }
        return x->segment_count / 4 + x->node_count / 8;
    case ALIGNER_SOLVE:
        return solve(x);
    default:
        return marginals(x);
    }
}
