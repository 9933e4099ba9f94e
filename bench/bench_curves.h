/* Draws curves of several methods over their iterations, in panels of one picture (SVG). */
#ifndef CAIRN_BENCH_CURVES_H
#define CAIRN_BENCH_CURVES_H

#include "cairn/file_error.h"

typedef struct bench_curve_panel {
    const char *title; /* with its unit */
    /* [method * samples + sample]; a value that is not finite is left out. */
    const double *value;
} bench_curve_panel;

typedef struct bench_curves {
    const char *title, *subtitle;
    /* [methods] names */
    const char *const *method;
    /* [samples], increasing: drawn at equal distances, so that the axis may change its scale */
    const int32_t *step;
    /* [panels], row by row */
    const bench_curve_panel *panel;
    int32_t methods, samples, panels, columns;
} bench_curves;

/* Writes the picture, or nothing. CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status bench_curves_write(const char *path, const bench_curves *curves,
                                              cairn_file_error *error);

#endif
