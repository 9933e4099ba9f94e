/* Main loop of a robot with online SLAM: every tick calls one step with a budget. Sweeps arrive at
 * fixed times; a sweep is lost when the previous one is still queued.
 *
 * The robot drives there and back again, lap after lap, with new noise in the ranges and continued
 * odometry drift. Prints for each lap its cost and the distance of its poses from those of the
 * second lap; at the end the poses of the keyframes, the numbers of sweeps taken, rejected and
 * lost, the hash of all states, and the cost of the ticks. Ends with status 1 when a sweep was
 * rejected, lost, or mapped more than 0.5 m from its pose in the second lap. */
#include "src/base/build.h"

#include "cairn/random.h"
#include "firmware/board.h"
#include "firmware/console.h"
#include "firmware/survey.h"

static const char *const work_name[SURVEYOR_WORKS] = {"add", "map", "settle", "idle"};

/* The simulated drive: scanner noise and odometry. */
typedef struct drive {
    float range[SURVEY_BEAMS];
    robot_sweep sweep; /* the last sweep that arrived; pose: the current odometry */
    cairn_pose recorded;
    cairn_random random;
    int32_t arrived, all;
    uint32_t due;             /* tick at which the next sweep arrives */
    int32_t waiting, working; /* numbers of the queued sweep and of the sweep being mapped */
} drive;

/* Statistics of the current lap. */
typedef struct lap_measure {
    int32_t number;
    int32_t mapped; /* sweeps */
    int64_t units;
    cairn_real sum, most; /* m, maximum distance from the poses of the second lap */
} lap_measure;

/* Maximum distance of a sweep from its pose in the second lap, m. */
static const cairn_real MAX_DISTANCE_M = CAIRN_REAL(0.5);

static survey the_survey;
static surveyor the_surveyor;
static drive the_drive;
static lap_measure the_lap;
static cairn_pose second_lap[SURVEY_SWEEPS];
static int32_t diverged_sweeps; /* number of sweeps beyond MAX_DISTANCE_M */
static console_measure measures[SURVEYOR_WORKS];

/* ---- The drive ---- */

/* Returns the index along the lap at which sweep `number` is taken. */
static int32_t place_of(int32_t number)
{
    int32_t count = the_survey.sweep_count, at = number % count;

    return number / count % 2 ? count - 1 - at : at;
}

static cairn_real off(drive *d, cairn_real most)
{
    return cairn_random_uniform(&d->random, -most, most);
}

/* Continues the odometry by the recorded motion with a scale and heading error. */
static cairn_pose odometry_at(drive *d, cairn_pose recorded)
{
    cairn_pose moved = cairn_pose_between(d->recorded, recorded);
    cairn_real way = cairn_sqrt(moved.x * moved.x + moved.y * moved.y),
               slip = (cairn_real)the_survey.slip;

    moved.x += off(d, slip * way);
    moved.y += off(d, slip * way);
    moved.theta += off(d, slip * (way + cairn_abs(moved.theta)));
    d->recorded = recorded;
    return cairn_pose_compose(d->sweep.pose, moved);
}

/* Lets the next sweep arrive. Returns 1 when it is lost, as the previous one is still queued. */
static int32_t arrive(drive *d, surveyor *s)
{
    const robot_sweep *recorded = &the_survey.sweeps[place_of(d->arrived)];

    if (d->arrived == 0)
        d->recorded = d->sweep.pose = recorded->pose;
    d->sweep.pose = odometry_at(d, recorded->pose);
    d->sweep.count = recorded->count;
    d->sweep.angle_min = recorded->angle_min;
    d->sweep.angle_step = recorded->angle_step;
    d->sweep.range = d->range;
    d->due += (uint32_t)the_survey.arrival;
    if (!s->queued) {
        for (int32_t i = 0; i < recorded->count; i++)
            d->range[i] =
                recorded->range[i] + the_survey.noise * (float)cairn_random_normal(&d->random);
        d->waiting = d->arrived;
    }
    d->arrived++;
    return surveyor_offer(s, &d->sweep) == CAIRN_MORE;
}

/* ---- Output ---- */

static int32_t tenth_millimetres(cairn_real metres)
{
    return cairn_real_to_int(metres * 10000);
}

static void print_lap(const surveyor *s)
{
    cairn_mapper_state state = cairn_mapper_measure(s->mapper);
    cairn_real mean = the_lap.mapped > 0 ? the_lap.sum / (cairn_real)the_lap.mapped : 0;
    int32_t number[7] = {the_lap.number,
                         the_lap.mapped,
                         state.keyframes,
                         state.culled_keyframes,
                         (int32_t)(the_lap.mapped > 0 ? the_lap.units / the_lap.mapped : 0),
                         tenth_millimetres(mean),
                         tenth_millimetres(the_lap.most)};

    console_numbers("lap", "number,mapped,keys,released,units_sweep,mean,most_0.1mm", number, 7);
}

/* Counts a mapped sweep; the first sweep of a lap completes the previous lap. */
static void count_mapped(const surveyor *s, int32_t number)
{
    int32_t lap = number / the_survey.sweep_count;
    cairn_pose pose = cairn_mapper_read(s->mapper).map_scan,
               *second = &second_lap[place_of(number)];
    cairn_real x, y, away;

    if (lap != the_lap.number) {
        print_lap(s);
        the_lap = (lap_measure){.number = lap};
    }
    if (lap == 1)
        *second = pose;
    x = pose.x - second->x;
    y = pose.y - second->y;
    away = lap > 0 ? cairn_sqrt(x * x + y * y) : 0;
    the_lap.mapped++;
    diverged_sweeps += away > MAX_DISTANCE_M;
    the_lap.sum += away;
    the_lap.most = cairn_max(the_lap.most, away);
}

static void print_map(const surveyor *s, int32_t refused, int32_t lost)
{
    cairn_mapper_state state = cairn_mapper_measure(s->mapper);
    int32_t counts[7] = {s->taken,
                         refused,
                         lost,
                         (int32_t)state.predicted,
                         state.keyframes,
                         state.loops,
                         state.culled_keyframes};

    for (int32_t key = 0; key < state.keyframes; key++) {
        cairn_pose pose = cairn_mapper_keyframe_pose(s->mapper, key);
        int32_t number[4] = {key, tenth_millimetres(pose.x), tenth_millimetres(pose.y),
                             cairn_real_to_int(pose.theta * 10000)};

        console_numbers("key", "0.1mm,0.1mrad", number, 4);
    }
    console_numbers("survey", "taken,refused,lost,predicted,keys,loops,released", counts, 7);
}

static void print_measures(const surveyor *s)
{
    const cairn_scan_set *kept = cairn_mapper_keyframes(s->mapper);
    int32_t used[3] = {kept->scan_count, kept->point_count, kept->segment_count};
    int32_t memory[4] = {(int32_t)s->pool.peak, (int32_t)s->pool.size, (int32_t)board_data_bytes(),
                         (int32_t)board_stack_peak()};

    for (surveyor_work work = 0; work < SURVEYOR_IDLE; work++)
        console_measured(work_name[work], &measures[work]);
    console_numbers("measure scans,points,segments", "used", used, 3);
    console_numbers("measure pool_peak,pool,data,stack", "bytes", memory, 4);
}

/* ---- The loop ---- */

/* Performs and times one tick. */
static cairn_status timed_tick(surveyor *s, surveyor_work *work)
{
    cairn_budget budget = {the_survey.budget};
    uint32_t begin = board_clock(), took;
    cairn_status status = surveyor_tick(s, &budget, work);

    took = board_clock() - begin;
    if (status < 0 && status != CAIRN_FULL && *work != SURVEYOR_ADD)
        console_give_up(work_name[*work], status);
    console_count(&measures[*work], took, the_survey.budget - budget.left);
    if (*work == SURVEYOR_MAP)
        the_lap.units += the_survey.budget - budget.left;
    return status;
}

/* Handles the events of the tick: a sweep was taken, or mapped. */
static void follow(drive *d, const surveyor *s, surveyor_work work)
{
    if (work == SURVEYOR_ADD)
        d->working = d->waiting;
    if (work == SURVEYOR_MAP && !s->mapping)
        count_mapped(s, d->working);
}

int main(void)
{
    surveyor *s = &the_surveyor;
    drive *d = &the_drive;
    uint32_t hash = HASH_START;
    int32_t refused = 0, lost = 0;
    cairn_status status;

    survey_read(&the_survey);
    if (the_survey.sweep_count > SURVEY_SWEEPS || the_survey.sweeps[0].count > SURVEY_BEAMS)
        console_give_up("sweeps", CAIRN_FULL);
    d->all = board_number(the_survey.laps) * the_survey.sweep_count;
    d->random = cairn_random_seed(1, 1);
    status = surveyor_create(s, the_survey.memory, the_survey.bytes, &the_survey.params);
    if (status != CAIRN_OK)
        console_give_up("create", status);
    do {
        surveyor_work work;

        if (d->arrived < d->all && (int32_t)(s->ticks - d->due) >= 0) {
            lost += arrive(d, s);
            if (d->arrived == d->all)
                surveyor_finish(s);
        }
        status = timed_tick(s, &work);
        refused += status < 0;
        hash = surveyor_hash(s, hash);
        follow(d, s, work);
    } while (status != CAIRN_OK);
    print_lap(s);
    print_map(s, refused, lost);
    console_hash(the_survey.name, hash);
    print_measures(s);
    return lost + refused + diverged_sweeps > 0;
}
