/* What the library says of itself. */
#include "core.h"

#if defined(__x86_64__) || defined(_M_X64)
#include <cpuid.h>
#endif

/* Digest of the sources that it was compiled from. */
EXPORT const char *csrc_digest(void) { return CSRC_DIGEST; }

/* Whether the processor runs the build for x86-64-v3, and the system saves its registers (Intel 64 and IA-32 Architectures
 * Software Developer's Manual, vol. 1, sections 14.5.3 and 14.7.1). `__builtin_cpu_supports` says no where zig compiles. */
EXPORT int64_t has_wide_vectors(void) {
#if defined(__x86_64__) || defined(_M_X64)
    enum { FMA = 1 << 12, OSXSAVE = 1 << 27, AVX2 = 1 << 5, BMI2 = 1 << 8, SAVED = 6 };
    unsigned a, b, c, d, saved, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & FMA) || !(c & OSXSAVE)) return 0;
    __asm__("xgetbv" : "=a"(saved), "=d"(high) : "c"(0));
    if ((saved & SAVED) != SAVED || !__get_cpuid_count(7, 0, &a, &b, &c, &d)) return 0;
    return (b & AVX2) && (b & BMI2);
#else
    return 0;
#endif
}
