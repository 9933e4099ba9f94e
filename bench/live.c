/* bench/live: lag of `cairn map - --live` behind a scanner in real time.
 *
 * Method: the lines of a CARMEN log are written to the program, one scan each 1/rate s. The first
 * scan is waited for, so that the start of the program is not counted. The lag of a scan is the
 * time from when its line is due to when the line of its pose has come; a scan is late when its
 * lag is longer than the time between two scans. Processes that run beside it lengthen the lags. */
#include <math.h>
#include <poll.h>
#include <signal.h>

#include "bench/bench_json.h"
#include "bench/bench_session.h"
#include "src/host/base/posix.h"
#include "tools/options.h"

#define PROGRAM "live"

enum { MISSING_DATA = 3, FIRST_WAIT_MS = 60000, LAST_WAIT_MS = 10000 };

/* Lines of a log: those up to and including each scan. */
typedef struct log_lines {
    char *text;
    size_t *end; /* [count] offset in the text behind the line of each scan */
    int32_t count;
} log_lines;

static int is_scan(const char *line)
{
    return strncmp(line, "FLASER ", 7) == 0 || strncmp(line, "ROBOTLASER1 ", 12) == 0;
}

/* Returns the text of a file, 0-terminated, on the heap; NULL when it cannot be read. */
static char *read_text(const char *path)
{
    FILE *file = fopen(path, "rb");
    long bytes = -1;
    char *text = NULL;

    if (file == NULL)
        return NULL;
    if (fseek(file, 0, SEEK_END) == 0)
        bytes = ftell(file);
    rewind(file);
    if (bytes >= 0)
        text = malloc((size_t)bytes + 1);
    if (text != NULL)
        text[fread(text, 1, (size_t)bytes, file)] = '\0';
    (void)fclose(file);
    return text;
}

/* Splits a log into scans; 0 when there is no memory. */
static int split(log_lines *log)
{
    int32_t capacity = 0;
    char *next;

    for (char *line = log->text; (next = strchr(line, '\n')) != NULL; line = next + 1) {
        if (!is_scan(line))
            continue;
        if (log->count == capacity) {
            size_t *grown = realloc(log->end, (size_t)(2 * capacity + 256) * sizeof *grown);

            if (grown == NULL)
                return 0;
            log->end = grown;
            capacity = 2 * capacity + 256;
        }
        log->end[log->count++] = (size_t)(next + 1 - log->text);
    }
    return 1;
}

/* Starts "cairn map - --live --quiet"; 0 when the system refuses. */
static int start(bench_session *s, char *program)
{
    static char map[] = "map", input[] = "-", live[] = "--live", quiet[] = "--quiet";
    char *arguments[] = {program, map, input, live, quiet, NULL};

    return bench_session_start(s, arguments, NULL);
}

/* Writes the lines of scan k; 0 when the program has ended. */
static int send_scan(const bench_session *s, const log_lines *log, int32_t k)
{
    size_t at = k > 0 ? log->end[k - 1] : 0;

    while (at < log->end[k]) {
        ssize_t written = write(s->in, log->text + at, log->end[k] - at);

        if (written <= 0)
            return 0;
        at += (size_t)written;
    }
    return 1;
}

/* Waits at most `wait_ms` for output; the number of line ends that came, or -1 at its end. */
static int32_t lines_that_came(const bench_session *s, int wait_ms)
{
    struct pollfd poll_out = {s->out, POLLIN, 0};
    char bytes[4096];
    int32_t lines = 0;
    ssize_t count;

    if (poll(&poll_out, 1, wait_ms) <= 0)
        return 0;
    count = read(s->out, bytes, sizeof bytes);
    if (count <= 0)
        return -1;
    for (ssize_t i = 0; i < count; i++)
        lines += bytes[i] == '\n';
    return lines;
}

/* Feeds all scans in real time. lag: [count] set to the lag of each scan, s; that of the first
 * one to 0. Returns 0 when the program ended early, or a line did not come. */
static int feed(const bench_session *s, const log_lines *log, double rate, double *lag)
{
    int32_t sent = 1, came = 0;
    double begin;

    lag[0] = 0;
    if (!send_scan(s, log, 0) || (came = lines_that_came(s, FIRST_WAIT_MS)) != 1)
        return 0;
    begin = bench_seconds();
    while (came < log->count) {
        double now = bench_seconds(), due = begin + sent / rate;
        int32_t lines;

        if (sent < log->count && now >= due) {
            if (!send_scan(s, log, sent++))
                return 0;
            continue;
        }
        lines = lines_that_came(s, sent < log->count ? (int)ceil(1e3 * (due - now)) : LAST_WAIT_MS);
        if (lines < 0 || (lines == 0 && sent == log->count))
            return 0;
        now = bench_seconds();
        for (; lines > 0 && came < sent; lines--, came++)
            lag[came] = now - (begin + came / rate);
    }
    return 1;
}

static void print(const char *path, int32_t count, double rate, double seconds, double *lag)
{
    int32_t late = 0, counted = count - 1;

    for (int32_t k = 1; k < count; k++)
        late += lag[k] > 1 / rate;
    bench_sort(lag + 1, (size_t)counted);
    bench_json_begin("live");
    bench_json_text("log", path);
    bench_json_number("rate_hz", rate);
    bench_json_integer("scans", count);
    bench_json_integer("late", late);
    bench_json_number("lag_ms_median", 1e3 * lag[1 + counted / 2]);
    bench_json_number("lag_ms_p99", 1e3 * lag[1 + (int32_t)(0.99 * (counted - 1))]);
    bench_json_number("lag_ms_most", 1e3 * lag[counted]);
    bench_json_number("seconds", seconds);
    bench_json_true("summary");
    bench_json_end();
}

static int run(char *program, const char *path, double rate)
{
    log_lines log = {read_text(path), NULL, 0};
    double *lag = NULL, begin = bench_seconds();
    bench_session s = {-1, -1, -1};
    int code = 1, status;

    if (log.text == NULL || !split(&log) || log.count < 2) {
        (void)options_refuse(PROGRAM, "%s: no CARMEN log of two scans, expected one, not gzipped",
                             path);
        code = MISSING_DATA;
    } else if ((lag = malloc((size_t)log.count * sizeof *lag)) == NULL || !start(&s, program)) {
        (void)options_refuse(PROGRAM, "%s cannot be started", program);
    } else {
        code = !feed(&s, &log, rate, lag);
        (void)close(s.in);
        while (lines_that_came(&s, LAST_WAIT_MS) > 0)
            ;
        (void)close(s.out);
        if (waitpid(s.program, &status, 0) < 0 || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
            code = 1;
        if (code == 0)
            print(path, log.count, rate, bench_seconds() - begin, lag);
        else
            (void)options_refuse(PROGRAM, "%s failed, or did not print a line for each scan",
                                 program);
    }
    free(lag);
    free(log.end);
    free(log.text);
    return code;
}

/* Writes the path of cairn, in the folder above that of this program. */
static void find_cairn(char *path, size_t size)
{
    static const char name[] = "cairn";

    cairn_program_path(path, size - sizeof name);
    for (int up = 0; up < 2; up++) {
        char *slash = strrchr(path, '/');

        if (slash != NULL)
            *slash = '\0';
    }
    strcat(strcat(path, "/"), name);
}

int main(int argc, char **argv)
{
    const char *log = "data/logs/office.log";
    double rate = 40;
    const option table[] = {
        OPTION_TEXT("--log", &log, "FILE", "CARMEN log, not gzipped (data/logs/office.log)"),
        OPTION_NUMBER("--rate", &rate, 0.1, 1000, "HZ", "scans per second"),
    };
    const option_set set = {
        PROGRAM, "[options]",
        "Feeds a log to `cairn map - --live` in real time, and counts the scans "
        "whose poses come later "
        "than the next scan.",
        table, sizeof table / sizeof *table};
    char program[4096];
    size_t words = 0;
    option_result result = options_read(&set, argc, argv, NULL, &words);

    if (result != OPTIONS_READ)
        return result;
    (void)signal(SIGPIPE, SIG_IGN);
    find_cairn(program, sizeof program);
    return run(program, log, rate);
}
