"""Inputs that act later: what they did before a record is not known."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench import solve
from workbench.identification import StateSpaceFit


@pytest.mark.cases(0)
@pytest.mark.parametrize("direct", [True, False])
@pytest.mark.parametrize("delay", [150, "estimate"])
def test_inputs_before_a_record_are_not_taken_as_known(delay, direct):
    """The plant runs already; with a long delay the first samples answer what was not recorded."""
    u, noise = np.random.default_rng(3).standard_normal((2, 2500))
    y = lfilter([0.0, 0.2], [1.0, -0.8], u)[350:2350] + 0.02 * noise[:2000]
    program = StateSpaceFit(u[500:], y, orders=(1,), delay_samples=delay, direct=direct)
    answer = solve(program).answer
    gain, deviation = np.abs(answer.simulator.response([0.0])), program.deviations(answer, [0.0])
    assert abs(gain - 1.0) < 4 * deviation < 0.05
    assert program.metrics(answer)["fit_free_run_y1"] > 90
