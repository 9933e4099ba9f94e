/* status: what a call returns, where an input went wrong, how much work a step may do, and which
 * method it follows.
 *
 * A status says whether a call could be carried out. What was found out by it (converged,
 * ambiguous, unobservable) is a field of the result, never a status. */
#ifndef CAIRN_STATUS_H
#define CAIRN_STATUS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__) || defined(__clang__)
#define CAIRN_CHECKED __attribute__((warn_unused_result))
#else
#define CAIRN_CHECKED
#endif

/* 0: done. Positive: not an error. Negative: the call was refused and nothing changed. */
typedef int32_t cairn_status;
enum {
    CAIRN_OK = 0,
    /* the budget is used up, there is work left: call again */
    CAIRN_MORE = 1,
    /* NULL, or a value outside the range that the header states */
    CAIRN_BAD_ARGUMENT = -1,
    /* NaN or infinity where a number is needed */
    CAIRN_NOT_FINITE = -2,
    /* the pool has less room than _memory() or _scratch() says */
    CAIRN_NO_MEMORY = -3,
    /* a capacity that the caller chose is used up */
    CAIRN_FULL = -4,
    /* nothing there to work on */
    CAIRN_EMPTY = -5,
    /* input that does not follow its format */
    CAIRN_BAD_FORMAT = -6,
    /* input that ends too early */
    CAIRN_TRUNCATED = -7,
    /* valid, but not offered by this build */
    CAIRN_UNSUPPORTED = -8,
    /* the operating system refused to read or write */
    CAIRN_IO = -9,
    /* compiled with options that change results (contraction, flush to zero) */
    CAIRN_BAD_BUILD = -10
};

/* A status in words, without a full stop: "out of pool memory". Constant storage; any value
 * gives a text. */
const char *cairn_status_text(cairn_status status);

/* Where an array or file went wrong. `index` counts elements or lines as the function's comment
 * says; -1: no one place. `what` is constant text that says what is wrong and what was expected;
 * NULL when there was no fault. */
typedef struct cairn_fault {
    int64_t index;
    const char *what;
} cairn_fault;

/* Fills in the fault, unless it is NULL, and returns the status: how a call that can say where
 * refuses. */
cairn_status cairn_refuse(cairn_fault *fault, int64_t index, const char *what, cairn_status status);

/* Work that a step may still do, counted down. One unit is at most about 200 instructions of a
 * Cortex-M7; dearer items charge several. Objects may share one budget. 0 is legal: the step
 * does nothing and returns CAIRN_MORE or CAIRN_OK. */
typedef struct cairn_budget {
    int32_t left;
} cairn_budget;

/* Pays for an item of `cost` units, over several calls if need be, so that no step uses more
 * than its budget; *paid holds what was paid so far, 0 before the first. 1 when the item is paid
 * and may be done, 0 when the budget is used up before. */
static inline int cairn_budget_pay(cairn_budget *budget, int32_t *paid, int32_t cost)
{
    int32_t due = cost - *paid, now = due < budget->left ? due : budget->left;

    if (now > 0) {
        *paid += now;
        budget->left -= now;
    }
    if (*paid < cost)
        return 0;
    *paid = 0;
    return 1;
}

/* The method that an object follows: field `mode` of its params. */
enum {
    /* the library's own method */
    CAIRN_MODE_DEFAULT = 0,
    /* that of Adluru 2008 as it is printed, with its constants; headers list what it leaves open */
    CAIRN_MODE_AS_WRITTEN = 1
};

/* A budget that is never used up by one call. */
#define CAIRN_UNBOUNDED INT32_MAX

#ifdef __cplusplus
}
#endif

#endif
