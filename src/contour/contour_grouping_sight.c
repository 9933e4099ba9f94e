/* First sight: where the model may lie at all.
 *
 * Two tokens with the touches of one sample of the model give a similarity: the chord between
 * them its size, turn and place; the directions of both must agree. How much of the outline has
 * an edge of its direction near it, looked up in a map of bits, ranks these places; of places
 * that are nearly one the best is kept. They are the first particles. */
#include "src/core/build.h"

#include "src/contour/contour_grouping_work.h"

/* Least cosine between a token and the direction that it should have. */
#define LEAST_COSINE CAIRN_REAL(0.9)
/* Places closer than this, of the size, and of sizes closer than this are one. */
#define SAME_PLACE CAIRN_REAL(0.05)
#define SAME_SIZE  CAIRN_REAL(0.12)
/* Places closer than this, of the size, are a crowd, and no more of them are kept than one share
 * in so many. */
#define CLOSE CAIRN_REAL(0.3)
enum { CROWDS = 8 };
enum { MOST_PAIRS = 1 << 22 };
/* Cosines of half the range of turns above this tell a chord that is turned too far without a
 * root. */
#define NARROW CAIRN_REAL(0.1)
/* Room for rounding. */
#define LESS CAIRN_REAL(0.9999)
#define MORE CAIRN_REAL(1.0001)

/* The bin of a direction, 0 ... 7 over half a turn, by comparisons only. */
static int32_t bin_of(cairn_vec2 d)
{
    cairn_real x = d.x, y = d.y;
    int32_t bin;

    if (y < 0 || (y == 0 && x < 0)) {
        x = -x;
        y = -y;
    }
    bin = x >= 0 ? 0 : 4;
    if (bin == 4) {
        cairn_real was = x;

        x = y;
        y = -was;
    }
    if (y > CAIRN_REAL(2.414213562) * x)
        return bin + 3;
    return bin + (y > x ? 2 : y > CAIRN_REAL(0.414213562) * x);
}

/* Marks a token's direction, and the bins beside it, in the cells around it. */
static void mark(cairn_grouping *g, const grouping_token *t)
{
    int32_t bin = bin_of(t->direction), steps = 1 + cairn_real_to_int(t->half / GROUPING_SIGHT);
    uint8_t bits = (uint8_t)(1 << bin | 1 << ((bin + 1) & 7) | 1 << ((bin + 7) & 7));

    for (int32_t s = -steps; s <= steps; s++) {
        cairn_vec2 p = cairn_vec2_add(
            t->at, cairn_vec2_scale(t->direction, t->half * ((cairn_real)s / (cairn_real)steps)));
        int32_t x = cairn_real_to_int(p.x) / GROUPING_SIGHT,
                y = cairn_real_to_int(p.y) / GROUPING_SIGHT;

        for (int32_t v = y - 1; v <= y + 1; v++)
            for (int32_t u = x - 1; u <= x + 1; u++)
                if (u >= 0 && v >= 0 && u < g->sight_columns && v < g->sight_rows)
                    g->sight[v * g->sight_columns + u] |= bits;
    }
}

/* The share of the outline that has an edge near it. */
static cairn_real sight_score(const cairn_grouping *g, const grouping_pose *pose)
{
    const cairn_shape_model *m = g->input.model;
    int32_t stride = 1 + m->outline_count / 48, seen = 0, count = 0;

    for (int32_t i = 0; i < m->outline_count; i += stride) {
        cairn_vec2 p = grouping_place(pose, m->outline[i].position);
        int32_t x = cairn_real_to_int(p.x) / GROUPING_SIGHT,
                y = cairn_real_to_int(p.y) / GROUPING_SIGHT;

        count++;
        if (p.x < 0 || p.y < 0 || x >= g->sight_columns || y >= g->sight_rows)
            continue;
        seen += g->sight[y * g->sight_columns + x] >>
                    bin_of(grouping_direction(pose, m->outline[i].direction)) &
                1;
    }
    return (cairn_real)seen / (cairn_real)count;
}

static int is_same(const grouping_start *a, const grouping_start *b, cairn_real sizes)
{
    cairn_real da = a->pose.a - b->pose.a, db = a->pose.b - b->pose.b;

    return cairn_vec2_norm_squared(cairn_vec2_sub(a->pose.t, b->pose.t)) <
               SAME_PLACE * SAME_PLACE * sizes &&
           da * da + db * db < SAME_SIZE * SAME_SIZE * sizes;
}

static int is_close(const grouping_start *a, const grouping_start *b, cairn_real sizes)
{
    return cairn_vec2_norm_squared(cairn_vec2_sub(a->pose.t, b->pose.t)) < CLOSE * CLOSE * sizes;
}

/* The place that a new one may only take the place of: one that is nearly the same, or the worst
 * of a crowd; -1: none. */
static int32_t rival(const cairn_grouping *g, const grouping_start *start)
{
    int32_t crowd = g->params.particles / CROWDS, close = 0, worst = -1;

    for (int32_t i = 0; i < g->start_count; i++) {
        cairn_real sizes = g->starts[i].size * start->size;

        if (!is_close(&g->starts[i], start, sizes))
            continue;
        if (is_same(&g->starts[i], start, sizes))
            return i;
        close++;
        worst = i;
    }
    return close > crowd ? worst : -1;
}

/* Keeps a place among the best, in order; of those nearly at one place only the best, and of
 * those close to it not too many, so that there is room for the places of other objects. */
static void keep(cairn_grouping *g, const grouping_start *start)
{
    int32_t at = g->start_count, other;

    if (at == g->params.particles && !(start->score > g->starts[at - 1].score))
        return;
    other = rival(g, start);
    if (other >= 0 && !(start->score > g->starts[other].score))
        return;
    if (other >= 0)
        at = other;
    else if (at == g->params.particles)
        at--;
    else
        g->start_count++;
    for (; at > 0 && g->starts[at - 1].score < start->score; at--)
        g->starts[at] = g->starts[at - 1];
    g->starts[at] = *start;
}

/* 1 when a token runs as a direction of the model would in a pose. */
static int runs_so(const grouping_token *t, const grouping_pose *pose, cairn_vec2 d,
                   cairn_real size)
{
    return cairn_abs(cairn_vec2_dot(t->direction, grouping_direction(pose, d))) >=
           LEAST_COSINE * size;
}

/* Which of the ways a chord runs, 0 ... GROUPING_WAYS - 1 once around: like an angle, but
 * without an arc tangent. */
static int32_t way_of(cairn_vec2 c)
{
    cairn_real sum = cairn_abs(c.x) + cairn_abs(c.y), along = sum > 0 ? c.x / sum : 0;
    int32_t way = cairn_real_to_int((1 - along) * GROUPING_WAYS / 4);

    way = way < GROUPING_WAYS / 2 ? way : GROUPING_WAYS / 2 - 1;
    return c.y < 0 ? GROUPING_WAYS - 1 - way : way;
}

/* Chords of a way may be this sample's. */
static void admit(grouping_way *way, int32_t sample)
{
    if (sample < way->from)
        way->from = (int16_t)sample;
    if (sample >= way->to)
        way->to = (int16_t)(sample + 1);
}

/* The chord between the touches of a sample. */
static cairn_vec2 chord_of(const cairn_grouping *g, int32_t sample)
{
    const cairn_shape_sample *s = &g->input.model->samples[sample];

    return cairn_vec2_sub(s->side[1].position, s->side[0].position);
}

/* The ways that chords of a sample may run, turned as far as asked for to either side, and one
 * more for rounding. */
static void admit_ways(cairn_grouping *g, int32_t sample)
{
    cairn_vec2 m = chord_of(g, sample), axis = g->turn_axis;
    cairn_vec2 middle = {m.x * axis.x - m.y * axis.y, m.x * axis.y + m.y * axis.x};
    cairn_real cosine = cairn_sqrt(cairn_max(g->cosine2, 0)),
               sine = cairn_sqrt(1 - cosine * cosine);
    cairn_vec2 low = {middle.x * cosine + middle.y * sine, middle.y * cosine - middle.x * sine};
    cairn_vec2 high = {middle.x * cosine - middle.y * sine, middle.y * cosine + middle.x * sine};
    int32_t first = way_of(low) + GROUPING_WAYS - 1;
    int32_t count = g->cosine2 < 0
                        ? GROUPING_WAYS
                        : (way_of(high) + GROUPING_WAYS - way_of(low)) % GROUPING_WAYS + 3;

    for (int32_t i = 0; i < count; i++)
        admit(&g->ways[(first + i) % GROUPING_WAYS], sample);
}

void cairn_grouping_look_begin(cairn_grouping *g)
{
    g->least2 = g->input.min_size * g->input.min_size * LESS;
    g->most2 = g->input.max_size * g->input.max_size * MORE;
    g->cosine2 = g->turn_cosine > NARROW ? g->turn_cosine * g->turn_cosine * LESS : -2;
    for (int32_t i = 0; i < GROUPING_WAYS; i++) {
        g->ways[i].from = INT16_MAX;
        g->ways[i].to = 0;
    }
    for (int32_t k = 0; k < g->input.model->sample_count; k++)
        admit_ways(g, k);
}

/* 0: a chord of tokens, whose length squared is cc, is too short, too long or turned too far for
 * a sample's; 1: it may not be. */
static int may_be(const cairn_grouping *g, int32_t sample, cairn_vec2 c, cairn_real cc)
{
    cairn_vec2 m = chord_of(g, sample);
    cairn_real mm = cairn_vec2_norm_squared(m);
    cairn_real along =
        cairn_vec2_dot(m, c) * g->turn_axis.x + cairn_vec2_cross(m, c) * g->turn_axis.y;

    return cc >= mm * g->least2 && cc <= mm * g->most2 &&
           along * cairn_abs(along) >= g->cosine2 * mm * cc;
}

/* A pair of tokens as the sides 0 and 1 of a sample. */
static void try_sample(cairn_grouping *g, const grouping_token *p, const grouping_token *q,
                       int32_t sample)
{
    const cairn_shape_sample *s = &g->input.model->samples[sample];
    cairn_vec2 m = chord_of(g, sample), c = cairn_vec2_sub(q->at, p->at);
    cairn_real mm = cairn_vec2_norm_squared(m), cc = cairn_vec2_norm_squared(c);
    grouping_start start;

    if (mm == 0 || cc < mm * g->input.min_size * g->input.min_size ||
        cc > mm * g->input.max_size * g->input.max_size)
        return;
    start.pose.a = cairn_vec2_dot(m, c) / mm;
    start.pose.b = cairn_vec2_cross(m, c) / mm;
    start.size = grouping_size(&start.pose);
    if (start.pose.a * g->turn_axis.x + start.pose.b * g->turn_axis.y <
            g->turn_cosine * start.size ||
        !runs_so(p, &start.pose, s->side[0].direction, start.size) ||
        !runs_so(q, &start.pose, s->side[1].direction, start.size))
        return;
    start.pose.t = cairn_vec2_sub(p->at, grouping_direction(&start.pose, s->side[0].position));
    start.score = sight_score(g, &start.pose);
    start.sample = sample;
    g->looked += g->looked < INT32_MAX;
    keep(g, &start);
}

/* Of so many tokens one is looked at with all others, so that the pairs stay within bounds. */
static int32_t stride_of(const cairn_grouping *g)
{
    return 1 +
           cairn_real_to_int((cairn_real)g->token_count * (cairn_real)g->token_count / MOST_PAIRS);
}

/* Clears the map, marks all tokens; then pair by pair. */
cairn_status cairn_grouping_look(cairn_grouping *g, cairn_budget *budget)
{
    int32_t cells = g->sight_columns * g->sight_rows, samples = g->input.model->sample_count;
    cairn_real reach = g->reach * g->reach;

    for (; g->cursor < cells; g->cursor++) {
        if (!cairn_budget_pay(budget, &g->paid, 1))
            return CAIRN_MORE;
        g->sight[g->cursor] = 0;
    }
    for (; g->cursor < cells + g->token_count; g->cursor++) {
        if (!cairn_budget_pay(budget, &g->paid, 4))
            return CAIRN_MORE;
        mark(g, &g->tokens[g->cursor - cells]);
    }
    for (; g->cursor < cells + 2 * g->token_count; g->cursor += stride_of(g)) {
        const grouping_token *p = &g->tokens[g->cursor - cells - g->token_count];

        for (; g->other < g->token_count; g->other++) {
            const grouping_token *q = &g->tokens[g->other];
            cairn_vec2 c = cairn_vec2_sub(q->at, p->at);
            cairn_real cc = cairn_vec2_norm_squared(c);
            grouping_way way;

            if (budget->left <= 0)
                return CAIRN_MORE;
            if (p == q || cc > reach) {
                budget->left -= g->other % 16 == 0;
                continue;
            }
            if (!cairn_budget_pay(budget, &g->paid, samples))
                return CAIRN_MORE;
            way = g->ways[way_of(c)];
            for (int32_t k = way.from; k < way.to; k++)
                if (may_be(g, k, c, cc))
                    try_sample(g, p, q, k);
        }
        g->other = 0;
    }
    return CAIRN_OK;
}
