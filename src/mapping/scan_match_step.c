/* scan_match: the phases of a match, item by item. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/scan_match_shape.h"

enum { CELLS_PER_ITEM = 64 }; /* cells of a grid that are summed in one item */

static const cairn_real INDEX_CELL_SPACINGS =
    CAIRN_REAL(1.75); /* cell side of a grid, in spacings */

static void enter(cairn_scan_match *match, match_phase phase)
{
    match->phase = phase;
    match->at = 0;
}

/* Returns the grid and the points that are being sorted: the evenly spaced ones, then the dense
 * ones. */
static match_index *current_index(cairn_scan_match *match, const cairn_oriented_point **points)
{
    *points = match->other == 0 ? match->target : match->dense;
    return match->other == 0 ? &match->index : &match->dense_index;
}

/* Only voting needs the points by direction. */
static int32_t sorts_by_direction(const cairn_scan_match *match)
{
    return match->other == 0 && match->shape == NULL;
}

static void reset_item(cairn_scan_match *match)
{
    cairn_match_index_reset(&match->index, match->params.max_target, match->target_count,
                            INDEX_CELL_SPACINGS * match->params.spacing);
    cairn_match_index_reset(&match->dense_index, match->params.max_dense, match->dense_count,
                            INDEX_CELL_SPACINGS * match->params.spacing);
    cairn_match_spots_reset(match);
    cairn_match_charge(match, (match->index.side * match->index.side +
                               match->dense_index.side * match->dense_index.side) /
                                  16);
    match->other = 0;
    enter(match, MATCH_COUNT);
}

static void count_item(cairn_scan_match *match)
{
    const cairn_oriented_point *points;
    match_index *index = current_index(match, &points);

    if (match->at < index->count) {
        cairn_match_index_count(index, points[match->at].position);
        if (sorts_by_direction(match))
            cairn_match_spots_count(match, &points[match->at]);
        match->at++;
    }
    cairn_match_charge(match, sorts_by_direction(match) ? 48 : 16);
    if (match->at == index->count)
        enter(match, MATCH_SUM);
}

static void sum_item(cairn_scan_match *match)
{
    const cairn_oriented_point *points;
    match_index *index = current_index(match, &points);
    int32_t cells = index->side * index->side + 1,
            end = match->at + CELLS_PER_ITEM < cells ? match->at + CELLS_PER_ITEM : cells;

    cairn_match_index_sum(index, match->at, end);
    match->at = end;
    cairn_match_charge(match, 4 * MATCH_PART);
    if (match->at < cells)
        return;
    if (sorts_by_direction(match))
        cairn_match_spots_sum(match);
    enter(match, MATCH_PLACE);
}

/* The last point first, so that the sort is stable. */
static void place_item(cairn_scan_match *match)
{
    const cairn_oriented_point *points;
    match_index *index = current_index(match, &points);

    if (match->at < index->count) {
        const cairn_oriented_point *p = &points[index->count - 1 - match->at++];

        cairn_match_index_place(index, *p);
        if (sorts_by_direction(match))
            cairn_match_spots_place(match, p);
    }
    cairn_match_charge(match, sorts_by_direction(match) ? 48 : 16);
    if (match->at < index->count)
        return;
    enter(match, MATCH_COUNT);
    if (match->other++ == 0)
        return;
    match->is_indexed = 1;
    enter(match, match->shape != NULL ? MATCH_SHAPE_TARGET : MATCH_VOTE);
}

/* Returns the first phase after the target's descriptors: without rotations only ICP. */
static match_phase first_of_shape(const cairn_scan_match *match)
{
    return match->shape->rotations > 0 ? MATCH_SHAPE_TURN : MATCH_SHAPE_ICP;
}

void cairn_match_start(cairn_scan_match *match)
{
    if (match->shape != NULL)
        cairn_match_shape_begin(match);
    else
        cairn_match_votes_begin(match);
    enter(match, match->shape != NULL ? MATCH_SHAPE_TURN : MATCH_VOTE);
    if (!match->is_indexed)
        enter(match, MATCH_RESET);
}

void cairn_match_start_icp(cairn_scan_match *match, cairn_pose start)
{
    cairn_match_written_icp_at(match, start);
    enter(match, match->is_indexed ? MATCH_SHAPE_ICP : MATCH_RESET);
}

/* Candidates that pass the non-maximum suppression become the hypotheses to be refined. */
static void choose_item(cairn_scan_match *match)
{
    if (!cairn_match_choose(match))
        return;
    match->stage = match->other = 0;
    match->phase = MATCH_RANK;
    if (match->hypothesis_count == 0)
        return;
    match->phase = MATCH_FIT;
    cairn_match_fit_begin(match, match->hypotheses[0].target_query);
}

static void peaks_item(cairn_scan_match *match)
{
    if (!cairn_match_peaks(match))
        return;
    enter(match, MATCH_VOTE);
    if (match->votes.rotation < match->votes.rotations)
        return;
    cairn_match_sort(match);
    cairn_match_charge(match, match->candidate_count * 8);
    match->hypothesis_count = 0;
    enter(match, MATCH_CHOOSE);
}

static void tally_item(cairn_scan_match *match)
{
    if (!cairn_match_tally_item(match))
        return;
    match->other++;
    match->measure.fits++;
    match->phase = MATCH_RANK;
    if (match->other == match->hypothesis_count)
        return;
    match->phase = MATCH_FIT;
    cairn_match_fit_begin(match, match->hypotheses[match->other].target_query);
}

/* The best hypotheses enter the next stage. */
static void rank_item(cairn_scan_match *match)
{
    int32_t most = match->params.max_hypotheses, keep = cairn_match_stage_of(match)->keep;

    cairn_match_charge(match, (8 + match->hypothesis_count / 2) * match->hypothesis_count);
    if (keep == 0)
        keep = most;
    else if (keep < 2 * most)
        keep = 2 * most;
    cairn_match_thin(match, keep);
    match->other = 0;
    match->stage++;
    if (match->hypothesis_count == 0 || match->stage >= MATCH_STAGES) {
        cairn_match_judge(match);
        match->phase = MATCH_DONE;
        return;
    }
    match->phase = MATCH_FIT;
    cairn_match_fit_begin(match, match->hypotheses[0].target_query);
}

static void run_correlative(cairn_scan_match *match)
{
    switch (match->phase) {
    case MATCH_RESET:
        reset_item(match);
        break;
    case MATCH_COUNT:
        count_item(match);
        break;
    case MATCH_SUM:
        sum_item(match);
        break;
    case MATCH_PLACE:
        place_item(match);
        break;
    case MATCH_VOTE:
        if (cairn_match_vote(match))
            enter(match, MATCH_PEAKS);
        break;
    case MATCH_PEAKS:
        peaks_item(match);
        break;
    case MATCH_CHOOSE:
        choose_item(match);
        break;
    case MATCH_FIT:
        if (cairn_match_fit_item(match)) {
            match->phase = MATCH_TALLY;
            cairn_match_tally_begin(match);
        }
        break;
    case MATCH_TALLY:
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
    match->stage = MATCH_STAGES;
    match->other = 0;
    match->phase = MATCH_RANK;
    if (match->hypothesis_count == 0)
        return;
    match->phase = MATCH_FIT;
    cairn_match_fit_begin(match, match->shape->best);
}

/* All rotations have been tried, and the stored pairs are those of the best one. */
static void end_shape(cairn_scan_match *match)
{
    if (!cairn_match_has_icp(match) || match->shape->best_overlap <= 0) {
        start_last_stage(match);
        return;
    }
    cairn_match_shape_icp_begin(match);
    enter(match, MATCH_SHAPE_ICP);
}

static void end_rotation(cairn_scan_match *match)
{
    int32_t is_there = match->shape->with_lines;

    if (cairn_match_shape_is_turned(match)) {
        if (match->shape->best_overlap <= 0) {
            end_shape(match);
            return;
        }
        is_there = cairn_match_shape_again(match);
    }
    enter(match, is_there ? MATCH_SHAPE_FILTER : MATCH_SHAPE_TURN);
}

static void run_shape(cairn_scan_match *match)
{
    switch (match->phase) {
    case MATCH_SHAPE_TARGET:
        if (cairn_match_shape_target(match))
            enter(match, first_of_shape(match));
        break;
    case MATCH_SHAPE_TURN:
        if (cairn_match_shape_turn(match))
            enter(match, MATCH_SHAPE_ALIGN);
        break;
    case MATCH_SHAPE_FILTER:
        if (cairn_match_shape_filter(match))
            enter(match, MATCH_SHAPE_SEGMENT);
        break;
    case MATCH_SHAPE_SEGMENT:
        if (!cairn_match_shape_segment(match))
            break;
        if (match->shape->is_again)
            end_shape(match);
        else
            enter(match, MATCH_SHAPE_TRANSLATE);
        break;
    case MATCH_SHAPE_TRANSLATE:
        if (cairn_match_shape_translate(match))
            enter(match, MATCH_SHAPE_OVERLAP);
        break;
    case MATCH_SHAPE_OVERLAP:
        if (cairn_match_shape_overlap(match))
            end_rotation(match);
        break;
    default:
        if (cairn_match_is_as_written(match) ? cairn_match_written_icp(match)
                                             : cairn_match_shape_icp(match))
            start_last_stage(match);
        break;
    }
}

static void run_item(cairn_scan_match *match)
{
    if (match->phase >= MATCH_SHAPE_TARGET && match->phase <= MATCH_SHAPE_ICP)
        run_shape(match);
    else
        run_correlative(match);
}

cairn_status cairn_scan_match_step(cairn_scan_match *match, cairn_budget *budget)
{
    if (match == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while ((match->phase != MATCH_IDLE && match->phase != MATCH_DONE) ||
           match->owed >= MATCH_PART) {
        int32_t before = match->owed, due = match->owed / MATCH_PART;

        if (budget->left <= 0)
            return CAIRN_MORE;
        if (due > 0) {
            due = due < budget->left ? due : budget->left;
            budget->left -= due;
            match->owed -= due * MATCH_PART;
            match->measure.units += due;
            continue;
        }
        if (match->phase == MATCH_SHAPE_ALIGN) {
            cairn_status status = cairn_match_shape_align(match, budget);

            if (status != CAIRN_OK)
                return status;
            enter(match, MATCH_SHAPE_FILTER);
            continue;
        }
        run_item(match);
        due = (match->owed - before) / MATCH_PART;
        if (due > match->measure.worst_step)
            match->measure.worst_step = due;
    }
    return CAIRN_OK;
}
