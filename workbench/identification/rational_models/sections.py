"""The fit as a nonlinear program in second-order sections of the denominator, by IPOPT.

In the coefficients of its sections c_0 + c_1 x + x^2, a denominator is stable if linear
inequalities hold, in continuous time and in the z-plane; and two real poles become a complex pair
smoothly. The sections are those of `FactoredRational`; only the program around them is here.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.executor import Context
from workbench.fitting.factored import FactoredRational, Pair, complex_product
from workbench.fitting.rational import Rational
from workbench.identification.rational_models.point import FitPoint
from workbench.identification.rational_models.structure import LEAST_DAMPING, LEAST_RATE
from workbench.solvers import in_one_thread, ipopt

PASSES = 4
"""Largest number of runs of IPOPT; each continues with the standard deviations as units."""
SETTLED = 1e-3
"""The passes end when the unknowns, in those units, change by less than this."""
PROXIMAL_CURVATURE = 1e-6
"""Curvature added to the cost in those units, for directions that the data do not determine."""


@in_one_thread
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
        # x has a unit already, so the sections need no level of their own
        start = Rational(np.zeros(0, complex), point.poles, 1.0)
        self.denominator = FactoredRational.of(start, 0, (1.0, 1.0), False, False)
        self.shares = np.concatenate([share for _, share in point.each_share()])
        extra = [point.delay] if self.structure.free_delay else []
        self.start: RealArray = np.concatenate([self.denominator.start[:-1], self.shares, extra])
        count = self.start.size
        with context.stating():
            values = ca.MX.sym("values", count)
            residual = self._residual(ca, values)
            limits = self._limits(ca, values)
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
        delay = float(values[-1]) if self.structure.free_delay else self.point.delay
        return self.denominator.rational(np.array(self._coefficients(values))).poles, delay

    def _coefficients(self, values: Any) -> list[Any]:
        """Parameters of the denominator among the unknowns, with the gain 1."""
        return [*(values[k] for k in range(self.point.poles.size)), 1.0]

    def _residual(self, ca: Any, values: Any) -> Any:
        """Whitened residuals, real parts above imaginary ones."""
        structure, point = self.structure, self.point
        data = structure.data
        parts = structure.x.real, structure.x.imag
        known = self.denominator.products(self.denominator.start, parts)
        now = self.denominator.products(self._coefficients(values), tuple(map(ca.DM, parts)))
        known = 1 / (known[0] + 1j * known[1])
        ratio = complex_product(now, (known.real, known.imag))  # D0 / D
        place, errors = point.poles.size, {}
        for (i, j), share in point.each_share():
            basis = point.basis.values[:, : share.size] * point.turn[:, i, j, None]
            own = values[place : place + share.size]
            place += share.size
            part = (ca.mtimes(ca.DM(basis.real), own), ca.mtimes(ca.DM(basis.imag), own))
            part = complex_product(part, ratio)
            if structure.free_delay:
                angle = -ca.DM(data.omega) * (values[-1] - point.delay)
                part = complex_product(part, (ca.cos(angle), ca.sin(angle)))
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
                part = complex_product(pair, (root[:, a].real, root[:, a].imag))
                total = (total[0] + part[0], total[1] + part[1])
            columns += total
        return columns

    def _limits(self, ca: Any, values: Any) -> Any:
        """Expressions that are nonnegative if the denominator is stable; None if poles are free."""
        structure = self.structure
        if not structure.stable:
            return None
        edge = 1 - LEAST_DAMPING
        rate = LEAST_RATE * float(structure.data.omega[0]) / structure.unit
        found, place = [], 0
        for part in self.denominator.denominators:
            order = len(part.moving)
            c0, c1, _ = part.at([values[place + k] for k in range(order)])
            place += order
            if structure.sample_time is not None:
                if order == 2:
                    found += [edge**2 - c0, edge**2 + edge * c1 + c0, edge**2 - edge * c1 + c0]
                else:
                    found += [edge - c0, edge + c0]
            elif order == 2:
                size = float(np.sqrt(abs(part.coefficients[0])))
                found += [c1 - 2 * max(rate, LEAST_DAMPING * size), c0 - rate**2]
            else:
                found.append(c0 - rate)
        return ca.vertcat(*found)
