"""Units belong to the model and its figures, which show how well a record determines a response."""

import numpy as np
import pytest
import xarray as xr
from scipy.signal import lfilter

import workbench as wb
from workbench.identification import ClosedLoopFit, StateSpaceFit, as_experiments
from workbench.identification.innovations.uncertainty import magnitude_deviations

B, A, AT = [0, 0.3, 0.1], [1, -1.2, 0.6], np.array([0.02, 0.1, 0.3])


def recorded(seed, samples=400):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(samples)
    return u, lfilter(B, A, u) + 0.1 * rng.standard_normal(samples)


@pytest.fixture(scope="module")
def solved():
    labels = {"dims": "time", "coords": {"time": 0.01 * np.arange(400)}}
    u, y = recorded(0)
    program = StateSpaceFit(
        xr.DataArray(u, name="force", attrs={"units": "N"}, **labels),
        xr.DataArray(y, name="speed", attrs={"units": "m/s"}, **labels),
        orders=[2],
    )
    return program, wb.solve(program, method="subspace").answer


def test_the_model_has_the_units_of_its_record(solved):
    program, answer = solved
    stored = program.from_dataset(program.to_dataset(answer))
    for model in (answer.predictor, answer.simulator, stored.simulator):
        assert (model.input_units, model.output_units) == (("N",), ("m/s",))


def test_figures_have_units_and_a_band(solved):
    program, answer = solved
    figures = program.figures(answer)
    panel = figures["response"].axes[0]
    assert panel.get_ylabel() == "magnitude, speed [m/s/N]"
    assert [band.get_label()[:14] for band in panel.collections] == ["its 95 % band "]
    assert figures["held-out"].axes[0].get_ylabel() == "speed [m/s]"


@pytest.mark.cases(0)
def test_a_band_holds_the_true_magnitude_as_often_as_it_says():
    z = np.exp(-2j * np.pi * AT)
    exact = np.abs(np.polyval(B[::-1], z) / np.polyval(A[::-1], z))
    held = []
    for seed in range(60):
        program = StateSpaceFit(*recorded(seed), orders=[2], estimation=300)
        model = wb.solve(program, method="output-error").answer.simulator
        spread = magnitude_deviations(model, program.estimation_record, AT)[:, 0, 0]
        held.append(np.abs(np.abs(model.response(AT)[:, 0, 0]) - exact) < 1.96 * spread)
    assert 0.88 < np.mean(held) < 0.99


def test_what_is_known_does_not_vary():
    record = as_experiments(*recorded(1))
    program = StateSpaceFit(*recorded(1), orders=[2], static_gain=1.0)
    model = wb.solve(program, method="output-error").answer.simulator
    spread = magnitude_deviations(model, record, [1e-6, 0.1], known=program.known)[:, 0, 0]
    assert spread[0] < 1e-6 < spread[1]


def test_a_loop_by_instruments_has_the_units_of_its_record():
    r = np.random.default_rng(0).standard_normal(400)
    y = lfilter([0, 0.2], [1, -0.6], r)  # the plant 0.2 / (z - 0.8) with u = r - y
    u, y = (
        xr.DataArray(one, dims="time", attrs={"units": unit})
        for one, unit in ((r - y, "V"), (y, "rad/s"))
    )
    loop = ClosedLoopFit(u, y, orders=[1], direct=False, excitation=r)
    model = wb.solve(loop, method="instrumental-variables").answer.simulator
    assert (model.input_units, model.output_units) == (("V",), ("rad/s",))
    assert model.A[0, 0] == pytest.approx(0.8, abs=1e-6)
