/* Sizes and offsets of the open structs are part of the ABI: a change requires a new soname, and
 * then a new tests/layout.h by tools/layout.sh. */
#include "tests/test.h"

typedef struct layout {
    const char *name;
    size_t actual, expected;
} layout;

#define SIZE(type, in_double, in_float) #type, sizeof(type), NUMBER(in_double, in_float)
#define FIELD(type, field, d, f)        #type "." #field, offsetof(type, field), NUMBER(d, f)

#include "tests/layout.h"

static void open_structs_keep_their_layout(void **state)
{
    (void)state;
    if (sizeof(void *) != 8 || _Alignof(int64_t) != 8)
        skip();
    for (size_t i = 0; i < sizeof OPEN_STRUCTS / sizeof *OPEN_STRUCTS; i++)
        if (OPEN_STRUCTS[i].actual != OPEN_STRUCTS[i].expected)
            fail_msg("%s is %zu, was %zu", OPEN_STRUCTS[i].name, OPEN_STRUCTS[i].actual,
                     OPEN_STRUCTS[i].expected);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(open_structs_keep_their_layout),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
