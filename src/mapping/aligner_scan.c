/* Scans of the aligner, and what two of them say of their relative pose.
 *
 * Every scan has a table of bearings: how far it saw, and which segment there. A point of another
 * scan is looked up by its bearing as the scan's sensor would see it, in constant time: on the same
 * surface when its distance from the segment's line is within a gate and the directions agree; in
 * free space when the scan saw well beyond it; else behind something, which is no wonder for the
 * far side of a wall, or unseen. Bearings are places on the diamond |x| + |y| = 1, which takes a
 * division and no arc tangent.
 *
 * Points of one surface are not independent: a long wall that lies on a long wall says little
 * more than a short one. So what the points of a segment say saturates. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/aligner_work.h"

/* What a look-up finds. */
typedef int32_t finding;
enum { UNSEEN = 0, SAME = 1, OTHER = 2, BEHIND = 3, THROUGH = 4 };

static const cairn_real SAME_NATS = CAIRN_REAL(0.5), OTHER_NATS = CAIRN_REAL(0.15);
/* points that may still turn what the others say */
static const cairn_real SOON = 8;
static const cairn_real FULL_POINTS = 6, MORE_POINTS = CAIRN_REAL(0.1);
/* of the directions of one surface */
static const cairn_real LEAST_COSINE = CAIRN_REAL(0.85);
/* m */
static const cairn_real BEYOND_END = CAIRN_REAL(0.1);
/* m, and ... */
static const cairn_real CLEAR = CAIRN_REAL(0.12);
/* ... share of the range that must lie behind a point */
static const cairn_real CLEAR_SHARE = CAIRN_REAL(0.02);
/* m */
static const cairn_real SURFACE = CAIRN_REAL(0.15);
/* of the width of the narrowest sector, ... */
static const cairn_real SINE_OF_SECTOR = CAIRN_REAL(0.14);
/* ... and of two */
static const cairn_real SINE_OF_TWO = CAIRN_REAL(0.27);
/* m, at which nothing is on a surface any more */
static const cairn_real BEYOND_FARTHEST = CAIRN_REAL(0.35);

/* ---- Poses as transforms ---- */

cairn_transform cairn_aligner_compose(cairn_transform a_b, cairn_transform b_c)
{
    cairn_transform a_c;

    a_c.cosine = a_b.cosine * b_c.cosine - a_b.sine * b_c.sine;
    a_c.sine = a_b.sine * b_c.cosine + a_b.cosine * b_c.sine;
    a_c.x = a_b.cosine * b_c.x - a_b.sine * b_c.y + a_b.x;
    a_c.y = a_b.sine * b_c.x + a_b.cosine * b_c.y + a_b.y;
    return a_c;
}

cairn_transform cairn_aligner_inverse(cairn_transform a_b)
{
    cairn_transform b_a;

    b_a.cosine = a_b.cosine;
    b_a.sine = -a_b.sine;
    b_a.x = -(a_b.cosine * a_b.x + a_b.sine * a_b.y);
    b_a.y = a_b.sine * a_b.x - a_b.cosine * a_b.y;
    return b_a;
}

cairn_transform cairn_aligner_between(cairn_transform a_b, cairn_transform a_c)
{
    return cairn_aligner_compose(cairn_aligner_inverse(a_b), a_c);
}

cairn_pose cairn_aligner_to_pose(cairn_transform t)
{
    cairn_pose pose = {t.x, t.y, cairn_atan2(t.sine, t.cosine)};

    return pose;
}

int32_t cairn_aligner_near(cairn_transform a, cairn_transform b, cairn_real metres,
                           cairn_real cosine)
{
    cairn_real dx = a.x - b.x, dy = a.y - b.y;

    return dx * dx + dy * dy < metres * metres && a.cosine * b.cosine + a.sine * b.sine > cosine;
}

cairn_transform cairn_aligner_moved(cairn_transform pose, cairn_vec2 centre,
                                    const cairn_real motion[3])
{
    cairn_transform turn = {0, 0, 1, 0}, moved;
    cairn_real norm;

    cairn_sincos(motion[2], &turn.sine, &turn.cosine);
    turn.x = centre.x + motion[0] - (turn.cosine * centre.x - turn.sine * centre.y);
    turn.y = centre.y + motion[1] - (turn.sine * centre.x + turn.cosine * centre.y);
    moved = cairn_aligner_compose(turn, pose);
    norm = 1 / cairn_sqrt(moved.cosine * moved.cosine + moved.sine * moved.sine);
    moved.cosine *= norm;
    moved.sine *= norm;
    return moved;
}

/* ---- Tables ---- */

static cairn_real range_of(const cairn_aligner *x, uint16_t range)
{
    return (cairn_real)range * (x->params.reach / CAIRN_REAL(65535.0));
}

int32_t cairn_aligner_points_of(const cairn_aligner *x, int32_t scan)
{
    return x->scans[scan].end_point - x->scans[scan].first_point;
}

/* ---- Pairs ---- */

static int is_in_cone(const aligner_scan *scan, cairn_transform map_scan, cairn_real cosine,
                      cairn_real sine, cairn_vec2 middle, cairn_real radius)
{
    cairn_vec2 sensor = cairn_transform_point(map_scan, scan->sensor);
    cairn_vec2 axis = cairn_transform_direction(map_scan, scan->axis),
               to = cairn_vec2_sub(middle, sensor);
    cairn_real along = cairn_vec2_dot(axis, to), across = cairn_abs(cairn_vec2_cross(axis, to));

    /* Distance from the side of the cone that is nearer to the middle. */
    return cosine <= 0 || cosine * across - sine * along < radius;
}

int cairn_aligner_may_see(const aligner_scan *scan, cairn_transform map_scan, cairn_real turned,
                          cairn_vec2 middle, cairn_real radius)
{
    cairn_real cosine, sine;

    if (scan->view_cosine <= 0 || turned >= CAIRN_PI / 2)
        return 1;
    cairn_sincos(turned, &sine, &cosine);
    return is_in_cone(scan, map_scan, scan->view_cosine * cosine - scan->view_sine * sine,
                      scan->view_sine * cosine + scan->view_cosine * sine, middle, radius);
}

static int may_see(const aligner_scan *a, cairn_transform map_a, cairn_vec2 middle,
                   cairn_real radius)
{
    return is_in_cone(a, map_a, a->view_cosine, a->view_sine, middle, radius);
}

int32_t cairn_aligner_may_meet(const cairn_aligner *x, int32_t i, int32_t j, cairn_transform map_i,
                               cairn_transform map_j)
{
    const aligner_scan *a = &x->scans[i], *b = &x->scans[j];
    cairn_vec2 p = cairn_transform_point(map_i, a->middle),
               q = cairn_transform_point(map_j, b->middle);
    cairn_real sum = a->radius + b->radius + CAIRN_REAL(0.2);

    if (cairn_vec2_norm_squared(cairn_vec2_sub(p, q)) >= sum * sum)
        return 0;
    return may_see(a, map_i, q, b->radius) || may_see(b, map_j, p, a->radius);
}

static int same_way(const cairn_aligner *x, cairn_vec2 a, cairn_vec2 b)
{
    cairn_real cosine = cairn_vec2_dot(a, b);

    return (x->params.oriented ? cosine : cairn_abs(cosine)) >= LEAST_COSINE;
}

/* The surface near bin whose line is nearest to p and within the gate; ALIGNER_NO_SEGMENT. */
static int32_t surface_at(const cairn_aligner *x, int32_t scan, int32_t bin, cairn_vec2 p,
                          cairn_vec2 direction, cairn_real gate, cairn_real *error)
{
    const aligner_table *table = &x->tables[scan];
    int32_t best = -1, before = ALIGNER_NO_SEGMENT;
    cairn_real margin = BEYOND_END + gate / 2;

    *error = gate;
    for (int32_t k = -1; k <= 1; k++) {
        int32_t id = table->segment[(bin + k) & (ALIGNER_BINS - 1)];
        const aligner_segment *s;
        cairn_vec2 from;
        cairn_real across, along;

        if (id == ALIGNER_NO_SEGMENT || id == before)
            continue;
        before = id;
        s = &x->segments[x->scans[scan].first_segment + id];
        if (!same_way(x, s->direction, direction))
            continue;
        from = cairn_vec2_sub(p, s->a);
        across = cairn_vec2_cross(s->direction, from);
        along = cairn_vec2_dot(s->direction, from);
        if (cairn_abs(across) < cairn_abs(*error) && along > -margin &&
            along < s->length + margin) {
            *error = across;
            best = x->scans[scan].first_segment + id;
        }
    }
    return best;
}

/* What scan says of a point with a direction, both in its frame. */
static finding look_up(const cairn_aligner *x, int32_t scan, cairn_vec2 p, cairn_vec2 direction,
                       cairn_real gate)
{
    const aligner_table *table = &x->tables[scan];
    cairn_vec2 ray = cairn_vec2_sub(p, x->scans[scan].sensor);
    int32_t bin = cairn_aligner_bin_of(ray.x, ray.y);
    uint16_t before = table->range[(bin - 1) & (ALIGNER_BINS - 1)];
    uint16_t here = table->range[bin], after = table->range[(bin + 1) & (ALIGNER_BINS - 1)];
    cairn_real error, range, clear, squared;

    if (here == 0)
        return UNSEEN;
    if (surface_at(x, scan, bin, p, direction, gate, &error) >= 0)
        return SAME;
    squared = cairn_vec2_norm_squared(ray);
    range = range_of(x, here);
    if (before > 0 && after > 0) {
        uint16_t least = before < after ? before : after;

        clear = range_of(x, least < here ? least : here) - CLEAR - CLEAR_SHARE * range - gate;
        if (clear > 0 && squared < clear * clear)
            return THROUGH;
    }
    if (x->params.oriented && cairn_vec2_cross(direction, ray) > 0 && squared > range * range)
        return BEHIND; /* it faces away */
    range += SURFACE;
    return squared < range * range ? OTHER : BEHIND;
}

/* 1 when what lies in a circle, in the frame of scan, may be at or before something that it
 * sees. */
static int may_show(const cairn_aligner *x, int32_t scan, cairn_vec2 middle, cairn_real radius)
{
    cairn_vec2 ray = cairn_vec2_sub(middle, x->scans[scan].sensor);
    cairn_real squared = cairn_vec2_norm_squared(ray), reach;
    const uint16_t *sectors = x->tables[scan].farthest;
    int32_t sector = cairn_aligner_bin_of(ray.x, ray.y) / (ALIGNER_BINS / ALIGNER_SECTORS);
    uint16_t farthest = sectors[sector];

    if (radius * radius > SINE_OF_SECTOR * SINE_OF_SECTOR * squared) {
        uint16_t before = sectors[(sector - 1) & (ALIGNER_SECTORS - 1)];
        uint16_t after = sectors[(sector + 1) & (ALIGNER_SECTORS - 1)];

        if (radius * radius > SINE_OF_TWO * SINE_OF_TWO * squared)
            return 1;
        farthest = farthest > before ? farthest : before;
        farthest = farthest > after ? farthest : after;
    }
    reach = range_of(x, farthest) + radius + BEYOND_FARTHEST;
    return farthest > 0 && squared < reach * reach;
}

/* The points of a scan that another one may show, a patch at a time. */
typedef struct patch_walk {
    const cairn_aligner *x;
    int32_t to, patch, at, end; /* at, end: points of the patch at hand */
    int32_t last;               /* of the scan */
    int32_t work;               /* points looked up, patches counted in part */
} patch_walk;

static patch_walk begin_patches(const cairn_aligner *x, int32_t from, int32_t to)
{
    const aligner_scan *scan = &x->scans[from];
    patch_walk w = {x, to, scan->first_patch, scan->first_point, scan->first_point, scan->end_point,
                    0};

    return w;
}

/* Goes on to the next patch in view; 0: no more. */
static int next_patch(patch_walk *w, cairn_transform to_from)
{
    while (w->end < w->last) {
        const aligner_patch *patch = &w->x->patches[w->patch++];

        w->at = w->end;
        w->end = w->at + ALIGNER_PATCH < w->last ? w->at + ALIGNER_PATCH : w->last;
        w->work += w->patch & 1;
        if (may_show(w->x, w->to, cairn_transform_point(to_from, patch->middle), patch->radius)) {
            w->work += w->end - w->at;
            return 1;
        }
    }
    return 0;
}

static int32_t shown_of(const cairn_aligner *x, int32_t from, int32_t to, cairn_transform to_from)
{
    int32_t first = x->scans[from].first_patch, shown = 0;
    int32_t end = first + (cairn_aligner_points_of(x, from) + ALIGNER_PATCH - 1) / ALIGNER_PATCH;

    for (int32_t k = first; k < end; k++)
        shown += may_show(x, to, cairn_transform_point(to_from, x->patches[k].middle),
                          x->patches[k].radius);
    return shown;
}

int32_t cairn_aligner_shown(const cairn_aligner *x, int32_t i, int32_t j, cairn_transform i_j)
{
    return shown_of(x, j, i, i_j) + shown_of(x, i, j, cairn_aligner_inverse(i_j));
}

static cairn_real saturated(int32_t points)
{
    cairn_real n = (cairn_real)points;

    return n <= FULL_POINTS ? n : FULL_POINTS + MORE_POINTS * (n - FULL_POINTS);
}

/* 1 when the evidence stays at `least` or below even when the next SOON of the `left` points are
 * all on the same surface. */
static int is_hopeless(const cairn_aligner *x, aligner_count count, int32_t left, cairn_real least)
{
    count.same += cairn_min((cairn_real)left, SOON);
    return cairn_aligner_evidence(x, count) <= least;
}

int32_t cairn_aligner_count_points(const cairn_aligner *x, int32_t from, int32_t to,
                                   cairn_transform to_from, cairn_real gate, cairn_real least,
                                   aligner_count *count)
{
    patch_walk w = begin_patches(x, from, to);
    int32_t segment = -1, same = 0;
    cairn_vec2 direction = {0, 0};

    while (!is_hopeless(x, *count, same + w.last - w.end, least) && next_patch(&w, to_from))
        for (int32_t i = w.at; i < w.end; i++) {
            const aligner_point *point = &x->points[i];

            if (point->segment != segment) {
                count->same += saturated(same);
                same = 0;
                segment = point->segment;
                direction = cairn_transform_direction(to_from, x->segments[segment].direction);
            }
            switch (
                look_up(x, to, cairn_transform_point(to_from, point->position), direction, gate)) {
            case SAME:
                same++;
                break;
            case OTHER:
                count->other += 1;
                break;
            case THROUGH:
                count->through += 1;
                break;
            default:
                break;
            }
        }
    count->same += saturated(same);
    return w.work;
}

cairn_real cairn_aligner_evidence(const cairn_aligner *x, aligner_count count)
{
    return SAME_NATS * count.same - OTHER_NATS * count.other -
           x->params.contradiction * count.through;
}

int32_t cairn_aligner_count_pair(const cairn_aligner *x, int32_t first, int32_t second,
                                 cairn_transform second_first, cairn_real gate,
                                 aligner_count *count)
{
    const cairn_real least = -CAIRN_REAL_MAX;
    int32_t work = cairn_aligner_count_points(x, first, second, second_first, gate, least, count);

    return work + cairn_aligner_count_points(x, second, first, cairn_aligner_inverse(second_first),
                                             gate, least, count);
}

/* Adds the row of a point of `from` against the surface of `to` that it lies on, if any. */
static void pull_point(const cairn_aligner *x, const aligner_point *point, int32_t to,
                       cairn_transform to_from, cairn_transform map_to, cairn_real gate,
                       cairn_real sign, cairn_vec2 centre, aligner_sums *sums)
{
    cairn_vec2 p = cairn_transform_point(to_from, point->position), normal, arm;
    cairn_vec2 ray = cairn_vec2_sub(p, x->scans[to].sensor);
    cairn_vec2 direction =
        cairn_transform_direction(to_from, x->segments[point->segment].direction);
    cairn_real error, weight, row[3];
    int32_t surface =
        surface_at(x, to, cairn_aligner_bin_of(ray.x, ray.y), p, direction, gate, &error);

    if (surface < 0)
        return;
    normal = cairn_transform_direction(map_to, cairn_vec2_left(x->segments[surface].direction));
    arm = cairn_vec2_sub(cairn_transform_point(map_to, p), centre);
    weight = 1 / (1 + 4 / (gate * gate) * error * error);
    row[0] = normal.x;
    row[1] = normal.y;
    row[2] = cairn_vec2_cross(arm, normal);
    cairn_sym3_add_outer(&sums->equations.information, row, weight);
    for (int k = 0; k < 3; k++)
        sums->equations.gradient[k] += sign * weight * error * row[k];
    sums->pairs++;
}

int32_t cairn_aligner_pull(const cairn_aligner *x, int32_t from, int32_t to,
                           cairn_transform map_from, cairn_transform map_to, cairn_real gate,
                           cairn_real sign, cairn_vec2 centre, aligner_sums *sums)
{
    cairn_transform to_from = cairn_aligner_between(map_to, map_from);
    patch_walk w = begin_patches(x, from, to);

    while (next_patch(&w, to_from))
        for (int32_t i = w.at; i < w.end; i++)
            pull_point(x, &x->points[i], to, to_from, map_to, gate, sign, centre, sums);
    return w.work;
}

int32_t cairn_aligner_solve(const aligner_sums *sums, cairn_real motion[3])
{
    cairn_sym3 m = sums->equations.information;
    cairn_real b[3];
    const cairn_real damping = CAIRN_REAL(0.5);

    if (sums->pairs < 3)
        return 0;
    m.xx += damping;
    m.yy += damping;
    m.zz += damping;
    for (int k = 0; k < 3; k++)
        b[k] = -sums->equations.gradient[k];
    return cairn_sym3_solve(m, b, motion);
}
