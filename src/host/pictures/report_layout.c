/* Layout of map pictures.
 *
 * Method
 * 1. The box of a panel contains its walls, poses and grid.
 * 2. All panels share one scale: the largest at which every box fits its frame.
 * 3. Frames are as high as the highest box needs, within limits. */
#include "src/base/build.h"

#include "src/host/pictures/report_layout.h"

/* px between panels. */
#define PANEL_GAP_PX     20.0
#define FRAME_PADDING_PX 18.0 /* px between a frame and its box */
#define MIN_BOX_M        1.0  /* minimum side of a box */

/* ---- Validation ---- */

static cairn_status check_scans(const char *path, const cairn_report_map *map,
                                cairn_file_error *error)
{
    int32_t i, k;

    for (i = 0; i < map->scan_count && map->scan != NULL; i++) {
        const cairn_report_scan *scan = &map->scan[i];

        if (scan->point_count < 0 || scan->segment_count < 0 ||
            (scan->point_count > 0 && scan->point == NULL) ||
            (scan->segment_count > 0 && scan->segment == NULL))
            return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0, "scan %d: bad arrays",
                                        (int)i);
        for (k = 0; k < scan->point_count; k++)
            if (!cairn_vec2_is_finite(scan->point[k]))
                return cairn_file_error_set(error, CAIRN_NOT_FINITE, path, 0,
                                            "scan %d: point %d is not finite", (int)i, (int)k);
        for (k = 0; k < scan->segment_count; k++)
            if (!cairn_vec2_is_finite(scan->segment[k].a) ||
                !cairn_vec2_is_finite(scan->segment[k].b))
                return cairn_file_error_set(error, CAIRN_NOT_FINITE, path, 0,
                                            "scan %d: segment %d is not finite", (int)i, (int)k);
    }
    return CAIRN_OK;
}

static cairn_status check_panel(const char *path, const cairn_report_map *map, int32_t index,
                                cairn_file_error *error)
{
    const cairn_report_panel *panel = &map->panel[index];
    const cairn_report_grid *grid = panel->grid;
    int32_t i;

    if (panel->pose == NULL)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0, "panel %d has no poses",
                                    (int)index);
    for (i = 0; i < map->scan_count; i++)
        if (!cairn_pose_is_finite(panel->pose[i]))
            return cairn_file_error_set(error, CAIRN_NOT_FINITE, path, 0,
                                        "panel %d: pose %d is not finite", (int)index, (int)i);
    if (grid == NULL)
        return CAIRN_OK;
    if (grid->pixel == NULL || grid->width < 1 || grid->height < 1 || !(grid->resolution > 0) ||
        !cairn_is_finite(grid->resolution))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "panel %d has a grid without cells or resolution", (int)index);
    if (!cairn_pose_is_finite(grid->origin))
        return cairn_file_error_set(error, CAIRN_NOT_FINITE, path, 0,
                                    "panel %d: the grid's origin is not finite", (int)index);
    return CAIRN_OK;
}

cairn_status cairn_report_check(const char *path, const cairn_report_map *map,
                                cairn_file_error *error)
{
    cairn_status status;
    int32_t i;

    if (map->panel == NULL || map->panel_count < 1 || map->panel_count > CAIRN_REPORT_MAX_PANELS ||
        map->scan_count < 1 || map->width < 200 || map->width > 10000 || map->max_elements < 0)
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "%d panels, %d scans, width %d: expected 1 to %d panels, 1 or more scans, a width from "
            "200 to 10000",
            (int)map->panel_count, (int)map->scan_count, (int)map->width, CAIRN_REPORT_MAX_PANELS);
    status = check_scans(path, map, error);
    for (i = 0; i < map->panel_count && status == CAIRN_OK; i++)
        status = check_panel(path, map, i, error);
    return status;
}

/* ---- Layout ---- */

int64_t cairn_report_elements(const cairn_report_map *map)
{
    int64_t sum = 0;
    int32_t i;

    for (i = 0; i < map->scan_count && map->scan != NULL; i++)
        sum +=
            map->scan[i].segment_count > 0 ? map->scan[i].segment_count : map->scan[i].point_count;
    return sum;
}

/* Returns the box extended by the walls of a scan as they are drawn: its segments, else its
 * points. */
static cairn_box extend_by_walls(cairn_box box, const cairn_report_scan *scan, cairn_pose pose)
{
    int32_t i;

    for (i = 0; i < scan->segment_count; i++) {
        box = cairn_box_extend(box, cairn_pose_point(pose, scan->segment[i].a));
        box = cairn_box_extend(box, cairn_pose_point(pose, scan->segment[i].b));
    }
    for (i = 0; i < scan->point_count && scan->segment_count == 0; i++)
        box = cairn_box_extend(box, cairn_pose_point(pose, scan->point[i]));
    return box;
}

static cairn_box box_of_panel(const cairn_report_map *map, const cairn_report_panel *panel)
{
    cairn_box box = cairn_box_empty();
    int32_t i;

    for (i = 0; i < map->scan_count; i++) {
        cairn_vec2 p = {panel->pose[i].x, panel->pose[i].y};

        box = cairn_box_extend(box, p);
        if (panel->grid == NULL && map->scan != NULL)
            box = extend_by_walls(box, &map->scan[i], panel->pose[i]);
    }
    for (i = 0; i < 4 && panel->grid != NULL; i++) {
        cairn_vec2 corner = {
            panel->grid->resolution * (cairn_real)(i % 2 == 0 ? 0 : panel->grid->width),
            panel->grid->resolution * (cairn_real)(i < 2 ? 0 : panel->grid->height)};

        box = cairn_box_extend(box, cairn_pose_point(panel->grid->origin, corner));
    }
    return box;
}

void cairn_report_compute_layout(const cairn_report_map *map, cairn_report_layout *layout)
{
    double wide = MIN_BOX_M, high = MIN_BOX_M, min_height, max_height;
    int32_t i, titles = 0;

    for (i = 0; i < map->panel_count; i++) {
        layout->box[i] = box_of_panel(map, &map->panel[i]);
        wide = fmax(wide, (double)layout->box[i].max.x - (double)layout->box[i].min.x);
        high = fmax(high, (double)layout->box[i].max.y - (double)layout->box[i].min.y);
        titles |= map->panel[i].title != NULL || map->panel[i].note != NULL;
    }
    layout->head = cairn_report_head_height(map->title, map->subtitle);
    layout->top = layout->head + (titles ? 26 : 0);
    layout->width = (map->width - 2 * CAIRN_REPORT_MARGIN - PANEL_GAP_PX * (map->panel_count - 1)) /
                    map->panel_count;
    min_height = 0.3 * layout->width;
    max_height = 1.25 * layout->width;
    layout->scale = fmin((layout->width - 2 * FRAME_PADDING_PX) / wide,
                         (max_height - 2 * FRAME_PADDING_PX) / high);
    layout->height = fmax(min_height, high * layout->scale + 2 * FRAME_PADDING_PX);
}

cairn_report_view cairn_report_view_of(const cairn_report_layout *layout, int32_t index)
{
    const cairn_box *box = &layout->box[index];
    cairn_report_view view;

    view.min_x = (double)box->min.x;
    view.min_y = (double)box->min.y;
    view.scale = layout->scale;
    view.width = layout->width;
    view.height = layout->height;
    view.frame_left = CAIRN_REPORT_MARGIN + index * (layout->width + PANEL_GAP_PX);
    view.frame_top = layout->top;
    /* The box is centred in its frame. */
    view.left =
        view.frame_left + (layout->width - (double)(box->max.x - box->min.x) * layout->scale) / 2;
    view.bottom = view.frame_top + layout->height -
                  (layout->height - (double)(box->max.y - box->min.y) * layout->scale) / 2;
    return view;
}
