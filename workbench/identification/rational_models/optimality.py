"""Distance of a model from a minimum of its cost, by separate code that no method uses.

Methods move the poles in a basis that is orthonormal over the data. Here the directions of change
of a model are products of its own roots, in Newton's form, and an orthogonal decomposition projects
the residuals on all directions together.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import null_space

from workbench._core.arrays import ComplexArray, RealArray
from workbench.executor.effort import tries
from workbench.fitting.rational import Rational, conjugate_pairs
from workbench.identification.rational_models.model import CommonPoleModel
from workbench.identification.rational_models.structure import ModelStructure

AT_BOUND = 1e-3
"""Distance of a pole from the margin of stability, relative to the margin, below which it is at the
margin.
"""
DEPENDENT = 1e-12
"""Scaled directions count as dependent if a singular value, relative to the largest, is
below this.
"""
NEIGHBOURS = 8
"""Number of models drawn at each distance."""
DISTANCES = (0.01, 0.1, 1.0)
"""Distances of drawn models: changes of the residuals, in standard deviations of one residual."""
PROBE = 1e-6
"""Relative change of the roots that is used to measure the distance of a draw."""


def movement(structure: ModelStructure, model: CommonPoleModel) -> float:
    """Change of the whitened residuals by Newton's step to the optimum within the bounds.

    It is sqrt(g' H^-1 g) with the gradient g and the Gauss-Newton Hessian H: the step's length in
    standard deviations of the estimates.
    """
    data = structure.data
    values = model.response(data.omega)
    residual = _rows(data.whitened(values - data.response))
    directions, poles = model_directions(structure, model, values)
    rows = _rows(data.whitened(directions))
    size = np.linalg.norm(rows, axis=0)
    if not (np.isfinite(rows).all() and np.isfinite(residual).all()):
        return float("nan")
    rows = rows[:, size > 0] / size[size > 0]
    held = _forbidden_motions(structure, model, poles, residual, rows, size > 0, size)
    if held.size:
        rows = rows @ null_space(held)
    u, s, _ = np.linalg.svd(rows, full_matrices=False)
    seen = s > DEPENDENT * s.max(initial=0.0)
    return float(np.linalg.norm(u.T[seen] @ residual))


def model_directions(
    structure: ModelStructure, model: CommonPoleModel, values: ComplexArray
) -> tuple[ComplexArray, slice]:
    """Changes (F, p, m, P) of the response, and a mask of those that change the denominator."""
    data, n = structure.data, model.order
    x = structure.x
    newton = _newton(x, model.poles / structure.unit)
    turn = np.exp(-1j * data.omega[:, None, None] * model.delay)
    parts = []
    for i, j in np.ndindex(model.shape):
        count = structure.degree(i, j, n) + 1
        part = np.zeros((*values.shape, count), complex)
        part[:, i, j] = turn[:, i, j, None] * newton[:, :count]
        parts.append(part)
    before = sum(part.shape[-1] for part in parts)
    parts.append(values[..., None] * newton[:, None, None, :n])
    if structure.free_delay:
        parts.append((data.omega[:, None, None] * 1j * values)[..., None])
    return np.concatenate(parts, axis=-1), slice(before, before + n)


def _newton(x: ComplexArray, poles: ComplexArray) -> ComplexArray:
    """prod_(i < k) (x - root_i) / prod (x - poles), k = 0 ... n, with real coefficients (F, n + 1).

    The roots are the poles in order; for a pair, the first step multiplies by x alone.
    """
    ordered = [*poles[poles.imag == 0], *poles[poles.imag > 0]]
    numerators, so_far = [np.ones_like(x)], np.ones_like(x)
    for root in ordered:
        scale = abs(root) or 1.0
        if root.imag:
            numerators.append(so_far * x / scale)
            so_far = so_far * (x - root) * (x - root.conjugate()) / scale**2
        else:
            so_far = so_far * (x - root) / scale
        numerators.append(so_far)
    found = np.stack(numerators, axis=-1)
    for root in poles:
        found = found / ((x - root) / (abs(root) or 1.0))[:, None]
    return found


def _forbidden_motions(
    structure: ModelStructure,
    model: CommonPoleModel,
    at: slice,
    residual: RealArray,
    rows: RealArray,
    kept: np.ndarray,
    size: RealArray,
) -> RealArray:
    """Rows (h, P) of motions that the bounds forbid and the free step would make."""
    found: list[RealArray] = []
    count = size.size
    step = -np.linalg.lstsq(rows, residual)[0]
    if structure.stable:
        poles = model.poles / structure.unit
        near = structure.distance(poles) <= structure.margin(poles) * (1 + AT_BOUND)
        for k in np.flatnonzero(near & (poles.imag >= 0)):
            # If the response changes by v / d, the denominator d changes by -v.
            others = np.delete(poles, k)
            with np.errstate(all="ignore"):
                slope = _newton_numerators(poles, poles[k]) / np.prod(poles[k] - others)
            turn = 1.0 if structure.sample_time is None else poles[k].conj()
            row = np.zeros(count)
            row[at] = -(turn * slope).real
            if np.isfinite(row).all():
                found.append(row)
    if structure.delay_bounds is not None:
        extra = float(np.mean(model.delay - structure.delay))
        low, high = structure.delay_bounds
        for bound, sign in ((low, -1.0), (high, 1.0)):
            if abs(extra - bound) <= 1e-9 * high:
                row = np.zeros(count)
                row[-1] = sign
                found.append(row)
    scaled = [row[kept] / size[kept] for row in found]
    outward = [row / np.linalg.norm(row) for row in scaled if row @ step < 0]
    return np.array(outward).reshape(len(outward), int(kept.sum()))


def _newton_numerators(poles: ComplexArray, x: complex) -> ComplexArray:
    """The numerators (n,) of `_newton` at one point, divided by the sizes of the poles."""
    ordered = [*poles[poles.imag == 0], *poles[poles.imag > 0]]
    values, so_far = [1.0 + 0j], 1.0 + 0j
    for root in ordered:
        scale = abs(root) or 1.0
        if root.imag:
            values.append(so_far * x / scale)
            so_far = so_far * (x - root) * (x - root.conjugate()) / scale**2
        else:
            so_far = so_far * (x - root) / scale
        values.append(so_far)
    sizes = np.prod([abs(root) or 1.0 for root in poles])
    return np.array(values[:-1]) * sizes


def fall_nearby(
    residual: Callable[[CommonPoleModel], ComplexArray],
    model: CommonPoleModel,
    structure: ModelStructure,
    rng: np.random.Generator,
) -> float:
    """Square root of the largest decrease of the cost at models drawn nearby."""
    here = residual(model)
    cost, best = float(np.sum(np.abs(here) ** 2)), np.inf
    for distance in DISTANCES:
        for _ in range(tries(NEIGHBOURS)):
            way = _drawn_way(model, structure, rng)
            probe = residual(_changed_model(model, structure, way, PROBE))
            speed = float(np.linalg.norm(probe - here)) / PROBE
            if not np.isfinite(speed) or speed == 0:
                continue
            near = residual(_changed_model(model, structure, way, distance / speed))
            best = min(best, float(np.sum(np.abs(near) ** 2)))
    return float(np.sqrt(max(cost - best, 0.0)))


def _drawn_way(
    model: CommonPoleModel, structure: ModelStructure, rng: np.random.Generator
) -> dict[str, Any]:
    """Random relative changes of poles, zeros, gains and delay."""

    def numbers(count: int) -> ComplexArray:
        return rng.standard_normal(count) + 1j * rng.standard_normal(count)

    p, m = model.shape
    return {
        "poles": numbers(model.order),
        "zeros": [[numbers(model.entries[i][j].zeros.size) for j in range(m)] for i in range(p)],
        "gains": rng.standard_normal((p, m)),
        "delay": rng.standard_normal() / structure.data.omega[-1] * structure.free_delay,
    }


def _changed_model(
    model: CommonPoleModel, structure: ModelStructure, way: dict[str, Any], share: float
) -> CommonPoleModel:
    """The model after a fraction of a random change, kept within its bounds."""
    unit = structure.unit
    poles = _moved_roots(model.poles, way["poles"], share)
    poles = structure.allowed(poles / unit) * unit
    entries = []
    for i, row in enumerate(model.entries):
        entries.append(
            [
                Rational(
                    _moved_roots(each.zeros, way["zeros"][i][j], share),
                    poles,
                    each.gain * (1.0 + share * way["gains"][i, j]),
                )
                for j, each in enumerate(row)
            ]
        )
    extra = model.delay - structure.delay + share * way["delay"]
    if structure.delay_bounds is not None:
        extra = np.clip(extra, *structure.delay_bounds)
    return CommonPoleModel(entries, structure.delay + extra, dt=model.dt)


def _moved_roots(roots: ComplexArray, way: ComplexArray, share: float) -> ComplexArray:
    """Roots, moved relative to their sizes; pairs stay pairs, real roots stay real."""
    upper = roots.imag > 0
    real = roots.imag == 0
    size = np.abs(roots) + (np.abs(roots) == 0)
    pairs = roots[upper] + share * size[upper] * way[upper]
    line = roots[real].real + share * size[real] * way[real].real
    return conjugate_pairs(np.concatenate([pairs, pairs.conj(), line.astype(complex)]))


def _rows(values: ComplexArray) -> RealArray:
    """Whitened values (F, p, m, ...) as rows, real parts above imaginary ones."""
    flat = values.reshape(-1, *values.shape[3:])
    return np.concatenate([flat.real, flat.imag])
