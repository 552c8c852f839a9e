"""Robust stability with known dead time, proven with exp(-s T) itself between all frequencies.

With exp(-s T) = P (1 + W delta), |delta| at most 1
(`workbench.uncertainty.dead_time_approximation`), the dead time is one member of a rational set.
The block of delta keeps its size while all other blocks grow, so that the skewed mu of the set
gives a lower bound of the margin at every frequency. The upper bound comes from mu at single
frequencies, with exp(-j omega T) itself in the response. If the bounds do not meet, a higher order
makes W smaller.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.answer import Answer, PartsChecker, no_better
from workbench.certificate import Check
from workbench.certify.agreement import need_agreement
from workbench.errors import InputError
from workbench.mu.boxes.partition import corner_signs
from workbench.mu.frequency.channels import analysed, even_channels
from workbench.mu.lower.bound import lower_bound
from workbench.mu.lower.program import LowerBound
from workbench.mu.robust.delay_margins import delay_margins
from workbench.mu.robust.destabilising import END_OFFSET, interpolated, null_vector
from workbench.mu.robust.lone_delay import loop_about_dead_time, with_delay_of
from workbench.mu.robust.margin_bounds import RECIPROCAL_ROUNDING, StabilityMargin, reciprocal
from workbench.mu.robust.skewed_bounds import SkewedPeak
from workbench.mu.robust.skewed_peak import skewed_peak
from workbench.mu.robust.values import values_of
from workbench.second_opinion import peaks
from workbench.second_opinion.margins.dead_times import counted_poles
from workbench.second_opinion.responses import plain_response
from workbench.structure import Real, Structure
from workbench.systems.generalised_plant import response
from workbench.uncertainty.algebra.dead_time import DeadTime, dead_times, pade, pade_error
from workbench.uncertainty.algebra.rational_delays import dead_time_approximation
from workbench.uncertainty.algebra.system import UncertainSystem

ORDERS = (6, 10, 14)
"""Orders of the Pade approximation, tried in turn until the bounds meet. Each is exact to a higher
frequency, and doubles hold no order far above 14. Half of all leaves wider gaps; double of all
loses digits.
"""
NEARBY_RATIOS = np.geomspace(0.98, 1.02, 9)
"""Frequencies at which lower bounds of mu are computed, relative to the frequency of the largest
upper bound.
"""
SWEPT_FREQUENCIES = 30
"""Number of further frequencies, in addition to 0: several peaks may be equally high, and only some
belong to a member of the set. With half of them a lower bound may belong to a lower peak, and
leaves a gap; with twice as many it takes twice as long.
"""
COVERED, ONE_LOST = "the set that contains the dead time is stable", "one member is not"
"""What the two bounds rest on."""
RESPONSE_ROUNDING = 1e-9
"""Relative error of responses in doubles by which a lower bound of mu may be too large. It is the
rounding of a double times 5e6, as for lightly damped poles. With half of it a bound may contradict
its proof; double loosens a bound by 1e-9.
"""
HALVINGS = 40
"""Number of bisections for the size at which a corner of real parameters is lost. From a range of
1e6 they leave 1e-11. With half of them a size has five digits; more change nothing.
"""
SMALLEST, LARGEST = 1e-9, 1e3
"""Least and largest size of real parameters that are tried. Sizes beyond have no meaning for a set
stated so. Half or double only changes what is called 0 or infinite.
"""
BORDER_EXCESS = 1e-5
"""Relative distance of the reported size beyond the stability border, so that poles can be counted
clearly. Poles counted by turns must lie apart from the axis by more than `RESPONSE_ROUNDING`. With
half of it some are not counted clearly; double loosens a bound by 2e-5.
"""
TURN_FREQUENCIES = 12
"""Number of frequencies at which the second opinion counts turns of determinants. A second opinion
on few points between the slowest and the fastest pole; the peak is added. With half of them it may
miss a wrong count at another frequency; with twice as many it takes twice as long.
"""


@dataclass(frozen=True, eq=False)
class LateSystem:
    """A system with known dead time, and the rational set that contains it.

    Unlike an `UncertainSystem`, it keeps the dead time beside the rational set that contains
    it.
    """

    given: UncertainSystem
    cover: UncertainSystem
    order: int

    @property
    def known(self) -> dict[str, DeadTime]:
        """The dead times by name."""
        return dead_times(self.given.elements)

    @property
    def fixed(self) -> list[int]:
        """Indices of the blocks that stand for errors of approximations."""
        return [k for k, name in enumerate(self.cover.elements) if name in self.known]

    @property
    def structure(self) -> Structure:
        """The blocks of the uncertain elements other than dead time."""
        blocks = enumerate(self.cover.structure)
        return Structure(block for k, block in blocks if k not in self.fixed)

    def matrices(self, omega: RealArray, seen: Any = response) -> Array:
        """M (F, c, r) that the uncertain elements close, with exp(-j omega T) itself."""
        structure = self.cover.structure
        N = seen(self.cover.system, omega)
        out, into = structure.column_slices, structure.row_slices
        rows, columns = (_places(sides, self.fixed, inside=False) for sides in (out, into))
        late_rows, late_columns = (_places(sides, self.fixed, inside=True) for sides in (out, into))
        names = list(self.cover.elements)
        found = []
        for k in self.fixed:
            T = self.known[names[k]].delay
            P, W = (seen(make(T, self.order), omega)[:, 0, 0] for make in (pade, pade_error))
            error = (np.exp(-1j * omega * T) / P - 1.0) / np.where(W == 0.0, 1.0, W)
            found += [error] * (into[k].stop - into[k].start)
        delta = np.stack(found, axis=-1)
        N_ff = N[:, late_rows][:, :, late_columns]
        loop = np.eye(len(late_rows)) - N_ff * delta[:, None, :]
        back = np.linalg.solve(loop, N[:, late_rows][:, :, columns])
        direct = N[:, rows][:, :, columns]
        whole: Array = direct + (N[:, rows][:, :, late_columns] * delta[:, None, :]) @ back
        return whole


@dataclass(frozen=True, eq=False)
class LateStabilityChecker(PartsChecker):
    """Checks a `StabilityMargin` of a system with known dead time.

    The upper bound is proven by ``attained``, or by ``lost``: normalised real parameters by name
    with which the loop is unstable.
    """

    late: LateSystem
    proof: SkewedPeak
    attained: LowerBound | None
    lost: Mapping[str, float] | None = None

    @property
    def quantifier(self) -> str:
        return "for every perturbation of a size below the lower bound, with the dead time itself"

    def parts(self, answer: StabilityMargin) -> Mapping[str, Answer | None]:
        return {"mu of the cover": self.proof, "mu at a frequency": self.attained}

    def checks(self, answer: StabilityMargin, tolerance: float) -> list[Check]:
        lower = reciprocal(self.proof.upper)
        upper = math.inf if self.attained is None else reciprocal(float(self.attained.value))
        if self.lost is not None and _is_lost(self.late, self.lost):
            upper = max(map(abs, self.lost.values()))
        statement = "by which share it is better than the reciprocal of a proven bound"
        return no_better(answer, lower, upper, statement, RECIPROCAL_ROUNDING)

    def second_opinion(self, answer: StabilityMargin) -> list[Check]:
        """With the dead time itself, determinants for smaller perturbations must not turn around
        0.
        """
        slow, fast = _speeds(self.late.cover)
        omega = np.geomspace(slow, fast, TURN_FREQUENCIES)
        if math.isfinite(answer.omega) and answer.omega > 0:
            omega = np.append(omega, answer.omega)[::-1]
        matrices = answer.lower * self.late.matrices(omega, plain_response)
        found = [peaks.not_encircled(matrices, self.late.structure)]
        if self.lost is not None:
            loop, T = _loop_of(self.late, self.lost)
            count = 0 if loop is None else counted_poles(loop, T)
            statement = "whether no closed-loop pole lies right of the axis, by turns"
            found.append(Check("lost", statement, float(count == 0), 0.0, over="for these values"))
        if self.attained is not None:
            M = self.late.matrices(np.array([answer.omega]), plain_response)[0]
            distance = peaks.regularity(M @ np.asarray(self.attained.Delta))
            statement = "smallest singular value of the loop at that frequency, relative"
            where = f"at {answer.omega:.6g} rad/s"
            found.append(Check("worst", statement, distance, peaks.NEARLY_SINGULAR, where=where))
        return found


def late_margin(given: UncertainSystem, tolerance: float) -> StabilityMargin:
    """The margin of robust stability of a system with known dead time; see `robust_stability`."""
    known = dead_times(given.elements)
    if len(known) == len(given.elements):
        raise InputError(
            f"the system has the dead time {', '.join(known)} and no uncertain element; there is "
            "nothing to be robust to"
        )
    best: tuple[LateSystem, SkewedPeak] | None = None
    found: tuple[LateSystem, float, LowerBound] | None = None
    corner = _lost_corner(
        LateSystem(given, dead_time_approximation(given, order=ORDERS[0]), ORDERS[0])
    )
    for order in ORDERS:
        late = LateSystem(given, analysed(dead_time_approximation(given, order=order)), order)
        structure = late.cover.structure
        stable = even_channels(late.cover.system, structure)[0]
        proof = skewed_peak(stable, structure, late.fixed, tolerance=tolerance)
        if best is None or proof.upper < best[1].upper:
            best = late, proof
        attained = _largest_lower_bound(late, proof.omega)
        if attained and (found is None or attained[2].value > found[2].value):
            found = attained
        if best[1].upper <= (1.0 + 2.0 * tolerance) * max(_lower_bounds(found, corner)):
            break
    assert best is not None
    return _margin_of(*best, found, corner, delay_margins(best[0].cover, tolerance))


def _lower_bounds(found: Any, corner: Any) -> tuple[float, float]:
    """Lower bounds of mu: from a frequency, and from a corner of parameters."""
    at_frequency = 0.0 if found is None else float(found[2].value)
    return at_frequency, 0.0 if corner is None else 1.0 / corner[0]


def _margin_of(
    late: LateSystem,
    proof: SkewedPeak,
    found: tuple[LateSystem, float, LowerBound] | None,
    corner: tuple[float, dict[str, float]] | None,
    delays: Mapping[str, tuple[float, float]],
) -> StabilityMargin:
    """The margin, with the smaller of the upper bounds."""
    upper, omega, worst = math.inf, math.nan, None
    attained, lost = None, None
    at_frequency, at_corner = _lower_bounds(found, corner)
    proven = (1.0 - RESPONSE_ROUNDING) * max(at_frequency, at_corner)
    need_agreement(proven, proof.upper, "mu with dead time", ONE_LOST, COVERED)
    if corner is not None and at_corner >= at_frequency:
        upper, lost = corner
        omega = _crossing(late, lost)
        worst = {name: late.given.elements[name].value(one) for name, one in lost.items()}
    elif found is not None:
        _, omega, attained = found
        upper, worst = reciprocal(at_frequency), _worst(*found)
    margin = StabilityMargin(reciprocal(proof.upper), upper, omega, worst, None, delays=delays)
    return margin.with_checker(LateStabilityChecker(late, proof, attained, lost))


def _largest_lower_bound(
    late: LateSystem, omega: float
) -> tuple[LateSystem, float, LowerBound] | None:
    """The largest lower bound of mu near a frequency and in a sweep, with its proof."""
    slow, fast = _speeds(late.cover)
    tried = np.append(0.0, np.geomspace(END_OFFSET * slow, fast, SWEPT_FREQUENCIES))
    if 0.0 < omega < math.inf:
        tried = np.append(tried, omega * NEARBY_RATIOS)
    matrices = late.matrices(tried)
    if not tried[0]:
        matrices[0] = matrices[0].real
    bounds = lower_bound(matrices, late.structure)
    order = np.argsort(-bounds.value)
    for k in order:
        Delta = bounds.Delta[k]
        if bounds.value[k] > 0 and (tried[k] or not Delta.imag.any()):
            return late, float(tried[k]), lower_bound(matrices[k], late.structure)
    return None


def _lost_corner(late: LateSystem) -> tuple[float, dict[str, float]] | None:
    """The least size found at which a corner of real parameters is unstable, and the parameters.

    None if there is other uncertainty, or if none is found.
    """
    names = [name for name in late.given.elements if name not in late.known]
    if not all(isinstance(block, Real) for block in late.structure):
        return None
    most, found = LARGEST, None
    for signs in corner_signs(len(names)):
        low, high = SMALLEST, most
        if not _is_lost(late, dict(zip(names, high * signs, strict=True))):
            continue
        for _ in range(HALVINGS):
            middle = math.sqrt(low * high)
            is_lost = _is_lost(late, dict(zip(names, middle * signs, strict=True)))
            low, high = (low, middle) if is_lost else (middle, high)
        beyond = (1.0 + BORDER_EXCESS) * high
        deltas = dict(zip(names, beyond * signs, strict=True))
        if _is_lost(late, deltas):
            most, found = beyond, deltas
    return None if found is None else (most, found)


def _loop_of(late: LateSystem, deltas: Mapping[str, float]) -> tuple[StateSpace | None, float]:
    """The loop around the dead time with these real parameters, and the dead time [s]; None for
    several dead times.
    """
    (name, one), *others = late.known.items()
    return (None if others else loop_about_dead_time(late.given, name, deltas)), one.delay


def _is_lost(late: LateSystem, deltas: Mapping[str, float]) -> bool:
    """Whether the loop with these real parameters is proven to be unstable."""
    L, T = _loop_of(late, deltas)
    loop = None if L is None else with_delay_of(L, T)
    return loop is not None and (loop.unstable_poles() or 0) > 0


def _crossing(late: LateSystem, deltas: Mapping[str, float]) -> float:
    """The frequency [rad/s] at which the loop with these real parameters is nearest to -1."""
    L, T = _loop_of(late, deltas)
    loop = None if L is None else with_delay_of(L, T)
    crossings = [] if loop is None else loop.unit_crossings()
    return min(crossings, key=lambda one: abs(1.0 + one.value)).omega if crossings else 0.0


def _worst(late: LateSystem, omega: float, bound: LowerBound) -> dict[str, Any]:
    """The perturbation of a lower bound, as values of the elements by name."""
    import control

    structure, Delta = late.structure, np.asarray(bound.Delta)
    constant = np.zeros(Delta.shape)
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        if isinstance(block, Real):
            constant[row, column] = Delta[row, column].real
    if omega:
        z = null_vector(late.matrices(np.array([omega]))[0], Delta)
        made = interpolated(Delta, z, structure, omega, constant)
    else:
        made = control.ss([], [], [], Delta.real)
    elements = [one for name, one in late.cover.elements.items() if name not in late.known]
    return values_of(elements, structure, made)


def _speeds(cover: UncertainSystem) -> tuple[float, float]:
    """Sizes of the slowest and of the fastest pole [rad/s]."""
    sizes = np.abs(cover.nominal.poles())
    sizes = sizes[sizes > 0]
    return (float(sizes.min()), float(sizes.max())) if sizes.size else (1.0, 1.0)


def _places(slices: Any, blocks: list[int], *, inside: bool) -> list[int]:
    """Indices of the signals of blocks (``inside``), or of the others."""
    return [
        at
        for k, one in enumerate(slices)
        if (k in blocks) is inside
        for at in range(one.start, one.stop)
    ]
