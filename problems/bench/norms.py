"""Time of answers certified between frequencies, over plain linear algebra of the same size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, problem, solve
from workbench.certify import certified_norm
from workbench.executor import WALL_TIME, Context
from workbench.mu import peak
from workbench.structure import Full, Real, Structure
from workbench.study import Study, array, check, dim, figure, metric, part, table
from workbench.synthesis import MixedSensitivity
from workbench.synthesis.h_infinity.assumptions import checked
from workbench.synthesis.h_infinity.riccati import central_of
from workbench.systems import realisation
from workbench.systems.standard_plant import standard_plant
from workbench.types import Array, DataArray, Figure, RealArray, StateSpace

from .bars import ratio_bars
from .interleaved import interleaved

CASES = {
    "norm, 40 states": ("AB13DD of SLICOT", 4.0),
    "norm, 120 states": ("AB13DD of SLICOT", 4.0),
    "peak of mu, 200 states": ("eigenvalues of a complex matrix of size 400", 15.0),
    "certificate, 120 states": ("eigenvalues of the loop's Hamiltonian", 6.0),
    "synthesis, 120 states": ("one ordered Schur form of its Hamiltonian", 60.0),
}
"""Timed cases, each with its yardstick and the largest accepted ratio."""
TOLERANCE, LEVEL_TOLERANCE = 1e-6, 1e-3
"""Tolerances of the certificate and of the least level."""
STEPS = ("workbench", "yardstick")
"""Timed sides."""
SLOWEST, FASTEST = 1.0, 1e3
"""Natural frequencies [rad/s] of the random plants."""
DAMPINGS = (0.01, 0.3)
"""Damping ratios of the random plants."""


@problem("bench/norms", slow=True)
def norms(rounds: Annotated[int, Field(ge=1, le=20)] = 3) -> NormsSpeed:
    """Time of certified norms, peaks of mu and loops, over that of linear algebra of their size.

    The plants are random, with lightly damped modes. A certified norm holds at every frequency,
    with rounding errors enclosed, while SLICOT's AB13DD gives no bound on its errors. Peaks are for
    a repeated real scalar and two full blocks. The loop is a mixed-sensitivity loop with a plant of
    120 states.

    rounds: number of interleaved timings; the median counts.
    """
    return NormsSpeed(rounds)


@dataclass(frozen=True)
class NormsSpeed(Study):
    """Times of certified answers and of their yardsticks, measured in turn."""

    rounds: int

    headline: ClassVar[str] = "norm_120_states"

    @property
    def quantifier(self) -> str:
        return "for these plants"

    case = dim(*CASES)
    step = dim(*STEPS)

    @part
    def timed(self, context: Context) -> Array:
        """Times [s] (case, step)."""
        rng = context.rng
        makers: dict[str, Callable[[], tuple[Callable[[], Any], Callable[[], Any]]]] = {
            "norm, 40 states": lambda: _norm(rng, 40),
            "norm, 120 states": lambda: _norm(rng, 120),
            "peak of mu, 200 states": lambda: _peak(rng, 200),
            "certificate, 120 states": lambda: _loop(rng, 120)[0],
            "synthesis, 120 states": lambda: _loop(rng, 120)[1],
        }
        # The first round loads compiled code and is not counted.
        times = [
            interleaved(makers[case](), self.rounds + 1)[1:]
            for case in context.track(CASES, "cases")
        ]
        return np.median(times, axis=1)

    seconds = array(
        dims=(case, step), unit="s", meaning="time", value=lambda timed: timed, **WALL_TIME
    )

    @check()
    def near_the_yardstick(self, seconds: DataArray) -> list[Check]:
        over = _time_over_yardstick(seconds)
        return [
            Check(case, f"time over that of {what}", float(over.sel(case=case)), wanted)
            for case, (what, wanted) in CASES.items()
        ]

    ratios = metric("{case}", value=lambda seconds: _time_over_yardstick(seconds))

    @figure
    def times(self, seconds: DataArray) -> Figure:
        over = {case: float(_time_over_yardstick(seconds).sel(case=case)) for case in CASES}
        wanted = [limit for _, limit in CASES.values()]
        return ratio_bars(over, "time over that of the yardstick", wanted)

    @table
    def cases(self, seconds: DataArray) -> tuple[list[str], list[list[str]]]:
        rows = [
            [case, what]
            + [f"{1e3 * float(seconds.sel(case=case, step=one)):.4g}" for one in STEPS]
            + [f"{float(_time_over_yardstick(seconds).sel(case=case)):.3g}", f"{wanted:g}"]
            for case, (what, wanted) in CASES.items()
        ]
        return ["case", "over", "workbench [ms]", "yardstick [ms]", "ratio", "asked"], rows


def _time_over_yardstick(seconds: DataArray) -> DataArray:
    """Time of the workbench, divided by that of the yardstick (case,)."""
    return seconds.sel(step="workbench", drop=True) / seconds.sel(step="yardstick", drop=True)


def modal_plant(rng: np.random.Generator, states: int, channels: int) -> StateSpace:
    """A stable plant of lightly damped modes in random coordinates."""
    natural = np.exp(rng.uniform(np.log(SLOWEST), np.log(FASTEST), states // 2))
    damping = rng.uniform(*DAMPINGS, states // 2)
    A = np.zeros((states, states))
    for k, (omega, zeta) in enumerate(zip(natural, damping, strict=True)):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = omega * np.array([[-zeta, 1.0], [-1.0, -zeta]])
    Q, _ = np.linalg.qr(rng.normal(size=(states, states)))
    B, C = rng.normal(size=(states, channels)), rng.normal(size=(channels, states))
    return realisation((Q @ A @ Q.T, Q @ B, C @ Q.T, np.zeros((channels, channels))), 0.0)


def _norm(rng: np.random.Generator, states: int) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """A call for a certified norm and one for SLICOT's. Each call changes the gain, since norms are
    cached.
    """
    import control

    plant = modal_plant(rng, states, 2)
    gains = iter(np.linspace(1.0, 2.0, 100))

    def certified() -> float:
        parts = plant.A, next(gains) * plant.B, plant.C, plant.D
        return certified_norm(realisation(parts, 0.0))

    return certified, lambda: control.linfnorm(plant)


def _peak(rng: np.random.Generator, states: int) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """A call for a peak of mixed mu with three blocks, and one for eigenvalues."""
    plant = modal_plant(rng, states, 6)
    structure = Structure([Real(2), Full(2, 2), Full(2, 2)])
    size = 2 * states
    matrix = rng.normal(size=(size, size)) + 1j * rng.normal(size=(size, size))
    return lambda: peak(plant, structure), lambda: np.linalg.eigvals(matrix)


def _loop(
    rng: np.random.Generator, states: int
) -> tuple[
    tuple[Callable[[], Any], Callable[[], Any]], tuple[Callable[[], Any], Callable[[], Any]]
]:
    """Two pairs of calls: a loop's certificate with eigenvalues, and its synthesis with a Schur
    form.
    """
    from scipy.linalg import schur

    weight = realisation((-np.eye(1) / 10, np.eye(1), 5 * np.eye(1), np.eye(1) / 2), 0.0)
    program = MixedSensitivity(modal_plant(rng, states, 1), W_S=weight, W_KS=1.0)
    answer = solve(program).answer
    level, normal = 2.0 * answer.gamma, checked(standard_plant(program.plant))
    closed = _hamiltonian(program.plant.close(answer.K), level)
    opened = _hamiltonian(program.plant.system, level)
    gains = iter(1.0 + 1e-9 * np.arange(100))

    def certified() -> Any:
        K = answer.K
        near = realisation(
            (K.A, next(gains) * K.B, K.C, K.D), 0.0
        )  # a loop whose norm is not cached
        return program.certify(replace(answer, K=near), TOLERANCE)

    return (
        (certified, lambda: np.linalg.eigvals(closed)),
        (
            lambda: central_of(normal, LEVEL_TOLERANCE),
            lambda: schur(opened, sort="lhp"),
        ),
    )


def _hamiltonian(system: StateSpace, gamma: float) -> RealArray:
    """The Hamiltonian matrix of the H-infinity norm at level gamma, for a system without direct
    term.
    """
    A, B, C = system.A, system.B / gamma, system.C
    return np.block([[A, B @ B.T], [-C.T @ C, -A.T]])
