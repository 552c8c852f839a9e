"""Plants with hundreds of states: a small model, its proven error as uncertainty, a certificate."""

import control
import numpy as np
import pytest

import workbench as wb
from workbench.certify.norms import certified_norm
from workbench.structure import Full
from workbench.synthesis import MuSynthesis, approximate
from workbench.uncertainty import generalised_plant


def rod(modes):
    """The first modes of a rod, pushed at one place and measured at another."""
    omega = np.pi * np.arange(1, modes + 1)
    A = np.kron(np.diag(omega), [[0.0, 1.0], [-1.0, -0.02]])
    B = np.kron((2 * np.sin(0.3 * omega) / omega)[:, None], [[0.0], [1.0]])
    return control.ss(A, B, np.kron(np.sin(0.4 * omega), [[1.0, 0.0]]), 0)


def controlled(G, error=None):
    """Disturbance at the input and noise, to position and effort; with an additive error."""
    q = "" if error is None else " + q"
    parts = [(G, "v", "x"), (0.1, "u", "effort"), (0.1, "s", "z")]
    parts += [] if error is None else [(error, "v", "p")]
    return generalised_plant(
        parts,
        {"v": "u + d", "s": f"x{q}", "y": f"x{q} + n"},
        perturbation=[] if error is None else [(Full(1, 1), "p", "q")],
        exogenous=["d", "n"],
        performance=["z", "effort"],
        control="u",
        measurement="y",
    )


@pytest.mark.cases(0)
@pytest.mark.parametrize(
    ("modes", "order"), [(20, 12), pytest.param(300, 12, marks=pytest.mark.slow)]
)
def test_a_controller_of_the_small_model_is_certified_for_the_large_plant(modes, order):
    large = rod(modes)
    small = approximate(large, order, method="balanced")
    omega = np.concatenate([np.linspace(1, 200, 4000), np.pi * np.arange(1, modes + 1)])
    apart = np.abs(large(1j * omega) - small(1j * omega)).max()
    assert apart <= small.error <= 1.5 * apart
    solution = wb.solve(MuSynthesis(controlled(small, small.error)), method="dk")
    assert solution.certificate.holds
    assert solution.answer.upper < 1
    # the large plant is within the error, so that its own loop is below the peak
    assert certified_norm(controlled(large).close(solution.answer.K)) <= solution.answer.upper
