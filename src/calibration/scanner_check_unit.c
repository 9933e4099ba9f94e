/* The unit of the ranges: the one with which the motions of matched scans agree with the odometry;
 * when none does, that of the most usual ranges where those of the log are impossible in m. */
#include "src/base/build.h"

#include "src/base/step.h"
#include "src/calibration/scanner_check_work.h"

/* Medians of ranges in m, in buildings and around them. */
static const cairn_real SHORTEST_MEDIAN_M = CAIRN_REAL(0.15);
static const cairn_real LONGEST_MEDIAN_M = 60;
static const cairn_real USUAL_MEDIAN_M = 3;
/* Factors of units: m, mm, cm, dm, feet, and ranges that were divided once too often. */
static const cairn_real UNIT_FACTORS[] = {
    1, CAIRN_REAL(0.001), CAIRN_REAL(0.01), CAIRN_REAL(0.1), CAIRN_REAL(0.3048), 10, 100, 1000};
enum { UNIT_COUNT = sizeof UNIT_FACTORS / sizeof *UNIT_FACTORS };
/* The unit is wrong when motions of scans and odometry differ by more than the first factor;
 * another one is right when they differ by less than the second. */
static const cairn_real UNIT_WRONG = CAIRN_REAL(1.5);
static const cairn_real UNIT_RIGHT = CAIRN_REAL(1.2);
/* A ratio of distances with a larger standard deviation, as a share of it, is not known. */
static const cairn_real RATIO_KNOWN = CAIRN_REAL(0.2);

/* Ranges whose upper quartile is not above this many times the lower one are all alike: what the
 * scanner reports without a return. */
static const cairn_real MIN_QUARTILE_RATIO = CAIRN_REAL(1.02);

cairn_real cairn_scanner_check_factor(cairn_real ratio)
{
    return ratio > 1 ? ratio : 1 / ratio;
}

static void set_unit(cairn_scanner_check *check, cairn_real unit)
{
    check->correction.range_scale = unit;
    check->correction.range_max = cairn_scan_correction_limit(
        (cairn_real)check->drive.scans[0].input.range_max, check->drive.quartile[1], unit);
}

static int is_usual(cairn_real median)
{
    return median >= SHORTEST_MEDIAN_M && median <= LONGEST_MEDIAN_M;
}

/* Returns the unit whose median is the most usual. */
static cairn_real unit_by_median(cairn_real median)
{
    cairn_real best = 1;

    for (int i = 0; i < UNIT_COUNT; i++)
        if (cairn_scanner_check_factor(UNIT_FACTORS[i] * median / USUAL_MEDIAN_M) <
            cairn_scanner_check_factor(best * median / USUAL_MEDIAN_M))
            best = UNIT_FACTORS[i];
    return best;
}

/* Returns by what factor the motions of the scans differ from those of the odometry, >= 1; 0: not
 * known. */
static cairn_real distance_factor(const cairn_scanner_check *check)
{
    const cairn_scanner_check_value *distance = &check->fit.distance;

    return distance->is_known && distance->sigma < RATIO_KNOWN * distance->value
               ? cairn_scanner_check_factor(distance->value)
               : 0;
}

/* Matches and compares with the odometry. */
static int measure_distance(cairn_scanner_check *check, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(check->at.distance);
    CAIRN_STEP_RUN(check, at.distance, budget, cairn_scanner_check_match);
    CAIRN_STEP_RUN(check, at.distance, budget, cairn_scanner_check_mounting);
    CAIRN_STEP_END(check->at.distance);
}

/* Takes the unit that was tried when it is better than all before. */
static void take_unit(cairn_scanner_check *check)
{
    cairn_real factor = distance_factor(check);

    if (factor > 0 && factor < check->unit.error) {
        check->unit.error = factor;
        check->unit.best = UNIT_FACTORS[check->unit.candidate];
    }
}

int cairn_scanner_check_find_unit(cairn_scanner_check *check, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(check->at.unit);
    check->unit.best = 1;
    check->unit.error = UNIT_RIGHT;
    check->unit.tries_others =
        check->drive.has_odometry &&
        check->drive.quartile[2] > MIN_QUARTILE_RATIO * check->drive.quartile[0];
    set_unit(check, 1);
    if (check->drive.quartile[2] > MIN_QUARTILE_RATIO * check->drive.quartile[0] &&
        !is_usual(check->drive.quartile[1]))
        check->unit.best = unit_by_median(check->drive.quartile[1]);
    else if (check->unit.tries_others) {
        CAIRN_STEP_RUN(check, at.unit, budget, measure_distance);
        check->unit.tries_others = distance_factor(check) >= UNIT_WRONG;
    }
    for (check->unit.candidate = 1; check->unit.candidate < UNIT_COUNT && check->unit.tries_others;
         check->unit.candidate++) {
        if (!is_usual(UNIT_FACTORS[check->unit.candidate] * check->drive.quartile[1]))
            continue;
        set_unit(check, UNIT_FACTORS[check->unit.candidate]);
        CAIRN_STEP_RUN(check, at.unit, budget, measure_distance);
        take_unit(check);
    }
    set_unit(check, check->unit.best);
    CAIRN_STEP_END(check->at.unit);
}
