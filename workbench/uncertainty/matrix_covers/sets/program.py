"""The smallest sets {Z + W_1 Delta W_2, |Delta| <= 1} that contain matrices, at each frequency.

Their size is one of three. "volume" is the geometric mean of the radius in all directions, which
does not depend on the units of the channels. "trace" is the square root of tr W_1 W_1^* / p times
tr W_2^* W_2 / m. "mu" is the mu of a loop that they perturb, times a small power of the radius.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np

from workbench._core.arrays import EPS, Array, RealArray
from workbench._core.heavy_types import Dataset
from workbench.answer import ProgramAnswer
from workbench.certificate import Check, worst_value
from workbench.errors import InputError
from workbench.input_checks import as_array, need_choice, need_numbers
from workbench.program import Program
from workbench.uncertainty.matrix_covers.sets.channels import equilibrated
from workbench.uncertainty.matrix_covers.sets.loop import (
    VOLUME_SHARE,
    loop_in_unit,
    loop_level,
    mu_excess,
    need_loop,
    scaled_loop,
)
from workbench.uncertainty.matrix_covers.sets.optimality import (
    SMALLEST,
    InUnits,
    farthest,
    trace_bound,
    volume_excess,
)
from workbench.uncertainty.matrix_covers.sets.shapes import WeightShape, ctranspose, of_shape

Size = Literal["volume", "trace", "mu"]
Centre = Literal["zero", "free"]

CONTAINED = 1e-9
"""Excess of a norm of Delta over 1 that counts as rounding. Norms are rounded up, so a little is
left for another processor. With half of it a run may be refused there for an ill-conditioned set;
double accepts 2e-9.
"""
SQUARES_CONTAINED = 1e-7
"""The same excess for the squares in the second opinion. Squares of ill-conditioned weights cost
half of the digits. With half of it a true answer may be contradicted; double overlooks 2e-7.
"""
ALIKE = 64 * EPS
"""Spread of deviations, relative to their size, that counts as rounding."""
SHAPED = 1e-9
"""Largest relative part of a weight outside its shape that counts as rounding. It is far above the
rounding of a product and far below an entry that means anything. Half or double decides the same.
"""


@dataclass(frozen=True, eq=False, repr=False)
class FoundSets(ProgramAnswer):
    """Sets at F frequencies, with centres Z and weights W_1 and W_2.

    Parameters
    ----------
    left, right
        W_1 (F, p, p), lower triangular, and W_2 (F, m, m), upper triangular with determinant 1.
    centre
        Z (F, p, m).
    weights
        Weights (F, N + p m, min(p, m)) that prove that no set is smaller; see
        `workbench.uncertainty.matrix_covers.sets.optimality`. Zeros prove nothing.
    of_loop
        Further data (F, 2 + rank) of the proof for sets of least mu; see
        `workbench.uncertainty.matrix_covers.sets.loop`.
    """

    left: Array
    right: Array
    centre: Array
    weights: RealArray
    of_loop: RealArray | None = None

    def summary(self) -> str:
        size = self.radius
        return (
            f"sets at {size.size} frequencies, with mean radii from {size.min():.4g} to "
            f"{size.max():.4g}"
        )

    @property
    def radius(self) -> RealArray:
        """Geometric mean (F,) of the radius in all directions."""
        logs = [np.linalg.slogdet(W)[1] / W.shape[-1] for W in (self.left, self.right)]
        return np.exp(logs[0] + logs[1])

    def deltas(self, matrices: Array) -> Array:
        """Delta (F, N, p, m) of each of the matrices (F, N, p, m)."""
        P, S = np.linalg.inv(self.left), np.linalg.inv(self.right)
        found: Array = P[:, None] @ (matrices - self.centre[:, None]) @ S[:, None]
        return found


@dataclass(frozen=True, eq=False)
class MatrixSets(Program):
    """The smallest sets Z + W_1 Delta W_2 with |Delta| <= 1 that contain N matrices.

    It is the first step of a `MatrixCover`: no weights give smaller sets at a frequency.
    Frequencies are independent of each other.

    Parameters
    ----------
    deviations
        Complex matrices (F, N, p, m).
    left, right
        Shapes of W_1 and W_2: ``"full"``, ``"diagonal"`` or ``"scalar"``.
    centre
        ``"zero"``, or ``"free"`` to optimise the centre together with the weights.
    size
        ``"volume"``, ``"trace"`` or ``"mu"``. The optimum is global, except for the volume with a
        free centre.
    floor
        Every set must also contain a small change of each single entry: this share of the product
        of the sizes of its row and its column. Otherwise sets of few matrices would be flat and
        have no volume.
    loop
        Only for the size ``"mu"``: responses (F, m + q, p + r) of a loop from (u, w) to (y, z). It
        is closed with u = X y, where X are the matrices of the sets; w and z are performance
        channels of any number.

    Raises
    ------
    InputError
        The data do not have these forms; or all deviations are equal at some frequency.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.uncertainty import MatrixResponses
    >>> from workbench.uncertainty.matrix_covers.sets.program import MatrixSets
    >>> rng, omega = np.random.default_rng(0), np.geomspace(0.1, 10, 6)
    >>> plants = 1 + 0.1 * rng.standard_normal((6, 5, 2, 2)) + np.eye(2)
    >>> responses = MatrixResponses(omega, plants + 0j)
    >>> sets = MatrixSets(
    ...     responses.values - responses.values.mean(axis=1, keepdims=True), left="diagonal",
    ...     right="diagonal"
    ... )
    >>> wb.solve(sets).certificate.holds
    True
    """

    deviations: Array
    _: KW_ONLY
    left: WeightShape = "full"
    right: WeightShape = "full"
    centre: Centre = field(default="zero", kw_only=True)
    size: Size = field(default="volume", kw_only=True)
    floor: float = field(default=1e-3, kw_only=True)
    loop: Any = field(default=None, kw_only=True)

    default_method: ClassVar[str] = "barrier"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.uncertainty.matrix_covers.sets.barrier",
        "workbench.uncertainty.matrix_covers.sets.conic",
    )
    headline: ClassVar[str] = "radius_mean"

    def __post_init__(self) -> None:
        given = as_array(self.deviations, "deviations", dtype=complex)
        if given.ndim != 4 or not given.size:
            raise InputError(f"deviations must have shape (F, N, p, m), not {given.shape}")
        bad = np.argwhere(~np.isfinite(given))
        if bad.size:
            raise InputError(f"deviations are not finite at index {tuple(bad[0].tolist())}")
        object.__setattr__(self, "deviations", given)
        for name, kind in (
            ("left", WeightShape),
            ("right", WeightShape),
            ("centre", Centre),
            ("size", Size),
        ):
            value = getattr(self, name)
            need_choice(value, kind, name)
        need_numbers(floor=self.floor)
        if not 0 < self.floor < 1:
            raise InputError(f"floor is {self.floor}; it must lie between 0 and 1")
        size = np.abs(given).max(axis=(1, 2, 3))
        flat = np.abs(self._spread).max(axis=(1, 2, 3)) <= ALIKE * size
        if flat.any():
            what = "equal" if self.centre == "free" else "zero"
            raise InputError(
                f"all deviations at frequency number {int(flat.argmax())} are {what}: there is "
                "nothing to cover"
            )
        self._need_loop()

    def _need_loop(self) -> None:
        """Raise InputError unless the size "mu" and a fitting loop are given together."""
        if (self.size == "mu") != (self.loop is not None):
            raise InputError('the size "mu" needs a loop, and a loop needs the size "mu"')
        if self.loop is None:
            return
        if self.centre == "free":
            raise InputError(
                'the size "mu" needs centre="zero": the loop is built around the nominal'
            )
        object.__setattr__(self, "loop", need_loop(self.loop, self.deviations.shape))

    @property
    def quantifier(self) -> str:
        F, N = self.deviations.shape[:2]
        return f"for these {N} matrices at each of {F} frequencies"

    @property
    def problem_size(self) -> float:
        """Number of matrices to cover, at all frequencies together."""
        return float(np.prod(self.deviations.shape[:2]))

    # --- the question -----------------------------------------------------------------------------

    @cached_property
    def _spread(self) -> Array:
        """Deviations (F, N, p, m) from a starting centre."""
        mean = self.deviations.mean(axis=1, keepdims=True)
        return self.deviations - mean if self.centre == "free" else self.deviations

    @cached_property
    def channel_sizes(self) -> tuple[RealArray, RealArray]:
        """Sizes of rows (F, p) and columns (F, m); entries are at most the products of these."""
        return equilibrated(np.abs(self._spread).max(axis=1))

    @cached_property
    def floors(self) -> Array:
        """Changes (F, p m, p, m) of single entries that every set contains around its centre."""
        rows, columns = self.channel_sizes
        F, p, m = len(rows), rows.shape[1], columns.shape[1]
        size = self.floor * rows[:, :, None] * columns[:, None]
        unit = np.eye(p * m).reshape(p * m, p, m)
        found: Array = (unit * size[:, None]).astype(complex)
        return found.reshape(F, p * m, p, m)

    def away(self, centre: Array, *, at: np.ndarray | slice = slice(None)) -> Array:
        """The matrices that sets around a centre (f, p, m) must contain: deviations from it, and
        the floor.

        ``at`` are the indices (f,) of frequencies; by default all.
        """
        return np.concatenate([self.deviations[at] - centre[:, None], self.floors[at]], axis=1)

    def size_of(self, P: Array, S: Array, *, level: RealArray | None = None) -> RealArray:
        """The logarithm of the size (F,) of sets with inverse weights P and S, times 2 p m.

        ``level`` (F,) is log mu of the loop, if it is already known.
        """
        p, m = self.deviations.shape[2:]
        if self.size != "trace":
            logs = -2 * (m * np.linalg.slogdet(P)[1] + p * np.linalg.slogdet(S)[1])
            if self.size == "volume":
                return np.asarray(logs)
            level = loop_level(self.loop, P, S)[0] if level is None else level
            return np.asarray(2 * p * m * level + VOLUME_SHARE * logs)
        logs = [_log_root(np.linalg.inv(W)) for W in (P, S)]
        return np.asarray(2 * p * m * (logs[0] + logs[1] - np.log(p * m) / 2))

    # --- objective --------------------------------------------------------------------------------

    def sizes(self, answer: FoundSets) -> RealArray:
        """Size (F,) of the sets: the geometric mean radius, or the square root of the product of
        traces.
        """
        p, m = self.deviations.shape[2:]
        size = self.size_of(np.linalg.inv(answer.left), np.linalg.inv(answer.right))
        return np.exp(size / (2 * p * m))

    def objective(self, answer: FoundSets) -> float:
        """Mean of the logarithm of the size over the frequencies."""
        return float(np.log(self.sizes(answer)).mean())

    def objective_scale(self, answer: FoundSets) -> float:
        """The scale is 1, since differences of logarithms are already relative."""
        return 1.0

    def gap(self, answer: FoundSets) -> tuple[str, float] | None:
        if self.size == "volume" and self.centre == "free":
            return None
        value = float(np.max(self.excess(answer)))
        return "largest excess of the size over its proven lower bound, in logarithms", value

    def in_units(self, answer: FoundSets) -> InUnits:
        """The contained matrices and the loop, in units of the sets with which the proof starts."""
        unit = np.abs(answer.left).max(axis=(1, 2), keepdims=True)
        P, S = np.linalg.inv(answer.left / unit), np.linalg.inv(answer.right)
        rows, columns = self.channel_sizes
        loop = K = None
        if answer.of_loop is not None:
            P = P * np.exp(answer.of_loop[:, 0])[:, None, None]
            loop = loop_in_unit(self.loop, unit, len(P[0]))
            K = scaled_loop(loop, P, S, answer.of_loop[:, 1])
        away = self.away(answer.centre) / unit[:, None]
        M = P[:, None] @ away @ S[:, None]
        return InUnits(P, S, away, M, (rows / unit[:, 0], columns), loop, K)

    def excess(self, answer: FoundSets) -> RealArray:
        """Proven bounds (F,) on how far the log size is above the least possible one."""
        within, shapes = self.in_units(answer), (self.left, self.right)
        P, S = within.P, within.S
        if self.size == "trace":
            bound = trace_bound(
                within.away,
                self.deviations.shape[1],
                P,
                S,
                answer.weights,
                *shapes,
                self.centre == "free",
            )
            p, m = self.deviations.shape[2:]
            size = self.size_of(P, S) / (2 * p * m)
            return np.asarray(size - np.log(np.maximum(bound, SMALLEST)))
        if answer.of_loop is not None:
            return mu_excess(within, answer.weights, answer.of_loop, shapes, self.floor)
        if self.size == "mu":
            return np.full(len(P), np.inf)  # without the loop's part nothing is proven
        reach = farthest(P, S, within.channels, self.floor)
        return volume_excess(within.M, answer.weights, *shapes, reach)

    # --- the check --------------------------------------------------------------------------------

    def checks(self, answer: FoundSets, tolerance: float) -> Sequence[Check]:
        deltas = answer.deltas(self.deviations)
        norms = np.linalg.norm(deltas, 2, axis=(2, 3)) if np.isfinite(deltas).all() else np.nan
        beyond = norms * (1 + self._rounding(answer)[:, None]) - 1
        value, where = worst_value(beyond, self._place)
        checks = [
            Check(
                "containment", "norm of a Delta, rounded up, less 1", value, CONTAINED, where=where
            )
        ]
        for name, W, shape in (("W_1", answer.left, self.left), ("W_2", answer.right, self.right)):
            scaled = W / np.abs(W).max(axis=(1, 2), keepdims=True)
            gram = scaled @ ctranspose(scaled) if name == "W_1" else ctranspose(scaled) @ scaled
            off = np.abs(gram - of_shape(gram, shape)).max(axis=(1, 2))
            value, where = worst_value(off, self._place)
            statement = f"largest entry of its square outside the shape {shape}, relative"
            checks.append(Check(f"{name} {shape}", statement, value, SHAPED, where=where))
        if self.centre == "zero":
            value, where = worst_value(np.abs(answer.centre), self._place)
            checks.append(
                Check("centre", "largest entry of a centre, must be 0", value, 0.0, where=where)
            )
        return checks

    def _rounding(self, answer: FoundSets) -> RealArray:
        """Relative error (F,) of a norm of Delta that rounding may cause."""
        total = np.zeros(len(answer.left))
        for W, axis in ((answer.left, 2), (answer.right, 1)):
            scaled = W / np.abs(W).max(axis=axis, keepdims=True)
            total = total + W.shape[-1] * np.linalg.cond(scaled)
        return 8 * EPS * total

    def second_opinion(self, answer: FoundSets) -> Sequence[Check]:
        import scipy.linalg

        found = np.zeros(self.deviations.shape[:2])
        unit = np.abs(answer.left).max(axis=(1, 2), keepdims=True)
        squares = (
            (answer.left / unit) @ ctranspose(answer.left / unit),
            ctranspose(answer.right) @ answer.right,
        )
        away = (self.deviations - answer.centre[:, None]) / unit[:, None]
        for f, (L, R) in enumerate(zip(*squares, strict=True)):
            for k, E in enumerate(away[f]):
                square = E @ scipy.linalg.cho_solve(scipy.linalg.cho_factor(R), ctranspose(E))
                found[f, k] = scipy.linalg.eigh(square, L, eigvals_only=True)[-1]
        value, where = worst_value(found - 1, self._place)
        statement = "largest eigenvalue of E R^-1 E^* beyond that of L = W_1 W_1^*, relative"
        return [Check("eigenvalues", statement, value, SQUARES_CONTAINED, where=where)]

    def _place(self, index: tuple[int, ...]) -> str:
        of = f", matrix {index[1]}" if len(index) == 2 else ""
        return f"at frequency number {index[0]}{of}"

    def metrics(self, answer: FoundSets) -> dict[str, float]:
        size = self.sizes(answer)
        return self._mu(answer) | {
            "radius_mean": float(np.exp(np.log(answer.radius).mean())),
            "size_mean": float(np.exp(np.log(size).mean())),
            "size_peak": float(size.max()),
            "frequencies": len(size),
            "matrices": self.deviations.shape[1],
        }

    def log_mu(self, answer: FoundSets) -> RealArray:
        """Logarithm (F,) of the loop's mu with these sets."""
        return loop_level(self.loop, np.linalg.inv(answer.left), np.linalg.inv(answer.right))[0]

    def _mu(self, answer: FoundSets) -> dict[str, float]:
        if self.loop is None:
            return {}
        level = self.log_mu(answer)
        return {"mu_peak": float(np.exp(level.max())), "mu_mean": float(np.exp(level.mean()))}

    # --- datasets ---------------------------------------------------------------------------------

    def to_dataset(self, answer: FoundSets) -> Dataset:
        import xarray as xr

        output, entering = ("frequency", "output", "output_"), ("frequency", "input", "input_")
        variables = {
            "deviations": (
                ("frequency", "sample", "output", "input"),
                self.deviations,
                "deviations",
            ),
            "left": (output, answer.left, "left weight W_1"),
            "right": (entering, answer.right, "right weight W_2"),
            "centre": (("frequency", "output", "input"), answer.centre, "centre"),
            "weights": (("frequency", "touching", "order"), answer.weights, "weights of the proof"),
        }
        if answer.of_loop is not None:
            variables["of_loop"] = (("frequency", "of_loop_"), answer.of_loop, "proof of the loop")
        return xr.Dataset(
            {
                name: (dims, values, {"units": "1", "long_name": text})
                for name, (dims, values, text) in variables.items()
            }
        )

    def from_dataset(self, data: Dataset) -> FoundSets:
        names = ("left", "right", "centre", "weights", "of_loop")
        return FoundSets(*(data[name].values for name in names if name in data))


def _log_root(W: Array) -> RealArray:
    """Logarithm (F,) of the root of the sum of squares, also if the squares would overflow."""
    peak = np.abs(W).max(axis=(1, 2), keepdims=True)
    found: RealArray = np.log(peak[:, 0, 0]) + np.log(np.linalg.norm(W / peak, axis=(1, 2)))
    return found
