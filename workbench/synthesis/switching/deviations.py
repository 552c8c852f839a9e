"""Largest error of a switched loop over every sequence of measurement defects.

The disturbance is w = Re(a exp(j omega t)), with any phase. Before the first defect the loop is in
its steady motion x = Re(X exp(j omega t)). A defect adds a deviation d from this motion,

    d[k + 1] = A_o d[k] + q exp(j omega t_k) + B_o v[k]    in the defect, q = (A_o - A_c) X + ...
    d[k + 1] = A_c d[k]                                    after it,

where v is the false signal that the defect adds to the filtered disturbance, |v| <= F. The
deviation due to one defect is computed exactly. The deviation that all earlier defects leave at its
start is bounded by V_i = x' P_i x:

    r = g_c b / (1 - g_o g_c), b the largest V_c^(1/2) after one defect,

g_o and g_c being the largest factors of V^(1/2) over a defect and over the distance to the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.synthesis.switching.loops import SwitchedLoop

NDArrayInt = NDArray[np.int64]
HORIZON = 2000
"""Number of samples after a defect that are computed one by one in bounds. V_c bounds later ones.
"""
SIMULATED = 400
"""Number of samples after a defect at which the simulated error is evaluated."""
OUTWARD = 1.0 + 1e-9
"""Factor that enlarges a bound to cover the rounding errors of its computation."""


@dataclass(frozen=True, eq=False)
class Deviations:
    """Errors of a switched loop for defects of 1 ... N samples, where N is `longest`.

    Parameters
    ----------
    loop
        The loop; it must be stable in its clean mode.
    amplitude, omega
        Amplitudes of the disturbance and its angular frequencies [rad/s] (F,). Only one of these
        sines acts at a time.
    longest
        Length of the longest defect in samples.
    false
        The bound F on |v|, in the unit of the amplitudes.

    Raises
    ------
    InputError
        Frequencies and amplitudes have different shapes; the longest defect has no sample; F is
        negative.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.simulation import sampled_model
    >>> from workbench.synthesis import (
    ...     Deviations,
    ...     SampledPlant,
    ...     discretise,
    ...     dropout_modes,
    ...     switched_loop,
    ... )
    >>> G = sampled_model(control.ss(-2.0, 1.0, [[1.0], [1.0]], 0.0), 0.1)
    >>> plant = SampledPlant(G.A, G.B, G.C[:1], G.C[1:], 1.0, 0.1, np.ones_like)
    >>> K = discretise(control.tf([1.0, 1.0], [1.0, 0.01]), 0.1)
    >>> loop = switched_loop(plant, dropout_modes(K))
    >>> found = Deviations(
    ...     loop, amplitude=np.array([2.0]), omega=np.array([0.5]), longest=8, false=0.3
    ... )
    >>> abs(found.steady_error).shape, bool(abs(found.steady_error[0]) < 2.0)
    ((1,), True)
    """

    loop: SwitchedLoop
    amplitude: RealArray
    omega: RealArray
    longest: int
    false: float

    def __post_init__(self) -> None:
        if self.omega.ndim != 1 or self.amplitude.shape != self.omega.shape:
            raise InputError(
                f"amplitude has shape {self.amplitude.shape}, omega {self.omega.shape}; both must "
                "be (F,)"
            )
        if self.longest < 1 or not self.false >= 0.0:
            raise InputError(
                f"longest is {self.longest} samples, false {self.false}; need 1 or more, and 0 or "
                "more"
            )

    @cached_property
    def phase_factor(self) -> ComplexArray:
        """Factor by which the phasor of the disturbance turns in one sample (F,)."""
        return np.asarray(np.exp(1j * self.omega * self.loop.dt))

    @cached_property
    def steady_phasor(self) -> ComplexArray:
        """X (F, n): phasor of the loop's state without defects."""
        A, B = self.loop.clean
        measured = self.amplitude * self.loop.filter(self.omega)
        found = np.linalg.solve(
            self.phase_factor[:, None, None] * np.eye(len(A)) - A, B[None] * measured[:, None, None]
        )[..., 0]
        return np.asarray(found)

    @cached_property
    def steady_error(self) -> ComplexArray:
        """Phasor of the error w - output x (F,) without defects."""
        error = self.amplitude - (self.steady_phasor @ self.loop.output.T)[:, 0]
        return np.asarray(error)

    @cached_property
    def forced_deviation(self) -> ComplexArray:
        """Phasor of d after 0 ... N samples of a defect (N + 1, F, n); the disturbance starts at
        phase 0.
        """
        (A_c, B_c), (A_o, B_o) = self.loop.clean, self.loop.defect
        measured = self.amplitude * self.loop.filter(self.omega)
        q = self.steady_phasor @ (A_o - A_c).T + measured[:, None] * (B_o - B_c)[:, 0]
        d = np.zeros((self.longest + 1, *q.shape), complex)
        for k in range(self.longest):
            d[k + 1] = d[k] @ A_o.T + q * self.phase_factor[:, None] ** k
        return d

    @cached_property
    def impulse_deviations(self) -> RealArray:
        """A_o^j B_o for j = 0 ... N - 1 (N, n): deviation that v = 1 in one sample causes j samples
        later.
        """
        A, B = self.loop.defect
        found = [B[:, 0]]
        for _ in range(self.longest - 1):
            found.append(A @ found[-1])
        return np.array(found)

    @cached_property
    def rows(self) -> RealArray:
        """Rows output A_c^k for k = 0 ... HORIZON (HORIZON + 1, n)."""
        found = [self.loop.output[0]]
        for _ in range(HORIZON):
            found.append(found[-1] @ self.loop.clean[0])
        return np.array(found)

    def single_defect_error(self, root: RealArray) -> RealArray:
        """Largest error with one defect of 1 ... n samples (N,), for the worst phase and the worst
        v.

        root (n, n) is a factor of P_c = root root', which bounds the error after the horizon.
        """
        output, steps = self.loop.output[0], np.arange(self.longest + 1)
        phase = self.phase_factor ** steps[:, None]
        disturbed = abs(self.steady_error * phase - self.forced_deviation @ output)  # (N + 1, F)
        follows = np.concatenate([[0.0], np.cumsum(abs(self.impulse_deviations @ output))])
        during = disturbed.max(axis=1) + self.false * follows
        after = np.zeros(self.longest)
        ahead = self.phase_factor ** np.arange(HORIZON + 1)[:, None]
        left = self.false * np.cumsum(
            abs(self.rows @ self.impulse_deviations.T), axis=1
        )  # (HORIZON + 1, N)
        for n in range(1, self.longest + 1):
            swing = self.steady_error * ahead * phase[n] - self.rows @ self.forced_deviation[n].T
            after[n - 1] = (abs(swing).max(axis=1) + left[:, n - 1]).max()
        end = np.linalg.matrix_power(self.loop.clean[0], HORIZON)
        tail = abs(self.steady_error).max() + self.reach(root) * self._size_after_defect(root, end)
        own = np.maximum(np.maximum.accumulate(during)[1:], np.maximum(after, tail))
        return np.asarray(np.maximum.accumulate(own))

    def reach(self, root: RealArray) -> float:
        """Largest |output x| over all x with x' P x = 1, where P = root root'."""
        return float(np.linalg.norm(np.linalg.solve(root, self.loop.output[0])))

    def _size_after_defect(self, root: RealArray, after: RealArray) -> RealArray:
        """Bound on V^(1/2) of the deviation after a defect of 1 ... N samples and then a transition
        (N,).
        """
        y = self.forced_deviation[1:] @ (root.T @ after).T
        # the largest |Re(y exp(j phase))| over all phases
        square = (abs(y) ** 2).sum(axis=-1) + abs((y**2).sum(axis=-1))
        disturbed = np.sqrt(square / 2).max(axis=1)
        false = self.false * np.cumsum(
            np.linalg.norm(self.impulse_deviations @ (root.T @ after).T, axis=1)
        )
        return np.asarray(disturbed + false)

    def proven(self, P: RealArray, distances_samples: NDArrayInt) -> RealArray:
        """Bounds on the error (N, distances) for defects of at most n samples with these least
        distances.

        P (2, n, n) are the matrices of the clean and the defect mode, as `SwitchedStability` gives
        them; ``distances_samples`` [samples] are lengths. The bound is infinite where P do not
        bound the error.
        """
        root_c, root_o = (np.linalg.cholesky(each) for each in P)
        A_c, A_o = self.loop.clean[0], self.loop.defect[0]
        g_o = np.maximum.accumulate(
            _growth_over_stays(A_o, root_o, root_c, range(1, self.longest + 1))
        )
        g_c = _growth_over_stays(A_c, root_c, root_o, distances_samples)
        b = np.maximum.accumulate(self._size_after_defect(root_c, np.eye(len(A_c))))
        output, seen = self.loop.output[0], []
        for _ in range(self.longest):
            seen.append(np.linalg.norm(np.linalg.solve(root_o, output)))
            output = output @ A_o
        reach = np.maximum(np.maximum.accumulate(seen), self.reach(root_c) * g_o)
        product = g_o[:, None] * g_c
        with np.errstate(divide="ignore"):
            r = np.where(product < 1.0, g_c * b[:, None] / (1.0 - product), np.inf)
        if (
            _growth_over_stays(A_c, root_c, root_c, [1])[0] > 1.0
        ):  # a longer distance may then be worse
            r[:] = np.inf
        bound: RealArray = OUTWARD * (
            self.single_defect_error(root_c)[:, None] + reach[:, None] * r
        )
        return bound

    def simulated(self, samples: int, distance: int, count: int) -> float:
        """Largest error with `count` equal defects at equal distances, for the worst phase.

        Each defect has `samples` samples; `distance` is the number of samples from its end to the
        next defect. v is one period of a sine with amplitude F over each defect.
        """
        (A_c, _), (A_o, B_o) = self.loop.clean, self.loop.defect
        v = self.false * np.sin(2 * np.pi * (np.arange(samples) + 0.5) / samples)
        during = np.array([np.linalg.matrix_power(A_o, k) for k in range(samples + 1)])
        swing = np.zeros((samples + 1, len(A_o)))
        for k in range(samples):
            swing[k + 1] = A_o @ swing[k] + B_o[:, 0] * v[k]
        rest = np.linalg.matrix_power(A_c, distance)
        ahead = self.phase_factor ** np.arange(samples + 1)[:, None]
        rows, output = self.rows[: min(distance, SIMULATED) + 1], self.loop.output[0]
        d, false = np.zeros_like(self.steady_phasor), np.zeros(len(A_o))
        start, worst = np.ones_like(self.phase_factor), 0.0
        for _ in range(count):
            # (samples + 1, F, n): deviation left by earlier defects, plus that of this defect
            path = (
                np.einsum("kij,fj->kfi", during, d)
                + self.forced_deviation[: samples + 1] * start[:, None]
            )
            other = during @ false + swing
            error = self.steady_error * start * ahead - path @ output
            worst = max(worst, float((abs(error) + abs(other @ output)[:, None]).max()))
            start = start * ahead[-1]
            after = self.steady_error * start * self.phase_factor ** np.arange(len(rows))[:, None]
            error = after - rows @ path[-1].T
            worst = max(worst, float((abs(error) + abs(rows @ other[-1])[:, None]).max()))
            d, false = path[-1] @ rest.T, rest @ other[-1]
            start = start * self.phase_factor**distance
        return worst


def _growth_over_stays(
    A: RealArray, root: RealArray, after: RealArray, stays: NDArrayInt | Sequence[int]
) -> RealArray:
    """Largest ratio of the next mode's V^(1/2) after a stay to a mode's own V^(1/2) before it, by
    stay.
    """
    back = np.linalg.inv(root.T)
    return np.array(
        [np.linalg.norm(after.T @ np.linalg.matrix_power(A, int(n)) @ back, 2) for n in stays]
    )
