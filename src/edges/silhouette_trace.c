/* Boundary tracing of regions along pixel edges (cracks), and smoothing. silhouette.c describes the
 * method.
 *
 * Outlines are traced twice: the first time their points are counted, the second time stored. */
#include "src/base/build.h"

#include "src/edges/silhouette_work.h"

/* Half width of the smoothing window, in points. */
enum { SMOOTHING_RADIUS = 2 };

/* Cracks that are followed, and points that are smoothed, for one work unit. */
enum { CRACKS_PER_UNIT = 4, SMOOTHED_PER_UNIT = 3 };

/* ---- Tracing ---- */

/* The region of the outline that is traced. */
static const silhouette_region *region_of(const cairn_silhouette *s)
{
    return &s->regions[s->cursor];
}

/* 1 for a pixel of the region. */
static int is_region(const cairn_silhouette *s, int32_t x, int32_t y)
{
    const silhouette_region *region = region_of(s);

    return (region->is_hole ? s->face : s->component)[y * s->width + x] == region->label;
}

/* Advances along the region's boundary by one crack. Where two pixels of it meet at a corner only,
 * components continue with the other pixel, holes with the same one. */
static void follow_crack(cairn_silhouette *s)
{
    static const int8_t ahead[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    /* The pixels at a corner to the right and to the left of the direction. */
    static const int8_t right[4][2] = {{0, 0}, {-1, 0}, {-1, -1}, {0, -1}};
    silhouette_crack *at = &s->at;
    int32_t h = at->heading, left = (h + 3) % 4, is_right, is_left;

    at->x += ahead[h][0];
    at->y += ahead[h][1];
    is_right = is_region(s, at->x + right[h][0], at->y + right[h][1]);
    is_left = is_region(s, at->x + right[left][0], at->y + right[left][1]);
    if (is_left && (is_right || !region_of(s)->is_hole))
        at->heading = left;
    else if (!is_right)
        at->heading = (h + 1) % 4;
}

/* The middle of a crack. A corner is half a pixel before its pixel's centre, and the border shifts
 * by one. */
static cairn_vec2 middle_of(silhouette_crack crack)
{
    static const int8_t twice_x[4] = {1, 0, -1, 0}, twice_y[4] = {0, 1, 0, -1};
    cairn_vec2 middle = {(cairn_real)(2 * crack.x + twice_x[crack.heading] - 3) / 2,
                         (cairn_real)(2 * crack.y + twice_y[crack.heading] - 3) / 2};

    return middle;
}

/* Goes to the first pixel of the region in row order. */
static void start_outline(cairn_silhouette *s)
{
    int32_t first = region_of(s)->first;
    silhouette_crack start = {first % s->width, first / s->width, 0};

    s->start = s->at = start;
    s->first_point = s->point_count;
    s->is_following = 1;
}

/* Follows the next cracks, until the outline is closed. */
static void follow(cairn_silhouette *s)
{
    cairn_vec2 *points = s->scratch;

    for (int32_t i = 0; i < CRACKS_PER_UNIT && s->is_following; i++) {
        if (s->is_stored)
            points[s->point_count] = middle_of(s->at);
        s->point_count++;
        follow_crack(s);
        s->is_following =
            s->at.x != s->start.x || s->at.y != s->start.y || s->at.heading != s->start.heading;
    }
}

static void end_outline(cairn_silhouette *s)
{
    const cairn_vec2 *points = s->scratch;
    cairn_curve outline = {points + s->first_point, s->point_count - s->first_point, 1};

    s->outlines[s->cursor] = outline;
}

/* Compares the points with their capacity, after they were counted. */
static void check_points(cairn_silhouette *s)
{
    s->measure.points = s->point_count;
    if (s->point_count > s->params.max_points)
        silhouette_refuse(s, CAIRN_SILHOUETTE_POINTS, CAIRN_FULL);
}

/* ---- Smoothing ---- */

/* Points of the outline that is smoothed. */
static cairn_vec2 *points_of(const cairn_silhouette *s)
{
    cairn_vec2 *points = s->scratch;

    return points + (s->outlines[s->cursor].points - points);
}

/* Keeps the points at the ends of the outline, which are smoothed and still needed. */
static void start_smoothing(cairn_silhouette *s)
{
    const cairn_vec2 *points = points_of(s);
    int32_t count = s->outlines[s->cursor].count;

    for (int32_t k = 0; k < SMOOTHING_RADIUS; k++) {
        s->before[k] = points[count - SMOOTHING_RADIUS + k];
        s->head[k] = points[k];
    }
}

/* Replaces the next points by the means of their windows. */
static void smooth(cairn_silhouette *s)
{
    cairn_vec2 *points = points_of(s);
    int32_t count = s->outlines[s->cursor].count;

    for (int32_t i = s->point; i < s->point + SMOOTHED_PER_UNIT && i < count; i++) {
        cairn_vec2 traced = points[i], sum = cairn_vec2_add(s->before[0], s->before[1]);

        sum = cairn_vec2_add(sum, traced);
        for (int32_t k = i + 1; k <= i + SMOOTHING_RADIUS; k++)
            sum = cairn_vec2_add(sum, k < count ? points[k] : s->head[k - count]);
        points[i] = cairn_vec2_scale(sum, CAIRN_REAL(1.0) / (2 * SMOOTHING_RADIUS + 1));
        s->before[0] = s->before[1];
        s->before[1] = traced;
    }
}

int cairn_silhouette_trace(cairn_silhouette *s, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(s->phase_resume);
    for (s->is_stored = 0; s->is_stored < 2 && s->status == CAIRN_MORE; s->is_stored++) {
        s->point_count = 0;
        for (s->cursor = 0; s->cursor < s->region_count; s->cursor++) {
            start_outline(s);
            do {
                CAIRN_STEP_CHARGE_UNIT(s, phase_resume, budget);
                follow(s);
            } while (s->is_following);
            end_outline(s);
        }
        check_points(s);
    }
    for (s->cursor = 0; s->cursor < s->region_count && s->status == CAIRN_MORE; s->cursor++)
        if (s->outlines[s->cursor].count > 2 * SMOOTHING_RADIUS + 1) {
            start_smoothing(s);
            for (s->point = 0; s->point < s->outlines[s->cursor].count;
                 s->point += SMOOTHED_PER_UNIT) {
                CAIRN_STEP_CHARGE_UNIT(s, phase_resume, budget);
                smooth(s);
            }
        }
    CAIRN_STEP_END(s->phase_resume);
}
