/* cairn align --virtual: method default, then virtual scans for the scans that remain unplaced;
 * with method gradient algorithm 2 of the thesis (Adluru 2008, chapter 8). */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/virtual_align.h"
#include "tools/cairn_align.h"

/* Frames of the player for --report. */
typedef struct virtual_record {
    cairn_report_player *player;
    const cairn_virtual_align *align;
    cairn_pose *pose;
    uint8_t *low_confidence;
    cairn_report_hypothesis *hypothesis;
    int32_t scans, hypothesis_capacity;
    int32_t as_written;
    int64_t step;
} virtual_record;

static cairn_status add_to_align(void *align, const cairn_scan_view *view, cairn_pose start,
                                 cairn_fault *fault)
{
    return cairn_virtual_align_add_scan(align, view, start, fault);
}

/* ---- Frames of the player ---- */

static cairn_report_player_params player_params(void)
{
    static const cairn_report_curve curves[] = {
        {"hypotheses", "", "lines and rectangles proposed from the map"},
        {"sigma", "m", "standard deviation of the pose errors left"},
        {"mean relocation", "mm", "of the scans that move, by the step that ends here"},
    };
    cairn_report_player_params params = cairn_report_player_default();

    params.curve = curves;
    params.curve_count = sizeof curves / sizeof *curves;
    return params;
}

static cairn_virtual_align_params params_of(const align_job *job)
{
    cairn_virtual_align_params params;

    if (!job->settings->as_written) {
        params = cairn_virtual_align_default();
        params.aligner = align_params_of(job);
        return params;
    }
    params = cairn_virtual_align_as_written();
    params.aligner = align_params_of(job);
    params.aligner.max_hypotheses = params.aligner.max_fill = 1; /* the aligner does not run */
    params.field.max_steps = (int32_t)job->settings->steps;
    params.hypotheses.spacing = (cairn_real)job->settings->spacing;
    params.hypotheses.max_virtual = CAIRN_VIRTUAL_ALIGN_WRITTEN_POINTS;
    params.hypotheses.hough.distances = CAIRN_VIRTUAL_ALIGN_WRITTEN_DISTANCES;
    return params;
}

static cairn_status record_begin(virtual_record *record, const align_job *job,
                                 const cairn_virtual_align *align)
{
    size_t scans = (size_t)job->log->count + 1;

    record->player = job->player;
    record->align = align;
    record->scans = job->log->count;
    record->as_written = job->settings->as_written;
    record->hypothesis_capacity = params_of(job).hypotheses.max_virtual;
    record->pose = malloc(scans * sizeof *record->pose);
    record->low_confidence = calloc(scans, 1);
    record->hypothesis = malloc((size_t)record->hypothesis_capacity * sizeof *record->hypothesis);
    return record->pose != NULL && record->low_confidence != NULL && record->hypothesis != NULL
               ? CAIRN_OK
               : CAIRN_NO_MEMORY;
}

static void record_free(virtual_record *record)
{
    free(record->pose);
    free(record->low_confidence);
    free(record->hypothesis);
}

static int is_straight_on(const cairn_oriented_point *a, const cairn_oriented_point *b)
{
    return a->direction.x == b->direction.x && a->direction.y == b->direction.y;
}

/* Converts the virtual scan to segments: consecutive points of equal direction form one segment; a
 * single point gets a segment of the length of the spacing. */
static int32_t take_guesses(virtual_record *record)
{
    const cairn_virtual_scan *from = cairn_virtual_align_hypotheses(record->align);
    const cairn_real half = cairn_virtual_align_default().hypotheses.spacing / 2, *weights;
    int32_t hypotheses, points, count = 0;
    const cairn_virtual_scan_hypothesis *h = cairn_virtual_scan_hypotheses(from, &hypotheses);
    const cairn_oriented_point *p = cairn_virtual_scan_points(from, &weights, &points);

    for (int32_t i = 0; i < hypotheses; i++)
        for (int32_t first = h[i].first_point, end; first < h[i].end_point; first = end) {
            cairn_report_hypothesis *guess = &record->hypothesis[count++];

            for (end = first + 1; end < h[i].end_point && is_straight_on(&p[first], &p[end]);)
                end++;
            guess->strength = h[i].strength;
            guess->segment.a = p[first].position;
            guess->segment.b = p[end - 1].position;
            if (end == first + 1) {
                cairn_vec2 way = cairn_vec2_scale(p[first].direction, half);

                guess->segment.a = cairn_vec2_sub(p[first].position, way);
                guess->segment.b = cairn_vec2_add(p[first].position, way);
            }
        }
    return count;
}

/* Copies the current poses; returns the mean displacement of the moving scans, m. */
static double take_poses(virtual_record *record)
{
    double way = 0;
    int32_t moving = 0;

    for (int32_t i = 0; i < record->scans; i++) {
        cairn_virtual_align_pose pose = cairn_virtual_align_pose_of(record->align, i);
        cairn_pose last = record->pose[i];

        record->pose[i] = pose.aligned.map_scan;
        record->low_confidence[i] = !record->as_written && !pose.aligned.placed;
        if (pose.moved && record->step > 0) {
            way +=
                hypot((double)(record->pose[i].x - last.x), (double)(record->pose[i].y - last.y));
            moving++;
        }
    }
    return moving > 0 ? way / moving : 0;
}

/* Records the current state as a frame. In the first frame no scan has moved. */
static cairn_status record_frame(virtual_record *record)
{
    cairn_virtual_align_result result = cairn_virtual_align_read(record->align);
    int in_field = result.iterations > 0 && cairn_virtual_align_running(record->align);
    double sigma = (double)cairn_force_field_read(cairn_virtual_align_field(record->align)).sigma;
    cairn_report_frame frame;
    char label[96];
    double value[3];

    memset(&frame, 0, sizeof frame);
    value[2] = 1000 * take_poses(record);
    value[0] = in_field ? result.hypotheses : (double)NAN;
    value[1] = in_field ? sigma : (double)NAN;
    if (in_field) {
        snprintf(label, sizeof label,
                 "%" PRId32 " scans move with %" PRId32 " hypotheses, sigma %.2f m",
                 result.moved_scans, result.hypotheses, sigma);
        frame.hypothesis = record->hypothesis;
        frame.hypothesis_count = take_guesses(record);
    } else if (record->as_written) {
        snprintf(label, sizeof label, "end: %" PRId32 " iterations", result.iterations);
    } else {
        snprintf(label, sizeof label, "%s%" PRId32 " scans placed, the others in red",
                 cairn_virtual_align_running(record->align) ? "" : "end: ", result.aligner.placed);
    }
    frame.step = record->step++;
    frame.label = label;
    frame.pose = record->pose;
    frame.low_confidence = record->low_confidence;
    frame.pose_count = record->scans;
    frame.value = value;
    return cairn_report_player_add_frame(record->player, &frame);
}

/* ---- The alignment ---- */

static cairn_status run(align_job *job, cairn_virtual_align *align)
{
    cairn_status status = cairn_virtual_align_begin(align);
    virtual_record record;

    memset(&record, 0, sizeof record);
    if (status == CAIRN_OK && job->player != NULL)
        status = record_begin(&record, job, align);
    while (status == CAIRN_OK && cairn_virtual_align_running(align)) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        while ((status = cairn_virtual_align_iterate(align, &budget)) == CAIRN_MORE)
            budget.left = CAIRN_UNBOUNDED;
        if (status == CAIRN_OK && job->player != NULL)
            status = record_frame(&record);
    }
    record_free(&record);
    return status;
}

static void read_result(align_job *job, const cairn_virtual_align *align)
{
    cairn_virtual_align_result result = cairn_virtual_align_read(align);
    cairn_json_writer *json = &job->json.writer;
    int32_t guessed = 0;

    for (int32_t i = 0; i < job->log->count; i++) {
        cairn_virtual_align_pose pose = cairn_virtual_align_pose_of(align, i);

        align_read_pose(job, i, &pose.aligned);
        if (pose.moved && pose.aligned.component != 0 && job->scans[i].low_confidence &&
            job->scans[i].point_count > 0) {
            job->scans[i].verdict = "guessed";
            guessed++;
        }
    }
    snprintf(job->subtitle, sizeof job->subtitle,
             "%" PRId32 " placed, %" PRId32 " by hypotheses alone", result.aligner.placed, guessed);
    snprintf(
        job->summary, sizeof job->summary,
        "virtual    %" PRId32 " scans registered against hypotheses in %" PRId32
        " iterations, %" PRId32 " translated along walls, %" PRId32 " placed by hypotheses alone\n",
        result.moved_scans, result.iterations, result.weak_direction.translated_scans, guessed);
    cairn_json_write_integer(json, "moved", result.moved_scans);
    cairn_json_write_integer(json, "virtual_iterations", result.iterations);
    cairn_json_write_integer(json, "translated", result.weak_direction.translated_scans);
    cairn_json_write_integer(json, "guessed", guessed);
    align_summarize(job, &result.aligner);
}

/* Stores the poses as written: all scans are placed by the force field. */
static void read_as_written(align_job *job, const cairn_virtual_align *align)
{
    cairn_virtual_align_result result = cairn_virtual_align_read(align);
    cairn_force_field_state state = cairn_force_field_read(cairn_virtual_align_field(align));
    const char *verdict =
        state.verdict == CAIRN_FORCE_FIELD_CONVERGED ? "converged" : "out of steps";
    cairn_json_writer *json = &job->json.writer;

    for (int32_t i = 0; i < job->log->count; i++) {
        map_scan *scan = &job->scans[i];

        scan->after = cairn_virtual_align_pose_of(align, i).aligned.map_scan;
        scan->low_confidence = scan->point_count == 0;
        scan->verdict = scan->low_confidence ? "blind" : "aligned";
    }
    snprintf(job->subtitle, sizeof job->subtitle, "%" PRId32 " iterations of algorithm 2",
             result.iterations);
    snprintf(job->summary, sizeof job->summary,
             "steps      %" PRId32 " (%s), %" PRId32 " with a virtual scan, the last of %" PRId32
             " hypotheses\n",
             result.iterations, verdict, result.active_iterations, result.hypotheses);
    cairn_json_write_integer(json, "iterations", result.iterations);
    cairn_json_write_text(json, "verdict", verdict);
    cairn_json_write_integer(json, "active_iterations", result.active_iterations);
    cairn_json_write_integer(json, "hypotheses", result.hypotheses);
}

int align_by_hypotheses(align_job *job)
{
    cairn_virtual_align_params params = params_of(job);
    cairn_virtual_align *align = NULL;
    cairn_scan *scan = NULL;
    cairn_status status;
    cairn_pool pool;
    int code;

    code = tool_pool_open(&pool, ALIGN_PROGRAM, job->settings->pool,
                          cairn_virtual_align_memory(&params) + cairn_scan_memory(&job->scan));
    if (code != TOOL_OK)
        return code;
    status = cairn_scan_create(&scan, &pool, &job->scan);
    if (status == CAIRN_OK)
        status = cairn_virtual_align_create(&align, &pool, &params);
    if (status == CAIRN_OK)
        status = align_open_player(job, player_params(),
                                   job->settings->as_written
                                       ? "force field simulation with virtual scans"
                                       : "unplaced scans registered against hypotheses");
    if (status == CAIRN_OK)
        code = align_add_scans(job, scan, add_to_align, align);
    if (status == CAIRN_OK && code == TOOL_OK)
        status = run(job, align);
    if (status < 0)
        code = align_refuse(job, status);
    else if (code == TOOL_OK && job->settings->as_written)
        read_as_written(job, align);
    else if (code == TOOL_OK)
        read_result(job, align);
    job->pool_bytes = pool.peak;
    tool_pool_close(&pool);
    return code;
}
