/* The loop of a robot: every tick calls one step with a budget; now and then a sweep has arrived.
 *
 * Prints the poses, the hash of all states, and what the ticks cost; writes the flight recorder's stream. */
#include "src/core/build.h"

#include "firmware/board.h"
#include "firmware/mission.h"
#include "firmware/recorder.h"

static const char *const work_name[ROBOT_WORKS] = {"add", "fit", "pair", "solve", "grid", "idle"};

typedef struct measure {
    uint32_t ticks, worst; /* instructions */
    uint64_t sum;
    int32_t worst_units; /* of budget */
} measure;

static mission the_mission;
static robot the_robot;
static measure measures[ROBOT_WORKS];

/* ---- What is printed ---- */

static char *put_text(char *at, const char *text)
{
    while (*text != '\0')
        *at++ = *text++;
    *at = '\0';
    return at;
}

static char *put_number(char *at, int32_t value)
{
    char digits[10];
    int count = 0;
    uint32_t rest = value < 0 ? 0U - (uint32_t)value : (uint32_t)value;

    if (value < 0)
        *at++ = '-';
    do
        digits[count++] = (char)('0' + rest % 10);
    while ((rest /= 10) > 0);
    while (count > 0)
        *at++ = digits[--count];
    *at = '\0';
    return at;
}

static char *put_hex(char *at, uint32_t value)
{
    for (int shift = 28; shift >= 0; shift -= 4)
        *at++ = "0123456789abcdef"[value >> shift & 15];
    *at = '\0';
    return at;
}

/* A line "what number number ...". */
static void print_numbers(const char *what, const char *of_what, const int32_t *number, int32_t count)
{
    char line[160], *at = put_text(put_text(put_text(line, what), " "), of_what);

    for (int32_t i = 0; i < count; i++)
        at = put_number(put_text(at, " "), number[i]);
    (void)put_text(at, "\n");
    board_print(line);
}

/* Ends the program and says why: there is nobody to hand a status to. */
static _Noreturn void give_up(const char *what, cairn_status status)
{
    char line[160], *at = put_text(put_text(put_text(line, what), ": "), cairn_status_text(status));

    (void)put_text(at, "\n");
    board_print(line);
    board_exit(1);
}

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

        print_numbers("pose", "0.1mm,0.1mrad,sigmas", number, 7);
    }
}

/* Bit by bit: the compiler's 64-bit division is a tenth as long as all of the loop. */
static uint32_t mean_of(const measure *m)
{
    uint64_t rest = m->sum, part = (uint64_t)m->ticks << 31;
    uint32_t mean = 0;

    for (int bit = 31; bit >= 0 && m->ticks > 0; bit--, part >>= 1)
        if (rest >= part) {
            rest -= part;
            mean |= 1U << bit;
        }
    return mean;
}

static void print_measures(const robot *r)
{
    const cairn_scan_set *kept = cairn_force_field_scans(r->field);
    int32_t used[4] = {kept->scan_count, kept->point_count, kept->segment_count,
                       cairn_force_field_read(r->field).corners};
    int32_t memory[4] = {(int32_t)r->pool.peak, (int32_t)r->pool.size, (int32_t)board_data_bytes(),
                         (int32_t)board_stack_peak()};

    for (robot_work work = 0; work < ROBOT_IDLE; work++) {
        const measure *m = &measures[work];
        int32_t number[4] = {(int32_t)m->ticks, (int32_t)mean_of(m), (int32_t)m->worst, m->worst_units};

        print_numbers("measure ticks,mean,worst,units", work_name[work], number, 4);
    }
    print_numbers("measure scans,points,segments,corners", "used", used, 4);
    print_numbers("measure pool_peak,pool,data,stack", "bytes", memory, 4);
}

/* ---- The loop ---- */

static void record(void *context, const void *data, uint32_t bytes)
{
    (void)context;
    board_record(data, bytes);
}

/* One tick, timed. Returns 0 when all is done. */
static int32_t timed_tick(robot *r, int32_t units)
{
    cairn_budget budget = {units};
    robot_work work;
    uint32_t begin = board_clock(), took;
    cairn_status status = robot_tick(r, &budget, &work);
    measure *m;

    took = board_clock() - begin;
    if (status < 0)
        give_up(work_name[work], status);
    m = &measures[work];
    m->ticks++;
    m->sum += took;
    m->worst = took > m->worst ? took : m->worst;
    m->worst_units = units - budget.left > m->worst_units ? units - budget.left : m->worst_units;
    return status == CAIRN_MORE;
}

/* Offers the next sweep when it is time. */
static void let_arrive(robot *r, recorder *recording, uint32_t *last)
{
    const robot_sweep *sweep = &the_mission.sweeps[r->offered];
    cairn_status status;

    if (r->finished || (r->offered > 0 && r->ticks - *last < (uint32_t)the_mission.arrival))
        return;
    status = robot_offer(r, sweep);
    if (status < 0)
        give_up("offer", status);
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
    uint32_t last = 0, hash = ROBOT_HASH_START;
    cairn_status status;
    int32_t more = 1;
    char line[64], *at;

    mission_read(&the_mission);
    status = robot_create(r, the_mission.memory, the_mission.bytes, &the_mission.params);
    if (status != CAIRN_OK)
        give_up("create", status);
    recorder_begin(&recording, record, NULL, &the_mission.params, the_mission.bytes);
    while (more) {
        let_arrive(r, &recording, &last);
        more = timed_tick(r, the_mission.budget);
        recorder_tick(&recording, the_mission.budget);
        hash = robot_hash(r, hash);
    }
    recorder_end(&recording, r->ticks, hash);
    print_poses(r);
    at = put_hex(put_text(put_text(put_text(line, "hash "), the_mission.name), " "), hash);
    (void)put_text(at, "\n");
    board_print(line);
    print_measures(r);
    return 0;
}
