/* Build options of the library, included first by every .c: floating-point settings that give the
 * same bits with every compiler, and the internal assertion. */
#ifndef CAIRN_BASE_BUILD_H
#define CAIRN_BASE_BUILD_H

#ifdef __FAST_MATH__
#error "cairn gives the same bits everywhere; -ffast-math does not"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "cairn gives the same bits everywhere; -ffinite-math-only does not"
#elif defined(__ASSOCIATIVE_MATH__)
#error "cairn gives the same bits everywhere; -fassociative-math does not"
#elif defined(__RECIPROCAL_MATH__)
#error "cairn gives the same bits everywhere; -freciprocal-math does not"
#elif defined(__NO_SIGNED_ZEROS__)
#error "cairn gives the same bits everywhere; -fno-signed-zeros does not"
#endif

/* FLT_EVAL_METHOD 16 and 32 equal 0, except that half precision is evaluated apart
 * (AVX512-FP16). */
#if defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0 && __FLT_EVAL_METHOD__ != 16 &&       \
    __FLT_EVAL_METHOD__ != 32
#if defined(__i386__) || defined(__x86_64__)
#error                                                                                             \
    "cairn gives the same bits everywhere; excess precision (x87) does not: use -msse2 -mfpmath=sse"
#else
#error                                                                                             \
    "cairn gives the same bits everywhere; excess precision does not: use -fexcess-precision=fast"
#endif
#endif

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#if defined(__FMA__) || defined(__AVX512F__)
/* Fused multiply-add instructions are disabled, because gcc 12 generates vfmaddsub in vectorized
 * loops even when contraction is off. */
#pragma GCC target("no-fma,no-avx512f")
#endif
/* Straight-line (SLP) vectorization is disabled, because gcc 12 generates vfmaddsub in vectorized
 * blocks even when contraction is off. */
#pragma GCC optimize("fp-contract=off", "no-tree-slp-vectorize")
#endif

/* Assertion of an internal invariant. Active when compiled with CAIRN_ASSERTIONS, as the tests are.
 * Static analyzers take the condition as a fact: clang's, and gcc's with CAIRN_ANALYZER. */
#if defined(__clang_analyzer__) || defined(CAIRN_ANALYZER)
#define CAIRN_ASSERT(condition) ((condition) ? (void)0 : __builtin_unreachable())
#elif defined(CAIRN_ASSERTIONS)
void cairn_assertion_failed(const char *condition, const char *file, int line);
#define CAIRN_ASSERT(condition)                                                                    \
    ((condition) ? (void)0 : cairn_assertion_failed(#condition, __FILE__, __LINE__))
#else
#define CAIRN_ASSERT(condition) ((void)0)
#endif

/* Asserts that a call with inputs that are known to be valid succeeded. An int, as this header
 * stands before all others.
 *
 * status: a cairn_status; CAIRN_OK is 0 */
static inline void cairn_must_be_ok(int status)
{
    CAIRN_ASSERT(status == 0);
    (void)status;
}

#endif
