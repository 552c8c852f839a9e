"""Diagonal weights by quasi-Newton descent over their poles and zeros.

Each weight is a product of sections s^2 + a s + b and s + c over others like them, with positive
coefficients: stable, with a stable inverse. The mean logarithm of the radius is a sum of those of
the weights' sizes; so is what containment adds, the largest log |W_1^-1 X W_2^-1|, of which the
slope by log |w_i| is -|u_i|^2 and by log |w_j| is -|v_j|^2 with its singular vectors u and v. The
largest is replaced by a soft one that hardens. With a loop the largest log mu over frequency takes
the place of most of the radius; its slopes are the other way about, |v_i|^2 and |u_j|^2 of the
scaled loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp, softmax

from workbench.arrays import Array, ComplexArray, RealArray
from workbench.executor import Context
from workbench.fitting.rational import Rational, conjugate_pairs
from workbench.uncertainty.matrix_covers.cover import MatrixCover
from workbench.uncertainty.matrix_covers.loop import MatrixCoverForLoop
from workbench.uncertainty.matrix_sets.loop import VOLUME_SHARE, loop_level, scaled_loop

HARDNESS = (30.0, 100.0, 300.0, 1000.0, 3000.0)
"""Factors of the logarithms in the soft maximum, one after the other."""
STEPS = 200
"""Most steps of the descent at one hardness."""
OUTERMOST = 8
"""Most plants at a frequency that the descent looks at."""
RANGE = 10.0
"""Largest change of the logarithm of a coefficient."""


def descended(
    program: MatrixCover, left: Sequence[Rational], right: Sequence[Rational], context: Context
) -> tuple[list[Rational], list[Rational]]:
    """Weights of the bilinear plane with smaller sets, from those of the channels.

    One weight for all channels stands alone in its list.
    """
    fine, shares = program.for_fits()
    sides = [_Side(fine.axis, fits) for fits in (left, right)]
    X = _outermost(fine.covered, [side.logs(side.start)[0] for side in sides])
    start = np.concatenate([side.start for side in sides])
    ends = np.cumsum([side.start.size for side in sides])
    of_loop = None
    if isinstance(program, MatrixCoverForLoop):
        of_loop = _LoopCost(program, left, right)

    def value(x: RealArray, hardness: float) -> tuple[float, RealArray]:
        parts = np.split(x, ends[:-1])
        found = [side.logs(part) for side, part in zip(sides, parts, strict=True)]
        left, right = (np.exp(logs) for logs, _ in found)
        u, s, vh = np.linalg.svd(X / left[:, None, :, None] / right[:, None, None])
        largest = np.log(s[..., 0]) * hardness
        soft = softmax(largest)
        pull = [
            np.einsum("fk,fki->fi", soft, np.abs(u[..., 0]) ** 2),
            np.einsum("fk,fki->fi", soft, np.abs(vh[..., 0, :]) ** 2),
        ]
        raised = logsumexp(largest) / hardness  # of W_1, until the model contains the plants
        total, share = raised, 1.0
        if of_loop is not None:
            logs = [side.logs(part) for side, part in zip(of_loop.sides, parts, strict=True)]
            level, grips, of_raise = of_loop(logs[0][0] + raised, logs[1][0], hardness)
            share = VOLUME_SHARE
            total = level + share * raised
        gradient = []
        for side, ((log, slope), grip) in enumerate(zip(found, pull, strict=True)):
            total = total + share * shares @ log.mean(axis=1)
            weights = share * shares[:, None] / log.shape[1]
            scale = share if of_loop is None else share + of_raise
            weights = weights - scale * _for_channels(grip, log)
            rise = np.einsum("fi,fid->d", weights, slope)
            if of_loop is not None:
                log, slope = logs[side]
                rise += np.einsum("fi,fid->d", _for_channels(grips[side], log), slope)
            gradient.append(rise)
        return float(total), np.concatenate(gradient)

    x = start
    if x.size:
        for hardness in context.track(HARDNESS, "descents"):
            bounds = [(each - RANGE, each + RANGE) for each in start]
            x = minimize(
                value, x, (hardness,), "L-BFGS-B", True, bounds=bounds, options={"maxiter": STEPS}
            ).x
    found = [side.fits(part) for side, part in zip(sides, np.split(x, ends[:-1]), strict=True)]
    return found[0], found[1]


def _for_channels(grip: RealArray, log: RealArray) -> RealArray:
    """Slopes (F, n) by the logarithms (F, n) of all channels, or (F, 1) of one for all."""
    found: RealArray = grip if log.shape == grip.shape else grip.sum(axis=1, keepdims=True)
    return found


class _LoopCost:
    """The largest log mu of the program's loop over the given frequencies, softened."""

    def __init__(
        self, program: MatrixCoverForLoop, left: Sequence[Rational], right: Sequence[Rational]
    ) -> None:
        self.loop = program.loop_response
        self.sides = [_Side(program.axis, fits) for fits in (left, right)]
        self.m, self.p = program.deviations.shape[3], program.deviations.shape[2]

    def __call__(
        self, left: RealArray, right: RealArray, hardness: float
    ) -> tuple[float, list[RealArray], float]:
        """Value, slopes (F, p) and (F, m) by the logarithms of the weights, and by that of W_1.

        ``left`` and ``right`` are the logarithms (F, .).
        """
        P, S = (_diagonals(np.exp(-log), n) for log, n in ((left, self.p), (right, self.m)))
        level, delta = loop_level(self.loop, P, S)
        u, _, vh = np.linalg.svd(scaled_loop(self.loop, P, S, delta), full_matrices=False)
        soft = softmax(level * hardness)[:, None]
        grips = [
            soft * np.abs(vh[:, 0, : self.p]) ** 2,
            soft * np.abs(u[:, : self.m, 0]) ** 2,
        ]
        return float(logsumexp(level * hardness) / hardness), grips, float(grips[0].sum())


def _diagonals(values: RealArray, size: int) -> Array:
    """Diagonal matrices (F, size, size) of values (F, size), or (F, 1) for all."""
    found: Array = np.eye(size) * np.broadcast_to(values, (len(values), size))[:, None]
    return found


def _outermost(X: Array, logs: Sequence[RealArray]) -> Array:
    """Those of X (F, N, p, m) that are largest in weights of these logarithmic sizes (F, .)."""
    left, right = (np.exp(each) for each in logs)
    norms = np.linalg.norm(X / left[:, None, :, None] / right[:, None, None], 2, axis=(2, 3))
    order = np.argsort(-norms, axis=1)[:, :OUTERMOST]
    return np.take_along_axis(X, order[..., None, None], axis=1)


@dataclass(frozen=True)
class _Sections:
    """Coefficients of quadratic sections (q, 2) and of linear ones (l,), by their logarithms."""

    quadratic: int
    linear: int

    @property
    def count(self) -> int:
        return 2 * self.quadratic + self.linear

    def logs(self, x: RealArray, omega: RealArray) -> tuple[RealArray, RealArray]:
        """log of the product's size (F,) and its slope (F, count) by x."""
        square = (omega**2)[:, None]
        a, b = np.exp(x[: 2 * self.quadratic].reshape(-1, 2)).T
        size = (b - square) ** 2 + a**2 * square
        c = np.exp(x[2 * self.quadratic :])
        lines = square + c**2
        slope = np.concatenate(
            [
                np.stack([a**2 * square / size, (b - square) * b / size], axis=2).reshape(
                    len(omega), -1
                ),
                c**2 / lines,
            ],
            axis=1,
        )
        return (np.log(size).sum(axis=1) + np.log(lines).sum(axis=1)) / 2, slope

    def roots(self, x: RealArray) -> ComplexArray:
        pairs = np.exp(x[: 2 * self.quadratic].reshape(-1, 2))
        found = [np.roots([1.0, a, b]) for a, b in pairs]
        found.append(-np.exp(x[2 * self.quadratic :]))
        return conjugate_pairs(np.concatenate([*found, np.zeros(0)]).astype(complex))


def _sections(roots: ComplexArray) -> tuple[_Sections, RealArray]:
    """Sections with these roots, and the logarithms of their coefficients."""
    upper = roots[roots.imag > 0]
    reals = np.sort(-roots[roots.imag == 0].real)
    pairs = [(-2 * root.real, abs(root) ** 2) for root in upper]
    pairs += [(p + q, p * q) for p, q in zip(reals[0:-1:2], reals[1::2], strict=True)]
    linear = reals[2 * (reals.size // 2) :]
    x = np.log(np.concatenate([np.ravel(pairs), linear]))
    return _Sections(len(pairs), linear.size), x


class _Side:
    """The weights of one side, in units of the middle of the band."""

    def __init__(self, axis: RealArray, fits: Sequence[Rational]) -> None:
        self.unit = float(np.sqrt(axis[0] * axis[-1]))
        self.omega = axis / self.unit
        self.gains = [np.log(abs(fit.gain)) + (fit.zeros.size - fit.poles.size) * np.log(self.unit)
                      for fit in fits]  # fmt: skip
        found = [_sections(roots / self.unit) for fit in fits for roots in (fit.zeros, fit.poles)]
        self.sections = [sections for sections, _ in found]
        self.start = np.concatenate([x for _, x in found]) if found else np.zeros(0)
        self.ends = np.cumsum([sections.count for sections in self.sections])[:-1]

    def logs(self, x: RealArray) -> tuple[RealArray, Array]:
        """Logarithms of the weights' sizes (F, channels), and slopes (F, channels, d)."""
        F, channels = self.omega.size, len(self.gains)
        logs = np.tile(np.array(self.gains), (F, 1))
        slopes = np.zeros((F, channels, x.size))
        place = 0
        for number, (sections, part) in enumerate(
            zip(self.sections, np.split(x, self.ends), strict=True)
        ):
            value, slope = sections.logs(part, self.omega)
            sign = 1.0 if number % 2 == 0 else -1.0  # zeros and poles in turn
            logs[:, number // 2] += sign * value
            slopes[:, number // 2, place : place + part.size] = sign * slope
            place += part.size
        return logs, slopes

    def fits(self, x: RealArray) -> list[Rational]:
        """The weights with these coefficients."""
        roots = [
            self.unit * sections.roots(part)
            for sections, part in zip(self.sections, np.split(x, self.ends), strict=True)
        ]
        gains = np.exp(self.gains)
        return [
            Rational(zeros, poles, float(gain * self.unit ** (poles.size - zeros.size)))
            for zeros, poles, gain in zip(roots[::2], roots[1::2], gains, strict=True)
        ]
