/* Several files that are written all or none. */
#include "tests/files.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/sysmacros.h>
#include <sys/wait.h>

#include "cairn/output.h"
#include "cairn/output_set.h"

static const char *const names[] = {"a.txt", "b.txt", "c.txt"};

enum { FILES = 3 };

/* Takes the place of the system's: kills the process instead of the renaming after a number of calls. */
static int renames_left = -1;
int rename(const char *from, const char *to)
{
    if (renames_left-- == 0)
        (void)raise(SIGKILL);
    return renameat(AT_FDCWD, from, AT_FDCWD, to);
}

static void write_to(const char *path, const char *text)
{
    cairn_output *output;

    assert_ok(cairn_output_open(&output, path, NULL));
    cairn_output_print(output, "%s", text);
    assert_ok(cairn_output_commit(output, NULL));
}

static void write_all(cairn_output_set *set, const char *text)
{
    for (int32_t i = 0; i < FILES; i++)
        write_to(cairn_output_set_path(set, i), text);
}

static const char *in_folder(const char *folder, const char *name)
{
    char inner[320];

    (void)snprintf(inner, sizeof inner, "%s/%s", folder, name);
    return files_path(inner);
}

static void assert_file(const char *folder, const char *name, const char *expected)
{
    char *bytes = files_read(in_folder(folder, name), NULL);

    if (expected == NULL) {
        assert_null(bytes);
        return;
    }
    assert_non_null(bytes);
    assert_string_equal(bytes, expected);
    free(bytes);
}

static int is_root(void)
{
    return geteuid() == 0;
}

static void test_all_come_at_the_commit(void **state)
{
    static const char folder[] = "one/two/three";
    char stage[128];
    cairn_file_error error;
    cairn_output_set *set;

    (void)state;
    assert_ok(cairn_output_set_check(files_path(folder), names, FILES, &error));
    assert_int_equal(files_count_in("one"), -1);
    assert_ok(cairn_output_set_open(&set, files_path(folder), names, FILES, &error));
    (void)snprintf(stage, sizeof stage, "%s/.cairn-%ld-0.part", folder, (long)getpid());
    assert_int_equal(files_count_in(stage), 0);
    write_all(set, "first");
    assert_file(folder, "a.txt", NULL);
    assert_int_equal(files_count_in(folder), 1);
    assert_ok(cairn_output_set_commit(set, &error));
    for (int32_t i = 0; i < FILES; i++)
        assert_file(folder, names[i], "first");
    assert_int_equal(files_count_in(folder), FILES);

    /* Once more, over existing files and beside foreign ones. */
    write_to(in_folder(folder, "other"), "kept");
    assert_ok(cairn_output_set_check(files_path(folder), names, FILES, &error));
    assert_ok(cairn_output_set_open(&set, files_path(folder), names, FILES, &error));
    write_all(set, "second");
    assert_file(folder, "b.txt", "first");
    assert_ok(cairn_output_set_commit(set, &error));
    for (int32_t i = 0; i < FILES; i++)
        assert_file(folder, names[i], "second");
    assert_file(folder, "other", "kept");
    assert_int_equal(files_count_in(folder), FILES + 1);
}

/* What an earlier set has written and this one does not goes with the commit, if it is a file. */
static void test_files_that_go(void **state)
{
    static const char folder[] = "going";
    cairn_output_set *set;

    (void)state;
    assert_int_equal(mkdir(files_path(folder), 0777), 0);
    for (int round = 0; round < 2; round++) {
        write_to(in_folder(folder, "d.txt"), "old");
        assert_ok(cairn_output_set_open(&set, files_path(folder), names, FILES, NULL));
        assert_ok(cairn_output_set_remove(set, "d.txt", NULL));
        assert_ok(cairn_output_set_remove(set, "not-there.txt", NULL));
        write_all(set, "new");
        assert_file(folder, "d.txt", "old");
        if (round == 0)
            cairn_output_set_discard(set);
        else
            assert_ok(cairn_output_set_commit(set, NULL));
        assert_file(folder, "d.txt", round == 0 ? "old" : NULL);
        assert_int_equal(files_count_in(folder), round == 0 ? 1 : FILES);
    }
    assert_int_equal(mkfifo(in_folder(folder, "d.txt"), 0666), 0);
    assert_ok(cairn_output_set_open(&set, files_path(folder), names, FILES, NULL));
    assert_ok(cairn_output_set_remove(set, "d.txt", NULL));
    write_all(set, "new");
    assert_ok(cairn_output_set_commit(set, NULL));
    assert_int_equal(files_count_in(folder), FILES + 1);
}

/* Names of as many bytes as there may be. */
static void test_long_names(void **state)
{
    static char deep[256];
    const char *const deep_name[] = {deep};
    cairn_output_set *set;

    (void)state;
    memset(deep, 'n', sizeof deep - 1);
    for (int round = 0; round < 2; round++) {
        assert_ok(cairn_output_set_open(&set, files_path("long"), deep_name, 1, NULL));
        write_to(cairn_output_set_path(set, 0), "whole");
        assert_ok(cairn_output_set_commit(set, NULL));
        assert_file("long", deep, "whole");
        assert_int_equal(files_count_in("long"), 1);
    }
}

static void test_discard_leaves_nothing(void **state)
{
    cairn_output_set *set;

    (void)state;
    cairn_output_set_discard(NULL);
    assert_ok(cairn_output_set_open(&set, files_path("new/deep//er/"), names, FILES, NULL));
    write_to(cairn_output_set_path(set, 1), "gone");
    assert_int_equal(files_count_in("new/deep/er"), 1);
    cairn_output_set_discard(set);
    assert_int_equal(files_count_in("new"), -1);

    /* Only its own files are removed. */
    assert_int_equal(mkdir(files_path("there"), 0777), 0);
    assert_ok(cairn_output_set_open(&set, files_path("there/more"), names, FILES, NULL));
    write_all(set, "gone");
    cairn_output_set_discard(set);
    assert_int_equal(files_count_in("there"), 0);
    assert_ok(cairn_output_set_open(&set, files_path("there"), names, FILES, NULL));
    write_all(set, "gone");
    cairn_output_set_discard(set);
    assert_int_equal(files_count_in("there"), 0);

    /* And no folder with foreign files. */
    assert_ok(cairn_output_set_open(&set, files_path("shared/by"), names, FILES, NULL));
    write_to(files_path("shared/by/two"), "kept");
    cairn_output_set_discard(set);
    assert_file("shared/by", "two", "kept");
    assert_int_equal(files_count_in("shared/by"), 1);
}

static void test_a_failing_commit_takes_all_back(void **state)
{
    static const char folder[] = "back";
    cairn_file_error error;
    cairn_output_set *set;

    (void)state;
    /* The last file is missing. */
    assert_ok(cairn_output_set_open(&set, files_path(folder), names, FILES, NULL));
    write_to(cairn_output_set_path(set, 0), "x");
    write_to(cairn_output_set_path(set, 1), "x");
    assert_status(cairn_output_set_commit(set, &error), CAIRN_IO);
    assert_non_null(strstr(error.text, "/back/c.txt: cannot write: No such file"));
    assert_int_equal(files_count_in(folder), -1);

    /* The same over older files; one of the three is new. */
    assert_int_equal(mkdir(files_path(folder), 0777), 0);
    write_to(in_folder(folder, "a.txt"), "old a");
    write_to(in_folder(folder, "c.txt"), "old c");
    assert_ok(cairn_output_set_open(&set, files_path(folder), names, FILES, NULL));
    write_to(cairn_output_set_path(set, 0), "x");
    write_to(cairn_output_set_path(set, 1), "x");
    assert_status(cairn_output_set_commit(set, &error), CAIRN_IO);
    assert_file(folder, "a.txt", "old a");
    assert_file(folder, "b.txt", NULL);
    assert_file(folder, "c.txt", "old c");
    assert_int_equal(files_count_in(folder), 2);

    /* A folder takes the name of a file before the commit. */
    assert_ok(cairn_output_set_open(&set, files_path(folder), names, FILES, NULL));
    write_all(set, "x");
    assert_int_equal(mkdir(in_folder(folder, "b.txt"), 0777), 0);
    assert_status(cairn_output_set_commit(set, &error), CAIRN_IO);
    assert_non_null(strstr(error.text, "/back/b.txt: cannot write: "));
    assert_file(folder, "a.txt", "old a");
    assert_file(folder, "c.txt", "old c");
    assert_int_equal(files_count_in(folder), 3);
    assert_int_equal(rmdir(in_folder(folder, "b.txt")), 0);
}

static void assert_refused(const char *folder, const char *expected)
{
    cairn_output_set *set = (cairn_output_set *)(void *)names;
    cairn_file_error error;
    int entries = files_count();

    assert_status(cairn_output_set_check(folder, names, FILES, &error), CAIRN_IO);
    assert_non_null(strstr(error.text, expected));
    assert_status(cairn_output_set_check(folder, names, FILES, NULL), CAIRN_IO);
    memset(&error, 0, sizeof error);
    assert_status(cairn_output_set_open(&set, folder, names, FILES, &error), CAIRN_IO);
    assert_non_null(strstr(error.text, expected));
    assert_null(set);
    assert_int_equal(files_count(), entries);
}

static void test_bad_places(void **state)
{
    cairn_output_set *set;
    cairn_file_error error;
    const char *file = files_write_text("file", "kept");

    (void)state;
    assert_refused(file, "/file: is a file, expected a folder");
    assert_refused(files_path("file/inner/most"), "/file: is a file, expected a folder");
    assert_refused("", "\"\": is not a path, expected that of a folder");
    assert_file(".", "file", "kept");
    assert_int_equal(mkdir(files_path("taken"), 0777), 0);
    assert_int_equal(mkdir(files_path("taken/c.txt"), 0777), 0);
    assert_refused(files_path("taken"), "/taken/c.txt: is a folder, expected a file or nothing");
    assert_int_equal(files_count_in("taken"), 1);
    if (!is_root()) {
        assert_int_equal(mkdir(files_path("closed"), 0555), 0);
        assert_refused(files_path("closed"),
                       "/closed: cannot write in this folder: Permission denied");
        assert_refused(files_path("closed/new"),
                       "/closed: cannot write in this folder: Permission denied");
    }
    assert_status(cairn_output_set_open(&set, files_path("x"), names, 0, &error),
                  CAIRN_BAD_ARGUMENT);
    assert_non_null(strstr(error.text, "/x: 0 files, expected 1 to 16"));
    assert_status(
        cairn_output_set_open(&set, files_path("x"), names, CAIRN_OUTPUT_SET_MAX_FILES + 1, &error),
        CAIRN_BAD_ARGUMENT);
    assert_int_equal(files_count_in("x"), -1);
}

static void test_names_without_a_folder_above(void **state)
{
    char here[1024];
    cairn_output_set *set;

    (void)state;
    assert_non_null(getcwd(here, sizeof here));
    assert_int_equal(chdir(files_folder), 0);
    assert_ok(cairn_output_set_check("plain", names, FILES, NULL));
    assert_ok(cairn_output_set_open(&set, "plain", names, FILES, NULL));
    write_all(set, "here");
    assert_ok(cairn_output_set_commit(set, NULL));
    assert_file("plain", "c.txt", "here");
    for (int k = 0; k < 3; k++) {
        static const char *const gone[] = {"gone", "g", "g//h/"};

        assert_ok(cairn_output_set_open(&set, gone[k], names, FILES, NULL));
        assert_int_equal(files_count_in(gone[k]), 1);
        cairn_output_set_discard(set);
        assert_int_equal(files_count_in(k == 0 ? "gone" : "g"), -1);
    }
    /* Two at once: each with its own staging folder, the later commit wins. */
    {
        cairn_output_set *other;

        assert_ok(cairn_output_set_open(&set, ".", names, FILES, NULL));
        assert_ok(cairn_output_set_open(&other, ".", names, FILES, NULL));
        write_all(set, "one");
        write_all(other, "other");
        assert_ok(cairn_output_set_commit(set, NULL));
        assert_file(".", "a.txt", "one");
        assert_ok(cairn_output_set_commit(other, NULL));
        assert_file(".", "a.txt", "other");
    }
    assert_int_equal(chdir(here), 0);
}

/* A target that is no regular file keeps its kind; one that is keeps its mode. */
static void test_targets_keep_kind_and_mode(void **state)
{
    static const char folder[] = "kinds";
    struct stat about;
    cairn_output_set *set;
    int fifo;
    char text[8] = "";

    (void)state;
    assert_int_equal(mkdir(files_path(folder), 0777), 0);
    assert_int_equal(mkdir(files_path("elsewhere"), 0777), 0);
    write_to(in_folder("elsewhere", "real"), "old");
    assert_int_equal(symlink("../elsewhere/real", in_folder(folder, "a.txt")), 0);
    assert_int_equal(mkfifo(in_folder(folder, "b.txt"), 0666), 0);
    write_to(in_folder(folder, "c.txt"), "old");
    assert_int_equal(chmod(in_folder(folder, "c.txt"), 0600), 0);

    fifo = open(in_folder(folder, "b.txt"), O_RDONLY | O_NONBLOCK);
    assert_true(fifo >= 0);
    assert_ok(cairn_output_set_check(files_path(folder), names, FILES, NULL));
    assert_ok(cairn_output_set_open(&set, files_path(folder), names, FILES, NULL));
    write_all(set, "new");
    assert_file("elsewhere", "real", "old");
    assert_ok(cairn_output_set_commit(set, NULL));
    assert_int_equal(lstat(in_folder(folder, "a.txt"), &about), 0);
    assert_true(S_ISLNK(about.st_mode));
    assert_file("elsewhere", "real", "new");
    assert_int_equal(lstat(in_folder(folder, "b.txt"), &about), 0);
    assert_true(S_ISFIFO(about.st_mode));
    assert_int_equal(read(fifo, text, sizeof text), 3);
    assert_string_equal(text, "new");
    (void)close(fifo);
    assert_file(folder, "c.txt", "new");
    assert_int_equal(stat(in_folder(folder, "c.txt"), &about), 0);
    assert_int_equal(about.st_mode & 07777, 0600);
    assert_int_equal(files_count_in(folder), FILES);
    assert_int_equal(files_count_in("elsewhere"), 1);
}

/* A device alone needs no staging folder; a link that leads nowhere is reported. */
static void test_a_device_and_a_link_to_nothing(void **state)
{
    static const char *const null_name[] = {"null"};
    cairn_output_set *set;
    cairn_file_error error;
    struct stat about;

    (void)state;
    assert_int_equal(mkdir(files_path("devices"), 0777), 0);
    /* The same device as /dev/null; only root can make it. */
    if (mknod(in_folder("devices", "null"), S_IFCHR | 0666, makedev(1, 3)) == 0) {
        assert_ok(cairn_output_set_check(files_path("devices"), null_name, 1, NULL));
        assert_ok(cairn_output_set_open(&set, files_path("devices"), null_name, 1, NULL));
        assert_int_equal(files_count_in("devices"), 1);
        write_to(cairn_output_set_path(set, 0), "gone");
        assert_ok(cairn_output_set_commit(set, NULL));
        assert_int_equal(lstat(in_folder("devices", "null"), &about), 0);
        assert_true(S_ISCHR(about.st_mode));
    }

    assert_int_equal(mkdir(files_path("dangling"), 0777), 0);
    assert_int_equal(symlink("nothing", in_folder("dangling", "b.txt")), 0);
    assert_status(cairn_output_set_check(files_path("dangling"), names, FILES, &error), CAIRN_IO);
    assert_non_null(strstr(error.text, "/dangling/b.txt: is a symbolic link to nothing"));
}

/* Runs a set in a process of its own: `renames` of its commit, then it is killed; -1: by `signal`
 * before the commit. */
static void run_killed(const char *folder, int renames, int signal)
{
    pid_t child = fork();
    int status;

    if (child == 0) {
        cairn_output_set *set;
        cairn_output *half;

        /* A shell starts what runs in the background with SIGINT ignored. */
        (void)sigaction(signal, &(struct sigaction){.sa_handler = SIG_DFL}, NULL);
        cairn_output_clean_up_on_signals();
        if (cairn_output_set_open(&set, files_path(folder), names, FILES, NULL) != CAIRN_OK)
            _exit(1);
        write_all(set, "new");
        if (renames >= 0) {
            renames_left = renames;
            _exit(cairn_output_set_commit(set, NULL) != CAIRN_OK);
        }
        if (cairn_output_open(&half, in_folder(folder, "alone.txt"), NULL) != CAIRN_OK)
            _exit(1);
        (void)raise(signal);
        _exit(1);
    }
    assert_true(child > 0);
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFSIGNALED(status));
    assert_int_equal(WTERMSIG(status), renames >= 0 ? SIGKILL : signal);
}

/* A process that is killed amid its commit has committed: the next set in the folder completes it;
 * one that is killed before has not. */
static void test_killed(void **state)
{
    static const char folder[] = "killed";

    (void)state;
    assert_int_equal(mkdir(files_path(folder), 0777), 0);
    for (int renames = -1; renames < FILES; renames++) {
        cairn_output_set *set;

        for (int32_t i = 0; i < FILES; i++)
            write_to(in_folder(folder, names[i]), "old");
        run_killed(folder, renames, SIGKILL);
        assert_ok(cairn_output_set_open(&set, files_path(folder), names, FILES, NULL));
        for (int32_t i = 0; i < FILES; i++)
            assert_file(folder, names[i], renames >= 0 ? "new" : "old");
        /* A set in use is left alone. */
        if (renames == 0) {
            cairn_output_set *other;

            assert_ok(cairn_output_set_open(&other, files_path(folder), names, FILES, NULL));
            cairn_output_set_discard(other);
            write_all(set, "third");
            assert_ok(cairn_output_set_commit(set, NULL));
            assert_file(folder, "c.txt", "third");
        } else {
            cairn_output_set_discard(set);
        }
        files_remove(in_folder(folder, "alone.txt"));
    }
}

/* A program that a signal ends leaves no temporary file behind. */
static void test_signals(void **state)
{
    static const int signals[] = {SIGINT, SIGTERM, SIGHUP};

    (void)state;
    assert_int_equal(mkdir(files_path("signals"), 0777), 0);
    for (int k = 0; k < 3; k++) {
        run_killed("signals", -1, signals[k]);
        assert_int_equal(files_count_in("signals"), 0);
    }
}

/* All memory is freed, whatever the end. */
static void test_heap(void **state)
{
    size_t heap = 0;

    (void)state;
    for (int round = 0; round <= FILES_HEAP_ROUNDS; round++) {
        cairn_output_set *set;

        if (round == 1)
            heap = files_heap();
        assert_ok(cairn_output_set_open(&set, files_path("heap"), names, FILES, NULL));
        write_all(set, "x");
        assert_ok(cairn_output_set_commit(set, NULL));
        assert_ok(cairn_output_set_open(&set, files_path("heap"), names, FILES, NULL));
        assert_status(cairn_output_set_commit(set, NULL), CAIRN_IO);
        assert_ok(cairn_output_set_open(&set, files_path("heap/more"), names, FILES, NULL));
        cairn_output_set_discard(set);
        assert_status(cairn_output_set_open(&set, files_path("heap/a.txt"), names, FILES, NULL),
                      CAIRN_IO);
    }
    assert_true(files_heap() < heap + FILES_HEAP_NOISE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_all_come_at_the_commit),
        cmocka_unit_test(test_long_names),
        cmocka_unit_test(test_files_that_go),
        cmocka_unit_test(test_discard_leaves_nothing),
        cmocka_unit_test(test_a_failing_commit_takes_all_back),
        cmocka_unit_test(test_bad_places),
        cmocka_unit_test(test_names_without_a_folder_above),
        cmocka_unit_test(test_targets_keep_kind_and_mode),
        cmocka_unit_test(test_a_device_and_a_link_to_nothing),
        cmocka_unit_test(test_killed),
        cmocka_unit_test(test_signals),
        cmocka_unit_test(test_heap),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
