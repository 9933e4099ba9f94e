/* status: status codes, the fault of a refused input, the work budget of a step, and the mode of
 * a method.
 *
 * A status says whether a call was carried out. The verdict of a method (converged, ambiguous,
 * unobservable) is a field of its result, never a status. */
#ifndef CAIRN_STATUS_H
#define CAIRN_STATUS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Attribute of functions whose return value must be used. */
#if defined(__GNUC__) || defined(__clang__)
#define CAIRN_CHECKED __attribute__((warn_unused_result))
#else
#define CAIRN_CHECKED
#endif

/* Status code of a call. 0: success. Positive: not an error. Negative: the call was refused and
 * changed nothing. */
typedef int32_t cairn_status;
enum {
    /* Success: the call is complete. */
    CAIRN_OK = 0,
    /* Work is left: call the step, again where the budget was used up. */
    CAIRN_MORE = 1,
    /* A pointer is NULL, or a value is outside the range that the header states. */
    CAIRN_BAD_ARGUMENT = -1,
    /* An input is NaN or infinite. */
    CAIRN_NOT_FINITE = -2,
    /* Too little memory: the pool has fewer bytes left than _memory() or _scratch() returns, or the
     * heap of the host has none. */
    CAIRN_NO_MEMORY = -3,
    /* A capacity of the params (a field max_...) is used up. */
    CAIRN_FULL = -4,
    /* There is no input or no result to work on. */
    CAIRN_EMPTY = -5,
    /* The input does not follow its format. */
    CAIRN_BAD_FORMAT = -6,
    /* The input ends too early. */
    CAIRN_TRUNCATED = -7,
    /* The request is valid, but this build or state does not support the request. */
    CAIRN_UNSUPPORTED = -8,
    /* The operating system failed to read or write. */
    CAIRN_IO = -9,
    /* The library was compiled with options that change results (contracted multiply-adds,
     * subnormal numbers flushed to zero). */
    CAIRN_BAD_BUILD = -10,
    /* The last input is still being worked on: nothing was taken. Call the step until its work is
     * complete, then give the input again. */
    CAIRN_BUSY = -11
};

/* Text of a status in words, without a full stop: "out of pool memory". Constant storage. Any
 * value gives a text. */
const char *cairn_status_text(cairn_status status);

/* Position and description of the fault in an array or a file that was refused. */
typedef struct cairn_fault {
    /* Index of the element or number of the line, as the function's comment says. -1: the fault
     * has no single position. */
    int64_t index;
    /* Error message: the fault and the value that was expected. Constant text. NULL: no fault. */
    const char *message;
} cairn_fault;

/* Fills in *fault, unless NULL, and returns the status. Functions that report the position of a
 * fault return with it.
 *
 * index: position of the fault, for fault->index
 * what: constant text, for fault->message
 * status: returned as it is */
cairn_status cairn_refuse(cairn_fault *fault, int64_t index, const char *what, cairn_status status);

/* Work that a step may still do, counted down by the step. Several objects may share one budget.
 * No step leaves it below 0. With a budget of 0 or less a step does nothing, leaves the budget as it
 * is and returns CAIRN_MORE or CAIRN_OK. */
typedef struct cairn_budget {
    /* Work units left. One unit is 80 to 200 instructions of a Cortex-M7 on average, up to 480 in
     * the most expensive steps. Expensive operations are charged several units. */
    int32_t left;
} cairn_budget;

/* Charges units of operations that wait, as many as the budget reaches for; the step then does as
 * much of them. Returns the units charged, 0 when the budget is used up. Constant time.
 *
 * wanted: units of all of them; 0 or less: none wait */
inline int32_t cairn_budget_take(cairn_budget *budget, int32_t wanted)
{
    int32_t now = wanted < budget->left ? wanted : budget->left;

    if (now <= 0)
        return 0;
    budget->left -= now;
    return now;
}

/* Charges an operation of `cost` units to the budget, in several calls if the budget is used up
 * in between, so that the operation does not exceed it. *charged holds the units charged so far, 0 before
 * the first call and after the last. Returns 1 when the operation is charged in full and may be
 * done, 0 when the budget is used up. Constant time.
 *
 * charged: units already charged for this operation
 * cost: units of the operation, >= 0 */
int cairn_budget_charge(cairn_budget *budget, int32_t *charged, int32_t cost);

/* Charges units that a nested object has used of a budget of its own, which had no more units than
 * this one has left. An operation is charged by cairn_budget_charge() before it is done. Constant
 * time.
 *
 * units: units that the nested object has used, >= 0 */
static inline void cairn_budget_spend(cairn_budget *budget, int32_t units)
{
    budget->left -= units;
}

/* Method that an object follows: the field `mode` of its params. */
enum {
    /* The library's own method. */
    CAIRN_MODE_DEFAULT = 0,
    /* The method of Adluru 2008 as printed, with the constants of the thesis. The header of each
     * module lists the choices where the thesis is silent. */
    CAIRN_MODE_AS_WRITTEN = 1
};

/* Budget that no single call uses up, in work units. */
#define CAIRN_UNBOUNDED INT32_MAX

#ifdef __cplusplus
}
#endif

#endif
