/* The layout of the open structs does not depend on how the library is built: sizes and offsets
 * with assertions and the flags of this build are those in a program without them, in
 * tests/layout.h, which tools/layout.sh makes below the build folder. Their changes from release to release are found by
 * tools/check-abi.sh. */
#include "tests/test.h"

typedef struct layout {
    const char *name;
    size_t actual, expected;
} layout;

#define SIZE(type, in_double, in_float) #type, sizeof(type), NUMBER(in_double, in_float)
#define FIELD(type, field, d, f)        #type "." #field, offsetof(type, field), NUMBER(d, f)

#include "tests/layout.h"

static void open_structs_have_the_layout_that_a_program_without_flags_sees(void **state)
{
    (void)state;
    if (sizeof(void *) != 8 || _Alignof(int64_t) != 8)
        skip();
    for (size_t i = 0; i < sizeof OPEN_STRUCTS / sizeof *OPEN_STRUCTS; i++)
        if (OPEN_STRUCTS[i].actual != OPEN_STRUCTS[i].expected)
            fail_msg("%s is %zu, expected %zu", OPEN_STRUCTS[i].name, OPEN_STRUCTS[i].actual,
                     OPEN_STRUCTS[i].expected);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(open_structs_have_the_layout_that_a_program_without_flags_sees),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
