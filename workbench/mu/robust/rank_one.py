"""Mu in closed form where M is of rank one: a loop with one disturbance channel.

For a single channel w -> z of a loop with scalar uncertainty M = N is of rank one: with
c_k = N_kk, I - N Delta is singular where the sum of delta_k c_k is 1, and with one real scalar and
complex ones

    mu = 1 / min { t : |1 - x c_r| <= t sum |c_k|, |x| <= t, x real }.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import InputError, UnknownNameError
from workbench.geometry import Stadium
from workbench.input_checks import as_array
from workbench.systems.conversion import need_plant
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.uncertainty import cheapest_orientation
from workbench.uncertainty.covers.sets import stadiums_about_nominal


def rank_one_mu(real: ComplexArray, others: RealArray) -> RealArray:
    """Mu of a matrix of rank one with one real scalar and any number of complex scalars.

    If the best x lies inside, |x| < t, the minimum is given by the distance of 1 from the line
    through c_r; at the end |x| = t, (mu - |Re c_r|)^2 + (Im c_r)^2 = others^2.

    Parameters
    ----------
    real
        Diagonal entry c_r of the real scalar, complex (...); 0 if there is none.
    others
        Sum of |c_k| over the complex scalars (...), not negative.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.mu import rank_one_mu
    >>> rank_one_mu(np.array([0.3 + 0j, 0j]), np.array([0.4, 0.4])).round(6).tolist()
    [0.7, 0.4]
    """
    real, others = as_array(real, "real", dtype=complex), as_array(others, "others")
    try:
        np.broadcast_shapes(real.shape, others.shape)
    except ValueError:
        raise InputError(
            f"real and others have shapes {real.shape} and {others.shape}, which do not fit"
        ) from None
    along, across, size = np.abs(real.real), np.abs(real.imag), np.abs(real)
    at_end = others * along >= across * size
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = others * size / across
    end = along + np.sqrt(np.maximum(others**2 - across**2, 0.0))
    return np.where(at_end, end, inside)


@dataclass(frozen=True)
class RankOneLoop:
    """A loop with one multiplicative uncertainty and one channel w -> z, at frequencies (F,).

    Unlike a closed `StateSpace`, it is two responses, for which mu has a formula.

    ``uncertain`` (F,) is the response seen by an uncertainty of size 1, ``performance`` (F,) the
    response from w to z.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.mu import RankOneLoop
    >>> loop = RankOneLoop(np.array([0.3 + 0j]), np.array([0.5 + 0j]))
    >>> loop.uncertain.shape
    (1,)
    """

    uncertain: ComplexArray
    performance: ComplexArray

    @classmethod
    def of(
        cls,
        plant: GeneralisedPlant,
        controller: Any,
        performance: str,
        exogenous: str,
        omega: ArrayLike,
    ) -> RankOneLoop:
        """One channel of a plant closed by a controller, at frequencies `omega` [rad/s] (F,).

        Parameters
        ----------
        plant
            A plant whose perturbation is one complex scalar, multiplicative with weight 1.
        controller
            StateSpace or TransferFunction, from the plant's measurements to its controls.
        performance, exogenous
            Names of z and w.

        Raises
        ------
        InputError, UnknownNameError
            The plant has another perturbation, or lacks one of the names; or as
            `GeneralisedPlant.close`.
        """
        need_plant(plant)
        if plant.structure is None or plant.structure.to_pairs() != [(1, 0)]:
            raise InputError("the perturbation must be one complex scalar, of a weight 1")
        N = plant.close(controller)
        names = {"performance output": N.output_labels, "exogenous input": N.input_labels}
        for (kind, labels), name in zip(names.items(), (performance, exogenous), strict=True):
            if name not in labels:
                raise UnknownNameError(kind, name, labels)
        response = np.moveaxis(N(1j * np.asarray(omega, dtype=float), squeeze=False), -1, 0)
        z, w = N.output_labels.index(performance), N.input_labels.index(exogenous)
        return cls(response[:, 0, 0], response[:, z, w])

    def mu(self, sets: Stadium) -> RealArray:
        """Mu over multiplicative uncertainty in sets (F, ...) about the nominal: (F, ...).

        No weights are fitted to the sets, whose centres must be 0: the segment of a stadium is the
        real scalar, its radius the complex one.
        """
        uncertain, performance = (
            part.reshape(part.shape + (1,) * (sets.radius.ndim - 1))
            for part in (self.uncertain, self.performance)
        )
        segment = sets.half_length * np.exp(1j * sets.angle)
        return rank_one_mu(
            segment * uncertain, sets.radius * np.abs(uncertain) + np.abs(performance)
        )

    def stadiums_of_least_mu(self, omega: RealArray, away: ComplexArray) -> Stadium:
        """Stadiums around relative deviations (F, N) from the nominal, oriented for least mu.

        At each frequency [rad/s] (F,), the better of the candidates of `cheapest_orientation` and
        the narrowest stadium.
        """

        def cost(
            _: RealArray, angle: RealArray, radius: RealArray, half_length: RealArray
        ) -> RealArray:
            every = np.broadcast_to(angle, radius.shape)
            return self.mu(Stadium(np.zeros(radius.shape, complex), radius, half_length, every))

        narrow = stadiums_about_nominal(away)
        angle = cheapest_orientation(cost, 0.0)(omega, away)
        better = self.mu(narrow) <= self.mu(stadiums_about_nominal(away, angle))
        return stadiums_about_nominal(away, np.where(better, narrow.angle, angle))
