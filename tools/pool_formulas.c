/* Prints the memory of objects as a linear formula of their capacities: rows for
 * docs/memory-and-time.md, written by tools/footprint.sh.
 *
 * A formula is fitted to _memory() with all its capacities at 1024 and one of them at 2048; all
 * other capacities have their defaults. Where memory grows in powers of two (hash grids) or with
 * pairs, it holds between these. */
#include <stdio.h>

#include "tools/pool_objects.h"

enum { FIRST = 1024, SECOND = 2048 };

/* Returns the bytes with all capacities of the formula at FIRST, except `other` at SECOND; -1: all
 * at FIRST. */
static double bytes_with(const pool_object *o, int other)
{
    int32_t values[POOL_CAPACITIES];
    size_t bytes;

    for (int k = 0; k < o->linear; k++)
        values[k] = k == other ? SECOND : FIRST;
    bytes = pool_object_bytes(o, values, o->linear);
    if (bytes == 0)
        fprintf(stderr, "pool_formulas: %s refuses capacities of %d and %d\n", o->name, FIRST,
                SECOND);
    return (double)bytes;
}

static int print_formula(const pool_object *o)
{
    double base = bytes_with(o, -1), fixed = base;
    double each[POOL_CAPACITIES];
    int good = base > 0;

    for (int k = 0; k < o->linear; k++) {
        double more = bytes_with(o, k);

        good = good && more > 0;
        each[k] = (more - base) / (SECOND - FIRST);
        fixed -= each[k] * FIRST;
    }
    printf("| `%s`: fixed | %.0f |\n", o->name, fixed);
    for (int k = 0; k < o->linear; k++)
        printf("| `%s`: each %s | %.1f |\n", o->name, o->capacities[k].name, each[k]);
    return good;
}

int main(void)
{
    int good = 1;

    for (const pool_object *o = pool_objects; o->name != NULL; o++)
        if (o->linear > 0)
            good = print_formula(o) && good;
    return good ? 0 : 1;
}
