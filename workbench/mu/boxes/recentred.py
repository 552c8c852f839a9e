"""An uncertain system recentred about other values of its real parameters, with rounding enclosed.

In a box of real parameters with centre c and half-widths w, delta = c + w e with |e| <= 1. The
system M closed by delta is then N = (I - M K)^-1 M W closed by e, where K has the centre in the
blocks of real scalars and W scales the inputs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import EPS, BoolArray, ComplexArray, RealArray
from workbench.certify.eigenvalues import Discs, pole_discs, separate_pole_discs
from workbench.certify.rounding import Enclosure, enclosed_inverse, exact
from workbench.certify.stable_system import StableSystem, enclosed_system
from workbench.mu.boxes.bands import Band, never, open_bands
from workbench.mu.boxes.partition import BoxPart
from workbench.structure import Real, Structure


@dataclass(frozen=True, eq=False)
class Recentred:
    """An uncertain system about other parameter values; ``stable``: whether its centre is stable.

    ``system`` may have poles right of the axis: the proofs on intervals of frequency only need that
    no pole is on the axis.
    """

    system: StableSystem
    structure: Structure
    stable: bool

    def open_bands(
        self, bands: tuple[Band, ...], late: Callable[[], bool] = never
    ) -> tuple[tuple[Band, ...], ComplexArray]:
        """As `workbench.mu.boxes.bands.open_bands`."""
        return open_bands(self.system, self.structure, bands, late)


def real_perturbation(structure: Structure, values: RealArray) -> RealArray:
    """The perturbation (..., r, c) of values (..., p) of the real blocks, with all others 0."""
    Delta = np.zeros((*values.shape[:-1], structure.rows, structure.columns))
    blocks = zip(structure, structure.row_slices, structure.column_slices, strict=True)
    real = [(into, out) for block, into, out in blocks if isinstance(block, Real)]
    for j, (into, out) in enumerate(real):
        Delta[..., into, out] = values[..., j, None, None] * np.eye(into.stop - into.start)
    return Delta


@dataclass(frozen=True, eq=False)
class RealParameters:
    """A stable system with a structure, and which of its blocks are real parameters."""

    system: StableSystem
    structure: Structure

    @property
    def places(self) -> list[int]:
        """Indices of the blocks that are real scalars."""
        return [k for k, block in enumerate(self.structure) if isinstance(block, Real)]

    def perturbation(self, values: RealArray) -> RealArray:
        """The perturbation (..., r, c) of normalised values (..., p), with all other blocks 0."""
        return real_perturbation(self.structure, values)

    def unstable(self, values: RealArray) -> BoolArray:
        """Which of the values (k, p) have a pole right of the axis or are ill-posed, in doubles."""
        return self.abscissae(values) > 0

    def abscissae(self, values: RealArray) -> RealArray:
        """Largest real parts (k,) of the poles [rad/s] at values (k, p), in doubles.

        Infinite where ill-posed. Infinite for a negative det(I - D Delta) too: the determinant is 1
        for the nominal, so that on the way from there a pole went through infinity.
        """
        A, B, C, D = self.system.A, self.system.B, self.system.C, self.system.D
        Delta = self.perturbation(values)
        loop = np.eye(len(D)) - D @ Delta
        regular = (np.linalg.cond(loop) < 1 / EPS) & (np.linalg.det(loop) > 0)
        Delta, loop = Delta[regular], loop[regular]
        closed = np.linalg.solve(loop, np.broadcast_to(C, (len(loop), *C.shape)))
        poles = np.linalg.eigvals(A + B @ Delta @ closed)
        found = np.full(len(values), np.inf)
        found[regular] = poles.real.max(axis=1, initial=-np.inf)
        return found

    def pole_slopes(self, values: RealArray) -> RealArray:
        """Slopes (k, p) of the real parts of the poles at values (p,), rightmost first, in doubles.

        Each slope is known up to a positive factor. The slopes of 1 / det(I - D Delta) come last.
        """
        from scipy.linalg import eig

        A, B, C, D = self.system.A, self.system.B, self.system.C, self.system.D
        Delta = self.perturbation(values)
        inward = np.linalg.pinv(np.eye(len(D)) - D @ Delta)
        outward = B + B @ Delta @ inward @ D
        poles, left, right = eig(A + B @ Delta @ inward @ C, left=True)
        seen, driven = inward @ C @ right, left.conj().T @ outward
        turn = np.exp(-1j * np.angle(np.sum(left.conj() * right, axis=0)))
        effect = turn[:, None] * driven, seen.T
        order = np.argsort(-poles.real)
        through = np.diagonal(inward @ D)
        slopes = [
            [*(effect[0][order, into] * effect[1][order, out]).sum(axis=1).real, through[out].sum()]
            for into, out in self._channels
        ]
        return np.array(slopes).T

    @property
    def _channels(self) -> list[tuple[slice, slice]]:
        """Indices of the inputs and outputs of each parameter."""
        places = zip(self.structure.row_slices, self.structure.column_slices, strict=True)
        real = (isinstance(block, Real) for block in self.structure)
        return [place for place, wanted in zip(places, real, strict=True) if wanted]

    def recentred(self, part: BoxPart, others: float = 1.0) -> Recentred | None:
        """N about the centre of a part; `others` scales the blocks that are no real scalars.

        None where the centre is ill-posed or has a pole that rounding cannot tell from the axis.
        """
        loop = self._closed(exact(self.perturbation(part.centre)))
        if loop is None:
            return None
        moved, closed, direct, dynamics = loop
        discs = _discs(dynamics)
        if _undecided(discs):
            return None
        scale = np.full(self.structure.rows, others)
        for value, k in zip(part.reach, self.places, strict=True):
            scale[self.structure.row_slices[k]] = value
        B, D = self.system.enclosures[1], direct
        system = enclosed_system(
            (dynamics, (B + moved @ D).times(scale), closed),
            D.times(scale),
            discs.centre.astype(complex),
            period=self.system.period,
        )
        return Recentred(system, self.structure, discs.rightmost < 0)

    def all_stable(self, part: BoxPart) -> bool | None:
        """True if all members of a part are stable, False if none is; by discs around their poles.

        None where the discs do not decide; for narrow parts they do.
        """
        centre, width = self.perturbation(part.centre), self.perturbation(part.reach)
        loop = self._closed(Enclosure(centre, np.abs(width)))
        if loop is None:
            return None
        discs = _discs(loop[3])
        return None if _undecided(discs) else discs.rightmost < 0

    def _closed(self, K: Enclosure) -> tuple[Enclosure, ...] | None:
        """B K, (I - D K)^-1 C, (I - D K)^-1 D and the state matrix; None where ill-posed."""
        A, B, C, D = self.system.enclosures
        back = enclosed_inverse(exact(np.eye(len(self.system.D))) - D @ K)
        if back is None:
            return None
        moved, closed = B @ K, back @ C
        return moved, closed, back @ D, A + moved @ closed


def _discs(dynamics: Enclosure) -> Discs:
    """Discs that contain the poles, chosen so that none crosses the axis where that can be
    proven.
    """
    discs = pole_discs(dynamics)
    return separate_pole_discs(dynamics) if _undecided(discs) else discs


def _undecided(discs: Discs) -> bool:
    """Whether a disc meets the imaginary axis."""
    return not bool((np.abs(discs.centre.real) > discs.radius).all())
