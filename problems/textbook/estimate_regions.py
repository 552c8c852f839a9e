"""What each form of one estimate's uncertainty costs in mu, and how often it holds
the true plant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Run, figures, problem, ref
from workbench.executor import Context
from workbench.identification import CommonPoleModel
from workbench.mu import performance_peak
from workbench.study import (
    LEAST_COVERAGE_P,
    Study,
    array,
    check,
    coverage_p,
    dim,
    figure,
    metric,
    part,
    system,
    table,
)
from workbench.systems import response
from workbench.types import ComplexArray, DataArray, Figure, RealArray, StateSpace
from workbench.uncertainty import EstimateRegion

from .estimate_to_mu import (
    CONTROL_WEIGHT,
    ERROR_WEIGHT,
    OMEGA,
    TRUE_PLANT,
    Uncertainty,
    noisy_estimate,
    region_of,
    weighted_loop,
)

FORMS: tuple[Uncertainty, ...] = ("discs", "ball", "box")
MEMBERS = 200
"""Number of plants drawn from the ball, and from the box."""
FREQUENCY = np.geomspace(0.02, 50.0, 300)
"""Angular frequencies [rad/s] at which the drawn plants and loops are computed."""
GAIN_ROUNDING = 1e-6
"""Rounding error allowed when a drawn loop's gain is compared with the certified peak, relative."""
FINE = np.geomspace(OMEGA[0], OMEGA[-1], 300)
"""Angular frequencies [rad/s] at which it is tested whether the discs hold the true plant."""
OTHER_DRAWS = 1000
"""Seed of the first of the other estimates, which measure the coverage."""
PROOF_WIDTH = 5e-3
"""Largest relative width of the certified interval of a peak."""


@dataclass(frozen=True, eq=False)
class EstimateRegions(Study):
    """Certified peaks of three designs on three sets, gains of drawn plants, and coverage."""

    designs: dict[str, Run]
    noise: float
    confidence: float
    first: int
    draws: int

    headline: ClassVar[str] = "peak_ball"

    @property
    def quantifier(self) -> str:
        return f"for {MEMBERS} plants drawn, or {self.draws} estimates"

    design, region, bound = dim(*FORMS), dim(*FORMS), dim("lower", "upper")
    shape, member = dim("ball", "box"), dim(lambda: np.arange(MEMBERS))
    draw = dim(lambda self: np.arange(self.draws))
    omega = dim(FREQUENCY, unit="rad/s", meaning="angular frequency")

    @part
    def parts(self) -> dict[str, Any]:
        """The uncertainty of the estimate, by form."""
        estimate = noisy_estimate(self.noise, self.first)
        return {form: region_of(estimate, form, self.confidence) for form in FORMS}

    @system(design, called="{}")
    def controllers(self) -> list[StateSpace]:
        return [self.designs[form].answer.K for form in FORMS]

    @array(
        dims=(design, region, bound), unit="1", meaning="certified peak of mu of a design on a set"
    )
    def peak(self, parts: dict[str, Any], controllers: Any, context: Context) -> RealArray:
        found = np.full((3, 3, 2), np.inf)
        plants = [weighted_loop(parts[form]) for form in FORMS]
        for i, K in enumerate(context.track(controllers, "designs")):
            for j, plant in enumerate(plants):
                certified = performance_peak(plant, K)
                if certified is not None:
                    found[i, j] = certified.lower, certified.upper
        return found

    @part
    def plants(self, parts: dict[str, Any]) -> list[ComplexArray]:
        """Responses (members, F) of plants drawn from ball and box."""
        return [
            parts[form].response(
                FREQUENCY, parts[form].sampled(np.random.default_rng(self.first), MEMBERS)
            )
            for form in ("ball", "box")
        ]

    @array(
        dims=(shape, bound, omega), unit="1", meaning="least and largest magnitude of drawn plants"
    )
    def magnitude(self, plants: list[ComplexArray]) -> RealArray:
        return np.array([[np.abs(of).min(axis=0), np.abs(of).max(axis=0)] for of in plants])

    @array(dims=omega, unit="1", meaning="magnitude of the estimate")
    def estimate(self, parts: dict[str, Any]) -> RealArray:
        return np.abs(response(parts["ball"].lti, FREQUENCY)[:, 0, 0])

    @array(dims=omega, unit="1", meaning="radius of the discs that the weight covers with")
    def radius(self, parts: dict[str, Any]) -> RealArray:
        return np.asarray(parts["discs"].sizes(FREQUENCY)[0])

    @array(
        dims=(design, shape, member), unit="1", meaning="weighted gain of the loop of a drawn plant"
    )
    def gain(self, plants: list[ComplexArray], controllers: Any) -> RealArray:
        return np.array([_gains(K, np.array(plants)) for K in _controllers_in_order(controllers)])

    @array(dims=design, unit="1", meaning="weighted gain of the loop of the true plant")
    def true_gain(self, controllers: Any) -> RealArray:
        truth = TRUE_PLANT.response(FREQUENCY)
        return np.array([_gains(K, truth) for K in _controllers_in_order(controllers)])

    @array(
        dims=(region, draw),
        unit="1",
        meaning="size of the set about another estimate that holds the true plant",
    )
    def needed(self, context: Context) -> RealArray:
        """Smallest scaling of each set that would reach the true plant: the set holds it if at most
        1.
        """
        truth = CommonPoleModel([[TRUE_PLANT]], np.zeros((1, 1)))
        found = np.zeros((3, self.draws))
        for k in context.track(range(self.draws), "estimates"):
            estimate = noisy_estimate(self.noise, OTHER_DRAWS + k)
            for i, form in enumerate(FORMS):
                one = region_of(estimate, form, self.confidence)
                if isinstance(one, EstimateRegion):
                    e = one.coordinates(truth)
                    found[i, k] = np.linalg.norm(e) if form == "ball" else np.abs(e).max()
                else:
                    away = np.abs(TRUE_PLANT.response(FINE) - one.nominal.response(FINE))
                    found[i, k] = (away / one.sizes(FINE)[0]).max()
        return found

    # --- checks -------------------------------------------------------------------------------

    proven = check(
        title="proofs of {design} on {region}",
        statement="upper over lower bound of the peak, less 1",
        value=lambda peak: peak.sel(bound="upper") / peak.sel(bound="lower") - 1.0,
        at_most=PROOF_WIDTH,
        each=("design", "region"),
    )

    @check(
        title="drawn loops",
        statement="gain of a drawn plant over the certified peak, less 1",
        at_most=GAIN_ROUNDING,
    )
    def below(self, gain: DataArray, peak: DataArray) -> DataArray:
        """The main loop theorem bounds the gain only if the peak is at most 1; other sets are
        skipped.
        """
        upper = peak.sel(bound="upper", region=["ball", "box"]).rename(region="shape")
        return (gain / upper - 1.0).where(upper <= 1.0, -1.0)

    coverage = check(
        title="coverage of the {region}",
        statement=f"{LEAST_COVERAGE_P:g} less the probability that sets hold the truth in no more "
        "draws than here",
        value=lambda self, needed: LEAST_COVERAGE_P - coverage_p(needed <= 1.0, self.confidence),
        at_most=0.0,
        each="region",
    )

    # --- what is told -------------------------------------------------------------------------

    @metric
    def numbers(self, peak: DataArray, gain: DataArray, needed: DataArray) -> dict[str, float]:
        """Certified peak of each design on its own set, absolute and over the largest gain drawn;
        coverage.

        The needed size is the scaling with which the set would hold the promised share of true
        plants.
        """
        found = {}
        for form in FORMS:
            own = float(peak.sel(design=form, region=form, bound="upper"))
            worst = float(gain.sel(design=form, shape="ball").max())
            found[f"peak_{form}"] = own
            found[f"peak_over_drawn_{form}"] = own / worst
            sizes = needed.sel(region=form)
            found[f"held_{form}"] = float((sizes <= 1.0).mean())
            found[f"needed_size_{form}"] = float(sizes.quantile(self.confidence))
        return found

    @table
    def costs(
        self, peak: DataArray, gain: DataArray, true_gain: DataArray, needed: DataArray
    ) -> tuple[list[str], list[list[str]]]:
        rows = []
        for form in FORMS:
            on = [f"{float(peak.sel(design=form, region=other, bound='upper')):.3f}"
                  for other in FORMS]  # fmt: skip
            worst = [f"{float(gain.sel(design=form, shape=s).max()):.3f}" for s in ("ball", "box")]
            truth = f"{float(true_gain.sel(design=form)):.3f}"
            sizes = needed.sel(region=form)
            share = f"{float((sizes <= 1.0).mean()):.3f}"
            size = f"{float(sizes.quantile(self.confidence)):.3f}"
            rows.append([form, *on, *worst, truth, share, size])
        heads = ["design for", *(f"peak on {form}" for form in FORMS)]
        return [
            *heads,
            "drawn from ball",
            "from box",
            "true plant",
            "held the truth",
            "needed size",
        ], rows

    @figure
    def regions(
        self,
        magnitude: DataArray,
        estimate: DataArray,
        radius: DataArray,
        gain: DataArray,
        peak: DataArray,
        needed: DataArray,
    ) -> Figure:
        """Responses of the set, gains of drawn loops with the certified peaks, and needed sizes."""
        drawn, (left, middle, right) = figures.axes(1, 3, size=(12.0, 4.2))
        of = magnitude.sel(shape="ball")
        band: dict[str, Any] = {
            "color": figures.SKY,
            "alpha": 0.6,
            "linewidth": 0,
            "label": "drawn from the ball",
        }
        left.fill_between(FREQUENCY, of.sel(bound="lower"), of.sel(bound="upper"), **band)
        left.plot(FREQUENCY, estimate + radius, "--", color=figures.ORANGE, label="discs")
        left.plot(FREQUENCY, np.maximum(estimate - radius, 1e-4), "--", color=figures.ORANGE)
        truth = np.abs(TRUE_PLANT.response(FREQUENCY))
        left.plot(FREQUENCY, truth, color=figures.BLACK, label="true plant")
        left.set_xlim(OMEGA[0], OMEGA[-1])
        left.set_ylim(3e-3, 30.0)
        figures.label(left, x="angular frequency [rad/s]", y="magnitude [1]", log="xy")
        for k, form in enumerate(FORMS):
            values = gain.sel(design=form, shape="ball").values
            spread = np.random.default_rng(0).uniform(-0.25, 0.25, values.size)
            middle.plot(k + spread, values, ".", color=figures.SKY, markersize=3)
            own = float(peak.sel(design=form, region=form, bound="upper"))
            name = "certified peak of mu" if k == 0 else None
            middle.plot([k - 0.35, k + 0.35], [own, own], color=figures.BLUE, label=name)
            sizes = np.sort(needed.sel(region=form).values)
            share = np.arange(1, sizes.size + 1) / sizes.size
            right.step(sizes, share, where="post", label=form)
        middle.set_xticks(range(len(FORMS)), FORMS)
        figures.label(middle, x="design for", y="weighted gain of a loop [1]")
        right.axvline(1.0, color="0.4", linewidth=0.8)
        right.axhline(self.confidence, color="0.4", linewidth=0.8)
        figures.label(
            right, x="size of the set that holds the true plant [1]", y="share of estimates"
        )
        for panel in (left, middle, right):
            panel.legend(frameon=False, loc="best")
        return drawn


def _controllers_in_order(controllers: Any) -> list[StateSpace]:
    """The controllers in the order of the designs."""
    return [controllers[form] for form in FORMS] if isinstance(controllers, dict) else controllers


def _gains(K: StateSpace, plants: ComplexArray) -> RealArray:
    """Largest gain over frequency from r to the weighted error and control, for plants (..., F)."""
    s, k = 1j * FREQUENCY, response(K, FREQUENCY)[:, 0, 0]
    error = np.polyval(ERROR_WEIGHT[0], s) / np.polyval(ERROR_WEIGHT[1], s)
    size = np.hypot(np.abs(error), np.abs(CONTROL_WEIGHT * k)) / np.abs(1.0 + plants * k)
    return np.asarray(size.max(axis=-1))


def designs_for(
    noise: float = 0.2, confidence: float = 0.95, draw: int = 0, **_: Any
) -> dict[str, Any]:
    """References to the controllers that were designed for the three forms."""
    asked: dict[str, Any] = {"noise": noise, "confidence": confidence, "draw": draw}
    return {form: ref(f"textbook/{form}/estimate-to-mu", **asked) for form in FORMS}


@problem("textbook/estimate-regions", needs=designs_for, slow=True)
def estimate_regions(
    discs: Run,
    ball: Run,
    box: Run,
    noise: Annotated[float, Field(gt=0.0, le=1.0)] = 0.2,
    confidence: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.95,
    draw: Annotated[int, Field(ge=0)] = 0,
    estimates: Annotated[int, Field(ge=10, le=5000)] = 100,
) -> EstimateRegions:
    """What discs, a ball and a box about one estimate cost in mu, and how often each is right.

    Each of the three designs is certified on all three sets. Plants are drawn from ball and box,
    and estimates from new noise: do their sets hold the true plant?

    noise: standard deviation, relative to the response. confidence: probability that a set holds
    the true plant. draw: seed of the noise. estimates: number of estimates from new noise.
    """
    runs = {"discs": discs, "ball": ball, "box": box}
    return EstimateRegions(runs, noise, confidence, draw, estimates)
