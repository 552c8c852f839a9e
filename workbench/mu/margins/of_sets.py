"""Gain, phase and delay margins that every plant of a set keeps, by branch and bound.

A disk margin lets gain and phase change together. Here the gain alone is a real factor, 1 + t or
1 / (1 + t), and the phase alone is a factor (1 + j t) / (1 - j t) with t = tan(phi / 2): one more
real parameter, beside those of the plant, which stay within their ranges. A delay alone is a phase
that grows with frequency (`workbench.mu.margins.set_delay`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from workbench.answer import REPEATED_ROUNDING, Answer
from workbench.arrays import RealArray
from workbench.certificate import Check, Checker, excess
from workbench.errors import InputError
from workbench.executor.effort import tries
from workbench.heavy_types import StateSpace
from workbench.input_checks import need_count, need_tolerance
from workbench.mu.boxes.margin import BoxMargin, LastGrowing, box_margin
from workbench.mu.boxes.recentred import RealParameters
from workbench.mu.frequency.channels import even_channels
from workbench.mu.margins.classical import ClassicalMargins, classical_margins
from workbench.mu.margins.loop import matched_loop, opened_channel
from workbench.mu.margins.set_delay import DelayBounds, delay_bounds
from workbench.structure import Block, Complex, Full, Real, Structure
from workbench.systems.realisation import realisation
from workbench.uncertainty.algebra.system import UncertainSystem, uncertain

LARGEST_CHANGE = 1e3
"""Largest t of a gain that is looked for."""
LARGEST_TURN = 1e3
"""Largest t of a phase; it stands for 179.9 degrees."""
DRAWN, DRAWN_ROUNDING = 20, 1e-6
"""Plants that are drawn in a check, and the share by which their crossings may be off."""
LOST_ROUNDING = 1e-4
"""Share by which the crossings of the plant that is lost first may be off: they are nearly double
where the border of stability is touched."""


@dataclass(frozen=True, eq=False, repr=False)
class SetMargins(Answer):
    """Margins of one channel that every plant of a set keeps.

    The loops of all plants are stable for a gain between the ends of ``gain``, for a phase up to
    ``phase`` [deg] of either sign, and for a delay up to ``delay`` [s]. Some plant is not at a gain
    outside ``gain_lost``, at the phase ``phase_lost`` and at the delay ``delay_lost`` (infinite, or
    0 for a lower end, where none was found): ``plants`` has the parameters of the plants that are
    lost first, by "rise", "fall", "phase" and "delay".

    Examples
    --------
    >>> import control
    >>> from workbench.mu import SetMargins, set_margins
    >>> from workbench.uncertainty import real, tf
    >>> k = real("k", 10, percent=40)
    >>> found = set_margins(
    ...     tf([18], [1, 1.8, k]), control.tf([0.4, 1.0], [0.02, 1.0]), tolerance=0.1
    ... )
    >>> [isinstance(margin, SetMargins) for margin in found.values()]
    [True, True]
    """

    gain: tuple[float, float]
    phase: float
    gain_lost: tuple[float, float]
    phase_lost: float
    delay: float
    delay_lost: float
    plants: Mapping[str, Mapping[str, float]]

    def said(self) -> str:
        (low, high), (lost_low, lost_high) = self.gain, self.gain_lost
        return (
            f"SetMargins: gain {low:.4g} to {high:.4g}, phase {self.phase:.4g} degrees, delay "
            f"{self.delay:.4g} s for every plant; lost at {lost_low:.4g} and {lost_high:.4g}, "
            f"{self.phase_lost:.4g} degrees, {self.delay_lost:.4g} s"
        )


def set_margins(
    plant: Any, controller: Any = 1.0, *, tolerance: float = 1e-2, parts: int = 4000
) -> dict[str, SetMargins]:
    """Gain, phase and delay margins of each channel that every plant of an uncertain set keeps.

    Parameters
    ----------
    plant, controller
        As in `loop_margins`; of the uncertain elements at least one is a real parameter.
    tolerance
        Relative distance of the bounds of t. Where the set has dynamics too, upper bounds of mu
        keep a distance that no number of parts closes.
    parts
        Most parts of the box of parameters that are examined for each margin.

    Raises
    ------
    InputError
        As `loop_margins`; the plant has no real parameter.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import set_margins
    >>> from workbench.uncertainty import real, tf
    >>> k = real("k", 10, percent=40)
    >>> found = set_margins(
    ...     tf([18], [1, 1.8, k]), control.tf([0.4, 1.0], [0.02, 1.0]), tolerance=0.1
    ... )
    >>> [round(margin.phase) > 0 for margin in found.values()]
    [True, True]
    """
    need_tolerance(tolerance)
    need_count("parts", parts)
    loop, channels = matched_loop(plant, controller)
    if not loop.elements or not any(isinstance(block, Real) for block in loop.structure):
        raise InputError("the plant has no uncertain real parameter; `loop_margins` serves it")

    return {
        name: margins_of_channel(loop, k, tolerance, parts).checked_by(
            SetChecker(loop, k, tolerance, parts)
        )
        for k, name in channels.items()
    }


def margins_of_channel(
    loop: UncertainSystem, channel: int, tolerance: float, parts: int
) -> SetMargins:
    """The margins of one channel of a `matched_loop`; the rest as of `set_margins`."""

    def parameters(whole: StateSpace, structure: Structure) -> RealParameters:
        return RealParameters(even_channels(whole, structure)[0], structure)

    def bounded(whole: StateSpace, structure: Structure, largest: float) -> BoxMargin:
        given = parameters(whole, structure)
        return box_margin(given, LastGrowing(len(given.places)), tolerance, parts, largest)

    rise = bounded(*_with_rise(loop, channel), LARGEST_CHANGE)
    fall = bounded(*_with_fall(loop, channel), LARGEST_CHANGE)
    turn = bounded(*_with_phase(loop, channel), LARGEST_TURN)
    late = delay_bounds(
        parameters(*_with_delay(loop, channel)), partial(_delay_of, loop, channel), tolerance, parts
    )
    kinds: dict[str, BoxMargin | DelayBounds] = {
        "rise": rise,
        "fall": fall,
        "phase": turn,
        "delay": late,
    }
    # Poles of the plants that are lost were found in doubles, so their sizes are known no better.
    beyond = 1.0 + REPEATED_ROUNDING
    return SetMargins(
        (1.0 / (1.0 + fall.lower), 1.0 + rise.lower),
        math.degrees(2 * math.atan(turn.lower)),
        (1.0 / (1.0 + fall.upper * beyond), 1.0 + rise.upper * beyond),
        math.degrees(2 * math.atan(turn.upper * beyond)) if turn.values is not None else math.inf,
        late.lower,
        late.upper * beyond,
        {kind: _plant(loop, one.values) for kind, one in kinds.items() if one.values is not None},
    )


@dataclass(frozen=True, eq=False)
class SetChecker(Checker):
    """Checks the `SetMargins` of one channel of a `matched_loop`; the rest as of `set_margins`."""

    loop: UncertainSystem
    channel: int
    tolerance: float
    boxes: int

    @property
    def quantifier(self) -> str:
        return "for every plant of the set"

    def checks(self, answer: SetMargins, tolerance: float) -> list[Check]:
        """Every margin is computed again: nothing shorter proves that boxes are excluded."""
        again = margins_of_channel(self.loop, self.channel, self.tolerance, self.boxes)
        kept = (
            ("least gain", again.gain[0], answer.gain[0]),
            ("largest gain", answer.gain[1], again.gain[1]),
            ("phase", answer.phase, again.phase),
            ("delay", answer.delay, again.delay),
        )
        statement = "by which share it is better than the one computed again"
        return [
            Check(name, statement, excess(one, other), REPEATED_ROUNDING)
            for name, one, other in kept
        ]

    def second_opinion(self, answer: SetMargins) -> list[Check]:
        """Plants that are drawn keep the margins by their own crossings; the lost one does not."""
        members = [self._crossings(member) for member in self.loop.sample(tries(DRAWN))]
        low = max(one.gain[0] for one in members)
        high = min(one.gain[1] for one in members)
        phase = min(abs(one.phase) for one in members)
        delay = min(one.delay for one in members)
        kept = (
            ("least gain", low, answer.gain[0]),
            ("largest gain", answer.gain[1], high),
            ("phase", answer.phase, phase),
            ("delay", answer.delay, delay),
        )
        over, statement = (
            f"for {len(members)} plants",
            "by which share a plant that is drawn keeps less",
        )
        return [
            Check(f"drawn: {name}", statement, excess(one, other), DRAWN_ROUNDING, over=over)
            for name, one, other in kept
        ] + self._lost(answer)

    def _lost(self, answer: SetMargins) -> list[Check]:
        """Checks that the plants that are lost first keep no more, where parameters tell of all."""
        if not all(isinstance(block, Real) for block in self.loop.structure):
            return []
        statement, found = "by which share the plant that is lost keeps more", []
        for kind, plant in answer.plants.items():
            own = self._crossings(self.loop.at(**plant))
            more = {
                "rise": (own.gain[1], answer.gain_lost[1]),
                "fall": (answer.gain_lost[0], own.gain[0]),
                "phase": (abs(own.phase), answer.phase_lost),
                "delay": (own.delay, answer.delay_lost),
            }[kind]
            value, over = excess(*more) if own.stable else 0.0, "for this one plant"
            found.append(Check(f"lost: {kind}", statement, value, LOST_ROUNDING, over=over))
        return found

    def _crossings(self, member: StateSpace) -> ClassicalMargins:
        return classical_margins(opened_channel(uncertain(member), self.channel))


def _channel(loop: UncertainSystem, channel: int) -> StateSpace:
    """The perturbations' channels and one of the loop's, in which what is added returns."""
    whole, structure = loop.system, loop.structure
    out = [*range(structure.columns), structure.columns + channel]
    into = [*range(structure.rows), structure.rows + channel]
    parts = (whole.A, whole.B[:, into], whole.C[out], whole.D[np.ix_(out, into)])
    return realisation(parts, whole.dt)


def _with_rise(loop: UncertainSystem, channel: int) -> tuple[StateSpace, Structure]:
    """The factor 1 + t in a channel: t times the signal is added."""
    return _channel(loop, channel), Structure((*loop.structure, Real(1, "t")))


def _with_fall(loop: UncertainSystem, channel: int) -> tuple[StateSpace, Structure]:
    """The factor 1 / (1 + t) in a channel: t times what leaves it is taken away."""
    one = _channel(loop, channel)
    B, D = one.B.copy(), one.D.copy()
    B[:, -1] *= -1.0
    D[:, -1] *= -1.0
    D[-1, -1] -= 1.0
    return realisation((one.A, B, one.C, D), one.dt), Structure((*loop.structure, Real(1, "t")))


def _with_phase(loop: UncertainSystem, channel: int) -> tuple[StateSpace, Structure]:
    """The factor (1 + j t) / (1 - j t) in a channel: 2 w is added, with w = j t (v + w)."""
    return _turned(loop, channel, np.eye(1))


def _with_delay(loop: UncertainSystem, channel: int) -> tuple[StateSpace, Structure]:
    """The square of the factor of `_with_phase`: the second one turns what the first one gives."""
    return _turned(loop, channel, np.array([[1.0, 0.0], [2.0, 1.0]]))


def _turned(loop: UncertainSystem, channel: int, series: RealArray) -> tuple[StateSpace, Structure]:
    """Factors in series, of which number i sees v + sum_k series[i, k] w_k.

    Each signal is two, its real and its imaginary part, and j is a matrix J. What is added in the
    channel is 2 sum w_k, with w_i = t J (v + ...).
    """
    one, n = _channel(loop, channel), len(series)
    into, out = np.ones((1, n)), np.ones((n, 1))
    B = np.hstack([one.B[:, :-1], 2.0 * one.B[:, -1:] @ into])
    C = np.vstack([one.C[:-1], out @ one.C[-1:]])
    D = np.block(
        [
            [one.D[:-1, :-1], 2.0 * one.D[:-1, -1:] @ into],
            [out @ one.D[-1:, :-1], 2.0 * out @ one.D[-1:, -1:] @ into + series],
        ]
    )
    A, B, C, D = (np.kron(part, np.eye(2)) for part in (one.A, B, C, D))
    turn = np.kron(np.eye(n), np.array([[0.0, -1.0], [1.0, 0.0]]))
    C[-2 * n :], D[-2 * n :] = turn @ C[-2 * n :], turn @ D[-2 * n :]
    structure = Structure((*(_doubled(block) for block in loop.structure), Real(2 * n, "t")))
    return realisation((A, B, C, D), one.dt), structure


def _delay_of(loop: UncertainSystem, channel: int, values: RealArray) -> float:
    """Delay margin [s] of the member with normalised values of the real parameters."""
    member = uncertain(loop.at(**_plant(loop, values)))
    return float(classical_margins(opened_channel(member, channel)).delay)


def _doubled(block: Block) -> Block:
    """A block of signals of two parts each."""
    if isinstance(block, Full):
        return Full(2 * block.outputs, 2 * block.inputs, block.name)
    if isinstance(block, Real):
        return Real(2 * block.n, block.name)
    assert isinstance(block, Complex)
    return Complex(2 * block.n, block.name)


def _plant(loop: UncertainSystem, values: RealArray) -> dict[str, float]:
    """The plant's parameters in a perturbation, by name."""
    real = [
        one
        for one, block in zip(loop.elements.values(), loop.structure, strict=True)
        if isinstance(block, Real)
    ]
    return {one.name: float(one.value(v)) for one, v in zip(real, values, strict=False)}
