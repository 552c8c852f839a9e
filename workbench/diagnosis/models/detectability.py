"""Which faults can be detected and isolated, and by which structures of residuals.

Fault j is detectable (thesis, equation 7.11) if some residual reacts to the fault but not to
controls and disturbances: generically, rank [G_d g_j] > rank G_d. It is
strongly detectable (7.12) at a frequency where its response there can be made nonzero, by a stable
generator, so that a lasting fault of that frequency has a lasting effect; equation 7.12 is
omega = 0. If other faults count as disturbances, the same tests tell which faults can be isolated
and which rows of a structure matrix are attainable (Varga, Solving Fault Diagnosis
Problems (2017), section 3.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.diagnosis.models.decoupling import GENERIC_RANK_SHARE, Parity, scaled_response
from workbench.diagnosis.models.fault_model import FaultModel
from workbench.errors import InputError, UnknownNameError
from workbench.input_checks import as_array
from workbench.systems.range_hints import warn_far_frequencies

FAULT_EFFECT_SHARE = 1e-7
"""The effect of a fault on the rows counts as 0 below this share of its effect on the outputs."""
MOST_FAULTS = 12
"""Largest number of faults whose structures are enumerated."""


@dataclass(frozen=True, eq=False)
class Detectability:
    """Whether each fault is detectable generically (weak), and at each frequency (strong).

    ``weak`` (k,) and ``strong`` (k, F) are booleans, ``omega`` (F,) are frequencies [rad/s].
    ``remaining`` (k,) is the share of the fault's response that the disturbances do not span, at
    random points of the s-plane. ``masked_by`` has, for a fault that is not detectable, a least set
    of disturbances that hide it: none of them can be left out.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import FaultModel, detectability
    >>> A, B = [[-1.0, 0.0], [0.0, -2.0]], [[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]
    >>> plant = control.ss(A, B, np.eye(2), 0.0, inputs=["u", "d", "f"], outputs=["y1", "y2"])
    >>> model = FaultModel(plant, controls=("u",), disturbances=("d",), faults=("f",))
    >>> found = detectability(model, omega=[0.0, 1.0])
    >>> found.faults, found.weak.tolist(), found.strong.tolist()
    (('f',), [True], [[True, True]])
    """

    faults: tuple[str, ...]
    omega: NDArray[np.float64]
    weak: NDArray[np.bool_]
    strong: NDArray[np.bool_]
    remaining: NDArray[np.float64]
    masked_by: tuple[tuple[str, ...], ...]


def detectability(
    model: FaultModel, *, omega: ArrayLike = 0.0, decoupled: Sequence[str] = ()
) -> Detectability:
    """Weak and strong detectability of a model's faults.

    Parameters
    ----------
    model
        With one fault at least.
    omega
        Frequencies [rad/s] of the strong test; up to pi / dt for a sampled model.
    decoupled
        Faults that count as disturbances; they are not in the result.

    Raises
    ------
    InputError
        No fault is left; frequencies are negative or not finite.
    UnknownNameError
        A name in `decoupled` is not that of a fault.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import FaultModel, detectability
    >>> A, B = [[-1.0, 0.0], [0.0, -2.0]], [[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]
    >>> plant = control.ss(A, B, np.eye(2), 0.0, inputs=["u", "d", "f"], outputs=["y1", "y2"])
    >>> model = FaultModel(plant, controls=("u",), disturbances=("d",), faults=("f",))
    >>> detectability(
    ...     model, omega=0.0
    ... ).strong.tolist()  # y1 shows the fault without the disturbance
    [[True]]
    """
    need_faults(model)
    at = frequencies(model, omega)
    model.columns(decoupled)
    for name in decoupled:
        if name not in model.faults:
            raise UnknownNameError("fault", name, model.faults)
    faults = tuple(name for name in model.faults if name not in decoupled)
    if not faults:
        raise InputError("every fault is decoupled; one to be detected is needed")
    parity = Parity(model, (*model.disturbances, *decoupled))
    remaining = _share_outside_span(parity, faults)
    weak = remaining > GENERIC_RANK_SHARE
    strong = np.zeros((len(faults), at.size), dtype=bool)
    if weak.any() and at.size:
        strong = weak[:, None] & _basis_shows(parity, faults, at)
    masks = tuple(
        () if seen else masking_inputs(model, name, parity.decoupled)
        for name, seen in zip(faults, weak, strict=True)
    )
    return Detectability(faults, at, weak, strong, remaining, masks)


def masking_inputs(model: FaultModel, fault: str, among: Sequence[str]) -> tuple[str, ...]:
    """A smallest subset of the inputs `among` that hides a fault: none of them can be left out.

    It is empty if the fault moves no output at all. Raises InputError if the inputs do not hide
    the fault.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import FaultModel, masking_inputs
    >>> plant = control.ss(-1.0, [[1.0, 1.0]], 1.0, 0.0, inputs=["d", "f"])
    >>> masking_inputs(FaultModel(plant, disturbances=("d",), faults=("f",)), "f", ["d"])
    ('d',)
    """
    need_faults(model)
    kept = list(among)
    if _share_outside_span(Parity(model, tuple(kept)), [fault])[0] > GENERIC_RANK_SHARE:
        raise InputError(f"{', '.join(among) or 'nothing'} does not hide the fault {fault!r}")
    for name in among:
        fewer = [other for other in kept if other != name]
        if _share_outside_span(Parity(model, tuple(fewer)), [fault])[0] <= GENERIC_RANK_SHARE:
            kept = fewer
    return tuple(kept)


def isolability(model: FaultModel) -> NDArray[np.bool_]:
    """Whether fault i (row) can be detected with fault j (column) decoupled: (k, k).

    On the diagonal all other faults are decoupled at once. If the diagonal is True everywhere, all
    faults can be isolated even if they occur together.

    Raises InputError without a fault.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import FaultModel, isolability
    >>> plant = control.ss(-np.eye(2), np.eye(2), np.eye(2), 0.0, inputs=["f1", "f2"])
    >>> model = FaultModel(plant, faults=("f1", "f2"))
    >>> isolability(model).tolist()
    [[True, True], [True, True]]
    """
    need_faults(model)
    faults = model.faults
    found = np.zeros((len(faults), len(faults)), dtype=bool)
    for k, other in enumerate(faults):
        parity = Parity(model, (*model.disturbances, other))
        found[:, k] = _share_outside_span(parity, faults) > GENERIC_RANK_SHARE
        rest = tuple(name for name in faults if name != other)
        alone = Parity(model, (*model.disturbances, *rest))
        found[k, k] = _share_outside_span(alone, [other])[0] > GENERIC_RANK_SHARE
    return found


def attainable_structures(
    model: FaultModel, *, omega: ArrayLike | None = None
) -> NDArray[np.bool_]:
    """The attainable rows (R, k) of structure matrices: sets of faults that a residual can show.

    Parameters
    ----------
    model
        With 1 to 12 faults: 2^k - 1 rows are tested.
    omega
        Frequencies [rad/s] at which every fault of a row must have an effect (strong structure).
        None: an effect at almost all frequencies is enough (weak structure).

    Raises
    ------
    InputError
        There is no fault or there are too many; frequencies are negative or not finite.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import FaultModel, attainable_structures
    >>> plant = control.ss(-np.eye(2), np.eye(2), np.eye(2), 0.0, inputs=["f1", "f2"])
    >>> model = FaultModel(plant, faults=("f1", "f2"))
    >>> attainable_structures(model).astype(int).tolist()
    [[0, 1], [1, 0], [1, 1]]
    """
    need_faults(model)
    if len(model.faults) > MOST_FAULTS:
        raise InputError(
            f"{len(model.faults)} faults have too many structures; {MOST_FAULTS} can be done"
        )
    rows = [
        row
        for row in product((False, True), repeat=len(model.faults))
        if any(row) and not unattainable_faults(model, row, omega=omega)
    ]
    return np.array(rows, dtype=bool).reshape(-1, len(model.faults))


def unattainable_faults(
    model: FaultModel, row: ArrayLike, *, omega: ArrayLike | None = None
) -> tuple[str, ...]:
    """The faults with 1 in a structure's row that no residual shows if those with 0 are decoupled.

    The result is empty if the row is attainable, because residuals that each show one of its faults
    have a combination that shows all. Parameters and errors are those of `attainable_structures`.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import FaultModel, unattainable_faults
    >>> plant = control.ss(
    ...     -1.0, [[1.0, 1.0]], 1.0, 0.0, inputs=["f1", "f2"]
    ... )  # one output, two faults
    >>> unattainable_faults(FaultModel(plant, faults=("f1", "f2")), [1, 0])
    ('f1',)
    """
    need_faults(model)
    chosen = np.asarray(row)
    if chosen.shape != (len(model.faults),) or not np.isin(chosen, (0, 1)).all():
        raise InputError(f"row is {row!r}; it must be (k,), 0 or 1 for each of {model.faults}")
    zeros = tuple(name for name, one in zip(model.faults, chosen, strict=True) if not one)
    ones = [name for name, one in zip(model.faults, chosen, strict=True) if one]
    parity = Parity(model, (*model.disturbances, *zeros))
    seen: NDArray[np.bool_] = np.asarray(_share_outside_span(parity, ones) > GENERIC_RANK_SHARE)
    if omega is not None and seen.all():
        seen = np.all(_basis_shows(parity, ones, frequencies(model, omega)), axis=1)
    return tuple(name for name, shown in zip(ones, seen, strict=True) if not shown)


def frequencies(model: FaultModel, omega: ArrayLike) -> NDArray[np.float64]:
    """Frequencies [rad/s] as an array (F,); InputError if negative, not finite or above pi / dt."""
    at = np.atleast_1d(as_array(omega, "omega"))
    if at.ndim != 1 or not (np.isfinite(at).all() and (at >= 0.0).all()):
        raise InputError(f"omega is {omega!r}; frequencies [rad/s] from 0 on are needed")
    if model.dt and (at > np.pi / model.dt).any():
        raise InputError(
            f"omega goes to {at.max():.6g} rad/s; the model sampled at {model.dt:.6g} s has "
            f"frequencies up to {np.pi / model.dt:.6g}"
        )
    warn_far_frequencies(at, model.system)
    return at


def need_faults(model: FaultModel) -> None:
    """Raise InputError unless this is a FaultModel with a fault."""
    if not isinstance(model, FaultModel):
        raise InputError(f"model must be a FaultModel, not {type(model).__name__}")
    if not model.faults:
        raise InputError("the model has no fault; name one of its inputs, or add one")


def _share_outside_span(parity: Parity, faults: Sequence[str]) -> NDArray[Any]:
    """The share (k,) of the faults' responses outside the span of the decoupled inputs."""
    G_f = scaled_response(parity, faults)
    if parity.decoupled:
        U, sizes, _ = np.linalg.svd(scaled_response(parity, parity.decoupled), full_matrices=False)
        U = U * (sizes > GENERIC_RANK_SHARE)[:, None, :]
        G_f = G_f - U @ (U.conj().swapaxes(1, 2) @ G_f)
    return np.linalg.norm(G_f, axis=1).max(axis=0)


def _basis_shows(parity: Parity, faults: Sequence[str], omega: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether the rows of a whole basis show the faults at `omega` [rad/s]: (k, F)."""
    shown = np.zeros((len(faults), omega.size), dtype=bool)
    if not parity.count:
        return shown
    for place, point in enumerate(parity.points_at(omega)):
        direct = parity.left_at(faults, point)
        # at a zero of the disturbances; the rows of a polynomial basis keep full rank there
        if direct is None:
            order = parity.complete
            there = parity.effects(order, faults, np.array([point]))[0]
            direct = parity.rows(order) @ there, np.linalg.norm(there, axis=0)
        left, size = direct
        shown[:, place] = np.linalg.norm(left, axis=0) > FAULT_EFFECT_SHARE * size
    return shown
