/* edge_image: an image of edges that is drawn line by line. Of the detector, and of the golden scenes
 * of detection. */
#ifndef CAIRN_FIRMWARE_EDGE_IMAGE_H
#define CAIRN_FIRMWARE_EDGE_IMAGE_H

#include <string.h>

#include "cairn/geometry.h"
#include "cairn/random.h"

typedef struct edge_image {
    uint8_t *edges; /* [width * height] strengths; 0: no edge */
    int32_t width, height;
} edge_image;

/* Removes all edges. */
static inline void edge_image_clear(const edge_image *image)
{
    memset(image->edges, 0, (size_t)image->width * (size_t)image->height);
}

/* Draws a line of a strength. */
static inline void edge_image_line(const edge_image *image, cairn_vec2 a, cairn_vec2 b,
                                   int32_t strength)
{
    int32_t steps = 1 + cairn_real_to_int(2 * cairn_vec2_norm(cairn_vec2_sub(b, a)));

    for (int32_t i = 0; i <= steps; i++) {
        cairn_vec2 p = cairn_vec2_interpolate(a, b, (cairn_real)i / (cairn_real)steps);
        int32_t x = cairn_real_to_int(cairn_rint(p.x)), y = cairn_real_to_int(cairn_rint(p.y));

        if (x >= 0 && y >= 0 && x < image->width && y < image->height)
            image->edges[y * image->width + x] = (uint8_t)strength;
    }
}

/* Draws a random line, from a point of the image up to `most` px along and across. */
static inline void edge_image_random_line(const edge_image *image, cairn_random *random,
                                          int32_t most, int32_t strength)
{
    cairn_real side = (cairn_real)most;
    cairn_vec2 a, b;

    a.x = cairn_random_uniform(random, 0, (cairn_real)image->width);
    a.y = cairn_random_uniform(random, 0, (cairn_real)image->height);
    b.x = a.x + cairn_random_uniform(random, -side, side);
    b.y = a.y + cairn_random_uniform(random, -side, side);
    edge_image_line(image, a, b, strength);
}

/* Draws a closed polygon with its origin at a position. */
static inline void edge_image_polygon(const edge_image *image, const cairn_vec2 *corners,
                                      int32_t count, cairn_vec2 at, int32_t strength)
{
    for (int32_t i = 0; i < count; i++)
        edge_image_line(image, cairn_vec2_add(at, corners[i]),
                        cairn_vec2_add(at, corners[(i + 1) % count]), strength);
}

#endif
