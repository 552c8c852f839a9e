"""Gain and phase margins that every plant of a set keeps, by branch and bound.

A disk margin lets gain and phase change together. Here the gain alone is a real factor, 1 + t or
1 / (1 + t), and the phase alone is a factor (1 + j t) / (1 - j t) with t = tan(phi / 2): one more
real parameter, beside those of the plant, which stay within their ranges.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.certify.stable_system import stable_system
from workbench.errors import InputError
from workbench.heavy_types import StateSpace
from workbench.input_checks import need_count, need_tolerance
from workbench.mu.boxes.margin import BoxMargin, LastGrowing, box_margin
from workbench.mu.boxes.recentred import RealParameters
from workbench.mu.frequency.channels import even_channels
from workbench.mu.margins.loop import matched_loop
from workbench.structure import Block, Complex, Full, Real, Structure
from workbench.systems.realisation import realisation
from workbench.uncertainty.algebra.system import UncertainSystem

LARGEST_CHANGE = 1e3
"""Largest t of a gain that is looked for."""
LARGEST_TURN = 1e3
"""Largest t of a phase; it stands for 179.9 degrees."""


@dataclass(frozen=True, eq=False)
class SetMargins:
    """Margins of one channel that every plant of a set keeps.

    The loops of all plants are stable for a gain between the ends of ``gain``, and for a phase up
    to ``phase`` [deg] of either sign. Some plant is not at a gain outside ``gain_lost`` and at the
    phase ``phase_lost`` (infinite, or 0 for a lower end, where none was found): ``plants`` has the
    parameters of the plants that are lost first, by "rise", "fall" and "phase".
    """

    gain: tuple[float, float]
    phase: float
    gain_lost: tuple[float, float]
    phase_lost: float
    plants: Mapping[str, Mapping[str, float]]

    def __repr__(self) -> str:
        (low, high), (lost_low, lost_high) = self.gain, self.gain_lost
        return (
            f"SetMargins: gain {low:.4g} to {high:.4g}, phase {self.phase:.4g} degrees for every "
            f"plant; lost at {lost_low:.4g} and {lost_high:.4g}, {self.phase_lost:.4g} degrees"
        )


def set_margins(
    plant: Any, controller: Any = 1.0, *, tolerance: float = 1e-2, parts: int = 4000
) -> dict[str, SetMargins]:
    """Gain and phase margins of each channel that every plant of an uncertain set keeps.

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
    """
    need_tolerance(tolerance)
    need_count("parts", parts)
    loop, channels = matched_loop(plant, controller)
    if not loop.elements or not any(isinstance(block, Real) for block in loop.structure):
        raise InputError("the plant has no uncertain real parameter; `loop_margins` serves it")

    def bounded(whole: StateSpace, structure: Structure, largest: float) -> BoxMargin:
        stable = stable_system(even_channels(whole, structure)[0])
        given = RealParameters(stable, structure)
        return box_margin(given, LastGrowing(len(given.places)), tolerance, parts, largest)

    found = {}
    for k, name in channels.items():
        rise = bounded(*_with_rise(loop, k), LARGEST_CHANGE)
        fall = bounded(*_with_fall(loop, k), LARGEST_CHANGE)
        turn = bounded(*_with_phase(loop, k), LARGEST_TURN)
        kinds = {"rise": rise, "fall": fall, "phase": turn}
        found[name] = SetMargins(
            (1.0 / (1.0 + fall.lower), 1.0 + rise.lower),
            math.degrees(2 * math.atan(turn.lower)),
            (1.0 / (1.0 + fall.upper), 1.0 + rise.upper),
            math.degrees(2 * math.atan(turn.upper)) if turn.values is not None else math.inf,
            {kind: _plant(loop, one) for kind, one in kinds.items() if one.values is not None},
        )
    return found


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
    """The factor (1 + j t) / (1 - j t) in a channel, in real coordinates.

    Each signal is two, its real and its imaginary part, and j is a matrix J. What is added is
    2 w with w = t J (v + w).
    """
    one = _channel(loop, channel)
    A, B, C, D = (np.kron(part, np.eye(2)) for part in (one.A, one.B, one.C, one.D))
    J = np.array([[0.0, -1.0], [1.0, 0.0]])
    B[:, -2:] *= 2.0
    D[:, -2:] *= 2.0
    C[-2:], D[-2:] = J @ C[-2:], J @ D[-2:]
    D[-2:, -2:] += J
    structure = Structure((*(_doubled(block) for block in loop.structure), Real(2, "t")))
    return realisation((A, B, C, D), one.dt), structure


def _doubled(block: Block) -> Block:
    """A block of signals of two parts each."""
    if isinstance(block, Full):
        return Full(2 * block.outputs, 2 * block.inputs, block.name)
    if isinstance(block, Real):
        return Real(2 * block.n, block.name)
    assert isinstance(block, Complex)
    return Complex(2 * block.n, block.name)


def _plant(loop: UncertainSystem, margin: BoxMargin) -> dict[str, float]:
    """The plant's parameters in a perturbation, by name."""
    assert margin.values is not None
    real = [
        one
        for one, block in zip(loop.elements.values(), loop.structure, strict=True)
        if isinstance(block, Real)
    ]
    return {one.name: float(one.value(v)) for one, v in zip(real, margin.values, strict=False)}
