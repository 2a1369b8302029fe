/* Rays of a pinhole camera through a flat refracting surface, exact by Snell's law. */
#include "snell.h"

enum { STEPS = 30 };

/* Horizontal distance from the lens at which the ray to a point crosses the surface, m.
 *
 * Solves s/sqrt(s^2 + a^2) = n (d - s)/sqrt((d - s)^2 + b^2) by Newton's method; the left side increases and the right
 * side decreases with s, so that there is one root between 0 and d. Convergence is quadratic: after a relative step of
 * 1e-9 it is exact to rounding.
 *
 * d: horizontal distance of the point from the lens; a: height of the lens above the surface; b: depth of the point
 * below it; n: refractive index below the surface over that above; s: first guess, between 0 and d.
 */
static double surface_crossing(double d, double a, double b, double n, double s) {
    double low = 0.0, high = d;
    for (int k = 0; k < STEPS; k++) {
        const double rest = d - s, up = 1.0 / sqrt(s * s + a * a), down = 1.0 / sqrt(rest * rest + b * b);
        const double value = s * up - n * rest * down;
        if (value > 0.0)
            high = s;
        else
            low = s;
        const double step = value / (a * a * (up * up * up) + n * b * b * (down * down * down));
        s -= step;
        if (fabs(step) < 1e-9 * d) break;
        if (s <= low || s >= high) s = 0.5 * (low + high);
    }
    return s;
}

void pixel_near(const Camera *c, const double point[3], double *share, double pixel[2]) {
    const double across = sqrt(point[0] * point[0] + point[1] * point[1]);
    const double above = c->height - c->surface, below = c->surface - point[2];
    double x = point[0], y = point[1], z = point[2] - c->height;
    if (below > 0.0) {
        if (!(0.0 < *share && *share < 1.0)) *share = above / (above + below / c->index);
        if (across <= 0.0 || c->index == 1.0)
            *share = across > 0.0 ? above / (above + below) : 0.0;
        else
            *share = surface_crossing(across, above, below, c->index, *share * across) / across;
        x *= *share;
        y *= *share;
        z = -above;
    }
    const double ahead = -(c->back[0] * x + c->back[1] * y + c->back[2] * z);
    pixel[0] = pixel[1] = NAN;
    if (ahead <= 0.0) return;
    const double a = (c->right[0] * x + c->right[1] * y + c->right[2] * z) / ahead;
    const double b = (c->up[0] * x + c->up[1] * y + c->up[2] * z) / ahead, r2 = a * a + b * b;
    const double stretch = 1.0 + r2 * (c->k1 + r2 * c->k2);
    pixel[0] = c->centre_u + c->focal * a * stretch;
    pixel[1] = c->centre_v - c->focal * b * stretch;
}

void pixel_of_point(const Camera *c, const double point[3], double pixel[2]) {
    double share = 0.0;
    pixel_near(c, point, &share, pixel);
}

/* Tangent of the angle to the optical axis whose distorted image is `far`, by Newton's method. */
static double undistorted(const Camera *c, double far) {
    double r = far;
    for (int k = 0; k < STEPS; k++) {
        const double r2 = r * r;
        const double slope = 1.0 + r2 * (3.0 * c->k1 + 5.0 * r2 * c->k2);
        const double step = (r * (1.0 + r2 * (c->k1 + r2 * c->k2)) - far) / slope;
        r -= step;
        if (fabs(step) < 1e-14) break;
    }
    return r;
}

void point_of_pixel(const Camera *c, const double pixel[2], double level, double point[3]) {
    double a = (pixel[0] - c->centre_u) / c->focal, b = (c->centre_v - pixel[1]) / c->focal;
    if (c->k1 != 0.0 || c->k2 != 0.0) {
        const double far = sqrt(a * a + b * b);
        if (far > 0.0) {
            const double r = undistorted(c, far);
            a = a * r / far;
            b = b * r / far;
        }
    }
    const double x = c->right[0] * a + c->up[0] * b - c->back[0];
    const double y = c->right[1] * a + c->up[1] * b - c->back[1];
    const double z = c->right[2] * a + c->up[2] * b - c->back[2];
    point[0] = point[1] = NAN;
    point[2] = level;
    if (z >= 0.0) return;
    if (level >= c->surface) {
        const double far = (level - c->height) / z;
        point[0] = x * far;
        point[1] = y * far;
        return;
    }
    const double length = sqrt(x * x + y * y + z * z) * c->index;
    const double sine_x = x / length, sine_y = y / length; /* Snell's law keeps n sin(angle) */
    const double far = (c->surface - c->height) / z;
    const double deep = (c->surface - level) / sqrt(1.0 - sine_x * sine_x - sine_y * sine_y);
    point[0] = x * far + sine_x * deep;
    point[1] = y * far + sine_y * deep;
}

/* Project points, m, to pixels (u, v); NaN behind the camera. */
EXPORT void pixels_of_points(const double (*points)[3] /* (count, 3) */, const Camera *camera,
                             double (*pixels)[2] /* (count, 2) */, int64_t count) {
    double share = 0.0;
    for (int64_t i = 0; i < count; i++) pixel_near(camera, points[i], &share, pixels[i]);
}

/* Points at the height `level` on the rays of pixels, m; NaN where a ray does not reach it. */
EXPORT void points_of_pixels(const double (*pixels)[2] /* (count, 2) */, double level, const Camera *camera,
                             double (*points)[3] /* (count, 3) */, int64_t count) {
    for (int64_t i = 0; i < count; i++) point_of_pixel(camera, pixels[i], level, points[i]);
}
