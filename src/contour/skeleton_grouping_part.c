/* Parts: walks rival for edgels, the winners are smoothed, and those whose axes lead into each
 * other are joined to objects.
 *
 * In each round every walk is valued anew by the stretch of most log odds that is left of it
 * when places where the contour belongs to a part already are losses; the best one becomes a
 * part and takes its edgels, until none is worth min_log_odds. */
#include "src/core/build.h"

#include <string.h>

#include "src/contour/skeleton_grouping_work.h"

/* A disc whose contour is another part's on one side, and on both. */
#define ONE_TAKEN  CAIRN_REAL(-1.0)
#define BOTH_TAKEN CAIRN_REAL(-3.0)
/* Edgels so near a part's contour, px, and so much along it, are its own. */
#define OWN        CAIRN_REAL(2.5)
#define OWN_COSINE CAIRN_REAL(0.7)
/* An end leads to an axis that is no farther than so many of its own radii beyond the other's
 * disc, and so much ahead. */
#define LEAD        CAIRN_REAL(1.2)
#define LEAD_COSINE CAIRN_REAL(0.5)
/* px: edgels so near a way lie across it, if there are so many. */
#define ACROSS CAIRN_REAL(1.5)
enum { LEAST_DISCS = 3, CROSSING = 2 };

static cairn_real worth(const cairn_skeleton *g, const skeleton_disc *d)
{
    int32_t taken = 0;

    for (int32_t side = 0; side < 2; side++)
        taken += d->edgel[side] >= 0 && g->edgels[d->edgel[side]].taken;
    return taken == 0 ? d->gain : taken == 1 ? cairn_min(d->gain, ONE_TAKEN) : BOTH_TAKEN;
}

static int is_written(const cairn_skeleton *g)
{
    return g->params.mode == CAIRN_MODE_AS_WRITTEN;
}

/* As written: the whole walk, whatever others there are. */
static void value_whole(const cairn_skeleton *g, skeleton_part *p)
{
    p->from = p->first;
    p->end = p->first + p->count;
    p->log_odds = 0;
    for (int32_t i = p->from; i < p->end; i++)
        p->log_odds += g->discs[i].gain;
}

/* The stretch of discs of the largest sum. */
static void value(const cairn_skeleton *g, skeleton_part *p)
{
    cairn_real sum = 0;
    int32_t from = p->first;

    if (is_written(g)) {
        value_whole(g, p);
        return;
    }
    p->log_odds = 0;
    p->from = p->end = p->first;
    for (int32_t i = p->first; i < p->first + p->count; i++) {
        if (sum <= 0) {
            sum = 0;
            from = i;
        }
        sum += worth(g, &g->discs[i]);
        if (sum > p->log_odds) {
            p->log_odds = sum;
            p->from = from;
            p->end = i + 1;
        }
    }
}

/* The next item pays for the edgels of these cells. */
static void owe(cairn_skeleton *g, int32_t x0, int32_t x1, int32_t y0, int32_t y1)
{
    g->paid -= skeleton_cost(g, x0, x1, y0, y1);
}

/* Edgels along a piece of the contour belong to the part. */
static void take_along(cairn_skeleton *g, cairn_segment line)
{
    cairn_vec2 unit = cairn_vec2_unit(cairn_vec2_sub(line.b, line.a));
    cairn_box box = {line.a, line.a};
    int32_t x0, x1, y1;

    box = cairn_box_grow(cairn_box_extend(box, line.b), OWN);
    x0 = cairn_skeleton_column(g, box.min.x);
    x1 = cairn_skeleton_column(g, box.max.x);
    y1 = cairn_skeleton_line(g, box.max.y);
    owe(g, x0, x1, cairn_skeleton_line(g, box.min.y), y1);
    for (int32_t y = cairn_skeleton_line(g, box.min.y); y <= y1; y++) {
        int32_t from, end;

        skeleton_row(g, y, x0, x1, &from, &end);
        for (int32_t i = from; i < end; i++)
            if (cairn_abs(cairn_vec2_cross(g->edgels[i].normal, unit)) >= OWN_COSINE &&
                cairn_segment_distance(line, g->edgels[i].at) <= OWN)
                g->edgels[i].taken = 1;
    }
}

static void take(cairn_skeleton *g, const skeleton_part *p)
{
    for (int32_t i = p->from; i < p->end; i++)
        for (int32_t side = 0; side < 2; side++) {
            const skeleton_disc *d = &g->discs[i], *next = i + 1 < p->end ? d + 1 : d;
            cairn_segment line = {d->touch[side], next->touch[side]};

            if (d->edgel[side] >= 0)
                g->edgels[d->edgel[side]].taken = 1;
            if (d->edgel[side] >= 0 && next->edgel[side] >= 0)
                take_along(g, line);
        }
}

/* The disc's place in its part, smoothed along the axis; as written as it is. */
static cairn_skeleton_point shown(const cairn_skeleton *g, const skeleton_part *p, int32_t i)
{
    const skeleton_disc *d = &g->discs[i], *a = i > p->from ? d - 1 : d,
                        *b = i + 1 < p->end ? d + 1 : d;
    cairn_skeleton_point q;

    if (a == d || b == d || is_written(g))
        a = b = d;
    q.centre =
        cairn_vec2_add(cairn_vec2_scale(d->centre, CAIRN_REAL(0.5)),
                       cairn_vec2_scale(cairn_vec2_add(a->centre, b->centre), CAIRN_REAL(0.25)));
    q.radius = CAIRN_REAL(0.5) * d->radius + CAIRN_REAL(0.25) * (a->radius + b->radius);
    for (int32_t side = 0; side < 2; side++) {
        q.touch[side] = d->touch[side];
        q.edgel[side] = d->edgel[side] >= 0 ? g->edgels[d->edgel[side]].source : -1;
    }
    return q;
}

static void show(cairn_skeleton *g, const skeleton_part *p)
{
    cairn_skeleton_part *part = &g->parts[g->part_count];

    part->first = g->point_count;
    part->count = p->end - p->from;
    part->object = g->part_count;
    part->joint[0] = part->joint[1] = -1;
    part->log_odds = p->log_odds;
    g->group[g->part_count] = g->part_count;
    g->bright[g->part_count] = 0;
    for (int32_t i = p->from; i < p->end; i++) {
        g->points[g->point_count++] = shown(g, p, i);
        for (int32_t side = 0; side < 2; side++)
            if (g->discs[i].edgel[side] >= 0)
                g->bright[g->part_count] += g->discs[i].sense[side] == SKELETON_BRIGHTER ? 1 : -1;
    }
    g->part_count++;
}

/* The walk of most log odds that is not chosen; -1: there is none. */
static int32_t best_of(const cairn_skeleton *g)
{
    int32_t best = -1;

    for (int32_t i = 0; i < g->candidate_count; i++)
        if (g->candidates[i].state == 0 &&
            (best < 0 || g->candidates[i].log_odds > g->candidates[best].log_odds))
            best = i;
    return best;
}

/* Round by round: the cursor counts candidates, and is beyond them while the best one's part is
 * paid for. */
cairn_status cairn_skeleton_choose(cairn_skeleton *g, cairn_budget *budget)
{
    for (;;) {
        for (; g->cursor < g->candidate_count; g->cursor++) {
            skeleton_part *p = &g->candidates[g->cursor];

            if (p->state != 0)
                continue;
            if (!cairn_budget_pay(budget, &g->paid, 1 + p->count / 8))
                return CAIRN_MORE;
            value(g, p);
            if (p->log_odds < g->params.min_log_odds ||
                (!is_written(g) && p->end - p->from < LEAST_DISCS))
                p->state = -1;
        }
        if (g->cursor == g->candidate_count) {
            if (!cairn_budget_pay(budget, &g->paid, 1 + g->candidate_count / 32))
                return CAIRN_MORE;
            g->other = best_of(g);
            if (g->other < 0)
                return CAIRN_OK;
            g->cursor++;
        }
        if (!cairn_budget_pay(budget, &g->paid,
                              1 + 8 * (g->candidates[g->other].end - g->candidates[g->other].from)))
            return CAIRN_MORE;
        if (!is_written(g))
            take(g, &g->candidates[g->other]);
        show(g, &g->candidates[g->other]);
        g->candidates[g->other].state = 1;
        g->cursor = 0;
    }
}

/* ---- Objects ---- */

static int32_t root(const cairn_skeleton *g, int32_t part)
{
    while (g->group[part] != part) {
        g->group[part] = g->group[g->group[part]];
        part = g->group[part];
    }
    return part;
}

/* By halves: parts' points lie one part behind the other. */
static int32_t part_of(const cairn_skeleton *g, int32_t point)
{
    int32_t low = 0, high = g->part_count - 1;

    while (low < high) {
        int32_t middle = (low + high) / 2;

        if (point >= g->parts[middle].first + g->parts[middle].count)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* 1: one lies within contours that are brighter inside, the other within such that are darker. */
static int are_opposite(const cairn_skeleton *g, int32_t a, int32_t b)
{
    return g->bright[a] * g->bright[b] < 0;
}

/* 1: an edge runs across a way from one axis to another. */
static int is_crossed(cairn_skeleton *g, cairn_vec2 from, cairn_vec2 to)
{
    cairn_segment way = {from, to};
    cairn_vec2 unit = cairn_vec2_unit(cairn_vec2_sub(to, from));
    cairn_box box =
        cairn_box_grow(cairn_box_extend(cairn_box_extend(cairn_box_empty(), from), to), ACROSS);
    int32_t x0 = cairn_skeleton_column(g, box.min.x), x1 = cairn_skeleton_column(g, box.max.x);
    int32_t y1 = cairn_skeleton_line(g, box.max.y), count = 0;

    owe(g, x0, x1, cairn_skeleton_line(g, box.min.y), y1);
    for (int32_t y = cairn_skeleton_line(g, box.min.y); y <= y1; y++) {
        int32_t begin, end;

        skeleton_row(g, y, x0, x1, &begin, &end);
        for (int32_t i = begin; i < end; i++) {
            const skeleton_edgel *e = &g->edgels[i];

            count += cairn_abs(cairn_vec2_dot(e->normal, unit)) >= OWN_COSINE &&
                     cairn_segment_distance(way, e->at) <= ACROSS;
        }
    }
    return count >= CROSSING;
}

/* The point of another part that an end of this one leads into; -1: it is free. */
static int32_t joint_of(cairn_skeleton *g, const cairn_skeleton_part *p, int32_t end)
{
    const cairn_skeleton_point *last = &g->points[end ? p->first + p->count - 1 : p->first];
    const cairn_skeleton_point *before =
        end ? last - (p->count > 3 ? 3 : p->count - 1) : last + (p->count > 3 ? 3 : p->count - 1);
    cairn_vec2 heading = cairn_vec2_unit(cairn_vec2_sub(last->centre, before->centre));
    cairn_real nearest = CAIRN_REAL_MAX;
    int32_t joint = -1;

    for (int32_t k = 0; k < g->part_count; k++) {
        const cairn_skeleton_part *other = &g->parts[k];

        if (other == p || are_opposite(g, g->cursor, k))
            continue;
        for (int32_t i = other->first; i < other->first + other->count; i++) {
            cairn_vec2 way = cairn_vec2_sub(g->points[i].centre, last->centre);
            cairn_real distance = cairn_vec2_norm(way);

            if (distance < nearest && distance <= g->points[i].radius + LEAD * last->radius &&
                cairn_vec2_dot(way, heading) >= LEAD_COSINE * distance &&
                !is_crossed(g, last->centre, g->points[i].centre)) {
                nearest = distance;
                joint = i;
            }
        }
    }
    return joint;
}

static void gather(cairn_skeleton *g)
{
    for (int32_t i = 0; i < g->part_count; i++) {
        int32_t home = root(g, i);
        cairn_skeleton_object *o;

        if (home == i) {
            o = &g->objects[g->object_count];
            memset(o, 0, sizeof *o);
            g->parts[i].object = g->object_count++;
        }
        g->parts[i].object = g->parts[home].object;
        o = &g->objects[g->parts[i].object];
        o->parts++;
        o->log_odds += g->parts[i].log_odds;
        o->free_ends += (g->parts[i].joint[0] < 0) + (g->parts[i].joint[1] < 0);
    }
}

/* 1: the object a stands behind b: of equal ones the later. */
static int is_behind(const cairn_skeleton *g, int32_t a, int32_t b)
{
    cairn_real x = g->objects[a].log_odds, y = g->objects[b].log_odds;

    return x < y || (x <= y && a > b);
}

/* Restores the heap of group[0 ... count - 1], whose root stands behind all others, below a
 * place. */
static void sift(cairn_skeleton *g, int32_t place, int32_t count)
{
    for (;;) {
        int32_t child = 2 * place + 1, moved = g->group[place];

        if (child >= count)
            return;
        if (child + 1 < count && is_behind(g, g->group[child + 1], g->group[child]))
            child++;
        if (!is_behind(g, g->group[child], moved))
            return;
        g->group[place] = g->group[child];
        g->group[child] = moved;
        place = child;
    }
}

/* The likeliest objects first: group[] becomes their order, bright[] the place of each in it. */
static void rank(cairn_skeleton *g)
{
    for (int32_t i = 0; i < g->object_count; i++)
        g->group[i] = i;
    for (int32_t i = g->object_count / 2 - 1; i >= 0; i--)
        sift(g, i, g->object_count);
    for (int32_t count = g->object_count - 1; count > 0; count--) {
        int32_t last = g->group[0];

        g->group[0] = g->group[count];
        g->group[count] = last;
        sift(g, 0, count);
    }
    for (int32_t i = 0; i < g->object_count; i++)
        g->bright[g->group[i]] = i;
    for (int32_t p = 0; p < g->part_count; p++)
        g->parts[p].object = g->bright[g->parts[p].object];
    for (int32_t i = 0; i < g->object_count; i++)
        while (g->bright[i] != i) {
            int32_t place = g->bright[i];
            cairn_skeleton_object moved = g->objects[place];

            g->objects[place] = g->objects[i];
            g->objects[i] = moved;
            g->bright[i] = g->bright[place];
            g->bright[place] = place;
        }
}

/* Puts two parts into one group: its first part stands for it. */
static void unite(cairn_skeleton *g, int32_t first, int32_t second)
{
    int32_t a = root(g, first), b = root(g, second);

    g->group[a < b ? b : a] = a < b ? a : b;
}

cairn_status cairn_skeleton_join(cairn_skeleton *g, cairn_budget *budget)
{
    for (; g->cursor < g->part_count; g->cursor++) {
        cairn_skeleton_part *p = &g->parts[g->cursor];

        if (!cairn_budget_pay(budget, &g->paid, 2 + g->point_count / 4))
            return CAIRN_MORE;
        for (int32_t end = 0; end < 2 && !is_written(g); end++) {
            p->joint[end] = joint_of(g, p, end);
            if (p->joint[end] >= 0)
                unite(g, g->cursor, part_of(g, p->joint[end]));
        }
    }
    if (!cairn_budget_pay(budget, &g->paid, 1 + 2 * g->part_count))
        return CAIRN_MORE;
    gather(g);
    rank(g);
    return CAIRN_OK;
}
