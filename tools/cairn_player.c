/* Recording of the frames of --report. */
#include "tools/cairn_player.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/output.h"
#include "cairn/output_set.h"

/* Maximum number of forces recorded per frame, of points sampled evenly over all scans. */
#define MAX_FRAME_FORCES 500

/* The page's folder, "." when the path names none; to be freed. */
static char *folder_of(const char *path)
{
    char *folder = cairn_output_path_folder(path);

    if (folder != NULL && folder[0] == '\0') {
        free(folder);
        folder = strdup(".");
    }
    return folder;
}

cairn_status player_check(const char *path, cairn_file_error *error)
{
    const char *name = cairn_output_path_name(path);
    char *folder = folder_of(path);
    cairn_status status;

    if (folder == NULL)
        return cairn_file_error_set(error, CAIRN_NO_MEMORY, path, 0, "no memory");
    if (name[0] == '\0')
        status = cairn_file_error_set(error, CAIRN_IO, path, 0,
                                      "is a folder, expected the name of a page (HTML)");
    else
        status = cairn_output_set_check(folder, &name, 1, error);
    free(folder);
    return status;
}

cairn_status player_write(const cairn_report_player *player, const char *path,
                          cairn_file_error *error)
{
    const char *name = cairn_output_path_name(path);
    char *folder = folder_of(path);
    cairn_output_set *files = NULL;
    cairn_status status;

    if (folder == NULL)
        return cairn_file_error_set(error, CAIRN_NO_MEMORY, path, 0, "no memory");
    status = cairn_output_set_open(&files, folder, &name, 1, error);
    if (status == CAIRN_OK)
        status = cairn_report_player_write(player, cairn_output_set_path(files, 0), error);
    if (status == CAIRN_OK)
        status = cairn_output_set_commit(files, error);
    else
        cairn_output_set_discard(files);
    free(folder);
    return status;
}

cairn_status player_add_scan(cairn_report_player *player, const map_scan *scan, int32_t index)
{
    cairn_report_scan seen;

    seen.point = scan->point;
    seen.point_count = scan->point_count;
    seen.segment = scan->segment;
    seen.segment_count = scan->segment_count;
    return cairn_report_player_add_scan(player, &seen, index);
}

/* ---- force field ---- */

cairn_report_player_params player_field_params(const cairn_force_field_params *field)
{
    static const cairn_report_curve curves[] = {
        {"potential P(g)", "", "values compare only at equal \xCF\x83"},
        {"\xCF\x83", "m", NULL},
        {"mean relocation", "mm", "by the step that ends here"},
    };
    cairn_report_player_params params = cairn_report_player_default();

    params.curve = curves;
    params.curve_count = sizeof curves / sizeof *curves;
    params.region_radius = field->roi_radius;
    return params;
}

cairn_status player_field_begin(player_field *record, cairn_report_player *player,
                                const cairn_force_field *field)
{
    int32_t scans = cairn_force_field_pose_count(field);

    memset(record, 0, sizeof *record);
    record->player = player;
    record->field = field;
    record->relocation = (double)NAN;
    record->pose = malloc(((size_t)scans + 1) * sizeof *record->pose);
    record->force = malloc((MAX_FRAME_FORCES + 1) * sizeof *record->force);
    return record->pose != NULL && record->force != NULL ? CAIRN_OK : CAIRN_NO_MEMORY;
}

void player_field_free(player_field *record)
{
    free(record->pose);
    free(record->force);
    free(record->region);
}

void player_field_before(player_field *record)
{
    int32_t scans = cairn_force_field_pose_count(record->field);

    for (int32_t i = 0; i < scans; i++)
        record->pose[i] = cairn_force_field_pose(record->field, i);
}

/* Records the force on every n-th point (n = stride), at the position before the iteration. */
static int32_t forces_of(const player_field *record)
{
    const cairn_scan_set *set = cairn_force_field_scans(record->field);
    int32_t stride = (set->point_count + MAX_FRAME_FORCES - 1) / MAX_FRAME_FORCES, count = 0;

    for (int32_t s = 0; s < set->scan_count; s++) {
        const cairn_scan_set_scan *scan = &set->scans[s];

        for (int32_t p = scan->first_point; p < scan->end_point; p++) {
            cairn_report_force *force = &record->force[count];
            cairn_real mass;

            if (p % stride == 0 &&
                cairn_force_field_point_force(record->field, s, p - scan->first_point,
                                              &force->force, &mass) == CAIRN_OK) {
                force->at = cairn_pose_point(record->pose[s], set->points[p]);
                count++;
            }
        }
    }
    return count;
}

static cairn_status regions_of(player_field *record, int32_t *count)
{
    const cairn_corner *corner = cairn_force_field_corners(record->field, count);

    if (*count > record->region_capacity) {
        cairn_vec2 *grown = realloc(record->region, (size_t)*count * sizeof *grown);

        if (grown == NULL)
            return CAIRN_NO_MEMORY;
        record->region = grown;
        record->region_capacity = *count;
    }
    for (int32_t i = 0; i < *count; i++)
        record->region[i] = corner[i].position;
    return CAIRN_OK;
}

cairn_status player_field_after(player_field *record)
{
    cairn_force_field_state state = cairn_force_field_read(record->field);
    double value[3] = {(double)state.potential, (double)state.sigma, record->relocation};
    cairn_report_frame frame;
    cairn_status status;
    char label[96];

    memset(&frame, 0, sizeof frame);
    snprintf(label, sizeof label, "\xCF\x83 %.4g m, \xCE\x94t %.3g, %" PRId64 " pairs of points",
             (double)state.sigma, (double)state.dt, state.pairs);
    frame.step = state.iterations - 1;
    frame.label = label;
    frame.pose = record->pose;
    frame.pose_count = cairn_force_field_pose_count(record->field);
    frame.value = value;
    frame.force = record->force;
    frame.force_count = forces_of(record);
    status = regions_of(record, &frame.region_count);
    frame.region = record->region;
    record->relocation = 1000 * (double)state.mean_relocation;
    return status == CAIRN_OK ? cairn_report_player_add_frame(record->player, &frame) : status;
}

cairn_status player_field_end(player_field *record)
{
    cairn_force_field_state state = cairn_force_field_read(record->field);
    double value[3] = {(double)NAN, (double)NAN, record->relocation};
    cairn_report_frame frame;

    player_field_before(record);
    memset(&frame, 0, sizeof frame);
    frame.step = state.iterations;
    frame.label = state.verdict == CAIRN_FORCE_FIELD_CONVERGED ? "converged" : "end";
    frame.pose = record->pose;
    frame.pose_count = cairn_force_field_pose_count(record->field);
    frame.value = value;
    return cairn_report_player_add_frame(record->player, &frame);
}

/* ---- aligner ---- */

/* Smallest visible motion, m or rad. */
#define MIN_VISIBLE_MOTION 1e-4

cairn_report_player_params player_aligner_params(void)
{
    static const cairn_report_curve curves[] = {
        {"submaps", "", "connected components of the pose graph, one colour each"},
        {"scans in the largest submap", "", NULL},
        {"mean relocation", "mm", "by the step that ends here"},
    };
    cairn_report_player_params params = cairn_report_player_default();

    params.curve = curves;
    params.curve_count = sizeof curves / sizeof *curves;
    return params;
}

cairn_status player_aligner_begin(player_aligner *record, cairn_report_player *player,
                                  const cairn_aligner *aligner)
{
    size_t scans = (size_t)cairn_aligner_scan_count(aligner) + 1;

    memset(record, 0, sizeof *record);
    record->player = player;
    record->aligner = aligner;
    record->pose = malloc(scans * sizeof *record->pose);
    record->submap = malloc(scans * sizeof *record->submap);
    record->low_confidence = calloc(scans, 1);
    return record->pose != NULL && record->submap != NULL && record->low_confidence != NULL
               ? CAIRN_OK
               : CAIRN_NO_MEMORY;
}

void player_aligner_free(player_aligner *record)
{
    free(record->pose);
    free(record->submap);
    free(record->low_confidence);
}

/* Copies the current poses and submaps. Returns 1 when a change is visible. *way: m, the mean
 * displacement of the scans. */
static int take_commit(player_aligner *record, double *way)
{
    int32_t scans = cairn_aligner_scan_count(record->aligner);
    int seen = record->step == 0 || !cairn_aligner_running(record->aligner);

    *way = 0;
    for (int32_t i = 0; i < scans; i++) {
        int32_t part;
        cairn_pose pose = cairn_aligner_current_pose(record->aligner, i, &part),
                   last = record->pose[i];
        double moved =
            record->step > 0 ? hypot((double)(pose.x - last.x), (double)(pose.y - last.y)) : 0;

        seen |= record->step > 0 &&
                (part != record->submap[i] || moved > MIN_VISIBLE_MOTION ||
                 fabs((double)cairn_wrap_angle(pose.theta - last.theta)) > MIN_VISIBLE_MOTION);
        *way += moved / scans;
    }
    for (int32_t i = 0; i < scans && seen; i++)
        record->pose[i] = cairn_aligner_current_pose(record->aligner, i, &record->submap[i]);
    return seen;
}

/* Returns the number of scans in the largest submap; *parts: the number of submaps. */
static int32_t count_parts(const player_aligner *record, int32_t *parts)
{
    int32_t scans = cairn_aligner_scan_count(record->aligner), largest = 0;

    *parts = 0;
    for (int32_t i = 0; i < scans; i++) {
        int32_t size = 0;

        for (int32_t k = 0; k < scans; k++)
            size += record->submap[k] == i;
        *parts += size > 0;
        largest = size > largest ? size : largest;
    }
    return largest;
}

cairn_status player_aligner_commit(player_aligner *record)
{
    cairn_aligner_result result = cairn_aligner_read(record->aligner);
    cairn_report_frame frame;
    char label[96];
    double value[3];
    int32_t parts;

    if (!take_commit(record, &value[2]))
        return CAIRN_OK;
    value[1] = count_parts(record, &parts);
    value[0] = parts;
    value[2] = record->step > 0 ? 1000 * value[2] : (double)NAN;
    memset(&frame, 0, sizeof frame);
    if (!cairn_aligner_running(record->aligner)) {
        snprintf(label, sizeof label, "end: %" PRId32 " scans placed, the others in red",
                 result.placed);
        for (int32_t i = 0; i < cairn_aligner_scan_count(record->aligner); i++)
            record->low_confidence[i] = !cairn_aligner_pose_of(record->aligner, i).placed;
    } else if (result.iterations > 0) {
        snprintf(label, sizeof label, "all poses and walls at once, iteration %" PRId32,
                 result.iterations);
    } else {
        snprintf(label, sizeof label, "%" PRId32 " submaps, the largest of %.0f scans", parts,
                 value[1]);
    }
    frame.step = record->step++;
    frame.label = label;
    frame.pose = record->pose;
    frame.submap = record->submap;
    frame.low_confidence = record->low_confidence;
    frame.pose_count = cairn_aligner_scan_count(record->aligner);
    frame.value = value;
    return cairn_report_player_add_frame(record->player, &frame);
}
