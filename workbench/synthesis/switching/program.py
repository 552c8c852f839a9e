"""Dwell times that make sampled switched linear systems stable.

    x[k + 1] = A_i x[k]    in mode i, from any mode to any other.

Each mode has a quadratic function V_i = x' P_i x of the state at its entry. If for every allowed
stay n and every mode j that may follow

    (A_i^n)' P_j A_i^n < P_i,

then V falls from entry to entry and the system is stable. In a mode without a longest stay, the
inequality for the shortest n and A_i' P_i A_i < P_i imply it for all longer stays (J. C. Geromel,
P. Colaneri, Stability and stabilization of discrete time switched systems, Int. J. Control 79
(2006) 719-728).

Powers of A are computed for each plant on its own. If the A are the vertices of a set and the
whole set is meant, a rate r < 1 keeps the inequalities linear in A:

    A_i' P_i A_i < r^2 P_i,    r^(2 n - 2) A_i' P_j A_i < P_i.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from workbench import figures
from workbench.arrays import RealArray
from workbench.errors import InputError
from workbench.heavy_types import Dataset, Figure
from workbench.program import Check, Program

FALL_MARGIN = 1e-9
"""Least relative fall of V, far more than the rounding errors of the recomputed inequalities."""
SEARCHED_STAYS = (80, 12)
"""Numbers of stays of the sought mode and of the other mode that are tried in the search for an
unstable periodic switching. Stays of the sought mode in between are tried afterwards."""


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode of a switched system.

    Parameters
    ----------
    name
        Name for messages and tables.
    A
        Transition matrix over one sample (n, n), or (V, n, n) for V plants. The plant stays the
        same while the modes change.
    shortest
        Shortest stay [samples]; None: it is sought.
    longest
        Longest stay [samples]; None: no limit.
    rate
        V^(1/2) must fall by this factor in every sample, and rate^(n - 1) A replaces A^n, so that
        the proof holds for the convex hull of the A. None: the powers of each A are used.

    Raises
    ------
    InputError
        A matrix is not square or not finite; stays are not whole and positive, or in the wrong
        order; a sought mode has a longest stay; or the rate is not between 0 and 1, or belongs to a
        mode with a longest stay.
    """

    name: str
    A: RealArray
    shortest: int | None = 1
    longest: int | None = None
    rate: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "A", transitions(self.name, self.A))
        check_stays(self.name, 1 if self.shortest is None else self.shortest, self.longest)
        if self.shortest is None and self.longest is not None:
            raise InputError(
                f"mode {self.name!r}: its shortest stay is sought, so longest must be None, not "
                f"{self.longest}"
            )
        if self.rate is not None and not (0.0 < self.rate < 1.0 and self.longest is None):
            raise InputError(
                f"mode {self.name!r}: rate is {self.rate!r}, longest {self.longest}; a rate must "
                "be above 0, below 1, and of a mode without a longest stay"
            )

    @property
    def decaying(self) -> RealArray:
        """A / rate (V, n, n), under which V must fall; A where there is no rate."""
        return self.A / (self.rate or 1.0)

    def over(self, stay: int) -> RealArray:
        """The matrix (V, n, n) used for A^stay: the power, or rate^(stay - 1) A with a rate."""
        if self.rate is None:
            return np.linalg.matrix_power(self.A, stay)
        return self.rate ** (stay - 1) * self.A

    @cached_property
    def radius(self) -> RealArray:
        """Spectral radius of each plant (V,)."""
        radius: RealArray = np.abs(np.linalg.eigvals(self.A)).max(axis=1)
        return radius

    def powers(self, stays: Any) -> RealArray:
        """Powers A^n (N, V, n, n) for stays n (N,)."""
        return np.array([np.linalg.matrix_power(self.A, int(n)) for n in stays])


@dataclass(frozen=True, eq=False)
class Dwell:
    """Shortest stay ``samples`` of the sought modes, and the ``P`` (modes, n, n) that prove it."""

    samples: int
    P: RealArray


@dataclass(frozen=True, eq=False)
class SwitchedStability(Program):
    """The shortest stay in the sought modes for which any switching is stable.

    One family of P proves stability for all plants. The result is a bound: shorter stays may be
    stable too, down to ``destabilising``, which some periodic switching makes unstable.

    Parameters
    ----------
    modes
        Two or more modes with the same plants and states; at least one has ``shortest`` None.
    limit
        Longest dwell time that is tried [samples].

    Raises
    ------
    InputError
        There are fewer modes; no mode is sought; modes differ in plants or states; the limit is not
        positive; a mode without a longest stay is unstable; or a plant does not reach a rate.
    """

    modes: tuple[Mode, ...]
    limit: int = 100_000

    default_method: ClassVar[str] = "clarabel"
    headline: ClassVar[str] = "dwell"

    def __post_init__(self) -> None:
        object.__setattr__(self, "modes", tuple(self.modes))
        check_modes(self.modes)
        if not any(mode.shortest is None for mode in self.modes):
            raise InputError("no mode has shortest None: say whose dwell time is sought")
        if not (_whole(self.limit) and self.limit > 0):
            raise InputError(f"limit is {self.limit!r}; it must be a positive number of samples")
        for mode in self.modes:
            worst = int(np.argmax(mode.radius))
            if mode.longest is None and mode.radius[worst] >= 1.0:
                raise InputError(
                    f"mode {mode.name!r} has no longest stay and is unstable: its spectral radius "
                    f"is {mode.radius[worst]:.9g} for plant {worst}; give the longest stay"
                )
            if mode.rate is not None and mode.radius[worst] >= mode.rate:
                raise InputError(
                    f"mode {mode.name!r}: rate is {mode.rate}; it must be above the spectral "
                    f"radius, {mode.radius[worst]:.9g} for plant {worst}"
                )

    @property
    def states(self) -> int:
        """Number of states."""
        return int(self.modes[0].A.shape[-1])

    def stays(self, mode: Mode, samples: int) -> range:
        """Stays of a mode with inequalities of their own, if the sought dwell is ``samples``."""
        shortest = samples if mode.shortest is None else mode.shortest
        return range(shortest, (mode.longest or shortest) + 1)

    def ratios(self, answer: Dwell, i: int) -> tuple[RealArray, RealArray]:
        """Largest ratios of V at the next entry to V_i (stays,), and of V_i after a sample to V_i.

        The second is 0 for a mode with a longest stay, where V_i need not fall in every sample.
        """
        mode, P = self.modes[i], answer.P
        others = [P[j] for j in range(len(self.modes)) if j != i]
        stays = self.stays(mode, answer.samples)
        power = mode.over(stays[0])
        found = []
        for _ in stays:
            found.append(max(_largest(power.mT @ Q @ power, P[i]) for Q in others))
            power = mode.A @ power
        own = mode.decaying
        decay = 0.0 if mode.longest else _largest(own.mT @ P[i] @ own, P[i])
        return np.array(found), np.array(decay)

    @cached_property
    def destabilising(self) -> tuple[int, str]:
        """The longest dwell [samples] that a periodic switching found makes unstable, and a text.

        The text says which switching; the dwell is 0 where none was found.
        """
        best, which = 0, ""
        for i, one in enumerate(self.modes):
            for other in self.modes[i + 1 :]:
                if one.shortest is None or other.shortest is None:
                    pair = (one, other) if one.shortest is None else (other, one)
                    found, stay = _unstable(*pair, self.limit)
                    if found > best:
                        best = found
                        which = f"{found} samples in {pair[0].name}, {stay} in {pair[1].name}"
        return best, which

    # --- checks -------------------------------------------------------------------------------

    def checks(self, answer: Dwell, tolerance: float) -> list[Check]:
        n, count = self.states, len(self.modes)
        fits = answer.P.shape == (count, n, n) and bool(np.isfinite(answer.P).all())
        fits = fits and 0 < answer.samples <= self.limit
        statement = "whether P has another shape, or the dwell time is none"
        found = [Check("dimensions", statement, float(not fits), 0.0)]
        if not fits:
            return found
        skew = max(float(np.abs(P - P.T).max() / np.abs(P).max()) for P in answer.P)
        found.append(Check("symmetry", "largest P - P', relative", skew, 1e-12))
        least = min(_least(P) for P in answer.P)
        found.append(Check("positive", "less the least eigenvalue of P, scaled", -least, -1e-14))
        if least <= 1e-14:
            return found
        for i, mode in enumerate(self.modes):
            at_entry, decay = self.ratios(answer, i)
            stays = self.stays(mode, answer.samples)
            worst = int(np.argmax(at_entry))
            statement = "largest V of the next mode at its entry over V of this at its own"
            where = f"after {stays[worst]} samples"
            limit = 1.0 - FALL_MARGIN
            name = f"{mode.name}, entries"
            found.append(Check(name, statement, float(at_entry[worst]), limit, where))
            if mode.longest is None:
                of = "" if mode.rate is None else " and rate^2"
                statement = f"largest V of this mode after a sample over V before{of}"
                found.append(Check(f"{mode.name}, decay", statement, float(decay), limit))
        return found

    def gap(self, answer: Dwell) -> tuple[str, float]:
        found, which = self.destabilising
        statement = "dwell time over the shortest that no periodic switching found excludes, less 1"
        return f"{statement} ({which})" if which else statement, answer.samples / (found + 1) - 1

    def metrics(self, answer: Dwell) -> dict[str, float]:
        return {
            "dwell": float(answer.samples),
            "destabilising": float(self.destabilising[0]),
            "states": float(self.states),
            "plants": float(len(self.modes[0].A)),
        }

    # --- datasets and figures -----------------------------------------------------------------

    def to_dataset(self, answer: Dwell) -> Dataset:
        import xarray as xr

        about = {"long_name": "V = x' P x at the entry of each mode"}
        transition = {"long_name": "transition over a sample"}
        return xr.Dataset(
            {
                "A": (
                    ("mode", "plant", "state", "state_"),
                    np.stack([mode.A for mode in self.modes]),
                    transition,
                ),
                "P": (("mode", "state", "state_"), answer.P, about),
                "dwell": ((), answer.samples, {"units": "1", "long_name": "shortest stay"}),
            },
            coords={"mode": [mode.name for mode in self.modes]},
        )

    def from_dataset(self, data: Dataset) -> Dwell:
        return Dwell(int(data["dwell"]), data["P"].values)

    def figures(self, answer: Dwell) -> dict[str, Figure]:
        figure, (panel,) = figures.axes()
        for i, mode in enumerate(self.modes):
            ratio, _ = self.ratios(answer, i)
            panel.semilogy(
                self.stays(mode, answer.samples), ratio, ".-" if len(ratio) > 1 else "D",
                label=mode.name,
            )  # fmt: skip
        panel.axhline(1.0, color="0.4", linewidth=0.8)
        panel.set_xlabel("stay [samples]")
        panel.set_ylabel("V at the next entry over V at this [1]")
        figures.legend_below(figure, panel)
        return {"entries": figure}


# --- checks of the input ----------------------------------------------------------------------


def transitions(name: str, A: Any) -> RealArray:
    """A (V, n, n) of a mode; raises InputError for anything else."""
    try:
        array = np.asarray(A, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"mode {name!r}: A is no array of real numbers: {error}") from None
    array = array[None] if array.ndim == 2 else array
    if array.ndim != 3 or array.shape[1] != array.shape[2] or not array.size:
        raise InputError(
            f"mode {name!r}: A has shape {np.shape(A)}; it must be square, (n, n) or (V, n, n)"
        )
    if not np.isfinite(array).all():
        raise InputError(f"mode {name!r}: A has entries that are not finite")
    return array


def check_stays(name: str, shortest: int, longest: int | None) -> None:
    """Raise InputError unless the stays are whole, positive and in order."""
    for word, stay in (("shortest", shortest), ("longest", longest)):
        if stay is not None and not (_whole(stay) and stay > 0):
            raise InputError(
                f"mode {name!r}: {word} is {stay!r}; it must be a positive number of samples"
            )
    if longest is not None and longest < shortest:
        raise InputError(f"mode {name!r}: longest is {longest}, less than shortest, {shortest}")


def check_modes(modes: Any) -> None:
    """Raise InputError unless there are at least two modes with the same plants and states."""
    if len(modes) < 2:
        raise InputError(f"{len(modes)} modes are given; switching needs two at least")
    first = modes[0]
    for mode in modes[1:]:
        if mode.A.shape != first.A.shape:
            raise InputError(
                f"modes {first.name!r} and {mode.name!r} have A of shapes {first.A.shape} and "
                f"{mode.A.shape}; all must have the same plants and states, those that a mode does "
                "not use among them"
            )


def _whole(value: Any) -> bool:
    """Whether a value is an integer."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def _scaled(P: RealArray, units: RealArray) -> RealArray:
    """P with rows and columns divided by units."""
    return P / units[:, None] / units


def _least(P: RealArray) -> float:
    """Least eigenvalue of P scaled to unit diagonal; the least diagonal entry if not positive."""
    diagonal = np.diag(P)
    if diagonal.min() <= 0.0:
        return float(diagonal.min())
    return float(np.linalg.eigvalsh(_scaled((P + P.T) / 2, np.sqrt(diagonal)))[0])


def _largest(M: RealArray, P: RealArray) -> float:
    """Largest ratio of x' M x to x' P x over x and a batch of M, rounded up."""
    units = np.sqrt(np.diag(P))
    L = np.linalg.cholesky(_scaled((P + P.T) / 2, units))
    inner = np.linalg.solve(L, np.linalg.solve(L, M / units[:, None] / units).mT)
    return outward(P) * float(np.linalg.eigvalsh((inner + inner.mT) / 2)[..., -1].max())


def outward(P: RealArray) -> float:
    """Factor that rounds ratios of quadratic functions to x' P x upward.

    For P of unit diagonal, the rounding error grows as its least eigenvalue falls.
    """
    return 1.0 + len(P) ** 2 * np.finfo(float).eps / max(_least(P), np.finfo(float).eps)


def _unstable(sought: Mode, other: Mode, limit: int) -> tuple[int, int]:
    """Longest dwell with an unstable periodic switching of two modes, and the other mode's stay."""
    many, few = SEARCHED_STAYS
    both = other.shortest is None
    # Powers of a stable mode beyond this horizon are negligible, except for transients.
    horizon = min(limit, 1000, max(4, math.ceil(40.0 / max(1e-6, 1.0 - sought.radius.max()))))
    n = _spread(1, horizon, many)
    longest = other.longest or max(other.shortest or 1, horizon)
    m = n if both else _spread(other.shortest or 1, longest, few)
    radius = _radii(sought.powers(n), other.powers(m))
    dwell = np.minimum(n[:, None], m) if both else np.broadcast_to(n[:, None], radius.shape)
    unstable = np.where(radius > 1.0 + FALL_MARGIN, dwell, 0)
    best = int(unstable.max())
    if best == 0 or both:
        place = np.unravel_index(int(np.argmax(unstable)), unstable.shape)
        return best, int(m[place[1]])
    stay = m[int(np.argmax(radius[int(np.searchsorted(n, best))]))]
    after = n[n > best]
    between = np.arange(best, int(after[0]) if after.size else best + 1)
    fine = _radii(sought.powers(between), other.powers([stay]))[:, 0]
    return int(between[fine > 1.0 + FALL_MARGIN].max()), int(stay)


def _radii(first: RealArray, second: RealArray) -> RealArray:
    """Spectral radii (N, M) of the products of N and M powers, the largest over the plants."""
    product = first[:, None] @ second[None]
    radius: RealArray = np.abs(np.linalg.eigvals(product)).max(axis=(-2, -1))
    return radius


def _spread(first: int, last: int, count: int) -> NDArray[np.int64]:
    """Integers from first to last: all of them, or at most `count` on a logarithmic scale."""
    if last - first < count:
        return np.arange(first, last + 1)
    return np.unique(np.geomspace(first, last, count).round().astype(np.int64))
