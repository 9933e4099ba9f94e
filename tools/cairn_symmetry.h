/* Shared by the files of cairn symmetry. */
#ifndef CAIRN_TOOLS_CAIRN_SYMMETRY_H
#define CAIRN_TOOLS_CAIRN_SYMMETRY_H

#include "cairn/self_similarity.h"
#include "cairn/shape_image.h"
#include "tools/cairn_picture.h"

enum { SYMMETRY_MAX_POINTS = 512 };

/* The axes of one shape, in pixels of its picture. */
typedef struct symmetry_found {
    const char *path;
    char stem[PICTURE_NAME_BYTES];
    cairn_shape_image image; /* all outlines: parts, then holes */
    int32_t parts;           /* parts of the picture; the largest one is analysed */
    int32_t holes;           /* holes of the largest part */
    cairn_curve shape[CAIRN_SHAPE_MODEL_MAX_OUTLINES];
    int32_t mode; /* CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN */
    cairn_self_similarity_axis axes[CAIRN_SELF_SIMILARITY_MAX_AXES];
    cairn_vec2 samples[SYMMETRY_MAX_POINTS];
    cairn_self_similarity_result result; /* its arrays are axes and samples */
} symmetry_found;

/* "as written", "re-ranked". */
const char *symmetry_mode_name(int32_t mode);

/* Returns the verdict as text. */
const char *symmetry_verdict_name(cairn_self_similarity_verdict verdict);

/* The picture of one shape: its two arcs red and blue, the rest of the outline grey, its axes. */
CAIRN_CHECKED cairn_status symmetry_draw(const symmetry_found *found, const char *path,
                                         cairn_file_error *error);

/* Several in one picture, side by side; found: [count]. */
CAIRN_CHECKED cairn_status symmetry_draw_sheet(const symmetry_found *found, int32_t count,
                                               const char *path, cairn_file_error *error);

/* The same as JSON (docs/formats.md). */
CAIRN_CHECKED cairn_status symmetry_write(const symmetry_found *found, const char *path,
                                          cairn_file_error *error);

#endif
