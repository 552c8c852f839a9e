"""Mixed and complex mu of the two masses with a simple controller."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import figures, problem
from workbench.certificate import THIS_SYSTEM
from workbench.mu import (
    Conditions,
    PeakChecker,
    Sweep,
    condition_systems,
    conditions,
    frequency_sweep,
    upper_bound,
)
from workbench.structure import Structure
from workbench.study import Study, answers, array, check, dim, figure, metric, part
from workbench.types import Array, ComplexArray, DataArray, Dataset, Figure, StateSpace
from workbench.uncertainty import GeneralisedPlant

from .equations import characteristic_roots, determinant, real_spring_mu
from .plant import simple_controller, two_mass_plant

QUESTIONS = ("performance", "stability")
KINDS = ("mixed", "complex")
CHANNELS = 4
"""Channels of N: two of the perturbation, two of the performance."""
ORDER_SLACK = 1e-6
"""Rounding error allowed when a lower bound is compared with an upper bound, relative."""
CONIC_DISTANCE = 1e-4
"""Largest accepted relative difference from the conic solver, which has a tolerance of its own."""
EXCESS_OVER_MU = 1e-3
"""Largest accepted excess of the bound over mu, relative. For one real and one complex scalar they
are equal.
"""
SMALL_MU = 1e-6
"""Smallest mu by which an excess is divided to make it relative."""
SINGULARITY = 1e-6
"""Largest |det(I - N Delta)| accepted as zero; without Delta the determinant is 1."""
SPRINGS = 201
"""Number of springs between 1.2 and 2.8 N/m for which the loop is checked to be stable."""
AT_CASE, AT_PEER = "{kind} {question}", "at {peer_omega:.4g}"
"""Templates that name the place of a check's largest value."""
SHOWN, LEAST_SHOWN = (1e-2, 1e2), 1e-5
"""Range of the frequencies [rad/s] in the figure, and the smallest mu shown."""
Case = tuple[str, str]
"""A question and a kind of spring."""


@problem("mass-spring/analysis")
def analysis(
    peak_width: Annotated[float, Field(gt=0, lt=0.5)] = 1e-3,
    peers: Annotated[int, Field(ge=1)] = 12,
) -> Analysis:
    """Robust performance and stability of two masses with a real and with a complex spring.

    Bounds of mu over frequency, and peaks certified over all frequencies, for the controller u =
    0.005 s / (s + 0.1) y. The uncertain spring is a real scalar; if it is replaced by a complex
    one, the bounds are those of an analysis that knows no real uncertainty.

    peak_width: relative width of the certified interval of a peak. peers: number of frequencies at
    which CVXPY with Clarabel computes the upper bound again.
    """
    return Analysis(peak_width, peers)


@dataclass(frozen=True)
class Analysis(Study):
    """mu over frequency [rad/s] and its certified peaks."""

    peak_width: float
    peers: int

    headline: ClassVar[str] = "peak_mixed"

    @property
    def quantifier(self) -> str:
        return "at the frequencies of the sweep"

    @part
    def plants(self) -> dict[str, GeneralisedPlant]:
        """The generalised plant, by kind of spring."""
        plant = two_mass_plant()
        assert plant.structure is not None
        complex_ = replace(plant, structure=plant.structure.complexified())
        return {"mixed": plant, "complex": complex_}

    @part
    def found(self, plants: dict[str, GeneralisedPlant]) -> dict[str, Conditions]:
        """Robustness conditions of the loop, by kind of spring."""
        K = simple_controller()
        return {
            kind: conditions(plant, K, tolerance=self.peak_width) for kind, plant in plants.items()
        }

    @answers
    def peaks(self, found: dict[str, Conditions]) -> dict[Case, Any]:
        """Certified peak of each case."""
        return {
            case: getattr(found[case[1]], f"robust_{case[0]}") for case in product(QUESTIONS, KINDS)
        }

    @peaks.checkers
    def of_the_cases(self, cases: Any) -> dict[Case, PeakChecker]:
        """Checker that certifies the peak of each case."""
        return {case: PeakChecker(*question) for case, question in cases.items()}

    @part
    def cases(self, plants: Any) -> dict[Case, tuple[StateSpace, Structure]]:
        """For each case the system that Delta closes, and the structure of Delta."""
        of = {kind: condition_systems(plant, simple_controller()) for kind, plant in plants.items()}
        return {case: of[case[1]][f"robust_{case[0]}"] for case in product(QUESTIONS, KINDS)}

    @part
    def sweeps(self, cases: Any, omega: DataArray) -> dict[Case, Sweep]:
        """Bounds of mu over frequency, for each case."""
        return {
            case: frequency_sweep(N, structure, omega=omega.values, lower="best")
            for case, (N, structure) in cases.items()
        }

    question, kind, bound = dim(*QUESTIONS), dim(*KINDS), dim("lower", "upper")

    @dim(unit="rad/s")
    def omega(self, cases: Any) -> Array:
        grids = [frequency_sweep(system, structure).omega for system, structure in cases.values()]
        omega = np.unique(np.concatenate(grids))
        return omega[(omega > 0) & np.isfinite(omega)]

    @part
    def peer_places(self, omega: DataArray) -> Array:
        """Indices of the frequencies at which the conic solver computes the bound again."""
        shown = np.flatnonzero((omega.values >= SHOWN[0]) & (omega.values <= SHOWN[1]))
        return shown[np.linspace(0, len(shown) - 1, self.peers).astype(int)]

    peer_omega = dim(lambda omega, peer_places: omega.values[peer_places], unit="rad/s")
    each = (question, kind)
    lower = array(
        dims=(*each, omega), unit="1", value=lambda sweeps: _grid(lambda c: sweeps[c].lower)
    )
    upper = array(
        dims=(*each, omega), unit="1", value=lambda sweeps: _grid(lambda c: sweeps[c].upper)
    )

    @array(dims=(*each, peer_omega), unit="1")
    def peer(self, sweeps: Any, cases: Any, peer_places: Array) -> list[Any]:
        return _grid(
            lambda case: (
                upper_bound(sweeps[case].M[peer_places], cases[case][1], method="clarabel").value
            )
        )

    peak = array(
        dims=(*each, bound),
        unit="1",
        meaning="bounds of the supremum of mu over all frequencies",
        value=lambda peaks: _grid(lambda case: (peaks[case].lower, peaks[case].upper)),
    )
    peak_omega = array(
        dims=each, unit="rad/s", value=lambda peaks: _grid(lambda case: peaks[case].omega)
    )
    Delta = array(
        dims=(*each, "row", "column"),
        unit="1",
        value=lambda peaks: _grid(lambda c: _padded(peaks[c].Delta)),
    )
    nominal_performance = array(
        dims=(), unit="1", value=lambda found: found["mixed"].nominal_performance.upper
    )
    pole = array(
        dims=(), unit="rad/s", meaning="rightmost pole", value=lambda found: found["mixed"].pole
    )

    # --- checks -------------------------------------------------------------------------------

    @check(
        title="nominal stability",
        statement="rightmost root of the loop [rad/s]",
        at_most=0.0,
        over=THIS_SYSTEM,
    )
    def nominal_stability(self) -> float:
        return characteristic_roots(0.0).real.max()

    @check(
        title="rightmost pole",
        statement="relative distance of the stored pole from the rightmost root of the loop",
        at_most=ORDER_SLACK,
        over=THIS_SYSTEM,
    )
    def pole_distance(self, pole: DataArray) -> float:
        roots = characteristic_roots(0.0)
        right, found = roots[np.argmax(roots.real)], complex(pole)
        return min(abs(found - right), abs(found - right.conjugate())) / abs(right)

    @check(
        title="every spring",
        statement="rightmost root over 1.2 to 2.8 N/m [rad/s]",
        at_most=0.0,
        over=f"for {SPRINGS} springs of the range",
    )
    def every_spring(self) -> float:
        return max(characteristic_roots(d).real.max() for d in np.linspace(-1, 1, SPRINGS))

    @check(
        title="lower below upper",
        statement="lower over upper bound",
        at_most=1 + ORDER_SLACK,
        where=f"{AT_CASE} at {{omega:.4g}}",
    )
    def order(self, lower: DataArray, upper: DataArray) -> DataArray:
        return lower / upper

    @check(
        title="real below complex",
        statement="mixed over complex upper bound",
        at_most=1 + ORDER_SLACK,
        where="{question} at {omega:.4g}",
    )
    def real_below_complex(self, upper: DataArray) -> DataArray:
        return upper.sel(kind="mixed", drop=True) / upper.sel(kind="complex", drop=True)

    @check(
        title="peaks",
        statement="bound at a frequency over the certified peak",
        at_most=1.0,
        where=AT_CASE,
    )
    def beyond_peak(self, upper: DataArray, peak: DataArray) -> DataArray:
        return upper.max("omega") / peak.sel(bound="upper")

    @check(
        title="conic bounds",
        statement="excess over Clarabel's bound, relative",
        at_most=CONIC_DISTANCE,
        where=AT_PEER,
    )
    def conic(self, upper: DataArray, peer: DataArray) -> DataArray:
        return _ratio_to_conic(upper, peer) - 1

    @check(
        title="conic bounds of performance",
        statement="distance from Clarabel's bound, relative",
        at_most=CONIC_DISTANCE,
        where=AT_PEER,
    )
    def conic_performance(self, upper: DataArray, peer: DataArray) -> DataArray:
        # If a spring alone can make the loop unstable, G grows beyond what the conic solver
        # resolves.
        return abs(_ratio_to_conic(upper, peer).sel(question="performance") - 1)

    @check(
        title="never below mu",
        statement="mu of stability over its bound",
        at_most=1 + ORDER_SLACK,
        where=AT_PEER,
    )
    def reached(self, upper: DataArray, peer_omega: DataArray) -> DataArray:
        return 1 / _ratio_to_mu(upper, peer_omega)

    @check(
        title="exact",
        statement=f"largest excess of the bound over mu, over the larger of mu and {SMALL_MU:g}",
        at_most=EXCESS_OVER_MU,
        where=AT_PEER,
    )
    def tight(self, upper: DataArray, peer_omega: DataArray) -> DataArray:
        mu = real_spring_mu(peer_omega.values)
        return (_ratio_to_mu(upper, peer_omega) - 1) * mu / np.maximum(mu, SMALL_MU)

    @check(
        title="singular",
        statement="|det(I - N Delta)| by the element equations",
        at_most=SINGULARITY,
        where=AT_CASE,
        over="at the frequency of each peak",
    )
    def singular(self, peak_omega: DataArray, Delta: DataArray) -> DataArray:
        rows = zip(peak_omega.values, Delta.values, strict=True)
        left = [[abs(determinant(float(w), D)) for w, D in zip(*row, strict=True)] for row in rows]
        return peak_omega.copy(data=left)

    @check(
        title="size of Delta",
        statement="times the lower bound, distance from 1",
        at_most=ORDER_SLACK,
        where=AT_CASE,
        over="at the frequency of each peak",
    )
    def size(self, peak: DataArray, Delta: DataArray) -> DataArray:
        """Distance from 1 of the product of the lower bound and the largest singular value of
        Delta.
        """
        norms = [[np.linalg.norm(one, 2) for one in row] for row in Delta.values]
        return abs(peak.sel(bound="lower") * np.array(norms) - 1)

    # --- metrics and figures ------------------------------------------------------------------

    @metric
    def of_cases(self, answer: Dataset) -> dict[str, float]:
        numbers = {}
        for question, after in (("performance", ""), ("stability", "_stability")):
            for kind in KINDS:
                one = answer.sel(question=question, kind=kind)
                for name, bound in (("peak", "upper"), ("peak_lower", "lower")):
                    numbers[f"{name}_{kind}{after}"] = float(one["peak"].sel(bound=bound))
                numbers[f"frequency_{kind}{after}_rad_s"] = float(one["peak_omega"])
        return numbers

    nominal = metric(
        template="nominal_performance", value=lambda nominal_performance: nominal_performance
    )
    rightmost_pole = metric("rightmost_pole_rad_s", value=lambda pole: pole.real)

    @figure
    def mu(self, answer: Dataset) -> Figure:
        figure, panels = figures.axes(2, 1, size=(7.0, 7.0), sharex=True)
        for panel, question in zip(panels, QUESTIONS, strict=True):
            # The mixed curves lie on or below the complex ones, so they are drawn last and thinner.
            for kind, colour, width in (
                ("complex", figures.ORANGE, 2.6),
                ("mixed", figures.BLUE, 1),
            ):
                one = answer.sel(question=question, kind=kind)
                look: Any = {"color": colour, "lw": width}
                lower = one["lower"].where(one["lower"] > 0)
                panel.plot(one["omega"], one["upper"], **look, label=f"{kind}, upper")
                panel.plot(one["omega"], lower, ":", **look, label=f"{kind}, lower")
            panel.axhline(1.0, color=figures.BLACK, lw=0.8)
            figures.label(panel, y=r"$\mu$", title=f"robust {question}", log="xy")
            panel.set_xlim(*SHOWN)
            panel.set_ylim(bottom=LEAST_SHOWN)
        figures.label(panels[-1], x=r"angular frequency $\omega$ [rad/s]")
        figures.legend_below(figure, panels[0])
        return figure


def _grid(value: Callable[[Case], Any]) -> list[list[Any]]:
    """A value for each case, in a table of questions by kinds."""
    return [[value((question, kind)) for kind in KINDS] for question in QUESTIONS]


def _padded(Delta: ComplexArray) -> ComplexArray:
    """Delta (CHANNELS, CHANNELS), padded by zeros for channels that it does not have."""
    found = np.zeros((CHANNELS, CHANNELS), complex)
    found[: len(Delta), : len(Delta)] = Delta
    return found


def _ratio_to_conic(upper: DataArray, peer: DataArray) -> DataArray:
    """The upper bound divided by the conic solver's, at the conic solver's frequencies."""
    return peer.copy(data=upper.sel(omega=peer["peer_omega"].values).values / peer.values)


def _ratio_to_mu(upper: DataArray, peer_omega: DataArray) -> DataArray:
    """The upper bound of robust stability divided by the exact mu for a real spring."""
    stability = upper.sel(question="stability", kind="mixed", omega=peer_omega.values)
    return peer_omega.copy(data=stability.values / real_spring_mu(peer_omega.values))
