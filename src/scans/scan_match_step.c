/* scan_match: the phases of a match, item by item. scan_match.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "src/scans/scan_match_shape.h"

enum { CELLS_PER_ITEM = 64 }; /* cells of a grid that are summed in one item */

static const cairn_real INDEX_CELL_SPACINGS =
    CAIRN_REAL(1.75); /* cell side of a grid, in spacings */

static void enter(cairn_scan_match *match, scan_match_phase phase)
{
    match->phase = phase;
    match->index_in_phase = 0;
}

/* Returns the grid and the points that are being sorted: the evenly spaced ones, then the dense
 * ones. */
static scan_match_index *current_index(cairn_scan_match *match, const cairn_oriented_point **points)
{
    *points = match->hypothesis_index == 0 ? match->target : match->dense;
    return match->hypothesis_index == 0 ? &match->index : &match->dense_index;
}

/* Only voting needs the points by direction. */
static int32_t sorts_by_direction(const cairn_scan_match *match)
{
    return match->hypothesis_index == 0 && match->shape == NULL;
}

static void reset_item(cairn_scan_match *match)
{
    cairn_scan_match_index_reset(&match->index, match->params.max_target, match->target_count,
                                 INDEX_CELL_SPACINGS * match->params.spacing);
    cairn_scan_match_index_reset(&match->dense_index, match->params.max_dense, match->dense_count,
                                 INDEX_CELL_SPACINGS * match->params.spacing);
    cairn_scan_match_positions_reset(match);
    cairn_scan_match_charge(match, (match->index.side * match->index.side +
                                    match->dense_index.side * match->dense_index.side) /
                                       16);
    match->hypothesis_index = 0;
    enter(match, SCAN_MATCH_COUNT);
}

static void count_item(cairn_scan_match *match)
{
    const cairn_oriented_point *points;
    scan_match_index *index = current_index(match, &points);

    if (match->index_in_phase < index->count) {
        cairn_scan_match_index_count(index, points[match->index_in_phase].position);
        if (sorts_by_direction(match))
            cairn_scan_match_positions_count(match, &points[match->index_in_phase]);
        match->index_in_phase++;
    }
    cairn_scan_match_charge(match, sorts_by_direction(match) ? 48 : 16);
    if (match->index_in_phase == index->count)
        enter(match, SCAN_MATCH_SUM);
}

static void sum_item(cairn_scan_match *match)
{
    const cairn_oriented_point *points;
    scan_match_index *index = current_index(match, &points);
    int32_t cells = index->side * index->side + 1,
            end = match->index_in_phase + CELLS_PER_ITEM < cells
                      ? match->index_in_phase + CELLS_PER_ITEM
                      : cells;

    cairn_scan_match_index_sum(index, match->index_in_phase, end);
    match->index_in_phase = end;
    cairn_scan_match_charge(match, 4 * SCAN_MATCH_PARTS_PER_UNIT);
    if (match->index_in_phase < cells)
        return;
    if (sorts_by_direction(match))
        cairn_scan_match_positions_sum(match);
    enter(match, SCAN_MATCH_PLACE);
}

/* The last point first, so that the sort is stable. */
static void place_item(cairn_scan_match *match)
{
    const cairn_oriented_point *points;
    scan_match_index *index = current_index(match, &points);

    if (match->index_in_phase < index->count) {
        const cairn_oriented_point *p = &points[index->count - 1 - match->index_in_phase++];

        cairn_scan_match_index_place(index, *p);
        if (sorts_by_direction(match))
            cairn_scan_match_positions_place(match, p);
    }
    cairn_scan_match_charge(match, sorts_by_direction(match) ? 48 : 16);
    if (match->index_in_phase < index->count)
        return;
    enter(match, SCAN_MATCH_COUNT);
    if (match->hypothesis_index++ == 0)
        return;
    match->is_indexed = 1;
    enter(match, match->shape != NULL ? SCAN_MATCH_SHAPE_TARGET : SCAN_MATCH_VOTE);
}

/* Returns the first phase after the target's descriptors: without rotations only ICP. */
static scan_match_phase first_of_shape(const cairn_scan_match *match)
{
    return match->shape->rotations > 0 ? SCAN_MATCH_SHAPE_TURN : SCAN_MATCH_SHAPE_ICP;
}

void cairn_scan_match_start(cairn_scan_match *match)
{
    if (match->shape != NULL)
        cairn_scan_match_shape_begin(match);
    else
        cairn_scan_match_votes_begin(match);
    enter(match, match->shape != NULL ? SCAN_MATCH_SHAPE_TURN : SCAN_MATCH_VOTE);
    if (!match->is_indexed)
        enter(match, SCAN_MATCH_RESET);
}

void cairn_scan_match_start_icp(cairn_scan_match *match, cairn_pose start)
{
    cairn_scan_match_written_icp_begin(match, start);
    enter(match, match->is_indexed ? SCAN_MATCH_SHAPE_ICP : SCAN_MATCH_RESET);
}

/* Candidates that pass the non-maximum suppression become the hypotheses to be refined. */
static void choose_item(cairn_scan_match *match)
{
    if (!cairn_scan_match_suppress_item(match))
        return;
    match->stage = match->hypothesis_index = 0;
    match->phase = SCAN_MATCH_RANK;
    if (match->hypothesis_count == 0)
        return;
    match->phase = SCAN_MATCH_FIT;
    cairn_scan_match_fit_begin(match, match->hypotheses[0].target_query);
}

static void peaks_item(cairn_scan_match *match)
{
    if (!cairn_scan_match_peak_item(match))
        return;
    enter(match, SCAN_MATCH_VOTE);
    if (match->votes.rotation < match->votes.rotations)
        return;
    cairn_scan_match_sort_candidates(match);
    cairn_scan_match_charge(match, match->candidate_count * 8);
    match->hypothesis_count = 0;
    enter(match, SCAN_MATCH_CHOOSE);
}

static void tally_item(cairn_scan_match *match)
{
    if (!cairn_scan_match_score_item(match))
        return;
    match->hypothesis_index++;
    match->measure.refinements++;
    match->phase = SCAN_MATCH_RANK;
    if (match->hypothesis_index == match->hypothesis_count)
        return;
    match->phase = SCAN_MATCH_FIT;
    cairn_scan_match_fit_begin(match, match->hypotheses[match->hypothesis_index].target_query);
}

/* The best hypotheses enter the next stage. */
static void rank_item(cairn_scan_match *match)
{
    int32_t most = match->params.max_hypotheses, keep = cairn_scan_match_current_stage(match)->keep;

    cairn_scan_match_charge(match, (8 + match->hypothesis_count / 2) * match->hypothesis_count);
    if (keep == 0)
        keep = most;
    else if (keep < 2 * most)
        keep = 2 * most;
    cairn_scan_match_select(match, keep);
    match->hypothesis_index = 0;
    match->stage++;
    if (match->hypothesis_count == 0 || match->stage >= SCAN_MATCH_STAGES) {
        cairn_scan_match_decide(match);
        match->phase = SCAN_MATCH_DONE;
        return;
    }
    match->phase = SCAN_MATCH_FIT;
    cairn_scan_match_fit_begin(match, match->hypotheses[0].target_query);
}

static void run_correlative(cairn_scan_match *match)
{
    switch (match->phase) {
    case SCAN_MATCH_RESET:
        reset_item(match);
        break;
    case SCAN_MATCH_COUNT:
        count_item(match);
        break;
    case SCAN_MATCH_SUM:
        sum_item(match);
        break;
    case SCAN_MATCH_PLACE:
        place_item(match);
        break;
    case SCAN_MATCH_VOTE:
        if (cairn_scan_match_vote_item(match))
            enter(match, SCAN_MATCH_PEAKS);
        break;
    case SCAN_MATCH_PEAKS:
        peaks_item(match);
        break;
    case SCAN_MATCH_CHOOSE:
        choose_item(match);
        break;
    case SCAN_MATCH_FIT:
        if (cairn_scan_match_fit_item(match)) {
            match->phase = SCAN_MATCH_SCORE;
            cairn_scan_match_score_begin(match);
        }
        break;
    case SCAN_MATCH_SCORE:
        tally_item(match);
        break;
    default:
        rank_item(match);
        break;
    }
}

/* The best rotation becomes the one hypothesis; only its covariance and score are computed. */
static void start_last_stage(cairn_scan_match *match)
{
    match->hypothesis_count = match->shape->best_overlap > 0;
    match->hypotheses[0].target_query = match->shape->best;
    match->stage = SCAN_MATCH_STAGES;
    match->hypothesis_index = 0;
    match->phase = SCAN_MATCH_RANK;
    if (match->hypothesis_count == 0)
        return;
    match->phase = SCAN_MATCH_FIT;
    cairn_scan_match_fit_begin(match, match->shape->best);
}

/* All rotations have been tried, and the stored pairs are those of the best one. */
static void end_shape(cairn_scan_match *match)
{
    if (!cairn_scan_match_has_icp(match) || match->shape->best_overlap <= 0) {
        start_last_stage(match);
        return;
    }
    cairn_scan_match_shape_icp_begin(match);
    enter(match, SCAN_MATCH_SHAPE_ICP);
}

static void end_rotation(cairn_scan_match *match)
{
    int32_t is_there = match->shape->with_lines;

    if (cairn_scan_match_shape_has_ended(match)) {
        if (match->shape->best_overlap <= 0) {
            end_shape(match);
            return;
        }
        is_there = cairn_scan_match_shape_restore_best(match);
    }
    enter(match, is_there ? SCAN_MATCH_SHAPE_FILTER : SCAN_MATCH_SHAPE_TURN);
}

static void run_shape(cairn_scan_match *match)
{
    switch (match->phase) {
    case SCAN_MATCH_SHAPE_TARGET:
        if (cairn_scan_match_shape_describe_target(match))
            enter(match, first_of_shape(match));
        break;
    case SCAN_MATCH_SHAPE_TURN:
        if (cairn_scan_match_shape_rotate(match))
            enter(match, SCAN_MATCH_SHAPE_ALIGN);
        break;
    case SCAN_MATCH_SHAPE_FILTER:
        if (cairn_scan_match_shape_filter(match))
            enter(match, SCAN_MATCH_SHAPE_SEGMENT);
        break;
    case SCAN_MATCH_SHAPE_SEGMENT:
        if (!cairn_scan_match_shape_segment(match))
            break;
        if (match->shape->is_replay)
            end_shape(match);
        else
            enter(match, SCAN_MATCH_SHAPE_TRANSLATE);
        break;
    case SCAN_MATCH_SHAPE_TRANSLATE:
        if (cairn_scan_match_shape_translate(match))
            enter(match, SCAN_MATCH_SHAPE_OVERLAP);
        break;
    case SCAN_MATCH_SHAPE_OVERLAP:
        if (cairn_scan_match_shape_overlap(match))
            end_rotation(match);
        break;
    default:
        if (cairn_scan_match_is_as_written(match) ? cairn_scan_match_written_icp(match)
                                                  : cairn_scan_match_shape_icp(match))
            start_last_stage(match);
        break;
    }
}

static void run_item(cairn_scan_match *match)
{
    if (match->phase >= SCAN_MATCH_SHAPE_TARGET && match->phase <= SCAN_MATCH_SHAPE_ICP)
        run_shape(match);
    else
        run_correlative(match);
}

cairn_status cairn_scan_match_step(cairn_scan_match *match, cairn_budget *budget)
{
    if (match == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while ((match->phase != SCAN_MATCH_IDLE && match->phase != SCAN_MATCH_DONE) ||
           match->parts_due >= SCAN_MATCH_PARTS_PER_UNIT) {
        int32_t before = match->parts_due, due = match->parts_due / SCAN_MATCH_PARTS_PER_UNIT;

        if (budget->left <= 0)
            return CAIRN_MORE;
        if (due > 0) {
            due = cairn_budget_take(budget, due);
            match->parts_due -= due * SCAN_MATCH_PARTS_PER_UNIT;
            match->measure.units += due;
            continue;
        }
        if (match->phase == SCAN_MATCH_SHAPE_ALIGN) {
            cairn_status status = cairn_scan_match_shape_align(match, budget);

            if (status != CAIRN_OK)
                return status;
            enter(match, SCAN_MATCH_SHAPE_FILTER);
            continue;
        }
        run_item(match);
        due = (match->parts_due - before) / SCAN_MATCH_PARTS_PER_UNIT;
        if (due > match->measure.worst_step)
            match->measure.worst_step = due;
    }
    return CAIRN_OK;
}
