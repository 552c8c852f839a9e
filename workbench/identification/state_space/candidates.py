"""Candidates in a choice among models: their validation fits, and by how much each one lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.tables import markdown_table
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.model import InnovationsModel

BLOCKS = 10
"""Number of blocks of validation samples in each fold; their mean errors give the
standard error.
"""
MEMBER_LOSS = 10.0
"""A candidate is averaged with the best one only if its fit is at most so many points lower."""
PHYSICS = "(physics)"
"""Ending of the names of kinds that come from physics."""
MEMBERS = 10
"""Most candidates that are averaged: few enough that all of them are good."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Validation results of models of several kinds and orders, for the uses (one-step, free run).

    Parameters
    ----------
    labels
        Kind and order of each candidate (M,).
    fits
        Mean fit over outputs and folds [%], (uses, M).
    lost, deviation
        Difference between the best fit of the use and this fit, in points, and its standard error,
        (uses, M).
    averaged
        Validation fit [%] of the average of the best candidates, (uses,), if it is the answer; None
        if the best candidate is.
    """

    labels: tuple[str, ...]
    fits: RealArray
    lost: RealArray
    deviation: RealArray
    averaged: RealArray | None = None

    def best(self, use: int) -> int:
        """The candidate that fits best in a use.

        A model from physics is taken if it lost by at most one standard error: then the record does
        not contradict it, and it has fewer parameters than the others. Source of the rule: L.
        Breiman and others, Classification and Regression Trees, 1984, section 3.4.3.
        """
        first = int(np.argmax(self.fits[use]))
        as_good = np.isfinite(self.fits[use]) & (self.lost[use] <= self.deviation[use])
        physical = [
            k
            for k, label in enumerate(self.labels)
            if _kind(label).endswith(PHYSICS) and as_good[k]
        ]
        return max(physical, key=lambda k: float(self.fits[use, k]), default=first)

    def members(self, use: int) -> list[int]:
        """The candidates with the best fits for a use that are averaged, best first."""
        order = np.argsort(-self.fits[use], kind="stable")[:MEMBERS]
        return [int(k) for k in order if self.fits[use, k] >= self.fits[use].max() - MEMBER_LOSS]

    def runner_up(self, use: int) -> int | None:
        """The best candidate of a different kind than the best one; None if there is none."""
        kind = _kind(self.labels[self.best(use)])
        others = [
            k
            for k, label in enumerate(self.labels)
            if _kind(label) != kind and np.isfinite(self.fits[use, k])
        ]
        return max(others, key=lambda k: float(self.fits[use, k]), default=None)

    def words(self, use: int, task: str) -> str:
        """A sentence: the choice, the runner-up, and by how much that lost."""
        chosen, second = self.labels[self.best(use)], self.runner_up(use)
        if self.averaged is not None:
            gain = self.averaged[use] - self.fits[use].max()
            names = ", ".join(self.labels[k] for k in self.members(use))
            return (
                f"to {task}: the average of {names}; in validation it fits {gain:+.2g} points "
                f"better than {chosen} alone"
            )
        if second is None:
            return f"to {task}: {chosen}; no other kind gave a model"
        behind = self.best(use)
        if self.lost[use, behind] > 0:
            return (
                f"to {task}: {chosen}; {self.labels[second]} validates "
                f"{self.lost[use, behind]:.2g} +- {self.deviation[use, behind]:.1g} points better, "
                "which may be chance"
            )
        lost, deviation = self.lost[use, second], self.deviation[use, second]
        told = "" if lost > 2 * deviation else ", which may be chance"
        return (
            f"to {task}: {chosen}; the runner-up, {self.labels[second]}, lost "
            f"{lost:.2g} +- {deviation:.1g} points in validation{told}"
        )

    def table(self) -> str:
        """Fits of all candidates, in Markdown."""
        rows = [
            [label, *(f"{fits[k]:.2f}" for fits in self.fits), *(
                f"{lost[k]:.2f} +- {spread[k]:.2f}"
                for lost, spread in zip(self.lost, self.deviation, strict=True)
            )]
            for k, label in enumerate(self.labels)
        ]  # fmt: skip
        titles = ["one step [%]", "free run [%]", "one step lost", "free run lost"]
        return markdown_table(["model", *titles], rows)


def _kind(label: str) -> str:
    return label.rpartition(" ")[0]


def validation_errors(model: InnovationsModel, record: Experiments, washout: int) -> RealArray:
    """Errors (uses, N, ny) of a model on experiments, without the washout of each.

    Missing samples count as no error.
    """
    runs = (model.one_step, model.free_run)
    found = [
        np.vstack(
            [(y - run(u, y, washout))[washout:] for u, y in record.pieces() if len(u) > washout]
        )
        for run in runs
    ]
    return np.nan_to_num(np.array(found), posinf=np.inf, neginf=-np.inf)


def judged_variance(record: Experiments, washout: int) -> RealArray:
    """Variance (ny,) of the outputs of experiments, without the washout of each."""
    outputs = [y[washout:] for _, y in record.pieces() if len(y) > washout]
    return np.asarray(np.nanvar(np.vstack(outputs), axis=0))


def block_means(errors: RealArray) -> RealArray:
    """Mean squares (uses, blocks, ny) of errors (uses, N, ny) in blocks of samples."""
    with np.errstate(over="ignore"):
        squares = errors**2
    return np.array(
        [[part.mean(axis=0) for part in np.array_split(use, BLOCKS)] for use in squares]
    )


def compared_candidates(labels: Sequence[str], errors: RealArray, spreads: RealArray) -> Candidates:
    """Candidates from squared errors (M, folds, uses, blocks, ny) and variances (folds, ny).

    A candidate without a model has infinite errors. The fit of a fold is as in `nrmse_fit`; the
    standard error of a difference comes from the blocks, to first order.
    """
    with np.errstate(all="ignore"):
        relative = errors / spreads[:, None, None, :]
        root = np.sqrt(relative.mean(axis=3))  # M, folds, uses, ny
        fits = 100 * (1 - root.mean(axis=(1, 3))).T  # uses, M
        fits[~np.isfinite(fits)] = -np.inf
        best = fits.argmax(axis=1)
        # To first order, the relative change of the root is half that of the mean square of a
        # block.
        pull = 100 * (relative / (2 * root[:, :, :, None, :])).mean(axis=4)
        lost, deviation = np.empty_like(fits), np.empty_like(fits)
        for use, winner in enumerate(best):
            lost[use] = fits[use, winner] - fits[use]
            apart = pull[:, :, use] - pull[winner, :, use]
            folds, blocks = apart.shape[1:]
            variance = apart.var(axis=2, ddof=1) / blocks
            deviation[use] = np.sqrt(variance.sum(axis=1)) / folds
    deviation[~np.isfinite(deviation)] = np.inf
    return Candidates(tuple(labels), fits, lost, deviation)
