/* Index of the edgels: sorted by the cells of a grid; those of a cell in the order of the input. */
#include "src/base/build.h"

#include "src/containers/counting_sort.h"
#include "src/outlines/skeleton_grouping_work.h"

cell_range cairn_skeleton_grouping_cells(const cairn_skeleton_grouping *skeleton, cairn_box box)
{
    return cell_grid_range(&skeleton->grid, SKELETON_GROUPING_CELL_PX, box);
}

cell_range cairn_skeleton_grouping_cells_near(const cairn_skeleton_grouping *skeleton,
                                              cairn_vec2 place, cairn_real reach)
{
    return cell_grid_range(&skeleton->grid, SKELETON_GROUPING_CELL_PX,
                           cairn_box_grow((cairn_box){place, place}, reach));
}

static int is_finite_edgel(const cairn_edgel *edgel)
{
    return cairn_vec2_is_finite(edgel->position) && cairn_vec2_is_finite(edgel->normal) &&
           cairn_is_finite(edgel->gradient_magnitude);
}

/* Counts an edgel in its cell and updates the mean logarithmic slope. */
static cairn_status count_edgel(cairn_skeleton_grouping *skeleton, const cairn_edgel *edgel)
{
    if (!is_finite_edgel(edgel))
        return CAIRN_NOT_FINITE;
    counting_sort_count(
        skeleton->cell_first,
        cell_grid_cell(&skeleton->grid, SKELETON_GROUPING_CELL_PX, edgel->position));
    if (edgel->gradient_magnitude > 0)
        skeleton->mean_log_slope +=
            (cairn_log(edgel->gradient_magnitude) - skeleton->mean_log_slope) /
            (cairn_real)++skeleton->slope_count;
    return CAIRN_OK;
}

/* Stores an input edgel in its cell. */
static void store_edgel(cairn_skeleton_grouping *skeleton, int32_t source)
{
    const cairn_edgel *from = &skeleton->input.edgels[source];
    int32_t cell = cell_grid_cell(&skeleton->grid, SKELETON_GROUPING_CELL_PX, from->position);
    skeleton_grouping_edgel *e = &skeleton->edgels[counting_sort_place(skeleton->cell_first, cell)];

    e->position = from->position;
    e->normal = from->normal;
    e->log_slope_ratio = from->gradient_magnitude > 0
                             ? cairn_log(from->gradient_magnitude) - skeleton->mean_log_slope
                             : 0;
    e->input_index = source;
    e->assigned = 0;
}

int cairn_skeleton_grouping_index(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(skeleton->phase_resume);
    for (skeleton->cell = 0; skeleton->cell < cell_grid_count(&skeleton->grid); skeleton->cell++) {
        CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, 1);
        counting_sort_reset(skeleton->cell_first, skeleton->cell, skeleton->cell + 2);
    }
    for (skeleton->edgel = 0; skeleton->edgel < skeleton->edgel_count; skeleton->edgel++) {
        CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, 1);
        skeleton->status = count_edgel(skeleton, &skeleton->input.edgels[skeleton->edgel]);
        CAIRN_STEP_UNTIL(skeleton->phase_resume, skeleton->status == CAIRN_OK);
    }
    for (skeleton->cell = 0; skeleton->cell < cell_grid_count(&skeleton->grid); skeleton->cell++) {
        CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, 1);
        counting_sort_sum(skeleton->cell_first, skeleton->cell + 1, skeleton->cell + 2);
    }
    for (skeleton->edgel = skeleton->edgel_count - 1; skeleton->edgel >= 0; skeleton->edgel--) {
        CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, 1);
        store_edgel(skeleton, skeleton->edgel);
    }
    CAIRN_STEP_END(skeleton->phase_resume);
}

cairn_real cairn_skeleton_grouping_density(const cairn_skeleton_grouping *skeleton, cairn_vec2 at)
{
    enum { HALF_WINDOW_CELLS = 2, PRIOR_COUNT = 3 };
    cell_range cells = cairn_skeleton_grouping_cells_near(skeleton, at, 0);
    int32_t count = PRIOR_COUNT, area = 0;

    cells.x0 = cells.x0 > HALF_WINDOW_CELLS ? cells.x0 - HALF_WINDOW_CELLS : 0;
    cells.x1 = cells.x1 + HALF_WINDOW_CELLS < skeleton->grid.columns ? cells.x1 + HALF_WINDOW_CELLS
                                                                     : skeleton->grid.columns - 1;
    for (int32_t row = cells.y0 > HALF_WINDOW_CELLS ? cells.y0 - HALF_WINDOW_CELLS : 0;
         row <= cells.y1 + HALF_WINDOW_CELLS && row < skeleton->grid.rows; row++) {
        int32_t from, end;

        skeleton_grouping_cells_of_row(skeleton, cells, row, &from, &end);
        count += end - from;
        area += (cells.x1 - cells.x0 + 1) * SKELETON_GROUPING_CELL_PX * SKELETON_GROUPING_CELL_PX;
    }
    return (cairn_real)count / (cairn_real)area;
}
