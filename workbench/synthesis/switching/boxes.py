"""Stability of switching between two controllers, for every plant of a box and not just for
samples.

The plant is affine in its parameters, which lie in a box. The box is cut into cells. In each cell
the plant with its hold is the sum of an affine part, whose extremes are at the cell's vertices, and
a remainder bounded entry by entry (`held_set`). The matrices P come from the LMIs at the vertices.
They prove the cell if the inequalities also hold with the remainder. The parameters of a plant stay
constant while the controllers switch, so each cell may have P of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench.errors import InputError
from workbench.solution import solve
from workbench.synthesis.switching.cells import CellProof, ParameterCell
from workbench.synthesis.switching.modes import Mode
from workbench.synthesis.switching.program import SwitchedStability
from workbench.synthesis.switching.transition_sets import TransitionSet, held_set

if TYPE_CHECKING:
    from workbench.executor import Context

LARGEST_RATIO = 1.0 - 1e-9
"""Largest ratio of V after a sample to V before it that counts as a decrease. Its distance from 1
is far larger than the rounding error of the ratio.
"""


@dataclass(frozen=True, eq=False)
class SwitchedBox:
    """Plants with parameters in a box, whose controller switches between a clean and a defect mode.

    Parameters
    ----------
    ends
        Lowest and highest parameters (p,) each.
    plant
        Affine function: parameters (p,) -> [A B; 0 0] (m, m) of the continuous plant, inputs last.
        It is scaled so that `period` times the matrix has entries of about 1.
    loops
        Affine function: [A_d B_d; 0 1] (m, m) of the plant with hold -> transition matrices (n, n)
        of the clean and of the defect mode.
    dt
        Sampling period [s].
    parts
        Number of cells along each parameter at the start (p,).
    halved
        Indices of the parameters along which an unproven cell is halved, one after the other. After
        the last one the cell is given up.
    dwells
        Dwell times tried, in increasing order: numbers of samples in the clean mode between two
        defects. 1 allows any switching.

    Raises
    ------
    InputError
        `ends` have different shapes, are not finite or are in the wrong order; `parts` or `halved`
        do not fit the parameters; or `dwells` are not increasing.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.synthesis import SwitchedBox
    >>> def box(share):
    ...     '''x' = -p x + u, p within 0.5 share of 1; a defect cuts off the gain of 0.5.'''
    ...     ends = np.array([1.0 - 0.5 * share]), np.array([1.0 + 0.5 * share])
    ...     plant = lambda p: np.array([[-p[0], 1.0], [0.0, 0.0]])
    ...     loops = lambda held: (held[:1, :1] - 0.5 * held[:1, 1:], held[:1, :1])
    ...     return SwitchedBox(ends, plant, loops, dt=1.0, parts=(2,))
    ...
    >>> len(box(1.0).cells())
    2
    """

    ends: tuple[RealArray, RealArray]
    plant: Callable[[RealArray], RealArray]
    loops: Callable[[RealArray], tuple[RealArray, RealArray]]
    dt: float
    parts: tuple[int, ...]
    _: KW_ONLY
    halved: tuple[int, ...] = ()
    dwells: tuple[int, ...] = (1, 10, 30)

    def __post_init__(self) -> None:
        low, high = self.ends
        p = len(low)
        if low.shape != (p,) or high.shape != (p,) or not (low < high).all():
            raise InputError(f"ends are {low} and {high}; the first must be below the second, (p,)")
        if not np.isfinite([low, high]).all():
            raise InputError(f"ends are {low} and {high}; both must be finite")
        if len(self.parts) != p or min(self.parts) < 1:
            raise InputError(f"parts are {self.parts}; need {p} numbers from 1 on")
        if any(not 0 <= along < p for along in self.halved):
            raise InputError(f"halved is {self.halved}; parameters are numbered from 0 to {p - 1}")
        if not self.dwells or self.dwells[0] < 1 or list(self.dwells) != sorted(set(self.dwells)):
            raise InputError(f"dwells are {self.dwells}; need increasing numbers from 1 on")

    def cells(self) -> list[ParameterCell]:
        """Cells that fill the box at the start."""
        low, high = self.ends
        edges = [np.linspace(a, b, n + 1) for a, b, n in zip(low, high, self.parts, strict=True)]
        return [
            ParameterCell(
                np.array([edge[i] for edge, i in zip(edges, at, strict=True)]),
                np.array([edge[i + 1] for edge, i in zip(edges, at, strict=True)]),
            )
            for at in np.ndindex(*self.parts)
        ]

    def at(self, parameters: RealArray) -> tuple[RealArray, RealArray]:
        """Transition matrices (n, n) of both modes, for the plant with these parameters (p,)."""
        from scipy.linalg import expm

        return self.loops(expm(self.dt * self.plant(parameters)))

    def sets(self, cell: ParameterCell) -> tuple[TransitionSet, TransitionSet]:
        """Sets of the transition matrices of both modes over a cell."""
        centre = cell.centre
        M = self.plant(centre)
        half = (cell.high - cell.low) / 2
        slopes = [self.plant(centre + step) - M for step in np.diag(half)]
        held = held_set(M, slopes, self.dt)
        pairs = [self.loops(each) for each in held.vertices]
        clean, defect = (
            TransitionSet(np.stack(vertices), np.tensordot(held.remainder, gains, 2))
            for vertices, gains in zip(zip(*pairs, strict=True), self._gains(len(M)), strict=True)
        )
        return clean, defect

    def _gains(self, m: int) -> tuple[RealArray, RealArray]:
        """Magnitudes (m, m, n, n) of the derivatives of a loop's entries by the held plant's, by
        mode.
        """
        base = self.loops(np.zeros((m, m)))
        units = np.eye(m * m).reshape(m * m, m, m)
        moved = [self.loops(unit) for unit in units]
        clean, defect = (
            np.array([abs(each[i] - base[i]) for each in moved]).reshape(m, m, *base[i].shape)
            for i in (0, 1)
        )
        return clean, defect

    # --- proof --------------------------------------------------------------------------------

    def functions(self, sets: Sequence[TransitionSet], dwell: int) -> RealArray | None:
        """P of both modes (2, n, n) from the LMIs at the vertices, for a dwell time in the clean
        mode.

        V_c^(1/2) must fall in every sample by the square root of the largest spectral radius of the
        clean mode, that is, half as fast as its slowest motion. None where the LMIs have no
        solution.
        """
        clean, defect = (each.vertices for each in sets)
        slowest = float(abs(np.linalg.eigvals(clean)).max())
        if max(slowest, abs(np.linalg.eigvals(defect)).max()) >= 1.0:
            return None
        rate = None if dwell == 1 else math.sqrt(slowest)
        # The shortest stay in the defect is sought with a limit of one sample: either one sample is
        # proven or nothing is.
        modes = (
            Mode("clean", clean, shortest_samples=dwell, rate=rate),
            Mode("defect", defect, shortest_samples=None),
        )
        found = solve(SwitchedStability(modes, limit_samples=1))
        return found.answer.P if found.certificate and found.certificate.valid else None

    def dwell(self, sets: Sequence[TransitionSet], P: RealArray) -> int | None:
        """Number of clean samples between defects of any length for which P prove stability, or
        None.

        Over the cell, a sample of the clean mode multiplies V_c by at most r_cc < 1, and a sample
        of a defect multiplies V_o by at most r_oo < 1. Over the last clean sample V_o becomes at
        most r_co times the V_c before it; over the last sample of a defect V_c becomes at most r_oc
        times the V_o before it. From one defect to the next, V is then multiplied by at most
        r_cc^(n - 1) r_co r_oc.
        """
        r = np.array([[each.ratio(p, q) for q in P] for each, p in zip(sets, P, strict=True)])
        if max(r[0, 0], r[1, 1]) > LARGEST_RATIO:
            return None
        rises = math.log(r[0, 1] * r[1, 0] / LARGEST_RATIO)
        return 1 + max(0, math.ceil(-rises / math.log(r[0, 0])))

    def proof(self, cell: ParameterCell) -> CellProof | None:
        """Proof for the first dwell time that the LMIs prove; None where they prove none."""
        sets = self.sets(cell)
        for tried in self.dwells:
            P = self.functions(sets, tried)
            dwell = None if P is None else self.dwell(sets, P)
            if P is not None and dwell is not None and dwell <= self.dwells[-1]:
                return CellProof(cell, P, dwell)
        return None

    def proven(self, context: Context) -> tuple[list[CellProof], list[ParameterCell]]:
        """Proofs of cells, and the cells that were given up; together they fill the box."""
        waiting, given_up = self.cells(), []
        done: list[CellProof] = []
        while waiting:
            context.progress("cells of the parametric set", len(done), len(done) + len(waiting))
            cell = waiting.pop()
            found = self.proof(cell)
            if found is not None:
                done.append(found)
            elif cell.depth == len(self.halved):
                given_up.append(cell)
            else:
                waiting += cell.halves(self.halved[cell.depth])
        return done, given_up


@dataclass(frozen=True, eq=False)
class ProvenShare:
    """Share of the volume that is proven, for multiples of a set of plants, and cells of one
    multiple.

    Parameters
    ----------
    multiples, volumes
        Multiples of the set that were tried, and the shares of their volumes that are proven.
    multiple
        The multiple of the set to which the cells below belong.
    low, high
        Lowest and highest parameters of the proven cells (cells, p) each.
    P
        Functions of both modes over each cell (cells, 2, n, n).
    dwell
        Number of samples in the clean mode between defects for which P prove stability (cells,).
    """

    multiples: list[float]
    volumes: list[float]
    multiple: float
    low: RealArray
    high: RealArray
    P: RealArray
    dwell: Array


def proven_share(
    box: Callable[[float], SwitchedBox], multiples: Sequence[float], context: Context
) -> ProvenShare:
    """Prove increasing multiples of a set of plants, until one of them is not proven completely.

    Parameters
    ----------
    box
        Function: multiple of the set -> the `SwitchedBox` of that multiple.
    multiples
        Increasing multiples of the set. The result has the cells of the largest multiple that is
        proven completely, or else of the first one.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.executor import Context
    >>> from workbench.synthesis import SwitchedBox, proven_share
    >>> def box(share):
    ...     '''x' = -p x + u, p within 0.5 share of 1; a defect cuts off the gain of 0.5.'''
    ...     ends = np.array([1.0 - 0.5 * share]), np.array([1.0 + 0.5 * share])
    ...     plant = lambda p: np.array([[-p[0], 1.0], [0.0, 0.0]])
    ...     loops = lambda held: (held[:1, :1] - 0.5 * held[:1, 1:], held[:1, :1])
    ...     return SwitchedBox(ends, plant, loops, dt=1.0, parts=(2,))
    ...
    >>> found = proven_share(box, (0.5, 1.0), Context())
    >>> list(found.volumes)
    [1.0, 1.0]
    """
    volumes: list[float] = []
    kept: list[CellProof] = []
    best = multiples[0]
    for multiple in multiples:
        done, given_up = box(multiple).proven(context)
        low, high = box(multiple).ends
        volumes.append(sum(one.cell.volume for one in done) / float(np.prod(high - low)))
        if len(volumes) == 1 or not given_up:
            kept, best = done, multiple
        if given_up:
            break
    one_box = box(best)
    n, p = len(one_box.at(one_box.cells()[0].centre)[0]), len(one_box.ends[0])
    low, high = (
        np.reshape([getattr(one.cell, end) for one in kept], (len(kept), p))
        for end in ("low", "high")
    )
    P = np.reshape([one.P for one in kept], (len(kept), 2, n, n))
    dwell = np.array([one.dwell for one in kept], dtype=np.int64)
    return ProvenShare(list(multiples[: len(volumes)]), volumes, best, low, high, P, dwell)
