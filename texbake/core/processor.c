/* Which instructions the processor has, to choose the fastest build of the core.

   Called from texbake/core/library.py. */

#include "core.h"

#if defined(__x86_64__)

#include <cpuid.h>

/* The operating system keeps the 256-bit registers when it switches threads. */
static bool keeps_wide_registers(void)
{
    uint32_t low, high;
    __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return (low & 6) == 6;
}

/* x86-64-v3, without what only kernels of an operating system need: AVX2, FMA, BMI, BMI2, F16C,
   LZCNT and MOVBE. */
EXPORT bool has_x86_64_v3(void)
{
    const uint32_t fma = 1u << 12, movbe = 1u << 22, xsave = 1u << 27, avx = 1u << 28, f16c = 1u << 29;
    const uint32_t bmi = 1u << 3, avx2 = 1u << 5, bmi2 = 1u << 8, lzcnt = 1u << 5;
    const uint32_t first = fma | movbe | xsave | avx | f16c, second = bmi | avx2 | bmi2;
    uint32_t a, b, c, d;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & first) != first || !keeps_wide_registers())
        return false;
    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d) || (b & second) != second)
        return false;
    return __get_cpuid(0x80000001, &a, &b, &c, &d) && (c & lzcnt) != 0;
}

#else

EXPORT bool has_x86_64_v3(void)
{
    return false;
}

#endif
