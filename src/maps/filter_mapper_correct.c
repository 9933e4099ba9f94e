/* Drift of a path, and correction of the paths that close a loop.
 *
 * Method.
 *
 * 1. The motions between keyframes have independent Gaussian errors. So the covariance of a pose
 *    relative to an earlier one is the difference of their drifts, both taken to the later pose.
 * 2. A match against the old map moves keyframe t by e relative to keyframe k. Given that, the mean
 *    motion of a keyframe j between them is C_j A^T S^-1 e, where C_j and S are the covariances of
 *    j and t relative to k, and A takes a small motion of j to t. This is a Rauch-Tung-Striebel
 *    smoother in closed form.
 * 3. The match counts as exact: keyframes k ... t then have the drift of k, and later corrections
 *    move them together. The walk back ends where that is so already.
 *
 * A corrected keyframe becomes the particle's own; particles that share it keep theirs.
 *
 * Limits: angles of a correction are taken as small; a loop of L m that is turned by a rad keeps an
 * error of L a^2 / 2.
 *
 * Source: Rauch, Tung and Striebel 1965; correction of sampled paths: Gilks and Berzuini 2001. */
#include "src/base/build.h"

#include "src/base/step.h"
#include "src/maps/filter_mapper_work.h"

/* units of the last keyframe of a loop, and of every other one */
enum { TIE_COST = 6, CORRECT_COST = 3 };

/* ---- Drift ---- */

cairn_sym3 cairn_filter_mapper_carry(const filter_mapper_path_state *state, cairn_pose to)
{
    cairn_vec2 to_from = {state->map_keyframe.x - to.x, state->map_keyframe.y - to.y};

    return cairn_rigid_motion_shift(to_from, state->drift);
}

cairn_sym3 cairn_filter_mapper_motion_covariance(const cairn_filter_mapper *mapper,
                                                 cairn_real theta)
{
    return cairn_sym3_rotate_by(mapper->motion_covariance, theta);
}

filter_mapper_path_state cairn_filter_mapper_predict(const cairn_filter_mapper *mapper,
                                                     const filter_mapper_path_state *last)
{
    filter_mapper_path_state next = {
        .map_keyframe = cairn_pose_compose(last->map_keyframe, mapper->motion),
        .keyframe = last->keyframe + 1,
        .revisited = -1,
    };

    next.drift =
        cairn_sym3_add(cairn_filter_mapper_carry(last, next.map_keyframe),
                       cairn_filter_mapper_motion_covariance(mapper, next.map_keyframe.theta));
    return next;
}

cairn_sym3 cairn_filter_mapper_relative_drift(const filter_mapper_path_state *earlier,
                                              const filter_mapper_path_state *later)
{
    cairn_sym3 carried = cairn_filter_mapper_carry(earlier, later->map_keyframe);

    return cairn_sym3_add(later->drift, cairn_sym3_scale(carried, -1));
}

void cairn_filter_mapper_displacement(cairn_pose from, cairn_pose to, cairn_real e[3])
{
    e[0] = to.x - from.x;
    e[1] = to.y - from.y;
    e[2] = cairn_wrap_angle(to.theta - from.theta);
}

/* ---- Correction ---- */

/* Begins with the last keyframe of the current particle; returns 0 when it closes no loop. */
static int begin_correction(cairn_filter_mapper *mapper)
{
    filter_mapper_correction *work = &mapper->correction;
    const filter_mapper_path_state *last =
        cairn_particle_filter_particle(mapper->filter, work->particle).state;

    work->revisited = last;
    work->keyframe = last->revisited;
    return work->keyframe >= 0;
}

/* Walks back to the keyframe that is revisited; returns 0 when there. */
static int walk_to_revisited(filter_mapper_correction *work)
{
    for (int k = 0; k < FILTER_MAPPER_WALKED_PER_UNIT; k++)
        if (work->revisited->keyframe != work->keyframe)
            work->revisited = cairn_particle_filter_state_before(work->revisited);
    return work->revisited->keyframe != work->keyframe;
}

/* Makes the state before the current one the particle's own. */
static void own_before(cairn_filter_mapper *mapper)
{
    filter_mapper_correction *work = &mapper->correction;

    work->state = cairn_particle_filter_own_state(mapper->filter, work->particle, work->state);
    CAIRN_ASSERT(work->state != NULL);
}

/* Ties the last keyframe to the revisited one, and sets S^-1 e. Where the drifts are so large that
 * S is lost in rounding errors no other keyframe moves. */
static void tie_last(cairn_filter_mapper *mapper)
{
    filter_mapper_correction *work = &mapper->correction;
    const filter_mapper_path_state *revisited = work->revisited;
    filter_mapper_path_state expected;
    cairn_real e[3];

    work->state = NULL;
    own_before(mapper);
    expected = cairn_filter_mapper_predict(mapper, cairn_particle_filter_state_before(work->state));
    cairn_filter_mapper_displacement(expected.map_keyframe, work->state->map_keyframe, e);
    work->force[0] = work->force[1] = work->force[2] = 0;
    (void)cairn_sym3_solve(cairn_filter_mapper_relative_drift(revisited, &expected), e,
                           work->force);
    work->expected = expected.map_keyframe;
    work->state->drift = cairn_filter_mapper_carry(revisited, work->state->map_keyframe);
}

/* Whether the keyframe before the current one moves relative to the revisited one. */
static int is_before_free(const filter_mapper_correction *work)
{
    const filter_mapper_path_state *before = cairn_particle_filter_state_before(work->state);

    return before->drift.zz > work->revisited->drift.zz;
}

/* Corrects the keyframe before the current one. */
static void correct_before(cairn_filter_mapper *mapper)
{
    filter_mapper_correction *work = &mapper->correction;
    const filter_mapper_path_state *revisited = work->revisited;
    cairn_real force[3] = {work->force[0], work->force[1], work->force[2]}, e[3];
    cairn_pose *pose;

    own_before(mapper);
    pose = &work->state->map_keyframe;
    force[2] += (work->expected.x - pose->x) * force[1] - (work->expected.y - pose->y) * force[0];
    cairn_sym3_times(cairn_filter_mapper_relative_drift(revisited, work->state), force, e);
    pose->x += e[0];
    pose->y += e[1];
    pose->theta = cairn_wrap_angle(pose->theta + e[2]);
    work->state->drift = cairn_filter_mapper_carry(revisited, *pose);
}

int cairn_filter_mapper_correct(cairn_filter_mapper *mapper, cairn_budget *budget)
{
    filter_mapper_correction *work = &mapper->correction;
    int32_t count = cairn_particle_filter_count(mapper->filter);

    CAIRN_STEP_BEGIN(work->resume);
    for (work->particle = 0; work->particle < count; work->particle++) {
        CAIRN_STEP_CHARGE_UNIT(work, resume, budget);
        if (!begin_correction(mapper))
            continue;
        do {
            CAIRN_STEP_CHARGE_UNIT(work, resume, budget);
        } while (walk_to_revisited(work));
        CAIRN_STEP_CHARGE(work, resume, budget, TIE_COST);
        tie_last(mapper);
        while (is_before_free(work)) {
            CAIRN_STEP_CHARGE(work, resume, budget, CORRECT_COST);
            correct_before(mapper);
        }
    }
    CAIRN_STEP_END(work->resume);
}
