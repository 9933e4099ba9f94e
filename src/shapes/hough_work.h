/* Internals of the module hough, shared by hough.c (votes and peaks) and hough_lines.c (lines). */
#ifndef CAIRN_SHAPES_HOUGH_WORK_H
#define CAIRN_SHAPES_HOUGH_WORK_H

#include "cairn/hough.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_hough_parameters;

/* Local maximum of the accumulator. */
typedef struct hough_peak {
    /* Votes of its bin. */
    cairn_real votes;
    /* Its row (direction) and column (distance). */
    int32_t row, column;
} hough_peak;

/* Weighted moments of points in the frame of a line: weight w, and sums of t (along the line, in
 * m), s (to the left of the line, in m) and their products. */
typedef struct hough_moments {
    cairn_real w, t, s, tt, ts, ss;
} hough_moments;

struct cairn_hough {
    /* Rows of the accumulator. */
    int32_t rows;
    /* Angle between adjacent rows, in rad. */
    cairn_real angle_step;
    /* [rows] Unit direction of each row. */
    cairn_vec2 *direction;
    /* [rows * distances] Votes, row by row. */
    cairn_real *accumulator;
    /* [(distances + 31) / 32] Bit set of the positions along the current line that have an
     * inlier. */
    uint32_t *occupied;
    /* [max_lines] Peaks, by decreasing votes. */
    hough_peak *peaks;
    /* Number of peaks, and of peaks dropped. */
    int32_t peak_count, found_dropped;
    /* [max_lines] each: lines of the search that runs, and of the last one, by decreasing votes. */
    cairn_hough_line *found, *result;
    int32_t found_count, result_count, result_dropped;

    /* Input of the search. */
    const cairn_oriented_point *points;
    const cairn_real *weights;
    int32_t count;
    /* 1: a search was begun and is not done. */
    int32_t is_running;
    /* Status of the search, returned when it ends. */
    cairn_status outcome;
    /* Resume points of the search and of a phase. */
    int32_t resume, phase_resume;
    /* Next point or bin of the phase. */
    int32_t cursor;
    /* Work units charged for the next operation so far. */
    int32_t units_charged;
    /* Centre of the bounding box of the points, in m. */
    cairn_vec2 centre;
    /* Width of a column, and of a position along a line, in m. */
    cairn_real bin_width;
    /* Non-maximum suppression radius around a peak, in rows and columns. */
    int32_t row_radius, column_radius;
    /* Sines of angle_tolerance and separation_angle. */
    cairn_real sine_tolerance, sine_separation;
    /* What only one phase needs. */
    union {
        /* Bounding box of the points, in m. */
        cairn_box box;
        /* Votes of the current point: its direction, in rows, and the rows in which it votes, which
         * may be below 0 or beyond the last row. */
        struct {
            cairn_real direction_row;
            int32_t first_row, last_row;
        };
        /* Lines: current peak, and pass over the points for this peak; its line, and the moments of
         * the inliers. */
        struct {
            int32_t current_peak, pass;
            cairn_hough_line fit;
            hough_moments moments;
        };
    };
    cairn_hough_params params;
};

/* Weight of point i. */
static inline cairn_real cairn_hough_weight(const cairn_hough *hough, int32_t i)
{
    return hough->weights != NULL ? hough->weights[i] : 1;
}

/* Column, as a real number, of a signed distance from the centre in m; 0 is in the middle
 * column. */
static inline cairn_real cairn_hough_column(const cairn_hough *hough, cairn_real distance)
{
    return distance / hough->bin_width +
           (cairn_real)(hough->params.distances - 1) * CAIRN_REAL(0.5);
}

/* 1 in the mode as written. */
static inline int cairn_hough_is_as_written(const cairn_hough *hough)
{
    return hough->params.mode == CAIRN_MODE_AS_WRITTEN;
}

/* As written: the column in which a point votes in a row. p: relative to the centre, in m. */
static inline int32_t cairn_hough_bin(const cairn_hough *hough, int32_t row, cairn_vec2 p)
{
    cairn_real at = cairn_hough_column(hough, cairn_vec2_cross(hough->direction[row], p));

    return cairn_real_to_int(cairn_floor(at + CAIRN_REAL(0.5)));
}

/* Points that are visited for one work unit. */
enum { HOUGH_POINTS_PER_UNIT = 4 };

/* Fits a line to the inliers of each peak. 1 when done, 0 when the budget is used up. */
int cairn_hough_fit_lines(cairn_hough *hough, cairn_budget *budget);

/* Non-maximum suppression: drops lines that coincide with one of more votes, and publishes the rest
 * as the result. */
void cairn_hough_suppress_lines(cairn_hough *hough);

#endif
