"""Gain, phase and delay of one channel of a loop as one more real parameter t, the last one.

The gain alone is a factor 1 + t or 1 / (1 + t), and the phase alone is (1 + j t) / (1 - j t) with
t = tan(phi / 2). A delay is a phase that grows with frequency (`workbench.mu.margins.set_delay`).
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.structure import Block, Complex, Full, Real, Structure
from workbench.systems.realisation import realisation
from workbench.uncertainty.algebra.system import UncertainSystem


def _channel(loop: UncertainSystem, channel: int) -> StateSpace:
    """The perturbations' channels, and the loop channel in which the added signal returns."""
    whole, structure = loop.system, loop.structure
    out = [*range(structure.columns), structure.columns + channel]
    into = [*range(structure.rows), structure.rows + channel]
    parts = (whole.A, whole.B[:, into], whole.C[out], whole.D[np.ix_(out, into)])
    return realisation(parts, whole.dt)


def with_rise(loop: UncertainSystem, channel: int) -> tuple[StateSpace, Structure]:
    """Factor 1 + t in a channel: t times the signal is added to it."""
    return _channel(loop, channel), Structure((*loop.structure, Real(1, name="t")))


def with_fall(loop: UncertainSystem, channel: int) -> tuple[StateSpace, Structure]:
    """Factor 1 / (1 + t) in a channel: t times the outgoing signal is subtracted."""
    one = _channel(loop, channel)
    B, D = one.B.copy(), one.D.copy()
    B[:, -1] *= -1.0
    D[:, -1] *= -1.0
    D[-1, -1] -= 1.0
    return realisation((one.A, B, one.C, D), one.dt), Structure(
        (*loop.structure, Real(1, name="t"))
    )


def with_phase(loop: UncertainSystem, channel: int) -> tuple[StateSpace, Structure]:
    """Factor (1 + j t) / (1 - j t) in a channel: 2 w is added, with w = j t (v + w)."""
    return _in_series(loop, channel, np.eye(1))


def with_delay(loop: UncertainSystem, channel: int) -> tuple[StateSpace, Structure]:
    """The factor of `with_phase` twice in series: the second one turns the output of the first."""
    return _in_series(loop, channel, np.array([[1.0, 0.0], [2.0, 1.0]]))


def _in_series(
    loop: UncertainSystem, channel: int, series: RealArray
) -> tuple[StateSpace, Structure]:
    """Factors in series; factor i sees the signal v + sum_k series[i, k] w_k.

    Each signal has two components, its real and its imaginary part, and j is a matrix J. The sum 2
    sum w_k is added in the channel, with w_i = t J (v + ...).
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
    structure = Structure((*(_doubled(block) for block in loop.structure), Real(2 * n, name="t")))
    return realisation((A, B, C, D), one.dt), structure


def _doubled(block: Block) -> Block:
    """A block of the same kind for signals with two components each."""
    if isinstance(block, Full):
        return Full(2 * block.outputs, 2 * block.inputs, name=block.name)
    if isinstance(block, Real):
        return Real(2 * block.n, name=block.name)
    assert isinstance(block, Complex)
    return Complex(2 * block.n, name=block.name)
