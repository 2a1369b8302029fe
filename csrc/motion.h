/* A robot whose motion is followed: in its tube, or in unbounded fluid with films at a channel's wall. */
#ifndef SPIRILLUM_MOTION_H
#define SPIRILLUM_MOTION_H

#include "slices.h"
#include "table.h"

/* The channel's wall of a robot without a tube. */
typedef struct {
    double radius, roughness, stiffest, load; /* m (infinite: none); m; largest resistance of a film, N s/m; N */
} Wall;

/* A ring that may near the wall: x on the axis, radius a, half-length b along the axis, m; a film of thickness h resists
 * with c ((H/h)^p - 1). */
typedef struct {
    double x, radius, half;
    double resistance, power, reach; /* c, N s/m; p; H, m */
} Ring;

/* A robot without a tube, opened from `TwoLinks.data` of dynamics/free_robot.py. */
typedef struct {
    const Links *links;
    const double *drag; /* A(0), (7, 7), SI */
    const Wall *wall;
    const Ring *rings;
    int64_t ring_count;
} TwoLinks;

enum { CLOSED, OPEN, IMPOSED }; /* kinds of ends */

/* A tube with its asperities, its dry friction and its fluid. */
typedef struct {
    double radius, roughness, load; /* R, m; s, m; load at half of it, N */
    double coefficient, sliding;    /* mu_c; v_r, m/s */
    double viscosity, ends, length; /* Pa s; one of the kinds; L_eff, m */
    double cavitation;              /* the film's pressure is not below -p_c, Pa; infinite: without a bound */
    double sites, stations;         /* their numbers */
} Tube;

/* What rates at one place of the robot share, and what those nearby begin with; see `tube_robot_rates`. */
typedef struct {
    double place[6]; /* position across the tube, attitude; NaN: none */
    TablePlace table, near_table;
    TableSlopes slopes;
    SlicedFilm sliced, near_sliced;
    Slices crests; /* of the films under crests that were looked for last */
    bool has_slopes;
} PlaceMemory;

/* A robot in its tube, opened from `TubeRobot.data` of dynamics/tube_robot.py. */
typedef struct {
    const Links *links;
    const Tube *tube;
    const Wire *wire;
    const Site *sites;
    const Station *stations;
    const double (*flow)[2]; /* times, s, and imposed mean velocities, m/s */
    int64_t site_count, station_count, flow_count;
    Table table;
    PlaceMemory *memory;
} TubeRobot;

/* How `advance` ended: the time was reached; the steps are used up; something watched has changed its sign in the last
 * step; no step is small enough. */
enum { DONE, PAUSED, CROSSED, STUCK };

/* What a run is watched for, behind the gaps less the roughness: room to the tube's end, charge left, the table's range. */
enum { ROOM, CHARGE_LEFT, WITHIN, WATCHED };

/* Where the tube and the battery end: half the channel, its middle, nose and tip on the motor axis, m; charge, A s. */
typedef struct {
    double channel, middle, nose, tip, most_charge;
} Limits;

/* Between calls: time, length of the next step; time and length of the last step taken; samples answered in a call. */
typedef struct {
    double time, step, last_time, last_step, answered;
} Memory;

TwoLinks two_links_opened(const double *packed, int64_t size);
void two_links_rates(const TwoLinks *robot, const State *y, double time, Seen *seen, State *dy);
double two_links_film(const TwoLinks *robot, const State *y);

TubeRobot tube_robot_opened(const double *packed, int64_t size, const double *table, PlaceMemory *memory);
/* Write what is observed in a state, and its time derivative; `nearby`: to first order in the distance from the last
 * state whose rates were asked for otherwise and are in `seen`. */
void tube_robot_rates(const TubeRobot *robot, const State *y, double time, bool nearby, Seen *seen, State *dy);
void tube_robot_gaps(const TubeRobot *robot, const State *y, double *gaps);

#endif
