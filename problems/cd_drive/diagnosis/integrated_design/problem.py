"""Controller and fault filter from one synthesis, or one after the other (section 7.1.5).

Section and equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003); the classes are those of J. Stoustrup, M. Grimble, H. Niemann, Sensor Review 17
(1997) 138-149.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from workbench import Check, figures, problem, solve
from workbench.certificate import EVERY_FREQUENCY
from workbench.certify import certified_norm, stability_check
from workbench.errors import SolverError
from workbench.study import Study, array, arrays, check, dim, figure, metric, part, system, table
from workbench.synthesis import HinfController, HinfSynthesis
from workbench.systems import response
from workbench.types import DataArray, Dataset, Figure, RealArray, StateSpace
from workbench.uncertainty import GeneralisedPlant

from ...drive.plants import controller, total_gains
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, drives
from .plants import (
    carried_over,
    channel_norm,
    control_plant,
    drive,
    filter_plant,
    joint_plant,
    weights,
)
from .robust import least_robust

FACTORS = {"mu-PID": 1.0, "a third of it": 1 / 3, "1.5 times it": 1.5}
"""Factors on the gain of the reference controller."""
CONTROLLERS = (*FACTORS, "H-infinity")
"""Controllers for whose loops filters are designed; the last has the least H-infinity norm."""
SHARES = (1.0, 3.0)
"""Weights of the estimation error in the joint synthesis."""
BOTH = ("control", "estimate")
"""The judged norms: of (d, n) -> (z_p, z_u), and of (d, n, f) -> z_f."""
FREQUENCY = np.geomspace(500.0, 15e3, 24)
"""Frequencies [Hz] of the defects."""
LEVELS_AGREE = 1e-3
"""Largest accepted difference between the least levels of different methods, relative."""
CARRIED = 2e-4
"""Largest accepted difference between the norms of one filter, carried over to another controller,
relative: twice the tolerance of `certified_norm`.
"""
COUPLED = 1.1
"""Least ratio of the robust errors with two controllers from which the designs count as coupled."""


@problem("cd/{axis}/integrated-design", axis=("focus", "radial"), data=TABLES)
def integrated_design(axis: Axis) -> IntegratedDesign:
    """Controller and fault filter designed in one, and one after the other (section 7.1.5).

    For the nominal drive are computed: the least H-infinity norm of the control loop alone, that of
    the estimate with each of four controllers, and both norms for controllers and filters from one
    synthesis. A filter for one controller can be converted for the loop of another with the same
    norm, so no choice of the controller makes the estimate better. With a multiplicative
    uncertainty as large as the spread of the twelve drives' gains this is no longer so: for each
    controller, the least error of any filter at a frequency is bounded from both sides.
    """
    return IntegratedDesign(axis)


@dataclass(frozen=True)
class IntegratedDesign(Study):
    """Designs of controller and filter, separately and jointly."""

    axis: Axis

    headline: ClassVar[str] = "carried_over_spread"

    @property
    def quantifier(self) -> str:
        return "for these controllers"

    design, share, judged_by = dim(CONTROLLERS), dim(SHARES), dim(BOTH)
    bound = dim("lower", "upper")
    frequency = dim(FREQUENCY, unit="Hz")

    @part
    def alone(self) -> HinfController:
        """The controller with the least norm."""
        return least(control_plant(self.axis))

    @system(design, called="{}")
    def laws(self, alone: HinfController) -> dict[str, StateSpace]:
        """K by name, in units of the allowed leakage."""
        import control

        K = control.ss(controller(self.axis))
        return {name: factor * K for name, factor in FACTORS.items()} | {CONTROLLERS[-1]: alone.K}

    @part
    def beside(self, laws: dict[str, StateSpace]) -> dict[str, HinfController]:
        """The filter with the least norm for each controller."""
        return {name: least(filter_plant(self.axis, K)) for name, K in laws.items()}

    filter = system(called="filter")(lambda beside: next(iter(beside.values())).K)
    level = array(
        dims=design, unit="1", meaning="level of the estimate below which no filter was found"
    )(lambda beside: [one.least for one in beside.values()])
    level_alone = array(
        dims=(), unit="1", meaning="level of control below which no controller was found"
    )(lambda alone: alone.least)

    @arrays(design, control_norm="1", carried="1")
    def norms(self, laws: dict[str, StateSpace], filter: StateSpace) -> dict[str, list[float]]:
        """Certified norms of control, and of the first filter carried over."""
        return {
            "control_norm": [
                certified_norm(control_plant(self.axis).close(K)) for K in laws.values()
            ],
            "carried": list(self.norms_of_carried(laws, filter).values()),
        }

    def norms_of_carried(self, laws: dict[str, StateSpace], filter: StateSpace) -> dict[str, float]:
        """Certified norms of the estimate with each controller, by one filter carried over."""
        first = next(iter(laws.values()))
        return {
            name: certified_norm(
                filter_plant(self.axis, K).close(carried_over(self.axis, filter, first, K))
            )
            for name, K in laws.items()
        }

    @part
    def together(self) -> list[StateSpace]:
        """Loops with controllers and filters from one synthesis."""
        plants = [joint_plant(self.axis, share) for share in SHARES]
        return [plant.close(least(plant).K) for plant in plants]

    @array(dims=(share, judged_by), unit="1", meaning="certified norms of one synthesis")
    def joint(self, together: list[StateSpace]) -> list[list[float]]:
        return [
            [channel_norm(one, [0, 1], [0, 1]), channel_norm(one, [2], [0, 1, 2]) / share]
            for one, share in zip(together, SHARES, strict=True)
        ]

    spread = array(
        dims=(),
        unit="1",
        meaning="half-range of the twelve drives' gains",
        value=lambda self: self.gains(),
    )

    def gains(self) -> float:
        """Half-range of the drives' gains over their middle."""
        every = drives(self.axis)
        gain = total_gains(self.axis, every, [one.K_optn for one in every])
        return float((gain.max() - gain.min()) / (gain.max() + gain.min()))

    @array(
        dims=(design, frequency, bound), unit="1", meaning="least robust error over the nominal one"
    )
    def robust(self, laws: dict[str, StateSpace], spread: DataArray) -> list[Any]:
        return [robust_errors(self.axis, K, float(spread)) for K in laws.values()]

    # --- checks -------------------------------------------------------------------------------

    @check(over=EVERY_FREQUENCY)
    def carried_again(
        self, laws: dict[str, StateSpace], filter: StateSpace, carried: DataArray
    ) -> list[Check]:
        """Norms of the stored filter, carried over and computed again; the loops are stable."""
        again = np.array(list(self.norms_of_carried(laws, filter).values()))
        off = float(abs(again / carried.values - 1.0).max())
        apart = float(again.max() / again.min() - 1.0)
        stated = "largest relative difference from the stored norm"
        found = [
            Check("carried over, again", stated, off, CARRIED),
            Check(
                "carried over",
                "largest norm beside a controller over the least, less 1",
                apart,
                CARRIED,
            ),
        ]
        for name, K in laws.items():
            stable = stability_check(control_plant(self.axis).close(K))
            found.append(
                Check(f"{name}: {stable.name}", stable.statement, stable.value, stable.limit)
            )
        return found

    @check(title="levels", at_most=LEVELS_AGREE)
    def levels(self, level: DataArray) -> DataArray:
        """largest level of a filter beside a controller over the least, less 1"""
        return level.max() / level.min() - 1.0

    @check(title="near the level", at_most=2 * LEVELS_AGREE)
    def near(self, carried: DataArray, level: DataArray) -> DataArray:
        """certified norm of the filter over the least level beside any controller, less 1"""
        return carried.max() / level.min() - 1.0

    @check(title="one synthesis", at_most=1.0 + LEVELS_AGREE)
    def no_better(self, joint: DataArray, level: DataArray, level_alone: DataArray) -> float:
        """least level of control or estimate over the norm in one synthesis, at most"""
        control, estimate = (joint.sel(judged_by=one) for one in BOTH)
        return float(max((level_alone / control).max(), (level.min() / estimate).max()))

    @check(title="bounds", at_most=1e-3)
    def closed(self, robust: DataArray) -> DataArray:
        """upper over lower bound of a robust error, less 1"""
        return (robust.sel(bound="upper") / robust.sel(bound="lower") - 1.0).max()

    @check(title="coupled", at_most=1.0 / COUPLED)
    def coupled(self, robust: DataArray) -> float:
        """least robust error beside a third of the mu-PID over that beside it, at one frequency"""
        return 1.0 / float(self.coupling_of(robust)["pid_over_third"])

    # --- what is told -------------------------------------------------------------------------

    carried_over_spread = metric(lambda carried: carried.max() / carried.min() - 1.0)
    level_spread = metric(lambda level: level.max() / level.min() - 1.0)

    @metric
    def separate_and_joint(self, answer: Dataset) -> dict[str, Any]:
        best = answer["control_norm"].sel(design=CONTROLLERS[-1])
        joint = answer["joint"]
        return {
            "control_alone": best,
            "estimate_alone": answer["carried"].max(),
            "joint_over_separate_control": (joint.sel(judged_by="control") / best).min(),
            "joint_over_separate_estimate": (
                joint.sel(judged_by="estimate") / answer["carried"].max()
            ).min(),
        }

    coupling = metric(lambda self, robust: self.coupling_of(robust))

    def coupling_of(self, robust: DataArray) -> dict[str, Any]:
        """Least ratio of the robust errors that the bounds prove, at the worst frequency."""
        lower, upper = (robust.sel(bound=one, drop=True) for one in ("lower", "upper"))
        pid, best = CONTROLLERS[0], CONTROLLERS[-1]
        return {
            "pid_over_hinf": (lower.sel(design=pid) / upper.sel(design=best)).max(),
            "pid_over_third": (lower.sel(design=pid) / upper.sel(design="a third of it")).max(),
            "hinf_over_third": (lower.sel(design=best) / upper.sel(design="a third of it")).max(),
        }

    gain_spread = metric(lambda spread: spread)

    @table
    def designs(self, answer: Dataset) -> Any:
        """Controllers, norms of control and of the estimate, and the worst robust error."""
        worst = answer["robust"].sel(bound="upper").max("frequency")
        rows = [
            [
                name,
                f"{float(answer['control_norm'].sel(design=name)):.4f}",
                f"{float(answer['carried'].sel(design=name)):.4f}",
                f"{float(worst.sel(design=name)):.2f}",
            ]
            for name in CONTROLLERS
        ]
        for share in SHARES:
            control, estimate = answer["joint"].sel(share=share).values
            rows.append(
                [f"one synthesis, weight {share:g}", f"{control:.4f}", f"{estimate:.4f}", ""]
            )
        heads = ["controller", "control", "estimate", "robust error over nominal, worst"]
        return heads, rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        drawn, (left, right) = figures.axes(1, 2, size=(9.5, 4.0))
        for n, name in enumerate(CONTROLLERS):
            colour = figures.CYCLE[n]
            one = answer.sel(design=name)
            left.plot(one["control_norm"], one["carried"], "o", color=colour, label=name)
            lower, upper = one["robust"].transpose("bound", ...).values
            right.semilogx(FREQUENCY, upper, color=colour)
            right.semilogx(FREQUENCY, lower, ":", color=figures.BLACK, linewidth=0.8)
        joint = answer["joint"].transpose("judged_by", ...).values
        left.plot(*joint, "x", color=figures.BLACK, label="one synthesis")
        figures.label(
            left,
            x="norm of control [1]",
            y="norm of the estimate's error [1]",
            title=f"{self.axis}",
        )
        left.set_ylim(0.0, 1.2 * max(joint[1].max(), float(answer["carried"].max())))
        words = "least robust error over nominal [1]"
        figures.label(
            right, x="frequency [Hz]", y=words, title="gains as uncertain as of twelve drives"
        )
        figures.legend_below(drawn, left, columns=5)
        return {"designs": drawn}


def least(plant: GeneralisedPlant) -> HinfController:
    """The controller of nearly the least norm, by two Riccati equations.

    Raises SolverError if its certificate does not hold.
    """
    solution = solve(HinfSynthesis(plant), method="riccati")
    if solution.answer is None or not (solution.certificate and solution.certificate.holds):
        raise SolverError(f"H-infinity synthesis: {solution.message}")
    answer: HinfController = solution.answer
    return answer


def robust_errors(axis: Axis, K: StateSpace, spread: float) -> RealArray:
    """Bounds (F, 2) on the least robust error, over that without uncertainty."""
    omega = 2 * np.pi * FREQUENCY
    fault, disc = (np.abs(response(one, omega)[:, 0, 0]) for one in weights(axis))
    L = response(drive(axis), omega)[:, 0, 0] * response(K, omega)[:, 0, 0]
    nominal = fault * disc / np.hypot(fault, disc)
    found = [
        least_robust(float(a), float(b), complex(T), spread)
        for a, b, T in zip(fault, disc, L / (1 + L), strict=True)
    ]
    return np.array(found) / nominal[:, None]
