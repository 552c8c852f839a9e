"""Gain, phase and delay margins that every plant of a set keeps, by branch and bound.

A disk margin lets gain and phase change together. Here each of them changes alone, as one more real
parameter (`workbench.mu.margins.channel_factors`) beside those of the plant, which stay within
their ranges.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.answer import REPEATED_ROUNDING, Answer
from workbench.certificate import Check, Checker, relative_excess
from workbench.executor import Context
from workbench.executor.effort import tries
from workbench.executor.live import shown_live
from workbench.mu.boxes.margin import (
    REPROOF_PARTS,
    BoxMargin,
    LastGrowing,
    box_margin,
    proven_stable,
)
from workbench.mu.boxes.recentred import RealParameters
from workbench.mu.frequency.channels import even_channels
from workbench.mu.margins.channel_factors import with_delay, with_fall, with_phase, with_rise
from workbench.mu.margins.classical import ClassicalMargins, classical_margins, delay_in_words
from workbench.mu.margins.returned import opened_channel
from workbench.mu.margins.set_delay import DelayBounds, bears_delay, delay_bounds
from workbench.solvers import Options
from workbench.structure import Real, Structure
from workbench.uncertainty.algebra.system import UncertainSystem, uncertain

LARGEST_CHANGE = 1e3
"""Largest t of a gain that is searched. Gains farther from 1 than 60 dB are of no use to a
designer, as in `LARGEST_FACTOR`. Half or double only changes what is called infinite.
"""
LARGEST_TURN = 1e3
"""Largest t of a phase; it corresponds to 179.9 degrees. Half or double: 179.8 or 179.94 degrees;
only what is called half a turn changes.
"""
KINDS = 4
"""Number of margins per channel that share the time: gain up, gain down, phase and delay. It
follows from that list. Another number leaves time unused, or the last kind without any. Half or
double gives each kind too much or too little of it.
"""
REPROVEN_SHARE = 1 - REPEATED_ROUNDING
"""Share of a margin that is proven again: the search stops where the proof has no room left."""
DRAWN_PLANTS, DRAWN_ROUNDING = 20, 1e-6
"""Number of plants drawn in a check, and the relative error allowed for their crossings. A check on
a few plants finds a margin that is wrong for many. Half finds less, double takes longer; half of
the error may contradict plants whose crossings are nearly double.
"""
LOST_ROUNDING = 1e-4
"""Relative error allowed for the crossings of the plant that is lost first: they are nearly double
where the stability border is touched. A double crossing is known to half of the digits of a double,
1e-8, and is divided by the slope of the curve. With half of it a true margin of such a plant may be
contradicted; double overlooks an error of 2e-4.
"""


@dataclass(frozen=True, eq=False, repr=False)
class SetMargins(Answer):
    """Margins of one channel that every plant of a set keeps.

    Unlike `ClassicalMargins`, it holds for every plant of a set, with the plant that is lost
    first.

    The loops of all plants are stable for a gain between the ends of ``gain``, for a phase up to
    ``phase_deg`` [deg] of either sign, and for a delay up to ``delay`` [s]. Some plant's loop is
    unstable at each end of ``gain_lost``, at the phase ``phase_lost_deg`` [deg], and at the delay
    ``delay_lost`` [s]; where no such plant was found, these are infinite, or 0 for a lower end.
    ``plants`` has the parameters of the plants that are lost first, by "rise", "fall", "phase" and
    "delay". ``dt`` [s] is the sampling time, 0 in continuous time.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import SetMargins, loop_margins
    >>> from workbench.uncertainty import real, tf
    >>> k = real("k", 10, percent=40)
    >>> margins = loop_margins(
    ...     tf([18], [1, 1.8, k]), control.tf([0.4, 1.0], [0.02, 1.0]), tolerance=0.1
    ... )
    >>> found = margins.every_plant["input"]
    >>> isinstance(found, SetMargins), found.phase_deg <= found.phase_lost_deg
    (True, True)
    """

    gain: tuple[float, float]
    phase_deg: float
    gain_lost: tuple[float, float]
    phase_lost_deg: float
    delay: float
    delay_lost: float
    plants: Mapping[str, Mapping[str, float]]
    dt: float = field(default=0.0, kw_only=True)

    def summary(self) -> str:
        (low, high), (lost_low, lost_high) = self.gain, self.gain_lost
        late, lost = (delay_in_words(one, self.dt) for one in (self.delay, self.delay_lost))
        return (
            f"SetMargins: gain {low:.4g} to {high:.4g}, phase {self.phase_deg:.4g} degrees, delay "
            f"{late} for every plant; lost at {lost_low:.4g} and {lost_high:.4g}, "
            f"{self.phase_lost_deg:.4g} degrees, {lost}"
        )


def set_margins(
    loop: UncertainSystem,
    channels: Mapping[int, str],
    tolerance: float,
    parts: int,
    time_limit: float | None = None,
) -> dict[str, SetMargins]:
    """Gain, phase and delay margins of each channel that every plant of an uncertain set keeps.

    Parameters
    ----------
    loop
        A `returned_loop` that is stable at its nominal and has an uncertain element.
    channels
        Number and name of each channel.
    tolerance
        Relative distance of the bounds of t. If the set has uncertain dynamics too, upper bounds of
        mu keep a gap that no number of parts closes.
    parts
        Largest number of parts of the box of parameters that are examined for each margin.
    time_limit
        Time [s] after which the bounds so far are returned.
    """
    with shown_live("margins of every plant") as (progress, watch):
        shares = _shares(time_limit, KINDS * len(channels))

        def next_context() -> Context:
            return Context(options=Options(time_limit=next(shares)), progress=progress, watch=watch)

        return {
            name: margins_of_channel(loop, k, tolerance, parts, next_context).with_checker(
                SetChecker(loop, k, tolerance, parts)
            )
            for k, name in channels.items()
        }


def _shares(time_limit: float | None, count: int) -> Iterator[float | None]:
    """Time [s] that each of ``count`` searches may take; time that one leaves unused goes to those
    after it.
    """
    end = None if time_limit is None else time.perf_counter() + time_limit
    for left in range(count, 0, -1):
        rest = 0.0 if end is None else (end - time.perf_counter()) / left
        # a limit of 0 s would mean no limit
        yield None if end is None else max(rest, math.ulp(0.0))


def margins_of_channel(
    loop: UncertainSystem,
    channel: int,
    tolerance: float,
    parts: int,
    next_context: Callable[[], Context] = Context,
) -> SetMargins:
    """The margins of one channel; ``next_context`` gives the time limit of each search."""

    def bounded(change: Any, largest: float) -> BoxMargin:
        given = _parameters(*change(loop, channel))
        boxes = LastGrowing(len(given.places))
        return box_margin(given, boxes, tolerance, parts, largest, next_context())

    rise = bounded(with_rise, LARGEST_CHANGE)
    fall = bounded(with_fall, LARGEST_CHANGE)
    turn = bounded(with_phase, LARGEST_TURN)
    given, delay_of = _parameters(*with_delay(loop, channel)), partial(_delay_of, loop, channel)
    late = delay_bounds(given, delay_of, tolerance, parts, next_context())
    kinds: dict[str, BoxMargin | DelayBounds] = {
        "rise": rise,
        "fall": fall,
        "phase": turn,
        "delay": late,
    }
    # The plants that are lost were found in doubles, so their sizes have that accuracy only.
    beyond = 1.0 + REPEATED_ROUNDING
    return SetMargins(
        (1.0 / (1.0 + fall.lower), 1.0 + rise.lower),
        math.degrees(2 * math.atan(turn.lower)),
        (1.0 / (1.0 + fall.upper * beyond), 1.0 + rise.upper * beyond),
        math.degrees(2 * math.atan(turn.upper * beyond)) if turn.values is not None else math.inf,
        late.lower,
        late.upper * beyond,
        {kind: _plant(loop, one.values) for kind, one in kinds.items() if one.values is not None},
        dt=float(loop.dt or 0.0),
    )


def proven_again(
    loop: UncertainSystem, channel: int, claimed: SetMargins, tolerance: float, parts: int
) -> SetMargins:
    """The claimed margins that can be proven again, each one or nothing; the search is not
    repeated.
    """

    def kept(change: Any, t: float) -> bool:
        given = _parameters(*change(loop, channel))
        return t <= 0.0 or proven_stable(
            given, LastGrowing(len(given.places)), REPROVEN_SHARE * t, parts
        )

    low, high = claimed.gain
    given, delay_of = _parameters(*with_delay(loop, channel)), partial(_delay_of, loop, channel)
    late = claimed.delay <= 0.0 or bears_delay(
        given, delay_of, REPROVEN_SHARE * claimed.delay, tolerance, parts
    )
    turned = kept(with_phase, math.tan(math.radians(claimed.phase_deg) / 2))
    gain = (
        low if low > 0.0 and kept(with_fall, 1.0 / low - 1.0) else 1.0,
        high if math.isfinite(high) and kept(with_rise, high - 1.0) else 1.0,
    )
    return SetMargins(
        gain,
        claimed.phase_deg if turned else 0.0,
        (0.0, math.inf),
        math.inf,
        claimed.delay if late else 0.0,
        math.inf,
        {},
    )


@dataclass(frozen=True, eq=False)
class SetChecker(Checker):
    """Checks the `SetMargins` of one channel; the fields are arguments of `set_margins`."""

    loop: UncertainSystem
    channel: int
    tolerance: float
    boxes: int

    @property
    def quantifier(self) -> str:
        return "for every plant of the set"

    def checks(self, answer: SetMargins, tolerance: float) -> list[Check]:
        """Prove every margin again from its number."""
        parts = REPROOF_PARTS * self.boxes
        again = proven_again(self.loop, self.channel, answer, self.tolerance, parts)
        kept = (
            ("least gain", again.gain[0], answer.gain[0]),
            ("largest gain", answer.gain[1], again.gain[1]),
            ("phase", answer.phase_deg, again.phase_deg),
            ("delay", answer.delay, again.delay),
        )
        statement = "by which share it is better than what is proven again"
        return [
            Check(name, statement, relative_excess(one, other), REPEATED_ROUNDING)
            for name, one, other in kept
        ]

    def second_opinion(self, answer: SetMargins) -> list[Check]:
        """Random plants must keep the margins, by their own crossings; the plant that is lost must
        not.
        """
        members = [self._crossings(member) for member in self.loop.sample(tries(DRAWN_PLANTS))]
        low = max(one.gain[0] for one in members)
        high = min(one.gain[1] for one in members)
        phase = min(abs(one.phase_deg) for one in members)
        delay = min(one.delay for one in members)
        kept = (
            ("least gain", low, answer.gain[0]),
            ("largest gain", answer.gain[1], high),
            ("phase", answer.phase_deg, phase),
            ("delay", answer.delay, delay),
        )
        over, statement = (
            f"for {len(members)} plants",
            "by which share a plant that is drawn keeps less",
        )
        return [
            Check(
                f"drawn: {name}", statement, relative_excess(one, other), DRAWN_ROUNDING, over=over
            )
            for name, one, other in kept
        ] + self._lost(answer)

    def _lost(self, answer: SetMargins) -> list[Check]:
        """Check that the plants that are lost first keep no larger margin."""
        statement, found = "by which share the plant that is lost keeps more", []
        for kind, plant in answer.plants.items():
            own = self._crossings(self.loop.at(**plant))
            more = {
                "rise": (own.gain[1], answer.gain_lost[1]),
                "fall": (answer.gain_lost[0], own.gain[0]),
                "phase": (abs(own.phase_deg), answer.phase_lost_deg),
                "delay": (own.delay, answer.delay_lost),
            }[kind]
            value, over = relative_excess(*more) if own.stable else 0.0, "for this one plant"
            found.append(Check(f"lost: {kind}", statement, value, LOST_ROUNDING, over=over))
        return found

    def _crossings(self, member: StateSpace) -> ClassicalMargins:
        return classical_margins(opened_channel(uncertain(member), self.channel).nominal)


def _parameters(whole: StateSpace, structure: Structure) -> RealParameters:
    return RealParameters(even_channels(whole, structure)[0], structure)


def _delay_of(loop: UncertainSystem, channel: int, values: RealArray) -> float:
    """Delay margin [s] of the member with normalised values of the real parameters."""
    member = uncertain(loop.at(**_plant(loop, values)))
    return float(classical_margins(opened_channel(member, channel).nominal).delay)


def _plant(loop: UncertainSystem, values: RealArray) -> dict[str, float]:
    """The plant's parameters in a perturbation, by name."""
    real = [
        one
        for one, block in zip(loop.elements.values(), loop.structure, strict=True)
        if isinstance(block, Real)
    ]
    return {one.name: float(one.value(v)) for one, v in zip(real, values, strict=False)}
