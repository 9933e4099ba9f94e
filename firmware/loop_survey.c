/* The loop of a robot that maps as it drives: every tick calls one step with a budget; a sweep arrives at fixed times, and is
 * lost when the one before it still waits.
 *
 * Prints the poses of the key scans, how many sweeps were taken, refused and lost, the hash of all states, and what the ticks cost. */
#include "src/core/build.h"

#include "firmware/board.h"
#include "firmware/console.h"
#include "firmware/survey.h"

static const char *const work_name[SURVEYOR_WORKS] = {"add", "map", "settle", "idle"};

static survey the_survey;
static surveyor the_surveyor;
static console_measure measures[SURVEYOR_WORKS];

static void print_map(const surveyor *s, int32_t refused, int32_t lost)
{
    cairn_mapper_state state = cairn_mapper_measure(s->mapper);
    int32_t counts[7] = {s->taken, refused, lost, (int32_t)state.predicted, state.keys, state.loops, state.releases};

    for (int32_t key = 0; key < state.keys; key++) {
        cairn_pose pose = cairn_mapper_key_pose(s->mapper, key);
        int32_t number[4] = {key, cairn_real_to_int(pose.x * 10000), cairn_real_to_int(pose.y * 10000),
                             cairn_real_to_int(pose.theta * 10000)};

        console_numbers("key", "0.1mm,0.1mrad", number, 4);
    }
    console_numbers("survey", "taken,refused,lost,predicted,keys,loops,released", counts, 7);
}

static void print_measures(const surveyor *s)
{
    const cairn_scan_set *kept = cairn_mapper_keys(s->mapper);
    int32_t used[3] = {kept->scan_count, kept->point_count, kept->segment_count};
    int32_t memory[4] = {(int32_t)s->pool.peak, (int32_t)s->pool.size, (int32_t)board_data_bytes(),
                         (int32_t)board_stack_peak()};

    for (surveyor_work work = 0; work < SURVEYOR_IDLE; work++)
        console_measured(work_name[work], &measures[work]);
    console_numbers("measure scans,points,segments", "used", used, 3);
    console_numbers("measure pool_peak,pool,data,stack", "bytes", memory, 4);
}

/* The sweep that arrives as number `arrived`. */
static const robot_sweep *arriving(int32_t arrived)
{
    int32_t count = the_survey.sweep_count, at = arrived % count;

    return &the_survey.sweeps[arrived / count % 2 ? count - 1 - at : at];
}

/* One tick, timed. */
static cairn_status timed_tick(surveyor *s)
{
    cairn_budget budget = {the_survey.budget};
    surveyor_work work;
    uint32_t begin = board_clock(), took;
    cairn_status status = surveyor_tick(s, &budget, &work);

    took = board_clock() - begin;
    if (status < 0 && status != CAIRN_FULL && work != SURVEYOR_ADD)
        console_give_up(work_name[work], status);
    console_count(&measures[work], took, the_survey.budget - budget.left);
    return status;
}

int main(void)
{
    surveyor *s = &the_surveyor;
    uint32_t hash = HASH_START;
    int32_t arrived = 0, refused = 0, lost = 0, all;
    cairn_status status;

    survey_read(&the_survey);
    all = the_survey.laps * the_survey.sweep_count;
    status = surveyor_create(s, the_survey.memory, the_survey.bytes, &the_survey.params);
    if (status != CAIRN_OK)
        console_give_up("create", status);
    do {
        if (arrived < all && s->ticks >= (uint32_t)(arrived * the_survey.arrival)) {
            lost += surveyor_offer(s, arriving(arrived++)) == CAIRN_MORE;
            if (arrived == all)
                surveyor_finish(s);
        }
        status = timed_tick(s);
        refused += status < 0;
        hash = surveyor_hash(s, hash);
    } while (status != CAIRN_OK);
    print_map(s, refused, lost);
    console_hash(the_survey.name, hash);
    print_measures(s);
    return 0;
}
