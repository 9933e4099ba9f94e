/* Shared by the tests of silhouettes: a small grey picture, rectangles drawn into it, and measures
 * of outlines. */
#ifndef CAIRN_TESTS_GREY_PICTURE_H
#define CAIRN_TESTS_GREY_PICTURE_H

#include "tests/test.h"

#include <math.h>

#include "cairn/curve.h"
#include "cairn/geometry.h"
#include "cairn/raster.h"

enum { WIDTH = 120, HEIGHT = 90, PIXELS = WIDTH * HEIGHT };

static uint8_t grey[PIXELS];

static inline cairn_raster_u8_view view(void)
{
    cairn_raster_u8_view v = {grey, WIDTH, HEIGHT, WIDTH};

    return v;
}

static inline void clear(uint8_t value)
{
    memset(grey, value, sizeof grey);
}

static inline void fill(int32_t left, int32_t top, int32_t right, int32_t bottom, uint8_t value)
{
    for (int32_t y = top; y <= bottom; y++)
        for (int32_t x = left; x <= right; x++)
            grey[y * WIDTH + x] = value;
}

/* The outline of a rectangle, one pixel wide. */
static inline void frame(int32_t left, int32_t top, int32_t right, int32_t bottom, uint8_t value)
{
    fill(left, top, right, top, value);
    fill(left, bottom, right, bottom, value);
    fill(left, top, left, bottom, value);
    fill(right, top, right, bottom, value);
}

static inline double area_of(const cairn_curve *c)
{
    return fabs((double)cairn_polygon_area(c->points, c->count));
}

static inline cairn_box box_of(const cairn_curve *c)
{
    cairn_box box = cairn_box_empty();

    for (int32_t i = 0; i < c->count; i++)
        box = cairn_box_extend(box, c->points[i]);
    return box;
}

#endif
