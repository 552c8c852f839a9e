"""Branch and bound over constant gains: a proven lower bound on the norm for all gains of a box.

Boxes are halved until each one has a proof: at some frequency no gain in the box gives a norm below
the level, or no gain in the box stabilises (`workbench.certify.proofs.gain_boxes`). Proofs are
searched in doubles and made in ball arithmetic.
"""

from __future__ import annotations

import heapq
import math
import warnings
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgError, solve_continuous_lyapunov

from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench.certify.proofs.gain_boxes import box_corners
from workbench.errors import InputError
from workbench.executor.clock import tick
from workbench.input_checks import as_array, need_kind, need_positive, need_whole
from workbench.synthesis.mu.structured.norm.gain_box import (
    BoxProof,
    GainBoxBound,
    GainBoxChecker,
)
from workbench.synthesis.mu.structured.norm.loop_norm import peak_of
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.standard_plant import StandardPlant, standard_plant

MOST_GAINS = 6
"""Largest number of gains that vary in a box. The number of boxes grows exponentially with it."""
FREQUENCIES, DECADES = 120, 3.0
"""Number of frequencies that are tried, and decades that they extend beyond the plant's poles."""
BESIDE = 1.001
"""Ratio of the frequencies tried beside a resonance of the plant to the resonance."""


def least_norm_in_box(
    plant: GeneralisedPlant,
    low: ArrayLike,
    high: ArrayLike,
    *,
    distance: float = 0.05,
    most_boxes: int = 20_000,
) -> GainBoxBound:
    """Prove a lower bound on the norm of a loop with a constant gain in a box.

    Parameters
    ----------
    plant
        A continuous plant without direct term from the controls to the measurements; u = K y with
        positive feedback. Perturbation channels count as exogenous inputs and performance outputs.
        The plant needs as many exogenous inputs as measurements, or as many performance outputs as
        controls.
    low, high
        The lowest and the highest gains (controls, measurements). They may differ in at most six
        entries.
    distance
        The search ends at this relative distance between the proven bound and the best norm found.
    most_boxes
        Largest number of boxes. If it is reached, the answer is the bound of the boxes so far, and
        ``finished`` is False.

    Raises
    ------
    InputError
        The plant is sampled, has a direct term or too few signals; or the box does not fit.

    References
    ----------
    V. Balakrishnan, S. Boyd, S. Balemi, Branch and bound algorithm for computing the minimum
    stability degree of parameter-dependent linear systems, Int. J. Robust and Nonlinear Control 1
    (1991) 295-317.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import least_norm_in_box
    >>> from workbench.uncertainty import GeneralisedPlant
    >>> B, C, D = [[1.0, 0, 1]], [[1.0], [0], [1]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]]
    >>> plant = GeneralisedPlant(control.ss([[1.0]], B, C, D), None, 1, 1)
    >>> least_norm_in_box(plant, [[0.0]], [[10.0]])  # positive feedback does not stabilise
    GainBoxBound: no gain in 0 to 10 stabilises, proven on 1 boxes
      for all gains of the box; certificate made when asked for
    """
    need_kind(plant, GeneralisedPlant, "plant")
    need_positive(distance, "distance")
    need_whole(most_boxes, "most_boxes")
    search = _Search(standard_plant(plant), *_checked_box(plant, low, high))
    return search.bounded(distance, most_boxes)


def _checked_box(
    plant: GeneralisedPlant, low: ArrayLike, high: ArrayLike
) -> tuple[RealArray, RealArray]:
    """Check the box and return its lowest and highest gains."""
    if plant.system.dt:
        raise InputError(f"the plant is sampled (dt = {plant.system.dt}); it must be continuous")
    if np.any(plant.controlled().D):
        raise InputError("the plant has a direct term from the controls to the measurements")
    z, w = plant.unstructured().performance, plant.unstructured().exogenous
    if z < plant.controls and w < plant.measurements:
        raise InputError(
            f"{w} exogenous inputs for {plant.measurements} measurements and {z} performance "
            f"outputs for {plant.controls} controls: as many of one kind are needed"
        )
    shape = (plant.controls, plant.measurements)
    ends = []
    for name, value in (("low", low), ("high", high)):
        end = np.asarray(as_array(value, name), dtype=float)
        if end.shape != shape or not np.isfinite(end).all():
            raise InputError(f"{name} has shape {end.shape}; finite gains {shape} are needed")
        ends.append(end)
    if (ends[0] > ends[1]).any():
        raise InputError("low is above high in some entry: every gain must lie between them")
    moving = int((ends[0] < ends[1]).sum())
    if moving > MOST_GAINS:
        raise InputError(f"{moving} gains may move; {MOST_GAINS} at most, since boxes are halved")
    return ends[0], ends[1]


@dataclass(eq=False)
class _Search:
    """The search over boxes of gains."""

    P: StandardPlant
    low: RealArray
    high: RealArray
    upper: float = math.inf
    gain: RealArray = field(default_factory=lambda: np.zeros((0, 0)))
    proofs: list[BoxProof] = field(default_factory=list)

    def bounded(self, distance: float, most_boxes: int) -> GainBoxBound:
        """Halve the box with the least bound until this bound is close to the best norm."""
        number, lower, finished = 1, math.inf, True
        level, proof = self._proof_of_box(self.low, self.high)
        open_boxes = [(level, 0, proof)]
        while open_boxes:
            level, _, proof = open_boxes[0]
            close = level >= self.upper / (1.0 + distance)
            if close or number >= most_boxes:
                lower, finished = level, close
                break
            tick("branch and bound over gains")
            heapq.heappop(open_boxes)
            if math.isinf(level):
                self.proofs.append(proof)
                continue
            for half in self._halves(*proof.box):
                number += 1
                found, made = self._proof_of_box(*half)
                heapq.heappush(open_boxes, (found, number, made))
        self.proofs += [proof for _, _, proof in open_boxes]
        answer = GainBoxBound(
            self.low, self.high, lower, self.upper, self.gain, finished, tuple(self.proofs)
        )
        return answer.with_checker(GainBoxChecker(self.P, self.low, self.high))

    def _halves(self, low: RealArray, high: RealArray) -> list[tuple[RealArray, RealArray]]:
        """Both halves of the box, cut along the gain whose range is the largest share of its
        initial range.
        """
        share = (high - low) / np.where(self.high > self.low, self.high - self.low, np.inf)
        place = np.unravel_index(int(np.argmax(share)), low.shape)
        below, above = high.copy(), low.copy()
        below[place] = above[place] = (low[place] + high[place]) / 2
        return [(low, below), (above, high)]

    def _proof_of_box(self, low: RealArray, high: RealArray) -> tuple[float, BoxProof]:
        """The proven level of a box, and its proof."""
        centre, box = (low + high) / 2, (low, high)
        peak = math.nan
        if np.linalg.eigvals(self._closed(centre)).real.max(initial=-1.0) < 0:
            peak = self._peak_frequency(centre)
        else:
            proof = BoxProof(box, self._decreasing_form(low, high))
            if proof.form is not None and math.isinf(proof.level(self.P)):
                return math.inf, proof
        omega = np.append(self._omega, peak if self._off_poles(np.array([peak]))[0] else np.inf)
        best = max(
            (
                self._best_frequency(omega, centre, (high - low) / 2, dual)
                for dual in self._possible_proofs
            ),
            key=lambda each: each[0],
        )
        proof = BoxProof(box, None, *best[1:])
        return proof.level(self.P), proof

    @property
    def _possible_proofs(self) -> list[bool]:
        """Whether proofs are possible with the plant itself, and whether with the transposed
        plant.
        """
        P = self.P
        own, dual = P.B1.shape[1] >= P.measurements, len(P.C1) >= P.controls
        return [kind for kind, fits in ((False, own), (True, dual)) if fits]

    def _closed(self, K: RealArray) -> RealArray:
        closed: RealArray = self.P.A + self.P.B2 @ K @ self.P.C2
        return closed

    def _peak_frequency(self, K: RealArray) -> float:
        """The frequency of the peak for a stabilising gain; remembers the gain with the least
        norm.
        """
        none = np.zeros((0, 0))
        gain = none, np.zeros((0, K.shape[1])), np.zeros((K.shape[0], 0)), K
        size, omega = peak_of(self.P.close(gain))
        if size < self.upper:
            self.upper, self.gain = size, K
        return omega

    def _decreasing_form(self, low: RealArray, high: RealArray) -> RealArray | None:
        """A quadratic form, in doubles, that decreases at the corners of a box; None if there is
        none.
        """
        A = self._closed((low + high) / 2)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", RuntimeWarning)
                form = solve_continuous_lyapunov(A.T, -np.eye(len(A)))
        except (LinAlgError, RuntimeWarning):
            return None
        form = (form + form.T) / 2
        for corner in box_corners((low, high)):
            moved = self._closed(corner).T @ form
            if np.linalg.eigvalsh(moved + moved.T)[-1] >= 0:
                return None
        return np.asarray(form, dtype=float)

    @cached_property
    def _omega(self) -> RealArray:
        """Frequencies (F,) that are tried; the last one is infinite."""
        poles = np.linalg.eigvals(self.P.A)
        sizes = np.abs(poles)
        top = float(sizes.max(initial=0.0)) or 1.0
        bottom = float(sizes[sizes > 1e-6 * top].min(initial=top))
        reach = 10.0**DECADES
        grid = np.geomspace(bottom / reach, top * reach, FREQUENCIES)
        resonant = np.abs(poles.imag[poles.imag > 1e-9 * top])
        omega = np.union1d(grid, BESIDE * resonant)
        return np.append(omega[self._off_poles(omega)], np.inf)

    def _off_poles(self, omega: RealArray) -> Array:
        """Mask of the frequencies (F,) that are positive and not close to a pole of the plant."""
        poles = np.linalg.eigvals(self.P.A)
        known = np.isfinite(omega)
        apart = np.abs(1j * np.where(known, omega, 0.0)[:, None] - poles).min(
            axis=1, initial=np.inf
        )
        found: Array = known & (omega > 0) & (apart > (BESIDE - 1) / 10 * omega)
        return found

    def _response(self, omega: RealArray) -> ComplexArray:
        """The plant at frequencies (F,) [rad/s], some of them infinite."""
        P = self.P
        finite = np.isfinite(omega)
        beyond = 1.0 + 2.0 * float(np.abs(P.A).sum())  # than any pole; its response is not used
        inside = 1j * np.where(finite, omega, beyond)[:, None, None] * np.eye(P.states) - P.A
        moved = P.C @ np.linalg.solve(inside, np.broadcast_to(P.B, (len(omega), *P.B.shape)))
        found: ComplexArray = P.D + finite[:, None, None] * moved
        return found

    @cached_property
    def _on_grid(self) -> ComplexArray:
        return self._response(self._omega)

    def _best_frequency(
        self, omega: RealArray, K: RealArray, radius: RealArray, dual: bool
    ) -> tuple[float, float, tuple[Array, Array] | None, bool]:
        """The largest level that one frequency proves for a box, in doubles, with the frequency, w
        and y.
        """
        P, whole = self.P, np.concatenate([self._on_grid, self._response(omega[-1:])])
        z, w = len(P.C1), P.B1.shape[1]
        if dual:
            whole, z, w, K, radius = whole.swapaxes(1, 2), w, z, K.T, radius.T
        P11, P12, P21, P22 = whole[:, :z, :w], whole[:, :z, w:], whole[:, z:, :w], whole[:, z:, w:]
        p = P21.shape[1]
        none = 0.0, math.nan, None, dual
        with np.errstate(all="ignore"):
            try:
                loop = np.linalg.solve(np.eye(p) - P22 @ K, P21)
                R = np.linalg.pinv(P21)
                N = P11 + P12 @ K @ loop
                size, vh = np.linalg.svd(N)[1:]
            except np.linalg.LinAlgError:
                return none
            v = vh[:, :1].conj().swapaxes(1, 2)
            y = loop @ v
            reach = np.abs(y[:, :, 0]) @ radius.T
            outward = np.linalg.norm(P12 - P11 @ R @ P22, axis=1)
            inward = np.linalg.norm(R @ P22, axis=1)
            level = (size[:, 0] - (reach * outward).sum(axis=1)) / (
                1.0 + (reach * inward).sum(axis=1)
            )
        regular = np.linalg.matrix_rank(P21) == p
        level = np.where(np.isfinite(level) & regular, level, 0.0)
        place = int(np.argmax(level))
        if not level[place] > 0.0:
            return none
        return float(level[place]), float(omega[place]), (v[place], y[place]), dual
