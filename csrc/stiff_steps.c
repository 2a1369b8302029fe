/* Steps in time of a free robot by Rodas5P, a linearly implicit method for stiff equations.
 *
 * Eight stages, order 5 (continuous output and embedded error: 4), stiffly accurate and L-stable: G. Steinebach, BIT
 * Numer. Math. 63:27, 2023. In the form without products of the Jacobian, with W = 1/(gamma dt) - J:
 *
 *     W u_i = f(t + c_i dt, y + sum_j a_ij u_j) + sum_j (C_ij/dt) u_j + d_i dt f_t,   y_1 = y + sum_j a_8j u_j + u_8
 *
 * The last three stages repeat the row of the sixth: each adds the stage before it. The error estimate is u_8.
 *
 * Only place across the tube, attitude, tail phase and current act back on the rates: their columns of the Jacobian, by
 * finite differences, are all it has; flow and field change with time besides. A step needs no iteration and no memory
 * but its length, so that a run is continued exactly from the beginning of its last step.
 */
#include <stddef.h>

#include "stiff_steps.h"

static const double GAMMA = 0.21193756319429014;
/* a_ij */
#define SIXTH -7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946
static const double WEIGHTS[STAGES][STAGES] = {
    {0.0},
    {3.0},
    {2.849394379747939, 0.45842242204463923},
    {-6.954028509809101, 2.489845061869568, -10.358996098473584},
    {2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641},
    {SIXTH},
    {SIXTH, 1.0},
    {SIXTH, 1.0, 1.0},
};
/* C_ij */
static const double COEFFICIENTS[STAGES][STAGES] = {
    {0.0},
    {-14.155112264123755},
    {-17.97296035885952, -2.859693295451294},
    {147.12150275711716, -1.41221402718213, 71.68940251302358},
    {165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306},
    {24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471},
    {30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783, -19.097331116725623,
     -28.087943162872662},
    {37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047, -40.06618937091002,
     -54.66780262877968, -9.48861652309627},
};
/* c_i and d_i */
static const double NODES[STAGES]
    = {0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1.0, 1.0, 1.0};
static const double TIMES[STAGES] = {0.21193756319429014,
                                     -0.42387512638858027,
                                     -0.3384627126235924,
                                     1.8046452872882734,
                                     2.325825639765069,
                                     0.0,
                                     0.0,
                                     0.0};
/* Continuous output (1 - s) y_0 + s (y_1 + (1 - s) (k_1 + s (k_2 + s k_3))), k = DENSE u, s from 0 to 1 over a step. */
static const double DENSE[3][STAGES] = {
    {25.948786856663858, -2.5579724845846235, 10.433815404888879, -2.3679251022685204, 0.524948541321073,
     1.1241088310450404, 0.4272876194431874, -0.17202221070155493},
    {-9.91568850695171, -0.9689944594115154, 3.0438037242978453, -24.495224566215796, 20.176138334709044,
     15.98066361424651, -6.789040303419874, -6.710236069923372},
    {11.419903575922262, 2.8879645146136994, 72.92137995996029, 80.12511834622643, -52.072871366152654,
     -59.78993625266729, -0.15582684282751913, 4.883087185713722},
};

#define COLUMN(field) ((int)(offsetof(State, field) / sizeof(double)))
static const int ACTS[ACTING] = {
    COLUMN(position[1]), COLUMN(position[2]), COLUMN(attitude[0]), COLUMN(attitude[1]),
    COLUMN(attitude[2]), COLUMN(attitude[3]), COLUMN(phase),       COLUMN(current),
};
static const double WIDER = 30.0;     /* steps of central differences over those of differences to one side */
static const double SMALLEST = 1e-12; /* step over the time that it would be without */

/* Sizes of the state's components below which nothing matters; a small change of time, s (0: nothing depends on it); a
 * time of the order of the run's, s. */
typedef struct {
    double state[STATES], later, whole;
} Sizes;

/* A robot of either kind: without a table it is one without a tube. */
typedef struct {
    bool in_tube;
    TubeRobot tube;
    TwoLinks links;
    Seen *seen;
} Robot;

static Robot robot_opened(double *data, const double *table, int64_t size, int64_t table_size, PlaceMemory *memory) {
    Robot robot = {.in_tube = table_size > 0, .seen = (Seen *)data};
    if (robot.in_tube)
        robot.tube = tube_robot_opened(data + SEEN, size - SEEN, table, memory);
    else
        robot.links = two_links_opened(data + SEEN, size - SEEN);
    return robot;
}

static void find_rates(const Robot *robot, double time, const double *y, double *dy) {
    if (robot->in_tube)
        tube_robot_rates(&robot->tube, (const State *)y, time, false, robot->seen, (State *)dy);
    else
        two_links_rates(&robot->links, (const State *)y, time, robot->seen, (State *)dy);
}

/* Rates close to the last state, whose rates are `base`, for differences. */
static void find_rates_near(const Robot *robot, const double base[RATES], double time, const double *y, double *dy) {
    for (int i = 0; i < RATES; i++) robot->seen->rates[i] = base[i];
    if (robot->in_tube)
        tube_robot_rates(&robot->tube, (const State *)y, time, true, robot->seen, (State *)dy);
    else
        find_rates(robot, time, y, dy);
}

static void find_gaps(const Robot *robot, const double *y, double *gaps) {
    if (robot->in_tube)
        tube_robot_gaps(&robot->tube, (const State *)y, gaps);
    else
        gaps[0] = two_links_film(&robot->links, (const State *)y);
}

/* Write what a run is watched for; the smallest gap. */
static double watch(const Robot *robot, const double *state, double outside, const Limits *limits, double rough,
                    double *gaps, int64_t count) {
    const State *y = (const State *)state;
    const double w = y->attitude[0], i = y->attitude[1], j = y->attitude[2], k = y->attitude[3];
    double smallest = INFINITY;
    find_gaps(robot, state, gaps);
    for (int64_t n = 0; n < count - WATCHED; n++) {
        smallest = smaller(smallest, gaps[n]);
        gaps[n] -= rough;
    }
    const double along = 1.0 - 2.0 * (j * j + k * k) / (w * w + i * i + j * j + k * k);
    const double x = y->position[0] - limits->middle;
    double *other = gaps + count - WATCHED;
    other[ROOM] = limits->channel - larger(x + limits->nose * along, -x - limits->tip * along);
    other[CHARGE_LEFT] = limits->most_charge - y->charge;
    other[WITHIN] = outside == 0.0 ? 1.0 : -1.0;
    return smallest;
}

/* How much smaller than their sizes changes of place have to be where a gap is thin. */
static double nearness(const Robot *robot, const Sizes *sizes) {
    const double gap = smaller(robot->seen->film, robot->seen->tail_gap);
    return smaller(1.0, larger(100.0 * gap / sizes->state[0], 1e-6));
}

/* One step: where it begins, its rates and their derivatives in what acts and in time, its increments and its end. */
typedef struct {
    double time, length;
    double y[STATES], f[STATES], jacobian[STATES][ACTING], later[STATES];
    double (*u)[STATES]; /* (STAGES, STATES) */
    double end[STATES];
} Step;

static void copy(const double *from, double *to) {
    for (int i = 0; i < STATES; i++) to[i] = from[i];
}

/* Derivatives of the rates at the beginning of a step. */
static void set_jacobian(const Robot *robot, const Sizes *sizes, double near, Step *s) {
    double trial[STATES], other[STATES], back[STATES], base[RATES];
    /* central differences where the rates cost little and are smooth, and where asperities under the wire bend them */
    const bool touches = robot->in_tube && robot->seen->tail_gap < robot->tube.tube->roughness;
    const bool central = touches || (!robot->in_tube && near < 1.0);
    copy(s->y, trial);
    for (int i = 0; i < RATES; i++) base[i] = robot->seen->rates[i];
    for (int column = 0; column < ACTING; column++) {
        const int at = ACTS[column];
        double step = sizes->state[at] * (at == COLUMN(current) ? 1e-6 : 3e-7 * near);
        double first = s->y[at];
        if (central) {
            step *= touches ? 1.0 : WIDER;
            first = trial[at] = s->y[at] - step;
            find_rates_near(robot, base, s->time, trial, back);
        }
        trial[at] = s->y[at] + step;
        step = trial[at] - first;
        find_rates_near(robot, base, s->time, trial, other);
        for (int i = 0; i < STATES; i++) s->jacobian[i][column] = (other[i] - (central ? back : s->f)[i]) / step;
        trial[at] = s->y[at];
    }
    for (int i = 0; i < RATES; i++) robot->seen->rates[i] = base[i];
    if (sizes->later > 0.0) find_rates(robot, s->time + sizes->later, s->y, other);
    for (int i = 0; i < STATES; i++) s->later[i] = sizes->later > 0.0 ? (other[i] - s->f[i]) / sizes->later : 0.0;
}

/* W = 1/(gamma dt) - J of what acts, in LU factors with the order of its rows. */
typedef struct {
    double a[ACTING][ACTING];
    int order[ACTING];
} Factors;

static void factorise(Factors *factors) {
    double (*a)[ACTING] = factors->a;
    for (int k = 0; k < ACTING; k++) {
        int best = k;
        for (int i = k + 1; i < ACTING; i++)
            if (fabs(a[i][k]) > fabs(a[best][k])) best = i;
        factors->order[k] = best;
        for (int j = 0; j < ACTING && best != k; j++) {
            const double kept = a[k][j];
            a[k][j] = a[best][j];
            a[best][j] = kept;
        }
        for (int i = k + 1; i < ACTING; i++) {
            a[i][k] /= a[k][k];
            for (int j = k + 1; j < ACTING; j++) a[i][j] -= a[i][k] * a[k][j];
        }
    }
}

/* Solve with the factors, in place. */
static void solve(const Factors *factors, double b[ACTING]) {
    for (int k = 0; k < ACTING; k++) {
        const double kept = b[k];
        b[k] = b[factors->order[k]];
        b[factors->order[k]] = kept;
    }
    for (int i = 0; i < ACTING; i++)
        for (int j = 0; j < i; j++) b[i] -= factors->a[i][j] * b[j];
    for (int i = ACTING - 1; i >= 0; i--) {
        for (int j = i + 1; j < ACTING; j++) b[i] -= factors->a[i][j] * b[j];
        b[i] /= factors->a[i][i];
    }
}

/* The increment of one stage from the rates at its argument. */
static void set_increment(Step *s, const Factors *factors, int stage, const double rates[STATES]) {
    double *u = s->u[stage], b[ACTING];
    const double over = 1.0 / (GAMMA * s->length);
    for (int i = 0; i < STATES; i++) u[i] = rates[i] + TIMES[stage] * s->length * s->later[i];
    for (int j = 0; j < stage; j++) {
        const double c = COEFFICIENTS[stage][j] / s->length;
        for (int i = 0; i < STATES; i++) u[i] += c * s->u[j][i];
    }
    for (int i = 0; i < ACTING; i++) b[i] = u[ACTS[i]];
    solve(factors, b);
    for (int i = 0; i < STATES; i++) {
        for (int j = 0; j < ACTING; j++) u[i] += s->jacobian[i][j] * b[j];
        u[i] /= over;
    }
    for (int i = 0; i < ACTING; i++) u[ACTS[i]] = b[i];
}

/* Find increments and end of a step. */
static void take_step(const Robot *robot, Step *s) {
    Factors factors;
    double rates[STATES];
    for (int i = 0; i < ACTING; i++) {
        for (int j = 0; j < ACTING; j++) factors.a[i][j] = -s->jacobian[ACTS[i]][j];
        factors.a[i][i] += 1.0 / (GAMMA * s->length);
    }
    factorise(&factors);
    copy(s->f, rates);
    for (int stage = 0; stage < STAGES; stage++) {
        copy(s->y, s->end);
        for (int j = 0; j < stage; j++)
            for (int i = 0; i < STATES; i++) s->end[i] += WEIGHTS[stage][j] * s->u[j][i];
        if (stage > 0) find_rates(robot, s->time + NODES[stage] * s->length, s->end, rates);
        set_increment(s, &factors, stage, rates);
    }
    for (int i = 0; i < STATES; i++) s->end[i] += s->u[STAGES - 1][i];
}

/* Largest error of a step over what is allowed; infinite if it is no number. */
static double error_of(const Step *s, const Sizes *sizes, double near, double tolerance) {
    double largest = 0.0;
    for (int i = 0; i < STATES; i++) {
        double size = sizes->state[i];
        if (i < COLUMN(phase) && i != COLUMN(position)) size *= near;
        if (i > COLUMN(current)) size = larger(larger(size, fabs(s->y[i])), fabs(s->end[i]));
        const double share = fabs(s->u[STAGES - 1][i]) / (tolerance * size);
        if (!(share <= 1e300)) return INFINITY;
        largest = larger(largest, share);
    }
    return largest;
}

/* Fill the state inside a step, of order 4, at a share of it from 0 to 1. */
EXPORT void interpolate(double share, const double *y /* (19) */, const double *end /* (19) */,
                        const double *increments /* (8, 19) */, double *out /* (19) */) {
    const double (*u)[STATES] = (const double (*)[STATES])increments;
    for (int i = 0; i < STATES; i++) {
        double k[3] = {0.0, 0.0, 0.0};
        for (int j = 0; j < STAGES; j++)
            for (int n = 0; n < 3; n++) k[n] += DENSE[n][j] * u[j][i];
        out[i] = (1.0 - share) * y[i] + share * (end[i] + (1.0 - share) * (k[0] + share * (k[1] + share * k[2])));
    }
}

/* Keep what is watched now; whether any of it has changed its sign. */
static bool has_crossed(double *gaps, const double *now, int64_t count) {
    bool crossed = false;
    for (int64_t n = 0; n < count; n++) {
        crossed = crossed || (now[n] > 0.0) != (gaps[n] > 0.0);
        gaps[n] = now[n];
    }
    return crossed;
}

/* Write the time derivative of a state into `dy`, and what is observed to the begin of `data`.
 *
 * dy: derivative of the state, the result; time: s; y: `State`; data: from
 * `packed` of `tube_motion` or `two_links`; its rates are where the solution begins; table: the robot's table, (0,) for
 * one without a tube. */
EXPORT void rates(double *dy /* (19) */, double time, const double *y /* (19) */, double *data /* (size) */,
                  const double *table /* (table_size) */, int64_t size, int64_t table_size) {
    PlaceMemory place;
    const Robot robot = robot_opened(data, table, size, table_size, &place);
    find_rates(&robot, time, y, dy);
}

/* Write what is observed in samples of one stretch between switchings into the rows of `out`, its first columns. */
EXPORT void observe(const double *time /* (count) */, const double *states /* (count, 19) */, double *data /* (size) */,
                    const double *table /* (table_size) */, double *out /* (count, columns) */, int64_t count,
                    int64_t size, int64_t table_size, int64_t columns) {
    PlaceMemory place;
    const Robot robot = robot_opened(data, table, size, table_size, &place);
    double dy[STATES];
    for (int64_t n = 0; n < count; n++) {
        find_rates(&robot, time[n], states + n * STATES, dy);
        for (int64_t i = 0; i < columns; i++) out[n * columns + i] = data[i];
    }
}

/* Fill the gap at every site, and last the smallest of the wire (infinite far from the wall), m.
 *
 * Without a tube: the thinnest film, from the tips of the roughness; infinite without a wall. */
EXPORT void gaps_of(const double *y /* (19) */, double *data /* (size) */, const double *table /* (table_size) */,
                    double *gaps /* (count) */, int64_t size, int64_t table_size, int64_t count) {
    PlaceMemory place;
    const Robot robot = robot_opened(data, table, size, table_size, &place);
    (void)count;
    find_gaps(&robot, y, gaps);
}

/* Write what a run is watched for into `gaps`; return the smallest gap. */
EXPORT double watched(const double *y /* (19) */, double outside, double *data /* (size) */,
                      const double *table /* (table_size) */, const Limits *limits, double rough,
                      double *gaps /* (count) */, int64_t size, int64_t table_size, int64_t count) {
    PlaceMemory place;
    const Robot robot = robot_opened(data, table, size, table_size, &place);
    return watch(&robot, y, outside, limits, rough, gaps, count);
}

/* A run while it is followed. */
typedef struct {
    Robot robot;
    const Sizes *sizes;
    const Limits *limits;
    double rough, tolerance, stop;
    bool clip; /* whether a step ends at `stop` */
    Memory *memory;
    int64_t count;                                      /* of what is watched */
    double now[MOST_CONTACTS + WATCHED], rates[STATES]; /* at the end of the step */
    Step step;
} Run;

/* Error of a step of this length over what is allowed; infinite where it goes through the wall. */
static double tried(Run *run, double length, double end, double near) {
    Step *s = &run->step;
    s->length = length;
    take_step(&run->robot, s);
    const double error = error_of(s, run->sizes, near, run->tolerance);
    if (!(error <= 1.0)) return error;
    find_rates(&run->robot, end, s->end, run->rates);
    const double outside = run->robot.seen->outside;
    const double gap = watch(&run->robot, s->end, outside, run->limits, run->rough, run->now, run->count);
    return gap > 0.0 ? error : INFINITY;
}

/* Find the next step, shorter until its error is allowed; whether one is small enough. */
static bool found_step(Run *run) {
    Memory *memory = run->memory;
    const double time = memory->time, near = nearness(&run->robot, run->sizes);
    double trial = memory->step, taken = 0.0, end = time, error = INFINITY;
    bool clipped = false;
    run->step.time = time;
    set_jacobian(&run->robot, run->sizes, near, &run->step);
    while (!(error <= 1.0)) {
        clipped = run->clip && time + 1.0001 * trial >= run->stop;
        taken = clipped ? run->stop - time : trial;
        end = clipped ? run->stop : time + taken;
        error = tried(run, taken, end, near);
        if (error <= 1.0) break;
        trial = taken * (isfinite(error) ? larger(0.2, 0.9 * pow(error, -0.2)) : 0.25);
        if (trial < SMALLEST * run->sizes->whole) return false;
    }
    const double grown = taken * smaller(5.0, 0.9 * pow(larger(error, 1e-10), -0.2));
    *memory = (Memory){end, clipped ? larger(grown, trial) : grown, time, memory->step, memory->answered};
    return true;
}

/* Step on until a time, an event, or the number of steps is reached.
 *
 * Returns One of `DONE`, `PAUSED`, `CROSSED`, `STUCK`.
 *
 * stop: where to stop, s; clip: whether a step ends there; else the last one may go beyond; steps:
 * number of steps at most; tolerance: error of a step over the sizes; memory: time and step length, see the constants;
 * changed; y: the state, (19,); changed; before: state at the beginning of the last step; increments:
 * those of the last step; jacobian: derivatives of the rates of what acts (`ACTING`) at the beginning
 * of the last step, 1/s; gaps: what is watched, at `y`; changed; samples: increasing times, s: those in the steps taken
 * are answered; states: states at the samples; sizes: sizes of the state's components below which nothing
 * matters, (19,); a small change of time, s (0: nothing depends on it); a time of the order of the run's, s; limits:
 * where tube and battery end; rough: height of the asperities, m; data: from `packed` of `tube_motion` or `two_links`;
 * table: the robot's table, (0,) for one without walls. */
EXPORT int64_t advance(double stop, bool clip, int64_t steps, double tolerance, Memory *memory, double *y /* (19) */,
                       double *before /* (19) */, double *increments /* (8, 19) */, double *jacobian /* (8, 8) */,
                       double *gaps /* (count) */, const double *samples /* (sample_count) */,
                       double *states /* (sample_count, 19) */, const double *sizes /* (21) */, const Limits *limits,
                       double rough, double *data /* (size) */, const double *table /* (table_size) */, int64_t count,
                       int64_t sample_count, int64_t size, int64_t table_size) {
    PlaceMemory place;
    Run run = {
        .robot = robot_opened(data, table, size, table_size, &place),
        .sizes = (const Sizes *)sizes,
        .limits = limits,
        .rough = rough,
        .tolerance = tolerance,
        .stop = stop,
        .clip = clip,
        .memory = memory,
        .count = count,
        .step.u = (double (*)[STATES])increments,
    };
    Step *s = &run.step;
    int64_t answered = 0;
    run.memory->answered = 0.0;
    find_rates(&run.robot, run.memory->time, y, s->f);
    for (int64_t n = 0; n < steps; n++) {
        if (run.memory->time >= stop) return DONE;
        copy(y, s->y);
        if (!found_step(&run)) return STUCK;
        for (; answered < sample_count && samples[answered] <= run.memory->time; answered++)
            interpolate((samples[answered] - s->time) / s->length, s->y, s->end, increments,
                        states + answered * STATES);
        run.memory->answered = (double)answered;
        for (int i = 0; i < ACTING * ACTING; i++) jacobian[i] = s->jacobian[ACTS[i / ACTING]][i % ACTING];
        copy(s->y, before);
        copy(s->end, y);
        copy(run.rates, s->f);
        if (has_crossed(gaps, run.now, count)) return CROSSED;
    }
    return PAUSED;
}
