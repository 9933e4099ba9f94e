/* Reader of laser scans in CSM's JSON.
 *
 * Method
 * 1. The whole file is read into memory.
 * 2. The values of an object are read token by token into one array for each field. The arrays are
 *    reused for all objects.
 * 3. At the end of an object its fields are validated against each other and converted to a
 * scan. */
#include "src/base/build.h"

#include <stdlib.h>
#include <string.h>

#include "cairn/csm_scan.h"
#include "cairn/json_text.h"
#include "src/host/logs/carmen_log_reader.h"
#include "src/host/logs/log_origin.h"
#include "src/host/logs/log_parameters.h"

/* Largest accepted magnitude of angles and poses, in rad and m. */
#define MAX_COORDINATE 1e9

/* Largest magnitude of a stamp in seconds: CAIRN_SCAN_MAX_STAMP_NS. */
#define MAX_SECONDS 4e9

static const cairn_host_parameter rows[] = {
    LOG_PARAMETERS(cairn_csm_scan_params),
};

const cairn_host_parameters cairn_csm_scan_parameters =
    CAIRN_HOST_PARAMETERS(cairn_csm_scan_params, rows);

cairn_csm_scan_params cairn_csm_scan_default(void)
{
    cairn_csm_scan_params params;

    cairn_host_parameters_preset(&cairn_csm_scan_parameters, &params);
    return params;
}

/* ---- the text of a file ---- */

typedef struct file_text {
    char *bytes; /* [count] of [capacity] */
    size_t count, capacity;
} file_text;

/* Appends a line and a line end; 0 when out of memory. */
static int append(file_text *text, const char *line, size_t length)
{
    if (text->capacity - text->count <= length) {
        size_t capacity = 2 * (text->count + length + 1);
        char *grown = realloc(text->bytes, capacity);

        if (grown == NULL)
            return 0;
        text->bytes = grown;
        text->capacity = capacity;
    }
    memcpy(text->bytes + text->count, line, length);
    text->bytes[text->count + length] = '\n';
    text->count += length + 1;
    return 1;
}

/* Reads a whole file, plain or gzipped. */
static cairn_status read_text(file_text *text, const char *path, cairn_file_error *error)
{
    cairn_line_reader *reader;
    const char *line;
    size_t length;
    cairn_status status = cairn_line_reader_open(&reader, path, error);

    if (status != CAIRN_OK)
        return status;
    while ((status = cairn_line_reader_next(reader, &line, &length, error)) == CAIRN_OK) {
        if (!append(text, line, length)) {
            status =
                cairn_file_error_set(error, CAIRN_NO_MEMORY, path, 0, "no memory for the file");
            break;
        }
    }
    if (status == CAIRN_FULL)
        status = cairn_file_error_set(error, CAIRN_FULL, path, cairn_line_reader_number(reader),
                                      "a line of %zu bytes, expected at most %d", length,
                                      CAIRN_LINE_READER_MAX_BYTES);
    cairn_line_reader_close(reader);
    /* the last line end is dropped, so that an early end is reported in the last line */
    text->count -= text->count > 0;
    return status == CAIRN_EMPTY ? CAIRN_OK : status;
}

/* ---- fields ---- */

enum {
    FIELD_NRAYS,
    MIN_THETA,
    MAX_THETA,
    FIELD_THETA,
    FIELD_READINGS,
    FIELD_VALID,
    FIELD_ODOMETRY,
    FIELD_ESTIMATE,
    TRUE_POSE,
    FIELD_TIMESTAMP,
    FIELD_COUNT
};

/* The syntax of a field. */
typedef struct field_rule {
    const char *name;
    int32_t single;   /* 1: a number, 0: an array, 2: either */
    int32_t nullable; /* 1: null is allowed and becomes NaN */
    int32_t truth;    /* 1: true and false are allowed and become 1 and 0 */
} field_rule;

static const field_rule rules[FIELD_COUNT] = {
    {"nrays", 1, 0, 0},     {"min_theta", 1, 0, 0}, {"max_theta", 1, 0, 0}, {"theta", 0, 0, 0},
    {"readings", 0, 1, 0},  {"valid", 0, 1, 1},     {"odometry", 0, 1, 0},  {"estimate", 0, 1, 0},
    {"true_pose", 0, 1, 0}, {"timestamp", 2, 0, 0}};

/* The values of one field of the current object. */
typedef struct csm_field {
    double *value; /* [count] of [capacity] */
    int32_t count, capacity;
    int32_t given;   /* 1: the object has this field */
    int32_t is_list; /* 1: an array, 0: a single value */
    int64_t line;    /* of its value */
} csm_field;

/* State of the reader. */
typedef struct csm_loader {
    const char *path;
    const cairn_csm_scan_params *params;
    cairn_json json;
    csm_field field[FIELD_COUNT];
    cairn_csm_scan_list *scans;
    int32_t has_origin;
    int32_t capacity; /* of scans->scan */
    cairn_file_error *error;
} csm_loader;

static cairn_status no_memory(const csm_loader *loader)
{
    return cairn_file_error_set(loader->error, CAIRN_NO_MEMORY, loader->path, 0,
                                "no memory for the scans");
}

/* Appends a value to a field. */
static cairn_status append_value(const csm_loader *loader, csm_field *field, int32_t which,
                                 double value)
{
    if (field->count == CAIRN_CSM_SCAN_MAX_RAYS)
        return cairn_file_error_set(
            loader->error, CAIRN_FULL, loader->path, loader->json.line,
            "%s holds more numbers than a scan has rays, expected at most %d", rules[which].name,
            CAIRN_CSM_SCAN_MAX_RAYS);
    if (field->count == field->capacity) {
        int32_t capacity = 2 * field->capacity + 512;
        double *grown = realloc(field->value, (size_t)capacity * sizeof *grown);

        if (grown == NULL)
            return no_memory(loader);
        field->value = grown;
        field->capacity = capacity;
    }
    field->value[field->count++] = value;
    return CAIRN_OK;
}

/* Describes the values that a field accepts, for an error text. */
static const char *describe_values(const field_rule *rule)
{
    return rule->truth      ? "0, 1, true, false or null"
           : rule->nullable ? "a number or null"
                            : "a number";
}

/* Converts a token to a value of a field and appends it. */
static cairn_status accept_value(const csm_loader *loader, csm_field *field, int32_t which,
                                 const cairn_json_token *token)
{
    const field_rule *rule = &rules[which];

    if (token->kind == CAIRN_JSON_NUMBER)
        return append_value(loader, field, which, token->number);
    if (token->kind == CAIRN_JSON_NULL && rule->nullable)
        return append_value(loader, field, which, (double)NAN);
    if ((token->kind == CAIRN_JSON_TRUE || token->kind == CAIRN_JSON_FALSE) && rule->truth)
        return append_value(loader, field, which, token->kind == CAIRN_JSON_TRUE);
    return cairn_file_error_set(loader->error, CAIRN_BAD_FORMAT, loader->path, token->line,
                                "%s has a value of another type, expected %s", rule->name,
                                describe_values(rule));
}

/* Reads the value of a field after its name. */
static cairn_status read_field(csm_loader *loader, int32_t which)
{
    const field_rule *rule = &rules[which];
    csm_field *field = &loader->field[which];
    cairn_json_token token;
    cairn_status status = cairn_json_next(&loader->json, &token, loader->error);

    if (status != CAIRN_OK)
        return status;
    if (field->given)
        return cairn_file_error_set(loader->error, CAIRN_BAD_FORMAT, loader->path, token.line,
                                    "%s is duplicated in a scan, expected once", rule->name);
    field->given = 1;
    field->count = 0;
    field->line = token.line;
    field->is_list = token.kind == CAIRN_JSON_ARRAY;
    if (field->is_list && rule->single == 1)
        return cairn_file_error_set(loader->error, CAIRN_BAD_FORMAT, loader->path, token.line,
                                    "%s is a list, expected a number", rule->name);
    if (!field->is_list && rule->single == 0)
        return cairn_file_error_set(loader->error, CAIRN_BAD_FORMAT, loader->path, token.line,
                                    "%s is not a list, expected [ and numbers", rule->name);
    if (!field->is_list)
        return accept_value(loader, field, which, &token);
    while ((status = cairn_json_next(&loader->json, &token, loader->error)) == CAIRN_OK &&
           token.kind != CAIRN_JSON_ARRAY_END) {
        status = accept_value(loader, field, which, &token);
        if (status != CAIRN_OK)
            break;
    }
    return status;
}

/* Reads the fields of one object. */
static cairn_status read_object(csm_loader *loader)
{
    cairn_json_token token;
    cairn_status status;
    int32_t i;

    for (i = 0; i < FIELD_COUNT; i++)
        loader->field[i].given = 0;
    while ((status = cairn_json_next(&loader->json, &token, loader->error)) == CAIRN_OK &&
           token.kind == CAIRN_JSON_NAME) {
        for (i = 0; i < FIELD_COUNT && !cairn_json_is(&token, rules[i].name); i++)
            continue;
        status =
            i < FIELD_COUNT ? read_field(loader, i) : cairn_json_skip(&loader->json, loader->error);
        if (status != CAIRN_OK)
            break;
    }
    return status;
}

/* ---- from fields to a scan ---- */

/* Checks that a field has `count` numbers, if the object has it. */
static cairn_status check_count(const csm_loader *loader, int32_t which, int32_t count)
{
    const csm_field *field = &loader->field[which];

    if (!field->given || field->count == count)
        return CAIRN_OK;
    return cairn_file_error_set(loader->error, CAIRN_BAD_FORMAT, loader->path, field->line,
                                "%s holds %d numbers, expected %d", rules[which].name,
                                (int)field->count, (int)count);
}

/* Checks the magnitude of a field's numbers. */
static cairn_status check_size(const csm_loader *loader, int32_t which)
{
    const csm_field *field = &loader->field[which];
    int32_t i;

    for (i = 0; i < field->count && field->given; i++)
        if (fabs(field->value[i]) > MAX_COORDINATE)
            return cairn_file_error_set(loader->error, CAIRN_BAD_FORMAT, loader->path, field->line,
                                        "%s holds %g, expected at most 1e9 either way",
                                        rules[which].name, field->value[i]);
    return CAIRN_OK;
}

/* Validates the fields of an object against each other. */
static cairn_status check_object(const csm_loader *loader, int64_t line)
{
    const csm_field *field = loader->field;
    cairn_status status = CAIRN_OK;
    int32_t i, rays;

    if (!field[FIELD_NRAYS].given || !field[FIELD_READINGS].given)
        return cairn_file_error_set(loader->error, CAIRN_BAD_FORMAT, loader->path, line,
                                    "a scan without %s, expected one",
                                    field[FIELD_NRAYS].given ? "readings" : "nrays");
    if (!field[FIELD_THETA].given && !(field[MIN_THETA].given && field[MAX_THETA].given))
        return cairn_file_error_set(
            loader->error, CAIRN_BAD_FORMAT, loader->path, line,
            "a scan without directions, expected theta or min_theta and max_theta");
    if (!(field[FIELD_NRAYS].value[0] >= 1 &&
          field[FIELD_NRAYS].value[0] <= CAIRN_CSM_SCAN_MAX_RAYS) ||
        field[FIELD_NRAYS].value[0] != floor(field[FIELD_NRAYS].value[0]))
        return cairn_file_error_set(loader->error, CAIRN_BAD_FORMAT, loader->path,
                                    field[FIELD_NRAYS].line,
                                    "nrays is %g, expected a whole number from 1 to %d",
                                    field[FIELD_NRAYS].value[0], CAIRN_CSM_SCAN_MAX_RAYS);
    rays = (int32_t)field[FIELD_NRAYS].value[0];
    for (i = FIELD_THETA; i <= FIELD_VALID && status == CAIRN_OK; i++)
        status = check_count(loader, i, rays);
    for (i = FIELD_ODOMETRY; i <= TRUE_POSE && status == CAIRN_OK; i++)
        status = check_count(loader, i, 3);
    for (i = MIN_THETA; i <= TRUE_POSE && status == CAIRN_OK; i++)
        if (i != FIELD_READINGS && i != FIELD_VALID)
            status = check_size(loader, i);
    return status;
}

/* Reads a pose; 1 when all its numbers are known, otherwise 0 and the identity. */
static int32_t read_pose(csm_loader *loader, int32_t key, cairn_pose *pose)
{
    const csm_field *field = &loader->field[key];
    double position[2];

    *pose = cairn_pose_identity();
    if (!field->given || !(fabs(field->value[0]) >= 0) || !(fabs(field->value[1]) >= 0) ||
        !(fabs(field->value[2]) >= 0))
        return 0;
    memcpy(position, field->value, sizeof position);
    if (!loader->has_origin)
        log_origin_set(loader->scans->origin, position);
    loader->has_origin = 1;
    log_origin_take(loader->scans->origin, position);
    pose->x = (cairn_real)position[0];
    pose->y = (cairn_real)position[1];
    pose->theta = (cairn_real)remainder(field->value[2], 2 * (double)CAIRN_PI);
    return 1;
}

/* Converts the timestamp to nanoseconds. */
static cairn_status read_stamp(const csm_loader *loader, cairn_csm_scan *scan)
{
    const csm_field *field = &loader->field[FIELD_TIMESTAMP];
    double seconds, micros;

    if (!field->given)
        return CAIRN_OK;
    if (field->is_list && field->count != 2)
        return check_count(loader, FIELD_TIMESTAMP, 2);
    seconds = field->value[0];
    micros = field->is_list ? field->value[1] : 0;
    if (!(fabs(seconds) <= MAX_SECONDS) || !(fabs(micros) <= MAX_SECONDS) ||
        !(fabs(seconds + micros * 1e-6) <= MAX_SECONDS))
        return cairn_file_error_set(loader->error, CAIRN_BAD_FORMAT, loader->path, field->line,
                                    "timestamp holds %g, expected s and us within 4e9",
                                    fabs(micros) <= MAX_SECONDS ? seconds : micros);
    scan->has_stamp = 1;
    scan->scan.stamp_ns = (int64_t)floor(seconds) * 1000000000 +
                          (int64_t)rint((seconds - floor(seconds)) * 1e9) +
                          (int64_t)rint(micros * 1000);
    return CAIRN_OK;
}

/* Returns a heap array of [2 * rays]: ranges in m, then bearings in rad. NULL: out of memory. */
static float *make_beams(const csm_loader *loader, int32_t rays)
{
    const csm_field *reading = &loader->field[FIELD_READINGS], *theta = &loader->field[FIELD_THETA],
                    *valid = &loader->field[FIELD_VALID];
    double first = loader->field[MIN_THETA].given ? loader->field[MIN_THETA].value[0] : 0;
    double span = loader->field[MAX_THETA].given ? loader->field[MAX_THETA].value[0] - first : 0;
    float *beam = malloc(2 * (size_t)rays * sizeof *beam);
    int32_t i;

    for (i = 0; i < rays && beam != NULL; i++) {
        double range = reading->value[i];

        if (!(range > 0) || (valid->given && !(fabs(valid->value[i]) > 0)))
            range = (double)NAN;
        else if (range >= loader->scans->range_max)
            range = (double)INFINITY;
        beam[i] = (float)range;
        beam[rays + i] = (float)(theta->given ? theta->value[i]
                                 : rays > 1   ? first + span * i / (rays - 1)
                                              : first);
    }
    return beam;
}

/* Converts the current object to a scan and appends it. */
static cairn_status add_scan(csm_loader *loader, int64_t line)
{
    cairn_csm_scan_list *scans = loader->scans;
    cairn_csm_scan scan;
    int32_t rays;
    float *beam;
    cairn_status status = check_object(loader, line);

    if (status != CAIRN_OK)
        return status;
    memset(&scan, 0, sizeof scan);
    scan.line = line;
    status = read_stamp(loader, &scan);
    if (status != CAIRN_OK)
        return status;
    if (scans->count == loader->capacity) {
        int32_t capacity = 2 * loader->capacity + 16;
        cairn_csm_scan *grown = realloc(scans->scan, (size_t)capacity * sizeof *grown);

        if (grown == NULL)
            return no_memory(loader);
        scans->scan = grown;
        loader->capacity = capacity;
    }
    rays = (int32_t)loader->field[FIELD_NRAYS].value[0];
    beam = make_beams(loader, rays);
    if (beam == NULL)
        return no_memory(loader);
    scan.scan.range = beam;
    scan.scan.angle = beam + rays;
    scan.scan.count = rays;
    scan.scan.range_max = (float)loader->scans->range_max;
    scan.scan.range_sigma = (float)loader->params->range_sigma;
    scan.has_odometry = read_pose(loader, FIELD_ODOMETRY, &scan.odometry);
    scan.has_estimate = read_pose(loader, FIELD_ESTIMATE, &scan.estimate);
    scan.has_true_pose = read_pose(loader, TRUE_POSE, &scan.true_pose);
    scans->scan[scans->count++] = scan;
    scans->max_rays = rays > scans->max_rays ? rays : scans->max_rays;
    return CAIRN_OK;
}

/* ---- files ---- */

/* Reads all objects. */
static cairn_status read_scans(csm_loader *loader)
{
    cairn_json_token token;
    cairn_status status;

    while ((status = cairn_json_next(&loader->json, &token, loader->error)) == CAIRN_OK &&
           token.kind != CAIRN_JSON_END) {
        if (token.kind != CAIRN_JSON_OBJECT)
            return cairn_file_error_set(loader->error, CAIRN_BAD_FORMAT, loader->path, token.line,
                                        "not an object, expected { and the fields of a scan");
        status = read_object(loader);
        if (status == CAIRN_OK)
            status = add_scan(loader, token.line);
        if (status != CAIRN_OK)
            return status;
    }
    if (status == CAIRN_OK && loader->scans->count == 0)
        return cairn_file_error_set(loader->error, CAIRN_EMPTY, loader->path, 0,
                                    "no scan, expected at least one");
    return status;
}

cairn_status cairn_csm_scan_load(cairn_csm_scan_list *scans, const char *path,
                                 const cairn_csm_scan_params *params, cairn_file_error *error)
{
    cairn_csm_scan_params standard = cairn_csm_scan_default();
    file_text text = {.bytes = NULL};
    csm_loader loader;
    cairn_status status;
    int32_t i;

    memset(scans, 0, sizeof *scans);
    memset(&loader, 0, sizeof loader);
    loader.path = path;
    loader.params = params != NULL ? params : &standard;
    loader.scans = scans;
    loader.error = error;
    status = cairn_host_parameters_check(&cairn_csm_scan_parameters, loader.params, path, error);
    if (status != CAIRN_OK)
        return status;
    scans->range_max =
        loader.params->range_max > 0 ? loader.params->range_max : LOG_DEFAULT_RANGE_MAX_M;
    status = read_text(&text, path, error);
    if (status == CAIRN_OK) {
        loader.json = cairn_json_begin(path, text.bytes != NULL ? text.bytes : "", text.count);
        status = read_scans(&loader);
    }
    for (i = 0; i < FIELD_COUNT; i++)
        free(loader.field[i].value);
    free(text.bytes);
    if (status != CAIRN_OK)
        cairn_csm_scan_list_free(scans);
    return status;
}

void cairn_csm_scan_list_free(cairn_csm_scan_list *scans)
{
    int32_t i;

    for (i = 0; i < scans->count; i++)
        free((float *)scans->scan[i].scan.range);
    free(scans->scan);
    memset(scans, 0, sizeof *scans);
}
