"""The fastest jump within a voltage limit, and the proof that none is faster.

A pulse of N samples moves the lens of a linear drive from rest on its track to rest on another. For
each N, finding the end nearest to the target is a convex problem in the voltages, stated in CasADi.
The fastest pulse is that of the least N whose end is the target. One sample less is too few: then
the difference r between the target and the nearest end separates the target from every end,

    r' x_target  >  max over |u| <= U of r' sum A^(N-1-k) B u_k  =  U sum |r' A^(N-1-k) B|,

and this is checked from the stored r alone, however it was found.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench import Options
from workbench.errors import SolverError
from workbench.simulation import held_input_matrices
from workbench.solvers import in_one_thread, ipopt
from workbench.types import RealArray

from ...drive.actuator import specific_model
from ...drive.photo_diodes import TRACK_PITCH
from ...laboratory.bench_setup import PERIOD, coil_gain, find_drive
from .laws import acceleration

REACHED = 1e-3
"""Distance from the target, in the scale of each state in tracks, at which it counts as reached."""


@dataclass(frozen=True)
class FastestJump:
    """The fastest jump of a drive across tracks with at most this voltage."""

    drive: str
    tracks: int
    volts: float

    @cached_property
    def model(self) -> tuple[RealArray, RealArray]:
        """Sampled model A (4, 4), B (4,) of lens and arm, in tracks and tracks per millisecond."""
        parameters = find_drive("radial", self.drive)
        moving = specific_model(parameters).state_space()
        A, B = held_input_matrices(moving.A, moving.B * coil_gain(parameters), PERIOD)
        n = len(A) // 2
        unit = TRACK_PITCH * np.repeat([1.0, 1e3], n)
        return A * unit / unit[:, None], B[:, 0] / unit

    @cached_property
    def target(self) -> tuple[RealArray, float]:
        """State (4,) at rest on the new track, and the voltage [V] that holds it."""
        A, B = self.model
        rest = np.linalg.solve(np.eye(len(A)) - A, B)
        return rest * (self.tracks / rest[0]), self.tracks / float(rest[0])

    def reached_by(self, pulse: RealArray) -> RealArray:
        """State (4,) at the end of a pulse (N,) [V]."""
        A, B = self.model
        state = np.zeros(len(A))
        for volts in pulse:
            state = A @ state + B * volts
        return state

    def reach(self, direction: RealArray, samples: int) -> float:
        """Largest r' x at the end of any pulse of this many samples; direction r (4,)."""
        A, B = self.model
        row, most = direction.copy(), 0.0
        for _ in range(samples):
            most += abs(float(row @ B))
            row = row @ A
        return self.volts * most

    def beyond(self, direction: RealArray, samples: int) -> float:
        """Relative part of r' x_target beyond reach; if above 0, no pulse of this many samples
        makes the jump.
        """
        wanted = float(direction @ self.target[0])
        return 1.0 - self.reach(direction, samples) / wanted if wanted > 0.0 else -1.0

    @in_one_thread
    def nearest(self, samples: int) -> RealArray:
        """Pulse (N,) [V] whose end is nearest to the target."""
        import casadi as ca

        A, B = self.model
        columns = [B]
        for _ in range(samples - 1):
            columns.append(A @ columns[-1])
        to_end = np.transpose(columns[::-1]) * self.volts
        share = ca.SX.sym("share", samples)
        off = ca.mtimes(ca.DM(to_end), share) - ca.DM(self.target[0])
        solve = ipopt("jump", {"x": share, "f": ca.sumsqr(off)}, Options(tolerance=1e-9))
        found = solve(x0=np.zeros(samples), lbx=-1.0, ubx=1.0)
        return self.volts * np.clip(np.ravel(found["x"].full()), -1.0, 1.0)

    def fastest(self) -> tuple[RealArray, RealArray]:
        """Pulse (N,) [V] of the fastest jump, and the r (4,) that proves that N - 1 samples are too
        few.

        Raises SolverError if the least N and its proof are not found.
        """
        free = 2 * np.sqrt(self.tracks * TRACK_PITCH / acceleration(self.volts)) / PERIOD
        samples, direction = max(2, int(free)), None
        for _ in range(200):
            pulse = self.nearest(samples)
            off = self.target[0] - self.reached_by(pulse)
            if np.linalg.norm(off) > REACHED:
                if not self.beyond(off, samples) > 0.0:
                    break
                direction, samples = off, samples + 1
            elif direction is not None:
                return pulse, direction
            else:
                samples -= 1
        raise SolverError(f"no fastest jump across {self.tracks} tracks with {self.volts} V found")
