"""Controllers with one family for each nonzero entry of the transfer matrix."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.linalg import block_diag

from workbench._core.arrays import BoolArray, ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.synthesis.families.family import Family
from workbench.systems.hidden_states import seen_states
from workbench.systems.realisation import realisation

MOST_EXAMPLES = 64
"""Largest number of combinations of the entries' examples."""

EntryPlace = tuple[int, int]
"""Indices of output i and input j of the controller."""


class EntryFamilies(Family):
    """Controllers whose entries K_ij are members of families, or zero.

    Parameters and states are those of the entries, one after the other, row by row.
    """

    @property
    @abstractmethod
    def shape(self) -> EntryPlace:
        """Numbers of outputs and inputs."""

    @property
    @abstractmethod
    def entries(self) -> Mapping[EntryPlace, Family]:
        """The families of the entries that are not zero, row by row."""

    @abstractmethod
    def place_name(self, place: EntryPlace) -> str:
        """Name of an entry in messages."""

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of parameters of each entry; raises InputError if a family does not say how many
        it has.
        """
        counts = [each.count for each in self.entries.values()]
        if None in counts:
            name = self.place_name(list(self.entries)[counts.index(None)])
            raise InputError(f"{name} does not tell how many parameters it has")
        return tuple(each for each in counts if each is not None)

    @property
    def count(self) -> int:
        return sum(self.counts)

    @abstractmethod
    def with_entries(self, families: Sequence[Family]) -> EntryFamilies:
        """The same nonzero entries with other families, row by row."""

    def system(self, x: RealArray) -> StateSpace:
        parts = zip(self.entries.values(), self._split(x), strict=True)
        return self._joined([family.system(part) for family, part in parts])

    def response(self, x: RealArray, omega: RealArray) -> tuple[ComplexArray, ComplexArray]:
        K = np.zeros((len(omega), *self.shape), complex)
        slopes = np.zeros((len(omega), len(x), *self.shape), complex)
        at = 0
        for ((i, j), family), part in zip(self.entries.items(), self._split(x), strict=True):
            K[:, i : i + 1, j : j + 1], own = family.response(part, omega)
            slopes[:, at : at + len(part), i : i + 1, j : j + 1] = own
            at += len(part)
        return K, slopes

    def about(self, controller: StateSpace) -> tuple[EntryFamilies, RealArray]:
        families, parts = zip(
            *(family.about(part) for family, part in self._entries_of(controller)), strict=True
        )
        return self.with_entries(families), np.concatenate(parts)

    def parameters(self, controller: StateSpace) -> RealArray:
        return np.concatenate(
            [family.parameters(part) for family, part in self._entries_of(controller)]
        )

    def units(self, x: RealArray) -> RealArray:
        parts = zip(self.entries.values(), self._split(x), strict=True)
        return np.concatenate([family.units(part) for family, part in parts])

    def halfspaces(self, stable: bool, fastest: float | None) -> tuple[RealArray, RealArray]:
        rows, sides = zip(
            *(each.halfspaces(stable, fastest) for each in self.entries.values()), strict=True
        )
        return block_diag(*rows), np.concatenate(sides)

    def examples(self, omega: float, gain: float) -> Sequence[StateSpace]:
        """All combinations of the entries' examples, or some of them where there are too many."""
        each = [family.examples(omega, gain) for family in self.entries.values()]
        combinations = np.ndindex(*(len(one) for one in each))
        return [
            self._joined([one[k] for one, k in zip(each, places, strict=True)])
            for _, places in zip(range(MOST_EXAMPLES), combinations, strict=False)
        ]

    def nearest(
        self, controller: StateSpace, omega: RealArray, weight: RealArray
    ) -> StateSpace | None:
        """The controller whose entries are each the nearest to the given controller's."""
        parts = []
        for (i, j), family in self.entries.items():
            part = family.nearest(_entry(controller, i, j), omega, weight)
            if part is None:
                return None
            parts.append(part)
        return self._joined(parts)

    def settings(self, controller: StateSpace) -> Mapping[str, float]:
        return {
            f"{self.place_name(place)} {name}": value
            for place, (family, part) in zip(
                self.entries, self._entries_of(controller), strict=True
            )
            for name, value in family.settings(part).items()
        }

    def _split(self, x: RealArray) -> list[RealArray]:
        """Split the parameters x into those of each entry."""
        return np.split(x, np.cumsum(self.counts)[:-1])

    def _joined(self, parts: Sequence[StateSpace]) -> StateSpace:
        """The controller composed of the systems of its entries."""
        outputs, inputs = self.shape
        n = sum(part.nstates for part in parts)
        A, B, C = np.zeros((n, n)), np.zeros((n, inputs)), np.zeros((outputs, n))
        D, at = np.zeros((outputs, inputs)), 0
        for (i, j), part in zip(self.entries, parts, strict=True):
            own = slice(at, at + part.nstates)
            A[own, own], B[own, j], C[i, own] = part.A, part.B[:, 0], part.C[0]
            D[i, j] = part.D[0, 0]
            at = own.stop
        return realisation((A, B, C, D), 0.0)

    def _entries_of(self, K: StateSpace) -> Iterator[tuple[Family, StateSpace]]:
        """The families, each with its entry of K. Raises InputError if K has another nonzero
        entry.
        """
        import control

        outputs, inputs = self.shape
        if (K.noutputs, K.ninputs) != self.shape:
            raise InputError(
                f"the controller has {K.ninputs} inputs and {K.noutputs} outputs; a member of "
                f"{self} has {inputs} and {outputs}"
            )
        for i, j in np.ndindex(outputs, inputs):
            if (i, j) in self.entries or not (_on_path(K, i, j).any() or K.D[i, j]):
                continue
            off = control.minreal(_entry(K, i, j), verbose=False)
            if off.nstates or np.abs(off.D).max() > 0:
                raise InputError(
                    f"output {i} of the controller answers input {j}: {self._says_zero}"
                )
        return (
            (family, _without_foreign_states(K, i, j)) for (i, j), family in self.entries.items()
        )

    @property
    def _says_zero(self) -> str:
        """The words for an entry that must be zero."""
        return f"{self} is zero there"


def _entry(K: StateSpace, i: int, j: int) -> StateSpace:
    """One entry of K with all states of K."""
    return realisation((K.A, K.B[:, [j]], K.C[[i]], K.D[[i]][:, [j]]), 0.0)


def _on_path(K: StateSpace, i: int, j: int) -> BoolArray:
    """Mask of the states on a path from input j to output i, by the zeros of the matrices."""
    M = np.block([[K.A, K.B[:, [j]]], [K.C[[i]], K.D[[i]][:, [j]]]])
    return seen_states(M, K.nstates)


def _without_foreign_states(K: StateSpace, i: int, j: int) -> StateSpace:
    """One entry of K without the states that belong to other entries."""
    import control

    # States hidden by a gain of zero are kept, since they belong to no other entry.
    foreign = np.zeros(K.nstates, bool)
    for other in set(range(K.ninputs)) - {j}:
        foreign |= _reachable(K.A, K.B[:, [other]])
    for other in set(range(K.noutputs)) - {i}:
        foreign |= _reachable(K.A.T, K.C[[other]].T)
    if (_on_path(K, i, j) & foreign).any():
        return control.minreal(_entry(K, i, j), verbose=False)
    own = ~foreign
    return realisation(
        (K.A[np.ix_(own, own)], K.B[own][:, [j]], K.C[[i]][:, own], K.D[[i]][:, [j]]), 0.0
    )


def _reachable(A: RealArray, B: RealArray) -> BoolArray:
    """Mask of the states that an input reaches, by the zeros of the matrices."""
    n = len(A)
    return seen_states(np.block([[A, B], [np.ones((1, n)), np.zeros((1, 1))]]), n)
