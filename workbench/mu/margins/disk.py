"""Disk margins: the disk of gain and phase factors that a loop tolerates in each channel.

With the skew e, a channel's factor is f = (1 + (1 - e) delta / 2) / (1 - (1 + e) delta / 2) for
|delta| < alpha, delta is complex and different in each channel. For e = 0 the gain may rise and
fall by the same factor. With a delta in every channel, alpha is 1 / mu of S + (e - 1) / 2, S the
sensitivity; over a set of plants it is 1 / the skewed mu with their uncertainty held at its size.

Source: P. Seiler, A. Packard, P. Gahinet, "An introduction to disk margins", IEEE Control Systems
Magazine 40 (2020) 78-95.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.answer import Answer, PartsChecker, no_better
from workbench.certificate import Check
from workbench.certify.stable_system import StableSystem, angular_frequency
from workbench.input_checks import need_numbers
from workbench.mu.frequency.channels import even_channels
from workbench.mu.frequency.peak import peak
from workbench.mu.frequency.peak_bounds import Peak
from workbench.mu.margins.classical import in_both_units, least_db
from workbench.mu.margins.late_peak import LatePeak
from workbench.mu.robust.destabilising import destabilising_perturbation
from workbench.mu.robust.margin_bounds import RECIPROCAL_ROUNDING, StabilityMargin, reciprocal
from workbench.mu.robust.skewed_bounds import SkewedPeak
from workbench.mu.robust.skewed_peak import skewed_peak
from workbench.mu.robust.values import values_of
from workbench.second_opinion import peaks
from workbench.second_opinion.responses import plain_response, precise_response
from workbench.structure import Complex, Structure
from workbench.systems.bilinear import bilinear_sampled
from workbench.systems.hidden_states import without_hidden_states
from workbench.systems.realisation import realisation
from workbench.uncertainty.algebra.system import UncertainSystem

INFINITE_FACTOR = 1e-6
"""A factor counts as infinite if the denominator of its direct term is below this. Its reciprocal,
1e6, is a factor that breaks any loop by itself, and rounding of the Delta is below it. Half or
double moves this border.
"""


@dataclass(frozen=True, eq=False, repr=False)
class DiskMargin(Answer):
    """The disk of factors, one in each of ``channels`` at once, that a loop tolerates.

    Unlike `LoopMargins`, it is the one factor that acts on gain and phase at once.

    The loop is proven stable for every |delta| below ``lower``. At size ``upper`` there are
    factors, ``worst`` by channel, with which it has a pole at ``omega`` [rad/s]. ``worst`` is None
    if one of them is an infinite gain, if the loop breaks only in the limit of infinite frequency,
    or if no factors are known and ``upper`` is infinite. ``proof`` has the bounds of the
    reciprocals; it may be the margin itself. For a set of plants, stability is proven for every
    plant, and ``plant`` has the values of the uncertain elements that belong to the worst factors.
    """

    channels: tuple[str, ...]
    skew: float
    lower: float
    upper: float
    omega: float
    worst: Mapping[str, StateSpace] | None
    plant: Mapping[str, Any] | None
    proof: Peak | SkewedPeak | LatePeak | StabilityMargin

    @property
    def gain(self) -> tuple[float, float]:
        """Least and largest real factor of the proven disk, in every channel at once."""
        return disk_gain(self.lower, skew=self.skew)

    @property
    def gain_db(self) -> float:
        """The least change of the gain, up or down [dB]."""
        return least_db(self.gain)

    @property
    def phase_deg(self) -> float:
        """Largest phase [deg] of the proven disk at gain 1, in every channel at once."""
        return disk_phase(self.lower, skew=self.skew)

    def summary(self) -> str:
        low, high = self.gain
        over = "" if self.plant is None else ", every plant of the set"
        return (
            f"DiskMargin of {', '.join(self.channels)}{over}: {self.lower:.5g} to {self.upper:.5g} "
            f"at {in_both_units(self.omega)}; gain {low:.4g} to {high:.4g}, phase "
            f"{self.phase_deg:.4g} degrees"
        )


@dataclass(frozen=True, eq=False)
class DiskChecker(PartsChecker):
    """Checks a `DiskMargin` of a closed loop.

    ``returned`` is the closed loop from signals added in the channels to the signals there, without
    the added ones.
    """

    returned: UncertainSystem

    @property
    def quantifier(self) -> str:
        plants = "for every plant of the set" if self.returned.elements else "for this one plant"
        return f"{plants}, for all factors of the disk"

    def parts(self, answer: DiskMargin) -> Mapping[str, Answer]:
        return {"mu": answer.proof}

    def checks(self, answer: DiskMargin, tolerance: float) -> list[Check]:
        return disk_checks(answer)

    def second_opinion(self, answer: DiskMargin) -> list[Check]:
        if answer.worst is None:
            return []
        member = self.returned.at(**(answer.plant or {}))
        omega = np.array([answer.omega])
        changes = [plain_response(f, omega)[0, 0, 0] - 1.0 for f in answer.worst.values()]
        distance = peaks.regularity(plain_response(member, omega)[0] @ np.diag(changes))
        # or doubles cannot resolve it
        if distance > peaks.NEARLY_SINGULAR and math.isfinite(answer.omega):
            sharp = [precise_response(f, answer.omega)[0, 0] - 1.0 for f in answer.worst.values()]
            distance = peaks.precise_distance(member, np.diag(sharp), answer.omega)
        statement = "smallest singular value of the loop with the worst factors, relative"
        return [
            Check(
                "worst factors",
                statement,
                distance,
                peaks.NEARLY_SINGULAR,
                where=f"at {answer.omega:.6g} rad/s",
                over="for the worst plant",
            )
        ]


def disk_checks(answer: DiskMargin) -> list[Check]:
    """Checks that a disk margin is no better than the reciprocals of its proven peak's bounds."""
    lower, upper = reciprocal(answer.proof.upper), reciprocal(answer.proof.lower)
    statement = "by which share it is better than the reciprocal of a proven bound of the peak"
    return no_better(answer, lower, upper, statement, RECIPROCAL_ROUNDING)


def disk_gain(alpha: float, *, skew: float = 0.0) -> tuple[float, float]:
    """Least and largest real factor of a disk; the latter is infinite for a half plane or more."""
    need_numbers(alpha=alpha, skew=skew)
    up, down = (1.0 - skew) / 2.0, (1.0 + skew) / 2.0
    if math.isinf(alpha):
        return (-up / down if down else -math.inf), math.inf
    low = (1.0 - up * alpha) / (1.0 + down * alpha)
    room = 1.0 - down * alpha
    return low, (1.0 + up * alpha) / room if room > 0 else math.inf


def disk_phase(alpha: float, *, skew: float = 0.0) -> float:
    """Largest phase [deg] of factors with gain 1 in a disk."""
    need_numbers(alpha=alpha, skew=skew)
    if math.isinf(alpha):
        return 180.0
    # |f| = 1 with f = exp(j phi): |delta| = |f - 1| / |(1 - e) / 2 + (1 + e) f / 2|
    # = 2 |sin(phi / 2)| / |cos(phi / 2) + j e sin(phi / 2)|.
    room = 1.0 - (skew * alpha / 2.0) ** 2
    if room <= 0.0:
        return 180.0
    return math.degrees(2.0 * math.atan(alpha / 2.0 / math.sqrt(room)))


def disk_of(
    returned: UncertainSystem, channels: Mapping[int, str], skew: float, tolerance: float
) -> DiskMargin:
    """The disk margin of some channels of a loop.

    Parameters
    ----------
    returned
        The closed loop, stable at its nominal, from signals added in its channels to the signals
        there without the added ones: S - 1 for each channel by itself.
    channels
        Number and name of each channel that has a factor.
    """
    part = returned[list(channels), list(channels)]
    shifted = part + (1.0 + skew) / 2.0 * np.eye(len(channels))
    factors = Structure(Complex(1, name=name) for name in channels.values())
    uncertain = list(shifted.structure) if shifted.elements else []
    structure = Structure([*uncertain, *factors])
    N = shifted.system if uncertain else shifted.nominal
    plane, period = even_channels(N, structure)
    found: Peak | SkewedPeak
    if uncertain:
        found = skewed_peak(plane, structure, list(range(len(uncertain))), tolerance=tolerance)
    else:
        found = peak(plane, structure, tolerance=tolerance)
    lower, upper = reciprocal(found.upper), reciprocal(found.lower)
    omega = found.omega
    worst: dict[str, StateSpace] | None = None
    plant: dict[str, Any] | None = None
    if 0 < upper < math.inf:
        Delta = _destabilising(plane, structure, found, len(uncertain))
        Delta = bilinear_sampled(Delta, period) if period else Delta
        places = zip(structure.row_slices, structure.column_slices, strict=True)
        at = [(rows.start, columns.start) for rows, columns in places][len(uncertain) :]
        factors_found = [factor_of(Delta, *place, skew) for place in at]
        if all(f is not None for f in factors_found):
            worst = dict(zip(channels.values(), factors_found, strict=True))
        plant = (
            values_of(shifted.elements.values(), shifted.structure, Delta) if uncertain else None
        )
    elif uncertain:
        plant = {}
    omega = float(angular_frequency(omega, period))  # half the sampling rate stands for infinity
    answer = DiskMargin(tuple(channels.values()), skew, lower, upper, omega, worst, plant, found)
    return answer.with_checker(DiskChecker(part))


def _destabilising(
    N: StableSystem, structure: Structure, found: Peak | SkewedPeak, fixed: int
) -> StateSpace:
    """The worst perturbation as a stable system: uncertain blocks, normalised to at most 1, then
    the deltas.
    """
    if isinstance(found, Peak):
        return destabilising_perturbation(found, N, structure)
    # Varying blocks are divided by their size, so that all blocks are at most 1.
    rows = structure.row_slices[fixed].start
    columns = structure.column_slices[fixed].start
    outputs, inputs = (np.arange(count) for count in N.D.shape)
    scaled = N.channels(outputs, inputs, np.where(outputs < columns, 1.0, 1.0 / found.lower))
    Delta = found.Delta.copy()
    Delta[rows:] *= found.lower
    size = float(np.linalg.norm(Delta, 2))
    claim = Peak(1.0 / size, math.inf, found.omega, Delta, (), "")
    made = destabilising_perturbation(claim, scaled, structure)
    back = np.where(np.arange(made.noutputs) < rows, 1.0, 1.0 / found.lower)
    return realisation((made.A, made.B, back[:, None] * made.C, back[:, None] * made.D), 0.0)


def factor_of(Delta: StateSpace, row: int, column: int, skew: float) -> StateSpace | None:
    """f = 1 + delta / (1 - (1 + e) delta / 2) of one channel; None where it is infinite."""
    import control

    D = Delta.D[[row], [column]]
    delta = control.ss(Delta.A, Delta.B[:, [column]], Delta.C[[row]], D, Delta.dt)
    delta = without_hidden_states(delta)
    share = (1.0 + skew) / 2.0
    if abs(1.0 - share * delta.D.item()) <= INFINITE_FACTOR:
        return None
    return 1.0 + control.feedback(delta, share, sign=1)
