/* Main loop of the robot: every tick calls one step with a budget; sweeps arrive at intervals.
 *
 * Prints the poses, the hash of all states, and the cost of the ticks; writes the flight
 * recorder's stream. */
#include "src/base/build.h"

#include "firmware/board.h"
#include "firmware/console.h"
#include "firmware/mission.h"
#include "firmware/recorder.h"

static const char *const work_name[ROBOT_WORKS] = {"add", "fit", "pair", "solve", "grid", "idle"};

static mission the_mission;
static robot the_robot;
static console_measure measures[ROBOT_WORKS];

/* ---- Output ---- */

static void print_poses(const robot *r)
{
    for (int32_t i = 0; i < cairn_force_field_pose_count(r->field); i++) {
        cairn_pose pose = robot_pose(r, i);
        const cairn_real *covariance = r->joint.covariances[i];
        int32_t number[7] = {i,
                             cairn_real_to_int(pose.x * 10000),
                             cairn_real_to_int(pose.y * 10000),
                             cairn_real_to_int(pose.theta * 10000),
                             cairn_real_to_int(cairn_sqrt(covariance[0]) * 10000),
                             cairn_real_to_int(cairn_sqrt(covariance[4]) * 10000),
                             cairn_real_to_int(cairn_sqrt(covariance[8]) * 10000)};

        console_numbers("pose", "0.1mm,0.1mrad,sigmas", number, 7);
    }
}

static void print_measures(const robot *r)
{
    const cairn_scan_set *kept = cairn_force_field_scans(r->field);
    int32_t used[4] = {kept->scan_count, kept->point_count, kept->segment_count,
                       cairn_force_field_read(r->field).corners};
    int32_t memory[4] = {(int32_t)r->pool.peak, (int32_t)r->pool.size, (int32_t)board_data_bytes(),
                         (int32_t)board_stack_peak()};

    for (robot_work work = 0; work < ROBOT_IDLE; work++)
        console_measured(work_name[work], &measures[work]);
    console_numbers("measure scans,points,segments,corners", "used", used, 4);
    console_numbers("measure pool_peak,pool,data,stack", "bytes", memory, 4);
}

/* ---- The loop ---- */

static void record(void *context, const void *data, uint32_t bytes)
{
    (void)context;
    board_record(data, bytes);
}

/* Performs and times one tick. Returns 0 when the run is complete. */
static int32_t timed_tick(robot *r, int32_t units)
{
    cairn_budget budget = {units};
    robot_work work;
    uint32_t begin = board_clock(), took;
    cairn_status status = robot_tick(r, &budget, &work);

    took = board_clock() - begin;
    if (status < 0)
        console_give_up(work_name[work], status);
    console_count(&measures[work], took, units - budget.left);
    return status == CAIRN_MORE;
}

/* Offers the next sweep when its arrival time is reached. */
static void let_arrive(robot *r, recorder *recording, uint32_t *last)
{
    const robot_sweep *sweep = &the_mission.sweeps[r->offered];
    cairn_status status;

    if (r->finished || (r->offered > 0 && r->ticks - *last < (uint32_t)the_mission.arrival))
        return;
    status = robot_offer(r, sweep);
    if (status < 0)
        console_give_up("offer", status);
    if (status == CAIRN_MORE)
        return;
    recorder_sweep(recording, sweep);
    *last = r->ticks;
    if (r->offered == the_mission.sweep_count) {
        robot_finish(r);
        recorder_finish(recording);
    }
}

int main(void)
{
    robot *r = &the_robot;
    recorder recording;
    uint32_t last = 0, hash = HASH_START;
    cairn_status status;
    int32_t more = 1;

    mission_read(&the_mission);
    status = robot_create(r, the_mission.memory, the_mission.bytes, &the_mission.params);
    if (status != CAIRN_OK)
        console_give_up("create", status);
    recorder_begin(&recording, record, NULL, &the_mission.params, the_mission.bytes);
    while (more) {
        let_arrive(r, &recording, &last);
        more = timed_tick(r, the_mission.budget);
        recorder_tick(&recording, the_mission.budget);
        hash = robot_hash(r, hash);
    }
    recorder_end(&recording, r->ticks, hash);
    print_poses(r);
    console_hash(the_mission.name, hash);
    print_measures(r);
    return 0;
}
