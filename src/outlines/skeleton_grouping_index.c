/* Index of the edgels: sorted by the cells of a grid; those of a cell in the order of the input. */
#include "src/base/build.h"

#include "src/containers/counting_sort.h"
#include "src/outlines/skeleton_grouping_work.h"

static int32_t clamp_cell(cairn_real x, int32_t count)
{
    int32_t cell = cairn_real_to_int(cairn_floor(x / SKELETON_GROUPING_CELL_PX));

    return cell < 0 ? 0 : cell >= count ? count - 1 : cell;
}

int32_t cairn_skeleton_grouping_column(const cairn_skeleton_grouping *skeleton, cairn_real x)
{
    return clamp_cell(x, skeleton->columns);
}

int32_t cairn_skeleton_grouping_row(const cairn_skeleton_grouping *skeleton, cairn_real y)
{
    return clamp_cell(y, skeleton->rows);
}

skeleton_grouping_cells cairn_skeleton_grouping_cells(const cairn_skeleton_grouping *skeleton,
                                                      cairn_box box)
{
    skeleton_grouping_cells cells = {.x0 = cairn_skeleton_grouping_column(skeleton, box.min.x),
                                     .x1 = cairn_skeleton_grouping_column(skeleton, box.max.x),
                                     .y0 = cairn_skeleton_grouping_row(skeleton, box.min.y),
                                     .y1 = cairn_skeleton_grouping_row(skeleton, box.max.y)};

    return cells;
}

static int32_t cell_of(const cairn_skeleton_grouping *skeleton, cairn_vec2 p)
{
    return cairn_skeleton_grouping_row(skeleton, p.y) * skeleton->columns +
           cairn_skeleton_grouping_column(skeleton, p.x);
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
    counting_sort_count(skeleton->cell_first, cell_of(skeleton, edgel->position));
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
    skeleton_grouping_edgel *e =
        &skeleton
             ->edgels[counting_sort_place(skeleton->cell_first, cell_of(skeleton, from->position))];

    e->position = from->position;
    e->normal = from->normal;
    e->log_slope_ratio = from->gradient_magnitude > 0
                             ? cairn_log(from->gradient_magnitude) - skeleton->mean_log_slope
                             : 0;
    e->input_index = source;
    e->assigned = 0;
}

static int32_t cell_count(const cairn_skeleton_grouping *skeleton)
{
    return skeleton->columns * skeleton->rows;
}

int cairn_skeleton_grouping_index(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(skeleton->phase_resume);
    for (skeleton->cell = 0; skeleton->cell < cell_count(skeleton); skeleton->cell++) {
        CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, 1);
        counting_sort_reset(skeleton->cell_first, skeleton->cell, skeleton->cell + 2);
    }
    for (skeleton->edgel = 0; skeleton->edgel < skeleton->edgel_count; skeleton->edgel++) {
        CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, 1);
        skeleton->status = count_edgel(skeleton, &skeleton->input.edgels[skeleton->edgel]);
        CAIRN_STEP_UNTIL(skeleton->phase_resume, skeleton->status == CAIRN_OK);
    }
    for (skeleton->cell = 0; skeleton->cell < cell_count(skeleton); skeleton->cell++) {
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
    int32_t x = cairn_skeleton_grouping_column(skeleton, at.x),
            y = cairn_skeleton_grouping_row(skeleton, at.y), count = PRIOR_COUNT, area = 0;
    int32_t x0 = x > HALF_WINDOW_CELLS ? x - HALF_WINDOW_CELLS : 0,
            x1 = x + HALF_WINDOW_CELLS < skeleton->columns ? x + HALF_WINDOW_CELLS
                                                           : skeleton->columns - 1;

    for (int32_t row = y > HALF_WINDOW_CELLS ? y - HALF_WINDOW_CELLS : 0;
         row <= y + HALF_WINDOW_CELLS && row < skeleton->rows; row++) {
        int32_t from, end;

        skeleton_grouping_cells_of_row(skeleton, row, x0, x1, &from, &end);
        count += end - from;
        area += (x1 - x0 + 1) * SKELETON_GROUPING_CELL_PX * SKELETON_GROUPING_CELL_PX;
    }
    return (cairn_real)count / (cairn_real)area;
}
