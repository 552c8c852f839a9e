"""A plant and a controller in a loop; expensive margins are computed when they are asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import is_real
from workbench.mu.loops.coupled_loop import CoupledLoop
from workbench.mu.loops.crossings import Crossing
from workbench.mu.loops.delayed_loop import DelayedLoop
from workbench.mu.loops.late_pair import late_pair
from workbench.mu.margins.classical import (
    ClassicalMargins,
    classical_margins,
    late_loop,
    margins_of_late,
)
from workbench.mu.margins.returned import (
    channel_names,
    matched_pair,
    names_of_channels,
    need_stable_loop,
    opened_channel,
    returned_loop,
)
from workbench.structure import Real
from workbench.systems.joints import UncertainPart, part_of
from workbench.uncertainty.algebra.dead_time import dead_times, pade_corner
from workbench.uncertainty.algebra.rational_delays import dead_time_approximation, nominal_but_late
from workbench.uncertainty.algebra.system import UncertainSystem, uncertain

if TYPE_CHECKING:  # modules with expensive margins are imported only when they are needed
    from workbench.mu.margins.disk import DiskMargin
    from workbench.mu.margins.of_sets import SetMargins

PADE_ORDERS = (6, 8, 10, 12, 14)
"""Orders of the Pade approximation of dead time in disks of sets; higher orders lose digits. The
least that suffices is used. Half of all approximates only slow loops; double of all loses the
digits that proofs need.
"""
CORNER = 2.0
"""The error bound of the approximation may reach its largest value only above this multiple of the
highest crossover frequency. Below that the error bound must be small, since the loop passes -1
there. With half of it disks are smaller than they need be; with double of it a higher order is
taken.
"""
MEMBERS = 20
"""Number of random plants of a set whose loops are drawn. They show how far loops of a set differ.
Half or double changes the figure only.
"""
PARTS = 4000
"""Largest number of parts of the box of real parameters that are examined for one margin. It limits
the time, as `PARTS` of a stability margin. With half of them a margin may keep a wider gap; double
takes twice as long where the gap stays.
"""
PARTS_WITH_DYNAMICS = 120
"""The same for a set with uncertain dynamics too: then the bounds keep a gap that no number of
parts closes, and each part takes a bound of mu over frequency. Half or double changes the time and,
by little, the gap.
"""
SET_TOLERANCE = 1e-2
"""Least relative distance between the bounds of a gain, phase or delay margin of a set. A designer
reads two digits of the margins of a set, and each digit more takes many times the parts. Half or
double changes the gap and the time.
"""


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """The loop u = -K y of a plant and a controller; the other fields as in `loop_margins`.

    Unlike a closed `StateSpace`, it keeps plant and controller apart, so that each channel can
    be opened.
    """

    plant: Any
    controller: Any
    skew: float
    tolerance: float
    parts: int | None
    time_limit: float | None

    @cached_property
    def pair(self) -> tuple[UncertainSystem, UncertainSystem]:
        """Plant and controller."""
        return matched_pair(self.plant, self.controller)

    @cached_property
    def channels(self) -> dict[int, str]:
        """Names of the channels at which the loop is opened, by number."""
        return {1: "loop"} if self._alone else names_of_channels(*self.pair)

    @property
    def is_uncertain(self) -> bool:
        """Whether the loop has an uncertain element other than known dead time."""
        return len(self._elements) > len(dead_times(self._elements))

    @cached_property
    def loops(self) -> dict[str, StateSpace | UncertainSystem]:
        """The nominal L of each channel by name: opened at that channel, closed at the others."""
        G, K = self.pair
        if self._single:
            one = G * K
            return dict.fromkeys(self.channels.values(), one if self._late else one.nominal)
        nominal = nominal_but_late(returned_loop(G, K))
        opened = {name: opened_channel(nominal, k) for k, name in self.channels.items()}
        return opened if self._late else {name: one.nominal for name, one in opened.items()}

    def classical(self) -> dict[str, ClassicalMargins]:
        """The margins of the nominal L of each channel."""
        if self._alone:
            return {"loop": classical_margins(self.plant)}
        if self._late and not self._single:
            return {name: margins_of_late(one) for name, one in self._late_loops.items()}
        if not self._late:
            _ = self._returned  # raises InputError where the loop is singular
        if self._single:
            margins = classical_margins(next(iter(self.loops.values())))
            return dict.fromkeys(self.channels.values(), margins)
        return {name: classical_margins(one) for name, one in self.loops.items()}

    def disks(self) -> dict[str, DiskMargin]:
        """The disk margin of each channel; it holds for every plant of an uncertain set."""
        return self._disks_of({name: {k: name} for k, name in self.channels.items()})

    def together(self) -> dict[str, DiskMargin]:
        """Disk margins of the inputs, of the outputs and of all channels at once."""
        return self._disks_of(self._groups)

    def nominal_disks(self) -> dict[str, DiskMargin]:
        """All disk margins of the nominal plant, if the plant is uncertain."""
        if not self.is_uncertain:
            return {}
        wanted = {name: {k: name} for k, name in self.channels.items()} | self._groups
        if self._late:
            return self._late_disks(wanted)
        from workbench.mu.margins.disk import disk_of

        nominal = uncertain(self.stable_loop.nominal)
        return {
            name: disk_of(nominal, part, self.skew, self.tolerance) for name, part in wanted.items()
        }

    def every_plant(self) -> dict[str, SetMargins]:
        """Gain, phase and delay margins, each alone, that every plant keeps in each channel."""
        from workbench.mu.margins.of_sets import set_margins

        every = self.channels
        if self._single:  # with one input and one output, L is the same at both
            every = dict(list(every.items())[:1])
        loop = self.stable_loop
        real = all(isinstance(block, Real) for block in loop.structure)
        parts = self.parts or (PARTS if real else PARTS_WITH_DYNAMICS)
        tolerance = max(self.tolerance, SET_TOLERANCE)
        found = set_margins(loop, every, tolerance, parts, self.time_limit)
        first = next(iter(found.values()))
        return {name: found.get(name, first) for name in self.channels.values()}

    def members(self) -> list[StateSpace]:
        """Loops of random plants of the set, for a plant with one channel."""
        if not (self._single and self.is_uncertain) or self._late:
            return []
        G, K = self.pair
        return (G * K).sample(MEMBERS)

    # --- properties of the loop
    # -------------------------------------------------------------------

    @cached_property
    def _alone(self) -> bool:
        """Whether the plant is the whole loop, with one channel and its own coefficients."""
        if not is_real(self.controller) or self.controller != 1:
            return False
        part = part_of(self.plant, "plant")
        return hasattr(part, "noutputs") and part.noutputs == part.ninputs == 1

    @property
    def _single(self) -> bool:
        """Whether plant and controller have one channel each."""
        return self._alone or self.pair[0].noutputs == self.pair[0].ninputs == 1

    @cached_property
    def _elements(self) -> Mapping[str, Any]:
        if self._alone and not isinstance(part_of(self.plant, "plant"), UncertainPart):
            return {}
        G, K = self.pair
        return {**G.elements, **K.elements}

    @property
    def _late(self) -> str:
        """Names of the known dead times, in words; empty without any."""
        return ", ".join(dead_times(self._elements))

    @property
    def _groups(self) -> dict[str, dict[int, str]]:
        """Groups of channels that are perturbed together."""
        if len(self.channels) == 1:
            return {}
        m, p = self.pair[0].ninputs, self.pair[0].noutputs
        names = channel_names(m, p)
        groups: dict[str, dict[int, str]] = {}
        if m > 1:
            groups["inputs"] = {k: names[k] for k in range(m)}
        if p > 1:
            groups["outputs"] = {k: names[k] for k in range(m, m + p)}
        return groups | {"all": dict(enumerate(names))}

    @cached_property
    def _returned(self) -> UncertainSystem:
        G, K = self.pair
        if self._late:
            order = self._pade_order()
            G, K = (dead_time_approximation(one, order=order) for one in (G, K))
        return returned_loop(G, K)

    @cached_property
    def stable_loop(self) -> UncertainSystem:
        """The loop seen from signals added in its channels; raises InputError if unstable."""
        need_stable_loop(self._returned.nominal)
        return self._returned

    @cached_property
    def _late_loops(self) -> Mapping[str, DelayedLoop | CoupledLoop]:
        """L of each channel by name, with its exact dead time."""
        G, K = self.pair
        if not self._single:
            every = late_pair(G, K).loops
            return {name: every[k] for k, name in self.channels.items()}
        return dict.fromkeys(self.channels.values(), late_loop(G * K))

    @cached_property
    def _exact(self) -> Mapping[str, DelayedLoop | CoupledLoop]:
        """L of each channel by name, with its exact dead time; raises InputError if the closed loop
        is unstable.
        """
        first = next(iter(self._late_loops.values()))
        if not first.stable():
            raise InputError(
                f"the closed loop is unstable at the nominal with its dead time {self._late}; the "
                "loop is closed with negative feedback, u = -K y"
            )
        return self._late_loops

    def _disks_of(self, wanted: Mapping[str, dict[int, str]]) -> dict[str, DiskMargin]:
        if self._late and not self.is_uncertain:
            return self._late_disks(wanted)
        from workbench.mu.margins.disk import disk_of

        found = {
            name: disk_of(self.stable_loop, part, self.skew, self.tolerance)
            for name, part in wanted.items()
        }
        if self._late and not all(disk.lower > 0.0 for disk in found.values()):
            raise InputError(
                f"the loop of the set with the dead time {self._late} does not fall to 0 at "
                "infinite frequency, where no Pade approximation is accurate, so that no disk of "
                "every plant can be proven; `nominal_disks` has those of the nominal plant"
            )
        return found

    def _late_disks(self, wanted: Mapping[str, dict[int, str]]) -> dict[str, DiskMargin]:
        return {name: self._late_disk(part) for name, part in wanted.items()}

    def _late_disk(self, part: dict[int, str]) -> DiskMargin:
        from workbench.mu.margins.late_disk import late_disk
        from workbench.mu.margins.late_group import late_group

        names = tuple(part.values())
        exact = self._exact[names[0]]
        if len(names) == 1 or isinstance(exact, DelayedLoop):
            return late_disk(exact, names, self.skew, self.tolerance)
        returned = nominal_but_late(returned_loop(*self.pair))
        return late_group(returned, part, self.skew, self.tolerance)

    def _pade_order(self) -> int:
        """The order of the Pade approximation of dead time in proofs for a set."""
        turn = max(
            float(one.longest_delay) * crossing.omega
            for one in self._exact.values()
            for crossing in [Crossing(0.0, 0j), *one.unit_crossings()]
        )
        order = next((n for n in PADE_ORDERS if pade_corner(n) >= CORNER * turn), None)
        if order is None:
            raise InputError(
                f"the dead time {self._late} turns the loop by {turn:.4g} rad at its highest "
                "crossover, too far for the Pade approximation that margins of every plant rest "
                "on; `nominal_disks` has those of the nominal plant"
            )
        return order
