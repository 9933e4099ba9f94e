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

/* Units of an empty histogram; pairs of lines per unit; units of the peaks, of points that are rotated, and of LOOK_UPS_PER_UNIT
 * points of each map that are looked up. */
enum {
    UNITS_OF_BINS = 2,
    LINES_PER_UNIT = 4,
    UNITS_OF_PEAKS = 80,
    UNITS_OF_ROTATION = 24,
    UNITS_PER_LOOK_UP = 2
};

/* ---- Rotations ---- */

/* Adds the angle difference of the current pair of lines to its histogram bin. */
static void add_bin(cairn_map_merge *merge)
{
    map_merge_search *search = &merge->search;
    map_merge_direction a = merge->maps[merge->pairs.first].directions[search->lines.first],
                        b = merge->maps[merge->pairs.second].directions[search->lines.second];
    cairn_real turn = (a.angle - b.angle) * (MAP_MERGE_ANGLE_BINS / (2 * CAIRN_PI));
    int32_t bin = cairn_real_to_int(cairn_rint(turn)) % MAP_MERGE_ANGLE_BINS;

    search->bins[bin < 0 ? bin + MAP_MERGE_ANGLE_BINS : bin] += cairn_min(a.length, b.length);
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

    merge->search.rotation_count = 0;
    while (merge->search.rotation_count < MAP_MERGE_MAX_ROTATIONS) {
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
        merge->search.rotations[merge->search.rotation_count++] =
            cairn_wrap_angle(peak_angle(merge->search.bins, best));
        for (int32_t i = -NMS_RADIUS_BINS; i <= NMS_RADIUS_BINS; i++)
            merge->search.bins[(best + i + MAP_MERGE_ANGLE_BINS) % MAP_MERGE_ANGLE_BINS] = 0;
    }
}

int cairn_map_merge_find_rotations(cairn_map_merge *merge, cairn_budget *budget)
{
    const map_merge_map *first = &merge->maps[merge->pairs.first],
                        *second = &merge->maps[merge->pairs.second];
    map_merge_item_pair *at = &merge->search.lines;

    CAIRN_STEP_BEGIN(merge->resume.phase);
    CAIRN_STEP_CHARGE(merge, resume.phase, budget, UNITS_OF_BINS);
    memset(merge->search.bins, 0, sizeof merge->search.bins);
    for (at->first = 0; at->first < first->line_count; at->first++)
        for (at->second = 0; at->second < second->line_count; at->second++) {
            CAIRN_STEP_CHARGE_EVERY(merge, resume.phase, budget, LINES_PER_UNIT, at->second);
            add_bin(merge);
        }
    CAIRN_STEP_CHARGE(merge, resume.phase, budget, UNITS_OF_PEAKS);
    find_peaks(merge);
    CAIRN_STEP_END(merge->resume.phase);
}

/* ---- Translations ---- */

static cairn_vec2 in_cells(const map_merge_map *map, cairn_vec2 p)
{
    return cairn_vec2_scale(cairn_vec2_sub(p, map->corner), 1 / map->input.resolution);
}

/* Rotates the points of both maps by the current rotation, in cells of the other one's grid at
 * translation 0. */
static void rotate_points(cairn_map_merge *merge)
{
    const map_merge_map *first = &merge->maps[merge->pairs.first],
                        *second = &merge->maps[merge->pairs.second];
    cairn_box at = cairn_box_empty(), turned = cairn_box_empty();
    cairn_transform t = {0, 0, 1, 0}, back;
    int32_t n = MAP_MERGE_COARSE_POINTS;

    cairn_sincos(merge->search.rotations[merge->search.rotation], &t.sine, &t.cosine);
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
static void add_points(const cairn_map_merge *merge, const map_merge_map *to,
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

/* Sets the current translation, in m and in cells of either map. */
static void begin_translation(cairn_map_merge *merge)
{
    const map_merge_map *first = &merge->maps[merge->pairs.first],
                        *second = &merge->maps[merge->pairs.second];
    const map_merge_sums none = {0, 0, 0, 0, {0, 0}, 0};
    map_merge_search *search = &merge->search;
    cairn_real stride = TRANSLATION_STEP_CELLS * first->input.resolution,
               x = search->translations.min.x + stride * (cairn_real)search->column,
               y = search->translations.min.y + stride * (cairn_real)search->row;

    search->first_second.x = x;
    search->first_second.y = y;
    search->first_second.theta = search->rotations[search->rotation];
    search->there.x = x / first->input.resolution;
    search->there.y = y / first->input.resolution;
    search->back.x = -(search->cosine * x + search->sine * y) / second->input.resolution;
    search->back.y = -(search->cosine * y - search->sine * x) / second->input.resolution;
    search->point = 0;
    search->sums = none;
}

/* Looks up the next points of each map in the grid of the other; none are left when the translation
 * is rejected. */
static void look_up_points(cairn_map_merge *merge)
{
    map_merge_search *search = &merge->search;
    int32_t begin = search->point, end = begin + LOOK_UPS_PER_UNIT;

    add_points(merge, &merge->maps[merge->pairs.first], search->second, search->second_front,
               search->there, begin, end < search->second_count ? end : search->second_count,
               &search->sums);
    add_points(merge, &merge->maps[merge->pairs.second], search->first, search->first_front,
               search->back, begin, end < search->first_count ? end : search->first_count,
               &search->sums);
    search->point = map_merge_is_rejected(&search->sums) ? MAP_MERGE_COARSE_POINTS : end;
}

static void end_translation(cairn_map_merge *merge)
{
    const map_merge_search *search = &merge->search;
    cairn_real score = map_merge_search_score(&search->sums, search->wall);

    merge->tried_count++;
    if (score > 0)
        cairn_map_merge_insert_hypothesis(merge, search->first_second, score);
}

int cairn_map_merge_try_translations(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_search *search = &merge->search;

    CAIRN_STEP_BEGIN(merge->resume.phase);
    for (search->rotation = 0; search->rotation < search->rotation_count; search->rotation++) {
        CAIRN_STEP_CHARGE(merge, resume.phase, budget, UNITS_OF_ROTATION);
        rotate_points(merge);
        for (search->row = 0; search->row < search->rows; search->row++)
            for (search->column = 0; search->column < search->columns; search->column++) {
                CAIRN_STEP_CHARGE(merge, resume.phase, budget, UNITS_PER_LOOK_UP);
                begin_translation(merge);
                look_up_points(merge);
                while (search->point < MAP_MERGE_COARSE_POINTS) {
                    CAIRN_STEP_CHARGE(merge, resume.phase, budget, UNITS_PER_LOOK_UP);
                    look_up_points(merge);
                }
                end_translation(merge);
            }
    }
    CAIRN_STEP_END(merge->resume.phase);
}
