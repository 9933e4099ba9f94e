/* Flight recorder. Words are written in memory order: the boards are little-endian. */
#include "src/base/build.h"

#include "firmware/recorder.h"

static void put(recorder *out, const void *data, uint32_t bytes)
{
    out->sink(out->context, data, bytes);
}

static void put_word(recorder *out, uint32_t word)
{
    put(out, &word, sizeof word);
}

static void flush_ticks(recorder *out)
{
    if (out->ticks == 0)
        return;
    put_word(out, 'T');
    put_word(out, out->ticks);
    put_word(out, (uint32_t)out->budget);
    out->ticks = 0;
}

void recorder_begin(recorder *out, recorder_sink *sink, void *context, const robot_params *params,
                    size_t memory)
{
    out->sink = sink;
    out->context = context;
    out->ticks = 0;
    out->budget = 0;
    put(out, "CRNR", 4);
    put_word(out, RECORDER_VERSION);
    put_word(out, sizeof(cairn_real));
    put_word(out, (uint32_t)memory);
    put_word(out, sizeof *params);
    put(out, params, sizeof *params);
}

void recorder_sweep(recorder *out, const robot_sweep *sweep)
{
    cairn_real pose[3] = {sweep->pose.x, sweep->pose.y, sweep->pose.theta};

    flush_ticks(out);
    put_word(out, 'S');
    put_word(out, (uint32_t)sweep->count);
    put(out, &sweep->angle_min, sizeof sweep->angle_min);
    put(out, &sweep->angle_step, sizeof sweep->angle_step);
    put(out, pose, sizeof pose);
    put(out, sweep->range, (uint32_t)sweep->count * (uint32_t)sizeof *sweep->range);
}

void recorder_tick(recorder *out, int32_t budget)
{
    if (budget != out->budget)
        flush_ticks(out);
    out->budget = budget;
    out->ticks++;
}

void recorder_finish(recorder *out)
{
    flush_ticks(out);
    put_word(out, 'F');
}

void recorder_end(recorder *out, uint32_t ticks, uint32_t hash)
{
    flush_ticks(out);
    put_word(out, 'E');
    put_word(out, ticks);
    put_word(out, hash);
}
