"""Scaling of records by mean and spread, in which models are computed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.model import InnovationsModel


@dataclass(frozen=True, eq=False)
class Scaling:
    """Means and spreads of the channels of experiments; computations use scaled signals."""

    u_mean: RealArray
    u_spread: RealArray
    y_mean: RealArray
    y_spread: RealArray

    @classmethod
    def of(cls, record: Experiments) -> Scaling:
        u_spread, y_spread = record.u.std(axis=0), np.nanstd(record.y, axis=0)
        u_spread[u_spread == 0], y_spread[y_spread == 0] = 1.0, 1.0
        return cls(record.u.mean(axis=0), u_spread, np.nanmean(record.y, axis=0), y_spread)

    def scaled(self, u: RealArray, y: RealArray) -> tuple[RealArray, RealArray]:
        """Inputs and outputs without means, at unit spread."""
        return (u - self.u_mean) / self.u_spread, (y - self.y_mean) / self.y_spread

    def restored(self, model: InnovationsModel, record: Experiments) -> InnovationsModel:
        """Convert a model of scaled signals to the record's signals."""
        return replace(
            model,
            B=model.B / self.u_spread,
            C=self.y_spread[:, None] * model.C,
            D=self.y_spread[:, None] * model.D / self.u_spread,
            K=model.K / self.y_spread,
            u_offset=self.u_mean + self.u_spread * model.u_offset,
            y_offset=self.y_mean + self.y_spread * model.y_offset,
            **record.labels,
        )

    def applied(self, model: InnovationsModel) -> InnovationsModel:
        """Convert a model of the record's signals to scaled ones: the inverse of `restored`."""
        return replace(
            model,
            B=model.B * self.u_spread,
            C=model.C / self.y_spread[:, None],
            D=model.D * self.u_spread / self.y_spread[:, None],
            K=model.K * self.y_spread,
            u_offset=(model.u_offset - self.u_mean) / self.u_spread,
            y_offset=(model.y_offset - self.y_mean) / self.y_spread,
        )
