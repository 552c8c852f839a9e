"""All margins of a loop in one call: each channel at a time, all at once, over a set of plants."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, overload

import numpy as np

from workbench.answer import Answer, PartsChecker
from workbench.errors import InputError
from workbench.heavy_types import Figure, StateSpace
from workbench.identification.responses.periodic import ResponseEstimate
from workbench.input_checks import is_real, need_tolerance
from workbench.mu.margins import drawn
from workbench.mu.margins.classical import ClassicalMargins, classical_margins, delayed_loop
from workbench.mu.margins.disk import DiskMargin, disk_of
from workbench.mu.margins.measured import (
    MeasuredMargins,
    is_measured,
    loops_of,
    measured_margins,
)
from workbench.systems.axis_poles import pole_may_be_at
from workbench.systems.balancing import singular
from workbench.systems.realisation import worst_pole
from workbench.tables import markdown
from workbench.uncertainty.algebra.connections import append, feedback, not_well_posed
from workbench.uncertainty.algebra.dead_time import dead_times, pade_corner
from workbench.uncertainty.algebra.rational_delays import without_dead_time
from workbench.uncertainty.algebra.system import UncertainSystem, uncertain
from workbench.uncertainty.responses.plants import Responses

PADE_ORDERS = (6, 8, 10, 12, 14)
"""Orders of the approximation of dead time in disks; a higher one loses digits."""
CORNER = 2.0
"""Least frequency at which its error may be as large as it is, in highest crossovers."""
MEMBERS = 20
"""Random plants of a set whose loops are drawn."""


@dataclass(frozen=True, eq=False, repr=False)
class LoopMargins(Answer):
    """Margins of the loop of a plant and a controller with negative feedback, u = -K y.

    ``loops`` has the response L of each channel by name, opened there and closed elsewhere, at the
    nominal. ``classical`` are its margins and ``disks`` its disk margin. ``together`` has disk
    margins of "inputs", "outputs" and "all" channels at once. Where the plant is uncertain, all
    disks hold for every plant of the set, and ``nominal`` has those of the nominal plant;
    ``members`` are the loops of random plants, of a plant of one channel.
    """

    loops: Mapping[str, StateSpace | UncertainSystem]
    classical: Mapping[str, ClassicalMargins]
    disks: Mapping[str, DiskMargin]
    together: Mapping[str, DiskMargin]
    nominal: Mapping[str, DiskMargin]
    members: Sequence[StateSpace]
    skew: float

    @cached_property
    def first(self) -> DiskMargin:
        """The least disk margin: what breaks first."""
        return min([*self.disks.values(), *self.together.values()], key=lambda one: one.lower)

    def table(self) -> str:
        """All margins as a table in Markdown."""
        rows: list[list[Any]] = []
        for name, one in self.classical.items():
            low, high = one.gain
            disk = self.disks[name]
            rows.append([name, _range(low, high), f"{one.phase:.4g}", f"{one.delay:.4g}",
                         f"{one.modulus:.4g}", *_disk_cells(disk)])  # fmt: skip
        rows += [[name, "", "", "", "", *_disk_cells(one)] for name, one in self.together.items()]
        heads = ["channel", "gain", "phase [deg]", "delay [s]", "modulus", "disk", "disk gain",
                 "disk phase [deg]", "at [Hz]"]  # fmt: skip
        return markdown(heads, rows)

    def said(self) -> str:
        first = self.first
        over = ", for every plant of the set" if first.plant is not None else ""
        lines = [
            f"LoopMargins, skew {self.skew:g}: least in {' and '.join(first.channels)}{over}",
            self.table().rstrip(),
        ]
        if first.worst is not None:
            s = 1j * first.omega
            for name, f in first.worst.items():
                z = np.exp(s * f.dt) if f.dt else s
                value = complex(f(z))
                lines.append(
                    f"breaks first: {name} times {abs(value):.4g} at "
                    f"{math.degrees(np.angle(value)):.4g} degrees, {first.omega:.4g} rad/s"
                )
        return "\n".join(lines)


class LoopChecker(PartsChecker):
    """Checks `LoopMargins` by those of its parts; its figure has the disks that curves avoid."""

    def parts(self, answer: LoopMargins) -> Mapping[str, Answer]:
        groups: dict[str, Mapping[str, Answer]] = {
            "margins": answer.classical,
            "disk": answer.disks,
            "disk of": answer.together,
            "nominal disk": answer.nominal,
        }
        return {f"{kind} {name}": one for kind, of in groups.items() for name, one in of.items()}

    def figures(self, answer: LoopMargins) -> dict[str, Figure]:
        """Nyquist curves with the disks that they avoid, and gains with phases that all bear."""
        together = answer.together.get("all")
        return {"margins": drawn.figure_of(answer.loops, answer.disks, together, answer.members)}


@overload
def loop_margins(
    plant: Responses, controller: Any = 1.0, *, skew: float = 0.0, tolerance: float = 1e-4
) -> dict[str, MeasuredMargins]: ...


@overload
def loop_margins(
    plant: ResponseEstimate, controller: Any = 1.0, *, skew: float = 0.0, tolerance: float = 1e-4
) -> MeasuredMargins: ...


@overload
def loop_margins(
    plant: Any, controller: Any = 1.0, *, skew: float = 0.0, tolerance: float = 1e-4
) -> LoopMargins: ...


def loop_margins(
    plant: Any, controller: Any = 1.0, *, skew: float = 0.0, tolerance: float = 1e-4
) -> LoopMargins | MeasuredMargins | dict[str, MeasuredMargins]:
    """Gain, phase, delay, modulus and disk margins of a loop, proven between grid points.

    Of an uncertain plant the disks hold for all of its set, the others for the nominal; what gain
    and phase alone every plant bears, `set_margins` says. Known dead time in a loop of one channel
    counts as it is; only its disks are those of a set that contains it, `without_dead_time`. Of
    measured responses the answer is `MeasuredMargins`, of the data at their frequencies only, with
    ranges from variances.

    Parameters
    ----------
    plant
        A system, or an uncertain one; of any number of channels, in continuous or sampled time. Or
        a measured response of one channel: python-control's FrequencyResponseData, a
        `ResponseEstimate` with its variances, or `Responses` of several plants, whose margins are
        told by plant.
    controller
        K of u = -K y; for a loop L alone, 1.
    skew
        0: gain may rise and fall by the same factor; positive: more room to rise, negative: to
        fall. 1 is the disk of the sensitivity, -1 that of the complementary sensitivity.
    tolerance
        Relative distance between the bounds of a disk margin.

    Raises
    ------
    InputError
        Plant and controller do not fit each other, the loop is singular, or unstable at the
        nominal; or its dead time is not as `classical_margins` needs it, or turns the loop too far.

    Examples
    --------
    >>> from workbench.mu import loop_margins
    >>> from workbench.uncertainty import delay, tf
    >>> found = loop_margins(tf([1], [1, 0]) * delay("tau", 1.0, 1.0))
    >>> round(found.classical["loop"].delay, 6)  # pi / 2 - 1 s
    0.570796
    """
    if is_measured(plant):
        data, dt = loops_of(plant, controller)
        found = {name: measured_margins(one, dt) for name, one in data.items()}
        return found if isinstance(plant, Responses) else found["loop"]
    need_tolerance(tolerance)
    if not is_real(skew) or not math.isfinite(skew):
        raise InputError(f"skew is {skew!r}; a number is needed")
    G, K = _matched(plant, controller)
    if dead_times({**G.elements, **K.elements}):
        return _with_dead_time(G, K, skew, tolerance)
    returned, channels = matched_loop(G, K)
    nominal = uncertain(returned.nominal)
    m, p = G.ninputs, G.noutputs
    names = _names(m, p)
    only = len(channels) == 1
    groups: dict[str, dict[int, str]] = {}
    if m > 1:
        groups["inputs"] = {k: names[k] for k in range(m)}
    if p > 1:
        groups["outputs"] = {k: names[k] for k in range(m, m + p)}
    if not only:
        groups["all"] = dict(enumerate(names))
    scalar = G * K if m == p == 1 else None
    loops = {
        name: scalar.nominal if scalar is not None else opened_channel(nominal, k)
        for k, name in channels.items()
    }

    def every(system: UncertainSystem, wanted: Mapping[str, dict[int, str]]) -> dict[str, Any]:
        return {name: disk_of(system, part, skew, tolerance) for name, part in wanted.items()}

    single = {name: {k: name} for k, name in channels.items()}
    return LoopMargins(
        loops,
        {name: classical_margins(loop) for name, loop in loops.items()},
        every(returned, single),
        every(returned, groups),
        every(nominal, single | groups) if returned.elements else {},
        scalar.sample(MEMBERS) if scalar is not None and scalar.elements else [],
        float(skew),
    ).checked_by(LoopChecker())


def _with_dead_time(
    G: UncertainSystem, K: UncertainSystem, skew: float, tolerance: float
) -> LoopMargins:
    """The margins of a loop of one channel with known dead time; the rest as of `loop_margins`."""
    late = ", ".join(dead_times({**G.elements, **K.elements}))
    if G.noutputs != 1 or G.ninputs != 1:
        raise InputError(
            f"plant has {G.noutputs} outputs and {G.ninputs} inputs and the dead time {late}; "
            "exact margins are known of one channel: give `without_dead_time(plant)`, of which "
            "disks hold with the dead time itself"
        )
    L = G * K
    classical = classical_margins(L)
    if not classical.stable:
        raise InputError(
            f"the closed loop is unstable at the nominal with its dead time {late}; the loop is "
            "closed with negative feedback, u = -K y; `classical_margins` tells its crossings"
        )
    turn = float(delayed_loop(L).delay) * float(classical.phases[:, 1].max(initial=0.0))
    order = next((n for n in PADE_ORDERS if pade_corner(n) >= CORNER * turn), None)
    if order is None:
        raise InputError(
            f"the dead time {late} turns the loop by {turn:.4g} rad at its highest crossover, too "
            "far for the disks' Pade approximation; `classical_margins` of plant times controller "
            "takes it exactly"
        )
    rational = [without_dead_time(one, order=order) for one in (G, K)]
    found = loop_margins(*rational, skew=skew, tolerance=tolerance)
    if not all(disk.lower > 0.0 for disk in found.disks.values()):
        raise InputError(
            f"the loop with the dead time {late} keeps a size up to infinite frequency, where no "
            "Pade approximation follows it, so that no disk is proven; `classical_margins` of "
            "plant times controller takes it exactly"
        )
    exact = replace(
        found,
        loops=dict.fromkeys(found.loops, L),
        classical=dict.fromkeys(found.classical, classical),
        nominal={},
        members=[],
    )
    return exact.checked_by(LoopChecker())


def matched_loop(plant: Any, controller: Any) -> tuple[UncertainSystem, dict[int, str]]:
    """`returned_loop` of a plant and a controller, and the names of the channels to open it at.

    Raises InputError as `loop_margins`.
    """
    G, K = _matched(plant, controller)
    returned = returned_loop(G, K)
    need_stable_loop(returned.nominal)
    m, p = G.ninputs, G.noutputs
    if m == p == 1 and not K.nstates and not K.elements:  # L alone: one place to open it
        return returned, {m: "loop"}
    return returned, dict(enumerate(_names(m, p)))


def _matched(plant: Any, controller: Any) -> tuple[UncertainSystem, UncertainSystem]:
    """Plant and controller; a number stands for as many channels as the plant has."""
    G, K = uncertain(plant, "plant"), uncertain(controller, "controller")
    constant = not K.nstates and not K.elements
    if K.value.shape == (1, 1) and constant and G.ninputs == G.noutputs:
        K = K * np.eye(G.ninputs)
    need_matching(G, K)
    return G, K


def need_matching(plant: Any, controller: Any) -> None:
    """Raise InputError unless the controller has the plant's channels, the other way round."""
    if (controller.noutputs, controller.ninputs) != (plant.ninputs, plant.noutputs):
        raise InputError(
            f"plant has {plant.noutputs} outputs and {plant.ninputs} inputs, controller "
            f"{controller.noutputs} and {controller.ninputs}; they must fit each other"
        )


def returned_loop(G: UncertainSystem, K: UncertainSystem) -> UncertainSystem:
    """From what is added to (u, y) to (u, y) without it, the loop u = -K y closed."""
    m, p = G.ninputs, G.noutputs
    if singular(np.eye(p) + G.value.blocks[3] @ K.value.blocks[3]):
        raise not_well_posed("plant", G, "controller", K)
    # (u, y) before = append(-K, G) times (y, u) after.
    swap = np.block([[np.zeros((p, m)), np.eye(p)], [np.eye(m), np.zeros((m, p))]])
    closed = feedback(append(-K, G), swap, sign=1)
    return closed @ swap


def need_stable_loop(loop: StateSpace) -> None:
    """Raise InputError unless the nominal closed loop is stable."""
    worst, beyond = worst_pole(loop)
    if beyond >= 0:
        raise InputError(
            f"the closed loop is unstable at the nominal: it has a pole at {worst:.6g}; the loop "
            "is closed with negative feedback, u = -K y"
        )
    _need_clearly_stable(loop)


def _need_clearly_stable(loop: StateSpace) -> None:
    """Raise InputError where rounding of the entries of a stable loop may make it unstable."""
    poles = loop.poles()
    boundary = np.exp(1j * np.angle(poles)) if loop.dt else 1j * poles.imag
    for pole, point in zip(poles, boundary, strict=True):
        if pole_may_be_at(complex(point), loop.A):
            raise InputError(
                "the closed loop may be unstable at the nominal: rounding of its coefficients "
                f"moves its pole at {pole:.6g} to the boundary; give plant and controller as "
                "state-space systems, or sample more slowly"
            )


def _names(inputs: int, outputs: int) -> list[str]:
    return [
        *(f"input {k + 1}" if inputs > 1 else "input" for k in range(inputs)),
        *(f"output {k + 1}" if outputs > 1 else "output" for k in range(outputs)),
    ]


def opened_channel(returned: UncertainSystem, channel: int) -> StateSpace:
    """L of a channel, from S - 1: the other channels stay closed."""
    closed = returned[[channel], [channel]].nominal
    # v = (S - 1) q = -L (v + q), so L = -(S - 1) / S, by positive feedback of what is returned.
    opened = feedback(closed, 1.0, sign=-1)
    return (-1.0 * opened).nominal


def _range(low: float, high: float) -> str:
    return f"{low:.4g} to {high:.4g}"


def _disk_cells(one: DiskMargin) -> list[str]:
    return [
        f"{one.lower:.4g}",
        _range(*one.gain),
        f"{one.phase:.4g}",
        f"{one.omega / (2 * math.pi):.4g}",
    ]
