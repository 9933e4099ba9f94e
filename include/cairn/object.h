/* object: why the params of an object were refused.
 *
 * Every object of cairn is created from a struct of parameters, whose fields have a default and a
 * range, written in brackets and before it in the headers. _check() of a module says which field is
 * out of range, or which rule between fields does not hold; _memory() and _create() refuse the same
 * params. */
#ifndef CAIRN_OBJECT_H
#define CAIRN_OBJECT_H

#include "cairn/real.h"
#include "cairn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Parameter that was refused. */
typedef struct cairn_object_fault {
    /* Name of the module whose parameter it is: "polyline". Constant text. */
    const char *module;
    /* Name of the field that is out of range: "max_points". Constant text. NULL: the fault is not
     * in one field, and `rule` says what was expected. */
    const char *field;
    /* What was expected: the bounds that belong to the range, or a rule between fields. Constant
     * text. */
    const char *rule;
    /* Value of the field, and its range; 0 when field is NULL. */
    cairn_real value, lowest, highest;
} cairn_object_fault;

#ifdef __cplusplus
}
#endif

#endif
