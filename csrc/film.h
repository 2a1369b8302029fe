/* Resistance of the lubrication film between a body of revolution and the wall of its tube, interpolated. */
#ifndef SPIRILLUM_FILM_H
#define SPIRILLUM_FILM_H

#include "core.h"

/* Head of a packed film, before its coefficients in single precision, (intervals + 3, second_intervals + 3, yaws,
 * FILM_ENTRIES): lengths in m, places x on the body's axis about its middle. */
typedef struct {
    double tube, body;         /* R, a */
    double half;               /* half-length of a spheroid, 0: a straight side */
    double rear, rear_round;   /* rear end of the straight side (of a spheroid its middle), radius of its rounding */
    double front, front_round; /* front end */
    double first, last, intervals;                      /* knots of the first coordinate */
    double second_first, second_last, second_intervals; /* of the second one */
    double yaw, yaws;                                   /* largest yaw, rad; polynomials in yaw */
} Film;

enum { FILM_ENTRIES = 21, FILM_MOST_YAWS = 99 };

EXPORT double smallest_gap(const Film *film, double e, double pitch, double yaw);
void film_resistance(const Film *film, double e, double pitch, double yaw, double out[6][6]);

#endif
