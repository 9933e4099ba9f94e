/* Selection of parts (greedy, by log odds) and joining of parts to objects.
 *
 * Method:
 * 1. In each round every trajectory is scored by its stretch of greatest log odds (maximum-sum
 *    subarray). Discs whose contour is already assigned to a part count as losses.
 * 2. The best trajectory becomes a part and its edgels are assigned to it. The rounds end when none
 *    reaches min_log_odds.
 * 3. Parts are smoothed along their axes.
 * 4. Parts whose axes continue into each other are united to objects (union-find), sorted by log
 *    odds (heap sort). */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/disjoint_sets.h"
#include "src/containers/heap.h"
#include "src/outlines/skeleton_grouping_work.h"

/* Gain of a disc whose contour is assigned to another part on one side, and on both, nats. */
#define ONE_SIDE_ASSIGNED_GAIN   CAIRN_REAL(-1.0)
#define BOTH_SIDES_ASSIGNED_GAIN CAIRN_REAL(-3.0)
/* Edgels within this distance of a part's contour and this cosine of its direction are assigned
 * to the part. */
#define ASSIGN_DISTANCE_PX CAIRN_REAL(2.5)
#define ASSIGN_MIN_COSINE  CAIRN_REAL(0.7)
/* An end is joined to an axis within the other disc's radius plus this multiple of its own
 * radius, and within this cosine of its heading. */
#define JOINT_DISTANCE_RADII CAIRN_REAL(1.2)
#define JOINT_MIN_COSINE     CAIRN_REAL(0.5)
/* Edgels within this distance of a connection cross it; the least number of edgels that block
 * it. */
#define CROSSING_DISTANCE_PX CAIRN_REAL(1.5)
enum { MIN_DISCS = 3, MIN_CROSSING_EDGELS = 2 };
/* Discs that are scored, candidates and points of all parts that are compared, per work unit; work
 * units of a disc of a part. */
enum { DISCS_PER_UNIT = 8, CANDIDATES_PER_UNIT = 32, POINTS_PER_UNIT = 4, UNITS_PER_KEPT_DISC = 8 };

/* Returns the gain of a disc after assignments to other parts, nats. */
static cairn_real remaining_gain(const cairn_skeleton_grouping *skeleton,
                                 const skeleton_grouping_disc *d)
{
    int32_t assigned = 0;

    for (int32_t side = 0; side < 2; side++)
        assigned += d->edgel[side] >= 0 && skeleton->edgels[d->edgel[side]].assigned;
    return assigned == 0   ? d->gain
           : assigned == 1 ? cairn_min(d->gain, ONE_SIDE_ASSIGNED_GAIN)
                           : BOTH_SIDES_ASSIGNED_GAIN;
}

static int is_written(const cairn_skeleton_grouping *skeleton)
{
    return skeleton->params.mode == CAIRN_MODE_AS_WRITTEN;
}

/* As written: scores the whole trajectory, without competition. */
static void score_whole(const cairn_skeleton_grouping *skeleton, skeleton_grouping_part *part)
{
    part->kept_first = part->first;
    part->kept_end = part->first + part->count;
    part->log_odds = 0;
    for (int32_t i = part->kept_first; i < part->kept_end; i++)
        part->log_odds += skeleton->discs[i].gain;
}

/* Finds the stretch of discs of maximum sum (Kadane's algorithm). */
static void score_best_stretch(const cairn_skeleton_grouping *skeleton,
                               skeleton_grouping_part *part)
{
    cairn_real sum = 0;
    int32_t from = part->first;

    if (is_written(skeleton)) {
        score_whole(skeleton, part);
        return;
    }
    part->log_odds = 0;
    part->kept_first = part->kept_end = part->first;
    for (int32_t i = part->first; i < part->first + part->count; i++) {
        if (sum <= 0) {
            sum = 0;
            from = i;
        }
        sum += remaining_gain(skeleton, &skeleton->discs[i]);
        if (sum > part->log_odds) {
            part->log_odds = sum;
            part->kept_first = from;
            part->kept_end = i + 1;
        }
    }
}

/* Returns the cells of the edgels within a distance, in px, of a line. */
static cell_range cells_near(const cairn_skeleton_grouping *skeleton, cairn_segment line,
                             cairn_real distance)
{
    cairn_box box = cairn_box_extend((cairn_box){line.a, line.a}, line.b);

    return cairn_skeleton_grouping_cells(skeleton, cairn_box_grow(box, distance));
}

/* Sets the contour segment from the current disc to the next one of its part, on the current side;
 * that of the last disc is a point. Returns 0 when an edgel of it is undetected. */
static int contour_of(const cairn_skeleton_grouping *skeleton, cairn_segment *line)
{
    const skeleton_grouping_disc *d = &skeleton->discs[skeleton->disc], *next = d;

    if (skeleton->disc + 1 < skeleton->candidates[skeleton->best].kept_end)
        next = d + 1;
    line->a = d->contact[skeleton->side];
    line->b = next->contact[skeleton->side];
    return d->edgel[skeleton->side] >= 0 && next->edgel[skeleton->side] >= 0;
}

/* Cost in units of assigning the edgels along the current contour segment. */
static int32_t assignment_cost(const cairn_skeleton_grouping *skeleton)
{
    cairn_segment line;

    return contour_of(skeleton, &line)
               ? skeleton_grouping_cells_cost(skeleton,
                                              cells_near(skeleton, line, ASSIGN_DISTANCE_PX))
               : 0;
}

/* Assigns the edgels along a contour segment to the part. */
static void assign_along(cairn_skeleton_grouping *skeleton, cairn_segment line)
{
    cairn_vec2 unit = cairn_vec2_unit(cairn_vec2_sub(line.b, line.a));
    cell_range cells = cells_near(skeleton, line, ASSIGN_DISTANCE_PX);

    for (int32_t y = cells.y0; y <= cells.y1; y++) {
        int32_t from, end;

        skeleton_grouping_cells_of_row(skeleton, cells, y, &from, &end);
        for (int32_t i = from; i < end; i++)
            if (cairn_abs(cairn_vec2_cross(skeleton->edgels[i].normal, unit)) >=
                    ASSIGN_MIN_COSINE &&
                cairn_segment_distance(line, skeleton->edgels[i].position) <= ASSIGN_DISTANCE_PX)
                skeleton->edgels[i].assigned = 1;
    }
}

/* Assigns the edgel of the current disc on the current side, and those along the contour to the next
 * disc, to the part. */
static void assign_edgels(cairn_skeleton_grouping *skeleton)
{
    int32_t edgel = skeleton->discs[skeleton->disc].edgel[skeleton->side];
    cairn_segment line;

    if (edgel >= 0)
        skeleton->edgels[edgel].assigned = 1;
    if (contour_of(skeleton, &line))
        assign_along(skeleton, line);
}

/* Returns the disc, smoothed along the axis; as written unsmoothed. */
static cairn_skeleton_grouping_point smoothed_point(const cairn_skeleton_grouping *skeleton,
                                                    const skeleton_grouping_part *part, int32_t i)
{
    const skeleton_grouping_disc *d = &skeleton->discs[i], *a = i > part->kept_first ? d - 1 : d,
                                 *b = i + 1 < part->kept_end ? d + 1 : d;
    cairn_skeleton_grouping_point q;

    if (a == d || b == d || is_written(skeleton))
        a = b = d;
    q.centre =
        cairn_vec2_add(cairn_vec2_scale(d->centre, CAIRN_REAL(0.5)),
                       cairn_vec2_scale(cairn_vec2_add(a->centre, b->centre), CAIRN_REAL(0.25)));
    q.radius = CAIRN_REAL(0.5) * d->radius + CAIRN_REAL(0.25) * (a->radius + b->radius);
    for (int32_t side = 0; side < 2; side++) {
        q.contact[side] = d->contact[side];
        q.edgel[side] = d->edgel[side] >= 0 ? skeleton->edgels[d->edgel[side]].input_index : -1;
    }
    return q;
}

/* Appends a selected trajectory to the reported parts. */
static void report_part(cairn_skeleton_grouping *skeleton, skeleton_grouping_part *p)
{
    cairn_skeleton_grouping_part *part = &skeleton->parts[skeleton->part_count];

    part->first = skeleton->point_count;
    part->count = p->kept_end - p->kept_first;
    part->object = skeleton->part_count;
    part->joint[0] = part->joint[1] = -1;
    part->log_odds = p->log_odds;
    disjoint_sets_add(skeleton->union_find, skeleton->part_count);
    skeleton->polarity_sum[skeleton->part_count] = 0;
    for (int32_t i = p->kept_first; i < p->kept_end; i++) {
        skeleton->points[skeleton->point_count++] = smoothed_point(skeleton, p, i);
        for (int32_t side = 0; side < 2; side++)
            if (skeleton->discs[i].edgel[side] >= 0)
                skeleton->polarity_sum[skeleton->part_count] +=
                    skeleton->discs[i].polarity[side] == SKELETON_GROUPING_BRIGHTER ? 1 : -1;
    }
    skeleton->part_count++;
    p->state = 1;
}

/* Returns the unselected trajectory of greatest log odds; -1: none. */
static int32_t best_of(const cairn_skeleton_grouping *skeleton)
{
    int32_t best = -1;

    for (int32_t i = 0; i < skeleton->candidate_count; i++)
        if (skeleton->candidates[i].state == 0 &&
            (best < 0 || skeleton->candidates[i].log_odds > skeleton->candidates[best].log_odds))
            best = i;
    return best;
}

/* Scores a candidate; drops it when no stretch of it can be a part. */
static void score_candidate(cairn_skeleton_grouping *skeleton, skeleton_grouping_part *candidate)
{
    score_best_stretch(skeleton, candidate);
    if (candidate->log_odds < skeleton->params.min_log_odds ||
        (!is_written(skeleton) && candidate->kept_end - candidate->kept_first < MIN_DISCS))
        candidate->state = -1;
}

/* Cost in units of a candidate that becomes a part. */
static int32_t part_cost(const skeleton_grouping_part *candidate)
{
    return 1 + UNITS_PER_KEPT_DISC * (candidate->kept_end - candidate->kept_first);
}

/* Sets the current disc to the first one of the best candidate, whose edgels are to be assigned;
 * as written, where parts do not compete, behind its last one. */
static void begin_assignment(cairn_skeleton_grouping *skeleton)
{
    const skeleton_grouping_part *part = &skeleton->candidates[skeleton->best];

    skeleton->disc = is_written(skeleton) ? part->kept_end : part->kept_first;
}

int cairn_skeleton_grouping_select_parts(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    skeleton_grouping_part *candidates = skeleton->candidates;

    CAIRN_STEP_BEGIN(skeleton->phase_resume);
    for (;;) {
        for (skeleton->candidate = 0; skeleton->candidate < skeleton->candidate_count;
             skeleton->candidate++) {
            if (candidates[skeleton->candidate].state != 0)
                continue;
            CAIRN_STEP_CHARGE(skeleton, phase_resume, budget,
                              1 + candidates[skeleton->candidate].count / DISCS_PER_UNIT);
            score_candidate(skeleton, &candidates[skeleton->candidate]);
        }
        CAIRN_STEP_CHARGE(skeleton, phase_resume, budget,
                          1 + skeleton->candidate_count / CANDIDATES_PER_UNIT);
        skeleton->best = best_of(skeleton);
        if (skeleton->best < 0)
            break;
        CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, part_cost(&candidates[skeleton->best]));
        report_part(skeleton, &candidates[skeleton->best]);
        for (begin_assignment(skeleton); skeleton->disc < candidates[skeleton->best].kept_end;
             skeleton->disc++)
            for (skeleton->side = 0; skeleton->side < 2; skeleton->side++) {
                CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, assignment_cost(skeleton));
                assign_edgels(skeleton);
            }
    }
    CAIRN_STEP_END(skeleton->phase_resume);
}

/* ---- Objects ---- */

/* Returns the part of a point by binary search; parts' points are consecutive. */
static int32_t part_of(const cairn_skeleton_grouping *skeleton, int32_t point)
{
    int32_t low = 0, high = skeleton->part_count - 1;

    while (low < high) {
        int32_t middle = (low + high) / 2;

        if (point >= skeleton->parts[middle].first + skeleton->parts[middle].count)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* Returns 1 if the parts have opposite contrast polarity. */
static int are_opposite(const cairn_skeleton_grouping *skeleton, int32_t a, int32_t b)
{
    return skeleton->polarity_sum[a] * skeleton->polarity_sum[b] < 0;
}

/* The last point of the current part at its current end. */
static const cairn_skeleton_grouping_point *last_point(const cairn_skeleton_grouping *skeleton)
{
    const cairn_skeleton_grouping_part *part = &skeleton->parts[skeleton->part];

    return &skeleton->points[skeleton->end ? part->first + part->count - 1 : part->first];
}

/* Direction of the axis outwards at the current end. */
static cairn_vec2 heading_of_end(const cairn_skeleton_grouping *skeleton)
{
    int32_t count = skeleton->parts[skeleton->part].count, steps = count > 3 ? 3 : count - 1;
    const cairn_skeleton_grouping_point *last = last_point(skeleton),
                                        *before = skeleton->end ? last - steps : last + steps;

    return cairn_vec2_unit(cairn_vec2_sub(last->centre, before->centre));
}

/* The connection of the current end with the point that it may continue into. */
static cairn_segment connection_of(const cairn_skeleton_grouping *skeleton)
{
    cairn_segment connection = {last_point(skeleton)->centre,
                                skeleton->points[skeleton->joined].centre};

    return connection;
}

/* Cost in units of the test whether an edge crosses the connection. */
static int32_t crossing_cost(const cairn_skeleton_grouping *skeleton)
{
    return skeleton_grouping_cells_cost(
        skeleton, cells_near(skeleton, connection_of(skeleton), CROSSING_DISTANCE_PX));
}

/* Returns 1 if an edge crosses the connection. */
static int is_crossed(const cairn_skeleton_grouping *skeleton)
{
    cairn_segment connection = connection_of(skeleton);
    cairn_vec2 unit = cairn_vec2_unit(cairn_vec2_sub(connection.b, connection.a));
    cell_range cells = cells_near(skeleton, connection, CROSSING_DISTANCE_PX);
    int32_t count = 0;

    for (int32_t y = cells.y0; y <= cells.y1; y++) {
        int32_t from, end;

        skeleton_grouping_cells_of_row(skeleton, cells, y, &from, &end);
        for (int32_t i = from; i < end; i++) {
            const skeleton_grouping_edgel *e = &skeleton->edgels[i];

            count += cairn_abs(cairn_vec2_dot(e->normal, unit)) >= ASSIGN_MIN_COSINE &&
                     cairn_segment_distance(connection, e->position) <= CROSSING_DISTANCE_PX;
        }
    }
    return count >= MIN_CROSSING_EDGELS;
}

/* Starts the search for the point of another part into which the current end continues. */
static void begin_joint(cairn_skeleton_grouping *skeleton)
{
    skeleton->parts[skeleton->part].joint[skeleton->end] = -1;
    skeleton->joined = -1;
}

/* Continues to the next point of another part that is ahead of the current end, in reach, and nearer
 * than the joint so far. Returns 0 when there is none. */
static int find_joint(cairn_skeleton_grouping *skeleton)
{
    const cairn_skeleton_grouping_point *last = last_point(skeleton), *points = skeleton->points;
    cairn_vec2 heading = heading_of_end(skeleton);
    int32_t joint = skeleton->parts[skeleton->part].joint[skeleton->end];
    cairn_real nearest = joint < 0
                             ? CAIRN_REAL_MAX
                             : cairn_vec2_norm(cairn_vec2_sub(points[joint].centre, last->centre));

    for (int32_t k = part_of(skeleton, skeleton->joined + 1); k < skeleton->part_count; k++) {
        int32_t first = skeleton->parts[k].first, end = first + skeleton->parts[k].count;

        if (k == skeleton->part || are_opposite(skeleton, skeleton->part, k))
            continue;
        for (int32_t i = first > skeleton->joined ? first : skeleton->joined + 1; i < end; i++) {
            cairn_vec2 displacement = cairn_vec2_sub(points[i].centre, last->centre);
            cairn_real distance = cairn_vec2_norm(displacement);

            if (distance < nearest &&
                distance <= points[i].radius + JOINT_DISTANCE_RADII * last->radius &&
                cairn_vec2_dot(displacement, heading) >= JOINT_MIN_COSINE * distance) {
                skeleton->joined = i;
                return 1;
            }
        }
    }
    return 0;
}

/* Takes the point as the joint when no edge crosses the connection. */
static void set_joint(cairn_skeleton_grouping *skeleton)
{
    if (!is_crossed(skeleton))
        skeleton->parts[skeleton->part].joint[skeleton->end] = skeleton->joined;
}

/* Unites the current part with that of the joint. */
static void unite_parts(cairn_skeleton_grouping *skeleton)
{
    int32_t joint = skeleton->parts[skeleton->part].joint[skeleton->end];

    if (joint >= 0)
        (void)disjoint_sets_unite(skeleton->union_find, skeleton->part, part_of(skeleton, joint));
}

/* Collects the groups into objects. */
static void collect_objects(cairn_skeleton_grouping *skeleton)
{
    for (int32_t i = 0; i < skeleton->part_count; i++) {
        int32_t home = disjoint_sets_root(skeleton->union_find, i);
        cairn_skeleton_grouping_object *o;

        if (home == i) {
            o = &skeleton->objects[skeleton->object_count];
            memset(o, 0, sizeof *o);
            skeleton->parts[i].object = skeleton->object_count++;
        }
        skeleton->parts[i].object = skeleton->parts[home].object;
        o = &skeleton->objects[skeleton->parts[i].object];
        o->part_count++;
        o->log_odds += skeleton->parts[i].log_odds;
        o->free_end_count += (skeleton->parts[i].joint[0] < 0) + (skeleton->parts[i].joint[1] < 0);
    }
}

/* Returns 1 if the object at place a of union_find[] ranks after that at b; ties: the later one. */
static int ranks_after(const void *context, int32_t a, int32_t b)
{
    const cairn_skeleton_grouping *skeleton = context;
    int32_t first = skeleton->union_find[a], second = skeleton->union_find[b];
    cairn_real x = skeleton->objects[first].log_odds, y = skeleton->objects[second].log_odds;

    return x < y || (x <= y && first > second);
}

static void exchange_objects(void *context, int32_t a, int32_t b)
{
    const cairn_skeleton_grouping *skeleton = context;
    int32_t moved = skeleton->union_find[a];

    skeleton->union_find[a] = skeleton->union_find[b];
    skeleton->union_find[b] = moved;
}

/* Sorts the objects by decreasing log odds: union_find[] becomes their order, polarity_sum[] the
 * rank of each. */
static void sort_objects(cairn_skeleton_grouping *skeleton)
{
    for (int32_t i = 0; i < skeleton->object_count; i++)
        skeleton->union_find[i] = i;
    heap_sort(skeleton, skeleton->object_count, ranks_after, exchange_objects);
    for (int32_t i = 0; i < skeleton->object_count; i++)
        skeleton->polarity_sum[skeleton->union_find[i]] = i;
    for (int32_t p = 0; p < skeleton->part_count; p++)
        skeleton->parts[p].object = skeleton->polarity_sum[skeleton->parts[p].object];
    for (int32_t i = 0; i < skeleton->object_count; i++)
        while (skeleton->polarity_sum[i] != i) {
            int32_t place = skeleton->polarity_sum[i];
            cairn_skeleton_grouping_object moved = skeleton->objects[place];

            skeleton->objects[place] = skeleton->objects[i];
            skeleton->objects[i] = moved;
            skeleton->polarity_sum[i] = skeleton->polarity_sum[place];
            skeleton->polarity_sum[place] = place;
        }
}

int cairn_skeleton_grouping_join_parts(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(skeleton->phase_resume);
    for (skeleton->part = 0; skeleton->part < skeleton->part_count; skeleton->part++) {
        CAIRN_STEP_CHARGE(skeleton, phase_resume, budget,
                          2 + skeleton->point_count / POINTS_PER_UNIT);
        for (skeleton->end = 0; !is_written(skeleton) && skeleton->end < 2; skeleton->end++) {
            begin_joint(skeleton);
            while (find_joint(skeleton)) {
                CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, crossing_cost(skeleton));
                set_joint(skeleton);
            }
            unite_parts(skeleton);
        }
    }
    CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, 1 + 2 * skeleton->part_count);
    collect_objects(skeleton);
    sort_objects(skeleton);
    CAIRN_STEP_END(skeleton->phase_resume);
}
