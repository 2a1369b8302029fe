/* Resistance of the film between a body of revolution and a tube's wall, interpolated.
 *
 * The film is a spline (cubic, tensor product) of coordinates in which thin films are straight lines: logarithms of the
 * clearances v under both ends of the straight side (under the middle, and the pitch, for a spheroid), and the yaw
 * against the yaw at which the side leaves the wall's curvature. What is interpolated are the logarithms of D and the
 * entries of the unit triangular M of R = M D M', R in an order of motions in which M stays finite. It is positive
 * definite anywhere.
 *
 * A clearance v is the depth by which an end may sink before it touches, at the place across where it is. It is smooth
 * through the tube's axis, and its zeros are contacts.
 */
#include "film.h"

/* Order of the motions (U, Omega) in the factors: those that the film resists most come first, even before odd ones. */
static const int ORDER[6] = {2, 4, 0, 1, 5, 3};
enum { ODD = 3 }; /* motions of the order from here on change their sign with the mirror */

/* A ring about the body's axis with a ball that runs around on it, or a spheroid (half > 0, ball 0); m. Of a ball larger
 * than the body, as under a slender nose, the ring's radius is negative: its centre is beyond the axis. */
typedef struct {
    double x, half, radius, ball;
} Part;

static Part rear_end(const Film *f) { return (Part){f->rear, 0.0, f->body - f->rear_round, f->rear_round}; }
static Part front_end(const Film *f) { return (Part){f->front, 0.0, f->body - f->front_round, f->front_round}; }
static Part spheroid(const Film *f) { return (Part){f->rear, f->half, f->body, 0.0}; }

/* Direction of the body's axis: its components towards the tube's axis and to the side. */
typedef struct {
    double lift, side;
} Axis;

static Axis axis_of(double pitch, double yaw) { return (Axis){sin(pitch), cos(pitch) * sin(yaw)}; }

/* Depth by which a part may sink until it touches the wall, m; e is the offset of the body's middle. */
static double clearance_of(double tube, Part part, double e, Axis axis) {
    const double limit = 0.99;
    const double room = tube - part.ball, across = part.x * axis.side, depth = e - part.x * axis.lift;
    const double ring = part.radius, stretch = part.half * part.half - ring * ring;
    double n_y = clamped(across / (room - ring), -limit, limit), q_y = across, q_z = depth;
    for (int k = 0; k < (part.half > 0.0 ? 4 : 2); k++) {
        const double n_z = sqrt(1.0 - n_y * n_y);
        const double along = n_y * axis.side - n_z * axis.lift; /* n.d; the depth counts downwards */
        const double reach = copysign(sqrt(ring * ring + stretch * along * along), ring), bend = stretch * along;
        if (reach != 0.0) {
            q_y = across + (ring * ring * n_y + bend * axis.side) / reach;
            q_z = depth + (ring * ring * n_z - bend * axis.lift) / reach;
        }
        n_y = clamped(n_y + (q_y - room * n_y) / (room - ring), -limit, limit);
    }
    return copysign(sqrt(larger(room * room - q_y * q_y, 0.0)), room) - q_z;
}

/* Distance between the wall and a part, m: the normal is turned until it points at the nearest point. */
static double gap_of(double tube, Part part, double e, Axis axis) {
    const double c_y = part.x * axis.side, c_z = e - part.x * axis.lift, size = hypot(c_y, c_z);
    const double ring = part.radius, stretch = part.half * part.half - ring * ring;
    double n_y = 0.0, n_z = 1.0, q_y = c_y, q_z = c_z;
    if (size > 1e-9 * tube) {
        n_y = c_y / size;
        n_z = c_z / size;
    }
    for (int k = 0; k < 4; k++) {
        const double along = n_y * axis.side - n_z * axis.lift, across = -n_y * axis.lift - n_z * axis.side;
        const double reach = copysign(sqrt(larger(ring * ring + stretch * along * along, 0.0)), ring);
        if (reach != 0.0) {
            q_y = c_y + (ring * ring * n_y + stretch * along * axis.side) / reach;
            q_z = c_z + (ring * ring * n_z - stretch * along * axis.lift) / reach;
        }
        if (k == 3 || reach == 0.0) break;
        const double error = n_y * c_z - n_z * c_y + stretch * along * across / reach;
        const double slope = -(n_y * c_y + n_z * c_z) + stretch * (across * across - along * along) / reach;
        if (slope > -1e-6 * tube) break;
        const double turn = clamped(-error / slope, -0.3, 0.3), y = n_y - turn * n_z, z = n_z + turn * n_y;
        const double length = hypot(y, z);
        n_y = y / length;
        n_z = z / length;
    }
    return tube - part.ball - copysign(hypot(q_y, q_z), tube - part.ball);
}

/* Smallest distance between a body and the wall, m. */
EXPORT double smallest_gap(const Film *f /* (...) */, double e, double pitch, double yaw) {
    const Axis axis = axis_of(pitch, yaw);
    if (f->half > 0.0) return gap_of(f->tube, spheroid(f), e, axis);
    return smaller(gap_of(f->tube, rear_end(f), e, axis), gap_of(f->tube, front_end(f), e, axis));
}

/* Coordinate of a clearance: its logarithm where it is small against the radius, and finer about the radius. */
EXPORT double stretched(double v, double radius) {
    const double wide = 1.0 + v / radius;
    return log(v * wide * wide);
}

/* Sine of the yaw at which the wall's curvature under the straight side counts, from the clearances of its ends.
 *
 * With h = rear, front at the ends and the curvature's term C s (L - s), C = sin^2 psi/(2 (R - a)), in between,
 *
 *     int h^-1.5 ds = 2 L/(sqrt(rear front) (sqrt rear + sqrt front) (1 + (sin psi/scale)^2)).
 */
EXPORT double yaw_scale(const Film *f /* (...) */, double rear, double front) {
    if (f->half > 0.0) return 1.0;
    return sqrt(2.0 * (f->tube - f->body)) * (sqrt(rear) + sqrt(front)) / (f->front - f->rear);
}

/* What the interpolation goes by. */
typedef struct {
    double first, second, yaw; /* three coordinates */
    double known;              /* part of log D of the first motion that is known in closed form */
    double turn;               /* angle from z' to the normal of the wall, where a rounded end is nearest, rad */
} Coordinates;

static Coordinates coordinates_of(const Film *f, double e, double pitch, double yaw) {
    const Axis axis = axis_of(pitch, yaw);
    const double a = f->body, least = 1e-12 * a, largest = sin(f->yaw);
    double turn = sin(yaw);
    Coordinates c;
    if (f->half > 0.0) {
        c.first = stretched(larger(clearance_of(f->tube, spheroid(f), e, axis), least), a);
        c.second = pitch;
        c.yaw = asinh(turn) / asinh(largest);
        c.known = 0.0;
        c.turn = pitch;
    } else {
        const double rear = larger(clearance_of(f->tube, rear_end(f), e, axis), least);
        const double front = larger(clearance_of(f->tube, front_end(f), e, axis), least);
        const double scale = yaw_scale(f, rear, front), product = rear * front / (a * a * a);
        c.first = stretched(rear, a);
        c.second = stretched(front, a);
        turn /= scale;
        c.yaw = asinh(turn) / asinh(largest / scale);
        c.known = -log(sqrt(product) * (sqrt(rear) + sqrt(front)) * (1.0 + turn * turn));
        c.turn = 0.0;
        if (f->rear_round > 0.0) c.turn += pitch * squared(front / (rear + front));
        if (f->front_round > 0.0) c.turn += pitch * squared(rear / (rear + front));
    }
    c.yaw = clamped(c.yaw, -1.0, 1.0);
    return c;
}

/* Weights of the four cubic B-splines at a place, and the number of their first; a straight line outside. */
EXPORT int64_t spline_weights(double at, double first, double last, int64_t intervals, double out[4]) {
    const double step = (last - first) / (double)intervals, place = (at - first) / step;
    const double inside = clamped(place, 0.0, (double)intervals);
    const int64_t cell = inside >= 1.0 ? (int64_t)smaller(inside, (double)(intervals - 1)) : 0; /* of no number too */
    const double u = inside - (double)cell, v = 1.0 - u, beyond = place - inside;
    out[0] = v * v * v / 6.0;
    out[1] = (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0;
    out[2] = (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0;
    out[3] = u * u * u / 6.0;
    if (beyond != 0.0) {
        out[0] -= 0.5 * v * v * beyond;
        out[1] += (1.5 * u * u - 2.0 * u) * beyond;
        out[2] += (2.0 * v - 1.5 * v * v) * beyond;
        out[3] += 0.5 * u * u * beyond;
    }
    return cell;
}

/* What the interpolation of a film goes by at a place. */
EXPORT void film_coordinates(const Film *f /* (...) */, double e, double pitch, double yaw, Coordinates *out) {
    *out = coordinates_of(f, e, pitch, yaw);
}

/* Fill log D and M, in the order of the triangle. */
static void interpolate(const Film *f, const Coordinates *c, double out[FILM_ENTRIES]) {
    double along[4], across[4], sums[FILM_ENTRIES * FILM_MOST_YAWS];
    const int64_t row = spline_weights(c->first, f->first, f->last, (int64_t)f->intervals, along);
    const int64_t column
        = spline_weights(c->second, f->second_first, f->second_last, (int64_t)f->second_intervals, across);
    const int64_t yaws = (int64_t)f->yaws, count = FILM_ENTRIES * yaws, columns = (int64_t)f->second_intervals + 3;
    const float *coefficients = (const float *)(f + 1);
    for (int64_t k = 0; k < count; k++) sums[k] = 0.0;
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            const double weight = along[i] * across[j];
            const float *of_cell = coefficients + ((row + i) * columns + column + j) * count;
#pragma omp simd
            for (int64_t k = 0; k < count; k++) sums[k] += weight * (double)of_cell[k];
        }
    }
    /* even polynomials in yaw, times the yaw for entries that change their sign with the mirror */
    const double even = c->yaw * c->yaw;
    for (int64_t n = yaws - 2; n >= 0; n--)
        for (int k = 0; k < FILM_ENTRIES; k++) sums[n * FILM_ENTRIES + k] += even * sums[(n + 1) * FILM_ENTRIES + k];
    for (int k = 0; k < FILM_ENTRIES; k++) out[k] = sums[k];
    for (int i = ODD; i < 6; i++)
        for (int j = 0; j < ODD; j++) out[6 + i * (i - 1) / 2 + j] *= c->yaw;
}

/* Fill M D M' in the order of the motions, times powers of a, and turn it by an angle from the normal to z'. */
static void multiply_factors(const double sums[FILM_ENTRIES], double a, double angle, double out[6][6]) {
    double d[6];
    for (int i = 0; i < 6; i++) d[i] = exp(sums[i]);
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j <= i; j++) {
            double total = 0.0;
            for (int k = 0; k <= j; k++) {
                const double left = k == i ? 1.0 : sums[6 + i * (i - 1) / 2 + k];
                const double right = k == j ? 1.0 : sums[6 + j * (j - 1) / 2 + k];
                total += left * right * d[k];
            }
            const int m = ORDER[i], n = ORDER[j];
            total *= m < 3 ? a : a * a;
            total *= n < 3 ? 1.0 : a;
            out[m][n] = out[n][m] = total;
        }
    }
    const double c = cos(angle), s = sin(angle);
    for (int i = 0; i < 6; i++) {
        const double x = out[i][0], z = out[i][2];
        out[i][0] = c * x + s * z;
        out[i][2] = c * z - s * x;
    }
    for (int i = 0; i < 6; i++) {
        const double x = out[0][i], z = out[2][i];
        out[0][i] = c * x + s * z;
        out[2][i] = c * z - s * x;
    }
}

void film_resistance(const Film *f, double e, double pitch, double yaw, double out[6][6]) {
    double sums[FILM_ENTRIES];
    const Coordinates c = coordinates_of(f, e, pitch, yaw);
    interpolate(f, &c, sums);
    sums[0] += c.known;
    multiply_factors(sums, f->body, c.turn, out);
}

/* Write the film's resistance (6x6, per viscosity, in F about the body's middle); the body's smallest gap, m.
 *
 * Outside of the table the film goes on: as power laws below its thinnest clearances, unchanged beyond its largest yaw.
 * Where the body touches the wall, the clearances are 1e-12 of its radius, and the gap is negative.
 *
 * e: offset of the body's middle from the tube's axis, m, at least 0; pitch: pitch,
 * rad, positive where the nose points away from the wall; yaw: yaw, rad; out: (6, 6), the result. */
EXPORT double film_at(const Film *film /* (...) */, double e, double pitch, double yaw, double *out /* (6, 6) */) {
    film_resistance(film, e, pitch, yaw, (double (*)[6])out);
    return smallest_gap(film, e, pitch, yaw);
}

/* Depth by which a ring, or a spheroid, may sink until it touches the wall, m.
 *
 * x: place on the body's axis; half: half-length of the spheroid, 0 for a ring; ring:
 * radius of the ring or spheroid; rounded: radius of the ball that runs around on the ring; e: offset of the body's
 * middle; lift: component of the body's axis towards the tube's axis; side: component of the body's axis to the side. */
EXPORT double clearance(const Film *film /* (...) */, double x, double half, double ring, double rounded, double e,
                        double lift, double side) {
    return clearance_of(film->tube, (Part){x, half, ring, rounded}, e, (Axis){lift, side});
}
