/* Apparent contour of a body from its polynomials, and its projection into the picture.
 *
 * `factors` are Chebyshev coefficients, in the lens's place along and across, of x and y of the edge points with the
 * upper rims of flat ends, and of x and y with the lower ones; `reach` are the largest distances of the lens. A pose is
 * x, y, heading.
 */
#include "snell.h"
#include <string.h>

enum { ALONG = 8, ACROSS = 5, BLOCK = 64 };

/* Products of Chebyshev polynomials at the place of the lens in the body's frame. */
static void lens_basis(const double pose[3], const double reach[2], double basis[ALONG][ACROSS]) {
    const double c = cos(pose[2]), s = sin(pose[2]);
    const double turn_a = acos(clamped(-(c * pose[0] + s * pose[1]) / reach[0], -1.0, 1.0));
    const double turn_b = acos(clamped(-(-s * pose[0] + c * pose[1]) / reach[1], -1.0, 1.0));
    for (int i = 0; i < ALONG; i++)
        for (int j = 0; j < ACROSS; j++) basis[i][j] = cos(i * turn_a) * cos(j * turn_b);
}

/* Edge points in the plane through the axis, in the body's frame.
 *
 * pose: x, y, heading; factors: Chebyshev coefficients, in the lens's place along and across, of x and y with the upper
 * rims of flat ends, and of x and y with the lower ones; the outer point of the two is taken; normals: outward normals;
 * reach: largest distances of the lens along and across, m; points: the points, m. */
EXPORT void edge_points(const double pose[3], const double *factors /* (8, 5, 4, count) */,
                        const double (*normals)[2] /* (count, 2) */, const double reach[2],
                        double (*points)[2] /* (count, 2) */, int64_t count) {
    double basis[ALONG][ACROSS], both[4][BLOCK];
    lens_basis(pose, reach, basis);
    for (int64_t first = 0; first < count; first += BLOCK) {
        const int64_t length = count - first < BLOCK ? count - first : BLOCK;
        memset(both, 0, sizeof both);
        for (int64_t m = 0; m < ALONG * 4; m++) {
            const double *weights = basis[m / 4], *factor = factors + (m / 4 * ACROSS * 4 + m % 4) * count + first;
            for (int64_t n = 0; n < length; n++)
                for (int64_t j = 0; j < ACROSS; j++) both[m % 4][n] += weights[j] * factor[4 * j * count + n];
        }
        for (int64_t n = 0; n < length; n++) {
            const bool lower = (both[2][n] - both[0][n]) * normals[first + n][0] > 0.0; /* the outer one of two rims */
            points[first + n][0] = both[lower ? 2 : 0][n];
            points[first + n][1] = both[lower ? 3 : 1][n];
        }
    }
}

/* Project a body's apparent contour into the picture.
 *
 * pose: x, y, heading; factors: coefficients of the edge points, as in `edge_points`; normals: outward normals in the
 * body's frame; reach: largest distances of the lens along and across, m; axis_height: height of the axis, m; camera:
 * of snell.h; pixels: the edge points; directions: unit normals in the picture; size: pixels per m
 * along them; slopes: Jacobian of the displacement along each normal by (x, y, heading), pixels per m and per rad. */
EXPORT void edge_places(const double pose[3], const double *factors /* (8, 5, 4, count) */,
                        const double (*normals)[2] /* (count, 2) */, const double reach[2], double axis_height,
                        const Camera *camera, double (*pixels)[2] /* (count, 2) */,
                        double (*directions)[2] /* (count, 2) */, double *size /* (count) */,
                        double (*slopes)[3] /* (count, 3) */, int64_t count) {
    const double c = cos(pose[2]), s = sin(pose[2]), step = 1e-4; /* m */
    double share = 0.0;
    edge_points(pose, factors, normals, reach, pixels, count);
    for (int64_t i = 0; i < count; i++) {
        const double *normal = normals[i], local[2] = {pixels[i][0], pixels[i][1]};
        double ends[2][2];
        for (int k = 0; k < 2; k++) {
            const double x = local[0] + k * step * normal[0], y = local[1] + k * step * normal[1];
            const double point[3] = {pose[0] + c * x - s * y, pose[1] + s * x + c * y, axis_height};
            pixel_near(camera, point, &share, ends[k]);
        }
        const double d_u = (ends[1][0] - ends[0][0]) / step, d_v = (ends[1][1] - ends[0][1]) / step;
        const double far = sqrt(d_u * d_u + d_v * d_v);
        memcpy(pixels[i], ends[0], sizeof ends[0]);
        directions[i][0] = d_u / far;
        directions[i][1] = d_v / far;
        size[i] = far;
        slopes[i][0] = far * (c * normal[0] - s * normal[1]);
        slopes[i][1] = far * (s * normal[0] + c * normal[1]);
        slopes[i][2] = far * (local[0] * normal[1] - local[1] * normal[0]);
    }
}
