"""Sampled linear systems that switch between modes: how long they must stay for stability.

    x[k + 1] = A_i x[k]    in mode i, from any mode to any other.

Each mode has a quadratic function of the state at its entry, V_i = x' P_i x. If over every stay n
that is allowed and for every mode j that may follow

    (A_i^n)' P_j A_i^n < P_i,

then V falls from entry to entry and the system is stable. In a mode without a longest stay n is the
shortest one, and A_i' P_i A_i < P_i carries it on to all longer ones (J. C. Geromel, P. Colaneri,
Stability and stabilization of discrete time switched systems, Int. J. Control 79 (2006) 719-728).

Powers of A are known plant by plant. Where the A are vertices of a set, all of which is meant, a
rate r < 1 keeps the inequalities linear in A:

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

ROUNDING = 1e-9
"""By which V must fall at least, relative: far more than the rounding of what is recomputed."""
LATTICE = (80, 12)
"""Stays of the sought modes and of the others among which an unstable periodic switching is looked
for; what lies between those of the sought modes is looked at after."""


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode of a switched system.

    Parameters
    ----------
    name
        For messages and tables.
    A
        Transition over one sample (n, n), or (V, n, n) of V plants, each of which keeps to itself
        while the modes change.
    shortest
        Samples that it is stayed in at least; None: that is what is sought.
    longest
        Samples that it is stayed in at most; None: no limit.
    rate
        By which V^(1/2) falls over a sample at least, and A^n is taken as rate^(n - 1) A, so that
        what is proven holds for the convex hull of the A; None: powers of each A as they are.

    Raises
    ------
    InputError
        Matrices that are not square or not finite; stays that are not whole and positive, or in the
        wrong order; a sought mode with a longest stay; a rate that is not between 0 and 1, or of a
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
        """A / rate (V, n, n), under which V must fall: A where there is no rate."""
        return self.A / (self.rate or 1.0)

    def over(self, stay: int) -> RealArray:
        """What stands for A^stay (V, n, n) at the end of a stay."""
        if self.rate is None:
            return np.linalg.matrix_power(self.A, stay)
        return self.rate ** (stay - 1) * self.A

    @cached_property
    def radius(self) -> RealArray:
        """Spectral radius of each plant (V,)."""
        radius: RealArray = np.abs(np.linalg.eigvals(self.A)).max(axis=1)
        return radius

    def powers(self, stays: Any) -> RealArray:
        """A^n for stays (N,): (N, V, n, n)."""
        return np.array([np.linalg.matrix_power(self.A, int(n)) for n in stays])


@dataclass(frozen=True, eq=False)
class Dwell:
    """``samples``: shortest stay of the sought modes; ``P`` (modes, n, n) prove it."""

    samples: int
    P: RealArray


@dataclass(frozen=True, eq=False)
class SwitchedStability(Program):
    """The shortest stay in the sought modes for which any switching is stable.

    One family of P proves it for all plants. It is a bound: shorter stays may be stable too, down
    to ``destabilising``, which some periodic switching makes unstable.

    Parameters
    ----------
    modes
        Two or more, of the same plants and states; at least one with ``shortest`` None.
    limit
        Longest dwell that is looked at [samples].

    Raises
    ------
    InputError
        Fewer modes, none sought, other numbers of plants or states, a limit that is not positive, a
        mode without a longest stay that is unstable, a rate that a plant does not reach.
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
        return int(self.modes[0].A.shape[-1])

    def stays(self, mode: Mode, samples: int) -> range:
        """Stays that must be looked at one by one if the sought dwell is ``samples``."""
        shortest = samples if mode.shortest is None else mode.shortest
        return range(shortest, (mode.longest or shortest) + 1)

    def ratios(self, answer: Dwell, i: int) -> tuple[RealArray, RealArray]:
        """Largest V at the next entry over V_i (stays,), and V_i after a sample over V_i ().

        The latter is 0 for a mode with a longest stay, which needs no such thing.
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
        """The longest dwell found that some periodic switching makes unstable, and which one; 0."""
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
            limit = 1.0 - ROUNDING
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


# --- what is given, looked at -----------------------------------------------------------------


def transitions(name: str, A: Any) -> RealArray:
    """A (V, n, n) of a mode; raises InputError for anything that is none."""
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
    """Raise InputError for stays that are not whole, positive and in order."""
    for word, stay in (("shortest", shortest), ("longest", longest)):
        if stay is not None and not (_whole(stay) and stay > 0):
            raise InputError(
                f"mode {name!r}: {word} is {stay!r}; it must be a positive number of samples"
            )
    if longest is not None and longest < shortest:
        raise InputError(f"mode {name!r}: longest is {longest}, less than shortest, {shortest}")


def check_modes(modes: Any) -> None:
    """Raise InputError unless there are two modes or more, of the same plants and states."""
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
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def _scaled(P: RealArray, units: RealArray) -> RealArray:
    return P / units[:, None] / units


def _least(P: RealArray) -> float:
    """Least eigenvalue of P with unit diagonal; negative where the diagonal is."""
    diagonal = np.diag(P)
    if diagonal.min() <= 0.0:
        return float(diagonal.min())
    return float(np.linalg.eigvalsh(_scaled((P + P.T) / 2, np.sqrt(diagonal)))[0])


def _largest(M: RealArray, P: RealArray) -> float:
    """Largest x' M x over x' P x, for any of a batch of M; rounded up."""
    units = np.sqrt(np.diag(P))
    L = np.linalg.cholesky(_scaled((P + P.T) / 2, units))
    inner = np.linalg.solve(L, np.linalg.solve(L, M / units[:, None] / units).mT)
    return outward(P) * float(np.linalg.eigvalsh((inner + inner.mT) / 2)[..., -1].max())


def outward(P: RealArray) -> float:
    """By what ratios of quadratic functions to x' P x are to be multiplied for their rounding.

    The more P's eigenvalues are apart, its diagonal being 1, the more of it is lost.
    """
    return 1.0 + len(P) ** 2 * np.finfo(float).eps / max(_least(P), np.finfo(float).eps)


def _unstable(sought: Mode, other: Mode, limit: int) -> tuple[int, int]:
    """Longest dwell of an unstable periodic switching of two modes, and the stay in the other."""
    many, few = LATTICE
    both = other.shortest is None
    # A stable mode's power is as good as zero when its radius says so, but for its transients.
    horizon = min(limit, 1000, max(4, math.ceil(40.0 / max(1e-6, 1.0 - sought.radius.max()))))
    n = _spread(1, horizon, many)
    longest = other.longest or max(other.shortest or 1, horizon)
    m = n if both else _spread(other.shortest or 1, longest, few)
    radius = _radii(sought.powers(n), other.powers(m))
    dwell = np.minimum(n[:, None], m) if both else np.broadcast_to(n[:, None], radius.shape)
    unstable = np.where(radius > 1.0 + ROUNDING, dwell, 0)
    best = int(unstable.max())
    if best == 0 or both:
        place = np.unravel_index(int(np.argmax(unstable)), unstable.shape)
        return best, int(m[place[1]])
    stay = m[int(np.argmax(radius[int(np.searchsorted(n, best))]))]
    after = n[n > best]
    between = np.arange(best, int(after[0]) if after.size else best + 1)
    fine = _radii(sought.powers(between), other.powers([stay]))[:, 0]
    return int(between[fine > 1.0 + ROUNDING].max()), int(stay)


def _radii(first: RealArray, second: RealArray) -> RealArray:
    """Largest spectral radius over the plants of products (N, M)."""
    product = first[:, None] @ second[None]
    radius: RealArray = np.abs(np.linalg.eigvals(product)).max(axis=(-2, -1))
    return radius


def _spread(first: int, last: int, count: int) -> NDArray[np.int64]:
    """Whole numbers from first to last, all of them or as many on a logarithmic scale."""
    if last - first < count:
        return np.arange(first, last + 1)
    return np.unique(np.geomspace(first, last, count).round().astype(np.int64))
