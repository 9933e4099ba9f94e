/* Test cases of the hypotheses of virtual scans. */
#include "bench/bench_guess.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_random.h"
#include "cairn/small_matrix.h"
#include "cairn/virtual_align.h"
#include "src/host/base/degrees.h"

/* ---- Ellipses ---- */

enum { ELLIPSES = 4, MOST_POINTS = 1500, STRAYS = 12 };

typedef struct cloud {
    cairn_oriented_point points[MOST_POINTS];
    int32_t count;
} cloud;

/* With 1.5 cm and 3 degrees of noise. */
static void add_point(cloud *c, cairn_oriented_point p, cairn_random *random)
{
    cairn_pose turn = {0, 0, (cairn_real)(3 * CAIRN_DEGREE) * cairn_random_normal(random)};

    if (c->count == MOST_POINTS)
        return;
    p.position.x += (cairn_real)0.015 * cairn_random_normal(random);
    p.position.y += (cairn_real)0.015 * cairn_random_normal(random);
    p.direction = cairn_transform_direction(cairn_transform_of(turn), p.direction);
    c->points[c->count++] = p;
}

/* Rooms and columns alternate in the quarters of a square of 24 m. */
static cairn_ellipse draw_ellipse(int i, cairn_random *random)
{
    cairn_ellipse e;

    memset(&e, 0, sizeof e);
    e.kind = i % 2 == 0 ? CAIRN_ELLIPSE_ROOM : CAIRN_ELLIPSE_COLUMN;
    e.half_width =
        (cairn_real)(i % 2 == 0 ? bench_uniform(random, 1, 3) : bench_uniform(random, 0.3, 0.8));
    e.half_length = e.half_width * (cairn_real)bench_uniform(random, 1, 1.4);
    e.centre.x = (cairn_real)(12 * (i % 2) + bench_uniform(random, -2, 2));
    e.centre.y = (cairn_real)((i < 2 ? 0 : 12) + bench_uniform(random, -2, 2));
    e.centre.theta = (cairn_real)bench_uniform(random, 0, (double)CAIRN_PI);
    return e;
}

static void see_ellipse(cloud *c, const cairn_ellipse *e, cairn_random *random)
{
    double first = bench_uniform(random, 0.2, 0.4),
           gap[2] = {bench_uniform(random, 0, 0.2), bench_uniform(random, 0, 0.2)};
    double start = bench_uniform(random, 0, 1),
           places = ceil((double)cairn_ellipse_length(e) / 0.1);

    for (int i = 0; i < (int)places; i++) {
        double at = i / places;

        if ((at >= gap[0] && at < gap[0] + first) ||
            (at >= gap[0] + first + gap[1] && at < gap[0] + gap[1] + 0.6))
            add_point(c, cairn_ellipse_point(e, (cairn_real)(2 * (double)CAIRN_PI * (at + start))),
                      random);
    }
}

static void add_stray(cloud *c, cairn_random *random)
{
    double angle = bench_uniform(random, 0, 2 * (double)CAIRN_PI),
           length = bench_uniform(random, 0.3, 3);
    double x = bench_uniform(random, -6, 18), y = bench_uniform(random, -6, 18);

    for (double t = 0; t < length; t += 0.1) {
        cairn_oriented_point p;

        p.direction.x = (cairn_real)cos(angle);
        p.direction.y = (cairn_real)sin(angle);
        p.position.x = (cairn_real)x + (cairn_real)t * p.direction.x;
        p.position.y = (cairn_real)y + (cairn_real)t * p.direction.y;
        add_point(c, p, random);
    }
}

/* Centre and axes within 0.3 m, as the corners of rectangles. */
static int is_same(const cairn_ellipse *a, const cairn_ellipse *b)
{
    return a->kind == b->kind &&
           hypot((double)(a->centre.x - b->centre.x), (double)(a->centre.y - b->centre.y)) < 0.3 &&
           fabs((double)(a->half_length - b->half_length)) < 0.3 &&
           fabs((double)(a->half_width - b->half_width)) < 0.3;
}

static void count_found(const cairn_ellipse *truth, const cairn_ellipse *list, int32_t count,
                        int32_t *found, int32_t *wrong)
{
    for (int i = 0; i < ELLIPSES; i++) {
        int32_t k = 0;

        while (k < count && !is_same(&truth[i], &list[k]))
            k++;
        *found += k < count;
    }
    for (int32_t k = 0; k < count; k++) {
        int i = 0;

        while (i < ELLIPSES && !is_same(&truth[i], &list[k]))
            i++;
        *wrong += i == ELLIPSES;
    }
}

int bench_guess_ellipses(uint64_t seed, int32_t *there, int32_t *found, int32_t *wrong)
{
    static cloud c;
    cairn_ellipse_params params = cairn_virtual_scan_default().ellipse;
    cairn_random random = cairn_random_seed(seed, 82);
    size_t bytes = cairn_ellipse_memory(&params) + CAIRN_ALIGN;
    void *memory = malloc(bytes);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_ellipse truth[ELLIPSES];
    cairn_ellipse_set *set = NULL;
    cairn_pool pool;
    int32_t count;
    int done;

    c.count = 0;
    for (int i = 0; i < ELLIPSES; i++) {
        truth[i] = draw_ellipse(i, &random);
        see_ellipse(&c, &truth[i], &random);
    }
    for (int i = 0; i < STRAYS; i++)
        add_stray(&c, &random);
    done = memory != NULL && cairn_pool_init(&pool, memory, bytes) == CAIRN_OK &&
           cairn_ellipse_create(&set, &pool, &params) == CAIRN_OK &&
           cairn_ellipse_begin(set, c.points, NULL, c.count) == CAIRN_OK &&
           cairn_ellipse_step(set, &budget) == CAIRN_OK;
    if (done) {
        const cairn_ellipse *list = cairn_ellipse_list(set, &count);

        *there += ELLIPSES;
        count_found(truth, list, count, found, wrong);
    }
    free(memory);
    return done;
}

/* ---- A box ---- */

enum { BOX_WALLS = 8 };

/* Distance along a ray from p in direction d to a wall, in m; infinity: none. */
static double meet(const double wall[4], double px, double py, double dx, double dy)
{
    double ex = wall[2] - wall[0], ey = wall[3] - wall[1], cross = dx * ey - dy * ex;
    double t = ((wall[0] - px) * ey - (wall[1] - py) * ex) / cross;
    double s = ((wall[0] - px) * dy - (wall[1] - py) * dx) / cross;

    return cross != 0 && t > 0 && s >= 0 && s <= 1 ? t : (double)INFINITY;
}

static void see_box(bench_box *box, int scan, const double walls[BOX_WALLS][4], sim_pose at,
                    cairn_random *random)
{
    sim_scan *s = &box->scans[scan];

    memset(s, 0, sizeof *s);
    s->range = box->range[scan];
    s->edge = NULL;
    s->count = BENCH_BOX_BEAMS;
    s->angle_min = -55 * CAIRN_DEGREE;
    s->angle_step = 110 * CAIRN_DEGREE / (BENCH_BOX_BEAMS - 1);
    s->range_min = 0.1;
    s->range_max = 8;
    s->range_sigma = 0.01;
    s->truth = at;
    for (int i = 0; i < BENCH_BOX_BEAMS; i++) {
        double angle = at.theta + s->angle_min + i * s->angle_step, nearest = (double)INFINITY;
        int hit = -1;

        for (int w = 0; w < BOX_WALLS; w++) {
            double t = meet(walls[w], at.x, at.y, cos(angle), sin(angle));

            if (t < nearest) {
                nearest = t;
                hit = w;
            }
        }
        box->range[scan][i] = (float)(nearest + 0.01 * (double)cairn_random_normal(random));
        box->is_box[scan][i] = hit == 0 || hit == 1;
    }
}

void bench_box_draw(bench_box *box, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 83);
    double length = bench_uniform(&random, 1, 1.6), thick = bench_uniform(&random, 0.25, 0.5),
           turn = bench_uniform(&random, 0, 6.28);
    double l = length / 2, t = thick / 2, w = bench_uniform(&random, 2.6, 3.4),
           h = bench_uniform(&random, 2.6, 3.4);
    const double walls[BOX_WALLS][4] = {{-l, t, l, t},   {-l, -t, l, -t}, {-l, -t, -l, t},
                                        {l, -t, l, t},   {-w, -h, w, -h}, {-w, h, w, h},
                                        {-w, -h, -w, h}, {w, -h, w, h}};

    box->thickness = thick;
    for (int i = 0; i < BENCH_BOX_SCANS; i++) {
        int below = i < BENCH_BOX_SCANS / 2;
        sim_pose at = {bench_uniform(&random, -0.4, 0.4), below ? -1.8 : 1.8,
                       (below ? 90 : -90) * CAIRN_DEGREE + bench_uniform(&random, -0.1, 0.1)};
        double x = at.x;

        see_box(box, i, walls, at, &random);
        at.x = cos(turn) * x - sin(turn) * at.y;
        at.y = sin(turn) * x + cos(turn) * at.y;
        at.theta += turn;
        box->scans[i].truth = at;
    }
}

/* Mean of the hits of the scans from `first` on on the long side, and its direction there. */
static sim_point mean_hit(const bench_box *box, const sim_pose *poses, int first,
                          cairn_sym2 *spread)
{
    sim_point sum = {0, 0};
    double count = 0, xx = 0, xy = 0, yy = 0;

    for (int i = first; i < first + BENCH_BOX_SCANS / 2; i++)
        for (int k = 0; k < BENCH_BOX_BEAMS; k++) {
            double angle = poses[i].theta + box->scans[i].angle_min + k * box->scans[i].angle_step;
            double x = poses[i].x + (double)box->range[i][k] * cos(angle);
            double y = poses[i].y + (double)box->range[i][k] * sin(angle);

            if (!box->is_box[i][k])
                continue;
            sum.x += x;
            sum.y += y;
            xx += x * x;
            xy += x * y;
            yy += y * y;
            count++;
        }
    sum.x /= count;
    sum.y /= count;
    spread->xx = (cairn_real)(xx / count - sum.x * sum.x);
    spread->xy = (cairn_real)(xy / count - sum.x * sum.y);
    spread->yy = (cairn_real)(yy / count - sum.y * sum.y);
    return sum;
}

double bench_box_thickness(const bench_box *box, const sim_pose *poses)
{
    cairn_sym2 spread, other;
    sim_point below = mean_hit(box, poses, 0, &spread),
              above = mean_hit(box, poses, BENCH_BOX_SCANS / 2, &other);
    double heading = poses[0].theta - box->scans[0].truth.theta,
           looks = box->scans[0].truth.theta + heading;
    cairn_real values[2];
    cairn_vec2 across, along;
    double off;

    cairn_sym2_eigen(spread, values, &across, &along);
    off = (above.x - below.x) * (double)across.x + (above.y - below.y) * (double)across.y;
    return (double)across.x * cos(looks) + (double)across.y * sin(looks) > 0 ? off : -off;
}

/* ---- Collinear walls ---- */

static int is_wall(const sim_arena *arena, const sim_edge *e)
{
    int32_t count;

    return !e->curved && !(e->radius > 0) &&
           sim_arena_bodies(arena, &count)[e->body].kind == SIM_WALL;
}

static int is_collinear(const sim_edge *a, const sim_edge *b)
{
    double turned = a->normal.x * b->normal.y - a->normal.y * b->normal.x;
    double same = a->normal.x * b->normal.x + a->normal.y * b->normal.y;

    return same > 0 && fabs(turned) < 0.005 &&
           fabs((b->a.x - a->a.x) * a->normal.x + (b->a.y - a->a.y) * a->normal.y) < 0.005 &&
           fabs((b->b.x - a->a.x) * a->normal.x + (b->b.y - a->a.y) * a->normal.y) < 0.005;
}

/* The first edge collinear with each; -1: no wall. */
static int32_t *lines_of(const sim_arena *arena, int32_t *count)
{
    const sim_edge *edges = sim_arena_edges(arena, count);
    int32_t *line = malloc((size_t)*count * sizeof *line);

    for (int32_t i = 0; i < *count && line != NULL; i++) {
        line[i] = is_wall(arena, &edges[i]) ? i : -1;
        for (int32_t k = 0; k < i && line[i] == i; k++)
            if (line[k] == k && is_collinear(&edges[k], &edges[i]))
                line[i] = k;
    }
    return line;
}

typedef struct sums {
    double n, x, y, xx, xy, yy;
    int32_t scan, scans; /* the last scan that showed it; number of scans that did */
} sums;

static void add_hits(const sim_scan *s, sim_pose at, int32_t scan, const int32_t *line, sums *of)
{
    for (int32_t i = 0; i < s->count; i++) {
        double angle = at.theta + s->angle_min + i * s->angle_step, x, y;
        sums *m;

        if (s->edge[i] < 0 || line[s->edge[i]] < 0)
            continue;
        m = &of[line[s->edge[i]]];
        x = at.x + (double)s->range[i] * cos(angle);
        y = at.y + (double)s->range[i] * sin(angle);
        m->scans += m->n == 0 || m->scan != scan;
        m->scan = scan;
        m->n++;
        m->x += x;
        m->y += y;
        m->xx += x * x;
        m->xy += x * y;
        m->yy += y * y;
    }
}

void bench_guess_straightness(const sim_arena *arena, const sim_scan *scans, const sim_pose *poses,
                              int32_t count, double *squares, double *hits)
{
    int32_t edges, *line = lines_of(arena, &edges);
    sums *of = calloc((size_t)edges, sizeof *of);

    for (int32_t i = 0; i < count && line != NULL && of != NULL; i++)
        add_hits(&scans[i], poses[i], i, line, of);
    for (int32_t i = 0; i < edges && line != NULL && of != NULL; i++) {
        const sums *m = &of[i];
        double xx, xy, yy;

        if (m->scans < 2 || m->n < 10)
            continue;
        xx = m->xx - m->x * m->x / m->n;
        xy = m->xy - m->x * m->y / m->n;
        yy = m->yy - m->y * m->y / m->n;
        *squares += fmax((xx + yy - hypot(xx - yy, 2 * xy)) / 2, 0);
        *hits += m->n;
    }
    free(of);
    free(line);
}

/* ---- A lie ---- */

static cairn_status begin_lie(void *state, const cairn_virtual_scan_map *map)
{
    (void)map;
    ((bench_false_rectangle *)state)->detections++;
    return CAIRN_OK;
}

static cairn_status step_lie(void *state, cairn_budget *budget)
{
    (void)state;
    (void)budget;
    return CAIRN_OK;
}

static int32_t count_lies(const void *state)
{
    const bench_false_rectangle *lie = state;

    return lie->detections - 1 == lie->when;
}

static int32_t report_false_rectangle(const void *state, int32_t i, cairn_real spacing,
                                      cairn_oriented_point *points, int32_t capacity,
                                      cairn_real *strength)
{
    const bench_false_rectangle *lie = state;
    cairn_vec2 corner[4];
    int32_t count = 0;

    (void)i;
    cairn_rectangle_corners(&lie->rectangle, corner);
    for (int k = 0; k < 4; k++) {
        cairn_vec2 way = cairn_vec2_sub(corner[(k + 1) % 4], corner[k]),
                   along = cairn_vec2_unit(way);

        for (cairn_real t = 0; t < cairn_vec2_norm(way) && count < capacity;
             t += spacing, count++) {
            points[count].position = cairn_vec2_add(corner[k], cairn_vec2_scale(along, t));
            points[count].direction = along;
        }
    }
    *strength = 1;
    return count;
}

cairn_virtual_scan_hypothesis_detector bench_lie_detector(bench_false_rectangle *lie)
{
    cairn_virtual_scan_hypothesis_detector detector = {lie, begin_lie, step_lie, count_lies,
                                                       report_false_rectangle};

    return detector;
}

/* Within 0.15 m and 15 degrees of a side of the false rectangle. */
static int is_on_lie(const bench_false_rectangle *lie, const cairn_oriented_point *p)
{
    cairn_vec2 corner[4];

    cairn_rectangle_corners(&lie->rectangle, corner);
    for (int k = 0; k < 4; k++) {
        cairn_segment side = {corner[k], corner[(k + 1) % 4]};
        cairn_vec2 along = cairn_vec2_unit(cairn_vec2_sub(side.b, side.a));

        if ((double)cairn_segment_distance(side, p->position) < 0.15 &&
            (double)cairn_vec2_dot(along, p->direction) > cos(15 * CAIRN_DEGREE))
            return 1;
    }
    return 0;
}

int bench_false_rectangle_is_accepted(const bench_false_rectangle *lie,
                                      const cairn_virtual_scan *hypotheses)
{
    int32_t count, points;
    const cairn_virtual_scan_hypothesis *h = cairn_virtual_scan_hypotheses(hypotheses, &count);
    const cairn_real *weights;
    const cairn_oriented_point *p = cairn_virtual_scan_points(hypotheses, &weights, &points);
    const double outline = 4 * (double)(lie->rectangle.half_length + lie->rectangle.half_width);

    for (int32_t i = 0; i < count; i++) {
        double on = 0;

        for (int32_t k = h[i].first_point; k < h[i].end_point; k++)
            on += is_on_lie(lie, &p[k]);
        if (h[i].weight > 0 && on > (h[i].end_point - h[i].first_point) / 2.0 &&
            on * lie->spacing > outline / 2)
            return 1;
    }
    return 0;
}

bench_false_rectangle bench_false_rectangle_draw(const sim_pose *start, int32_t count,
                                                 uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 85);
    const sim_pose *about = &start[seed % (uint64_t)count];
    bench_false_rectangle lie;

    memset(&lie, 0, sizeof lie);
    lie.when = 1;
    lie.spacing = (double)cairn_virtual_align_default().hypotheses.spacing;
    lie.rectangle.centre.x = (cairn_real)about->x + cairn_random_uniform(&random, -1, 1);
    lie.rectangle.centre.y = (cairn_real)about->y + cairn_random_uniform(&random, -1, 1);
    lie.rectangle.centre.theta = cairn_random_uniform(&random, 0, CAIRN_PI / 2);
    lie.rectangle.half_length = cairn_random_uniform(&random, 1, 3);
    lie.rectangle.half_width = cairn_random_uniform(&random, 1, 3);
    return lie;
}

void bench_guess_print(const cairn_virtual_scan *hypotheses, int32_t step)
{
    static const char *const kinds[] = {"line", "rectangle", "ellipse", "of the caller"};
    int32_t count;
    const cairn_virtual_scan_hypothesis *h = cairn_virtual_scan_hypotheses(hypotheses, &count);

    for (int32_t i = 0; i < count; i++) {
        bench_json_begin("virtual");
        bench_json_integer("step", step);
        bench_json_text("kind", kinds[h[i].kind]);
        bench_json_number("strength", (double)h[i].strength);
        bench_json_number("weight", (double)h[i].weight);
        bench_json_integer("points", h[i].end_point - h[i].first_point);
        bench_json_end();
    }
}
