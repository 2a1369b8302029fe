/* Columns of the arrays that Python packs and reads, by the names of their constants in spirillum/kernels: a test
 * compares them. A row with -1 names the module of those behind it. */
#include <stddef.h>

#include "motion.h"

#define AT(name, type, field) {#name, offsetof(type, field) / sizeof(double)}
#define SIZE(name, type) {#name, sizeof(type) / sizeof(double)}
#define VALUE(name, value) {#name, value}

static const struct {
    const char *name;
    int64_t value;
} COLUMNS[] = {
    {"rigid_links", -1},
    AT(POSITION, State, position), AT(ATTITUDE, State, attitude), AT(PHASE, State, phase), AT(ROLL, State, roll),
    AT(CURRENT, State, current), AT(ELECTRICAL, State, electrical), AT(RESISTIVE, State, resistive),
    AT(CONVERSION, State, conversion), AT(CHARGE, State, charge), AT(DRIVEN, State, driven),
    AT(FRICTION, State, friction), AT(DISSIPATED, State, dissipated), AT(CONTACT, State, contact),
    AT(FLOW, State, flow), SIZE(STATES, State),
    AT(VELOCITY, Seen, rates[0]), AT(ROTATION, Seen, rates[SPIN]), AT(JOINT, Seen, rates[JOINT]),
    AT(DRIVE_TORQUE, Seen, drive_torque), AT(FILM, Seen, film), AT(FRICTION_POWER, Seen, friction_power),
    AT(DISSIPATED_POWER, Seen, dissipated_power), AT(DRIVE_POWER, Seen, drive_power), AT(PRESSED, Seen, pressed),
    AT(OBSERVED, Seen, contact_force), AT(TAIL_GAP, Seen, tail_gap), AT(OUTSIDE, Seen, outside), SIZE(SEEN, Seen),
    AT(KIND, Drive, kind), AT(FIXED, Drive, fixed), AT(DUTY, Drive, duty), AT(GIVEN, Drive, given),
    AT(MOMENT, Drive, moment), AT(FIELD, Drive, field), AT(FIELD_RATE, Drive, field_rate),
    AT(POLARITY, Drive, polarity), AT(TORQUE_CONSTANT, Drive, torque_constant), AT(BACK_EMF, Drive, back_emf),
    AT(INDUCTANCE, Drive, inductance), AT(CONSTANT, Drive, constant), AT(DECAY, Drive, decay),
    AT(DECAY_RATE, Drive, decay_rate), AT(GROWTH, Drive, growth), AT(GROWTH_RATE, Drive, growth_rate),
    AT(SLOPE, Drive, slope), AT(VOLTAGE, Drive, voltage), AT(INTERNAL_RESISTANCE, Drive, internal_resistance),
    AT(AXIS_Y, Drive, axis_y), AT(AXIS_Z, Drive, axis_z), AT(FIELD_PHASE, Drive, field_phase), SIZE(DRIVE, Drive),
    AT(WEIGHT_BODY, Weight, body), AT(WEIGHT_ROTOR, Weight, rotor), AT(MOMENT_BODY, Weight, moment_body),
    AT(MOMENT_ROTOR, Weight, moment_rotor), SIZE(WEIGHT, Weight),
    VALUE(MOTOR, MOTOR), VALUE(TORQUE, TORQUE), VALUE(RATE, RATE), VALUE(MAGNETIC, MAGNETIC),
    {"contacts", -1},
    AT(SITE_X, Site, x), AT(SITE_RING, Site, ring), AT(SITE_HALF, Site, half), AT(SITE_BALL, Site, ball),
    AT(SITE_ROTOR, Site, rotor), SIZE(SITE, Site),
    AT(WIRE_RADIUS, Wire, radius), AT(AMPLITUDE, Wire, amplitude), AT(TAPER, Wire, taper), AT(HAND_K, Wire, hand_k),
    AT(ROOT, Wire, root), AT(LENGTH, Wire, length), SIZE(WIRE, Wire),
    AT(STATION_XI, Station, xi), AT(STATION_X, Station, x), AT(STATION_Y, Station, y), AT(STATION_Z, Station, z),
    SIZE(STATION, Station),
    {"two_links", -1},
    AT(RADIUS, Wall, radius), AT(ROUGHNESS, Wall, roughness), AT(STIFFEST, Wall, stiffest), AT(LOAD, Wall, load),
    SIZE(WALL, Wall),
    AT(RING_X, Ring, x), AT(RING_RADIUS, Ring, radius), AT(RING_REACH, Ring, half),
    AT(FILM_RESISTANCE, Ring, resistance), AT(FILM_POWER, Ring, power), AT(FILM_REACH, Ring, reach), SIZE(RING, Ring),
    {"tube_motion", -1},
    AT(CONTACT_FORCE, Seen, contact_force), AT(CONTACT_FRICTION, Seen, contact_friction),
    AT(CONTACT_POWER, Seen, contact_power), AT(FLOW_POWER, Seen, flow_power), AT(MEAN_FLOW, Seen, mean_flow),
    AT(OFFSET, Seen, offset), AT(AZIMUTH, Seen, azimuth), AT(WALL_PITCH, Seen, pitch), AT(WALL_YAW, Seen, yaw),
    AT(TURN, Seen, turn), AT(BALANCE, Seen, balance), AT(WEIGHT_LOAD, Seen, weight_load),
    AT(FILM_LOAD, Seen, film_load), AT(OUTER_LOAD, Seen, outer_load), AT(CONTACT_LOAD, Seen, contact_load),
    AT(LIFT, Seen, lift),
    AT(RADIUS, Tube, radius), AT(ROUGHNESS, Tube, roughness), AT(LOAD, Tube, load), AT(COEFFICIENT, Tube, coefficient),
    AT(SLIDING, Tube, sliding), AT(VISCOSITY, Tube, viscosity), AT(ENDS, Tube, ends), AT(LENGTH, Tube, length),
    AT(CAVITATION, Tube, cavitation), AT(SITES, Tube, sites), AT(STATIONS, Tube, stations), SIZE(TUBE, Tube),
    VALUE(CLOSED, CLOSED), VALUE(OPEN, OPEN), VALUE(IMPOSED, IMPOSED),
    {"stiff_steps", -1},
    AT(CHANNEL, Limits, channel), AT(MIDDLE, Limits, middle), AT(NOSE, Limits, nose), AT(TIP, Limits, tip),
    AT(MOST_CHARGE, Limits, most_charge), SIZE(LIMITS, Limits),
    AT(TIME, Memory, time), AT(STEP, Memory, step), AT(LAST_TIME, Memory, last_time), AT(LAST_STEP, Memory, last_step),
    AT(ANSWERED, Memory, answered), SIZE(MEMORY, Memory),
    VALUE(DONE, DONE), VALUE(PAUSED, PAUSED), VALUE(CROSSED, CROSSED), VALUE(STUCK, STUCK), VALUE(ROOM, ROOM),
    VALUE(CHARGE_LEFT, CHARGE_LEFT), VALUE(INSIDE, WITHIN), VALUE(WATCHED, WATCHED),
};

EXPORT int64_t columns_count(void) { return sizeof COLUMNS / sizeof *COLUMNS; }
EXPORT const char *column_name(int64_t n) { return COLUMNS[n].name; }
EXPORT int64_t column_value(int64_t n) { return COLUMNS[n].value; }
