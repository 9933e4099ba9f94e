/* recorder: flight recorder. Writes the inputs and budgets of a robot's run as a byte stream, which
 * `cairn replay` replays bit by bit.
 *
 * The stream, all numbers little-endian, reals of 4 or 8 bytes as the recording build has them:
 *
 * header "CRNR", u32 version (1), u32 bytes of a real, u32 bytes of the memory, u32 bytes of
 * robot_params, robot_params 'S' u32 count, f32 angle_min, f32 angle_step, real x, y, theta, f32
 * range[count]: a sweep was offered 'T' u32 n, i32 budget: n ticks with that budget 'F' no more
 * sweeps will come 'E' u32 ticks, u32 hash: the end
 *
 * A letter is followed by three zero bytes. Consecutive ticks are merged, so that a run without
 * inputs takes 12 bytes. */
#ifndef CAIRN_FIRMWARE_RECORDER_H
#define CAIRN_FIRMWARE_RECORDER_H

#include "firmware/robot.h"

enum { RECORDER_VERSION = 1 };

/* Callback that receives the next bytes of the stream. */
typedef void recorder_sink(void *context, const void *data, uint32_t bytes);

typedef struct recorder {
    recorder_sink *sink;
    void *context;
    uint32_t ticks; /* ticks not yet written */
    int32_t budget; /* their budget */
} recorder;

/* Writes the header. */
void recorder_begin(recorder *out, recorder_sink *sink, void *context, const robot_params *params,
                    size_t memory);

/* Call for every accepted offer, every tick, the finish, and the end. */
void recorder_sweep(recorder *out, const robot_sweep *sweep);
void recorder_tick(recorder *out, int32_t budget);
void recorder_finish(recorder *out);
void recorder_end(recorder *out, uint32_t ticks, uint32_t hash);

#endif
