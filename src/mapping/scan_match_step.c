/* The steps of a match, item by item: what comes after what. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/scan_match_shape.h"

enum { SUM_BLOCK = 64 }; /* cells of an index that are summed at once */

static const cairn_real CELL = CAIRN_REAL(1.75); /* of an index, spacings */

static void enter(cairn_scan_match *x, match_phase phase)
{
    x->phase = phase;
    x->at = 0;
}

/* The points that are sorted now: the even ones, then the dense ones. */
static match_index *index_at_work(cairn_scan_match *x, const cairn_oriented_point **points)
{
    *points = x->other == 0 ? x->target : x->dense;
    return x->other == 0 ? &x->index : &x->dense_index;
}

/* Only votes need the points by direction. */
static int32_t fills_spots(const cairn_scan_match *x)
{
    return x->other == 0 && x->shape == NULL;
}

static void reset_item(cairn_scan_match *x)
{
    cairn_match_index_reset(&x->index, x->params.max_target, x->target_count,
                            CELL * x->params.spacing);
    cairn_match_index_reset(&x->dense_index, x->params.max_dense, x->dense_count,
                            CELL * x->params.spacing);
    cairn_match_spots_reset(x);
    cairn_match_charge(
        x, (x->index.side * x->index.side + x->dense_index.side * x->dense_index.side) / 16);
    x->other = 0;
    enter(x, MATCH_COUNT);
}

static void count_item(cairn_scan_match *x)
{
    const cairn_oriented_point *points;
    match_index *index = index_at_work(x, &points);

    if (x->at < index->count) {
        cairn_match_index_count(index, points[x->at].position);
        if (fills_spots(x))
            cairn_match_spots_count(x, &points[x->at]);
        x->at++;
    }
    cairn_match_charge(x, fills_spots(x) ? 48 : 16);
    if (x->at == index->count)
        enter(x, MATCH_SUM);
}

static void sum_item(cairn_scan_match *x)
{
    const cairn_oriented_point *points;
    match_index *index = index_at_work(x, &points);
    int32_t cells = index->side * index->side + 1,
            end = x->at + SUM_BLOCK < cells ? x->at + SUM_BLOCK : cells;

    cairn_match_index_sum(index, x->at, end);
    x->at = end;
    cairn_match_charge(x, 4 * MATCH_PART);
    if (x->at < cells)
        return;
    if (fills_spots(x))
        cairn_match_spots_sum(x);
    enter(x, MATCH_PLACE);
}

/* The last point first, so that those of a cell stay in their order. */
static void place_item(cairn_scan_match *x)
{
    const cairn_oriented_point *points;
    match_index *index = index_at_work(x, &points);

    if (x->at < index->count) {
        const cairn_oriented_point *p = &points[index->count - 1 - x->at++];

        cairn_match_index_place(index, *p);
        if (fills_spots(x))
            cairn_match_spots_place(x, p);
    }
    cairn_match_charge(x, fills_spots(x) ? 48 : 16);
    if (x->at < index->count)
        return;
    enter(x, MATCH_COUNT);
    if (x->other++ == 0)
        return;
    x->is_indexed = 1;
    enter(x, x->shape != NULL ? MATCH_SHAPE_TARGET : MATCH_VOTE);
}

/* What follows when the target is known: without rotations only ICP is left. */
static match_phase first_of_shape(const cairn_scan_match *x)
{
    return x->shape->rotations > 0 ? MATCH_SHAPE_TURN : MATCH_SHAPE_ICP;
}

void cairn_match_start(cairn_scan_match *x)
{
    if (x->shape != NULL)
        cairn_match_shape_begin(x);
    else
        cairn_match_votes_begin(x);
    enter(x, x->shape != NULL ? MATCH_SHAPE_TURN : MATCH_VOTE);
    if (!x->is_indexed)
        enter(x, MATCH_RESET);
}

void cairn_match_start_icp(cairn_scan_match *x, cairn_pose start)
{
    cairn_match_written_icp_at(x, start);
    enter(x, x->is_indexed ? MATCH_SHAPE_ICP : MATCH_RESET);
}

/* Of the candidates those that stand for a peak become the hypotheses that are refined. */
static void choose_item(cairn_scan_match *x)
{
    if (!cairn_match_choose(x))
        return;
    x->stage = x->other = 0;
    x->phase = MATCH_RANK;
    if (x->hypothesis_count == 0)
        return;
    x->phase = MATCH_FIT;
    cairn_match_fit_begin(x, x->hypotheses[0].target_query);
}

static void peaks_item(cairn_scan_match *x)
{
    if (!cairn_match_peaks(x))
        return;
    enter(x, MATCH_VOTE);
    if (x->votes.rotation < x->votes.rotations)
        return;
    cairn_match_sort(x);
    cairn_match_charge(x, x->candidate_count * 8);
    x->hypothesis_count = 0;
    enter(x, MATCH_CHOOSE);
}

static void tally_item(cairn_scan_match *x)
{
    if (!cairn_match_tally_item(x))
        return;
    x->other++;
    x->measure.fits++;
    x->phase = MATCH_RANK;
    if (x->other == x->hypothesis_count)
        return;
    x->phase = MATCH_FIT;
    cairn_match_fit_begin(x, x->hypotheses[x->other].target_query);
}

/* The best go on to the next stage. */
static void rank_item(cairn_scan_match *x)
{
    int32_t most = x->params.max_hypotheses, keep = cairn_match_stage_of(x)->keep;

    cairn_match_charge(x, (8 + x->hypothesis_count / 2) * x->hypothesis_count);
    if (keep == 0)
        keep = most;
    else if (keep < 2 * most)
        keep = 2 * most;
    cairn_match_thin(x, keep);
    x->other = 0;
    x->stage++;
    if (x->hypothesis_count == 0 || x->stage >= MATCH_STAGES) {
        cairn_match_judge(x);
        x->phase = MATCH_DONE;
        return;
    }
    x->phase = MATCH_FIT;
    cairn_match_fit_begin(x, x->hypotheses[0].target_query);
}

static void run_correlative(cairn_scan_match *x)
{
    switch (x->phase) {
    case MATCH_RESET:
        reset_item(x);
        break;
    case MATCH_COUNT:
        count_item(x);
        break;
    case MATCH_SUM:
        sum_item(x);
        break;
    case MATCH_PLACE:
        place_item(x);
        break;
    case MATCH_VOTE:
        if (cairn_match_vote(x))
            enter(x, MATCH_PEAKS);
        break;
    case MATCH_PEAKS:
        peaks_item(x);
        break;
    case MATCH_CHOOSE:
        choose_item(x);
        break;
    case MATCH_FIT:
        if (cairn_match_fit_item(x)) {
            x->phase = MATCH_TALLY;
            cairn_match_tally_begin(x);
        }
        break;
    case MATCH_TALLY:
        tally_item(x);
        break;
    default:
        rank_item(x);
        break;
    }
}

/* The best rotation becomes the one hypothesis, of which only the covariance is still to be
 * found. */
static void start_last_stage(cairn_scan_match *x)
{
    x->hypothesis_count = x->shape->best_overlap > 0;
    x->hypotheses[0].target_query = x->shape->best;
    x->stage = MATCH_STAGES;
    x->other = 0;
    x->phase = MATCH_RANK;
    if (x->hypothesis_count == 0)
        return;
    x->phase = MATCH_FIT;
    cairn_match_fit_begin(x, x->shape->best);
}

/* All rotations are through, and the pairs are those of the best one. */
static void end_shape(cairn_scan_match *x)
{
    if (!cairn_match_has_icp(x) || x->shape->best_overlap <= 0) {
        start_last_stage(x);
        return;
    }
    cairn_match_shape_icp_begin(x);
    enter(x, MATCH_SHAPE_ICP);
}

static void end_rotation(cairn_scan_match *x)
{
    int32_t is_there = x->shape->with_lines;

    if (cairn_match_shape_is_turned(x)) {
        if (x->shape->best_overlap <= 0) {
            end_shape(x);
            return;
        }
        is_there = cairn_match_shape_again(x);
    }
    enter(x, is_there ? MATCH_SHAPE_FILTER : MATCH_SHAPE_TURN);
}

static void run_shape(cairn_scan_match *x)
{
    switch (x->phase) {
    case MATCH_SHAPE_TARGET:
        if (cairn_match_shape_target(x))
            enter(x, first_of_shape(x));
        break;
    case MATCH_SHAPE_TURN:
        if (cairn_match_shape_turn(x))
            enter(x, MATCH_SHAPE_ALIGN);
        break;
    case MATCH_SHAPE_FILTER:
        if (cairn_match_shape_filter(x))
            enter(x, MATCH_SHAPE_SEGMENT);
        break;
    case MATCH_SHAPE_SEGMENT:
        if (!cairn_match_shape_segment(x))
            break;
        if (x->shape->is_again)
            end_shape(x);
        else
            enter(x, MATCH_SHAPE_TRANSLATE);
        break;
    case MATCH_SHAPE_TRANSLATE:
        if (cairn_match_shape_translate(x))
            enter(x, MATCH_SHAPE_OVERLAP);
        break;
    case MATCH_SHAPE_OVERLAP:
        if (cairn_match_shape_overlap(x))
            end_rotation(x);
        break;
    default:
        if (cairn_match_is_as_written(x) ? cairn_match_written_icp(x) : cairn_match_shape_icp(x))
            start_last_stage(x);
        break;
    }
}

static void run_item(cairn_scan_match *x)
{
    if (x->phase >= MATCH_SHAPE_TARGET && x->phase <= MATCH_SHAPE_ICP)
        run_shape(x);
    else
        run_correlative(x);
}

cairn_status cairn_scan_match_step(cairn_scan_match *x, cairn_budget *budget)
{
    if (x == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while ((x->phase != MATCH_IDLE && x->phase != MATCH_DONE) || x->owed >= MATCH_PART) {
        int32_t before = x->owed, due = x->owed / MATCH_PART;

        if (budget->left <= 0)
            return CAIRN_MORE;
        if (due > 0) {
            due = due < budget->left ? due : budget->left;
            budget->left -= due;
            x->owed -= due * MATCH_PART;
            x->measure.units += due;
            continue;
        }
        if (x->phase == MATCH_SHAPE_ALIGN) {
            cairn_status status = cairn_match_shape_align(x, budget);

            if (status != CAIRN_OK)
                return status;
            enter(x, MATCH_SHAPE_FILTER);
            continue;
        }
        run_item(x);
        due = (x->owed - before) / MATCH_PART;
        if (due > x->measure.worst_step)
            x->measure.worst_step = due;
    }
    return CAIRN_OK;
}
