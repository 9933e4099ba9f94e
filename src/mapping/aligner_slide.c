/* Scans that slide along what they see.
 *
 * A scan of one long wall may lie anywhere along it as far as the surfaces go that others see,
 * too. What is left are its other surfaces, which no other scan has seen at that place: they
 * lie, more often than not, on the straight continuation of a wall of the map. Every shift along
 * the weak direction that brings one of them there is tried, and that to where the initial pose
 * says; evidence and initial poses are weighed as ever, and a surface that continues a wall adds
 * to it. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/aligner_work.h"

enum { MOST_PASSES = 2 };

/* m, standard deviation */
static const cairn_real WEAK = CAIRN_REAL(0.03);
/* m: makes turns comparable to shifts */
static const cairn_real ARM = CAIRN_REAL(1.5);
/* of the weak direction and a surface's normal */
static const cairn_real LEAST_ACROSS = CAIRN_REAL(0.5);
/* m */
static const cairn_real SAME_SHIFT = CAIRN_REAL(0.03), NEAR_LINE = CAIRN_REAL(0.05), GAP = 6;
static const cairn_real LINE_NATS = 3, FULL_LENGTH = CAIRN_REAL(0.3);

void cairn_aligner_begin_slides(cairn_aligner *x)
{
    x->phase = ALIGNER_SLIDE;
    x->i = 0;
    x->changed = 0;
    if (x->slides++ == MOST_PASSES)
        x->i = x->scan_count;
}

/* The unit direction in which a scan can be shifted; 0 when there is none. */
static int find_weak(const cairn_aligner *x, int32_t i, cairn_vec2 *along)
{
    cairn_sym3 own = cairn_aligner_own_information(x, i);
    cairn_real values[3], vectors[3][3];

    own.xz /= ARM;
    own.yz /= ARM;
    own.zz /= ARM * ARM;
    cairn_sym3_eigen(own, values, vectors);
    if (values[0] * WEAK * WEAK > 1 || values[1] * WEAK * WEAK <= 1)
        return 0;
    along->x = vectors[0][0];
    along->y = vectors[0][1];
    if (cairn_vec2_norm(*along) < CAIRN_REAL(0.9))
        return 0;
    *along = cairn_vec2_unit(*along);
    return 1;
}

/* A segment in the map, at a pose of its scan. */
typedef struct placed {
    const aligner_segment *segment;
    cairn_vec2 direction, mean;
} placed;

static placed place_at(const aligner_segment *s, cairn_transform pose)
{
    placed p = {s, cairn_transform_direction(pose, s->direction),
                cairn_transform_point(pose, s->mean)};

    return p;
}

/* Shift along `along` that brings a segment onto the line of a wall; 0 when there is none. */
static int shift_to(const placed *p, cairn_vec2 along, const aligner_wall *wall, cairn_real *shift)
{
    cairn_real across = cairn_vec2_dot(wall->normal, along), place, half;
    cairn_vec2 way = cairn_aligner_along(wall);

    if (cairn_abs(across) < LEAST_ACROSS ||
        (wall->scans == 1 && wall->first_scan == p->segment->scan) ||
        !cairn_aligner_same_line(wall, p->segment, p->direction))
        return 0;
    *shift = (wall->offset - cairn_vec2_dot(wall->normal, p->mean)) / across;
    place = cairn_vec2_dot(way, p->mean) + *shift * cairn_vec2_dot(way, along);
    half = p->segment->length / 2 + GAP;
    return place > wall->low - half && place < wall->high + half;
}

static void keep_shift(cairn_aligner *x, cairn_real shift)
{
    cairn_pose *pose;

    for (int32_t k = 0; k < x->find_count; k++)
        if (cairn_abs(x->find[k].score - shift) < SAME_SHIFT)
            return;
    if (x->find_count == ALIGNER_SLIDES)
        return;
    pose = &x->find[x->find_count].pose;
    *pose = cairn_aligner_to_pose(x->before);
    pose->x += shift * x->along.x;
    pose->y += shift * x->along.y;
    x->find[x->find_count++].score = shift;
}

/* Staying, where the initial pose says, and where walls meet. */
static void find_shifts(cairn_aligner *x)
{
    const aligner_scan *scan = &x->scans[x->i];
    cairn_transform gauge = cairn_aligner_inverse(cairn_aligner_gauge(x, x->home));
    cairn_transform expected = cairn_aligner_compose(gauge, cairn_transform_of(scan->initial));
    cairn_vec2 off = {expected.x - x->before.x, expected.y - x->before.y};
    cairn_real shift;

    x->find_count = x->find_at = 0;
    keep_shift(x, 0);
    keep_shift(x, cairn_vec2_dot(x->along, off));
    for (int32_t k = scan->first_segment; k < scan->end_segment; k++) {
        placed p = place_at(&x->segments[k], x->before);

        for (int32_t w = 0; w < x->wall_count && p.segment->weight > 0; w++)
            if (shift_to(&p, x->along, &x->walls[w], &shift) &&
                cairn_abs(shift) <= x->params.spread)
                keep_shift(x, shift);
    }
}

/* What the surfaces of the scan at hand that lie on walls add, nats. */
static cairn_real line_nats(const cairn_aligner *x, cairn_transform pose)
{
    const aligner_scan *scan = &x->scans[x->i];
    cairn_real sum = 0, shift;

    for (int32_t k = scan->first_segment; k < scan->end_segment; k++) {
        const aligner_segment *s = &x->segments[k];
        placed p = place_at(s, pose);
        cairn_real least = NEAR_LINE;

        if (!(s->weight > 0))
            continue;
        for (int32_t w = 0; w < x->wall_count; w++)
            if (shift_to(&p, x->along, &x->walls[w], &shift))
                least = cairn_min(least, cairn_abs(shift));
        least /= NEAR_LINE;
        sum += LINE_NATS * (s->stub ? CAIRN_REAL(0.5) : cairn_min(s->length / FULL_LENGTH, 1)) *
               (1 - least * least);
    }
    return sum;
}

static int32_t choose(cairn_aligner *x)
{
    int32_t home = x->home, units;

    if (x->i == x->scan_count) {
        cairn_aligner_end_slides(x, x->changed);
        return 1;
    }
    units = 1 + x->scans[x->i].end_segment - x->scans[x->i].first_segment;
    if (x->scans[x->i].part != home || x->clusters[home].size < 3 ||
        !find_weak(x, x->i, &x->along)) {
        x->i++;
        return units;
    }
    x->changed += !x->scans[x->i].weak;
    x->scans[x->i].weak = 1;
    x->before = x->poses[x->i];
    find_shifts(x);
    if (x->find_count == 1) {
        x->i++;
    } else {
        cairn_transform same = {0, 0, 1, 0};

        cairn_aligner_put_back(x, x->scan_count, same);
        x->best_score = -CAIRN_REAL_MAX;
        x->phase = ALIGNER_SLIDE_TRY;
    }
    return units + units * x->wall_count / 16;
}

static int32_t try_shift(cairn_aligner *x)
{
    if (x->find_at > 0) {
        aligner_count count = {.other = x->look.count.other, .through = x->look.count.through};
        cairn_real score =
            cairn_aligner_evidence(x, count) + x->look.prior + line_nats(x, x->look.pose);

        if (score > x->best_score) {
            x->best_score = score;
            x->best = x->look.pose;
        }
    }
    if (x->find_at < x->find_count) {
        cairn_aligner_begin_look(x, x->scan_count, x->home,
                                 cairn_transform_of(x->find[x->find_at++].pose), 0,
                                 -CAIRN_REAL_MAX);
        return 1 + x->wall_count / 16;
    }
    x->changed += !cairn_aligner_near(x->best, x->before, CAIRN_REAL(0.005), 0);
    cairn_aligner_put_back(x, x->home, x->best);
    x->i++;
    x->phase = ALIGNER_SLIDE;
    return 1;
}

int32_t cairn_aligner_slide_item(cairn_aligner *x)
{
    return x->phase == ALIGNER_SLIDE ? choose(x) : try_shift(x);
}
