/* Faults of the scanner's set-up, as text and as JSON. */
#include "tools/cairn_info_check.h"

#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <string.h>

#include "src/host/base/degrees.h"
#include "src/host/maps/scanner_check_run.h"

/* With a smaller share of returns the unit of the ranges, or their limit, may be wrong. */
#define FEW_RETURNS 0.1

enum { TEXT_BYTES = 256, OPTION_BYTES = 64 };

/* What is said of a fault. */
typedef struct fault_text {
    const char *name;
    char option[OPTION_BYTES]; /* empty: none mends it */
    char evidence[TEXT_BYTES];
} fault_text;

/* ---- The check ---- */

static int has_few_returns(const cairn_scan_log *log)
{
    int64_t returns = 0, no_returns = 0;

    for (int32_t i = 0; i < log->scans.count; i++)
        for (int32_t k = 0; k < log->scans.record[i].count; k++) {
            float range = log->scans.record[i].range[k];

            returns += range > 0 && !isinf(range);
            no_returns += isinf(range);
        }
    return no_returns > 0 && (double)returns < FEW_RETURNS * (double)(returns + no_returns);
}

int info_check_run(cairn_scanner_check_result *check, const cairn_scan_log *log, const char *path,
                   const tool_log_options *options)
{
    int32_t is_raw = !(options->scanner.range_scale > 0) && has_few_returns(log);
    cairn_scan_correction correction;
    cairn_fault fault = {-1, NULL};
    cairn_scan_log raw;
    cairn_status status;
    int code = TOOL_OK;

    if (is_raw)
        code = tool_correction(&options->scanner, &correction);
    if (is_raw && code == TOOL_OK)
        code = tool_load_raw(&raw, path, options);
    if (code != TOOL_OK)
        return code;
    status = is_raw ? cairn_scan_log_correct(&raw, &correction) : CAIRN_OK;
    if (status == CAIRN_OK)
        status = cairn_scanner_check_run(check, is_raw ? &raw : log, &fault);
    if (is_raw)
        cairn_scan_log_free(&raw);
    if (status == CAIRN_OK)
        return TOOL_OK;
    if (fault.message != NULL)
        (void)options_refuse("cairn info", "%s: scan %" PRId64 ": %s", path, fault.index + 1,
                             fault.message);
    else
        (void)options_refuse("cairn info", "%s: %s", path, cairn_status_text(status));
    return tool_exit_code(status);
}

/* ---- Texts ---- */

static void say(char *text, size_t size, const char *format, ...) CAIRN_FILE_ERROR_FORMAT(3, 4);

static void say(char *text, size_t size, const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    (void)vsnprintf(text, size, format, arguments);
    va_end(arguments);
}

/* The value of an estimate, or that of the log when it is not known. */
static double known_or(cairn_scanner_check_value value, double logged)
{
    return value.is_known ? (double)value.value : logged;
}

static void say_ranges(const cairn_scanner_check_result *check, fault_text *text)
{
    say(text->option, sizeof text->option, "--range-scale %g", (double)check->range_scale);
    if (check->distance.is_known)
        say(text->evidence, sizeof text->evidence,
            "the median of the ranges is %g; scaled, the scans move %.3f +- %.3f m per m of "
            "odometry",
            (double)check->median_range, (double)check->distance.value,
            (double)check->distance.sigma);
    else
        say(text->evidence, sizeof text->evidence,
            "the median of the ranges is %g, impossible in m; not compared with the odometry",
            (double)check->median_range);
}

static void say_sensor(const cairn_scanner_check_result *check, fault_text *text)
{
    double theta =
        known_or(check->theta, (double)check->base_sensor.theta) * CAIRN_DEGREES_PER_RADIAN;

    say(text->option, sizeof text->option, "--sensor %.3f,%.3f,%.2f",
        known_or(check->x, (double)check->base_sensor.x),
        known_or(check->y, (double)check->base_sensor.y), theta);
    say(text->evidence, sizeof text->evidence,
        "matches put the sensor at %.3f +- %.3f m, %.3f +- %.3f m, %.2f +- %.2f degrees; the log "
        "at %.3f, %.3f, %.2f (%" PRId32 " pairs, %" PRId32 " with a turn)",
        (double)check->x.value, (double)check->x.sigma, (double)check->y.value,
        (double)check->y.sigma, theta, (double)check->theta.sigma * CAIRN_DEGREES_PER_RADIAN,
        (double)check->base_sensor.x, (double)check->base_sensor.y,
        (double)check->base_sensor.theta * CAIRN_DEGREES_PER_RADIAN, check->pairs, check->turns);
}

/* The step that mends, per logged one: overlapping scans, where they were needed, are surer. */
static double mending_step(const cairn_scanner_check_result *check)
{
    return known_or(check->overlap_step, (double)check->step.value);
}

/* Appends what overlapping scans say, or else the turns of the odometry. */
static void say_other_evidence(const cairn_scanner_check_result *check, char *text, size_t size)
{
    size_t used = strlen(text);

    if (check->overlap_step.is_known)
        say(text + used, size - used, "; overlapping scans of its map agree with %.4f +- %.4f",
            (double)check->overlap_step.value, (double)check->overlap_step.sigma);
    else if (check->turn_scale.is_known)
        say(text + used, size - used, "; the scans then turn %.3f per turn of the odometry",
            (double)check->turn_scale.value);
}

static void say_step(const cairn_scanner_check_result *check, fault_text *text)
{
    say(text->option, sizeof text->option, "--angle-step %.5g",
        mending_step(check) * (double)check->angle_step * CAIRN_DEGREES_PER_RADIAN);
    say(text->evidence, sizeof text->evidence,
        "walls are bent: they are straight with %.4f +- %.4f times the angle step of %.5g degrees "
        "(%" PRId32 " walls)",
        (double)check->step.value, (double)check->step.sigma,
        (double)check->angle_step * CAIRN_DEGREES_PER_RADIAN, check->walls);
    say_other_evidence(check, text->evidence, sizeof text->evidence);
}

/* Says what the check has found, with the option that mends it. */
static fault_text text_of(const cairn_scanner_check_result *check, cairn_scanner_check_fault fault)
{
    static const char *const names[CAIRN_SCANNER_CHECK_FAULTS] = {
        "range_scale",       "flip",          "angle_step", "sweep",   "sensor",
        "odometry_distance", "odometry_turn", "stamps",     "repeated"};
    fault_text text = {names[fault], "", ""};

    switch (fault) {
    case CAIRN_SCANNER_CHECK_RANGES:
        say_ranges(check, &text);
        break;
    case CAIRN_SCANNER_CHECK_FLIP:
        say(text.option, sizeof text.option, "--flip");
        say(text.evidence, sizeof text.evidence,
            "the scans turn against the odometry: %.3f +- %.3f of its turns (%" PRId32 " pairs)",
            (double)check->turn.value, (double)check->turn.sigma, check->turns);
        break;
    case CAIRN_SCANNER_CHECK_STEP:
        say_step(check, &text);
        break;
    case CAIRN_SCANNER_CHECK_SWEEP:
        say(text.option, sizeof text.option, "--sweep %.3f", (double)check->sweep_found.value);
        say(text.evidence, sizeof text.evidence,
            "walls bend with the turn rate, as in scans of %.3f +- %.3f s; the log has %.3f s "
            "(%" PRId32 " walls)",
            (double)check->sweep_found.value, (double)check->sweep_found.sigma,
            (double)check->sweep, check->walls);
        break;
    case CAIRN_SCANNER_CHECK_SENSOR:
        say_sensor(check, &text);
        break;
    case CAIRN_SCANNER_CHECK_DISTANCE:
        say(text.evidence, sizeof text.evidence,
            "the scans move %.3f +- %.3f m per m of odometry: wheels, or unit of the odometry "
            "(%" PRId32 " pairs)",
            (double)check->distance.value, (double)check->distance.sigma, check->pairs);
        break;
    case CAIRN_SCANNER_CHECK_TURN:
        say(text.evidence, sizeof text.evidence,
            "the scans turn %.3f +- %.3f per turn of the odometry: wheels, or unit of the angles "
            "(%" PRId32 " pairs)",
            (double)check->turn_scale.value, (double)check->turn_scale.sigma, check->turns);
        break;
    case CAIRN_SCANNER_CHECK_STAMPS:
        say(text.evidence, sizeof text.evidence,
            "%" PRId32 " scans are stamped earlier than the one before, %" PRId32
            " alike, of %" PRId32 ": velocities are wrong there",
            check->backward, check->constant, check->scans);
        break;
    case CAIRN_SCANNER_CHECK_REPEATED:
    default:
        say(text.evidence, sizeof text.evidence,
            "%" PRId32 " of %" PRId32 " scans after a motion have the ranges of the one before: "
            "the driver repeats scans",
            check->repeated, check->moved);
        break;
    }
    return text;
}

/* Why an estimate is missing. */
static const char *reason_of(const cairn_scanner_check_result *check, int32_t needs_odometry)
{
    if (check->scans < 2)
        return "one scan";
    if (needs_odometry && !check->has_odometry)
        return "no odometry that moves";
    return needs_odometry ? "too few matches, motions or turns"
                          : "too few walls or turns, or an offset of the ranges";
}

/* Says why a small deviation of the step is no fault. */
static void print_unconfirmed(const cairn_scanner_check_result *check)
{
    char other[TEXT_BYTES] = "; no overlapping scans confirm it";

    if (!cairn_scanner_check_needs_overlap(check) ||
        cairn_scanner_check_has(check, CAIRN_SCANNER_CHECK_STEP))
        return;
    if (check->overlap_step.is_known)
        say(other, sizeof other, ", overlapping scans of its map agree with %.4f +- %.4f",
            (double)check->overlap_step.value, (double)check->overlap_step.sigma);
    printf("%-12s angle step: walls are straight with %.4f +- %.4f times that of the log%s\n",
           "unconfirmed", (double)check->step.value, (double)check->step.sigma, other);
}

static void print_unknown(const cairn_scanner_check_result *check)
{
    const struct {
        const char *name;
        int32_t is_known, needs_odometry;
    } part[] = {{"unit of the ranges", check->distance.is_known, 1},
                {"flip", check->turn.is_known, 1},
                {"angle step", check->step.is_known, 0},
                {"sweep", check->sweep_found.is_known, 0},
                {"sensor's position", check->x.is_known && check->y.is_known, 1},
                {"sensor's heading", check->theta.is_known, 1}};

    for (size_t i = 0; i < sizeof part / sizeof *part; i++)
        if (!part[i].is_known)
            printf("%-12s %s: not observable: %s\n", "unknown", part[i].name,
                   reason_of(check, part[i].needs_odometry));
}

void info_check_print(const cairn_scanner_check_result *check)
{
    int32_t faults = 0;

    printf("%-12s %" PRId32 " pairs of scans matched, %" PRId32 " with a turn; %" PRId32
           " straight walls\n",
           "check", check->pairs, check->turns, check->walls);
    for (int i = 0; i < CAIRN_SCANNER_CHECK_FAULTS; i++) {
        fault_text text;

        if (!cairn_scanner_check_has(check, (cairn_scanner_check_fault)i))
            continue;
        text = text_of(check, (cairn_scanner_check_fault)i);
        printf("%-12s %s: %s%s%s\n", "fault", text.name, text.evidence,
               text.option[0] != '\0' ? "; mended by " : "", text.option);
        faults++;
    }
    if (faults == 0)
        printf("%-12s no fault found\n", "");
    print_unconfirmed(check);
    print_unknown(check);
}

/* ---- JSON ---- */

static void write_value(cairn_json_writer *json, const char *name, cairn_scanner_check_value value,
                        double unit)
{
    if (!value.is_known) {
        cairn_json_write_null(json, name);
        return;
    }
    cairn_json_write_object(json, name);
    cairn_json_write_number(json, "value", (double)value.value * unit);
    cairn_json_write_number(json, "sigma", (double)value.sigma * unit);
    cairn_json_write_object_end(json);
}

static void write_faults(cairn_json_writer *json, const cairn_scanner_check_result *check)
{
    cairn_json_write_array(json, "faults");
    for (int i = 0; i < CAIRN_SCANNER_CHECK_FAULTS; i++) {
        fault_text text;

        if (!cairn_scanner_check_has(check, (cairn_scanner_check_fault)i))
            continue;
        text = text_of(check, (cairn_scanner_check_fault)i);
        cairn_json_write_object(json, NULL);
        cairn_json_write_text(json, "fault", text.name);
        cairn_json_write_text(json, "option", text.option[0] != '\0' ? text.option : NULL);
        cairn_json_write_text(json, "evidence", text.evidence);
        cairn_json_write_object_end(json);
    }
    cairn_json_write_array_end(json);
}

void info_check_write(cairn_json_writer *json, const cairn_scanner_check_result *check)
{
    if (check == NULL) {
        cairn_json_write_null(json, "check");
        return;
    }
    cairn_json_write_object(json, "check");
    cairn_json_write_integer(json, "pairs", check->pairs);
    cairn_json_write_integer(json, "turns", check->turns);
    cairn_json_write_integer(json, "walls", check->walls);
    cairn_json_write_integer(json, "repeated", check->repeated);
    cairn_json_write_integer(json, "equal_stamps", check->constant);
    cairn_json_write_number(json, "median_range", (double)check->median_range);
    cairn_json_write_number(json, "range_scale", (double)check->range_scale);
    write_value(json, "turn_ratio", check->turn, 1);
    write_value(json, "distance_ratio", check->distance, 1);
    write_value(json, "angle_step_deg", check->step,
                (double)check->angle_step * CAIRN_DEGREES_PER_RADIAN);
    write_value(json, "overlap_angle_step_deg", check->overlap_step,
                (double)check->angle_step * CAIRN_DEGREES_PER_RADIAN);
    write_value(json, "sweep_s", check->sweep_found, 1);
    write_value(json, "sensor_x_m", check->x, 1);
    write_value(json, "sensor_y_m", check->y, 1);
    write_value(json, "sensor_theta_deg", check->theta, CAIRN_DEGREES_PER_RADIAN);
    write_faults(json, check);
    cairn_json_write_object_end(json);
}
