"""Two controllers: one for disturbances, one for surface defects (sections 6.4 and 8.5).

Section, equation and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control
of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Study, problem
from workbench.arrays import RealArray
from workbench.certify.norms import certified_norm
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure, StateSpace
from workbench.mu import Peak, WorstCaseGain, conditions, worst_case_gain
from workbench.systems import Margins, bandwidths, margins
from workbench.systems.generalised_plant import response

from ...drive.disc import VELOCITY
from ...drive.photo_diodes import CAPTURE
from ...drive.plants import controller
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ..trade_off import CHANNELS, TradeOff
from .checks import two_controllers_checks
from .report import two_controllers_figures, two_controllers_tables

SHARES = (0.3, 60.0)
"""Weights of the defects' channel, the disturbances' having 1, from and to."""
GAINS = (1 / 3, 3**-0.5, 1.0, 3**0.5)
"""Factors on the reference controller; figure 6.7 has a third of its gain."""
CASES = ("high", "low", "reference")
UNCERTAIN = CHANNELS[:2]
"""Channels whose worst case over the uncertainty is bounded."""
TOLERANCE = 1e-2
"""Of the worst-case gains, relative."""
LOW, HIGH = 1.0, 20e3
"""Ends of the frequencies shown [Hz]."""
LASTS = 6e-3
"""Time shown [s]."""
INSTANTS = 600


@problem("cd/{axis}/two-controllers", axis=("focus", "radial"), data=TABLES, slow=True)
def two_controllers(
    axis: Axis,
    designs: Annotated[int, Field(ge=2, le=200)] = 10,
    defect_mm: Annotated[float, Field(gt=0, le=100)] = 1.6,
    frequencies: Annotated[int, Field(ge=20, le=100_000)] = 300,
) -> TwoControllers:
    """A high-bandwidth controller for disturbances and a low-bandwidth one for surface defects.

    The front between a, the largest |W_p S|, and b, the largest |W_sd T|, of H-infinity controllers
    whose effort c, the largest |W_u K_optn K S|, is 1: each has the least norm of a stack
    [z_p; share z_sd; sigma z_u]. That is not the least of max(a, share b), but no controller with
    c <= 1 does better than the bounds that are given with it, which hold for all of them. Of every
    controller the worst cases over parametric uncertainty are certified, and of these the two are
    chosen: the one with the least a, and the one with the least b among those whose error stays so
    small that the loop is not lost while a defect passes.

    designs: how many on the front. defect_mm: length of the longest defect [mm], which sets the
    corner of W_sd. frequencies: of the curves shown.
    """
    return TwoControllers(axis, designs, defect_mm / 1e3, frequencies)


@dataclass(frozen=True)
class TwoControllers(Study):
    """The front, what bounds it, and two controllers of it."""

    axis: Axis
    designs: int
    length: float
    frequencies: int

    headline: ClassVar[str] = "worst_disturbance_high"

    @cached_property
    def trade_off(self) -> TradeOff:
        return TradeOff(self.axis, self.length)

    @property
    def relaxed(self) -> float:
        """How much larger than acceptable the error may be before focus, or the track, is lost."""
        return CAPTURE[self.axis] / ACCEPTABLE_ERROR[self.axis]

    def compute(self, context: Context) -> Dataset:
        import control
        import xarray as xr

        trade = self.trade_off
        shares = np.geomspace(*SHARES, self.designs)
        made = [trade.design(share) for share in context.track(list(shares), "designs")]
        front = [K for _, K in made]
        reference = control.ss(controller(self.axis))
        scaled = [gain * reference for gain in GAINS]
        judged = context.track([*front, *scaled], "judging")
        found = [(self._gains(K), self._worst(K)) for K in judged]
        nominal, worst = (np.array(part) for part in zip(*found, strict=True))
        bound, filters = self._bounds(context, shares, nominal[: self.designs])
        count, one = self.designs, {"units": "1"}
        chosen = self.chosen(worst[:count, :, 1])
        cases = [front[chosen[0]], front[chosen[1]], reference]
        kinds = {"": slice(0, count), "reference_": slice(count, None)}
        places = {"": "share", "reference_": "gain"}
        gains: dict[str, Any] = {}
        for kind, part in kinds.items():
            gains |= {
                f"{kind}nominal": (
                    (places[kind], "channel"),
                    nominal[part],
                    one | {"long_name": "largest gain of the nominal loop, certified"},
                ),
                f"{kind}worst": (
                    (places[kind], "uncertain", "bound"),
                    worst[part],
                    one | {"long_name": "largest gain over all plants, certified"},
                ),
            }
        matrices = {
            f"K_{name}": (
                ("share", *dims),
                [getattr(K, name) for K in front],
                {"long_name": f"{name} of the controllers' realisations"},
            )
            for name, dims in {
                "A": ("state", "state_"),
                "B": ("state", "measurement"),
                "C": ("control", "state"),
                "D": ("control", "measurement"),
            }.items()
        }
        return xr.Dataset(
            {
                **gains,
                **matrices,
                **self._of_cases(cases),
                "sigma": ("share", [sigma for sigma, _ in made], one),
                "excluded": (
                    "share",
                    bound,
                    one | {"long_name": "level that max(a, share b) cannot be below"},
                ),
                "filters": (
                    ("share", "filter"),
                    filters,
                    {"long_name": "logarithms of the bound's corners [rad/s] and zeta"},
                ),
                "chosen": (
                    "bandwidth",
                    chosen,
                    {"long_name": "which of the controllers"},
                ),
            },
            coords={
                "share": ("share", shares, one),
                "gain": ("gain", list(GAINS), one),
                "channel": list(CHANNELS),
                "uncertain": list(UNCERTAIN),
                "bound": ["lower", "upper"],
                "bandwidth": list(CASES[:2]),
                "case": list(CASES),
                "frequency": ("frequency", self.frequency, {"units": "Hz"}),
                "time": ("time", self.time, {"units": "s"}),
            },
        )

    @cached_property
    def frequency(self) -> RealArray:
        return np.geomspace(LOW, HIGH, self.frequencies)

    @cached_property
    def time(self) -> RealArray:
        return np.linspace(0.0, LASTS, INSTANTS)

    def chosen(self, worst: RealArray) -> list[int]:
        """Which controllers are the two, from the worst a and b (designs, 2) of all."""
        disturbance, defect = worst.T
        high = int(np.argmin(disturbance))
        bearable = disturbance <= max(self.relaxed, disturbance[high])
        return [high, int(np.argmin(np.where(bearable, defect, np.inf)))]

    def controllers(self, answer: Dataset) -> list[StateSpace]:
        """Those of the front, by share."""
        import control

        return [
            control.ss(*(one[f"K_{name}"].values for name in "ABCD"))
            for one in (answer.isel(share=i) for i in range(answer.sizes["share"]))
        ]

    def _gains(self, K: StateSpace) -> list[float]:
        """a, b and c of the nominal loop."""
        nominal = self.trade_off.nominal
        return [certified_norm(nominal.channel(z).close(K)) for z in CHANNELS]

    def _worst(self, K: StateSpace) -> list[tuple[float, float]]:
        """Bounds of a and b over all plants."""
        uncertain = self.trade_off.uncertain
        structure = uncertain.structure
        assert structure is not None
        found: list[WorstCaseGain] = [
            worst_case_gain(uncertain.channel(z, "w").close(K), structure, TOLERANCE)
            for z in UNCERTAIN
        ]
        return [(each.lower, each.upper) for each in found]

    def _bounds(
        self, context: Context, shares: RealArray, nominal: RealArray
    ) -> tuple[RealArray, RealArray]:
        """The levels that no controller is below, and their filters (designs, 3)."""
        levels: list[float] = []
        filters: list[RealArray] = []
        for share, (a, b, _) in context.track(
            list(zip(shares, nominal, strict=True)), "bounds for all controllers"
        ):
            guess = [2 * np.pi * 500, 2 * np.pi * 5000, 0.7 * max(a, share * b)]
            starts = [np.log(guess), *filters[-1:]]
            level, x = self.trade_off.bound(share, *starts)
            levels.append(level)
            filters.append(x)
        return np.array(levels), np.array(filters)

    def _of_cases(self, cases: list[StateSpace]) -> dict[str, Any]:
        """Margins, robust performance and responses of the two and of the reference controller."""
        import control

        G, omega, one = self.trade_off.G, 2 * np.pi * self.frequency, {"units": "1"}
        loops = [G * K for K in cases]
        found = [margins(loop) for loop in loops]
        widths = [bandwidths(loop) for loop in loops]
        units = dict.fromkeys([field.name for field in fields(Margins)], "1")
        units |= {"decrease_hz": "Hz", "increase_hz": "Hz", "crossover_hz": "Hz", "phase": "deg"}
        data: dict[str, Any] = {
            name: ("case", [astuple(each)[k] for each in found], {"units": unit})
            for k, (name, unit) in enumerate(units.items())
        }
        for name in ("S", "T"):
            data[f"bandwidth_{name}"] = ("case", [each[name] for each in widths], {"units": "Hz"})
        S = [1 / (1 + response(loop, omega)[:, 0, 0]) for loop in loops]
        passing = np.minimum(self.time * VELOCITY / self.length, 1.0)
        inputs = {"step": np.ones(INSTANTS), "defect": np.sin(2 * np.pi * passing)}
        T = [control.feedback(loop, 1) for loop in loops]
        follows = {
            name: np.array([control.forced_response(each, self.time, u).outputs for each in T])
            for name, u in inputs.items()
        }
        mu = [self._robust_performance(K) for K in cases]
        return data | {
            "S": (("case", "frequency"), np.abs(S), one),
            "T": (("case", "frequency"), np.abs(1 - np.array(S)), one),
            "permitted": ("frequency", 1 / abs(response(self.trade_off.W_p, omega)[:, 0, 0]), one),
            "defects": ("frequency", abs(response(self.trade_off.W_sd, omega)[:, 0, 0]), one),
            "step_error": (
                ("case", "time"),
                1.0 - follows["step"],
                one | {"long_name": "error after a step of the disc, relative"},
            ),
            "false": ("time", inputs["defect"], one | {"long_name": "false displacement"}),
            "defect_error": (
                ("case", "time"),
                -follows["defect"],
                one | {"long_name": "error by a surface defect, relative"},
            ),
            "mu": (
                ("case", "specification", "bound"),
                [[(each.lower, each.upper) for each in row] for row in mu],
                one | {"long_name": "peak of robust performance of z_p, certified"},
            ),
            "specification": ["as it is", "while a defect passes"],
        }

    def _robust_performance(self, K: StateSpace) -> list[Peak]:
        """Of the disturbance: with W_p, and with what is bearable while a defect passes."""
        channel = self.trade_off.uncertain.channel("z_p", "w")
        peaks = [
            conditions(channel.weighted([1 / size]), K).robust_performance
            for size in (1.0, self.relaxed)
        ]
        return [peak for peak in peaks if peak is not None]

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        return two_controllers_checks(self.trade_off, self.controllers(answer), answer)

    def metrics(self, answer: Dataset) -> dict[str, float]:
        upper, numbers = answer["worst"].sel(bound="upper"), {}
        a, b = (answer["nominal"].sel(channel=z) for z in UNCERTAIN)
        ratio = np.maximum(a, answer["share"] * b) / answer["excluded"]
        for place, name in enumerate(CASES[:2]):
            one = {"share": int(answer["chosen"][place])}
            for channel, word in zip(UNCERTAIN, ("disturbance", "defect"), strict=True):
                numbers[f"{word}_{name}"] = float(answer["nominal"].sel(channel=channel)[one])
                numbers[f"worst_{word}_{name}"] = float(upper.sel(uncertain=channel)[one])
        for case in CASES:
            one_case = answer.sel(case=case)
            numbers[f"crossover_{case}_hz"] = float(one_case["crossover_hz"])
            numbers[f"phase_margin_{case}_deg"] = float(one_case["phase"])
            numbers[f"mu_{case}"] = float(one_case["mu"][0, 1])
        numbers["largest_distance_from_bound"] = float(ratio.max()) - 1
        return numbers

    def tables(self, answer: Dataset) -> dict[str, str]:
        return two_controllers_tables(answer, self.relaxed)

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return two_controllers_figures(self.axis, answer, self.relaxed)
