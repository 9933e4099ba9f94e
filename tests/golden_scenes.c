/* The list of the golden scenes. */
#include "tests/golden.h"

#define SCENE(name) {#name, golden_##name},

const golden_scene golden_scenes[] = {GOLDEN_SCENES(SCENE){NULL, NULL}};
