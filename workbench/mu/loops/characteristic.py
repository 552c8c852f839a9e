"""Exact characteristic functions of loops with dead times, from the entries of their parts.

With states x, delayed signals and loop signals as channels, all of them linear in each other by a
matrix Q, the closed loop's poles are the zeros of

    f(s) = det(diag(s I, I) - Q diag(I, Lambda)),  Lambda = diag(exp(-s T_i), gain of each loop).

f is linear in each entry of Lambda, so that the polynomials p of f = sum p_S(s) exp(-s T_S), T_S
the sum of the delays of a set S, are differences of determinants with Lambda 0 or a number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations

from flint import fmpq, fmpq_mat, fmpq_poly

from workbench._core.arrays import RealArray
from workbench.certify.known_plants.exact_function import exact_rational
from workbench.errors import InputError
from workbench.mu.loops.quasi_polynomials import QuasiPolynomial

ZERO = Fraction(0)
MOST_DELAYS = 8
"""Largest number of channels with dead time: one determinant is computed for each set of them.
There are 256 determinants then. Half refuses loops that take little time; double would take 65,536
of them.
"""
STANDINGS = (fmpq(1), fmpq(1, 2), fmpq(1, 3), fmpq(2, 3), fmpq(3, 7))
"""Numbers put in place of the exponentials; the next one is tried if a determinant is singular."""


@dataclass(frozen=True, eq=False)
class LateChannels:
    """Signals of a loop and how they depend on each other.

    ``Q`` (n + d + c, n + d + c) maps states, delayed signals and loop signals to the derivatives of
    the states, the signals to be delayed, and the loop signals; ``delays`` (d,) [s].
    """

    Q: RealArray
    states: int
    delays: tuple[Fraction, ...]

    @property
    def loops(self) -> int:
        """Number of loop signals."""
        return len(self.Q) - self.states - len(self.delays)

    @cached_property
    def closed(self) -> QuasiPolynomial:
        """f with every loop closed."""
        return self._function(range(self.loops))

    def opened(self, loop: int) -> QuasiPolynomial:
        """f with one loop opened, the others closed."""
        return self._function([k for k in range(self.loops) if k != loop])

    @cached_property
    def _exact(self) -> list[list[fmpq]]:
        return [[exact_rational(x) for x in row] for row in self.Q]

    def _function(self, loops: Sequence[int]) -> QuasiPolynomial:
        n, d = self.states, len(self.delays)
        if d > MOST_DELAYS:
            raise InputError(
                f"the loop has {d} channels with dead time; exact margins are known of up to "
                f"{MOST_DELAYS}: put dead times together, or give "
                "`dead_time_approximation` of the plant"
            )
        kept = [n + d + k for k in loops]
        for standing in STANDINGS:
            found = self._combined(kept, standing)
            if found is not None:
                return found
        raise InputError(
            "the loop is not well posed: it is singular through the direct terms of its parts; "
            "give one of them a lag, or another gain"
        )

    def _combined(self, kept: Sequence[int], standing: fmpq) -> QuasiPolynomial | None:
        """The function, from the determinants of all sets of delayed channels, with a number in
        place of each exponential.

        None where a determinant is singular with that number.
        """
        n, d = self.states, len(self.delays)
        parts: dict[frozenset[int], fmpq_poly] = {}
        total = QuasiPolynomial({})
        for chosen in (frozenset(one) for k in range(d + 1) for one in combinations(range(d), k)):
            p = self._determinant([n + i for i in sorted(chosen)], kept, standing)
            if p is None:
                return None
            for other, part in parts.items():  # subtract the contribution of smaller sets
                if other < chosen:
                    p -= part * standing ** len(other)
            p *= 1 / standing ** len(chosen)
            parts[chosen] = p
            total += QuasiPolynomial({sum((self.delays[i] for i in chosen), ZERO): p})
        return total

    def _determinant(
        self, late: Sequence[int], kept: Sequence[int], standing: fmpq
    ) -> fmpq_poly | None:
        """Determinant with these channels only, the delayed ones times a number; None where
        singular.
        """
        n, channels = self.states, [*late, *kept]
        states = range(n)
        A, C = self._part(states, states), self._part(channels, states)
        if not channels:
            return A.charpoly()
        gains = fmpq_mat(len(channels), len(channels))
        for i in range(len(channels)):
            gains[i, i] = standing if i < len(late) else fmpq(1)
        B, D = (self._part(rows, channels) * gains for rows in (states, channels))
        for i in range(len(channels)):
            D[i, i] -= 1
        direct = (-1 * D).det()
        return direct * (A - B * D.inv() * C).charpoly() if direct else None

    def _part(self, rows: Sequence[int], columns: Sequence[int]) -> fmpq_mat:
        return fmpq_mat(len(rows), len(columns), [self._exact[i][j] for i in rows for j in columns])
