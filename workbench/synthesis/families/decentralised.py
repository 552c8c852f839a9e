"""A controller with one input and one output for each channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from workbench.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.heavy_types import StateSpace
from workbench.synthesis.families.family import Family, need_family, need_size
from workbench.systems.hidden_states import seen_states
from workbench.systems.realisation import realisation

MOST_EXAMPLES = 64
"""Most combinations of the channels' examples."""


@dataclass(frozen=True, init=False)
class Decentralised(Family):
    """A diagonal K: a controller with one input and one output for each channel.

    Examples
    --------
    >>> from workbench.synthesis import PI, PID, Decentralised
    >>> Decentralised(PID(), PI()).counts
    (4, 2)
    >>> family, x = Decentralised.of([PID.of(2.0, 1.0, 0.1, 0.01)] * 2)
    >>> family.counts, family.system(x).ninputs
    ((4, 4), 2)
    """

    channels: tuple[Family, ...]

    def __init__(self, *channels: Family) -> None:
        if not channels:
            raise InputError("no channels: Decentralised(PID(), PI()) has two")
        for number, each in enumerate(channels, start=1):
            need_family(each, f"channel {number}")
        sized = tuple(each.sized(1, 1) for each in channels)
        object.__setattr__(self, "channels", sized)

    def __repr__(self) -> str:
        return f"Decentralised({', '.join(map(repr, self.channels))})"

    @classmethod
    def of(cls, members: Sequence[tuple[Family, RealArray]]) -> tuple[Decentralised, RealArray]:
        """The family and its parameters from families and parameters as their `of` gives them."""
        families, parts = zip(*members, strict=True)
        return cls(*families), np.concatenate(parts)

    @property
    def counts(self) -> tuple[int, ...]:
        """Numbers of parameters of the channels; raises InputError where one does not tell."""
        counts = [each.count for each in self.channels]
        if None in counts:
            raise InputError(f"channel {counts.index(None) + 1} does not tell how many parameters")
        return tuple(each for each in counts if each is not None)

    @property
    def count(self) -> int:
        return sum(self.counts)

    def sized(self, inputs: int, outputs: int) -> Decentralised:
        n = len(self.channels)
        need_size(self, (n, n), inputs, outputs, "there must be one channel for each of both")
        return self

    def _split(self, x: RealArray) -> list[RealArray]:
        """The parameters of each channel."""
        return np.split(x, np.cumsum(self.counts)[:-1])

    def _joined(self, parts: Sequence[StateSpace]) -> StateSpace:
        import control

        return control.append(*parts)

    def system(self, x: RealArray) -> StateSpace:
        parts = zip(self.channels, self._split(x), strict=True)
        return self._joined([family.system(part) for family, part in parts])

    def response(self, x: RealArray, omega: RealArray) -> tuple[ComplexArray, ComplexArray]:
        n = len(self.channels)
        K = np.zeros((len(omega), n, n), complex)
        slopes = np.zeros((len(omega), len(x), n, n), complex)
        at = 0
        for i, (family, part) in enumerate(zip(self.channels, self._split(x), strict=True)):
            K[:, i : i + 1, i : i + 1], own = family.response(part, omega)
            slopes[:, at : at + len(part), i : i + 1, i : i + 1] = own
            at += len(part)
        return K, slopes

    def about(self, controller: StateSpace) -> tuple[Decentralised, RealArray]:
        pairs = [family.about(part) for family, part in self._channels_of(controller)]
        return Decentralised.of(pairs)

    def parameters(self, controller: StateSpace) -> RealArray:
        return np.concatenate(
            [family.parameters(part) for family, part in self._channels_of(controller)]
        )

    def units(self, x: RealArray) -> RealArray:
        parts = zip(self.channels, self._split(x), strict=True)
        return np.concatenate([family.units(part) for family, part in parts])

    def halfspaces(self, stable: bool, fastest: float | None) -> tuple[RealArray, RealArray]:
        rows, sides = zip(
            *(each.halfspaces(stable, fastest) for each in self.channels), strict=True
        )
        return block_diag(*rows), np.concatenate(sides)

    def examples(self, omega: float, gain: float) -> Sequence[StateSpace]:
        """The channels' examples, in all combinations where these are few."""
        each = [family.examples(omega, gain) for family in self.channels]
        combinations = np.ndindex(*(len(one) for one in each))
        return [
            self._joined([one[k] for one, k in zip(each, places, strict=True)])
            for _, places in zip(range(MOST_EXAMPLES), combinations, strict=False)
        ]

    def nearest(
        self, controller: StateSpace, omega: RealArray, weight: RealArray
    ) -> StateSpace | None:
        """Each channel by itself, the nearest to the diagonal of controller."""
        parts = []
        for i, family in enumerate(self.channels):
            part = family.nearest(_diagonal(controller, i), omega, weight)
            if part is None:
                return None
            parts.append(part)
        return self._joined(parts)

    def settings(self, controller: StateSpace) -> Mapping[str, float]:
        return {
            f"channel {number} {name}": value
            for number, (family, part) in enumerate(self._channels_of(controller), start=1)
            for name, value in family.settings(part).items()
        }

    def _channels_of(self, K: StateSpace) -> list[tuple[Family, StateSpace]]:
        """The families with the diagonal elements of K; InputError for a coupled K."""
        import control

        n = len(self.channels)
        if (K.noutputs, K.ninputs) != (n, n):
            raise InputError(
                f"the controller has {K.ninputs} inputs and {K.noutputs} outputs; it must have {n}"
            )
        for i, j in np.ndindex(n, n):
            if i == j or not _element(K, i, j).nstates + np.abs(K.D[i, j]):
                continue
            off = control.minreal(K[i, j], verbose=False)
            if off.nstates or np.abs(off.D).max() > 0:
                raise InputError(
                    f"output {i} of the controller answers input {j}: it is not diagonal"
                )
        return [(family, _own_states(K, i)) for i, family in enumerate(self.channels)]


def _diagonal(K: StateSpace, i: int) -> StateSpace:
    """One diagonal element of K with every state."""
    return realisation((K.A, K.B[:, [i]], K.C[[i]], K.D[[i]][:, [i]]), 0.0)


def _element(K: StateSpace, i: int, j: int) -> StateSpace:
    """One element of K with the states that lie between, by the zeros of the matrices."""
    M = np.block([[K.A, K.B[:, [j]]], [K.C[[i]], K.D[[i]][:, [j]]]])
    seen = seen_states(M, K.nstates)
    A = K.A[np.ix_(seen, seen)]
    return realisation((A, K.B[seen][:, [j]], K.C[[i]][:, seen], K.D[[i]][:, [j]]), 0.0)


def _own_states(K: StateSpace, i: int) -> StateSpace:
    """One diagonal element of K without the states of the others."""
    import control

    others = [j for j in range(K.ninputs) if j != i]
    alone = all(not _element(K, i, j).nstates and not _element(K, j, i).nstates for j in others)
    if not alone:
        return control.minreal(K[i, i], verbose=False)
    # Keep states with zero gain of one side, which belong to no other channel.
    foreign = np.zeros(K.nstates, bool)
    for j in others:
        foreign |= _touched(K, j)
    own = ~foreign
    return realisation(
        (K.A[np.ix_(own, own)], K.B[own][:, [i]], K.C[[i]][:, own], K.D[[i]][:, [i]]), 0.0
    )


def _touched(K: StateSpace, j: int) -> Any:
    """States that input j reaches or that reach output j, by the zeros of the matrices."""
    n = K.nstates
    ones = np.ones((n, 1))
    into = seen_states(np.block([[K.A, K.B[:, [j]]], [ones.T, np.zeros((1, 1))]]), n)
    out = seen_states(np.block([[K.A, ones], [K.C[[j]], np.zeros((1, 1))]]), n)
    return into | out
