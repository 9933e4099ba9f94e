/* random: seeded random numbers, the same on every machine.
 *
 * PCG32 (O'Neill 2014, XSH-RR 64/32). Draw one number per full expression: the order in which
 * arguments are evaluated is free in C. */
#ifndef CAIRN_RANDOM_H
#define CAIRN_RANDOM_H

#include "cairn/real.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_random {
    uint64_t state;
    uint64_t increment; /* odd; selects the stream */
} cairn_random;

/* A generator for `seed`; generators of different `stream` with the same seed are independent. */
cairn_random cairn_random_seed(uint64_t seed, uint64_t stream);

/* The next 32 bits. */
uint32_t cairn_random_bits(cairn_random *random);

/* Uniform in [0, 1): 53 bits in double (two draws), 24 bits in float (one draw). */
cairn_real cairn_random_unit(cairn_random *random);

/* Uniform in [low, high). */
cairn_real cairn_random_uniform(cairn_random *random, cairn_real low, cairn_real high);

/* Normal with mean 0 and standard deviation 1 (Box and Muller 1958, one value of the pair). */
cairn_real cairn_random_normal(cairn_random *random);

/* Uniform integer in [0, count), without bias; 0 when count <= 0. */
int32_t cairn_random_below(cairn_random *random, int32_t count);

#ifdef __cplusplus
}
#endif

#endif
