/* scan_match: the steps of a match. scan_match.c describes the method. */
#include "src/base/build.h"

#include "src/containers/counting_sort.h"
#include "src/scans/scan_match_shape.h"

enum {
    /* cells of a grid that are reset, or summed up, in one operation */
    CELLS_PER_RESET = 2048,
    CELLS_PER_SUM = 64,
    /* costs in parts of a unit: cells, ... */
    CELLS_RESET_PER_PART = 16,
    PARTS_PER_CELL_SUMMED = 1,
    DIRECTION_CELLS_SUMMED_PER_PART = 3,
    /* ... a point that is counted or placed in the grid, or by direction as well, ... */
    PARTS_PER_POINT = 16,
    PARTS_PER_POINT_BY_DIRECTION = 48,
    /* ... the log odds of a hypothesis, and its comparison with another one */
    PARTS_PER_DECISION = 40,
    PARTS_PER_COMPARISON = 4
};

static const cairn_real INDEX_CELL_SPACINGS =
    CAIRN_REAL(1.75); /* cell side of a grid, in spacings */

/* ---- The target ---- */

static scan_match_index *sorted_index(cairn_scan_match *match)
{
    return match->sorting.is_dense ? &match->dense_index : &match->index;
}

static void open_index(cairn_scan_match *match)
{
    int is_dense = match->sorting.is_dense;

    cairn_scan_match_index_open(sorted_index(match),
                                is_dense ? match->params.max_dense : match->params.max_target,
                                is_dense ? match->dense_count : match->target_count,
                                INDEX_CELL_SPACINGS * match->params.spacing);
}

/* Returns the cells of the grid from the current one on, at most `most`. */
static int32_t cells_of_block(cairn_scan_match *match, int32_t most)
{
    const scan_match_index *index = sorted_index(match);
    int32_t left = index->side * index->side + 1 - match->sorting.cell;

    return left < most ? left : most;
}

/* Sorts points of the target into their grid, and the evenly spaced ones by direction, too, which
 * only voting needs. The last point is placed first, so that the sort is stable. */
static int sort_points(cairn_scan_match *match, cairn_budget *budget)
{
    scan_match_sorting *sorting = &match->sorting;
    scan_match_index *index = sorted_index(match);
    const cairn_oriented_point *points = sorting->is_dense ? match->dense : match->target;
    int by_direction = !sorting->is_dense && match->shape == NULL;
    int32_t parts = by_direction ? PARTS_PER_POINT_BY_DIRECTION : PARTS_PER_POINT;

    CAIRN_STEP_BEGIN(match->resume.part);
    open_index(match);
    for (sorting->cell = 0; sorting->cell <= index->side * index->side;
         sorting->cell += CELLS_PER_RESET) {
        SCAN_MATCH_CHARGE(part, cells_of_block(match, CELLS_PER_RESET) / CELLS_RESET_PER_PART);
        counting_sort_reset(index->start, sorting->cell,
                            sorting->cell + cells_of_block(match, CELLS_PER_RESET));
    }
    if (by_direction) {
        SCAN_MATCH_CHARGE(part, SCAN_MATCH_DIRECTION_CELLS / CELLS_RESET_PER_PART);
        cairn_scan_match_positions_reset(match);
    }
    for (sorting->point = 0; sorting->point < index->count; sorting->point++) {
        SCAN_MATCH_CHARGE(part, parts);
        cairn_scan_match_index_count(index, points[sorting->point].position);
        if (by_direction)
            cairn_scan_match_positions_count(match, &points[sorting->point]);
    }
    for (sorting->cell = 0; sorting->cell <= index->side * index->side;
         sorting->cell += CELLS_PER_SUM) {
        SCAN_MATCH_CHARGE(part, PARTS_PER_CELL_SUMMED * cells_of_block(match, CELLS_PER_SUM));
        counting_sort_sum(index->start, sorting->cell,
                          sorting->cell + cells_of_block(match, CELLS_PER_SUM));
    }
    if (by_direction) {
        SCAN_MATCH_CHARGE(part, SCAN_MATCH_DIRECTION_CELLS / DIRECTION_CELLS_SUMMED_PER_PART);
        cairn_scan_match_positions_sum(match);
    }
    for (sorting->point = index->count - 1; sorting->point >= 0; sorting->point--) {
        SCAN_MATCH_CHARGE(part, parts);
        cairn_scan_match_index_place(index, points[sorting->point]);
        if (by_direction)
            cairn_scan_match_positions_place(match, &points[sorting->point]);
    }
    CAIRN_STEP_END(match->resume.part);
}

/* Phase: the grids of the target. */
static int sort_target(cairn_scan_match *match, cairn_budget *budget)
{
    scan_match_sorting *sorting = &match->sorting;

    CAIRN_STEP_BEGIN(match->resume.phase);
    for (sorting->is_dense = 0; sorting->is_dense < 2; sorting->is_dense++)
        CAIRN_STEP_RUN(match, resume.phase, budget, sort_points);
    CAIRN_STEP_END(match->resume.phase);
}

/* ---- The match ---- */

/* The pose by shape becomes the one hypothesis, of which only covariance and score are computed. */
static void take_shape_pose(cairn_scan_match *match)
{
    match->hypothesis_count = match->shape->best_overlap > 0;
    match->hypotheses[0].target_query = match->shape->best;
    match->stage = SCAN_MATCH_STAGES;
}

/* Returns 1 when the pose by shape is refined by the ICP of the mode. */
static int uses_icp(const cairn_scan_match *match)
{
    return cairn_scan_match_has_icp(match) && match->shape->best_overlap > 0;
}

/* Phase: that ICP. */
static int refine_shape_pose(cairn_scan_match *match, cairn_budget *budget)
{
    return cairn_scan_match_is_as_written(match) ? cairn_scan_match_written_icp(match, budget)
                                                 : cairn_scan_match_shape_icp(match, budget);
}

static int match_all(cairn_scan_match *match, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(match->resume.run);
    if (!match->is_indexed) {
        CAIRN_STEP_RUN(match, resume.run, budget, sort_target);
        if (match->shape != NULL)
            CAIRN_STEP_RUN(match, resume.run, budget, cairn_scan_match_shape_describe_target);
        match->is_indexed = 1;
    }
    if (match->shape == NULL) {
        CAIRN_STEP_RUN(match, resume.run, budget, cairn_scan_match_vote);
        CAIRN_STEP_RUN(match, resume.run, budget, cairn_scan_match_suppress);
        for (match->stage = 0; match->stage < SCAN_MATCH_STAGES; match->stage++)
            CAIRN_STEP_RUN(match, resume.run, budget, cairn_scan_match_refine);
    } else {
        if (match->shape->rotations > 0)
            CAIRN_STEP_RUN(match, resume.run, budget, cairn_scan_match_shape_search);
        if (uses_icp(match))
            CAIRN_STEP_RUN(match, resume.run, budget, refine_shape_pose);
        take_shape_pose(match);
        CAIRN_STEP_RUN(match, resume.run, budget, cairn_scan_match_refine);
    }
    SCAN_MATCH_CHARGE(run,
                      match->hypothesis_count *
                          (PARTS_PER_DECISION + PARTS_PER_COMPARISON * match->hypothesis_count));
    cairn_scan_match_decide(match);
    CAIRN_STEP_END(match->resume.run);
}

cairn_status cairn_scan_match_step(cairn_scan_match *match, cairn_budget *budget)
{
    int32_t before;
    int ended;

    if (match == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (match->state != SCAN_MATCH_RUNNING)
        return CAIRN_OK;
    before = budget->left;
    ended = match_all(match, budget);
    match->measure.units += before - budget->left;
    if (!ended)
        return CAIRN_MORE;
    match->state = SCAN_MATCH_DONE;
    return CAIRN_OK;
}
