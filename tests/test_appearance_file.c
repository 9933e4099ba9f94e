/* Appearance models as files: kept, bad files refused. */
#include "cairn/appearance_file.h"

#include <math.h>

#include "tests/appearance_small.h"
#include "tests/files.h"

static cairn_file_error error;

static void keeps_models(void **state)
{
    cairn_appearance_model made = make_small(), got;
    const char *path = files_path("small.look");

    (void)state;
    made.weights[0] = (cairn_real)1 / 3;
    made.histograms[2] = 0.1F;
    assert_ok(cairn_appearance_file_write(&made, path, &error));
    assert_ok(cairn_appearance_file_read(&got, path, &error));
    assert_int_equal(got.word_count, 2);
    assert_int_equal(got.support_count, 2);
    assert_memory_equal(got.words, made.words, 2 * CAIRN_APPEARANCE_DESCRIPTOR_SIZE);
    assert_memory_equal(got.histograms, made.histograms, 4 * sizeof(float));
    assert_memory_equal(got.weights, made.weights, 2 * sizeof(cairn_real));
    assert_near(got.gamma, 0.5, 0);
    assert_near(got.rho, 0.25, 0);
    assert_near(got.platt_slope, -2, 0);
    assert_near(got.platt_offset, 0.125, 0);
    cairn_appearance_file_free(&got);
    made.weights[0] = 2;
    made.histograms[2] = 0.25F;
}

static void assert_unreadable(const char *text, cairn_status status, const char *what)
{
    cairn_appearance_model m;

    assert_status(cairn_appearance_file_read(&m, files_write_text("bad.look", text), &error),
                  status);
    assert_null(m.words);
    assert_null(m.histograms);
    if (strstr(error.text, what) == NULL || strstr(error.text, "expected") == NULL)
        fail_msg("\"%s\" does not hold \"%s\"", error.text, what);
}

/* Every truncated file is refused, and so are foreign files, other versions, and impossible
 * numbers. */
static void refuses_what_is_no_model(void **state)
{
    cairn_appearance_model m = make_small();
    char *text, *at, kept;
    size_t length;

    (void)state;
    assert_ok(cairn_appearance_file_write(&m, files_path("whole.look"), &error));
    text = files_read(files_path("whole.look"), NULL);
    assert_non_null(text);
    length = strlen(text);
    for (size_t cut = 0; cut + 2 < length; cut += 1 + cut / 50) {
        cairn_appearance_model got;

        kept = text[cut];
        text[cut] = '\0';
        assert_true(cairn_appearance_file_read(&got, files_write_text("cut.look", text), &error) <
                    0);
        assert_null(got.words);
        text[cut] = kept;
    }
    assert_unreadable("", CAIRN_TRUNCATED, "the file ends here, expected 'cairn-appearance 1'");
    assert_unreadable("cairn-shape 1\n", CAIRN_BAD_FORMAT,
                      ":1: \"cairn-shape\", expected 'cairn-appearance'");
    assert_unreadable("cairn-appearance 2\nwords 2\n", CAIRN_UNSUPPORTED,
                      ":1: a model of version 2, expected 1");
    assert_unreadable("cairn-appearance 1\nwords 1001\n", CAIRN_BAD_FORMAT,
                      ":2: \"1001\", expected a number of 2");
    assert_unreadable("cairn-appearance 1\nwords 2.5\n", CAIRN_BAD_FORMAT,
                      ":2: 2.5, expected a whole number");
    assert_unreadable("cairn-appearance 1\nwords 1e300\n", CAIRN_BAD_FORMAT,
                      ":2: \"1e300\", expected a number of 2");
    assert_unreadable("cairn-appearance 1\nwords nan\n", CAIRN_BAD_FORMAT,
                      ":2: \"nan\", expected a number of 2");
    assert_unreadable("cairn-appearance 1 2\n", CAIRN_BAD_FORMAT,
                      ":1: \"2\", expected the line to end");
    at = strstr(text, " 1 2 3 ");
    assert_non_null(at);
    memcpy(at, " 1 x 3 ", 7);
    assert_unreadable(text, CAIRN_BAD_FORMAT, ":3: \"x\", expected a number of 0 ... 255");
    memcpy(at, " 1 2 3 ", 7);
    at = strstr(text, "machine 0.5");
    memcpy(at, "machine 0.0", 11);
    assert_unreadable(text, CAIRN_BAD_FORMAT, "expected a number of 1e-09");
    memcpy(at, "machine 0.5", 11);
    memcpy(text + length - 4, "END\n", 4);
    assert_unreadable(text, CAIRN_BAD_FORMAT, "\"END\", expected 'end'");
    free(text);
    assert_status(cairn_appearance_file_read(&m, files_path("missing.look"), &error), CAIRN_IO);
}

/* Nothing is written that the reader would refuse. */
static void writes_nothing_unreadable(void **state)
{
    static float beyond[] = {1, 0, 1.5F, 0};
    static cairn_real none[] = {2, (cairn_real)NAN};

    (void)state;
    for (int k = 0; k < 8; k++) {
        cairn_appearance_model m = make_small();

        switch (k) {
        case 0:
            m.gamma = 0;
            break;
        case 1:
            m.gamma = (cairn_real)INFINITY;
            break;
        case 2:
            m.rho = (cairn_real)NAN;
            break;
        case 3:
            m.platt_slope = CAIRN_REAL(-2e9);
            break;
        case 4:
            m.histograms = beyond;
            break;
        case 5:
            m.weights = none;
            break;
        case 6:
            m.support_count = 0;
            break;
        default:
            m.word_count = 1;
            break;
        }
        assert_status(cairn_appearance_file_write(&m, files_path("never.look"), &error),
                      CAIRN_BAD_ARGUMENT);
        assert_non_null(
            strstr(error.text, "never.look: a model beyond what is read again, expected"));
        assert_null(files_read(files_path("never.look"), NULL));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(keeps_models),
        cmocka_unit_test(refuses_what_is_no_model),
        cmocka_unit_test(writes_nothing_unreadable),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
