/* Laser scans in CSM's JSON.
 *
 * Method: the file is read whole, its values token by token; the numbers of an object are
 * gathered in lists that serve all objects, and checked against each other at its end. */
#include "src/core/build.h"

#include <stdlib.h>
#include <string.h>

#include "cairn/csm_scan.h"
#include "cairn/json_text.h"
#include "src/host/carmen_log_reader.h"

/* Angles and poses may be so large. */
#define COORDINATE_MOST 1e9

/* Seconds of a stamp: ns that fit into int64. */
#define SECONDS_MOST 9e9

cairn_csm_params cairn_csm_default(void)
{
    cairn_csm_params params = {80, 0.01};

    return params;
}

/* ---- the text of a file ---- */

typedef struct text {
    char *bytes;
    size_t count, room;
} text;

static int append(text *t, const char *line, size_t length)
{
    if (t->room - t->count <= length) {
        size_t room = 2 * (t->count + length + 1);
        char *grown = realloc(t->bytes, room);

        if (grown == NULL)
            return 0;
        t->bytes = grown;
        t->room = room;
    }
    memcpy(t->bytes + t->count, line, length);
    t->bytes[t->count + length] = '\n';
    t->count += length + 1;
    return 1;
}

static cairn_status read_text(text *t, const char *path, cairn_file_error *error)
{
    cairn_line_reader *reader;
    const char *line;
    size_t length;
    cairn_status status = cairn_line_reader_open(&reader, path, error);

    if (status != CAIRN_OK)
        return status;
    while ((status = cairn_line_reader_next(reader, &line, &length, error)) == CAIRN_OK) {
        if (!append(t, line, length)) {
            status =
                cairn_file_error_set(error, CAIRN_NO_MEMORY, path, 0, "no memory for the file");
            break;
        }
    }
    if (status == CAIRN_FULL)
        status = cairn_file_error_set(error, CAIRN_FULL, path, cairn_line_reader_number(reader),
                                      "a line of %zu bytes, expected at most %d", length,
                                      CAIRN_LINE_LONGEST);
    cairn_line_reader_close(reader);
    t->count -= t->count > 0; /* what ends too early ends in the last line */
    return status == CAIRN_EMPTY ? CAIRN_OK : status;
}

/* ---- fields ---- */

enum {
    NRAYS,
    MIN_THETA,
    MAX_THETA,
    THETA,
    READINGS,
    VALID,
    ODOMETRY,
    ESTIMATE,
    TRUE_POSE,
    TIMESTAMP,
    FIELDS
};

typedef struct field_rule {
    const char *name;
    int32_t single;   /* 1: one number, 0: a list, 2: either */
    int32_t nullable; /* 1: null is allowed, and NaN here */
    int32_t truth;    /* 1: true and false are allowed, and 1 and 0 here */
} field_rule;

static const field_rule rules[FIELDS] = {
    {"nrays", 1, 0, 0},     {"min_theta", 1, 0, 0}, {"max_theta", 1, 0, 0}, {"theta", 0, 0, 0},
    {"readings", 0, 1, 0},  {"valid", 0, 1, 1},     {"odometry", 0, 1, 0},  {"estimate", 0, 1, 0},
    {"true_pose", 0, 1, 0}, {"timestamp", 2, 0, 0}};

typedef struct field {
    double *value; /* [count] */
    int32_t count, room;
    int32_t given;
    int32_t is_list;
    int64_t line;
} field;

typedef struct loader {
    const char *path;
    const cairn_csm_params *params;
    cairn_json json;
    field field[FIELDS];
    cairn_csm_scans *scans;
    int32_t room;
    cairn_file_error *error;
} loader;

static cairn_status no_memory(const loader *l)
{
    return cairn_file_error_set(l->error, CAIRN_NO_MEMORY, l->path, 0, "no memory for the scans");
}

static cairn_status push(const loader *l, field *f, int32_t which, double value)
{
    if (f->count == CAIRN_CSM_RAYS_MOST)
        return cairn_file_error_set(
            l->error, CAIRN_FULL, l->path, l->json.line,
            "%s holds more numbers than a scan has rays, expected at most %d", rules[which].name,
            CAIRN_CSM_RAYS_MOST);
    if (f->count == f->room) {
        int32_t room = 2 * f->room + 512;
        double *grown = realloc(f->value, (size_t)room * sizeof *grown);

        if (grown == NULL)
            return no_memory(l);
        f->value = grown;
        f->room = room;
    }
    f->value[f->count++] = value;
    return CAIRN_OK;
}

/* What a number of a field may be. */
static const char *expected_of(const field_rule *rule)
{
    return rule->truth      ? "0, 1, true, false or null"
           : rule->nullable ? "a number or null"
                            : "a number";
}

static cairn_status take(const loader *l, field *f, int32_t which, const cairn_json_token *token)
{
    const field_rule *rule = &rules[which];

    if (token->kind == CAIRN_JSON_NUMBER)
        return push(l, f, which, token->number);
    if (token->kind == CAIRN_JSON_NULL && rule->nullable)
        return push(l, f, which, (double)NAN);
    if ((token->kind == CAIRN_JSON_TRUE || token->kind == CAIRN_JSON_FALSE) && rule->truth)
        return push(l, f, which, token->kind == CAIRN_JSON_TRUE);
    return cairn_file_error_set(l->error, CAIRN_BAD_FORMAT, l->path, token->line,
                                "%s holds something else, expected %s", rule->name,
                                expected_of(rule));
}

static cairn_status read_field(loader *l, int32_t which)
{
    const field_rule *rule = &rules[which];
    field *f = &l->field[which];
    cairn_json_token token;
    cairn_status status = cairn_json_next(&l->json, &token, l->error);

    if (status != CAIRN_OK)
        return status;
    if (f->given)
        return cairn_file_error_set(l->error, CAIRN_BAD_FORMAT, l->path, token.line,
                                    "%s stands twice in one scan, expected once", rule->name);
    f->given = 1;
    f->count = 0;
    f->line = token.line;
    f->is_list = token.kind == CAIRN_JSON_ARRAY;
    if (f->is_list && rule->single == 1)
        return cairn_file_error_set(l->error, CAIRN_BAD_FORMAT, l->path, token.line,
                                    "%s is a list, expected a number", rule->name);
    if (!f->is_list && rule->single == 0)
        return cairn_file_error_set(l->error, CAIRN_BAD_FORMAT, l->path, token.line,
                                    "%s is not a list, expected [ and numbers", rule->name);
    if (!f->is_list)
        return take(l, f, which, &token);
    while ((status = cairn_json_next(&l->json, &token, l->error)) == CAIRN_OK &&
           token.kind != CAIRN_JSON_ARRAY_END) {
        status = take(l, f, which, &token);
        if (status != CAIRN_OK)
            break;
    }
    return status;
}

static cairn_status read_object(loader *l)
{
    cairn_json_token token;
    cairn_status status;
    int32_t i;

    for (i = 0; i < FIELDS; i++)
        l->field[i].given = 0;
    while ((status = cairn_json_next(&l->json, &token, l->error)) == CAIRN_OK &&
           token.kind == CAIRN_JSON_NAME) {
        for (i = 0; i < FIELDS && !cairn_json_is(&token, rules[i].name); i++)
            continue;
        status = i < FIELDS ? read_field(l, i) : cairn_json_skip(&l->json, l->error);
        if (status != CAIRN_OK)
            break;
    }
    return status;
}

/* ---- from fields to a scan ---- */

static cairn_status check_count(const loader *l, int32_t which, int32_t count)
{
    const field *f = &l->field[which];

    if (!f->given || f->count == count)
        return CAIRN_OK;
    return cairn_file_error_set(l->error, CAIRN_BAD_FORMAT, l->path, f->line,
                                "%s holds %d numbers, expected %d", rules[which].name,
                                (int)f->count, (int)count);
}

static cairn_status check_size(const loader *l, int32_t which)
{
    const field *f = &l->field[which];
    int32_t i;

    for (i = 0; i < f->count && f->given; i++)
        if (fabs(f->value[i]) > COORDINATE_MOST)
            return cairn_file_error_set(l->error, CAIRN_BAD_FORMAT, l->path, f->line,
                                        "%s holds %g, expected at most 1e9 either way",
                                        rules[which].name, f->value[i]);
    return CAIRN_OK;
}

static cairn_status check_object(const loader *l, int64_t line)
{
    const field *f = l->field;
    cairn_status status = CAIRN_OK;
    int32_t i, rays;

    if (!f[NRAYS].given || !f[READINGS].given)
        return cairn_file_error_set(l->error, CAIRN_BAD_FORMAT, l->path, line,
                                    "a scan without %s, expected one",
                                    f[NRAYS].given ? "readings" : "nrays");
    if (!f[THETA].given && !(f[MIN_THETA].given && f[MAX_THETA].given))
        return cairn_file_error_set(
            l->error, CAIRN_BAD_FORMAT, l->path, line,
            "a scan without directions, expected theta or min_theta and max_theta");
    if (!(f[NRAYS].value[0] >= 1 && f[NRAYS].value[0] <= CAIRN_CSM_RAYS_MOST) ||
        f[NRAYS].value[0] != floor(f[NRAYS].value[0]))
        return cairn_file_error_set(l->error, CAIRN_BAD_FORMAT, l->path, f[NRAYS].line,
                                    "nrays is %g, expected a whole number from 1 to %d",
                                    f[NRAYS].value[0], CAIRN_CSM_RAYS_MOST);
    rays = (int32_t)f[NRAYS].value[0];
    for (i = THETA; i <= VALID && status == CAIRN_OK; i++)
        status = check_count(l, i, rays);
    for (i = ODOMETRY; i <= TRUE_POSE && status == CAIRN_OK; i++)
        status = check_count(l, i, 3);
    for (i = MIN_THETA; i <= TRUE_POSE && status == CAIRN_OK; i++)
        if (i != READINGS && i != VALID)
            status = check_size(l, i);
    return status;
}

/* 1 and a pose when it is known whole. */
static int32_t pose_of(const field *f, cairn_pose *pose)
{
    *pose = cairn_pose_identity();
    if (!f->given || !(fabs(f->value[0]) >= 0) || !(fabs(f->value[1]) >= 0) ||
        !(fabs(f->value[2]) >= 0))
        return 0;
    pose->x = (cairn_real)f->value[0];
    pose->y = (cairn_real)f->value[1];
    pose->theta = (cairn_real)remainder(f->value[2], 2 * (double)CAIRN_PI);
    return 1;
}

static cairn_status stamp_of(const loader *l, cairn_csm_scan *scan)
{
    const field *f = &l->field[TIMESTAMP];
    double seconds, micros;

    if (!f->given)
        return CAIRN_OK;
    if (f->is_list && f->count != 2)
        return check_count(l, TIMESTAMP, 2);
    seconds = f->value[0];
    micros = f->is_list ? f->value[1] : 0;
    if (!(fabs(seconds) <= SECONDS_MOST) || !(fabs(micros) <= SECONDS_MOST))
        return cairn_file_error_set(l->error, CAIRN_BAD_FORMAT, l->path, f->line,
                                    "timestamp holds %g, expected s and us within 9e9",
                                    fabs(seconds) <= SECONDS_MOST ? micros : seconds);
    scan->has_stamp = 1;
    scan->scan.stamp_ns = (int64_t)floor(seconds) * 1000000000 +
                          (int64_t)rint((seconds - floor(seconds)) * 1e9) +
                          (int64_t)rint(micros * 1000);
    return CAIRN_OK;
}

/* Ranges, then angles, in one array. */
static float *beams_of(const loader *l, int32_t rays)
{
    const field *reading = &l->field[READINGS], *theta = &l->field[THETA],
                *valid = &l->field[VALID];
    double first = l->field[MIN_THETA].given ? l->field[MIN_THETA].value[0] : 0;
    double span = l->field[MAX_THETA].given ? l->field[MAX_THETA].value[0] - first : 0;
    float *beam = malloc(2 * (size_t)rays * sizeof *beam);
    int32_t i;

    for (i = 0; i < rays && beam != NULL; i++) {
        double range = reading->value[i];

        if (!(range > 0) || (valid->given && !(fabs(valid->value[i]) > 0)))
            range = (double)NAN;
        else if (range >= l->params->range_max)
            range = (double)INFINITY;
        beam[i] = (float)range;
        beam[rays + i] = (float)(theta->given ? theta->value[i]
                                 : rays > 1   ? first + span * i / (rays - 1)
                                              : first);
    }
    return beam;
}

static cairn_status add_scan(loader *l, int64_t line)
{
    cairn_csm_scans *scans = l->scans;
    cairn_csm_scan scan;
    int32_t rays;
    float *beam;
    cairn_status status = check_object(l, line);

    if (status != CAIRN_OK)
        return status;
    memset(&scan, 0, sizeof scan);
    scan.line = line;
    status = stamp_of(l, &scan);
    if (status != CAIRN_OK)
        return status;
    if (scans->count == l->room) {
        int32_t room = 2 * l->room + 16;
        cairn_csm_scan *grown = realloc(scans->scan, (size_t)room * sizeof *grown);

        if (grown == NULL)
            return no_memory(l);
        scans->scan = grown;
        l->room = room;
    }
    rays = (int32_t)l->field[NRAYS].value[0];
    beam = beams_of(l, rays);
    if (beam == NULL)
        return no_memory(l);
    scan.scan.range = beam;
    scan.scan.angle = beam + rays;
    scan.scan.count = rays;
    scan.scan.range_max = (float)l->params->range_max;
    scan.scan.range_sigma = (float)l->params->range_sigma;
    scan.has_odometry = pose_of(&l->field[ODOMETRY], &scan.odometry);
    scan.has_estimate = pose_of(&l->field[ESTIMATE], &scan.estimate);
    scan.has_true_pose = pose_of(&l->field[TRUE_POSE], &scan.true_pose);
    scans->scan[scans->count++] = scan;
    scans->rays_most = rays > scans->rays_most ? rays : scans->rays_most;
    return CAIRN_OK;
}

/* ---- files ---- */

static cairn_status read_scans(loader *l)
{
    cairn_json_token token;
    cairn_status status;

    while ((status = cairn_json_next(&l->json, &token, l->error)) == CAIRN_OK &&
           token.kind != CAIRN_JSON_END) {
        if (token.kind != CAIRN_JSON_OBJECT)
            return cairn_file_error_set(l->error, CAIRN_BAD_FORMAT, l->path, token.line,
                                        "not an object, expected { and the fields of a scan");
        status = read_object(l);
        if (status == CAIRN_OK)
            status = add_scan(l, token.line);
        if (status != CAIRN_OK)
            return status;
    }
    if (status == CAIRN_OK && l->scans->count == 0)
        return cairn_file_error_set(l->error, CAIRN_EMPTY, l->path, 0,
                                    "no scan, expected at least one");
    return status;
}

cairn_status cairn_csm_load(cairn_csm_scans *scans, const char *path,
                            const cairn_csm_params *params, cairn_file_error *error)
{
    cairn_csm_params standard = cairn_csm_default();
    text t = {NULL, 0, 0};
    loader l;
    cairn_status status;
    int32_t i;

    memset(scans, 0, sizeof *scans);
    memset(&l, 0, sizeof l);
    l.path = path;
    l.params = params != NULL ? params : &standard;
    l.scans = scans;
    l.error = error;
    if (!(l.params->range_max > 0) || !(l.params->range_max <= (double)CAIRN_SCAN_EXTENT) ||
        !(l.params->range_sigma >= 0) || !(l.params->range_sigma <= (double)CAIRN_SCAN_EXTENT))
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "range_max %g and range_sigma %g, expected above 0 and not below 0",
            l.params->range_max, l.params->range_sigma);
    status = read_text(&t, path, error);
    if (status == CAIRN_OK) {
        l.json = cairn_json_begin(path, t.bytes != NULL ? t.bytes : "", t.count);
        status = read_scans(&l);
    }
    for (i = 0; i < FIELDS; i++)
        free(l.field[i].value);
    free(t.bytes);
    if (status != CAIRN_OK)
        cairn_csm_scans_free(scans);
    return status;
}

void cairn_csm_scans_free(cairn_csm_scans *scans)
{
    int32_t i;

    for (i = 0; i < scans->count; i++)
        free((float *)scans->scan[i].scan.range);
    free(scans->scan);
    memset(scans, 0, sizeof *scans);
}
