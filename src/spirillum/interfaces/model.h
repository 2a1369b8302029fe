/* A robot as the functions of FMI 3.0 in fmi3.c drive it.
 *
 * robot.h, written at export, has the numbers of its arrays (STATE, PARAMETERS, OUTPUTS), its token and what its inputs
 * are at first (START_DUTY, START_FLOW; FLOW_INPUT: whether a flow is one).
 */
#ifndef SPIRILLUM_MODEL_H
#define SPIRILLUM_MODEL_H

#include "core.h"
#include "robot.h"

/* Value references: time, inputs, outputs from FIRST_OUTPUT on, parameters from FIRST_PARAMETER on. */
enum { TIME = 0, REMOTE = 1, DUTY = 2, FLOW = 3, FIRST_OUTPUT = 10, FIRST_PARAMETER = 100 };
typedef enum { INSTANTIATED, INITIALIZING, STEPPING, ENDED, TERMINATED, BROKEN } Mode;

typedef struct {
    double time, duty, flow; /* s; 0 to 1; m/s */
    bool remote;             /* whether the drive is on */
    Mode mode;
    double p[PARAMETERS + 1];
    double state[STATE];
} Model;

static inline double duty_of(const Model *m) { return m->remote ? fmin(fmax(m->duty, 0.0), 1.0) : 0.0; }

/* Set parameters, inputs and state as they are at first; the rest is zero. */
void start_model(Model *m);
/* What is wrong with the value of a parameter, or NULL. */
const char *parameter_problem(int parameter, double value);
/* Observe the outputs again: the inputs have changed. */
void observe_model(Model *m);
/* Go on for a time, s, or until the mode is ENDED; why that cannot be, or NULL. */
const char *advance_model(Model *m, double length);
double output_of(const Model *m, int output);

#endif
