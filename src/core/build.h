/* Included first by every .c of the library: the same bits from every compiler, and the internal
 * assertion. */
#ifndef CAIRN_CORE_BUILD_H
#define CAIRN_CORE_BUILD_H

#ifdef __FAST_MATH__
#error "cairn gives the same bits everywhere; -ffast-math does not"
#endif

/* 16 and 32 are 0 with half precision kept apart (AVX512-FP16). */
#if defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0 && __FLT_EVAL_METHOD__ != 16 &&       \
    __FLT_EVAL_METHOD__ != 32
#error                                                                                             \
    "cairn gives the same bits everywhere; excess precision (x87) does not: use -msse2 -mfpmath=sse"
#endif

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#if defined(__FMA__) || defined(__AVX512F__)
/* Without fused instructions, because gcc 12 makes vfmaddsub of vectorized loops even when
 * contraction is off. */
#pragma GCC target("no-fma,no-avx512f")
#endif
/* Without straight-line vectorization, because gcc 12 makes vfmaddsub of it even when
 * contraction is off. */
#pragma GCC optimize("fp-contract=off", "no-tree-slp-vectorize")
#endif

/* Invariants of the library itself; the tests are built with CAIRN_ASSERTIONS. */
#ifdef __clang_analyzer__
#define CAIRN_ASSERT(condition)                                                                    \
    ((condition) ? (void)0 : __builtin_unreachable()) /* a fact that it cannot see */
#elif defined(CAIRN_ASSERTIONS)
void cairn_assertion_failed(const char *condition, const char *file, int line);
#define CAIRN_ASSERT(condition)                                                                    \
    ((condition) ? (void)0 : cairn_assertion_failed(#condition, __FILE__, __LINE__))
#else
#define CAIRN_ASSERT(condition) ((void)0)
#endif

#endif
