/* Random numbers of scenes. */
#ifndef CAIRN_BENCH_RANDOM_H
#define CAIRN_BENCH_RANDOM_H

#include "cairn/random.h"

/* Uniform in [low, high). */
static inline double bench_uniform(cairn_random *random, double low, double high)
{
    return (double)cairn_random_uniform(random, (cairn_real)low, (cairn_real)high);
}

#endif
