"""Mixed sensitivity: the least norm of weighted S, K S and T (E. Vidal Sanchez, Robust and Fault
Tolerant Control of CD-players (2003), eq. 5.6, which weighs S and K S).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.certificate import Check, worst_value
from workbench.certify.norms import NORM_TOLERANCE
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.synthesis.families.family import Family
from workbench.synthesis.h_infinity.figures import grid
from workbench.synthesis.h_infinity.program import HinfController, HinfSynthesis
from workbench.synthesis.h_infinity.singular_plants.absorbed import between_poles
from workbench.systems.connection import generalised_plant
from workbench.systems.conversion import as_system, as_weight
from workbench.systems.generalised_plant import GeneralisedPlant, response


@dataclass(frozen=True, eq=False, init=False, kw_only=True)
class MixedSensitivity(HinfSynthesis):
    """The stabilising K with the least norm of [W_S S; W_KS K S; W_T T], S = (1 + G K)^-1.

    T = 1 - S. K acts on the error: u = K (r - G u), the usual loop with negative feedback.

    Parameters
    ----------
    nominal
        StateSpace or TransferFunction from u to x.
    W_S, W_KS, W_T
        Weights of the error, the control and the output: StateSpace, TransferFunction or number. A
        weight with a single channel acts on every channel. None leaves the row out. Weights must be
        stable, except that W_S may have poles on the stability boundary, such as an integrator or a
        resonator. The controller then has these poles too (``answer.lti``), and stability is that
        of the loop without weights.
    gamma, order, family, stable, fastest_pole, start, random, largest_gain, further_plants
        As in `HinfSynthesis`.

    Raises
    ------
    InputError
        As in `HinfSynthesis`; there is no weight; or a weight has the wrong size.

    Examples
    --------
    >>> import control
    >>> import workbench as wb
    >>> from workbench.synthesis import MixedSensitivity
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> program = MixedSensitivity(G, W_S=control.tf([0.5, 1.0], [1.0, 0.01]), W_KS=0.1)
    >>> solution = wb.solve(program)
    >>> solution.certificate.holds, bool(solution.answer.norm < 1)
    (True, True)
    >>> from workbench.synthesis import PI
    >>> program = MixedSensitivity(
    ...     G, W_S=control.tf([0.5, 1.0], [1.0, 0.01]), W_KS=0.1, family=PI()
    ... )
    >>> bool(wb.solve(program).answer.K.poles()[0] == 0)  # an integrator
    True
    """

    nominal: StateSpace
    weights: dict[str, StateSpace]

    def __init__(
        self,
        nominal: Any,
        *,
        W_S: Any = None,
        W_KS: Any = None,
        W_T: Any = None,
        gamma: float | None = None,
        order: int | None = None,
        family: Family | None = None,
        stable: bool = False,
        fastest_pole: float | None = None,
        start: Any = None,
        random: int = 0,
        largest_gain: float | None = None,
        further_plants: Sequence[GeneralisedPlant] = (),
    ) -> None:
        nominal = as_system(nominal, "nominal")
        given = {"S": W_S, "KS": W_KS, "T": W_T}
        sizes = {"S": nominal.noutputs, "KS": nominal.ninputs, "T": nominal.noutputs}
        weights = {
            name: as_weight(weight, sizes[name], f"W_{name}")
            for name, weight in given.items()
            if weight is not None
        }
        if not weights:
            raise InputError("there is no weight; give at least one of W_S, W_KS and W_T")
        fields = {
            "nominal": nominal,
            "weights": weights,
            "plant": _stack(nominal, weights),
            "gamma": gamma,
        }
        fields |= {"order": order, "family": family, "stable": stable}
        fields |= {"fastest_pole": fastest_pole, "start": start, "random": random}
        fields |= {"largest_gain": largest_gain, "further_plants": further_plants}
        for name, value in fields.items():
            object.__setattr__(self, name, value)
        self.__post_init__()

    def checks(self, answer: HinfController, tolerance: float) -> list[Check]:
        found = super().checks(answer, tolerance)
        if len(found) == 1:  # K does not fit
            return found
        K = self.absorbed.whole(answer.K)
        omega = between_poles(grid(self.absorbed.plant.close(answer.K)), self.plant, K)
        size = np.linalg.norm(self._formula(K, omega), 2, axis=(-2, -1))
        over_norm = size / answer.norm - 1.0 if answer.norm else np.where(size > 0.0, np.inf, 0.0)
        excess, where = worst_value(over_norm, lambda index: f"at {omega[index[0]]:.6g} rad/s")
        statement = "largest [W_S S; W_KS K S; W_T T] at frequencies over the norm, less 1"
        over = f"at {omega.size} frequencies"
        limit = 2.0 * NORM_TOLERANCE
        found.append(Check("definition", statement, excess, limit, where=where, over=over))
        if self.absorbed.copies:
            bare = _stack(self.nominal, {"S": as_weight(1.0, self.nominal.noutputs, "W_S")})
            said = "stability without weights"
            found.append(replace(stability_check(bare.close(K)), name=said))
        return found

    def _formula(self, K: StateSpace, omega: np.ndarray) -> np.ndarray:
        """[W_S S; W_KS K S; W_T T] by its definition, from responses of G, K and the weights."""
        G, controller = response(self.nominal, omega), response(K, omega)
        one = np.eye(G.shape[-2])
        S = np.linalg.inv(one + G @ controller)
        rows = {"S": S, "KS": controller @ S, "T": one - S}
        stack = [response(weight, omega) @ rows[name] for name, weight in self.weights.items()]
        return np.concatenate(stack, axis=-2)


def _stack(G: StateSpace, weights: dict[str, StateSpace]) -> GeneralisedPlant:
    """The plant with inputs r and u, weighted e, u and x as performance, and e as measurement."""

    def names(signal: str, count: int) -> list[str]:
        return [f"{signal}{i}" for i in range(count)]

    u, x = names("u", G.ninputs), names("x", G.noutputs)
    e, r = names("e", G.noutputs), names("r", G.noutputs)
    enters = {"S": e, "KS": u, "T": x}
    leaves = {name: names(f"z_{name}", weight.noutputs) for name, weight in weights.items()}
    return generalised_plant(
        [(G, u, x), *((weight, enters[name], leaves[name]) for name, weight in weights.items())],
        {error: f"{wanted} - {is_}" for error, wanted, is_ in zip(e, r, x, strict=True)},
        exogenous=r,
        control=u,
        performance=[name for row in leaves.values() for name in row],
        measurement=e,
    )
