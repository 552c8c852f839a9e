"""What a record leaves uncertain of a regularised impulse response."""

import numpy as np
import pytest
from scipy.signal import lfilter

import workbench as wb
from workbench.errors import InputError
from workbench.identification import (
    StateSpaceFit,
    as_experiments,
    impulse_response,
    impulse_response_deviations,
)

B, A = [0, 0.12, -0.05, 0.03], [1, -2.1, 1.65, -0.48]
AT = np.array([0.001, 0.01, 0.03, 0.2, 0.4])


def recorded(seed, samples=600, noise=0.1):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(samples)
    return u, lfilter(B, A, u) + noise * rng.standard_normal(samples)


def exact(frequency):
    z = np.exp(-2j * np.pi * frequency)
    return np.polyval(B[::-1], z) / np.polyval(A[::-1], z)


@pytest.mark.cases(0)
def test_errors_are_as_large_as_they_say():
    errors, deviations = [], []
    for seed in range(40):
        record = as_experiments(*recorded(seed))
        errors.append(np.abs(impulse_response(record).response(AT)[:, 0, 0] - exact(AT)))
        deviations.append(impulse_response_deviations(record, AT)[:, 0, 0])
    ratio = np.sqrt(np.mean(np.square(errors), axis=0) / np.mean(np.square(deviations), axis=0))
    assert (ratio > 0.75).all()
    assert (ratio < 1.35).all()


def test_they_follow_the_units_and_do_not_see_a_delay():
    u, y = recorded(1)
    late = np.r_[np.zeros(4), y[:-4]]
    both = np.column_stack([late, np.roll(late, 3)])
    plain = impulse_response_deviations(as_experiments(u, both), AT, delay_samples=(4,))
    scaled = impulse_response_deviations(
        as_experiments(1e6 * u, 1e-3 * both), AT, delay_samples=(4,)
    )
    np.testing.assert_allclose(scaled, 1e-9 * plain, rtol=1e-6)
    assert plain.shape == (5, 2, 1)


def test_a_record_that_tells_nothing_more_leaves_the_prior():
    u, y = recorded(2)
    long, short = (
        impulse_response_deviations(as_experiments(u[:n], y[:n]), AT).max() for n in (600, 150)
    )
    assert long < short
    with pytest.raises(InputError, match="3 samples are too few for impulse responses"):
        impulse_response_deviations(as_experiments(u[:3], y[:3]), AT)


def test_a_fit_tells_them():
    u, y = recorded(3)
    program = StateSpaceFit(u, y)
    answer = wb.solve(program, method="impulse-response").answer
    found = program.deviations(answer, AT)[:, 0, 0]
    assert (found > 0).all()
    assert (found <= impulse_response_deviations(program.estimation_record, AT)[:, 0, 0]).all()
    gain, deviation = np.sum(B) / np.sum(A), found[0]
    told = next(fact for fact in program.facts(answer) if fact.startswith("simulator: static"))
    assert abs(float(told.split()[7]) - gain) < 4 * deviation
