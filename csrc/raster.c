/* Triangles into pixels, and light into bytes: the loops of the virtual camera.
 *
 * A pixel has its centre at whole numbers and reaches half a pixel to every side. Colours are linear light.
 */
#include "core.h"

enum { SAMPLES = 16 };             /* of a pixel */
static const double EMPTY = -1e30; /* height of a sample that has met nothing */

/* Reflection of light by a material (Blinn-Phong), as the Python layer packs it. */
typedef struct {
    double ambient, diffuse, specular, exponent;
} Material;

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* Light that corners of triangles send to a camera far above them (Blinn-Phong).
 *
 * normals: unit normals in the frame of their solid; turn: rotation of the solid; towards: unit vector towards each
 * lamp; halfway: unit vector halfway between lamp and camera; strength: of each lamp; materials: ambient, diffuse and
 * specular reflectance, and exponent of the specular one; kind: index of each triangle's material; diffuse: diffuse
 * light of each corner; specular: specular light of each corner. */
EXPORT void shade(const double (*normals)[3] /* (triangles, 3, 3) */, const double turn[3][3],
                  const double (*towards)[3] /* (lamps, 3) */, const double (*halfway)[3] /* (lamps, 3) */,
                  const double *strength /* (lamps) */, const Material *materials /* (kinds) */,
                  const int64_t *kind /* (triangles) */, double *diffuse /* (triangles, 3) */,
                  double *specular /* (triangles, 3) */, int64_t triangles, int64_t lamps, int64_t kinds) {
    (void)kinds;
    for (int64_t i = 0; i < 3 * triangles; i++) {
        const Material material = materials[kind[i / 3]];
        const double normal[3] = {dot(turn[0], normals[i]), dot(turn[1], normals[i]), dot(turn[2], normals[i])};
        diffuse[i] = material.ambient;
        specular[i] = 0.0;
        for (int64_t k = 0; k < lamps; k++) {
            const double facing = dot(normal, towards[k]), half = dot(normal, halfway[k]);
            if (facing > 0.0) diffuse[i] += material.diffuse * strength[k] * facing;
            if (half > 0.6) specular[i] += material.specular * strength[k] * pow(half, material.exponent);
        }
    }
}

/* The samples of one moment in 4 x 4 neighbouring pixels: their numbers, and places from the pixel's centre. */
typedef struct {
    int count, which[SAMPLES];
    double du[16][SAMPLES], dv[16][SAMPLES];
} Spots;

static Spots spots_of(const double spots[16][2][SAMPLES], int64_t first, int64_t every) {
    Spots found = {.count = 0};
    for (int64_t k = first; k < SAMPLES; k += every) {
        found.which[found.count] = (int)k;
        for (int variant = 0; variant < 16; variant++) {
            found.du[variant][found.count] = spots[variant][0][k];
            found.dv[variant][found.count] = spots[variant][1][k];
        }
        found.count++;
    }
    return found;
}

/* Shares of the corners b and c of a triangle, and its height, as linear functions of the pixel. */
typedef struct {
    double u, v;           /* pixel of the corner a */
    double bu, bv, cu, cv; /* slopes of the shares */
    double z, zb, zc;      /* height of the corner a, and of b and c above it */
} Plane;

/* Colours of a triangle, and the light on its corners. */
typedef struct {
    const double *colour, *gloss, *diffuse, *specular;
} Surface;

/* Colour of a surface at a sample. */
static void colour_at(const Surface *s, double share_b, double share_c, float colour[3]) {
    const double share_a = 1.0 - share_b - share_c;
    const double diffuse = share_a * s->diffuse[0] + share_b * s->diffuse[1] + share_c * s->diffuse[2];
    const double shine = share_a * s->specular[0] + share_b * s->specular[1] + share_c * s->specular[2];
    for (int c = 0; c < 3; c++) colour[c] = (float)(s->colour[c] * diffuse + s->gloss[c] * shine);
}

/* Draw a triangle into the samples of a pixel, given its shares at the pixel's centre. */
static void draw_pixel(const Plane *p, const Surface *surface, double share_b, double share_c, int count,
                       const int *which, const double *du, const double *dv, float *depth, float (*picture)[3]) {
    const double base = p->z + share_b * p->zb + share_c * p->zc;
    const double zu = p->zb * p->bu + p->zc * p->cu, zv = p->zb * p->bv + p->zc * p->cv;
    double heights[SAMPLES];
    for (int k = 0; k < count; k++) { /* no branches: several samples at a time */
        const double sb = share_b + du[k] * p->bu + dv[k] * p->bv, sc = share_c + du[k] * p->cu + dv[k] * p->cv;
        const double height = base + du[k] * zu + dv[k] * zv, inside = smaller(smaller(sb, sc), 1.0 - sb - sc);
        heights[k] = inside >= 0.0 ? height : EMPTY;
    }
    float colour[3] = {-1.0f}; /* one a pixel and triangle, at the first sample that it meets */
    for (int k = 0; k < count; k++) {
        const int at = which[k];
        if (heights[k] <= (double)depth[at]) continue;
        depth[at] = (float)heights[k];
        if (colour[0] < 0.0f) {
            const double sb = share_b + du[k] * p->bu + dv[k] * p->bv, sc = share_c + du[k] * p->cu + dv[k] * p->cv;
            colour_at(surface, sb, sc, colour);
        }
        for (int c = 0; c < 3; c++) picture[at][c] = colour[c];
    }
}

/* A window of the picture. */
typedef struct {
    int64_t left, top, rows, columns;
    float *depth, (*picture)[3];
} Window;

static int64_t whole(double x, int64_t low, int64_t high) { return (int64_t)clamped(x, (double)low, (double)high); }

static void draw_triangle(const Window *w, const Spots *spots, const double *corners[3], const Surface *surface) {
    const double *a = corners[0], *b = corners[1], *c = corners[2];
    const double twice = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
    if (!(twice < 0.0)) return; /* v runs downwards: outward triangles that are seen turn the other way */
    const double inverse = 1.0 / twice;
    const Plane p = {
        .u = a[0],
        .v = a[1],
        .z = a[2],
        .zb = b[2] - a[2],
        .zc = c[2] - a[2],
        .bu = (c[1] - a[1]) * inverse,
        .bv = -(c[0] - a[0]) * inverse,
        .cu = -(b[1] - a[1]) * inverse,
        .cv = (b[0] - a[0]) * inverse,
    };
    /* A pixel in which a share falls short by more than this lies outside. */
    const double spare_b = -0.5 * (fabs(p.bu) + fabs(p.bv)), spare_c = -0.5 * (fabs(p.cu) + fabs(p.cv));
    const double spare_a = 1.0 + 0.5 * (fabs(p.bu + p.cu) + fabs(p.bv + p.cv));
    const int64_t right = w->left + w->columns, bottom = w->top + w->rows;
    const int64_t first_u = whole(ceil(smaller(smaller(a[0], b[0]), c[0]) - 0.5), w->left, right);
    const int64_t last_u = whole(floor(larger(larger(a[0], b[0]), c[0]) + 0.5), w->left - 1, right - 1);
    const int64_t first_v = whole(ceil(smaller(smaller(a[1], b[1]), c[1]) - 0.5), w->top, bottom);
    const int64_t last_v = whole(floor(larger(larger(a[1], b[1]), c[1]) + 0.5), w->top - 1, bottom - 1);
    for (int64_t v = first_v; v <= last_v; v++) {
        for (int64_t u = first_u; u <= last_u; u++) {
            const double share_b = ((double)u - p.u) * p.bu + ((double)v - p.v) * p.bv;
            const double share_c = ((double)u - p.u) * p.cu + ((double)v - p.v) * p.cv;
            if (share_b < spare_b || share_c < spare_c || share_b + share_c > spare_a) continue;
            const int64_t variant = 4 * (v & 3) + (u & 3), at = ((v - w->top) * w->columns + u - w->left) * SAMPLES;
            draw_pixel(&p, surface, share_b, share_c, spots->count, spots->which, spots->du[variant],
                       spots->dv[variant], w->depth + at, w->picture + at);
        }
    }
}

/* Draw triangles that face the camera into samples, the highest in front.
 *
 * seen: pixel u, v and height z of each vertex; faces: vertices of each triangle, outward oriented; colour: linear
 * colour of each triangle's diffuse light; gloss: linear colour of its specular light; diffuse: diffuse light of its
 * corners; specular: specular light of its corners; spots: u and v of the samples in a pixel, -0.5 to 0.5, for 4 x 4
 * neighbouring pixels; first: number of the first sample that is drawn; every: every how many samples one is drawn from
 * there: those of one moment; left: column of the picture's first pixel; top: row of the picture's first pixel; depth:
 * height z of what each sample has met; picture: its colour. */
EXPORT void draw(const double (*seen)[3] /* (vertices, 3) */, const int64_t (*faces)[3] /* (triangles, 3) */,
                 const double (*colour)[3] /* (triangles, 3) */, const double (*gloss)[3] /* (triangles, 3) */,
                 const double (*diffuse)[3] /* (triangles, 3) */, const double (*specular)[3] /* (triangles, 3) */,
                 const double spots[16][2][SAMPLES] /* (16, 2, 16) */, int64_t first, int64_t every, int64_t left,
                 int64_t top, float *depth /* (rows, columns, 16) */, float (*picture)[3] /* (rows, columns, 16, 3) */,
                 int64_t vertices, int64_t triangles, int64_t rows, int64_t columns) {
    (void)vertices;
    const Window window = {left, top, rows, columns, depth, picture};
    const Spots chosen = spots_of(spots, first, every);
    for (int64_t i = 0; i < triangles; i++) {
        const double *corners[3] = {seen[faces[i][0]], seen[faces[i][1]], seen[faces[i][2]]};
        const Surface surface = {colour[i], gloss[i], diffuse[i], specular[i]};
        draw_triangle(&window, &chosen, corners, &surface);
    }
}

/* A soft shadow on the floor, a rounded bar, as the Python layer packs it; m. */
typedef struct {
    double x, y, axis_x, axis_y; /* its centre; unit vector along it */
    double half_length, radius;  /* without the rounded ends; of these */
    double softness, darkness;   /* width of its edge; relative loss of light */
} Shadow;

/* Share of the light that reaches a place on the floor. */
static double lit(const Shadow *s, double x, double y) {
    const double along = fabs(x * s->axis_x + y * s->axis_y), across = y * s->axis_x - x * s->axis_y;
    const double far = hypot(larger(along - s->half_length, 0.0), across) - s->radius;
    return 1.0 - s->darkness / (1.0 + exp(smaller(far / s->softness, 50.0)));
}

/* Composite the samples of an exposure and the robot's shadow with the still parts, and clear the samples.
 *
 * depth: height of what each sample has met; cleared; samples: colours of the samples; left: column of the whole
 * picture at which the samples begin; top: row at which they begin; over: transmission of the glass between robot and
 * camera; shine: light mirrored by the glass; floors: x and y of the floor behind each pixel, m; shadow: of the robot
 * on the floor, a rounded bar: its centre, unit vector along it, half length without the rounded ends, radius, width of
 * its edge, m, and relative loss of light; tint: transmission of red, green and blue by the oil; picture: light of the
 * still parts; changed. */
EXPORT void blend(float *depth /* (rows, columns, 16) */, const float (*samples)[3] /* (rows, columns, 16, 3) */,
                  int64_t left, int64_t top, const float *over /* (whole_rows, whole_columns) */,
                  const float *shine /* (whole_rows, whole_columns) */,
                  const float (*floors)[2] /* (whole_rows, whole_columns, 2) */, const Shadow *shadow,
                  const double tint[3], float (*picture)[3] /* (whole_rows, whole_columns, 3) */, int64_t rows,
                  int64_t columns, int64_t whole_rows, int64_t whole_columns) {
    (void)whole_rows;
    for (int64_t cell = 0; cell < rows * columns; cell++) {
        const int64_t pixel = (top + cell / columns) * whole_columns + left + cell % columns;
        double sum[3] = {0.0};
        int hits = 0;
        for (int64_t k = cell * SAMPLES; k < (cell + 1) * SAMPLES; k++) {
            if (!(depth[k] > (float)EMPTY)) continue;
            hits++;
            for (int c = 0; c < 3; c++) sum[c] += (double)samples[k][c];
            depth[k] = (float)EMPTY;
        }
        double bare = 1.0 - (double)hits / SAMPLES;
        if (bare > 0.0) bare *= lit(shadow, (double)floors[pixel][0] - shadow->x, (double)floors[pixel][1] - shadow->y);
        const double through = (double)over[pixel] / SAMPLES, mirrored = (double)shine[pixel] * hits / SAMPLES;
        for (int c = 0; c < 3; c++)
            picture[pixel][c] = (float)(bare * (double)picture[pixel][c] + through * tint[c] * sum[c] + mirrored);
    }
}

/* Bytes of a picture from its light: vignetting, lamp, gamma curve, noise.
 *
 * light: linear light; lens: transmission of the lens; gain: brightness of the lamp; curve: bytes over linear light
 * from 0 to 1 in equal steps; grain: a pool of standard normal noise; starts: start of each row in it; sigma: standard
 * deviation of the noise, bytes; image: the picture. */
EXPORT void develop(const float *light /* (rows, columns, 3) */, const double *lens /* (rows, columns) */,
                    const double gain[3], const double *curve /* (steps) */, const float *grain /* (grains) */,
                    const int64_t *starts /* (rows) */, double sigma, uint8_t *restrict image /* (rows, columns, 3) */,
                    int64_t rows, int64_t columns, int64_t steps, int64_t grains) {
    const double last = (double)steps - 1.0;
    for (int64_t v = 0; v < rows; v++) {
        int64_t at = starts[v];
        for (int64_t pixel = v * columns; pixel < (v + 1) * columns; pixel++) {
            for (int64_t i = 3 * pixel, c = 0; c < 3; i++, c++) {
                const double place = (double)light[i] * lens[pixel] * gain[c] * last + 0.5;
                double value = curve[(int64_t)smaller(larger(0.0, place), last)] + 0.5;
                if (sigma > 0.0) {
                    value = clamped(value + sigma * (double)grain[at], 0.0, 255.0);
                    if (++at == grains) at = 0;
                }
                image[i] = (uint8_t)value;
            }
        }
    }
}
