/* Rays of a pinhole camera through a flat refracting surface. */
#ifndef SPIRILLUM_SNELL_H
#define SPIRILLUM_SNELL_H

#include "core.h"

/* A camera at x = y = 0 above the surface, as the Python layer packs it: 17 numbers; m and pixels. */
typedef struct {
    double focal, centre_u, centre_v; /* focal length, negative for a camera turned by half a turn; principal point */
    double k1, k2;                    /* radial distortion, r -> r (1 + k1 r^2 + k2 r^4) */
    double height, surface, index;    /* of the lens, of the surface; index below the surface over that above */
    double right[3], up[3], back[3];  /* axes of the camera: to the right and up in the picture, away from the scene */
} Camera;

/* Pixel (u, v) at which the camera sees a point; NaN behind it. */
void pixel_of_point(const Camera *camera, const double point[3], double pixel[2]);

/* The same; `share` is that of the horizontal distance at which the ray to a close point crosses the surface, and becomes
 * that of this one. Unless it is between 0 and 1, the search begins anywhere. */
void pixel_near(const Camera *camera, const double point[3], double *share, double pixel[2]);

/* Point at the height `level` on the ray of a pixel; NaN where the ray does not reach it. */
void point_of_pixel(const Camera *camera, const double pixel[2], double level, double point[3]);

#endif
