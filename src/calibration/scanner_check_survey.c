/* What the drive says itself: stamps, repeated scans, the odometry, quartiles of the ranges.
 *
 * Method: an order statistic of the ranges is found without sorting them: the bits of positive floats
 * are in the order of the numbers. A pass counts the ranges by eight of their bits, from the first on,
 * among those that share the bits before with the number sought; four passes find all of its bits
 * (radix selection). */
#include "src/base/build.h"

#include <string.h>

#include "src/base/step.h"
#include "src/calibration/scanner_check_work.h"

enum { BEAMS_PER_UNIT = 16, UNITS_PER_SCAN = 2, UNITS_PER_PASS = 8 };
enum { BITS_PER_PASS = 8, HIGHEST_SHIFT = 24 };

/* m, rad: an odometry that moves less than this does not move. */
static const cairn_real MOVES_M = CAIRN_REAL(0.5);
static const cairn_real MOVES_RAD = CAIRN_REAL(0.5);
/* m, rad: a scan after a greater motion must differ from the one before. */
static const cairn_real MOVED_M = CAIRN_REAL(0.02);
static const cairn_real MOVED_RAD = CAIRN_REAL(0.01);

static int is_return(float range)
{
    return range > 0 && range <= FLT_MAX;
}

/* Units of a pass over the beams of a scan. */
static int32_t units_of(const cairn_scan_input *input)
{
    return UNITS_PER_SCAN + input->count / BEAMS_PER_UNIT;
}

/* ---- Scans ---- */

static int32_t count_returns(const cairn_scan_input *input)
{
    int32_t returns = 0;

    for (int32_t i = 0; i < input->count; i++)
        returns += is_return(input->range[i]);
    return returns;
}

/* 1 when all ranges are the same, and some are returns. */
static int32_t is_same_scan(const cairn_scan_input *a, const cairn_scan_input *b)
{
    return count_returns(b) > 0 && a->count == b->count &&
           memcmp(a->range, b->range, (size_t)a->count * sizeof *a->range) == 0;
}

/* Counts the returns of a scan, its stamp, and its motion from the scan before. */
static void count_scan(cairn_scanner_check *check, int32_t scan)
{
    const cairn_scanner_check_scan *b = &check->drive.scans[scan], *a = b - 1;
    cairn_scanner_check_result *found = &check->found;
    cairn_pose motion;
    cairn_real distance, turn;

    check->survey.returns += count_returns(&b->input);
    if (scan == 0)
        return;
    motion = cairn_scanner_check_motion(check, scan - 1, scan);
    distance = cairn_scanner_check_distance(motion);
    turn = cairn_abs(motion.theta);
    check->survey.odometry_length += distance;
    check->survey.odometry_turn += turn;
    found->backward += b->input.stamp_ns < a->input.stamp_ns;
    found->constant += b->input.stamp_ns == a->input.stamp_ns;
    if (distance > MOVED_M || turn > MOVED_RAD) {
        found->moved++;
        found->repeated += is_same_scan(&a->input, &b->input);
    }
}

/* ---- Quartiles ---- */

static uint32_t bits_of(float range)
{
    uint32_t bits;

    memcpy(&bits, &range, sizeof bits);
    return bits;
}

static float range_of(uint32_t bits)
{
    float range;

    memcpy(&range, &bits, sizeof range);
    return range;
}

/* Counts the ranges of a scan that share the leading bits, by the bits that follow. */
static void count_bits(cairn_scanner_check *check, const cairn_scan_input *input)
{
    uint32_t mask = check->survey.shift == HIGHEST_SHIFT
                        ? 0
                        : ~UINT32_C(0) << (uint32_t)(check->survey.shift + BITS_PER_PASS);

    for (int32_t i = 0; i < input->count; i++) {
        uint32_t bits;

        if (!is_return(input->range[i]))
            continue;
        bits = bits_of(input->range[i]);
        if ((bits & mask) == check->survey.prefix)
            check->survey.bins[bits >> (uint32_t)check->survey.shift & (SCANNER_CHECK_BINS - 1)]++;
    }
}

/* Enters the bin of the rank that is sought. */
static void enter_bin(cairn_scanner_check *check)
{
    uint32_t bin = 0;

    for (; bin < SCANNER_CHECK_BINS - 1 && check->survey.rank >= check->survey.bins[bin]; bin++)
        check->survey.rank -= check->survey.bins[bin];
    check->survey.prefix |= bin << (uint32_t)check->survey.shift;
}

/* ---- The survey ---- */

static void describe(cairn_scanner_check *check)
{
    const cairn_scan_input *first = &check->drive.scans[0].input;
    cairn_scanner_check_result *found = &check->found;

    found->scans = check->drive.count;
    found->angle_step = cairn_abs(cairn_scan_correction_mean_step(first));
    found->sweep = (cairn_real)first->time_step * (cairn_real)(first->count - 1);
    found->base_sensor = first->base_sensor;
    found->range_scale = 1;
}

int cairn_scanner_check_survey(cairn_scanner_check *check, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(check->at.survey);
    describe(check);
    check->survey.returns = 0;
    check->survey.odometry_length = check->survey.odometry_turn = 0;
    for (check->cursor = 0; check->cursor < check->drive.count; check->cursor++) {
        CAIRN_STEP_CHARGE(check, at.survey, budget,
                          units_of(&check->drive.scans[check->cursor].input));
        count_scan(check, check->cursor);
    }
    check->drive.has_odometry =
        check->survey.odometry_length > MOVES_M || check->survey.odometry_turn > MOVES_RAD;
    check->found.has_odometry = check->drive.has_odometry;
    memset(check->drive.quartile, 0, sizeof check->drive.quartile);
    for (check->survey.part = 0; check->survey.part < 3 && check->survey.returns > 0;
         check->survey.part++) {
        check->survey.prefix = 0;
        check->survey.rank = (check->survey.part + 1) * (check->survey.returns - 1) / 4;
        for (check->survey.shift = HIGHEST_SHIFT; check->survey.shift >= 0;
             check->survey.shift -= BITS_PER_PASS) {
            CAIRN_STEP_CHARGE(check, at.survey, budget, UNITS_PER_PASS);
            memset(check->survey.bins, 0, sizeof check->survey.bins);
            for (check->cursor = 0; check->cursor < check->drive.count; check->cursor++) {
                CAIRN_STEP_CHARGE(check, at.survey, budget,
                                  units_of(&check->drive.scans[check->cursor].input));
                count_bits(check, &check->drive.scans[check->cursor].input);
            }
            enter_bin(check);
        }
        check->drive.quartile[check->survey.part] = (cairn_real)range_of(check->survey.prefix);
    }
    check->found.median_range = check->drive.quartile[1];
    CAIRN_STEP_END(check->at.survey);
}
