/* cairn replay: a robot's recorded run once more, bit by bit. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "firmware/recorder.h"
#include "firmware/robot.h"
#include "tools/cairn_tool.h"

#define PROGRAM "cairn replay"

/* Ranges are kept until the end of the run, so many at most in a sweep. */
#define BEAMS_MOST 100000

typedef struct settings {
    const char *path;
    int32_t quiet;
} settings;

typedef struct recording {
    const char *path;
    FILE *file;
    long at; /* byte of the stream, for what is said of it */
} recording;

/* The run: the robot, its memory, and the ranges that it was offered. */
typedef struct run {
    robot robot;
    void *memory;
    float *range[ROBOT_SCANS];
    uint32_t hash, recorded_ticks, recorded_hash;
} run;

static option_result read_settings(settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_FLAG("--quiet", &s->quiet, "only the verdict"),
    };
    const option_set set = {
        PROGRAM, "FILE [options]",
        "Plays the recording of a flight recorder (firmware/recorder.h) back: offers the robot the "
        "same\n"
        "sweeps between the same ticks, prints the poses, and says whether the hash of all states "
        "is the\n"
        "recorded one. Recordings in float are played by cairn-float, which stands beside cairn.",
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

/* 1 when all bytes were there. */
static int take(recording *in, void *data, size_t bytes)
{
    size_t got = fread(data, 1, bytes, in->file);

    in->at += (long)got;
    return got == bytes;
}

static int take_word(recording *in, uint32_t *word)
{
    return take(in, word, sizeof *word);
}

/* A recording of the other number type is played by the program of that type. */
static int play_elsewhere(const recording *in, uint32_t real_bytes, char **argv)
{
    static const char *const name = sizeof(cairn_real) == 8 ? "cairn-float" : "cairn";
    char path[4096];
    ssize_t length = readlink("/proc/self/exe", path, sizeof path - 16);
    char *slash;

    if (real_bytes != 4 && real_bytes != 8)
        return refuse(in, "reals are neither of 4 nor of 8 bytes");
    path[length > 0 ? length : 0] = '\0';
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

    if (!take(in, magic, sizeof magic) && ferror(in->file)) {
        perror(in->path);
        return TOOL_BAD;
    }
    if (memcmp(magic, "CRNR", 4) != 0)
        return refuse(in, "not a flight recording, expected CRNR at its begin");
    if (!take_word(in, &version) || version != RECORDER_VERSION)
        return refuse(in, "a version that is not known, expected 1");
    if (!take_word(in, &real_bytes) || !take_word(in, &memory) || !take_word(in, &params_bytes))
        return refuse(in, "cut in its header");
    if (real_bytes != sizeof(cairn_real))
        return play_elsewhere(in, real_bytes, argv);
    if (params_bytes != sizeof params || !take(in, &params, sizeof params))
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

    if (!take_word(in, &count) || !take(in, &sweep.angle_min, 4) ||
        !take(in, &sweep.angle_step, 4) || !take(in, pose, sizeof pose))
        return refuse(in, "cut in a sweep");
    if (count < 1 || count > BEAMS_MOST || r->robot.offered == ROBOT_SCANS)
        return refuse(in, "too many beams or sweeps");
    range = malloc(count * sizeof *range);
    if (range == NULL)
        return TOOL_FAILED;
    r->range[r->robot.offered] = range;
    if (!take(in, range, count * sizeof *range))
        return refuse(in, "cut in the ranges of a sweep");
    sweep.range = range;
    sweep.count = (int32_t)count;
    sweep.pose.x = pose[0];
    sweep.pose.y = pose[1];
    sweep.pose.theta = pose[2];
    status = robot_offer(&r->robot, &sweep);
    return status == CAIRN_OK ? TOOL_OK
                              : refuse(in, "a sweep that the robot cannot have taken there");
}

static int play_ticks(run *r, recording *in)
{
    uint32_t count;
    int32_t units;

    if (!take_word(in, &count) || !take(in, &units, sizeof units))
        return refuse(in, "cut in its ticks");
    for (; count > 0; count--) {
        cairn_budget budget = {units};
        robot_work work;
        cairn_status status = robot_tick(&r->robot, &budget, &work);

        if (status < 0)
            return refuse(in, cairn_status_text(status));
        r->hash = robot_hash(&r->robot, r->hash);
    }
    return TOOL_OK;
}

static int play(run *r, recording *in)
{
    for (;;) {
        uint32_t letter;
        int code = TOOL_OK;

        if (!take_word(in, &letter))
            return refuse(in, "cut before its end");
        if (letter == 'S')
            code = play_sweep(r, in);
        else if (letter == 'T')
            code = play_ticks(r, in);
        else if (letter == 'F')
            robot_finish(&r->robot);
        else if (letter == 'E')
            return take_word(in, &r->recorded_ticks) && take_word(in, &r->recorded_hash)
                       ? TOOL_OK
                       : refuse(in, "cut in its end");
        else
            return refuse(in, "an unknown record, expected S, T, F or E");
        if (code != TOOL_OK)
            return code;
    }
}

static int say(const run *r, const settings *s)
{
    const robot *played = &r->robot;
    int same = r->hash == r->recorded_hash && played->ticks == r->recorded_ticks;

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
    char *again[] = {NULL, argv[0], NULL, NULL, NULL};
    option_result result = read_settings(&s, argc, argv);
    int code;

    if (result != OPTIONS_READ)
        return result == OPTIONS_HELPED ? TOOL_OK : TOOL_BAD;
    memset(&r, 0, sizeof r);
    in.path = s.path;
    in.file = fopen(s.path, "rb");
    if (in.file == NULL) {
        perror(s.path);
        return TOOL_BAD;
    }
    again[2] = argv[1];
    again[3] = argc > 2 ? argv[2] : NULL;
    code = begin(&r, &in, again);
    if (code == TOOL_OK)
        code = play(&r, &in);
    if (code == TOOL_OK)
        code = say(&r, &s);
    (void)fclose(in.file);
    for (int32_t i = 0; i < ROBOT_SCANS; i++)
        free(r.range[i]);
    free(r.memory);
    return code;
}
