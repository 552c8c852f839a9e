"""Bounds of the supremum of mu over frequency, and checks that prove them without a search."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass, field
from typing import Any

import numpy as np

from workbench._core.arrays import Array
from workbench._core.heavy_types import Dataset, Figure, StateSpace
from workbench.answer import Answer
from workbench.certificate import EVERY_PERTURBATION, Check, Checker, relative_excess
from workbench.certify.balls import in_plane
from workbench.certify.band_cover import CertifiedInterval
from workbench.certify.perturbed_loop import proven_at, proven_over_frequency
from workbench.certify.proofs.peak_proof import PeakProof, proves
from workbench.certify.proofs.scaled_system import ScalingFunctions
from workbench.certify.proofs.storage import restored_proof, stored_proof
from workbench.certify.stable_system import (
    StableSystem,
    angular_frequency,
    bilinear_frequency,
    stable_system,
)
from workbench.mu.frequency.complex_part import complex_part_added, separated
from workbench.mu.frequency.sweep import frequency_sweep, mu_figure
from workbench.second_opinion import peaks
from workbench.structure import Structure
from workbench.systems.conversion import as_system
from workbench.systems.realisation import realisation

NEAR_SINGULAR = 1e-4
"""Where the smallest singular value of I - M Delta, as a share of M Delta, is above this at the
frequency of Delta, a proof over all frequencies replaces the proof at that frequency. At the
frequency of Delta it is rounding, elsewhere of order 1. Half or double decides the same.
"""
REPROVEN_LOWER = 1e-9
"""Relative excess of a lower bound over a repeated proof that is accepted, since another machine
rounds the loop's realisation differently. It is 4.5 million roundings, for loops with lightly
damped poles. With half of it a run on another processor may be refused for an ill-conditioned loop;
double accepts a claim 2e-9 too high.
"""


@dataclass(frozen=True, eq=False, repr=False)
class Peak(Answer):
    """The supremum of mu over a band lies between ``lower`` and ``upper``.

    ``Delta`` (r, c) makes I - M(j omega) Delta singular up to rounding and proves the lower bound;
    it is no larger than 1 / lower, and NaN where lower is 0. ``omega`` [rad/s] is the frequency of
    Delta or, without a Delta, that of the largest upper bound. ``intervals`` cover the band unless
    upper is infinite.
    ``band`` [rad/s]: where the supremum is taken. ``complex_part`` is the complex uncertainty added
    to real scalars, as a share of them; the peak holds for this larger set of perturbations. For a
    system with sampling time ``dt`` [s] the band ends at half the sampling rate, and the intervals
    are in the frequency v = 2 / dt tan(omega dt / 2).
    """

    lower: float
    upper: float
    omega: float
    Delta: Array
    intervals: tuple[CertifiedInterval, ...]
    message: str
    _: KW_ONLY
    complex_part: float = 0.0
    band: tuple[float, float] = (0.0, math.inf)
    dt: float = 0.0
    scalings: ScalingFunctions | None = None

    @property
    def proof(self) -> PeakProof | None:
        """The proof of the upper bound, for `proves` of `workbench.certify.proofs.peak_proof`.

        None if the bound is infinite. Where there is a complex part, it is a proof for
        `complex_part_added` of the system.
        """
        if math.isinf(self.upper):
            return None
        return PeakProof(self.upper, self.intervals, self.intervals_band, self.scalings)

    @property
    def intervals_band(self) -> tuple[float, float]:
        """The band in the frequency of the intervals."""
        low, high = (bilinear_frequency(omega, self.dt) for omega in self.band)
        return low, high

    def multipliers(self, structure: Structure) -> tuple[Array, Array, Array] | None:
        """D_left (c, c), D_right (r, r) and G (r, c) that prove the bound at ``omega``; None: no
        proof.
        """
        of = next((one for one in self.intervals if one.low <= self.omega <= one.high), None)
        if of is not None:
            return of.multipliers(self.omega)
        if self.scalings is None:
            return None
        return self.scalings.multipliers(structure, self.omega)

    def summary(self) -> str:
        return f"Peak: from {self.lower:.6g} to {self.upper:.6g}, at {self.omega:.6g} rad/s"


@dataclass(frozen=True, eq=False)
class PeakChecker(Checker):
    """Checks a `Peak` of mu over frequency of a system, as given to `peak`, and its structure.

    ``band`` [rad/s]: lowest and highest frequency of the peak.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import PeakChecker, peak
    >>> from workbench.structure import Full, Structure
    >>> lag, structure = control.ss(-2.0, 1.0, 1.0, 0.0), Structure([Full(1, 1)])
    >>> PeakChecker(lag, structure).certify(peak(lag, structure), 1e-6).holds
    True
    """

    system: Any
    structure: Structure
    band: tuple[float, float] = field(default=(0.0, math.inf), kw_only=True)

    @property
    def quantifier(self) -> str:
        low, high = self.band
        if (low, high) == (0.0, math.inf):
            return EVERY_PERTURBATION
        return f"from {low:.6g} to {high:.6g} rad/s, for every perturbation of the structure"

    def checks(self, answer: Peak, tolerance: float) -> list[Check]:
        system, structure, Delta = self._claim_parts(answer)
        return peak_checks(system, structure, answer.lower, answer.upper, answer, Delta)

    def second_opinion(self, answer: Peak) -> list[Check]:
        system, structure, Delta = self._claim_parts(answer)
        omega = answer.omega
        if isinstance(system, StableSystem):
            system, omega = realised_in_doubles(system), system.plane(omega)
        else:
            system = as_system(system, "system")
        found = [peaks.nearly_singular(system, Delta, omega)] if answer.lower > 0 else []
        if math.isfinite(answer.upper) and self.band == (0.0, math.inf):
            found += peaks.upper_tried(system, structure, answer.upper)
        return found

    def figures(self, answer: Peak) -> dict[str, Figure]:
        """Bounds of mu over frequency, and the level that is proven at every frequency."""
        system, structure, _ = self._claim_parts(answer)
        figure = mu_figure(frequency_sweep(system, structure), answer.upper)
        return {"mu": figure}

    def stored_answer(self, name: str, answer: Peak) -> dict[str, Any]:
        return stored_peak(name, answer)

    def restored_answer(self, name: str, data: Dataset) -> Peak | None:
        return restored_peak(data, name)

    def _claim_parts(self, answer: Peak) -> tuple[Any, Structure, Array]:
        """The claim's system, structure and perturbation, with the complex part that the claim
        adds.
        """
        if not answer.complex_part:
            return self.system, self.structure, answer.Delta
        larger = complex_part_added(self.system, self.structure, answer.complex_part)
        return *larger, separated(answer.Delta, self.structure, answer.complex_part)


def _is_singular_near(stable: StableSystem, Delta: Array, omega: float) -> bool:
    """Whether Delta makes the loop singular near omega; a real Delta may destabilise it
    elsewhere.
    """
    if not Delta.imag.any():
        return True
    turn = stable.response(np.array([stable.plane(omega)]))[0] @ Delta
    least = float(np.linalg.svd(np.eye(len(turn)) - turn, compute_uv=False)[-1])
    return least <= NEAR_SINGULAR * max(1.0, float(np.linalg.norm(turn, 2)))


def realised_in_doubles(system: StableSystem) -> StateSpace:
    """The realisation in doubles, in continuous time."""
    return realisation((system.A, system.B, system.C, system.D), 0.0)


def peak_checks(
    system: Any,
    structure: Structure,
    lower: float,
    upper: float,
    found: Peak | None,
    Delta: Array | None = None,
) -> list[Check]:
    """Checks of claimed bounds of a peak by the multipliers and the perturbation of a `Peak`.

    Parameters
    ----------
    system
        The stable system that Delta closes.
    structure
        Blocks of Delta.
    lower, upper
        The claimed bounds.
    found
        The peak that proves them; None: no proof.
    Delta
        The perturbation of the lower bound; None: that of ``found``.
    """
    fault, proven = "no proof is stored", 0.0
    if found is not None:
        stable = stable_system(system, sampled=True)
        if found.proof is not None:
            fault = proves(stable, structure, found.proof, upper)
        Delta = found.Delta if Delta is None else Delta
        if lower > 0 and np.isfinite(Delta).all():
            proven = proven_at(stable, structure, Delta, in_plane(found.omega, stable.period))
            if proven < lower and _is_singular_near(stable, Delta, found.omega):
                proven = max(proven, proven_over_frequency(stable, structure, Delta))
    short = 0.0 if lower <= proven else relative_excess(lower, proven)
    return [
        Check(
            "peak",
            "whether the multipliers leave it unproven",
            float(bool(fault)),
            0.0,
            where=fault,
            proven=True,
        ),
        Check(
            "lower",
            "claimed lower bound over what its perturbation proves, less 1",
            short,
            REPROVEN_LOWER,
            proven=True,
        ),
        Check(
            "order",
            "claimed lower over claimed upper bound, less 1",
            relative_excess(lower, upper),
            0.0,
        ),
    ]


def stored_peak(name: str, found: Peak) -> dict[str, Any]:
    """The peak as variables of a dataset, under a name; `restored_peak` reads them back."""
    one, delta = {"units": "1"}, {"units": "1", "long_name": "perturbation of the lower bound"}
    parts = np.stack([found.Delta.real, found.Delta.imag], axis=-1)
    bounds = {"units": "1", "long_name": "lower and upper bound"}
    return {
        f"{name}_bounds": ("bound", [found.lower, found.upper], bounds),
        f"{name}_omega": ((), found.omega, {"units": "rad/s", "long_name": "of the lower bound"}),
        f"{name}_Delta": ((f"{name}_input", f"{name}_output", "complex"), parts, delta),
        **({} if found.proof is None else stored_proof(f"{name}_proof", found.proof)),
        f"{name}_complex_part": ((), found.complex_part, one),
        **({f"{name}_period": ((), found.dt, {"units": "s"})} if found.dt else {}),
    }


def restored_peak(data: Dataset, name: str) -> Peak | None:
    """The peak that `stored_peak` put into the dataset under this name; None: there is none."""
    if f"{name}_bounds" not in data:
        return None
    lower, upper = data[f"{name}_bounds"].values.tolist()
    parts = data[f"{name}_Delta"].values
    proof = restored_proof(data, f"{name}_proof") if f"{name}_proof_band" in data else None
    period = float(data[f"{name}_period"]) if f"{name}_period" in data else 0.0
    low, high = proof.band if proof else (0.0, math.inf)
    return Peak(
        lower,
        upper,
        float(data[f"{name}_omega"]),
        parts[..., 0] + 1j * parts[..., 1],
        proof.intervals if proof else (),
        "",
        complex_part=float(data[f"{name}_complex_part"]),
        band=(angular_frequency(low, period), angular_frequency(high, period)),
        dt=period,
        scalings=proof.scalings if proof else None,
    )
