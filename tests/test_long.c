/* The long scenes, compared with the stored hashes. */
#include <inttypes.h>

#include "tests/golden.h"
#include "tests/kept.h"
#include "tests/long_scenes.h"

#define SCENE(name) {#name, long_##name},
static const golden_scene SCENES[] = {LONG_SCENES(SCENE)};

static void format_value(const void *item, char text[KEPT_TEXT])
{
    (void)snprintf(text, KEPT_TEXT, "%016" PRIx64, ((const golden_scene *)item)->run());
}

int main(int argc, char **argv)
{
    enum { COUNT = sizeof SCENES / sizeof *SCENES };
    kept_value values[COUNT];

    for (int32_t i = 0; i < COUNT; i++) {
        values[i].name = SCENES[i].name;
        values[i].item = &SCENES[i];
    }
    return kept_main(argc, argv, KEPT_FILE("long"), values, COUNT, format_value);
}
