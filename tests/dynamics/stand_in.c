/* The motion in a tube on a stand-in for a table, see conftest.py: films and two-dimensional laws of a long capsule. */
#include "motion.h"

/* Behind the rest, (8, 8): R and a, m; R_t at h = a and R_x, per length; largest pitch, rad; stations: place, length. */
typedef struct {
    double rest[MOTIONS][MOTIONS], radius, body, sliding, axial, largest, stations[5][2];
} StandIn;

static Table stand_in_opened(const double *packed) {
    static const Film none = {0.0};
    return (Table){.outline = (const double (*)[4])packed, .film = &none};
}

static void cross(const double a[3], const double b[3], double out[3]) {
    for (int i = 0; i < 3; i++) out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

/* Add what one station of the straight side carries; the rows of f are the axes of F at the place. */
static void add_station(const StandIn *s, const double station[2], const double f[3][3], double e,
                        double out[MOTIONS][MOTIONS]) {
    const double x = station[0], k = squared(s->body) / (squared(s->radius) + squared(s->body));
    const double side = x * f[0][1], up = x * f[0][2] - e, offset = larger(hypot(side, up), 1e-9 * s->radius);
    const double h = larger(s->radius - s->body - offset, 1e-9), sliding = s->sliding * sqrt(s->body / h);
    double rows[4][6] = {{0.0}};
    for (int i = 0; i < 3; i++) {
        rows[0][i] = f[i][1] * side / offset + f[i][2] * up / offset;
        rows[1][i] = -f[i][1] * up / offset + f[i][2] * side / offset;
        rows[3][i] = f[i][0];
    }
    for (int row = 0; row < 4; row++) {
        rows[row][4] = -x * rows[row][2];
        rows[row][5] = x * rows[row][1];
    }
    rows[1][3] = -offset * k;
    rows[2][3] = 1.0;
    const double weights[4] = {
        3.0 * sqrt(2.0) * PI * pow(s->body * s->radius / ((s->radius - s->body) * h), 1.5),
        sliding,
        sliding * k * offset * (s->radius - s->body - k * offset),
        s->axial,
    };
    for (int row = 0; row < 4; row++)
        for (int i = 0; i < 6; i++)
            for (int j = 0; j < 6; j++) out[i][j] += station[1] * weights[row] * rows[row][i] * rows[row][j];
}

static void stand_in_place_at(const Table *table, Pose pose, TablePlace *out) {
    const StandIn *s = (const StandIn *)table->outline;
    out->pose = pose;
    out->left = fabs(pose.pitch) > s->largest;
    for (int i = 0; i < 36; i++) out->film[i / 6][i % 6] = 0.0;
}

static void stand_in_slopes_at(const Table *table, const TablePlace *at, TableSlopes *out) {
    (void)table;
    out->of[0][0] = at->pose.offset;
}

static void stand_in_place_near(const Table *table, const TablePlace *at, const TableSlopes *slopes, Pose pose,
                                TablePlace *out) {
    (void)at;
    (void)slopes;
    stand_in_place_at(table, pose, out);
}

static void stand_in_resistance(const Table *table, const TablePlace *place, double phase,
                                double out[MOTIONS][MOTIONS]) {
    const StandIn *s = (const StandIn *)table->outline;
    const double p = place->pose.pitch, psi = place->pose.yaw;
    double f[3][3] = {{cos(p) * cos(psi), cos(p) * sin(psi), sin(p)}, {-sin(psi), cos(psi), 0.0}};
    cross(f[0], f[1], f[2]);
    turn_about_axis(&s->rest[0][0], phase, &out[0][0], MOTIONS);
    for (int n = 0; n < 5; n++) add_station(s, s->stations[n], f, place->pose.offset, out);
}

#define table_opened stand_in_opened
#define table_place_at stand_in_place_at
#define table_slopes_at stand_in_slopes_at
#define table_place_near stand_in_place_near
#define table_resistance stand_in_resistance
#include "tube_motion.inc"

EXPORT void stand_in_at(const double *table, double offset, double *out) {
    const Table opened = stand_in_opened(table);
    TablePlace place;
    stand_in_place_at(&opened, (Pose){offset, 0.0, 0.0}, &place);
    stand_in_resistance(&opened, &place, 0.0, (double (*)[MOTIONS])out);
}
