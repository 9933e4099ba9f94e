/* aligner: clusters of scans with known relative poses, each in its own frame; evaluation and
 * relaxation.
 *
 * Method:
 * 1. Evaluation of two clusters: Gauss-Newton on all pairs of scans that may overlap refines their
 *    relative pose, then the points are counted for its log-likelihood ratio. The initial poses add
 *    a prior (aligner_prior.c): the increase of their residuals under a common motion.
 * 2. Relaxation: nonlinear Gauss-Seidel over the scans of a cluster. Only dirty scans are relaxed:
 *    those merged last, and those whose accumulated gradient would move them.
 * 3. Merge: the smaller cluster enters the frame of the larger one. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/aligner_work.h"

static const cairn_real COUNT_GATE_M = CAIRN_REAL(0.07);
/* m: a scan that moves less makes no other dirty */
static const cairn_real MIN_MOTION_M = CAIRN_REAL(0.006);

void cairn_aligner_insert(cairn_aligner *aligner, int32_t scan, int32_t cluster)
{
    aligner_cluster *c = &aligner->clusters[cluster];

    cairn_aligner_update_prior_sums(aligner, scan, cluster, 1);
    aligner->scans[scan].cluster = cluster;
    aligner->scans[scan].next_in_cluster = c->head;
    c->head = scan;
    c->size++;
    c->stamp = ++aligner->change_count;
}

void cairn_aligner_remove(cairn_aligner *aligner, int32_t scan)
{
    aligner_cluster *c = &aligner->clusters[aligner->scans[scan].cluster];
    int32_t *link = &c->head;

    cairn_aligner_update_prior_sums(aligner, scan, aligner->scans[scan].cluster, -1);
    while (*link != scan)
        link = &aligner->scans[*link].next_in_cluster;
    *link = aligner->scans[scan].next_in_cluster;
    aligner->scans[scan].next_in_cluster = -1;
    c->size--;
    c->stamp = ++aligner->change_count;
}

int32_t cairn_aligner_largest(const cairn_aligner *aligner)
{
    int32_t best = 0;

    for (int32_t c = 1; c < aligner->scan_count; c++)
        if (aligner->clusters[c].size > aligner->clusters[best].size)
            best = c;
    return best;
}

void cairn_aligner_begin_clusters(cairn_aligner *aligner)
{
    static const cairn_vec2 x_axis = {1, 0};

    memset(aligner->clusters, 0, ((size_t)aligner->scan_count + 1) * sizeof *aligner->clusters);
    for (int32_t i = 0; i <= aligner->scan_count; i++)
        aligner->clusters[i].head = aligner->prior_sums[i].stamp = -1;
    for (int32_t i = 0; i < aligner->scan_count; i++) {
        aligner->poses[i] = cairn_transform_of(aligner->scans[i].initial);
        aligner->scans[i].support = aligner->scans[i].log_likelihood_ratio = 0;
        aligner->scans[i].is_weak = aligner->scans[i].relax_state = 0;
        aligner->scans[i].merge_event = -1 - i;
        aligner->scans[i].first_axis = x_axis;
        memset(&aligner->scans[i].normal_equations, 0, sizeof aligner->scans[i].normal_equations);
        cairn_aligner_insert(aligner, i, i);
    }
    cairn_aligner_estimate_sigmas(aligner);
}

/* ---- Evaluation ---- */

void cairn_aligner_begin_evaluation(cairn_aligner *aligner, int32_t moving, int32_t fixed,
                                    cairn_transform pose, int32_t rounds, cairn_real least)
{
    aligner_evaluation *evaluation = &aligner->evaluation;
    int32_t first = aligner->clusters[moving].head;

    memset(evaluation, 0, sizeof *evaluation);
    evaluation->active = 1;
    evaluation->moving = moving;
    evaluation->fixed = fixed;
    evaluation->pose = pose;
    evaluation->rounds = rounds;
    evaluation->lower_bound = least;
    evaluation->outer =
        aligner->clusters[moving].size <= aligner->clusters[fixed].size ? moving : fixed;
    evaluation->inner = evaluation->outer == moving ? fixed : moving;
    evaluation->member = aligner->clusters[evaluation->outer].head;
    evaluation->centre = cairn_transform_point(cairn_transform_compose(pose, aligner->poses[first]),
                                               aligner->scans[first].middle);
}

static cairn_real refine_gate(int32_t round)
{
    static const cairn_real gates[] = {CAIRN_REAL(0.15), CAIRN_REAL(0.10), CAIRN_REAL(0.07)};

    return gates[round < 2 ? round : 2];
}

static void find_weak_direction(aligner_evaluation *evaluation)
{
    cairn_real values[3], vectors[3][3];

    cairn_aligner_eigen(evaluation->sums.equations.information, values, vectors);
    memcpy(evaluation->weak_direction, vectors[0], sizeof evaluation->weak_direction);
    evaluation->weak_direction[2] /= ALIGNER_ARM_M;
}

static void end_refinement(aligner_evaluation *evaluation)
{
    cairn_real motion[3];

    find_weak_direction(evaluation);
    if (cairn_aligner_solve(&evaluation->sums, motion))
        evaluation->pose = cairn_aligner_moved(evaluation->pose, evaluation->centre, motion);
    else
        evaluation->round = evaluation->rounds - 1;
    memset(&evaluation->sums, 0, sizeof evaluation->sums);
    evaluation->round++;
}

static void end_evaluation(cairn_aligner *aligner)
{
    aligner_evaluation *evaluation = &aligner->evaluation;

    evaluation->active = 0;
    evaluation->log_likelihood_ratio =
        cairn_aligner_log_likelihood_ratio(aligner, evaluation->count);
    evaluation->log_prior =
        cairn_aligner_prior(aligner, evaluation->moving, evaluation->fixed, evaluation->pose);
}

/* Evaluates a pair of scans, a of the outer cluster; returns the number of lookups. */
static int32_t evaluate_pair(cairn_aligner *aligner, int32_t a, int32_t b, cairn_transform pose_a,
                             cairn_transform pose_b)
{
    aligner_evaluation *evaluation = &aligner->evaluation;
    int32_t turn = evaluation->outer != evaluation->moving, i = turn ? b : a, j = turn ? a : b;
    cairn_transform pose_i = turn ? pose_b : pose_a, pose_j = turn ? pose_a : pose_b;

    if (evaluation->round < evaluation->rounds)
        return cairn_aligner_add_normal_equations(aligner, i, j, pose_i, pose_j,
                                                  refine_gate(evaluation->round), 1,
                                                  evaluation->centre, &evaluation->sums);
    return cairn_aligner_count_pair(aligner, i, j, cairn_transform_between(pose_j, pose_i),
                                    COUNT_GATE_M, &evaluation->count);
}

/* Returns 1 when the count cannot change the decision. */
static int is_decided(const cairn_aligner *aligner)
{
    return aligner->evaluation.round >= aligner->evaluation.rounds &&
           cairn_aligner_log_likelihood_ratio(aligner, aligner->evaluation.count) <=
               aligner->evaluation.lower_bound;
}

/* Evaluates a scan of the outer cluster with its next neighbour that it may overlap. */
int32_t cairn_aligner_evaluation_item(cairn_aligner *aligner)
{
    aligner_evaluation *evaluation = &aligner->evaluation;
    cairn_transform same = {0, 0, 1, 0}, to_outer, to_inner, pose_a;
    int32_t a = evaluation->member, passed = 0, work = 0;

    if (a < 0 || is_decided(aligner)) {
        if (evaluation->round < evaluation->rounds)
            end_refinement(evaluation);
        else
            end_evaluation(aligner);
        evaluation->member = aligner->clusters[evaluation->outer].head;
        return 4;
    }
    to_outer = evaluation->outer == evaluation->moving ? evaluation->pose : same;
    to_inner = evaluation->outer == evaluation->moving ? same : evaluation->pose;
    pose_a = cairn_transform_compose(to_outer, aligner->poses[a]);
    while (work == 0 && evaluation->neighbour < aligner->scans[a].neighbour_count) {
        int32_t b = cairn_aligner_neighbour(aligner, a, evaluation->neighbour++);
        cairn_transform pose_b;

        passed++;
        if (aligner->scans[b].cluster != evaluation->inner)
            continue;
        pose_b = cairn_transform_compose(to_inner, aligner->poses[b]);
        if (cairn_aligner_may_overlap(aligner, a, b, pose_a, pose_b))
            work = evaluate_pair(aligner, a, b, pose_a, pose_b);
    }
    if (evaluation->neighbour >= aligner->scans[a].neighbour_count) {
        evaluation->member = aligner->scans[a].next_in_cluster;
        evaluation->neighbour = 0;
    }
    return 1 + passed / ALIGNER_FAR_PAIRS_PER_UNIT + work / ALIGNER_POINTS_PER_UNIT;
}

/* ---- Relaxation ---- */

void cairn_aligner_begin_relax(cairn_aligner *aligner, int32_t cluster, cairn_real gate,
                               int32_t rounds, int32_t all)
{
    aligner_relax *relax = &aligner->relax;

    memset(relax, 0, sizeof *relax);
    relax->active = rounds > 0 && aligner->clusters[cluster].size > 1;
    relax->all = all;
    relax->cluster = cluster;
    relax->rounds = rounds;
    relax->gate = gate;
    relax->scan = aligner->clusters[cluster].head;
}

static void end_round(cairn_aligner *aligner)
{
    aligner_relax *relax = &aligner->relax;

    relax->scan = aligner->clusters[relax->cluster].head;
    relax->active = ++relax->round < relax->rounds;
    relax->all = 0;
    if (relax->active)
        return;
    aligner->clusters[relax->cluster].stamp = ++aligner->change_count;
    cairn_aligner_estimate_sigmas(aligner);
}

static int is_move(const cairn_real motion[3])
{
    return cairn_max(cairn_abs(motion[0]), cairn_abs(motion[1])) +
               ALIGNER_ARM_M * cairn_abs(motion[2]) >
           MIN_MOTION_M;
}

static void add_sums(aligner_sums *to, const aligner_sums *from)
{
    to->equations.information =
        cairn_sym3_add(to->equations.information, from->equations.information);
    for (int k = 0; k < 3; k++)
        to->equations.gradient[k] += from->equations.gradient[k];
    to->pairs += from->pairs;
}

/* Returns 1 when two scans were relaxed together in a cluster before. */
static int were_relaxed_together(const cairn_aligner *aligner, int32_t i, int32_t j)
{
    return aligner->scans[i].relax_state != ALIGNER_RELAX_MERGED ||
           aligner->scans[i].merge_event == aligner->scans[j].merge_event;
}

/* Propagates the motion of scan i to the gradient of scan j, and all of their pair's gradient when
 * they were not relaxed together before. j becomes dirty when its gradient would move it. */
static void propagate(cairn_aligner *aligner, int32_t i, int32_t j, const aligner_sums *pair,
                      const cairn_real motion[3])
{
    const aligner_scan *scan = &aligner->scans[i];
    aligner_scan *other = &aligner->scans[j];
    cairn_vec2 from = cairn_transform_point(aligner->poses[i], scan->middle);
    cairn_vec2 arm = cairn_vec2_sub(from, cairn_transform_point(aligner->poses[j], other->middle));
    const cairn_sym3 *m = &pair->equations.information;
    int met = were_relaxed_together(aligner, i, j);
    cairn_real moved[3], gradient[3];

    gradient[0] = m->xx * motion[0] + m->xy * motion[1] + m->xz * motion[2];
    gradient[1] = m->xy * motion[0] + m->yy * motion[1] + m->yz * motion[2];
    gradient[2] = m->xz * motion[0] + m->yz * motion[1] + m->zz * motion[2];
    for (int k = 0; k < 3 && !met; k++)
        gradient[k] += pair->equations.gradient[k];
    gradient[2] += arm.x * gradient[1] - arm.y * gradient[0];
    for (int k = 0; k < 3; k++)
        other->normal_equations.equations.gradient[k] -= gradient[k];
    if (other->relax_state == 0 &&
        (other->normal_equations.pairs < 3 ||
         (cairn_aligner_solve(&other->normal_equations, moved) && is_move(moved))))
        other->relax_state = ALIGNER_RELAX_DIRTY;
}

static void next_scan(cairn_aligner *aligner)
{
    aligner_relax *relax = &aligner->relax;

    memset(relax->pairs, 0, sizeof relax->pairs);
    memset(&relax->sums, 0, sizeof relax->sums);
    relax->scan = aligner->scans[relax->scan].next_in_cluster;
    relax->neighbour = relax->second_pass = 0;
    if (relax->scan < 0)
        end_round(aligner);
}

static void end_scan(cairn_aligner *aligner, const cairn_real motion[3])
{
    aligner_relax *relax = &aligner->relax;
    aligner_scan *scan = &aligner->scans[relax->scan];
    cairn_transform *pose = &aligner->poses[relax->scan];
    cairn_vec2 centre = cairn_transform_point(*pose, scan->middle);

    for (int32_t k = 0; k < scan->neighbour_count; k++)
        if (relax->pairs[k].pairs > 0)
            propagate(aligner, relax->scan, cairn_aligner_neighbour(aligner, relax->scan, k),
                      &relax->pairs[k], motion);
    *pose = cairn_aligner_moved(*pose, centre, motion);
    scan->normal_equations = relax->sums;
    memset(scan->normal_equations.equations.gradient, 0,
           sizeof scan->normal_equations.equations.gradient);
    scan->relax_state = is_move(motion) ? ALIGNER_RELAX_DIRTY : 0;
    next_scan(aligner);
}

/* All new neighbours of the current scan have been added. When their gradient would not move it,
 * its relaxation ends; otherwise its other neighbours follow. */
static void end_first_pass(cairn_aligner *aligner)
{
    static const cairn_real still[3] = {0, 0, 0};
    aligner_relax *relax = &aligner->relax;
    aligner_scan *scan = &aligner->scans[relax->scan];
    aligner_sums sums = scan->normal_equations;
    cairn_real motion[3];

    relax->neighbour = 0;
    relax->second_pass = 1;
    add_sums(&sums, &relax->sums);
    if (relax->all || scan->relax_state != ALIGNER_RELAX_MERGED ||
        scan->normal_equations.pairs == 0 ||
        (cairn_aligner_solve(&sums, motion) && is_move(motion)))
        return;
    for (int32_t k = 0; k < scan->neighbour_count; k++)
        if (relax->pairs[k].pairs > 0)
            propagate(aligner, relax->scan, cairn_aligner_neighbour(aligner, relax->scan, k),
                      &relax->pairs[k], still);
    scan->normal_equations = sums;
    scan->relax_state = 0;
    next_scan(aligner);
}

/* Skips clean scans of the cluster; returns units. */
static int32_t skip_clean(cairn_aligner *aligner)
{
    aligner_relax *relax = &aligner->relax;
    int32_t passed = 0;

    while (relax->scan >= 0 && aligner->scans[relax->scan].relax_state == 0 &&
           passed < ALIGNER_MAX_PASSED_SCANS) {
        relax->scan = aligner->scans[relax->scan].next_in_cluster;
        passed++;
    }
    if (relax->scan < 0)
        end_round(aligner);
    return 1 + passed / ALIGNER_FAR_PAIRS_PER_UNIT;
}

/* Adds the current scan's next neighbour that it may overlap: first those it was not relaxed
 * with. */
int32_t cairn_aligner_relax_item(cairn_aligner *aligner)
{
    aligner_relax *relax = &aligner->relax;
    int32_t i = relax->scan, passed = 0, work = 0;
    cairn_vec2 centre;

    if (!relax->all && aligner->scans[i].relax_state == 0)
        return skip_clean(aligner);
    if (relax->neighbour >= aligner->scans[i].neighbour_count) {
        cairn_real motion[3];

        if (!relax->second_pass) {
            end_first_pass(aligner);
        } else {
            if (!cairn_aligner_solve(&relax->sums, motion))
                memset(motion, 0, sizeof motion);
            end_scan(aligner, motion);
        }
        return 4 + aligner->scans[i].neighbour_count / 8;
    }
    centre = cairn_transform_point(aligner->poses[i], aligner->scans[i].middle);
    while (work == 0 && relax->neighbour < aligner->scans[i].neighbour_count) {
        int32_t k = relax->neighbour++, j = cairn_aligner_neighbour(aligner, i, k);
        aligner_sums *pair = &relax->pairs[k];

        passed++;
        if (aligner->scans[j].cluster != relax->cluster ||
            were_relaxed_together(aligner, i, j) != relax->second_pass ||
            !cairn_aligner_may_overlap(aligner, i, j, aligner->poses[i], aligner->poses[j]))
            continue;
        work = cairn_aligner_add_normal_equations(aligner, i, j, aligner->poses[i],
                                                  aligner->poses[j], relax->gate, 1, centre, pair);
        work += cairn_aligner_add_normal_equations(
            aligner, j, i, aligner->poses[j], aligner->poses[i], relax->gate, -1, centre, pair);
        add_sums(&relax->sums, pair);
    }
    return 1 + passed / ALIGNER_FAR_PAIRS_PER_UNIT + work / ALIGNER_POINTS_PER_UNIT;
}

/* Rotates the stored normal equations of a scan with its cluster. */
static void rotate_normal_equations(aligner_sums *sums, cairn_transform pose)
{
    cairn_sym3 *m = &sums->equations.information;
    cairn_real *g = sums->equations.gradient, c = pose.cosine, s = pose.sine, gx = g[0];

    *m = cairn_sym3_rotate(*m, s, c);
    g[0] = c * gx - s * g[1];
    g[1] = s * gx + c * g[1];
}

/* Moves the smaller cluster into the frame of the larger one; returns that. pose: fixed_moving. */
int32_t cairn_aligner_merge_clusters(cairn_aligner *aligner, int32_t moving, int32_t fixed,
                                     cairn_transform pose)
{
    int32_t event = aligner->change_count;

    if (aligner->clusters[moving].size > aligner->clusters[fixed].size) {
        int32_t swap = moving;

        moving = fixed;
        fixed = swap;
        pose = cairn_transform_inverse(pose);
    }
    while (aligner->clusters[moving].head >= 0) {
        int32_t scan = aligner->clusters[moving].head;

        aligner->poses[scan] = cairn_transform_compose(pose, aligner->poses[scan]);
        rotate_normal_equations(&aligner->scans[scan].normal_equations, pose);
        aligner->scans[scan].relax_state = ALIGNER_RELAX_MERGED;
        aligner->scans[scan].merge_event = event;
        cairn_aligner_remove(aligner, scan);
        cairn_aligner_insert(aligner, scan, fixed);
    }
    return fixed;
}
