/* Outlines of known objects.
 *
 * Method: control points by hand, closed centripetal Catmull-Rom splines through them, the
 * even-odd rule over the polygon of the curves. */
#include "sim/outlines.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

enum { PIECE_POINTS = 8 };

typedef struct control {
    double x, y;
} control;

static const control swan[] = {
    {-0.50, -0.06}, {-0.38, -0.02}, {-0.24, -0.09}, {-0.06, -0.08}, {0.07, 0.00},  {0.13, -0.02},
    {0.12, -0.14},  {0.05, -0.27},  {0.06, -0.40},  {0.15, -0.48},  {0.26, -0.46}, {0.33, -0.39},
    {0.46, -0.32},  {0.33, -0.32},  {0.24, -0.35},  {0.18, -0.36},  {0.16, -0.30}, {0.23, -0.16},
    {0.31, 0.00},   {0.34, 0.13},   {0.27, 0.25},   {0.08, 0.31},   {-0.16, 0.30}, {-0.35, 0.20}};
static const control mug[] = {{-0.34, -0.38}, {-0.10, -0.41}, {0.12, -0.38}, {0.14, -0.28},
                              {0.26, -0.29},  {0.39, -0.20},  {0.43, -0.02}, {0.37, 0.16},
                              {0.24, 0.25},   {0.13, 0.25},   {0.12, 0.37},  {-0.10, 0.42},
                              {-0.31, 0.37},  {-0.33, 0.00}};
static const control mug_hole[] = {{0.14, -0.20}, {0.24, -0.21}, {0.32, -0.14}, {0.35, -0.02},
                                   {0.31, 0.10},  {0.22, 0.17},  {0.13, 0.17},  {0.14, -0.02}};
static const control bottle[] = {{-0.06, -0.49}, {0.06, -0.49},  {0.07, -0.44},   {0.055, -0.40},
                                 {0.06, -0.24},  {0.10, -0.14},  {0.16, -0.06},   {0.17, 0.04},
                                 {0.17, 0.30},   {0.165, 0.46},  {0.13, 0.49},    {-0.13, 0.49},
                                 {-0.165, 0.46}, {-0.17, 0.30},  {-0.17, 0.04},   {-0.16, -0.06},
                                 {-0.10, -0.14}, {-0.06, -0.24}, {-0.055, -0.40}, {-0.07, -0.44}};
static const control giraffe[] = {
    {0.36, -0.49}, {0.39, -0.44}, {0.46, -0.38},  {0.45, -0.34},  {0.36, -0.36}, {0.31, -0.30},
    {0.24, -0.12}, {0.19, 0.06},  {0.17, 0.14},   {0.16, 0.30},   {0.17, 0.48},  {0.12, 0.48},
    {0.11, 0.30},  {0.08, 0.17},  {-0.06, 0.16},  {-0.17, 0.13},  {-0.20, 0.20}, {-0.18, 0.32},
    {-0.19, 0.48}, {-0.24, 0.48}, {-0.24, 0.32},  {-0.28, 0.14},  {-0.30, 0.04}, {-0.34, 0.16},
    {-0.37, 0.16}, {-0.33, 0.00}, {-0.27, -0.05}, {-0.12, -0.07}, {0.04, -0.08}, {0.13, -0.18},
    {0.23, -0.34}, {0.29, -0.45}};
static const control apple[] = {{0.00, -0.30},  {0.10, -0.35},  {0.24, -0.36},  {0.38, -0.26},
                                {0.42, -0.08},  {0.37, 0.14},   {0.26, 0.33},   {0.12, 0.42},
                                {0.00, 0.39},   {-0.12, 0.42},  {-0.26, 0.33},  {-0.37, 0.14},
                                {-0.42, -0.08}, {-0.38, -0.26}, {-0.24, -0.36}, {-0.10, -0.35}};
static const control lizard[] = {
    {0.00, -0.46},  {0.06, -0.40},  {0.07, -0.31},  {0.05, -0.25},  {0.15, -0.27},  {0.24, -0.33},
    {0.29, -0.30},  {0.18, -0.20},  {0.08, -0.18},  {0.09, -0.05},  {0.07, 0.05},   {0.18, 0.04},
    {0.27, 0.12},   {0.24, 0.17},   {0.15, 0.11},   {0.05, 0.13},   {0.05, 0.25},   {0.10, 0.36},
    {0.20, 0.43},   {0.18, 0.47},   {0.05, 0.43},   {-0.02, 0.30},  {-0.04, 0.13},  {-0.15, 0.11},
    {-0.24, 0.17},  {-0.27, 0.12},  {-0.18, 0.04},  {-0.07, 0.05},  {-0.09, -0.05}, {-0.08, -0.18},
    {-0.18, -0.20}, {-0.29, -0.30}, {-0.24, -0.33}, {-0.15, -0.27}, {-0.05, -0.25}, {-0.07, -0.31},
    {-0.06, -0.40}};

#define POINTS(of) of, (int32_t)(sizeof(of) / sizeof *(of))

static const struct drawn {
    const char *name;
    const control *outer;
    int32_t outer_count;
    const control *hole; /* NULL: none */
    int32_t hole_count;
} objects[OUTLINE_OBJECTS] = {
    {"apple", POINTS(apple), NULL, 0},      {"bottle", POINTS(bottle), NULL, 0},
    {"giraffe", POINTS(giraffe), NULL, 0},  {"lizard", POINTS(lizard), NULL, 0},
    {"mug", POINTS(mug), POINTS(mug_hole)}, {"swan", POINTS(swan), NULL, 0}};

const char *outline_name(int32_t object)
{
    return object >= 0 && object < OUTLINE_OBJECTS ? objects[object].name : NULL;
}

int32_t outline_find(const char *name)
{
    for (int32_t i = 0; i < OUTLINE_OBJECTS; i++)
        if (strcmp(objects[i].name, name) == 0)
            return i;
    return -1;
}

/* The point at parameter t of the straight way from a at ta to b at tb. */
static control between(control a, double ta, control b, double tb, double t)
{
    double share = (t - ta) / (tb - ta);
    control point = {a.x + share * (b.x - a.x), a.y + share * (b.y - a.y)};

    return point;
}

/* The spline from p[1] to p[2] at a share of its parameter (Barry and Goldman 1988). */
static control spline(const control p[4], double share)
{
    double t[4] = {0};
    control a, b, c;

    for (int i = 1; i < 4; i++)
        t[i] = t[i - 1] + sqrt(hypot(p[i].x - p[i - 1].x, p[i].y - p[i - 1].y));
    share = t[1] + share * (t[2] - t[1]);
    a = between(p[0], t[0], p[1], t[1], share);
    b = between(p[1], t[1], p[2], t[2], share);
    c = between(p[2], t[2], p[3], t[3], share);
    a = between(a, t[0], b, t[2], share);
    b = between(b, t[1], c, t[3], share);
    return between(a, t[1], b, t[2], share);
}

static void draw_curve(outline_curve *to, const control *points, int32_t count)
{
    to->count = 0;
    for (int32_t i = 0; i < count; i++) {
        control p[4];

        for (int32_t k = 0; k < 4; k++)
            p[k] = points[(i + k + count - 1) % count];
        for (int32_t k = 0; k < PIECE_POINTS; k++) {
            control at = spline(p, (double)k / PIECE_POINTS);

            to->point[to->count][0] = at.x;
            to->point[to->count++][1] = at.y;
        }
    }
}

void outline_draw(outline_object *to, int32_t object)
{
    const struct drawn *from = &objects[object];

    to->count = from->hole != NULL ? 2 : 1;
    draw_curve(&to->curve[0], from->outer, from->outer_count);
    if (from->hole != NULL)
        draw_curve(&to->curve[1], from->hole, from->hole_count);
}

int outline_contains(const void *object, double x, double y)
{
    const outline_object *o = object;
    int inside = 0;

    for (int32_t c = 0; c < o->count; c++)
        for (int32_t i = 0; i < o->curve[c].count; i++) {
            const double *a = o->curve[c].point[i];
            const double *b = o->curve[c].point[(i + 1) % o->curve[c].count];

            if ((a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
                inside = !inside;
        }
    return inside;
}
