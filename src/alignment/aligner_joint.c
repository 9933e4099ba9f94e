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
 * 5. Marginal covariances: the inverse of the same system, with one scan as anchor, is the
 *    Cramer-Rao bound of the poses at the solution. It decides about observability. The covariances
 *    are the bound times chi-squared per degree of freedom, since misassociated walls are not
 *    noise. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/aligner_work.h"

static const cairn_real ANCHOR_INFORMATION = CAIRN_REAL(1e10);
static const cairn_real CONVERGED_STEP_M = CAIRN_REAL(5e-4); /* m: converged below this step */
/* standard deviations of a damped iteration's motion */
static const cairn_real DAMPING_SIGMA_M = CAIRN_REAL(0.03), DAMPING_SIGMA_RAD = CAIRN_REAL(0.003);
static const cairn_real MIN_SUPPORT_NATS = 2; /* nats: least support of a placed scan */

/* Robust scale: chi-squared at which a segment loses weight, per iteration. */
static const cairn_real tolerances[] = {1000, 300, 100, 50, 25, 15, 12};

enum { RESUME_ITERATION = 6 }; /* iteration to resume from when scans were translated */
enum { MAX_TRANSLATION_PASSES = 2 };
enum { COVARIANCE_ITERATION = 4 }; /* iteration whose robust scale the covariances use */
/* Scans, and nodes, links, walls or blocks, whose fields are set. */
enum { SCANS_PER_UNIT = 16, NODES_PER_UNIT = 8, BLOCKS_PER_UNIT = 32 };
enum { UNITS_PER_RESULT = 8 };

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

/* Rotates a translation (or a row over it) into a frame, and back into the map. */
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
               weight = m.scale * segment->weight;
    cairn_sym3 own = cairn_sym3_zero(), walls = cairn_sym3_zero();
    cairn_status status;

    into_frame(aligner->scans[segment->scan].first_axis, m.row);
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

/* Adds a weak prior of a wall, and its unused third unknown. */
static cairn_status add_wall_prior(cairn_aligner *aligner, const aligner_wall *wall)
{
    cairn_real prior_weight = CAIRN_REAL_EPSILON * 256 * wall->weight + CAIRN_REAL(0.01);
    cairn_sym3 block = {prior_weight, 0, 0, prior_weight + 1, 0, 1};

    return wall->node >= 0 ? cairn_block_solver_add_pose_block(aligner->solver, wall->node, block)
                           : CAIRN_OK;
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
        out_of_frame(aligner->scans[i].first_axis, motion);
        aligner->joint.max_step = cairn_max(aligner->joint.max_step,
                                            cairn_max(cairn_abs(motion[0]), cairn_abs(motion[1])));
        *pose = cairn_aligner_moved(*pose, centre, motion);
    }
    aligner->clusters[aligner->move.home].stamp = ++aligner->change_count;
}

/* ---- Results ---- */

/* Makes a scan the anchor when its information, the walls given, has the greatest determinant so
 * far. */
static void consider_anchor(cairn_aligner *aligner, int32_t i)
{
    cairn_sym3 own;
    cairn_real determinant;

    if (aligner->scans[i].cluster != aligner->move.home)
        return;
    own = cairn_aligner_own_information(aligner, i);
    determinant = own.xx * (own.yy * own.zz - own.yz * own.yz) -
                  own.xy * (own.xy * own.zz - own.yz * own.xz) +
                  own.xz * (own.xy * own.yz - own.yy * own.xz);
    if (determinant > aligner->joint.determinant) {
        aligner->joint.determinant = determinant;
        aligner->result.anchor = i;
    }
}

/* Rotates a covariance m of a scan by the gauge into the map. */
static void rotate_covariance(cairn_transform gauge, const cairn_real m[9], cairn_real out[9])
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

static void set_observability(cairn_aligner *aligner, int32_t i)
{
    cairn_aligner_pose *r = &aligner->results[i];
    const cairn_real *c = r->covariance;
    cairn_real far = aligner->params.observable_sigma,
               turned = aligner->params.observable_sigma_theta;

    r->observable = (cairn_sqrt(c[0]) < far ? CAIRN_ALIGNER_X : 0) |
                    (cairn_sqrt(c[4]) < far ? CAIRN_ALIGNER_Y : 0) |
                    (cairn_sqrt(c[8]) < turned ? CAIRN_ALIGNER_THETA : 0);
    r->placed = r->component == 0 && r->support >= MIN_SUPPORT_NATS &&
                cairn_sqrt(c[0] + c[4]) < far && cairn_sqrt(c[8]) < turned;
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

static void read_covariance(const cairn_aligner *aligner, int32_t i, cairn_transform gauge,
                            cairn_real covariance[9])
{
    cairn_real block[9], prior = 2 * aligner->sigma * aligner->sigma,
                         turn = 2 * aligner->sigma_angle * aligner->sigma_angle;

    memset(covariance, 0, 9 * sizeof *covariance);
    covariance[0] = covariance[4] = prior;
    covariance[8] = turn;
    if (aligner->scans[i].cluster != aligner->move.home || aligner->result.anchor < 0)
        return;
    if (i == aligner->result.anchor)
        memset(covariance, 0, 9 * sizeof *covariance);
    else if (cairn_block_solver_covariance(aligner->solver, i, i, block) == CAIRN_OK) {
        cairn_vec2 frame = aligner->scans[i].first_axis;
        cairn_transform own = {0, 0, frame.x, frame.y};

        rotate_covariance(cairn_transform_compose(gauge, own), block, covariance);
    }
}

static void begin_chi2(cairn_aligner *aligner)
{
    aligner->joint.chi2_per_dof = 0;
    aligner->joint.dof =
        -3 * aligner->clusters[aligner->move.home].size - 2 * aligner->result.walls;
}

/* Adds chi-squared of a segment on a shared wall. */
static void add_chi2(cairn_aligner *aligner, const aligner_segment *segment)
{
    aligner_term m;

    if (!aligner_is_shared(aligner, segment))
        return;
    m = cairn_aligner_term_of(aligner, segment);
    aligner->joint.chi2_per_dof += m.chi * m.scale;
    aligner->joint.dof += 2;
}

static void end_chi2(cairn_aligner *aligner)
{
    aligner->joint.chi2_per_dof =
        aligner->joint.dof > 0
            ? cairn_max(aligner->joint.chi2_per_dof / (cairn_real)aligner->joint.dof, 1)
            : 1;
    aligner->joint.gauge_part = -1;
    aligner->result.placed = 0;
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
    read_covariance(aligner, i, aligner->joint.gauge, r->covariance);
    set_observability(aligner, i);
    for (int k = 0; k < 9; k++)
        r->covariance[k] *= aligner->joint.chi2_per_dof;
    aligner->result.placed += r->placed;
    aligner->scans[i].was_placed = r->placed;
}

/* ---- Steps ---- */

/* Step: writes the results of all scans. */
static int report(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_joint *joint = &aligner->joint;
    aligner_cursor *cursor = &aligner->cursor;

    CAIRN_STEP_BEGIN(aligner->resume.part);
    begin_chi2(aligner);
    for (joint->at = 0; joint->at < aligner->segment_count; joint->at++) {
        ALIGNER_CHARGE(part, 1);
        add_chi2(aligner, &aligner->segments[joint->at]);
    }
    end_chi2(aligner);
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

/* Step: chooses the anchor, and inverts the system. */
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
    CAIRN_STEP_RUN(aligner, resume.iteration, budget, factor);
    if (!joint->is_skipped)
        keep_status(aligner, cairn_block_solver_invert(aligner->solver));
    CAIRN_STEP_RUN(aligner, resume.iteration, budget, run_solver);
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
