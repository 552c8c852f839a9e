"""Records whose samples are missing one by one, labels that disagree, outputs that have settled."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.signal import lfilter

import workbench as wb
from workbench.errors import InputError
from workbench.identification import ClosedLoopFit, StateSpaceFit, as_experiments

B, A = [0, 0.12, -0.05, 0.03], [1, -2.1, 1.65, -0.48]
AT = np.array([0.003, 0.02, 0.07, 0.2])


def exact(delay=0):
    z = np.exp(-2j * np.pi * AT)
    return np.polyval(B[::-1], z) / np.polyval(A[::-1], z) * z**delay


def recorded(samples=600):
    rng = np.random.default_rng(11)
    u = rng.standard_normal(samples)
    return u, lfilter(B, A, u) + 0.01 * rng.standard_normal(samples), rng


def error_of(solution, delay=0):
    assert solution.certificate.valid
    found = solution.answer.simulator.response(AT)[:, 0, 0]
    return np.max(np.abs(found - exact(delay))) / np.max(np.abs(exact()))


@pytest.mark.parametrize("pattern", ["a fifth", "every third", "every second"])
def test_single_missing_samples(pattern):
    u, y, rng = recorded()
    if pattern == "a fifth":
        y[rng.random(len(y)) < 0.2] = np.nan
    else:
        y[1 :: {"every third": 3, "every second": 2}[pattern]] = np.nan
    assert error_of(wb.solve(StateSpaceFit(u, y, orders=[3]))) < 0.02


@pytest.mark.cases(0)
def test_projections_and_the_choice_of_kinds_with_gaps():
    u, y, rng = recorded()
    y[rng.random(len(y)) < 0.2] = np.nan
    for method in ("cva", "best"):
        assert error_of(wb.solve(StateSpaceFit(u, y, orders=[3]), method=method)) < 0.03


def test_a_delay_is_estimated_across_gaps():
    u, y, rng = recorded()
    late = np.r_[np.zeros(9), y[:-9]]
    late[rng.random(len(y)) < 0.2] = np.nan
    solution = wb.solve(StateSpaceFit(u, late, orders=[3, 4], delay_samples="estimate"))
    # one sample more than was put before the plant
    assert solution.answer.simulator.delay_samples == (10,)
    assert error_of(solution, 9) < 0.03


def test_an_output_that_is_not_measured_where_it_judges_is_refused():
    u, y, _ = recorded()
    y[420:] = np.nan
    with pytest.raises(InputError, match="0 measured samples in the part of the record that judg"):
        StateSpaceFit(u, y)
    y[:] = lfilter(B, A, u)
    y[:250] = np.nan
    with pytest.raises(InputError, match=r"0 measured samples .* is estimated from"):
        StateSpaceFit(u, y, estimation=250)


@pytest.mark.parametrize("start", [0, 30])
def test_a_step_without_noise_that_has_settled(start):
    u = np.r_[np.zeros(start), np.ones(200 - start)]
    assert error_of(wb.solve(StateSpaceFit(u, lfilter(B, A, u)))) < 1e-9


def test_the_unit_of_time_is_read():
    u, y, _ = recorded(20)
    time = ("time", 20.0 * np.arange(20), {"units": "ms"})
    one, other = (xr.DataArray(x, dims="time", coords={"time": time}) for x in (u, y))
    assert as_experiments(one, other).dt == pytest.approx(0.02)
    one["time"].attrs["units"] = "fathom"
    with pytest.raises(InputError, match="the instants of u: 'fathom' cannot be converted to 's'"):
        as_experiments(one, other)


def test_labels_of_other_instants_are_refused():
    u, y, _ = recorded(20)
    dates = pd.date_range("2024-01-01", periods=20, freq="20ms")
    for index, later in ((dates, pd.Timedelta("1s")), (0.02 * np.arange(20), 1.0)):
        with pytest.raises(InputError, match="y begins 1 s after u"):
            as_experiments(pd.Series(u, index=index), pd.Series(y, index=index + later))


def test_masked_samples_are_missing():
    u, y, _ = recorded(20)
    assert as_experiments(u, np.ma.masked_array(y, np.arange(20) == 5)).missing == 1


def test_methods_of_stable_plants_say_so():
    rng = np.random.default_rng(0)
    r, noise = rng.standard_normal((2, 400))
    u, y = np.zeros(400), np.zeros(400)
    for n in range(400):
        y[n] = 1.1 * y[n - 1] + 0.2 * u[n - 1] + 0.01 * noise[n] if n else 0.0
        u[n] = r[n] - 2 * y[n]
    loop = ClosedLoopFit(u, y, orders=(1,), direct=False, excitation=r, poles="any")
    with pytest.raises(InputError, match="its models are stable"):
        wb.solve(loop, method="two-stage")
    found = wb.solve(loop, method="direct").answer.simulator
    assert found.A[0, 0] == pytest.approx(1.1, abs=0.02)


def test_a_long_delay_is_estimated():
    u, y, _ = recorded(900)
    assert StateSpaceFit(
        u, np.r_[np.zeros(40), y[:-40]], delay_samples="estimate"
    ).delays_samples == (41,)
