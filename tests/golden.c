/* Prints one line per scene, "name hash": tools/check-bits.sh compares them between compilers and
 * options, tools/firmware-test.sh between machines; tests/test_golden.c runs the scenes, too. A
 * scene computes with seeded inputs and hashes all bits of its results. A NaN is never hashed; 0 is
 * a scene that failed. Output goes through the board, so that it runs on a bare microcontroller. */
#include "src/base/build.h"

#include "firmware/board.h"
#include "tests/golden.h"

static void print_line(const char *name, uint64_t hash)
{
    char line[64];
    size_t length = strlen(name);

    memcpy(line, name, length);
    line[length++] = ' ';
    for (int shift = 60; shift >= 0; shift -= 4)
        line[length++] = "0123456789abcdef"[hash >> shift & 15];
    line[length++] = '\n';
    line[length] = '\0';
    board_print(line);
}

int main(void)
{
    static _Alignas(CAIRN_ALIGN) unsigned char memory[CAIRN_ALIGN];
    cairn_pool pool;
    int failed = 0;

    if (cairn_pool_init(&pool, memory, sizeof memory) != CAIRN_OK) {
        board_print("this build does not compute faithfully\n");
        return 1;
    }
    for (const golden_scene *scene = golden_scenes; scene->name != NULL; scene++) {
        uint64_t hash = scene->run();

        print_line(scene->name, hash);
        failed |= hash == 0;
    }
    return failed;
}
