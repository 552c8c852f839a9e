"""Two controllers: one for disturbances, one for surface defects (sections 6.4 and 8.5).

Section, equation and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control
of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, problem
from workbench.certify import certified_norm
from workbench.executor import Context
from workbench.mu import Peak, WorstCaseChecker, WorstCaseGain, conditions, worst_case_gain
from workbench.structure import Structure
from workbench.study import Study, answers, array, arrays, check, dim, figure, metric, part, table
from workbench.systems import bandwidths, response
from workbench.types import DataArray, Dataset, RealArray, StateSpace

from ...drive.disc import VELOCITY
from ...drive.margins import MARGIN_UNITS, each_margin
from ...drive.photo_diodes import CAPTURE
from ...drive.plants import controller
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ..trade_off import CHANNELS, TradeOff
from .checks import two_controllers_checks
from .report import cases_table, front_figure, front_table, loops_figure

Bounds = list[tuple[float, RealArray]]
"""Levels, and their filters (3,)."""
Judged = tuple[RealArray, RealArray, list[list[WorstCaseGain]]]
"""Nominal gains (controller, 3), worst-case gains (controller, 2, 2), and proofs of the latter."""
SHARES = (0.3, 60.0)
"""Least and largest weight of the defect channel; the weight of the disturbance channel is 1."""
GAIN_FACTORS = (1 / 3, 3**-0.5, 1.0, 3**0.5)
"""Factors on the reference controller; figure 6.7 uses a third of its gain."""
CASES = ("high", "low", "reference")
UNCERTAIN = CHANNELS[:2]
"""Channels whose worst case over the uncertainty is bounded."""
WORST_CASE_TOLERANCE = 1e-2
"""Relative width of the interval that certifies a worst-case gain."""
LOW, HIGH = 1.0, 20e3
"""Ends of the frequency range shown [Hz]."""
DURATION = 6e-3
"""Duration shown [s]."""
INSTANTS = 600
"""Number of instants shown."""


@problem("cd/{axis}/two-controllers", axis=("focus", "radial"), data=TABLES, slow=True)
def two_controllers(
    axis: Axis,
    designs: Annotated[int, Field(ge=2, le=200)] = 10,
    defect_mm: Annotated[float, Field(gt=0, le=100)] = 1.6,
    frequencies: Annotated[int, Field(ge=20, le=100_000)] = 300,
) -> TwoControllers:
    """A high-bandwidth controller for disturbances and a low-bandwidth one for surface defects.

    H-infinity controllers whose effort c, the largest |W_u K_optn K S|, is 1 form a front between
    a, the largest |W_p S|, and b, the largest |W_sd T|: each has the least norm of a stack [z_p;
    share z_sd; sigma z_u]. This is not the least value of max(a, share b), but no controller with c
    <= 1 is below the bounds that are given with it. For every controller the worst cases over
    parametric uncertainty are certified. From these, two controllers are chosen: the one with the
    least a; and the one with the least b among those whose error stays so small that the loop is
    not lost while a defect passes.

    designs: number of controllers on the front. defect_mm: length of the longest defect [mm], which
    sets the corner of W_sd. frequencies: of the curves shown.
    """
    return TwoControllers(axis, designs, defect_mm / 1e3, frequencies)


@dataclass(frozen=True)
class TwoControllers(Study):
    """The front, its bounds, and two controllers of it."""

    axis: Axis
    designs: int
    length: float
    frequencies: int

    headline: ClassVar[str] = "worst_disturbance_high"

    @property
    def quantifier(self) -> str:
        return "for these controllers"

    @cached_property
    def trade_off(self) -> TradeOff:
        return TradeOff(self.axis, self.length)

    @property
    def relaxed(self) -> float:
        """Error at which focus or track is lost, over the acceptable error."""
        return CAPTURE[self.axis] / ACCEPTABLE_ERROR[self.axis]

    # --- the front ----------------------------------------------------------------------------

    share = dim(lambda self: np.geomspace(*SHARES, self.designs), unit="1")
    gain = dim(lambda: list(GAIN_FACTORS), unit="1")
    channel, uncertain, bound = dim(CHANNELS), dim(UNCERTAIN), dim("lower", "upper")
    bandwidth, case = dim(CASES[:2]), dim(CASES)
    specification = dim("as it is", "while a defect passes")
    frequency = dim(lambda self: np.geomspace(LOW, HIGH, self.frequencies), unit="Hz")
    time = dim(lambda: np.linspace(0.0, DURATION, INSTANTS), unit="s")

    @part
    def designed(self, share: DataArray, context: Context) -> list[tuple[float, StateSpace]]:
        """Sigma and controller for every share."""
        return [self.trade_off.design(one) for one in context.track(list(share.values), "designs")]

    front = part(lambda designed: [K for _, K in designed])
    sigma = array(dims=share, unit="1")(lambda designed: [sigma for sigma, _ in designed])
    K_A = array(
        dims=(share, "state", "state_"), unit="", meaning="A of the controllers' realisations"
    )(lambda front: [K.A for K in front])
    K_B = array(
        dims=(share, "state", "measurement"), unit="", meaning="B of the controllers' realisations"
    )(lambda front: [K.B for K in front])
    K_C = array(
        dims=(share, "control", "state"), unit="", meaning="C of the controllers' realisations"
    )(lambda front: [K.C for K in front])
    K_D = array(
        dims=(share, "control", "measurement"),
        unit="",
        meaning="D of the controllers' realisations",
    )(lambda front: [K.D for K in front])

    @part
    def judged(self, front: list[StateSpace], context: Context) -> Judged:
        """Nominal gains (controller, 3), worst-case gains (controller, 2, 2), and their proofs.

        The reference controllers with scaled gains come last.
        """
        import control

        scaled = [gain * control.ss(controller(self.axis)) for gain in GAIN_FACTORS]
        found = [
            (self._gains(K), self._worst(K)) for K in context.track([*front, *scaled], "judging")
        ]
        nominal, worst = (list(part) for part in zip(*found, strict=True))
        bounds = [[(one.lower, one.upper) for one in each] for each in worst]
        return np.array(nominal), np.array(bounds), worst

    largest = "largest gain of the nominal loop, certified"
    nominal = array(dims=(share, channel), unit="1", meaning=largest)(
        lambda self, judged: judged[0][: self.designs]
    )
    reference_nominal = array(dims=(gain, channel), unit="1", meaning=largest)(
        lambda self, judged: judged[0][self.designs :]
    )
    over_plants = "largest gain over all plants, certified"
    worst = array(dims=(share, uncertain, bound), unit="1", meaning=over_plants)(
        lambda self, judged: judged[1][: self.designs]
    )
    reference_worst = array(dims=(gain, uncertain, bound), unit="1", meaning=over_plants)(
        lambda self, judged: judged[1][self.designs :]
    )
    chosen = array(dims=bandwidth, unit="", meaning="which of the controllers")(
        lambda self, worst: self.choice(worst.values[:, :, 1])
    )

    @answers
    def worst_of_two(self, judged: Judged, chosen: DataArray) -> dict[Any, WorstCaseGain]:
        """Worst-case gains of the two chosen controllers, with their proofs."""
        return {
            (case, channel): gain
            for case, place in zip(CASES[:2], chosen.values, strict=True)
            for channel, gain in zip(UNCERTAIN, judged[2][place], strict=True)
        }

    @worst_of_two.checkers
    def of_the_two(
        self, K_A: DataArray, K_B: DataArray, K_C: DataArray, K_D: DataArray, chosen: DataArray
    ) -> dict[Any, WorstCaseChecker]:
        """Checker that certifies these gains."""
        front = _systems(K_A, K_B, K_C, K_D)
        return {
            (case, z): WorstCaseChecker(self.uncertain_loop(z, front[place]), self.parameters)
            for case, place in zip(CASES[:2], chosen.values.tolist(), strict=True)
            for z in UNCERTAIN
        }

    @part
    def bounds(self, share: DataArray, nominal: DataArray, context: Context) -> Bounds:
        """Lower bounds for every controller, and the filters that prove them (3,)."""
        found: Bounds = []
        pairs = list(zip(share.values, nominal.values, strict=True))
        for weight, (a, b, _) in context.track(pairs, "bounds for all controllers"):
            guess = [2 * np.pi * 500, 2 * np.pi * 5000, 0.7 * max(a, weight * b)]
            starts = [np.log(guess), *(x for _, x in found[-1:])]
            found.append(self.trade_off.bound(weight, *starts))
        return found

    excluded = array(dims=share, unit="1", meaning="level that max(a, share b) cannot be below")(
        lambda bounds: [level for level, _ in bounds]
    )
    filters = array(
        dims=(share, "filter"),
        unit="",
        meaning="logarithms of the bound's corners [rad/s] and zeta",
    )(lambda bounds: [x for _, x in bounds])

    # --- the two, and the reference controller ------------------------------------------------

    @part
    def cases(self, front: list[StateSpace], chosen: DataArray) -> list[StateSpace]:
        import control

        high, low = chosen.values
        return [front[high], front[low], control.ss(controller(self.axis))]

    loops = part(lambda self, cases: [self.trade_off.G * K for K in cases])
    margin = arrays(
        case, lambda loops: {k: one for k, (one,) in each_margin([loops]).items()}, **MARGIN_UNITS
    )

    @arrays(case, bandwidth_S="Hz", bandwidth_T="Hz")
    def widths(self, loops: list[StateSpace]) -> dict[str, list[float]]:
        found = [bandwidths(loop) for loop in loops]
        return {f"bandwidth_{name}": [each[name] for each in found] for name in ("S", "T")}

    omega = part(lambda frequency: 2 * np.pi * frequency.values)
    sensitivity = part(
        lambda loops, omega: np.array([1 / (1 + response(L, omega)[:, 0, 0]) for L in loops])
    )
    S = array(dims=(case, frequency), unit="1")(lambda sensitivity: abs(sensitivity))
    T = array(dims=(case, frequency), unit="1")(lambda sensitivity: abs(1 - sensitivity))
    permitted = array(dims=frequency, unit="1")(
        lambda self, omega: 1 / abs(response(self.trade_off.W_p, omega)[:, 0, 0])
    )
    defects = array(dims=frequency, unit="1")(
        lambda self, omega: abs(response(self.trade_off.W_sd, omega)[:, 0, 0])
    )
    false = array(dims=time, unit="1", meaning="false displacement")(
        lambda self, time: np.sin(2 * np.pi * np.minimum(time.values * VELOCITY / self.length, 1.0))
    )
    step_error = array(
        dims=(case, time), unit="1", meaning="error after a step of the disc, relative"
    )(lambda loops, time: 1.0 - _follows(loops, time, np.ones(INSTANTS)))
    defect_error = array(
        dims=(case, time), unit="1", meaning="error by a surface defect, relative"
    )(lambda loops, time, false: -_follows(loops, time, false.values))

    @array(
        dims=(case, specification, bound),
        unit="1",
        meaning="peak of robust performance of z_p, certified",
    )
    def mu(self, cases: list[StateSpace]) -> list[list[tuple[float, float]]]:
        return [[(p.lower, p.upper) for p in self._robust_performance(K)] for K in cases]

    def choice(self, worst: RealArray) -> list[int]:
        """Indices of the two controllers, chosen by the worst a and b (designs, 2) of all."""
        disturbance, defect = worst.T
        high = int(np.argmin(disturbance))
        bearable = disturbance <= max(self.relaxed, disturbance[high])
        return [high, int(np.argmin(np.where(bearable, defect, np.inf)))]

    def controllers(self, answer: Dataset) -> list[StateSpace]:
        """Controllers of the front, by share."""
        return _systems(*(answer[f"K_{name}"] for name in "ABCD"))

    @property
    def parameters(self) -> Structure:
        """Structure of the uncertain parameters."""
        structure = self.trade_off.uncertain.structure
        assert structure is not None
        return structure

    def _gains(self, K: StateSpace) -> list[float]:
        """a, b and c of the nominal loop."""
        nominal = self.trade_off.nominal
        return [certified_norm(nominal.channel(performance=z).close(K)) for z in CHANNELS]

    def uncertain_loop(self, channel: str, K: StateSpace) -> StateSpace:
        """The loop of K from w to a performance output, and of the uncertain parameters."""
        return self.trade_off.uncertain.channel(performance=channel, exogenous="w").close(K)

    def _worst(self, K: StateSpace) -> list[WorstCaseGain]:
        """Bounds of a and b over all plants."""
        return [
            worst_case_gain(
                self.uncertain_loop(z, K), self.parameters, tolerance=WORST_CASE_TOLERANCE
            )
            for z in UNCERTAIN
        ]

    def _robust_performance(self, K: StateSpace) -> list[Peak]:
        """Peaks of mu of z_p: with W_p, and with the error that is bearable while a defect
        passes.
        """
        channel = self.trade_off.uncertain.channel(performance="z_p", exogenous="w")
        peaks = [
            conditions(channel.weighted(performance=[1 / size]), K).robust_performance
            for size in (1.0, self.relaxed)
        ]
        return [peak for peak in peaks if peak is not None]

    @check()
    def gains_and_bounds(self, answer: Dataset) -> list[Check]:
        return two_controllers_checks(self.trade_off, self.controllers(answer), answer)

    @check(
        title="worst of two",
        statement="bounds that differ from the proven ones of the two",
        at_most=0.0,
    )
    def same_bounds(self, answer: Dataset) -> float:
        kept = answer["worst"].values[answer["chosen"].values]
        return float(np.count_nonzero(kept.ravel() != answer["worst_of_two_bounds"].values))

    @metric
    def numbers_of_the_two(self, answer: Dataset) -> dict[str, float]:
        upper, numbers = answer["worst"].sel(bound="upper"), {}
        for place, name in enumerate(CASES[:2]):
            one = {"share": int(answer["chosen"][place])}
            for channel, word in zip(UNCERTAIN, ("disturbance", "defect"), strict=True):
                numbers[f"{word}_{name}"] = float(answer["nominal"].sel(channel=channel)[one])
                numbers[f"worst_{word}_{name}"] = float(upper.sel(uncertain=channel)[one])
        return numbers

    crossover = metric("crossover_{case}_hz", value=lambda crossover_hz: crossover_hz)
    phase_margin = metric("phase_margin_{case}_deg", value=lambda phase: phase)
    peak_of_mu = metric("mu_{case}", value=lambda mu: mu[:, 0, 1])

    @metric
    def largest_distance_from_bound(self, answer: Dataset) -> float:
        a, b = (answer["nominal"].sel(channel=z) for z in UNCERTAIN)
        ratio = np.maximum(a, answer["share"] * b) / answer["excluded"]
        return float(ratio.max()) - 1

    tables_of_two = table(
        function=lambda self, answer: {
            "front": front_table(answer),
            "two": cases_table(answer, self.relaxed),
        }
    )
    drawn = figure(
        lambda self, answer: {
            "front": front_figure(self.axis, answer, self.relaxed),
            "loops": loops_figure(self.axis, answer),
        }
    )


def _systems(A: DataArray, B: DataArray, C: DataArray, D: DataArray) -> list[StateSpace]:
    """Controllers by share."""
    import control

    return [control.ss(*one) for one in zip(A.values, B.values, C.values, D.values, strict=True)]


def _follows(loops: list[StateSpace], time: DataArray, reference: RealArray) -> RealArray:
    """Outputs (loop, time) of closed loops that follow a reference (time,)."""
    import control

    closed = [control.feedback(loop, 1) for loop in loops]
    return np.array([control.forced_response(T, time.values, reference).outputs for T in closed])
