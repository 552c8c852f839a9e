/* Controller in state space.
 *
 * 1 inputs, 1 outputs, 4 states, sample time 0.02 s.
 * Call controller_init once, then controller_step each sample: it reads y[1] and writes
 * u[1], which must not overlap.
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
    u[0] = -428.79254f * x0 - 196.64127f * x1 + 217.47092f * x2 - 0.593696f * x3 + 10.209892f * y[0];
    state->x[0] = 1.0772216e-32f * x0 - 0.0064114495f * y[0];
    state->x[1] = 1.3354195e-19f * x1 + 0.006199849f * y[0];
    state->x[2] = 5.0742264e-09f * x2 - 0.034972616f * y[0];
    state->x[3] = 0.9998937f * x3 - 0.0481965f * y[0];
}

/* The state from which a step answers the measurements y with the controls u: no bump. */
static inline void controller_start(controller_state *state, const controller_real y[1],
                                const controller_real u[1])
{
    state->x[0] = -0.002687452f * y[0] - 1.362207e-05f * u[0];
    state->x[1] = 0.007907649f * y[0] - 6.2469862e-06f * u[0];
    state->x[2] = -0.03686132f * y[0] + 6.908712e-06f * u[0];
    state->x[3] = 3.0167243f * y[0] - 1.6699256f * u[0];
}

#endif
