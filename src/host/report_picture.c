/* Images within a map picture: counts of points per sample as grey levels, and grids; both as
 * PNG in base 64. */
#include "src/core/build.h"

#include <stdlib.h>

#include "src/host/map_file_image.h"
#include "src/host/report_picture.h"
#include "src/host/report_text.h"

#define SAMPLES_PER_PIXEL 2
#define GRID_SIDE_MOST    2048
#define PAPER             255.0
#define INK               30.0

/* An image under the transform (x, y) -> (m0 x + m2 y + m4, m1 x + m3 y + m5). `crisp`: samples
 * keep their edges when they are enlarged. */
static cairn_status print_image(cairn_output *output, const uint8_t *pixel, int32_t width,
                                int32_t height, const double m[6], int crisp)
{
    uint8_t *bytes;
    size_t count;
    cairn_status status = cairn_image_encode_png(&bytes, &count, pixel, width, height, 1);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(
        output,
        "<image width=\"%d\" height=\"%d\" transform=\"matrix(%.6g %.6g %.6g %.6g %.2f %.2f)\"",
        (int)width, (int)height, m[0], m[1], m[2], m[3], m[4], m[5]);
    cairn_output_print(output, "%s href=\"data:image/png;base64,",
                       crisp ? " style=\"image-rendering:pixelated\"" : "");
    cairn_report_print_base64(output, bytes, count);
    cairn_output_print(output, "\"/>\n");
    free(bytes);
    return CAIRN_OK;
}

/* Samples of a frame, row 0 topmost, with the number of points in each. */
typedef struct density {
    uint32_t *count; /* [height * width] */
    int32_t width, height;
    const cairn_report_view *view;
} density;

static void add_point(density *d, cairn_vec2 p)
{
    double x =
        (cairn_report_view_x(d->view, (double)p.x) - d->view->frame_left) * SAMPLES_PER_PIXEL;
    double y = (cairn_report_view_y(d->view, (double)p.y) - d->view->frame_top) * SAMPLES_PER_PIXEL;

    if (x >= 0 && y >= 0 && x < d->width && y < d->height)
        d->count[(size_t)y * (size_t)d->width + (size_t)x]++;
}

/* One point a sample along the segment; of a very long one only as many as cross the frame twice
 * over. */
static void add_segment(density *d, cairn_vec2 a, cairn_vec2 b)
{
    double length =
        (double)cairn_vec2_norm(cairn_vec2_sub(b, a)) * d->view->scale * SAMPLES_PER_PIXEL;
    int32_t most = 4 * (d->width + d->height), steps = length < most ? (int32_t)length + 1 : most,
            i;

    for (i = 0; i <= steps; i++)
        add_point(d, cairn_vec2_add(a, cairn_vec2_scale(cairn_vec2_sub(b, a),
                                                        (cairn_real)i / (cairn_real)steps)));
}

static void count_walls(density *d, const cairn_report_map *map, const cairn_pose *pose)
{
    int32_t i, k;

    for (i = 0; i < map->scan_count; i++) {
        const cairn_report_scan *scan = &map->scan[i];
        cairn_transform t = cairn_transform_of(pose[i]);

        for (k = 0; k < scan->segment_count; k++)
            add_segment(d, cairn_transform_point(t, scan->segment[k].a),
                        cairn_transform_point(t, scan->segment[k].b));
        for (k = 0; k < scan->point_count && scan->segment_count == 0; k++)
            add_point(d, cairn_transform_point(t, scan->point[k]));
    }
}

/* The count that 9 in 10 of the samples with any do not exceed: full ink from there on. */
static double full_count(const density *d)
{
    size_t samples = (size_t)d->width * (size_t)d->height, any = 0, sum = 0, i;
    size_t bin[256] = {0}, k = 0;

    for (i = 0; i < samples; i++) {
        any += d->count[i] > 0;
        bin[d->count[i] < 255 ? d->count[i] : 255]++;
    }
    while (k < 255 && sum * 10 < any * 9)
        sum += bin[++k];
    return (double)(k > 0 ? k : 1);
}

cairn_status cairn_report_draw_density(cairn_output *output, const cairn_report_view *view,
                                       const cairn_report_map *map, const cairn_pose *pose)
{
    density d = {NULL, (int32_t)(view->width * SAMPLES_PER_PIXEL),
                 (int32_t)(view->height * SAMPLES_PER_PIXEL), view};
    double m[6] = {1.0 / SAMPLES_PER_PIXEL, 0, 0, 1.0 / SAMPLES_PER_PIXEL, view->frame_left,
                   view->frame_top};
    size_t samples = (size_t)d.width * (size_t)d.height, i;
    uint8_t *pixel = malloc(samples);
    cairn_status status = CAIRN_NO_MEMORY;
    double full;

    d.count = calloc(samples, sizeof *d.count);
    if (d.count != NULL && pixel != NULL) {
        count_walls(&d, map, pose);
        full = log1p(full_count(&d));
        for (i = 0; i < samples; i++) {
            double ink = log1p((double)d.count[i]) / full;

            pixel[i] = (uint8_t)(PAPER - (PAPER - INK) * (ink < 1 ? ink : 1));
        }
        status = print_image(output, pixel, d.width, d.height, m, 0);
    }
    free(d.count);
    free(pixel);
    return status;
}

cairn_status cairn_report_coarsen_grid(const cairn_report_grid *grid, cairn_report_grid *coarse,
                                       uint8_t **pixel)
{
    int32_t side = grid->width > grid->height ? grid->width : grid->height;
    int32_t step = (side + GRID_SIDE_MOST - 1) / GRID_SIDE_MOST;
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
    double m[6], k;
    cairn_vec2 corner = {0, 0};
    cairn_status status = cairn_report_coarsen_grid(grid, &coarse, &pixel);

    if (status != CAIRN_OK)
        return status;
    k = view->scale * (double)coarse.resolution;
    corner.y = coarse.resolution * (cairn_real)coarse.height;
    corner = cairn_transform_point(t, corner);
    m[0] = k * (double)t.cosine;
    m[1] = 0 - k * (double)t.sine;
    m[2] = k * (double)t.sine;
    m[3] = k * (double)t.cosine;
    m[4] = cairn_report_view_x(view, (double)corner.x);
    m[5] = cairn_report_view_y(view, (double)corner.y);
    status = print_image(output, pixel, coarse.width, coarse.height, m, k > 1);
    free(pixel);
    return status;
}
