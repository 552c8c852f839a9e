/* Controller in state space.
 *
 * 1 inputs, 1 outputs, 4 states, sample time 0.02 s.
 * Call controller_init once, then controller_step each sample: it reads y[1] and writes
 * u[1], which must not overlap. y are the inputs of the controller as it was designed:
 * in a loop with e = r - y the errors e, not the measurements.
 * Outputs are not limited.
 */
#ifndef CONTROLLER_H
#define CONTROLLER_H

#define CONTROLLER_INPUTS 1
#define CONTROLLER_OUTPUTS 1
#define CONTROLLER_STATES 4
#define CONTROLLER_SAMPLE_TIME 0.02

typedef float controller_real;

typedef struct {
    controller_real x[4];
} controller_state;


static inline void controller_init(controller_state *state)
{
    for (int i = 0; i < 4; i++)
        state->x[i] = 0;
}

static inline void controller_step(controller_state *state, const controller_real y[1],
                               controller_real u[1])
{
    const controller_real x0 = state->x[0];
    const controller_real x1 = state->x[1];
    const controller_real x2 = state->x[2];
    const controller_real x3 = state->x[3];
    u[0] = -414.90466f * x0 - 233.42776f * x1 + 198.31068f * x2 - 0.57601035f * x3 + 10.208039f * y[0];
    state->x[0] = 4.8583178e-30f * x0 - 0.008643797f * y[0];
    state->x[1] = 7.3377723e-16f * x1 + 0.01513344f * y[0];
    state->x[2] = 7.551937e-09f * x2 - 0.030969812f * y[0];
    state->x[3] = 0.9998731f * x3 - 0.05011277f * y[0];
}

/* The state from which a step answers the measurements y with the controls u: no bump. */
static inline void controller_start(controller_state *state, const controller_real y[1],
                                const controller_real u[1])
{
    state->x[0] = -0.004039661f * y[0] - 1.9880585e-05f * u[0];
    state->x[1] = 0.017723752f * y[0] - 1.1184931e-05f * u[0];
    state->x[2] = -0.033170436f * y[0] + 9.502261e-06f * u[0];
    state->x[3] = 2.0292094f * y[0] - 1.7139556f * u[0];
}

#endif
