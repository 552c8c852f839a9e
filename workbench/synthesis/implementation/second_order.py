"""Cascades of second-order sections for sampled controllers, one cascade for each channel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError, SolverError
from workbench.systems.balancing import balanced
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import response
from workbench.systems.hidden_states import visible_matrices
from workbench.systems.realisation import realisation

CHECKED_ANGLES = np.pi * np.append(np.logspace(-6, 0, 120, endpoint=False), 0.999)
"""Frequencies [rad/sample] at which the cascades are compared with the controller."""
SECTION_RESPONSE_TOLERANCE = 1e-6
"""Largest difference at these frequencies, relative to the largest gain of the channel."""
INFINITE_ZERO = 1e8
"""Zeros of a larger modulus count as infinite."""


@dataclass(frozen=True, eq=False)
class Sections:
    """Cascades ``channels[i][j]`` (L, 6) from input j to output i, rows b0 b1 b2 1 a1 a2.

    A row is (b0 + b1 / z + b2 / z^2) / (1 + a1 / z + a2 / z^2); outputs are sums over inputs. The
    sampling time is ``dt`` [s].

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import second_order_sections
    >>> sections = second_order_sections(control.tf([1.0, 0.5], [1.0, -0.9], 0.1))
    >>> sections.ninputs, sections.noutputs, sections.dt
    (1, 1, 0.1)
    """

    channels: tuple[tuple[RealArray, ...], ...]
    dt: float

    @property
    def noutputs(self) -> int:
        """Number of outputs."""
        return len(self.channels)

    @property
    def ninputs(self) -> int:
        """Number of inputs."""
        return len(self.channels[0])

    def response(self, omega: ArrayLike) -> ComplexArray:
        """Frequency response at `omega` [rad/s] (F,), shape (F, outputs, inputs)."""
        z = np.exp(1j * np.atleast_1d(np.asarray(omega, float)) * self.dt)
        return np.array([[_value(rows, z) for rows in line] for line in self.channels]).transpose(
            2, 0, 1
        )

    @property
    def lti(self) -> StateSpace:
        """The StateSpace `system`."""
        return self.system

    @property
    def system(self) -> StateSpace:
        """StateSpace with the states of every cascade, two for each section."""
        parts = [[_cascade(rows) for rows in line] for line in self.channels]
        sizes = [len(part[0]) for line in parts for part in line]
        n, place = sum(sizes), 0
        A, B = np.zeros((n, n)), np.zeros((n, self.ninputs))
        C, D = np.zeros((self.noutputs, n)), np.zeros((self.noutputs, self.ninputs))
        for i, line in enumerate(parts):
            for j, (a, b, c, d) in enumerate(line):
                own = slice(place, place + len(a))
                A[own, own], B[own, j], C[i, own], D[i, j] = a, b, c, d
                place += len(a)
        return realisation((A, B, C, D), self.dt)


def second_order_sections(controller: Any) -> Sections:
    """Realise a sampled StateSpace or TransferFunction as cascades of second-order sections.

    Poles are combined with the zeros nearest to them. The poles nearest to the unit circle choose
    first, and their sections are the last of the cascade (L. Jackson, Roundoff-noise analysis for
    fixed-point digital filters realized in cascade or parallel form, IEEE Trans. Audio and
    Electroacoustics 18 (1970) 107-122).

    Raises
    ------
    InputError
        The controller is continuous or has no sampling time.
    SolverError
        The computed poles and zeros do not reproduce the response of K because of rounding errors.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import second_order_sections
    >>> K = control.tf([1.0, 0.5, 0.2], [1.0, -1.2, 0.5], 0.1)
    >>> second_order_sections(K).channels[0][0].round(6).tolist()
    [[1.0, 0.5, 0.2, 1.0, -1.2, 0.5]]
    """
    controller = as_system(controller, "controller")
    if not controller.dt or controller.dt is True:
        raise InputError(
            f"controller has dt = {controller.dt}; discretise it first, with a sampling time "
            "in seconds"
        )
    channels = tuple(
        tuple(_channel(controller, i, j) for j in range(controller.ninputs))
        for i in range(controller.noutputs)
    )
    found = Sections(channels, float(controller.dt))
    omega = CHECKED_ANGLES / found.dt
    expected = response(controller, omega)
    change = np.abs(found.response(omega) - expected).max(axis=0)
    if (change > SECTION_RESPONSE_TOLERANCE * np.abs(expected).max(axis=0)).any():
        raise SolverError(
            f"the cascades differ from K by up to {change.max():.3g}: its zeros are lost in "
            "rounding; reduce K first"
        )
    return found


def _channel(K: StateSpace, i: int, j: int) -> RealArray:
    """Sections (L, 6) of the channel from input j to output i."""
    # A mode hidden in this channel may be visible in another. Scale all modes into the unit circle,
    # so that none counts as a hidden unstable mode.
    size = 2.0 * float(np.abs(K.poles()).max(initial=0.0)) or 1.0
    A, B, C = visible_matrices(*balanced(K.A / size, K.B[:, [j]], K.C[[i]]), float(K.dt))
    A = size * A
    D = np.asarray(K.D[i, j], dtype=float).reshape(1, 1)
    own = realisation((A, B, C, D), float(K.dt))
    poles, zeros = own.poles().astype(complex), np.asarray(own.zeros(), dtype=complex)
    zeros = zeros[np.abs(zeros) < INFINITE_ZERO]
    rows = paired_sections(zeros, poles)
    z = np.exp(1j * CHECKED_ANGLES)
    raw, wanted = _value(rows, z), response(own, CHECKED_ANGLES / float(K.dt))[:, 0, 0]
    # Match the gain where the response of the channel is largest and thus most accurate.
    at = int(np.argmax(np.abs(wanted)))
    rows[0, :3] *= float((wanted[at] / raw[at]).real) if np.abs(wanted[at]) > 0.0 else 0.0
    return rows


def paired_sections(zeros: ComplexArray, poles: ComplexArray) -> RealArray:
    """Sections (L, 6), at least one, with these zeros and poles and leading coefficients 1."""
    pairs = _groups(poles)
    pairs.sort(key=lambda group: (len(group) == 1, -max(np.abs(group))))
    free = _groups(zeros)
    rows = []
    for left, group in zip(range(len(pairs), 0, -1), pairs, strict=True):
        rows.append([*_take_numerator(free, group, left), *_monic(group, 0)])
    return np.array(rows[::-1] or [[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]])


def _groups(roots: ComplexArray) -> list[ComplexArray]:
    """Groups of two roots: complex pairs, and real roots by modulus; one group may be a single
    root.
    """
    upper = roots[roots.imag > 0.0]
    real = np.sort(roots[roots.imag == 0.0].real)
    groups = [np.array([root, root.conjugate()]) for root in upper]
    # The largest roots form the first pair; a single root is the one of smallest modulus.
    real = real[np.argsort(-np.abs(real), kind="stable")]
    return groups + [real[i : i + 2].astype(complex) for i in range(0, len(real), 2)]


def _take_numerator(free: list[ComplexArray], poles: ComplexArray, left: int) -> RealArray:
    """Numerator of a section with `poles`; its zeros are taken from the free groups.

    `left` is the number of sections that have no zeros yet. Every group of two zeros needs a
    section with two poles.
    """
    fitting = [k for k, group in enumerate(free) if len(group) <= len(poles)]
    if not fitting:
        return _monic(np.zeros(0, complex), len(poles))
    if len(free) >= left:  # no group of two zeros may remain
        wide = [k for k in fitting if len(free[k]) == len(poles)]
        fitting = wide or fitting
    nearest = min(fitting, key=lambda k: float(np.abs(free[k] - poles[: len(free[k])]).min()))
    group = free.pop(nearest)
    return _monic(group, len(poles) - len(group))


def _monic(roots: ComplexArray, delays: int) -> RealArray:
    """Coefficients (3,) of z^-delays prod(1 - root / z), in powers of 1/z."""
    row = np.zeros(3)
    row[delays : delays + len(roots) + 1] = np.poly(roots).real
    return row


def _value(rows: RealArray, z: ComplexArray) -> ComplexArray:
    """Response of a cascade at points z (F,)."""
    powers = np.stack([np.ones_like(z), 1 / z, z**-2.0])
    value: ComplexArray = ((rows[:, :3] @ powers) / (rows[:, 3:] @ powers)).prod(axis=0)
    return value


def _cascade(
    rows: Sequence[RealArray] | RealArray,
) -> tuple[RealArray, RealArray, RealArray, float]:
    """A, b, c, d of a cascade of sections in the transposed direct form II."""
    A, b, c, d = np.zeros((0, 0)), np.zeros(0), np.zeros(0), 1.0
    for b0, b1, b2, _, a1, a2 in rows:
        n = len(A)
        own, enter = np.array([[-a1, 1.0], [-a2, 0.0]]), np.array([b1 - a1 * b0, b2 - a2 * b0])
        A = np.block([[A, np.zeros((n, 2))], [np.outer(enter, c), own]])
        b, c, d = np.concatenate([b, enter * d]), np.concatenate([b0 * c, [1.0, 0.0]]), b0 * d
    return A, b, c, d
