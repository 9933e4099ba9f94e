/* The walls of the parts, and what their thickness tells of a shift.
 *
 * Of walls that one part shows from both sides the thicknesses are counted; the value that most
 * have, and the share that has it, make a density: that share normally distributed about the
 * value, the others evenly up to the greatest. A wall of which the one part shows one face and
 * the other part the other face is as likely at a shift as this density says, against an even
 * one. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/wall_slide_work.h"

enum { TESTS_OF_UNIT = 8, SHIFTS_OF_UNIT = 4, WINDOW = 8 };

static const cairn_real PARALLEL = CAIRN_REAL(0.99);                              /* cosine */
static const cairn_real LEAST_WALL = CAIRN_REAL(0.2);                             /* m */
static const cairn_real SAME_LINE = CAIRN_REAL(0.03), SAME_GAP = CAIRN_REAL(0.1); /* m */
static const cairn_real LEAST_OVERLAP = CAIRN_REAL(0.3);                          /* m */
static const cairn_real THINNEST = CAIRN_REAL(0.02), THICKEST = CAIRN_REAL(0.5);  /* m */
static const cairn_real CROSSED = CAIRN_REAL(-0.03); /* m: faces that have changed places */
static const cairn_real LEAST_ACROSS = CAIRN_REAL(0.7);
static const cairn_real DOUBT = 2; /* walls that are of any thickness, beside those that are seen */

/* ---- Walls ---- */

static void add_wall(cairn_wall_slide *x, int32_t scan, cairn_segment segment)
{
    cairn_transform pose = cairn_transform_of(x->scans[scan].map_scan);
    cairn_vec2 a = cairn_transform_point(pose, segment.a),
               b = cairn_transform_point(pose, segment.b);
    cairn_vec2 run = cairn_vec2_sub(b, a);
    cairn_real length = cairn_vec2_norm(run);
    slide_wall *wall = &x->walls[x->wall_count];

    if (!(length >= LEAST_WALL))
        return;
    if (x->wall_count == x->params.max_walls) {
        x->result.left_out++;
        return;
    }
    x->wall_count++;
    wall->middle = cairn_vec2_scale(cairn_vec2_add(a, b), CAIRN_REAL(0.5));
    wall->direction = cairn_vec2_scale(run, 1 / length);
    wall->half = length / 2;
    wall->part = x->scans[scan].part;
}

int32_t cairn_slide_walls_item(cairn_wall_slide *x)
{
    const cairn_scan_set_scan *scan = &x->set->scans[x->i];
    int32_t part = x->scans[x->i].part;

    if (part == SLIDE_NONE || (part == SLIDE_FIRM) != x->j)
        return 1;
    for (int32_t k = scan->first_segment; k < scan->end_segment; k++)
        add_wall(x, x->i, x->set->segments[k].segment);
    return 1 + (scan->end_segment - scan->first_segment) / 2;
}

/* How far two walls of like or opposite direction lie side by side, m; negative: apart. */
static cairn_real overlap_of(const slide_wall *a, const slide_wall *b)
{
    cairn_real along =
        cairn_abs(cairn_vec2_dot(a->direction, cairn_vec2_sub(b->middle, a->middle)));

    return cairn_min(a->half + b->half - along, 2 * cairn_min(a->half, b->half));
}

/* The mean normal of two walls of like direction, or with sign -1 of opposite ones: on the free
 * side of a. */
static cairn_vec2 normal_of(const slide_wall *a, const slide_wall *b, cairn_real sign)
{
    cairn_vec2 along = cairn_vec2_add(a->direction, cairn_vec2_scale(b->direction, sign));

    return cairn_vec2_unit(cairn_vec2_left(along));
}

static int is_same_wall(const slide_wall *a, const slide_wall *b)
{
    return cairn_vec2_dot(a->direction, b->direction) >= PARALLEL && overlap_of(a, b) > -SAME_GAP &&
           cairn_abs(cairn_vec2_dot(normal_of(a, b, 1), cairn_vec2_sub(a->middle, b->middle))) <
               SAME_LINE;
}

int32_t cairn_slide_share_item(cairn_wall_slide *x)
{
    slide_wall *wall = &x->walls[x->i];
    int32_t same = 0;

    if (x->phase == SLIDE_SHARE_AGAIN && wall->part != x->fixed)
        return 1;
    for (int32_t k = 0; k < x->wall_count; k++)
        same += x->walls[k].part == wall->part && is_same_wall(wall, &x->walls[k]);
    wall->share = 1 / (cairn_real)(same > 0 ? same : 1);
    return 1 + x->wall_count / TESTS_OF_UNIT;
}

/* ---- Thickness ---- */

/* 1 when two walls may be the faces of one; *gap: from the face b to the face a, where that is
 * free. */
static int are_faces(const slide_wall *a, const slide_wall *b, cairn_vec2 *normal, cairn_real *gap)
{
    if (cairn_vec2_dot(a->direction, b->direction) > -PARALLEL || overlap_of(a, b) < LEAST_OVERLAP)
        return 0;
    *normal = normal_of(a, b, -1);
    *gap = cairn_vec2_dot(*normal, cairn_vec2_sub(a->middle, b->middle));
    return 1;
}

/* The most frequent thickness, from the bins. */
static void find_thickness(cairn_wall_slide *x)
{
    cairn_real total = 0, most = 0, sum = 0;

    for (int32_t first = 0; first + WINDOW <= SLIDE_BINS; first++) {
        cairn_real weight = 0, gaps = 0;

        for (int32_t k = first; k < first + WINDOW; k++) {
            weight += x->bins[k];
            gaps += x->gaps[k];
        }
        if (weight > most) {
            most = weight;
            sum = gaps;
        }
    }
    for (int32_t k = 0; k < SLIDE_BINS; k++)
        total += x->bins[k];
    x->result.thickness = most > 0 ? sum / most : 0;
    x->result.alike = most / (total + DOUBT);
}

int32_t cairn_slide_learn_item(cairn_wall_slide *x)
{
    const slide_wall *wall = &x->walls[x->i];
    cairn_vec2 normal;
    cairn_real gap;

    for (int32_t k = 0; k < x->i; k++) {
        const slide_wall *other = &x->walls[k];

        if (other->part == wall->part && are_faces(wall, other, &normal, &gap) && gap > THINNEST &&
            gap < THICKEST) {
            int32_t bin = cairn_real_to_int(cairn_floor(gap / THICKEST * SLIDE_BINS));

            x->bins[bin] += wall->share * other->share;
            x->gaps[bin] += wall->share * other->share * gap;
        }
    }
    if (x->i + 1 == x->wall_count)
        find_thickness(x);
    return 1 + x->i / TESTS_OF_UNIT;
}

/* ---- Shifts ---- */

/* Nats for a wall of this thickness. */
static cairn_real nats_of(const cairn_wall_slide *x, cairn_real gap)
{
    cairn_real alike = x->result.alike, off = (gap - x->result.thickness) / x->params.tolerance,
               density = 0;

    if (cairn_abs(off) < 4)
        density = cairn_exp(-off * off / 2) * CAIRN_REAL(0.3989422804014327) * THICKEST /
                  x->params.tolerance;
    return cairn_log(1 - alike + alike * density);
}

/* The better of what the wall at hand fitted before and a face at every shift; returns units. */
static int32_t fit_face(cairn_wall_slide *x, cairn_real gap, cairn_real slope)
{
    int32_t fitted = 0;

    for (int32_t i = 0; i < x->shifts; i++) {
        cairn_real now = gap + slope * cairn_slide_shift(x, i);

        if (now <= CROSSED || now >= THICKEST)
            continue;
        x->fits[i] = cairn_max(x->fits[i], nats_of(x, now));
        fitted++;
    }
    return 1 + x->shifts / 32 + fitted / SHIFTS_OF_UNIT;
}

int32_t cairn_slide_thickness_item(cairn_wall_slide *x)
{
    const slide_wall *wall = &x->walls[x->i];
    cairn_vec2 along = x->parts[x->moving].along, normal;
    int32_t units = 1, faces = 0;
    cairn_real gap;

    if (wall->part != x->moving ||
        cairn_abs(cairn_vec2_cross(wall->direction, along)) < LEAST_ACROSS)
        return 1;
    for (int32_t i = 0; i < x->shifts; i++)
        x->fits[i] = -CAIRN_REAL_MAX;
    for (int32_t k = 0; k < x->wall_count; k++)
        if (x->walls[k].part == x->fixed && are_faces(wall, &x->walls[k], &normal, &gap)) {
            units += fit_face(x, gap, cairn_vec2_dot(normal, along));
            faces++;
        }
    for (int32_t i = 0; i < x->shifts && faces > 0; i++)
        if (x->fits[i] > -CAIRN_REAL_MAX)
            x->trials[i].nats += wall->share * x->fits[i];
    return units + x->wall_count / TESTS_OF_UNIT + x->shifts / 16;
}
