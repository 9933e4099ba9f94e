/* Tokens: the segments are cut into short pieces, which are sorted into a grid, so that those near a
 * point of a contour are found. */
#include "src/base/build.h"

#include "src/containers/counting_sort.h"
#include "src/outlines/contour_grouping_work.h"

/* Consecutive segments with a smaller gap between their ends belong to one chain, px. */
enum { MAX_CHAIN_GAP_PX = 3 };
/* Limit of pieces per segment, and of all segments together before subsampling. */
enum { MAX_PIECES = 1 << 24 };

/* Chain index of a segment's tokens: that of the previous token when the segments are contiguous,
 * else a new one. */
static int32_t chain_of(const cairn_contour_grouping *grouping, int32_t segment)
{
    const contour_grouping_token *previous = &grouping->tokens[grouping->token_count - 1];
    cairn_vec2 gap;

    if (grouping->token_count == 0 || previous->segment == segment)
        return grouping->token_count == 0 ? 0 : previous->chain;
    gap = cairn_vec2_sub(grouping->input.segments[segment].a,
                         grouping->input.segments[previous->segment].b);
    return previous->chain + (cairn_vec2_norm_squared(gap) > MAX_CHAIN_GAP_PX * MAX_CHAIN_GAP_PX);
}

/* Number of pieces of a segment. */
static int32_t pieces_of(const cairn_contour_grouping *grouping, int32_t segment)
{
    cairn_real length = cairn_segment_length(grouping->input.segments[segment]);

    return cairn_real_to_int(
        cairn_min(cairn_ceil(length / grouping->params.token_length), MAX_PIECES));
}

/* 1 when piece number `piece` of all becomes a token: all of them, or an even subsample of
 * max_tokens. */
static int is_kept(const cairn_contour_grouping *grouping, int32_t piece)
{
    int64_t capacity = grouping->params.max_tokens, all = grouping->pieces.count;

    return all <= capacity || (piece + 1) * capacity / all > piece * capacity / all;
}

/* Cuts one segment into tokens. */
static void cut(cairn_contour_grouping *grouping, int32_t index)
{
    cairn_segment s = grouping->input.segments[index];
    cairn_real length = cairn_segment_length(s);
    cairn_vec2 along = cairn_vec2_sub(s.b, s.a);
    int32_t piece_count = pieces_of(grouping, index);

    for (int32_t i = 0; i < piece_count; i++) {
        contour_grouping_token *token = &grouping->tokens[grouping->token_count];

        if (!is_kept(grouping, grouping->pieces.cut + i))
            continue;
        token->middle =
            cairn_vec2_add(s.a, cairn_vec2_scale(along, ((cairn_real)i + CAIRN_REAL(0.5)) /
                                                            (cairn_real)piece_count));
        token->direction = cairn_vec2_scale(along, 1 / length);
        token->half_length = length / (2 * (cairn_real)piece_count);
        grouping->pieces.length += 2 * token->half_length;
        token->segment = index;
        token->chain = chain_of(grouping, index);
        token->is_used = 0;
        counting_sort_count(
            grouping->cell_start,
            cell_grid_cell(&grouping->grid, CONTOUR_GROUPING_TOKEN_CELL_PX, token->middle));
        grouping->token_count++;
    }
    grouping->pieces.cut += piece_count;
}

/* Counts the pieces of a segment. */
static cairn_status count_pieces(cairn_contour_grouping *grouping, int32_t segment)
{
    if (!cairn_segment_is_finite(grouping->input.segments[segment]))
        return CAIRN_NOT_FINITE;
    grouping->pieces.count += pieces_of(grouping, segment);
    return grouping->pieces.count > MAX_PIECES ? CAIRN_FULL : CAIRN_OK;
}

/* Puts a token into its cell. */
static void sort_token(cairn_contour_grouping *grouping, int32_t index)
{
    const contour_grouping_token *token = &grouping->tokens[index];
    int32_t place = counting_sort_place(
        grouping->cell_start,
        cell_grid_cell(&grouping->grid, CONTOUR_GROUPING_TOKEN_CELL_PX, token->middle));
    contour_grouping_sorted_token sorted = {token->middle, token->direction, token->half_length,
                                            index};

    grouping->sorted_tokens[place] = sorted;
}

int cairn_contour_grouping_make_tokens(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(grouping->phase_resume);
    for (grouping->cell = 0; grouping->cell < cell_grid_count(&grouping->grid); grouping->cell++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, 1);
        counting_sort_reset(grouping->cell_start, grouping->cell, grouping->cell + 2);
    }
    for (grouping->segment = 0; grouping->segment < grouping->input.count; grouping->segment++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, 1);
        grouping->status = count_pieces(grouping, grouping->segment);
        CAIRN_STEP_UNTIL(grouping->phase_resume, grouping->status == CAIRN_OK);
    }
    for (grouping->segment = 0; grouping->segment < grouping->input.count; grouping->segment++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget,
                          1 + pieces_of(grouping, grouping->segment));
        cut(grouping, grouping->segment);
    }
    for (grouping->cell = 0; grouping->cell < cell_grid_count(&grouping->grid); grouping->cell++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, 1);
        counting_sort_sum(grouping->cell_start, grouping->cell + 1, grouping->cell + 2);
    }
    for (grouping->token = 0; grouping->token < grouping->token_count; grouping->token++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, 1);
        sort_token(grouping, grouping->token);
    }
    CAIRN_STEP_END(grouping->phase_resume);
}

/* ---- Matching ---- */

cairn_vec2 cairn_contour_grouping_nearest_point(const cairn_contour_grouping *grouping,
                                                int32_t token, cairn_vec2 p)
{
    const contour_grouping_token *t = &grouping->tokens[token];
    cairn_real along = cairn_vec2_dot(t->direction, cairn_vec2_sub(p, t->middle));

    return cairn_vec2_add(
        t->middle, cairn_vec2_scale(t->direction,
                                    cairn_max(-t->half_length, cairn_min(along, t->half_length))));
}

/* A contour point and its tolerances: 1 / sigma^2 of the distance across the contour and of the
 * sine of the angle. The tolerance of the gap along the contour is twice as wide. */
typedef struct contour_place {
    cairn_vec2 middle, along;
    cairn_real across, turn;
} contour_place;

/* Cost of a token at a contour point: half the squared distance in sigmas. Returns early with a
 * value above `limit` when the angle alone or the lower bound of the distance across exceeds it. */
static cairn_real token_cost(const contour_place *place, const contour_grouping_sorted_token *token,
                             cairn_real limit)
{
    cairn_real sine = cairn_vec2_cross(place->along, token->direction),
               turn_cost = sine * sine * place->turn, across, middle, gap;
    cairn_vec2 offset = cairn_vec2_sub(token->middle, place->middle);

    if (turn_cost > 2 * limit)
        return turn_cost;
    middle = cairn_vec2_cross(place->along, offset);
    across = cairn_max(cairn_abs(middle) - token->half_length * cairn_abs(sine), 0);
    if (across * across * place->across > 2 * limit)
        return CAIRN_REAL_MAX;
    gap = cairn_max(-token->half_length,
                    cairn_min(-cairn_vec2_dot(token->direction, offset), token->half_length));
    across = middle + sine * gap;
    gap = CAIRN_REAL(0.5) * (cairn_vec2_dot(place->along, offset) +
                             cairn_vec2_dot(place->along, token->direction) * gap);
    return CAIRN_REAL(0.5) * ((across * across + gap * gap) * place->across + turn_cost);
}

int32_t cairn_contour_grouping_match_tokens(const cairn_contour_grouping *grouping, cairn_vec2 at,
                                            cairn_vec2 direction, cairn_real sigma, int32_t most,
                                            int32_t *token, cairn_real *cost)
{
    cairn_real reach = cairn_min(cairn_max(3 * sigma, 4) + grouping->params.token_length / 2, 64),
               limit = CAIRN_REAL(4.5);
    cell_range cells = cell_grid_range(&grouping->grid, CONTOUR_GROUPING_TOKEN_CELL_PX,
                                       cairn_box_grow((cairn_box){at, at}, reach));
    contour_place point = {at, cairn_vec2_unit(direction), 0,
                           1 / (grouping->params.turn_sigma * grouping->params.turn_sigma)};
    int32_t count = 0;

    sigma = cairn_max(sigma, CAIRN_REAL(1.5));
    point.across = 1 / (sigma * sigma);
    for (int32_t y = cells.y0; y <= cells.y1; y++) {
        const int32_t *row = &grouping->cell_start[y * grouping->grid.columns];
        const contour_grouping_sorted_token *n = &grouping->sorted_tokens[row[cells.x0]],
                                            *end = &grouping->sorted_tokens[row[cells.x1 + 1]];

        for (; n < end; n++) {
            cairn_real c = token_cost(&point, n, limit);
            int32_t i;

            if (c > limit || (count == most && c >= cost[count - 1]) ||
                grouping->tokens[n->token].is_used)
                continue;
            count += count < most;
            for (i = count - 1; i > 0 && cost[i - 1] > c; i--) {
                cost[i] = cost[i - 1];
                token[i] = token[i - 1];
            }
            cost[i] = c;
            token[i] = n->token;
            limit = count == most ? cost[count - 1] : limit;
        }
    }
    return count;
}
