/* Variance of a sum of autocorrelated terms. */
#ifndef SPIRILLUM_NEWEY_WEST_H
#define SPIRILLUM_NEWEY_WEST_H

#include "core.h"

/* Variance of the sum of terms with mean zero: autocovariances with Bartlett's triangular window.
 *
 * W. K. Newey and K. D. West, A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent
 * covariance matrix, Econometrica 55:703, 1987.
 *
 * The terms follow each other at a distance of `stride` numbers; `reach` is the largest lag with a correlation.
 */
static inline double variance_of_sum(const double *terms, int64_t stride, int64_t count, int64_t reach) {
    double total = 0.0;
    for (int64_t i = 0; i < count; i++) {
        const int64_t first = i > reach ? i - reach : 0, last = i + reach < count ? i + reach : count - 1;
        for (int64_t j = first; j <= last; j++) {
            const double lag = (double)(i > j ? i - j : j - i);
            total += terms[i * stride] * terms[j * stride] * (1.0 - lag / ((double)reach + 1.0));
        }
    }
    return total;
}

#endif
