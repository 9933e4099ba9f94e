/* Libraries loaded on demand: zlib is the example, its "table" is the text of its version. */
#include "src/host/images/shim.h"

#include <stdlib.h>
#include <zlib.h>

#include "tests/test.h"

#define LIBRARY  "libz.so.1"
#define VARIABLE "CAIRN_TEST_SHIM"

static void loads_what_fits(void **state)
{
    int32_t version;

    (void)state;
    memcpy(&version, zlibVersion(), sizeof version);
    (void)unsetenv(VARIABLE);
    assert_non_null(cairn_shim_find(LIBRARY, VARIABLE, "zlibVersion", version));
    assert_null(cairn_shim_find(LIBRARY, VARIABLE, "zlibVersion", version + 1));
    assert_null(cairn_shim_find(LIBRARY, VARIABLE, "no_function_of_zlib", version));
    assert_null(cairn_shim_find("libnowhere.so", VARIABLE, "zlibVersion", version));
    /* A given path is the only one tried. */
    (void)setenv(VARIABLE, "/nowhere/libz.so.1", 1);
    assert_null(cairn_shim_find(LIBRARY, VARIABLE, "zlibVersion", version));
    (void)setenv(VARIABLE, LIBRARY, 1);
    assert_non_null(cairn_shim_find("libnowhere.so", VARIABLE, "zlibVersion", version));
    (void)unsetenv(VARIABLE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(loads_what_fits)};

    return cmocka_run_group_tests(tests, NULL, NULL);
}
