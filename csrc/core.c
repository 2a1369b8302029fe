/* What the library says of itself. */
#include "core.h"

/* Digest of the sources that it was compiled from. */
EXPORT const char *csrc_digest(void) { return CSRC_DIGEST; }

/* Whether the processor runs the build for x86-64-v3. */
EXPORT int64_t has_wide_vectors(void) {
#if defined(__x86_64__) || defined(_M_X64)
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
#else
    return 0;
#endif
}
