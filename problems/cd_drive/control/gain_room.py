"""Range of the reference controller's gain in which robust performance is kept (section 6.4).

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np

from workbench import Run, figures, problem, ref
from workbench.certificate import EVERY_PERTURBATION
from workbench.executor import Context
from workbench.mu import GainRoom, Peak, PeakChecker, RoomChecker, gain_room, performance_peak
from workbench.study import Study, answers, array, check, dim, figure, metric, part, table
from workbench.types import DataArray, Figure, RealArray
from workbench.uncertainty import GeneralisedPlant

from ..drive.plants import controller
from ..drive.shared_parameters import TABLES, Frequencies
from ..drive.tables import Axis
from .control_problem import generalised
from .design import CoverMethod, uncertainty
from .loop_weights import CHANNELS

FORMS = ("parametric", "circle", "stadium")
FACTORS = np.round(np.geomspace(0.4, 2.5, 13), 6)
"""Factors on the gain for which peaks are drawn; the middle one is 1."""
ENDS = ("below", "low", "high", "above")
"""Names of the factors: proven to lose robust performance, to keep it, to keep it, and to lose it.
"""
EDGE_TOLERANCE = 1e-3
"""Relative width of the interval between a factor that keeps and one that loses robust performance.
"""
CURVE_TOLERANCE = 1e-3
"""Relative width of the interval that certifies a peak of the curve."""
Plants = dict[tuple[str, str], GeneralisedPlant]
"""Generalised plants by form of uncertainty and channel."""


def needs(
    axis: str, cover: CoverMethod = "steps", frequencies: int = 400, **_: Any
) -> dict[str, Any]:
    """References to the circles and stadiums about fitted nominals."""
    return {
        form: ref(f"cd/{axis}/{form}-cover", method=cover, frequencies=frequencies)
        for form in FORMS[1:]
    }


@dataclass(frozen=True, eq=False)
class ReferenceGainRoom(Study):
    """Peaks of robust performance over a factor of the gain, and where they cross 1."""

    axis: Axis
    circle: Run
    stadium: Run

    headline: ClassVar[str] = "high_parametric_disturbance"

    @property
    def quantifier(self) -> str:
        return f"{EVERY_PERTURBATION}, at the factors tried"

    form, channel, bound, end = dim(FORMS), dim(CHANNELS), dim("lower", "upper"), dim(ENDS)
    factor = dim(lambda: FACTORS, unit="1", meaning="factor of the gain")

    def plant(self, form: str, channel: str) -> GeneralisedPlant:
        """The generalised plant of a form of uncertainty, with the signals of one channel."""
        covered = {"parametric": None, "circle": self.circle, "stadium": self.stadium}[form]
        exogenous, performance = CHANNELS[channel]
        whole = generalised(self.axis, uncertainty(self.axis, covered))
        return whole.channel(performance=performance, exogenous=exogenous)

    @part
    def plants(self) -> Plants:
        """Generalised plants by form of uncertainty and channel."""
        return {case: self.plant(*case) for case in product(FORMS, CHANNELS)}

    @answers
    def factor_peaks(self, plants: Plants, context: Context) -> dict[Any, Peak | None]:
        """Peaks by form, channel and factor; None if the nominal loop is unstable."""
        K = controller(self.axis)
        return {
            (*case, factor): performance_peak(plants[case], factor * K, tolerance=CURVE_TOLERANCE)
            for case in context.track(list(plants), "peaks")
            for factor in FACTORS.tolist()
        }

    @factor_peaks.checkers
    def of_the_factors(self, plants: Plants) -> dict[Any, PeakChecker]:
        """Checker that certifies each peak."""
        K = controller(self.axis)
        return {
            (*case, factor): PeakChecker(plant.close(factor * K), plant.performance_structure)
            for case, plant in plants.items()
            for factor in FACTORS.tolist()
        }

    @array(
        dims=(form, channel, factor, bound),
        unit="1",
        meaning="certified bounds of the peak, NaN if unstable",
    )
    def peak(self, factor_peaks: dict[Any, Peak | None]) -> RealArray:
        found = [[np.nan] * 2 if p is None else [p.lower, p.upper] for p in factor_peaks.values()]
        return np.reshape(found, (len(FORMS), len(CHANNELS), len(FACTORS), 2))

    @answers
    def rooms(self, plants: Plants, context: Context) -> dict[Any, GainRoom | None]:
        """Range of the gain by form and channel; None if performance is not proven with the given
        gain.
        """
        K = controller(self.axis)
        cases = context.track(list(plants), "edges")
        return {case: gain_room(plants[case], K, tolerance=EDGE_TOLERANCE) for case in cases}

    @rooms.checkers
    def of_the_plants(self, plants: Plants) -> dict[Any, RoomChecker]:
        """Checker that certifies each range."""
        return {case: RoomChecker(plant, controller(self.axis)) for case, plant in plants.items()}

    @array(
        dims=(form, channel, end),
        unit="1",
        meaning="factors proven to keep or to lose robust performance",
    )
    def room(self, rooms: dict[Any, GainRoom | None]) -> RealArray:
        """NaN if robust performance is not proven with the given gain."""
        found = [
            [np.nan if one is None else getattr(one, end) for end in ENDS] for one in rooms.values()
        ]
        return np.reshape(found, (len(FORMS), len(CHANNELS), len(ENDS)))

    @check(
        title="between",
        statement="peak between the factors that keep robust performance",
        at_most=1.0,
    )
    def kept_between(peak: DataArray, room: DataArray) -> DataArray:  # noqa: N805
        """Peaks of the curve at factors between the two edges."""
        inside = (peak["factor"] >= room.sel(end="low")) & (peak["factor"] <= room.sel(end="high"))
        return peak.sel(bound="upper").where(inside, 0.0)

    @check(
        title="edges",
        statement="factor that keeps robust performance over one that loses it",
        at_most=1.0,
    )
    def edges_in_order(room: DataArray) -> float:  # noqa: N805
        upper = room.sel(end="high") / room.sel(end="above")
        lower = room.sel(end="below") / room.sel(end="low")
        return float(max(upper.fillna(0.0).max(), lower.fillna(0.0).max()))

    @metric
    def ends(self, room: DataArray) -> dict[str, float]:
        """Edges of each form and channel, and of both channels together; 1 if there is none."""
        numbers = {}
        for form in FORMS:
            of = room.sel(form=form)
            for channel in CHANNELS:
                for end in ENDS:
                    value = float(of.sel(channel=channel, end=end))
                    if np.isfinite(value):
                        numbers[f"{end}_{form}_{channel}"] = value
            known = bool(of.notnull().all())
            low = float(of.sel(end="low").max()) if known else 1.0
            high = float(of.sel(end="high").min()) if known else 1.0
            numbers |= {f"low_{form}": low, f"high_{form}": high}
        return numbers

    @metric
    def least_peaks(self, peak: DataArray) -> dict[str, float]:
        """Least certified peak of both channels over the factors tried, and its factor."""
        worst = peak.sel(bound="upper").max("channel", skipna=False)
        numbers = {}
        for form in FORMS:
            one = worst.sel(form=form)
            numbers[f"least_peak_{form}"] = float(one.min())
            numbers[f"factor_of_least_peak_{form}"] = float(one.idxmin("factor"))
        return numbers

    @table
    def edges(self, room: DataArray) -> tuple[list[str], list[list[str]]]:
        rows = []
        for form in FORMS:
            for channel in CHANNELS:
                ends = room.sel(form=form, channel=channel).values
                told = [f"{end:.4f}" if np.isfinite(end) else "none" for end in ends]
                rows.append([form, channel, *told])
        heads = ["lost at", "kept from", "kept to", "lost at"]
        return ["uncertainty", "channel", *heads], rows

    @figure
    def peaks(self, peak: DataArray, room: DataArray) -> Figure:
        """Peaks over the factor, one panel per channel."""
        drawn, panels = figures.axes(1, 2, size=(10.0, 4.4), sharex=True, sharey=True)
        for panel, channel in zip(panels, CHANNELS, strict=True):
            for form in FORMS:
                curve = peak.sel(form=form, channel=channel, bound="upper")
                panel.loglog(curve["factor"], curve, label=form)
            low, high = (room.sel(form="parametric", channel=channel, end=e) for e in ENDS[1:3])
            if np.isfinite(low):
                panel.axvspan(float(low), float(high), color="0.9", label="parametric: kept")
            panel.axhline(1.0, color="0.4", linewidth=0.8)
            panel.set_xlim(FACTORS[0], FACTORS[-1])
            signals = " to ".join(f"${name}$" for name in CHANNELS[channel])
            figures.label(panel, x="factor of the gain", y="", title=f"{self.axis}, {signals}")
        figures.label(panels[0], y="peak of $\\mu$")
        figures.legend_below(drawn, panels[1])
        return drawn


@problem("cd/{axis}/gain-room", axis=("focus", "radial"), needs=needs, data=TABLES)
def gain_room_of(
    axis: Axis,
    circle: Run,
    stadium: Run,
    cover: CoverMethod = "steps",
    frequencies: Frequencies = 400,
) -> ReferenceGainRoom:
    """Room to change the reference controller's gain with robust performance kept (section 6.4).

    Peaks of mu from w_p to z_p and from w_u to z_u, over a factor on the gain, are certified
    between frequencies for the three models of the drives. The factors with a peak below 1 form a
    range. Each of its edges is between a factor proven to keep robust performance and one proven to
    lose it.

    cover, frequencies: of the circles and stadiums.
    """
    return ReferenceGainRoom(axis, circle, stadium)
