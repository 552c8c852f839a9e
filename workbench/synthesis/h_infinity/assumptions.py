"""The standard assumptions of H-infinity synthesis, tested one by one.

(A, B2) stabilisable and (C2, A) detectable; D12 of full column and D21 of full row rank; no
invariant zero of (A, B2, C1, D12) or (A, B1, C2, D21) on the imaginary axis (Zhou, Doyle, Glover,
Robust and Optimal Control (1996), section 17.1). A sampled plant is tested by s = (z - 1)/(z + 1).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from workbench.arrays import EPS, RealArray
from workbench.errors import InputError
from workbench.input_checks import need_positive
from workbench.synthesis.h_infinity.axis_zeros import axis_zeros
from workbench.synthesis.h_infinity.normalised import (
    Scaled,
    SingularPlantError,
    has_rank,
    normalised_plant,
)
from workbench.systems.balancing import balanced, speed, state_units
from workbench.systems.bilinear import continuous, to_sampled
from workbench.systems.conversion import need_plant
from workbench.systems.frequency_response import frequency_response
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.hidden_states import ZERO_ROUNDING
from workbench.systems.realisation import Matrices, realisation
from workbench.systems.standard_plant import StandardPlant, standard_plant

ADDED = "regular_"
"""How names of the signals begin that `regularised` adds."""


class HiddenModeError(InputError):
    """A mode that is not stable, and that no control reaches or no measurement shows."""


def checked(plant: StandardPlant) -> Scaled:
    """Test every assumption, and return the plant scaled and in continuous time.

    Raises
    ------
    HiddenModeError
        The plant is not stabilisable or not detectable; the message names the mode.
    SingularPlantError
        Another assumption fails; the message names it, the block or frequency, and a remedy.
    """
    try:
        normal = normalised_plant(continuous(plant))
    except InputError as error:
        if not plant.dt:
            raise
        raise type(error)(
            f"{error} (of the sampled plant in s = (z - 1)/(z + 1), where D12 and D21 are the "
            "responses at z = -1)"
        ) from None
    small = normal.plant

    _need_stabilisable(small, normal.rate, plant.dt)
    on_the_axis = "has an invariant zero on the stability boundary, at"
    zeros = axis_zeros(small.A, small.B2, small.C1, small.D12)
    if zeros:
        where = _place(1j * zeros[0].omega * normal.rate, plant.dt)
        raise SingularPlantError(
            f"(A, B2, C1, D12), u -> z, {on_the_axis} {where}: weigh a signal that moves there, or "
            "ask regularised()"
        )
    zeros = axis_zeros(small.A.T, small.C2.T, small.B1.T, small.D21.T)
    if zeros:
        where = _place(1j * zeros[0].omega * normal.rate, plant.dt)
        raise SingularPlantError(
            f"(A, B1, C2, D21), w -> y, {on_the_axis} {where}: let a disturbance or noise act there, "
            "or ask regularised()"
        )
    return normal


def scaled_if_regular(plant: StandardPlant) -> Scaled | None:
    """As `checked`; None where only a perturbation makes the plant meet the assumptions."""
    try:
        return checked(plant)
    except SingularPlantError:
        need_stabilisable(plant)
    return None


def need_stabilisable(plant: StandardPlant) -> None:
    """Raise HiddenModeError for a mode that no control stabilises or no measurement shows."""
    given = continuous(plant)
    rate = speed(given.A, given.B, given.C)
    root = math.sqrt(rate)
    A, B, C = balanced(given.A / rate, given.B / root, given.C / root)
    _need_stabilisable(replace(given, A=A, B=B, C=C), rate, plant.dt)


def _need_stabilisable(scaled: StandardPlant, rate: float, dt: float) -> None:
    """As `need_stabilisable`, of a plant in balanced units; `rate` and `dt` are for messages."""
    advice = "weights must be stable, their integrators moved a little to the left"
    hidden = _unreached(scaled.A, scaled.B2)
    if hidden is not None:
        where = _place(hidden * rate, dt)
        raise HiddenModeError(
            f"(A, B2) is not stabilisable: no control reaches the mode {where}; {advice}"
        )
    hidden = _unreached(scaled.A.T, scaled.C2.T)
    if hidden is not None:
        where = _place(hidden * rate, dt)
        raise HiddenModeError(
            f"(C2, A) is not detectable: no measurement shows the mode {where}; {advice}"
        )


def _place(s: complex, dt: float) -> str:
    """Text for a point of the transformed s plane in the plant's own s or z plane."""
    return f"z = {(1 + s) / (1 - s):.6g}" if dt else f"{s:.6g} rad/s"


def _unreached(A: RealArray, B: RealArray) -> complex | None:
    """The first unstable mode that no input reaches (Popov, Belevitch, Hautus); None if none."""
    size = float(np.linalg.norm(A))
    rounding = ZERO_ROUNDING * EPS * len(A) * size
    for mode in np.linalg.eigvals(A).astype(complex):
        if mode.real < -rounding:
            continue
        pencil = np.hstack([A - mode * np.eye(len(A)), B])
        if np.linalg.svd(pencil, compute_uv=False)[-1] <= rounding:
            return complex(mode)
    return None


def regularised(plant: GeneralisedPlant, size: float) -> GeneralisedPlant:
    """Add small exogenous inputs and performance outputs so that the plant meets the assumptions.

    Where D12 lacks rank, every control becomes a performance output. Where D21 lacks rank, every
    measurement gets noise. Both pass through a first-order high-pass whose corner is the plant's
    fastest pole, so that they have no effect at low frequencies, where weights may integrate. For
    each zero on the stability boundary, performance outputs show the states that move there
    unseen, or disturbances move them (two for a zero other than 0).

    The weight of u is `size` times the largest response of u -> z at the corner, the weight of the
    noise `size` times the largest response of w -> y there. The outputs for a zero are `size` times
    as large as the terms of z that cancel there; where none do, as the largest entry of C1 for
    balanced states (1 if that is zero). The disturbances are as large by w -> y. The closed loop
    contains the old channels, so its norm is at least theirs.

    The new signals come after the old exogenous inputs and performance outputs. Their names are
    ``regular_u0`` (performance), ``regular_y0`` (noise), ``regular_x0`` and so on.

    Raises
    ------
    InputError
        `size` is not positive and finite; or as `standard_plant` and `continuous`.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import hinf, regularised
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> plant = generalised_plant(
    ...     [(G, "u", "x")],
    ...     {"e": "r - x"},
    ...     exogenous=["r"],
    ...     performance=["e"],
    ...     control="u",
    ...     measurement="e",
    ... )
    >>> regular = regularised(plant, 1e-3)  # neither u nor noise stood in the plant
    >>> regular.system.ninputs - plant.system.ninputs, bool(hinf(regular).norm <= 1.1)
    (0, True)
    """
    need_plant(plant)
    need_positive(size, "size")
    given = standard_plant(plant)
    u, x_out = _additions(given, size)
    y, x_in = _additions(given.dual, size)
    a, b, c, d = _high_pass(given)
    (z, w), m, p = given.D11.shape, given.controls, given.measurements
    # Order of the states: plant, high-passes of the controls, high-passes of the noises.
    states, k, j = given.states, len(u), len(y)
    A = block_diag(given.A, a * np.eye(k), a * np.eye(j))
    B = np.zeros((len(A), w + j + len(x_in) + m))
    C = np.zeros((z + k + len(x_out) + p, len(A)))
    D = np.zeros((len(C), B.shape[1]))
    noise, rows = slice(w, w + j), slice(z, z + k)
    B[:states, :w], B[:states, w + j : -m], B[:states, -m:] = given.B1, x_in.T, given.B2
    C[:z, :states], C[z + k : -p, :states], C[-p:, :states] = given.C1, x_out, given.C2
    D[:z, :w], D[:z, -m:], D[-p:, :w], D[-p:, -m:] = given.D11, given.D12, given.D21, given.D22
    out, into = slice(states, states + k), slice(states + k, None)
    B[out, -m:], C[rows, out], D[rows, -m:] = b * u, c * np.eye(k), d * u
    B[into, noise], C[-p:, into], D[-p:, noise] = b * np.eye(j), c * y.T, d * y.T
    system = plant.system
    before, after = list(system.input_labels), list(system.output_labels)
    larger = realisation(
        (A, B, C, D),
        given.dt,
        inputs=[*before[:w], *_names("y", y), *_names("x", x_in), *before[w:]],
        outputs=[*after[:z], *_names("u", u), *_names("x", x_out), *after[z:]],
    )
    return GeneralisedPlant(larger, plant.structure, m, p)


def _additions(given: StandardPlant, size: float) -> tuple[RealArray, RealArray]:
    """Rows that make u and states performance outputs; no rows where not needed."""
    n, m = given.states, given.controls
    plant = continuous(given)
    u = np.zeros((0, m))
    if not has_rank(plant.D12):
        M = np.block([[plant.A, plant.B2], [plant.C1, plant.D12]])
        response = np.abs(frequency_response(M, n, [1j * _fastest(plant.A)])[0]).max(axis=0)
        u = size * np.diag(np.where(response > 0.0, response, response.max() or 1.0))
    Q, R = np.linalg.qr(np.vstack([plant.D12, u]))
    rate = speed(plant.A, plant.B, plant.C)
    # All channels count for the units, those of states that z does not show too.
    factor = state_units(plant.A / rate, plant.B, plant.C)
    A, B2 = plant.A * factor[:, None] / factor, plant.B2 * factor[:, None]
    C1 = np.vstack([plant.C1 / factor, np.zeros((len(u), n))])
    root = math.sqrt(rate)
    zeros = axis_zeros(A / rate, B2 @ np.linalg.inv(R) / root, C1 / root, Q)
    rows = [size * root * zero.outputs * factor for zero in zeros]
    return u, np.vstack([np.zeros((0, n)), *rows])


def _high_pass(given: StandardPlant) -> tuple[float, float, float, float]:
    """A, B, C, D of s / (s + c) with c the size of the plant's fastest pole."""
    corner = _fastest(continuous(given).A)
    one = np.eye(1)
    parts: Matrices = (-corner * one, corner * one, -one, one)
    a, b, c, d = (float(part[0, 0]) for part in (to_sampled(parts) if given.dt else parts))
    return a, b, c, d


def _fastest(A: RealArray) -> float:
    """The magnitude of the largest pole [rad/s]; 1 where all are 0."""
    return float(np.abs(np.linalg.eigvals(A)).max(initial=0.0)) or 1.0


def _names(kind: str, rows: RealArray) -> list[str]:
    """Names of added signals."""
    return [f"{ADDED}{kind}{i}" for i in range(len(rows))]
