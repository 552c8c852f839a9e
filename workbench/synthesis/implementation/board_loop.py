"""The loop of a sampled controller around a plant with hold, also for a set of plants."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.certify.sampled_sets import SetPeak, sampled_set_peak
from workbench.errors import InputError
from workbench.synthesis.implementation.sampled_loop import plant_and_sign
from workbench.synthesis.implementation.sampled_response import HeldPlantLoop
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.interconnection import connected, named_realisation
from workbench.systems.joints import part_of
from workbench.systems.realisation import realisation
from workbench.uncertainty import UncertaintyModel


@dataclass(frozen=True, eq=False)
class BoardLoop:
    """A plant with the hold and the delay of the computer, and with an anti-aliasing filter.

    Unlike a `HeldPlantLoop`, it has no controller yet.

    The parameters are those of `Implementation`.
    """

    plant: Any
    period: float
    delay: float
    anti_aliasing: Any
    sign: int | None

    @cached_property
    def model(self) -> UncertaintyModel | None:
        """The set of plants, if the plant is such a set with a single channel; otherwise None."""
        if isinstance(self.plant, GeneralisedPlant):
            return None
        part = part_of(self.plant, "plant")
        return part if isinstance(part, UncertaintyModel) else None

    @cached_property
    def nominal(self) -> tuple[StateSpace, int]:
        """The continuous nominal from u to y including the filter, and the sign of the loop."""
        plant, sign = plant_and_sign(self.plant, self.sign)
        if plant.dt:
            raise InputError(f"the plant is sampled (dt = {plant.dt}); give the continuous plant")
        if self.anti_aliasing is None:
            return plant, sign
        import control

        if self.model is not None and self.model.form == "additive":
            raise InputError("the model is additive: put the filter into the responses instead")
        part = as_system(self.anti_aliasing, "anti_aliasing")
        if (part.ninputs, part.noutputs) == (1, 1) and plant.noutputs > 1:
            part = control.append(*[part] * plant.noutputs)
        if part.ninputs != plant.noutputs or part.noutputs != plant.noutputs or part.dt:
            raise InputError(
                f"anti_aliasing has {part.ninputs} inputs and {part.noutputs} outputs, dt "
                f"{part.dt}; needed is a continuous filter of 1 or {plant.noutputs} channels"
            )
        return part * plant, sign

    def loop_of(self, K: StateSpace) -> HeldPlantLoop:
        """The loop of a sampled controller."""
        plant, sign = self.nominal
        if (K.ninputs, K.noutputs) != (plant.noutputs, plant.ninputs):
            raise InputError(
                f"controller has {K.ninputs} inputs and {K.noutputs} outputs; the plant has "
                f"{plant.noutputs} outputs and {plant.ninputs} inputs"
            )
        return HeldPlantLoop(plant, K, self.period, self.delay, sign)

    def closed(self, K: StateSpace) -> StateSpace:
        """The loop from a disturbance of the measurements to (measurements, controls)."""
        loop = self.loop_of(K)
        G = loop.held()
        m, p = G.ninputs, G.noutputs
        links = np.zeros((m + p, p + m))
        links[:m, p:], links[m:, :p] = loop.sign * np.eye(m), np.eye(p)
        enters = np.vstack([np.zeros((m, p)), np.eye(p)])
        # The measurement is output plus disturbance, so S = 1 + (transfer from disturbance to
        # output).
        M, n = connected((named_realisation(G), named_realisation(K)), links, enters, np.eye(p + m))
        M[n : n + p, n:] += np.eye(p)
        return realisation((M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:]), self.period)

    def sensitivity(self, K: StateSpace) -> StateSpace:
        """Sensitivity S of the loop, from a disturbance of the measurements to the measurements."""
        closed, p = self.closed(K), self.nominal[0].noutputs
        return realisation((closed.A, closed.B, closed.C[:p], closed.D[:p]), self.period)

    def around(self, K: StateSpace) -> StateSpace:
        """The transfer function around the set's deviations: T = 1 - S for relative ones, K S for
        additive ones.
        """
        closed, p = self.closed(K), self.nominal[0].noutputs
        assert self.model is not None
        if self.model.form == "multiplicative":
            return realisation((closed.A, -closed.B, closed.C[:p], 1.0 - closed.D[:p]), self.period)
        sign = -self.nominal[1]
        return realisation(
            (closed.A, sign * closed.B, closed.C[p:], sign * closed.D[p:]), self.period
        )

    def peak(self, K: StateSpace) -> SetPeak | None:
        """Bounds on mu of a stable loop for the set of plants; None without a set."""
        model = self.model
        return None if model is None else sampled_set_peak(self.around(K), model.W_c, model.W_r)
