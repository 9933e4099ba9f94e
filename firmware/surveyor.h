/* surveyor: the mapper in the loop of a robot, apart from any machine.
 *
 * Sweeps are offered as they arrive, with the odometry at their first beam; every tick does one
 * bounded step. The robot does not wait for its map: while one sweep is being worked on another
 * one may wait, and one that comes too early for that is the caller's to drop. What happens is a
 * function of the offers and of the budgets of the ticks; the poses are one of the sweeps taken
 * alone. */
#ifndef CAIRN_FIRMWARE_SURVEYOR_H
#define CAIRN_FIRMWARE_SURVEYOR_H

#include "cairn/mapper.h"
#include "firmware/robot.h"

typedef struct surveyor_params {
    float range_max;   /* m */
    float range_sigma; /* m */
    cairn_mapper_params mapper;
} surveyor_params;

/* What a tick did. */
typedef int32_t surveyor_work;
enum { SURVEYOR_ADD, SURVEYOR_MAP, SURVEYOR_SETTLE, SURVEYOR_IDLE, SURVEYOR_WORKS };

/* Open for reading. */
typedef struct surveyor {
    surveyor_params params;
    cairn_pool pool;
    cairn_mapper *mapper;
    robot_sweep sweep; /* that waits */
    int32_t waits;
    int32_t mapping;  /* the last sweep taken has no pose yet */
    int32_t finished; /* no more sweeps will come */
    int32_t done;     /* ... and the map is as good as it gets */
    int32_t taken;
    uint32_t ticks;
} surveyor;

/* The mapper in the memory. Statuses of cairn_mapper_create(). */
CAIRN_CHECKED cairn_status surveyor_create(surveyor *s, void *memory, size_t bytes,
                                           const surveyor_params *params);

/* Offers a sweep, whose ranges must stay until it is taken; its pose is the odometry.
 * CAIRN_MORE: one waits already, nothing was done. */
CAIRN_CHECKED cairn_status surveyor_offer(surveyor *s, const robot_sweep *sweep);

/* No more sweeps will come. */
void surveyor_finish(surveyor *s);

/* One step. CAIRN_OK: all sweeps are in the map and it is settled. CAIRN_MORE: go on. Negative:
 * what the step said; go on: a sweep that is refused is dropped, a full mapper (CAIRN_FULL)
 * refuses all to come. */
CAIRN_CHECKED cairn_status surveyor_tick(surveyor *s, cairn_budget *budget, surveyor_work *work);

/* The hash so far, at first HASH_START, with the last result and the poses of all key scans. */
uint32_t surveyor_hash(const surveyor *s, uint32_t hash);

#endif
