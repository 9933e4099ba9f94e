/* Hough transform: lines compared with a reference implementation, known scenes, tolerances,
 * budgets, refusals. */
#include "tests/test.h"

#include <math.h>

#include "cairn/hough.h"

#define PI     3.14159265358979323846
#define DEGREE (PI / 180)

enum { ITEM_COUNT = 1500, MOST_LINES = 64 };

struct fixture {
    cairn_pool pool;
    cairn_hough *hough;
};

static struct fixture hough_with(cairn_hough_params params)
{
    struct fixture f;

    f.pool = test_pool(cairn_hough_memory(&params));
    assert_ok(cairn_hough_create(&f.hough, &f.pool, &params));
    return f;
}

/* Points of a scene, in the order of their creation. */
struct cloud {
    cairn_oriented_point points[ITEM_COUNT];
    cairn_real weights[ITEM_COUNT];
    int32_t count;
};

/* `count` points from (ax, ay) on, `spacing` apart, on a wall of the unit direction (dx, dy). */
static void add_points_along(struct cloud *c, double ax, double ay, double dx, double dy,
                             int32_t count, double spacing)
{
    for (int32_t i = 0; i < count; i++) {
        cairn_oriented_point *p = &c->points[c->count];

        p->position.x = (cairn_real)(ax + i * spacing * dx);
        p->position.y = (cairn_real)(ay + i * spacing * dy);
        p->direction.x = (cairn_real)dx;
        p->direction.y = (cairn_real)dy;
        c->weights[c->count++] = 1;
    }
}

static void add_wall(struct cloud *c, double ax, double ay, double angle, int32_t count,
                     double spacing)
{
    add_points_along(c, ax, ay, cos(angle), sin(angle), count, spacing);
}

static const cairn_hough_line *search(cairn_hough *hough, const struct cloud *c, int32_t *found)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_hough_begin(hough, c->points, c->weights, c->count));
    assert_ok(cairn_hough_step(hough, &budget));
    return cairn_hough_list(hough, found);
}

/* ---- Reference implementation: all votes of one bin at a time, in double, angles of libm ---- */

struct slow_line {
    double x, y, dx, dy, low, high, covered, votes, rms, peak;
};

struct slow {
    const cairn_hough_params *p;
    const struct cloud *c;
    double middle_x, middle_y, step;
    double angle[ITEM_COUNT]; /* of the points */
    int32_t rows;
    double *votes;
    struct slow_line lines[MOST_LINES];
    int32_t count;
};

static double between(double a, double b, double period)
{
    return fabs(remainder(a - b, period));
}

static double slow_votes(const struct slow *s, int32_t row, int32_t column)
{
    double turn = PI / s->p->angles, tolerance = (double)s->p->angle_tolerance, sum = 0;

    for (int32_t i = 0; i < s->c->count; i++) {
        const cairn_oriented_point *p = &s->c->points[i];
        double off = between(s->angle[i], row * turn, s->p->oriented ? 2 * PI : PI) / tolerance;
        double distance = ((double)p->position.y - s->middle_y) * cos(row * turn) -
                          ((double)p->position.x - s->middle_x) * sin(row * turn);
        double at = distance / s->step + (s->p->distances - 1) * 0.5;

        if (off < 1 && fabs(at - column) < 1)
            sum += (double)s->c->weights[i] * (1 - off) * (1 - fabs(at - column));
    }
    return sum;
}

static void slow_begin(struct slow *s)
{
    double low_x = (double)INFINITY, low_y = (double)INFINITY, high_x = -(double)INFINITY,
           high_y = -(double)INFINITY;

    for (int32_t i = 0; i < s->c->count; i++) {
        low_x = fmin(low_x, (double)s->c->points[i].position.x);
        low_y = fmin(low_y, (double)s->c->points[i].position.y);
        high_x = fmax(high_x, (double)s->c->points[i].position.x);
        high_y = fmax(high_y, (double)s->c->points[i].position.y);
        s->angle[i] =
            atan2((double)s->c->points[i].direction.y, (double)s->c->points[i].direction.x);
    }
    s->middle_x = (low_x + high_x) / 2;
    s->middle_y = (low_y + high_y) / 2;
    s->step = fmax((double)s->p->distance_step,
                   hypot(high_x - low_x, high_y - low_y) / (s->p->distances - 3));
    s->rows = s->p->oriented ? 2 * s->p->angles : s->p->angles;
    s->votes = malloc((size_t)s->rows * (size_t)s->p->distances * sizeof *s->votes);
    assert_non_null(s->votes);
}

static void slow_vote(struct slow *s)
{
    for (int32_t row = 0; row < s->rows; row++)
        for (int32_t column = 0; column < s->p->distances; column++)
            s->votes[row * s->p->distances + column] = slow_votes(s, row, column);
}

static int slow_is_peak(const struct slow *s, int32_t row, int32_t column)
{
    int32_t columns = s->p->distances;
    int32_t rows = (int32_t)ceil((double)s->p->separation_angle / (PI / s->p->angles) - 1e-6);
    int32_t beside = (int32_t)ceil((double)s->p->separation / s->step - 1e-6);
    double votes = s->votes[row * columns + column];

    if (votes < 0.4 * (double)s->p->min_votes)
        return 0;
    for (int32_t r = 0; r < s->rows; r++)
        for (int32_t c = 0; c < columns; c++) {
            int32_t apart = r - row, at = c;

            if (apart > s->rows / 2)
                apart -= s->rows;
            if (apart < -s->rows / 2)
                apart += s->rows;
            if (!s->p->oriented && apart != r - row)
                at = columns - 1 - c;
            if (abs(apart) <= rows && abs(at - column) <= beside &&
                s->votes[r * columns + c] > votes)
                return 0;
        }
    return 1;
}

static int slow_belongs(const struct slow *s, const struct slow_line *l, int32_t i, double reach)
{
    const cairn_oriented_point *p = &s->c->points[i];
    double across = ((double)p->position.y - l->y) * l->dx - ((double)p->position.x - l->x) * l->dy;

    return fabs(across) <= reach &&
           between(s->angle[i], atan2(l->dy, l->dx), s->p->oriented ? 2 * PI : PI) <=
               (double)s->p->angle_tolerance;
}

static int by_value(const void *a, const void *b)
{
    return *(const double *)a < *(const double *)b ? -1 : *(const double *)a > *(const double *)b;
}

/* The line through the points within reach of l: the mean and slope of the distance over the
 * position along it. */
static void slow_refit(const struct slow *s, struct slow_line *l, double reach)
{
    double w = 0, t = 0, d = 0, tt = 0, td = 0, slope;
    struct slow_line old = *l;

    for (int pass = 0; pass < 2; pass++)
        for (int32_t i = 0; i < s->c->count; i++) {
            double x = (double)s->c->points[i].position.x - old.x,
                   y = (double)s->c->points[i].position.y - old.y;
            double along = x * old.dx + y * old.dy, across = y * old.dx - x * old.dy,
                   weight = (double)s->c->weights[i];

            if (!slow_belongs(s, &old, i, reach))
                continue;
            if (pass == 0) {
                w += weight, t += weight * along, d += weight * across;
            } else {
                tt += weight * (along - t / w) * (along - t / w);
                td += weight * (along - t / w) * (across - d / w);
            }
        }
    slope = td / tt;
    l->x = old.x + old.dx * t / w - old.dy * d / w;
    l->y = old.y + old.dy * t / w + old.dx * d / w;
    l->dx = (old.dx - slope * old.dy) / hypot(1, slope);
    l->dy = (old.dy + slope * old.dx) / hypot(1, slope);
}

static void slow_measure(const struct slow *s, struct slow_line *l)
{
    static double places[ITEM_COUNT];
    double t = 0, d = 0, dd = 0;
    int32_t count = 0;

    l->votes = 0;
    for (int32_t i = 0; i < s->c->count; i++) {
        double x = (double)s->c->points[i].position.x - l->x,
               y = (double)s->c->points[i].position.y - l->y;
        double across = y * l->dx - x * l->dy, weight = (double)s->c->weights[i];

        if (!slow_belongs(s, l, i, (double)s->p->support_distance))
            continue;
        places[count++] = x * l->dx + y * l->dy;
        l->votes += weight;
        t += weight * (x * l->dx + y * l->dy);
        d += weight * across;
        dd += weight * across * across;
    }
    if (count == 0)
        return;
    t /= l->votes;
    l->rms = sqrt(fmax(dd / l->votes - d / l->votes * d / l->votes, 0));
    qsort(places, (size_t)count, sizeof *places, by_value);
    l->covered = 0;
    for (int32_t i = 1; i < count; i++)
        if (places[i] - places[i - 1] <= 2 * (double)s->p->spacing)
            l->covered += places[i] - places[i - 1];
    l->low = places[0] - t;
    l->high = places[count - 1] - t;
    l->x += l->dx * t;
    l->y += l->dy * t;
}

static int by_votes(const void *a, const void *b)
{
    const struct slow_line *p = a, *q = b;

    if (p->votes != q->votes)
        return p->votes > q->votes ? -1 : 1;
    return p->peak > q->peak ? -1 : p->peak < q->peak;
}

static double from_middle(const struct slow *s, const struct slow_line *l)
{
    return (s->middle_x - l->x) * l->dy - (s->middle_y - l->y) * l->dx;
}

/* Of coincident lines only the one with more votes stays. */
static void slow_thin(struct slow *s)
{
    int32_t kept = 0;

    for (int32_t i = 0; i < s->count; i++) {
        const struct slow_line *l = &s->lines[i];
        int32_t j = 0;

        for (; j < kept; j++) {
            const struct slow_line *k = &s->lines[j];
            double turned =
                between(atan2(l->dy, l->dx), atan2(k->dy, k->dx), s->p->oriented ? 2 * PI : PI);
            double sign = l->dx * k->dx + l->dy * k->dy < 0 ? -1 : 1;

            if (turned < (double)s->p->separation_angle &&
                fabs(from_middle(s, l) - sign * from_middle(s, k)) < (double)s->p->separation)
                break;
        }
        if (j == kept)
            s->lines[kept++] = *l;
    }
    s->count = kept;
}

static void slow_search(struct slow *s)
{
    slow_begin(s);
    slow_vote(s);
    s->count = 0;
    for (int32_t row = 0; row < s->rows; row++)
        for (int32_t column = 0; column < s->p->distances; column++) {
            double turn = PI / s->p->angles,
                   distance = (column - (s->p->distances - 1) * 0.5) * s->step;
            struct slow_line *l = &s->lines[s->count];

            if (!slow_is_peak(s, row, column))
                continue;
            assert_true(s->count < MOST_LINES);
            l->peak = s->votes[row * s->p->distances + column];
            l->dx = cos(row * turn);
            l->dy = sin(row * turn);
            l->x = s->middle_x - distance * l->dy;
            l->y = s->middle_y + distance * l->dx;
            slow_refit(s, l, 2 * fmax((double)s->p->support_distance, s->step));
            slow_refit(s, l, (double)s->p->support_distance);
            slow_measure(s, l);
            s->count += l->votes >= (double)s->p->min_votes;
        }
    free(s->votes);
    qsort(s->lines, (size_t)s->count, sizeof *s->lines, by_votes);
    slow_thin(s);
}

static double draw(cairn_random *random, double high)
{
    return (double)cairn_random_uniform(random, 0, (cairn_real)high);
}

/* Walls at all angles with noise, and clutter. */
static void scatter(struct cloud *c, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 0);

    c->count = 0;
    for (int32_t wall = 0; wall < 7; wall++) {
        double x = draw(&random, 10);
        double y = draw(&random, 8);
        double angle = draw(&random, 2 * PI);

        add_wall(c, x, y, angle, 40 + 17 * wall, 0.07);
    }
    for (int32_t i = 0; i < c->count; i++) {
        c->points[i].position.x += CAIRN_REAL(0.01) * cairn_random_normal(&random);
        c->points[i].position.y += CAIRN_REAL(0.01) * cairn_random_normal(&random);
    }
    for (int32_t i = 0; i < 300; i++) {
        double x = draw(&random, 10);
        double y = draw(&random, 8);
        double angle = draw(&random, 2 * PI);

        add_wall(c, x, y, angle, 1, 0);
    }
    for (int32_t i = 0; i < c->count; i++)
        c->weights[i] = cairn_random_uniform(&random, CAIRN_REAL(0.5), CAIRN_REAL(1.5));
}

static void assert_same_line(const cairn_hough_line *l, const struct slow_line *s,
                             const cairn_hough_params *p)
{
    double near = NUMBER(1e-9, 2e-4);
    double sign = (double)l->direction.x * s->dx + (double)l->direction.y * s->dy < 0 ? -1 : 1;

    if (p->oriented)
        assert_true(sign > 0);
    assert_near(l->votes, s->votes, NUMBER(1e-9, 1e-3));
    assert_near(l->point.x, s->x, near);
    assert_near(l->point.y, s->y, near);
    assert_near(sign * (double)l->direction.x, s->dx, near);
    assert_near(sign * (double)l->direction.y, s->dy, near);
    assert_near(l->low, sign > 0 ? s->low : -s->high, near);
    assert_near(l->high, sign > 0 ? s->high : -s->low, near);
    assert_near(l->rms, s->rms, near);
    assert_near(l->covered_length, s->covered, 2.1 * (double)p->distance_step);
}

static void finds_what_the_reference_finds(void **state)
{
    static struct cloud c;
    static struct slow s;

    (void)state;
    for (uint64_t seed = 1; seed <= 6; seed++) {
        cairn_hough_params p = cairn_hough_default();
        struct fixture f;
        const cairn_hough_line *lines;
        int32_t found;

        p.angles = seed % 2 != 0 ? 60 : 45;
        p.distances = 260;
        p.max_lines = MOST_LINES;
        p.oriented = seed > 3;
        p.support_distance = CAIRN_REAL(0.06);
        scatter(&c, seed);
        s.p = &p;
        s.c = &c;
        slow_search(&s);
        f = hough_with(p);
        lines = search(f.hough, &c, &found);
        assert_in_range(s.count, 5, 9);
        assert_int_equal(found, s.count);
        assert_int_equal(cairn_hough_dropped(f.hough), 0);
        for (int32_t i = 0; i < found; i++)
            assert_same_line(&lines[i], &s.lines[i], &p);
        test_pool_free(&f.pool);
    }
}

/* ---- As written ---- */

/* Points in a bin, one in each column of every row, whatever their directions. */
static double slow_count(const struct slow *s, int32_t row, int32_t column, int32_t *bin)
{
    double turn = PI / s->p->angles, sum = 0;

    for (int32_t i = 0; i < s->c->count; i++) {
        const cairn_oriented_point *p = &s->c->points[i];
        double distance = ((double)p->position.y - s->middle_y) * cos(row * turn) -
                          ((double)p->position.x - s->middle_x) * sin(row * turn);

        bin[i] = floor(distance / s->step + (s->p->distances - 1) * 0.5 + 0.5) == column;
        sum += bin[i] ? (double)s->c->weights[i] : 0;
    }
    return sum;
}

/* Local maxima: bins that no other within the separation exceeds, or equals and precedes, by all
 * pairs of bins; then those not on a stronger one. */
static void slow_as_written(struct slow *s)
{
    static int32_t bin[ITEM_COUNT];

    slow_begin(s);
    for (int32_t row = 0; row < s->rows; row++)
        for (int32_t column = 0; column < s->p->distances; column++)
            s->votes[row * s->p->distances + column] = slow_count(s, row, column, bin);
    s->count = 0;
    for (int32_t row = 0; row < s->rows; row++)
        for (int32_t column = 0; column < s->p->distances; column++) {
            double turn = PI / s->p->angles,
                   distance = (column - (s->p->distances - 1) * 0.5) * s->step, t = 0, tt = 0;
            double dx = cos(row * turn), dy = sin(row * turn);
            struct slow_line *l = &s->lines[s->count];

            if (s->votes[row * s->p->distances + column] < (double)s->p->min_votes ||
                !slow_is_peak(s, row, column))
                continue;
            assert_true(s->count < MOST_LINES);
            l->peak = l->votes = slow_count(s, row, column, bin);
            l->dx = dx;
            l->dy = dy;
            l->x = s->middle_x - distance * dy;
            l->y = s->middle_y + distance * dx;
            l->low = (double)INFINITY;
            l->high = -(double)INFINITY;
            for (int32_t i = 0; i < s->c->count; i++) {
                double x = (double)s->c->points[i].position.x - l->x,
                       y = (double)s->c->points[i].position.y - l->y;

                if (!bin[i])
                    continue;
                t += (double)s->c->weights[i] * (x * dx + y * dy) / l->votes;
                tt += (double)s->c->weights[i] * (y * dx - x * dy) * (y * dx - x * dy) / l->votes;
                l->low = fmin(l->low, x * dx + y * dy);
                l->high = fmax(l->high, x * dx + y * dy);
            }
            l->low -= t;
            l->high -= t;
            l->x += t * dx;
            l->y += t * dy;
            l->rms = sqrt(tt);
            s->count++;
        }
    free(s->votes);
    qsort(s->lines, (size_t)s->count, sizeof *s->lines, by_votes);
    slow_thin(s);
}

/* All points count for all directions: the directions of the points do not matter. */
static void as_written_is_the_classical_transform(void **state)
{
    static struct cloud c;
    static struct slow s;

    (void)state;
    for (uint64_t seed = 1; seed <= 2; seed++) {
        cairn_hough_params p = cairn_hough_as_written();
        cairn_random random = cairn_random_seed(seed, 9);
        struct fixture f;
        const cairn_hough_line *lines;
        cairn_hough_line first[MOST_LINES];
        int32_t found, again;

        p.angles = 60;
        p.distances = 130 + (int32_t)seed;
        p.max_lines = MOST_LINES;
        p.min_votes = 40;
        scatter(&c, seed);
        s.p = &p;
        s.c = &c;
        slow_as_written(&s);
        p.oriented = 1; /* not read, as these two */
        p.angle_tolerance = CAIRN_REAL(0.01);
        p.support_distance = CAIRN_REAL(0.001);
        f = hough_with(p);
        lines = search(f.hough, &c, &found);
        p.oriented = 0;
        assert_in_range(s.count, 5, MOST_LINES - 1);
        assert_int_equal(found, s.count);
        for (int32_t i = 0; i < found; i++) {
            double sign = (double)lines[i].direction.x * s.lines[i].dx +
                          (double)lines[i].direction.y * s.lines[i].dy;

            first[i] = lines[i];
            assert_near(fabs(sign), 1, NUMBER(1e-9, 1e-5));
            assert_near(lines[i].votes, s.lines[i].votes, NUMBER(1e-9, 1e-3));
            assert_near(lines[i].point.x, s.lines[i].x, NUMBER(1e-9, 2e-4));
            assert_near(lines[i].point.y, s.lines[i].y, NUMBER(1e-9, 2e-4));
            assert_near(lines[i].low, sign > 0 ? s.lines[i].low : -s.lines[i].high,
                        NUMBER(1e-9, 2e-4));
            assert_near(lines[i].high, sign > 0 ? s.lines[i].high : -s.lines[i].low,
                        NUMBER(1e-9, 2e-4));
            assert_near(lines[i].rms, s.lines[i].rms, NUMBER(1e-9, 2e-4));
        }
        for (int32_t i = 0; i < c.count; i++)
            c.points[i].direction.x = cairn_random_uniform(&random, -1, 1);
        lines = search(f.hough, &c, &again);
        assert_int_equal(again, found);
        assert_memory_equal(lines, first, (size_t)found * sizeof *first);
        test_pool_free(&f.pool);
    }
}

/* The number of points of a wall and of those that lie in its bin by chance. */
static void as_written_votes_are_points(void **state)
{
    static struct cloud c;
    cairn_hough_params p = cairn_hough_as_written();
    struct fixture f;
    const cairn_hough_line *lines;
    int32_t found;

    (void)state;
    c.count = 0;
    add_wall(&c, 0, 0, 0, 50, 0.1);
    add_wall(&c, 8, 0, PI / 2, 20, 0.1); /* its first point lies on the first wall's line */
    add_wall(&c, 3, 3, PI, 1, 0);
    f = hough_with(p);
    lines = search(f.hough, &c, &found);
    assert_int_equal(found, 2);
    assert_near(lines[0].votes, 51, 0);
    assert_near(lines[0].high - lines[0].low, 8, 1e-5);
    assert_near(lines[1].votes, 20, 0);
    test_pool_free(&f.pool);
}

/* ---- Exactly known results ---- */

/* Two segments of one wall with a door between them, two metres apart, seen from both sides. */
static void segments_of_a_wall_are_one_line(void **state)
{
    static struct cloud c;
    struct fixture f = hough_with(cairn_hough_default());
    const cairn_hough_line *lines;
    cairn_segment s;
    int32_t found;

    (void)state;
    for (int32_t turn = 0; turn < 24; turn++) {
        double angle = turn * 15 * DEGREE, dx = cos(angle), dy = sin(angle);

        c.count = 0;
        add_wall(&c, 3 + dx, -5 + dy, angle, 31, 0.1);
        add_wall(&c, 3 + 6 * dx, -5 + 6 * dy, angle, 21, 0.1);
        /* another face */
        add_wall(&c, 3 + 8 * dx - 0.3 * dy, -5 + 8 * dy + 0.3 * dx, angle + PI, 26, 0.1);
        lines = search(f.hough, &c, &found);
        assert_int_equal(found, 2);
        assert_near(lines[0].votes, 52, 0);
        assert_near(lines[0].direction.x, dx, NUMBER(1e-12, 1e-5));
        assert_near(lines[0].direction.y, dy, NUMBER(1e-12, 1e-5));
        assert_near(lines[0].high - lines[0].low, 7, NUMBER(1e-9, 1e-4));
        assert_near(lines[0].covered_length, 5, 0.1);
        assert_near(lines[0].rms, 0, NUMBER(1e-7, 1e-3));
        s = cairn_hough_segment(&lines[0]);
        assert_near(s.a.x, 3 + dx, NUMBER(1e-9, 1e-4));
        assert_near(s.a.y, -5 + dy, NUMBER(1e-9, 1e-4));
        assert_near(s.b.x, 3 + 8 * dx, NUMBER(1e-9, 1e-4));
        assert_near(s.b.y, -5 + 8 * dy, NUMBER(1e-9, 1e-4));
        assert_near(lines[1].votes, 26, 0);
        assert_near(lines[1].direction.x, -dx, NUMBER(1e-12, 1e-5));
    }
    test_pool_free(&f.pool);
}

static void faces_are_one_without_orientation(void **state)
{
    static struct cloud c;
    cairn_hough_params p = cairn_hough_default();
    struct fixture f;
    const cairn_hough_line *lines;
    int32_t found;

    (void)state;
    p.oriented = 0;
    f = hough_with(p);
    for (int32_t turn = -2; turn < 20; turn++) {
        double angle = turn * 10 * DEGREE + 1e-3, dx = cos(angle), dy = sin(angle);

        c.count = 0;
        add_wall(&c, 1, 1, angle, 20, 0.1);
        add_wall(&c, 1 + 5 * dx, 1 + 5 * dy, angle + PI, 20, 0.1);
        lines = search(f.hough, &c, &found);
        assert_int_equal(found, 1);
        assert_near(lines[0].votes, 40, 0);
        assert_true(lines[0].direction.x > 0);
        assert_near((double)lines[0].direction.x * dy, (double)lines[0].direction.y * dx,
                    NUMBER(1e-12, 1e-5));
        assert_near(lines[0].high - lines[0].low, 5, NUMBER(1e-9, 1e-4));
        assert_near(lines[0].high + lines[0].low, 0, NUMBER(1e-9, 1e-4));
    }
    test_pool_free(&f.pool);
}

/* Parallel walls are separated from the separation on, and nearly parallel ones from its angle
 * on. */
static void separation(void **state)
{
    static struct cloud c;
    struct fixture f = hough_with(cairn_hough_default());
    const cairn_hough_line *lines;
    int32_t found;

    (void)state;
    for (int32_t apart = 13; apart <= 40; apart += 6) {
        c.count = 0;
        add_wall(&c, 0, 0, 0, 60, 0.1);
        add_wall(&c, 0, apart * 0.01, 0, 50, 0.1);
        lines = search(f.hough, &c, &found);
        assert_int_equal(found, apart > 21 ? 2 : 1);
        assert_near(lines[0].votes, 60, 0);
    }
    for (int32_t degrees = 4; degrees <= 30; degrees += 2) {
        c.count = 0;
        add_wall(&c, -3, 0, 0, 60, 0.1);
        add_wall(&c, -3 * cos(degrees * DEGREE), -3 * sin(degrees * DEGREE), degrees * DEGREE, 60,
                 0.1);
        (void)search(f.hough, &c, &found);
        if (degrees <= 8)
            assert_int_equal(found, 1);
        if (degrees > 12)
            assert_int_equal(found, 2);
    }
    test_pool_free(&f.pool);
}

/* Points of deviating direction vote less and less, and then not at all. */
static void directions_count(void **state)
{
    static struct cloud c;
    struct fixture f = hough_with(cairn_hough_default());
    int32_t found;

    (void)state;
    for (int32_t degrees = 0; degrees <= 180; degrees += 5) {
        c.count = 0;
        add_wall(&c, 0, 0, 0, 100, 0.1);
        for (int32_t i = 0; i < c.count; i++) {
            c.points[i].direction.x = (cairn_real)cos(degrees * DEGREE);
            c.points[i].direction.y = (cairn_real)sin(degrees * DEGREE);
        }
        (void)search(f.hough, &c, &found);
        assert_int_equal(found, degrees <= 5 || degrees >= 175); /* there it is the other face */
    }
    for (int32_t i = 0; i < c.count; i++)
        c.points[i].direction.x = c.points[i].direction.y = 0;
    (void)search(f.hough, &c, &found);
    assert_int_equal(found, 0);
    test_pool_free(&f.pool);
}

static void weights_are_votes(void **state)
{
    static struct cloud c;
    struct fixture f = hough_with(cairn_hough_default());
    cairn_budget budget = {CAIRN_UNBOUNDED};
    const cairn_hough_line *lines;
    int32_t found;

    (void)state;
    c.count = 0;
    add_wall(&c, 0, 0, 1, 30, 0.1);
    for (int32_t i = 0; i < c.count; i++)
        c.weights[i] = CAIRN_REAL(0.66);
    (void)search(f.hough, &c, &found);
    assert_int_equal(found, 0); /* 19.8 */
    for (int32_t i = 0; i < c.count; i++)
        c.weights[i] = CAIRN_REAL(0.67);
    (void)search(f.hough, &c, &found);
    assert_int_equal(found, 1); /* 20.1 */
    for (int32_t i = 0; i < c.count; i++)
        c.weights[i] = i < 15 ? CAIRN_REAL(0.5) : 1;
    lines = search(f.hough, &c, &found);
    assert_int_equal(found, 1);
    assert_near(lines[0].votes, 22.5, 1e-4);
    assert_near(lines[0].point.x, (0.5 * 15 * 0.7 + 15 * 2.2) / 22.5 * cos(1), 1e-4);
    assert_ok(cairn_hough_begin(f.hough, c.points, NULL, c.count));
    assert_ok(cairn_hough_step(f.hough, &budget));
    lines = cairn_hough_list(f.hough, &found);
    assert_near(lines[0].votes, 30, 0);
    assert_near(lines[0].point.x, 1.45 * cos(1), 1e-4);
    for (int32_t i = 0; i < 15; i++)
        c.weights[i] = 0;
    c.weights[15] = 10;
    lines = search(f.hough, &c, &found);
    assert_near(lines[0].high - lines[0].low, 1.4, 1e-4);
    test_pool_free(&f.pool);
}

/* Weights are relative to min_votes: those of a line may be far below 1 in all. */
static void small_weights_make_the_same_lines(void **state)
{
    static struct cloud c;
    cairn_hough_params params = cairn_hough_default();

    (void)state;
    for (int small = 0; small < 2; small++) {
        cairn_real scale = small ? CAIRN_REAL(0.0078125) : 1; /* 1 / 128 */
        const cairn_hough_line *lines;
        struct fixture f;
        int32_t found;

        params.min_votes = 20 * scale;
        f = hough_with(params);
        c.count = 0;
        add_wall(&c, 0, 0, 1, 30, 0.1);
        for (int32_t i = 0; i < c.count; i++)
            c.weights[i] = (i < 15 ? CAIRN_REAL(0.5) : 1) * scale;
        lines = search(f.hough, &c, &found);
        assert_int_equal(found, 1);
        assert_near(lines[0].votes, 22.5 * (double)scale, 1e-4);
        assert_near(lines[0].point.x, (0.5 * 15 * 0.7 + 15 * 2.2) / 22.5 * cos(1), 1e-4);
        assert_near(lines[0].rms, 0, 1e-4);
        test_pool_free(&f.pool);
    }
}

static void the_highest_peaks_are_kept(void **state)
{
    static struct cloud c;
    cairn_hough_params p = cairn_hough_default();
    struct fixture f;
    const cairn_hough_line *lines;
    int32_t found;
    static const int32_t counts[] = {30, 60, 40, 70, 50};

    (void)state;
    p.max_lines = 3;
    f = hough_with(p);
    c.count = 0;
    for (int32_t i = 0; i < 5; i++)
        add_wall(&c, 0, i, 0, counts[i], 0.1);
    lines = search(f.hough, &c, &found);
    assert_int_equal(found, 3);
    assert_int_equal(cairn_hough_dropped(f.hough), 2);
    assert_near(lines[0].votes, 70, 0);
    assert_near(lines[1].votes, 60, 0);
    assert_near(lines[2].votes, 50, 0);
    test_pool_free(&f.pool);
}

/* Distant points make the columns wider; none is dropped. */
static void far_points_fit(void **state)
{
    static struct cloud c;
    cairn_hough_params p = cairn_hough_default();
    struct fixture f;
    const cairn_hough_line *lines;
    int32_t found;

    (void)state;
    p.distances = 8;
    f = hough_with(p);
    c.count = 0;
    add_wall(&c, -1000, 300, 0, 30, 60);
    add_wall(&c, 500, -900, PI / 2, 40, 60);
    lines = search(f.hough, &c, &found);
    assert_int_equal(found, 2);
    assert_near(lines[0].votes, 40, 0);
    assert_near(lines[0].point.x, 500, 1e-2);
    assert_near(lines[1].votes, 30, 0);
    assert_near(lines[1].point.y, 300, 1e-2);
    /* the points are farther apart than the spacing says */
    assert_near(lines[1].covered_length, 0, 0);
    test_pool_free(&f.pool);
}

/* The columns lie about the points, wherever these are. */
static void places_do_not_matter(void **state)
{
    static struct cloud c;
    struct fixture f = hough_with(cairn_hough_default());
    const cairn_hough_line *lines;
    int32_t found;

    (void)state;
    for (int32_t i = 0; i < 9; i++) {
        int32_t column = i % 3 - 1, row = i / 3 - 1;
        double x = 300 * column, y = 300 * row;

        c.count = 0;
        add_wall(&c, x + 1, y + 1, 0.3, 60, 0.1);
        add_wall(&c, x + 1 - 0.3 * sin(0.3), y + 1 + 0.3 * cos(0.3), 0.3, 40, 0.1);
        lines = search(f.hough, &c, &found);
        assert_int_equal(found, 2);
        assert_near(lines[0].votes, 60, 0);
        assert_near(lines[1].votes, 40, 0);
        assert_near(lines[1].covered_length, 3.9, 0.1);
    }
    test_pool_free(&f.pool);
}

/* With other tolerances the same points give other lines; capacities stay. */
static void tolerances_can_be_adjusted(void **state)
{
    static struct cloud c;
    cairn_hough_params p = cairn_hough_default(), other;
    struct fixture f = hough_with(p);
    const cairn_hough_line *lines;
    cairn_budget budget = {10};
    int32_t found;

    (void)state;
    c.count = 0;
    add_wall(&c, 0, 0, 0.2, 30, 0.1);
    add_wall(&c, 5 * cos(0.2) - 0.3 * sin(0.2), 5 * sin(0.2) + 0.3 * cos(0.2), 0.2, 30, 0.1);
    (void)search(f.hough, &c, &found);
    assert_int_equal(found, 2);
    p.support_distance = CAIRN_REAL(0.3);
    p.separation = CAIRN_REAL(0.6);
    assert_ok(cairn_hough_begin(f.hough, c.points, c.weights, c.count));
    assert_status(cairn_hough_step(f.hough, &budget), CAIRN_MORE);
    assert_ok(cairn_hough_adjust(f.hough, &p));
    assert_ok(cairn_hough_step(f.hough, &budget)); /* given up */
    (void)cairn_hough_list(f.hough, &found);
    assert_int_equal(found, 2);
    lines = search(f.hough, &c, &found);
    assert_int_equal(found, 1);
    assert_near(lines[0].votes, 60, 0);
    p.angle_tolerance = p.separation_angle = CAIRN_REAL(0.1);
    p.min_votes = 61;
    assert_ok(cairn_hough_adjust(f.hough, &p));
    (void)search(f.hough, &c, &found);
    assert_int_equal(found, 0);
    for (int32_t i = 0; i < 6; i++) {
        other = p;
        other.max_lines += i == 0;
        other.angles += i == 1;
        other.distances += i == 2;
        other.oriented = i != 3;
        other.support_distance *= i == 4 ? -1 : 1;
        assert_status(cairn_hough_adjust(i == 5 ? NULL : f.hough, &other), CAIRN_BAD_ARGUMENT);
    }
    assert_ok(cairn_hough_adjust(f.hough, &p));
    test_pool_free(&f.pool);
}

/* ---- The bits ---- */

/* Walls on a grid of a quarter of a metre with weights in halves, so that votes tie and distances
 * equal the params' limits; every third scene is rotated and noisy. */
static void draw_quarters(struct cloud *c, cairn_random *random)
{
    static const double directions[8][2] = {{1, 0},  {0.8, 0.6},   {0, 1},  {-0.6, 0.8},
                                            {-1, 0}, {-0.8, -0.6}, {0, -1}, {0.6, -0.8}};
    int32_t walls = 2 + cairn_random_below(random, 6), turned = cairn_random_below(random, 3) == 0;
    cairn_pose pose = {1, 2, turned ? cairn_random_uniform(random, 0, 2 * CAIRN_PI) : 0};
    cairn_transform turn = cairn_transform_of(pose);

    c->count = 0;
    for (int32_t i = 0; i < walls; i++) {
        const double *direction = directions[cairn_random_below(random, 8)];
        double x = 0.25 * cairn_random_below(random, 24);
        double y = 0.25 * cairn_random_below(random, 24);
        double spacing = 0.125 * (1 + cairn_random_below(random, 4));

        add_points_along(c, x, y, direction[0], direction[1], 6 + cairn_random_below(random, 30),
                         spacing);
    }
    for (int32_t i = 0; i < c->count; i++) {
        cairn_oriented_point *p = &c->points[i];

        c->weights[i] = CAIRN_REAL(0.5) * (cairn_real)cairn_random_below(random, 4);
        if (turned) {
            p->position.x += CAIRN_REAL(0.02) * cairn_random_normal(random);
            p->position = cairn_transform_point(turn, p->position);
            p->direction = cairn_transform_direction(turn, p->direction);
        } else if (i % 16 == 0) {
            p->direction.x = p->direction.y = 0;
        }
    }
}

static uint64_t add_real(uint64_t hash, cairn_real x)
{
    assert_true(x == x);
    return test_hash(hash, &x, sizeof x);
}

static uint64_t add_found(const cairn_hough *hough, uint64_t hash)
{
    int32_t found, dropped;
    const cairn_hough_line *l;

    l = cairn_hough_list(hough, &found);
    dropped = cairn_hough_dropped(hough);
    hash = test_hash(hash, &found, sizeof found);
    hash = test_hash(hash, &dropped, sizeof dropped);
    for (int32_t i = 0; i < found; i++) {
        cairn_segment s = cairn_hough_segment(&l[i]);

        hash = add_real(add_real(add_real(add_real(hash, s.a.x), s.a.y), s.b.x), s.b.y);
        hash = add_real(add_real(hash, l[i].point.x), l[i].point.y);
        hash = add_real(add_real(hash, l[i].direction.x), l[i].direction.y);
        hash = add_real(add_real(add_real(hash, l[i].covered_length), l[i].votes), l[i].rms);
    }
    return hash;
}

static uint64_t hash_of_search(cairn_hough *hough, const struct cloud *c, int32_t weighted,
                               uint64_t hash)
{
    cairn_budget budget = {1 << 28};

    assert_ok(cairn_hough_begin(hough, c->points, weighted ? c->weights : NULL, c->count));
    assert_ok(cairn_hough_step(hough, &budget));
    return add_found(hough, test_hash(hash, &budget.left, sizeof budget.left));
}

/* Params whose limits are the scenes' quarters, and few lines. */
static cairn_hough_params draw_params(cairn_random *random)
{
    cairn_hough_params p = cairn_hough_default();

    p.angles = 16 << cairn_random_below(random, 2);
    p.distances = 31 + cairn_random_below(random, 40);
    p.distance_step = CAIRN_REAL(0.25);
    p.angle_tolerance = CAIRN_PI / (cairn_real)(8 + cairn_random_below(random, 8));
    p.separation = CAIRN_REAL(0.25) * (cairn_real)(1 + cairn_random_below(random, 4));
    p.separation_angle = CAIRN_PI / (cairn_real)(8 + cairn_random_below(random, 3));
    p.support_distance = CAIRN_REAL(0.125) * (cairn_real)(1 + cairn_random_below(random, 3));
    p.spacing = CAIRN_REAL(0.25) * (cairn_real)(1 + cairn_random_below(random, 2));
    p.min_votes = (cairn_real)(4 + cairn_random_below(random, 8));
    p.max_lines = 1 + cairn_random_below(random, 12);
    return p;
}

static uint64_t hash_of_scenes(int32_t oriented)
{
    static struct cloud c;
    uint64_t hash = TEST_HASH_START;
    cairn_random random = cairn_random_seed(6, 0);

    for (int32_t i = 0; i < 120; i++) {
        cairn_hough_params p = draw_params(&random);
        struct fixture f;

        p.oriented = oriented;
        f = hough_with(p);
        for (int32_t k = 0; k < 2; k++) { /* the second must not see the first */
            draw_quarters(&c, &random);
            hash = hash_of_search(f.hough, &c, i % 4, hash);
        }
        test_pool_free(&f.pool);
    }
    return hash;
}

static void all_bits_are_kept(void **state)
{
    (void)state;
    assert_golden(hash_of_scenes(0), UINT64_C(0x48a7ac093b3790a4), UINT64_C(0xaf85cdb07a6fa2f1));
    assert_golden(hash_of_scenes(1), UINT64_C(0x4a4dfdf585411221), UINT64_C(0x89702d1795969e21));
}

/* ---- Steps, statuses, memory ---- */

static void the_budget_does_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    static struct cloud c;
    static cairn_hough_line whole[MOST_LINES];
    struct fixture f = hough_with(cairn_hough_default());
    const cairn_hough_line *lines;
    int32_t found, count;

    (void)state;
    scatter(&c, 9);
    for (int32_t i = 0; i < 8; i++)
        add_wall(&c, 12 + i, 1, 1, 50, 0.1);
    lines = search(f.hough, &c, &count);
    memcpy(whole, lines, (size_t)count * sizeof *whole);
    for (int i = 0; i < 3; i++) {
        cairn_budget budget = {0};
        cairn_status status;
        int64_t units = 0;

        assert_ok(cairn_hough_begin(f.hough, c.points, c.weights, c.count));
        assert_status(cairn_hough_step(f.hough, &budget), CAIRN_MORE);
        do {
            budget.left = budgets[i];
            status = cairn_hough_step(f.hough, &budget);
            assert_true(budget.left >= 0);
            units += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        lines = cairn_hough_list(f.hough, &found);
        assert_int_equal(found, count);
        assert_memory_equal(lines, whole, (size_t)count * sizeof *whole);
        assert_int_equal(units, NUMBER(0x7f17, 0x7ebd));
        assert_ok(cairn_hough_step(f.hough, &budget)); /* nothing left to do */
    }
    test_pool_free(&f.pool);
}

struct under_way {
    cairn_hough *hough;
    struct cloud *cloud;
};

static cairn_status begin_cloud(void *context)
{
    struct under_way *u = context;

    return cairn_hough_begin(u->hough, u->cloud->points, u->cloud->weights, u->cloud->count);
}

static cairn_status step_cloud(void *context, cairn_budget *budget)
{
    return cairn_hough_step(((struct under_way *)context)->hough, budget);
}

static uint64_t hash_cloud(void *context)
{
    return add_found(((struct under_way *)context)->hough, TEST_HASH_START);
}

static void begins_anew(void **state)
{
    static struct cloud c;
    cairn_hough_params p = cairn_hough_default();
    struct fixture f;
    struct under_way u;
    test_stepped object = {begin_cloud, step_cloud, hash_cloud, &u};

    (void)state;
    p.angles = 32;
    p.distances = 64;
    p.max_lines = 4;
    f = hough_with(p);
    u.hough = f.hough;
    u.cloud = &c;
    scatter(&c, 3);
    test_begins_anew(&object, 31);
    test_pool_free(&f.pool);
}

static void nothing_gives_no_lines(void **state)
{
    static struct cloud c;
    struct fixture f = hough_with(cairn_hough_default());
    cairn_budget budget = {CAIRN_UNBOUNDED};
    int32_t found;

    (void)state;
    (void)cairn_hough_list(f.hough, &found);
    assert_int_equal(found, 0);
    assert_ok(cairn_hough_step(f.hough, &budget));
    assert_ok(cairn_hough_begin(f.hough, NULL, NULL, 0));
    assert_ok(cairn_hough_step(f.hough, &budget));
    (void)cairn_hough_list(f.hough, &found);
    assert_int_equal(found, 0);
    /* One place has no direction. */
    c.count = 0;
    add_wall(&c, 7, 7, 1, 100, 0);
    (void)search(f.hough, &c, &found);
    assert_int_equal(found, 0);
    test_pool_free(&f.pool);
}

static void bad_points_are_refused(void **state)
{
    static struct cloud c;
    struct fixture f = hough_with(cairn_hough_default());
    static const struct {
        int field;
        double value;
        cairn_status status;
    } bad[] = {{0, (double)NAN, CAIRN_NOT_FINITE}, {1, (double)INFINITY, CAIRN_NOT_FINITE},
               {2, (double)NAN, CAIRN_NOT_FINITE}, {3, (double)INFINITY, CAIRN_NOT_FINITE},
               {4, (double)NAN, CAIRN_NOT_FINITE}, {0, -1.1e6, CAIRN_BAD_ARGUMENT},
               {1, 1.1e6, CAIRN_BAD_ARGUMENT},     {4, -1e-3, CAIRN_BAD_ARGUMENT},
               {4, 1.1e6, CAIRN_BAD_ARGUMENT}};
    int32_t found;

    (void)state;
    c.count = 0;
    add_wall(&c, 0, 0, 0, 50, 0.1);
    (void)search(f.hough, &c, &found);
    assert_int_equal(found, 1);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        struct cloud copy = c;
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_real *fields[] = {&copy.points[33].position.x, &copy.points[33].position.y,
                                &copy.points[33].direction.x, &copy.points[33].direction.y,
                                &copy.weights[33]};

        *fields[bad[i].field] = (cairn_real)bad[i].value;
        assert_ok(cairn_hough_begin(f.hough, copy.points, copy.weights, copy.count));
        assert_status(cairn_hough_step(f.hough, &budget), bad[i].status);
        assert_ok(cairn_hough_step(f.hough, &budget));
        (void)cairn_hough_list(f.hough, &found);
        assert_int_equal(found, 1);
    }
    assert_status(cairn_hough_begin(NULL, c.points, NULL, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_hough_begin(f.hough, NULL, NULL, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_hough_begin(f.hough, c.points, NULL, -1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_hough_step(f.hough, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_hough_step(NULL, NULL), CAIRN_BAD_ARGUMENT);
    test_pool_free(&f.pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_hough *hough;

    return cairn_hough_create(&hough, pool, context);
}

static void memory_is_exact(void **state)
{
    cairn_hough_params p = cairn_hough_default();

    (void)state;
    p.angles = 8;
    p.distances = 8;
    p.max_lines = 5;
    test_every_pool_size(create, &p, cairn_hough_memory(&p));
    for (int32_t angles = 8; angles <= 1 << 12; angles *= 2) {
        p.angles = angles;
        p.distances = 4 * angles < 1 << 14 ? 4 * angles : 1 << 14;
        p.max_lines = angles / 16 + 1 < 256 ? angles / 16 + 1 : 256;
        assert_true(cairn_hough_memory(&p) <=
                    CAIRN_HOUGH_BYTES(p.angles, p.distances, p.max_lines));
    }
}

/* As written, the fields that are ignored may have any value; the others not. */
static void params_that_the_mode_ignores_are_not_checked(void **state)
{
    cairn_hough_params p = cairn_hough_as_written();
    cairn_object_fault fault = {.field = NULL};

    (void)state;
    p.angle_tolerance = (cairn_real)NAN;
    p.support_distance = 0;
    assert_ok(cairn_hough_check(&p, NULL));
    assert_true(cairn_hough_memory(&p) > 0);
    p.distance_step = 0;
    assert_status(cairn_hough_check(&p, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.field, "distance_step");
}

static void the_ends_of_the_ranges_are_accepted(void **state)
{
    cairn_hough_params p = cairn_hough_default();
    cairn_hough *hough = NULL;

    (void)state;
    assert_status(cairn_hough_create(&hough, NULL, &p), CAIRN_BAD_ARGUMENT);
    p.max_lines = 1;
    p.angles = 8;
    p.distances = 8;
    assert_true(cairn_hough_memory(&p) > 0);
    p.max_lines = 256;
    p.angles = 1 << 12;
    p.distances = 1 << 14;
    p.angle_tolerance = CAIRN_PI / 2;
    assert_true(cairn_hough_memory(&p) > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(finds_what_the_reference_finds),
        cmocka_unit_test(as_written_is_the_classical_transform),
        cmocka_unit_test(as_written_votes_are_points),
        cmocka_unit_test(segments_of_a_wall_are_one_line),
        cmocka_unit_test(faces_are_one_without_orientation),
        cmocka_unit_test(separation),
        cmocka_unit_test(directions_count),
        cmocka_unit_test(weights_are_votes),
        cmocka_unit_test(small_weights_make_the_same_lines),
        cmocka_unit_test(the_highest_peaks_are_kept),
        cmocka_unit_test(far_points_fit),
        cmocka_unit_test(places_do_not_matter),
        cmocka_unit_test(tolerances_can_be_adjusted),
        cmocka_unit_test(all_bits_are_kept),
        cmocka_unit_test(the_budget_does_not_matter),
        cmocka_unit_test(begins_anew),
        cmocka_unit_test(nothing_gives_no_lines),
        cmocka_unit_test(bad_points_are_refused),
        cmocka_unit_test(memory_is_exact),
        cmocka_unit_test(params_that_the_mode_ignores_are_not_checked),
        cmocka_unit_test(the_ends_of_the_ranges_are_accepted),
    };

    return cmocka_run_group_tests_name("hough", tests, NULL, NULL);
}
