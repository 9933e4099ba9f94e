/* cairn replay: deterministic replay of a robot's recorded run, compared bit by bit. */
#include <inttypes.h>

#include "firmware/recorder.h"
#include "firmware/robot.h"
#include "src/host/base/posix.h"
#include "src/host/base/regular_file.h"
#include "tools/cairn_tool.h"

#define PROGRAM "cairn replay"

/* Maximum number of beams of a sweep; ranges are kept until the end of the run. */
#define MAX_BEAMS 100000
/* Maximum number of ticks, and of work units of all of them, so that a few bytes cannot take
 * years: hours of a control loop, and of this machine. */
#define MAX_TICKS (1u << 24)
#define MAX_UNITS (INT64_C(1) << 36)

typedef struct settings {
    const char *path;
    int32_t json, quiet;
} settings;

typedef struct recording {
    const char *path;
    FILE *file;
    long at; /* byte offset in the stream, for error messages */
} recording;

/* The replayed run: the robot, its memory, the ranges of the offered sweeps, and the hashes. */
typedef struct run {
    robot robot;
    void *memory;
    float *range[ROBOT_SCANS];
    uint32_t hash, recorded_ticks, recorded_hash;
    int64_t units; /* of all ticks so far */
} run;

static option_result read_settings(settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_JSON(&s->json),
        OPTION_FLAG("--quiet", &s->quiet, "prints only the verdict"),
    };
    const option_set set = {
        PROGRAM, "FILE [options]",
        "Replays the recording of a flight recorder (firmware/recorder.h): offers the robot the "
        "same "
        "sweeps between the same ticks, prints the poses, and compares the hash of all states with "
        "the "
        "recorded one. Recordings in float are replayed by cairn-float in the same folder.",
        table, sizeof table / sizeof *table};
    const char *words[1];
    size_t count = 1;
    option_result result = options_read(&set, argc, argv, words, &count);

    if (result != OPTIONS_READ)
        return result;
    if (count == 0) {
        (void)options_refuse(PROGRAM, "no recording, expected FILE");
        return OPTIONS_BAD;
    }
    s->path = words[0];
    return OPTIONS_READ;
}

static int refuse(const recording *in, const char *what)
{
    fprintf(stderr, "%s: byte %ld: %s\n", in->path, in->at, what);
    return TOOL_BAD;
}

/* Reads bytes; returns 1 when the stream had all of them. */
static int read_bytes(recording *in, void *data, size_t bytes)
{
    size_t got = fread(data, 1, bytes, in->file);

    in->at += (long)got;
    return got == bytes;
}

static int read_word(recording *in, uint32_t *word)
{
    return read_bytes(in, word, sizeof *word);
}

/* Executes the program of the other number type to replay the recording. */
static int play_with_other_program(const recording *in, uint32_t real_bytes, char **argv)
{
    static const char *const name = sizeof(cairn_real) == 8 ? "cairn-float" : "cairn";
    char path[4096];
    char *slash;

    if (real_bytes != 4 && real_bytes != 8)
        return refuse(in, "reals are neither of 4 nor of 8 bytes");
    cairn_program_path(path, sizeof path - 16);
    slash = strrchr(path, '/');
    (void)snprintf(slash == NULL ? path : slash + 1, 16, "%s", name);
    argv[0] = path;
    (void)execvp(path, argv);
    fprintf(stderr,
            "%s: recorded with reals of %" PRIu32
            " bytes, expected %s to play it beside this program\n",
            in->path, real_bytes, name);
    return TOOL_BAD;
}

static int begin(run *r, recording *in, char **argv)
{
    char magic[4] = "";
    uint32_t version, real_bytes, memory, params_bytes;
    robot_params params;
    cairn_status status;

    if (!read_bytes(in, magic, sizeof magic) && ferror(in->file)) {
        perror(in->path);
        return TOOL_BAD;
    }
    if (memcmp(magic, "CRNR", 4) != 0)
        return refuse(in, "no flight recording, expected CRNR at the start");
    if (!read_word(in, &version) || version != RECORDER_VERSION)
        return refuse(in, "unknown version, expected 1");
    if (!read_word(in, &real_bytes) || !read_word(in, &memory) || !read_word(in, &params_bytes))
        return refuse(in, "truncated in the header");
    if (real_bytes != sizeof(cairn_real))
        return play_with_other_program(in, real_bytes, argv);
    if (params_bytes != sizeof params || !read_bytes(in, &params, sizeof params))
        return refuse(in,
                      "parameters of another size, expected a recording of this version of cairn");
    r->memory = malloc(memory > 0 ? memory : 1);
    if (r->memory == NULL) {
        fprintf(stderr, "%s: no memory for a pool of %" PRIu32 " bytes\n", in->path, memory);
        return TOOL_FAILED;
    }
    status = robot_create(&r->robot, r->memory, memory, &params);
    if (status != CAIRN_OK)
        return refuse(in, cairn_status_text(status));
    r->hash = HASH_START;
    return TOOL_OK;
}

static int play_sweep(run *r, recording *in)
{
    robot_sweep sweep;
    cairn_real pose[3];
    uint32_t count;
    cairn_status status;
    float *range;

    if (!read_word(in, &count) || !read_bytes(in, &sweep.angle_min, 4) ||
        !read_bytes(in, &sweep.angle_step, 4) || !read_bytes(in, pose, sizeof pose))
        return refuse(in, "truncated in a sweep");
    if (count < 1 || count > MAX_BEAMS || r->robot.offered == ROBOT_SCANS)
        return refuse(in, "too many beams or sweeps");
    range = malloc(count * sizeof *range);
    if (range == NULL)
        return TOOL_FAILED;
    r->range[r->robot.offered] = range;
    if (!read_bytes(in, range, count * sizeof *range))
        return refuse(in, "truncated in the ranges of a sweep");
    sweep.range = range;
    sweep.count = (int32_t)count;
    sweep.pose.x = pose[0];
    sweep.pose.y = pose[1];
    sweep.pose.theta = pose[2];
    status = robot_offer(&r->robot, &sweep);
    return status == CAIRN_OK
               ? TOOL_OK
               : refuse(in, "a sweep that the robot cannot have accepted at this tick");
}

static int play_ticks(run *r, recording *in)
{
    uint32_t count;
    int32_t units;

    if (!read_word(in, &count) || !read_bytes(in, &units, sizeof units))
        return refuse(in, "truncated in the ticks");
    if (count > MAX_TICKS - r->robot.ticks)
        return refuse(in, "more than 16777216 ticks, expected the recording of a run");
    for (; count > 0; count--) {
        cairn_budget budget = {units};
        robot_work work;
        cairn_status status = robot_tick(&r->robot, &budget, &work);

        if (status < 0)
            return refuse(in, cairn_status_text(status));
        r->units += (int64_t)units - budget.left;
        if (r->units > MAX_UNITS)
            return refuse(in, "more than 2^36 units of work, expected the recording of a run");
        r->hash = robot_hash(&r->robot, r->hash);
    }
    return TOOL_OK;
}

static int play(run *r, recording *in)
{
    for (;;) {
        uint32_t letter;
        int code = TOOL_OK;

        if (!read_word(in, &letter))
            return refuse(in, "truncated before the end record");
        if (letter == 'S')
            code = play_sweep(r, in);
        else if (letter == 'T')
            code = play_ticks(r, in);
        else if (letter == 'F')
            robot_finish(&r->robot);
        else if (letter == 'E')
            return read_word(in, &r->recorded_ticks) && read_word(in, &r->recorded_hash)
                       ? TOOL_OK
                       : refuse(in, "truncated in the end record");
        else
            return refuse(in, "an unknown record, expected S, T, F or E");
        if (code != TOOL_OK)
            return code;
    }
}

static void write_hash(cairn_json_writer *json, const char *name, uint32_t hash)
{
    char text[9];

    (void)snprintf(text, sizeof text, "%08" PRIx32, hash);
    cairn_json_write_text(json, name, text);
}

static void print_json(const run *r, int same)
{
    const robot *played = &r->robot;
    cairn_json_writer json = cairn_json_write_begin(stdout);

    cairn_json_write_boolean(&json, "same", same);
    cairn_json_write_integer(&json, "ticks", played->ticks);
    cairn_json_write_integer(&json, "recorded_ticks", r->recorded_ticks);
    write_hash(&json, "hash", r->hash);
    write_hash(&json, "recorded_hash", r->recorded_hash);
    cairn_json_write_array(&json, "poses");
    for (int32_t i = 0; i < cairn_force_field_pose_count(played->field); i++)
        tool_json_pose(&json, NULL, robot_pose(played, i));
    cairn_json_write_array_end(&json);
    cairn_json_write_end(&json);
}

static int print_result(const run *r, const settings *s)
{
    const robot *played = &r->robot;
    int same = r->hash == r->recorded_hash && played->ticks == r->recorded_ticks;

    if (s->json) {
        print_json(r, same);
        return same ? TOOL_OK : TOOL_BAD;
    }

    for (int32_t i = 0; !s->quiet && i < cairn_force_field_pose_count(played->field); i++) {
        cairn_pose pose = robot_pose(played, i);

        printf("pose %" PRId32 " %.4f %.4f m %.4f rad\n", i, (double)pose.x, (double)pose.y,
               (double)pose.theta);
    }
    printf("ticks %" PRIu32 ", recorded %" PRIu32 "\nhash %08" PRIx32 ", recorded %08" PRIx32
           ": %s\n",
           played->ticks, r->recorded_ticks, r->hash, r->recorded_hash,
           same ? "the same run" : "NOT the same run");
    return same ? TOOL_OK : TOOL_BAD;
}

int tool_replay(int argc, char **argv)
{
    static run r;
    settings s = {0};
    recording in = {0};
    cairn_file_error error;
    char **again;
    option_result result = read_settings(&s, argc, argv);
    int code;

    if (result != OPTIONS_READ)
        return result == OPTIONS_HELPED ? TOOL_OK : TOOL_BAD;
    memset(&r, 0, sizeof r);
    /* the command line of the other program, its path first */
    again = calloc((size_t)argc + 2, sizeof *again);
    if (again == NULL)
        return options_refuse(PROGRAM, "no memory"), TOOL_FAILED;
    memcpy(again + 1, argv, (size_t)argc * sizeof *again);
    in.path = s.path;
    if (regular_file_open(&in.file, s.path, &error) != CAIRN_OK) {
        free(again);
        return tool_report(&error);
    }
    code = begin(&r, &in, again);
    if (code == TOOL_OK)
        code = play(&r, &in);
    if (code == TOOL_OK)
        code = print_result(&r, &s);
    (void)fclose(in.file);
    for (int32_t i = 0; i < ROBOT_SCANS; i++)
        free(r.range[i]);
    free(r.memory);
    free(again);
    return code;
}
