/* random: seeded pseudo-random numbers, the same on every machine.
 *
 * Method: the generator PCG32 (O'Neill 2014, XSH-RR 64/32).
 *
 * Limits: draw one number per full expression, because C leaves the order in which arguments are
 * evaluated unspecified. */
#ifndef CAIRN_RANDOM_H
#define CAIRN_RANDOM_H

#include "cairn/real.h"

#ifdef __cplusplus
extern "C" {
#endif

/* State of a generator. */
typedef struct cairn_random {
    /* State of the linear congruential generator. */
    uint64_t state;
    /* Increment of the linear congruential generator. Odd; selects the stream. */
    uint64_t increment;
} cairn_random;

/* A generator seeded with `seed`. Generators of different streams are independent, also with the
 * same seed.
 *
 * seed: any number
 * stream: number of the stream */
cairn_random cairn_random_seed(uint64_t seed, uint64_t stream);

/* The next 32 random bits. */
uint32_t cairn_random_bits(cairn_random *random);

/* Uniform number in [0, 1): 53 bits in double (two draws), 24 bits in float (one draw). */
cairn_real cairn_random_unit(cairn_random *random);

/* Uniform number in [low, high).
 *
 * low, high: bounds, low < high */
cairn_real cairn_random_uniform(cairn_random *random, cairn_real low, cairn_real high);

/* Normal (Gaussian) number with mean 0 and standard deviation 1 (Box and Muller 1958, one number of
 * the pair). */
cairn_real cairn_random_normal(cairn_random *random);

/* Uniform integer in [0, count), without modulo bias; 0 when count <= 0. */
int32_t cairn_random_below(cairn_random *random, int32_t count);

#ifdef __cplusplus
}
#endif

#endif
