"""Poles of weights on the stability boundary, moved into the controller.

An integrator in the weight of an error is a mode that no measurement shows, so no controller
stabilises it. If a measurement y drives it, xi' = Lambda xi + L y + M u, then the controller can
hold a copy of the mode, which knows xi from the start. It remains to find a controller of

    y' = y + F xi,    Lambda - L F stable,

where y' shows xi. No information is lost: y follows from y', u and a stable system. The controller
of the given plant has the poles of Lambda (internal model principle). The certified loop contains
xi only once, in the controller, where it drives the performance outputs: the pole that weight and
controller share is cancelled by construction. The other states are those of the controller's loop
with the plant without these weights, so the stability that is certified is the stability of that
loop.

The state that a measurement drives may also be xi + T x with other states x. Modes that no control
reaches, such as those of disturbances that are integrated noise, are treated in the same way with
the transposed plant: their effect must be that of a control.

B. A. Francis, W. M. Wonham, The internal model principle of control theory, Automatica 12 (1976)
457-465.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench._core.arrays import EPS, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.synthesis.h_infinity.assumptions import HiddenModeError, scaled_if_regular
from workbench.synthesis.h_infinity.normalised import Scaled
from workbench.synthesis.h_infinity.singular_plants.shared_poles import (
    HiddenPoleError,
    Shared,
    modes_shown,
)
from workbench.systems.bilinear import continuous, to_sampled
from workbench.systems.generalised_plant import GeneralisedPlant, response
from workbench.systems.realisation import realisation
from workbench.systems.standard_plant import StandardPlant, standard_plant

RESPONSE_ROUNDING = 1e5
"""Rounding errors of the terms of a response, in units of the machine epsilon. They are large
because controllers of nearly singular plants have poles of very different sizes.
"""
POLE_DISTANCE = 1e-5
"""A pole within this distance of a frequency, relative to it, spoils responses by cancellation."""


@dataclass(frozen=True, eq=False)
class Absorbed:
    """The ``plant`` that remains to be controlled, and the copies of modes that the controller
    holds.

    Each of ``copies`` is a generalised plant with inputs (y, u') and outputs (u, y'). The next
    copy, or at the end the controller of ``plant``, closes it. ``poles`` are the shared poles, in
    the s or z plane of the plant.
    """

    plant: GeneralisedPlant
    copies: tuple[GeneralisedPlant, ...] = ()
    poles: tuple[complex, ...] = ()

    @property
    def words(self) -> str:
        """A sentence about the shared poles."""
        poles = ", ".join(f"{pole:.4g}" for pole in self.poles)
        return (
            f"shared with the controller: {poles}, poles on the stability boundary of the plant, "
            "taken for those of weights; stability is that of the loop without them"
        )

    def whole(self, K: StateSpace) -> StateSpace:
        """The controller of the given plant from a controller of ``plant``."""
        for copy in reversed(self.copies):
            K = copy.close(K)
        return K


def absorbed(plant: GeneralisedPlant) -> Absorbed:
    """The plant without the hidden modes on the stability boundary that a controller can share.

    Raises
    ------
    HiddenModeError
        The plant has a hidden mode beyond the stability boundary, or one on it that no controller
        can share; the message says which, and why.
    """
    given = standard_plant(plant)
    seen = _with_modes_shown(continuous(given), given.dt, "measurement")
    copied = 0 if seen.copy is None else seen.copy.states
    reached = _with_modes_shown(seen.plant.dual, given.dt, "control", copied)
    poles = seen.poles + reached.poles
    if not poles:
        return Absorbed(plant)
    copies = (seen.copy, None if reached.copy is None else reached.copy.dual)
    parts = reached.plant.dual
    matrices = (parts.A, parts.B, parts.C, parts.D)
    system = realisation(
        to_sampled(matrices) if given.dt else matrices,
        given.dt,
        inputs=list(plant.system.input_labels),
        outputs=list(plant.system.output_labels),
    )
    return Absorbed(
        replace(plant, system=system),
        tuple(_system(copy, given.dt) for copy in copies if copy is not None),
        tuple(_in_given_plane(pole, given.dt) for pole in poles),
    )


def tested(plant: GeneralisedPlant, asked: Sequence[str] = ()) -> tuple[Absorbed, Scaled | None]:
    """The plant without modes that the controller shares, and scaled where it is regular.

    ``asked`` names the demands on the controller. They leave no room for poles of weights.

    Raises
    ------
    HiddenModeError
        A mode that the controller cannot share is not stabilisable or not detectable.
    InputError
        Poles must be shared, but there are demands on the controller.
    """
    try:
        return Absorbed(plant), scaled_if_regular(standard_plant(plant))
    except HiddenModeError:
        shared = absorbed(plant)
    if asked:
        poles = ", ".join(f"{pole:.4g}" for pole in shared.poles)
        raise InputError(
            f"weights have poles on the stability boundary ({poles}), which the controller then "
            f"has besides; so {' and '.join(asked)} cannot be given: move these poles a little to "
            "the left"
        )
    return shared, scaled_if_regular(standard_plant(shared.plant))


def loop_gains(plant: GeneralisedPlant, K: StateSpace, omega: RealArray) -> RealArray:
    """Largest singular values (F,) of a loop from responses of plant and K, less their rounding
    errors.
    """
    P, k = plant.response(omega), response(K, omega)
    z, w = P.shape[-2] - plant.measurements, P.shape[-1] - plant.controls
    inner = np.eye(plant.measurements) - P[:, z:, w:] @ k
    moved = k @ np.linalg.solve(inner, P[:, z:, :w])
    closed = P[:, :z, :w] + P[:, :z, w:] @ moved
    direct, through, inward, size = (
        np.linalg.norm(part, 2, axis=(-2, -1))
        for part in (P[:, :z, :w], P[:, :z, w:], moved, closed)
    )
    # Large terms cancel. Those of the inner loop have errors proportional to its condition number.
    terms = direct + through * inward * np.linalg.cond(inner)
    lower: RealArray = np.maximum(size - RESPONSE_ROUNDING * EPS * terms, 0.0)
    return lower


def between_poles(omega: RealArray, plant: GeneralisedPlant, K: StateSpace) -> RealArray:
    """The frequencies at which no pole of plant or K spoils responses by cancellation."""
    poles = np.concatenate([plant.system.poles(), K.poles()])
    dt = plant.system.dt or 0.0
    points = np.exp(1j * omega * dt) if dt else 1j * omega
    apart = np.abs(points[:, None] - poles).min(axis=1, initial=np.inf)
    kept: RealArray = omega[apart > POLE_DISTANCE * np.abs(points)]
    return kept


def _system(copy: StandardPlant, dt: float) -> GeneralisedPlant:
    matrices = (copy.A, copy.B, copy.C, copy.D)
    system = realisation(to_sampled(matrices) if dt else matrices, dt)
    return GeneralisedPlant(system, None, copy.controls, copy.measurements)


def _in_given_plane(pole: complex, dt: float) -> complex:
    """A pole of the transformed plant, in the s or z plane of the given plant."""
    return complex((1 + pole) / (1 - pole)) if dt else complex(pole)


def _pole_text(pole: complex, dt: float) -> str:
    return f"z = {pole:.6g}" if dt else f"{pole:.6g} rad/s"


def _with_modes_shown(plant: StandardPlant, dt: float, through: str, copied: int = 0) -> Shared:
    """As `modes_shown`; `dt` and `through` are for messages. `through` is "measurement" or
    "control".
    """
    try:
        return modes_shown(plant, copied)
    except HiddenPoleError as error:
        where, unstable = _pole_text(_in_given_plane(error.pole, dt), dt), error.unstable
    if through == "measurement":
        fails = "(C2, A) is not detectable: no measurement shows the mode"
        why = "no measurement drives it alone"
        remedy = "weigh a signal that is measured, or move the pole to the left"
    else:
        fails = "(A, B2) is not stabilisable: no control reaches the mode"
        why = "its effect is not that of a control"
        if copied:
            why = f"a zero of the plant cancels it, or {why}"
        remedy = "move the pole to the left"
    if unstable:
        raise HiddenModeError(
            f"{fails} {where}; weights must be stable, except for poles on the stability boundary"
        )
    raise HiddenModeError(
        f"{fails} {where}, and {why}, so no controller can hold it in place of a weight: {remedy}"
    )
