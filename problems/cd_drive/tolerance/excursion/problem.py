"""Excursion of the focus point while a defect passes, and the defects that each strategy survives.

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from workbench import Run, problem
from workbench.executor import Context
from workbench.study import (
    CLAIM_SHARE,
    Study,
    array,
    arrays,
    check,
    dim,
    draws_summary,
    figure,
    independent_seeds,
    interval_text,
    markdown_table,
    metric,
    share_of_draws,
    table,
)
from workbench.synthesis import discretise
from workbench.types import DataArray, Dataset

from ...drive.disc import VELOCITY
from ...drive.photo_diodes import CAPTURE
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, red_book
from ...laboratory.bench_setup import PERIOD
from ...laboratory.printed_noise import Amplitude, Fixed
from ..bench_reading import BenchReading
from ..fault_filters import chosen_filter, needs_with_filter
from ..strategy_looks import titled
from ..tactics import STRATEGIES
from .cells import cells_table
from .checks import disc_difference, flight_difference, half_step_change
from .figures import against_theory, maps
from .runs import Crossing, DefectCase, excursion_of
from .theory import WORST, standing

LENGTHS = (0.3e-3, 2.5e-3)
"""Shortest and longest defect [m]; the error correction repairs 2.5 mm."""
SHARES = (0.25, 0.5, 1.0, 1.5, 2.0)
"""Amplitudes of the disc's deviation over what the Red Book allows."""
LENSES = {
    "standing": "stops (eq. 8.1)",
    "free": "free, voltage held",
    "driven": "driven by the blind controller",
}
"""Motion of the lens during a defect, in each theory of `theory`."""
WORST_CASE = "eq. 8.1 at 500 um, 9 Hz, 1.9 ms"


Filter = Literal["high-pass", "with margins"]


def needs(axis: str, fault_filter: Filter = "high-pass", **_: Any) -> dict[str, Any]:
    """References to K', and to the designed fault filter if it is asked for."""
    return needs_with_filter(axis, fault_filter)


@problem(
    "cd/{axis}/excursion",
    slow=True,
    axis=("focus", "radial"),
    needs=needs,
    data=(*TABLES, "data/red_book.csv"),
    added=("fault_filter", "delay", "noise", "noise_fixed"),
)
def excursion(
    axis: Axis,
    slower: Run,
    designed: Run | None = None,
    drive: str = "nominal",
    rotation: Annotated[float, Field(ge=3, le=20)] = 9.0,
    angles: Annotated[int, Field(ge=2, le=90)] = 6,
    lengths: Annotated[int, Field(ge=2, le=50)] = 5,
    depth: Annotated[float, Field(gt=0, le=1)] = 0.9,
    swing: Annotated[float, Field(ge=0, le=5)] = 0.5,
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
    fault_filter: Filter = "high-pass",
    delay: Annotated[float, Field(ge=0, le=2)] = 1.0,
    noise: Amplitude = "rms",
    noise_fixed: Fixed = "metres",
) -> Excursion:
    """Excursion of the lens in a defect (eq. 8.1), and a map of the defects that are survived.

    The disc deviates by shares of what the Red Book allows. The middle of the defect comes at a
    given angle of that deviation. Equation 8.1, for a lens that stops, is compared with a lens that
    moves freely, with one that the blind controller drives, and with the simulated loop under the
    reference strategy. The map shows for each strategy whether focus or track is kept (true error
    within the diodes' capture range) over angle, length and deviation.

    drive: "CD1" to "CD12", or "nominal". rotation [Hz]. angles: number of angles from 0 (where the
    disc is fastest) to below 180 degrees. lengths: number of lengths from 0.3 to 2.5 mm. depth:
    share of the light that the defect takes. swing: its false displacement, over the acceptable
    error. draws: number of draws for each defect. fault_filter: of C, the "high-pass" with the
    margins of figure 8.10, or the one "with margins" of `cd/<axis>/designed-filter`. delay,
    noise, noise_fixed: as in `cd/<axis>/strategies`.
    """
    K_prime = discretise(slower.answer.K, PERIOD)
    F = chosen_filter(fault_filter, designed)
    reading = BenchReading(delay=delay, noise=noise, noise_fixed=noise_fixed)
    crossing = Crossing(axis, K_prime, F, drive, rotation, depth, swing, reading)
    return Excursion(crossing, angles, lengths, draws)


@dataclass(frozen=True, eq=False)
class Excursion(Study):
    """Every strategy over angle, length and deviation, compared with eq. 8.1."""

    crossing: Crossing
    angles: int
    lengths: int
    draws: int

    headline: ClassVar[str] = "survived_reference_mean"

    @property
    def quantifier(self) -> str:
        return (
            f"for {self.angles} angles and {self.lengths} lengths of a defect, "
            f"in {self.draws} simulated draws of each"
        )

    strategy = dim(STRATEGIES)
    angle = dim(
        lambda self: np.pi * np.arange(self.angles) / self.angles,
        unit="rad",
        meaning="middle of the defect",
    )
    theta = dim(
        lambda angle: np.unique(np.append(np.radians(np.arange(0, 181, 3)), angle.values)),
        unit="rad",
        meaning="middle, finer",
    )
    length = dim(lambda self: np.linspace(*LENGTHS, self.lengths), unit="m")
    share = dim(SHARES, meaning="deviation over the Red Book's")

    draw = dim(lambda self: range(self.draws))

    @array(dims=(angle, length, share, draw))
    def seed(self, context: Context) -> Any:
        return independent_seeds(context.rng, self.angles, self.lengths, len(SHARES), self.draws)

    @array(dims=(angle, length, share, draw, strategy), unit="m")
    def peak(self, context: Context, seed: DataArray) -> Any:
        """Largest true error, defect and 5 ms after"""

        def met(place: tuple[int, ...]) -> list[float]:
            one = seed[place]
            case = self.crossing.drawn(one)
            runs = (self.crossing.run(case, name, int(one)) for name in STRATEGIES)
            return [excursion_of(record, case.length)[0] for record in runs]

        found = context.spread(met, list(np.ndindex(seed.shape)), "defects")
        return np.reshape(found, (*seed.shape, len(STRATEGIES))).astype("f4")

    @array(dims=(angle, length), unit="m")
    def end(self, angle: DataArray, length: DataArray) -> Any:
        """True error at the defect's end without noise, reference strategy, Red Book's disc"""
        crossing = self.crossing
        cases = [
            [DefectCase(a, each, crossing.allowed) for each in length.values.tolist()]
            for a in angle.values.tolist()
        ]
        return [
            [excursion_of(crossing.run(one, "reference"), one.length)[1] for one in row]
            for row in cases
        ]

    @arrays((theta, length), standing="m", free="m", driven="m")
    def theory(self, theta: DataArray, length: DataArray) -> dict[str, Any]:
        """Errors at the end of a defect on the Red Book's disc, by the three theories."""
        crossing, time, middle = self.crossing, length.values / VELOCITY, theta.values
        lenses = {"free": crossing.blind_lens(False), "driven": crossing.blind_lens(True)}
        return {
            "standing": standing(crossing.allowed, crossing.rotation, time, middle[:, None]),
            **{
                name: np.transpose([lens.error(each, middle) for each in time])
                for name, lens in lenses.items()
            },
        }

    # --- checks -------------------------------------------------------------------------------

    disc = check(
        title="equation 8.1",
        statement="difference from the disc [m]",
        value=lambda self, standing: disc_difference(self.crossing, standing),
        at_most=1e-9,
    )
    worst_case = check(
        title="53.7 um",
        statement="relative difference of equation 8.1 from 53.7 um",
        value=lambda: abs(_thesis() / 53.7e-6 - 1.0),
        at_most=1e-3,
    )
    flight = check(
        title="lens in flight",
        statement="largest difference of a lens error from an integration, over the deviation",
        value=lambda self, answer: flight_difference(self.crossing, answer),
        at_most=1e-6,
    )
    order = check(
        title="order",
        statement="largest error of a free lens over the largest of a standing one",
        value=lambda free, standing: float(abs(free).max()) / float(abs(standing).max()),
        at_most=0.1,
    )

    @check(title="reference strategy", at_most=0.3)
    def reference(self, end: DataArray, driven: DataArray) -> float:
        """largest difference of its last error from the blind loop's, over its worst and swing"""
        crossing, theory = self.crossing, driven.sel(theta=end["angle"]).drop_vars("theta")
        # The false displacement enters while the light fades and returns.
        scale = abs(theory).max("angle") + crossing.swing * ACCEPTABLE_ERROR[crossing.axis]
        linear = abs(end) < CAPTURE[crossing.axis] / 2  # the diodes are nearly linear there
        return float((abs(end - theory) / scale).where(linear).max())

    replay = check(
        title="replay",
        statement="largest relative change of a kept peak at half the step",
        value=lambda self, answer: half_step_change(self.crossing, answer),
        at_most=0.02,
    )

    @check(title="harder", at_most=0.05)
    def reversed(self, peak: DataArray) -> float:
        """share of defects kept though lost at a smaller deviation, reference"""
        kept = self.kept(peak).sel(strategy="reference").transpose(..., "share").values
        return float((kept[..., 1:] & ~kept[..., :-1]).mean())

    @check(title="{strategy} survives more", at_most=1.0 - CLAIM_SHARE, each="strategy")
    def survives_more(self, peak: DataArray) -> DataArray:
        """share of draws in which it survives fewer defects of the map than the reference"""
        kept = self.kept(peak).mean(["angle", "length", "share"])
        fewer = kept < kept.sel(strategy="reference")
        return share_of_draws(fewer.sel(strategy=["A", "B"]), "strategy")

    # --- what is told -------------------------------------------------------------------------

    def kept(self, peak: DataArray) -> DataArray:
        """Whether the true error stays within the diodes' capture range."""
        return peak <= CAPTURE[self.crossing.axis]

    thesis_um = metric(lambda: 1e6 * _thesis())
    theory_um = metric(
        template=lambda standing, free, driven: {
            f"{one.name}_um": 1e6 * float(abs(one).max()) for one in (standing, free, driven)
        }
    )
    survived = metric(
        template="survived_{strategy}_{summary}",
        value=lambda self, peak: draws_summary(self.kept(peak).mean(["angle", "length", "share"])),
    )
    survived_red_book = metric(
        template="survived_red_book_{strategy}_{summary}",
        value=lambda self, peak: draws_summary(
            self.kept(peak).sel(share=1.0).mean(["angle", "length"])
        ),
    )
    in_spec = metric(
        template="in_spec_red_book_{strategy}_{summary}",
        value=lambda self, peak: draws_summary(
            (peak.sel(share=1.0) <= ACCEPTABLE_ERROR[self.crossing.axis]).mean(["angle", "length"])
        ),
    )
    worst = metric(
        template="worst_red_book_{strategy}_{summary}_um",
        value=lambda peak: draws_summary(1e6 * peak.sel(share=1.0).max(["angle", "length"])),
    )

    def first_lost(self, peak: DataArray, length: DataArray) -> DataArray:
        """Shortest defect [mm] that is lost at some angle in some draw; NaN if there is none."""
        safe = self.kept(peak).sel(share=1.0).all(["angle", "draw"])
        return 1e3 * length.where(~safe).min("length")

    first_lost_mm = metric("first_lost_{strategy}_mm", value=first_lost)

    @table
    def survival(self, peak: DataArray, length: DataArray) -> Any:
        """Share of defects that each strategy survives: mean, and 90 % range of the draws."""
        red_book, over = peak.sel(share=1.0), ["angle", "length"]
        readable = red_book <= ACCEPTABLE_ERROR[self.crossing.axis]
        shares = (
            self.kept(peak).mean([*over, "share"]),
            self.kept(red_book).mean(over),
            readable.mean(over),
        )
        first, rows = self.first_lost(peak, length), []
        for name in STRATEGIES:
            own = [
                interval_text(draws_summary(100.0 * one.sel(strategy=name)), form="{:.1f}")
                for one in shares
            ]
            worst = interval_text(
                draws_summary(1e6 * red_book.max(over).sel(strategy=name)), form="{:.2f}"
            )
            lost = float(first.sel(strategy=name))
            rows.append([titled(name), *own, worst, "none" if np.isnan(lost) else f"{lost:.2f}"])
        heads = ["strategy", "kept, all [%]", "kept, Red Book [%]", "in spec, Red Book [%]"]
        return [*heads, "worst [um]", "shortest defect lost [mm]"], rows

    cells = table(lambda peak: cells_table(peak))

    @table
    def theories(self, answer: Dataset) -> Any:
        """The three theories, and the worst case of the thesis."""
        numbers, words = self.metrics(answer), {**LENSES, "thesis": WORST_CASE}
        rows = [[text, f"{numbers[f'{key}_um']:.2f}"] for key, text in words.items()]
        heads = ["lens during the longest defect, worst angle", "error [um]"]
        return {"theory": markdown_table(heads, rows)}

    @figure
    def both(self, answer: Dataset) -> Any:
        axis = self.crossing.axis
        return {"equation-8-1": against_theory(answer, axis), "survival": maps(answer, axis)}


def _thesis() -> float:
    """Equation 8.1 [m] for the worst case of the thesis."""
    return float(standing(red_book("focus").deviation, *WORST, 0.0))
