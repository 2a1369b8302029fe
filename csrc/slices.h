/* Slices of the lubrication film under a body's straight side, whose pressure is bounded below; see slices.c. */
#ifndef SPIRILLUM_SLICES_H
#define SPIRILLUM_SLICES_H

#include "contacts.h"
#include "film.h"

/* The film of a place: set as far as it was needed. */
typedef struct {
    SliceLanes ends; /* of the straight side, in the first two lanes */
    Slices slices;
    bool has_ends, has_slices, is_weakened;
} SlicedFilm;

/* Body and tube of a film, and the place: `thinnest` is the smallest gap of the body, m. */
typedef struct {
    const Film *film;
    const State *y;
    const double (*rotation)[3];
    const double (*resistance)[6]; /* of the film, against U and Omega_b, over the viscosity */
    double thinnest, viscosity;
} FilmPlace;

/* Begin at another place, with the edges of cavities as guesses. */
void begin_slices(SlicedFilm *sliced, const SlicedFilm *last);
/* Rates in balance; what is left of it. Where no slice cavitates at those without slices, they are the rates. */
double balance_film(const FilmPlace *place, SlicedFilm *sliced, Balance *b, double q[RATES], double left[RATES]);

#endif
