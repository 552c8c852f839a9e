"""Matrices of rational functions with common poles and delays, in continuous or sampled time."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.fitting.rational import Rational

if TYPE_CHECKING:
    from collections.abc import Sequence

REALISATION_POINTS = 20
"""Points for each unknown at which the outputs of a realisation are computed."""


@dataclass(frozen=True, eq=False)
class CommonPoleModel:
    """G with entries gain prod(x - zeros) / prod(x - poles) exp(-s delay), x = s or z = exp(s T).

    Unlike a `StateSpace`, it has exact delays, and entries with the same poles.

    Parameters
    ----------
    entries
        Rational functions of x, one row for each output, all with the same poles.
    delay
        Delays (p, m) [s].
    dt
        T [s], or None for a model in continuous time.

    Raises
    ------
    InputError
        Rows of different lengths, entries with different poles, or a sample time that is not
        positive.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.fitting import Rational
    >>> from workbench.identification import CommonPoleModel
    >>> entry = Rational([], [-2.0], 3.0)
    >>> model = CommonPoleModel([[entry]], np.array([[0.1]]))  # 3 exp(-0.1 s) / (s + 2)
    >>> model.order, model.is_stable, abs(model.response(np.array([0.0]))).ravel().tolist()
    (1, True, [1.5])
    """

    entries: Sequence[Sequence[Rational]]
    delay: RealArray
    _: KW_ONLY
    dt: float | None = None

    def __post_init__(self) -> None:
        rows = tuple(tuple(row) for row in self.entries)
        if not rows or not rows[0] or any(len(row) != len(rows[0]) for row in rows):
            raise InputError(f"entries must be rows of one length, not {self.entries!r:.80}")
        object.__setattr__(self, "entries", rows)
        delay = np.broadcast_to(np.asarray(self.delay, float), self.shape)
        object.__setattr__(self, "delay", delay)
        if not all(np.array_equal(each.poles, self.poles) for row in rows for each in row):
            raise InputError("all entries must have the same poles")
        if self.dt is not None and not 0 < self.dt < np.inf:
            raise InputError(f"dt is {self.dt}; it must be positive, or None")

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of outputs and inputs."""
        return len(self.entries), len(self.entries[0])

    @property
    def poles(self) -> ComplexArray:
        """Poles (n,) in rad/s, or in the z-plane."""
        return self.entries[0][0].poles

    @property
    def order(self) -> int:
        """Number of poles."""
        return int(self.poles.size)

    @property
    def is_stable(self) -> bool:
        """Whether every pole is left of the imaginary axis, or inside the unit circle."""
        inside = self.poles.real < 0 if self.dt is None else np.abs(self.poles) < 1
        return bool(inside.all())

    def response(self, omega: ArrayLike) -> ComplexArray:
        """Responses (F, p, m) at angular frequencies (F,) [rad/s]."""
        omega = np.asarray(omega, float)
        x = variable(omega, self.dt)
        found = np.empty((omega.size, *self.shape), complex)
        for i, j in np.ndindex(self.shape):
            found[:, i, j] = self.entries[i][j](x) * np.exp(-1j * omega * self.delay[i, j])
        return found

    @property
    def lti(self) -> StateSpace:
        """A state-space realisation of the rational part: the delays are left out.

        A single entry becomes a cascade of sections. A matrix has order min(p, m) states: for each
        input, or for each output if there are fewer, the same chain of sections, or modes if these
        are better conditioned.
        """
        import control

        dt = 0.0 if self.dt is None else self.dt
        p, m = self.shape
        if p == m == 1:
            cascade = self.entries[0][0].state_space()
            return control.ss(cascade.A, cascade.B, cascade.C, cascade.D, dt)
        tall = p >= m
        side = m if tall else p
        points = self._points()
        ways = [_chain(self.poles, self.dt is None), _modes(self.poles)]
        a, b, (c, D, _) = min(
            ((a, b, self._outputs(a, b, points, tall)) for a, b in ways), key=lambda way: way[2][2]
        )
        A, B, C = np.kron(np.eye(side), a), np.kron(np.eye(side), b), c
        if not tall:
            A, B, C, D = A.T, C.T, B.T, D.T
        return control.ss(A, B, C, D, dt)

    def _outputs(
        self, a: RealArray, b: RealArray, points: ComplexArray, tall: bool
    ) -> tuple[RealArray, RealArray, float]:
        """C and D for states driven by a, b for each input; and the largest relative error.

        If not ``tall``: for each output in place of each input, transposed.
        """
        n = self.order
        rows = points[:, None, None] * np.eye(n) - a
        states = np.linalg.solve(rows, np.broadcast_to(b, (points.size, n, 1)))[..., 0]
        basis = np.column_stack([states, np.ones(points.size)])
        sizes = np.linalg.norm(basis, axis=0)
        p, m = self.shape
        side, other = (m, p) if tall else (p, m)
        C, D, worst = np.zeros((other, side * n)), np.zeros((other, side)), 0.0
        for i, j in np.ndindex(other, side):
            entry = self.entries[i][j] if tall else self.entries[j][i]
            count = n if entry.zeros.size < n else n + 1
            value = entry(points)
            weight = 1.0 / np.maximum(np.abs(value), 1e-3 * np.abs(value).max(initial=1e-300))
            columns = weight[:, None] * basis[:, :count] / sizes[:count]
            found = np.linalg.lstsq(_stacked(columns), _stacked(weight * value))[0]
            worst = max(worst, float(np.abs(columns @ found - weight * value).max()))
            found = found / sizes[:count]
            C[i, j * n : (j + 1) * n] = found[:n]
            D[i, j] = found[n] if count > n else 0.0
        return C, D, worst

    def _points(self) -> ComplexArray:
        """Points on the imaginary axis, or on the unit circle, near the poles and zeros."""
        count = REALISATION_POINTS * (self.order + 1)
        if self.dt is not None:
            circle: ComplexArray = np.exp(1j * np.pi * (np.arange(count) + 0.5) / count)
            return circle
        roots = [self.poles, *(each.zeros for row in self.entries for each in row)]
        sizes = np.abs(np.concatenate(roots))
        sizes = sizes[sizes > 0]
        if not sizes.size:
            return np.asarray(1j * np.geomspace(0.1, 10.0, count), complex)
        near = np.abs(self.poles[self.poles.imag > 0])
        low, high = sizes.min() / 10, sizes.max() * 10
        low = max(low, 1e-6 * high)
        axis: ComplexArray = 1j * np.union1d(np.geomspace(low, high, count), near)
        return axis


def _chain(poles: ComplexArray, scaled: bool) -> tuple[RealArray, RealArray]:
    """A (n, n) and B (n, 1) of sections in series; scaled in time by the size of each pole."""
    n = poles.size
    a, b = np.zeros((n, n)), np.zeros((n, 1))
    place, last = 0, -1
    pairs, real = poles[poles.imag > 0], poles[poles.imag == 0]
    for pole in sorted([*pairs, *real], key=abs):
        size = (abs(pole) if scaled else 1.0) or 1.0
        width = 2 if pole.imag else 1
        _fill_mode(a, place, pole)
        if last < 0:
            b[place] = size
        else:
            a[place, last] = size
        place, last = place + width, place + width - 1
    return a, b


def _modes(poles: ComplexArray) -> tuple[RealArray, RealArray]:
    """A (n, n) and B (n, 1) of parallel sections."""
    n, place = poles.size, 0
    a, b = np.zeros((n, n)), np.zeros((n, 1))
    for pole in poles[poles.imag >= 0]:
        _fill_mode(a, place, pole)
        b[place] = abs(pole) or 1.0
        place += 2 if pole.imag else 1
    return a, b


def _fill_mode(a: RealArray, place: int, pole: complex) -> None:
    """Write a real pole, or a pair, on the diagonal of a matrix."""
    a[place, place] = pole.real
    if pole.imag:
        a[place + 1, place + 1] = pole.real
        a[place, place + 1], a[place + 1, place] = pole.imag, -pole.imag


def variable(omega: RealArray, sample_time: float | None) -> ComplexArray:
    """s = j omega, or z = exp(j omega T), at frequencies (F,) [rad/s]."""
    found: Any = 1j * omega if sample_time is None else np.exp(1j * omega * sample_time)
    return found


def _stacked(values: np.ndarray) -> RealArray:
    """Real parts above imaginary parts."""
    return np.concatenate([values.real, values.imag])
