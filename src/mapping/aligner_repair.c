/* Scans that lie badly, or nowhere, are looked for in all the rest.
 *
 * The rest is drawn into a raster about the place where the scan is expected: a bit for each
 * direction of a surface, one for free space. For every turn, all shifts within the window are
 * voted for at once, a point giving its vote to the shifts that bring it onto a surface of its
 * direction, and two votes against those that bring it into free space. The best few are refined
 * and compared by their evidence, also with where the scan was. All scans are looked for once,
 * later those that lie badly. Scans that something else has moved since, as walls that attract
 * each other do, lie parallel to the rest before they meet it: they are looked for in fewer
 * turns, by every second point. A cluster beside the largest is looked for as a whole, by each
 * of its scans; in the last round its scans are looked for one by one. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/aligner_work.h"

enum { DIRECTIONS = 15, FREE_CELL = 1 << DIRECTIONS, TRY_ROUNDS = 3 };
/* Of one item of the search: so many votes, or cells whose votes are counted as far as the units
 * go. */
enum {
    VOTES_OF_ITEM = 2400,
    VOTES_OF_UNIT = 24,
    CELLS_OF_UNIT = 16,
    FIND_COST = 3,
    UNITS_OF_COUNT = 100
};

/* Votes, halves of a point, that a find has at least; where scans are looked for again every
 * so-manieth point votes, for as many, and a find may have one vote less. */
enum { LEAST_VOTES = 3, AGAIN_STRIDE = 2 };

/* m */
static const cairn_real CELL = CAIRN_REAL(0.1);
/* m before a surface that is not drawn free */
static const cairn_real CLEARANCE = CAIRN_REAL(0.2);
/* rad: 2 degrees */
static const cairn_real TURN = CAIRN_REAL(0.0349);
/* standard deviations */
static const cairn_real WINDOW = CAIRN_REAL(2.2);
/* of the params' spread */
static const cairn_real WIDEST = CAIRN_REAL(1.875);
/* of the turns, where looked for again */
static const cairn_real STILL_TURNED = CAIRN_REAL(0.4);
static const cairn_real LIES_WELL = 10, LIES_SURELY = 40, BETTER = 2, ATTACHED = -2, TORN_OFF = 4,
                        JOINED = 4,
                        /* nats */
    CLEARLY = 3, HOPELESS = -40;

/* ---- Which scan ---- */

static cairn_transform single(void)
{
    cairn_transform same = {0, 0, 1, 0};

    return same;
}

static int finds_near(cairn_pose a, cairn_pose b)
{
    cairn_real dx = cairn_abs(a.x - b.x), dy = cairn_abs(a.y - b.y);
    cairn_real turn = cairn_abs(cairn_wrap_angle(a.theta - b.theta));

    return cairn_max(dx, dy) / CAIRN_REAL(0.25) + turn / CAIRN_REAL(0.12) < 1;
}

/* Keeps the best, no two of which are near each other. */
static void keep_find(cairn_aligner *x, cairn_pose pose, cairn_real score)
{
    int32_t to = -1, end = 0;

    for (int32_t i = 0; i < x->find_count; i++)
        if (finds_near(x->find[i].pose, pose)) {
            if (x->find[i].score >= score)
                return;
            to = to < 0 ? i : to;
        }
    if (to < 0) {
        if (x->find_count < ALIGNER_FINDS) {
            to = x->find_count++;
        } else {
            to = 0;
            for (int32_t i = 1; i < x->find_count; i++)
                if (x->find[i].score < x->find[to].score)
                    to = i;
            if (x->find[to].score >= score)
                return;
        }
    }
    x->find[to].pose = pose;
    x->find[to].score = score;
    for (int32_t i = 0; i < x->find_count; i++)
        if (i == to || !finds_near(x->find[i].pose, pose))
            x->find[end++] = x->find[i];
    x->find_count = end;
}

/* Where the rest's motion brings the scan's initial pose, and the raster about it. */
static void expect(cairn_aligner *x, int32_t rest)
{
    const aligner_scan *scan = &x->scans[x->i];
    cairn_transform gauge = cairn_aligner_inverse(cairn_aligner_gauge(x, rest));
    cairn_real factor = cairn_sqrt(1 / (cairn_real)x->clusters[x->moving].size +
                                   1 / (cairn_real)x->clusters[rest].size);
    cairn_real window = cairn_min(WINDOW * x->sigma * factor, WIDEST * x->params.spread);
    cairn_real turned =
        cairn_min(WINDOW * x->sigma_angle * factor, WIDEST * x->params.spread_angle);
    cairn_real half = scan->radius + cairn_vec2_norm(scan->middle) + window + CAIRN_REAL(0.3);
    int32_t most = cairn_real_to_int(cairn_sqrt((cairn_real)x->params.max_cells)),
            most_window = most / 4 - 1;

    if (x->moving == x->scan_count)
        gauge = cairn_aligner_compose(gauge, cairn_transform_of(scan->initial));
    else
        gauge = cairn_aligner_compose(
            gauge, cairn_aligner_compose(cairn_aligner_gauge(x, x->moving), x->poses[x->i]));
    x->predicted = cairn_aligner_to_pose(gauge);
    x->cell = cairn_max(CELL, 2 * half / (cairn_real)(most - 1));
    x->side_cells = cairn_real_to_int(cairn_ceil(2 * half / x->cell));
    x->half_window =
        cairn_real_to_int(cairn_min(cairn_ceil(window / x->cell), (cairn_real)most_window));
    if (x->again)
        turned *= STILL_TURNED;
    x->turns = cairn_real_to_int(cairn_ceil(cairn_min(turned, CAIRN_PI) / TURN));
    x->corner.x = x->predicted.x - (cairn_real)x->side_cells * x->cell / 2;
    x->corner.y = x->predicted.y - (cairn_real)x->side_cells * x->cell / 2;
    memset(x->cells, 0, (size_t)x->side_cells * (size_t)x->side_cells * sizeof *x->cells);
    x->j = x->k = x->l = 0;
    x->turn = -x->turns;
    x->find_count = x->find_at = 0;
    keep_find(x, x->predicted, 0);
    x->best_score = x->rest = -CAIRN_REAL_MAX;
}

/* Takes the scan out of its cluster to look for it; 0 when there is nothing to look for. */
static int take_out(cairn_aligner *x)
{
    int32_t rest = cairn_aligner_largest(x), home = x->scans[x->i].part,
            points = cairn_aligner_points_of(x, x->i);

    x->largest = rest;
    x->home = home == rest ? -1 : home;
    if (points == 0 || x->clusters[rest].size < 3 ||
        (x->home < 0 && x->scans[x->i].evidence > LIES_SURELY))
        return 0;
    x->before = x->poses[x->i];
    x->moving = home;
    if (x->home >= 0 && x->clusters[home].size > 1 && x->repairs + 1 < x->params.max_repairs)
        return 1;
    x->moving = x->scan_count;
    cairn_aligner_remove(x, x->i);
    x->poses[x->i] = single();
    cairn_aligner_insert(x, x->i, x->scan_count);
    cairn_aligner_learn_spread(x);
    return 1;
}

void cairn_aligner_put_back(cairn_aligner *x, int32_t cluster, cairn_transform pose)
{
    cairn_aligner_remove(x, x->i);
    x->poses[x->i] = pose;
    cairn_aligner_insert(x, x->i, cluster);
}

static void end_round(cairn_aligner *x)
{
    x->repairs++;
    if (x->again && x->changed > 0)
        x->result.verdict = CAIRN_ALIGNER_RUNNING;
    if (x->again && x->result.verdict != CAIRN_ALIGNER_RUNNING) {
        x->has_ended = 1;
        x->phase = ALIGNER_DONE;
        return;
    }
    /* All scans once; later those that have been placed anew, and those that meet them. */
    cairn_aligner_begin_relax(x, cairn_aligner_largest(x), CAIRN_REAL(0.07), 5,
                              !x->again && x->repairs == 1);
    if (x->changed == 0 || x->repairs >= x->params.max_repairs) {
        x->phase = ALIGNER_SETTLE;
        x->round = x->stage = x->at = 0;
        return;
    }
    cairn_aligner_begin_open(x, 1);
}

static int32_t choose_scan(cairn_aligner *x)
{
    if (x->i == x->scan_count || x->params.max_repairs == 0) {
        end_round(x);
        return 1;
    }
    if ((x->again && x->scans[x->i].held) || !take_out(x)) {
        x->i++;
        return 1 + x->scan_count / 16;
    }
    x->before_score = -CAIRN_REAL_MAX;
    if (x->home < 0)
        cairn_aligner_begin_look(x, x->scan_count, x->largest, x->before, 0, -CAIRN_REAL_MAX);
    x->phase = ALIGNER_DRAW;
    x->stage = 0;
    return 1;
}

/* ---- The raster ---- */

static int32_t direction_bin(cairn_vec2 direction, cairn_real *rest)
{
    cairn_real place =
        cairn_atan2(direction.y, direction.x) * (DIRECTIONS / (2 * CAIRN_PI)) + DIRECTIONS;
    cairn_real whole = cairn_floor(place);

    *rest = place - whole;
    return (int32_t)((uint32_t)cairn_real_to_int(whole) % DIRECTIONS);
}

/* Bits of the directions within about 20 degrees. */
static int32_t direction_bits(cairn_vec2 direction)
{
    cairn_real rest;
    int32_t bin = direction_bin(direction, &rest), bits = 1 << bin | 1 << (bin + 1) % DIRECTIONS;

    if (rest < CAIRN_REAL(0.3))
        bits |= 1 << (bin + DIRECTIONS - 1) % DIRECTIONS;
    if (rest > CAIRN_REAL(0.7))
        bits |= 1 << (bin + 2) % DIRECTIONS;
    return bits;
}

/* How many cells of a ray have been passed when it comes to within 0 ... side along one axis. */
static cairn_real cells_to(cairn_real from, cairn_real step, cairn_real side)
{
    if (from < 0)
        return step > 0 ? -from / step : CAIRN_REAL_MAX;
    if (from >= side)
        return step < 0 ? (side - from) / step : CAIRN_REAL_MAX;
    return 0;
}

/* The cells of one ray from place (x, y) on, from the first-th to before the last-th of it;
 * returns how many. */
static int32_t draw_ray(cairn_aligner *x, cairn_vec2 from, cairn_vec2 step, int32_t first,
                        int32_t last)
{
    cairn_real side = (cairn_real)x->side_cells;
    cairn_real enter = cairn_max(cells_to(from.x, step.x, side), cells_to(from.y, step.y, side));
    int32_t k = enter > (cairn_real)first ? cairn_real_to_int(cairn_ceil(enter)) : first, begin = k;
    cairn_vec2 p;

    if (k >= last)
        return 0;
    p = cairn_vec2_add(from, cairn_vec2_scale(step, (cairn_real)k));
    for (; k < last && p.x >= 0 && p.y >= 0 && p.x < side && p.y < side; k++) {
        int32_t at = (int32_t)p.y * x->side_cells + (int32_t)p.x;

        x->cells[at] = (uint16_t)(x->cells[at] | FREE_CELL);
        p = cairn_vec2_add(p, step);
    }
    return k - begin;
}

/* Free space of scan j along its bearings, near the sensor along every second or fourth; returns
 * units. */
static int32_t draw_free(cairn_aligner *x, int32_t j)
{
    /* cells: from there on, bearings are a cell apart */
    static const int32_t first[4] = {0, 45, 22, 45};
    const aligner_table *table = &x->tables[j];
    cairn_vec2 sensor = cairn_transform_point(x->poses[j], x->scans[j].sensor);
    cairn_vec2 from = {(sensor.x - x->corner.x) / x->cell, (sensor.y - x->corner.y) / x->cell};
    cairn_real cells = x->params.reach / CAIRN_REAL(65535.0) / x->cell;
    int32_t work = 0;

    for (int32_t bin = 0; bin < ALIGNER_BINS; bin++) {
        uint16_t before = table->range[(bin - 1) & (ALIGNER_BINS - 1)];
        uint16_t least = table->range[bin], after = table->range[(bin + 1) & (ALIGNER_BINS - 1)];
        int32_t steps;

        least = before < least ? before : least;
        least = after < least ? after : least;
        if (least == 0)
            continue;
        steps = cairn_real_to_int((cairn_real)least * cells - CLEARANCE / x->cell);
        work += 2;
        if (steps > first[bin & 3])
            work += 2 + draw_ray(x, from, cairn_transform_direction(x->poses[j], x->bearings[bin]),
                                 first[bin & 3], steps);
    }
    return 8 + work / 16;
}

/* The points of scan j, each with its neighbouring cells; no surface is free. */
static int32_t draw_points(cairn_aligner *x, int32_t j)
{
    int32_t side = x->side_cells, segment = -1, bits = 0;

    for (int32_t i = x->scans[j].first_point; i < x->scans[j].end_point; i++) {
        const aligner_point *point = &x->points[i];
        cairn_vec2 p = cairn_transform_point(x->poses[j], point->position);
        int32_t ix = cairn_real_to_int(cairn_floor((p.x - x->corner.x) / x->cell));
        int32_t iy = cairn_real_to_int(cairn_floor((p.y - x->corner.y) / x->cell));

        if (point->segment != segment) {
            cairn_vec2 direction =
                cairn_transform_direction(x->poses[j], x->segments[point->segment].direction);

            segment = point->segment;
            bits = direction_bits(direction);
            if (!x->params.oriented)
                bits |= direction_bits(cairn_vec2_scale(direction, -1));
        }
        for (int32_t v = iy > 0 ? iy - 1 : 0; v <= iy + 1 && v < side; v++)
            for (int32_t u = ix > 0 ? ix - 1 : 0; u <= ix + 1 && u < side; u++)
                x->cells[v * side + u] = (uint16_t)((x->cells[v * side + u] & ~FREE_CELL) | bits);
    }
    return 4 + cairn_aligner_points_of(x, j) / ALIGNER_POINTS_OF_UNIT;
}

/* 1 when scan j may lie where the points of the scan at hand may come to lie. */
static int is_drawn(const cairn_aligner *x, int32_t j)
{
    const aligner_scan *scan = &x->scans[x->i], *other = &x->scans[j];
    cairn_vec2 middle = cairn_transform_point(x->poses[j], other->middle);
    cairn_real window = (cairn_real)x->half_window * x->cell;
    cairn_real far = scan->radius + cairn_vec2_norm(scan->middle) + other->radius + window;

    return cairn_abs(middle.x - x->predicted.x) <= far &&
           cairn_abs(middle.y - x->predicted.y) <= far &&
           cairn_aligner_may_see(scan, cairn_transform_of(x->predicted),
                                 (cairn_real)x->turns * TURN, middle,
                                 other->radius + window * CAIRN_REAL(1.5));
}

/* One scan of the rest: first the free space of all, then the points of all. */
static int32_t draw(cairn_aligner *x)
{
    int32_t rest = x->largest, passed = 0, count, j = 0;

    if (x->stage == 0) {
        if (x->home < 0) {
            x->before_score = x->look.evidence + x->look.prior;
            x->scans[x->i].evidence = x->look.evidence;
            if (x->look.evidence > (x->repairs > 0 ? LIES_WELL : LIES_SURELY)) {
                cairn_aligner_put_back(x, rest, x->before);
                x->i++;
                x->phase = ALIGNER_REPAIR;
                return 1;
            }
        }
        expect(x, rest);
        x->stage = 1;
        return 4 + x->side_cells * x->side_cells / 256 + x->clusters[rest].size / 4;
    }
    count = x->scans[x->i].partner_count;
    if (x->j == count) {
        x->phase = x->k == 1 ? ALIGNER_SEARCH : x->phase;
        x->k = !x->k; /* drawn all: none of the votes has been counted */
        x->j = 0;
        return 1;
    }
    for (; x->j < count; x->j++, passed++) {
        j = cairn_aligner_partner(x, x->i, x->j);
        if (x->scans[j].part == rest && is_drawn(x, j))
            break;
    }
    if (x->j == count)
        return 1 + passed / ALIGNER_FAR_OF_UNIT;
    x->j++;
    passed /= ALIGNER_FAR_OF_UNIT;
    if (x->k == 0)
        return passed + (x->params.contradiction > 0 ? draw_free(x, j) : 1);
    return passed + draw_points(x, j);
}

/* ---- The search ---- */

/* Every so-manieth point votes. */
static int32_t stride_of(const cairn_aligner *x)
{
    return x->again ? AGAIN_STRIDE : 1;
}

/* The votes of some points of the scan at hand, from the first-th on. */
static void vote(cairn_aligner *x, cairn_transform pose, int32_t width, int32_t first, int32_t end)
{
    int32_t side = x->side_cells;

    for (int32_t i = first; i < end; i += stride_of(x)) {
        const aligner_point *point = &x->points[i];
        cairn_vec2 p = cairn_transform_point(pose, point->position);
        cairn_vec2 direction =
            cairn_transform_direction(pose, x->segments[point->segment].direction);
        int32_t ix = cairn_real_to_int(cairn_floor((p.x - x->corner.x) / x->cell)) - x->half_window;
        int32_t iy = cairn_real_to_int(cairn_floor((p.y - x->corner.y) / x->cell)) - x->half_window;
        cairn_real rest;
        int32_t bin = direction_bin(direction, &rest),
                mask = 1 << (bin + (rest >= CAIRN_REAL(0.5))) % DIRECTIONS;

        if (ix < 0 || iy < 0 || ix + width > side || iy + width > side)
            continue;
        for (int32_t v = 0; v < width; v++) {
            const uint16_t *cell = &x->cells[(iy + v) * side + ix];
            int32_t *to = &x->votes[v * width];

            for (int32_t u = 0; u < width; u++)
                to[u] += (cell[u] & mask) != 0 ? 1 : -((cell[u] >> DIRECTIONS) << 1);
        }
    }
}

/* A shift that has found enough votes at one turn, what the initial pose says weighed in. */
static void take_votes(cairn_aligner *x, cairn_pose at, int32_t cell, int32_t width, int32_t votes)
{
    int32_t column = cell % width - x->half_window, row = cell / width - x->half_window;
    cairn_real dx = (cairn_real)column * x->cell, dy = (cairn_real)row * x->cell,
               turned = (cairn_real)x->turn * TURN;
    cairn_real off = (dx * dx + dy * dy) / (x->sigma * x->sigma) +
                     turned * turned / (x->sigma_angle * x->sigma_angle);
    cairn_pose pose = {at.x + dx, at.y + dy, at.theta};

    keep_find(x, pose, (cairn_real)votes / 2 - off / 2);
}

/* The shifts that have found most votes at one turn: some, and after the last of them the next
 * turn. */
static int32_t count_votes(cairn_aligner *x, cairn_pose at, int32_t width)
{
    int32_t stride = stride_of(x), units = 1, begin = x->k;

    for (; x->k < width * width && units + (x->k - begin) / CELLS_OF_UNIT < UNITS_OF_COUNT;
         x->k++) {
        int32_t votes = x->votes[x->k] * stride;

        if (votes <= LEAST_VOTES - stride)
            continue;
        take_votes(x, at, x->k, width, votes);
        units += FIND_COST;
    }
    units += (x->k - begin) / CELLS_OF_UNIT;
    if (x->k == width * width) {
        x->turn++;
        x->k = x->l = 0;
    }
    return units;
}

/* All shifts at one turn: votes of some points, or, when all have voted, a look at some of the
 * votes. */
static int32_t search_turn(cairn_aligner *x)
{
    int32_t width = 2 * x->half_window + 1, first = x->scans[x->i].first_point + x->l,
            last = x->scans[x->i].end_point;
    int32_t stride = stride_of(x), end = first + stride * (1 + VOTES_OF_ITEM / (width * width)),
            voted;
    cairn_pose at = x->predicted;

    if (x->turn > x->turns) {
        x->phase = ALIGNER_TRY;
        return 1;
    }
    at.theta = cairn_wrap_angle(at.theta + (cairn_real)x->turn * TURN);
    if (first >= last)
        return count_votes(x, at, width);
    if (x->l == 0)
        memset(x->votes, 0, (size_t)width * (size_t)width * sizeof *x->votes);
    end = end < last ? end : last;
    vote(x, cairn_transform_of(at), width, first, end);
    x->l += end - first;
    voted = (end - first + stride - 1) / stride;
    return 1 + voted + voted * width * width / VOTES_OF_UNIT;
}

/* The best of the finds, and the best score of another place. */
static void take_find(cairn_aligner *x)
{
    cairn_real score = x->look.evidence + x->look.prior;
    cairn_transform found = cairn_aligner_compose(x->look.pose, x->poses[x->i]);
    cairn_transform best = cairn_aligner_compose(x->best, x->poses[x->i]);
    int same = x->best_score > -CAIRN_REAL_MAX &&
               cairn_aligner_near(found, best, CAIRN_REAL(0.15), CAIRN_REAL(0.9986));

    if (score > x->best_score) {
        x->rest = same ? x->rest : x->best_score;
        x->best_score = score;
        x->best = x->look.pose;
    } else if (!same) {
        x->rest = cairn_max(x->rest, score);
    }
}

/* Tries the finds, poses of the scan at hand, one by one; what moves with it is the scan alone
 * or its whole cluster. */
static int32_t try_find(cairn_aligner *x)
{
    cairn_transform found;

    if (x->find_at > 0)
        take_find(x);
    if (x->find_at == x->find_count) {
        x->phase = ALIGNER_PLACE;
        return 1;
    }
    found = cairn_transform_of(x->find[x->find_at++].pose);
    cairn_aligner_begin_look(x, x->moving, x->largest,
                             cairn_aligner_compose(found, cairn_aligner_inverse(x->poses[x->i])),
                             TRY_ROUNDS, HOPELESS);
    return 1;
}

/* 1 when the best find is to be taken. */
static int is_better(const cairn_aligner *x)
{
    if (x->moving != x->scan_count)
        return x->best_score > JOINED && x->best_score > x->rest + CLEARLY;
    if (x->home >= 0)
        return x->best_score > (x->clusters[x->home].size > 0 ? TORN_OFF : ATTACHED);
    return x->best_score > x->before_score + BETTER &&
           !cairn_aligner_near(x->best, x->before, CAIRN_REAL(0.1), CAIRN_REAL(0.9994));
}

static int32_t place(cairn_aligner *x)
{
    int32_t rest = x->largest;
    int better = is_better(x);

    if (x->moving != x->scan_count) {
        if (better)
            (void)cairn_aligner_join(x, x->moving, rest, x->best);
    } else {
        cairn_aligner_put_back(x, better || x->home < 0 ? rest : x->home,
                               better ? x->best : x->before);
        if (better) {
            memset(&x->scans[x->i].pull, 0, sizeof x->scans[x->i].pull);
            x->scans[x->i].stirred = ALIGNER_JOINED;
            x->scans[x->i].joined = x->changes;
        }
    }
    x->scans[x->i].evidence = 0;
    x->changed += better;
    x->result.moved += better;
    x->i++;
    x->phase = ALIGNER_REPAIR;
    return 1;
}

int32_t cairn_aligner_repair_item(cairn_aligner *x)
{
    switch (x->phase) {
    case ALIGNER_REPAIR:
        return choose_scan(x);
    case ALIGNER_DRAW:
        return draw(x);
    case ALIGNER_SEARCH:
        return search_turn(x);
    case ALIGNER_TRY:
        return try_find(x);
    default:
        return place(x);
    }
}
