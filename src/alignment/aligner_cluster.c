/* aligner: clusters of scans with known relative poses, each in its own frame; evaluation and
 * relaxation.
 *
 * Method:
 * 1. Evaluation of two clusters: Gauss-Newton on all pairs of scans that may overlap refines their
 *    relative pose, then the points are counted for its log-likelihood ratio. The initial poses add
 *    a prior (aligner_prior.c): the increase of their residuals under a common motion.
 * 2. Relaxation: nonlinear Gauss-Seidel over the scans of a cluster. Only dirty scans are relaxed:
 *    those merged last, and those whose accumulated gradient would move them.
 * 3. Support of a scan: the log-likelihood ratios of its pairs in its cluster.
 * 4. Merge: the smaller cluster enters the frame of the larger one. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/aligner_work.h"

static const cairn_real COUNT_GATE_M = CAIRN_REAL(0.07);
/* m: a scan that moves less makes no other dirty */
static const cairn_real MIN_MOTION_M = CAIRN_REAL(0.006);

/* Units of the solution of normal equations, and what follows from it. */
enum { UNITS_PER_SOLUTION = 4 };

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
    cairn_aligner_expect_sigmas(aligner);
}

/* ---- Evaluation ---- */

void cairn_aligner_begin_evaluation(cairn_aligner *aligner, int32_t moving, int32_t fixed,
                                    cairn_transform pose, int32_t rounds, cairn_real least)
{
    aligner_evaluation *evaluation = &aligner->evaluation;
    int32_t first = aligner->clusters[moving].head;

    memset(evaluation, 0, sizeof *evaluation);
    evaluation->is_active = 1;
    evaluation->moving = moving;
    evaluation->fixed = fixed;
    evaluation->pose = pose;
    evaluation->rounds = rounds;
    evaluation->lower_bound = least;
    evaluation->outer =
        aligner->clusters[moving].size <= aligner->clusters[fixed].size ? moving : fixed;
    evaluation->inner = evaluation->outer == moving ? fixed : moving;
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

    evaluation->is_active = 0;
    evaluation->log_likelihood_ratio =
        cairn_aligner_log_likelihood_ratio(aligner, evaluation->count);
}

/* Starts the evaluation of the current member of the outer cluster and its current neighbour;
 * returns 0 when they cannot overlap. */
static int begin_pair(cairn_aligner *aligner)
{
    static const cairn_transform same = {0, 0, 1, 0};
    aligner_evaluation *evaluation = &aligner->evaluation;
    int32_t i = evaluation->member, j = cairn_aligner_neighbour(aligner, i, evaluation->neighbour);
    cairn_transform pose_i, pose_j;

    if (aligner->scans[j].cluster != evaluation->inner)
        return 0;
    if (evaluation->outer != evaluation->moving) {
        int32_t swap = i;

        i = j;
        j = swap;
    }
    pose_i = cairn_transform_compose(evaluation->pose, aligner->poses[i]);
    pose_j = cairn_transform_compose(same, aligner->poses[j]);
    if (!cairn_aligner_may_overlap(aligner, i, j, pose_i, pose_j))
        return 0;
    if (evaluation->round < evaluation->rounds)
        cairn_aligner_begin_equations(aligner, &aligner->walk, i, j, pose_i, pose_j,
                                      refine_gate(evaluation->round), evaluation->centre,
                                      &evaluation->sums);
    else
        cairn_aligner_begin_count(aligner, &aligner->walk, i, j,
                                  cairn_transform_between(pose_j, pose_i), COUNT_GATE_M,
                                  &evaluation->count);
    return 1;
}

/* Step: adds the points of the pair. */
static int add_pair(cairn_aligner *aligner, cairn_budget *budget)
{
    return aligner->evaluation.round < aligner->evaluation.rounds
               ? cairn_aligner_walk_points(aligner, &aligner->walk, budget)
               : cairn_aligner_walk_pair(aligner, &aligner->walk, budget);
}

/* Returns 1 when the count cannot change the decision. */
static int is_decided(const cairn_aligner *aligner)
{
    return aligner->evaluation.round >= aligner->evaluation.rounds &&
           cairn_aligner_log_likelihood_ratio(aligner, aligner->evaluation.count) <=
               aligner->evaluation.lower_bound;
}

int cairn_aligner_evaluate(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_evaluation *evaluation = &aligner->evaluation;

    CAIRN_STEP_BEGIN(aligner->resume.evaluation);
    for (;;) {
        evaluation->member = aligner->clusters[evaluation->outer].head;
        for (; evaluation->member >= 0 && !is_decided(aligner);
             evaluation->member = aligner->scans[evaluation->member].next_in_cluster) {
            ALIGNER_CHARGE(evaluation, cairn_aligner_passing_units(aligner, evaluation->member));
            for (evaluation->neighbour = 0;
                 evaluation->neighbour < aligner->scans[evaluation->member].neighbour_count &&
                 !is_decided(aligner);
                 evaluation->neighbour++)
                if (begin_pair(aligner))
                    CAIRN_STEP_RUN(aligner, resume.evaluation, budget, add_pair);
        }
        ALIGNER_CHARGE(evaluation, UNITS_PER_SOLUTION);
        if (evaluation->round == evaluation->rounds)
            break;
        end_refinement(evaluation);
    }
    CAIRN_STEP_RUN(aligner, resume.evaluation, budget, cairn_aligner_find_prior);
    end_evaluation(aligner);
    CAIRN_STEP_END(aligner->resume.evaluation);
}

/* ---- Support ---- */

/* Starts the count of the points of the current scan and its current neighbour; each pair is
 * counted once. Returns 0 when they cannot overlap. */
static int begin_support(cairn_aligner *aligner)
{
    int32_t i = aligner->cursor.scan,
            j = cairn_aligner_neighbour(aligner, i, aligner->cursor.neighbour);

    if (j > i || aligner->scans[i].cluster != aligner->scans[j].cluster ||
        !cairn_aligner_may_overlap(aligner, i, j, aligner->poses[i], aligner->poses[j]))
        return 0;
    memset(&aligner->pairs.count, 0, sizeof aligner->pairs.count);
    cairn_aligner_begin_count(aligner, &aligner->walk, i, j,
                              cairn_transform_between(aligner->poses[j], aligner->poses[i]),
                              COUNT_GATE_M, &aligner->pairs.count);
    return 1;
}

/* Adds the log-likelihood ratio of the pair to the support of both scans. */
static void end_support(cairn_aligner *aligner)
{
    int32_t i = aligner->cursor.scan,
            j = cairn_aligner_neighbour(aligner, i, aligner->cursor.neighbour);
    cairn_real evidence = cairn_aligner_log_likelihood_ratio(aligner, aligner->pairs.count);

    aligner->scans[i].support += evidence;
    aligner->scans[j].support += evidence;
}

int cairn_aligner_count_support(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_cursor *cursor = &aligner->cursor;

    CAIRN_STEP_BEGIN(aligner->resume.part);
    for (cursor->scan = 0; cursor->scan < aligner->scan_count; cursor->scan++) {
        ALIGNER_CHARGE(part, 1 + aligner->scans[cursor->scan].neighbour_count);
        for (cursor->neighbour = 0;
             cursor->neighbour < aligner->scans[cursor->scan].neighbour_count;
             cursor->neighbour++) {
            if (!begin_support(aligner))
                continue;
            CAIRN_STEP_UNTIL(aligner->resume.part,
                             cairn_aligner_walk_pair(aligner, &aligner->walk, budget));
            end_support(aligner);
        }
    }
    CAIRN_STEP_END(aligner->resume.part);
}

/* ---- Relaxation ---- */

void cairn_aligner_begin_relax(cairn_aligner *aligner, int32_t cluster, cairn_real gate,
                               int32_t rounds, int32_t all)
{
    aligner_relax *relax = &aligner->relax;

    memset(relax, 0, sizeof *relax);
    relax->is_active = rounds > 0 && aligner->clusters[cluster].size > 1;
    relax->all = all;
    relax->cluster = cluster;
    relax->rounds = rounds;
    relax->gate = gate;
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

/* Propagates the motion of the current scan to the neighbours that were added. */
static void propagate_to_all(cairn_aligner *aligner, const cairn_real motion[3])
{
    const aligner_relax *relax = &aligner->relax;

    for (int32_t k = 0; k < aligner->scans[relax->scan].neighbour_count; k++)
        if (relax->pairs[k].pairs > 0)
            propagate(aligner, relax->scan, cairn_aligner_neighbour(aligner, relax->scan, k),
                      &relax->pairs[k], motion);
}

/* All neighbours of the current scan have been added: it moves. */
static void end_scan(cairn_aligner *aligner)
{
    aligner_relax *relax = &aligner->relax;
    aligner_scan *scan = &aligner->scans[relax->scan];
    cairn_transform *pose = &aligner->poses[relax->scan];
    cairn_vec2 centre = cairn_transform_point(*pose, scan->middle);
    cairn_real motion[3];

    if (!cairn_aligner_solve(&relax->sums, motion))
        memset(motion, 0, sizeof motion);
    propagate_to_all(aligner, motion);
    *pose = cairn_aligner_moved(*pose, centre, motion);
    scan->normal_equations = relax->sums;
    memset(scan->normal_equations.equations.gradient, 0,
           sizeof scan->normal_equations.equations.gradient);
    scan->relax_state = is_move(motion) ? ALIGNER_RELAX_DIRTY : 0;
}

/* All new neighbours of the current scan have been added. When their gradient would not move it,
 * its relaxation ends, and 1 is returned; otherwise its other neighbours follow. */
static int is_still(cairn_aligner *aligner)
{
    static const cairn_real still[3] = {0, 0, 0};
    aligner_relax *relax = &aligner->relax;
    aligner_scan *scan = &aligner->scans[relax->scan];
    aligner_sums sums = scan->normal_equations;
    cairn_real motion[3];

    add_sums(&sums, &relax->sums);
    if (relax->all || scan->relax_state != ALIGNER_RELAX_MERGED ||
        scan->normal_equations.pairs == 0 ||
        (cairn_aligner_solve(&sums, motion) && is_move(motion)))
        return 0;
    propagate_to_all(aligner, still);
    scan->normal_equations = sums;
    scan->relax_state = 0;
    return 1;
}

static void begin_scan(aligner_relax *relax)
{
    memset(relax->pairs, 0, sizeof relax->pairs);
    memset(&relax->sums, 0, sizeof relax->sums);
}

/* Starts the normal equations of the current scan and its current neighbour; returns 0 when they
 * cannot overlap, or belong to the other pass. */
static int begin_neighbour(cairn_aligner *aligner)
{
    aligner_relax *relax = &aligner->relax;
    int32_t i = relax->scan, k = relax->neighbour, j = cairn_aligner_neighbour(aligner, i, k);

    if (aligner->scans[j].cluster != relax->cluster ||
        were_relaxed_together(aligner, i, j) != relax->second_pass ||
        !cairn_aligner_may_overlap(aligner, i, j, aligner->poses[i], aligner->poses[j]))
        return 0;
    cairn_aligner_begin_equations(
        aligner, &aligner->walk, i, j, aligner->poses[i], aligner->poses[j], relax->gate,
        cairn_transform_point(aligner->poses[i], aligner->scans[i].middle), &relax->pairs[k]);
    return 1;
}

/* Step: relaxes the current scan with its neighbours, first those it was not relaxed with. */
static int relax_scan(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_relax *relax = &aligner->relax;
    int32_t count = aligner->scans[relax->scan].neighbour_count;

    CAIRN_STEP_BEGIN(aligner->resume.item);
    begin_scan(relax);
    for (relax->second_pass = 0; relax->second_pass < 2; relax->second_pass++) {
        ALIGNER_CHARGE(item, UNITS_PER_SOLUTION + 2 * count / ALIGNER_FAR_PAIRS_PER_UNIT);
        for (relax->neighbour = 0; relax->neighbour < count; relax->neighbour++) {
            if (!begin_neighbour(aligner))
                continue;
            CAIRN_STEP_UNTIL(aligner->resume.item,
                             cairn_aligner_walk_pair(aligner, &aligner->walk, budget));
            add_sums(&relax->sums, &relax->pairs[relax->neighbour]);
        }
        if (relax->second_pass)
            end_scan(aligner);
        else if (is_still(aligner))
            break;
    }
    CAIRN_STEP_END(aligner->resume.item);
}

int cairn_aligner_relax(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_relax *relax = &aligner->relax;

    CAIRN_STEP_BEGIN(aligner->resume.relax);
    if (relax->is_active) {
        for (; relax->round < relax->rounds; relax->round++) {
            relax->scan = aligner->clusters[relax->cluster].head;
            for (relax->visited = 0; relax->scan >= 0;
                 relax->scan = aligner->scans[relax->scan].next_in_cluster, relax->visited++) {
                ALIGNER_CHARGE_EVERY(relax, ALIGNER_FAR_PAIRS_PER_UNIT, relax->visited);
                if (relax->all || aligner->scans[relax->scan].relax_state != 0)
                    CAIRN_STEP_RUN(aligner, resume.relax, budget, relax_scan);
            }
            relax->all = 0;
        }
        aligner->clusters[relax->cluster].stamp = ++aligner->change_count;
        CAIRN_STEP_RUN(aligner, resume.relax, budget, cairn_aligner_estimate_sigmas);
        relax->is_active = 0;
    }
    CAIRN_STEP_END(aligner->resume.relax);
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
