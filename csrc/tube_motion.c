/* The motion of two rigid links in a tube: film, walls, contact and dry friction.
 *
 * Unknowns are the seven rates q = (U, Omega_b, omega_m) in body axes about the origin. Forces balance without inertia:
 *
 *     (mu M + B) q + sum_c mu_c N_c J_c' J_c q/sqrt(q' J_c' J_c q + v_r^2) = weight + field + tau d + flow - N n + L(q),
 *
 * where L is the lift of films that cavitate, over the rates; see slices.c, contacts.c and cavitation.c.
 * M, (7, 7), is the table's at the robot's place, with the mean flow of open ends eliminated; B friction in the joint;
 * N_c the load that asperities carry at contact c along n_c, J_c q its sliding velocity (2,), mu_c the coefficient of
 * dry friction, made smooth below the sliding speed v_r. See contacts.c and dry_friction.c.
 *
 * The place: offset e of the origin from the tube's axis, azimuth A about +x from the lowest place, pitch p away from
 * the wall and yaw psi against the local axes (X along the tube, z_loc towards its axis, y_loc = z_loc x X), and the
 * phase of the tail in the roll-free axes F of the body.
 */
#include "motion.h"

TubeRobot tube_robot_opened(const double *packed, int64_t size, const double *table, PlaceMemory *memory) {
    const Tube *tube = (const Tube *)(packed + sizeof(Links) / sizeof(double));
    const Wire *wire = (const Wire *)(tube + 1);
    const Site *sites = (const Site *)(wire + 1);
    const Station *stations = (const Station *)(sites + (int64_t)tube->sites);
    const double *flow = (const double *)(stations + (int64_t)tube->stations);
    memory->place[0] = NAN;
    forget_cavities(&memory->sliced.slices);
    forget_cavities(&memory->crests);
    return (TubeRobot){
        .links = (const Links *)packed,
        .tube = tube,
        .wire = wire,
        .sites = sites,
        .stations = stations,
        .flow = (const double (*)[2])flow,
        .site_count = (int64_t)tube->sites,
        .station_count = (int64_t)tube->stations,
        .flow_count = (packed + size - flow) / 2,
        .table = table_opened(table),
        .memory = memory,
    };
}

/* Note offset, azimuth, pitch, yaw and roll of the body against F; on the axis the azimuth is 0. */
static void note_place(const State *y, const double rotation[3][3], double radius, Seen *seen) {
    const double side = y->position[1], up = y->position[2], e = hypot(side, up);
    double z_y = 0.0, z_z = 1.0;
    if (e > 1e-9 * radius) {
        z_y = -side / e;
        z_z = -up / e;
    }
    const double y_y = z_z, y_z = -z_y; /* y_loc = z_loc x X */
    const double d_y = rotation[1][0], d_z = rotation[2][0];
    seen->offset = e;
    seen->azimuth = atan2(-z_y, z_z);
    seen->pitch = asin(clamped(d_y * z_y + d_z * z_z, -1.0, 1.0));
    seen->yaw = atan2(d_y * y_y + d_z * y_z, rotation[0][0]);
    /* y' of F is across the axis and along the plane of X and y_loc; z' = d x y'. */
    const double f[3] = {-sin(seen->yaw), cos(seen->yaw) * y_y, cos(seen->yaw) * y_z};
    const double along = rotation[0][1] * f[0] + rotation[1][1] * f[1] + rotation[2][1] * f[2];
    const double across = rotation[0][2] * f[0] + rotation[1][2] * f[1] + rotation[2][2] * f[2]; /* = -e_2.z' */
    seen->turn = atan2(-across, along);
}

/* Imposed mean velocity, m/s: straight between its times, constant beyond. */
static double imposed_flow(const TubeRobot *robot, double time) {
    const double (*flow)[2] = robot->flow;
    int64_t before = 0, after = robot->flow_count - 1;
    if (time >= flow[after][0]) return flow[after][1];
    if (time <= flow[0][0]) return flow[0][1];
    while (after - before > 1) {
        const int64_t middle = (before + after) / 2;
        *(flow[middle][0] < time ? &before : &after) = middle;
    }
    const double share = (time - flow[before][0]) / (flow[after][0] - flow[before][0]);
    return flow[before][1] + share * (flow[after][1] - flow[before][1]);
}

/* The fluid about the robot, in body axes. */
typedef struct {
    double matrix[RATES][RATES]; /* against q, SI */
    double film[6][6];           /* of it, the film's, against U and Omega_b */
    double crests[RATES][RATES]; /* of it, that of the films under the wire's crests */
    double stream[RATES];        /* force of an imposed flow */
    double opened[RATES];        /* mean flow of open ends per q */
} Fluid;

static const double FOLLOWED = 20.0 * PI / 180.0; /* tilt up to which a run goes on outside the table's range */

/* Table and slices at the pose, as far as they are known. */
typedef struct {
    TablePlace *table;
    SlicedFilm *sliced;
} Place;

/* What is known of the place of a state, or of one near the last. */
static Place find_place(const TubeRobot *robot, const State *y, const Seen *seen, bool nearby) {
    PlaceMemory *memory = robot->memory;
    const double *q = y->attitude, place[6] = {y->position[1], y->position[2], q[0], q[1], q[2], q[3]};
    const Pose pose = {seen->offset, seen->pitch, seen->yaw};
    bool same = true;
    for (int i = 0; i < 6; i++) same = same && place[i] == memory->place[i];
    if (!same && nearby) {
        if (!memory->has_slopes) table_slopes_at(&robot->table, &memory->table, &memory->slopes);
        memory->has_slopes = true;
        table_place_near(&robot->table, &memory->table, &memory->slopes, pose, &memory->near_table);
        begin_slices(&memory->near_sliced, &memory->sliced);
        return (Place){&memory->near_table, &memory->near_sliced};
    }
    if (!same) {
        for (int i = 0; i < 6; i++) memory->place[i] = place[i];
        table_place_at(&robot->table, pose, &memory->table);
        begin_slices(&memory->sliced, &memory->sliced);
        memory->has_slopes = false;
    }
    return (Place){&memory->table, &memory->sliced};
}

static void set_fluid(const TubeRobot *robot, const Place *place, double phase, double time, Seen *seen, Fluid *fluid) {
    const Tube *tube = robot->tube;
    const Pose pose = {seen->offset, seen->pitch, seen->yaw};
    double free_of_roll[MOTIONS][MOTIONS], m[MOTIONS][MOTIONS];
    seen->outside = place->table->left;
    table_resistance(&robot->table, place->table, seen->turn + phase, free_of_roll);
    if (fabs(pose.pitch) < FOLLOWED && fabs(pose.yaw) < FOLLOWED) seen->outside = 0.0;
    turn_about_axis(&free_of_roll[0][0], -seen->turn, &m[0][0], MOTIONS);
    turn_about_axis(&place->table->film[0][0], -seen->turn, &fluid->film[0][0], 6);
    const double opened = tube->ends == OPEN ? 1.0 / (8.0 * PI * tube->length + m[7][7]) : 0.0;
    seen->mean_flow = tube->ends == IMPOSED ? imposed_flow(robot, time) : 0.0;
    for (int i = 0; i < RATES; i++) {
        fluid->opened[i] = opened * m[i][7];
        fluid->stream[i] = tube->viscosity * m[i][7] * seen->mean_flow;
        for (int j = 0; j < RATES; j++) {
            fluid->matrix[i][j] = tube->viscosity * (m[i][j] - opened * m[i][7] * m[j][7]);
            fluid->crests[i][j] = 0.0;
        }
    }
}

/* Contacts of a state, and the gaps on the way to them. */
typedef struct {
    const TubeRobot *robot;
    const State *y;
    double rotation[3][3];
    Balance *balance; /* forces and contacts that are added to */
    Seen *seen;
    SlicedFilm *sliced;
    double (*resistance)[RATES]; /* of the films under crests, added to, or NULL */
    int crest_count;
    double *gaps; /* of the sites, and last of the wire (infinite far from the wall), or NULL, m */
} Touch;

/* Add one contact to the balance, and its push to the force. */
static void add_contact(Touch *t, const Nearest *at, double rotor) {
    const Tube *tube = t->robot->tube;
    if (!(at->gap < tube->roughness) || t->balance->count >= MOST_CONTACTS) return;
    const double load = asperity_load(at->gap, tube->roughness, tube->load);
    t->seen->pressed += asperity_energy(at->gap, tube->roughness, tube->load);
    t->seen->contact_force += load;
    for (int i = 0; i < RATES; i++) t->balance->force[i] -= load * at->j[i];
    Contact *contact = t->balance->contacts + t->balance->count++;
    contact->load = tube->coefficient * load;
    sliding_rows(at, t->rotation, rotor, contact->rows);
}

/* Squared distance of a station of the wire from the tube's axis, m^2; cosine and sine of the phase. */
static double station_square(const Touch *t, const Station *station, double c, double s) {
    const double *p = station->point, at[3] = {p[0], c * p[1] - s * p[2], s * p[1] + c * p[2]};
    double d[2];
    for (int n = 0; n < 2; n++) {
        const double *row = t->rotation[n + 1];
        d[n] = t->y->position[n + 1] + row[0] * at[0] + row[1] * at[1] + row[2] * at[2];
    }
    return d[0] * d[0] + d[1] * d[1];
}

/* Add the film under a crest of the wire that was found near a station. */
static void add_crest(Touch *t, const Nearest *nearest, const Station *first, const Station *at, const Station *end) {
    const TubeRobot *robot = t->robot;
    if (!t->resistance || t->crest_count * LANES >= MOST_SLICES) return;
    const Station *last = at;
    while (last < end && last[1].turn == at->turn) last++;
    const Crest crest = {robot->wire,
                         at,
                         first,
                         last,
                         t->y,
                         t->rotation,
                         robot->tube->radius,
                         robot->tube->viscosity,
                         robot->tube->cavitation};
    Slices *slices = &robot->memory->crests;
    if (t->crest_count == 0) clear_slices(slices);
    t->crest_count += add_crest_film(&crest, nearest, slices, t->crest_count * LANES, t->resistance);
}

/* Look for contacts of the wires, one after the other, where their stations are farthest from the axis. */
static void touch_wire(Touch *t) {
    const TubeRobot *robot = t->robot;
    const Tube *tube = robot->tube;
    const int64_t last = robot->station_count - 1;
    const double height = larger(tube->roughness, CREST_REACH * robot->wire->radius);
    if (last < 0 || !tail_reaches(robot->wire, t->y, t->rotation, tube->radius, height)) return;
    const double c = cos(t->y->phase), s = sin(t->y->phase);
    double before = 0.0, here = station_square(t, robot->stations, c, s);
    bool first = true;
    const Station *root = robot->stations;
    for (int64_t k = 0; k <= last; k++) {
        const Station *at = robot->stations + k;
        if (first) root = at;
        const double next = k < last ? station_square(t, at + 1, c, s) : 0.0;
        const bool tip = k == last || at[1].turn != at->turn;
        if (here >= before && here > (tip ? 0.0 : next) && t->balance->count < MOST_CONTACTS) {
            const double bracket[3] = {at[first ? 0 : -1].xi, at->xi, at[tip ? 0 : 1].xi};
            const Station *about = at - (first ? 0 : 1);
            const Nearest nearest = wire_nearest(robot->wire, about, t->y, t->rotation, tube->radius, bracket);
            t->seen->tail_gap = smaller(t->seen->tail_gap, nearest.gap);
            add_contact(t, &nearest, 1.0);
            add_crest(t, &nearest, root, at, robot->stations + last);
        }
        first = tip;
        before = tip ? 0.0 : here;
        here = next;
    }
}

/* Look for all contacts. */
static void touch(Touch *t) {
    const TubeRobot *robot = t->robot;
    t->seen->film = t->seen->tail_gap = INFINITY;
    t->seen->pressed = t->seen->contact_force = 0.0;
    for (int64_t n = 0; n < robot->site_count; n++) {
        const Site *site = robot->sites + n;
        const Nearest nearest = site_nearest(site, t->y, t->rotation, robot->tube->radius);
        if (site->rotor == 0.0) t->seen->film = smaller(t->seen->film, nearest.gap);
        if (t->gaps) t->gaps[n] = nearest.gap;
        add_contact(t, &nearest, site->rotor);
    }
    touch_wire(t);
    if (t->gaps) t->gaps[robot->site_count] = t->seen->tail_gap;
}

/* Rates in balance; what is left of it. */
static double balance(const Touch *t, const double film[6][6], double q[RATES], double left[RATES]) {
    const FilmPlace place = {t->robot->table.film, t->y, t->rotation, film, t->seen->film, t->robot->tube->viscosity};
    return balance_film(&place, t->sliced, t->balance, q, left);
}

/* The same under a curve: a straight piece of it is a friction of the joint, and the next one is tried where it ends. */
static double solve_on_curve(const Touch *t, const double film[6][6]) {
    const Drive *drive = &t->robot->links->drive;
    Balance *b = t->balance;
    Seen *seen = t->seen;
    const double sense = drive->motor.polarity, own = b->a[JOINT][JOINT], force = b->force[JOINT];
    double *q = seen->rates, left[RATES];
    int64_t number = -1;
    for (int n = 0; n < MOST_POINTS; n++) number = next_piece(&drive->curve, number, sense * q[JOINT]);
    Piece piece = {0.0, 0.0};
    for (int64_t before = -2, n = 0; number != before && n < MOST_TRIALS; n++) {
        piece = piece_of(&drive->curve, before = number, drive->duty);
        b->a[JOINT][JOINT] = own - piece.slope;
        b->force[JOINT] = force + sense * piece.torque;
        seen->balance = balance(t, film, q, left);
        number = next_piece(&drive->curve, before, sense * q[JOINT]);
    }
    return sense * piece.torque + piece.slope * q[JOINT];
}

/* Rates at which forces and drive are in balance; the drive's torque, N m. Those of the last state are the first guess:
 * a trial inside the wall has none, and the next one must not begin with them. */
static double solve_rates(const Touch *t, const double film[6][6]) {
    const Drive *drive = &t->robot->links->drive;
    Balance *b = t->balance;
    Seen *seen = t->seen;
    double *q = seen->rates, left[RATES];
    bool finite = true;
    for (int i = 0; i < RATES; i++) finite = finite && isfinite(q[i]);
    for (int i = 0; i < RATES && !finite; i++) q[i] = 0.0;
    b->along = driven_rate(drive);
    b->prescribed = drive->kind == RATE && drive->duty > 0.0;
    if (drive->kind == CURVE) return solve_on_curve(t, film);
    const double torque = b->prescribed ? 0.0 : drive_torque(drive, t->y->current, q, q);
    b->force[b->along] += torque;
    if (drive->fixed != 0.0) {
        b->force[JOINT] = q[JOINT] = 0.0;
        for (int64_t n = 0; n < b->count; n++) b->contacts[n].rows[0][JOINT] = b->contacts[n].rows[1][JOINT] = 0.0;
    }
    if (b->prescribed) q[b->along] += drive->given - q[SPIN] - q[JOINT];
    seen->balance = balance(t, film, q, left);
    return b->prescribed ? left[b->along] : torque;
}

/* Note force and power of dry friction, sums over contacts. */
static void note_sliding(const Balance *b, Seen *seen) {
    seen->contact_friction = seen->contact_power = 0.0;
    for (int64_t n = 0; n < b->count; n++) {
        const Sliding s = sliding_at(b->contacts + n, seen->rates, b->slow);
        seen->contact_friction += s.drag * hypot(s.u, s.v);
        seen->contact_power += s.drag * (s.u * s.u + s.v * s.v);
    }
}

/* Component of a force in body axes towards the wall at the body's mid-length. */
static double towards_wall(const double force[3], const double rotation[3][3], double azimuth) {
    double found = 0.0;
    for (int i = 0; i < 3; i++) found += force[i] * (sin(azimuth) * rotation[1][i] - cos(azimuth) * rotation[2][i]);
    return found;
}

/* Note the forces towards the wall, which sum to zero, and take from the fluid's power what the film's bound saves. */
static void note_loads(const Balance *b, double mu, const Fluid *fluid, const double weight[RATES],
                       const double asperities[RATES], const double rotation[3][3], Seen *seen) {
    const double *q = seen->rates;
    double film[3], outer[3], contact[3], lift[3] = {0.0};
    for (int i = 0; i < 3; i++) {
        film[i] = 0.0;
        outer[i] = fluid->stream[i];
        contact[i] = asperities[i];
        for (int j = 0; j < 6; j++) film[i] -= mu * fluid->film[i][j] * q[j];
        for (int j = 0; j < RATES; j++) {
            film[i] -= fluid->crests[i][j] * q[j];
            outer[i] -= fluid->matrix[i][j] * q[j];
        }
        outer[i] -= film[i];
    }
    for (int64_t n = 0; n < b->count; n++) {
        const Sliding s = sliding_at(b->contacts + n, q, b->slow);
        for (int i = 0; i < 3; i++)
            contact[i] -= s.drag * (b->contacts[n].rows[0][i] * s.u + b->contacts[n].rows[1][i] * s.v);
    }
    for (int k = 0; k < FILMS; k++) {
        const Slices *slices = b->slices[k];
        for (int n = 0; slices && n < MOST_SLICES; n++) {
            for (int i = 0; i < RATES && slices->lift[n].normal != 0.0; i++) {
                const double force = slice_force(slices, n, i);
                if (i < 3) lift[i] += force;
                seen->dissipated_power -= force * q[i];
            }
        }
    }
    seen->weight_load = towards_wall(weight, rotation, seen->azimuth);
    seen->outer_load = towards_wall(outer, rotation, seen->azimuth);
    seen->contact_load = towards_wall(contact, rotation, seen->azimuth);
    seen->lift = -towards_wall(lift, rotation, seen->azimuth);
    seen->film_load = towards_wall(film, rotation, seen->azimuth) - seen->lift;
}

void tube_robot_rates(const TubeRobot *robot, const State *y, double time, bool nearby, Seen *seen, State *dy) {
    const Links *links = robot->links;
    Balance balance = {.count = 0, .slow = robot->tube->sliding, .bound = robot->tube->cavitation, .once = nearby};
    Fluid fluid;
    Touch t = {.robot = robot, .y = y, .balance = &balance, .seen = seen, .resistance = fluid.crests};
    double field[RATES], weight[RATES], asperities[RATES];
    axes_of(y, t.rotation);
    note_place(y, t.rotation, robot->tube->radius, seen);
    const Place place = find_place(robot, y, seen, nearby);
    t.sliced = place.sliced;
    set_fluid(robot, &place, y->phase, time, seen, &fluid);
    weight_loads(&links->weight, y->phase, t.rotation, weight);
    for (int i = 0; i < RATES; i++) balance.force[i] = 0.0;
    touch(&t);
    for (int i = 0; i < RATES; i++) {
        asperities[i] = balance.force[i];
        for (int j = 0; j < RATES; j++) fluid.matrix[i][j] += fluid.crests[i][j];
    }
    if (t.crest_count > 0 && isfinite(balance.bound)) balance.slices[CREST_FILMS] = &robot->memory->crests;
    field_loads(&links->drive, time, t.rotation, field);
    assemble(fluid.matrix, links, balance.a);
    for (int i = 0; i < RATES; i++) balance.force[i] += weight[i] + field[i] + fluid.stream[i];
    seen->drive_torque = solve_rates(&t, fluid.film);
    note_powers(fluid.matrix, links, field, seen);
    seen->flow_power = 0.0;
    for (int i = 0; i < RATES; i++) {
        seen->mean_flow += fluid.opened[i] * seen->rates[i];
        seen->flow_power += fluid.stream[i] * seen->rates[i];
    }
    note_sliding(&balance, seen);
    note_loads(&balance, robot->tube->viscosity, &fluid, weight, asperities, t.rotation, seen);
    differentiate(y, &links->drive, t.rotation, seen, dy);
}

/* Gap at every site, and last the smallest of the wire (infinite far from the wall), m. */
void tube_robot_gaps(const TubeRobot *robot, const State *y, double *gaps) {
    Balance balance = {.count = 0};
    Seen seen = {.film = INFINITY};
    Touch t = {.robot = robot, .y = y, .balance = &balance, .seen = &seen, .gaps = gaps};
    axes_of(y, t.rotation);
    touch(&t);
}
