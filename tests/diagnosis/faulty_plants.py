"""Models with faults for tests, and residuals computed from their matrices alone."""

import control
import numpy as np

from workbench.diagnosis import FaultModel


def random_model(seed, states=4, outputs=3, controls=1, disturbances=1, faults=2, dt=0.0):
    """A random model: always stable if sampled, mostly stable in continuous time."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((states, states))
    if states:
        A = 0.8 * A / np.abs(np.linalg.eigvals(A)).max() if dt else A - 2.5 * np.eye(states)
    counts = {"u": controls, "d": disturbances, "f": faults}
    names = {kind: tuple(f"{kind}{k}" for k in range(n)) for kind, n in counts.items()}
    inputs = [name for group in names.values() for name in group]
    B = rng.standard_normal((states, len(inputs)))
    C = rng.standard_normal((outputs, states))
    D = rng.standard_normal((outputs, len(inputs))) * rng.integers(0, 2, (1, len(inputs)))
    system = control.StateSpace(
        A,
        B,
        C,
        D,
        dt,
        remove_useless_states=False,
        inputs=inputs,
        outputs=[f"y{k}" for k in range(outputs)],
    )
    return FaultModel(system, controls=names["u"], disturbances=names["d"], faults=names["f"])


def response_at(system, s, columns=None):
    """The response C (s - A)^-1 B + D at one complex number s."""
    A, B, C, D = (np.asarray(getattr(system, part)) for part in "ABCD")
    if columns is not None:
        B, D = B[:, columns], D[:, columns]
    return C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D


def residual_at(Q, model, name, s):
    """The response at s from one input of the model to r = Q [y; u]."""
    G = response_at(model.system, s, [list(model.system.input_labels).index(name)])
    given = np.array([[name == u] for u in model.controls], dtype=float)
    return response_at(Q, s) @ np.vstack([G, given.reshape(len(model.controls), 1)])
