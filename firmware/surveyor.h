/* surveyor: the mapper (online SLAM) in the main loop of a robot, independent of the machine.
 *
 * Sweeps are offered as they arrive, with the odometry at their first beam; every tick performs one
 * bounded step. While one sweep is being mapped another one may be queued; the caller drops a sweep
 * that arrives while the queue is full. The state is a function of the offers and the budgets of
 * the ticks; the poses are a function of the sweeps taken alone. */
#ifndef CAIRN_FIRMWARE_SURVEYOR_H
#define CAIRN_FIRMWARE_SURVEYOR_H

#include "cairn/mapper.h"
#include "firmware/robot.h"

typedef struct surveyor_params {
    float range_max;   /* m */
    float range_sigma; /* m */
    cairn_mapper_params mapper;
} surveyor_params;

/* Kind of work of a tick. */
typedef int32_t surveyor_work;
enum { SURVEYOR_ADD, SURVEYOR_MAP, SURVEYOR_SETTLE, SURVEYOR_IDLE, SURVEYOR_WORKS };

/* Open for reading. */
typedef struct surveyor {
    surveyor_params params;
    cairn_pool pool;
    cairn_mapper *mapper;
    robot_sweep sweep; /* the queued sweep */
    int32_t queued;
    int32_t mapping;  /* 1: the last sweep taken has no pose yet */
    int32_t finished; /* 1: no more sweeps will arrive */
    int32_t done;     /* 1: all sweeps are mapped and the map is settled */
    int32_t taken;
    uint32_t ticks;
} surveyor;

/* Creates the mapper in the memory. Statuses of cairn_mapper_create(). */
CAIRN_CHECKED cairn_status surveyor_create(surveyor *s, void *memory, size_t bytes,
                                           const surveyor_params *params);

/* Offers a sweep, whose ranges must stay valid until it is taken; its pose is the odometry.
 * CAIRN_MORE: a sweep is already queued, nothing was done. */
CAIRN_CHECKED cairn_status surveyor_offer(surveyor *s, const robot_sweep *sweep);

/* Declares that no more sweeps will arrive. */
void surveyor_finish(surveyor *s);

/* Performs one step. CAIRN_OK: all sweeps are in the map and it is settled. CAIRN_MORE: call again.
 * Negative: status of the step; call again: a rejected sweep is dropped, a full mapper (CAIRN_FULL)
 * rejects all further sweeps. */
CAIRN_CHECKED cairn_status surveyor_tick(surveyor *s, cairn_budget *budget, surveyor_work *work);

/* Returns the hash, initially HASH_START, updated with the last result and the poses of all
 * keyframes. */
uint32_t surveyor_hash(const surveyor *s, uint32_t hash);

#endif
