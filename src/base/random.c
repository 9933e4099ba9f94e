/* Pseudo-random numbers by PCG32.
 *
 * Method: a 64-bit linear congruential generator, of whose state a random rotation of the upper
 * bits is the output (XSH-RR). Uniform integers by rejection.
 *
 * Source: O'Neill, PCG: a family of simple fast space-efficient statistically good algorithms for
 * random number generation, 2014; Box and Muller 1958. */
#include "src/base/build.h"

#include "cairn/random.h"

cairn_random cairn_random_seed(uint64_t seed, uint64_t stream)
{
    cairn_random random = {0, stream << 1 | 1};

    (void)cairn_random_bits(&random);
    random.state += seed;
    (void)cairn_random_bits(&random);
    return random;
}

uint32_t cairn_random_bits(cairn_random *random)
{
    uint64_t old = random->state;
    uint32_t shifted = (uint32_t)((old >> 18 ^ old) >> 27);
    uint32_t rotation = (uint32_t)(old >> 59);

    random->state = old * UINT64_C(6364136223846793005) + random->increment;
    return shifted >> rotation | shifted << (-rotation & 31);
}

cairn_real cairn_random_unit(cairn_random *random)
{
#ifdef CAIRN_FLOAT
    return (cairn_real)(cairn_random_bits(random) >> 8) * 0x1p-24f;
#else
    uint64_t high = cairn_random_bits(random) >> 5; /* 27 bits */
    uint64_t low = cairn_random_bits(random) >> 6;  /* 26 bits */

    return (cairn_real)(high << 26 | low) * 0x1p-53;
#endif
}

cairn_real cairn_random_uniform(cairn_random *random, cairn_real low, cairn_real high)
{
    cairn_real x = low + (high - low) * cairn_random_unit(random);

    /* Rounding may reach high. */
    return x < high || !(low < high) ? x : low;
}

cairn_real cairn_random_normal(cairn_random *random)
{
    cairn_real radius = cairn_sqrt(-2 * cairn_log(1 - cairn_random_unit(random)));

    return radius * cairn_cos(2 * CAIRN_PI * cairn_random_unit(random));
}

int32_t cairn_random_below(cairn_random *random, int32_t count)
{
    uint32_t range, threshold, bits;

    if (count <= 0)
        return 0;
    range = (uint32_t)count;
    /* Rejection of smaller draws removes the modulo bias. */
    threshold = (0u - range) % range;
    do
        bits = cairn_random_bits(random);
    while (bits < threshold);
    return (int32_t)(bits % range);
}
