"""Unlike arms, identified in the loop by models of several orders (section 4.6.2).

Figure, section and equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import problem
from workbench.executor import Context
from workbench.identification import IdentificationWarning
from workbench.study import (
    CLAIM_SHARE,
    LEAST_COVERAGE_P,
    Study,
    array,
    arrays,
    check,
    coverage_p,
    dim,
    figure,
    metric,
    part,
    share_of_draws,
    table,
)
from workbench.types import DataArray, Dataset, Figure, RealArray

from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ...drive.two_masses import FITTED
from ..closed_loop import LEAST_P
from ..experiment import Laboratory
from ..in_the_loop import LoopExperiment, LoopRecord
from ..known_values import CONFIDENCE, Lumped
from ..loop_fit import LoopFit, fit_of_draw
from ..unknowns import Told, experiment_seeds
from .figures import figure_4_5, shown_of
from .resonances import ARMS, HALVES, order_of, resonances_shown, shares_shown

MISMATCH = {"alike": (0.0,), "halves": (0.2, -0.2), "four": (0.3, 0.2, -0.2, -0.3)}
"""Mismatches of the arms of each bench. Four arms come as two pairs, since evenly spread arms show
fewer resonances: these fill each other's dips.
"""
BENCHES = {name: len(one) for name, one in MISMATCH.items()}
"""Number of unlike arms of each bench."""
ORDERS = {4: 1, 6: HALVES, 10: ARMS}
"""Number of arms of the model of each order."""
PROVEN = ["alike", "halves"]
"""Benches on whose fits of the right order checks rely."""
PARASITIC = ("m2", "k2")
"""Parameters that the parasitic resonances determine."""
DEVIATIONS = (0.1, 0.2, 0.3, 0.4, 0.5)
"""Standard deviations of the mismatches of random arms."""
RANDOM_ARMS = 200
"""Number of random arms for each standard deviation."""
FINE = np.geomspace(200.0, 2000.0, 800)
"""Frequencies [Hz] at which resonances are counted."""


@problem(
    "cd/{axis}/unlike-arms",
    slow=True,
    axis=("focus", "radial"),
    data=(*TABLES, "data/red_book.csv"),
)
def unlike_arms(
    axis: Axis,
    drive: str = "CD12",
    step_hz: Annotated[float, Field(ge=1, le=50)] = 5.0,
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
) -> UnlikeArms:
    """Parasitic resonances of unlike arms, and fits of too low an order (figure 4.5).

    Section 4.6.2. The tables give one parasitic resonance of each drive, so the differences between
    its four arms are assumed: their links to the lens differ. Three benches have the masses,
    springs and dampers of the drive's table: "alike" with one arm (order 4), "halves" with two arms
    whose links are 20 % above and below the mean (order 6), and "four" with four arms whose links
    are 30 or 20 % off (order 10). On each, a stepped sine from 100 to 2000 Hz in the loop measures
    x / coil voltage as in cd/<axis>/closed-loop, and models of order 4, 6 and 10, up to that of the
    bench, are fitted. The lumped parameters are known as accurately as an open-loop experiment
    finds them. Reported are the number of resonances that show, how often the intervals of the
    parameters hold the truth, how often the tests of the fit reject the order, and how many
    resonances four random arms show.

    A model of order 10 is at the limit of what the data can determine: two of its arms may become
    alike, and then the fit is singular. So its intervals are reported, but no check relies on them.

    drive: CD1 ... CD12. step_hz: distance between the frequencies [Hz]. draws: number of draws of
    the noise and of the told values.
    """
    return UnlikeArms(axis, drive, step_hz, draws)


@dataclass(frozen=True)
class UnlikeArms(Study):
    """One drive with three kinds of arms, and fits of several orders."""

    axis: Axis
    drive: str
    step_hz: float
    draws: int

    headline: ClassVar[str] = "covered_halves_4"

    @property
    def quantifier(self) -> str:
        return f"for this one drive, in {self.draws} simulated draws of each bench"

    bench, order, parameter = dim(BENCHES), dim(ORDERS), dim(FITTED)
    deviation, count = dim(DEVIATIONS), dim(range(1, ARMS + 1))
    frequency = dim(
        lambda self: np.arange(100.0, 2000.0 + self.step_hz / 2, self.step_hz),
        unit="Hz",
        meaning="frequency",
    )
    draw = dim(lambda self: range(self.draws))

    @array(dims=draw)
    def seed(self, context: Context) -> Any:
        return experiment_seeds(context.rng, "closed-loop", self.drive, self.draws)

    @part
    def experiments(self, frequency: DataArray) -> list[LoopExperiment]:
        """The experiment on every bench, by name."""
        return [
            LoopExperiment(self.laboratory(name), frequency.values, disturbances=True)
            for name in BENCHES
        ]

    def laboratory(self, bench: str) -> Laboratory:
        """The bench with this name."""
        return Laboratory(self.axis, self.drive, mismatch=MISMATCH[bench])

    @part
    def told(self, seed: DataArray) -> list[Told]:
        return [Told.drawn(self.axis, one) for one in seed.values.tolist()]

    @part
    def records(
        self, context: Context, experiments: list[LoopExperiment], seed: DataArray, told: list[Told]
    ) -> list[list[LoopRecord]]:
        """Records of every bench, by draw."""
        seeds = seed.values.tolist()

        def measured(place: tuple[int, ...]) -> LoopRecord:
            n, k = place
            return experiments[n].measured(seeds[k], told[k])

        places = list(np.ndindex(len(experiments), self.draws))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", IdentificationWarning)  # of a few weak lines
            found = context.spread(measured, places, "experiments")
        return [found[n * self.draws : (n + 1) * self.draws] for n in range(len(experiments))]

    @part
    def fits(
        self,
        context: Context,
        experiments: list[LoopExperiment],
        records: list[list[LoopRecord]],
        seed: DataArray,
        told: list[Told],
    ) -> dict[tuple[int, int, int], LoopFit]:
        """Fits by bench, order and draw, with orders up to that of the bench."""
        true = Lumped.of(self.laboratory("alike").parameters)
        known = [true.drawn(np.random.default_rng([one, 2])) for one in seed.values.tolist()]
        places = [
            (n, m, k)
            for n, most in enumerate(BENCHES.values())
            for m, arms in enumerate(ORDERS.values())
            for k in range(self.draws)
            if arms <= most
        ]
        arms = list(ORDERS.values())
        return {
            (n, m, k): fit_of_draw(
                experiments[n], records[n][k], told[k], known[k], context.options, arms[m]
            )
            for n, m, k in context.track(places, "fits")
        }

    def _over_all_fits(
        self, fits: dict[tuple[int, int, int], LoopFit], value: Any, *size: int
    ) -> Any:
        """A value of every fit (benches, orders, draws, ...); NaN if there is no fit."""
        found = np.full((len(BENCHES), len(ORDERS), self.draws, *size), np.nan)
        for place, one in fits.items():
            found[place] = value(one)
        return found

    # --- what the arms show -------------------------------------------------------------------

    order_of_bench = array(dims=bench, unit="", meaning="order of the bench's model")(
        lambda self: [order_of(self.laboratory(name).actuator) for name in BENCHES]
    )
    shown = array(dims=bench, unit="", meaning="parasitic resonances that show")(
        lambda self: [
            resonances_shown(FINE, self.laboratory(name).actuator.response(FINE))
            for name in BENCHES
        ]
    )
    random_shown = array(
        dims=(deviation, count), unit="1", meaning="share of random arms that show so many"
    )(
        lambda self, context: shares_shown(
            context.rng,
            self.laboratory("alike").parameters,
            FINE,
            np.array(DEVIATIONS),
            RANDOM_ARMS,
        )
    )

    # --- the first draw -----------------------------------------------------------------------

    @arrays(
        (bench, frequency),
        measured=("m/V", "x / coil voltage measured"),
        radius="m/V",
        exact=("m/V", "without noise, by the measurement chain that is told"),
    )
    def first(self, fits: dict[tuple[int, int, int], LoopFit]) -> dict[str, Any]:
        """Responses of the first draw."""
        own = [fits[n, 0, 0] for n in range(len(BENCHES))]
        return {
            "measured": np.array([one.response for one in own]).astype("c8"),
            "radius": np.array([one.radius for one in own]).astype("f4"),
            "exact": np.array([one.exact for one in own]).astype("c8"),
        }

    @array(
        dims=(bench, order, frequency), unit="m/V", meaning="|x / coil voltage| fitted, first draw"
    )
    def fitted(self, fits: dict[tuple[int, int, int], LoopFit], frequency: DataArray) -> RealArray:
        every = self._over_all_fits(fits, lambda one: abs(one.fitted), frequency.size)
        found: RealArray = every[:, :, 0].astype("f4")
        return found

    # --- all draws ----------------------------------------------------------------------------

    @arrays((bench, order, draw, parameter), value="", half_width=("", "of the 99 % interval"))
    def fitted_values(self, fits: dict[tuple[int, int, int], LoopFit]) -> dict[str, RealArray]:
        """Values of the fits, and half-widths; NaN of a parameter that stopped at its bound"""
        return {
            name: self._over_all_fits(fits, lambda one, name=name: getattr(one, name), len(FITTED))
            for name in ("value", "half_width")
        }

    @arrays((bench, order, draw), chi_square_p="1", neighbours_p="1", unproven="", error_fitted="1")
    def numbers(self, fits: dict[tuple[int, int, int], LoopFit]) -> dict[str, RealArray]:
        """Numbers that describe the fits."""
        names = ("chi_square_p", "neighbours_p", "unproven", "error_fitted")
        return {
            name: self._over_all_fits(fits, lambda one, name=name: one.numbers[name])
            for name in names
        }

    fitted_shown = array(
        dims=(bench, order, draw), unit="", meaning="parasitic resonances of the fitted model"
    )(
        lambda self, fits, frequency: self._over_all_fits(
            fits, lambda one: resonances_shown(frequency.values, one.fitted)
        )
    )
    table_value = array(dims=parameter, value=lambda self: [
        getattr(self.laboratory("alike").parameters, name) for name in FITTED
    ])  # fmt: skip

    # --- checks -------------------------------------------------------------------------------

    two = check(
        title="two resonances",
        statement="how many fewer than two resonances unlike arms show",
        value=lambda shown: 2.0 - shown.sel(bench=["halves", "four"]),
        at_most=0.0,
    )
    orders = check(
        title="order",
        statement="difference of the order of the bench's model from that of so many arms",
        value=lambda order_of_bench: abs(
            order_of_bench - order_of_bench.copy(data=[2 * one + 2 for one in BENCHES.values()])
        ),
        at_most=0.0,
    )
    proven = check(
        title="fits of the right order",
        statement="checks of a fit of order 4 or 6 that fail, all draws",
        value=lambda unproven: _of_right_order(unproven).sel(bench=PROVEN).sum(),
        at_most=0.0,
    )
    coverage = check(
        title="coverage, right order, {bench}",
        statement="1 - probability that 99 % intervals hold the truth in no more draws than here, "
        "worst parameter",
        value=lambda answer: (
            1.0 - coverage_p(_of_right_order(_covers_truth(answer)).sel(bench=PROVEN), CONFIDENCE)
        ),
        each="bench",
        at_most=1.0 - LEAST_COVERAGE_P,
    )
    accepted = check(
        title="the right order is accepted, {bench}",
        statement="1 - probability that a test of the fit rejects it in no fewer draws than here",
        value=lambda answer: (
            1.0 - coverage_p(_of_right_order(_order_accepted(answer)), (1.0 - LEAST_P) ** 2)
        ),
        each="bench",
        at_most=1.0 - LEAST_COVERAGE_P,
    )

    @check(title="order 4 is rejected, {bench}", at_most=1.0 - CLAIM_SHARE, each="bench")
    def rejected(self, answer: Dataset) -> DataArray:
        """share of draws in which no test of the fit rejects order 4"""
        low = _order_accepted(answer).sel(order=4, bench=["halves", "four"])
        return share_of_draws(low, "bench")

    @check(title="intervals of order 4, {bench}", at_most=LEAST_COVERAGE_P, each="bench")
    def misleading(self, answer: Dataset) -> DataArray:
        """probability that 99 % intervals hold the truth in no more draws, smaller of m2 and k2"""
        low = _covers_truth(answer).sel(
            order=4, bench=["halves", "four"], parameter=list(PARASITIC)
        )
        return coverage_p(low, CONFIDENCE).min("parameter")

    # --- what is told -------------------------------------------------------------------------

    orders_told = metric("order_{bench}", value=lambda order_of_bench: order_of_bench)
    shown_told = metric("shown_{bench}", value=lambda shown: shown)

    @metric
    def by_order(self, answer: Dataset) -> dict[str, float]:
        """Numbers of every bench and fitted order."""
        found: dict[str, float] = {}
        held, accepted = _covers_truth(answer), _order_accepted(answer)
        errors = abs(answer["value"] / answer["table_value"] - 1)
        for bench, order in self._fitted_cases:
            at = {"bench": bench, "order": order}
            one, name = held.sel(at), f"{bench}_{order}"
            found[f"covered_{name}"] = float(one.mean())
            for parameter in FITTED:
                own = one.sel(parameter=parameter)
                found[f"covered_{parameter}_{name}"] = float(own.mean())
            found[f"rejected_{name}"] = float(1.0 - accepted.sel(at).mean())
            found[f"shown_fitted_{name}"] = float(answer["fitted_shown"].sel(at).mean())
            found[f"error_fitted_{name}"] = float(answer["error_fitted"].sel(at).mean())
            for parameter in PARASITIC:
                this = {**at, "parameter": parameter}
                half = answer["half_width"].sel(this)
                half = half / answer["table_value"].sel(parameter=parameter)
                found[f"error_{parameter}_{name}"] = float(errors.sel(this).mean())
                found[f"half_width_{parameter}_{name}"] = float(half.mean())
            no_interval = answer["half_width"].sel(at).isnull().any("parameter").mean()
            found[f"no_interval_{name}"] = float(no_interval)
            found[f"unproven_{name}"] = float((answer["unproven"].sel(at) > 0).mean())
        return found

    random_arms = metric(
        template="random_{count}_shown_{deviation}",
        value=lambda random_shown: random_shown.assign_coords(
            deviation=[f"{100 * one:.0f}_percent" for one in DEVIATIONS]
        ),
    )

    @property
    def _fitted_cases(self) -> list[tuple[str, int]]:
        """Pairs of bench and order that were fitted."""
        return [
            (bench, order)
            for bench, most in BENCHES.items()
            for order, arms in ORDERS.items()
            if arms <= most
        ]

    @table
    def fits_(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        """Each bench and order: how often it is rejected, and how often its intervals hold the
        truth.
        """
        numbers, rows = self.metrics(answer), []
        for bench, order in self._fitted_cases:
            name = f"{bench}_{order}"
            cells = [f"{int(answer['order_of_bench'].sel(bench=bench))}", f"{order}"]
            cells += [f"{int(answer['shown'].sel(bench=bench))}"]
            cells += [
                f"{numbers[f'shown_fitted_{name}']:.2f}",
                f"{numbers[f'rejected_{name}']:.0%}",
            ]
            cells += [f"{numbers[f'error_fitted_{name}']:.1%}"]
            cells += [f"{numbers[f'covered_{one}_{name}']:.0%}" for one in FITTED]
            rows.append([bench, *cells, f"{numbers[f'no_interval_{name}']:.0%}"])
        heads = ["arms", "order", "of the model", "resonances", "of the model", "order rejected"]
        heads += ["error of the response", *(f"{one} held" for one in FITTED), "no interval of one"]
        return heads, rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        title = f"{self.drive} {self.axis}"
        return {"figure-4-5": figure_4_5(answer, title), "resonances": shown_of(answer, title)}


def _of_right_order(values: DataArray) -> DataArray:
    """Values of the fits whose order is that of the bench."""
    import xarray as xr

    order = {arms: order for order, arms in ORDERS.items()}
    own = [values.sel(bench=name, order=order[arms]) for name, arms in BENCHES.items()]
    return xr.concat([one.drop_vars("order") for one in own], "bench")


def _covers_truth(answer: Dataset) -> DataArray:
    """Whether an interval holds the truth; false if there is no interval."""
    return abs(answer["value"] - answer["table_value"]) <= answer["half_width"]


def _order_accepted(answer: Dataset) -> DataArray:
    """Whether neither test of a fit rejects the model's order."""
    return (answer["chi_square_p"] >= LEAST_P) & (answer["neighbours_p"] >= LEAST_P)
