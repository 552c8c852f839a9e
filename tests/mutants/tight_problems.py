"""Small problems, one or two of every Program, whose answers are tight: a little less is false."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import control
import numpy as np
from perturbed_control import perturbed
from scipy.linalg import expm
from scipy.signal import dlsim

import workbench as wb
from workbench.diagnosis import FaultEstimation, Requirement
from workbench.fitting import MagnitudeFit, ResponseFit
from workbench.geometry import NarrowestStadium, SmallestAreaStadium, SmallestCircle
from workbench.identification import (
    CrestFactor,
    ExperimentDesign,
    FittedParameter,
    MeasuredResponse,
    ParameterFit,
    StateSpaceFit,
)
from workbench.mu import MuLowerBound, MuUpperBound
from workbench.program import Program
from workbench.structure import Complex, Full, Real, Structure
from workbench.synthesis import (
    FeedbackFromRecords,
    H2HinfSynthesis,
    H2Synthesis,
    HinfSynthesis,
    Mode,
    MuSynthesis,
    NoiseEnergy,
    StateRecords,
    SwitchedStability,
)
from workbench.systems.connection import generalised_plant
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.uncertainty import (
    CircleCover,
    MatrixCover,
    MatrixResponses,
    Responses,
    StadiumCover,
)
from workbench.uncertainty.matrix_covers.sets.program import MatrixSets


class Solved(NamedTuple):
    """A program and its certified answer."""

    program: Program
    answer: Any


def circle() -> Program:
    points = np.random.default_rng(1).standard_normal((3, 7, 2)) @ np.array([1.0, 1j])
    return SmallestCircle(points + 2.0)


def stadium() -> Program:
    points = np.random.default_rng(2).standard_normal((3, 7, 2)) @ np.array([1.0, 0.3j])
    return NarrowestStadium((points + 2.0) * np.exp(0.7j))


def small_stadium() -> Program:
    points = np.random.default_rng(4).standard_normal((3, 7, 2)) @ np.array([1.0, 0.5j])
    return SmallestAreaStadium((points + 2.0) * np.exp(0.7j))


def hinf() -> Program:
    B, C = [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]]
    D = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]
    return HinfSynthesis(GeneralisedPlant(control.ss([[1.0]], B, C, D), None, 1, 1))


def h2() -> Program:
    return H2Synthesis(PROGRAMS["hinf"]().plant)


def mixed_norms() -> Program:
    """An unstable lag whose control is perturbed, within a limit that costs energy."""
    unstable = control.ss([[1.0]], [[1.0]], [[1.0]], [[0.0]])
    return H2HinfSynthesis(perturbed(unstable), 2.2)


def hinf_flexible() -> Program:
    from workbench.synthesis import MixedSensitivity

    s = control.tf("s")
    weighted = MixedSensitivity(1 / (s**2 + 0.1 * s + 1), W_S=(s + 1) / (2 * s + 0.02), W_KS=0.1)
    return HinfSynthesis(weighted.plant)


def random_matrices(structure: Structure, count: int, seed: int) -> np.ndarray:
    real, imag = np.random.default_rng(seed).standard_normal(
        (2, count, structure.columns, structure.rows)
    )
    return real + 1j * imag


def mu_upper_full() -> Program:
    """Three full blocks: the upper bound is mu."""
    structure = Structure([Full(2, 1), Full(1, 2), Full(1, 1)])
    return MuUpperBound(random_matrices(structure, 12, 3), structure)


def mu_upper_mixed() -> Program:
    """A real scalar and a full block: the upper bound is mu."""
    structure = Structure([Real(1), Full(2, 2)])
    return MuUpperBound(random_matrices(structure, 12, 4), structure)


def mu_upper_repeated() -> Program:
    """A repeated complex scalar and a full block: the upper bound is mu."""
    structure = Structure([Complex(2), Full(1, 1)])
    return MuUpperBound(random_matrices(structure, 12, 5), structure)


def mu_lower_full() -> Program:
    structure = Structure([Full(2, 1), Full(1, 2), Full(1, 1)])
    return MuLowerBound(random_matrices(structure, 6, 3), structure)


def mu_lower_mixed() -> Program:
    structure = Structure([Real(1), Full(2, 2)])
    return MuLowerBound(random_matrices(structure, 6, 4), structure)


def mu_synthesis() -> Program:
    """An unstable lag with an uncertain gain, its sensitivity and its control."""
    G, W = control.tf([1.0], [1.0, -1.0]), control.tf([0.5, 0.6], [1.0, 0.006])
    return MuSynthesis(
        generalised_plant(
            [(G, "v", "y"), (W, "e", "z"), (control.tf([0.2], [1.0]), "u", "y_d")],
            {"v": "u + u_d", "e": "r + y", "m": "r + y"},
            perturbation=[(Complex(1), "y_d", "u_d")],
            exogenous="r",
            performance="z",
            control="u",
            measurement="m",
        )
    )


def mu_synthesis_target() -> Program:
    """The same with a target just above the least peak found; scalings prove the bound."""
    return replace(mu_synthesis(), target=0.507)


def fault_filter() -> Program:
    lag = control.tf([1.0], [1.0, 0.5])
    plant = generalised_plant(
        [(lag, "v", "x"), (control.tf([0.3], [1.0]), "d0", "y_d")],
        {"v": "d + u_d", "d0": "d", "y": "x + f + n"},
        perturbation=[(Complex(1), "y_d", "u_d")],
        exogenous=["d", "n", "f"],
        measurement="y",
    )
    slow, fast = control.tf([1.0], [1.0, 0.01]), control.tf([1.0, 0.1], [1.0, 2.0])
    noise = control.ss([], [], [], [[0.05]])
    wanted = [
        Requirement("disturbances", ["d", "n"], weight=control.append(control.ss(slow), noise)),
        Requirement("faults", "f", weight=fast),
    ]
    return FaultEstimation(plant, "f", requirements=wanted)


def switching() -> Program:
    first = np.array([[0.0, 1.0], [-10.0, -1.0]])
    second = np.array([[0.0, 1.0], [-0.1, -0.5]])
    return SwitchedStability(
        (
            Mode("first", expm(0.5 * first), shortest_samples=None),
            Mode("second", expm(0.5 * second), shortest_samples=None),
        )
    )


OMEGA = np.geomspace(0.1, 100.0, 25)
"""Frequencies [rad/s] of the fits and covers."""


def response_fit() -> Program:
    s = 1j * OMEGA
    values = 3.0 * (s + 4.0) / (s**2 + 0.4 * s + 9.0) * (1 + 0.05 * np.exp(1j * OMEGA))
    return ResponseFit(OMEGA, values, 2, minimum_phase=True, error=0.06)


def magnitude_fit() -> Program:
    return MagnitudeFit(OMEGA, np.abs((1j * OMEGA + 10.0) / (1j * OMEGA + 0.5)) ** 0.7, 2)


def magnitude_cover() -> Program:
    return MagnitudeFit(OMEGA, 1 / np.sqrt(1 + (OMEGA / 3.0) ** 3), 2, cover=True)


def plants() -> np.ndarray:
    s = 1j * OMEGA[:, None]
    gain, pole = np.array([0.8, 1.0, 1.25, 1.1]), np.array([1.0, 1.3, 0.9, 1.1])
    return gain / (s + pole) * (1 + 0.02 * s / (s + 30.0) * np.array([1.0, 1j, -1.0, -1j]))


def circle_cover() -> Program:
    return CircleCover(Responses(omega=OMEGA, values=plants()), 2, complex_order=2)


def stadium_cover() -> Program:
    return StadiumCover(Responses(omega=OMEGA, values=plants()), 2, complex_order=2)


def crest_factor() -> Program:
    return CrestFactor(1.0, np.arange(1, 8), 32)


def state_space_fit() -> Program:
    rng = np.random.default_rng(5)
    A, B = np.array([[0.9, 0.3], [-0.3, 0.8]]), np.array([[1.0], [0.5]])
    u = rng.standard_normal((700, 1))
    y = dlsim((A, B, np.array([[1.0, -0.5]]), np.zeros((1, 1)), 1.0), u)[1]
    return StateSpaceFit(
        u, y + 0.05 * rng.standard_normal(y.shape), estimation=400, orders=(2,), washout=20
    )


def oscillator(p: Any, s: Any) -> Any:
    return p["gain"] / (s**2 + p["damping"] * s + p["stiffness"])


def parameter_fit() -> Program:
    rng, frequency = np.random.default_rng(7), np.linspace(0.2, 2.5, 60)
    s = 2j * np.pi * frequency
    values = oscillator({"gain": 3.0, "damping": 0.5, "stiffness": 40.0}, s)
    values = values + 2e-3 * (rng.normal(size=60) + 1j * rng.normal(size=60))
    datum = MeasuredResponse(oscillator, frequency, values, variance=8e-6)
    start = {
        "stiffness": FittedParameter(20.0, lower=1.0, upper=1e3),
        "damping": FittedParameter(2.0, lower=1e-3, upper=100.0),
        "gain": FittedParameter(1.0, lower=0.0, upper=10.0),
    }
    return ParameterFit([datum], start)


def matrix_sets() -> Program:
    return MatrixSets(random_matrices(Structure([Full(2, 2)]), 14, 6).reshape(2, 7, 2, 2))


def matrix_traces() -> Program:
    matrices = matrix_sets().deviations
    return MatrixSets(matrices, left="diagonal", right="full", size="trace", centre="free")


def matrix_cover() -> Program:
    gains = np.random.default_rng(7).uniform(0.8, 1.2, (4, 2, 2))
    values = gains / (1 + 1j * OMEGA[:, None, None, None])
    nominal = control.ss(-np.eye(2), np.eye(2), np.ones((2, 2)), np.zeros((2, 2)))
    return MatrixCover(MatrixResponses(OMEGA, values), nominal, left_order=1, right_order=0)


def experiment_design() -> Program:
    """A lag and an oscillator side by side, known from twelve lines."""
    lines, watched = np.arange(1, 13) / 4.0, np.geomspace(0.1, 4.0, 9)

    def slopes(omega: np.ndarray) -> np.ndarray:
        s = 1j * omega
        lag, mode = 1 / (s + 0.5), 1 / (s**2 + 0.3 * s + 2.0)
        return np.stack([lag, lag**2, mode, s * mode**2, mode**2], axis=1)

    return ExperimentDesign(slopes(lines), np.full(12, 0.1), slopes(watched), 1 / watched)


def state_records() -> StateRecords:
    """A plant with a pole at 1.1 and 30 samples with a little noise."""
    rng = np.random.default_rng(8)
    x, u, w = rng.standard_normal((2, 30)), rng.standard_normal((1, 30)), rng.random((2, 30)) - 0.5
    next_states = np.array([[1.1, 0.3], [0.0, 0.7]]) @ x + np.array([[0.2], [1.0]]) @ u + 0.2 * w
    return StateRecords(x, u, next_states, NoiseEnergy(0.3 * np.eye(2)))


def record_decay() -> Program:
    return FeedbackFromRecords(state_records())


def record_h2() -> Program:
    return FeedbackFromRecords(
        state_records(), criterion="h2", C=np.eye(3)[:, :2], D=np.eye(3)[:, 2:]
    )


def record_hinf() -> Program:
    return FeedbackFromRecords(
        state_records(), criterion="hinf", C=np.eye(3)[:, :2], D=np.eye(3)[:, 2:]
    )


PROGRAMS = {
    make.__name__: make
    for make in (
        circle, stadium, small_stadium, mu_upper_full, mu_upper_mixed, mu_upper_repeated,
        mu_lower_full,
        mu_lower_mixed, hinf, h2, mixed_norms, hinf_flexible, mu_synthesis, mu_synthesis_target,
        fault_filter,
        switching, response_fit,
        magnitude_fit, magnitude_cover, circle_cover, stadium_cover, crest_factor, state_space_fit,
        parameter_fit, matrix_sets, matrix_traces, matrix_cover, record_decay, record_h2,
        record_hinf, experiment_design,
    )
}  # fmt: skip


QUICK_METHODS = {"circle_cover": "steps", "stadium_cover": "steps", "matrix_cover": "steps"}
"""Methods that take the place of a slower default one."""


@cache
def solved(name: str) -> Solved:
    """The tight problem of that name and its certified answer, found once."""
    program = PROGRAMS[name]()
    solution = wb.solve(program, method=QUICK_METHODS.get(name))
    assert solution.certificate is not None, solution.message
    assert solution.certificate.valid, solution.certificate.failures
    return Solved(program, solution.answer)
