/* Lines of sight of the virtual camera, and the still picture that they meet: floor, ruler and glass tube.
 *
 * It shares nothing with snell.c, which measures its pictures, so that an error of either one shows.
 */
#include "core.h"

/* A camera above a flat surface of oil, at x = y = 0 with z towards it, as the Python layer packs it; m and pixels. */
typedef struct {
    double eye, surface, index;       /* heights of the lens and of the surface; refractive index of the oil */
    double focal, centre_u, centre_v; /* focal length, negative for a camera turned by half a turn; optical axis */
    double k1, k2;                    /* radial distortion, r -> r (1 + k1 r^2 + k2 r^4) */
    double turn[3][3];                /* rotation from the frame to the tilted camera */
} VirtualCamera;

/* A line of sight below the surface: where it crosses it, m, and the unit vector in the oil, away from the camera. */
typedef struct {
    double x, y, dx, dy, dz;
} Ray;

/* Horizontal distance from the lens at which the ray to a point crosses the surface.
 *
 * r + deep tan(angle in the oil) = across, a concave rising function of r, by Newton's method.
 */
static double crossing_of(const VirtualCamera *c, double across, double deep) {
    const double above = c->eye - c->surface, n2 = c->index * c->index;
    double r = across * above / (above + deep / c->index);
    for (int k = 0; k < 20; k++) {
        const double root = 1.0 / sqrt(n2 * (above * above + r * r) - r * r), miss = r + deep * r * root - across;
        const double step = miss / (1.0 + deep * n2 * above * above * root * root * root);
        r -= step;
        if (fabs(step) <= 1e-15 * across) break;
    }
    return r;
}

/* Pixel u, v and height z of points, by Snell's law; those above the surface are seen straight. */
EXPORT void project(const double (*points)[3] /* (count, 3) */, const VirtualCamera *c,
                    double (*seen)[3] /* (count, 3) */, int64_t count) {
    for (int64_t i = 0; i < count; i++) {
        double x = points[i][0], y = points[i][1], down = c->eye - points[i][2];
        if (points[i][2] < c->surface) {
            const double across = hypot(x, y);
            const double bent = across > 0.0 ? crossing_of(c, across, c->surface - points[i][2]) / across : 0.0;
            x *= bent;
            y *= bent;
            down = c->eye - c->surface;
        }
        const double away = -(c->turn[2][0] * x + c->turn[2][1] * y - c->turn[2][2] * down);
        const double a = (c->turn[0][0] * x + c->turn[0][1] * y - c->turn[0][2] * down) / away;
        const double b = (c->turn[1][0] * x + c->turn[1][1] * y - c->turn[1][2] * down) / away;
        const double r2 = a * a + b * b, stretch = c->focal * (1.0 + r2 * (c->k1 + r2 * c->k2));
        seen[i][0] = c->centre_u + stretch * a;
        seen[i][1] = c->centre_v - stretch * b;
        seen[i][2] = points[i][2];
    }
}

/* Tangent of the angle to the optical axis whose distorted image is `far`, by Newton's method. */
static double straightened(const VirtualCamera *c, double far) {
    double r = far;
    for (int k = 0; k < 12; k++) {
        const double r2 = r * r, bent = r * (1.0 + r2 * (c->k1 + r2 * c->k2));
        const double step = (bent - far) / (1.0 + r2 * (3.0 * c->k1 + 5.0 * r2 * c->k2));
        r -= step;
        if (fabs(step) < 1e-15) break;
    }
    return r;
}

static Ray sightline(const VirtualCamera *c, double u, double v) {
    double a = (u - c->centre_u) / c->focal, b = -(v - c->centre_v) / c->focal;
    if (c->k1 != 0.0 || c->k2 != 0.0) {
        const double far = hypot(a, b);
        if (far > 0.0) {
            const double r = straightened(c, far);
            a = a * r / far;
            b = b * r / far;
        }
    }
    double x = a * c->turn[0][0] + b * c->turn[1][0] - c->turn[2][0];
    double y = a * c->turn[0][1] + b * c->turn[1][1] - c->turn[2][1];
    double z = a * c->turn[0][2] + b * c->turn[1][2] - c->turn[2][2];
    const double size = sqrt(x * x + y * y + z * z);
    x /= size;
    y /= size;
    z /= size;
    const double down = (c->eye - c->surface) / -z;
    const double dx = x / c->index, dy = y / c->index; /* Snell's law keeps n sin(angle) */
    return (Ray){x * down, y * down, dx, dy, -sqrt(1.0 - dx * dx - dy * dy)};
}

/* Lines of sight of pixels: x and y where they cross the surface, unit vector in the oil, away from the camera. */
EXPORT void sightlines(const double (*pixels)[2] /* (count, 2) */, const VirtualCamera *camera, Ray *rays /* (count) */,
                       int64_t count) {
    for (int64_t i = 0; i < count; i++) rays[i] = sightline(camera, pixels[i][0], pixels[i][1]);
}

/* Two strips of paper with lines across, at both sides of y = 0: smallest and largest |y|, m. */
typedef struct {
    double paper_start, line_start, line_end, paper_end;
    double spacing, width; /* from one line to the next; of a line */
} Ruler;

/* A glass tube along x; m. */
typedef struct {
    double height, inner, outer; /* of its axis; radii */
    double half_length;          /* negative where there is no tube */
    double absorption;           /* coefficient of the glass, 1/m */
} GlassTube;

/* A sine wave of the floor's brightness: wavevector, 1/m, phase, relative amplitude. */
typedef struct {
    double kx, ky, phase, amplitude;
} FloorWave;

/* What half of a tube does to light: its transmission, and the light that it mirrors. */
typedef struct {
    double through, sheen;
} Glass;

static double bell(double x) { return exp(-(x * x)); }

/* The glass absorbs along the path through its wall, longest at the edges; `height` of the surface above the axis. */
static Glass glass_on(Ray ray, double height, const GlassTube *tube) {
    const double slant = hypot(ray.dy, ray.dz), away = (ray.y * ray.dz - height * ray.dy) / slant;
    const double nearest = -(ray.y * ray.dy + height * ray.dz) / (slant * slant);
    if (fabs(away) > 1.1 * tube->outer || fabs(ray.x + ray.dx * nearest) > tube->half_length) return (Glass){1.0, 0.0};
    const double inner = sqrt(larger(tube->inner * tube->inner - away * away, 0.0));
    const double outer = sqrt(larger(tube->outer * tube->outer - away * away, 0.0)), share = away / tube->outer;
    const double lamps = 0.20 * bell((share - 0.62) / 0.018) + 0.10 * bell((share + 0.70) / 0.03);
    return (Glass){
        .through = exp(-tube->absorption * (outer - inner) / slant),
        .sheen = lamps + 0.06 * bell((fabs(away) - tube->inner) / 0.0005),
    };
}

/* Samples of a pixel on the ruler's paper and on its lines. */
typedef struct {
    double paper, ink;
} Print;

static Print print_at(const Ruler *ruler, double x, double y) {
    if (!(ruler->paper_start < y && y < ruler->paper_end)) return (Print){0.0, 0.0};
    const double off = fabs(x - ruler->spacing * floor(x / ruler->spacing + 0.5));
    const bool inked = ruler->line_start < y && y < ruler->line_end && off < 0.5 * ruler->width;
    return inked ? (Print){0.0, 1.0} : (Print){1.0, 0.0};
}

/* Picture of the still parts: floor with its ruler, seen through oil and a tube of glass.
 *
 * camera: packed; spots: samples of a pixel, for 4 x 4 neighbouring pixels; the first quarter also sees the glass;
 * colours: of the ground, the ruler's paper and its ink; ruler: smallest |y| of the paper, smallest and largest |y| of
 * the lines, largest |y| of the paper, distance from one line to the next, width of a line, m; tube: height of its
 * axis, inner and outer radius, half its length (negative: there is none), m, absorption coefficient, 1/m; waves: of
 * the floor's brightness: wavevector, 1/m, phase, relative amplitude; oil: absorption coefficients of red, green and
 * blue, 1/m; light: light of the still parts, linear; over: transmission of the glass between robot and camera; shine:
 * light mirrored by the glass; floors: x and y of the floor behind each pixel, m. */
EXPORT void still_picture(const VirtualCamera *camera, const double *spots /* (16, samples, 2) */,
                          const double colours[3][3], const Ruler *ruler, const GlassTube *tube,
                          const FloorWave *waves /* (wave_count) */, const double oil[3],
                          float *light /* (rows, columns, 3) */, float *over /* (rows, columns) */,
                          float *shine /* (rows, columns) */, float (*floors)[2] /* (rows, columns, 2) */,
                          int64_t samples, int64_t wave_count, int64_t rows, int64_t columns) {
    const double *ground = colours[0], *paper = colours[1], *ink = colours[2];
    const int64_t few = samples / 4 > 1 ? samples / 4 : 1; /* samples that also see the glass */
    const double size = (double)samples, some = (double)few;
    for (int64_t pixel = 0; pixel < rows * columns; pixel++) {
        const int64_t u = pixel % columns, v = pixel / columns;
        const double (*spot)[2] = (const double (*)[2])(spots + 2 * samples * (4 * (v & 3) + (u & 3)));
        const Ray middle = sightline(camera, (double)u, (double)v);
        const double path = camera->surface / -middle.dz;
        const double at_x = middle.x + path * middle.dx, at_y = middle.y + path * middle.dy;
        double mottle = 1.0, through = 0.0, twice = 0.0, sheen = 0.0;
        for (int64_t k = 0; k < wave_count; k++)
            mottle += waves[k].amplitude * sin(waves[k].kx * at_x + waves[k].ky * at_y + waves[k].phase);
        Print print = {0.0, 0.0};
        for (int64_t k = 0; k < samples; k++) {
            const Ray ray = sightline(camera, (double)u + spot[k][0], (double)v + spot[k][1]);
            const double deep = camera->surface / -ray.dz;
            const Print one = print_at(ruler, ray.x + deep * ray.dx, fabs(ray.y + deep * ray.dy));
            print.paper += one.paper;
            print.ink += one.ink;
            if (k >= few) continue;
            const Glass glass = glass_on(ray, camera->surface - tube->height, tube);
            through += glass.through;
            twice += glass.through * glass.through;
            sheen += glass.sheen;
        }
        const double share_paper = print.paper / size, share_ink = print.ink / size;
        const double bare = (1.0 - share_paper - share_ink) * mottle;
        floors[pixel][0] = (float)at_x;
        floors[pixel][1] = (float)at_y;
        over[pixel] = (float)(through / some);
        shine[pixel] = (float)(sheen / some);
        for (int k = 0; k < 3; k++) {
            const double seen = bare * ground[k] + share_paper * paper[k] + share_ink * ink[k];
            light[3 * pixel + k] = (float)(seen * exp(-oil[k] * path) * twice / some + shine[pixel]);
        }
    }
}
