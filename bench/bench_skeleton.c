/* Distances of detected axes and contours from the true ones. */
#include "bench/bench_skeleton.h"

#include <math.h>
#include <string.h>

#include "bench/bench_json.h"

#define TOLERANCE_PX 3 /* px */

void skeleton_add_way(skeleton_places *p, skeleton_place a, skeleton_place b)
{
    int32_t steps = 1 + (int32_t)hypot(b.x - a.x, b.y - a.y);

    for (int32_t i = 0; i < steps && p->count < SKELETON_PLACES; i++) {
        double t = (double)i / steps;
        skeleton_place at = {a.x + t * (b.x - a.x), a.y + t * (b.y - a.y), a.r + t * (b.r - a.r)};

        p->at[p->count++] = at;
    }
}

void skeleton_add_truth(skeleton_places *p, const scene *s, const sweep_shape *shape)
{
    p->count = 0;
    for (int32_t l = 0; l < shape->limbs; l++)
        for (int32_t i = 0; i + 1 < SWEEP_NODES; i++) {
            skeleton_place end[2];

            for (int k = 0; k < 2; k++) {
                const sweep_node *n = &shape->nodes[l][i + k];

                end[k].x = s->at[0] + s->size * (cos(s->turn) * n->x - sin(s->turn) * n->y);
                end[k].y = s->at[1] + s->size * (sin(s->turn) * n->x + cos(s->turn) * n->y);
                end[k].r = s->size * n->r;
            }
            skeleton_add_way(p, end[0], end[1]);
        }
}

skeleton_place skeleton_place_of(const cairn_skeleton_grouping_point *q)
{
    skeleton_place p = {(double)q->centre.x, (double)q->centre.y, (double)q->radius};

    return p;
}

void skeleton_add_found(skeleton_places *p, const cairn_skeleton_grouping_result *r, int all)
{
    p->count = 0;
    for (int32_t i = 0; i < r->part_count; i++) {
        const cairn_skeleton_grouping_part *part = &r->parts[i];
        const cairn_skeleton_grouping_point *q = &r->points[part->first];

        if (!all && part->object != 0)
            continue;
        for (int32_t k = 0; k + 1 < part->count; k++)
            skeleton_add_way(p, skeleton_place_of(&q[k]), skeleton_place_of(&q[k + 1]));
        for (int32_t end = 0; end < 2; end++)
            if (part->joint[end] >= 0)
                skeleton_add_way(p, skeleton_place_of(&q[end ? part->count - 1 : 0]),
                                 skeleton_place_of(&r->points[part->joint[end]]));
    }
}

/* The nearest of the others; -1: none within `most`. */
static int32_t nearest(const skeleton_places *others, const skeleton_place *p, double most)
{
    double best = most * most;
    int32_t at = -1;

    for (int32_t i = 0; i < others->count; i++) {
        double dx = others->at[i].x - p->x, dy = others->at[i].y - p->y;

        if (dx * dx + dy * dy <= best) {
            best = dx * dx + dy * dy;
            at = i;
        }
    }
    return at;
}

static double share_near(const skeleton_places *p, const skeleton_places *others, double most)
{
    int32_t near = 0;

    for (int32_t i = 0; i < p->count; i++)
        near += nearest(others, &p->at[i], most) >= 0;
    return p->count > 0 ? (double)near / p->count : 0;
}

static double f_of(double precision, double recall)
{
    return precision + recall > 0 ? 2 * precision * recall / (precision + recall) : 0;
}

double skeleton_axis_f(const skeleton_places *found, const skeleton_places *truth)
{
    double near = 0.01 * hypot(SCENE_WIDTH, SCENE_HEIGHT);

    return f_of(share_near(found, truth, near), share_near(truth, found, near));
}

double skeleton_radius_error(const skeleton_places *found, const skeleton_places *truth)
{
    static double off[SKELETON_PLACES];
    size_t count = 0;

    for (int32_t i = 0; i < found->count; i++) {
        int32_t at = nearest(truth, &found->at[i], 0.01 * hypot(SCENE_WIDTH, SCENE_HEIGHT));

        if (at >= 0)
            off[count++] = fabs(found->at[i].r - truth->at[at].r) / truth->at[at].r;
    }
    return bench_median(off, count);
}

double skeleton_discs_iou(const skeleton_places *found, const scene *s)
{
    static uint8_t covered[SCENE_PIXELS];
    int32_t both = 0, either = 0;

    memset(covered, 0, sizeof covered);
    for (int32_t i = 0; i < found->count; i++) {
        const skeleton_place *p = &found->at[i];

        for (int32_t y = (int32_t)fmax(0, p->y - p->r); y <= fmin(SCENE_HEIGHT - 1, p->y + p->r);
             y++)
            for (int32_t x = (int32_t)fmax(0, p->x - p->r); x <= fmin(SCENE_WIDTH - 1, p->x + p->r);
                 x++)
                if ((x - p->x) * (x - p->x) + (y - p->y) * (y - p->y) <= p->r * p->r)
                    covered[y * SCENE_WIDTH + x] = 1;
    }
    for (int32_t i = 0; i < SCENE_PIXELS; i++) {
        both += covered[i] && s->inside[i];
        either += covered[i] || s->inside[i];
    }
    return either > 0 ? (double)both / either : 0;
}

double skeleton_boundary_f(const cairn_skeleton_grouping_result *r, const scene *s, int all)
{
    static skeleton_places found, truth;

    found.count = truth.count = 0;
    for (int32_t i = 0; i < r->part_count; i++) {
        const cairn_skeleton_grouping_point *q = &r->points[r->parts[i].first];

        for (int32_t k = 0; (all || r->parts[i].object == 0) && k + 1 < r->parts[i].count; k++)
            for (int side = 0; side < 2; side++) {
                skeleton_place a = {(double)q[k].contact[side].x, (double)q[k].contact[side].y, 0};
                skeleton_place b = {(double)q[k + 1].contact[side].x,
                                    (double)q[k + 1].contact[side].y, 0};

                skeleton_add_way(&found, a, b);
            }
    }
    for (int32_t i = 0; i < SCENE_PIXELS && truth.count < SKELETON_PLACES; i++)
        if (s->truth[i] > 0) {
            int32_t y = i / SCENE_WIDTH;
            skeleton_place p = {i % SCENE_WIDTH, y, 0};

            truth.at[truth.count++] = p;
        }
    return f_of(share_near(&found, &truth, TOLERANCE_PX), share_near(&truth, &found, TOLERANCE_PX));
}
