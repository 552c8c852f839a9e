"""Plants that absorb scalings. The controller of a K step is designed for them.

A channel w -> z of a real scalar with multiplier m = m_+ m_-~ and bound beta has

    Re( conj(m_- (w + z / beta)) m_+ (w - z / beta) ) = |w'|^2 - |z'|^2,
    w' = (m_- (w + z / beta) + m_+ (w - z / beta)) / 2,
    z' = (m_- (w + z / beta) - m_+ (w - z / beta)) / 2.

The scalings prove beta if the loop from w' and the other inputs to z' and the other outputs has a
norm of at most 1. Solving for w and z' gives a feedback around the plant. It is stable because |arg
m| < pi/2, and has no direct term if m_+ and m_- are equal at infinity. By the small-gain theorem a
controller that gives norm 1 also stabilises the plant itself: with w = 0 the loop is in feedback
with a contraction.

M. Safonov, R. Chiang, Real/complex K_m-synthesis without curve fitting, Control and Dynamic Systems
56 (1993) 303-324; P. Young, Controller design with mixed uncertainties, American Control Conference
(1994) 2333-2337, absorbs D and G by spectral factors, of twice the order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from workbench._core.arrays import RealArray
from workbench.errors import SolverError
from workbench.structure import Real as RealScalar
from workbench.synthesis.mu.biquads import Biquads
from workbench.synthesis.mu.multipliers import triangles
from workbench.synthesis.mu.multipliers.functions import Multipliers, Place
from workbench.synthesis.mu.scaled_plant import with_scalings
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.norms import hinf_norm
from workbench.systems.realisation import Matrices, in_series, side_by_side
from workbench.systems.standard_plant import StandardPlant


def scaled_by_D(plant: GeneralisedPlant, scalings: Multipliers, x: RealArray) -> Matrices:
    """The system with D at its perturbation outputs and D^-1 at its perturbation inputs.

    For real channels, only T and the gains of D are absorbed.
    """
    left, right = [], []
    for block, place in zip(scalings.structure, scalings.places, strict=True):
        out, into = _D(scalings, x, place, dynamic=not isinstance(block, RealScalar))
        left += [out] * ((place.row.stop - place.row.start) // place.n)
        right += [into] * ((place.column.stop - place.column.start) // place.n)
    return with_scalings(plant, right, left)


def _D(
    scalings: Multipliers, x: RealArray, place: Place, dynamic: bool
) -> tuple[Matrices, Matrices]:
    """D of a block and its inverse; unless `dynamic`, gains replace d."""
    n = place.n
    functions = Biquads(n, scalings.biquads if dynamic else 0)
    rows = x[place.channels, : functions.size]
    out = side_by_side(functions.realised(rows), n)
    into = side_by_side(functions.realised(functions.inverse(rows)), n)
    if n > 1:
        g = np.exp(rows[:, 0])
        T, back = (
            (A, B * g, C / g[:, None], D * g / g[:, None])
            for A, B, C, D in triangles.systems(x[scalings.functions.rows :][place.entries], n)
        )
        # diag(d) T diag(gains), where `out` includes the gains in d
        out, into = in_series(T, out), in_series(into, back)
    return out, into


@dataclass(frozen=True, eq=False)
class Multiplied:
    """A plant with scalings D and G; it gives a standard plant for every beta.

    ``into`` and ``out`` are the indices of the real channels among its inputs and outputs. m_- and
    m_+ are realised by x' = A x + B_w w + B_z z / beta, direct w = w' - C_w x and z' = direct z /
    beta + C_z x.
    """

    system: Matrices
    measurements: int
    controls: int
    into: NDArray[np.int_]
    out: NDArray[np.int_]
    A: RealArray
    B_w: RealArray
    B_z: RealArray
    C_w: RealArray
    C_z: RealArray
    direct: RealArray

    @classmethod
    def of(cls, plant: GeneralisedPlant, scalings: Multipliers, x: RealArray) -> Multiplied:
        """The plant with multipliers of parameters x.

        Raises SolverError if |arg m| is not below a right angle at every frequency.
        """
        number, into, out = scalings.real
        rows = np.vstack([x[number], x[scalings.minus]])
        rows[:, 0] = 0.0  # D contains the gains
        systems = scalings.functions.realised(rows)
        pairs = zip(systems[: len(number)], systems[len(number) :], strict=True)
        parts = zip(*(_channel(plus, minus) for plus, minus in pairs), strict=True)
        *matrices, direct = (block_diag(*part) for part in parts)
        system = scaled_by_D(plant, scalings, x)
        sizes = plant.measurements, plant.controls
        A, B_w, B_z, C_w, C_z = matrices
        direct = np.diagonal(direct)
        return cls(system, *sizes, into, out, A, B_w, B_z, C_w, C_z, direct)

    def plant(self, beta: float) -> StandardPlant:
        """The standard plant for which a loop of norm 1 proves beta."""
        (A, B, C, D), into, out = self.system, self.into, self.out
        shrink = np.ones((len(D), 1))
        shrink[: len(D) - self.measurements] = 1 / beta
        C, D = shrink * C, shrink * D
        # the plant's inputs are enters u' + feedback x
        enters = np.eye(B.shape[1])
        enters[into, into] = 1 / self.direct
        feedback = np.zeros((B.shape[1], len(self.A)))
        feedback[into] = -self.C_w / self.direct[:, None]
        C_all, D_all = np.hstack([C, D @ feedback]), D @ enters
        below = self.B_z @ C_all[out]
        below[:, len(A) :] += self.A + self.B_w @ feedback[into]
        B_below = self.B_w @ enters[into] + self.B_z @ D_all[out]
        C_all[out] *= self.direct[:, None]
        D_all[out] *= self.direct[:, None]
        C_all[out, len(A) :] += self.C_z
        return StandardPlant(
            np.vstack([np.hstack([A, B @ feedback]), below]),
            np.vstack([B @ enters, B_below]),
            C_all,
            D_all,
            self.controls,
            self.measurements,
        )


def _channel(plus: Matrices, minus: Matrices) -> tuple[RealArray, ...]:
    """A, B_w, B_z, C_w, C_z and direct of one channel, where m_+ and m_- are made equal at
    infinity.
    """
    (A_plus, B_plus, C_plus, D_plus), (A_minus, B_minus, C_minus, D_minus) = plus, minus
    direct = np.sqrt(D_plus * D_minus)
    C_plus, C_minus = direct * C_plus / D_plus / 2, direct * C_minus / D_minus / 2
    A = block_diag(A_minus, A_plus)
    B_w, B_z = np.vstack([B_minus, B_plus]), np.vstack([B_minus, -B_plus])
    C_w, C_z = np.hstack([C_minus, C_plus]), np.hstack([C_minus, -C_plus])
    # the transfer function from z / beta to w for w' = 0: (m_+ - m_-) / (m_+ + m_-)
    contraction: Matrices = (A - B_w @ C_w / direct, B_z, -C_w / direct, np.zeros((1, 1)))
    if not hinf_norm(contraction) < 1.0:
        raise SolverError("the phase of a real scalar's multiplier exceeds a right angle")
    return A, B_w, B_z, C_w, C_z, direct
