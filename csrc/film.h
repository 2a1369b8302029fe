/* Resistance of the lubrication film between a body of revolution and the wall of its tube, interpolated. */
#ifndef SPIRILLUM_FILM_H
#define SPIRILLUM_FILM_H

#include "core.h"

/* A packed film, opened: lengths in m, places x on the body's axis about its middle. */
typedef struct {
    double tube, body;         /* R, a */
    double half;               /* half-length of a spheroid, 0: a straight side */
    double rear, rear_round;   /* rear end of the straight side (of a spheroid its middle), radius of its rounding */
    double front, front_round; /* front end */
    double first, last;        /* knots of the first coordinate */
    int64_t intervals;
    double second_first, second_last; /* knots of the second coordinate */
    int64_t second_intervals;
    double yaw;                /* largest yaw, rad */
    int64_t yaws;              /* polynomials in yaw */
    const float *coefficients; /* (intervals + 3, second_intervals + 3, yaws, FILM_ENTRIES) */
} Film;

enum { FILM_HEAD = 15, FILM_ENTRIES = 21, FILM_MOST_YAWS = 99 };

Film film_opened(const double *packed);
double film_smallest_gap(const Film *film, double e, double pitch, double yaw);
void film_resistance(const Film *film, double e, double pitch, double yaw, double out[6][6]);

#endif
