"""A plant and a controller in a loop, of which dear margins are computed when asked for."""

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
from workbench.uncertainty.algebra.rational_delays import nominal_but_late, without_dead_time
from workbench.uncertainty.algebra.system import UncertainSystem, uncertain

if TYPE_CHECKING:  # what computes them is imported when it is asked for
    from workbench.mu.margins.disk import DiskMargin
    from workbench.mu.margins.of_sets import SetMargins

PADE_ORDERS = (6, 8, 10, 12, 14)
"""Orders of the approximation of dead time in disks of sets; a higher one loses digits."""
CORNER = 2.0
"""Least frequency at which its error may be as large as it is, in highest crossovers."""
MEMBERS = 20
"""Random plants of a set whose loops are drawn."""
PARTS = 4000
"""Most parts of a box of real parameters that are examined for a margin."""
PARTS_WITH_DYNAMICS = 120
"""The same where there are dynamics too: bounds then keep a distance that no number closes."""
SET_TOLERANCE = 1e-2
"""Least relative distance between bounds of a gain, a phase or a delay that every plant bears."""


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """The loop u = -K y of a plant and a controller; the rest as of `loop_margins`."""

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
        """Whether anything beside known dead time is."""
        return len(self._elements) > len(dead_times(self._elements))

    @cached_property
    def loops(self) -> dict[str, StateSpace | UncertainSystem]:
        """The nominal L of each channel by name, opened there and closed elsewhere."""
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
            _ = self._returned  # raises where the loop is singular
        if self._single:
            margins = classical_margins(next(iter(self.loops.values())))
            return dict.fromkeys(self.channels.values(), margins)
        return {name: classical_margins(one) for name, one in self.loops.items()}

    def disks(self) -> dict[str, DiskMargin]:
        """The disk margin of each channel, of every plant where the plant is uncertain."""
        return self._disks_of({name: {k: name} for k, name in self.channels.items()})

    def together(self) -> dict[str, DiskMargin]:
        """Disk margins of inputs, of outputs and of all channels at once."""
        return self._disks_of(self._groups)

    def nominal_disks(self) -> dict[str, DiskMargin]:
        """All disk margins of the nominal plant, where the plant is uncertain."""
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
        """What every plant of a set bears in each channel, gain, phase and delay alone."""
        from workbench.mu.margins.of_sets import set_margins

        every = self.channels
        if self._single:  # L is the same at either place
            every = dict(list(every.items())[:1])
        loop = self.stable_loop
        real = all(isinstance(block, Real) for block in loop.structure)
        parts = self.parts or (PARTS if real else PARTS_WITH_DYNAMICS)
        tolerance = max(self.tolerance, SET_TOLERANCE)
        found = set_margins(loop, every, tolerance, parts, self.time_limit)
        first = next(iter(found.values()))
        return {name: found.get(name, first) for name in self.channels.values()}

    def members(self) -> list[StateSpace]:
        """Loops of random plants of a set, of a plant of one channel."""
        if not (self._single and self.is_uncertain) or self._late:
            return []
        G, K = self.pair
        return (G * K).sample(MEMBERS)

    # --- what it is -----------------------------------------------------------------------------

    @cached_property
    def _alone(self) -> bool:
        """Whether the plant is all of a loop of one channel, with the coefficients it was given."""
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
        """Names of known dead time; empty without one."""
        return ", ".join(dead_times(self._elements))

    @property
    def _groups(self) -> dict[str, dict[int, str]]:
        """Channels that are taken together."""
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
            G, K = (without_dead_time(one, order=order) for one in (G, K))
        return returned_loop(G, K)

    @cached_property
    def stable_loop(self) -> UncertainSystem:
        """The loop with its channels opened for what is added; raises where it is not stable."""
        need_stable_loop(self._returned.nominal)
        return self._returned

    @cached_property
    def _late_loops(self) -> Mapping[str, DelayedLoop | CoupledLoop]:
        """L of each channel by name, with its dead time."""
        G, K = self.pair
        if not self._single:
            every = late_pair(G, K).loops
            return {name: every[k] for k, name in self.channels.items()}
        return dict.fromkeys(self.channels.values(), late_loop(G * K))

    @cached_property
    def _exact(self) -> Mapping[str, DelayedLoop | CoupledLoop]:
        """The same; raises InputError where the closed loop is not stable."""
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
                f"the loop of the set with the dead time {self._late} keeps a size up to infinite "
                "frequency, where no Pade approximation follows it, so that no disk of every plant "
                "is proven; `nominal` has those of the nominal plant"
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
        """The order of the approximation of dead time in the proofs for a set."""
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
                "on; `nominal` has the disks of the nominal plant"
            )
        return order
