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
    u[0] = -1595.2345f * x0 + 937.0151f * x1 - 250.27414f * x2 - 1.1065232f * x3 + 10.267368f * y[0];
    state->x[0] = -0.00023641533f * y[0];
    state->x[1] = -0.00042615036f * y[0];
    state->x[2] = 1.5549291e-09f * x2 + 0.024466362f * y[0];
    state->x[3] = 0.9998734f * x3 - 0.026077848f * y[0];
}

/* The state from which a step answers the measurements y with the controls u: no bump. */
static inline void controller_start(controller_state *state, const controller_real y[1],
                                const controller_real u[1])
{
    state->x[0] = 0.004397821f * y[0] - 1.9970863e-05f * u[0];
    state->x[1] = -0.0031482263f * y[0] + 1.17305635e-05f * u[0];
    state->x[2] = 0.025193421f * y[0] - 3.1332013e-06f * u[0];
    state->x[3] = -5.425449f * y[0] - 0.86429816f * u[0];
}

#endif
