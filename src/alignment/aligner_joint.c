/* aligner: joint least squares over the poses of the largest cluster and the walls that its scans
 * share, with marginal covariances.
 *
 * Method: each wall (aligner_wall.c) has an unknown offset and angle.
 * 1. Normal equations by moments: a hit at p has the residual e = n p - rho, whose Jacobian J is
 *    linear in p. The sums of J J^T and J e over all hits of a segment therefore follow from its
 *    weight, mean and scatter matrix. Every beam counts, and none is stored.
 * 2. Robust weights (Geman and McClure) of segments, with a scale that falls from iteration to
 *    iteration. They are those of whole segments, beside walls that are unknown themselves; the
 *    weights of registration are those of pairs with known lines.
 * 3. The estimated variances of the initial poses are a weak prior at the current pose. After the
 *    joint translations of groups (aligner_shift.c) the prior is narrower, so that walls of little
 *    robust weight do not pull them back.
 * 4. Sparse Cholesky (block_solver), update, until convergence.
 * 5. Marginal covariances (aligner_covariance.c): the inverse of this system at the solution, with
 *    one scan, the anchor, fixed. The line of each segment then has a variance of its own, beside
 *    the noise of its hits: surfaces are not lines, and some walls are misassociated. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/aligner_work.h"

static const cairn_real ANCHOR_INFORMATION = CAIRN_REAL(1e10);
static const cairn_real CONVERGED_STEP_M = CAIRN_REAL(5e-4); /* m: converged below this step */
/* standard deviations of a damped iteration's motion */
static const cairn_real DAMPING_SIGMA_M = CAIRN_REAL(0.03), DAMPING_SIGMA_RAD = CAIRN_REAL(0.003);
static const cairn_real MIN_SUPPORT_NATS = 2; /* nats: of a placed or an anchored scan */
/* m: standard deviation of the line of a segment on its wall, beside the noise of its hits. With
 * it 91 to 98 % of the placed scans of apartments, mazes and offices lie within their 95 % ellipses;
 * of rooms that nothing joins fewer do (docs/lab/align.md) */
static const cairn_real LINE_SIGMA_M = CAIRN_REAL(0.00175);
/* Weak prior of a wall: relative rounding errors of its information, as its own information. In float
 * it can make groups of scans observable that nothing joins, so that of the marginals is less. */
static const cairn_real PRIOR_ROUNDINGS = 256, MARGINAL_PRIOR_ROUNDINGS = 32;
/* standard deviations of the position of a placed scan that are within the limit of an observable
 * one: 97.5 % of the errors along a line */
static const cairn_real PLACED_SIGMAS = CAIRN_REAL(2.24);

/* Robust scale: chi-squared at which a segment loses weight, per iteration. */
static const cairn_real tolerances[] = {1000, 300, 100, 50, 25, 15, 12};

enum { RESUME_ITERATION = 6 }; /* iteration to resume from when scans were translated */
enum { MAX_TRANSLATION_PASSES = 2 };
enum { COVARIANCE_ITERATION = 4 }; /* iteration whose robust scale the covariances use */
enum { MAX_DATUM_PASSES = 2 };
/* Scans, and nodes, links, walls or blocks, whose fields are set. */
enum { SCANS_PER_UNIT = 16, NODES_PER_UNIT = 8, BLOCKS_PER_UNIT = 32 };
enum { UNITS_PER_RESULT = 8, UNITS_PER_COVARIANCE = 4 };
/* Scans that the datum is found from, or whose column of it is read. */
enum { SCANS_PER_DATUM_UNIT = 2 };

/* Sets the robust scale: in standard deviations, and in early iterations also in metres, however
 * well a long segment is known. */
static void set_tolerance(cairn_aligner *aligner, int32_t round)
{
    static const cairn_real metres[] = {CAIRN_REAL(0.08), CAIRN_REAL(0.08), CAIRN_REAL(0.05),
                                        CAIRN_REAL(0.03)};

    aligner->joint.robust_chi2 = tolerances[round < 6 ? round : 6];
    aligner->joint.robust_squared_distance = round < 4 ? metres[round] * metres[round] : 0;
}

/* ---- The linear system ---- */

/* Numbers the nodes of shared walls behind the scans. */
static void number_walls(cairn_aligner *aligner)
{
    aligner->node_count = aligner->scan_count;
    aligner->result.walls = 0;
    for (int32_t w = 0; w < aligner->wall_count; w++) {
        aligner->walls[w].node = aligner->walls[w].scan_count > 1 ? aligner->node_count++ : -1;
        aligner->result.walls += aligner->walls[w].scan_count > 1;
    }
}

/* Keeps a status of the solver: without success there is no joint solution. */
static void keep_status(cairn_aligner *aligner, cairn_status status)
{
    if (status == CAIRN_OK)
        return;
    if (status == CAIRN_FULL)
        aligner->result.verdict = CAIRN_ALIGNER_FILL_EXCEEDED;
    aligner->joint.is_skipped = 1;
}

/* Step: runs the stage of the solver that has begun, if one has. */
static int run_solver(cairn_aligner *aligner, cairn_budget *budget)
{
    cairn_status status = CAIRN_OK;

    if (cairn_block_solver_read(aligner->solver).running)
        status = cairn_block_solver_step(aligner->solver, budget);
    if (status == CAIRN_MORE)
        return 0;
    keep_status(aligner, status);
    return 1;
}

/* Adds the link of a segment on a shared wall. */
static void add_link(cairn_aligner *aligner, const aligner_segment *s)
{
    if (aligner_is_shared(aligner, s))
        keep_status(aligner, cairn_block_solver_add_link(aligner->solver, s->scan,
                                                         aligner->walls[s->wall].node));
}

/* Step: numbers the nodes, adds the links of the segments, and analyzes the system; with a fixed
 * association it is unchanged. */
static int link_segments(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_joint *joint = &aligner->joint;

    CAIRN_STEP_BEGIN(aligner->resume.part);
    ALIGNER_CHARGE(part, 1 + aligner->wall_count / BLOCKS_PER_UNIT +
                             (aligner->scan_count + aligner->wall_count) / NODES_PER_UNIT);
    number_walls(aligner);
    if (!cairn_aligner_has_fixed_association(aligner)) {
        keep_status(aligner, cairn_block_solver_begin(aligner->solver, aligner->node_count));
        for (joint->at = 0; joint->at < aligner->segment_count && !joint->is_skipped; joint->at++) {
            ALIGNER_CHARGE_EVERY(part, NODES_PER_UNIT, joint->at);
            add_link(aligner, &aligner->segments[joint->at]);
        }
        if (!joint->is_skipped) {
            ALIGNER_CHARGE(part,
                           (cairn_block_solver_read(aligner->solver).links + aligner->node_count) /
                               NODES_PER_UNIT);
            keep_status(aligner, cairn_block_solver_analyze(aligner->solver));
            CAIRN_STEP_RUN(aligner, resume.part, budget, run_solver);
        }
    }
    CAIRN_STEP_END(aligner->resume.part);
}

/* Returns the direction of a scan's first unknown: its least observable translation. A scan of one
 * wall is known ten thousand times better across than along. With skew axes, all entries of its
 * block's inverse would be of the larger magnitude, and the smaller one would be lost to rounding
 * in float. */
static cairn_vec2 frame_of(const cairn_aligner *aligner, int32_t scan)
{
    cairn_sym3 own = cairn_aligner_own_information(aligner, scan);
    cairn_sym2 shifts = {own.xx, own.xy, own.yy};
    cairn_real values[2];
    cairn_vec2 least, most;

    cairn_sym2_eigen(shifts, values, &least, &most);
    return least;
}

static cairn_status add_segment(cairn_aligner *aligner, const aligner_segment *segment,
                                int32_t link)
{
    int32_t node = aligner->walls[segment->wall].node;
    aligner_term m = cairn_aligner_term_of(aligner, segment);
    cairn_real *b = &aligner->rhs[3 * segment->scan], *c = &aligner->rhs[3 * node], block[9],
               weight;
    cairn_sym3 own = cairn_sym3_zero(), walls = cairn_sym3_zero();
    cairn_status status;

    if (aligner->result.anchor >= 0)
        m.scale /= 1 + segment->weight * (LINE_SIGMA_M * LINE_SIGMA_M);
    weight = m.scale * segment->weight;
    aligner_into_axes(aligner->scans[segment->scan].first_axis, m.row);
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
    status = cairn_block_solver_add_pose_block(aligner->solver, segment->scan, own);
    if (status == CAIRN_OK)
        status = cairn_block_solver_add_pose_block(aligner->solver, node, walls);
    return status == CAIRN_OK ? cairn_block_solver_add_link_block(aligner->solver, link, block)
                              : status;
}

/* Adds the prior of a scan, and fixes the anchor. */
static cairn_status add_prior(cairn_aligner *aligner, int32_t i, int32_t anchor)
{
    cairn_real weight = 1 / (aligner->sigma * aligner->sigma),
               turn = 1 / (aligner->sigma_angle * aligner->sigma_angle);
    cairn_sym3 block = {weight, 0, 0, weight, 0, turn};

    if (aligner->joint.is_damped && anchor < 0) {
        block.xx = block.yy = cairn_max(weight, 1 / (DAMPING_SIGMA_M * DAMPING_SIGMA_M));
        block.zz = cairn_max(turn, 1 / (DAMPING_SIGMA_RAD * DAMPING_SIGMA_RAD));
    }
    if (i == anchor)
        block.xx = block.yy = block.zz = ANCHOR_INFORMATION;
    return cairn_block_solver_add_pose_block(aligner->solver, i, block);
}

/* Adds a weak prior of a wall, and its unused third unknown. That of the marginals is of the
 * information that the variance of lines leaves. */
static cairn_status add_wall_prior(cairn_aligner *aligner, const aligner_wall *wall)
{
    cairn_real weight = PRIOR_ROUNDINGS * wall->weight;
    cairn_sym3 block = {0, 0, 0, 1, 0, 1};

    if (wall->node < 0)
        return CAIRN_OK;
    if (aligner->result.anchor >= 0)
        weight = MARGINAL_PRIOR_ROUNDINGS * wall->weight /
                 (1 + wall->weight * (LINE_SIGMA_M * LINE_SIGMA_M) / (cairn_real)wall->scan_count);
    block.xx = CAIRN_REAL_EPSILON * weight + CAIRN_REAL(0.01);
    block.yy += block.xx;
    return cairn_block_solver_add_pose_block(aligner->solver, wall->node, block);
}

/* Returns the units of the k-th term: the first segment of a scan comes with the scan's frame. */
static int32_t units_of_value(const cairn_aligner *aligner, int32_t k)
{
    const aligner_scan *scan;

    if (k >= aligner->segment_count)
        return 1;
    scan = &aligner->scans[aligner->segments[k].scan];
    return k == scan->first_segment ? 1 + (scan->end_segment - k) / 2 : 1;
}

/* Adds the k-th term: segments, then scans, then walls. */
static cairn_status add_value(cairn_aligner *aligner, int32_t k, int32_t anchor)
{
    if (k < aligner->segment_count) {
        int32_t scan = aligner->segments[k].scan;

        if (k == aligner->scans[scan].first_segment)
            aligner->scans[scan].first_axis = frame_of(aligner, scan);
        return aligner_is_shared(aligner, &aligner->segments[k])
                   ? add_segment(aligner, &aligner->segments[k], aligner->joint.link++)
                   : CAIRN_OK;
    }
    k -= aligner->segment_count;
    return k < aligner->scan_count
               ? add_prior(aligner, k, anchor)
               : add_wall_prior(aligner, &aligner->walls[k - aligner->scan_count]);
}

static void begin_system(cairn_aligner *aligner)
{
    keep_status(aligner, cairn_block_solver_clear(aligner->solver));
    memset(aligner->rhs, 0, 3 * (size_t)aligner->node_count * sizeof *aligner->rhs);
    aligner->joint.link = 0;
}

/* Step: adds all terms, and factors the system. The result's anchor is fixed: -1 but for the
 * marginals. */
static int factor(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_joint *joint = &aligner->joint;

    CAIRN_STEP_BEGIN(aligner->resume.part);
    ALIGNER_CHARGE(part, 1 + aligner->result.fill / BLOCKS_PER_UNIT +
                             aligner->node_count / BLOCKS_PER_UNIT);
    begin_system(aligner);
    for (joint->at = 0;
         joint->at < aligner->segment_count + aligner->scan_count + aligner->wall_count &&
         !joint->is_skipped;
         joint->at++) {
        ALIGNER_CHARGE(part, units_of_value(aligner, joint->at));
        keep_status(aligner, add_value(aligner, joint->at, aligner->result.anchor));
    }
    if (!joint->is_skipped) {
        keep_status(aligner, cairn_block_solver_factor(aligner->solver));
        CAIRN_STEP_RUN(aligner, resume.part, budget, run_solver);
    }
    if (!joint->is_skipped &&
        cairn_block_solver_read(aligner->solver).state != CAIRN_BLOCK_SOLVER_FACTORED)
        keep_status(aligner, CAIRN_UNSUPPORTED);
    CAIRN_STEP_END(aligner->resume.part);
}

static void move_scans(cairn_aligner *aligner)
{
    aligner->joint.max_step = 0;
    for (int32_t i = 0; i < aligner->scan_count; i++) {
        cairn_transform *pose = &aligner->poses[i];
        cairn_vec2 centre = {pose->x, pose->y};
        cairn_real motion[3];

        if (aligner->scans[i].cluster != aligner->move.home ||
            cairn_block_solver_solution(aligner->solver, i, motion) != CAIRN_OK)
            continue;
        aligner_out_of_axes(aligner->scans[i].first_axis, motion);
        aligner->joint.max_step = cairn_max(aligner->joint.max_step,
                                            cairn_max(cairn_abs(motion[0]), cairn_abs(motion[1])));
        *pose = cairn_aligner_moved(*pose, centre, motion);
    }
    aligner->clusters[aligner->move.home].stamp = ++aligner->change_count;
}

/* ---- Results ---- */

/* Makes a scan the anchor when its information, the walls given, has the greatest determinant so
 * far; makes it a reference scan when this information makes its position observable. */
static void consider_anchor(cairn_aligner *aligner, int32_t i)
{
    cairn_real far = aligner->params.observable_sigma, values[3], vectors[3][3], determinant;
    cairn_sym3 own;

    aligner->scans[i].is_reference = 0;
    if (aligner->scans[i].cluster != aligner->move.home)
        return;
    own = cairn_aligner_own_information(aligner, i);
    cairn_aligner_eigen(own, values, vectors);
    aligner->scans[i].is_reference = values[0] * far * far > 1;
    determinant = own.xx * (own.yy * own.zz - own.yz * own.yz) -
                  own.xy * (own.xy * own.zz - own.yz * own.xz) +
                  own.xz * (own.xy * own.yz - own.yy * own.xz);
    if (determinant > aligner->joint.determinant) {
        aligner->joint.determinant = determinant;
        aligner->result.anchor = i;
    }
}

static void set_observability(cairn_aligner *aligner, int32_t i)
{
    cairn_aligner_pose *r = &aligner->results[i];
    const cairn_real *c = r->covariance;
    cairn_real far = aligner->params.observable_sigma,
               turned = aligner->params.observable_sigma_theta;
    int is_supported;

    r->observable = (cairn_sqrt(c[0]) < far ? CAIRN_ALIGNER_X : 0) |
                    (cairn_sqrt(c[4]) < far ? CAIRN_ALIGNER_Y : 0) |
                    (cairn_sqrt(c[8]) < turned ? CAIRN_ALIGNER_THETA : 0);
    is_supported = r->component == 0 && r->support >= MIN_SUPPORT_NATS;
    r->placed = is_supported && cairn_aligner_is_observable(aligner, c, PLACED_SIGMAS);
    r->anchored = is_supported && cairn_aligner_is_observable(aligner, r->anchor_covariance, 1);
}

/* Returns the component number of a scan's cluster: by size, ties by index. */
static int32_t component_of(const cairn_aligner *aligner, int32_t i)
{
    int32_t own = aligner->scans[i].cluster, before = 0;

    for (int32_t c = 0; c < aligner->scan_count; c++)
        before += aligner->clusters[c].size > aligner->clusters[own].size ||
                  (aligner->clusters[c].size == aligner->clusters[own].size &&
                   aligner->clusters[c].size > 0 && c < own);
    return own == aligner->move.home ? 0 : before;
}

/* Counts the components, without scans that have no points. */
static int32_t count_components(const cairn_aligner *aligner)
{
    int32_t parts = 0;

    for (int32_t c = 0; c < aligner->scan_count; c++)
        parts += aligner->clusters[c].size > 1 ||
                 (aligner->clusters[c].size == 1 &&
                  cairn_aligner_points_of(aligner, aligner->clusters[c].head) > 0);
    return parts;
}

static void finish(cairn_aligner *aligner)
{
    aligner->result.components = count_components(aligner);
    aligner->result.largest_size = aligner->clusters[aligner->move.home].size;
    aligner->result.initial_sigma = aligner->sigma;
    aligner->result.initial_sigma_theta = aligner->sigma_angle;
    if (aligner->result.verdict == CAIRN_ALIGNER_RUNNING) {
        aligner->result.verdict = aligner->joint.max_step <= CONVERGED_STEP_M
                                      ? CAIRN_ALIGNER_CONVERGED
                                      : CAIRN_ALIGNER_OUT_OF_ITERATIONS;
        if (aligner->result.components > 1 || aligner->result.largest_size < 2)
            aligner->result.verdict = CAIRN_ALIGNER_DISCONNECTED;
    }
}

/* Returns the units of the result of a scan; the first of a cluster comes with its gauge. */
static int32_t units_of_result(const cairn_aligner *aligner, int32_t i)
{
    int32_t part = aligner->scans[i].cluster;

    return UNITS_PER_RESULT + aligner->scan_count / SCANS_PER_UNIT +
           (part == aligner->joint.gauge_part ? 0 : aligner->clusters[part].size);
}

/* Writes the result of one scan; not inlined, which keeps its matrices off the stack of the nested
 * steps. */
CAIRN_STEP_NOT_INLINED static void report_scan(cairn_aligner *aligner, int32_t i)
{
    cairn_aligner_pose *r = &aligner->results[i];

    if (aligner->scans[i].cluster != aligner->joint.gauge_part) {
        aligner->joint.gauge_part = aligner->scans[i].cluster;
        aligner->joint.gauge = cairn_aligner_gauge(aligner, aligner->joint.gauge_part);
    }
    r->component = component_of(aligner, i);
    r->map_scan = cairn_pose_of(cairn_transform_compose(aligner->joint.gauge, aligner->poses[i]));
    r->support = aligner->scans[i].support;
    cairn_aligner_write_covariances(aligner, i);
    set_observability(aligner, i);
    aligner->result.placed += r->placed;
    aligner->result.anchored += r->anchored;
    aligner->scans[i].was_anchored = r->anchored;
}

/* ---- Steps ---- */

/* Step: writes the results of all scans. */
static int report(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_cursor *cursor = &aligner->cursor;

    CAIRN_STEP_BEGIN(aligner->resume.part);
    aligner->joint.gauge_part = -1;
    aligner->result.placed = aligner->result.anchored = 0;
    for (cursor->scan = 0; cursor->scan < aligner->scan_count; cursor->scan++) {
        ALIGNER_CHARGE(part, units_of_result(aligner, cursor->scan));
        report_scan(aligner, cursor->scan);
    }
    CAIRN_STEP_RUN(aligner, resume.part, budget, cairn_aligner_charge_scans);
    finish(aligner);
    CAIRN_STEP_END(aligner->resume.part);
}

static void begin_joint(cairn_aligner *aligner)
{
    aligner->move.home = cairn_aligner_largest(aligner);
    aligner->result.anchor = -1;
    aligner->joint.round = aligner->joint.translations_done = aligner->joint.is_damped = 0;
    aligner->joint.is_skipped = aligner->segment_count == 0 || aligner->params.max_iterations == 0;
    if (aligner->joint.is_skipped)
        aligner->joint.max_step = 0;
}

/* Moves the scans by the solution, and ends an iteration. */
static void end_iteration(cairn_aligner *aligner)
{
    int32_t fill = cairn_block_solver_read(aligner->solver).fill;

    move_scans(aligner);
    if (fill > aligner->result.fill)
        aligner->result.fill = fill;
    aligner->joint.round++;
    aligner->result.iterations++;
}

/* Step: one Gauss-Newton iteration. */
static int iterate(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_joint *joint = &aligner->joint;

    CAIRN_STEP_BEGIN(aligner->resume.iteration);
    CAIRN_STEP_RUN(aligner, resume.iteration, budget, cairn_aligner_associate);
    CAIRN_STEP_RUN(aligner, resume.iteration, budget, link_segments);
    if (!joint->is_skipped) {
        set_tolerance(aligner, joint->round);
        CAIRN_STEP_RUN(aligner, resume.iteration, budget, factor);
    }
    if (!joint->is_skipped) {
        ALIGNER_CHARGE(iteration, 1 + aligner->node_count / NODES_PER_UNIT + aligner->scan_count);
        keep_status(aligner, cairn_block_solver_solve(aligner->solver, aligner->rhs));
    }
    CAIRN_STEP_RUN(aligner, resume.iteration, budget, run_solver);
    if (!joint->is_skipped)
        end_iteration(aligner);
    CAIRN_STEP_END(aligner->resume.iteration);
}

/* While translations may follow, the iterations end with the fixed association; only then must they
 * converge. */
static int is_translation_due(const cairn_aligner *aligner)
{
    return !aligner->joint.is_skipped && !aligner->joint.translations_done &&
           (aligner->joint.round >= aligner->params.max_iterations ||
            cairn_aligner_has_fixed_association(aligner));
}

/* Ends the translations: when there were some, more iterations follow. */
static void end_translations(cairn_aligner *aligner)
{
    aligner->joint.translations_done = aligner->changed_scans == 0;
    if (!aligner->joint.translations_done)
        aligner->joint.round = RESUME_ITERATION < aligner->params.max_iterations
                                   ? RESUME_ITERATION
                                   : aligner->params.max_iterations - 1;
}

static int has_ended(const cairn_aligner *aligner)
{
    return aligner->joint.translations_done &&
           (aligner->joint.round >= aligner->params.max_iterations ||
            (cairn_aligner_has_fixed_association(aligner) &&
             aligner->joint.max_step <= CONVERGED_STEP_M));
}

/* Sets the robust scale of the marginals, at the final poses and walls. */
static void begin_marginals(aligner_joint *joint)
{
    joint->robust_chi2 = tolerances[COVARIANCE_ITERATION];
    joint->robust_squared_distance = 0;
    joint->determinant = -1;
}

/* Step: the covariances of all scans with the datum and with themselves. */
static int find_covariances(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_joint *joint = &aligner->joint;

    CAIRN_STEP_BEGIN(aligner->resume.item);
    CAIRN_STEP_RUN(aligner, resume.item, budget, factor);
    ALIGNER_CHARGE(item, 1 + aligner->scan_count / SCANS_PER_DATUM_UNIT);
    cairn_aligner_begin_datum(aligner);
    for (joint->datum.column = 0; joint->datum.column < 3 && !joint->is_skipped;
         joint->datum.column++) {
        ALIGNER_CHARGE(item, 1 + aligner->node_count / NODES_PER_UNIT + aligner->scan_count);
        cairn_aligner_set_column(aligner);
        keep_status(aligner, cairn_block_solver_solve(aligner->solver, aligner->rhs));
        CAIRN_STEP_RUN(aligner, resume.item, budget, run_solver);
        ALIGNER_CHARGE(item, 1 + aligner->scan_count / SCANS_PER_DATUM_UNIT);
        if (!joint->is_skipped)
            keep_status(aligner, cairn_aligner_read_column(aligner));
    }
    if (!joint->is_skipped)
        keep_status(aligner, cairn_block_solver_invert(aligner->solver));
    CAIRN_STEP_RUN(aligner, resume.item, budget, run_solver);
    CAIRN_STEP_END(aligner->resume.item);
}

/* Step: chooses the anchor, and inverts the system; once more for another datum when a reference
 * scan has turned out not to be observable. */
static int find_marginals(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_joint *joint = &aligner->joint;
    const aligner_scan *scans = aligner->scans;

    CAIRN_STEP_BEGIN(aligner->resume.iteration);
    begin_marginals(joint);
    for (joint->at = 0; joint->at < aligner->scan_count; joint->at++) {
        ALIGNER_CHARGE(iteration,
                       1 + (scans[joint->at].end_segment - scans[joint->at].first_segment) / 2);
        consider_anchor(aligner, joint->at);
    }
    for (joint->datum.pass = 1; !joint->is_skipped; joint->datum.pass++) {
        CAIRN_STEP_RUN(aligner, resume.iteration, budget, find_covariances);
        if (joint->is_skipped || joint->datum.pass == MAX_DATUM_PASSES)
            break;
        for (joint->at = 0; joint->at < aligner->scan_count; joint->at++) {
            ALIGNER_CHARGE(iteration, UNITS_PER_COVARIANCE);
            cairn_aligner_choose_reference(aligner, joint->at);
        }
        if (!cairn_aligner_is_datum_spoilt(aligner))
            break;
    }
    if (joint->is_skipped)
        aligner->result.anchor = -1;
    CAIRN_STEP_END(aligner->resume.iteration);
}

int cairn_aligner_solve_jointly(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_joint *joint = &aligner->joint;

    CAIRN_STEP_BEGIN(aligner->resume.phase);
    CAIRN_STEP_RUN(aligner, resume.phase, budget, cairn_aligner_charge_scans);
    begin_joint(aligner);
    if (!joint->is_skipped)
        CAIRN_STEP_RUN(aligner, resume.phase, budget, cairn_aligner_sort);
    while (!joint->is_skipped && !has_ended(aligner)) {
        CAIRN_STEP_RUN(aligner, resume.phase, budget, iterate);
        if (is_translation_due(aligner)) {
            aligner->changed_scans = 0;
            if (aligner->translation_passes++ < MAX_TRANSLATION_PASSES)
                CAIRN_STEP_RUN(aligner, resume.phase, budget, cairn_aligner_translate);
            if (!joint->is_damped)
                CAIRN_STEP_RUN(aligner, resume.phase, budget, cairn_aligner_shift);
            ALIGNER_CHARGE(phase, 1);
            joint->is_damped = 1;
            end_translations(aligner);
        }
    }
    if (!joint->is_skipped)
        CAIRN_STEP_RUN(aligner, resume.phase, budget, find_marginals);
    CAIRN_STEP_RUN(aligner, resume.phase, budget, cairn_aligner_count_support);
    CAIRN_STEP_RUN(aligner, resume.phase, budget, report);
    CAIRN_STEP_END(aligner->resume.phase);
}
