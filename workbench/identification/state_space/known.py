"""Known poles and static gains of a plant: checks of the input, and checks of an answer."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.linalg import matrix_balance

from workbench._core.arrays import RealArray
from workbench.certificate import THIS_SYSTEM, Check
from workbench.errors import InputError
from workbench.identification.innovations.knowledge import Knowledge
from workbench.identification.innovations.model import InnovationsModel
from workbench.input_checks import as_array

PAIR_ROUNDING = 1e-9
"""Distance of a pole from the conjugate of another, or from 1, that counts as rounding."""
KNOWN_ROUNDING = 1e-6
"""Largest error of a known pole, and of a known gain relative to itself or to the ratio
of y to u.
"""


def checked_knowledge(poles: Any, gain: Any, nu: int, ny: int) -> Knowledge | None:
    """Known poles and gains as given.

    None if nothing is known; raises `InputError` for bad ones.
    """
    found = _checked_poles(poles)
    if gain is None:
        return Knowledge(found) if found else None
    values = as_array(gain, "static_gain")
    if values.ndim == 0 and nu == ny == 1:
        values = values.reshape(1, 1)
    if values.shape != (ny, nu):
        raise InputError(
            f"static_gain has shape {values.shape}; ({ny}, {nu}) is needed, a row for each output "
            "and a column for each input, NaN where it is unknown"
        )
    if np.isinf(values).any():
        raise InputError(
            "static_gain is infinite; of an integrator give known_poles=[1] and no gain"
        )
    if np.isnan(values).all():
        raise InputError("static_gain is NaN throughout; give at least one gain, or leave it out")
    if any(abs(pole - 1) <= PAIR_ROUNDING for pole in found):
        raise InputError(
            "static_gain is given together with a known pole at 1, an integrator, whose static "
            "gain is infinite; give one of them"
        )
    return Knowledge(found, values)


def _checked_poles(poles: Any) -> tuple[complex, ...]:
    """Poles, with complex ones made exactly conjugate to each other."""
    try:
        values = np.asarray(poles, dtype=complex)
    except (TypeError, ValueError):
        raise InputError(f"known_poles is {poles!r}; a list of numbers is needed") from None
    if values.ndim != 1 or not np.isfinite(values).all():
        raise InputError(
            f"known_poles is {poles!r}; a list of finite numbers is needed, the poles z of the "
            "sampled plant: an integrator is 1"
        )
    for pole in values:
        if abs(pole) <= PAIR_ROUNDING:
            raise InputError(
                "a known pole is 0, which is a delay of one sample; give delay_samples="
            )
    real = [complex(p.real) for p in values if abs(p.imag) <= PAIR_ROUNDING * abs(p)]
    upper = [complex(p) for p in values if p.imag > PAIR_ROUNDING * abs(p)]
    lower = [complex(p) for p in values if p.imag < -PAIR_ROUNDING * abs(p)]
    found = sorted(real, key=lambda p: p.real)
    for pole in upper:
        near = [q for q in lower if abs(q - pole.conjugate()) <= PAIR_ROUNDING * abs(pole)]
        if not near:
            raise InputError(_unpaired(pole))
        lower.remove(near[0])
        found += [pole, pole.conjugate()]
    if lower:
        raise InputError(_unpaired(lower[0]))
    return tuple(found)


def _unpaired(pole: complex) -> str:
    return f"the known pole {pole:.6g} is complex and its conjugate is not given; give both"


def refuse_poles_outside(poles: tuple[complex, ...], allowed: str) -> None:
    """Raise `InputError` for known poles that the argument ``poles`` of a fit does not allow."""
    for pole in poles:
        size = abs(pole)
        if allowed == "stable" and size >= 1 - PAIR_ROUNDING:
            raise InputError(
                f"the known pole {pole:.6g} is not inside the unit circle and poles is "
                '"stable"; give poles="marginal" or "any"'
            )
        if allowed == "marginal" and size > 1 + PAIR_ROUNDING:
            raise InputError(
                f'the known pole {pole:.6g} is outside the unit circle; give poles="any"'
            )


def known_checks(
    known: Knowledge, model: InnovationsModel, name: str, size: RealArray
) -> Iterator[Check]:
    """Checks of a model against the known poles and gains, from its matrices alone.

    ``size`` (ny, nu) are ratios of output spread to input spread, for gains near zero.
    """
    if known.poles:
        errors = [_pole_error(model.A, pole, times) for pole, times in known.groups()]
        worst = int(np.argmax(errors))
        yield Check(
            f"known poles, {name}",
            "singular value of (A - pole)^multiplicity that must vanish, as a distance",
            errors[worst],
            KNOWN_ROUNDING,
            where=f"at the pole {known.groups()[worst][0]:.6g}",
            over=THIS_SYSTEM,
        )
    if known.gain is not None:
        found = model.C @ np.linalg.solve(np.eye(model.order) - model.A, model.B) + model.D
        yield gain_check(f"static gain, {name}", found, known.gain, size)


def gain_check(name: str, found: RealArray, known: RealArray, size: RealArray) -> Check:
    """Check of the known static gains (ny, nu), relative to their sizes (ny, nu)."""
    scale = np.maximum(np.abs(known), size)
    apart = np.where(np.isnan(known), 0.0, np.abs(found - known) / scale)
    o, j = np.unravel_index(int(np.argmax(apart)), apart.shape)
    return Check(
        name,
        "static gain less that given, relative to it or to the spread of y over that of u",
        float(apart[o, j]),
        KNOWN_ROUNDING,
        where=f"from input {j + 1} to output {o + 1}",
        over=THIS_SYSTEM,
    )


def _pole_error(A: RealArray, pole: complex, times: int) -> float:
    """Distance of A from a matrix that has a pole with this multiplicity."""
    if len(A) < times:
        return np.inf
    A = matrix_balance(A, permute=False)[0]
    power = np.linalg.matrix_power(A - pole * np.eye(len(A)), times)
    smallest = float(np.linalg.svd(power, compute_uv=False)[-times])
    return smallest / max(1.0, float(np.linalg.norm(A, 2))) ** times
