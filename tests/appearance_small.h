/* A small appearance model: two words and two support vectors, one of each word. */
#ifndef CAIRN_TESTS_APPEARANCE_SMALL_H
#define CAIRN_TESTS_APPEARANCE_SMALL_H

#include "cairn/appearance.h"

/* The arrays are shared by all models made. */
static inline cairn_appearance_model make_small(void)
{
    static uint8_t words[2 * CAIRN_APPEARANCE_DESCRIPTOR_SIZE];
    static float histograms[] = {1, 0, 0.25F, 0.75F};
    static cairn_real weights[] = {2, CAIRN_REAL(-1.5)};
    cairn_appearance_model m = {
        2, 2, words, histograms, weights, CAIRN_REAL(0.5), CAIRN_REAL(0.25), -2, CAIRN_REAL(0.125)};

    for (int32_t i = 0; i < CAIRN_APPEARANCE_DESCRIPTOR_SIZE; i++) {
        words[i] = (uint8_t)i;
        words[CAIRN_APPEARANCE_DESCRIPTOR_SIZE + i] = (uint8_t)(255 - i);
    }
    return m;
}

#endif
