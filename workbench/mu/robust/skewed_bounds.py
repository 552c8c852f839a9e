"""Bounds of a skewed mu over frequency and of a worst-case gain, and the checks that prove them."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import Any

import numpy as np
from flint import arb, ctx

from workbench._core.arrays import EPS, Array, BoolArray
from workbench._core.heavy_types import Dataset
from workbench.answer import Answer
from workbench.certificate import (
    EVERY_PERTURBATION,
    Check,
    Checker,
    quantified_checks,
    relative_excess,
)
from workbench.certify.balls import in_plane, response_of
from workbench.certify.modes.modal_form import PRECISIONS
from workbench.certify.perturbed_loop import proven_at, proven_gain, proven_over_frequency
from workbench.certify.proofs.peak_proof import PeakProof, proves
from workbench.certify.proofs.storage import restored_proof, stored_proof
from workbench.certify.skewed import proven_skew_of, without_effect
from workbench.certify.stable_system import StableSystem, bilinear_frequency, stable_system
from workbench.mu.frequency.peak_bounds import REPROVEN_LOWER, realised_in_doubles
from workbench.second_opinion import peaks
from workbench.structure import Structure

LEVEL_ROUNDING = 1 + 1e-12
"""Factor on the product of level and mu that covers its rounding and that of the division by the
level. Two roundings need 4e-16; the rest lets another linear algebra library prove it. Half or
double changes the twelfth digit.
"""
CHECKED_ROUNDING = LEVEL_ROUNDING * (1 - 16 * EPS)
"""The same factor in a check. The claimed value was rounded by more, so that no last bit
decides.
"""


@dataclass(frozen=True, eq=False, repr=False)
class SkewedPeak(Answer):
    """Bounds of the supremum of the skewed mu over all frequencies.

    Unlike a `Peak`, it scales only some of the blocks; the others keep their size of 1.

    ``Delta`` (r, c) makes I - M(j omega) Delta singular at ``omega`` [rad/s], up to rounding, and
    proves the lower bound: its fixed blocks are at most 1, the others at most 1 / lower. If lower
    is infinite, the fixed blocks alone make it singular. Delta is NaN where lower is 0. ``upper``
    is infinite where no bound was proven; the message says why. ``proof`` proves that mu is below 1
    once the inputs of the varying blocks are divided by ``level``; it is None, and the level 0, for
    an infinite bound.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.mu import skewed_peak
    >>> from workbench.structure import Complex, Structure
    >>> system = control.ss(-np.eye(2), np.eye(2), [[0.5, 0.1], [0.1, 0.5]], np.zeros((2, 2)))
    >>> found = skewed_peak(system, Structure([Complex(1), Complex(1)]), fixed=[0])
    >>> found.proof is not None, found.Delta.shape
    (True, (2, 2))
    """

    lower: float
    upper: float
    omega: float
    Delta: Array
    message: str
    _: KW_ONLY
    level: float = 0.0
    proof: PeakProof | None = None

    def summary(self) -> str:
        text = f"{type(self).__name__}: from {self.lower:.5g} to {self.upper:.5g}"
        return f"{text}, at {self.omega:.5g} rad/s; {self.message}"


class WorstCaseGain(SkewedPeak):
    """Bounds of the largest gain over all frequencies and perturbations.

    ``lower`` is proven to be at most the largest singular value of F_u(N(j omega), Delta) for the
    perturbation ``Delta`` (r, c), of size at most 1, at ``omega`` [rad/s]; it is infinite where a
    multiple of Delta, of size at most 1, is proven to make the loop singular. ``upper`` is infinite
    where no bound was proven; the message says why.
    ``proof`` proves that mu is below 1 once the exogenous inputs are divided by ``level``; it is
    None, and the level 0, for an infinite bound.
    """


@dataclass(frozen=True, eq=False)
class SkewedPeakChecker(Checker):
    """Checks a `SkewedPeak` of a stable system; ``varies`` (blocks,) marks the varying blocks."""

    system: Any
    structure: Structure
    varies: BoolArray

    @property
    def quantifier(self) -> str:
        return EVERY_PERTURBATION

    def checks(self, answer: SkewedPeak, tolerance: float) -> list[Check]:
        stable = stable_system(self.system, sampled=True)
        proven = 0.0
        if answer.lower > 0:
            with ctx.workprec(PRECISIONS[1]):
                M = response_of(stable, in_plane(answer.omega, stable.period))
            if M is not None:
                proven = proven_skew_of(M, self.structure, self.varies, answer.Delta)
        return bound_checks(stable, self.structure, self._inputs, answer, proven)

    def second_opinion(self, answer: SkewedPeak) -> list[Check]:
        stable = stable_system(self.system, sampled=True)
        found = []
        if answer.lower > 0:
            found.append(
                peaks.nearly_singular(
                    realised_in_doubles(stable), answer.Delta, stable.plane(answer.omega)
                )
            )
        return found + level_tried(stable, self.structure, self._inputs, answer)

    @property
    def _inputs(self) -> BoolArray:
        return np.repeat(self.varies, [block.rows for block in self.structure])


@dataclass(frozen=True, eq=False)
class WorstCaseChecker(Checker):
    """Checks a `WorstCaseGain` of a system in continuous time that may stand for a sampled one.

    ``dt`` is the sampling time [s] of the sampled system, 0 if the system stands for itself.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.mu import WorstCaseChecker, worst_case_gain
    >>> from workbench.structure import Complex, Structure
    >>> N = control.ss(-np.eye(2), np.eye(2), [[0.5, 0.1], [0.1, 0.5]], np.zeros((2, 2)))
    >>> structure = Structure([Complex(1)])
    >>> WorstCaseChecker(N, structure).certify(worst_case_gain(N, structure), 1e-6).holds
    True
    """

    system: Any
    structure: Structure
    dt: float = field(default=0.0, kw_only=True)

    @property
    def quantifier(self) -> str:
        return EVERY_PERTURBATION

    def checks(self, answer: WorstCaseGain, tolerance: float) -> list[Check]:
        return worst_case_checks(self.system, self.structure, answer, dt=self.dt)

    def second_opinion(self, answer: WorstCaseGain) -> list[Check]:
        stable, claim = stable_system(self.system, sampled=True), self._in_plane(answer)
        inputs = np.arange(stable.D.shape[1]) >= self.structure.rows
        found = level_tried(stable, whole_structure(stable, self.structure), inputs, claim)
        if 0.0 < claim.lower < math.inf:
            omega = stable.plane(claim.omega)
            found.append(
                peaks.attains(realised_in_doubles(stable), claim.Delta, omega, claim.lower)
            )
        return found

    def stored_answer(self, name: str, answer: WorstCaseGain) -> dict[str, Any]:
        return stored_worst_case(name, answer)

    def restored_answer(self, name: str, data: Dataset) -> WorstCaseGain | None:
        return restored_worst_case(data, name) if f"{name}_bounds" in data else None

    def _in_plane(self, answer: WorstCaseGain) -> WorstCaseGain:
        return replace(answer, omega=float(bilinear_frequency(answer.omega, self.dt)))


def worst_case_checks(
    system: Any, structure: Structure, found: WorstCaseGain, *, dt: float = 0.0
) -> list[Check]:
    """Checks of a worst-case gain by its multipliers and its perturbation alone.

    Parameters
    ----------
    system, structure
        As given to `worst_case_gain`.
    found
        The claimed bounds with their proofs. An infinite upper bound claims nothing.
    dt
        Sampling time [s] of the sampled system that this continuous one stands for; 0: none.

    Raises
    ------
    InputError
        As `worst_case_gain`.
    """
    stable = stable_system(system, sampled=True)
    exogenous = np.arange(stable.D.shape[1]) >= structure.rows
    attained = attained_gain(
        stable, structure, found.Delta, in_plane(found.omega, dt or stable.period)
    )
    whole = whole_structure(stable, structure)
    return quantified_checks(
        EVERY_PERTURBATION, bound_checks(stable, whole, exogenous, found, attained, "gain")
    )


def bound_checks(
    stable: StableSystem,
    structure: Structure,
    inputs: BoolArray,
    found: SkewedPeak,
    proven: float,
    lower_bound: str = "lower bound",
) -> list[Check]:
    """Checks of claimed bounds: of the upper bound by multipliers, of the lower one by its proven
    value.

    Parameters
    ----------
    structure
        All blocks of the multipliers.
    inputs
        Marks the inputs (r,) that are divided by the level of the proof.
    proven
        The lower bound that the perturbation proves.
    lower_bound
        Name of the lower bound in the text of the check.
    """
    fault = level_fault(stable, structure, inputs, found) if math.isfinite(found.upper) else ""
    lower = found.lower
    short = 0.0 if lower <= proven else relative_excess(lower, proven)
    return [
        Check(
            "upper",
            "whether the multipliers leave it unproven",
            float(bool(fault)),
            0.0,
            where=fault,
            proven=True,
        ),
        Check(
            "lower",
            f"claimed {lower_bound} over what its perturbation proves, less 1",
            short,
            REPROVEN_LOWER,
            proven=True,
        ),
        Check(
            "order",
            "whether the lower bound is above the upper one",
            float(lower > found.upper),
            0.0,
        ),
    ]


def level_fault(
    stable: StableSystem, structure: Structure, inputs: BoolArray, found: SkewedPeak
) -> str:
    """Why the multipliers do not prove the upper bound; the empty text if they do."""
    if found.proof is None:
        return "no proof is stored"
    beta = found.proof.beta
    if not beta < 1:
        return f"the proof is one of mu {beta:.6g}, which is not below 1"
    if not found.level * beta * CHECKED_ROUNDING <= found.upper:
        return f"the proof is one of the bound {found.level * beta:.9g}"
    if found.level == 0:
        varies = np.array([bool(inputs[into].any()) for into in structure.row_slices])
        idle = without_effect(stable, structure, varies)
        return "" if idle else "the response is not zero"
    return proves(divided(stable, inputs, found.level), structure, found.proof, beta)


def level_tried(
    stable: StableSystem, structure: Structure, inputs: BoolArray, found: SkewedPeak
) -> list[Check]:
    """Check of the upper bound by random perturbations of the system with its inputs divided by the
    bound.
    """
    if not 0.0 < found.upper < math.inf:
        return []
    scaled = divided(stable, inputs, found.upper)
    return peaks.upper_tried(realised_in_doubles(scaled), structure, 1.0)


def whole_structure(stable: StableSystem, structure: Structure) -> Structure:
    """The blocks of the perturbation, and one block for the performance channels."""
    outputs, inputs = stable.D.shape
    return structure.with_performance(outputs - structure.columns, inputs - structure.rows)


def attained_gain(
    system: StableSystem, structure: Structure, Delta: Array, omega: float | arb
) -> float:
    """The gain that a perturbation proves at a frequency [rad/s]; infinite if the perturbation
    destabilises.

    In that case a multiple of at most 1 of the perturbation makes the loop singular at some
    frequency.
    """
    r, c = structure.rows, structure.columns
    loop = system.channels(np.arange(c), np.arange(r))
    gain = proven_gain(system, structure, Delta, omega)
    if not Delta.any():
        return gain
    unstable = max(
        proven_at(loop, structure, Delta, omega),
        proven_over_frequency(loop, structure, Delta),
    )
    return math.inf if unstable >= 1 else gain


def divided(system: StableSystem, inputs: BoolArray, level: float) -> StableSystem:
    """The system with some of its inputs (r,) divided by a level."""
    outputs, every = (np.arange(count) for count in system.D.shape)
    return system.channels(outputs, every, input_gains=np.where(inputs, 1.0 / level, 1.0))


def stored_worst_case(name: str, found: WorstCaseGain) -> dict[str, Any]:
    """The gain as variables of a dataset, under a name; `restored_worst_case` reads them back."""
    one, parts = {"units": "1"}, np.stack([found.Delta.real, found.Delta.imag], axis=-1)
    about = {"long_name": "lower and upper bound of the worst-case gain"}
    return {
        f"{name}_bounds": (("bound",), [found.lower, found.upper], about),
        f"{name}_omega": ((), found.omega, {"units": "rad/s", "long_name": "of the lower bound"}),
        f"{name}_Delta": (
            (f"{name}_input", f"{name}_output", "complex"),
            parts,
            one | {"long_name": "worst perturbation, real and imaginary"},
        ),
        f"{name}_level": ((), found.level, {"long_name": "gain by which inputs are divided"}),
        **({} if found.proof is None else stored_proof(f"{name}_proof", found.proof)),
    }


def restored_worst_case(data: Dataset, name: str) -> WorstCaseGain:
    """The gain that `stored_worst_case` put into the dataset under this name."""
    lower, upper = data[f"{name}_bounds"].values.tolist()
    parts = data[f"{name}_Delta"].values
    proof = restored_proof(data, f"{name}_proof") if f"{name}_proof_band" in data else None
    return WorstCaseGain(
        lower,
        upper,
        float(data[f"{name}_omega"]),
        parts[..., 0] + 1j * parts[..., 1],
        "",
        level=float(data[f"{name}_level"]),
        proof=proof,
    )
