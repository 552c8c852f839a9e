"""The margins of a loop, as a user reads them: the least ones, every crossing, disks, sets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Figure, StateSpace
from workbench._core.tables import markdown_table
from workbench.answer import Answer, PartsChecker
from workbench.errors import InputError
from workbench.mu.margins.classical import (
    NOT_TOLD,
    UNSTABLE,
    ClassicalMargins,
    in_both_units,
    least_db,
)
from workbench.mu.margins.closed_loop import ClosedLoop
from workbench.uncertainty.algebra.system import UncertainSystem

if TYPE_CHECKING:  # modules with expensive margins are imported only when they are needed
    from workbench.mu.margins.disk import DiskMargin
    from workbench.mu.margins.measured import MeasuredMargins
    from workbench.mu.margins.of_sets import SetMargins

ALIKE = 1e-6
"""Margins of two channels that differ by no more than this share are printed once: with one input
and one output, L is the same at both, except for rounding. It is below the digits printed. Half or
double changes how a text is set, and no number.
"""


@dataclass(frozen=True, eq=False, repr=False)
class LoopMargins(Answer):
    """Margins of the loop of a plant and a controller with negative feedback, u = -K y.

    ``gain``, ``gain_db``, ``phase_deg``, ``delay`` and ``modulus`` are the least margins; for an
    uncertain plant, those that every plant of the set keeps. ``gains``, ``phases_deg`` and
    ``delays`` have every crossing of the nominal loop. ``stable`` says whether the nominal closed
    loop is stable; None for measured data, which do not tell.

    ``classical`` has the margins of each channel of the nominal loop by name; for measured
    responses those of each plant, as `MeasuredMargins`. The following are computed when asked for:
    ``disks``, the disk margins of each channel; ``multiloop``, those of "inputs", "outputs" and
    "all" channels at once. For an uncertain plant all disks hold for every plant of the set,
    ``nominal_disks`` has those of the nominal plant, and ``every_plant`` the gain, phase and delay
    margins, each alone, that every plant keeps. The certificate covers the crossings and the disks,
    and ``every_plant`` once somebody has asked for it.
    """

    classical: Mapping[str, ClassicalMargins | MeasuredMargins]
    stable: bool | None
    closed: ClosedLoop | None

    # --- the least margins -----------------------------------------------------------------------

    @property
    def gain(self) -> tuple[float, float]:
        """The nearest destabilising factors below and above 1; 0 and infinity if there is none."""
        every = self._told
        return max(one.gain[0] for one in every), min(one.gain[1] for one in every)

    @property
    def gain_db(self) -> float:
        """The least change of the gain, up or down [dB]."""
        return least_db(self.gain)

    @property
    def phase_deg(self) -> float:
        """The least phase margin [deg]; negative against lead, infinite without a crossing.

        The margin of a set holds for lag and for lead.
        """
        return min((one.phase_deg for one in self._told), key=abs)

    @property
    def delay(self) -> float:
        """The least delay margin [s]; infinite if there is none."""
        return min(one.delay for one in self._told)

    @property
    def modulus(self) -> float:
        """The least distance of the nominal L, or of the data, from -1; 0 for an unstable loop."""
        return min(float(np.ravel(one.modulus)[0]) for one in self.classical.values())

    # --- every crossing --------------------------------------------------------------------------

    @property
    def gains(self) -> RealArray:
        """Gain factors and frequencies [rad/s] (K, 2): every crossing of the real axis.

        For data (K, 4), with the ends of the ranges.
        """
        return self._only.gains

    @property
    def phases_deg(self) -> RealArray:
        """Phase margins [deg] and frequencies [rad/s] (K, 2): every crossing of |L| = 1."""
        return self._only.phases_deg

    @property
    def delays(self) -> RealArray:
        """Delay margins [s] and frequencies [rad/s] (K, 2): every crossing of |L| = 1."""
        return self._only.delays

    # --- what is computed when asked for ---------------------------------------------------------

    @cached_property
    def disks(self) -> Mapping[str, DiskMargin]:
        """The disk margin of each channel by name."""
        return self._loop.disks()

    @cached_property
    def multiloop(self) -> Mapping[str, DiskMargin]:
        """Disk margins of "inputs", "outputs" and "all" channels at once."""
        return self._loop.together()

    @cached_property
    def nominal_disks(self) -> Mapping[str, DiskMargin]:
        """All disk margins of the nominal plant; empty if the plant is not uncertain."""
        return self._loop.nominal_disks()

    @cached_property
    def every_plant(self) -> Mapping[str, SetMargins]:
        """Margins that every plant of the set keeps in each channel; empty for a known plant."""
        found = self._loop.every_plant() if self._is_set else {}
        vars(self).pop("certificate", None)  # it says nothing of them
        return found

    @cached_property
    def least_disk(self) -> DiskMargin:
        """The least disk margin: the channels that break first."""
        return min([*self.disks.values(), *self.multiloop.values()], key=lambda one: one.lower)

    @property
    def skew(self) -> float:
        """Skew of the disks."""
        return self._loop.skew

    @property
    def loops(self) -> Mapping[str, StateSpace | UncertainSystem]:
        """The nominal L of each channel by name: opened at that channel, closed at the others."""
        return self._loop.loops

    @property
    def _loop(self) -> ClosedLoop:
        if self.closed is None:
            raise InputError(
                "measured responses say nothing between their frequencies, so that no disk can be "
                "proven for them: fit a model or a cover first; `modulus` is the least distance "
                "from -1 at the data"
            )
        return self.closed

    @property
    def _is_set(self) -> bool:
        return self.closed is not None and self.closed.is_uncertain

    @cached_property
    def _refusal(self) -> str:
        """Why there are no disks; empty if there are."""
        try:
            _ = self.least_disk
        except InputError as reason:
            return str(reason)
        return ""

    @property
    def _told(self) -> Sequence[ClassicalMargins | MeasuredMargins | SetMargins]:
        return list((self.every_plant if self._is_set else self.classical).values())

    @cached_property
    def _alike(self) -> bool:
        """Whether all channels have the same margins as the first one."""
        numbers = [[*one.gain, one.phase_deg, one.delay] for one in self.classical.values()]
        return bool(np.isclose(numbers, numbers[0], rtol=ALIKE, atol=0.0).all())

    @property
    def _only(self) -> ClassicalMargins | MeasuredMargins:
        """The margins of the only loop; raises InputError if there are several."""
        if not self._alike:
            raise InputError(
                f"each of {', '.join(self.classical)} has crossings of its own: take them from "
                f"classical[{next(iter(self.classical))!r}] and so on"
            )
        return next(iter(self.classical.values()))

    # --- in words --------------------------------------------------------------------------------

    def table(self) -> str:
        """All margins as a table in Markdown."""
        disks = self.disks if self.closed is not None and not self._refusal else {}
        together = self.multiloop if disks else {}
        rows: list[list[Any]] = []
        for name, one in self.classical.items():
            modulus = float(np.ravel(one.modulus)[0])
            cells = [f"{one.phase_deg:.4g}", f"{one.delay:.4g}", f"{modulus:.4g}"]
            disk = _disk_cells(disks[name]) if disks else [""] * 4
            rows.append([name, _range(*one.gain), *cells, *disk])
        rows += [[name, "", "", "", "", *_disk_cells(one)] for name, one in together.items()]
        heads = ["channel", "gain", "phase [deg]", "delay [s]", "modulus", "disk", "disk gain",
                 "disk phase [deg]", "at [Hz]"]  # fmt: skip
        return markdown_table(heads, rows)

    def summary(self) -> str:
        state = f"{UNSTABLE}; " if self.stable is False else ""
        over = "of the nominal, " if self._is_set else ""
        first, *others = self._least()
        lines = [f"LoopMargins: {state}{over}{first}", *(f"  {line}" for line in others)]
        if not self._alike:
            lines.append(self.table().rstrip())
        if self.stable is None:
            return "\n".join([*lines, f"  {NOT_TOLD}"])
        if self._is_set:
            lines.append(f"  {self._every_plant_line()}")
        if self.stable:
            lines += self._disk_lines()
        return "\n".join(lines)

    def _least(self) -> list[str]:
        """The margins that are printed first."""
        if self._alike:
            return next(iter(self.classical.values())).lines()
        every = self.classical.values()
        low, high = max(one.gain[0] for one in every), min(one.gain[1] for one in every)
        phase, delay = min((o.phase_deg for o in every), key=abs), min(o.delay for o in every)
        return [
            f"gain from {low:.4g} to {high:.4g}, phase {phase:.4g} degrees, delay {delay:.4g} s"
        ]

    def _every_plant_line(self) -> str:
        if "every_plant" not in vars(self):
            return "what every plant bears of each alone: computed when asked for, by `every_plant`"
        one = min(self.every_plant.values(), key=lambda one: one.phase_deg)
        return f"every plant: {one.summary().removeprefix('SetMargins: ')}"

    def _disk_lines(self) -> list[str]:
        if self._refusal:
            return [f"  no disk margins: {self._refusal}"]
        first = self.least_disk
        over = ", for every plant of the set" if first.plant is not None else ""
        skewed = f", skew {self.skew:g}" if self.skew else ""
        low, high = first.gain
        lines = [
            f"  gain and phase together{skewed}, in {' and '.join(first.channels)}{over}: disk "
            f"{first.lower:.4g}, gain {low:.4g} to {high:.4g} or phase {first.phase_deg:.4g} "
            "degrees"
        ]
        if first.worst is None:
            return lines
        s, words = 1j * first.omega, []
        for name, f in first.worst.items():
            value = complex(f(np.exp(s * f.dt) if f.dt else s))
            words.append(
                f"{name} times {abs(value):.4g} at {math.degrees(np.angle(value)):.4g} degrees"
            )
        return [*lines, f"  breaks first: {', '.join(words)}, {in_both_units(first.omega)}"]


class LoopChecker(PartsChecker):
    """Checks `LoopMargins` by its parts; the figure shows the disks that the curves avoid."""

    def parts(self, answer: LoopMargins) -> Mapping[str, Answer]:
        groups: dict[str, Mapping[str, Answer]] = {"margins": answer.classical}
        if answer.stable and not answer._refusal:
            groups |= {
                "disk": answer.disks,
                "disk of": answer.multiloop,
                "nominal disk": answer.nominal_disks,
            }
        if "every_plant" in vars(answer):
            groups["every plant"] = answer.every_plant
        return {f"{kind} {name}": one for kind, of in groups.items() for name, one in of.items()}

    def figures(self, answer: LoopMargins) -> dict[str, Figure]:
        """Nyquist curves with the disks that they avoid, and gains with phases that all
        tolerate.
        """
        if answer.closed is None:
            first = next(iter(answer.classical.values()))
            return first._checked_by[0].figures(first) if first._checked_by else {}
        from workbench.mu.margins import drawn

        proven = bool(answer.stable) and not answer._refusal
        disks = answer.disks if proven else {}
        together = answer.multiloop.get("all") if proven else None
        members = answer.closed.members()
        return {"margins": drawn.figure_of(answer.loops, disks, together, members)}


def _range(low: float, high: float) -> str:
    return f"{low:.4g} to {high:.4g}"


def _disk_cells(one: DiskMargin) -> list[str]:
    return [
        f"{one.lower:.4g}",
        _range(*one.gain),
        f"{one.phase_deg:.4g}",
        f"{one.omega / (2 * math.pi):.4g}",
    ]
