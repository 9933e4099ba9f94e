#include "bench/bench_sweep.h"
#include "bench/bench_random.h"

#include <math.h>
#include <string.h>

#define PI 3.14159265358979323846

const char *sweep_family_name(int32_t family)
{
    static const char *const name[SWEEP_FAMILIES] = {"rod", "wave", "club", "fork", "figure"};

    return name[family];
}

/* Continuation of a limb from its start. */
typedef struct limb {
    double x, y, heading, length;
    double bend, wave; /* rad: total bend, and bend to both sides along it */
    double from, to;   /* radii at its ends */
    double bulge;      /* of the radius in the middle, or in two places */
    int waists;        /* 1: one bulge, 2: two */
} limb;

static void add_limb(sweep_shape *s, const limb *l)
{
    sweep_node *node = s->nodes[s->limbs++];
    double x = l->x, y = l->y, step = l->length / (SWEEP_NODES - 1);

    for (int32_t i = 0; i < SWEEP_NODES; i++) {
        double t = (double)i / (SWEEP_NODES - 1);
        double heading = l->heading + l->bend * (t - 0.5) + l->wave * sin(2 * PI * t);

        node[i].x = x;
        node[i].y = y;
        node[i].r = l->from + t * (l->to - l->from) +
                    l->bulge * sin(l->waists * PI * t) * sin(l->waists * PI * t);
        x += step * cos(heading);
        y += step * sin(heading);
    }
}

/* Moves the middle of its box to the middle of the square. */
static void centre(sweep_shape *s)
{
    double box[4] = {1e9, 1e9, -1e9, -1e9};

    for (int32_t i = 0; i < s->limbs * SWEEP_NODES; i++) {
        const sweep_node *n = &s->nodes[i / SWEEP_NODES][i % SWEEP_NODES];

        box[0] = fmin(box[0], n->x);
        box[1] = fmin(box[1], n->y);
        box[2] = fmax(box[2], n->x);
        box[3] = fmax(box[3], n->y);
    }
    for (int32_t i = 0; i < s->limbs * SWEEP_NODES; i++) {
        sweep_node *n = &s->nodes[i / SWEEP_NODES][i % SWEEP_NODES];

        n->x -= (box[0] + box[2]) / 2;
        n->y -= (box[1] + box[3]) / 2;
    }
}

static void add_rod(sweep_shape *s, int32_t family, cairn_random *random)
{
    limb l = {.heading = bench_uniform(random, -PI, PI),
              .length = bench_uniform(random, 0.8, 1),
              .waists = 1};

    l.from = bench_uniform(random, 0.07, 0.14);
    l.to = l.from * bench_uniform(random, 0.6, 1.2);
    if (family == 0) {
        l.bend = bench_uniform(random, -1, 1) * PI / 2;
        l.bulge = bench_uniform(random, -0.02, 0.04);
    } else if (family == 1) {
        l.wave = bench_uniform(random, 0.4, 0.8) * (cairn_random_below(random, 2) ? 1 : -1);
        l.from = l.to = bench_uniform(random, 0.06, 0.1);
    } else {
        l.from = l.to = bench_uniform(random, 0.06, 0.09);
        l.bulge = bench_uniform(random, 0.04, 0.07);
        l.bend = bench_uniform(random, -0.5, 0.5);
        l.waists = 2;
    }
    add_limb(s, &l);
    s->ends = 2;
}

static void add_fork(sweep_shape *s, cairn_random *random)
{
    double heading = bench_uniform(random, -PI, PI), radius = bench_uniform(random, 0.07, 0.1);

    for (int i = 0; i < 3; i++) {
        limb l = {.from = radius, .waists = 1};

        l.heading = heading + i * 2 * PI / 3 + bench_uniform(random, -0.3, 0.3);
        l.length = bench_uniform(random, 0.4, 0.55);
        l.bend = bench_uniform(random, -0.5, 0.5);
        l.to = radius * bench_uniform(random, 0.6, 1);
        add_limb(s, &l);
    }
    s->ends = 3;
}

static void add_figure(sweep_shape *s, cairn_random *random)
{
    limb body = {.heading = bench_uniform(random, -PI, PI),
                 .length = bench_uniform(random, 0.4, 0.5),
                 .waists = 1};
    const sweep_node *node;

    body.from = bench_uniform(random, 0.11, 0.14);
    body.to = body.from * bench_uniform(random, 0.85, 1.1);
    body.bend = bench_uniform(random, -0.4, 0.4);
    add_limb(s, &body);
    node = s->nodes[0];
    for (int i = 0; i < 4; i++) {
        const sweep_node *at = i < 2 ? &node[0] : &node[SWEEP_NODES - 1];
        limb l = {.x = at->x, .y = at->y, .waists = 1};

        l.heading = body.heading + (i < 2 ? PI : 0) +
                    (i % 2 ? 1 : -1) * bench_uniform(random, 0.6, 1) +
                    (i < 2 ? -0.5 : 0.5) * body.bend;
        l.length = bench_uniform(random, 0.36, 0.46);
        l.bend = bench_uniform(random, -0.5, 0.5);
        l.from = bench_uniform(random, 0.055, 0.07);
        l.to = l.from * bench_uniform(random, 0.7, 1);
        add_limb(s, &l);
    }
    s->ends = 4;
}

sweep_shape sweep_draw(int32_t family, cairn_random *random)
{
    sweep_shape s;

    memset(&s, 0, sizeof s);
    if (family < 3)
        add_rod(&s, family, random);
    else if (family == 3)
        add_fork(&s, random);
    else
        add_figure(&s, random);
    centre(&s);
    return s;
}

int sweep_contains(const void *shape, double x, double y)
{
    const sweep_shape *s = shape;

    for (int32_t l = 0; l < s->limbs; l++)
        for (int32_t i = 0; i + 1 < SWEEP_NODES; i++) {
            const sweep_node *a = &s->nodes[l][i], *b = a + 1;
            double dx = b->x - a->x, dy = b->y - a->y;
            double t = ((x - a->x) * dx + (y - a->y) * dy) / (dx * dx + dy * dy), r, u, v;

            t = t < 0 ? 0 : t > 1 ? 1 : t;
            r = a->r + t * (b->r - a->r);
            u = x - a->x - t * dx;
            v = y - a->y - t * dy;
            if (u * u + v * v <= r * r)
                return 1;
        }
    return 0;
}
