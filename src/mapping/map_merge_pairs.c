/* Rival places of two maps beside each other.
 *
 * Method. Every pair of corners of the same kind and opening fixes a rigid motion. It is judged
 * first by a few points of each map, looked up in the distance map of the other, softly; the
 * best ones that differ are refined by a pattern search about the middle of their overlap (x, y
 * and rotation, steps halved from two cells to a quarter), and then judged by all points.
 * Evidence is counted in lengths of wall: what lies on a wall of the other map speaks for a
 * place, what lies in its free space against it, what lies where it knows nothing says nothing.
 * No image is ever resampled: a point is rotated and looked up. */
#include "src/core/build.h"

#include "src/mapping/map_merge_work.h"

/* Nats for a stretch of wall that agrees: log(0.85 / 0.15); against one that does not: log(0.75
 * / 0.014). */
#define FOR     CAIRN_REAL(1.7)
#define AGAINST CAIRN_REAL(4.0)
/* Two corners match when their openings differ by at most so much, rad. */
#define OPENING CAIRN_REAL(0.25)
/* Places nearer than this are one in the end; while searching: MERGE_COARSE_M. */
#define FINE_M   CAIRN_REAL(0.20)
#define FINE_RAD CAIRN_REAL(0.06)
/* Cells: first and last step of a refinement by an even choice of points, and by all of them. */
#define FIRST_STEP CAIRN_REAL(2.0)
#define LAST_STEP  CAIRN_REAL(0.2)
#define FINE_FIRST CAIRN_REAL(0.5)
#define FINE_LAST  CAIRN_REAL(0.1)
/* m of wall, as felt while searching, from which on a place is refined by all points. */
#define WORTH_FINE CAIRN_REAL(0.3)
/* Of what speaks against a place while searching. */
#define WEIGHT CAIRN_REAL(1.5)
/* Nats from which on a map supports another one. */
#define NEIGHBOUR CAIRN_REAL(3.0)
/* Cells within which a wall is felt. */
#define NEAR 6
/* rad: rotations to either side from which a place is refined again; nats from which on that is
 * worth it. */
#define VARIANT CAIRN_REAL(0.025)
#define WORTH   CAIRN_REAL(1.0)
enum { VARIANTS = 3 };
/* Rounds of a place's refinement by lines. */
enum { LINE_ROUNDS = 5 };
/* m: where a rotation moves cells by one step. */
#define LEVER CAIRN_REAL(3.0)

int cairn_merge_is_same(cairn_pose a, cairn_pose b, cairn_real metres, cairn_real radians)
{
    cairn_real x = a.x - b.x, y = a.y - b.y;

    return x * x + y * y < metres * metres &&
           cairn_abs(cairn_wrap_angle(a.theta - b.theta)) < radians;
}

/* ---- Comparing ---- */

static uint16_t cell_of(const merge_map *to, cairn_vec2 p, cairn_real scale)
{
    return merge_cell_at(to, (p.x - to->corner.x) * scale, (p.y - to->corner.y) * scale);
}

/* Adds points begin ... end - 1 of `from`, mapped by t, in the grid of `to`. A point agrees that
 * lies on a wall and has free space before it, as in its own map: the two faces of a wall do
 * not. One that lies two cells beside a wall may be on its other face or be moved by noise: it
 * counts half, a third one says nothing. */
void cairn_merge_sum(const cairn_map_merge *m, const merge_map *to, const merge_map *from,
                     const cairn_transform *t, int32_t begin, int32_t end, merge_sums *s)
{
    cairn_real scale = 1 / to->input.resolution;

    for (int32_t i = begin; i < end; i++) {
        cairn_vec2 p = cairn_transform_point(*t, from->points[i].at);
        uint16_t cell = cell_of(to, p, scale);
        int32_t d = merge_to_occupied(cell);

        if (merge_class(cell) == MERGE_UNKNOWN)
            continue;
        s->known++;
        s->middle = cairn_vec2_add(s->middle, p);
        if (d > 3 && merge_class(cell) == MERGE_FREE) {
            s->conflict += 1;
            s->against += d > 5;
        }
        if (d > NEAR || merge_class(cell_of(to, cairn_transform_point(*t, from->points[i].front),
                                            scale)) != MERGE_FREE)
            continue;
        s->soft += m->soft[d];
        if (d <= 2)
            s->agree += d < 2 ? from->points[i].weight : from->points[i].weight / 2;
    }
}

static void begin_comparing(cairn_map_merge *m, int32_t first, int32_t second,
                            cairn_pose first_second, int32_t points)
{
    merge_comparison *c = &m->comparison;
    const merge_sums none = {0, 0, 0, 0, {0, 0}, 0};
    int32_t of_first = m->maps[first].point_count, of_second = m->maps[second].point_count;

    c->first = first;
    c->second = second;
    c->first_second = first_second;
    c->there = cairn_transform_of(first_second);
    c->back = cairn_transform_of(cairn_pose_inverse(first_second));
    c->points[0] = of_second < points ? of_second : points;
    c->points[1] = of_first < points ? of_first : points;
    c->cursor = c->direction = 0;
    c->sums[0] = c->sums[1] = none;
}

static int go_on_comparing(cairn_map_merge *m, cairn_budget *budget)
{
    merge_comparison *c = &m->comparison;

    for (; c->direction < 2; c->direction++, c->cursor = 0) {
        int32_t to = c->direction == 0 ? c->first : c->second,
                from = c->direction == 0 ? c->second : c->first;

        while (c->cursor < c->points[c->direction]) {
            int32_t end = c->cursor + MERGE_POINTS_PER_UNIT;

            if (!cairn_budget_pay(budget, &m->paid, 1))
                return 0;
            end = end < c->points[c->direction] ? end : c->points[c->direction];
            cairn_merge_sum(m, &m->maps[to], &m->maps[from],
                            c->direction == 0 ? &c->there : &c->back, c->cursor, end,
                            &c->sums[c->direction]);
            c->cursor = end;
        }
    }
    return 1;
}

/* m of wall for one of the points that were compared. */
static cairn_real wall_of_point(const cairn_map_merge *m, const merge_comparison *c,
                                int32_t direction)
{
    const merge_map *from = &m->maps[direction == 0 ? c->second : c->first];

    if (c->points[direction] == 0)
        return 0;
    return from->spacing * (cairn_real)from->point_count / (cairn_real)c->points[direction];
}

cairn_real cairn_merge_nats(const cairn_map_merge *m, cairn_real agree, cairn_real conflict)
{
    return (FOR * agree - AGAINST * conflict) / (m->params.correlation * MERGE_CELL);
}

static cairn_real evidence_of(const cairn_map_merge *m, const merge_comparison *c)
{
    cairn_real there = wall_of_point(m, c, 0), back = wall_of_point(m, c, 1);
    cairn_real agree = (c->sums[0].agree * there + c->sums[1].agree * back) / 2;
    cairn_real conflict = c->sums[0].conflict * there + c->sums[1].conflict * back;

    return cairn_merge_nats(m, agree, conflict);
}

/* The same for searching, with a kernel that is felt from farther away. */
static cairn_real soft_score(const cairn_map_merge *m)
{
    const merge_comparison *c = &m->comparison;
    cairn_real there = wall_of_point(m, c, 0), back = wall_of_point(m, c, 1);

    return (c->sums[0].soft * there + c->sums[1].soft * back) / 2 -
           WEIGHT * (c->sums[0].against * there + c->sums[1].against * back);
}

/* ---- Hypotheses ---- */

void cairn_merge_keep(merge_mode *list, int32_t *count, int32_t most, merge_mode mode,
                      cairn_real metres, cairn_real radians)
{
    int32_t at;

    for (int32_t i = 0; i < *count; i++)
        if (cairn_merge_is_same(list[i].first_second, mode.first_second, metres, radians)) {
            if (list[i].evidence >= mode.evidence)
                return;
            for (; i + 1 < *count; i++)
                list[i] = list[i + 1];
            --*count;
            break;
        }
    if (*count == most && list[most - 1].evidence >= mode.evidence)
        return;
    at = *count < most ? (*count)++ : most - 1;
    for (; at > 0 && list[at - 1].evidence < mode.evidence; at--)
        list[at] = list[at - 1];
    list[at] = mode;
}

static int corners_match(const cairn_corner *a, const cairn_corner *b)
{
    return a->kind == b->kind && cairn_abs(a->opening - b->opening) <= OPENING;
}

/* The motion that lays corner b on corner a, the bisectors of their legs on each other. */
static cairn_pose motion_of(const cairn_corner *a, const cairn_corner *b)
{
    cairn_vec2 u = cairn_vec2_add(a->leg[0], a->leg[1]), v = cairn_vec2_add(b->leg[0], b->leg[1]);
    cairn_pose pose = {0, 0, cairn_atan2(cairn_vec2_cross(v, u), cairn_vec2_dot(v, u))};
    cairn_vec2 moved = cairn_pose_point(pose, b->position);

    pose.x = a->position.x - moved.x;
    pose.y = a->position.y - moved.y;
    return pose;
}

static cairn_status step_hypotheses(cairn_map_merge *m, cairn_budget *budget)
{
    const merge_map *first = &m->maps[m->map], *second = &m->maps[m->other];
    int32_t count = first->corner_count * second->corner_count;

    for (; m->cursor < count; m->cursor++) {
        const cairn_corner *a = &first->corners[m->cursor / second->corner_count];
        const cairn_corner *b = &second->corners[m->cursor % second->corner_count];

        if (!m->comparing) {
            if (!cairn_budget_pay(budget, &m->paid, 1))
                return CAIRN_MORE;
            if (!corners_match(a, b))
                continue;
            begin_comparing(m, m->map, m->other, motion_of(a, b), MERGE_FIRST_POINTS);
            m->comparing = 1;
        }
        if (!go_on_comparing(m, budget))
            return CAIRN_MORE;
        m->comparing = 0;
        m->tried++;
        {
            merge_mode mode = {m->comparison.first_second, soft_score(m)};

            cairn_merge_keep(m->kept, &m->kept_count, MERGE_KEPT, mode, MERGE_COARSE_M,
                             MERGE_COARSE_RAD);
        }
    }
    return CAIRN_OK;
}

/* ---- One map beside several ---- */

static int32_t rounded(cairn_real x, cairn_real step)
{
    return cairn_real_to_int(cairn_rint(x / step));
}

static merge_memory *slot_of(const cairn_map_merge *m, const merge_memory *key)
{
    uint32_t h = (uint32_t)key->first * 73856093U ^ (uint32_t)key->second * 19349663U ^
                 (uint32_t)key->x * 83492791U ^ (uint32_t)key->y * 2654435761U ^
                 (uint32_t)key->theta * 40503U;

    return &m->memory[(h ^ h >> 15) & (MERGE_MEMORY - 1)];
}

static merge_memory key_of(int32_t first, int32_t second, cairn_pose pose)
{
    merge_memory key = {first,
                        second,
                        rounded(pose.x, CAIRN_REAL(0.02)),
                        rounded(pose.y, CAIRN_REAL(0.02)),
                        rounded(pose.theta, CAIRN_REAL(0.005)),
                        0};

    return key;
}

static int is_remembered(const merge_memory *slot, const merge_memory *key)
{
    return slot->first == key->first && slot->second == key->second && slot->x == key->x &&
           slot->y == key->y && slot->theta == key->theta;
}

static cairn_real reach_of(const merge_map *map)
{
    return cairn_vec2_norm(map->corner);
}

int cairn_merge_is_apart(const cairn_map_merge *m, int32_t first, int32_t second,
                         cairn_pose first_second)
{
    cairn_real reach = reach_of(&m->maps[first]) + reach_of(&m->maps[second]);

    return first_second.x * first_second.x + first_second.y * first_second.y > reach * reach;
}

void cairn_merge_begin_total(cairn_map_merge *m, int32_t map, cairn_pose pose, int32_t points)
{
    m->total.map = map;
    m->total.pose = pose;
    m->total.points = points;
    m->total.near = 0;
    m->total.neighbours = 0;
    m->total.evidence = m->total.soft = m->total.known = 0;
    m->total.middle.x = m->total.middle.y = 0;
    m->comparing = 0;
}

/* Takes in the comparison with one neighbour. */
static void add_comparison(cairn_map_merge *m, cairn_real evidence)
{
    const merge_comparison *c = &m->comparison;
    cairn_transform t = cairn_transform_of(m->near_pose[m->total.near]);
    cairn_real known = (cairn_real)c->sums[0].known;
    cairn_vec2 middle = cairn_vec2_scale(c->sums[0].middle, 1 / cairn_max(known, 1));

    m->total.soft += soft_score(m);
    m->total.known += known;
    m->total.middle =
        cairn_vec2_add(m->total.middle, cairn_vec2_scale(cairn_transform_point(t, middle), known));
    m->total.evidence += evidence;
    m->total.neighbours += evidence > NEIGHBOUR;
}

int cairn_merge_go_on_total(cairn_map_merge *m, cairn_budget *budget)
{
    int whole = m->total.points == m->params.max_points;

    for (; m->total.near < m->near_count; m->total.near++) {
        int32_t near = m->near[m->total.near];
        cairn_pose seen = cairn_pose_between(m->near_pose[m->total.near], m->total.pose);
        merge_memory key = key_of(near, m->total.map, seen), *slot = slot_of(m, &key);

        if (!m->comparing) {
            if (!cairn_budget_pay(budget, &m->paid, 2))
                return 0;
            if (cairn_merge_is_apart(m, near, m->total.map, seen))
                continue;
            if (whole && is_remembered(slot, &key)) {
                m->total.evidence += slot->evidence;
                m->total.neighbours += slot->evidence > NEIGHBOUR;
                continue;
            }
            begin_comparing(m, near, m->total.map, seen, m->total.points);
            m->comparing = 1;
        }
        if (!go_on_comparing(m, budget))
            return 0;
        m->comparing = 0;
        key.evidence = evidence_of(m, &m->comparison);
        if (whole)
            *slot = key;
        add_comparison(m, key.evidence);
    }
    return 1;
}

/* ---- Refinement ---- */

/* The pose turned about a point. */
static cairn_pose turned(cairn_pose pose, cairn_vec2 pivot, cairn_real angle)
{
    cairn_vec2 arm = {pose.x - pivot.x, pose.y - pivot.y};
    cairn_pose turn = {pivot.x, pivot.y, angle};
    cairn_vec2 at = cairn_pose_point(turn, arm);
    cairn_pose result = {at.x, at.y, cairn_wrap_angle(pose.theta + angle)};

    return result;
}

/* The pose moved by a step along x, y, or turned about the pivot: directions 0 ... 5. */
static cairn_pose moved(const cairn_map_merge *m, int32_t direction)
{
    cairn_real sign = direction % 2 == 0 ? 1 : -1;
    cairn_pose pose = m->climb.best;

    if (direction < 2) {
        pose.x += sign * m->climb.step;
    } else if (direction < 4) {
        pose.y += sign * m->climb.step;
    } else {
        pose = turned(pose, m->climb.pivot, sign * m->climb.turn);
    }
    return pose;
}

static void set_step(cairn_map_merge *m, cairn_real cells)
{
    m->climb.cells = cells;
    m->climb.step = cells * m->maps[m->total.map].input.resolution;
    m->climb.turn = m->climb.step / LEVER;
}

static void begin_climb(cairn_map_merge *m, int32_t map, cairn_pose start, int32_t points,
                        cairn_real first, cairn_real last)
{
    m->climb.best = start;
    m->climb.points = points;
    m->climb.last = last;
    m->climb.direction = -1;
    m->climb.rounds = 0;
    m->climb.improved = 0;
    cairn_merge_begin_total(m, map, start, points);
    set_step(m, first);
}

/* Takes in the score of the pose that was tried; 1 when the search has ended. */
static int end_try(cairn_map_merge *m)
{
    if (m->climb.direction < 0 || m->total.soft > m->climb.score) {
        m->climb.improved |= m->climb.direction >= 0;
        m->climb.best = m->total.pose;
        m->climb.score = m->total.soft;
        m->climb.pivot = cairn_vec2_scale(m->total.middle, 1 / cairn_max(m->total.known, 1));
    }
    if (++m->climb.direction < 6)
        return 0;
    m->climb.direction = 0;
    if (!m->climb.improved)
        set_step(m, m->climb.cells / 2);
    m->climb.improved = 0;
    return m->climb.cells < m->climb.last || ++m->climb.rounds == MERGE_ROUNDS;
}

static int go_on_climbing(cairn_map_merge *m, cairn_budget *budget)
{
    for (;;) {
        if (!cairn_merge_go_on_total(m, budget))
            return 0;
        if (end_try(m))
            return 1;
        cairn_merge_begin_total(m, m->total.map, moved(m, m->climb.direction), m->climb.points);
    }
}

/* All that are kept are looked at again with more points; the best are refined. */
static cairn_status step_sift(cairn_map_merge *m, cairn_budget *budget)
{
    for (; m->cursor < m->kept_count; m->cursor++) {
        merge_mode mode = m->kept[m->cursor];

        if (!m->comparing) {
            begin_comparing(m, m->map, m->other, mode.first_second, MERGE_REFINE_POINTS);
            m->comparing = 1;
        }
        if (!go_on_comparing(m, budget))
            return CAIRN_MORE;
        m->comparing = 0;
        mode.evidence = soft_score(m);
        cairn_merge_keep(m->refined, &m->refined_count, MERGE_REFINED, mode, MERGE_COARSE_M,
                         MERGE_COARSE_RAD);
    }
    return CAIRN_OK;
}

/* Where the refinement of a variant starts: the search may have stuck beside the best rotation. */
static cairn_pose variant_of(const cairn_map_merge *m)
{
    cairn_real turn = m->climb.variant == 1 ? VARIANT : -VARIANT;

    return m->climb.variant == 0 ? m->refined[m->cursor].first_second
                                 : turned(m->climb.base, m->climb.base_pivot, turn);
}

/* Refines the place at hand by cells, then by lines, then judges it by all points. */
static int step_place(cairn_map_merge *m, cairn_budget *budget)
{
    if (m->inner == 0) {
        m->near[0] = m->map;
        m->near_pose[0] = cairn_pose_identity();
        m->near_count = 1;
        begin_climb(m, m->other, variant_of(m), MERGE_REFINE_POINTS, FIRST_STEP, LAST_STEP);
        m->inner = 1;
    }
    if (m->inner == 1) {
        if (!go_on_climbing(m, budget))
            return 0;
        m->inner = 2;
        if (m->climb.score < WORTH_FINE)
            m->inner = 3;
        else
            begin_climb(m, m->other, m->climb.best, m->params.max_points + 1, FINE_FIRST,
                        FINE_LAST);
    }
    if (m->inner == 2 && !go_on_climbing(m, budget))
        return 0;
    if (m->inner < 4) {
        cairn_merge_begin_lines(m, m->other, m->climb.best, m->climb.best, LINE_ROUNDS);
        m->inner = 4;
    }
    if (m->inner == 4) {
        if (!cairn_merge_go_on_lines(m, budget))
            return 0;
        cairn_merge_begin_total(m, m->other, m->climb.best, m->params.max_points);
        m->inner = 5;
    }
    return cairn_merge_go_on_total(m, budget);
}

/* Each of the places kept, and its variants when it is worth it. */
static cairn_status step_refine(cairn_map_merge *m, cairn_budget *budget)
{
    int32_t pair = merge_pair(m->map, m->other);

    while (m->cursor < m->refined_count) {
        merge_mode mode;

        if (!step_place(m, budget))
            return CAIRN_MORE;
        mode.first_second = m->climb.best;
        mode.evidence = m->total.evidence;
        if (mode.evidence > 0)
            cairn_merge_keep(m->modes + (size_t)pair * (size_t)m->params.max_modes,
                             &m->mode_count[pair], m->params.max_modes, mode, FINE_M, FINE_RAD);
        if (m->climb.variant == 0) {
            m->climb.base = m->climb.best;
            m->climb.base_pivot = m->climb.pivot;
        }
        m->inner = 0;
        if (mode.evidence < WORTH || ++m->climb.variant == VARIANTS) {
            m->climb.variant = 0;
            m->cursor++;
        }
    }
    return CAIRN_OK;
}

static void begin_pair(cairn_map_merge *m)
{
    m->cursor = 0;
    m->inner = 0;
    m->comparing = 0;
    m->kept_count = m->refined_count = 0;
    m->climb.variant = 0;
    m->phase = MERGE_HYPOTHESES;
    if (m->other < m->map_count)
        m->mode_count[merge_pair(m->map, m->other)] = 0;
}

static cairn_status step_phase(cairn_map_merge *m, cairn_budget *budget)
{
    switch (m->phase) {
    case MERGE_HYPOTHESES:
        return step_hypotheses(m, budget);
    case MERGE_TURNS:
    case MERGE_SHIFTS:
        return cairn_merge_correlate(m, budget);
    case MERGE_BENDS:
        return cairn_merge_try_bends(m, budget);
    case MERGE_SIFT:
        return step_sift(m, budget);
    default:
        return step_refine(m, budget);
    }
}

cairn_status cairn_merge_find_modes(cairn_map_merge *m, cairn_budget *budget)
{
    if (m->phase == MERGE_OCCUPIED_DISTANCE) {
        if (!cairn_budget_pay(budget, &m->paid, MERGE_MEMORY / 16))
            return CAIRN_MORE;
        for (int32_t i = 0; i < MERGE_MEMORY; i++)
            m->memory[i].first = -1;
        m->map = 0;
        m->other = 1;
        begin_pair(m);
    }
    while (m->other < m->map_count) {
        cairn_status status = step_phase(m, budget);

        if (status != CAIRN_OK)
            return status;
        if (m->phase < MERGE_REFINE) {
            m->phase++;
            m->cursor = 0;
            m->inner = 0;
            continue;
        }
        if (++m->map == m->other) {
            m->map = 0;
            m->other++;
        }
        begin_pair(m);
    }
    return CAIRN_OK;
}
