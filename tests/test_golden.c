/* The golden scenes, also those that a board runs, compared with the stored hashes. */
#include <inttypes.h>

#include "tests/golden.h"
#include "tests/kept.h"

static void format_value(const void *item, char text[KEPT_TEXT])
{
    const golden_scene *scene = item;
    uint64_t hash = scene->run();

    if (hash == 0)
        (void)snprintf(text, KEPT_TEXT, "failed");
    else
        (void)snprintf(text, KEPT_TEXT, "%016" PRIx64, hash);
}

int main(int argc, char **argv)
{
    enum { MAX_COUNT = 64 };
    kept_value values[MAX_COUNT];
    int32_t count = 0;

    for (; count < MAX_COUNT && golden_scenes[count].name != NULL; count++) {
        values[count].name = golden_scenes[count].name;
        values[count].item = &golden_scenes[count];
    }
    return kept_main(argc, argv, KEPT_FILE("golden"), values, count, format_value);
}
