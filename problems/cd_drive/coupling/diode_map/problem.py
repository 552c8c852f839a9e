"""Can a function of four diodes find the true errors in a defect (section 7.4)?

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import problem
from workbench.executor import Context
from workbench.study import (
    Study,
    array,
    check,
    dim,
    draws_summary,
    figure,
    independent_seeds,
    interval_text,
    metric,
    part,
    share_interval,
    table,
)
from workbench.types import DataArray, Dataset, RealArray

from ...diagnosis.defect_kinds import KINDS
from ...drive.photo_diodes import CAPTURE
from ...drive.shared_parameters import TABLES
from ...drive.tables import AXES, drives
from ...laboratory.bench_setup import NOISE
from .bench import NORMALISERS, DefectBench
from .figures import left_by_kind
from .runs import ESTIMATES, REFRACTIONS, DiodeMap, Draw, Points, together

TRAINING = 4
"""Number of records of every drive from which the map is learnt."""
READING, NOTHING, TWO, FOUR = ESTIMATES
STEPS = (1, 2)
"""Numbers of steps per sample in which the optics are simulated."""


@problem(
    "cd/diode-map",
    data=(*TABLES, "data/red_book.csv", "data/disc_formats.csv", "data/compact_disc.csv"),
)
def diode_map(draws: Annotated[int, Field(ge=1, le=1000)] = 6) -> DiodeMapStudy:
    """Can a function of four diodes find the true errors in a defect (section 7.4)?

    Both loops run over scratches, finger prints, black dots and dropouts, on the Red Book's disc.
    The map gives the mean true errors of the nearest readings of other records: no static function
    of the same diodes has a smaller mean square error, for many records. It is compared with the
    normalised readings, with the guess that both errors are 0, and with a map of the own pair only.

    Assumed: the laboratory's defects, which dim all diodes alike and move each reading; whether the
    false displacements of both axes belong together, in two cases; D3 as noisy as D1. Simulated:
    errors left in defects of records that the map has not seen and in which no loop is lost, with
    intervals over draws; the loops' largest errors with D1 + D2 and with D3 as normaliser.

    draws: number of records of every drive that judge the map.
    """
    return DiodeMapStudy(draws)


@dataclass(frozen=True)
class DiodeMapStudy(Study):
    """Squared errors of every estimate in the defects of records."""

    draws: int

    headline: ClassVar[str] = "left_focus_independent"

    @property
    def quantifier(self) -> str:
        return f"for these 12 drives, in {self.draws} simulated records of each"

    refraction, estimate = dim(REFRACTIONS), dim(ESTIMATES)
    axis, kind, normaliser = dim(AXES), dim(KINDS), dim(NORMALISERS)
    drive = dim(lambda: [one.name for one in drives("focus")])
    draw = dim(lambda self: range(self.draws))
    step = dim(STEPS, meaning="steps per sample")

    @part
    def seed(self, context: Context) -> Any:
        """Seeds of the records that judge (drives, draws)."""
        return independent_seeds(context.rng, 12, self.draws)

    @part
    def maps(self, drive: DataArray, context: Context) -> list[DiodeMap]:
        """A map for each of REFRACTIONS, learnt from records of all drives."""
        seeds = independent_seeds(context.rng, 12, TRAINING)
        found = []
        for refraction in REFRACTIONS:
            records = [
                Draw(int(seed), refraction).points(DefectBench(name))
                for name, row in zip(drive.values.tolist(), seeds, strict=True)
                for seed in row
            ]
            found.append(DiodeMap(together(records)))
        return found

    @part
    def judged(self, seed: Any, drive: DataArray, context: Context) -> list[list[Points]]:
        """Records by refraction, over drives and draws; then those with D3 as normaliser."""
        cases: list[tuple[str, Any]] = [(one, NORMALISERS[0]) for one in REFRACTIONS]
        cases.append((REFRACTIONS[0], NORMALISERS[1]))

        def one(place: tuple[int, ...]) -> list[Points]:
            name, number = str(drive.values[place[0]]), int(seed[place])
            return [Draw(number, r).points(DefectBench(name, by)) for r, by in cases]

        found = context.spread(one, list(np.ndindex(seed.shape)), "records")
        return [list(row) for row in zip(*found, strict=True)]

    @part
    def by_draw(self, judged: list[list[Points]]) -> list[list[Points]]:
        """Samples of all drives together, by refraction and draw."""
        few = judged[: len(REFRACTIONS)]
        return [[together(row[n :: self.draws]) for n in range(self.draws)] for row in few]

    @array(
        dims=(refraction, draw, estimate, axis, kind),
        unit="m^2",
        meaning="sum of the squared errors of an estimate in defects of all drives",
    )
    def square(self, maps: list[DiodeMap], by_draw: list[list[Points]]) -> RealArray:
        pairs = zip(maps, by_draw, strict=True)
        rows = [[_squares(one, own) for own in records] for one, records in pairs]
        return np.array(rows).astype("f4")

    @array(dims=(refraction, draw, kind), unit="1", meaning="number of samples in defects")
    def count(self, by_draw: list[list[Points]]) -> RealArray:
        rows = [[np.bincount(own.kind, minlength=len(KINDS)) for own in row] for row in by_draw]
        return np.array(rows, float)

    @array(dims=(normaliser, axis, drive, draw), unit="m", meaning="largest true error")
    def largest(self, judged: list[list[Points]]) -> RealArray:
        rows = [[own.largest for own in judged[n]] for n in (0, -1)]
        return np.moveaxis(np.reshape(rows, (2, 12, self.draws, 2)), -1, 1).astype("f4")

    @array(
        dims=(axis, draw), unit="m", meaning="rms error of the readings outside defects, loops held"
    )
    def clean(self, judged: list[list[Points]]) -> RealArray:
        rows = np.reshape([own.clean for own in judged[0]], (12, self.draws, 2))
        return np.sqrt(np.nanmean(rows**2, axis=0)).T

    @array(dims=(step, axis), unit="m", meaning="largest true error of the first drive, no noise")
    def quiet(self, drive: DataArray, seed: Any) -> list[RealArray]:
        one, name = Draw(int(seed[0, 0]), REFRACTIONS[0]), str(drive.values[0])
        return [one.points(DefectBench(name, noise=False, refine=n)).largest for n in STEPS]

    # --- checks -------------------------------------------------------------------------------

    @check(at_most=0.3)
    def readings(self, clean: DataArray) -> float:
        """relative distance of the readings' error on the clean disc from the laboratory's noise"""
        noise = np.array([NOISE[axis] for axis in AXES])
        rms = np.sqrt((clean.values**2).mean(axis=1))
        return float(abs(rms / noise - 1.0).max())

    @check(title="half the step", at_most=0.01)
    def replayed(self, quiet: DataArray) -> DataArray:
        """relative change of a largest error when the optics are followed twice as finely"""
        return abs(quiet.isel(step=1) / quiet.isel(step=0) - 1.0)

    @check(title="more diodes", at_most=0.05)
    def no_worse(self, answer: Dataset) -> float:
        """relative excess of the error left by the map of four over that of two"""
        rms = _rms(answer, "kind", "draw")
        return float((rms.sel(estimate=FOUR) / rms.sel(estimate=TWO) - 1.0).max())

    # --- what is told -------------------------------------------------------------------------

    @metric
    def left(self, answer: Dataset) -> dict[str, float]:
        """Error left by the maps over the smaller one of reading and guess 0, over all records."""
        rms, numbers = _rms(answer, "kind", "draw"), dict[str, float]()
        for refraction in REFRACTIONS:
            for axis in AXES:
                own = rms.sel(refraction=refraction, axis=axis)
                other = float(own.sel(estimate=[READING, NOTHING]).min())
                name = f"{axis}_{refraction}"
                numbers |= {
                    f"left_{name}": float(own.sel(estimate=FOUR)) / other,
                    f"left_by_two_{name}": float(own.sel(estimate=TWO)) / other,
                    f"reading_{name}_um": 1e6 * float(own.sel(estimate=READING)),
                    f"nothing_{name}_um": 1e6 * float(own.sel(estimate=NOTHING)),
                    f"map_{name}_um": 1e6 * float(own.sel(estimate=FOUR)),
                }
        return numbers

    @metric("left_{axis}_{refraction}_by_draw_{summary}")
    def left_by_draw(self, answer: Dataset) -> DataArray:
        """The same of every draw, mean and interval of 90 %."""
        return draws_summary(_left(_rms(answer, "kind")))

    @metric
    def by_normaliser(self, answer: Dataset) -> dict[str, float]:
        """Largest errors with D3 over those with D1 + D2, and shares of lost records."""
        ratio = answer["largest"].sel(normaliser="D3") / answer["largest"].sel(normaliser="sum")
        numbers = {f"D3_over_sum_{a}": float(ratio.sel(axis=a).median()) for a in AXES}
        for one in NORMALISERS:
            found = share_interval(_lost(answer["largest"].sel(normaliser=one)))
            ends = found["summary"].values
            numbers |= {f"lost_{one}_{end}": float(found.sel(summary=end)) for end in ends}
        return numbers

    @table
    def by_kind(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        """Rms error [um] in defects of each kind: mean over draws and interval of 90 %."""
        rms, rows = 1e6 * _rms(answer), []
        for refraction in REFRACTIONS:
            for axis in AXES:
                for kind in KINDS:
                    own = rms.sel(refraction=refraction, axis=axis, kind=kind)
                    told = [
                        interval_text(draws_summary(own.sel(estimate=e)), form="{:.2g}")
                        for e in ESTIMATES
                    ]
                    rows.append([refraction, axis, kind, *told])
        return ["displacements", "axis", "defect", *ESTIMATES], rows

    kinds = figure(lambda answer: left_by_kind(1e6 * _rms(answer, "draw")))


def _squares(one: DiodeMap, points: Points) -> RealArray:
    """Sums (4, 2, kinds) [m^2] of the squared errors of every estimate."""
    off = (one.estimates(points) - points.error) ** 2
    by_kind = [off[:, points.kind == kind].sum(axis=1) for kind in range(len(KINDS))]
    return np.moveaxis(np.array(by_kind), 0, -1)


def _lost(largest: DataArray) -> DataArray:
    """Whether focus or track is lost, of largest errors [m] along the dimension "axis"."""
    limit = largest["axis"].copy(data=[CAPTURE[axis] for axis in AXES])
    lost: DataArray = (largest > limit).any("axis")
    return lost


def _rms(answer: Dataset, *over: str) -> DataArray:
    """Rms error [m] of every estimate over these dimensions."""
    kept: DataArray = (answer["square"].sum(over) / answer["count"].sum(over)) ** 0.5
    return kept


def _left(rms: DataArray) -> DataArray:
    """Rms of the map of four over the smaller one of reading and guess 0."""
    least: DataArray = rms.sel(estimate=[READING, NOTHING]).min("estimate")
    return rms.sel(estimate=FOUR, drop=True) / least
