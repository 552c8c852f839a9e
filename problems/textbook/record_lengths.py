"""Which records allow a feedback without a model: effects of their length, noise and noise bound.

After figure 1 and the table of section VI of van Waarde, Camlibel and Mesbahi, IEEE Trans.
Automatic Control 67 (2022) 162-175.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field
from scipy.linalg import solve_discrete_are

from workbench import figures, problem, solve
from workbench.executor import Context
from workbench.solvers import Outcome
from workbench.study import Study, array, check, dim, figure, metric, part
from workbench.synthesis import FeedbackFromRecords, NoiseEnergy, StateRecords
from workbench.types import DataArray, Figure, RealArray

from .record_feedback import A, B, C, D, bounded_records

SAMPLES = 8
"""Samples of each experiment. In longer ones the unstable states would grow too large."""
EXPERIMENTS = (2, 4, 8, 16, 32, 64)
RADII = (0.05, 0.3, 0.6, 1.0)
KNOWN = ("each sample", "energy")
"""What is known of the noise: a bound on each sample, or 1.05 times its true energy."""
ABOVE_ENERGY = 1.05
NORM_ROUNDING = 1e-6
"""Rounding error allowed when a norm is compared with its bound, relative."""
STABLE, NONE, OPEN = 1, 0, -1
"""Verdicts: a gain is proven; it is proven that none exists; or neither."""


def known_plant_norm() -> float:
    """The least H2 norm that state feedback can reach for the known plant, from the Riccati
    equation.
    """
    P = solve_discrete_are(A, B, C.T @ C, D.T @ D)
    return float(np.sqrt(np.trace(P)))


@dataclass(frozen=True, eq=False)
class RecordLengths(Study):
    """Proven H2 norms over the length of the record, and which records allow a feedback at all."""

    draws: int

    headline: ClassVar[str] = "norm_above_known"

    @property
    def quantifier(self) -> str:
        return f"for these {self.draws} draws of each record"

    known, radius = dim(*KNOWN), dim(RADII, unit="1", meaning="bound of a noise sample")
    experiments = dim(EXPERIMENTS, unit="1", meaning=f"experiments of {SAMPLES} samples")
    draw = dim(lambda self: np.arange(self.draws))
    entry, column = dim(lambda: np.arange(2)), dim(lambda: np.arange(3))

    best = array(
        dims=(), unit="1", meaning="least H2 norm of the known plant", value=known_plant_norm
    )

    @part
    def found(self, context: Context) -> list[list[list[list[tuple[float, RealArray, int]]]]]:
        """Norm, gain and verdict of each record."""
        return [
            [
                [
                    [self._record_result(*at, draw, context) for draw in range(self.draws)]
                    for at in row
                ]
                for row in rows
            ]
            for rows in context.track(self._places(), "records")
        ]

    def _places(self) -> list[list[list[tuple[str, float, int]]]]:
        return [
            [[(known, radius, count) for count in EXPERIMENTS] for radius in RADII]
            for known in KNOWN
        ]

    def _record_result(
        self, known: str, radius: float, count: int, draw: int, context: Context
    ) -> tuple[float, RealArray, int]:
        rng = np.random.default_rng([draw, count])
        records = bounded_records(SAMPLES, radius, rng, count)
        if known == "energy":
            plant = np.hstack([A, B]) @ records.regressors
            noise = records.next_states - plant
            energy = NoiseEnergy(ABOVE_ENERGY * noise @ noise.T)
            records = StateRecords(records.states, records.inputs, records.next_states, energy)
        program = FeedbackFromRecords(records, criterion="h2", C=C, D=D)
        answer, _, _ = program.respond("riccati", context)
        if answer is not None and program.proven(answer):
            return answer.level, answer.K, STABLE
        none = solve(program.stabilising).outcome is Outcome.INFEASIBLE
        return np.nan, np.full((2, 3), np.nan), NONE if none else OPEN

    places = (known, radius, experiments, draw)
    verdict = array(
        dims=places, unit="1", meaning="1: proven gain, 0: proven that none is, -1: neither"
    )(lambda found: _field_of_records(found, 2))
    level = array(dims=places, unit="1", meaning="proven H2 norm for every plant")(
        lambda found: _field_of_records(found, 0)
    )
    gain = array(dims=(*places, entry, column), unit="1", meaning="gain")(
        lambda found: _field_of_records(found, 1)
    )

    @array(dims=places, unit="1", meaning="H2 norm of the loop of the true plant")
    def true_norm(self, gain: DataArray) -> RealArray:
        flat = gain.values.reshape(-1, 2, 3)
        return np.array([_norm(K) for K in flat]).reshape(gain.shape[:-2])

    decided = check(
        title="decided",
        statement="1 for a record without a verdict",
        value=lambda verdict: verdict == OPEN,
        at_most=0.0,
    )
    below = check(
        title="true loops",
        statement="norm of the loop of the true plant over the proven one, less 1",
        value=lambda true_norm, level: (true_norm / level - 1.0).fillna(-1.0),
        at_most=NORM_ROUNDING,
    )
    above = check(
        title="known plant",
        statement="least norm of the known plant over the proven one, less 1",
        value=lambda best, level: (best / level - 1.0).fillna(-1.0),
        at_most=NORM_ROUNDING,
    )

    @metric
    def norms(self, level: DataArray, true_norm: DataArray, best: DataArray) -> dict[str, float]:
        """Excess of the H2 norms over the known plant's least one, for the longest record with the
        least noise.
        """
        at = {"known": "energy", "radius": RADII[0], "experiments": EXPERIMENTS[-1]}
        return {
            "norm_above_known": float((level.sel(at) / best).median()) - 1.0,
            "true_norm_above_known": float((true_norm.sel(at) / best).median()) - 1.0,
        }

    @metric
    def shares(self, verdict: DataArray) -> dict[str, float]:
        """Share of the records with a proven gain."""
        return {
            f"proven_{known.replace(' ', '_')}": float((verdict.sel(known=known) == STABLE).mean())
            for known in KNOWN
        }

    @figure
    def norms_over_length(
        self, level: DataArray, true_norm: DataArray, verdict: DataArray, best: DataArray
    ) -> Figure:
        """H2 norms, proven and of the true plant's loop, relative to the least norm of the known
        plant.
        """
        drawn, panels = figures.axes(1, 2, size=(9.0, 4.2), sharex=True, sharey=True)
        for panel, known in zip(panels, KNOWN, strict=True):
            for radius, colour in zip(RADII, figures.CYCLE, strict=False):
                at = {"known": known, "radius": radius}
                proven = (verdict.sel(at) == STABLE).all("draw")
                for values, look in ((level, "o-"), (true_norm, ":")):
                    above = values.sel(at).median("draw").where(proven) / best - 1.0
                    name = f"noise up to {radius:g}" if values is level else None
                    count = SAMPLES * above["experiments"]
                    panel.loglog(count, above, look, color=colour, label=name)
                if (verdict.sel(at) == NONE).all():
                    text = f"noise up to {radius:g}: proven that no gain serves"
                    panel.text(0.04, 0.3, text, color=colour, transform=panel.transAxes)
            figures.label(panel, x="samples", title=f"known: {known} of the noise")
        figures.label(panels[0], y="H2 norm over the known plant's, less 1\n(dotted: true plant)")
        figures.legend_below(drawn, panels[0])
        return drawn


def _field_of_records(found: Any, place: int) -> RealArray:
    """One field of all records: 0 is the norm, 1 the gain, 2 the verdict."""
    return np.array([[[[one[place] for one in a] for a in b] for b in c] for c in found], float)


def _norm(K: RealArray) -> float:
    """H2 norm of the true plant's loop from noise to states and inputs; infinite if unstable."""
    from scipy.linalg import solve_discrete_lyapunov

    loop, seen = A + B @ K, C + D @ K
    if not np.isfinite(K).all():
        return np.nan
    if np.abs(np.linalg.eigvals(loop)).max() >= 1.0:
        return np.inf
    return float(np.sqrt(np.trace(solve_discrete_lyapunov(loop.T, seen.T @ seen))))


@problem("textbook/record-lengths")
def record_lengths(draws: Annotated[int, Field(ge=1, le=100)] = 3) -> RecordLengths:
    """How long a record, with how much noise, gives a feedback without a model.

    Proven H2 norms over the number of samples are compared with the least norm of the known plant.
    There are four sizes of noise, and either each noise sample is bounded or only the energy.
    Records that allow no feedback are proven to allow none.

    draws: number of records of each kind.
    """
    return RecordLengths(draws)
