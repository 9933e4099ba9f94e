/* One line per scene, "name hash": what tools/check-bits.sh compares between compilers and options, and
 * tools/firmware-test.sh between machines. A scene computes with seeded inputs and hashes all bits of its results; a NaN is
 * never hashed, and 0 is a scene that has failed. Prints through the board, so that it runs on a bare microcontroller, too. */
#include "src/core/build.h"

#include "firmware/board.h"
#include "tests/golden.h"

static const struct {
    const char *name;
    uint64_t (*run)(void);
} SCENES[] = {
    {"elementary_functions", golden_elementary_functions},
    {"random_numbers", golden_random_numbers},
    {"poses_and_segments", golden_poses_and_segments},
    {"small_matrices", golden_small_matrices},
    {"force_field", golden_force_field},
    {"scans_and_grid", golden_scans_and_grid},
    {"matches", golden_matches},
    {"links_and_cover", golden_links_and_cover},
    {"aligned", golden_aligned},
    {"pose_graphs", golden_pose_graphs},
    {"consensus", golden_consensus},
    {"lines_and_rectangles", golden_lines_and_rectangles},
    {"particles", golden_particles},
    {"registered", golden_registered},
    {"hypotheses", golden_hypotheses},
    {"virtual_aligned", golden_virtual_aligned},
    {"mapped", golden_mapped},
    {"places", golden_places},
    {"merged", golden_merged},
    {"contours", golden_contours},
};

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
    for (size_t i = 0; i < sizeof SCENES / sizeof *SCENES; i++) {
        uint64_t hash = SCENES[i].run();

        print_line(SCENES[i].name, hash);
        failed |= hash == 0;
    }
    return failed;
}
