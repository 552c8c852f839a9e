"""Design of an input's spectrum that reduces the most costly errors, as a Program.

A record's information about the parameters theta is linear in the powers p_k of the lines,

    M(p) = sum_k p_k M_k,    M_k = 2 Re(conj(g_k) g_k') / v_k,

where g_k holds the derivatives of the response at line k and v_k the variance of the response
measured with unit power. The error of the response at another frequency has, to first order, the
covariance Psi' M^-1 Psi of real and imaginary part, Psi = [Re g, Im g]. The least of the worst
costs c lambda_max(Psi' M^-1 Psi) is a semidefinite program (L. Pronzato, Optimal experimental
design and some related control problems, Automatica 44 (2008) 303-325; X. Bombois, G. Scorletti,
M. Gevers, P. Van den Hof, R. Hildebrand, Least costly identification experiment for control,
Automatica 42 (2006) 1651-1662).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Dataset, Figure
from workbench.answer import ProgramAnswer
from workbench.certificate import Check, relative_excess, worst_value
from workbench.errors import InputError
from workbench.identification.experiments.design_bound import least_cost_bound
from workbench.input_checks import as_array
from workbench.program import Program

LIMIT_ROUNDING = 1e-9
"""Relative excess over a limit that rounding of a sum of powers can cause."""
COST_ROUNDING = 1e-8
"""Relative difference between two computations of the worst cost that rounding can cause."""
LEAST_INFORMATION = 1e-12
"""Least eigenvalue of an information matrix that counts as regular, relative to that of equal
powers.
"""


@dataclass(frozen=True, eq=False, repr=False)
class DesignedSpectrum(ProgramAnswer):
    """Powers (K,) of the lines, and the worst cost that results.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import ExperimentDesign
    >>> variance, cost = [1.0, 4.0], [3.0, 0.5]
    >>> program = ExperimentDesign(
    ...     np.eye(2), variance, np.eye(2), cost
    ... )  # two gains, a line for each
    >>> round(program.spectrum([0.6, 0.4]).worst, 6)  # (3 + 2) / 2
    2.5
    """

    power: RealArray
    worst: float


@dataclass(frozen=True, eq=False)
class ExperimentDesign(Program):
    """The powers of lines that minimise the worst weighted variance of a response.

    Parameters
    ----------
    slopes
        Derivatives (K, P) of the response at the lines with respect to the parameters, complex.
    variance
        Variances (K,) of the response measured with a line of unit power, positive.
    watched
        Derivatives (W, P) of the response at the frequencies that matter, complex.
    cost
        Cost (W,) of a unit of variance there, positive, such as |K S|^2 of a loop.
    uses
        Fractions (R, K) of R limits that a unit of power at each line uses, not negative: the
        powers obey uses p <= 1, and every line uses some limit. None: the total power is 1.

    Raises
    ------
    InputError
        Shapes that do not fit, numbers out of range, or lines that do not determine all parameters.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.identification import ExperimentDesign
    >>> variance, cost = [1.0, 4.0], [3.0, 0.5]
    >>> program = ExperimentDesign(
    ...     np.eye(2), variance, np.eye(2), cost
    ... )  # two gains, a line for each
    >>> solution = wb.solve(program)
    >>> solution.certificate.holds, solution.answer.power.round(2).tolist()  # 3 to 2, as v c is
    (True, [0.6, 0.4])
    """

    slopes: Any
    variance: Any
    watched: Any
    cost: Any
    _: KW_ONLY
    uses: Any = None

    default_method: ClassVar[str] = "clarabel"
    methods_in: ClassVar[tuple[str, ...]] = ("workbench.identification.experiments.design_methods",)
    headline: ClassVar[str] = "worst"

    def __post_init__(self) -> None:
        lines, watched = (
            as_array(getattr(self, name), name, dtype=complex) for name in ("slopes", "watched")
        )
        variance, cost = (as_array(getattr(self, name), name) for name in ("variance", "cost"))
        if lines.ndim != 2 or watched.ndim != 2 or lines.shape[1] != watched.shape[1]:
            raise InputError(
                f"slopes and watched have shapes {lines.shape} and {watched.shape}; (K, P) and "
                "(W, P) are needed"
            )
        uses = np.ones((1, len(lines))) if self.uses is None else as_array(self.uses, "uses")
        shapes = (variance.shape, cost.shape, uses.shape[1:])
        if shapes != ((len(lines),), (len(watched),), (len(lines),)):
            raise InputError(
                f"variance, cost and uses have shapes {variance.shape}, {cost.shape} and "
                f"{uses.shape}; ({len(lines)},), ({len(watched)},) and (R, {len(lines)}) are needed"
            )
        for name, part in (("slopes", lines), ("watched", watched)):
            if not (np.isfinite(part).all() and part.any()):
                raise InputError(f"{name} must be finite, and not all zero")
        for name, part in (("variance", variance), ("cost", cost)):
            if not (np.isfinite(part).all() and (part > 0).all()):
                raise InputError(f"{name} must be positive and finite")
        if not (np.isfinite(uses).all() and (uses >= 0).all() and uses.any(axis=0).all()):
            raise InputError("uses must be finite and not negative; each line must use some limit")
        for name, part in zip(
            ("slopes", "watched", "variance", "cost", "uses"),
            (lines, watched, variance, cost, uses),
            strict=True,
        ):
            object.__setattr__(self, name, part)
        _ = self.frame  # raises if the lines do not determine all parameters

    @cached_property
    def even(self) -> RealArray:
        """Equal powers (K,) of all lines, as large as the limits allow."""
        found: RealArray = np.full(len(self.slopes), 1.0 / self.uses.sum(axis=1).max())
        return found

    @cached_property
    def frame(self) -> RealArray:
        """Matrix F (P, P) with theta = F z, where equal powers inform about all z equally."""
        scaled = self.slopes * np.sqrt(2.0 * self.even / self.variance)[:, None]
        rows = np.concatenate([scaled.real, scaled.imag])
        size = np.linalg.norm(rows, axis=0)
        if not (size > 0).all():
            raise InputError(f"no line tells parameter {int(np.argmin(size))}")
        _, s, Vt = np.linalg.svd(rows / size, full_matrices=False)
        if len(s) < len(size) or s[-1] ** 2 <= LEAST_INFORMATION * s[0] ** 2:
            raise InputError(
                f"the {len(self.slopes)} lines do not tell all {len(size)} parameters, however "
                "large their power"
            )
        found: RealArray = (Vt.T / s) / size[:, None]
        return found

    @cached_property
    def information(self) -> RealArray:
        """M_k (K, P, P) of unit powers, in the frame."""
        rows = self.slopes @ self.frame * np.sqrt(2.0 / self.variance)[:, None]
        found: RealArray = (rows.conj()[:, :, None] * rows[:, None, :]).real
        return found

    @cached_property
    def planes(self) -> RealArray:
        """root(c) [Re g, Im g] (W, P, 2) of the watched frequencies, in the frame."""
        rows = self.watched @ self.frame * np.sqrt(self.cost)[:, None]
        return np.stack([rows.real, rows.imag], axis=-1)

    def _informed(self, power: RealArray) -> RealArray | None:
        """M for given powers; None if there is not one power for each line, or M is singular."""
        if np.shape(power) != (len(self.slopes),) or not np.isfinite(power).all():
            return None
        M: RealArray = np.tensordot(power, self.information, 1)
        return M if np.linalg.eigvalsh(M)[0] > LEAST_INFORMATION else None

    def costs(self, power: RealArray) -> RealArray:
        """Costs (W,) for powers (K,); infinite if the powers do not determine all parameters."""
        M = self._informed(power)
        if M is None:
            return np.full(len(self.planes), np.inf)
        inner = self.planes.mT @ np.linalg.solve(M, self.planes)
        return np.asarray(np.linalg.eigvalsh(inner)[:, -1])

    def spectrum(self, power: RealArray) -> DesignedSpectrum:
        """The answer for a method's powers, scaled up to the limits and clipped at zero."""
        power = np.maximum(np.nan_to_num(power), 0.0)
        used = float((self.uses @ power).max())
        power = power / used if used > 0 else self.even
        return DesignedSpectrum(power, float(self.costs(power).max()))

    # --- objective and checks -------------------------------------------------------------------

    @property
    def quantifier(self) -> str:
        return f"at {len(self.watched)} watched frequencies"

    @property
    def problem_size(self) -> float:
        """Number of lines."""
        return float(len(self.slopes))

    def objective(self, answer: DesignedSpectrum) -> float:
        """The worst cost."""
        return answer.worst

    def checks(self, answer: DesignedSpectrum, tolerance: float) -> Sequence[Check]:
        power = np.asarray(answer.power, float)
        fits = power.shape == (len(self.slopes),) and bool(np.isfinite(power).all())
        statement = "whether the powers are no finite number for each line"
        found = [Check("dimensions", statement, float(not fits), 0.0)]
        if not fits:
            return found
        lines = f"for these {len(power)} lines"
        least, where = worst_value(-power, lambda place: f"of line {place[0] + 1}")
        found.append(
            Check(
                "powers",
                "minus the least power [squared unit of the input]",
                least,
                0.0,
                where=where,
                over=lines,
            )
        )
        used, where = worst_value(self.uses @ power, lambda place: f"of limit {place[0] + 1}")
        statement = "share of a limit that is used, less 1"
        found.append(
            Check("limits", statement, used - 1.0, LIMIT_ROUNDING, where=where, over=lines)
        )
        cost, where = worst_value(self.costs(power), lambda place: f"at frequency {place[0] + 1}")
        statement = "worst cost over the claimed one, less 1"
        off = relative_excess(cost, answer.worst)
        found.append(Check("cost", statement, off, COST_ROUNDING, where=where))
        return found

    def second_opinion(self, answer: DesignedSpectrum) -> Sequence[Check]:
        """The errors themselves: least squares on the lines, without an information matrix."""
        weight = np.sqrt(2.0 * answer.power / self.variance)[:, None]
        rows = np.concatenate([weight * self.slopes.real, weight * self.slopes.imag])
        size = np.maximum(np.linalg.norm(rows, axis=0), np.finfo(float).tiny)
        R = np.asarray(np.linalg.qr(rows / size, mode="r"))
        errors = np.linalg.solve(R.T, (self.watched / size).T)
        planes = np.stack([errors.real, errors.imag], axis=-1)
        largest = np.linalg.norm(planes.transpose(1, 0, 2), 2, axis=(1, 2)) ** 2 * self.cost
        value, where = worst_value(largest, lambda place: f"at frequency {place[0] + 1}")
        statement = "worst cost by least squares over the claimed one, less 1"
        spent = float((self.uses @ np.abs(answer.power)).max()) - 1.0
        return [
            Check("least squares", statement, relative_excess(value, answer.worst), COST_ROUNDING,
            where=where), Check("sizes", "share of a limit that sizes of powers use, less 1", spent,
                  LIMIT_ROUNDING),
        ]  # fmt: skip

    def gap(self, answer: DesignedSpectrum) -> tuple[str, float]:
        statement = "worst cost over the bound by duality, less 1"
        bound = self.dual_bound(answer.power)
        return statement, relative_excess(answer.worst, bound)

    def dual_bound(self, power: RealArray) -> float:
        """Lower bound of the worst cost of any powers, computed at these powers.

        0 if none is found.
        """
        M = self._informed(power)
        return 0.0 if M is None else least_cost_bound(M, self.information, self.planes, self.uses)

    def metrics(self, answer: DesignedSpectrum) -> dict[str, float]:
        return {
            "worst": answer.worst,
            "worst_over_even": answer.worst / float(self.costs(self.even).max()),
            "lines_used": float(np.sum(answer.power > 1e-4 * answer.power.max())),
        }

    # --- datasets and figures -------------------------------------------------------------------

    def to_dataset(self, answer: DesignedSpectrum) -> Dataset:
        import xarray as xr

        unit = {"units": "1"}
        return xr.Dataset(
            {
                "power": ("line", answer.power, unit | {"long_name": "power of a line"}),
                "worst": ((), answer.worst, unit | {"long_name": "worst cost"}),
            }
        )

    def from_dataset(self, data: Dataset) -> DesignedSpectrum:
        return DesignedSpectrum(data["power"].values, float(data["worst"]))

    def figures(self, answer: DesignedSpectrum) -> dict[str, Figure]:
        figure, (left, right) = figures.axes(1, 2, size=(9.0, 4.2))
        number = np.arange(1, len(answer.power) + 1)
        left.vlines(number, 0.0, answer.power, color=figures.BLUE, linewidth=2)
        left.plot(number, self.even, "--", color=figures.ORANGE, label="equal powers")
        figures.label(left, x="line", y="power [1]")
        watched = np.arange(1, len(self.watched) + 1)
        for power, name, colour in (
            (answer.power, "designed", figures.BLUE),
            (self.even, "equal powers", figures.ORANGE),
        ):
            right.semilogy(watched, self.costs(power), color=colour, label=name)
        figures.label(right, x="number of the watched frequency", y="cost [1]")
        figures.legend_below(figure, right)
        return {"spectrum": figure}
