"""The least ratio of disturbances to faults in a residual, over all filters (equation 7.23).

    f_en = K_optn (ACT u + W_p w_p + W_sd w_sd),   r = H (f_en - K_optn ACT u)      eq. 7.7, 7.21

Equation 7.23 has H_photo W_p over H_act W_sd. The gain from the fault to r is H_photo K_optn W_sd,
as in equation 7.10, so the denominator is corrected here. With one measured error both have the
factor H: at each frequency the ratio is |W_p / W_sd|, whatever the filter. Norms over a range of
frequencies weight these ratios by the filter, and none is below the least of them. Equation numbers
refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import figures, problem
from workbench.certificate import Checker
from workbench.diagnosis import (
    FaultModel,
    PerformanceIndex,
    index_checker,
    performance_index,
)
from workbench.errors import InputError
from workbench.study import (
    Study,
    answers,
    array,
    arrays,
    check,
    dim,
    figure,
    metric,
    part,
    system,
    table,
)
from workbench.systems import realisation, response
from workbench.types import DataArray, Dataset, Figure, RealArray, StateSpace

from ..control.control_problem import optical_gain, performance_weight
from ..drive.plants import nominal_parameters, nominal_response, plant, total_gain
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis
from .fault_filter.peers import M, defect_weight
from .stand_in import low_pass

Filters = dict[str, StateSpace]
"""H by name."""
RATIO: dict[str, Any] = {"disturbances": ["w_p"], "faults": ["w_sd"]}
"""Inputs in the numerator and the denominator of equation 7.23."""
WIDTHS = (0.3, 0.1, 0.03, 0.01)
"""Damping ratios of band-passes at the frequency of the least ratio; narrower ones are better."""
BROAD = ("all frequencies", "low-pass", "high-pass")
"""Filters that were not designed for the index."""
FILTERS = (*BROAD, *(f"band-pass {one:g}" for one in WIDTHS))
"""Filters by name."""
NORMS = ("H2", "H-infinity")
"""Norms over the range whose ratios are computed."""
INDEX_WIDTH = 1e-3
"""Relative width of the certified interval of an index."""
REACHED = 1.05
"""Largest accepted ratio of norms of the narrowest filter, over the lower bound for every filter.
"""
POINTS = 4001
"""Number of frequencies over which norms are computed, and again near the narrow filters'
frequency.
"""


@problem("cd/{axis}/residual-index", axis=("focus", "radial"), data=TABLES)
def residual_index(
    axis: Axis,
    low_hz: Annotated[float, Field(gt=0, le=1e5)] = 10.0,
    high_hz: Annotated[float, Field(gt=0, le=1e5)] = 10e3,
) -> ResidualIndex:
    """Disturbances over faults in the residual, and the filter that has least of it (eq. 7.23).

    The ratio at its worst frequency is certified for several filters, and is the same for all. The
    ratio of norms over the range has a certified lower bound for every filter, the least ratio at
    any frequency; band-passes at that frequency come close to it.

    low_hz, high_hz: range of frequencies [Hz].
    """
    if not low_hz < high_hz:
        raise InputError(f"low_hz = {low_hz} must be below high_hz = {high_hz}")
    return ResidualIndex(axis, low_hz, high_hz)


@dataclass(frozen=True)
class ResidualIndex(Study):
    """The index of several filters, and its bound."""

    axis: Axis
    low_hz: float
    high_hz: float

    headline: ClassVar[str] = "narrowest_over_bound"

    @property
    def quantifier(self) -> str:
        return f"from {self.low_hz:g} to {self.high_hz:g} Hz"

    @property
    def band(self) -> tuple[float, float]:
        """Ends of the range [rad/s]."""
        return 2 * np.pi * self.low_hz, 2 * np.pi * self.high_hz

    @part
    def model(self) -> FaultModel:
        """Equation 7.21 with the nominal drive: u, w_p, w_sd -> f_en."""
        return weighted_model(self.axis)

    bound, norm = dim("lower", "upper"), dim(NORMS)
    filter = dim(FILTERS)
    frequency = dim(
        lambda self: np.geomspace(self.low_hz, self.high_hz, 400), unit="Hz", meaning="frequency"
    )

    @answers
    def swapped(self, model: FaultModel) -> dict[str, PerformanceIndex]:
        """Largest ratio of faults to disturbances."""
        return {"all frequencies": performance_index(*self._swapped(model))}

    @swapped.checkers
    def of_the_swapped(self, model: FaultModel) -> dict[str, Checker]:
        """Checker that certifies this ratio."""
        return {"all frequencies": index_checker(*self._swapped(model))}

    def _swapped(self, model: FaultModel) -> tuple[Any, ...]:
        """Filter, model with faults and disturbances exchanged, and range."""
        other = FaultModel(model.system, controls=("u",), disturbances=("w_sd",), faults=("w_p",))
        return residual_of(pass_all(), self.axis), other, self.band

    @arrays((), least_bound="1", least_hz="Hz")
    def least(self, swapped: dict[str, PerformanceIndex]) -> dict[str, float]:
        """Lower bound on every filter's ratio of norms, and the frequency of the least ratio."""
        found = swapped["all frequencies"]
        at = float(found.omega[0]) / (2 * np.pi)
        return {"least_bound": 1.0 / float(found.upper[0]), "least_hz": at}

    @system(filter, called="{}")
    def filters(self, least_hz: DataArray) -> Filters:
        """H by name."""
        import control

        slow = control.ss(low_pass())
        at, s = 2 * np.pi * float(least_hz), control.tf("s")
        narrow = [2 * z * at * s / (s**2 + 2 * z * at * s + at**2) for z in WIDTHS]
        every = [pass_all(), slow, 1 - slow, *map(control.ss, narrow)]
        return dict(zip(FILTERS, every, strict=True))

    @answers
    def ratio_indices(self, filters: Filters, model: FaultModel) -> dict[str, PerformanceIndex]:
        """Largest ratio of disturbances to faults by filter."""
        return {
            name: performance_index(residual_of(H, self.axis), model, self.band, **RATIO)
            for name, H in filters.items()
        }

    @ratio_indices.checkers
    def of_the_filters(self, filters: Filters, model: FaultModel) -> dict[str, Checker]:
        """Checker that certifies each ratio."""
        return {
            name: index_checker(residual_of(H, self.axis), model, self.band, **RATIO)
            for name, H in filters.items()
        }

    index = array(dims=(filter, bound), unit="1", meaning="ratio at its largest over the range")(
        lambda ratio_indices: [
            (float(one.lower[0]), float(one.upper[0])) for one in ratio_indices.values()
        ]
    )

    @array(dims=(filter, norm), unit="1", meaning="ratio of norms over the range")
    def ratio(self, filters: dict[str, StateSpace], least_hz: DataArray) -> list[list[float]]:
        grid = self.grid(float(least_hz))
        return [ratios_of_norms(self.axis, H, grid) for H in filters.values()]

    @arrays(frequency, pointwise="1", printed="V/unit")
    def ratios(self, frequency: DataArray) -> dict[str, RealArray]:
        """|W_p / W_sd|, and the same as printed in equation 7.23, divided also by |K_optn ACT|."""
        disturbance, defect = weights(self.axis, frequency.values)
        ratio = disturbance / defect
        gain = abs(nominal_response(self.axis, frequency.values, antialiasing=False))
        return {"pointwise": ratio, "printed": ratio / gain}

    def grid(self, at: float) -> RealArray:
        """Frequencies [Hz] over which norms are taken, dense about one."""
        about = at * (1.0 + np.concatenate([-(one := np.geomspace(1e-6, 1.0, POINTS)), one]))
        every = np.concatenate([np.geomspace(self.low_hz, self.high_hz, POINTS), about, [at]])
        return np.unique(every[(every >= self.low_hz) & (every <= self.high_hz)])

    # --- checks -------------------------------------------------------------------------------

    @check(title="one index", at_most=2 * INDEX_WIDTH)
    def alike(self, index: DataArray) -> float:
        """largest certified index of a filter over the least, less 1"""
        return float(index.sel(bound="upper").max() / index.sel(bound="lower").min() - 1.0)

    @check(title="bound", at_most=1.0 + 1e-6)
    def kept(self, ratio: DataArray, least_bound: DataArray) -> DataArray:
        """bound over the least ratio of norms of a filter"""
        return least_bound / ratio.min()

    @check(title="bound at frequencies", at_most=1.0 + 1e-6)
    def at_frequencies(self, pointwise: DataArray, least_bound: DataArray) -> DataArray:
        """bound over the least ratio at the frequencies shown, from the weights alone"""
        return least_bound / pointwise.min()

    @check(title="reached", at_most=REACHED)
    def reached(self, ratio: DataArray, least_bound: DataArray) -> DataArray:
        """ratio of norms of the narrowest filter over the bound for every filter"""
        return ratio.isel(filter=-1) / least_bound

    # --- what is told -------------------------------------------------------------------------

    @metric
    def ratios_told(self, answer: Dataset) -> dict[str, Any]:
        index, ratio, bound = answer["index"], answer["ratio"], answer["least_bound"]
        printed = answer["printed"] / answer["pointwise"]
        return {
            "worst_frequency_index": index.sel(bound="upper").max(),
            "spread_of_index": index.sel(bound="lower").max() / index.sel(bound="lower").min() - 1,
            "least_bound": bound,
            "least_hz": answer["least_hz"],
            "narrowest_over_bound": (ratio.isel(filter=-1) / bound).max(),
            "all_frequencies_over_bound_H2": ratio.sel(filter=BROAD[0], norm="H2") / bound,
            "high_pass_over_bound_H2": ratio.sel(filter="high-pass", norm="H2") / bound,
            "printed_over_mended_varies": printed.max() / printed.min(),
            "printed_least_hz": answer["frequency"].values[answer["printed"].values.argmin()],
        }

    @table
    def indices(self, answer: Dataset) -> Any:
        """Each filter: the ratio at its worst frequency, and the ratios of norms."""
        rows = [
            [
                name,
                f"{float(answer['index'].sel(filter=name, bound='upper')):.5g}",
                *(f"{float(answer['ratio'].sel(filter=name, norm=n)):.4g}" for n in NORMS),
            ]
            for name in answer["filter"].values.tolist()
        ]
        rows.append(["no filter below", "", *2 * [f"{float(answer['least_bound']):.4g}"]])
        return ["filter", "largest over the range", *(f"ratio of {n} norms" for n in NORMS)], rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        drawn, (left, right) = figures.axes(1, 2, size=(9.5, 4.0))
        frequency = answer["frequency"].values
        left.loglog(frequency, answer["pointwise"], color=figures.BLUE, label="every filter")
        label = "as printed [V/unit]"
        left.loglog(frequency, answer["printed"], color=figures.ORANGE, label=label)
        left.axhline(
            float(answer["least_bound"]), color="k", linestyle=":", label="no filter below"
        )
        figures.label(
            left,
            x="frequency [Hz]",
            y="disturbances / faults [1]",
            title=f"{self.axis}, equation 7.23",
        )
        names = answer["filter"].values.tolist()
        for n, norm in enumerate(NORMS):
            value = answer["ratio"].sel(norm=norm) / answer["least_bound"]
            colour = (figures.SKY, figures.GREEN)[n]
            left.plot([], [], "o", color=colour, label=f"{norm} norms")
            right.plot(value, np.arange(len(names)), "o", color=colour)
        right.axvline(1.0, color="k", linestyle=":")
        right.set_xscale("log")
        right.set_yticks(np.arange(len(names)), names)
        right.invert_yaxis()
        figures.label(right, x="ratio of norms over the bound [1]")
        figures.legend_below(drawn, left, columns=5)
        return {"index": drawn}


def weighted_model(axis: Axis) -> FaultModel:
    """Equation 7.21 with the nominal drive, without uncertainty: u, w_p, w_sd -> f_en."""
    G = plant(nominal_parameters(axis), total_gain(axis), antialiasing=False)
    K_optn = optical_gain(axis)
    W_p, W_sd = K_optn * performance_weight(axis), K_optn * M * defect_weight()
    from scipy.linalg import block_diag

    system = realisation(
        (
            block_diag(G.A, W_p.A, W_sd.A),
            block_diag(G.B, W_p.B, W_sd.B),
            np.hstack([G.C, W_p.C, W_sd.C]),
            np.hstack([G.D, W_p.D, W_sd.D]),
        ),
        0.0,
        inputs=["u", "w_p", "w_sd"],
        outputs=["f_en"],
    )
    return FaultModel(system, controls=("u",), disturbances=("w_p",), faults=("w_sd",))


def residual_of(H: StateSpace, axis: Axis) -> StateSpace:
    """Q of r = Q [f_en; u] = H (f_en - K_optn ACT u)."""
    G = plant(nominal_parameters(axis), total_gain(axis), antialiasing=False)
    beside = realisation((G.A, np.hstack([0.0 * G.B, G.B]), -G.C, np.array([[1.0, 0.0]])), 0.0)
    return H * beside


def pass_all() -> StateSpace:
    """H = 1."""
    empty = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.eye(1)
    return realisation(empty, 0.0)


def weights(axis: Axis, frequency: RealArray) -> tuple[RealArray, RealArray]:
    """|W_p| and |W_sd| (F,) at frequencies [Hz]."""
    omega = 2 * np.pi * frequency
    both = performance_weight(axis), M * defect_weight()
    disturbance, defect = (np.abs(response(one, omega)[:, 0, 0]) for one in both)
    return disturbance, defect


def ratios_of_norms(axis: Axis, H: StateSpace, frequency: RealArray) -> list[float]:
    """|H W_p| over |H W_sd| in each of NORMS over the range of the frequencies [Hz]."""
    gain = abs(response(H, 2 * np.pi * frequency)[:, 0, 0])
    top, base = (gain * one for one in weights(axis, frequency))
    energy = [float(np.trapezoid(one**2, frequency)) ** 0.5 for one in (top, base)]
    return [energy[0] / energy[1], float(top.max() / base.max())]
