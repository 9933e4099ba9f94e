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
/* Votes, and cells whose votes are counted; cells of a ray; cells that are cleared; scans. */
enum {
    VOTES_PER_ITEM = 2400,
    VOTES_PER_UNIT = 24,
    CELLS_PER_UNIT = 16,
    UNITS_PER_PEAK = 3,
    BEARINGS_PER_UNIT = 16,
    CLEARED_PER_UNIT = 256
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

/* ---- Peaks, and the selection of the scan ---- */

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
    aligner->move.peak_count = aligner->move.peak_index = 0;
    insert_peak(aligner, aligner->move.predicted, 0);
    aligner->move.best_score = aligner->move.second_best_score = -CAIRN_REAL_MAX;
}

static void clear_raster(cairn_aligner *aligner)
{
    memset(aligner->cells, 0,
           (size_t)aligner->raster.side * (size_t)aligner->raster.side * sizeof *aligner->cells);
}

/* Returns 0 when the current scan needs no search; sets which cluster moves: the scan's, or one of
 * the scan alone. */
static int is_searched(cairn_aligner *aligner)
{
    int32_t rest = cairn_aligner_largest(aligner), scan = aligner->cursor.scan,
            home = aligner->scans[scan].cluster;

    if (aligner->is_warm_start && aligner->scans[scan].was_anchored)
        return 0;
    aligner->move.largest = rest;
    aligner->move.home = home == rest ? -1 : home;
    if (cairn_aligner_points_of(aligner, scan) == 0 || aligner->clusters[rest].size < 3 ||
        (aligner->move.home < 0 && aligner->scans[scan].log_likelihood_ratio > CERTAIN_NATS))
        return 0;
    aligner->move.previous_pose = aligner->poses[scan];
    aligner->move.before_score = -CAIRN_REAL_MAX;
    aligner->move.moving = aligner->scan_count;
    if (aligner->move.home >= 0 && aligner->clusters[home].size > 1 &&
        aligner->relocalization_rounds + 1 < aligner->params.max_relocalizations)
        aligner->move.moving = home;
    return 1;
}

/* Returns 1 when the current scan is searched for alone. */
static int is_alone(const cairn_aligner *aligner)
{
    return aligner->move.moving == aligner->scan_count;
}

void cairn_aligner_put_back(cairn_aligner *aligner, int32_t cluster, cairn_transform pose)
{
    cairn_aligner_remove(aligner, aligner->cursor.scan);
    aligner->poses[aligner->cursor.scan] = pose;
    cairn_aligner_insert(aligner, aligner->cursor.scan, cluster);
}

void cairn_aligner_take_out(cairn_aligner *aligner)
{
    static const cairn_transform same = {0, 0, 1, 0};

    cairn_aligner_put_back(aligner, aligner->scan_count, same);
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

/* Starts the ray of the current bearing of the current scan; without cells in the raster it has
 * none. Near the sensor only every second or fourth bearing is drawn. */
static void begin_ray(cairn_aligner *aligner)
{
    /* in cells: bearings are a cell apart from there on */
    static const int32_t first[4] = {0, 45, 22, 45};
    aligner_raster *raster = &aligner->raster;
    int32_t j = raster->scan, bin = raster->bearing;
    const aligner_view *view = &aligner->views[j];
    uint16_t before = view->range[(bin - 1) & (ALIGNER_VIEW_BINS - 1)];
    uint16_t least = view->range[bin], after = view->range[(bin + 1) & (ALIGNER_VIEW_BINS - 1)];
    cairn_real cells = view->visibility.step / raster->cell, side = (cairn_real)raster->side, enter;
    cairn_vec2 from;

    least = before < least ? before : least;
    least = after < least ? after : least;
    raster->at = first[bin & 3];
    raster->last =
        least == 0 ? 0 : cairn_real_to_int((cairn_real)least * cells - CLEARANCE_M / raster->cell);
    if (raster->at >= raster->last)
        return;
    from = cairn_transform_point(aligner->poses[j], aligner->scans[j].sensor);
    from.x = (from.x - raster->corner.x) / raster->cell;
    from.y = (from.y - raster->corner.y) / raster->cell;
    raster->step = cairn_transform_direction(aligner->poses[j],
                                             cairn_visibility_direction(bin, ALIGNER_VIEW_BINS));
    enter =
        cairn_max(cells_to(from.x, raster->step.x, side), cells_to(from.y, raster->step.y, side));
    if (enter > (cairn_real)raster->at)
        raster->at = cairn_real_to_int(cairn_ceil(enter));
    raster->place = cairn_vec2_add(from, cairn_vec2_scale(raster->step, (cairn_real)raster->at));
}

/* Draws some cells of the ray; none is left when it leaves the raster. */
CAIRN_STEP_NOT_INLINED static void draw_cells(cairn_aligner *aligner)
{
    aligner_raster *raster = &aligner->raster;
    cairn_vec2 p = raster->place;
    cairn_real side = (cairn_real)raster->side;
    int32_t end =
        raster->at + CELLS_PER_UNIT < raster->last ? raster->at + CELLS_PER_UNIT : raster->last;

    for (; raster->at < end; raster->at++) {
        int32_t at;

        if (!(p.x >= 0 && p.y >= 0 && p.x < side && p.y < side)) {
            raster->last = raster->at;
            break;
        }
        at = (int32_t)p.y * raster->side + (int32_t)p.x;
        aligner->cells[at] = (uint16_t)(aligner->cells[at] | FREE_CELL);
        p = cairn_vec2_add(p, raster->step);
    }
    raster->place = p;
}

/* Step: draws the free space of the current scan along its bearings. */
static int draw_free(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_raster *raster = &aligner->raster;

    CAIRN_STEP_BEGIN(aligner->resume.item);
    ALIGNER_CHARGE(item, ALIGNER_VIEW_BINS / BEARINGS_PER_UNIT);
    for (raster->bearing = 0; raster->bearing < ALIGNER_VIEW_BINS; raster->bearing++) {
        begin_ray(aligner);
        while (raster->at < raster->last) {
            ALIGNER_CHARGE(item, 1);
            draw_cells(aligner);
        }
    }
    CAIRN_STEP_END(aligner->resume.item);
}

/* Draws the points of scan j, each with its neighbouring cells; a surface is never free. */
static void draw_points(cairn_aligner *aligner, int32_t j)
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

/* Step: draws the scans of the rest: first the free space of all, then the points of all. */
static int draw(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_cursor *cursor = &aligner->cursor;
    aligner_raster *raster = &aligner->raster;

    CAIRN_STEP_BEGIN(aligner->resume.part);
    ALIGNER_CHARGE(part, 4 + aligner->clusters[aligner->move.largest].size / 4);
    predict(aligner, aligner->move.largest);
    ALIGNER_CHARGE(part, raster->side * raster->side / CLEARED_PER_UNIT);
    clear_raster(aligner);
    for (cursor->item = 0; cursor->item < 2; cursor->item++) {
        ALIGNER_CHARGE(part, cairn_aligner_passing_units(aligner, cursor->scan));
        for (cursor->neighbour = 0;
             cursor->neighbour < aligner->scans[cursor->scan].neighbour_count;
             cursor->neighbour++) {
            raster->scan = cairn_aligner_neighbour(aligner, cursor->scan, cursor->neighbour);
            if (aligner->scans[raster->scan].cluster != aligner->move.largest ||
                !is_drawn(aligner, raster->scan))
                continue;
            if (cursor->item == 0) {
                if (aligner->params.free_space_penalty > 0)
                    CAIRN_STEP_RUN(aligner, resume.part, budget, draw_free);
                continue;
            }
            ALIGNER_CHARGE(part, 4 + cairn_aligner_points_of(aligner, raster->scan) /
                                         ALIGNER_POINTS_PER_UNIT);
            draw_points(aligner, raster->scan);
        }
    }
    CAIRN_STEP_END(aligner->resume.part);
}

/* ---- The search ---- */

/* Returns the stride over the voting points. */
static int32_t stride_of(const cairn_aligner *aligner)
{
    return aligner->is_warm_start ? WARM_START_STRIDE : 1;
}

/* Returns the translations along one axis. */
static int32_t width_of(const cairn_aligner *aligner)
{
    return 2 * aligner->raster.half_window + 1;
}

/* Returns the predicted pose, rotated by the current turn. */
static cairn_pose turned_pose(const cairn_aligner *aligner)
{
    cairn_pose at = aligner->move.predicted;

    at.theta = cairn_wrap_angle(at.theta + (cairn_real)aligner->raster.turn * ROTATION_STEP_RAD);
    return at;
}

/* Returns the next points that vote together, skipped ones included. */
static int32_t voting_points(const cairn_aligner *aligner)
{
    int32_t width = width_of(aligner),
            left = aligner->scans[aligner->cursor.scan].end_point - aligner->cursor.item,
            most = stride_of(aligner) * (1 + VOTES_PER_ITEM / (width * width));

    return most < left ? most : left;
}

static int32_t voting_units(const cairn_aligner *aligner)
{
    int32_t width = width_of(aligner), stride = stride_of(aligner),
            voted = (voting_points(aligner) + stride - 1) / stride;

    return 1 + voted + voted * width * width / VOTES_PER_UNIT;
}

static void clear_votes(cairn_aligner *aligner)
{
    size_t width = (size_t)width_of(aligner);

    memset(aligner->votes, 0, width * width * sizeof *aligner->votes);
}

/* Adds the votes of some points of the current scan. */
CAIRN_STEP_NOT_INLINED static void vote(cairn_aligner *aligner)
{
    cairn_transform pose = cairn_transform_of(turned_pose(aligner));
    int32_t side = aligner->raster.side, width = width_of(aligner),
            end = aligner->cursor.item + voting_points(aligner);

    for (int32_t i = aligner->cursor.item; i < end; i += stride_of(aligner)) {
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
    aligner->cursor.item = end;
}

/* Advances to the next translation with votes for a peak, one unit of them at most. Returns 1 at
 * such a translation. */
CAIRN_STEP_NOT_INLINED static int find_votes(cairn_aligner *aligner)
{
    int32_t width = width_of(aligner), stride = stride_of(aligner), at = aligner->cursor.item,
            end = at + CELLS_PER_UNIT - at % CELLS_PER_UNIT;

    end = end < width * width ? end : width * width;
    while (at < end && aligner->votes[at] * stride <= MIN_VOTES - stride)
        at++;
    aligner->cursor.item = at;
    return at < end;
}

/* Inserts a peak of one rotation, its prior added. */
static void insert_vote_peak(cairn_aligner *aligner)
{
    cairn_pose at = turned_pose(aligner);
    int32_t cell = aligner->cursor.item++, width = width_of(aligner),
            votes = aligner->votes[cell] * stride_of(aligner);
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

/* Step: all rotations: the votes of the points, then the peaks among the translations. */
static int search(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_cursor *cursor = &aligner->cursor;
    aligner_raster *raster = &aligner->raster;

    CAIRN_STEP_BEGIN(aligner->resume.part);
    for (raster->turn = -raster->turns; raster->turn <= raster->turns; raster->turn++) {
        ALIGNER_CHARGE(part, width_of(aligner) * width_of(aligner) / CLEARED_PER_UNIT);
        clear_votes(aligner);
        for (cursor->item = aligner->scans[cursor->scan].first_point;
             cursor->item < aligner->scans[cursor->scan].end_point;) {
            ALIGNER_CHARGE(part, voting_units(aligner));
            vote(aligner);
        }
        for (cursor->item = 0; cursor->item < width_of(aligner) * width_of(aligner);) {
            ALIGNER_CHARGE_EVERY(part, CELLS_PER_UNIT, cursor->item);
            if (!find_votes(aligner))
                continue;
            ALIGNER_CHARGE(part, UNITS_PER_PEAK);
            insert_vote_peak(aligner);
        }
    }
    CAIRN_STEP_END(aligner->resume.part);
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

/* Starts the evaluation of the current peak; the scan alone or its whole cluster moves. */
static void begin_peak(cairn_aligner *aligner)
{
    cairn_transform found = cairn_transform_of(aligner->move.peaks[aligner->move.peak_index].pose);

    cairn_aligner_begin_evaluation(
        aligner, aligner->move.moving, aligner->move.largest,
        cairn_transform_compose(found,
                                cairn_transform_inverse(aligner->poses[aligner->cursor.scan])),
        REFINEMENT_ROUNDS, MIN_NATS);
}

/* Step: evaluates the peaks one by one. */
static int try_peaks(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_move *move = &aligner->move;

    CAIRN_STEP_BEGIN(aligner->resume.part);
    for (move->peak_index = 0; move->peak_index < move->peak_count; move->peak_index++) {
        ALIGNER_CHARGE(part, 1);
        begin_peak(aligner);
        CAIRN_STEP_RUN(aligner, resume.part, budget, cairn_aligner_evaluate);
        update_best(aligner);
    }
    CAIRN_STEP_END(aligner->resume.part);
}

/* Returns 1 when the best peak is accepted. */
static int is_better(const cairn_aligner *aligner)
{
    if (!is_alone(aligner))
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

/* Places the scan, or its cluster, at the best peak if that is accepted. */
static void place(cairn_aligner *aligner)
{
    aligner_scan *scan = &aligner->scans[aligner->cursor.scan];
    int32_t rest = aligner->move.largest;
    int better = is_better(aligner);

    if (!is_alone(aligner)) {
        if (better)
            (void)cairn_aligner_merge_clusters(aligner, aligner->move.moving, rest,
                                               aligner->move.best_pose);
    } else {
        cairn_aligner_put_back(aligner,
                               better || aligner->move.home < 0 ? rest : aligner->move.home,
                               better ? aligner->move.best_pose : aligner->move.previous_pose);
        if (better) {
            memset(&scan->normal_equations, 0, sizeof scan->normal_equations);
            scan->relax_state = ALIGNER_RELAX_MERGED;
            scan->merge_event = aligner->change_count;
        }
    }
    scan->log_likelihood_ratio = 0;
    aligner->changed_scans += better;
    aligner->result.relocalized += better;
}

/* Starts the evaluation of the pose that the current scan had. */
static void begin_former_pose(cairn_aligner *aligner)
{
    cairn_aligner_begin_evaluation(aligner, aligner->scan_count, aligner->move.largest,
                                   aligner->move.previous_pose, 0, -CAIRN_REAL_MAX);
}

/* Returns 1, the scan back in its cluster, when its former pose fits well. */
static int stays(cairn_aligner *aligner)
{
    const aligner_evaluation *evaluation = &aligner->evaluation;

    aligner->move.before_score = evaluation->log_likelihood_ratio + evaluation->log_prior;
    aligner->scans[aligner->cursor.scan].log_likelihood_ratio = evaluation->log_likelihood_ratio;
    if (!(evaluation->log_likelihood_ratio >
          (aligner->relocalization_rounds > 0 ? WELL_PLACED_NATS : CERTAIN_NATS)))
        return 0;
    cairn_aligner_put_back(aligner, aligner->move.largest, aligner->move.previous_pose);
    return 1;
}

int cairn_aligner_relocalize(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_cursor *cursor = &aligner->cursor;

    CAIRN_STEP_BEGIN(aligner->resume.phase);
    aligner->changed_scans = 0;
    for (cursor->scan = 0;
         cursor->scan < aligner->scan_count && aligner->params.max_relocalizations > 0;
         cursor->scan++) {
        CAIRN_STEP_RUN(aligner, resume.phase, budget, cairn_aligner_charge_scans);
        if (!is_searched(aligner))
            continue;
        if (is_alone(aligner)) {
            cairn_aligner_take_out(aligner);
            CAIRN_STEP_RUN(aligner, resume.phase, budget, cairn_aligner_estimate_sigmas);
            if (aligner->move.home < 0) {
                begin_former_pose(aligner);
                CAIRN_STEP_RUN(aligner, resume.phase, budget, cairn_aligner_evaluate);
                if (stays(aligner))
                    continue;
            }
        }
        CAIRN_STEP_RUN(aligner, resume.phase, budget, draw);
        CAIRN_STEP_RUN(aligner, resume.phase, budget, search);
        CAIRN_STEP_RUN(aligner, resume.phase, budget, try_peaks);
        CAIRN_STEP_RUN(aligner, resume.phase, budget, cairn_aligner_charge_scans);
        place(aligner);
    }
    CAIRN_STEP_RUN(aligner, resume.phase, budget, cairn_aligner_charge_scans);
    aligner->relocalization_rounds++;
    CAIRN_STEP_END(aligner->resume.phase);
}
