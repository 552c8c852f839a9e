"""The verdict of every cell, which takes all cells of a comparison into account.

One cell alone shows whether an answer is valid. Whether a claim is true is seen only from all cells
of a problem together. Terms of the rules:

- A *valid answer* meets every check at its tolerance. It is *credible* unless it lies below the
  lower bound that its own gap proves, by more than `SAFETY` times its tolerance.
- A method *claims the optimum* if it says "solved" and is registered as finding the optimum. Other
  methods are heuristics: a worse objective does not make them wrong.
- The *lower bound* of a credible answer is objective - gap * scale - rounding: no valid answer of
  the problem has a smaller objective.
- Objectives *differ* if their distance exceeds the tolerance of the cells, times the scale, plus
  the rounding error; they differ *clearly* beyond `SAFETY` times the tolerance.

Rules; the first one that applies decides:

unfit, crashed, memory limit
    The method cannot take the problem, or its worker died, or it was stopped for its memory.
contradiction
    Two certificates exclude each other. A credible answer, or a proof that there is no least value,
    stands against a proof that there is no answer. A lower bound stands against a proof that there
    is no least value, or clearly above the objective of a credible answer. Both cells have this
    verdict. A single cell of a heuristic also has it if its valid answer is not credible.
wrong
    The method says "solved", and its answer was checked and is not valid; or no answer exists, as
    another cell proves. It claims the optimum, and its answer is not credible, or another cell has
    a clearly better credible answer while no closed gap speaks for its own, or another cell
    proves that there is no least value. It says "infeasible" without a proof, and another cell has
    a credible answer, or a proof that there is no least value. It says "unbounded" without a proof,
    and another cell has a lower bound, or a proof that there is no answer. Cells in a contradiction
    prove nothing against others.
inaccurate
    The answer is valid and the optimum is claimed, but the gap is open; or there is no gap, and
    another cell has a better credible answer, though not a clearly better one.
solved, infeasible, unbounded, no solution up to R, no claim, time limit, failed
    What the certificate of the cell says.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.heavy_types import Dataset
from workbench.bench.comparison.layout import (
    METHOD,
    asked_cells,
    need_comparison,
    tolerances,
)
from workbench.solvers import Outcome

SAFETY = 10.0
"""Number of tolerances by which two objectives must differ before one of them is called wrong."""
WRONG, CONTRADICTION = "wrong", "contradiction"
CERTIFIED = (str(Outcome.SOLVED), str(Outcome.INFEASIBLE), str(Outcome.UNBOUNDED))
"""Certified verdicts: the answer, or the claim that there is none, has a certificate that holds."""


def judged_cells(data: Dataset) -> Dataset:
    """The dataset with the variables ``verdict`` and ``reason``, made from all its cells.

    For a cell that is wrong, in a contradiction or inaccurate, the reason is a sentence that says
    why. It is empty for other cells, whose message says it.

    Raises
    ------
    ResultError
        As `workbench.bench.comparison.layout.need_comparison`.
    """
    data = need_comparison(data)
    verdict = data["outcome"].values.astype(object)
    reason = np.full(verdict.shape, "", dtype=object)
    for i in range(data.sizes["problem"]):
        one = _Problem.of(data, i)
        verdict[i], reason[i] = (array.reshape(verdict.shape[1:]) for array in one.judged())
    dims = data["outcome"].dims
    return data.assign(verdict=(dims, verdict.astype(str)), reason=(dims, reason.astype(str)))


@dataclass(frozen=True, eq=False)
class _Problem:
    """The cells (N,) of one problem."""

    names: np.ndarray
    outcome: np.ndarray
    claim: np.ndarray
    claims_optimum: np.ndarray
    was_checked: np.ndarray
    objective: np.ndarray
    gap: np.ndarray
    tolerance: np.ndarray
    validity: np.ndarray
    """Tolerance of the validity checks; it is never finer than the one asked for."""
    scale: np.ndarray
    rounding: np.ndarray

    @classmethod
    def of(cls, data: Dataset, i: int) -> _Problem:
        def flat(values: np.ndarray) -> np.ndarray:
            return np.asarray(values[i]).reshape(-1)

        methods, levels = data[METHOD].values, data["accuracy"].values
        shape = data["outcome"].shape[1:]
        names = [
            f"{methods[j]} at {levels[k]}" + (f", repetition {n + 1}" if shape[2] > 1 else "")
            for j, k, n in np.ndindex(*shape)
        ]
        outcome, claim = flat(data["outcome"].values), flat(data["claim"].values)
        outcome = np.where(flat(asked_cells(data)), outcome, "")
        tolerance, served = flat(tolerances(data)), flat(data["served"].values)
        return cls(
            np.array(names, dtype=object),
            outcome,
            claim,
            (claim == Outcome.SOLVED) & (flat(data["optimal"].values) == 1),
            flat(data["check"].values) > 0.0,
            flat(data["objective"].values).astype(float),
            flat(data["gap"].values).astype(float),
            tolerance,
            np.fmax(tolerance, served),
            flat(data["scale"].values).astype(float),
            np.nan_to_num(flat(data["rounding"].values).astype(float)),
        )

    def judged(self) -> tuple[np.ndarray, np.ndarray]:
        """Verdicts (N,) and reasons (N,)."""
        verdict = self.outcome.astype(object)
        reason = np.full(verdict.shape, "", dtype=object)

        def put(word: str, found: np.ndarray, sentences: str, by: np.ndarray | None = None) -> None:
            """Give cells a verdict; ``by`` (N, N) marks other cells that speak against each."""
            for k in np.flatnonzero(found):
                if verdict[k] in (WRONG, CONTRADICTION):  # keep the first reason
                    continue
                verdict[k] = word
                other = "" if by is None else self.names[int(np.argmax(by[k]))]
                reason[k] = sentences.format(other)

        against = self.contradictions()
        contradicted = against.any(axis=1)
        for k in np.flatnonzero(contradicted):
            put(CONTRADICTION, np.arange(len(verdict)) == k, self._excluding(int(k)), against)
        holds = self.outcome == Outcome.SOLVED
        said = "a valid answer lies below the lower bound that its own gap proves"
        put(CONTRADICTION, holds & self.beyond & ~self.claims_optimum, said)

        solved = self.claim == Outcome.SOLVED
        failed = self.outcome == Outcome.FAILED
        put(WRONG, solved & failed & self.was_checked, "says solved, but its answer is not valid")
        optimum = self.claims_optimum
        said = "says solved, but its objective lies below the lower bound that its gap proves"
        put(WRONG, optimum & self.beyond, said)
        trusted = ~contradicted & ~self.beyond
        clearly = self.better(SAFETY) & trusted
        said = "says solved, but the valid answer of {} has a clearly better objective"
        put(WRONG, optimum & clearly.any(axis=1), said, clearly)
        unproven = self.outcome != self.claim
        for word, found, by, proof in (
            (Outcome.SOLVED, failed, self.no_answer, "proves that there is no answer"),
            (Outcome.SOLVED, optimum, self.no_least, "proves that there is no least value"),
            (Outcome.INFEASIBLE, unproven, self.credible, "has a valid answer"),
            (Outcome.INFEASIBLE, unproven, self.no_least, "proves that there is no least value"),
            (Outcome.UNBOUNDED, unproven, np.isfinite(self.lower), "proves a lower bound"),
            (Outcome.UNBOUNDED, unproven, self.no_answer, "proves that there is no answer"),
        ):
            others = np.broadcast_to(by & trusted, (len(verdict), len(verdict)))
            accused = (self.claim == word) & found & others.any(axis=1)
            put(WRONG, accused, f"says {word}, but {{}} {proof}", others)
        slightly = self.better(1.0) & trusted
        said = "says solved, but the valid answer of {} has a better objective"
        put(str(Outcome.INACCURATE), holds & optimum & slightly.any(axis=1), said, slightly)
        for k in np.flatnonzero(verdict == Outcome.INACCURATE):
            open_gap = f"the gap {self.gap[k]:.2g} exceeds the tolerance {self.tolerance[k]:g}"
            reason[k] = reason[k] or open_gap
        return verdict, reason

    # --- what the cells prove -----------------------------------------------------------------

    @property
    def no_answer(self) -> np.ndarray:
        return np.asarray(self.outcome == Outcome.INFEASIBLE)

    @property
    def no_least(self) -> np.ndarray:
        return np.asarray(self.outcome == Outcome.UNBOUNDED)

    @property
    def valid(self) -> np.ndarray:
        """Cells with a valid answer; after a time limit, those that have an objective."""
        stopped = (self.outcome == Outcome.TIME_LIMIT) & np.isfinite(self.objective)
        return np.isin(self.outcome, [Outcome.SOLVED, Outcome.INACCURATE]) | stopped

    @property
    def beyond(self) -> np.ndarray:
        """Valid answers below the lower bound that their own gap proves."""
        return np.asarray(self.valid & (self.gap < -SAFETY * self.validity))

    @property
    def credible(self) -> np.ndarray:
        return np.asarray(self.valid & ~self.beyond)

    @property
    def lower(self) -> np.ndarray:
        """Lower bounds (N,) on the objective; minus infinity if a cell proves none."""
        with np.errstate(invalid="ignore"):
            found = self.objective - self.gap * self.scale - self.rounding
        return np.where(self.credible & np.isfinite(found), found, -np.inf)

    def contradictions(self) -> np.ndarray:
        """Pairs (N, N), symmetric, of cells whose certificates exclude each other."""
        no_answer, no_least, lower = self.no_answer, self.no_least, self.lower
        objective = np.where(self.credible, self.objective, np.nan)
        with np.errstate(invalid="ignore"):
            distance = lower[:, None] - objective[None, :]
            found = distance > SAFETY * self.validity[None, :] * self._scale + self._rounding
        found |= no_answer[:, None] & (self.credible | no_least)[None, :]
        found |= np.isfinite(lower)[:, None] & no_least[None, :]
        np.fill_diagonal(found, False)
        return np.asarray(found | found.T)

    def better(self, factor: float) -> np.ndarray:
        """Pairs (N, N): the second cell has a valid objective better by ``factor`` tolerances.

        No objective speaks against a cell whose closed gap proves its own.
        """
        objective = np.where(self.valid, self.objective, np.nan)
        tolerance = np.maximum(self.tolerance[:, None], self.validity[None, :])
        with np.errstate(invalid="ignore"):
            distance = objective[:, None] - objective[None, :]
            found = distance > factor * tolerance * self._scale + self._rounding
        open_gap = ~(np.abs(self.gap) <= self.tolerance)
        return np.asarray(found & open_gap[:, None])

    @property
    def _scale(self) -> np.ndarray:
        """The larger of two cells' scales (N, N)."""
        return np.fmax(self.scale[:, None], self.scale[None, :])

    @property
    def _rounding(self) -> np.ndarray:
        """The sum of two cells' rounding errors (N, N)."""
        return np.asarray(self.rounding[:, None] + self.rounding[None, :])

    def _excluding(self, k: int) -> str:
        """The statement of a certificate in a contradiction, to be set against another cell's."""
        if self.no_answer[k]:
            return "proves that there is no answer, against {}"
        if self.no_least[k]:
            return "proves that there is no least value, against {}"
        return f"has an answer that is valid to {self.validity[k]:g}, against what {{}} proves"
