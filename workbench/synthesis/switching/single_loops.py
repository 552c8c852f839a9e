"""Margins, decay and robust stability of each controller of a switched loop alone, for each plant.

Loops are closed with negative feedback: in continuous time, sampled, and sampled with a delay.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.executor import Context
from workbench.mu import conditions, loop_margins
from workbench.synthesis.switching.loops import closed_loop_transition
from workbench.systems.sampling import sampled_model

if TYPE_CHECKING:
    from workbench.uncertainty import GeneralisedPlant

SAMPLINGS = ("continuous", "sampled", "delayed")
"""Loops that are judged: "sampled" has a hold, "delayed" a hold and the computer's delay."""
PADE_ORDER = 3
"""Order of the Pade approximation of the delay. Its phase is exact to 1e-6 rad up to omega delay =
0.5.
"""
MU_TOLERANCE = 1e-2
"""Relative width of the certified intervals of mu."""


class MarginsOfPlants(NamedTuple):
    """Gain margins [dB], phase margins ``phase_deg`` [deg] and growth rates [1/s] of closed loops.

    Unlike `ClassicalMargins`, it has only arrays, for many controllers and plants.

    Each array is (controllers, SAMPLINGS, plants). Margins are NaN where the loop is unstable, that
    is, where its growth rate is not negative.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import SAMPLINGS, SingleLoops
    >>> K, G = control.ss([], [], [], [[1.0]]), control.ss(0.0, 40.0, 1.0, 0.0)
    >>> sampled = {"gain": control.ss([], [], [], [[1.0]], 0.001)}
    >>> found = SingleLoops({"gain": K}, sampled, {"tank": G}, 0.0).margins()
    >>> dict(zip(SAMPLINGS, found.growth[0, :, 0].round(1).tolist()))
    {'continuous': -40.0, 'sampled': -40.8, 'delayed': -40.8}
    """

    gain_db: RealArray
    phase_deg: RealArray
    growth: RealArray


@dataclass(frozen=True, eq=False)
class SingleLoops:
    """Loops of controllers with plants, by name.

    Unlike a closed `StateSpace`, it holds many controllers and plants and closes each pair.

    Parameters
    ----------
    controllers, plants
        Continuous systems with one input and one output. The plants are strictly proper.
    discrete
        The controllers as a computer runs them, under the same names; their dt is the period [s].
    delay_samples
        Computation delay [samples].

    Raises
    ------
    InputError
        The discrete controllers have other names than the controllers.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import SingleLoops
    >>> K, G = control.ss([], [], [], [[1.0]]), control.ss(0.0, 40.0, 1.0, 0.0)
    >>> loops = SingleLoops(
    ...     {"gain": K}, {"gain": control.ss([], [], [], [[1.0]], 0.001)}, {"tank": G}, 0.0
    ... )
    >>> found = loops.margins()
    >>> found.phase_deg.round(2).tolist()  # of an integrator, continuous and sampled [deg]
    [[[90.0], [88.85], [88.85]]]
    """

    controllers: Mapping[str, StateSpace]
    discrete: Mapping[str, StateSpace]
    plants: Mapping[str, StateSpace]
    delay_samples: float

    def __post_init__(self) -> None:
        if list(self.discrete) != list(self.controllers):
            raise InputError(
                f"discrete controllers {list(self.discrete)}; need the names "
                f"{list(self.controllers)}"
            )

    def open_loop(self, controller: str, plant: str, sampling: str) -> StateSpace:
        """Loop transfer function G K in one of SAMPLINGS."""
        G = self.plants[plant]
        if sampling == "continuous":
            return G * self.controllers[controller]
        K = self.discrete[controller]
        return (
            sampled_model(
                G, K.dt, delay_samples=self.delay_samples if sampling == "delayed" else 0.0
            )
            * K
        )

    def growth(self, controller: str, plant: str, sampling: str) -> float:
        """Growth rate [1/s] of the slowest motion of a closed loop; negative for a stable loop."""
        G = self.plants[plant]
        if sampling == "continuous":
            L = G * self.controllers[controller]
            return float(np.linalg.eigvals(L.A - L.B @ L.C).real.max())
        K = self.discrete[controller]
        A = closed_loop_transition(G, K, self.delay_samples if sampling == "delayed" else 0.0)
        return math.log(abs(np.linalg.eigvals(A)).max()) / K.dt

    def margins(self) -> MarginsOfPlants:
        """Margins and growth rates of every loop."""
        shape = (len(self.controllers), len(SAMPLINGS), len(self.plants))
        gains, phases, growths = (np.full(shape, np.nan) for _ in range(3))
        for i, K in enumerate(self.controllers):
            for j, sampling in enumerate(SAMPLINGS):
                for k, G in enumerate(self.plants):
                    growths[i, j, k] = self.growth(K, G, sampling)
                    if growths[i, j, k] < 0.0:
                        found = loop_margins(self.open_loop(K, G, sampling))
                        phase = min(found.phases_deg[:, 0], key=abs, default=math.inf)
                        gains[i, j, k], phases[i, j, k] = found.gain_db, phase
        return MarginsOfPlants(gains, phases, growths)

    def robust(self, uncertain: GeneralisedPlant, context: Context) -> RealArray:
        """Certified bounds on mu of robust stability (controllers, 2, 2): without and with delay,
        lower and upper.

        `uncertain` is the continuous generalised plant that is closed with every controller. The
        delay is half a period for the hold plus the computer's `delay_samples`, as a rational
        approximation. Bounds are infinite where the nominal loop is unstable.
        """
        import control

        found = []
        for name in context.track(list(self.controllers), "robust stability"):
            K, delay = self.controllers[name], (0.5 + self.delay_samples) * self.discrete[name].dt
            late = control.ss(control.tf(*control.pade(delay, PADE_ORDER)))
            found.append([_mu(uncertain, K), _mu(uncertain, late * K)])
        return np.array(found)


def _mu(uncertain: GeneralisedPlant, K: StateSpace) -> tuple[float, float]:
    """Bounds on the peak of mu; infinite where the nominal loop is unstable."""
    peak = conditions(uncertain, K, tolerance=MU_TOLERANCE).robust_stability
    return (math.inf, math.inf) if peak is None else (peak.lower, peak.upper)
