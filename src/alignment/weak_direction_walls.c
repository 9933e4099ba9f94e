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

#include "src/alignment/weak_direction_work.h"

enum { TESTS_PER_UNIT = 8, TRIALS_PER_UNIT = 4, WINDOW_BINS = 8 };

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
    wall->submap = weak_direction->scans[scan].submap;
}

int32_t cairn_weak_direction_walls_item(cairn_weak_direction *weak_direction)
{
    const cairn_scan_set_scan *scan = &weak_direction->set->scans[weak_direction->item];
    int32_t part = weak_direction->scans[weak_direction->item].submap;

    if (part == WEAK_DIRECTION_NO_SUBMAP ||
        (part == WEAK_DIRECTION_FIXED_SUBMAP) != weak_direction->gathers_fixed)
        return 1;
    for (int32_t k = scan->first_segment; k < scan->end_segment; k++)
        add_wall(weak_direction, weak_direction->item, weak_direction->set->segments[k].segment);
    return 1 + (scan->end_segment - scan->first_segment) / 2;
}

/* Returns the overlap of two parallel walls along their direction, m; negative: a gap. */
static cairn_real overlap_of(const weak_direction_wall *a, const weak_direction_wall *b)
{
    cairn_real along =
        cairn_abs(cairn_vec2_dot(a->direction, cairn_vec2_sub(b->middle, a->middle)));

    return cairn_min(a->half_length + b->half_length - along,
                     2 * cairn_min(a->half_length, b->half_length));
}

/* Returns the mean normal of two parallel walls (sign 1) or antiparallel ones (sign -1), on the
 * free side of a. */
static cairn_vec2 normal_of(const weak_direction_wall *a, const weak_direction_wall *b,
                            cairn_real sign)
{
    cairn_vec2 along = cairn_vec2_add(a->direction, cairn_vec2_scale(b->direction, sign));

    return cairn_vec2_unit(cairn_vec2_left_perp(along));
}

static int is_same_wall(const weak_direction_wall *a, const weak_direction_wall *b)
{
    return cairn_vec2_dot(a->direction, b->direction) >= MIN_PARALLEL_COSINE &&
           overlap_of(a, b) > -MAX_LINE_GAP_M &&
           cairn_abs(cairn_vec2_dot(normal_of(a, b, 1), cairn_vec2_sub(a->middle, b->middle))) <
               MAX_LINE_OFFSET_M;
}

int32_t cairn_weak_direction_weight_item(cairn_weak_direction *weak_direction)
{
    weak_direction_wall *wall = &weak_direction->walls[weak_direction->item];
    int32_t same = 0;

    if (weak_direction->phase == WEAK_DIRECTION_WEIGHT_MERGED &&
        wall->submap != weak_direction->fixed)
        return 1;
    for (int32_t k = 0; k < weak_direction->wall_count; k++)
        same += weak_direction->walls[k].submap == wall->submap &&
                is_same_wall(wall, &weak_direction->walls[k]);
    wall->weight = 1 / (cairn_real)(same > 0 ? same : 1);
    return 1 + weak_direction->wall_count / TESTS_PER_UNIT;
}

/* ---- Thickness ---- */

/* Returns 1 when two walls may be opposite faces of one; *gap: distance from face b to face a, in
 * the direction where a is free. */
static int are_faces(const weak_direction_wall *a, const weak_direction_wall *b, cairn_vec2 *normal,
                     cairn_real *gap)
{
    if (cairn_vec2_dot(a->direction, b->direction) > -MIN_PARALLEL_COSINE ||
        overlap_of(a, b) < MIN_OVERLAP_M)
        return 0;
    *normal = normal_of(a, b, -1);
    *gap = cairn_vec2_dot(*normal, cairn_vec2_sub(a->middle, b->middle));
    return 1;
}

/* Finds the mode of the thickness histogram. */
static void find_mode(cairn_weak_direction *weak_direction)
{
    cairn_real total = 0, most = 0, sum = 0;

    for (int32_t first = 0; first + WINDOW_BINS <= WEAK_DIRECTION_THICKNESS_BINS; first++) {
        cairn_real weight = 0, gaps = 0;

        for (int32_t k = first; k < first + WINDOW_BINS; k++) {
            weight += weak_direction->thickness_weight[k];
            gaps += weak_direction->thickness_sum[k];
        }
        if (weight > most) {
            most = weight;
            sum = gaps;
        }
    }
    for (int32_t k = 0; k < WEAK_DIRECTION_THICKNESS_BINS; k++)
        total += weak_direction->thickness_weight[k];
    weak_direction->result.thickness = most > 0 ? sum / most : 0;
    weak_direction->result.thickness_share = most / (total + PRIOR_WEIGHT);
}

int32_t cairn_weak_direction_histogram_item(cairn_weak_direction *weak_direction)
{
    const weak_direction_wall *wall = &weak_direction->walls[weak_direction->item];
    cairn_vec2 normal;
    cairn_real gap;

    for (int32_t k = 0; k < weak_direction->item; k++) {
        const weak_direction_wall *other = &weak_direction->walls[k];

        if (other->submap == wall->submap && are_faces(wall, other, &normal, &gap) &&
            gap > MIN_THICKNESS_M && gap < MAX_THICKNESS_M) {
            int32_t bin = cairn_real_to_int(
                cairn_floor(gap / MAX_THICKNESS_M * WEAK_DIRECTION_THICKNESS_BINS));

            weak_direction->thickness_weight[bin] += wall->weight * other->weight;
            weak_direction->thickness_sum[bin] += wall->weight * other->weight * gap;
        }
    }
    if (weak_direction->item + 1 == weak_direction->wall_count)
        find_mode(weak_direction);
    return 1 + weak_direction->item / TESTS_PER_UNIT;
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

/* Raises the current wall's log-likelihood at every trial by one opposite face, if greater; returns
 * units. */
static int32_t add_face(cairn_weak_direction *weak_direction, cairn_real gap, cairn_real slope)
{
    int32_t fitted = 0;

    for (int32_t i = 0; i < weak_direction->trial_count; i++) {
        cairn_real now = gap + slope * cairn_weak_direction_trial_translation(weak_direction, i);

        if (now <= MIN_FACE_DISTANCE_M || now >= MAX_THICKNESS_M)
            continue;
        weak_direction->fits[i] =
            cairn_max(weak_direction->fits[i], thickness_log_likelihood(weak_direction, now));
        fitted++;
    }
    return 1 + weak_direction->trial_count / 32 + fitted / TRIALS_PER_UNIT;
}

int32_t cairn_weak_direction_thickness_item(cairn_weak_direction *weak_direction)
{
    const weak_direction_wall *wall = &weak_direction->walls[weak_direction->item];
    cairn_vec2 along = weak_direction->submaps[weak_direction->moving].along, normal;
    int32_t units = 1, faces = 0;
    cairn_real gap;

    if (wall->submap != weak_direction->moving ||
        cairn_abs(cairn_vec2_cross(wall->direction, along)) < MIN_CROSS_SINE)
        return 1;
    for (int32_t i = 0; i < weak_direction->trial_count; i++)
        weak_direction->fits[i] = -CAIRN_REAL_MAX;
    for (int32_t k = 0; k < weak_direction->wall_count; k++)
        if (weak_direction->walls[k].submap == weak_direction->fixed &&
            are_faces(wall, &weak_direction->walls[k], &normal, &gap)) {
            units += add_face(weak_direction, gap, cairn_vec2_dot(normal, along));
            faces++;
        }
    for (int32_t i = 0; i < weak_direction->trial_count && faces > 0; i++)
        if (weak_direction->fits[i] > -CAIRN_REAL_MAX)
            weak_direction->trials[i].nats += wall->weight * weak_direction->fits[i];
    return units + weak_direction->wall_count / TESTS_PER_UNIT + weak_direction->trial_count / 16;
}
