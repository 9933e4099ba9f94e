/* weak_direction: walls of the submaps, and the likelihood of their thickness.
 *
 * Method:
 * 1. Segments of one submap on the same wall share a total weight of 1.
 * 2. Thickness histogram: distances of opposite, overlapping faces within one submap.
 * 3. Mode: the window of the greatest weight gives the thickness and its share. The density is a
 *    mixture of a Gaussian about this thickness, with that share, and a uniform distribution.
 * 4. At a trial translation, a face of one submap and one of the other have the log-likelihood
 *    ratio of this mixture against the uniform distribution. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/weak_direction_work.h"

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

static void add_wall(cairn_weak_direction *slide, int32_t scan, cairn_segment segment)
{
    cairn_transform pose = cairn_transform_of(slide->scans[scan].map_scan);
    cairn_vec2 a = cairn_transform_point(pose, segment.a),
               b = cairn_transform_point(pose, segment.b);
    cairn_vec2 run = cairn_vec2_sub(b, a);
    cairn_real length = cairn_vec2_norm(run);
    weak_direction_wall *wall = &slide->walls[slide->wall_count];

    if (!(length >= MIN_WALL_LENGTH_M))
        return;
    if (slide->wall_count == slide->params.max_walls) {
        slide->result.dropped++;
        return;
    }
    slide->wall_count++;
    wall->middle = cairn_vec2_scale(cairn_vec2_add(a, b), CAIRN_REAL(0.5));
    wall->direction = cairn_vec2_scale(run, 1 / length);
    wall->half_length = length / 2;
    wall->submap = slide->scans[scan].submap;
}

int32_t cairn_weak_direction_walls_item(cairn_weak_direction *slide)
{
    const cairn_scan_set_scan *scan = &slide->set->scans[slide->item];
    int32_t part = slide->scans[slide->item].submap;

    if (part == WEAK_DIRECTION_NO_SUBMAP ||
        (part == WEAK_DIRECTION_FIXED_SUBMAP) != slide->inner_item)
        return 1;
    for (int32_t k = scan->first_segment; k < scan->end_segment; k++)
        add_wall(slide, slide->item, slide->set->segments[k].segment);
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

int32_t cairn_weak_direction_weight_item(cairn_weak_direction *slide)
{
    weak_direction_wall *wall = &slide->walls[slide->item];
    int32_t same = 0;

    if (slide->phase == WEAK_DIRECTION_WEIGHT_MERGED && wall->submap != slide->fixed)
        return 1;
    for (int32_t k = 0; k < slide->wall_count; k++)
        same += slide->walls[k].submap == wall->submap && is_same_wall(wall, &slide->walls[k]);
    wall->weight = 1 / (cairn_real)(same > 0 ? same : 1);
    return 1 + slide->wall_count / TESTS_PER_UNIT;
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
static void find_mode(cairn_weak_direction *slide)
{
    cairn_real total = 0, most = 0, sum = 0;

    for (int32_t first = 0; first + WINDOW_BINS <= WEAK_DIRECTION_THICKNESS_BINS; first++) {
        cairn_real weight = 0, gaps = 0;

        for (int32_t k = first; k < first + WINDOW_BINS; k++) {
            weight += slide->thickness_weight[k];
            gaps += slide->thickness_sum[k];
        }
        if (weight > most) {
            most = weight;
            sum = gaps;
        }
    }
    for (int32_t k = 0; k < WEAK_DIRECTION_THICKNESS_BINS; k++)
        total += slide->thickness_weight[k];
    slide->result.thickness = most > 0 ? sum / most : 0;
    slide->result.thickness_share = most / (total + PRIOR_WEIGHT);
}

int32_t cairn_weak_direction_histogram_item(cairn_weak_direction *slide)
{
    const weak_direction_wall *wall = &slide->walls[slide->item];
    cairn_vec2 normal;
    cairn_real gap;

    for (int32_t k = 0; k < slide->item; k++) {
        const weak_direction_wall *other = &slide->walls[k];

        if (other->submap == wall->submap && are_faces(wall, other, &normal, &gap) &&
            gap > MIN_THICKNESS_M && gap < MAX_THICKNESS_M) {
            int32_t bin = cairn_real_to_int(
                cairn_floor(gap / MAX_THICKNESS_M * WEAK_DIRECTION_THICKNESS_BINS));

            slide->thickness_weight[bin] += wall->weight * other->weight;
            slide->thickness_sum[bin] += wall->weight * other->weight * gap;
        }
    }
    if (slide->item + 1 == slide->wall_count)
        find_mode(slide);
    return 1 + slide->item / TESTS_PER_UNIT;
}

/* ---- Trials ---- */

/* Returns the log-likelihood ratio of a wall of this thickness, nats. */
static cairn_real thickness_log_likelihood(const cairn_weak_direction *slide, cairn_real gap)
{
    cairn_real alike = slide->result.thickness_share,
               off = (gap - slide->result.thickness) / slide->params.thickness_sigma, density = 0;

    if (cairn_abs(off) < 4)
        density = cairn_exp(-off * off / 2) * CAIRN_REAL(0.3989422804014327) * MAX_THICKNESS_M /
                  slide->params.thickness_sigma;
    return cairn_log(1 - alike + alike * density);
}

/* Raises the current wall's log-likelihood at every trial by one opposite face, if greater; returns
 * units. */
static int32_t add_face(cairn_weak_direction *slide, cairn_real gap, cairn_real slope)
{
    int32_t fitted = 0;

    for (int32_t i = 0; i < slide->trial_count; i++) {
        cairn_real now = gap + slope * cairn_weak_direction_trial_translation(slide, i);

        if (now <= MIN_FACE_DISTANCE_M || now >= MAX_THICKNESS_M)
            continue;
        slide->fits[i] = cairn_max(slide->fits[i], thickness_log_likelihood(slide, now));
        fitted++;
    }
    return 1 + slide->trial_count / 32 + fitted / TRIALS_PER_UNIT;
}

int32_t cairn_weak_direction_thickness_item(cairn_weak_direction *slide)
{
    const weak_direction_wall *wall = &slide->walls[slide->item];
    cairn_vec2 along = slide->submaps[slide->moving].along, normal;
    int32_t units = 1, faces = 0;
    cairn_real gap;

    if (wall->submap != slide->moving ||
        cairn_abs(cairn_vec2_cross(wall->direction, along)) < MIN_CROSS_SINE)
        return 1;
    for (int32_t i = 0; i < slide->trial_count; i++)
        slide->fits[i] = -CAIRN_REAL_MAX;
    for (int32_t k = 0; k < slide->wall_count; k++)
        if (slide->walls[k].submap == slide->fixed &&
            are_faces(wall, &slide->walls[k], &normal, &gap)) {
            units += add_face(slide, gap, cairn_vec2_dot(normal, along));
            faces++;
        }
    for (int32_t i = 0; i < slide->trial_count && faces > 0; i++)
        if (slide->fits[i] > -CAIRN_REAL_MAX)
            slide->trials[i].nats += wall->weight * slide->fits[i];
    return units + slide->wall_count / TESTS_PER_UNIT + slide->trial_count / 16;
}
