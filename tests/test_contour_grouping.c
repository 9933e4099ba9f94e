/* Grouping of the contour of a known object: drawn scenes, evidence compared with a reference
 * implementation, degenerate input, budgets. */
#include "tests/contour_grouping_hash.h"
#include "tests/contour_scene.h"
#include "src/outlines/contour_grouping_variants.h"

#define PI     3.14159265358979323846
#define DEGREE (PI / 180)

enum { SIDES = 7 };

/* A lamp: it has no symmetry upside down or mirrored. */
static const double lamp[SIDES][2] = {{-10, -40}, {14, -40}, {26, 0}, {6, 4},
                                      {10, 40},   {-14, 40}, {-4, 4}};

/* The lamp's sides as segments of about 8 px, only those of number `from` to `to` - 1. Indices of
 * its segments are in order. */
static void add_lamp(scene *s, double x, double y, double scale, double turn, int from, int to)
{
    double c = scale * cos(turn), w = scale * sin(turn);

    for (int i = from; i < to; i++) {
        const double *a = lamp[i], *b = lamp[(i + 1) % SIDES];

        add_pieces(s, x + c * a[0] - w * a[1], y + w * a[0] + c * a[1], x + c * b[0] - w * b[1],
                   y + w * b[0] + c * b[1]);
    }
}

static cairn_contour_grouping_params small_params(void)
{
    cairn_contour_grouping_params p = cairn_contour_grouping_default();

    p.max_width = WIDTH;
    p.max_height = HEIGHT;
    p.max_tokens = 800;
    p.particles = 40;
    return p;
}

static finder new_finder(const cairn_contour_grouping_params *params)
{
    return new_finder_of(params, lamp, SIDES);
}

static cairn_contour_grouping_input input_of(const finder *f, const scene *s)
{
    cairn_contour_grouping_input in = {
        .segments = s->lines,
        .count = s->count,
        .width = WIDTH,
        .height = HEIGHT,
        .model = &f->model,
        .min_size = (cairn_real)0.6 * f->model.size,
        .max_size = (cairn_real)1.6 * f->model.size,
        .min_turn = (cairn_real)(-20 * DEGREE),
        .max_turn = (cairn_real)(20 * DEGREE),
        .mean_length = 8,
    };

    return in;
}

/* Recall and precision of an object against the segments first ... last - 1. */
static void shares(const cairn_contour_grouping_result *r, int32_t object, int32_t first,
                   int32_t last, double *recall, double *precision)
{
    const cairn_contour_grouping_object *o = &r->objects[object];
    int32_t among = 0;

    for (int32_t i = 0; i < o->count; i++) {
        int32_t s = r->segments[o->first + i];

        among += s >= first && s < last;
        for (int32_t k = 0; k < i; k++)
            assert_true(r->segments[o->first + k] != s);
    }
    *recall = (double)among / (last - first);
    *precision = o->count > 0 ? (double)among / o->count : 0;
}

/* The pose of the model's frame: its origin is the middle of the box. */
static void assert_lies(const finder *f, const cairn_contour_grouping_object *o, double x, double y,
                        double scale, double turn)
{
    double mx = (double)f->model.origin.x * scale, my = (double)f->model.origin.y * scale;

    assert_near(o->origin.x, x + cos(turn) * mx - sin(turn) * my, 2);
    assert_near(o->origin.y, y + sin(turn) * mx + cos(turn) * my, 2);
    assert_near((double)o->size / ((double)f->model.size * scale), 1, 0.04);
    assert_near(o->turn, turn, 3 * DEGREE);
}

static void it_is_found_in_clutter_at_any_size_and_turn(void **state)
{
    static const double where[4][4] = {{160, 120, 1, 0},
                                       {90, 100, 0.7, 12 * DEGREE},
                                       {200, 130, 1.5, -12 * DEGREE},
                                       {60, 60, 1.1, 5 * DEGREE}};
    cairn_contour_grouping_params params = small_params();
    finder f = new_finder(&params);

    (void)state;
    for (int i = 0; i < 4; i++) {
        const double *w = where[i];
        scene s = {.count = 0};
        cairn_contour_grouping_result r;
        cairn_contour_grouping_input in;
        double recall, precision;
        int32_t own;

        add_lamp(&s, w[0], w[1], w[2], w[3], 0, SIDES);
        own = s.count;
        add_clutter(&s, 150, 2, 8, (uint64_t)i);
        in = input_of(&f, &s);
        r = group(&f, &in);
        assert_int_equal(r.object_count, 1);
        assert_lies(&f, &r.objects[0], w[0], w[1], w[2], w[3]);
        shares(&r, 0, 0, own, &recall, &precision);
        assert_true(recall >= 0.9);
        assert_true(precision >= 0.8);
        assert_true(r.objects[0].score > (cairn_real)0.8 && r.objects[0].score <= 1);
        assert_near(r.best_score, r.objects[0].score, 0);
        assert_true(r.hypothesis_count > 0 && r.steps == f.model.sample_count - 1);
        assert_true(r.objects[0].matched_samples > f.model.sample_count * 2 / 3 &&
                    r.objects[0].matched_samples <= f.model.sample_count);
        for (int32_t k = 0; k < r.steps; k++) {
            assert_true(r.trace[k].particles >= 1 && r.trace[k].particles <= params.particles);
            assert_true(r.trace[k].n_eff >= (cairn_real)0.99 && r.trace[k].log_likelihood <= 0);
        }
    }
    test_pool_free(&f.pool);
}

static void two_are_found_and_distinguished(void **state)
{
    cairn_contour_grouping_params params = small_params();
    finder f = new_finder(&params);
    scene s = {.count = 0};
    cairn_contour_grouping_input in;
    cairn_contour_grouping_result r;
    double recall, precision;
    int32_t first, second;

    (void)state;
    add_lamp(&s, 80, 120, 1, 0, 0, SIDES);
    first = s.count;
    add_lamp(&s, 230, 110, 1.2, 8 * DEGREE, 0, SIDES);
    second = s.count;
    in = input_of(&f, &s);
    r = group(&f, &in);
    assert_int_equal(r.object_count, 2);
    assert_true(r.objects[0].evidence >= r.objects[1].evidence);
    for (int32_t i = 0; i < 2; i++) {
        int left = r.objects[i].origin.x < 150;

        shares(&r, i, left ? 0 : first, left ? first : second, &recall, &precision);
        assert_true(recall >= 0.9);
        assert_near(precision, 1, 0);
    }
    assert_true((r.objects[0].origin.x < 150) != (r.objects[1].origin.x < 150));
    assert_int_equal(r.segment_count, r.objects[0].count + r.objects[1].count);
    assert_int_equal(r.objects[1].first, r.objects[0].count);
    test_pool_free(&f.pool);
}

/* 1 when a place of the model is nearer to the lamp's sides from `from` to `to` - 1 than to all
 * others. */
static int is_of_sides(const finder *f, cairn_vec2 place, int from, int to)
{
    double least = 1e9, x = (double)(place.x * f->model.size + f->model.origin.x);
    double y = (double)(place.y * f->model.size + f->model.origin.y);
    int nearest = -1;

    for (int i = 0; i < SIDES; i++) {
        const double *a = lamp[i], *b = lamp[(i + 1) % SIDES];
        double dx = b[0] - a[0], dy = b[1] - a[1];
        double t = fmin(1, fmax(0, ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy)));
        double off = hypot(x - a[0] - t * dx, y - a[1] - t * dy);

        if (off < least) {
            least = off;
            nearest = i;
        }
    }
    return nearest >= from && nearest < to;
}

/* Samples of the paths with a side next to a place of the outline that a segment covers. */
static int32_t samples_seen(const finder *f, const cairn_contour_grouping_result *r,
                            const cairn_contour_grouping_object *o)
{
    int32_t seen = 0;

    for (int32_t k = 0; k < f->model.sample_count; k++) {
        int is_seen = 0;

        for (int side = 0; side < 2; side++) {
            double least = 1e9;
            int32_t nearest = 0;

            for (int32_t i = 0; i < f->model.outline_count; i++) {
                double off = (double)cairn_vec2_norm(cairn_vec2_sub(
                    f->model.outline[i].position, f->model.samples[k].contact[side].position));

                nearest = off < least ? i : nearest;
                least = fmin(off, least);
            }
            is_seen |= r->outline_segments[o->first_outline + nearest] >= 0;
        }
        seen += is_seen;
    }
    return seen;
}

/* One end is hidden, then the other: the rest is grouped, with less evidence, and the visible part
 * is reported. */
static void a_part_is_enough(void **state)
{
    cairn_contour_grouping_params params = small_params();
    finder f = new_finder(&params);

    (void)state;
    for (int part = 0; part < 2; part++) {
        int from = part ? 2 : 0, to = part ? 7 : 5;
        int32_t right = 0, seen = 0, visible = 0, own;
        scene s = {.count = 0}, whole = {.count = 0};
        cairn_contour_grouping_input in;
        cairn_contour_grouping_result r;
        cairn_real evidence;
        double recall, precision;

        add_lamp(&whole, 150, 110, 1.2, 5 * DEGREE, 0, SIDES);
        in = input_of(&f, &whole);
        evidence = group(&f, &in).best_evidence;
        add_lamp(&s, 150, 110, 1.2, 5 * DEGREE, from, to);
        own = s.count;
        add_clutter(&s, 60, 2, 8, (uint64_t)part);
        in = input_of(&f, &s);
        r = group(&f, &in);
        assert_int_equal(r.object_count, 1);
        assert_lies(&f, &r.objects[0], 150, 110, 1.2, 5 * DEGREE);
        assert_true(r.best_evidence < evidence && r.best_score < (cairn_real)0.92 &&
                    r.best_score > (cairn_real)0.5);
        assert_near(r.objects[0].evidence, r.best_evidence, 0);
        shares(&r, 0, 0, own, &recall, &precision);
        assert_true(recall >= 0.9);
        assert_true(precision >= 0.8);
        for (int32_t i = 0; i < f.model.outline_count; i++) {
            int32_t along = r.outline_segments[r.objects[0].first_outline + i];
            int own_side = is_of_sides(&f, f.model.outline[i].position, from, to);

            visible += own_side;
            seen += along >= 0;
            right += along >= 0 && along < own && own_side;
        }
        assert_true(right >= visible * 9 / 10);
        assert_true(right >= seen * 9 / 10);
        assert_in_range(r.objects[0].matched_samples, samples_seen(&f, &r, &r.objects[0]),
                        f.model.sample_count);
        assert_true(r.objects[0].matched_samples <= samples_seen(&f, &r, &r.objects[0]) + 2);
    }
    test_pool_free(&f.pool);
}

/* A third of it lies beyond the border of the image. */
static void objects_cut_by_the_border_are_found(void **state)
{
    cairn_contour_grouping_params params = small_params();
    finder f = new_finder(&params);
    scene all = {.count = 0}, s = {.count = 0};
    cairn_contour_grouping_input in;
    cairn_contour_grouping_result r;
    int32_t own;

    (void)state;
    add_lamp(&all, 150, HEIGHT - 20, 1.3, -6 * DEGREE, 0, SIDES);
    for (int32_t i = 0; i < all.count; i++)
        if (all.lines[i].a.y < HEIGHT && all.lines[i].b.y < HEIGHT)
            s.lines[s.count++] = all.lines[i];
    own = s.count;
    assert_true(own < all.count * 4 / 5);
    add_clutter(&s, 60, 2, 8, 4);
    in = input_of(&f, &s);
    r = group(&f, &in);
    assert_int_equal(r.object_count, 1);
    assert_lies(&f, &r.objects[0], 150, HEIGHT - 20, 1.3, -6 * DEGREE);
    test_pool_free(&f.pool);
}

/* Absent, upside down, or of another size than requested: nothing is reported but the best
 * score. */
static void absent_objects_are_not_found(void **state)
{
    cairn_contour_grouping_params params = small_params();
    finder f = new_finder(&params);
    cairn_contour_grouping_input in;
    cairn_contour_grouping_result r;
    scene s = {.count = 0}, none = {.count = 0};

    (void)state;
    add_clutter(&s, 200, 2, 8, 9);
    in = input_of(&f, &s);
    r = group(&f, &in);
    assert_int_equal(r.object_count, 0);
    assert_true(r.best_evidence < params.min_evidence);
    s.count = 0;
    add_lamp(&s, 160, 120, 1, PI, 0, SIDES);
    in = input_of(&f, &s);
    r = group(&f, &in);
    assert_int_equal(r.object_count, 0);
    in.min_turn = (cairn_real)(170 * DEGREE);
    in.max_turn = (cairn_real)PI;
    r = group(&f, &in);
    assert_int_equal(r.object_count, 1);
    s.count = 0;
    add_lamp(&s, 160, 120, 1, 0, 0, SIDES);
    in = input_of(&f, &s);
    in.min_size = (cairn_real)1.3 * f.model.size;
    r = group(&f, &in);
    assert_int_equal(r.object_count, 0);
    in = input_of(&f, &none);
    r = group(&f, &in);
    assert_int_equal(r.object_count, 0);
    assert_int_equal(r.token_count + r.hypothesis_count + r.steps, 0);
    test_pool_free(&f.pool);
}

/* ---- The reference implementation: evidence of a pose from all tokens of the image ---- */

enum { REFERENCE_MOST = 2000, REFERENCE_CELLS = 5 };

typedef struct reference_token {
    double x, y, dx, dy, half;
    int32_t chain;
} reference_token;

typedef struct reference {
    reference_token token[REFERENCE_MOST];
    int32_t count;
    double size, cosine, sine, ox, oy; /* the pose */
    double deform, turn, spacing, chance;
} reference;

typedef struct reference_cell {
    double cost, off, value;
    int32_t token;
} reference_cell;

static void reference_cut(reference *t, const scene *s, double token)
{
    double length_of_all = 0;
    int32_t chain = 0;

    for (int32_t i = 0; i < s->count; i++) {
        double ax = (double)s->lines[i].a.x, ay = (double)s->lines[i].a.y,
               bx = (double)s->lines[i].b.x;
        double by = (double)s->lines[i].b.y, length = hypot(bx - ax, by - ay);
        int parts = (int)ceil(length / token);

        if (i > 0 && hypot(ax - (double)s->lines[i - 1].b.x, ay - (double)s->lines[i - 1].b.y) > 3)
            chain++;
        for (int k = 0; k < parts; k++) {
            reference_token *p = &t->token[t->count++];

            p->x = ax + (k + 0.5) / parts * (bx - ax);
            p->y = ay + (k + 0.5) / parts * (by - ay);
            p->dx = (bx - ax) / length;
            p->dy = (by - ay) / length;
            p->half = length / parts / 2;
            p->chain = chain;
        }
        length_of_all += length;
    }
    t->chance = 0.25 * log(fmax(1, length_of_all / (WIDTH * HEIGHT * 0.035)));
}

static double reference_sense(const reference *t, int32_t token, double ux, double uy)
{
    return t->token[token].dx * ux + t->token[token].dy * uy >= 0 ? 1 : -1;
}

/* 2 where the chain of a token continues. */
static double reference_leave(const reference *t, int32_t token, double ux, double uy, int ahead)
{
    int32_t next = token + 2 * ahead * (int)reference_sense(t, token, ux, uy);

    return next >= 0 && next < t->count && t->token[next].chain == t->token[token].chain ? 2 : 0;
}

static double reference_step(const reference *t, const reference_cell *a, const reference_cell *b,
                             double ux, double uy, double bend)
{
    int32_t ahead;

    if (a->token == b->token)
        return 0;
    if (a->token < 0)
        return 0.4 + reference_leave(t, b->token, ux, uy, -1);
    if (b->token < 0)
        return 0.4 + reference_leave(t, a->token, ux, uy, 1);
    ahead = (b->token - a->token) * (int)reference_sense(t, b->token, ux, uy);
    if (t->token[a->token].chain == t->token[b->token].chain && ahead >= 0 && ahead <= 3)
        return -bend;
    return 0.8 + (b->off - a->off) * (b->off - a->off) + reference_leave(t, a->token, ux, uy, 1) +
           reference_leave(t, b->token, ux, uy, -1);
}

/* The cells of a place of the outline; returns their number. */
static int reference_cells(const reference *t, double x, double y, double ux, double uy,
                           double bend, reference_cell *cell)
{
    double sigma = t->deform * t->size, wide = fmax(sigma, 1.5), reward = 1 - 0.65 * (1 - bend);
    double reach = fmin(fmax(3 * sigma, 4) + 5, 64);
    int count = 1;

    cell[0].token = -1;
    cell[0].value = -0.15 * t->spacing / 0.08;
    for (int32_t i = 0; i < t->count; i++) {
        const reference_token *p = &t->token[i];
        double along = fmax(-p->half, fmin(p->half, (x - p->x) * p->dx + (y - p->y) * p->dy));
        double fx = p->x + along * p->dx - x, fy = p->y + along * p->dy - y, cost;
        int at;

        if (floor(p->x / 8) < floor((x - reach) / 8) || floor(p->x / 8) > floor((x + reach) / 8) ||
            floor(p->y / 8) < floor((y - reach) / 8) || floor(p->y / 8) > floor((y + reach) / 8))
            continue;
        cost = pow((ux * fy - uy * fx) / wide, 2) + pow((ux * fx + uy * fy) / (2 * wide), 2);
        cost = (cost + pow((ux * p->dy - uy * p->dx) / t->turn, 2)) / 2;
        if (cost > 4.5 || (count == REFERENCE_CELLS && cost >= cell[count - 1].cost))
            continue;
        count += count < REFERENCE_CELLS;
        for (at = count - 1; at > 1 && cell[at - 1].cost > cost; at--)
            cell[at] = cell[at - 1];
        cell[at].cost = cost;
        cell[at].token = i;
        cell[at].off = (ux * fy - uy * fx) / sigma;
        cell[at].value = t->spacing / 0.08 *
                         (fmax(2.14 * reward - 6.25 * cost, 0.5 * reward - cost) - t->chance);
    }
    return count;
}

static double reference_evidence(const reference *t, const cairn_shape_model *m)
{
    static reference_cell cell[512][REFERENCE_CELLS];
    int count = 0, before = 0;
    double best = -1e9;

    for (int32_t i = 0; i < m->outline_count; i++) {
        const cairn_oriented_point *o = &m->outline[i];
        const cairn_oriented_point *p = &m->outline[i < 2 ? 0 : i - 2];
        const cairn_oriented_point *q =
            &m->outline[i + 2 < m->outline_count ? i + 2 : m->outline_count - 1];
        double mx = (double)o->position.x * t->size, my = (double)o->position.y * t->size;
        double dx = (double)o->direction.x, dy = (double)o->direction.y;
        double ux = t->cosine * dx - t->sine * dy, uy = t->sine * dx + t->cosine * dy;
        double bend = 1 - exp(((double)cairn_vec2_dot(p->direction, q->direction) - 1) / 0.0667);

        before = count;
        count = reference_cells(t, t->ox + t->cosine * mx - t->sine * my,
                                t->oy + t->sine * mx + t->cosine * my, ux, uy, bend, cell[i]);
        for (int k = 0; k < count && i > 0; k++) {
            double most = -1e9;

            for (int j = 0; j < before; j++)
                most = fmax(most, cell[i - 1][j].value - reference_step(t, &cell[i - 1][j],
                                                                        &cell[i][k], ux, uy, bend));
            cell[i][k].value += most;
        }
    }
    for (int k = 0; k < count; k++)
        best = fmax(best, cell[m->outline_count - 1][k].value);
    return best;
}

static void evidence_is_that_of_the_reference(void **state)
{
    cairn_contour_grouping_params params = small_params();
    finder f = new_finder(&params);

    (void)state;
    for (int i = 0; i < 6; i++) {
        static reference t;
        double w = 0;
        scene s = {.count = 0};
        cairn_contour_grouping_input in;
        cairn_contour_grouping_result r;

        add_lamp(&s, 140 + 7.3 * i, 100 + 4.1 * i, 0.9 + 0.1 * i, (2.5 * i - 5) * DEGREE, i % 3,
                 SIDES);
        add_clutter(&s, 40 * i + 20, 2, 8, (uint64_t)i);
        in = input_of(&f, &s);
        r = group(&f, &in);
        assert_true(r.object_count >= 1);
        memset(&t, 0, sizeof t);
        t.deform = (double)params.deform_sigma;
        t.turn = (double)params.turn_sigma;
        t.size = (double)r.objects[0].size;
        t.cosine = cos((double)r.objects[0].turn);
        t.sine = sin((double)r.objects[0].turn);
        t.ox = (double)r.objects[0].origin.x;
        t.oy = (double)r.objects[0].origin.y;
        for (int32_t k = 1; k < f.model.outline_count; k++)
            w += (double)cairn_vec2_norm(
                cairn_vec2_sub(f.model.outline[k].position, f.model.outline[k - 1].position));
        t.spacing = w / f.model.outline_count;
        reference_cut(&t, &s, (double)params.token_length);
        assert_int_equal(r.token_count, t.count);
        assert_near(r.objects[0].evidence, reference_evidence(&t, &f.model), 0.02);
    }
    test_pool_free(&f.pool);
}

/* ---- Degenerate input ---- */

/* Pairs of lines, each a token, that may be the two sides of a sample, judged by angles. */
static int32_t reference_hypotheses(const finder *f, const scene *s,
                                    const cairn_contour_grouping_input *in)
{
    int32_t count = 0;

    for (int32_t k = 0; k < s->count * s->count * f->model.sample_count; k++) {
        int32_t p = k % s->count, q = k / s->count % s->count;
        const cairn_oriented_point *side = f->model.samples[k / s->count / s->count].contact;
        double mx = (double)(side[1].position.x - side[0].position.x),
               my = (double)(side[1].position.y - side[0].position.y), at[2][2], turned[2], size,
               turn, off;

        for (int e = 0; e < 2; e++) {
            const cairn_segment *line = &s->lines[e ? q : p];

            at[e][0] = (double)(line->a.x + line->b.x) / 2;
            at[e][1] = (double)(line->a.y + line->b.y) / 2;
            turned[e] = atan2((double)(line->b.y - line->a.y), (double)(line->b.x - line->a.x)) -
                        atan2((double)side[e].direction.y, (double)side[e].direction.x);
        }
        if (p == q || hypot(mx, my) == 0)
            continue;
        size = hypot(at[1][0] - at[0][0], at[1][1] - at[0][1]) / hypot(mx, my);
        turn = atan2(at[1][1] - at[0][1], at[1][0] - at[0][0]) - atan2(my, mx);
        off = remainder(turn - (double)(in->min_turn + in->max_turn) / 2, 2 * PI);
        count += size >= (double)in->min_size && size <= (double)in->max_size &&
                 fabs(off) <= (double)(in->max_turn - in->min_turn) / 2 &&
                 fabs(cos(turned[0] - turn)) >= 0.9 && fabs(cos(turned[1] - turn)) >= 0.9;
    }
    return count;
}

static void hypothesis_generation_skips_no_pose(void **state)
{
    static const double turns[][2] = {{-15, 15}, {-180, 180}, {20, 50}, {-90, 90},
                                      {-89, 89}, {150, 180},  {0, 1}};
    cairn_contour_grouping_params params = small_params();
    finder f = new_finder(&params);
    cairn_random random = cairn_random_seed(5, 3);
    scene s = {.count = 0};
    int32_t all = 0;

    (void)state;
    for (int i = 0; i < 90; i++) {
        double x = (double)cairn_random_uniform(&random, 10, WIDTH - 10);
        double y = (double)cairn_random_uniform(&random, 10, HEIGHT - 10);
        double turn = (double)cairn_random_uniform(&random, 0, (cairn_real)PI);

        add_line(&s, x, y, x + 6 * cos(turn), y + 6 * sin(turn));
    }
    for (size_t i = 0; i < sizeof turns / sizeof *turns; i++) {
        cairn_contour_grouping_input in = input_of(&f, &s);
        cairn_contour_grouping_result r;
        int32_t wanted;

        in.min_size = 60;
        in.max_size = 150;
        in.min_turn = (cairn_real)(turns[i][0] * DEGREE);
        in.max_turn = (cairn_real)(turns[i][1] * DEGREE);
        wanted = reference_hypotheses(&f, &s, &in);
        r = group(&f, &in);
        assert_int_equal(r.token_count, s.count);
        assert_int_equal(r.hypothesis_count, wanted);
        all += wanted;
    }
    assert_true(all > 1000);
    test_pool_free(&f.pool);
}

/* Edges everywhere: tokens up to the capacity, evenly distributed; and the search ends. */
static void an_image_full_of_edges_is_thinned_out(void **state)
{
    cairn_contour_grouping_params params = small_params();
    cairn_segment *lines = calloc(6000, sizeof *lines);
    scene none = {.count = 0};
    cairn_contour_grouping_input in;
    cairn_contour_grouping_result r;
    finder f;

    (void)state;
    assert_non_null(lines);
    params.particles = 10;
    params.max_tokens = 500;
    f = new_finder(&params);
    in = input_of(&f, &none);
    in.segments = lines;
    for (int32_t y = 4; y < HEIGHT; y += 4)
        for (int32_t x = 4; x < WIDTH - 4; x += 4) {
            cairn_segment line = {
                {(cairn_real)x, (cairn_real)y},
                {(cairn_real)(x + (x / 4 % 2 ? 4 : 0)), (cairn_real)(y + (x / 4 % 2 ? 0 : 4))}};

            lines[in.count++] = line;
        }
    r = group(&f, &in);
    assert_int_equal(r.token_count, 500);
    assert_int_equal(r.object_count, 0);
    in.count = 500;
    assert_int_equal(group(&f, &in).token_count, 500);
    in.count = 499;
    assert_int_equal(group(&f, &in).token_count, 499);
    lines[3].b.x = (cairn_real)1e12;
    assert_ok(cairn_contour_grouping_begin(f.grouping, &in));
    {
        cairn_budget budget = {INT32_MAX};

        assert_status(cairn_contour_grouping_step(f.grouping, &budget), CAIRN_FULL);
    }
    assert_int_equal(cairn_contour_grouping_read(f.grouping).token_count, 0);
    free(lines);
    test_pool_free(&f.pool);
}

/* A triangle is a valid model; an image of one pixel is empty. */
static void small_models_and_images(void **state)
{
    cairn_contour_grouping_params params = small_params();
    finder f = new_finder(&params);
    cairn_vec2 corner[3] = {{0, 0}, {60, 10}, {20, 50}};
    cairn_curve outline = {corner, 3, 1};
    cairn_budget budget = {INT32_MAX};
    scene s = {.count = 0};
    cairn_contour_grouping_input in;

    (void)state;
    assert_ok(cairn_shape_model_builder_begin(f.builder, &outline, 1));
    assert_ok(cairn_shape_model_builder_step(f.builder, &budget));
    f.model = cairn_shape_model_builder_read(f.builder);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 6; k++) {
            cairn_vec2 a = corner[i], b = corner[(i + 1) % 3];
            double t = k / 6.0, u = (k + 1) / 6.0;

            add_line(&s, 100 + (double)a.x + t * (double)(b.x - a.x),
                     80 + (double)a.y + t * (double)(b.y - a.y),
                     100 + (double)a.x + u * (double)(b.x - a.x),
                     80 + (double)a.y + u * (double)(b.y - a.y));
        }
    in = input_of(&f, &s);
    assert_int_equal(group(&f, &in).object_count, 1);
    assert_near(cairn_contour_grouping_read(f.grouping).objects[0].origin.x,
                100 + (double)f.model.origin.x, 1);
    in.width = in.height = 1;
    in.count = 0;
    assert_int_equal(group(&f, &in).object_count, 0);
    test_pool_free(&f.pool);
}

/* Without one of the terms it still groups; steps stop early where nothing fits; a longer path
 * needs no larger pool but for its trace. */
static void parts_can_be_switched_off(void **state)
{
    cairn_contour_grouping_params params = small_params(), longer = params;
    cairn_contour_grouping_input in;
    cairn_contour_grouping_result r;
    cairn_real likelihood;
    scene s = {.count = 0};
    finder f;

    (void)state;
    add_lamp(&s, 160, 120, 1, 0, 0, SIDES);
    add_clutter(&s, 100, 2, 8, 8);
    for (int off = 0; off < 3; off++) {
        params = small_params();
        contour_grouping_ablate(&params, off == 1, off == 2);
        f = new_finder(&params);
        in = input_of(&f, &s);
        r = group(&f, &in);
        assert_int_equal(r.object_count, 1);
        assert_int_equal(r.steps, f.model.sample_count - 1);
        if (off == 0)
            likelihood = r.trace[r.steps - 1].log_likelihood;
        else
            assert_true(r.trace[r.steps - 1].log_likelihood != likelihood);
        test_pool_free(&f.pool);
    }
    params = small_params();
    params.stop_likelihood = 1;
    f = new_finder(&params);
    in = input_of(&f, &s);
    r = group(&f, &in);
    assert_int_equal(r.steps, 1);
    assert_int_equal(r.object_count, 1);
    test_pool_free(&f.pool);
    longer.max_samples = params.max_samples + 100;
    assert_true(cairn_contour_grouping_memory(&longer) - cairn_contour_grouping_memory(&params) <=
                100 * sizeof(cairn_contour_grouping_trace) + CAIRN_ALIGN);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {7, 1000, 100000};
    cairn_contour_grouping_params params = small_params();
    cairn_budget all = {INT32_MAX};
    finder f;
    cairn_contour_grouping_input in;
    cairn_contour_grouping_result r;
    scene s = {.count = 0};
    int32_t units;
    uint64_t hash;

    (void)state;
    params.particles = 8;
    f = new_finder(&params);
    add_lamp(&s, 160, 120, 1, 0, 0, SIDES);
    add_clutter(&s, 10, 2, 8, 5);
    in = input_of(&f, &s);
    assert_ok(cairn_contour_grouping_begin(f.grouping, &in));
    assert_ok(cairn_contour_grouping_step(f.grouping, &all));
    units = INT32_MAX - all.left;
    r = cairn_contour_grouping_read(f.grouping);
    assert_int_equal(r.object_count, 1);
    hash = contour_grouping_hash(&r);
    assert_golden(test_hash(hash, &units, sizeof units), UINT64_C(0xf0946a4c76b4be45),
                  UINT64_C(0x40ee51e8ef85c89d));
    for (int i = 0; i < 3; i++) {
        int64_t used = 0;
        cairn_status status;

        assert_ok(cairn_contour_grouping_begin(f.grouping, &in));
        do {
            cairn_budget budget = {budgets[i]};

            status = cairn_contour_grouping_step(f.grouping, &budget);
            assert_true(budget.left >= 0);
            used += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        r = cairn_contour_grouping_read(f.grouping);
        assert_true(contour_grouping_hash(&r) == hash);
        assert_int_equal(used, units);
    }
    test_pool_free(&f.pool);
}

/* The fault says the public modes; the variants between are accepted. */
static void modes_are_the_public_ones_and_the_variants(void **state)
{
    static const int32_t accepted[] = {
        CAIRN_MODE_DEFAULT,
        CAIRN_MODE_AS_WRITTEN,
        CAIRN_CONTOUR_GROUPING_NO_MODEL,
        CAIRN_MODE_AS_WRITTEN + CAIRN_CONTOUR_GROUPING_WRITTEN_NO_MODEL,
        CAIRN_MODE_AS_WRITTEN + CAIRN_CONTOUR_GROUPING_WRITTEN_LETTER,
        CAIRN_MODE_AS_WRITTEN + CAIRN_CONTOUR_GROUPING_WRITTEN_ALL};
    cairn_contour_grouping_params params = small_params();
    cairn_object_fault fault = {.field = NULL};
    int32_t count = 0;

    (void)state;
    for (size_t k = 0; k < sizeof accepted / sizeof *accepted; k++) {
        params.mode = accepted[k];
        assert_ok(cairn_contour_grouping_check(&params, NULL));
    }
    for (params.mode = -10; params.mode <= 20; params.mode++) {
        if (cairn_contour_grouping_check(&params, &fault) == CAIRN_OK) {
            count++;
            continue;
        }
        assert_string_equal(fault.field, "mode");
        assert_true(fault.lowest == CAIRN_MODE_DEFAULT && fault.highest == CAIRN_MODE_AS_WRITTEN);
    }
    assert_int_equal(count, sizeof accepted / sizeof *accepted);
    /* The other fields are checked in a variant, too. */
    params.mode = CAIRN_CONTOUR_GROUPING_NO_MODEL;
    params.max_width = 0;
    assert_status(cairn_contour_grouping_check(&params, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.field, "max_width");
}

static void bad_input_is_refused(void **state)
{
    cairn_contour_grouping_params params = small_params();
    finder f = new_finder(&params);
    scene s = {.count = 0};
    cairn_contour_grouping_input good, in;
    cairn_budget budget = {INT32_MAX};
    cairn_shape_model model = f.model;
    cairn_shape_model_sample *many;

    (void)state;
    add_lamp(&s, 160, 120, 1, 0, 0, SIDES);
    good = input_of(&f, &s);
    assert_int_equal(group(&f, &good).object_count, 1);
#define REFUSED(change, status)                                                                    \
    in = good;                                                                                     \
    change;                                                                                        \
    assert_status(cairn_contour_grouping_begin(f.grouping, &in), status);                          \
    assert_int_equal(cairn_contour_grouping_read(f.grouping).object_count, 1)
    REFUSED(in.count = -1, CAIRN_BAD_ARGUMENT);
    REFUSED(in.segments = NULL, CAIRN_BAD_ARGUMENT);
    REFUSED(in.width = 0, CAIRN_BAD_ARGUMENT);
    REFUSED(in.height = 0, CAIRN_BAD_ARGUMENT);
    REFUSED(in.width = WIDTH + 1, CAIRN_FULL);
    REFUSED(in.height = HEIGHT + 1, CAIRN_FULL);
    REFUSED(in.model = NULL, CAIRN_BAD_ARGUMENT);
    REFUSED(in.min_size = 0, CAIRN_BAD_ARGUMENT);
    REFUSED(in.min_size = (cairn_real)NAN, CAIRN_BAD_ARGUMENT);
    REFUSED(in.max_size = in.min_size / 2, CAIRN_BAD_ARGUMENT);
    REFUSED(in.max_size = (cairn_real)INFINITY, CAIRN_NOT_FINITE);
    REFUSED(in.min_turn = -4, CAIRN_BAD_ARGUMENT);
    REFUSED(in.max_turn = 4, CAIRN_BAD_ARGUMENT);
    REFUSED(in.max_turn = in.min_turn - 1, CAIRN_BAD_ARGUMENT);
    REFUSED(in.min_turn = (cairn_real)NAN, CAIRN_NOT_FINITE);
    REFUSED(in.max_turn = (cairn_real)NAN, CAIRN_NOT_FINITE);
    REFUSED(in.mean_length = 0, CAIRN_BAD_ARGUMENT);
    REFUSED(in.mean_length = (cairn_real)NAN, CAIRN_NOT_FINITE);
    model.sample_count = params.max_samples + 1;
    many = calloc((size_t)model.sample_count, sizeof *many);
    assert_non_null(many);
    model.samples = many;
    for (int32_t i = 0; i < model.sample_count; i++)
        many[i] = f.model.samples[0];
    REFUSED(in.model = &model, CAIRN_FULL);
    free(many);
#undef REFUSED
    assert_status(cairn_contour_grouping_begin(NULL, &good), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_contour_grouping_begin(f.grouping, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_contour_grouping_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_contour_grouping_step(f.grouping, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_contour_grouping_step(f.grouping, &budget));
    s.lines[2].b.y = (cairn_real)NAN;
    assert_ok(cairn_contour_grouping_begin(f.grouping, &good));
    assert_status(cairn_contour_grouping_step(f.grouping, &budget), CAIRN_NOT_FINITE);
    assert_int_equal(cairn_contour_grouping_read(f.grouping).object_count, 0);
    assert_int_equal(cairn_contour_grouping_read(NULL).steps, 0);
    test_pool_free(&f.pool);
}

/* tests/test_object.c has the ranges. */
static void a_pool_of_its_bytes_suffices(void **state)
{
    cairn_contour_grouping_params good = small_params();
    cairn_pool pool = test_pool(64);

    (void)state;
    assert_status(cairn_contour_grouping_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    good.particles = 2;
    good.max_tokens = 4;
    good.max_samples = 4;
    good.max_width = good.max_height = 32;
    test_every_pool_size(create, &good, cairn_contour_grouping_memory(&good));
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_is_found_in_clutter_at_any_size_and_turn),
        cmocka_unit_test(two_are_found_and_distinguished),
        cmocka_unit_test(a_part_is_enough),
        cmocka_unit_test(objects_cut_by_the_border_are_found),
        cmocka_unit_test(evidence_is_that_of_the_reference),
        cmocka_unit_test(hypothesis_generation_skips_no_pose),
        cmocka_unit_test(an_image_full_of_edges_is_thinned_out),
        cmocka_unit_test(small_models_and_images),
        cmocka_unit_test(parts_can_be_switched_off),
        cmocka_unit_test(absent_objects_are_not_found),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(modes_are_the_public_ones_and_the_variants),
        cmocka_unit_test(bad_input_is_refused),
        cmocka_unit_test(a_pool_of_its_bytes_suffices),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
