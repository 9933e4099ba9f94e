/* bench_scene: generated images of known objects in clutter, with edges and ground-truth
 * outlines. */
#ifndef CAIRN_BENCH_SCENE_H
#define CAIRN_BENCH_SCENE_H

#include "cairn/geometry.h"
#include "cairn/random.h"

enum { SCENE_WIDTH = 400, SCENE_HEIGHT = 300, SCENE_PIXELS = SCENE_WIDTH * SCENE_HEIGHT };
enum { SCENE_FAMILIES = 5, SCENE_SHAPE = 6, SCENE_OUTLINES = 4 };

/* One member of a family. */
typedef struct scene_shape {
    int32_t family;
    double vary[SCENE_SHAPE]; /* -1 ... 1 each */
} scene_shape;

/* A figure other than the families: a function that tests which places of a square from -0.5 to 0.5
 * are inside. */
typedef struct scene_figure {
    int (*contains)(const void *shape, double x, double y);
    const void *shape;
    double max_turn; /* degrees, to both sides */
} scene_figure;

typedef struct scene_options {
    int32_t clutter; /* objects */
    double noise;    /* sigma, grey levels */
    double hidden;   /* share of the boundary, 0: none */
    int32_t without; /* 1: the object is absent */
} scene_options;

typedef struct scene {
    float grey[SCENE_PIXELS];
    uint8_t edges[SCENE_PIXELS]; /* strength, 0: none */
    /* 1: boundary of the object, hidden or not; 2: visible boundary */
    uint8_t truth[SCENE_PIXELS];
    uint8_t inside[SCENE_PIXELS]; /* 1: of the object */
    double box[4];                /* of the object: least x, y, most x, y */
    double at[2], size, turn;     /* px, rad: pose of its square */
} scene;

const char *scene_family_name(int32_t family);

/* A random member of a family. */
scene_shape scene_shape_draw(int32_t family, cairn_random *random);

/* The outlines of a member, 240 px high: its own, then those of its holes, at most `most` vertices
 * one after another; counts: of each. Returns the number of outlines. */
int32_t scene_outlines(const scene_shape *shape, cairn_vec2 *vertices, int32_t most,
                       int32_t counts[SCENE_OUTLINES]);

/* Draws a scene with one object of this shape. */
/* The same with another figure. */
void scene_draw_figure(scene *s, const scene_figure *figure, const scene_options *options,
                       cairn_random *random);

void scene_draw(scene *s, const scene_shape *shape, const scene_options *options,
                cairn_random *random);

#endif
