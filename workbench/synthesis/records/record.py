"""Records of states and inputs, and the set of plants that agree with them.

    x[t + 1] = A x[t] + B u[t] + w[t],    (W - W0) R (W - W0)' <= E,

where the columns of W are the unknown noise samples. With Z = [X; U], the plants theta = [A B] that
agree with the records satisfy a quadratic matrix inequality,

    [I theta] N [I theta]' >= 0,    N = [I X_next - W0; 0 -Z] [E 0; 0 -R] [I X_next - W0; 0 -Z]'.

Source: H. J. van Waarde, M. K. Camlibel, M. Mesbahi, From noisy data to feedback controllers:
nonconservative design via a matrix S-lemma, IEEE Trans. Automatic Control 67 (2022) 162-175.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import eigh

from workbench._core.arrays import RealArray
from workbench.certify.rounding import (
    Enclosure,
    exact,
    nearest_power_of_two,
    positive_definite,
    solution,
    stacked_enclosures,
)
from workbench.errors import InputError
from workbench.input_checks import as_array, need_count, need_positive

SYMMETRY_ROUNDING = 1e-12
"""Largest difference of two opposite entries of a symmetric matrix, relative to its largest
entry.
"""


@dataclass(frozen=True, eq=False)
class NoiseEnergy:
    """The noise samples W (n, T) with (W - mean) weight (W - mean)' <= energy.

    Every bound by a quadratic matrix inequality [I; W']' Phi [I; W'] >= 0 with Phi_22 < 0 is of
    this form.

    Parameters
    ----------
    energy
        Positive definite (n, n), in the squared units of the states.
    weight
        Positive definite (T, T); None for the identity.
    mean
        Known part of the noise (n, T); None for zero.

    Raises
    ------
    InputError
        A matrix has another shape, is not finite, or is not symmetric and positive definite.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.synthesis import NoiseEnergy
    >>> noise = NoiseEnergy(0.3 * np.eye(2))  # of noise with W W' <= 0.3 I
    >>> noise.energy.tolist()
    [[0.3, 0.0], [0.0, 0.3]]
    """

    energy: RealArray
    _: KW_ONLY
    weight: RealArray | None = None
    mean: RealArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "energy", _positive_definite("energy", self.energy))
        if self.weight is not None:
            object.__setattr__(self, "weight", _positive_definite("weight", self.weight))
        if self.mean is not None:
            mean = as_array(self.mean, "mean")
            if mean.ndim != 2 or len(mean) != len(self.energy) or not np.isfinite(mean).all():
                raise InputError(
                    f"mean has shape {mean.shape}; finite numbers of shape ({len(self.energy)}, T) "
                    "are needed"
                )
            object.__setattr__(self, "mean", mean)

    @classmethod
    def of_samples(cls, radius: float, states: int, samples: int) -> NoiseEnergy:
        """The bound that follows from |w| <= radius in each of the samples: W W' <= T radius^2 I.

        Raises InputError for a radius that is not positive, or a count that is not a positive
        integer.
        """
        need_positive(radius, "radius")
        need_count("states", states)
        need_count("samples", samples)
        return cls(samples * radius**2 * np.eye(states))


@dataclass(frozen=True, eq=False)
class StateRecords:
    """Records of states and inputs, with a bound on the noise between them.

    Parameters
    ----------
    states
        X (n, T), the states at T instants; several experiments may follow each other.
    inputs
        U (m, T), the inputs at these instants.
    next_states
        X_next (n, T), the states one sample later.
    noise
        Bound on the noise W = X_next - A X - B U of the true plant.

    Raises
    ------
    InputError
        Shapes do not fit, or a number is not finite. Or [X; U] does not have full row rank: the
        plants then form an unbounded set, and a single rounding error of a gain makes some of them
        unstable. Or the noise bound contradicts the records: no plant, or no open set of plants,
        agrees with them.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.synthesis import NoiseEnergy, StateRecords
    >>> rng = np.random.default_rng(0)
    >>> x, u, w = (
    ...     rng.standard_normal((2, 30)),
    ...     rng.standard_normal((1, 30)),
    ...     rng.random((2, 30)) - 0.5,
    ... )
    >>> next_states = [[1.1, 0.3], [0.0, 0.7]] @ x + [[0.2], [1.0]] @ u + 0.2 * w
    >>> records = StateRecords(x, u, next_states, NoiseEnergy(0.3 * np.eye(2)))
    >>> records.order, records.controls, records.samples
    (2, 1, 30)
    """

    states: RealArray
    inputs: RealArray
    next_states: RealArray
    noise: NoiseEnergy

    def __post_init__(self) -> None:
        for name in ("states", "inputs", "next_states"):
            values = as_array(getattr(self, name), name)
            if values.ndim != 2 or not values.size or not np.isfinite(values).all():
                raise InputError(f"{name} has shape {values.shape}; finite rows (n, T) are needed")
            object.__setattr__(self, name, values)
        n, samples = self.states.shape
        if self.next_states.shape != (n, samples) or self.inputs.shape[1] != samples:
            shapes = f"{self.states.shape}, {self.inputs.shape} and {self.next_states.shape}"
            raise InputError(
                f"states, inputs and next_states have shapes {shapes}; (n, T), (m, T) and (n, T) "
                "are needed"
            )
        if not isinstance(self.noise, NoiseEnergy):
            raise InputError(f"noise is {self.noise!r}; a NoiseEnergy is needed")
        weight, mean = self.noise.weight, self.noise.mean
        if len(self.noise.energy) != n:
            raise InputError(f"the noise bound has {len(self.noise.energy)} states, not {n}")
        for name, given in (("weight", weight), ("mean", mean)):
            if given is not None and given.shape[1] != samples:
                raise InputError(f"{name} of the noise has {given.shape[1]} samples, not {samples}")
        self._check_rank()
        self._check_noise()

    @classmethod
    def of_run(cls, states: Any, inputs: Any, noise: NoiseEnergy) -> StateRecords:
        """Records of one experiment: states (n, T + 1) and inputs (m, T)."""
        states = as_array(states, "states")
        if states.ndim != 2:
            raise InputError(f"states has shape {states.shape}; (n, T + 1) is needed")
        return cls(states[:, :-1], inputs, states[:, 1:], noise)

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.states)

    @property
    def controls(self) -> int:
        """Number of inputs."""
        return len(self.inputs)

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.states.shape[1]

    @cached_property
    def regressors(self) -> RealArray:
        """Z = [X; U] (n + m, T)."""
        return np.vstack([self.states, self.inputs])

    @cached_property
    def scale(self) -> RealArray:
        """Powers of two (n + m,) near the root mean square of each state and input."""
        found: RealArray = nearest_power_of_two(np.sqrt(np.mean(self.regressors**2, axis=1)))
        return found

    @cached_property
    def _weighted_qr(self) -> tuple[RealArray, RealArray]:
        """Q (T, n + m) and R (n + m, n + m) with (regressors / scale) root(weight) = R' Q'."""
        Z = self.regressors / self.scale[:, None]
        if self.noise.weight is not None:
            Z = Z @ np.linalg.cholesky(self.noise.weight)
        Q, R = np.linalg.qr(Z.T)
        return Q, R

    @cached_property
    def frame(self) -> RealArray:
        """H (n + m, n + m) that makes the rows of H Z almost orthonormal with the weight.

        Plants are theta = centre + delta H. Raises LinAlgError if the rank is not full.
        """
        found: RealArray = np.linalg.inv(self._weighted_qr[1]).T / self.scale
        return found

    @cached_property
    def centre(self) -> RealArray:
        """The least squares plant [A B] (n, n + m), which is the centre of the set."""
        after = self.next_states - (0.0 if self.noise.mean is None else self.noise.mean)
        if self.noise.weight is not None:
            after = after @ np.linalg.cholesky(self.noise.weight)
        found: RealArray = after @ self._weighted_qr[0] @ self.frame
        return found

    @cached_property
    def inequality(self) -> Enclosure:
        """Enclosure of N (2 n + m, 2 n + m) with [I delta] N [I delta]' >= 0 for the plants.

        About the centre and in the coordinates of `frame`, N is almost diag(S, -I). The N of theta
        itself would lose digits of all that is much smaller than the states.
        """
        Z, residual = exact(self.regressors), exact(self.next_states)
        residual = residual - exact(self.centre) @ Z
        if self.noise.mean is not None:
            residual = residual - exact(self.noise.mean)
        Z = exact(self.frame) @ Z
        weight = None if self.noise.weight is None else exact(self.noise.weight)
        heavy = [part if weight is None else part @ weight for part in (residual, Z)]
        across = heavy[0] @ Z.H
        corner = exact(self.noise.energy) - heavy[0] @ residual.H
        return stacked_enclosures([[corner, across], [across.H, -(heavy[1] @ Z.H)]])

    @cached_property
    def ellipsoid(self) -> tuple[RealArray, RealArray]:
        """S (n, n) and E (n + m, n + m); the plants are centre + root(S) Delta E with |Delta| <= 1.

        root(S) is any matrix with root(S) root(S)' = S. S and E are midpoints of enclosures, for
        methods and figures.
        """
        n, N = self.order, self.inequality.mid
        slack = N[:n, :n] - N[:n, n:] @ np.linalg.solve(N[n:, n:], N[n:, :n])
        root = np.linalg.cholesky(-(N[n:, n:] + N[n:, n:].T) / 2)
        return (slack + slack.T) / 2, np.linalg.solve(root, self.frame)

    # --- what is refused ----------------------------------------------------------------------

    def _check_rank(self) -> None:
        n, total = self.order, self.order + self.controls
        try:
            if positive_definite(-_block(self.inequality, slice(n, None), slice(n, None))):
                return
        except np.linalg.LinAlgError:
            pass
        rank = int(np.linalg.matrix_rank(self.regressors / self.scale[:, None]))
        raise InputError(
            f"states and inputs together have rank {rank} of {total}, as far as doubles can tell, "
            f"in {self.samples} samples: the set of plants is unbounded; excite every input, "
            "independently of the states, for more samples"
        )

    def _check_noise(self) -> None:
        """Raise InputError unless the set has an inner point (Slater condition), which proofs
        need.
        """
        n, N = self.order, self.inequality
        first, second = slice(0, n), slice(n, None)
        inner = solution(-_block(N, second, second), _block(N, second, first))
        slack = None if inner is None else _block(N, first, second) @ inner
        if slack is not None and positive_definite(_block(N, first, first) + slack):
            return
        energy = self.noise.energy
        spent = energy - self.ellipsoid[0]
        grown = float(eigh((spent + spent.T) / 2, energy, eigvals_only=True)[-1])
        raise InputError(
            "the noise bound contradicts the records, or allows one plant only: the residuals "
            f"of the best plant have {grown:.6g} times the energy allowed; it must be below 1 times"
        )


def _block(matrix: Enclosure, rows: slice, columns: slice) -> Enclosure:
    """The block of an enclosure in these rows and columns."""
    return Enclosure(matrix.mid[rows, columns], matrix.rad[rows, columns])


def _positive_definite(name: str, given: Any) -> RealArray:
    """A positive definite matrix, made exactly symmetric."""
    matrix = as_array(given, name)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.size:
        raise InputError(f"{name} has shape {matrix.shape}; a square matrix is needed")
    largest = np.abs(matrix).max()
    if not (largest < np.inf and np.abs(matrix - matrix.T).max() <= SYMMETRY_ROUNDING * largest):
        raise InputError(f"{name} must be finite and symmetric")
    matrix = (matrix + matrix.T) / 2
    if not positive_definite(exact(matrix)):
        least = float(np.linalg.eigvalsh(matrix)[0])
        raise InputError(f"{name} must be positive definite; its least eigenvalue is {least:.6g}")
    return matrix
