"""Parameter fits by differential evolution, beside those that follow derivatives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_parameter_fit import START, TRUTH, exact, response

from workbench.errors import InputError
from workbench.identification import FittedParameter, MeasuredResponse, ParameterFit
from workbench.solution import solve
from workbench.solvers import Options, Outcome


@pytest.mark.cases(0)
@settings(max_examples=3, deadline=None)
@given(seed=st.integers(0, 1000))
def test_it_finds_what_derivatives_find_whatever_the_seed(seed):
    program = ParameterFit([response()], START)
    found = solve(program, method="evolution", options=Options(seed=seed))
    assert found.certificate.failures == ()
    assert found.outcome is Outcome.SOLVED
    np.testing.assert_allclose(found.answer, solve(program, method="ipopt").answer, rtol=1e-5)


def test_it_needs_no_start_near_the_least_of_several_minima():
    """The error of a delay has a minimum for every period; from this start IPOPT keeps to one."""

    def delay(p, s):
        return np.exp(-s * p["delay"])

    frequency = np.linspace(1, 5, 80)
    datum = MeasuredResponse(
        delay, frequency, exact(delay, {"delay": 1.3}, frequency), variance=1e-4
    )
    program = ParameterFit([datum], {"delay": FittedParameter(0.1, lower=0.05, upper=2.0)})
    assert solve(program, method="ipopt").answer[0] != pytest.approx(1.3, rel=1e-3)
    found = solve(program, method="evolution")
    assert found.certificate.valid
    assert found.answer[0] == pytest.approx(1.3, rel=1e-7)


def test_a_bound_that_is_active_is_kept():
    low = START | {"gain": FittedParameter(1.0, lower=0.0, upper=2.5)}
    found = solve(ParameterFit([response()], low), method="evolution")
    assert found.certificate.valid
    assert found.answer[2] == pytest.approx(2.5, abs=1e-9) and found.answer[2] <= 2.5
    near = solve(ParameterFit([response()], low), method="scipy").answer
    np.testing.assert_allclose(found.answer, near, rtol=1e-5)


@pytest.mark.cases(0)
def test_data_that_fit_but_for_rounding_end_the_search():
    found = solve(ParameterFit([response(size=1e-12)], START), method="evolution")
    assert found.outcome is Outcome.SOLVED
    np.testing.assert_allclose(found.answer, list(TRUTH.values()), rtol=1e-8)


def test_a_missing_bound_is_named():
    program = ParameterFit([response()], START | {"gain": FittedParameter(1.0)})
    with pytest.raises(InputError, match="finite bounds, which gain lacks"):
        solve(program, method="evolution")


def test_the_time_limit_ends_it_with_the_best_so_far():
    program = ParameterFit([response()], START)
    found = solve(program, method="evolution", options=Options(time_limit=0.03))
    assert found.claim is Outcome.TIME_LIMIT
    assert found.answer is not None and "best so far" in found.message
