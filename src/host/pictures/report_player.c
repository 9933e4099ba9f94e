/* Recording of a player: scans, frames and links.
 *
 * Method: frames are kept at a stride, which doubles whenever there are too many frames or poses.
 * The kept frames are therefore an even subset of all frames, whose number need not be known in
 * advance. The last frame is kept in addition. */
#include "src/base/build.h"

#include <stdlib.h>
#include <string.h>

#include "src/host/files/map_file_image.h"
#include "src/host/pictures/report_picture.h"
#include "src/host/pictures/report_player.h"
#include "src/host/base/heap_copy.h"
#include "src/host/base/host_parameters.h"

/* Largest accepted magnitude of a coordinate: in the units of the page it is an exact double. */
#define MAX_COORDINATE CAIRN_REAL(1e9)

static const cairn_host_parameter rows[] = {
    CAIRN_HOST_NUMBER(cairn_report_player_params, curve_count, 0, 0, CAIRN_REPORT_MAX_CURVES),
    CAIRN_HOST_NUMBER(cairn_report_player_params, connect, 0, 0, 1),
    CAIRN_HOST_NUMBER(cairn_report_player_params, max_frames, 600, 2, INT32_MAX),
    CAIRN_HOST_NUMBER(cairn_report_player_params, max_poses, 2000000, 2, INT64_MAX),
    CAIRN_HOST_NUMBER(cairn_report_player_params, max_points, 200000, 1, INT64_MAX),
    CAIRN_HOST_NUMBER(cairn_report_player_params, max_forces, 150000, 1, INT64_MAX),
    CAIRN_HOST_NUMBER(cairn_report_player_params, region_radius, 0, 0, MAX_COORDINATE),
    CAIRN_HOST_NUMBER(cairn_report_player_params, image, 0, 0, 1024),
};

const cairn_host_parameters cairn_report_player_parameters =
    CAIRN_HOST_PARAMETERS(cairn_report_player_params, rows);

cairn_report_player_params cairn_report_player_default(void)
{
    cairn_report_player_params params;

    cairn_host_parameters_preset(&cairn_report_player_parameters, &params);
    params.step_name = "step";
    return params;
}

/* ---- Memory ---- */

/* A copy of count items on the heap; sets *failed when out of memory. */
static void *copy_of(const void *items, int32_t count, size_t size, int *failed)
{
    void *copy = cairn_heap_copy(items, count, size);

    if (copy == NULL)
        *failed = 1;
    return copy;
}

static char *copy_of_text(const char *text, int *failed)
{
    return copy_of(text != NULL ? text : "", text != NULL ? (int32_t)strlen(text) + 1 : 1, 1,
                   failed);
}

/* Grows a dynamic array for one more item; 0: out of memory. */
static int grow(void **items, int32_t count, int32_t *capacity, size_t size)
{
    int32_t new_capacity = *capacity < 16 ? 16 : 2 * *capacity;
    void *grown;

    if (count < *capacity)
        return 1;
    if (*capacity > INT32_MAX / 2)
        return 0;
    grown = realloc(*items, (size_t)new_capacity * size);
    if (grown == NULL)
        return 0;
    *items = grown;
    *capacity = new_capacity;
    return 1;
}

static void free_scan(cairn_player_scan *scan)
{
    free(scan->point);
    free(scan->segment);
}

static void free_frame(cairn_player_frame *frame)
{
    free(frame->label);
    free(frame->pose);
    free(frame->low_confidence);
    free(frame->submap);
    free(frame->region);
    free(frame->force);
    free(frame->hypothesis);
}

static int copy_params(cairn_report_player *player, const cairn_report_player_params *params)
{
    int32_t i;
    int failed = 0;

    player->params = *params;
    player->params.title = copy_of_text(params->title, &failed);
    player->params.subtitle = copy_of_text(params->subtitle, &failed);
    player->params.step_name = copy_of_text(params->step_name, &failed);
    player->params.curve = player->curve;
    for (i = 0; i < params->curve_count; i++) {
        player->curve[i].name = copy_of_text(params->curve[i].name, &failed);
        player->curve[i].unit = copy_of_text(params->curve[i].unit, &failed);
        player->curve[i].note = copy_of_text(params->curve[i].note, &failed);
    }
    return !failed;
}

cairn_status cairn_report_player_open(cairn_report_player **player,
                                      const cairn_report_player_params *params)
{
    cairn_report_player *added;

    if (player == NULL ||
        cairn_host_parameters_check(&cairn_report_player_parameters, params, "", NULL) !=
            CAIRN_OK ||
        (params->curve_count > 0 && params->curve == NULL))
        return CAIRN_BAD_ARGUMENT;
    added = calloc(1, sizeof *added);
    if (added == NULL)
        return CAIRN_NO_MEMORY;
    added->stride = 1;
    if (!copy_params(added, params)) {
        cairn_report_player_free(added);
        return CAIRN_NO_MEMORY;
    }
    *player = added;
    return CAIRN_OK;
}

void cairn_report_player_free(cairn_report_player *player)
{
    int32_t i;

    if (player == NULL)
        return;
    for (i = 0; i < player->scan_count; i++)
        free_scan(&player->scan[i]);
    for (i = 0; i < player->frame_count; i++)
        free_frame(&player->frame[i]);
    for (i = 0; i < CAIRN_REPORT_MAX_CURVES; i++) {
        free((char *)player->curve[i].name);
        free((char *)player->curve[i].unit);
        free((char *)player->curve[i].note);
    }
    free((char *)player->params.title);
    free((char *)player->params.subtitle);
    free((char *)player->params.step_name);
    free(player->scan);
    free(player->frame);
    free(player->link);
    free(player->grid_png);
    free(player);
}

/* ---- Scans ---- */

static int scan_is_within(const cairn_report_scan *scan)
{
    int32_t k;

    for (k = 0; k < scan->point_count; k++)
        if (!cairn_vec2_is_within(scan->point[k], MAX_COORDINATE))
            return 0;
    for (k = 0; k < scan->segment_count; k++)
        if (!cairn_vec2_is_within(scan->segment[k].a, MAX_COORDINATE) ||
            !cairn_vec2_is_within(scan->segment[k].b, MAX_COORDINATE))
            return 0;
    return 1;
}

cairn_status cairn_report_player_add_scan(cairn_report_player *player,
                                          const cairn_report_scan *scan, int64_t index)
{
    cairn_player_scan added;
    int failed = 0;

    if (player == NULL || scan == NULL || scan->point_count < 0 || scan->segment_count < 0 ||
        (scan->point_count > 0 && scan->point == NULL) ||
        (scan->segment_count > 0 && scan->segment == NULL))
        return CAIRN_BAD_ARGUMENT;
    if (!scan_is_within(scan))
        return CAIRN_NOT_FINITE;
    added.point = copy_of(scan->point, scan->point_count, sizeof *scan->point, &failed);
    added.segment = copy_of(scan->segment, scan->segment_count, sizeof *scan->segment, &failed);
    added.point_count = scan->point_count;
    added.segment_count = scan->segment_count;
    added.index = index;
    if (failed ||
        !grow((void **)&player->scan, player->scan_count, &player->scan_capacity, sizeof added)) {
        free_scan(&added);
        return CAIRN_NO_MEMORY;
    }
    player->scan[player->scan_count++] = added;
    return CAIRN_OK;
}

/* ---- Frames ---- */

/* Validates a frame. */
static cairn_status check_frame(const cairn_report_player *player, const cairn_report_frame *frame)
{
    int32_t i;

    if (frame->pose_count < 0 || frame->pose_count > player->scan_count ||
        frame->region_count < 0 || frame->force_count < 0 || frame->hypothesis_count < 0 ||
        (frame->pose_count > 0 && frame->pose == NULL) ||
        (frame->region_count > 0 && frame->region == NULL) ||
        (frame->force_count > 0 && frame->force == NULL) ||
        (frame->hypothesis_count > 0 && frame->hypothesis == NULL) ||
        (player->frame_count > 0 && frame->step <= player->frame[player->frame_count - 1].step))
        return CAIRN_BAD_ARGUMENT;
    for (i = 0; i < frame->pose_count; i++) {
        cairn_vec2 position = {frame->pose[i].x, frame->pose[i].y};

        if (!cairn_vec2_is_within(position, MAX_COORDINATE) ||
            !(cairn_abs(frame->pose[i].theta) <= MAX_COORDINATE))
            return CAIRN_NOT_FINITE;
        if (frame->submap != NULL &&
            (frame->submap[i] < -1 || frame->submap[i] >= player->scan_count))
            return CAIRN_BAD_ARGUMENT;
    }
    for (i = 0; i < frame->region_count; i++)
        if (!cairn_vec2_is_within(frame->region[i], MAX_COORDINATE))
            return CAIRN_NOT_FINITE;
    for (i = 0; i < frame->force_count; i++)
        if (!cairn_vec2_is_within(frame->force[i].at, MAX_COORDINATE) ||
            !cairn_vec2_is_within(frame->force[i].force, MAX_COORDINATE))
            return CAIRN_NOT_FINITE;
    for (i = 0; i < frame->hypothesis_count; i++) {
        if (!cairn_vec2_is_within(frame->hypothesis[i].segment.a, MAX_COORDINATE) ||
            !cairn_vec2_is_within(frame->hypothesis[i].segment.b, MAX_COORDINATE))
            return CAIRN_NOT_FINITE;
        if (!(frame->hypothesis[i].strength >= 0 && frame->hypothesis[i].strength <= 1))
            return CAIRN_BAD_ARGUMENT;
    }
    return CAIRN_OK;
}

/* Copies a frame to the heap; 0: out of memory, and *added is to be freed. */
static int copy_frame(cairn_player_frame *added, const cairn_report_player *player,
                      const cairn_report_frame *frame)
{
    int32_t i;
    int failed = 0;

    added->ordinal = player->ordinals;
    added->step = frame->step;
    added->label = copy_of_text(frame->label, &failed);
    added->pose = copy_of(frame->pose, frame->pose_count, sizeof *frame->pose, &failed);
    added->region = copy_of(frame->region, frame->region_count, sizeof *frame->region, &failed);
    added->force = copy_of(frame->force, frame->force_count, sizeof *frame->force, &failed);
    added->hypothesis =
        copy_of(frame->hypothesis, frame->hypothesis_count, sizeof *frame->hypothesis, &failed);
    added->submap = frame->submap != NULL
                        ? copy_of(frame->submap, frame->pose_count, sizeof *frame->submap, &failed)
                        : NULL;
    added->pose_count = frame->pose_count;
    added->region_count = frame->region_count;
    added->force_count = frame->force_count;
    added->hypothesis_count = frame->hypothesis_count;
    added->low_confidence_count = 0;
    for (i = 0; i < frame->pose_count && frame->low_confidence != NULL; i++)
        added->low_confidence_count += frame->low_confidence[i] != 0;
    added->low_confidence =
        malloc((size_t)added->low_confidence_count * sizeof *added->low_confidence + 1);
    failed |= added->low_confidence == NULL;
    added->low_confidence_count = 0;
    for (i = 0; i < frame->pose_count && frame->low_confidence != NULL && !failed; i++)
        if (frame->low_confidence[i] != 0)
            added->low_confidence[added->low_confidence_count++] = i;
    for (i = 0; i < player->params.curve_count; i++)
        added->value[i] = frame->value != NULL ? frame->value[i] : (double)NAN;
    return !failed;
}

/* Frees a frame that is not kept. */
static void drop_frame(cairn_report_player *player, int32_t index)
{
    player->pose_count -= player->frame[index].pose_count;
    free_frame(&player->frame[index]);
}

/* Drops every second frame until the limits hold. The first and the last frame are kept. */
static void drop_excess_frames(cairn_report_player *player)
{
    while (player->frame_count > 2 && (player->frame_count > player->params.max_frames ||
                                       player->pose_count > player->params.max_poses)) {
        int32_t kept = 0, i;

        player->stride *= 2;
        for (i = 0; i < player->frame_count; i++) {
            if (player->frame[i].ordinal % player->stride == 0 || i == player->frame_count - 1)
                player->frame[kept++] = player->frame[i];
            else
                drop_frame(player, i);
        }
        player->frame_count = kept;
    }
}

cairn_status cairn_report_player_add_frame(cairn_report_player *player,
                                           const cairn_report_frame *frame)
{
    cairn_player_frame added;
    cairn_status status =
        player != NULL && frame != NULL ? check_frame(player, frame) : CAIRN_BAD_ARGUMENT;

    if (status != CAIRN_OK)
        return status;
    if (!copy_frame(&added, player, frame) || !grow((void **)&player->frame, player->frame_count,
                                                    &player->frame_capacity, sizeof added)) {
        free_frame(&added);
        return CAIRN_NO_MEMORY;
    }
    /* The previous last frame was kept only because it was the last. */
    if (player->frame_count > 0 &&
        player->frame[player->frame_count - 1].ordinal % player->stride != 0)
        drop_frame(player, --player->frame_count);
    player->frame[player->frame_count++] = added;
    player->pose_count += added.pose_count;
    player->ordinals++;
    drop_excess_frames(player);
    return CAIRN_OK;
}

/* ---- Links and grid ---- */

cairn_status cairn_report_player_add_link(cairn_report_player *player, int32_t a, int32_t b,
                                          int32_t accepted)
{
    cairn_player_link *link;

    if (player == NULL || a < 0 || b < 0 || a >= player->scan_count || b >= player->scan_count)
        return CAIRN_BAD_ARGUMENT;
    if (!grow((void **)&player->link, player->link_count, &player->link_capacity,
              sizeof *player->link))
        return CAIRN_NO_MEMORY;
    link = &player->link[player->link_count++];
    link->ordinal = player->ordinals;
    link->a = a;
    link->b = b;
    link->accepted = accepted != 0;
    return CAIRN_OK;
}

cairn_status cairn_report_player_set_grid(cairn_report_player *player,
                                          const cairn_report_grid *grid)
{
    cairn_report_grid coarse;
    uint8_t *pixel = NULL, *bytes = NULL;
    size_t count = 0;
    cairn_status status;

    if (player == NULL || grid == NULL || grid->pixel == NULL || grid->width < 1 ||
        grid->height < 1 || !(grid->resolution > 0) || !(grid->resolution <= MAX_COORDINATE))
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pose_is_finite(grid->origin))
        return CAIRN_NOT_FINITE;
    status = cairn_report_coarsen_grid(grid, &coarse, &pixel);
    if (status == CAIRN_OK)
        status = cairn_image_encode_png(&bytes, &count, pixel, coarse.width, coarse.height, 1);
    free(pixel);
    if (status != CAIRN_OK)
        return status;
    free(player->grid_png);
    player->grid_png = bytes;
    player->grid_bytes = count;
    player->grid = coarse;
    player->grid.pixel = NULL;
    return CAIRN_OK;
}
