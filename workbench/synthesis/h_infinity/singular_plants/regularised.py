"""Plants made regular by small named signals, so that a user can see what is added."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np
from scipy.linalg import block_diag

from workbench._core.arrays import RealArray
from workbench.errors import InputError, SolverError
from workbench.input_checks import need_positive
from workbench.synthesis.h_infinity.assumptions import HiddenModeError, checked
from workbench.synthesis.h_infinity.axis_zeros import axis_zeros
from workbench.synthesis.h_infinity.levels import MIDDLE_POINT
from workbench.synthesis.h_infinity.normalised import (
    Scaled,
    SingularPlantError,
    has_rank,
    normalised_plant,
)
from workbench.synthesis.h_infinity.singular_plants.perturbed import (
    DEFAULT_SIZE,
    made_regular,
    wholly_perturbed,
)
from workbench.systems.balancing import speed, state_units
from workbench.systems.bilinear import continuous, to_sampled
from workbench.systems.conversion import need_plant
from workbench.systems.frequency_response import frequency_response
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import Matrices, realisation
from workbench.systems.standard_plant import StandardPlant, standard_plant

T = TypeVar("T")

NEAR_CORNER = 1e-9
"""The fastest pole counts as on the axis within this distance, relative to its size."""
ADDED = "regular_"
"""Beginning of the names of signals that `regularise` adds."""


def regularise(
    plant: GeneralisedPlant, *by_place: float, size: float = DEFAULT_SIZE
) -> GeneralisedPlant:
    """Add small exogenous inputs and performance outputs so that the plant meets the assumptions.

    Where D12 lacks rank, every control becomes a performance output. Where D21 lacks rank, every
    measurement gets noise. Both pass through a first-order high-pass whose corner is the plant's
    fastest pole, so that they have no effect at low frequencies, where weights may integrate. For
    each zero on the stability boundary, performance outputs show the motion of the states that was
    not seen there, or disturbances cause it (two signals for a zero other than 0).

    The weight of u is `size` times the largest response of u -> z at the corner, and the weight of
    the noise is `size` times the largest response of w -> y there. The outputs for a zero are
    `size` times as large as the terms of z that cancel there. If no terms cancel, they are `size`
    times the largest entry of C1 for balanced states (or `size` if that is zero). Disturbances are
    scaled in the same way by w -> y. The new closed loop contains the old channels, so its norm is
    at least as large as theirs.

    If this is not enough, for example because two controls have the same effect, all controls and
    measurements get weights at every frequency instead, and in case of zeros all balanced states
    get outputs and disturbances. A plant that can be stabilised then meets the assumptions.
    Synthesis perturbs plants by itself; use this function to see the perturbed problem.

    The size may also be given as the second argument, as in earlier versions.

    The new signals come after the old exogenous inputs and performance outputs. Their names are
    ``regular_u0`` (performance), ``regular_y0`` (noise), ``regular_x0`` and so on.

    Raises
    ------
    InputError
        `size` is not positive and finite, or is given twice; or as in `standard_plant` and
        `continuous`.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import hinf, regularise
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
    >>> regular = regularise(plant)  # neither u nor noise stood in the plant
    >>> regular.system.ninputs - plant.system.ninputs, bool(hinf(regular).norm <= 1.1)
    (0, True)
    """
    need_plant(plant)
    if len(by_place) > 1:
        raise InputError(f"regularise takes a plant and one size, not {len(by_place)} sizes")
    size = by_place[0] if by_place else size
    need_positive(size, "size")
    found = narrowly_regularised(plant, size)
    for more in (made_regular, wholly_perturbed):
        try:
            checked(standard_plant(found))
        except SingularPlantError:
            found = _with_added_signals(plant, more(continuous(standard_plant(plant)), size))
        except HiddenModeError:  # the failure has another reason than missing signals
            pass
    return found


def on_regular(plant: GeneralisedPlant, made: Callable[[Scaled], T]) -> T:
    """Apply `made` to the scaled continuous plant; to a perturbed plant if it must be perturbed.

    Steps of iterations use this. Their results are judged with the plant itself afterwards.
    """
    try:
        return made(normalised_plant(standard_plant(plant)))
    except (SingularPlantError, SolverError):
        regular = regularise(plant)
        if regular.system.D.shape == plant.system.D.shape:
            raise
    return made(normalised_plant(standard_plant(regular)))


def narrowly_regularised(
    plant: GeneralisedPlant, size: float, whether_needed: bool = True
) -> GeneralisedPlant:
    """The plant with added signals at high frequencies and for zeros on the stability boundary.

    With ``whether_needed``, the signals at high frequencies are left out if D12 or D21 has full
    rank.
    """
    given = standard_plant(plant)
    u, x_out = _added_rows(given, size, whether_needed)
    y, x_in = _added_rows(given.dual, size, whether_needed)
    a, b, c, d = _high_pass(given)
    (z, w), m, p = given.D11.shape, given.controls, given.measurements
    # Order of states: the plant, the high-passes of the controls, the high-passes of the noises.
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
    return _with_names(plant, (A, B, C, D), j, k)


def _with_added_signals(plant: GeneralisedPlant, larger: StandardPlant) -> GeneralisedPlant:
    """The plant with the additional signals that the larger continuous plant has."""
    given = continuous(standard_plant(plant))
    (z, w), (rows, columns) = given.D11.shape, larger.D11.shape
    costs = given.controls if rows > z and not has_rank(given.D12) else 0
    noises = given.measurements if columns > w and not has_rank(given.D21.T) else 0
    matrices = (larger.A, larger.B, larger.C, larger.D)
    return _with_names(plant, to_sampled(matrices) if plant.system.dt else matrices, noises, costs)


def _with_names(
    plant: GeneralisedPlant, larger: Matrices, noises: int, costs: int
) -> GeneralisedPlant:
    """The larger plant with names; its first new inputs are noises, and its first new outputs costs
    of u.
    """
    system = plant.system
    inputs, outputs = list(system.input_labels), list(system.output_labels)
    w, z = len(inputs) - plant.controls, len(outputs) - plant.measurements
    rows, columns = larger[3].shape
    entering = _names(noises, "y", columns - len(inputs))
    leaving = _names(costs, "u", rows - len(outputs))
    named = realisation(
        larger,
        float(system.dt or 0.0),
        inputs=[*inputs[:w], *entering, *inputs[w:]],
        outputs=[*outputs[:z], *leaving, *outputs[z:]],
    )
    return replace(plant, system=named)


def _added_rows(
    given: StandardPlant, size: float, whether_needed: bool
) -> tuple[RealArray, RealArray]:
    """Rows that make u and states performance outputs; no rows if they are not needed."""
    n, m = given.states, given.controls
    plant = continuous(given)
    u = np.zeros((0, m))
    if not (whether_needed and has_rank(plant.D12)):
        M = np.block([[plant.A, plant.B2], [plant.C1, plant.D12]])
        corner = _fastest_pole(plant.A)
        on_axis = np.isclose(np.linalg.eigvals(plant.A), 1j * corner, rtol=NEAR_CORNER).any()
        at = corner * (MIDDLE_POINT if on_axis else 1j)
        response = np.abs(frequency_response(M, n, [at])[0]).max(axis=0)
        u = size * np.diag(np.where(response > 0.0, response, response.max() or 1.0))
    Q, R = np.linalg.qr(np.vstack([plant.D12, u]))
    rate = speed(plant.A, plant.B, plant.C)
    # All channels determine the units of the states, including states that z does not show.
    factor = state_units(plant.A / rate, plant.B, plant.C)
    A, B2 = plant.A * factor[:, None] / factor, plant.B2 * factor[:, None]
    C1 = np.vstack([plant.C1 / factor, np.zeros((len(u), n))])
    root = math.sqrt(rate)
    zeros = axis_zeros(A / rate, B2 @ np.linalg.inv(R) / root, C1 / root, Q)
    rows = [size * root * zero.outputs * factor for zero in zeros]
    return u, np.vstack([np.zeros((0, n)), *rows])


def _high_pass(given: StandardPlant) -> tuple[float, float, float, float]:
    """A, B, C, D of s / (s + c) with c the size of the plant's fastest pole."""
    corner = _fastest_pole(continuous(given).A)
    one = np.eye(1)
    parts: Matrices = (-corner * one, corner * one, -one, one)
    a, b, c, d = (float(part[0, 0]) for part in (to_sampled(parts) if given.dt else parts))
    return a, b, c, d


def _fastest_pole(A: RealArray) -> float:
    """The magnitude of the largest pole [rad/s]; 1 where all are 0."""
    return float(np.abs(np.linalg.eigvals(A)).max(initial=0.0)) or 1.0


def _names(first: int, kind: str, count: int) -> list[str]:
    """Names of added signals: the first ``first`` are of `kind`, the others of states."""
    named = [f"{ADDED}{kind}{i}" for i in range(first)]
    return [*named, *(f"{ADDED}x{i}" for i in range(count - first))]
