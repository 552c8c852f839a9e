"""Four estimators and three kinds of excitation on one coil (sections 4.1.1 and 4.1.2).

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from workbench import problem
from workbench.executor import Context
from workbench.identification import ResponseEstimate
from workbench.study import (
    CLAIM_SHARE,
    LEAST_COVERAGE_P,
    Study,
    array,
    arrays,
    check,
    coverage_p,
    dim,
    draws_summary,
    figure,
    independent_seeds,
    interval_text,
    markdown_table,
    metric,
    part,
    share_of_draws,
    table,
)
from workbench.types import ComplexArray, DataArray, Dataset, Figure, RealArray

from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, Values
from ..coil_current import RESONANCE
from ..experiment import Laboratory
from ..known_values import CONFIDENCE
from ..unknowns import DRIVES
from .estimators import BY_RECORD, ESTIMATORS, estimates
from .excitations import EXCITATIONS, RESPONSES, SEGMENTS, Excited
from .figures import error_curves, methods_bode

NOISES = {"quiet": 1.0, "noisy": 10.0}
"""Electronic noise in rms steps of the converter: that of the laboratory, and ten times that."""
PARAMETERS = ("R", "Bl", "k", "b")
LONGEST = list(SEGMENTS)[-1]
"""Estimate from spectra that is judged: its segments are long enough for the resonance."""
RESPONSE_TOLERANCE = 0.01
"""Largest accepted rms error of a response over the frequencies, with the laboratory's noise."""
ALIKE = 0.05
"""Largest accepted difference between the errors by instruments and by prediction errors, relative.
"""
UNBIASED = ("instruments", "prediction_errors")


class Draw(NamedTuple):
    """Estimates of one draw: by RESPONSES, and by (EXCITATIONS, ESTIMATORS)."""

    measured: ComplexArray
    radius: RealArray
    fitted: ComplexArray
    distance: RealArray
    parameters: RealArray


@problem("cd/{axis}/response-methods", slow=True, axis=("focus", "radial"), data=TABLES)
def response_methods(
    axis: Axis,
    drive: str = "CD1",
    amplitude: Annotated[float, Field(gt=0, le=10)] = 0.1,
    duration: Annotated[float, Field(ge=26, le=1000)] = 30.0,
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
    values: Values = "printed",
) -> ResponseMethods:
    """v_r/u of a coil by steps, sines or noise, and its model by four estimators (section 4.1).

    The three excitations have the same duration and the same largest voltage, from 10 to 50 Hz
    (focus) or 100 Hz (radial). Responses without a model come from the differences of a step's
    record, from the whole periods of settled sines, and from averaged spectra (eq. 4.3) with
    segments of four lengths. Models of second order come from each record, by least squares (eq.
    4.1), refined instrumental variables (eq. 4.2) and prediction errors; and from each response,
    weighted by its variance, by maximum likelihood. The experimenter knows the computer's output,
    how it reaches the coil, and the mass.

    drive: CD1 ... CD12. amplitude [V], duration [s]: of each excitation. draws: number of draws of
    the noise, at the laboratory's size and at ten times that. values: tables "printed" or
    "corrected".
    """
    return ResponseMethods(Excited(Laboratory(axis, drive, values), amplitude, duration), draws)


@dataclass(frozen=True, eq=False)
class ResponseMethods(Study):
    """Every excitation, response and estimator at both sizes of noise."""

    excited: Excited
    draws: int

    headline: ClassVar[str] = "error_quiet_sines_mean"

    @property
    def quantifier(self) -> str:
        drive = self.excited.laboratory.drive
        return f"on {drive}, in {self.draws} simulated draws of each noise"

    noise, response = dim(tuple(NOISES)), dim(RESPONSES)
    excitation, estimator, parameter = dim(EXCITATIONS), dim(ESTIMATORS), dim(PARAMETERS)
    frequency = dim(lambda self: self.excited.frequency, unit="Hz", meaning="frequency")
    draw = dim(lambda self: range(self.draws))
    fits = (noise, draw, excitation, estimator)

    @array(dims=(noise, draw))
    def seed(self, context: Context) -> Any:
        every = independent_seeds(context.rng, self.draws, len(NOISES), len(DRIVES))
        return every[..., DRIVES.index(self.excited.laboratory.drive)].T

    truth = array(
        dims=frequency,
        unit="V/V",
        meaning="v_r/u without noise",
        value=lambda self: self.excited.sweep.exact(),
    )

    @array(dims=parameter)
    def known(self, truth: DataArray) -> RealArray:
        """R [ohm], Bl [N/A], k [N/m], b [N s/m] of the lumped fit to the noise-free response"""
        one = self.excited.sweep
        return one.fit(truth.values, np.full(truth.shape, 1e-12), np.inf, one.mass).values[:4]

    @part
    def every(self, seed: DataArray, truth: DataArray, context: Context) -> dict[str, RealArray]:
        """Fields of `Draw` by name, each over (noise, draw, ...)."""
        self.excited.played["step"]  # computed once, before parallel threads need it

        def one(place: tuple[int, ...]) -> Draw:
            return self.estimated(list(NOISES.values())[place[0]], int(seed[place]), truth.values)

        places = list(np.ndindex(seed.shape))
        found = context.spread(one, places, "draws")
        stacked = zip(*found, strict=True)
        return {
            name: np.reshape(each, (*seed.shape, *np.shape(each)[1:]))
            for name, each in zip(Draw._fields, stacked, strict=True)
        }

    def estimated(self, steps: float, seed: int, truth: ComplexArray) -> Draw:
        """One draw with noise of this many steps: a record of each excitation, and all
        estimates.
        """
        responses: dict[str, ResponseEstimate] = {}
        fits = []
        noises = np.random.default_rng(seed).integers(2**31, size=len(EXCITATIONS))
        for name, own in zip(EXCITATIONS, noises.tolist(), strict=True):
            record = self.excited.record(name, steps, own)
            found = self.excited.responses(name, record)
            responses |= found
            judged = found.get(name, found.get(LONGEST))
            assert judged is not None
            fits.append(estimates(self.excited, name, record, judged, truth))
        return Draw(
            np.array([responses[name].response[:, 0, 0] for name in RESPONSES]),
            np.array([responses[name].radius()[:, 0, 0] for name in RESPONSES]),
            *(np.array([[one[i] for one in row] for row in fits]) for i in range(3)),
        )

    @arrays((noise, draw, response, frequency), error="1", missed="1")
    def errors(self, every: dict[str, RealArray], truth: DataArray) -> dict[str, RealArray]:
        """Relative errors without a model, and whether the truth is outside the 99 % region."""
        apart = abs(every["measured"] - truth.values)
        missed = apart > every["radius"]
        return {"error": (apart / abs(truth.values)).astype("f4"), "missed": missed.astype("i1")}

    @arrays((*fits, frequency), fit_error="1", fit_missed="1")
    def fit_errors(self, every: dict[str, RealArray], truth: DataArray) -> dict[str, RealArray]:
        """Relative errors of models, and whether the truth is outside the 99 % region."""
        error = abs(every["fitted"] / truth.values - 1.0)
        missed = every["distance"] > 1.0  # always false without a region
        return {"fit_error": error.astype("f4"), "fit_missed": missed.astype("i1")}

    @array(dims=(*fits, parameter), unit="1", meaning="relative errors of the parameters")
    def parameter_error(self, every: dict[str, RealArray], known: DataArray) -> RealArray:
        return (every["parameters"] / known.values - 1.0).astype("f4")

    @arrays((noise, response, frequency), first="V/V", first_radius="V/V")
    def shown(self, every: dict[str, RealArray]) -> dict[str, Any]:
        """Responses of the first draw, and radii of their 99 % regions."""
        return {"first": every["measured"][:, 0], "first_radius": every["radius"][:, 0]}

    # --- checks -------------------------------------------------------------------------------

    @check(title="{response}", at_most=1.0 - CLAIM_SHARE, each="response")
    def response_found(self, error: DataArray) -> DataArray:
        """share of the quiet draws in which the rms error of the response exceeds 1 %"""
        judged = rms(error).sel(noise="quiet", response=["step", "sines", LONGEST])
        return share_of_draws(judged > RESPONSE_TOLERANCE, "response")

    @check(title="instruments, {excitation}", at_most=1.0 - CLAIM_SHARE, each="excitation")
    def instruments_nearer(self, fit_error: DataArray) -> DataArray:
        """share of the noisy draws in which least squares are nearer than instruments"""
        by = rms(fit_error).sel(noise="noisy")
        nearer = by.sel(estimator="least_squares") < by.sel(estimator="instruments")
        return share_of_draws(nearer, "excitation")

    @check(title="prediction errors", at_most=ALIKE)
    def alike(self, fit_error: DataArray) -> DataArray:
        """relative difference of the rms errors by instruments and by prediction errors"""
        by = rms(fit_error)
        return abs(by.sel(estimator="prediction_errors") / by.sel(estimator="instruments") - 1)

    @check(title="regions", at_most=1.0 - LEAST_COVERAGE_P)
    def regions(self, answer: Dataset) -> float:
        """1 - probability that 99 % regions hold the response at resonance in no more draws

        Those of the step, of the sines, of instruments and of prediction errors; errors at other
        frequencies go with those of one draw.
        """
        at = {"frequency": RESONANCE[self.excited.laboratory.axis]}
        plain = answer["missed"].sel(response=["step", "sines"]).sel(at, method="nearest")
        fits = answer["fit_missed"].sel(estimator=list(UNBIASED)).sel(at, method="nearest")
        return max(float((1.0 - coverage_p(one == 0, CONFIDENCE)).max()) for one in (plain, fits))

    # --- what is told -------------------------------------------------------------------------

    errors_without_model = metric(
        template="error_{noise}_{response}_{summary}", value=lambda error: draws_summary(rms(error))
    )
    errors_of_fits = metric(
        template="error_{noise}_{excitation}_{estimator}_{summary}",
        value=lambda fit_error: draws_summary(rms(fit_error)),
    )
    errors_of_parameters = metric(
        template="error_{noise}_{excitation}_{estimator}_{parameter}",
        value=lambda parameter_error: np.sqrt((parameter_error**2).mean("draw")),
    )
    outside = metric(
        template="missed_{noise}_{response}",
        value=lambda missed: missed.mean(("draw", "frequency")),
    )
    outside_of_fits = metric(
        template="missed_{noise}_{excitation}_{estimator}",
        value=lambda fit_missed: fit_missed.sel(estimator=list(BY_RECORD)).mean(
            ("draw", "frequency")
        ),
    )
    waiting = metric(lambda self: self.excited.waiting)

    @metric("nearer_{noise}_{pair}")
    def nearer(self, answer: Dataset) -> DataArray:
        """Share of the draws in which the first of two estimators is nearer to the truth."""
        import xarray as xr

        found, of_fits = rms(answer["error"]), rms(answer["fit_error"])
        by = {name: found.sel(response=name, drop=True) for name in RESPONSES}
        pairs = {
            f"{first}_than_{second}": by[first] < by[second]
            for first, second in (("sines", "step"), ("sines", LONGEST), ("step", LONGEST))
        }
        for name in EXCITATIONS:
            one = of_fits.sel(excitation=name, drop=True)
            by_estimator = {each: one.sel(estimator=each, drop=True) for each in ESTIMATORS}
            for other in ("least_squares", "likelihood"):
                pairs[f"{name}_instruments_than_{other}"] = (
                    by_estimator["instruments"] < by_estimator[other]
                )
        return xr.concat(
            [share_of_draws(one, "noise") for one in pairs.values()], "pair"
        ).assign_coords(pair=list(pairs))

    @table
    def methods(self, answer: Dataset) -> dict[str, str]:
        """Rms errors over the frequencies, and how often regions miss the truth."""
        found, of_fits = (
            draws_summary(rms(answer["error"])),
            draws_summary(rms(answer["fit_error"])),
        )
        heads = ["noise", "rms error [%]", "frequencies missed"]
        plain, models = [], []
        for noise in NOISES:
            for name in RESPONSES:
                at = {"noise": noise, "response": name}
                missed = float(answer["missed"].sel(at).mean())
                told = interval_text(100 * found.sel(at), form="{:.3g}")
                plain.append([name.replace("_", " "), noise, told, f"{missed:.1%}"])
            for name in EXCITATIONS:
                for estimator in ESTIMATORS:
                    at = {"noise": noise, "excitation": name, "estimator": estimator}
                    missed = float(answer["fit_missed"].sel(at).mean())
                    told = interval_text(100 * of_fits.sel(at), form="{:.3g}")
                    share = f"{missed:.1%}" if estimator in BY_RECORD else ""
                    models.append([name, estimator.replace("_", " "), noise, told, share])
        return {
            "responses": markdown_table(["response by", *heads], plain),
            "models": markdown_table(["record of", "model by", *heads], models),
        }

    @figure
    def pictures(self, answer: Dataset) -> dict[str, Figure]:
        one = self.excited.laboratory
        title = f"{one.drive} {one.axis}"
        return {
            "responses": methods_bode(answer, f"{title}, one record"),
            "errors": error_curves(answer, f"{title}, {self.draws} draws"),
        }


def rms(error: DataArray) -> DataArray:
    """Root mean square of relative errors (..., frequency) over the frequencies."""
    return (error.astype(float) ** 2).mean("frequency") ** 0.5
