/* Resistance of a robot anywhere in its tube, from its table. */
#ifndef SPIRILLUM_TABLE_H
#define SPIRILLUM_TABLE_H

#include "core.h"
#include "film.h"

enum { MOTIONS = 8 };                          /* U and Omega of the body, omega_m of the rotor against it, mean flow */
enum { FACTOR = MOTIONS * (MOTIONS + 1) / 2 }; /* entries of a Cholesky factor */
enum { INSIDE, TOO_FAR_PITCHED, TOO_FAR_YAWED }; /* how a table's range was left */

/* A packed table, opened; see `packed` of spirillum/kernels/tube_table.py. */
typedef struct {
    double radius; /* R of the tube, m */
    int64_t rings, gaps, up, down, phases, yaw_gaps, yaw_pitches;
    const double (*outline)[4];                      /* rings: x, rho, semi-axis along, across, m */
    const double *gap_nodes, *up_nodes, *down_nodes; /* t; f nose up; f nose down */
    const double (*most)[2];                         /* largest pitch nose up, nose down at the nodes t, rad */
    const double *yaw_gap_nodes, *yaw_pitch_nodes;
    const double *yaw_limit; /* of `limited_yaw` */
    const double *outer;     /* (gaps, up + down - 1, phases, FACTOR) */
    const double *yawed;     /* (yaw_gaps, yaw_pitches, YAW_ORDERS, phases, FACTOR) */
    const Film *film;
} Table;

/* Offset of the body's mid-length from the tube's axis, m; pitch nose up, away from the near wall, and yaw, rad. */
typedef struct {
    double offset, pitch, yaw;
} Pose;

Table table_opened(const double *packed);

enum { MOST_PHASES = 99 };

/* What the resistance at a pose is made of, but for the phase: Fourier coefficients of the outer part's factor, (phases,
 * FACTOR), and the share of the film's resistance. */
typedef struct {
    Pose pose;
    int left; /* how the table's range was left */
    double coefficients[MOST_PHASES * FACTOR], film[6][6];
} TablePlace;

/* Derivatives of these coefficients in offset, pitch and yaw. */
typedef struct {
    double of[3][MOST_PHASES * FACTOR];
} TableSlopes;

void table_place_at(const Table *table, Pose pose, TablePlace *out);
void table_slopes_at(const Table *table, const TablePlace *at, TableSlopes *out);
/* The outer part is linear from `at` on, and `left` that of `at`. */
void table_place_near(const Table *table, const TablePlace *at, const TableSlopes *slopes, Pose pose, TablePlace *out);
void table_resistance(const Table *table, const TablePlace *place, double phase, double out[MOTIONS][MOTIONS]);
/* Returns how the table's range was left. */
int table_mean_resistance(const Table *table, Pose pose, int64_t phases, double out[MOTIONS][MOTIONS]);

#endif
