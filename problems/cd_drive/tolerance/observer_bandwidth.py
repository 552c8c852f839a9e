"""Effect of an observer on the bandwidth of the loop on a clean disc (section 7.3.3).

Strategy B (figure 8.4) adds the estimated u_p to the controller's output at all times. On a clean
disc the controller gets f_en itself; with the state feedback that section 8.4 suggests it would get
the estimate of f_en. Both loops are linear there, since the quality is 1. Section and figure
numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, figures, problem
from workbench.certificate import THIS_SYSTEM
from workbench.diagnosis import Estimator, Rotation
from workbench.simulation import discrete_system, sampled_model
from workbench.study import Study, array, check, dim, figure, metric, part, table
from workbench.systems import bandwidths, loop_response
from workbench.types import DataArray, Dataset, Figure, RealArray, StateSpace
from workbench.uncertainty import generalised_plant

from ..control.loops import plants
from ..diagnosis.defect_runs import ROTATION
from ..diagnosis.position_estimator.model import (
    FAST_BANDWIDTH,
    SLOW_BANDWIDTH,
    Prototype,
    itae,
    kalman,
    of_prototype,
    thesis_estimator,
)
from ..drive.plants import Gain, controller
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis
from ..laboratory.bench_setup import PERIOD

OBSERVERS = ("none", "thesis", "ITAE 5 kHz", "ITAE 300 Hz", "Kalman")
"""Observers: none; K_obs and K_p of eq. 7.33 to 7.35; ITAE poles and placed oscillators; Kalman."""
SEEN = ("f_en", "estimate", "estimate, no u_p")
"""Input of the controller: the measured error (figure 8.4) or its estimate. u_p is added in all
cases except the last, which shows the observer alone.
"""
FAST = ("thesis", "ITAE 5 kHz")
"""Observers of 5 kHz."""
SAME = 0.05
"""Largest relative change of the bandwidth that counts as negligible."""
FREQUENCY = np.geomspace(10.0, 10e3, 300)
"""Frequencies [Hz] of the figure."""


@problem(
    "cd/{axis}/observer-bandwidth",
    axis=("focus", "radial"),
    data=TABLES,
    added=("gain", "delay"),
)
def observer_bandwidth(
    axis: Axis,
    gain: Gain = "own",
    delay: Annotated[float, Field(ge=0.0, le=3.0)] = 1.0,
) -> ObserverBandwidth:
    """Bandwidth of strategy B's loop on a clean disc, with its observer and without (sec. 7.3.3).

    T of twelve drives and the nominal one is computed, sampled at 35 kHz, with the frequency at
    which it falls to -3 dB: with the controller alone, with the thesis' observer, with one with
    ITAE poles at 5 kHz, and with the Kalman filter, all designed for the nominal drive. The
    controller gets f_en or the observer's estimate of it.

    gain: of the twelve drives. delay: of the computer [samples]; one in the experiments with
    strategy B.
    """
    return ObserverBandwidth(axis, gain, delay)


@dataclass(frozen=True)
class ObserverBandwidth(Study):
    """Loops of every drive with every observer."""

    axis: Axis
    gain: Gain
    delay: float

    headline: ClassVar[str] = "largest_change_thesis_estimate_no_u_p"

    @property
    def quantifier(self) -> str:
        return "for these 12 drives and the nominal one"

    observer, seen = dim(OBSERVERS), dim(SEEN)
    drive = dim(lambda drives: list(drives))
    frequency = dim(FREQUENCY, unit="Hz", meaning="frequency")

    drives = part(lambda self: sampled_drives(self.axis, self.gain, self.delay))
    laws = part(lambda self: every_law(self.axis))

    @array(dims=(observer, seen, drive), unit="Hz", meaning="where |T| falls to -3 dB for good")
    def bandwidth(self, laws: Any, drives: dict[str, StateSpace]) -> RealArray:
        return self.over(laws, drives, lambda L: bandwidths(L)["T"])

    @array(dims=(observer, seen, drive), unit="Hz", meaning="where |L| falls to 1 for good")
    def crossover(self, laws: Any, drives: dict[str, StateSpace]) -> RealArray:
        return self.over(laws, drives, lambda L: bandwidths(L)["crossover"])

    @array(
        dims=(observer, seen, drive),
        unit="1",
        meaning="largest modulus of a pole of the closed loop",
    )
    def radius(self, laws: Any, drives: dict[str, StateSpace]) -> RealArray:
        return self.over(laws, drives, closed_radius)

    @array(dims=(observer, seen, frequency), unit="1", meaning="|T| of the nominal drive")
    def T(self, laws: Any, drives: dict[str, StateSpace]) -> Any:
        nominal = {"nominal": drives["nominal"]}
        return self.over(laws, nominal, lambda L: _closed(loop_response(L, FREQUENCY)))[
            :, :, 0
        ].astype("f4")

    def over(self, laws: Any, drives: dict[str, StateSpace], found: Any) -> RealArray:
        """Values of a function for every loop (observer, seen, drive, ...)."""
        return np.array(
            [
                [[found(P * laws[one, what]) for P in drives.values()] for what in SEEN]
                for one in OBSERVERS
            ]
        )

    # --- checks -------------------------------------------------------------------------------

    @check(over=THIS_SYSTEM)
    def stable(self, radius: DataArray) -> list[Check]:
        """All loops are stable except those whose controller gets the estimate of a slow
        observer.
        """
        slow = (radius["observer"] == "ITAE 300 Hz") & (radius["seen"] != SEEN[0])
        worst = "largest modulus of a closed loop's pole, every drive"
        return [
            Check(f"stable, {one}", worst, float(radius.where(~slow).sel(seen=one).max()), 1.0)
            for one in SEEN
        ]

    @check(title="observer alone", at_most=SAME)
    def unchanged(self, bandwidth: DataArray) -> DataArray:
        """largest relative change of a drive's bandwidth by an observer of 5 kHz, no u_p"""
        return abs(changes(bandwidth)).sel(observer=list(FAST), seen=SEEN[2]).max()

    @check(title="found otherwise", at_most=1e-6)
    def again(self, bandwidth: DataArray, radius: DataArray) -> float:
        """largest relative difference of |T| from -3 dB at a bandwidth, or of a spectral radius"""
        import control

        worst, drives = 0.0, sampled_drives(self.axis, self.gain, self.delay)
        for (o, s), K in every_law(self.axis).items():
            for name, P in drives.items():
                at = {"observer": o, "seen": s, "drive": name}
                closed = control.feedback(P * K, 1)
                gain = abs(loop_response(closed, bandwidth.sel(at).values.reshape(1))[0])
                pole = abs(closed.poles()).max() / float(radius.sel(at))
                worst = max(worst, abs(gain * 2**0.5 - 1.0), abs(pole - 1.0))
        return worst

    # --- what is told -------------------------------------------------------------------------

    largest_change = metric(
        template="largest_change_{observer}_{seen}",
        value=lambda bandwidth: abs(changes(bandwidth)).drop_sel(observer="none").max("drive"),
    )
    nominal_change = metric(
        template="nominal_change_{observer}_{seen}",
        value=lambda bandwidth: changes(bandwidth).drop_sel(observer="none").sel(drive="nominal"),
    )
    unstable_drives = metric(
        template="unstable_drives_{observer}_{seen}",
        value=lambda radius: (radius.drop_sel(drive="nominal") >= 1.0).sum("drive"),
    )
    nominal_bandwidth_hz = metric(
        template=lambda bandwidth: bandwidth.sel(observer="none", seen=SEEN[0], drive="nominal")
    )

    @table
    def bandwidths(self, bandwidth: DataArray, radius: DataArray) -> Any:
        """Bandwidth of T: nominal, and over twelve drives."""
        twelve, change = bandwidth.drop_sel(drive="nominal"), changes(bandwidth)
        rows = []
        for o in OBSERVERS:
            for s in SEEN if o != "none" else SEEN[:1]:
                at = {"observer": o, "seen": s}
                one, off = twelve.sel(at), change.sel(at)
                cells = [f"{float(bandwidth.sel(at).sel(drive='nominal')):.0f}"]
                cells.append(f"{float(one.min()):.0f} to {float(one.max()):.0f}")
                cells.append(f"{float(off.min()):+.1%} to {float(off.max()):+.1%}")
                unstable = int((radius.sel(at).drop_sel(drive="nominal") >= 1).sum())
                rows.append([o, s, *cells, f"{unstable}"])
        heads = ["observer", "the controller sees", "nominal [Hz]", "twelve drives [Hz]"]
        return [*heads, "change", "unstable of twelve"], rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        drawn, panels = figures.axes(1, 3, size=(10.0, 3.8), sharey=True)
        for panel, one in zip(panels, SEEN, strict=True):
            for name, colour in zip(OBSERVERS, ("k", *figures.CYCLE), strict=False):
                size = answer["T"].sel(observer=name, seen=one)
                style: Any = {"color": colour, "label": name, "linewidth": 1.2}
                panel.semilogx(FREQUENCY, 20 * np.log10(size), **style)
            panel.axhline(-20 * np.log10(2**0.5), color="0.4", linewidth=0.8, linestyle=":")
            panel.set_ylim(-20.0, 10.0)
            figures.label(panel, x="frequency [Hz]", y="", title=f"seen: {one}")
        figures.label(panels[0], y=f"|T|, {self.axis}, nominal [dB]")
        figures.legend_below(drawn, panels[0], columns=5)
        return {"complementary-sensitivity": drawn}


def changes(bandwidth: DataArray) -> DataArray:
    """Relative change of the bandwidth from that of the same drive without an observer."""
    alone = bandwidth.sel(observer="none", drop=True)
    return bandwidth / alone - 1.0


def sampled_drives(axis: Axis, gain: Gain = "own", delay: float = 1.0) -> dict[str, StateSpace]:
    """u [V] -> f_en [units] of every drive, including hold and delay [samples]."""
    every = plants(axis, gain, "printed")
    return {name: sampled_model(one, PERIOD, delay_samples=delay) for name, one in every.items()}


def every_law(axis: Axis) -> dict[tuple[str, str], StateSpace]:
    """f_en -> u, by observer and input of the controller."""
    every: dict[str, Estimator | None] = {"none": None}
    every |= observers(axis)
    return {(o, s): law(axis, one, s) for o, one in every.items() for s in SEEN}


def observers(axis: Axis) -> dict[str, Estimator]:
    """Observers of the nominal drive, which know the disc's rotation."""
    rotation = Rotation(ROTATION)
    return {
        "thesis": thesis_estimator(axis, rotation),
        "ITAE 5 kHz": itae(axis, rotation, FAST_BANDWIDTH),
        "ITAE 300 Hz": itae(axis, rotation, SLOW_BANDWIDTH),
        "Kalman": kalman(axis, rotation).steady_state,
    }


def prototype_changes(axis: Axis, kind: Prototype) -> RealArray:
    """Relative change of each drive's bandwidth by an observer of 5 kHz with a prototype's poles.

    The controller gets its estimate, and no u_p is added.
    """
    observer = of_prototype(kind, axis, Rotation(ROTATION), FAST_BANDWIDTH)
    without, with_ = (law(axis, one, SEEN[2]) for one in (None, observer))
    drives = sampled_drives(axis).values()
    found = [bandwidths(P * with_)["T"] / bandwidths(P * without)["T"] - 1 for P in drives]
    return np.array(found)


def law(axis: Axis, observer: Estimator | None, seen: str) -> StateSpace:
    """f_en -> u: the controller, with f_en or its estimate as input, plus u_p of an observer."""
    import control

    K = discrete_system(controller(axis), PERIOD)
    if observer is None:
        return control.ss(K)
    last = control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]], PERIOD)
    told = ["estimate", "e_hat", "x_hat", "u_p"]
    joined = generalised_plant(
        [
            (observer.system(), ["f_en", "u_last"], told),
            (last, "u", "u_last"),
            (K, "f_en" if seen == SEEN[0] else "estimate", "u_k"),
        ],
        {"u": "u_k" if seen == SEEN[2] else "u_k + u_p"},
        exogenous="f_en",
        performance="u",
    )
    return joined.system


def closed_radius(L: StateSpace) -> float:
    """Largest modulus of a pole of the loop closed around L with negative feedback."""
    poles = np.linalg.eigvals(L.A - L.B @ np.linalg.solve(np.eye(1) + L.D, L.C))
    return float(abs(poles).max())


def _closed(L: Any) -> RealArray:
    return np.abs(L / (1 + L))
