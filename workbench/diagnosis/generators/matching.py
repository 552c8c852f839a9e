"""Residuals that follow a reference model of the faults as closely as noise allows.

Every stable generator that decouples controls and disturbances is Q = K Q_1. Here K is stable, and
Q_1 is a proper basis of the left null space, made from a minimal polynomial basis. With
Q_1 [G_f G_w; 0] = R_1 the error is E = K R_1 - [M_r 0]. This is an H-infinity problem with
D12 = I and no feedback, whose stabilising controllers are the stable K (Varga, Solving Fault
Diagnosis Problems (2017), section 5.6; Frank and Ding (1997)).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag

from workbench._core.heavy_types import StateSpace
from workbench.answer import Answer
from workbench.certificate import EVERY_FREQUENCY, Check, Checker, relative_excess
from workbench.certify.norms import certified_norm
from workbench.certify.stability import stability_check
from workbench.diagnosis.generators.generator import (
    Poles,
    ResidualGenerator,
    realised,
    residual_response,
)
from workbench.diagnosis.models.decoupling import Parity
from workbench.diagnosis.models.detectability import frequencies, masking_inputs, need_faults
from workbench.diagnosis.models.fault_model import FaultModel
from workbench.errors import InputError, SolverError
from workbench.second_opinion import loops
from workbench.synthesis.h_infinity.hinf import hinf
from workbench.synthesis.h_infinity.singular_plants.regularised import regularise
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import GeneralisedPlant, response
from workbench.systems.realisation import realisation

RESPONSE_RANK_SHARE = 1e-10
"""A singular value of a response counts as 0 below this share of the largest."""


@dataclass(frozen=True, eq=False, repr=False)
class ModelMatch(Answer):
    """A generator, its error R - [M_r 0] from faults and noise, and the error's certified norm.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import FaultModel, ModelMatch, model_matching
    >>> plant = control.ss(-1.0, [[1.0, 0.0]], 1.0, [[0.0, 0.1]], inputs=["f", "n"])
    >>> model = FaultModel(plant, faults=("f",), noise=("n",))
    >>> match = model_matching(model, control.tf([1.0], [1.0, 1.0]), poles=-2.0)
    >>> isinstance(match, ModelMatch), bool(match.error.poles().real.max() < 0)
    (True, True)
    """

    generator: ResidualGenerator
    error: StateSpace
    norm: float

    @property
    def value(self) -> float:
        """The norm of the error."""
        return self.norm


def model_matching(
    model: FaultModel,
    reference: Any,
    poles: Poles,
    *,
    gamma: float | None = None,
    regularisation: float = 1e-3,
    method: str | None = None,
) -> ModelMatch:
    """The stable generator with the least H-infinity norm of its error R - [M_r 0].

    Parameters
    ----------
    model
        With one fault at least. Controls and disturbances are decoupled exactly; noise counts in
        the error.
    reference
        M_r, a stable StateSpace or TransferFunction from the faults to the residuals. Where faults
        move the outputs through an integration or more, an M_r that does
        not roll off cannot be matched at high frequencies: its gain there stays in the error.
    poles
        Poles of the basis Q_1, some of which cancel: one for all, or a list from which each row of
        Q_1 takes as many as its order.
    gamma, method
        As for `workbench.synthesis.h_infinity`; gamma None: nearly the least level.
    regularisation
        Relative size of the noise that is added if faults and noise do not reach every direction
        of R_1 (at high frequencies, or at a zero on the stability boundary).

    Raises
    ------
    InputError
        The model has no fault; the reference is unstable or does not fit; disturbances leave no
        null space; the poles are refused by `generator.denominator`.
    SolverError
        As `workbench.synthesis.h_infinity`; or rounding makes the error unstable.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import FaultModel, model_matching
    >>> plant = control.ss(-1.0, [[1.0, 0.0]], 1.0, [[0.0, 0.1]], inputs=["f", "n"])
    >>> model = FaultModel(plant, faults=("f",), noise=("n",))
    >>> match = model_matching(model, control.tf([1.0], [1.0, 1.0]), poles=-2.0)
    >>> round(match.norm, 3)
    0.1
    """
    need_faults(model)
    M_r = _reference(model, reference)
    base = null_space_generator(model, poles)
    R = base.R
    k = int(M_r.noutputs)
    n, n_r = int(R.nstates), int(M_r.nstates)
    into_r = np.hstack([M_r.B, np.zeros((n_r, len(model.noise)))])
    through_r = np.hstack([M_r.D, np.zeros((k, len(model.noise)))])
    plant = realisation(
        (
            block_diag(R.A, M_r.A),
            np.hstack([np.vstack([R.B, into_r]), np.zeros((n + n_r, k))]),
            np.block([[np.zeros((k, n)), -M_r.C], [R.C, np.zeros((R.noutputs, n_r))]]),
            np.block([[-through_r, np.eye(k)], [R.D, np.zeros((R.noutputs, k))]]),
        ),
        model.dt,
    )
    generalised = GeneralisedPlant(plant, None, k, int(R.noutputs))
    K = hinf(regularise(generalised, regularisation), gamma=gamma, method=method).lti
    names = [f"r{i + 1}" for i in range(k)]
    generator = ResidualGenerator(
        followed_by(base.Q, K, names), followed_by(R, K, names), model.faults, model.noise
    )
    error = generalised.close(K)
    if not stability_check(error).holds:
        raise SolverError("the error is not stable, numerically; choose slower poles of the basis")
    return ModelMatch(generator, error, certified_norm(error)).with_checker(MatchChecker())


class MatchChecker(Checker):
    """Checks the norm of a `ModelMatch`'s error."""

    @property
    def quantifier(self) -> str:
        return f"{EVERY_FREQUENCY}, for this one model"

    def checks(self, answer: ModelMatch, tolerance: float) -> list[Check]:
        stable = stability_check(answer.error)
        if not stable.holds:
            return [stable]
        proven = relative_excess(certified_norm(answer.error), answer.norm)
        statement = "proven norm over the claimed one, less 1"
        return [stable, Check("norm", statement, proven, 0.0, proven=True)]

    def second_opinion(self, answer: ModelMatch) -> list[Check]:
        return [
            loops.powers_fall(answer.error.A, answer.error.dt),
            loops.gain(answer.error, None, None, answer.norm),
        ]


def null_space_generator(model: FaultModel, poles: Poles) -> ResidualGenerator:
    """A proper basis Q_1 of all generators that decouple controls and disturbances.

    Raises InputError if the disturbances leave none, and as `generator.denominator` does.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import FaultModel, null_space_generator, residual_response
    >>> A, B = [[-1.0, 0.0], [0.0, -2.0]], [[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]
    >>> plant = control.ss(A, B, np.eye(2), 0.0, inputs=["u", "d", "f"], outputs=["y1", "y2"])
    >>> model = FaultModel(plant, controls=("u",), disturbances=("d",), faults=("f",))
    >>> Q = null_space_generator(model, poles=-3.0).Q
    >>> float(abs(residual_response(Q, model, ["u", "d"], [0.1, 1.0, 10.0])).max().round(9))
    0.0
    """
    need_faults(model)
    parity = Parity(model, model.disturbances)
    if not parity.count:
        masks = masking_inputs(model, model.faults[0], model.disturbances)
        raise InputError(
            f"{len(model.outputs)} outputs and {len(model.disturbances)} disturbances leave no "
            f"residual: {', '.join(masks)} can imitate every fault; measure more, or let some "
            "disturbances be noise"
        )
    return realised(parity, parity.basis, poles)


def matching_bound(
    model: FaultModel, Q_1: StateSpace, reference: Any, omega: ArrayLike
) -> NDArray[np.float64]:
    """A lower bound (F,) at `omega` [rad/s] on the matching error of any generator, even acausal.

    It is the norm of the part of [M_r 0] that the rows of Q_1 [G_f G_w; 0] do not span there.
    Raises InputError as `generator.transfer` does, and for a reference that does not fit.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import (
    ...     FaultModel,
    ...     matching_bound,
    ...     model_matching,
    ...     null_space_generator,
    ... )
    >>> plant = control.ss(-1.0, [[1.0, 0.0]], 1.0, [[0.0, 0.1]], inputs=["f", "n"])
    >>> model = FaultModel(plant, faults=("f",), noise=("n",))
    >>> reference, Q_1 = control.tf([1.0], [1.0, 1.0]), null_space_generator(model, poles=-2.0).Q
    >>> bound = matching_bound(model, Q_1, reference, [0.01, 1.0, 10.0])
    >>> bool(bound.max() <= model_matching(model, reference, poles=-2.0).norm)
    True
    """
    need_faults(model)
    M_r = _reference(model, reference)
    omega = frequencies(model, omega)
    target = response(M_r, omega)
    target = np.concatenate([target, np.zeros((*target.shape[:2], len(model.noise)))], axis=2)
    rows = residual_response(Q_1, model, (*model.faults, *model.noise), omega)
    _, sizes, V = np.linalg.svd(rows, full_matrices=False)
    V = V * (sizes > RESPONSE_RANK_SHARE * sizes.max(axis=1, keepdims=True))[:, :, None]
    left = target - (target @ V.conj().swapaxes(1, 2)) @ V
    return np.linalg.norm(left, 2, axis=(1, 2))


def _reference(model: FaultModel, reference: Any) -> StateSpace:
    M_r = as_system(reference, "reference")
    if int(M_r.ninputs) != len(model.faults):
        raise InputError(
            f"the reference has {M_r.ninputs} inputs; the model has {len(model.faults)} faults"
        )
    # a static system fits any sampling time
    if M_r.nstates and float(M_r.dt or 0.0) != model.dt:
        raise InputError(
            f"the reference has the sampling time {M_r.dt}, the model {model.dt} (0: continuous)"
        )
    if not stability_check(M_r).holds:
        raise InputError("the reference is unstable: no stable generator can follow it")
    return realisation((M_r.A, M_r.B, M_r.C, M_r.D), model.dt)


def followed_by(first: StateSpace, K: StateSpace, names: list[str]) -> StateSpace:
    """The series connection: K after the first system, with the states of both."""
    matrices = (
        np.block([[first.A, np.zeros((first.nstates, K.nstates))], [K.B @ first.C, K.A]]),
        np.vstack([first.B, K.B @ first.D]),
        np.hstack([K.D @ first.C, K.C]),
        K.D @ first.D,
    )
    return realisation(
        matrices, float(first.dt or 0.0), inputs=list(first.input_labels), outputs=names
    )
