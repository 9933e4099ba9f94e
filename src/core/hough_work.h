/* What the two parts of the hough room share. */
#ifndef CAIRN_CORE_HOUGH_WORK_H
#define CAIRN_CORE_HOUGH_WORK_H

#include "cairn/hough.h"

typedef struct peak {
    cairn_real votes;
    int32_t row, column;
} peak;

/* Weighted moments of points in the frame of a line: t along it, s across to the left. */
typedef struct moments {
    cairn_real w, t, s, tt, ts, ss;
} moments;

struct cairn_hough {
    cairn_hough_params params;
    int32_t rows;
    cairn_real turn;       /* rad from row to row */
    cairn_vec2 *direction; /* [rows] */
    cairn_real *votes;     /* [rows * distances], row by row */
    uint32_t *places;      /* [(distances + 31) / 32] */
    peak *peaks;           /* [max_lines], the highest first */
    int32_t peak_count, work_dropped;
    cairn_hough_line *work, *done; /* [max_lines] each, the most votes first */
    int32_t work_count, done_count, done_dropped;

    const cairn_oriented_point *points;
    const cairn_real *weights;
    int32_t count;
    int32_t phase;
    int32_t cursor; /* point or bin to be done next */
    int32_t paid;   /* units towards the item at hand */
    cairn_box box;
    cairn_vec2 middle;
    cairn_real step;                 /* m, width of a column and of a place */
    int32_t row_reach, column_reach; /* about a peak */
    cairn_real sine_tolerance, sine_separation;

    int32_t line; /* peak at hand */
    int32_t pass; /* over the points */
    cairn_hough_line fit;
    moments sum;
};

static inline cairn_real cairn_hough_weight(const cairn_hough *hough, int32_t i)
{
    return hough->weights != NULL ? hough->weights[i] : 1;
}

/* Where a signed distance from the middle lies among the columns: the middle is in the middle. */
static inline cairn_real cairn_hough_column(const cairn_hough *hough, cairn_real distance)
{
    return distance / hough->step + (cairn_real)(hough->params.distances - 1) * CAIRN_REAL(0.5);
}

static inline int cairn_hough_is_as_written(const cairn_hough *hough)
{
    return hough->params.mode == CAIRN_MODE_AS_WRITTEN;
}

/* As written: the column in which a point, from the middle, votes in a row. */
static inline int32_t cairn_hough_bin(const cairn_hough *hough, int32_t row, cairn_vec2 p)
{
    cairn_real at = cairn_hough_column(hough, cairn_vec2_cross(hough->direction[row], p));

    return cairn_real_to_int(cairn_floor(at + CAIRN_REAL(0.5)));
}

/* Goes to the first of the peaks. */
void cairn_hough_begin_lines(cairn_hough *hough);

/* Fits a line to the points at each peak. */
cairn_status cairn_hough_fit_lines(cairn_hough *hough, cairn_budget *budget);

/* Lines that lie on a stronger one go; the rest is what readers see. */
cairn_status cairn_hough_thin_lines(cairn_hough *hough, cairn_budget *budget);

#endif
