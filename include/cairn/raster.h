/* raster: strided views of images and grids, and distance transforms of images (distance_map).
 *
 * A view refers to a rectangle of the caller's memory: `data` is pixel (0, 0), and pixel (x, y) is
 * data[y * stride + x]. The stride counts elements. A negative stride flips an image vertically
 * without copying (rows of images run from the top, rows of grids from the bottom). */
#ifndef CAIRN_RASTER_H
#define CAIRN_RASTER_H

#include "cairn/object.h"
#include "cairn/pool.h"
#include "cairn/real.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Largest number of columns and of rows of a view: squared distances between pixels then fit an
 * int32_t. */
#define CAIRN_RASTER_MAX_SIDE 32768

/* Writable view of a raster of 8-bit unsigned elements. */
typedef struct cairn_raster_u8 {
    /* Pixel (0, 0). */
    uint8_t *data;
    /* Columns and rows. */
    int32_t width, height;
    /* Elements from a row to the next. */
    ptrdiff_t stride;
} cairn_raster_u8;

/* Read-only view of a raster of 8-bit unsigned elements. */
typedef struct cairn_raster_u8_view {
    /* Pixel (0, 0). */
    const uint8_t *data;
    /* Columns and rows. */
    int32_t width, height;
    /* Elements from a row to the next. */
    ptrdiff_t stride;
} cairn_raster_u8_view;

/* Writable view of a raster of 32-bit signed elements. */
typedef struct cairn_raster_i32 {
    /* Pixel (0, 0). */
    int32_t *data;
    /* Columns and rows. */
    int32_t width, height;
    /* Elements from a row to the next. */
    ptrdiff_t stride;
} cairn_raster_i32;

/* Read-only view of a raster of 32-bit signed elements. */
typedef struct cairn_raster_i32_view {
    /* Pixel (0, 0). */
    const int32_t *data;
    /* Columns and rows. */
    int32_t width, height;
    /* Elements from a row to the next. */
    ptrdiff_t stride;
} cairn_raster_i32_view;

/* Writable view of a raster of cairn_real elements. */
typedef struct cairn_raster_real {
    /* Pixel (0, 0). */
    cairn_real *data;
    /* Columns and rows. */
    int32_t width, height;
    /* Elements from a row to the next. */
    ptrdiff_t stride;
} cairn_raster_real;

/* Read-only view of a raster of cairn_real elements. */
typedef struct cairn_raster_real_view {
    /* Pixel (0, 0). */
    const cairn_real *data;
    /* Columns and rows. */
    int32_t width, height;
    /* Elements from a row to the next. */
    ptrdiff_t stride;
} cairn_raster_real_view;

/* Checks a view. CAIRN_BAD_ARGUMENT: data is NULL, a side is outside 1 ... CAIRN_RASTER_MAX_SIDE,
 * rows overlap (|stride| < width with more than one row), or offsets overflow.
 *
 * view: any view */
CAIRN_CHECKED cairn_status cairn_raster_u8_check(cairn_raster_u8_view view);
CAIRN_CHECKED cairn_status cairn_raster_i32_check(cairn_raster_i32_view view);
CAIRN_CHECKED cairn_status cairn_raster_real_check(cairn_raster_real_view view);

/* The read-only view of a writable view.
 *
 * raster: writable view */
static inline cairn_raster_u8_view cairn_raster_u8_as_view(cairn_raster_u8 raster)
{
    cairn_raster_u8_view view = {raster.data, raster.width, raster.height, raster.stride};
    return view;
}

/* The read-only view of a writable view.
 *
 * raster: writable view */
static inline cairn_raster_i32_view cairn_raster_i32_as_view(cairn_raster_i32 raster)
{
    cairn_raster_i32_view view = {raster.data, raster.width, raster.height, raster.stride};
    return view;
}

/* The read-only view of a writable view.
 *
 * raster: writable view */
static inline cairn_raster_real_view cairn_raster_real_as_view(cairn_raster_real raster)
{
    cairn_raster_real_view view = {raster.data, raster.width, raster.height, raster.stride};
    return view;
}

/* ---- Distance maps ---- */

/* Metric of a distance map. */
typedef int32_t cairn_distance_map_metric;
enum {
    /* City-block distance |dx| + |dy|, in pixels. */
    CAIRN_DISTANCE_MAP_L1 = 0,
    /* Squared Euclidean distance dx * dx + dy * dy, in pixels^2. */
    CAIRN_DISTANCE_MAP_L2_SQUARED = 1
};

/* Distance of every pixel when no pixel of the image matches. */
#define CAIRN_DISTANCE_MAP_FAR INT32_MAX

/* Distance transform of an image, computed in bounded steps. */
typedef struct cairn_distance_map cairn_distance_map;

/* Capacity of a distance transform. */
typedef struct cairn_distance_map_params {
    /* 1 ... CAIRN_RASTER_MAX_SIDE (none): columns. The memory grows only with the columns, by 12
     * bytes per column. */
    int32_t max_width;
} cairn_distance_map_params;

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_distance_map_check(const cairn_distance_map_params *params,
                                                    cairn_object_fault *fault);

/* Bytes that create() allocates. 0 for params that create() would refuse. */
size_t cairn_distance_map_memory(const cairn_distance_map_params *params);

/* Creates an object in a pool. CAIRN_BAD_ARGUMENT: NULL, or params out of range. CAIRN_NO_MEMORY:
 * the pool has too few bytes left. A failure changes nothing. */
CAIRN_CHECKED cairn_status cairn_distance_map_create(cairn_distance_map **map, cairn_pool *pool,
                                                     const cairn_distance_map_params *params);

/* Input of a distance transform: for every pixel the distance to the nearest pixel that matches,
 * i.e. with (value & mask) == match. */
typedef struct cairn_distance_map_input {
    /* Image. */
    cairn_raster_u8_view pixels;
    /* [pixels.height][pixels.width] Distances, written; must not overlap the image. */
    cairn_raster_i32 distances;
    /* Bits that are compared. 0xFF: pixels that equal `match`. */
    uint8_t mask;
    /* Value of the bits of a matching pixel. */
    uint8_t match;
    /* L1 in pixels, or squared L2 in pixels^2. */
    cairn_distance_map_metric metric;
} cairn_distance_map_input;

/* Starts a distance transform. Both rasters must stay until step() returns CAIRN_OK. A transform
 * that runs is discarded. CAIRN_BAD_ARGUMENT: NULL, a view that the check refuses, views of
 * different sizes, an unknown metric. CAIRN_FULL: wider than max_width. Constant time.
 *
 * input: rasters, metric and targets */
CAIRN_CHECKED cairn_status cairn_distance_map_begin(cairn_distance_map *map,
                                                    const cairn_distance_map_input *input);

/* Works until the budget is used up. CAIRN_OK: `distances` is complete, or no transform was begun.
 * CAIRN_MORE: call again. The distances are exact. Cost: about .7 units per pixel for L1 and .8 for
 * L2 (four, and at most five operations per pixel, six operations per unit). Source: L1: Rosenfeld
 * and Pfaltz 1966; L2: Meijster, Roerdink and Hesselink 2000. */
CAIRN_CHECKED cairn_status cairn_distance_map_step(cairn_distance_map *map, cairn_budget *budget);

#ifdef __cplusplus
}
#endif

#endif
