/* Files for tests, in a folder that is removed at the end. */
#ifndef CAIRN_TESTS_FILES_H
#define CAIRN_TESTS_FILES_H

#include <dirent.h>
#include <locale.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include "tests/test.h"

static char files_folder[64];

/* For cmocka_run_group_tests: makes the folder, in $TMPDIR unless its name is too long. */
static inline int files_setup(void **state)
{
    const char *above = getenv("TMPDIR");

    (void)state;
    if (above == NULL || *above == 0 || strlen(above) > 40)
        above = "/tmp";
    (void)snprintf(files_folder, sizeof files_folder, "%.40s/cairn-test-XXXXXX", above);
    return mkdtemp(files_folder) == NULL;
}

static inline void files_remove(const char *path)
{
    struct dirent *entry;
    char inner[1024];
    DIR *folder;

    if (remove(path) == 0)
        return;
    folder = opendir(path);
    while (folder != NULL && (entry = readdir(folder)) != NULL) {
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0)
            continue;
        if (snprintf(inner, sizeof inner, "%s/%s", path, entry->d_name) < (int)sizeof inner)
            files_remove(inner);
    }
    if (folder != NULL)
        (void)closedir(folder);
    (void)rmdir(path);
}

/* Removes the folder with all its contents. */
static inline int files_teardown(void **state)
{
    (void)state;
    files_remove(files_folder);
    return access(files_folder, F_OK) == 0;
}

/* The path of a name in the folder; one of eight buffers in turn. */
static inline const char *files_path(const char *name)
{
    static char path[8][512];
    static int next;

    next = (next + 1) % 8;
    (void)snprintf(path[next], sizeof path[next], "%s/%s", files_folder, name);
    return path[next];
}

static inline const char *files_write(const char *name, const void *bytes, size_t count)
{
    const char *path = files_path(name);
    FILE *file = fopen(path, "wb");

    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, count, file), count);
    assert_int_equal(fclose(file), 0);
    return path;
}

static inline const char *files_write_text(const char *name, const char *text)
{
    return files_write(name, text, strlen(text));
}

/* The whole file, terminated by 0, to be freed; NULL when it cannot be opened. */
static inline char *files_read(const char *path, size_t *count)
{
    FILE *file = fopen(path, "rb");
    char *bytes;
    long size;

    if (file == NULL)
        return NULL;
    assert_int_equal(fseek(file, 0, SEEK_END), 0);
    size = ftell(file);
    rewind(file);
    bytes = malloc((size_t)size + 1);
    assert_non_null(bytes);
    assert_int_equal(fread(bytes, 1, (size_t)size, file), size);
    bytes[size] = 0;
    (void)fclose(file);
    if (count != NULL)
        *count = (size_t)size;
    return bytes;
}

/* A file of the folder as text, to be freed. */
static inline char *files_text(const char *name)
{
    char *text = files_read(files_path(name), NULL);

    if (text == NULL)
        fail_msg("%s is not there", name);
    return text;
}

/* Entries of a folder in the folder, hidden ones too; -1 when it is not there. */
static inline int files_count_in(const char *name)
{
    DIR *folder = opendir(files_path(name));
    const struct dirent *entry;
    int count = -2; /* without "." and ".." */

    if (folder == NULL)
        return -1;
    while ((entry = readdir(folder)) != NULL)
        count++;
    (void)closedir(folder);
    return count;
}

static inline void assert_holds(const char *string, const char *piece)
{
    if (strstr(string, piece) == NULL)
        fail_msg("\"%s\" does not hold \"%s\"", string, piece);
}

/* Bytes of the heap in use by glibc's mallinfo; 0 elsewhere and under sanitizers. A leak in every
 * round adds up to more than what the heap retains for itself. */
#define FILES_HEAP_ROUNDS 40
#define FILES_HEAP_NOISE  1000
static inline size_t files_heap(void)
{
#if defined __GLIBC__ && (__GLIBC__ > 2 || __GLIBC_MINOR__ >= 33)
    return mallinfo2().uordblks;
#else
    return 0;
#endif
}

/* Number of entries in the folder. */
static inline int files_count(void)
{
    DIR *folder = opendir(files_folder);
    struct dirent *entry;
    int count = 0;

    while ((entry = readdir(folder)) != NULL)
        count += entry->d_name[0] != '.';
    (void)closedir(folder);
    return count;
}

/* Sets a locale with a decimal comma, an installed one or one made in the folder; 1 when that
 * succeeded. The caller sets "C" again. */
static inline int files_comma_locale(void)
{
    static const char *const names[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "it_IT.UTF-8",
                                        "es_ES.UTF-8"};
    char command[256];

    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (setlocale(LC_ALL, names[i]) != NULL)
            return 1;
    (void)snprintf(command, sizeof command,
                   "localedef -i de_DE -f UTF-8 %s/de_DE.UTF-8 >/dev/null 2>&1", files_folder);
    if (system(command) != 0 || setenv("LOCPATH", files_folder, 1) != 0)
        return 0;
    return setlocale(LC_ALL, "de_DE.UTF-8") != NULL;
}

#endif
