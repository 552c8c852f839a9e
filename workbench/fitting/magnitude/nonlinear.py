"""The magnitude fit as a nonlinear program for IPOPT, in logarithms of quadratic factors."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.executor import Context
from workbench.fitting.magnitude.gain import Target, target_of, with_best_gain
from workbench.fitting.magnitude.program import MagnitudeFit
from workbench.fitting.magnitude.sanathanan_koerner import sanathanan_koerner
from workbench.fitting.rational import Rational, conjugate_pairs
from workbench.program import Claim, method
from workbench.solvers import in_one_thread, ipopt, ipopt_outcome

MIN_STARTING_DAMPING = 0.05
"""Smallest damping ratio at the start: IPOPT rarely leaves resonances that are sharper than the
data's.
"""


@method(MagnitudeFit, "ipopt", optimal=False)
@in_one_thread
def _ipopt(program: MagnitudeFit, context: Context) -> Claim:
    """Nonlinear program: least worst error over log a and log b of factors s^2 + a s + b."""
    import casadi as ca

    target, n = target_of(program), program.order
    middle = float(np.sqrt(target.omega[0] * target.omega[-1]))
    start = _start(target, n)
    with context.stating():
        x = ca.SX.sym("x", 2 * n + 2)  # gain, zeros, poles, worst error
        omega = target.omega / middle
        log_ratio = x[0] + _log_size(x[1 : n + 1], omega) - _log_size(x[n + 1 : 2 * n + 1], omega)
        error = program.weight * (ca.exp(log_ratio - np.log(target.magnitude)) - 1)
        low = -error if program.cover else -error - x[-1]
        nlp = {"x": x, "f": x[-1], "g": ca.vertcat(error - x[-1], low)}
        solver = ipopt("magnitude", nlp, context.options)
    worst, shape = target.best(start)
    zeros, poles = _logs(shape.zeros / middle), _logs(shape.poles / middle)
    x0 = np.concatenate([[np.log(shape.gain)], zeros, poles, [worst]])
    found = solver(x0=x0, ubg=0, lbx=-30, ubx=30)["x"].full().ravel()
    outcome, message = ipopt_outcome(solver)
    fit = with_best_gain(
        target, middle * _roots(found[1 : n + 1]), middle * _roots(found[n + 1 : 2 * n + 1])
    )
    return fit, outcome, message


def _start(target: Target, order: int) -> Rational:
    """Start of the search: the linear fit, or the same fit with more damping if its error is
    smaller.
    """
    fit = sanathanan_koerner(target, order)
    damped = Rational(_damped(fit.zeros), _damped(fit.poles), 1.0)
    return min((fit, damped), key=lambda start: target.best(start)[0])


def _damped(roots: ComplexArray) -> ComplexArray:
    """Roots of the same size with at least MIN_STARTING_DAMPING."""
    size = np.abs(roots)
    real = np.minimum(roots.real, -MIN_STARTING_DAMPING * size)
    return conjugate_pairs(
        real + 1j * np.sign(roots.imag) * np.sqrt(np.maximum(size**2 - real**2, 0))
    )


def _log_size(logs: Any, omega: RealArray) -> Any:
    """log|product of factors| at frequencies, as a CasADi expression.

    ``logs`` holds log a, log b of each factor s^2 + a s + b and, if odd, log a of a last s + a.
    """
    import casadi as ca

    size = ca.SX.zeros(omega.size)
    for k in range(0, logs.numel() - 1, 2):
        a, b = ca.exp(logs[k]), ca.exp(logs[k + 1])
        size += ca.log((b - omega**2) ** 2 + (a * omega) ** 2) / 2
    if logs.numel() % 2:
        size += ca.log(omega**2 + ca.exp(2 * logs[-1])) / 2
    return size


def _logs(roots: ComplexArray) -> RealArray:
    """Logarithms of the factors with given roots, as `_log_size` takes them.

    Real roots are taken two by two.
    """
    real, upper = np.sort(roots.real[roots.imag == 0]), roots[roots.imag > 0]
    pairs = [(-2 * p.real, abs(p) ** 2) for p in upper]
    pairs += [(-(p + q), p * q) for p, q in zip(real[:-1:2], real[1::2], strict=False)]
    last = [-real[-1]] if real.size % 2 else []
    return np.log(np.array([value for pair in pairs for value in pair] + last))


def _roots(logs: RealArray) -> ComplexArray:
    """Roots of the factors with given logarithms."""
    values = np.exp(logs)
    pairs = [np.roots([1, a, b]) for a, b in zip(values[:-1:2], values[1::2], strict=False)]
    last = [np.array([-values[-1]])] if values.size % 2 else []
    return np.concatenate([*pairs, *last, np.zeros(0)]).astype(complex)
