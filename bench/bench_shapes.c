#include "bench/bench_shapes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_random.h"
#include "cairn/curve.h"
#include "cairn/shape_image.h"

#define PI     3.14159265358979324
#define LENGTH 200.0
/* Spacing of the vertices of a swept outline, in px. */
#define VERTEX_SPACING_PX 4.0
/* Bound of the widths as a share of the axis's radius of curvature, so that no ribs cross. */
#define MAX_WIDTH_SHARE 0.8

enum { RIB_COUNT = 400, WAVES = 3 };

static cairn_vec2 vec2(double x, double y)
{
    cairn_vec2 v = {(cairn_real)x, (cairn_real)y};

    return v;
}

/* ---- Widths along an axis ---- */

typedef struct profile {
    double width, taper, blunt, wave[WAVES], phase[WAVES];
} profile;

static profile draw_profile(cairn_random *random, double narrowest, double widest)
{
    profile p;

    p.width = narrowest * pow(widest / narrowest, bench_uniform(random, 0, 1));
    p.taper = bench_uniform(random, 0.25, 0.6);
    p.blunt = bench_uniform(random, 2, 5);
    for (int k = 0; k < WAVES; k++) {
        p.wave[k] = bench_uniform(random, -0.2, 0.2) / (k + 1);
        p.phase[k] = bench_uniform(random, 0, 2 * PI);
    }
    return p;
}

/* Half the width at t, 0 ... 1. */
static double half_width(const profile *p, double t)
{
    double waves = 1, middle = fabs(2 * t - 1);

    for (int k = 0; k < WAVES; k++)
        waves += p->wave[k] * sin(PI * (k + 1) * t + p->phase[k]);
    return 0.5 * p->width * pow(fmax(0, 1 - pow(middle, p->blunt)), 1 / p->blunt) *
           (1 - p->taper * (2 * t - 1)) * waves;
}

/* ---- Swept shapes ---- */

/* Position at an offset from an axis that starts along x and bends to the left. */
static cairn_vec2 bent(double along, double aside, double bend)
{
    double turned = bend * along / LENGTH, radius = LENGTH / bend;

    if (fabs(bend) < 1e-9)
        return vec2(along, aside);
    return vec2((radius - aside) * sin(turned), radius - (radius - aside) * cos(turned));
}

/* Rotates and shifts a shape, and rotates its list of vertices. */
static void place_shape(bench_shape *shape, cairn_random *random)
{
    double turn = bench_uniform(random, -PI, PI), x = bench_uniform(random, 200, 400),
           y = bench_uniform(random, 200, 400);
    int32_t first = (int32_t)bench_uniform(random, 0, shape->count), n = shape->count;
    cairn_vec2 *copy = malloc((size_t)n * sizeof *copy);
    double before = 0, whole = 0;

    if (copy == NULL)
        abort();
    for (int32_t i = 0; i < n; i++) {
        cairn_vec2 p = shape->points[i], q = shape->points[(i + 1) % n];
        double side = hypot((double)(q.x - p.x), (double)(q.y - p.y));

        copy[i] = vec2(x + cos(turn) * (double)p.x - sin(turn) * (double)p.y,
                       y + sin(turn) * (double)p.x + cos(turn) * (double)p.y);
        before += i < first ? side : 0;
        whole += side;
    }
    for (int32_t i = 0; i < n; i++)
        shape->points[i] = copy[(first + i) % n];
    for (int k = 0; k < 2; k++)
        shape->end[k] -= before / whole - (shape->end[k] < before / whole);
    free(copy);
}

void bench_shape_swept(bench_shape *shape, uint64_t seed, double bend, double skew, double noise)
{
    cairn_random random = cairn_random_seed(seed, 51);
    profile p = draw_profile(&random, 0.2 * LENGTH, 1.25 * LENGTH);
    double widest = 0, turned = 0, left = 0, right = 0;
    cairn_vec2 ribs[2 * RIB_COUNT], even[BENCH_SHAPE_POINTS], across[BENCH_SHAPE_POINTS];
    cairn_curve outline = {ribs, 2 * RIB_COUNT, 1};
    cairn_status status;

    bend = bench_uniform(&random, -1, 1) < 0 ? -bend : bend;
    skew = bench_uniform(&random, -1, 1) < 0 ? -skew : skew;
    for (int32_t i = 0; i <= RIB_COUNT; i++)
        widest = fmax(widest, half_width(&p, (double)i / RIB_COUNT));
    p.width *= fmin(1, MAX_WIDTH_SHARE * LENGTH / (fmax(fabs(bend), 1e-9) * widest));
    turned = bend / 2;
    for (int32_t i = 0; i < 2 * RIB_COUNT; i++) {
        double t = 0.5 - 0.5 * cos(PI * i / RIB_COUNT), width = half_width(&p, t);
        cairn_vec2 at = bent(t * LENGTH, i < RIB_COUNT ? width : -width, bend);
        double x = cos(turned) * (double)at.x + sin(turned) * (double)at.y;
        double y = cos(turned) * (double)at.y - sin(turned) * (double)at.x;

        ribs[i] = vec2(x + skew * y, y);
    }
    for (int32_t i = 0; i < 2 * RIB_COUNT; i++) {
        cairn_vec2 a = ribs[i], b = ribs[(i + 1) % (2 * RIB_COUNT)];

        *(i < RIB_COUNT ? &left : &right) += hypot((double)(b.x - a.x), (double)(b.y - a.y));
    }
    shape->count = (int32_t)fmin(BENCH_SHAPE_POINTS, ceil((left + right) / VERTEX_SPACING_PX));
    shape->end[0] = 0;
    shape->end[1] = left / (left + right);
    status = cairn_curve_resample(&outline, even, across, shape->count);
    if (status != CAIRN_OK)
        abort();
    for (int32_t i = 0; i < shape->count; i++) {
        double by = noise * (double)cairn_random_normal(&random);

        shape->points[i] = vec2((double)even[i].x - by * (double)across[i].y,
                                (double)even[i].y + by * (double)across[i].x);
    }
    place_shape(shape, &random);
}

/* ---- Articulated shapes ---- */

enum { SIDE = 480, LIMBS = 4, TRIES = 50 };

typedef struct limb {
    cairn_segment bone;
    double radius;
} limb;

/* A limb at `t` of the body, on the side of `sign`, from inside the body outward. */
static limb draw_limb(const profile *body, double t, double sign, double angle, double length,
                      double radius)
{
    double joint = 0.75 * half_width(body, t), x = t * LENGTH;
    limb l;

    l.bone.a = vec2(x, sign * joint);
    l.bone.b = vec2(x + length * cos(angle), sign * (joint + length * sin(angle)));
    l.radius = radius;
    return l;
}

static int is_inside(const profile *body, const limb *limbs, double x, double y)
{
    cairn_vec2 p = vec2(x, y);

    if (x > 0 && x < LENGTH && fabs(y) <= half_width(body, x / LENGTH))
        return 1;
    for (int i = 0; i < LIMBS; i++)
        if ((double)cairn_segment_distance(limbs[i].bone, p) <= limbs[i].radius)
            return 1;
    return 0;
}

/* The share of the outline's length at which it is nearest to a point; -1: more than 3 px away
 * everywhere. */
static double place_near(const bench_shape *shape, double x, double y)
{
    double before = 0, nearest = 3, place = -1;

    for (int32_t i = 0; i < shape->count; i++) {
        cairn_segment side = {shape->points[i], shape->points[(i + 1) % shape->count]};
        cairn_real parameter;
        double length = (double)cairn_segment_length(side), d;

        (void)cairn_segment_nearest(side, vec2(x, y), &parameter);
        d = (double)cairn_segment_distance(side, vec2(x, y));
        if (d < nearest) {
            nearest = d;
            place = before + (double)parameter * length;
        }
        before += length;
    }
    return place < 0 ? -1 : place / before;
}

/* Draws the body and limbs, with the axis rotated by `turn` in the image. */
static int trace(bench_shape *shape, const profile *body, const limb *limbs, double turn)
{
    static uint8_t grey[SIDE * SIDE];
    cairn_raster_u8_view view = {grey, SIDE, SIDE, SIDE};
    cairn_shape_image_params params = cairn_shape_image_default();
    double c = cos(turn), s = sin(turn), middle = SIDE / 2.0;
    cairn_shape_image image;
    cairn_file_error error;
    int good;

    for (int32_t v = 0; v < SIDE; v++)
        for (int32_t u = 0; u < SIDE; u++) {
            double x = u - middle, y = v - middle;

            grey[v * SIDE + u] =
                is_inside(body, limbs, c * x + s * y + LENGTH / 2, c * y - s * x) ? 255 : 0;
        }
    if (cairn_shape_image_trace(&image, view, &params, "shape", &error) != CAIRN_OK)
        return 0;
    good = image.count == 1 && image.outlines[0].count <= BENCH_SHAPE_POINTS;
    if (good) {
        shape->count = image.outlines[0].count;
        memcpy(shape->points, image.outlines[0].points,
               (size_t)shape->count * sizeof shape->points[0]);
        for (int k = 0; k < 2; k++) {
            double x = k == 0 ? -LENGTH / 2 : LENGTH / 2;

            shape->end[k] = place_near(shape, middle + c * x, middle + s * x);
            good &= shape->end[k] >= 0;
        }
    }
    cairn_shape_image_free(&image);
    return good;
}

int bench_shape_articulated(bench_shape *shape, uint64_t seed, double turn)
{
    cairn_random random = cairn_random_seed(seed, 52);

    for (int tries = 0; tries < TRIES; tries++) {
        profile body = draw_profile(&random, 0.25 * LENGTH, 0.45 * LENGTH);
        limb limbs[LIMBS];

        for (int pair = 0; pair < LIMBS / 2; pair++) {
            double t =
                pair == 0 ? bench_uniform(&random, 0.2, 0.35) : bench_uniform(&random, 0.65, 0.8);
            double length = bench_uniform(&random, 0.3, 0.55) * LENGTH,
                   radius = bench_uniform(&random, 0.03, 0.06) * LENGTH;

            for (int side = 0; side < 2; side++)
                limbs[2 * pair + side] =
                    draw_limb(&body, t, side == 0 ? 1 : -1,
                              PI / 2 + bench_uniform(&random, -turn, turn), length, radius);
        }
        if (trace(shape, &body, limbs, bench_uniform(&random, -PI, PI)))
            return 1;
    }
    return 0;
}
