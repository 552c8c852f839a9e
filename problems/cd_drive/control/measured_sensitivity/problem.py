"""Sensitivity measured on the bench and in simulations (figure 6.6, section 6.4).

Figure, section and equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import problem
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import DataArray, Dataset, Figure
from workbench.executor import Context
from workbench.study import (
    Study,
    array,
    arrays,
    check,
    dim,
    draws_summary,
    figure,
    independent_seeds,
    interval_text,
    metric,
    part,
    share_of_draws,
    table,
)
from workbench.study.draws import SURE
from workbench.systems import loop_response

from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, drives
from ...laboratory.in_the_loop import DISC_SHARE
from ..control_problem import performance_weight
from ..loops import SCALES
from .experiment import (
    Measurement,
    continuous_sensitivity,
    experiment_on,
    measured,
    sampled_sensitivity,
)
from .figures import figure_6_6, good_from

BAND = (20.0, 8000.0)
"""Lowest and highest frequency of the sine [Hz]."""
DISCS = {"ordinary": DISC_SHARE, "red_book": 1.0}
"""Deviation of each disc over the Red Book's."""
ACCURACIES = (0.1, 0.3)
"""Radius of the 99 % region, over |S|, up to which a measurement is good: 0.9 dB, and an accuracy
that is still visible in a drawn curve.
"""
COMPARED = ACCURACIES[0]
"""The accuracy at which measured and simulated sensitivities are compared."""
MODELS = ("told", "continuous")
"""Simulations: of the sampled loop as the experimenter knows it, and as in the thesis."""
SIMILAR_RMS, SIMILAR_MOST = 1.0, 3.0
"""Root mean square and largest difference [dB] of two curves that count as similar: too small to
see in a figure that spans 60 dB.
"""


@problem(
    "cd/{axis}/measured-sensitivity",
    slow=True,
    axis=("focus", "radial"),
    data=(*TABLES, "data/red_book.csv"),
)
def measured_sensitivity(
    axis: Axis,
    frequencies: Annotated[int, Field(ge=8, le=400)] = 30,
    draws: Annotated[int, Field(ge=1, le=1000)] = 3,
) -> MeasuredSensitivity:
    """Sensitivity of the twelve drives measured in the laboratory, beside simulations (figure 6.6).

    A stepped sine is added in the loop while the disc turns, for half a second or more at each
    frequency, of which the later half counts. The sine's part in the signal behind the point where
    it is added, divided by the sine, is the sensitivity. This is done with the reference controller
    and with a third of its gain, on a disc that deviates by a fifth of what the Red Book allows,
    and on one that deviates by all of it. The result is compared with the sensitivity of the
    sampled loop as the experimenter knows it, whose optical gain, delay and filters are told with
    errors (see `laboratory.unknowns`), and with that of the loop in continuous time without delay,
    as the thesis simulates it.

    A measurement is good if the radius of its 99 % region is at most a tenth of |S|; the study
    finds the frequency from which this is so. At low frequencies the loop suppresses the sine until
    it vanishes in the noise; around 1 kHz the limit of the control signal limits the sine. The
    regions hold the random error only. The curvature of the diodes' characteristic also lowers the
    loop gain slightly where the lens moves far, most of all radially, so the metrics `covered` are
    below 0.99, and radially far below.

    frequencies: number of frequencies, logarithmically spaced from 20 to 8000 Hz. draws: number of
    draws of the noise and of the told values on each drive.
    """
    return MeasuredSensitivity(axis, frequencies, draws)


@dataclass(frozen=True)
class MeasuredSensitivity(Study):
    """Stepped sines in the loops of twelve drives, at two gains and on two discs."""

    axis: Axis
    frequencies: int
    draws: int

    headline: ClassVar[str] = "similar_full_ordinary_told"

    @property
    def quantifier(self) -> str:
        return f"for these 12 drives, in {self.draws} simulated draws on each"

    scale, disc, model = dim(SCALES), dim(DISCS), dim(MODELS)
    drive = dim(lambda self: [one.name for one in drives(self.axis)])
    draw = dim(lambda self: range(self.draws))
    accuracy = dim(ACCURACIES)
    frequency = dim(
        lambda self: np.geomspace(*BAND, self.frequencies), unit="Hz", meaning="frequency"
    )

    @array(dims=(drive, draw))
    def seed(self, context: Context) -> Any:
        return independent_seeds(context.rng, 12, self.draws)

    @part
    def records(self, context: Context, seed: DataArray, frequency: DataArray) -> list[Measurement]:
        """Measurements in the order of scale, disc, drive, draw."""
        grid, sizes = frequency.values, list(SCALES.values())
        deviations, names = list(DISCS.values()), seed["drive"].values.tolist()

        def played(place: tuple[int, ...]) -> Measurement:
            n, m, i, k = place
            trial = experiment_on(self.axis, names[i], grid, deviations[m], sizes[n])
            return measured(trial, int(seed.values[i, k]))

        return context.spread(played, list(np.ndindex(*self._shape)), "records")

    @property
    def _shape(self) -> tuple[int, ...]:
        return len(SCALES), len(DISCS), 12, self.draws

    def _every(self, records: list[Measurement], name: str) -> Any:
        """One field of all records (scales, discs, drives, draws, ...)."""
        found = np.array([getattr(one, name) for one in records])
        return found.reshape(*self._shape, *found.shape[1:])

    # --- the first draw -----------------------------------------------------------------------

    @arrays((scale, disc, drive, frequency), size=("1", "|S| measured"), radius="1")
    def first(self, records: list[Measurement]) -> dict[str, RealArray]:
        """Sensitivities of the first draw."""
        return {
            "size": abs(self._every(records, "S")[..., 0, :]).astype("f4"),
            "radius": self._every(records, "radius")[..., 0, :].astype("f4"),
        }

    @array(
        dims=(model, scale, drive, frequency),
        unit="1",
        meaning="|S| simulated; as told in the first draw",
    )
    def simulated(
        self, records: list[Measurement], frequency: DataArray, drive: DataArray
    ) -> RealArray:
        told = abs(self._every(records, "model")[:, 0, :, 0])
        continuous = [
            [
                continuous_sensitivity(self.axis, name, frequency.values, one)
                for name in drive.values
            ]
            for one in SCALES.values()
        ]
        return np.array([told, continuous])

    permitted = array(dims=frequency, unit="1", meaning="1/|W_p|")(
        lambda self, frequency: (
            1 / abs(loop_response(performance_weight(self.axis), frequency.values))
        )
    )

    # --- all draws ----------------------------------------------------------------------------

    events = array(
        dims=(scale, disc, drive, draw), unit="", meaning="times that the loop was lost or regained"
    )(lambda self, records: self._every(records, "events"))
    saturated = array(
        dims=(scale, disc, drive, draw), unit="", meaning="share of the samples of u at its limit"
    )(lambda self, records: self._every(records, "saturated"))

    @part
    def good(self, records: list[Measurement]) -> Any:
        """Whether a measurement is good (accuracies, scales, discs, drives, draws, F)."""
        share = self._every(records, "radius") / abs(self._every(records, "S"))
        return share <= np.array(ACCURACIES).reshape(-1, *[1] * share.ndim)

    @array(
        dims=(accuracy, scale, disc, drive, draw),
        unit="Hz",
        meaning="lowest frequency from which on it is good",
    )
    def good_from(self, good: Any, frequency: DataArray) -> RealArray:
        """NaN if not even the highest frequency is good."""
        bad = ~good
        last = good.shape[-1] - 1 - np.argmax(bad[..., ::-1], axis=-1)
        first = np.where(bad.any(axis=-1), last + 1, 0)
        edge = np.append(frequency.values, np.nan)
        return edge[first]

    @array(
        dims=(scale, disc, drive, draw),
        unit="1",
        meaning="share of good measurements whose region holds S",
    )
    def held(
        self, records: list[Measurement], good: Any, frequency: DataArray, drive: DataArray
    ) -> RealArray:
        exact = np.array(
            [
                [
                    sampled_sensitivity(
                        experiment_on(self.axis, name, frequency.values, DISC_SHARE, one)
                    )
                    for name in drive.values
                ]
                for one in SCALES.values()
            ]
        )[:, None, :, None]
        within = abs(self._every(records, "S") - exact) <= self._every(records, "radius")
        return _mean(within, good[ACCURACIES.index(COMPARED)])

    @arrays((model, scale, disc, drive, draw), rms="dB", most="dB")
    def difference(
        self,
        records: list[Measurement],
        good: Any,
        simulated: DataArray,
    ) -> dict[str, RealArray]:
        """Of measured and simulated |S| where the measurement is good"""
        size = abs(self._every(records, "S"))
        told = abs(self._every(records, "model"))
        continuous = simulated.sel(model="continuous").values[:, None, :, None]
        off = 20 * np.log10(np.array([size / told, size / continuous]))
        counted = np.broadcast_to(good[ACCURACIES.index(COMPARED)], off.shape)
        largest = np.where(counted, abs(off), -np.inf).max(axis=-1)
        return {
            "rms": np.sqrt(_mean(off**2, counted)),
            "most": np.where(np.isfinite(largest), largest, np.nan),
        }

    @arrays((accuracy, scale, disc, drive, draw), weighted="1", fails_below="Hz")
    def against_weight(
        self, records: list[Measurement], good: Any, permitted: DataArray, frequency: DataArray
    ) -> dict[str, RealArray]:
        """Largest |W_p S| among good measurements, and the highest frequency of a region above 1"""
        size, radius = abs(self._every(records, "S")), self._every(records, "radius")
        weighted = np.where(good, size / permitted.values, -np.inf).max(axis=-1)
        above = size - radius > permitted.values
        below = np.where(good & above, frequency.values, 0.0).max(axis=-1)
        return {"weighted": np.where(np.isfinite(weighted), weighted, np.nan), "fails_below": below}

    # --- checks -------------------------------------------------------------------------------

    holds = check(
        title="the loop holds",
        statement="times that it was lost or regained on an ordinary disc, any draw",
        value=lambda events: events.sel(disc="ordinary"),
        at_most=0.0,
    )
    converter = check(
        title="saturation",
        statement="share of the samples of u at the converter's limit on an ordinary disc, any "
        "draw",
        value=lambda saturated: saturated.sel(disc="ordinary"),
        at_most=0.0,
    )
    alike = check(
        title="similar, {scale} gain",
        statement="share of records on an ordinary disc whose |S| is not similar to the model's, "
        "as told",
        value=lambda answer: (1.0 - share_of_draws(_similar(answer), "scale", "disc", "model")).sel(
            disc="ordinary", model="told"
        ),
        each="scale",
        at_most=1.0 - SURE,
    )

    # --- what is told -------------------------------------------------------------------------

    similar = metric(
        template="similar_{scale}_{disc}_{model}",
        value=lambda answer: share_of_draws(_similar(answer), "scale", "disc", "model"),
    )
    rms_db = metric(
        template="rms_db_{scale}_{disc}_{model}_{summary}",
        value=lambda rms: draws_summary(rms, "drive"),
    )
    most_db = metric(
        template="largest_db_{scale}_{disc}_{model}_{summary}",
        value=lambda most: draws_summary(most, "drive"),
    )
    good_hz = metric(
        template="good_{accuracy}_from_hz_{scale}_{disc}_{summary}",
        value=lambda good_from: draws_summary(
            good_from.assign_coords(accuracy=[f"{100 * one:.0f}_percent" for one in ACCURACIES]),
            "drive",
        ),
    )
    lost = metric(
        template="lost_{scale}_{disc}", value=lambda events: (events > 0).mean(["drive", "draw"])
    )
    covered = metric(
        template="covered_{scale}_{disc}", value=lambda held: held.mean(["drive", "draw"])
    )
    measured_weighted = metric(
        template="weighted_{scale}_{disc}_{summary}",
        value=lambda weighted: draws_summary(weighted.sel(accuracy=COMPARED), "drive"),
    )
    fails_hz = metric(
        template="fails_below_hz_{scale}_{disc}_{summary}",
        value=lambda fails_below: draws_summary(fails_below.sel(accuracy=ACCURACIES[-1]), "drive"),
    )

    @table
    def comparison(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        """Each gain and disc: mean and 90 % range of the records."""
        numbers = {
            name: draws_summary(answer[name], "drive") for name in ("rms", "most", "good_from")
        }
        similar, rows = _similar(answer), []
        for scale in SCALES:
            for disc in DISCS:
                at = {"scale": scale, "disc": disc}
                cells = []
                for one in MODELS:
                    cells.append(f"{float(similar.sel(at | {'model': one}).mean()):.0%}")
                    cells += [
                        interval_text(numbers[name].sel(at | {"model": one}), form="{:.2f}")
                        for name in ("rms", "most")
                    ]
                good = numbers["good_from"].sel(at)
                cells += [
                    interval_text(good.sel(accuracy=one), form="{:.0f}") for one in ACCURACIES
                ]
                lost = float((answer["events"].sel(at) > 0).mean())
                rows.append([scale, disc.replace("_", " "), *cells, f"{lost:.0%}"])
        heads = ["gain", "disc"]
        for words in ("sampled, as told", "continuous"):
            heads += [f"similar to {words}", "rms [dB]", "largest [dB]"]
        heads += [f"good to {one:.0%} from [Hz]" for one in ACCURACIES]
        return [*heads, "loop lost"], rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        return {
            "figure-6-6": figure_6_6(answer, self.axis, COMPARED),
            "good-from": good_from(answer, self.axis),
        }


def _similar(answer: Dataset) -> DataArray:
    """Whether measured and simulated |S| are similar; false if no measurement is good or the loop
    is lost.
    """
    close = (answer["rms"] <= SIMILAR_RMS) & (answer["most"] <= SIMILAR_MOST)
    return close & (answer["events"] == 0)


def _mean(values: Any, counted: Any) -> RealArray:
    """Mean along the last axis of the values that count; NaN if none counts."""
    number = counted.sum(axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        found: RealArray = np.where(counted, values, 0.0).sum(axis=-1) / number
    return found
