/* cairn eval: quality of a map, errors of poses and of relative poses. */
#include "tools/cairn_eval.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/map_quality.h"
#include "cairn/relation_table.h"
#include "src/host/base/degrees.h"

#define POSES_PROGRAM     "cairn eval poses"
#define RELATIONS_PROGRAM "cairn eval relations"

static int compare_rows(const void *a, const void *b)
{
    const cairn_pose_table_row *x = a, *y = b;

    return (x->index > y->index) - (x->index < y->index);
}

int eval_read_poses(const char *program, const char *path, cairn_pose_table_row **row,
                    int32_t *count)
{
    cairn_file_error error;

    if (cairn_pose_table_read(row, count, path, &error) != CAIRN_OK)
        return tool_report(&error);
    qsort(*row, (size_t)*count, sizeof **row, compare_rows);
    for (int32_t i = 1; i < *count; i++)
        if ((*row)[i].index == (*row)[i - 1].index) {
            int64_t index = (*row)[i].index;

            cairn_pose_table_free(*row);
            return options_refuse(
                program, "%s: duplicate index %" PRId64 ", expected every scan once", path, index);
        }
    return TOOL_OK;
}

/* ---- poses ---- */

/* Poses of the scans that are in both tables. */
typedef struct pose_pairs {
    cairn_pose *estimate, *truth; /* [count] */
    int32_t count;
} pose_pairs;

static void free_pairs(pose_pairs *pairs)
{
    free(pairs->estimate);
    free(pairs->truth);
}

/* Pairs poses of equal index of two sorted tables. Returns 0 when there is no memory. */
static int match_indices(const cairn_pose_table_row *a, int32_t a_count,
                         const cairn_pose_table_row *b, int32_t b_count, pose_pairs *pairs)
{
    pairs->count = 0;
    pairs->estimate = malloc((size_t)a_count * sizeof *pairs->estimate);
    pairs->truth = malloc((size_t)a_count * sizeof *pairs->truth);
    if (pairs->estimate == NULL || pairs->truth == NULL)
        return 0;
    for (int32_t i = 0, k = 0; i < a_count; i++) {
        while (k < b_count && b[k].index < a[i].index)
            k++;
        if (k == b_count || b[k].index != a[i].index)
            continue;
        pairs->estimate[pairs->count] = a[i].pose;
        pairs->truth[pairs->count++] = b[k].pose;
    }
    return 1;
}

typedef struct pose_figures {
    /* errors after alignment of the first poses; after rigid least-squares alignment */
    cairn_map_quality_pose_errors first, common;
    double distance_mean, distance_most;
} pose_figures;

/* Computes the errors after both alignments of the estimates with the ground truth. */
static cairn_status measure_poses(pose_pairs *pairs, pose_figures *f)
{
    cairn_pose motion = cairn_pose_fit(pairs->estimate, pairs->truth, NULL, pairs->count, 1);
    cairn_status status =
        cairn_map_quality_pose_errors_of(pairs->estimate, pairs->truth, pairs->count, &f->first);

    memset(&f->common, 0, sizeof f->common);
    f->distance_mean = f->distance_most = 0;
    for (int32_t i = 0; i < pairs->count && status == CAIRN_OK; i++) {
        cairn_pose moved = cairn_pose_compose(motion, pairs->estimate[i]), truth = pairs->truth[i];
        double distance = hypot((double)(moved.x - truth.x), (double)(moved.y - truth.y));
        cairn_real share = 1 / (cairn_real)pairs->count;

        f->common.x += share * cairn_abs(moved.x - truth.x);
        f->common.y += share * cairn_abs(moved.y - truth.y);
        f->common.theta += share * cairn_abs(cairn_wrap_angle(moved.theta - truth.theta));
        f->distance_mean += distance / pairs->count;
        f->distance_most = fmax(f->distance_most, distance);
    }
    return status;
}

static void print_poses_json(const pose_figures *f, int32_t count, int32_t left_out)
{
    cairn_json_writer json = cairn_json_write_begin(stdout);

    cairn_json_write_integer(&json, "poses", count);
    cairn_json_write_integer(&json, "left_out", left_out);
    cairn_json_write_number(&json, "e_x_m", (double)f->common.x);
    cairn_json_write_number(&json, "e_y_m", (double)f->common.y);
    cairn_json_write_number(&json, "e_theta_rad", (double)f->common.theta);
    cairn_json_write_number(&json, "distance_mean_m", f->distance_mean);
    cairn_json_write_number(&json, "distance_most_m", f->distance_most);
    cairn_json_write_number(&json, "first_e_x_m", (double)f->first.x);
    cairn_json_write_number(&json, "first_e_y_m", (double)f->first.y);
    cairn_json_write_number(&json, "first_e_theta_rad", (double)f->first.theta);
    cairn_json_write_end(&json);
}

static void print_poses(const pose_figures *f, int32_t count, int32_t left_out)
{
    printf("poses      %" PRId32 " (%" PRId32 " in only one of the tables ignored)\n"
           "after the best rigid alignment\n"
           "  E(x)     %.4f m\n"
           "  E(y)     %.4f m\n"
           "  E(theta) %.4f degrees\n"
           "  distance %.4f m on average, %.4f m at most\n"
           "after alignment of the first poses\n"
           "  E(x)     %.4f m\n"
           "  E(y)     %.4f m\n"
           "  E(theta) %.4f degrees\n",
           count, left_out, (double)f->common.x, (double)f->common.y,
           (double)f->common.theta * CAIRN_DEGREES_PER_RADIAN, f->distance_mean, f->distance_most,
           (double)f->first.x, (double)f->first.y,
           (double)f->first.theta * CAIRN_DEGREES_PER_RADIAN);
}

static int compare_poses(const char *const arguments[2], const cairn_pose_table_row *a,
                         int32_t a_count, const cairn_pose_table_row *b, int32_t b_count,
                         int32_t json)
{
    pose_pairs pairs;
    pose_figures figures;
    int code = TOOL_OK;

    if (!match_indices(a, a_count, b, b_count, &pairs)) {
        (void)options_refuse(POSES_PROGRAM, "no memory for %" PRId32 " poses", a_count);
        code = TOOL_FAILED;
    } else if (pairs.count == 0) {
        code = options_refuse(POSES_PROGRAM,
                              "%s and %s have no index in common, expected poses of the same scans",
                              arguments[0], arguments[1]);
    } else if (measure_poses(&pairs, &figures) != CAIRN_OK) {
        code = options_refuse(POSES_PROGRAM, "%s: the poses cannot be compared", arguments[0]);
    } else {
        (json ? print_poses_json : print_poses)(&figures, pairs.count,
                                                a_count + b_count - 2 * pairs.count);
    }
    free_pairs(&pairs);
    return code;
}

int eval_poses(int argc, char **argv)
{
    int32_t json = 0, a_count, b_count;
    const option table[] = {OPTION_JSON(&json)};
    const option_set set = {POSES_PROGRAM, "POSES.csv TRUTH.csv [options]",
                            "Errors of poses against ground truth: mean absolute differences E(x), "
                            "E(y), E(theta) of the "
                            "scans in both tables, after the best rigid alignment (least squares) "
                            "and after alignment of "
                            "the first poses, as in the thesis.",
                            table, sizeof table / sizeof *table};
    const char *arguments[2] = {NULL, NULL};
    size_t count = 2;
    option_result result = options_read(&set, argc, argv, arguments, &count);
    cairn_pose_table_row *a, *b;
    int code;

    if (result != OPTIONS_READ)
        return (int)result;
    if (count < 2)
        return options_refuse(POSES_PROGRAM, "%s, expected %s",
                              count == 0 ? "no poses" : "no truth", set.synopsis);
    code = eval_read_poses(POSES_PROGRAM, arguments[0], &a, &a_count);
    if (code != TOOL_OK)
        return code;
    code = eval_read_poses(POSES_PROGRAM, arguments[1], &b, &b_count);
    if (code == TOOL_OK) {
        code = compare_poses(arguments, a, a_count, b, b_count, json);
        cairn_pose_table_free(b);
    }
    cairn_pose_table_free(a);
    return code;
}

/* ---- relations ---- */

/* Poses of scans with their time stamps, indexed by scan; missing scans have no stamp and known =
 * 0. */
typedef struct timed_poses {
    cairn_pose *pose;
    int64_t *stamp_ns;
    uint8_t *known;
    int32_t count;
} timed_poses;

static int new_timed(timed_poses *t, int64_t count)
{
    t->count = (int32_t)count;
    t->pose = calloc((size_t)count + 1, sizeof *t->pose);
    t->stamp_ns = malloc(((size_t)count + 1) * sizeof *t->stamp_ns);
    t->known = calloc((size_t)count + 1, 1);
    for (int64_t i = 0; i < count && t->stamp_ns != NULL; i++)
        t->stamp_ns[i] = CAIRN_POSE_TABLE_NO_STAMP;
    if (t->pose != NULL && t->stamp_ns != NULL && t->known != NULL)
        return TOOL_OK;
    (void)options_refuse(RELATIONS_PROGRAM, "no memory for %" PRId64 " poses", count);
    return TOOL_FAILED;
}

static void free_timed(timed_poses *t)
{
    free(t->pose);
    free(t->stamp_ns);
    free(t->known);
}

static int poses_of_table(const char *path, timed_poses *t)
{
    cairn_pose_table_row *row;
    int32_t count;
    int code = eval_read_poses(RELATIONS_PROGRAM, path, &row, &count);

    if (code != TOOL_OK)
        return code;
    if (row[0].index < 0 || row[count - 1].index >= INT32_MAX)
        code = options_refuse(RELATIONS_PROGRAM,
                              "%s: index %" PRId64 ", expected indices of scans from 0", path,
                              row[0].index < 0 ? row[0].index : row[count - 1].index);
    if (code == TOOL_OK)
        code = new_timed(t, row[count - 1].index + 1);
    for (int32_t i = 0; i < count && code == TOOL_OK; i++) {
        t->pose[row[i].index] = row[i].pose;
        t->stamp_ns[row[i].index] = row[i].stamp_ns;
        t->known[row[i].index] = 1;
    }
    cairn_pose_table_free(row);
    return code;
}

/* Reads the poses of the sensors from a log; relations are between sensors. */
static int poses_of_log(const char *path, const tool_log_options *options, timed_poses *t)
{
    cairn_scan_log log;
    int code = tool_load_with_poses(&log, RELATIONS_PROGRAM, path, options);

    if (code != TOOL_OK)
        return code;
    code = new_timed(t, log.scans.count);
    for (int32_t i = 0; i < log.scans.count && code == TOOL_OK; i++) {
        t->pose[i] =
            cairn_pose_compose(log.scans.record[i].robot, log.scans.record[i].scan.base_sensor);
        t->stamp_ns[i] = log.scans.record[i].stamp_ns;
        t->known[i] = 1;
    }
    cairn_scan_log_free(&log);
    return code;
}

/* Converts poses of the robot to poses of the sensor by the mounting in the log. */
static int move_to_sensors(const char *path, const tool_log_options *options, timed_poses *t)
{
    cairn_scan_log log;
    int code = tool_load(&log, path, options);

    if (code != TOOL_OK)
        return code;
    if (t->count > log.scans.count)
        code =
            options_refuse(RELATIONS_PROGRAM,
                           "%s holds %" PRId32 " scans, expected one for each of %" PRId32 " poses",
                           path, log.scans.count, t->count);
    for (int32_t i = 0; i < t->count && code == TOOL_OK; i++)
        t->pose[i] = cairn_pose_compose(t->pose[i], log.scans.record[i].scan.base_sensor);
    cairn_scan_log_free(&log);
    return code;
}

static int is_table(const char *path)
{
    size_t length = strlen(path);

    return length > 4 && strcmp(path + length - 4, ".csv") == 0;
}

static void print_relations_json(const cairn_map_quality_relation_errors *e, int64_t used,
                                 int64_t left_out)
{
    cairn_json_writer json = cairn_json_write_begin(stdout);

    cairn_json_write_integer(&json, "relations", used);
    cairn_json_write_integer(&json, "left_out", left_out);
    cairn_json_write_number(&json, "trans_mean_m", (double)e->distance_mean);
    cairn_json_write_number(&json, "trans_sd_m", (double)e->distance_sd);
    cairn_json_write_number(&json, "trans_squared_m2", (double)e->distance_squared);
    cairn_json_write_number(&json, "rot_mean_deg",
                            (double)e->angle_mean * CAIRN_DEGREES_PER_RADIAN);
    cairn_json_write_number(&json, "rot_sd_deg", (double)e->angle_sd * CAIRN_DEGREES_PER_RADIAN);
    cairn_json_write_number(&json, "rot_squared_deg2",
                            (double)e->angle_squared * CAIRN_DEGREES_PER_RADIAN *
                                CAIRN_DEGREES_PER_RADIAN);
    cairn_json_write_end(&json);
}

static void print_relations(const cairn_map_quality_relation_errors *e, int64_t used,
                            int64_t left_out)
{
    printf("relations  %" PRId64 " (%" PRId64 " without both scans ignored)\n"
           "distance   %.4f +- %.4f m, %.4f m^2 squared\n"
           "angle      %.4f +- %.4f degrees, %.4f degrees^2 squared\n",
           used, left_out, (double)e->distance_mean, (double)e->distance_sd,
           (double)e->distance_squared, (double)e->angle_mean * CAIRN_DEGREES_PER_RADIAN,
           (double)e->angle_sd * CAIRN_DEGREES_PER_RADIAN,
           (double)e->angle_squared * CAIRN_DEGREES_PER_RADIAN * CAIRN_DEGREES_PER_RADIAN);
}

static int compare_relations(const char *const arguments[2], const timed_poses *t,
                             cairn_relation_table_row *row, int32_t count, int32_t json)
{
    cairn_map_quality_relation_sums sums = {0, 0, 0, 0, 0};
    cairn_map_quality_relation_errors errors;

    if (cairn_relation_table_find(row, count, t->stamp_ns, t->count) < 0) {
        (void)options_refuse(RELATIONS_PROGRAM, "no memory for %" PRId32 " poses", t->count);
        return TOOL_FAILED;
    }
    for (int32_t k = 0; k < count; k++) {
        const cairn_relation_table_row *r = &row[k];

        if (r->first < 0 || !t->known[r->first] || !t->known[r->second])
            continue;
        if (cairn_map_quality_relation_add(&sums, r->reference, t->pose[r->first],
                                           t->pose[r->second]) != CAIRN_OK)
            return options_refuse(RELATIONS_PROGRAM,
                                  "%s:%" PRId64
                                  ": the relation cannot be compared, expected finite poses",
                                  arguments[1], r->line);
    }
    if (sums.count == 0)
        return options_refuse(RELATIONS_PROGRAM,
                              "no scan of %s is in %s, expected relations between its scans",
                              arguments[0], arguments[1]);
    errors = cairn_map_quality_relation_errors_of(&sums);
    (json ? print_relations_json : print_relations)(&errors, sums.count, count - sums.count);
    return TOOL_OK;
}

int eval_relations(int argc, char **argv)
{
    tool_log_options log_options = {.range_max = 0};
    const char *log = NULL;
    int32_t json = 0;
    const option table[] = {
        OPTION_TEXT("--log", &log, "LOG",
                    "log of the table, for the pose of the sensor on the robot (its origin)"),
        TOOL_LOG_OPTIONS(&log_options.scan_topic, &log_options.odometry_topic,
                         &log_options.scanner),
        OPTION_JSON(&json),
    };
    const option_set set = {
        RELATIONS_PROGRAM, "POSES.csv|LOG FILE.relations [options]",
        "Errors of relative poses against reference relations (Kuemmerle et al. 2009): lines "
        "\"t1 t2 x y z roll pitch yaw\" or \"a b x y theta\". The poses are those of a table, "
        "found by its "
        "times or indices, or those that a log has. Relations are between sensors: poses of a "
        "robot "
        "whose sensor is mounted elsewhere need --log.",
        table, sizeof table / sizeof *table};
    const char *arguments[2] = {NULL, NULL};
    timed_poses poses = {NULL, NULL, NULL, 0};
    size_t count = 2;
    option_result result = options_read(&set, argc, argv, arguments, &count);
    cairn_file_error error;
    cairn_relation_table_row *row;
    int32_t rows;
    int code;

    if (result != OPTIONS_READ)
        return (int)result;
    if (count < 2)
        return options_refuse(RELATIONS_PROGRAM, "%s, expected %s",
                              count == 0 ? "no poses" : "no relations", set.synopsis);
    if (cairn_relation_table_read(&row, &rows, arguments[1], &error) != CAIRN_OK)
        return tool_report(&error);
    code = is_table(arguments[0]) ? poses_of_table(arguments[0], &poses)
                                  : poses_of_log(arguments[0], &log_options, &poses);
    if (code == TOOL_OK && log != NULL && is_table(arguments[0]))
        code = move_to_sensors(log, &log_options, &poses);
    if (code == TOOL_OK)
        code = compare_relations(arguments, &poses, row, rows, json);
    free_timed(&poses);
    cairn_relation_table_free(row);
    return code;
}

/* ---- the command ---- */

static const tool_command parts[] = {
    {"map", "entropy of the map of a log and likelihood of its beams, total and by quadrant",
     eval_map},
    {"poses", "errors E(x), E(y), E(theta) of poses against ground truth", eval_poses},
    {"relations", "errors of relative poses against reference relations", eval_relations},
};

#define PARTS (sizeof parts / sizeof *parts)

int tool_eval(int argc, char **argv)
{
    const char *word = argc > 1 ? argv[1] : "";
    const tool_command *part = tool_command_find(parts, PARTS, word);

    if (part != NULL)
        return part->run(argc - 1, argv + 1);
    if (strcmp(word, "--help") == 0 || strcmp(word, "-h") == 0) {
        printf("usage: cairn eval map|poses|relations ...\n\n");
        tool_commands_print(parts, PARTS, stdout);
        printf("\n  cairn eval map --help   the options of an evaluation\n");
        return TOOL_OK;
    }
    if (strcmp(word, "--version") == 0) {
        options_version();
        return TOOL_OK;
    }
    if (strcmp(word, OPTIONS_TABLE) == 0) {
        tool_commands_table("cairn eval", "Evaluates a map, its poses or relative poses.", parts,
                            PARTS);
        return TOOL_OK;
    }
    if (argc < 2)
        return options_refuse("cairn eval",
                              "nothing to evaluate, expected map, poses or relations");
    return options_refuse("cairn eval", "unknown '%s', expected map, poses or relations", word);
}
