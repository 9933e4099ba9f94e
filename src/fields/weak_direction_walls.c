/* weak_direction: walls of the submaps, and the likelihood of their thickness.
 *
 * Method:
 * 1. Segments of one submap on the same wall share a total weight of 1.
 * 2. Thickness histogram: distances of opposite, overlapping faces within one submap.
 * 3. Mode: the window of the greatest weight gives the thickness and its share. The density is a
 *    mixture of a Gaussian about this thickness, with that share, and a uniform distribution.
 * 4. At a trial translation, a face of one submap and one of the other have the log-likelihood
 *    ratio of this mixture against the uniform distribution. */
#include "src/base/build.h"

#include <string.h>

#include "src/fields/weak_direction_work.h"

/* Tests of two walls, likelihoods of trials, and visited trials for a work unit; units of the mode
 * of the histogram. */
enum {
    TESTS_PER_UNIT = 8,
    TRIALS_PER_UNIT = 4,
    TRIAL_VISITS_PER_UNIT = 16,
    UNITS_PER_MODE = WEAK_DIRECTION_THICKNESS_BINS / 4
};
/* Bins of the window of the mode. */
enum { WINDOW_BINS = 8 };

static const cairn_real MIN_PARALLEL_COSINE = CAIRN_REAL(0.99);
/* m: least length of a wall */
static const cairn_real MIN_WALL_LENGTH_M = CAIRN_REAL(0.2);
/* m: greatest distance across and along between segments of one wall */
static const cairn_real MAX_LINE_OFFSET_M = CAIRN_REAL(0.03), MAX_LINE_GAP_M = CAIRN_REAL(0.1);
/* m: least overlap of two faces */
static const cairn_real MIN_OVERLAP_M = CAIRN_REAL(0.3);
/* m: range of thicknesses */
static const cairn_real MIN_THICKNESS_M = CAIRN_REAL(0.02), MAX_THICKNESS_M = CAIRN_REAL(0.5);
/* m: least distance of faces; negative, as faces that have just crossed still count */
static const cairn_real MIN_FACE_DISTANCE_M = CAIRN_REAL(-0.03);
static const cairn_real MIN_CROSS_SINE = CAIRN_REAL(0.7);
/* weight of walls of any thickness, added to the observed ones (shrinkage) */
static const cairn_real PRIOR_WEIGHT = 2;

/* ---- Walls ---- */

static void add_wall(cairn_weak_direction *weak_direction, int32_t scan, cairn_segment segment)
{
    cairn_transform pose = cairn_transform_of(weak_direction->scans[scan].map_scan);
    cairn_vec2 a = cairn_transform_point(pose, segment.a),
               b = cairn_transform_point(pose, segment.b);
    cairn_vec2 run = cairn_vec2_sub(b, a);
    cairn_real length = cairn_vec2_norm(run);
    weak_direction_wall *wall = &weak_direction->walls[weak_direction->wall_count];

    if (!(length >= MIN_WALL_LENGTH_M))
        return;
    if (weak_direction->wall_count == weak_direction->params.max_walls) {
        weak_direction->result.dropped++;
        return;
    }
    weak_direction->wall_count++;
    wall->middle = cairn_vec2_scale(cairn_vec2_add(a, b), CAIRN_REAL(0.5));
    wall->direction = cairn_vec2_scale(run, 1 / length);
    wall->half_length = length / 2;
    wall->submap = weak_direction->submap[scan];
}

/* Number of segments of a scan that are gathered now: all or none. */
static int32_t gathered_segments(const cairn_weak_direction *weak_direction, int32_t scan)
{
    int32_t submap = weak_direction->submap[scan];

    return submap != WEAK_DIRECTION_NO_SUBMAP && (submap == WEAK_DIRECTION_FIXED_SUBMAP) ==
                                                     weak_direction->phase.items.gathers_fixed
               ? cairn_weak_direction_segments_of(weak_direction, scan)
               : 0;
}

int32_t cairn_weak_direction_gather_units(const cairn_weak_direction *weak_direction, int32_t scan)
{
    return 1 + gathered_segments(weak_direction, scan) / 2;
}

void cairn_weak_direction_gather_walls(cairn_weak_direction *weak_direction, int32_t scan)
{
    const cairn_scan_set_segment *segment =
        &weak_direction->set->segments[weak_direction->set->scans[scan].first_segment];

    for (int32_t left = gathered_segments(weak_direction, scan); left > 0; left--, segment++)
        add_wall(weak_direction, scan, segment->segment);
}

/* ---- Weights ---- */

/* Returns the overlap of two parallel walls along their direction, m; negative: a gap. */
static cairn_real overlap_of(const weak_direction_wall *a, const weak_direction_wall *b)
{
    cairn_real along =
        cairn_abs(cairn_vec2_dot(a->direction, cairn_vec2_sub(b->middle, a->middle)));

    return cairn_min(a->half_length + b->half_length - along,
                     2 * cairn_min(a->half_length, b->half_length));
}

/* 1 when two walls are parallel (sign 1) or antiparallel (sign -1) and overlap by `overlap` m at
 * least.
 *
 * normal: mean normal, on the free side of a
 * gap: m from b to a along it */
static int are_parallel(const weak_direction_wall *a, const weak_direction_wall *b, cairn_real sign,
                        cairn_real overlap, cairn_vec2 *normal, cairn_real *gap)
{
    cairn_vec2 along = cairn_vec2_scale(b->direction, sign);

    if (cairn_vec2_dot(a->direction, along) < MIN_PARALLEL_COSINE || overlap_of(a, b) < overlap)
        return 0;
    *normal = cairn_vec2_unit(cairn_vec2_left_perp(cairn_vec2_add(a->direction, along)));
    *gap = cairn_vec2_dot(*normal, cairn_vec2_sub(a->middle, b->middle));
    return 1;
}

static int is_same_wall(const weak_direction_wall *a, const weak_direction_wall *b)
{
    cairn_vec2 normal;
    cairn_real gap;

    return are_parallel(a, b, 1, -MAX_LINE_GAP_M, &normal, &gap) &&
           cairn_abs(gap) < MAX_LINE_OFFSET_M;
}

/* 1 when a wall is weighed now. */
static int is_weighed(const cairn_weak_direction *weak_direction, int32_t wall)
{
    int32_t weighed = weak_direction->phase.items.weighed;

    return weighed == WEAK_DIRECTION_NO_SUBMAP || weak_direction->walls[wall].submap == weighed;
}

int32_t cairn_weak_direction_weigh_units(const cairn_weak_direction *weak_direction, int32_t wall)
{
    return is_weighed(weak_direction, wall) ? 1 + weak_direction->wall_count / TESTS_PER_UNIT : 1;
}

void cairn_weak_direction_weigh_wall(cairn_weak_direction *weak_direction, int32_t wall)
{
    weak_direction_wall *own = &weak_direction->walls[wall];
    int32_t same = 0;

    if (!is_weighed(weak_direction, wall))
        return;
    for (int32_t k = 0; k < weak_direction->wall_count; k++)
        same += weak_direction->walls[k].submap == own->submap &&
                is_same_wall(own, &weak_direction->walls[k]);
    own->weight = 1 / (cairn_real)(same > 0 ? same : 1);
}

/* ---- Thickness ---- */

/* 1 when two walls may be opposite faces of one; *gap: distance from face b to face a, in the
 * direction where a is free. */
static int are_faces(const weak_direction_wall *a, const weak_direction_wall *b, cairn_vec2 *normal,
                     cairn_real *gap)
{
    return are_parallel(a, b, -1, MIN_OVERLAP_M, normal, gap);
}

/* Finds the mode of the thickness histogram. */
static void find_mode(cairn_weak_direction *weak_direction)
{
    cairn_real total = 0, most = 0, sum = 0;

    for (int32_t first = 0; first + WINDOW_BINS <= WEAK_DIRECTION_THICKNESS_BINS; first++) {
        cairn_real weight = 0, gaps = 0;

        for (int32_t k = first; k < first + WINDOW_BINS; k++) {
            weight += weak_direction->bins[k].weight;
            gaps += weak_direction->bins[k].sum;
        }
        if (weight > most) {
            most = weight;
            sum = gaps;
        }
    }
    for (int32_t k = 0; k < WEAK_DIRECTION_THICKNESS_BINS; k++)
        total += weak_direction->bins[k].weight;
    weak_direction->result.thickness = most > 0 ? sum / most : 0;
    weak_direction->result.thickness_share = most / (total + PRIOR_WEIGHT);
}

int32_t cairn_weak_direction_bin_units(const cairn_weak_direction *weak_direction, int32_t wall)
{
    return 1 + wall / TESTS_PER_UNIT +
           (wall + 1 == weak_direction->wall_count ? UNITS_PER_MODE : 0);
}

void cairn_weak_direction_bin_wall(cairn_weak_direction *weak_direction, int32_t wall)
{
    const weak_direction_wall *own = &weak_direction->walls[wall];
    cairn_vec2 normal;
    cairn_real gap;

    for (const weak_direction_wall *other = weak_direction->walls; other < own; other++)
        if (other->submap == own->submap && are_faces(own, other, &normal, &gap) &&
            gap > MIN_THICKNESS_M && gap < MAX_THICKNESS_M) {
            weak_direction_bin *bin = &weak_direction->bins[cairn_real_to_int(
                cairn_floor(gap / MAX_THICKNESS_M * WEAK_DIRECTION_THICKNESS_BINS))];

            bin->weight += own->weight * other->weight;
            bin->sum += own->weight * other->weight * gap;
        }
    if (wall + 1 == weak_direction->wall_count)
        find_mode(weak_direction);
}

/* ---- Trials ---- */

/* Returns the log-likelihood ratio of a wall of this thickness, nats. */
static cairn_real thickness_log_likelihood(const cairn_weak_direction *weak_direction,
                                           cairn_real gap)
{
    cairn_real alike = weak_direction->result.thickness_share,
               off = (gap - weak_direction->result.thickness) /
                     weak_direction->params.thickness_sigma,
               density = 0;

    if (cairn_abs(off) < 4)
        density = cairn_exp(-off * off / 2) * CAIRN_REAL(0.3989422804014327) * MAX_THICKNESS_M /
                  weak_direction->params.thickness_sigma;
    return cairn_log(1 - alike + alike * density);
}

/* 1 when a wall of the moving submap changes its distance from others with the translation. */
static int is_moved(const cairn_weak_direction *weak_direction, const weak_direction_wall *wall)
{
    return wall->submap == weak_direction->moving &&
           cairn_abs(cairn_vec2_cross(wall->direction,
                                      weak_direction->submaps[weak_direction->moving].along)) >=
               MIN_CROSS_SINE;
}

/* Starts the log-likelihood of the current wall at every trial. */
static void reset_fits(cairn_weak_direction *weak_direction)
{
    for (int32_t i = 0; i < weak_direction->phase.search.trial_count; i++)
        weak_direction->fits[i] = -CAIRN_REAL_MAX;
}

/* Advances to the next wall of the fixed submap that may be the opposite face of the current wall,
 * over the walls of one unit at most. 1: it is found. */
static int find_face(cairn_weak_direction *weak_direction)
{
    struct weak_direction_search *search = &weak_direction->phase.search;
    const weak_direction_wall *wall = &weak_direction->walls[search->wall];
    int32_t end = search->face + TESTS_PER_UNIT;
    cairn_vec2 normal;

    for (; search->face < end && search->face < weak_direction->wall_count; search->face++) {
        const weak_direction_wall *face = &weak_direction->walls[search->face];

        if (face->submap == weak_direction->fixed && are_faces(wall, face, &normal, &search->gap)) {
            search->slope =
                cairn_vec2_dot(normal, weak_direction->submaps[weak_direction->moving].along);
            return 1;
        }
    }
    return 0;
}

/* Raises the current wall's log-likelihood at every trial by the face, if greater. */
static void add_face(cairn_weak_direction *weak_direction)
{
    const struct weak_direction_search *search = &weak_direction->phase.search;

    for (int32_t i = 0; i < search->trial_count; i++) {
        cairn_real gap =
            search->gap + search->slope * cairn_weak_direction_trial_translation(weak_direction, i);

        if (gap > MIN_FACE_DISTANCE_M && gap < MAX_THICKNESS_M)
            weak_direction->fits[i] =
                cairn_max(weak_direction->fits[i], thickness_log_likelihood(weak_direction, gap));
    }
}

/* Adds the log-likelihood of the current wall to the trials at which it has an opposite face. */
static void add_fits(cairn_weak_direction *weak_direction)
{
    const struct weak_direction_search *search = &weak_direction->phase.search;

    for (int32_t i = 0; i < search->trial_count; i++)
        if (weak_direction->fits[i] > -CAIRN_REAL_MAX)
            weak_direction->trials[i].nats +=
                weak_direction->walls[search->wall].weight * weak_direction->fits[i];
}

int cairn_weak_direction_add_thickness(cairn_weak_direction *weak_direction, cairn_budget *budget)
{
    struct weak_direction_search *search = &weak_direction->phase.search;

    CAIRN_STEP_BEGIN(weak_direction->phase_resume);
    for (search->wall = 0; search->wall < weak_direction->wall_count; search->wall++) {
        CAIRN_STEP_CHARGE(weak_direction, phase_resume, budget,
                          1 + search->trial_count / TRIAL_VISITS_PER_UNIT);
        if (!is_moved(weak_direction, &weak_direction->walls[search->wall]))
            continue;
        reset_fits(weak_direction);
        for (search->face = 0; search->face < weak_direction->wall_count;) {
            CAIRN_STEP_CHARGE(weak_direction, phase_resume, budget, 1);
            if (!find_face(weak_direction))
                continue;
            CAIRN_STEP_CHARGE(weak_direction, phase_resume, budget,
                              1 + search->trial_count / TRIALS_PER_UNIT);
            add_face(weak_direction);
            search->face++;
        }
        add_fits(weak_direction);
    }
    CAIRN_STEP_END(weak_direction->phase_resume);
}
