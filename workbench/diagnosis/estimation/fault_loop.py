"""A feedback loop with an additive fault on its measurement, and demands on the fault's estimate.

    e = d + f - H G (1 + W_c delta_c + W_r delta_r) K e,     u_f = F e,

where d is the disturbance, f the fault, and H a filter of the measurement inside the loop. F S maps
the fault and the disturbance alike to the estimate, so whatever share of a fault is estimated, the
same share of a disturbance leaks. F has no filter H before it: d and f are the disturbance and
the fault after H.
"""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.stable_system import stable_system
from workbench.diagnosis.estimation.weighting import Requirement
from workbench.errors import InputError
from workbench.input_checks import need_positive
from workbench.systems.bilinear import bilinear_continuous
from workbench.systems.connection import generalised_plant
from workbench.systems.generalised_plant import GeneralisedPlant, response
from workbench.systems.sampling import sampled_model
from workbench.uncertainty import UncertaintyModel

BOUNDARY_POINTS = 24
"""Points on each half of the boundary of the plants' stadium or circle at a frequency."""


@dataclass(frozen=True, eq=False)
class EstimationDemands:
    """Demands on a fault's estimate: where it must be accurate, and what may disturb it.

    Parameters
    ----------
    disturbance
        Stable weight whose magnitude is the disturbance's largest amplitude [unit of the fault].
    error_above_hz
        Frequency [Hz] above which the relative error of the estimate is limited.
    leakage_below_hz
        Frequency [Hz] below which the leakage of the disturbance is limited.
    gain
        Largest gain from disturbance or fault to the estimate, at any frequency and plant.
    noise
        Rms of the measurement's noise, in the unit of the fault, white up to `noise_band_hz`.
    noise_band_hz
        Bandwidth of the noise [Hz].
    unit
        Typical size of a leakage; the cone programs are scaled by it.

    Raises
    ------
    InputError
        A number is not positive and finite.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import EstimationDemands
    >>> room = control.ss(-0.1, 0.1, 3e-3, 0.0)  # of a room's temperature [K]
    >>> demands = EstimationDemands(
    ...     error_above_hz=0.5, leakage_below_hz=0.05, gain=2.0, disturbance=room, noise=1e-4,
    ...     noise_band_hz=1.0
    ... )
    >>> demands.disturbance_size([0.0]).tolist()
    [0.003]
    """

    disturbance: StateSpace
    error_above_hz: float
    leakage_below_hz: float
    gain: float
    noise: float
    noise_band_hz: float
    _: KW_ONLY
    unit: float = 1.0

    def __post_init__(self) -> None:
        names = ("error_above_hz", "leakage_below_hz", "gain", "noise", "noise_band_hz", "unit")
        for name in names:
            need_positive(getattr(self, name), name)

    def disturbance_size(self, omega: RealArray) -> RealArray:
        """Largest amplitude (F,) of the disturbance at omega [rad/s] (F,)."""
        return np.abs(response(self.disturbance, omega)[:, 0, 0])


@dataclass(frozen=True, eq=False)
class FaultLoop:
    """A loop with all plants of a model; a sampled loop if a delay is given.

    Unlike a closed `StateSpace`, it keeps its parts, from which the loop of each demand is
    made.

    Parameters
    ----------
    model
        Nominal plant and weights u -> y, without the measurement's filter.
    controller
        e -> u, continuous, closed with negative feedback.
    filter
        H, continuous, stable.
    demands
        Demands on the estimate of the fault.
    dt
        Sampling period [s]; None: the loop is continuous.
    delay_samples
        Delay of the computer [samples], given together with a period: the plant is sampled behind a
        hold and mapped back to continuous time by the bilinear transform; K and the weights
        represent their bilinear transforms.

    Raises
    ------
    InputError
        The period is not positive, or the filter is not proven stable.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import EstimationDemands, FaultLoop
    >>> from workbench.fitting import Rational
    >>> from workbench.uncertainty import UncertaintyModel
    >>> room = control.ss(-0.1, 0.1, 3e-3, 0.0)  # of a room's temperature [K]
    >>> demands = EstimationDemands(
    ...     error_above_hz=0.5, leakage_below_hz=0.05, gain=2.0, disturbance=room, noise=1e-4,
    ...     noise_band_hz=1.0
    ... )
    >>> parts = [Rational([], [-p], gain) for p, gain in ((0.2, 0.2), (2.0, 0.2), (1.0, 0.15))]
    >>> K, H = control.ss(0.0, 0.1, 1.0, 0.8), control.ss(-30.0, 30.0, 1.0, 0.0)
    >>> loop = FaultLoop(UncertaintyModel(*parts), K, H, demands)
    >>> grid = np.unique(np.r_[np.geomspace(1e-3, 20.0, 40), 0.05, 0.5, 1.0])
    >>> bool(loop.amplification(loop.warped_omega(grid)).min() >= 1.0)
    True
    """

    model: UncertaintyModel
    controller: StateSpace
    filter: StateSpace
    demands: EstimationDemands
    _: KW_ONLY
    dt: float | None = None
    delay_samples: float = 0.0

    def __post_init__(self) -> None:
        if self.dt is not None:
            need_positive(self.dt, "dt")
        try:
            stable_system(self.filter)
        except InputError as fault:
            raise InputError(f"filter of a fault loop: {fault}") from fault

    def within(self, share: float) -> FaultLoop:
        """The loop with only those plants whose perturbations are at most this share of the set's.

        Raises InputError for a share that is not positive.
        """
        need_positive(share, "share")
        weights = {"W_c": self.model.W_c, "W_r": self.model.W_r}
        smaller = {
            name: replace(W, gain=share * W.gain) for name, W in weights.items() if W is not None
        }
        return replace(self, model=replace(self.model, **smaller))

    def warped_omega(self, frequency_hz: ArrayLike) -> RealArray:
        """omega [rad/s] at which the continuous systems respond as the loop does.

        ``frequency_hz`` (F,) [Hz].
        """
        omega = 2 * np.pi * np.asarray(frequency_hz, float)
        if self.dt is None:
            return omega
        rate = 2.0 / self.dt
        return rate * np.tan(omega / rate)

    @cached_property
    def nominal(self) -> StateSpace:
        """Nominal plant, including the filter of the measurement and the delay."""
        G = self.filter * self.model.systems()["G"]
        if self.dt is None:
            return G
        return bilinear_continuous(sampled_model(G, self.dt, delay_samples=self.delay_samples))

    @cached_property
    def plant(self) -> GeneralisedPlant:
        """(perturbation; d, f) -> (perturbation; e) of the closed loop."""
        return self._connected({"e": "d + f - x"}, "e", exogenous=["d", "f"], measurement="e")

    @cached_property
    def removal(self) -> GeneralisedPlant:
        """(perturbation; d; u_f) -> (perturbation; e; e), the estimate subtracted before K.

        Closed by F, it is the loop while a fault estimate is subtracted: e = d / (1 + L (1 - F)).
        """
        sums = {"e": "d - x", "seen": "e - u_f"}
        signals = {"performance": "e", "control": "u_f", "measurement": "e"}
        return self._connected(sums, "seen", exogenous=["d"], **signals)

    def _connected(self, sums: dict[str, str], seen: str, **signals: Any) -> GeneralisedPlant:
        """The loop of K, which reads the signal `seen`, with the uncertain plant v -> x."""
        systems = self.model.systems()
        kinds = [kind for kind in ("r", "c") if f"W_{kind}" in systems]
        blocks = [(systems[f"W_{kind}"], "m", f"y_{kind}") for kind in kinds]
        perturbation = [
            (block, f"y_{kind}", f"u_{kind}")
            for kind, block in zip(kinds, self.model.structure, strict=True)
        ]
        return generalised_plant(
            [(self.nominal, "v", "x"), (self.controller, seen, "m"), *blocks],
            {"v": " + ".join(["m", *(f"u_{kind}" for kind in kinds)])} | sums,
            perturbation=perturbation,
            **signals,
        )

    def open_loop(self, omega: RealArray) -> ComplexArray:
        """L (F,) of the nominal loop."""
        parts = response(self.controller, omega)[:, 0, 0], response(self.nominal, omega)[:, 0, 0]
        return parts[0] * parts[1]

    def differences(self, omega: RealArray, *, sides: int = BOUNDARY_POINTS) -> ComplexArray:
        """S_nominal / S (F, P) on the boundary of the set: 1 + T (W_c delta_c + W_r delta_r)."""
        L = self.open_loop(omega)
        T = L / (1 + L)
        circular, real = (part[:, None] for part in self._extents(omega, T))
        along = np.exp(1j * np.angle(real))
        cap = real + circular * along * np.exp(1j * np.pi * np.linspace(-0.5, 0.5, sides // 2))
        side = real * np.linspace(-1.0, 1.0, sides // 2)[1:-1] + 1j * circular * along
        return np.concatenate([1 + cap, 1 - cap, 1 + side, 1 - side], axis=1)

    def amplification(self, omega: RealArray) -> RealArray:
        """Largest |S / S_nominal| (F,) over the set; infinite if the loop may be unstable."""
        L = self.open_loop(omega)
        circular, real = self._extents(omega, L / (1 + L))
        along = np.clip(-real.real / np.maximum(np.abs(real) ** 2, np.finfo(float).tiny), -1, 1)
        distance = np.abs(1 + along * real) - circular
        with np.errstate(divide="ignore"):
            return np.where(distance > 0, 1 / np.maximum(distance, 0.0), np.inf)

    def _extents(self, omega: RealArray, T: ComplexArray) -> tuple[RealArray, ComplexArray]:
        """Radius and end of the stadiums of T (W_c delta_c + W_r delta_r)."""
        real = np.zeros(len(omega), complex)
        if self.model.W_r is not None:
            real = self.model.W_r.response(omega) * T
        return np.abs(self.model.W_c.response(omega) * T), real

    def requirements(self, error: float, leakage: float) -> list[Requirement]:
        """Requirements on a filter: relative error of f, leakage of d, gain at all frequencies.

        leakage: in the unit of the fault.
        """
        demands = self.demands
        fast = float(self.warped_omega(demands.error_above_hz))
        slow = float(self.warped_omega(demands.leakage_below_hz))
        return [
            Requirement("error", "f", weight=1.0, bound=error, band=(fast, math.inf)),
            Requirement(
                "leakage", "d", weight=demands.disturbance, bound=leakage, band=(0.0, slow)
            ),
            Requirement("gain", "d", weight=1.0, bound=demands.gain),
        ]

    @property
    def slowest_pole(self) -> float:
        """Distance [rad/s] of the slowest pole of K and G from the imaginary axis."""
        poles = np.concatenate([self.controller.poles(), self.nominal.poles()])
        return float(-poles[np.argmin(np.abs(poles))].real)
