/* Scenes: a background of 1/f noise, clutter, the object, an occluder, noise; edges by the
 * gradient of the smoothed picture. All quantities of the protocol are options; the rest is
 * fixed here. */
#include "bench/bench_scene.h"
#include "bench/bench_random.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

enum {
    OUTLINE_SIDE = 280,
    OUTLINE_MIDDLE = OUTLINE_SIDE / 2,
    OUTLINE_PIXELS = OUTLINE_SIDE * OUTLINE_SIDE
};

static int32_t row_of(int32_t pixel)
{
    return pixel / SCENE_WIDTH;
}

/* ---- Shapes, in a square from -0.5 to 0.5, y down ---- */

const char *scene_family_name(int32_t family)
{
    static const char *const name[SCENE_FAMILIES] = {"apple", "bottle", "cup", "bird", "horse"};

    return name[family];
}

scene_shape scene_shape_draw(int32_t family, cairn_random *random)
{
    scene_shape shape;

    shape.family = family;
    for (int i = 0; i < SCENE_SHAPE; i++)
        shape.vary[i] = bench_uniform(random, -1, 1);
    return shape;
}

static int in_ellipse(double x, double y, double cx, double cy, double rx, double ry)
{
    return (x - cx) * (x - cx) / (rx * rx) + (y - cy) * (y - cy) / (ry * ry) <= 1;
}

/* A bar from a to b with round ends, its half width from ra to rb. */
static int in_bar(double x, double y, const double a[3], const double b[3])
{
    double dx = b[0] - a[0], dy = b[1] - a[1];
    double t = ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy), r;

    t = t < 0 ? 0 : t > 1 ? 1 : t;
    r = a[2] + t * (b[2] - a[2]);
    return (x - a[0] - t * dx) * (x - a[0] - t * dx) + (y - a[1] - t * dy) * (y - a[1] - t * dy) <=
           r * r;
}

static double bump(double angle, double at, double width)
{
    double off = remainder(angle - at, 2 * PI);

    return exp(-off * off / width);
}

static int in_apple(const double *v, double x, double y)
{
    double angle = atan2(y, x);
    double r = 0.45 * (1 + 0.06 * v[0] * cos(2 * angle) + 0.05 * v[1] * cos(3 * angle));

    r -= (0.12 + 0.03 * v[2]) * bump(angle, -PI / 2, 0.08) +
         (0.05 + 0.02 * v[3]) * bump(angle, PI / 2, 0.06);
    return x * x + y * y <= r * r;
}

static int in_bottle(const double *v, double x, double y)
{
    double neck = 0.07 + 0.015 * v[0], body = 0.17 + 0.03 * v[1], shoulder = -0.16 + 0.06 * v[2];
    double t = (y - shoulder) / (0.14 + 0.04 * v[3]);

    t = t < 0 ? 0 : t > 1 ? 1 : t * t * (3 - 2 * t);
    return fabs(y) <= 0.5 && fabs(x) <= neck + t * (body - neck);
}

static int in_cup(const double *v, double x, double y)
{
    double right = 0.17 + 0.03 * v[0], ring = 0.2 + 0.03 * v[2], cx = right, cy = 0.05 * v[3];
    double half = (0.38 + 0.05 * v[1]) * 1.0, from = hypot(x - cx, y - cy);

    if (x >= -0.33 && x <= right && fabs(y) <= half)
        return 1;
    return x > right && from <= ring && from >= ring - 0.075;
}

static int in_bird(const double *v, double x, double y)
{
    double head[3] = {0.32, -0.24 + 0.04 * v[2], 0.1 + 0.015 * v[3]}, neck[3] = {0.2, 0.02, 0.1};
    double beak[3] = {0.42, head[1], 0.04}, tip[3] = {0.52, head[1] + 0.03, 0.012};
    double rump[3] = {-0.26, 0.06, 0.08}, tail[3] = {-0.5, -0.04 + 0.06 * v[4], 0.03};

    return in_ellipse(x, y, 0, 0.1, 0.34 + 0.03 * v[0], 0.19 + 0.03 * v[1]) ||
           in_bar(x, y, neck, head) || in_bar(x, y, beak, tip) || in_bar(x, y, rump, tail);
}

static int in_horse(const double *v, double x, double y)
{
    double chest[3] = {0.24, -0.08, 0.1}, nape[3] = {0.38, -0.33 + 0.03 * v[2], 0.06},
           nose[3] = {0.5, -0.2, 0.04};
    double hip[4] = {-0.26, -0.15, 0.14, 0.25};

    for (int leg = 0; leg < 4; leg++) {
        double top[3] = {hip[leg], 0.02, 0.045},
               foot[3] = {hip[leg] + 0.03 * v[5] * (leg % 2 ? 1 : -1), 0.46, 0.028};

        if (in_bar(x, y, top, foot))
            return 1;
    }
    return in_ellipse(x, y, 0, -0.03, 0.32 + 0.02 * v[0], 0.14 + 0.02 * v[1]) ||
           in_bar(x, y, chest, nape) || in_bar(x, y, nape, nose);
}

static int is_inside(const void *shape, double x, double y)
{
    const scene_shape *s = shape;
    static int (*const inside[SCENE_FAMILIES])(const double *, double, double) = {
        in_apple, in_bottle, in_cup, in_bird, in_horse};

    return inside[s->family](s->vary, x, y);
}

/* Label of a pixel of the square: 0 background, 1 the shape, 2 not known yet, 3 and above a
 * hole. */
static void spread(uint8_t *label, int32_t from, uint8_t as)
{
    static int32_t stack[OUTLINE_PIXELS];
    int32_t depth = 0;

    label[from] = as;
    stack[depth++] = from;
    while (depth > 0) {
        int32_t at = stack[--depth], x = at % OUTLINE_SIDE, y = at / OUTLINE_SIDE;
        int32_t beside[4] = {x > 0 ? at - 1 : at, x < OUTLINE_SIDE - 1 ? at + 1 : at,
                             y > 0 ? at - OUTLINE_SIDE : at,
                             y < OUTLINE_SIDE - 1 ? at + OUTLINE_SIDE : at};

        for (int k = 0; k < 4; k++)
            if (label[beside[k]] == 2) {
                label[beside[k]] = as;
                stack[depth++] = beside[k];
            }
    }
}

/* Traces the border of a label (Moore's neighbours), from the topmost pixel. */
static int32_t go_round(const uint8_t *label, uint8_t of, int32_t from, cairn_vec2 *vertices,
                        int32_t most)
{
    static const int dx[8] = {1, 1, 0, -1, -1, -1, 0, 1}, dy[8] = {0, 1, 1, 1, 0, -1, -1, -1};
    int32_t x = from % OUTLINE_SIDE, y = from / OUTLINE_SIDE, count = 0;
    int came = 4;

    do {
        vertices[count].x = (cairn_real)x;
        vertices[count++].y = (cairn_real)y;
        for (int turn = 1; turn <= 8; turn++) {
            int way = (came + turn) & 7;

            if (label[(y + dy[way]) * OUTLINE_SIDE + x + dx[way]] == of) {
                x += dx[way];
                y += dy[way];
                came = (way + 4) & 7;
                break;
            }
        }
    } while (count < most && y * OUTLINE_SIDE + x != from);
    return count;
}

int32_t scene_outlines(const scene_shape *shape, cairn_vec2 *vertices, int32_t most,
                       int32_t counts[SCENE_OUTLINES])
{
    static uint8_t label[OUTLINE_PIXELS];
    int32_t outlines = 0, used = 0;
    uint8_t known = 2;

    for (int32_t y = 0; y < OUTLINE_SIDE; y++)
        for (int32_t x = 0; x < OUTLINE_SIDE; x++)
            label[y * OUTLINE_SIDE + x] =
                is_inside(shape, (x - OUTLINE_MIDDLE) / 240.0, (y - OUTLINE_MIDDLE) / 240.0) ? 1
                                                                                             : 2;
    spread(label, 0, 0);
    for (int32_t i = 0; i < OUTLINE_PIXELS && outlines < SCENE_OUTLINES; i++) {
        if (label[i] == 2)
            spread(label, i, ++known);
        else if (outlines > 0 || label[i] != 1)
            continue;
        counts[outlines] = go_round(label, label[i], i, &vertices[used], most - used);
        used += counts[outlines++];
    }
    return outlines;
}

/* ---- The picture ---- */

static void add_background(scene *s, cairn_random *random)
{
    for (int32_t wave = 128; wave >= 4; wave /= 2) {
        int32_t columns = SCENE_WIDTH / wave + 2, rows = SCENE_HEIGHT / wave + 2;
        double *knot = malloc((size_t)columns * (size_t)rows * sizeof *knot);

        for (int32_t i = 0; knot != NULL && i < columns * rows; i++)
            knot[i] = bench_uniform(random, -1, 1) * 25 * wave / 128;
        for (int32_t i = 0; knot != NULL && i < SCENE_PIXELS; i++) {
            double x = (double)(i % SCENE_WIDTH) / wave, y = (double)row_of(i) / wave;
            int32_t u = (int32_t)x, v = (int32_t)y;
            double fx = x - u, fy = y - v;
            const double *k = &knot[v * columns + u];

            s->grey[i] += (float)((k[0] * (1 - fx) + k[1] * fx) * (1 - fy) +
                                  (k[columns] * (1 - fx) + k[columns + 1] * fx) * fy);
        }
        free(knot);
    }
}

static void add_clutter(scene *s, cairn_random *random)
{
    double cx = bench_uniform(random, 0, SCENE_WIDTH), cy = bench_uniform(random, 0, SCENE_HEIGHT);
    double rx = bench_uniform(random, 6, 45), ry = bench_uniform(random, 4, 30),
           turn = bench_uniform(random, 0, PI);
    double contrast = bench_uniform(random, 20, 60), sine = sin(turn), cosine = cos(turn);
    int32_t kind = cairn_random_below(random, 3);

    if (cairn_random_below(random, 2))
        contrast = -contrast;
    for (int32_t i = 0; i < SCENE_PIXELS; i++) {
        double dx = i % SCENE_WIDTH - cx, dy = (double)row_of(i) - cy;
        double x = (cosine * dx + sine * dy) / rx, y = (cosine * dy - sine * dx) / ry;

        if (kind == 0   ? x * x + y * y <= 1
            : kind == 1 ? fabs(x) <= 1 && fabs(y) <= 1
                        : y <= 1 && fabs(x) <= (y + 1) / 2 && y >= -1)
            s->grey[i] += (float)contrast;
    }
}

/* The object of `size` px; marks its boundary. */
static void add_object(scene *s, const scene_figure *figure, cairn_random *random)
{
    double size = 120 * bench_uniform(random, 0.7, 1.3),
           turn = bench_uniform(random, -figure->max_turn, figure->max_turn) * PI / 180;
    double cx = bench_uniform(random, size * 0.6, SCENE_WIDTH - size * 0.6);
    double cy = bench_uniform(random, size * 0.6, SCENE_HEIGHT - size * 0.6);
    double contrast = cairn_random_below(random, 2) ? 60 : -60;

    s->at[0] = cx;
    s->at[1] = cy;
    s->size = size;
    s->turn = turn;
    for (int32_t i = 0; i < SCENE_PIXELS; i++) {
        double dx = (i % SCENE_WIDTH - cx) / size, dy = (row_of(i) - cy) / size;

        s->inside[i] = (uint8_t)figure->contains(figure->shape, cos(turn) * dx + sin(turn) * dy,
                                                 cos(turn) * dy - sin(turn) * dx);
        s->grey[i] += s->inside[i] ? (float)contrast : 0;
    }
}

static void mark_boundary(scene *s)
{
    const uint8_t *inside = s->inside;

    s->box[0] = s->box[1] = 1e9;
    s->box[2] = s->box[3] = -1e9;
    for (int32_t i = 0; i < SCENE_PIXELS; i++) {
        int32_t x = i % SCENE_WIDTH, y = i / SCENE_WIDTH;

        if (!inside[i] || x == 0 || y == 0 || x == SCENE_WIDTH - 1 || y == SCENE_HEIGHT - 1)
            continue;
        s->box[0] = fmin(s->box[0], x);
        s->box[1] = fmin(s->box[1], y);
        s->box[2] = fmax(s->box[2], x);
        s->box[3] = fmax(s->box[3], y);
        if (!inside[i - 1] || !inside[i + 1] || !inside[i - SCENE_WIDTH] ||
            !inside[i + SCENE_WIDTH])
            s->truth[i] = 2;
    }
}

/* A disc about a place of the boundary, large enough to hide the requested share. */
static void hide(scene *s, double share, cairn_random *random)
{
    int32_t total = 0, chosen, at = -1;
    double radius = 4, contrast = bench_uniform(random, -60, 60);

    for (int32_t i = 0; i < SCENE_PIXELS; i++)
        total += s->truth[i] > 0;
    chosen = cairn_random_below(random, total);
    for (int32_t i = 0; i < SCENE_PIXELS && chosen >= 0; i++)
        if (s->truth[i] > 0 && chosen-- == 0)
            at = i;
    for (int32_t hidden = 0; at >= 0 && hidden < share * total; radius += 1) {
        hidden = 0;
        for (int32_t i = 0; i < SCENE_PIXELS; i++)
            hidden += s->truth[i] > 0 &&
                      hypot(i % SCENE_WIDTH - at % SCENE_WIDTH, row_of(i) - row_of(at)) <= radius;
    }
    for (int32_t i = 0; at >= 0 && i < SCENE_PIXELS; i++)
        if (hypot(i % SCENE_WIDTH - at % SCENE_WIDTH, row_of(i) - row_of(at)) <= radius) {
            s->truth[i] = s->truth[i] > 0;
            s->grey[i] = (float)(128 + contrast);
        }
}

/* ---- Edges: the gradient of the smoothed picture, its crests, by hysteresis ---- */

static void smooth(float *to, const float *from, int32_t step, int32_t length, int32_t other,
                   int32_t lines)
{
    static const double weight[5] = {0.2659, 0.2129, 0.1093, 0.0360, 0.0088};

    for (int32_t line = 0; line < lines; line++)
        for (int32_t i = 0; i < length; i++) {
            double sum = 0;

            for (int32_t k = -4; k <= 4; k++) {
                int32_t at = i + k < 0 ? 0 : i + k >= length ? length - 1 : i + k;

                sum += weight[k < 0 ? -k : k] * (double)from[line * other + at * step];
            }
            to[line * other + i * step] = (float)sum;
        }
}

static void find_edges(scene *s)
{
    static float across[SCENE_PIXELS], smoothed[SCENE_PIXELS], gradient[SCENE_PIXELS];
    static const double low = 4, high = 8;
    int changed = 1;

    smooth(across, s->grey, 1, SCENE_WIDTH, SCENE_WIDTH, SCENE_HEIGHT);
    smooth(smoothed, across, SCENE_WIDTH, SCENE_HEIGHT, 1, SCENE_WIDTH);
    memset(s->edges, 0, sizeof s->edges);
    memset(gradient, 0, sizeof gradient);
#define GX(i) ((double)(smoothed[(i) + 1] - smoothed[(i)-1]) / 2)
#define GY(i) ((double)(smoothed[(i) + SCENE_WIDTH] - smoothed[(i)-SCENE_WIDTH]) / 2)
    for (int32_t i = SCENE_WIDTH + 1; i < SCENE_PIXELS - SCENE_WIDTH - 1; i++)
        gradient[i] = (float)hypot(GX(i), GY(i));
    for (int32_t i = 2 * SCENE_WIDTH + 2; i < SCENE_PIXELS - 2 * SCENE_WIDTH - 2; i++) {
        double gx = GX(i), gy = GY(i), t = fabs(gx) > fabs(gy) ? gy / gx : gx / gy,
               sign = t < 0 ? -1 : 1;
        int32_t straight = fabs(gx) > fabs(gy) ? 1 : SCENE_WIDTH,
                aside = (straight == 1 ? SCENE_WIDTH : 1) * (int32_t)sign;
        double share = fabs(t), ahead, behind;

        if ((double)gradient[i] < low || i % SCENE_WIDTH < 2 || i % SCENE_WIDTH >= SCENE_WIDTH - 2)
            continue;
        ahead = (1 - share) * (double)gradient[i + straight] +
                share * (double)gradient[i + straight + aside];
        behind = (1 - share) * (double)gradient[i - straight] +
                 share * (double)gradient[i - straight - aside];
        if ((double)gradient[i] > ahead && (double)gradient[i] >= behind)
            s->edges[i] = (double)gradient[i] >= high ? 255 : 1;
    }
#undef GX
#undef GY
    while (changed) {
        changed = 0;
        for (int32_t i = SCENE_WIDTH + 1; i < SCENE_PIXELS - SCENE_WIDTH - 1; i++)
            for (int32_t k = 0; k < 9 && s->edges[i] == 1; k++)
                if (s->edges[i + (k / 3 - 1) * SCENE_WIDTH + k % 3 - 1] == 255) {
                    s->edges[i] = 255;
                    changed = 1;
                }
    }
    for (int32_t i = 0; i < SCENE_PIXELS; i++)
        s->edges[i] = s->edges[i] == 255 ? (uint8_t)fmin(255, 10 * (double)gradient[i]) : 0;
}

void scene_draw(scene *s, const scene_shape *shape, const scene_options *options,
                cairn_random *random)
{
    scene_figure figure = {is_inside, shape, 10};

    scene_draw_figure(s, &figure, options, random);
}

void scene_draw_figure(scene *s, const scene_figure *figure, const scene_options *options,
                       cairn_random *random)
{
    memset(s->truth, 0, sizeof s->truth);
    for (int32_t i = 0; i < SCENE_PIXELS; i++)
        s->grey[i] = 128;
    add_background(s, random);
    for (int32_t k = 0; k < options->clutter; k++)
        add_clutter(s, random);
    if (!options->without) {
        add_object(s, figure, random);
        mark_boundary(s);
        if (options->hidden > 0)
            hide(s, options->hidden, random);
    }
    for (int32_t i = 0; i < SCENE_PIXELS; i++)
        s->grey[i] += (float)(options->noise * (double)cairn_random_normal(random));
    find_edges(s);
}
