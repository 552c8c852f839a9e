"""Tests of the standard assumptions of H-infinity synthesis, one by one.

(A, B2) stabilisable and (C2, A) detectable; D12 of full column and D21 of full row rank; no
invariant zero of (A, B2, C1, D12) or (A, B1, C2, D21) on the imaginary axis (Zhou, Doyle, Glover,
Robust and Optimal Control (1996), section 17.1). A sampled plant is first transformed by s = (z -
1)/(z + 1).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from workbench._core.arrays import EPS, RealArray
from workbench.errors import InputError
from workbench.synthesis.h_infinity.axis_zeros import REFINEMENTS, axis_zeros
from workbench.synthesis.h_infinity.normalised import (
    Scaled,
    SingularPlantError,
    normalised_plant,
)
from workbench.systems.balancing import balanced, balancing, speed
from workbench.systems.bilinear import continuous
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.hidden_states import ZERO_ROUNDING, unstable_modes
from workbench.systems.standard_plant import StandardPlant, standard_plant


class HiddenModeError(InputError):
    """The plant has a mode that is not stable and that no control reaches or no measurement
    shows.
    """


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
        where = _point_text(1j * zeros[0].omega * normal.rate, plant.dt)
        raise SingularPlantError(
            f"(A, B2, C1, D12), u -> z, {on_the_axis} {where}: weigh a signal that moves there, or "
            "ask regularised()"
        )
    zeros = axis_zeros(small.A.T, small.C2.T, small.B1.T, small.D21.T)
    if zeros:
        where = _point_text(1j * zeros[0].omega * normal.rate, plant.dt)
        raise SingularPlantError(
            f"(A, B1, C2, D21), w -> y, {on_the_axis} {where}: let a disturbance or noise act "
            "there, or ask regularised()"
        )
    return normal


def scaled_if_regular(plant: StandardPlant) -> Scaled | None:
    """As `checked`, but None if the plant meets the assumptions only after a perturbation."""
    try:
        return checked(plant)
    except SingularPlantError:
        need_stabilisable(plant)
    return None


def need_all_stabilisable(plants: Sequence[GeneralisedPlant]) -> None:
    """Raise HiddenModeError for the first plant that no controller stabilises; the message has its
    number.
    """
    for number, plant in enumerate(plants, start=1):
        try:
            need_stabilisable(standard_plant(plant))
        except HiddenModeError as error:
            raise HiddenModeError(f"further plant {number}: {error}") from None


def need_stabilisable(plant: StandardPlant) -> None:
    """Raise HiddenModeError for an unstable mode that no control reaches or no measurement
    shows.
    """
    given = continuous(plant)
    rate = speed(given.A, given.B, given.C)
    root = math.sqrt(rate)
    A, B, C = balanced(given.A / rate, given.B / root, given.C / root)
    _need_stabilisable(replace(given, A=A, B=B, C=C), rate, plant.dt)


def _need_stabilisable(scaled: StandardPlant, rate: float, dt: float) -> None:
    """As `need_stabilisable`, for a plant in balanced units; `rate` and `dt` are for messages."""
    advice = "weights must be stable, their integrators moved a little to the left"
    hidden = unreached_mode(scaled.A, scaled.B2)
    if hidden is not None:
        where = _point_text(hidden * rate, dt)
        raise HiddenModeError(
            f"(A, B2) is not stabilisable: no control reaches the mode {where}; {advice}"
        )
    hidden = unreached_mode(scaled.A.T, scaled.C2.T)
    if hidden is not None:
        where = _point_text(hidden * rate, dt)
        raise HiddenModeError(
            f"(C2, A) is not detectable: no measurement shows the mode {where}; {advice}"
        )


def _point_text(s: complex, dt: float) -> str:
    """Text for a point of the transformed s plane, given in the plant's own s or z plane."""
    return f"z = {(1 + s) / (1 - s):.6g}" if dt else f"{s:.6g} rad/s"


def unreached_mode(A: RealArray, B: RealArray) -> complex | None:
    """The first unstable mode that no input reaches (Popov, Belevitch, Hautus); None if there is
    none.

    The states may have been mixed, so rounding is as large as the whole matrix makes it. A mode
    that is much slower than others is still reached if the entries show it.
    """
    size = float(np.linalg.norm(A) or np.linalg.norm(B))  # integrators alone give no size
    rounding = ZERO_ROUNDING * EPS * len(A)
    for mode in unstable_modes(A, 0.0):
        pencil = np.hstack([A - mode * np.eye(len(A)), B])
        near = np.linalg.svd(pencil, compute_uv=False)[-1] <= rounding * size
        if near and not _shown_reached(A, B, mode, rounding):
            return complex(mode)
    return None


def _shown_reached(A: RealArray, B: RealArray, mode: complex, rounding: float) -> bool:
    """Whether the entries of A and B show that inputs reach the modes next to a computed one.

    Rounding changes entry (i, j) of P = [A - mode, B] by at most ``rounding`` sqrt(r_i c_j), where
    r_i and c_j are the largest entries of its row and column. If P X = 1, no such change D lowers
    the rank of P while ``rounding`` sqrt(c)^T |X| sqrt(r) < 1: this bounds the spectral radius
    of |D| |X|. The computed mode is first taken as it is, then at the nearest place where P loses
    rank, unless that is farther away than rounding can have moved the mode.
    """
    n = len(A)
    farthest = rounding * float(np.linalg.norm(A))
    for _ in range(1 + REFINEMENTS):
        pencil = np.hstack([A - mode * np.eye(n), B])
        sizes = np.abs(np.hstack([A, B]))
        sizes[range(n), range(n)] += abs(mode)
        rows, columns = balancing(pencil, 0)
        U, values, Vh = np.linalg.svd(rows[:, None] * pencil * columns, full_matrices=False)
        if not values[-1] > 0.0:
            return False
        with np.errstate(over="ignore", invalid="ignore"):  # too large to show anything
            inverse = np.abs(columns[:, None] * ((Vh.conj().T / values) @ U.conj().T) * rows)
            changed = rounding * np.sqrt(sizes.max(0)) @ inverse @ np.sqrt(sizes.max(1))
        if not changed < 1.0:
            return False
        turn = np.vdot(U[:, -1] * rows, Vh[-1, :n].conj() * columns[:n])
        if not abs(turn) * farthest > values[-1]:
            break
        mode = mode + values[-1] / turn
    return True
