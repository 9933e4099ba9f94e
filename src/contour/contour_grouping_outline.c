/* The whole outline of the model is laid onto the tokens in a pose, and the pose moved to where it
 * lies best.
 *
 * Method: dynamic programming along the outline (Viterbi). A sample of the outline goes along one
 * of the tokens near it, or is hidden. What is added up is about the logarithm of how much likelier
 * the tokens are with the object than by chance. A piece of the outline that is seen is worth the
 * more the closer it lies, by one of two widths, whichever explains it better: that of the same
 * object and that of another of its kind. A straight piece is worth less than a bent one, and
 * following a chain round a bend more, since few chains bend there by chance. To begin, to end and
 * to change chains costs something; most of all to leave a chain that goes on elsewhere, which an
 * object's own contour does not. What is hidden costs little: a part of an object is evidence as
 * well.
 *
 * Source: the search over all of a path by dynamic programming is this project's, in place of
 * the likelihood of Adluru 2008 (2.13), which cannot tell a part that is hidden from an object
 * that is not there. */
#include "src/core/build.h"

#include <string.h>

#include "src/contour/contour_grouping_work.h"

/* Of the object's size: pieces of the outline of this length are independent of each other. */
#define PIECE CAIRN_REAL(0.08)
/* What a piece is worth that lies as in the model: if it is the same object, or another of its
 * kind, whose sigmas are WIDER. */
#define SAME    CAIRN_REAL(2.14)
#define SIMILAR CAIRN_REAL(0.5)
#define WIDER   CAIRN_REAL(2.5)
/* By how much a straight piece is worth less. */
#define STRAIGHT CAIRN_REAL(0.65)
/* Edges, in px a px^2, that are usual, and what a piece loses when there are e times as many. */
#define USUAL CAIRN_REAL(0.035)
#define DENSE CAIRN_REAL(0.25)
/* What it costs to hide a piece, to begin or end what is seen, to change to another chain, and
 * to leave one that goes on. */
#define HIDE   CAIRN_REAL(0.15)
#define BORDER CAIRN_REAL(0.4)
#define CHANGE CAIRN_REAL(0.8)
#define LEAVE  2
/* What it is worth to go on along a chain where the outline bends. */
#define BEND 1
/* 1 - cosine of the turn between the neighbours but one of a sample that makes a bend. */
#define BEND_TURN CAIRN_REAL(0.0667)
/* Tokens of a chain that a step may go on by, and that a chain must have left to go on
 * elsewhere. */
enum { STEPS_ON = 3, LEFT_OVER = 2 };
/* Rounds; places with less than one part in so many of the most evidence so far get no further
 * round. */
enum { ROUNDS = 5 };
static const int32_t hope[ROUNDS] = {12, 6, 4, 3, 0};
/* Samples on either side that shift with a sample. */
enum { AROUND = 3 };
/* Of the shift of a sample what is expected of the next one. */
#define CARRY CAIRN_REAL(0.95)
/* Points that the pose of the round before is worth in the fit. */
#define HELD 2
/* Of one sample: its tokens, and its ways. */
enum { UNITS_A_SAMPLE = 12 };

/* How much less a piece is worth in an image with more edges than usual, where more is near any
 * place by chance. */
void cairn_grouping_outline_chance(cairn_grouping *g)
{
    cairn_real length = 0, area = (cairn_real)g->input.width * (cairn_real)g->input.height;

    for (int32_t i = 0; i < g->token_count; i++)
        length += 2 * g->tokens[i].half;
    g->chance = DENSE * cairn_log(cairn_max(length / (area * USUAL), 1));
}

/* How much the outline bends about a sample: 0 not at all, 1 sharply. */
static cairn_real bend_at(const cairn_shape_model *m, int32_t i)
{
    cairn_vec2 before = m->outline[i >= 2 ? i - 2 : 0].direction;
    cairn_vec2 after =
        m->outline[i + 2 < m->outline_count ? i + 2 : m->outline_count - 1].direction;

    return 1 - cairn_exp((cairn_vec2_dot(before, after) - 1) / BEND_TURN);
}

/* 1 when an edge from token `from` to token `to` goes on along a chain, in the sense in which
 * the outline runs. */
static int goes_on(const cairn_grouping *g, int32_t from, int32_t to, cairn_vec2 direction)
{
    int32_t ahead = cairn_vec2_dot(g->tokens[to].direction, direction) >= 0 ? to - from : from - to;

    return g->tokens[from].chain == g->tokens[to].chain && ahead >= 0 && ahead <= STEPS_ON;
}

/* What it costs that the chain of a token goes on ahead of it (ahead 1) or behind it (-1), as
 * the outline runs. */
static cairn_real cost_of_leaving(const cairn_grouping *g, int32_t token, cairn_vec2 direction,
                                  int32_t ahead)
{
    int32_t sense = cairn_vec2_dot(g->tokens[token].direction, direction) >= 0 ? ahead : -ahead;
    int32_t next = token + LEFT_OVER * sense;

    return !g->is_listing && next >= 0 && next < g->token_count &&
                   g->tokens[next].chain == g->tokens[token].chain
               ? LEAVE
               : 0;
}

/* What it costs to come from one cell to another; what it costs to leave the chain of the one,
 * and to come upon that of the other. */
static cairn_real cost_of_step(const cairn_grouping *g, const grouping_cell *from,
                               const grouping_cell *to, cairn_vec2 direction, cairn_real bend,
                               cairn_real leave, cairn_real come)
{
    cairn_real jump;

    if (from->token == to->token)
        return 0;
    if (from->token < 0)
        return BORDER + come;
    if (to->token < 0)
        return BORDER + leave;
    if (goes_on(g, from->token, to->token, direction))
        return -BEND * bend;
    jump = to->off - from->off;
    return CHANGE + jump * jump + leave + come;
}

/* The cells of a sample: hidden, and the tokens near it; their number. */
static int32_t look_around(const cairn_grouping *g, const grouping_pose *pose,
                           const cairn_oriented_point *o, cairn_real bend, grouping_cell *row)
{
    cairn_vec2 at = grouping_place(pose, o->position),
               direction = grouping_direction(pose, o->direction);
    cairn_real size = grouping_size(pose), sigma = g->params.deform * size,
               cost[GROUPING_CELLS - 1];
    cairn_real pieces = g->spacing / PIECE, worth = g->is_listing ? 1 : 1 - STRAIGHT * (1 - bend);
    int32_t token[GROUPING_CELLS - 1];
    int32_t count;

    at = g->is_listing ? cairn_vec2_add(at, g->shift[o - g->input.model->outline]) : at;
    count = cairn_grouping_near(g, at, direction, sigma, GROUPING_CELLS - 1, token, cost);

    row[0].token = -1;
    row[0].cost = row[0].off = 0;
    row[0].value = -HIDE * pieces;
    for (int32_t k = 0; k < count; k++) {
        cairn_vec2 off = cairn_vec2_sub(cairn_grouping_touch(g, token[k], at), at);

        row[k + 1].token = token[k];
        row[k + 1].cost = cost[k];
        row[k + 1].off = cairn_vec2_cross(direction, off) / (size * sigma);
        row[k + 1].value =
            pieces * (cairn_max(SAME * worth - WIDER * WIDER * cost[k], SIMILAR * worth - cost[k]) -
                      g->chance);
    }
    return count + 1;
}

/* One sample of the outline: its cells, and the best way to each. */
static void lay_sample(cairn_grouping *g, int32_t i)
{
    const cairn_oriented_point *o = &g->input.model->outline[i];
    grouping_cell *row = &g->cells[i * GROUPING_CELLS], *before = row - GROUPING_CELLS;
    cairn_vec2 direction = grouping_direction(&g->pose, o->direction);
    cairn_real bend = g->bend[i], leave[GROUPING_CELLS];
    int32_t count = look_around(g, &g->pose, o, bend, row);

    for (int32_t j = 0; j < g->cell_count && i > 0; j++)
        leave[j] = before[j].token < 0 ? 0 : cost_of_leaving(g, before[j].token, direction, 1);
    for (int32_t k = 0; k < count && i > 0; k++) {
        cairn_real most = -CAIRN_REAL_MAX;
        cairn_real come = row[k].token < 0 ? 0 : cost_of_leaving(g, row[k].token, direction, -1);

        for (int32_t j = 0; j < g->cell_count; j++) {
            cairn_real value = before[j].value - cost_of_step(g, &before[j], &row[k], direction,
                                                              bend, leave[j], come);

            if (value > most) {
                most = value;
                row[k].from = j;
            }
        }
        row[k].value += most;
    }
    g->cell_count = count;
}

/* Follows the best way back: matches and their costs. Its value. */
static cairn_real read_way(cairn_grouping *g)
{
    int32_t last = g->input.model->outline_count - 1, at = 0;
    const grouping_cell *row = &g->cells[last * GROUPING_CELLS];
    cairn_real value;

    for (int32_t k = 1; k < g->cell_count; k++)
        if (row[k].value > row[at].value)
            at = k;
    value = row[at].value;
    for (int32_t i = last; i >= 0; i--) {
        const grouping_cell *c = &g->cells[i * GROUPING_CELLS + at];

        g->match[i] = c->token;
        g->cost[i] = c->cost;
        at = c->from;
    }
    return value;
}

cairn_status cairn_grouping_lay(cairn_grouping *g, cairn_budget *budget)
{
    g->is_laying = 1;
    for (; g->sample < g->input.model->outline_count; g->sample++) {
        if (!cairn_budget_pay(budget, &g->paid, UNITS_A_SAMPLE))
            return CAIRN_MORE;
        lay_sample(g, g->sample);
    }
    g->sample = g->is_laying = 0;
    g->evidence = read_way(g);
    return CAIRN_OK;
}

/* Moves the pose to where the matches lie best. */
static void move(cairn_grouping *g)
{
    const cairn_shape_model *m = g->input.model;
    grouping_sums sums = cairn_grouping_hold(&g->pose, HELD);
    grouping_pose was = g->pose;

    for (int32_t i = 0; i < m->outline_count; i++) {
        cairn_vec2 place = m->outline[i].position;

        if (g->match[i] >= 0)
            cairn_grouping_sum(&sums, place,
                               cairn_grouping_touch(g, g->match[i], grouping_place(&was, place)),
                               cairn_exp(-g->cost[i]));
    }
    g->pose = cairn_grouping_fit(&sums, &was);
}

cairn_status cairn_grouping_refine(cairn_grouping *g, cairn_budget *budget)
{
    for (; g->round < ROUNDS; g->round++) {
        cairn_status status = cairn_grouping_lay(g, budget);

        if (status != CAIRN_OK)
            return status;
        if (g->round + 1 == ROUNDS || g->evidence * (cairn_real)hope[g->round] < g->most)
            break;
        move(g);
        g->is_laying = 1;
    }
    g->round = g->is_laying = 0;
    g->most = cairn_max(g->most, g->evidence);
    return CAIRN_OK;
}

/* Sums of the shifts of the samples from i - AROUND to i + AROUND that are seen, and their
 * number. */
static int32_t shifts_around(const cairn_grouping *g, int32_t i, cairn_vec2 *sum)
{
    const cairn_shape_model *m = g->input.model;
    int32_t count = 0;

    sum->x = sum->y = 0;
    for (int32_t k = i > AROUND ? i - AROUND : 0; k <= i + AROUND && k < m->outline_count; k++)
        if (g->match[k] >= 0) {
            cairn_vec2 place = grouping_place(&g->pose, m->outline[k].position);
            cairn_vec2 from = cairn_vec2_add(place, g->shift[k]);

            *sum = cairn_vec2_add(
                *sum, cairn_vec2_sub(cairn_grouping_touch(g, g->match[k], from), place));
            count++;
        }
    return count;
}

/* Where nothing is seen around, the shift is that of the nearest sample where something is, the
 * less the farther it is. */
static void carry(cairn_vec2 *shift, int32_t *apart, int32_t count, int32_t step)
{
    int32_t at = step > 0 ? 0 : count - 1;

    for (int32_t k = 1; k < 2 * count; k++) {
        int32_t next = (at + step + count) % count;

        if (apart[at] + 1 < apart[next]) {
            apart[next] = apart[at] + 1;
            shift[next] = cairn_vec2_scale(shift[at], CARRY);
        }
        at = next;
    }
}

void cairn_grouping_bend(cairn_grouping *g)
{
    int32_t count = g->input.model->outline_count;
    cairn_vec2 sum;

    for (int32_t i = 0; i < count; i++) {
        int32_t seen = shifts_around(g, i, &sum);

        g->bent[i] = cairn_vec2_scale(sum, 1 / (cairn_real)(seen > 0 ? seen : 1));
        g->apart[i] = seen > 0 ? 0 : 2 * count;
    }
    carry(g->bent, g->apart, count, 1);
    carry(g->bent, g->apart, count, -1);
    memcpy(g->shift, g->bent, (size_t)count * sizeof *g->bent);
}

void cairn_grouping_outline_begin(cairn_grouping *g)
{
    const cairn_shape_model *m = g->input.model;
    cairn_real sum = 0;

    for (int32_t i = 1; i < m->outline_count; i++)
        sum += cairn_vec2_norm(cairn_vec2_sub(m->outline[i].position, m->outline[i - 1].position));
    g->spacing = sum / (cairn_real)m->outline_count;
    for (int32_t i = 0; i < m->outline_count; i++)
        g->bend[i] = bend_at(m, i);
    g->most = 0;
    g->sample = g->round = g->cell_count = g->is_laying = g->is_listing = 0;
}
