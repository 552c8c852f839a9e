"""Uncertainty structures: which Delta = diag(blocks) closes the perturbation loop of a plant.

A block drives `rows` perturbation inputs of the plant and reads `columns` of its perturbation
outputs, so that an M which maps Delta's outputs to Delta's inputs has shape (columns, rows).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import Array
from workbench._core.on_demand import no_more_names
from workbench.errors import InputError

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)


class Block(ABC):
    """One block of Delta.

    Examples
    --------
    >>> from workbench.structure import Block, Real, Structure
    >>> [isinstance(block, Block) for block in Structure([Real(2)])]
    [True]
    """

    name: str

    @property
    @abstractmethod
    def rows(self) -> int:
        """Number of perturbation inputs of the plant that it drives."""

    @property
    @abstractmethod
    def columns(self) -> int:
        """Number of perturbation outputs of the plant that it reads."""

    @property
    @abstractmethod
    def pair(self) -> tuple[int, int]:
        """Its row in the two-column integer form that other tools use."""

    @abstractmethod
    def nearest(self, matrix: Array) -> Array:
        """The block of this kind nearest to `matrix` (rows, columns) in the Frobenius norm."""

    @abstractmethod
    def random(self, rng: np.random.Generator) -> Array:
        """A random block (rows, columns) with norm at most 1."""


@dataclass(frozen=True)
class _Repeated(Block):
    """A scalar times the identity: delta I_n."""

    n: int
    _: KW_ONLY
    name: str = ""

    def __post_init__(self) -> None:
        _check_size(type(self).__name__, n=self.n)

    @property
    def rows(self) -> int:
        return self.n

    @property
    def columns(self) -> int:
        return self.n


@dataclass(frozen=True)
class Real(_Repeated):
    """A real scalar, repeated n times.

    Examples
    --------
    >>> from workbench.structure import Real
    >>> stiffness = Real(2, name="stiffness")
    >>> stiffness.rows, stiffness.columns, stiffness.name
    (2, 2, 'stiffness')
    """

    @property
    def pair(self) -> tuple[int, int]:
        return -self.n, 0

    def nearest(self, matrix: Array) -> Array:
        return np.trace(matrix).real / self.n * np.eye(self.n)

    def random(self, rng: np.random.Generator) -> Array:
        return rng.uniform(-1.0, 1.0) * np.eye(self.n)


@dataclass(frozen=True)
class Complex(_Repeated):
    """A complex scalar, repeated n times.

    Examples
    --------
    >>> from workbench.structure import Complex
    >>> actuator = Complex(1, name="actuator")
    >>> actuator.rows, actuator.columns
    (1, 1)
    """

    @property
    def pair(self) -> tuple[int, int]:
        return self.n, 0

    def nearest(self, matrix: Array) -> Array:
        return np.trace(matrix) / self.n * np.eye(self.n)

    def random(self, rng: np.random.Generator) -> Array:
        radius, angle = np.sqrt(rng.uniform()), rng.uniform(0.0, 2.0 * np.pi)
        return radius * np.exp(1j * angle) * np.eye(self.n)


@dataclass(frozen=True)
class Full(Block):
    """A full complex block, not necessarily square.

    `outputs` and `inputs` are those of the block: it drives `outputs` signals and reads `inputs`
    signals.

    Examples
    --------
    >>> from workbench.structure import Full
    >>> performance = Full(2, 3, name="performance")
    >>> performance.rows, performance.columns
    (2, 3)
    """

    outputs: int
    inputs: int
    _: KW_ONLY
    name: str = ""

    def __post_init__(self) -> None:
        _check_size("Full", outputs=self.outputs, inputs=self.inputs)

    @property
    def rows(self) -> int:
        return self.outputs

    @property
    def columns(self) -> int:
        return self.inputs

    @property
    def pair(self) -> tuple[int, int]:
        return self.outputs, self.inputs

    def nearest(self, matrix: Array) -> Array:
        return matrix

    def random(self, rng: np.random.Generator) -> Array:
        real, imag = rng.standard_normal((2, self.outputs, self.inputs))
        matrix = real + 1j * imag
        return rng.uniform() * matrix / np.linalg.norm(matrix, 2)


@dataclass(frozen=True)
class Structure:
    """Delta = diag(blocks) with the blocks in any order; raises InputError if there are no blocks.

    Examples
    --------
    >>> from workbench.structure import Complex, Full, Real, Structure
    >>> structure = Structure([Real(2, name="mass"), Complex(1), Full(2, 3)])
    >>> structure.rows, structure.columns
    (5, 6)
    """

    blocks: tuple[Block, ...]

    def __init__(self, blocks: Iterable[Block]) -> None:
        try:
            object.__setattr__(self, "blocks", tuple(blocks))
        except InputError:  # An iterator may raise an error of its own.
            raise
        except Exception:  # Some objects look like sequences but cannot be iterated.
            raise InputError(f"a list of blocks is needed, not {blocks!r}") from None
        if not self.blocks:
            raise InputError("the structure has no blocks; give at least one")
        for block in self.blocks:
            if not isinstance(block, Block):
                raise InputError(
                    f"{block!r} is no block; use Real(n), Complex(n) or Full(outputs, inputs), "
                    "or Structure.from_pairs for rows of two integers"
                )

    @classmethod
    def from_pairs(cls, pairs: Iterable[Sequence[int]]) -> Structure:
        """A structure from the two-column integer form that other tools use.

        [-n 0] is a real scalar repeated n times, [n 0] a complex one, [r c] a full r-by-c block;
        [-1 1] is accepted as a real scalar. [1 1] is a full 1-by-1 block, which is the same set
        as a complex scalar. Raises InputError for anything else.
        """
        if not isinstance(pairs, Iterable):
            raise InputError(f"a list of rows of two integers is needed, not {pairs!r}")
        return cls(_from_pair(pair) for pair in pairs)

    def to_pairs(self) -> list[tuple[int, int]]:
        """The two-column integer form; names of blocks are lost."""
        return [block.pair for block in self.blocks]

    def __iter__(self) -> Iterator[Block]:
        return iter(self.blocks)

    def __len__(self) -> int:
        return len(self.blocks)

    @property
    def rows(self) -> int:
        """Number of perturbation inputs of the plant, all blocks together."""
        return sum(block.rows for block in self.blocks)

    @property
    def columns(self) -> int:
        """Number of perturbation outputs of the plant, all blocks together."""
        return sum(block.columns for block in self.blocks)

    @property
    def unstructured(self) -> bool:
        """Whether mu is the largest singular value: Delta is one full block or complex number."""
        block = next(iter(self))
        number = isinstance(block, Complex) and block.rows == 1
        return len(self) == 1 and (isinstance(block, Full) or number)

    @cached_property
    def row_slices(self) -> tuple[slice, ...]:
        """Rows of Delta (columns of M) that belong to each block."""
        return _slices([block.rows for block in self.blocks])

    @cached_property
    def column_slices(self) -> tuple[slice, ...]:
        """Columns of Delta (rows of M) that belong to each block."""
        return _slices([block.columns for block in self.blocks])

    def check(self, M: ArrayLike) -> None:
        """Raise InputError unless M has the shape (..., columns, rows) that Delta can close."""
        shape = np.shape(M)
        if shape[-2:] != (self.columns, self.rows):
            raise InputError(
                f"M has shape {shape}, but the structure {self.to_pairs()} needs "
                f"(..., {self.columns}, {self.rows}): M maps the {self.rows} outputs of Delta "
                f"to its {self.columns} inputs"
            )

    def diagonal(self, parts: Iterable[ArrayLike]) -> Array:
        """Delta (rows, columns) from its blocks."""
        arrays = [np.asarray(part) for part in parts]
        delta = np.zeros((self.rows, self.columns), np.result_type(*arrays, float))
        for row, column, array in zip(self.row_slices, self.column_slices, arrays, strict=True):
            delta[row, column] = array
        return delta

    def contains(self, delta: ArrayLike, *, rounding: float = 1e-12) -> bool:
        """Whether `delta` (rows, columns) has this structure.

        No entry may deviate by more than `rounding` times the largest entry. The size of delta is
        not checked. Raises InputError if the shape does not fit.
        """
        array = np.asarray(delta)
        if array.shape != (self.rows, self.columns):
            raise InputError(
                f"delta has shape {array.shape}; the structure {self.to_pairs()} needs "
                f"({self.rows}, {self.columns})"
            )
        places = zip(self.blocks, self.row_slices, self.column_slices, strict=True)
        nearest = self.diagonal(b.nearest(array[row, column]) for b, row, column in places)
        return bool((abs(array - nearest) <= rounding * abs(array).max()).all())

    def random(self, rng: np.random.Generator) -> Array:
        """A random Delta (rows, columns) with largest singular value 1."""
        parts = [block.random(rng) for block in self.blocks]
        return self.diagonal(parts) / max(np.linalg.norm(part, 2) for part in parts)

    def complexified(self) -> Structure:
        """The same structure with complex scalars in place of real ones."""
        return Structure(
            Complex(b.n, name=b.name) if isinstance(b, Real) else b for b in self.blocks
        )

    def with_performance(self, performance: int, exogenous: int) -> Structure:
        """This structure extended by the full performance block of the main loop theorem.

        The block, named "performance", reads the plant's `performance` outputs and drives its
        `exogenous` inputs.
        """
        return Structure((*self.blocks, Full(exogenous, performance, name="performance")))


def _check_size(kind: str, **sizes: object) -> None:
    for name, size in sizes.items():
        # To Python a bool is an integer, but it makes no sense as a size.
        if isinstance(size, bool) or not isinstance(size, Integral) or size < 1:
            raise InputError(f"{kind} has {name} = {size!r}; it must be an integer of at least 1")


def _from_pair(pair: Sequence[int]) -> Block:
    values = tuple(pair) if np.ndim(pair) == 1 else ()
    if len(values) == 2 and all(isinstance(value, Integral) for value in values):
        first, second = (int(value) for value in values)
        if first < 0 and (second == 0 or (first, second) == (-1, 1)):
            return Real(-first)
        if first > 0 and second == 0:
            return Complex(first)
        if first > 0 and second > 0:
            return Full(first, second)
    raise InputError(
        f"{pair!r} is no row of a structure; write [-n, 0] for a repeated real scalar, [n, 0] for "
        "a repeated complex scalar, [r, c] for a full block of r rows and c columns"
    )


def _slices(sizes: Sequence[int]) -> tuple[slice, ...]:
    return tuple(slice(*ends) for ends in pairwise(accumulate(sizes, initial=0)))
