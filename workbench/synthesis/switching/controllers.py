"""Switching between controllers that hand over their integrator, as modes with common states.

u = z + C_i f + D_i e, z' = a z + b_i e: z is the integrator, or the slowest state, of the active
controller. At a switch z keeps its value, and so does the slow part of u. f are the fast states of
all controllers and filters; they run all the time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.synthesis.switching.loops import Modes
from workbench.systems.conversion import as_system
from workbench.systems.realisation import realisation

SLOW_POLE_TOLERANCE = 1e-6
"""Largest difference of two slow poles that count as equal, relative to their distance from 1."""
SLOW_POLE_ROUNDING = 1e-15
"""Absolute rounding of a slow pole near 1, added to that difference."""


class SplitController(NamedTuple):
    """A controller as u = z + C f + D e, z' = a z + b e, f' = A f + B e.

    Unlike a `StateSpace`, it keeps the integrator apart, which is handed over at a switch.
    """

    a: float
    b: float
    A: RealArray
    B: RealArray
    C: RealArray
    D: float


def split_slowest(K: StateSpace) -> SplitController:
    """Split a sampled controller into its slowest state and the rest; that state enters u with gain
    1.

    K has one input and one output. Its slowest pole is real, and its state is not coupled with
    others: `discretise` gives such controllers. Raises InputError otherwise.
    """
    K = as_system(K, "the controller")
    A = K.A
    slow = int(np.argmin(abs(np.diag(A) - 1.0)))
    fast = [i for i in range(len(A)) if i != slow]
    if abs(A[slow, fast]).max(initial=0.0) + abs(A[fast, slow]).max(initial=0.0) > 0.0:
        raise InputError("the controller's slowest state is coupled with its other states")
    gain = float(K.C[0, slow])
    inner = A[np.ix_(fast, fast)]
    return SplitController(
        float(A[slow, slow]), gain * float(K.B[slow, 0]), inner, K.B[fast], K.C[:, fast],
        float(K.D[0, 0]),
    )  # fmt: skip


def unswitched_modes(controller: StateSpace) -> Modes:
    """Modes of a sampled controller that does not change while the measurement has a defect.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.synthesis import discretise, unswitched_modes
    >>> K = discretise(control.tf([1.0, 1.0], [1.0, 0.01]), 0.1)
    >>> clean, defect = unswitched_modes(K)
    >>> bool(np.array_equal(clean.A, defect.A))
    True
    """
    alone = _mode_of(controller)
    return alone, alone


def dropout_modes(controller: StateSpace) -> Modes:
    """Modes of a sampled controller whose input is zero during a defect, while its states go on.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import discretise, dropout_modes
    >>> K = discretise(control.tf([1.0, 1.0], [1.0, 0.01]), 0.1)
    >>> clean, defect = dropout_modes(K)
    >>> bool(clean.B.any()), bool(defect.B.any())
    (True, False)
    """
    alone = _mode_of(controller)
    return alone, realisation((alone.A, 0 * alone.B, alone.C, 0 * alone.D), alone.dt)


def filtering_modes(controller: StateSpace, F: StateSpace) -> Modes:
    """Modes of a sampled controller whose input passes through a filter F during a defect: K and K
    F.

    F is sampled, with one input and one output. It receives the measured error all the time.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import discretise, filtering_modes
    >>> K = discretise(control.tf([1.0, 1.0], [1.0, 0.01]), 0.1)
    >>> clean, defect = filtering_modes(K, control.ss(0.5, 0.5, 1.0, 0.0, 0.1))
    >>> clean.A.shape  # the controller's state and that of the filter
    (2, 2)
    """
    alone, F = _mode_of(controller), as_system(F, "F")
    n, both = len(alone.A), block_diag(alone.A, F.A)
    wide = np.hstack([alone.C, np.zeros((1, F.nstates))])
    clean = realisation((both, np.vstack([alone.B, F.B]), wide, alone.D), alone.dt)
    fed = both.copy()
    fed[:n, n:] = alone.B @ F.C
    enter, leave = np.vstack([alone.B @ F.D, F.B]), np.hstack([alone.C, alone.D @ F.C])
    return clean, realisation((fed, enter, leave, alone.D @ F.D), alone.dt)


def replacement_modes(controller: StateSpace, other: StateSpace) -> Modes:
    """Modes of a sampled controller K that another controller replaces during a defect.

    Raises InputError where the two have different slowest poles.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import replacement_modes, discretise
    >>> K = discretise(control.tf([1.0, 1.0], [1.0, 0.01]), 0.1)
    >>> slow = discretise(control.tf([0.1, 0.1], [1.0, 0.01]), 0.1)
    >>> clean, defect = replacement_modes(K, slow)
    >>> bool(abs(defect.B).sum() < abs(clean.B).sum())
    True
    """
    a, _, _, B, C, _ = split_slowest(controller)
    a2, b2, A2, B2, C2, D2 = split_slowest(other)
    if abs(a2 - a) > SLOW_POLE_TOLERANCE * abs(1 - a) + SLOW_POLE_ROUNDING:
        raise InputError(
            f"K and K' have slow poles {a:.12g} and {a2:.12g}; the integrator can only be handed "
            "over if they are the same"
        )
    one = np.array([[1.0]])
    alone = _mode_of(controller)
    both = block_diag(alone.A, A2)
    none_1, none_2 = np.zeros_like(C), np.zeros_like(C2)
    enter = np.vstack([alone.B, B2])
    clean = realisation((both, enter, np.hstack([one, C, none_2]), alone.D), alone.dt)
    slow = np.vstack([[[b2]], B, B2])
    return clean, realisation(
        (both, slow, np.hstack([one, none_1, C2]), np.array([[D2]])), alone.dt
    )


def _mode_of(controller: StateSpace) -> StateSpace:
    """The controller with its slowest state first, which enters u with gain 1."""
    K, one = split_slowest(controller), np.array([[1.0]])
    whole, enter = block_diag(K.a, K.A), np.vstack([[[K.b]], K.B])
    return realisation((whole, enter, np.hstack([one, K.C]), np.array([[K.D]])), controller.dt)
