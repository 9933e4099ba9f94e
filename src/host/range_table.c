/* Tables of ranges as logs.
 *
 * Layout: the bearings stand once in front of all ranges, in one array that the scans give back;
 * records point into it when all is read, as it moves while it grows. */
#include "src/core/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/number_text.h"
#include "cairn/range_table.h"
#include "src/host/carmen_log_reader.h"

enum { URG_FIELDS = 707, URG_FIRST = 25, URG_MIDDLE = 341, PROBED_LINES = 100 };

static const double URG_STEP = 360.0 / 1024, URG_RANGE_MIN = 0.02, URG_RANGE_MAX = 5.6,
                    URG_TURN = 0.1, CSV_RANGE_MAX = 80, RADIANS = 0.017453292519943295;
/* The robot of these logs, see the header: m that a wheel rolls in a tick, m between the wheels,
 * m of the scanner before their axle. */
static const double URG_TICK = 2 * 3.141592653589793 * 0.077 / 2000, URG_AXLE = 0.31,
                    URG_AHEAD = 0.145;
/* a line's scan was made so long before its ticks were read */
static const int64_t URG_LATE_NS = 170000000;
/* between scans whose time is not known */
static const int64_t SCAN_NS = 100000000;

/* What a column holds; a head of CSV can name those before NAMED, and bearings. */
enum { TIME, X, Y, THETA, NAMED, LEFT = NAMED, RIGHT, BEARING, PASSED };

typedef struct table {
    cairn_range_table_kind kind;
    int32_t *column; /* [fields] */
    int32_t fields;
    int32_t has_time, has_odometry;
    double time_unit, range_unit; /* ns and m */
    float *bearing;               /* [beams] rad */
    int32_t beams;
    double *value;               /* [fields] of the line at hand */
    double wheels[2], rolled[3]; /* ticks of the line before, and x, y, theta where they led */
    int32_t rolls;               /* 1: there was one */
} table;

typedef struct loading {
    cairn_carmen_scans *scans;
    const cairn_carmen_params *params;
    table table;
    int32_t capacity;
    cairn_line_reader *reader;
    const char *path;
} loading;

static void free_table(table *t)
{
    free(t->column);
    free(t->bearing);
    free(t->value);
}

static int make_table(table *t, int32_t fields)
{
    t->fields = fields;
    t->column = calloc((size_t)fields, sizeof *t->column);
    t->bearing = calloc((size_t)fields, sizeof *t->bearing);
    t->value = calloc((size_t)fields, sizeof *t->value);
    return t->column != NULL && t->bearing != NULL && t->value != NULL;
}

/* ---- Fields ---- */

/* The next field up to a comma, without blanks about it; 0 when there is none. */
static int next_cell(const char **at, const char *end, const char **cell, size_t *length)
{
    const char *from = *at, *to;

    if (from == NULL)
        return 0;
    to = memchr(from, ',', (size_t)(end - from));
    *at = to != NULL ? to + 1 : NULL;
    if (to == NULL)
        to = end;
    for (; from < to && (*from == ' ' || *from == '\t'); from++)
        ;
    for (; to > from && (to[-1] == ' ' || to[-1] == '\t'); to--)
        ;
    *cell = from;
    *length = (size_t)(to - from);
    return 1;
}

static int next_field(const table *t, const char **at, const char *end, const char **field,
                      size_t *length)
{
    if (t->kind == CAIRN_RANGE_TABLE_CSV)
        return next_cell(at, end, field, length);
    *length = cairn_token_next(at, end, field);
    return *length > 0;
}

static int is_text(const char *line, size_t length)
{
    const char *at = line, *token;

    return cairn_token_next(&at, line + length, &token) > 0 && token[0] != '#';
}

/* ---- The head ---- */

/* The column of a name; -1: none. */
static int32_t column_of(const char *name, size_t length, double *degrees)
{
    static const char *const names[NAMED] = {"time", "x", "y", "theta"};

    for (int32_t k = 0; k < NAMED; k++)
        if (strlen(names[k]) == length && memcmp(names[k], name, length) == 0)
            return k;
    return cairn_number_read(name, length, degrees) && fabs(*degrees) <= 360 ? BEARING : -1;
}

/* 1 when a line can be the head of a table. */
static int is_head(const char *line, size_t length)
{
    const char *at = line, *cell;
    int32_t fields = 0, bearings = 0;
    double degrees;
    size_t n;

    while (next_cell(&at, line + length, &cell, &n)) {
        int32_t column = column_of(cell, n, &degrees);

        if (column < 0)
            return 0;
        fields++;
        bearings += column == BEARING;
    }
    return bearings > 0 && fields > 1;
}

static int32_t count_fields(const char *line, size_t length)
{
    const char *at = line, *token;
    int32_t count = 0;

    while (cairn_token_next(&at, line + length, &token) > 0)
        count++;
    return count;
}

static cairn_status read_head(loading *l, const char *line, size_t length, cairn_file_error *error)
{
    int64_t number = cairn_line_reader_number(l->reader);
    table *t = &l->table;
    const char *at = line, *cell;
    int32_t seen[NAMED] = {0}, fields = 1;
    size_t n;

    for (size_t i = 0; i < length; i++)
        fields += line[i] == ',';
    if (!make_table(t, fields))
        return cairn_file_error_system(error, l->path, "read", ENOMEM);
    for (int32_t i = 0; next_cell(&at, line + length, &cell, &n); i++) {
        char text[CAIRN_TOKEN_TEXT_BYTES];
        double degrees = 0;
        int32_t column = column_of(cell, n, &degrees);

        if (column < 0 || (column < NAMED && seen[column]++ > 0))
            return cairn_file_error_set(
                error, CAIRN_BAD_FORMAT, l->path, number,
                "column %s, expected time, x, y, theta, each once, or a bearing in degrees",
                cairn_token_text(text, cell, n));
        t->column[i] = column;
        if (column == BEARING)
            t->bearing[t->beams++] = (float)(degrees * RADIANS);
    }
    if (seen[X] + seen[Y] + seen[THETA] != 3 * seen[X])
        return cairn_file_error_set(error, CAIRN_BAD_FORMAT, l->path, number,
                                    "only some of x, y and theta, expected all");
    if (t->beams == 0 || t->beams > CAIRN_CARMEN_BEAMS_MOST)
        return cairn_file_error_set(error, CAIRN_BAD_FORMAT, l->path, number,
                                    "%d bearings, expected 1 to %d", t->beams,
                                    CAIRN_CARMEN_BEAMS_MOST);
    t->has_time = seen[TIME];
    t->has_odometry = seen[X];
    t->time_unit = 1e9;
    t->range_unit = 1;
    return CAIRN_OK;
}

static cairn_status make_urg(loading *l, cairn_file_error *error)
{
    table *t = &l->table;

    if (!make_table(t, URG_FIELDS))
        return cairn_file_error_system(error, l->path, "read", ENOMEM);
    for (int32_t i = 0; i < URG_FIELDS; i++)
        t->column[i] = PASSED;
    t->column[0] = TIME;
    t->column[2] = LEFT;
    t->column[3] = RIGHT;
    for (int32_t i = URG_FIRST; i < URG_FIELDS; i++) {
        t->column[i] = BEARING;
        t->bearing[t->beams] = (float)((t->beams - URG_MIDDLE) * URG_STEP * RADIANS);
        t->beams++;
    }
    t->has_time = 1;
    t->time_unit = 1e3;
    t->range_unit = 1e-3;
    return CAIRN_OK;
}

/* ---- Scans ---- */

/* Reads the fields of a line; the words of a fault, or NULL. */
static const char *read_values(table *t, const char *line, size_t length)
{
    const char *at = line, *field;
    int32_t count = 0;
    size_t n;

    for (; next_field(t, &at, line + length, &field, &n); count++) {
        if (count == t->fields)
            return "too many fields";
        t->value[count] = 0;
        if (t->column[count] == PASSED || (n == 0 && t->column[count] == BEARING))
            continue;
        if (!cairn_number_read(field, n, &t->value[count]))
            return "a field that is no number";
        if (t->column[count] < BEARING && !(fabs(t->value[count]) <= 1e15))
            return "a time, pose or tick that is not finite";
    }
    return count < t->fields ? "too few fields" : NULL;
}

static int grow(loading *l)
{
    cairn_carmen_scans *s = l->scans;
    int32_t capacity = l->capacity > 0 ? 2 * l->capacity : 256;
    size_t beams = (size_t)l->table.beams;
    cairn_carmen_record *record;
    float *range;

    if (s->count < l->capacity)
        return 1;
    if (l->capacity > INT32_MAX / 2)
        return 0;
    record = realloc(s->record, (size_t)capacity * sizeof *record);
    if (record != NULL)
        s->record = record;
    range = realloc(s->range, ((size_t)capacity + 1) * beams * sizeof *range);
    if (range != NULL)
        s->range = range;
    l->capacity = capacity;
    return record != NULL && range != NULL;
}

static void survey(cairn_carmen_info *info, const cairn_carmen_record *r,
                   const cairn_carmen_record *before)
{
    if (before == NULL) {
        info->first_ns = info->least_ns = info->most_ns = r->stamp_ns;
    } else {
        cairn_pose step = cairn_pose_between(before->robot, r->robot);

        info->stamps_back += r->stamp_ns < before->stamp_ns;
        info->odometry_length += hypot((double)step.x, (double)step.y);
        info->odometry_turn += fabs((double)step.theta);
    }
    info->last_ns = r->stamp_ns;
    info->least_ns = r->stamp_ns < info->least_ns ? r->stamp_ns : info->least_ns;
    info->most_ns = r->stamp_ns > info->most_ns ? r->stamp_ns : info->most_ns;
    info->scans++;
    info->beams += r->count;
}

/* Where the wheels have rolled since the scan before, on an arc; the pose is kept in double, as
 * it adds up. */
static void roll(table *t, double *named)
{
    double left = named[LEFT] - t->wheels[0], right = named[RIGHT] - t->wheels[1];
    double way = URG_TICK * (left + right) / 2, turn = URG_TICK * (right - left) / URG_AXLE;

    t->wheels[0] = named[LEFT];
    t->wheels[1] = named[RIGHT];
    if (t->rolls) {
        t->rolled[0] += way * cos(t->rolled[2] + turn / 2);
        t->rolled[1] += way * sin(t->rolled[2] + turn / 2);
        t->rolled[2] = remainder(t->rolled[2] + turn, 360 * RADIANS);
        t->has_odometry |= left != 0 || right != 0;
    }
    t->rolls = 1;
    memcpy(&named[X], t->rolled, sizeof t->rolled);
}

/* Takes the values that were read as the next scan. */
static cairn_status take_scan(loading *l, cairn_file_error *error)
{
    cairn_carmen_scans *s = l->scans;
    const table *t = &l->table;
    cairn_carmen_record *r;
    float *range;
    double named[BEARING] = {0};

    if (!grow(l))
        return cairn_file_error_system(error, l->path, "read", ENOMEM);
    r = &s->record[s->count];
    range = &s->range[((size_t)s->count + 1) * (size_t)t->beams];
    memset(r, 0, sizeof *r);
    for (int32_t i = 0, beam = 0; i < t->fields; i++) {
        double v = t->value[i];

        if (t->column[i] < BEARING)
            named[t->column[i]] = v;
        else if (t->column[i] == BEARING)
            range[beam++] =
                v >= s->info.range_max / t->range_unit ? INFINITY : (float)(v * t->range_unit);
    }
    r->kind = CAIRN_CARMEN_SCAN;
    r->count = t->beams;
    r->line = cairn_line_reader_number(l->reader);
    r->stamp_ns = t->has_time ? (int64_t)llround(named[TIME] * t->time_unit) : s->count * SCAN_NS;
    if (t->kind == CAIRN_RANGE_TABLE_URG)
        roll(&l->table, named);
    r->robot.x = (cairn_real)named[X];
    r->robot.y = (cairn_real)named[Y];
    r->robot.theta = cairn_wrap_angle((cairn_real)named[THETA]);
    r->laser = cairn_pose_compose(r->robot, s->info.base_sensor);
    survey(&s->info, r, s->count > 0 ? r - 1 : NULL);
    s->count++;
    return CAIRN_OK;
}

static void tell_fault(loading *l, const char *what)
{
    cairn_file_error fault;

    l->scans->info.faults++;
    (void)cairn_file_error_set(&fault, CAIRN_BAD_FORMAT, l->path,
                               cairn_line_reader_number(l->reader), "%s, expected %d numbers", what,
                               l->table.fields);
    if (l->params->on_fault != NULL)
        l->params->on_fault(l->params->context, &fault);
}

static cairn_status take_line(loading *l, const char *line, size_t length, cairn_file_error *error)
{
    const char *what;

    l->scans->info.lines++;
    if (!is_text(line, length))
        return CAIRN_OK;
    if (l->table.column == NULL)
        return read_head(l, line, length, error);
    what = read_values(&l->table, line, length);
    if (what == NULL)
        return take_scan(l, error);
    tell_fault(l, what);
    return CAIRN_OK;
}

/* The pose of the wheels at a time before record i, or the first one since which the times run
 * on. */
static cairn_pose wheels_at(const cairn_carmen_record *record, int32_t i, int64_t time)
{
    cairn_pose step;
    int32_t k = i;

    while (k > 0 && record[k].stamp_ns > time && record[k - 1].stamp_ns < record[k].stamp_ns &&
           record[k].stamp_ns - record[k - 1].stamp_ns <= 2 * SCAN_NS)
        k--;
    if (k == i || record[k].stamp_ns > time)
        return record[k].robot;
    step = cairn_pose_between(record[k].robot, record[k + 1].robot);
    return cairn_pose_compose(
        record[k].robot,
        cairn_twist_at(cairn_twist_of(step),
                       (cairn_real)(time - record[k].stamp_ns) /
                           (cairn_real)(record[k + 1].stamp_ns - record[k].stamp_ns)));
}

/* The records point to their ranges. */
static void finish(loading *l)
{
    cairn_carmen_scans *s = l->scans;
    const table *t = &l->table;
    cairn_carmen_info *info = &s->info;

    for (int32_t i = s->count - 1; i >= 0 && t->kind == CAIRN_RANGE_TABLE_URG; i--) {
        s->record[i].robot = wheels_at(s->record, i, s->record[i].stamp_ns - URG_LATE_NS);
        s->record[i].laser = cairn_pose_compose(s->record[i].robot, info->base_sensor);
    }
    info->beams_least = info->beams_most = t->beams;
    info->fixed_mounting = 1;
    memcpy(s->range, t->bearing, (size_t)t->beams * sizeof *s->range);
    for (int32_t i = 0; i < s->count; i++) {
        cairn_carmen_record *r = &s->record[i];

        r->range = &s->range[((size_t)i + 1) * (size_t)t->beams];
        r->scan.range = r->range;
        r->scan.angle = s->range;
        r->scan.count = t->beams;
        r->scan.range_min = t->kind == CAIRN_RANGE_TABLE_URG ? (float)URG_RANGE_MIN : 0;
        r->scan.range_max = (float)info->range_max;
        r->scan.range_sigma = (float)l->params->range_sigma;
        r->scan.time_step =
            t->kind == CAIRN_RANGE_TABLE_URG ? (float)(URG_TURN * URG_STEP / 360) : 0;
        r->scan.stamp_ns = r->stamp_ns;
        r->scan.base_sensor = info->base_sensor;
    }
}

static cairn_status read_lines(loading *l, cairn_file_error *error)
{
    cairn_status status = CAIRN_OK;

    while (status == CAIRN_OK) {
        const char *line;
        size_t length;
        cairn_file_error fault;

        status = cairn_line_reader_next(l->reader, &line, &length, &fault);
        if (status == CAIRN_EMPTY)
            break;
        if (status == CAIRN_OK) {
            status = take_line(l, line, length, error);
        } else if (status == CAIRN_FULL || status == CAIRN_TRUNCATED ||
                   status == CAIRN_BAD_FORMAT) {
            tell_fault(l, status == CAIRN_FULL ? "a line without end" : "damaged gzip data");
            status = CAIRN_OK;
        } else if (error != NULL) {
            *error = fault;
        }
    }
    if (status != CAIRN_EMPTY)
        return status;
    if (l->scans->count == 0)
        return cairn_file_error_set(error, CAIRN_EMPTY, l->path, 0,
                                    "no scan in it, expected a table of ranges");
    finish(l);
    return CAIRN_OK;
}

cairn_status cairn_range_table_load(cairn_carmen_scans *scans, int32_t *has_odometry,
                                    const char *path, cairn_range_table_kind kind,
                                    const cairn_carmen_params *params, cairn_file_error *error)
{
    cairn_carmen_params defaults = cairn_carmen_default();
    loading l;
    cairn_status status;

    memset(scans, 0, sizeof *scans);
    memset(&l, 0, sizeof l);
    l.scans = scans;
    l.params = params != NULL ? params : &defaults;
    l.path = path;
    l.table.kind = kind;
    if (!(l.params->range_max >= 0 && l.params->range_max <= (double)CAIRN_SCAN_EXTENT))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "the greatest range is %g, expected 0 to %g",
                                    l.params->range_max, (double)CAIRN_SCAN_EXTENT);
    scans->info.range_max = kind == CAIRN_RANGE_TABLE_URG ? URG_RANGE_MAX : CSV_RANGE_MAX;
    if (l.params->range_max > 0)
        scans->info.range_max = l.params->range_max;
    if (kind == CAIRN_RANGE_TABLE_URG)
        scans->info.base_sensor.x = (cairn_real)URG_AHEAD;
    status = cairn_line_reader_open(&l.reader, path, error);
    if (status == CAIRN_OK && kind == CAIRN_RANGE_TABLE_URG)
        status = make_urg(&l, error);
    if (status == CAIRN_OK)
        status = read_lines(&l, error);
    *has_odometry = l.table.has_odometry;
    cairn_line_reader_close(l.reader);
    free_table(&l.table);
    if (status != CAIRN_OK)
        cairn_carmen_scans_free(scans);
    return status;
}

cairn_status cairn_range_table_find_kind(cairn_range_table_kind *kind, const char *path,
                                         cairn_file_error *error)
{
    cairn_line_reader *reader;
    cairn_status status = cairn_line_reader_open(&reader, path, error);

    *kind = CAIRN_RANGE_TABLE_NONE;
    if (status != CAIRN_OK)
        return status;
    for (int32_t i = 0; i < PROBED_LINES && *kind == CAIRN_RANGE_TABLE_NONE; i++) {
        const char *line;
        size_t length;

        if (cairn_line_reader_next(reader, &line, &length, NULL) != CAIRN_OK)
            break;
        if (!is_text(line, length))
            continue;
        if (is_head(line, length))
            *kind = CAIRN_RANGE_TABLE_CSV;
        else if (count_fields(line, length) == URG_FIELDS &&
                 (line[0] == '-' || (line[0] >= '0' && line[0] <= '9')))
            *kind = CAIRN_RANGE_TABLE_URG;
    }
    cairn_line_reader_close(reader);
    return CAIRN_OK;
}
