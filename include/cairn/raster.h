/* raster: strided views of pixels and cells, and distance maps over them.
 *
 * A view is a piece of the caller's memory: `data` is pixel (0, 0), pixel (x, y) is data[y *
 * stride + x]. The stride counts elements and may be negative, which turns a picture upside down
 * without moving it (pictures start at the top, grids at the bottom). */
#ifndef CAIRN_RASTER_H
#define CAIRN_RASTER_H

#include "cairn/pool.h"
#include "cairn/real.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Views have 1 ... CAIRN_RASTER_MAX_SIDE columns and rows: squared distances within them fit an
 * int32_t. */
#define CAIRN_RASTER_MAX_SIDE 32768

typedef struct cairn_raster_u8 {
    uint8_t *data;
    int32_t width, height;
    ptrdiff_t stride;
} cairn_raster_u8;

typedef struct cairn_raster_u8_view {
    const uint8_t *data;
    int32_t width, height;
    ptrdiff_t stride;
} cairn_raster_u8_view;

typedef struct cairn_raster_i32 {
    int32_t *data;
    int32_t width, height;
    ptrdiff_t stride;
} cairn_raster_i32;

typedef struct cairn_raster_i32_view {
    const int32_t *data;
    int32_t width, height;
    ptrdiff_t stride;
} cairn_raster_i32_view;

typedef struct cairn_raster_real {
    cairn_real *data;
    int32_t width, height;
    ptrdiff_t stride;
} cairn_raster_real;

typedef struct cairn_raster_real_view {
    const cairn_real *data;
    int32_t width, height;
    ptrdiff_t stride;
} cairn_raster_real_view;

/* CAIRN_BAD_ARGUMENT: no data, a side outside 1 ... CAIRN_RASTER_MAX_SIDE, rows that overlap
 * (|stride| < width, with more than one row), or offsets that overflow. */
CAIRN_CHECKED cairn_status cairn_raster_u8_check(cairn_raster_u8_view view);
CAIRN_CHECKED cairn_status cairn_raster_i32_check(cairn_raster_i32_view view);
CAIRN_CHECKED cairn_status cairn_raster_real_check(cairn_raster_real_view view);

static inline cairn_raster_u8_view cairn_raster_u8_read(cairn_raster_u8 raster)
{
    cairn_raster_u8_view view = {raster.data, raster.width, raster.height, raster.stride};
    return view;
}

static inline cairn_raster_i32_view cairn_raster_i32_read(cairn_raster_i32 raster)
{
    cairn_raster_i32_view view = {raster.data, raster.width, raster.height, raster.stride};
    return view;
}

static inline cairn_raster_real_view cairn_raster_real_read(cairn_raster_real raster)
{
    cairn_raster_real_view view = {raster.data, raster.width, raster.height, raster.stride};
    return view;
}

/* ---- Distance maps ---- */

typedef int32_t cairn_distance_metric;
enum {
    CAIRN_DISTANCE_L1 = 0,        /* |dx| + |dy| */
    CAIRN_DISTANCE_L2_SQUARED = 1 /* dx * dx + dy * dy */
};

/* The distance when no pixel matches at all. */
#define CAIRN_DISTANCE_FAR INT32_MAX

typedef struct cairn_distance_map cairn_distance_map;

typedef struct cairn_distance_map_params {
    /* 1 ... CAIRN_RASTER_MAX_SIDE; the memory grows with this side alone, by 12 bytes a column */
    int32_t max_width;
} cairn_distance_map_params;

/* 0 for params that create() would refuse. */
size_t cairn_distance_map_memory(const cairn_distance_map_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_distance_map_create(cairn_distance_map **map, cairn_pool *pool,
                                                     const cairn_distance_map_params *params);

/* What is wanted: for every pixel of `pixels` the distance, in pixels, to the nearest one with
 * (value & mask) == match. */
typedef struct cairn_distance_map_input {
    cairn_raster_u8_view pixels;
    cairn_raster_i32 distances; /* [pixels.height][pixels.width], written; in memory of its own */
    uint8_t mask;               /* 0xFF: pixels that equal `match` */
    uint8_t match;
    cairn_distance_metric metric;
} cairn_distance_map_input;

/* Starts a distance map; both rasters must stay until step() returns CAIRN_OK. A map that was
 * not finished is dropped. CAIRN_BAD_ARGUMENT: a bad view, views of different sizes, an unknown
 * metric. CAIRN_FULL: wider than max_width. */
CAIRN_CHECKED cairn_status cairn_distance_map_begin(cairn_distance_map *map,
                                                    const cairn_distance_map_input *input);

/* CAIRN_OK: `distances` is complete, or nothing was begun. CAIRN_MORE: go on. The distances are
 * exact. In all about .7 units a pixel for L1 and .8 for L2 (four and at most five operations a
 * pixel, six to a unit). Source: L1: Rosenfeld and Pfaltz 1966; L2: Meijster, Roerdink and
 * Hesselink 2000. */
CAIRN_CHECKED cairn_status cairn_distance_map_step(cairn_distance_map *map, cairn_budget *budget);

#ifdef __cplusplus
}
#endif

#endif
