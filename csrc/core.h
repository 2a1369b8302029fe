/* What all files of csrc/ share.
 *
 * A function that Python calls is EXPORTed. build.py writes its stub, spirillum/kernels/core.py, from its declaration
 * and from the comment before it. Arrays are pointers to their first element (C order) with their shape in a comment,
 * (...) for any; those of structs end with the numbers of a struct; written are those that are not const. The
 * dimensions that shapes name come last, each once, in the order in which they first appear, and are no arguments of
 * the stub. `Threads share n.` lets threads work on ranges of n. A function allocates nothing unless it says so, keeps
 * nothing between calls, and checks nothing: the Python layer has.
 */
#ifndef SPIRILLUM_CORE_H
#define SPIRILLUM_CORE_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#if defined(SPIRILLUM_INSIDE) /* a part of another library */
#define EXPORT
#elif defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#define PI 3.14159265358979323846

/* A NaN in the first place stays: a trial outside of everything must not look like one on the border. */
static inline double larger(double a, double b) { return b > a ? b : a; }
static inline double smaller(double a, double b) { return b < a ? b : a; }
static inline double clamped(double x, double low, double high) { return smaller(larger(x, low), high); }
static inline double squared(double x) { return x * x; }

/* Inverse of a 3x3 matrix by cofactors. */
static inline void invert(const double a[9], double inverse[9]) {
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const int b = 3 * ((j + 1) % 3), c = 3 * ((j + 2) % 3), d = (i + 1) % 3, e = (i + 2) % 3;
            inverse[3 * i + j] = a[b + d] * a[c + e] - a[b + e] * a[c + d];
        }
    }
    const double determinant = a[0] * inverse[0] + a[1] * inverse[3] + a[2] * inverse[6];
    for (int e = 0; e < 9; e++) inverse[e] /= determinant;
}

#endif
