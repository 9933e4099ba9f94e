/* The second structure of maps, where corners are few: the directions of their lines, and the walls
 * as such.
 *
 * Method. The directions of lines of both maps, weighted by length, are correlated on the
 * circle: its peaks are the rotations (Carpin 2008 does so with the spectra of Hough
 * transforms). In each rotation every translation is tried, two cells apart: points of each map,
 * turned beforehand, are shifted and looked up in the other; most translations end after the
 * first few points. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/map_merge_work.h"

/* Bins on each side over which a correlation is smoothed, and within which there is one peak. */
enum { SMOOTH = 2, APART = 8, LOOKS_PER_UNIT = 12 };

/* Cells within which a wall is felt. */
#define NEAR 5
/* Share of the highest peak that a rotation must have. */
#define LEAST_PEAK CAIRN_REAL(0.2)
/* Cells between translations. */
#define STRIDE CAIRN_REAL(2.0)
/* m: boxes of the points of both maps overlap at least by this. */
#define LEAST_OVERLAP CAIRN_REAL(0.5)
/* The difference of every pair of lines, in the bin of its angle. */
static cairn_status step_bins(cairn_map_merge *m, cairn_budget *budget)
{
    const merge_map *first = &m->maps[m->map], *second = &m->maps[m->other];

    for (; m->cursor < first->line_count; m->cursor++, m->inner = 0)
        for (; m->inner < second->line_count; m->inner++) {
            merge_way a = first->ways[m->cursor], b = second->ways[m->inner];
            cairn_real turn = (a.angle - b.angle) * (MERGE_BINS / (2 * CAIRN_PI));
            int32_t bin;

            if (m->inner % 4 == 0 && !cairn_budget_pay(budget, &m->paid, 1))
                return CAIRN_MORE;
            bin = cairn_real_to_int(cairn_rint(turn)) % MERGE_BINS;
            m->search.bins[bin < 0 ? bin + MERGE_BINS : bin] += cairn_min(a.length, b.length);
        }
    return CAIRN_OK;
}

static cairn_real smooth_bin(const cairn_real *bins, int32_t at)
{
    cairn_real sum = 0;

    for (int32_t i = -SMOOTH; i <= SMOOTH; i++)
        sum +=
            (cairn_real)(SMOOTH + 1 - (i < 0 ? -i : i)) * bins[(at + i + MERGE_BINS) % MERGE_BINS];
    return sum;
}

/* The weighted mean of a peak's bins. */
static cairn_real peak_angle(const cairn_real *bins, int32_t at)
{
    cairn_real sum = 0, moment = 0;

    for (int32_t i = -SMOOTH; i <= SMOOTH; i++) {
        cairn_real value = bins[(at + i + MERGE_BINS) % MERGE_BINS];

        sum += value;
        moment += value * (cairn_real)i;
    }
    return ((cairn_real)at + moment / sum) * (2 * CAIRN_PI / MERGE_BINS);
}

/* The highest peaks, by clearing the surroundings of each. */
static void find_peaks(cairn_map_merge *m)
{
    cairn_real highest = 0;

    m->search.count = 0;
    while (m->search.count < MERGE_TURNS_MOST) {
        int32_t best = 0;
        cairn_real value = 0;

        for (int32_t i = 0; i < MERGE_BINS; i++)
            if (smooth_bin(m->search.bins, i) > value) {
                value = smooth_bin(m->search.bins, i);
                best = i;
            }
        highest = cairn_max(highest, value);
        if (!(value > LEAST_PEAK * highest))
            return;
        m->search.turns[m->search.count++] = cairn_wrap_angle(peak_angle(m->search.bins, best));
        for (int32_t i = -APART; i <= APART; i++)
            m->search.bins[(best + i + MERGE_BINS) % MERGE_BINS] = 0;
    }
}

static cairn_vec2 in_cells(const merge_map *map, cairn_vec2 p)
{
    return cairn_vec2_scale(cairn_vec2_sub(p, map->corner), 1 / map->input.resolution);
}

/* Points of both maps turned, in cells of the other one's grid at translation 0. */
static void turn_points(cairn_map_merge *m, cairn_real turn)
{
    const merge_map *first = &m->maps[m->map], *second = &m->maps[m->other];
    cairn_box at = cairn_box_empty(), turned = cairn_box_empty();
    cairn_transform t = {0, 0, 1, 0}, back;
    int32_t n = MERGE_FIRST_POINTS;

    cairn_sincos(turn, &t.sine, &t.cosine);
    back = t;
    back.sine = -t.sine;
    m->search.wall = merge_search_wall(first, second);
    m->search.cosine = t.cosine;
    m->search.sine = t.sine;
    m->search.firsts = first->point_count < n ? first->point_count : n;
    m->search.seconds = second->point_count < n ? second->point_count : n;
    for (int32_t i = 0; i < m->search.firsts; i++) {

        at = cairn_box_extend(at, first->points[i].at);
        m->search.first[i] = in_cells(second, cairn_transform_point(back, first->points[i].at));
        m->search.first_front[i] =
            in_cells(second, cairn_transform_point(back, first->points[i].front));
    }
    for (int32_t i = 0; i < m->search.seconds; i++) {
        cairn_vec2 p = cairn_transform_point(t, second->points[i].at);

        turned = cairn_box_extend(turned, p);
        m->search.second[i] = in_cells(first, p);
        m->search.second_front[i] =
            in_cells(first, cairn_transform_point(t, second->points[i].front));
    }
    m->search.columns = m->search.rows = 0;
    if (m->search.firsts > 0 && m->search.seconds > 0) {
        cairn_real stride = STRIDE * first->input.resolution;

        m->search.shifts.min.x = at.min.x - turned.max.x + LEAST_OVERLAP;
        m->search.shifts.min.y = at.min.y - turned.max.y + LEAST_OVERLAP;
        m->search.shifts.max.x = at.max.x - turned.min.x - LEAST_OVERLAP;
        m->search.shifts.max.y = at.max.y - turned.min.y - LEAST_OVERLAP;
        m->search.columns =
            1 + cairn_real_to_int((m->search.shifts.max.x - m->search.shifts.min.x) / stride);
        m->search.rows =
            1 + cairn_real_to_int((m->search.shifts.max.y - m->search.shifts.min.y) / stride);
    }
}

/* Adds points begin ... end - 1, shifted by so many cells, in a grid. */
static void look(const cairn_map_merge *m, const merge_map *to, const cairn_vec2 *points,
                 const cairn_vec2 *fronts, cairn_vec2 shift, int32_t begin, int32_t end,
                 merge_sums *s)
{
    for (int32_t i = begin; i < end; i++) {
        uint16_t cell = merge_cell_at(to, points[i].x + shift.x, points[i].y + shift.y);
        int32_t d = merge_to_occupied(cell);

        if (merge_class(cell) == MERGE_UNKNOWN)
            continue;
        if (d > NEAR)
            s->against += merge_class(cell) == MERGE_FREE;
        else if (merge_class(merge_cell_at(to, fronts[i].x + shift.x, fronts[i].y + shift.y)) ==
                 MERGE_FREE)
            s->soft += m->soft[d];
    }
}

static cairn_pose shift_at(const cairn_map_merge *m, int32_t index)
{
    cairn_real stride = STRIDE * m->maps[m->map].input.resolution;
    int32_t column = index % m->search.columns, row = index / m->search.columns;
    cairn_pose pose = {m->search.shifts.min.x + stride * (cairn_real)column,
                       m->search.shifts.min.y + stride * (cairn_real)row,
                       m->search.turns[m->search.at]};

    return pose;
}

/* One translation; m->inner counts the points of each map that were looked up. */
static int step_shift(cairn_map_merge *m, cairn_pose pose, cairn_budget *budget)
{
    const merge_map *first = &m->maps[m->map], *second = &m->maps[m->other];
    cairn_vec2 there = {pose.x / first->input.resolution, pose.y / first->input.resolution};
    cairn_vec2 back = {
        -(m->search.cosine * pose.x + m->search.sine * pose.y) / second->input.resolution,
        -(m->search.cosine * pose.y - m->search.sine * pose.x) / second->input.resolution};

    while (m->inner < MERGE_FIRST_POINTS) {
        int32_t end = m->inner + LOOKS_PER_UNIT;
        merge_sums *s = &m->search.sums;

        if (!cairn_budget_pay(budget, &m->paid, 2))
            return 0;
        look(m, first, m->search.second, m->search.second_front, there, m->inner,
             end < m->search.seconds ? end : m->search.seconds, s);
        look(m, second, m->search.first, m->search.first_front, back, m->inner,
             end < m->search.firsts ? end : m->search.firsts, s);
        m->inner = merge_is_hopeless(s) ? MERGE_FIRST_POINTS : end;
    }
    return 1;
}

static cairn_status step_shifts(cairn_map_merge *m, cairn_budget *budget)
{
    const merge_sums none = {0, 0, 0, 0, {0, 0}, 0};

    for (; m->cursor < m->search.columns * m->search.rows; m->cursor++) {
        cairn_pose pose = shift_at(m, m->cursor);
        merge_mode mode;

        if (!step_shift(m, pose, budget))
            return CAIRN_MORE;
        mode.first_second = pose;
        mode.evidence = merge_search_score(&m->search.sums, m->search.wall);
        m->search.sums = none;
        m->inner = 0;
        m->tried++;
        if (mode.evidence > 0)
            cairn_merge_keep(m->kept, &m->kept_count, MERGE_KEPT, mode, MERGE_COARSE_M,
                             MERGE_COARSE_RAD);
    }
    return CAIRN_OK;
}

cairn_status cairn_merge_correlate(cairn_map_merge *m, cairn_budget *budget)
{
    const merge_sums none = {0, 0, 0, 0, {0, 0}, 0};

    if (m->phase == MERGE_TURNS) {
        if (m->cursor == 0 && m->inner == 0)
            memset(m->search.bins, 0, sizeof m->search.bins);
        if (step_bins(m, budget) != CAIRN_OK || !cairn_budget_pay(budget, &m->paid, 80))
            return CAIRN_MORE;
        find_peaks(m);
        m->search.at = 0;
        m->search.columns = 0;
        return CAIRN_OK;
    }
    for (; m->search.at < m->search.count; m->search.at++) {
        if (m->search.columns == 0) {
            if (!cairn_budget_pay(budget, &m->paid, 24))
                return CAIRN_MORE;
            turn_points(m, m->search.turns[m->search.at]);
            m->search.sums = none;
            m->cursor = m->inner = 0;
        }
        if (step_shifts(m, budget) != CAIRN_OK)
            return CAIRN_MORE;
        m->search.columns = 0;
    }
    return CAIRN_OK;
}
