/* The pool memory of every object, at its defaults and with each capacity changed, compared with
 * stored values: memory is part of the contract. */
#include "tests/kept.h"
#include "tools/pool_objects.h"

enum { MAX_COUNT = 400, NAME = 48 };

typedef struct question {
    const pool_object *object;
    int32_t capacity; /* the changed capacity; -1: none */
} question;

/* With the capacities up to `capacity` at their defaults, the last of them increased by so much. */
static size_t bytes_with(const question *q, int32_t more)
{
    int32_t values[POOL_CAPACITIES];

    for (int32_t k = 0; k <= q->capacity; k++)
        values[k] = pool_object_default(q->object, k);
    if (q->capacity >= 0)
        values[q->capacity] += more;
    return pool_object_bytes(q->object, values, q->capacity + 1);
}

/* The default; or the sum over sixteen numbers from a third more than the default on. For a choice
 * these are the next values; beyond the limit they start from a third less. Sizes are rounded up,
 * and one element more shows in one of the sixteen. */
static void format_value(const void *item, char text[KEPT_TEXT])
{
    const question *q = item;
    int32_t third = q->capacity < 0 ? 0 : pool_object_default(q->object, q->capacity) / 3;
    size_t bytes = bytes_with(q, 0);

    for (int32_t k = 1; k <= CAIRN_ALIGN && q->capacity >= 0; k++) {
        size_t more = bytes_with(q, third + k);

        bytes += more > 0 ? more : bytes_with(q, -third - k);
    }
    (void)snprintf(text, KEPT_TEXT, "%zu", bytes);
}

/* Under AddressSanitizer allocations have gaps, and sizes differ: only that they are above 0. */
static void defaults_are_accepted(void **state)
{
    (void)state;
    for (const pool_object *o = pool_objects; o->name != NULL; o++)
        assert_true(pool_object_bytes(o, NULL, 0) > 0);
}

int main(int argc, char **argv)
{
    static question questions[MAX_COUNT];
    static kept_value values[MAX_COUNT];
    static char names[MAX_COUNT][NAME];
    const struct CMUnitTest with_gaps[] = {cmocka_unit_test(defaults_are_accepted)};
    int32_t count = 0;

    if (CAIRN_POOL_REDZONE > 0)
        return cmocka_run_group_tests(with_gaps, NULL, NULL);
    for (const pool_object *o = pool_objects; o->name != NULL; o++)
        for (int32_t k = -1;
             k < POOL_CAPACITIES && (k < 0 || o->capacities[k].name != NULL) && count < MAX_COUNT;
             k++) {
            questions[count].object = o;
            questions[count].capacity = k;
            (void)snprintf(names[count], NAME, "%s_%s", o->name,
                           k < 0 ? "default" : o->capacities[k].field);
            for (char *c = names[count]; *c != 0; c++)
                if (*c == '.')
                    *c = '_';
            values[count].name = names[count];
            values[count].item = &questions[count];
            count++;
        }
    return kept_main(argc, argv, KEPT_FILE("memory"), values, count, format_value);
}
