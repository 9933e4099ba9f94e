/* Images embedded in a map picture: density images of the walls, and grids, as PNG in base 64. */
#include "src/base/build.h"

#include <stdlib.h>

#include "src/host/files/map_file_image.h"
#include "src/host/pictures/report_picture.h"
#include "src/host/pictures/report_text.h"

#define SAMPLES_PER_PIXEL 2
#define MAX_GRID_SIDE     2048
/* Grey levels of no points and of full density. */
#define PAPER_LEVEL 255.0
#define INK_LEVEL   30.0

/* Embeds an image under the affine transform (x, y) -> (m0 x + m2 y + m4, m1 x + m3 y + m5). crisp:
 * 1: no smoothing of enlarged samples. */
static cairn_status print_image(cairn_output *output, const uint8_t *pixel, int32_t width,
                                int32_t height, const double matrix[6], int crisp)
{
    uint8_t *bytes;
    size_t count;
    cairn_status status = cairn_image_encode_png(&bytes, &count, pixel, width, height, 1);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(
        output,
        "<image width=\"%d\" height=\"%d\" transform=\"matrix(%.6g %.6g %.6g %.6g %.2f %.2f)\"",
        (int)width, (int)height, matrix[0], matrix[1], matrix[2], matrix[3], matrix[4], matrix[5]);
    cairn_output_print(output, "%s href=\"data:image/png;base64,",
                       crisp ? " style=\"image-rendering:pixelated\"" : "");
    cairn_report_print_base64(output, bytes, count);
    cairn_output_print(output, "\"/>\n");
    free(bytes);
    return CAIRN_OK;
}

/* A 2D histogram of points over a panel's frame, row 0 topmost. */
typedef struct histogram {
    uint32_t *count; /* [height * width] */
    int32_t width, height;
    const cairn_report_view *view;
} histogram;

/* Counts a point. */
static void add_point(histogram *density, cairn_vec2 point)
{
    double x = (cairn_report_view_x(density->view, (double)point.x) - density->view->frame_left) *
               SAMPLES_PER_PIXEL;
    double y = (cairn_report_view_y(density->view, (double)point.y) - density->view->frame_top) *
               SAMPLES_PER_PIXEL;

    if (x >= 0 && y >= 0 && x < density->width && y < density->height)
        density->count[(size_t)y * (size_t)density->width + (size_t)x]++;
}

/* Counts points along a segment, one a sample; at most enough to cross the frame twice. */
static void add_segment(histogram *density, cairn_vec2 a, cairn_vec2 b)
{
    double length =
        (double)cairn_vec2_norm(cairn_vec2_sub(b, a)) * density->view->scale * SAMPLES_PER_PIXEL;
    int32_t max_steps = 4 * (density->width + density->height),
            steps = length < max_steps ? (int32_t)length + 1 : max_steps, i;

    for (i = 0; i <= steps; i++)
        add_point(density, cairn_vec2_interpolate(a, b, (cairn_real)i / (cairn_real)steps));
}

/* Counts all walls of a panel. */
static void count_walls(histogram *density, const cairn_report_map *map, const cairn_pose *pose)
{
    int32_t i, k;

    for (i = 0; i < map->scan_count; i++) {
        const cairn_report_scan *scan = &map->scan[i];
        cairn_transform t = cairn_transform_of(pose[i]);

        for (k = 0; k < scan->segment_count; k++)
            add_segment(density, cairn_transform_point(t, scan->segment[k].a),
                        cairn_transform_point(t, scan->segment[k].b));
        for (k = 0; k < scan->point_count && scan->segment_count == 0; k++)
            add_point(density, cairn_transform_point(t, scan->point[k]));
    }
}

/* Returns the 90 % quantile of the counts that are not 0, at most 255: full density from there
 * on. */
static double full_count(const histogram *density)
{
    size_t samples = (size_t)density->width * (size_t)density->height, non_empty = 0, sum = 0, i;
    size_t bin[256] = {0}, k = 0;

    for (i = 0; i < samples; i++) {
        non_empty += density->count[i] > 0;
        bin[density->count[i] < 255 ? density->count[i] : 255]++;
    }
    while (k < 255 && sum * 10 < non_empty * 9)
        sum += bin[++k];
    return (double)(k > 0 ? k : 1);
}

cairn_status cairn_report_draw_density(cairn_output *output, const cairn_report_view *view,
                                       const cairn_report_map *map, const cairn_pose *pose)
{
    histogram density = {.width = (int32_t)(view->width * SAMPLES_PER_PIXEL),
                         .height = (int32_t)(view->height * SAMPLES_PER_PIXEL),
                         .view = view};
    double matrix[6] = {1.0 / SAMPLES_PER_PIXEL, 0, 0, 1.0 / SAMPLES_PER_PIXEL, view->frame_left,
                        view->frame_top};
    size_t samples = (size_t)density.width * (size_t)density.height, i;
    uint8_t *pixel = malloc(samples);
    cairn_status status = CAIRN_NO_MEMORY;
    double full;

    density.count = calloc(samples, sizeof *density.count);
    if (density.count != NULL && pixel != NULL) {
        count_walls(&density, map, pose);
        full = log1p(full_count(&density));
        for (i = 0; i < samples; i++) {
            double ink = log1p((double)density.count[i]) / full;

            pixel[i] = (uint8_t)(PAPER_LEVEL - (PAPER_LEVEL - INK_LEVEL) * (ink < 1 ? ink : 1));
        }
        status = print_image(output, pixel, density.width, density.height, matrix, 0);
    }
    free(density.count);
    free(pixel);
    return status;
}

cairn_status cairn_report_coarsen_grid(const cairn_report_grid *grid, cairn_report_grid *coarse,
                                       uint8_t **pixel)
{
    int32_t side = grid->width > grid->height ? grid->width : grid->height;
    int32_t step = (side + MAX_GRID_SIDE - 1) / MAX_GRID_SIDE;
    int32_t width = (grid->width + step - 1) / step, height = (grid->height + step - 1) / step, x,
            y;

    *coarse = *grid;
    coarse->width = width;
    coarse->height = height;
    coarse->resolution = grid->resolution * (cairn_real)step;
    coarse->pixel = *pixel = malloc((size_t)width * (size_t)height);
    if (*pixel == NULL)
        return CAIRN_NO_MEMORY;
    for (y = 0; y < height; y++) {
        for (x = 0; x < width; x++) {
            uint8_t darkest = 255;
            int32_t i, j;

            for (j = y * step; j < (y + 1) * step && j < grid->height; j++)
                for (i = x * step; i < (x + 1) * step && i < grid->width; i++)
                    if (grid->pixel[(size_t)j * (size_t)grid->width + (size_t)i] < darkest)
                        darkest = grid->pixel[(size_t)j * (size_t)grid->width + (size_t)i];
            (*pixel)[(size_t)(height - 1 - y) * (size_t)width + (size_t)x] = darkest;
        }
    }
    return CAIRN_OK;
}

cairn_status cairn_report_draw_grid(cairn_output *output, const cairn_report_view *view,
                                    const cairn_report_grid *grid)
{
    cairn_transform t = cairn_transform_of(grid->origin);
    cairn_report_grid coarse;
    uint8_t *pixel;
    double matrix[6], pixels_per_cell;
    cairn_vec2 corner = {0, 0};
    cairn_status status = cairn_report_coarsen_grid(grid, &coarse, &pixel);

    if (status != CAIRN_OK)
        return status;
    pixels_per_cell = view->scale * (double)coarse.resolution;
    corner.y = coarse.resolution * (cairn_real)coarse.height;
    corner = cairn_transform_point(t, corner);
    matrix[0] = pixels_per_cell * (double)t.cosine;
    matrix[1] = 0 - pixels_per_cell * (double)t.sine;
    matrix[2] = pixels_per_cell * (double)t.sine;
    matrix[3] = pixels_per_cell * (double)t.cosine;
    matrix[4] = cairn_report_view_x(view, (double)corner.x);
    matrix[5] = cairn_report_view_y(view, (double)corner.y);
    status = print_image(output, pixel, coarse.width, coarse.height, matrix, pixels_per_cell > 1);
    free(pixel);
    return status;
}
