"""Switching between two controllers over the whole parametric set, not at samples of it.

In g = 1 / (R + r), k1 and k2, the parameters of Table 5.3, the actuator is affine: all of the coil
that depends on R is Bl g u and the damping Bl^2 g. A box of them is cut into cells. In each the
plant behind its hold is an affine part, whose extremes are at the cell's vertices, and a remainder
bounded entry by entry; P from the LMIs at the vertices prove the cell if they hold for all of that.
Every plant keeps its parameters while the controllers switch, so cells may have P of their own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench import solve
from workbench.arrays import RealArray
from workbench.errors import InputError
from workbench.synthesis import Mode, SwitchedStability
from workbench.synthesis.switching.transition_sets import TransitionSet, held_set

from ...control.control_problem import optical_gain
from ...drive.actuator import SERIES_RESISTANCE
from ...drive.plants import ANTIALIASING
from ...drive.tables import Axis, nominal_table
from ...laboratory.bench_setup import PERIOD
from ...uncertainty.parametric_model import two_masses, uncertain_parameters
from ..switched_loop import MICRO, LensModel, Regulator, transition

if TYPE_CHECKING:
    from workbench.executor import Context

NAMES = ("R", "k1", "k2")
FIRST = (1, 1, 8)
"""Cells of the whole box at the start, along g, k1 and k2."""
HALVED = (2, 0, 2)
"""Along which a cell is halved, one after the other, before it is given up."""
DWELLS = (1, 10, 30)
"""Samples of the clean mode between defects that are tried; the first is any switching."""
UNITS = np.array([1 / MICRO, 1 / MICRO, PERIOD / MICRO, PERIOD / MICRO, 1.0, 1.0])
"""Of positions, speeds, filter and command over SI."""
SURE = 1.0 - 1e-9
"""V must fall by more than the rounding of its change."""


@dataclass(frozen=True, eq=False)
class Cell:
    """A box of g, k1, k2: ``low`` and ``high`` (3,)."""

    low: RealArray
    high: RealArray
    depth: int = 0

    @property
    def centre(self) -> RealArray:
        middle: RealArray = (self.low + self.high) / 2
        return middle

    @property
    def volume(self) -> float:
        return float(np.prod(self.high - self.low))

    def halves(self, along: int) -> Iterator[Cell]:
        """Both halves along a parameter."""
        for side, end in (("high", self.high.copy()), ("low", self.low.copy())):
            end[along] = self.centre[along]
            yield replace(self, **{side: end}, depth=self.depth + 1)


@dataclass(frozen=True, eq=False)
class Proof:
    """Functions P (2, n, n) of both modes and the dwell they prove over a cell [samples]."""

    cell: Cell
    P: RealArray
    dwell: int


@dataclass(frozen=True, eq=False)
class Box:
    """A multiple of the parametric set of an axis, with one sample of delay."""

    axis: Axis
    modes: tuple[Regulator, Regulator]
    share: float = 1.0

    def __post_init__(self) -> None:
        widest = 1 / max(p.tolerance for p in uncertain_parameters(self.axis))
        if not 0.0 < self.share < widest:
            raise InputError(
                f"share is {self.share}; it must be above 0 and below {widest:.3g}, where a spring "
                "has no stiffness"
            )

    @cached_property
    def ends(self) -> tuple[RealArray, RealArray]:
        """Of g [1/ohm], k1 and k2 [N/m]: the smallest box that has the share of the set in it."""
        R, k1, k2 = (
            [p.nominal * (1 + side * self.share * p.tolerance) for side in (-1, 1)]
            for p in (
                next(each for each in uncertain_parameters(self.axis) if each.name == name)
                for name in NAMES
            )
        )
        g = [1 / (R[1] + SERIES_RESISTANCE), 1 / (R[0] + SERIES_RESISTANCE)]
        low, high = np.array([g, k1, k2]).T
        return low, high

    def cells(self) -> list[Cell]:
        """Of the whole box, to begin with."""
        low, high = self.ends
        edges = [np.linspace(a, b, n + 1) for a, b, n in zip(low, high, FIRST, strict=True)]
        index = np.ndindex(*FIRST)
        return [
            Cell(
                np.array([edge[i] for edge, i in zip(edges, at, strict=True)]),
                np.array([edge[i + 1] for edge, i in zip(edges, at, strict=True)]),
            )
            for at in index
        ]

    def continuous(self, parameters: RealArray) -> RealArray:
        """[A B; 0 0] (6, 6) of actuator and filter, affine in g, k1, k2.

        Positions are in um and speeds in um a sample, so that a sample's entries are about 1.
        """
        g, k1, k2 = parameters
        values = {name: entry.nominal for name, entry in nominal_table(self.axis).items()}
        given = values | {"R": 1 / g - SERIES_RESISTANCE, "k1": k1, "k2": k2}
        A, B, C, _ = (np.asarray(part, float) for part in two_masses(**given))
        M = np.zeros((6, 6))
        M[:4, :4], M[:4, 5:] = A, B
        M[4, :4] = ANTIALIASING * C[0] * self._micro
        M[4, 4] = -ANTIALIASING
        scaled: RealArray = M * UNITS[:, None] / UNITS
        return scaled

    @property
    def _micro(self) -> float:
        return 1.0 / (optical_gain(self.axis) * MICRO)

    def sets(self, cell: Cell) -> tuple[TransitionSet, TransitionSet]:
        """Transitions of both modes over a cell."""
        centre = cell.centre
        M = self.continuous(centre)
        half = (cell.high - cell.low) / 2
        slopes = [self.continuous(centre + step) - M for step in np.diag(half)]
        held = held_set(M, slopes, PERIOD)
        clean, defect = (self._set(held, mode) for mode in self.modes)
        return clean, defect

    def at(self, parameters: RealArray) -> tuple[RealArray, RealArray]:
        """Transitions of both modes at one set of parameters."""
        from scipy.linalg import expm

        held = expm(PERIOD * self.continuous(parameters))
        clean, defect = (self._loop(held, mode) for mode in self.modes)
        return clean, defect

    def _loop(self, held: RealArray, mode: Regulator) -> RealArray:
        """A of the loop from [A B; 0 1] of the plant, its input a sample late."""
        A, B = np.zeros((6, 6)), np.zeros((6, 1))
        A[:5], B[5] = held[:5], 1.0
        filtered, lens = np.zeros((1, 6)), np.zeros((1, 6))
        filtered[0, 4] = 1.0
        return transition(LensModel(A, B, lens, filtered, optical_gain(self.axis) * MICRO), mode)

    def _set(self, held: TransitionSet, mode: Regulator) -> TransitionSet:
        vertices = np.stack([self._loop(each, mode) for each in held.vertices])
        remainder = np.zeros(vertices.shape[1:])
        remainder[:5, :6] = held.remainder[:5]
        return TransitionSet(vertices, remainder)

    # --- proof --------------------------------------------------------------------------------

    def functions(self, sets: Sequence[TransitionSet], dwell: int) -> RealArray | None:
        """P of both modes (2, n, n) by LMIs at the vertices, for a dwell of the clean mode.

        V_c falls there half as fast as the slowest motion. None where there are none.
        """
        clean, defect = (each.vertices for each in sets)
        slowest = float(abs(np.linalg.eigvals(clean)).max())
        if max(slowest, abs(np.linalg.eigvals(defect)).max()) >= 1.0:
            return None
        rate = None if dwell == 1 else math.sqrt(slowest)
        # What is sought is the defect's shortest stay: one sample, or nothing.
        modes = Mode("clean", clean, dwell, rate=rate), Mode("defect", defect, None)
        found = solve(SwitchedStability(modes, 1))
        return found.answer.P if found.certificate and found.certificate.valid else None

    def dwell(self, sets: Sequence[TransitionSet], P: RealArray) -> int | None:
        """Samples of the clean mode between defects of any length; None: nothing is proven.

        Over the cell, V_c becomes at most r_cc V_c in a sample of the clean mode, and V_o r_oo V_o
        in one of a defect, both less than 1; over the last sample of either, V_o is at most r_co
        times what V_c was, and V_c r_oc times V_o. From one defect to the next V then changes by
        r_cc^(n - 1) r_co r_oc at most.
        """
        r = np.array([[each.ratio(p, q) for q in P] for each, p in zip(sets, P, strict=True)])
        if max(r[0, 0], r[1, 1]) > SURE:
            return None
        rises = math.log(r[0, 1] * r[1, 0] / SURE)
        return 1 + max(0, math.ceil(-rises / math.log(r[0, 0])))

    def proof(self, cell: Cell) -> Proof | None:
        """For the first of DWELLS for which the LMIs give one; None: for none."""
        sets = self.sets(cell)
        for tried in DWELLS:
            P = self.functions(sets, tried)
            dwell = None if P is None else self.dwell(sets, P)
            if P is not None and dwell is not None and dwell <= DWELLS[-1]:
                return Proof(cell, P, dwell)
        return None

    def proven(self, context: Context) -> tuple[list[Proof], list[Cell]]:
        """Cells that are proven, and cells given up."""
        waiting, given_up = self.cells(), []
        done: list[Proof] = []
        while waiting:
            context.progress("cells of the parametric set", len(done), len(done) + len(waiting))
            cell = waiting.pop()
            found = self.proof(cell)
            if found is not None:
                done.append(found)
            elif cell.depth == len(HALVED):
                given_up.append(cell)
            else:
                waiting += cell.halves(HALVED[cell.depth])
        return done, given_up


def proven_share(
    box: Callable[[float], Box], shares: Sequence[float], context: Context
) -> dict[str, Any]:
    """Variables of a dataset: how much of each multiple of the set is proven, up to the first of
    which not all is, and the cells of the largest of which all is, or else of the first."""
    volumes: list[float] = []
    kept: list[Proof] = []
    best = shares[0]
    for share in shares:
        done, given_up = box(share).proven(context)
        low, high = box(share).ends
        volumes.append(sum(one.cell.volume for one in done) / float(np.prod(high - low)))
        if len(volumes) == 1 or not given_up:
            kept, best = done, share
        if given_up:
            break
    n = len(box(best).at(box(best).cells()[0].centre)[0])
    about = {"long_name": "g [1/ohm], k1 and k2 [N/m]"}
    dwell = np.array([one.dwell for one in kept], dtype=np.int64)
    tried = list(shares[: len(volumes)])
    ends = {name: [getattr(one.cell, name) for one in kept] for name in ("low", "high")}
    return {
        "box_volume": ("box_share", volumes, {"units": "1", "long_name": "proven volume"}),
        "box_share": ("box_share", tried, {"units": "1", "long_name": "multiple of the set"}),
        "box_of_cells": ((), best, {"units": "1", "long_name": "multiple that the cells fill"}),
        **{
            f"cell_{name}": (("cell", "parameter"), np.reshape(rows, (len(kept), 3)), about)
            for name, rows in ends.items()
        },
        "cell_P": (
            ("cell", "mode", "state_box", "state_box_"),
            np.reshape([one.P for one in kept], (len(kept), 2, n, n)),
        ),
        "cell_dwell": ("cell", dwell, {"long_name": "proven distance, in samples"}),
    }
