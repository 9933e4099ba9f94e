/* Files that are complete or absent, folders, paths. */
#include "tests/files.h"

#include <errno.h>
#include <math.h>

#include "cairn/output.h"

static void assert_file(const char *path, const char *expected)
{
    char *bytes = files_read(path, NULL);

    assert_non_null(bytes);
    assert_string_equal(bytes, expected);
    free(bytes);
}

static void test_commit_and_discard(void **state)
{
    const char *path = files_write_text("target.txt", "old");
    int entries = files_count();
    cairn_file_error error;
    cairn_output *output;
    struct stat about;
    char part[600];

    (void)state;
    assert_ok(cairn_output_open(&output, path, &error));
    cairn_output_print(output, "%s %d ", "new", 7);
    cairn_output_bytes(output, "abc", 2);
    cairn_output_bytes(output, "abc", 0);
    cairn_output_print(output, "%s", "");
    assert_file(path, "old");
    (void)snprintf(part, sizeof part, "%s/.cairn-%ld-0.part", files_folder, (long)getpid());
    assert_int_equal(access(part, F_OK), 0);
    assert_int_equal(files_count(), entries);
    assert_ok(cairn_output_commit(output, &error));
    assert_file(path, "new 7 ab");
    assert_int_equal(files_count(), entries);

    assert_ok(cairn_output_open(&output, path, &error));
    cairn_output_print(output, "nothing");
    cairn_output_discard(output);
    cairn_output_discard(NULL);
    assert_file(path, "new 7 ab");
    assert_int_equal(files_count(), entries);

    /* A new file has the mode that the user's mask gives. */
    path = files_path("fresh.txt");
    (void)umask(027);
    assert_ok(cairn_output_open(&output, path, &error));
    assert_ok(cairn_output_commit(output, &error));
    (void)umask(022);
    assert_int_equal(stat(path, &about), 0);
    assert_int_equal(about.st_mode & 0777, 0640);
    assert_int_equal(about.st_size, 0);

    /* One that is replaced keeps the mode that it had. */
    assert_int_equal(chmod(path, 0600), 0);
    assert_ok(cairn_output_open(&output, path, &error));
    assert_ok(cairn_output_commit(output, &error));
    assert_int_equal(stat(path, &about), 0);
    assert_int_equal(about.st_mode & 07777, 0600);
}

static void test_two_at_once(void **state)
{
    const char *path = files_path("twice.txt");
    cairn_output *first, *second;

    (void)state;
    assert_ok(cairn_output_open(&first, path, NULL));
    assert_ok(cairn_output_open(&second, path, NULL));
    cairn_output_print(first, "first");
    cairn_output_print(second, "second");
    assert_ok(cairn_output_commit(second, NULL));
    assert_file(path, "second");
    assert_ok(cairn_output_commit(first, NULL));
    assert_file(path, "first");
}

static void test_links_stay_links(void **state)
{
    const char *path = files_write_text("real.txt", "old"), *link = files_path("link.txt");
    cairn_file_error error;
    cairn_output *output;
    struct stat about;

    (void)state;
    assert_int_equal(symlink(path, link), 0);
    assert_ok(cairn_output_open(&output, link, NULL));
    cairn_output_print(output, "new");
    assert_ok(cairn_output_commit(output, NULL));
    assert_file(path, "new");
    assert_int_equal(lstat(link, &about), 0);
    assert_true(S_ISLNK(about.st_mode));
    assert_int_equal(remove(path), 0);
    assert_status(cairn_output_open(&output, link, &error), CAIRN_IO);
    assert_non_null(strstr(error.text, "/link.txt: is a symbolic link to nothing"));
}

static void test_devices_are_written_directly(void **state)
{
    cairn_file_error error;
    cairn_output *output;
    struct stat about;

    (void)state;
    assert_ok(cairn_output_open(&output, "/dev/null", &error));
    cairn_output_print(output, "gone");
    assert_ok(cairn_output_commit(output, &error));
    assert_int_equal(stat("/dev/null", &about), 0);
    assert_true(S_ISCHR(about.st_mode));
    assert_ok(cairn_output_open(&output, "/dev/null", &error));
    cairn_output_discard(output);

    if (access("/dev/full", W_OK) != 0)
        skip();
    assert_ok(cairn_output_open(&output, "/dev/full", &error));
    cairn_output_print(output, "too much");
    assert_status(cairn_output_commit(output, &error), CAIRN_IO);
    assert_string_equal(error.text, "/dev/full: cannot write: No space left on device");
    /* An early failure is kept. */
    assert_ok(cairn_output_open(&output, "/dev/full", &error));
    for (int i = 0; i < 100000; i++)
        cairn_output_bytes(output, "0123456789", 10);
    cairn_output_print(output, "more");
    assert_status(cairn_output_commit(output, &error), CAIRN_IO);
}

static void test_refusals(void **state)
{
    cairn_file_error error;
    cairn_output *output;
    char deep[300];

    (void)state;
    assert_status(cairn_output_open(&output, files_folder, &error), CAIRN_IO);
    assert_null(output);
    assert_non_null(strstr(error.text, ": is a folder, expected a file or nothing"));
    assert_status(cairn_output_open(&output, files_path("missing/file.txt"), &error), CAIRN_IO);
    assert_non_null(strstr(error.text, "missing/file.txt: cannot write: No such file"));
    assert_int_equal(error.line, 0);
    assert_status(cairn_output_open(&output, files_path("missing/file.txt"), NULL), CAIRN_IO);
    memset(deep, 'n', sizeof deep);
    deep[sizeof deep - 1] = 0;
    assert_status(cairn_output_open(&output, files_path(deep), &error), CAIRN_IO);
    /* A name of the maximum length. */
    deep[255] = 0;
    assert_ok(cairn_output_open(&output, files_path(deep), &error));
    assert_ok(cairn_output_commit(output, &error));
    assert_int_equal(access(files_path(deep), F_OK), 0);
    /* The folder is removed during the writing. */
    assert_ok(cairn_output_folder(files_path("going"), &error));
    assert_ok(cairn_output_open(&output, files_path("going/file.txt"), &error));
    files_remove(files_path("going"));
    assert_status(cairn_output_commit(output, &error), CAIRN_IO);
    assert_non_null(strstr(error.text, "going/file.txt: cannot write: No such file"));
}

static void test_folders(void **state)
{
    const char *path = files_path("a/b/c");
    cairn_file_error error;
    struct stat about;

    (void)state;
    assert_ok(cairn_output_folder(path, &error));
    assert_int_equal(stat(path, &about), 0);
    assert_true(S_ISDIR(about.st_mode));
    assert_ok(cairn_output_folder(path, &error));
    assert_ok(cairn_output_folder(files_path("a/d/"), &error));
    assert_int_equal(stat(files_path("a/d"), &about), 0);
    assert_ok(cairn_output_folder("/", &error));
    assert_status(cairn_output_folder("", &error), CAIRN_IO);
    (void)files_write_text("plain", "x");
    assert_status(cairn_output_folder(files_path("plain"), &error), CAIRN_IO);
    assert_non_null(strstr(error.text, "plain: cannot make the folder: File exists"));
    assert_status(cairn_output_folder(files_path("plain/inner"), &error), CAIRN_IO);
}

static void test_paths(void **state)
{
    static const char *const joined[][3] = {
        {"a", "b", "a/b"}, {"a/", "b", "a/b"}, {"", "b", "b"}, {"a", "/b", "/b"}, {"/", "b", "/b"}};
    static const char *const split[][3] = {{"a/b", "a", "b"},
                                           {"b", "", "b"},
                                           {"/b", "/", "b"},
                                           {"a/b/", "a/b", ""},
                                           {"a//b", "a", "b"}};

    (void)state;
    for (size_t i = 0; i < 5; i++) {
        char *path = cairn_output_path_join(joined[i][0], joined[i][1]),
             *folder = cairn_output_path_folder(split[i][0]);

        assert_string_equal(path, joined[i][2]);
        assert_string_equal(folder, split[i][1]);
        assert_string_equal(cairn_output_path_name(split[i][0]), split[i][2]);
        free(path);
        free(folder);
    }
}

static void test_locale(void **state)
{
    const char *path = files_path("locale.txt");
    cairn_output *output;

    (void)state;
    if (!files_comma_locale())
        skip();
    assert_ok(cairn_output_open(&output, path, NULL));
    cairn_output_print(output, "%.2f", 1.5);
    assert_ok(cairn_output_commit(output, NULL));
    assert_non_null(setlocale(LC_ALL, "C"));
    assert_file(path, "1.50");
}

static void test_error_texts(void **state)
{
    cairn_file_error error;
    char piece[2000];

    (void)state;
    assert_status(cairn_file_error_set(&error, CAIRN_BAD_FORMAT, "f", 12, "is %d", 3),
                  CAIRN_BAD_FORMAT);
    assert_string_equal(error.text, "f:12: is 3");
    assert_int_equal(error.line, 12);
    assert_int_equal(error.status, CAIRN_BAD_FORMAT);
    assert_status(cairn_file_error_set(NULL, CAIRN_FULL, "f", 12, "is %d", 3), CAIRN_FULL);
    assert_status(cairn_file_error_system(&error, "f", "open", ENOMEM), CAIRN_NO_MEMORY);
    assert_string_equal(error.text, "f: cannot open: Cannot allocate memory");
    assert_status(cairn_file_error_system(&error, "f", "open", EACCES), CAIRN_IO);
    assert_string_equal(error.text, "f: cannot open: Permission denied");
    (void)cairn_file_error_set(&error, CAIRN_IO, "f", 1, "end");
    assert_string_equal(error.text, "f:1: end");
    memset(piece, 'x', sizeof piece);
    piece[sizeof piece - 1] = 0;
    (void)cairn_file_error_set(&error, CAIRN_IO, "f", 0, "%s", piece);
    assert_int_equal(strlen(error.text), sizeof error.text - 1);
    (void)cairn_file_error_set(&error, CAIRN_IO, piece, 7, "end");
    assert_non_null(strstr(error.text, "xxx:7: end"));
    assert_memory_equal(error.text, "...xxx", 6);
    piece[CAIRN_FILE_ERROR_BYTES - 512] = 0; /* the longest that is not cut */
    (void)cairn_file_error_set(&error, CAIRN_IO, piece, 7, "end");
    assert_memory_equal(error.text, "xxxxxx", 6);
}

/* All memory is freed, whatever the end. */
static void test_heap(void **state)
{
    size_t heap = 0;

    (void)state;
    for (int round = 0; round <= FILES_HEAP_ROUNDS; round++) {
        cairn_output *output;

        if (round == 1)
            heap = files_heap();
        assert_ok(cairn_output_open(&output, files_path("heap.txt"), NULL));
        assert_ok(cairn_output_commit(output, NULL));
        assert_ok(cairn_output_open(&output, files_path("heap.txt"), NULL));
        cairn_output_discard(output);
        assert_status(cairn_output_open(&output, files_path("none/heap.txt"), NULL), CAIRN_IO);
        assert_ok(cairn_output_folder(files_path("heap"), NULL));
    }
    assert_true(files_heap() < heap + FILES_HEAP_NOISE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_commit_and_discard),
        cmocka_unit_test(test_two_at_once),
        cmocka_unit_test(test_links_stay_links),
        cmocka_unit_test(test_devices_are_written_directly),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_folders),
        cmocka_unit_test(test_paths),
        cmocka_unit_test(test_locale),
        cmocka_unit_test(test_error_texts),
        cmocka_unit_test(test_heap),
    };
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
