"""Realisations as given, and enclosed: in continuous time, and in other coordinates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.certify.modes.bilinear import bilinear_enclosures
from workbench.certify.modes.modal_form import (
    PRECISIONS,
    Enclosures,
    form_in_basis,
    real_balls,
    real_doubles,
)
from workbench.certify.rounding import Enclosure, exact
from workbench.errors import InputError
from workbench.systems.balancing import balancing
from workbench.systems.frequency_response import driven_states

LARGEST_BLUR = 1e-8
"""Largest error of an entry of modal coordinates, relative to the largest entry of its matrix. With
larger errors, such as those of a cluster of many poles in a Laguerre filter, modal coordinates only
prove where the poles are. It is half of the digits of a double. Half or double decides otherwise
only for errors next to it; either realisation is proven.
"""
LARGEST_OPEN = 1e-3
"""Largest uncertainty of a response in modal coordinates, as a share of it, where the given
realisation is more accurate. A bound 0.1 % above a peak cannot be proven with more. Half or double
changes which of two proven realisations is used.
"""
FEWEST_DOUBLES = 20
"""Least number of states for which a sampled realisation is transformed in doubles; for fewer,
balls take no time. Half or double changes the time only.
"""

Realised = tuple[RealArray, RealArray, RealArray, RealArray]
"""A, B, C and D."""
Coordinates = Callable[[RealArray, RealArray, RealArray], RealArray | None]
"""Proposes other states for A, B and C in continuous time, as columns (n, n); None: no proposal."""


@dataclass(frozen=True, eq=False)
class GivenRealisation:
    """Matrices of doubles as they were given, with gains that are multiplied without rounding.

    Unlike a `StateSpace`, it keeps gains as factors, so that exact arithmetic starts from the
    given numbers.

    A system with ``period`` [s] is sampled; with 0 it is continuous. Whichever realisation doubles
    work with, the proofs to many digits start from this one.
    """

    A: RealArray
    B: RealArray
    C: RealArray
    D: RealArray
    period: float
    output_gains: tuple[RealArray, ...] = ()
    """Each (outputs,); their product multiplies the outputs."""
    input_gains: tuple[RealArray, ...] = ()
    """Each (inputs,)."""
    _shifted: dict[int, tuple[Any, Any]] = field(default_factory=dict)
    """(A + 1)^-1 and its product with A - 1, by the number of bits of their balls."""

    def __getstate__(self) -> dict[str, Any]:
        """State for another process: the balls are left out, since they are made there again."""
        return vars(self) | {"_shifted": {}}

    def channels(
        self, outputs: Any, inputs: Any, rows: RealArray, columns: RealArray
    ) -> GivenRealisation:
        """The system with chosen outputs and inputs, by index, each times a gain."""
        return replace(
            self,
            B=self.B[:, inputs],
            C=self.C[outputs],
            D=self.D[outputs][:, inputs],
            output_gains=(*(gains[outputs] for gains in self.output_gains), rows),
            input_gains=(*(gains[inputs] for gains in self.input_gains), columns),
        )

    def in_balls(self, bits: int) -> tuple[Any, Any, Any, Any]:
        """A, B, C and D; for a sampled system those in s = 2 / T (z - 1) / (z + 1).

        Raises ZeroDivisionError if a pole cannot be told from z = -1.
        """
        import flint

        with flint.ctx.workprec(bits):
            A, B, C, D = map(real_balls, (self.A, self.B, self.C, self.D))
            if self.period and len(self.A):
                if bits not in self._shifted:
                    one = real_balls(np.eye(len(self.A)))
                    back = (A + one).inv()
                    self._shifted[bits] = back, back * (A - one)
                back, A = self._shifted[bits]
                rate = flint.arb(2) / flint.arb(self.period)
                across = back * B
                A, B, C, D = A * rate, across * (2 * rate), C * back, D - C * across
            out, into = self.gains_in_balls()
            return A, B * into, out * C, out * D * into

    def vanishes(self) -> bool:
        """Whether the response is zero, exactly: D and all C A^k B are (Cayley and Hamilton)."""
        import flint

        rows, columns = (
            np.all([gains != 0.0 for gains in each], axis=0) if each else slice(None)
            for each in (self.output_gains, self.input_gains)
        )
        if self.D[rows][:, columns].any():
            return False
        A, driven, C = map(_as_integers, (self.A, self.B[:, columns], self.C[rows]))
        for _ in range(len(self.A)):
            if C * driven != flint.fmpz_mat(C.nrows(), driven.ncols()):
                return False
            driven = A * driven
        return True

    def gains_in_balls(self) -> tuple[Any, Any]:
        """Diagonal matrices of the gains of the outputs and of the inputs."""
        out, into = real_balls(np.eye(len(self.C))), real_balls(np.eye(self.B.shape[1]))
        for gains in self.output_gains:
            out = out * real_balls(np.diag(gains))
        for gains in self.input_gains:
            into = into * real_balls(np.diag(gains))
        return out, into


def _as_integers(matrix: RealArray) -> Any:
    """A multiple of a matrix of doubles, by a power of two, whose entries are integers."""
    import flint

    ratios = [float(entry).as_integer_ratio() for entry in np.ravel(matrix)]
    whole = max((below for _, below in ratios), default=1)  # all are powers of two
    rows, columns = matrix.shape
    return flint.fmpz_mat(rows, columns, [above * (whole // below) for above, below in ratios])


def in_coordinates(given: GivenRealisation, coordinates: Coordinates) -> Enclosures | None:
    """A, B and C in the proposed coordinates; None if there is no proposal, or if they blur too
    much.
    """
    parts: Sequence[Any] = (given.A, given.B, given.C)
    near = parts
    if given.period:
        try:
            parts = given.in_balls(PRECISIONS[0])[:3]
        except ZeroDivisionError:
            return None
        near = [real_doubles(part).mid for part in parts]
    basis = coordinates(*near)
    if basis is None:
        return None
    found = scaled_states(form_in_basis(parts, basis, PRECISIONS[0]))
    return found if found and is_sharp(found) else None


def in_continuous_time(given: GivenRealisation) -> tuple[Enclosures, Enclosure]:
    """A, B, C and D in continuous time, in doubles; the given gains are left out."""
    parts = given.A, given.B, given.C, given.D
    if not given.period:
        A, B, C, D = map(exact, parts)
        return (A, B, C), D
    try:
        many = len(given.A) >= FEWEST_DOUBLES
        found = bilinear_enclosures(parts, given.period) if many else None
        A, B, C, D = found or map(real_doubles, given.in_balls(PRECISIONS[-1]))
    except ZeroDivisionError:
        raise InputError(
            "the system has a pole that cannot be told from z = -1, half the sampling rate: filter "
            "it or sample at another rate"
        ) from None
    scaled = scaled_states((A, B, C))
    assert scaled is not None
    return scaled, D


def scaled_states(parts: Enclosures | None) -> Enclosures | None:
    """The realisation with balanced states; None if there is none.

    Modes of a cluster of poles come with entries of very different size.
    """
    return parts and with_balanced_states(*parts)


def with_balanced_states(A: Enclosure, B: Enclosure, C: Enclosure) -> Enclosures:
    """The realisation with its states scaled by powers of two, exactly, to entries of like size."""
    n, outputs, inputs = len(A.mid), len(C.mid), B.mid.shape[1]
    whole = np.block([[A.mid, B.mid], [C.mid, np.zeros((outputs, inputs))]])
    scale = balancing(np.abs(whole), n)[0][:n]
    return (
        A.scaled(scale, 1 / scale),
        B.scaled(scale, np.ones(inputs)),
        C.scaled(np.ones(outputs), 1 / scale),
    )


def is_sharp(parts: Enclosures) -> bool:
    """Whether the coordinates are accurate enough to work with."""
    return all(
        part.rad.max(initial=0.0) <= LARGEST_BLUR * np.abs(part.mid).max(initial=0.0)
        for part in parts
    )


def responds_sharply(modes: Enclosures, plain: Enclosures) -> bool:
    """Whether modal coordinates are accurate, and make the response hardly more uncertain than
    plain ones.

    Modes of nearly equal poles cancel each other: C and B are large, and small errors of A between
    two such modes have a large effect on the response. Both responses are compared at 0 and at the
    frequencies of the poles.
    """
    if not is_sharp(modes):
        return False
    A, B, C = modes
    points = 1j * np.unique(np.append(np.abs(np.linalg.eigvals(A.mid).imag), 0.0))
    with np.errstate(over="ignore", invalid="ignore"):
        try:
            into = np.abs(driven_states(A.mid, B.mid, points))
            out = np.abs(driven_states(A.mid.T, C.mid.T, points)).mT
            response = plain[2].mid @ driven_states(plain[0].mid, plain[1].mid, points)
        except np.linalg.LinAlgError:
            return True  # doubles have a pole there: the plain coordinates are no better
        left_open = C.rad @ into + out @ B.rad + out @ A.rad @ into
    return bool(left_open.max(initial=0.0) <= LARGEST_OPEN * np.abs(response).max(initial=0.0))
