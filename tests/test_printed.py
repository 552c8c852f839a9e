"""What people print: a few lines with the numbers that matter, and no arrays."""

import control
import numpy as np
import pytest

import workbench as wb
from workbench.synthesis import HinfSynthesis, Implementation, MuSynthesis
from workbench.systems.realisation import in_words
from workbench.uncertainty import CircleCover, Responses, generalised_plant

OMEGA = np.geomspace(1.0, 1e3, 40)


@pytest.fixture(scope="module")
def way():
    """Responses, cover, plant, designs and board of four plants."""
    gain = 1 + 0.1 * np.random.default_rng(1).uniform(-1, 1, 4)
    responses = Responses(omega=OMEGA, values=gain * 10 / (1j * OMEGA[:, None] + 5), unit="m/N")
    cover = wb.solve(CircleCover(responses, 1, zeros=0, complex_order=1), method="steps")
    W_e = control.tf([0.5, 4], [1, 0.04])
    plant = generalised_plant(
        [cover, (W_e, "e", "z")],
        {"e": "r - f"},
        exogenous="r",
        control="u",
        performance="z",
        measurement="e",
    )
    design = wb.solve(MuSynthesis(plant), method="dk")
    board = wb.solve(Implementation(cover, design, 0.002, precision="float"))
    hinf = wb.solve(HinfSynthesis(plant))
    return {"responses": responses, "cover": cover, "mu": design, "board": board, "hinf": hinf}


def test_each_prints_a_few_lines_and_what_matters(way):
    upper = way["mu"].answer.upper
    for name, wanted in {
        "responses": ["4 plants", "40 frequencies", "Hz", "m/N"],
        "cover": ["Solution: solved", "radius up to", "nominal of order 1", "checks hold"],
        "mu": ["peak of mu from", f"{upper:.4g}", "stable itself", "fastest pole"],
        "board": ["mu of the set at most", "bytes a sample", "phase"],
        "hinf": ["norm", "order"],
    }.items():
        text = repr(way[name])
        assert all(part in text for part in wanted), text
        assert len(text.splitlines()) <= 8 and len(text) < 900, text
        assert "array(" not in text


def test_a_failure_prints_its_reason(way):
    text = repr(wb.Solution(None, wb.Outcome.FAILED, "no controller was found " * 40, None))
    assert text.startswith("Solution: failed (no controller was found") and len(text) < 260


def test_a_system_in_words():
    assert in_words(control.ss(-2.0, 1, 1, 0)) == "order 1, stable itself, fastest pole 2 rad/s"
    assert in_words(control.ss(0.5, 1, 1, 0, 0.1)).startswith("order 1, stable itself")
    assert "UNSTABLE" in in_words(control.ss(1.5, 1, 1, 0, 0.1))
    assert in_words(control.ss([], [], [], 3.0)) == "order 0, stable itself"


S = control.tf("s")


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("G", "said"),
    [
        (1e9 / (1e-6 * S), "with an integrator"),
        ((S + 1) / (S * (S + 10)), "with an integrator, stable otherwise"),
        (1 / (S**2 * (S + 3)), "with 2 integrators, stable otherwise"),
        (1 / (S * (S - 1)), "with an integrator, UNSTABLE otherwise"),
        (1 / (S**2 + 4), "with undamped poles at 2 rad/s"),
        (1 / (S * (S**2 + 4)), "with an integrator and undamped poles at 2 rad/s"),
        (1 / (S * (S + 1) * (S + 1e6)), "with an integrator, stable otherwise"),
        (1 / (S + 1e-9), "stable itself"),
        (1 / ((S + 1) * (S - 1e-7)), "UNSTABLE itself"),
    ],
)
def test_an_integrator_is_called_so(G, said, turned):
    """In triangular states, in full ones that round, and sampled (a pole at 1)."""
    K = control.ss(G)
    n = K.nstates
    if turned:
        T = np.linalg.qr(np.random.default_rng(0).normal(size=(n, n)))[0] + 0.1 * np.eye(n)
        K = control.ss(np.linalg.solve(T, K.A @ T), np.linalg.solve(T, K.B), K.C @ T, K.D)
    words = in_words(K).removeprefix(f"order {n}, ").split(", fastest")[0]
    assert words == said


@pytest.mark.parametrize(
    ("A", "said"),
    [
        ([[1.0]], "order 1, with an integrator"),
        ([[1.0, 1.0], [0.0, 0.5]], "order 2, with an integrator, stable otherwise"),
        ([[1.0, 0.0], [0.0, 1.5]], "order 2, with an integrator, UNSTABLE otherwise"),
        ([[0.0, 1.0], [-1.0, 0.0]], "order 2, with undamped poles at 15.71 rad/s"),
        ([[1.0 - 1e-9]], "order 1, stable itself"),
    ],
)
def test_integrators_of_sampled_systems(A, said):
    n = len(A)
    G = control.ss(A, np.ones((n, 1)), np.ones((1, n)), 0.0, 0.1)
    assert in_words(G).split(", fastest")[0] == said
