"""Sampled loops whose controller is switched while the measurement has a defect.

With w the disturbance, y the plant's output and H the filter through which both are measured,

    e = k H (w - y)    measured error,        u = C x_K + D e,    x_K' = A x_K + B e,

where A, B, C, D of the controllers depend on the mode, clean or defect. Their states are the same
in both modes: all controllers run all the time (see `controllers`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.systems.sampling import sampled_model

FilterResponse = Callable[[RealArray], ComplexArray]
"""Function: omega [rad/s] (F,) -> response (F,) of the measurement filter H."""


@dataclass(frozen=True, eq=False)
class SampledPlant:
    """A plant with its measurement filter, sampled with u held over a period: x' = A x + B u.

    Unlike a `StateSpace`, it has the exact response of its measurement filter beside the
    sampled states.

    A is (n, n), B (n, 1). The plant's output is y = output x, and the filtered output is H y =
    measured x, both rows (1, n). `gain` is the factor k of the measured error, `period` the
    sampling period [s], and `filter` the response of H.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.simulation import sampled_model
    >>> from workbench.synthesis import (
    ...     SampledPlant,
    ...     discretise,
    ... )
    >>> G = sampled_model(control.ss(-2.0, 1.0, [[1.0], [1.0]], 0.0), 0.1)
    >>> plant = SampledPlant(G.A, G.B, G.C[:1], G.C[1:], 1.0, 0.1, np.ones_like)
    >>> K = discretise(control.tf([1.0, 1.0], [1.0, 0.01]), 0.1)
    >>> plant.dt, plant.A.round(4).tolist()
    (0.1, [[0.8187]])
    """

    A: RealArray
    B: RealArray
    output: RealArray
    measured: RealArray
    gain: float
    dt: float
    filter: FilterResponse


Modes = tuple[StateSpace, StateSpace]
"""All controllers, from the measured error to u, in the mode while the measurement is clean and in
the mode while it has a defect. Both have the same states.
"""


@dataclass(frozen=True, eq=False)
class SwitchedLoop:
    """Both modes of a loop: x[k + 1] = A_i x[k] + B_i H w[k], with the error w - output x.

    Unlike a closed `StateSpace`, it has two transition matrices for the same states.

    `clean` and `defect` hold A_i (n, n) and B_i (n, 1) of each mode. `output` is (1, n), `period`
    the sampling period [s], and `filter` the response of H.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.simulation import sampled_model
    >>> from workbench.synthesis import (
    ...     SampledPlant,
    ...     discretise,
    ...     dropout_modes,
    ...     switched_loop,
    ... )
    >>> G = sampled_model(control.ss(-2.0, 1.0, [[1.0], [1.0]], 0.0), 0.1)
    >>> plant = SampledPlant(G.A, G.B, G.C[:1], G.C[1:], 1.0, 0.1, np.ones_like)
    >>> K = discretise(control.tf([1.0, 1.0], [1.0, 0.01]), 0.1)
    >>> loop = switched_loop(plant, dropout_modes(K))
    >>> loop.clean[0].shape, loop.output.shape
    ((2, 2), (1, 2))
    """

    clean: tuple[RealArray, RealArray]
    defect: tuple[RealArray, RealArray]
    output: RealArray
    dt: float
    filter: FilterResponse


def switched_loop(plant: SampledPlant, modes: Modes) -> SwitchedLoop:
    """The loop of a plant and a controller with two modes, closed with negative feedback.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.simulation import sampled_model
    >>> from workbench.synthesis import (
    ...     SampledPlant,
    ...     discretise,
    ...     dropout_modes,
    ...     switched_loop,
    ... )
    >>> G = sampled_model(control.ss(-2.0, 1.0, [[1.0], [1.0]], 0.0), 0.1)
    >>> plant = SampledPlant(G.A, G.B, G.C[:1], G.C[1:], 1.0, 0.1, np.ones_like)
    >>> K = discretise(control.tf([1.0, 1.0], [1.0, 0.01]), 0.1)
    >>> loop = switched_loop(plant, dropout_modes(K))
    >>> bool(abs(np.linalg.eigvals(loop.clean[0])).max() < 1)
    True
    """
    clean, defect = (
        (mode_transition(plant, mode), disturbance_input(plant, mode)) for mode in modes
    )
    output = np.hstack([plant.output, np.zeros((1, modes[0].nstates))])
    return SwitchedLoop(clean, defect, output, plant.dt, plant.filter)


def mode_transition(plant: SampledPlant, mode: StateSpace) -> RealArray:
    """Matrix A of the loop (n + m, n + m) in one mode; the plant's states come first."""
    read = plant.gain * plant.measured
    return np.block(
        [[plant.A - plant.B @ mode.D @ read, plant.B @ mode.C], [-mode.B @ read, mode.A]]
    )


def disturbance_input(plant: SampledPlant, mode: StateSpace) -> RealArray:
    """Matrix B of the loop (n + m, 1) in one mode, for the filtered disturbance H w as input."""
    return plant.gain * np.vstack([plant.B @ mode.D, mode.B])


def closed_loop_transition(
    plant: StateSpace, controller: StateSpace, delay_samples: float
) -> RealArray:
    """Transition matrix (n, n) over a sample: G behind a hold, with K in negative feedback.

    The plant is continuous and strictly proper. The controller is sampled; its dt is the sampling
    time [s]. ``delay_samples`` [samples] is the delay of u.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.synthesis import closed_loop_transition
    >>> G, K = control.ss(-2.0, 1.0, 1.0, 0.0), control.ss([], [], [], [[3.0]], 0.1)
    >>> held = np.exp(-0.2)
    >>> bool(np.isclose(closed_loop_transition(G, K, 0.0), held - 3.0 * (1 - held) / 2.0))
    True
    """
    P = sampled_model(plant, controller.dt, delay_samples=delay_samples)
    corner = P.A - P.B @ controller.D @ P.C
    return np.block([[corner, P.B @ controller.C], [-controller.B @ P.C, controller.A]])
