/* The library in the loop of a robot: scans arrive one after another, and every tick calls one step with a budget.
 *
 * Method: a tick does one of: take in a scan (add), go on with its line fit (fit), go on with the alignment of all scans
 * that have come (pair), go on with drawing them into the grid at their best poses so far (grid). After every tick the raw
 * bytes of all poses and of the whole grid enter a hash, so that two machines that print the same hash did the same.
 *
 * Limits: the poses that come with the scans must be near enough for the force field. */
#include "src/core/build.h"

#include <stddef.h>
#include <string.h>

#include "firmware/board.h"
#include "firmware/mission.h"

typedef int32_t tick_kind;
enum { TICK_ADD, TICK_FIT, TICK_PAIR, TICK_GRID, TICK_KINDS };

static const char *const kind_name[TICK_KINDS] = {"add", "fit", "pair", "grid"};

/* The grid gets every so many ticks one. */
enum { GRID_EVERY = 8, GRID_BEAM_UNITS = 12 };

typedef struct kind_measure {
    uint32_t ticks, worst;
    uint64_t sum;
    int32_t worst_units; /* of budget, in one tick */
} kind_measure;

typedef struct robot {
    mission mission;
    cairn_pool pool;
    cairn_scan *scan;
    cairn_force_field *field;
    cairn_occupancy_grid *grid;
    int32_t arrived;    /* scans that were taken in */
    int32_t fitting;    /* the last of them is not yet in the field */
    int32_t aligned;    /* the field has nothing left to do */
    int32_t since;      /* ticks since the last arrival */
    int32_t drawn;      /* scans of this drawing that are in the grid */
    int32_t beam;       /* next beam of the scan that is being drawn */
    int32_t last_pass;  /* the drawing under way began when all was aligned */
    int32_t drawing_ok; /* and it has ended */
    uint32_t tick;
    uint32_t hash;
    kind_measure measure[TICK_KINDS];
} robot;

static robot the_robot;

/* ---- What is printed ---- */

static char *put_text(char *at, const char *text)
{
    while (*text != '\0')
        *at++ = *text++;
    *at = '\0';
    return at;
}

static char *put_number(char *at, int64_t value)
{
    char digits[20];
    int count = 0;
    uint64_t rest = value < 0 ? (uint64_t)-value : (uint64_t)value;

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

/* A line "name number number ...". */
static void print_line(const char *first, const char *second, const int64_t *number, int32_t count)
{
    char line[160], *at = put_text(line, first);

    if (second != NULL)
        at = put_text(put_text(at, " "), second);
    for (int32_t i = 0; i < count; i++)
        at = put_number(put_text(at, " "), number[i]);
    (void)put_text(at, "\n");
    board_print(line);
}

/* Ends the program: what a status means is said in full, for whoever reads the console. */
static _Noreturn void give_up(const char *what, cairn_status status)
{
    char line[160], *at = put_text(line, what);

    at = put_text(put_text(at, ": "), cairn_status_text(status));
    (void)put_text(at, "\n");
    board_print(line);
    board_exit(1);
}

/* ---- Hash ---- */

/* FNV-1a over 32-bit words. */
static uint32_t hash_words(uint32_t hash, const void *data, size_t bytes)
{
    const unsigned char *at = data;

    for (size_t i = 0; i + 4 <= bytes; i += 4) {
        uint32_t word;

        memcpy(&word, at + i, 4);
        hash = (hash ^ word) * UINT32_C(16777619);
    }
    return hash;
}

static void hash_state(robot *r)
{
    cairn_force_field_state state = cairn_force_field_read(r->field);

    for (int32_t i = 0; i < cairn_force_field_pose_count(r->field); i++) {
        cairn_pose pose = cairn_force_field_pose(r->field, i);

        r->hash = hash_words(r->hash, &pose, sizeof pose);
    }
    r->hash = hash_words(r->hash, &state.potential, sizeof state.potential);
    for (int32_t y = 0; y < r->mission.grid.height; y++)
        for (int32_t x = 0; x < r->mission.grid.width; x++) {
            cairn_occupancy_cell cell = cairn_occupancy_grid_cell(r->grid, x, y);

            r->hash = hash_words(r->hash, &cell, sizeof cell);
        }
}

/* ---- Ticks ---- */

static cairn_status create(robot *r)
{
    cairn_status status;

    memset(r, 0, sizeof *r);
    mission_read(&r->mission);
    r->hash = UINT32_C(2166136261);
    r->aligned = 1;
    status = cairn_pool_init(&r->pool, r->mission.memory, r->mission.bytes);
    if (status == CAIRN_OK)
        status = cairn_scan_create(&r->scan, &r->pool, &r->mission.scan);
    if (status == CAIRN_OK)
        status = cairn_force_field_create(&r->field, &r->pool, &r->mission.field);
    if (status == CAIRN_OK)
        status = cairn_occupancy_grid_create(&r->grid, &r->pool, &r->mission.grid);
    return status;
}

static cairn_status take_in(robot *r)
{
    const recorded_scan *recorded = &r->mission.scans[r->arrived];
    cairn_scan_input input = {
        .range = recorded->range,
        .count = recorded->count,
        .angle_min = recorded->angle_min,
        .angle_step = recorded->angle_step,
        .range_max = r->mission.range_max,
        .range_sigma = 0.01f,
    };
    cairn_status status = cairn_scan_begin(r->scan, &input, NULL);

    if (status == CAIRN_OK) {
        r->arrived++;
        r->fitting = 1;
        r->since = 0;
    }
    return status;
}

static cairn_status fit(robot *r, cairn_budget *budget)
{
    cairn_status status = cairn_scan_step(r->scan, budget);
    cairn_scan_view view;

    if (status != CAIRN_OK)
        return status;
    view = cairn_scan_read(r->scan);
    status = cairn_force_field_add_scan(r->field, &view, NULL, r->mission.scans[r->arrived - 1].pose, NULL);
    if (status == CAIRN_OK && r->arrived == 1)
        status = cairn_force_field_fix(r->field, 0, 1);
    if (status != CAIRN_OK)
        return status;
    cairn_force_field_restart(r->field);
    r->fitting = r->aligned = 0;
    return CAIRN_OK;
}

static cairn_status pair(robot *r, cairn_budget *budget)
{
    cairn_status status = cairn_force_field_step(r->field, budget);

    r->aligned = status == CAIRN_OK;
    return status;
}

/* One beam of a scan at its best pose so far; beams without a return end at the greatest range. */
static cairn_status draw_beam(robot *r, const recorded_scan *scan, cairn_pose pose, int32_t beam)
{
    float range = scan->range[beam];
    int32_t hit = range <= r->mission.range_max;
    cairn_real angle = pose.theta + (cairn_real)scan->angle_min + (cairn_real)beam * (cairn_real)scan->angle_step;
    cairn_real length = hit ? (cairn_real)range : (cairn_real)r->mission.range_max, sine, cosine;
    cairn_vec2 from = {pose.x, pose.y}, to;

    if (!(range > 0))
        return CAIRN_OK;
    cairn_sincos(angle, &sine, &cosine);
    to.x = from.x + length * cosine;
    to.y = from.y + length * sine;
    return cairn_occupancy_grid_add_beam(r->grid, from, to, hit);
}

/* Draws the scans that are in the field again and again, each time at their poses of then. */
static cairn_status draw(robot *r, cairn_budget *budget)
{
    cairn_status status = cairn_occupancy_grid_step(r->grid, budget);

    while (status == CAIRN_OK && budget->left > 0 && r->drawn < cairn_force_field_pose_count(r->field)) {
        const recorded_scan *scan = &r->mission.scans[r->drawn];

        status = draw_beam(r, scan, cairn_force_field_pose(r->field, r->drawn), r->beam);
        budget->left -= GRID_BEAM_UNITS;
        if (++r->beam == scan->count) {
            r->beam = 0;
            r->drawn++;
        }
    }
    if (status != CAIRN_OK || r->drawn < cairn_force_field_pose_count(r->field))
        return status;
    r->drawing_ok = r->last_pass;
    if (!r->drawing_ok) {
        r->last_pass = r->aligned && !r->fitting && r->arrived == r->mission.scan_count;
        r->drawn = 0;
        cairn_occupancy_grid_clear(r->grid);
    }
    return CAIRN_OK;
}

static int32_t all_arrived(const robot *r)
{
    return r->arrived == r->mission.scan_count;
}

static tick_kind kind_of_tick(const robot *r)
{
    if (!r->fitting && !all_arrived(r) && (r->arrived == 0 || r->since >= r->mission.arrival))
        return TICK_ADD;
    if (r->tick % GRID_EVERY == GRID_EVERY - 1 && cairn_force_field_pose_count(r->field) > 0)
        return TICK_GRID;
    if (r->fitting)
        return TICK_FIT;
    return r->aligned && cairn_force_field_pose_count(r->field) > 0 ? TICK_GRID : TICK_PAIR;
}

/* 0 when all is done. */
static int32_t tick(robot *r)
{
    tick_kind kind = kind_of_tick(r);
    kind_measure *measure = &r->measure[kind];
    cairn_budget budget = {r->mission.tick_budget};
    uint32_t begin = board_clock(), took;
    cairn_status status = CAIRN_OK;

    switch (kind) {
    case TICK_ADD:
        status = take_in(r);
        break;
    case TICK_FIT:
        status = fit(r, &budget);
        break;
    case TICK_PAIR:
        status = pair(r, &budget);
        break;
    default:
        status = draw(r, &budget);
        break;
    }
    took = board_clock() - begin;
    if (status < 0)
        give_up(kind_name[kind], status);
    measure->ticks++;
    measure->sum += took;
    measure->worst = took > measure->worst ? took : measure->worst;
    if (r->mission.tick_budget - budget.left > measure->worst_units)
        measure->worst_units = r->mission.tick_budget - budget.left;
    r->tick++;
    r->since++;
    hash_state(r);
    return !r->drawing_ok;
}

/* ---- The program ---- */

static void print_poses(const robot *r)
{
    for (int32_t i = 0; i < cairn_force_field_pose_count(r->field); i++) {
        cairn_pose pose = cairn_force_field_pose(r->field, i);
        int64_t number[4] = {i, cairn_real_to_int(pose.x * 10000), cairn_real_to_int(pose.y * 10000),
                             cairn_real_to_int(pose.theta * 10000)};

        print_line("pose", "0.1mm,0.1mrad", number, 4);
    }
}

static void print_measures(const robot *r)
{
    const cairn_scan_set *kept = cairn_force_field_scans(r->field);
    cairn_force_field_state state = cairn_force_field_read(r->field);
    int64_t used[4] = {kept->scan_count, kept->point_count, kept->segment_count, state.corners};
    int64_t memory[4] = {(int64_t)r->pool.peak, (int64_t)r->mission.bytes, board_data_bytes(), board_stack_peak()};

    for (tick_kind kind = 0; kind < TICK_KINDS; kind++) {
        const kind_measure *m = &r->measure[kind];
        int64_t number[4] = {m->ticks, m->ticks > 0 ? (int64_t)(m->sum / m->ticks) : 0, m->worst, m->worst_units};

        print_line("measure ticks,mean,worst,units", kind_name[kind], number, 4);
    }
    print_line("measure scans,points,segments,corners", "used", used, 4);
    print_line("measure pool_peak,pool,data,stack", "bytes", memory, 4);
}

int main(void)
{
    robot *r = &the_robot;
    cairn_status status = create(r);
    char line[64], *at;

    if (status != CAIRN_OK)
        give_up("create", status);
    while (tick(r)) {
    }
    print_poses(r);
    at = put_text(put_text(line, "hash "), r->mission.name);
    at = put_hex(put_text(at, " "), r->hash);
    (void)put_text(at, "\n");
    board_print(line);
    print_measures(r);
    return 0;
}
