/* Registration by wall directions and exhaustive translation, where corners are few.
 *
 * Method.
 *
 * 1. The direction histograms of the lines of both maps, weighted by length, are cross-correlated
 *    on the circle. Peaks after non-maximum suppression are the candidate rotations (Carpin 2008
 *    does so with Hough spectra).
 * 2. In each rotation all translations on a grid of two cells are tried. Rotated points of each map
 *    are shifted and looked up in the other; most translations are rejected after the first few
 *    points. */
#include "src/base/build.h"

#include <string.h>

#include "src/merging/map_merge_work.h"

/* bins on each side: smoothing of the correlation, and non-maximum suppression */
enum { SMOOTH_BINS = 2, NMS_RADIUS_BINS = 8, LOOK_UPS_PER_UNIT = 12 };

/* cells: reach of the search kernel */
#define SOFT_REACH_CELLS 5
/* minimum height of a peak, as a share of the highest */
#define MIN_PEAK_SHARE CAIRN_REAL(0.2)
/* cells between translations */
#define TRANSLATION_STEP_CELLS CAIRN_REAL(2.0)
/* m: minimum overlap of the bounding boxes of the points */
#define MIN_OVERLAP_M CAIRN_REAL(0.5)
/* Adds the angle difference of every pair of lines to its histogram bin. */
static cairn_status step_bins(cairn_map_merge *merge, cairn_budget *budget)
{
    const map_merge_map *first = &merge->maps[merge->map], *second = &merge->maps[merge->other];

    for (; merge->cursor < first->line_count; merge->cursor++, merge->inner = 0)
        for (; merge->inner < second->line_count; merge->inner++) {
            map_merge_direction a = first->directions[merge->cursor],
                                b = second->directions[merge->inner];
            cairn_real turn = (a.angle - b.angle) * (MAP_MERGE_ANGLE_BINS / (2 * CAIRN_PI));
            int32_t bin;

            if (merge->inner % 4 == 0 && !cairn_budget_charge(budget, &merge->units_charged, 1))
                return CAIRN_MORE;
            bin = cairn_real_to_int(cairn_rint(turn)) % MAP_MERGE_ANGLE_BINS;
            merge->search.bins[bin < 0 ? bin + MAP_MERGE_ANGLE_BINS : bin] +=
                cairn_min(a.length, b.length);
        }
    return CAIRN_OK;
}

static cairn_real smooth_bin(const cairn_real *bins, int32_t at)
{
    cairn_real sum = 0;

    for (int32_t i = -SMOOTH_BINS; i <= SMOOTH_BINS; i++)
        sum += (cairn_real)(SMOOTH_BINS + 1 - (i < 0 ? -i : i)) *
               bins[(at + i + MAP_MERGE_ANGLE_BINS) % MAP_MERGE_ANGLE_BINS];
    return sum;
}

/* Returns the weighted mean angle of a peak's bins. */
static cairn_real peak_angle(const cairn_real *bins, int32_t at)
{
    cairn_real sum = 0, moment = 0;

    for (int32_t i = -SMOOTH_BINS; i <= SMOOTH_BINS; i++) {
        cairn_real value = bins[(at + i + MAP_MERGE_ANGLE_BINS) % MAP_MERGE_ANGLE_BINS];

        sum += value;
        moment += value * (cairn_real)i;
    }
    return ((cairn_real)at + moment / sum) * (2 * CAIRN_PI / MAP_MERGE_ANGLE_BINS);
}

/* Finds the highest peaks; each one suppresses its neighbourhood. */
static void find_peaks(cairn_map_merge *merge)
{
    cairn_real highest = 0;

    merge->search.count = 0;
    while (merge->search.count < MAP_MERGE_MAX_ROTATIONS) {
        int32_t best = 0;
        cairn_real value = 0;

        for (int32_t i = 0; i < MAP_MERGE_ANGLE_BINS; i++)
            if (smooth_bin(merge->search.bins, i) > value) {
                value = smooth_bin(merge->search.bins, i);
                best = i;
            }
        highest = cairn_max(highest, value);
        if (!(value > MIN_PEAK_SHARE * highest))
            return;
        merge->search.rotations[merge->search.count++] =
            cairn_wrap_angle(peak_angle(merge->search.bins, best));
        for (int32_t i = -NMS_RADIUS_BINS; i <= NMS_RADIUS_BINS; i++)
            merge->search.bins[(best + i + MAP_MERGE_ANGLE_BINS) % MAP_MERGE_ANGLE_BINS] = 0;
    }
}

static cairn_vec2 in_cells(const map_merge_map *map, cairn_vec2 p)
{
    return cairn_vec2_scale(cairn_vec2_sub(p, map->corner), 1 / map->input.resolution);
}

/* Rotates the points of both maps, in cells of the other one's grid at translation 0. */
static void rotate_points(cairn_map_merge *merge, cairn_real turn)
{
    const map_merge_map *first = &merge->maps[merge->map], *second = &merge->maps[merge->other];
    cairn_box at = cairn_box_empty(), turned = cairn_box_empty();
    cairn_transform t = {0, 0, 1, 0}, back;
    int32_t n = MAP_MERGE_COARSE_POINTS;

    cairn_sincos(turn, &t.sine, &t.cosine);
    back = t;
    back.sine = -t.sine;
    merge->search.wall = map_merge_search_wall(first, second);
    merge->search.cosine = t.cosine;
    merge->search.sine = t.sine;
    merge->search.first_count = first->point_count < n ? first->point_count : n;
    merge->search.second_count = second->point_count < n ? second->point_count : n;
    for (int32_t i = 0; i < merge->search.first_count; i++) {

        at = cairn_box_extend(at, first->points[i].position);
        merge->search.first[i] =
            in_cells(second, cairn_transform_point(back, first->points[i].position));
        merge->search.first_front[i] =
            in_cells(second, cairn_transform_point(back, first->points[i].free_side));
    }
    for (int32_t i = 0; i < merge->search.second_count; i++) {
        cairn_vec2 p = cairn_transform_point(t, second->points[i].position);

        turned = cairn_box_extend(turned, p);
        merge->search.second[i] = in_cells(first, p);
        merge->search.second_front[i] =
            in_cells(first, cairn_transform_point(t, second->points[i].free_side));
    }
    merge->search.columns = merge->search.rows = 0;
    if (merge->search.first_count > 0 && merge->search.second_count > 0) {
        cairn_real stride = TRANSLATION_STEP_CELLS * first->input.resolution;

        merge->search.translations.min.x = at.min.x - turned.max.x + MIN_OVERLAP_M;
        merge->search.translations.min.y = at.min.y - turned.max.y + MIN_OVERLAP_M;
        merge->search.translations.max.x = at.max.x - turned.min.x - MIN_OVERLAP_M;
        merge->search.translations.max.y = at.max.y - turned.min.y - MIN_OVERLAP_M;
        merge->search.columns =
            1 + cairn_real_to_int(
                    (merge->search.translations.max.x - merge->search.translations.min.x) / stride);
        merge->search.rows =
            1 + cairn_real_to_int(
                    (merge->search.translations.max.y - merge->search.translations.min.y) / stride);
    }
}

/* Adds points begin ... end - 1, translated in cells, looked up in a grid. */
static void look_up_points(const cairn_map_merge *merge, const map_merge_map *to,
                           const cairn_vec2 *points, const cairn_vec2 *fronts, cairn_vec2 shift,
                           int32_t begin, int32_t end, map_merge_sums *sums)
{
    for (int32_t i = begin; i < end; i++) {
        uint16_t cell = map_merge_cell_at(to, points[i].x + shift.x, points[i].y + shift.y);
        int32_t d = map_merge_to_occupied(cell);

        if (map_merge_class(cell) == MAP_MERGE_UNKNOWN)
            continue;
        if (d > SOFT_REACH_CELLS)
            sums->soft_conflict += map_merge_class(cell) == MAP_MERGE_FREE;
        else if (map_merge_class(map_merge_cell_at(to, fronts[i].x + shift.x,
                                                   fronts[i].y + shift.y)) == MAP_MERGE_FREE)
            sums->soft_agree += merge->soft_kernel[d];
    }
}

static cairn_pose translation_at(const cairn_map_merge *merge, int32_t index)
{
    cairn_real stride = TRANSLATION_STEP_CELLS * merge->maps[merge->map].input.resolution;
    int32_t column = index % merge->search.columns, row = index / merge->search.columns;
    cairn_pose pose = {merge->search.translations.min.x + stride * (cairn_real)column,
                       merge->search.translations.min.y + stride * (cairn_real)row,
                       merge->search.rotations[merge->search.at]};

    return pose;
}

/* Scores one translation; merge->inner counts the points of each map that were looked up. */
static int step_translation(cairn_map_merge *merge, cairn_pose pose, cairn_budget *budget)
{
    const map_merge_map *first = &merge->maps[merge->map], *second = &merge->maps[merge->other];
    cairn_vec2 there = {pose.x / first->input.resolution, pose.y / first->input.resolution};
    cairn_vec2 back = {
        -(merge->search.cosine * pose.x + merge->search.sine * pose.y) / second->input.resolution,
        -(merge->search.cosine * pose.y - merge->search.sine * pose.x) / second->input.resolution};

    while (merge->inner < MAP_MERGE_COARSE_POINTS) {
        int32_t end = merge->inner + LOOK_UPS_PER_UNIT;
        map_merge_sums *s = &merge->search.sums;

        if (!cairn_budget_charge(budget, &merge->units_charged, 2))
            return 0;
        look_up_points(merge, first, merge->search.second, merge->search.second_front, there,
                       merge->inner,
                       end < merge->search.second_count ? end : merge->search.second_count, s);
        look_up_points(merge, second, merge->search.first, merge->search.first_front, back,
                       merge->inner,
                       end < merge->search.first_count ? end : merge->search.first_count, s);
        merge->inner = map_merge_is_rejected(s) ? MAP_MERGE_COARSE_POINTS : end;
    }
    return 1;
}

static cairn_status step_translations(cairn_map_merge *merge, cairn_budget *budget)
{
    const map_merge_sums none = {0, 0, 0, 0, {0, 0}, 0};

    for (; merge->cursor < merge->search.columns * merge->search.rows; merge->cursor++) {
        cairn_pose pose = translation_at(merge, merge->cursor);
        map_merge_mode mode;

        if (!step_translation(merge, pose, budget))
            return CAIRN_MORE;
        mode.first_second = pose;
        mode.log_ratio = map_merge_search_score(&merge->search.sums, merge->search.wall);
        merge->search.sums = none;
        merge->inner = 0;
        merge->tried_count++;
        if (mode.log_ratio > 0)
            cairn_map_merge_insert_mode(merge->pairs.hypotheses, &merge->pairs.hypothesis_count,
                                        MAP_MERGE_MAX_HYPOTHESES, mode, MAP_MERGE_COARSE_M,
                                        MAP_MERGE_COARSE_RAD);
    }
    return CAIRN_OK;
}

cairn_status cairn_map_merge_correlate(cairn_map_merge *merge, cairn_budget *budget)
{
    const map_merge_sums none = {0, 0, 0, 0, {0, 0}, 0};

    if (merge->phase == MAP_MERGE_ROTATIONS) {
        if (merge->cursor == 0 && merge->inner == 0)
            memset(merge->search.bins, 0, sizeof merge->search.bins);
        if (step_bins(merge, budget) != CAIRN_OK ||
            !cairn_budget_charge(budget, &merge->units_charged, 80))
            return CAIRN_MORE;
        find_peaks(merge);
        merge->search.at = 0;
        merge->search.columns = 0;
        return CAIRN_OK;
    }
    for (; merge->search.at < merge->search.count; merge->search.at++) {
        if (merge->search.columns == 0) {
            if (!cairn_budget_charge(budget, &merge->units_charged, 24))
                return CAIRN_MORE;
            rotate_points(merge, merge->search.rotations[merge->search.at]);
            merge->search.sums = none;
            merge->cursor = merge->inner = 0;
        }
        if (step_translations(merge, budget) != CAIRN_OK)
            return CAIRN_MORE;
        merge->search.columns = 0;
    }
    return CAIRN_OK;
}
