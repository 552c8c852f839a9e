"""The ratio of disturbances to faults in a residual: the index of equation 7.23 of the thesis.

The index of a residual is the largest I = ||G_rd(j omega)|| / ||G_rf(j omega)|| over a range of
frequencies. The printed denominator lacks the residual generator. It has the factor H_photo K_optFn
like the numerator, so both are meant as gains to the residual.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvals

from workbench._core.arrays import Array
from workbench._core.heavy_types import Dataset, StateSpace
from workbench.answer import Answer, RepeatedChecker
from workbench.certificate import Check
from workbench.diagnosis.generators.generator import residual_response, structure_matrix
from workbench.diagnosis.models.detectability import need_faults
from workbench.diagnosis.models.fault_model import FaultModel
from workbench.errors import InputError, SolverError, UnknownNameError
from workbench.executor.effort import tries
from workbench.input_checks import need_positive
from workbench.second_opinion.loops import SAMPLED_ROUNDING
from workbench.solvers import slicot_routine
from workbench.systems.balancing import balanced, balancing
from workbench.systems.bilinear import to_continuous
from workbench.systems.generalised_plant import response
from workbench.systems.range_hints import warn_far_frequencies

NUMBERS = ("lower", "upper", "omega")
"""Names of the numbers of each residual in a `PerformanceIndex`."""
SAMPLED_FREQUENCIES = 500
"""Frequencies at which a check tries an index."""
FIRST_FREQUENCIES = 60
"""Number of frequencies with which the search starts."""
MOST_LEVELS = 60
"""Largest number of levels that are tried."""
AXIS_DISTANCE_SHARE = 1e-6
"""A zero counts as on the imaginary axis if it is nearer to it than this share of its size."""
CANCELLED_SHARE = 1e-10
"""A gain from disturbances counts as 0 up to this share of the terms that cancel in it."""
VANISHED_GAIN_SHARE = 1e-6
"""At a zero on the axis, a gain from the faults counts as 0 below this share of the largest."""


@dataclass(frozen=True, eq=False, repr=False)
class PerformanceIndex(Answer):
    """Bounds of every residual's index; ``lower`` is its value at ``omega`` [rad/s].

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import FaultModel, null_space_generator, performance_index
    >>> plant = control.ss(-1.0, [[1.0, 0.0]], 1.0, [[0.0, 0.1]], inputs=["f", "n"])
    >>> model = FaultModel(plant, faults=("f",), noise=("n",))
    >>> found = performance_index(null_space_generator(model, poles=-2.0).Q, model, band=(0.1, 1.0))
    >>> round(float(found.omega[0]), 3), bool(found.lower[0] <= found.upper[0])
    (1.0, True)
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    omega: NDArray[np.float64]


def performance_index(
    Q: StateSpace,
    model: FaultModel,
    band: tuple[float, float],
    *,
    disturbances: Sequence[str] | None = None,
    faults: Sequence[str] | None = None,
    tolerance: float = 1e-3,
) -> PerformanceIndex:
    """The largest ratio of disturbances to faults in each residual over a range of frequencies.

    ``upper`` is certified between grid points as well: at this level the spectrum
    upper^2 G_f G_f* - G_d G_d* of a residual has no zero in the range. Zeros are eigenvalues of its
    system pencil; if there is one in the range, the level rises, as in the computation of the norm
    by Bruinsma and Steinbuch, Systems and Control Letters 14 (1990).

    Parameters
    ----------
    Q
        The filter of r = Q [y; u], as `ResidualGenerator.Q`.
    band
        Two frequencies [rad/s], 0 < low < high, below pi / dt where sampled.
    disturbances, faults
        Names of inputs, whose weights are in the model. None: the model's disturbances and noise;
        all its faults.
    tolerance
        Relative distance of ``upper`` from ``lower``.

    Returns
    -------
    PerformanceIndex
        The index is infinite if the faults vanish at a frequency of the range and disturbances do
        not, and 0 if disturbances are decoupled.

    Raises
    ------
    UnknownNameError
        The model has no such fault or disturbance.
    InputError
        The band is not a range of frequencies; there is no fault or no disturbance; a residual
        shows none of the faults; as `generator.transfer`.
    SolverError
        The level does not settle.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import FaultModel, null_space_generator, performance_index
    >>> plant = control.ss(-1.0, [[1.0, 0.0]], 1.0, [[0.0, 0.1]], inputs=["f", "n"])
    >>> model = FaultModel(plant, faults=("f",), noise=("n",))
    >>> Q = null_space_generator(model, poles=-2.0).Q
    >>> found = performance_index(Q, model, band=(0.1, 1.0))
    >>> round(float(found.upper[0]), 3)  # 0.1 |1 + j omega| at omega = 1, rounded outward
    0.142
    """
    need_positive(tolerance, "tolerance")
    checker = index_checker(
        Q, model, band, disturbances=disturbances, faults=faults, tolerance=tolerance
    )
    return checker.again().with_checker(checker)


def index_checker(
    Q: StateSpace,
    model: FaultModel,
    band: tuple[float, float],
    *,
    disturbances: Sequence[str] | None = None,
    faults: Sequence[str] | None = None,
    tolerance: float = 1e-3,
) -> IndexChecker:
    """The checker that certifies the answer of `performance_index` to the same question.

    Parameters
    ----------
    Q, model, disturbances, faults, tolerance
        As given to `performance_index`.
    band
        Two frequencies [rad/s], as given to it.

    Raises
    ------
    UnknownNameError, InputError
        As `performance_index`.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import FaultModel, index_checker, null_space_generator
    >>> from workbench.diagnosis import performance_index
    >>> plant = control.ss(-1.0, [[1.0, 0.0]], 1.0, [[0.0, 0.1]], inputs=["f", "n"])
    >>> model = FaultModel(plant, faults=("f",), noise=("n",))
    >>> question = null_space_generator(model, poles=-2.0).Q, model, (0.1, 1.0)
    >>> index_checker(*question).certify(performance_index(*question), 1e-6).holds
    True
    """
    need_faults(model)
    over = tuple(model.faults if faults is None else faults)
    under = (*model.disturbances, *model.noise) if disturbances is None else tuple(disturbances)
    low, high = _band(model, band)
    for name in over:
        if name not in model.faults:
            raise UnknownNameError("fault", name, model.faults)
    if not (over and under):
        raise InputError("the index needs one fault and one disturbance or noise input at least")
    shown = structure_matrix(Q, model)[:, [model.faults.index(name) for name in over]].any(axis=1)
    if not shown.all():
        raise InputError(f"residual {int(shown.argmin()) + 1} shows none of {', '.join(over)}")

    def found() -> PerformanceIndex:
        residuals = range(int(Q.noutputs))
        rows = [_peak(Q, model, i, over, under, low, high, tolerance) for i in residuals]
        return PerformanceIndex(*np.array(rows).T)

    words = f"at every frequency from {low:.6g} to {high:.6g} rad/s"
    return IndexChecker(found, words, Q, model, band, under, over)


@dataclass(frozen=True, eq=False)
class IndexChecker(RepeatedChecker):
    """Computes the index again, and tries it at frequencies between its ends."""

    Q: StateSpace
    model: FaultModel
    band: tuple[float, float]
    disturbances: tuple[str, ...]
    faults: tuple[str, ...]

    def stored_answer(self, name: str, answer: PerformanceIndex) -> dict[str, Any]:
        return {f"{name}_{one}": (f"{name}_residual", getattr(answer, one)) for one in NUMBERS}

    def restored_answer(self, name: str, data: Dataset) -> PerformanceIndex | None:
        if f"{name}_lower" not in data:
            return None
        return PerformanceIndex(*(data[f"{name}_{one}"].values for one in NUMBERS))

    def second_opinion(self, answer: PerformanceIndex) -> list[Check]:
        omega = np.geomspace(*_band(self.model, self.band), tries(SAMPLED_FREQUENCIES))
        top, bottom = (
            np.linalg.norm(residual_response(self.Q, self.model, names, omega), axis=2)
            for names in (self.disturbances, self.faults)
        )
        ratio = np.max(top / bottom, axis=0) / answer.upper
        largest = float(np.max(ratio, initial=0.0, where=answer.upper > 0)) - 1.0
        statement = "largest ratio over the claimed bound, less 1"
        over = f"at {omega.size} frequencies"
        return [Check("sampled ratio", statement, largest, SAMPLED_ROUNDING, over=over)]


def _peak(
    Q: StateSpace,
    model: FaultModel,
    residual: int,
    faults: Sequence[str],
    disturbances: Sequence[str],
    low: float,
    high: float,
    tolerance: float,
) -> tuple[float, float, float]:
    """The lower and upper bound of a residual's index, and the frequency of the lower one."""

    def ratio(omega: Array) -> Array:
        top = np.linalg.norm(residual_response(Q, model, disturbances, omega)[:, residual], axis=1)
        return top / fault_gain(omega)

    def fault_gain(omega: Array) -> Array:
        return np.linalg.norm(residual_response(Q, model, faults, omega)[:, residual], axis=1)

    omega = np.geomspace(low, high, FIRST_FREQUENCIES)
    values = ratio(omega)
    best, at = float(values.max()), float(omega[values.argmax()])
    terms = np.linalg.norm(_terms(Q, model, disturbances, omega)[:, residual], axis=1)
    rounding = CANCELLED_SHARE * float((terms / fault_gain(omega)).max())
    if best < rounding:
        return 0.0, rounding, at
    both = (*faults, *disturbances)
    sizes = np.abs(residual_response(Q, model, both, omega)[:, residual]).max(axis=0)
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    units = sizes[: len(faults)]
    vanish = _axis_zeros(_residual_system(Q, model, residual, faults, units), units**2, model.dt)
    vanish = vanish[(vanish >= low) & (vanish <= high)]
    if vanish.size:
        least = fault_gain(vanish)
        if least.min() < VANISHED_GAIN_SHARE * fault_gain(omega).max():
            return np.inf, np.inf, float(vanish[least.argmin()])
    system = _residual_system(Q, model, residual, both, sizes)
    for _ in range(MOST_LEVELS):
        level = (1.0 + tolerance) * best
        # divided by level^2 the spectrum has a pencil with entries of one size
        weights = np.array([1.0] * len(faults) + [-1.0 / level**2] * len(disturbances))
        zeros = _axis_zeros(system, weights * sizes**2, model.dt)
        inside = np.sort(zeros[(zeros > low) & (zeros < high)])
        if not inside.size:
            return best, level, at
        edges = np.concatenate([[low], inside, [high]])
        tried = np.unique(np.concatenate([np.sqrt(edges[1:] * edges[:-1]), inside]))
        values = ratio(tried)
        if values.max() <= best:
            # Near a narrow peak, zeros beside the axis may be included too. All true zeros are
            # among them, and between neighbouring ones the index does not exceed the level.
            return best, level, at
        best, at = float(values.max()), float(tried[values.argmax()])
    raise SolverError(f"the index of residual {residual + 1} does not settle; give a narrower band")


def _terms(Q: StateSpace, model: FaultModel, names: Sequence[str], omega: Array) -> Array:
    """Bounds (F, r, k) of the terms of which the gains from inputs of the model are sums.

    Rounding may also have left small entries in Q. So Q and the signals [y; u] are bounded by
    norms, with y and u in units in which all inputs of the model move them alike.
    """
    labels = list(model.system.input_labels)
    into = np.array([[name == u for name in labels] for u in model.controls], dtype=float)
    into = np.broadcast_to(into.reshape(-1, len(labels)), (len(omega), len(into), len(labels)))
    signals = np.concatenate([np.abs(model.response(labels, omega)), into], axis=1)
    units = balancing(signals.max(axis=0), 0)[0]
    through = np.linalg.norm(response(Q, omega) / units, axis=2)
    moved = np.linalg.norm(units[:, None] * signals, axis=1)
    chosen: Array = moved[:, [labels.index(name) for name in names]]
    return through[:, :, None] * chosen[:, None]


def _residual_system(
    Q: StateSpace, model: FaultModel, residual: int, names: Sequence[str], units: Array
) -> tuple[Array, ...]:
    """A, B, C, D from inputs of the model, divided by units, to one residual, without modes that
    cancel.
    """
    import control

    B, D = model.matrices(names)
    p = len(model.outputs)
    plant = control.StateSpace(model.system.A, B, model.system.C, D, remove_useless_states=False)
    row = control.StateSpace(
        Q.A, Q.B[:, :p], Q.C[[residual]], Q.D[[residual], :p], remove_useless_states=False
    )
    into = np.array([[name == u for name in names] for u in model.controls], dtype=float)
    from_u = into.reshape(len(model.controls), len(names))
    n, k = int(plant.nstates), int(row.nstates)
    matrices = (
        np.block([[plant.A, np.zeros((n, k))], [row.B @ plant.C, row.A]]),
        np.vstack([plant.B, row.B @ plant.D + Q.B[:, p:] @ from_u]),
        np.hstack([row.D @ plant.C, row.C]),
        row.D @ plant.D + Q.D[[residual], p:] @ from_u,
    )
    A, B, C, D = matrices
    B, D = B / units, D / units
    return _minimal(*balanced(A, B, C), D)


def _minimal(A: Array, B: Array, C: Array, D: Array) -> tuple[Array, ...]:
    """The controllable and observable part of a system, by SLICOT TB01PD."""
    tb01pd = slicot_routine("tb01pd")

    n, m, p = len(A), B.shape[1], len(C)
    if not n:
        return A, B, C, D
    wide = max(m, p)
    B_wide, C_wide = np.zeros((n, wide)), np.zeros((wide, n))
    B_wide[:, :m], C_wide[:p] = B, C
    A, B_wide, C_wide, order = tb01pd(n, m, p, A, B_wide, C_wide, job="M", equil="S", tol=1e-10)
    return A[:order, :order], B_wide[:order, :m], C_wide[:p, :order], D


def _axis_zeros(system: tuple[Array, ...], weights: Array, dt: float) -> Array:
    """Frequencies [rad/s] of the zeros of N J N~ on the stability boundary.

    N is the system, J = diag(weights), N~ its para-Hermitian conjugate.
    """
    A, B, C, D = to_continuous(system) if dt else system  # type: ignore[arg-type]
    n, J = len(A), np.diag(weights)
    spectrum = np.block(
        [
            [A, B @ J @ B.T, B @ J @ D.T],
            [np.zeros((n, n)), -A.T, -C.T],
            [C, D @ J @ B.T, D @ J @ D.T],
        ]
    )
    E = np.diag([1.0] * (2 * n) + [0.0])
    zeros = eigvals(spectrum, E)
    zeros = zeros[np.isfinite(zeros)]
    found = np.abs(zeros.imag[np.abs(zeros.real) <= AXIS_DISTANCE_SHARE * np.abs(zeros)])
    # s = (z - 1) / (z + 1) takes exp(j omega dt) to j tan(omega dt / 2)
    return 2.0 / dt * np.arctan(found) if dt else found


def _band(model: FaultModel, band: tuple[float, float]) -> tuple[float, float]:
    values = np.asarray(band, dtype=float).reshape(-1)
    if values.size != 2 or not np.isfinite(values).all() or not 0.0 < values[0] < values[1]:
        raise InputError(f"band is {band!r}; it must be two frequencies [rad/s], 0 < low < high")
    if model.dt and values[1] >= np.pi / model.dt:
        raise InputError(
            f"band goes to {values[1]:.6g} rad/s, beyond pi / dt = {np.pi / model.dt:.6g}"
        )
    warn_far_frequencies(values, model.system)
    return float(values[0]), float(values[1])
