/* The angle step of the logs of cairn map: a known mistake of drivers is corrected. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "src/host/base/degrees.h"
#include "tools/cairn_map_work.h"

/* Steps of logs that differ by a smaller share are the same. */
#define SAME_STEP 1e-5

/* Returns the step that all logs would have by the mistake, rad; 0: they do not look like it. */
static double mistake_of(const map_input *input)
{
    double first = (double)cairn_angle_step_mistake(&input->record[0].scan);

    for (int32_t i = 1; i < input->log_count; i++) {
        const cairn_scan_input *scan = &input->record[input->log[i].first].scan;

        if (!(fabs((double)cairn_angle_step_mistake(scan) - first) <= SAME_STEP * first))
            return 0;
    }
    return first;
}

/* The scans with the poses of the run; NULL: none, or no memory. */
static cairn_scanner_check_scan *placed_scans(const map_settings *s, const map_run *run,
                                              const map_input *input)
{
    cairn_scanner_check_scan *scans =
        input->count > 0 ? malloc((size_t)input->count * sizeof *scans) : NULL;

    for (int32_t i = 0; scans != NULL && i < input->count; i++) {
        scans[i].input = map_scan_input(s, &input->record[i]);
        scans[i].robot = cairn_scan_place_pose(run->mapper, &run->places[i]);
    }
    return scans;
}

int map_check_angle_step(map_settings *s, const map_run *run, map_input *input)
{
    map_angle_step *step = &s->angle_step;
    double mistake =
        s->keep_angle_step || s->scanner.angle_step > 0 || !run->keeps || input->count == 0
            ? 0
            : mistake_of(input);
    cairn_scan_correction correction = cairn_scan_correction_none();
    cairn_scanner_check_scan *scans;
    cairn_status status = CAIRN_NO_MEMORY;

    step->is_checked = 1;
    if (!(mistake > 0))
        return TOOL_OK;
    scans = placed_scans(s, run, input);
    if (scans != NULL)
        status = cairn_angle_step_run(&step->found, scans, input->count, NULL);
    free(scans);
    if (status == CAIRN_OK && cairn_angle_step_is_mistake(&step->found, (cairn_real)mistake)) {
        correction.angle_step = (cairn_real)mistake;
        step->corrected = mistake;
        step->is_corrected = map_input_correct(input, &correction);
        status = step->is_corrected ? CAIRN_OK : CAIRN_NO_MEMORY;
    }
    if (status == CAIRN_OK)
        return TOOL_OK;
    (void)options_refuse(MAP_PROGRAM, "%s: %s", s->log, cairn_status_text(status));
    return tool_exit_code(status);
}

void map_print_angle_step(const map_settings *s)
{
    const map_angle_step *step = &s->angle_step;

    if (!step->is_corrected)
        return;
    fprintf(stderr,
            MAP_PROGRAM ": %s: mapped with an angle step of %.5g degrees in place of %.5g: %" PRId32
                        " pairs of overlapping scans agree with %.4f +- %.4f times the step of the "
                        "log, whose field of view is one beam too wide; other commands need "
                        "--angle-step %.5g; --keep-angle-step maps with that of the log\n",
            s->log, step->corrected * CAIRN_DEGREES_PER_RADIAN,
            (double)step->found.logged * CAIRN_DEGREES_PER_RADIAN, step->found.pairs,
            (double)step->found.ratio.value, (double)step->found.ratio.sigma,
            step->corrected * CAIRN_DEGREES_PER_RADIAN);
}

void map_write_angle_step(cairn_json_writer *json, const map_settings *s)
{
    const map_angle_step *step = &s->angle_step;

    if (!step->found.ratio.is_known) {
        cairn_json_write_null(json, "angle_step");
        return;
    }
    cairn_json_write_object(json, "angle_step");
    cairn_json_write_boolean(json, "corrected", step->is_corrected);
    cairn_json_write_number(json, "logged_deg",
                            (double)step->found.logged * CAIRN_DEGREES_PER_RADIAN);
    cairn_json_write_number(json, "mapped_deg",
                            (step->is_corrected ? step->corrected : (double)step->found.logged) *
                                CAIRN_DEGREES_PER_RADIAN);
    cairn_json_write_number(json, "ratio", (double)step->found.ratio.value);
    cairn_json_write_number(json, "ratio_sigma", (double)step->found.ratio.sigma);
    cairn_json_write_integer(json, "pairs", step->found.pairs);
    cairn_json_write_object_end(json);
}
