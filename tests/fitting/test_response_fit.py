"""The program of response fits: its input, checks, dataset and figures, and the public function."""

import numpy as np
import pytest

import workbench.fitting.response.best
import workbench.fitting.response.conic  # noqa: F401  registers the methods
from workbench.bench.formats import netcdf
from workbench.errors import InputError, SolverError
from workbench.fitting.rational import Rational
from workbench.fitting.response.program import ResponseFit, fit_response
from workbench.solution import solve
from workbench.solvers import Options, Outcome

OMEGA = np.geomspace(0.1, 1e3, 60)
TRUTH = Rational([-40.0], [-2 + 30j, -2 - 30j, -5.0], 7.0)
RESPONSE = TRUTH.response(OMEGA)
PROGRAM = ResponseFit(OMEGA, RESPONSE, 3)


def changed(values, place, value):
    values = values.copy()
    values[place] = value
    return values


# --- input ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"omega": OMEGA[::-1]}, r"must rise.*entry 1"),
        ({"omega": changed(OMEGA, 7, OMEGA[6])}, r"must rise.*entry 7"),
        ({"omega": changed(OMEGA, 0, 0.0)}, "positive and finite.*entry 0 is 0.0"),
        ({"omega": changed(OMEGA, 59, np.nan)}, "positive and finite.*entry 59 is nan"),
        ({"omega": OMEGA[None]}, r"shape \(F,\)"),
        ({"omega": []}, r"shape \(F,\)"),
        ({"omega": OMEGA * 1j}, "omega must hold real numbers, not complex128"),
        ({"response": RESPONSE[1:]}, r"response has shape \(59,\)"),
        ({"response": changed(RESPONSE, 3, np.inf)}, r"finite; entry 3 .* rad/s"),
        ({"response": ["a"] * 60}, "response must hold numbers"),
        ({"response": changed(RESPONSE, 0, 0)}, r"relative error.*entry 0 is 0j \(at 0.1 rad/s\)"),
        ({"weight": OMEGA[1:]}, r"weight has shape \(59,\)"),
        ({"weight": changed(OMEGA, 4, -1.0)}, "not negative; entry 4 is -1.0"),
        ({"weight": changed(OMEGA, 4, np.nan)}, "not negative; entry 4 is nan"),
        ({"weight": 0 * OMEGA}, "every weight is zero"),
        ({"weight": RESPONSE}, "weight must hold real numbers"),
        ({"order": -1}, "order must be a whole number, 0 or more, not -1"),
        ({"order": 2.5}, "not 2.5"),
        ({"order": True}, "not True"),
        ({"zeros": 4}, "zeros is 4; at most the order, 3"),
        ({"zeros": -1}, "zeros must be a whole number"),
        ({"error": 0.0}, "error must be positive"),
        ({"order": 60}, "60 responses .* are 120 real numbers, but order 60 .* 121 coefficients"),
        ({"weight": np.arange(60) < 3}, "weight must hold real numbers, not bool"),
        ({"weight": np.where(np.arange(60) < 3, 1.0, 0.0)}, "3 responses .* 7 coefficients"),
    ],
)
def test_bad_input_is_named(keywords, words):
    given = {"omega": OMEGA, "response": RESPONSE, "order": 3} | keywords
    with pytest.raises(InputError, match=words):
        ResponseFit(**given)


# --- checks ---------------------------------------------------------------------------------------


def failures(program, answer):
    return " ".join(program.certify(answer, 1e-6).failures)


def test_the_truth_holds():
    assert failures(PROGRAM, TRUTH) == ""
    assert PROGRAM.metrics(TRUTH)["error_worst"] < 1e-14
    assert PROGRAM.metrics(TRUTH)["order"] == 3


def test_wrong_answers_fail():
    poles, zeros = TRUTH.poles, TRUTH.zeros
    assert "order: 4" in failures(PROGRAM, Rational(zeros, [*poles, -1.0], 1.0))
    few = ResponseFit(OMEGA, RESPONSE, 3, zeros=0)
    assert "zeros: 1 exceeds 0" in failures(few, TRUTH)
    assert "stable: 2" in failures(PROGRAM, Rational(zeros, -poles * [-1, 1, 1], 1.0))
    assert "stable: 1" in failures(PROGRAM, Rational(zeros, [*poles[1:], 0.0], 1.0))
    assert failures(ResponseFit(OMEGA, RESPONSE, 3, stable=False), Rational(zeros, -poles, 1)) == ""
    right = Rational([40.0], poles, 1.0)
    assert failures(PROGRAM, right) == ""
    phase = ResponseFit(OMEGA, RESPONSE, 3, minimum_phase=True)
    assert "minimum phase: 1 exceeds 0 the first at 40" in failures(phase, right)
    on_grid = Rational([], [1j * OMEGA[9], -1j * OMEGA[9]], 1.0)
    free = ResponseFit(OMEGA, RESPONSE, 3, stable=False)
    assert f"at {OMEGA[9]:.6g} rad/s" in failures(free, on_grid)  # infinite there


def test_an_error_asked_for_is_checked():
    program = ResponseFit(OMEGA, RESPONSE, 1, error=1e-3)
    assert "error: " in failures(program, Rational([], [-5.0], 1.0))
    assert solve(program).outcome is Outcome.FAILED


def test_error_is_weighted_as_documented():
    weight = np.linspace(0, 2, OMEGA.size)
    program = ResponseFit(OMEGA, RESPONSE, 3, weight=weight)
    off = TRUTH.scaled(1.01)
    assert program.metrics(off)["error_worst"] == pytest.approx(
        np.max(weight * 0.01 * np.abs(RESPONSE))
    )
    assert PROGRAM.metrics(off)["error_worst"] == pytest.approx(0.01)
    assert PROGRAM.metrics(off)["error_rms"] == pytest.approx(0.01)


# --- dataset and figures --------------------------------------------------------------------------


def test_dataset_round_trip(tmp_path):
    for answer in (TRUTH, Rational([], [-1.0], 2.0), Rational([], [], 2.0)):
        netcdf.write(PROGRAM.to_dataset(answer), tmp_path / "data.nc")
        read = PROGRAM.from_dataset(netcdf.read(tmp_path / "data.nc"))
        assert np.array_equal(read.zeros, answer.zeros)
        assert np.array_equal(read.poles, answer.poles)
        assert read.gain == answer.gain


@pytest.mark.parametrize("answer", [TRUTH, TRUTH.scaled(-1.1)])
def test_figures(answer):
    weight = np.where(OMEGA > 1, 1.0, 0.0)
    drawn = ResponseFit(OMEGA, RESPONSE, 3, weight=weight).figures(answer)
    assert set(drawn) == {"bode", "nyquist"}
    panels = drawn["bode"].axes
    assert [panel.get_ylabel() for panel in panels] == [
        "magnitude [1]",
        "phase [deg]",
        "weighted error [1]",
    ]
    phases = [line.get_ydata() for line in panels[1].lines]
    assert abs(phases[0][0] - phases[1][0]) < 181  # on one sheet


# --- the function ---------------------------------------------------------------------------------


def test_fit_response_is_a_state_space_system():
    system = fit_response(OMEGA, RESPONSE, order=3, zeros=1)
    assert system.nstates == 3
    assert np.allclose(system(1j * OMEGA), RESPONSE, rtol=1e-9)


def test_fit_response_finds_the_order():
    assert fit_response(OMEGA, RESPONSE, error=1e-6).nstates == 3
    assert fit_response(OMEGA, RESPONSE, error=1e-6, zeros=1).nstates == 3
    assert fit_response(OMEGA, RESPONSE, error=1e9).nstates == 0


def test_fit_response_says_what_it_reached():
    with pytest.raises(SolverError, match=r"error: .* exceeds 1e-06.*; best: .* at order 2"):
        fit_response(OMEGA, RESPONSE, order=2, error=1e-6)
    omega = OMEGA[:4]  # not enough data for more than order 3
    delayed = np.exp(-1j * np.array([0.0, 3.0, 1.0, 2.0]))
    with pytest.raises(SolverError, match=r"best: .* at order [0-3]"):
        fit_response(omega, delayed, error=1e-9, method="vector-fitting")


def test_fit_response_needs_an_order_or_an_error():
    with pytest.raises(InputError, match="neither order nor error"):
        fit_response(OMEGA, RESPONSE)


def test_time_limit_is_kept():
    program = ResponseFit(OMEGA, RESPONSE, 3)
    assert solve(program, options=Options(time_limit=1e-9)).outcome is Outcome.TIME_LIMIT


def test_zeros_at_infinity_leave_an_accurate_system():
    slow = Rational([], [-2 + 30j, -2 - 30j, -5.0, -400.0], 7.0)
    system = fit_response(OMEGA, slow.response(OMEGA), order=4, minimum_phase=True)
    assert np.allclose(system(1j * OMEGA), slow.response(OMEGA), rtol=1e-6)
    assert system.poles().real.max() < 0
