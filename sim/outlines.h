/* outlines: hand-drawn outlines of known objects, as smooth closed curves.
 *
 * Coordinates lie in a square from -0.5 to 0.5, x to the right, y down. Each curve is a closed
 * centripetal Catmull-Rom spline through control points (Catmull and Rom 1974). A second curve is
 * a hole. */
#ifndef CAIRN_SIM_OUTLINES_H
#define CAIRN_SIM_OUTLINES_H

#include <stdint.h>

enum { OUTLINE_OBJECTS = 6, OUTLINE_CURVES = 2, OUTLINE_POINTS_MOST = 512 };

typedef struct outline_curve {
    double point[OUTLINE_POINTS_MOST][2];
    int32_t count;
} outline_curve;

/* One object: its outer curve, then its holes. */
typedef struct outline_object {
    outline_curve curve[OUTLINE_CURVES];
    int32_t count;
} outline_object;

/* "swan", "mug", ...; NULL beyond the last. */
const char *outline_name(int32_t object);

/* The index of an object, -1: no such name. */
int32_t outline_find(const char *name);

/* The curves of an object, every piece between two control points in 8 points. */
void outline_draw(outline_object *to, int32_t object);

/* Whether a place lies inside the object (not in a hole); the type fits scene_figure. */
int outline_contains(const void *object, double x, double y);

#endif
