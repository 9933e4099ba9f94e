/* aligner: relocalization of scans that fit badly, or nowhere, against all others (correlative
 * matching on a raster).
 *
 * Method:
 * 1. The largest cluster is drawn into a raster about the predicted pose: a bit for each surface
 *    direction, one for free space.
 * 2. For every rotation, all translations within the window are scored by votes: one per point on a
 *    surface of its direction, minus two per point in free space.
 * 3. The best peaks, after non-maximum suppression, are refined and compared by their
 *    log-likelihood ratio, also with the previous pose.
 * 4. All scans are searched once, later the badly fitting ones. In a warm start the initial poses
 *    come from methods that align walls in parallel: fewer rotations and every second point.
 * 5. A smaller cluster is relocalized as a whole, by each of its scans; in the last round its scans
 *    one by one. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/aligner_work.h"

enum { DIRECTION_BITS = 15, FREE_CELL = 1 << DIRECTION_BITS, REFINEMENT_ROUNDS = 3 };
/* Per item of the search: votes, and cells whose votes are counted. */
enum {
    VOTES_PER_ITEM = 2400,
    VOTES_PER_UNIT = 24,
    CELLS_PER_UNIT = 16,
    UNITS_PER_PEAK = 3,
    MAX_COUNT_UNITS = 100
};

/* Least votes of a peak, in half points; in a warm start every second point votes, with double
 * weight, and a peak may have one vote less. */
enum { MIN_VOTES = 3, WARM_START_STRIDE = 2 };

/* m: least side of a raster cell */
static const cairn_real MIN_CELL_M = CAIRN_REAL(0.1);
/* m: margin before a surface that is not drawn free */
static const cairn_real CLEARANCE_M = CAIRN_REAL(0.2);
/* rad: rotation step, 2 degrees */
static const cairn_real ROTATION_STEP_RAD = CAIRN_REAL(0.0349);
/* standard deviations: half size of the search window */
static const cairn_real WINDOW_SIGMAS = CAIRN_REAL(2.2);
/* factor on the params' error bounds: greatest window */
static const cairn_real MAX_WINDOW_FACTOR = CAIRN_REAL(1.875);
/* factor on the rotations in a warm start */
static const cairn_real WARM_START_ROTATIONS = CAIRN_REAL(0.4);
/* nats: thresholds of the log-likelihood ratio */
static const cairn_real WELL_PLACED_NATS = 10, CERTAIN_NATS = 40, MIN_GAIN_NATS = 2,
                        MIN_ATTACHED_NATS = -2, MIN_DETACHED_NATS = 4, MIN_MERGED_NATS = 4,
                        MIN_MARGIN_NATS = 3, MIN_NATS = -40;

/* ---- Selection of the scan ---- */

static cairn_transform single(void)
{
    cairn_transform same = {0, 0, 1, 0};

    return same;
}

static int are_duplicates(cairn_pose a, cairn_pose b)
{
    cairn_real dx = cairn_abs(a.x - b.x), dy = cairn_abs(a.y - b.y);
    cairn_real turn = cairn_abs(cairn_wrap_angle(a.theta - b.theta));

    return cairn_max(dx, dy) / CAIRN_REAL(0.25) + turn / CAIRN_REAL(0.12) < 1;
}

/* Inserts a peak, with non-maximum suppression. */
static void insert_peak(cairn_aligner *aligner, cairn_pose pose, cairn_real score)
{
    int32_t to = -1, end = 0;

    for (int32_t i = 0; i < aligner->move.peak_count; i++)
        if (are_duplicates(aligner->move.peaks[i].pose, pose)) {
            if (aligner->move.peaks[i].score >= score)
                return;
            to = to < 0 ? i : to;
        }
    if (to < 0) {
        if (aligner->move.peak_count < ALIGNER_MAX_PEAKS) {
            to = aligner->move.peak_count++;
        } else {
            to = 0;
            for (int32_t i = 1; i < aligner->move.peak_count; i++)
                if (aligner->move.peaks[i].score < aligner->move.peaks[to].score)
                    to = i;
            if (aligner->move.peaks[to].score >= score)
                return;
        }
    }
    aligner->move.peaks[to].pose = pose;
    aligner->move.peaks[to].score = score;
    for (int32_t i = 0; i < aligner->move.peak_count; i++)
        if (i == to || !are_duplicates(aligner->move.peaks[i].pose, pose))
            aligner->move.peaks[end++] = aligner->move.peaks[i];
    aligner->move.peak_count = end;
}

/* Predicts the scan's pose by the gauge of the rest, and sets up the raster about it. */
static void predict(cairn_aligner *aligner, int32_t rest)
{
    const aligner_scan *scan = &aligner->scans[aligner->cursor.scan];
    cairn_transform gauge = cairn_transform_inverse(cairn_aligner_gauge(aligner, rest));
    cairn_real factor = cairn_sqrt(1 / (cairn_real)aligner->clusters[aligner->move.moving].size +
                                   1 / (cairn_real)aligner->clusters[rest].size);
    cairn_real window = cairn_min(WINDOW_SIGMAS * aligner->sigma * factor,
                                  MAX_WINDOW_FACTOR * aligner->params.max_initial_error);
    cairn_real turned = cairn_min(WINDOW_SIGMAS * aligner->sigma_angle * factor,
                                  MAX_WINDOW_FACTOR * aligner->params.max_initial_angle_error);
    cairn_real half = scan->radius + cairn_vec2_norm(scan->middle) + window + CAIRN_REAL(0.3);
    int32_t most = cairn_real_to_int(cairn_sqrt((cairn_real)aligner->params.max_cells)),
            most_window = most / 4 - 1;

    if (aligner->move.moving == aligner->scan_count)
        gauge = cairn_transform_compose(gauge, cairn_transform_of(scan->initial));
    else
        gauge = cairn_transform_compose(
            gauge, cairn_transform_compose(cairn_aligner_gauge(aligner, aligner->move.moving),
                                           aligner->poses[aligner->cursor.scan]));
    aligner->move.predicted = cairn_pose_of(gauge);
    aligner->raster.cell = cairn_max(MIN_CELL_M, 2 * half / (cairn_real)(most - 1));
    aligner->raster.side = cairn_real_to_int(cairn_ceil(2 * half / aligner->raster.cell));
    aligner->raster.half_window = cairn_real_to_int(
        cairn_min(cairn_ceil(window / aligner->raster.cell), (cairn_real)most_window));
    if (aligner->is_warm_start)
        turned *= WARM_START_ROTATIONS;
    aligner->raster.turns =
        cairn_real_to_int(cairn_ceil(cairn_min(turned, CAIRN_PI) / ROTATION_STEP_RAD));
    aligner->raster.corner.x =
        aligner->move.predicted.x - (cairn_real)aligner->raster.side * aligner->raster.cell / 2;
    aligner->raster.corner.y =
        aligner->move.predicted.y - (cairn_real)aligner->raster.side * aligner->raster.cell / 2;
    memset(aligner->cells, 0,
           (size_t)aligner->raster.side * (size_t)aligner->raster.side * sizeof *aligner->cells);
    aligner->cursor.neighbour = aligner->cursor.item = aligner->cursor.inner = 0;
    aligner->raster.turn = -aligner->raster.turns;
    aligner->move.peak_count = aligner->move.peak_index = 0;
    insert_peak(aligner, aligner->move.predicted, 0);
    aligner->move.best_score = aligner->move.second_best_score = -CAIRN_REAL_MAX;
}

/* Removes the scan from its cluster for the search; returns 0 when no search is needed. */
static int remove_for_search(cairn_aligner *aligner)
{
    int32_t rest = cairn_aligner_largest(aligner),
            home = aligner->scans[aligner->cursor.scan].cluster,
            points = cairn_aligner_points_of(aligner, aligner->cursor.scan);

    aligner->move.largest = rest;
    aligner->move.home = home == rest ? -1 : home;
    if (points == 0 || aligner->clusters[rest].size < 3 ||
        (aligner->move.home < 0 &&
         aligner->scans[aligner->cursor.scan].log_likelihood_ratio > CERTAIN_NATS))
        return 0;
    aligner->move.previous_pose = aligner->poses[aligner->cursor.scan];
    aligner->move.moving = home;
    if (aligner->move.home >= 0 && aligner->clusters[home].size > 1 &&
        aligner->relocalization_rounds + 1 < aligner->params.max_relocalizations)
        return 1;
    aligner->move.moving = aligner->scan_count;
    cairn_aligner_remove(aligner, aligner->cursor.scan);
    aligner->poses[aligner->cursor.scan] = single();
    cairn_aligner_insert(aligner, aligner->cursor.scan, aligner->scan_count);
    cairn_aligner_estimate_sigmas(aligner);
    return 1;
}

void cairn_aligner_put_back(cairn_aligner *aligner, int32_t cluster, cairn_transform pose)
{
    cairn_aligner_remove(aligner, aligner->cursor.scan);
    aligner->poses[aligner->cursor.scan] = pose;
    cairn_aligner_insert(aligner, aligner->cursor.scan, cluster);
}

static void end_round(cairn_aligner *aligner)
{
    aligner->relocalization_rounds++;
    if (aligner->is_warm_start && aligner->changed_scans > 0)
        aligner->result.verdict = CAIRN_ALIGNER_RUNNING;
    if (aligner->is_warm_start && aligner->result.verdict != CAIRN_ALIGNER_RUNNING) {
        aligner->has_ended = 1;
        aligner->phase = ALIGNER_DONE;
        return;
    }
    /* All scans once; later those that were relocalized, and their neighbours. */
    cairn_aligner_begin_relax(aligner, cairn_aligner_largest(aligner), CAIRN_REAL(0.07), 5,
                              !aligner->is_warm_start && aligner->relocalization_rounds == 1);
    if (aligner->changed_scans == 0 ||
        aligner->relocalization_rounds >= aligner->params.max_relocalizations) {
        aligner->phase = ALIGNER_SORT_SEGMENTS;
        aligner->joint.round = aligner->cursor.stage = aligner->joint.at = 0;
        return;
    }
    cairn_aligner_begin_merging(aligner, 1);
}

static int32_t choose_scan(cairn_aligner *aligner)
{
    if (aligner->cursor.scan == aligner->scan_count || aligner->params.max_relocalizations == 0) {
        end_round(aligner);
        return 1;
    }
    if ((aligner->is_warm_start && aligner->scans[aligner->cursor.scan].was_placed) ||
        !remove_for_search(aligner)) {
        aligner->cursor.scan++;
        return 1 + aligner->scan_count / 16;
    }
    aligner->move.before_score = -CAIRN_REAL_MAX;
    if (aligner->move.home < 0)
        cairn_aligner_begin_evaluation(aligner, aligner->scan_count, aligner->move.largest,
                                       aligner->move.previous_pose, 0, -CAIRN_REAL_MAX);
    aligner->phase = ALIGNER_DRAW_RASTER;
    aligner->cursor.stage = 0;
    return 1;
}

/* ---- The raster ---- */

static int32_t direction_bin(cairn_vec2 direction, cairn_real *rest)
{
    cairn_real place =
        cairn_atan2(direction.y, direction.x) * (DIRECTION_BITS / (2 * CAIRN_PI)) + DIRECTION_BITS;
    cairn_real whole = cairn_floor(place);

    *rest = place - whole;
    return (int32_t)((uint32_t)cairn_real_to_int(whole) % DIRECTION_BITS);
}

/* Returns the bits of the directions within about 20 degrees. */
static int32_t direction_bits(cairn_vec2 direction)
{
    cairn_real rest;
    int32_t bin = direction_bin(direction, &rest),
            bits = 1 << bin | 1 << (bin + 1) % DIRECTION_BITS;

    if (rest < CAIRN_REAL(0.3))
        bits |= 1 << (bin + DIRECTION_BITS - 1) % DIRECTION_BITS;
    if (rest > CAIRN_REAL(0.7))
        bits |= 1 << (bin + 2) % DIRECTION_BITS;
    return bits;
}

/* Returns the cells of a ray until it enters 0 ... side along one axis. */
static cairn_real cells_to(cairn_real from, cairn_real step, cairn_real side)
{
    if (from < 0)
        return step > 0 ? -from / step : CAIRN_REAL_MAX;
    if (from >= side)
        return step < 0 ? (side - from) / step : CAIRN_REAL_MAX;
    return 0;
}

/* Draws the cells of one ray from `from` on, cells first ... last - 1; returns their number. */
static int32_t draw_ray(cairn_aligner *aligner, cairn_vec2 from, cairn_vec2 step, int32_t first,
                        int32_t last)
{
    cairn_real side = (cairn_real)aligner->raster.side;
    cairn_real enter = cairn_max(cells_to(from.x, step.x, side), cells_to(from.y, step.y, side));
    int32_t k = enter > (cairn_real)first ? cairn_real_to_int(cairn_ceil(enter)) : first, begin = k;
    cairn_vec2 p;

    if (k >= last)
        return 0;
    p = cairn_vec2_add(from, cairn_vec2_scale(step, (cairn_real)k));
    for (; k < last && p.x >= 0 && p.y >= 0 && p.x < side && p.y < side; k++) {
        int32_t at = (int32_t)p.y * aligner->raster.side + (int32_t)p.x;

        aligner->cells[at] = (uint16_t)(aligner->cells[at] | FREE_CELL);
        p = cairn_vec2_add(p, step);
    }
    return k - begin;
}

/* Draws the free space of scan j along its bearings, near the sensor along every second or fourth;
 * returns units. */
static int32_t draw_free(cairn_aligner *aligner, int32_t j)
{
    /* in cells: bearings are a cell apart from there on */
    static const int32_t first[4] = {0, 45, 22, 45};
    const aligner_view *view = &aligner->views[j];
    cairn_vec2 sensor = cairn_transform_point(aligner->poses[j], aligner->scans[j].sensor);
    cairn_vec2 from = {(sensor.x - aligner->raster.corner.x) / aligner->raster.cell,
                       (sensor.y - aligner->raster.corner.y) / aligner->raster.cell};
    cairn_real cells = view->visibility.step / aligner->raster.cell;
    int32_t work = 0;

    for (int32_t bin = 0; bin < ALIGNER_VIEW_BINS; bin++) {
        uint16_t before = view->range[(bin - 1) & (ALIGNER_VIEW_BINS - 1)];
        uint16_t least = view->range[bin], after = view->range[(bin + 1) & (ALIGNER_VIEW_BINS - 1)];
        int32_t steps;

        least = before < least ? before : least;
        least = after < least ? after : least;
        if (least == 0)
            continue;
        steps = cairn_real_to_int((cairn_real)least * cells - CLEARANCE_M / aligner->raster.cell);
        work += 2;
        if (steps > first[bin & 3])
            work += 2 + draw_ray(aligner, from,
                                 cairn_transform_direction(
                                     aligner->poses[j],
                                     cairn_visibility_direction(bin, ALIGNER_VIEW_BINS)),
                                 first[bin & 3], steps);
    }
    return 8 + work / 16;
}

/* Draws the points of scan j, each with its neighbouring cells; a surface is never free. */
static int32_t draw_points(cairn_aligner *aligner, int32_t j)
{
    int32_t side = aligner->raster.side, segment = -1, bits = 0;

    for (int32_t i = aligner->scans[j].first_point; i < aligner->scans[j].end_point; i++) {
        const aligner_point *point = &aligner->points[i];
        cairn_vec2 p = cairn_transform_point(aligner->poses[j], point->position);
        int32_t ix =
            cairn_real_to_int(cairn_floor((p.x - aligner->raster.corner.x) / aligner->raster.cell));
        int32_t iy =
            cairn_real_to_int(cairn_floor((p.y - aligner->raster.corner.y) / aligner->raster.cell));

        if (point->segment != segment) {
            cairn_vec2 direction = cairn_transform_direction(
                aligner->poses[j], aligner->segments[point->segment].direction);

            segment = point->segment;
            bits = direction_bits(direction);
            if (!aligner->params.oriented)
                bits |= direction_bits(cairn_vec2_scale(direction, -1));
        }
        for (int32_t v = iy > 0 ? iy - 1 : 0; v <= iy + 1 && v < side; v++)
            for (int32_t u = ix > 0 ? ix - 1 : 0; u <= ix + 1 && u < side; u++)
                aligner->cells[v * side + u] =
                    (uint16_t)((aligner->cells[v * side + u] & ~FREE_CELL) | bits);
    }
    return 4 + cairn_aligner_points_of(aligner, j) / ALIGNER_POINTS_PER_UNIT;
}

/* Returns 1 when scan j may overlap the search window of the current scan. */
static int is_drawn(const cairn_aligner *aligner, int32_t j)
{
    const aligner_scan *scan = &aligner->scans[aligner->cursor.scan], *other = &aligner->scans[j];
    cairn_vec2 middle = cairn_transform_point(aligner->poses[j], other->middle);
    cairn_real window = (cairn_real)aligner->raster.half_window * aligner->raster.cell;
    cairn_real far = scan->radius + cairn_vec2_norm(scan->middle) + other->radius + window;

    return cairn_abs(middle.x - aligner->move.predicted.x) <= far &&
           cairn_abs(middle.y - aligner->move.predicted.y) <= far &&
           cairn_aligner_may_see(scan, cairn_transform_of(aligner->move.predicted),
                                 (cairn_real)aligner->raster.turns * ROTATION_STEP_RAD, middle,
                                 other->radius + window * CAIRN_REAL(1.5));
}

/* Draws one scan of the rest: first the free space of all, then the points of all. */
static int32_t draw(cairn_aligner *aligner)
{
    int32_t rest = aligner->move.largest, passed = 0, count, j = 0;

    if (aligner->cursor.stage == 0) {
        if (aligner->move.home < 0) {
            aligner->move.before_score =
                aligner->evaluation.log_likelihood_ratio + aligner->evaluation.log_prior;
            aligner->scans[aligner->cursor.scan].log_likelihood_ratio =
                aligner->evaluation.log_likelihood_ratio;
            if (aligner->evaluation.log_likelihood_ratio >
                (aligner->relocalization_rounds > 0 ? WELL_PLACED_NATS : CERTAIN_NATS)) {
                cairn_aligner_put_back(aligner, rest, aligner->move.previous_pose);
                aligner->cursor.scan++;
                aligner->phase = ALIGNER_RELOCALIZE;
                return 1;
            }
        }
        predict(aligner, rest);
        aligner->cursor.stage = 1;
        return 4 + aligner->raster.side * aligner->raster.side / 256 +
               aligner->clusters[rest].size / 4;
    }
    count = aligner->scans[aligner->cursor.scan].neighbour_count;
    if (aligner->cursor.neighbour == count) {
        aligner->phase = aligner->cursor.item == 1 ? ALIGNER_SEARCH : aligner->phase;
        aligner->cursor.item = !aligner->cursor.item; /* all drawn: no votes have been counted */
        aligner->cursor.neighbour = 0;
        return 1;
    }
    for (; aligner->cursor.neighbour < count; aligner->cursor.neighbour++, passed++) {
        j = cairn_aligner_neighbour(aligner, aligner->cursor.scan, aligner->cursor.neighbour);
        if (aligner->scans[j].cluster == rest && is_drawn(aligner, j))
            break;
    }
    if (aligner->cursor.neighbour == count)
        return 1 + passed / ALIGNER_FAR_PAIRS_PER_UNIT;
    aligner->cursor.neighbour++;
    passed /= ALIGNER_FAR_PAIRS_PER_UNIT;
    if (aligner->cursor.item == 0)
        return passed + (aligner->params.free_space_penalty > 0 ? draw_free(aligner, j) : 1);
    return passed + draw_points(aligner, j);
}

/* ---- The search ---- */

/* Returns the stride over the voting points. */
static int32_t stride_of(const cairn_aligner *aligner)
{
    return aligner->is_warm_start ? WARM_START_STRIDE : 1;
}

/* Adds the votes of some points of the current scan. */
static void vote(cairn_aligner *aligner, cairn_transform pose, int32_t width, int32_t first,
                 int32_t end)
{
    int32_t side = aligner->raster.side;

    for (int32_t i = first; i < end; i += stride_of(aligner)) {
        const aligner_point *point = &aligner->points[i];
        cairn_vec2 p = cairn_transform_point(pose, point->position);
        cairn_vec2 direction =
            cairn_transform_direction(pose, aligner->segments[point->segment].direction);
        int32_t ix = cairn_real_to_int(
                         cairn_floor((p.x - aligner->raster.corner.x) / aligner->raster.cell)) -
                     aligner->raster.half_window;
        int32_t iy = cairn_real_to_int(
                         cairn_floor((p.y - aligner->raster.corner.y) / aligner->raster.cell)) -
                     aligner->raster.half_window;
        cairn_real rest;
        int32_t bin = direction_bin(direction, &rest),
                mask = 1 << (bin + (rest >= CAIRN_REAL(0.5))) % DIRECTION_BITS;

        if (ix < 0 || iy < 0 || ix + width > side || iy + width > side)
            continue;
        for (int32_t v = 0; v < width; v++) {
            const uint16_t *cell = &aligner->cells[(iy + v) * side + ix];
            int32_t *to = &aligner->votes[v * width];

            for (int32_t u = 0; u < width; u++)
                to[u] += (cell[u] & mask) != 0 ? 1 : -((cell[u] >> DIRECTION_BITS) << 1);
        }
    }
}

/* Inserts a peak of one rotation, its prior added. */
static void insert_vote_peak(cairn_aligner *aligner, cairn_pose at, int32_t cell, int32_t width,
                             int32_t votes)
{
    int32_t column = cell % width - aligner->raster.half_window,
            row = cell / width - aligner->raster.half_window;
    cairn_real dx = (cairn_real)column * aligner->raster.cell,
               dy = (cairn_real)row * aligner->raster.cell,
               turned = (cairn_real)aligner->raster.turn * ROTATION_STEP_RAD;
    cairn_real off = (dx * dx + dy * dy) / (aligner->sigma * aligner->sigma) +
                     turned * turned / (aligner->sigma_angle * aligner->sigma_angle);
    cairn_pose pose = {at.x + dx, at.y + dy, at.theta};

    insert_peak(aligner, pose, (cairn_real)votes / 2 - off / 2);
}

/* Tests some translations of one rotation for peaks; at the end starts the next rotation. */
static int32_t count_votes(cairn_aligner *aligner, cairn_pose at, int32_t width)
{
    int32_t stride = stride_of(aligner), units = 1, begin = aligner->cursor.item;

    for (; aligner->cursor.item < width * width &&
           units + (aligner->cursor.item - begin) / CELLS_PER_UNIT < MAX_COUNT_UNITS;
         aligner->cursor.item++) {
        int32_t votes = aligner->votes[aligner->cursor.item] * stride;

        if (votes <= MIN_VOTES - stride)
            continue;
        insert_vote_peak(aligner, at, aligner->cursor.item, width, votes);
        units += UNITS_PER_PEAK;
    }
    units += (aligner->cursor.item - begin) / CELLS_PER_UNIT;
    if (aligner->cursor.item == width * width) {
        aligner->raster.turn++;
        aligner->cursor.item = aligner->cursor.inner = 0;
    }
    return units;
}

/* One rotation: votes of some points, then tests of some translations. */
static int32_t search_turn(cairn_aligner *aligner)
{
    int32_t width = 2 * aligner->raster.half_window + 1,
            first = aligner->scans[aligner->cursor.scan].first_point + aligner->cursor.inner,
            last = aligner->scans[aligner->cursor.scan].end_point;
    int32_t stride = stride_of(aligner),
            end = first + stride * (1 + VOTES_PER_ITEM / (width * width)), voted;
    cairn_pose at = aligner->move.predicted;

    if (aligner->raster.turn > aligner->raster.turns) {
        aligner->phase = ALIGNER_TRY_PEAKS;
        return 1;
    }
    at.theta = cairn_wrap_angle(at.theta + (cairn_real)aligner->raster.turn * ROTATION_STEP_RAD);
    if (first >= last)
        return count_votes(aligner, at, width);
    if (aligner->cursor.inner == 0)
        memset(aligner->votes, 0, (size_t)width * (size_t)width * sizeof *aligner->votes);
    end = end < last ? end : last;
    vote(aligner, cairn_transform_of(at), width, first, end);
    aligner->cursor.inner += end - first;
    voted = (end - first + stride - 1) / stride;
    return 1 + voted + voted * width * width / VOTES_PER_UNIT;
}

/* Updates the best pose, and the best score of another pose. */
static void update_best(cairn_aligner *aligner)
{
    cairn_real score = aligner->evaluation.log_likelihood_ratio + aligner->evaluation.log_prior;
    cairn_transform found =
        cairn_transform_compose(aligner->evaluation.pose, aligner->poses[aligner->cursor.scan]);
    cairn_transform best =
        cairn_transform_compose(aligner->move.best_pose, aligner->poses[aligner->cursor.scan]);
    int same = aligner->move.best_score > -CAIRN_REAL_MAX &&
               cairn_aligner_is_near(found, best, CAIRN_REAL(0.15), CAIRN_REAL(0.9986));

    if (score > aligner->move.best_score) {
        aligner->move.second_best_score =
            same ? aligner->move.second_best_score : aligner->move.best_score;
        aligner->move.best_score = score;
        aligner->move.best_pose = aligner->evaluation.pose;
    } else if (!same) {
        aligner->move.second_best_score = cairn_max(aligner->move.second_best_score, score);
    }
}

/* Evaluates the peaks one by one; the scan alone or its whole cluster moves. */
static int32_t try_peak(cairn_aligner *aligner)
{
    cairn_transform found;

    if (aligner->move.peak_index > 0)
        update_best(aligner);
    if (aligner->move.peak_index == aligner->move.peak_count) {
        aligner->phase = ALIGNER_PLACE;
        return 1;
    }
    found = cairn_transform_of(aligner->move.peaks[aligner->move.peak_index++].pose);
    cairn_aligner_begin_evaluation(
        aligner, aligner->move.moving, aligner->move.largest,
        cairn_transform_compose(found,
                                cairn_transform_inverse(aligner->poses[aligner->cursor.scan])),
        REFINEMENT_ROUNDS, MIN_NATS);
    return 1;
}

/* Returns 1 when the best peak is accepted. */
static int is_better(const cairn_aligner *aligner)
{
    if (aligner->move.moving != aligner->scan_count)
        return aligner->move.best_score > MIN_MERGED_NATS &&
               aligner->move.best_score > aligner->move.second_best_score + MIN_MARGIN_NATS;
    if (aligner->move.home >= 0)
        return aligner->move.best_score > (aligner->clusters[aligner->move.home].size > 0
                                               ? MIN_DETACHED_NATS
                                               : MIN_ATTACHED_NATS);
    return aligner->move.best_score > aligner->move.before_score + MIN_GAIN_NATS &&
           !cairn_aligner_is_near(aligner->move.best_pose, aligner->move.previous_pose,
                                  CAIRN_REAL(0.1), CAIRN_REAL(0.9994));
}

static int32_t place(cairn_aligner *aligner)
{
    int32_t rest = aligner->move.largest;
    int better = is_better(aligner);

    if (aligner->move.moving != aligner->scan_count) {
        if (better)
            (void)cairn_aligner_merge_clusters(aligner, aligner->move.moving, rest,
                                               aligner->move.best_pose);
    } else {
        cairn_aligner_put_back(aligner,
                               better || aligner->move.home < 0 ? rest : aligner->move.home,
                               better ? aligner->move.best_pose : aligner->move.previous_pose);
        if (better) {
            memset(&aligner->scans[aligner->cursor.scan].normal_equations, 0,
                   sizeof aligner->scans[aligner->cursor.scan].normal_equations);
            aligner->scans[aligner->cursor.scan].relax_state = ALIGNER_RELAX_MERGED;
            aligner->scans[aligner->cursor.scan].merge_event = aligner->change_count;
        }
    }
    aligner->scans[aligner->cursor.scan].log_likelihood_ratio = 0;
    aligner->changed_scans += better;
    aligner->result.relocalized += better;
    aligner->cursor.scan++;
    aligner->phase = ALIGNER_RELOCALIZE;
    return 1;
}

int32_t cairn_aligner_relocalize_item(cairn_aligner *aligner)
{
    switch (aligner->phase) {
    case ALIGNER_RELOCALIZE:
        return choose_scan(aligner);
    case ALIGNER_DRAW_RASTER:
        return draw(aligner);
    case ALIGNER_SEARCH:
        return search_turn(aligner);
    case ALIGNER_TRY_PEAKS:
        return try_peak(aligner);
    default:
        return place(aligner);
    }
}
