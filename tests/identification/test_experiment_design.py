"""Spectra for experiments: closed forms, the bound by duality, real estimates, wrong input."""

from dataclasses import replace

import numpy as np
import pytest

import workbench as wb
from workbench.errors import InputError
from workbench.identification import DesignedSpectrum, ExperimentDesign
from workbench.solvers import Outcome, conic_solvers

METHODS = (*(solver.name for solver in conic_solvers()), "ipopt")
LINES = 0.1 * np.arange(1, 31)
WATCHED = np.geomspace(0.05, 5.0, 25)


def slopes(omega):
    """Of 1 / (s^2 + 0.2 s + 1) with respect to its three coefficients."""
    s = 1j * omega
    G = 1 / (s**2 + 0.2 * s + 1)
    return np.stack([G, -s * G**2, -(G**2)], axis=1)


def oscillator(**changes):
    parts = {
        "slopes": slopes(LINES),
        "variance": np.full(LINES.size, 0.02),
        "watched": slopes(WATCHED),
        "cost": 1 / (0.3 + WATCHED**2),
    }
    return ExperimentDesign(**(parts | changes))


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", METHODS)
def test_methods_agree_and_close_the_gap(method):
    program = oscillator()
    solution = wb.solve(program, method=method)
    assert solution.outcome is Outcome.SOLVED, solution
    assert 0 <= solution.certificate.gap.value < 3e-4
    best = wb.solve(program, method="ipopt").answer.worst
    assert solution.answer.worst == pytest.approx(best, rel=1e-4)
    assert solution.metrics["worst_over_even"] < 0.5


@pytest.mark.parametrize("method", METHODS)
def test_two_gains_have_a_closed_form(method):
    """Of two gains, each known from a line of its own, the costs v c / (2 p) are made equal."""
    variance, cost = np.array([1.0, 4.0]), np.array([3.0, 0.5])
    program = ExperimentDesign(np.eye(2), variance, np.eye(2), cost)
    answer = wb.solve(program, method=method).answer
    share = variance * cost
    np.testing.assert_allclose(answer.power, share / share.sum(), rtol=1e-3)
    assert answer.worst == pytest.approx(share.sum() / 2, rel=1e-3)


def test_no_drawn_spectrum_beats_the_bound():
    program = oscillator()
    answer = wb.solve(program).answer
    bound = program.dual_bound(answer.power)
    rng = np.random.default_rng(0)
    for _ in range(300):
        power = rng.dirichlet(np.full(LINES.size, 0.1)) + 1e-6
        assert program.spectrum(power).worst >= bound
    mixed = [0.9 * answer.power + 0.1 * rng.dirichlet(np.ones(LINES.size)) for _ in range(100)]
    assert min(program.spectrum(power).worst for power in mixed) >= bound
    loose = program.dual_bound(program.even)  # a bound also from powers that are not the best
    assert 0 < loose <= bound * (1 + 1e-9)


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", METHODS)
def test_several_limits_hold(method):
    """No line may have more than a fifth of the power, and the output has a limit too."""
    output = np.abs(slopes(LINES)[:, 0]) ** 2
    uses = np.vstack([np.ones(30), 5 * np.eye(30), output / 8])
    program = oscillator(uses=uses)
    solution = wb.solve(program, method=method)
    assert solution.certificate.valid, solution
    assert solution.certificate.gap.value < 1e-3
    assert (uses @ solution.answer.power).max() <= 1 + 1e-9
    assert np.sum(solution.answer.power > 0.01) >= 5
    assert solution.answer.worst > wb.solve(oscillator()).answer.worst


@pytest.mark.cases(0)
def test_it_is_the_variance_of_estimates_in_noise():
    """Least squares on noisy responses, whose model is linear in the parameters."""
    program = oscillator()
    power = wb.solve(program).answer.power
    rng = np.random.default_rng(1)
    used = power > 1e-9
    deviation = np.sqrt(0.02 / power[used] / 2)
    noise = rng.standard_normal((2, 20_000, used.sum())) * deviation
    weight = 1 / deviation
    rows = program.slopes[used] * weight[:, None]
    left = np.linalg.pinv(np.concatenate([rows.real, rows.imag]))
    errors = np.concatenate([noise[0] * weight, noise[1] * weight], axis=1) @ left.T
    response = errors @ program.watched.T
    for k in range(WATCHED.size):
        parts = np.stack([response[:, k].real, response[:, k].imag])
        largest = np.linalg.eigvalsh(np.cov(parts))[-1] * program.cost[k]
        assert largest == pytest.approx(program.costs(power)[k], rel=0.06)


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", METHODS)
def test_units_make_no_difference(method):
    """Parameters, variances and costs in units from 1e-12 to 1e12."""
    units = np.array([1e-12, 1.0, 1e9])
    graded = oscillator(
        slopes=slopes(LINES) * units, watched=slopes(WATCHED) * units,
        variance=np.full(30, 0.02e-10), cost=1e12 / (0.3 + WATCHED**2),
    )  # fmt: skip
    plain, scaled = wb.solve(oscillator(), method=method), wb.solve(graded, method=method)
    assert scaled.certificate.valid, scaled
    np.testing.assert_allclose(scaled.answer.power, plain.answer.power, atol=1e-3)
    assert scaled.answer.worst == pytest.approx(100 * plain.answer.worst, rel=1e-4)


def test_an_answer_is_stored_and_drawn():
    program = oscillator()
    answer = wb.solve(program).answer
    again = program.from_dataset(program.to_dataset(answer))
    assert program.certify(again, 1e-6).valid
    assert set(program.figures(again)) == {"spectrum"}
    assert program.metrics(again)["lines_used"] <= 6


def test_wrong_answers_are_rejected():
    program = oscillator()
    answer = wb.solve(program).answer
    for wrong in (
        replace(answer, worst=0.99 * answer.worst),
        replace(answer, power=1.01 * answer.power),
        replace(answer, power=answer.power[:-1]),
        replace(answer, power=np.zeros(30)),
        DesignedSpectrum(program.even, answer.worst),
    ):
        assert not program.certify(wrong, 1e-6).valid
    cheaper = replace(answer, worst=0.99 * answer.worst)
    assert not all(check.holds for check in program.checks(cheaper, 1e-6))  # not by an opinion only
    assert program.dual_bound(np.zeros(30)) == 0.0


REFUSED = {
    r"\(K, P\) and": {"watched": slopes(WATCHED)[:, :2]},
    "are needed": {"variance": np.ones(3)},
    "slopes must be finite": {"slopes": np.nan * slopes(LINES)},
    "variance must be positive": {"variance": np.zeros(30)},
    "cost must be positive": {"cost": -np.ones(25)},
    "each line must use some limit": {"uses": np.eye(30)[:3]},
    "do not tell all 3 parameters": {"slopes": slopes(np.full(30, 1.0))[:, [0, 1, 1]]},
    "no line tells parameter 1": {"slopes": slopes(LINES) * [1, 0, 1]},
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_cannot_be_answered_is_refused_by_name(message):
    with pytest.raises(InputError, match=message):
        oscillator(**REFUSED[message])


def test_one_line_does_not_tell_three_parameters():
    with pytest.raises(InputError, match="do not tell all 3"):
        ExperimentDesign(slopes(LINES[:1]), [0.1], slopes(WATCHED), np.ones(25))


def test_each_fault_is_refused_by_the_check_of_its_name():
    """By the kernel alone; least squares refuse them too."""
    program = oscillator()
    power = program.even
    answer = DesignedSpectrum(power, float(program.costs(power).max()))
    less = power.copy()
    less[3] = -1e-6
    wrong = {
        "limits": replace(answer, power=1.01 * power),
        "cost": replace(answer, worst=0.99 * answer.worst),
        "powers": replace(answer, power=less),
    }
    assert all(check.holds for check in program.checks(answer, 1e-6))
    for name, one in wrong.items():
        assert name in {check.name for check in program.checks(one, 1e-6) if not check.holds}
    assert {c.name for c in program.checks(wrong["limits"], 1e-6) if not c.holds} == {"limits"}
