"""The fit as a nonlinear program in second-order sections of the denominator, by IPOPT.

In the coefficients of its sections x^2 + a_1 x + a_0, a denominator is stable if linear
inequalities hold; and two real poles become a complex pair smoothly.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.executor import Context
from workbench.fitting.rational import conjugate_pairs
from workbench.identification.rational_models.point import FitPoint
from workbench.identification.rational_models.structure import LEAST_DAMPING, LEAST_RATE
from workbench.solvers import ipopt

PASSES = 4
"""Largest number of runs of IPOPT; each continues with the standard deviations as units."""
SETTLED = 1e-3
"""The passes end when the unknowns, in those units, change by less than this."""
PROXIMAL_CURVATURE = 1e-6
"""Curvature added to the cost in those units, for directions that the data do not determine."""

Pair = tuple[Any, Any]
"""Real and imaginary part of a column as CasADi expressions."""


def section_descent(point: FitPoint, context: Context) -> FitPoint:
    """The minimum of the cost that IPOPT reaches from a point; the point itself if it fails."""
    if not point.poles.size:
        return point
    program = _SectionProgram(point, context)
    best = point
    for start in program.passes():
        poles, delay = program.read(start)
        after = FitPoint(point.structure, point.structure.allowed(poles), delay)
        if after.cost < best.cost:
            best = after
    return best


class _SectionProgram:
    """The nonlinear program about a point, and its solution in passes."""

    def __init__(self, point: FitPoint, context: Context) -> None:
        import casadi as ca

        self.point, self.structure = point, point.structure
        n = point.poles.size
        self.coefficients = _sections(point.poles)
        self.shares = np.concatenate([share for _, share in point.each_share()])
        extra = [point.delay] if self.structure.free_delay else []
        self.start: RealArray = np.concatenate([self.coefficients, self.shares, extra])
        count = self.start.size
        with context.stating():
            values = ca.MX.sym("values", count)
            residual = self._residual(ca, values, n)
            limits = self._limits(ca, values, n)
            self.residuals = ca.Function("residuals", [values], [residual])
            self.slope = self.residuals.jacobian()
            x, origin, unit = (ca.MX.sym(name, count) for name in ("x", "origin", "unit"))
            # So the solver's gradient is in units of the noise, or of the misfit if that is larger.
            spread = ca.MX.sym("spread")
            misfit = self.residuals(origin + unit * x) / spread
            cost = ca.sumsqr(misfit) / 2 + PROXIMAL_CURVATURE * ca.sumsqr(x) / 2
            nlp: dict[str, Any] = {"x": x, "p": ca.vertcat(origin, unit, spread), "f": cost}
            if limits is not None:
                moved = ca.Function("limits", [values], [limits])
                nlp["g"] = moved(origin + unit * x)
            self.limited = limits is not None
            self.solver = ipopt("fit", nlp, context.options, max_iter=200)

    def passes(self) -> list[RealArray]:
        """The unknowns after each pass of IPOPT."""
        values, found = self.start, []
        for _ in range(PASSES):
            left = self.residuals(values).full()
            rounding = 1e-12 * self.structure.data.size
            spread = max(float(np.linalg.norm(left)) / np.sqrt(left.size), rounding)
            slopes = np.linalg.norm(self.slope(values, left).full(), axis=0)
            unit = spread / np.maximum(slopes, 1e-12 * slopes.max())
            low, high = np.full(values.size, -np.inf), np.full(values.size, np.inf)
            if self.structure.delay_bounds is not None:
                ends = np.array(self.structure.delay_bounds)
                low[-1], high[-1] = (ends - values[-1]) / unit[-1]
            limits = {"lbg": 0.0, "ubg": np.inf} if self.limited else {}
            answer = self.solver(
                x0=np.zeros(values.size),
                p=np.concatenate([values, unit, [spread]]),
                lbx=low,
                ubx=high,
                **limits,
            )
            moved = answer["x"].full().ravel()
            if not np.isfinite(moved).all():
                break
            values = values + unit * moved
            found.append(values)
            if np.abs(moved).max() < SETTLED:
                break
        return found

    def read(self, values: RealArray) -> tuple[ComplexArray, float]:
        """Poles, in units of the structure, and delay [s], from the unknowns."""
        n = self.point.poles.size
        delay = float(values[-1]) if self.structure.free_delay else self.point.delay
        return _roots(values[:n]), delay

    def _residual(self, ca: Any, values: Any, n: int) -> Any:
        """Whitened residuals, real parts above imaginary ones."""
        structure, point = self.structure, self.point
        data = structure.data
        ratio: Pair = (ca.DM.ones(data.omega.size), ca.DM.zeros(data.omega.size))
        for k, polynomial in enumerate(_polynomials(point.poles)):
            known = np.polyval(polynomial, structure.x)
            x = structure.x
            if len(polynomial) == 3:
                a1, a0 = values[2 * k], values[2 * k + 1]
                square = x**2
                ours = (square.real + a1 * x.real + a0, square.imag + a1 * x.imag)
            else:
                ours = (x.real + values[n - 1], ca.DM(x.imag))
            # D0 / D = known conj(ours) / |ours|^2
            size = ours[0] ** 2 + ours[1] ** 2
            ratio = _product(ratio, (known.real, known.imag))
            ratio = _product(ratio, (ours[0] / size, -ours[1] / size))
        place, errors = n, {}
        for (i, j), share in point.each_share():
            basis = point.basis.values[:, : share.size] * point.turn[:, i, j, None]
            own = values[place : place + share.size]
            place += share.size
            part = (ca.mtimes(ca.DM(basis.real), own), ca.mtimes(ca.DM(basis.imag), own))
            part = _product(part, ratio)
            if structure.free_delay:
                angle = -ca.DM(data.omega) * (values[-1] - point.delay)
                part = _product(part, (ca.cos(angle), ca.sin(angle)))
            given = data.response[:, i, j]
            errors[i, j] = (part[0] - given.real, part[1] - given.imag)
        return ca.vertcat(*self._whitened(ca, errors))

    def _whitened(self, ca: Any, errors: dict[tuple[int, int], Pair]) -> list[Any]:
        """Columns of whitened errors."""
        data = self.structure.data
        if data.independent:
            return [
                part * (np.sqrt(2) / data.deviation[:, i, j])
                for (i, j), pair in errors.items()
                for part in pair
            ]
        columns: list[Any] = []
        unit = np.zeros(data.response.shape, complex)
        roots = []
        for i, j in errors:
            unit[:] = 0.0
            unit[:, i, j] = 1.0
            roots.append(data.whitened(unit).reshape(len(unit), -1))
        for a in range(len(errors)):
            total: Pair = (0.0, 0.0)
            for root, pair in zip(roots, errors.values(), strict=True):
                part = _product(pair, (root[:, a].real, root[:, a].imag))
                total = (total[0] + part[0], total[1] + part[1])
            columns += total
        return columns

    def _limits(self, ca: Any, values: Any, n: int) -> Any:
        """Expressions that are nonnegative if the denominator is stable; None if poles are free."""
        structure = self.structure
        if not structure.stable:
            return None
        found = []
        for k in range(n // 2):
            a1, a0 = values[2 * k], values[2 * k + 1]
            if structure.sample_time is None:
                rate = LEAST_RATE * float(structure.data.omega[0]) / structure.unit
                size = float(np.sqrt(abs(self.coefficients[2 * k + 1])))
                found += [a1 - 2 * max(rate, LEAST_DAMPING * size), a0 - rate**2]
            else:
                edge = 1 - LEAST_DAMPING
                found += [edge**2 - a0, edge**2 + edge * a1 + a0, edge**2 - edge * a1 + a0]
        if n % 2:
            a0 = values[n - 1]
            if structure.sample_time is None:
                found.append(a0 - LEAST_RATE * float(structure.data.omega[0]) / structure.unit)
            else:
                found += [1 - LEAST_DAMPING - a0, 1 - LEAST_DAMPING + a0]
        return ca.vertcat(*found)


def _polynomials(poles: ComplexArray) -> list[RealArray]:
    """Second-order sections, with real poles in pairs, and one of first order if n is odd."""
    real = np.sort(poles[poles.imag == 0].real)
    found: list[RealArray] = [
        np.array([1.0, -2.0 * p.real, abs(p) ** 2]) for p in poles[poles.imag > 0]
    ]
    found += [np.asarray(np.poly(real[k : k + 2]), float) for k in range(0, real.size, 2)]
    return found


def _sections(poles: ComplexArray) -> RealArray:
    """Coefficients (n,) of the sections, without their leading ones."""
    return np.concatenate([each[1:] for each in _polynomials(poles)])


def _roots(coefficients: RealArray) -> ComplexArray:
    """Poles of sections with these coefficients (n,)."""
    n = coefficients.size
    parts = [np.roots([1.0, *coefficients[k : k + 2]]) for k in range(0, n - n % 2, 2)]
    if n % 2:
        parts.append(-coefficients[-1:])
    return conjugate_pairs(np.concatenate(parts))


def _product(a: Pair, b: Pair) -> Pair:
    """Product of complex columns in parts."""
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]
