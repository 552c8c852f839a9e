"""The records that people try first: each gets its model, and what is uncertain is said."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.signal import dlsim

from workbench import solve
from workbench.errors import InputError
from workbench.identification import StateSpaceFit
from workbench.identification.experiments.several import as_experiments

N = 2000
A = 0.95 * np.array([[0.9, 0.3], [-0.3, 0.8]])
B, C, D = np.array([[1.0], [0.5]]), np.array([[1.0, -0.5]]), np.zeros((1, 1))
POLES = np.sort_complex(np.linalg.eigvals(A))


def response(u, matrices=(A, B, C, D)):
    return dlsim((*matrices, 1.0), u)[1]


def drive(samples=N, seed=0):
    return np.random.default_rng(seed).standard_normal((samples, 1))


def noise(like, size, seed=1):
    return size * np.random.default_rng(seed).standard_normal(like.shape)


def modelled(u, y, **options):
    program = StateSpaceFit(u, y, **options)
    solution = solve(program)
    assert solution.certificate is not None, solution.message
    assert solution.certificate.holds, solution.certificate.failures
    return program, solution


def assert_poles(model, poles=POLES, atol=1e-6):
    found = np.linalg.eigvals(model.A)
    for pole in poles:
        assert np.abs(found - pole).min() < atol


@pytest.mark.cases(1)
@pytest.mark.parametrize("size", [0.0, 1e-6, 0.1])
def test_any_noise(size):
    u = drive()
    y = response(u)
    program, solution = modelled(u, y + noise(y, size))
    assert solution.answer.simulator.order == 2
    assert_poles(solution.answer.simulator, atol=1e-6 + 0.05 * size)
    assert program.metrics(solution.answer)["fit_free_run_y1"] > 100 - 60 * size - 1e-6


@pytest.mark.cases(0)
@pytest.mark.parametrize("radius", [0.9995, 0.99999, 1.0])
def test_a_lightly_damped_plant(radius):
    turn = np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]])
    u = drive()
    y = response(u, (radius * turn, B, C, D))
    program, solution = modelled(u, y + noise(y, 0.1))
    assert program.metrics(solution.answer)["fit_free_run_y1"] > 98
    assert solution.answer.simulator.radius == pytest.approx(radius, abs=2e-4)


@pytest.mark.cases(1)
@pytest.mark.parametrize("start", [0, 20, 500])
def test_a_step(start):
    u = np.zeros((N, 1))
    u[start:] = 1.0
    y = response(u) + 3.0
    program, solution = modelled(u, y + noise(y, 0.01))
    model = solution.answer.simulator
    gain = float(np.real(model.response([1e-9])[0, 0, 0]))
    assert gain == pytest.approx(float((C @ np.linalg.solve(np.eye(2) - A, B))[0, 0]), rel=0.01)
    facts = " ".join(solution.certificate.facts)
    assert "+-" in facts
    assert ("stepped from zero" in facts) == (start == 0)
    run = model.free_run(u, y, program.washout_samples)
    assert np.abs(run - y).max() < 0.2


@pytest.mark.cases(0)
def test_an_integrator_is_found():
    u = drive()
    y = 0.1 * np.vstack([[[0.0]], np.cumsum(u, axis=0)[:-1]])
    _, solution = modelled(u, y + noise(y, 0.1))
    assert solution.answer.simulator.radius == pytest.approx(1.0, abs=1e-4)
    assert "may lie on the unit circle" in " ".join(solution.certificate.facts)


def test_an_integrator_with_an_input_offset_drifts():
    u = drive() + 0.3
    y = 0.1 * np.vstack([[[0.0]], np.cumsum(u - 0.1, axis=0)[:-1]])
    program, solution = modelled(u, y + noise(y, 0.1), orders=(1,))
    assert solution.answer.simulator.u_offset == pytest.approx([0.1], abs=0.01)
    assert program.metrics(solution.answer)["fit_free_run_y1"] > 95


@pytest.mark.cases(0)
def test_experiments_of_different_length():
    lengths = (600, 150, 40, 900)
    us = [drive(length, seed) for seed, length in enumerate(lengths)]
    ys = [response(u) + noise(u, 0.05, seed + 9) + 2.0 for seed, u in enumerate(us)]
    program, solution = modelled(us, ys)
    assert program.record.starts == (0, 600, 750, 790)
    assert_poles(solution.answer.simulator, atol=5e-3)
    assert any("4 experiments" in fact for fact in solution.certificate.facts)
    back = program.from_dataset(program.to_dataset(solution.answer))
    assert program.metrics(back) == program.metrics(solution.answer)


@pytest.mark.cases(0)
def test_missing_samples():
    u = drive()
    y = response(u) + noise(u, 0.05)
    gaps = np.random.default_rng(4).random(N) < 0.03
    y[gaps] = np.nan
    u[1000] = np.nan
    program, solution = modelled(u, y)
    assert program.record.starts == (0, 1000)
    assert_poles(solution.answer.simulator, atol=1e-2)
    assert any("missing" in fact for fact in solution.certificate.facts)


@pytest.mark.cases(0)
@pytest.mark.parametrize("size", [0.0, 0.1])
def test_delays(size):
    u = np.random.default_rng(3).standard_normal((N, 2))
    late = np.column_stack([np.roll(u[:, 0], 7), np.roll(u[:, 1], 3)])
    y = dlsim((A, np.eye(2), C, np.zeros((1, 2)), 1.0), late)[1][20:]
    u = u[20:]
    program, solution = modelled(u, y + noise(y, size), delay_samples="estimate")
    assert program.delays_samples == (8, 4)  # one sample of which is that of the plant, without D
    system = solution.answer.simulator.system()
    assert system.nstates == solution.answer.simulator.order + 12
    f = np.array([0.03, 0.2])
    own = solution.answer.simulator.response(f)
    np.testing.assert_allclose(
        np.moveaxis(system(np.exp(2j * np.pi * f)), 2, 0), own, rtol=1e-9, atol=1e-9
    )
    stated = StateSpaceFit(u, y, delay_samples=(7, 3))
    assert stated.delays_samples == (7, 3)


@pytest.mark.cases(0)
def test_without_a_direct_term():
    u = drive()
    y = response(u) + noise(u, 0.1)
    _, solution = modelled(u, y, direct=False)
    assert not solution.answer.simulator.D.any() and not solution.answer.predictor.D.any()


def test_an_unstable_plant_in_a_closed_loop():
    rng = np.random.default_rng(5)
    x, u, y = 0.0, np.zeros((N, 1)), np.zeros((N, 1))
    for t in range(N):
        y[t] = x + 0.1 * rng.standard_normal()
        u[t] = rng.standard_normal() - 0.5 * y[t, 0]
        x = 1.1 * x + u[t, 0]
    _, solution = modelled(u, y, direct=False, poles="any", assume="open loop")
    assert_poles(solution.answer.predictor, (1.1,), atol=0.01)


def test_short_records():
    u = drive(60)
    y = response(u) + noise(u, 0.01)
    program, _ = modelled(u, y)
    assert 2 in program.orders


@pytest.mark.cases(0)
def test_single_precision_and_units_do_not_matter():
    u = drive()
    y = response(u) + noise(u, 0.1)
    both = np.column_stack([y, 2 * y + noise(y, 0.1, 7)])
    plain = solve(StateSpaceFit(u, both, orders=(2,))).answer.simulator
    far = solve(StateSpaceFit(1e6 * u, both * [1e-6, 1e6], orders=(2,))).answer.simulator
    f = np.linspace(0.01, 0.49, 20)
    expected = plain.response(f) * np.array([[1e-12], [1.0]])
    np.testing.assert_allclose(far.response(f), expected, rtol=1e-5)
    single = solve(StateSpaceFit(u.astype("f4"), y.astype("f4"), orders=(2,))).answer.simulator
    assert_poles(single, atol=1e-2)


def test_shapes_and_labels_are_recognised():
    u = drive(400)
    y = response(u) + noise(u, 0.1)
    both = np.column_stack([y, -y])
    expected = as_experiments(u, both)
    index = pd.Index(np.arange(400) * 0.01, name="time")
    labelled = xr.Dataset(
        {"u": (("input", "time"), u.T, {"units": "V"}), "y": (("time", "output"), both)},
        coords={"time": index.to_numpy(), "input": ["force"], "output": ["x", "phi"]},
    )
    tables = pd.DataFrame(u, index, ["force"]), pd.DataFrame(both, index, ["x", "phi"])
    for given in (
        (u[:, 0], both.T), (u.T, both), (u[:, 0].tolist(), both.tolist()), (labelled, None), tables,
    ):  # fmt: skip
        found = as_experiments(*given)
        np.testing.assert_array_equal(found.u, expected.u)
        np.testing.assert_array_equal(found.y, expected.y)
    for given in ((labelled, None), tables):
        program = StateSpaceFit(*given, orders=(2,))
        system = solve(program, method="subspace").answer.lti
        assert system.dt == pytest.approx(0.01)
        assert system.input_labels == ["force"] and system.output_labels == ["x", "phi"]
        model = solve(program, method="subspace").answer.predictor.system()
        assert model.dt == pytest.approx(0.01)
    assert as_experiments(labelled, None).input_units == ("V",)
    times = pd.date_range("2024-01-01", periods=400, freq="10ms")
    assert as_experiments(pd.Series(u[:, 0], times), pd.DataFrame(both, times)).dt == pytest.approx(
        0.01
    )
    square = np.random.default_rng(0).standard_normal((2, 8, 8))
    with pytest.raises(InputError, match='samples="rows"'):
        as_experiments(*square)
    np.testing.assert_array_equal(as_experiments(*square, samples="columns").u, square[0].T)


@pytest.mark.cases(0)
def test_held_out_arrays_do_not_hang_on_how_they_were_given():
    u = drive(500)
    y = response(u) + noise(u, 0.1)
    one, other = (solve(StateSpaceFit(*pair)).answer for pair in ((u, y), (u[:, 0], y.T)))
    np.testing.assert_array_equal(one.simulator.A, other.simulator.A)
