/* CSM's scans: every field, every fault, files truncated at every byte. */
#include "tests/files.h"

#include <math.h>
#include <zlib.h>

#include "cairn/csm_scan.h"

static const char whole[] =
    "{\"nrays\": 3, \"min_theta\": -1.5, \"max_theta\": 1.5,\n"
    " \"theta\": [-1.5, 0.25, 1.5], \"readings\": [2.5, null, 3.125], \"valid\": [1, 0, 1],\n"
    " \"odometry\": [1, -2, 7], \"estimate\": [0, null, 0], \"cluster\": [-1, {\"a\": []}, -1],\n"
    " \"timestamp\": [1147713122, 541201], \"true_pose\": [0.5, 0.25, -0.125]}\n"
    "{\"max_theta\": 2, \"min_theta\": 1, \"readings\": [0, -1, 79.5, 80, 1e30], \"nrays\": 5, "
    "\"timestamp\": -0.5}";

static void load(cairn_csm_scan_list *scans, const char *text)
{
    cairn_file_error error;

    if (cairn_csm_scan_load(scans, files_write_text("scans.json", text), NULL, &error) != CAIRN_OK)
        fail_msg("%s", error.text);
}

static void test_fields(void **state)
{
    static const float angle[3] = {-1.5f, 0.25f, 1.5f};
    cairn_csm_scan_list scans;
    const cairn_csm_scan *s;

    (void)state;
    load(&scans, whole);
    assert_int_equal(scans.count, 2);
    assert_int_equal(scans.max_rays, 5);
    s = &scans.scan[0];
    assert_int_equal(s->line, 1);
    assert_int_equal(s->scan.count, 3);
    assert_near(s->scan.range[0], 2.5, 0);
    assert_true(isnan(s->scan.range[1]));
    assert_near(s->scan.range[2], 3.125, 0);
    assert_memory_equal(s->scan.angle, angle, sizeof angle);
    assert_near(s->scan.range_min, 0, 0);
    assert_near(s->scan.range_max, 80, 0);
    assert_near(s->scan.range_sigma, 0.01, 1e-7);
    assert_int_equal(s->has_odometry, 1);
    assert_near(s->odometry.x, 1, 0);
    assert_near(s->odometry.y, -2, 0);
    assert_near(s->odometry.theta, 7 - 2 * (double)CAIRN_PI, NUMBER(1e-15, 1e-6));
    assert_int_equal(s->has_estimate, 0);
    assert_near(s->estimate.x, 0, 0);
    assert_int_equal(s->has_true_pose, 1);
    assert_near(s->true_pose.theta, -0.125, 0);
    assert_int_equal(s->has_stamp, 1);
    assert_int_equal(s->scan.stamp_ns, INT64_C(1147713122541201000));
    s = &scans.scan[1];
    assert_int_equal(s->line, 5);
    assert_int_equal(s->scan.count, 5);
    for (int i = 0; i < 5; i++)
        assert_near(s->scan.angle[i], 1 + 0.25 * i, 0);
    assert_true(isnan(s->scan.range[0]) && isnan(s->scan.range[1]));
    assert_near(s->scan.range[2], 79.5, 0);
    assert_true(isinf(s->scan.range[3]) && s->scan.range[3] > 0 && isinf(s->scan.range[4]));
    assert_int_equal(s->scan.stamp_ns, -500000000);
    assert_int_equal(s->has_odometry + s->has_estimate + s->has_true_pose, 0);
    cairn_csm_scan_list_free(&scans);
    assert_int_equal(scans.count, 0);
    assert_null(scans.scan);

    /* Theta takes precedence over the limits; for a single ray without it the limits give the
     * first. */
    load(&scans, "{\"nrays\":1,\"min_theta\":0.5,\"max_theta\":3,\"readings\":[1],\"valid\":[true]}"
                 "{\"nrays\":2,\"min_theta\":0,\"max_theta\":1,\"readings\":[1,2],\"theta\":[5,6],"
                 "\"valid\":[false,null]}");
    assert_near(scans.scan[0].scan.angle[0], 0.5, 0);
    assert_near(scans.scan[0].scan.range[0], 1, 0);
    assert_int_equal(scans.scan[0].has_stamp, 0);
    assert_near(scans.scan[1].scan.angle[1], 6, 0);
    assert_true(isnan(scans.scan[1].scan.range[0]) && isnan(scans.scan[1].scan.range[1]));
    cairn_csm_scan_list_free(&scans);
}

static void test_params(void **state)
{
    cairn_csm_scan_params params = cairn_csm_scan_default();
    cairn_csm_scan_list scans;
    cairn_file_error error;
    const char *path = files_write_text("scans.json", whole);

    (void)state;
    params.range_max = 3;
    params.range_sigma = 0.5;
    assert_ok(cairn_csm_scan_load(&scans, path, &params, &error));
    assert_near(scans.scan[0].scan.range[0], 2.5, 0);
    assert_true(isinf(scans.scan[0].scan.range[2]));
    assert_near(scans.scan[0].scan.range_max, 3, 0);
    assert_near(scans.scan[0].scan.range_sigma, 0.5, 0);
    cairn_csm_scan_list_free(&scans);
#define REFUSED(change)                                                                            \
    params = cairn_csm_scan_default();                                                             \
    params.change;                                                                                 \
    assert_status(cairn_csm_scan_load(&scans, path, &params, &error), CAIRN_BAD_ARGUMENT);         \
    assert_int_equal(scans.count, 0)
    REFUSED(range_max = -1);
    REFUSED(range_max = (double)NAN);
    REFUSED(range_max = 1.1e5);
    REFUSED(range_sigma = -1);
    REFUSED(range_sigma = (double)NAN);
    REFUSED(range_sigma = 1.1e5);
#undef REFUSED
}

/* Their fit by the scan module. */
static void test_as_scans(void **state)
{
    cairn_scan_params params = cairn_scan_default();
    cairn_pool pool = test_pool(cairn_scan_memory(&params));
    cairn_csm_scan_list scans;
    cairn_scan *scan;

    (void)state;
    load(&scans, whole);
    assert_ok(cairn_scan_create(&scan, &pool, &params));
    for (int i = 0; i < 2; i++) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        assert_ok(cairn_scan_begin(scan, &scans.scan[i].scan, NULL));
        assert_ok(cairn_scan_step(scan, &budget));
    }
    assert_int_equal(cairn_scan_measured(scan).hits, 1);
    assert_int_equal(cairn_scan_measured(scan).free, 2);
    assert_int_equal(cairn_scan_measured(scan).unknown, 2);
    cairn_csm_scan_list_free(&scans);
    test_pool_free(&pool);
}

static void test_refusals(void **state)
{
#define SCAN "\"nrays\":2,\"theta\":[0,1],\"readings\":[1,2]"
    static const struct {
        const char *text;
        cairn_status status;
        const char *piece;
    } cases[] = {
        {"", CAIRN_EMPTY, "scans.json: no scan, expected at least one"},
        {" \n", CAIRN_EMPTY, ": no scan"},
        {"[]", CAIRN_BAD_FORMAT, ":1: not an object, expected { and the fields of a scan"},
        {"{" SCAN "}\n7", CAIRN_BAD_FORMAT, ":2: not an object"},
        {"{" SCAN "}\n{", CAIRN_TRUNCATED, ":2: the text ends within an object"},
        {"{}", CAIRN_BAD_FORMAT, ":1: a scan without nrays, expected one"},
        {"\n{\"nrays\":2}", CAIRN_BAD_FORMAT, ":2: a scan without readings, expected one"},
        {"{\"nrays\":1,\"readings\":[1]}", CAIRN_BAD_FORMAT,
         "without directions, expected theta or min_theta and max_theta"},
        {"{\"nrays\":1,\"readings\":[1],\"min_theta\":0}", CAIRN_BAD_FORMAT, "without directions"},
        {"{\"nrays\":1,\"readings\":[1],\"max_theta\":0}", CAIRN_BAD_FORMAT, "without directions"},
        {"{\"nrays\":3,\"theta\":[0,1],\n\"readings\":[1,2,3]}", CAIRN_BAD_FORMAT,
         ":1: theta holds 2 numbers, expected 3"},
        {"{\"nrays\":2,\"theta\":[0,1],\n\"readings\":[1,2,3]}", CAIRN_BAD_FORMAT,
         ":2: readings holds 3 numbers, expected 2"},
        {"{" SCAN ",\"valid\":[1]}", CAIRN_BAD_FORMAT, "valid holds 1 numbers, expected 2"},
        {"{" SCAN ",\"odometry\":[1,2]}", CAIRN_BAD_FORMAT, "odometry holds 2 numbers, expected 3"},
        {"{" SCAN ",\"estimate\":[]}", CAIRN_BAD_FORMAT, "estimate holds 0 numbers, expected 3"},
        {"{" SCAN ",\"true_pose\":[1,2,3,4]}", CAIRN_BAD_FORMAT,
         "true_pose holds 4 numbers, expected 3"},
        {"{" SCAN ",\"timestamp\":[1]}", CAIRN_BAD_FORMAT, "timestamp holds 1 numbers, expected 2"},
        {"{" SCAN ",\"timestamp\":1e10}", CAIRN_BAD_FORMAT,
         "timestamp holds 1e+10, expected s and us within 4e9"},
        {"{" SCAN ",\"timestamp\":[1,-1e10]}", CAIRN_BAD_FORMAT,
         "timestamp holds -1e+10, expected s and us"},
        {"{" SCAN ",\"timestamp\":[4e9,1]}", CAIRN_BAD_FORMAT, "timestamp holds 4e+09"},
        {"{" SCAN ",\"timestamp\":null}", CAIRN_BAD_FORMAT,
         "timestamp has a value of another type, expected a number"},
        {"{\"nrays\":0,\"theta\":[],\"readings\":[]}", CAIRN_BAD_FORMAT,
         "nrays is 0, expected a whole number from 1 to 100000"},
        {"{\"nrays\":1.5,\"theta\":[],\"readings\":[]}", CAIRN_BAD_FORMAT,
         "nrays is 1.5, expected a whole number"},
        {"{\"nrays\":100001,\"theta\":[],\"readings\":[]}", CAIRN_BAD_FORMAT,
         "nrays is 100001, expected"},
        {"{\"nrays\":-2,\"theta\":[],\"readings\":[]}", CAIRN_BAD_FORMAT, "nrays is -2, expected"},
        {"{\"nrays\":[2]}", CAIRN_BAD_FORMAT, "nrays is a list, expected a number"},
        {"{\"nrays\":\"2\"}", CAIRN_BAD_FORMAT,
         "nrays has a value of another type, expected a number"},
        {"{\"min_theta\":null}", CAIRN_BAD_FORMAT,
         "min_theta has a value of another type, expected a number"},
        {"{\"max_theta\":true}", CAIRN_BAD_FORMAT,
         "max_theta has a value of another type, expected a number"},
        {"{\"readings\":2}", CAIRN_BAD_FORMAT, "readings is not a list, expected [ and numbers"},
        {"{\"readings\":[1,\n\"x\"]}", CAIRN_BAD_FORMAT,
         ":2: readings has a value of another type, expected a number or null"},
        {"{\"readings\":[true]}", CAIRN_BAD_FORMAT, "readings has a value of another type"},
        {"{\"readings\":[[1]]}", CAIRN_BAD_FORMAT, "readings has a value of another type"},
        {"{\"theta\":[null]}", CAIRN_BAD_FORMAT,
         "theta has a value of another type, expected a number"},
        {"{\"valid\":[\"yes\"]}", CAIRN_BAD_FORMAT,
         "valid has a value of another type, expected 0, 1, true, false or null"},
        {"{\"theta\":[1e10,0],\"nrays\":2,\"readings\":[1,1]}", CAIRN_BAD_FORMAT,
         "theta holds 1e+10, expected at most 1e9 either way"},
        {"{\"nrays\":1,\"min_theta\":-2e9,\"max_theta\":1,\"readings\":[1]}", CAIRN_BAD_FORMAT,
         "min_theta holds -2e+09"},
        {"{\"nrays\":1,\"min_theta\":0,\"max_theta\":2e9,\"readings\":[1]}", CAIRN_BAD_FORMAT,
         "max_theta holds 2e+09"},
        {"{" SCAN ",\"odometry\":[0,2e9,0]}", CAIRN_BAD_FORMAT, "odometry holds 2e+09"},
        {"{" SCAN ",\"estimate\":[0,0,-2e9]}", CAIRN_BAD_FORMAT, "estimate holds -2e+09"},
        {"{" SCAN ",\"true_pose\":[2e9,0,0]}", CAIRN_BAD_FORMAT, "true_pose holds 2e+09"},
        {"{" SCAN ",\n\"nrays\":2}", CAIRN_BAD_FORMAT,
         ":2: nrays is duplicated in a scan, expected once"},
        {"{" SCAN ",\"readings\":[1,2]}", CAIRN_BAD_FORMAT, "readings is duplicated"},
        {"{" SCAN ",\"readings\":[1,nan]}", CAIRN_BAD_FORMAT, "readings is duplicated"},
        {"{\"readings\":[1,nan]}", CAIRN_BAD_FORMAT, "'n' within an array, expected a value"},
        {"{" SCAN ",\"x\":tru}", CAIRN_BAD_FORMAT, "'t' within an object, expected a value"},
        {"{" SCAN ",}", CAIRN_BAD_FORMAT, "expected a name in quotes"},
    };

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        cairn_csm_scan_list scans;
        cairn_file_error error;

        assert_status(cairn_csm_scan_load(&scans, files_write_text("scans.json", cases[i].text),
                                          NULL, &error),
                      cases[i].status);
        if (strstr(error.text, cases[i].piece) == NULL)
            fail_msg("\"%s\" does not hold \"%s\"", error.text, cases[i].piece);
        assert_int_equal(scans.count, 0);
        assert_null(scans.scan);
    }
}

/* Unreadable files, and one with more rays than allowed. */
static void test_files(void **state)
{
    cairn_csm_scan_list scans;
    cairn_file_error error;
    gzFile zip = gzopen(files_path("scans.json.gz"), "wb");
    size_t size = 300000, used = 0;
    char *text = malloc(size), *packed;

    (void)state;
    assert_status(cairn_csm_scan_load(&scans, files_path("missing.json"), NULL, &error), CAIRN_IO);
    assert_status(cairn_csm_scan_load(&scans, files_folder, NULL, &error), CAIRN_UNSUPPORTED);
    assert_non_null(zip);
    assert_int_equal(gzwrite(zip, whole, sizeof whole - 1), sizeof whole - 1);
    assert_int_equal(gzclose(zip), Z_OK);
    assert_ok(cairn_csm_scan_load(&scans, files_path("scans.json.gz"), NULL, &error));
    assert_int_equal(scans.count, 2);
    cairn_csm_scan_list_free(&scans);
    packed = files_read(files_path("scans.json.gz"), &used);
    assert_status(
        cairn_csm_scan_load(&scans, files_write("cut.json.gz", packed, used - 20), NULL, &error),
        CAIRN_TRUNCATED);
    free(packed);
    assert_non_null(text);
    used = (size_t)snprintf(text, size, "{\"nrays\":1,\"readings\":[");
    for (int i = 0; i < 100001; i++)
        used += (size_t)snprintf(text + used, size - used, "1,");
    (void)snprintf(text + used, size - used, "1]}");
    assert_status(cairn_csm_scan_load(&scans, files_write_text("many.json", text), NULL, &error),
                  CAIRN_FULL);
    assert_non_null(
        strstr(error.text,
               ":1: readings holds more numbers than a scan has rays, expected at most 100000"));
    free(text);
}

/* 40 scans: the lists of scans and rays grow. */
static void test_many(void **state)
{
    char *text = calloc(1, 400000);
    cairn_csm_scan_list scans;
    size_t used = 0;

    (void)state;
    assert_non_null(text);
    for (int k = 0; k < 40; k++) {
        int rays = 1 + 20 * k;

        used += (size_t)sprintf(text + used,
                                "{\"nrays\":%d,\"min_theta\":0,\"max_theta\":1,\"readings\":[%d",
                                rays, k + 1);
        for (int i = 1; i < rays; i++)
            used += (size_t)sprintf(text + used, ",%d", 1 + (i + k) % 70);
        used += (size_t)sprintf(text + used, "]}\n");
    }
    load(&scans, text);
    assert_int_equal(scans.count, 40);
    assert_int_equal(scans.max_rays, 781);
    for (int k = 0; k < 40; k++) {
        assert_int_equal(scans.scan[k].line, k + 1);
        assert_int_equal(scans.scan[k].scan.count, 1 + 20 * k);
        assert_near(scans.scan[k].scan.range[0], k + 1, 0);
        for (int i = 1; i < scans.scan[k].scan.count; i++) {
            assert_near(scans.scan[k].scan.range[i], 1 + (i + k) % 70, 0);
            assert_near(scans.scan[k].scan.angle[i], (double)i / (20 * k), 1e-6);
        }
    }
    cairn_csm_scan_list_free(&scans);
    free(text);
}

/* A truncated file is refused, or gives the scans before the end. */
static void test_cut_anywhere(void **state)
{
    const char *second = strstr(whole, "}\n{") + 1;
    size_t first = (size_t)(second - whole);

    (void)state;
    for (size_t length = 0; length < sizeof whole - 1; length++) {
        cairn_csm_scan_list scans;
        cairn_file_error error;
        cairn_status status =
            cairn_csm_scan_load(&scans, files_write("cut.json", whole, length), NULL, &error);

        if (length == first || length == first + 1) {
            assert_ok(status);
            assert_int_equal(scans.count, 1);
            cairn_csm_scan_list_free(&scans);
        } else {
            assert_true(status == CAIRN_TRUNCATED || status == CAIRN_BAD_FORMAT ||
                        (length == 0 && status == CAIRN_EMPTY));
            assert_null(scans.scan);
        }
    }
}

/* A changed byte causes a refusal at most. */
static void test_any_byte_changed(void **state)
{
    static const char bytes[] = "\"[]{},:0x-\\";
    char text[sizeof whole];

    (void)state;
    for (size_t i = 0; i < sizeof whole - 1; i++) {
        cairn_csm_scan_list scans;
        cairn_file_error error;

        memcpy(text, whole, sizeof whole);
        text[i] = bytes[i % (sizeof bytes - 1)];
        if (cairn_csm_scan_load(&scans, files_write_text("changed.json", text), NULL, &error) ==
            CAIRN_OK)
            cairn_csm_scan_list_free(&scans);
        else
            assert_non_null(strstr(error.text, "changed.json:"));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_fields),       cmocka_unit_test(test_params),
        cmocka_unit_test(test_as_scans),     cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_files),        cmocka_unit_test(test_many),
        cmocka_unit_test(test_cut_anywhere), cmocka_unit_test(test_any_byte_changed),
    };
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
