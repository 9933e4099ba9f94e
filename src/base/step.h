/* Steps that read from top to bottom: a function that returns when the budget of its caller is used
 * up, and continues at the same place when it is called again.
 *
 * Method: the body of a step is one switch over a resume point, which the object keeps. A place
 * where the step may return is a case label, inside of loops as well (Duff's device; protothreads).
 * The points of a body are counted from 1: consecutive numbers take less code than lines do.
 *
 *     static int sum(object *object, cairn_budget *budget)
 *     {
 *         CAIRN_STEP_BEGIN(object->resume);
 *         for (object->i = 0; object->i < object->count; object->i++) {
 *             CAIRN_STEP_CHARGE(object, resume, budget, UNITS_PER_VALUE);
 *             object->sum += object->values[object->i];
 *         }
 *         CAIRN_STEP_END(object->resume);
 *     }
 *
 * Limits: what is needed after a place of return is kept in the object: a block with such a place
 * declares no variables, since they lose their values there; those before BEGIN get theirs anew at
 * every call. Between BEGIN and END there is no `return`, no `break` outside of a loop, and no
 * further switch with a place of return; a step that is run by another one has a resume point of its
 * own. Two places of return do not share a line. begin() of an object sets its resume points to 0,
 * and so drops a step that is under way.
 *
 * Deviations from MISRA C 2012: case labels inside of blocks, and what follows from them (rules
 * 14.3, 16.1 to 16.3).
 *
 * Source: Duff 1983; Dunkels et al. 2006, Protothreads. */
#ifndef CAIRN_BASE_STEP_H
#define CAIRN_BASE_STEP_H

#include "cairn/status.h"
#include "src/base/build.h"

/* Attribute of a function with a hot loop that a step calls: gcc vectorizes less of what it inlines
 * between places of return, whose loops have two entries. */
#ifdef __GNUC__
#define CAIRN_STEP_NOT_INLINED __attribute__((noinline))
#else
#define CAIRN_STEP_NOT_INLINED
#endif

/* Number of a resume point: counted, where the compiler can, else a line. */
#ifdef __COUNTER__
#define CAIRN_STEP_POINT __COUNTER__
#else
#define CAIRN_STEP_POINT __LINE__
#endif

/* Opens the body of a step, which continues where it returned last.
 *
 * resume: resume point, 0 before the first call */
#define CAIRN_STEP_BEGIN(resume)                                                                   \
    enum { first_point_ = CAIRN_STEP_POINT };                                                      \
    switch (resume) {                                                                              \
    case 0:

/* Place of return: the step returns 0 while `ready` is 0, and evaluates it again when it is called
 * again. `ready` charges the operation that follows, or runs a step of its own to its end. */
#define CAIRN_STEP_UNTIL(resume, ready) CAIRN_STEP_UNTIL_AT(resume, CAIRN_STEP_POINT, ready)
#define CAIRN_STEP_UNTIL_AT(resume, point, ready)                                                  \
    do {                                                                                           \
        if (0) {                                                                                   \
        case (point)-first_point_:;                                                                \
        }                                                                                          \
        if (!(ready)) {                                                                            \
            (resume) = (point)-first_point_;                                                       \
            return 0;                                                                              \
        }                                                                                          \
    } while (0)

/* Place of return: the step continues when a phase has run to its end, which is a step with a
 * resume point of its own.
 *
 * object: pointer to the struct with the resume point
 * resume: field of the resume point of the step that waits
 * phase: function of object and budget; returns 1 at its end, 0 when the budget is used up */
#define CAIRN_STEP_RUN(object, resume, budget, phase)                                              \
    CAIRN_STEP_UNTIL((object)->resume, phase(object, budget))

/* Place of return: the step continues when the operation that follows is charged. What is charged
 * of it when the budget is used up stays in object->units_charged.
 *
 * object: pointer to the struct with the resume point and units_charged
 * resume: field of the resume point
 * units: units of the operation */
#define CAIRN_STEP_CHARGE(object, resume, budget, units)                                           \
    CAIRN_STEP_UNTIL((object)->resume, cairn_budget_charge(budget, &(object)->units_charged, units))

/* The same for an operation of one unit, which is charged at once or not at all. */
#define CAIRN_STEP_CHARGE_UNIT(object, resume, budget)                                             \
    do {                                                                                           \
        CAIRN_STEP_UNTIL((object)->resume, (budget)->left > 0);                                    \
        (budget)->left--;                                                                          \
    } while (0)

/* The same for items of a loop that cost little: one unit is charged before items 0, each,
 * 2 each, ... */
#define CAIRN_STEP_CHARGE_EVERY(object, resume, budget, each, i)                                   \
    do {                                                                                           \
        if ((i) % (each) == 0)                                                                     \
            CAIRN_STEP_CHARGE_UNIT(object, resume, budget);                                        \
    } while (0)

/* Charges an operation of `eighths` of a unit, in whole units and in several calls if the budget is
 * used up in between. 1 when the operation is charged and may be done, 0 when the budget is used
 * up. Constant time.
 *
 * used: eighths used but not yet charged; below 0: charged for the operation that waits
 * units: sum of the units charged */
inline int cairn_step_charge_eighths(cairn_budget *budget, int32_t *used, int64_t *units,
                                     int32_t eighths)
{
    uint32_t due = (uint32_t)(*used + eighths);
    int32_t wanted = (int32_t)(due / 8), left = budget->left;

    if (left <= 0)
        return 0;
    if (wanted > left) {
        budget->left = 0;
        *units += left;
        *used -= 8 * left;
        return 0;
    }
    budget->left = left - wanted;
    *units += wanted;
    *used = (int32_t)(due % 8);
    return 1;
}

/* Place of return: the step continues when the operation that follows is charged, whose cost is in
 * eighths of a unit. The object has eighths_used and measure.units. */
#define CAIRN_STEP_CHARGE_EIGHTHS(object, resume, budget, eighths)                                 \
    CAIRN_STEP_UNTIL((object)->resume,                                                             \
                     cairn_step_charge_eighths(budget, &(object)->eighths_used,                    \
                                               &(object)->measure.units, eighths))

/* The same for items of a loop up to `end`: items 0, each, 2 each, ... are charged with those that
 * follow, since a check per item would be measurable.
 *
 * eighths: of one item */
#define CAIRN_STEP_CHARGE_EIGHTHS_EVERY(object, resume, budget, each, i, end, eighths)             \
    do {                                                                                           \
        if ((i) % (each) == 0)                                                                     \
            CAIRN_STEP_CHARGE_EIGHTHS(object, resume, budget,                                      \
                                      ((end) - (i) < (each) ? (end) - (i) : (each)) * (eighths));  \
    } while (0)

/* Closes the body of a step, which returns 1 and starts anew when it is called again. */
#define CAIRN_STEP_END(resume)                                                                     \
    break;                                                                                         \
    default:                                                                                       \
        CAIRN_ASSERT((resume) == 0);                                                               \
        }                                                                                          \
        (resume) = 0;                                                                              \
        return 1

#endif
