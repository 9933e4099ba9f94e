/* Reader of tables of ranges.
 *
 * Method
 * 1. The columns are taken from the CSV header or from the fixed URG layout.
 * 2. Every line is parsed into values and appended as a record. For URG, wheel ticks are integrated
 *    to odometry on arcs.
 * 3. At the end, URG poses are shifted back by the latency of the ranges, with interpolation of the
 *    motion as a constant twist.
 *
 * Layout: one array holds the bearings, which all scans share, followed by the ranges. Records get
 * pointers into it only after the last line, because it moves when it grows. */
#include "src/base/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/number_text.h"
#include "cairn/range_table.h"
#include "src/host/logs/carmen_log_reader.h"
#include "src/host/logs/carmen_log_summary.h"
#include "src/host/logs/log_interpolation.h"
#include "src/host/logs/log_origin.h"
#include "src/host/logs/log_parameters.h"

/* URG: fields of a line, the first range, the range that points ahead. */
enum { URG_FIELDS = 707, URG_FIRST = 25, URG_MIDDLE = 341, PROBED_LINES = 100 };

/* Degrees between beams, m, m, s of one rotation, m, rad of a degree. */
static const double URG_STEP_DEGREES = 360.0 / 1024, URG_RANGE_MIN = 0.02, URG_RANGE_MAX = 5.6,
                    URG_ROTATION_S = 0.1, RAD_PER_DEG = 0.017453292519943295;
/* The robot of these logs: metres that a wheel rolls in a tick, wheel separation in m, distance of
 * the scanner in front of the axle in m. */
static const double URG_METRES_PER_TICK = 2 * 3.141592653589793 * 0.077 / 2000,
                    URG_WHEEL_SEPARATION_M = 0.31, URG_SENSOR_X_M = 0.145;
/* Latency: the age of a line's ranges when its ticks are read. */
static const int64_t URG_LATENCY_NS = 170000000;
/* Period of scans without time. */
static const int64_t SCAN_PERIOD_NS = 100000000;

/* The content of a column. A CSV header can name the columns before CONTENT_NAMED, and bearings. */
enum {
    CONTENT_TIME,
    CONTENT_X,
    CONTENT_Y,
    CONTENT_THETA,
    CONTENT_NAMED,
    CONTENT_LEFT = CONTENT_NAMED,
    CONTENT_RIGHT,
    CONTENT_BEARING,
    CONTENT_IGNORED
};

/* Columns, and the line being read. */
typedef struct range_table {
    cairn_range_table_kind kind;
    char separator;  /* of a CSV table */
    int32_t *column; /* [fields] content of each column */
    int32_t fields;
    int32_t has_time, has_odometry;
    double time_unit, range_unit; /* ns and m of a unit of the file */
    float *bearing;               /* [beams] rad */
    int32_t beams;
    double *value;                     /* [fields] of the current line */
    double last_ticks[2], odometry[3]; /* of the previous line; integrated pose: m, m, rad */
    int32_t has_last_ticks;            /* 1: there is a previous line */
} range_table;

/* State of the reader. */
typedef struct range_loader {
    cairn_carmen_log_scans *scans;
    const cairn_carmen_log_params *params;
    range_table table;
    int32_t capacity; /* records */
    cairn_line_reader *reader;
    const char *path;
} range_loader;

static void free_table(range_table *table)
{
    free(table->column);
    free(table->bearing);
    free(table->value);
}

/* Allocates the columns of a table; 0: out of memory. */
static int make_table(range_table *table, int32_t fields)
{
    table->fields = fields;
    table->column = calloc((size_t)fields, sizeof *table->column);
    table->bearing = calloc((size_t)fields, sizeof *table->bearing);
    table->value = calloc((size_t)fields, sizeof *table->value);
    return table->column != NULL && table->bearing != NULL && table->value != NULL;
}

/* ---- Fields ---- */

/* Returns the separator of a CSV line: semicolon, comma or tab, whichever of these it has first in
 * this order. */
static char separator_of(const char *line, size_t length)
{
    static const char separators[] = {';', ',', '\t'};

    for (size_t k = 0; k < sizeof separators; k++)
        if (memchr(line, separators[k], length) != NULL)
            return separators[k];
    return ',';
}

static int is_blank(char c)
{
    return c == ' ' || c == '\t';
}

/* Splits off the next field up to a separator, without surrounding blanks; 0 when there is none. */
static int next_cell(const char **at, const char *end, char separator, const char **cell,
                     size_t *length)
{
    const char *from = *at, *to;

    if (from == NULL)
        return 0;
    to = memchr(from, separator, (size_t)(end - from));
    *at = to != NULL ? to + 1 : NULL;
    if (to == NULL)
        to = end;
    for (; from < to && is_blank(*from); from++)
        ;
    for (; to > from && is_blank(to[-1]); to--)
        ;
    *cell = from;
    *length = (size_t)(to - from);
    return 1;
}

static int next_field(const range_table *table, const char **at, const char *end,
                      const char **field, size_t *length)
{
    if (table->kind == CAIRN_RANGE_TABLE_CSV)
        return next_cell(at, end, table->separator, field, length);
    *length = cairn_token_next(at, end, field);
    return *length > 0;
}

/* Returns 1 when a line is neither blank nor a comment. */
static int has_content(const char *line, size_t length)
{
    const char *at = line, *token;

    return cairn_token_next(&at, line + length, &token) > 0 && token[0] != '#';
}

/* ---- The head ---- */

/* Returns the content of a column by its name in a header, with *degrees of a bearing; -1:
 * unknown. */
static int32_t find_column(const char *name, size_t length, double *degrees)
{
    static const char *const names[CONTENT_NAMED] = {"time", "x", "y", "theta"};

    for (int32_t k = 0; k < CONTENT_NAMED; k++)
        if (strlen(names[k]) == length && memcmp(names[k], name, length) == 0)
            return k;
    return cairn_number_read(name, length, degrees) && fabs(*degrees) <= 360 ? CONTENT_BEARING : -1;
}

/* Returns 1 when a line can be a CSV header, or one of ranges in a table without a header. */
static int is_csv(const char *line, size_t length)
{
    const char *at = line, *cell;
    char separator = separator_of(line, length);
    int32_t fields = 0, numbers = 0;
    double value;
    size_t n;

    while (next_cell(&at, line + length, separator, &cell, &n)) {
        int number = n == 0 || cairn_number_read(cell, n, &value);

        if (!number && find_column(cell, n, &value) < 0)
            return 0;
        fields++;
        numbers += number;
    }
    return numbers > 0 && fields > 1;
}

/* Returns 1 when a line is a CSV header: with a name in it, or bearings that rise or fall. */
static int is_header(const char *line, size_t length)
{
    const char *at = line, *cell;
    char separator = separator_of(line, length);
    int32_t bearings = 0, rising = 0, falling = 0;
    double degrees = 0, before;
    size_t n;

    while (next_cell(&at, line + length, separator, &cell, &n)) {
        before = degrees;
        if (find_column(cell, n, &degrees) != CONTENT_BEARING)
            return n > 0 && !cairn_number_read(cell, n, &degrees);
        rising += bearings > 0 && degrees > before;
        falling += bearings > 0 && degrees < before;
        bearings++;
    }
    return rising == bearings - 1 || falling == bearings - 1;
}

static int32_t count_fields(const char *line, size_t length)
{
    const char *at = line, *token;
    int32_t count = 0;

    while (cairn_token_next(&at, line + length, &token) > 0)
        count++;
    return count;
}

/* Returns 1 when a line can be one of a URG log: its numbers stand between blanks. */
static int is_urg(const char *line, size_t length)
{
    return memchr(line, ',', length) == NULL && memchr(line, ';', length) == NULL &&
           count_fields(line, length) == URG_FIELDS &&
           (line[0] == '-' || (line[0] >= '0' && line[0] <= '9'));
}

/* Reads a CSV header: columns and bearings. */
static cairn_status read_header(range_loader *loader, const char *line, size_t length,
                                cairn_file_error *error)
{
    int64_t number = cairn_line_reader_number(loader->reader);
    range_table *table = &loader->table;
    const char *at = line, *cell;
    int32_t seen[CONTENT_NAMED] = {0}, fields = 1;
    size_t n;

    if (!is_header(line, length))
        return cairn_file_error_set(error, CAIRN_BAD_FORMAT, loader->path, number,
                                    "the first line has no header, expected the names of the "
                                    "columns and bearings in degrees, rising or falling: "
                                    "time,x,y,theta,-90,-89,...,90");
    table->separator = separator_of(line, length);
    for (size_t i = 0; i < length; i++)
        fields += line[i] == table->separator;
    if (!make_table(table, fields)) {
        (void)cairn_file_error_system(error, loader->path, "read", ENOMEM);
        return CAIRN_NO_MEMORY;
    }
    for (int32_t i = 0; next_cell(&at, line + length, table->separator, &cell, &n); i++) {
        char text[CAIRN_TOKEN_TEXT_BYTES];
        double degrees = 0;
        int32_t column = find_column(cell, n, &degrees);

        if (column < 0 || (column < CONTENT_NAMED && seen[column]++ > 0))
            return cairn_file_error_set(
                error, CAIRN_BAD_FORMAT, loader->path, number,
                "column %s, expected time, x, y, theta, each once, or a bearing in degrees",
                cairn_token_text(text, cell, n));
        table->column[i] = column;
        if (column == CONTENT_BEARING)
            table->bearing[table->beams++] = (float)(degrees * RAD_PER_DEG);
    }
    if (seen[CONTENT_X] + seen[CONTENT_Y] + seen[CONTENT_THETA] != 3 * seen[CONTENT_X])
        return cairn_file_error_set(error, CAIRN_BAD_FORMAT, loader->path, number,
                                    "only some of x, y and theta, expected all");
    if (table->beams == 0 || table->beams > CAIRN_CARMEN_LOG_MAX_BEAMS)
        return cairn_file_error_set(error, CAIRN_BAD_FORMAT, loader->path, number,
                                    "%d bearings, expected 1 to %d", table->beams,
                                    CAIRN_CARMEN_LOG_MAX_BEAMS);
    table->has_time = seen[CONTENT_TIME];
    table->has_odometry = seen[CONTENT_X];
    table->time_unit = 1e9;
    table->range_unit = 1;
    return CAIRN_OK;
}

/* Sets the columns and bearings of the URG format. */
static cairn_status set_urg_layout(range_loader *loader, cairn_file_error *error)
{
    range_table *table = &loader->table;

    if (!make_table(table, URG_FIELDS)) {
        (void)cairn_file_error_system(error, loader->path, "read", ENOMEM);
        return CAIRN_NO_MEMORY;
    }
    for (int32_t i = 0; i < URG_FIELDS; i++)
        table->column[i] = CONTENT_IGNORED;
    table->column[0] = CONTENT_TIME;
    table->column[2] = CONTENT_LEFT;
    table->column[3] = CONTENT_RIGHT;
    for (int32_t i = URG_FIRST; i < URG_FIELDS; i++) {
        table->column[i] = CONTENT_BEARING;
        table->bearing[table->beams] =
            (float)((table->beams - URG_MIDDLE) * URG_STEP_DEGREES * RAD_PER_DEG);
        table->beams++;
    }
    table->has_time = 1;
    table->time_unit = 1e3;
    table->range_unit = 1e-3;
    return CAIRN_OK;
}

/* ---- Scans ---- */

/* Parses the fields of a line into table->value. Returns NULL, or the description of a fault. */
static const char *read_values(range_table *table, const char *line, size_t length)
{
    const char *at = line, *field;
    int32_t count = 0;
    size_t n;

    for (; next_field(table, &at, line + length, &field, &n); count++) {
        if (count == table->fields)
            return "too many fields";
        table->value[count] = 0;
        if (table->column[count] == CONTENT_IGNORED ||
            (n == 0 && table->column[count] == CONTENT_BEARING))
            continue;
        if (!cairn_number_read(field, n, &table->value[count]))
            return "a field is not a number";
        if (table->column[count] < CONTENT_BEARING && !(fabs(table->value[count]) <= 1e15))
            return "a time, pose or tick that is not finite";
        if (table->column[count] == CONTENT_TIME &&
            !(fabs(table->value[count]) * table->time_unit <= (double)CAIRN_SCAN_MAX_STAMP_NS))
            return "a time beyond 4e9 s";
    }
    return count < table->fields ? "too few fields" : NULL;
}

/* Makes space for one more scan; 0 when out of memory. */
static int reserve_scan(range_loader *loader)
{
    cairn_carmen_log_scans *scans = loader->scans;
    int32_t capacity = loader->capacity > 0 ? 2 * loader->capacity : 256;
    size_t beams = (size_t)loader->table.beams;
    cairn_carmen_log_record *record;
    float *range;

    if (scans->count < loader->capacity)
        return 1;
    record = realloc(scans->record, (size_t)capacity * sizeof *record);
    if (record != NULL)
        scans->record = record;
    range = realloc(scans->range, ((size_t)capacity + 1) * beams * sizeof *range);
    if (range != NULL)
        scans->range = range;
    loader->capacity = capacity;
    return record != NULL && range != NULL;
}

/* Integrates the wheel ticks since the previous scan: differential-drive odometry on an arc
 * (midpoint rule). The pose is accumulated in double. */
static void integrate_ticks(range_table *table, double *named)
{
    double left = named[CONTENT_LEFT] - table->last_ticks[0],
           right = named[CONTENT_RIGHT] - table->last_ticks[1];
    double distance = URG_METRES_PER_TICK * (left + right) / 2,
           rotation = URG_METRES_PER_TICK * (right - left) / URG_WHEEL_SEPARATION_M;

    table->last_ticks[0] = named[CONTENT_LEFT];
    table->last_ticks[1] = named[CONTENT_RIGHT];
    if (table->has_last_ticks) {
        table->odometry[0] += distance * cos(table->odometry[2] + rotation / 2);
        table->odometry[1] += distance * sin(table->odometry[2] + rotation / 2);
        table->odometry[2] = remainder(table->odometry[2] + rotation, 360 * RAD_PER_DEG);
        table->has_odometry |= left != 0 || right != 0;
    }
    table->has_last_ticks = 1;
    memcpy(&named[CONTENT_X], table->odometry, sizeof table->odometry);
}

/* Appends the values of the current line as a scan. */
static cairn_status append_scan(range_loader *loader, cairn_file_error *error)
{
    cairn_carmen_log_scans *scans = loader->scans;
    const range_table *table = &loader->table;
    cairn_carmen_log_record *record;
    float *range;
    double named[CONTENT_BEARING] = {0};

    if (scans->count == CAIRN_CARMEN_LOG_MAX_SCANS)
        return cairn_file_error_set(
            error, CAIRN_FULL, loader->path, cairn_line_reader_number(loader->reader),
            "more than %d scans, expected at most that", CAIRN_CARMEN_LOG_MAX_SCANS);
    if (!reserve_scan(loader))
        return cairn_file_error_system(error, loader->path, "read", ENOMEM);
    record = &scans->record[scans->count];
    range = &scans->range[((size_t)scans->count + 1) * (size_t)table->beams];
    memset(record, 0, sizeof *record);
    for (int32_t i = 0, beam = 0; i < table->fields; i++) {
        double value = table->value[i];

        if (table->column[i] < CONTENT_BEARING)
            named[table->column[i]] = value;
        else if (table->column[i] == CONTENT_BEARING)
            range[beam++] = value >= scans->info.range_max / table->range_unit
                                ? INFINITY
                                : (float)(value * table->range_unit);
    }
    record->kind = CAIRN_CARMEN_LOG_SCAN;
    record->count = table->beams;
    record->line = cairn_line_reader_number(loader->reader);
    record->stamp_ns = table->has_time ? (int64_t)llround(named[CONTENT_TIME] * table->time_unit)
                                       : scans->count * SCAN_PERIOD_NS;
    if (table->kind == CAIRN_RANGE_TABLE_URG)
        integrate_ticks(&loader->table, named);
    if (scans->count == 0)
        log_origin_set(scans->info.origin, &named[CONTENT_X]);
    log_origin_take(scans->info.origin, &named[CONTENT_X]);
    record->robot.x = (cairn_real)named[CONTENT_X];
    record->robot.y = (cairn_real)named[CONTENT_Y];
    record->robot.theta = cairn_wrap_angle((cairn_real)named[CONTENT_THETA]);
    record->laser = cairn_pose_compose(record->robot, scans->info.base_sensor);
    scans->count++;
    return CAIRN_OK;
}

static void report_fault(range_loader *loader, const char *what)
{
    cairn_file_error fault;

    loader->scans->info.faults++;
    (void)cairn_file_error_set(&fault, CAIRN_BAD_FORMAT, loader->path,
                               cairn_line_reader_number(loader->reader), "%s, expected %d numbers",
                               what, loader->table.fields);
    if (loader->params->on_fault != NULL)
        loader->params->on_fault(loader->params->context, &fault);
}

static cairn_status read_line(range_loader *loader, const char *line, size_t length,
                              cairn_file_error *error)
{
    const char *what;

    loader->scans->info.lines++;
    if (!has_content(line, length))
        return CAIRN_OK;
    if (loader->table.column == NULL)
        return read_header(loader, line, length, error);
    what = read_values(&loader->table, line, length);
    if (what == NULL)
        return append_scan(loader, error);
    report_fault(loader, what);
    return CAIRN_OK;
}

/* Returns the odometry pose at a time before a record, interpolated with a constant twist. Where
 * the times are not continuous back to it, the earliest pose reached. */
static cairn_pose odometry_at(const cairn_carmen_log_record *record, int32_t index, int64_t time)
{
    int32_t before = index;

    while (before > 0 && record[before].stamp_ns > time &&
           record[before - 1].stamp_ns < record[before].stamp_ns &&
           cairn_time_difference(record[before].stamp_ns, record[before - 1].stamp_ns) <=
               2 * SCAN_PERIOD_NS)
        before--;
    if (before == index || record[before].stamp_ns > time)
        return record[before].robot;
    return log_pose_between(record[before].robot, record[before].stamp_ns, record[before + 1].robot,
                            record[before + 1].stamp_ns, time);
}

/* Completes the scans: shifts URG odometry by the latency, sets the pointers to the ranges. */
static void finish(range_loader *loader)
{
    cairn_carmen_log_scans *scans = loader->scans;
    const range_table *table = &loader->table;
    cairn_carmen_log_summary *info = &scans->info;

    cairn_carmen_log_summarize(scans);
    for (int32_t i = scans->count - 1; i >= 0 && table->kind == CAIRN_RANGE_TABLE_URG; i--) {
        scans->record[i].robot =
            odometry_at(scans->record, i, scans->record[i].stamp_ns - URG_LATENCY_NS);
        scans->record[i].laser = cairn_pose_compose(scans->record[i].robot, info->base_sensor);
    }
    info->fixed_mounting = 1;
    memcpy(scans->range, table->bearing, (size_t)table->beams * sizeof *scans->range);
    for (int32_t i = 0; i < scans->count; i++) {
        cairn_carmen_log_record *record = &scans->record[i];

        record->range = &scans->range[((size_t)i + 1) * (size_t)table->beams];
        record->scan.range = record->range;
        record->scan.angle = scans->range;
        record->scan.count = table->beams;
        record->scan.range_min = table->kind == CAIRN_RANGE_TABLE_URG ? (float)URG_RANGE_MIN : 0;
        record->scan.range_max = (float)info->range_max;
        record->scan.range_sigma = (float)loader->params->range_sigma;
        record->scan.time_step = table->kind == CAIRN_RANGE_TABLE_URG
                                     ? (float)(URG_ROTATION_S * URG_STEP_DEGREES / 360)
                                     : 0;
        record->scan.stamp_ns = record->stamp_ns;
        record->scan.base_sensor = info->base_sensor;
    }
}

/* Reads all lines; malformed ones are reported and skipped. */
static cairn_status read_lines(range_loader *loader, cairn_file_error *error)
{
    cairn_status status = CAIRN_OK;

    while (status == CAIRN_OK) {
        const char *line;
        size_t length;
        cairn_file_error fault;

        status = cairn_line_reader_next(loader->reader, &line, &length, &fault);
        if (status == CAIRN_EMPTY)
            break;
        if (status == CAIRN_OK) {
            status = read_line(loader, line, length, error);
        } else if (status == CAIRN_FULL || status == CAIRN_TRUNCATED ||
                   status == CAIRN_BAD_FORMAT) {
            report_fault(loader,
                         status == CAIRN_FULL ? "the line is too long" : "damaged gzip data");
            status = CAIRN_OK;
        } else if (status != CAIRN_MORE && error != NULL) {
            *error = fault;
        }
    }
    if (status != CAIRN_EMPTY)
        return status;
    if (loader->scans->count == 0)
        return cairn_file_error_set(error, CAIRN_EMPTY, loader->path, 0,
                                    "no scan in it, expected a table of ranges");
    finish(loader);
    return CAIRN_OK;
}

cairn_status cairn_range_table_load(cairn_carmen_log_scans *scans, int32_t *has_odometry,
                                    const char *path, cairn_range_table_kind kind,
                                    const cairn_carmen_log_params *params, cairn_file_error *error)
{
    cairn_carmen_log_params defaults = cairn_carmen_log_default();
    range_loader loader;
    cairn_status status;

    memset(scans, 0, sizeof *scans);
    memset(&loader, 0, sizeof loader);
    loader.scans = scans;
    loader.params = params != NULL ? params : &defaults;
    loader.path = path;
    loader.table.kind = kind;
    status = cairn_host_parameters_check(&cairn_carmen_log_parameters, loader.params, path, error);
    if (status != CAIRN_OK)
        return status;
    scans->info.range_max = kind == CAIRN_RANGE_TABLE_URG ? URG_RANGE_MAX : LOG_DEFAULT_RANGE_MAX_M;
    if (loader.params->range_max > 0)
        scans->info.range_max = loader.params->range_max;
    if (kind == CAIRN_RANGE_TABLE_URG)
        scans->info.base_sensor.x = (cairn_real)URG_SENSOR_X_M;
    status = cairn_line_reader_open(&loader.reader, path, error);
    if (status == CAIRN_OK && kind == CAIRN_RANGE_TABLE_URG)
        status = set_urg_layout(&loader, error);
    if (status == CAIRN_OK)
        status = read_lines(&loader, error);
    *has_odometry = loader.table.has_odometry;
    cairn_line_reader_close(loader.reader);
    free_table(&loader.table);
    if (status != CAIRN_OK)
        cairn_carmen_log_scans_free(scans);
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
        if (!has_content(line, length))
            continue;
        if (is_urg(line, length))
            *kind = CAIRN_RANGE_TABLE_URG;
        else if (is_csv(line, length))
            *kind = CAIRN_RANGE_TABLE_CSV;
    }
    cairn_line_reader_close(reader);
    return CAIRN_OK;
}
